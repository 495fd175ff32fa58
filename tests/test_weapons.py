"""The weapons: their patterns, their JSON, their weights, and what they refuse."""

from __future__ import annotations

import copy
import gc
import json
import math
import pickle
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from fractions import Fraction
from math import floor, isqrt
from typing import Any
from weakref import ref

import numpy as np
import oracle_raster
import pytest
from examples import examples
from hypothesis import HealthCheck, assume, example, given
from hypothesis import strategies as st
from some_of import some_of

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    InputError,
    Laser,
    Pistol,
    Point,
    Polygon,
    Ring,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Sweep,
    Weapon,
    fire,
    weapon_from_json,
)
from hitplanes.planes.bits import tiles
from hitplanes.planes.common.backend import LruCache
from hitplanes.planes.grid.fixed_point import ONE, unit
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.scene.sprite import rows_of
from hitplanes.weapons.fire import prefilter as narrow
from hitplanes.weapons.kinds import areas
from hitplanes.weapons.kinds import weapon as windows
from hitplanes.weapons.kinds.areas import AreaWeapon, pattern_of
from hitplanes.weapons.kinds.weapon import falloff_weights

ARROW = ["..#..", ".###.", "#####", "..#.."]
PLAIN: list[AreaWeapon] = [
    Point(),
    Disc(4.5, falloff="linear"),
    Ring(3, 6.25),
    Box(5, 4, pierce=True),
    Polygon([(-5, -4), (6, 0), (-5, 4)], holes=[[(-3, -1), (0, 0), (-3, 1)]]),
    Cone(9, 40, falloff="smooth"),
    Beam(12, 1.5, pierce=True),
    Stencil(ARROW, pivot_xy=(2, 1)),
]
EVERY: list[Weapon] = [
    *PLAIN,
    Spread(Disc(2), count=8, radius=20),
    Rounds(Spread(Point(), count=3, radius=4), count=3, recoil_xy=(1, -6.5), recoil_deg=2),
]


def drawn(spans: Spans) -> list[str]:
    mask, _ = spans.to_mask()
    return ["".join("#" if v else "." for v in row) for row in mask.tolist()]


@pytest.mark.parametrize("weapon", EVERY, ids=lambda w: w.kind)
def test_json_round_trip(weapon: Weapon) -> None:
    again = weapon_from_json(weapon.to_json())
    assert again == weapon and hash(again) == hash(weapon)
    scene = Scene((40, 40))
    scene.add(np.ones((30, 30), np.bool_), (20, 20))
    shots = [(18, 18), (3.7, 29)]
    assert fire(scene, weapon, shots, aim=33, seed=5) == fire(scene, again, shots, aim=33, seed=5)


def test_weapons_differ_by_any_field() -> None:
    assert Disc(4) != Disc(5) and Disc(4) != Disc(4, pierce=True) and Disc(4) != Ring(0, 4)
    assert len({Disc(4), Disc(4), Disc(5)}) == 2


