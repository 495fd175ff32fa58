"""Families of random cases that are hard to decide: pairs of shapes, points on outlines, and triangles in space.

Each family makes rows as arrays. Most pairs touch at a point of both outlines, with opposite outward normals, and are
then moved as the family says, rounded, and nudged by up to three ulp, so that about half touch or overlap. Directions
are computed without sines, so a seed gives the same numbers on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import Bools, Floats

from .truth import has_area, is_convex, is_simple

Rng = np.random.Generator
Columns = tuple[npt.NDArray[Any], ...]  # arguments of a predicate, row by row
Make = Callable[[Rng, int], Columns]  # makes n rows

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

SQUARE = np.array([(-1.0, -1), (1, -1), (1, 1), (-1, 1)])
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
    swap = rng.integers(0, 2, n) == 1
    return np.stack([np.where(swap, y, x), np.where(swap, x, y)], axis=1) * either(rng, (n, 2))


def decades(rng: Rng, n: int, low: int, high: int) -> Floats:
    """Return random numbers from 10^low to 10^high."""
    return np.asarray(rng.uniform(1, 10, n) * POWERS[rng.integers(low, high, n) + 20])


def across(v: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rotate vectors by a quarter turn."""
    return np.stack([-v[:, 1], v[:, 0]], axis=1)


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
    x, y = along * length[:, None], across(along) * width[:, None]
    if kind == "capsule":
        return Shapes(np.stack([-x, x], axis=1), width)
    around = unit_circle(np.sort(rng.uniform(0, 4, (n, CORNERS[kind])), axis=1)) if kind == "polygon" else SQUARE
    return Shapes(_in_frame(around, x, y), np.zeros(n))


def _in_frame(points: Floats, x: Floats, y: Floats) -> Floats:
    """Return points (n, k, ...) whose coordinates (k, 2) or (n, k, 2) are along two vectors for each row."""
    return np.asarray(points[..., :1] * x[:, None] + points[..., 1:] * y[:, None])


