"""Every pair of the table against slow exact truth, over all adversarial families.

By default some 1,000 cases a pair. Marked long: 10^6 for each closed form, 2*10^5 for turned boxes and polygons, 10^4
for the rest. `adversarial`, `oracle_volumes` and `touching` share no code with what they judge.
"""

from __future__ import annotations

from itertools import pairwise, product
from typing import Any

import adversarial
import numpy as np
import oracle_volumes as exact
import pytest
import touching
from oracle_volumes import KINDS, PAIRS

from hitplanes.planes.volumes.overlap import contains_point, overlap, separating_axis
from hitplanes.planes.volumes.volumes import Aabbs, BoxSets, Capsules, Circles, ConcavePolygons, Obbs, Polygons, Volumes

SPACE_PAIRS = [("circle", "circle"), ("circle", "aabb"), ("aabb", "aabb")]
ALL_PAIRS = [*((*pair, 2) for pair in PAIRS), *((*pair, 3) for pair in SPACE_PAIRS)]
HULLS = ("aabb", "obb", "polygon")
HULL_PAIRS = [(a, b) for a, b in PAIRS if a in HULLS and b in HULLS]
CLOSED = [
    ("circle", "circle", 2), ("circle", "aabb", 2), ("circle", "capsule", 2), ("capsule", "capsule", 2),
    ("circle", "circle", 3), ("circle", "aabb", 3),
]  # fmt: skip
MANY = [("obb", "obb"), ("polygon", "polygon"), ("obb", "polygon")]
REST = [pair for pair in ALL_PAIRS if pair[:2] not in MANY and pair not in CLOSED]
COUNT = 204
FINITE = [name for name in adversarial.FAMILIES if name != "greatest"]

Shape = tuple[Any, ...]


@pytest.fixture(params=[COUNT, pytest.param(6 * COUNT, marks=pytest.mark.long)])
def count(request: pytest.FixtureRequest) -> int:
    """Cases of what is asked in no other long test."""
    return request.param


def starts_of(rows: list[Any]) -> list[int]:
    return np.cumsum([0, *map(len, rows[:-1])]).tolist()


def made(kind: str, rows: list[Any]) -> Volumes:
    """Shapes as the oracle has them, as one volume."""
    match kind:
        case "point":
            return Circles(rows, 0.0)
        case "circle":
            return Circles([row[0] for row in rows], [row[1] for row in rows])
        case "aabb":
            return Aabbs([row[0] for row in rows], [row[1] for row in rows])
        case "segment":
            return Capsules([row[0] for row in rows], [row[1] for row in rows], 0.0)
        case "capsule":
            return Capsules(*([row[k] for row in rows] for k in range(3)))
        case "obb":
            return Obbs.from_corners(rows)
    return Polygons([p for row in rows for p in row], starts_of(rows))


def wrong(kind_a: str, kind_b: str, count: int, seed: int, dim: int = 2) -> list[Any]:
    """Cases that either order decides otherwise than truth does, or that conservative calls apart though they meet."""
    cases = list(adversarial.cases(kind_a, kind_b, count, seed, dim))
    a, b = made(kind_a, [case[1] for case in cases]), made(kind_b, [case[2] for case in cases])
    truth = np.array([exact.meets(kind_a, p, kind_b, q) for _, p, q in cases])
    assert 0.2 < truth.mean() < 0.8
    bad = (overlap(a, b) != truth) | (overlap(b, a) != truth)
    bad |= truth & ~(overlap(a, b, conservative=True) & overlap(b, a, conservative=True))
    return [cases[i] for i in np.flatnonzero(bad)]


@pytest.mark.parametrize(("kind_a", "kind_b", "dim"), ALL_PAIRS)
def test_every_pair_is_decided_as_it_is(kind_a: str, kind_b: str, dim: int) -> None:
    assert wrong(kind_a, kind_b, COUNT, 11, dim) == []


@pytest.mark.long
@pytest.mark.parametrize(("kind_a", "kind_b", "dim"), REST)
def test_every_other_pair_many_times(kind_a: str, kind_b: str, dim: int) -> None:
    assert wrong(kind_a, kind_b, 10_000, 12, dim) == []


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("kind_a", "kind_b"), MANY)
def test_turned_boxes_and_polygons_many_times(kind_a: str, kind_b: str, seed: int) -> None:
    """2 * 10^5 of the pairs of one kind, 10^5 of the mixed one."""
    assert wrong(kind_a, kind_b, 20_000 if kind_a == kind_b else 10_000, 100 + seed) == []


# Closed forms, by arrays


def volume(kind: str, rows: touching.Rows) -> Volumes:
    points, radius = rows
    if kind == "circle":
        return Circles(points[:, 0], radius)
    if kind == "aabb":
        return Aabbs(points[:, 0], points[:, 1])
    return Capsules(points[:, 0], points[:, 1], radius)


