"""The scenes that `hitplanes new` writes.

One is an example, which is shipped in `weapons/starter/`: a hit, a hidden and a missed target. The other is made of a
picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hitplanes.planes.common.checks import Image, InputError, path_of
from hitplanes.planes.common.limits import ALPHA_THRESHOLD
from hitplanes.planes.common.tables import inside
from hitplanes.planes.files.png import read_png, write_bytes, write_png, write_text
from hitplanes.planes.files.scene_folder import FILE_NAME, FORMAT, laid_out, new_folder

SHIPPED = Path(__file__).parent.parent
EXAMPLE, SCHEMA = SHIPPED / "starter", SHIPPED / "schemas" / "scene.json"
SCHEMA_NAME = "scene.schema.json"  # JSON Schema beside scene.json, by which an editor completes keys and marks mistakes
FROM_IMAGE = "--from-image"  # option of the command that names a picture
RED = (214, 62, 58)


def write_starter(folder: Path) -> None:
    """Write the example scene into a new or empty folder."""
    images = {path.name: path.read_bytes() for path in sorted(EXAMPLE.glob("*.png"))}
    _write(folder, (EXAMPLE / FILE_NAME).read_text(encoding="utf-8"), images)


def write_from_picture(folder: Path, picture: Path) -> None:
    """Write a scene of a picture, with a first shot, into a new or empty folder.

    A picture with transparent pixels becomes one object that can be hit: its opaque pixels. Any other becomes the
    background of a round target. The bounds of the scene are those of the picture. An InputError says if the picture is
    no PNG, or has no opaque pixel, or if the folder is not new or empty.
    """
    image = read_png(picture, FROM_IMAGE)
    height, width = image.shape[:2]
    opaque = image[:, :, 3] > ALPHA_THRESHOLD
    if not opaque.any():
        got = f"alpha up to {image[:, :, 3].max()} of 255"
        raise InputError(f"{FROM_IMAGE}: expected a picture with a pixel of alpha over {ALPHA_THRESHOLD}, got {got}")
    name, middle, radius = _name_of(picture), [(width - 1) / 2, (height - 1) / 2], max(min(width, height) // 8, 1)
    placed = {"name": name, "image": f"{name}.png", "position_xy": middle}
    if opaque.all():
        target = {"name": "target", "circle": radius, "color": list(RED), "position_xy": middle}
        objects, at = {"background": [placed], "hittable": [target]}, [middle[0] + radius, middle[1]]
    else:
        x, y = (np.arange(side, dtype=np.float32) - at for side, at in zip((width, height), middle, strict=True))
        far2 = np.where(opaque, y[:, None] ** 2 + x**2, np.float32(np.inf))
        at = [*divmod(int(far2.argmin()), width)][::-1]
        objects = {"hittable": [placed]}
    scene: dict[str, Any] = {"$schema": SCHEMA_NAME, "format": FORMAT, "name": name}
    scene |= {"bounds": {"origin_xy": [0, 0], "size_wh": [width, height]}, "objects": objects}
    scene |= {"weapons": {"blast": {"kind": "disc", "radius": radius}}, "shots": [{"weapon": "blast", "at": at}]}
    _write(folder, laid_out(scene) + "\n", {f"{name}.png": image})


def _name_of(picture: Path) -> str:
    """Name of a picture's file without its ending, or "picture" if that is no file name on every system."""
    try:
        return inside("name", f"{picture.stem}.png").removesuffix(".png")
    except InputError:
        return "picture"


def _write(folder: Path, scene: str, images: Mapping[str, Image | bytes]) -> None:
    """Write the text of a scene and its images, as pixels or as files, into a new or empty folder.

    scene.json is written last, so an incomplete scene cannot be loaded. An error or an interrupt removes all files.
    """
    folder = path_of("folder", folder)
    with new_folder(folder) as files:
        files += [folder / name for name in (FILE_NAME, SCHEMA_NAME, *images)]
        for name, image in images.items():
            if isinstance(image, bytes):
                write_bytes(folder / name, image)
            else:
                write_png(folder / name, image)
        write_text(folder / SCHEMA_NAME, SCHEMA.read_text(encoding="utf-8"))
        write_text(folder / FILE_NAME, scene)
