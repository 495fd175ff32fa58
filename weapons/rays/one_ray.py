"""One ray a call, or a few. A thin ray is followed in whole numbers of Python, which is faster than numpy.

A ray visits the boxes of items in the order in which it enters them, and in each box its cells, row by row, until no
box is left that it enters before its end. The cells of a wide ray are found in arrays, those of all boxes at once; both
have one rule for what is hit and where they end. Times are those of `grid.rasterize`: whole numbers over
max(1, |dx|) max(1, |dy|), so that the order of two cells never depends on rounding.
"""

from __future__ import annotations

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
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import Box, clipped, meets
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.prefilter import Filters
from ..fire.strategy import RAY_WAYS, chosen_ray_way
from ..kinds.rays import RayWeapon
from .contacts import NEVER, Reason
from .first_hit import marcher
from .raycast import ROUND_PAIRS, Crossed, cast_together, first_cells, times_in

ROWS_MOST = 400
"""Most rows of masks that the ray looks at; with more, the raycast of a batch is faster."""

Pair = tuple[int, int]
Spell = tuple[int, int]
"""Times at which a ray enters and leaves a box or a cell."""


class Entered(NamedTuple):
    """Items (n,) that a ray may touch, in the order in which it enters their boxes.

    Parameters
    ----------
    rank : (n,) places in the stack
    box_xyxy : (n, 4) boxes within the bounds, relative to the pixel on which the ray begins
    entry, leave : (n,) times at which the ray enters and leaves the boxes; of a wide ray their bounds
    """

    rank: Ints
    box_xyxy: Ints
    entry: Ints
    leave: Ints


Followed = tuple[int, list[list[int]]]
"""When a ray ends, and what it hits, in order: rank, number of cells, first cell (x, y) in the world, and its time."""

Touch = tuple[int, int, int, int, int, int]
"""An item that a ray touches: time, y and x of its first cell, rank, cells, and when the ray leaves its box."""

Passed = tuple[int, list[list[int]], Touch | None]
"""Like `Followed`, with cells relative to the pixel on which the ray begins; and what it touches as it ends."""

Follow = Callable[[int, int, int, int], Followed | None]
"""Function that follows one ray from (x, y) to (x + dx, y + dy), 1/256 px; None if it does not serve the ray."""


def chosen_follower(scene: Scene, stack: Stack, ray: RayWeapon, view: View) -> tuple[Follow, bool]:
    """Function that follows one ray by the way chosen now, and whether the next ray may go another way.

    A ray is cast if it comes to several pixels at once by march. None is returned of rays that must walk.
    """
    chosen = chosen_ray_way("auto", False, ray, scene, stack, view, 1, prepared=True)
    cast: Follow = kernels_of(sys.modules[__name__]).follower(stack, scene.bounds, view, ray.radius_256, ray.hits_most)
    if chosen.way == "march":
        march = marcher(scene, stack, view)
        return lambda *line: march(*line) or cast(*line), chosen.pending
    return (lambda *_: None) if RAY_WAYS["cast"](ray, scene, view) else cast, chosen.pending


def follower(stack: Stack, bounds: Box | None, view: View, radius: int, most: int | None) -> Follow:
    """Function that follows one ray of half a width, in 1/256 px, among the items that a view accepts.

    `most` is the number of objects that a ray may hit, or None.
    """
    filters = np.array([view.meets]), np.array([view.exclude], np.int64)

    def cast(x: int, y: int, dx: int, dy: int) -> Followed | None:
        """Follow one ray in arrays."""
        lines = Lines(np.array([[x, y]]), np.array([[dx, dy]]), radius)
        hit, ends = cast_together(stack, bounds, lines, most, filters)
        hit[3:5] += pixel(lines.start).T
        return int(ends[1, 0]), hit[1:].T.tolist()

    accepted = view.accepts(stack)
    accepts = None if accepted.all() else accepted

    def follow(x: int, y: int, dx: int, dy: int) -> Followed | None:
        """Follow one ray."""
        found = _passed((x, y), (dx, dy), radius, stack, bounds, accepts, most)
        if found is None:
            return cast(x, y, dx, dy)
        left, top = (x + HALF) // SUB, (y + HALF) // SUB
        return found[0], [[rank, count, x + left, y + top, time] for rank, count, x, y, time in found[1]]

    return follow


