"""The 1/256-px grid: one rounding of positions, directions correct to the last bit, turns and mirrors exact."""

import importlib
import math
from collections.abc import Callable
from fractions import Fraction
from importlib.util import find_spec
from itertools import chain
from typing import Any

import numpy as np
import oracle_raster as oracle
import pytest
from examples import examples
from hypothesis import example, given
from hypothesis import strategies as st

from hitplanes.planes.common.checks import InputError
from hitplanes.planes.common.limits import POSITION_MAX
from hitplanes.planes.grid import fixed_point

SNAPPING = [fixed_point, *([importlib.import_module("hitplanes.planes.jit.scene")] if find_spec("numba") else [])]

MANY = examples(300, deadline=None)
FEW = examples(100, deadline=None)
MAX_PX = 2.0**40  # the largest position

# Positions that fall between two grid points as often as not: whole numbers of 1/1024 px.
near_ties = st.integers(-(2**20), 2**20).map(lambda n: n / 1024)
positions = st.one_of(near_ties, st.floats(-MAX_PX, MAX_PX), st.floats(-100, 100))
# Angles on a binary grid: a quarter turn can be added to them, or they can be taken from one, without rounding.
grid_angles = st.one_of(st.integers(-3600, 3600).map(float), st.integers(-(2**40), 2**40).map(lambda n: n * 2.0**-20))
any_angle = st.one_of(
    grid_angles,
    st.floats(-720, 720),
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(-1e-6, 1e-6),
    # next to the folds, where an octant is mistaken most easily
    st.builds(math.nextafter, st.integers(-16, 16).map(lambda n: 45.0 * n), st.sampled_from([-math.inf, math.inf])),
)
components = st.one_of(st.integers(-40, 40), st.integers(-(2**29), 2**29), st.integers(-(2**49), 2**49))
vectors = st.tuples(components, components).filter(lambda v: v != (0, 0))


def unit(degrees: float) -> tuple[int, int]:
    c, s = fixed_point.unit(degrees)
    return int(c), int(s)


def unit_toward(dx: int, dy: int) -> tuple[int, int]:
    c, s = fixed_point.unit_toward(dx, dy)
    return int(c), int(s)


# snap, pixel


@pytest.mark.parametrize(
    ("n_512ths", "expected"),
    [(0, 0), (1, 0), (2, 1), (3, 2), (5, 2), (7, 4), (-1, 0), (-3, -2), (-5, -2), (513, 256), (515, 258)],
)
def test_snap_rounds_ties_to_even(n_512ths: int, expected: int) -> None:
    assert int(fixed_point.snap(n_512ths / 512)) == expected


@MANY
@given(st.lists(positions, min_size=1, max_size=20))
def test_snap_is_the_rounding_of_256_v(values: list[float]) -> None:
    snapped = fixed_point.snap(np.array(values))
    assert snapped.dtype == np.int64
    assert snapped.tolist() == [oracle.rounded(Fraction(v) * 256) for v in values]


@MANY
@given(positions)
def test_snap_is_odd(value: float) -> None:
    assert int(fixed_point.snap(-value)) == -int(fixed_point.snap(value))


@MANY
@given(st.integers(-(2**28), 2**28), st.sampled_from([1, -1, 10**9, -(10**9), 2**39]))
def test_snap_moves_with_the_world(v_256: int, shift_px: int) -> None:
    # on the grid the shifted float is exact, so the shift must come through exactly
    assert int(fixed_point.snap(v_256 / 256 + shift_px)) == v_256 + 256 * shift_px


LAID: list[Callable[[list[float]], np.ndarray[Any, Any]]] = [
    lambda values: np.array(values).reshape(-1, 2),
    lambda values: np.array(values).reshape(-1, 2).T.copy().T,
    lambda values: np.repeat(np.array(values).reshape(-1, 2), 2, axis=0)[::2],
]
"""Positions in one piece, by columns, and with gaps."""

LIMIT = float(POSITION_MAX)
IN_RANGE = st.one_of(st.floats(-LIMIT, LIMIT), st.integers(-(2**49), 2**49).map(lambda n: n / 512))


