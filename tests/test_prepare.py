"""A weapon made ready: each shot is what `fire` gives, of the scene as it is, also when it is asked later."""

from __future__ import annotations

import gc
import math
import random
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from some_of import in_turn
from test_fire import Placements, expected, some_battle, some_place, some_pose, told

from hitplanes import (
    ALL,
    Beam,
    Box,
    Cone,
    Disc,
    Hits,
    InputError,
    Laser,
    Pistol,
    Point,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Weapon,
    fire,
    prepare,
    use_jit,
)
from hitplanes.planes.bits import tiles
from hitplanes.planes.bits.tiles import pixels_of, rows_of_spans
from hitplanes.planes.common import costs
from hitplanes.planes.grid.fixed_point import pixel, snap
from hitplanes.planes.grid.spans import Spans
from hitplanes.weapons.prepared import position_cache
from hitplanes.weapons.prepared.one_shot import OneShot
from hitplanes.weapons.prepared.position_cache import ODD, PIXEL
from hitplanes.weapons.prepared.prepare import filtered

WORLD = (220, 160)
MASK = np.array([[1, 0, 1], [0, 1, 0]], bool)


def crowd(seed: int, size_wh: tuple[int, int] | None = WORLD, objects: int = 40) -> Scene:
    """Irregular objects, some hundred px wide, in three layers, and some occluders; a part of them off the bounds."""
    rng = np.random.default_rng(seed)
    scene = Scene(size_wh, categories=("glass",))
    for k in range(objects):
        side = rng.integers(1, (30, 30, 130)[k % 3], 2)
        mask = rng.random(side) < (0.05, 0.6, 1.0)[rng.integers(3)]
        pose = {
            "layer": int(rng.integers(3)),
            "categories": int(rng.integers(1, 4)),
            "owner": None if k % 4 else k // 2,
        }
        role = "occluder" if k % 5 == 0 else "hittable"
        scene.add(mask, rng.uniform((-30, -30), (250, 190)), role=role, angle=(0.0, 90.0, 33.0)[k % 3], **pose)
    return scene


def same(got: Hits, truth: Hits) -> None:
    """All that can be asked of one answer is the same of the other."""
    assert len(got) == len(truth)
    assert bool(got) == bool(truth)
    assert got == truth
    assert truth == got
    assert list(got) == list(truth) == got.of(0)
    assert got.verdict_counts() == truth.verdict_counts()
    assert got.fired.tolist() == truth.fired.tolist()
    assert got.starts.tolist() == truth.starts.tolist()


@pytest.mark.parametrize("compiled", [False, True])
def test_random_scenes_against_the_oracle(compiled: bool) -> None:
    """Small crowded worlds, any weapon but rays, filters, falloff, targets and aims, and changes between the shots."""
    if compiled:
        squares = pytest.importorskip("hitplanes.weapons.prepared.compiled")

    @settings(max_examples=40, deadline=None)
    @given(st.integers(0, 10**6))
    def check(seed: int) -> None:
        with ExitStack() as patches:
            patches.enter_context(mock.patch.object(tiles, "OFTEN", 2))
            now = costs.NUMPY._replace(visible_made=10_000 * (seed % 3), visible_tile=0)
            patches.enter_context(mock.patch.object(costs, "NUMPY", now))
            if compiled and seed % 2:
                now = squares.COMPILED._replace(visible_made=seed % 1000, visible_tile=0)
                patches.enter_context(mock.patch.object(squares, "COMPILED", now))
            check_random_scene(seed)

    use_jit(compiled)
    try:
        check()
    finally:
        use_jit(None)


