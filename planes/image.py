"""PNG files in and out, as RGBA arrays (h, w, 4) of bytes; the header is read before anything is decoded."""

from __future__ import annotations

import os
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from planes.arrays import Image, InputError
from planes.constants import MASK_AREA_MAX, MASK_SIDE_MAX

__all__ = ["check_output", "read_png", "write_png", "write_text"]

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY = 0


def read_png(path: Path, field: str = "image") -> Image:
    """Read a PNG of any kind (grey, palette, 1 to 16 bits, with or without transparency) as RGBA bytes.

    Raises
    ------
    InputError
        If the file is missing, is no PNG, is damaged, or is larger than a mask may be.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{field}: expected a PNG file, got {path.name!r}: {error.strerror}") from error
    kind = _checked_header(data, f"{field}: {path.name!r}")
    import cv2  # here, because a scene without image files need not load it

    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None:
        raise InputError(f"{field}: expected a whole PNG file, got {path.name!r}, which is damaged")
    raw = np.asarray(decoded)
    shades = _grey_key(data, raw) if kind == GREY else None
    return _rgba(raw, shades)


def write_png(path: Path, image: Image) -> None:
    """Write an image (h, w, 3 or 4), RGB order, beside its place and rename it: never half a file."""
    import cv2

    order = cv2.COLOR_RGB2BGR if image.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    flat = [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_DEFAULT, cv2.IMWRITE_PNG_COMPRESSION, 6]
    _, data = cv2.imencode(".png", cv2.cvtColor(image, order), flat)  # a third of the size of OpenCV's default
    _replace(path, data.tobytes())


def write_text(path: Path, text: str) -> None:
    """Write a text file beside its place and rename it."""
    _replace(path, text.encode("utf-8"))


def check_output(path: Path) -> None:
    """Refuse, before any work is done, a place where no file can be written."""
    if not path.name or (path.exists() and not path.is_file()):
        raise InputError(f"output: cannot write {path}: expected the name of a file")
    if not path.parent.is_dir():
        raise InputError(f"output: cannot write {path}: no folder {path.parent}")


def _replace(path: Path, data: bytes) -> None:
    check_output(path)
    aside = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        aside.write_bytes(data)
        aside.replace(path)
    except OSError as error:
        raise InputError(f"output: cannot write {path}: {error.strerror}") from error
    finally:
        with suppress(OSError):
            aside.unlink()


def _checked_header(data: bytes, what: str) -> int:
    """Colour type of a PNG whose size is within the limits."""
    if data[:8] != SIGNATURE or data[12:16] != b"IHDR" or len(data) < 33:
        raise InputError(f"{what}: expected a PNG file, got something else ({len(data)} bytes)")
    width, height = struct.unpack(">II", data[16:24])
    if not (0 < width <= MASK_SIDE_MAX and 0 < height <= MASK_SIDE_MAX and width * height <= MASK_AREA_MAX):
        limit = f"sides from 1 to {MASK_SIDE_MAX} px and at most {MASK_AREA_MAX} px in all"
        raise InputError(f"{what}: expected {limit}, got {width} x {height}")
    return data[25]


def _grey_key(data: bytes, decoded: npt.NDArray[np.generic]) -> int | None:
    """Transparent shade of a grey PNG, in the decoded range: OpenCV loses it."""
    at = 8
    while at + 12 <= len(data):
        length, name = struct.unpack(">I4s", data[at : at + 8])
        if name == b"tRNS" and length >= 2:
            shade = int.from_bytes(data[at + 8 : at + 10], "big")
            return shade * (255 // (2 ** data[24] - 1)) if decoded.dtype == np.uint8 else shade
        if name == b"IDAT":
            break
        at += 12 + length
    return None


def _rgba(decoded: npt.NDArray[np.generic], transparent: int | None) -> Image:
    """Grey, BGR or BGRA of 8 or 16 bits to RGBA of 8, each value to the nearest."""
    pixels = decoded.astype(np.uint32)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    top = 255 if decoded.dtype == np.uint8 else 65535
    alpha = pixels[:, :, 3] if pixels.shape[2] == 4 else np.full(pixels.shape[:2], top, np.uint32)
    if transparent is not None:
        alpha = np.where(pixels[:, :, 0] == transparent, 0, top).astype(np.uint32)
    out = np.dstack([pixels[:, :, 2::-1], alpha])
    return ((out * 255 + top // 2) // top).astype(np.uint8)
