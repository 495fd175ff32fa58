"""Rays that end at their first hit: the choice among walk, cast and march, and the hits of such rays.

- The walk (`ray_walk`) follows any ray.
- The cast tests a thin ray against the boxes and pixels of all items. It leaves to the walk a ray of no length, and one
  that starts inside an item which its weapon does not hit there.
- The march by the distance field takes a thin ray to the first pixel that is taken; the label plane names its item. A
  ray passes what its filter refuses cell by cell. It is left to the walk if something else lies behind what it refuses,
  or is touched at the same moment, or if the ray has no length.

Rows are made at once; passes and stops when they are asked for. A ray walked one cell of the object that ended it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hitplanes.planes.bits import distance_field, raycast
from hitplanes.planes.bits.distance_field import PAD, UNDECIDED, Clearance, DistanceField, Passed
from hitplanes.planes.bits.raycast import Touched
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints, Labels, choice
from hitplanes.planes.common.limits import HALF, SUB
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import meets
from hitplanes.planes.scene.items import Items, Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import Rows
from ..fire.plan import Plan
from ..fire.prefilter import may_refuse, refused
from ..fire.strategy import REDRAW_PIXEL_NS, STRATEGIES
from ..kinds.placements import ONES, Shots
from ..kinds.rays import Projectile, RayWeapon
from .contacts import Rays, Reason, Terminations, endless
from .ray_hits import Passes, Stops, groups_of, normals_at, points_at, rows_of_passes, weights_at
from .ray_walk import Range, lines_of

if TYPE_CHECKING:
    from hitplanes.planes.bits.distance_field import DistanceField


# Costs in ns, measured with `tests/bench/rays.py` on one machine; the choice depends on their ratios only.

WALK_CALL_NS, WALK_ITEM_NS, WALK_RAY_NS, WALK_MET_NS = 700_000.0, 20.0, 12_000.0, 3000.0
"""Walk: a call, each item, each ray, and each box in which a ray is expected to start."""

JUMP_CALL_NS, JUMP_RAY_NS, CLEARANCE_PIXEL_NS = 190_000.0, 400.0, 5.5
"""March: a call, each ray, and each pixel of a distance field that is made."""

CAST_CALL_NS, CAST_RAY_NS, CAST_PAIR_NS = 270_000.0, 75_000.0, 30.0
"""Cast in numpy: a call, each ray, and each pair of a ray and an item."""

COMPILED_CALL_NS, COMPILED_RAY_NS, COMPILED_PAIR_NS = 170_000.0, 600.0, 1.3
"""Cast by a compiled kernel: a call, each ray, and each pair of a ray and an item."""


class Way(NamedTuple):
    """How the ends of rays are found, and why: by march if `plane` is set, by cast if `casts`, else by the walk."""

    plane: DistanceField | None
    casts: bool
    why: str


def ends_at_first(ray: RayWeapon) -> bool:
    """Whether rays of a weapon end at the first object that they touch, and take no time."""
    return ray.hits_most == 1 and ray.budget_256 is None and not isinstance(ray, Projectile)


def can_march(ray: RayWeapon) -> bool:
    """Whether rays of a weapon may march or be cast."""
    return ends_at_first(ray) and not ray.radius_256


def chosen_way(strategy: str, asked: bool, ray: RayWeapon, scene: Scene, stack: Stack, rays: int) -> Way:
    """Choose how the ends of so many rays of a weapon are found.

    Parameters
    ----------
    strategy : argument of `fire`
    asked : whether the caller named a pre-filter or a broad phase, which only the walk uses

    Raises
    ------
    InputError
        If the strategy is not known, or is "composed" and the bounds do not fit one plane.
    """
    choice("strategy", strategy, STRATEGIES if can_march(ray) else STRATEGIES[:2])
    if not can_march(ray):
        return Way(None, False, "only thin rays that end at their first hit do")
    plane = None if strategy == "direct" else scene.distance_field()
    if strategy == "composed":
        if plane is None:
            raise InputError("strategy: expected bounds that fit one plane for 'composed', got a scene without them")
        return Way(plane, False, "asked for")
    if asked or not len(stack):
        return Way(None, False, "every ray walks")
    walk, cast = _walk_ns(rays, stack), _cast_ns(rays, len(stack))
    casts, direct = cast < walk, min(cast, walk)
    costs = f"about {cast / 1e3:.0f} us cast at items, {walk / 1e3:.0f} us walking"
    if plane is None:
        why = "direct is asked for" if strategy == "direct" else "no bounds that fit one plane"
        return Way(None, casts, f"{why}: {costs}")
    jump, owed = JUMP_CALL_NS + rays * JUMP_RAY_NS, owed_ns(plane, scene)
    plane.missed += max(direct - jump, 0.0)
    return Way(plane if plane.missed > owed else None, casts, f"{costs}, {(jump + owed) / 1e3:.0f} us by jumps")


def owed_ns(plane: DistanceField, scene: Scene) -> float:
    """Cost of bringing a distance field up to date, ns."""
    if plane.is_made(scene.items):
        return 0.0
    return plane.labels.cost(scene.items) * REDRAW_PIXEL_NS + plane.labels.size * CLEARANCE_PIXEL_NS


def _walk_ns(rays: int, stack: Stack) -> float:
    """Cost of the walk of rays, ns, among items that are spread evenly over the box around all."""
    item_wh, world_wh = stack.sizes
    met = min(len(stack) * float((item_wh / world_wh).prod()), len(stack))
    return WALK_CALL_NS + len(stack) * WALK_ITEM_NS + rays * (WALK_RAY_NS + met * WALK_MET_NS)


def _cast_ns(rays: int, items: int) -> float:
    """Cost of casting rays at items, ns."""
    if kernels_of(raycast) is raycast:
        return CAST_CALL_NS + rays * (CAST_RAY_NS + items * CAST_PAIR_NS)
    return COMPILED_CALL_NS + rays * (COMPILED_RAY_NS + items * COMPILED_PAIR_NS)


@dataclass(frozen=True, eq=False)
class FirstHits:
    """First hits of the rays of whole shots.

    Parameters
    ----------
    rays : (R,) the rays
    ray : their weapon
    ends : (R,) their ends
    stack : the items at the version that was fired at
    """

    rays: Rays
    ray: RayWeapon
    ends: Terminations
    stack: Stack

    @property
    def hit(self) -> Ints:
        """Numbers of the rays that hit an object."""
        return np.flatnonzero(self.ends.reason == Reason.HITS)

    @cached_property
    def lines(self) -> Lines:
        """Lines (R,) of the rays, relative to the pixels of their starts."""
        return lines_of(self.rays, self.ray)

    @cached_property
    def parts(self) -> Floats:
        """Ends as fractions (R,) of the rays."""
        parts, stopped = np.ones(len(self.rays)), np.flatnonzero(self.ends.rank >= 0)
        parts[stopped] = self.ends.time[stopped] / self.lines.scale[stopped]
        return parts

    def rows(self, shots: int) -> Rows:
        """Rows of so many shots; if a shot has one ray, a row for each hit."""
        if len(self.rays) > shots:
            passes = self.passes
            group = groups_of(passes, int(self.rays.round.max(initial=0)) + 1)
            return rows_of_passes(passes, np.concatenate([group[:, None], passes.entry_xy], axis=1), self.rays)
        hit = self.hit
        x, y = self.ends.x[hit], self.ends.y[hit]
        one = ONES[: len(hit)]
        weight = self._weights(hit)
        return Rows(
            self.rays.shot[hit], self.rays.round[hit], self.stack.ids[self.ends.rank[hit]], one, one, weight, one,
            np.stack([x, y], axis=1) + self.rays.origin_xy[hit], x * x + y * y,
        )  # fmt: skip

    @cached_property
    def passes(self) -> Passes:
        """Pass of each ray that hit an object; it ends in the cell of the hit."""
        ends, rays, hit = self.ends, self.rays, self.hit
        rank, part = ends.rank[hit], self.parts[hit]
        xy = self._cells(hit) + rays.origin_xy[hit]
        along = part * self.lines.length[hit]
        none = np.zeros(len(hit), np.int64)
        sides = self.lines.entered_by(hit, ends.x[hit], ends.y[hit])
        return Passes(
            rays.shot[hit], rays.round[hit], rays.pellet[hit], self.stack.ids[rank], none,
            xy, xy.copy(), part, part.copy(), along, along.copy(), np.zeros(len(hit)),
            normals_at(self.stack, rank, xy, sides),
            self._weights(hit),
            points_at(rays, hit, part),
            np.ones(len(hit), np.int64), none.copy(),
        )  # fmt: skip

    @cached_property
    def stops(self) -> Stops:
        """Where each ray ended."""
        ends, rays, stack, parts = self.ends, self.rays, self.stack, self.parts
        stopped = np.flatnonzero(ends.rank >= 0)
        rank = ends.rank[stopped]
        cell_xy = pixel(rays.start_256 + rays.step_256)
        cell_xy[stopped] = self._cells(stopped) + rays.origin_xy[stopped]
        item, normal = np.full(len(rays), -1), np.zeros((len(rays), 2), np.int64)
        item[stopped] = stack.ids[rank]
        sides = self.lines.entered_by(stopped, ends.x[stopped], ends.y[stopped])
        normal[stopped] = normals_at(stack, rank, cell_xy[stopped], sides)
        return Stops(
            rays.shot, rays.round, rays.pellet, ends.reason, item, cell_xy, parts,
            parts * self.lines.length, points_at(rays, np.arange(len(rays)), parts), normal,
        )  # fmt: skip

    def _weights(self, hit: Ints) -> Ints:
        falloff = self.ray.fades
        return weights_at(self.ends.time[hit], self.lines.scale[hit] if falloff else ONES[: len(hit)], falloff)

    def _cells(self, some: Ints) -> Ints:
        """Cells in which rays end, relative to the pixels of their starts."""
        return np.stack([self.ends.x[some], self.ends.y[some]], axis=1)


# house: way of rays
def ends_by_cast(rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> tuple[Terminations, Ints]:
    """Find the ends of rays by casting them at the items.

    Returns
    -------
    the ends without `fraction`, and the numbers of the rays that are left to the walk
    """
    stack = through.stack
    whose = (shots.accept[rays.shot], shots.exclude[rays.shot]) if may_refuse(stack, shots) else ()
    found = kernels_of(raycast).first_touched(stack, through.bounds, rays.start_256, rays.step_256, *whose)
    ends = ends_of_touched(found, rays.origin_xy, stack)
    through.plan.run("cast", "each ray to what it touches first: boxes, filters and occluders, too", ends.nbytes)
    unsure = found.entry == UNDECIDED
    if ray.inside != "hit":
        unsure |= found.entry == 0
    return ends, np.flatnonzero(unsure)


# house: hit rule of rays
def ends_of_touched(found: Touched, origin_xy: Ints, stack: Stack) -> Terminations:
    """Ends of rays at what they touch first, without `fraction`; `origin_xy` (R, 2) are the pixels of their starts."""
    ends, met = endless(len(origin_xy)), np.flatnonzero(found.entry >= 0)
    aside, rank = origin_xy[met], found.rank[met]
    ends.x[met], ends.y[met] = found.x[met] - aside[:, 0], found.y[met] - aside[:, 1]
    ends.rank[met], ends.time[met] = rank, found.entry[met]
    ends.reason[met] = np.where(stack.occluder[rank], Reason.OCCLUDER, Reason.HITS)
    return ends


RAYS_AT_ONCE = 2**14
"""Number of rays whose columns fit the processor's cache."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """The scene as marching rays read it: labels, distances, and the filter of their shots."""

    rays: Rays
    shots: Shots
    stack: Stack
    labels: Labels
    distances: Clearance
    plan: Plan

    def place(self, cell: Ints) -> tuple[Ints, Ints]:
        """Columns and rows of cells; in numpy this is several times as fast as `divmod`."""
        y = cell // self.distances.shape[1]
        return cell - y * self.distances.shape[1], y

    def front(self, cell: Ints) -> tuple[Ints, Labels]:
        """Rank of the front-most item of taken cells, and their labels."""
        x, y = self.place(cell)
        code = self.labels.reshape(-1).take((y - PAD) * self.labels.shape[1] + (x - PAD))
        return self.stack.rank_by_code.take(code >> 1), code

    def refuses(self, ray: Ints, rank: Ints) -> Bools:
        """Whether rays refuse items."""
        self.plan.run("jumps", "")
        found = refused(self.stack, rank, self.shots, self.rays.shot[ray])
        self.plan.run("filter", "categories and owners", found.nbytes)
        return found

    def passed(self, ray: Ints, cell: Ints) -> Bools:
        """Whether rays refuse all items of taken cells."""
        rank, code = self.front(cell)
        return np.asarray(self.refuses(ray, rank) & (code & 1 == 0))


