"""Slow exact truth for volumes: do two closed sets share a point, on which side of a radius lies a distance.

Frame: x right, y down, px; pixel (x, y) is the closed square [x-1/2, x+1/2] x [y-1/2, y+1/2]. Sets are closed: touching
counts. Shapes are plain tuples of numbers, and every number means exactly itself, as a fraction:

    point    (x, y)                     segment  (a, b)
    circle   (centre, radius)           capsule  (a, b, radius)
    aabb     (min, max)                 obb      four corners: their hull, in any order, also flat
    polygon  its corners: their hull

Each is the hull of a few points, grown by a radius (0 for most). Points, circles and boxes may have three coordinates.
Every decision compares sums of products of coordinates, all of one degree, so the coordinates of a case may all be
multiplied by one number above zero: `units` multiplies fractions by their common denominator, because whole numbers are
faster. Nothing after it divides or rounds, and the same functions run on Fraction, int and, to be compared, float.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import combinations, pairwise, product
from math import lcm
from typing import Any

__all__ = [
    "KINDS", "PAIRS", "bounds_hold", "boxes_hold_pixels", "circles_sign", "contains_point", "fractions", "hull",
    "is_convex_ring", "meets", "meets_exactly_as", "orient2d", "orient3d", "outline_holds_pixels", "pixels_of",
    "point_segment_sign", "segment_segment_sign", "separates", "triangles_meet", "triangles_meet_as", "units",
    "volume_holds_pixels",
]  # fmt: skip

KINDS = ("circle", "aabb", "obb", "polygon", "capsule")
PAIRS = tuple((a, b) for i, a in enumerate(KINDS) for b in KINDS[i:])
"""The 15 pairs of 2-D kinds, each once."""

Number = Any  # Fraction or int in decisions; float where the same formula is shown to fail
Point = tuple[Number, ...]
Shape = tuple[Any, ...]
Pixel = tuple[int, int]
HALF = Fraction(1, 2)


# Numbers


def leaves(shape: Any) -> Iterator[Number]:
    if isinstance(shape, tuple | list):
        for part in shape:
            yield from leaves(part)
    else:
        yield shape


def mapped(shape: Any, change: Callable[[Number], Number]) -> Any:
    if isinstance(shape, tuple | list):
        return tuple(mapped(part, change) for part in shape)
    return change(shape)


def fractions(*shapes: Shape) -> tuple[Shape, ...]:
    """Each number of the shapes as the fraction that it is."""
    return mapped(shapes, Fraction)


def units(*shapes: Shape) -> tuple[Shape, ...]:
    """The shapes in whole units, the greatest unit that all their numbers are multiples of (or a divisor of it)."""
    unit = lcm(*(value.as_integer_ratio()[1] for value in leaves(shapes)))

    def whole(value: Number) -> int:
        numerator, denominator = value.as_integer_ratio()
        return int(numerator) * (unit // denominator)

    return mapped(shapes, whole)


def sign(value: Number) -> int:
    return (value > 0) - (value < 0)


def minus(a: Point, b: Point) -> Point:
    return tuple(p - q for p, q in zip(a, b, strict=True))


def times(a: Point, factor: Number) -> Point:
    return tuple(p * factor for p in a)


def dot(a: Point, b: Point) -> Number:
    return sum(p * q for p, q in zip(a, b, strict=True))


def cross3(a: Point, b: Point) -> Point:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


# Signs


def turn(a: Point, b: Point, c: Point) -> Number:
    """(b - a) x (c - a): above zero when a, b, c go from +x toward +y."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def volume6(a: Point, b: Point, c: Point, d: Point) -> Number:
    """(b - a) x (c - a) . (d - a)."""
    return dot(cross3(minus(b, a), minus(c, a)), minus(d, a))


def orient2d(a: Point, b: Point, c: Point) -> int:
    """Sign of (b - a) x (c - a)."""
    return sign(turn(*units(a, b, c)))


def orient3d(a: Point, b: Point, c: Point, d: Point) -> int:
    """Sign of the determinant of the rows b - a, c - a, d - a (of a - d, b - d, c - d: the opposite)."""
    return sign(volume6(*units(a, b, c, d)))


def circles_sign(c1: Point, r1: Number, c2: Point, r2: Number) -> int:
    """Sign of |c1 - c2| - (r1 + r2), in any dimension."""
    c1, r1, c2, r2 = units(c1, r1, c2, r2)
    return sign(dot(minus(c1, c2), minus(c1, c2)) - (r1 + r2) ** 2)


