"""The history of a scene by tick, each tick readable as a scene; and a clock with a fixed time step.

A column, a list or a whole moment that did not change between two recorded ticks is stored once. A moment never
changes, so neither does a scene made of it.
"""

from __future__ import annotations

import copy
import math
import pickle
import threading
import warnings
from bisect import bisect
from collections.abc import Mapping
from typing import Any, NamedTuple, NoReturn, TypeVar
from weakref import WeakValueDictionary

import numpy as np

from ..common.checks import Bools, InputError, Ints, flag, integer, kind_of, real, shown, within
from ..common.limits import HISTORY_TICKS_MAX, SUB, TICK_MAX
from ..grid.fixed_point import rounded_div
from ..grid.spans import Box
from .derived import NEVER, Derived
from .items import ARRANGEMENTS, COLUMNS, EMPTY, NO_BOXES, UNARRANGED, Items
from .objects import RowTable, looked_up
from .scene import Scene
from .variants import MaskAtlas, variant_of, variants_of

T = TypeVar("T")

RUNS_SHOWN = 8  # most runs of ticks that an error lists; of more it gives only the number
PART_BITS = 31  # a step between two ticks has fewer than 2**31 parts: the square of their number stays inside int64


class Snapshot:
    """The columns and lists of the items of a scene at one moment, which never change.

    Parameters
    ----------
    items : the present items; if too many of their masks are unused, the snapshot gets an atlas without those
    earlier : the snapshot of the moment before, with which everything unchanged is shared
    """

    def __init__(self, items: Items, earlier: Snapshot | None) -> None:
        (atlas, stack), self.by_mask = items.settled(), items.by_mask
        self.version, self.arrangement = items.version, items.arrangement
        self.table, self.order = PastTable(items), None if stack is None else stack.placed(NO_BOXES)
        columns: dict[str, Ints] = {} if earlier is None else earlier.columns
        lists: dict[str, list[Any]] = {} if earlier is None else earlier.lists
        arranged = earlier is not None and earlier.arrangement == items.arrangement
        self.columns: dict[str, Ints] = {
            name: columns[name] if arranged and name not in UNARRANGED else self._column(items, name, columns.get(name))
            for name in COLUMNS
        }
        self.lists: dict[str, list[Any]] = lists
        if not arranged:
            self.lists = {name: self._list(items, name, lists.get(name)) for name in EMPTY}
        shared = earlier is not None and earlier.atlas.flat is atlas.flat
        self.atlas: MaskAtlas = earlier.atlas if earlier is not None and shared else _full(atlas.flat)
        self._items: PastItems | None = None

    def _column(self, items: Items, name: str, before: Ints | None) -> Ints:
        """A copy of a column; the earlier one if they are equal."""
        now: Ints = getattr(items, name)[: items.table.height]
        if before is not None and now.shape == before.shape and (now == before).all():
            return before
        return _sealed(now.copy())

    def _list(self, items: Items, name: str, before: list[Any] | None) -> list[Any]:
        """A copy of a list; the earlier one if they are equal."""
        now: list[Any] = getattr(items, name)
        return before if before is not None and now == before else list(now)

    def items(self) -> PastItems:
        """The items, to be read."""
        self._items = self._items or PastItems(self)
        return self._items

    def between(self, after: Snapshot, part: int, parts: int) -> PastItems:
        """Items at part / parts of the time to a later moment, 0 < part < parts; see `History`."""
        if after is self:
            return self.items()
        if self.order is None:
            self.order = self.items().stack().placed(NO_BOXES)
        rows, later = self._in_both(after)
        own, position = copy.copy(self), self.columns["position_256"].copy()
        step = after.columns["position_256"][later] - position[rows]
        if step.any():
            position[rows] += _part_of(step, part, parts)
            own.columns = self.columns | {"position_256": _sealed(position)}
        out = PastItems(own)
        then, to = self.lists["angles"], after.lists["angles"]
        if then is not to or not np.array_equal(rows, later):
            pairs = zip(rows.tolist(), later.tolist(), strict=True)
            turns = {row: (then[row], _short_turn(then[row], to[other])) for row, other in pairs}
            out.turn({row: angle + turn * (part / parts) for row, (angle, turn) in turns.items() if turn})
        return out

    def _in_both(self, after: Snapshot) -> tuple[Ints, Ints]:
        """Rows of the items that are there at both moments, in this one and in the other."""
        (ids, rows), (others, later) = self.table.known, after.table.known
        if ids is others:
            return rows, later
        _, own, other = np.intersect1d(ids, others, assume_unique=True, return_indices=True)
        return rows[own], later[other]


