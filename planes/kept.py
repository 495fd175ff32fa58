"""What was made and may be asked for again: the last ones used are kept, within a number of bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

__all__ = ["Kept"]

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
