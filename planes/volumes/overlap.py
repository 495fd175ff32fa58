"""Overlap tests for all pairs of volumes, in both orders; volumes are closed sets, so touching counts.

Some pairs have a closed form. The others are tested as hulls of points with a radius: by separating axes without radii,
by distances of edges with them. Every sign is exact on the float64 inputs.

The outline of a hull turns from +x towards +y, so a point lies beyond an edge if `orient2d` is below 0. Columns are
points (2, k, n): x and y, k points a row, n rows.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from ..common.checks import Bools, Floats, InputError, Ints, array_of, flag, kind_of, reals
from ..common.limits import CHUNK_ROWS, DISTANCE_ERROR, FLOAT_HUGE, FLOAT_TINY, LENGTH_TINY, SIDE_ERROR
from ..grid.spans import ragged
from .exact import Signs, circles_sign, orient2d, point_segment_sign, segment_segment_sign, squared_distance
from .polygons import rows_of, starts_of
from .volumes import Aabbs, Capsules, Circles, Core, Obbs, Parts, Polygons, Volumes


def hulls_sign(one: Core, two: Core, rows: Ints) -> Signs:
    """Test rows of two volumes for overlap in floats: -1 overlapping, 1 apart, 0 undecided.

    See Ericson, *Real-Time Collision Detection* (2005), 4.4.1, 5.1.2 and 5.2.1.
    """
    signs = np.zeros(len(rows), np.int8)
    most_corners = np.maximum(one.counts[rows], two.counts[rows])
    order = np.argsort(-most_corners, kind="stable")  # so rows of a chunk have about as many
    done = 0
    with np.errstate(all="ignore"):
        while done < len(rows):
            chunk = order[done : done + max(CHUNK_ROWS // int(most_corners[order[done]]), 1)]
            signs[chunk] = _chunk_sign(one, two, rows[chunk])
            done += len(chunk)
    return signs


def _chunk_sign(one: Core, two: Core, rows: Ints) -> Signs:
    """Test the edges of one, then of the other, then distances; decided rows leave the batch."""
    a, b = (_corners(core, rows) for core in (one, two))
    a_ends, b_ends = ((v == np.roll(v, -1, axis=1)).all(axis=0) for v in (a, b))  # edges without length
    middle = a[:, :1].copy()
    a -= middle
    b -= middle
    reach = np.maximum(np.abs(a).max(axis=(0, 1)), np.abs(b).max(axis=(0, 1)))
    signs, met = _edges_sign(a, b, a_ends, reach)
    left = np.flatnonzero(signs == 0)
    others, met_too = _edges_sign(
        b.take(left, axis=2), a.take(left, axis=2), b_ends.take(left, axis=1), reach.take(left)
    )
    signs[left] = np.where(met[left] & met_too & (others == 0), -1, others)
    radius = one.radius[rows] + two.radius[rows]
    if radius.any():
        left = np.flatnonzero((signs >= 0) & (radius > 0))
        far = _distance_sign(a.take(left, axis=2), b.take(left, axis=2), reach.take(left), radius.take(left))
        signs[left] = np.where(far > 0, signs[left], far)
    return signs


def _corners(core: Core, rows: Ints) -> Floats:
    """Corners of rows as columns; a row with fewer corners than the longest repeats its last."""
    counts = core.counts[rows]
    places = np.arange(counts.max())[:, None]
    if not (counts == len(places)).all():
        places = np.minimum(places, counts - 1)
    pairs = np.ascontiguousarray(core.points).view(np.complex128)[:, 0]  # x and y are gathered as one
    found = pairs[core.starts[rows] + places]
    return np.stack([found.real, found.imag])


def _edges_sign(a: Floats, b: Floats, ends: Bools, reach: Floats) -> tuple[Signs, Bools]:
    """Sides of the edges of a on which the corners of b lie; edges without length are ignored.

    The sign is 1 where all corners lie beyond an edge, -1 where one lies within all edges, else 0. Returned, too, is
    where they all lie beyond no edge, and there is one.
    """
    bound = SIDE_ERROR * reach * reach + FLOAT_TINY
    parted, met = np.zeros(len(reach), np.bool_), np.ones(len(reach), np.bool_)
    within = np.full(b.shape[1:], np.inf)
    after = np.roll(a, -1, axis=1)
    for k in range(a.shape[1]):
        (x, y), (dx, dy) = a[:, k], after[:, k] - a[:, k]
        side = dx * b[1]
        side -= dy * b[0]
        side -= dx * y - dy * x
        if ends[k].any():
            side[:, ends[k]] = np.inf
        top = side.max(axis=0)
        parted |= top < -bound
        met &= top > bound
        np.minimum(within, side, out=within)
    most = within.max(axis=0)
    inside = (most > bound) & (most < np.inf)
    return parted.astype(np.int8) - inside.astype(np.int8), met & (most < np.inf)


def _distance_sign(a: Floats, b: Floats, reach: Floats, radius: Floats) -> Signs:
    """Compare the least distance from a corner of either to an edge of the other with the radius."""
    least = np.full(len(reach), np.inf)
    for corners, edges in ((a, b), (b, a)):
        count = edges.shape[1]
        if count == 1 and corners.shape[1] > 1:
            continue  # the distances from the other's edges to this point suffice
        for k in range(1 if count == 2 else count):
            p, d = edges[:, k, None], edges[:, (k + 1) % count, None] - edges[:, k, None]
            far = squared_distance(corners - p, d, d[0] * d[0] + d[1] * d[1])
            np.minimum(least, far.min(axis=0), out=least)
    value = least - radius * radius
    error = DISTANCE_ERROR * reach + LENGTH_TINY
    bound = error * (2 * radius + error)
    bound[~(reach * reach < FLOAT_HUGE)] = np.inf
    return np.subtract((value > bound).view(np.int8), (value < -bound).view(np.int8))


def edge_parts(first: Core, second: Core, rows: Ints, k: int, conservative: bool) -> Bools:
    """Whether the second lies strictly beyond edge k of the first; a segment has an edge on either side."""
    parted = np.flatnonzero(k < first.counts[rows])
    here = rows[parted]
    p, q = first.point(here, k), first.point(here, k + 1)
    for j in range(int(second.counts[here].max(initial=0))):
        outside = orient2d(p, q, second.point(here, np.minimum(j, second.counts[here] - 1)), conservative) < 0
        parted, here, p, q = parted[outside], here[outside], p[outside], q[outside]
    found = np.zeros(len(rows), np.bool_)
    found[parted] = True
    return found


Rows = Ints | None  # numbers of rows; None for all rows

Test = Callable[[Any, Any, bool], Bools]
"""A test of two volumes of equal length, row against row; the flag skips the exact stage."""


def overlap(a: Volumes, b: Volumes, conservative: bool = False) -> Bools:
    """Test rows of a and b for a common point.

    Parameters
    ----------
    a, b : volumes or sets of parts, N rows against N, or against 1
    conservative : skip the exact stage; rows that floats cannot decide are True

    Returns
    -------
    (N,) bool

    Raises
    ------
    InputError
        If an argument is not a volume, or has infinite bounds; or they differ in length or in dimensions.

    References
    ----------
    Ericson, *Real-Time Collision Detection* (2005), 4.2 to 5.2.
    """
    _checked("a", a)
    _checked("b", b)
    quick = flag("conservative", conservative)
    if a.d != b.d:
        raise InputError(f"b: expected volumes in {a.d}-D, got {b.d}-D")
    n = _rows(len(a), len(b))
    i, j = (None if len(v) == n else np.zeros(n, np.int64) for v in (a, b))
    return _pairs(a, b, i, j, quick)


def contains_point(volume: Volumes, xy: object, conservative: bool = False) -> Bools:
    """Tell which rows contain a point; a point on the edge is inside.

    Parameters
    ----------
    xy : one point (d,), or one for each row (N, d)
    conservative : yes where floats cannot tell, never no where it is yes
    """
    d = _checked("volume", volume).d
    points = array_of("xy", xy)
    points = reals("xy", points, (d,) if points.ndim == 1 else (None, d)).reshape(-1, d)
    _rows(len(volume), len(points), "xy")
    return overlap(volume, Circles(points, 0.0), conservative)


def separating_axis(a: Volumes, b: Volumes) -> Floats:
    """Find a line that separates two hulls without radii, row by row.

    Returns
    -------
    (N, 4) float, rows (x0, y0, x1, y1): two points of a line that one hull touches, with the other beyond it; NaN if
    the rows overlap. The points are corners of a hull, or the line is parallel to x or y if no edge separates two hulls
    without area

    Raises
    ------
    InputError
        If an argument has a radius, is a set of parts, or is not in 2-D.
    """
    for name, volume in (("a", a), ("b", b)):
        if type(_checked(name, volume)) not in (Aabbs, Obbs, Polygons) or volume.d != 2:
            kind = type(volume).__name__
            raise InputError(f"{name}: expected boxes or polygons in 2-D, got {kind} in {volume.d}-D")
    n = _rows(len(a), len(b))
    hulls = tuple(v if len(v) == n else v.take(np.zeros(n, np.int64)) for v in (a, b))
    one, two = (v.core() for v in hulls)
    found = np.full((n, 4), np.nan)
    left = np.arange(n)
    for first, second in ((one, two), (two, one)):
        for k in range(int(first.counts.max(initial=0))):
            parted = edge_parts(first, second, left, k, False)
            rows = left[parted]
            found[rows] = np.concatenate([first.point(rows, k), first.point(rows, k + 1)], axis=1)
            left = left[~parted]
    found[left] = _line_between(*(v.take(left).bounds() for v in hulls))
    return found


def _line_between(a: Aabbs, b: Aabbs) -> Floats:
    """Lines along x or y that separate boxes, with b on the left side; NaN where there is none."""
    found = np.full((len(a), 4), np.nan)
    zero, one = np.zeros(len(a)), np.ones(len(a))
    for apart, line in (
        (a.max[:, 0] < b.min[:, 0], (a.max[:, 0], zero, a.max[:, 0], one)),
        (b.max[:, 0] < a.min[:, 0], (a.min[:, 0], one, a.min[:, 0], zero)),
        (a.max[:, 1] < b.min[:, 1], (one, a.max[:, 1], zero, a.max[:, 1])),
        (b.max[:, 1] < a.min[:, 1], (zero, a.min[:, 1], one, a.min[:, 1])),
    ):
        found[apart] = np.stack(line, axis=1)[apart]
    return found


def _checked(name: str, volume: Volumes) -> Volumes:
    if not isinstance(volume, Volumes):
        raise InputError(f"{name}: expected volumes, got {kind_of(volume)}")
    beyond = volume.beyond()
    if len(beyond):
        raise InputError(f"{name}: expected finite volumes, got bounds beyond the floats in row {beyond[0]}")
    return volume


def _rows(n: int, m: int, name: str = "b") -> int:
    if n != m and 1 not in (n, m):
        raise InputError(f"{name}: expected {n} rows or 1, got {m}")
    return n if m == 1 else m


def _pairs(a: Volumes, b: Volumes, i: Rows, j: Rows, conservative: bool) -> Bools:
    """Overlap of rows i of a with rows j of b; sets of parts overlap if any of their parts do."""
    if isinstance(b, Parts):
        return _any_part(b, j, lambda of, part: _pairs(a, b.parts, of if i is None else i[of], part, conservative))
    if isinstance(a, Parts):
        return _any_part(a, i, lambda of, part: _pairs(a.parts, b, part, of if j is None else j[of], conservative))
    test = TABLE.get((type(a), type(b)))
    if test is None:
        raise InputError(f"b: expected a volume that {type(a).__name__} are tested with, got {type(b).__name__}")
    one, two = (volume if rows is None else volume.take(rows) for volume, rows in ((a, i), (b, j)))
    return test(one, two, conservative) if len(one) else np.zeros(0, np.bool_)


def _any_part(sets: Parts, rows: Rows, test: Callable[[Ints, Ints], Bools]) -> Bools:
    """Test all parts of rows at once; `test` takes positions in `rows` and numbers of parts."""
    starts, (counts, _) = sets.starts, rows_of(sets.starts, len(sets.parts))
    if rows is not None:
        starts, counts = starts[rows], counts[rows]
    if not len(starts):
        return np.zeros(0, np.bool_)
    of, place = ragged(counts)
    return np.logical_or.reduceat(test(of, starts[of] + place), starts_of(counts))


def _circles_aabbs(a: Circles, b: Aabbs, conservative: bool) -> Bools:
    """Test the point of the box nearest to the centre; its coordinates are input coordinates, so it is exact."""
    nearest = np.clip(a.center, b.min, b.max)
    return circles_sign(a.center, a.radius, nearest, 0.0, conservative) <= 0


def _aabbs_aabbs(a: Aabbs, b: Aabbs, conservative: bool) -> Bools:
    axes = ((a.min[:, k] <= b.max[:, k]) & (b.min[:, k] <= a.max[:, k]) for k in range(a.d))
    return np.asarray(functools.reduce(np.logical_and, axes))


def _hulls_hulls(a: Volumes, b: Volumes, conservative: bool) -> Bools:
    """Test bounds and then separating axes; a decided row leaves the batch.

    The bounds also separate hulls that no edge does: segments on one line, and single points.
    """
    one, two = a.core(), b.core()
    found, left = _quickly(a, b, one, two)
    for first, second in ((one, two), (two, one)):
        for k in range(int(first.counts[left].max(initial=0))):
            left = left[~edge_parts(first, second, left, k, conservative)]
    found[left] = True
    return found


def _quickly(a: Volumes, b: Volumes, one: Core, two: Core) -> tuple[Bools, Ints]:
    """Rows that surely overlap by bounds and floats, as a mask, and the numbers of the undecided rows."""
    found = np.zeros(len(a), np.bool_)
    left = np.flatnonzero(_aabbs_aabbs(a.bounds(), b.bounds(), False))
    signs = hulls_sign(one, two, left)
    found[left[signs < 0]] = True
    return found, left[signs == 0]


def _round_hulls(a: Volumes, b: Volumes, conservative: bool) -> Bools:
    """Test a circle or capsule: one of its points lies in the hull, or an edge is within the radius."""
    one, two = a.core(), b.core()
    found, left = _quickly(a, b, one, two)
    inside = _holds(two, one, left, conservative)
    found[left[inside]] = True
    left = left[~inside]
    found[left] = _near(one, two, left, conservative)
    return found


def _holds(hull: Core, other: Core, rows: Ints, conservative: bool) -> Bools:
    """Whether the hull has an area and contains the first point of the other."""
    p = other.point(rows, 0)
    first, second, last = (hull.point(rows, k) for k in (0, 1, -1))  # of a box without area two of them are equal
    inside: Bools = (hull.counts[rows] > 2) & (first != second).any(axis=1) & (first != last).any(axis=1)
    for k in range(int(hull.counts[rows].max(initial=0))):
        at = np.flatnonzero(inside)
        here = rows[at]
        inside[at] = orient2d(hull.point(here, k), hull.point(here, k + 1), p[at], conservative) >= 0
    return inside


def _near(one: Core, two: Core, rows: Ints, conservative: bool) -> Bools:
    """Whether an edge of one is within the sum of the radii of an edge of the other."""
    found = np.zeros(len(rows), np.bool_)
    for k in range(int(one.counts[rows].max(initial=0))):
        for j in range(int(two.counts[rows].max(initial=0))):
            left = np.flatnonzero(~found & (k < one.counts[rows]) & (j < two.counts[rows]))
            at = rows[left]
            edges = one.point(at, k), one.point(at, k + 1), two.point(at, j), two.point(at, j + 1)
            found[left] = segment_segment_sign(*edges, one.radius[at], two.radius[at], conservative) <= 0
    return found


_HULLS: tuple[type[Volumes], ...] = (Aabbs, Obbs, Polygons)
_PAIRS: dict[tuple[type[Volumes], type[Volumes]], Test] = {
    **dict.fromkeys(itertools.product((Circles, Capsules), _HULLS), _round_hulls),
    **dict.fromkeys(itertools.combinations_with_replacement(_HULLS, 2), _hulls_hulls),
    (Aabbs, Aabbs): _aabbs_aabbs,
    (Circles, Circles): lambda a, b, quick: circles_sign(a.center, a.radius, b.center, b.radius, quick) <= 0,
    (Circles, Aabbs): _circles_aabbs,
    (Circles, Capsules): lambda a, b, quick: (
        point_segment_sign(a.center, b.a_xy, b.b_xy, a.radius, b.radius, quick) <= 0
    ),
    (Capsules, Capsules): lambda a, b, quick: (
        segment_segment_sign(a.a_xy, a.b_xy, b.a_xy, b.b_xy, a.radius, b.radius, quick) <= 0
    ),
}
TABLE = _PAIRS | {
    (b, a): lambda a, b, conservative, test=test: test(b, a, conservative)
    for (a, b), test in _PAIRS.items()
    if a is not b
}
"""The test of each of the fifteen pairs, in both orders."""
