"""Compiled kernels of the label plane, the distance field and its march, of rays at pixels, and of turned masks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np
from numba import njit, types

from ..bits.distance_field import EXACT, FAR, LONGEST, NOTHING, PAD, UNDECIDED, Clearance
from ..bits.label_plane import CELL_BITS, Front
from ..common.checks import Bools, Ints, Labels
from ..common.limits import HALF, MAPPED_PIXELS, SUB, TRIG_BITS
from ..grid.spans import WIDEST, Box, RowRuns, pieces
from ..grid.turns import Edges
from ..scene.variants import Grids, Turned
from .bit_rows import BOXES, FLAGS, INTS, OUT, ROWS_OUT
from .cache import compiled
from .scene import PARTS, PELLETS, STEPS, add_run, at_least, at_most, empty_parts, layout, root_of

BLOCK = 128
"""Rays that march together, so that reads overlap; their columns fit the fastest cache."""

ROUNDS = 4
"""Jumps of each ray of a block before finished rays are replaced."""

N, STOP, ALONG, ACROSS, BASE, A, B, C, ASIDE, RAY, COLUMNS = range(11)
"""Columns of a block: N, the crossings before a ray's next look, and those of `bits.distance_field._ways`."""


@compiled()
def paint(labels: Labels, x: int, y: int, dirty: Ints, places: Ints, masks: Bools) -> None:
    """Redraw boxes of a label plane, back to front; see `bits.label_plane.paint`."""
    for d in range(len(dirty)):
        left, top, right, low = dirty[d, 0], dirty[d, 1], dirty[d, 2], dirty[d, 3]
        labels[top - y : low - y + 1, left - x : right - x + 1] = 0
        for rank in range(len(places) - 1, -1, -1):
            place = places[rank]
            if place[0] <= right and place[2] >= left and place[1] <= low and place[3] >= top:
                paint_item(labels, x, y, left, top, right, low, place, masks)


@compiled()
def paint_item(
    labels: Labels, x: int, y: int, left: int, top: int, right: int, low: int, place: Any, masks: Bools
) -> None:
    """Draw the part of an item that lies in a box over what is drawn there."""
    zero, one = labels.dtype.type(0), labels.dtype.type(1)
    code = labels.dtype.type(place[5])
    width = place[2] - place[0] + 1
    x0, x1, y0, y1 = max(left, place[0]), min(right, place[2]), max(top, place[1]), min(low, place[3])
    begin = place[4] + (y0 - place[1]) * width + x0 - place[0]
    n = x1 - x0 + 1
    for row in range(y0 - y, y1 - y + 1):
        part, mask = labels[row, x0 - x : x1 - x + 1], masks[begin : begin + n]
        for i in range(n):
            old = part[i]
            new = code + one if old != zero else code
            part[i] = new if mask[i] else old
        begin += width


CELLS = types.Array(types.boolean, 2, "C", readonly=True)
BITS = np.uint64(CELL_BITS)


# house: hit rule of areas
@compiled(
    *(
        types.int64(
            types.Array(kind, 2, "C", readonly=True), CELLS, *[types.int64] * 2, BOXES, FLAGS, OUT, OUT, ROWS_OUT
        )
        for kind in (types.uint16, types.uint32)
    )
)  # fmt: skip
def _front_at(labels, cells, left, top, at_256, objects, place, item, xy):
    count = 0
    high, wide, coarse = np.uint64(labels.shape[0]), np.uint64(labels.shape[1]), cells.size > 0
    for i in range(len(at_256)):
        x, y = (at_256[i, 0] + HALF) >> 8, (at_256[i, 1] + HALF) >> 8
        column, row = np.uint64(x - left), np.uint64(y - top)  # negative numbers become very large
        if (column >= wide) | (row >= high):
            continue
        if coarse and not cells[row >> BITS, column >> BITS]:
            continue
        front = np.int64(labels[row, column] >> 1)  # always written; the next one overwrites it if it is no hit
        place[count], item[count], xy[count, 0], xy[count, 1] = i, front - 1, x, y
        count += objects[front]
    return count


NO_CELLS: Bools = np.zeros((0, 0), np.bool_)


def front_at(labels: Labels, cells: Bools | None, plane_xyxy: Box, at_256: Ints, objects: Bools) -> Front:
    """See `bits.label_plane.front_at`."""
    place, item = np.empty((2, len(at_256)), np.int64)
    xy, coarse = np.empty(at_256.shape, np.int64), NO_CELLS if cells is None else cells
    count = _front_at(labels, coarse, plane_xyxy[0], plane_xyxy[1], at_256, objects, place, item, xy)
    return Front(place[:count], item[:count], xy[:count])


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