@pytest.mark.parametrize(("width", "height"), [(1, 1), (4, 3), (5, 2), (6, 6)])
def test_box_is_exactly_its_size_and_even_sides_lie_right_and_below(width: int, height: int) -> None:
    spans = Box(width, height).spans(ONE, 0)
    assert spans.box_xyxy == (-((width - 1) // 2), -((height - 1) // 2), width // 2, height // 2)
    assert spans.count == width * height


@pytest.mark.parametrize("weapon", PLAIN, ids=lambda w: w.kind)
@pytest.mark.parametrize("degrees", [0, 11, 45, 100.5])
def test_a_quarter_turn_of_the_aim_turns_the_pattern(weapon: AreaWeapon, degrees: float) -> None:
    c, s = (int(v) for v in unit(degrees))
    turned = {(-y, x) for x, y in weapon.spans(c, s).pixels().tolist()}
    assert {tuple(p) for p in weapon.spans(-s, c).pixels().tolist()} == turned


def test_stencil_is_aimed_like_a_sprite() -> None:
    stencil = Stencil(ARROW, pivot_xy=(2, 1))
    assert drawn(stencil.spans(ONE, 0)) == ARROW
    assert drawn(stencil.spans(0, ONE)) == [".#..", ".##.", "####", ".##.", ".#.."]
    assert stencil.spans(ONE, 0).box_xyxy == (-2, -1, 2, 2)


diagonals = st.integers(-9, 9).map(lambda n: 90.0 * n + 45.0)
near_diagonals = st.one_of(
    diagonals,
    st.builds(math.nextafter, diagonals, st.sampled_from([-1e3, 1e3])),
    st.builds(lambda angle, offset: angle + offset, diagonals, st.floats(-1e-6, 1e-6)),
    st.builds(lambda angle, offset: angle + offset, diagonals, st.floats(-4e-8, 4e-8)),  # they round to the diagonal
)
beside_diagonals = st.builds(
    lambda x, y, length, off: (x * length, y * length + off),
    *2 * [st.sampled_from([-1, 1])],
    st.sampled_from([3, 2**24, 2**30, 2**38]),
    st.integers(-3, 3),
)
any_angle = st.one_of(near_diagonals, st.integers(-24, 24).map(lambda n: 15.0 * n), st.floats(-1e4, 1e4))
masks = st.tuples(st.integers(1, 5), st.integers(1, 5)).flatmap(
    lambda shape: st.lists(st.booleans(), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]).map(
        lambda pixels: np.array([True, *pixels[1:]]).reshape(shape)
    )
)
pivots = st.none() | st.tuples(*2 * [st.integers(-4, 9).map(lambda n: n / 2)])
TURNS = examples(150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def fired_pixels(stencil: Stencil, **aimed: Any) -> set[tuple[int, int]]:
    """Pixels of a shot from (0, 0)."""
    return {(x, y) for x, y in fire(Scene(), stencil, (0, 0), **aimed).samples_at(0).xy.tolist()}


def turned_pixels(mask: np.ndarray, pivot: tuple[float, float] | None, angle: float) -> set[tuple[int, int]]:
    """Pixels of a sprite at (0, 0)."""
    scene = Scene()
    scene.add(Sprite.from_mask(mask, pivot_xy=pivot), (0, 0), angle=angle)
    found, (left, top) = scene.mask(0)
    return {(x + left, y + top) for y, x in np.argwhere(found).tolist()}


@TURNS
@given(masks, pivots, any_angle)
@example(np.ones((3, 4), np.bool_), None, 44.99999999)
@example(np.ones((3, 4), np.bool_), None, math.nextafter(-135.0, 0))
@example(np.ones((4, 3), np.bool_), (1.5, 0.0), 45.00000002)
def test_a_stencil_covers_the_pixels_of_a_sprite_turned_by_its_aim(
    jit: bool, mask: np.ndarray, pivot: tuple[float, float] | None, angle: float
) -> None:
    assert fired_pixels(Stencil(mask, pivot), aim=angle) == turned_pixels(mask, pivot, angle)


@TURNS
@given(masks, pivots, st.one_of(beside_diagonals, st.tuples(*2 * [st.integers(-3000, 3000)])))
@example(np.ones((3, 4), np.bool_), None, (2**38, 2**38 - 1))
@example(np.ones((3, 4), np.bool_), None, (-7, -7))
@example(np.eye(12, 1, dtype=np.bool_).reshape(3, 4) | np.eye(12, dtype=np.bool_)[11].reshape(3, 4), None, (3, 4))
def test_a_stencil_fired_toward_a_point_is_turned_by_the_same_rule(
    jit: bool, mask: np.ndarray, pivot: tuple[float, float] | None, toward_256: tuple[int, int]
) -> None:
    """As a sprite by the angle whose direction, once rounded, is that of the point."""
    x, y = toward_256
    angle = math.degrees(math.atan2(y, x))
    assume((x or y) and oracle_raster.unit(angle) == oracle_raster.unit_toward(x, y))
    assert fired_pixels(Stencil(mask, pivot), toward=(x / 256, y / 256)) == turned_pixels(mask, pivot, angle)


def test_a_stencil_is_made_without_a_step_of_python_for_each_pixel() -> None:
    """As are masks of nested lists and of rows of '#' and '.'."""
    mask = np.hypot(*np.indices((128, 128)) - 64) < 60
    steps: list[str] = []
    sys.setprofile(lambda _, event, what: steps.append(event))
    stencils = [Stencil(given) for given in (mask, mask.tolist(), rows_of(mask))]
    reaches = [stencil.reach_256 for stencil in stencils]
    sys.setprofile(None)
    assert len(steps) < mask.size
    assert {stencil.mask for stencil in stencils} == {tuple(rows_of(mask))}
    farthest = max((x - 63) ** 2 + (y - 63) ** 2 for y, x in np.argwhere(mask).tolist())
    assert set(reaches) == {isqrt(256**2 * farthest - 1) + 1}


def test_arrays_are_taken_and_left_as_they_were() -> None:
    mask = np.eye(3, dtype=np.bool_)
    stencil = Stencil(mask)
    mask[0, 0] = False
    assert drawn(stencil.spans(ONE, 0)) == ["#..", ".#.", "..#"]
    points = np.array([(-2.0, -2), (2, -2), (0, 3)])
    polygon = Polygon(points)  # type: ignore[arg-type]
    points[:] = 0
    assert polygon.spans(ONE, 0).count > 8


@given(st.integers(0, 10**6), st.integers(1, 2**28), st.sampled_from(["linear", "smooth"]))
def test_weights_are_exact(distance2: int, reach_256: int, falloff: str) -> None:
    lost = isqrt(int(Fraction(65535 * 256, reach_256) ** 2 * distance2))
    weight = max(65535 - lost, 0)
    if falloff == "smooth":
        weight = weight**2 * (3 * 65535 - 2 * weight) // 65535**2
    assert falloff_weights(np.array([distance2]), falloff, reach_256).tolist() == [weight]


@given(st.integers(2**15, 65535), st.integers(2**27, 2**28))
def test_weights_are_exact_just_short_of_a_whole_number(lost: int, reach_256: int) -> None:
    """The greatest distance that loses less than `lost`: the float is often nearer to it than its error."""
    distance2 = ((lost * reach_256) ** 2 - 1) // (65535 * 256) ** 2
    weights = falloff_weights(np.array([distance2, distance2 + 1]), "linear", reach_256)
    assert weights.tolist() == [65535 - (lost - 1), 65535 - lost]


def test_weights_at_whole_parts_of_the_reach() -> None:
    distances = np.array([0, 1, 9, 25, 225, 226])
    assert falloff_weights(distances, "linear", 15 * 256).tolist() == [65535, 61166, 52428, 43690, 0, 0]
    smooth = falloff_weights(np.arange(16) ** 2, "smooth", 15 * 256)
    assert smooth[0] == 65535 and smooth[15] == 0 and (np.diff(smooth) < 0).all()


def test_falloff_goes_into_the_rows() -> None:
    scene = Scene()
    scene.add(np.ones((1, 30), np.bool_), (15, 0))
    for at in ((0, 0), (20, 0)):
        (row,) = fire(scene, Beam(10, 0, falloff="linear"), at)
        seen = [abs(x - at[0]) for x in range(at[0], at[0] + 11) if 0 <= x - 1 < 30]
        assert row.weight == sum(65535 - isqrt(65535**2 * d * d // 100) for d in seen)
    (full,) = fire(scene, Beam(10, 0), (5, 0))
    assert full.weight == 65535 * full.samples


def test_patterns_are_made_once() -> None:
    assert pattern_of(Disc(7), ONE, 0) is pattern_of(Disc(7), ONE, 0)


DISC = {"kind": "disc", "radius": 3}
BAD: list[tuple[Any, str]] = [
    (7, "expected an object with a kind"),
    (Disc(3), "expected an object with a kind, got Disc(radius=3.0): give what its to_json() returns"),
    ({"knd": "disc", "radius": 3}, "key: expected one of 'kind', got 'knd' (did you mean 'kind'?)"),
    ({"radius": 3}, "kind: expected one of"),
    ({}, "kind: expected one of"),
    ({"kind": "disk", "radius": 3}, "did you mean 'disc'?"),
    ({"kind": "disc"}, "radius: expected a value, got nothing"),
    ({**DISC, "radios": 3}, "key: expected one of"),
    ({**DISC, "radius": "3"}, "radius: expected a number, got '3'"),
    ({**DISC, "radius": [3]}, "radius: expected shape ()"),
    ({**DISC, "radius": -1}, "radius: expected a number from 0"),
    ({**DISC, "radius": float("nan")}, "radius: expected a finite number"),
    ({**DISC, "radius": 2**20 + 1}, "radius: expected a number from 0 to"),
    ({**DISC, "pierce": 1}, "pierce: expected true or false"),
    ({**DISC, "falloff": "lineer"}, "did you mean 'linear'?"),
    ({"kind": "ring", "inner_radius": 5, "outer_radius": 4}, "inner_radius: expected at most outer_radius, 4"),
    ({"kind": "box", "width": 2.5, "height": 3}, "width: expected a whole number"),
    ({"kind": "box", "width": 0, "height": 3}, "width: expected a whole number"),
    ({"kind": "polygon", "points": [[0, 0], [1, 1]]}, "points: expected 3 points or more, got 2"),
    ({"kind": "polygon", "points": [[0, 0, 0]] * 3}, "points: expected shape (any, 2)"),
    ({"kind": "polygon", "points": [[0, 0], [1, float("inf")], [2, 2]]}, "points[1][1]: expected a finite number"),
    ({"kind": "polygon", "points": [[0, 0], [4, 0], [0, 4]], "holes": [[[1, 1]]]}, "holes[0]: expected 3 points"),
    ({"kind": "polygon", "points": [[0, 0], [4, 0], [0, 4]], "holes": 3}, "holes: expected a list"),
    ({"kind": "cone", "reach": 9, "angle": 361}, "angle: expected a number from 0 to 360"),
    ({"kind": "beam", "length": -9, "width": 1}, "length: expected a number from 0"),
    ({"kind": "stencil", "mask": ["##", "#"]}, "mask[1]: expected 2 of '#' and '.'"),
    ({"kind": "stencil", "mask": ["#x"]}, "mask[0]: expected 2 of '#' and '.'"),
    ({"kind": "stencil", "mask": 5}, "mask: expected"),
    ({"kind": "stencil", "mask": [[0, 2]]}, "mask[0][1]: expected 0 or 1"),
    ({"kind": "spread", "pellet": 3, "count": 2, "radius": 1}, "pellet: expected an object with a kind"),
    ({"kind": "spread", "pellet": {**DISC, "radius": -1}, "count": 2, "radius": 1}, "pellet: radius: expected"),
    ({"kind": "spread", "pellet": DISC, "count": 0, "radius": 1}, "count: expected a whole number from 1"),
    ({"kind": "spread", "pellet": DISC, "count": 10**9, "radius": 1}, "count: expected a whole number from 1"),
    ({"kind": "rounds", "weapon": DISC, "count": 2, "recoil_xy": [1]}, "recoil_xy: expected shape (2,)"),
    ({"kind": "rounds", "weapon": DISC, "count": True}, "count: expected a whole number"),
]


@pytest.mark.parametrize(("data", "told"), BAD)
def test_bad_weapons_are_refused_by_name(data: Any, told: str) -> None:
    with pytest.raises(InputError) as caught:
        weapon_from_json(data, "weapons.gun")
    assert str(caught.value).startswith("weapons.gun: ") and told in str(caught.value)


def test_a_spread_holds_one_pattern_and_rounds_no_rounds() -> None:
    spread = {"kind": "spread", "pellet": DISC, "count": 2, "radius": 3}
    with pytest.raises(InputError, match=r"pellet: kind: expected one of .*'projectile', got 'spread'"):
        weapon_from_json({**spread, "pellet": spread})
    rounds = {"kind": "rounds", "weapon": DISC, "count": 2}
    with pytest.raises(InputError, match=r"weapon: kind: expected one of .*'sweep', got 'rounds'"):
        weapon_from_json({**rounds, "weapon": rounds})
    with pytest.raises(InputError, match="pellet: expected a weapon of one pattern"):
        Spread(Rounds(Disc(1), 2), 2, 3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="weapon: expected a weapon other than rounds"):
        Rounds(Rounds(Disc(1), 2), 2)  # type: ignore[arg-type]


def test_recoil_shifts_and_turns_each_round() -> None:
    scene = Scene()
    scene.add(np.ones((101, 101), np.bool_), (0, 0))
    hits = fire(scene, Rounds(Point(), count=4, recoil_xy=(2.5, -3)), (0, 0))
    assert hits.first_xy.tolist() == [[0, 0], [3, -3], [5, -6], [8, -9]]
    assert hits.distance2.tolist() == [0, 0, 0, 0]
    turned = fire(scene, Rounds(Beam(20, 0), count=2, recoil_deg=90), (0, 0), aim=0)
    alone = [fire(scene, Beam(20, 0), (0, 0), aim=angle).samples_at(0).xy.tolist() for angle in (0, 90)]
    assert turned.samples_at(0).xy.tolist() == alone[0] + alone[1]


def test_a_shot_aimed_toward_a_point_passes_through_it() -> None:
    for x, y in ((30, 40), (-7.2, 2.1), (0.25, -60), (-50, -50), (3.4, 90.3)):
        xy = fire(Scene(), Beam(100, 0), (0, 0), toward=(x, y)).samples_at(0).xy.tolist()
        assert [floor(x + 0.5), floor(y + 0.5)] in xy


@pytest.mark.parametrize(
    ("weapon", "plain"),
    [
        (Disc(np.int64(3), pierce=np.bool_(True)), Disc(3, pierce=True)),  # type: ignore[arg-type]
        (Disc(np.float32(2.5)), Disc(2.5)),  # type: ignore[arg-type]
        (Box(3.0, np.int8(4)), Box(3, 4)),  # type: ignore[arg-type]
        (Cone(np.array(9), 40), Cone(9.0, 40.0)),  # type: ignore[arg-type]
        (Spread(Point(), np.int64(4), 3), Spread(Point(), 4, 3.0)),  # type: ignore[arg-type]
        (Rounds(Point(), np.uint8(2), np.array([1, 2])), Rounds(Point(), 2, (1.0, 2.0))),  # type: ignore[arg-type]
    ],
)
def test_numbers_of_numpy_are_kept_as_plain_ones(weapon: Weapon, plain: Weapon) -> None:
    assert weapon == plain and hash(weapon) == hash(plain)
    assert json.loads(json.dumps(weapon.to_json())) == plain.to_json()
    assert fire(Scene(), weapon, (0, 0)) == fire(Scene(), plain, (0, 0))


def test_pellets_of_a_burst_are_limited_as_a_whole() -> None:
    assert Rounds(Spread(Point(), 256, 5), 256).count == 256
    with pytest.raises(InputError, match="count: expected a whole number from 1 to 256, got 257"):
        Rounds(Spread(Point(), 256, 5), 257)


def test_patterns_that_are_kept_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = caches(monkeypatch, 40_000)[0]
    for degrees in range(60):
        pattern_of(Beam(40, 2), *(int(v) for v in unit(degrees)))
        text = len(Beam(40, 2).text)
        assert kept.bytes == sum(p.nbytes + text for p in kept.values.values()) <= 40_000
    assert len(kept.values) > 3


def caches(monkeypatch: pytest.MonkeyPatch, limit: int) -> list[LruCache[Any, Any]]:
    """Empty caches of a limit for all that is kept of patterns, the patterns themselves first."""
    made = []
    for module, name in (
        (areas, "_kept"), (windows, "_kept"), (windows, "_kept_columns"), (windows, "_kept_bigs"), (narrow, "_kept")
    ):  # fmt: skip
        old = getattr(module, name)
        made.append(LruCache(limit, old.size, old.key_size))
        monkeypatch.setattr(module, name, made[-1])
    return made


@pytest.fixture
def uncollected() -> Iterator[None]:
    """Do without the garbage collector."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def fire_every_way(scene: Scene, weapon: Weapon) -> None:
    """One shot and many, by every strategy and pre-filter; all that is worked out of a pattern is."""
    many = [(10 + 3 * i, 20) for i in range(70)]
    for strategy in ("auto", "direct", "built"):
        fire(scene, weapon, many, aim=17, strategy=strategy)
        fire(scene, weapon, (50, 50), aim=17, strategy=strategy)
    for prefilter in ("none", "box", "circle", "oriented box", "4 boxes", "polygon", "swept"):
        fire(scene, weapon, many, aim=17, prefilter=prefilter, strategy="direct")
    fire(scene, weapon, many, aim=list(range(70)))
    hits = fire(scene, weapon, (50, 50), aim=17)
    assert hits.verdict_counts() and hits.shares() is not None and hits.pixels_at() is not None


def aimed_world() -> Scene:
    scene = Scene((200, 200))
    scene.add(Sprite.circle(30), (60, 60))
    scene.add(Sprite.box(5, 90), (120, 60), angle=20, role="occluder")
    return scene


def warmed(weapon: Weapon) -> Scene:
    """A scene, after kernels for a weapon were loaded: what loads them may leave cycles that hold what was fired."""
    scene = aimed_world()
    if isinstance(weapon, AreaWeapon):
        fire_every_way(scene, weapon)
    fire(scene, weapon, (50, 50), aim=17)
    fire(scene, weapon, [(50, 50), (60, 20)], aim=17)
    gc.collect()
    return scene


@pytest.mark.parametrize("weapon", some_of(PLAIN), ids=lambda w: w.kind)
@pytest.mark.usefixtures("jit", "uncollected")
def test_a_pattern_that_is_given_up_goes_without_the_garbage_collector(
    weapon: AreaWeapon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be known again by other caches, which hold what is made of it; none of them holds it."""
    scene = warmed(weapon)
    kept, weapon = caches(monkeypatch, 2**26)[0], copy.copy(weapon)  # one that knows no pattern yet
    fire_every_way(scene, weapon)
    patterns = [ref(pattern) for pattern in kept.values.values()]
    kept.values.clear()
    assert patterns and not any(pattern() for pattern in patterns)
    again = weapon_from_json(weapon.to_json())
    assert fire(scene, again, (50, 50), aim=17) == fire(scene, weapon, (50, 50), aim=17)


@pytest.mark.parametrize("weapon", some_of([*EVERY, Laser(9), Sweep(Laser(9), 3, 20)]), ids=lambda w: w.kind)
@pytest.mark.usefixtures("jit", "uncollected")
def test_a_weapon_that_was_fired_goes_without_the_garbage_collector(weapon: Weapon) -> None:
    """As one that is made anew for each shot."""
    scene, own = warmed(weapon), weapon_from_json(weapon.to_json())
    known = ref(own)
    fire(scene, own, (50, 50), aim=17)
    fire(scene, own, [(50, 50), (60, 20)], aim=17)
    del own
    assert known() is None


DISTINCT: dict[str, Callable[[int], AreaWeapon]] = {
    "ring": lambda i: Ring(40, 41 + i / 9),
    "faded disc": lambda i: Disc(20 + i / 9, falloff="smooth"),
    "beam": lambda i: Beam(60 + i / 9, 2),
    "point": lambda i: Disc(i / 200),
    "stencil": lambda i: Stencil(["#" * 30] * (i + 1), pivot_xy=(9, i)),
    "long text": lambda i: Polygon([(i, 0), *((i + 2, j / 99) for j in range(300))]),
}


def work_out(weapon: AreaWeapon) -> None:
    """All that is worked out of a pattern and kept, here or there."""
    pattern = pattern_of(weapon, *(int(v) for v in unit(17)))
    for worked_out in ("spans", "prefix", "count", "box_xyxy"):
        getattr(pattern.table, worked_out)
    for worked_out in ("strip", "window_bytes"):
        getattr(pattern, worked_out)
    for _ in range(2):
        windows.pattern_bits_of([pattern])
    nearest = windows.big_of(pattern).depths.nearest
    for _ in range(tiles.OFTEN + 1):
        nearest(1)
    for prefilter in ("circle", "oriented box", "boxes", "polygon", "swept"):
        narrow.pattern_volumes(prefilter, [pattern])


@pytest.mark.parametrize("kind", some_of(DISTINCT))
@pytest.mark.usefixtures("uncollected")
def test_caches_of_patterns_hold_no_more_than_they_count(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many patterns and all that is worked out of them, as the allocator tells, without the garbage collector."""
    work_out(DISTINCT[kind](99))
    limit = 2**17
    made = caches(monkeypatch, limit)
    monkeypatch.setattr("hitplanes.planes.scene.variants._kept", LruCache(1, lambda variant: variant.mask.nbytes))
    tracemalloc.start()
    for i in range(20):
        work_out(DISTINCT[kind](i))
    assert all(one.bytes <= limit or len(one.values) == 1 for one in made)
    for one in made:
        before = tracemalloc.get_traced_memory()[0]
        one.values.clear()
        assert before - tracemalloc.get_traced_memory()[0] <= one.bytes + 4096
    left = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert left < limit, "what was given up is still held"


@pytest.mark.parametrize(
    "weapon", [Disc(3), Rounds(Spread(Disc(2), 3, 4), 2), Sweep(Laser(9), 3, 20), Stencil(["##", "#."])]
)
def test_a_weapon_that_was_fired_can_be_copied(weapon: Weapon) -> None:
    """What is worked out of its fields and kept with it is no part of it."""
    scene = Scene((30, 30))
    scene.add(Sprite.circle(5), (15, 15))
    hits, told = fire(scene, weapon, (12, 12)), repr(weapon)
    for copied in (copy.deepcopy(weapon), pickle.loads(pickle.dumps(weapon))):
        assert copied == weapon and repr(copied) == told and fire(scene, copied, (12, 12)) == hits


@pytest.mark.parametrize(
    ("weapon", "text"),
    [
        (Point(), "Point()"),
        (Disc(3), "Disc(radius=3.0)"),
        (Disc(3, pierce=True, falloff="linear"), "Disc(radius=3.0, pierce=True, falloff='linear')"),
        (Laser(None), "Laser(range=None)"),
        (Spread(Pistol(9), count=3, radius=2), "Spread(pellet=Pistol(range=9.0), count=3, radius=2.0)"),
    ],
)
def test_a_weapon_prints_as_what_made_it(weapon: Weapon, text: str) -> None:
    assert repr(weapon) == text
    assert eval(text, globals()) == weapon


def test_a_long_weapon_prints_on_a_line() -> None:
    assert len(repr(Stencil(np.ones((300, 300), np.bool_)))) < 100
