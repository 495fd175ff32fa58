"""Explanations of shots of ray weapons: cells in the order of the walk, blockers, why not, and the nearest miss."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import NamedTuple

import numpy as np

from hitplanes.planes.bits.span_walk import Verdict
from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints
from hitplanes.planes.common.limits import DETAIL_SAMPLES_MAX, NEAR_PX, SUB
from hitplanes.planes.grid.rasterize import Lines, cells_of
from hitplanes.planes.grid.spans import Box, Spans, clipped, meets, pieces, slabs
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.plan import Plan
from ..fire.prefilter import Candidates, refused
from ..kinds.areas import RayParts
from ..kinds.placements import Shots
from ..rays.contacts import Contacts, Rays, Reason, Terminations, cells_hit, rays_of, steps_of
from ..rays.ray_walk import Range, touching, trace
from .samples import Behind, Blocked, Samples, WhyNot, pixels_in, unmet

REACH_BITS = 23  # of a coordinate of a cell: cells lie within 2**22 px of their ray's origin; x, y and ray fit int64
CELLS_AT_ONCE = 2**19  # cells of rays counted at a time: 4 MB for each of their columns


class Miss(NamedTuple):
    """The object that rays came nearest to without a hit.

    `distance` is the distance, px, from the walked part of the rays, with their width, to the object's pixel squares;
    `ray_xy` and `object_xy` are the nearest points.
    """

    object: int
    round: int
    pellet: int
    distance: float
    ray_xy: tuple[float, float]
    object_xy: tuple[float, float]


def key_of_cells(ray: Ints, x: Ints, y: Ints) -> Ints:
    """One number for each cell of each ray; cells are given relative to the pixels of their rays' starts."""
    half = 1 << (REACH_BITS - 1)
    return np.asarray((((ray << REACH_BITS) + y + half) << REACH_BITS) + x + half)


def _places(keys: Ints, wanted: Ints) -> tuple[Ints, Ints]:
    """Indices of the wanted cells among sorted keys, and their places among the wanted ones.

    A moving item may put cells beside a projectile's own path; they are left out.
    """
    at = np.searchsorted(keys, wanted)
    found = np.flatnonzero(np.append(keys, -1)[at] == wanted)
    return at[found], found


