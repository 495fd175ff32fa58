"""The kernels of `bitrows`, compiled: row for row the same, pair by pair and row by row instead of all at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from planes import bitrows
from planes.arrays import Ints
from planes.bitrows import Found, Placed, Windows
from planes.bits import Seen, Words
from planes.compiled import compiled
from planes.nearest import Beside
from planes.twins import in_parts

__all__ = [
    "FEW_ROWS",
    "bits_of",
    "found",
    "in_order",
    "is_beyond",
    "is_far",
    "key_of",
    "pixels_of",
    "row_order",
    "shared",
    "sort_places",
    "union",
    "visible",
]

INTS = types.Array(types.int64, 1, "A", readonly=True)
BOXES = types.Array(types.int64, 2, "C", readonly=True)
WORDS = types.Array(types.uint64, 1, "C", readonly=True)
FLAGS = types.Array(types.boolean, 1, "C", readonly=True)
OUT = types.int64[::1]
ROWS_OUT = types.int64[:, ::1]
ALL = np.uint64(2**64 - 1)
FAR = np.int64(2**62)
EVERYWHERE = (-(2**62), -(2**62), 2**62, 2**62)
ONE = np.uint64(1)
ROW_BITS, ROWS = 7, 127
ROOM, ROOM_LEAST = 8, 64
"""Rows for each placement, and beside, for which there is room at first."""

FEW_ROWS = 128
"""Rows of a placement that are put in order one by one: of more that takes longer than to sort all rows."""

SIDE, SIDE_BITS = np.int64(2**17), 19  # no pixel of a pattern is so far from its origin


@intrinsic
def bits_of(_: Any, word: Any) -> Any:
    """How many bits of a word are set."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.ctpop(values[0])

    return types.int64(types.uint64), made


@intrinsic
def _lowest(_: Any, word: Any) -> Any:
    """Place of the lowest bit of a word; 64 if it has none."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), made


@intrinsic
def _above(_: Any, word: Any) -> Any:
    """How many bits lie above the highest bit of a word; 64 if it has none."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.ctlz(values[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), made


@njit(inline="always")
def _window(words: Any, begin: Any, following: Any, shift: Any) -> Any:
    """One row of a window: a word, or parts of two neighbours."""
    if shift == 0:
        return words[begin]
    return (words[begin] >> np.uint64(shift)) | (words[begin + following] << np.uint64(64 - shift))


@njit(inline="always")
def key_of(distance2, x, y):
    """A number that sorts as (distance2, y, x): of two pixels of a row that are as far one lies before the origin."""
    return (distance2 << SIDE_BITS) | ((y + SIDE) << 1) | (x > 0)


@njit(inline="always")
def is_far(origin_x, origin_y, left, top, right, bottom):
    """Whether a box about an origin is too far from it for `key_of`."""
    across = max(abs(left - origin_x), abs(right - origin_x))
    return max(across, abs(top - origin_y), abs(bottom - origin_y)) >= SIDE


@njit(inline="always")
def is_beyond(strips, pattern, x, y, left, top, right, bottom):
    """Whether a box lies beyond the strip of a pattern that is placed on a pixel."""
    a, b = strips[pattern, 0], strips[pattern, 1]
    low = min(a * (left - x), a * (right - x)) + min(b * (top - y), b * (bottom - y))
    high = max(a * (left - x), a * (right - x)) + max(b * (top - y), b * (bottom - y))
    return (low > strips[pattern, 3]) | (high < strips[pattern, 2])


@njit(inline="always")
def _sooner(a, b, distance2, y, x):
    if distance2[a] != distance2[b]:
        return distance2[a] < distance2[b]
    if y[a] != y[b]:
        return y[a] < y[b]
    return x[a] < x[b] if x[a] != x[b] else a < b


@njit
def sort_places(order, distance2, y, x):
    """Sort places of rows by (distance2, y, x, place), as Shell (1959): they mostly are few, and in sorted runs."""
    step = 1
    while step < len(order) // 3:
        step = 3 * step + 1
    while step:
        for i in range(step, len(order)):
            row, j = order[i], i
            while j >= step and _sooner(row, order[j - step], distance2, y, x):
                order[j] = order[j - step]
                j -= step
            order[j] = row
        step //= 3


