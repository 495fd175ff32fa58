"""Kernels that scale and turn masks by inverse mapping; `turning_jit` has the compiled twins."""

from __future__ import annotations

from itertools import product

import numpy as np

from planes.arrays import Bools, Ints
from planes.spans import Box

__all__ = ["inverse_mapped", "sides_of"]


def inverse_mapped(
    inside: Bools, size_wh: tuple[int, int], first: tuple[int, int], step: tuple[int, int], unit: tuple[int, int]
) -> tuple[Ints, Bools]:
    """Map each centre of a result back to the closed squares of a frame that hold it: any that is set, if there is one.

    Parameters
    ----------
    inside : (h, w) of the frame, in one piece
    size_wh : of the result
    first : column and row of the frame where the first centre of the result lies, in parts
    step : (cos, sin): by how many parts column and row grow from one centre to the next, and row and column fall
    unit : parts of a column, and of a row

    Returns
    -------
    (height, width) flat index of the frame's pixel, -1 for none; and whether that one is set
    """
    (h, w), (width, height) = inside.shape, size_wh
    across, down = np.arange(width), np.arange(height)[:, None]
    columns = _squares(first[0] + across * step[0] + down * step[1], unit[0])
    rows = _squares(first[1] + down * step[0] - across * step[1], unit[1])
    found, held = np.full(height * width, -1), np.zeros(height * width, np.bool_)
    for row, column in product(rows, columns):
        valid = (row >= 0) & (row < h) & (column >= 0) & (column < w)
        some = np.flatnonzero(valid.ravel() & ~held)
        source = row.take(some) * w + column.take(some)
        found[some], held[some] = source, inside.take(source)
    return found.reshape(height, width), held.reshape(height, width)


def _squares(place: Ints, unit: int) -> list[Ints]:
    """Columns (or rows) of the closed squares that hold places; two of them where a place is on a border."""
    column = place // unit
    border = place == column * unit
    return [column, column - border] if border.any() else [column]


def sides_of(mask: Bools) -> tuple[Box, int]:
    """Inclusive box around the pixels of a mask (h, w), and how many they are; of none it ends before it begins."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return (0, 0, -1, -1), 0
    return (int(columns[0]), int(rows[0]), int(columns[-1]), int(rows[-1])), int(np.count_nonzero(mask))
