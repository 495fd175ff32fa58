"""Volumes: what they take and refuse, bounds that contain, moves that keep the original, parts that tile."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from hitplanes import InputError
from hitplanes.planes.volumes.exact import orient2d
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

F = Fraction
L_SHAPE = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]
SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]


def samples() -> dict[str, Volumes]:
    """Three rows of each kind."""
    rng = np.random.default_rng(3)
    p, q, r = rng.normal(0, 9, (3, 2)), rng.normal(0, 9, (3, 2)), rng.uniform(0, 3, 3)
    low, high = np.minimum(p, q), np.maximum(p, q)
    polygons = np.array([[0, 0], [3, 1], [1, 4], *SQUARE, [5, 5], [9, 4], [9, 9]], float) / 3
    return {
        "circles": Circles(p, r),
        "aabbs": Aabbs(low, high),
        "obbs": Obbs.from_center(p, np.abs(q), [0, 30, 77.7]),
        "polygons": Polygons(polygons, [0, 3, 7]),
        "capsules": Capsules(p, q, r),
        "box sets": BoxSets([[0, 0], *low], [[1, 2], *high], [0, 1, 2]),
        "concave": ConcavePolygons.from_concave([*L_SHAPE, *SQUARE, *L_SHAPE[::-1]], [0, 6, 10]),
    }


KINDS = pytest.mark.parametrize("kind", samples())


def cores(v: Volumes) -> list[tuple[list[tuple[float, ...]], float, int]]:
    """Points, radius and row of each part."""
    parts, starts = (v.parts, v.starts) if isinstance(v, Parts) else (v, np.arange(len(v)))
    core = parts.core()
    ends = core.starts + core.counts
    row = np.searchsorted(starts, np.arange(len(parts)), side="right") - 1
    return [
        ([tuple(p) for p in core.points[a:b].tolist()], float(radius), int(i))
        for a, b, radius, i in zip(core.starts, ends, core.radius, row, strict=True)
    ]


def check_bounds(v: Volumes) -> None:
    """Rationally: inside the box, and no farther than one float from it."""
    box = v.bounds()
    assert len(box) == len(v)
    for points, radius, row in cores(v):
        for k in range(v.d):
            low, high = min(F(p[k]) for p in points) - F(radius), max(F(p[k]) for p in points) + F(radius)
            assert F(float(box.min[row, k])) <= low and high <= F(float(box.max[row, k]))
            if not isinstance(v, Parts):
                assert low < F(float(np.nextafter(box.min[row, k], np.inf))) or low == F(float(box.min[row, k]))
                assert F(float(np.nextafter(box.max[row, k], -np.inf))) < high or high == F(float(box.max[row, k]))


@KINDS
def test_bounds_contain_and_are_tight(kind: str) -> None:
    v = samples()[kind]
    for moved in (v, v.translated([1e9 / 3, 0.1]), v.scaled(1e-9), v.rotated(12.3), v.take([2, 0])):
        check_bounds(moved)


def test_bounds_that_are_exact_are_not_widened() -> None:
    box = Circles([[1, 2], [0.1, 0]], [0.5, 0.2]).bounds()
    assert box.min[0].tolist() == [0.5, 1.5] and box.max[0].tolist() == [1.5, 2.5]
    assert F(float(box.max[1, 0])) > F(0.1) + F(0.2) - F(1, 10**18)


@KINDS
def test_rows_are_taken_and_moved(kind: str) -> None:
    v = samples()[kind]
    whole = cores(v)
    assert cores(v.take([1])) == [(p, r, 0) for p, r, i in whole if i == 1]
    assert cores(v.take([])) == [] and len(v.take([])) == 0 and len(v.take([]).bounds()) == 0
    assert len(v.take([2, 2, 0])) == 3
    moved = cores(v.translated([[8, 0], [0, 16], [-4, 0]]))
    shift = {0: (8, 0), 1: (0, 16), 2: (-4, 0)}
    for (p, r, i), (q, s, j) in zip(whole, moved, strict=True):
        assert (r, i) == (s, j)
        assert q == [(x + shift[i][0], y + shift[i][1]) for x, y in p]
    for (p, r, _), (q, s, _) in zip(whole, cores(v.scaled(2)), strict=True):
        assert s == 2 * r and q == [(2 * x, 2 * y) for x, y in p]


@KINDS
def test_each_row_has_its_own_factor_and_angle(kind: str) -> None:
    v = samples()[kind]
    factor, about = [2.0, 0.5, 4.0], [[1, 2], [3, 4], [5, 6]]
    for moved, one in (
        (v.scaled(factor, about), lambda row, i: row.scaled(factor[i], about[i])),
        (v.rotated([10, 20, 30], about), lambda row, i: row.rotated([10, 20, 30][i], about[i])),
    ):
        for i in range(3):
            assert cores(moved.take([i])) == cores(one(v.take([i]), i))


@KINDS
def test_the_original_is_kept(kind: str) -> None:
    v = samples()[kind]
    assert v.original is v
    moved = v.translated(0.1).rotated(33, [1, 2]).scaled(3)
    assert moved.original is v and len(moved) == len(v)
    assert cores(moved.take([1, 0]).original) == cores(v.take([1, 0]))
    assert v.original is v


@KINDS
def test_quarter_turns_are_exact(kind: str) -> None:
    v = samples()[kind]
    for (p, r, i), (q, s, j) in zip(cores(v), cores(v.rotated(90)), strict=True):
        assert (r, i) == (s, j) and sorted(q) == sorted((-y + 0.0, x + 0.0) for x, y in p)
    turned = v.rotated([0, 360, -720])
    assert [(sorted(p), r, i) for p, r, i in cores(turned)] == [(sorted(p), r, i) for p, r, i in cores(v)]


def test_spheres_and_cubes() -> None:
    balls, cubes = Circles([[1, 2, 3]], 2), Aabbs([[0, 0, 0]], [[1, 2, 3]])
    assert balls.translated([1, 0, 0]).bounds().max.tolist() == [[4, 4, 5]]
    assert cubes.scaled(2, [1, 1, 1]).max.tolist() == [[1, 3, 5]]
    check_bounds(balls)
    check_bounds(cubes)
    with pytest.raises(InputError, match="rotated: expected volumes in 2-D"):
        balls.rotated(5)


def test_degenerate_rows_are_valid() -> None:
    check_bounds(Circles([[1, 2]], 0))
    check_bounds(Aabbs([[1, 2], [1, 2]], [[1, 2], [1, 9]]))
    check_bounds(Capsules([[1, 2]], [[1, 2]], 0))
    flat = Obbs.from_center([[1, 2], [1, 2]], [[0, 0], [3, 0]], 45)
    check_bounds(flat)
    assert [len(p) for p, _, _ in cores(flat)] == [1, 2]


def test_turned_boxes_are_the_hull_of_their_corners() -> None:
    bow = Obbs.from_corners([[[0, 0], [2, 2], [2, 0], [0, 2]], [[0, 0], [4, 0], [1, 1], [0, 4]]])
    first, second = (p for p, _, _ in cores(bow))
    assert sorted(first) == [(0, 0), (0, 2), (2, 0), (2, 2)] and sorted(second) == [(0, 0), (0, 4), (4, 0)]
    lined = Obbs.from_corners([[[0, 0], [2, 2], [1, 1], [0, 5]]])
    assert sorted(cores(lined)[0][0]) == [(0, 0), (0, 5), (2, 2)]
    far = Obbs.from_center(np.full((50, 2), 1e12), np.full((50, 2), 1e-4), np.arange(50) * 7.0)
    check_bounds(far)


def random_convex(rng: np.random.Generator, n: int) -> list[list[float]]:
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    return (np.rint(np.stack([np.cos(angles), np.sin(angles)], axis=1) * 1e6)).tolist()


def test_polygons_turn_either_way_and_bear_points_on_edges() -> None:
    rng = np.random.default_rng(1)
    rows: list[Any] = [random_convex(rng, n) for n in range(5, 30)]
    rows += [r[::-1] for r in rows]
    rows += [[[0, 0], [1, 0], [2, 0], [2, 2], [2, 2], [0, 2], [0, 1]], [[0, 0], [0, 0], [2, 0], [0, 2], [0, 0]]]
    starts = np.cumsum([0] + [len(r) for r in rows])[:-1]
    for points, _, row in cores(Polygons(np.concatenate(rows), starts)):
        assert set(points) == {(float(x), float(y)) for x, y in rows[row]}
        a = np.array(points)
        turns = orient2d(a, np.roll(a, -1, axis=0), np.roll(a, -2, axis=0))
        assert turns.min() >= 0 and turns.max() == 1


def test_a_dent_that_rounding_makes_at_a_double_point_is_filled() -> None:
    """Far out two corners become one, inside of the line between their neighbours."""
    near = Polygons([[0, 0], [6.6, 0], [3.4, 3.3], [3.3, 3.4], [0, 6.6]], [0])
    (points, _, _), *_ = cores(near.translated(2.0**52))
    assert sorted((x - 2.0**52, y - 2.0**52) for x, y in points) == [(0, 0), (0, 7), (7, 0)]


STAR = [[0, -20], [12, 16], [-19, -6], [19, -6], [-12, 16]]
BAD_POLYGONS: dict[str, Any] = {
    "two points": [[0, 0], [1, 0]],
    "two distinct": [[0, 0], [1, 0], [1, 0], [0, 0]],
    "one distinct": [[1, 1], [1, 1], [1, 1]],
    "no area": [[0, 0], [1, 1], [3, 3]],
    "there and back": [[0, 0], [1, 0], [2, 0], [1, 0]],
    "a star that winds twice": STAR,
    "twice round": SQUARE + SQUARE,
    "a bow": [[0, 0], [2, 2], [2, 0], [0, 2]],
    "a dent": [[0, 0], [4, 0], [1, 1], [0, 4]],
    "a dent by an ulp": [[0, 0], [1, 0], [float(np.nextafter(1, 0)), 0.5], [1, 1], [0, 1]],
    "a dent at a double point": [[0, 0], [4, 0], [1, 1], [1, 1], [0, 4]],
    "a spike": [[0, 0], [3, 0], [2, 0], [2, 2], [0, 2]],
}


@pytest.mark.parametrize("name", BAD_POLYGONS)
def test_polygons_that_are_refused(name: str) -> None:
    good = [[0, 0], [1, 0], [0, 1]]
    with pytest.raises(InputError, match="row 1"):
        Polygons([*good, *BAD_POLYGONS[name]], [0, 3])
    if "dent" not in name:
        with pytest.raises(InputError, match="row 1"):
            ConcavePolygons.from_concave([*good, *BAD_POLYGONS[name]], [0, 3])


def area2(points: Any) -> Fraction:
    exact = [(F(float(x)), F(float(y))) for x, y in points]
    return sum((a[0] * b[1] - b[0] * a[1] for a, b in zip(exact, exact[1:] + exact[:1], strict=True)), F(0))


def combs(rng: np.random.Generator, n: int) -> list[list[float]]:
    """A comb with teeth of any depth, points on its edges, and corners that line up."""
    top = [[float(i), float(rng.integers(1, 4) if i % 2 else -rng.integers(1, 4))] for i in range(n)]
    return [*top, [n - 1.0, 9.0], [(n - 1) / 2, 9.0], [0.0, 9.0], [0.0, 8.0]]


@pytest.mark.parametrize("seed", range(12))
def test_concave_polygons_are_tiled_by_their_parts(seed: int) -> None:
    """Areas add up exactly, every part turns one way, and every part's points are the polygon's."""
    rng = np.random.default_rng(seed)
    rows: list[Any] = [combs(rng, int(rng.integers(3, 14))) for _ in range(4)]
    wave = rng.uniform(0.2, 1, 25) * 1e3
    turn = np.arange(25) / 25 * 2 * np.pi
    rows += [np.stack([wave * np.cos(turn), wave * np.sin(turn)], axis=1).tolist(), L_SHAPE, SQUARE]
    rows = [r[::-1] if seed % 2 else r for r in rows]
    starts = np.cumsum([0] + [len(r) for r in rows])[:-1]
    sets = ConcavePolygons.from_concave(np.concatenate(rows), starts)
    total = [F(0)] * len(rows)
    for points, _, row in cores(sets):
        assert area2(points) > 0 and {tuple(map(float, p)) for p in points} <= {tuple(map(float, p)) for p in rows[row]}
        total[row] += area2(points)
    assert total == [abs(area2(row)) for row in rows]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Circles([[0, 0]], -1), r"radius\[0\]: expected 0 or more"),
        (lambda: Circles([[0, np.nan]], 1), r"center\[0\]\[1\]: expected a finite number"),
        (lambda: Circles([[0, 0, 0, 0]], 1), r"center: expected shape \(any, 2\)"),
        (lambda: Aabbs([[0, 1]], [[1, 0]]), r"max\[0\]\[1\]: expected 1.0 or more"),
        (lambda: Obbs.from_center([[0, 0]], [[1, -1]], 0), "half_wh: expected numbers of 0 or more"),
        (lambda: Polygons([[0, 0], [1, 0], [0, 1]], [1]), "starts: expected 0 and then numbers that grow"),
        (lambda: Polygons([[0, 0], [1, 0], [0, 1]], []), "starts: expected 0"),
        (lambda: BoxSets([[0, 0]] * 2, [[1, 1]] * 2, [0, 0]), "starts: expected 0 and then numbers that grow"),
        (lambda: Circles([[0, 0]], 1).scaled(0), "s: expected a number above 0"),
        (lambda: Circles([[1e308, 0]], 1).translated([1e308, 0]), "center.*expected a finite number"),
        (lambda: Obbs([(0, 0)]), r"Obbs: expected Obbs.from_center\(.*\) or Obbs.from_corners\(corners\)"),
        (lambda: Obbs(center=[(0, 0)]), "Obbs: expected Obbs.from_center"),
        (lambda: Polygons([(0, 0)], [0]), "three distinct points or more in row 0, got 1$"),
        (lambda: ConcavePolygons([(0, 0), (2, 2)], [0]), "row 0: points: expected three or more, got 2"),
        (lambda: Parts([Circles([[0, 0]], 1)], [0]), "parts: expected volumes of one kind, got list"),  # type: ignore[arg-type]
    ],
)
def test_bad_volumes_are_named(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message), np.errstate(over="ignore"):
        make()


def test_concave_polygons_are_made_as_polygons_are() -> None:
    made, same = ConcavePolygons(L_SHAPE, [0]), ConcavePolygons.from_concave(L_SHAPE, [0])
    assert isinstance(made, ConcavePolygons) and cores(made) == cores(same) and len(made.parts) > 1
    assert len(ConcavePolygons(np.zeros((0, 2)), [])) == 0


def test_they_say_what_they_are_in_a_few_words() -> None:
    assert repr(Circles(np.zeros((5, 3)), 1)) == "<Circles: 5 rows in 3-D>"
    assert [repr(v) for v in samples().values()][-2:] == [
        "<BoxSets: 3 rows in 2-D>",
        "<ConcavePolygons: 3 rows in 2-D>",
    ]


def test_bounds_beyond_the_floats_are_known_by_their_rows() -> None:
    box = Circles([[0, 0], [1.7e308, 0]], [1, 1.7e308]).bounds()
    assert box.beyond().tolist() == [1] == box.bounds().beyond().tolist()
    assert Parts(box.take([0]), [0]).beyond().tolist() == [] == Circles([[1.7e308, 0]], [1.7e308]).beyond().tolist()
    assert BoxSets([[0, 0]], [[1, 1]], [0]).bounds().beyond().tolist() == []
    sets = Parts(Circles([[0, 0], [1.7e308, 0], [0, 0]], [1, 1.7e308, 2]).bounds(), [0, 1])
    assert sets.beyond().tolist() == [1] == sets.bounds().beyond().tolist()