class PastTable(RowTable):
    """The rows that objects had at one moment, by their ids."""

    def __init__(self, items: Items) -> None:
        self.count, self.height = items.table.count, items.table.height
        self.known, self._latest = (items.ids, items.rows), items.table

    @property
    def living(self) -> int:
        """Number of objects."""
        return len(self.known[0])

    def rows(self, ids: Ints) -> Ints:
        """See `RowTable.rows`."""
        return looked_up(ids, *self.known)

    def row(self, item: int) -> int:
        """See `RowTable.row`."""
        return int(self.rows(np.array([item]))[0])

    def name_of_gone(self, item: int) -> str:
        """Name of an object that was removed before that moment: its id never came back."""
        return self._latest.name_of_gone(item)

    def copied(self, ids: Ints, count: int) -> RowTable:
        """See `RowTable.copied`."""
        return self._latest.copied(ids, count)


class PastItems(Items):
    """The items of a scene at one moment, read-only."""

    def __init__(self, snapshot: Snapshot) -> None:
        super().__init__()
        vars(self).update(snapshot.columns)
        vars(self).update(snapshot.lists)
        self._snapshot, self.table, self.arrangement = snapshot, snapshot.table, snapshot.arrangement
        self.version = self._forgotten = snapshot.version
        self.by_mask, self.atlas = snapshot.by_mask, snapshot.atlas
        if snapshot.order is not None:
            self._stack = (NEVER, snapshot.order)

    def _allot(self) -> None:
        """Do nothing: the columns are the recorded ones."""

    def _known(self) -> tuple[Ints, Ints]:
        return self._snapshot.table.known

    def deciding_boxes(self, rows: Ints) -> Ints:
        """Boxes of items that decide hits."""
        return self.boxes(rows)

    def turn(self, angles: Mapping[int, float]) -> None:
        """Set the angles of items by their rows, and their masks."""
        if not angles:
            return
        self.arrangement = next(ARRANGEMENTS)
        for name in COLUMNS:
            setattr(self, name, getattr(self, name).copy())
        self.atlas = _full(self.atlas.flat)
        self.angles, self.transforms, self.variants = list(self.angles), list(self.transforms), list(self.variants)
        looks = self.looks(list(angles)).changed(None, list(angles.values()), None, None, None)
        try:
            variants = variants_of(looks.sprites, looks.transforms)
        except InputError:
            for row, sprite, angle, transform in zip(angles, *looks, strict=True):
                with within(f"object {self.id[row]} at {angle:.15g} degrees"):
                    variant_of(sprite, transform)
            raise
        for row, angle, transform in zip(angles, looks.angles, looks.transforms, strict=True):
            self.angles[row], self.transforms[row] = angle, transform
        self._enter(list(angles), variants)
        for name in COLUMNS:
            _sealed(getattr(self, name))


class Moment(NamedTuple):
    """The record of a scene at one tick; `pickled` holds its weapons and shots."""

    name: str
    categories: tuple[str, ...]
    bounds: Box | None
    pickled: bytes
    snapshot: Snapshot


class PastScene(Scene):
    """A read-only scene as it was at a tick, made by `History.at`.

    Parameters
    ----------
    moment, items : the recorded moment, and its items or those of a time between it and the next
    tick : its tick; between two recorded ticks a multiple of 1/256
    latest : the scene that was recorded, as it is now

    Attributes
    ----------
    tick : as given
    """

    def __init__(self, moment: Moment, items: PastItems, tick: float, latest: Scene) -> None:  # no Scene has more
        self.tick, self._latest = tick, latest
        self.name, self.categories, self._bounds, pickled, _ = moment
        self._items = items
        self.derived = Derived(self._bounds)
        try:
            self.weapons, self.shots = pickle.loads(pickled)
        except Exception as error:
            raise _not_plain(error) from error

    @property
    def latest(self) -> Scene:
        """The scene that was recorded, as it is now."""
        return self._latest

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        """Refuse: the past is as it was."""
        raise InputError(f"scene: expected the present one, got that of tick {self.tick:.15g}, which is read-only")

    add = remove = move = set = carve = rename = _refuse


