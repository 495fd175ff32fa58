"""A prepared weapon of one ray, or of a few: each is cast at the items, or marches to its first hit.

The way is chosen as `fire` chooses it (see `fire.strategy`). A ray that marches is cast if it comes to several pixels
at once.

position, aim -> start and step, 1/256 px -> what each ray hits -> a row for each object
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from hitplanes.planes.common.backend import cached_attribute, kernels_of
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import HALF, POSITION_MAX, REACH_MAX, SUB, WEIGHT_FULL
from hitplanes.planes.grid.fixed_point import over_one, pixel, snap, toward, unit_of
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import row_order
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.hits import HitRow
from ..fire.prefilter import filters_of
from ..kinds.areas import RayParts, Spread, pellets_in
from ..kinds.placements import STRAIGHT, ZEROS, pellets_of
from ..kinds.rays import RayWeapon, Sweep, unspent
from ..kinds.weapon import Weapon
from ..rays import raycast
from ..rays.contacts import NEVER, Rays, Touches, endless, rays_of
from ..rays.one_ray import Follow, Followed, chosen_follower
from ..rays.ray_hits import Later, RayHits, Walk, weights_at
from ..rays.ray_walk import lines_of
from .one_shot import Filter, OneShot, Present
from .position_cache import new
from .prepare import PLAIN, Ready, plain_number, plain_pair

Pair = tuple[float, float]

Vector = tuple[int, int]
"""Start of a ray, or the vector from there to its end, 1/256 px."""

NUMBERS_KEPT = 1024  # shots whose pellets are kept

ENTRY = 4
"""Place in a row of `Followed` of the time at which the ray enters the object."""


def ray_along(start: Vector, step: Vector) -> Rays:
    """The ray of the first shot along a line, 1/256 px."""
    start_256, zero = np.array([start]), ZEROS[:1]
    return Rays(start_256, np.array([step]), pixel(start_256), shot=zero, round=zero, pellet=zero)


class OneShotOfRays(OneShot, RayHits):
    """Answer of one shot of a prepared ray weapon: a list of its rows; all else is made when it is asked for."""

    @cached_attribute
    def _weighted(self) -> bool:
        return self._parts[2].fades is not None

    @cached_property
    def _ended(self) -> Walk:
        """The rays as a batch, followed anew in the snapshot of the scene."""
        parts, stack, bounds = self._parts, self._present.stack, self._present.bounds
        rays, ray = rays_of(parts, self.shots), parts[2]
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

    `rays` is their number in a shot.

    These are left to `fire`: bad input, projectiles while items move, a budget of 0, and a ray that starts inside an
    item if its weapon does not hit that item.
    """

    rays = 1

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, ray: RayWeapon) -> None:
        super().__init__(scene, weapon, kept)
        self._ray, self._length, self._fades, self._view = ray, ray.length_256, ray.fades, kept.view(pierce=False)
        self._cast, self._budget_256 = unspent(ray), ray.budget_256
        self._arrangement = -1
        self._stack: Stack
        self._follows: Follow | None
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
        ahead = self._ahead(place, angle, target) if place and numbered and (target or toward is None) else None
        if place is None or ahead is None:
            return Ready.fire(self, at, aim, toward, shot)
        hits: OneShotOfRays = OneShotOfRays()
        hits._present, hits._at, hits._arguments = self._present, place, (angle, target, number)
        if self._answered(hits, (round(SUB * place[0]), round(SUB * place[1])), ahead):
            return hits
        return Ready.fire(self, at, aim, toward, shot)

    def _answered(self, hits: OneShotOfRays, start: Vector, ahead: Vector) -> bool:
        """Add the rows of a shot to its answer; False if it is left to `fire`."""
        step = self._scaled(ahead)
        followed = (self._follows or self._chosen())(*start, *step)
        if followed is None or self._must_walk(*followed):
            return False
        found = followed[1]
        if self._budget_256 and self._may_spend(found, self._budget_256):
            found = self._before_spent(start, step, self._budget_256, followed)
        self._add_of_one(hits, 0, start, step, found)
        return True

    def _add_of_one(
        self, hits: OneShotOfRays, round_: int, start: Vector, step: Vector, found: list[list[int]]
    ) -> None:
        """Add rows of what the only ray of a round hits, as in `Followed`."""
        for rank, count, x, y, entry in found:
            column, row = x - ((start[0] + HALF) >> 8), y - ((start[1] + HALF) >> 8)
            weight = WEIGHT_FULL if self._fades is None else self._weight(step, entry)
            columns = 0, round_, self._ids[rank], count, count, weight, 1, (x, y), column * column + row * row
            hits.append(new(HitRow, columns))

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

    def _before_spent(self, start: Vector, step: Vector, budget_256: int, followed: Followed) -> list[list[int]]:
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
        ahead = self._ahead(place, None, goal) if place and goal else None
        if place is None or ahead is None:
            return None
        follow = self._follows or self._chosen()
        followed = follow(round(SUB * place[0]), round(SUB * place[1]), *self._scaled(ahead))
        return None if followed is None else followed[0] == NEVER

    def _chosen(self) -> Follow:
        """How a shot's rays are followed; the next ones are followed alike unless a better way may pay soon."""
        follow, pending = chosen_follower(self.scene, self._stack, self._cast, self._view, self.rays)
        if not pending:
            self._follows = follow
        return follow

    def _ahead(self, place: Pair, aim: Any, target: Pair | None) -> Vector | None:
        """Direction of a shot, or the vector to where it is aimed, if it ends there; None if `fire` must check it."""
        if target is None:
            if self._length is None or not (aim is None or (type(aim) in PLAIN and abs(aim) <= POSITION_MAX)):
                return None
            return STRAIGHT if aim is None else unit_of(float(aim))
        dx, dy = (round(SUB * to) - round(SUB * at) for to, at in zip(target, place, strict=True))
        if aim is not None or dx == 0 == dy:
            return None
        if self._length is None:
            return (dx, dy) if max(abs(dx), abs(dy)) <= SUB * REACH_MAX else None
        return toward(dx, dy)

    def _scaled(self, ahead: Vector) -> Vector:
        """Vector from the start of a ray to its end, 1/256 px."""
        length = self._length
        return ahead if length is None else (over_one(ahead[0] * length), over_one(ahead[1] * length))

    def _weight(self, step: tuple[int, int], entry: int) -> int:
        scale = Lines(np.zeros((1, 2), np.int64), np.array([step]), self._ray.radius_256).scale
        return int(weights_at(np.array([entry]), scale, self._fades)[0])

    def _read(self, version: int, stack: Stack) -> None:
        self._stack = stack
        if stack.arrangement != self._arrangement:
            self._arrangement = stack.arrangement
            self._ids = stack.ids.data
        self._follows = None
        cost = None if self._budget_256 is None else self.scene.items.cost[stack.rows]
        self._present = self._snapshot(version, stack, cost=cost)