@given(st.lists(IN_RANGE, min_size=2).filter(lambda values: len(values) % 2 == 0), st.sampled_from(LAID))
@example([0.5 / 256, 1.5 / 256, -0.5 / 256, -2.5 / 256, LIMIT, -LIMIT], LAID[0])
def test_positions_are_snapped_at_once_as_each_is_alone(
    values: list[float], laid: Callable[[list[float]], np.ndarray[Any, Any]]
) -> None:
    at, expected = laid(values), [round(256 * Fraction(value)) for value in values]
    for kernels in SNAPPING:
        found = kernels.snapped(at)
        assert found is not None and found.dtype == np.int64
        assert found.tolist() == np.reshape(expected, (-1, 2)).tolist() and at.tolist() == laid(values).tolist()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, math.nextafter(LIMIT, math.inf), -1.01 * LIMIT])
def test_positions_out_of_range_are_not_snapped(bad: float) -> None:
    for kernels in SNAPPING:
        for place in np.ndindex(9, 2):
            at = np.ones((9, 2))
            at[place] = bad
            assert kernels.snapped(at) is None
        assert kernels.snapped(np.zeros((0, 2))).shape == (0, 2)


def test_snap_keeps_the_shape_and_the_input() -> None:
    values = np.array([[0.5, 1.25, -2.0], [3.001, -3.001, 1e9]])
    before = values.copy()
    assert fixed_point.snap(values).shape == (2, 3)
    assert np.array_equal(values, before)


@pytest.mark.parametrize(
    ("v_256", "expected"),
    [(0, 0), (127, 0), (128, 1), (129, 1), (-127, 0), (-128, 0), (-129, -1), (256, 1), (-384, -1), (-385, -2)],
)
def test_pixel_boundaries_go_right_and_down(v_256: int, expected: int) -> None:
    assert int(fixed_point.pixel(np.int64(v_256))) == expected


@FEW
@given(st.lists(st.integers(-(2**48), 2**48), min_size=1, max_size=20))
def test_pixel_holds_the_position(values: list[int]) -> None:
    for v, p in zip(values, fixed_point.pixel(np.array(values)).tolist(), strict=True):
        assert 256 * p - 128 <= v < 256 * p + 128


# whole-number arithmetic


numerators = st.one_of(st.integers(-50, 50), st.integers(-(2**62), 2**62))
divisors = st.one_of(st.integers(1, 12), st.sampled_from([2, 256, 2**30]), st.integers(1, 2**61))


@MANY
@given(st.lists(st.tuples(numerators, divisors), min_size=1, max_size=20))
@example([(a, b) for a in range(-9, 10) for b in (1, 2, 3, 4)])
@example([(2**62, 2**61), (-(2**62), 2**61), (2**62 - 1, 2), (1 - 2**62, 2), (2**29, 2**30), (3 * 2**29, 2**30)])
def test_rounded_div_is_half_to_even(rows: list[tuple[int, int]]) -> None:
    a, b = np.array(rows, dtype=np.int64).T
    expected = [oracle.rounded(Fraction(n, d)) for n, d in rows]
    assert fixed_point.rounded_div(a, b).tolist() == expected


roots = st.integers(0, 3037000499)  # the largest whole number whose square is an int64


@MANY
@given(st.lists(st.one_of(st.integers(0, 2**63 - 1), st.integers(0, 100), roots.map(lambda r: r * r)), min_size=1))
@example([2**63 - 1, 3037000499**2, 3037000499**2 - 1, 2**62, 2**62 - 1, 2**52 + 1, 2**53 + 1, 0])
def test_isqrt_is_the_floor_of_the_root(values: list[int]) -> None:
    assert fixed_point.isqrt(np.array(values, dtype=np.int64)).tolist() == [math.isqrt(v) for v in values]