# house: way of rays
# house: hit rule of rays
def ends_by_march(
    rays: Rays, ray: RayWeapon, shots: Shots, items: Items, stack: Stack, plane: DistanceField, plan: Plan
) -> tuple[Terminations, Ints]:
    """Find the ends of rays by marching them through the distance field.

    Returns
    -------
    the ends without `fraction`, and the numbers of the rays that are left to another way
    """
    seen = _Seen(rays, shots, stack, *_read(plane, items, plan), plan)
    choosy = may_refuse(stack, shots)
    entry, cell, several = _first_taken(seen.distances, rays, plane.corner_xy, seen.passed if choosy else None)
    unsure, met = entry == UNDECIDED, np.flatnonzero(entry >= 0)
    at = np.flatnonzero(several)
    if len(at):
        cells = _cells_at_once(cell[at], entry[at] == 0, rays.start_256[at], rays.step_256[at], seen.distances.shape[1])
        cell[at], others = _first_of(cells, seen, plane.corner_xy)
        unsure[at] = others & choosy
    place = cell[met]
    rank, _ = seen.front(place)
    if choosy:
        unsure[met] |= seen.refuses(met, rank)
    if ray.inside != "hit":
        unsure |= entry == 0
    (x, y), aside = seen.place(place), plane.corner_xy - rays.origin_xy.take(met, axis=0)
    ends = endless(len(rays))
    ends.x[met], ends.y[met] = x + aside[:, 0], y + aside[:, 1]
    ends.rank[met], ends.time[met] = rank, entry[met]
    ends.reason[met] = np.where(stack.occluder[rank], Reason.OCCLUDER, Reason.HITS)
    plan.run("jumps", "each to the first cell that is taken", ends.nbytes)
    return ends, np.flatnonzero(unsure)


