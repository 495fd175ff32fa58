"""Compiled kernels of bit rows, which work pair by pair and row by row; and of the draws of pellets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .. import late
from ..bits.bit_rows import NO_STRIPS, NO_SUMS, WORD, PatternBits, Words
from ..bits.blockers import Blockers
from ..common.backend import in_parts
from ..common.checks import Ints
from ..common.limits import GOLDEN, SUB
from ..grid.spans import WIDEST, RowRuns, row_order
from .cache import compiled, helper

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
ROW_BITS, WORD_ROWS = 7, 127
ROOM, ROOM_LEAST = 8, 64  # initial room for rows: ROOM for each placement, plus ROOM_LEAST
FEW_ROWS = 128  # most rows of a placement that are sorted by insertion; if any has more, all rows are sorted at the end

SIDE, SIDE_BITS = np.int64(2**17), 19  # farther than any pixel of a pattern from its origin


@intrinsic
def bits_of(_: Any, word: Any) -> Any:
    """Number of bits set in a word."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.ctpop(values[0])

    return types.int64(types.uint64), made


@intrinsic
def lowest(_: Any, word: Any) -> Any:
    """Place of the lowest set bit of a word; 64 if none is set."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), made


@intrinsic
def _above(_: Any, word: Any) -> Any:
    """Number of bits above the highest set bit of a word; 64 if none is set."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.ctlz(values[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), made


@helper(inline="always")
def key_of(distance2, x, y):
    """A number that sorts as (distance2, y, x); two equally far pixels of a row lie on both sides of the origin."""
    return (distance2 << SIDE_BITS) | ((y + SIDE) << 1) | (x > 0)


@helper(inline="always")
def is_far(origin_x, origin_y, left, top, right, bottom):
    """Whether a box reaches too far from an origin for `key_of`."""
    across = max(abs(left - origin_x), abs(right - origin_x))
    return max(across, abs(top - origin_y), abs(bottom - origin_y)) >= SIDE


@helper(inline="always")
def is_beyond(strips, pattern, x, y, left, top, right, bottom):
    """Whether a box lies beyond the strip of a pattern that is placed on a pixel."""
    a, b = strips[pattern, 0], strips[pattern, 1]
    low = min(a * (left - x), a * (right - x)) + min(b * (top - y), b * (bottom - y))
    high = max(a * (left - x), a * (right - x)) + max(b * (top - y), b * (bottom - y))
    return (low > strips[pattern, 3]) | (high < strips[pattern, 2])


@helper(inline="always")
def pixels_of(first, last, origin_x, origin_y, distance2, x, y):
    """Replace keys and relative columns of rows `first` .. `last` - 1 by squared distances and pixels."""
    for i in range(first, last):
        x[i] += origin_x
        y[i] = origin_y + ((distance2[i] >> 1) & (2 * SIDE - 1)) - SIDE
        distance2[i] >>= SIDE_BITS


Kernel = Callable[..., tuple[int, int, int]]
"""A function of (placement, end, rows written so far, columns of rows, further arguments), which goes on from there.

It returns (placement where it stopped, or -1 if it cannot decide; rows written; most rows of a placement). Columns
begin with the placement and the rank that it hits, and end with squared distance, x and y.
"""


def rows_by(kernel: Kernel, columns: int, count: int, least: float, *given: Any) -> Ints | None:
    """Rows of all placements, as columns, in threads if there are enough; None if the kernel cannot decide them.

    A thread has at least so many placements; `given` are further arguments of the kernel.
    """
    parts = in_parts(count, least, lambda first, last: _filled(kernel, columns, first, last, given))
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    return known[0] if len(known) == 1 else np.concatenate(known, axis=1)


def _filled(kernel: Kernel, columns: int, first: int, last: int, given: tuple[Any, ...]) -> Ints | None:
    """Columns of the rows of placements `first` .. `last` - 1; memory that is never written costs nothing."""
    count, crowd, out = 0, 0, np.empty((columns, ROOM * (last - first) + ROOM_LEAST), np.int64)
    while True:
        first, count, most = kernel(first, last, count, out, *given)
        crowd = max(crowd, most)
        if first < 0:
            return None
        if first == last:
            rows = out[:, :count]
            return rows if crowd <= FEW_ROWS else rows[:, row_order(rows[0], *rows[[-3, -1, -2, 1]])]
        more = np.empty((columns, 2 * out.shape[1]), np.int64)
        more[:, :count] = out[:, :count]
        out = more


