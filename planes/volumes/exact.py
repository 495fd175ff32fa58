"""Exact geometric predicates on float64 inputs: float filters with an error bound, then integers.

A predicate is the sign of a polynomial, which is evaluated in up to three stages:

1. In floats, with one error bound for a chunk of rows, from its largest magnitudes.
2. For rows still in doubt, with an error bound for each row.
3. For rows still in doubt, in Python integers.

Comparisons ask for certainty: with NaN they are false, so NaN is in doubt. Infinite inputs are never certain, and are
refused in the last stage.

All predicates take finite floats whose leading axes broadcast: points (..., 2) or (..., 3), and radii (...) of 0 or
more, whose sum is taken exactly. They return signs (...). With `conservative` the last stage is skipped, and rows in
doubt are 0. An InputError names an argument that is not finite, has a wrong number of coordinates, or does not
broadcast.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, InputError, Ints, array_of, flag, shown
from ..common.limits import (
    BOUND_HUGE,
    CHUNK_ROWS,
    FLOAT_HUGE,
    FLOAT_TINY,
    LENGTH_TINY,
    ORIENT2D_ERROR,
    ORIENT3D_ERROR,
    ROUNDING,
)

Signs = npt.NDArray[np.int8]
Numbers = npt.NDArray[Any]
Given = list[tuple[str, Floats]]  # columns, each with the name of its argument
SIGN_ROWS = 8192  # rows of a chunk of signs: their temporary arrays stay in the cache, and are not given back

Valued = tuple[Any, tuple[Sequence[Numbers], ...]]
"""A determinant, and arrays for each magnitude on which its error depends."""


@dataclass(frozen=True)
class Predicate:
    """A sign, computed in floats with an error bound, and in integers.

    value : function of the columns that returns the determinant and the magnitudes
    bound : function of the largest of each magnitude that returns a bound of the error
    exact : function of columns of Python integers that returns a number of that sign; None if `value` is one

    All columns are lengths in one unit, and the sign does not depend on the unit.
    """

    value: Callable[[list[Numbers]], Valued]
    bound: Callable[..., Any]
    exact: Callable[[list[Numbers]], Numbers] | None = None


def orient2d(a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike, conservative: bool = False) -> Signs:
    """Side of the line through a and b on which the point c lies, in 2-D.

    It is 1 when turning from +x towards +y, which is clockwise on the screen; 0 on the line; else -1 (Shewchuk,
    *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997).
    """
    return _signs(_ORIENT2D, _points(2, a=a, b=b, c=c), conservative)


def orient3d(
    a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike, d: npt.ArrayLike, conservative: bool = False
) -> Signs:
    """Side of the plane through a, b and c on which the point d lies, in 3-D: the sign of det(a - d, b - d, c - d).

    It is 1 where a, b, c turn from +x towards +y when seen from +z and d lies below them; 0 in the plane; else -1.
    """
    return _signs(_ORIENT3D, _points(3, a=a, b=b, c=c, d=d), conservative)


def circles_sign(
    c1: npt.ArrayLike, r1: npt.ArrayLike, c2: npt.ArrayLike, r2: npt.ArrayLike, conservative: bool = False
) -> Signs:
    """Compare the distance of two centres, in 2-D or 3-D, with the sum of two radii.

    It is -1 where the circles share more than a point, 0 where they touch, 1 where they are apart.
    """
    shape = _numbers("c1", c1).shape
    if not shape or shape[-1] not in (2, 3):
        raise InputError(f"c1: expected 2 or 3 coordinates on the last axis, got {shape}")
    return _signs(_CIRCLES, _points(shape[-1], c1=c1, c2=c2) + _radii(r1=r1, r2=r2), conservative)


def point_segment_sign(
    p: npt.ArrayLike, a: npt.ArrayLike, b: npt.ArrayLike, r: npt.ArrayLike, r2: npt.ArrayLike = 0.0,
    conservative: bool = False,
) -> Signs:  # fmt: skip
    """Compare the distance from p to the segment ab, which may be a point, with r + r2, in 2-D.

    It is -1 nearer, 0 at that distance, 1 farther (Ericson, *Real-Time Collision Detection*, 2005, 5.1.2).
    """
    return _signs(_POINT_SEGMENT, _points(2, p=p, a=a, b=b) + _radii(r=r, r2=r2), conservative)


def segment_segment_sign(
    a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike, d: npt.ArrayLike, r: npt.ArrayLike,
    r2: npt.ArrayLike = 0.0, conservative: bool = False,
) -> Signs:  # fmt: skip
    """Compare the distance between the segments ab and cd, which may be points, with r + r2, in 2-D.

    It is -1 nearer, 0 at that distance (with radii 0: they meet), 1 farther.
    """
    sign = _signs(_ENDS, _points(2, a=a, b=b, c=c, d=d) + _radii(r=r, r2=r2), conservative)
    a, b, c, d = (np.asarray(v, np.float64) for v in (a, b, c, d))
    grown = (np.asarray(r, np.float64) > 0) | (np.asarray(r2, np.float64) > 0)
    crossing = _cross(a, b, c, d, sign >= 0, conservative)
    return np.asarray(np.where(crossing, np.minimum(sign, -grown.astype(np.int8)), sign), np.int8)


def _cross(a: Floats, b: Floats, c: Floats, d: Floats, asked: Bools, conservative: bool) -> Bools:
    """Whether two segments cross, in the rows asked for; if conservative, also True where floats cannot decide."""
    boxes = asked
    for k in range(2):
        p, q, s, t = (v[..., k] for v in (a, b, c, d))
        boxes = boxes & (np.minimum(p, q) <= np.maximum(s, t)) & (np.minimum(s, t) <= np.maximum(p, q))
    crossing = np.zeros(boxes.shape, np.bool_)
    if not boxes.any():
        return crossing
    a, b, c, d = (np.broadcast_to(v, (*boxes.shape, 2))[boxes] for v in (a, b, c, d))
    sides = orient2d(a, b, c, conservative) * orient2d(a, b, d, conservative)
    others = orient2d(c, d, a, conservative) * orient2d(c, d, b, conservative)
    least = 0 if conservative else -1
    crossing[boxes] = (sides <= least) & (others <= least)
    return crossing


def _numbers(field: str, values: npt.ArrayLike) -> Floats:
    array = array_of(field, values)
    if array.dtype.kind not in "iuf":
        raise InputError(f"{field}: expected numbers, got {shown(values)}")
    return array.astype(np.float64, copy=False)


def _points(size: int, /, **given: npt.ArrayLike) -> Given:
    """Columns of points in 2-D or 3-D, whose names are those of their arguments."""
    columns = []
    for field, points in given.items():
        array = _numbers(field, points)
        if not array.ndim or array.shape[-1] != size:
            raise InputError(f"{field}: expected {size} coordinates on the last axis, got {array.shape}")
        columns += [(field, array[..., k]) for k in range(size)]
    return columns


def _radii(**given: npt.ArrayLike) -> Given:
    return [(field, _numbers(field, radii)) for field, radii in given.items()]


def _signs(predicate: Predicate, given: Given, conservative: bool) -> Signs:
    """Signs of the broadcast rows, a chunk at a time, and then of the rows in doubt."""
    quick = flag("conservative", conservative)
    _refuse_axes(given)
    doubts, kept, done = [], [], 0
    chunks = chunked([column for _, column in given], np.int8, SIGN_ROWS)
    with chunks, np.errstate(all="ignore"):
        for *rows, signs in chunks:
            if len(signs) and len(doubt := _chunk(predicate, rows, signs)):
                doubts.append(done + doubt)
                kept.append([row[doubt] for row in rows])
            done += len(signs)
        found = np.asarray(chunks.operands[-1])
        if doubts:
            places, hard = np.concatenate(doubts), np.concatenate(kept, axis=1)
            signs, left = _row_signs(predicate, list(hard))
            if len(left):
                hard = hard[:, left]
                _refuse_infinite([name for name, _ in given], hard, places[left])
                signs[left] = 0 if quick else _exact(predicate, hard)
            found.reshape(-1)[places] = signs
    return found


def chunked(columns: list[Floats], kind: type, rows: int = CHUNK_ROWS) -> Any:
    """Chunks of columns that broadcast, each with a part of an array of one kind to be filled: the last operand."""
    flags: Any = ["external_loop", "buffered", "zerosize_ok"]
    modes: Any = [["readonly"]] * len(columns) + [["writeonly", "allocate"]]
    types: Any = [np.float64] * len(columns) + [kind]
    return np.nditer([*columns, None], flags, modes, types, order="C", buffersize=rows)


def _refuse_axes(given: Given) -> None:
    """Refuse columns whose axes do not broadcast; the error names the first that does not fit those before."""
    shape: tuple[int, ...] = ()
    for name, column in given:
        if column.shape != shape:
            try:
                shape = np.broadcast_shapes(shape, column.shape)
            except ValueError:
                raise InputError(f"{name}: expected axes that broadcast with {shape}, got {column.shape}") from None


def _refuse_infinite(names: list[str], columns: Floats, rows: Ints) -> None:
    bad = np.argwhere(~np.isfinite(columns.T))
    if len(bad):
        i, k = bad[0].tolist()
        raise InputError(f"{names[k]}: expected finite numbers, got {columns[k, i]} in row {rows[i]}")


def _chunk(predicate: Predicate, columns: list[Floats], signs: Signs) -> Ints:
    """Fill in the signs of one chunk, and return the rows that one bound for all leaves in doubt."""
    value, magnitudes = predicate.value(columns)
    np.subtract((value > 0).view(np.int8), (value < 0).view(np.int8), out=signs)
    bound = predicate.bound(*(max(max(v.max(), -v.min()) for v in values) for values in magnitudes))
    size = np.abs(value)
    if size.min() > bound and bound < BOUND_HUGE:
        return np.zeros(0, np.int64)
    return np.flatnonzero(~((size > bound) & (size < FLOAT_HUGE)))


def _row_signs(predicate: Predicate, columns: list[Floats]) -> tuple[Signs, Ints]:
    """Signs by a bound for each row, and the rows that are still in doubt."""
    value, magnitudes = predicate.value(columns)
    bounds = predicate.bound(*(np.abs(values).max(axis=0) for values in magnitudes))
    size = np.abs(value)
    return _sign(value), np.flatnonzero(~((size > bounds) & (size < FLOAT_HUGE)))


def _exact(predicate: Predicate, columns: Floats) -> Signs:
    """Signs in integers; the lengths of each row are in units of its smallest power of two."""
    mantissas, exponents = np.frexp(columns)
    shifts = exponents - exponents.min(axis=0)
    numbers = (mantissas * 2.0**53).astype(np.int64).astype(object) << shifts.astype(object)
    return _sign(predicate.exact(list(numbers)) if predicate.exact else predicate.value(list(numbers))[0])


def _sign(value: Numbers) -> Signs:
    return np.asarray((value > 0).astype(np.int8) - (value < 0).astype(np.int8))


def _orient2d(columns: list[Numbers]) -> Valued:
    ax, ay, bx, by, cx, cy = columns
    left, right = (ax - cx) * (by - cy), (ay - cy) * (bx - cx)
    return left - right, ((left,), (right,))


def _orient3d(columns: list[Numbers]) -> Valued:
    a, b, c = ([columns[3 * i + k] - columns[9 + k] for k in range(3)] for i in range(3))
    terms = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    return sum(a[k] * (b[i] * c[j] - b[j] * c[i]) for i, j, k in terms), (a, b, c)


def _orient3d_bound(a: Any, b: Any, c: Any) -> Any:
    """Bound of six terms, each at most a * b * c, including products that underflow before they are multiplied by a."""
    return 6 * ORIENT3D_ERROR * a * (b * c + FLOAT_TINY) + FLOAT_TINY


def _circles(columns: list[Numbers]) -> Valued:
    *coordinates, r1, r2 = columns
    d, radius2 = len(coordinates) // 2, (r1 + r2) ** 2
    value = sum((coordinates[k] - coordinates[d + k]) ** 2 for k in range(d)) - radius2
    return value, ((radius2,), (value,))


def _circles_bound(radius2: Any, value: Any) -> Any:
    """Bound of 9 roundings: where the sign is in doubt both squares are about equal. NaN for an infinite value."""
    return 10 * ROUNDING * radius2 + FLOAT_TINY + 0 * value


def _point_segment(columns: list[Numbers]) -> Valued:
    px, py, ax, ay, bx, by, r1, r2 = columns
    f, d, radius = (px - ax, py - ay), (bx - ax, by - ay), r1 + r2
    length2 = d[0] * d[0] + d[1] * d[1]
    return squared_distance(f, d, length2) - radius * radius, (f, (radius,), (length2,))


def _ends(columns: list[Numbers]) -> Valued:
    """Least of the four distances from the ends of two segments to the other segment."""
    found, magnitudes = zip(*(_point_segment(part) for part in _four_ends(columns)), strict=True)
    ways, radii, lengths2 = zip(*magnitudes, strict=True)
    return functools.reduce(np.minimum, found), (sum(ways, ()), radii[0], lengths2[0] + lengths2[2])


def _four_ends(columns: list[Numbers]) -> list[list[Numbers]]:
    """Columns for `_point_segment` of each end of two segments and the other segment."""
    a, b, c, d = (columns[2 * k : 2 * k + 2] for k in range(4))
    return [[*p, *q, *s, *columns[8:]] for p, q, s in ((c, a, b), (d, a, b), (a, c, d), (b, c, d))]


def squared_distance(f: Any, d: Any, length2: Numbers) -> Floats:
    """Squared distance of a point to a segment; f leads from its start to the point, d from its start to its end."""
    share = (f[0] * d[0] + f[1] * d[1]) / np.maximum(length2, FLOAT_TINY)
    share = np.minimum(np.maximum(share, 0), 1)
    x, y = f[0] - share * d[0], f[1] - share * d[1]
    return np.asarray(x * x + y * y)


def _point_segment_bound(f: Any, radius: Any, length2: Any) -> Any:
    """Bound of a distance that errs by at most e: 14 roundings of |f|, which is at least its part along the segment.

    A length whose square underflows is below LENGTH_TINY; one whose square is huge is left to integers.
    """
    e = 32 * ROUNDING * f + LENGTH_TINY
    bound = e * (2 * radius + e) + 10 * ROUNDING * radius * radius
    return np.where(length2 < FLOAT_HUGE, bound, np.inf)


def _point_segment_exact(columns: list[Numbers]) -> Numbers:
    px, py, ax, ay, bx, by, r1, r2 = columns
    fx, fy, dx, dy = px - ax, py - ay, bx - ax, by - ay
    share, length2, radius2 = fx * dx + fy * dy, dx * dx + dy * dy, (r1 + r2) ** 2
    at_a = fx * fx + fy * fy - radius2
    at_b = (px - bx) ** 2 + (py - by) ** 2 - radius2
    between = (fx * dy - fy * dx) ** 2 - radius2 * length2
    return np.asarray(np.where(share <= 0, at_a, np.where(share >= length2, at_b, between)))


def _ends_exact(columns: list[Numbers]) -> Numbers:
    """Least of four signs; the values have different degrees and cannot be compared."""
    return np.asarray(np.minimum.reduce([_sign(_point_segment_exact(part)) for part in _four_ends(columns)]))


_ORIENT2D = Predicate(_orient2d, lambda left, right: ORIENT2D_ERROR * (left + right) + FLOAT_TINY)
_ORIENT3D = Predicate(_orient3d, _orient3d_bound)
_CIRCLES = Predicate(_circles, _circles_bound)
_POINT_SEGMENT = Predicate(_point_segment, _point_segment_bound, _point_segment_exact)
_ENDS = Predicate(_ends, _point_segment_bound, _ends_exact)