class History:
    """The last ticks of a scene, for shots at its past.

    At a tick between two recorded ticks a < b the fraction (tick - a) / (b - a) of the time has passed. It is rounded
    down to a multiple of 2**-30 if a and b are more than 2**22 ticks apart. By this fraction

    - positions move straight, rounded once, half to even, to 1/256 px;
    - angles turn the shorter way, a half turn clockwise;
    - everything else is as at a, including objects that exist at only one of the two.

    Several threads may record and read at once; none may change the scene during a recording.

    Parameters
    ----------
    scene : the scene to record
    ticks : most ticks that are kept
    interpolate : whether `at` takes ticks between the recorded ones

    Raises
    ------
    InputError
        If an argument is not valid.
    """

    def __init__(self, scene: Scene, ticks: int = 64, interpolate: bool = False) -> None:
        if not isinstance(scene, Scene):
            raise InputError(f"scene: expected a Scene, got {kind_of(scene)}")
        self.scene = scene
        self._most = integer("ticks", ticks, 1, HISTORY_TICKS_MAX)
        self._interpolate = flag("interpolate", interpolate)
        self._moments: dict[int, Moment] = {}
        self._views: WeakValueDictionary[float, PastScene] = WeakValueDictionary()
        self._read: PastScene | None = None
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the recorded moments with the scene; equal columns of moments are stored once."""
        with self._lock:
            snapshots = {id(moment.snapshot): moment.snapshot for moment in self._moments.values()}
            states: dict[int, Any] = {number: snapshot.items().state() for number, snapshot in snapshots.items()}
            tables: dict[int, RowTable] = {}
            for number, state in states.items():
                state["table"] = tables.setdefault(id(snapshots[number].table.known[0]), state["table"])
            moments = {
                tick: moment._replace(snapshot=states[id(moment.snapshot)]) for tick, moment in self._moments.items()
            }
        return _restored_history, (self.scene, self._most, self._interpolate, moments)

    def __deepcopy__(self, memo: dict[int, Any]) -> History:
        _, (scene, *rest) = self.__reduce__()
        return _restored_history(copy.deepcopy(scene, memo), *rest)

    @property
    def ticks(self) -> list[int]:
        """Ticks that can be read, rising."""
        with self._lock:
            return list(self._moments)

    def record(self, tick: int | None = None) -> int:
        """Record the present scene, and forget the oldest tick if there are too many.

        Parameters
        ----------
        tick : number of the tick, greater than the last; by default the last plus 1, beginning at 0

        Returns
        -------
        number of the tick

        Raises
        ------
        InputError
            If the tick is not whole, or not greater than the last; or if the scene's weapons or shots cannot be kept.
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
        """The scene as it was at a tick.

        The same object is returned while it is referenced, and the last one is kept: its indexes and planes serve
        further shots.

        Parameters
        ----------
        tick : one of `ticks`; if the history interpolates, any number from the first to the last of them, rounded to
            1/256, half to even

        Raises
        ------
        InputError
            If the tick is not recorded; the message lists the recorded ones.
        """
        with self._lock:
            at = self._checked(tick)
            scene = self._views.get(at)
            if scene is None:
                tick = int(at) if at.is_integer() else at
                scene = self._views[at] = PastScene(*self._moment(at), tick, self.scene)
            self._read = scene
            return scene

    def _now(self, last: Moment | None) -> Moment:
        """The moment of the present scene; it shares everything unchanged with the last one."""
        scene, items = self.scene, self.scene.items
        before = None if last is None else last.snapshot
        if before is None or (before.version, before.table.count) != (items.version, items.count):
            before = Snapshot(items, before)
        try:
            pickled = pickle.dumps((scene.weapons, scene.shots))
        except Exception as error:  # an object that cannot be pickled may raise anything
            raise _not_plain(error) from error
        moment = Moment(scene.name, scene.categories, scene.bounds, pickled, before)
        return last if last is not None and moment == last else moment

    def _checked(self, tick: object) -> float:
        """Check that a tick can be read."""
        at = real("tick", tick, -TICK_MAX, TICK_MAX)
        if self._interpolate:
            at = round(SUB * at) / SUB
        if at in self._moments:
            return at
        ticks = list(self._moments)
        if not ticks:
            raise InputError(f"tick: expected one that is recorded, got {shown(tick)}: none is yet")
        if not self._interpolate:
            between = "" if at.is_integer() else "; to read between them, make the History with interpolate=True"
            raise InputError(f"tick: expected one of {_runs(ticks)}, got {shown(tick)}{between}")
        if not ticks[0] < at < ticks[-1]:
            raise InputError(f"tick: expected a number from {ticks[0]} to {ticks[-1]}, got {shown(tick)}")
        return at

    def _moment(self, at: float) -> tuple[Moment, PastItems]:
        """The recorded moment of a tick, or the one before it, and the items of that time."""
        if at in self._moments:
            moment = self._moments[int(at)]
            return moment, moment.snapshot.items()
        ticks = list(self._moments)
        place = bisect(ticks, at)
        first, last = ticks[place - 1], ticks[place]
        before, after = self._moments[first], self._moments[last]
        part, parts = int(SUB * (at - first)), SUB * (last - first)
        spare = max(parts.bit_length() - PART_BITS, 0)
        return before, before.snapshot.between(after.snapshot, part >> spare, parts >> spare)


