"""The scenes that `hitplanes new` writes.

One is an example, with images drawn by code and a hit, a hidden and a missed target. The other is made of a picture.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, Image, InputError, path_of
from hitplanes.planes.common.limits import ALPHA_THRESHOLD
from hitplanes.planes.common.tables import Mask, inside
from hitplanes.planes.files.png import read_png, write_png, write_text
from hitplanes.planes.files.scene_folder import FILE_NAME, laid_out, new_folder

SCHEMAS = Path(__file__).parent.parent / "schemas"

FROM_IMAGE = "--from-image"  # option of the command that names a picture

WIDTH, HEIGHT = 320, 180
Color = tuple[int, int, int]
INK: Color = (52, 38, 48)
RED: Color = (214, 62, 58)
PAPER: Color = (250, 242, 224)
WOOD: Color = (188, 132, 76)
GRASS: Color = (92, 158, 76)
SKY_HIGH, SKY_LOW = (104, 170, 220), (220, 238, 240)

SCHEMA_NAME = "scene.schema.json"  # JSON Schema beside scene.json, by which an editor completes keys and marks mistakes

SCENE: dict[str, Any] = {
    "$schema": SCHEMA_NAME,
    "format": "hitplanes-scene/2",
    "name": "A range to start from",
    "bounds": {"origin_xy": [0, 0], "size_wh": [WIDTH, HEIGHT]},
    "categories": ["target"],
    "objects": {
        "background": [{"name": "meadow", "image": "meadow.png", "position_xy": [159.5, 89.5]}],
        "hittable": [
            {"name": "balloon", "image": "balloon.png", "position_xy": [88, 74], "categories": ["target"]},
            {"name": "bullseye", "image": "bullseye.png", "position_xy": [226, 118], "categories": ["target"]},
        ],
        "occluders": [
            {"name": "crate", "image": "crate.png", "position_xy": [252, 138], "layer": 1},
            {"name": "ground", "image": "ground.png", "position_xy": [159.5, 167.5], "layer": 2},
        ],
        "hud": [{"name": "score", "image": "score.png", "position_xy": [40, 12]}],
    },
    "weapons": {
        "point": {"kind": "point"},
        "shotgun": {"kind": "spread", "pellet": {"kind": "disc", "radius": 2}, "count": 10, "radius": 26},
        "blast": {"kind": "disc", "radius": 22, "falloff": "linear"},
    },
    "shots": [
        {"weapon": "shotgun", "at": [238, 112], "seed": 7},
        {"weapon": "blast", "at": [66, 50], "accept": ["target"]},
        {"weapon": "point", "at": [109, 66]},
    ],
}

SCORE = (
    ".###..###..###.####.#####........###....#...#####",
    "#....#....#...##...##.......#...#...#..##...#....",
    ".###.#....#...#####.####............#...#...####.",
    "....##....#...##..#.#.......#.....##....#.......#",
    "####..###..###.#...######.......#####..###..####.",
)
"""Pixels of the text on the score display."""


def write_starter(folder: Path) -> None:
    """Write the example scene into a new or empty folder."""
    draw = {"meadow": _meadow, "balloon": _balloon, "bullseye": _bullseye, "crate": _crate, "ground": _ground}
    _write(folder, SCENE, {f"{name}.png": image() for name, image in {**draw, "score": _score}.items()})


def write_from_picture(folder: Path, picture: Path) -> None:
    """Write a scene of a picture, with a first shot, into a new or empty folder.

    A picture with transparent pixels becomes one object that can be hit: its opaque pixels. Any other becomes the
    background of a round target. The bounds of the scene are those of the picture.

    Raises
    ------
    InputError
        If the picture is not a PNG, or has no opaque pixel; or if the folder is not new or empty.
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
    scene = {key: SCENE[key] for key in ("$schema", "format")}
    scene |= {"name": name, "bounds": {"origin_xy": [0, 0], "size_wh": [width, height]}, "objects": objects}
    scene |= {"weapons": {"blast": {"kind": "disc", "radius": radius}}, "shots": [{"weapon": "blast", "at": at}]}
    _write(folder, scene, {f"{name}.png": image})


def _name_of(picture: Path) -> str:
    """Name of a picture's file without its ending, or "picture" if that is no file name on every system."""
    try:
        return inside("name", f"{picture.stem}.png").removesuffix(".png")
    except InputError:
        return "picture"


def _write(folder: Path, scene: dict[str, Any], images: dict[str, Image]) -> None:
    """Write a scene and its images into a new or empty folder.

    scene.json is written last, so an incomplete scene cannot be loaded. An error or an interrupt removes all files.
    """
    folder = path_of("folder", folder)
    with new_folder(folder) as files:
        files += [folder / name for name in (FILE_NAME, SCHEMA_NAME, *images)]
        for name, image in images.items():
            write_png(folder / name, image)
        write_text(folder / SCHEMA_NAME, (SCHEMAS / "scene.json").read_text(encoding="utf-8"))
        write_text(folder / FILE_NAME, laid_out(scene) + "\n")


