"""The inset of a shot's first hit: the pixels around it, large, with a grid and coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from planes.arrays import Image
from planes.scene import Scene
from planes.spans import Box
from weapons.marks import MARKS
from weapons.raymarks import draw_arrows
from weapons.world import World

__all__ = ["CELL", "COLUMNS", "ROWS", "Inset", "inset_of"]

CELL, COLUMNS, ROWS = 14, 15, 9
"""Side of a pixel of the world in the inset, px, and how many are shown; odd, so that the hit lies in the middle."""

LIGHT = 200
"""How much of the scene's light is left, of 255: more than around it."""

GRID = 130
"""How much of the light is left on the lines of the grid, of 255."""


class Inset(NamedTuple):
    """Enlarged pixels (h, w, 3), and the box of the world that they show."""

    image: Image
    view: Box


def inset_of(shot: Mapping[str, Any], scene: Scene) -> Inset | None:
    """Draw the pixels around the first hit of a shot; None if it hit nothing."""
    if not shot["rows"]:
        return None
    x, y = shot["rows"][0]["first_xy"]
    view = (x - COLUMNS // 2, y - ROWS // 2, x + COLUMNS // 2, y + ROWS // 2)
    world = World(scene, scene.bounds, view, CELL, LIGHT)
    for verdict in MARKS:
        world.mark_samples([shot], verdict)
    for item in sorted({row["object"] for row in shot["rows"]}):
        world.outline(item, "hit")
    image = world.image
    for line in (image[::CELL], image[:, ::CELL]):
        line[:] = (line.astype(np.uint16) * GRID // 255).astype(np.uint8)
    if "rays" in shot:
        draw_arrows(world, shot)
    left, top = COLUMNS // 2 * CELL, ROWS // 2 * CELL
    frame = image[top : top + CELL + 1, left : left + CELL + 1]
    frame[[0, -1]] = frame[:, [0, -1]] = (255, 255, 255)
    return Inset(image, view)