def shape(kind: str, rows: touching.Rows, i: int) -> Shape:
    """One row as the slow oracle has it."""
    points, radius = tuple(map(tuple, rows[0][i].tolist())), float(rows[1][i])
    return (points[0], radius) if kind == "circle" else points if kind == "aabb" else (*points, radius)


def wrong_of_many(kind_a: str, kind_b: str, dim: int, count: int, seed: int) -> list[Any]:
    a, b = touching.pairs(np.random.default_rng(seed), kind_a, kind_b, count, dim)
    truth = touching.find_contacts(kind_a, a, kind_b, b)
    one, two = volume(kind_a, a), volume(kind_b, b)
    bad = (overlap(one, two) != truth) | (truth & ~overlap(one, two, conservative=True))
    return [(shape(kind_a, a, i), shape(kind_b, b, i)) for i in np.flatnonzero(bad)[:9]]


@pytest.mark.parametrize(("kind_a", "kind_b", "dim"), CLOSED)
def test_closed_forms(kind_a: str, kind_b: str, dim: int) -> None:
    assert wrong_of_many(kind_a, kind_b, dim, 10_000, 1) == []


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("kind_a", "kind_b", "dim"), CLOSED[:4])
def test_closed_forms_a_million_times(kind_a: str, kind_b: str, dim: int, seed: int) -> None:
    assert wrong_of_many(kind_a, kind_b, dim, 100_000, 1000 + seed) == []


@pytest.mark.parametrize(("kind_a", "kind_b", "dim"), CLOSED)
def test_truth_by_arrays_is_the_slow_truth_and_its_pairs_are_hard(kind_a: str, kind_b: str, dim: int) -> None:
    """Floats are wrong in more than 3 % of those of ordinary size, and both answers are frequent."""
    a, b = touching.pairs(np.random.default_rng(2), kind_a, kind_b, 1500, dim)
    rows = [(shape(kind_a, a, i), shape(kind_b, b, i)) for i in range(1500)]
    truth = [exact.meets(kind_a, p, kind_b, q) for p, q in rows]
    assert touching.find_contacts(kind_a, a, kind_b, b).tolist() == truth
    assert 0.4 < np.mean(truth) < 0.7
    ordinary = [i for i, row in enumerate(rows) if 1e-100 < max(map(abs, exact.leaves(row))) < 1e100]
    floats = [exact.meets_exactly_as(kind_a, kind_b, *rows[i]) for i in ordinary]
    assert np.mean([x != truth[i] for i, x in zip(ordinary, floats, strict=True)]) > 0.03


# Points, bounds and witnesses


@pytest.mark.parametrize("kind", KINDS)
def test_points_of_volumes(kind: str, count: int) -> None:
    cases = list(adversarial.cases("point", kind, count, 13))
    points, volumes = [case[1] for case in cases], made(kind, [case[2] for case in cases])
    truth = [exact.contains_point(kind, shape, point) for _, point, shape in cases]
    assert contains_point(volumes, points).tolist() == truth
    assert contains_point(volumes, points, conservative=True)[truth].all()


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_hold(kind: str, count: int) -> None:
    """Also where they reach beyond the floats."""
    shapes = [case[1] for case in adversarial.cases(kind, "circle", count, 14)]
    if kind in ("circle", "capsule"):
        far = (1.7e308, -1e308)
        shapes += [(*[far] * (len(shapes[0]) - 1), radius) for radius in (0.0, 1e290, 9e306, 9e307, 1.7e308)]
    box = made(kind, shapes).bounds()
    assert np.isinf(box.max).any() == np.isinf(box.min).any() == (kind in ("circle", "capsule"))
    beyond = {np.inf: 2**1025, -np.inf: -(2**1025)}
    for low, high, row in zip(box.min.tolist(), box.max.tolist(), shapes, strict=True):
        assert exact.bounds_hold(tuple(tuple(beyond.get(v, v) for v in p) for p in (low, high)), kind, row)


@pytest.mark.parametrize(("kind_a", "kind_b"), HULL_PAIRS)
def test_a_separating_axis_separates(kind_a: str, kind_b: str, count: int) -> None:
    """A line for exactly the rows that are apart: all of one hull on it or on one side, the other strictly beyond."""
    cases = list(adversarial.cases(kind_a, kind_b, count, 15))
    line = separating_axis(made(kind_a, [case[1] for case in cases]), made(kind_b, [case[2] for case in cases]))
    for (family, a, b), (x0, y0, x1, y1) in zip(cases, line.tolist(), strict=True):
        if exact.meets(kind_a, a, kind_b, b):
            assert np.isnan([x0, y0, x1, y1]).all(), (family, a, b)
            continue
        p, q, *whole = exact.units((x0, y0), (x1, y1), a, b)
        assert p != q, (family, a, b)
        assert exact.separates((q[1] - p[1], p[0] - q[0]), kind_a, whole[0], kind_b, whole[1]), (family, a, b)
        sides = [
            {exact.sign(exact.turn(p, q, v)) for v in exact.core(kind, row)[0]}
            for kind, row in zip((kind_a, kind_b), whole, strict=True)
        ]
        assert any(one <= {0, 1} and two == {-1} for one, two in (sides, sides[::-1])), (family, a, b)


