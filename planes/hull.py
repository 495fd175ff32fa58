"""Convex hulls of pixel squares and of half-planes, on whole numbers.

Points are in half pixels: the corners of pixel (x, y) are (2x +- 1, 2y +- 1). Rings turn from +x toward +y.
A line (a, b, c) bounds the half-plane a x + b y <= c.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from planes.arrays import Bools, Floats, Ints
from planes.rings import chain, turn

__all__ = ["Extents", "edge_lines", "extents", "fewer_lines", "hull_points", "outward_corners", "turn"]

Point = tuple[int, int]
Line = tuple[int, int, int]
Extents = tuple[Ints, Ints, Ints]
"""Rows that have pixels, rising, and the first and last column of each."""


def extents(mask: Bools) -> Extents:
    """Rows that have pixels, and the first and last column of each."""
    rows = np.flatnonzero(mask.any(axis=1))
    some = mask if len(rows) == len(mask) else mask[rows]
    return rows, some.argmax(axis=1), mask.shape[1] - 1 - some[:, ::-1].argmax(axis=1)


def hull_points(extents: Extents) -> list[Point]:
    """Corners of the hull of pixel squares, given by rows and their ends; none of them between its neighbours.

    Only the ends of a row can be corners: O(rows) by the monotone chain.

    References
    ----------
    Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979).
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
    """Lines of a ring's edges, its inside on the <= side; edge i begins at point i."""
    lines = []
    for (x, y), (x_next, y_next) in zip(ring, ring[1:] + ring[:1], strict=True):
        a, b = y_next - y, x - x_next
        lines.append((a, b, a * x + b * y))
    return lines


def _cross(one: Line, other: Line) -> int:
    return one[0] * other[1] - one[1] * other[0]


def fewer_lines(lines: list[Line], n: int) -> list[Line]:
    """Leave out edges of a convex polygon until n >= 4 are left, each time the one that adds the least area.

    Four lines can always be reached: of five outer angles some two neighbours make less than half a turn.
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
    """Area of the triangle that leaving out line i adds, in square half pixels; infinite where none is closed."""
    before, line, after = lines[i - 1], lines[i], lines[(i + 1) % len(lines)]
    if _cross(before, after) <= 0:
        return math.inf
    whole = before[2] * _cross(line, after) - line[2] * _cross(before, after) + after[2] * _cross(before, line)
    return whole * whole / (2 * _cross(before, line) * _cross(line, after) * _cross(before, after))


def outward_corners(lines: list[Line]) -> Floats:
    """Corners (n, 2) in px of a convex polygon of lines, stored so that their hull contains it.

    Corners that float64 holds are kept. Otherwise the lines move out by one unit in the last place of the largest
    coordinate, more than rounding (half a unit both ways, 0.71 of it along any normal) can take back.
    """
    pairs = list(zip(lines[-1:] + lines[:-1], lines, strict=True))
    exact = [_meet(one, other) for one, other in pairs]
    corners = [(x / (2 * d), y / (2 * d)) for x, y, d in exact]
    if all(_is(u, x, 2 * d) and _is(v, y, 2 * d) for (u, v), (x, y, d) in zip(corners, exact, strict=True)):
        return np.array(corners)
    bits = 1 - math.frexp(math.ulp(2 * max(map(abs, itertools.chain(*corners)))))[1]
    moved = [(a, b, (c << bits) + 2 * (math.isqrt(a * a + b * b) + 1)) for a, b, c in lines]
    met = [_meet(one, other) for one, other in zip(moved[-1:] + moved[:-1], moved, strict=True)]
    return np.array([(x / (d << bits + 1), y / (d << bits + 1)) for x, y, d in met])


def _meet(one: Line, other: Line) -> tuple[int, int, int]:
    """Where two lines meet: (x, y, d) stands for (x / d, y / d)."""
    (a, b, c), (p, q, r) = one, other
    return c * q - r * b, a * r - p * c, a * q - p * b


def _is(value: float, numerator: int, denominator: int) -> bool:
    top, bottom = value.as_integer_ratio()
    return top * denominator == numerator * bottom