def check_random_scene(seed: int) -> None:
    battle, rng = some_battle(seed), random.Random(seed)
    scene, volley = battle.scene(), battle.volley
    filtered = volley.shots[0]
    ready = prepare(
        scene,
        volley.weapon,
        accept=filtered.accept,
        blocked_by=filtered.blocked_by,
        exclude=list(filtered.exclude),
        seed=volley.seed,
    )
    for one in [*volley.shots, *volley.shots]:
        shot = replace(one, accept=filtered.accept, blocked_by=filtered.blocked_by, exclude=filtered.exclude)
        aim, toward = (None, shot.toward) if shot.toward is not None else (shot.aim, None)
        rows, verdicts = expected(scene, Placements(volley.weapon, [shot], volley.seed))
        for _ in range(rng.randint(1, 3)):
            got = ready.fire(shot.at, aim=aim, toward=toward, shot=shot.number)
            count = len(got)
            assert told(got) == (rows, verdicts), f"{seed=}"
            assert count == len(rows)
        straight = [ready.fire(shot.at) for _ in range(4)]
        filters = {"accept": filtered.accept, "blocked_by": filtered.blocked_by, "exclude": list(filtered.exclude)}
        alone = fire(scene, volley.weapon, shot.at, **filters, seed=volley.seed, strategy="direct")
        assert all(one == alone for one in straight), f"{seed=}"
        changed(scene, rng)


def changed(scene: Scene, rng: random.Random) -> None:
    """Move, turn, remove or add something."""
    ids = scene.ids().tolist()
    kind = rng.choice(["move", "set", "remove", "add", "layer", "role", "nothing"])
    if kind == "add" or not ids:
        scene.add(Sprite.box(rng.randint(1, 9), rng.randint(1, 9)), some_place(rng, (0, 0)))
    elif kind == "move":
        some = rng.sample(ids, rng.randint(1, len(ids)))
        scene.move(some, [some_place(rng, (0, 0)) for _ in some])
    elif kind == "set":
        pose = some_pose(rng, 1)
        scene.set(rng.choice(ids), angle=pose["angle"], flip=pose["flip"])
    elif kind == "remove":
        scene.remove(rng.choice(ids))
    elif kind == "layer":
        scene.set(rng.choice(ids), layer=rng.randint(-3, 3), categories=rng.choice([1, 2, 3]))
    elif kind == "role":
        scene.set(rng.choice(ids), role=rng.choice(["hittable", "occluder", "mover"]))


WEAPONS: dict[str, tuple[Weapon, dict[str, Any]]] = {
    "point": (Point(), {}),
    "piercing point": (Point(pierce=True), {"accept": ["default"]}),
    "disc": (Disc(20), {}),
    "piercing": (Disc(40, pierce=True), {}),
    "largest whole": (Disc(47.9), {"exclude": [1, 4]}),
    "fading": (Disc(47.9, falloff="smooth"), {"exclude": [1, 4]}),
    "first in tiles": (Disc(48), {"accept": ["glass"]}),
    "tiles": (Disc(90, pierce=True), {}),
    "nothing": (Stencil([".."]), {}),
    "beam": (Beam(200, 9), {}),
    "box": (Box(31, 8), {"exclude": 2}),
    "shotgun": (Spread(Disc(2), 6, 21.3), {"seed": 5}),
    "fading shotgun": (Spread(Disc(9, falloff="linear"), 6, 40), {"seed": 5}),
    "fading cones": (Spread(Cone(70, 50, falloff="smooth", pierce=True), 3, 9), {}),
    "a single pellet": (Spread(Disc(2), 1, 21.3), {"seed": 3}),
    "burst of single pellets": (Rounds(Spread(Disc(1), 1, 15), 2), {}),
    "wide spread": (Spread(Box(9, 2), 6, 80), {"seed": 2**64 - 1}),
    "burst": (Rounds(Beam(60, 3), 3, (5, -70), 11), {}),
    "sub-pixel recoil": (Rounds(Disc(5), 3, (0.3, 7)), {}),
    "burst of spreads": (Rounds(Spread(Disc(3, pierce=True), 3, 8), 2, (0, 4)), {"accept": ["default"]}),
    "burst of fading spreads": (Rounds(Spread(Cone(40, 60, falloff="linear"), 4, 20), 3, (-4, 9), 30), {"seed": 9}),
    "giant": (Disc(600), {}),
    "pistol": (Pistol(100), {"exclude": 3}),
    "line of sight": (Laser(None), {}),
}