# Sets of parts


def test_box_sets(count: int) -> None:
    """Three boxes of three cases, of which each nearly touches its own circle, capsule or box."""
    for kind in ("circle", "capsule", "aabb", "polygon"):
        cases = list(adversarial.cases("aabb", kind, count, 16))
        lows, highs = ([case[1][k] for case in cases] for k in (0, 1))
        sets = BoxSets(lows, highs, np.arange(0, count, 3))
        for k in range(3):
            others = [cases[i][2] for i in range(k, count, 3)]
            truth = [any(exact.meets("aabb", cases[3 * i + j][1], kind, row) for j in range(3))
                     for i, row in enumerate(others)]  # fmt: skip
            assert overlap(sets, made(kind, others)).tolist() == truth
            assert overlap(made(kind, others), sets).tolist() == truth


def dented(ring: Shape, place: Shape) -> Shape | None:
    """A convex ring with a corner inside it put between its first two: simple, and no longer convex."""
    if len(set(ring)) < 3 or place in ring:
        return None
    corners = exact.hull(ring)
    if any(exact.turn(p, q, place) <= 0 for p, q in exact.edges(corners)) or ring[0] not in corners:
        return None
    return (ring[0], place, *ring[1:])


def meets_ring(ring: Shape, kind: str, other: Shape) -> bool:
    """Whether a simple polygon meets a volume: its outline does, or the volume lies inside as a whole."""
    sides = [*pairwise(ring), (ring[-1], ring[0])]
    if any(exact.meets("segment", side, kind, other) for side in sides):
        return True
    first, *sides = exact.fractions(exact.core(kind, other)[0][0], *sides)
    return exact.odd(first, sides)


@pytest.mark.parametrize("kind", ["point", "circle", "capsule", "aabb", "polygon"])
def test_concave_polygons(kind: str, count: int) -> None:
    """Convex ones with a dent: to a point of the other volume, or to about their middle."""
    rows = []
    for _, ring, other in adversarial.cases("polygon", kind, count, 17, families=FINITE):
        first, *_ = exact.core(kind, other)[0]
        for place in (tuple(first), tuple(np.mean(ring, axis=0).tolist())):
            exact_ring, exact_place = exact.units(ring, place)
            if dented(exact_ring, exact_place) is not None:
                rows.append(((ring[0], place, *ring[1:]), other))
    assert len(rows) > count / 4
    sets = ConcavePolygons.from_concave([p for ring, _ in rows for p in ring], starts_of([ring for ring, _ in rows]))
    truth = [meets_ring(ring, kind, other) for ring, other in rows]
    assert 0.1 < np.mean(truth) < 0.95
    assert overlap(sets, made(kind, [other for _, other in rows])).tolist() == truth


def test_sets_against_sets() -> None:
    """Lattice corners: an L and two boxes, as parts of both and as boxes alone."""
    rng = np.random.default_rng(18)
    n = 300
    p, q = rng.integers(-6, 7, (2, n, 2)).astype(float)
    ell = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]], float)
    sets = ConcavePolygons.from_concave((p[:, None] + ell).reshape(-1, 2), np.arange(n) * 6)
    low = np.stack([q, q + 3], axis=1).reshape(-1, 2)
    boxes = BoxSets(low, low + 2, np.arange(n) * 2)
    same = BoxSets(np.repeat(p, 2, axis=0), np.repeat(p, 2, axis=0) + np.tile([[4, 1], [1, 3]], (n, 1)),
                   np.arange(n) * 2)  # fmt: skip
    truth = [
        any(exact.meets("aabb", r, "aabb", s) for r, s in product(
            [((x, y), (x + 4, y + 1)), ((x, y), (x + 1, y + 3))],
            [((z, w), (z + 2, w + 2)), ((z + 3, w + 3), (z + 5, w + 5))],
        ))
        for (x, y), (z, w) in zip(p.tolist(), q.tolist(), strict=True)
    ]  # fmt: skip
    assert overlap(sets, boxes).tolist() == overlap(boxes, sets).tolist() == overlap(same, boxes).tolist() == truth
    assert 0 < sum(truth) < n
