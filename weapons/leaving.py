"""The least shift that leaves a union of closed convex shapes: polygons and discs of one radius, about 0.

The nearest point out of a union lies straight out of one edge or arc, or where two of them cross: these are the
candidates, of which those stay that have no shape just beyond them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import product

import numpy as np

from planes.arrays import Bools, Floats

__all__ = ["EDGES", "Union", "leaving"]

EDGES = 6
"""Edges of a polygon, at most: of a square that is swept along a segment."""

GAP = 2.0**-30
"""A gap between two shapes that is no wider is none, px: floats tell others, of segments of up to 2**20 px."""

PARALLEL = 2.0**-40
"""Sine of the angle between edges that are taken for parallel: where they cross is beyond all that is looked at."""

CUSP = 2.0**-12
"""Between two boundaries that touch from outside, at so small an angle or less, it is looked so far along them, px."""

TOUCHING = 1 + 2.0**-40
"""Of distances that floats tell apart though they are the same."""

FEW, SMALL = 24, 2.0**-10
"""Edges in a square of shifts of which all pairs are tried, and half the side of one that is not cut further, px."""

AT_A_TIME = 2**19
"""Comparisons, or pairs of boundaries, that are worked on at a time."""


@dataclass(frozen=True, eq=False)
class Union:
    """A union of closed shapes.

    Parameters
    ----------
    normal, offset : (P, EDGES, 2) and (P, EDGES) a polygon is where normal . s <= offset, for all; normals have length
        1, an offset of inf is no edge
    centre, radius : (D, 2) of discs
    """

    normal: Floats
    offset: Floats
    centre: Floats
    radius: float

    def around(self, middle: Floats, half: float) -> Union | None:
        """The shapes that may meet a square and a little around it; None if one of them contains it."""
        reach = half + 2 * CUSP
        wide = np.abs(self.normal).sum(axis=2) * reach
        at = self.normal[..., 0] * middle[0] + self.normal[..., 1] * middle[1] - self.offset
        x, y = np.abs(self.centre - middle).T
        far2, near2 = (np.maximum(x + k, 0) ** 2 + np.maximum(y + k, 0) ** 2 for k in (reach, -reach))
        if (at + wide <= 0).all(axis=1).any() or (far2 <= self.radius**2).any():
            return None
        met = (at - wide <= 0).all(axis=1)
        return Union(self.normal[met], self.offset[met], self.centre[near2 <= self.radius**2], self.radius)

    def boundaries(self, middle: Floats, half: float) -> tuple[Floats, Floats]:
        """Lines (n, 3) of edges, as normal and offset, and centres (m, 2) of circles that pass through a square."""
        normal, offset = self.normal.reshape(-1, 2), self.offset.ravel()
        passes = np.abs(normal[:, 0] * middle[0] + normal[:, 1] * middle[1] - offset) <= np.abs(normal).sum(axis=1) * (
            half + GAP
        )
        apart = np.sqrt(((self.centre - middle) ** 2).sum(axis=1))
        lines = np.concatenate([normal[passes], offset[passes, None]], axis=1)
        return np.unique(lines, axis=0), self.centre[np.abs(apart - self.radius) <= 2 * (half + GAP)]

    def lacks(self, s: Floats) -> Bools:
        """Which points (n, 2) lie in none of the shapes."""
        out = np.ones(len(s), np.bool_)
        step = max(1, AT_A_TIME // (EDGES * len(self.offset) + 2 * len(self.centre) + 1))
        for first in range(0, len(s), step):
            x, y = s[first : first + step].T[:, :, None]
            beyond = np.zeros((len(x), len(self.offset)), np.bool_)
            for edge in range(EDGES):
                beyond |= self.normal[:, edge, 0] * x + self.normal[:, edge, 1] * y > self.offset[:, edge]
            apart = (x - self.centre[:, 0]) ** 2 + (y - self.centre[:, 1]) ** 2 > self.radius**2
            out[first : first + step] = beyond.all(axis=1) & apart.all(axis=1)
        return out


def leaving(union: Union, most: float) -> tuple[float, float] | None:
    """Find the shortest shift, up to `most` px, to the edge of a union, beyond which there is nothing of it.

    Of several the first by (y, x). Squares of shifts are looked at from the nearest on: one that lies in a single shape
    has no way out, one with many edges is cut into four.
    """
    best: tuple[float, float] | None = None
    squares = [(0.0, 0.0, 0.0, most, union)]
    while squares:
        near, y, x, half, shapes = heappop(squares)
        if near > (most if best is None else _length(best)):
            break
        here = np.array([x, y])
        some = shapes.around(here, half)
        if some is None:
            continue
        lines, circles = some.boundaries(here, half)
        if len(lines) + len(circles) > FEW and half > SMALL:
            half /= 2
            for j, i in product((y - half, y + half), (x - half, x + half)):
                least = max(abs(i) - half, 0.0), max(abs(j) - half, 0.0)
                heappush(squares, (_length(least), j, i, half, some))
            continue
        for at, outward in (_feet(lines, circles, union.radius), *_crossings(lines, circles, union.radius)):
            inside = (np.abs(at - here) <= half + GAP).all(axis=1)
            best = _first_out(some, at[inside], outward[inside], best, most)
    return best


def _length(s: tuple[float, float]) -> float:
    return float(np.sqrt(s[0] ** 2 + s[1] ** 2))


def _first_out(
    union: Union, at: Floats, outward: Floats, best: tuple[float, float] | None, most: float
) -> tuple[float, float] | None:
    """The first by (length, y, x) of some points, with nothing just beyond them, and of the best so far."""
    length = np.sqrt((at**2).sum(axis=1))
    near = np.flatnonzero(length <= (most if best is None else _length(best)))
    near = near[np.lexsort((at[near, 0], at[near, 1], length[near]))]
    step = 64
    while len(near):
        some, near = near[:step], near[step:]
        free = some[union.lacks(at[some] + GAP * outward[some])]
        if len(free):
            found = float(at[free[0], 0]) + 0.0, float(at[free[0], 1]) + 0.0
            order = [(_length(s), s[1], s[0], s) for s in (found, best) if s is not None]
            return min(order)[3]
        step *= 2
    return best


def _feet(lines: Floats, circles: Floats, radius: float) -> tuple[Floats, Floats]:
    """Points of boundaries that lie straight out from 0, and which way is out of their own shape."""
    foot = lines[:, :2] * lines[:, 2:]
    apart = np.sqrt((circles**2).sum(axis=1))
    some = apart > 0
    ways = [-circles[some] / apart[some, None]]
    middles = [circles[some]]
    if not some.all():  # 0 is a centre: any way is as short
        ways.append(np.array([[0.0, -1.0], [-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        middles.append(np.zeros((4, 2)))
    way, middle = np.concatenate(ways), np.concatenate(middles)
    return np.concatenate([foot, middle + radius * way]), np.concatenate([lines[:, :2], way])


def _crossings(lines: Floats, circles: Floats, radius: float) -> Iterator[tuple[Floats, Floats]]:
    """Points where two boundaries cross, and the way between those out of both."""
    step = max(1, AT_A_TIME // (4 * max(len(lines) + len(circles), 1)))
    for first in range(0, len(lines), step):
        yield _line_line(lines[first : first + step], lines)
        if len(circles):
            yield _line_circle(lines[first : first + step], circles, radius)
    for first in range(0, len(circles), step):
        yield _circle_circle(circles[first : first + step], circles, radius)


def _line_line(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    first, second = (index.ravel() for index in np.indices((len(a), len(b))))
    det = a[first, 0] * b[second, 1] - a[first, 1] * b[second, 0]
    some = np.abs(det) > PARALLEL
    one, other, det = a[first[some]], b[second[some]], det[some]
    x = (one[:, 2] * other[:, 1] - other[:, 2] * one[:, 1]) / det
    y = (one[:, 0] * other[:, 2] - other[:, 0] * one[:, 2]) / det
    return np.stack([x, y], axis=1), _unit(one[:, :2] + other[:, :2])


def _line_circle(lines: Floats, circles: Floats, radius: float) -> tuple[Floats, Floats]:
    line, circle = (index.ravel() for index in np.indices((len(lines), len(circles))))
    normal, middle = lines[line, :2], circles[circle]
    across = lines[line, 2] - (normal * middle).sum(axis=1)
    some = np.abs(across) <= radius * TOUCHING
    normal, middle, across = normal[some], middle[some], across[some, None]
    return _both_sides(middle + normal * across, normal, np.sqrt(np.maximum(radius**2 - across**2, 0)), middle, None)


def _circle_circle(a: Floats, b: Floats, radius: float) -> tuple[Floats, Floats]:
    first, second = (index.ravel() for index in np.indices((len(a), len(b))))
    apart2 = ((b[second] - a[first]) ** 2).sum(axis=1)
    some = (apart2 > 0) & (apart2 <= 4 * radius**2 * TOUCHING)
    one, other, apart2 = a[first[some]], b[second[some]], apart2[some, None]
    along = (other - one) / np.sqrt(apart2)
    return _both_sides((one + other) / 2, along, np.sqrt(np.maximum(radius**2 - apart2 / 4, 0)), one, other)


def _both_sides(
    foot: Floats, along: Floats, aside: Floats, middle: Floats, other: Floats | None
) -> tuple[Floats, Floats]:
    """Points of a circle on both sides of a foot, across a direction; out of it and of a second circle, or a line."""
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    at = np.concatenate([foot + across * aside, foot - across * aside])
    second = np.tile(along, (2, 1)) if other is None else _unit(at - np.tile(other, (2, 1)))
    between = _unit(at - np.tile(middle, (2, 1))) + second
    cusp = (between**2).sum(axis=1) < CUSP**2
    outward = np.where(cusp[:, None], np.concatenate([across, -across]) * (CUSP / GAP), _unit(between))
    return at, outward


def _unit(ways: Floats) -> Floats:
    length = np.sqrt((ways**2).sum(axis=1, keepdims=True))
    return np.asarray(ways / np.where(length > 0, length, 1))
