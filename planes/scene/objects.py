"""Roles and ids of objects, and the row of the columns of `Items` that each object has.

Ids count up and are never given out again, as hits and histories name objects by them. Rows are used again, and are
laid out anew when most hold nothing: columns are about as long as the scene is full, however many came and went.
"""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.checks import InputError, Ints
from ..common.limits import IDS_MAX, ITEMS_MAX


class Role(Enum):
    """Role of an object; only HITTABLE and OCCLUDER decide hits, the others are only drawn."""

    BACKGROUND = "background"
    HITTABLE = "hittable"
    MOVER = "mover"
    OCCLUDER = "occluder"
    HUD = "hud"


ROLES = tuple(Role)
DECIDING = Role.HITTABLE, Role.OCCLUDER
HITTABLE, OCCLUDER = map(ROLES.index, DECIDING)
ROLE_NAMES = tuple(role.value for role in ROLES)
PLANE_NAMES = ("background", "hittable", "movers", "occluders", "hud")  # of the planes of ROLES, in order

GROWTH_MOST = 2**20  # most ids that room is made for ahead
NAMELESS = -1 - len(ROLES)
"""Row of an id whose name tells no role and id."""


def looked_up(ids: Ints, rising: Ints, values: Ints) -> Ints:
    """Values (n,) of ids, of which the known ones (m,) are rising and have values (m,); -1 for others."""
    if not len(rising):
        return np.full(np.shape(ids), -1)
    place = np.minimum(np.searchsorted(rising, ids), len(rising) - 1)
    return np.asarray(np.where(rising[place] == ids, values[place], -1))


class RowTable:
    """The row of each object, by its id, and the names of objects that are gone.

    An id without an object takes four bytes, and the room of its name unless that is a role and the id.

    Attributes
    ----------
    count : number of ids that were given out
    height : number of rows that are or were in use
    row_of : (n,) by id the row of an object; of an object that is gone -1 less the number of the role in its name
    """

    def __init__(self) -> None:
        self.count = self.height = 0
        self.row_of: npt.NDArray[np.int32] = np.zeros(16, np.int32)
        self._names: dict[int, str] = {}
        self._free: list[int] = []

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy has rows of its own, also where pickles share their arrays."""
        vars(self).update(state, row_of=state["row_of"].copy())

    @property
    def living(self) -> int:
        """Number of objects."""
        return self.height - len(self._free)

    def add(self) -> tuple[int, int]:
        """Give out the next id, and a row for it."""
        if self.living >= ITEMS_MAX:
            raise InputError(f"objects: expected at most {ITEMS_MAX} at a time, got one more")
        if self.count >= IDS_MAX:
            raise InputError(f"objects: expected at most {IDS_MAX} in the life of a scene, got one more")
        item = self.count
        self._reserve(item + 1)
        if self._free:
            row = self._free.pop()
        else:
            row, self.height = self.height, self.height + 1
        self.row_of[item], self.count = row, item + 1
        return item, row

    def skip_to(self, count: int) -> None:
        """Give out all ids below `count` to no object; they have no names."""
        if count > self.count:
            self._reserve(count)
            self.row_of[self.count : count] = NAMELESS
            self.count = count

    def drop(self, item: int, name: str) -> None:
        """Take the row of an object, which has a name, away from it."""
        self._free.append(self.row(item))
        role, _, number = name.rpartition(" ")
        if number == str(item) and role in ROLE_NAMES:
            self.row_of[item] = -1 - ROLE_NAMES.index(role)
        else:
            self.row_of[item], self._names[item] = NAMELESS, name

    def row(self, item: int) -> int:
        """Row of an object; negative for an id without one."""
        return self.row_of.item(item)

    def rows(self, ids: Ints) -> Ints:
        """Rows (n,) of objects; negative for ids without one."""
        return self.row_of.take(ids).astype(np.int64)

    def name_of_gone(self, item: int) -> str:
        """Name that an object had when it was removed; "" of an id that no object had."""
        row = self.row(item)
        return self._names.get(item, "") if row == NAMELESS else f"{ROLE_NAMES[-1 - row]} {item}"

    def compact(self, ids: Ints) -> None:
        """Give the objects, of rising ids (n,), the rows 0 .. n - 1."""
        self.row_of[ids] = np.arange(len(ids))
        self.height, self._free = len(ids), []

    def copied(self, ids: Ints, count: int) -> RowTable:
        """A table of the first `count` ids and their names; the objects, of rising ids (n,), have rows 0 .. n - 1."""
        other = RowTable()
        other.count = count
        other._names = {item: name for item, name in self._names.items() if item < count}
        other.row_of = self.row_of[:count].copy()
        other.compact(ids)
        return other

    def _reserve(self, count: int) -> None:
        size = len(self.row_of)
        if count > size:
            more = max(count - size, min(size // 4, GROWTH_MOST))
            self.row_of = np.concatenate([self.row_of, np.zeros(more, np.int32)])
