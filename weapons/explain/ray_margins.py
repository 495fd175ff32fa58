"""Margins of rays: the shortest common shifts of all rays of a shot that make them touch an object, or leave it.

The shifts for which a segment touches a pixel square form a hexagon, the square swept along the segment. The shifts for
which a thick segment covers a pixel centre form a capsule. Their edges are computed from whole numbers and lie within a
few px, so floats decide on which side of an edge a shift is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Set
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints
from hitplanes.planes.common.limits import HALF, MARGIN_PX, SUB
from hitplanes.planes.grid.rasterize import DIAGONAL
from hitplanes.planes.grid.spans import Spans, each_pixel, meets
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.volumes.polygons import EDGES, ConvexUnion, escape_distance

from ..fire.plan import Plan
from ..fire.prefilter import refused
from ..kinds.rays import Laser, Projectile, RayWeapon
from ..rays.contacts import Reason, Terminations, terminations_of
from .ray_samples import RayDetail, gap, squares
from .samples import Margin, spans_of

RAYS_MAX = 1024  # most rays of a shot that has margins; all rays are handled at once, and so many take some seconds
NEARLY = 2.0**-20  # distance of a pixel centre from the rim of a thick ray, px, below which integers compute it
TINY = float(np.nextafter(0, 1))  # distance of an object that is not touched but whose distance rounds to 0

Shift = tuple[float, float]


class Runs(NamedTuple):
    """Runs of pixels of an object, relative to the pixel of a ray's start."""

    y: Ints
    x_first: Ints
    x_last: Ints

    def take(self, rows: Ints | Bools) -> Runs:
        """Runs by their numbers or by a mask."""
        return Runs(self.y[rows], self.x_first[rows], self.x_last[rows])

    @property
    def squares(self) -> tuple[Ints, Ints]:
        """Least and greatest corners (n, 2) of the runs as rectangles, 1/256 px."""
        low = np.stack([SUB * self.x_first - HALF, SUB * self.y - HALF], axis=1)
        return low, np.stack([SUB * self.x_last + HALF, SUB * self.y + HALF], axis=1)


@dataclass(frozen=True, eq=False)
class Way:
    """Walked segment of a ray relative to the motion of an item, from the pixel of the ray's start; 1/256 px."""

    begin: Ints  # (2,)
    end: Ints  # (2,) whole part of the end
    part: Floats  # (2,) fractional part of the end, in [0, 1)
    step: Ints  # (2,) vector of the whole ray
    radius: int  # half of the width

    @cached_property
    def ray(self) -> float:
        """Length of the whole ray."""
        return math.sqrt(int((self.step**2).sum()))

    @cached_property
    def length(self) -> float:
        """Length of the segment."""
        if not self.ray:
            return 0.0
        return float((((self.end - self.begin) + self.part) * (self.step / self.ray)).sum())

    @cached_property
    def across(self) -> Floats:
        """Direction in which `cross` grows; (0, 0) for a ray of no length."""
        dx, dy = self.step.tolist()
        return np.array([dy, -dx]) / (self.ray or 1.0)

    def cross(self, x: Ints, y: Ints) -> Ints:
        """Signed distance of points from the line of the ray, times its length."""
        return np.asarray((x - self.begin[0]) * self.step[1] - (y - self.begin[1]) * self.step[0])

    def along(self, x: Ints, y: Ints) -> Floats:
        """Distance of points along the ray."""
        u = (x - self.begin[0]) * self.step[0] + (y - self.begin[1]) * self.step[1]
        return np.asarray(u / (self.ray or 1.0))

    def from_end(self, place: Ints, axis: int) -> Floats:
        """Coordinates on an axis minus that of the end."""
        return np.asarray((place - self.end[axis]) - self.part[axis])

    def wide(self, cross: Ints, side: int) -> Floats:
        """Sideways shifts after which centres at `cross` lie on the rim of the ray, on the given side (-1 or 1)."""
        far = side * cross / self.ray + self.radius
        for row in np.flatnonzero(np.abs(far) < NEARLY * SUB).tolist():
            times = side * int(cross[row])  # radius^2 - (cross / length)^2, times length^2, is whole
            over = self.radius**2 * int((self.step**2).sum()) - times**2
            far[row] = over / (self.ray * (self.ray * self.radius - times))
        return np.asarray(far)