def visible_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let compiled kernels make the visible set soon."""
    now = costs.COMPILED._replace(visible_made=400, visible_tile=0)
    monkeypatch.setattr("hitplanes.weapons.prepared.compiled.COMPILED", now)


@pytest.mark.parametrize(("name", "bounded"), in_turn(WEAPONS, [True, False]))
def test_every_weapon_in_a_crowd(name: str, bounded: bool, jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wide masks, edges, shots off the bounds, an aim, a target, a number; all while the scene changes."""
    if jit:
        visible_soon(monkeypatch)
    check_weapon(name, bounded, monkeypatch)


def check_weapon(name: str, bounded: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tiles, "OFTEN", 1 if bounded else 3)
    now = costs.NUMPY._replace(tiles_call=10**9 if bounded else 10**5, visible_made=10_000, visible_tile=0)
    monkeypatch.setattr(costs, "NUMPY", now)
    weapon, options = WEAPONS[name]
    scene, rng = crowd(7, WORLD if bounded else None), np.random.default_rng(3)
    ready, rows = prepare(scene, weapon, **options), 0
    for k in range(14):
        at = tuple((rng.integers(-60 * 256, 300 * 256, 2) / 256).tolist())
        how = [{}, {"aim": 22.5}, {"toward": (at[0] - 3, at[1] + 1)}, {"shot": 9}, {"aim": -90.0, "shot": 9}, {}][k % 6]
        if name == "line of sight":
            how = {"toward": (at[0] - 3 - k, at[1] + 1)}
        for _ in range(3):
            got = ready.fire(at, **how)
            same(got, fire(scene, weapon, at, strategy="direct", **options, **how))
            rows += len(got)
        some = rng.choice(scene.ids(), 2, replace=False)
        if k % 3 == 0:
            scene.move(some, rng.uniform((0, 0), WORLD, (2, 2)))
        elif k % 7 == 0:
            scene.set(some, angle=float(rng.integers(0, 360)), layer=int(rng.integers(4)))
    assert rows > 1 or name == "nothing"


@pytest.mark.parametrize("name", ["point", "piercing point", "disc", "piercing", "shotgun"])
def test_every_pixel_of_some_squares(name: str, jit: bool) -> None:
    """All that squares tell, also that nothing is near, is so from each of their pixels."""
    weapon, options = WEAPONS[name]
    scene = crowd(12, (400, 300))
    ready = prepare(scene, weapon, **options)
    places = [(x, y) for x in range(150, 340, 2) for y in range(120, 300, 5)]
    truth = fire(scene, weapon, np.array(places, float), shot=0, **options)
    rows = [truth.of(shot) for shot in range(len(places))]
    for at, truly in zip(places, rows, strict=True):
        assert [row[1:] for row in ready.fire(at)] == [row[1:] for row in truly], at
    assert {bool(one) for one in rows} == {True, False}


def test_what_is_asked_of_a_shot(jit: bool) -> None:
    """Whatever reads an answer of `fire` reads this one."""
    scene = crowd(2)
    ready = prepare(scene, Disc(30), exclude=3)
    for at in ((40, 50), (100.5, 80.25), (215, 100), (400, 0)):
        got, truth = ready.fire(at), fire(scene, Disc(30), at, exclude=3)
        assert got.by_owner() == truth.by_owner()
        assert got.why_not() == truth.why_not()
        assert got.blockers() == truth.blockers()
        assert got.margins() == truth.margins()
        assert got.shares() == truth.shares()
        assert got.pixels_at() == truth.pixels_at()
        assert all(np.array_equal(a, b) for a, b in zip(got.samples_at(), truth.samples_at(), strict=True))
        both = [{k: v for k, v in hits.to_dict().items() if k != "plan"} for hits in (got, truth)]
        assert both[0] == both[1]
        assert got.plan.ran[0].name == "prepared"
        assert repr(got) == repr(truth)
        with pytest.raises(ValueError, match="read-only"):
            got.pixels[:] = 0
        with pytest.raises(AttributeError, match="nothing"):
            got.nothing  # noqa: B018


