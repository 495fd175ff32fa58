"""Volumes as rows of float64 columns: circles, boxes, oriented boxes, convex polygons, capsules, and sets of parts.

A volume is a closed set: the hull of a few points, grown by a radius (`core`). A moved volume keeps the volume before
the first move (`original`); moving that instead avoids accumulating rounding errors.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..common.checks import Floats, InputError, Ints, array_of, each, integers, kind_of, reals, shown, within
from ..common.limits import TRIG_BITS
from ..grid.fixed_point import unit
from .polygons import convex_parts, convex_rows, neighbours, outlines, rows_of, rows_taken, starts_of

Move = Callable[[Floats, Ints], Floats]  # a function that moves points (n, d), given the row of each point


@dataclass(frozen=True, eq=False)
class Core:
    """Points (M, d) in ragged rows, each in order around its hull, and a radius per row (N,)."""

    points: Floats
    starts: Ints
    counts: Ints
    radius: Floats

    def point(self, rows: Ints, k: int | Ints) -> Floats:
        """Point k of rows; k wraps around."""
        return np.asarray(self.points[self.starts[rows] + k % self.counts[rows]])

    def extent(self) -> tuple[Floats, Floats]:
        """Least and greatest coordinates (N, d) of the points of each row."""
        n, most = len(self.counts), int(self.counts.max())
        if len(self.points) < most * n:
            return np.minimum.reduceat(self.points, self.starts), np.maximum.reduceat(self.points, self.starts)
        low, high = np.empty((2, n, self.points.shape[1]))  # column by column, which is faster
        for axis, values in enumerate(self.points.reshape(n, most, -1).transpose(2, 1, 0)):
            low[:, axis] = functools.reduce(np.minimum, values)
            high[:, axis] = functools.reduce(np.maximum, values)
        return low, high


class Volumes(ABC):
    """Base class of all volumes: length, bounds, selection of rows, and moves that keep the original."""

    _original: Volumes | None = None
    d = 2

    @abstractmethod
    def __len__(self) -> int:
        """Number of rows."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self)} rows in {self.d}-D>"

    @abstractmethod
    def core(self) -> Core:
        """Points and radii of the rows."""

    def take(self, rows: object) -> Self:
        """Select rows by number."""
        chosen = integers("rows", rows, (None,), 0, len(self) - 1)
        return self._chosen(chosen)._of(None if self._original is None else self._original.take(chosen))

    @property
    def original(self) -> Volumes:
        """The volumes before the first move."""
        return self if self._original is None else self._original

    def bounds(self) -> Aabbs:
        """Boxes that contain the volumes, rounded outward; infinite where a volume exceeds the range of float64."""
        core = self.core()
        if not len(self):
            return Aabbs(np.zeros((0, self.d)), np.zeros((0, self.d)))
        low, high = core.extent()
        if not core.radius.any():
            return Aabbs._made(low, high)
        radius = core.radius[:, None]
        return Aabbs._made(_sum_outward(low, -radius, -np.inf), _sum_outward(high, radius, np.inf))

    def beyond(self) -> Ints:
        """Rows that exceed the range of float64, as bounds may; they cannot be moved or tested for overlap."""
        return np.zeros(0, np.int64)

    def translated(self, xy: object) -> Self:
        """Move by `xy`: one vector (d,), or one for each row (N, d)."""
        by = _vectors("xy", xy, len(self), self.d)
        return self._moved(lambda p, row: np.asarray(p + by[row]), np.ones(len(self)))._of(self.original)

    def scaled(self, s: object, about_xy: object = 0.0) -> Self:
        """Scale by `s`: a factor above 0, or one for each row (N,).

        `about_xy` is the point that stays, or one for each row (N, d).
        """
        factor = reals("s", each("s", s, len(self)), (len(self),))
        if not (factor > 0).all():
            raise InputError(f"s: expected a number above 0, got {factor.min()}")
        about = _vectors("about_xy", about_xy, len(self), self.d)
        moved = self._moved(lambda p, row: np.asarray(about[row] + (p - about[row]) * factor[row, None]), factor)
        return moved._of(self.original)

    def rotated(self, degrees: object, about_xy: object = 0.0) -> Volumes:
        """Turn by `degrees`: one angle, or one for each row (N,); quarter turns are exact.

        `about_xy` is the point that stays, or one for each row (N, 2).
        """
        if self.d != 2:
            raise InputError("rotated: expected volumes in 2-D, got 3-D")
        c, s = (v / 2.0**TRIG_BITS for v in unit(reals("degrees", each("degrees", degrees, len(self)), (len(self),))))
        about = _vectors("about_xy", about_xy, len(self), 2)

        def turn(p: Floats, row: Ints) -> Floats:
            x, y = (p - about[row]).T
            return np.asarray(about[row] + np.stack([c[row] * x - s[row] * y, s[row] * x + c[row] * y], axis=1))

        return self._turned(turn)._of(self.original)

    def _turned(self, move: Move) -> Volumes:
        return self._moved(move, np.ones(len(self)))

    @abstractmethod
    def _moved(self, move: Move, factor: Floats) -> Self:
        """The same kind of volumes with moved points, and radii times a factor per row."""

    @abstractmethod
    def _chosen(self, rows: Ints) -> Self:
        """Selected rows."""

    def _of(self, original: Volumes | None) -> Self:
        self._original = original
        return self


