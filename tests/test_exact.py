"""Signs against rational arithmetic, where floats fail: within ulps of touching, far out, tiny, huge, degenerate."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from some_of import in_turn

from hitplanes import InputError
from hitplanes.planes.common.limits import CHUNK_ROWS
from hitplanes.planes.volumes import exact as exact_module
from hitplanes.planes.volumes.exact import circles_sign, orient2d, orient3d, point_segment_sign, segment_segment_sign

F = Fraction
Arrays = list[npt.NDArray[np.float64]]
Rows = tuple[Any, ...]


def sign(value: Fraction | int) -> int:
    return (value > 0) - (value < 0)


def rational(row: Rows) -> list[Any]:
    """The floats of one row as fractions, points as lists."""
    return [F(float(v)) if np.ndim(v) == 0 else [F(float(c)) for c in v] for v in row]


def minus(p: list[Fraction], q: list[Fraction]) -> list[Fraction]:
    return [x - y for x, y in zip(p, q, strict=True)]


def dot(p: list[Fraction], q: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(p, q, strict=True)), F(0))


def turn(a: Any, b: Any, c: Any) -> Fraction:
    (px, py), (qx, qy) = minus(b, a), minus(c, a)
    return px * qy - py * qx


def distance2(p: Any, a: Any, b: Any) -> Fraction:
    """Squared distance to a segment, by the point nearest to p."""
    d = minus(b, a)
    t = min(max(dot(minus(p, a), d) / dot(d, d), F(0)), F(1)) if any(d) else F(0)
    return dot(v := minus(p, [x + t * y for x, y in zip(a, d, strict=True)]), v)


def true_orient2d(a: Any, b: Any, c: Any) -> int:
    return sign(turn(a, b, c))


def true_orient3d(a: Any, b: Any, c: Any, d: Any) -> int:
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = (minus(v, d) for v in (a, b, c))
    return sign(a0 * (b1 * c2 - b2 * c1) - a1 * (b0 * c2 - b2 * c0) + a2 * (b0 * c1 - b1 * c0))


def true_circles(c1: Any, r1: Any, c2: Any, r2: Any) -> int:
    return sign(dot(v := minus(c1, c2), v) - (r1 + r2) ** 2)


def true_point_segment(p: Any, a: Any, b: Any, r: Any, r2: Any) -> int:
    return sign(distance2(p, a, b) - (r + r2) ** 2)


def true_segment_segment(a: Any, b: Any, c: Any, d: Any, r: Any, r2: Any) -> int:
    crossing = turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
    nearest = min(distance2(*row) for row in ((a, c, d), (b, c, d), (c, a, b), (d, a, b)))
    return sign((F(0) if crossing else nearest) - (r + r2) ** 2)


PREDICATES: dict[Callable[..., Any], Callable[..., int]] = {
    orient2d: true_orient2d,
    orient3d: true_orient3d,
    circles_sign: true_circles,
    point_segment_sign: true_point_segment,
    segment_segment_sign: true_segment_segment,
}
CASES = list(PREDICATES)

LENGTHS = {
    "ordinary": (1.0, 0.0),
    "offset 1e6": (1.0, 1e6),
    "offset 1e12": (1.0, 1e12),
    "subnormal": (5e-324, 0.0),
    "near underflow of squares": (1e-155, 0.0),
    "1e-145": (1e-145, 0.0),
    "1e150": (1e150, 0.0),
    "overflow": (1e304, 0.0),
}


def nudged(rng: np.random.Generator, values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Move by up to three ulp either way; most stay."""
    steps = rng.integers(-3, 4, values.shape) * (rng.random(values.shape) < 0.4)
    for k in range(3):
        values = np.where(np.abs(steps) > k, np.nextafter(values, np.inf * np.where(steps > 0, 1, -1)), values)
    return values


