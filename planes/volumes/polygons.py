"""Polygons: exact convex hulls, convex parts of simple polygons, and hulls of pixels.

Outlines and rings turn from +x toward +y. Points of hulls of pixels are in half pixels: the corners of pixel (x, y) are
(2x +- 1, 2y +- 1). A line (a, b, c) bounds the half-plane a x + b y <= c.
"""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, InputError, Ints
from ..grid.spans import meets, ragged
from .exact import orient2d, point_segment_sign, segment_segment_sign

Numbers = npt.NDArray[Any]
Corner = tuple[float, float]
Point = tuple[int, int]


def rows_of(starts: Ints, total: int) -> tuple[Ints, Ints]:
    """Length of each ragged row (N,), and row of each point (total,)."""
    counts = np.diff(np.append(starts, total))
    return counts, np.repeat(np.arange(len(starts)), counts)


def starts_of(lengths: Ints | list[int]) -> Ints:
    """Index of the first element of each ragged row, given the lengths."""
    counts = np.asarray(lengths, np.int64)
    return np.asarray(np.cumsum(counts) - counts)


def neighbours(starts: Ints, total: int) -> tuple[Ints, Ints]:
    """Indices of the points before and after each point (total,), around its ragged row."""
    counts, row = rows_of(starts, total)
    first, last = starts[row], (starts + counts - 1)[row]
    place = np.arange(total)
    return np.where(place == first, last, place - 1), np.where(place == last, first, place + 1)


def rows_taken(values: Numbers, starts: Ints, rows: Ints) -> tuple[Numbers, Ints]:
    """Selected ragged rows of values, and their starts."""
    counts = rows_of(starts, len(values))[0][rows]
    row, place = ragged(counts)
    return values[starts[rows][row] + place], starts_of(counts)


def convex_rows(points: Floats, starts: Ints) -> Ints:
    """Turning sense of outlines of three points or more: 1 or -1 if convex, 0 if not convex or without area.

    An outline is convex if all turns have one sense, and its edges change only once from rightward to leftward: a star
    that winds twice changes twice. Points on an edge are allowed; equal neighbours must have been removed.
    """
    if not len(starts):
        return np.zeros(0, np.int64)
    _, after = neighbours(starts, len(points))
    turns = orient2d(points, points[after], points[after[after]]).astype(np.int64)
    rightward = points[after, 0] > points[:, 0]
    changes = np.add.reduceat((rightward != rightward[after]).astype(np.int64), starts)
    low, high = np.minimum.reduceat(turns, starts), np.maximum.reduceat(turns, starts)
    return np.where(changes == 2, low + high, 0).clip(-1, 1)


def outlines(points: Floats, starts: Ints) -> tuple[Floats, Ints]:
    """Points and starts of the hulls of ragged rows; rows that are convex are only brought to one turning sense.

    A row without area has one or two points.
    """
    if not len(starts):
        return points, starts
    _, after = neighbours(starts, len(points))
    same: Bools = (points == points[after]).all(axis=1)  # equal neighbours would hide turns
    sense = np.where(np.logical_or.reduceat(same, starts), 0, convex_rows(points, starts))
    counts, row = rows_of(starts, len(points))
    place = np.arange(len(points)) - starts[row]
    points = points[np.where(sense[row] < 0, starts[row] + counts[row] - 1 - place, np.arange(len(points)))]
    if sense.all():
        return points, starts
    parts = np.split(points, starts[1:])
    for i in np.flatnonzero(sense == 0).tolist():
        parts[i] = np.array(hull([(x, y) for x, y in parts[i].tolist()]))
    return np.concatenate(parts), starts_of([len(part) for part in parts])


def hull(points: list[Corner]) -> list[Corner]:
    """Convex hull without points on its edges; one or two points if it has no area.

    References
    ----------
    Andrew, *Another efficient algorithm for convex hulls in two dimensions* (1979).
    """
    distinct = sorted(set(points))
    if len(distinct) < 3:
        return distinct
    whole = _whole(distinct)
    given = dict(zip(whole, distinct, strict=True))
    return [given[p] for run in (whole, whole[::-1]) for p in chain(run)[:-1]]


def chain(points: list[Point]) -> list[Point]:
    """Corners of one side of the hull of sorted points: Andrew's monotone chain."""
    kept: list[Point] = []
    for point in points:
        while len(kept) > 1 and turn(kept[-2], kept[-1], point) <= 0:
            kept.pop()
        kept.append(point)
    return kept


