"""Families of random cases that are hard to decide: pairs of shapes, points on outlines, and triangles in space.

Each family makes rows as arrays. Most pairs touch at a point of both outlines, with opposite outward normals, and are
then moved as the family says, rounded, and nudged by up to three ulp, so that about half touch or overlap. Directions
are computed without sines, so a seed gives the same numbers on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import Bools, Floats

from .truth import has_area, is_convex, is_simple

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
"""Title of each family."""

TRIPLES = np.array([(1, 0, 1), (0, 1, 1), (3, 4, 5), (4, 3, 5), (5, 12, 13), (12, 5, 13), (8, 15, 17), (20, 21, 29)])
"""Integer vectors of integer length, and the length; integer shapes along them touch exactly."""

POWERS = np.array([float(f"1e{k}") for k in range(-20, 21)])

ULPS = 3


@dataclass(frozen=True)
class Shapes:
    """Convex hulls of k points a row, in order from +x towards +y, each grown by a radius."""

    points: Floats
    radius: Floats

    def moved(self, by: Floats) -> Shapes:
        """Move each row by a vector (n, 2)."""
        return Shapes(self.points + by[:, None], self.radius)

    def scaled(self, power: npt.NDArray[np.int64]) -> Shapes:
        """Scale each row by a power of two."""
        return Shapes(np.ldexp(self.points, power[:, None, None]), np.ldexp(self.radius, power))

    def farthest(self, normal: Floats) -> Floats:
        """Return the point of each row that is farthest along a vector, without the radius."""
        heights = (self.points * normal[:, None]).sum(axis=2)
        return np.asarray(self.points[np.arange(len(normal)), heights.argmax(axis=1)])

    def where(self, rows: Bools, other: Shapes) -> Shapes:
        """Replace the given rows by those of the other."""
        points = np.where(rows[:, None, None], other.points, self.points)
        return Shapes(points, np.where(rows, other.radius, self.radius))


CORNERS = {"circle": 1, "capsule": 2, "box": 4, "oriented box": 4, "polygon": 5}
"""Points of each kind of shape. Integer polygons may be triangles, with a corner up to three times."""

Pair = tuple[Shapes, Shapes]


def directions(rng: Rng, n: int) -> Floats:
    """Return random vectors of length 1 (rounded)."""
    s = rng.uniform(0, 1, n)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    return np.asarray(np.stack([x, y], axis=1)[np.arange(n)[:, None], _turns(rng, n)] * either(rng, (n, 2)))


def decades(rng: Rng, n: int, low: int, high: int) -> Floats:
    """Return random numbers from 10^low to 10^high."""
    return np.asarray(rng.uniform(1, 10, n) * POWERS[rng.integers(low, high, n) + 20])


def across(v: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rotate vectors by a quarter turn."""
    return np.stack([-v[:, 1], v[:, 0]], axis=1)


def _turns(rng: Rng, n: int) -> npt.NDArray[np.int64]:
    return np.array([(0, 1), (1, 0)])[rng.integers(0, 2, n)]


def either(rng: Rng, shape: Any) -> npt.NDArray[np.int64]:
    """Return random signs."""
    return np.asarray(2 * rng.integers(0, 2, shape) - 1)


def nudged(rng: Rng, *arrays: Floats) -> Columns:
    """Move every number by up to 3 ulp, in half of the rows by ulps of the row's largest number."""
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
    """Make shapes of a size along a direction and `size * thin` across it; boxes lie along x."""
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
    """Return random points (n, k, 2) on the unit circle, in order."""
    return unit_circle(np.sort(rng.uniform(0, 4, (n, k)), axis=1))


def unit_circle(quarters: Floats) -> Floats:
    """Return points (..., 2) of the unit circle at about this many quarter turns (0 to 4) from +x."""
    quarter, s = np.divmod(quarters, 1.0)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    turns = np.array([(1, 0, 0, 1), (0, -1, 1, 0), (-1, 0, 0, -1), (0, 1, -1, 0)])[quarter.astype(np.int64)]
    return np.stack([turns[..., 0] * x + turns[..., 1] * y, turns[..., 2] * x + turns[..., 3] * y], axis=-1)