def has_ray_margins(ray: RayWeapon, rays: int) -> bool:
    """Whether a shot of so many rays has margins."""
    return rays <= RAYS_MAX and not (isinstance(ray, Projectile) and ray.steps is not None)


def ray_margins(detail: RayDetail, scene: Scene, ray: RayWeapon, shot: int, hit: Set[int]) -> list[Margin]:
    """Margins of the accepted objects within MARGIN_PX of the rays of one shot, by object.

    The margin of an object that was hit is the shortest shift after which no ray touches it; the rays go as far as they
    would if no object ended them. The margin of an object that was not hit is the shortest shift after which a ray
    touches it; the rays end where they did. An object in which rays start, and which they ignore, has no margin. The
    shot has a number, and hit the objects of some ids.

    An InputError says if the weapon is a projectile tested in steps, or if there are too many rays.
    """
    if isinstance(ray, Projectile) and ray.steps is not None:
        raise InputError(f"hits: expected those of a ray or of a projectile without steps, got steps={ray.steps}")
    if len(detail.rays) > RAYS_MAX:
        raise InputError(f"shot: expected one of at most {RAYS_MAX} rays, got {len(detail.rays)}")
    stack = detail.stack
    none = np.zeros(len(stack), np.int64)
    accepted = ~stack.occluder & ~refused(stack, np.arange(len(stack)), detail.shots, none)
    if detail.ignores:
        accepted[detail.every.rank[detail.entered == 0]] = False
    open_ends = terminations_of(detail.met, detail.lines, stack, none, Laser(None), Plan())
    touched = _touched(detail)
    velocity = scene.items.velocity_256[stack.rows] * isinstance(ray, Projectile)
    found = []
    for rank, rows in _passed(detail, np.flatnonzero(accepted), velocity).items():
        item = int(stack.ids[rank])
        near = list(_near(detail, rank, rows, open_ends if item in hit else detail.ends, velocity[rank]))
        still = (0.0, 0.0) if rank in touched else None
        shift = _left(near) if item in hit else still or _met(near)
        if shift is not None:
            length = math.sqrt(shift[0] ** 2 + shift[1] ** 2)
            length = TINY if not length and item not in hit and rank not in touched else length
            found.append(Margin(shot, item, item in hit, length, shift))
    return sorted(margin for margin in found if margin.distance <= MARGIN_PX)


def _passed(detail: RayDetail, ranks: Ints, velocity: Ints) -> dict[int, list[int]]:
    """Rays whose whole length may come near an item, by the rank of the item."""
    rays, lines = detail.rays, detail.lines
    reach = MARGIN_PX + 1 + lines.radius / SUB
    found: dict[int, list[int]] = {}
    for row in range(len(rays)):
        near = ranks
        if not velocity.any():
            begin = lines.start[row] / SUB
            boxes = squares(detail.stack.box_xyxy[ranks], rays.origin_xy[row])
            near = ranks[gap(begin, begin + lines.step[row] / SUB, boxes)[0] <= reach]
        for rank in near.tolist():
            found.setdefault(rank, []).append(row)
    return found


def _touched(detail: RayDetail) -> set[int]:
    """Ranks of the items that the rays touch up to their ends, from the exact times of the walk."""
    met, ends = detail.met, detail.ends
    last = ends.last_whole(detail.lines.scale)
    pair = met.pair[met.entry <= last[met.ray[met.pair]]]
    return set(met.rank[pair].tolist())


