"""Laws over the whole table of pairs, rows by hand, and closed forms against points and a radius."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from some_of import some_of

from hitplanes import InputError
from hitplanes.planes.volumes import overlap as overlap_module
from hitplanes.planes.volumes.exact import orient2d
from hitplanes.planes.volumes.overlap import TABLE, contains_point, overlap, separating_axis
from hitplanes.planes.volumes.volumes import (
    Aabbs,
    BoxSets,
    Capsules,
    Circles,
    ConcavePolygons,
    Obbs,
    Parts,
    Polygons,
    Volumes,
)

L_SHAPE = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def ordinary(kind: str, n: int, rng: np.random.Generator) -> Any:
    """Rows on a coarse lattice: many touch, some are degenerate."""
    p, q = (rng.integers(-6, 7, (n, 2)).astype(float) for _ in range(2))
    r = rng.integers(0, 4, n).astype(float)
    if kind == "circles":
        return Circles(p, r)
    if kind == "aabbs":
        return Aabbs(np.minimum(p, q), np.maximum(p, q))
    if kind == "obbs":
        along, across = rng.integers(-3, 4, (n, 2)), rng.integers(0, 3, (n, 1))
        other = np.stack([-along[:, 1], along[:, 0]], axis=1) * across
        corners = [p, p + along, p + along + other, p + other]
        return Obbs.from_corners(np.stack(corners, axis=1))
    if kind == "polygons":
        shapes = np.array([[[0, 0], [3, 1], [1, 4]], [[0, 0], [0, 5], [1, 0]], [[0, 0], [-2, 2], [0, 1]]])
        return Polygons((p[:, None] + shapes[rng.integers(0, 3, n)]).reshape(-1, 2), np.arange(n) * 3)
    if kind == "capsules":
        return Capsules(p, q, r)
    if kind == "box sets":
        low = np.stack([np.minimum(p, q), p], axis=1).reshape(-1, 2)
        high = np.stack([np.maximum(p, q), p + 1], axis=1).reshape(-1, 2)
        return BoxSets(low, high, np.arange(n) * 2)
    return ConcavePolygons.from_concave((p[:, None] + L_SHAPE).reshape(-1, 2), np.arange(n) * 6)


SINGLE = ["circles", "aabbs", "obbs", "polygons", "capsules"]
KINDS = [*SINGLE, "box sets", "concave"]
PAIRS = pytest.mark.parametrize(("one", "other"), some_of(product(KINDS, KINDS)))

ROWS = 160
"""Pairs of each two kinds."""


def test_the_table_has_fifteen_pairs_both_ways_round() -> None:
    assert len(TABLE) == 25 and len({frozenset(pair) for pair in TABLE}) == 15


def two(one: str, other: str, seed: int = 7) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    return ordinary(one, ROWS, rng), ordinary(other, ROWS, rng)


@PAIRS
def test_symmetric(one: str, other: str) -> None:
    a, b = two(one, other)
    found = overlap(a, b)
    assert found.dtype == np.bool_ and found.shape == (ROWS,) and 0 < found.sum() < ROWS
    assert (overlap(b, a) == found).all() and overlap(a, a).all()


@PAIRS
def test_moved_by_whole_numbers_turned_and_scaled_alike(one: str, other: str) -> None:
    a, b = two(one, other)
    found = overlap(a, b)
    for by in ([2**40, -7], [-(10**9), 10**12], [3, 5]):
        assert (overlap(a.translated(by), b.translated(by)) == found).all()
    assert (overlap(a.rotated(90), b.rotated(90)) == found).all()
    p, q = a.take(range(40)), b.take(range(40))
    found = overlap(p, q)
    for factor in (2.0**-60, 2.0**-1040, 2.0**600, 2.0**1015):
        assert (overlap(p.scaled(factor), q.scaled(factor)) == found).all()


@PAIRS
def test_conservative_never_says_no_to_what_overlaps(one: str, other: str) -> None:
    a, b = two(one, other)
    a, b = a.take(range(40)), b.take(range(40))
    for factor, by in ((1.0, 0.0), (0.1, 0.0), (0.1, 1e9 + 0.1), (2.0**-1040, 0.0), (2.0**1015, 0.0)):
        p, q = (v.scaled(factor).translated(by) for v in (a, b))
        assert (overlap(p, q, conservative=True) | ~overlap(p, q)).all()


@PAIRS
def test_conservative_is_right_where_nothing_is_near(one: str, other: str) -> None:
    a, b = two(one, other)
    near, far = a.translated([1e-3, 2e-3]), overlap(a, b.translated([500, 300]), conservative=True)
    assert (overlap(near, b, conservative=True) == overlap(near, b)).mean() > 0.95
    assert not far.any()


@PAIRS
def test_rows_broadcast(one: str, other: str) -> None:
    a, b = two(one, other)
    for k in (5, 17):
        assert (overlap(a.take([k]), b) == overlap(a.take([k] * ROWS), b)).all()
        assert (overlap(a, b.take([k])) == overlap(a, b.take([k] * ROWS))).all()
    assert overlap(a.take([]), b.take([])).shape == (0,) == overlap(a.take([]), b.take([5])).shape
    assert overlap(a.take([3]), b.take([4])).shape == (1,)


def at_origin(kind: str, s: int) -> Any:
    """Of which the origin is the only place that lies farthest toward (3 s, 4 s), or one of a side."""
    box: Any = [[-2, -3], [0, 0]] if s > 0 else [[0, 0], [2, 3]]
    side = np.array([[-4, 3], [4, -3]])
    if kind == "circles":
        return Circles([[-3 * s, -4 * s]], 5)
    if kind == "aabbs":
        return Aabbs(box[:1], box[1:])
    if kind == "obbs":
        return Obbs.from_corners([[*side, *(side[::-1] - np.array([3, 4]) * s)]])
    if kind == "polygons":
        return Polygons([[0, 0], [-3 * s, -s], [-s, -5 * s]], [0])
    if kind == "capsules":
        return Capsules(side[:1] - np.array([3, 4]) * s, side[1:] - np.array([3, 4]) * s, 5)
    if kind == "box sets":
        return BoxSets([box[0], np.array(box[0]) - 9 * s], [box[1], np.array(box[1]) - 9 * s], [0])
    return ConcavePolygons.from_concave([[0, 0], [-4 * s, s], [-s, -s], [s, -4 * s]], [0])


@PAIRS
def test_touching_counts(one: str, other: str) -> None:
    """In one point, where neither side need be along an axis; apart by 2^-30, they do not touch."""
    a, b = at_origin(one, 1), at_origin(other, -1)
    for by in ([0, 0], [2**20, -5]):
        p, q = a.translated(by), b.translated(by)
        assert overlap(p, q).all() and overlap(q, p).all() and overlap(p, q, conservative=True).all()
        away = q.translated([3 * 2.0**-30, 4 * 2.0**-30])
        assert not overlap(p, away).any() and not overlap(away, p).any()
        assert not overlap(p, away, conservative=True).any()


def same_as(kind: str, a: Any) -> list[Any]:
    """The same rows as other kinds of volumes."""
    rows = np.arange(len(a))
    if kind == "circles":
        return [Capsules(a.center, a.center, a.radius)]
    if kind == "aabbs":
        boxes = [Obbs.from_corners(a.corners()), BoxSets(a.min, a.max, rows), a.rotated(0)]
        solid = (a.min < a.max).all(axis=1)
        return [*boxes, Polygons(a.corners().reshape(-1, 2), rows * 4)] if solid.all() else boxes
    if kind == "polygons":
        return [ConcavePolygons.from_concave(a.points, a.starts), Parts(a, rows)]
    return [Parts(a, rows)]


@pytest.mark.parametrize(("one", "other"), some_of(product(SINGLE, KINDS)))
def test_closed_and_general_forms_agree(one: str, other: str) -> None:
    """A circle is a capsule without length; a box is a turned box, a polygon, and a set of one."""
    a, b = two(one, other, 8)
    solid = np.flatnonzero((a.bounds().min < a.bounds().max).all(axis=1))
    for rows in (np.arange(ROWS), solid):
        for same in same_as(one, a.take(rows)):
            assert (overlap(same, b.take(rows)) == overlap(a, b)[rows]).all()


@pytest.mark.parametrize(
    ("one", "other"), list(product(["aabbs", "obbs", "polygons", "box sets", "concave"], repeat=2))
)
def test_shapely_agrees_where_it_is_exact(one: str, other: str) -> None:
    """Areas on whole numbers; it takes no box without an area."""
    shapely = pytest.importorskip("shapely")

    def areas(volume: Any) -> tuple[Any, Any]:
        """One shape a row, and whether all parts of it have areas."""
        parts, starts = (volume.parts, volume.starts) if isinstance(volume, Parts) else (volume, np.arange(len(volume)))
        core = parts.core()
        ends = core.starts + core.counts
        rings = [
            core.points[k:m] if m - k > 2 else core.points[[k] * 3] for k, m in zip(core.starts, ends, strict=True)
        ]
        shapes = np.array([shapely.Polygon(ring) for ring in rings])
        solid = np.logical_and.reduceat(shapely.area(shapes) > 0, starts)
        return np.array([shapely.union_all(row) for row in np.split(shapes, starts[1:])]), solid

    a, b = two(one, other, 9)
    (p, solid), (q, solid_too) = areas(a), areas(b)
    good = solid & solid_too
    assert good.sum() > 60
    assert (shapely.intersects(p, q) == overlap(a, b))[good].all()


@PAIRS
def test_what_shares_a_point_overlaps(one: str, other: str) -> None:
    """A lattice point in both proves that they overlap."""
    rng = np.random.default_rng(9)
    a, b = ordinary(one, 40, rng), ordinary(other, 40, rng)
    lattice = np.array(list(product(range(-9, 10), repeat=2)), float)
    rows, points = np.repeat(np.arange(40), len(lattice)), np.tile(lattice, (40, 1))
    both = contains_point(a.take(rows), points) & contains_point(b.take(rows), points)
    shared = both.reshape(40, -1).any(axis=1)
    assert overlap(a, b)[shared].all() and shared.any()


def wholly(a: Any, b: Any) -> Any:
    """Where the box around a lies in a box b."""
    box = a.bounds()
    return ((b.min <= box.min) & (box.max <= b.max)).all(axis=1)


@pytest.mark.parametrize("kind", KINDS)
def test_containment_implies_overlap(kind: str) -> None:
    rng = np.random.default_rng(4)
    a, big = ordinary(kind, 200, rng), Aabbs(np.full((200, 2), -8.0), np.full((200, 2), 8.0))
    inside = wholly(a, big)
    assert inside.sum() > 20
    around = [big, Obbs.from_corners(big.corners()), Polygons(big.corners().reshape(-1, 2), np.arange(200) * 4),
              Circles(np.zeros((200, 2)), 12.0), Capsules(np.zeros((200, 2)), np.ones((200, 2)), 12.0)]  # fmt: skip
    for volume in around:
        assert overlap(a, volume)[inside].all() and overlap(volume, a)[inside].all()


@pytest.mark.parametrize(("one", "two"), list(product(SINGLE, SINGLE)))
def test_closed_forms_agree_with_points_and_a_radius(one: str, two: str) -> None:
    """By distances of edges alone, with a look for a point of one inside the other."""
    rng = np.random.default_rng(11)
    a, b = ordinary(one, 2000, rng), ordinary(two, 2000, rng)
    rows = np.arange(2000)
    first, second = a.core(), b.core()
    general = overlap_module._near(first, second, rows, False)
    for hull, other in ((first, second), (second, first)):
        if (hull.counts > 2).any():
            general |= overlap_module._holds(hull, other, rows, False)
    assert (overlap(a, b) == general).all()


def ulp(value: float, steps: int) -> float:
    for _ in range(abs(steps)):
        value = float(np.nextafter(value, np.inf if steps > 0 else -np.inf))
    return value


def point_like(x: float, y: float) -> list[Volumes]:
    p: Any = [[x, y]]
    return [Circles(p, 0), Aabbs(p, p), Obbs.from_center(p, [[0, 0]], 0), Capsules(p, p, 0)]


@pytest.mark.parametrize("other", range(4))
def test_touching_counts_to_the_ulp(other: int) -> None:
    """Single points of each kind against an edge at x = 3: an ulp farther they are apart."""
    shapes = [
        Circles([[0, 0]], 3),
        Aabbs([[0, -1]], [[3, 1]]),
        Obbs.from_center([[2, 0]], [[1, 1]], 90),
        Polygons([[0, 0], [3, -3], [3, 3]], [0]),
        Capsules([[-5, 0]], [[1, 0]], 2),
        BoxSets([[-9, -9], [0, -1]], [[-8, -8], [3, 1]], [0]),
        ConcavePolygons.from_concave([[0, 0], [3, -3], [3, 3], [2, 0]], [0]),
    ]
    for shape in shapes[:6]:
        for steps in (-2, -1, 0, 1, 2):
            assert overlap(shape, point_like(ulp(3.0, steps), 0)[other]).tolist() == [steps <= 0]
    for x, y, inside in ((2.0, 1.0, False), (2.0, 0.0, True), (2.9, 2.5, True)):
        assert overlap(point_like(x, y)[other], shapes[6]).tolist() == [inside]


def test_degenerate_rows() -> None:
    """Flat boxes and zero-length capsules on one line: they meet, touch, or are apart."""

    def kinds(x0: float, x1: float) -> list[Volumes]:
        low: Any = [[x0, x0]]
        high: Any = [[x1, x1]]
        turned = Obbs.from_corners([[*low, *high, *high, *low]])
        return [turned, Capsules(low, high, 0)]

    for (x0, x1), meets in (((4, 6), True), ((3, 6), True), ((5, 5), False), ((4, 4), True), ((7, 9), False)):
        for a, b in product(kinds(0, 4), kinds(x0, x1)):
            assert overlap(a, b).tolist() == [meets] == overlap(b, a).tolist()
    flat = Aabbs([[0, 1]], [[9, 1]])
    for wall in (Aabbs([[5, 0]], [[5, 2]]), Capsules([[5, 0]], [[5, 1]], 0), Obbs.from_center([[5, 0]], [[1, 0]], 90)):
        assert overlap(flat, wall).all() and not overlap(flat.translated([0, 1.5]), wall).any()


def test_a_turned_box_with_a_double_corner_has_an_area() -> None:
    box = Obbs.from_corners([[[0, 0], [0, 0], [4, 0], [0, 4]]])
    assert contains_point(box, [1, 1]).all() and overlap(box, Capsules([[1, 1]], [[1.5, 1]], 0.1)).all()


def test_parallel_slivers() -> None:
    """Two thin triangles whose long sides are an ulp apart far from the origin."""
    base = np.array([[0, 0], [1e12, 1], [0, 1]])
    a = Polygons(base, [0])
    for steps, meets in ((0, True), (1, False)):
        b = Polygons([[0, ulp(-0.0, -steps)], [1e12, ulp(1.0, -steps)], [1e12, -5]], [0])
        assert overlap(a, b).tolist() == [meets]


def test_spheres_and_cubes() -> None:
    balls, cubes = Circles([[0, 0, 0], [5, 2, 3]], [1, 3]), Aabbs([[1, 0, 0], [0, 0, 0]], [[2, 2, 2], [2, 1, 1]])
    assert overlap(balls, cubes).tolist() == [True, False]
    assert overlap(cubes, balls).tolist() == [True, False]
    assert overlap(cubes, cubes.take([1, 0])).tolist() == [True, True]
    assert contains_point(balls, [1, 0, 0]).tolist() == [True, False]


def test_separating_axis_is_a_witness() -> None:
    rng = np.random.default_rng(2)
    for one, two in product(("aabbs", "polygons"), ("obbs", "polygons")):
        a, b = ordinary(one, ROWS, rng), ordinary(two, ROWS, rng)
        line = separating_axis(a, b)
        apart = ~np.isnan(line[:, 0])
        assert not overlap(a, b)[apart].any() and 0 < apart.sum() < ROWS
        assert (apart == ~overlap(a, b)).all()
        for i in np.flatnonzero(apart).tolist():
            sides = [orient2d(line[i, :2], line[i, 2:], v.take([i]).core().points) for v in (a, b)]
            ends = [(s.min(), s.max()) for s in sides]
            assert (ends[0][0] >= 0 and ends[1][1] < 0) or (ends[1][0] >= 0 and ends[0][1] < 0)


def test_a_separating_axis_of_what_no_edge_parts() -> None:
    """Points, and segments on one line: along x or y through what comes first."""
    low: Any = [[0, 0], [0, 0], [0, 0], [4, 4], [2, 7]]
    high: Any = [[0, 0], [2, 0], [0, 2], [4, 4], [2, 7]]
    others: Any = [[3, 5], [3, 0], [0, 3], [3, 4], [2, 6]]
    found = separating_axis(Aabbs(low, high), Aabbs(others, others))
    assert found.tolist() == [[1, 0, 0, 0], [2, 0, 2, 1], [1, 2, 0, 2], [4, 1, 4, 0], [0, 7, 1, 7]]
    slanted = Obbs.from_corners([[[0, 0], [2, 2]] * 2]), Obbs.from_corners([[[3, 3], [5, 5]] * 2])
    assert separating_axis(*slanted).tolist() == [[1, 2, 0, 2]]
    assert np.isnan(separating_axis(slanted[0], slanted[0])).all()


def on_an_edge(n: int, rng: np.random.Generator) -> tuple[Any, Any]:
    """Triangles, and others beyond the line of an edge but for a corner, which lies on it but for rounding."""
    a = rng.uniform(-1, 1, (n, 3, 2))
    along = a[:, 1] - a[:, 0]
    out = np.stack([along[:, 1], -along[:, 0]], axis=1)
    out *= -np.sign((out * (a[:, 2] - a[:, 0])).sum(axis=1))[:, None]
    place = a[:, 0] + rng.uniform(0, 1, (n, 1)) * along
    b = [place, *(place + out * rng.uniform(0.1, 2, (n, 1)) + along * rng.uniform(-1, 1, (n, 1)) for _ in range(2))]
    rows = np.arange(n) * 3
    return Polygons(a.reshape(-1, 2), rows), Polygons(np.stack(b, axis=1).reshape(-1, 2), rows)


@pytest.mark.parametrize("scale", [1.0, 2.0**-533, 2.0**-537])
@pytest.mark.parametrize("grown", [False, True])
def test_floats_are_never_sure_of_what_is_not_so(grown: bool, scale: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Corners on edges, circles that touch edges: the same with floats that are sure of nothing.

    Also where products of two lengths are a few of the least floats.
    """
    a, b = on_an_edge(12_000 if scale == 1 else 3_000, np.random.default_rng(6))
    if grown:
        p, q = a.points[::3], a.points[1::3]
        along = q - p
        place = p + along * 0.3
        out = np.stack([along[:, 1], -along[:, 0]], axis=1) * np.geomspace(1e-9, 1, len(p))[:, None]
        b = Circles(place + out, np.sqrt((out * out).sum(axis=1)))
    a, b = a.scaled(scale), b.scaled(scale)
    found = [overlap(a, b), overlap(b, a), overlap(a, b, conservative=True)]
    monkeypatch.setattr(overlap_module, "hulls_sign", lambda one, two, rows: np.zeros(len(rows), np.int8))
    truth = overlap(a, b)
    assert 0.3 < truth.mean() < 0.9
    assert (found[0] == truth).all() and (found[1] == truth).all() and found[2][truth].all()