def test_a_shot_of_the_past_is_still_what_it_was(jit: bool) -> None:
    """Rows and verdicts are those of the scene when it was fired, though they are worked out later."""
    scene, rng = crowd(4), np.random.default_rng(4)
    ready = prepare(scene, Disc(25))
    places = [tuple(at) for at in rng.uniform((0, 0), WORLD, (30, 2)).tolist()]
    truths = [fire(scene, Disc(25), at, strategy="direct") for at in places]
    told = [[hits.by_owner(), hits.shares(), hits.why_not(), hits.blockers(), hits.margins()] for hits in truths]
    shots = [ready.fire(at) for at in places]
    scene.move(scene.ids(), rng.uniform((0, 0), WORLD, (len(scene), 2)))
    scene.remove(scene.ids()[::2])
    scene.set(scene.ids(), owner=scene.ids()[0])
    for got, truth, of_then in zip(shots, truths, told, strict=True):
        same(got, truth)
        assert got.version == truth.version != scene.version
        assert [got.by_owner(), got.shares(), got.why_not(), got.blockers(), got.margins()] == of_then
        with pytest.raises(InputError, match="expected the scene at version"):
            got.scene_of(0)


def test_a_scene_that_forgot_what_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.scene.items.JOURNAL_ROWS", 4)
    scene, rng = crowd(1), np.random.default_rng(0)
    ready = prepare(scene, Disc(15))
    for _ in range(10):
        at = tuple(rng.uniform((0, 0), WORLD).tolist())
        same(ready.fire(at), fire(scene, Disc(15), at))
        scene.move(scene.ids()[:6], rng.uniform((0, 0), WORLD, (6, 2)))


@pytest.mark.parametrize("limit", ["KEPT_BYTES", "FILTER_BYTES", "AIMS_BYTES"])
def test_memory_is_bounded(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"hitplanes.weapons.prepared.prepare.{limit}", 20_000)
    scene = crowd(3)
    ready: Any = prepare(scene, Beam(120, 20))
    if limit == "FILTER_BYTES":
        ready = filtered(ready, ALL, ALL, None, 0)
    for k in range(300):
        at, aim = (float(7 * k % 220), float(11 * k % 160)), float(k % 97)
        assert ready.fire(at, aim=aim) == fire(scene, Beam(120, 20), at, aim=aim)
        kept = ready._aims.nbytes if "AIMS" in limit else ready._near.nbytes
        assert kept < 60_000
        assert len(ready._near.made) * position_cache.CELL_BYTES < 60_000 or "AIMS" in limit
        assert len(ready._aims._looks_of) <= 100


NUMBERS: list[Callable[[float], Any]] = [
    float, int, np.float64, np.float32, np.float16, np.int64, np.int16, np.uint8, np.longdouble,
]  # fmt: skip


