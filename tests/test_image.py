"""PNG files in and out: every kind of PNG gives the right RGBA, a bad one an error, and a write is whole or nothing."""

import errno
import os
import stat
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from hitplanes.planes.common.checks import InputError
from hitplanes.planes.files.png import read_png, write_png, write_text
from hitplanes.planes.scene.scene import Scene
from hitplanes.weapons.golden.check import claimed
from hitplanes.weapons.replay.stream import Part

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGBA: 4}
RNG = np.random.default_rng(7)


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def header(width: int, height: int, depth: int, kind: int) -> bytes:
    return SIGNATURE + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0))


def png(values: np.ndarray, depth: int, kind: int, *extra: bytes) -> bytes:
    """Build a PNG of values (h, w, channels) by hand: each row unfiltered, packed to whole bytes."""
    height, width = values.shape[:2]
    rows = []
    for row in values.reshape(height, -1):
        bits = (row[:, None].astype(np.int64) >> np.arange(depth)[::-1]) & 1
        rows.append(b"\0" + np.packbits(bits.astype(np.uint8).reshape(-1)).tobytes())
    body = chunk(b"IDAT", zlib.compress(b"".join(rows)))
    return header(width, height, depth, kind) + b"".join(extra) + body + chunk(b"IEND", b"")


def to_byte(values: np.ndarray, depth: int) -> np.ndarray:
    """Nearest of 256 values."""
    top = 2**depth - 1
    return ((values.astype(np.int64) * 510 + top) // (2 * top)).astype(np.uint8)


def read(tmp_path: Path, data: bytes) -> np.ndarray:
    path = tmp_path / "a.png"
    path.write_bytes(data)
    image = read_png(path)
    assert image.dtype == np.uint8
    return image


def some_values(depth: int, channels: int, width: int = 11, height: int = 5) -> np.ndarray:
    values = RNG.integers(0, 2**depth, (height, width, channels))
    values[0, 0], values[0, 1] = 0, 2**depth - 1
    return values


# Every kind of PNG


@pytest.mark.parametrize("depth", [1, 2, 4, 8, 16])
def test_grey(tmp_path: Path, depth: int) -> None:
    values = some_values(depth, 1)
    grey = to_byte(values, depth)
    expected = np.dstack([grey, grey, grey, np.full(grey.shape, 255)])
    assert np.array_equal(read(tmp_path, png(values, depth, GREY)), expected)


@pytest.mark.parametrize("depth", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("shade", ["black", "white", "middle"])
def test_grey_with_a_transparent_shade(tmp_path: Path, depth: int, shade: str) -> None:
    values = some_values(depth, 1)
    key = {"black": 0, "white": 2**depth - 1, "middle": int(values[2, 3, 0])}[shade]
    grey = to_byte(values, depth)
    expected = np.dstack([grey, grey, grey, np.where(values == key, 0, 255)])
    data = png(values, depth, GREY, chunk(b"gAMA", struct.pack(">I", 45455)), chunk(b"tRNS", struct.pack(">H", key)))
    assert np.array_equal(read(tmp_path, data), expected)


def test_a_shade_of_16_bits_is_transparent_only_if_all_bits_agree(tmp_path: Path) -> None:
    values = np.array([[[0x1234], [0x1235], [0x1334]]])
    image = read(tmp_path, png(values, 16, GREY, chunk(b"tRNS", struct.pack(">H", 0x1234))))
    assert image[0, :, 3].tolist() == [0, 255, 255]


@pytest.mark.parametrize("depth", [8, 16])
def test_rgb(tmp_path: Path, depth: int) -> None:
    values = some_values(depth, 3)
    expected = np.dstack([to_byte(values, depth), np.full(values.shape[:2], 255)])
    assert np.array_equal(read(tmp_path, png(values, depth, RGB)), expected)


@pytest.mark.parametrize("depth", [8, 16])
def test_rgb_with_a_transparent_colour(tmp_path: Path, depth: int) -> None:
    values = some_values(depth, 3)
    key = values[2, 3].copy()
    values[4, 4] = key
    values[3, 3] = key ^ (0, 0, 1)
    alpha = np.where((values == key).all(axis=2), 0, 255)
    image = read(tmp_path, png(values, depth, RGB, chunk(b"tRNS", struct.pack(">3H", *key.tolist()))))
    assert np.array_equal(image[:, :, 3], alpha)
    assert np.array_equal(image[:, :, :3], to_byte(values, depth))


@pytest.mark.parametrize("depth", [1, 2, 4, 8])
@pytest.mark.parametrize("alphas", ["none", "some", "all"])
def test_palette(tmp_path: Path, depth: int, alphas: str) -> None:
    values = some_values(depth, 1)
    colors = RNG.integers(0, 256, (2**depth, 3)).astype(np.uint8)
    alpha = np.full(2**depth, 255, np.uint8)
    given = {"none": 0, "some": 2 ** (depth - 1), "all": 2**depth}[alphas]
    alpha[:given] = RNG.integers(0, 256, given)
    extra = [chunk(b"PLTE", colors.tobytes())] + ([chunk(b"tRNS", alpha[:given].tobytes())] if given else [])
    expected = np.column_stack([colors, alpha])
    assert np.array_equal(read(tmp_path, png(values, depth, PALETTE, *extra)), expected[values[:, :, 0]])


@pytest.mark.parametrize("depth", [8, 16])
def test_grey_and_alpha(tmp_path: Path, depth: int) -> None:
    values = some_values(depth, 2)
    expected = to_byte(values, depth)[:, :, [0, 0, 0, 1]]
    assert np.array_equal(read(tmp_path, png(values, depth, GREY_ALPHA)), expected)


@pytest.mark.parametrize("depth", [8, 16])
def test_rgba(tmp_path: Path, depth: int) -> None:
    values = some_values(depth, 4)
    assert np.array_equal(read(tmp_path, png(values, depth, RGBA)), to_byte(values, depth))


def test_an_orientation_tag_does_not_turn_the_image(tmp_path: Path) -> None:
    """The mask lies as the pixels are stored, whatever a camera noted."""
    values = some_values(8, 4)
    tag = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    assert np.array_equal(read(tmp_path, png(values, 8, RGBA, chunk(b"eXIf", tag))), values)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 9), (9, 1), (65, 2)])
