"""Calls timed in turns: what disturbs one disturbs the others as well, and the least time of each is what it takes."""

from __future__ import annotations

import time
from collections.abc import Callable

__all__ = ["least"]

ROUNDS = 7


def least(*calls: Callable[[], object]) -> list[float]:
    """Least seconds of each call."""
    best = [float("inf")] * len(calls)
    for _ in range(ROUNDS):
        for k, call in enumerate(calls):
            begin = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - begin)
    return best
