"""What one prepared shot hit: as little as tells it, and all that `Hits` has made of it when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from planes.arrays import Ints
from planes.items import Stack
from planes.sampling import OF_PATTERNS
from planes.scene import Scene
from planes.spans import Box
from weapons.arsenal import pierces
from weapons.candidates import Candidates
from weapons.hits import HitRow, Hits, Rows, rows_of_met
from weapons.plan import Plan
from weapons.resolve import Met, Sight, direct
from weapons.volley import Shots, Volley, checked_shots, volley_of
from weapons.weapon import Weapon

__all__ = ["Filter", "OneShot", "Present", "Told"]

Told = tuple[object, object, object]
"""Aim of a shot, what it was aimed toward, and its number."""


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


class OneShot(Hits):
    """What one shot of a prepared weapon hit: equal to what `fire` gives, and made when it is asked for.

    How many rows there are is known. Their columns, the verdict counts and the plan are worked out from the scene as it
    was, also if it has changed since.
    """

    _present: Present
    _at: tuple[float, float]
    _found: Any
    _met: tuple[Volley, Met]
    _told: Told = (None, None, None)

    __init__ = object.__init__  # one in Python would take a third of the time of a shot

    def __len__(self) -> int:
        return len(self._found)

    def __bool__(self) -> bool:
        return bool(self._found)

    def __iter__(self) -> Iterator[HitRow]:
        return super().__iter__() if self._found else iter(())

    def __getattr__(self, name: str) -> Any:
        """Make what is not there yet."""
        if name in ROWS:
            present = self._present
            self._keep(self._made_rows(), present.scene, present.weapon, self.shots, self.plan)
            self.version = present.version
        elif name in MADE:
            setattr(self, name, MADE[name](self))
        else:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(self, name)

    def _made_rows(self) -> Rows:
        volley, met = self._met
        return rows_of_met(met, volley, self._present.stack.ids, 0) if self._found else Rows.none()

    def _walk(self) -> tuple[Volley, Met]:
        """Walk the samples of the shot through the stack as it was."""
        present = self._present
        volley = volley_of(present.weapon, self.shots)
        candidates = Candidates(present.scene.items, present.stack)
        sight = Sight(present.stack, present.bounds, pierces(present.weapon), candidates, self.plan)
        return volley, direct(volley, self.shots, sight)

    def _counted(self) -> Ints:
        counts = self._met[1].counts.reshape(1, -1, len(OF_PATTERNS)).sum(axis=1)
        counts.flags.writeable = False
        return np.asarray(counts)

    def _planned(self) -> Plan:
        plan = Plan()
        plan.run("prepared", "looked up; the stages after it ran when they were asked for")
        return plan


ROWS = frozenset((*HitRow._fields, "starts"))
MADE: dict[str, Callable[[OneShot], Any]] = {
    "scene": lambda one: one._present.scene,
    "version": lambda one: one._present.version,
    "weapon": lambda one: one._present.weapon,
    "shots": lambda one: one._present.filter.shots(one._present.weapon, one._at, one._told),
    "plan": OneShot._planned,
    "_met": OneShot._walk,
    "_verdicts": OneShot._counted,
    "_scenes": lambda one: None,
    "_walked": lambda one: None,
}
"""What an answer has beside its rows, and how it is made when it is first asked for."""
