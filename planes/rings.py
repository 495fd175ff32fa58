"""Rows of points to convex outlines, exactly: hulls, tests of convexity, and simple polygons cut into parts.

Orientation as in the frame: an outline turns from +x towards +y.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Floats, InputError, Ints
from planes.exact import orient2d
from planes.spans import ragged

__all__ = [
    "chain",
    "convex_parts",
    "convex_rows",
    "hull",
    "neighbours",
    "outlines",
    "rows_of",
    "rows_taken",
    "starts_of",
    "turn",
]

Numbers = npt.NDArray[Any]
Point = tuple[float, float]
Whole = tuple[int, int]


def rows_of(starts: Ints, total: int) -> tuple[Ints, Ints]:
    """Counts of ragged rows (N,), and the row of each point (total,)."""
    counts = np.diff(np.append(starts, total))
    return counts, np.repeat(np.arange(len(starts)), counts)


def starts_of(lengths: Ints | list[int]) -> Ints:
    """First places of ragged rows of these lengths."""
    counts = np.asarray(lengths, np.int64)
    return np.asarray(np.cumsum(counts) - counts)


def neighbours(starts: Ints, total: int) -> tuple[Ints, Ints]:
    """Places before and after each point (total,), going round its ragged row."""
    counts, row = rows_of(starts, total)
    first, last = starts[row], (starts + counts - 1)[row]
    place = np.arange(total)
    return np.where(place == first, last, place - 1), np.where(place == last, first, place + 1)


def rows_taken(values: Numbers, starts: Ints, rows: Ints) -> tuple[Numbers, Ints]:
    """Some ragged rows of values, and their starts."""
    counts = rows_of(starts, len(values))[0][rows]
    row, place = ragged(counts)
    return values[starts[rows][row] + place], starts_of(counts)


def convex_rows(points: Floats, starts: Ints) -> Ints:
    """Turning sense of convex outlines of three points or more: 1, -1; 0 where a row is not convex or has no area.

    All turns have one sense, and going round the edges change only once from rightward to leftward: a star that winds
    twice changes twice. Points on an edge pass; equal neighbours must have been removed.
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
    """Hulls of ragged rows: rows that are convex already are only brought to one turning sense.

    Returns
    -------
    points, starts : the outlines; rows that have no area have one or two points
    """
    if not len(starts):
        return points, starts
    sense = _checked_sense(points, starts)
    counts, row = rows_of(starts, len(points))
    place = np.arange(len(points)) - starts[row]
    points = points[np.where(sense[row] < 0, starts[row] + counts[row] - 1 - place, np.arange(len(points)))]
    if sense.all():
        return points, starts
    parts = np.split(points, starts[1:])
    for i in np.flatnonzero(sense == 0).tolist():
        parts[i] = np.array(hull([(x, y) for x, y in parts[i].tolist()]))
    return np.concatenate(parts), starts_of([len(part) for part in parts])


def _checked_sense(points: Floats, starts: Ints) -> Ints:
    """Sense of convex rows; 0 also for rows with equal neighbours, whose turns would not be seen."""
    _, after = neighbours(starts, len(points))
    same: Bools = (points == points[after]).all(axis=1)
    return np.where(np.logical_or.reduceat(same, starts), 0, convex_rows(points, starts))


def hull(points: list[Point]) -> list[Point]:
    """Convex hull, without points on its edges: one point or two where it has no area.

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


def chain(points: list[Whole]) -> list[Whole]:
    """Corners of one side of a hull, of points that go along it: Andrew's monotone chain."""
    kept: list[Whole] = []
    for point in points:
        while len(kept) > 1 and turn(kept[-2], kept[-1], point) <= 0:
            kept.pop()
        kept.append(point)
    return kept