@pytest.mark.parametrize("kind", NUMBERS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("pair", [tuple, list, np.array])
def test_positions_of_any_kind(kind: Callable[[float], Any], pair: Callable[[Any], Any]) -> None:
    scene = crowd(5)
    ready = prepare(scene, Point(pierce=True))
    for x, y in ((40, 50), (101, 83), (7, 120)):
        at = pair((kind(x), kind(y)))
        same(ready.fire(at), fire(scene, Point(pierce=True), at))
        same(
            ready.fire(at, aim=kind(30), shot=kind(3)), fire(scene, Point(pierce=True), at, aim=kind(30), shot=kind(3))
        )
        assert ready.fire(at, toward=pair((kind(1), kind(2)))) == fire(scene, Point(pierce=True), at)


def test_a_position_that_is_changed_later_was_read() -> None:
    scene = crowd(5)
    ready = prepare(scene, Disc(9))
    for at in ([40.0, 50.0], np.array([40.0, 50.0])):
        target: Any = [3.0, 4.0]
        got = ready.fire(at, toward=target)
        at[0], target[0] = 170.0, 100.0
        same(got, fire(scene, Disc(9), (40, 50), strategy="direct"))
        assert got.shots.at_256.tolist() == [[40 * 256, 50 * 256]]


@given(st.floats(-(2**40), 2**40))
@example(ODD)
@example(-ODD)
@example(math.nextafter(ODD, 0))
@example(math.nextafter(ODD, 1))
@example(-1 / 2 - 1 / 512)
@example(math.nextafter(-1 / 2 - 1 / 512, -1))
@example(2.0**40)
def test_the_pixel_of_a_position(v: float) -> None:
    for x in {v, *(math.nextafter(math.floor(v) + 1 - PIXEL, end) for end in (-math.inf, math.inf))}:
        if x != ODD and abs(x) <= 2**40:
            assert math.floor(x + PIXEL) == pixel(snap(x))


@pytest.mark.parametrize("x", [ODD, 0.498046875, math.nextafter(ODD, 0), -0.501953125, 2.498046875])
def test_positions_on_the_edge_of_a_pixel(x: float, jit: bool) -> None:
    scene = Scene()
    for k in range(-3, 4, 2):
        scene.add([[True]], (k, 0))
    ready = prepare(scene, Point())
    ready.fire((1, 0))
    for end in (-math.inf, math.inf):
        for place in (x, math.nextafter(x, end)):
            same(ready.fire((place, 0.0)), fire(scene, Point(), (place, 0.0)))
            same(ready.fire((place, 0.0), aim=3.0), fire(scene, Point(), (place, 0.0)))
            same(ready.fire((1.0, place)), fire(scene, Point(), (1.0, place)))


BAD_SHOTS: list[dict[str, Any]] = [
    {"at": at}
    for at in (
        (1, 2, 3), (1,), 5, "ab", None, {1.0: 2, 3.0: 4}, {1.0, 2.0}, iter((1.0, 2.0)), (True, 2.0), (1.0, False),
        (math.nan, 0.0), (0.0, math.inf), (2.0**40 + 1, 0.0), (0, -(2**40) - 1), (10**400, 0), (1j, 0), ("1", "2"),
        (Fraction(1), 2.0), (np.array([1.0]), 2.0), ([1.0], [2.0]), np.array(["a", "b"]), np.array([True, False]),
        np.ma.masked_array([1.0, 2.0], [True, False]), (None, 1.0),
    )
] + [
    {"at": (4.0, 4.0), **how}
    for how in (
        {"aim": math.nan}, {"aim": math.inf}, {"aim": True}, {"aim": "up"}, {"aim": [[1, 2]]}, {"aim": 10**400},
        {"aim": Fraction(1)}, {"aim": 1.0, "toward": (1, 1)}, {"toward": (4, 4)}, {"toward": (math.nan, 1)},
        {"toward": (1, 2, 3)}, {"toward": 1.0}, {"toward": (2.0**41, 1)}, {"shot": True}, {"shot": -1}, {"shot": 2**63},
        {"shot": 0.5}, {"shot": "1"}, {"shot": [1, 2]}, {"aim": 1.0, "shot": True}, {"aim": None, "shot": Fraction(1)},
    )
]  # fmt: skip


@pytest.mark.parametrize(("bad", "weapon"), in_turn(BAD_SHOTS, [Disc(3), Beam(9, 2), Spread(Disc(2), 3, 4), Pistol(9)]))
def test_bad_shots_are_refused_in_the_same_words(bad: dict[str, Any], weapon: Weapon) -> None:
    scene = crowd(6)
    ready = prepare(scene, weapon)
    for aim in (None, 1.0, 1):
        for number in (None, 0, 1):
            ready.fire((4.0, 4.0), aim=aim, shot=number)
    ready.fire((2.0**40, 0.0))
    how = dict(bad)
    at = how.pop("at")
    with pytest.raises(InputError) as truth:
        fire(scene, weapon, at, strategy="direct", **how)
    with pytest.raises(InputError) as got:
        ready.fire(at, **how)
    assert str(got.value) == str(truth.value)


@pytest.mark.parametrize(
    "name, bad",
    [
        ("accept", -1), ("accept", True), ("accept", ["glas"]), ("exclude", 0.5), ("exclude", "me"), ("exclude", -2),
        ("seed", -1), ("seed", 1.5), ("weapon", "disc"), ("weapon", None), ("weapon", {"kind": "disc"}),
    ],
)  # fmt: skip
def test_bad_preparations_are_refused_in_the_same_words(name: str, bad: Any) -> None:
    scene, how = crowd(6), {"weapon": Disc(3), name: bad}
    weapon: Any = how.pop("weapon")
    with pytest.raises(InputError) as truth:
        fire(scene, weapon, (0, 0), strategy="direct", **how)
    with pytest.raises(InputError) as got:
        prepare(scene, weapon, **how)
    assert str(got.value) == str(truth.value)


def test_only_a_scene_is_prepared_for() -> None:
    with pytest.raises(InputError, match="scene: expected a Scene, got str"):
        prepare("scene", Disc(3))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["fading shotgun", "burst", "burst of spreads", "burst of fading spreads"])