def _whole_shapes(rng: Rng, kind: str, normal: Floats, length: Floats) -> Shapes:
    """Make small shapes of even integers in the frame of an integer vector; radii are multiples of its length."""
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
    """Make convex integer pentagons, parallelograms with a corner cut off."""
    u, v = rng.integers(-4, 5, (2, n, 2))
    turn = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    flat = turn == 0
    u[flat], v[flat] = (3, 1), (-1, 2)
    back = (turn < 0)[:, None]
    u, v = np.where(back, v, u), np.where(back, u, v)
    return np.stack([0 * u, 2 * u, 2 * u + v, u + 2 * v, 2 * v], axis=1).astype(np.float64)


# Putting two together


def _touching(rng: Rng, a: Shapes, b: Shapes) -> Pair:
    """Move the second shape so that it touches a side or the outermost point of the first."""
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
    """Make two shapes that touch, the first around the origin; in half of the rows the side is the second's."""
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
    """Make integer shapes that touch exactly or are one step away from it."""
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
    """Make shapes with almost parallel sides, next to each other or one after the other on a line."""
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
    """Make shapes that share a corner or a side to the last bit; half of the rows are then nudged."""
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
    """Return a maker of pairs of two kinds, as arguments of `truth`; polygons are exactly convex as stored."""

    def make(rng: Rng, n: int) -> Columns:
        pair = MAKERS[family](rng, kinds, n)
        kept = np.ones(n, np.bool_)
        for kind, shapes in zip(kinds, pair, strict=True):
            if kind in ("polygon", "oriented box"):
                kept &= [is_convex(ring) for ring in shapes.points.tolist()]
        return tuple(column[kept] for kind, s in zip(kinds, pair, strict=True) for column in _stored(kind, s))

    return lambda rng, n: filled(rng, n, make)


def filled(rng: Rng, n: int, make: Callable[[Rng, int], Columns]) -> Columns:
    """Make rows until there are enough, as makers drop rows that rounding made invalid."""
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


POINTS = 16
"""Points that are tested against each polygon."""

TRIANGLE_CORNERS = 7
"""Corners of a polygon."""


def stars(rng: Rng, n: int, low: float = 0.4) -> Floats:
    """Make simple polygons (n, k, 2) of size about 1, star-shaped around the origin."""
    step = rng.uniform(0.55, 1, (n, TRIANGLE_CORNERS))
    quarters = 4 * (np.cumsum(step, axis=1) - step) / step.sum(axis=1)[:, None]
    return np.asarray(unit_circle(quarters) * rng.uniform(low, 1, (n, TRIANGLE_CORNERS, 1)))


def _on_sides(rng: Rng, rings: Floats) -> Floats:
    """Return points (n, m, 2) on sides: corners, midpoints, and random ones."""
    n = len(rings)
    rows, side = np.arange(n)[:, None], rng.integers(0, TRIANGLE_CORNERS, (n, POINTS))
    p, q = rings[rows, side], rings[rows, (side + 1) % TRIANGLE_CORNERS]
    share = np.where(rng.random((n, POINTS)) < 0.4, rng.choice([0.0, 0.5], (n, POINTS)), rng.random((n, POINTS)))
    return np.asarray(p + share[..., None] * (q - p))


def _whole_stars(rng: Rng, n: int) -> tuple[Floats, Floats]:
    """Make polygons of even integers, and integer points in and around them, many on sides."""
    rings = 2 * np.rint(
        unit_circle(4 * (np.arange(TRIANGLE_CORNERS) + 0.3) / TRIANGLE_CORNERS)
        * rng.integers(3, 7, (n, TRIANGLE_CORNERS, 1))
    )
    on_sides = _on_sides(rng, rings)
    near = np.where(rng.random((n, POINTS, 1)) < 0.5, on_sides, rng.integers(-13, 14, (n, POINTS, 2)))
    return rings, np.rint(near)


def _near(rng: Rng, n: int, by: float = 0.0, thin: bool = False) -> Columns:
    rings = stars(rng, n)
    if thin:
        rings = rings * np.array([1.0, 0.0]) + rings * np.array([0.0, 1.0]) * decades(rng, n, -12, -2)[:, None, None]
        slope = directions(rng, n)[:, None]
        rings = rings[..., :1] * slope + rings[..., 1:] * across(slope[:, 0])[:, None]
    if by:
        rings = rings + (directions(rng, n) * decades(rng, n, 0, 12)[:, None])[:, None]
    points = _on_sides(rng, rings)
    return rings, _pushed(rng, points, rings)


def _pushed(rng: Rng, points: Floats, rings: Floats) -> Floats:
    """Move points by up to 3 ulp."""
    n = len(points)
    flat = points.reshape(-1, 2)
    (moved,) = nudged(rng, flat)
    return np.asarray(moved.reshape(n, POINTS, 2))


