"""Spoilt scenes and images by the thousand: each loads or is an InputError, in bounded time and in silence.

The cases run in a process of their own, so that a crash is noticed; what it was given last lies in its folder.
"""

from __future__ import annotations

import copy
import json
import signal
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracle_png import CHANNELS, GREY, KINDS, PALETTE, RGB, SIGNATURE, chunk, chunks_of, joined, png, rgba

from hitplanes import InputError, load_scene, read_png, weapons_of
from hitplanes.weapons.replay.shot_log import requests_of

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "fixtures" / "gallery"
SECONDS = 10
"""A case that takes longer hangs."""

Rng = np.random.Generator


def pick(rng: Rng, options: Any) -> Any:
    return options[int(rng.integers(len(options)))]


class HangError(BaseException):
    """Nothing of the project catches it."""


def hang(*_: object) -> None:
    raise HangError


# Scenes


NASTY: list[Any] = [
    None, True, False, 0, -1, 1, 0.5, -0.0, 255, 256, 2**15, 2**15 + 1, 2**31, 2**40, 2**63, 2**64, 10**30, 10**400,
    1e300, 1e-300, "", "x", "#", ".#", "duck 1", "target", "\ud800", "\0", "a\nb", "..", "../x.png", "/etc/passwd",
    "wall.png", "x" * 300, [], {}, [[]], [{}], [None], [True, 2], [1, [2]], [0, 0], [1, 2, 3], [[0, 0], [5, 0], [0, 5]],
    ["#"], ["##", "#"], {"a": 1}, {"kind": "point"}, {"kind": "disc", "radius": 3}, {"grid_wh": [1, 1]},
    {"kind": "rounds", "weapon": {"kind": "point"}, "count": 2}, {"size_wh": [5, 5]},
]  # fmt: skip
SPELLINGS = [
    "NaN", "Infinity", "-Infinity", "1e999", "-1e999", "1" * 5000, "-0", "1.0", "01", "+1", "0x1", "'a'", "/**/", "tru",
    "[" * 900 + "]" * 900, "\ufeff", '"\\ud800"', '"\\u0000"', "nul", "{}", "[]", '{"kind":1,"kind":2}', ",", ":", "}",
]  # fmt: skip


