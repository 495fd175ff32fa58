"""Compiled kernels of first hits: the march by the distance field, and the raycast at items."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numba import njit, types

from ..bits.distance_field import EXACT, FAR, LONGEST, NOTHING, PAD, UNDECIDED, Clearance
from ..bits.raycast import Cast, Touched
from ..common.backend import in_parts
from ..common.checks import Bools, Ints
from ..common.limits import HALF, SUB
from ..grid.spans import Box
from ..scene.items import Stack
from .areas import NOBODY, NONE, OWNERS, refuses
from .bit_rows import BOXES, EVERYWHERE, FLAGS, INTS
from .cache import compiled

BLOCK = 128
"""Rays that march together, so that reads overlap; their columns fit the fastest cache."""

ROUNDS = 4
"""Jumps of each ray of a block before finished rays are replaced."""

N, STOP, ALONG, ACROSS, BASE, A, B, C, ASIDE, RAY, COLUMNS = range(11)
"""Columns of a block: N, the crossings before a ray's next look, and those of `bits.distance_field._ways`."""


@compiled()
def distances_of(taken: Bools) -> Clearance:
    """See `bits.distance_field.distances_of`."""
    h, w = taken.shape
    distance = np.full((h + 2 * PAD, w + 2 * PAD), FAR, np.uint8)
    for y in range(PAD, h + PAD):
        for x in range(w):
            if taken[y - PAD, x]:
                distance[y, x + PAD] = 0
    height, width = distance.shape
    for y in range(1, height):
        for x in range(width):
            distance[y, x] = min(distance[y, x], distance[y - 1, x] + 1)
        _spread_along(distance[y])
    for y in range(height - 2, -1, -1):
        for x in range(width):
            distance[y, x] = min(distance[y, x], distance[y + 1, x] + 1)
        _spread_along(distance[y])
    return distance


@compiled()
def _spread_along(row: Clearance) -> None:
    """Limit each cell of a row to 1 more than the cells beside it."""
    for x in range(1, len(row)):
        row[x] = min(row[x], row[x - 1] + 1)
    for x in range(len(row) - 2, -1, -1):
        row[x] = min(row[x], row[x + 1] + 1)


@compiled(error_model="numpy")
def first_taken(distances: Clearance, start_256: Ints, step_256: Ints) -> tuple[Ints, Ints, Bools]:
    """See `bits.distance_field.first_taken`."""
    count, flat = len(start_256), distances.reshape(-1)
    height, width = distances.shape
    entry, cell, several = np.full(count, NOTHING), np.zeros(count, np.int64), np.zeros(count, np.bool_)
    block, look, jump = np.zeros((COLUMNS, BLOCK)), np.empty(BLOCK, np.int32), np.zeros(BLOCK, np.uint8)
    free = np.arange(BLOCK)
    left = holes = BLOCK
    ray = 0
    while left:
        while holes and ray < count:
            x, y, one = start_256[ray, 0], start_256[ray, 1], free[holes - 1]
            why = _way(height, width, x, y, step_256[ray, 0], step_256[ray, 1], block, one)
            if why < 0:
                entry[ray] = why
            elif block[N, one] == 0 and _between(flat, block, one, x, y):
                entry[ray], cell[ray], several[ray] = 0, np.int64(block[BASE, one]), True
            else:
                block[RAY, one] = ray
                holes -= 1
            ray += 1
        left = _closed(block, left, free, holes)
        for _ in range(ROUNDS):
            _look(block, left, look)
            _jump(flat, block, left, look, jump)
        holes = _done(block, left, jump, free)
        for hole in range(holes):
            one = free[hole]
            if block[N, one] < block[STOP, one]:
                done, place = np.int64(block[RAY, one]), np.int64(look[one])
                several[done] = place < 0
                cell[done] = place = max(place, ~place)
                entry[done] = _entry(place, width, start_256[done], step_256[done])
    return entry, cell, several


@compiled()
def _closed(block, left, free, holes):  # type: ignore[no-untyped-def]
    """Move the last rays of a block to the free places; return the number of rays."""
    for hole in range(holes - 1, -1, -1):
        left -= 1
        for column in range(COLUMNS):
            block[column, free[hole]] = block[column, left]
    return left


