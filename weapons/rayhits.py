"""What rays hit: hits with the passes of each ray through an object, and where each ray stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from planes.arrays import InputError, Ints
from planes.constants import ITEMS_MAX
from planes.sampling import Verdict
from planes.scene import Scene
from planes.spans import Spans
from weapons.arsenal import ray_parts_of
from weapons.ends import Reason
from weapons.explain import Blocked, Samples, Share, WhyNot
from weapons.hits import HitRow, Hits, Rows
from weapons.meetings import Meetings
from weapons.passes import Passes, Stops
from weapons.plan import Plan
from weapons.rayexplain import Miss, RayDetail, blocked_rays, nearest_miss, pixels_of_rays, ray_detail, ray_why_not
from weapons.rays import Parts, Rays
from weapons.volley import Shots
from weapons.weapon import Weapon

if TYPE_CHECKING:
    from weapons.margins import Margin

__all__ = ["RayHits", "Reason", "Told", "groups_of", "pixels_of", "rows_of_passes"]


C = TypeVar("C", Passes, Stops)
Told = tuple[Callable[[], Passes], Callable[[], Stops]]
"""What makes the passes and the stops of rays, once they are asked for."""


class RayHits(Hits):
    """What a call of `fire` with a traced weapon hit.

    Its rows are those of `Hits`, ordered by (shot, round, distance, pellet, order along the ray): `samples` are cells
    of all pellets, `first_xy` is where the nearest pellet enters. Two are equal when rows, passes and stops are.

    Parameters
    ----------
    rays : how many were fired
    """

    rays: int = 1

    def __init__(
        self, rows: Rows, told: Told, rays: int, scene: Scene, weapon: Weapon, shots: Shots, plan: Plan
    ) -> None:
        self._keep(rows, scene, weapon, shots, plan)
        self.rays, self._later = rays, told

    @cached_property
    def passes(self) -> Passes:
        """Each ray through each object."""
        passes = self._later[0]()
        return _unwritable(replace(passes, row=_rows_of(self._rows, passes)))

    @cached_property
    def stop(self) -> Stops:
        """Where each ray ended, and why."""
        return _unwritable(self._later[1]())

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
        """Ends of the rays of one shot."""
        return self.stop.of_shot(self._checked(shot))

    def to_dict(self) -> dict[str, Any]:
        """Rows, passes and stops as JSON; verdicts are counted when they are asked for."""
        told = {"rows": [{**row._asdict(), "first_xy": list(row.first_xy)} for row in self]}
        return {**told, "passes": self.passes.to_rows(), "stops": self.stop.to_rows(), "plan": self.plan.to_dict()}

    def samples_at(self, shot: int = 0) -> Samples:
        """Every cell of the rays of one shot in the order of the walk: pixel, pellet, verdict, what decided it."""
        return self._rays(shot).samples()

    def pixels_at(self, shot: int = 0) -> dict[tuple[int, int], Spans]:
        """Pixels that each round of one shot hit of each object, as {(round, object): pixels}."""
        return pixels_of_rays(self._rays(shot))

    def why_not(self, shot: int = 0) -> list[WhyNot]:
        """Objects on the whole length of the rays of one shot, or within 32 px of their way, not hit, and why."""
        return ray_why_not(self._rays(shot), {row.object for row in self.of(shot)})

    def blockers(self, shot: int = 0) -> list[Blocked]:
        """Occluders that ended rays of one shot, and the objects on their way behind them."""
        return blocked_rays(self._rays(shot))

    def nearest_miss(self, shot: int = 0) -> Miss | None:
        """The accepted object that one shot passed by most closely, how near, and where."""
        return nearest_miss(self._rays(shot), {row.object for row in self.of(shot)})

    def shares(self, shot: int | None = None) -> list[Share]:
        """Rays have no shares."""
        raise InputError("hits: expected those of a weapon with a pattern, got those of rays: their passes tell more")

    def margins(self, shot: int | None = None) -> list[Margin]:
        """How far the rays of one shot, or of all, are from touching an accepted object or from leaving it, up to 8 px.

        All rays of a shot move together, by any shift. What they hit they leave: they go then as far as they would if
        no object ended them. What they did not hit they touch, from the muzzle to where each stopped.
        """
        from weapons.raymargins import ray_margins  # few ask

        if self._scenes is None:
            self.scene_of(0)  # an old answer is refused, also an empty one
        found: list[Margin] = []
        for row in range(len(self.shots)) if shot is None else [self._checked(shot)]:
            hit = {told.object for told in self.of(row)}
            found += ray_margins(self._rays(row), self.scene_of(row), self._parts[2], row, hit)
        return found

    @property
    def has_margins(self) -> bool:
        """Whether margins can be told: not of steps of a projectile, nor of very many rays."""
        from weapons.raymargins import has_ray_margins

        return has_ray_margins(self._parts[2], self.rays // max(len(self.shots), 1))

    def _rays(self, shot: int) -> RayDetail:
        scene, row = self.scene_of(shot), self._checked(shot)
        if self._walked is None or self._walked[0] != row:
            self._walked = row, ray_detail(scene, self._parts, self.shots.take(row, row + 1))
        found: RayDetail = self._walked[1]
        return found

    @property
    def _parts(self) -> Parts:
        parts = ray_parts_of(self.weapon)
        assert parts is not None  # it was fired as one
        return parts

    @cached_property
    def verdicts(self) -> Ints:
        """Cells of each shot by verdict, counted when they are first asked for."""
        none = np.zeros((0, len(Verdict)), np.int64)
        verdicts = np.concatenate([none, *(self._rays(i).counts() for i in range(len(self.shots)))])
        verdicts.flags.writeable = False
        return verdicts

    @classmethod
    def gathered(cls, parts: Sequence[Hits], rows: Sequence[Ints], shots: Shots) -> RayHits:
        """Hits of shots that were fired at several ticks, in the order of the shots."""
        rays = [part for part in parts if isinstance(part, RayHits)]
        found = cls(
            cls._gathered_rows(parts, rows),
            (
                lambda: Passes.gathered([part.passes for part in rays], rows),
                lambda: Stops.gathered([part.stop for part in rays], rows),
            ),
            sum(part.rays for part in rays),
            parts[0].scene,
            parts[0].weapon,
            shots,
            Plan.joined([part.plan for part in parts]),
        )
        found._remember(parts, rows)
        return found


def _unwritable(columns: C) -> C:
    for f in fields(columns):
        getattr(columns, f.name).flags.writeable = False
    return columns


def groups_of(of: Rows | Passes, rounds: int) -> Ints:
    """A number for each shot, round and object."""
    return (of.shot * rounds + of.round) * ITEMS_MAX + of.object


def _rows_of(rows: Rows, passes: Passes) -> Ints:
    """Row of each pass: of the same shot, round and object."""
    rounds = int(rows.round.max(initial=0)) + 1
    of_row, of_pass = groups_of(rows, rounds), groups_of(passes, rounds)
    order = np.argsort(of_row)
    return np.asarray(order[np.searchsorted(of_row[order], of_pass)])


def pixels_of(passes: Passes, cells: Meetings, some: Rays, rays: Rays) -> Ints:
    """Pixels that some rays of whole shots hit, as rows (group, x, y), for shots of several pellets.

    Parameters
    ----------
    cells : of each pass
    """
    if not rays.pellet.any():
        return np.zeros((0, 3), np.int64)
    group = groups_of(passes, int(rays.round.max(initial=0)) + 1)[cells.pair]
    x, y = (np.stack([cells.x, cells.y], axis=1) + some.origin_xy[cells.ray[cells.pair]]).T
    found = np.stack([group, x, y], axis=1)
    return found if len(some) == len(rays) else np.unique(found, axis=0)


def rows_of_passes(passes: Passes, pixels: Ints, rays: Rays) -> Rows:
    """Gather the passes of all rays of whole shots into rows; `pixels` are those of `pixels_of`."""
    rounds, pellets_fired = (int(column.max(initial=0)) + 1 for column in (rays.round, rays.pellet))
    group = groups_of(passes, rounds)
    order = np.lexsort((passes.order, passes.pellet, passes.entry_px, group))
    begins = np.flatnonzero(np.diff(group[order], prepend=-1))
    best = order[begins]
    number = np.zeros(len(group), np.int64)
    number[order] = np.cumsum(np.diff(group[order], prepend=-1) != 0) - 1
    samples = np.bincount(number, passes.samples, len(best)).astype(np.int64)
    weight = np.bincount(number, passes.weight, len(best)).astype(np.int64)
    pellets = np.bincount(number, minlength=len(best))
    distinct = samples if (pellets == 1).all() else _counted_once(pixels, group[best])
    ray_of = passes.shot[best], passes.round[best]
    sort = np.lexsort((passes.order[best], passes.pellet[best], passes.entry_px[best], *ray_of[::-1]))
    best = best[sort]
    ray = (passes.shot[best] * rounds + passes.round[best]) * pellets_fired + passes.pellet[best]
    return Rows(
        passes.shot[best], passes.round[best], passes.object[best], samples[sort], distinct[sort], weight[sort],
        pellets[sort], passes.entry_xy[best], ((passes.entry_xy[best] - rays.origin_xy[ray]) ** 2).sum(axis=1),
    )  # fmt: skip


def _counted_once(pixels: Ints, groups: Ints) -> Ints:
    """Distinct pixels of each of rising groups."""
    group = np.unique(pixels, axis=0)[:, 0]
    return np.bincount(np.searchsorted(groups, group), minlength=len(groups))