def test_sizes(tmp_path: Path, width: int, height: int) -> None:
    values = some_values(1, 1, max(width, 2), height)[:, :width]
    assert np.array_equal(read(tmp_path, png(values, 1, GREY))[:, :, 0], values[:, :, 0] * 255)


# What is refused


GOOD = png(some_values(8, 4), 8, RGBA)
JPEG = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
BODY = GOOD.index(b"IDAT")
PIXELS = zlib.compress(bytes(some_values(8, 1, 45, 5).astype(np.uint8)))


def damaged(at: int) -> bytes:
    return GOOD[:at] + bytes([GOOD[at] ^ 0x55]) + GOOD[at + 1 :]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", r"got something else \(0 bytes\)"),
        (b"once upon a time there was no image here at all", "expected a PNG file, got something else"),
        (JPEG, "expected a PNG file, got something else"),
        (SIGNATURE, "expected a PNG file"),
        (GOOD[:20], "expected a PNG file"),
        (SIGNATURE + b"\0\0\0\x0dIDAT" + GOOD[16:], "expected a PNG file"),
        (header(40_000, 40_000, 8, RGBA), "sides from 1 to 32768 px .*got 40000 x 40000"),
        (header(32_768, 2_049, 8, RGBA), "67108864 px in all, got 32768 x 2049"),
        (header(0, 5, 8, RGBA), "got 0 x 5"),
        (header(2**31, 1, 8, RGBA), "got 2147483648 x 1"),
        (GOOD[:33], "damaged"),
        (GOOD[: BODY + 4], "damaged"),
        (GOOD[: BODY + 60], "damaged"),
        (GOOD[: -12 - 20], "damaged"),
        (damaged(24), "damaged"),
        (damaged(29), "damaged"),
        (damaged(BODY + 40), "damaged"),
        (damaged(len(GOOD) - 13), "damaged"),
        (header(11, 5, 8, RGBA) + chunk(b"IEND", b""), "damaged"),
        (header(11, 5, 8, RGBA) + chunk(b"IDAT", b"no zlib stream") + chunk(b"IEND", b""), "damaged"),
        (header(11, 5, 3, RGBA) + chunk(b"IDAT", PIXELS) + chunk(b"IEND", b""), "damaged"),
        (header(11, 5, 8, PALETTE) + chunk(b"IDAT", PIXELS) + chunk(b"IEND", b""), "damaged"),
        (header(11, 50, 8, RGBA) + GOOD[33:], "damaged"),
    ],
    ids=[
        "empty", "text", "jpeg", "signature only", "half a header", "no header chunk", "40000 x 40000", "area",
        "no width", "2**31", "header only", "cut at the pixels", "cut in the pixels", "cut before the end",
        "depth changed", "header checksum", "pixels changed", "pixel checksum", "no pixels", "no zlib", "3 bits",
        "no palette", "few rows",
    ],
)  # fmt: skip
def test_a_bad_file_is_an_error(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "bad.png"
    path.write_bytes(data)
    with pytest.raises(InputError, match=f"picture: .*'bad.png'.*{message}|picture: .*{message}.*'bad.png'"):
        read_png(path, "picture")
    assert path.read_bytes() == data


@pytest.mark.parametrize("name", ["missing.png", "folder", "file.txt/a.png"])
def test_a_file_that_cannot_be_read_is_an_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file.txt").write_text("text")
    with pytest.raises(InputError, match="image: expected a PNG file"):
        read_png(tmp_path / name)


# Writing


@pytest.mark.parametrize("channels", [3, 4])
def test_what_is_written_is_read(tmp_path: Path, channels: int) -> None:
    image = RNG.integers(0, 256, (7, 5, channels)).astype(np.uint8)
    before = image.copy()
    write_png(tmp_path / "a.png", image)
    expected = image if channels == 4 else np.dstack([image, np.full((7, 5), 255, np.uint8)])
    assert np.array_equal(read_png(tmp_path / "a.png"), expected)
    assert np.array_equal(image, before)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_read_only_or_strided_image_is_written(tmp_path: Path) -> None:
    image = RNG.integers(0, 256, (6, 8, 4)).astype(np.uint8)
    image.flags.writeable = False
    for number, view in enumerate([image, image[::2, ::-1], np.asfortranarray(image)]):
        write_png(tmp_path / f"{number}.png", view)
        assert np.array_equal(read_png(tmp_path / f"{number}.png"), view)


def test_a_write_replaces_the_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"x" * 10_000)
    write_png(path, np.zeros((2, 2, 4), np.uint8))
    assert read_png(path).shape == (2, 2, 4)
    write_text(tmp_path / "a.txt", "pixel ä\n")
    assert (tmp_path / "a.txt").read_bytes() == "pixel ä\n".encode()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "a.txt"]


