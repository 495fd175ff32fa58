"""Prepared weapon of one thin ray that ends at its first hit: each shot is cast at the items, or marches.

The way is chosen as `fire` chooses it (see `fire.strategy`). A ray that marches is cast if it comes to several pixels
at once.

position, aim -> start and step, 1/256 px -> what is touched first -> a row, or none
"""

from __future__ import annotations

import threading
from functools import cached_property
from typing import Any

import numpy as np

from hitplanes.planes.bits.distance_field import NOTHING, UNDECIDED
from hitplanes.planes.bits.raycast import Cast, Touched
from hitplanes.planes.common.backend import cached_attribute
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import HALF, POSITION_MAX, REACH_MAX, SUB, WEIGHT_FULL
from hitplanes.planes.grid.fixed_point import ONE, over_one, quarter_turns, toward
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.hits import HitRow
from ..fire.strategy import chosen_ray_way
from ..kinds.areas import ray_parts_of
from ..kinds.rays import RayWeapon
from ..kinds.weapon import Weapon
from ..rays.contacts import rays_of
from ..rays.first_hit import PREPARED, FirstHits, ends_of_touched
from ..rays.ray_hits import RayHits, Told, weights_at
from .one_shot import Filter, OneShot, Present
from .position_cache import new
from .prepare import PLAIN, Ready, plain_pair

Pair = tuple[float, float]


class OneRay(OneShot, RayHits):
    """Answer of one prepared ray: a list of at most one row; all else is made when it is asked for."""

    __slots__ = ("_found", "_told")  # set at each shot

    _found: tuple[int, ...]

    @cached_attribute
    def _weighted(self) -> bool:
        parts = ray_parts_of(self.weapon)
        return parts is not None and parts[2].fades is not None

    @cached_property
    def _first(self) -> FirstHits:
        """First hits of the ray as a batch of one."""
        parts = ray_parts_of(self.weapon)
        assert parts is not None  # it was prepared as one
        rays, stack = rays_of(parts, self.shots), self._present.stack
        ends = ends_of_touched(Touched(*np.array(self._found, np.int64).reshape(4, 1)), rays.origin_xy, stack)
        return FirstHits(rays, parts[2], ends, stack)

    @cached_attribute
    def _later(self) -> Told:
        def verdicts() -> Ints:
            return late.ray_verdicts.verdicts_of([(0, self._first)], self.shots, self._present.bounds)

        return Told(lambda: self._first.passes, lambda: self._first.stops, verdicts)


class ReadyRay(Ready[RayHits]):
    """Prepared weapon of one thin ray that ends at its first hit.

    Bad input is left to `fire`, and so is a ray that starts inside an item if its weapon does not hit that item.
    """

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, ray: RayWeapon) -> None:
        super().__init__(scene, weapon, kept)
        self._ray, self._length, self._fades, self._view = ray, ray.length_256, ray.fades, kept.view(pierce=False)
        self._items, self._version, self._arrangement = scene.items, -1, -1
        self._lock = threading.Lock()
        self._stack: Stack
        self._first: Cast
        self._present: Present
        self._objects: memoryview

    def fire(self, at: Any, aim: Any = None, toward: Any = None, shot: Any = None) -> RayHits:
        """Decide what one shot hits; the arguments are those of `fire`."""
        if self._items.version != self._version:
            self._follow()
        place, target = plain_pair(at), None if toward is None else plain_pair(toward)
        numbered = shot is None or (type(shot) is int and 0 <= shot < 2**63)
        step = self._step(place, aim, target) if place and numbered and (target or toward is None) else None
        if place and step:
            start = round(SUB * place[0]), round(SUB * place[1])
            found = entry, x, y, rank = self._first(*start, *step)
            if entry > 0 or entry == NOTHING or (entry == 0 and self._ray.inside == "hit"):
                hits: OneRay = OneRay()
                hits._present, hits._at, hits._told, hits._found = self._present, place, (aim, target, shot), found
                item = -1 if rank < 0 else self._objects[rank]
                if item >= 0:
                    column, row = x - ((start[0] + HALF) >> 8), y - ((start[1] + HALF) >> 8)
                    weight = WEIGHT_FULL if self._fades is None else self._weight(step, entry)
                    distance2 = column * column + row * row
                    hits.append(new(HitRow, (0, 0, item, 1, 1, weight, 1, (x, y), distance2)))
                return hits
        return Ready.fire(self, at, aim, toward, shot)

    def _unsettled(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...]:
        """What a ray touches first, by the way chosen now; the next rays go the same way unless it is pending."""
        chosen = chosen_ray_way("auto", False, self._ray, self.scene, self._stack, self._view, 1, prepared=True)
        given = self.scene, self._stack, self._view
        first = cast = PREPARED["cast"](*given)
        if chosen.way == "march":
            march = PREPARED["march"](*given)

            def first(x: int, y: int, dx: int, dy: int) -> tuple[int, ...]:
                """March, and cast what the march leaves undecided."""
                found = march(x, y, dx, dy)
                return cast(x, y, dx, dy) if found[0] == UNDECIDED else found

        if not chosen.pending:
            self._first = first
        return first(x, y, dx, dy)

    def _step(self, place: Pair, aim: Any, target: Pair | None) -> tuple[int, int] | None:
        """Vector from the start of a shot to its end, 1/256 px; None if an argument must be checked by `fire`."""
        if target is None:
            if self._length is None or not (aim is None or (type(aim) in PLAIN and abs(aim) <= POSITION_MAX)):
                return None
            c, s = (ONE, 0) if aim is None else direction(aim)
            return over_one(c * self._length), over_one(s * self._length)
        dx, dy = (round(SUB * to) - round(SUB * at) for to, at in zip(target, place, strict=True))
        if aim is not None or dx == 0 == dy:
            return None
        if self._length is None:
            return (dx, dy) if max(abs(dx), abs(dy)) <= SUB * REACH_MAX else None
        c, s = toward(dx, dy)
        return over_one(c * self._length), over_one(s * self._length)

    def _weight(self, step: tuple[int, int], entry: int) -> int:
        scale = max(abs(step[0]), 1) * max(abs(step[1]), 1)
        return int(weights_at(np.array([entry]), np.array([scale]), self._fades)[0])

    def _follow(self) -> None:
        """Read the scene as it is now, and choose the kernels."""
        with self._lock:
            version = self._items.version
            if version == self._version:
                return
            stack = self._stack = self._items.stack()
            if stack.forms != self._arrangement:
                self._arrangement = stack.forms
                self._objects = np.where(stack.occluder, -1, stack.ids).data
            self._first = self._unsettled
            self._present = self._snapshot(version, stack)
            self._version = version


def direction(degrees: float) -> tuple[int, int]:
    """(cos, sin) times 2**30 of an angle, correctly rounded, equal to `fixed_point.unit`."""
    turns, c, s = quarter_turns(float(degrees))
    return ((c, s), (-s, c), (-c, -s), (s, -c))[turns]