def test_a_row_that_found_its_axis_leaves_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three edges one corner of the other says that they do not part, of the fourth four say that it does."""
    rows = 0

    def counted(*points: Any) -> Any:
        nonlocal rows
        rows += len(points[0])
        return orient2d(*points)

    monkeypatch.setattr(overlap_module, "hulls_sign", lambda one, two, rows: np.zeros(len(rows), np.int8))
    monkeypatch.setattr(overlap_module, "orient2d", counted)
    a = Obbs.from_corners(np.tile(CORNERS * 1.0, (1000, 1, 1)))
    slanted = np.array([[0, -3], [3, 0], [0, 3], [-3, 0]]) + 3.5
    b = Obbs.from_corners(np.tile(slanted, (1000, 1, 1)))
    assert not overlap(b, a).any()
    assert rows == 1000 * (3 + 4)


ONE_BOX = Aabbs([[0, 0]], [[1, 1]])
BEYOND = Circles([[0, 0], [1.7e308, 0]], [1, 1.7e308]).bounds()

BAD: list[tuple[Callable[[], Any], str]] = [
    (lambda: overlap(Circles([[0, 0]] * 2, 1), Circles([[0, 0]] * 3, 1)), "b: expected 2 rows or 1, got 3"),
    (lambda: overlap(Circles([[0, 0]], 1), Circles([[0, 0, 0]], 1)), "b: expected volumes in 2-D, got 3-D"),
    (lambda: overlap([1, 2], Circles([[0, 0]], 1)), "a: expected volumes, got list"),  # type: ignore[arg-type]
    (lambda: separating_axis(ONE_BOX, Circles([[0, 0]], 1)), "^b: expected boxes or polygons in 2-D, got Circles"),
    (lambda: separating_axis(Circles([[0, 0]], 1), ONE_BOX), "^a: expected boxes or polygons in 2-D, got Circles"),
    (lambda: separating_axis(ONE_BOX, Aabbs([[0] * 3], [[1] * 3])), "^b: .* in 2-D, got Aabbs in 3-D"),
    (lambda: separating_axis(ONE_BOX, 5), "^b: expected volumes, got int"),  # type: ignore[arg-type]
    (lambda: contains_point(ONE_BOX, [np.nan, 0]), r"^xy\[0\]: expected a finite number, got nan"),
    (lambda: contains_point(ONE_BOX, [[0, 0], [0, np.inf]]), r"^xy\[1\]\[1\]: expected a finite number, got inf"),
    (lambda: contains_point(ONE_BOX, [1, 2, 3]), r"^xy: expected shape \(2,\), got \(3,\)"),
    (lambda: contains_point(ONE_BOX.take([0, 0]), [[1, 2]] * 3), "^xy: expected 2 rows or 1, got 3"),
    (lambda: contains_point([1], [1, 2]), "^volume: expected volumes, got list"),  # type: ignore[arg-type]
    (lambda: contains_point(ONE_BOX, [1, 2], "no"), "^conservative: expected true"),  # type: ignore[arg-type]
    (lambda: overlap(ONE_BOX, ONE_BOX, "no"), "^conservative: expected true or false"),  # type: ignore[arg-type]
    (lambda: overlap(BEYOND, ONE_BOX), "^a: expected finite volumes, got bounds beyond the floats in row 1"),
    (lambda: overlap(Obbs.from_corners(ONE_BOX.corners()), BEYOND), "^b: expected finite volumes"),
    (lambda: overlap(Parts(BEYOND, [0]), ONE_BOX), "^a: expected finite volumes"),
    (lambda: contains_point(BEYOND, [1, 2]), "^volume: expected finite volumes"),
    (lambda: separating_axis(ONE_BOX, BEYOND), "^b: expected finite volumes"),
]


@pytest.mark.parametrize(("call", "message"), BAD)
def test_bad_input_is_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
