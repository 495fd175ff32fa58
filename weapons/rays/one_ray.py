"""One ray a call, or a few, followed in whole numbers of Python, which is faster than numpy.

A ray visits the boxes of items in the order in which it enters them, and in each box its cells, row by row, until no
box is left that it enters before its end. Times are those of `grid.rasterize`: whole numbers over one of the ray, so
that the order of two cells never depends on rounding.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from hitplanes.planes.bits.distance_field import LONGEST
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Ints
from hitplanes.planes.common.limits import HALF, SUB
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.grid.rasterize import DIAGONAL, Lines
from hitplanes.planes.grid.spans import Box, clipped, meets
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.prefilter import Filters
from ..fire.strategy import RAY_WAYS, are_faster_alone, chosen_ray_way
from ..kinds.rays import RayWeapon
from .contacts import NEVER, Reason
from .first_hit import marcher
from .raycast import cast_together

ROWS_MOST = 120
"""Most rows of masks that a ray looks at; with more, the raycast of a batch is faster."""

AT_RANGE = [Reason.RANGE, NEVER, 0, 0, -1, False]
"""End of a ray that meets nothing: why, when, y, x, rank, and whether an occluder's cell is walked alone."""

Pair = tuple[int, int]
Spell = tuple[int, int]
"""Times at which a ray enters and leaves a box or a cell."""


Cell = tuple[int, int, int]
"""When a ray enters a cell, and the cell's y and x."""

Run = tuple[int, int, bytes]
"""Cells of an item's mask along the longer axis of a ray: the row, the first cell, and one byte for each."""


class Entered(NamedTuple):
    """Items (n,) that a ray may touch, in the order in which it enters their boxes.

    Parameters
    ----------
    rank : (n,) places in the stack
    box_xyxy : (n, 4) boxes within the bounds, relative to the pixel on which the ray begins
    entry, leave : (n,) times at which the ray enters and leaves the boxes; of a wide ray bounds of when it enters cells
    """

    rank: Ints
    box_xyxy: Ints
    entry: Ints
    leave: Ints


Followed = tuple[int, list[list[int]]]
"""When a ray ends, and what it hits, in order: rank, number of cells, first cell (x, y) in the world, and its time."""

Touch = tuple[int, int, int, int, int, int]
"""An item that a ray touches: time, y and x of its first cell, rank, cells, and its number in `Entered`."""

Passed = tuple[int, list[list[int]], Touch | None]
"""Like `Followed`, with cells relative to the pixel on which the ray begins; and what it touches as it ends."""

Follow = Callable[[int, int, int, int], Followed | None]
"""Function that follows one ray from (x, y) to (x + dx, y + dy), 1/256 px; None if it does not serve the ray."""


def chosen_follower(
    scene: Scene, stack: Stack, ray: RayWeapon, view: View, rays: int = 1, in_arrays: bool = True
) -> tuple[Follow, bool]:
    """Function that follows each of so many rays by the way chosen now, and whether the next may go another way.

    A ray is cast if it comes to several pixels at once by march. One that passes too many rows of masks is cast in
    arrays, or None is returned of it if `in_arrays` is False, as of rays that must walk, and of several rays that take
    less time together.
    """
    chosen = chosen_ray_way("auto", False, ray, scene, stack, view, rays, prepared=True)
    bounds, radius, most = scene.bounds, ray.radius_256, ray.hits_most
    alone: Follow = kernels_of(sys.modules[__name__]).follower(stack, bounds, view, radius, most)

    def cast(x: int, y: int, dx: int, dy: int) -> Followed | None:
        return alone(x, y, dx, dy) or (
            follow_in_arrays(x, y, dx, dy, stack, bounds, view, radius, most) if in_arrays else None
        )

    if chosen.way == "march":
        march = marcher(scene, stack, view)
        return lambda *line: march(*line) or cast(*line), chosen.pending
    alone_pays = not RAY_WAYS["cast"](ray, scene, view) and (rays == 1 or are_faster_alone(rays, stack))
    return cast if alone_pays else lambda *_: None, chosen.pending


def follower(stack: Stack, bounds: Box | None, view: View, radius: int, most: int | None) -> Follow:
    """Function that follows one ray of half a width, in 1/256 px, among the items that a view accepts.

    `most` is the number of objects that a ray may hit, or None.
    """
    accepted = view.accepts(stack)
    accepts = None if accepted.all() else accepted

    def follow(x: int, y: int, dx: int, dy: int) -> Followed | None:
        """Follow one ray."""
        found = _passed((x, y), (dx, dy), radius, stack, bounds, accepts, most)
        if found is None:
            return None
        left, top = (x + HALF) // SUB, (y + HALF) // SUB
        return found[0], [[rank, count, x + left, y + top, time] for rank, count, x, y, time in found[1]]

    return follow


