"""Rays that end at their first hit: all that is told of one hangs on where it ends.

Of the object that ended it a ray walked one cell. Rows are made at once, passes and stops when they are asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planes.arrays import Floats, Ints
from planes.grid256 import pixel
from planes.items import Stack
from weapons.columns import ONES
from weapons.ends import Ends, Reason
from weapons.guns import Traced
from weapons.hits import Rows
from weapons.passes import Passes, Stops, normals_at, points_at, weights_at
from weapons.rayhits import groups_of, rows_of_passes
from weapons.rays import Rays
from weapons.trace import Lines
from weapons.tracing import lines_of

__all__ = ["FirstHits"]


@dataclass(frozen=True, eq=False)
class FirstHits:
    """Ends of rays of whole shots, and what they are told by.

    Parameters
    ----------
    rays : (R,) the rays, and
    ray : the weapon that they are of
    ends : (R,)
    stack : what they went through, at that version
    """

    rays: Rays
    ray: Traced
    ends: Ends
    stack: Stack

    @property
    def hit(self) -> Ints:
        """Rays that hit an object."""
        return np.flatnonzero(self.ends.reason == Reason.HITS)

    @cached_property
    def lines(self) -> Lines:
        """The rays (R,) about the whole pixels that they begin on."""
        return lines_of(self.rays, self.ray)

    @cached_property
    def parts(self) -> Floats:
        """Parts of the rays before their ends."""
        parts, stopped = np.ones(len(self.rays)), np.flatnonzero(self.ends.rank >= 0)
        parts[stopped] = self.ends.time[stopped] / self.lines.scale[stopped]
        return parts

    def rows(self, shots: int) -> Rows:
        """Rows of so many shots: one for each hit where a shot has one ray."""
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
        """Each ray that hit an object, into the cell where it ends."""
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
        """Cells in which rays end, about the pixel that they begin on."""
        return np.stack([self.ends.x[some], self.ends.y[some]], axis=1)
