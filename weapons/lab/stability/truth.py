"""Exact predicates for shapes, in slow rational arithmetic on Python's integers, one case at a time.

They judge the methods of this project and of others, so they import none of them and use another criterion: a common
point of two shapes instead of a separating line. Floats are exact rational numbers. All sets are closed, so touching
shapes meet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

Row = Sequence[Any]
Point = Sequence[int]
Ring = Sequence[Point]

HALF = 128  # from a pixel's centre to its edge, in 1/256 px


def whole(numbers: Sequence[Any]) -> list[int]:
    """Scale floats or integers to integers in a common unit."""
    ratios = [number.as_integer_ratio() for number in numbers]
    unit = max([denominator for _, denominator in ratios])  # the largest power of two
    return [numerator * (unit // denominator) for numerator, denominator in ratios]


def _rows(*rows: Row, width: int = 2) -> list[list[tuple[int, ...]]]:
    """Scale rows of points to integers in a common unit."""
    flat = whole([value for row in rows for point in row for value in point])
    points = list(zip(*(flat[k::width] for k in range(width)), strict=True))
    ends = [0]
    for row in rows:
        ends.append(ends[-1] + len(row))
    return [points[first:last] for first, last in pairwise(ends)]


def _turn(a: Point, b: Point, c: Point) -> int:
    """Return (b - a) x (c - a), which is positive if a, b, c turn from +x toward +y."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _sides(ring: Ring) -> Iterator[tuple[Point, Point]]:
    yield from pairwise(ring)
    yield ring[-1], ring[0]


def _upright(ring: Ring) -> Ring:
    """Return the ring in the order in which `_turn` is positive for points inside."""
    twice_area = sum(a[0] * b[1] - a[1] * b[0] for a, b in _sides(ring))
    return ring if twice_area > 0 else ring[::-1]


# Circles, boxes, capsules


def circles_meet(center_a: Row, radius_a: float, center_b: Row, radius_b: float) -> bool:
    """Whether the distance of the centres is at most the sum of the radii."""
    ax, ay, ra, bx, by, rb = whole([*center_a, radius_a, *center_b, radius_b])
    return bool((ax - bx) ** 2 + (ay - by) ** 2 <= (ra + rb) ** 2)


def boxes_meet(low_a: Row, high_a: Row, low_b: Row, high_b: Row) -> bool:
    """Whether the sum of the widths is at least that of their common span, on both axes."""
    ((low_a, high_a, low_b, high_b),) = _rows((low_a, high_a, low_b, high_b))
    spans = (max(high_a[k], high_b[k]) - min(low_a[k], low_b[k]) for k in (0, 1))
    return all(span <= high_a[k] - low_a[k] + high_b[k] - low_b[k] for k, span in enumerate(spans))


def capsule_meets_circle(a: Row, b: Row, radius: float, center: Row, radius_c: float) -> bool:
    """Whether the distance of a centre from a segment is at most the sum of the radii."""
    ax, ay, bx, by, r, x, y, r_c = whole([*a, *b, radius, *center, radius_c])
    return _near((x, y), (ax, ay), (bx, by), r + r_c)


def _near(p: Point, a: Point, b: Point, r: int) -> bool:
    """Whether a point lies within r of a segment."""
    dx, dy, x, y = b[0] - a[0], b[1] - a[1], p[0] - a[0], p[1] - a[1]
    along, length2 = x * dx + y * dy, dx * dx + dy * dy
    if 0 < along < length2:
        return (x * dy - y * dx) ** 2 <= r * r * length2
    if along > 0:
        x, y = p[0] - b[0], p[1] - b[1]
    return x * x + y * y <= r * r


# Polygons


def is_convex(ring: Row) -> bool:
    """Whether points go once around a convex polygon and turn the same way at each of them."""
    (ring,) = _rows(ring)
    n = len(ring)
    turns = [_turn(ring[k], ring[(k + 1) % n], ring[(k + 2) % n]) for k in range(n)]
    ahead = [tuple(q) > tuple(p) for p, q in _sides(ring)]
    returns = sum(p != q for p, q in zip(ahead, ahead[1:] + ahead[:1], strict=True))
    return (min(turns) > 0 or max(turns) < 0) and returns == 2


def is_simple(ring: Row) -> bool:
    """Whether a ring of points neither crosses nor touches itself."""
    (ring,) = _rows(ring)
    sides = list(_sides(ring))
    for k, (a, b) in enumerate(sides):
        after = sides[(k + 1) % len(sides)][1]
        back = sum((after[i] - b[i]) * (a[i] - b[i]) for i in (0, 1)) > 0
        if a == b or (back and _turn(a, b, after) == 0):
            return False  # a side without length, or one that turns back
        for c, d in sides[k + 2 : len(sides) - (k == 0)]:
            ends = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
            if _cross(a, b, c, d) or any(_on_side(p, q, r) for p, q, r in ends):
                return False
    return True


def polygon_holds(ring: Row, p: Row) -> bool:
    """Whether a point lies in a simple polygon or on its edge, by the crossings of a ray to +x."""
    ring, (p,) = _rows(ring, [p])
    if any(_on_side(p, *side) for side in _sides(ring)):
        return True
    crossed = [
        sorted(side, key=lambda end: end[1]) for side in _sides(ring) if (side[0][1] > p[1]) != (side[1][1] > p[1])
    ]
    return sum(_turn(low, high, p) > 0 for low, high in crossed) % 2 == 1


