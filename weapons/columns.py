"""Results as columns of one length, which all have a column `shot`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from planes.arrays import Ints

__all__ = ["Columns"]

C = TypeVar("C", bound="Columns")

ZEROS, ONES = (np.broadcast_to(np.int64(value), 2**48) for value in (0, 1))
"""A slice of one of them is a column of one value, that takes no memory."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of one length, of which the first is `shot`."""

    shot: Ints

    def __len__(self) -> int:
        return len(self.shot)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(np.array_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    __hash__ = None  # type: ignore[assignment]

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return sum(int(column.nbytes) for column in vars(self).values())

    def take(self: C, rows: Ints | slice) -> C:
        """Some of the rows."""
        return type(self)(*(getattr(self, f.name)[rows] for f in fields(self)))

    def of_shot(self: C, shot: int) -> C:
        """Rows of one shot."""
        return self.take(slice(*np.searchsorted(self.shot, [shot, shot + 1]).tolist()))

    def to_rows(self) -> list[dict[str, Any]]:
        """Rows as JSON."""
        names = [f.name for f in fields(self)]
        columns = [getattr(self, name).tolist() for name in names]
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]

    @classmethod
    def joined(cls: type[C], parts: Sequence[C]) -> C:
        """All rows of one or more."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    @classmethod
    def gathered(cls: type[C], parts: Sequence[C], shots: Sequence[Ints]) -> C:
        """All rows in the order of the shots; `shots` are the numbers of those of each part."""
        every = cls.joined([replace(part, shot=own[part.shot]) for part, own in zip(parts, shots, strict=True)])
        return every.take(np.argsort(every.shot, kind="stable"))
