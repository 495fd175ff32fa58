"""Compiled raycast: what each ray hits, how many pixels of it, and where the ray ends. See `weapons.rays.raycast`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from ..bits.cells import BRUTE_PAIRS, cells_of, is_sparse
from ..bits.span_walk import Verdict
from ..common.checks import Ints
from ..common.limits import HALF, REACH_MAX, SUB
from ..grid.rasterize import DIAGONAL, FAR, Lines
from ..grid.spans import Box
from ..scene.items import Stack
from .areas import CELLS, NOBODY, NONE, OWNERS, refuses
from .bit_rows import BOXES, EVERYWHERE, FLAGS, INTS, ROWS_OUT, cell_at, meets_any, rows_by
from .cache import compiled, helper
from .planes import (
    LATE,
    between,
    borders_of,
    bounds_of_times,
    cells_by,
    cells_within,
    entry_of,
    near_of,
    part_of,
    rows_between,
    run_of,
    wide_run_of,
)

RANK, COUNT, ENTRY, Y, X, ENTER, LAST, SOONEST, COLUMNS = range(9)
"""Columns of the items that a ray touches; ENTER and LAST bound the times at which it enters their pixels, and SOONEST
has the earliest times of objects, in order."""

BOUNDS = types.UniTuple(types.int64, 4)
PAIRS = types.Array(types.int64, 2, "A", readonly=True)
ITEMS = types.Tuple((BOXES, INTS, FLAGS, FLAGS, INTS, INTS))

LISTED = 4096 * SUB
"""Longest wide ray whose cells are counted row by row; thin ones are counted in closed form."""

FARTHEST, LONG = 2**29, 2**50
"""Longest ray of which sums of products fit int64, 1/256 px, and squared length below which those of `share` do."""

NOWHERE = 0, 0, 0, 0, 0, NONE, NONE
"""Cells that list no items: all boxes are compared."""

SORTED = 32
"""Boxes of a ray that are picked one by one, the earliest first; more are sorted."""

PART_PAIRS, RAY_PAIRS = 135_000, 2000
"""Least number of pairs of a ray and an item that is worth a thread; each ray counts as so many more."""


@helper()
def _walked(at_x, at_y, u, v, ray, wide, stop):
    """Whether a ray enters a pixel before its stop, and when."""
    time, stop_x, stop_y, alone, takes = stop
    if wide[0] > 0 and u - wide[2] - 2 > time:
        return False, np.int64(LATE)
    entry = entry_of(at_x, at_y, u, v, ray, wide)
    if entry < time or entry == LATE:
        return entry < time, entry
    here = takes and at_x == stop_x and at_y == stop_y
    before = not alone and (at_y < stop_y or (at_y == stop_y and at_x < stop_x))
    return entry == time and (here or before), entry


@helper()
def _touches(part, mask, ray, wide, stop, first_alone):
    """Number of pixels of an item that a ray enters before a stop, and time and cell of the first of them.

    Parameters
    ----------
    wide : radius of the ray; its `sides` and `wide_sides`, see `grid.rasterize.Lines`; and its squared length
    stop : time and cell of the stop, whether the cell is the only one at that time, and whether the item is hit in it
    first_alone : whether the number does not matter, so that a thin ray is followed to its first pixel and no further
    """
    x, y, dx, dy, across_x, across_y = ray
    masks, begin, width, first_x, first_y = mask
    steep = abs(dy) > abs(dx)
    u, along, v, step, across = (y, dy, x, dx, across_x) if steep else (x, dx, y, dy, across_y)
    u_least, u_most, v_least, v_most, stride = part[0], part[2], part[1], part[3], np.int64(1)
    if steep:
        u_least, u_most, v_least, v_most, stride = part[1], part[3], part[0], part[2], width
    top, low = rows_between(u_least, u_most, u, along, v, step, wide)
    per = 1 / step if step != 0 else 0.0
    first_of = np.int64(0), np.int64(LATE), np.int64(0), np.int64(0)
    top, low = max(top, v_least), min(low, v_most)
    for k in range(low - top + 1):
        row = top + k if step >= 0 else low - k
        first, last = run_of(row, v, step, u, along) if wide[0] == 0 else wide_run_of(row, u, along, v, step, wide, per)
        first, last = max(first, u_least), min(last, u_most)
        if first > last:
            continue
        left, upper = (row, first) if steep else (first, row)
        pixel = begin + (upper - first_y) * width + left - first_x
        ahead = (SUB * row - v) * (1 if step > 0 else -1)
        if wide[0] == 0 and step != 0 and (ahead - HALF) * across > first_of[1] and (ahead + HALF) * across < stop[0]:
            if first_alone:
                break
            count = first_of[0]
            for i in range(last - first + 1):
                count += masks[pixel + i * stride]
            first_of = count, first_of[1], first_of[2], first_of[3]
        else:
            first_of = _in_run(left, upper, last - first + 1, masks, pixel, stride, steep, ray, wide, stop, first_of)
    return first_of


@helper()
def _in_run(left, top, length, masks, pixel, stride, steep, ray, wide, stop, first_of):
    """What `_touches` found so far, with the pixels of one run of cells."""
    x, y, dx, dy, _, _ = ray
    radius, side, reach, length2 = wide
    count, best, best_x, best_y = first_of
    px, py = SUB * left - x, SUB * top - y
    u, v = px * dx + py * dy, px * dy - py * dx
    along, aside = (SUB * dy, -SUB * dx) if steep else (SUB * dx, SUB * dy)
    surely = radius > 0 and length2 > 0
    for k in range(length):
        if masks[pixel + k * stride]:
            if surely and abs(v) <= side and max(best + reach + 2, -1) < u < min(stop[0], length2):
                count += 1
            else:
                at_x, at_y = (left, top + k) if steep else (left + k, top)
                walked, entry = _walked(at_x, at_y, u, v, ray, wide, stop)
                count += walked
                sooner = entry == best and (at_y < best_y or (at_y == best_y and at_x < best_x))
                if walked and (entry < best or sooner):
                    best, best_x, best_y = entry, at_x, at_y
        u, v = u + along, v + aside
    return count, best, best_x, best_y


@helper()
def _comes_before(found, one, other):
    """Whether a ray enters an item before another: by (time, y, x, rank)."""
    for column in (ENTRY, Y, X):
        if found[column, one] != found[column, other]:
            return found[column, one] < found[column, other]
    return found[RANK, one] < found[RANK, other]


@helper()
def _listed(cells, ray, origin, reach, near):
    """Copy the items that are listed in the cell of the corner of a ray's box; return how many."""
    x, y, dx, dy, _, _ = ray
    left, top = (min(x, x + dx) - reach + SUB - 1) >> 8, (min(y, y + dy) - reach + SUB - 1) >> 8
    grid_x, grid_y, bits, wide, high, begin, listed = cells
    cell = cell_at(left + origin[0], top + origin[1], grid_x, grid_y, bits, wide, high)
    if cell < 0:
        return 0
    for i in range(begin[cell], begin[cell + 1]):
        near[i - begin[cell]] = listed[i]
    return begin[cell + 1] - begin[cell]