def touching(rng: np.random.Generator, predicate: Callable[..., Any], n: int, ratio: float) -> Arrays:
    """Rows that touch but for rounding: on one line or plane, at the distance of the radii."""
    a, d = rng.integers(-40, 40, (n, 2)).astype(float), rng.integers(-9, 9, (n, 2)) * ratio
    along = (rng.integers(-2, 5, n) / rng.choice([1.0, 2.0, 3.0, 7.0], n))[:, None]
    b, on = a + d, a + along * d
    triple = np.array([(3, 4, 5), (5, 12, 13), (8, 15, 17), (20, 21, 29), (0, 1, 1), (1, 0, 1)])[rng.integers(0, 6, n)]
    away, r = triple[:, :2] * rng.choice([-1, 1], (n, 2)), triple[:, 2].astype(float)
    part = rng.choice([0.0, 0.25, 1 / 3, 0.1, 1e-12], n)
    if predicate is orient2d:
        return [a, b, on]
    if predicate is orient3d:
        base, u, v = (rng.integers(-9, 9, (n, 3)).astype(float) for _ in range(3))
        s, t = rng.uniform(-2, 2, (2, n, 1))
        return [base, base + u * ratio, base + v, base + s * u + t * v]
    if predicate is circles_sign:
        return [a, r * part, a + away, r - r * part]
    normal = np.stack([-d[:, 1], d[:, 0]], axis=1) / np.maximum(np.sqrt((d * d).sum(axis=1)), 1e-300)[:, None]
    side = np.where(rng.random((n, 1)) < 0.5, normal * r[:, None], away)
    still = rng.random(n) < 0.3
    side, r = np.where(still[:, None], 0.0, side), np.where(still, 0.0, r)
    if predicate is point_segment_sign:
        return [on + side, a, b, r * part, r - r * part]
    return [a, b, on + side, on + side + rng.integers(-3, 4, (n, 1)) * side + rng.integers(-1, 2, (n, 1)) * d,
            r * part, r - r * part]  # fmt: skip


def family(predicate: Callable[..., Any], n: int, seed: int, length: float, offset: float, ratio: float) -> Arrays:
    rng = np.random.default_rng(seed)
    arrays = [v * length + (offset if v.ndim == 2 else 0) for v in touching(rng, predicate, n, ratio)]
    return [np.abs(v) if v.ndim == 1 else v for v in (nudged(rng, v) for v in arrays)]


def wrong(predicate: Callable[..., Any], arrays: Arrays) -> list[int]:
    got = predicate(*arrays)
    truth = [PREDICATES[predicate](*rational(row)) for row in zip(*arrays, strict=True)]
    assert got.dtype == np.int8 and got.shape == (len(truth),)
    return np.flatnonzero(got != truth).tolist()


@pytest.mark.parametrize(("length", "ratio"), in_turn(LENGTHS, [1.0, 1e6, 1e12, 1e-12]))
@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_signs_are_exact_within_three_ulp(predicate: Callable[..., Any], length: str, ratio: float) -> None:
    scale, offset = LENGTHS[length]
    if scale * ratio > 1e304:
        pytest.skip("not finite")
    assert wrong(predicate, family(predicate, 80, 1, scale, offset, ratio)) == []


@pytest.mark.long
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_many_signs_are_exact(predicate: Callable[..., Any], length: str) -> None:
    scale, offset = LENGTHS[length]
    for seed, ratio in enumerate((1.0, 3.7, 1e6, 1e12, 1e-12)):
        if scale * ratio <= 1e304:
            assert wrong(predicate, family(predicate, 2_000, seed + 2, scale, offset, ratio)) == []


@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_any_floats_at_all(predicate: Callable[..., Any]) -> None:
    """Exponents over the whole range, in one row, and rows of few values that meet by chance."""
    rng = np.random.default_rng(5)
    for exponents in ((-1074, 1020), (-600, -400), (400, 540), (-2, 2)):
        shapes = [v.shape for v in touching(rng, predicate, 300, 1.0)]
        arrays = [np.ldexp(rng.integers(-4, 5, s) / 4, rng.integers(*exponents, s)) for s in shapes]
        assert wrong(predicate, [np.abs(v) if v.ndim == 1 else v for v in arrays]) == []


def test_products_that_underflow_before_they_count() -> None:
    """Coordinates of one column are tiny, of another huge: a product of two is lost, of three it is not."""
    rng = np.random.default_rng(6)
    for powers in ((-540, -534, 500), (-540, 500, -534), (500, -540, -534)):
        arrays = [np.ldexp(rng.integers(-999, 1000, (300, 3)).astype(float), powers) for _ in range(4)]
        assert wrong(orient3d, arrays) == []
        assert (orient3d(*arrays) != 0).any()


