"""What a method costs: set-up, time of a run with its spread, and memory: the run-time axis of the study."""

from __future__ import annotations

import gc
import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from weapons.decisions import Method

__all__ = ["Cost", "measured"]

RUNS_MAX = 1000
"""Runs of a method that takes no time are enough after so many."""

SLOW = 0.5
"""Seconds after which a method is not run more often, even if it ran less often than was asked for."""


class Cost(NamedTuple):
    """Seconds to set up, seconds of a run (least, median, most of `runs`), bytes kept, and bytes that a run needs.

    What the first run takes longer belongs to the set-up: much is made when it is first needed.
    """

    setup: float
    least: float
    median: float
    most: float
    runs: int
    kept_bytes: int
    run_bytes: int


def measured(method: Method, runs: int, seconds: float) -> tuple[Any, Cost]:
    """Set a method up, run it to warm up, then `runs` times, and on for `seconds`; a slow one at least once.

    Memory is traced in a run of its own, as tracing takes time.

    Returns
    -------
    what a run returned, and its cost
    """
    begin = time.perf_counter()
    run = method.prepare()
    answer = run()
    setup = time.perf_counter() - begin
    times: list[float] = []
    with _undisturbed():
        while not times or _goes_on(times, runs, seconds):
            begin = time.perf_counter()
            run()
            times.append(time.perf_counter() - begin)
    kept, needed = _traced(method, run) if method.kept_bytes is None else (method.kept_bytes(answer), _peak(run))
    return answer, Cost(
        max(setup - min(times), 0.0), min(times), statistics.median(times), max(times), len(times), kept, needed
    )


def _goes_on(times: list[float], runs: int, seconds: float) -> bool:
    """Whether a method is run once more."""
    if len(times) < runs:
        return sum(times) < max(seconds, SLOW)
    return sum(times) < seconds and len(times) < RUNS_MAX


@contextmanager
def _undisturbed() -> Iterator[None]:
    """No garbage is collected while the clock runs."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _traced(method: Method, run: Callable[[], Any]) -> tuple[int, int]:
    """Bytes that another set-up keeps, its first run too; and the most that a run needs beside them."""
    tracemalloc.start()
    try:
        again = method.prepare()
        again()
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return kept, _peak(run)


def _peak(run: Callable[[], Any]) -> int:
    """The most bytes that a run needs at once."""
    tracemalloc.start()
    try:
        run()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
