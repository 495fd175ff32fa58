"""A weapon made ready for a scene: the thin path for one shot a call.

scene, weapon -> rounds and squares -> one look-up a shot -> hits
"""

from __future__ import annotations

import threading
from math import floor
from types import ModuleType
from typing import Any

import numpy as np

from planes.constants import HALF, POSITION_MAX, SUB
from planes.scene import Scene
from planes.twins import kernels_of
from weapons import squares
from weapons.arsenal import parts_of
from weapons.firing import fire
from weapons.hits import Hits
from weapons.oneshot import Answer, Filter, Present, Told, answer_of
from weapons.pieces import Frame, rounds_of
from weapons.squares import CELL_SHIFT, FARTHEST, ODD, PIXEL, Look
from weapons.weapon import Weapon

__all__ = ["PLAIN", "Ready", "ReadyPattern", "plain_pair"]

AIMS_BYTES = 32 * 2**20
"""Patterns of other aims and numbers that are kept as integer rows, bytes."""

AIM_BYTES = 200
"""What an aim or a number costs beside what is looked up with it, bytes."""

Looks = list[tuple[int, int, Look]]
"""Of each round of a shot its pixel, from the shot's, and the function that looks up what it hits."""

PLAIN = float, int
NUMPY_NUMBERS = frozenset((np.float64, np.float32, np.float16, *(np.dtype(k).type for k in "bBhHiIlLqQ")))


class Ready:
    """A weapon that `prepare` made ready for a scene: `ready.fire(at)` is `fire(scene, weapon, at)`, at less cost.

    What makes a shot cheap is found out when the first shot needs it, and once:

    - the pattern of each aim, and of each number of a `Spread`, with a bit for a pixel;
    - for squares of 32 px of shot positions, the objects near them, with the pixels that a shot could hit; where all
      has moved shots walk the items near them instead, until the scene stands still for more of them.

    With compiled kernels there are no squares. One call of a kernel walks the items, until shots have spent on that as
    much as it takes to compose what can be seen of all objects; or looks at those, if that is done, by any caller.

    Every shot compares the version of the scene, which counts its changes, with that of what was found out. If the
    scene has changed, the squares near the old and the new places of what changed are forgotten first (all of them, if
    the scene no longer knows what changed): no answer is of an older scene. Then, too, it is decided if compiled
    kernels are used.

    Patterns of up to 96 px, and of up to 1000 px cut into tiles, at a position given as two numbers, are answered like
    this; thin rays up to their first hit are cast, see `readyray`. All others, larger patterns, in numpy those near
    which much lies, bursts whose recoil is not of whole pixels, batches and bad input go the way of `fire`.

    Threads may fire one Ready at a scene that none of them changes.
    """

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter) -> None:
        self.scene, self.weapon = scene, weapon
        self._filter = kept

    def fire(self, at: object, aim: object = None, toward: object = None, shot: object = None) -> Hits:
        """Decide what one shot hits; the arguments are those of `fire`."""
        kept = self._filter
        exclude = kept.exclude if kept.exclude.size else None
        return fire(
            self.scene, self.weapon, at, aim=aim, toward=toward, accept=kept.accept, exclude=exclude, seed=kept.seed,
            shot=shot,
        )  # fmt: skip


