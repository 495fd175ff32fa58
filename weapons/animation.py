"""Moving pictures: a GIF, written by OpenCV, or numbered PNG files in a folder of their own."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from planes.arrays import Image, InputError
from planes.image import check_output, write_bytes, write_png
from weapons.folders import empty_folder

__all__ = ["can_write_gif", "write_frames", "write_gif"]

NO_DITHER = 3
"""What OpenCV takes for none, unlike what it says: by -1 to 2 it strews dots over even ground."""

COLORS = 6
"""Binary digits of the number of colours: 64 are enough for flat drawings, and make small files."""


def can_write_gif() -> bool:
    """Whether this OpenCV writes GIF files: from 4.12 on, unless it was built without."""
    import cv2

    return hasattr(cv2, "imwriteanimation") and cv2.haveImageWriter("x.gif")


def write_gif(path: Path, frames: Iterable[Image], milliseconds: int) -> None:
    """Write frames (h, w, 3) of bytes, RGB order, as a GIF that goes on without end: never half a file.

    Raises
    ------
    InputError
        If it cannot be written, by this OpenCV or in this place.
    """
    import cv2

    check_output(path)
    if not can_write_gif():
        raise InputError(f"output: expected the name of a folder: OpenCV {cv2.__version__} writes no GIF, got {path}")
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in frames]
    animation.durations = [milliseconds] * len(animation.frames)
    flat = [cv2.IMWRITE_GIF_QUALITY, COLORS, cv2.IMWRITE_GIF_DITHER, NO_DITHER, cv2.IMWRITE_GIF_TRANSPARENCY, 0]
    with tempfile.TemporaryDirectory() as folder:
        aside = Path(folder) / "aside.gif"
        if not cv2.imwriteanimation(str(aside), animation, flat):
            raise InputError(f"output: cannot write {path}: OpenCV {cv2.__version__} did not encode it")
        write_bytes(path, aside.read_bytes())


def write_frames(folder: Path, frames: Iterable[Image]) -> int:
    """Write frames (h, w, 3) of bytes, RGB order, as 000.png, 001.png, ...; tells how many.

    What an interrupt leaves is removed.

    Raises
    ------
    InputError
        If the folder is neither new nor empty, or cannot be written to.
    """
    made, written = empty_folder(folder), 0
    try:
        for frame in frames:
            write_png(folder / f"{written:03}.png", frame)
            written += 1
    except BaseException:
        with suppress(OSError):
            for number in range(written + 1):
                (folder / f"{number:03}.png").unlink(missing_ok=True)
            if made:
                folder.rmdir()
        raise
    return written
