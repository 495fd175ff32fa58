"""The kernels of `bitrows`, compiled: row for row the same, pair by pair and row by row instead of all at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from planes.arrays import Bools, Codes, Ints
from planes.bitrows import Beside, Found, Placed, Seen, Windows, Words
from planes.spans import Box

__all__ = ["front_at", "found", "row_order", "union", "visible"]

INTS = types.Array(types.int64, 1, "A", readonly=True)
BOXES = types.Array(types.int64, 2, "C", readonly=True)
WORDS = types.Array(types.uint64, 1, "C", readonly=True)
FLAGS = types.Array(types.boolean, 1, "C", readonly=True)
OUT = types.int64[::1]
ALL = np.uint64(2**64 - 1)
FAR = np.int64(2**62)


@intrinsic
def _bits(_: Any, word: Any) -> Any:
    """How many bits of a word are set."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.ctpop(values[0])

    return types.int64(types.uint64), made


@intrinsic
def _lowest(_: Any, word: Any) -> Any:
    """Place of the lowest bit of a word that is not 0."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), made


@intrinsic
def _above(_: Any, word: Any) -> Any:
    """How many bits lie above the highest bit of a word that is not 0."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.ctlz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), made


@njit(inline="always")
def _window(words: Any, begin: Any, following: Any, shift: Any) -> Any:
    """One row of a window: a word, or parts of two neighbours."""
    if shift == 0:
        return words[begin]
    return (words[begin] >> np.uint64(shift)) | (words[begin + following] << np.uint64(64 - shift))


@njit(inline="always")
def _across(word: Any, column: Any) -> Any:
    """From a column to the nearest pixel of a word that is not 0; of two as near that before it."""
    if column <= 0:
        return _lowest(word) - column
    if column >= 63:
        return 63 - _above(word) - column
    right = word >> np.uint64(column)
    left = word << np.uint64(63 - column)
    if right == 0:
        return -_above(left)
    after = _lowest(right)
    if left != 0 and _above(left) <= after:
        return -_above(left)
    return after


@njit(inline="always")
def _within(column: Any, reach: Any) -> Any:
    """Columns of a word that lie within a reach of a column."""
    low, high = max(column - reach, 0), min(column + reach, 63)
    if low > 63 or high < 0 or reach < 0:
        return np.uint64(0)
    return (ALL << np.uint64(low)) & (ALL >> np.uint64(63 - high))


@njit
def _shared(tiles, tile, windows, word, step, shift, low, high):
    """Pixels that a tile shares with a window, in rows from `low` to `high` of the world."""
    samples = 0
    if shift == 0:
        for row in range(low, high + 1):
            samples += _bits(tiles[tile + row] & windows[word + row])
        return samples
    right, rest = np.uint64(shift), np.uint64(64 - shift)
    for row in range(low, high + 1):
        window = (windows[word + row] >> right) | (windows[word + step + row] << rest)
        samples += _bits(tiles[tile + row] & window)
    return samples


@njit
def _closest(tiles, tile, windows, word, step, shift, low, high, own, level):
    """Squared distance and place, about the origin at (own, level), of the nearest of these pixels, by (y, x)."""
    middle = min(max(level, low), high)
    best, best_x, best_y, nearer, first_row, last_row = FAR, np.int64(0), np.int64(0), ALL, low, high
    row = middle
    while row <= last_row:
        met = tiles[tile + row] & _window(windows, word + row, step, shift)
        if met & nearer:
            across, down = _across(met, own), row - level
            if across * across + down * down < best:
                best, best_x, best_y = across * across + down * down, across, down
                reach = np.int64(np.sqrt(best)) + 1  # no smaller than the root
                nearer, last_row = _within(own, reach), min(high, level + reach)
                first_row = max(low, level - reach)
        row += 1
    row = middle - 1
    while row >= first_row:
        met = tiles[tile + row] & _window(windows, word + row, step, shift)
        if met & nearer:
            across, down = _across(met, own), row - level
            if across * across + down * down <= best:  # of two as near the upper one is first
                best, best_x, best_y = across * across + down * down, across, down
                reach = np.int64(np.sqrt(best)) + 1
                nearer, first_row = _within(own, reach), max(low, level - reach)
        row -= 1
    return best, best_x, best_y


@njit(
    [types.int64(*[INTS] * 5, BOXES, INTS, INTS, WORDS, types.int64, BOXES, INTS, WORDS, INTS, INTS, *[OUT] * 6)],
    cache=True,
    nogil=True,
)
def _found(
    pattern, x, y, origin_x, origin_y, pattern_box, first, following, windows, shifted, box, begin, tiles,
    placement, near, out_placement, out_seen, out_samples, out_distance2, out_x, out_y,
):  # fmt: skip
    count = 0
    for pair in range(len(placement)):
        who, at = placement[pair], near[pair]
        kind, left, top = pattern[who], box[at, 0], box[at, 1]
        pattern_left, pattern_top = x[who] + pattern_box[kind, 0], y[who] + pattern_box[kind, 1]
        low = max(top, pattern_top)
        high = min(box[at, 3], y[who] + pattern_box[kind, 3])
        if low > high or left > x[who] + pattern_box[kind, 2] or pattern_left > box[at, 2]:
            continue
        column = left - pattern_left + 63
        shift, step = column & 63, following[kind]
        word = first[kind] + (column >> 6) * step - pattern_top
        if shifted:
            word += shift * shifted
            shift = 0
        tile = begin[at] - top
        samples = _shared(tiles, tile, windows, word, step, shift, low, high)
        if samples:
            out_placement[count], out_seen[count], out_samples[count] = who, at, samples
            own, level = origin_x[who] - left, origin_y[who]
            best, best_x, best_y = _closest(tiles, tile, windows, word, step, shift, low, high, own, level)
            out_distance2[count], out_x[count], out_y[count] = best, best_x, best_y
            count += 1
    return count