@helper()
def _entered_by(items, cells, meets, exclude, row, origin, ray, wide, bounds, near, found):
    """Write rank and bounds of the times of the accepted items whose boxes a ray enters; return how many."""
    (box, _, _, _, categories, owner), reach = items, max(wide[0], HALF)
    if cells[3]:
        listed_count = _listed(cells, ray, origin, reach, near)
    else:
        listed_count = near_of(box, origin[0], origin[1], ray, bounds, near, reach)
    count = 0
    for i in range(listed_count):
        at = near[i]
        if len(meets) and refuses(at, categories, owner, meets, exclude, row):
            continue
        left, top, right, low = part_of(box, at, origin[0], origin[1], bounds)
        if left > right or top > low:
            continue
        found[RANK, count] = at
        found[ENTER, count], found[LAST, count] = bounds_of_times(left, top, right, low, ray, wide)
        count += found[ENTER, count] <= found[LAST, count]
    return count


@helper()
def _of_item(items, at, origin, ray, wide, bounds, stop, first_alone):
    """`_touches` of an item within the bounds."""
    box, offset, masks, _, _, _ = items
    mask = masks, offset[at], box[at, 2] - box[at, 0] + 1, box[at, 0] - origin[0], box[at, 1] - origin[1]
    return _touches(part_of(box, at, origin[0], origin[1], bounds), mask, ray, wide, stop, first_alone)


