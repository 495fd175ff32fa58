"""Races: every side answers the same work in every round, in turn, so that ratios are of one run."""

from __future__ import annotations

import gc
import itertools
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hitplanes.planes.common.checks import Ints

__all__ = [
    "PROBE",
    "Cell",
    "DisagreementError",
    "Side",
    "Times",
    "bandwidth",
    "no_collection",
    "race",
    "sorted_rows",
    "told",
]

PROBE = 16
"""Units of work by which a side tells how many it can answer in its time."""


class DisagreementError(AssertionError):
    """Sides that should give the same rows do not."""


@dataclass
class Side:
    """One who answers.

    Parameters
    ----------
    answer : of the work and how many units of it; only this is timed
    rows : (K, 3) shot, object, samples of an answer, to be compared; None where it answers another question
    easier : in what its question is easier than ours
    ready : what goes before each call, untimed
    whole : answers all of the work, however long it takes
    """

    name: str
    answer: Callable[[Any, int], Any]
    rows: Callable[[Any], Any] | None = None
    easier: str = ""
    ready: Callable[[], object] | None = None
    whole: bool = False


@dataclass
class Times:
    """What a side took for a unit of work, ns: in each round, and for the first work of each alone."""

    rounds: list[float] = field(default_factory=list)
    firsts: list[float] = field(default_factory=list)
    easier: str = ""
    units: int = 0
    compared: bool = False

    @property
    def least(self) -> float:
        return min(self.rounds)

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    @property
    def first(self) -> float:
        """The median of the first works: what other sides left in the caches is of no use to them."""
        return statistics.median(self.firsts or self.rounds)

    def to_dict(self) -> dict[str, Any]:
        return {
            "min_ns": self.least,
            "median_ns": self.median,
            "first_ns": self.first,
            "rounds_ns": self.rounds,
            "units": self.units,
            "easier": self.easier,
            "rows_compared": self.compared,
        }


@dataclass
class Cell:
    """One line of a table: the sides by name, and what else was measured; `rows` are those of a unit of work."""

    section: str
    what: str
    objects: int
    sides: dict[str, Times] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    unit: str = "ns a shot"
    asked: int = 0
    rows: float | None = None

    def ratio(self, peer: str, ours: str) -> float | None:
        """How many times as long a peer takes, by the least of each."""
        if peer not in self.sides or ours not in self.sides:
            return None
        return self.sides[peer].least / self.sides[ours].least

    def to_dict(self) -> dict[str, Any]:
        head = {
            "section": self.section,
            "what": self.what,
            "objects": self.objects,
            "asked": self.asked,
            "rows": self.rows,
        }
        sides = {name: times.to_dict() for name, times in self.sides.items()}
        return {**head, "unit": self.unit, "sides": sides, "values": self.values}


def race(
    cell: Cell, sides: Sequence[Side], runs: Iterable[Sequence[Any]], units: int, seconds: float, compare: bool = True
) -> Cell:
    """Let sides answer the runs, one for each round, and compare the rows of all who tell rows.

    A run is works that are answered one after the other, without anything between them. All sides have the same time
    for it: a `whole` one answers as many works as it can in the given seconds, and one at least; another as many units
    of the first work. The first side is the one that the others are compared with; the first of the runs is for
    probing and warming up.
    """
    runs = iter(runs)
    warm_up = next(runs)
    shares = {side.name: _share(side, warm_up, units, seconds) for side in sides}
    cell.asked = units
    for number, run in enumerate(runs):
        answers: dict[str, list[Any]] = {}
        for side in itertools.islice(itertools.cycle(sides), number % len(sides), number % len(sides) + len(sides)):
            works, share = shares[side.name]
            times = cell.sides.setdefault(side.name, Times(easier=side.easier, units=works * share))
            first, ns, answers[side.name] = _timed(side, run[:works], share)
            times.firsts.append(first / share)
            times.rounds.append(ns / (works * share))
        if compare:
            _compare(cell, sides, answers)
    cell.sides = {side.name: cell.sides[side.name] for side in sides}
    if longer := {name: cell.sides[name].first for name, (works, _) in shares.items() if works > 1}:
        cell.values["first of a run, median"] = longer
    return cell


