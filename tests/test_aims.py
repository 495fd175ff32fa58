"""Patterns along many directions at once are those along each alone, pixel for pixel, word for word."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from some_of import in_turn

from hitplanes import Beam, Box, Cone, Disc, Polygon, Rounds, Scene, Spread, Stencil, Weapon, fire
from hitplanes.planes.bits import bit_rows
from hitplanes.planes.bits.tiles import big_pattern
from hitplanes.planes.common.backend import COMPILED
from hitplanes.planes.common.limits import REACH_MAX
from hitplanes.planes.grid import fixed_point, rasterize
from hitplanes.planes.grid.fixed_point import ONE, all_quarters, quarters, turned, unit, unit_toward
from hitplanes.planes.grid.spans import Spans
from hitplanes.weapons.kinds.areas import AreaWeapon, pattern_of, patterns_of
from hitplanes.weapons.kinds.weapon import AimedTable, PatternTable, big_of, big_of_bits, columns_of

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
    "star": STAR,
    "ring about a hole": Polygon([(0, 0), (40, 0), (40, 40), (0, 40)], holes=[[(10, 10), (30, 12), (20, 30)]]),
    "two rings that cross": Polygon([(-30, 0), (30, 0), (0, 40)], holes=[[(-30, 30), (30, 30), (0, -15)]]),
    "anticlockwise": Polygon([(0, 0), (0, 30), (40, 30), (40, 0)]),
    "stencil": Stencil([".##", "###", ".#."]),
    "stencil of even sides with holes": Stencil(["##.###" * 5, "#....#" * 5, ".#.###" * 5, "######" * 5]),
    "stencil about a corner": Stencil(["#" * 30] * 9, pivot_xy=(-0.5, -0.5)),
    "stencil about a place aside": Stencil(["#.#", "...", "#.#"], pivot_xy=(31.3, -17.71)),
    "stencil of one pixel": Stencil(["#"]),
}
SIGNS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
SPECIAL = [0, 45, 90, 135, 180, 225, 270, 315, 17, 163, 1e-6, 90.0001, 359.99999, 26.565051177077990, 30, 60]


def directions(seed: int, count: int = 40) -> Any:
    aims = np.concatenate([SPECIAL, np.random.default_rng(seed).uniform(0, 360, count)])
    return np.unique(np.stack(unit(aims), axis=1), axis=0)


@pytest.mark.parametrize("name", WEAPONS)
def test_bit_rows_of_all_directions_are_those_of_each(name: str, jit: bool) -> None:
    weapon, direction = WEAPONS[name], directions(3 + jit, 12)  # those of a seed are kept
    patterns = patterns_of(weapon, direction)
    assert isinstance(patterns, AimedTable) and len(patterns) == len(direction) > 1
    bits, begin = patterns.bits, 64
    for i, (c, s) in enumerate(direction.tolist()):
        spans = weapon.spans(c, s)
        assert patterns.patterns[i].spans == spans
        words, big, own = columns_of(spans), big_of_bits(bits, i), big_pattern(spans)
        assert vars(big) | {"depths": 0} == vars(own) | {"depths": 0}
        assert tuple(bits.box_xyxy[i]) == spans.box_xyxy
        assert bits.rows[i] == words.shape[1] and bits.first[i] == begin
        assert np.array_equal(bits.words[begin : begin + words.size], words.reshape(-1))
        begin += words.size
        if len(bits.strips):
            a, b, low, high = bits.strips[i].tolist()
            across = spans.pixels() @ np.array([a, b])
            assert (low, high) == (across.min(), across.max())
    assert begin == len(bits.words) and not bits.words[:64].any()


@pytest.mark.parametrize("name", WEAPONS)
def test_a_pattern_alone_is_that_of_all_directions(name: str, jit: bool) -> None:
    weapon, direction = WEAPONS[name], directions(5 + jit, 3)
    for c, s in direction.tolist():
        alone, pattern = patterns_of(weapon, np.array([[c, s]])), pattern_of(weapon, c, s)
        big, own, bits, kept = alone.only_big(), big_of(pattern), alone.only_bits(), alone.bits
        assert [getattr(big, field) for field in BIG] == [getattr(own, field) for field in BIG]
        assert big.share(big.rows, pattern.spans.count) == own.share(own.rows, pattern.spans.count)
        assert not len(bits.strips) and not len(pattern.table.only_bits().strips)
        assert all(map(np.array_equal, bits[:4] + bits[5:], kept[:4] + kept[5:]))


def test_a_pattern_alone_may_have_no_pixels(jit: bool) -> None:
    for weapon in (Stencil([".."]), Polygon([(0.1, 0.2), (0.8, 0.3), (0.4, 0.7)])):
        alone = patterns_of(weapon, np.array([[ONE, 0]]))
        assert alone.only_big().rows == 0 and not alone.only_bits().words.any()


BIG = ("x", "y", "wide", "high", "stride", "rows")


def test_weights_of_integers_are_those_of_the_pattern_however_it_was_made(jit: bool) -> None:
    weapon = Cone(40, 50, falloff="smooth")
    patterns = patterns_of(weapon, directions(8 + jit, 12))
    assert isinstance(patterns, AimedTable)
    for big, pattern in zip(patterns.bigs, patterns.patterns, strict=True):
        assert pattern.prefix is not None
        assert big.share(big.rows, pattern.spans.count) == big_of(pattern).share(big.rows, 0) == pattern.prefix[-1]


WHOLE_SIDES = [(3, 4), (5, 12), (8, 15), (7, 24), (20, 21), (63, 16)]
TIES = np.stack(unit_toward(*np.array([(u * x, v * y) for x, y in WHOLE_SIDES for u, v in SIGNS]).T), axis=1)
"""Directions along which corners of turned pixels are centres of other pixels, but for the rounding of a direction."""


@given(
    st.lists(st.text("#.", min_size=7, max_size=7), min_size=1, max_size=9),
    st.tuples(*[st.one_of(st.floats(-20, 20), st.integers(-9, 40).map(lambda n: n / 2))] * 2),
)
@example([".......", "......#"], (3.0, 1.0))
def test_masks_are_turned_by_their_runs_as_by_their_pixels(mask: list[str], pivot: tuple[float, float]) -> None:
    weapon = Stencil([*mask, "#......"], pivot_xy=pivot)
    aims = np.concatenate([directions(len(mask), 9), TIES])
    runs = weapon.runs(aims)
    assert runs is not None
    for i, (c, s) in enumerate(aims.tolist()):
        assert spans_of(runs, i) == weapon.spans(c, s)


def spans_of(runs: rasterize.RowRuns, i: int) -> Spans:
    """Pixels of one of several shapes."""
    own = runs.shape == i
    return rasterize.RowRuns(
        runs.shape[own], runs.y[own], [(first[own], last[own]) for first, last in runs.parts]
    ).spans()


def each_run(runs: rasterize.RowRuns, count: int) -> list[list[list[int]]]:
    """Runs of each shape as (y, first, last), united."""
    return [spans_of(runs, i).runs().tolist() for i in range(count)]


@settings(deadline=None)
@given(
    st.lists(st.text("#.", min_size=17, max_size=17), min_size=1, max_size=17),
    st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999)),
    st.lists(st.one_of(st.sampled_from(SPECIAL), st.floats(-360, 360)), min_size=1, max_size=5),
)
def test_compiled_turned_masks_are_those_of_numpy(mask: list[str], pivot: tuple[int, int], aims: list[float]) -> None:
    pytest.importorskip("numba")
    kernels = importlib.import_module(COMPILED[rasterize.__name__])
    edges = rasterize.edges_of(np.array([[c == "#" for c in row] for row in [*mask, "#" * 17]]), pivot)
    split = all_quarters(np.concatenate([np.stack(unit(np.array(aims, float)), axis=1), TIES]))
    own, other = (each_run(one.turned_runs(edges, *split), len(split[0])) for one in (rasterize, kernels))
    assert own == other


def test_rectangles_of_a_mask_are_runs_of_equal_columns_in_adjacent_rows() -> None:
    mask = np.array([[c == "#" for c in row] for row in ("##.#", "##.#", ".#..", "....", "##..")])
    edges = rasterize.edges_of(mask, (0, 0))
    left, right, top, low = (edges.sides[:, : edges.begin[1]] + 128) // 256
    assert sorted(zip(left, right, top, low, strict=True)) == [(0, 2, 0, 2), (0, 2, 4, 5), (1, 2, 2, 3), (3, 4, 0, 2)]


def test_directions_are_split_together_as_one_by_one() -> None:
    every = np.concatenate(
        [directions(40), [[ONE, 0], [0, ONE], [-ONE, 0], [0, -ONE], [5, 5], [-5, 5], [5, -5], [-5, -5]]]
    )
    assert np.stack(all_quarters(every), axis=1).tolist() == [list(quarters(c, s)) for c, s in every.tolist()]


def test_stencils_that_may_be_too_large_are_turned_one_by_one() -> None:
    weapon, aims = Stencil(["##"], pivot_xy=(5000, 0)), directions(2)
    assert weapon.runs(aims) is None
    assert np.array_equal(patterns_of(weapon, aims).bits.box_xyxy[0], weapon.spans(*aims[0].tolist()).box_xyxy)


def test_patterns_without_bit_rows_are_made_one_by_one(jit: bool) -> None:
    weapon, aims = Beam(60_000 + jit, 3), directions(2)
    assert type(patterns_of(weapon, aims)) is PatternTable


def test_stencils_without_pixels_hit_nothing_at_any_aim(jit: bool) -> None:
    weapon, aims = Stencil(["..", ".."]), np.linspace(0, 350, 30 + jit)
    scene = Scene()
    scene.add(np.ones((9, 9), np.bool_), (5, 5))
    hits = fire(scene, weapon, [(5, 5)] * len(aims), aim=aims)
    assert len(hits) == 0 and not hits.verdicts.any()
    some = Stencil(["#.", ".."], pivot_xy=(-0.3, -0.3))  # a pixel that covers no centre at some aims
    for shot, row in zip(aims.tolist(), fire(scene, some, [(5, 5)] * len(aims), aim=aims).fired.tolist(), strict=True):
        assert row == fire(scene, some, (5, 5), aim=shot, strategy="spans").fired[0]


def test_strips_are_kept_for_long_patterns_alone() -> None:
    kept = {name for name, weapon in WEAPONS.items() if len(patterns_of(weapon, directions(5)).bits.strips)}
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


def same(module: Any, name: str, *given: Any) -> Any:
    """What a numpy kernel gives, which is compared with what the compiled one gives."""
    pytest.importorskip("numba")
    own, other = (getattr(one, name)(*given) for one in (module, importlib.import_module(COMPILED[module.__name__])))
    assert (own is None) == (other is None)
    for mine, others in zip(*map(columns, (own, other)), strict=True) if own is not None else ():
        assert np.array_equal(mine, others)
    return own


def columns(found: Any) -> list[Any]:
    """Columns of runs or of bit rows; an empty run may be told in any way."""
    if not isinstance(found, rasterize.RowRuns):
        return list(found)
    empty = [first > last for first, last in found.parts]
    ends = [np.where(none, 0, end) for none, part in zip(empty, found.parts, strict=True) for end in part]
    return [found.shape, found.y, *empty, *ends]


SIZES = st.one_of(st.integers(0, 300), st.integers(0, 20000), st.sampled_from([0, 1, 127, 128, 181, 182, 256, 25600]))
ANGLES = st.one_of(st.sampled_from(SPECIAL), st.floats(-360, 360))
AIMS_AT_A_TIME = st.lists(ANGLES, min_size=1, max_size=5)


def aimed_at(aims: list[float]) -> Any:
    return np.stack(unit(np.array(aims, float)), axis=1)


@settings(deadline=None)
@given(AIMS_AT_A_TIME, st.lists(st.tuples(SIZES, SIZES.map(lambda size: -size)), max_size=4))
def test_compiled_points_turn_as_those_of_numpy(aims: list[float], points: list[tuple[int, int]]) -> None:
    pytest.importorskip("numba")
    given = np.array(points, np.int64).reshape(-1, 2)
    found = np.array([turned(given, c, s) for c, s in aimed_at(aims).tolist()])
    for form in (fixed_point, importlib.import_module(COMPILED[fixed_point.__name__])):
        assert np.array_equal(form.turned_to(given, aimed_at(aims)), found)


@settings(deadline=None)
@given(AIMS_AT_A_TIME, SIZES, SIZES, SIZES)
def test_compiled_beams_are_those_of_numpy(aims: list[float], length: int, radius: int, x: int) -> None:
    a = np.array([x, -x // 3])
    runs = same(rasterize, "beams", a, a + turned(np.array([[length, 0]]), *aimed_at(aims).T), radius)
    same(bit_rows, "bits_of_runs", runs, len(aims), aimed_at(aims))


@settings(deadline=None)
@given(AIMS_AT_A_TIME, SIZES, ANGLES)
def test_compiled_cones_are_those_of_numpy(aims: list[float], reach: int, angle: float) -> None:
    c_half, s_half = map(int, unit(abs(angle) / 2))
    same(
        bit_rows,
        "bits_of_runs",
        same(rasterize, "cones", reach, aimed_at(aims), c_half, s_half),
        len(aims),
        np.zeros((0, 2), np.int64),
    )


@settings(deadline=None)
@given(st.lists(st.lists(st.tuples(SIZES, SIZES), min_size=3, max_size=3), min_size=1, max_size=4), AIMS_AT_A_TIME)
def test_compiled_polygons_are_those_of_numpy(rings: Any, aims: list[float]) -> None:
    runs = same(rasterize, "convex_polygons", np.array(rings))
    if runs is not None:
        same(bit_rows, "bits_of_runs", runs, len(rings), np.array(rings)[:, 0])
    box = Box(1 + rings[0][0][0] // 100, 1 + rings[0][0][1] // 100)._corners
    same(
        bit_rows,
        "bits_of_runs",
        same(rasterize, "convex_polygons", turned(box, *aimed_at(aims).T[..., None])),
        len(aims),
        aimed_at(aims),
    )


places = st.one_of(coordinates, st.integers(-3, 3).map(lambda n: 256 * n))
RINGS = st.lists(st.lists(st.tuples(places, places), min_size=3, max_size=7), min_size=1, max_size=3)


@settings(deadline=None)
@given(RINGS, AIMS_AT_A_TIME)
def test_rings_at_several_aims_are_each_filled_by_the_even_odd_rule(rings: Any, aims: list[float]) -> None:
    pytest.importorskip("numba")
    every, starts = np.concatenate([np.array(ring) for ring in rings]), np.cumsum([0, *map(len, rings)])[:-1]
    points = fixed_point.turned_to(every, np.concatenate([aimed_at(aims), [[ONE, 0]]]))
    for form in (rasterize, importlib.import_module(COMPILED[rasterize.__name__])):
        runs, expected = form.polygons(points, starts), [rasterize.polygon(np.split(one, starts[1:])) for one in points]
        assert [spans_of(runs, i) for i in range(len(points))] == expected
        for (mask, corner_xy), spans in zip(runs.masks(len(points)), expected, strict=True):
            assert Spans.from_mask(mask, corner_xy) == spans
            assert mask.shape == spans.to_mask()[0].shape


def test_masks_of_shapes_are_cropped_and_hold_any_number_of_runs_of_a_row() -> None:
    runs = [(np.array([7, rasterize.WIDEST, 0]), np.array([9, -rasterize.WIDEST, k])) for k in range(300)]
    shapes = rasterize.RowRuns(np.array([1, 1, 3]), np.array([4, 5, 6]), runs)
    masks = [(mask.shape, mask.all(), corner_xy) for mask, corner_xy in shapes.masks(5)]
    nothing = (0, 0), True, (0, 0)
    assert masks == [nothing, ((1, 3), True, (7, 4)), nothing, ((1, 300), True, (0, 6)), nothing]


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(-2, 2)), min_size=3, max_size=7), st.sampled_from([1, 256]))
def test_compiled_polygons_refuse_the_rings_that_numpy_refuses(ring: Any, size: int) -> None:
    same(rasterize, "convex_polygons", size * np.array([ring, ring[::-1]]))


@pytest.mark.parametrize("aim", [0, 1e-4, 89.99, 90, 135, 180.3, 269.9999, 45])
def test_compiled_shapes_of_the_longest_reach_are_those_of_numpy(aim: float) -> None:
    longest, direction = 256 * REACH_MAX, aimed_at([aim])
    end = turned(np.array([[longest, 0]]), *direction.T)
    for radius in (0, 100, 5000):
        same(rasterize, "beams", np.zeros(2, np.int64), end, radius)
    same(rasterize, "cones", longest, direction, *map(int, unit(0.001)))
    same(
        rasterize,
        "convex_polygons",
        turned(256 * np.array([(0, -3), (REACH_MAX, -3), (REACH_MAX, 4), (0, 1)]), *direction.T)[None],
    )


def test_compiled_widest_shapes_are_those_of_numpy() -> None:
    longest = 256 * REACH_MAX
    same(rasterize, "beams", np.zeros(2, np.int64), np.array([[longest, longest // 3]]), longest)
    for half in (30, 90, 120, 180):
        same(rasterize, "cones", longest, aimed_at([33]), *map(int, unit(half)))


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


@pytest.mark.parametrize(("name", "corner"), in_turn([*WEAPONS, *MORE], [(0, 0), (-(10**9), 10**9)]))
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
    assert isinstance(first, AimedTable)
    assert patterns_of(Beam(77, 5), direction.copy()).bits is first.bits
    assert patterns_of(Beam(78, 5), direction).bits is not first.bits
    assert first.patterns[0] is pattern_of(Beam(77, 5), *direction[0].tolist())
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
