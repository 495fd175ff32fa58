"""A prepared weapon of one ray: each shot is cast at the items, or marches to its first hit.

The way is chosen as `fire` chooses it (see `fire.strategy`). A ray that marches is cast if it comes to several pixels
at once.

position, aim -> start and step, 1/256 px -> what the ray hits -> a row for each object
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from hitplanes.planes.common.backend import cached_attribute, kernels_of
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import HALF, POSITION_MAX, REACH_MAX, SUB, WEIGHT_FULL
from hitplanes.planes.grid.fixed_point import over_one, pixel, toward, unit_of
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.hits import HitRow
from ..fire.prefilter import filters_of
from ..kinds.areas import ray_parts_of
from ..kinds.placements import STRAIGHT, ZEROS
from ..kinds.rays import RayWeapon, ends_at_first, unspent
from ..kinds.weapon import Weapon
from ..rays import raycast
from ..rays.contacts import NEVER, Rays, Reason, Terminations, Touches, endless
from ..rays.first_hit import FirstHits
from ..rays.one_ray import Follow, Followed, chosen_follower
from ..rays.ray_hits import Later, RayHits, Walk, weights_at
from ..rays.ray_walk import lines_of
from .one_shot import Filter, OneShot, Present
from .position_cache import new
from .prepare import PLAIN, Ready, plain_number, plain_pair

Pair = tuple[float, float]

Line = tuple[tuple[int, int], tuple[int, int]]
"""Start of a ray, and the vector from there to its end, 1/256 px."""

ENTRY = 4
"""Place in a row of `Followed` of the time at which the ray enters the object."""


def ray_along(start: tuple[int, int], step: tuple[int, int]) -> Rays:
    """The ray of the first shot along a line, 1/256 px."""
    start_256, zero = np.array([start]), ZEROS[:1]
    return Rays(start_256, np.array([step]), pixel(start_256), shot=zero, round=zero, pellet=zero)


def _first_end(rays: Rays, met: list[list[int]]) -> Terminations:
    """The end of one ray in the object that it hits, or at its range; `met` is that of `Followed`."""
    ends = endless(1)
    if met:
        (rank, _, x, y, entry), (left, top) = met[0], rays.origin_xy[0].tolist()
        ends.reason[0], ends.rank[0], ends.time[0] = Reason.HITS, rank, entry
        ends.x[0], ends.y[0] = x - left, y - top
    return ends


class OneRay(OneShot, RayHits):
    """Answer of one prepared ray: a list of its rows; all else is made when it is asked for."""

    __slots__ = ("_arguments", "_followed", "_line")  # set at each shot

    _line: Line
    _followed: Followed

    @cached_attribute
    def _weighted(self) -> bool:
        parts = ray_parts_of(self.weapon)
        return parts is not None and parts[2].fades is not None

    @cached_property
    def _ended(self) -> Walk | FirstHits:
        """The ray as a batch of one. Unless its end is known, it is followed anew in the snapshot of the scene."""
        parts, stack, bounds = ray_parts_of(self.weapon), self._present.stack, self._present.bounds
        assert parts is not None  # it was prepared as one
        rays, ray = ray_along(*self._line), parts[2]
        time, met = self._followed
        if ends_at_first(ray) and (met or time == NEVER):
            return FirstHits(rays, ray, _first_end(rays, met), stack)
        lines = Lines(rays.start_256, rays.step_256, ray.radius_256)
        filters = filters_of(stack, self._present.filter.shot_at_origin(None, 0), rays.shot)
        cast = stack, bounds, lines, ray.hits_most, filters
        found = kernels_of(raycast).hits_and_ends(*cast) or raycast.hits_and_ends(*cast)
        walk = raycast.walk_of(rays, ray, stack, bounds, found)
        cost = self._present.cost
        return walk if cost is None or ray.budget_256 is None else raycast.spent(walk, cost, ray.budget_256)

    @cached_attribute
    def _later(self) -> Later:
        def verdicts() -> Ints:
            return late.ray_verdicts.verdicts_of([(0, self._ended)], self.shots, self._present.bounds)

        return Later(lambda: self._ended.passes, lambda: self._ended.stops, verdicts)


class ReadyRay(Ready[RayHits]):
    """Prepared weapon of one ray that can be cast.

    These are left to `fire`: bad input, projectiles while items move, a budget of 0, and a ray that starts inside an
    item if its weapon does not hit that item.
    """

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, ray: RayWeapon) -> None:
        super().__init__(scene, weapon, kept)
        self._ray, self._length, self._fades, self._view = ray, ray.length_256, ray.fades, kept.view(pierce=False)
        self._cast, self._budget_256 = unspent(ray), ray.budget_256
        self._arrangement = -1
        self._stack: Stack
        self._follows: Follow
        self._present: Present
        self._ids: memoryview

    def _with(self, kept: Filter) -> ReadyRay:
        return ReadyRay(self.scene, self.weapon, kept, self._ray)

    def fire(self, at: Any, aim: Any = None, toward: Any = None, shot: Any = None) -> RayHits:
        """Decide what one shot hits; the arguments are those of `fire`."""
        if self._items.version != self._version:
            self._follow()
        place, target = plain_pair(at), None if toward is None else plain_pair(toward)
        angle, number = plain_number(aim), plain_number(shot)
        numbered = number is None or (type(number) is int and 0 <= number < 2**63)
        step = self._step(place, angle, target) if place and numbered and (target or toward is None) else None
        if place is None or step is None:
            return Ready.fire(self, at, aim, toward, shot)
        start = round(SUB * place[0]), round(SUB * place[1])
        followed = self._follows(*start, *step)
        if followed is None or self._must_walk(*followed):
            return Ready.fire(self, at, aim, toward, shot)
        hits: OneRay = OneRay()
        hits._present, hits._at, hits._arguments = self._present, place, (angle, target, number)
        hits._line, hits._followed = (start, step), followed
        found = followed[1]
        if self._budget_256 and self._may_spend(found, self._budget_256):
            found = self._before_spent(start, step, self._budget_256, followed)
        for rank, count, x, y, entry in found:
            column, row = x - ((start[0] + HALF) >> 8), y - ((start[1] + HALF) >> 8)
            weight = WEIGHT_FULL if self._fades is None else self._weight(step, entry)
            columns = 0, 0, self._ids[rank], count, count, weight, 1, (x, y), column * column + row * row
            hits.append(new(HitRow, columns))
        return hits

    def _must_walk(self, end: int, found: list[list[int]]) -> bool:
        """Whether a ray that was cast to its end begins in an item that is not hit, or with a budget of 0."""
        starts_inside = self._ray.inside != "hit" and (end == 0 or (found and found[0][ENTRY] == 0))
        return bool(starts_inside) or self._budget_256 == 0

    def _may_spend(self, found: list[list[int]], budget_256: int) -> bool:
        """Whether what a ray hits is enough to use its budget up."""
        cost = self._present.cost
        assert cost is not None  # its weapon has a budget
        cells = sum(cost.item(rank) * count for rank, count, *_ in found)
        return cells * raycast.longest_in_cell(self._ray.radius_256) >= budget_256

    def _before_spent(
        self, start: tuple[int, int], step: tuple[int, int], budget_256: int, followed: Followed
    ) -> list[list[int]]:
        """What a ray hits before its budget is used up, of what it hits without one."""
        cost, ends, rays = self._present.cost, endless(1), ray_along(start, step)
        assert cost is not None  # its weapon has a budget
        ends.time[0] = followed[0]
        (left, top), (rank, count, x, y, entry) = rays.origin_xy[0].tolist(), np.array(followed[1]).T
        hit = Touches(np.zeros_like(rank), rank, count, x - left, y - top, entry)
        walk = Walk(rays, lines_of(rays, self._ray), hit, ends, self._stack, self._present.bounds, None)
        hit = raycast.spent(walk, cost, budget_256).hit
        found: list[list[int]] = np.stack([hit.rank, hit.count, hit.x + left, hit.y + top, hit.entry], axis=1).tolist()
        return found

    def reaches(self, at: Any, target: Any) -> bool | None:
        """Whether a ray from one point to another meets nothing; None if they must be checked, or are one."""
        if self._items.version != self._version:
            self._follow()
        place, goal = plain_pair(at), plain_pair(target)
        step = self._step(place, None, goal) if place and goal else None
        if place is None or step is None:
            return None
        followed = self._follows(round(SUB * place[0]), round(SUB * place[1]), *step)
        return None if followed is None else followed[0] == NEVER

    def _unsettled(self, x: int, y: int, dx: int, dy: int) -> Followed | None:
        """What a ray hits, by the way chosen now; the next rays go the same way unless it is pending."""
        follow, pending = chosen_follower(self.scene, self._stack, self._cast, self._view)
        if not pending:
            self._follows = follow
        return follow(x, y, dx, dy)

    def _step(self, place: Pair, aim: Any, target: Pair | None) -> tuple[int, int] | None:
        """Vector from the start of a shot to its end, 1/256 px; None if an argument must be checked by `fire`."""
        if target is None:
            if self._length is None or not (aim is None or (type(aim) in PLAIN and abs(aim) <= POSITION_MAX)):
                return None
            c, s = STRAIGHT if aim is None else unit_of(float(aim))
            return over_one(c * self._length), over_one(s * self._length)
        dx, dy = (round(SUB * to) - round(SUB * at) for to, at in zip(target, place, strict=True))
        if aim is not None or dx == 0 == dy:
            return None
        if self._length is None:
            return (dx, dy) if max(abs(dx), abs(dy)) <= SUB * REACH_MAX else None
        c, s = toward(dx, dy)
        return over_one(c * self._length), over_one(s * self._length)

    def _weight(self, step: tuple[int, int], entry: int) -> int:
        scale = Lines(np.zeros((1, 2), np.int64), np.array([step]), self._ray.radius_256).scale
        return int(weights_at(np.array([entry]), scale, self._fades)[0])

    def _read(self, version: int, stack: Stack) -> None:
        self._stack = stack
        if stack.arrangement != self._arrangement:
            self._arrangement = stack.arrangement
            self._ids = stack.ids.data
        self._follows = self._unsettled
        cost = None if self._budget_256 is None else self.scene.items.cost[stack.rows]
        self._present = self._snapshot(version, stack, cost=cost)
