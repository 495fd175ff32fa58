"""Pairs of shapes that are hard to decide, from a seed: near touching, far away, thin, tied, tiny and huge.

Each family makes rows as arrays. Most pairs are put together at one point of both outlines, with the outward normals
opposite, then moved as the family says, rounded, and nudged by up to three ulp: about half touch or overlap. Directions
are made without sines, so that a seed means the same numbers on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Floats
from weapons.truth import is_convex

__all__ = [
    "FAMILIES", "MAKERS", "TRIPLES", "Columns", "Rng", "across", "decades", "directions", "either", "filled", "nudged",
    "shape_pairs", "unit_circle",
]  # fmt: skip

Rng = np.random.Generator
Columns = tuple[npt.NDArray[Any], ...]
"""Arguments of a predicate, row by row."""

FAMILIES = {
    "near": "near touching, 1 to 3 ulp",
    "far": "offsets 10^0 to 10^12",
    "ratio": "size ratios to 10^12",
    "needles": "slivers and needles",
    "parallel": "near-parallel, collinear",
    "shared": "shared edges, vertices",
    "coplanar": "near-coplanar",
    "subnormal": "subnormals",
    "huge": "10^150",
    "lattice": "integer lattice, exact ties",
    "corners": "aimed at lattice, corners",
    "fast": "1-px targets, 10^6 px",
    "walls": "10^-6 beside 10^6",
    "one": "patterns of one pixel",
    "vast": "patterns of 10^8 pixels",
    "scene": "scenes at 10^9",
}
"""What each family is."""

TRIPLES = np.array([(1, 0, 1), (0, 1, 1), (3, 4, 5), (4, 3, 5), (5, 12, 13), (12, 5, 13), (8, 15, 17), (20, 21, 29)])
"""Whole vectors of whole length, and that length: along them shapes of whole numbers touch exactly."""

POWERS = np.array([float(f"1e{k}") for k in range(-20, 21)])

ULPS = 3


@dataclass(frozen=True)
class Shapes:
    """Rows of hulls of k points, in order from +x towards +y, each grown by a radius."""

    points: Floats
    radius: Floats

    def moved(self, by: Floats) -> Shapes:
        """Each row by a vector (n, 2)."""
        return Shapes(self.points + by[:, None], self.radius)

    def scaled(self, power: npt.NDArray[np.int64]) -> Shapes:
        """Each row by a power of two."""
        return Shapes(np.ldexp(self.points, power[:, None, None]), np.ldexp(self.radius, power))

    def farthest(self, normal: Floats) -> Floats:
        """The point of each row that is farthest along a vector: without the radius."""
        heights = (self.points * normal[:, None]).sum(axis=2)
        return np.asarray(self.points[np.arange(len(normal)), heights.argmax(axis=1)])

    def where(self, rows: Bools, other: Shapes) -> Shapes:
        """These, and in some rows the other."""
        points = np.where(rows[:, None, None], other.points, self.points)
        return Shapes(points, np.where(rows, other.radius, self.radius))


CORNERS = {"circle": 1, "capsule": 2, "box": 4, "oriented box": 4, "polygon": 5}
"""Points of each kind of shape. Of whole numbers polygons are triangles, with a corner given three times at most."""

Pair = tuple[Shapes, Shapes]


def directions(rng: Rng, n: int) -> Floats:
    """Vectors of length 1 but for rounding."""
    s = rng.uniform(0, 1, n)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    return np.asarray(np.stack([x, y], axis=1)[np.arange(n)[:, None], _turns(rng, n)] * either(rng, (n, 2)))


def decades(rng: Rng, n: int, low: int, high: int) -> Floats:
    """Numbers from 10^low to 10^high."""
    return np.asarray(rng.uniform(1, 10, n) * POWERS[rng.integers(low, high, n) + 20])


def across(v: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Quarter turns of vectors."""
    return np.stack([-v[:, 1], v[:, 0]], axis=1)


def _turns(rng: Rng, n: int) -> npt.NDArray[np.int64]:
    return np.array([(0, 1), (1, 0)])[rng.integers(0, 2, n)]


def either(rng: Rng, shape: Any) -> npt.NDArray[np.int64]:
    """Signs, 1 or -1."""
    return np.asarray(2 * rng.integers(0, 2, shape) - 1)


