"""What one prepared shot hit: its rows, and all that `Hits` has beside them when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from planes.arrays import Ints, integer
from planes.items import Stack
from planes.kept import once
from planes.sampling import OF_PATTERNS
from planes.scene import Scene
from planes.spans import Box
from planes.visible import View
from weapons.arsenal import parts_of, pierces
from weapons.candidates import Candidates
from weapons.hits import HitRow, Hits, Rows, rows_of_met
from weapons.plan import Plan
from weapons.resolve import Met, Sight, direct
from weapons.volley import Shots, Volley, checked_shots, volley_of
from weapons.weapon import Weapon

__all__ = ["Answer", "Filter", "OneShot", "Present", "Told", "Uneven", "answer_of"]

Told = tuple[object, object, object]
"""Aim of a shot, what it was aimed toward, and its number."""


@dataclass(frozen=True, eq=False)
class Filter:
    """What a weapon was prepared with: the arguments of `fire` that are the same for all its shots."""

    accept: int
    exclude: Ints
    seed: int

    def view(self, pierce: bool) -> View:
        """What all its shots accept."""
        return View(pierce, self.accept, tuple(sorted(set(self.exclude[0].tolist()) - {-1})))

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


class Answer(Hits):
    """What one shot of a prepared weapon hit: equal to what `fire` gives.

    How many rows there are is known. The columns, the verdict counts and the plan are made when they are asked for,
    from the scene as it was, also if it has changed since.
    """

    _present: Present
    _at: tuple[float, float]
    _told: Told = (None, None, None)

    scene: once[Scene] = once(lambda one: one._present.scene)
    version: once[int] = once(lambda one: one._present.version)
    weapon: once[Weapon] = once(lambda one: one._present.weapon)
    shots: once[Shots] = once(lambda one: one._present.filter.shots(one._present.weapon, one._at, one._told))
    _rows: once[Rows] = once(lambda one: one._columns())

    def _columns(self) -> Rows:
        raise NotImplementedError

    def of(self, shot: int) -> list[HitRow]:
        """Rows of the shot, whose number in the batch is 0."""
        self._checked(shot)
        return list(self)

    def _checked(self, shot: int) -> int:
        return integer("shot", shot, 0, 0)

    @once
    def _met(self) -> tuple[Volley, Met]:
        """Walk the samples of the shot through the stack as it was."""
        present = self._present
        volley = volley_of(present.weapon, self.shots)
        candidates = Candidates(present.scene.items, present.stack)
        sight = Sight(present.stack, present.bounds, pierces(present.weapon), candidates, self.plan)
        return volley, direct(volley, self.shots, sight)

    def _counted(self) -> Ints:
        return np.asarray(self._met[1].counts.reshape(1, -1, len(OF_PATTERNS)).sum(axis=1))

    @once
    def plan(self) -> Plan:
        """What was done for the shot."""
        plan = Plan()
        plan.run("prepared", "looked up; the stages after it ran when they were asked for")
        return plan


class OneShot(Answer, list[HitRow]):
    """One of a weapon whose samples are pixels of full weight: the list of its rows.

    A list is made, counted and read without a call of a function in Python; each would take a tenth of the time of a
    shot.
    """

    __slots__ = ("_at", "_present")  # what is set at each shot

    __init__ = list.__init__
    __len__ = list.__len__
    __iter__ = list.__iter__

    def __bool__(self) -> bool:
        return len(self) > 0

    def _columns(self) -> Rows:
        return Rows(*(np.array(column, np.int64) for column in zip(*self, strict=True))) if self else Rows.none()


class Uneven(Answer):
    """One of a weapon of several pellets, or whose samples weigh less the farther they are.

    Its rows are walked when they are read; those that are looked up only tell how many they are.
    """

    _count = 0

    __init__ = object.__init__

    def append(self, _: HitRow) -> None:
        """Count a row: it has the round and the object, but not all samples."""
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __bool__(self) -> bool:
        return self._count > 0

    def _columns(self) -> Rows:
        if not self._count:
            return Rows.none()
        volley, met = self._met
        return rows_of_met(met, volley, self._present.stack.ids, 0)


def answer_of(weapon: Weapon) -> tuple[Callable[[], Answer], Callable[[Any, HitRow], None]]:
    """How an answer of a weapon is begun, and how it is told a row, the next in order, while the shot is looked up.

    As a function of its class that takes a third of the time: `__getattr__` makes all attributes of answers slow.
    """
    _, spread, plain = parts_of(weapon)
    return (OneShot, OneShot.append) if spread is None and plain.falloff is None else (Uneven, Uneven.append)