def _read(plane: DistanceField, items: Items, plan: Plan) -> tuple[Labels, Clearance]:
    """Labels and distances of the scene as it is now."""
    made = plane.is_made(items)
    labels = plane.labels.read(items)
    redrawn = plane.labels.redrawn
    plan.run("code plane", f"{redrawn} px drawn anew", redrawn * labels.itemsize)
    distances = plane.read(items, labels)
    plan.run("clearance plane", "as it was" if made else "measured anew", 0 if made else distances.nbytes)
    return labels, distances


def _first_taken(distances: Clearance, rays: Rays, corner_xy: Ints, passed: Passed | None) -> tuple[Ints, Ints, Bools]:
    """First taken cell of each ray that it does not pass, for RAYS_AT_ONCE rays at a time."""
    start, found = rays.start_256 - SUB * corner_xy, []
    for begin in range(0, max(len(rays), 1), RAYS_AT_ONCE):
        part = slice(begin, begin + RAYS_AT_ONCE)
        if passed is None:
            kernels = kernels_of(distance_field)
            found.append(kernels.first_taken(distances, start[part], rays.step_256[part]))
        else:
            later = partial(_later, passed, begin)
            found.append(distance_field.first_taken(distances, start[part], rays.step_256[part], later))
    if len(found) == 1:
        first: tuple[Ints, Ints, Bools] = found[0]
        return first
    entry, cell, several = (np.concatenate(column) for column in zip(*found, strict=True))
    return entry, cell, several


