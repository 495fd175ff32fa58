"""How a verdict looks: one shape and one colour each, told apart by the colour-blind and in grey."""

from __future__ import annotations

import numpy as np

from planes.arrays import Bools

__all__ = ["MARKS", "glyph"]

MARKS: dict[str, tuple[tuple[int, int, int], int]] = {
    "empty": ((255, 255, 255), 190),
    "outside": ((240, 228, 66), 220),
    "filtered": ((230, 140, 200), 235),
    "occluded": ((86, 180, 233), 245),
    "hit": ((235, 96, 10), 225),
}
"""Colour (after Okabe and Ito) and opacity of each verdict, in the order of drawing."""


def glyph(verdict: str, size: int) -> Bools:
    """Shape (size, size) of a mark: block, cross, bar, frame or dot; a block where it is too small for a shape."""
    if size < 3:
        return np.ones((size, size), np.bool_)
    free = int(size > 3)  # larger marks leave a line between neighbours
    last = size - 1 - free
    y, x = np.mgrid[:size, :size]
    thick = max(1, size // 6)
    shapes = {
        "hit": np.ones((size, size), np.bool_),
        "occluded": (abs(x - y) < thick) | (abs(x + y - last) < thick),
        "filtered": abs(2 * y - last) <= thick,
        "outside": (x < thick) | (y < thick) | (x > last - thick) | (y > last - thick),
        "empty": (abs(2 * x - last) <= thick) & (abs(2 * y - last) <= thick),
    }
    return np.asarray(shapes[verdict] & (x <= last) & (y <= last), np.bool_)