class ColumnVolumes(Volumes):
    """Volumes of as many points each, in the columns `_point_columns`, and of the column `radius` if they have one."""

    _point_columns: tuple[str, ...]
    radius: Floats | None = None

    def __len__(self) -> int:
        return len(getattr(self, self._point_columns[0]))

    def _columns(self) -> list[Floats]:
        """Arguments that make these volumes."""
        return [getattr(self, name) for name in self._point_columns] + ([] if self.radius is None else [self.radius])

    def core(self) -> Core:
        """Points in order: one of a circle, two of a capsule, min and max of a box in 3-D."""
        points = np.stack([getattr(self, name) for name in self._point_columns], axis=1)
        radius = np.zeros(len(self)) if self.radius is None else self.radius
        return Core(points.reshape(-1, self.d), *_even(len(self), len(self._point_columns)), radius)

    def _moved(self, move: Move, factor: Floats) -> Self:
        points = [move(getattr(self, name), np.arange(len(self))) for name in self._point_columns]
        return type(self)(*points, *([] if self.radius is None else [self.radius * factor]))

    def _chosen(self, rows: Ints) -> Self:
        return type(self)(*(column[rows] for column in self._columns()))


class Circles(ColumnVolumes):
    """Circles or spheres: center (N, d) with d 2 or 3, radius (N,) of 0 or more."""

    _point_columns = ("center",)
    radius: Floats

    def __init__(self, center: object, radius: object) -> None:
        self.center = _points("center", center)
        self.d = self.center.shape[1]
        self.radius = _radii(radius, len(self.center))


class Aabbs(ColumnVolumes):
    """Axis-aligned boxes: min and max (N, d) with d 2 or 3, min <= max; they may be flat, or points."""

    _point_columns = ("min", "max")
    _finite = True

    def __init__(self, min: object, max: object) -> None:  # noqa: A002
        self.min = _points("min", min)
        self.d = self.min.shape[1]
        self.max = reals("max", max, (len(self.min), self.d))
        bad = np.argwhere(self.min > self.max)
        if len(bad):
            i, k = bad[0].tolist()
            raise InputError(f"max[{i}][{k}]: expected {self.min[i, k]} or more, got {self.max[i, k]}")

    @classmethod
    def _made(cls, low: Floats, high: Floats) -> Self:
        """Make bounds, which may exceed the range of float64."""
        made = cls.__new__(cls)
        made.min, made.max, made.d, made._finite = low, high, low.shape[1], False
        return made

    def beyond(self) -> Ints:
        """Rows with infinite bounds."""
        if self._finite:
            return super().beyond()
        return np.flatnonzero(~(np.isfinite(self.min) & np.isfinite(self.max)).all(axis=1))

    def corners(self) -> Floats:
        """Corners (N, 4, 2) of boxes in 2-D, in order."""
        made = np.empty((len(self), 4, 2))
        made[:, [0, 3], 0], made[:, [1, 2], 0] = self.min[:, :1], self.max[:, :1]
        made[:, :2, 1], made[:, 2:, 1] = self.min[:, 1:], self.max[:, 1:]
        return made

    def bounds(self) -> Aabbs:
        """The boxes themselves."""
        return Aabbs._made(self.min, self.max)

    def core(self) -> Core:
        """Four corners in 2-D, min and max in 3-D."""
        if self.d == 3:
            return super().core()
        return Core(self.corners().reshape(-1, 2), *_even(len(self), 4), np.zeros(len(self)))

    def _turned(self, move: Move) -> Volumes:
        return Obbs.from_corners(
            move(self.corners().reshape(-1, 2), np.repeat(np.arange(len(self)), 4)).reshape(-1, 4, 2)
        )


