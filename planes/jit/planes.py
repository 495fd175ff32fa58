"""Compiled kernels of the march through the distance field, of rays at pixels, and of masks that are mapped."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from numba import types

from ..bits.distance_field import EXACT, LONGEST, NOTHING, UNDECIDED, Clearance
from ..common.checks import Bools, Ints
from ..common.limits import HALF, MAPPED_PIXELS, SUB
from ..grid.rasterize import DIAGONAL
from ..grid.spans import pieces
from ..scene.sprite import frozen
from ..scene.variants import Grids, Turned
from .bit_rows import FLAGS, INTS
from .cache import compiled, helper
from .scene import PELLETS, STEPS, root_of

BLOCK = 128
"""Rays that march together, so that reads overlap; their columns fit the fastest cache."""

ROUNDS = 4
"""Jumps of each ray of a block before finished rays are replaced."""

N, STOP, ALONG, ACROSS, BASE, A, B, C, ASIDE, RAY, COLUMNS = range(11)
"""Columns of a block: N, the crossings before a ray's next look, and those of `bits.distance_field._ways`."""


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
            x, y, slot = start_256[ray, 0], start_256[ray, 1], free[holes - 1]
            why = _way(height, width, x, y, step_256[ray, 0], step_256[ray, 1], block, slot)
            if why < 0:
                entry[ray] = why
            elif block[N, slot] == 0 and _between(flat, block, slot, x, y):
                entry[ray], cell[ray], several[ray] = 0, np.int64(block[BASE, slot]), True
            else:
                block[RAY, slot] = ray
                holes -= 1
            ray += 1
        left = _closed(block, left, free, holes)
        for _ in range(ROUNDS):
            _look(block, left, look)
            _jump(flat, block, left, look, jump)
        holes = _done(block, left, jump, free)
        for hole in range(holes):
            slot = free[hole]
            if block[N, slot] < block[STOP, slot]:
                done, place = np.int64(block[RAY, slot]), np.int64(look[slot])
                several[done] = place < 0
                cell[done] = place = max(place, ~place)
                entry[done] = _entry(place, width, start_256[done], step_256[done])
    return entry, cell, several


@helper()
def _closed(block, left, free, holes):  # type: ignore[no-untyped-def]
    """Move the last rays of a block to the free places; return the number of rays."""
    for hole in range(holes - 1, -1, -1):
        left -= 1
        for column in range(COLUMNS):
            block[column, free[hole]] = block[column, left]
    return left


@helper()
def _done(block, left, jump, free):  # type: ignore[no-untyped-def]
    """Write the places of rays that hit or ended to `free`; return how many."""
    holes = 0
    for slot in range(left):
        free[holes] = slot
        holes += (jump[slot] == 0) | (block[N, slot] >= block[STOP, slot])
    return holes


@helper(error_model="numpy")
def _look(block, count, look):  # type: ignore[no-untyped-def]
    """Write the place of the cell that each ray looks at; at a corner it is ~place, a negative number."""
    for slot in range(count):
        n = block[N, slot]
        quotient = (block[A, slot] * n + block[C, slot]) / block[B, slot]
        i = np.floor(quotient)
        place = np.int32(block[BASE, slot] + i * block[ALONG, slot] + n * block[ACROSS, slot])
        look[slot] = ~place if i == quotient else place


@helper()
def _jump(flat, block, count, look, jump):  # type: ignore[no-untyped-def]
    """Move rays by the distance at their cells, up to their ends."""
    for slot in range(count):
        place = look[slot]
        far = flat[np.int64(max(place, ~place))]
        if place < 0:
            far = min(far, flat[~place - np.int32(block[ASIDE, slot])])
        jump[slot] = far
        block[N, slot] = min(block[N, slot] + far, block[STOP, slot])