def _near(
    detail: RayDetail, rank: int, rows: list[int], ends: Terminations, velocity: Ints
) -> Iterator[tuple[Way, Runs]]:
    """Rays that have runs of an item near them, each up to its end, with these runs."""
    stack, bounds, rays = detail.stack, detail.bounds, detail.rays
    box = stack.box_xyxy[rank]
    spans: Spans | None = None
    for row in rows:
        way = _way(detail, row, ends, velocity)
        origin = rays.origin_xy[row]
        reach = MARGIN_PX + 2 + way.radius // SUB
        low = np.minimum(way.begin, way.end) // SUB - reach + origin
        high = np.maximum(way.begin, way.end) // SUB + reach + 1 + origin
        if not meets(np.concatenate([low, high]), box):
            continue
        if spans is None:
            spans = spans_of(stack, rank)
        x_first, x_last, y = spans.x_first, spans.x_last, spans.y
        if bounds is not None:
            low, high = np.maximum(low, bounds[:2]), np.minimum(high, bounds[2:])
        kept = np.flatnonzero((y >= low[1]) & (y <= high[1]) & (x_first <= high[0]) & (x_last >= low[0]))
        x_first, x_last = np.maximum(x_first[kept], low[0]), np.minimum(x_last[kept], high[0])
        runs = _beside(way, Runs(y[kept] - origin[1], x_first - origin[0], x_last - origin[0]))
        if len(runs.y):
            yield way, runs


def _way(detail: RayDetail, row: int, ends: Terminations, velocity: Ints) -> Way:
    """Segment of a ray up to its end, relative to an item of the given velocity."""
    lines = detail.lines
    step = lines.step[row] - velocity
    time, scale = 1, 1
    if ends.reason[row] == Reason.BUDGET:
        time, scale = float(ends.fraction[row]).as_integer_ratio()
    elif ends.reason[row] != Reason.RANGE:
        time, scale = int(ends.time[row]), int(lines.scale[row])
    both = [divmod(int(a) * scale + int(d) * time, scale) for a, d in zip(lines.start[row], step, strict=True)]
    part = np.minimum([rest / scale for _, rest in both], 1 - 2.0**-53)
    return Way(lines.start[row], np.array([whole for whole, _ in both]), part, step, lines.radius)


def _beside(way: Way, runs: Runs) -> Runs:
    """Runs cut to a strip around the ray's line, a little too wide."""
    dx, dy = way.step.tolist()
    if not dy:
        return runs
    ahead = way.begin[0] + (SUB * runs.y - way.begin[1]) * (dx / dy)
    reach = ((MARGIN_PX + 2) * SUB + way.radius) * (way.ray / abs(dy))
    first = np.maximum(runs.x_first, np.floor((ahead - reach) / SUB).astype(np.int64))
    last = np.minimum(runs.x_last, np.ceil((ahead + reach) / SUB).astype(np.int64))
    return Runs(runs.y, first, last).take(first <= last)


# Touching


def _met(near: list[tuple[Way, Runs]]) -> Shift | None:
    """Shortest shift after which any segment touches any of its runs; the first by (y, x) of several."""
    found = [_to_squares(way, runs) for way, runs in near]
    found += [_to_centres(way, runs) for way, runs in near if way.radius]
    if not found:
        return None
    shifts = np.concatenate(found) / SUB
    best = np.lexsort((shifts[:, 0], shifts[:, 1], (shifts**2).sum(axis=1)))[0]
    return float(shifts[best, 0]) + 0.0, float(shifts[best, 1]) + 0.0


