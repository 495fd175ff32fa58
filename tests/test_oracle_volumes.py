"""The slow truth for volumes is itself right, shown by hand and by other ways; and the families of pairs are hard."""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import combinations, permutations, product
from typing import Any

import adversarial
import numpy as np
import oracle_volumes as exact
import pytest
from oracle_volumes import KINDS, PAIRS, contains_point, cross3, dot, fractions, meets, minus, times
from some_of import some_of

Shape = tuple[Any, ...]
SPACE_PAIRS = [("circle", "circle"), ("circle", "aabb"), ("aabb", "aabb")]
ALL_PAIRS = [*((*pair, 2) for pair in PAIRS), *((*pair, 3) for pair in SPACE_PAIRS)]
SMALL_PAIRS = [("point", kind, 2) for kind in KINDS] + [("segment", "segment", 2), ("segment", "capsule", 2)]
EXTREME = ("subnormal", "huge", "greatest", "mixed")
ORDINARY = tuple(name for name in adversarial.FAMILIES if name not in EXTREME)
COUNT = 72  # of each pair, in each law: six of each family

every_pair = pytest.mark.parametrize(("kind_a", "kind_b", "dim"), some_of(ALL_PAIRS + SMALL_PAIRS, 2))
planar_pair = pytest.mark.parametrize(("kind_a", "kind_b"), some_of([*PAIRS, *(pair[:2] for pair in SMALL_PAIRS)], 2))


def up(value: float, ulps: int = 1) -> float:
    for _ in range(abs(ulps)):
        value = math.nextafter(value, math.copysign(math.inf, ulps))
    return value


# By hand

UNIT = ((0.0, 0.0), (1.0, 1.0))
DIAMOND = ((0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))
BAR = ((0.0, 0.0), (4.0, 0.0), 0.5)
WEDGE = ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0))

TOUCHING = {
    "circle-circle, 3-4-5": ("circle", ((0.0, 0.0), 2.0), "circle", ((3.0, 4.0), 3.0)),
    "circle-circle, radius 0, the same point": ("circle", ((0.1, 0.2), 0.0), "circle", ((0.1, 0.2), 0.0)),
    "circle-circle, one inside the other": ("circle", ((0.0, 0.0), 9.0), "circle", ((1.0, 0.0), 1.0)),
    "circle-aabb, side": ("circle", ((0.5, 3.0), 2.0), "aabb", UNIT),
    "circle-aabb, corner": ("circle", ((4.0, 5.0), 5.0), "aabb", UNIT),
    "circle-aabb, centre inside": ("circle", ((0.5, 0.5), 0.0), "aabb", UNIT),
    "circle-obb, side of the diamond": ("circle", ((2.0, 2.0), 2.125), "obb", DIAMOND),
    "circle-obb, corner": ("circle", ((3.0, 0.0), 2.0), "obb", DIAMOND),
    "circle-polygon, hypotenuse": ("circle", ((5.0, 5.5), 5.0), "polygon", WEDGE),
    "circle-capsule, end": ("circle", ((7.0, 4.0), 4.5), "capsule", BAR),
    "circle-capsule, side": ("circle", ((2.0, 2.0), 1.5), "capsule", BAR),
    "aabb-aabb, corner": ("aabb", UNIT, "aabb", ((1.0, 1.0), (2.0, 2.0))),
    "aabb-aabb, points": ("aabb", ((1.0, 1.0), (1.0, 1.0)), "aabb", ((1.0, 1.0), (1.0, 1.0))),
    "aabb-aabb, crossing lines": ("aabb", ((0.0, 1.0), (2.0, 1.0)), "aabb", ((1.0, 0.0), (1.0, 2.0))),
    "aabb-obb, corner on a side": ("aabb", ((0.5, 0.5), (2.0, 2.0)), "obb", DIAMOND),
    "aabb-polygon, corner on a side": ("aabb", ((2.0, 1.5), (3.0, 3.0)), "polygon", WEDGE),
    "aabb-capsule, side": ("aabb", ((1.0, 0.5), (2.0, 1.0)), "capsule", BAR),
    "obb-obb, end to end": ("obb", DIAMOND, "obb", tuple((x + 2.0, y) for x, y in DIAMOND)),
    "obb-obb, flat across": ("obb", ((-2.0, 0.0), (2.0, 0.0), (2.0, 0.0), (-2.0, 0.0)), "obb", DIAMOND),
    "obb-obb, corners in no order": ("obb", ((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)), "obb",
                                     ((2.0, 1.0), (3.0, 1.0), (2.0, 3.0), (3.0, 3.0))),
    "obb-polygon, side by side": ("obb", ((0.0, 0.0), (0.0, -1.0), (4.0, -1.0), (4.0, 0.0)), "polygon", WEDGE),
    "obb-capsule, corner on the end": ("obb", tuple((x - 1.5, y) for x, y in DIAMOND), "capsule", BAR),
    "polygon-polygon, one inside": ("polygon", WEDGE, "polygon", ((0.5, 0.5), (1.0, 0.5), (0.5, 1.0))),
    "polygon-polygon, corner on a side": ("polygon", WEDGE, "polygon", ((2.0, 1.5), (4.0, 1.5), (4.0, 3.0))),
    "polygon-capsule, side": ("polygon", tuple((x, y + 0.5) for x, y in WEDGE), "capsule", BAR),
    "capsule-capsule, side by side": ("capsule", BAR, "capsule", ((1.0, 1.0), (9.0, 1.0), 0.5)),
    "capsule-capsule, no length": ("capsule", BAR, "capsule", ((5.5, 0.0), (5.5, 0.0), 1.0)),
    "capsule-capsule, on a line, no radius": ("capsule", (*BAR[:2], 0.0), "capsule", ((4.0, 0.0), (5.0, 0.0), 0.0)),
    "capsule-capsule, crossing": ("capsule", BAR, "capsule", ((2.0, -9.0), (2.0, 9.0), 0.0)),
    "spheres": ("circle", ((0.0, 0.0, 0.0), 1.0), "circle", ((2.0, 3.0, 6.0), 6.0)),
    "sphere-cube, corner": ("circle", ((3.0, 4.0, 7.0), 7.0), "aabb", ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))),
    "cubes, corner": ("aabb", ((0.0,) * 3, (1.0,) * 3), "aabb", ((1.0,) * 3, (2.0,) * 3)),
}  # fmt: skip

