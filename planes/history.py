"""The past of a scene: what decides, recorded by tick, and read as a scene of its own.

What did not change between two recorded ticks is kept once: a column, a list, or the whole moment. A moment never
changes, so whoever holds one, or a scene made of it, sees nothing of what comes later.
"""

from __future__ import annotations

import math
import pickle
import threading
from bisect import bisect
from collections.abc import Mapping
from typing import Any, NamedTuple, NoReturn, TypeVar
from weakref import WeakValueDictionary

import numpy as np

from planes.arrays import Bools, InputError, Ints, flag, integer, real, shown, within
from planes.constants import HISTORY_TICKS_MAX, SUB, TICK_MAX
from planes.grid256 import quarter_turns, rounded_div
from planes.items import ARRANGEMENTS, COLUMNS, NEVER, NO_BOXES, UNARRANGED, Items, MaskAtlas
from planes.scene import Scene
from planes.spans import Box
from planes.sprite import variant_of

__all__ = ["History", "PastScene"]

T = TypeVar("T")

RUNS_SHOWN = 8
"""Runs of ticks that an error lists; with more of them, how many there are says more."""

PART_BITS = 31
"""A way is cut into fewer than 2**31 parts: the square of their number stays inside int64."""


class PastItems(Items):
    """The items of a scene at one moment, for good.

    Parameters
    ----------
    items : as they are now; masks are laid out anew where too many are no longer in use
    earlier : the moment before, with which all that is still the same is shared
    """

    def __init__(self, items: Items, earlier: PastItems | None) -> None:
        super().__init__()
        before = Items() if earlier is None else earlier
        self.count = items.count
        self.version = self._forgotten = items.version
        self._bounds, self._tiles = items._bounds, items._tiles  # by mask, whoever uses it
        with items._lock:  # a thread that reads the stack may lay the masks out anew
            if items.atlas.wasteful:
                items._compact()
            kept = before.arrangement == items.arrangement
            for name in COLUMNS:
                changed = not kept or name in UNARRANGED
                now = getattr(items, name)[: self.count] if changed else getattr(before, name)
                setattr(self, name, _column(now, getattr(before, name)) if changed else now)
            flat, self.arrangement = items.atlas.flat, items.arrangement
            if items._stack is not None:
                self._stack = (NEVER, items._stack[1].placed(NO_BOXES))  # the order is kept, the boxes are made anew
        self.atlas = before.atlas if flat is before.atlas.flat else _full(flat)
        if kept:
            self.sprites, self.names, self.angles = before.sprites, before.names, before.angles
            self.variants, self.forms = before.variants, before.forms
            return
        self.sprites = _shared(items.sprites, before.sprites)
        self.names = _shared(items.names, before.names)
        self.angles = _shared(items.angles, before.angles)
        self.variants = _shared(items.variants, before.variants)
        self.forms = before.forms if self.variants is before.variants else list(items.forms)

    def _allot(self) -> None:
        """Nothing: the columns are those that were recorded."""

    def between(self, after: PastItems, part: int, parts: int) -> PastItems:
        """These items on their way to a later moment; see `History`.

        Parameters
        ----------
        part, parts : how much of the time has passed, 0 < part < parts
        """
        if after is self:
            return self
        out = PastItems(self, self)
        both = np.flatnonzero(after.alive[: self.count])  # what is gone does not come back
        step = after.position_256[both] - self.position_256[both]
        if step.any():
            position = self.position_256.copy()
            position[both] += _part_of(step, part, parts)
            out.position_256 = _sealed(position)
        if self.angles is not after.angles:
            differ = [i for i in both.tolist() if self.angles[i] != after.angles[i]]
            turns = {i: _short_turn(self.angles[i], after.angles[i]) for i in differ}
            out._turn({i: self.angles[i] + turn * (part / parts) for i, turn in turns.items() if turn})
        return out

    def _boxes_in_order(self, ids: Ints) -> Ints:
        return self.boxes(ids)

    def _turn(self, angles: Mapping[int, float]) -> None:
        """Give some items other angles, and the masks that belong to them."""
        if not angles:
            return
        self.arrangement = next(ARRANGEMENTS)
        for name in COLUMNS:
            setattr(self, name, getattr(self, name).copy())
        self.atlas = _full(self.atlas.flat)
        self.angles, self.forms, self.variants = list(self.angles), list(self.forms), list(self.variants)
        for item, angle in angles.items():
            quarter, c, s = quarter_turns(angle)
            form = self.forms[item]._replace(quarter=quarter, c=c, s=s)
            with within(f"object {item} at {angle:.15g} degrees"):
                variant = variant_of(self.sprites[item], form)
            self.angles[item], self.forms[item], self.variants[item] = angle, form, variant
            self._use([item], [variant])
        for name in COLUMNS:
            _sealed(getattr(self, name))


