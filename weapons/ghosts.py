"""The present over a picture of the past: where things are now, and the way that they went."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from planes.arrays import Bools
from planes.spans import Spans
from weapons.strokes import Strokes
from weapons.world import OUTLINES, World

__all__ = ["draw_present"]

WIDTH, DASH, HEAD = 1.4, 6.0, 11.0
"""Width of the way of a thing, length of its dashes and of its head, px."""

FAR = 6.0
"""A shorter way than this is not drawn, px of the picture."""


def draw_present(world: World, report: Mapping[str, Any]) -> Bools:
    """Draw the outlines of what has moved since, and an arrow from where it was.

    Returns
    -------
    what of the picture (h, w) the arrows cover
    """
    strokes = Strokes(world.image.shape[:2])
    for entry in report["now"]["moved"]:
        runs = np.array(entry["runs"], np.int64).reshape(-1, 3)
        world.outline_pixels(Spans(*runs.T), "now")
        begin, end = ((np.array(entry[key]) - world.view[:2] + 0.5) * world.factor for key in ("from_xy", "to_xy"))
        way = end - begin
        length = float(np.sqrt((way**2).sum()))
        if length > FAR:
            strokes.line(begin, end, WIDTH, DASH)
            strokes.head(end, way / length, min(HEAD, length))
    strokes.lay(world.image, *OUTLINES["now"], grounded=True)
    return np.asarray(strokes.ground > 0)