APART = {
    "circle-circle, an ulp": ("circle", ((0.0, 0.0), 2.0), "circle", ((3.0, up(4.0)), 3.0)),
    "circle-circle, the least float": ("circle", ((0.0, 0.0), 0.0), "circle", ((5e-324, 0.0), 0.0)),
    "circle-aabb, beside the corner": ("circle", ((4.0, up(5.0)), 5.0), "aabb", UNIT),
    "circle-obb": ("circle", ((2.0, 2.0), 2.1213203435596424), "obb", DIAMOND),  # below 3 / sqrt(2)
    "circle-polygon": ("circle", ((5.0, 5.5), up(4.4, -1)), "polygon", WEDGE),
    "circle-capsule, beyond the end": ("circle", ((7.0, 4.0), up(4.5, -1)), "capsule", BAR),
    "aabb-aabb": ("aabb", UNIT, "aabb", ((up(1.0), 0.0), (2.0, 1.0))),
    "aabb-obb, boxes overlap": ("aabb", ((up(0.5), 0.5), (2.0, 2.0)), "obb", DIAMOND),
    "aabb-polygon": ("aabb", ((2.0, up(1.5)), (3.0, 3.0)), "polygon", WEDGE),
    "aabb-capsule, in the rounded corner": ("aabb", ((4.375, 0.375), (5.0, 1.0)), "capsule", BAR),
    "obb-obb": ("obb", DIAMOND, "obb", tuple((x + up(2.0), y) for x, y in DIAMOND)),
    "obb-obb, flat ones on a line": ("obb", ((0.0, 0.0), (1.0, 1.0)) * 2, "obb", ((2.0, 2.0), (3.0, 3.0)) * 2),
    "obb-polygon": ("obb", ((0.0, -5e-324), (0.0, -1.0), (4.0, -1.0), (4.0, -5e-324)), "polygon", WEDGE),
    "obb-capsule": ("obb", tuple((x - up(1.5), y) for x, y in DIAMOND), "capsule", BAR),
    "polygon-polygon": ("polygon", WEDGE, "polygon", ((up(2.0), 1.5), (4.0, 1.5), (4.0, 3.0))),
    "polygon-capsule": ("polygon", tuple((x, y + up(0.5)) for x, y in WEDGE), "capsule", BAR),
    "capsule-capsule": ("capsule", BAR, "capsule", ((1.0, up(1.0)), (9.0, 1.5), 0.5)),
    "capsule-capsule, on a line": ("capsule", (*BAR[:2], 0.0), "capsule", ((up(4.0), 0.0), (5.0, 0.0), 0.0)),
    "spheres": ("circle", ((0.0, 0.0, 0.0), 1.0), "circle", ((2.0, 3.0, 6.0), up(6.0, -1))),
    "sphere-cube": ("circle", ((3.0, 4.0, up(7.0)), 7.0), "aabb", ((0.0,) * 3, (1.0,) * 3)),
    "cubes": ("aabb", ((0.0,) * 3, (1.0,) * 3), "aabb", ((0.0, 0.0, up(1.0)), (2.0,) * 3)),
}  # fmt: skip


@pytest.mark.parametrize("row", TOUCHING.values(), ids=TOUCHING)
def test_what_touches_meets(row: tuple[str, Shape, str, Shape]) -> None:
    kind_a, a, kind_b, b = row
    assert meets(kind_a, a, kind_b, b)
    assert meets(kind_b, b, kind_a, a)


