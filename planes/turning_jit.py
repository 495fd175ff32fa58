"""Compiled twins of `planes.turning`."""

from __future__ import annotations

import numpy as np
from numba import types

from planes.arrays import Bools, Ints
from planes.compiled import compiled
from planes.spans import Box

__all__ = ["inverse_mapped", "sides_of"]

MASK = types.Array(types.boolean, 2, "C", readonly=True)
WHOLE = types.int64


@compiled(types.Tuple((WHOLE, types.boolean))(MASK, WHOLE, WHOLE, types.boolean, types.boolean, WHOLE))
def _on_border(inside, row, column, up, left, at):
    """The other squares beside a place: the last that is in the frame, or the first that is set; else `at`."""
    for j in (row, row - 1) if up else (row, row):
        for i in (column, column - 1) if left else (column, column):
            if 0 <= j < inside.shape[0] and 0 <= i < inside.shape[1]:
                at = j * inside.shape[1] + i
                if inside[j, i]:
                    return at, True
    return at, False


@compiled(types.void(MASK, *[WHOLE] * 6, types.int64[:, ::1], types.boolean[:, ::1]))
def _inverse_mapped(inside, first_x, first_y, c, s, unit_x, unit_y, found, held):
    h, w = np.uint64(inside.shape[0]), np.uint64(inside.shape[1])
    along_x, over_x, along_y, over_y = c // unit_x, c % unit_x, -s // unit_y, -s % unit_y
    for y in range(found.shape[0]):
        column, x_rest = (first_x + y * s) // unit_x, (first_x + y * s) % unit_x
        row, y_rest = (first_y + y * c) // unit_y, (first_y + y * c) % unit_y
        for x in range(found.shape[1]):
            at, is_held = -1, False
            j, i = np.uint64(row), np.uint64(column)  # what is less than 0 is large
            if j < h and i < w:
                at, is_held = np.int64(j * w + i), inside[j, i]
            if not is_held and (x_rest == 0 or y_rest == 0):
                at, is_held = _on_border(inside, row, column, y_rest == 0, x_rest == 0, at)
            found[y, x], held[y, x] = at, is_held
            column, x_rest = column + along_x, x_rest + over_x
            if x_rest >= unit_x:
                column, x_rest = column + 1, x_rest - unit_x
            row, y_rest = row + along_y, y_rest + over_y
            if y_rest >= unit_y:
                row, y_rest = row + 1, y_rest - unit_y


def inverse_mapped(
    inside: Bools, size_wh: tuple[int, int], first: tuple[int, int], step: tuple[int, int], unit: tuple[int, int]
) -> tuple[Ints, Bools]:
    """See `turning.inverse_mapped`; no division by pixel."""
    width, height = size_wh
    found, held = np.empty((height, width), np.int64), np.empty((height, width), np.bool_)
    _inverse_mapped(inside, *first, *step, *unit, found, held)
    return found, held


@compiled(types.UniTuple(WHOLE, 5)(types.Array(types.boolean, 2, "A", readonly=True)))
def _sides_of(mask):
    height, width = mask.shape
    x_min, y_min, x_max, y_max, count = width, height, -1, -1, 0
    for y in range(height):
        for x in range(width):
            if mask[y, x]:
                count += 1
                x_min, x_max = min(x_min, x), max(x_max, x)
                y_min, y_max = min(y_min, y), y
    return x_min, y_min, x_max, y_max, count


def sides_of(mask: Bools) -> tuple[Box, int]:
    """See `turning.sides_of`."""
    *box, count = _sides_of(mask)
    return (tuple(box) if count else (0, 0, -1, -1)), count