class ReadyPattern(Ready):
    """One of a pattern that is looked up."""

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter, frame: Frame) -> None:
        super().__init__(scene, weapon, kept)
        _, spread, plain = parts_of(weapon)
        self._frame, self._directed, self._drawn = frame, plain.directed, spread is not None
        self._pierce, self._answer = plain.pierce, answer_of(weapon)[0]
        self._items, self._version = scene.items, -1
        self._lock = threading.Lock()
        self._kernels: ModuleType | None = None
        self._squares: Any
        self._present: Present
        self._aims: dict[object, Looks] = {}
        self._told: dict[tuple[object, object], Looks] = {}
        self._aims_bytes = 0
        self._straight: Look
        self._quick: Any = {}

    def fire(self, at: Any, aim: object = None, toward: object = None, shot: object = None) -> Hits:
        """Decide what one shot hits; the arguments are those of `fire`."""
        if self._items.version != self._version:
            self._follow()
        try:
            if type(at) is tuple:
                x, y = at
                kind = type(x)
                if kind is type(y) and (kind is float or kind is int):
                    if aim is None and toward is None and shot is None:
                        hits, quick = self._answer(), self._quick
                        hits._present, hits._at = self._present, at
                        if quick is None:
                            self._straight(x, y, hits)
                            return hits
                        column, row = floor(x + PIXEL), floor(y + PIXEL)
                        if quick[column >> CELL_SHIFT][row >> CELL_SHIFT]:
                            if x == ODD or y == ODD:  # that is off by a pixel, though in the same square
                                return self._looked_up(at, aim, toward, shot)
                            self._straight(column, row, hits)
                        return hits
                    looks = self._known(aim, toward, shot)
                    if -FARTHEST < x < FARTHEST and -FARTHEST < y < FARTHEST and x != ODD and y != ODD:
                        return self._told_of(at, (aim, None, shot), floor(x + PIXEL), floor(y + PIXEL), looks)
        except (KeyError, ValueError, OverflowError):  # it is not known yet, too far, or no pair
            pass
        return self._looked_up(at, aim, toward, shot)

    def _looked_up(self, at: object, aim: object, toward: object, shot: object) -> Hits:
        """Fire at a square, or with an aim or number, that is not known yet, or at what is no tuple of numbers."""
        place = plain_pair(at)
        looks = None if place is None else self._looks(place, aim, toward, shot)
        if place is None or looks is None or max(map(abs, place)) > FARTHEST:
            return super().fire(at, aim, toward, shot)
        x, y = ((round(SUB * v) + HALF) >> 8 for v in place)
        told = aim, None if toward is None else plain_pair(toward), shot
        try:
            return self._told_of(place, told, x, y, looks)
        except KeyError:  # what is near is too much to be looked up
            return super().fire(at, aim, toward, shot)

    def _told_of(self, at: tuple[float, float], told: Told, x: int, y: int, looks: Looks) -> Answer:
        """Look up all rounds of a shot at a pixel."""
        hits = self._answer()
        hits._present, hits._at, hits._told = self._present, at, told
        for dx, dy, look in looks:
            look(x + dx, y + dy, hits)
        return hits

    def _known(self, aim: object, toward: object, shot: object) -> Looks:
        """Looks of an aim and a number that were asked for before."""
        plain = toward is None and (type(aim) is float or aim is None or type(aim) is int)
        if plain and (shot is None or type(shot) is int):  # True is no number, though it is found under that of 1
            return self._told[aim, shot]
        raise KeyError

    def _looks(self, place: tuple[float, float], aim: object, toward: object, shot: object) -> Looks | None:
        """Looks of a shot; None if an argument is not as plain as that."""
        number, offset = 0, None
        if shot is not None:
            if type(shot) is not int or not 0 <= shot < 2**63:
                return None
            number = shot if self._drawn else 0
        if toward is not None:
            target = plain_pair(toward)
            if target is None or aim is not None:
                return None
            offset = round(SUB * target[0]) - round(SUB * place[0]), round(SUB * target[1]) - round(SUB * place[1])
            if offset == (0, 0):
                return None
        elif aim is not None and not (isinstance(aim, float | int) and type(aim) in PLAIN and abs(aim) <= POSITION_MAX):
            return None
        key = (number, aim, offset) if self._directed else number
        looks = self._aims.get(key)
        if looks is None:
            looks = self._made_looks(key, aim, offset, number)
        if looks and toward is None:
            self._told[aim, shot] = looks
            self._grow(AIM_BYTES)
        return looks

    def _made_looks(self, key: object, aim: object, offset: tuple[int, int] | None, number: int) -> Looks:
        """Make the looks of a shot; those of a shot of which nothing is told are found fastest."""
        shots = self._filter.shots(self.weapon, (0, 0), (aim, None, number))
        looks: Looks = []
        for one in rounds_of(self.weapon, shots, offset):
            look, size = self._squares.look(one)
            looks.append((one.x, one.y, look))
            self._grow(size)
        self._grow(AIM_BYTES)
        self._aims[key] = looks
        straight = (0, None, None) if self._directed else 0
        if key == straight and len(looks) == 1 and looks[0][:2] == (0, 0):
            self._straight, self._quick = looks[0][2], self._squares.quick
        return looks

    def _grow(self, size: int) -> None:
        """Count what is kept of aims, and give it up if it is too much."""
        with self._lock:
            self._aims_bytes += size
            if self._aims_bytes > AIMS_BYTES:
                self._aims, self._told, self._aims_bytes = {}, {}, size

    def _follow(self) -> None:
        """Read the scene as it is now, by the kernels that are to be used now."""
        with self._lock:
            version = self._items.version
            if version == self._version:
                return
            kernels = kernels_of(squares)
            if kernels is not self._kernels:
                self._kernels = kernels
                self._squares = kernels.Squares(self.scene, self.weapon, self._pierce, self._filter, self._frame)
                self._aims, self._told, self._quick = {}, {}, {}
            stack = self._items.stack()
            self._squares.follow(stack)
            self._present = Present(self.scene, version, stack, self.scene.bounds, self.weapon, self._filter)
            self._version = version


def plain_pair(value: object) -> tuple[float, float] | None:
    """Two numbers within the limits as Python's own; None of anything that `fire` must look at more closely."""
    if type(value) is tuple and len(value) == 2 and type(value[0]) is float is type(value[1]):
        pair: Any = value
    elif type(value) is np.ndarray and value.shape == (2,) and value.dtype.kind in "iuf" and value.itemsize <= 8:
        pair = tuple(value.tolist())
    elif type(value) in (tuple, list) and len(value) == 2:  # type: ignore[arg-type]
        pair = tuple(v.item() if type(v) in NUMPY_NUMBERS else v for v in value)  # type: ignore[attr-defined]
    else:
        return None
    for v in pair:
        if type(v) not in PLAIN or not -POSITION_MAX <= v <= POSITION_MAX:
            return None
    x, y = pair
    return x, y
