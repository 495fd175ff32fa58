"""PNGs of every kind against a decoder in plain Python; broken ones are told without a word of OpenCV's on stderr."""

from __future__ import annotations

import os
import re
import struct
import time
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from oracle_png import (
    CHANNELS,
    GREY,
    GREY_ALPHA,
    KINDS,
    PALETTE,
    RGB,
    RGBA,
    SIGNATURE,
    chunk,
    chunks_of,
    header,
    joined,
    png,
    rgba,
    stream,
)

from hitplanes import InputError, read_png

pytestmark = pytest.mark.usefixtures("bounded")

RNG = np.random.default_rng(11)
SIZES = [(1, 1), (1, 9), (9, 1), (7, 5), (5, 4), (17, 11)]
END = chunk(b"IEND", b"")


def values(depth: int, kind: int, width: int, height: int) -> np.ndarray:
    return RNG.integers(0, 2**depth, (height, width, CHANNELS[kind]))


def palette(depth: int) -> bytes:
    return chunk(b"PLTE", RNG.integers(0, 256, 3 * 2**depth).astype(np.uint8).tobytes())


def read(tmp_path: Path, data: bytes) -> np.ndarray:
    (tmp_path / "a.png").write_bytes(data)
    return read_png(tmp_path / "a.png")


def same(tmp_path: Path, data: bytes, capfd: pytest.CaptureFixture[str]) -> np.ndarray:
    """What is read is what the plain decoder reads, and nothing is said."""
    image = read(tmp_path, data)
    assert image.dtype == np.uint8 and np.array_equal(image, rgba(data))
    assert capfd.readouterr() == ("", "")
    return image


