"""Closed forms by the million: pairs of circles, boxes and capsules that nearly touch, as arrays, with exact truth.

`adversarial` and `oracle_volumes` do the same for every kind, one pair at a time, at some 200 us each. Here one costs a
few: families are drawn for all rows at once, and the truth is the same algebra on arrays of whole numbers of Python.
A kind is (n, points, d) floats and (n,) radii: of a circle its centre, of a box min and max, of a capsule both ends.
"""

from typing import Any

import numpy as np

__all__ = ["Rows", "find_contacts", "pairs"]

Array = np.ndarray[Any, np.dtype[Any]]
Rng = np.random.Generator
Rows = tuple[Array, Array]

ULPS = 3
WHOLE_NORMALS = {
    2: np.array([(1, 0, 1), (0, 1, 1), (3, 4, 5), (4, 3, 5), (5, 12, 13), (8, 15, 17), (20, 21, 29)]),
    3: np.array([(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (1, 2, 2, 3), (2, 3, 6, 7), (4, 4, 7, 9), (1, 4, 8, 9)]),
}
"""Whole vectors of whole length, and that length: shapes of whole numbers touch along them exactly."""


# Families


def across(v: Array) -> Array:
    return np.stack([-v[:, 1], v[:, 0]], axis=1)


def normals(rng: Rng, n: int, dim: int, whole: Array) -> tuple[Array, Array]:
    """Directions of contact, and their lengths: whole vectors of whole length, axes, or any of length 1."""
    rows = WHOLE_NORMALS[dim][rng.integers(0, 7, n)]
    any_way = rng.normal(size=(n, dim))
    any_way /= np.sqrt((any_way * any_way).sum(axis=1))[:, None]
    axis = np.eye(dim)[rng.integers(0, dim, n)] * rng.choice([-1, 1], (n, 1))
    any_way = np.where(rng.random((n, 1)) < 0.3, axis, any_way)
    normal = np.where(whole[:, None], rows[:, :dim] * rng.choice([-1, 1], (n, dim)), any_way)
    return normal, np.where(whole, rows[:, dim], 1.0)


def shape(rng: Rng, kind: str, normal: Array, length: Array, whole: Array, size: Array) -> Rows:
    """One shape a row, of whole numbers or of a size; a fifth has no radius, no length, or no width."""
    n, dim = normal.shape
    flat = rng.random(n) < 0.2
    radius = np.where(whole, length * rng.integers(1, 5, n), size * rng.uniform(0.01, 1, n)) * ~flat
    if kind == "circle":
        return np.zeros((n, 1, dim)), radius
    if kind == "aabb":
        half = np.where(whole[:, None], rng.integers(0, 5, (n, dim)), size[:, None] * rng.uniform(0, 1, (n, dim)))
        half *= ~(flat[:, None] & (rng.random((n, dim)) < 0.5))
        return np.stack([-half, half], axis=1), np.zeros(n)
    other = np.where(whole[:, None], rng.integers(-5, 6, (n, 2)), rng.normal(size=(n, 2)))
    along = np.where(rng.random((n, 1)) < 0.6, across(normal), other)
    thin = np.where(rng.random(n) < 0.3, 10 ** rng.uniform(-12, 0, n), 1.0)
    step = along * np.where(whole, rng.integers(0, 4, n), size * rng.uniform(0, 1, n) * ~(rng.random(n) < 0.1))[:, None]
    return np.stack([-step, step], axis=1), np.where(whole, radius, radius * thin)


def outermost(rng: Rng, kind: str, points: Array, radius: Array, normal: Array, length: Array) -> Array:
    """A point of the outline with that outward normal: on a side, any of it (an end, or the middle)."""
    share = rng.choice([0.0, 0.5, 1.0], (len(points), 1))
    if kind == "aabb":
        low, high = points[:, 0], points[:, 1]
        place = np.where(normal > 0, high, np.where(normal < 0, low, low + share * (high - low)))
    elif kind == "capsule":
        first, last = points[:, 0], points[:, 1]
        reach = ((last - first) * normal).sum(axis=1)[:, None]
        side = np.abs(reach) <= 1e-9 * np.abs(last - first).max(axis=1)[:, None] * length[:, None]
        place = np.where(side, first + share * (last - first), np.where(reach > 0, last, first))
    else:
        place = points[:, 0]
    return place + normal * (radius / length)[:, None]


def ulps(rng: Rng, values: Array, greatest: Array, steps: Array) -> Array:
    """Up to three ulp either way, of each number or, in half of the rows, of the row's greatest."""
    spread = (slice(None),) + (None,) * (values.ndim - 1)
    coarse = (rng.random(len(values)) < 0.5)[spread]
    ulp = np.spacing(np.where(coarse, greatest[spread], np.abs(values)))
    return values + np.rint(rng.uniform(-1, 1, values.shape) * steps[spread]) * ulp


def pairs(rng: Rng, kind_a: str, kind_b: str, n: int, dim: int = 2) -> tuple[Rows, Rows]:
    """Rows that touch in one point but for rounding.

    A third are whole numbers, where ties are exact, half of them moved by a step. Sizes to 10^12 apart, offsets to
    10^12, all of it scaled by a power of two: mostly 1, else into the subnormals or to 10^150 or 10^300.
    """
    whole = rng.random(n) < 0.33
    normal, length = normals(rng, n, dim, whole)
    apart = np.where(rng.random(n) < 0.4, rng.uniform(-6, 6, n), 0.0)
    a, ra = shape(rng, kind_a, normal, length, whole, 10**apart)
    b, rb = shape(rng, kind_b, normal, length, whole, 10**-apart)
    a = a - outermost(rng, kind_a, a, ra, normal, length)[:, None]
    b = b - outermost(rng, kind_b, b, rb, -normal, length)[:, None]
    step = rng.integers(-1, 2, (n, 1, dim)) * (whole & (rng.random(n) < 0.5))[:, None, None]
    by = rng.normal(size=(n, 1, dim)) * np.where(rng.random(n) < 0.4, 10 ** rng.uniform(0, 12, n), 0.0)[:, None, None]
    by = np.where(whole[:, None, None], np.rint(by), by)
    power = np.where(rng.random(n) < 0.7, 0, rng.choice([-1073, -1040, -1020, -530, 450, 900], n))
    steps = np.where(whole & (rng.random(n) < 0.7), 0, rng.integers(0, ULPS + 1, n))
    greatest = np.ldexp(np.maximum(np.abs(a + by).max(axis=(1, 2)), np.abs(b + by + step).max(axis=(1, 2))), power)

    def placed(kind: str, points: Array, radius: Array) -> Rows:
        points = ulps(rng, np.ldexp(points + by, power[:, None, None]), greatest, steps)
        radius = np.abs(ulps(rng, np.ldexp(radius, power), greatest, steps * (radius > 0)))
        return np.sort(points, axis=1) if kind == "aabb" else points, radius

    return placed(kind_a, a, ra), placed(kind_b, b + step, rb)


# Truth


def whole_numbers(*arrays: Array) -> list[Array]:
    """Floats (n, ...) as whole numbers, each row in the least unit that holds all of its numbers."""
    ratios = [np.array([v.as_integer_ratio() for v in a.ravel().tolist()], object).reshape(*a.shape, 2) for a in arrays]
    unit = ratios[0][..., 1].reshape(len(arrays[0]), -1).max(axis=1)
    for r in ratios[1:]:
        unit = np.maximum(unit, r[..., 1].reshape(len(unit), -1).max(axis=1))
    return [r[..., 0] * (unit[(slice(None),) + (None,) * (r.ndim - 2)] // r[..., 1]) for r in ratios]


def dot(p: Array, q: Array) -> Array:
    return (p * q).sum(axis=1)


def turn(a: Array, b: Array, c: Array) -> Array:
    p, q = b - a, c - a
    return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]


def near_segment(p: Array, a: Array, b: Array, r: Array) -> Array:
    """Whether a point lies within r of a segment."""
    along, reach = b - a, p - a
    at, length2, far2 = dot(reach, along), dot(along, along), dot(reach, reach)
    before, beyond = far2 <= r * r, dot(p - b, p - b) <= r * r
    beside = far2 * length2 - at * at <= r * r * length2
    return np.where(at <= 0, before, np.where(at >= length2, beyond, beside)).astype(bool)


def crossed(a: Array, b: Array, c: Array, d: Array) -> Array:
    sides, others = turn(a, b, c) * turn(a, b, d), turn(c, d, a) * turn(c, d, b)
    return ((sides < 0) & (others < 0)).astype(bool)


def find_contacts(kind_a: str, a: Rows, kind_b: str, b: Rows) -> Array:
    """Whether rows share a point: circles, boxes and capsules, but no box with a capsule."""
    (p, ra), (q, rb) = a, b
    p, ra, q, rb = whole_numbers(p, ra, q, rb)
    r = ra + rb
    if kind_a != "capsule" and kind_b != "capsule":
        gap = np.maximum(np.maximum(p[:, 0] - q[:, -1], q[:, 0] - p[:, -1]), 0)
        return (dot(gap, gap) <= r * r).astype(bool)
    if "circle" in (kind_a, kind_b):
        (centre, ends) = (p, q) if kind_a == "circle" else (q, p)
        return near_segment(centre[:, 0], ends[:, 0], ends[:, 1], r)
    s, t, u, v = p[:, 0], p[:, 1], q[:, 0], q[:, 1]
    ends = near_segment(s, u, v, r) | near_segment(t, u, v, r) | near_segment(u, s, t, r) | near_segment(v, s, t, r)
    return ends | crossed(s, t, u, v)