@pytest.mark.parametrize("row", APART.values(), ids=APART)
def test_what_is_apart_does_not_meet(row: tuple[str, Shape, str, Shape]) -> None:
    kind_a, a, kind_b, b = row
    assert not meets(kind_a, a, kind_b, b)
    assert not meets(kind_b, b, kind_a, a)


def test_every_pair_was_drawn_by_hand() -> None:
    for drawn in (TOUCHING, APART):
        assert {(row[0], row[2]) for row in drawn.values()} >= set(PAIRS)


def test_signs_by_hand() -> None:
    assert exact.orient2d((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)) == 1  # +x toward +y
    assert exact.orient2d((0.0, 0.0), (1.0, 1.0), (3.0, 3.0)) == 0
    assert exact.orient2d((0.0, 0.0), (1e300, 1e300), (1e-300, 5e-324)) == -1
    assert exact.orient3d((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (5.0, 5.0, 5e-324)) == 1
    assert exact.orient3d((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (5.0, 5.0, 0.0)) == 0
    assert [exact.circles_sign((0.0, 0.0), 2.0, (3.0, 4.0), r) for r in (up(3.0), 3.0, up(3.0, -1))] == [-1, 0, 1]
    assert [exact.point_segment_sign((1.0, y), (0.0, 0.0), (4.0, 0.0), 2.0) for y in (1.0, -2.0, 3.0)] == [-1, 0, 1]
    assert [exact.point_segment_sign((7.0, y), (0.0, 0.0), (4.0, 0.0), 5.0) for y in (3.0, -4.0, 5.0)] == [-1, 0, 1]
    assert [exact.point_segment_sign((3.0, 4.0), (0.0, 0.0), (0.0, 0.0), r) for r in (6.0, 5.0, 4.0)] == [-1, 0, 1]
    assert exact.point_segment_sign((1.0, 3.0, 4.0), (0.0, 0.0, 0.0), (9.0, 0.0, 0.0), 5.0) == 0
    cross = ((0.0, 0.0), (2.0, 2.0), (0.0, 2.0), (2.0, 0.0))
    assert [exact.segment_segment_sign(*cross, r) for r in (0.0, 1.0)] == [0, -1]
    apart = ((0.0, 0.0), (4.0, 0.0), (7.0, 4.0), (9.0, 4.0))
    assert [exact.segment_segment_sign(*apart, r) for r in (up(5.0), 5.0, up(5.0, -1))] == [-1, 0, 1]


FLOOR = ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
LINE = ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (2.0, 4.0, 6.0))
TRIANGLES = {
    "corner on the face": (FLOOR, ((1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (2.0, 1.0, 1.0)), True),
    "corner above the face": (FLOOR, ((1.0, 1.0, 5e-324), (1.0, 1.0, 1.0), (2.0, 1.0, 1.0)), False),
    "corner on an edge": (FLOOR, ((2.0, 2.0, 0.0), (3.0, 3.0, 1.0), (3.0, 3.0, -1.0)), True),
    "through the plane beside it": (FLOOR, ((up(2.0), 2.0, 1.0), (up(2.0), 2.0, -1.0), (3.0, 3.0, 1.0)), False),
    "through the inside": (FLOOR, ((1.0, 1.0, 1.0), (1.0, 1.0, -1.0), (9.0, 9.0, 0.0)), True),
    "an edge in the plane, apart": (FLOOR, ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)), False),
    "coplanar, one inside": (FLOOR, ((0.5, 0.5, 0.0), (1.0, 0.5, 0.0), (0.5, 1.0, 0.0)), True),
    "coplanar, a corner shared": (FLOOR, ((4.0, 0.0, 0.0), (5.0, 0.0, 0.0), (5.0, 1.0, 0.0)), True),
    "coplanar, apart": (FLOOR, ((up(4.0), 0.0, 0.0), (5.0, 0.0, 0.0), (5.0, 1.0, 0.0)), False),
    "parallel planes": (FLOOR, tuple((x, y, 5e-324) for x, y, _ in FLOOR), False),
    "the same, another order": (FLOOR, FLOOR[::-1], True),
    "lines that cross": (LINE, ((1.0, 2.0, 0.0), (1.0, 2.0, 9.0), (1.0, 2.0, 5.0)), True),
    "lines that are skew": (LINE, ((1.0, up(2.0), 0.0), (1.0, up(2.0), 9.0), (1.0, up(2.0), 5.0)), False),
    "lines on a line, apart": (LINE, tuple((x + 3.0, y + 6.0, z + 9.0) for x, y, z in LINE), False),
    "lines on a line, end to end": (LINE, tuple((x + 2.0, y + 4.0, z + 6.0) for x, y, z in LINE), True),
    "a point on the face": (FLOOR, ((1.0, 1.0, 0.0),) * 3, True),
    "a point off the face": (FLOOR, ((1.0, 1.0, 1.0),) * 3, False),
    "a point beside the line": (LINE, ((1.0, 2.0, up(3.0)),) * 3, False),
    "a point and itself": (((1.0, 2.0, 3.0),) * 3, ((1.0, 2.0, 3.0),) * 3, True),
    "a point and another": (((1.0, 2.0, 3.0),) * 3, ((1.0, 2.0, 4.0),) * 3, False),
}