def _on_side(p: Point, a: Point, b: Point) -> bool:
    return _turn(a, b, p) == 0 and all(min(a[k], b[k]) <= p[k] <= max(a[k], b[k]) for k in (0, 1))


def circle_meets_polygon(ring: Row, center: Row, radius: float) -> bool:
    """Whether a centre lies in a convex polygon, or within the radius of an edge."""
    ring, ((x, y), (r, _)) = _rows(ring, [center, (radius, 0)])
    center = x, y
    return _in_convex(_upright(ring), center) or any(_near(center, a, b, r) for a, b in _sides(ring))


def polygons_meet(a: Row, b: Row) -> bool:
    """Whether two convex polygons with areas meet: a corner of one lies in the other, or two edges cross."""
    a, b = _rows(a, b)
    a, b = _upright(a), _upright(b)
    if any(_in_convex(b, p) for p in a) or any(_in_convex(a, p) for p in b):
        return True
    return any(_cross(*side, *other) for side in _sides(a) for other in _sides(b))


def _in_convex(ring: Ring, p: Point) -> bool:
    return all(_turn(a, b, p) >= 0 for a, b in _sides(ring))


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    return _turn(a, b, c) * _turn(a, b, d) < 0 and _turn(c, d, a) * _turn(c, d, b) < 0


# Triangles in space


def has_area(triangle: Row) -> bool:
    """Whether the corners of a triangle in space do not lie on one line."""
    ((a, b, c),) = _rows(triangle, width=3)
    return any(_cross3(_minus(b, a), _minus(c, a)))


def triangles_meet(a: Row, b: Row) -> bool:
    """Whether two triangles with areas in 3-D meet: an edge of one meets the other."""
    a, b = _rows(a, b, width=3)
    return any(_edge_meets(p, q, b) for p, q in _sides(a)) or any(_edge_meets(p, q, a) for p, q in _sides(b))


def _edge_meets(p: Point, q: Point, triangle: Ring) -> bool:
    a, b, c = triangle
    normal = _cross3(_minus(b, a), _minus(c, a))
    at_p, at_q = _dot(normal, _minus(p, a)), _dot(normal, _minus(q, a))
    if at_p * at_q > 0:
        return False
    drop = max(range(3), key=lambda k: abs(normal[k]))
    flat = _upright([_without(corner, drop) for corner in triangle])
    if at_p == at_q:  # both 0: the edge lies in the plane
        ends = _without(p, drop), _without(q, drop)
        return any(_in_convex(flat, end) for end in ends) or any(_cross(*ends, *side) for side in _sides(flat))
    # The intersection with the plane, times (at_p - at_q), so the corners are multiplied by the same factor.
    factor = at_p - at_q
    at = _without([at_p * q[k] - at_q * p[k] for k in range(3)], drop)
    return _in_convex(_upright([[factor * v for v in corner] for corner in flat]), at)


def _minus(p: Point, q: Point) -> Point:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


def _dot(p: Point, q: Point) -> int:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _cross3(p: Point, q: Point) -> Point:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def _without(p: Point, axis: int) -> Point:
    return [v for k, v in enumerate(p) if k != axis]


# Rays and patterns, in 1/256 px


def segment_meets_cell(a: Point, b: Point, cell: Point) -> bool:
    """Whether a segment meets the closed square of a pixel: an end lies in it, or it crosses a diagonal."""
    (ax, ay), (bx, by) = ((p[0] - 256 * cell[0], p[1] - 256 * cell[1]) for p in (a, b))
    if max(abs(ax), abs(ay)) <= HALF or max(abs(bx), abs(by)) <= HALF:
        return True
    diagonals = (((-HALF, -HALF), (HALF, HALF)), ((-HALF, HALF), (HALF, -HALF)))
    a, b = (ax, ay), (bx, by)
    sides = ((_turn(c, d, a), _turn(c, d, b), _turn(a, b, c) * _turn(a, b, d)) for c, d in diagonals)
    return any((p or q) and p * q <= 0 and ends <= 0 for p, q, ends in sides)


def disc_flies_into(a: Point, step: Point, radius: int, cell: Point, cell_step: Point) -> bool:
    """Whether a moving disc touches a moving pixel: the disc its centre, or the disc's centre its square."""
    b = [a[k] + step[k] - cell_step[k] for k in (0, 1)]
    centre = [256 * v for v in cell]
    return _near(centre, a, b, radius) or segment_meets_cell(a, b, cell)


def in_disc(radius: int, cell: Point) -> bool:
    """Whether the distance of a pixel's centre from that of pixel (0, 0) is at most the radius."""
    return (256 * cell[0]) ** 2 + (256 * cell[1]) ** 2 <= radius * radius


def in_beam(end: Point, radius: int, cell: Point) -> bool:
    """Whether a pixel's centre lies within the radius of a segment from (0, 0), or its square meets the segment."""
    return disc_flies_into((0, 0), end, radius, cell, (0, 0))