def point_segment_sign(p: Point, a: Point, b: Point, r: Number) -> int:
    """Sign of (distance from p to the segment ab) - r, in any dimension; r >= 0."""
    return point_segment(*units(p, a, b, r))


def segment_segment_sign(a: Point, b: Point, c: Point, d: Point, r: Number) -> int:
    """Sign of (distance between the segments ab and cd) - r, in 2-D; r >= 0."""
    a, b, c, d, r = units(a, b, c, d, r)
    if segments_meet(a, b, c, d):
        return -sign(r)
    return min(point_segment(*row, r) for row in ((a, c, d), (b, c, d), (c, a, b), (d, a, b)))


def point_segment(p: Point, a: Point, b: Point, r: Number) -> int:
    along, reach = minus(b, a), minus(p, a)
    at, length2 = dot(reach, along), dot(along, along)
    if at <= 0:  # before a, or a = b
        return sign(dot(reach, reach) - r * r)
    if at >= length2:  # beyond b
        return sign(dot(minus(p, b), minus(p, b)) - r * r)
    return sign(dot(reach, reach) * length2 - at * at - r * r * length2)


# Hulls of points in the plane


def hull(points: Iterable[Point]) -> list[Point]:
    """Corners of the hull, each once, none on an edge, in the turning sense of `turn` > 0: one, two, or a ring."""
    points = sorted(set(points))
    if len(points) < 3:
        return points
    return half_hull(points)[:-1] + half_hull(points[::-1])[:-1]


def half_hull(points: Sequence[Point]) -> list[Point]:
    chain: list[Point] = []
    for point in points:
        while len(chain) > 1 and turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def edges(ring: Sequence[Point]) -> list[tuple[Point, Point]]:
    """The sides of a ring; of two points their segment, of one the point twice."""
    return [(ring[0], ring[-1])] if len(ring) < 3 else [*pairwise(ring), (ring[-1], ring[0])]


def on_segment(p: Point, a: Point, b: Point) -> bool:
    return turn(a, b, p) == 0 and dot(minus(p, a), minus(p, b)) <= 0


def in_ring(p: Point, ring: Sequence[Point]) -> bool:
    """Whether a point lies in a hull as `hull` gives it."""
    if len(ring) < 3:
        return on_segment(p, ring[0], ring[-1])
    return all(turn(a, b, p) >= 0 for a, b in edges(ring))


def segments_meet(a: Point, b: Point, c: Point, d: Point) -> bool:
    across = sign(turn(a, b, c)) * sign(turn(a, b, d)) < 0 and sign(turn(c, d, a)) * sign(turn(c, d, b)) < 0
    return across or on_segment(a, c, d) or on_segment(b, c, d) or on_segment(c, a, b) or on_segment(d, a, b)


def rings_meet(a: Sequence[Point], b: Sequence[Point]) -> bool:
    """One has a corner in the other, or their sides meet: convex sets that meet without either have equal corners."""
    if any(in_ring(p, b) for p in a) or any(in_ring(p, a) for p in b):
        return True
    return any(segments_meet(*s, *t) for s in edges(a) for t in edges(b))


def rings_within(a: Sequence[Point], b: Sequence[Point], r: Number) -> bool:
    """Whether two hulls lie within r: they meet, or a corner of one is as near to a side of the other."""
    if rings_meet(a, b):
        return True
    pairs = [*product(a, edges(b)), *product(b, edges(a))]
    return r > 0 and any(point_segment(p, *side, r) <= 0 for p, side in pairs)


def is_convex_ring(points: Sequence[Point]) -> bool:
    """Whether points go once around a convex polygon with an area, in either sense; points on its sides are allowed."""
    (points,) = units(tuple(points))
    corners = hull(points)
    if len(corners) < 3 or len(set(points)) < len(points):
        return False
    around = [p for a, b in edges(corners) for p in sorted(set(points), key=lambda p: dot(minus(p, a), minus(b, a)))
              if on_segment(p, a, b) and p != b]  # fmt: skip
    if len(around) < len(points):
        return False
    start = around.index(points[0])
    forward = around[start:] + around[:start]
    return list(points) in (forward, forward[:1] + forward[:0:-1])


# Volumes


