"""A few boxes that cover a mask: the multiple-bounding-box idea.

Boxes are rows (x, y, x_end, y_end) of whole pixels, ends exclusive.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from planes.arrays import Bools, Ints
from planes.constants import BOXES_MAX
from planes.hull import extents

__all__ = ["cover"]


def cover(mask: Bools, k: int) -> Ints:
    """Cover a mask that is not empty by at most k boxes with few false pixels.

    Two ways, each a sequence in which one box more never covers more: cutting the worst box in two, from one box up;
    and from BOXES_MAX boxes down, joining the two that cost least. The better of both at k: optimal it is not.

    Returns
    -------
    (n, 4) boxes, n <= k
    """
    if k == 1:
        rows, first, last = extents(mask)
        return np.array([[first.min(), rows[0], last.max() + 1, rows[-1] + 1]])
    few, many = _cut(mask, k)
    return min((few, _area(few)), _join(many, k), key=lambda found: found[1])[0]


def _area(boxes: Ints) -> int:
    """Pixels of boxes that do not overlap."""
    return int((boxes[:, 2:] - boxes[:, :2]).prod(axis=1).sum())


@dataclass(frozen=True)
class _Part:
    """A tight box with its false pixels and its best cut: what it saves, along which axis, at which row or column."""

    box: tuple[int, int, int, int]
    false: int
    saved: int = 0
    axis: int = 0
    at: int = 0


def _cut(mask: Bools, k: int) -> tuple[Ints, Ints]:
    """Cut boxes in two, the one first that saves most: the state at k boxes, and at BOXES_MAX."""
    height, width = mask.shape
    parts: dict[int, _Part] = {0: _part(mask, 0, 0, width, height)}
    heap = [(0, 0, 0)] if parts[0].false else []
    few, made = list(parts.values()), 1
    while heap and len(parts) < BOXES_MAX:
        number = heapq.heappop(heap)[-1]
        for half in _halves(mask, parts.pop(number)):
            parts[made] = half
            if half.false:
                heapq.heappush(heap, (-half.saved, -half.false, made))
            made += 1
        if len(parts) <= k:
            few = list(parts.values())
    return np.array([part.box for part in few]), np.array([part.box for part in parts.values()])


def _halves(mask: Bools, part: _Part) -> tuple[_Part, _Part]:
    x, y, x_end, y_end = part.box
    if part.axis == 0:
        return _part(mask, x, y, x_end, y + part.at), _part(mask, x, y + part.at, x_end, y_end)
    return _part(mask, x, y, x + part.at, y_end), _part(mask, x + part.at, y, x_end, y_end)


def _part(mask: Bools, x: int, y: int, x_end: int, y_end: int) -> _Part:
    """Shrink a box to its pixels and find its best cut."""
    inside = mask[y:y_end, x:x_end]
    rows, first, last = extents(inside)
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(first.min()), int(last.max()) + 1
    inside = inside[top:bottom, left:right]
    box = (x + left, y + top, x + right, y + bottom)
    false = inside.size - int(np.count_nonzero(inside))
    if not false:
        return _Part(box, 0)
    by_row = _best_cut(rows - top, first, last, bottom - top)
    by_column = _best_cut(*extents(inside.T), right - left)
    axis = int(by_column < by_row)
    area, _, at = (by_row, by_column)[axis]
    return _Part(box, false, inside.size - area, axis, at)


def _best_cut(rows: Ints, first: Ints, last: Ints, height: int) -> tuple[int, int, int]:
    """Cut between filled rows so that the two tight boxes are smallest; of equal ones the nearest to the middle.

    Returns
    -------
    area of both, distance from the middle, row that begins the lower one
    """
    if len(rows) < 2:
        return height * int(last[0] - first[0] + 1), height, 0
    above = (rows + 1) * _widths(first, last)
    below = (height - rows) * _widths(first[::-1], last[::-1])[::-1]
    areas = above[:-1] + below[1:]
    off_middle = np.abs(2 * rows[1:] - height)
    best = np.lexsort((off_middle, areas))[0]
    return int(areas[best]), int(off_middle[best]), int(rows[best + 1])


def _widths(first: Ints, last: Ints) -> Ints:
    """Width of the box of the rows so far."""
    return np.maximum.accumulate(last) - np.minimum.accumulate(first) + 1


def _join(boxes: Ints, k: int) -> tuple[Ints, int]:
    """Join the two boxes whose common box covers least that no box covers yet, until k are left; and their area.

    All corners lie on the lines of the first boxes: boxes are kept as numbers of lines, areas per cell between them.
    """
    xs, ys = np.unique(boxes[:, 0::2]), np.unique(boxes[:, 1::2])
    cells = np.stack([np.searchsorted(lines, v) for lines, v in zip((xs, ys, xs, ys), boxes.T, strict=True)], axis=1)
    free = np.diff(ys)[:, None] * np.diff(xs)
    whole = int(free.sum())
    for x, y, x_end, y_end in cells.tolist():
        free[y:y_end, x:x_end] = 0
    ones, others = np.tril_indices(len(cells), -1)  # the pairs of the first n boxes come first
    while (n := len(cells)) > k:
        one, other = ones[: n * (n - 1) // 2], others[: n * (n - 1) // 2]
        low, high = np.minimum(cells[one, :2], cells[other, :2]), np.maximum(cells[one, 2:], cells[other, 2:])
        best = np.argmin(_sums(free, low, high))
        (x, y), (x_end, y_end) = low[best].tolist(), high[best].tolist()
        free[y:y_end, x:x_end] = 0
        within = (cells[:, :2] >= (x, y)).all(axis=1) & (cells[:, 2:] <= (x_end, y_end)).all(axis=1)
        cells = np.concatenate([cells[~within], [[x, y, x_end, y_end]]])
    joined = np.stack([xs[cells[:, 0]], ys[cells[:, 1]], xs[cells[:, 2]], ys[cells[:, 3]]], axis=1)
    return joined, whole - int(free.sum())


def _sums(values: Ints, low: Ints, high: Ints) -> Ints:
    """Sums of a table over boxes of its cells, by a table of sums from the corner."""
    height, width = values.shape
    table = np.zeros((height + 1, width + 1), np.int64)
    values.cumsum(axis=0).cumsum(axis=1, out=table[1:, 1:])
    flat, (x, y), (x_end, y_end) = table.reshape(-1), low.T, high.T
    top, bottom = y * (width + 1), y_end * (width + 1)
    sums: Ints = flat[bottom + x_end] - flat[top + x_end] - flat[bottom + x] + flat[top + x]
    return sums