@compiled()
def _done(block, left, jump, free):  # type: ignore[no-untyped-def]
    """Write the places of rays that hit or ended to `free`; return how many."""
    holes = 0
    for one in range(left):
        free[holes] = one
        holes += (jump[one] == 0) | (block[N, one] >= block[STOP, one])
    return holes


@compiled(error_model="numpy")
def _look(block, count, look):  # type: ignore[no-untyped-def]
    """Write the place of the cell that each ray looks at; at a corner it is ~place, a negative number."""
    for one in range(count):
        n = block[N, one]
        quotient = (block[A, one] * n + block[C, one]) / block[B, one]
        i = np.floor(quotient)
        place = np.int32(block[BASE, one] + i * block[ALONG, one] + n * block[ACROSS, one])
        look[one] = ~place if i == quotient else place


@compiled()
def _jump(flat, block, count, look, jump):  # type: ignore[no-untyped-def]
    """Move rays by the distance at their cells, up to their ends."""
    for one in range(count):
        place = look[one]
        far = flat[np.int64(max(place, ~place))]
        if place < 0:
            far = min(far, flat[~place - np.int32(block[ASIDE, one])])
        jump[one] = far
        block[N, one] = min(block[N, one] + far, block[STOP, one])


@compiled()
def _entry(place, width, start_256, step_256):  # type: ignore[no-untyped-def]
    """Time at which a ray enters a cell."""
    ahead_x, ahead_y = SUB * (place % width) - start_256[0], SUB * (place // width) - start_256[1]
    dx, dy = step_256[0], step_256[1]
    ahead_x, ahead_y = ahead_x if dx >= 0 else -ahead_x, ahead_y if dy >= 0 else -ahead_y
    return max((ahead_x - HALF) * max(abs(dy), 1), (ahead_y - HALF) * max(abs(dx), 1), 0)


@compiled()
def _between(flat, block, one, x_256, y_256):  # type: ignore[no-untyped-def]
    """Whether a ray starts on a border and touches a taken cell there, other than the one that it enters."""
    on_x, on_y = (x_256 & (SUB - 1)) == HALF, (y_256 & (SUB - 1)) == HALF
    if not (on_x or on_y):
        return False
    across, base = np.int64(block[ACROSS, one]), np.int64(block[BASE, one])
    step = np.int64(block[ALONG, one]) + across
    if on_x and flat[base - step] == 0:
        return True
    return on_y and (flat[base - across] == 0 or (on_x and flat[base - step - across] == 0))


@compiled(error_model="numpy")
def over(numerator, denominator):  # type: ignore[no-untyped-def]
    """Quotient of whole numbers, rounded down, by floats where that is exact."""
    if abs(numerator) < EXACT:
        return np.int64(np.floor(float(numerator) / float(denominator)))
    return numerator // denominator


@compiled(error_model="numpy")
def _way(height, width, x_256, y_256, step_x, step_y, block, one):  # type: ignore[no-untyped-def]
    """Write the columns of a ray to its block; return 0, or NOTHING or UNDECIDED."""
    back_x, back_y = step_x < 0, step_y < 0
    dx, dy = abs(step_x), abs(step_y)
    x, y = (x_256 + HALF - back_x) >> 8, (y_256 + HALF - back_y) >> 8
    ax, ay = (x_256 - (x << 8)) * (1 - 2 * back_x), (y_256 - (y << 8)) * (1 - 2 * back_y)
    if dx + dy == 0 or dx > LONGEST or dy > LONGEST:
        return UNDECIDED
    last_x, last_y = (dx + ax + HALF) >> 8, (dy + ay + HALF) >> 8
    behind_x, behind_y = back_x * (width - 1 - 2 * x) + x, back_y * (height - 1 - 2 * y) + y
    room_x, room_y = width - 2 - behind_x, height - 2 - behind_y
    if room_x < 0 or room_y < 0 or 1 - behind_x > last_x or 1 - behind_y > last_y:
        return NOTHING
    a, b, c = SUB * dx, SUB * (dx + dy), dx * (HALF - ay) + dy * (HALF + ax)
    across = width * (1 - 2 * back_y)
    aside = along = 1 - 2 * back_x - across
    if dx == 0 and ax == -HALF:
        aside = 1
    if dy == 0 and ay == -HALF:
        aside, c = width, 0
    first, stop = 0, last_x + last_y + 1
    off_x, off_y = -over(c - b * (room_x + 1), max(a, 1)), over(c + b * room_y, max(SUB * dy, 1)) + 1
    stop = min(stop, off_x if last_x > room_x else stop, off_y if last_y > room_y else stop)
    if behind_x < 1:
        first = max(first, -over(c - b * (1 - behind_x), a))
    if behind_y < 1:
        first = max(first, over(c - b * behind_y, SUB * dy) + 1)
    if float(a) * stop + c >= EXACT:
        return UNDECIDED
    block[A, one], block[B, one], block[C, one] = a, b, c
    block[ALONG, one], block[ACROSS, one], block[ASIDE, one] = along, across, aside
    block[BASE, one], block[N, one], block[STOP, one] = y * width + x, first, stop
    return 0 if first < stop else NOTHING


PART_PAIRS, RAY_PAIRS = 270_000, 2000
"""Least number of pairs of a ray and an item that is worth a thread; each ray counts as so many more."""

LATE = 2**62
"""A time after all others."""

PICKED = 16
"""Boxes that a ray picks by searching the earliest; after so many the rest are sorted."""

PAIRS = types.Array(types.int64, 2, "A", readonly=True)


@njit(inline="always")
def _spell(low, high, sign, across, entry, leave):
    """Part of the time from `entry` to `leave` in which a ray is between two sides, given relative to its start."""
    if sign == 0:
        return (entry, leave) if low <= 0 <= high else (LATE, np.int64(0))
    near, far = (low, high) if sign > 0 else (-high, -low)
    return max(entry, near * across), min(leave, far * across)


@njit
def times_in(left, top, right, low, ray):
    """Times at which a ray enters and leaves a box of pixels; leave < entry if it does not touch the box."""
    x, y, dx, dy, across_x, across_y = ray
    entry, leave = _spell(SUB * left - HALF - x, SUB * right + HALF - x, dx, across_x, np.int64(0), across_x * across_y)
    return _spell(SUB * top - HALF - y, SUB * low + HALF - y, dy, across_y, entry, leave)


@njit
def part_of(box, at, origin_x, origin_y, bounds):
    """The part of an item's box within the bounds, relative to a pixel."""
    left, top = max(box[at, 0], bounds[0]) - origin_x, max(box[at, 1], bounds[1]) - origin_y
    return left, top, min(box[at, 2], bounds[2]) - origin_x, min(box[at, 3], bounds[3]) - origin_y


@njit
def near_of(box, origin_x, origin_y, ray, bounds, near, reach):
    """Write the items with pixels whose centres may lie within `reach` of a ray to `near`; return how many."""
    x, y, dx, dy, around = ray[0] + reach, ray[1] + reach, ray[2], ray[3], 2 * reach - SUB + 1
    left, right = ((min(x, x + dx) - around) >> 8) + origin_x, (max(x, x + dx) >> 8) + origin_x
    top, low = ((min(y, y + dy) - around) >> 8) + origin_y, (max(y, y + dy) >> 8) + origin_y
    left, top, right, low = max(left, bounds[0]), max(top, bounds[1]), min(right, bounds[2]), min(low, bounds[3])
    count = 0
    for at in range(len(box)):
        across = (box[at, 0] <= right) & (box[at, 2] >= left)
        near[count] = at
        count += across & (box[at, 1] <= low) & (box[at, 3] >= top)
    return count


@njit
def run_of(row, begin, step, u, along):
    """First and last cell of a row that a ray touches, along its longer axis; (1, 0) if it touches none."""
    first = max(min(begin, begin + step), SUB * row - HALF) - begin
    last = min(max(begin, begin + step), SUB * row + HALF) - begin
    if first > last:
        return np.int64(1), np.int64(0)
    if step == 0:
        low, high, per = min(u, u + along), max(u, u + along), np.int64(1)
    else:
        per, slope = abs(step), along if step > 0 else -along
        low, high = u * per + min(first * slope, last * slope), u * per + max(first * slope, last * slope)
    return -over(HALF * per - low, SUB * per), over(high + HALF * per, SUB * per)


@njit
def _in(part, mask, ray, entry, leave):
    """Time and cell at which a ray first touches an item; LATE if it does not.

    Parameters
    ----------
    mask : all masks; place, width and first pixel (x, y) of the item's
    """
    x, y, dx, dy, across_x, across_y = ray
    masks, begin, width, first_x, first_y = mask
    steep = abs(dy) > abs(dx)
    u, along, v, step = (y, dy, x, dx) if steep else (x, dx, y, dy)
    u_least, u_most, v_least, v_most = part[0], part[2], part[1], part[3]
    if steep:
        u_least, u_most, v_least, v_most = part[1], part[3], part[0], part[2]
    scale = float(across_x * across_y)
    from_v, to_v = v + step * (entry / scale), v + step * (leave / scale)
    v_least = max(v_least, np.int64(np.floor((min(from_v, to_v) + HALF) / SUB)) - 1)
    v_most = min(v_most, np.int64(np.floor((max(from_v, to_v) + HALF) / SUB)) + 1)
    best, best_x, best_y = np.int64(LATE), np.int64(0), np.int64(0)
    for k in range(v_most - v_least + 1):
        row = v_least + k if step >= 0 else v_most - k
        first, last = run_of(row, v, step, u, along)
        first, last = max(first, u_least), min(last, u_most)
        for j in range(last - first + 1):
            column = first + j if along > 0 else last - j
            at_x, at_y = (row, column) if steep else (column, row)
            if masks[begin + (at_y - first_y) * width + at_x - first_x]:
                time, _ = times_in(at_x, at_y, at_x, at_y, ray)
                if time < best:
                    best, best_x, best_y = time, at_x, at_y
                break
        if best < LATE and step != 0:
            break  # later rows are entered later
    return best, best_x, best_y


@njit
def _front(x, y, near, count, box, offset, masks, occluder, origin_x, origin_y, bounds):
    """The front item at a cell, or -1, and whether any item there is an occluder."""
    front, blocked = np.int64(-1), False
    x, y = x + origin_x, y + origin_y
    if x < bounds[0] or y < bounds[1] or x > bounds[2] or y > bounds[3]:
        return front, blocked
    for i in range(count):
        at = near[i]
        if box[at, 0] <= x <= box[at, 2] and box[at, 1] <= y <= box[at, 3]:
            width = box[at, 2] - box[at, 0] + 1
            if masks[offset[at] + (y - box[at, 1]) * width + x - box[at, 0]]:
                front = at if front < 0 else front
                blocked |= occluder[at]
    return front, blocked


@njit
def _entered(box, categories, owner, meets, exclude, who, origin_x, origin_y, ray, bounds, near, times):
    """Write the accepted items whose boxes a ray enters, and the times of entry; return how many."""
    count = 0
    for i in range(near_of(box, origin_x, origin_y, ray, bounds, near, HALF)):
        at = near[i]
        if len(meets) and refuses(at, categories, owner, meets, exclude, who):
            continue
        left, top, right, low = part_of(box, at, origin_x, origin_y, bounds)
        near[count], (times[count], leave) = at, times_in(left, top, right, low, ray)
        count += times[count] <= leave
    return count


@njit
def _earliest(box, offset, masks, origin_x, origin_y, ray, bounds, near, times, count):
    """Time and a cell at which a ray touches the first of some items; LATE if it touches none."""
    best, column, row, order = np.int64(LATE), np.int64(0), np.int64(0), near[:0]
    for k in range(count):
        next_ = 0
        if k == PICKED:
            order = np.argsort(times[:count])  # visited boxes have time LATE, and come last
        if k < PICKED:
            for i in range(1, count):
                next_ = i if times[i] < times[next_] else next_
        else:
            next_ = order[k - PICKED]
        if times[next_] > best:
            break
        times[next_], at = LATE, near[next_]
        part = part_of(box, at, origin_x, origin_y, bounds)
        entry, leave = times_in(part[0], part[1], part[2], part[3], ray)
        mask = masks, offset[at], box[at, 2] - box[at, 0] + 1, box[at, 0] - origin_x, box[at, 1] - origin_y
        found, found_x, found_y = _in(part, mask, ray, entry, leave)
        if found < best:
            best, column, row = found, found_x, found_y
    return best, column, row


# house: hit rule of rays
@njit
def touched(x, y, dx, dy, box, offset, masks, occluder, categories, owner, meets, exclude, who, bounds, near, times):
    """Time of entry, cell and rank of the first item that a ray touches; `near` and `times` are scratch, (M,) each."""
    if (dx == 0 and dy == 0) or max(abs(dx), abs(dy)) > LONGEST:
        return np.int64(UNDECIDED), np.int64(0), np.int64(0), np.int64(-1)
    origin_x, origin_y = (x + HALF) >> 8, (y + HALF) >> 8
    ray = x - SUB * origin_x, y - SUB * origin_y, dx, dy, max(abs(dy), 1), max(abs(dx), 1)
    count = _entered(box, categories, owner, meets, exclude, who, origin_x, origin_y, ray, bounds, near, times)
    best, column, row = _earliest(box, offset, masks, origin_x, origin_y, ray, bounds, near, times, count)
    if best == LATE:
        return np.int64(NOTHING), np.int64(0), np.int64(0), np.int64(-1)
    front, blocked, first_x, first_y = np.int64(-1), False, np.int64(0), np.int64(0)
    for k in range(9):  # of cells that are entered at once an occluder's comes first, then by (y, x)
        at_x, at_y = column + k % 3 - 1, row + k // 3 - 1
        entry, leave = times_in(at_x, at_y, at_x, at_y, ray)
        if entry != best or entry > leave or blocked:
            continue
        at, blocks = _front(at_x, at_y, near, count, box, offset, masks, occluder, origin_x, origin_y, bounds)
        if at >= 0 and (front < 0 or blocks):
            front, blocked, first_x, first_y = at, blocks, at_x, at_y
    return best, first_x + origin_x, first_y + origin_y, front


BOUNDS = types.UniTuple(types.int64, 4)


@compiled(types.void(
    PAIRS, PAIRS, types.Array(types.int64, 2, "A"), BOXES, INTS, FLAGS, FLAGS, INTS, INTS, INTS, OWNERS, BOUNDS,
))  # fmt: skip
def _each(start, step, found, box, offset, masks, occluder, categories, owner, meets, exclude, bounds):
    scratch = np.empty((2, len(box) + 1), np.int64)
    for who in range(len(start)):
        found[0, who], found[1, who], found[2, who], found[3, who] = touched(
            start[who, 0], start[who, 1], step[who, 0], step[who, 1], box, offset, masks, occluder, categories, owner,
            meets, exclude, who, bounds, scratch[0], scratch[1],
        )  # fmt: skip


@compiled(types.UniTuple(types.int64, 4)(BOXES, INTS, FLAGS, FLAGS, INTS, BOUNDS, *[types.int64] * 4), nogil=False)
def _one(box, offset, masks, occluder, rank, bounds, x, y, dx, dy):
    scratch = np.empty((2, len(box) + 1), np.int64)
    entry, column, row, at = touched(
        x, y, dx, dy, box, offset, masks, occluder, NONE, NONE, NONE, NOBODY, 0, bounds, scratch[0], scratch[1]
    )
    return entry, column, row, rank[at] if at >= 0 else at


ONE = _one.overloads[_one.signatures[0]].entry_point
"""Its entry point, without the dispatch on argument types, which takes longer than the call."""


def caster(stack: Stack, bounds: Box | None, accepts: Bools | None) -> Cast:
    """See `bits.raycast.caster`."""
    rank = np.arange(len(stack)) if accepts is None else np.flatnonzero(accepts)
    columns: tuple[Any, ...] = stack.box_xyxy, stack.offset, stack.masks, stack.occluder
    if accepts is not None:
        columns = stack.box_xyxy[rank], stack.offset[rank], stack.masks, stack.occluder[rank]
    return partial(ONE, *map(np.ascontiguousarray, columns), rank, EVERYWHERE if bounds is None else bounds)


def first_touched(
    stack: Stack,
    bounds: Box | None,
    start_256: Ints,
    step_256: Ints,
    meets: Ints | None = None,
    exclude: Ints | None = None,
) -> Touched:
    """See `bits.raycast.first_touched`."""
    found = np.empty((4, len(start_256)), np.int64)
    given = stack.box_xyxy, stack.offset, stack.masks, stack.occluder, stack.categories, stack.owner
    within = EVERYWHERE if bounds is None else bounds

    def some(first: int, last: int) -> None:
        """Rays first .. last - 1."""
        part = slice(first, last)
        whose = (NONE, NOBODY) if meets is None or exclude is None else (meets[part], exclude[part])
        _each(start_256[part], step_256[part], found[:, part], *given, *whose, within)

    in_parts(len(start_256), PART_PAIRS / (RAY_PAIRS + len(stack)), some)
    return Touched(*found)
