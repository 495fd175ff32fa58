"""Textbook formulas in plain float64, to compare with hitplanes.

Each function takes the columns of the exact predicate, and returns which rows meet; touching counts if the formula can
decide it. No epsilon is added, as it would only move the errors.

References
----------
Ericson, *Real-Time Collision Detection* (2005); Franklin, *PNPOLY*; Moller, *A Fast Triangle-Triangle Intersection
Test* (1997); Amanatides and Woo, *A Fast Voxel Traversal Algorithm* (1987); Kay and Kajiya, *Ray Tracing Complex
Scenes* (1986).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import Bools, Floats

Array = npt.NDArray[Any]


def circles(center_a: Floats, radius_a: Floats, center_b: Floats, radius_b: Floats) -> Bools:
    """Compare the squared distance with the squared sum of the radii."""
    d, r = center_a - center_b, radius_a + radius_b
    return np.asarray((d * d).sum(axis=1) <= r * r)


def boxes(low_a: Floats, high_a: Floats, low_b: Floats, high_b: Floats) -> Bools:
    """Compare the ends of intervals (Ericson 4.2.1), without rounding."""
    return np.asarray(((low_a <= high_b) & (low_b <= high_a)).all(axis=1))


def _distance2(p: Floats, a: Floats, b: Floats) -> Floats:
    """Return the squared distance to a segment, by the clamped projection on it."""
    along, reach = b - a, p - a
    length2 = (along * along).sum(axis=-1)
    share = (reach * along).sum(axis=-1) / np.where(length2 > 0, length2, 1)
    off = p - (a + np.clip(share, 0, 1)[..., None] * along)
    return np.asarray((off * off).sum(axis=-1))


def capsule_circle(a: Floats, b: Floats, radius: Floats, center: Floats, radius_c: Floats) -> Bools:
    """Compare the distance of the centre from the segment."""
    r = radius + radius_c
    return np.asarray(_distance2(center, a, b) <= r * r)


def point_polygon(rings: Floats, points: Floats) -> Bools:
    """Count crossings of a ray to +x (PNPOLY)."""
    inside = np.zeros(len(points), np.bool_)
    x, y = points.T
    for k in range(rings.shape[1]):
        (x0, y0), (x1, y1) = rings[:, k - 1].T, rings[:, k].T
        inside ^= ((y1 > y) != (y0 > y)) & (x < (x0 - x1) * (y - y1) / (y0 - y1) + x1)
    return inside


def circle_polygon(rings: Floats, center: Floats, radius: Floats) -> Bools:
    """Test the centre by crossings, and the distance of each side."""
    found = point_polygon(rings, center)
    for k in range(rings.shape[1]):
        found |= _distance2(center, rings[:, k - 1], rings[:, k]) <= radius * radius
    return found


def polygons(a: Floats, b: Floats, sides: int | None = None) -> Bools:
    """Project both on the normals of sides (separating axes): of all sides, or of the first few of each."""
    found = np.ones(len(a), np.bool_)
    for one in (a, b):
        for k in range(sides or one.shape[1]):
            side = one[:, (k + 1) % one.shape[1]] - one[:, k]
            normal = np.stack([-side[:, 1], side[:, 0]], axis=1)[:, None]
            on_a, on_b = (a * normal).sum(axis=2), (b * normal).sum(axis=2)
            found &= (on_a.max(axis=1) >= on_b.min(axis=1)) & (on_b.max(axis=1) >= on_a.min(axis=1))
    return found


# Triangles in space


def triangles(a: Floats, b: Floats) -> Bools:
    """Compare the intervals on the line of both planes; coplanar triangles by sides and corners (Moller)."""
    (normal_a, at_a), (normal_b, at_b) = _plane(a), _plane(b)
    side_a = (a * normal_b[:, None]).sum(axis=2) + at_b[:, None]
    side_b = (b * normal_a[:, None]).sum(axis=2) + at_a[:, None]
    apart = [(side > 0).all(axis=1) | (side < 0).all(axis=1) for side in (side_a, side_b)]
    along = np.abs(np.cross(normal_a, normal_b)).argmax(axis=1)
    rows = np.arange(len(a))
    (low_a, high_a), (low_b, high_b) = _interval(a[rows, :, along], side_a), _interval(b[rows, :, along], side_b)
    meet = (low_a <= high_b) & (low_b <= high_a) & ~apart[0] & ~apart[1]
    same = (side_a == 0).all(axis=1) | (side_b == 0).all(axis=1)
    meet[same] = _coplanar(a[same], b[same], normal_a[same])
    return np.asarray(meet)


def _plane(t: Floats) -> tuple[Floats, Floats]:
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    return normal, -(normal * t[:, 0]).sum(axis=1)


def _interval(at: Floats, side: Floats) -> tuple[Floats, Floats]:
    """Return the interval on an axis in which the triangle crosses the other plane."""
    low, high = np.full(len(at), np.inf), np.full(len(at), -np.inf)
    for k in range(3):
        p, q, here, there = at[:, k - 1], at[:, k], side[:, k - 1], side[:, k]
        place = p + (q - p) * here / (here - there)
        for crossed, value in (((here > 0) != (there > 0), place), (there == 0, q)):
            low = np.where(crossed, np.fmin(low, value), low)
            high = np.where(crossed, np.fmax(high, value), high)
    return low, high


def _coplanar(a: Floats, b: Floats, normal: Floats) -> Bools:
    """Test for crossing sides or a corner in the other, with the largest axis of the normal dropped."""
    drop = np.abs(normal).argmax(axis=1)
    kept = np.array([(1, 2), (0, 2), (0, 1)])[drop]
    p, q = (np.take_along_axis(t, kept[:, None], axis=2) for t in (a, b))
    found = point_polygon(q, p[:, 0]) | point_polygon(p, q[:, 0])
    for i in range(3):
        for j in range(3):
            a0, a1, b0, b1 = p[:, i - 1], p[:, i], q[:, j - 1], q[:, j]
            found |= (_turn(a0, a1, b0) * _turn(a0, a1, b1) <= 0) & (_turn(b0, b1, a0) * _turn(b0, b1, a1) <= 0)
    return found


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


# Rays and patterns, in px


def ray_targets(start: Array, end: Array, cells: Array) -> Bools:
    """Clip the ray to the slabs of the box (Kay and Kajiya)."""
    a, b = start / 256, end / 256
    return _slabs(a, b - a, cells)


def _slabs(a: Floats, step: Floats, cells: Array) -> Bools:
    low, high = (cells - 0.5 - a) / step, (cells + 0.5 - a) / step
    entry, leave = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
    return np.asarray(np.maximum(entry, 0) <= np.minimum(leave, 1))


def ray_cells(start: Array, end: Array, cells: Array) -> Bools:
    """Walk from cell to cell across the nearest wall, up to the last cell (Amanatides and Woo)."""
    a, b = start / 256, end / 256
    step = b - a
    at, last = np.floor(a + 0.5), np.floor(b + 0.5)
    sign = np.sign(step)
    each = np.abs(1 / step)
    following = np.where(sign == 0, np.inf, (at + sign * 0.5 - a) / step)
    found = (at == cells).all(axis=1)
    for _ in range(int(np.abs(last - at).sum(axis=1).max(initial=0))):
        going = (at != last).any(axis=1)
        across = following[:, 1] < following[:, 0]
        for axis, moves in ((0, going & ~across), (1, going & across)):
            at[moves, axis] += sign[moves, axis]
            following[moves, axis] += each[moves, axis]
        found |= (at == cells).all(axis=1)
    return np.asarray(found)


def flights(start: Array, unit: Array, times: Array, radius: Array, cells: Array, velocity: Array) -> Bools:
    """Move the centre by the relative step; test its distance from the pixel's centre, and the slabs of the pixel."""
    a, step, r = start / 256, (unit * times[:, None] - velocity) / 256, radius / 256
    return np.asarray((_distance2(cells.astype(np.float64), a, a + step) <= r * r) | _slabs(a, step, cells))


def disc_pixels(radius: Array, cells: Array, places: Array) -> Bools:
    """Compare the distance in the world with the radius."""
    off = (cells + places).astype(np.float64) - places
    return np.asarray(np.sqrt((off * off).sum(axis=1)) <= radius / 256)


def beam_pixels(unit: Array, times: Array, radius: Array, cells: Array, places: Array) -> Bools:
    """Compare the distance from the beam in the world, and test the slabs of the pixel."""
    angle = np.arctan2(unit[:, 1], unit[:, 0])
    length = np.sqrt((unit * unit).sum(axis=1)) * times / 256
    step = np.stack([np.cos(angle) * length, np.sin(angle) * length], axis=1)
    a, p = places.astype(np.float64), (cells + places).astype(np.float64)
    return np.asarray((_distance2(p, a, a + step) <= (radius / 256) ** 2) | _slabs(a, step, cells + places))


def pattern_pixels(rings: Array, cells: Array, places: Array) -> Bools:
    """Count crossings of a ray to +x in the world."""
    return point_polygon(rings / 256.0 + places[:, None], (cells + places).astype(np.float64))
