"""The kernel of `raycast`, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from planes.arrays import Ints
from planes.bitrows_jit import BOXES, EVERYWHERE, FLAGS, INTS
from planes.compiled import compiled
from planes.constants import HALF, SUB
from planes.fronttoback_jit import NOBODY, NONE, OWNERS, refuses
from planes.jumps import LONGEST, NOTHING, UNDECIDED
from planes.jumps_jit import over
from planes.raycast import Touched
from planes.spans import Box
from planes.stack import Stack
from planes.twins import in_parts

__all__ = ["first_touched", "touched"]

PART_NS, RAY_NS, ITEM_NS = 4e5, 3000.0, 1.5
"""What a thread must have to do to be worth it; about what a ray takes, and more for each item there is."""

LATE = 2**62
"""After all times."""

PICKED = 16
"""Boxes that a ray looks for one by one, the next that it enters among all; if it enters more, the rest are sorted."""

PAIRS = types.Array(types.int64, 2, "A", readonly=True)


@njit(inline="always")
def _spell(low, high, sign, across, entry, leave):
    """Of a time the part in which a ray is between two sides along an axis, which lie so far from its start."""
    if sign == 0:
        return (entry, leave) if low <= 0 <= high else (LATE, np.int64(0))
    near, far = (low, high) if sign > 0 else (-high, -low)
    return max(entry, near * across), min(leave, far * across)


@njit
def _times(left, top, right, low, ray):
    """When a ray enters and leaves a box of pixels; one that it does not touch is left before it is entered."""
    x, y, dx, dy, across_x, across_y = ray
    entry, leave = _spell(SUB * left - HALF - x, SUB * right + HALF - x, dx, across_x, np.int64(0), across_x * across_y)
    return _spell(SUB * top - HALF - y, SUB * low + HALF - y, dy, across_y, entry, leave)


@njit
def _part(box, at, origin_x, origin_y, bounds):
    """The part of an item's box that lies within the bounds, about a pixel."""
    left, top = max(box[at, 0], bounds[0]) - origin_x, max(box[at, 1], bounds[1]) - origin_y
    return left, top, min(box[at, 2], bounds[2]) - origin_x, min(box[at, 3], bounds[3]) - origin_y


@njit
def _near(box, origin_x, origin_y, ray, bounds, near):
    """Items whose boxes meet the one around a ray; how many."""
    x, y, dx, dy = ray[0] + HALF, ray[1] + HALF, ray[2], ray[3]
    left, right = ((min(x, x + dx) - 1) >> 8) + origin_x, (max(x, x + dx) >> 8) + origin_x
    top, low = ((min(y, y + dy) - 1) >> 8) + origin_y, (max(y, y + dy) >> 8) + origin_y
    left, top, right, low = max(left, bounds[0]), max(top, bounds[1]), min(right, bounds[2]), min(low, bounds[3])
    count = 0
    for at in range(len(box)):
        across = (box[at, 0] <= right) & (box[at, 2] >= left)
        near[count] = at
        count += across & (box[at, 1] <= low) & (box[at, 3] >= top)
    return count