def nudged(rng: Rng, *arrays: Floats) -> Columns:
    """Every number moved by up to 3 ulp: its own, or in half of the rows that of the row's greatest number."""
    n = len(arrays[0])
    greatest = np.max([np.abs(a).reshape(n, -1).max(axis=1) for a in arrays], axis=0)
    coarse, most = rng.random(n) < 0.5, rng.integers(0, ULPS + 1, n)
    made = []
    for a in arrays:
        spread = (slice(None),) + (None,) * (a.ndim - 1)
        ulp = np.spacing(np.where(coarse[spread], greatest[spread], np.abs(a)))
        steps = rng.integers(-ULPS, ULPS + 1, a.shape)
        made.append(a + np.clip(steps, -most[spread], most[spread]) * ulp)
    return tuple(made)


def _nudged(rng: Rng, pair: Pair) -> Pair:
    a, b = pair
    p, r, q, s = nudged(rng, a.points, a.radius, b.points, b.radius)
    return Shapes(p, np.abs(r) * (a.radius > 0)), Shapes(q, np.abs(s) * (b.radius > 0))


# Shapes around the origin


def _shapes(rng: Rng, kind: str, along: Floats, size: Floats, thin: Floats) -> Shapes:
    """Shapes of a size along a direction, and `size * thin` across it; boxes along x."""
    n = len(along)
    length, width = size * rng.uniform(0.1, 1, n), size * thin * rng.uniform(0.1, 1, n)
    if kind == "circle":
        return Shapes(np.zeros((n, 1, 2)), length)
    if kind == "box":
        along = np.tile([1.0, 0.0], (n, 1))
    frame = np.stack([along * length[:, None], across(along) * width[:, None]], axis=1)
    if kind == "capsule":
        return Shapes(np.stack([-frame[:, 0], frame[:, 0]], axis=1), width)
    corners = np.array([(-1.0, -1), (1, -1), (1, 1), (-1, 1)])
    unit = np.broadcast_to(corners, (n, 4, 2)) if kind != "polygon" else _round(rng, n, CORNERS[kind])
    return Shapes(unit[:, :, :1] * frame[:, None, 0] + unit[:, :, 1:] * frame[:, None, 1], np.zeros(n))


def _round(rng: Rng, n: int, k: int) -> Floats:
    """Points (n, k, 2) on a circle, in order."""
    return unit_circle(np.sort(rng.uniform(0, 4, (n, k)), axis=1))


def unit_circle(quarters: Floats) -> Floats:
    """Points (..., 2) of the unit circle, by about how many quarter turns, from 0 to 4, they lie beyond +x."""
    quarter, s = np.divmod(quarters, 1.0)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    turns = np.array([(1, 0, 0, 1), (0, -1, 1, 0), (-1, 0, 0, -1), (0, 1, -1, 0)])[quarter.astype(np.int64)]
    return np.stack([turns[..., 0] * x + turns[..., 1] * y, turns[..., 2] * x + turns[..., 3] * y], axis=-1)


def _whole_shapes(rng: Rng, kind: str, normal: Floats, length: Floats) -> Shapes:
    """Small shapes of even whole numbers, in the frame of a whole vector, the radius a multiple of its length."""
    n = len(normal)
    radius = length * rng.integers(1, 5, n) * 2
    some = rng.integers(1, 5, (n, 2)) * 2
    if kind == "circle":
        return Shapes(np.zeros((n, 1, 2)), radius)
    if kind == "capsule":
        step = np.where(rng.random((n, 1)) < 0.6, across(normal), rng.integers(-5, 6, (n, 2))) * some[:, :1]
        return Shapes(np.stack([-step, step], axis=1), radius)
    if kind == "box":
        corners = np.array([(-1.0, -1), (1, -1), (1, 1), (-1, 1)])
        return Shapes(corners * some[:, None], np.zeros(n))
    if kind == "oriented box":
        u, v = normal * some[:, :1], across(normal) * some[:, 1:]
        return Shapes(np.stack([0 * u, u, u + v, v], axis=1), np.zeros(n))
    return Shapes(2.0 * _whole_rings(rng, n), np.zeros(n))


def _whole_rings(rng: Rng, n: int) -> Floats:
    """Convex pentagons of whole numbers: a corner cut off a parallelogram."""
    u, v = rng.integers(-4, 5, (2, n, 2))
    turn = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    flat = turn == 0
    u[flat], v[flat] = (3, 1), (-1, 2)
    back = (turn < 0)[:, None]
    u, v = np.where(back, v, u), np.where(back, u, v)
    return np.stack([0 * u, 2 * u, 2 * u + v, u + 2 * v, 2 * v], axis=1).astype(np.float64)


