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

from planes.arrays import Ints

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
    """What a side took for a unit of work, ns: in each round."""

    rounds: list[float] = field(default_factory=list)
    easier: str = ""
    units: int = 0
    compared: bool = False

    @property
    def least(self) -> float:
        return min(self.rounds)

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    def to_dict(self) -> dict[str, Any]:
        return {
            "min_ns": self.least,
            "median_ns": self.median,
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
    cell: Cell, sides: Sequence[Side], works: Iterable[Any], units: int, seconds: float, compare: bool = True
) -> Cell:
    """Let sides answer the works, one for each round, and compare the rows of all who tell rows.

    The first side is the one that the others are compared with. A side that is not `whole` answers as many units as
    it can in the given seconds; the first of the works is for probing and warming up.
    """
    works = iter(works)
    warm_up = next(works)
    share = {side.name: _units(side, warm_up, units, seconds) for side in sides}
    cell.asked = units
    for number, work in enumerate(works):
        answers: dict[str, Any] = {}
        for side in itertools.islice(itertools.cycle(sides), number % len(sides), number % len(sides) + len(sides)):
            times = cell.sides.setdefault(side.name, Times(easier=side.easier, units=share[side.name]))
            ns, answers[side.name] = _timed(side, work, share[side.name])
            times.rounds.append(ns / share[side.name])
        if compare:
            _compare(cell, sides, answers, share)
    cell.sides = {side.name: cell.sides[side.name] for side in sides}
    return cell


def _units(side: Side, work: Any, units: int, seconds: float) -> int:
    """How many units a side answers in a round; a whole one warms up by all of them."""
    if side.whole:
        _timed(side, work, units)
        return units
    probe = min(PROBE, units)
    while True:
        ns, _ = _timed(side, work, probe)
        if probe == units or ns > seconds * 1e9 / 4:
            return max(1, min(units, int(seconds * 1e9 / max(ns / probe, 1))))
        probe = min(4 * probe, units)


def _timed(side: Side, work: Any, units: int) -> tuple[float, Any]:
    if side.ready:
        side.ready()
    with no_collection():
        begin = time.perf_counter_ns()
        answer = side.answer(work, units)
        return time.perf_counter_ns() - begin, answer


@contextmanager
def no_collection() -> Iterator[None]:
    """Time without the collector, as timeit does; what is young is collected before."""
    gc.collect(1)
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _compare(cell: Cell, sides: Sequence[Side], answers: dict[str, Any], share: dict[str, int]) -> None:
    """Compare all rows of the shots that both the first side and another answered."""
    first = next((side for side in sides if side.rows), None)
    if first is None or first.rows is None:
        return
    expected = sorted_rows(first.rows(answers[first.name]))
    cell.rows = len(expected) / share[first.name]
    for side in sides:
        if side is first or side.rows is None:
            continue
        both = min(share[side.name], share[first.name])
        got = sorted_rows(side.rows(answers[side.name]))
        ours = expected[expected[:, 0] < both]
        got = got[got[:, 0] < both]
        cell.sides[side.name].compared = cell.sides[first.name].compared = True
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
