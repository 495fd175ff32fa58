"""Pixels to volumes that contain them: every closed pixel square lies in the volume, exactly.

Pixels are a mask (h, w), with pixel [0, 0] about the origin, or Spans. Volumes are in px, and of one row. Hulls and
choices are made on whole numbers; what float64 cannot hold is rounded outward. Rings turn from +x toward +y. A set
without a pixel has no volume: it is refused.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np

from planes.arrays import Bools, Floats, InputError, array_of, bools, integer, real, reals
from planes.constants import BOXES_MAX, LENGTH_TINY, MASK_SIDE_MAX, POSITION_MAX
from planes.cover import cover
from planes.hull import Extents, Line, Point, edge_lines, extents, fewer_lines, hull_points, outward_corners
from planes.outline import outline
from planes.parts import BoxSets
from planes.spans import Spans
from planes.volumes import Aabbs, Capsules, Circles, Obbs, Polygons

__all__ = [
    "box", "boxes", "capsule", "concave", "convex", "hull", "least_circle", "oriented_box", "pivot_circle",
]  # fmt: skip

AXES = 33
"""Lengths of a capsule's axis that are tried."""


def hull(pixels: object) -> Polygons:
    """Convex hull of the pixel squares; its corners are pixel corners, none between its neighbours.

    Parameters
    ----------
    pixels : (h, w) bool, or Spans, with a pixel or more

    Raises
    ------
    InputError
        If there is no pixel, or the mask is too large, or no mask.
    """
    return _polygon(np.array(_corners(pixels)) / 2)


def box(pixels: object) -> Aabbs:
    """Axis-aligned box of the pixel squares, exact; `pixels` as in `hull`."""
    rows, first, last = _extents(pixels)
    return Aabbs([[first.min() - 0.5, rows[0] - 0.5]], [[last.max() + 0.5, rows[-1] + 0.5]])


def least_circle(pixels: object) -> Circles:
    """Least circle that contains the pixel squares, found exactly; `pixels` as in `hull`.

    The centre is rounded, then the radius is the least float64 for that centre: above the true one by rounding alone.

    References
    ----------
    Elzinga and Hearn, "Geometrical solutions for some minimax location problems" (1972): let in the farthest point
    until none is outside. Few rounds, each over the hull's corners.
    """
    corners = _corners(pixels)
    return _circle(corners, _center_px(corners))


def pivot_circle(pixels: object, pivot_xy: Sequence[float]) -> Circles:
    """Least circle about a pivot (2,) in px that contains the pixel squares, which no turn about it changes.

    The centre is the pivot; the radius is rounded up. `pixels` as in `hull`.
    """
    corners = _corners(pixels)
    x, y = reals("pivot_xy", pivot_xy, (2,), POSITION_MAX).tolist()
    return _circle(corners, (x, y))


def capsule(pixels: object) -> Capsules:
    """Capsule around the pixel squares: for what is long and thin, as a beam; `pixels` as in `hull`.

    Its axis is that of the least box, as much shorter at both ends as makes the area least (to 1/64 of its length); or
    it is the least circle, where that is smaller.
    """
    corners = _corners(pixels)
    a, b, c, d = outward_corners(_least_sides(corners))
    if ((b - a) ** 2).sum() < ((c - b) ** 2).sum():
        a, b, c, d = b, c, d, a
    begin, end = (a + d) / 2, (b + c) / 2
    inward = np.linspace(0, 0.5, AXES)[:, None] * (end - begin)
    found = min(zip(begin + inward, end - inward, strict=True), key=lambda axis: _capsule_area(corners, *axis))
    circle = _circle(corners, _center_px(corners))
    if math.pi * circle.radius[0] ** 2 <= _capsule_area(corners, *found):
        return Capsules(circle.center, circle.center, circle.radius)
    begin, end = found
    return Capsules(begin[None], end[None], _radius_about(corners, begin, end))


def _capsule_area(corners: list[Point], begin: Floats, end: Floats) -> float:
    """Area in px^2 of the capsule about an axis that contains points in half pixels, to rounding."""
    along = end - begin
    offset = np.array(corners) / 2 - begin
    share = np.clip((offset * along).sum(axis=1) / max(float((along**2).sum()), LENGTH_TINY), 0, 1)
    radius = math.sqrt(((offset - share[:, None] * along) ** 2).sum(axis=1).max())
    return (2 * math.sqrt((along**2).sum()) + math.pi * radius) * radius