@helper()
def _earliest_first(found, k, count):
    """Swap the item of the earliest time of entry, of those from place k on, to that place."""
    least = k
    for i in range(k + 1, count):
        least = i if found[ENTER, i] < found[ENTER, least] else least
    for column in (RANK, ENTER, LAST):
        found[column, k], found[column, least] = found[column, least], found[column, k]


@helper(allocates=True)
def _sort_by_entry(found, count):
    """Put items in the order of their times of entry."""
    order = np.argsort(found[ENTER, :count])
    for column in (RANK, ENTER, LAST):
        held = found[column, :count].copy()
        for k in range(count):
            found[column, k] = held[order[k]]


@helper()
def _meet(items, origin, ray, wide, bounds, most, found, count):
    """Move the items that a ray touches before its end to the front, with times, cells and counts; return how many."""
    endless = np.int64(LATE), np.int64(0), np.int64(0), np.bool_(True), np.bool_(True)  # of no literal types
    occluder, met, objects, limit, last = items[3], 0, 0, np.int64(LATE), found[SOONEST]
    if count > SORTED:
        _sort_by_entry(found, count)
    for k in range(count):
        if count <= SORTED:
            _earliest_first(found, k, count)
        if found[ENTER, k] > limit:
            break
        at = found[RANK, k]
        pixels, entry, x, y = _of_item(items, at, origin, ray, wide, bounds, endless, most == 1 or occluder[at])
        if pixels == 0:
            continue
        found[RANK, met], found[COUNT, met], found[LAST, met] = at, pixels, found[LAST, k]
        found[ENTRY, met], found[Y, met], found[X, met] = entry, y, x
        met += 1
        if occluder[at]:
            limit = min(limit, entry)
        elif most > 0:  # `last` has the earliest entries of objects, in order
            place = min(objects, most - 1)
            if objects < most or entry < last[place]:
                while place > 0 and last[place - 1] > entry:
                    last[place] = last[place - 1]
                    place -= 1
                last[place] = entry
            objects += 1
            if objects >= most:
                limit = min(limit, last[most - 1])
    return met


@helper()
def _covers(items, at, x, y, bounds):
    """Whether an item has a pixel, within the bounds."""
    box, offset, masks, _, _, _ = items
    if not (max(box[at, 0], bounds[0]) <= x <= min(box[at, 2], bounds[2])):
        return False
    if not (max(box[at, 1], bounds[1]) <= y <= min(box[at, 3], bounds[3])):
        return False
    return masks[offset[at] + (y - box[at, 1]) * (box[at, 2] - box[at, 0] + 1) + x - box[at, 0]]


@helper()
def _blocked(items, origin, bounds, found, count):
    """Drop what a ray touches at or behind the first occluder; return how many objects are left, and the occluder."""
    occluder, wall = items[3], -1
    for i in range(count):
        if occluder[found[RANK, i]] and (wall < 0 or _comes_before(found, i, wall)):
            wall = i
    if wall < 0:
        return count, np.int64(-1), np.int64(LATE), np.int64(0), np.int64(0)
    rank, time, y, x = found[RANK, wall], found[ENTRY, wall], found[Y, wall], found[X, wall]
    kept = 0
    for i in range(count):
        at, entry = found[RANK, i], found[ENTRY, i]
        if occluder[at] or entry > time:
            continue
        if entry == time:  # of the cells that are entered then, the ray walks the occluder's alone
            if at > rank or not _covers(items, at, x + origin[0], y + origin[1], bounds):
                continue
            found[Y, i], found[X, i] = y, x
        for column in (RANK, COUNT, ENTRY, Y, X, LAST):
            found[column, kept] = found[column, i]
        kept += 1
    return kept, rank, time, y, x


