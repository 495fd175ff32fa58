"""One prepared shot: its rounds as pixels, and its answer, whose columns and plan are made when they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hitplanes.planes.bits.span_walk import OF_PATTERNS
from hitplanes.planes.bits.tiles import Depths, rows_of_spans
from hitplanes.planes.bits.visible import View
from hitplanes.planes.common.caches import cached_attribute
from hitplanes.planes.common.checks import Ints, integer
from hitplanes.planes.common.limits import SUB
from hitplanes.planes.grid.fixed_point import snap, unit_toward
from hitplanes.planes.grid.spans import Box, Spans
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import HitRow, Hits, Rows, rows_of_span_hits
from ..fire.plan import Plan
from ..fire.prefilter import Candidates
from ..fire.spans import QueryContext, SpanHits, direct
from ..kinds.areas import parts_of, pierces
from ..kinds.placements import Placements, Shots, checked_shots, placements_for
from ..kinds.weapon import Weapon

WHOLE = 96
"""Largest side of a pattern that is looked up as a whole, px; larger ones are mostly empty where an object is."""

TILE = 64
"""Side of the chunks of a larger pattern, px."""

PARTS_MAX = 256
"""Most chunks of a pattern that are looked up one by one; with more of them numpy is as fast."""

TURNED_PX = 2
"""Margin for the pixels of a pattern that turns, beyond its reach: pixels that its axis meets, and rounding."""


class Round(NamedTuple):
    """A round of a shot at the origin: its pixel (x, y), its number, and its pixels relative to (x, y)."""

    x: int
    y: int
    number: int
    spans: Spans


PatternChunk = tuple[int, int, int, Depths]
"""A chunk of a round: x and y where it is looked up, relative to the round's pixel; its pixels as integer rows; and
their order by distance."""


@dataclass(frozen=True)
class Frame:
    """Bounds of the pixels of every round of a weapon, for the look-up as integer rows.

    All pixels lie within `reach` px of the round's pixel. A chunk lies in a box of `side` px that begins at
    (corner, corner) from the pixel where it is looked up; if `tiled`, a pattern is cut into several chunks.
    """

    reach: int
    corner: int
    side: int
    tiled: bool


def frame_of(weapon: Weapon) -> Frame | None:
    """Frame of an area weapon; None if it is too large, or if its pixels depend on the fraction of the position."""
    burst, spread, plain = parts_of(weapon)
    if burst and (snap(burst.recoil_xy) % SUB).any():
        return None
    reach = plain.reach_256 // SUB + (TURNED_PX if plain.directed else 0)
    reach += int(snap(spread.radius)) // SUB if spread else 0
    side = 2 * reach + 1
    if side <= WHOLE:
        return Frame(reach, -reach, side, False)
    return Frame(reach, 0, TILE, True) if (side // TILE + 1) ** 2 <= PARTS_MAX else None


def rounds_of(weapon: Weapon, shots: Shots, offset_256: tuple[int, int] | None) -> list[Round]:
    """Rounds that have pixels, of a shot at the origin that is aimed toward an offset, if one is given."""
    if offset_256 is not None:
        shots = shots.aimed(np.stack(unit_toward(*offset_256)).reshape(1, 2))
    volley = placements_for(weapon, shots)
    found: list[Round] = []
    for number in np.unique(volley.round).tolist():
        pellets = np.flatnonzero(volley.round == number)
        x, y = volley.origin_xy[pellets[0]].tolist()
        placed = zip(volley.pattern[pellets].tolist(), volley.xy[pellets].tolist(), strict=True)
        sets = [volley.table.patterns[k].spans.translated(px - x, py - y) for k, (px, py) in placed]
        runs = (np.concatenate([getattr(one, name) for one in sets]) for name in ("y", "x_first", "x_last"))
        spans = Spans.from_runs(*runs)
        if len(spans):
            found.append(Round(x, y, number, spans))
    return found


def pattern_chunks(spans: Spans, frame: Frame, stride: int) -> list[PatternChunk]:
    """Chunks of one round: the whole of it, or its tiles."""
    box = spans.box_xyxy
    if box is None:
        return []
    if not frame.tiled:
        rows = rows_of_spans(spans, (frame.corner, frame.corner), stride)
        return [(0, 0, rows, Depths(rows, stride, frame.corner, frame.corner))]
    found: list[PatternChunk] = []
    for top in range(box[1], box[3] + 1, TILE):
        for left in range(box[0], box[2] + 1, TILE):
            part = _clipped(spans, left, top)
            if len(part):
                rows = rows_of_spans(part, (left, top), stride)
                found.append((left, top, rows, Depths(rows, stride, left, top)))
    return found


def _clipped(spans: Spans, left: int, top: int) -> Spans:
    """Pixels within one tile."""
    first, last = np.maximum(spans.x_first, left), np.minimum(spans.x_last, left + TILE - 1)
    some = (first <= last) & (spans.y >= top) & (spans.y < top + TILE)
    return Spans(spans.y[some], first[some], last[some])


Told = tuple[object, object, object]
"""Arguments of a shot: aim, toward, and its number."""


@dataclass(frozen=True, eq=False)
class Filter:
    """Arguments of `fire` that are the same for all shots of a prepared weapon."""

    accept: int
    exclude: Ints
    seed: int

    def view(self, pierce: bool) -> View:
        """View of the items that its shots accept."""
        return View(pierce, self.accept, tuple(sorted(set(self.exclude[0].tolist()) - {-1})))

    def shots(self, weapon: Weapon, at: object, told: Told) -> Shots:
        """Batch of one shot."""
        aim, toward, number = told
        return checked_shots(weapon, at, aim, toward, self.accept, self.exclude, self.seed, number)


@dataclass(frozen=True, eq=False)
class Present:
    """Snapshot of a scene at one version, with the weapon and its filter."""

    scene: Scene
    version: int
    stack: Stack
    bounds: Box | None
    weapon: Weapon
    filter: Filter


class Answer(Hits):
    """Hits of one shot of a prepared weapon, equal to those of `fire`.

    The number of rows is known. The columns, the verdict counts and the plan are made when they are asked for, from the
    snapshot of the scene.
    """

    _present: Present
    _at: tuple[float, float]
    _told: Told = (None, None, None)

    scene: cached_attribute[Scene] = cached_attribute(lambda one: one._present.scene)
    version: cached_attribute[int] = cached_attribute(lambda one: one._present.version)
    weapon: cached_attribute[Weapon] = cached_attribute(lambda one: one._present.weapon)
    shots: cached_attribute[Shots] = cached_attribute(
        lambda one: one._present.filter.shots(one._present.weapon, one._at, one._told)
    )
    _rows: cached_attribute[Rows] = cached_attribute(lambda one: one._columns())

    def _columns(self) -> Rows:
        raise NotImplementedError

    def of(self, shot: int) -> list[HitRow]:
        """Rows of the shot; its number is 0."""
        self._checked(shot)
        return list(self)

    def _checked(self, shot: int) -> int:
        return integer("shot", shot, 0, 0)

    @cached_attribute
    def _met(self) -> tuple[Placements, SpanHits]:
        """Placements and span hits of the shot in the snapshot."""
        present = self._present
        volley = placements_for(present.weapon, self.shots)
        candidates = Candidates(present.scene.items, present.stack)
        context = QueryContext(present.stack, present.bounds, pierces(present.weapon), candidates, self.plan)
        return volley, direct(volley, self.shots, context)

    def _counted(self) -> Ints:
        return np.asarray(self._met[1].counts.reshape(1, -1, len(OF_PATTERNS)).sum(axis=1))

    @cached_attribute
    def plan(self) -> Plan:
        """Plan of the shot."""
        plan = Plan()
        plan.run("prepared", "looked up; the stages after it ran when they were asked for")
        return plan


class OneShot(Answer, list[HitRow]):
    """Answer of a weapon whose samples are pixels of full weight: a list of its rows.

    It is a list because a call of a Python function for each row would take a tenth of the time of a shot.
    """

    __slots__ = ("_at", "_present")  # set at each shot

    __init__ = list.__init__
    __len__ = list.__len__
    __iter__ = list.__iter__

    def __bool__(self) -> bool:
        return len(self) > 0

    def _columns(self) -> Rows:
        return Rows(*(np.array(column, np.int64) for column in zip(*self, strict=True))) if self else Rows.none()


class Uneven(Answer):
    """Answer of a weapon with several pellets or with falloff.

    The look-up only counts its rows; they are made by a walk when they are read.
    """

    _count = 0

    __init__ = object.__init__

    def append(self, _: HitRow) -> None:
        """Count a row; its samples are not complete."""
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __bool__(self) -> bool:
        return self._count > 0

    def _columns(self) -> Rows:
        if not self._count:
            return Rows.none()
        volley, met = self._met
        return rows_of_span_hits(met, volley, self._present.stack.ids, 0)


def answer_of(weapon: Weapon) -> tuple[Callable[[], Answer], Callable[[Any, HitRow], None]]:
    """Class of the answers of a weapon, and its function that appends a row.

    Called as a function of the class, appending takes a third of the time: `__getattr__` makes attributes slow.
    """
    _, spread, plain = parts_of(weapon)
    return (OneShot, OneShot.append) if spread is None and plain.falloff is None else (Uneven, Uneven.append)