class Moment(NamedTuple):
    """All that a scene of the past is made of; `told` is the scene's weapons and shots, as bytes."""

    name: str
    categories: tuple[str, ...]
    bounds: Box | None
    told: bytes
    items: PastItems


class PastScene(Scene):
    """A scene as it was at a tick: it answers what a Scene answers, and refuses to be changed.

    Made by `History.at`.

    Parameters
    ----------
    moment : what was recorded
    tick : when that was; of a scene between two recorded ticks a multiple of 1/256

    Attributes
    ----------
    tick : as given
    """

    def __init__(self, moment: Moment, tick: float) -> None:
        super().__init__()
        self.tick = tick
        self.name, self.categories, self._bounds, told, self.items = moment
        self.weapons, self.shots = pickle.loads(told)

    def add(self, *_: Any, **__: Any) -> NoReturn:
        """Refuse: the past has what it had."""
        self._refuse()

    def remove(self, *_: Any, **__: Any) -> NoReturn:
        """Refuse: the past has what it had."""
        self._refuse()

    def move(self, *_: Any, **__: Any) -> NoReturn:
        """Refuse: the past is as it was."""
        self._refuse()

    def set(self, *_: Any, **__: Any) -> NoReturn:
        """Refuse: the past is as it was."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise InputError(f"scene: expected the present one, got that of tick {self.tick:.15g}, which is read-only")


class History:
    """The last ticks of a scene, to fire at what was there.

    Between two recorded ticks a < b, (tick - a) / (b - a) of the time has passed. Positions have gone so much of the
    straight way, rounded once, half to even, to 1/256 px; angles so much of the shorter way, of a half turn clockwise.
    All else, and all of what is there at only one of the two, is as at a. Beyond 2**22 ticks from a to b, the time is
    rounded down to one part in 2**30 of that.

    Threads may record and read at once; none may change the scene while one records.

    Parameters
    ----------
    scene : whose past is kept
    ticks : how many of them, the last ones
    interpolate : whether `at` takes ticks between those recorded

    Raises
    ------
    InputError
        Naming the argument.
    """

    def __init__(self, scene: Scene, ticks: int = 64, interpolate: bool = False) -> None:
        if not isinstance(scene, Scene):
            raise InputError(f"scene: expected a Scene, got {type(scene).__name__}")
        self.scene = scene
        self._most = integer("ticks", ticks, 1, HISTORY_TICKS_MAX)
        self._interpolate = flag("interpolate", interpolate)
        self._moments: dict[int, Moment] = {}
        self._views: WeakValueDictionary[float, PastScene] = WeakValueDictionary()
        self._read: PastScene | None = None
        self._lock = threading.Lock()

    @property
    def ticks(self) -> list[int]:
        """Ticks that can be read, rising."""
        with self._lock:
            return list(self._moments)

    def record(self, tick: int | None = None) -> int:
        """Keep the scene as it is now, and forget the oldest tick if there are too many.

        Parameters
        ----------
        tick : its number, greater than the last; by default the last and 1, and first 0

        Returns
        -------
        its number

        Raises
        ------
        InputError
            If the tick is not whole, or not greater than the last.
        """
        with self._lock:
            last = next(reversed(self._moments), None)
            first, lowest = (0, -TICK_MAX) if last is None else (last + 1, last + 1)
            number = integer("tick", first if tick is None else tick, lowest, TICK_MAX)
            self._moments[number] = self._now(None if last is None else self._moments[last])
            if len(self._moments) > self._most:
                del self._moments[next(iter(self._moments))]
            return number

    def at(self, tick: float) -> PastScene:
        """The scene as it was.

        The same as long as anybody has it, and the last one that was asked for: what was made for it, as indexes and
        planes, is there for the next shot.

        Parameters
        ----------
        tick : one of `ticks`; of a history that interpolates any number between the first and the last of them,
            rounded to 1/256, half to even

        Raises
        ------
        InputError
            If the tick is not there: it says which ones are.
        """
        with self._lock:
            at = self._checked(tick)
            scene = self._views.get(at)
            if scene is None:
                scene = self._views[at] = PastScene(self._moment(at), int(at) if at.is_integer() else at)
            self._read = scene
            return scene

    def _now(self, last: Moment | None) -> Moment:
        """The scene as it is; what is as it was, is the same."""
        scene, items = self.scene, self.scene.items
        before = None if last is None else last.items
        if before is None or (before.version, before.count) != (items.version, items.count):
            before = PastItems(items, before)
        told = pickle.dumps((scene.weapons, scene.shots))
        moment = Moment(scene.name, scene.categories, scene.bounds, told, before)
        return last if last is not None and moment == last else moment

    def _checked(self, tick: object) -> float:
        """A tick that can be read."""
        at = real("tick", tick, -TICK_MAX, TICK_MAX)
        if self._interpolate:
            at = round(SUB * at) / SUB
        if at in self._moments:
            return at
        ticks = list(self._moments)
        if not ticks:
            raise InputError(f"tick: expected one that is recorded, got {shown(tick)}: none is yet")
        if not self._interpolate:
            raise InputError(f"tick: expected one of {_runs(ticks)}, got {shown(tick)}")
        if not ticks[0] < at < ticks[-1]:
            raise InputError(f"tick: expected a number from {ticks[0]} to {ticks[-1]}, got {shown(tick)}")
        return at

    def _moment(self, at: float) -> Moment:
        """What was recorded at a tick, or what lay between two."""
        if at in self._moments:
            return self._moments[int(at)]
        ticks = list(self._moments)
        place = bisect(ticks, at)
        first, last = ticks[place - 1], ticks[place]
        before, after = self._moments[first], self._moments[last]
        part, parts = int(SUB * (at - first)), SUB * (last - first)
        spare = max(parts.bit_length() - PART_BITS, 0)
        return before._replace(items=before.items.between(after.items, part >> spare, parts >> spare))


def _column(now: Ints, before: Ints) -> Ints:
    """The column before, if it is the same; or a copy."""
    if now.shape == before.shape and (now == before).all():
        return before
    return _sealed(now.copy())


def _shared(now: list[T], before: list[T]) -> list[T]:
    """The list before, if it is the same; or a copy."""
    return before if now == before else list(now)


def _sealed(column: Ints) -> Ints:
    column.flags.writeable = False
    return column


def _full(flat: Bools) -> MaskAtlas:
    """An atlas without room: what is added to it goes to an array of its own."""
    return MaskAtlas(flat, len(flat), len(flat))


def _part_of(step: Ints, part: int, parts: int) -> Ints:
    """So much of steps, rounded once, half to even: they are up to 2**49 either way, parts below 2**PART_BITS."""
    whole, rest = np.divmod(step, parts)
    odd = whole * part & 1
    return np.asarray(whole * part - odd + rounded_div(rest * part + odd * parts, parts))


def _short_turn(before: float, after: float) -> float:
    """Degrees from one angle to another, above -180, up to 180."""
    turn = math.fmod(math.fmod(after, 360) - math.fmod(before, 360), 360)
    return turn + 360 if turn <= -180 else turn - 360 if turn > 180 else turn


def _runs(ticks: list[int]) -> str:
    """Rising numbers in a few words."""
    breaks = [i for i in range(1, len(ticks)) if ticks[i] > ticks[i - 1] + 1]
    if len(breaks) >= RUNS_SHOWN:
        return f"the {len(ticks)} recorded from {ticks[0]} to {ticks[-1]}"
    ends = zip([0, *breaks], [*breaks, len(ticks)], strict=True)
    return ", ".join(str(ticks[i]) if j == i + 1 else f"{ticks[i]} to {ticks[j - 1]}" for i, j in ends)
