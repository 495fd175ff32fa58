"""Boxes by cell: which of them may a pattern meet, wherever in a cell of the world it is placed.

Functions from arrays to arrays; `cells_jit` has the same ones, compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planes.arrays import Ints
from planes.spans import ragged

__all__ = ["Cells", "cells_of", "coarse_enough", "listed_at"]

CELLS_MOST = 2**20
"""Cells of one list: 8 MB of where each begins."""

ENTRIES_A_BOX = 64
"""Cells that a box is listed in at most, on average, before the cells are made larger."""


class Cells(NamedTuple):
    """Cells of the world, and the boxes listed in each.

    Parameters
    ----------
    x, y : first pixel of the first cell
    bits : a cell is 2**bits px wide and high
    wide, high : cells
    begin : (wide * high + 1,) where the list of each cell begins
    listed : numbers of boxes, rising within a cell
    """

    x: int
    y: int
    bits: int
    wide: int
    high: int
    begin: Ints
    listed: Ints

    @property
    def nbytes(self) -> int:
        """Bytes of the lists."""
        return self.begin.nbytes + self.listed.nbytes


def cells_of(boxes_xyxy: Ints, reach_xyxy: Ints, bits: int) -> Cells:
    """List boxes by the cells in which a pattern that is placed there may meet them.

    Parameters
    ----------
    boxes_xyxy : (n, 4) inclusive, px, none empty
    reach_xyxy : (4,) box of the pattern about the pixel that it is placed on
    bits : of a cell's side, at least
    """
    low, high = boxes_xyxy[:, :2] - reach_xyxy[2:], boxes_xyxy[:, 2:] - reach_xyxy[:2]
    if not len(low):
        none = np.zeros(0, np.int64)
        return Cells(0, 0, bits, 0, 0, np.zeros(1, np.int64), none)
    corner = low.min(axis=0)
    low, high = low - corner, high - corner
    bits = coarse_enough(low, high, bits)
    wide, tall = ((high.max(axis=0) >> bits) + 1).tolist()
    first, last = low >> bits, high >> bits
    across = last[:, 0] - first[:, 0] + 1
    box, place = ragged(across * (last[:, 1] - first[:, 1] + 1))
    row, column = np.divmod(place, across[box])
    cell = (first[box, 1] + row) * wide + first[box, 0] + column
    begin = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=wide * tall))])
    x, y = corner.tolist()
    return Cells(x, y, bits, wide, tall, begin, box[np.argsort(cell, kind="stable")])


def coarse_enough(low: Ints, high: Ints, bits: int) -> int:
    """Bits of cells that are not too many, nor list each box too often."""
    far = high.max(axis=0)
    size = (high - low).astype(np.float64)
    while ((far >> bits) + 1.0).prod() > CELLS_MOST or (size / 2**bits + 1).prod(axis=1).mean() > ENTRIES_A_BOX:
        bits += 1
    return bits


def listed_at(cells: Cells, x: Ints, y: Ints) -> tuple[Ints, Ints]:
    """Boxes that patterns placed at pixels (n,) may meet, as (place, box), sorted."""
    column, row = (x - cells.x) >> cells.bits, (y - cells.y) >> cells.bits
    inside = (column >= 0) & (column < cells.wide) & (row >= 0) & (row < cells.high)
    cell = row * cells.wide + column
    every = inside.all()
    if not every:
        near = inside.nonzero()[0]
        cell = cell[near]
    begin = cells.begin[cell]
    length = cells.begin[cell + 1] - begin
    busy = length.nonzero()[0]
    length = length[busy]
    place = np.repeat(busy, length)
    offset = begin[busy] - np.cumsum(length) + length
    box = cells.listed[np.arange(len(place)) + np.repeat(offset, length)]
    return place if every else near[place], box
