"""Cells of the world: each lists the boxes that a pattern placed anywhere in it may meet."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.checks import Ints
from ..grid.spans import meets, ragged

CELLS_MOST = 2**20
"""Most cells of a grid: the column `begin` takes 8 MB."""

ENTRIES_A_BOX = 64
"""Mean number of cells that list a box, above which cells are made larger."""

BRUTE_PAIRS = 2**21
"""Most pairs of boxes that are compared one by one; listing 1000 boxes in cells and reading them takes as long."""

SPARSE = 0.1
"""Part of all boxes that a cell may list, if reading its list shall be faster than comparing all."""

FEW_PAIRS = 2**14
"""Most pairs of boxes that are compared as int64; converting so few to smaller types takes longer."""

PAIRS_AT_ONCE = 2**17
"""Pairs of boxes compared at a time: 128 KB of booleans."""


class Cells(NamedTuple):
    """Cells of the world, and the boxes listed in each.

    Parameters
    ----------
    x, y : first pixel of the first cell
    bits : a cell is 2**bits px wide and high
    wide, high : columns and rows of cells
    begin : (wide * high + 1,) where the list of each cell begins
    listed : the lists, box numbers rising within a cell
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


def is_sparse(sizes: tuple[tuple[float, float], tuple[float, float]], size_wh: Ints) -> bool:
    """Whether a cell that boxes of some size are looked up in lists less than SPARSE of all boxes.

    Parameters
    ----------
    sizes : mean size of the boxes, and size of the box around all
    """
    mean_wh, world_wh = sizes
    return bool(np.minimum((2 * size_wh + mean_wh) / np.maximum(world_wh, 1), 1).prod() < SPARSE)


def cells_of(boxes_xyxy: Ints, reach_xyxy: Ints, bits: int) -> Cells:
    """List each box in all cells from which a pattern may meet it.

    Parameters
    ----------
    boxes_xyxy : (n, 4) inclusive, px, none empty
    reach_xyxy : (4,) box of the pattern about the pixel that it is placed on
    bits : least side of a cell, as a power of two
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
    """The least `bits` with at most CELLS_MOST cells, and each box in at most ENTRIES_A_BOX of them on average."""
    far = high.max(axis=0)
    size = (high - low).astype(np.float64)
    while ((far >> bits) + 1.0).prod() > CELLS_MOST or (size / 2**bits + 1).prod(axis=1).mean() > ENTRIES_A_BOX:
        bits += 1
    return bits


def listed_at(cells: Cells, x: Ints, y: Ints) -> tuple[Ints, Ints]:
    """Sorted pairs (place, box) of boxes that patterns placed at pixels (n,) may meet."""
    column, row = x - cells.x, y - cells.y
    column >>= cells.bits
    row >>= cells.bits
    inside = within(column, row, cells.wide, cells.high)
    if inside is not None:
        column, row = column.take(inside), row.take(inside)
    row *= cells.wide
    row += column
    length = (cells.begin[1:] - cells.begin[:-1]).take(row)
    busy = length.nonzero()[0]
    length, begin = length.take(busy), cells.begin.take(row.take(busy))
    begin -= length.cumsum() - length
    entry = begin.repeat(length)
    entry += np.arange(len(entry))
    return (busy if inside is None else inside.take(busy)).repeat(length), cells.listed.take(entry)


def within(x: Ints, y: Ints, wide: int, high: int) -> Ints | None:
    """Places (n,) with 0 <= x < `wide` and 0 <= y < `high`; None if all have."""
    far = x.view(np.uint64), y.view(np.uint64)  # negative numbers become very large
    if int(far[0].max(initial=0)) < wide and int(far[1].max(initial=0)) < high:
        return None
    return ((far[0] < wide) & (far[1] < high)).nonzero()[0]


def met_boxes(asked_xyxy: Ints, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
    """Sorted pairs of inclusive boxes (n, 4) and (m, 4) that share a pixel; an empty box may lie within others."""
    if len(asked_xyxy) * len(boxes_xyxy) > BRUTE_PAIRS and (asked_xyxy[:, :2] <= asked_xyxy[:, 2:]).all():
        reach = np.concatenate([[0, 0], (asked_xyxy[:, 2:] - asked_xyxy[:, :2]).max(axis=0)])
        listed = cells_of(boxes_xyxy, reach, int(reach.max()).bit_length())
        row, box = listed_at(listed, asked_xyxy[:, 0], asked_xyxy[:, 1])
        met = meets(asked_xyxy[row], boxes_xyxy[box]).nonzero()[0]
        return row[met], box[met]
    if len(asked_xyxy) * len(boxes_xyxy) <= FEW_PAIRS:
        return _met_of_few(asked_xyxy, boxes_xyxy)
    every = max(1, len(boxes_xyxy))
    asked, boxes = _compact(asked_xyxy, boxes_xyxy)
    step = max(1, PAIRS_AT_ONCE // every)
    found = [_met(asked[first : first + step], boxes) + first * every for first in range(0, len(asked), step)]
    pair = found[0] if len(found) == 1 else np.concatenate([np.zeros(0, np.int64), *found])
    row = pair // every
    return row, pair - row * every


def _met_of_few(asked_xyxy: Ints, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
    """Like `met_boxes`, for few pairs: columns are compared first, then the rows of the pairs that are left."""
    x_min, y_min, x_max, y_max = asked_xyxy.T
    left, top, right, bottom = boxes_xyxy.T.copy()
    met = left <= x_max[:, None]
    met &= right >= x_min[:, None]
    pair = met.reshape(-1).nonzero()[0]
    row = pair // max(1, len(boxes_xyxy))
    box = pair - row * len(boxes_xyxy)
    met = top[box] <= y_max[row]
    met &= bottom[box] >= y_min[row]
    kept = met.nonzero()[0]
    return row[kept], box[kept]


def _met(asked: npt.NDArray[Any], boxes: npt.NDArray[Any]) -> Ints:
    """Pairs of boxes (n, 4) and others (4, m) that share a pixel, each as the number row * m + column."""
    left, top, right, bottom = asked.T
    met = boxes[0] <= right[:, None]
    met &= boxes[2] >= left[:, None]
    met &= boxes[1] <= bottom[:, None]
    met &= boxes[3] >= top[:, None]
    return np.asarray(met.reshape(-1).nonzero()[0])


def _compact(asked_xyxy: Ints, boxes_xyxy: Ints) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Boxes (n, 4), and others transposed (4, m), from a common corner, in the smallest integer type that fits."""
    if not len(asked_xyxy) or not len(boxes_xyxy):
        return asked_xyxy, boxes_xyxy.T
    both = (asked_xyxy, boxes_xyxy)
    low = min(int(np.minimum.reduce(boxes, axis=None)) for boxes in both)
    size = max(int(np.maximum.reduce(boxes, axis=None)) for boxes in both) - low
    kind = np.int16 if size < 2**15 else np.int32 if size < 2**31 else np.int64
    return (asked_xyxy - low).astype(kind), (boxes_xyxy - low).T.astype(kind, order="C")