@pytest.mark.parametrize(("a", "b", "expected"), TRIANGLES.values(), ids=TRIANGLES)
def test_triangles_by_hand(a: Shape, b: Shape, expected: bool) -> None:
    for p, q in product(permutations(a), permutations(b)):
        assert exact.triangles_meet(p, q) is expected
        assert exact.triangles_meet(q, p) is expected


# Laws


def changed(kind: str, shape: Shape, point: Callable[[Shape], Shape], factor: Fraction = Fraction(1)) -> Shape:
    """A shape with each of its points changed, and its radius multiplied."""
    (shape,) = fractions(shape)
    match kind:
        case "point":
            return point(shape)
        case "circle" | "capsule":
            return *map(point, shape[:-1]), shape[-1] * factor
        case "aabb":
            return tuple(tuple(f(pair) for pair in zip(*map(point, shape), strict=True)) for f in (min, max))
    return tuple(map(point, shape))


@every_pair
def test_symmetric_and_the_same_in_fractions(kind_a: str, kind_b: str, dim: int) -> None:
    for name, a, b in adversarial.cases(kind_a, kind_b, COUNT, 1, dim):
        answer = meets(kind_a, a, kind_b, b)
        assert meets(kind_b, b, kind_a, a) is answer, (name, a, b)
        assert exact.meets_exactly_as(kind_a, kind_b, *fractions(a, b)) is answer, (name, a, b)


@every_pair
def test_moved_scaled_and_mirrored_alike(kind_a: str, kind_b: str, dim: int) -> None:
    by, factor = (Fraction(10**9), Fraction(-7), Fraction(3))[:dim], Fraction(3, 7)
    changes = [
        (lambda p: tuple(v + w for v, w in zip(p, by, strict=True)), Fraction(1)),
        (lambda p: times(p, factor), factor),
        (lambda p: (-p[1], p[0], *p[2:]), Fraction(1)),
    ]
    for name, a, b in adversarial.cases(kind_a, kind_b, COUNT, 2, dim):
        answer = meets(kind_a, a, kind_b, b)
        for change, length in changes:
            pair = changed(kind_a, a, change, length), changed(kind_b, b, change, length)
            assert meets(kind_a, pair[0], kind_b, pair[1]) is answer, (name, a, b)


def test_triangles_in_any_order_and_frame() -> None:
    rng = np.random.default_rng(5)
    for name, a, b in adversarial.triangle_cases(550, 3):
        answer = exact.triangles_meet(a, b)
        assert exact.triangles_meet_as(*fractions(a, b)) is answer, (name, a, b)
        p, q = ([shape[i] for i in rng.permutation(3)] for shape in (a, b))
        axes = rng.permutation(3)
        p, q = (tuple(tuple(Fraction(row[k]) * 5 - 10**9 for k in axes) for row in shape) for shape in (p, q))
        assert exact.triangles_meet(q, p) is answer, (name, a, b)


# Other ways to the same answer


def square_distance(p: Shape, a: Shape, b: Shape) -> Fraction:
    """From a point to a segment: to the point a + t (b - a), t cut to [0, 1]."""
    along = minus(b, a)
    length2 = dot(along, along)
    t = min(max(dot(minus(p, a), along) / length2, Fraction(0)), Fraction(1)) if length2 else Fraction(0)
    off = minus(p, tuple(v + t * w for v, w in zip(a, along, strict=True)))
    return dot(off, off)


def in_some_triangle(p: Shape, points: Sequence[Shape]) -> bool:
    """Whether a point is in a hull by Caratheodory: in a triangle of three of the points, or on a segment of two."""
    if any(square_distance(p, a, b) == 0 for a, b in product(points, points)):
        return True
    for a, b, c in combinations(points, 3):
        area = exact.turn(a, b, c)
        if area and all(exact.turn(*row) / area >= 0 for row in ((a, b, p), (b, c, p), (c, a, p))):
            return True
    return False


def minkowski(kind_a: str, a: Shape, kind_b: str, b: Shape) -> bool:
    """Whether two volumes meet: is the origin within both radii of the hull of all differences of their points?"""
    a, b = fractions(a, b)
    (points_a, radius_a), (points_b, radius_b) = exact.core(kind_a, a), exact.core(kind_b, b)
    differences = exact.hull(minus(p, q) for p, q in product(points_a, points_b))
    origin = (Fraction(0), Fraction(0))
    if in_some_triangle(origin, differences):
        return True
    nearest = min(square_distance(origin, p, q) for p, q in exact.edges(differences))
    return nearest <= (radius_a + radius_b) ** 2


@pytest.mark.parametrize("count", [36, pytest.param(600, marks=pytest.mark.long)])
@planar_pair
def test_against_the_minkowski_difference(kind_a: str, kind_b: str, count: int) -> None:
    for name, a, b in adversarial.cases(kind_a, kind_b, count, 4):
        assert minkowski(kind_a, a, kind_b, b) is meets(kind_a, a, kind_b, b), (name, a, b)


