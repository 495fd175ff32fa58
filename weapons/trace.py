"""Rays to cells, in order: the closed supercover of segments on the 1/256-px grid, for many at once.

A cell is met when its closed square is: nothing slips through a corner, and both ends see the same cells. The times at
which a ray enters and leaves a cell are whole numbers over a scale of the ray's own, so they have a total order:

    thin ray     max(1, |dx|) * max(1, |dy|)        thick ray     dx^2 + dy^2

All coordinates are relative to a whole pixel near the start of the ray.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Floats, Ints
from planes.constants import HALF, SUB
from planes.grid256 import isqrt
from planes.spans import each_pixel, ragged

__all__ = ["COMMON", "ROOM", "Lines", "cells"]

DIAGONAL = 182
"""Half the diagonal of a pixel in 1/256 px, rounded up: a disc so large has the centre of every square it touches."""

COMMON = 2**60
"""Scale of the times of rays that each item sees in its own way: they are compared in whole parts of this."""

ROOM = 2**62
"""Products below it leave room for a sum in int64; larger ones are worked out in Python integers."""

FAR = 2**90
"""Squares below it differ from those of their float roots by less than 2**46, which one step of Newton's corrects."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Segments of one width, as columns.

    Parameters
    ----------
    start, step : (n, 2) where they begin and how far they go, 1/256 px
    radius : half of their width, 1/256 px; 0 for thin rays
    common : a scale of the times for all of them; 0 for each its own
    """

    start: Ints
    step: Ints
    radius: int
    common: int = 0

    def __len__(self) -> int:
        return len(self.start)

    def take(self, rows: Ints | Bools) -> Lines:
        """Some of the segments."""
        return Lines(self.start[rows], self.step[rows], self.radius, self.common)

    @cached_property
    def steep(self) -> Bools:
        """Which go farther along y than along x."""
        return np.asarray(np.abs(self.step[:, 1]) > np.abs(self.step[:, 0]))

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
        """What times are counted over: the end of the segment."""
        if self.common:
            return np.full(len(self), self.common)
        if self.radius:
            return np.maximum(self.length2, 1)
        dx, dy = np.maximum(np.abs(self.step), 1).T
        return np.asarray(dx * dy)

    @cached_property
    def sides(self) -> Ints:
        """How far centres lie from the axis at most, times the length, rounded down."""
        return self._lengths_times(self.radius)

    @cached_property
    def wide_sides(self) -> Ints:
        """Of all cells: of those that the axis touches, too."""
        return self._lengths_times(max(self.radius, DIAGONAL))

    def _lengths_times(self, reach: int) -> Ints:
        return np.array([math.isqrt(reach * reach * n) for n in self.length2.tolist()], np.int64)

    def candidates(self, boxes_xyxy: Ints) -> tuple[Ints, Ints, Ints]:
        """Cells of each segment in an inclusive box of its own (n, 4), as (segment, x, y).

        Of thick segments some more: those whose times then are none.
        """
        steep = self.steep
        if steep.any() and not steep.all():
            flat, upright = np.flatnonzero(~steep), np.flatnonzero(steep)
            parts = [(rows, self.take(rows).candidates(boxes_xyxy[rows])) for rows in (flat, upright)]
            return (
                np.concatenate([rows[line] for rows, (line, _, _) in parts]),
                np.concatenate([x for _, (_, x, _) in parts]),
                np.concatenate([y for _, (_, _, y) in parts]),
            )
        if len(steep) and steep[0]:
            line, y, x = self._along(1, boxes_xyxy)
        else:
            line, x, y = self._along(0, boxes_xyxy)
        return line, x, y

    def times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        """When segments enter and leave cells; one that is not met is left before it is entered."""
        (entry, leave), *others = self.spells(line, x, y)
        for first, last in others:
            met, also = entry <= leave, first <= last
            entry, leave = (
                np.where(also & (~met | (first < entry)), first, entry),
                np.where(also & (~met | (last > leave)), last, leave),
            )
        return entry, leave

    def spells(self, line: Ints, x: Ints, y: Ints) -> list[tuple[Ints, Ints]]:
        """When the disc around a segment's point covers the centres of cells, and when the point is in their squares.

        Of thin segments the second only, of wide ones the first: it is the longer.
        """
        if not self.radius:
            return [self._thin_times(line, x, y)]
        wide = self._thick_times(line, x, y)
        return [wide] if self.radius >= DIAGONAL else [wide, self._axis_times(line, x, y)]

    def _axis_times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        """Times of the point of a thick segment over its own scale: rounded up and down."""
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
        """Outward side (n, 2) by which cells are entered; (0, 0) if the segment begins strictly inside."""
        step = self.step[line]
        sign = np.sign(step)
        ahead = (SUB * np.stack([x, y], axis=1) - self.start[line]) * sign
        if self.radius:
            larger = np.stack([~self.steep[line], self.steep[line]], axis=1)
            return np.asarray(np.where(larger & (ahead > 0), -sign, 0))
        entry, _ = self._thin_times(line, x, y)
        across = np.maximum(np.abs(step), 1)[:, ::-1]
        return np.asarray(np.where((sign != 0) & ((ahead - HALF) * across == entry[:, None]), -sign, 0))

    def _along(self, major: int, boxes_xyxy: Ints) -> tuple[Ints, Ints, Ints]:
        """Cells as (segment, place along the axis on which they go farther, place along the other)."""
        minor = 1 - major
        start, step = self.start[:, minor], self.step[:, minor]
        reach = self.radius + HALF
        low, high = np.minimum(start, start + step) - reach, np.maximum(start, start + step) + reach
        first = np.maximum(-(-low // SUB), boxes_xyxy[:, minor])
        last = np.minimum(high // SUB, boxes_xyxy[:, minor + 2])
        line, place = ragged(np.maximum(last - first + 1, 0))
        v = first[line] + place
        u_first, u_last = (self._thick_runs if self.radius else self._thin_runs)(major, line, v)
        u_first = np.maximum(u_first, boxes_xyxy[line, major])
        u_last = np.minimum(u_last, boxes_xyxy[line, major + 2])
        run, u = each_pixel(u_first, np.maximum(u_last, u_first - 1))
        return line[run], u, v[run]

    def _thin_runs(self, major: int, line: Ints, v: Ints) -> tuple[Ints, Ints]:
        """First and last cell of segments in rows v of the minor axis."""
        minor = 1 - major
        begin, step = self.start[line, minor], self.step[line, minor]
        u, along = self.start[line, major], self.step[line, major]
        low, high = np.minimum(begin, begin + step), np.maximum(begin, begin + step)
        per, slope = np.maximum(np.abs(step), 1), along * np.sign(step)
        enter = u * per + (np.maximum(low, SUB * v - HALF) - begin) * slope
        leave = u * per + (np.minimum(high, SUB * v + HALF) - begin) * slope
        level = step == 0
        enter, leave = np.where(level, u, enter), np.where(level, u + along, leave)
        low, high = np.minimum(enter, leave), np.maximum(enter, leave)
        return -((HALF * per - low) // (SUB * per)), (high + HALF * per) // (SUB * per)

    def _thick_runs(self, major: int, line: Ints, v: Ints) -> tuple[Ints, Ints]:
        """Cells around thick segments in rows v: no fewer than there are."""
        minor = 1 - major
        reach = max(self.radius, DIAGONAL)
        begin, along = self.start[line, major], self.step[line, major]
        low, high = np.minimum(begin, begin + along) - reach, np.maximum(begin, begin + along) + reach
        # |(p - start) x step| <= reach * length bounds p along the major axis, unless the segment is level.
        cross, side = (SUB * v - self.start[line, minor]) * along, self.wide_sides[line]
        step = self.step[line, minor]
        per, sign = np.maximum(np.abs(step), 1), np.where(step < 0, -1, 1)
        cross = cross * sign
        sloping = step != 0
        low = np.where(sloping, np.maximum(low, begin - ((side - cross) // per)), low)
        high = np.where(sloping, np.minimum(high, begin + ((cross + side) // per)), high)
        return -(-low // SUB), high // SUB

    def _thin_times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        step = self.step[line]
        sign, length = np.sign(step), np.abs(step)
        across = np.maximum(length, 1)
        ahead_x = (SUB * x - self.start[line, 0]) * sign[:, 0]
        ahead_y = (SUB * y - self.start[line, 1]) * sign[:, 1]
        # Without a step along an axis the square is never entered or left by it: its times lie beyond the ends.
        entry = np.maximum((ahead_x - HALF) * across[:, 1], (ahead_y - HALF) * across[:, 0])
        leave = np.minimum((ahead_x + HALF) * across[:, 1], (ahead_y + HALF) * across[:, 0])
        end = np.where((length == 0).all(axis=1), 0, across.prod(axis=1))
        return np.maximum(entry, 0), np.minimum(leave, end)

    def _thick_times(self, line: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
        """When a disc that moves along the segment covers centres: u -+ sqrt(q), rounded inward."""
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
            return _far_roots(self.radius, v, length2)
        squares: npt.NDArray[np.object_] = self.radius**2 * length2.astype(object) - v.astype(object) ** 2
        return np.array([math.isqrt(square) for square in squares.tolist()], np.int64)


def _far_roots(radius: int, v: Ints, length2: Ints) -> Ints:
    """Roots of radius^2 length^2 - v^2, from 0 to FAR, rounded down.

    The float root is off by so little that what is left of the square fits int64, and so it is exact although the
    squares wrap around. Below 2**31 that gives the square; above, one step of Newton's gives the root or 1 more.
    """
    side = radius * np.sqrt(length2)
    root = np.rint(np.sqrt(np.maximum((side - v) * (side + v), 0))).astype(np.int64)
    left = radius**2 * length2 - v * v - root * root
    small = root < 2**31
    step = left // np.maximum(2 * root, 1)
    newton = root + step - (left - 2 * root * step - step * step < 0)
    return np.where(small, isqrt(np.where(small, root * root + left, 0)), newton)


def cells(start_256: Ints, end_256: Ints, radius_256: int = 0) -> tuple[Ints, Ints, Ints, Ints, Ints]:
    """Cells of segments in the order in which they are entered.

    Parameters
    ----------
    start_256, end_256 : (n, 2) 1/256 px, up to 2**48
    radius_256 : half of their width

    Returns
    -------
    segment (k,), pixel (k, 2), entry (k,) and exit (k,), sorted by (segment, entry, y, x); and the scale (n,) of the
    times, which is that of the segment's end
    """
    origin = (start_256 + HALF) // SUB
    lines = Lines(start_256 - SUB * origin, end_256 - start_256, radius_256)
    reach = (lines.step // SUB, -(-lines.step // SUB))
    wide = radius_256 // SUB + 2
    low, high = np.minimum(reach[0], 0) - wide, np.maximum(reach[1], 0) + wide
    line, x, y = lines.candidates(np.concatenate([low, high], axis=1))
    entry, leave = lines.times(line, x, y)
    order = np.lexsort((x, y, entry, line))
    order = order[entry[order] <= leave[order]]
    line = line[order]
    xy = np.stack([x, y], axis=1)[order] + origin[line]
    return line, xy, entry[order], leave[order], lines.scale
