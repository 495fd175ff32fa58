"""Rays that end at their first hit: their ends by march, and their hits.

The march by the distance field takes a thin ray to the first pixel that is taken; the label plane names its item. Both
hold what all rays of the call accept. A ray of no length is left over.

Rows are made at once; passes and stops when they are asked for. A ray walked one cell of the object that ended it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hitplanes.planes.bits import distance_field
from hitplanes.planes.bits.distance_field import NOTHING, PAD, UNDECIDED, Clearance, DistanceField
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Ints, Labels
from hitplanes.planes.common.limits import HALF, SUB
from hitplanes.planes.grid.spans import meets
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import Rows
from ..kinds.placements import ONES, Shots
from ..kinds.rays import RayWeapon
from .contacts import NEVER, Contacts, Rays, Reason, Terminations, Touches, endless, reasons_at
from .ray_hits import Passes, Stops, Summed, Walk, numbered, rows_of_passes, weights_at
from .ray_walk import Range, lines_of

if TYPE_CHECKING:
    from .one_ray import Follow, Followed


@dataclass(frozen=True, eq=False)
class FirstHits:
    """First hits of the rays of whole shots."""

    rays: Rays  # (R,) the rays
    ray: RayWeapon  # their weapon
    ends: Terminations  # (R,) their ends
    stack: Stack  # the items at the version that was fired at

    def rows(self, shots: int) -> Rows:
        """Rows of so many shots; if a shot has one ray, a row for each hit."""
        if len(self.rays) > shots:
            return self._rows_of_several()
        hit = np.flatnonzero(self.ends.reason == Reason.HITS)
        x, y = self.ends.x[hit], self.ends.y[hit]
        one, falloff = ONES[: len(hit)], self.ray.fades
        scale = lines_of(self.rays, self.ray).scale[hit] if falloff else one
        return Rows(
            self.rays.shot[hit], self.rays.round[hit], self.stack.ids[self.ends.rank[hit]], one, one,
            weights_at(self.ends.time[hit], scale, falloff), one,
            np.stack([x, y], axis=1) + self.rays.origin_xy[hit], x * x + y * y,
        )  # fmt: skip

    def _rows_of_several(self) -> Rows:
        """Rows of shots of several rays."""
        rays, ends, hit = self.rays, self.ends, np.flatnonzero(self.ends.reason == Reason.HITS)
        lines, one = lines_of(rays, self.ray), np.ones(len(hit), np.int64)
        scale, xy = lines.scale[hit], np.stack([ends.x[hit], ends.y[hit]], axis=1) + rays.origin_xy[hit]
        first = Summed(
            rays.shot[hit], rays.round[hit], rays.pellet[hit], self.stack.ids[ends.rank[hit]], one - 1,
            ends.time[hit] / scale * lines.length[hit], weights_at(ends.time[hit], scale, self.ray.fades), one, xy,
        )  # fmt: skip

        def pixels(wanted: Bools) -> Ints:
            """Number the pixels of some of the rays that hit."""
            own = hit[wanted]
            return numbered(rays, rays.rounds, own, ends.rank[own], ends.x[own], ends.y[own], self.stack)

        return rows_of_passes(first, rays, self.stack, pixels)

    @property
    def passes(self) -> Passes:
        """Pass of each ray that hit an object; it ends in the cell of the hit."""
        return self.walk.passes

    @property
    def stops(self) -> Stops:
        """Where each ray ended."""
        return self.walk.stops

    @cached_property
    def walk(self) -> Walk:
        """The rays, as if they walked the cells in which they end, and no others."""
        ends, stopped = self.ends, np.flatnonzero(self.ends.rank >= 0)
        lines, time, rank = lines_of(self.rays, self.ray), ends.time[stopped], ends.rank[stopped]
        ends.fraction[stopped] = time / lines.scale[stopped]
        one = np.ones(len(stopped), np.int64)
        hit = Touches(stopped, rank, one, ends.x[stopped], ends.y[stopped], time)
        met = Contacts(stopped, rank, one, hit.x, hit.y, time, time)
        hit = hit.take(~self.stack.occluder[rank])
        traced = met, lines.take(stopped)
        return Walk(self.rays, lines, hit, ends, self.stack, None, self.ray.fades, traced)


# house: hit rule of rays
def first_at_once(taken: Bools, blocked: Bools, place: Ints) -> Ints:
    """Of cells (n, k) that each ray enters at the same moment, the column of the one that ends it.

    Cells with an accepted occluder come first, then those of the least (y, x). The front item of the cell ends the ray.

    Parameters
    ----------
    taken, blocked : whether an accepted item covers the cell, and whether an accepted occluder does
    place : numbers of the cells, ordered by (y, x)
    """
    later = place.max(initial=0) + 1
    return np.asarray(np.argmin((~taken * 2 + ~blocked) * later + place, axis=1))


@dataclass(frozen=True, eq=False)
class _Planes:
    """The planes of a scene as marching rays read them, which hold what a view accepts."""

    stack: Stack
    view: View
    corner_xy: Ints
    labels: Labels
    distances: Clearance

    def place(self, cell: Ints) -> tuple[Ints, Ints]:
        """Columns and rows of cells; in numpy this is several times as fast as `divmod`."""
        y = cell // self.distances.shape[1]
        return cell - y * self.distances.shape[1], y

    def front(self, cell: Ints) -> tuple[Ints, Labels]:
        """Rank of the front-most item of taken cells, and their labels."""
        x, y = self.place(cell)
        code = self.labels.reshape(-1).take((y - PAD) * self.labels.shape[1] + (x - PAD))
        return self.stack.rank_by_label.take(code >> 1), code

    def first_of(self, cells: Ints) -> Ints:
        """First of the cells (n, 4) that rays enter at the same moment."""
        stack, taken = self.stack, self.distances.reshape(-1)[cells] == 0
        blocked = np.zeros_like(taken)
        if stack.has_occluders:
            rank, code = self.front(cells[taken])
            blocks = stack.occluder[rank]
            behind = np.flatnonzero(~blocks & (code & 1 == 1))
            blocks[behind] = self._has_occluder(cells[taken][behind])
            blocked[taken] = blocks
        return np.asarray(cells[np.arange(len(cells)), first_at_once(taken, blocked, cells)])

    def _has_occluder(self, cells: Ints) -> Bools:
        """Whether any occluder covers cells (n,)."""
        stack = self.stack
        walls = np.flatnonzero(stack.occluder & self.view.accepts(stack))
        xy, box = np.stack(self.place(cells), axis=1) + self.corner_xy, stack.box_xyxy[walls]
        pixel, wall = np.nonzero(meets(np.concatenate([xy, xy], axis=1)[:, None], box))
        x, y = (xy[pixel] - box[wall, :2]).T
        on = stack.masks[stack.offset[walls[wall]] + y * stack.width[walls[wall]] + x]
        return np.asarray(np.bincount(pixel, on, len(xy)) > 0)


# house: way of rays
def ends_by_march(rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> tuple[Terminations, Ints]:
    """Find the ends of rays, without `fraction`, by marching them; and the rays left to another way."""
    assert through.field is not None  # a scene without one is not marched through
    corner_xy = through.field.corner_xy
    planes = _Planes(through.stack, through.field.labels.view, corner_xy, *_read(through, through.field))
    start_256 = rays.start_256 - SUB * corner_xy
    entry, cell, several = kernels_of(distance_field).first_taken(planes.distances, start_256, rays.step_256)
    met, at = np.flatnonzero(entry >= 0), np.flatnonzero(several)
    if len(at):
        starts, width = entry[at] == 0, planes.distances.shape[1]
        cell[at] = planes.first_of(_at_once(cell[at], starts, start_256[at], rays.step_256[at], width))
    ends, aside, (x, y) = endless(len(rays)), corner_xy - rays.origin_xy[met], planes.place(cell[met])
    ends.rank[met], _ = planes.front(cell[met])
    ends.time[met], ends.x[met], ends.y[met] = entry[met], x + aside[:, 0], y + aside[:, 1]
    ends.reason[met] = reasons_at(through.stack, ends.rank[met])
    through.plan.run("march", "each ray to the first cell that is taken", ends.nbytes)
    starts_inside = (entry == 0) & (ray.inside != "hit")
    return ends, np.flatnonzero((entry == UNDECIDED) | starts_inside)


def _read(through: Range, field: DistanceField) -> tuple[Labels, Clearance]:
    """Labels and distances of the scene as it is now."""
    items, plan = through.items, through.plan
    made, labels = field.is_made(items), field.labels.read(items)
    redrawn = field.labels.redrawn
    plan.run("label plane", f"{redrawn} px drawn anew", redrawn * labels.itemsize)
    distances = field.read(items, labels)
    plan.run("distance field", "as it was" if made else "measured anew", 0 if made else distances.nbytes)
    return labels, distances


def _at_once(place: Ints, starts: Bools, start_256: Ints, step_256: Ints, width: int) -> Ints:
    """Cells (n, 4) of the distance field that each ray enters at the same moment; a cell may be listed twice.

    `place` (n,) is the cell that a ray enters, or the one beside the corner along x; `starts` (n,) says whether it
    starts there, as otherwise it goes through a corner or along a border.
    """
    sign = np.where(step_256 < 0, -1, 1)
    on_border = ((start_256 & (SUB - 1)) == HALF) & (starts[:, None] | (step_256 == 0))
    border, starts = sign * on_border, starts | on_border.any(axis=1)
    at_start, at_corner = np.array([[0, 0], [-1, 0], [0, -1], [-1, -1]]), np.array([[0, 0], [-1, 1], [0, 1], [0, 1]])
    steps = np.where(starts[:, None, None], at_start * border[:, None], at_corner * sign[:, None])
    return np.asarray(place[:, None] + steps[:, :, 0] + width * steps[:, :, 1])


def marcher(scene: Scene, stack: Stack, view: View) -> Follow:
    """Like `one_ray.follower`, by march; None of a ray that comes to several cells at once."""
    field = scene.derived.distance_field(view)
    assert field is not None
    plane = field.labels.read(scene.items)
    distances, (left, top) = field.read(scene.items, plane), field.corner_xy.tolist()
    flat, shape, labels, width = distances.reshape(-1).data, distances.shape, plane.reshape(-1).data, plane.shape[1]
    ranks, occluder = stack.rank_by_label.data, stack.occluder.data

    def march(x: int, y: int, dx: int, dy: int) -> Followed | None:
        """Follow one ray."""
        entry, cell, several = distance_field.one_taken(flat, shape, (x - SUB * left, y - SUB * top), (dx, dy))
        if entry == NOTHING:
            return NEVER, []
        if entry < 0 or several:
            return None
        row, column = divmod(cell, shape[1])
        rank = ranks[labels[(row - PAD) * width + column - PAD] >> 1]
        return entry, [] if occluder[rank] else [[rank, 1, column + left, row + top, entry]]

    return march
