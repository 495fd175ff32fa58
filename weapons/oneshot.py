"""What one prepared shot hit: as little as tells it, and all that `Hits` has made of it when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from planes.arrays import Ints, integer
from planes.constants import HALF, SUB, WEIGHT_FULL
from planes.grid256 import snap
from planes.items import Stack
from planes.sampling import OF_PATTERNS
from planes.scene import Scene
from planes.spans import Box
from weapons.arsenal import parts_of, pierces
from weapons.candidates import Candidates
from weapons.hits import HitRow, Hits, Rows, rows_of_met
from weapons.pieces import Piece
from weapons.plan import Plan
from weapons.resolve import Met, Sight, direct
from weapons.volley import Shots, Volley, checked_shots, volley_of
from weapons.weapon import Weapon

__all__ = ["Filter", "OneShot", "Present", "Told"]

Told = tuple[object, object, object]
"""Aim of a shot, what it was aimed toward, and its number."""


Tile = tuple[int, int, int, int, int, int]
"""Of what a piece shares with a tile of an object: round, squared distance, y and x of the nearest, id, pixels."""


@dataclass(frozen=True, eq=False)
class Filter:
    """What a weapon was prepared with: the arguments of `fire` that are the same for all its shots."""

    accept: int
    exclude: Ints
    seed: int

    def shots(self, weapon: Weapon, at: object, told: Told) -> Shots:
        """One shot as a batch."""
        aim, toward, number = told
        return checked_shots(weapon, at, aim, toward, self.accept, self.exclude, self.seed, number)


@dataclass(frozen=True, eq=False)
class Present:
    """A scene at one version, as it decides: it does not change when the scene does."""

    scene: Scene
    version: int
    stack: Stack
    bounds: Box | None
    weapon: Weapon
    filter: Filter
    stride: int
    straight: list[Piece]

    @cached_property
    def even(self) -> bool:
        """Whether each sample is a pixel of full weight: its rows can be told from the pixels that were shared."""
        _, spread, plain = parts_of(self.weapon)
        return spread is None and plain.falloff is None

    @cached_property
    def recoil_xy(self) -> tuple[int, int]:
        """Whole pixels from each round to the next."""
        burst = parts_of(self.weapon)[0]
        x, y = (snap(burst.recoil_xy) // SUB).tolist() if burst else (0, 0)
        return x, y


class OneShot(Hits):
    """What one shot of a prepared weapon hit: equal to what `fire` gives, and made when it is asked for.

    How many rows there are is known. Their columns, the verdict counts and the plan are worked out from the scene as it
    was, also if it has changed since.
    """

    _present: Present
    _at: tuple[float, float]
    _found: Any
    _pieces: list[Piece]
    _cells: Any
    _told: Told = (None, None, None)

    __init__ = object.__init__  # one in Python would take a third of the time of a shot

    def __len__(self) -> int:
        return len(self._found)

    def __bool__(self) -> bool:
        return bool(self._found)

    def __iter__(self) -> Iterator[HitRow]:
        return iter(self._listed) if self._found else iter(())

    def of(self, shot: int) -> list[HitRow]:
        """Rows of the shot, whose number in the batch is 0."""
        self._checked(shot)
        return list(self)

    def _checked(self, shot: int) -> int:
        return integer("shot", shot, 0, 0)

    def __getattr__(self, name: str) -> Any:
        """Make what is not there yet."""
        if name not in MADE:
            return super().__getattr__(name)
        setattr(self, name, MADE[name](self))
        return getattr(self, name)

    def _made_rows(self) -> Rows:
        if not self._found:
            return Rows.none()
        if self._present.even:
            return Rows(*(np.array(column, np.int64) for column in zip(*self._listed, strict=True)))
        volley, met = self._met
        return rows_of_met(met, volley, self._present.stack.ids, 0)

    def _list(self) -> list[HitRow]:
        """Rows in their order."""
        present = self._present
        if not present.even:
            return list(super().__iter__())
        x, y = ((round(SUB * v) + HALF) >> 8 for v in self._at)
        met: list[Tile] = []
        cells = self._cells if isinstance(self._cells, list) else [self._cells]
        for (dx, dy, rows, number, depths), cell in zip(self._pieces, cells, strict=True):
            place = (y + dy) * present.stride + x + dx
            for item, bits, base in cell:
                shift = place - base
                hit = (bits >> shift if shift >= 0 else bits << -shift) & rows
                if hit:
                    met.append((number, *depths.nearest(hit), item, hit.bit_count()))
        if len(met) > len(self._found):
            met = _gathered(met)
        met.sort()
        if any(one[:4] == other[:4] for one, other in pairwise(met)):  # pixels that are pierced: the front one first
            met.sort(key=lambda one: (*one[:4], present.stack.rank_of[one[4]]))
        shift_x, shift_y = present.recoil_xy
        row = HitRow._make
        return [
            row((0, n, item, count, count, count * WEIGHT_FULL, 1, (x + dx + n * shift_x, y + dy + n * shift_y), near))
            for n, near, dy, dx, item, count in met
        ]

    def _walk(self) -> tuple[Volley, Met]:
        """Walk the samples of the shot through the stack as it was."""
        present = self._present
        volley = volley_of(present.weapon, self.shots)
        candidates = Candidates(present.scene.items, present.stack)
        sight = Sight(present.stack, present.bounds, pierces(present.weapon), candidates, self.plan)
        return volley, direct(volley, self.shots, sight)

    def _counted(self) -> Ints:
        return np.asarray(self._met[1].counts.reshape(1, -1, len(OF_PATTERNS)).sum(axis=1))

    def _planned(self) -> Plan:
        plan = Plan()
        plan.run("prepared", "looked up; the stages after it ran when they were asked for")
        return plan


def _gathered(met: list[Tile]) -> list[Tile]:
    """Add up what lies in several tiles, or pieces, by round and object."""
    every: dict[tuple[int, int], Tile] = {}
    for one in met:
        key = one[0], one[4]
        other = every.get(key)
        every[key] = one if other is None else (*min(one[:4], other[:4]), one[4], one[5] + other[5])
    return list(every.values())


MADE: dict[str, Callable[[OneShot], Any]] = {
    "scene": lambda one: one._present.scene,
    "version": lambda one: one._present.version,
    "weapon": lambda one: one._present.weapon,
    "shots": lambda one: one._present.filter.shots(one._present.weapon, one._at, one._told),
    "plan": OneShot._planned,
    "_rows": OneShot._made_rows,
    "_met": OneShot._walk,
    "_listed": OneShot._list,
    "_pieces": lambda one: one._present.straight,
}
"""What an answer has beside its rows, and how it is made when it is first asked for."""
