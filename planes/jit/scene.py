"""Compiled kernels of fixed point, turned masks and label planes, and of the draws of pellets."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from ..bits.label_plane import CELL_BITS, Front
from ..common.checks import Bools, Floats, Ints, Labels
from ..common.limits import GOLDEN, HALF, POSITION_MAX, SUB
from ..grid.fixed_point import DOUBT, UNIT
from ..grid.spans import Box
from .bit_rows import BOXES, FLAGS, INTS, OUT, ROWS_OUT
from .cache import compiled

TERMS = 8
"""Terms of each series; up to 45 degrees the rest is below 2**-53."""

SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(TERMS))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(TERMS + 1))

RADIAN = math.pi / 180
FLOATS = types.Array(types.float64, 1, "C", readonly=True)


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
        c, s = (far if steep else near) * UNIT, (near if steep else far) * UNIT
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


@compiled(types.void(INTS, types.int64[::1]))
def _pixels(at_256, whole):
    for i in range(len(at_256)):
        whole[i] = (at_256[i] + HALF) >> 8


def pixels(at_256: Ints) -> Ints:
    """See `grid.fixed_point.pixels`."""
    whole = np.empty(at_256.shape, np.int64)
    _pixels(at_256.ravel(), whole.ravel())
    return whole


PELLETS = types.Array(types.int64, 2, "A", readonly=True)
PLANES = types.Array(types.boolean, 3, "A", readonly=True)
STEPS = types.Array(types.int64, 3, "A", readonly=True)
WHOLE = types.int64


@compiled(WHOLE(PLANES, *[WHOLE] * 3, types.boolean, types.boolean, WHOLE))
def _on_border(planes, k, row, column, up, left, at):
    """Place among the squares that meet at a border: the first that is set, else the last in the frame, else `at`."""
    _, rows, columns = planes.shape
    for j in (row, row - 1) if up else (row, row):
        for i in (column, column - 1) if left else (column, column):
            if 0 < j < rows - 1 and 0 < i < columns - 1:
                at = (k * rows + j) * columns + i
                if planes[k, j, i]:
                    return at
    return at


@compiled(types.void(PLANES, INTS, PELLETS, STEPS, WHOLE, WHOLE, types.int64[:, :, ::1]))
def _resample(planes, which, first, step, unit_x, unit_y, source):
    count, height, width = source.shape
    rows, columns = np.uint64(planes.shape[1]), np.uint64(planes.shape[2])
    for n in range(count):
        k, (across_x, down_x), (across_y, down_y) = which[n], step[n, 0], step[n, 1]
        along_x, over_x, along_y, over_y = across_x // unit_x, across_x % unit_x, across_y // unit_y, across_y % unit_y
        outside = np.int64(k * planes.shape[1] * planes.shape[2])
        for y in range(height):
            begin_x, begin_y = first[n, 0] + unit_x + y * down_x, first[n, 1] + unit_y + y * down_y
            column, x_rest, row, y_rest = begin_x // unit_x, begin_x % unit_x, begin_y // unit_y, begin_y % unit_y
            for x in range(width):
                j, i = np.uint64(row), np.uint64(column)  # negative numbers become very large
                at = outside + np.int64(j * columns + i) if j < rows and i < columns else outside
                if x_rest == 0 or y_rest == 0:
                    at = _on_border(planes, k, row, column, y_rest == 0, x_rest == 0, outside)
                source[n, y, x] = at
                column, x_rest = column + along_x, x_rest + over_x
                if x_rest >= unit_x:
                    column, x_rest = column + 1, x_rest - unit_x
                row, y_rest = row + along_y, y_rest + over_y
                if y_rest >= unit_y:
                    row, y_rest = row + 1, y_rest - unit_y


def resample(
    planes: Bools, which: Ints, first: Ints, step: Ints, unit: tuple[int, int], size_wh: tuple[int, int]
) -> Ints:
    """See `scene.variants.resample`; it divides once a row, not once a pixel."""
    source = np.empty((len(which), *size_wh[::-1]), np.int64)
    _resample(planes, which, first, step, *unit, source)
    return source


@compiled()
def place(
    ids: Ints, xy: Floats, count: int, alive: Ints, edge: Ints, position_256: Ints, box: Ints, before: Ints, after: Ints
) -> bool:
    """Place items at new positions; return whether that was done; see `grid.fixed_point.place`."""
    last = -1
    for i in range(len(ids)):
        item = ids[i]
        if item <= last or item >= count:
            return False
        if not (abs(xy[i, 0]) <= POSITION_MAX and abs(xy[i, 1]) <= POSITION_MAX and alive[item] != 0):
            return False
        last = item
    for i in range(len(ids)):
        item = ids[i]
        for axis in range(2):
            now = np.int64(np.rint(xy[i, axis] * SUB))
            position_256[item, axis] = now
            for side in (axis, axis + 2):
                before[i, side] = box[item, side]
                after[i, side] = (now + edge[item, side]) >> 8
                box[item, side] = after[i, side]
    return True


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


ANY_INTS = types.Array(types.int64, 1, "A", readonly=True)
SEEDS = types.Array(types.uint64, 1, "A", readonly=True)

AT_ONCE = 256
"""Least number of pellets that are drawn at a time; those of a round are drawn together."""


@njit(inline="always")
def _mixed(z):
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled(types.void(types.int64, types.int64, types.uint64, SEEDS, ANY_INTS, ANY_INTS, PELLETS, types.int64[:, ::1]))
def _disc_offsets(reach, radius2, bits, seed, shot, round_, pellet, offsets):
    rows, pellets = pellet.shape
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
                state[count + k] = _mixed((turn ^ np.uint64(pellet[row, k])) + GOLDEN)
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
                offsets[place[i], 0], offsets[place[i], 1] = x, y
                state[rest], place[rest] = state[i], place[i]
                rest += SUB * SUB * (x * x + y * y) > radius2
            count = rest


def disc_offsets(radius_256: int, seed: Any, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """See `kinds.placements.disc_offsets`."""
    seed, reach = np.asarray(seed, np.uint64), radius_256 // SUB
    shape = np.broadcast_shapes(*(word.shape for word in (seed, shot, round_, pellet)))
    wide = shape if len(shape) > 1 else (*shape, 1)
    *turns, pellets = (np.broadcast_to(word, shape).reshape(wide) for word in (seed, shot, round_, pellet))
    offsets = np.empty((*pellets.shape, 2), np.int64)
    bits = np.uint64((1 << (2 * reach).bit_length()) - 1)
    _disc_offsets(reach, radius_256**2, bits, *(word[:, 0] for word in turns), pellets, offsets.reshape(-1, 2))
    return offsets.reshape(*shape, 2)