@helper(inline="always")
def columns_about(own):
    """Shifts that keep the pixels from a column on, and up to it; and the column's distance from the tile."""
    column = min(max(own, 0), 63)
    return np.uint64(column), np.uint64(63 - column), abs(own - column)


@helper(inline="always")
def row_key(met, row, down, ahead, behind, beyond):
    """A number that sorts the nearest pixels of rows by (squared distance, row); the last bit is set if it is after."""
    after, before = lowest(met >> ahead), _above(met << behind)
    across = beyond + min(after, before)
    key = ((across * across + down * down) << ROW_BITS) | (row << 1) | (after < before)
    return key if met else FAR


@helper(inline="always")
def pixel_of(key, own, top):
    """Squared distance, x and y of the pixel of a `row_key`, from an origin in column `own`, `top` px above row 0."""
    distance2, down = key >> ROW_BITS, top + ((key & WORD_ROWS) >> 1)
    column = min(max(own, 0), 63)
    along = np.int64(np.sqrt(distance2 - down * down)) - abs(own - column)  # of a square that a float holds
    return distance2, column - own + (along if key & 1 else -along), down


@helper()
def shared(tiles, tile, windows, word, step, shift, low, high, own, level):
    """Count the pixels that a tile shares with a window, in rows `low` to `high` of the world.

    There is no branch in the loop, so that eight rows take one instruction each. Returned are the samples, and the
    squared distance, x and y of the nearest pixel, relative to the origin at (own, level), ties by (y, x).
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


BEYOND = 2**40  # farther than any column


@helper(inline="always")
def _columns(first, last, left):
    """Word whose bits are the columns first .. last; bit 0 is column `left`."""
    low, high = max(first - left, 0), min(last - left, 63)
    return (ALL << np.uint64(low)) & (ALL >> np.uint64(63 - high)) if low <= high else np.uint64(0)


@helper(inline="always")
def _shadow(x_min, y_min, x_max, y_max, y, left):
    """Word of the columns of a row that a rectangle hides; see `bits.shadows.shadow`."""
    away, near, far = abs(y), y_min if y >= 0 else -y_max, y_max if y >= 0 else -y_min
    if far < 0 or away < near:
        return np.uint64(0)
    ahead, first, last = near > 0, -BEYOND, BEYOND
    if x_min > 0:
        first = max(x_min, np.int64(np.ceil((2 * x_min - 1) * away / (2 * far + 1))))
    elif ahead:
        first = np.int64(np.ceil((2 * x_min - 1) * away / (2 * near - 1)))
    if x_max < 0:
        last = min(x_max, np.int64(np.floor((2 * x_max + 1) * away / (2 * far + 1))))
    elif ahead:
        last = np.int64(np.floor((2 * x_max + 1) * away / (2 * near - 1)))
    hidden = _columns(first, last, left)
    if away > far or hidden == 0:
        return hidden
    nearest, side = ahead and away == near, x_min if x_min > 0 else -x_max
    if side > 0 and (side > away or (nearest and side == away)):
        column = x_min if x_min > 0 else x_max
        return hidden & ~_columns(column, column, left)
    if nearest:
        return hidden & ~_columns(max(x_min, 1 - away), min(x_max, away - 1), left)
    if side <= 0 and not ahead and away == 0:  # the origin itself
        return hidden & ~_columns(0, 0, left)
    return hidden


# house: hit rule of areas
@compiled(
    types.void(types.uint64[:, ::1], BOXES, BOXES, BOXES, INTS, BOXES, types.UniTuple(types.int64, 4), INTS, INTS)
)
def _hide_behind(rows, corner, origin, box, begin, rects, bounds, pair, blocker):
    height = rows.shape[1]
    for k in range(len(pair)):
        own, b = pair[k], blocker[k]
        x, y = origin[own, 0], origin[own, 1]
        left, top = corner[own, 0] - x, corner[own, 1] - y
        for r in range(begin[b], begin[b + 1]):
            x_min = max(rects[r, 0] + box[b, 0], bounds[0]) - x
            y_min = max(rects[r, 1] + box[b, 1], bounds[1]) - y
            x_max = min(rects[r, 2] + box[b, 0], bounds[2]) - x
            y_max = min(rects[r, 3] + box[b, 1], bounds[3]) - y
            if x_min > min(x_max, max(left + 63, 0)) or x_max < min(left, 0):
                continue
            if y_min > min(y_max, max(top + height - 1, 0)) or y_max < min(top, 0):
                continue
            for row in range(height):
                if rows[own, row]:
                    rows[own, row] &= ~_shadow(x_min, y_min, x_max, y_max, top + row, left)


@compiled(types.int64(BOXES, INTS, INTS, OUT))
def _left_and_met(rects, x, y, again):
    count = 0
    for i in range(len(x)):
        across, down = max(abs(x[i]), 1), max(abs(y[i]), 1)
        inside, last = 0, 0
        for r in range(len(rects)):
            entry, leave = 0, 2 * across * down
            for axis, step, scale in ((0, x[i], down), (1, y[i], across)):
                low, high = 2 * rects[r, axis] - 1, 2 * rects[r, axis + 2] + 1
                if step > 0:
                    entry, leave = max(entry, low * scale), min(leave, high * scale)
                elif step < 0:
                    entry, leave = max(entry, -high * scale), min(leave, -low * scale)
                elif low > 0 or high < 0:
                    leave = -1
            if entry <= leave:
                inside, last = inside + leave - entry, max(last, leave)
        again[count] = i
        count += inside < last
    return count


def left_and_met(rects: Ints, x: Ints, y: Ints) -> Ints:
    """See `bits.exits.left_and_met`."""
    again = np.empty(len(x), np.int64)
    return again[: _left_and_met(rects, x, y, again)]


def hide_behind(rows: Words, corner_xy: Ints, origin_xy: Ints, blockers: Blockers, pair: Ints, blocker: Ints) -> None:
    """See `bits.shadows.hide_behind`."""
    if blockers.until_exit:
        pair, blocker = late.exits.hide_after_exit(rows, corner_xy, origin_xy, blockers, pair, blocker)
    bounds = EVERYWHERE if blockers.bounds is None else blockers.bounds
    boxes = np.ascontiguousarray(blockers.box_xyxy)
    _hide_behind(rows, corner_xy, origin_xy, boxes, blockers.begin, blockers.rects, bounds, pair, blocker)


@helper()
def _bounds_of(parts, y, at, end, box):
    """Write the box around the runs `at` .. `end` - 1 of a pattern; it has x_max < x_min if all are empty."""
    left, right, top, low = WIDEST, -WIDEST, WIDEST, -WIDEST
    for part in range(len(parts)):
        first, last = parts[part, 0, at:end], parts[part, 1, at:end]
        for i in range(len(first)):
            filled = first[i] <= last[i]
            left, right = min(left, first[i] if filled else WIDEST), max(right, last[i] if filled else -WIDEST)
        begin, stop = 0, len(first) - 1
        while begin <= stop and first[begin] > last[begin]:
            begin += 1
        while stop >= begin and first[stop] > last[stop]:
            stop -= 1
        if begin <= stop:
            top, low = min(top, y[at + begin]), max(low, y[at + stop])
    box[0], box[1], box[2], box[3] = left, top, right, low


@helper()
def _strip_of(parts, y, at, end, strip):
    """Write the least and the greatest distance of the runs `at` .. `end` - 1 along a normal, the strip's a and b."""
    a, b, low, high = strip[0], strip[1], FAR, -FAR
    for i in range(at, end):
        for part in range(len(parts)):
            first, last = parts[part, 0, i], parts[part, 1, i]
            if first <= last:
                low = min(low, b * y[i] + min(a * first, a * last))
                high = max(high, b * y[i] + max(a * first, a * last))
    strip[2], strip[3] = low, high


