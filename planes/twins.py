"""Which kernels are used: those in numpy, or their compiled twins (the extra `jit`), row for row the same; and threads.

The twin of `planes/name.py` is `planes/name_jit.py`, with the same functions. It is imported when it is asked for, or
by a batch that would take so long in numpy that loading it pays.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING, TypeVar

from planes.arrays import InputError, integer

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

__all__ = ["expect", "in_parts", "kernels_of", "use_jit", "use_threads"]

Part = TypeVar("Part")

LOADING_NS = 2e9
"""A call that is expected to take longer in numpy loads the compiled twins of itself, which takes about 1 s."""

THREADS_MOST = 64

_asked: list[bool] = []
_threads: list[int] = []
_twins: dict[ModuleType, ModuleType] = {}


def use_jit(on: bool | None = True) -> None:
    """Use compiled kernels from now on; False: only numpy; None: from the first call on that pays, as it is at first.

    They change no result. The first calls of all compile them, and keep them on disk.

    Raises
    ------
    InputError
        If they are asked for and numba, the extra `jit`, is not there.
    """
    if on and find_spec("numba") is None:
        raise InputError("jit: expected numba, which the extra 'jit' installs, got no such module")
    _asked[:] = [] if on is None else [bool(on)]


def use_threads(count: int | None = None) -> None:
    """Let a call of compiled kernels use so many threads at most; None: as many as the process may run on, as at first.

    They change no result. Only calls that take long are shared out.

    Raises
    ------
    InputError
        If it is no number from 1 on.
    """
    _threads[:] = [] if count is None else [integer("count", count, 1, THREADS_MOST)]


def in_parts(count: int, least: float, work: Callable[[int, int], Part]) -> list[Part]:
    """Do work on parts of a range, first .. last - 1, each in a thread of its own; what they give, in order.

    Parameters
    ----------
    least : of a part: what it takes to be worth a thread
    """
    parts = int(min(_threads[0] if _threads else _cores(), count // max(least, 1)))
    if parts < 2:
        return [work(0, count)]
    edges = [count * k // parts for k in range(parts + 1)]
    others = [_pool().submit(work, first, last) for first, last in pairwise(edges[1:])]
    return [work(0, edges[1]), *(other.result() for other in others)]


@cache
def _cores() -> int:
    """Threads that may run at a time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Threads that wait for work; a process that is forked off has none of them, and makes its own."""
    from concurrent.futures import ThreadPoolExecutor

    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_pool.cache_clear)
    return ThreadPoolExecutor(THREADS_MOST, "hitplanes")


def expect(ns: float) -> None:
    """Tell how long a call is expected to take in numpy: from one on that is long enough, compiled kernels are used."""
    if not _asked and ns > LOADING_NS and find_spec("numba") is not None:
        use_jit(True)


def kernels_of(module: ModuleType, expected_ns: float = 0.0) -> ModuleType:
    """The module of kernels itself, or its compiled twin, for work that is expected to take so long in numpy."""
    if expected_ns > LOADING_NS:
        expect(expected_ns)
    if not _asked or not _asked[0]:
        return module
    if module not in _twins:
        _twins[module] = import_module(f"{module.__name__}_jit")
    return _twins[module]