def test_spheres() -> None:
    rng = np.random.default_rng(8)
    c1, r1 = rng.integers(-20, 20, (500, 3)) + 1e9, rng.integers(0, 3, 500) / 3
    away = np.array([(1, 2, 2, 3), (2, 3, 6, 7), (4, 4, 7, 9)])[rng.integers(0, 3, 500)]
    arrays = [c1, r1, nudged(rng, c1 + away[:, :3]), np.abs(nudged(rng, away[:, 3] - r1))]
    assert wrong(circles_sign, arrays) == []
    assert {-1, 0, 1} == set(circles_sign(*arrays).tolist())


@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_conservative_is_never_wrong_when_it_is_sure(predicate: Callable[..., Any]) -> None:
    """What it calls apart is apart; a row in doubt is 0, or nearer for pairs of segments that might cross."""
    for seed, (scale, offset) in enumerate(LENGTHS.values()):
        arrays = family(predicate, 400, seed + 20, scale, offset, 1.0)
        exact, quick = predicate(*arrays), predicate(*arrays, conservative=True)
        assert (exact[quick == 1] == 1).all()
        if predicate is not segment_segment_sign:
            assert (exact[quick == -1] == -1).all()


@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_conservative_settles_ordinary_rows(predicate: Callable[..., Any]) -> None:
    rng = np.random.default_rng(2)
    arrays = [rng.uniform(0, 1000, v.shape) for v in touching(rng, predicate, 3000, 1.0)]
    assert (predicate(*arrays, conservative=True) == predicate(*arrays)).all()


@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_leading_axes_broadcast(predicate: Callable[..., Any]) -> None:
    arrays = family(predicate, 12, 3, 1.0, 0.0, 1.0)
    many = family(predicate, 7, 4, 1.0, 0.0, 1.0)
    grid = predicate(arrays[0][:, None], *many[1:])
    assert grid.shape == (12, 7)
    for i in range(12):
        assert (grid[i] == predicate(arrays[0][i], *many[1:])).all()
    one = predicate(*(v[0] for v in arrays))
    assert one.shape == () and one == predicate(*arrays)[0]
    assert predicate(*(v[:0] for v in arrays)).shape == (0,)


@pytest.mark.parametrize("rows", [CHUNK_ROWS - 1, CHUNK_ROWS, CHUNK_ROWS + 1, 3 * CHUNK_ROWS + 5])
def test_every_row_of_every_chunk_is_answered(rows: int) -> None:
    rng = np.random.default_rng(rows)
    for predicate in CASES:
        arrays = [rng.uniform(0, 9, v.shape) for v in touching(rng, predicate, rows, 1.0)]
        hard = rng.integers(0, rows, 40)
        for array, special in zip(arrays, family(predicate, 40, 6, 1.0, 0.0, 1.0), strict=True):
            array[hard] = special
        before = [array.copy() for array in arrays]
        got = predicate(*arrays)
        look = np.concatenate([hard, rng.integers(0, rows, 100), [0, rows - 1]])
        truth = [PREDICATES[predicate](*rational(tuple(v[i] for v in arrays))) for i in look]
        assert (got[look] == truth).all()
        assert all((array == old).all() for array, old in zip(arrays, before, strict=True))