sizes = st.integers(0, 62).flatmap(
    lambda bits: st.lists(st.tuples(st.integers(2**bits // 2 + 1, 2**bits), st.fractions(0, 1)), min_size=1)
)


@MANY
@given(sizes, st.integers(0, 2**60))
@example([(2**40 - 1, Fraction(1)), (2**40 - 1, Fraction(1, 3))], 2**60)
@example([(2**43 - 1, Fraction(1, 3))], 2**60)
def test_muldiv_is_the_floor_of_the_quotient(parts: list[tuple[int, Fraction]], factor: int) -> None:
    divisors = [divisor for divisor, _ in parts]
    values = [int(part * divisor) for divisor, part in parts]
    truth = [value * factor // divisor for value, divisor in zip(values, divisors, strict=True)]
    assert fixed_point.muldiv(np.array(values), factor, np.array(divisors)).tolist() == truth


@FEW
@given(st.lists(st.integers(1, 3037000499), min_size=1))
def test_isqrt_steps_at_squares(rs: list[int]) -> None:
    squares = np.array(rs, dtype=np.int64) ** 2
    assert fixed_point.isqrt(squares).tolist() == rs
    assert fixed_point.isqrt(squares - 1).tolist() == [r - 1 for r in rs]


# directions


def test_the_reference_knows_pi() -> None:
    assert oracle.pi_digits(61) == oracle.PI_DIGITS


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        (0.0, (2**30, 0)),
        (-0.0, (2**30, 0)),
        (30.0, (929887697, 2**29)),
        (45.0, (759250125, 759250125)),
        (60.0, (2**29, 929887697)),
        (90.0, (0, 2**30)),
        (180.0, (-(2**30), 0)),
        (270.0, (0, -(2**30))),
        (360.0, (2**30, 0)),
        (-90.0, (0, -(2**30))),
        (150.0, (-929887697, 2**29)),
        (5e-324, (2**30, 0)),
        (-5e-324, (2**30, 0)),
        (360.0 * 2**80, (2**30, 0)),
        (90.0 + 360.0 * 2**40, (0, 2**30)),
    ],
)
def test_unit_known_directions(degrees: float, expected: tuple[int, int]) -> None:
    assert unit(degrees) == expected


@examples(1000, deadline=None)
@given(any_angle)
@example(1.7976931348623157e308)
@example(-1.7976931348623157e308)
@example(math.nextafter(45.0, 90.0))
@example(math.nextafter(360.0, 0.0))
def test_unit_is_correctly_rounded(degrees: float) -> None:
    assert unit(degrees) == oracle.unit(degrees)


TIES = [
    math.degrees(arc((k + 0.5) / 2**30)) for k in range(-(2**30), 2**30, 5 * 10**7) for arc in (math.acos, math.asin)
]
"""Angles whose sine or cosine lies as near to half-way between two whole numbers as an angle's can."""


def test_unit_is_correctly_rounded_all_round(jit: bool) -> None:
    degrees = np.concatenate(
        [np.arange(-1080, 1081) / 3.0, np.array(TIES), np.random.default_rng(5).uniform(-400, 400, 4000)]
    )
    c, s = fixed_point.unit(degrees)
    assert c.dtype == s.dtype == np.int64
    assert list(zip(c.tolist(), s.tolist(), strict=True)) == [oracle.unit(d) for d in degrees.tolist()]


# Angles next to those whose sine or cosine lies half-way between two whole numbers: a float sine often rounds
# them to the wrong side.
near_halves = st.builds(
    lambda k, arc, steps: math.degrees(arc((k + 0.5) / 2**30)) * (1 + steps * 2.0**-52),
    st.integers(-(2**30), 2**30 - 1),
    st.sampled_from([math.acos, math.asin]),
    st.integers(-3, 3),
)


turns = st.sampled_from([0.0, 90.0, 180.0, -360.0, 720.0])


@MANY
@given(near_halves, turns)
def test_unit_is_correctly_rounded_next_to_ties(degrees: float, more: float) -> None:
    assert unit(degrees + more) == oracle.unit(degrees + more)


@pytest.mark.long
@examples(1500, deadline=None)
@given(near_halves, turns)
def test_unit_is_correctly_rounded_next_to_many_ties(degrees: float, more: float) -> None:
    assert unit(degrees + more) == oracle.unit(degrees + more)


@MANY
@given(st.one_of(any_angle, near_halves))
def test_unit_mirrors_on_the_axis(degrees: float) -> None:
    c, s = unit(degrees)
    assert unit(-degrees) == (c, -s)


@MANY
@given(grid_angles, st.integers(-9, 9))
def test_unit_quarter_turns_and_mirrors_are_exact(degrees: float, quarters: int) -> None:
    c, s = unit(degrees)
    assert unit(180.0 - degrees) == (-c, s)
    assert unit(90.0 - degrees) == (s, c)
    for _ in range(quarters % 4):
        c, s = -s, c
    assert unit(degrees + 90.0 * quarters) == (c, s)


@MANY
@given(any_angle)
def test_unit_has_length_one(degrees: float) -> None:
    c, s = unit(degrees)
    # each is off by at most a half, so the square of the length by at most |c| + |s| + 1/2
    assert abs(c * c + s * s - 2**60) <= abs(c) + abs(s) + 1
    assert max(abs(c), abs(s)) <= 2**30


def test_unit_rises_and_falls_with_the_angle() -> None:
    # cones of growing angle must not lose pixels, so neither number may step back
    c, s = fixed_point.unit(np.linspace(0.0, 180.0, 20001))
    assert (np.diff(c) <= 0).all()
    assert (np.diff(s[:10001]) >= 0).all()
    assert (np.diff(s[10000:]) <= 0).all()


def test_unit_of_a_batch_is_that_of_each_row() -> None:
    degrees = np.array([[0.1, 400.25, -1e17], [45.0, 1e-300, 359.999]])
    before = degrees.copy()
    c, s = fixed_point.unit(degrees)
    assert c.shape == s.shape == (2, 3)
    assert list(zip(c.ravel().tolist(), s.ravel().tolist(), strict=True)) == [unit(d) for d in degrees.ravel().tolist()]
    assert np.array_equal(degrees, before)


@MANY
@given(vectors)
@example((1, 2**49))
@example((3, 4))
@example((2**28, 1))
@example((2**49, 2**49 - 1))
def test_unit_toward_is_correctly_rounded(vector: tuple[int, int]) -> None:
    assert unit_toward(*vector) == oracle.unit_toward(*vector)


def nearly_tied(k: int) -> list[tuple[int, int]]:
    """Give vectors whose x component comes ever closer to (k + 1/2) / 2**30: convergents of the slope."""
    x = 2 * k + 1
    root, scale = math.isqrt((2**62 - x * x) << 256), x << 128
    (p, q), (p_next, q_next) = (0, 1), (1, 0)
    found = []
    while scale:
        whole = root // scale
        root, scale = scale, root - whole * scale
        (p, q), (p_next, q_next) = (p_next, q_next), (whole * p_next + p, whole * q_next + q)
        if max(p_next, q_next) > 2**49:
            break
        found.append((q_next, p_next))
    return found


@MANY
@given(st.integers(0, 2**30 - 1))
@example(0)
@example(2**30 - 1)
@example(2**29)
def test_unit_toward_is_correctly_rounded_next_to_ties(k: int) -> None:
    vectors = nearly_tied(k)
    c, s = fixed_point.unit_toward(*np.array(vectors, dtype=np.int64).T)
    assert list(zip(c.tolist(), s.tolist(), strict=True)) == [oracle.unit_toward(*v) for v in vectors]
    c, s = fixed_point.unit_toward(*np.array(vectors, dtype=np.int64).T[::-1])
    assert list(zip(s.tolist(), c.tolist(), strict=True)) == [oracle.unit_toward(*v) for v in vectors]


@MANY
@given(vectors)
def test_unit_toward_mirrors_swaps_and_turns(vector: tuple[int, int]) -> None:
    dx, dy = vector
    c, s = unit_toward(dx, dy)
    assert unit_toward(-dx, dy) == (-c, s)
    assert unit_toward(dx, -dy) == (c, -s)
    assert unit_toward(dy, dx) == (s, c)
    assert unit_toward(-dy, dx) == (-s, c)


@FEW
@given(st.tuples(st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20)).filter(any), st.integers(1, 2**28))
def test_unit_toward_does_not_depend_on_the_distance(vector: tuple[int, int], times: int) -> None:
    dx, dy = vector
    assert unit_toward(dx * times, dy * times) == unit_toward(dx, dy)


@pytest.mark.parametrize("eighth", range(8))
def test_unit_toward_agrees_with_unit(eighth: int) -> None:
    dx, dy = [(7, 0), (7, 7), (0, 7), (-7, 7), (-7, 0), (-7, -7), (0, -7), (7, -7)][eighth]
    assert unit_toward(dx, dy) == unit(45.0 * eighth)


def test_unit_toward_of_a_batch_is_that_of_each_row() -> None:
    dx, dy = np.random.default_rng(6).integers(-(2**29), 2**29, (2, 200))
    c, s = fixed_point.unit_toward(dx, dy)
    assert c.dtype == s.dtype == np.int64
    rows = list(zip(dx.tolist(), dy.tolist(), strict=True))
    assert list(zip(c.tolist(), s.tolist(), strict=True)) == [oracle.unit_toward(*row) for row in rows]


def test_unit_toward_refuses_no_direction() -> None:
    with pytest.raises(InputError):
        fixed_point.unit_toward(0, 0)
    with pytest.raises(InputError):
        fixed_point.unit_toward(np.array([1, 0]), np.array([0, 0]))


# turns


@MANY
@given(st.one_of(any_angle, near_halves))
@example(45.0)
@example(-45.0)
@example(135.0)
@example(math.nextafter(45.0, 0.0))
@example(math.nextafter(-45.0, -90.0))
@example(-5e-324)
def test_quarter_turns_split_the_angle(degrees: float) -> None:
    k, c, s = (int(v) for v in fixed_point.quarter_turns(degrees))
    assert (k, c, s) == oracle.quarter_turns(degrees)
    for _ in range(k):
        c, s = -s, c
    assert (c, s) == unit(degrees) == fixed_point.unit_of(degrees)


def test_few_angles_are_split_as_many_are() -> None:
    some = np.concatenate([np.random.default_rng(1).uniform(-800, 800, 300), 7.5 * np.arange(-60, 60)]).tolist()
    many = fixed_point.all_quarter_turns(some)
    for n in (1, fixed_point.FEW_ANGLES, fixed_point.FEW_ANGLES + 1):
        few = [fixed_point.all_quarter_turns(some[k : k + n]) for k in range(0, len(some), n)]
        assert [list(chain(*column)) for column in zip(*few, strict=True)] == many


points_256 = st.tuples(st.integers(-(2**28), 2**28), st.integers(-(2**28), 2**28))


@MANY
@given(st.lists(points_256, min_size=1, max_size=8), any_angle)
@example([(1, 0), (3, 0), (-1, 0), (1, 1), (-3, 5)], 60.0)  # the cosine is a half: ties
def test_turned_rounds_once(points: list[tuple[int, int]], degrees: float) -> None:
    c, s = oracle.unit(degrees)
    given_points = np.array(points, dtype=np.int64)
    before = given_points.copy()
    result = fixed_point.turned(given_points, c, s)
    assert result.shape == (len(points), 2)
    assert [tuple(row) for row in result.tolist()] == [oracle.turned(p, c, s) for p in points]
    assert np.array_equal(given_points, before)


@FEW
@given(st.lists(points_256, min_size=1, max_size=8), st.integers(0, 3))
def test_turned_by_quarter_turns_is_exact(points: list[tuple[int, int]], quarters: int) -> None:
    expected = points
    for _ in range(quarters):
        expected = [(-y, x) for x, y in expected]
    c, s = fixed_point.unit(90.0 * quarters)
    assert [tuple(row) for row in fixed_point.turned(np.array(points), c, s).tolist()] == expected


@FEW
@given(st.lists(points_256, min_size=1, max_size=8), any_angle)
def test_turned_mirrors(points: list[tuple[int, int]], degrees: float) -> None:
    c, s = oracle.unit(degrees)
    there = fixed_point.turned(np.array(points), c, s) * [1, -1]
    assert np.array_equal(there, fixed_point.turned(np.array(points) * [1, -1], c, -s))