def oriented_box(pixels: object) -> Obbs:
    """Box of least area over all directions; `pixels` as in `hull`.

    Its area is the least to rounding: corners that float64 does not hold are moved outward, so that the hull of the
    four stored corners contains the pixel squares.

    References
    ----------
    Freeman and Shapira (1975): a side lies on an edge of the hull. Toussaint, "Solving geometric problems with the
    rotating calipers" (1983).
    """
    return Obbs.from_corners(outward_corners(_least_sides(_corners(pixels)))[None])


def boxes(mask: object, k: int) -> BoxSets:
    """Cover the pixel squares of a mask (h, w) by at most k boxes (1 to 64) with few false pixels.

    A greater k never brings more false pixels. Fewer than k boxes come where they cover the mask as well. They may
    overlap.
    """
    rows = cover(_checked(mask), integer("k", k, 1, BOXES_MAX)) - 0.5
    return BoxSets(rows[:, :2], rows[:, 2:], [0])


def convex(pixels: object, n: int) -> Polygons:
    """Convex polygon of at most n >= 4 corners that contains the hull: edges left out, each the cheapest in area.

    The hull itself where it has no more corners. `pixels` as in `hull`.
    """
    lines = edge_lines(_corners(pixels))
    return _polygon(outward_corners(fewer_lines(lines, integer("n", n, 4, 4 * MASK_SIDE_MAX))))


def concave(mask: object, tolerance: float) -> Floats:
    """Outline that contains the pixel squares of a mask (h, w) and leaves them by at most `tolerance` px.

    Parts are bridged and holes are filled first: the tolerance is from what that gives. A mask of very many pixels or
    corners is taken by square blocks of pixels first (see `planes.outline`).

    Returns
    -------
    (n, 2) float, px: a simple polygon; `ConcavePolygons(points, [0])` makes a volume of it
    """
    checked = _checked(mask)
    return outline(checked, real("tolerance", tolerance, 0, MASK_SIDE_MAX))


def _checked(mask: object, field: str = "mask", expected: str = "a mask (h, w)") -> Bools:
    if array_of("mask", mask).ndim == 0:
        raise InputError(f"{field}: expected {expected}, got {type(mask).__name__}")
    checked = bools("mask", mask, (None, None))
    if max(checked.shape) > MASK_SIDE_MAX:
        raise InputError(f"mask: expected sides up to {MASK_SIDE_MAX} px, got shape {checked.shape}")
    if not checked.any():
        raise InputError(f"mask: expected a pixel or more, got none in shape {checked.shape}")
    return checked


def _extents(pixels: object) -> Extents:
    if not isinstance(pixels, Spans):
        return extents(_checked(pixels, "pixels", "a mask (h, w) or Spans"))
    if not len(pixels):
        raise InputError("pixels: expected a pixel or more, got none")
    begins = np.flatnonzero(np.diff(pixels.y, prepend=pixels.y[0] - 1))
    return pixels.y[begins], pixels.x_first[begins], pixels.x_last[np.append(begins[1:], len(pixels)) - 1]


def _corners(pixels: object) -> list[Point]:
    """Corners of the hull, in half pixels."""
    return hull_points(_extents(pixels))


def _polygon(points: Floats) -> Polygons:
    return Polygons(points, [0])


def _circle(corners: list[Point], center: tuple[float, float]) -> Circles:
    return Circles([center], _radius_about(corners, center, center))


def _radius_about(corners: list[Point], a_px: Iterable[float], b_px: Iterable[float]) -> float:
    """Least float64 radius, px, about a segment, or a point twice, that contains points in half pixels."""
    ratios = [float(v).as_integer_ratio() for v in (*a_px, *b_px)]
    scale = max(below for _, below in ratios)
    ax, ay, bx, by = (2 * above * (scale // below) for above, below in ratios)
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    far = Fraction(0)
    for x, y in corners:
        fx, fy = x * scale - ax, y * scale - ay
        along, square = fx * dx + fy * dy, fx * fx + fy * fy
        if along >= length2 > 0:
            square += length2 - 2 * along
        elif along > 0:
            far = max(far, Fraction(square * length2 - along * along, length2))
            continue
        far = max(far, Fraction(square))
    far /= 4 * scale * scale
    radius = math.nextafter(math.sqrt(far), 0)
    while Fraction(radius) ** 2 < far:
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


def _center_px(points: list[Point]) -> tuple[float, float]:
    x, y, d = _least_center(points)
    return x / (2 * d), y / (2 * d)


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
