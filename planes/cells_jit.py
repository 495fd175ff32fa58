"""The kernels of `cells`, compiled: the same lists, counted and filled box by box."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from planes.arrays import Ints
from planes.cells import Cells, coarse_enough

__all__ = ["cells_of", "listed_at"]

INTS = types.Array(types.int64, 1, "A", readonly=True)
BOXES = types.Array(types.int64, 2, "C", readonly=True)
OUT = types.int64[::1]


@njit([OUT(BOXES, types.int64, types.int64, OUT)], cache=True, nogil=True)
def _listed(spans, wide, cells, begin):
    for box in range(len(spans)):
        for row in range(spans[box, 1], spans[box, 3] + 1):
            for column in range(spans[box, 0], spans[box, 2] + 1):
                begin[row * wide + column + 1] += 1
    for cell in range(cells):
        begin[cell + 1] += begin[cell]
    listed = np.empty(begin[cells], np.int64)
    for box in range(len(spans)):
        for row in range(spans[box, 1], spans[box, 3] + 1):
            for column in range(spans[box, 0], spans[box, 2] + 1):
                cell = row * wide + column
                listed[begin[cell]] = box
                begin[cell] += 1
    for cell in range(cells, 0, -1):
        begin[cell] = begin[cell - 1]
    begin[0] = 0
    return listed


def cells_of(boxes_xyxy: Ints, reach_xyxy: Ints, bits: int) -> Cells:
    """See `cells.cells_of`."""
    if not len(boxes_xyxy):
        return Cells(0, 0, bits, 0, 0, np.zeros(1, np.int64), np.zeros(0, np.int64))
    spans = boxes_xyxy - np.concatenate([reach_xyxy[2:], reach_xyxy[:2]])
    x, y = spans[:, :2].min(axis=0).tolist()
    spans -= (x, y, x, y)
    bits = coarse_enough(spans[:, :2], spans[:, 2:], bits)
    spans >>= bits
    wide, high = (spans[:, 2:].max(axis=0) + 1).tolist()
    begin = np.zeros(wide * high + 1, np.int64)
    return Cells(x, y, bits, wide, high, begin, _listed(spans, wide, wide * high, begin))


@njit(
    [types.int64(types.int64, types.int64, types.int64, types.int64, types.int64, *[INTS] * 4, OUT, OUT)],
    cache=True,
    nogil=True,
)
def _at(x, y, bits, wide, high, begin, listed, at_x, at_y, place, box):
    count, room = 0, len(place)
    for i in range(len(at_x)):
        column, row = (at_x[i] - x) >> bits, (at_y[i] - y) >> bits
        if column < 0 or row < 0 or column >= wide or row >= high:
            continue
        cell = row * wide + column
        for entry in range(begin[cell], begin[cell + 1]):
            if count < room:
                place[count], box[count] = i, listed[entry]
            count += 1
    return count


def listed_at(cells: Cells, x: Ints, y: Ints) -> tuple[Ints, Ints]:
    """See `cells.listed_at`."""
    room = 2 * len(x) + 64
    while True:
        place, box = np.empty(room, np.int64), np.empty(room, np.int64)
        count = _at(*cells, x, y, place, box)
        if count <= room:
            return place[:count], box[:count]
        room = count