@helper()
def _entry(place, width, start_256, step_256):  # type: ignore[no-untyped-def]
    """Time at which a ray enters a cell."""
    ahead_x, ahead_y = SUB * (place % width) - start_256[0], SUB * (place // width) - start_256[1]
    dx, dy = step_256[0], step_256[1]
    ahead_x, ahead_y = ahead_x if dx >= 0 else -ahead_x, ahead_y if dy >= 0 else -ahead_y
    return max((ahead_x - HALF) * max(abs(dy), 1), (ahead_y - HALF) * max(abs(dx), 1), 0)


@helper()
def _between(flat, block, slot, x_256, y_256):  # type: ignore[no-untyped-def]
    """Whether a ray starts on a border and touches a taken cell there, other than the one that it enters."""
    on_x, on_y = (x_256 & (SUB - 1)) == HALF, (y_256 & (SUB - 1)) == HALF
    if not (on_x or on_y):
        return False
    across, base = np.int64(block[ACROSS, slot]), np.int64(block[BASE, slot])
    step = np.int64(block[ALONG, slot]) + across
    if on_x and flat[base - step] == 0:
        return True
    return on_y and (flat[base - across] == 0 or (on_x and flat[base - step - across] == 0))


@helper(error_model="numpy")
def over(numerator, denominator):  # type: ignore[no-untyped-def]
    """Quotient of whole numbers, rounded down, by floats where that is exact."""
    if abs(numerator) < EXACT:
        return np.int64(np.floor(float(numerator) / float(denominator)))
    return numerator // denominator


@helper(error_model="numpy")
def _way(height, width, x_256, y_256, step_x, step_y, block, slot):  # type: ignore[no-untyped-def]
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
    block[A, slot], block[B, slot], block[C, slot] = a, b, c
    block[ALONG, slot], block[ACROSS, slot], block[ASIDE, slot] = along, across, aside
    block[BASE, slot], block[N, slot], block[STOP, slot] = y * width + x, first, stop
    return 0 if first < stop else NOTHING


LATE = 2**62
"""A time after all others."""


@helper(inline="always")
def _spell(low, high, sign, across, entry, leave):
    """Part of the time from `entry` to `leave` in which a ray is between two sides, given relative to its start."""
    if sign == 0:
        return (entry, leave) if low <= 0 <= high else (LATE, np.int64(0))
    near, far = (low, high) if sign > 0 else (-high, -low)
    return max(entry, near * across), min(leave, far * across)


@helper()
def times_in(left, top, right, low, ray):
    """Times at which a ray enters and leaves a box of pixels; leave < entry if it does not touch the box."""
    x, y, dx, dy, across_x, across_y = ray
    entry, leave = _spell(SUB * left - HALF - x, SUB * right + HALF - x, dx, across_x, np.int64(0), across_x * across_y)
    return _spell(SUB * top - HALF - y, SUB * low + HALF - y, dy, across_y, entry, leave)


@helper()
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


@helper()
def _border(start, step):
    """Way to the first border of pixels along an axis, the pixel before it, and the direction."""
    ahead = 1 if step > 0 else -1
    first = (HALF - ahead * start) % SUB
    base = -(step > 0 and first == 0)
    return np.int64(2 if step == 0 and first > 0 else first), np.int64(base), np.int64(ahead)


@helper()
def borders_of(ray):
    """Borders of pixels that a thin ray crosses; see `weapons.explain.ray_verdicts.Borders`."""
    x, y, dx, dy, high, wide = ray
    (first_x, base_x, sign_x), (first_y, base_y, sign_y) = _border(x, dx), _border(y, dy)
    common, rest = wide, high
    while rest:
        common, rest = rest, common % rest
    p, q = wide // common, high // common
    odd, m = (p, first_x) if p & 1 else (q, first_y)
    odd %= 2 * SUB
    inverse = odd
    for _ in range(2):
        inverse = inverse * (2 - odd * inverse) % (2 * SUB)
    m = m % SUB * inverse % SUB
    both = (m * p - first_x) % SUB == 0 and (m * q - first_y) % SUB == 0
    phase = common * p * q * m if both else np.int64(LATE)
    still = dx == 0 or dy == 0
    return first_x, first_y, high, wide, base_x, base_y, sign_x, sign_y, still, phase, common * p * q * SUB


@helper()
def _crossed(first, across, time):
    return max((time // across - first) // SUB + 1, 0)


@helper()
def cells_by(borders, time):
    """Number of cells that a thin ray has entered by a time."""
    first_x, first_y, across_x, across_y, _, _, _, _, still, phase, period = borders
    x, y = _crossed(first_x, across_x, time), _crossed(first_y, across_y, time)
    if time < 0:
        return np.int64(0)
    return (1 + x) * (1 + y) if still else 1 + x + y + max((time - phase) // period + 1, 0)


@helper()
def _cells_up_to(borders, x, y, time):
    """Number of cells entered by a time, after at most `x` borders along x, and `y` along y."""
    first_x, first_y, across_x, across_y, _, _, _, _, still, phase, period = borders
    last = across_x * across_y
    if min(x, y, time) < 0:
        return np.int64(0)
    out_x = (first_x + SUB * x) * across_x if x < _crossed(first_x, across_x, last) else np.int64(LATE)
    out_y = (first_y + SUB * y) * across_y if y < _crossed(first_y, across_y, last) else np.int64(LATE)
    out = min(out_x, out_y)
    if still or out == 0:
        until = time if still else np.int64(0)
        return (1 + min(_crossed(first_x, across_x, until), x)) * (1 + min(_crossed(first_y, across_y, until), y))
    if time < out:
        return cells_by(borders, time)
    return cells_by(borders, out - 1) + (out_x != out_y and out >= phase and (out - phase) % period == 0)


@helper()
def _sides(low, high, base, sign, most):
    """Borders before the near side of a box along an axis, and up to its far side."""
    near, far = (low - base, high - base) if sign > 0 else (base - high, base - low)
    return min(max(near, 0), most + 1) - 1, min(max(far, -1), most)


@helper()
def cells_within(borders, box, time):
    """Number of cells of a box that a thin ray has entered by a time."""
    first_x, first_y, across_x, across_y, base_x, base_y, sign_x, sign_y, _, _, _ = borders
    last = across_x * across_y
    x_before, x = _sides(box[0], box[2], base_x, sign_x, _crossed(first_x, across_x, last))
    y_before, y = _sides(box[1], box[3], base_y, sign_y, _crossed(first_y, across_y, last))
    count = _cells_up_to(borders, x, y, time) - _cells_up_to(borders, x_before, y, time)
    return count - _cells_up_to(borders, x, y_before, time) + _cells_up_to(borders, x_before, y_before, time)


@helper()
def wide_run_of(row, u, along, v, step, wide, per):
    """First and last cell of a row that a wide ray may touch, along its longer axis; `per` is 1 / step, or 0."""
    reach = max(wide[0], DIAGONAL)
    low, high = float(min(u, u + along) - reach), float(max(u, u + along) + reach)
    if step != 0:
        cross = (SUB * row - v) * along
        middle, half = u + cross * per, wide[2] * abs(per)
        low, high = max(low, middle - half), min(high, middle + half)
    return np.int64(np.ceil((low - 1) / SUB)), np.int64(np.floor((high + 1) / SUB))


@helper()
def rows_between(least, most, u, along, v, step, wide):
    """First and last row that a ray may touch between two columns, along its longer axis; floats have room."""
    reach = max(wide[0], DIAGONAL) if wide[0] > 0 else HALF
    if along == 0:
        return (v - reach) // SUB, (v + reach) // SUB + 1
    low, high = min(u, u + along) - reach, max(u, u + along) + reach
    near, far = min(max(SUB * least - HALF, low), high), max(min(SUB * most + HALF, high), low)
    slope = step / along
    one, other = v + (near - u) * slope, v + (far - u) * slope
    half = max(float(HALF), wide[2] / abs(along)) + 1
    return np.int64(np.floor((min(one, other) - half) / SUB)), np.int64(np.ceil((max(one, other) + half) / SUB))


@helper()
def bounds_of_times(left, top, right, low, ray, wide):
    """Bounds of the times at which a ray enters pixels of a box; the second is less if it touches none."""
    if wide[0] == 0:
        return times_in(left, top, right, low, ray)
    x, y, dx, dy, _, _ = ray
    reach, length2 = wide[2], wide[3]
    left, right, top, low = SUB * left - x, SUB * right - x, SUB * top - y, SUB * low - y
    u_least = min(left * dx, right * dx) + min(top * dy, low * dy)
    u_most = max(left * dx, right * dx) + max(top * dy, low * dy)
    v_least = min(left * dy, right * dy) - max(top * dx, low * dx)
    v_most = max(left * dy, right * dy) - min(top * dx, low * dx)
    if v_least > reach or v_most < -reach or u_least - reach - 2 > length2 or u_most + reach + 2 < 0:
        return np.int64(1), np.int64(0)
    return max(u_least - reach - 2, 0), u_most + reach + 2


@helper()
def between(u, along, cells, low, high):
    """First and last of some cells, from a product `u` on with a step, whose product is `low` .. `high`."""
    far = u + along * (cells - 1)
    if min(u, far) >= low and max(u, far) <= high:
        return np.int64(0), cells - 1
    ahead = abs(along)
    if along > 0:
        return max(-over(u - low, ahead), 0), min(over(high - u, ahead), cells - 1)
    return max(-over(high - u, ahead), 0), min(over(u - low, ahead), cells - 1)


@helper()
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


@helper()
def part_of(box, at, origin_x, origin_y, bounds):
    """The part of an item's box within the bounds, relative to a pixel."""
    left, top = max(box[at, 0], bounds[0]) - origin_x, max(box[at, 1], bounds[1]) - origin_y
    return left, top, min(box[at, 2], bounds[2]) - origin_x, min(box[at, 3], bounds[3]) - origin_y


@helper()
def share(time, length2, scale):
    """The part time / scale of a squared length below 2**50, rounded down; products wrap, their difference fits."""
    whole = np.int64(np.floor(float(time) / float(scale) * float(length2)))
    return whole + (time * length2 - whole * scale) // scale


@helper()
def half_chord(radius, v, length2):
    """Root of radius^2 length^2 - v^2, rounded down; see `grid.fixed_point.far_roots`."""
    side = radius * np.sqrt(float(length2))
    root = np.int64(np.rint(np.sqrt(max((side - v) * (side + v), 0.0))))
    left = radius * radius * length2 - v * v - root * root
    if root < 2**31:
        return root_of(root * root + left)
    step = left // (2 * root)
    return root + step - (left - 2 * root * step - step * step < 0)


PLACE_BITS = 40
"""Bits of a place on a frame beyond the pixel."""

DOUBT = 1 << 18
"""Places are too small by less: 2**16 steps of a grid, each rounded down to 2**-40 px."""


@helper()
def entry_of(at_x, at_y, u, v, ray, wide):
    """Time at which a ray enters a pixel, see `grid.rasterize.Lines.times`; LATE if it does not touch it.

    Parameters
    ----------
    u, v : products of the ray with the vector from its start to the pixel, along it and across
    """
    x, y, _, _, across_x, across_y = ray
    radius, side, _, length2 = wide
    best, within = np.int64(LATE), (np.int64(0), np.int64(-1))
    if radius < DIAGONAL:
        within = times_in(at_x, at_y, at_x, at_y, ray)
        if radius == 0:
            return within[0] if within[0] <= within[1] else best
    if abs(v) <= side and (length2 > 0 or (SUB * at_x - x) ** 2 + (SUB * at_y - y) ** 2 <= radius * radius):
        root = half_chord(radius, v, length2)
        if max(u - root, 0) <= min(u + root, length2):
            best = max(u - root, 0)
    if within[0] <= within[1]:
        entry = -share(-within[0], length2, across_x * across_y)
        if entry <= share(within[1], length2, across_x * across_y):
            best = min(best, entry)
    return best


@helper()
def _place(parts, unit):
    """A number of pixels, given in parts, rounded down to 2**-40."""
    whole = parts // unit
    return (whole << PLACE_BITS) + np.int64(float(parts - whole * unit) / float(unit) * (1 << PLACE_BITS))


@helper()
def _is_held(flat, frame, place, unit):
    """Whether a set square of a frame holds a place in parts, which may lie on the border of several."""
    (begin, wide, high), column, row = frame, place[0] // unit[0], place[1] // unit[1]
    for j in (row, row - 1) if place[1] == row * unit[1] else (row, row):
        for i in (column, column - 1) if place[0] == column * unit[0] else (column, column):
            if 0 <= j < high and 0 <= i < wide and flat[begin + j * wide + i]:
                return True
    return False


@helper()
def _within(place, step, size, near, far):
    """The part of near .. far - 1 whose places on an axis, which are DOUBT too great, may be on a frame of a size."""
    most = (size << PLACE_BITS) + 2 * DOUBT - 1  # `_map` looks exactly at all up to it
    if step == 0:
        return (near, far) if 0 <= place <= most else (near, near)
    first, last = float(-place) / float(step), float(most - place) / float(step)
    near = min(max(near, np.int64(np.ceil(min(first, last)))), far)
    return near, max(min(far, np.int64(np.floor(max(first, last))) + 1), near)


@helper()
def _map(flat, frame, first, step, unit, size_wh, held):
    """Map a frame to a grid `held`; return the sides of what is set, right and low exclusive, and its pixels.

    A place that may lie on a border of squares, or be rounded across one, is looked at exactly.
    """
    (begin, wide, high), width, rest = frame, size_wh[0], (1 << PLACE_BITS) - 1
    (across_x, down_x), (across_y, down_y) = step
    first_x, first_y = _place(first[0], unit[0]) + DOUBT, _place(first[1], unit[1]) + DOUBT
    step_x, step_y = _place(across_x, unit[0]), _place(across_y, unit[1])
    row_x, row_y = _place(down_x, unit[0]), _place(down_y, unit[1])
    left, top, right, low, area = width, size_wh[1], 0, 0, 0
    for y in range(size_wh[1]):
        row, count = held[y * width : (y + 1) * width], 0
        place_x, place_y = first_x + y * row_x, first_y + y * row_y
        near, far = _within(place_x, step_x, wide, 0, width)
        near, far = _within(place_y, step_y, high, near, far)
        for x in range(near):
            row[x] = False
        for x in range(far, width):
            row[x] = False
        place_x, place_y = place_x + near * step_x, place_y + near * step_y
        for x in range(near, far):
            if place_x & rest < 2 * DOUBT or place_y & rest < 2 * DOUBT:
                place = first[0] + x * across_x + y * down_x, first[1] + x * across_y + y * down_y
                on = _is_held(flat, frame, place, unit)
            else:
                on = flat[np.uint64(begin + (place_y >> PLACE_BITS) * wide + (place_x >> PLACE_BITS))]
            row[np.uint64(x)] = on
            count += on
            place_x, place_y = place_x + step_x, place_y + step_y
        if count:
            area, top, low = area + count, min(top, y), y + 1
            begin_x, last_x = near, far - 1
            while begin_x < left and not row[begin_x]:
                begin_x += 1
            while last_x >= right and not row[last_x]:
                last_x -= 1
            left, right = min(left, begin_x), max(right, last_x + 1)
    return left, top, right, low, area


@compiled(types.Tuple((types.int64[:, ::1], types.boolean[::1]))(
    FLAGS, PELLETS, INTS, PELLETS, STEPS, PELLETS, PELLETS
))  # fmt: skip
def _turned_masks(flat, frames, which, first, step, unit, size_wh):
    boxes, room, most, used = np.empty((len(which), 6), np.int64), 0, 0, 0
    for n in range(len(which)):
        room, most = room + size_wh[n, 0] * size_wh[n, 1], max(most, size_wh[n, 0] * size_wh[n, 1])
    out, held = np.empty(room, np.bool_), np.empty(most, np.bool_)
    for n in range(len(which)):
        left, top, right, low, area = _map(flat, frames[which[n]], first[n], step[n], unit[n], size_wh[n], held)
        wide, high = max(right - left, 0), max(low - top, 0)
        boxes[n, 0], boxes[n, 1], boxes[n, 2], boxes[n, 3], boxes[n, 4], boxes[n, 5] = left, top, wide, high, area, used
        for y in range(top, top + high):
            begin = y * size_wh[n, 0] + left
            source, row = held[begin : begin + wide], out[used : used + wide]
            for k in range(wide):
                row[k] = source[k]
            used += wide
    return boxes, out


def turned_masks(masks: Sequence[Bools], which: Ints, grids: Grids) -> Turned:
    """See `scene.variants.turned_masks`; it divides once a row, not once a pixel."""
    sizes = [mask.size for mask in masks]
    shapes = [(begin, *mask.shape[::-1]) for begin, mask in zip(accumulate(sizes, initial=0), masks, strict=False)]
    flat = np.concatenate([mask.reshape(-1) for mask in masks])
    frames, made, found = np.array(shapes), [], []
    for part in pieces(grids.size_wh.prod(axis=1), MAPPED_PIXELS):
        _, size_wh, *places = (column[part] for column in grids)
        boxes, out = _turned_masks(flat, frames, which[part], *places, size_wh)
        made += [frozen(out[at : at + wide * high].reshape(high, wide)) for wide, high, _, at in boxes[:, 2:].tolist()]
        found.append(boxes)
    every = np.concatenate(found)
    return Turned(made, every[:, :2], every[:, 4])