def _restored_history(scene: Scene, most: int, interpolate: bool, moments: dict[int, Any]) -> History:
    """A history of the parts that copies and pickles take; its moments share masks and columns again."""
    history, atlas, made = History(scene, most, interpolate), MaskAtlas(), dict[int, Snapshot]()
    last: Snapshot | None = None
    for tick, moment in moments.items():
        if id(moment.snapshot) not in made:
            last = made[id(moment.snapshot)] = Snapshot(Items.restored(moment.snapshot, atlas), last)
            last.version = 0  # of no present scene, which has changed at least once
        history._moments[tick] = moment._replace(snapshot=made[id(moment.snapshot)])
    return history


def _not_plain(error: Exception) -> InputError:
    """The error for weapons or shots that cannot be pickled."""
    return InputError(f"scene: expected weapons and shots of plain JSON, got a value that cannot be kept: {error}")


def _sealed(column: Ints) -> Ints:
    column.flags.writeable = False
    return column


def _full(flat: Bools) -> MaskAtlas:
    """An atlas without spare room: adding a mask to it makes a new array."""
    return MaskAtlas(flat, len(flat), len(flat))


def _part_of(step: Ints, part: int, parts: int) -> Ints:
    """Compute step * part / parts, rounded half to even, for |step| up to 2**49 and parts below 2**PART_BITS."""
    whole, rest = np.divmod(step, parts)
    odd = whole * part & 1
    return np.asarray(whole * part - odd + rounded_div(rest * part + odd * parts, parts))


def _short_turn(before: float, after: float) -> float:
    """Degrees from one angle to another the shorter way, in (-180, 180]."""
    turn = math.fmod(math.fmod(after, 360) - math.fmod(before, 360), 360)
    return turn + 360 if turn <= -180 else turn - 360 if turn > 180 else turn


def _runs(ticks: list[int]) -> str:
    """Text for rising numbers, as runs."""
    breaks = [i for i in range(1, len(ticks)) if ticks[i] > ticks[i - 1] + 1]
    if len(breaks) >= RUNS_SHOWN:
        return f"the {len(ticks)} recorded from {ticks[0]} to {ticks[-1]}"
    ends = zip([0, *breaks], [*breaks, len(ticks)], strict=True)
    return ", ".join(str(ticks[i]) if j == i + 1 else f"{ticks[i]} to {ticks[j - 1]}" for i, j in ends)


NANOSECONDS = 10**9  # nanoseconds in a second: time is a whole number of them, and a step has as many whole parts

ELAPSED_MAX = 10**6
"""Longest time between two calls, s (12 days): in nanoseconds it is whole in float64, with bits to spare."""


class FixedStep:
    """A clock that turns the time between pictures into whole steps of a simulation.

    The number of steps depends only on the sum of the times, each rounded to whole nanoseconds: a simulation runs the
    same at 30 pictures a second and at 144.

        clock = FixedStep(240)
        while playing:
            for tick in clock.advance(seconds_since_last_picture):
                simulate(tick)  # 1 / 240 s
            draw(clock.fraction)  # so far from the last step to the next

    Parameters
    ----------
    rate_hz : steps a second, a whole number
    most : most steps of one call; None for all that are due. Without a limit a simulation that is slower than the
        time it simulates falls ever further behind. With one it runs slower instead: whole steps beyond the limit are
        dropped with a RuntimeWarning that says how many, and counted in `dropped`

    Attributes
    ----------
    tick : steps given so far
    dropped : steps dropped so far

    Raises
    ------
    InputError
        If an argument is not valid.

    References
    ----------
    Fiedler, "Fix your timestep!" (2004).
    """

    def __init__(self, rate_hz: int, *, most: int | None = None) -> None:
        self.rate_hz = integer("rate_hz", rate_hz, 1, NANOSECONDS)
        self.most = None if most is None else integer("most", most, 1, ELAPSED_MAX * NANOSECONDS)
        self.tick = 0
        self.dropped = 0
        self._rest = 0

    def advance(self, elapsed_s: float) -> range:
        """Let time pass, and return the ticks of the steps that are due; the first tick is 0.

        Parameters
        ----------
        elapsed_s : time since the last call, s

        Raises
        ------
        InputError
            If the time is not finite, is negative, or is longer than 12 days.
        """
        passed = round(real("elapsed_s", elapsed_s, 0, ELAPSED_MAX) * NANOSECONDS)
        due, self._rest = divmod(self._rest + passed * self.rate_hz, NANOSECONDS)
        steps = due if self.most is None else min(due, self.most)
        first = self.tick
        self.tick += steps
        if steps < due:
            self.dropped += due - steps
            message = f"FixedStep: dropped {due - steps} of {due} steps that were due at tick {self.tick}"
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        return range(first, self.tick)

    @property
    def fraction(self) -> float:
        """Fraction of a step, in [0, 1), that has passed since the last one; it interpolates between two states."""
        return self._rest / NANOSECONDS