WRITERS: list[Callable[[Path], None]] = [
    lambda path: write_png(path, np.zeros((2, 2, 4), np.uint8)),
    lambda path: write_text(path, "text"),
]


@pytest.mark.parametrize("write", WRITERS, ids=["png", "text"])
def test_a_write_that_fails_leaves_the_old_file_and_no_part(
    tmp_path: Path, write: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"old")

    def full(self: Path, target: Path) -> None:
        assert self.exists()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match=r"output: cannot write .*a\.png: No space left"):
        write(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize("write", WRITERS, ids=["png", "text"])
@pytest.mark.parametrize("name", ["missing/a.png", "file.txt/a.png", "folder.png", "n" * 246 + ".png"])
def test_a_place_that_cannot_be_written_is_an_error(tmp_path: Path, write: Callable[[Path], None], name: str) -> None:
    (tmp_path / "file.txt").write_text("text")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match="output: cannot write"):
        write(tmp_path / name)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file.txt", "folder.png"]


@pytest.mark.parametrize(
    ("path", "image", "told"),
    [
        (5, np.zeros((2, 2, 3), np.uint8), "output: expected a path, got 5"),
        ("a.png", np.zeros((2, 2), np.uint8), r"image: expected bytes \(h, w, 3 or 4\), got uint8 \(2, 2\)"),
        ("a.png", np.zeros((2, 2, 3)), r"image: expected bytes .*got float64 \(2, 2, 3\)"),
        ("a.png", [[1]], r"image: expected bytes .*got \[\[1\]\]"),
        ("a.png", np.zeros((0, 2, 3), np.uint8), r"image: expected bytes .*got uint8 \(0, 2, 3\)"),
    ],
)
def test_what_is_no_image_is_not_written(
    path: Any, image: Any, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=told):
        write_png(path, image)
    assert not list(tmp_path.iterdir())