class Hulls(Volumes):
    """Convex hulls of ragged rows of points."""

    points: Floats
    starts: Ints

    def __len__(self) -> int:
        return len(self.starts)

    def core(self) -> Core:
        """Points of the hulls."""
        return Core(self.points, self.starts, rows_of(self.starts, len(self.points))[0], np.zeros(len(self)))

    @classmethod
    def around(cls, points: Floats, starts: Ints) -> Self:
        """Make the hulls of ragged rows of points (M, 2), which begin at `starts` (N,)."""
        return cls._made(*outlines(reals("points", points, (None, 2)), starts))

    @classmethod
    def _made(cls, points: Floats, starts: Ints) -> Self:
        """Make hulls of outlines."""
        made = cls.__new__(cls)
        made.points, made.starts = points, starts
        return made

    def translated(self, xy: object) -> Self:
        """Move by a vector (2,), or by one vector per row (N, 2); hulls are recomputed only after rounding."""
        row = rows_of(self.starts, len(self.points))[1]
        by = _vectors("xy", xy, len(self), 2)[row]
        points = self.points + by
        if not ((points - by == self.points) & (points - self.points == by)).all():
            return super().translated(xy)
        return self._made(points, self.starts)._of(self.original)

    def _moved(self, move: Move, factor: Floats) -> Self:
        return self.around(move(self.points, rows_of(self.starts, len(self.points))[1]), self.starts)

    def _chosen(self, rows: Ints) -> Self:
        return self._made(*rows_taken(self.points, self.starts, rows))


class Obbs(Hulls):
    """Oriented boxes; each is the hull of its four stored corners, which may be rounded."""

    def __init__(self, *_: object, **__: object) -> None:
        raise InputError("Obbs: expected Obbs.from_center(center, half_wh, angle_deg) or Obbs.from_corners(corners)")

    @classmethod
    def from_corners(cls, corners: object) -> Self:
        """Make boxes of corners (N, 4, 2), in any order."""
        array = reals("corners", corners, (None, 4, 2))
        return cls.around(array.reshape(-1, 2), _even(len(array), 4)[0])

    @classmethod
    def from_center(cls, center: object, half_wh: object, angle_deg: object) -> Self:
        """Boxes from their centres, half sizes and angles.

        Parameters
        ----------
        center : (N, 2)
        half_wh : (N, 2), half of the width and of the height, 0 or more
        angle_deg : (N,) degrees, or one for all
        """
        middle = reals("center", center, (None, 2))
        n = len(middle)
        half = reals("half_wh", half_wh, (n, 2))
        if not (half >= 0).all():
            raise InputError(f"half_wh: expected numbers of 0 or more, got {half.min()}")
        c, s = (v[:, None] / 2.0**TRIG_BITS for v in unit(reals("angle_deg", each("angle_deg", angle_deg, n), (n,))))
        x, y = (half[:, k, None] * np.array(signs) for k, signs in enumerate(((-1, 1, 1, -1), (-1, -1, 1, 1))))
        return cls.from_corners(middle[:, None] + np.stack([c * x - s * y, s * x + c * y], axis=2))


class Polygons(Hulls):
    """Convex polygons: points (M, 2), and as `starts` the first point of each row (N,); either turning sense."""

    def __init__(self, points: object, starts: object) -> None:
        given = reals("points", points, (None, 2))
        first = _checked_starts(starts, len(given))
        row, (_, after) = rows_of(first, len(given))[1], neighbours(first, len(given))
        kept = (given != given[after]).any(axis=1)
        counts = np.bincount(row[kept], minlength=len(first))
        for i in np.flatnonzero(counts < 3).tolist():
            raise InputError(f"points: expected three distinct points or more in row {i}, got {max(counts[i], 1)}")
        given, first = given[kept], starts_of(counts)
        for i in np.flatnonzero(convex_rows(given, first) == 0).tolist():
            got = shown(np.split(given, first[1:])[i].tolist())
            raise InputError(f"points: expected a convex polygon with an area in row {i}, got {got}")
        self.points, self.starts = outlines(given, first)


class Capsules(ColumnVolumes):
    """Capsules: segments from a_xy to b_xy (N, 2), which may be points, grown by a radius (N,) of 0 or more."""

    _point_columns = ("a_xy", "b_xy")
    radius: Floats

    def __init__(self, a_xy: object, b_xy: object, radius: object) -> None:
        self.a_xy = reals("a_xy", a_xy, (None, 2))
        self.b_xy = reals("b_xy", b_xy, (len(self.a_xy), 2))
        self.radius = _radii(radius, len(self.a_xy))


