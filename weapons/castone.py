"""One ray a call, cast at the items of a scene that may change in between; `castone_jit` has the same class, compiled.

In numpy a ray jumps instead, in Python's own integers, as soon as the scene stood still for so many that the plane for
it pays; those that touch several things at once, or refuse any, are cast.
"""

from __future__ import annotations

import numpy as np

from planes import jumps, raycast
from planes.constants import SUB
from planes.items import Stack
from planes.jumps import NOTHING, PAD
from planes.scene import Scene
from planes.visible import View
from weapons.guns import Traced
from weapons.oneshot import Filter
from weapons.rayways import chosen_way

__all__ = ["Caster"]


class Caster:
    """What rays are cast at, with the filter that they have."""

    def __init__(self, scene: Scene, ray: Traced, kept: Filter) -> None:
        self._scene, self._ray = scene, ray
        self._accept, self._exclude = np.array([kept.accept]), kept.exclude
        self._view = View(False, kept.accept, tuple(set(kept.exclude[0].tolist()) - {-1}))
        self._stack: Stack
        self._refuses = False
        self._plane: tuple[memoryview, tuple[int, ...], memoryview, int, int] | None

    def follow(self, stack: Stack) -> None:
        """Take note of the scene as it is now."""
        self._stack, self._plane = stack, None
        self._refuses = not self._view.accepts(stack).all()

    def cast(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...]:
        """What `raycast.first_touched` tells of a ray from (x, y) to (x + dx, y + dy), 1/256 px."""
        if not self._refuses and (self._plane is not None or self._made()):
            found = self._jumped(x, y, dx, dy)
            if found is not None:
                return found
        start, step, accept = np.array([[x, y]]), np.array([[dx, dy]]), self._accept if self._refuses else None
        touched = raycast.first_touched(self._stack, self._scene.bounds, start, step, accept, self._exclude)
        return tuple(int(column[0]) for column in touched)

    def _made(self) -> bool:
        """Whether there is a plane now, as it pays."""
        way = chosen_way("auto", False, self._ray, self._scene, self._stack, 1)
        if way.plane is not None:
            codes = way.plane.codes.read(self._scene.items)
            clearance, (left, top) = way.plane.read(self._scene.items, codes), way.plane.corner_xy.tolist()
            self._plane = clearance.reshape(-1).data, clearance.shape, codes.reshape(-1).data, left, top
        return self._plane is not None

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
        return entry, column + left, row + top, int(self._stack.rank_by_code[code >> 1])
