"""Do two volumes overlap? The table of all pairs, in both orders; closed sets, so touching counts.

A pair has a closed form where it pays; the rest is decided on points and a radius: without radii by separating axes,
with them by the distances of edges. Every sign is exact on the float64 inputs.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from planes.arrays import Bools, Floats, InputError, Ints, array_of, flag, reals
from planes.axes import edge_parts, hulls_sign
from planes.exact import circles_sign, orient2d, point_segment_sign, segment_segment_sign
from planes.parts import Parts
from planes.rings import rows_of, starts_of
from planes.spans import ragged
from planes.volumes import Aabbs, Capsules, Circles, Core, Obbs, Polygons, Volumes

__all__ = ["contains_point", "overlap", "separating_axis"]

Rows = Ints | None
"""Numbers of rows, or all of them."""

Test = Callable[[Any, Any, bool], Bools]
"""Two volumes of equal length, row against row, and whether the exact stage is left out."""


def overlap(a: Volumes, b: Volumes, conservative: bool = False) -> Bools:
    """Tell which rows of a and b share a point.

    Parameters
    ----------
    a, b : volumes or sets of parts, N rows against N, or against 1
    conservative : leave the exact stage out: yes where floats cannot tell, never no where it is yes

    Returns
    -------
    (N,) bool

    Raises
    ------
    InputError
        If one is no volume, or bounds that reach beyond the floats; or they differ in length or in dimensions.

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
    """Tell which rows contain a point (d,), or each its own (N, d); a point on the edge is inside."""
    d = _checked("volume", volume).d
    points = array_of("xy", xy)
    points = reals("xy", points, (d,) if points.ndim == 1 else (None, d)).reshape(-1, d)
    _rows(len(volume), len(points), "xy")
    return overlap(volume, Circles(points, 0.0), conservative)