LATE = 2**62
"""A time after all others."""


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
def part_of(box, at, origin_x, origin_y, bounds):
    """The part of an item's box within the bounds, relative to a pixel."""
    left, top = max(box[at, 0], bounds[0]) - origin_x, max(box[at, 1], bounds[1]) - origin_y
    return left, top, min(box[at, 2], bounds[2]) - origin_x, min(box[at, 3], bounds[3]) - origin_y


@njit
def share(time, length2, scale):
    """The part time / scale of a squared length below 2**50, rounded down; products wrap, their difference fits."""
    whole = np.int64(np.floor(float(time) / float(scale) * float(length2)))
    return whole + (time * length2 - whole * scale) // scale


@njit
def half_chord(radius, v, length2):
    """Root of radius^2 length^2 - v^2, rounded down; see `grid.fixed_point.far_roots`."""
    side = radius * np.sqrt(float(length2))
    root = np.int64(np.rint(np.sqrt(max((side - v) * (side + v), 0.0))))
    left = radius * radius * length2 - v * v - root * root
    if root < 2**31:
        return root_of(root * root + left)
    step = left // (2 * root)
    return root + step - (left - 2 * root * step - step * step < 0)


MASKS = types.Array(types.boolean, 1, "C", readonly=True)


@njit
def _is_beside(flat, begin, wide, high, column, row, left, up):
    """Whether any of the squares of a frame that meet at a border is set."""
    for j in (row, row - 1) if up else (row, row):
        for i in (column, column - 1) if left else (column, column):
            if 0 <= j < high and 0 <= i < wide and flat[begin + j * wide + i]:
                return True
    return False


