"""How much of a disc lies on each object, counted pixel by pixel.

The truth that methods are judged by: it shares no code with them, and imports numpy alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Parts", "parts_of_discs"]

Ints = npt.NDArray[np.int64]
Target = tuple[int, npt.NDArray[np.bool_], tuple[int, int]]
"""An object's number, its mask (h, w), and the pixel (x, y) of the world at [0, 0]."""


class Parts(NamedTuple):
    """Discs and objects that share pixels: the disc (K,), the object (K,), how many, the nearest pixel (K, 2).

    The nearest is that to the disc's own; of several the least (y, x). `whole` is how many pixels a disc has.
    """

    disc: Ints
    object: Ints
    pixels: Ints
    nearest_xy: Ints
    whole: int


def parts_of_discs(center_xy: Ints, radius: int, targets: Sequence[Target]) -> Parts:
    """Count the pixels that discs share with objects, whatever lies in front of what.

    Parameters
    ----------
    center_xy : (N, 2) whole pixels
    radius : px; a pixel belongs to a disc when its centre is no farther away
    targets : in any order
    """
    side = np.arange(-radius, radius + 1)
    y, x = (grid.ravel() for grid in np.meshgrid(side, side, indexing="ij"))
    inside = x * x + y * y <= radius * radius
    xy = np.stack([x, y], axis=1)[inside]
    xy = xy[np.lexsort((xy[:, 0], xy[:, 1], (xy * xy).sum(axis=1)))]  # the nearest first
    found = []
    for number, mask, corner in targets:
        size = np.array(mask.shape[::-1])
        first = center_xy - np.array(corner)
        for disc in np.flatnonzero(((first >= -radius) & (first < size + radius)).all(axis=1)).tolist():
            at = first[disc] + xy
            on = np.flatnonzero(((at >= 0) & (at < size)).all(axis=1))
            on = on[mask[at[on, 1], at[on, 0]]]
            if len(on):
                found.append((disc, number, len(on), *(center_xy[disc] + xy[on[0]]).tolist()))
    rows = np.array(found, np.int64).reshape(-1, 5)
    return Parts(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3:], len(xy))