def convex_parts(points: list[Point]) -> list[list[int]]:
    """Cut a simple polygon into convex parts on its own points, as indices; points on edges are welcome.

    Triangles first; then diagonals that no part needs to be convex are left out: at most four times as many parts
    stay as there must be.

    Raises
    ------
    InputError
        If it crosses or touches itself, or has no area.

    References
    ----------
    Meisters, *Polygons have ears* (1975); Hertel and Mehlhorn, *Fast triangulation of simple polygons* (1983).
    """
    whole = _whole(points)
    _refuse_crossing(whole)
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


def _merged(a: list[int], b: list[int], u: int, v: int, whole: list[Whole]) -> list[int]:
    """Two parts as one, without their common edge uv (of a; of b it is vu); empty where that is not convex."""
    k, m = a.index(v), b.index(u)
    a, b = a[k:] + a[:k], b[m:] + b[:m]  # from v to u, and from u to v
    for before, corner, after in ((a[-2], u, b[1]), (b[-2], v, a[1])):
        if turn(whole[before], whole[corner], whole[after]) < 0:
            return []
    return a + b[1:-1]


def _triangles(whole: list[Whole]) -> list[list[int]]:
    n = len(whole)
    twice_area = sum(whole[i - 1][0] * whole[i][1] - whole[i][0] * whole[i - 1][1] for i in range(n))
    left = list(range(n)) if twice_area > 0 else list(range(n))[::-1]
    found = []
    while left := _without_straight(left, whole):
        k = next(k for k in range(len(left)) if _is_ear(left, k, whole))
        found.append([left[k - 1], left[k], left[(k + 1) % len(left)]])
        del left[k]
    return found


def _without_straight(left: list[int], whole: list[Whole]) -> list[int]:
    """Corners alone: taking a point of an edge away turns no other corner."""
    after = left[1:] + left[:1]
    return [k for i, k in enumerate(left) if turn(whole[left[i - 1]], whole[k], whole[after[i]]) != 0]


def _is_ear(left: list[int], k: int, whole: list[Whole]) -> bool:
    """Whether a corner turns inward and no other point lies in its closed triangle."""
    corner = (left[k - 1], left[k], left[(k + 1) % len(left)])
    a, b, c = (whole[i] for i in corner)
    if turn(a, b, c) <= 0:
        return False
    others = (whole[i] for i in left if i not in corner)
    return not any(turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in others)


def _refuse_crossing(whole: list[Whole]) -> None:
    """Edges that are no neighbours do not meet; neighbours share one point."""
    n = len(whole)
    if n < 3:
        raise InputError(f"points: expected three or more, got {n}")
    edges = [(whole[i], whole[(i + 1) % n]) for i in range(n)]
    for i in range(n):
        for j in range(i + 1, n):
            (a, b), (c, d) = edges[i], edges[j]
            if j == i + 1 or (i == 0 and j == n - 1):
                p, q, s = (a, b, d) if j == i + 1 else (c, d, b)
                bad = turn(p, q, s) == 0 and (_within(p, q, s) or _within(q, s, p))
            else:
                bad = _meet(a, b, c, d)
            if bad:
                raise InputError(f"points: expected edges that do not cross or touch, got edges {i} and {j}")


def _meet(a: Whole, b: Whole, c: Whole, d: Whole) -> bool:
    turns = turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)
    if turns[0] * turns[1] < 0 and turns[2] * turns[3] < 0:
        return True
    ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(turn == 0 and _within(*end) for turn, end in zip(turns, ends, strict=True))


def _within(a: Whole, b: Whole, p: Whole) -> bool:
    """Whether a point of the line through a and b lies between them."""
    return all(min(a[k], b[k]) <= p[k] <= max(a[k], b[k]) for k in range(2))


def turn(a: Whole, b: Whole, c: Whole) -> int:
    """Twice the signed area of a triangle; positive when it turns from +x towards +y."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _whole(points: list[Point]) -> list[Whole]:
    """Points as integers in units of their smallest power of two."""
    ratios = [(x.as_integer_ratio(), y.as_integer_ratio()) for x, y in points]
    unit = max((max(x[1], y[1]) for x, y in ratios), default=1)
    return [(x[0] * (unit // x[1]), y[0] * (unit // y[1])) for x, y in ratios]