@helper()
def _sort(found, order, count):
    """Order the items by the walk of the ray; each is near its place."""
    for i in range(count):
        place = i
        while place > 0 and _comes_before(found, i, order[place - 1]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = i


RAYCAST = types.Tuple((types.int64, types.int64, types.int64))(
    types.int64, types.int64, types.int64, ROWS_OUT, PAIRS, PAIRS, types.int64, PAIRS, types.int64,
    ITEMS, CELLS, INTS, OWNERS, BOUNDS, ROWS_OUT,
)  # fmt: skip


# house: hit rule of rays
@helper()
def follow(row, x, y, dx, dy, wide, items, cells, bounds, most, meets, exclude, near, found, ends):
    """Write the order of the objects that a ray hits to `near`, and its end; return how many there are."""
    origin = (x + HALF) >> 8, (y + HALF) >> 8
    ray = x - SUB * origin[0], y - SUB * origin[1], dx, dy, max(abs(dy), 1), max(abs(dx), 1)
    count = _entered_by(items, cells, meets, exclude, row, origin, ray, wide, bounds, near, found)
    count = _meet(items, origin, ray, wide, bounds, most, found, count)
    count, rank, time, last_y, last_x = _blocked(items, origin, bounds, found, count)
    _sort(found, near, count)
    reason, alone = np.int64(rank >= 0), rank >= 0
    if 0 < most <= count:
        at, count = near[most - 1], most
        alone = alone and found[ENTRY, at] == time
        reason, rank, time = np.int64(2), found[RANK, at], found[ENTRY, at]
        last_y, last_x = found[Y, at], found[X, at]
    ends[0, row], ends[1, row], ends[2, row], ends[3, row] = reason, time, last_y, last_x
    ends[4, row], ends[5, row] = rank, alone
    for i in range(count):
        at = near[i]
        if found[ENTRY, at] == time and found[Y, at] == last_y and found[X, at] == last_x:
            found[COUNT, at] = 1  # all other pixels of the item come after the first
        elif found[LAST, at] >= time:
            stop = time, last_x, last_y, alone, found[RANK, at] <= rank
            found[COUNT, at] = _of_item(items, found[RANK, at], origin, ray, wide, bounds, stop, np.bool_(False))[0]
    return count


@compiled(RAYCAST)
def _each(begin, end, row, out, start, step, radius, sides, most, items, cells, meets, exclude, bounds, ends):
    """Write what rays hit, in order, to columns (ray, rank, count, x, y, entry), and their ends.

    Returns
    -------
    the ray that there is no room for, or `end`; the number of rows; and 0
    """
    near, found = np.empty(len(items[0]) + 1, np.int64), np.empty((COLUMNS, len(items[0]) + 1), np.int64)
    for number in range(begin, end):
        x, y, dx, dy = start[number, 0], start[number, 1], step[number, 0], step[number, 1]
        wide = radius, sides[0, number], sides[1, number], dx * dx + dy * dy
        count = follow(number, x, y, dx, dy, wide, items, cells, bounds, most, meets, exclude, near, found, ends)
        if row + count > out.shape[1]:
            return number, row, 0
        for i in range(count):
            at = near[i]
            out[0, row], out[1, row], out[2, row] = number, found[RANK, at], found[COUNT, at]
            out[3, row], out[4, row], out[5, row] = found[X, at], found[Y, at], found[ENTRY, at]
            row += 1
    return end, row, 0


@helper()
def _row_cells(row, first, last, ray, wide, stop):
    """Number of cells of a row that a wide ray enters before a stop.

    `u` and `v` are products of the ray with the way to a cell, along the ray and across.
    """
    x, y, dx, dy, _, _ = ray
    (radius, side, reach, length2), steep, cells = wide, abs(dy) > abs(dx), last - first + 1
    left, top = (row, first) if steep else (first, row)
    px, py, end = SUB * left - x, SUB * top - y, min(stop[0], length2)
    u, v = px * dx + py * dy, px * dy - py * dx
    along, aside = (SUB * dy, -SUB * dx) if steep else (SUB * dx, SUB * dy)
    least, most = min(u, u + (cells - 1) * along), max(u, u + (cells - 1) * along)
    if cells < 1 or least > end + reach + 2 or most < -reach - 2:
        return 0
    sure = radius >= DIAGONAL and along != 0
    if sure and least >= 0 and most < end and max(abs(v), abs(v + (cells - 1) * aside)) <= side:
        return cells
    near, far, begin, until = 0, cells - 1, cells, cells - 1
    if along != 0:
        near, far = between(u, along, cells, -reach - 2, end + reach + 2)
    if sure:
        begin, until = between(u, along, cells, 0, end - 1)
        while begin <= until and abs(v + aside * begin) > side:
            begin += 1
        while begin <= until and abs(v + aside * until) > side:
            until -= 1
    count = surely = max(until - begin + 1, 0)
    for place in range(near, far + 1 - surely):
        k = place if place < begin or surely == 0 else place + surely
        at_u, at_v = u + k * along, v + k * aside
        count += _walked(left + k * (not steep), top + k * steep, at_u, at_v, ray, wide, stop)[0]
    return count


@helper()
def _wide_cells(ray, wide, bounds, stop):
    """Cells that a wide ray reaches, those after its stop, and those beyond the bounds."""
    x, y, dx, dy, _, _ = ray
    steep, endless = abs(dy) > abs(dx), (np.int64(LATE), np.int64(0), np.int64(0), np.bool_(True), np.bool_(True))
    u, along, v, step = (y, dy, x, dx) if steep else (x, dx, y, dy)
    u_least, u_most, v_least, v_most = bounds[0], bounds[2], bounds[1], bounds[3]
    if steep:
        u_least, u_most, v_least, v_most = bounds[1], bounds[3], bounds[0], bounds[2]
    top, low = rows_between(-(2**40), 2**40, u, along, v, step, wide)
    per, total, inside, reached = 1 / step if step != 0 else 0.0, 0, 0, 0
    for row in range(top, low + 1):
        first, last = wide_run_of(row, u, along, v, step, wide, per)
        count = _row_cells(row, first, last, ray, wide, endless)
        total += count
        if first < u_least or last > u_most or row < v_least or row > v_most:
            first, last = max(first, u_least), min(last, u_most) if v_least <= row <= v_most else first - 1
            count = _row_cells(row, first, last, ray, wide, endless)
        inside += count
        latest = max((SUB * first - u) * along, (SUB * last - u) * along) + (SUB * row - v) * step
        if max(latest, 0) + wide[2] + 2 >= stop[0]:  # no cell is entered later than its centre is passed, and reach
            count = _row_cells(row, first, last, ray, wide, stop)
        reached += count
    return reached, inside - reached, total - inside


@helper()
def _thin_cells(ray, bounds, stop):
    """Cells that a thin ray reaches, those after its stop, and those beyond the bounds."""
    borders = borders_of(ray)
    last = ray[4] * ray[5]
    total = inside = cells_by(borders, last)
    end_x, end_y = (ray[0] + ray[2] + HALF) >> 8, (ray[1] + ray[3] + HALF) >> 8
    leaves = min(0, end_x) - 1 < bounds[0] or min(0, end_y) - 1 < bounds[1]
    leaves = leaves or max(0, end_x) + 1 > bounds[2] or max(0, end_y) + 1 > bounds[3]
    if leaves:
        inside = cells_within(borders, bounds, last)
    if stop[0] == LATE:
        return inside, 0, total - inside
    time = min(stop[0] - 1, last)
    reached = cells_within(borders, bounds, time) if leaves else cells_by(borders, time)
    wide = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    for at_y in range(max(stop[2] - 1, bounds[1]), min(stop[2] + 1, bounds[3]) + 1):
        for at_x in range(max(stop[1] - 1, bounds[0]), min(stop[1] + 1, bounds[2]) + 1):
            walked, entry = _walked(at_x, at_y, 0, 0, ray, wide, stop)
            reached += walked and entry == stop[0]
    return reached, inside - reached, total - inside


@helper()
def _new_cells(items, at, taken, count, hits, last_rank, origin, ray, wide, bounds, stop):
    """Number of pixels of an item that a ray enters before a stop, and that none of the items before it has.

    Parameters
    ----------
    taken, count, hits : the items before it; the first `hits` have the stop's pixel only up to `last_rank`
    """
    x, y, dx, dy, _, _ = ray
    steep, (left, upper, right, lower) = abs(dy) > abs(dx), part_of(items[0], at, origin[0], origin[1], bounds)
    u, along, v, step = (y, dy, x, dx) if steep else (x, dx, y, dy)
    u_least, u_most, v_least, v_most = (upper, lower, left, right) if steep else (left, right, upper, lower)
    top, low = rows_between(u_least, u_most, u, along, v, step, wide)
    per, new = 1 / step if step != 0 else 0.0, 0
    for row in range(max(top, v_least), min(low, v_most) + 1):
        first, last = run_of(row, v, step, u, along) if wide[0] == 0 else wide_run_of(row, u, along, v, step, wide, per)
        for cell in range(max(first, u_least), min(last, u_most) + 1):
            at_x, at_y = (row, cell) if steep else (cell, row)
            if not _covers(items, at, at_x + origin[0], at_y + origin[1], bounds):
                continue
            px, py = SUB * at_x - x, SUB * at_y - y
            if not _walked(at_x, at_y, px * dx + py * dy, px * dy - py * dx, ray, wide, stop)[0]:
                continue
            new += not _is_taken(items, at_x, at_y, taken, count, hits, last_rank, origin, bounds, stop)
    return new


@helper()
def _is_taken(items, x, y, taken, count, hits, last_rank, origin, bounds, stop):
    """Whether any of some items has a pixel that a ray enters."""
    ends = x == stop[1] and y == stop[2]
    for k in range(count):
        counts = not ends or k >= hits or taken[k] <= last_rank
        if counts and _covers(items, taken[k], x + origin[0], y + origin[1], bounds):
            return True
    return False


@helper()
def _decided(items, hits, near, taken, origin, ray, wide, bounds, stop, end, refuse):
    """Number of cells of a ray that are hit, that an occluder ends, and that items have which are refused.

    Parameters
    ----------
    hits : ranks of the items that are hit, and numbers of their cells
    end : why the ray ends, and the greatest rank of items that it hits in the last cell
    refuse : filters of all rays, and the ray
    """
    (reason, last_rank), (meets, exclude, row), count, hit, filtered = end, refuse, 0, 0, 0
    for i in range(len(hits[0])):
        at, own = hits[0][i], hits[1][i]
        if meets_any(items[0], at, taken, count):
            takes = stop[0], stop[1], stop[2], stop[3], stop[4] and at <= last_rank
            own = _new_cells(items, at, taken, count, count, last_rank, origin, ray, wide, bounds, takes)
        taken[count], count, hit = at, count + 1, hit + own
    first, blocked = count, reason == 1
    if blocked:
        blocked = not _is_taken(items, stop[1], stop[2], taken, count, count, last_rank, origin, bounds, stop)
    if len(meets):
        for i in range(near_of(items[0], origin[0], origin[1], ray, bounds, near, max(wide[0], HALF))):
            if refuses(near[i], items[4], items[5], meets, exclude, row):
                filtered += _new_cells(items, near[i], taken, count, first, last_rank, origin, ray, wide, bounds, stop)
                taken[count], count = near[i], count + 1
        others = taken[first:count]
        if blocked and _is_taken(items, stop[1], stop[2], others, len(others), 0, LATE, origin, bounds, stop):
            filtered -= 1  # the occluder has the cell
    return hit, blocked, filtered


@compiled(types.void(
    PAIRS, PAIRS, PAIRS, types.int64, PAIRS, PAIRS, INTS, INTS, INTS, ITEMS, INTS, OWNERS, BOUNDS, ROWS_OUT,
))  # fmt: skip
def _verdicts(
    start, step, origins, radius, sides, ends, hit_begin, hit_rank, hit_count, items, meets, exclude, bounds, counts
):  # fmt: skip
    near, taken = np.empty(len(items[0]) + 1, np.int64), np.empty(len(items[0]) + 1, np.int64)
    for row in range(len(start)):
        x, y, dx, dy = start[row, 0], start[row, 1], step[row, 0], step[row, 1]
        ray = x, y, dx, dy, max(abs(dy), 1), max(abs(dx), 1)
        wide = radius, sides[0, row], sides[1, row], dx * dx + dy * dy
        origin, reason = (origins[row, 0], origins[row, 1]), ends[0, row]
        within = bounds[0] - origin[0], bounds[1] - origin[1], bounds[2] - origin[0], bounds[3] - origin[1]
        stop = ends[1, row], ends[3, row], ends[2, row], ends[5, row] != 0, reason < 3  # used up budgets reach no cell
        reached, after, outside = _wide_cells(ray, wide, within, stop) if radius else _thin_cells(ray, within, stop)
        own = slice(hit_begin[row], hit_begin[row + 1])
        end = reason, ends[4, row] if reason in (1, 2) else np.int64(LATE)
        hit, blocked, filtered = _decided(
            items, (hit_rank[own], hit_count[own]), near, taken, origin, ray, wide, bounds, stop, end,
            (meets, exclude, row),
        )  # fmt: skip
        counts[row, Verdict.HIT], counts[row, Verdict.OCCLUDED], counts[row, Verdict.FILTERED] = hit, blocked, filtered
        counts[row, Verdict.EMPTY] = reached - hit - blocked - filtered
        counts[row, Verdict.OUTSIDE], counts[row, Verdict.BEYOND] = outside, after


def _cells(stack: Stack, lines: Lines) -> tuple[Any, ...]:
    """The items listed by cells of the corners of the rays' boxes, if that spares most comparisons; else nothing."""
    size = (np.abs(lines.step).max(axis=0, initial=0) + 2 * max(lines.radius, HALF)) // SUB + 2
    if len(lines) * len(stack) <= BRUTE_PAIRS or not is_sparse(stack.sizes, size):
        return NOWHERE
    return tuple(cells_of(stack.box_xyxy, np.concatenate([[0, 0], size]), int(size.max()).bit_length()))


def fits(longest: int, radius: int) -> bool:
    """Whether sums of products of rays of so many 1/256 px along x or y fit int64."""
    far = 2 * longest * longest
    return longest + radius <= FARTHEST and radius * radius * far < FAR and not (0 < radius < DIAGONAL and far >= LONG)


def _given(
    stack: Stack, lines: Lines, filters: tuple[Ints, Ints] | None, bounds: Box | None
) -> tuple[Ints, tuple[Ints, ...], tuple[Ints, Ints], Box]:
    """Arguments of kernels: the sides of the rays, the items, the filters, and the bounds."""
    sides = np.stack([lines.sides, lines.wide_sides]) if lines.radius else np.zeros((2, len(lines)), np.int64)
    items = stack.box_xyxy, stack.offset, stack.masks, stack.occluder, stack.categories, stack.owner
    return sides, items, filters or (NONE, NOBODY), EVERYWHERE if bounds is None else bounds


def hits_and_ends(
    stack: Stack, bounds: Box | None, lines: Lines, most: int | None, filters: tuple[Ints, Ints] | None = None
) -> tuple[Ints, Ints] | None:
    """See `weapons.rays.raycast.hits_and_ends`; None if rays are so long or so wide that int64 overflows."""
    if not fits(int(np.abs(lines.step).max(initial=0)), lines.radius):
        return None
    sides, items, whose, within = _given(stack, lines, filters, bounds)
    ends = np.zeros((6, len(lines)), np.int64)
    found = rows_by(
        _each, 6, len(lines), PART_PAIRS / (RAY_PAIRS + len(stack)), lines.start, lines.step, lines.radius, sides,
        most or 0, items, _cells(stack, lines), *whose, within, ends,
    )  # fmt: skip
    assert found is not None
    return found, ends


def verdicts_of_rays(walk: Any, filters: tuple[Ints, Ints] | None, bounds: Box | None) -> Ints | None:
    """See `weapons.explain.ray_verdicts.verdicts_of_rays`; None if rays are so long or so wide that it is faster."""
    lines, ends, stack, longest = walk.lines, walk.ends, walk.stack, int(np.abs(walk.lines.step).max(initial=0))
    if longest > (LISTED if lines.radius else SUB * REACH_MAX) or not fits(longest, lines.radius):
        return None
    sides, items, whose, within = _given(stack, lines, filters, bounds)
    stops = np.stack([ends.reason, ends.time, ends.y, ends.x, ends.rank, ends.alone])
    hits = np.searchsorted(walk.hit.ray, np.arange(len(lines) + 1)), walk.hit.rank, walk.hit.count
    counts = np.zeros((len(lines), 6), np.int64)
    _verdicts(
        lines.start, lines.step, walk.rays.origin_xy, lines.radius, sides, stops, *hits, items, *whose, within, counts
    )
    return counts