# Putting two together


def _touching(rng: Rng, a: Shapes, b: Shapes) -> Pair:
    """Shapes such that a side of the first, or its outermost point, is touched by the second."""
    n, k = a.points.shape[:2]
    rows, side = np.arange(n), rng.integers(0, k, n)
    p, q = a.points[rows, side], a.points[rows, (side + 1) % k]
    by_side = (rng.random((n, 1)) < 0.6) & np.any(p != q, axis=1)[:, None]
    normal = np.where(by_side, -across(q - p), directions(rng, n))
    size = np.sqrt((normal * normal).sum(axis=1))[:, None]
    normal = normal / np.where(size > 0, size, 1)
    share = rng.choice([0.0, 0.5, 1.0, rng.random()], (n, 1))
    on_side = (((p - a.farthest(normal)) * normal).sum(axis=1) >= 0)[:, None]
    place = np.where(on_side, p + share * (q - p), a.farthest(normal)) + normal * a.radius[:, None]
    return a, b.moved(place - (b.farthest(-normal) - normal * b.radius[:, None]))


def _contact(rng: Rng, kinds: tuple[str, str], n: int, sizes: Any = (1.0, 1.0), thin: Any = None) -> Pair:
    """Two shapes that touch, the first about the origin; in half of the rows with the second's side."""
    thins = [rng.uniform(0.1, 1, n) if thin is None else thin for _ in kinds]
    a, b = (
        _shapes(rng, kind, directions(rng, n), np.broadcast_to(size, n), t)
        for kind, size, t in zip(kinds, sizes, thins, strict=True)
    )
    back = rng.random(n) < 0.5
    first, second = _touching(rng, a, b)
    other, one = _touching(rng, b, a)
    return first.where(back, one), second.where(back, other)


def _whole_contact(rng: Rng, kinds: tuple[str, str], n: int) -> Pair:
    """Whole numbers: they touch exactly, or are a step away from that."""
    triple = TRIPLES[rng.integers(0, len(TRIPLES), n)].astype(np.float64)
    normal, length = triple[:, :2] * either(rng, (n, 2)), triple[:, 2]
    a, b = (_whole_shapes(rng, kind, normal, length) for kind in kinds)
    rows, side = np.arange(n), rng.integers(0, a.points.shape[1], n)
    ends = a.points[rows, side], a.points[rows, (side + 1) % a.points.shape[1]]
    outward: Floats = np.where((a.radius + b.radius > 0)[:, None], normal, -across(ends[1] - ends[0]))
    halfway = (rng.random(n) < 0.5) & (a.radius + b.radius == 0)
    place = np.where(halfway[:, None], (ends[0] + ends[1]) / 2, a.farthest(outward))
    b = b.moved(place - b.farthest(-outward) + np.rint(normal * ((a.radius + b.radius) / length)[:, None]))
    step = rng.integers(-1, 2, (n, 2)) * (rng.random((n, 1)) < 0.5)
    return a, b.moved(step.astype(np.float64))


# Families: each makes pairs of two kinds


def _far(rng: Rng, kinds: tuple[str, str], n: int) -> Pair:
    by = directions(rng, n) * decades(rng, n, 0, 12)[:, None]
    a, b = (s.moved(by) for s in _contact(rng, kinds, n))
    a, b = _nudged(rng, (a, b))
    some = rng.random(n) < 0.4
    one, two = (s.moved(np.rint(by)) for s in _whole_contact(rng, kinds, n))
    return a.where(some, one), b.where(some, two)


def _ratio(rng: Rng, kinds: tuple[str, str], n: int) -> Pair:
    size = decades(rng, n, 0, 6)
    up = rng.random(n) < 0.5
    return _nudged(rng, _contact(rng, kinds, n, (np.where(up, size, 1 / size), np.where(up, 1 / size, size))))


def _parallel(rng: Rng, kinds: tuple[str, str], n: int) -> Pair:
    """Sides that are parallel but for rounding or a little more, side by side or one after the other on a line."""
    along = directions(rng, n)
    if "box" in kinds:
        along = np.tile([1.0, 0.0], (n, 1))
    tilt = np.where(rng.random(n) < 0.6, decades(rng, n, -17, -6), 0.0)
    made = []
    for kind, frame in zip(kinds, (along, along + across(along) * tilt[:, None]), strict=True):
        sided = "oriented box" if kind == "polygon" else kind  # with sides along the direction
        made.append(_shapes(rng, sided, frame, np.ones(n), decades(rng, n, -3, 0)))
    a, b = made
    normal: Floats = np.where(rng.random((n, 1)) < 0.5, along, across(along)) * either(rng, (n, 1)).astype(np.float64)
    place = a.farthest(normal) + normal * (a.radius + b.radius)[:, None]
    return _nudged(rng, (a, b.moved(place - b.farthest(-normal))))