def test_a_path_may_be_a_text(tmp_path: Path) -> None:
    write_png(str(tmp_path / "a.png"), np.full((1, 2, 3), 7, np.uint8))
    assert read_png(tmp_path / "a.png")[:, :, :3].tolist() == [[[7] * 3] * 2]


def saved(folder: Path) -> None:
    scene = Scene((40, 30))
    scene.add(np.full((20, 20, 4), 255, np.uint8), (5, 5))
    scene.save(folder / "level")


def part_finished(folder: Path) -> None:
    with Part(folder / "hits.jsonl", b'{"format": "x"}\n') as part:
        part.cut()
        part.write([b'{"shot":0'])
        part.finish()


PLACED: dict[str, tuple[Callable[[Path], object], list[str]]] = {
    "text": (lambda folder: write_text(folder / "a.txt", "12345"), ["a.txt"]),
    "PNG": (lambda folder: write_png(folder / "a.png", np.ones((2, 2, 3), np.uint8)), ["a.png"]),
    "scene": (saved, ["sprite.png", "scene.json"]),
    "part of a log": (part_finished, ["hits.jsonl"]),
    "failures": (lambda folder: claimed(folder / "failures"), ["failures"]),
}


def recorded(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, int]]:
    """What is brought to the disk and renamed from here on: what, the inode, and its size then."""
    told: list[tuple[str, str, int]] = []
    fsync, replace = os.fsync, os.replace

    def noted_fsync(file: int) -> None:
        told.append(("fsync", str(os.fstat(file).st_ino), os.fstat(file).st_size))
        fsync(file)

    def noted_replace(old: Path, new: Path) -> None:
        replace(old, new)
        told.append(("replace", str(new), Path(new).stat().st_size))

    monkeypatch.setattr("os.fsync", noted_fsync)
    monkeypatch.setattr("os.replace", noted_replace)
    monkeypatch.setattr("os.rename", lambda *_: pytest.fail("renamed without a word to the disk"))
    return told


@pytest.mark.parametrize("kind", PLACED)
def test_the_bytes_are_on_the_disk_before_the_name_and_the_name_when_it_returns(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, names = PLACED[kind]
    told = recorded(monkeypatch)
    write(tmp_path)
    places = [i for i, (what, _, _) in enumerate(told) if what == "replace"]
    assert [Path(told[i][1]).name for i in places] == names
    for i in places:
        path = Path(told[i][1])
        assert told[i + 1][:2] == ("fsync", str(path.parent.stat().st_ino))
        if path.is_file():
            assert ("fsync", str(path.stat().st_ino), path.stat().st_size) in told[:i]
        else:
            synced = {inode for what, inode, size in told[:i] if what == "fsync" and size}
            assert {str(file.stat().st_ino) for file in (path, *path.iterdir())} <= synced


@pytest.mark.parametrize("code", [errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EIO])
def test_a_folder_that_cannot_be_synced_is_no_error_but_a_broken_disk_is(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsync = os.fsync

    def refused(file: int) -> None:
        if stat.S_ISDIR(os.fstat(file).st_mode):
            raise OSError(code, os.strerror(code))
        fsync(file)

    monkeypatch.setattr("os.fsync", refused)
    if code == errno.EIO:
        with pytest.raises(InputError, match=r"cannot write .*a.txt: Input/output error"):
            write_text(tmp_path / "a.txt", "new")
    else:
        write_text(tmp_path / "a.txt", "new")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.txt", "new")]


def test_a_file_that_cannot_be_synced_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_text(tmp_path / "a.txt", "old")

    def refused(file: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.fsync", refused)
    with pytest.raises(InputError, match=r"cannot write .*a.txt: No space left on device"):
        write_text(tmp_path / "a.txt", "new")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.txt", "old")]


def test_a_folder_that_may_be_written_and_not_read_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = os.open

    def refused(path: Path, flags: int, mode: int = 0o777) -> int:
        if Path(path).is_dir():
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return opened(path, flags, mode)

    monkeypatch.setattr("os.open", refused)
    write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "new"
