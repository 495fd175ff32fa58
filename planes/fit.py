"""Masks to volumes that contain them: every closed pixel square of the mask lies in the volume, exactly.

Volumes are in px, pixel [0, 0] of the mask about the origin. Hulls and choices are made on whole numbers; what float64
cannot hold is rounded outward. Rings turn from +x toward +y. An empty mask has no volume: it is refused.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from planes.arrays import Bools, Floats, InputError, bools, integer, real, reals
from planes.constants import BOXES_MAX, MASK_SIDE_MAX, POSITION_MAX
from planes.cover import cover
from planes.hull import Line, Point, edge_lines, extents, fewer_lines, hull_points, outward_corners
from planes.outline import outline

__all__ = [
    "Box", "Boxes", "Circle", "OrientedBox", "Ring", "box", "boxes", "concave", "convex", "hull", "least_circle",
    "oriented_box", "pivot_circle",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Circle:
    """Closed disc: center_xy (2,) float64, radius, px."""

    center_xy: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class Box:
    """Closed axis-aligned box: min_xy (2,), max_xy (2,) float64, px."""

    min_xy: Floats
    max_xy: Floats


@dataclass(frozen=True, eq=False)
class OrientedBox:
    """The hull of four corners: corners_xy (4, 2) float64, px, in turning order."""

    corners_xy: Floats


@dataclass(frozen=True, eq=False)
class Boxes:
    """Any of closed boxes: rows_xyxy (n, 4) float64 x_min, y_min, x_max, y_max, px.

    false_area is what they cover and the mask does not, each place once, px^2.
    """

    rows_xyxy: Floats
    false_area: int


@dataclass(frozen=True, eq=False)
class Ring:
    """Closed simple polygon: points_xy (n, 2) float64, px, the last joined to the first."""

    points_xy: Floats


def hull(mask: object) -> Ring:
    """Convex hull of the pixel squares; its corners are pixel corners, none between its neighbours.

    Parameters
    ----------
    mask : (h, w) bool with a pixel or more

    Raises
    ------
    InputError
        If the mask is empty, too large, or no mask.
    """
    return Ring(np.array(hull_points(_checked(mask))) / 2)


def box(mask: object) -> Box:
    """Axis-aligned box of the pixel squares, exact; `mask` as in `hull`."""
    rows, first, last = extents(_checked(mask))
    low, high = (int(first.min()), int(rows[0])), (int(last.max()), int(rows[-1]))
    return Box(np.array(low) - 0.5, np.array(high) + 0.5)


def least_circle(mask: object) -> Circle:
    """Least circle that contains the pixel squares, found exactly; `mask` as in `hull`.

    The centre is rounded, then the radius is the least float64 for that centre: above the true one by rounding alone.

    References
    ----------
    Elzinga and Hearn, "Geometrical solutions for some minimax location problems" (1972): let in the farthest point
    until none is outside. Few rounds, each over the hull's corners.
    """
    points = hull_points(_checked(mask))
    x, y, d = _least_center(points)
    center = (x / (2 * d), y / (2 * d))
    return Circle(np.array(center), _radius_about(points, center))


def pivot_circle(mask: object, pivot_xy: Sequence[float]) -> Circle:
    """Least circle about a pivot (2,) in px that contains the pixel squares, which no turn about it changes.

    The centre is the pivot; the radius is rounded up. `mask` as in `hull`.
    """
    points = hull_points(_checked(mask))
    pivot = reals("pivot_xy", pivot_xy, (2,), POSITION_MAX)
    return Circle(pivot, _radius_about(points, (float(pivot[0]), float(pivot[1]))))


def oriented_box(mask: object) -> OrientedBox:
    """Box of least area over all directions; `mask` as in `hull`.

    Its area is the least to rounding: corners that float64 does not hold are moved outward, so that the hull of the
    four stored corners contains the pixel squares.

    References
    ----------
    Freeman and Shapira (1975): a side lies on an edge of the hull. Toussaint, "Solving geometric problems with the
    rotating calipers" (1983).
    """
    return OrientedBox(outward_corners(_least_sides(hull_points(_checked(mask)))))


def boxes(mask: object, k: int) -> Boxes:
    """Cover the pixel squares by at most k boxes (1 to 64) with few false pixels: never more of them for a greater k.

    Fewer than k boxes come where they cover the mask as well. They may overlap. `mask` as in `hull`.
    """
    rows, false = cover(_checked(mask), integer("k", k, 1, BOXES_MAX))
    return Boxes(rows.astype(np.float64) - 0.5, false)


def convex(mask: object, n: int) -> Ring:
    """Convex polygon of at most n >= 4 corners that contains the hull: edges left out, each the cheapest in area.

    The hull itself where it has no more corners. `mask` as in `hull`.
    """
    lines = edge_lines(hull_points(_checked(mask)))
    return Ring(outward_corners(fewer_lines(lines, integer("n", n, 4, 4 * MASK_SIDE_MAX))))


def concave(mask: object, tolerance: float) -> Ring:
    """Outline that contains the pixel squares and leaves them by at most `tolerance` px; `mask` as in `hull`.

    Parts are bridged and holes are filled first: the tolerance is from what that gives. A mask of very many pixels or
    corners is taken by square blocks of pixels first (see `planes.outline`).
    """
    checked = _checked(mask)
    return Ring(outline(checked, real("tolerance", tolerance, 0, MASK_SIDE_MAX)))


def _checked(mask: object) -> Bools:
    checked = bools("mask", mask, (None, None))
    if max(checked.shape) > MASK_SIDE_MAX:
        raise InputError(f"mask: expected sides up to {MASK_SIDE_MAX} px, got shape {checked.shape}")
    if not checked.any():
        raise InputError(f"mask: expected a pixel or more, got none in shape {checked.shape}")
    return checked


def _radius_about(points: list[Point], center_px: tuple[float, float]) -> float:
    """Least float64 radius, px, of a circle about a centre that contains points in half pixels."""
    (a, b), (p, q) = (v.as_integer_ratio() for v in center_px)
    scale = max(b, q)
    x, y = 2 * a * (scale // b), 2 * p * (scale // q)
    far = max((u * scale - x) ** 2 + (v * scale - y) ** 2 for u, v in points)
    square = Fraction(far, 4 * scale * scale)
    radius = math.nextafter(math.sqrt(square), 0)
    while Fraction(radius) ** 2 < square:
        radius = math.nextafter(radius, math.inf)
    return radius


Center = tuple[int, int, int]
"""(x, y, d) with d > 0 stands for (x / d, y / d)."""


def _least_center(points: list[Point]) -> Center:
    """Centre of the least circle around points, exactly."""
    basis = points[:2]
    while True:
        center = _center(basis)
        far = max(points, key=lambda p: _scaled_square(center, p))
        if _scaled_square(center, far) <= _scaled_square(center, basis[0]):
            return center
        basis = _support([far, *basis])


def _scaled_square(center: Center, point: Point) -> int:
    x, y, d = center
    return (point[0] * d - x) ** 2 + (point[1] * d - y) ** 2


def _center(basis: list[Point]) -> Center:
    """Centre of the circle on two points as diameter, or through three."""
    (x, y), *others = basis
    if len(others) == 1:
        return x + others[0][0], y + others[0][1], 2
    (p, q), (u, v) = ((a - x, b - y) for a, b in others)
    d = 2 * (p * v - q * u)
    up, down = v * (p * p + q * q) - q * (u * u + v * v), p * (u * u + v * v) - u * (p * p + q * q)
    return (x * d + up, y * d + down, d) if d > 0 else (-x * d - up, -y * d - down, -d)


def _support(points: list[Point]) -> list[Point]:
    """Of at most four points, the first on the circle's edge, the two or three that carry their least circle.

    A circle on a diameter, or about a triangle without an obtuse angle, that contains all is the least.
    """
    first, *rest = points
    pairs = [[first, q] for q in rest]
    triples = [[first, q, r] for q, r in itertools.combinations(rest, 2)]
    for basis in pairs + [t for t in triples if _is_acute(t)]:
        center = _center(basis)
        if all(_scaled_square(center, p) <= _scaled_square(center, first) for p in points):
            return basis
    raise AssertionError(f"no least circle around {points}")


def _is_acute(triangle: list[Point]) -> bool:
    """Whether a triangle has area and no obtuse angle."""
    (ax, ay), (bx, by), (cx, cy) = triangle
    p, q, u, v = bx - ax, by - ay, cx - ax, cy - ay
    at_a = p * u + q * v
    return p * v != q * u and at_a >= 0 and p * p + q * q >= at_a and u * u + v * v >= at_a


def _least_sides(ring: list[Point]) -> list[Line]:
    """Four lines of the least box: calipers turn once around the hull, one of their jaws on each edge in turn."""
    lines, n = edge_lines(ring), len(ring)
    best: tuple[int, int, list[Line]] | None = None
    right = far = left = 0
    for i, (a, b, c) in enumerate(lines):
        along, inward = (-b, a), (-a, -b)
        right = _farthest(ring, along, max(right, i + 1))
        far = _farthest(ring, inward, max(far, right))
        left = _farthest(ring, (b, -a), max(left, far))
        ends = [_dot(v, ring[j % n]) for v, j in ((along, right), (inward, far), ((b, -a), left))]
        area, square = (ends[0] + ends[2]) * (ends[1] + c), a * a + b * b
        if best is None or area * best[1] < best[0] * square:
            best = area, square, [(a, b, c), (*along, ends[0]), (*inward, ends[1]), (b, -a, ends[2])]
    assert best is not None
    return best[2]


def _dot(v: Point, p: Point) -> int:
    return v[0] * p[0] + v[1] * p[1]


def _farthest(ring: list[Point], direction: Point, start: int) -> int:
    """Walk on around the ring while it goes farther in a direction."""
    n, i = len(ring), start
    while _dot(direction, ring[(i + 1) % n]) > _dot(direction, ring[i % n]):
        i += 1
    return i