def follow_each(
    stack: Stack, bounds: Box | None, lines: Lines, most: int | None, filters: Filters | None
) -> tuple[Ints, Ints]:
    """`raycast.hits_and_ends` of a few rays, one after another."""
    hits: list[list[int]] = []
    ends: list[list[int]] = []

    @cache
    def accepted(meets: int, exclude: tuple[int, ...]) -> Bools:
        return View(False, meets, exclude).accepts(stack)

    for number, (start, step) in enumerate(zip(lines.start.tolist(), lines.step.tolist(), strict=True)):
        accepts = filters and accepted(int(filters[0][number]), tuple(filters[1][number].tolist()))
        found = _passed(start, step, lines.radius, stack, bounds, accepts, most)
        if found is None:
            own = slice(number, number + 1)
            among = filters and (filters[0][own], filters[1][own])
            hit, end = cast_together(stack, bounds, lines.take(own), most, among)
            hits += [[number, *row] for row in hit[1:].T.tolist()]
            ends.append(end[:, 0].tolist())
            continue
        time, rows, last = found
        hits += [[number, *row] for row in rows]
        if last is None:
            ends.append([Reason.RANGE, NEVER, 0, 0, -1, False])
        else:
            blocked = stack.has_occluders and bool(stack.occluder[last[3]])
            ends.append([Reason.OCCLUDER if blocked else Reason.HITS, time, *last[1:4], blocked])
    hit, end = (np.array(rows, np.int64).reshape(-1, 6).T for rows in (hits, ends))
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

    def __init__(self, start: Pair, step: Pair) -> None:
        self.start, self.step = start, step
        self.across = max(abs(step[1]), 1), max(abs(step[0]), 1)
        self.major = int(abs(step[1]) > abs(step[0]))

    def times(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Times at which the ray enters and leaves boxes (n, 4) of pixels; leave < entry if it does not touch a box."""
        entry, leave = np.zeros(len(boxes_xyxy), np.int64), np.full(len(boxes_xyxy), self.across[0] * self.across[1])
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
        minor = 1 - self.major
        begin, step, scale = self.start[minor], self.step[minor], self.across[0] * self.across[1]
        at = sorted((begin + step * time // scale + HALF) // SUB for time in times)
        first, last = max(at[0] - 1, box[minor]), min(at[1] + 1, box[minor + 2])  # on a border it is in two rows
        return range(first, last + 1) if step >= 0 else range(last, first - 1, -1)

    def rows_about(self, times: Ints) -> int:
        """About how many rows it visits in boxes in which it spends so much time each."""
        minor = abs(self.step[1 - self.major]) / (SUB * self.across[0] * self.across[1])
        return len(times) + int(times.sum() * minor)

    def run(self, row: int) -> Spell:
        """First and last cell of a row that the ray touches, along its longer axis; (1, 0) if it touches none."""
        u, along = self.start[self.major], self.step[self.major]
        begin, step = self.start[1 - self.major], self.step[1 - self.major]
        first = max(min(begin, begin + step), SUB * row - HALF) - begin
        last = min(max(begin, begin + step), SUB * row + HALF) - begin
        if first > last:
            return 1, 0
        if step:
            per, slope = abs(step), along if step > 0 else -along
            low, high = sorted((u * per + first * slope, u * per + last * slope))
        else:
            per, low, high = 1, min(u, u + along), max(u, u + along)
        return -((HALF * per - low) // (SUB * per)), (high + HALF * per) // (SUB * per)

    # house: hit rule of rays
    def passed(self, origin: Pair, near: Entered, stack: Stack, most: int | None) -> Passed | None:
        """What a ray hits, up to `most` objects; None if arrays must decide it.

        They do so if it looks at too many rows, if it enters another item at once with the occluder that ends it, or if
        it ends in the box of an item that it has hit before.
        """
        if most != 1 and self.rows_about(near.leave - near.entry) > ROWS_MOST:
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
            count, found = _cells(_runs(self, origin, box, rows, stack, rank), self, every)
            if found is None:
                continue
            touched.append((*found, rank, count, leave))
            if blocks:
                end = min(end, found[0])
            elif most is not None:
                times = sorted([*times, found[0]])[:most]
                end = min(end, times[-1]) if len(times) == most else end
        return _ended(sorted(met for met in touched if met[0] <= end), end, most, stack)


class WideRay:
    """A ray with a radius, half of its width, relative to the pixel on which it begins, in 1/256 px."""

    def __init__(self, start: Pair, step: Pair, radius: int) -> None:
        self.start, self.step, self.reach = start, step, max(radius, HALF)
        self.lines = Lines(np.array([start]), np.array([step]), radius)

    def times(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Bounds of the times at which the ray enters cells of boxes (n, 4); leave < entry if it touches none."""
        return times_in(self.lines, np.zeros(len(boxes_xyxy), np.int64), boxes_xyxy)

    def passed(self, origin: Pair, near: Entered, stack: Stack, most: int | None) -> Passed | None:
        """What the ray hits, up to `most` objects; None if the raycast of a batch must decide it.

        It does so if the ray may end long before it meets all boxes, and as it does for thin rays; see `Ray.passed`.
        """
        if most is not None and len(near.rank) > ROUND_PAIRS:
            return None
        first = first_cells(Crossed(np.zeros_like(near.rank), *near), self.lines, np.array([origin]), stack)
        end, times = NEVER, first.entry
        if stack.has_occluders:
            blocks = stack.occluder[first.rank]
            end, times = int(times[blocks].min(initial=NEVER)), times[~blocks]
        if most is not None and len(times) >= most:
            end = min(end, int(np.partition(times, most - 1)[most - 1]))
        reached = (first.entry <= end).nonzero()[0]
        columns = first.entry, first.y, first.x, first.rank, first.count, first.most
        touched = zip(*(column[reached].tolist() for column in columns), strict=True)
        return _ended(sorted(touched), end, most, stack)


def _near(ray: Ray | WideRay, origin: Pair, stack: Stack, bounds: Box | None, accepts: Bools | None) -> Entered:
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


Cell = tuple[int, int, int]
"""When a ray enters a cell, and the cell's y and x."""


def _runs(
    ray: Ray, origin: Pair, box: list[int], rows: range, stack: Stack, rank: int
) -> Iterator[tuple[int, int, bytes]]:
    """The cells of an item's mask that a ray touches: row, first cell along the longer axis, and one byte for each."""
    major, (left, top) = ray.major, (stack.box_xyxy[rank, :2] - origin).tolist()
    width, corner = int(stack.width[rank]), int(stack.offset[rank])
    step = width if major else 1
    for row in rows:
        first, last = ray.run(row)
        first, last = max(first, box[major]), min(last, box[major + 2])
        if first <= last:
            begin = corner + ((first - top) * width + row - left if major else (row - top) * width + first - left)
            yield row, first, stack.masks[begin : begin + (last - first) * step + 1 : step].tobytes()


def _entered(ray: Ray, row: int, at: int) -> Cell:
    """A cell of a row, and when a ray enters it."""
    x, y = (row, at) if ray.major else (at, row)
    return ray.spell(x, y)[0], y, x


def _ended(touched: list[Touch], end: int, most: int | None, stack: Stack) -> Passed | None:
    """What a ray hit before its end, of what it touched until then, in order."""
    at_end = [rank for time, _, _, rank, _, _ in touched if time == end]
    blocked = bool(at_end) and stack.has_occluders and bool(stack.occluder[at_end].any())
    hits = touched[:-1] if blocked else touched[:most]
    passed = hits if blocked else hits[:-1]  # if one of them was entered as the ray ends, it is not left before
    if at_end and any(leave >= end for *_, leave in passed):
        return None
    rows = [[rank, count, x, y, time] for time, y, x, rank, count, _ in hits]
    if not at_end:
        return end, rows, None
    if not blocked:
        rows[-1][1] = 1
    return end, rows, touched[-1] if blocked else hits[-1]


def _cells(runs: Iterator[tuple[int, int, bytes]], ray: Ray, every: bool) -> tuple[int, Cell | None]:
    """Number of cells that are set in runs, unless only the first is looked for, and the first of them."""
    count, rows_met, ahead = 0, 0, 1 if ray.step[ray.major] > 0 else -1
    found: list[Cell] = []
    for row, first, run in runs:
        cells = run.count(1)
        count, rows_met = count + cells, rows_met + (cells > 0)
        if cells and rows_met <= 2:  # through a corner it enters two cells of a row, and of the next, at once
            at = run.find(1) if ahead > 0 else run.rfind(1)
            found += [_entered(ray, row, first + k) for k in (at, at + ahead) if 0 <= k < len(run) and run[k] == 1]
        elif found and not every:
            break
    return count, min(found, default=None)
