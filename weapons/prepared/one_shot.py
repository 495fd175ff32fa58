"""One prepared shot: its rounds as pixels, and its answer, whose columns and plan are made when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hitplanes.planes.common.backend import cached_attribute
from hitplanes.planes.common.checks import Ints, integer
from hitplanes.planes.common.limits import SUB
from hitplanes.planes.grid.fixed_point import snap, toward, unit_of
from hitplanes.planes.grid.spans import Box
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.call import request_of
from ..fire.hits import HitRow, Hits, Rows
from ..fire.plan import Plan, absent, unaimed, undrawn
from ..fire.prefilter import may_refuse
from ..fire.strategy import AUTO
from ..kinds.areas import parts_of
from ..kinds.placements import (
    STRAIGHT,
    Shots,
    accepted_of,
    blocking_of,
    checked_shots,
    distinct_patterns,
    pellets_of,
    placements_for,
    placements_of,
)
from ..kinds.weapon import Pattern, PatternTable, Weapon

REACH_MOST = 500
"""Largest distance of a pixel from that of its round, px; larger patterns are left to `fire`."""

PELLETS_PX = 2**19
"""Most pellets of a shot, times the pixels of a spread's box; of others `fire` takes less time, and less is kept."""

TURNED_PX = 2
"""Margin for the pixels of a pattern that turns, beyond its reach: pixels that its axis meets, and rounding."""


class Round(NamedTuple):
    """A round of a shot at the origin.

    Parameters
    ----------
    x, y, number : its pixel, and its number
    pattern : one pattern, relative to (x, y), or to the pixel of each pellet
    pellets_xy : (K, 2) pixels of its pellets, relative to (x, y); None if it has none
    """

    x: int
    y: int
    number: int
    pattern: PatternTable
    pellets_xy: Ints | None = None


def reach_of(weapon: Weapon) -> int | None:
    """Greatest distance of a pixel of an area weapon from that of its round, px.

    None if `fire` answers: if it is too large, if the pixels depend on the fraction of the position, if a line of sight
    is needed, or if pellets are many.
    """
    burst, spread, plain = parts_of(weapon)
    if plain.line_of_sight or (burst and (snap(burst.recoil_xy) % SUB).any()):
        return None
    reach = plain.reach_256 // SUB + (TURNED_PX if plain.directed else 0)
    if spread:
        reach += int(snap(spread.radius)) // SUB
        if placements_of(weapon) * (2 * reach + 1) ** 2 > PELLETS_PX:
            return None
    return reach if reach <= REACH_MOST else None


def rounds_of(weapon: Weapon, shot: Shots, offset_256: tuple[int, int] | None) -> list[Round]:
    """Rounds of a shot at the origin that is aimed toward an offset, if one is given."""
    if offset_256 is not None:
        shot = shot.aimed(toward(*offset_256))
    burst, spread, plain = parts_of(weapon)
    if burst is None:
        pattern, drawn = distinct_patterns(plain, shot.one_direction or STRAIGHT)[0], None
        if spread is not None:
            drawn = pellets_of(spread, shot.seed, shot.number, ORIGIN[:, 0])[0]
        return [Round(0, 0, 0, pattern, drawn)]
    placements = placements_for(weapon, shot)
    turn_xy, pellets = placements.turn_xy, placements.pellets
    patterns: list[Pattern] = [placements.table.patterns[kind] for kind in placements.pattern[::pellets].tolist()]
    drawn = placements.xy.reshape(-1, pellets, 2) - turn_xy[:, None] if spread else [None] * len(turn_xy)
    places = zip(turn_xy.tolist(), range(len(turn_xy)), patterns, drawn, strict=True)
    return [Round(x, y, number, pattern.table, own) for (x, y), number, pattern, own in places]


ORIGIN: Ints = np.zeros((1, 2), np.int64)

Arguments = tuple[object, object, object]
"""Arguments of a shot: aim, toward, and its number."""


