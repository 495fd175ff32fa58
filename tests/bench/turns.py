"""Calls timed in turns: what disturbs one disturbs the others as well, and the least time of each is what it takes."""

from __future__ import annotations

import time
from collections.abc import Callable

__all__ = ["least"]

ROUNDS = 7


def least(*calls: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> list[float]:
    """Least seconds of each call, by a clock."""
    best = [float("inf")] * len(calls)
    for _ in range(ROUNDS):
        for k, call in enumerate(calls):
            begin = clock()
            call()
            best[k] = min(best[k], clock() - begin)
    return best
