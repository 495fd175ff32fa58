"""How a verdict looks: one shape and one colour each, told apart by the colour-blind and in grey."""

from __future__ import annotations

import numpy as np

from planes.arrays import Bools

__all__ = ["HEAT", "LET_THROUGH", "MARKS", "PASSED_OVER", "SKETCH", "TINT", "glyph", "tiled_glyph"]

MARKS: dict[str, tuple[tuple[int, int, int], int]] = {
    "beyond": ((178, 184, 196), 190),
    "empty": ((255, 255, 255), 190),
    "outside": ((240, 228, 66), 220),
    "filtered": ((230, 140, 200), 235),
    "occluded": ((86, 180, 233), 245),
    "hit": ((255, 125, 15), 240),
}
"""Colour (after Okabe and Ito) and opacity of each verdict, in the order of drawing."""

HEAT = (
    (66, 10, 104), (106, 23, 110), (147, 38, 103), (188, 55, 84), (221, 81, 58), (243, 120, 25), (252, 165, 10),
    (246, 215, 70), (252, 255, 164),
)  # fmt: skip
"""Colours of heat, from the least to the most: after inferno (Smith, van der Walt 2015), rising in lightness."""

LET_THROUGH, PASSED_OVER = "let through to the pixels", "passed over, by box or volume"
SKETCH = {
    LET_THROUGH: (96, 226, 150),
    PASSED_OVER: (150, 156, 168),
    "volume of the shot": (255, 255, 255),
    "cell opened": (86, 180, 233),
    "cell": (96, 102, 114),
}
"""Colours of what may be drawn of a pre-filter: volumes of items, volumes of shots, cells."""

TINT = 40
"""Opacity of a mark's ground: where samples are too small for a shape each, it shows all of them."""

EYE_MIN = 8
"""Least size of a block with an eye, px: by it a hit stands out in grey from what it hit."""

SHAPE_MIN = 6
"""Least size of a shape on the page, px; smaller samples share one."""


def tiled_glyph(verdict: str, factor: int, shape: tuple[int, ...]) -> Bools:
    """Marks side by side over a page (height, width), one for each sample, or for a few where they are small."""
    size = factor if factor >= SHAPE_MIN // 2 else -(-SHAPE_MIN // factor) * factor
    one = glyph(verdict, size)
    return np.tile(one, (-(-shape[0] // size), -(-shape[1] // size)))[: shape[0], : shape[1]]


def glyph(verdict: str, size: int) -> Bools:
    """Shape (size, size) of a mark: block with an eye, cross, bar, frame, dot, dashes; a block if it is too small."""
    if size < 3:
        return np.ones((size, size), np.bool_)
    free = int(size > 3)  # larger marks leave a line between neighbours
    last = size - 1 - free
    y, x = np.mgrid[:size, :size]
    thick = max(1, size // 6)
    dot = (abs(2 * x - last) <= thick) & (abs(2 * y - last) <= thick)
    shapes = {
        "hit": ~dot if size >= EYE_MIN else np.ones((size, size), np.bool_),
        "occluded": (abs(x - y) < thick) | (abs(x + y - last) < thick),
        "filtered": abs(2 * y - last) <= thick,
        "outside": (x < thick) | (y < thick) | (x > last - thick) | (y > last - thick),
        "empty": dot,
        "beyond": (abs(2 * y - last) <= thick) & (x * 5 // size % 2 == 0),
    }
    return np.asarray(shapes[verdict] & (x <= last) & (y <= last), np.bool_)