@lru_cache(NUMBERS_KEPT)
def _offsets(spread: Spread[Any], seed: int, number: int, round_: int) -> list[Vector]:
    """Offsets of the pellets of a round of a shot number, 1/256 px."""
    pellets_xy = pellets_of(spread, np.array([seed], np.uint64), np.array([number]), np.array([round_]))[0]
    return [(SUB * x, SUB * y) for x, y in pellets_xy.tolist()]


def _turned(vector: Vector, direction: Vector) -> Vector:
    """`grid.fixed_point.turned` of one vector, in Python integers."""
    (x, y), (c, s) = vector, direction
    return over_one(x * c - y * s), over_one(x * s + y * c)


class ReadyRays(ReadyRay):
    """Prepared burst, spread or sweep of a few rays that end at their first hit; see `ReadyRay`."""

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, parts: RayParts) -> None:
        super().__init__(scene, weapon, kept, parts[2])
        self._parts, self.rays = parts, pellets_in(parts)
        burst, several, _ = parts
        self._turns = [unit_of(burst.recoil_deg * k) for k in range(burst.count)] if burst else [STRAIGHT]
        self._shift: list[int] = snap(burst.recoil_xy).tolist() if burst else [0, 0]
        self._fan: list[Vector] = list(map(tuple, several.directions.tolist())) if isinstance(several, Sweep) else []

    def _with(self, kept: Filter) -> ReadyRays:
        return ReadyRays(self.scene, self.weapon, kept, self._parts)

    def _answered(self, hits: OneShotOfRays, start: Vector, ahead: Vector) -> bool:
        """Add the rows of a shot to its answer, round by round; False if it is left to `fire`."""
        follow, hits.rays = self._follows or self._chosen(), self.rays
        number: Any = hits._arguments[2] or 0
        for round_, turn in enumerate(self._turns):
            begin, ends, met = (start[0] + round_ * self._shift[0], start[1] + round_ * self._shift[1]), [], []
            for end in self._ends(_turned(ahead, turn) if round_ else ahead, number, round_):
                followed = follow(*begin, *end)
                if followed is None or self._must_walk(*followed):
                    return False
                if followed[1]:
                    ends.append(end)
                    met += followed[1]
            if len(met) == 1:
                self._add_of_one(hits, round_, begin, ends[0], met)
            elif met:
                self._add_rows(hits, round_, begin, np.array(ends), met)
        return True

    def _ends(self, ahead: Vector, number: int, round_: int) -> list[Vector]:
        """Vectors from the start of a round's rays to their ends, 1/256 px."""
        several = self._parts[1]
        if isinstance(several, Sweep):
            return [self._scaled(_turned(ahead, turn)) for turn in self._fan]
        x, y = self._scaled(ahead)
        if several is None:
            return [(x, y)]
        return [(x + dx, y + dy) for dx, dy in _offsets(several, self._filter.seed, number, round_)]

    def _add_rows(self, hits: OneShotOfRays, round_: int, start: Vector, steps: Ints, met: list[list[int]]) -> None:
        """Add rows of what the rays (k,) of a round hit first, the nearest hit first.

        Parameters
        ----------
        start, steps : of the rays, (2,) and (k, 2)
        met : what they hit, as in `Followed`
        """
        lines = Lines(np.zeros_like(steps), steps, self._ray.radius_256)
        entry = np.array([time for *_, time in met])
        weights = weights_at(entry, lines.scale, self._fades).tolist()
        rows: dict[int, list[Any]] = {}
        for k in row_order(entry / lines.scale * lines.length).tolist():
            rank, _, x, y, _ = met[k]
            row = rows.setdefault(rank, [(x, y), set(), 0, 0])
            row[1].add((x, y))
            row[2] += 1
            row[3] += weights[k]
        for rank, ((x, y), pixels, pellets, weight) in rows.items():
            column, line = x - ((start[0] + HALF) >> 8), y - ((start[1] + HALF) >> 8)
            of_pixels = pellets, len(pixels), weight, pellets, (x, y), column * column + line * line
            hits.append(new(HitRow, (0, round_, self._ids[rank], *of_pixels)))