@njit
def _run(row, begin, step, u, along):
    """The first and last cell that a ray touches in a row, along the axis on which it goes farther; none of others."""
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
    """When a ray touches an item first, LATE if it does not, and the cell where it does.

    Parameters
    ----------
    mask : its place and its width, and the pixel where it begins
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
        first, last = _run(row, v, step, u, along)
        first, last = max(first, u_least), min(last, u_most)
        for j in range(last - first + 1):
            column = first + j if along > 0 else last - j
            at_x, at_y = (row, column) if steep else (column, row)
            if masks[begin + (at_y - first_y) * width + at_x - first_x]:
                time, _ = _times(at_x, at_y, at_x, at_y, ray)
                if time < best:
                    best, best_x, best_y = time, at_x, at_y
                break
        if best < LATE and step != 0:
            break  # later rows are entered later
    return best, best_x, best_y


@njit
def _front(x, y, near, count, box, offset, masks, occluder, origin_x, origin_y, bounds):
    """The item in front at a cell, and whether any of those there is an occluder."""
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
def _entered(box, categories, owner, accept, exclude, who, origin_x, origin_y, ray, bounds, near, times):
    """Accepted items whose boxes a ray enters, and when it does; how many."""
    count = 0
    for i in range(_near(box, origin_x, origin_y, ray, bounds, near)):
        at = near[i]
        if len(accept) and refuses(at, categories, owner, accept, exclude, who):
            continue
        left, top, right, low = _part(box, at, origin_x, origin_y, bounds)
        near[count], (times[count], leave) = at, _times(left, top, right, low, ray)
        count += times[count] <= leave
    return count


@njit
def _earliest(box, offset, masks, origin_x, origin_y, ray, bounds, near, times, count):
    """When a ray touches the first of some items, LATE if it touches none, and a cell where it does."""
    best, column, row, order = np.int64(LATE), np.int64(0), np.int64(0), near[:0]
    for k in range(count):
        next_ = 0
        if k == PICKED:
            order = np.argsort(times[:count])  # those that were looked at are late, and come last
        if k < PICKED:
            for i in range(1, count):
                next_ = i if times[i] < times[next_] else next_
        else:
            next_ = order[k - PICKED]
        if times[next_] > best:
            break
        times[next_], at = LATE, near[next_]
        part = _part(box, at, origin_x, origin_y, bounds)
        entry, leave = _times(part[0], part[1], part[2], part[3], ray)
        mask = masks, offset[at], box[at, 2] - box[at, 0] + 1, box[at, 0] - origin_x, box[at, 1] - origin_y
        found, found_x, found_y = _in(part, mask, ray, entry, leave)
        if found < best:
            best, column, row = found, found_x, found_y
    return best, column, row


@njit
def touched(x, y, dx, dy, box, offset, masks, occluder, categories, owner, accept, exclude, who, bounds, near, times):
    """When a ray enters the cell where it touches an item first, the cell, and its rank.

    Parameters
    ----------
    near, times : room for a number of each item
    """
    if (dx == 0 and dy == 0) or max(abs(dx), abs(dy)) > LONGEST:
        return np.int64(UNDECIDED), np.int64(0), np.int64(0), np.int64(-1)
    origin_x, origin_y = (x + HALF) >> 8, (y + HALF) >> 8
    ray = x - SUB * origin_x, y - SUB * origin_y, dx, dy, max(abs(dy), 1), max(abs(dx), 1)
    count = _entered(box, categories, owner, accept, exclude, who, origin_x, origin_y, ray, bounds, near, times)
    best, column, row = _earliest(box, offset, masks, origin_x, origin_y, ray, bounds, near, times, count)
    if best == LATE:
        return np.int64(NOTHING), np.int64(0), np.int64(0), np.int64(-1)
    front, blocked, first_x, first_y = np.int64(-1), False, np.int64(0), np.int64(0)
    for k in range(9):  # of cells that are entered at once an occluder's comes first, then by (y, x)
        at_x, at_y = column + k % 3 - 1, row + k // 3 - 1
        entry, leave = _times(at_x, at_y, at_x, at_y, ray)
        if entry != best or entry > leave or blocked:
            continue
        at, blocks = _front(at_x, at_y, near, count, box, offset, masks, occluder, origin_x, origin_y, bounds)
        if at >= 0 and (front < 0 or blocks):
            front, blocked, first_x, first_y = at, blocks, at_x, at_y
    return best, first_x + origin_x, first_y + origin_y, front


@compiled(types.void(
    PAIRS, PAIRS, types.Array(types.int64, 2, "A"), BOXES, INTS, FLAGS, FLAGS, INTS, INTS, INTS, OWNERS,
    types.UniTuple(types.int64, 4),
))  # fmt: skip
def _each(
    start, step, found, box, offset, masks, occluder, categories, owner, accept, exclude, bounds
):  # fmt: skip
    near, times = np.empty(len(box) + 1, np.int64), np.empty(len(box) + 1, np.int64)
    for who in range(len(start)):
        found[0, who], found[1, who], found[2, who], found[3, who] = touched(
            start[who, 0], start[who, 1], step[who, 0], step[who, 1], box, offset, masks, occluder, categories, owner,
            accept, exclude, who, bounds, near, times,
        )  # fmt: skip


def first_touched(
    stack: Stack,
    bounds: Box | None,
    start_256: Ints,
    step_256: Ints,
    accept: Ints | None = None,
    exclude: Ints | None = None,
) -> Touched:
    """See `raycast.first_touched`."""
    found = np.empty((4, len(start_256)), np.int64)
    given = stack.box_xyxy, stack.offset, stack.masks, stack.occluder, stack.categories, stack.owner
    within = EVERYWHERE if bounds is None else bounds

    def some(first: int, last: int) -> None:
        """Rays first .. last - 1."""
        part = slice(first, last)
        whose = (NONE, NOBODY) if accept is None or exclude is None else (accept[part], exclude[part])
        _each(start_256[part], step_256[part], found[:, part], *given, *whose, within)

    in_parts(len(start_256), PART_NS / (RAY_NS + ITEM_NS * len(stack)), some)
    return Touched(*found)
