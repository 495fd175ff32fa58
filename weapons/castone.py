"""One ray a call, cast at the items of a scene that may change in between; `castone_jit` has the same class, compiled.

In numpy a ray jumps instead, in Python's own integers, as soon as the scene stood still for so many that the plane for
it pays; those that come to something that the filter refuses, or to several things at once, are cast. Compiled rays
are all cast.
"""

from __future__ import annotations

import numpy as np

from planes import jumps, raycast
from planes.arrays import Bools
from planes.constants import SUB
from planes.items import Stack
from planes.jumps import NOTHING, PAD
from planes.scene import Scene
from weapons.oneshot import Filter
from weapons.rayways import CAST_PAIR_NS, CAST_RAY_NS, owed_ns

__all__ = ["Caster"]


JUMP_NS = 10_000.0
"""What a ray takes that jumps, one a call: by `tests/bench/speed.py`."""


class Caster:
    """Rays of one filter, at a scene."""

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
        """Take note of the scene as it is now."""
        self._stack, self._plane, self._owed = stack, None, None
        self._accepts = self._view.accepts(stack)
        self._refuses = not self._accepts.all()

    def cast(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...]:
        """What `raycast.first_touched` tells of a ray from (x, y) to (x + dx, y + dy), 1/256 px: four whole numbers."""
        if self._plane is not None or self._made():
            found = self._jumped(x, y, dx, dy)
            if found is not None:
                return found
        start, step, whose = np.array([[x, y]]), np.array([[dx, dy]]), self._whose if self._refuses else ()
        touched = raycast.first_touched(self._stack, self._scene.bounds, start, step, *whose)
        return tuple(int(column[0]) for column in touched)

    def _made(self) -> bool:
        """Whether there is a plane now: it is made for the first ray by which it would have paid."""
        plane = self._scene.clearance()
        if plane is None:
            return False
        if self._owed is None:
            self._owed = owed_ns(plane, self._scene)
        plane.missed += CAST_RAY_NS - JUMP_NS + len(self._stack) * CAST_PAIR_NS
        if plane.missed <= self._owed and not plane.is_made(self._scene.items):
            return False
        codes = plane.codes.read(self._scene.items)
        clearance, (left, top) = plane.read(self._scene.items, codes), plane.corner_xy.tolist()
        self._plane = clearance.reshape(-1).data, clearance.shape, codes.reshape(-1).data, left, top
        return True

    def _jumped(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...] | None:
        """The same of a ray that jumps; None if it cannot tell."""
        assert self._plane is not None
        flat, (height, width), codes, left, top = self._plane
        entry, cell, several = jumps.one_taken(flat, (height, width), (x - SUB * left, y - SUB * top), (dx, dy))
        if entry == NOTHING:
            return NOTHING, 0, 0, -1
        if entry < 0 or several:
            return None
        row, column = divmod(cell, width)
        code = codes[(row - PAD) * (width - 2 * PAD) + column - PAD]
        rank = int(self._stack.rank_by_code[code >> 1])
        return (entry, column + left, row + top, rank) if self._accepts[rank] else None
