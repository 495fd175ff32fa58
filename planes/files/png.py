"""PNG files, read and written as RGBA arrays (h, w, 4) of bytes; damaged files are refused before they are decoded."""

from __future__ import annotations

import errno
import os
import stat
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Image, InputError, path_of, shown, within
from ..common.limits import MASK_AREA_MAX, MASK_SIDE_MAX, PLANE_SIDE_MAX, TEXT_BYTES_MAX

if TYPE_CHECKING:
    import cv2 as cv2
else:

    class _OpenCV:
        """Stands for the module `cv2`."""

        def __getattr__(self, name: str) -> Any:
            """Import OpenCV, or say what to install, in an InputError."""
            try:
                import cv2
            except ImportError as error:
                install = "pip install opencv-python-headless"
                raise InputError(f"images: expected OpenCV to be installed ({install}), got {error}") from error
            return getattr(cv2, name)

    cv2 = _OpenCV()


SIGNATURE = b"\x89PNG\r\n\x1a\n"
START = 33  # length of the signature and the header chunk, bytes

GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGBA: 4}
DEPTHS = {GREY: (1, 2, 4, 8, 16), RGB: (8, 16), PALETTE: (1, 2, 4, 8), GREY_ALPHA: (8, 16), RGBA: (8, 16)}
FILTERS = 5
WHOLE = ((0, 0, 1, 1),)  # the only pass of an image that is not interlaced: first column and row, steps between them

ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
"""Passes of an interlaced image, in the same form."""

NO_FSYNC = (errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EBADF, errno.EACCES, errno.EPERM)
"""Errors of systems that cannot sync a folder to disk: Windows, and folders that are not readable."""

FILE_BYTES_MAX = 16 * MASK_AREA_MAX  # of a PNG (1 GiB): twice the largest image in 16-bit RGBA without compression