def test_what_is_looked_up_is_not_left_to_fire(name: str, jit: bool) -> None:
    weapon, options = WEAPONS[name]
    hits = prepare(crowd(8), weapon, **options).fire((40.0, 60.0), 30.0)
    assert type(hits) is OneShot and len(hits) > 0


def test_a_batch_goes_the_way_of_fire() -> None:
    scene, at = crowd(8), np.random.default_rng(1).uniform((0, 0), WORLD, (7, 2))
    weapon = Spread(Disc(3), 3, 9)
    truth = fire(scene, weapon, at, exclude=[[1, 2]], seed=4, strategy="direct")
    assert prepare(scene, weapon, exclude=[1, 2], seed=4).fire(at) == truth


def test_of_pixels_that_are_pierced_the_front_one_comes_first(jit: bool) -> None:
    scene = Scene()
    for layer in (1, 0, 2, 1):
        scene.add(Sprite.circle(4), (9, 9), layer=layer)
    ready = prepare(scene, Disc(6, pierce=True))
    assert [row.object for row in ready.fire((4, 9))] == [2, 3, 0, 1]
    same(ready.fire((4, 9)), fire(scene, Disc(6, pierce=True), (4, 9)))


@pytest.mark.parametrize("dx, dy", [(0, -4), (0, 4), (-4, 0), (4, 0), (4, -4)])
def test_what_covers_but_one_row_or_column(dx: int, dy: int, jit: bool) -> None:
    scene = Scene()
    scene.add(np.ones((5, 5), bool), (10, 10))
    scene.add(np.ones((5, 5), bool), (10 + dx, 10 + dy), layer=1)
    ready = prepare(scene, Disc(20))
    same(ready.fire((9, 9)), fire(scene, Disc(20), (9, 9)))


@pytest.mark.parametrize("at", [(2**41, 0), (0.0, -(2.0**40) - 1), (0, math.nextafter(2.0**40, math.inf))])
def test_a_known_aim_lets_no_position_pass(at: tuple[float, float], jit: bool) -> None:
    ready = prepare(crowd(6), Beam(9, 2))
    ready.fire((4.0, 4.0), aim=1.0)
    with pytest.raises(InputError, match="within"):
        ready.fire(at, aim=1.0)


def test_far_away(jit: bool) -> None:
    """At the ends of the range, and where the world begins at any place."""
    for x, y in ((2**40, -(2**40)), (10**9, 10**9), (-(2**40) + 3, 7)):
        scene = Scene()
        scene.add(Sprite.circle(5), (x, y))
        ready = prepare(scene, Disc(3))
        for dx in (-12, -7, 0, 8):
            for _ in range(2):
                at = (max(min(x + dx, 2**40), -(2**40)), y)
                same(ready.fire(at), fire(scene, Disc(3), at))
        with pytest.raises(InputError, match="within"):
            ready.fire((math.nextafter(2.0**40, math.inf), 0.0))


@pytest.mark.parametrize("at", [(3, 30), (56, 30), (30, 3), (30, 56)])
def test_a_shot_a_few_pixels_over_the_edge(at: tuple[int, int], jit: bool) -> None:
    scene = Scene((60, 60))
    scene.add(np.ones((80, 80), bool), (30, 30))
    ready = prepare(scene, Disc(5))
    same(ready.fire(at), fire(scene, Disc(5), at))