def half_spaces(points: Sequence[Shape]) -> list[tuple[Shape, Fraction]]:
    """(normal, height) of each: the hull of up to three points in space is where all `normal . x <= height`."""
    planes: list[tuple[Shape, Shape]] = []  # (normal, a point on it)
    first, last = min(points), max(points)
    normal = cross3(minus(points[1], points[0]), minus(points[2], points[0]))
    if any(normal):
        planes = [(times(normal, s), points[0]) for s in (1, -1)]
        planes += [(cross3(minus(points[k - 2], points[k]), normal), points[k]) for k in range(3)]
    elif first != last:
        along = minus(last, first)
        sides = [cross3(along, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        planes = [(along, last), (times(along, -1), first), *((times(n, s), first) for n in sides for s in (1, -1))]
    else:
        planes = [(tuple(s * (k == j) for k in range(3)), first) for j in range(3) for s in (1, -1)]
    return [(normal, dot(normal, place)) for normal, place in planes]


def clipped(ring: list[Shape], normal: Shape, height: Fraction) -> list[Shape]:
    """The part of a convex ring where `normal . x <= height` (Sutherland and Hodgman)."""
    kept: list[Shape] = []
    for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
        over, next_over = dot(normal, p) - height, dot(normal, q) - height
        if over <= 0:
            kept.append(p)
        if over * next_over < 0:
            t = over / (over - next_over)
            kept.append(tuple(v + t * (w - v) for v, w in zip(p, q, strict=True)))
    return kept


def cut_by(ring: list[Shape], planes: Sequence[tuple[Shape, Fraction]]) -> bool:
    for normal, height in planes:
        ring = clipped(ring, normal, height)
    return bool(ring)


@pytest.mark.parametrize("count", [440, pytest.param(5_500, marks=pytest.mark.long)])
def test_triangles_against_clipping(count: int) -> None:
    for name, a, b in adversarial.triangle_cases(count, 6):
        p, q = fractions(a, b)
        assert cut_by(list(p), half_spaces(q)) is exact.triangles_meet(a, b), (name, a, b)


@pytest.mark.parametrize("kind", ["aabb", "obb", "polygon"])
def test_polygons_against_clipping(kind: str) -> None:
    for name, a, b in adversarial.cases(kind, "polygon", COUNT, 7):
        p, q = (exact.hull(exact.core(k, s)[0]) for k, s in zip((kind, "polygon"), fractions(a, b), strict=True))
        planes = [((v[1] - u[1], u[0] - v[0]), dot((v[1] - u[1], u[0] - v[0]), u)) for u, v in exact.edges(q)]
        assert cut_by(p, planes) is meets(kind, a, "polygon", b), (name, a, b)


@pytest.mark.parametrize(("kind_a", "kind_b"), list(product(exact.SEATED, exact.SEATED)))
def test_closed_forms_against_the_general_one(kind_a: str, kind_b: str) -> None:
    for name, a, b in adversarial.cases(kind_a, kind_b, COUNT, 8):
        (points_a, radius_a), (points_b, radius_b) = map(exact.core, (kind_a, kind_b), exact.units(a, b))
        general = exact.rings_within(exact.hull(points_a), exact.hull(points_b), radius_a + radius_b)
        assert general is meets(kind_a, a, kind_b, b), (name, a, b)


def test_distance_signs_against_distances() -> None:
    for name, p, (a, b, r) in adversarial.cases("point", "capsule", 240, 9):
        fp, fa, fb = fractions(p, a, b)
        expected = exact.sign(square_distance(fp, fa, fb) - Fraction(r) ** 2)
        assert exact.point_segment_sign(p, a, b, r) == expected, (name, p, a, b, r)
    for name, (a, b), (c, d, r) in adversarial.cases("segment", "capsule", 240, 10):
        fa, fb, fc, fd = fractions(a, b, c, d)
        ends = ((fa, fc, fd), (fb, fc, fd), (fc, fa, fb), (fd, fa, fb))
        distance = min(square_distance(*row) for row in ends)
        if minkowski("segment", (a, b), "segment", (c, d)):
            distance = Fraction(0)
        assert exact.segment_segment_sign(a, b, c, d, r) == exact.sign(distance - Fraction(r) ** 2), (name, a, b, c, d)
    for name, (p, r), (q, s) in adversarial.cases("circle", "circle", 240, 11, 3):
        off = minus(*fractions(p, q))
        assert exact.circles_sign(p, r, q, s) == exact.sign(dot(off, off) - (Fraction(r) + Fraction(s)) ** 2), name


@pytest.mark.parametrize("kind", ["obb", "polygon", "aabb"])
def test_containment_against_triangles(kind: str) -> None:
    for name, p, shape in adversarial.cases("point", kind, COUNT, 12):
        exact_p, exact_shape = fractions(p, shape)
        assert contains_point(kind, shape, p) is in_some_triangle(exact_p, exact.core(kind, exact_shape)[0]), name


@planar_pair
def test_a_separating_axis_exists_exactly_when_apart(kind_a: str, kind_b: str) -> None:
    """The shortest way between them, or across a side where that is no way."""
    for name, a, b in adversarial.cases(kind_a, kind_b, 60, 13):
        p, q = fractions(a, b)
        rings = [exact.hull(exact.core(kind, shape)[0]) for kind, shape in ((kind_a, p), (kind_b, q))]
        sides = [minus(v, u) for ring in rings for u, v in exact.edges(ring)]
        axes = [(-y, x) for x, y in sides] + sides + [minus(u, v) for u, v in product(*rings)]
        found = any(any(axis) and exact.separates(axis, kind_a, a, kind_b, b) for axis in axes)
        assert found is not meets(kind_a, a, kind_b, b), (name, a, b)


# Pixel squares

TWO = {(0, 0), (1, 1)}


def test_pixels_by_hand() -> None:
    assert exact.pixels_of([[True, False], [False, True]], (3, -2)) == {(3, -2), (4, -1)}
    held = exact.volume_holds_pixels
    assert held("aabb", ((-0.5, -0.5), (1.5, 1.5)), TWO)
    assert not held("aabb", ((-0.5, -0.5), (1.5, up(1.5, -1))), TWO)
    assert held("obb", ((0.5, -1.5), (2.5, 0.5), (0.5, 2.5), (-1.5, 0.5)), TWO)
    assert not held("obb", ((0.5, up(-1.5)), (2.5, 0.5), (0.5, 2.5), (-1.5, 0.5)), {(1, 0)})
    assert held("circle", ((0.5, 0.5), math.sqrt(2)), TWO) is (Fraction(math.sqrt(2)) ** 2 >= 2)
    assert held("circle", ((0.0, 0.0), 2.5), {(1, x) for x in (-1, 0, 1)} | {(-1, 1)})
    assert not held("circle", ((0.0, 0.0), 2.5), {(2, 0)})
    assert held("capsule", ((0.0, 0.0), (5.0, 0.0), 0.75), {(x, 0) for x in range(6)})
    assert not held("capsule", ((0.0, 0.0), (5.0, 0.0), 0.7), {(0, 0)})
    assert held("polygon", ((-0.5, -0.5), (2.5, -0.5), (-0.5, 2.5)), {(0, 0), (1, 0), (0, 1)})
    assert not held("polygon", ((-0.5, -0.5), (2.5, -0.5), (-0.5, 2.5)), {(1, 1)})
    assert held("circle", ((0.0, 0.0), 0.0), set())


def test_boxes_together_hold_what_none_holds_alone() -> None:
    left, right = ((-0.5, -0.5), (0.25, 0.5)), ((0.25, -0.5), (0.5, 0.5))
    assert exact.boxes_hold_pixels([left, right], {(0, 0)})
    assert not exact.boxes_hold_pixels([left], {(0, 0)})
    assert not exact.boxes_hold_pixels([left, ((up(0.25), -0.5), (0.5, 0.5))], {(0, 0)})
    assert not exact.boxes_hold_pixels([left, right], {(0, 0), (1, 0)})
    ring = [
        ((-1.5, -1.5), (1.5, -0.5)),
        ((-1.5, 0.5), (1.5, 1.5)),
        ((-1.5, -1.5), (-0.5, 1.5)),
        ((0.5, -1.5), (1.5, 1.5)),
    ]
    around = {(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)} - {(0, 0)}
    assert exact.boxes_hold_pixels(ring, around)
    assert not exact.boxes_hold_pixels(ring, {(0, 0)})
    assert exact.boxes_hold_pixels([], set())
    assert not exact.boxes_hold_pixels([], {(0, 0)})


def test_boxes_against_a_grid_of_places() -> None:
    """With sides on whole and half numbers, what happens at the odd eighths happens everywhere near them."""
    rng = np.random.default_rng(14)
    held = 0
    for _ in range(300):
        low = rng.integers(-4, 2, (4, 2)) / 4
        boxes = [
            (tuple(p), tuple(q))
            for p, q in zip(low.tolist(), (low + rng.integers(1, 8, (4, 2)) / 4).tolist(), strict=True)
        ]
        places = [Fraction(k, 8) for k in (-3, -1, 1, 3)]
        expected = all(any(contains_point("aabb", box, p) for box in boxes) for p in product(places, places))
        assert exact.boxes_hold_pixels(boxes, {(0, 0)}) is expected
        held += expected
    assert 30 < held < 270


def test_outlines_by_hand() -> None:
    """An L of three squares, in both turning senses; a notch; a needle that enters a square."""
    ell = ((-0.5, -0.5), (1.5, -0.5), (1.5, 0.5), (0.5, 0.5), (0.5, 1.5), (-0.5, 1.5))
    for outline in (ell, ell[::-1], ell[2:] + ell[:2]):
        assert exact.outline_holds_pixels(outline, {(0, 0), (1, 0), (0, 1)})
        assert not exact.outline_holds_pixels(outline, {(1, 1)})
        assert not exact.outline_holds_pixels(outline, {(2, 0)})
    notched = (*ell[:3], (up(0.5, -1), 0.5), *ell[4:])
    assert not exact.outline_holds_pixels(notched, {(0, 1)})
    needle = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.0), (0.0, 0.0), (0.5, 5e-324), (0.5, 0.5), (-0.5, 0.5))
    assert not exact.outline_holds_pixels(needle, {(0, 0)})


