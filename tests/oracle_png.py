"""PNG in plain Python, read from the specification: every kind written, every kind decoded to RGBA."""

import struct
import zlib
from collections.abc import Iterator, Sequence

import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGBA: 4}
KINDS = [
    *((GREY, depth) for depth in (1, 2, 4, 8, 16)), *((PALETTE, depth) for depth in (1, 2, 4, 8)),
    *((kind, depth) for kind in (RGB, GREY_ALPHA, RGBA) for depth in (8, 16)),
]  # fmt: skip
PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def header(width: int, height: int, depth: int, kind: int, *, interlaced: int = 0, methods: bytes = b"\0\0") -> bytes:
    return SIGNATURE + chunk(b"IHDR", struct.pack(">IIBB", width, height, depth, kind) + methods + bytes([interlaced]))


def chunks_of(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        yield data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        at += 12 + length


def joined(chunks: Sequence[tuple[bytes, bytes]]) -> bytes:
    return SIGNATURE + b"".join(chunk(*c) for c in chunks)


def passes_of(width: int, height: int, interlaced: bool) -> Iterator[tuple[slice, slice]]:
    for x, y, dx, dy in PASSES if interlaced else ((0, 0, 1, 1),):
        if x < width and y < height:
            yield slice(y, height, dy), slice(x, width, dx)


def paeth(a: int, b: int, c: int) -> int:
    p = a + b - c
    return min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]


def guess(kind: int, a: int, b: int, c: int) -> int:
    """What a filter expects of a byte with these at its left, above, and at the left above."""
    return (0, a, b, (a + b) // 2, paeth(a, b, c))[kind]


def packed(row: np.ndarray, depth: int) -> bytes:
    bits = (row.reshape(-1)[:, None].astype(np.int64) >> np.arange(depth)[::-1]) & 1
    return np.packbits(bits.astype(np.uint8).reshape(-1)).tobytes()


def stream(values: np.ndarray, depth: int, *, interlaced: bool = False, filters: Sequence[int] = (0,)) -> bytes:
    """Filtered rows of values (h, w, channels), not yet compressed; the filters take turns."""
    height, width, channels = values.shape
    step, out, number = max(1, channels * depth // 8), bytearray(), 0
    for rows, columns in passes_of(width, height, interlaced):
        part = values[rows, columns]
        above = bytes(len(packed(part[0], depth)))
        for line in part:
            row, kind = packed(line, depth), filters[number % len(filters)]
            left = lambda i, of: of[i - step] if i >= step else 0  # noqa: E731
            out.append(kind)
            out += bytes((row[i] - guess(kind, left(i, row), above[i], left(i, above))) & 255 for i in range(len(row)))
            above, number = row, number + 1
    return bytes(out)


def png(values: np.ndarray, depth: int, kind: int, *extra: bytes, interlaced: bool = False,
        filters: Sequence[int] = (0,)) -> bytes:  # fmt: skip
    height, width = values.shape[:2]
    body = chunk(b"IDAT", zlib.compress(stream(values, depth, interlaced=interlaced, filters=filters)))
    start = header(width, height, depth, kind, interlaced=int(interlaced))
    return start + b"".join(extra) + body + chunk(b"IEND", b"")


def values_of(data: bytes) -> tuple[np.ndarray, int, int, dict[bytes, bytes]]:
    """Values (h, w, channels) of a whole PNG, its depth and kind, and its chunks."""
    chunks: dict[bytes, bytes] = {}
    for name, body in chunks_of(data):
        chunks[name] = chunks.get(name, b"") + body
        if name == b"IEND":
            break
    width, height, depth, kind, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    raw = zlib.decompress(chunks[b"IDAT"])
    values = np.zeros((height, width, CHANNELS[kind]), np.int64)
    step, at = max(1, CHANNELS[kind] * depth // 8), 0
    for rows, columns in passes_of(width, height, bool(interlaced)):
        part = values[rows, columns]
        size = (part[0].size * depth + 7) // 8
        above = bytearray(size)
        for line in part:
            kind_of_filter, row = raw[at], bytearray(raw[at + 1 : at + 1 + size])
            for i in range(size):
                a, c = (row[i - step], above[i - step]) if i >= step else (0, 0)
                row[i] = (row[i] + guess(kind_of_filter, a, above[i], c)) & 255
            bits = np.unpackbits(np.frombuffer(bytes(row), np.uint8))[: line.size * depth].reshape(-1, depth)
            line[:] = (bits.astype(np.int64) @ (1 << np.arange(depth)[::-1])).reshape(line.shape)
            above, at = row, at + 1 + size
    return values, depth, kind, chunks


def rgba(data: bytes) -> np.ndarray:
    """Pixels (h, w, 4) of a whole PNG, each value to the nearest of 256."""
    values, depth, kind, chunks = values_of(data)
    top, key = 2**depth - 1, chunks.get(b"tRNS", b"")
    if kind == PALETTE:
        colors = np.frombuffer(chunks[b"PLTE"], np.uint8).reshape(-1, 3)
        alphas = np.array([*key, *[255] * (len(colors) - len(key))])
        return np.column_stack([colors, alphas])[values[:, :, 0]].astype(np.uint8)
    wide = values if CHANNELS[kind] > 2 else values[:, :, [0, 0, 0, *range(1, CHANNELS[kind])]]
    out = np.full((*values.shape[:2], 4), 255, np.int64)
    out[:, :, : wide.shape[2]] = (wide * 510 + top) // (2 * top)
    if key and kind in (GREY, RGB):
        color = np.frombuffer(key, ">u2").astype(np.int64) & top  # the low bits count
        out[(values == color).all(axis=2), 3] = 0
    return out.astype(np.uint8)
