"""The kernels of `cells`, compiled: the same lists, counted and filled box by box."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from planes.arrays import Ints
from planes.cells import Cells, coarse_enough
from planes.compiled import compiled

__all__ = ["cell_at", "cells_of", "listed_at", "met_boxes"]

INTS = types.Array(types.int64, 1, "A", readonly=True)
BOXES = types.Array(types.int64, 2, "C", readonly=True)
OUT = types.int64[::1]

BRUTE_PAIRS = 2**14
"""Pairs of boxes that are compared one by one: to list some 1000 boxes and to read the lists takes as long."""


@compiled(OUT(BOXES, types.int64, types.int64, OUT))
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


@njit(inline="always")
def cell_at(at_x, at_y, x, y, bits, wide, high):
    """The cell that a pixel is in; -1 beyond all."""
    column, row = np.uint64((at_x - x) >> bits), np.uint64((at_y - y) >> bits)  # what lies before 0 is far beyond
    inside = (column < np.uint64(wide)) & (row < np.uint64(high))
    return np.int64(row * np.uint64(wide) + column) if inside else -1


@compiled(types.int64(types.int64, types.int64, types.int64, types.int64, types.int64, *[INTS] * 4, OUT, OUT))
def _at(x, y, bits, wide, high, begin, listed, at_x, at_y, place, box):
    count, room = 0, len(place)
    for i in range(len(at_x)):
        cell = cell_at(at_x[i], at_y[i], x, y, bits, wide, high)
        if cell < 0:
            continue
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


@compiled(types.int64(BOXES, BOXES, OUT, OUT))
def _met(asked, boxes, rows, others):
    count, room = 0, len(rows)
    for row in range(len(asked)):
        left, top, right, bottom = asked[row]
        for box in range(len(boxes)):
            if (left <= boxes[box, 2]) & (right >= boxes[box, 0]) & (top <= boxes[box, 3]) & (bottom >= boxes[box, 1]):
                if count < room:
                    rows[count], others[count] = row, box
                count += 1
    return count


@compiled(types.int64(BOXES, BOXES, INTS, INTS, OUT, OUT))
def _met_of(asked, boxes, row, box, rows, others):
    count = 0
    for pair in range(len(row)):
        a, b = row[pair], box[pair]
        across = (asked[a, 0] <= boxes[b, 2]) & (asked[a, 2] >= boxes[b, 0])
        if across & (asked[a, 1] <= boxes[b, 3]) & (asked[a, 3] >= boxes[b, 1]):
            rows[count], others[count] = a, b
            count += 1
    return count


def met_boxes(asked_xyxy: Ints, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
    """See `cells.met_boxes`."""
    asked_xyxy, boxes_xyxy = np.ascontiguousarray(asked_xyxy), np.ascontiguousarray(boxes_xyxy)
    if len(asked_xyxy) * len(boxes_xyxy) > BRUTE_PAIRS and (asked_xyxy[:, :2] <= asked_xyxy[:, 2:]).all():
        reach = np.zeros(4, np.int64)
        reach[2:] = (asked_xyxy[:, 2:] - asked_xyxy[:, :2]).max(axis=0)
        listed = cells_of(boxes_xyxy, reach, int(reach.max()).bit_length())
        row, box = listed_at(listed, asked_xyxy[:, 0], asked_xyxy[:, 1])
        rows, others = np.empty(len(row), np.int64), np.empty(len(row), np.int64)
        count = _met_of(asked_xyxy, boxes_xyxy, row, box, rows, others)
        return rows[:count], others[:count]
    room = 4 * len(asked_xyxy) + 64
    while True:
        rows, others = np.empty(room, np.int64), np.empty(room, np.int64)
        count = _met(asked_xyxy, boxes_xyxy, rows, others)
        if count <= room:
            return rows[:count], others[:count]
        room = count