@dataclass(frozen=True, eq=False)
class RayDetail:
    """Cells of rays, with all that decides their verdicts."""

    stack: Stack
    bounds: Box | None
    shots: Shots
    rays: Rays
    lines: Lines
    ends: Terminations  # of the rays
    met: Contacts  # contacts with accepted items, up to the ends and some beyond
    every: Contacts  # contacts of the whole length of rays with any item, also out of bounds
    scale: Ints  # denominator of the times of each pair of `every`
    in_steps: bool  # whether the rays are tested at some moments only
    ignores: bool  # whether the rays ignore items in which they start

    @cached_property
    def walked(self) -> Contacts:
        """Contacts in which rays hit objects."""
        return cells_hit(self.met, self.ends, self.stack)

    @cached_property
    def entered(self) -> Floats:
        """Time of the first cell of each pair of `every`, as a fraction of the ray."""
        return np.asarray(self.every.entry[self.every.first] / self.scale)

    @cached_property
    def touched(self) -> Ints:
        """Ranks of the items that rays touch within the bounds, before their ends."""
        every = self.every
        pair, ray = every.pair, every.ray[every.pair]
        before = every.entry / self.scale[pair] <= self.ends.fraction[ray]
        if self.bounds is not None:
            xy = np.stack([every.x, every.y], axis=1) + self.rays.origin_xy[ray]
            before &= ((xy >= self.bounds[:2]) & (xy <= self.bounds[2:])).all(axis=1)
        return np.unique(every.rank[pair[before]])

    @cached_property
    def refuses(self) -> Bools:
        """Mask of the pairs of `every` that the filter refuses."""
        return refused(self.stack, self.every.rank, self.shots, self.rays.shot[self.every.ray])

    @cached_property
    def cells(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Every cell as (ray, pixel (K, 2), verdict, rank of what decided it), in the order of the walk."""
        ray, xy, entry, verdict, rank, blocked = self._decided()
        order = np.lexsort((xy[:, 0], xy[:, 1], ~blocked, entry, ray))
        return ray[order], xy[order], verdict[order], rank[order]

    def _decided(self) -> tuple[Ints, Ints, Ints, Ints, Ints, Bools]:
        """Every cell in any order, with its time of entry, and whether an accepted occluder lies there."""
        rays, most = self.rays, int(_cells_most(self.rays, self.lines.radius).sum())
        if most > DETAIL_SAMPLES_MAX:
            raise InputError(f"samples: expected a shot of at most {DETAIL_SAMPLES_MAX} to tell one by one, got {most}")
        ray, xy, entry, _, scale = cells_of(rays.start_256, rays.start_256 + rays.step_256, self.lines.radius)
        keys = key_of_cells(ray, *(xy - rays.origin_xy[ray]).T)
        order = np.argsort(keys)
        keys, ray, xy, entry = keys[order], ray[order], xy[order], entry[order]
        at = xy - rays.origin_xy[ray]
        verdict, rank = self._met(keys)
        if (scale != self.lines.scale).any():  # times of a projectile are fractions of the frame
            beyond = np.asarray(entry / scale[ray] > self.ends.fraction[ray])
        else:
            beyond = ~self.ends.reaches(ray, entry, at[:, 1], at[:, 0])
        verdict[beyond], rank[beyond] = Verdict.BEYOND, -1
        if self.bounds is not None:
            outside = ((xy < self.bounds[:2]) | (xy > self.bounds[2:])).any(axis=1)
            verdict[outside], rank[outside] = Verdict.OUTSIDE, -1
        blocked = np.zeros(len(ray), np.bool_)
        walls = self.met.take(np.flatnonzero(self.stack.occluder[self.met.rank]))
        blocked[_places(keys, key_of_cells(walls.ray[walls.pair], walls.x, walls.y))[0]] = True
        return ray, xy, entry, verdict, rank, blocked

    def _met(self, keys: Ints) -> tuple[Ints, Ints]:
        """Verdict of each cell, and the rank of the item that decided it; the front-most of several counts."""
        verdict, rank = np.full(len(keys), Verdict.EMPTY, np.int64), np.full(len(keys), -1)
        skipped = self.every.take(np.flatnonzero(self.refuses | (not self.in_steps)))
        stopped, ends = np.flatnonzero(self.ends.reason == Reason.OCCLUDER), self.ends
        at_stops = stopped, ends.x[stopped], ends.y[stopped], ends.rank[stopped]
        for kind, (ray, x, y, item) in (
            (Verdict.FILTERED, _back_to_front(skipped)),
            (Verdict.OCCLUDED, at_stops),
            (Verdict.HIT, _back_to_front(self.walked)),
        ):
            cell, found = _places(keys, key_of_cells(ray, x, y))
            verdict[cell], rank[cell] = kind, item[found]
        return verdict, rank

    def samples(self) -> Samples:
        """Cells as samples."""
        ray, xy, verdict, rank = self.cells
        items = np.append(self.stack.ids, -1)[rank]
        return Samples(xy, self.rays.round[ray], self.rays.pellet[ray], verdict, items, np.zeros(len(xy), np.bool_))

    def counts(self) -> Ints:
        """Number of cells (N, 6) of each shot by verdict."""
        ray, _, _, verdict, _, _ = self._decided()
        n = len(Verdict)
        column = self.rays.shot[ray] * n + verdict
        return np.bincount(column, minlength=len(self.shots) * n).reshape(-1, n)


def _back_to_front(met: Contacts) -> tuple[Ints, Ints, Ints, Ints]:
    """Cells as (ray, x, y, rank), sorted so that the front-most items come last."""
    order = np.argsort(-met.rank[met.pair], kind="stable")
    pair = met.pair[order]
    return met.ray[pair], met.x[order], met.y[order], met.rank[pair]


def ray_detail(scene: Scene, parts: RayParts, shots: Shots) -> RayDetail:
    """Walk shots cell by cell."""
    stack, rays = scene.items.stack(), rays_of(parts, shots)
    through = Range(scene.items, stack, scene.bounds, Candidates(scene.items, stack), Plan(), whole=True)
    met, ends, lines, _ = trace(rays, parts[2], shots, through)
    every, relative = touching(rays, parts[2], through)
    rules = steps_of(parts[2]) is not None, parts[2].inside == "ignore_until_exit"
    return RayDetail(stack, scene.bounds, shots, rays, lines, ends, met, every, relative.scale, *rules)


def counted_verdicts(scene_of: Callable[[int], Scene], parts: RayParts, shots: Shots) -> Ints:
    """Number of cells (N, 6) of shots by verdict, each at the scene that it was fired at; many are walked at a time."""
    counts = [np.zeros((0, len(Verdict)), np.int64)]
    rays = rays_of(parts, shots)
    each = np.bincount(rays.shot, _cells_most(rays, parts[2].radius_256), len(shots)).astype(np.int64)
    for part in pieces(each, CELLS_AT_ONCE):
        for _, same in groupby(range(part.start, part.stop), lambda shot: id(scene_of(shot))):
            numbers = list(same)
            chunk = shots.take(numbers[0], numbers[-1] + 1)
            counts.append(ray_detail(scene_of(numbers[0]), parts, chunk).counts())
    return np.concatenate(counts)


def _cells_most(rays: Rays, radius_256: int) -> Ints:
    """Bounds (R,) on the number of cells of rays."""
    wide = 2 * (radius_256 // SUB) + 3
    return np.asarray((np.abs(rays.step_256).sum(axis=1) // SUB + wide) * wide)


def pixels_of_rays(detail: RayDetail) -> dict[tuple[int, int], Spans]:
    """Distinct pixels that each round hit of each object, as {(round, object): pixels}."""
    met, found = detail.walked, {}
    xy = np.stack([met.x, met.y], axis=1) + detail.rays.origin_xy[met.ray[met.pair]]
    round_, item = detail.rays.round[met.ray], detail.stack.ids[met.rank]
    for key in dict.fromkeys(zip(round_.tolist(), item.tolist(), strict=True)):
        x, y = xy[((round_ == key[0]) & (item == key[1]))[met.pair]].T
        found[key] = Spans.from_runs(y, x, x)
    return found


def object_cells(scene: Scene, parts: RayParts, shots: Shots) -> Iterator[tuple[int, Spans]]:
    """Pixels that shots hit, as (object, pixels); many shots are walked at a time."""
    rays = rays_of(parts, shots)
    each = np.bincount(rays.shot, _cells_most(rays, parts[2].radius_256), len(shots)).astype(np.int64)
    for part in pieces(each, CELLS_AT_ONCE):
        found = pixels_of_rays(ray_detail(scene, parts, shots.take(part.start, part.stop)))
        yield from ((item, spans) for (_, item), spans in found.items())


def blocked_rays(detail: RayDetail) -> list[Blocked]:
    """Occluders that ended rays, by falling number of rays, then by id, with the objects behind them."""
    stack, ends = detail.stack, detail.ends
    by = np.where(ends.reason == Reason.OCCLUDER, ends.rank, -1)
    met = detail.every
    walked = set(zip(detail.walked.ray.tolist(), detail.walked.rank.tolist(), strict=True))
    behind: dict[int, dict[int, list[int]]] = {}
    for pair in np.flatnonzero(~stack.occluder[met.rank] & ~detail.refuses & (by[met.ray] >= 0)).tolist():
        ray, rank = int(met.ray[pair]), int(met.rank[pair])
        if (ray, rank) not in walked:
            behind.setdefault(int(by[ray]), {}).setdefault(rank, []).append(pair)
    found = [
        Blocked(
            int(stack.ids[rank]), count,
            tuple(sorted((_behind(detail, *one) for one in behind.get(rank, {}).items()), key=lambda b: b.object)),
        )
        for rank, count in zip(*(v.tolist() for v in np.unique(by[by >= 0], return_counts=True)), strict=True)
    ]  # fmt: skip
    return sorted(found, key=lambda b: (-b.samples, b.occluder))


def _behind(detail: RayDetail, rank: int, pairs: list[int]) -> Behind:
    met = detail.every
    first = met.first[pairs[0]]
    x, y = (np.array([met.x[first], met.y[first]]) + detail.rays.origin_xy[met.ray[pairs[0]]]).tolist()
    return Behind(int(detail.stack.ids[rank]), int(met.count[pairs].sum()), (x, y))


def ray_why_not(detail: RayDetail, hit: Set[int]) -> list[WhyNot]:
    """Objects that rays did not hit, on their whole length or within NEAR_PX of the walked part, nearest first."""
    stack, met = detail.stack, detail.every
    objects = [r for r in np.flatnonzero(~stack.occluder).tolist() if int(stack.ids[r]) not in hit]
    touched = np.bincount(met.rank, met.count, len(stack)).astype(np.int64)
    box, bounds = stack.box_xyxy, detail.bounds
    cut = np.zeros(len(stack), np.bool_) if bounds is None else (clipped(box, bounds) != box).any(axis=1)
    beside = [rank for rank in objects if not touched[rank]]
    near = {rank: gap[0] for rank, gap in _gaps(detail, beside, None, NEAR_PX).items()}
    near |= {rank: 0.0 for rank in objects if touched[rank]}
    outside = {rank for rank in near if cut[rank] and not len(pixels_in(stack, rank, bounds))}
    partly = {rank for rank in near if cut[rank] and not touched[rank]} - outside
    near = {rank: distance for rank, distance in near.items() if rank not in partly}
    near |= {rank: gap[0] for rank, gap in _gaps(detail, sorted(partly), bounds, NEAR_PX).items()}
    found = [_why(detail, rank, int(touched[rank]), distance, rank in outside) for rank, distance in near.items()]
    return sorted(found, key=lambda w: (w.distance, w.object))


def _why(detail: RayDetail, rank: int, samples: int, distance: float, out_of_bounds: bool) -> WhyNot:
    stack, ends = detail.stack, detail.ends
    item = int(stack.ids[rank])
    reason = unmet(stack, detail.shots, rank, samples, out_of_bounds)
    if reason is not None:
        return WhyNot(item, reason, samples, {}, distance)
    pairs = np.flatnonzero(detail.every.rank == rank)
    rays, by = detail.every.ray[pairs], {}
    if not (detail.entered[pairs] < ends.fraction[rays]).any():
        enders, counts = np.unique(stack.ids[ends.rank[rays[ends.rank[rays] >= 0]]], return_counts=True)
        by = dict(zip(enders.tolist(), counts.tolist(), strict=True))
        spent = bool((ends.reason[rays] == Reason.BUDGET).any())  # a budget of 0: no item ended the ray
        reason = "behind" if by else "budget" if spent else "outside"
    elif detail.ignores and (detail.entered[pairs] == 0).any():
        reason = "inside"
    else:
        reason = "tunnelled" if detail.in_steps else "outside"
    return WhyNot(item, reason, samples, by, distance)


def nearest_miss(detail: RayDetail, hit: Set[int]) -> Miss | None:
    """Accepted object nearest to the walked part of the rays; the least id of several.

    Objects that the rays touched do not count, nor do other parts of a body that was hit, nor pixels out of bounds.
    """
    stack, rays = detail.stack, detail.rays
    every = np.arange(len(stack))
    passed = ~stack.occluder & ~refused(stack, every, detail.shots, np.zeros(len(stack), np.int64))
    passed[detail.touched] = False
    passed &= ~np.isin(stack.owner, stack.owner[np.isin(stack.ids, list(hit))])
    found = _gaps(detail, np.flatnonzero(passed).tolist(), detail.bounds, None)
    if not found:
        return None
    rank = min(found, key=lambda rank: (found[rank][0], int(stack.ids[rank])))
    distance, ray, from_xy, to_xy = found[rank]
    return Miss(int(stack.ids[rank]), int(rays.round[ray]), int(rays.pellet[ray]), distance, from_xy, to_xy)


Gap = tuple[float, int, tuple[float, float], tuple[float, float]]


def _gaps(detail: RayDetail, objects: list[int], bounds: Box | None, most: float | None) -> dict[int, Gap]:
    """Distances of objects from the walked part of the rays: all within `most` px, or only the nearest.

    Only pixels within `bounds` count. Returned is {rank: (distance, ray, point of the ray, point of the object)}.
    """
    rays, stack = detail.rays, detail.stack
    origin = rays.origin_xy[0]
    begin = (rays.start_256 - SUB * origin) / SUB
    end = begin + detail.ends.fraction[:, None] * (rays.step_256 / SUB)
    wide = detail.lines.radius / SUB
    if bounds is not None:
        objects = np.array(objects, np.int64)[meets(np.array(bounds), stack.box_xyxy[objects])].tolist()
    boxes_xyxy = stack.box_xyxy[objects] if bounds is None else clipped(stack.box_xyxy[objects], bounds)
    boxes = squares(boxes_xyxy, origin)
    least = np.full(len(objects), np.inf)
    for ray in range(len(rays)):
        least = np.minimum(least, gap(begin[ray], end[ray], boxes)[0])
    found: dict[int, Gap] = {}
    limit = math.inf if most is None else most + wide
    for place in np.argsort(least, kind="stable").tolist():
        if least[place] > limit:
            break
        spans = pixels_in(stack, objects[place], bounds)
        if not len(spans):
            continue
        runs = squares(np.stack([spans.x_first, spans.y, spans.x_last, spans.y], axis=1), origin)
        gaps = [gap(begin[ray], end[ray], runs) for ray in range(len(rays))]
        ray = int(np.argmin([distances.min() for distances, _, _ in gaps]))
        nearest = gaps[ray][0].argmin()
        distance, from_xy, to_xy = (column[nearest] for column in gaps[ray])
        if distance <= limit:
            at, to = ((point + origin).tolist() for point in (from_xy, to_xy))
            found[objects[place]] = max(float(distance) - wide, 0.0), ray, (at[0], at[1]), (to[0], to[1])
            limit = distance if most is None else limit
    return found


def squares(boxes_xyxy: Ints, origin: Ints) -> Floats:
    """Boxes of pixels as closed boxes of their pixel squares, relative to an origin."""
    return np.asarray(boxes_xyxy - np.concatenate([origin, origin]) + np.array([-0.5, -0.5, 0.5, 0.5]))


def gap(begin: Floats, end: Floats, boxes_xyxy: Floats) -> tuple[Floats, Floats, Floats]:
    """Distances of a segment from closed boxes (n, 4), and the nearest points (n, 2) of both.

    If they do not cross, one of the points is an end of the segment or a corner of the box.
    """
    low, high = boxes_xyxy[:, :2], boxes_xyxy[:, 2:]
    step = end - begin
    corners = np.stack([low, high, boxes_xyxy[:, [0, 3]], boxes_xyxy[:, [2, 1]]], axis=1)
    along = ((corners - begin) * step).sum(axis=2) / max(float((step**2).sum()), np.finfo(np.float64).tiny)
    on_ray = begin + np.clip(along, 0, 1)[:, :, None] * step
    ends = np.broadcast_to(np.stack([begin, end]), (len(low), 2, 2))
    first, last = np.clip(slabs(begin, step, low, high), 0, 1)
    inside = begin + (first + last)[:, None] / 2 * step  # if the segment crosses the box
    on_ray = np.concatenate([on_ray, ends, inside[:, None]], axis=1)
    on_box = np.clip(on_ray, low[:, None], high[:, None])
    on_box[:, :4] = corners
    distance = np.sqrt(((on_ray - on_box) ** 2).sum(axis=2))
    best = np.argmin(distance, axis=1)
    row = np.arange(len(low))
    return distance[row, best], on_ray[row, best], on_box[row, best]
