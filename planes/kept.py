"""What was made and may be asked for again: of many the last ones used, within a number of bytes; of one thing all."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

__all__ = ["Kept", "once"]

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Kept(Generic[Key, Value]):
    """Values by last use; one that is larger than the limit is kept alone.

    Parameters
    ----------
    limit : bytes of all that is kept
    size : bytes of one value
    """

    def __init__(self, limit: int, size: Callable[[Value], int]) -> None:
        self.limit, self.size = limit, size
        self.values: OrderedDict[Key, Value] = OrderedDict()
        self.bytes = 0
        self._lock = threading.Lock()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Find a value, or make it."""
        with self._lock:
            found = self.values.get(key)
            if found is not None:
                self.values.move_to_end(key)
                return found
            made = self.values[key] = make()
            self.bytes += self.size(made)
            while self.bytes > self.limit and len(self.values) > 1:
                self.bytes -= self.size(self.values.popitem(last=False)[1])
            return made


class once(Generic[Value]):  # noqa: N801 - it is used as a decorator
    """A property that is worked out when it is first read, and kept with its owner.

    It is `functools.cached_property` as that is from Python 3.12 on: the lock that it has before takes longer than what
    most of these work out.
    """

    def __init__(self, make: Callable[[Any], Value]) -> None:
        self.make, self.__doc__ = make, make.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, one: Any, owner: type) -> Value:
        if one is None:
            return self  # type: ignore[return-value] # of the class it is this
        value = vars(one)[self.name] = self.make(one)
        return value