def _level(rng: Rng, n: int) -> Columns:
    """Make points (rounded) at the height of a corner, or on the line of a side beyond its ends."""
    rings = stars(rng, n)
    rows, side = np.arange(n)[:, None], rng.integers(0, TRIANGLE_CORNERS, (n, POINTS))
    p, q = rings[rows, side], rings[rows, (side + 1) % TRIANGLE_CORNERS]
    beyond = _pushed(rng, p + (q - p) * rng.uniform(-1, 2, (n, POINTS, 1)), rings)
    level = np.stack([rng.uniform(-1, 1, (n, POINTS)), p[..., 1]], axis=2)
    return rings, np.where(rng.random((n, POINTS, 1)) < 0.5, beyond, level)


def _shared_edges(rng: Rng, n: int) -> Columns:
    """Make points that are corners, or rounded midpoints of sides."""
    rings = stars(rng, n)
    rows, side = np.arange(n)[:, None], rng.integers(0, TRIANGLE_CORNERS, (n, POINTS))
    p, q = rings[rows, side], rings[rows, (side + 1) % TRIANGLE_CORNERS]
    return rings, np.where(rng.random((n, POINTS, 1)) < 0.5, p, p / 2 + q / 2)


def _scaled(rng: Rng, n: int, low: int, high: int) -> Columns:
    """Make integer and other points, scaled by a power of two."""
    power = rng.integers(low, high, n)[:, None, None]
    return tuple(np.ldexp(column, power) for column in _whole_stars(rng, n))