def _later(passed: Passed, begin: int, ray: Ints, cell: Ints) -> Bools:
    return passed(ray + begin, cell)


def _cells_at_once(place: Ints, starts: Bools, start_256: Ints, step_256: Ints, width: int) -> Ints:
    """Cells (n, 4) of the distance field that each ray enters at the same moment; a cell may be listed twice.

    Parameters
    ----------
    place : (n,) the cell that a ray enters, or the one beside the corner along x
    starts : (n,) whether it starts there; otherwise it goes through a corner or along a border
    """
    sign = np.where(step_256 < 0, -1, 1)
    on_border = ((start_256 & (SUB - 1)) == HALF) & (starts[:, None] | (step_256 == 0))
    border, starts = sign * on_border, starts | on_border.any(axis=1)
    at_start, at_corner = np.array([[0, 0], [-1, 0], [0, -1], [-1, -1]]), np.array([[0, 0], [-1, 1], [0, 1], [0, 1]])
    steps = np.where(starts[:, None, None], at_start * border[:, None], at_corner * sign[:, None])
    return np.asarray(place[:, None] + steps[:, :, 0] + width * steps[:, :, 1])


def _first_of(cells: Ints, seen: _Seen, corner_xy: Ints) -> tuple[Ints, Bools]:
    """First of the cells (n, k) that rays enter at the same moment: those with an occluder first, then by (y, x).

    Returns
    -------
    the cell of each ray; and whether more than one of its cells is taken
    """
    taken = seen.distances.reshape(-1)[cells] == 0
    blocked = np.zeros_like(taken)
    if seen.stack.has_occluders:
        rank, code = seen.front(cells[taken])
        in_front = seen.stack.occluder[rank]
        behind = np.flatnonzero(~in_front & (code & 1 == 1))
        xy = np.stack(seen.place(cells[taken][behind]), axis=1) + corner_xy
        in_front[behind] = _has_occluder(seen.stack, xy)
        blocked[taken] = in_front
    last = np.where(taken, cells, -1).max(axis=1, keepdims=True)
    best = np.argmin((~taken * 2 + ~blocked) * seen.distances.size + cells, axis=1)
    return cells[np.arange(len(cells)), best], (taken & (cells != last)).any(axis=1)


def _has_occluder(stack: Stack, xy: Ints) -> Bools:
    """Whether any occluder covers pixels (n, 2)."""
    walls = np.flatnonzero(stack.occluder)
    box = stack.box_xyxy[walls]
    pixel, wall = np.nonzero(meets(np.concatenate([xy, xy], axis=1)[:, None], box))
    x, y = (xy[pixel] - box[wall, :2]).T
    on = stack.masks[stack.offset[walls[wall]] + y * stack.width[walls[wall]] + x]
    return np.asarray(np.bincount(pixel, on, len(xy)) > 0)