def convex_parts(points: list[Corner]) -> list[list[int]]:
    """Cut a simple polygon into convex parts, as indices of its points; points on edges are allowed.

    It is cut into triangles (Meisters, *Polygons have ears*, 1975), and then diagonals that no part needs to be convex
    are removed. This gives at most four times the least number of parts (Hertel and Mehlhorn, *Fast triangulation of
    simple polygons*, 1983). An InputError says if the polygon crosses or touches itself, or has no area.
    """
    _refuse_crossing(points)
    whole = _whole(points)
    parts = dict(enumerate(_triangles(whole)))
    owner = {edge: i for i, part in parts.items() for edge in _edges(part)}
    for u, v in list(owner):
        i, j = owner[u, v], owner.get((v, u))
        if j is None or j == i:
            continue
        merged = _merged(parts[i], parts[j], u, v, whole)
        if merged:
            parts[i] = merged
            owner |= dict.fromkeys(_edges(parts.pop(j)), i)
    return [_without_straight(part, whole) for part in parts.values()]


def _edges(part: list[int]) -> list[tuple[int, int]]:
    return list(zip(part, part[1:] + part[:1], strict=True))


def _merged(a: list[int], b: list[int], u: int, v: int, whole: list[Point]) -> list[int]:
    """Join two parts at their common edge, uv in a and vu in b; empty if the result is not convex."""
    k, m = a.index(v), b.index(u)
    a, b = a[k:] + a[:k], b[m:] + b[:m]  # from v to u, and from u to v
    for before, corner, after in ((a[-2], u, b[1]), (b[-2], v, a[1])):
        if turn(whole[before], whole[corner], whole[after]) < 0:
            return []
    return a + b[1:-1]


def _triangles(whole: list[Point]) -> list[list[int]]:
    n = len(whole)
    twice_area = sum(whole[i - 1][0] * whole[i][1] - whole[i][0] * whole[i - 1][1] for i in range(n))
    left = list(range(n)) if twice_area > 0 else list(range(n))[::-1]
    found = []
    while left := _without_straight(left, whole):
        k = next(k for k in range(len(left)) if _is_ear(left, k, whole))
        found.append([left[k - 1], left[k], left[(k + 1) % len(left)]])
        del left[k]
    return found


def _without_straight(left: list[int], whole: list[Point]) -> list[int]:
    """Remove points on edges; this turns no other corner."""
    after = left[1:] + left[:1]
    return [k for i, k in enumerate(left) if turn(whole[left[i - 1]], whole[k], whole[after[i]]) != 0]


def _is_ear(left: list[int], k: int, whole: list[Point]) -> bool:
    """Whether a corner turns inward and no other point lies in its closed triangle."""
    corner = (left[k - 1], left[k], left[(k + 1) % len(left)])
    a, b, c = (whole[i] for i in corner)
    if turn(a, b, c) <= 0:
        return False
    others = (whole[i] for i in left if i not in corner)
    return not any(turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in others)


def _refuse_crossing(points: list[Corner]) -> None:
    """Refuse a polygon in which edges touch, except neighbours in one point."""
    n = len(points)
    if n < 3:
        raise InputError(f"points: expected three or more, got {n}")
    begin = np.array(points)
    end, beyond = np.roll(begin, -1, axis=0), np.roll(begin, -2, axis=0)
    folded = np.minimum(point_segment_sign(beyond, begin, end, 0), point_segment_sign(begin, end, beyond, 0)) <= 0
    boxes = np.concatenate([np.minimum(begin, end), np.maximum(begin, end)], axis=1)
    i, j = np.nonzero(np.triu(meets(boxes[:, None], boxes), 1))
    crossing = segment_segment_sign(begin[i], end[i], begin[j], end[j], 0) <= 0
    last = (i == 0) & (j == n - 1)
    bad = np.flatnonzero(np.where(last, folded[j], np.where(j == i + 1, folded[i], crossing)))
    if len(bad):
        raise InputError(f"points: expected edges that do not cross or touch, got edges {i[bad[0]]} and {j[bad[0]]}")


