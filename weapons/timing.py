"""What a method costs: set-up, time of a run with its spread, and memory: the run-time axis of the study."""

from __future__ import annotations

import gc
import statistics
import time
import tracemalloc
from typing import Any, NamedTuple

from weapons.decisions import Method

__all__ = ["Cost", "measured"]


class Cost(NamedTuple):
    """Seconds to set up, seconds of a run (least, median, most of `runs`), bytes kept, and bytes that a run needs."""

    setup: float
    least: float
    median: float
    most: float
    runs: int
    kept_bytes: int
    run_bytes: int


def measured(method: Method, runs: int, seconds: float) -> tuple[Any, Cost]:
    """Set a method up, run it to warm up, then at least `runs` times, and on for `seconds`.

    Memory is traced in a set-up and a run of their own: tracing takes time.

    Returns
    -------
    what a run returned, and its cost
    """
    kept, needed = _traced(method)
    begin = time.perf_counter()
    run = method.prepare()
    setup = time.perf_counter() - begin
    answer = run()
    times: list[float] = []
    enabled = gc.isenabled()
    gc.disable()
    try:
        while len(times) < runs or (sum(times) < seconds and len(times) < RUNS_MAX):
            begin = time.perf_counter()
            run()
            times.append(time.perf_counter() - begin)
    finally:
        if enabled:
            gc.enable()
    return answer, Cost(setup, min(times), statistics.median(times), max(times), len(times), kept, needed)


RUNS_MAX = 1000
"""Runs of a method that takes no time are enough after so many."""


def _traced(method: Method) -> tuple[int, int]:
    """Bytes that are kept after the set-up and a first run, and the most that a second run needs beside them."""
    tracemalloc.start()
    try:
        run = method.prepare()
        run()
        kept, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        run()
        return kept, tracemalloc.get_traced_memory()[1] - kept
    finally:
        tracemalloc.stop()