def _share(side: Side, run: Sequence[Any], units: int, seconds: float) -> tuple[int, int]:
    """How many works a side answers in a round, and how many units of each; a whole one warms up by one of them."""
    if side.whole:
        _timed(side, run[:1], units)
        _, ns, _ = _timed(side, run[:1], units)
        return max(1, min(len(run), int(seconds * 1e9 / ns))), units
    probe = min(PROBE, units)
    while True:
        _, ns, _ = _timed(side, run[:1], probe)
        if probe == units or ns > seconds * 1e9 / 4:
            return 1, max(1, min(units, int(seconds * 1e9 / max(ns / probe, 1))))
        probe = min(4 * probe, units)


def _timed(side: Side, works: Sequence[Any], units: int) -> tuple[float, float, list[Any]]:
    """What the first work takes, what all take, and their answers."""
    if side.ready:
        side.ready()
    answers: list[Any] = []
    with no_collection():
        begin = time.perf_counter_ns()
        answers.append(side.answer(works[0], units))
        first = time.perf_counter_ns()
        for work in works[1:]:
            answers.append(side.answer(work, units))
        return first - begin, time.perf_counter_ns() - begin, answers


@contextmanager
def no_collection() -> Iterator[None]:
    """Time without the collector, as timeit does; what is young is collected before."""
    gc.collect(1)
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _compare(cell: Cell, sides: Sequence[Side], answers: dict[str, list[Any]]) -> None:
    """Compare all rows of the works, or of the part of the first work, that the first side and another answered."""
    first = next((side for side in sides if side.rows), None)
    if first is None or first.rows is None:
        return
    expected = [sorted_rows(first.rows(answer)) for answer in answers[first.name]]
    cell.rows = sum(map(len, expected)) / cell.sides[first.name].units
    for side in sides:
        if side is first or side.rows is None:
            continue
        part = min((cell.sides[one.name].units for one in (first, side) if not one.whole), default=None)
        cell.sides[side.name].compared = cell.sides[first.name].compared = True
        for wanted, answer in zip(expected, answers[side.name], strict=False):
            told = sorted_rows(side.rows(answer))
            ours, got = (rows if part is None else rows[rows[:, 0] < part] for rows in (wanted, told))
            if not np.array_equal(ours, got):
                raise DisagreementError(_difference(cell, first.name, side.name, ours, got))


def _difference(cell: Cell, name: str, other: str, ours: Ints, got: Ints) -> str:
    one, two = set(map(tuple, ours.tolist())), set(map(tuple, got.tolist()))
    where = f"{cell.section}, {cell.what}, {cell.objects} objects"
    return (
        f"{where}: rows (shot, object, samples) of {name} and {other} differ: {len(one)} and {len(two)}; only "
        f"{name}: {sorted(one - two)[:5]}; only {other}: {sorted(two - one)[:5]}"
    )


def sorted_rows(rows: Any) -> Ints:
    """Rows (K, 3) in one order."""
    array = np.asarray(rows, np.int64).reshape(-1, 3)
    return array[np.lexsort(array.T[::-1])]


def told(ns: float) -> str:
    """A time in three digits or so."""
    for unit, size in (("ns", 1.0), ("us", 1e3), ("ms", 1e6), ("s", 1e9)):
        if ns < 1000 * size or unit == "s":
            value = ns / size
            return f"{value:.0f} {unit}" if value >= 100 else f"{value:.3g} {unit}"
    raise AssertionError


def bandwidth() -> dict[str, float]:
    """Bytes a second of this machine, best of some rounds: copies count what is read and what is written."""
    found: dict[str, float] = {}
    for name, size in (("64 MB", 1 << 26), ("256 kB", 1 << 18), ("32 kB", 1 << 15)):
        source = np.arange(size // 8, dtype=np.int64)
        target, counts = np.empty_like(source), np.empty(len(source), np.uint8)
        again = max(1, (1 << 26) // size)
        found[f"copy {name}"] = 2 * size * again / _best(lambda a=source, b=target: np.copyto(b, a), again)
        found[f"sum {name}"] = size * again / _best(lambda a=source: a.sum(), again)
        found[f"popcount {name}"] = size * again / _best(lambda a=source, b=counts: np.bitwise_count(a, out=b), again)
    return found


def _best(work: Callable[[], object], again: int) -> float:
    best = float("inf")
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(again):
            work()
        best = min(best, time.perf_counter() - begin)
    return best