def _shared(rng: Rng, kinds: tuple[str, str], n: int) -> Pair:
    """A corner, or a whole side, of both is the same to the last bit; half of the rows are nudged after all."""
    a, b = (_shapes(rng, kind, directions(rng, n), np.ones(n), rng.uniform(0.1, 1, n)) for kind in kinds)
    rows, side = np.arange(n), rng.integers(0, a.points.shape[1], n)
    p, q = a.points[rows, side], a.points[rows, (side + 1) % a.points.shape[1]]
    corner = rng.integers(0, b.points.shape[1], n)
    points = b.points + (p - b.points[rows, corner])[:, None]
    points[rows, corner] = p
    if kinds[1] == "oriented box":
        out = -across(q - p) * rng.uniform(0.1, 1, (n, 1))
        joined = np.stack([q, p, p + out, q + out], axis=1)
    elif kinds[1] == "polygon":
        out, step = -across(q - p) * rng.uniform(0.1, 1, (n, 1)), q - p
        joined = np.stack([q, p, p + out - step * 0.3, p + 2 * out + step * 0.4, q + out + step * 0.3], axis=1)
    else:
        joined = points
    b = Shapes(np.where((rng.random(n) < 0.5)[:, None, None], joined, points), b.radius)
    one, two = _nudged(rng, (a, b))
    kept = rng.random(n) < 0.5
    return one.where(kept, a), two.where(kept, b)


def _at_scale(rng: Rng, kinds: tuple[str, str], n: int, low: int, high: int) -> Pair:
    power = rng.integers(low, high, n)
    a, b = _nudged(rng, tuple(s.scaled(power) for s in _contact(rng, kinds, n)))  # type: ignore[arg-type]
    one, two = (s.scaled(power) for s in _whole_contact(rng, kinds, n))
    some = rng.random(n) < 0.5
    return a.where(some, one), b.where(some, two)


MAKERS: dict[str, Callable[[Rng, tuple[str, str], int], Pair]] = {
    "near": lambda rng, kinds, n: _nudged(rng, _contact(rng, kinds, n)),
    "far": _far,
    "ratio": _ratio,
    "needles": lambda rng, kinds, n: _nudged(rng, _contact(rng, kinds, n, thin=decades(rng, n, -16, -2))),
    "parallel": _parallel,
    "shared": _shared,
    "subnormal": lambda rng, kinds, n: _at_scale(rng, kinds, n, -1073, -1015),
    "huge": lambda rng, kinds, n: _at_scale(rng, kinds, n, 400, 498),
    "lattice": _whole_contact,
    "walls": lambda rng, kinds, n: _nudged(rng, _contact(rng, kinds, n, (1e6, 1e-6))),
}


def shape_pairs(kinds: tuple[str, str], family: str) -> Callable[[Rng, int], Columns]:
    """Make rows of two kinds of shapes, the arguments that `truth` takes; polygons are convex, as stored, exactly."""

    def make(rng: Rng, n: int) -> Columns:
        pair = MAKERS[family](rng, kinds, n)
        kept = np.ones(n, np.bool_)
        for kind, shapes in zip(kinds, pair, strict=True):
            if kind in ("polygon", "oriented box"):
                kept &= [is_convex(ring) for ring in shapes.points.tolist()]
        return tuple(column[kept] for kind, s in zip(kinds, pair, strict=True) for column in _stored(kind, s))

    return lambda rng, n: filled(rng, n, make)


def filled(rng: Rng, n: int, make: Callable[[Rng, int], Columns]) -> Columns:
    """Rows until there are enough: some makers drop those that rounding has spoiled."""
    parts = [make(rng, n)]
    while sum(len(part[0]) for part in parts) < n:
        parts.append(make(rng, n))
    return tuple(np.concatenate(column)[:n] for column in zip(*parts, strict=True))


def _stored(kind: str, shapes: Shapes) -> Columns:
    points = shapes.points
    if kind == "circle":
        return points[:, 0], shapes.radius
    if kind == "capsule":
        return points[:, 0], points[:, 1], shapes.radius
    if kind == "box":
        return points.min(axis=1), points.max(axis=1)
    return (points,)