def random_sides(rng: Rng, rings: npt.NDArray[Any], *many: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return both ends (n, 2) of a random side of each ring (n, k, 2), or of so many."""
    n, k = rings.shape[:2]
    rows, side = np.arange(n).reshape(n, *(1 for _ in many)), rng.integers(0, k, (n, *many))
    return rings[rows, side], rings[rows, (side + 1) % k]


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
    size = rng.integers(1, 5, (n, 2)) * 2
    if kind == "circle":
        return Shapes(np.zeros((n, 1, 2)), radius)
    if kind == "capsule":
        step = np.where(rng.random((n, 1)) < 0.6, across(normal), rng.integers(-5, 6, (n, 2))) * size[:, :1]
        return Shapes(np.stack([-step, step], axis=1), radius)
    if kind == "box":
        return Shapes(SQUARE * size[:, None], np.zeros(n))
    if kind == "oriented box":
        u, v = normal * size[:, :1], across(normal) * size[:, 1:]
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
    n = len(a.points)
    p, q = random_sides(rng, a.points)
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
    p, q = random_sides(rng, a.points)
    outward: Floats = np.where((a.radius + b.radius > 0)[:, None], normal, -across(q - p))
    halfway = (rng.random(n) < 0.5) & (a.radius + b.radius == 0)
    place = np.where(halfway[:, None], (p + q) / 2, a.farthest(outward))
    b = b.moved(place - b.farthest(-outward) + np.rint(normal * ((a.radius + b.radius) / length)[:, None]))
    step = rng.integers(-1, 2, (n, 2)) * (rng.random((n, 1)) < 0.5)
    return a, b.moved(step.astype(np.float64))


# Families: each makes pairs of two kinds


def _far(rng: Rng, kinds: tuple[str, str], n: int) -> Pair:
    by = directions(rng, n) * decades(rng, n, 0, 12)[:, None]
    a, b = _contact(rng, kinds, n)
    a, b = _nudged(rng, (a.moved(by), b.moved(by)))
    mask = rng.random(n) < 0.4
    one, two = (s.moved(np.rint(by)) for s in _whole_contact(rng, kinds, n))
    return a.where(mask, one), b.where(mask, two)


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
    p, q = random_sides(rng, a.points)
    rows, corner = np.arange(n), rng.integers(0, b.points.shape[1], n)
    points = b.points + (p - b.points[rows, corner])[:, None]
    points[rows, corner] = p
    joined = points
    if kinds[1] in ("oriented box", "polygon"):
        out, step = -across(q - p) * rng.uniform(0.1, 1, (n, 1)), q - p
        sides = [q, p, p + out, q + out]
        if kinds[1] == "polygon":
            sides = [q, p, p + out - step * 0.3, p + 2 * out + step * 0.4, q + out + step * 0.3]
        joined = np.stack(sides, axis=1)
    b = Shapes(np.where((rng.random(n) < 0.5)[:, None, None], joined, points), b.radius)
    one, two = _nudged(rng, (a, b))
    kept = rng.random(n) < 0.5
    return one.where(kept, a), two.where(kept, b)


def _at_scale(rng: Rng, kinds: tuple[str, str], n: int, low: int, high: int) -> Pair:
    power = rng.integers(low, high, n)
    a, b = _contact(rng, kinds, n)
    a, b = _nudged(rng, (a.scaled(power), b.scaled(power)))
    one, two = (s.scaled(power) for s in _whole_contact(rng, kinds, n))
    mask = rng.random(n) < 0.5
    return a.where(mask, one), b.where(mask, two)


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


STORED: dict[str, Callable[[Shapes], Columns]] = {
    "circle": lambda s: (s.points[:, 0], s.radius),
    "capsule": lambda s: (s.points[:, 0], s.points[:, 1], s.radius),
    "box": lambda s: (s.points.min(axis=1), s.points.max(axis=1)),
    "oriented box": lambda s: (s.points,),
    "polygon": lambda s: (s.points,),
}
"""Columns by which a predicate is told of each kind of shape."""


def shape_pairs(kinds: tuple[str, str], family: str) -> Make:
    """Return a maker of pairs of two kinds, as arguments of `truth`; polygons are exactly convex as stored."""
    sided = sum(kind in ("polygon", "oriented box") for kind in kinds)  # they come first

    def make(rng: Rng, n: int) -> Columns:
        pair = MAKERS[family](rng, kinds, n)
        return tuple(column for kind, shapes in zip(kinds, pair, strict=True) for column in STORED[kind](shapes))

    return _filled(make, lambda *row: all(map(is_convex, row[:sided])))


def _filled(make: Make, valid: Callable[..., bool]) -> Make:
    """Make rows until enough are valid, as rounding makes some invalid."""

    def filled(rng: Rng, n: int) -> Columns:
        parts: list[Columns] = []
        while not parts or sum(len(part[0]) for part in parts) < n:
            columns = make(rng, n)
            rows = zip(*(column.tolist() for column in columns), strict=True)
            kept = np.array([valid(*row) for row in rows], np.bool_)
            parts.append(tuple(column[kept] for column in columns))
        return tuple(np.concatenate(column)[:n] for column in zip(*parts, strict=True))

    return filled


POINTS = 16  # that are tested against each polygon
TRIANGLE_CORNERS = 7  # of a polygon


def stars(rng: Rng, n: int) -> Floats:
    """Make simple polygons (n, k, 2) of size about 1, star-shaped around the origin."""
    step = rng.uniform(0.55, 1, (n, TRIANGLE_CORNERS))
    quarters = 4 * (np.cumsum(step, axis=1) - step) / step.sum(axis=1)[:, None]
    return np.asarray(unit_circle(quarters) * rng.uniform(0.4, 1, (n, TRIANGLE_CORNERS, 1)))


def _on_sides(rng: Rng, rings: Floats) -> Floats:
    """Return points (n, m, 2) on sides: corners, midpoints, and random ones."""
    p, q = random_sides(rng, rings, POINTS)
    many = p.shape[:2]
    share = np.where(rng.random(many) < 0.4, rng.choice([0.0, 0.5], many), rng.random(many))
    return np.asarray(p + share[..., None] * (q - p))


def _whole_stars(rng: Rng, n: int) -> Columns:
    """Make polygons of even integers, and integer points in and around them, many on sides."""
    around = unit_circle(4 * (np.arange(TRIANGLE_CORNERS) + 0.3) / TRIANGLE_CORNERS)
    rings = 2 * np.rint(around * rng.integers(3, 7, (n, TRIANGLE_CORNERS, 1)))
    on_sides = _on_sides(rng, rings)
    near = np.where(rng.random((n, POINTS, 1)) < 0.5, on_sides, rng.integers(-13, 14, (n, POINTS, 2)))
    return rings, np.rint(near)


def _near(rng: Rng, n: int, far: bool = False, thin: bool = False) -> Columns:
    rings = stars(rng, n)
    if thin:
        rings = rings * np.array([1.0, 0.0]) + rings * np.array([0.0, 1.0]) * decades(rng, n, -12, -2)[:, None, None]
        slope = directions(rng, n)
        rings = _in_frame(rings, slope, across(slope))
    if far:
        rings = rings + (directions(rng, n) * decades(rng, n, 0, 12)[:, None])[:, None]
    return rings, _pushed(rng, _on_sides(rng, rings))


def _pushed(rng: Rng, points: Floats) -> Floats:
    """Move each point (n, m, 2) by up to 3 ulp."""
    return nudged(rng, points.reshape(-1, 2))[0].reshape(points.shape)


def _level(rng: Rng, n: int) -> Columns:
    """Make points (rounded) at the height of a corner, or on the line of a side beyond its ends."""
    rings = stars(rng, n)
    p, q = random_sides(rng, rings, POINTS)
    beyond = _pushed(rng, p + (q - p) * rng.uniform(-1, 2, (n, POINTS, 1)))
    level = np.stack([rng.uniform(-1, 1, (n, POINTS)), p[..., 1]], axis=2)
    return rings, np.where(rng.random((n, POINTS, 1)) < 0.5, beyond, level)


def _shared_edges(rng: Rng, n: int) -> Columns:
    """Make points that are corners, or rounded midpoints of sides."""
    rings = stars(rng, n)
    p, q = random_sides(rng, rings, POINTS)
    return rings, np.where(rng.random((n, POINTS, 1)) < 0.5, p, p / 2 + q / 2)


def _scaled(rng: Rng, n: int, low: int, high: int) -> Columns:
    """Make integer and other points, scaled by a power of two."""
    power = rng.integers(low, high, n)[:, None, None]
    return tuple(np.ldexp(column, power) for column in _whole_stars(rng, n))


def _repeated(make: Make) -> Make:
    """Keep simple polygons, and repeat each for each of its points."""
    filled = _filled(make, lambda ring, _: is_simple(ring))

    def rows(rng: Rng, n: int) -> Columns:
        rings, points = filled(rng, -(-n // POINTS))
        return np.repeat(rings, POINTS, axis=0)[:n], points.reshape(-1, 2)[:n]

    return rows


POINT_FAMILIES = {
    "near": _repeated(_near),
    "far": _repeated(partial(_near, far=True)),
    "needles": _repeated(partial(_near, thin=True)),
    "parallel": _repeated(_level),
    "shared": _repeated(_shared_edges),
    "subnormal": _repeated(partial(_scaled, low=-1073, high=-1015)),
    "huge": _repeated(partial(_scaled, low=400, high=496)),
    "lattice": _repeated(_whole_stars),
}


# Triangles in space


def _space_directions(rng: Rng, n: int) -> Floats:
    """Return random vectors in space, of length about 1."""
    v = rng.uniform(-1, 1, (n, 3))
    return np.asarray(v / np.sqrt((v * v).sum(axis=1))[:, None])


def _touching3(rng: Rng, n: int, size: Any = 1.0, thin: Any = 1.0) -> Columns:
    """Make triangles that touch with a corner on a face, or with two crossing edges, on different sides of a plane."""
    thin, size = (np.broadcast_to(v, n)[:, None] for v in (thin, size))
    x, y = _space_directions(rng, n), _space_directions(rng, n)
    up = np.cross(x, y)
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


def _near3(rng: Rng, n: int, by: Any = 0.0) -> Columns:
    return nudged(rng, *(t + by for t in _touching3(rng, n)))


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
    pair = tuple(_in_frame(flat, frame[:, 0], frame[:, 1]) for flat in (flat_a, flat_b))
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
    mask = (rng.random(n) < 0.5)[:, None, None]
    pairs = zip(_near3(rng, n), _lattice3(rng, n), strict=True)
    return tuple(np.ldexp(np.where(mask, whole, a), power) for a, whole in pairs)


_TRIANGLES: dict[str, Make] = {
    "near": _near3,
    "far": lambda rng, n: _near3(rng, n, (_space_directions(rng, n) * decades(rng, n, 0, 12)[:, None])[:, None]),
    "ratio": lambda rng, n: nudged(rng, *_touching3(rng, n, size=decades(rng, n, -12, 0))),
    "needles": lambda rng, n: nudged(rng, *_touching3(rng, n, thin=decades(rng, n, -16, -2))),
    "shared": _shared3,
    "coplanar": _coplanar3,
    "subnormal": partial(_scaled3, low=-1073, high=-1015),
    "huge": partial(_scaled3, low=250, high=498),
    "lattice": _lattice3,
}
TRIANGLE_FAMILIES = {name: _filled(make, lambda a, b: has_area(a) and has_area(b)) for name, make in _TRIANGLES.items()}
