"""Prepared weapon of one thin ray that ends at its first hit: each shot is cast at the items.

In numpy a ray is marched by the distance field instead, in Python integers, once enough rays were fired at the
unchanged scene to pay for the field. It is cast if the march comes to an item that the filter refuses, or to several
pixels at once. Compiled kernels cast all rays.

position, aim -> start and step, 1/256 px -> what is touched first -> a row, or none
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from hitplanes.planes.bits import distance_field, raycast
from hitplanes.planes.bits.distance_field import NOTHING, PAD
from hitplanes.planes.bits.raycast import Touched
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.caches import cached_attribute
from hitplanes.planes.common.checks import Bools
from hitplanes.planes.common.limits import HALF, POSITION_MAX, REACH_MAX, SUB, WEIGHT_FULL
from hitplanes.planes.grid.fixed_point import ONE, over_one, quarter_turns, toward
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import HitRow, Hits
from ..kinds.areas import ray_parts_of
from ..kinds.rays import RayWeapon
from ..kinds.weapon import Weapon
from ..rays.contacts import rays_of
from ..rays.first_hit import CAST_PAIR_NS, CAST_RAY_NS, FirstHits, ends_of_touched, owed_ns
from ..rays.ray_hits import Passes, RayHits, Stops, weights_at
from .one_shot import Filter, OneShot, Present
from .position_cache import new
from .prepare import PLAIN, Ready, plain_pair

JUMP_NS = 10_000.0
"""Cost of marching one ray a call, ns; measured with `tests/bench/speed.py`."""


class Caster:
    """First touched pixels of rays of one filter in a scene."""

    def __init__(self, scene: Scene, kept: Filter) -> None:
        self._scene = scene
        self._whose = np.array([kept.accept]), kept.exclude
        self._view = kept.view(pierce=False)
        self._stack: Stack
        self._accepts: Bools
        self._refuses = False
        self._owed: float | None
        self._plane: tuple[memoryview, tuple[int, ...], memoryview, int, int] | None

    def follow(self, stack: Stack) -> None:
        """Read the scene as it is now."""
        self._stack, self._plane, self._owed = stack, None, None
        self._accepts = self._view.accepts(stack)
        self._refuses = not self._accepts.all()

    # house: way of rays
    def cast(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...]:
        """Row of `raycast.first_touched` for a ray from (x, y) to (x + dx, y + dy), 1/256 px."""
        if self._plane is not None or self._made():
            found = self._jumped(x, y, dx, dy)
            if found is not None:
                return found
        start, step, whose = np.array([[x, y]]), np.array([[dx, dy]]), self._whose if self._refuses else ()
        touched = raycast.first_touched(self._stack, self._scene.bounds, start, step, *whose)
        return tuple(int(column[0]) for column in touched)

    def _made(self) -> bool:
        """Whether the distance field is made; it is made once the rays cast without it cost more than it does."""
        plane = self._scene.distance_field()
        if plane is None:
            return False
        if self._owed is None:
            self._owed = owed_ns(plane, self._scene)
        plane.missed += CAST_RAY_NS - JUMP_NS + len(self._stack) * CAST_PAIR_NS
        if plane.missed <= self._owed and not plane.is_made(self._scene.items):
            return False
        labels = plane.labels.read(self._scene.items)
        distances, (left, top) = plane.read(self._scene.items, labels), plane.corner_xy.tolist()
        self._plane = distances.reshape(-1).data, distances.shape, labels.reshape(-1).data, left, top
        return True

    # house: way of rays
    def _jumped(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...] | None:
        """The same by march; None if the ray must be cast."""
        assert self._plane is not None
        flat, (height, width), labels, left, top = self._plane
        entry, cell, several = distance_field.one_taken(
            flat, (height, width), (x - SUB * left, y - SUB * top), (dx, dy)
        )
        if entry == NOTHING:
            return NOTHING, 0, 0, -1
        if entry < 0 or several:
            return None
        row, column = divmod(cell, width)
        code = labels[(row - PAD) * (width - 2 * PAD) + column - PAD]
        rank = int(self._stack.rank_by_code[code >> 1])
        return (entry, column + left, row + top, rank) if self._accepts[rank] else None


Pair = tuple[float, float]


class OneRay(OneShot, RayHits):
    """Answer of one prepared ray: a list of at most one row; all else is made when it is asked for."""

    __slots__ = ("_found", "_told")  # set at each shot

    _found: tuple[int, ...]

    @cached_property
    def _first(self) -> FirstHits:
        """First hits of the ray as a batch of one."""
        parts = ray_parts_of(self.weapon)
        assert parts is not None  # it was prepared as one
        rays, stack = rays_of(parts, self.shots), self._present.stack
        ends = ends_of_touched(Touched(*np.array(self._found, np.int64).reshape(4, 1)), rays.origin_xy, stack)
        return FirstHits(rays, parts[2], ends, stack)

    @cached_attribute
    def _later(self) -> tuple[Callable[[], Passes], Callable[[], Stops]]:
        return lambda: self._first.passes, lambda: self._first.stops


class ReadyRay(Ready):
    """Prepared weapon of one thin ray that ends at its first hit.

    Bad input is left to `fire`, and so is a ray that starts inside an item if its weapon does not hit that item.
    """

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, ray: RayWeapon) -> None:
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

    # house: hit rule of rays
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
            kernels = kernels_of(sys.modules[__name__])
            if kernels is not self._kernels:
                self._kernels, self._caster = kernels, kernels.Caster(self.scene, self._filter)
            stack = self._items.stack()
            self._caster.follow(stack)
            self._cast, self._ids, self._blocks = self._caster.cast, stack.ids.data, stack.occluder.data
            self._present = Present(self.scene, version, stack, self.scene.bounds, self.weapon, self._filter)
            self._version = version


def direction(degrees: float) -> tuple[int, int]:
    """(cos, sin) times 2**30 of an angle, correctly rounded, equal to `fixed_point.unit`."""
    turns, c, s = quarter_turns(float(degrees))
    return ((c, s), (-s, c), (-c, -s), (s, -c))[turns]
