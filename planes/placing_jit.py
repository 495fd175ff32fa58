"""Compiled twins of `planes.placing`."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, Ints
from planes.compiled import compiled
from planes.constants import POSITION_MAX, SUB

__all__ = ["place"]


@compiled()
def place(
    ids: Ints, xy: Floats, count: int, alive: Ints, edge: Ints, position_256: Ints, box: Ints, before: Ints, after: Ints
) -> bool:
    """Place items at new positions and tell whether that was done; see `planes.placing.place`."""
    last = -1
    for i in range(len(ids)):
        item = ids[i]
        if item <= last or item >= count:
            return False
        if not (abs(xy[i, 0]) <= POSITION_MAX and abs(xy[i, 1]) <= POSITION_MAX and alive[item] != 0):
            return False
        last = item
    for i in range(len(ids)):
        item = ids[i]
        for axis in range(2):
            now = np.int64(np.rint(xy[i, axis] * SUB))
            position_256[item, axis] = now
            for side in (axis, axis + 2):
                before[i, side] = box[item, side]
                after[i, side] = (now + edge[item, side]) >> 8
                box[item, side] = after[i, side]
    return True
