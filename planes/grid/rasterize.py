"""Exact rasterization of shapes, segments and turned masks to pixels.

A filled shape has the pixels whose centres lie inside it or on its edge. A segment has its closed supercover: the
pixels whose closed squares it touches, so nothing slips through a corner, and either direction gives the same pixels. A
shape with an axis (beam, cone) also has the closed supercover of its axis: even a thin one has no gaps, and a wider one
covers a narrower one. All arguments are integers in 1/256 px, and the origin is the centre of pixel (0, 0).

The times at which a ray enters and leaves a cell are whole numbers over a scale of the ray's own, so they have a total
order. Coordinates of rays are relative to a whole pixel near their start.

    scale of a thin ray     max(1, |dx|) * max(1, |dy|)        of a thick ray     dx^2 + dy^2
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, Ints
from ..common.limits import HALF, SUB, TRIG_BITS
from .fixed_point import ONE, far_roots, isqrt, pixel, scaled
from .spans import WIDEST, RowRuns, Spans, each_pixel, in_rows, ragged, rectangles

ORIGIN = np.zeros(2, np.int64)
QUOTIENT_ERROR = 2.0**-50  # most relative error of a quotient of two numbers, rounded to float64, times a row number


def disc(radius: int) -> Spans:
    """Centres at most `radius` from the origin."""
    y = _rows(-radius, radius)
    half = isqrt(radius * radius - (SUB * y) ** 2) // SUB
    return Spans(y, -half, half)


def ring(inner: int, outer: int) -> Spans:
    """Centres p with inner <= |p| <= outer."""
    y = _rows(-outer, outer)
    edge = isqrt(outer * outer - (SUB * y) ** 2)
    rest = inner * inner - (SUB * y) ** 2
    # The hole is open: the first centre outside it has x * x >= rest, so x >= the root rounded up.
    root = isqrt(np.maximum(rest, 0))
    hole = np.where(rest > 0, root + (root * root < rest), 0)
    first, last = -(-hole // SUB), edge // SUB
    return Spans.from_runs(np.tile(y, 2), np.append(-last, first), np.append(-first, last))


def ellipse(radius_x: int, radius_y: int, c: int, s: int) -> Spans:
    """Centres inside an ellipse whose semi-axes are turned by the direction (c, s); a flat one is a segment.

    With u = x c + y s and v = y c - x s: (ry u)^2 + (rx v)^2 <= rx^2 ry^2 (c^2 + s^2). In one row that is
    |A x + B| <= sqrt(D) with numbers of up to 200 bits, hence Python integers.
    """
    if radius_x == 0 or radius_y == 0:
        return _flat_ellipse(radius_x, radius_y, c, s)
    xx, yy = radius_x**2, radius_y**2
    a, b = yy * c * c + xx * s * s, (yy - xx) * c * s
    last = xx * yy * (c * c + s * s)
    y = _rows(-max(radius_x, radius_y), max(radius_x, radius_y))
    rows = []
    for row in y.tolist():
        v = SUB * row
        squared = (b * v) ** 2 - a * ((yy * s * s + xx * c * c) * v * v - last)
        if squared >= 0:
            root = math.isqrt(squared)
            rows.append((row, -((b * v + root) // (SUB * a)), (root - b * v) // (SUB * a)))
    runs = np.array(rows, np.int64).reshape(-1, 3).T
    return Spans.from_runs(*runs)


def polygon(rings: Sequence[Ints]) -> Spans:
    """Centres inside rings of points (N, 2) by the even-odd rule over all rings, and centres on any edge."""
    starts = list(accumulate([len(ring) for ring in rings[:-1]], initial=0))
    _, y, first, last = _even_odd(np.concatenate(rings)[None], np.array(starts))
    return Spans.from_runs(y, first, last)


def polygons(points: Ints, starts: Ints) -> RowRuns:
    """Polygons of points (n, m, 2), each as `polygon` fills it; their rings begin at points `starts` (k,)."""
    convex = convex_polygons(points) if len(starts) == 1 else None
    return in_rows(*_even_odd(points, starts)) if convex is None else convex


def _even_odd(points: Ints, starts: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Shape, row, and first and last pixel of runs inside polygons and on their edges, in no order.

    A row is filled from each of its crossings at an odd place to the next one, both included. To sort them needs no
    rational: twice the centre at or left of a crossing, plus 1 if it lies beyond. Edges are half-open in y, so that a
    vertex between two of them counts once; what lies on a lower end, or on a flat edge, is added.
    """
    corners = points.shape[1]
    following = np.arange(1, corners + 1)
    following[np.append(starts[1:], corners) - 1] = starts
    start, end = (ends.reshape(-1, 2) for ends in (points, points[:, following]))
    down = (start[:, 1] > end[:, 1])[:, None]
    (x0, y0), (x1, y1) = np.where(down, end, start).T, np.where(down, start, end).T
    at, flat = np.flatnonzero(y1 % SUB == 0), y0 == y1
    left, right = (np.where(flat, side(x0, x1), x1)[at] for side in (np.minimum, np.maximum))
    edge, row = _ragged_rows(-(-y0 // SUB), -(-y1 // SUB) - 1)
    dx, dy = (x1 - x0)[edge], (y1 - y0)[edge]
    whole, rest = np.divmod(x0[edge] * dy + (SUB * row - y0[edge]) * dx, SUB * dy)
    inside = _between_every_two(edge // corners, row, 2 * whole + (rest > 0))
    touched = at // corners, y1[at] // SUB, -(-left // SUB), right // SUB
    first, second, third, fourth = (np.concatenate(pair) for pair in zip(inside, touched, strict=True))
    return first, second, third, fourth


def _between_every_two(shape: Ints, y: Ints, x: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Runs between every two crossings (n,) of a row; they are sorted as one number each."""
    (top, low), (left, right) = ((int(key.min(initial=0)), int(key.max(initial=0)) + 1) for key in (y, x))
    number = np.sort((shape * (low - top) + y - top) * (right - left) + x - left)
    row = number[::2] // (right - left)
    first, last = (end - row * (right - left) + left for end in (number[::2], number[1::2]))
    shape = row // (low - top)
    return shape, row - shape * (low - top) + top, first + 1 >> 1, last >> 1


def convex_polygons(points: Ints) -> RowRuns | None:
    """Centres inside polygons of points (n, m, 2), as `polygon` finds them; None if any is not convex.

    A row of a convex polygon begins at an edge that goes up and ends at one that goes down, or the other way round.
    """
    count, corners, _ = points.shape
    after = np.arange(1 - corners, 1)  # the corner after each; index 0 is the last one's
    step = points.take(after, axis=1) - points
    following = step.take(after, axis=1)
    turn = step[..., 0] * following[..., 1] - step[..., 1] * following[..., 0]
    clockwise, other = (turn >= 0).all(axis=1), (turn <= 0).all(axis=1)
    up = step[..., 1] < 0
    good = (clockwise ^ other) & up.any(axis=1) & ((turn != 0) | ((step * following).sum(axis=2) > 0)).all(axis=1)
    if not (good & ((up.take(after, axis=1) != up).sum(axis=1) <= 2)).all():  # it goes around only once
        return None
    top = -(-points[..., 1].min(axis=1) // SUB)
    shape, y = _ragged_rows(top, points[..., 1].max(axis=1) // SUB)
    ends = np.empty((2, len(y)), np.int64)  # each row meets edges on both of its sides
    at = step[..., 1].reshape(-1).nonzero()[0]
    of, (x0, y0), (dx, dy) = at // corners, points.reshape(-1, 2)[at].T, step.reshape(-1, 2)[at].T
    edge, row = _ragged_rows(-(-np.minimum(y0, y0 + dy) // SUB), np.maximum(y0, y0 + dy) // SUB)
    winding, per = np.where(clockwise, 1, -1)[of], SUB * np.abs(dy)
    across = (winding * (x0 * dy - y0 * dx)).take(edge) + (winding * SUB * dx).take(edge) * row
    side = winding * np.sign(dy)  # -1 if the edge begins rows, whose quotients are rounded up: -floor(-q)
    place = (shape.searchsorted(np.arange(count)) - top)[of] + np.where(side > 0, len(y), 0)
    ends.reshape(-1)[place.take(edge) + row] = across // per.take(edge) * side.take(edge)
    return RowRuns(shape, y, ends[None])


def beams(a: Ints, b: Ints, radius: int) -> RowRuns:
    """Centres at most `radius` from segments from one point (2,) to several (n, 2), and the segments' supercovers.

    The rows of a beam are those of a disc at each end and of what is between. These three are parts of a convex set, so
    the first and the last of their pixels bound all of a row. The supercover adds nothing to a beam that is as wide as
    a pixel's diagonal.
    """
    step = b - a
    low, high = np.minimum(a[1], b[:, 1]), np.maximum(a[1], b[:, 1])
    reach = max(radius, HALF)
    shape, y = _ragged_rows(-(-(low - reach) // SUB), (high + reach) // SUB)
    first, last = _between(a, step, radius, shape, y)
    for center in (np.broadcast_to(a, b.shape), b):
        _add_discs(center, radius, shape, y, first, last)
    axis = [] if radius >= DIAGONAL else [_axis_rows(a, step, shape, y)]
    return RowRuns(shape, y, [(first, last), *axis])


def _between(a: Ints, step: Ints, radius: int, shape: Ints, y: Ints) -> tuple[Ints, Ints]:
    """Runs of the centres p beside segments: 0 <= (p - a) . d <= |d|^2, and |(p - a) x d| <= radius |d|."""
    length2, side = (step * step).sum(axis=1), sides_of(radius, step)
    along = step.T.take(shape, axis=1)
    low = along[::-1] * (SUB * y - a[1]) * [[-1], [1]]
    low += a[0] * along - np.stack([0 * side, side]).take(shape, axis=1)
    begin, end = runs_between(low, low + np.stack([length2, 2 * side]).take(shape, axis=1), along)
    first, last = np.maximum(*begin), np.minimum(*end)
    return _or_nothing(first, last, (first > last) | (length2 == 0).take(shape))


def _add_discs(center: Ints, radius: int, shape: Ints, y: Ints, first: Ints, last: Ints) -> None:
    """Extend runs in rows of shapes to the centres at most `radius` from a point (n, 2) of each."""
    level = SUB * y - center[:, 1].take(shape)
    near = (np.abs(level) <= radius).nonzero()[0]
    x, level = center[:, 0].take(shape.take(near)), level.take(near)
    half = isqrt(radius * radius - level * level)
    begin, end = -((half - x) // SUB), (x + half) // SUB
    filled = begin <= end
    near = near[filled]
    first[near], last[near] = np.minimum(first[near], begin[filled]), np.maximum(last[near], end[filled])


def sides_of(radius: int, step: Ints) -> Ints:
    """The radius times the lengths of vectors (n, 2), rounded down."""
    length2 = (step * step).sum(axis=1)
    if radius * radius * int(length2.max(initial=0)) < ROOM:
        return isqrt(radius * radius * length2)
    return np.array([math.isqrt(radius * radius * n) for n in length2.tolist()], np.int64)


def cones(reach: int, direction: Ints, c_half: int, s_half: int) -> RowRuns:
    """Centres within `reach` and within the half angle of directions (n, 2), and the supercovers of the axes.

    With u = x c + y s and v = y c - x s: |v| c_half <= u s_half. Up to 90 degrees correctly rounded cosines fall and
    sines rise with the half angle, so a wider cone covers a narrower one.
    """
    s, (cc, sc), (cs, ss) = direction[:, 1], (direction * c_half).T, (direction * s_half).T
    one, other = sc - cs, sc + cs  # sines of the two sides
    low, high = (end(end(one, other) >> TRIG_BITS, 0) for end in (np.minimum, np.maximum))
    low, high = np.where(-s >= c_half, -ONE, low), np.where(s >= c_half, ONE, high)
    low, high = (reach * low >> TRIG_BITS) - 1, (reach * high >> TRIG_BITS) + 2  # rounded outward
    shape, y = _ragged_rows((low - HALF) // SUB, -(-(high + HALF) // SUB))
    parts = [_axis_rows(ORIGIN, scaled(direction, reach), shape, y)]
    if s_half or c_half < 0:
        # sign * v * c_half <= u * s_half  is  slope * x <= limit * y  with these, of both signs
        begin, end = _half_plane(np.stack([-other, one]), np.stack([ss - cc, ss + cc]), shape, y)
        half = _half_widths(reach, y)
        if c_half >= 0:
            begin, end = np.maximum.reduce(begin, keepdims=True), np.minimum.reduce(end, keepdims=True)
        begin, end = np.maximum(begin, -half), np.minimum(end, half)
        parts += zip(*_or_nothing(begin, end, begin > end), strict=True)
    return RowRuns(shape, y, parts)


def _half_widths(radius: int, y: Ints) -> Ints:
    """Last pixel of the disc about the origin in each of rows y; -1 in those that it does not meet.

    Each row is computed once.
    """
    top = int(y.min(initial=0))
    left = radius * radius - (SUB * np.arange(top, int(y.max(initial=0)) + 1)) ** 2
    return np.where(left < 0, -1, isqrt(np.maximum(left, 0)) // SUB).take(y - top)


def _axis_rows(a: Ints, step: Ints, shape: Ints, y: Ints) -> tuple[Ints, Ints]:
    """Runs of the supercovers of segments from a point (2,), in rows of shapes; empty in rows that they do not meet."""
    (dx, dy), (x0, y0) = np.ascontiguousarray(step.T), a.tolist()
    first, last = _thin_runs(x0, y0, dx, dy, shape, y)
    return _or_nothing(first, last, first > last)


def _or_nothing(first: Ints, last: Ints, none: Bools) -> tuple[Ints, Ints]:
    """Runs, of which some are empty; an empty one changes nothing where runs are joined."""
    return np.where(none, WIDEST, first), np.where(none, -WIDEST, last)


def _rows(low: int, high: int) -> Ints:
    """Rows whose centres lie in [low, high]."""
    return np.arange(-(-low // SUB), high // SUB + 1, dtype=np.int64)


def _ragged_rows(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """Rows first .. last of shapes (n,), as (shape, y)."""
    shape, place = ragged(np.maximum(last - first + 1, 0))
    return shape, first[shape] + place


def runs_between(low: Ints, high: Ints, slope: Ints) -> tuple[Ints, Ints]:
    """Runs of the centres with low <= slope * x <= high, x in 1/256 px."""
    low, high = np.where(slope < 0, -high, low), np.where(slope < 0, -low, high)
    per, level = SUB * np.maximum(np.abs(slope), 1), slope == 0
    first, last = -(-low // per), high // per
    if level.any():
        none = level & ((low > 0) | (high < 0))
        first, last = _or_nothing(np.where(level, -WIDEST, first), np.where(level, WIDEST, last), none)
    return first, last


def _half_plane(slope: Ints, limit: Ints, shape: Ints, y: Ints) -> tuple[Ints, Ints]:
    """Runs of the centres with slope * x <= limit * y; both (..., n) are below 2**62.

    Their quotient is computed in float64. Where that is so near to a whole number that its error could matter, Python's
    integers decide.
    """
    level, upper = slope == 0, (slope > 0).take(shape, axis=-1)
    per = np.where(level, 1, slope)
    bound = (limit / per).take(shape, axis=-1) * y
    whole = np.where(upper, np.floor(bound), np.ceil(bound))
    whole = np.minimum(np.maximum(whole, -WIDEST), WIDEST).astype(np.int64)
    doubt = np.abs(bound - np.rint(bound)) < np.abs(bound) * QUOTIENT_ERROR
    for *side, i in zip(*(at.tolist() for at in doubt.nonzero()), strict=True):
        of = *side, shape[i]
        a, b = int(per[of]), int(limit[of]) * int(y[i])
        whole[*side, i] = max(-WIDEST, min(b // a if a > 0 else -(b // -a), WIDEST))
    first, last = np.where(upper, -WIDEST, whole), np.where(upper, whole, WIDEST)
    if level.any():
        level = level.take(shape, axis=-1)
        none = level & (limit.take(shape, axis=-1) * np.sign(y) < 0)
        first, last = _or_nothing(np.where(level, -WIDEST, first), np.where(level, WIDEST, last), none)
    return first, last


def _flat_ellipse(radius_x: int, radius_y: int, c: int, s: int) -> Spans:
    """Centres on an ellipse without width, which is a segment."""
    longest = max(radius_x, radius_y)
    if radius_y > radius_x:
        c, s = -s, c
    steep = abs(s) > abs(c)
    along, across = (s, c) if steep else (c, s)
    u = _rows(-longest, longest)
    v = u * across // along
    on = (v * along == u * across) & ((SUB * u) ** 2 + (SUB * v) ** 2 <= longest * longest)
    x, y = (v[on], u[on]) if steep else (u[on], v[on])
    return Spans.from_runs(y, x, x)


DIAGONAL = 182  # half the diagonal of a pixel in 1/256 px, rounded up: no point of a pixel lies farther from its centre
COMMON = 2**60  # scale of the times of rays at moving items, where each item would otherwise have a scale of its own
ROOM = 2**62  # products below it leave room for a sum in int64; larger ones are computed in Python integers
FAR = 2**90  # squares below it differ from those of their float roots by less than 2**46: one Newton step corrects it


@dataclass(frozen=True, eq=False)
class Lines:
    """Segments of one width, as columns."""

    start: Ints  # (n, 2) 1/256 px
    step: Ints  # (n, 2) vectors from there to the ends, 1/256 px
    radius: int  # half of the width, 1/256 px; 0 for thin rays
    common: int = 0  # scale of the times of all segments; 0 if each has its own

    def __len__(self) -> int:
        return len(self.start)

    def take(self, rows: Ints | Bools | slice) -> Lines:
        """Select segments by rows or by a mask, with their sides if these are known."""
        taken = Lines(self.start[rows], self.step[rows], self.radius, self.common)
        vars(taken).update({name: vars(self)[name][rows] for name in ("sides", "wide_sides") if name in vars(self)})
        return taken

    @cached_property
    def steep(self) -> Bools:
        """Whether each segment goes farther along y than along x."""
        return np.asarray(np.abs(self.step[:, 1]) > np.abs(self.step[:, 0]))

    @cached_property
    def flat(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Starts and steps, (n,) each, along the longer axis and across it."""
        (x, y), (dx, dy), steep = self.start.T, self.step.T, self.steep
        return np.where(steep, y, x), np.where(steep, x, y), np.where(steep, dy, dx), np.where(steep, dx, dy)

    @cached_property
    def box_xyxy(self) -> Ints:
        """Inclusive boxes (n, 4) of pixels around all cells of each segment."""
        end, reach = self.start + self.step, max(self.radius, HALF)
        low, high = np.minimum(self.start, end) - reach, np.maximum(self.start, end) + reach
        return np.concatenate([-(-low // SUB), high // SUB], axis=1)

    @cached_property
    def length2(self) -> Ints:
        """Squared lengths, (1/256 px)^2."""
        dx, dy = self.step.T
        return np.asarray(dx * dx + dy * dy)

    @cached_property
    def length(self) -> Floats:
        """Lengths, px."""
        return np.asarray(np.sqrt(self.length2) / SUB)

    @cached_property
    def scale(self) -> Ints:
        """Scale of the times (n,): the time at the end of each segment."""
        if self.common:
            return np.full(len(self), self.common)
        if self.radius:
            return np.maximum(self.length2, 1)
        dx, dy = np.maximum(np.abs(self.step), 1).T
        return np.asarray(dx * dy)

    @cached_property
    def sides(self) -> Ints:
        """Largest distance of covered centres from the axis, times the length, rounded down."""
        return sides_of(self.radius, self.step)

    @cached_property
    def wide_sides(self) -> Ints:
        """The same bound for all cells, including those that only the axis touches."""
        return self.sides if self.radius >= DIAGONAL else sides_of(DIAGONAL, self.step)

    def candidates(self, boxes_xyxy: Ints) -> tuple[Ints, Ints, Ints]:
        """Cells of each segment within its own inclusive box (n, 4), as (segment, x, y), sorted by segment.

        For thick segments these include some cells that are not touched; `times` gives them an empty interval.
        """
        line, row, first, last = self.runs(boxes_xyxy)
        run, u = each_pixel(first, last)
        line, v = line[run], row[run]
        swapped = self.steep[line]
        return line, np.where(swapped, v, u), np.where(swapped, u, v)

    def runs(self, boxes_xyxy: Ints) -> tuple[Ints, Ints, Ints, Ints]:
        """The cells of `candidates` as runs along the longer axis of each segment: (segment, row, first, last)."""
        u, v, along, aside = self.flat
        left, top, right, low = np.where(self.steep, boxes_xyxy.T[[1, 0, 3, 2]], boxes_xyxy.T)
        reach = max(self.radius, DIAGONAL) if self.radius else HALF
        least, most = np.minimum(u, u + along) - reach, np.maximum(u, u + along) + reach
        left, right = np.maximum(left, -(-least // SUB)), np.minimum(right, most // SUB)
        # Floats have room for the rows between two columns; the runs are exact.
        slope = aside / np.where(along == 0, 1, along)
        sides = (np.minimum(np.maximum(side, least), most) for side in (SUB * left - HALF, SUB * right + HALF))
        ends = [v + (side - u) * slope for side in sides]
        half = np.maximum(reach, self.wide_sides / np.maximum(np.abs(along), 1)) if self.radius else reach
        first = np.maximum(np.floor((np.minimum(*ends) - half - 1) / SUB).astype(np.int64), top)
        last = np.minimum(np.ceil((np.maximum(*ends) + half + 1) / SUB).astype(np.int64), low)
        line, row = _ragged_rows(first, np.where(left <= right, last, first - 1))
        if self.radius:  # cells at most `wide_sides` from the infinite axis
            across, side = (u * aside - v * along)[line] + (SUB * along)[line] * row, self.wide_sides[line]
            first, last = runs_between(across - side, across + side, aside[line])
        else:
            first, last = _thin_runs(u, v, along, aside, line, row)
        first, last = np.maximum(first, left[line]), np.minimum(last, right[line])
        kept = np.flatnonzero(first <= last)
        return line[kept], row[kept], first[kept], last[kept]

    def times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        """Times at which segments enter and leave cells; a cell that is not touched is left before it is entered."""
        (entry, leave), *others = self.spells(line, x, y)
        for first, last in others:
            met, also = entry <= leave, first <= last
            entry, leave = (
                np.where(also & (~met | (first < entry)), first, entry),
                np.where(also & (~met | (last > leave)), last, leave),
            )
        return entry, leave

    def spells(self, line: Ints, x: Ints, y: Ints) -> list[tuple[Ints, Ints]]:
        """Times at which a disc moving along the segment covers cell centres, and its own centre is in their squares.

        Thin segments have only the second interval, wide ones only the first, which contains the second.
        """
        if not self.radius:
            return [self._thin_times(line, x, y)]
        wide = self._thick_times(line, x, y)
        return [wide] if self.radius >= DIAGONAL else [wide, self._axis_times(line, x, y)]

    def _axis_times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        """Times at which the axis of a thick segment is in cells, over the segment's scale, rounded inward."""
        first, last = self._thin_times(line, x, y)
        axis, length2 = np.maximum(np.abs(self.step), 1).prod(axis=1)[line], self.length2[line]
        beside = np.abs(SUB * np.stack([x, y], axis=1) - self.start[line]) > HALF
        met = (first <= last) & ~(beside & (self.step[line] == 0)).any(axis=1)
        first, last = np.where(met, first, 0), np.where(met, last, 0)
        if int(last.max(initial=0)) * int(length2.max(initial=0)) >= ROOM:
            first, last, axis = first.astype(object), last.astype(object), axis.astype(object)
        entry, leave = np.asarray(-(-first * length2 // axis), np.int64), np.asarray(last * length2 // axis, np.int64)
        return np.where(met, entry, 1), np.where(met, leave, 0)

    def entered_by(self, line: Ints, x: Ints, y: Ints) -> Ints:
        """Outward normal (n, 2) of the side by which cells are entered; (0, 0) if the segment begins inside."""
        step = self.step[line]
        sign = np.sign(step)
        ahead = (SUB * np.stack([x, y], axis=1) - self.start[line]) * sign
        if self.radius:
            larger = np.stack([~self.steep[line], self.steep[line]], axis=1)
            return np.asarray(np.where(larger & (ahead > 0), -sign, 0))
        entry, _ = self._thin_times(line, x, y)
        across = np.maximum(np.abs(step), 1)[:, ::-1]
        return np.asarray(np.where((sign != 0) & ((ahead - HALF) * across == entry[:, None]), -sign, 0))

    def _thin_times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        step = self.step[line]
        sign, length = np.sign(step), np.abs(step)
        across = np.maximum(length, 1)
        ahead_x = (SUB * x - self.start[line, 0]) * sign[:, 0]
        ahead_y = (SUB * y - self.start[line, 1]) * sign[:, 1]
        # Along an axis without a step the square is never entered or left: those times lie beyond the ends.
        entry = np.maximum((ahead_x - HALF) * across[:, 1], (ahead_y - HALF) * across[:, 0])
        leave = np.minimum((ahead_x + HALF) * across[:, 1], (ahead_y + HALF) * across[:, 0])
        end = np.where((length == 0).all(axis=1), 0, across.prod(axis=1))
        return np.maximum(entry, 0), np.minimum(leave, end)

    def _thick_times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        """Times at which a disc that moves along the segment covers centres: u -+ sqrt(q), rounded inward."""
        dx, dy = self.step[line].T
        px, py = SUB * x - self.start[line, 0], SUB * y - self.start[line, 1]
        u, v = px * dx + py * dy, px * dy - py * dx
        length2 = self.length2[line]
        still = length2 == 0
        near = np.where(still, px * px + py * py <= self.radius**2, np.abs(v) <= self.sides[line])
        root = np.zeros_like(u)
        root[near] = self._roots(v[near], length2[near])
        entry, leave = np.maximum(u - root, 0), np.minimum(u + root, length2)
        entry[~near], leave[~near] = 1, 0
        return entry, leave

    def _roots(self, v: Ints, length2: Ints) -> Ints:
        """Roots of radius^2 length^2 - v^2, rounded down."""
        most = self.radius**2 * int(length2.max(initial=0))
        if most < ROOM:
            return isqrt(self.radius**2 * length2 - v * v)
        if most < FAR:
            return far_roots(self.radius, v, length2)
        squares: npt.NDArray[np.object_] = self.radius**2 * length2.astype(object) - v.astype(object) ** 2
        return np.array([math.isqrt(square) for square in squares.tolist()], np.int64)


def _thin_runs(u: Ints | int, v: Ints | int, along: Ints, aside: Ints, line: Ints, row: Ints) -> tuple[Ints, Ints]:
    """First and last cell of thin segments in rows; the last is less in a row that is not touched."""
    per, slope, level = np.maximum(np.abs(aside), 1), along * np.sign(aside), aside == 0
    enter = np.maximum(SUB * row - HALF, np.minimum(v, v + aside)[line])
    leave = np.minimum(SUB * row + HALF, np.maximum(v, v + aside)[line])
    none, base, slope = enter > leave, (u * per - v * slope)[line], slope[line]
    enter, leave = base + enter * slope, base + leave * slope
    if level.any():
        leave += np.where(level, along, 0)[line]
    cell = (SUB * per)[line]
    first, last = -(((cell >> 1) - np.minimum(enter, leave)) // cell), (np.maximum(enter, leave) + (cell >> 1)) // cell
    return first, np.where(none, first - 1, last)


def cells_of(start_256: Ints, end_256: Ints, radius_256: int = 0) -> tuple[Ints, Ints, Ints, Ints, Ints]:
    """Cells of segments (n, 2), up to 2**48 and of half a width, all in 1/256 px, in any order.

    Returned are segment (k,), pixel (k, 2), entry (k,) and exit (k,); and the scale (n,) of the times, which is the
    time at a segment's end.
    """
    origin = (start_256 + HALF) // SUB
    lines = Lines(start_256 - SUB * origin, end_256 - start_256, radius_256)
    reach = (lines.step // SUB, -(-lines.step // SUB))
    wide = radius_256 // SUB + 2
    low, high = np.minimum(reach[0], 0) - wide, np.maximum(reach[1], 0) + wide
    line, x, y = lines.candidates(np.concatenate([low, high], axis=1))
    entry, leave = lines.times(line, x, y)
    met = np.flatnonzero(entry <= leave)
    line = line[met]
    return line, np.stack([x[met], y[met]], axis=1) + origin[line], entry[met], leave[met], lines.scale


def quarter_turned(array: npt.NDArray[Any], x: int, y: int, turns: int) -> tuple[npt.NDArray[Any], int, int]:
    """A view of an array (h, w, ...) and its pivot (x, y), turned by quarter turns.

    `numpy.rot90` takes five times as long for the same view.
    """
    for _ in range(turns):
        x, y = SUB * (len(array) - 1) - y, x
        array = array.swapaxes(0, 1)[:, ::-1]
    return array, x, y


class Edges(NamedTuple):
    """Rectangles that cover a mask in each of its four quarter turns, relative to its pivot."""

    begin: Ints  # (5,) first rectangle of each turn, and their number
    sides: Ints  # (4, k) left, right, top and low, 1/256 px
    pivots: Ints  # (4, 2) of each turn, from the centre of the pixel that holds it, 1/256 px


def edges_of(mask: Bools, pivot_256: tuple[int, int]) -> Edges:
    """Edges of a mask: a rectangle for all runs of equal columns in rows that follow each other."""
    sides, pivots = [], []
    for turns in range(4):
        source, *pivot = quarter_turned(mask, *pivot_256, turns)
        left, top, right, low = rectangles(np.asarray(source)).T
        edges = np.stack([left, right + 1, top, low + 1])
        sides.append(SUB * edges - HALF - np.repeat(pivot, 2)[:, None])
        pivots.append(pivot + SUB * pixel(-np.array(pivot)))
    return Edges(np.cumsum([0, *(part.shape[1] for part in sides)]), np.concatenate(sides, axis=1), np.array(pivots))


def turned_runs(edges: Edges, quarter: Ints, c: Ints, s: Ints) -> RowRuns:
    """Runs of a mask that is turned to n directions, as `variants_of` turns it, from the pixel of its pivot.

    A pixel is set if its centre, turned back, lies in one of the closed rectangles: between its ends,
    `left <= dx c + dy s <= right`, and between its sides, `top <= dy c - dx s <= low`. Rounded directions
    are not of length 1, so that corners are up to 1/256 px beyond the rows to which they turn.

    Parameters
    ----------
    quarter, c, s : (n,) directions, as `quarters` splits them
    """
    aim, place = ragged(np.diff(edges.begin)[quarter])
    left, right, top, low = edges.sides[:, edges.begin[quarter][aim] + place]
    c, s, pivot = c[aim], s[aim], edges.pivots[quarter][aim]
    ends = left * s, right * s
    first_row = (np.minimum(*ends) + top * c >> TRIG_BITS) + pivot[:, 1] - 1 >> 8
    last_row = (np.maximum(*ends) + low * c >> TRIG_BITS) + pivot[:, 1] + 1 >> 8
    run, row = each_pixel(first_row, last_row)
    c, s, (x, y) = c[run], s[run], pivot[run].T
    down = SUB * row - y
    across = [(side[run] << TRIG_BITS) - down * s + x * c for side in (left, right)]
    along = [down * c - (side[run] << TRIG_BITS) + x * s for side in (low, top)]
    (first, last), (begin, end) = runs_between(across[0], across[1], c), runs_between(along[0], along[1], s)
    return in_rows(aim[run], row, np.maximum(first, begin), np.minimum(last, end))