@njit
def _within(value, step, most, near, far):
    """The part of near .. far - 1 in which 0 <= value + k * step <= most."""
    if step == 0:
        return (near, far) if 0 <= value <= most else (near, near)
    first, last = -(value // step), (most - value) // step
    if step < 0:
        first, last = -((value - most) // step), -value // step
    near = max(near, first)
    return near, max(min(far, last + 1), near)


@njit
def _map(flat, frame, first, step, unit, size_wh, held):
    """Map a frame to a grid `held`; return the sides of what is set, right and low exclusive, and its pixels."""
    (begin, wide, high), (unit_x, unit_y), width = frame, unit, size_wh[0]
    (across_x, down_x), (across_y, down_y) = step[0], step[1]
    along_x, over_x, along_y, over_y = across_x // unit_x, across_x % unit_x, across_y // unit_y, across_y % unit_y
    columns, rows, first_place, at = np.uint64(wide), np.uint64(high), np.uint64(begin), 0
    left, top, right, low, area = width, size_wh[1], 0, 0, 0
    for y in range(size_wh[1]):
        begin_x, begin_y = first[0] + y * down_x, first[1] + y * down_y
        near, far = _within(begin_x, across_x, wide * unit_x, 0, width)
        near, far = _within(begin_y, across_y, high * unit_y, near, far)
        held[at : at + width] = False
        place_x, place_y = begin_x + near * across_x, begin_y + near * across_y
        column, x_rest, row, y_rest = place_x // unit_x, place_x % unit_x, place_y // unit_y, place_y % unit_y
        count = 0
        for x in range(at + near, at + far):
            j, i = np.uint64(row), np.uint64(column)
            on = j < rows and i < columns and flat[first_place + j * columns + i]
            if x_rest == 0 or y_rest == 0:
                on = on or _is_beside(flat, begin, wide, high, column, row, x_rest == 0, y_rest == 0)
            held[np.uint64(x)] = on
            count += on
            x_rest, y_rest = x_rest + over_x, y_rest + over_y
            carried_x, carried_y = x_rest >= unit_x, y_rest >= unit_y  # without a branch
            column, row = column + along_x + carried_x, row + along_y + carried_y
            x_rest, y_rest = x_rest - (unit_x if carried_x else 0), y_rest - (unit_y if carried_y else 0)
        if count:
            area, top, low = area + count, min(top, y), y + 1
            first_x, last_x = near, far - 1
            while first_x < left and not held[at + first_x]:
                first_x += 1
            while last_x >= right and not held[at + last_x]:
                last_x -= 1
            left, right = min(left, first_x), max(right, last_x + 1)
        at += width
    return left, top, right, low, area


@njit
def _crop(held, width, left, top, wide, high, quarter, out):
    """Write a part of a grid to `out`, turned by quarter turns."""
    begin, down, right = 0, wide, 1
    if quarter == 1:
        begin, down, right = high - 1, -1, high
    elif quarter == 2:
        begin, down, right = high * wide - 1, -wide, -1
    elif quarter == 3:
        begin, down, right = (wide - 1) * high, 1, -high
    for y in range(high):
        source, place = (top + y) * width + left, begin + y * down
        for x in range(wide):
            out[place + x * right] = held[source + x]


@compiled(types.Tuple((types.int64[:, ::1], types.boolean[::1]))(
    MASKS, PELLETS, INTS, PELLETS, STEPS, PELLETS, PELLETS, INTS
))  # fmt: skip
def _turned_masks(flat, frames, which, first, step, unit, size_wh, quarter):
    boxes, room, most, used = np.empty((len(which), 6), np.int64), 0, 0, 0
    for n in range(len(which)):
        room, most = room + size_wh[n, 0] * size_wh[n, 1], max(most, size_wh[n, 0] * size_wh[n, 1])
    out, held = np.empty(room, np.bool_), np.empty(most, np.bool_)
    for n in range(len(which)):
        left, top, right, low, area = _map(flat, frames[which[n]], first[n], step[n], unit[n], size_wh[n], held)
        wide, high = max(right - left, 0), max(low - top, 0)
        _crop(held, size_wh[n, 0], left, top, wide, high, quarter[n], out[used:])
        boxes[n, 0], boxes[n, 1], boxes[n, 4], boxes[n, 5] = left, top, area, used
        boxes[n, 2], boxes[n, 3] = (high, wide) if quarter[n] & 1 else (wide, high)
        used += wide * high
    return boxes, out


def turned_masks(masks: Sequence[Bools], which: Ints, grids: Grids, quarters: Ints) -> list[Turned]:
    """See `scene.variants.turned_masks`; it divides once a row, not once a pixel."""
    sizes = [mask.size for mask in masks]
    shapes = [(begin, *mask.shape[::-1]) for begin, mask in zip(accumulate(sizes, initial=0), masks, strict=False)]
    flat = np.concatenate([mask.reshape(-1) for mask in masks])
    frames, made = np.array(shapes), []
    for part in pieces(grids.size_wh.prod(axis=1), MAPPED_PIXELS):
        _, size_wh, *places = (column[part] for column in grids)
        boxes, out = _turned_masks(flat, frames, which[part], *places, size_wh, quarters[part])
        for left, top, wide, high, area, begin in boxes.tolist():
            made.append(Turned(out[begin : begin + wide * high].reshape(high, wide), left, top, area))
    return made


@njit
def _rows_of(sides, pivot_y, c, s):
    """First and last row of pixels that a turned rectangle may hold; see `turned_runs`."""
    left, right, top, low = sides
    first = (min(left * s, right * s) + top * c >> TRIG_BITS) + pivot_y - 1
    return first >> 8, (max(left * s, right * s) + low * c >> TRIG_BITS) + pivot_y + 1 >> 8


@njit
def _turned_rows(sides, pivot, c, s, row, first, last):
    """Fill the first and last pixel that a turned rectangle holds in each row from `row` on; see `turned_runs`."""
    (left, right, top, low), (x, y) = sides, pivot
    first[:], last[:] = -WIDEST, WIDEST
    down = SUB * row - y
    at_least((left << TRIG_BITS) - down * s + x * c, -SUB * s, SUB * c, first)
    at_most((right << TRIG_BITS) - down * s + x * c, -SUB * s, SUB * c, last)
    above, below = down * c - (low << TRIG_BITS) + x * s, down * c - (top << TRIG_BITS) + x * s
    if s >= 0:
        at_least(above, SUB * c, SUB * max(s, 1), first)
        at_most(below, SUB * c, SUB * max(s, 1), last)
    else:
        at_least(-below, -SUB * c, -SUB * s, first)
        at_most(-above, -SUB * c, -SUB * s, last)


@compiled(types.Tuple((OUT, OUT, PARTS))(INTS, BOXES, BOXES, INTS, INTS, INTS))
def _turned_runs(begin, sides, pivots, quarter, c, s):
    count, most = len(quarter), 0
    top, low = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        turns, top[k], low[k] = quarter[k], LATE, -LATE
        for r in range(begin[turns], begin[turns + 1]):
            upper, lower = _rows_of(sides[r], pivots[turns, 1], c[k], s[k])
            top[k], low[k], most = min(top[k], upper), max(low[k], lower), max(most, lower - upper + 1)
    shape, y, start = layout(top, low)
    parts, used = empty_parts(2, len(y)), np.zeros(len(y), np.int64)
    first, last = np.empty(most, np.int64), np.empty(most, np.int64)
    for k in range(count):
        turns = quarter[k]
        for r in range(begin[turns], begin[turns + 1]):
            upper, lower = _rows_of(sides[r], pivots[turns, 1], c[k], s[k])
            high, at = lower - upper + 1, start[k] + upper - top[k]
            _turned_rows(sides[r], pivots[turns], c[k], s[k], upper, first[:high], last[:high])
            for i in range(high):
                parts = add_run(parts, used, at + i, first[i], last[i])
    return shape, y, parts


def turned_runs(edges: Edges, quarter: Ints, c: Ints, s: Ints) -> RowRuns:
    """See `grid.turns.turned_runs`."""
    shape, y, parts = _turned_runs(edges.begin, np.ascontiguousarray(edges.sides.T), edges.pivots, quarter, c, s)
    return RowRuns(shape, y, parts)