def test_a_scene_that_is_filled_after_the_first_shot(jit: bool) -> None:
    scene = Scene()
    ready = prepare(scene, Disc(6))
    assert not ready.fire((0, 0))
    scene.add(np.ones((200, 150), bool), (0, 0))
    scene.add(Sprite.circle(3), (2, 2), role="occluder", layer=1)
    for at in ((0, 0), (-80, 0), (77, 90), (-75, -100)):
        same(ready.fire(at), fire(scene, Disc(6), at))


def test_threads_that_fire_one_at_once_agree(jit: bool) -> None:
    scene, rng = crowd(9), np.random.default_rng(5)
    ready = prepare(scene, Disc(9))

    def shoot(places: list[tuple[float, float]]) -> list[tuple[int, ...]]:
        return [tuple(row.object for row in ready.fire(at)) for at in places]

    with ThreadPoolExecutor(4) as pool:
        for _ in range(4):
            scene.move(scene.ids(), rng.uniform((0, 0), WORLD, (len(scene), 2)))
            places = list(map(tuple, rng.uniform((0, 0), WORLD, (60, 2)).tolist()))
            asked = [pool.submit(shoot, places) for _ in range(4)]
            truth = [tuple(row.object for row in fire(scene, Disc(9), at, strategy="direct")) for at in places]
            assert all(answer.result() == truth for answer in asked)


def test_kernels_may_be_changed_between_two_versions() -> None:
    pytest.importorskip("numba")
    scene, weapon = crowd(9), Beam(90, 20)
    ready: Any = prepare(scene, weapon)
    try:
        for compiled in (False, True, True, False, True):
            use_jit(compiled)
            scene.move(scene.ids()[:3], (60.0, 50.0))
            for how in ({}, {"aim": 30.0}, {"aim": 30.0}, {}):
                same(ready.fire((50.0, 50.0), **how), fire(scene, weapon, (50.0, 50.0), **how))
            assert type(ready._near).__module__.endswith(".compiled") == compiled
    finally:
        use_jit(None)


def test_many_rows_at_once(jit: bool) -> None:
    """More than a buffer has room for at first; all as near as each other, or none."""
    scene, rng = Scene(), np.random.default_rng(2)
    for xy in rng.integers(0, 60, (700, 2)).tolist():
        scene.add(MASK, xy, layer=int(rng.integers(3)))
    ready = prepare(scene, Disc(60, pierce=True))
    for at in ((30, 30), (31, 7)):
        assert len(ready.fire(at)) > 600
        same(ready.fire(at), fire(scene, Disc(60, pierce=True), at, strategy="direct"))


def test_shots_that_are_not_kept_leave_nothing() -> None:
    scene = crowd(9)
    ready = prepare(scene, Disc(9))
    ready.fire((50.0, 50.0))
    gc.collect()
    before = sum(type(one) is OneShot for one in gc.get_objects())
    for _ in range(50):
        ready.fire((50.0, 50.0))
    assert sum(type(one) is OneShot for one in gc.get_objects()) == before


# Integer rows


def test_rows_of_spans_begin_at_a_corner() -> None:
    spans = Spans.from_mask(MASK, (5, 7))
    assert pixels_of(rows_of_spans(spans, (3, 4), 10), 10).tolist() == [[2, 3], [4, 3], [3, 4]]
    assert rows_of_spans(Spans.empty(), (0, 0), 10) == 0


@pytest.mark.usefixtures("jit")
def test_rows_of_a_spread_are_those_of_then_also_once_objects_have_moved() -> None:
    """They are made when they are read."""
    scene = Scene((60, 60))
    duck = scene.add(np.ones((20, 20), np.bool_), (30, 30))
    ready = prepare(scene, Spread(Disc(3), 6, 5))
    now, later = ready.fire((30, 30)), ready.fire((30, 30))
    told = list(now)
    scene.move(duck, (50, 50))
    assert told and list(later) == told and len(later) == len(told)