@njit(inline="always")
def pixels_of(first, last, origin_x, origin_y, distance2, x, y):
    """Tell squared distances and pixels of rows `first` .. `last` - 1 instead of keys and columns about an origin."""
    for i in range(first, last):
        x[i] += origin_x
        y[i] = origin_y + ((distance2[i] >> 1) & (2 * SIDE - 1)) - SIDE
        distance2[i] >>= SIDE_BITS


@njit(inline="always")
def in_order(first, last, origin_x, origin_y, seen, samples, distance2, x, y):
    """Sort rows `first` .. `last` - 1 of a placement, in columns, by their keys, and tell pixels instead of these.

    More than FEW_ROWS stay as they are: `rows_by` sorts them, or the caller.

    Parameters
    ----------
    origin_x, origin_y : the pixel from which distances are counted
    distance2, x : keys, and the columns of the nearest pixels about the origin; the first are then squared distances
    y : nothing yet
    """
    for i in range(first + 1, last if last - first <= FEW_ROWS else 0):
        item, count, key, across, j = seen[i], samples[i], distance2[i], x[i], i
        while j > first and distance2[j - 1] > key:
            seen[j], samples[j], distance2[j], x[j] = seen[j - 1], samples[j - 1], distance2[j - 1], x[j - 1]
            j -= 1
        seen[j], samples[j], distance2[j], x[j] = item, count, key, across
    pixels_of(first, last, origin_x, origin_y, distance2, x, y)


Kernel = Callable[..., tuple[int, int, int]]
"""Goes on with a placement, before a last one, after so many rows that it has written, by what it is given beside;
tells where it stopped, -1 if it cannot decide, the rows, and how many a placement has at most.

Columns of rows begin with the placement and what it hits, and end with squared distance, x and y.
"""


def rows_by(kernel: Kernel, columns: int, count: int, least: float, *given: Any) -> Ints | None:
    """Rows of all placements, as columns, in threads if there are enough; None if the kernel cannot decide them.

    Parameters
    ----------
    least : placements that are worth a thread
    given : to the kernel
    """
    parts = in_parts(count, least, lambda first, last: _filled(kernel, columns, first, last, given))
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    return known[0] if len(known) == 1 else np.concatenate(known, axis=1)


def _filled(kernel: Kernel, columns: int, who: int, last: int, given: tuple[Any, ...]) -> Ints | None:
    """Columns of the rows of some placements; room that is not written to costs nothing."""
    count, crowd, out = 0, 0, np.empty((columns, ROOM * (last - who) + ROOM_LEAST), np.int64)
    while True:
        who, count, most = kernel(who, last, count, out, *given)
        crowd = max(crowd, most)
        if who < 0:
            return None
        if who == last:
            rows = out[:, :count]
            return rows if crowd <= FEW_ROWS else rows[:, np.lexsort(rows[[1, -2, -1, -3, 0]])]
        more = np.empty((columns, 2 * out.shape[1]), np.int64)
        more[:, :count] = out[:, :count]
        out = more


@njit(inline="always")
def columns_about(own):
    """A column of a tile as the columns before and after it are told by shifts; and how far beyond the tile it is."""
    column = min(max(own, 0), 63)
    return np.uint64(column), np.uint64(63 - column), abs(own - column)


@njit(inline="always")
def row_key(met, row, down, ahead, behind, beyond):
    """A number that sorts the nearest pixels of rows by (squared distance, row); its last bit tells it lies after."""
    after, before = _lowest(met >> ahead), _above(met << behind)
    across = beyond + min(after, before)
    key = ((across * across + down * down) << ROW_BITS) | (row << 1) | (after < before)
    return key if met else FAR


@njit(inline="always")
def pixel_of(key, own, top):
    """Squared distance, x and y of the pixel of a `row_key` about an origin in column `own`, `top` px above row 0."""
    distance2, down = key >> ROW_BITS, top + ((key & ROWS) >> 1)
    column = min(max(own, 0), 63)
    along = np.int64(np.sqrt(distance2 - down * down)) - abs(own - column)  # of a square that a float holds
    return distance2, column - own + (along if key & 1 else -along), down


