"""Kernels that crop bit rows to the box of their pixels; `cropping_jit` has the compiled twins."""

from __future__ import annotations

import numpy as np

from planes.arrays import Ints
from planes.bits import Words

__all__ = ["moved", "sides_of"]


def sides_of(rows: Words) -> Ints:
    """Inclusive boxes (V, 4) of the pixels of tiles (V, height), columns and rows; (0, 0, -1, -1) if there are none."""
    sides = np.empty((len(rows), 4), np.int64)
    some = rows != 0
    columns = np.bitwise_or.reduce(rows, axis=1)
    sides[:, 0] = np.bitwise_count(~columns & (columns - np.uint64(1)))
    sides[:, 1], sides[:, 3] = some.argmax(axis=1), rows.shape[1] - 1 - some[:, ::-1].argmax(axis=1)
    for bits in (1, 2, 4, 8, 16, 32):
        columns |= columns >> np.uint64(bits)
    sides[:, 2] = np.bitwise_count(columns)
    sides[:, 2] -= 1
    sides[columns == 0] = 0, 0, -1, -1
    return sides


def moved(rows: Words, kept: Ints, sides: Ints, height: int) -> Words:
    """Rows (n, height) of some tiles with the first pixel of each in row 0 and in column 0.

    Parameters
    ----------
    rows : (V, h) of all tiles
    kept : (n,) those asked for
    sides : (n, 4) boxes of their pixels, no higher than `height`
    """
    step = np.arange(height)
    inside = step <= (sides[:, 3] - sides[:, 1])[:, None]
    row = np.where(inside, step + (sides[:, 1] + kept * rows.shape[1])[:, None], 0)
    found = rows.reshape(-1).take(row)
    found >>= sides[:, :1].astype(np.uint64)
    found *= inside
    return found
