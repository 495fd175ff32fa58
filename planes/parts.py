"""Sets of parts: a row is a union of boxes, or of convex polygons; and rows of one kind joined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from planes.arrays import Floats, InputError, Ints, within
from planes.rings import convex_parts, rows_of, rows_taken, starts_of
from planes.volumes import (
    Aabbs,
    Capsules,
    Circles,
    Core,
    Hulls,
    Move,
    Obbs,
    Polygons,
    Volumes,
    checked_starts,
    ragged_points,
)

__all__ = ["BoxSets", "ConcavePolygons", "Parts", "joined"]


class Parts(Volumes):
    """Rows of several parts: volumes of one kind (M), and the first part of each row (N,); a row has one or more."""

    def __init__(self, parts: Volumes, starts: object) -> None:
        if not isinstance(parts, Volumes):
            raise InputError(f"parts: expected volumes of one kind, got {type(parts).__name__}")
        self.parts, self.d = parts, parts.d
        self.starts = checked_starts(starts, len(parts))

    def __len__(self) -> int:
        return len(self.starts)

    def core(self) -> Core:
        """A row of parts has no hull of its own."""
        raise InputError("core: expected a volume of one part, got a set of parts")

    def bounds(self) -> Aabbs:
        """Boxes around all parts of each row."""
        inner = self.parts.bounds()
        if not len(self):
            return inner
        return Aabbs._made(np.minimum.reduceat(inner.min, self.starts), np.maximum.reduceat(inner.max, self.starts))

    def beyond(self) -> Ints:
        """Rows of which a part is beyond the floats."""
        return np.unique(rows_of(self.starts, len(self.parts))[1][self.parts.beyond()])

    def _moved(self, move: Move, factor: Floats) -> Self:
        row = rows_of(self.starts, len(self.parts))[1]
        return self._same(self.parts._moved(lambda p, part: move(p, row[part]), factor[row]), self.starts)

    def _turned(self, move: Move) -> Volumes:
        row = rows_of(self.starts, len(self.parts))[1]
        return Parts(self.parts._turned(lambda p, part: move(p, row[part])), self.starts)

    def _chosen(self, rows: Ints) -> Self:
        chosen, starts = rows_taken(np.arange(len(self.parts)), self.starts, rows)
        return self._same(self.parts._chosen(chosen), starts)

    def _same(self, parts: Volumes, starts: Ints) -> Self:
        made = type(self).__new__(type(self))
        made.parts, made.starts, made.d = parts, starts, parts.d
        return made


class BoxSets(Parts):
    """Sets of boxes: min and max (M, d), and the first box of each row (N,)."""

    def __init__(self, min: object, max: object, starts: object) -> None:  # noqa: A002
        super().__init__(Aabbs(min, max), starts)


class ConcavePolygons(Parts):
    """Simple polygons, cut into convex parts: points (M, 2), and the first point of each row (N,).

    Either turning sense; points on edges are welcome. A row that crosses or touches itself, or has fewer than three
    points or no area, is an InputError.
    """

    def __init__(self, points: object, starts: object) -> None:
        given, first = ragged_points(points, starts)
        corners: list[Floats] = []
        lengths = []
        for i, row in enumerate(np.split(given, first[1:]) if len(first) else []):
            with within(f"row {i}"):
                parts = convex_parts([(x, y) for x, y in row.tolist()])
            corners += [row[part] for part in parts]
            lengths.append(len(parts))
        joined = np.concatenate(corners) if corners else np.zeros((0, 2))
        super().__init__(Polygons(joined, starts_of([len(part) for part in corners])), starts_of(lengths))

    @classmethod
    def from_concave(cls, points: object, starts: object) -> Self:
        """Make them of points and starts, as the constructor does."""
        return cls(points, starts)


def joined(volumes: Sequence[Volumes]) -> Volumes:
    """All rows of volumes of one kind, in order.

    Raises
    ------
    InputError
        If there are none, or they differ in kind.
    """
    if not volumes or any(type(v) is not type(volumes[0]) for v in volumes):
        raise InputError(f"volumes: expected some, of one kind, got {sorted({type(v).__name__ for v in volumes})}")
    first = volumes[0]
    if isinstance(first, Parts):
        counts = np.concatenate([rows_of(v.starts, len(v.parts))[0] for v in volumes if isinstance(v, Parts)])
        return first._same(joined([v.parts for v in volumes if isinstance(v, Parts)]), starts_of(counts))
    names = _COLUMNS[type(first)]
    columns = [np.concatenate([getattr(v, name) for v in volumes]) for name in names]
    if not isinstance(first, Hulls):
        return type(first)(*columns)
    made = type(first).__new__(type(first))
    before = starts_of([len(v.points) for v in volumes if isinstance(v, Hulls)])
    made.points, made.starts = columns[0], columns[1] + np.repeat(before, [len(v) for v in volumes])
    return made


_COLUMNS: dict[type[Volumes], tuple[str, ...]] = {
    Circles: ("center", "radius"),
    Aabbs: ("min", "max"),
    Capsules: ("a_xy", "b_xy", "radius"),
    Obbs: ("points", "starts"),
    Polygons: ("points", "starts"),
}