def turn(a: Any, b: Any, c: Any) -> Any:
    """Twice the signed area of a triangle; positive if it turns from +x towards +y; c may hold columns of points."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _whole(points: list[Corner]) -> list[Point]:
    """Points as integers in units of their smallest power of two."""
    ratios = [(x.as_integer_ratio(), y.as_integer_ratio()) for x, y in points]
    unit = max((max(x[1], y[1]) for x, y in ratios), default=1)
    return [(x[0] * (unit // x[1]), y[0] * (unit // y[1])) for x, y in ratios]


Line = tuple[int, int, int]
Extents = tuple[Ints, Ints, Ints]  # rows with pixels, rising, and the first and last column of each


def extents(mask: Bools) -> Extents:
    """Rows of a mask with pixels, and the first and last column of each."""
    rows = np.flatnonzero(mask.any(axis=1))
    filled = mask if len(rows) == len(mask) else mask[rows]
    return rows, filled.argmax(axis=1), mask.shape[1] - 1 - filled[:, ::-1].argmax(axis=1)


def hull_points(extents: Extents) -> list[Point]:
    """Corners of the hull of pixel squares, given by rows and their ends; no three are on one line.

    Only the ends of rows can be corners, so the monotone chain (see `hull`) takes O(rows).
    """
    rows, first, last = extents
    place = rows - rows[0]
    left = np.full(int(place[-1]) + 2, last.max() + 1)
    right = np.full(len(left), first.min() - 1)
    left[place], right[place] = first, last
    left[place + 1] = np.minimum(left[place + 1], first)
    right[place + 1] = np.maximum(right[place + 1], last)
    borders = np.flatnonzero(left <= right)
    y = 2 * (borders + rows[0]) - 1
    down = zip((2 * right[borders] + 1).tolist(), y.tolist(), strict=True)
    up = zip((2 * left[borders] - 1)[::-1].tolist(), y[::-1].tolist(), strict=True)
    return chain(list(down)) + chain(list(up))


def edge_lines(ring: list[Point]) -> list[Line]:
    """Lines of the edges of a ring, with its inside on the <= side; edge i begins at point i."""
    lines = []
    for (x, y), (x_next, y_next) in zip(ring, ring[1:] + ring[:1], strict=True):
        a, b = y_next - y, x - x_next
        lines.append((a, b, a * x + b * y))
    return lines


def _cross(one: Line, other: Line) -> int:
    return one[0] * other[1] - one[1] * other[0]


def fewer_lines(lines: list[Line], n: int) -> list[Line]:
    """Remove edges of a convex polygon until n >= 4 are left, each time the edge whose removal adds the least area.

    Four edges can always be reached: of five outer angles, two neighbours always sum to less than half a turn.
    """
    lines = list(lines)
    costs = [_added(lines, i) for i in range(len(lines))]
    while len(lines) > n:
        i = costs.index(min(costs))
        del lines[i], costs[i]
        for near in (i - 1, i % len(lines)):
            costs[near] = _added(lines, near)
    return lines


def _added(lines: list[Line], i: int) -> float:
    """Area of the triangle that removing line i adds, in square half pixels; infinite if its neighbours do not meet."""
    before, line, after = lines[i - 1], lines[i], lines[(i + 1) % len(lines)]
    if _cross(before, after) <= 0:
        return math.inf
    whole = before[2] * _cross(line, after) - line[2] * _cross(before, after) + after[2] * _cross(before, line)
    return whole * whole / (2 * _cross(before, line) * _cross(line, after) * _cross(before, after))


def outward_corners(lines: list[Line]) -> Floats:
    """Corners (n, 2) in px of a convex polygon of lines, stored so that their hull contains it.

    Corners that float64 holds exactly are kept. Otherwise the lines move out by one unit in the last place of the
    largest coordinate; rounding takes back at most half a unit on each axis, 0.71 of a unit along any normal.
    """
    pairs = list(zip(lines[-1:] + lines[:-1], lines, strict=True))
    exact = [(Fraction(x, 2 * d), Fraction(y, 2 * d)) for x, y, d in itertools.starmap(_crossing, pairs)]
    corners = [(float(x), float(y)) for x, y in exact]
    if all(x == u and y == v for (x, y), (u, v) in zip(exact, corners, strict=True)):
        return np.array(corners)
    bits = 1 - math.frexp(math.ulp(2 * max(map(abs, itertools.chain(*corners)))))[1]
    moved = [(a, b, (c << bits) + 2 * (math.isqrt(a * a + b * b) + 1)) for a, b, c in lines]
    met = [_crossing(one, other) for one, other in zip(moved[-1:] + moved[:-1], moved, strict=True)]
    return np.array([(x / (d << bits + 1), y / (d << bits + 1)) for x, y, d in met])


def _crossing(one: Line, other: Line) -> tuple[int, int, int]:
    """Point where two lines meet; (x, y, d) stands for (x / d, y / d)."""
    (a, b, c), (p, q, r) = one, other
    return c * q - r * b, a * r - p * c, a * q - p * b