@njit
def shared(tiles, tile, windows, word, step, shift, low, high, own, level):
    """What a tile shares with a window, in rows from `low` to `high` of the world.

    Returns
    -------
    samples, and of the nearest to the origin at (own, level) by (y, x): squared distance, x and y about it. All rows
    are worked on alike, without a branch, so that eight of them are one instruction each.
    """
    tile, word, following = np.uint64(tile + low), np.uint64(word + low), np.uint64(word + step + low)
    right, left = np.uint64(shift), np.uint64(63 - shift)
    ahead, behind, beyond = columns_about(own)
    samples, nearest = np.int64(0), FAR
    for i in range((high - low + 8) & -8):
        row = np.uint64(i)
        met = tiles[tile + row] & ((windows[word + row] >> right) | (windows[following + row] << left << ONE))
        samples += bits_of(met)
        nearest = min(nearest, row_key(met, i, low - level + i, ahead, behind, beyond))
    if samples == 0:
        return samples, FAR, np.int64(0), np.int64(0)
    return samples, *pixel_of(nearest, own, low - level)


@compiled(types.int64(*[INTS] * 5, BOXES, INTS, INTS, WORDS, BOXES, INTS, WORDS, INTS, INTS, *[OUT] * 6))
def _found(
    pattern, x, y, origin_x, origin_y, pattern_box, first, following, windows, box, begin, tiles,
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
        tile = begin[at] - top
        own, level = origin_x[who] - left, origin_y[who]
        samples, distance2, across, down = shared(tiles, tile, windows, word, step, shift, low, high, own, level)
        if samples:
            out_placement[count], out_seen[count], out_samples[count] = who, at, samples
            out_distance2[count], out_x[count], out_y[count] = distance2, origin_x[who] + across, origin_y[who] + down
            count += 1
    return count


def found(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, beside: Beside) -> Found:
    """See `bitrows.found`; `beside` is not needed, nor are all shifts: a word takes two loads from a smaller table."""
    if windows.shifted:
        return bitrows.found(placed, windows, seen, placement, near, beside)
    out = np.empty((6, len(near)), np.int64)
    pattern = (windows.box_xyxy, windows.first, windows.rows, windows.words)
    count = _found(*placed, *pattern, seen.box_xyxy, seen.begin, seen.words, placement, near, *out)
    return Found(*out[:, :count])


@compiled(types.void(WORDS, INTS, INTS, INTS, INTS, types.uint64[:, ::1]))
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


@compiled(types.void(INTS, INTS, INTS, BOXES, INTS, INTS, WORDS, BOXES, INTS, WORDS, types.int64, *[INTS] * 3, OUT))
def _union(
    pattern, x, y, pattern_box, first, following, windows, box, begin, tiles, height, placement, near, group,
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
            for row in range(max(top, pattern_top), min(box[at, 3], y[who] + pattern_box[kind, 3]) + 1):
                together[row - top] |= tiles[begin[at] + row - top] & _window(windows, word + row, step, shift)
        samples = 0
        for row in range(height):
            samples += bits_of(together[row])
        out[number] = samples


def union(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, first: Ints) -> Ints:
    """See `bitrows.union`."""
    if windows.shifted:
        return bitrows.union(placed, windows, seen, placement, near, first)
    out = np.empty(len(first), np.int64)
    pattern = (windows.box_xyxy, windows.first, windows.rows, windows.words)
    tiles = (seen.box_xyxy, seen.begin, seen.words, seen.height)
    _union(*placed[:3], *pattern, *tiles, placement, near, first, out)
    return out


@compiled(types.void(*[INTS] * 4, OUT))
def _row_order(group, distance2, y, x, order):
    begin = 0
    while begin < len(order):
        end = begin
        while end < len(order) and group[end] == group[begin]:
            order[end] = end
            end += 1
        sort_places(order[begin:end], distance2, y, x)
        begin = end


def row_order(group: Ints, distance2: Ints, y: Ints, x: Ints) -> Ints:
    """See `bitrows.row_order`."""
    order = np.empty(len(group), np.int64)
    _row_order(group, distance2, y, x, order)
    return order
