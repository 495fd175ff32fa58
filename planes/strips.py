"""Strips: the pixels of a long pattern lie between two parallel lines, and boxes beyond them share none with it.

The separating axis of an oriented box that is not along its own sides, as a filter before pixels are counted; compiled
kernels have the same test inline.

References
----------
Gottschalk, Lin and Manocha, "OBBTree: a hierarchical structure for rapid interference detection" (1996).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from planes.arrays import Ints
from planes.spans import Spans

__all__ = ["NO_STRIPS", "Strip", "meets_strip", "strip_of", "strips_of"]

Strip = tuple[int, int, int, int]

NO_STRIPS: Ints = np.zeros((0, 4), np.int64)

SCALE = 2**10
"""Length of the normals of strips, about."""

TILE = 48
"""Sides of what patterns meet, px, about: larger ones are dropped by a strip less often."""

PAYS = 0.75
"""Part of the boxes that meet a pattern's own, at most, that meet its strip, too: each is one more test."""


def strips_of(strips: Sequence[Strip], boxes_xyxy: Ints) -> Ints:
    """Strips (n, 4) of patterns with boxes (n, 4); none (0, 4) where the boxes of most tell about as much."""
    made = np.array(strips, np.int64).reshape(-1, 4)
    normal, side = np.abs(made[:, :2]), boxes_xyxy[:, 2:] - boxes_xyxy[:, :2]
    grown = TILE * normal.sum(axis=1)
    met = (made[:, 3] - made[:, 2] + grown) / np.maximum((normal * side).sum(axis=1) + grown, 1)
    return made if met.mean() <= PAYS else NO_STRIPS


def strip_of(spans: Spans) -> Strip:
    """The strip along the pixels of a set, as (a, b, low, high): low <= a * x + b * y <= high of each of them.

    The direction is that in which they lie least far apart, by their second moments.
    """
    if not len(spans):
        return 0, 0, 0, 0
    length = (spans.x_last - spans.x_first + 1).astype(np.float64)
    x, y = (spans.x_first + spans.x_last) / 2, spans.y.astype(np.float64)
    x, y = x - np.average(x, weights=length), y - np.average(y, weights=length)
    xx, xy, yy = (float((length * part).sum()) for part in (x * x + (length * length - 1) / 12, x * y, y * y))
    along = math.atan2(2 * xy, xx - yy) / 2
    a, b = round(-SCALE * math.sin(along)), round(SCALE * math.cos(along))
    ends = np.concatenate([a * spans.x_first, a * spans.x_last]) + b * np.concatenate([spans.y, spans.y])
    return a, b, int(ends.min()), int(ends.max())


def meets_strip(strips: Ints, which: Ints | int, left: Ints, top: Ints, wide: int, high: int) -> Ints:
    """Places of the boxes (n,) that are not beyond the strip of their pattern.

    Parameters
    ----------
    strips, which : (m, 4) strips, and which of them each box is compared with
    left, top : (n,) corners of the boxes about the pattern's origin
    wide, high : columns and rows of all boxes, at most
    """
    a, b = strips[:, 0], strips[:, 1]
    least = strips[:, 2] - np.maximum(a, 0) * (wide - 1) - np.maximum(b, 0) * (high - 1)
    most = strips[:, 3] - np.minimum(a, 0) * (wide - 1) - np.minimum(b, 0) * (high - 1)
    across = a[which] * left
    across += b[which] * top
    met = across >= least[which]
    met &= across <= most[which]
    return np.asarray(met.nonzero()[0])