def separating_axis(a: Volumes, b: Volumes) -> Floats:
    """Find a line that separates two hulls without radii, row by row.

    Returns
    -------
    (N, 4) float: rows (x0, y0, x1, y1), two points of the line: one hull touches it, the other lies beyond. They are
    corners of the first; where no edge parts two hulls without areas, the line goes along x or y. NaN where the rows
    overlap

    Raises
    ------
    InputError
        If one has a radius, is a set of parts, or is not in 2-D.
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
    """Lines along x or y by which boxes are apart: b lies to the left of the way along them; NaN where it does not."""
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
        raise InputError(f"{name}: expected volumes, got {type(volume).__name__}")
    beyond = volume.beyond()
    if len(beyond):
        raise InputError(f"{name}: expected finite volumes, got bounds beyond the floats in row {beyond[0]}")
    return volume


def _rows(n: int, m: int, name: str = "b") -> int:
    if n != m and 1 not in (n, m):
        raise InputError(f"{name}: expected {n} rows or 1, got {m}")
    return n if m == 1 else m


def _pairs(a: Volumes, b: Volumes, i: Rows, j: Rows, conservative: bool) -> Bools:
    """Overlap of row i of a with row j of b; sets of parts overlap when any of their parts do."""
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
    """Test all parts of rows at once; `test` takes places in rows and numbers of parts."""
    starts, (counts, _) = sets.starts, rows_of(sets.starts, len(sets.parts))
    if rows is not None:
        starts, counts = starts[rows], counts[rows]
    if not len(starts):
        return np.zeros(0, np.bool_)
    of, place = ragged(counts)
    return np.logical_or.reduceat(test(of, starts[of] + place), starts_of(counts))


def _circles_circles(a: Circles, b: Circles, conservative: bool) -> Bools:
    return circles_sign(a.center, a.radius, b.center, b.radius, conservative) <= 0


def _circles_aabbs(a: Circles, b: Aabbs, conservative: bool) -> Bools:
    """By the point of the box nearest to the centre: each of its coordinates is one that is given."""
    nearest = np.clip(a.center, b.min, b.max)
    return circles_sign(a.center, a.radius, nearest, 0.0, conservative) <= 0


def _circles_capsules(a: Circles, b: Capsules, conservative: bool) -> Bools:
    return point_segment_sign(a.center, b.a_xy, b.b_xy, a.radius, b.radius, conservative) <= 0


def _aabbs_aabbs(a: Aabbs, b: Aabbs, conservative: bool) -> Bools:
    axes = ((a.min[:, k] <= b.max[:, k]) & (b.min[:, k] <= a.max[:, k]) for k in range(a.d))
    return np.asarray(functools.reduce(np.logical_and, axes))


def _capsules_capsules(a: Capsules, b: Capsules, conservative: bool) -> Bools:
    return segment_segment_sign(a.a_xy, a.b_xy, b.a_xy, b.b_xy, a.radius, b.radius, conservative) <= 0


def _hulls_hulls(a: Volumes, b: Volumes, conservative: bool) -> Bools:
    """Separating axes; a row that found its axis leaves the batch.

    Bounds come first. They also part what no edge does: segments on one line, and single points.
    """
    one, two = a.core(), b.core()
    found, left = _quickly(a, b, one, two)
    for first, second in ((one, two), (two, one)):
        for k in range(int(first.counts[left].max(initial=0))):
            left = left[~edge_parts(first, second, left, k, conservative)]
    found[left] = True
    return found


def _quickly(a: Volumes, b: Volumes, one: Core, two: Core) -> tuple[Bools, Ints]:
    """Where bounds and floats are sure that rows overlap, and the rows of which they are not sure."""
    found = np.zeros(len(a), np.bool_)
    left = np.flatnonzero(_aabbs_aabbs(a.bounds(), b.bounds(), False))
    signs = hulls_sign(one, two, left)
    found[left[signs < 0]] = True
    return found, left[signs == 0]


def _flat(core: Core, rows: Ints) -> Bools:
    """Hulls without an area: one or two points, or a box whose first corner is also its second or last."""
    p, q, s = (core.point(rows, k) for k in (0, 1, -1))
    return np.asarray((core.counts[rows] < 3) | (p == q).all(axis=1) | (p == s).all(axis=1))


def _round_hulls(a: Volumes, b: Volumes, conservative: bool) -> Bools:
    """A circle or capsule: one of its points lies in the hull, or an edge is as near as the radius."""
    one, two = a.core(), b.core()
    found, left = _quickly(a, b, one, two)
    inside = _holds(two, one, left, conservative)
    found[left[inside]] = True
    left = left[~inside]
    found[left] = _near(one, two, left, conservative)
    return found


def _holds(hull: Core, other: Core, rows: Ints, conservative: bool) -> Bools:
    """Where the hull has an area and the first point of the other in it."""
    p = other.point(rows, 0)
    inside = ~_flat(hull, rows)
    for k in range(int(hull.counts[rows].max(initial=0))):
        at = np.flatnonzero(inside)
        here = rows[at]
        inside[at] = orient2d(hull.point(here, k), hull.point(here, k + 1), p[at], conservative) >= 0
    return inside


def _near(one: Core, two: Core, rows: Ints, conservative: bool) -> Bools:
    """Where an edge of one is as near to an edge of the other as the sum of the radii."""
    found = np.zeros(len(rows), np.bool_)
    for k in range(int(one.counts[rows].max(initial=0))):
        for j in range(int(two.counts[rows].max(initial=0))):
            left = np.flatnonzero(~found & (k < one.counts[rows]) & (j < two.counts[rows]))
            at = rows[left]
            edges = one.point(at, k), one.point(at, k + 1), two.point(at, j), two.point(at, j + 1)
            found[left] = segment_segment_sign(*edges, one.radius[at], two.radius[at], conservative) <= 0
    return found


def _swapped(test: Test) -> Test:
    return lambda a, b, conservative: test(b, a, conservative)


_PAIRS: dict[tuple[type[Volumes], type[Volumes]], Test] = {
    (Circles, Circles): _circles_circles,
    (Circles, Aabbs): _circles_aabbs,
    (Circles, Capsules): _circles_capsules,
    (Circles, Obbs): _round_hulls,
    (Circles, Polygons): _round_hulls,
    (Aabbs, Aabbs): _aabbs_aabbs,
    (Aabbs, Obbs): _hulls_hulls,
    (Aabbs, Polygons): _hulls_hulls,
    (Obbs, Obbs): _hulls_hulls,
    (Obbs, Polygons): _hulls_hulls,
    (Polygons, Polygons): _hulls_hulls,
    (Capsules, Aabbs): _round_hulls,
    (Capsules, Obbs): _round_hulls,
    (Capsules, Polygons): _round_hulls,
    (Capsules, Capsules): _capsules_capsules,
}
TABLE = _PAIRS | {(b, a): _swapped(test) for (a, b), test in _PAIRS.items() if a is not b}
"""Who tests whom: the fifteen pairs, each both ways round."""
