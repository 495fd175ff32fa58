"""What a process runs on and keeps: numpy kernels or compiled ones (the extra `jit`), threads, the arena, and caches.

A compiled module has the same functions as the numpy module and gives the same rows; COMPILED lists the pairs. It is
imported only after `use_jit`: installing numba changes nothing by itself.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections import OrderedDict, deque
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from .checks import InputError, flag, integer

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor


TRIM_THRESHOLD, MMAP_THRESHOLD = (-1, 2**26), (-3, 2**25)
"""Options of `mallopt` and their values, bytes: freed memory that is kept, and blocks that are kept when freed."""


@cache
def keep_arena() -> None:
    """Make the C library keep freed memory from the first call on.

    glibc returns a large block to the system when it is freed, and takes new pages for the next (`mallopt(3)`). A batch
    works in arrays of up to a megabyte; with new pages for each, discs took twice as long. Other C libraries are
    unaffected, and the process keeps at most 64 MB that it does not use.
    """
    if sys.platform != "linux":
        return
    library = ctypes.CDLL(None)
    if hasattr(library, "gnu_get_libc_version"):
        for option in (TRIM_THRESHOLD, MMAP_THRESHOLD):
            library.mallopt(*option)


Part = TypeVar("Part")

COMPILED = {
    "hitplanes.planes.grid.fixed_point": "hitplanes.planes.jit.scene",
    "hitplanes.planes.grid.rasterize": "hitplanes.planes.jit.scene",
    "hitplanes.planes.scene.variants": "hitplanes.planes.jit.planes",
    "hitplanes.planes.bits.label_plane": "hitplanes.planes.jit.areas",
    "hitplanes.weapons.kinds.draws": "hitplanes.planes.jit.bit_rows",
    "hitplanes.planes.bits.bit_rows": "hitplanes.planes.jit.bit_rows",
    "hitplanes.planes.bits.shadows": "hitplanes.planes.jit.bit_rows",
    "hitplanes.planes.bits.exits": "hitplanes.planes.jit.bit_rows",
    "hitplanes.planes.bits.front_to_back": "hitplanes.planes.jit.areas",
    "hitplanes.planes.bits.distance_field": "hitplanes.planes.jit.planes",
    "hitplanes.weapons.rays.raycast": "hitplanes.planes.jit.raycast",
    "hitplanes.weapons.explain.ray_verdicts": "hitplanes.planes.jit.raycast",
    "hitplanes.weapons.rays.one_ray": "hitplanes.weapons.prepared.compiled",
    "hitplanes.weapons.prepared.position_cache": "hitplanes.weapons.prepared.compiled",
}
"""Each module with numpy kernels, and the module that has the same functions compiled."""

THREADS_MOST = 64

_asked: list[bool] = [False]
_news: deque[str] = deque()
_told: set[str] = set()
_threads: list[int] = []
_twins: dict[ModuleType, ModuleType] = {}


def use_jit(on: bool | None = True) -> None:
    """Use compiled kernels from now on; with False or None only numpy, which is the default.

    Results do not change. The first call compiles a kernel and stores it on disk. If it cannot be stored, each process
    compiles it again, and the plan of the next call of `fire` says why.

    Raises
    ------
    InputError
        If `on` is not a boolean, or if numba (the extra `jit`) is not installed.
    """
    on = None if on is None else flag("on", on)
    if on and find_spec("numba") is None:
        raise InputError("jit: expected numba, which the extra 'jit' installs, got no such module")
    _asked[:] = [bool(on)]


def use_threads(count: int | None = None) -> None:
    """Set the most threads that a call of compiled kernels uses; None, the default: one per core of the process.

    Results do not change. Only long calls are split.

    Raises
    ------
    InputError
        If `count` is not a whole number from 1 on.
    """
    _threads[:] = [] if count is None else [integer("count", count, 1, THREADS_MOST)]


def in_parts(count: int, least: float, work: Callable[[int, int], Part]) -> list[Part]:
    """Split range(count) into parts, run `work(first, end)` on each in its own thread, and return the results in order.

    No part is smaller than `least`, which is worth a thread.
    """
    parts = int(min(_threads[0] if _threads else _cores(), count // max(least, 1)))
    if parts < 2:
        return [work(0, count)]
    edges = [count * k // parts for k in range(parts + 1)]
    others = [_pool().submit(work, first, last) for first, last in pairwise(edges[1:])]
    return [work(0, edges[1]), *(other.result() for other in others)]


@cache
def _cores() -> int:
    """Number of cores that the process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Thread pool of the process; a forked process makes its own."""
    from concurrent.futures import ThreadPoolExecutor

    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_pool.cache_clear)
    return ThreadPoolExecutor(THREADS_MOST, "hitplanes")


def tell(what: str) -> None:
    """Add a message about the compiled kernels to the plan of the next call, once per process."""
    if what not in _told:
        _told.add(what)
        _news.append(what)


def news() -> list[str]:
    """Messages about the compiled kernels that no plan has shown yet."""
    messages: list[str] = []
    while _news:
        with suppress(IndexError):  # another thread may take it
            messages.append(_news.popleft())
    return messages


def jit_is_on() -> bool:
    """Whether compiled kernels are used; asking loads none."""
    return _asked[0]


def kernels_of(module: ModuleType) -> ModuleType:
    """The numpy module itself, or its compiled module after `use_jit`."""
    if not _asked[0]:
        return module
    if module not in _twins:
        _twins[module] = import_module(COMPILED[module.__name__])
    return _twins[module]


Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class LruCache(Generic[Key, Value]):
    """A least-recently-used cache of at most `limit` bytes; a value larger than that is kept alone.

    `size` tells the bytes of a value, with everything that is later derived from it and kept with it, and `key_size`
    those of a key, if keys may be large.
    """

    def __init__(self, limit: int, size: Callable[[Value], int], key_size: Callable[[Key], int] = lambda _: 0) -> None:
        self.limit, self.size, self.key_size = limit, size, key_size
        self.values: OrderedDict[Key, Value] = OrderedDict()
        self.bytes = 0
        self._lock = threading.Lock()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Return the value of a key; make it if it is missing."""
        with self._lock:
            found = self.values.get(key)
            if found is not None:
                self.values.move_to_end(key)
                return found
            return self._keep(key, make())

    def get_all(self, keys: Sequence[Key], make: Callable[[list[int]], Sequence[Value]]) -> list[Value]:
        """Return the values of keys; `make` makes those of the given rows, of which no two have the same key."""
        with self._lock:
            found = list(map(self.values.get, keys))
            missing: dict[Key, int] = {}
            for row, (key, value) in enumerate(zip(keys, found, strict=True)):
                if value is None:
                    missing.setdefault(key, row)
                else:
                    self.values.move_to_end(key)
            if not missing:
                return cast(list[Value], found)
            fresh = dict(zip(missing, make(list(missing.values())), strict=True))
            for key, value in fresh.items():
                self._keep(key, value)
            return [fresh[key] if value is None else value for key, value in zip(keys, found, strict=True)]

    def _keep(self, key: Key, made: Value) -> Value:
        self.values[key] = made
        self.bytes += self.size(made) + self.key_size(key)
        while self.bytes > self.limit and len(self.values) > 1:
            old, value = self.values.popitem(last=False)
            self.bytes -= self.size(value) + self.key_size(old)
        return made


class cached_attribute(Generic[Value]):  # noqa: N801 - it is used as a decorator
    """A property that is computed when first read, and stored in its object.

    It is `functools.cached_property` of Python 3.12. Before 3.12 that takes a lock, which costs more than most of these
    computations.
    """

    def __init__(self, make: Callable[[Any], Value]) -> None:
        self.make, self.__doc__ = make, make.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, item: Any, owner: type) -> Value:
        if item is None:
            return self  # type: ignore[return-value] # read from the class
        value = vars(item)[self.name] = self.make(item)
        return value
