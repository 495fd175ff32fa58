"""Hits of rays, the passes of each ray through objects, and the stop of each ray."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints
from hitplanes.planes.common.limits import CHUNK_CELLS, HALF, IDS_MAX, SUB, WEIGHT_FULL
from hitplanes.planes.grid.fixed_point import muldiv, pixel
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import Box, Spans, begins, pieces, row_order, sorted_once
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.hits import HitRow, Hits, Rows
from ..fire.plan import Plan
from ..kinds.areas import RayParts, ray_parts_of
from ..kinds.placements import ShotColumns, Shots
from ..kinds.weapon import Weapon, smoothed
from .contacts import Contacts, Rays, Reason, Terminations, Touches, cells_hit, find_contacts, last_of_each, stretches

if TYPE_CHECKING:
    from ..explain.margins import Margin
    from ..explain.owners import Pellet
    from ..explain.ray_samples import Miss, RayDetail
    from ..explain.samples import Blocked, Samples, Share, WhyNot


SIDE = np.arange(-2, 3)
GRADIENT_XY = np.stack(np.meshgrid(SIDE, SIDE), axis=-1).reshape(-1, 2)
GRADIENT = -GRADIENT_XY * (3 - np.abs(GRADIENT_XY)).prod(axis=1, keepdims=True)
"""Weights (25, 2) of the pixels around one, the nearer the greater; the weighted sum of a mask is its outward normal.
On straight edges and circles its mean error is 4 degrees."""


@dataclass(frozen=True, eq=False)
class Passes(ShotColumns):
    """Passes of rays through objects, sorted by (shot, round, pellet, order).

    Parameters
    ----------
    shot, round, pellet, object : (n,) the ray, and the object
    order : (n,) number of the object among those that the ray hit
    entry_xy, exit_xy : (n, 2) first cell of the object, and the walked cell that the ray leaves last
    entry, exit : (n,) times, as fractions of the ray; of a projectile as fractions of the frame
    entry_px, exit_px : (n,) distances along the ray, px
    material : (n,) length of the ray inside the object's pixel squares, px
    normal_xy : (n, 2) outward normal at the entry, in whole numbers; (0, 0) only if the ray starts inside
    weight : (n,) weight by falloff at the entry, up to 65,535
    point_xy : (n, 2) point of the ray at the entry, px
    samples : (n,) number of cells of the object that the ray walked
    row : (n,) number of the row of the hits that lists the pass
    """

    round: Ints
    pellet: Ints
    object: Ints
    order: Ints
    entry_xy: Ints
    exit_xy: Ints
    entry: Floats
    exit: Floats
    entry_px: Floats
    exit_px: Floats
    material: Floats
    normal_xy: Ints
    weight: Ints
    point_xy: Floats
    samples: Ints
    row: Ints


@dataclass(frozen=True, eq=False)
class Stops(ShotColumns):
    """Stops of rays, where a bullet hole goes, sorted by (shot, round, pellet).

    Parameters
    ----------
    shot, round, pellet : (R,) the ray
    reason : (R,) value of `Reason`: RANGE, OCCLUDER, HITS (the last object that it may hit), BUDGET
    item : (R,) the occluder, or the object in which the ray ended; BUDGET: the object that took the last of it, even if
        the ray leaves it there; -1 for RANGE, and for a budget of 0
    cell_xy : (R, 2) pixel of the stop
    fraction, distance : (R,) fraction of the ray, and distance along it, px
    point_xy : (R, 2) point of the stop, px
    normal_xy : (R, 2) outward normal of the item, in whole numbers; (0, 0) for RANGE and BUDGET
    """

    round: Ints
    pellet: Ints
    reason: Ints
    item: Ints
    cell_xy: Ints
    fraction: Floats
    distance: Floats
    point_xy: Floats
    normal_xy: Ints


@dataclass(frozen=True, eq=False)
class Walk:
    """A chunk of rays that were followed to their ends; their passes and stops are made when they are read."""

    rays: Rays  # (R,)
    lines: Lines  # (R,) of the rays
    hit: Touches  # with the objects that they hit
    ends: Terminations  # (R,) where the rays end
    stack: Stack  # the items at the version that was fired at
    bounds: Box | None  # of the scene
    falloff: str | None  # of the weapon, or None
    traced: tuple[Contacts, Lines] | None = None
    """Contacts with objects and occluders, also beyond the ends, and the line of each pair, relative to the motion of
    its item; None if items do not move, so that the contacts can be found again."""

    def contacts(self) -> tuple[Contacts, Lines]:
        """Contacts with the objects that were hit, at least, and the line of each pair."""
        if self.traced:
            return self.traced
        ray = self.hit.ray
        lines, origin = self.lines.take(ray), self.rays.origin_xy[ray]
        return find_contacts(lines, ray, self.hit.rank, self.stack, self.bounds, origin), lines

    def _walked(self) -> tuple[Contacts, Ints, Lines]:
        """Walked cells of objects, in the order of the passes; their pairs; and the lines of all pairs."""
        met, lines = self.contacts()
        walked, chosen = walked_of(met, self.ends, self.stack)
        return walked, chosen, lines

    @property
    def walked(self) -> Contacts:
        """Walked cells of objects, in any order."""
        return cells_hit(self.contacts()[0], self.ends, self.stack)

    def pixels(self, rounds: int, hits: Bools | None = None) -> Ints:
        """Numbers of the pixels of objects that rays hit, each once; those of some `hits` at least, or of all.

        See `numbered`; `rounds` are those of each shot.
        """
        walk = self if hits is None or self.traced else replace(self, hit=self.hit.take(hits))
        cells = walk.walked
        of = cells.ray[cells.pair], cells.rank[cells.pair]
        return sorted_once(numbered(self.rays, rounds, *of, cells.x, cells.y, self.stack))

    @cached_property
    def summed(self) -> Summed:
        """What rows are summed up from."""
        rays, hit = self.rays, self.hit
        ray, scale = hit.ray, self.lines.scale[hit.ray]
        return Summed(
            rays.shot[ray], rays.round[ray], rays.pellet[ray], self.stack.ids[hit.rank],
            np.arange(len(ray)) - np.searchsorted(ray, ray), hit.entry / scale * self.lines.length[ray],
            weights_at(hit.entry, scale, self.falloff), hit.count,
            np.stack([hit.x, hit.y], axis=1) + rays.origin_xy[ray],
        )  # fmt: skip

    @cached_property
    def passes(self) -> Passes:
        """Passes of the rays through objects."""
        (walked, chosen, relative), of, ends = self._walked(), self.summed, self.ends
        hit, ray = self.hit, self.hit.ray
        out = last_of_each(walked.begin, walked.pair, (walked.leave, walked.entry, walked.y, walked.x))
        scale, length = self.lines.scale[ray], self.lines.length[ray]
        first = hit.entry / scale
        last = np.maximum(np.minimum(walked.leave[out] / scale, ends.fraction[ray]), first)

        def sides(rows: Ints) -> Ints:
            return relative.entered_by(chosen[rows], hit.x[rows], hit.y[rows])

        return Passes(
            of.shot, of.round, of.pellet, of.object, of.order, of.entry_xy,
            np.stack([walked.x[out], walked.y[out]], axis=1) + self.rays.origin_xy[ray],
            first, last, of.entry_px, last * length,
            _material(walked, ends, self.lines) * length,
            normals_at(self.stack, hit.rank, of.entry_xy, sides),
            of.weight, points_at(self.rays, ray, first), of.samples, np.zeros_like(ray),
        )  # fmt: skip

    @cached_property
    def stops(self) -> Stops:
        """Stops of the rays."""
        rays, ends = self.rays, self.ends
        ends_at_once = (ends.reason == Reason.BUDGET) & (ends.rank < 0)
        cell_xy = pixel(rays.start_256 + rays.step_256 * ~ends_at_once[:, None])
        item, normal = np.full(len(rays), -1), np.zeros((len(rays), 2), np.int64)
        stopped = np.flatnonzero(ends.rank >= 0)
        cell_xy[stopped] = np.stack([ends.x, ends.y], axis=1)[stopped] + rays.origin_xy[stopped]
        item[stopped] = self.stack.ids[ends.rank[stopped]]
        hard = stopped[ends.reason[stopped] != Reason.BUDGET]

        def sides(rows: Ints) -> Ints:
            ray = hard[rows]
            lines, line = self._relative(ray, ends.rank[ray])
            return lines.entered_by(line, ends.x[ray], ends.y[ray])

        normal[hard] = normals_at(self.stack, ends.rank[hard], cell_xy[hard], sides)
        return Stops(
            rays.shot, rays.round, rays.pellet, ends.reason, item, cell_xy, ends.fraction,
            ends.fraction * self.lines.length, points_at(rays, np.arange(len(rays)), ends.fraction), normal,
        )  # fmt: skip

    def _relative(self, ray: Ints, rank: Ints) -> tuple[Lines, Ints]:
        """Lines, and which of them (n,) are those of rays relative to the motion of the items in which they end."""
        if not self.traced:
            return self.lines, ray
        met, lines = self.traced
        key = met.ray * len(self.stack) + met.rank
        order = np.argsort(key)
        return lines, order[np.searchsorted(key[order], ray * len(self.stack) + rank)]

    def parts(self) -> list[Walk]:
        """The same rays in parts of about CHUNK_CELLS cells of objects, which can be found again."""
        if self.traced or int(self.hit.count.sum()) <= CHUNK_CELLS:
            return [self]
        each = np.bincount(self.hit.ray, self.hit.count, len(self.rays)).astype(np.int64)
        return [self.of_rays(np.arange(part.start, part.stop)) for part in pieces(each, CHUNK_CELLS)]

    def of_rays(self, rays: Ints) -> Walk:
        """Some of the rays (n,), sorted."""
        number = np.full(len(self.rays), -1)
        number[rays] = np.arange(len(rays))
        hit, traced = self.hit.take(number[self.hit.ray] >= 0), None
        hit.ray[:] = number[hit.ray]
        if self.traced:
            met, lines = self.traced
            pairs = np.flatnonzero(number[met.ray] >= 0)
            traced = met.take(pairs), lines.take(pairs)
            traced[0].ray[:] = number[traced[0].ray]
        own = self.rays.take(rays), self.lines.take(rays), hit, self.ends.take(rays)
        return Walk(*own, self.stack, self.bounds, self.falloff, traced)


def walked_of(met: Contacts, ends: Terminations, stack: Stack) -> tuple[Contacts, Ints]:
    """Cells of objects that rays walked, in the order of the passes, and the pairs of `met` that they belong to."""
    chosen = np.flatnonzero(~stack.occluder[met.rank]) if stack.has_occluders else np.arange(len(met))
    objects = met.take(chosen)
    keep = ends.walked(objects)
    chosen = chosen[np.bincount(objects.pair[keep], minlength=len(objects)) > 0]
    walked = objects.only(keep)
    cell = walked.first
    order = np.lexsort((walked.rank, walked.x[cell], walked.y[cell], walked.entry[cell], walked.ray))
    return walked.take(order), chosen[order]


def points_at(rays: Rays, ray: Ints, part: Floats) -> Floats:
    """Points of rays at fractions of their lengths, px."""
    return np.asarray(rays.start_256[ray] / SUB + part[:, None] * (rays.step_256[ray] / SUB))


def _material(walked: Contacts, ends: Terminations, lines: Lines) -> Floats:
    """Fraction of the ray that lies inside the item of each pair, up to its end; overlapping cells count once."""
    group, first, last = walked.pair, walked.entry, walked.leave
    beside = (lines.step == 0) & ((lines.start & (SUB - 1)) == HALF)
    if lines.radius or beside.any():  # the ray may be in several cells at once
        group, first, last = stretches(group, first, last)
    ray = walked.ray[group]
    budget = ends.reason[ray] == Reason.BUDGET
    scale = lines.scale[ray]
    whole = ends.last_whole(lines.scale)[ray]
    parts = np.maximum(np.minimum(last, whole) - first, 0)
    total = np.zeros(len(walked))
    if len(walked):
        total = np.add.reduceat(parts, np.searchsorted(group, np.arange(len(walked)))) / lines.scale[walked.ray]
    cut = np.flatnonzero(budget & (first <= whole) & (last > whole))
    np.add.at(total, group[cut], np.maximum(ends.fraction[ray[cut]] - whole[cut] / scale[cut], 0))
    return total


def normals_at(stack: Stack, rank: Ints, xy: Ints, sides: Callable[[Ints], Ints]) -> Ints:
    """Outward normals of items at their pixels (n, 2): gradients of the masks.

    Where the gradient is 0, it is the normal of the side by which a ray enters the pixel; `sides` tells it of rows.
    """
    left, top, right, low = (side[:, None] for side in stack.box_xyxy[rank].T)
    x, y = (at[:, None] + near for at, near in zip(xy.T, GRADIENT_XY.T, strict=True))
    inside = (x >= left) & (x <= right) & (y >= top) & (y <= low)
    texel = stack.offset[rank][:, None] + (y - top) * (right - left + 1) + x - left
    on = inside & stack.masks[np.where(inside, texel, 0)]
    normal: Ints = on.astype(np.int64) @ GRADIENT
    flat = np.flatnonzero(~normal.any(axis=1))
    if len(flat):
        normal[flat] = sides(flat)
    return normal


def weights_at(entry: Ints, scale: Ints, falloff: str | None) -> Ints:
    """Whole weights from 65,535 at the muzzle to 0 at the end of the ray."""
    if falloff is None:
        return np.full(len(entry), WEIGHT_FULL)
    return smoothed(WEIGHT_FULL - muldiv(entry, WEIGHT_FULL, scale), falloff)


C = TypeVar("C", Passes, Stops)


class Later(NamedTuple):
    """Functions that tell more of rays: their passes and stops, and the verdicts of shots, if they can be counted."""

    passes: Callable[[], Passes]
    stops: Callable[[], Stops]
    verdicts: Callable[[], Ints] | None = None


class RayHits(Hits):
    """Hits of a call of `fire` with a ray weapon.

    Rows are ordered by (shot, round, distance, pellet, order along the ray). `samples` counts the cells of all pellets;
    `first_xy` is where the nearest pellet enters. Two are equal if their rows, passes and stops are.

    Parameters
    ----------
    rays : number of rays that were fired
    """

    rays: int = 1

    def __init__(
        self, rows: Rows, later: Later, rays: int, scene: Scene, stack: Stack, weapon: Weapon, shots: Shots, plan: Plan
    ) -> None:
        self._keep(rows, scene, stack, weapon, shots, plan)
        self.rays, self._later = rays, later

    @cached_property
    def passes(self) -> Passes:
        """Passes of all rays through objects."""
        passes = self._later.passes()
        return _unwritable(replace(passes, row=_rows_of(self._rows, passes)))

    @cached_property
    def stop(self) -> Stops:
        """Stop of each ray, and its reason."""
        return _unwritable(self._later.stops())

    def _kind(self) -> type[Hits]:
        return RayHits

    @property
    def _count(self) -> Callable[[], Ints] | None:
        """Function that counts verdicts without the scene; None if it is needed, or these are copied."""
        later: Later | None = getattr(self, "_later", None)
        return later.verdicts if later else None

    def _answers(self) -> dict[str, Any]:
        counted = {"verdicts": self.verdicts} if self._count or "verdicts" in vars(self) else {}
        return {"rays": self.rays, "passes": self.passes, "stop": self.stop, **counted}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Hits):
            return NotImplemented
        if not isinstance(other, RayHits):
            return False
        same_rows = all(np.array_equal(getattr(self, n), getattr(other, n)) for n in HitRow._fields)
        return same_rows and self.passes == other.passes and self.stop == other.stop

    __hash__ = None

    def __repr__(self) -> str:
        return f"<RayHits: {len(self)} rows, {len(self.passes)} passes of {self.rays} rays>"

    def passes_at(self, shot: int) -> Passes:
        """Passes of the rays of one shot."""
        return self.passes.of_shot(self._checked(shot))

    def stops_at(self, shot: int) -> Stops:
        """Stops of the rays of one shot."""
        return self.stop.of_shot(self._checked(shot))

    def _pellets(self, shots: Sequence[int]) -> Iterator[Pellet]:
        of = self.passes.take(np.isin(self.passes.shot, shots))
        columns = of.shot, of.round, of.pellet, of.object
        return zip(*(column.tolist() for column in columns), strict=True)

    def to_dict(self) -> dict[str, Any]:
        """Rows, passes, stops and the plan as JSON."""
        return {
            "rows": self.to_rows(),
            "passes": self.passes.to_rows(),
            "stops": self.stop.to_rows(),
            "plan": self.plan.to_dict(),
        }

    def samples_at(self, shot: int = 0) -> Samples:
        """Cells of the rays of one shot in the order of the walk, with their verdicts and the items that decided."""
        return self._rays(shot).samples()

    def pixels_at(self, shot: int = 0) -> dict[tuple[int, int], Spans]:
        """Pixels of objects that one shot hit, as {(round, object): pixels}."""
        return late.ray_samples.pixels_of_rays(self._rays(shot))

    def _pixels_of(self, scene: Scene, shots: Shots) -> Iterator[tuple[int, Spans]]:
        return late.ray_samples.object_cells(scene, self._parts, shots)

    def why_not(self, shot: int = 0) -> list[WhyNot]:
        """Objects that one shot did not hit, and why: on the whole length of its rays, or within 32 px of their way."""
        return late.ray_samples.ray_why_not(self._rays(shot), {row.object for row in self.of(shot)})

    def blockers(self, shot: int = 0) -> list[Blocked]:
        """Occluders that ended rays of one shot, and the objects behind them on those rays."""
        return late.ray_samples.blocked_rays(self._rays(shot))

    def nearest_miss(self, shot: int = 0) -> Miss | None:
        """Accepted object that one shot missed by least, with the distance and the nearest points."""
        return late.ray_samples.nearest_miss(self._rays(shot), {row.object for row in self.of(shot)})

    def shares(self, shot: int | None = None) -> list[Share]:
        """Raise InputError: rays have no shares."""
        raise InputError("hits: expected those of a weapon with a pattern, got those of rays: their passes tell more")

    def margins(self, shot: int | None = None) -> list[Margin]:
        """How far the hits of one shot, or of all, are from flipping, by (shot, object).

        A margin is the shortest shift of all rays of a shot together, up to 8 px, with which it hits an object that it
        missed, or misses one that it hit. Whatever ends a shifted ray counts. A margin of at most 1 px is fragile.
        """
        if self._scenes is None:
            self._scene_then(0)  # raises for an answer of an older scene, even an empty one
        found: list[Margin] = []
        for row in range(len(self.shots)) if shot is None else [self._checked(shot)]:
            found += late.margins.ray_margins(self.scene_of(row), self._parts, self._one(row), row)
        return found

    @property
    def has_margins(self) -> bool:
        """Whether margins can be computed: not those of shots of more than 1024 rays."""
        return self.rays // max(len(self.shots), 1) <= late.margins.RAYS_MAX

    def _rays(self, shot: int) -> RayDetail:
        scene, row = self.scene_of(shot), self._checked(shot)
        if self._walked is None or self._walked[0] != row:
            self._walked = row, late.ray_samples.ray_detail(scene, self._parts, self.shots.take(row, row + 1))
        found: RayDetail = self._walked[1]
        return found

    @property
    def _parts(self) -> RayParts:
        parts = ray_parts_of(self.weapon)
        assert parts is not None  # it was fired as one
        return parts

    @cached_property
    def verdicts(self) -> Ints:
        """Number of cells of each shot by verdict, counted when first asked for."""
        count = self._count
        verdicts = count() if count else late.ray_samples.counted_verdicts(self.scene_of, self._parts, self.shots)
        verdicts.flags.writeable = False
        return verdicts

    @classmethod
    def gathered(cls, parts: Sequence[Hits], rows: Sequence[Ints], shots: Shots) -> RayHits:
        """Hits of shots that were fired at several ticks, in the order of the shots; parameters of `Hits.gathered`."""
        rays = [part for part in parts if isinstance(part, RayHits)]
        later = Later(
            lambda: Passes.gathered([part.passes for part in rays], rows),
            lambda: Stops.gathered([part.stop for part in rays], rows),
            (lambda: cls._gathered_verdicts(parts, rows)) if all(part._count for part in rays) else None,
        )
        of = *parts[0]._then(0), parts[0].weapon, shots, parts[0].plan
        found = cls(cls._gathered_rows(parts, rows), later, sum(part.rays for part in rays), *of)
        found._remember(parts, rows)
        return found


def _unwritable(columns: C) -> C:
    for column in vars(columns).values():
        column.flags.writeable = False
    return columns


class Summed(NamedTuple):
    """The columns of `Passes` that rows are summed up from."""

    shot: Ints
    round: Ints
    pellet: Ints
    object: Ints
    order: Ints
    entry_px: Floats
    weight: Ints
    samples: Ints
    entry_xy: Ints


def groups_of(of: Rows | Passes | Summed, rounds: int) -> Ints:
    """Number that identifies the shot, the round and the object of each row or pass."""
    return (of.shot * rounds + of.round) * IDS_MAX + of.object


def _rows_of(rows: Rows, passes: Passes) -> Ints:
    """Row of each pass: the one of its shot, round and object."""
    rounds = int(rows.round.max(initial=0)) + 1
    of_row, of_pass = groups_of(rows, rounds), groups_of(passes, rounds)
    order = np.argsort(of_row)
    return np.asarray(order[np.searchsorted(of_row[order], of_pass)])


Numbered = Callable[[Bools], Ints]
"""Function that numbers the pixels of objects that some passes hit, given by a mask of all passes."""


def numbered(rays: Rays, rounds: int, ray: Ints, rank: Ints, x: Ints, y: Ints, stack: Stack) -> Ints:
    """Numbers of pixels (n,) of items, given relative to the starts of rays; each round of each shot counts anew."""
    left, top = (stack.box_xyxy[rank, :2] - rays.origin_xy[ray]).T
    first = _first_number(rays.shot[ray] * rounds + rays.round[ray], rank, stack)
    return np.asarray(first + (y - top) * stack.width[rank] + x - left)


def _first_number(turn: Ints, rank: Ints, stack: Stack) -> Ints:
    """Numbers of the first pixels of the boxes of items; `turn` counts the rounds of all shots."""
    number: Ints = turn * stack.numbers[-1] + stack.numbers[rank]
    return number


def rows_of_passes(passes: Summed, rays: Rays, stack: Stack, pixels: Numbered) -> Rows:
    """Sum the passes of all rays of whole shots up to rows; pixels that several pellets hit are counted when read."""
    rounds, pellets_fired = rays.rounds, int(rays.pellet.max(initial=0)) + 1
    if pellets_fired == 1:  # each pass is a row
        x, y = (passes.entry_xy - rays.origin_xy[passes.shot * rounds + passes.round]).T
        return Rows(
            passes.shot.copy(), passes.round, passes.object, passes.samples, None, passes.weight,
            None, passes.entry_xy, x * x + y * y,
        )  # fmt: skip
    order, first, row = _grouped(passes, rounds)
    count = np.diff(first, append=len(order))
    best, pellets = order[first][row], count[row]
    samples, weight = (np.add.reduceat(column[order], first)[row] for column in (passes.samples, passes.weight))
    shot, round_, item, entry_xy = (c[best] for c in (passes.shot, passes.round, passes.object, passes.entry_xy))
    turn = shot * rounds + round_

    def distinct() -> Ints:
        """Pixels of each row; those that several pellets hit are counted once."""
        counted, shared = samples.copy(), np.flatnonzero(pellets > 1)
        if len(shared):
            wanted = np.zeros(len(order), np.bool_)
            wanted[order] = np.repeat(count > 1, count)
            rank = stack.ranks(item[shared])
            begin = _first_number(turn[shared], rank, stack)
            ends = begin + stack.numbers[rank + 1] - stack.numbers[rank]
            counted[shared] = np.diff(np.searchsorted(sorted_once(pixels(wanted)), [begin, ends]), axis=0)[0]
        return counted

    away = entry_xy - rays.origin_xy[turn * pellets_fired + passes.pellet[best]]
    columns = samples, None, weight, pellets, entry_xy, (away**2).sum(axis=1)
    return Rows(shot, round_, item, *columns, distinct=distinct)


def _grouped(passes: Summed, rounds: int) -> tuple[Ints, Ints, Ints]:
    """Group the passes of each row, that of the nearest pellet first.

    Returned are the passes in groups, the place there of the first of each group, and the groups in the order of rows.
    """
    order = row_order(passes.shot, passes.round, passes.entry_px, passes.pellet, passes.order)
    group = groups_of(passes, rounds)[order]
    alike = np.argsort(group, kind="stable")
    first = np.flatnonzero(begins(group[alike]))
    return order[alike], first, np.argsort(alike[first])