@helper()
def _lay(first, last, left, words):
    """Add the pixels of runs, row by row, to words whose bit 0 is column `left`; without a branch in the loop."""
    for i in range(len(words)):
        begin, end = max(first[i] - left, 0), min(last[i] - left, 63)
        run = (ALL << np.uint64(begin & 63)) & (ALL >> np.uint64((63 - end) & 63))
        words[i] |= run if begin <= end else np.uint64(0)


@compiled(
    types.Tuple((ROWS_OUT, OUT, OUT, types.uint64[::1], ROWS_OUT))(
        INTS, INTS, types.Array(types.int64, 3, "C", readonly=True), types.int64,
        types.Array(types.int64, 2, "A", readonly=True),
    )
)  # fmt: skip
def _bits_of_runs(shape, y, parts, count, normal):
    box, strips = np.empty((count, 4), np.int64), np.empty((len(normal), 4), np.int64)
    corner, rows, begin = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count + 1, np.int64)
    total, end = WORD, 0
    for k in range(count):
        begin[k] = at = end
        while end < len(shape) and shape[end] == k:
            end += 1
        _bounds_of(parts, y, at, end, box[k])
        if box[k, 0] > box[k, 2]:
            return box, corner, rows, np.empty(0, np.uint64), strips
        if len(normal):
            strips[k, 0], strips[k, 1] = normal[k, 0], normal[k, 1]
            _strip_of(parts, y, at, end, strips[k])
        corner[k], rows[k] = total, box[k, 3] - box[k, 1] + 1 + WORD
        total += rows[k] * ((2 * WORD - 2 + box[k, 2] - box[k, 0] + 1) // WORD + 1)
    words = np.zeros(total, np.uint64)
    for k in range(count):
        high, left, at = rows[k] - WORD, box[k, 0] - (WORD - 1), corner[k]
        first = begin[k] + box[k, 1] - y[begin[k]]
        while left <= box[k, 2]:
            for part in range(len(parts)):
                ends = parts[part, 0, first : first + high], parts[part, 1, first : first + high]
                _lay(*ends, left, words[at : at + high])
            left, at = left + WORD, at + rows[k]
    return box, corner, rows, words, strips


def bits_of_runs(runs: RowRuns, count: int, normal: Ints) -> PatternBits | None:
    """See `bits.bit_rows.bits_of_runs`."""
    box, corner, rows, words, strips = _bits_of_runs(runs.shape, runs.y, np.asarray(runs.parts), count, normal)
    if not len(words):
        return None
    return PatternBits(
        box, corner, rows, words, strips if len(normal) else NO_STRIPS, NO_SUMS, np.zeros(count, np.int64)
    )


@helper(inline="always")
def cell_at(at_x, at_y, x, y, bits, wide, high):
    """The cell of a pixel; -1 if it lies in none."""
    column, row = np.uint64((at_x - x) >> bits), np.uint64((at_y - y) >> bits)  # negative numbers become very large
    inside = (column < np.uint64(wide)) & (row < np.uint64(high))
    return np.int64(row * np.uint64(wide) + column) if inside else -1


@helper()
def meets_any(box, at, taken, count):
    """Whether the box of an item meets those of others."""
    for k in range(count):
        other = taken[k]
        across = box[at, 0] <= box[other, 2] and box[at, 2] >= box[other, 0]
        if across and box[at, 1] <= box[other, 3] and box[at, 3] >= box[other, 1]:
            return True
    return False


SEEDS = types.Array(types.uint64, 1, "A", readonly=True)

AT_ONCE = 256  # least number of pellets that are drawn at a time; those of a round are drawn together


@helper(inline="always")
def _mixed(z):
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled(types.void(types.int64, types.int64, types.uint64, SEEDS, INTS, INTS, types.int64[:, :, ::1]))
def _disc_offsets(reach, radius2, bits, seed, shot, round_, offsets):
    rows, pellets, _ = offsets.shape
    found = offsets.reshape(rows * pellets, 2)
    room = max(AT_ONCE, pellets)
    state, drawn, place = np.empty(room, np.uint64), np.empty(room, np.uint64), np.empty(room, np.int64)
    row = 0
    while row < rows:
        count = 0
        while row < rows and count + pellets <= room:
            turn = _mixed(seed[row])
            turn = _mixed((turn ^ np.uint64(shot[row])) + GOLDEN)
            turn = _mixed((turn ^ np.uint64(round_[row])) + GOLDEN)
            for k in range(pellets):
                state[count + k] = _mixed((turn ^ np.uint64(k)) + GOLDEN)
                place[count + k] = row * pellets + k
            count += pellets
            row += 1
        while count:
            for i in range(count):  # without a branch, several at a time
                state[i] += GOLDEN
                drawn[i] = _mixed(state[i])
            rest = 0
            for i in range(count):  # offsets outside the disc are overwritten later
                x = np.int64(drawn[i] & bits) - reach
                y = np.int64((drawn[i] >> np.uint64(32)) & bits) - reach
                found[place[i], 0], found[place[i], 1] = x, y
                state[rest], place[rest] = state[i], place[i]
                rest += SUB * SUB * (x * x + y * y) > radius2
            count = rest


def disc_offsets(radius_256: int, seed: Words, shot: Ints, round_: Ints, pellets: int) -> Ints:
    """See `kinds.draws.disc_offsets`."""
    reach, offsets = radius_256 // SUB, np.empty((len(shot), pellets, 2), np.int64)
    bits = np.uint64((1 << (2 * reach).bit_length()) - 1)
    _disc_offsets(reach, radius_256**2, bits, seed, shot, round_, offsets)
    return offsets