def follow_in_arrays(
    x: int, y: int, dx: int, dy: int, stack: Stack, bounds: Box | None, view: View, radius: int, most: int | None
) -> Followed:
    """Follow one ray in arrays."""
    filters = np.array([view.meets]), np.array([view.exclude], np.int64)
    lines = Lines(np.array([[x, y]]), np.array([[dx, dy]]), radius)
    hit, ends = cast_together(stack, bounds, lines, most, filters)
    hit[3:5] += pixel(lines.start).T
    return int(ends[1, 0]), hit[1:].T.tolist()


def follow_each(
    stack: Stack, bounds: Box | None, lines: Lines, most: int | None, filters: Filters | None
) -> tuple[Ints, Ints]:
    """`raycast.hits_and_ends` of a few rays, one after another; those that pass too many rows are cast together."""
    hits: list[list[int]] = []
    ends: list[list[int]] = []
    rest: list[int] = []

    @cache
    def accepted(meets: int, exclude: tuple[int, ...]) -> Bools:
        return View(False, meets, exclude).accepts(stack)

    for number, (start, step) in enumerate(zip(lines.start.tolist(), lines.step.tolist(), strict=True)):
        accepts = filters and accepted(int(filters[0][number]), tuple(filters[1][number].tolist()))
        found = _passed(start, step, lines.radius, stack, bounds, accepts, most)
        if found is None:
            rest.append(number)
            ends.append(AT_RANGE)  # until all of them are cast
            continue
        time, rows, last = found
        hits += [[number, *row] for row in rows]
        if last is None:
            ends.append(AT_RANGE)
        else:
            blocked = stack.has_occluders and bool(stack.occluder[last[3]])
            ends.append([Reason.OCCLUDER if blocked else Reason.HITS, time, *last[1:4], blocked])
    hit, end = (np.array(rows, np.int64).reshape(-1, 6).T for rows in (hits, ends))
    if rest:
        among = filters and (filters[0][rest], filters[1][rest])
        others, end[:, rest] = cast_together(stack, bounds, lines.take(np.array(rest)), most, among)
        others[0] = np.array(rest)[others[0]]
        hit = np.concatenate([hit, others], axis=1)
        hit = hit[:, np.argsort(hit[0], kind="stable")]
    return hit, end


def _passed(
    at: Pair, step: Pair, radius: int, stack: Stack, bounds: Box | None, accepts: Bools | None, most: int | None
) -> Passed | None:
    """What a ray of half a width hits, up to `most` of the accepted objects; None if arrays must decide it."""
    if not any(step) or max(map(abs, step)) > LONGEST:
        return None
    origin = (at[0] + HALF) // SUB, (at[1] + HALF) // SUB
    start, way = (at[0] - SUB * origin[0], at[1] - SUB * origin[1]), (step[0], step[1])
    ray = WideRay(start, way, radius) if radius else Ray(start, way)
    return ray.passed(origin, _near(ray, origin, stack, bounds, accepts), stack, most)