def test_outlines_against_convex_volumes() -> None:
    held = 0
    pixels = [(x, y) for x in range(-3, 4) for y in range(-3, 4)]
    for _, _, polygon in adversarial.cases("point", "polygon", 60, 15, families=("lattice",)):
        for pixel in pixels:
            expected = exact.volume_holds_pixels("polygon", polygon, [pixel])
            assert exact.outline_holds_pixels(polygon, [pixel]) is expected, (polygon, pixel)
            held += expected
    assert held > 200


def test_bounds() -> None:
    assert exact.bounds_hold(((-0.5, -0.5), (4.5, 0.5)), "capsule", BAR)
    assert not exact.bounds_hold(((-0.5, -0.5), (up(4.5, -1), 0.5)), "capsule", BAR)
    assert exact.bounds_hold(((-1.0, -1.0), (1.0, 1.0)), "obb", DIAMOND)
    assert not exact.bounds_hold(((-1.0, up(-1.0)), (1.0, 1.0)), "obb", DIAMOND)
    assert exact.bounds_hold(((-1.0,) * 3, (1.0,) * 3), "circle", ((0.0,) * 3, 1.0))


def test_convex_rings() -> None:
    assert exact.is_convex_ring(WEDGE)
    assert exact.is_convex_ring(WEDGE[::-1])
    assert exact.is_convex_ring(((0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (0.0, 3.0), (0.0, 1.0)))
    assert exact.is_convex_ring(((2.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 3.0), (4.0, 0.0)))
    assert not exact.is_convex_ring(((2.0, 0.0), (0.0, 0.0), (4.0, 0.0), (0.0, 3.0)))  # goes back along a side
    assert not exact.is_convex_ring(((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)))
    assert not exact.is_convex_ring((*WEDGE, (1.0, 1.0)))
    assert not exact.is_convex_ring((DIAMOND[0], DIAMOND[2], DIAMOND[1], DIAMOND[3]))
    assert not exact.is_convex_ring((*WEDGE, *WEDGE))


# The families


@every_pair
def test_families_are_well_formed_and_half_meet(kind_a: str, kind_b: str, dim: int) -> None:
    made = list(adversarial.cases(kind_a, kind_b, 240, 16, dim))
    assert {name for name, _, _ in made} == set(adversarial.FAMILIES)
    for name, a, b in made:
        for kind, shape in ((kind_a, a), (kind_b, b)):
            assert all(type(v) is float and math.isfinite(v) for v in exact.leaves(shape)), (name, shape)
            assert kind not in ("circle", "capsule") or shape[-1] >= 0
            assert kind != "aabb" or all(p <= q for p, q in zip(*shape, strict=True))
            assert kind != "polygon" or exact.is_convex_ring(shape), (name, shape)
    share = sum(meets(kind_a, a, kind_b, b) for _, a, b in made) / len(made)
    assert 0.33 < share < 0.67


def test_triangle_families_half_meet() -> None:
    made = list(adversarial.triangle_cases(1100, 17))
    assert {name for name, _, _ in made} == set(adversarial.TRIANGLE_FAMILIES)
    assert all(type(v) is float and math.isfinite(v) for _, a, b in made for v in exact.leaves((a, b)))
    assert 0.35 < sum(exact.triangles_meet(a, b) for _, a, b in made) / len(made) < 0.65


@pytest.mark.parametrize(("dim", "orient"), [(2, exact.orient2d), (3, exact.orient3d)])
def test_orient_families_have_all_signs(dim: int, orient: Callable[..., int]) -> None:
    made = list(adversarial.orient_cases(dim, 600, 18))
    assert all(type(v) is float and math.isfinite(v) for _, points in made for v in exact.leaves(points))
    signs = [orient(*points) for _, points in made]
    assert all(signs.count(sign) > 20 for sign in (-1, 0, 1))


def test_a_seed_says_all() -> None:
    made = list(adversarial.cases("obb", "polygon", 60, 19))
    assert list(adversarial.cases("obb", "polygon", 24, 19)) == made[:24]
    assert list(adversarial.cases("obb", "polygon", 60, 20)) != made
    assert list(adversarial.triangle_cases(22, 19)) == list(adversarial.triangle_cases(44, 19))[:22]


def test_sizes_and_places_go_as_far_as_said() -> None:
    def extent(name: str) -> tuple[float, float]:
        found = [
            max(map(abs, exact.leaves((a, b))))
            for _, a, b in adversarial.cases("obb", "capsule", 200, 21, families=[name])
        ]
        return min(found), max(found)

    assert extent("far_away")[1] > 1e11
    assert extent("subnormal")[0] < 1e-320
    assert 1e149 < extent("huge")[1] < 1e153
    assert extent("greatest")[1] > 1e303
    ratios = [a[1] / b[1] for _, a, b in adversarial.cases("circle", "circle", 200, 21, families=["size_ratio"])]
    assert min(ratios) < 1e-11
    assert max(ratios) > 1e11


# Plain float64 gets them wrong


def plain_circles(a: Shape, b: Shape) -> bool:
    return math.dist(a[0], b[0]) <= a[1] + b[1]


def plain_circle_box(a: Shape, b: Shape) -> bool:
    nearest = [min(max(v, lo), hi) for v, lo, hi in zip(a[0], *b, strict=True)]
    return math.dist(a[0], nearest) <= a[1]


def plain_distance(p: Shape, a: Shape, b: Shape) -> float:
    along = minus(b, a)
    length2 = dot(along, along)
    t = min(max(dot(minus(p, a), along) / length2, 0.0), 1.0) if length2 else 0.0
    return math.dist(p, tuple(v + t * w for v, w in zip(a, along, strict=True)))


def plain_circle_capsule(a: Shape, b: Shape) -> bool:
    return plain_distance(a[0], b[0], b[1]) <= a[1] + b[2]


def plain_capsules(a: Shape, b: Shape) -> bool:
    if exact.segments_meet(*a[:2], *b[:2]):
        return True
    rows = ((a[0], *b[:2]), (a[1], *b[:2]), (b[0], *a[:2]), (b[1], *a[:2]))
    return min(plain_distance(*row) for row in rows) <= a[2] + b[2]


def plain_axes(a: Shape, b: Shape) -> bool:
    """Separating axes by projecting the corners."""
    for ring in (a, b):
        for k, corner in enumerate(ring):
            axis = (corner[1] - ring[k - 1][1], ring[k - 1][0] - corner[0])
            on_a, on_b = ([dot(axis, p) for p in shape] for shape in (a, b))
            if max(on_a) < min(on_b) or max(on_b) < min(on_a):
                return False
    return True


PLAIN = {
    "circles": ("circle", "circle", 2, plain_circles), "spheres": ("circle", "circle", 3, plain_circles),
    "circle and box": ("circle", "aabb", 2, plain_circle_box),
    "sphere and cube": ("circle", "aabb", 3, plain_circle_box),
    "circle and capsule": ("circle", "capsule", 2, plain_circle_capsule),
    "capsules": ("capsule", "capsule", 2, plain_capsules), "polygons": ("polygon", "polygon", 2, plain_axes),
    "oriented boxes": ("obb", "obb", 2, plain_axes), "box and polygon": ("obb", "polygon", 2, plain_axes),
}  # fmt: skip


@pytest.mark.parametrize(("kind_a", "kind_b", "dim", "plain"), PLAIN.values(), ids=PLAIN)
def test_plain_formulas_are_wrong(kind_a: str, kind_b: str, dim: int, plain: Callable[[Shape, Shape], bool]) -> None:
    """Also at ordinary sizes, one in a hundred."""
    made = list(adversarial.cases(kind_a, kind_b, 600, 22, dim, ORDINARY))
    assert sum(plain(a, b) is not meets(kind_a, a, kind_b, b) for _, a, b in made) >= 6


@pytest.mark.parametrize(("kind_a", "kind_b"), some_of([pair for pair in PAIRS if pair != ("aabb", "aabb")]))
def test_the_oracle_itself_would_be_wrong_in_float64(kind_a: str, kind_b: str) -> None:
    made = list(adversarial.cases(kind_a, kind_b, 800, 23, families=ORDINARY))
    assert any(exact.meets_exactly_as(kind_a, kind_b, a, b) is not meets(kind_a, a, kind_b, b) for _, a, b in made)


def test_triangles_would_be_wrong_in_float64() -> None:
    ordinary = [name for name in adversarial.TRIANGLE_FAMILIES if name not in EXTREME]
    made = list(adversarial.triangle_cases(1600, 24, ordinary))
    wrong = {name for name, a, b in made if exact.triangles_meet_as(a, b) is not exact.triangles_meet(a, b)}
    assert wrong >= {"near_touching", "needles", "near_coplanar", "shared", "size_ratio"}


@pytest.mark.parametrize(
    ("dim", "value", "orient"), [(2, exact.turn, exact.orient2d), (3, exact.volume6, exact.orient3d)]
)
def test_orientations_are_wrong_in_float64(dim: int, value: Callable[..., float], orient: Callable[..., int]) -> None:
    made = list(adversarial.orient_cases(dim, 600, 25))
    wrong = {name for name, points in made if exact.sign(value(*points)) != orient(*points)}
    assert wrong >= {"near_touching", "subnormal", "greatest"}