def _repeated(make: Callable[[Rng, int], Columns]) -> Callable[[Rng, int], Columns]:
    """Repeat the polygon for each of its points."""

    def rows(rng: Rng, n: int) -> Columns:
        rings, points = make(rng, -(-n // POINTS))
        kept = np.array([is_simple(ring) for ring in rings.tolist()], np.bool_)
        return np.repeat(rings[kept], POINTS, axis=0), points[kept].reshape(-1, 2)

    return lambda rng, n: filled(rng, n, rows)


POINT_FAMILIES: dict[str, Callable[[Rng, int], Columns]] = {
    "near": _repeated(_near),
    "far": _repeated(lambda rng, n: _near(rng, n, by=1.0)),
    "needles": _repeated(lambda rng, n: _near(rng, n, thin=True)),
    "parallel": _repeated(_level),
    "shared": _repeated(_shared_edges),
    "subnormal": _repeated(lambda rng, n: _scaled(rng, n, -1073, -1015)),
    "huge": _repeated(lambda rng, n: _scaled(rng, n, 400, 496)),
    "lattice": _repeated(_whole_stars),
}


# Triangles in space


def _space_directions(rng: Rng, n: int) -> Floats:
    """Return random vectors in space, of length about 1."""
    v = rng.uniform(-1, 1, (n, 3))
    return np.asarray(v / np.sqrt((v * v).sum(axis=1))[:, None])


def _cross3(a: Floats, b: Floats) -> Floats:
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _touching_triangles(rng: Rng, n: int, size: Floats, thin: Floats) -> Columns:
    """Make triangles that touch with a corner on a face, or with two crossing edges, on different sides of a plane."""
    x, y = _space_directions(rng, n), _space_directions(rng, n)
    up, thin, size = _cross3(x, y), thin[:, None], size[:, None]
    face = np.stack([-0.4 * x, 0.6 * x, y * thin + x * rng.uniform(-0.4, 0.6, (n, 1))], axis=1)
    share = rng.dirichlet(np.ones(3), n)
    place = (face * share[:, :, None]).sum(axis=1)
    far = _space_directions(rng, n)
    far = far * np.where((far * up).sum(axis=1) < 0, -1, 1)[:, None]
    other = far + _space_directions(rng, n) * thin * 0.5
    corner = np.stack([place, place + far * size, place + other * size], axis=1)
    below = np.stack([-x * rng.uniform(0.1, 1, (n, 1)), x, -up * thin + x * rng.uniform(-1, 1, (n, 1))], axis=1)
    above = np.stack([-y * rng.uniform(0.1, 1, (n, 1)), y, up * thin + y * rng.uniform(-1, 1, (n, 1))], axis=1)
    edges = (rng.random(n) < 0.5)[:, None, None]
    a, b = np.where(edges, below, face), np.where(edges, above * size[:, None], corner)
    back = (rng.random(n) < 0.5)[:, None, None]
    return np.where(back, b, a), np.where(back, a, b)


def _near3(rng: Rng, n: int) -> Columns:
    return nudged(rng, *_touching_triangles(rng, n, np.ones(n), np.ones(n)))


def _far3(rng: Rng, n: int) -> Columns:
    by = (_space_directions(rng, n) * decades(rng, n, 0, 12)[:, None])[:, None]
    return nudged(rng, *(t + by for t in _touching_triangles(rng, n, np.ones(n), np.ones(n))))


def _lattice3(rng: Rng, n: int) -> Columns:
    reach = rng.integers(1, 5, (n, 1, 1))
    return tuple(rng.integers(-reach, reach + 1, (n, 3, 3)).astype(np.float64) for _ in range(2))


def _coplanar3(rng: Rng, n: int) -> Columns:
    """Make triangles that touch in a corner or along a side within a plane in space, or integer triangles."""
    frame = np.stack([_space_directions(rng, n), _space_directions(rng, n)], axis=1)
    flat_a = np.stack([rng.uniform(-1, 1, (n, 2)) for _ in range(3)], axis=1)
    place = flat_a[:, 0] + rng.choice([0.0, 0.5, 1.0], (n, 1)) * (flat_a[:, 1] - flat_a[:, 0])
    flat_b = 2 * place[:, None] - flat_a * 1.0
    whole = (rng.random(n) < 0.4)[:, None, None]
    frame = np.where(whole, rng.integers(-3, 4, (n, 2, 3)), frame)
    flat_a = np.where(whole, rng.integers(-4, 5, (n, 3, 2)), flat_a)
    flat_b = np.where(whole, rng.integers(-4, 5, (n, 3, 2)), flat_b)
    pair = tuple(f[:, :, :1] * frame[:, None, 0] + f[:, :, 1:] * frame[:, None, 1] for f in (flat_a, flat_b))
    return tuple(np.where(whole, exact, moved) for exact, moved in zip(pair, nudged(rng, *pair), strict=True))


def _shared3(rng: Rng, n: int) -> Columns:
    """Make triangles that share one, two or three corners to the last bit; some are then nudged."""
    a, b = rng.uniform(-1, 1, (2, n, 3, 3))
    count = rng.integers(1, 4, n)
    order = rng.permuted(np.tile(np.arange(3), (n, 1)), axis=1)
    for k in range(3):
        rows = np.flatnonzero(count > k)
        b[rows, order[rows, k]] = a[rows, k]
    kept = (rng.random(n) < 0.3)[:, None, None]
    return tuple(np.where(kept, exact, moved) for exact, moved in zip((a, b), nudged(rng, a, b), strict=True))


def _scaled3(rng: Rng, n: int, low: int, high: int) -> Columns:
    power = rng.integers(low, high, n)[:, None, None]
    some = (rng.random(n) < 0.5)[:, None, None]
    pairs = zip(_near3(rng, n), _lattice3(rng, n), strict=True)
    return tuple(np.ldexp(np.where(some, whole, a), power) for a, whole in pairs)


def _thin3(rng: Rng, n: int) -> Columns:
    return nudged(rng, *_touching_triangles(rng, n, np.ones(n), decades(rng, n, -16, -2)))


def _ratio3(rng: Rng, n: int) -> Columns:
    return nudged(rng, *_touching_triangles(rng, n, decades(rng, n, -12, 0), np.ones(n)))


def _with_areas(make: Callable[[Rng, int], Columns]) -> Callable[[Rng, int], Columns]:
    """Keep the rows in which both triangles have an area."""

    def rows(rng: Rng, n: int) -> Columns:
        a, b = make(rng, n)
        kept = np.array([has_area(p) and has_area(q) for p, q in zip(a.tolist(), b.tolist(), strict=True)], np.bool_)
        return a[kept], b[kept]

    return lambda rng, n: filled(rng, n, rows)


TRIANGLE_FAMILIES: dict[str, Callable[[Rng, int], Columns]] = {
    "near": _with_areas(_near3),
    "far": _with_areas(_far3),
    "ratio": _with_areas(_ratio3),
    "needles": _with_areas(_thin3),
    "shared": _with_areas(_shared3),
    "coplanar": _with_areas(_coplanar3),
    "subnormal": _with_areas(lambda rng, n: _scaled3(rng, n, -1073, -1015)),
    "huge": _with_areas(lambda rng, n: _scaled3(rng, n, 250, 498)),
    "lattice": _with_areas(_lattice3),
}
