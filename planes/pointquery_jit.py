"""The kernels of `pointquery`, compiled: one pass, and one walk for each pixel."""

from __future__ import annotations

import numpy as np
from numba import types

from planes.arrays import Bools, Codes, Ints
from planes.bitrows_jit import BOXES, EVERYWHERE, FLAGS, INTS, OUT, ROWS_OUT
from planes.compiled import compiled
from planes.constants import HALF
from planes.pointquery import CELL_BITS, Front, occupied
from planes.spans import Box
from planes.stack import Stack

__all__ = ["CELL_BITS", "front_at", "front_of", "occupied"]

CELLS = types.Array(types.boolean, 2, "C", readonly=True)
BITS = np.uint64(CELL_BITS)


@compiled(
    *(
        types.int64(
            types.Array(kind, 2, "C", readonly=True), CELLS, *[types.int64] * 2, BOXES, FLAGS, OUT, OUT, ROWS_OUT
        )
        for kind in (types.uint16, types.uint32)
    )
)  # fmt: skip
def _front_at(codes, cells, left, top, at_256, objects, place, item, xy):
    count = 0
    high, wide, coarse = np.uint64(codes.shape[0]), np.uint64(codes.shape[1]), cells.size > 0
    for i in range(len(at_256)):
        x, y = (at_256[i, 0] + HALF) >> 8, (at_256[i, 1] + HALF) >> 8
        column, row = np.uint64(x - left), np.uint64(y - top)  # what lies before the plane wraps far beyond it
        if (column >= wide) | (row >= high):
            continue
        if coarse and not cells[row >> BITS, column >> BITS]:
            continue
        front = np.int64(codes[row, column] >> 1)  # it is written, and the next over it if it is none: without a branch
        place[count], item[count], xy[count, 0], xy[count, 1] = i, front - 1, x, y
        count += objects[front]
    return count


NO_CELLS: Bools = np.zeros((0, 0), np.bool_)


def front_at(codes: Codes, cells: Bools | None, plane_xyxy: Box, at_256: Ints, objects: Bools) -> Front:
    """See `pointquery.front_at`."""
    place, item = np.empty((2, len(at_256)), np.int64)
    xy, coarse = np.empty(at_256.shape, np.int64), NO_CELLS if cells is None else cells
    count = _front_at(codes, coarse, plane_xyxy[0], plane_xyxy[1], at_256, objects, place, item, xy)
    return Front(place[:count], item[:count], xy[:count])


@compiled(types.int64(*[BOXES] * 2, INTS, INTS, FLAGS, FLAGS, types.UniTuple(types.int64, 4), OUT, OUT, ROWS_OUT))
def _front_of(at_256, box, offset, width, masks, occluder, bounds, place, rank, xy):
    count = 0
    for i in range(len(at_256)):
        x, y = (at_256[i, 0] + HALF) >> 8, (at_256[i, 1] + HALF) >> 8
        if x < bounds[0] or y < bounds[1] or x > bounds[2] or y > bounds[3]:
            continue
        for item in range(len(box)):
            across = (box[item, 0] <= x) & (box[item, 2] >= x)
            if not (across & (box[item, 1] <= y) & (box[item, 3] >= y)):
                continue
            if masks[offset[item] + (y - box[item, 1]) * width[item] + x - box[item, 0]]:
                place[count], rank[count], xy[count, 0], xy[count, 1] = i, item, x, y
                count += not occluder[item]
                break
    return count


def front_of(stack: Stack, bounds: Box | None, at_256: Ints) -> Front:
    """See `pointquery.front_of`."""
    place, rank = np.empty((2, len(at_256)), np.int64)
    xy = np.empty(at_256.shape, np.int64)
    what = stack.box_xyxy, stack.offset, stack.width, stack.masks, stack.occluder
    count = _front_of(at_256, *what, EVERYWHERE if bounds is None else bounds, place, rank, xy)
    return Front(place[:count], stack.ids.take(rank[:count]), xy[:count])