def core(kind: str, shape: Shape) -> tuple[list[Point], Number]:
    """Points and a radius: the volume is every place within the radius of the points' hull."""
    match kind:
        case "point":
            return [shape], 0
        case "segment" | "obb" | "polygon":
            return list(shape), 0
        case "circle":
            return [shape[0]], shape[1]
        case "capsule":
            return [shape[0], shape[1]], shape[2]
        case "aabb":
            return list(product(*zip(*shape, strict=True))), 0
    raise ValueError(f"no volume: {kind!r}")


def meets(kind_a: str, a: Shape, kind_b: str, b: Shape) -> bool:
    """Whether two volumes share a point."""
    return meets_exactly_as(kind_a, kind_b, *units(a, b))


def meets_exactly_as(kind_a: str, kind_b: str, a: Shape, b: Shape) -> bool:
    """`meets` on the numbers as they are, of whatever type.

    Points, circles and boxes by closed forms, in any dimension; the rest by their hulls' features, in 2-D.
    """
    if kind_a in SEATED and kind_b in SEATED:
        return seated_meet(*SEATED[kind_a](a), *SEATED[kind_b](b))
    (points_a, radius_a), (points_b, radius_b) = core(kind_a, a), core(kind_b, b)
    return rings_within(hull(points_a), hull(points_b), radius_a + radius_b)


SEATED: dict[str, Callable[[Shape], tuple[Point, Point, Number]]] = {
    "point": lambda shape: (shape, shape, 0),
    "circle": lambda shape: (shape[0], shape[0], shape[1]),
    "aabb": lambda shape: (shape[0], shape[1], 0),
}
"""Kinds that are a box (of a circle: its centre) and a radius: each axis has its own gap, whatever the others are."""


def seated_meet(low_a: Point, high_a: Point, radius_a: Number, low_b: Point, high_b: Point, radius_b: Number) -> bool:
    gaps = tuple(max(la - hb, lb - ha, 0) for la, ha, lb, hb in zip(low_a, high_a, low_b, high_b, strict=True))
    return dot(gaps, gaps) <= (radius_a + radius_b) ** 2


def contains_point(kind: str, shape: Shape, point: Point) -> bool:
    """Whether a point lies in a volume, or on its edge."""
    return meets(kind, shape, "point", point)


def separates(axis: Point, kind_a: str, a: Shape, kind_b: str, b: Shape) -> bool:
    """Whether the shadows of two volumes on an axis (of any length above zero) are strictly apart."""
    axis, a, b = *units(axis), *units(a, b)
    (points_a, radius_a), (points_b, radius_b) = core(kind_a, a), core(kind_b, b)
    on_a, on_b = [dot(p, axis) for p in points_a], [dot(p, axis) for p in points_b]
    gap = max(min(on_b) - max(on_a), min(on_a) - max(on_b))
    return gap > 0 and gap * gap > (radius_a + radius_b) ** 2 * dot(axis, axis)


def bounds_hold(box: Shape, kind: str, shape: Shape) -> bool:
    """Whether the box (min, max) contains a volume."""
    (low, high), shape = units(box, shape)
    points, radius = core(kind, shape)
    return all(lo <= v - radius and v + radius <= hi for p in points for lo, v, hi in zip(low, p, high, strict=True))


# Triangles in space


def triangles_meet(a: Shape, b: Shape) -> bool:
    """Whether two triangles in 3-D, also flat ones, share a point: an edge of one meets the other."""
    return triangles_meet_as(*units(a, b))


def triangles_meet_as(a: Shape, b: Shape) -> bool:
    """`triangles_meet` on the numbers as they are, of whatever type."""
    return any(edge_meets(edge, b) for edge in combinations(a, 2)) or any(
        edge_meets(edge, a) for edge in combinations(b, 2)
    )


def edge_meets(edge: tuple[Point, Point], triangle: Shape) -> bool:
    """Whether a segment meets a triangle: in their common plane, or where the segment crosses the triangle's."""
    start, end = (volume6(*triangle, point) for point in edge)
    if sign(start) * sign(end) > 0:
        return False
    if start == end == 0:
        normal = plane_normal([*edge, *triangle])
        if any(dot(normal, minus(p, edge[0])) != 0 for p in [edge[1], *triangle]):
            return False  # the triangle is flat, and lies skew to the segment
        flat = dropping(normal)
        return rings_meet(hull(map(flat, edge)), hull(map(flat, triangle)))
    # at = (end * edge[0] - start * edge[1]) / (end - start), and both sides of what follows times (end - start)
    at = minus(times(edge[0], end), times(edge[1], start))
    flat = dropping(plane_normal(triangle))
    return in_ring(flat(at), hull(flat(times(p, end - start)) for p in triangle))


