"""Compiled kernels of fixed point and shapes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import types

from ..common.checks import Floats, Ints
from ..common.limits import HALF, POSITION_MAX, SUB, TRIG_BITS
from ..grid.fixed_point import DOUBT, ONE
from ..grid.rasterize import DIAGONAL, ROOM, Edges, sides_of
from ..grid.spans import WIDEST, RowRuns
from .bit_rows import BOXES, INTS, OUT
from .cache import compiled, helper

TERMS = 8  # terms of each series; up to 45 degrees the rest is below 2**-53

SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(TERMS))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(TERMS + 1))

RADIAN = math.pi / 180
FLOATS = types.Array(types.float64, 1, "C", readonly=True)
NO_SIDES = np.zeros(0, np.int64)


@compiled(types.boolean(FLOATS, types.int64[::1], types.int64[::1], types.boolean[::1]))
def _nearest(degrees, cosine, sine, doubt):
    folded, any_doubt = np.abs(degrees), False
    for i in range(len(folded)):
        if folded[i] >= 360:
            folded[i] = np.fmod(folded[i], 360.0)
    for i in range(len(folded)):
        angle = folded[i]
        down = angle > 180
        angle = 360 - angle if down else angle
        left = angle > 90
        angle = 180 - angle if left else angle
        steep = angle > 45
        x = (90 - angle if steep else angle) * RADIAN
        far, near = SINE[TERMS - 1], COSINE[TERMS]
        for k in range(TERMS - 2, -1, -1):
            far = far * (x * x) + SINE[k]
        for k in range(TERMS - 1, -1, -1):
            near = near * (x * x) + COSINE[k]
        far *= x
        c, s = (far if steep else near) * ONE, (near if steep else far) * ONE
        c, s = -c if left else c, -s if down ^ (degrees[i] < 0) else s
        whole_c, whole_s = np.rint(c), np.rint(s)
        cosine[i], sine[i] = np.int32(whole_c), np.int32(whole_s)
        doubt[i] = max(abs(c - whole_c), abs(s - whole_s)) > 0.5 - DOUBT
        any_doubt |= doubt[i]
    return any_doubt


def nearest(degrees: Floats) -> tuple[Ints, Ints, Ints]:
    """See `grid.fixed_point.nearest`."""
    count = len(degrees)
    cosine, sine, doubt = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.bool_)
    in_doubt = _nearest(degrees, cosine, sine, doubt)
    return cosine, sine, np.flatnonzero(doubt) if in_doubt else np.zeros(0, np.int64)


@compiled(types.boolean(FLOATS, types.int64[::1]))
def _snapped(at, whole):
    good = True
    for i in range(len(at)):
        good &= abs(at[i]) <= POSITION_MAX  # false for NaN
        whole[i] = np.int64(np.rint(at[i] * SUB))
    return good


def snapped(at: Floats) -> Ints | None:
    """See `grid.fixed_point.snapped`."""
    whole = np.empty(at.shape, np.int64)
    return whole if _snapped(at.ravel(), whole.ravel()) else None


PELLETS = types.Array(types.int64, 2, "A", readonly=True)
STEPS = types.Array(types.int64, 3, "A", readonly=True)
PARTS = types.int64[:, :, ::1]
WHOLE = types.int64


@helper(inline="always")
def _over_one(value):
    """See `fixed_point.over_one`."""
    return (value + (ONE // 2 - 1) + ((value >> TRIG_BITS) & 1)) >> TRIG_BITS


@compiled(PARTS(PELLETS, PELLETS))
def turned_to(points_256, direction):
    """See `grid.fixed_point.turned_to`."""
    out = np.empty((len(direction), len(points_256), 2), np.int64)
    for k in range(len(direction)):
        c, s = direction[k]
        for i in range(len(points_256)):
            x, y = points_256[i]
            out[k, i, 0], out[k, i, 1] = _over_one(x * c - y * s), _over_one(x * s + y * c)
    return out


@helper()
def _lower(quotient, rest, more, over, per, out):
    """Lower out[k] to the whole part of a quotient, which grows by more + over / per from each to the next.

    No division is needed; `rest` / `per` is what the quotient lacks.
    """
    for k in range(len(out)):
        out[k] = min(out[k], quotient)
        rest += over
        carried = rest >= per
        quotient += more + carried
        rest -= per if carried else 0


@helper()
def _raise(quotient, rest, more, over, per, out):
    """Raise out[k] to the negative of such a quotient."""
    for k in range(len(out)):
        out[k] = max(out[k], -quotient)
        rest += over
        carried = rest >= per
        quotient += more + carried
        rest -= per if carried else 0


@helper()
def at_most(value, step, per, last):
    """Lower last[k] to the floor of (value + k * step) / per."""
    _lower(value // per, value % per, step // per, step % per, per, last)


@helper()
def at_least(value, step, per, first):
    """Raise first[k] to the ceiling of (value + k * step) / per."""
    _raise(-value // per, -value % per, -step // per, -step % per, per, first)


@helper(inline="always")
def _ceil(value, per):
    return -(-value // per)


@helper()
def root_of(value):
    """Square root of a whole number, rounded down."""
    root = np.int64(np.sqrt(np.float64(value)))
    while root * root > value:
        root -= 1
    while (root + 1) * (root + 1) <= value:
        root += 1
    return root


@helper(allocates=True)
def layout(top, low):
    """Shape and row of all rows top .. low of shapes, and where those of each begin (n + 1,)."""
    begin = np.zeros(len(top) + 1, np.int64)
    for k in range(len(top)):
        begin[k + 1] = begin[k] + max(low[k] - top[k] + 1, 0)
    shape, y = np.empty(begin[-1], np.int64), np.empty(begin[-1], np.int64)
    for k in range(len(top)):
        for i in range(begin[k], begin[k + 1]):
            shape[i], y[i] = k, top[k] + i - begin[k]
    return shape, y, begin


@helper(allocates=True)
def empty_parts(count, rows):
    """Parts (count, 2, rows) of `RowRuns`, all of them empty."""
    parts = np.empty((count, 2, rows), np.int64)
    parts[:, 0], parts[:, 1] = WIDEST, -WIDEST
    return parts


@helper(allocates=True)
def more_parts(parts):
    """Twice as many parts, of which the first are the given ones."""
    more = empty_parts(2 * len(parts), parts.shape[2])
    for k in range(parts.size):
        more.flat[k] = parts.flat[k]
    return more


@helper()
def add_run(parts, used, row, first, last):
    """Add a run, if it is not empty, to a row: to the run that was added last, if it touches that one.

    Returned is whether that was done, or there is no room; the first `used` (k,) parts of each row are not empty.
    """
    if first > last:
        return True
    part = used[row] - 1
    if part >= 0 and first <= parts[part, 1, row] + 1 and last >= parts[part, 0, row] - 1:
        parts[part, 0, row], parts[part, 1, row] = min(parts[part, 0, row], first), max(parts[part, 1, row], last)
        return True
    if part + 1 == len(parts):
        return False
    parts[part + 1, 0, row], parts[part + 1, 1, row] = first, last
    used[row] += 1
    return True


@helper()
def _winding(ring):
    """1 or -1 for a convex ring (m, 2) that turns right or left; 0 for any other: see `rasterize.convex_polygons`."""
    count, changes, right, left, level = len(ring), 0, 0, 0, True
    for i in range(count):
        j, k = (i + 1) % count, (i + 2) % count
        dx, dy = ring[j, 0] - ring[i, 0], ring[j, 1] - ring[i, 1]
        next_x, next_y = ring[k, 0] - ring[j, 0], ring[k, 1] - ring[j, 1]
        turn = dx * next_y - dy * next_x
        right, left, level = right + (turn > 0), left + (turn < 0), level and dy == 0
        changes += (dy < 0) != (next_y < 0)
        if turn == 0 and dx * next_x + dy * next_y <= 0:
            return 0
    if changes > 2 or level or (right > 0) == (left > 0):
        return 0
    return 1 if right else -1


@compiled(types.Tuple((types.boolean, OUT, OUT, PARTS))(STEPS))
def _convex_polygons(points):
    count, corners = points.shape[:2]
    top, low, winding = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        winding[k] = _winding(points[k])
        top[k], low[k] = _ceil(points[k, :, 1].min(), SUB), points[k, :, 1].max() // SUB
    if not winding.all():
        return False, top, low, np.empty((0, 0, 0), np.int64)
    shape, y, begin = layout(top, low)
    parts = np.empty((1, 2, len(y)), np.int64)
    first, last = parts[0, 0], parts[0, 1]
    first[:], last[:] = -WIDEST, WIDEST
    for k in range(count):
        for i in range(corners):
            (x0, y0), (x1, y1) = points[k, i], points[k, (i + 1) % corners]
            is_first = (y1 < y0) == (winding[k] > 0)
            if y1 < y0:
                x0, y0, x1, y1 = x1, y1, x0, y0
            dx, dy, upper, lower = x1 - x0, y1 - y0, _ceil(y0, SUB), y1 // SUB
            if dy == 0 or upper > lower:
                continue
            across, at = x0 * dy - y0 * dx + SUB * dx * upper, begin[k] - top[k]
            if is_first:
                at_least(across, SUB * dx, SUB * dy, first[at + upper : at + lower + 1])
            else:
                at_most(across, SUB * dx, SUB * dy, last[at + upper : at + lower + 1])
    return True, shape, y, parts


def convex_polygons(points: Ints) -> RowRuns | None:
    """See `grid.rasterize.convex_polygons`."""
    convex, shape, y, parts = _convex_polygons(points)
    return RowRuns(shape, y, parts) if convex else None


@helper()
def _cross(x0, y0, x1, y1, top, crossing, count):
    """Add where an edge that goes down crosses rows to their sorted crossings, see `rasterize._even_odd`."""
    upper, per, step = _ceil(y0, SUB), SUB * (y1 - y0), SUB * (x1 - x0)
    across, more, over = x0 * (y1 - y0) + (SUB * upper - y0) * (x1 - x0), step // per, step % per
    quotient, rest = across // per, across % per
    for row in range(upper - top, _ceil(y1, SUB) - top):
        x, j = 2 * quotient + (rest > 0), count[row]
        count[row] += 1
        while j > 0 and crossing[row, j - 1] > x:
            crossing[row, j], j = crossing[row, j - 1], j - 1
        crossing[row, j] = x
        rest += over
        carried = rest >= per
        quotient += more + carried
        rest -= per if carried else 0


@compiled(types.Tuple((OUT, OUT, PARTS))(STEPS, INTS))
def _even_odd(points, starts):
    number, corners = points.shape[:2]
    following, top, low = np.arange(1, corners + 1), np.empty(number, np.int64), np.empty(number, np.int64)
    for i in range(len(starts)):
        following[(starts[i + 1] if i + 1 < len(starts) else corners) - 1] = starts[i]
    high = 0
    for k in range(number):
        top[k], low[k] = _ceil(points[k, :, 1].min(), SUB), points[k, :, 1].max() // SUB
        high = max(high, low[k] - top[k] + 1)
    shape, y, begin = layout(top, low)
    parts, used = empty_parts(2, len(y)), np.zeros(len(y), np.int64)
    crossing, count = np.empty((high, corners), np.int64), np.empty(high, np.int64)
    for k in range(number):
        count[:] = 0
        for i in range(corners):
            (x0, y0), (x1, y1) = points[k, i], points[k, following[i]]
            if y1 < y0:
                x0, y0, x1, y1 = x1, y1, x0, y0
            if y0 < y1:
                _cross(x0, y0, x1, y1, top[k], crossing, count)
            if y1 % SUB == 0:  # its lower end, which counts as no crossing, or a flat edge
                left, right = (min(x0, x1), max(x0, x1)) if y0 == y1 else (x1, x1)
                while not add_run(parts, used, begin[k] + y1 // SUB - top[k], _ceil(left, SUB), right // SUB):
                    parts = more_parts(parts)
        for row in range(begin[k + 1] - begin[k]):
            for i in range(0, count[row], 2):
                first, last = (crossing[row, i] + 1) >> 1, crossing[row, i + 1] >> 1
                while not add_run(parts, used, begin[k] + row, first, last):
                    parts = more_parts(parts)
    return shape, y, parts


def polygons(points: Ints, starts: Ints) -> RowRuns:
    """See `grid.rasterize.polygons`; runs of a row may overlap."""
    convex = convex_polygons(points) if len(starts) == 1 else None
    return RowRuns(*_even_odd(points, starts)) if convex is None else convex


@helper()
def _axis_rows(x0, y0, dx, dy, top, first, last):
    """Runs of the supercover of a segment in rows from `top` on; empty in rows that it does not meet."""
    first[:], last[:] = WIDEST, -WIDEST
    low_y, high_y = y0 + min(dy, 0), y0 + max(dy, 0)
    upper, lower = _ceil(low_y - HALF, SUB), (high_y + HALF) // SUB
    first, last = first[upper - top : lower - top + 1], last[upper - top : lower - top + 1]
    if dy == 0:
        first[:], last[:] = _ceil(min(x0, x0 + dx) - HALF, SUB), (max(x0, x0 + dx) + HALF) // SUB
        return
    per, slope = abs(dy), dx if dy > 0 else -dx
    base, cell = x0 * per - y0 * slope, SUB * per
    half, begin = cell >> 1, base + (SUB * upper - HALF) * slope
    ahead = SUB * slope
    first[:], last[:] = -WIDEST, WIDEST
    at_least(min(begin, begin + ahead) - half, ahead, cell, first)
    at_most(max(begin, begin + ahead) + half, ahead, cell, last)
    enter, leave = base + low_y * slope, base + high_y * slope  # its ends lie within the first and the last row
    if slope >= 0:
        first[0], last[-1] = _ceil(enter - half, cell), (leave + half) // cell
    else:
        last[0], first[-1] = (enter + half) // cell, _ceil(leave - half, cell)


@helper()
def _side(value, step, slope, first, last):
    """Keep of runs the centres with slope * x >= value + k * step in row k, x in 1/256 px."""
    if slope > 0:
        at_least(value, step, SUB * slope, first)
    elif slope < 0:
        at_most(-value, -step, -SUB * slope, last)
    else:
        for k in range(len(first)):
            if value + k * step > 0:
                first[k], last[k] = WIDEST, -WIDEST


@helper()
def _between(x, y, dx, dy, reach, side, top, first, last):
    """Keep of runs in rows from `top` on the centres beside a segment, see `rasterize._between`.

    Only rows near an end can have centres beyond it.
    """
    level = SUB * top - y
    across, along, length2 = x * dy + dx * level, x * dx - dy * level, dx * dx + dy * dy
    _side(across - side, SUB * dx, dy, first, last)
    _side(-across - side, -SUB * dx, -dy, first, last)
    for sign, at in ((1, y), (-1, y + dy)):
        begin, end = max(_ceil(at - reach, SUB) - top, 0), (at + reach) // SUB + 1 - top
        value = (along if sign > 0 else -along - length2) - sign * SUB * dy * begin
        _side(value, -sign * SUB * dy, sign * dx, first[begin:end], last[begin:end])
    for k in range(len(first)):
        if first[k] > last[k] or length2 == 0:
            first[k], last[k] = WIDEST, -WIDEST


@helper()
def _add_disc(x, y, radius, top, first, last):
    """Extend runs in rows from `top` on to the centres at most `radius` from a point."""
    for row in range(_ceil(y - radius, SUB), (y + radius) // SUB + 1):
        level = SUB * row - y
        half = root_of(radius * radius - level * level)
        begin, end = -((half - x) >> 8), (x + half) >> 8
        if begin <= end:
            first[row - top], last[row - top] = min(first[row - top], begin), max(last[row - top], end)


@compiled(types.Tuple((OUT, OUT, PARTS))(WHOLE, WHOLE, PELLETS, WHOLE, INTS))
def _beams(x, y, ends, radius, sides):
    """Beams as `rasterize.beams` makes them; no row if sides are missing and are beyond what their root may be of."""
    count, reach = len(ends), max(radius, HALF)
    if not len(sides):
        sides = np.empty(count, np.int64)
        for k in range(count):
            length2 = (ends[k, 0] - x) ** 2 + (ends[k, 1] - y) ** 2
            if np.float64(radius) ** 2 * np.float64(length2) > ROOM:
                return sides[:0], sides[:0], np.empty((0, 2, 0), np.int64)
            sides[k] = root_of(radius * radius * length2)
    top, low = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        top[k], low[k] = _ceil(min(y, ends[k, 1]) - reach, SUB), (max(y, ends[k, 1]) + reach) // SUB
    shape, row, begin = layout(top, low)
    parts = np.empty((1 if radius >= DIAGONAL else 2, 2, len(row)), np.int64)
    for k in range(count):
        dx, dy = ends[k, 0] - x, ends[k, 1] - y
        first, last = parts[0, 0, begin[k] : begin[k + 1]], parts[0, 1, begin[k] : begin[k + 1]]
        first[:], last[:] = -WIDEST, WIDEST
        _between(x, y, dx, dy, reach, sides[k], top[k], first, last)
        _add_disc(x, y, radius, top[k], first, last)
        _add_disc(ends[k, 0], ends[k, 1], radius, top[k], first, last)
        if len(parts) > 1:
            _axis_rows(x, y, dx, dy, top[k], parts[1, 0, begin[k] : begin[k + 1]], parts[1, 1, begin[k] : begin[k + 1]])
    return shape, row, parts


def beams(a: Ints, b: Ints, radius: int) -> RowRuns:
    """See `grid.rasterize.beams`."""
    shape, y, parts = _beams(*a.tolist(), b, radius, NO_SIDES)
    if not len(parts):
        shape, y, parts = _beams(*a.tolist(), b, radius, sides_of(radius, b - a))
    return RowRuns(shape, y, parts)


@helper()
def _half_plane(slope, limit, top, first, last):
    """Keep of runs in rows from `top` on the centres with slope * x <= limit * y; both are below 2**62.

    Row 0 has quotient 0; from there the first row is reached by steps, as a product could leave int64.
    """
    if slope == 0:
        for k in range(len(first)):
            if (limit < 0 and top + k > 0) or (limit > 0 and top + k < 0):
                first[k], last[k] = WIDEST, -WIDEST
        return
    per = abs(slope)
    more, over, quotient, rest = min(max(limit // per, -WIDEST), WIDEST), limit % per, 0, 0
    for _ in range(top):
        rest += over
        carried = rest >= per
        quotient += more + carried
        rest -= per if carried else 0
    for _ in range(-top):
        rest -= over
        borrowed = rest < 0
        quotient -= more + borrowed
        rest += per if borrowed else 0
    if slope > 0:
        _lower(quotient, rest, more, over, per, last)
    else:
        _raise(quotient, rest, more, over, per, first)


@compiled(types.Tuple((OUT, OUT, PARTS))(WHOLE, PELLETS, WHOLE, WHOLE))
def _cones(reach, direction, c_half, s_half):
    count = len(direction)
    top, low = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        c, s = direction[k]
        one, other = s * c_half - c * s_half, s * c_half + c * s_half
        least = -ONE if -s >= c_half else min(min(one, other) >> TRIG_BITS, 0)
        most = ONE if s >= c_half else max(max(one, other) >> TRIG_BITS, 0)
        top[k] = ((reach * least >> TRIG_BITS) - 1 - HALF) // SUB
        low[k] = _ceil((reach * most >> TRIG_BITS) + 2 + HALF, SUB)
    shape, y, begin = layout(top, low)
    wide = s_half != 0 or c_half < 0
    half = np.empty(reach // SUB + 1, np.int64)
    for row in range(len(half) if wide else 0):
        half[row] = root_of(reach * reach - (SUB * row) ** 2) >> 8
    parts = np.empty(((3 if c_half < 0 else 2) if wide else 1, 2, len(y)), np.int64)
    for k in range(count):
        c, s = direction[k]
        axis = parts[0, 0, begin[k] : begin[k + 1]], parts[0, 1, begin[k] : begin[k + 1]]
        _axis_rows(0, 0, _over_one(reach * c), _over_one(reach * s), top[k], *axis)
        for part in range(1, len(parts)):
            first, last = parts[part, 0, begin[k] : begin[k + 1]], parts[part, 1, begin[k] : begin[k + 1]]
            for i in range(len(first)):
                row = abs(top[k] + i)
                first[i], last[i] = (-half[row], half[row]) if row < len(half) else (WIDEST, -WIDEST)
            for sign in (1, -1):
                if len(parts) == 2 or (sign == 1) == (part == 1):
                    slope, limit = -sign * s * c_half - c * s_half, s * s_half - sign * c * c_half
                    _half_plane(slope, limit, top[k], first, last)
            for i in range(len(first)):
                if first[i] > last[i]:
                    first[i], last[i] = WIDEST, -WIDEST
    return shape, y, parts


def cones(reach: int, direction: Ints, c_half: int, s_half: int) -> RowRuns:
    """See `grid.rasterize.cones`."""
    return RowRuns(*_cones(reach, direction, c_half, s_half))


@helper()
def _rows_of(sides, pivot_y, c, s):
    """First and last row of pixels that a turned rectangle may hold; see `turned_runs`."""
    left, right, top, low = sides
    first = (min(left * s, right * s) + top * c >> TRIG_BITS) + pivot_y - 1
    return first >> 8, (max(left * s, right * s) + low * c >> TRIG_BITS) + pivot_y + 1 >> 8


@helper()
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
        turns, top[k], low[k] = quarter[k], WIDEST, -WIDEST
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
                while not add_run(parts, used, at + i, first[i], last[i]):
                    parts = more_parts(parts)
    return shape, y, parts


def turned_runs(edges: Edges, quarter: Ints, c: Ints, s: Ints) -> RowRuns:
    """See `grid.rasterize.turned_runs`."""
    shape, y, parts = _turned_runs(edges.begin, np.ascontiguousarray(edges.sides.T), edges.pivots, quarter, c, s)
    return RowRuns(shape, y, parts)


@compiled()
def place(
    ids: Ints, xy: Floats, count: int, row_of: npt.NDArray[np.int32], edge: Ints, position_256: Ints, box: Ints,
    rows: Ints, before: Ints, after: Ints,
) -> bool:  # fmt: skip
    """Place items at new positions; return whether that was done; see `grid.fixed_point.place`."""
    last = -1
    for i in range(len(ids)):
        item = ids[i]
        if item <= last or item >= count:
            return False
        if not (abs(xy[i, 0]) <= POSITION_MAX and abs(xy[i, 1]) <= POSITION_MAX and row_of[item] >= 0):
            return False
        last, rows[i] = item, row_of[item]
    for i in range(len(ids)):
        row = rows[i]
        for axis in range(2):
            now = np.int64(np.rint(xy[i, axis] * SUB))
            position_256[row, axis] = now
            for side in (axis, axis + 2):
                before[i, side] = box[row, side]
                after[i, side] = (now + edge[row, side]) >> 8
                box[row, side] = after[i, side]
    return True