def _clear(width: int, height: int) -> tuple[Image, Floats, Floats]:
    """Return a clear image, and the x and y (h, w) of its pixel centres, from its centre."""
    y, x = np.mgrid[:height, :width].astype(np.float64)
    return np.zeros((height, width, 4), np.uint8), x - (width - 1) / 2, y - (height - 1) / 2


def _paint(image: Image, where: Bools, color: Color) -> None:
    image[where] = (*color, 255)


def _inked(image: Image) -> Image:
    """Draw a dark outline around the opaque pixels of an image."""
    inside = image[:, :, 3] > 0
    near = np.pad(inside, 1)
    around = near[:-2, 1:-1] | near[2:, 1:-1] | near[1:-1, :-2] | near[1:-1, 2:]
    _paint(image, around & ~inside, INK)
    return image


def _shaded(image: Image, light: Floats) -> Image:
    """Multiply the colours of an image by factors (h, w)."""
    lit = np.clip(image[:, :, :3] * light[:, :, None], 0, 255)
    image[:, :, :3] = lit.astype(np.uint8)
    return image


def _meadow() -> Image:
    """Sky, a sun, two clouds and two rows of hills."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    part = np.clip(y / 130, 0, 1)[:, :, None]
    image = np.full((HEIGHT, WIDTH, 4), 255, np.uint8)
    image[:, :, :3] = (np.array(SKY_HIGH) * (1 - part) + np.array(SKY_LOW) * part).astype(np.uint8)
    _paint(image, np.hypot(x - 282, y - 32) < 17, (250, 214, 110))
    for left, top in ((150, 34), (28, 112)):
        for dx, dy, radius in ((0, 0, 9), (13, -5, 11), (27, 0, 8), (13, 3, 9)):
            _paint(image, np.hypot(x - left - dx, (y - top - dy) * 1.3) < radius, (246, 250, 252))
    _paint(image, y > 128 + 9 * np.sin(x / 37) + 5 * np.sin(x / 17 + 1), (150, 196, 148))
    _paint(image, y > 144 + 6 * np.sin(x / 29 + 2), (122, 180, 112))
    return image


def _balloon() -> Image:
    """A round balloon with a knot and a string."""
    image, x, y = _clear(44, 84)
    top = y + 18
    _paint(image, (x / 19) ** 2 + (top / 22) ** 2 < 1, RED)
    _paint(image, (abs(x) < (top - 19) / 1.5) & (top > 20) & (top < 27), RED)
    _shaded(image, 1.1 - 0.35 * np.clip((x + top) / 40, 0, 1))
    _paint(image, ((x + 7) / 3.5) ** 2 + ((top + 9) / 6) ** 2 < 1, (244, 148, 136))
    _inked(image)
    _paint(image, (abs(x - 2.5 * np.sin(top / 5)) < 1) & (top >= 27) & (y < 41), INK)
    return image


def _bullseye() -> Image:
    """Rings on a post."""
    image, x, y = _clear(60, 96)
    top = y + 18
    _paint(image, (abs(x) < 4) & (top > 0) & (y < 47), WOOD)
    far = np.hypot(x, top)
    for radius, color in ((28, RED), (21, PAPER), (14, RED), (7, PAPER)):
        _paint(image, far < radius, color)
    _paint(image, far < 2.5, INK)
    return _inked(_shaded(image, 1.05 - 0.2 * np.clip((x + top) / 40, 0, 1)))


def _crate() -> Image:
    """Boards in a frame, with a brace across."""
    image, x, y = _clear(54, 54)
    reach = np.maximum(abs(x), abs(y))
    _paint(image, reach < 26, WOOD)
    frame = (reach > 20) | (abs(x + y) < 5)
    joint = (np.floor(y / 8) != np.floor((y + 1) / 8)) & ~frame
    edge = (abs(reach - 20) < 1) | ((abs(abs(x + y) - 5) < 1) & (reach < 20))
    light = 1.0 + 0.22 * frame - 0.22 * joint - 0.35 * edge + 0.04 * np.sin(x * 0.9 + np.floor(y / 8) * 7)
    return _inked(_shaded(image, np.where(reach < 26, light, 1)))


def _ground() -> Image:
    """A strip of grass, its blades along the top."""
    y, x = np.mgrid[:26, :WIDTH].astype(np.float64)
    image, _, _ = _clear(WIDTH, 26)
    blade = 5 + 2.5 * np.sin(x * 1.9) + 2 * np.sin(x * 0.7 + 1)
    _paint(image, y > blade, GRASS)
    return _shaded(image, 1.1 - 0.25 * np.clip((y - blade) / 16, 0, 1) + 0.05 * np.sin(x * 2.3 + y))


def _score() -> Image:
    """A dark plate with the score on it."""
    text = Mask().check("score", SCORE).astype(np.uint8)
    height, width = text.shape
    image = np.full((height + 8, width + 12, 4), (*INK, 255), np.uint8)
    _paint(image[4:-4, 6:-6], text == 1, (250, 214, 110))
    return image
