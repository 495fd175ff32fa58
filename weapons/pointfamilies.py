"""Points that nearly lie on outlines of polygons, and triangles in space that nearly touch, from a seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planes.arrays import Floats
from weapons.families import (
    Columns,
    Rng,
    across,
    decades,
    directions,
    filled,
    nudged,
    unit_circle,
)
from weapons.truth import has_area, is_simple

__all__ = ["POINT_FAMILIES", "TRIANGLE_FAMILIES", "stars"]

POINTS = 16
"""Points that are asked of each polygon."""

CORNERS = 7
"""Of a polygon."""


def stars(rng: Rng, n: int, low: float = 0.4) -> Floats:
    """Simple polygons (n, k, 2) about the origin, of a size about 1, that every ray from there crosses once."""
    step = rng.uniform(0.55, 1, (n, CORNERS))
    quarters = 4 * (np.cumsum(step, axis=1) - step) / step.sum(axis=1)[:, None]
    return np.asarray(unit_circle(quarters) * rng.uniform(low, 1, (n, CORNERS, 1)))


def _on_sides(rng: Rng, rings: Floats) -> Floats:
    """Points (n, m, 2) of sides: corners, middles, or anywhere between."""
    n = len(rings)
    rows, side = np.arange(n)[:, None], rng.integers(0, CORNERS, (n, POINTS))
    p, q = rings[rows, side], rings[rows, (side + 1) % CORNERS]
    share = np.where(rng.random((n, POINTS)) < 0.4, rng.choice([0.0, 0.5], (n, POINTS)), rng.random((n, POINTS)))
    return np.asarray(p + share[..., None] * (q - p))


def _whole_stars(rng: Rng, n: int) -> tuple[Floats, Floats]:
    """Polygons of even whole numbers, and whole points in and around them, many of them on sides."""
    rings = 2 * np.rint(unit_circle(4 * (np.arange(CORNERS) + 0.3) / CORNERS) * rng.integers(3, 7, (n, CORNERS, 1)))
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
    """Points by up to 3 ulp off where they are."""
    n = len(points)
    flat = points.reshape(-1, 2)
    (moved,) = nudged(rng, flat)
    return np.asarray(moved.reshape(n, POINTS, 2))


def _level(rng: Rng, n: int) -> Columns:
    """Points at the height of a corner, or on the line of a side beyond its ends, but for rounding."""
    rings = stars(rng, n)
    rows, side = np.arange(n)[:, None], rng.integers(0, CORNERS, (n, POINTS))
    p, q = rings[rows, side], rings[rows, (side + 1) % CORNERS]
    beyond = _pushed(rng, p + (q - p) * rng.uniform(-1, 2, (n, POINTS, 1)), rings)
    level = np.stack([rng.uniform(-1, 1, (n, POINTS)), p[..., 1]], axis=2)
    return rings, np.where(rng.random((n, POINTS, 1)) < 0.5, beyond, level)


def _shared(rng: Rng, n: int) -> Columns:
    """Corners themselves, and middles of sides as rounding has them."""
    rings = stars(rng, n)
    rows, side = np.arange(n)[:, None], rng.integers(0, CORNERS, (n, POINTS))
    p, q = rings[rows, side], rings[rows, (side + 1) % CORNERS]
    return rings, np.where(rng.random((n, POINTS, 1)) < 0.5, p, p / 2 + q / 2)


def _scaled(rng: Rng, n: int, low: int, high: int) -> Columns:
    """Whole numbers, and any, times a power of two."""
    power = rng.integers(low, high, n)[:, None, None]
    return tuple(np.ldexp(column, power) for column in _whole_stars(rng, n))


def _repeated(make: Callable[[Rng, int], Columns]) -> Callable[[Rng, int], Columns]:
    """A row for each point, with its polygon."""

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
    "shared": _repeated(_shared),
    "subnormal": _repeated(lambda rng, n: _scaled(rng, n, -1073, -1015)),
    "huge": _repeated(lambda rng, n: _scaled(rng, n, 400, 496)),
    "lattice": _repeated(_whole_stars),
}


# Triangles in space


def _space_directions(rng: Rng, n: int) -> Floats:
    """Vectors in space, about 1 long."""
    v = rng.uniform(-1, 1, (n, 3))
    return np.asarray(v / np.sqrt((v * v).sum(axis=1))[:, None])


def _cross3(a: Floats, b: Floats) -> Floats:
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _touching(rng: Rng, n: int, size: Floats, thin: Floats) -> Columns:
    """A corner on a face, the rest of it on one side; or two edges that cross, one triangle above and one below."""
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
    return nudged(rng, *_touching(rng, n, np.ones(n), np.ones(n)))


def _far3(rng: Rng, n: int) -> Columns:
    by = (_space_directions(rng, n) * decades(rng, n, 0, 12)[:, None])[:, None]
    return nudged(rng, *(t + by for t in _touching(rng, n, np.ones(n), np.ones(n))))


def _lattice3(rng: Rng, n: int) -> Columns:
    reach = rng.integers(1, 5, (n, 1, 1))
    return tuple(rng.integers(-reach, reach + 1, (n, 3, 3)).astype(np.float64) for _ in range(2))


def _coplanar3(rng: Rng, n: int) -> Columns:
    """Triangles of the plane that touch in a corner or along a side, put into a plane in space; or of whole numbers."""
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
    """One, two or three corners are the same to the last bit; or were, before a nudge."""
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
    return nudged(rng, *_touching(rng, n, np.ones(n), decades(rng, n, -16, -2)))


def _ratio3(rng: Rng, n: int) -> Columns:
    return nudged(rng, *_touching(rng, n, decades(rng, n, -12, 0), np.ones(n)))


def _with_areas(make: Callable[[Rng, int], Columns]) -> Callable[[Rng, int], Columns]:
    """Rows of which both triangles have an area."""

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