@dataclass(frozen=True, eq=False)
class Filter:
    """Arguments of `fire` that are the same for all shots of a prepared weapon."""

    meets: int
    exclude: tuple[int, ...]
    seed: int

    def view(self, pierce: bool) -> View:
        """View of the items that its shots accept."""
        return View(pierce, self.meets, tuple(sorted({*self.exclude} - {-1})))

    def shot_at_origin(self, aim: float | None, number: int) -> Shots:
        """Batch of one shot, whose aim and number are checked."""
        direction = STRAIGHT if aim is None else unit_of(float(aim))
        return Shots(ORIGIN, direction, None, self.meets, self.exclude, number, self.seed, 0, aim)

    def shots(self, weapon: Weapon, at: object, arguments: Arguments) -> Shots:
        """Batch of one shot."""
        aim, toward, number = arguments
        bits = accepted_of(self.meets), blocking_of(self.meets)
        return checked_shots(weapon, at, aim, toward, *bits, self.exclude, self.seed, number)


@dataclass(frozen=True, eq=False)
class Present:
    """Snapshot of a scene at one version, with the weapon and its filter; the roles are of items that decide no hit.

    `near` is where patterns look up what is near them: a `PositionCache`. `cost` (M,) is what a px of each item takes
    from the budget of a ray that has one.
    """

    scene: Scene
    version: int
    stack: Stack
    bounds: Box | None
    weapon: Weapon
    filter: Filter
    imagery: Sequence[Role]
    near: Any = None
    cost: Ints | None = None


class OneShot(Hits, list[HitRow]):
    """Hits of one shot of a prepared weapon, equal to those of `fire`.

    It is a list of its rows, because a call of a Python function for each row would take a tenth of the time of a shot.
    The columns, the verdict counts and the plan are made when they are asked for, from the snapshot of the scene.
    """

    __slots__ = ("_at", "_present")  # set at each shot

    _present: Present
    _at: tuple[float, float]
    _arguments: Arguments = (None, None, None)
    _weighted: cached_attribute[bool] = cached_attribute(lambda hits: parts_of(hits.weapon)[2].falloff is not None)
    scene: cached_attribute[Scene] = cached_attribute(lambda hits: hits._present.scene)
    version: cached_attribute[int] = cached_attribute(lambda hits: hits._present.version)
    _stack: cached_attribute[Stack] = cached_attribute(lambda hits: hits._present.stack)
    weapon: cached_attribute[Weapon] = cached_attribute(lambda hits: hits._present.weapon)
    shots: cached_attribute[Shots] = cached_attribute(
        lambda hits: hits._present.filter.shots(hits._present.weapon, hits._at, hits._arguments)
    )
    _rows: cached_attribute[Rows] = cached_attribute(lambda hits: hits._columns())

    __init__ = list.__init__
    __len__ = list.__len__
    __iter__ = list.__iter__

    def __bool__(self) -> bool:
        return len(self) > 0

    def _columns(self) -> Rows:
        return Rows(*(np.array(column, np.int64) for column in zip(*self, strict=True))) if self else Rows.none()

    def of(self, shot: int) -> list[HitRow]:
        """Rows of the shot; its number is 0."""
        self._checked(shot)
        return list(self)

    def _checked(self, shot: int) -> int:
        return integer("shot", shot, 0, 0)

    def _counted(self) -> Ints:
        request = request_of(self.scene, self._stack, self.weapon, self.shots, AUTO, Plan())
        return late.verdicts.verdicts_of(request, self._rows, "prepared")

    @cached_attribute
    def plan(self) -> Plan:
        """Plan of the shot."""
        plan = Plan()
        if type(self.scene) is not Scene:
            plan.run("past", "moments of it: 1")
        plan.run("prepared", "the weapon is ready for the scene")
        if self._arguments[:2] == (None, None):
            plan.leave_out_all(unaimed, self.weapon)
        present, choosy = self._present, may_refuse(self._stack, self.shots)
        plan.leave_out_all(absent, self._stack, self._weighted, present.bounds is not None, choosy)
        plan.leave_out_all(undrawn, present.imagery)
        return plan
