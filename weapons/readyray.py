"""A weapon of one thin ray made ready for a scene: each shot is cast at the items, with little beside.

position, aim -> start and step, 1/256 px -> what is touched first -> a row, or none
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from planes.constants import HALF, POSITION_MAX, REACH_MAX, SUB, WEIGHT_FULL
from planes.grid256 import ONE, over_one, quarter_turns, toward
from planes.jumps import NOTHING
from planes.kept import once
from planes.raycast import Touched
from planes.scene import Scene
from planes.twins import kernels_of
from weapons import castone
from weapons.arsenal import ray_parts_of
from weapons.casting import ends_of_touched
from weapons.firsthits import FirstHits
from weapons.guns import Traced
from weapons.hits import HitRow, Hits
from weapons.oneshot import Filter, OneShot, Present
from weapons.passes import Passes, Stops, weights_at
from weapons.rayhits import RayHits
from weapons.rays import rays_of
from weapons.ready import PLAIN, Ready, plain_pair
from weapons.squares import new
from weapons.weapon import Weapon

__all__ = ["OneRay", "ReadyRay"]

Pair = tuple[float, float]


class OneRay(OneShot, RayHits):
    """What one prepared ray hit: the list of its row, if it has one; all else is made when it is asked for."""

    __slots__ = ("_found", "_told")  # what is set at each shot, too

    _found: tuple[int, ...]

    @cached_property
    def _first(self) -> FirstHits:
        """The ray as a batch of one, and its end."""
        parts = ray_parts_of(self.weapon)
        assert parts is not None  # it was prepared as one
        rays, stack = rays_of(parts, self.shots), self._present.stack
        ends = ends_of_touched(Touched(*np.array(self._found, np.int64).reshape(4, 1)), rays.origin_xy, stack)
        return FirstHits(rays, parts[2], ends, stack)

    @once
    def _later(self) -> tuple[Callable[[], Passes], Callable[[], Stops]]:
        return lambda: self._first.passes, lambda: self._first.stops


class ReadyRay(Ready):
    """One of a weapon of one thin ray that ends at its first hit.

    A ray that starts inside of an item, if that is not to be hit, goes the way of `fire`, as bad input does.
    """

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, ray: Traced) -> None:
        super().__init__(scene, weapon, kept)
        self._length, self._fades, self._inside = ray.length_256, ray.fades, ray.inside == "hit"
        self._items, self._version = scene.items, -1
        self._lock = threading.Lock()
        self._kernels: ModuleType | None = None
        self._cast: Callable[[int, int, int, int], tuple[int, ...]]
        self._caster: Any
        self._present: Present
        self._ids: memoryview
        self._blocks: memoryview

    def fire(self, at: Any, aim: Any = None, toward: Any = None, shot: Any = None) -> Hits:
        """Decide what one shot hits; the arguments are those of `fire`."""
        if self._items.version != self._version:
            self._follow()
        place, target = plain_pair(at), None if toward is None else plain_pair(toward)
        numbered = shot is None or (type(shot) is int and 0 <= shot < 2**63)
        step = self._step(place, aim, target) if place and numbered and (target or toward is None) else None
        if place and step:
            start = round(SUB * place[0]), round(SUB * place[1])
            found = entry, x, y, rank = self._cast(*start, *step)
            if entry > 0 or entry == NOTHING or (entry == 0 and self._inside):
                hits: OneRay = OneRay()
                hits._present, hits._at, hits._told, hits._found = self._present, place, (aim, target, shot), found
                if rank >= 0 and not self._blocks[rank]:
                    column, row = x - ((start[0] + HALF) >> 8), y - ((start[1] + HALF) >> 8)
                    weight = WEIGHT_FULL if self._fades is None else self._weight(step, entry)
                    distance2 = column * column + row * row
                    hits.append(new(HitRow, (0, 0, self._ids[rank], 1, 1, weight, 1, (x, y), distance2)))
                return hits
        return Ready.fire(self, at, aim, toward, shot)

    def _step(self, place: Pair, aim: Any, target: Pair | None) -> tuple[int, int] | None:
        """From the start of a shot to its end, 1/256 px; None if that is not as plain as that."""
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
        """Read the scene as it is now, by the kernels that are to be used now."""
        with self._lock:
            version = self._items.version
            if version == self._version:
                return
            kernels = kernels_of(castone)
            if kernels is not self._kernels:
                self._kernels, self._caster = kernels, kernels.Caster(self.scene, self._filter)
            stack = self._items.stack()
            self._caster.follow(stack)
            self._cast, self._ids, self._blocks = self._caster.cast, stack.ids.data, stack.occluder.data
            self._present = Present(self.scene, version, stack, self.scene.bounds, self.weapon, self._filter)
            self._version = version


def direction(degrees: float) -> tuple[int, int]:
    """(cos, sin) times 2**30 of an angle, correctly rounded, as `grid256.unit` has it."""
    turns, c, s = quarter_turns(float(degrees))
    return ((c, s), (-s, c), (-c, -s), (s, -c))[turns]
