"""Patterns along many directions at once are those along each alone, pixel for pixel, word for word."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import Beam, Box, Cone, Disc, Polygon, Rounds, Scene, Spread, Stencil, Weapon, fire
from hitplanes.planes.bits.tiles import big_pattern
from hitplanes.planes.grid import rasterize
from hitplanes.planes.grid.fixed_point import ONE, unit
from hitplanes.weapons.kinds.areas import FEW_AIMS, AreaWeapon, pattern_of, patterns_of
from hitplanes.weapons.kinds.weapon import AimedPatterns, big_of_bits, columns_of

STAR = Polygon([(0, 0), (50, 10), (30, 40), (20, 10)])
WEAPONS: dict[str, AreaWeapon] = {
    "box": Box(61, 20),
    "even box of one row": Box(70, 1),
    "pixel": Box(1, 1),
    "long box": Box(300, 9),
    "beam": Beam(200, 9),
    "beam without width": Beam(90, 0),
    "beam without length": Beam(0, 30),
    "beam shorter than a pixel": Beam(0.3, 0.4),
    "cone": Cone(94, 34),
    "thin cone": Cone(120, 0),
    "half disc": Cone(40, 180),
    "more than half a disc": Cone(40, 250),
    "disc": Cone(30, 360),
    "triangle": Polygon([(0, 0), (50, 10), (30, 40)]),
    "triangle far off": Polygon([(500, -3), (530, 2.3), (515.004, 90)]),
    "points on an edge": Polygon([(0, 0), (20, 0), (40, 0), (40, 30), (0, 30)]),
    "anticlockwise": Polygon([(0, 0), (0, 30), (40, 30), (40, 0)]),
}
SPECIAL = [0, 45, 90, 135, 180, 225, 270, 315, 17, 163, 1e-6, 90.0001, 359.99999, 26.565051177077990, 30, 60]


def directions(seed: int, count: int = 40) -> Any:
    aims = np.concatenate([SPECIAL, np.random.default_rng(seed).uniform(0, 360, count)])
    return np.unique(np.stack(unit(aims), axis=1), axis=0)


@pytest.mark.parametrize("name", WEAPONS)
def test_bit_rows_of_all_directions_are_those_of_each(name: str) -> None:
    weapon, direction = WEAPONS[name], directions(3)
    patterns = patterns_of(weapon, direction)
    assert isinstance(patterns, AimedPatterns) and len(patterns) == len(direction) > FEW_AIMS
    bits, begin = patterns.bits, 0
    for i, (c, s) in enumerate(direction.tolist()):
        spans = weapon.spans(c, s)
        assert patterns[i].spans == spans
        words, big, own = columns_of(spans), big_of_bits(bits, i), big_pattern(spans)
        assert vars(big) | {"depths": 0} == vars(own) | {"depths": 0}
        assert tuple(bits.box_xyxy[i]) == spans.box_xyxy
        assert bits.rows[i] == words.shape[1] and bits.first[i] == begin + 64
        assert np.array_equal(bits.words[begin : begin + words.size], words.reshape(-1))
        begin += words.size
        if len(bits.strips):
            a, b, low, high = bits.strips[i].tolist()
            across = spans.pixels() @ np.array([a, b])
            assert (low, high) == (across.min(), across.max())
    assert begin == len(bits.words)


def test_strips_are_kept_for_long_patterns_alone() -> None:
    kept = {name for name, weapon in WEAPONS.items() if len(patterns_of(weapon, directions(5)).bits.strips)}  # type: ignore[attr-defined]
    assert {"long box", "beam"} <= kept and not kept & {"disc", "pixel"}


coordinates = st.integers(-700, 700)


@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=7))
def test_any_ring_is_refused_or_drawn_by_the_even_odd_rule(ring: list[tuple[int, int]]) -> None:
    runs = rasterize.convex_polygons(np.array([ring]))
    if runs is not None:
        assert runs.spans() == rasterize.polygon([np.array(ring)])


@given(st.lists(st.sampled_from([(x, y) for x in (-256, 0, 256) for y in (-256, 0, 256)]), min_size=3, max_size=6))
def test_rings_on_a_lattice_are_refused_or_drawn_by_the_even_odd_rule(ring: list[tuple[int, int]]) -> None:
    runs = rasterize.convex_polygons(np.array([ring]))
    if runs is not None:
        assert runs.spans() == rasterize.polygon([np.array(ring)])


@pytest.mark.parametrize(
    "ring",
    [
        [(0, 0), (10, 0), (20, 0), (10, 0), (10, 10)],  # a spike
        [(0, -30), (18, 24), (-29, -9), (29, -9), (-18, 24)],  # a star with five points, which goes around twice
        [(0, 0), (9, 9), (18, 18)],  # flat
        [(0, 0), (20, 0), (10, 5), (20, 20)],  # a notch
    ],
)
def test_rings_that_are_not_convex_are_left_to_the_even_odd_rule(ring: list[tuple[int, int]]) -> None:
    points = 256 * np.array([ring])
    assert rasterize.convex_polygons(points) is None
    assert rasterize.convex_polygons(points[:, ::-1]) is None


def crowd(corner: tuple[int, int]) -> Scene:
    rng = np.random.default_rng(4)
    scene = Scene()
    for _ in range(50):
        role = "occluder" if rng.random() < 0.2 else "hittable"
        scene.add(rng.random((30, 40)) < 0.7, tuple((corner + rng.integers(0, 500, 2)).tolist()), role=role)
    return scene


MORE: dict[str, Weapon] = {
    "star": STAR,
    "stencil": Stencil([".##", "###", ".#."]),
    "weights": Beam(90, 8, falloff="linear"),
    "smooth weights": Cone(60.3, 50, falloff="smooth"),
    "weights of a box": Box(40, 21, falloff="linear", pierce=True),
    "weights that reach far": Beam(600, 2, falloff="linear"),
    "weights of a spread": Spread(Cone(40, 50, falloff="smooth"), 3, 20),
    "spread": Spread(Box(9, 4), 3, 20),
    "rounds": Rounds(Cone(60, 30), 3, recoil_deg=7),
    "disc of one shape": Disc(20),
    "nothing": Polygon([(0.2, 0.2), (0.4, 0.2), (0.3, 0.4)]),
    "nothing at some aims": Polygon([(0.2, -0.1), (40.2, -0.1), (40.2, 0.1), (0.2, 0.1)]),
}


@pytest.mark.parametrize("corner", [(0, 0), (-(10**9), 10**9)])
@pytest.mark.parametrize("name", [*WEAPONS, *MORE])
def test_shots_at_many_aims_are_those_of_each_alone(name: str, corner: tuple[int, int], jit: bool) -> None:
    weapon, scene, rng = (WEAPONS | MORE)[name], crowd(corner), np.random.default_rng(9)
    at = np.array(corner) + rng.integers(0, 500, (40, 2))
    aim = np.concatenate([SPECIAL, rng.uniform(-400, 400, 40 - len(SPECIAL))])
    together = fire(scene, weapon, at, aim=aim, seed=3)
    assert together == fire(scene, weapon, at, aim=aim, seed=3, strategy="spans")
    for row in range(0, 40, 7):
        alone = fire(scene, weapon, at[row], aim=float(aim[row]), seed=3, shot=row)
        assert [(*one[1:],) for one in alone] == [(*one[1:],) for one in together if one[0] == row]


def test_the_same_aims_are_rasterized_once() -> None:
    direction = directions(11)
    first = patterns_of(Beam(77, 5), direction)
    assert isinstance(first, AimedPatterns)
    assert patterns_of(Beam(77, 5), direction.copy()).bits is first.bits  # type: ignore[attr-defined]
    assert patterns_of(Beam(78, 5), direction).bits is not first.bits  # type: ignore[attr-defined]
    few = patterns_of(Beam(77, 5), direction[:FEW_AIMS])
    assert not isinstance(few, AimedPatterns) and few[0] is pattern_of(Beam(77, 5), *direction[0].tolist())
    assert pattern_of(Beam(77, 5), ONE, 0).spans == Beam(77, 5).spans(ONE, 0)


@given(
    st.one_of(st.integers(2**56, 2**58), st.integers(-(2**58), -(2**56)), st.integers(-9, 9)),
    st.integers(-8, 8),
    st.integers(-1, 1),
    st.lists(st.integers(-5000, 5000), min_size=1, max_size=20),
)
def test_quotients_that_are_nearly_whole_are_floored_by_integers(
    a: int, times: int, more: int, rows: list[int]
) -> None:
    """Both numbers have more bits than a float holds, and their quotient is whole, or nearly."""
    b, y = times * a + more, np.array(rows)
    first, last = rasterize._half_plane(np.array([a]), np.array([b]), np.zeros_like(y), y)
    for row, begin, end in zip(rows, first.tolist(), last.tolist(), strict=True):
        if a == 0:
            assert (begin <= end) == (b * row >= 0)
        elif a > 0:
            assert (begin, end) == (-rasterize.WIDEST, min(max(b * row // a, -rasterize.WIDEST), rasterize.WIDEST))
        else:
            assert (begin, end) == (min(max(-(b * row // -a), -rasterize.WIDEST), rasterize.WIDEST), rasterize.WIDEST)