def plane_normal(points: Sequence[Point]) -> Point:
    """A normal of a plane through three of the points (any plane through them when all are on a line)."""
    for a, b, c in combinations(points, 3):
        normal = cross3(minus(b, a), minus(c, a))
        if any(normal):
            return normal
    along = next((d for d in (minus(p, points[0]) for p in points) if any(d)), (0, 0, 0))
    normals = (cross3(along, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    return next((normal for normal in normals if any(normal)), (0, 0, 1))


def dropping(normal: Point) -> Callable[[Point], Point]:
    """Leave out a coordinate, along which no two points of the plane lie."""
    left_out = max(range(3), key=lambda k: abs(normal[k]))
    return lambda point: tuple(v for k, v in enumerate(point) if k != left_out)


# Pixel squares inside volumes


def pixels_of(mask: Sequence[Sequence[bool]], origin: Pixel = (0, 0)) -> set[Pixel]:
    """The set pixels (x, y) of a mask whose first pixel lies at the origin."""
    return {(x + origin[0], y + origin[1]) for y, row in enumerate(mask) for x, on in enumerate(row) if on}


def square(pixel: Pixel) -> tuple[Point, Point]:
    return tuple(v - HALF for v in pixel), tuple(v + HALF for v in pixel)


def volume_holds_pixels(kind: str, shape: Shape, pixels: Iterable[Pixel]) -> bool:
    """Whether a volume contains every closed pixel square: being convex, whether it contains their corners."""
    corners = {corner for pixel in pixels for corner in product(*zip(*square(pixel), strict=True))}
    shape, *corners = units(shape, *corners)
    points, radius = core(kind, shape)
    ring = hull(points)
    return all(rings_within([corner], ring, radius) for corner in corners)


def boxes_hold_pixels(boxes: Sequence[Shape], pixels: Iterable[Pixel]) -> bool:
    """Whether boxes together contain every closed pixel square.

    All their sides cut a square into cells; each cell is in a box as a whole, or its centre is in none.
    """
    boxes = fractions(*boxes)
    for low, high in map(square, pixels):
        near = [box for box in boxes if all(p <= h and q >= v for p, q, v, h in zip(*box, low, high, strict=True))]
        cuts = [sorted({low[k], high[k], *(c for box in near for c in (box[0][k], box[1][k]) if low[k] < c < high[k])})
                for k in (0, 1)]  # fmt: skip
        centres = product(*([(p + q) / 2 for p, q in pairwise(cut)] for cut in cuts))
        if not all(any(seated_meet(*box, 0, c, c, 0) for box in near) for c in centres):
            return False
    return True


def outline_holds_pixels(outline: Sequence[Point], pixels: Iterable[Pixel]) -> bool:
    """Whether a simple polygon, convex or not, contains every closed pixel square.

    None of its sides enters the inside of a square, so that is inside or outside as a whole: as its centre is.
    """
    (ring,) = fractions(tuple(outline))
    sides = [*pairwise(ring), (ring[-1], ring[0])]
    for pixel in pixels:
        low, high = square(pixel)
        if any(enters(side, low, high) for side in sides) or not odd(pixel, sides):
            return False
    return True


def enters(side: tuple[Point, Point], low: Point, high: Point) -> bool:
    """Whether a segment has a point strictly inside a box: a stretch of it lies within both slabs."""
    first, last = Fraction(0), Fraction(1)
    for k in (0, 1):
        start, step = side[0][k], side[1][k] - side[0][k]
        if step == 0:
            if not low[k] < start < high[k]:
                return False
            continue
        ends = sorted(((low[k] - start) / step, (high[k] - start) / step))
        first, last = max(first, ends[0]), min(last, ends[1])
    return first < last


def odd(p: Point, sides: Sequence[tuple[Point, Point]]) -> bool:
    """Whether a ray from p toward +x crosses an odd number of sides; p is on none of them."""
    crossed = [(a, b) if a[1] < b[1] else (b, a) for a, b in sides if (a[1] > p[1]) != (b[1] > p[1])]
    return sum(turn(a, b, p) > 0 for a, b in crossed) % 2 == 1