class Ray:
    """A thin ray, relative to the pixel on which it begins, in 1/256 px."""

    reach = HALF  # how far from its axis it may touch a pixel's centre, along x and along y
    strip = 0  # how long before its axis passes the centre of a pixel it may enter that; of no use for a thin one

    def __init__(self, start: Pair, step: Pair) -> None:
        self.start, self.step = start, step
        self.across = max(abs(step[1]), 1), max(abs(step[0]), 1)
        self.scale = self.across[0] * self.across[1]  # the time at its end
        self.major = int(abs(step[1]) > abs(step[0]))
        (u, along), (v, aside) = ((start[axis], step[axis]) for axis in (self.major, 1 - self.major))
        per, slope = max(abs(aside), 1), (along if aside > 0 else -along) * (aside != 0)
        self.slant = v, min(v, v + aside), max(v, v + aside), u * per, slope, per  # that all rows have in common

    def times(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Times at which the ray enters and leaves boxes (n, 4) of pixels; leave < entry if it does not touch a box."""
        entry, leave = np.zeros(len(boxes_xyxy), np.int64), np.full(len(boxes_xyxy), self.scale)
        for axis, across in enumerate(self.across):
            low = SUB * boxes_xyxy[:, axis] - (HALF + self.start[axis])
            high = SUB * boxes_xyxy[:, axis + 2] + (HALF - self.start[axis])
            if not self.step[axis]:
                leave[(low > 0) | (high < 0)] = -1
                continue
            near, far = (low, high) if self.step[axis] > 0 else (-high, -low)
            np.maximum(entry, near * across, out=entry)
            np.minimum(leave, far * across, out=leave)
        return entry, leave

    def spell(self, x: int, y: int) -> Spell:
        """Like `times`, for one pixel."""
        entry, leave = 0, self.across[0] * self.across[1]
        for at, begin, step, across in zip((x, y), self.start, self.step, self.across, strict=True):
            ahead = SUB * at - begin if step > 0 else begin - SUB * at
            if step:
                entry, leave = max(entry, (ahead - HALF) * across), min(leave, (ahead + HALF) * across)
            elif abs(ahead) > HALF:
                return 1, 0
        return entry, leave

    def rows(self, box: list[int], times: Spell) -> range:
        """Rows of a box, across the longer axis of the ray, that it visits between two times, in its order."""
        minor, scale, reach = 1 - self.major, self.scale, self.reach
        begin, step = self.start[minor], self.step[minor]
        low, high = sorted(begin + step * min(max(time, 0), scale) // scale for time in times)
        first, last = max(-((reach - low) // SUB), box[minor]), min((high + 1 + reach) // SUB, box[minor + 2])
        return range(first, last + 1) if step >= 0 else range(last, first - 1, -1)

    def rows_about(self, near: Entered) -> int:
        """About how many rows it visits in boxes, if it goes on to its range."""
        minor = 1 - self.major
        high = near.box_xyxy[:, minor + 2] - near.box_xyxy[:, minor] + 1
        slope = abs(self.step[minor]) / (SUB * self.scale)
        return int(np.minimum((near.leave - near.entry) * slope + 2 * self.reach / SUB, high).sum())

    def run(self, row: int) -> Spell:
        """First and last cell of a row that the ray touches, along its longer axis; (1, 0) if it touches none."""
        begin, low, high, base, slope, per = self.slant
        first, last = max(low, SUB * row - HALF), min(high, SUB * row + HALF)
        if first > last:
            return 1, 0
        if slope:
            low, high = base + (first - begin) * slope, base + (last - begin) * slope
            low, high = (low, high) if slope > 0 else (high, low)
        else:
            low, high = min(base, base + self.step[self.major]), max(base, base + self.step[self.major])
        return -((HALF * per - low) // (SUB * per)), (high + HALF * per) // (SUB * per)

    def cells(self, runs: Iterator[Run], every: bool) -> tuple[int, Cell | None]:
        """Number of cells that are set in runs, unless only the first is looked for, and the first of them."""
        count, rows_met, ahead = 0, 0, 1 if self.step[self.major] > 0 else -1
        found: list[Cell] = []
        for row, first, run in runs:
            cells = run.count(1)
            count, rows_met = count + cells, rows_met + (cells > 0)
            if cells and rows_met <= 2:  # through a corner it enters two cells of a row, and of the next, at once
                at = run.find(1) if ahead > 0 else run.rfind(1)
                found += [self.entered(row, first + k) for k in (at, at + ahead) if 0 <= k < len(run) and run[k] == 1]
            elif found and not every:
                break
        return count, min(found, default=None)

    def entered(self, row: int, at: int) -> Cell:
        """A cell of a row, and when the ray enters it; NEVER if it does not."""
        x, y = (row, at) if self.major else (at, row)
        return self.spell(x, y)[0], y, x

    # house: hit rule of rays
    def passed(self, origin: Pair, near: Entered, stack: Stack, most: int | None) -> Passed | None:
        """What a ray hits, up to `most` objects; None if arrays must decide it.

        They do so if it looks at too many rows, or if it enters another item at once with the occluder that ends it.
        """
        if most is None and self.rows_about(near) > 2 * ROWS_MOST:  # about half of them lie in front of occluders
            return None
        end, left, times = NEVER, ROWS_MOST, list[int]()
        touched: list[Touch] = []
        for k, (entry, leave) in enumerate(zip(near.entry.tolist(), near.leave.tolist(), strict=True)):
            if entry > end:
                break
            box, rank = near.box_xyxy[k].tolist(), int(near.rank[k])
            rows = self.rows(box, (entry, leave))
            left -= len(rows)
            if left < 0:
                return None
            blocks = stack.has_occluders and bool(stack.occluder[rank])
            every = most != 1 and not blocks  # of an occluder only the first cell matters
            count, found = self.cells(_runs(self, origin, box, rows, stack, rank), every)
            if found is None:
                continue
            touched.append((*found, rank, count, k))
            if blocks:
                end = min(end, found[0])
            elif most is not None:
                times = sorted([*times, found[0]])[:most]
                end = min(end, times[-1]) if len(times) == most else end
        return self._ended(sorted(met for met in touched if met[0] <= end), end, origin, near, stack, most)

    def _ended(
        self, touched: list[Touch], end: int, origin: Pair, near: Entered, stack: Stack, most: int | None
    ) -> Passed | None:
        """What the ray hits before its end, of what it touches until then, in order."""
        at_end = [rank for time, _, _, rank, _, _ in touched if time == end]
        if not at_end:
            return end, [[rank, count, x, y, time] for time, y, x, rank, count, _ in touched], None
        blocked = stack.has_occluders and bool(stack.occluder[at_end].any())
        if blocked and len(at_end) > 1:
            return None
        last, hits = (touched[-1], touched[:-1]) if blocked else (touched[most - 1], touched[:most])  # type: ignore[operator]
        rows = []
        for met in hits:
            time, y, x, rank, count, k = met
            if met is last:
                count = 1
            elif near.leave[k] >= end:
                box = near.box_xyxy[k].tolist()
                visited = self.rows(box, (int(near.entry[k]), end + 2 * self.strip))
                count = self.walked(_runs(self, origin, box, visited, stack, rank), last, blocked, rank)
            rows.append([rank, count, x, y, time])
        return end, rows, last

    def walked(self, runs: Iterator[Run], last: Touch, alone: bool, rank: int) -> int:
        """Number of cells of an item of a rank that are set in runs, and that the ray enters up to its last cell.

        `alone` says whether the last cell is the only one that it walks of those that it enters at that time.
        """
        end, last_y, last_x, last_rank, _, _ = last
        count, ahead = 0, self.step[self.major] > 0
        for row, first, run in runs:
            at = run.find(1) if ahead else run.rfind(1)
            while at >= 0:
                time, y, x = cell = self.entered(row, first + at)
                if end + self.strip < time < NEVER:
                    break
                here = (y, x) == (last_y, last_x) and rank <= last_rank
                count += time < end or (time == end and (here or (not alone and cell < last[:3])))
                at = run.find(1, at + 1) if ahead else run.rfind(1, 0, at)
        return count


class WideRay(Ray):
    """A ray with a radius, half of its width, relative to the pixel on which it begins, in 1/256 px.

    Times are over the squared length. The disc of the radius comes nearest to the centre of a pixel at time u, and
    covers it from u - root to u + root, where root^2 = radius^2 length^2 - v^2; u and v are the products of the ray,
    along and across, with the vector from its start to the centre. See `grid.rasterize.Lines`.
    """

    def __init__(self, start: Pair, step: Pair, radius: int) -> None:
        super().__init__(start, step)
        self.reach, self.scale = max(radius, DIAGONAL), step[0] ** 2 + step[1] ** 2
        self.square, self.strip = radius**2 * self.scale, math.isqrt(self.reach**2 * self.scale)
        low, high = sorted((start[self.major], start[self.major] + step[self.major]))
        self.ends = -((self.reach - low) // SUB), (high + self.reach) // SUB  # first and last cell of any row
        self.narrow = radius < DIAGONAL  # its axis may be in pixels whose centres the disc does not cover

    def times(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Bounds of the times at which the ray enters cells of boxes (n, 4); leave < entry if it touches none."""
        (x, y), (dx, dy), (left, top, right, low) = self.start, self.step, SUB * boxes_xyxy.T
        near_x, far_x = (left - x, right - x) if dx >= 0 else (right - x, left - x)
        near_y, far_y = (top - y, low - y) if dy >= 0 else (low - y, top - y)
        entry, leave = near_x * dx + near_y * dy - (self.strip + 2), far_x * dx + far_y * dy + (self.strip + 2)
        sides = far_x * dy - near_y * dx, near_x * dy - far_y * dx
        beside = (np.maximum(*sides) < -self.strip) | (np.minimum(*sides) > self.strip)
        return entry, np.where(beside | (entry > self.scale) | (leave < 0), entry - 1, leave)

    def rows(self, box: list[int], times: Spell) -> range:
        """Rows of a box that the ray may touch, in its order: those near its axis between the box's sides."""
        return super().rows(box, (times[0] + self.strip, times[1] - self.strip))

    def run(self, row: int) -> Spell:
        """First and last cell of a row that the ray may touch, along its longer axis."""
        v, _, _, base, slope, per = self.slant
        if not slope:
            return self.ends if abs((SUB * row - v) * self.step[self.major]) <= self.strip else (1, 0)
        middle, cell = base + (SUB * row - v) * slope, SUB * per
        return max(self.ends[0], -((self.strip - middle) // cell)), min(self.ends[1], (middle + self.strip) // cell)

    def cells(self, runs: Iterator[Run], every: bool) -> tuple[int, Cell | None]:
        """Number of cells that are set in runs and touched, unless only the first is looked for, and the first."""
        count, best, (x0, y0), (dx, dy) = 0, None, self.start, self.step
        du, dv = (SUB * dy, -SUB * dx) if self.major else (SUB * dx, SUB * dy)
        for row, first, run in runs:
            x, y = (row, first) if self.major else (first, row)
            px, py = SUB * x - x0, SUB * y - y0
            u, v = px * dx + py * dy, px * dy - py * dx
            at = run.find(1) if du > 0 else run.rfind(1)
            while at >= 0:
                now = u + at * du
                if best is not None and best[0] < now - self.strip and now <= self.scale:
                    if not every:
                        break
                    if not self.narrow:  # all of the next cells are touched, and later, until the ray ends
                        end = min(max((self.scale - u) // du if du > 0 else -((u - self.scale) // du), 0), len(run) - 1)
                        low, high = min(at, end), max(at, end)
                        count += run.count(1, low, high + 1)
                        at = run.find(1, high + 1) if du > 0 else run.rfind(1, 0, low)
                        continue
                time = self.time(x + at * (1 - self.major), y + at * self.major, now, v + at * dv)
                if time < NEVER:
                    count, cell = count + 1, (time, y + at * self.major, x + at * (1 - self.major))
                    best = cell if best is None or cell < best else best
                at = run.find(1, at + 1) if du > 0 else run.rfind(1, 0, at)
        return count, best

    def entered(self, row: int, at: int) -> Cell:
        """See `Ray.entered`."""
        x, y = (row, at) if self.major else (at, row)
        px, py, (dx, dy) = SUB * x - self.start[0], SUB * y - self.start[1], self.step
        return self.time(x, y, px * dx + py * dy, px * dy - py * dx), y, x

    def time(self, x: int, y: int, u: int, v: int) -> int:
        """When the ray enters a pixel; NEVER if it does not."""
        found, rest = NEVER, self.square - v * v
        if rest >= 0:
            root = math.isqrt(rest)
            if max(u - root, 0) <= min(u + root, self.scale):
                found = max(u - root, 0)
        if self.narrow:
            scale, (first, last) = self.across[0] * self.across[1], self.spell(x, y)
            axis = -(-first * self.scale // scale)
            if first <= last and axis <= last * self.scale // scale:
                return min(axis, found)
        return found


def _near(ray: Ray, origin: Pair, stack: Stack, bounds: Box | None, accepts: Bools | None) -> Entered:
    """Accepted items whose boxes a ray touches, in order of entry."""
    ends = [sorted((start, start + step)) for start, step in zip(ray.start, ray.step, strict=True)]
    around = [(low - ray.reach) // SUB + o for (low, _), o in zip(ends, origin, strict=True)]
    around += [(high + ray.reach) // SUB + o for (_, high), o in zip(ends, origin, strict=True)]
    rank = np.flatnonzero(meets(np.array(around), stack.box_xyxy))
    if accepts is not None:
        rank = rank[accepts[rank]]
    box = stack.box_xyxy[rank]
    if bounds is not None:
        box = clipped(box, bounds)
    box = box - np.array([*origin, *origin])
    entry, leave = ray.times(box)
    rows = np.flatnonzero((entry <= leave) & (box[:, 0] <= box[:, 2]) & (box[:, 1] <= box[:, 3]))
    rows = rows[np.argsort(entry[rows], kind="stable")]
    return Entered(rank[rows], box[rows], entry[rows], leave[rows])


def _runs(ray: Ray, origin: Pair, box: list[int], rows: range, stack: Stack, rank: int) -> Iterator[Run]:
    """The cells of an item's mask that a ray may touch."""
    major, (left, top) = ray.major, (stack.box_xyxy[rank, :2] - origin).tolist()
    width, corner = int(stack.width[rank]), int(stack.offset[rank])
    step = width if major else 1
    for row in rows:
        first, last = ray.run(row)
        first, last = max(first, box[major]), min(last, box[major + 2])
        if first <= last:
            begin = corner + ((first - top) * width + row - left if major else (row - top) * width + first - left)
            yield row, first, stack.masks[begin : begin + (last - first) * step + 1 : step].tobytes()