@dataclass(frozen=True)
class _Header:
    width: int
    height: int
    depth: int
    kind: int
    compression: int
    filtering: int
    interlace: int

    @property
    def passes(self) -> Iterator[tuple[int, int]]:
        """Number of rows of each pass, and bytes of a row with its filter byte."""
        bits = self.depth * CHANNELS[self.kind]
        for x, y, dx, dy in ADAM7 if self.interlace else WHOLE:
            columns, rows = -(-(self.width - x) // dx), -(-(self.height - y) // dy)
            if columns > 0 and rows > 0:
                yield rows, 1 + (columns * bits + 7) // 8


def read_png(path: str | Path, field: str = "image") -> Image:
    """Read a PNG of any kind (grey, palette, 1 to 16 bits, interlaced, with or without transparency) as RGBA bytes.

    Raises
    ------
    InputError
        If the file is missing, is not a PNG, is damaged, or is larger than a mask may be.
    """
    path = path_of(field, path)
    header, data = _contents(path, field)
    with within(f"{field}: {path.name!r}"):
        chunks = _chunks(header, data)
        _check_pixels(header, chunks[b"IDAT"])
        return _rgba(header, _decoded(header, chunks[b"IDAT"]), chunks)


@contextmanager
def possible(what: str) -> Iterator[None]:
    """Turn errors of the file system into an `InputError` that begins with `what`."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{what}: {error.strerror}") from error


def read_text(path: Path) -> str:
    """Read a text file in UTF-8; an InputError says if it is missing, too large, not UTF-8, or a pipe or device."""
    path = path_of("path", path)
    with possible("cannot read it"):
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise InputError("cannot read it: it is a pipe or a device")
        if path.stat().st_size > TEXT_BYTES_MAX:
            raise InputError(f"cannot read it: expected at most {TEXT_BYTES_MAX} bytes, got {path.stat().st_size}")
        try:
            return path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise InputError(f"expected JSON in UTF-8: {error}") from error


def write_png(path: str | Path, image: Image) -> None:
    """Write an image (h, w, 3 or 4) of RGB or RGBA bytes to a temporary file and rename it: the file is never partial.

    Raises
    ------
    InputError
        If the name does not end in .png, the array is not an image, or the file cannot be written.
    """
    path = path_of("output", path)
    if not path.name.lower().endswith(".png"):  # also ".png", which has no suffix
        raise InputError(f"output: expected a name that ends in .png, got {path.name!r}")
    is_array = isinstance(image, np.ndarray)
    if not (is_array and image.dtype == np.uint8 and image.size and image.shape[2:] in ((3,), (4,))):
        got = f"{image.dtype} {image.shape}" if is_array else shown(image)
        raise InputError(f"image: expected bytes (h, w, 3 or 4), got {got}")
    if max(image.shape) > PLANE_SIDE_MAX:
        got = f"{image.shape[1]} x {image.shape[0]}"
        raise InputError(f"image: expected sides of at most {PLANE_SIDE_MAX} px, got {got}")
    order = cv2.COLOR_RGB2BGR if image.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    flat = [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_DEFAULT, cv2.IMWRITE_PNG_COMPRESSION, 6]
    _, data = cv2.imencode(".png", cv2.cvtColor(image, order), flat)  # a third of the size of OpenCV's default
    write_bytes(path, data.tobytes())


def write_text(path: Path, text: str) -> None:
    """Write a text to a temporary file and rename it."""
    write_bytes(path, text.encode("utf-8"))


def _is_no_file(path: Path) -> bool:
    """Whether the path exists and is not a regular file; checked in one call, as others may be writing it."""
    try:
        return not stat.S_ISREG(path.stat().st_mode)
    except OSError as error:
        if error.errno not in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP):
            raise
        return path.is_symlink()


def check_output(path: str | Path) -> Path:
    """Refuse a path where no file can be written; called before any work is done."""
    path = path_of("output", path)
    with possible(f"output: cannot write {path}"):
        is_other, has_folder = _is_no_file(path), path.parent.is_dir()
    if not path.name or is_other:
        raise InputError(f"output: cannot write {path}: expected the name of a file")
    if not has_folder:
        raise InputError(f"output: cannot write {path}: no folder {path.parent}")
    return path


def write_bytes(path: Path, data: bytes) -> None:
    """Write bytes to a temporary file and rename it."""
    path = check_output(path)
    import secrets  # slow to load

    aside = path.with_name(f"{path.name}.{secrets.token_hex(4)}.part")  # writers at the same time have different ones
    try:
        with possible(f"output: cannot write {path}"):
            aside.write_bytes(data)
            put_in_place(aside, path)
    finally:
        with suppress(OSError):
            aside.unlink()


def put_in_place(aside: Path, path: Path) -> None:
    """Sync a complete file, or a folder of such, to disk and rename it within its folder; else raise an OSError.

    A power loss leaves either the old file or all of the new one.
    """
    is_folder = aside.is_dir()
    for part in aside.iterdir() if is_folder else (aside,):
        _synced(part, os.O_RDWR)  # Windows syncs only files that are open for writing
    if is_folder:
        _synced_folder(aside)
    aside.replace(path)
    _synced_folder(path.parent)


def _synced(path: Path, flags: int) -> None:
    """Sync a file, or the names in a folder, to disk."""
    file = os.open(path, flags | getattr(os, "O_CLOEXEC", 0))
    try:
        os.fsync(file)
    finally:
        os.close(file)


def _synced_folder(folder: Path) -> None:
    """Sync the names in a folder to disk if the system and the file system can."""
    try:
        _synced(folder, os.O_RDONLY)
    except OSError as error:
        if error.errno not in NO_FSYNC:
            raise


def _contents(path: Path, field: str) -> tuple[_Header, bytes]:
    """Header and bytes of a file; only its start is read if that is not the start of a PNG within the limits."""
    what = f"{field}: expected a PNG file, got {path.name!r}"
    with possible(what):
        if path.exists() and not path.is_file():
            raise InputError(f"{what}, which is a folder, a pipe or a device")
        with path.open("rb") as file:
            start = file.read(START)
            size = path.stat().st_size
            with within(f"{field}: {path.name!r}"):
                header = _header(start, size)
            if size > FILE_BYTES_MAX:
                raise InputError(f"{what} of {size} bytes, more than any that a mask may come from")
            return header, start + file.read()


def _header(start: bytes, size: int) -> _Header:
    """Header of a PNG whose size is within the limits; `size`, that of the file, is for the error."""
    if start[:16] != SIGNATURE + b"\0\0\0\x0dIHDR" or len(start) < START:
        raise InputError(f"expected a PNG file, got something else ({size} bytes)")
    header = _Header(*struct.unpack(">IIBBBBB", start[16:29]))
    width, height = header.width, header.height
    if not (0 < width <= MASK_SIDE_MAX and 0 < height <= MASK_SIDE_MAX and width * height <= MASK_AREA_MAX):
        limit = f"sides from 1 to {MASK_SIDE_MAX} px and at most {MASK_AREA_MAX} px in all"
        raise InputError(f"expected {limit}, got {width} x {height}")
    known = header.depth in DEPTHS.get(header.kind, ())
    if not known or header.compression or header.filtering or header.interlace > 1:
        raise _damaged(f"{header.depth} bits of colour type {header.kind}, or a method that no PNG has")
    return header


def _damaged(why: str) -> InputError:
    return InputError(f"expected a whole PNG file, got one that is damaged: {why}")


def _chunks(header: _Header, data: bytes) -> dict[bytes, bytes]:
    """The chunks of palette, transparency and pixels, each joined; other chunks do not affect the pixels."""
    found: dict[bytes, list[bytes]] = {b"IDAT": [], b"PLTE": [], b"tRNS": []}
    last = b""
    for name, body in _each_chunk(data):
        if name in (b"PLTE", b"tRNS") and (found[name] or found[b"IDAT"]):
            raise _damaged(f"{name.decode()} again, or after the pixels")
        if name == b"IDAT" and found[name] and last != name:
            raise _damaged("its pixels are not in one place")
        if name not in found and name != b"IEND" and not name[0] & 0x20:
            raise _damaged(f"a chunk {name!r} that is not known and must be")
        found.get(name, []).append(body)
        last = name
    chunks = {name: b"".join(bodies) for name, bodies in found.items()}
    palette, key = len(chunks[b"PLTE"]), len(chunks[b"tRNS"])
    if header.kind == PALETTE and (not palette or palette % 3 or palette > 768):
        raise _damaged(f"a palette of {palette} bytes")
    if header.kind in (GREY_ALPHA, RGBA):
        chunks[b"tRNS"] = b""  # the pixels have an alpha channel
    elif found[b"tRNS"] and key != {GREY: 2, RGB: 6, PALETTE: min(key, palette // 3)}[header.kind]:
        raise _damaged(f"a transparency of {key} bytes")
    return chunks


def _each_chunk(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and bodies of the chunks after the header, up to the end."""
    at, name = 8, b""
    while name != b"IEND":
        if at + 12 > len(data):
            raise _damaged("it ends too early")
        length, name = struct.unpack(">I4s", data[at : at + 8])
        end = at + 12 + length
        if end > len(data) or not name.isalpha():
            raise _damaged(f"it ends within a chunk {name!r}")
        if zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise _damaged(f"the checksum of {name.decode()} is wrong")
        if at > 8:
            yield name, data[at + 8 : end - 4]
        at = end


def _check_pixels(header: _Header, packed: bytes) -> None:
    """Refuse a pixel stream that is damaged, too short, too long, or has an unknown filter."""
    size = sum(rows * row_bytes for rows, row_bytes in header.passes)
    stream = zlib.decompressobj()
    try:
        raw = np.frombuffer(stream.decompress(packed, size + 1), np.uint8)
    except zlib.error as error:
        raise _damaged(f"its pixels: {error}") from error
    if len(raw) != size or not stream.eof or stream.unused_data:
        raise _damaged(f"its pixels: expected {size} bytes, got {'more' if len(raw) > size else len(raw)}")
    at = 0
    for rows, row_bytes in header.passes:
        if raw[at : at + rows * row_bytes : row_bytes].max() >= FILTERS:
            raise _damaged("its pixels: an unknown filter")
        at += rows * row_bytes


def _decoded(header: _Header, packed: bytes) -> npt.NDArray[np.unsignedinteger]:
    """Decode the pixels with OpenCV, from the header and the pixel stream alone.

    Palette and transparency are left out, because OpenCV drops them for some kinds and versions; palette numbers are
    decoded as shades of grey. Profiles and notes are left out, because OpenCV may print warnings about them.
    """
    kind = GREY if header.kind == PALETTE else header.kind
    start = struct.pack(">IIBBBBB", header.width, header.height, header.depth, kind, 0, 0, header.interlace)
    plain = SIGNATURE + b"".join(_chunk(*c) for c in ((b"IHDR", start), (b"IDAT", packed), (b"IEND", b"")))
    decoded = cv2.imdecode(np.frombuffer(plain, np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None or decoded.shape[:2] != (header.height, header.width):
        raise _damaged("OpenCV cannot decode it")
    return np.asarray(decoded)


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def _rgba(header: _Header, decoded: npt.NDArray[np.unsignedinteger], chunks: dict[bytes, bytes]) -> Image:
    """Convert palette numbers, grey, BGR or BGRA of 8 or 16 bits to RGBA of 8 bits, rounded to the nearest."""
    key, top = chunks[b"tRNS"], 2**header.depth - 1
    shade = max(255 // top, 1)  # OpenCV spreads fewer than 8 bits over 0 .. 255
    if header.kind == PALETTE:
        return _colored(decoded // shade, chunks[b"PLTE"], key)
    out = np.full((*decoded.shape[:2], 4), 255, np.uint8)
    channels = decoded[:, :, None] if decoded.ndim == 2 else decoded
    for to, of in enumerate((0, 0, 0) if channels.shape[2] == 1 else (2, 1, 0, 3)[: channels.shape[2]]):
        out[:, :, to] = _bytes(channels[:, :, of])
    if key:
        color = (np.frombuffer(key, ">u2")[::-1].astype(np.int64) & top) * shade
        out[(channels == color).all(axis=2), 3] = 0
    return out


def _colored(numbers: npt.NDArray[np.unsignedinteger], palette: bytes, alphas: bytes) -> Image:
    """Look up palette colours; those without an alpha are opaque."""
    colors = np.full((len(palette) // 3, 4), 255, np.uint8)
    colors[:, :3] = np.frombuffer(palette, np.uint8).reshape(-1, 3)
    colors[: len(alphas), 3] = np.frombuffer(alphas, np.uint8)
    if int(numbers.max()) >= len(colors):
        raise _damaged(f"a pixel of colour {numbers.max()} of a palette of {len(colors)}")
    return np.asarray(colors[numbers])


def _bytes(values: npt.NDArray[np.unsignedinteger]) -> npt.NDArray[np.uint8]:
    """Convert 16-bit values to 8 bits, rounded to the nearest."""
    if values.dtype == np.uint8:
        return np.asarray(values, np.uint8)
    return ((values.astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)