def inner(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every container of a JSON value, with each of its keys."""
    for key in list(data) if isinstance(data, dict) else range(len(data)):
        yield data, key
        if isinstance(data[key], dict | list):
            yield from inner(data[key])


def spoil_value(rng: Rng, data: Any) -> None:
    places = list(inner(data))
    if not places:
        return
    holder, key = pick(rng, places)
    match pick(rng, ["drop", "nasty", "nasty", "nasty", "from elsewhere", "wrap", "rename", "add", "double"]):
        case "drop":
            del holder[key]
        case "nasty":
            holder[key] = copy.deepcopy(pick(rng, NASTY))
        case "from elsewhere":
            other, of = pick(rng, places)
            holder[key] = copy.deepcopy(other[of])
        case "wrap":
            holder[key] = [holder[key]] if rng.integers(2) else {"a": holder[key]}
        case "rename" if isinstance(holder, dict):
            name = str(key)
            at = int(rng.integers(len(name) + 1))
            holder[name[:at] + pick(rng, ["", "s", "_", "\ud800"]) + name[at + 1 :]] = holder.pop(key)
        case "add" if isinstance(holder, dict):
            other, of = pick(rng, places)
            holder[str(of)] = copy.deepcopy(other[of])
        case "double" if isinstance(holder, list):
            holder.insert(key, copy.deepcopy(holder[key]))


def spoil_text(rng: Rng, data: bytes) -> bytes:
    at = int(rng.integers(len(data) + 1))
    match pick(rng, ["cut", "flip", "spell", "swap", "insert"]):
        case "cut":
            return data[:at]
        case "flip":
            return spoilt_bytes(rng, data)
        case "spell":
            end = at
            while end < len(data) and data[end] not in b",]}":
                end += 1
            return data[:at] + pick(rng, SPELLINGS).encode("utf-8", "surrogatepass") + data[end:]
        case "swap":
            end = min(len(data), at + int(rng.integers(1, 200)))
            return data[:at] + data[end : end + 50] + data[at:end] + data[end + 50 :]
        case _:
            return data[:at] + bytes(rng.integers(0, 256, 3).astype(np.uint8)) + data[at:]


def read_scene(folder: Path) -> bool:
    """Load a scene with its weapons and shots; False if that is refused."""
    try:
        scene = load_scene(folder)
        requests_of(scene, weapons_of(scene))
    except InputError as error:
        assert len(str(error)) < 20_000
        return False
    return True


def fuzz_scenes(seed: int, count: int, place: str) -> None:
    """Spoil the gallery's JSON, `count` times."""
    folder = Path(place)
    for path in GALLERY.glob("*.png"):
        (folder / path.name).write_bytes(path.read_bytes())
    base = json.loads((GALLERY / "scene.json").read_text())
    read = 0
    for case in range(count):
        rng = np.random.default_rng((seed, case))
        data = copy.deepcopy(base)
        if rng.integers(2):  # fewer objects and more of the rest
            for section in data["objects"].values():
                del section[int(rng.integers(1, 4)) :]
        for _ in range(int(rng.integers(1, 4))):
            spoil_value(rng, data)
        text = json.dumps(data).encode()
        for _ in range(int(pick(rng, [0, 0, 0, 1, 2]))):
            text = spoil_text(rng, text)
        (folder / "scene.json").write_bytes(text)
        signal.alarm(SECONDS)
        read += read_scene(folder)
        signal.alarm(0)
    assert 0 < read < count
    assert {p.name for p in folder.iterdir()} == {"scene.json", *(p.name for p in GALLERY.glob("*.png"))}


# Images


def spoilt_bytes(rng: Rng, data: bytes) -> bytes:
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        if out:
            at = int(rng.integers(len(out)))
            out[at] = out[at] ^ (1 << int(rng.integers(8))) if rng.integers(2) else pick(rng, (0, 255, 1, 127, 128))
    return bytes(out)


def some_image(rng: Rng) -> bytes:
    kind, depth = pick(rng, KINDS)
    values = rng.integers(0, 2**depth, (int(rng.integers(1, 10)), int(rng.integers(1, 14)), CHANNELS[kind]))
    extra = []
    if kind == PALETTE:
        extra.append(chunk(b"PLTE", bytes(rng.integers(0, 256, 3 * 2**depth).astype(np.uint8))))
    if kind in (GREY, RGB, PALETTE) and rng.integers(2):
        key = struct.pack(f">{CHANNELS[kind]}H", *values[0, 0].tolist())
        extra.append(chunk(b"tRNS", key if kind != PALETTE else bytes(rng.integers(0, 256, 2).astype(np.uint8))))
    if rng.integers(2):
        extra.append(chunk(pick(rng, (b"iCCP", b"gAMA", b"eXIf", b"acTL", b"tEXt", b"sBIT")), rng.bytes(9)))
    filters = rng.integers(0, 5, 4).tolist()
    return png(values, depth, kind, *extra, interlaced=bool(rng.integers(2)), filters=filters)


def spoil_chunks(rng: Rng, data: bytes) -> bytes:
    """Change chunks, with right checksums."""
    chunks = list(chunks_of(data))
    at = int(rng.integers(len(chunks)))
    name, body = chunks[at]
    match pick(rng, ["body", "header", "pixels", "drop", "double", "move", "name", "cut", "split", "longer"]):
        case "body":
            chunks[at] = name, spoilt_bytes(rng, body)
        case "header":
            start = bytearray(chunks[0][1])
            field = int(rng.integers(len(start)))
            start[field] = pick(rng, (0, 1, 2, 3, 4, 6, 8, 16, 255))
            chunks[0] = chunks[0][0], bytes(start)
        case "pixels":
            which = next(i for i, (n, _) in enumerate(chunks) if n == b"IDAT")
            raw = spoilt_bytes(rng, zlib.decompress(chunks[which][1]))
            chunks[which] = (
                b"IDAT",
                zlib.compress(raw[: len(raw) - int(pick(rng, (0, 0, 0, 1)))], int(rng.integers(10))),
            )
        case "drop":
            del chunks[at]
        case "double":
            chunks.insert(int(rng.integers(len(chunks) + 1)), chunks[at])
        case "move":
            chunks.insert(int(rng.integers(len(chunks))), chunks.pop(at))
        case "name":
            chunks[at] = (
                pick(rng, (b"IDAT", b"PLTE", b"tRNS", b"IEND", b"IHDR", b"teXt", b"ABCD", spoilt_bytes(rng, name))),
                body,
            )
        case "cut":
            chunks[at] = name, body[: int(rng.integers(len(body) + 1))]
        case "split":
            half = int(rng.integers(len(body) + 1))
            chunks[at : at + 1] = [(name, body[:half]), (name, body[half:])]
        case _:
            chunks[at] = name, body + rng.bytes(3)
    return joined(chunks)


def check_image(path: Path, data: bytes) -> bool:
    """Read an image, to the pixels that the plain decoder finds; False if it is refused."""
    try:
        image = read_png(path)
    except InputError as error:
        assert "\n" not in str(error)
        return False
    width, height = struct.unpack(">II", data[16:24])
    assert image.shape == (height, width, 4) and image.dtype == np.uint8
    assert np.array_equal(image, rgba(data))
    return True


def fuzz_images(seed: int, count: int, place: str) -> None:
    """Spoil small PNGs of every kind, `count` times."""
    path, read = Path(place) / "a.png", 0
    for case in range(count):
        rng = np.random.default_rng((seed, case))
        data = some_image(rng)
        match pick(rng, ["chunks", "chunks", "chunks", "bytes", "cut", "whole"]):
            case "chunks":
                data = spoil_chunks(rng, data)
                if rng.integers(3) == 0 and data[:8] == SIGNATURE:
                    data = spoilt_bytes(rng, data)
            case "bytes":
                data = spoilt_bytes(rng, data)
            case "cut":
                data = data[: int(rng.integers(len(data)))]
            case _:
                data += rng.bytes(int(rng.integers(3)))
        path.write_bytes(data)
        signal.alarm(SECONDS)
        read += check_image(path, data)
        signal.alarm(0)
    assert count // 20 < read < count


# Both, in a process of their own


def run_apart(fuzz: Callable[[int, int, str], None], seed: int, count: int, folder: Path) -> None:
    code = (
        "import faulthandler, signal, test_fuzz; faulthandler.enable(); signal.signal(signal.SIGALRM, test_fuzz.hang); "
        f"test_fuzz.{fuzz.__name__}({seed}, {count}, {str(folder)!r})"
    )
    path = f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'tests')!r}]; "
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", path + code], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", ""), f"{run.stderr}\nthe last case lies in {folder}"


@pytest.mark.parametrize(("fuzz", "count"), [(fuzz_scenes, 100), (fuzz_images, 240)], ids=["scenes", "images"])
def test_spoilt_files_load_or_are_refused(fuzz: Callable[[int, int, str], None], count: int, tmp_path: Path) -> None:
    run_apart(fuzz, 1, count, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize(("fuzz", "count"), [(fuzz_scenes, 3000), (fuzz_images, 30_000)], ids=["scenes", "images"])
def test_many_spoilt_files_load_or_are_refused(
    fuzz: Callable[[int, int, str], None], count: int, seed: int, tmp_path: Path
) -> None:
    run_apart(fuzz, seed, count, tmp_path)