def test_ordinary_rows_cost_no_integers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not one of 10^5, nor where points project onto the end of an axis-parallel segment, nor for single points."""

    def none(*_: object) -> None:
        raise AssertionError("an exact stage")

    monkeypatch.setattr(exact_module, "_exact", none)
    rng = np.random.default_rng(4)
    for predicate in CASES:
        predicate(*(rng.uniform(0, 2000, v.shape) for v in touching(rng, predicate, 100_000, 1.0)))
    assert point_segment_sign([0, 3], [0, 0], [5, 0], 2) == 1
    assert point_segment_sign([4, 3], [1, 1], [1, 1], 2) == 1
    assert segment_segment_sign([0, 0], [4, 4], [0, 4], [4, 0], 1) == -1
    for predicate in CASES[:2]:
        with pytest.raises(AssertionError, match="an exact stage"):
            predicate(*family(predicate, 50, 1, 1.0, 0.0, 1.0))


def test_by_hand() -> None:
    assert orient2d([0, 0], [1, 0], [[0, 1], [5, 0], [0, -5e-324]]).tolist() == [1, 0, -1]
    assert orient3d([0, 0, 0], [1, 0, 0], [0, 1, 0], [[0, 0, -1], [7, 9, 0], [0, 0, 5e-324]]).tolist() == [1, 0, -1]
    assert circles_sign([0, 0], 2, [3, 4], [2, 3, 4]).tolist() == [1, 0, -1]
    assert circles_sign([1, 1], 0, [1, 1], 0) == 0
    assert circles_sign([0, 0], 1.0, [2, 0], np.nextafter(1.0, 0)) == 1
    assert circles_sign([0, 0], 1.0, [1, 0], 1e-300) == -1
    assert point_segment_sign([5, 1], [0, 0], [9, 0], [0.5, 1, 2]).tolist() == [1, 0, -1]
    assert point_segment_sign([12, 4], [0, 0], [9, 0], 5) == 0
    assert point_segment_sign([5, 1], [0, 0], [9, 0], 1.0, 1e-300) == -1
    assert segment_segment_sign([0, 0], [2, 2], [0, 2], [2, 0], 0) == 0
    assert segment_segment_sign([0, 0], [4, 0], [4, 0], [8, 0], 0) == 0
    assert segment_segment_sign([0, 0], [4, 0], [5, 0], [8, 0], [0, 1, 2]).tolist() == [1, 0, -1]
    assert segment_segment_sign([1, 1], [1, 1], [1, 1], [1, 1], 0) == 0


@pytest.mark.parametrize("predicate", [orient2d, orient3d, circles_sign])
def test_points_have_their_coordinates(predicate: Callable[..., Any]) -> None:
    with pytest.raises(InputError, match=r"expected .* coordinates? on the last axis, got \(4,\)"):
        predicate(*[np.zeros(4)] * (3 if predicate is orient2d else 4))


def test_squares_that_overflow_are_left_to_integers() -> None:
    """The end is 5 from p, the middle of so long a segment 4."""
    far = 1e200
    assert point_segment_sign([3, 4], [0, 0], [far, 0], [3.5, 4, 4.5]).tolist() == [1, 0, -1]
    assert segment_segment_sign([3, 4], [3, 5], [0, 0], [far, 0], [3.5, 4, 4.5]).tolist() == [1, 0, -1]
    assert segment_segment_sign([0, 0], [far, 0], [3, 4], [3, 5], [3.5, 4, 4.5]).tolist() == [1, 0, -1]
    assert circles_sign([far, 0], [far, 1], [-far, 0], [far, far]).tolist() == [0, 1]
    assert orient2d([0, 0], [far, far], [[far, far], [far, 9e199]]).tolist() == [0, -1]


def test_rows_in_doubt_find_their_place_whatever_the_memory_order() -> None:
    """Arrays with the first axis innermost, with rows in every chunk where floats have the wrong sign."""
    rng = np.random.default_rng(9)
    a, b = rng.uniform(0, 9, (2, 300, 70, 2))
    points = [a, b, a + (b - a) / 3]
    expected = orient2d(*(v.reshape(-1, 2) for v in points)).reshape(300, 70)
    assert (orient2d(*(np.asfortranarray(v) for v in points)) == expected).all()
    floats = np.sign(
        (a - points[2])[..., 0] * (b - points[2])[..., 1] - (a - points[2])[..., 1] * (b - points[2])[..., 0]
    )
    assert (floats != expected).mean() > 0.02


@pytest.mark.parametrize("toward", [1.0, -1.0])
@pytest.mark.parametrize("predicate", [p for p in CASES if p is not circles_sign], ids=lambda p: p.__name__)
def test_hard_rows_whose_magnitudes_have_one_sign(predicate: Callable[..., Any], toward: float) -> None:
    """The bound of a chunk looks at both ends of what may be negative: each row here has all on one side."""
    rng = np.random.default_rng(7)
    n = 400
    along, other, off = rng.uniform(1, 2, (n, 3)), rng.uniform(1, 2, (n, 3)), rng.uniform(0.1, 0.2, (n, 3))
    k, m = rng.uniform(1, 3, (2, n, 1))
    rows: Arrays
    if predicate is orient2d:  # on one line from c; products of coordinates of one sign
        step = np.array([1, toward]) * along[:, :2]
        rows = [off[:, :2] + step, off[:, :2] + step * k, off[:, :2]]
        (ax, ay), (bx, by), (cx, cy) = (v.T for v in rows)
        floats = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
    elif predicate is orient3d:  # in one plane with d
        rows = [off + toward * along, off + toward * other, off + toward * (along * k + other * m), off]
        floats = np.linalg.det(np.stack([v - off for v in rows[:3]], axis=1))
    else:  # p as far from an end of the segment as the radius
        p, a = off[:, :2] + toward * along[:, :2], off[:, :2]
        radius = np.sqrt(((p - a) ** 2).sum(axis=1))
        ends = [a, a - toward * along[:, :2] * k]
        rows = [p, *ends] if predicate is point_segment_sign else [p, p + (p - a), *ends]
        rows += [radius, np.zeros(n)]
        floats = ((p - a) ** 2).sum(axis=1) - radius * radius
    truth = [PREDICATES[predicate](*rational(row)) for row in zip(*rows, strict=True)]
    assert (np.sign(floats) != truth).any(), "too easy"
    assert wrong(predicate, rows) == []


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("conservative", [False, True])
@pytest.mark.parametrize("predicate", CASES, ids=lambda p: p.__name__)
def test_what_is_not_finite_is_refused_wherever_it_is(
    predicate: Callable[..., Any], conservative: bool, bad: float
) -> None:
    """In every place of every argument, in a row alone, and in one of a chunk that is settled otherwise."""
    rng = np.random.default_rng(3)
    names = {
        orient2d: "a b c", orient3d: "a b c d", circles_sign: "c1 r1 c2 r2",
        point_segment_sign: "p a b r r2", segment_segment_sign: "a b c d r r2",
    }[predicate].split()  # fmt: skip
    rows = [rng.uniform(1, 9, v.shape) for v in touching(rng, predicate, 50, 1.0)]
    for k, name in enumerate(names):
        for place in range(rows[k].shape[1] if rows[k].ndim == 2 else 1):
            arrays = [v.copy() for v in rows]
            arrays[k].reshape(50, -1)[31, place] = bad
            with pytest.raises(InputError, match=f"^{name}: expected finite numbers, got {bad} in row 31$"):
                predicate(*arrays, conservative=conservative)
            with pytest.raises(InputError, match=f"^{name}: expected finite numbers, got {bad} in row 0$"):
                predicate(*(v[31] for v in arrays), conservative=conservative)


def test_arguments_that_are_no_numbers_or_do_not_broadcast_are_named() -> None:
    p, many = [0.0, 0.0], np.zeros((3, 2))
    bad: Any = ["x", "y"]
    calls: list[tuple[Callable[[], Any], str]] = [
        (lambda: orient2d(p, many, np.zeros((4, 2))), r"^c: expected axes that broadcast with \(3,\), got \(4,\)$"),
        (lambda: circles_sign(many, [1, 2], many, 1), r"^r1: expected axes that broadcast with \(3,\), got \(2,\)$"),
        (lambda: orient2d(p, bad, p), r"^b: expected numbers, got \['x', 'y'\]$"),
        (lambda: orient2d(p, ["1", "2"], p), "^b: expected numbers"),
        (lambda: orient2d(p, [[1, 2], [3]], p), "^b: expected an array"),
        (lambda: circles_sign([[1, 2], [3]], 1, p, 1), "^c1: expected an array"),
        (lambda: point_segment_sign(p, p, p, None), "^r: expected numbers, got None$"),
        (lambda: segment_segment_sign(p, p, p, p, 1, "2"), "^r2: expected numbers, got '2'$"),
        (lambda: orient3d([0] * 3, [1] * 3, [2] * 3, [3] * 3, "no"), "^conservative: expected true or false"),
    ]
    for call, message in calls:
        with pytest.raises(InputError, match=message):
            call()
