"""Caches: an LRU cache bounded in bytes, and attributes that are computed once."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class LruCache(Generic[Key, Value]):
    """A least-recently-used cache of bounded size; a value larger than the limit is kept alone.

    Parameters
    ----------
    limit : bytes of all values and keys
    size : bytes of a value, with everything that is later derived from it and kept with it
    key_size : bytes of a key, if keys may be large
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
            made = self.values[key] = make()
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