def _to_squares(way: Way, runs: Runs) -> Floats:
    """Shifts (n, 2) after which a segment touches rectangles, with the shortest for each of them; 1/256 px."""
    low, high = runs.squares
    ends = [np.maximum(low - way.begin, 0) + np.minimum(high - way.begin, 0.0)]
    beyond, before = ((corner - way.end) - way.part for corner in (low, high))
    ends.append(np.maximum(beyond, 0) + np.minimum(before, 0))
    corners = [(x, y) for x in (low[:, 0], high[:, 0]) for y in (low[:, 1], high[:, 1])]
    cross = np.stack([way.cross(x, y) for x, y in corners])
    for (x, y), aside in zip(corners, cross, strict=True):
        along = way.along(x, y)
        beside = (along > 0) & (along < way.length)  # these may be shifted at right angles to the segment
        ends.append((aside / (way.ray or 1.0))[beside, None] * way.across)
    least, most = (np.minimum(way.begin, way.end), np.maximum(way.begin, way.end + way.part))
    crossed = ((least <= high) & (most >= low)).all(axis=1) & (cross.min(axis=0) <= 0) & (cross.max(axis=0) >= 0)
    ends.append(np.zeros((int(crossed.sum()), 2)))
    return np.concatenate(ends)


def _to_centres(way: Way, runs: Runs) -> Floats:
    """Shifts after which a thick segment covers centres of runs, with the shortest for each run; 1/256 px.

    Along a row the distance from a segment falls and then rises. It is least where the segment crosses the row, beside
    an end of the segment, or at an end of the run.
    """
    dx, dy = way.step.tolist()
    turns = [np.full(len(runs.y), way.begin[0]), np.full(len(runs.y), way.end[0])]
    if dy:
        turns.append(way.begin[0] + (SUB * runs.y - way.begin[1]) * (dx / dy))
        # the columns of both ends, and the column in which the line crosses the row
    columns = [np.clip((turn // SUB).astype(np.int64) + k, runs.x_first, runs.x_last) for turn in turns for k in (0, 1)]
    x, y = np.concatenate([runs.x_first, runs.x_last, *columns]) * SUB, np.tile(runs.y * SUB, 2 + len(columns))
    begin = np.stack([x, y], axis=1) - way.begin
    end = np.stack([way.from_end(x, 0), way.from_end(y, 1)], axis=1)
    along = way.along(x, y)
    middle = (way.cross(x, y) / (way.ray or 1.0))[:, None] * way.across
    beside = (along > 0) & (along < way.length)
    apart = np.where(beside[:, None], middle, np.where((along <= 0)[:, None], begin, end))
    distance = np.sqrt((apart**2).sum(axis=1))[:, None]
    return np.asarray(apart * (np.maximum(distance - way.radius, 0) / np.maximum(distance, 1)))


# Leaving


def _left(near: list[tuple[Way, Runs]]) -> Shift | None:
    """Shortest shift after which no segment touches its runs; None if there is none within MARGIN_PX."""
    if not near:
        return None
    polygons: list[tuple[Floats, Floats]] = []
    circles: list[Floats] = [np.zeros((0, 2))]
    for way, runs in near:
        slabs, rest = _slabs(way, runs)
        if ((slabs[:, 0] <= -MARGIN_PX * SUB) & (slabs[:, 1] >= MARGIN_PX * SUB)).any():
            return None
        polygons.append(_polygons([(way.across, slabs[:, 1]), (-way.across, -slabs[:, 0])]))
        rest = _outside(way, rest, slabs)
        if way.radius < DIAGONAL:
            polygons.append(_hexagons(way, rest))
        if way.radius:
            bodies, discs = _capsules(way, rest)
            polygons.append(bodies)
            circles.append(discs)
    normal, offset = (np.concatenate(column) for column in zip(*polygons, strict=True))
    radius = near[0][0].radius / SUB
    return escape_distance(ConvexUnion(normal, offset / SUB, np.concatenate(circles) / SUB, radius), MARGIN_PX)


def _polygons(edges: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Polygons of edges; each edge is a normal, the same for all polygons, and the offsets (n,)."""
    n = len(edges[0][1])
    normal, offset = np.zeros((n, EDGES, 2)), np.full((n, EDGES), np.inf)
    for place, (way_out, far) in enumerate(edges):
        normal[:, place], offset[:, place] = way_out, far
    return normal, offset


def _sides(way: Way, runs: Runs) -> tuple[Floats, Floats]:
    """Least and greatest sideways shift for which the infinite line of the ray touches each run."""
    low, high = runs.squares
    dx, dy = way.step.tolist()
    least = way.cross(low[:, 0] if dy >= 0 else high[:, 0], high[:, 1] if dx >= 0 else low[:, 1])
    most = way.cross(high[:, 0] if dy >= 0 else low[:, 0], low[:, 1] if dx >= 0 else high[:, 1])
    first, last = least / way.ray, most / way.ray
    if way.radius:
        x, y = np.stack([runs.x_first, runs.x_last]) * SUB, runs.y * SUB
        cross = np.stack([way.cross(x[0], y), way.cross(x[1], y)])
        first = np.minimum(first, -way.wide(cross.min(axis=0), -1))
        last = np.maximum(last, way.wide(cross.max(axis=0), 1))
    return first, last


def _slabs(way: Way, runs: Runs) -> tuple[Floats, Runs]:
    """Intervals (n, 2) of sideways shifts for which a ray touches runs far from both of its ends; and other runs."""
    if not way.ray:
        return np.zeros((0, 2)), runs
    low, high = runs.squares
    corners = np.stack([way.along(x, y) for x in (low[:, 0], high[:, 0]) for y in (low[:, 1], high[:, 1])])
    reach = MARGIN_PX * SUB + 1
    passed = (corners.min(axis=0) >= reach) & (corners.max(axis=0) <= way.length - reach)
    first, last = _sides(way, runs.take(passed))
    order = np.argsort(first, kind="stable")
    first, last = first[order], np.maximum.accumulate(last[order])
    begins = np.flatnonzero(np.concatenate([[True], first[1:] > last[:-1]])[: len(first)])
    slabs = np.stack([first[begins], last[np.append(begins[1:], len(first))[: len(begins)] - 1]], axis=1)
    return slabs, runs.take(~passed)


def _outside(way: Way, runs: Runs, slabs: Floats) -> Runs:
    """Runs whose sideways shifts are not wholly inside a slab."""
    if not len(slabs):
        return runs
    first, last = _sides(way, runs)
    slab = np.searchsorted(slabs[:, 0], first, side="right") - 1
    return runs.take((slab < 0) | (last > slabs[np.maximum(slab, 0), 1]))


def _hexagons(way: Way, runs: Runs) -> tuple[Floats, Floats]:
    """Polygons of the shifts for which a segment touches rectangles."""
    low, high = runs.squares
    edges: list[tuple[Floats, Floats]] = []
    for axis in (0, 1):
        out = np.eye(2)[axis]
        edges.append((out, np.maximum(high[:, axis] - way.begin[axis], way.from_end(high[:, axis], axis))))
        edges.append((-out, -np.minimum(low[:, axis] - way.begin[axis], way.from_end(low[:, axis], axis))))
    if way.ray:
        thin = Way(way.begin, way.end, way.part, way.step, 0)
        first, last = _sides(thin, runs)
        edges += [(way.across, last), (-way.across, -first)]
    return _polygons(edges)


def _capsules(way: Way, runs: Runs) -> tuple[tuple[Floats, Floats], Floats]:
    """Capsules of the shifts for which a thick segment covers centres: bodies, and centres of the discs at the ends."""
    run, x = each_pixel(runs.x_first, runs.x_last)
    x, y = SUB * x, SUB * runs.y[run]
    begin = np.stack([x, y], axis=1) - way.begin
    if not way.ray:
        return _polygons([(way.across, np.zeros(0))]), begin.astype(np.float64)
    cross, along = way.cross(x, y), way.along(x, y)
    ahead = way.step / way.ray
    sides = [(way.across, way.wide(cross, 1)), (-way.across, way.wide(cross, -1))]
    bodies = _polygons([*sides, (ahead, along), (-ahead, way.length - along)])
    end = np.stack([way.from_end(x, 0), way.from_end(y, 1)], axis=1)
    return bodies, np.concatenate([begin.astype(np.float64), end])