def found(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, beside: Beside) -> Found:
    """See `bitrows.found`; `beside` is not needed."""
    out = np.empty((6, len(near)), np.int64)
    pattern = (windows.box_xyxy, windows.first, windows.rows, windows.words, windows.shifted)
    count = _found(*placed, *pattern, seen.box_xyxy, seen.begin, seen.words, placement, near, *out)
    return Found(*out[:, :count])


@njit([types.void(WORDS, INTS, INTS, INTS, INTS, types.uint64[:, ::1])], cache=True, nogil=True)
def _visible(words, begin, of, front, right, seen):
    height = seen.shape[1]
    for tile in range(len(begin)):
        for row in range(height):
            seen[tile, row] = words[begin[tile] + row]
    for pair in range(len(of)):
        tile, shift = of[pair], right[pair]
        for row in range(height):
            cover = words[front[pair] + row]
            if shift >= 0:
                seen[tile, row] &= ~(cover << np.uint64(shift))
            else:
                seen[tile, row] &= ~(cover >> np.uint64(-shift))


def visible(words: Words, height: int, begin: Ints, of: Ints, front: Ints, right: Ints) -> Words:
    """See `bitrows.visible`."""
    seen = np.empty((len(begin), height), np.uint64)
    _visible(words, begin, of, front, right, seen)
    return seen


@njit(
    [
        types.void(
            INTS, INTS, INTS, BOXES, INTS, INTS, WORDS, types.int64, BOXES, INTS, WORDS, types.int64, *[INTS] * 3, OUT
        )
    ],
    cache=True,
    nogil=True,
)
def _union(
    pattern, x, y, pattern_box, first, following, windows, shifted, box, begin, tiles, height, placement, near, group,
    out,
):  # fmt: skip
    together = np.zeros(height, np.uint64)
    for number in range(len(group)):
        last = group[number + 1] if number + 1 < len(group) else len(placement)
        at = near[group[number]]
        left, top = box[at, 0], box[at, 1]
        together[:] = 0
        for pair in range(group[number], last):
            who = placement[pair]
            kind = pattern[who]
            pattern_top = y[who] + pattern_box[kind, 1]
            column = left - x[who] - pattern_box[kind, 0] + 63
            shift, step = column & 63, following[kind]
            word = first[kind] + (column >> 6) * step - pattern_top
            if shifted:
                word += shift * shifted
                shift = 0
            for row in range(max(top, pattern_top), min(box[at, 3], y[who] + pattern_box[kind, 3]) + 1):
                together[row - top] |= tiles[begin[at] + row - top] & _window(windows, word + row, step, shift)
        samples = 0
        for row in range(height):
            samples += _bits(together[row])
        out[number] = samples


def union(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, first: Ints) -> Ints:
    """See `bitrows.union`."""
    out = np.empty(len(first), np.int64)
    pattern = (windows.box_xyxy, windows.first, windows.rows, windows.words, windows.shifted)
    tiles = (seen.box_xyxy, seen.begin, seen.words, seen.height)
    _union(*placed[:3], *pattern, *tiles, placement, near, first, out)
    return out


@njit(inline="always")
def _sooner(a, b, distance2, y, x):
    if distance2[a] != distance2[b]:
        return distance2[a] < distance2[b]
    if y[a] != y[b]:
        return y[a] < y[b]
    return x[a] < x[b] if x[a] != x[b] else a < b


@njit([types.void(*[INTS] * 4, OUT)], cache=True, nogil=True)
def _row_order(group, distance2, y, x, order):
    begin = 0
    while begin < len(order):
        end = begin
        while end < len(order) and group[end] == group[begin]:
            order[end] = end
            end += 1
        step = 1
        while step < (end - begin) // 3:
            step = 3 * step + 1
        while step:  # Shell (1959): sorted runs of few rows are what there mostly is
            for i in range(begin + step, end):
                row, j = order[i], i
                while j - step >= begin and _sooner(row, order[j - step], distance2, y, x):
                    order[j] = order[j - step]
                    j -= step
                order[j] = row
            step //= 3
        begin = end


def row_order(group: Ints, distance2: Ints, y: Ints, x: Ints) -> Ints:
    """See `bitrows.row_order`."""
    order = np.empty(len(group), np.int64)
    _row_order(group, distance2, y, x, order)
    return order


@njit(
    [
        types.int64(types.Array(kind, 2, "C", readonly=True), *[types.int64] * 2, INTS, INTS, FLAGS, OUT, OUT)
        for kind in (types.uint16, types.uint32)
    ],
    cache=True,
    nogil=True,
)
def _front_at(codes, left, top, x, y, objects, place, item):
    count = 0
    high, wide = codes.shape
    for i in range(len(x)):
        column, row = x[i] - left, y[i] - top
        if 0 <= column < wide and 0 <= row < high:
            front = np.int64(codes[row, column] >> 1)
            if front and objects[front - 1]:
                place[count], item[count] = i, front - 1
                count += 1
    return count


def front_at(codes: Codes, plane_xyxy: Box, x: Ints, y: Ints, objects: Bools) -> tuple[Ints, Ints]:
    """See `bitrows.front_at`."""
    place, item = np.empty(len(x), np.int64), np.empty(len(x), np.int64)
    count = _front_at(codes, plane_xyxy[0], plane_xyxy[1], x, y, objects, place, item)
    return place[:count], item[:count]
