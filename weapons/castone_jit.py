"""What `castone` does, compiled: one call of a kernel that is given numbers.

All calls work in the same room: the kernel keeps other threads of Python waiting.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, types

from planes.addresses import address, flags_at, ints_at, pointer
from planes.bitrows_jit import EVERYWHERE
from planes.compiled import compiled
from planes.fronttoback_jit import NOBODY, NONE
from planes.items import Stack
from planes.raycast_jit import touched
from planes.scene import Scene
from weapons.oneshot import Filter

__all__ = ["Caster"]

LEFT, TOP, RIGHT, LOW, ITEMS, BOX, OFFSET, MASKS, OCCLUDER, RANK, NEAR, TIMES = range(12)
"""Of a scene: its bounds, how many items rays accept, and addresses: of their columns, and of room to work in."""


@compiled(types.UniTuple(types.int64, 4)(*[types.int64] * 5), nogil=False)
def _cast(x, y, dx, dy, scene_at):
    scene = ints_at(scene_at)
    count, near, times = scene[ITEMS], ints_at(scene[NEAR]), ints_at(scene[TIMES])
    box = carray(pointer(scene[BOX]), (count, 4), np.int64)
    offset, masks, occluder = ints_at(scene[OFFSET]), flags_at(scene[MASKS]), flags_at(scene[OCCLUDER])
    bounds = scene[LEFT], scene[TOP], scene[RIGHT], scene[LOW]
    entry, column, row, at = touched(
        x, y, dx, dy, box, offset, masks, occluder, NONE, NONE, NONE, NOBODY, 0, bounds, near, times
    )
    return entry, column, row, ints_at(scene[RANK])[at] if at >= 0 else at


cast = _cast.overloads[_cast.signatures[0]].entry_point
"""It, without the choice among its types, which takes twice as long as the call."""


class Caster:
    """See `castone.Caster`."""

    def __init__(self, scene: Scene, kept: Filter) -> None:
        self._scene = scene
        self._view = kept.view(pierce=False)
        self._forms = -1
        self._here = np.zeros(TIMES + 1, np.int64)  # it is changed in place: the kernel has its address
        self._at = address(self._here)
        self._kept: tuple[Any, ...] = ()
        self._columns: tuple[Any, ...]

    def follow(self, stack: Stack) -> None:
        """See `castone.Caster`."""
        if stack.forms != self._forms:
            rank = np.flatnonzero(self._view.accepts(stack))
            columns = stack.offset[rank], stack.masks, stack.occluder[rank], rank, *np.empty((2, len(rank)), np.int64)
            self._columns, self._forms = tuple(map(np.ascontiguousarray, columns)), stack.forms
        rank = self._columns[3]
        box = np.ascontiguousarray(stack.box_xyxy if len(rank) == len(stack) else stack.box_xyxy[rank])
        bounds = EVERYWHERE if self._scene.bounds is None else self._scene.bounds
        self._here[:] = [*bounds, len(rank), address(box), *map(address, self._columns)]
        self._kept = box, self._columns

    def cast(self, x: int, y: int, dx: int, dy: int) -> tuple[int, ...]:
        """See `castone.Caster`."""
        found: tuple[int, ...] = cast(x, y, dx, dy, self._at)
        return found