def _points(field: str, values: object) -> Floats:
    shape = array_of(field, values).shape
    return reals(field, values, (None, 3 if len(shape) == 2 and shape[1] == 3 else 2))


def _radii(radius: object, n: int) -> Floats:
    radii = reals("radius", each("radius", radius, n), (n,))
    for i in np.flatnonzero(radii < 0).tolist():
        raise InputError(f"radius[{i}]: expected 0 or more, got {radii[i]}")
    return radii


def _vectors(field: str, values: object, n: int, d: int) -> Floats:
    array = array_of(field, values)
    if array.ndim < 2:
        return np.broadcast_to(reals(field, np.broadcast_to(array, (d,)) if not array.ndim else array, (d,)), (n, d))
    return reals(field, array, (n, d))


def _checked_starts(starts: object, total: int) -> Ints:
    """Check indices of the first point or part of each row: they begin at 0 and rise."""
    first = integers("starts", starts, (None,), 0, max(total - 1, 0))
    if (len(first) and first[0] != 0) or (np.diff(first) < 1).any() or (total and not len(first)):
        raise InputError(f"starts: expected 0 and then numbers that grow, got {first[:9].tolist()}")
    return first


def _even(n: int, count: int) -> tuple[Ints, Ints]:
    return np.arange(n) * count, np.full(n, count)


def _sum_outward(a: Floats, b: Floats, toward: float) -> Floats:
    """Sum of a and b rounded outward, by Knuth's two-sum."""
    with np.errstate(all="ignore"):
        total = a + b
        part = total - a
        rest = (a - (total - part)) + (b - part)
        inside = rest <= 0 if toward > 0 else rest >= 0
        return np.where(inside, total, np.nextafter(total, toward))


class Parts(Volumes):
    """Rows of one or more parts: volumes of one kind (M), and the index of each row's first part (N,)."""

    def __init__(self, parts: Volumes, starts: object) -> None:
        if not isinstance(parts, Volumes):
            raise InputError(f"parts: expected volumes of one kind, got {kind_of(parts)}")
        self.parts, self.d = parts, parts.d
        self.starts = _checked_starts(starts, len(parts))

    def __len__(self) -> int:
        return len(self.starts)

    def core(self) -> Core:
        """Raise InputError: a row of parts has no hull of its own."""
        raise InputError("core: expected a volume of one part, got a set of parts")

    def bounds(self) -> Aabbs:
        """Boxes around all parts of each row."""
        inner = self.parts.bounds()
        if not len(self):
            return inner
        return Aabbs._made(np.minimum.reduceat(inner.min, self.starts), np.maximum.reduceat(inner.max, self.starts))

    def beyond(self) -> Ints:
        """Rows with a part that exceeds the range of float64."""
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
    """Sets of boxes: min and max (M, d), and as `starts` the first box of each row (N,)."""

    def __init__(self, min: object, max: object, starts: object) -> None:  # noqa: A002
        super().__init__(Aabbs(min, max), starts)


class ConcavePolygons(Parts):
    """Simple polygons, cut into convex parts: points (M, 2), and as `starts` the first point of each row (N,).

    They may have either turning sense and points on edges. A row that crosses or touches itself, or has fewer than
    three points or no area, raises an InputError.
    """

    def __init__(self, points: object, starts: object) -> None:
        given = reals("points", points, (None, 2))
        first = _checked_starts(starts, len(given))
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
        """Make polygons of points and starts, as the constructor does."""
        return cls(points, starts)


def joined(volumes: Sequence[Volumes]) -> Volumes:
    """All rows of volumes of one kind, in order; an InputError if there are none, or they differ in kind."""
    if not volumes or any(type(v) is not type(volumes[0]) for v in volumes):
        raise InputError(f"volumes: expected some, of one kind, got {sorted({type(v).__name__ for v in volumes})}")
    first = volumes[0]
    if isinstance(first, Parts):
        counts = np.concatenate([rows_of(v.starts, len(v.parts))[0] for v in volumes if isinstance(v, Parts)])
        return first._same(joined([v.parts for v in volumes if isinstance(v, Parts)]), starts_of(counts))
    if isinstance(first, ColumnVolumes):
        columns = zip(*(v._columns() for v in volumes if isinstance(v, ColumnVolumes)), strict=True)
        return type(first)(*(np.concatenate(column) for column in columns))
    hulls = [v for v in volumes if isinstance(v, Hulls)]
    before = np.repeat(starts_of([len(v.points) for v in hulls]), [len(v) for v in hulls])
    return hulls[0]._made(np.concatenate([v.points for v in hulls]), np.concatenate([v.starts for v in hulls]) + before)