@pytest.mark.parametrize("interlaced", [False, True], ids=["plain", "interlaced"])
@pytest.mark.parametrize(("kind", "depth"), KINDS)
def test_every_kind(kind: int, depth: int, interlaced: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for number, (width, height) in enumerate(SIZES):
        extra = [palette(depth)] if kind == PALETTE else []
        some = values(depth, kind, width, height)
        filters = [(0, 1, 2, 3, 4), (4, 3, 2, 1, 0)][number % 2]
        same(tmp_path, png(some, depth, kind, *extra, interlaced=interlaced, filters=filters), capfd)


@pytest.mark.parametrize("interlaced", [False, True], ids=["plain", "interlaced"])
@pytest.mark.parametrize(("kind", "depth"), [k for k in KINDS if k[0] in (GREY, RGB, PALETTE)])
def test_every_transparency(
    kind: int, depth: int, interlaced: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    some = values(depth, kind, 13, 7)
    some[2, 3] = some[0, 0]
    if depth == 16:
        some[1, 1] = some[0, 0] ^ 1
        some[1, 2] = some[0, 0] ^ 256
    key = struct.pack(f">{some.shape[2]}H", *some[0, 0].tolist())
    if kind == PALETTE:
        key = RNG.integers(0, 256, RNG.integers(1, 2**depth + 1)).astype(np.uint8).tobytes()
    extra = [palette(depth)] if kind == PALETTE else []
    data = png(some, depth, kind, *extra, chunk(b"tRNS", key), interlaced=interlaced, filters=(4, 1))
    image = same(tmp_path, data, capfd)
    if kind != PALETTE:
        assert image[0, 0, 3] == image[2, 3, 3] == 0 and image[:, :, 3].max() in (0, 255)
        assert depth < 16 or image[1, 1, 3] == image[1, 2, 3] == 255


def test_every_value_of_16_bits_goes_to_the_nearest_of_8(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image = same(tmp_path, png(np.arange(2**16).reshape(256, 256, 1), 16, GREY), capfd)
    nearest = np.abs(257 * image[:, :, 0].astype(np.int64) - np.arange(2**16).reshape(256, 256))
    assert nearest.max() == 128


GOOD = png(values(8, RGBA, 6, 4), 8, RGBA)
START = GOOD[:33]
PACKED = list(chunks_of(GOOD))[1][1]
PIXELS = chunk(b"IDAT", PACKED)
RAW = zlib.decompress(PACKED)

SPEAKS = {
    "gamma": chunk(b"gAMA", b"\0\0\0\0"), "colors": chunk(b"cHRM", b"\xff" * 32), "profile": chunk(b"iCCP", b"x\0\0no"),
    "profile known as wrong": chunk(b"iCCP", b"sRGB IEC61966-2.1\0\0" + zlib.compress(b"\0" * 3144)),
    "sRGB": chunk(b"sRGB", b"\x09"), "bits": chunk(b"sBIT", b"\xff\0\0"), "background": chunk(b"bKGD", b"\0"),
    "size": chunk(b"pHYs", b"\0"), "time": chunk(b"tIME", b"\xff" * 7), "text": chunk(b"tEXt", b"\0" * 3),
    "text of a megabyte": chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(10**6), 9)),
    "turned": chunk(b"eXIf", b"MM\0\x2a" + b"\xff" * 99),
    "unknown": chunk(b"quAk", b"quack"),
    "suggested palette": chunk(b"PLTE", b"abc"), "histogram": chunk(b"hIST", b"\0"),
    "transparency beside an alpha": chunk(b"tRNS", b"\0\0"), "animation": chunk(b"acTL", struct.pack(">II", 2, 0)),
    "wild animation": chunk(b"acTL", b"\xff" * 8) + chunk(b"fcTL", b"\xff" * 26),
    "significant": chunk(b"sTER", b"\xff"), "offset": chunk(b"oFFs", b"\xff" * 9), "of APNG": chunk(b"fdAT", b"\0" * 9),
}  # fmt: skip


@pytest.mark.parametrize("name", SPEAKS)
def test_what_else_it_brings_is_left_out(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    same(tmp_path, START + SPEAKS[name] + PIXELS + END, capfd)


def test_an_animation_is_its_first_picture(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    control = struct.pack(">IIIIIHHBB", 0, 6, 4, 0, 0, 1, 10, 0, 0)
    later = chunk(b"fcTL", b"\0\0\0\1" + control[4:]) + chunk(b"fdAT", b"\0\0\0\2" + zlib.compress(bytes(len(RAW))))
    data = START + SPEAKS["animation"] + chunk(b"fcTL", control) + PIXELS + later + END
    assert np.array_equal(same(tmp_path, data, capfd), rgba(GOOD))


RIGHT = {
    "pixels in many chunks": START + b"".join(chunk(b"IDAT", PACKED[i : i + 1]) for i in range(len(PACKED))) + END,
    "an empty chunk of pixels": START + chunk(b"IDAT", b"") + PIXELS + chunk(b"IDAT", b"") + END,
    "not compressed": START + chunk(b"IDAT", zlib.compress(RAW, 0)) + END,
    "a small window": START + chunk(b"IDAT", (c := zlib.compressobj(wbits=9)).compress(RAW) + c.flush()) + END,
    "a transparency beside an alpha": png(np.full((4, 6, 4), 5), 8, RGBA, chunk(b"tRNS", b"\0\5")),
    "garbage behind the end": GOOD + b"\0garbage" * 99,
    "another image behind the end": GOOD + GOOD,
    "more colours than numbers": png(values(2, PALETTE, 5, 4), 2, PALETTE, palette(8)),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_what_is_unusual_and_right(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    same(tmp_path, RIGHT[name], capfd)


def test_a_colour_beyond_the_depth_counts_by_its_low_bits(tmp_path: Path) -> None:
    data = png(np.array([[[3], [4]]]), 4, GREY, chunk(b"tRNS", b"\xff\x04"))
    assert read(tmp_path, data)[0, :, 3].tolist() == [255, 0]


# What is refused


def encoded(kind: str) -> bytes:
    return bytes(cv2.imencode(kind, np.full((8, 8, 3), 90, np.uint8))[1])


def start(width: int = 6, height: int = 4, depth: int = 8, kind: int = RGBA, **more: int | bytes) -> bytes:
    return header(width, height, depth, kind, **more)  # type: ignore[arg-type]


def spoilt(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :]


def numbered(colors: bytes, *extra: bytes, number: int = 0) -> bytes:
    return png(np.full((4, 6, 1), number), 2, PALETTE, *([chunk(b"PLTE", colors)] if colors else []), *extra)


def grey(*extra: bytes) -> bytes:
    return png(np.full((4, 6, 1), 5), 8, GREY, *extra)


def body(raw: bytes) -> bytes:
    return START + chunk(b"IDAT", zlib.compress(raw)) + END


block = (part := zlib.compressobj(9)).compress(bytes(2**20)) + part.flush(zlib.Z_FULL_FLUSH)
GIGABYTES = chunk(b"IDAT", block + 3600 * block[2:])
DICTIONARY = (dictionary := zlib.compressobj(zdict=RAW)).compress(RAW) + dictionary.flush()
ELSE = "expected a PNG file, got something else"
SIZE = "expected sides from 1 to 32768 px and at most 67108864 px in all, got"
WHOLE = "expected a whole PNG file, got one that is damaged:"

BAD: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", rf"{ELSE} \(0 bytes\)"),
    "a text": (b"Once upon a time there was no image at all, and nobody missed it.", ELSE),
    "a text of 10 MB": (b"text " * 2 * 10**6, rf"{ELSE} \(10000000 bytes\)"),
    "JPEG": (encoded(".jpg"), ELSE),
    "BMP": (encoded(".bmp"), ELSE),
    "WebP": (encoded(".webp"), ELSE),
    "TIFF": (encoded(".tiff"), ELSE),
    "PPM": (encoded(".ppm"), ELSE),
    "GIF": (b"GIF89a\1\0\1\0\x80\0\0\0\0\0\xff\xff\xff,\0\0\0\0\1\0\1\0\0\2\2D\1\0;" + b"\0" * 20, ELSE),
    "signature": (SIGNATURE, ELSE),
    "signature of a text transfer": (GOOD.replace(b"\r\n", b"\n", 1), ELSE),
    "half a header": (GOOD[:25], ELSE),
    "header without its checksum": (GOOD[:32], ELSE),
    "header of 14 bytes": (SIGNATURE + chunk(b"IHDR", START[16:29] + b"\0") + PIXELS + END, ELSE),
    "pixels before the header": (SIGNATURE + PIXELS + START[8:] + END, ELSE),
    "Apple's own": (SIGNATURE + chunk(b"CgBI", b"\x50\0\x20\6") + START[8:] + PIXELS + END, ELSE),
    "zero columns": (start(0, 5) + PIXELS + END, f"{SIZE} 0 x 5"),
    "zero rows": (start(5, 0) + PIXELS + END, f"{SIZE} 5 x 0"),
    "2^31 columns": (start(2**31, 1) + PIXELS + END, f"{SIZE} 2147483648 x 1"),
    "2^32 - 1 each": (start(2**32 - 1, 2**32 - 1) + PIXELS + END, f"{SIZE} 4294967295 x 4294967295"),
    "32,769 columns": (start(32_769, 1) + PIXELS + END, f"{SIZE} 32769 x 1"),
    "a row too many": (start(32_768, 2049) + PIXELS + END, f"{SIZE} 32768 x 2049"),
    "3.6 gigabytes in 4 MB": (start(30_000, 30_000) + GIGABYTES + END, f"{SIZE} 30000 x 30000"),
    "64 Mpx that are not there": (
        start(8192, 8192) + PIXELS + END, f"{WHOLE} its pixels: expected 268443648 bytes, got"),
    "gigabytes of 24 pixels": (START + GIGABYTES + END, f"{WHOLE} its pixels: expected 100 bytes, got more"),
    "3 bits": (start(depth=3) + PIXELS + END, f"{WHOLE} 3 bits of colour type 6"),
    "0 bits": (start(depth=0) + PIXELS + END, f"{WHOLE} 0 bits of colour type 6"),
    "32 bits": (start(depth=32) + PIXELS + END, f"{WHOLE} 32 bits of colour type 6"),
    "4 bits of RGB": (start(depth=4, kind=RGB) + PIXELS + END, f"{WHOLE} 4 bits of colour type 2"),
    "4 bits and alpha": (start(depth=4, kind=GREY_ALPHA) + PIXELS + END, f"{WHOLE} 4 bits of colour type 4"),
    "palette of 16 bits": (start(depth=16, kind=PALETTE) + PIXELS + END, f"{WHOLE} 16 bits of colour type 3"),
    "colour type 1": (start(kind=1) + PIXELS + END, f"{WHOLE} 8 bits of colour type 1"),
    "colour type 7": (start(kind=7) + PIXELS + END, f"{WHOLE} 8 bits of colour type 7"),
    "colour type 255": (start(kind=255) + PIXELS + END, f"{WHOLE} 8 bits of colour type 255"),
    "compression": (start(methods=b"\1\0") + PIXELS + END, f"{WHOLE} .*a method that no PNG has"),
    "filter method": (start(methods=b"\0\1") + PIXELS + END, f"{WHOLE} .*a method that no PNG has"),
    "interlaced by 2": (start(interlaced=2) + PIXELS + END, f"{WHOLE} .*a method that no PNG has"),
    "header's checksum": (spoilt(GOOD, 30), f"{WHOLE} the checksum of IHDR is wrong"),
    "header changed": (spoilt(GOOD, 19), f"{WHOLE} the checksum of IHDR is wrong"),
    "pixels changed": (spoilt(GOOD, 60), f"{WHOLE} the checksum of IDAT is wrong"),
    "name changed": (spoilt(GOOD, 38), f"{WHOLE} the checksum of IT?"),
    "end's checksum": (spoilt(GOOD, len(GOOD) - 1), f"{WHOLE} the checksum of IEND is wrong"),
    "text's checksum": (
        START + spoilt(chunk(b"tEXt", b"a\0b"), 9) + PIXELS + END, f"{WHOLE} the checksum of tEXt is w"),
    "palette's checksum": (numbered(b"")[:33] + spoilt(chunk(b"PLTE", b"abc"), 9) + PIXELS + END, "checksum of PLTE"),
    "cut behind the header": (GOOD[:33], f"{WHOLE} it ends too early"),
    "cut in a length": (GOOD[:35], f"{WHOLE} it ends too early"),
    "cut in the pixels": (GOOD[:70], f"{WHOLE} it ends within a chunk b'IDAT'"),
    "cut before the end": (START + PIXELS, f"{WHOLE} it ends too early"),
    "cut in the end": (GOOD[:-1], f"{WHOLE} it ends too early"),
    "a length of 2^32 - 1": (START + b"\xff\xff\xff\xff" + PIXELS[4:] + END, f"{WHOLE} it ends within a chunk b'IDAT'"),
    "a length of 2^31": (START + b"\x80\0\0\0" + PIXELS[4:] + END, f"{WHOLE} it ends within a chunk b'IDAT'"),
    "a name of zeros": (START + chunk(b"\0\0\0\0", b"") + PIXELS + END, f"{WHOLE} it ends within a chunk"),
    "two headers": (START + START[8:] + PIXELS + END, f"{WHOLE} a chunk b'IHDR' that is not known"),
    "an unknown need": (START + chunk(b"NEED", b"") + PIXELS + END, f"{WHOLE} a chunk b'NEED' that is not known"),
    "no pixels": (START + END, f"{WHOLE} its pixels: expected 100 bytes, got 0"),
    "empty pixels": (START + chunk(b"IDAT", b"") + END, f"{WHOLE} its pixels: expected 100 bytes, got 0"),
    "pixels in two places": (
        START + chunk(b"IDAT", PACKED[:20]) + chunk(b"tEXt", b"a\0b") + chunk(b"IDAT", PACKED[20:]) + END,
        f"{WHOLE} its pixels are not in one place"),
    "pixels, no stream": (START + chunk(b"IDAT", b"no stream at all") + END, f"{WHOLE} its pixels: Error -3"),
    "pixels, half a stream": (
        START + chunk(b"IDAT", PACKED[:40]) + END, f"{WHOLE} its pixels: expected 100 bytes, got"),
    "pixels without their sum": (START + chunk(b"IDAT", PACKED[:-4]) + END, f"{WHOLE} its pixels: expected 100 bytes"),
    "pixels, wrong sum": (START + chunk(b"IDAT", PACKED[:-1] + b"\0") + END, f"{WHOLE} its pixels: Error -3"),
    "pixels, more behind": (START + chunk(b"IDAT", PACKED + b"more") + END, f"{WHOLE} its pixels: expected 100 bytes"),
    "pixels by a dictionary": (START + chunk(b"IDAT", DICTIONARY) + END, f"{WHOLE} its pixels: Error 2"),
    "a byte too few": (body(RAW[:-1]), f"{WHOLE} its pixels: expected 100 bytes, got 99"),
    "a byte too many": (body(RAW + b"\0"), f"{WHOLE} its pixels: expected 100 bytes, got more"),
    "a filter 5": (body(b"\5" + RAW[1:]), f"{WHOLE} its pixels: an unknown filter"),
    "a filter 255 in the last row": (body(RAW[:75] + b"\xff" + RAW[76:]), f"{WHOLE} its pixels: an unknown filter"),
    "interlaced, but not": (
        start(interlaced=1) + PIXELS + END, f"{WHOLE} its pixels: expected 1[0-9][0-9] bytes, got 100"),
    "no palette": (numbered(b""), f"{WHOLE} a palette of 0 bytes"),
    "palette of 4 bytes": (numbered(b"abcd"), f"{WHOLE} a palette of 4 bytes"),
    "palette of 257": (numbered(b"abc" * 257), f"{WHOLE} a palette of 771 bytes"),
    "palette twice": (numbered(b"abc", chunk(b"PLTE", b"abc")), f"{WHOLE} PLTE again"),
    "palette behind the pixels": (
        numbered(b"abc").replace(chunk(b"PLTE", b"abc"), b"").replace(END, chunk(b"PLTE", b"abc") + END),
        f"{WHOLE} PLTE again, or after the pixels"),
    "a number beyond the palette": (numbered(b"abcdef", number=2), f"{WHOLE} a pixel of colour 2 of a palette of 2"),
    "more alphas than colours": (numbered(b"abc", chunk(b"tRNS", b"\0\0")), f"{WHOLE} a transparency of 2 bytes"),
    "transparency of 1 byte": (grey(chunk(b"tRNS", b"\5")), f"{WHOLE} a transparency of 1 bytes"),
    "transparency of no byte": (grey(chunk(b"tRNS", b"")), f"{WHOLE} a transparency of 0 bytes"),
    "transparency of a colour": (grey(chunk(b"tRNS", b"\0\5\0\5\0\5")), f"{WHOLE} a transparency of 6 bytes"),
    "transparency twice": (grey(chunk(b"tRNS", b"\0\5"), chunk(b"tRNS", b"\0\5")), f"{WHOLE} tRNS again"),
    "transparency behind the pixels": (
        grey().replace(END, chunk(b"tRNS", b"\0\5") + END), f"{WHOLE} tRNS again, or after the pixels"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_image_is_named_in_silence(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data, told = BAD[name]
    before = time.perf_counter()
    with pytest.raises(InputError) as caught:
        read(tmp_path, data)
    assert time.perf_counter() - before < 2
    assert re.match(f"image: 'a.png': .*{told}", str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300
    assert capfd.readouterr() == ("", "")
    assert (tmp_path / "a.png").read_bytes() == data


def test_a_cut_at_any_byte_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = numbered(b"abc", chunk(b"tRNS", b"\x07"), chunk(b"tEXt", b"a\0b"))
    same(tmp_path, data, capfd)
    for size in range(len(data)):
        with pytest.raises(InputError, match=r"image: 'a\.png': expected a (whole )?PNG file"):
            read(tmp_path, data[:size])
    assert capfd.readouterr() == ("", "")


def test_any_changed_bit_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = numbered(b"abc", chunk(b"tRNS", b"\x07"))
    for at in range(len(data)):
        with pytest.raises(InputError):
            read(tmp_path, spoilt(data, at))
    assert capfd.readouterr() == ("", "")


def test_a_giant_file_is_not_read(tmp_path: Path) -> None:
    """One of a terabyte, with nothing in it: by its first bytes a text, or a small PNG."""
    for first, told in ((b"text", ELSE), (GOOD, "of 1099511627776 bytes")):
        with (tmp_path / "a.png").open("wb") as file:
            file.write(first)
            file.truncate(2**40)
        with pytest.raises(InputError, match=told):
            read_png(tmp_path / "a.png")


def test_what_is_no_file_is_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("pipe", "folder", "zero"):
        with pytest.raises(InputError, match=f"image: .* got '{name}', which is a folder, a pipe or a device"):
            read_png(tmp_path / name)
    with pytest.raises(InputError, match=r"image: expected a PNG file, got 'loop': Too many levels"):
        read_png(tmp_path / "loop")


def test_the_oracle_reads_what_opencv_writes() -> None:
    """The plain decoder against a third: OpenCV's own files of kinds that it does not lose."""
    for shape in ((5, 7), (5, 7, 3), (5, 7, 4)):
        for kind in (np.uint8, np.uint16):
            image = RNG.integers(0, np.iinfo(kind).max, shape, endpoint=True).astype(kind)
            data = bytes(cv2.imencode(".png", image)[1])
            found = rgba(data)[:, :, [2, 1, 0, 3]]
            wide = np.dstack([image] * 3) if image.ndim == 2 else image
            top = int(np.iinfo(kind).max)
            assert np.array_equal(found[:, :, : wide.shape[2]], (wide.astype(np.int64) * 510 + top) // (2 * top))


def test_the_oracle_is_its_own_inverse() -> None:
    for kind, depth in KINDS:
        some = values(depth, kind, 9, 7)
        for interlaced in (False, True):
            data = png(some, depth, kind, interlaced=interlaced, filters=(1, 4, 3, 2, 0))
            assert len(stream(some, depth, interlaced=interlaced)) == len(
                zlib.decompress(dict(chunks_of(data))[b"IDAT"])
            )
            assert joined(list(chunks_of(data))) == data
