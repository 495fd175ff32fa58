"""Compiled twins of `planes.cropping`."""

from __future__ import annotations

import numpy as np
from numba import types

from planes.arrays import Ints
from planes.bits import Words
from planes.compiled import compiled

__all__ = ["moved", "sides_of"]

ROWS = types.Array(types.uint64, 2, "C", readonly=True)
INTS = types.Array(types.int64, 1, "C", readonly=True)
BOXES = types.Array(types.int64, 2, "C", readonly=True)


@compiled(types.int64[:, ::1](ROWS))
def sides_of(rows: Words) -> Ints:
    """Inclusive boxes (V, 4) of the pixels of tiles; see `planes.cropping.sides_of`."""
    zero, one = np.uint64(0), np.uint64(1)
    sides = np.empty((len(rows), 4), np.int64)
    for tile in range(len(rows)):
        columns, top, bottom = zero, 0, -1
        for row in range(rows.shape[1]):
            word = rows[tile, row]
            if word != zero:
                if columns == zero:
                    top = row
                bottom = row
                columns |= word
        left, right = 0, 63 if columns != zero else -1
        while columns != zero and (columns >> np.uint64(left)) & one == zero:
            left += 1
        while columns != zero and (columns >> np.uint64(right)) & one == zero:
            right -= 1
        sides[tile, 0], sides[tile, 1], sides[tile, 2], sides[tile, 3] = left, top, right, bottom
    return sides


@compiled(types.uint64[:, ::1](ROWS, INTS, BOXES, types.int64))
def moved(rows: Words, kept: Ints, sides: Ints, height: int) -> Words:
    """Rows of some tiles with the first pixel of each in row 0 and in column 0; see `planes.cropping.moved`."""
    found = np.zeros((len(kept), height), np.uint64)
    for i in range(len(kept)):
        left, top = np.uint64(sides[i, 0]), sides[i, 1]
        for row in range(sides[i, 3] - top + 1):
            found[i, row] = rows[kept[i], top + row] >> left
    return found
