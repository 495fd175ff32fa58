"""A weapon of one ray made ready: each shot is what `fire` gives, of the scene as it is, also when asked later."""

from __future__ import annotations

import random
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given, note
from hypothesis import strategies as st
from ray_battles import some_battle
from some_of import some_of
from test_march import single
from test_prepare import changed, crowd, same

from hitplanes import (
    Hits,
    InputError,
    Laser,
    Pistol,
    Projectile,
    RayHits,
    Ready,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Sweep,
    Weapon,
    fire,
    prepare,
    use_jit,
)
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.grid.fixed_point import unit, unit_of
from hitplanes.weapons.prepared.prepared_ray import OneShotOfRays, ReadyRay, ReadyRays
from hitplanes.weapons.rays import one_ray, raycast
from hitplanes.weapons.rays.contacts import NEVER
from hitplanes.weapons.rays.one_ray import Ray, WideRay

worlds = st.randoms(use_true_random=False)
AT, TOWARD = (30.25, 40.5), (200.0, 90.75)


@pytest.fixture
def kernels(jit: bool) -> ModuleType:
    """What rays are cast by, and its compiled twin."""
    return kernels_of(raycast)


def both(
    ready: Ready, scene: Scene, weapon: Weapon, how: dict[str, Any], shot: dict[str, Any]
) -> tuple[Hits, ...] | str:
    """What a ready weapon tells and what `fire` does; or the error that both raise."""
    try:
        truth = fire(scene, weapon, strategy="walk", **how, **shot)
    except InputError as error:
        with pytest.raises(InputError) as told:
            ready.fire(**shot)
        assert str(told.value) == str(error)
        return str(error)
    return ready.fire(**shot), truth


@examples(60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds)
def test_random_battles(kernels: ModuleType, rng: random.Random) -> None:
    """Any weapon of rays, half of them of one that ends at its first hit, while the scene changes between the shots."""
    battle = single(rng, 3) if rng.random() < 0.5 else some_battle(rng)
    note(repr(battle))
    scene, weapon, first = battle.scene(), battle.gun.weapon(), battle.shots[0]
    how: dict[str, Any] = {
        "accept": first.accept,
        "blocked_by": first.blocked_by,
        "exclude": [owner for owner in first.exclude if owner < len(battle.bodies)] or None,
        "seed": battle.seed,
    }
    ready = prepare(scene, weapon, **how)
    for one in battle.shots * 2:
        aimed = {"toward": one.toward} if one.toward is not None else {"aim": one.aim}
        shot = {"at": tuple(one.at), "shot": one.number, **aimed}
        told = both(ready, scene, weapon, how, shot)
        if not isinstance(told, str):
            same(*told)
        if rng.random() < 0.5:
            changed(scene, rng)


GO_ON: list[Weapon] = [
    Laser(120), Laser(90, width=3, falloff="linear"), Rifle(120, max_hits=2), Pistol(90, width=5), Projectile(70, 3)
]  # fmt: skip


WHILE_IT_CHANGES = Pistol(150), *GO_ON, Rifle(120, max_hits=1), Pistol(90, falloff="smooth")


@pytest.mark.parametrize("weapon", some_of(WHILE_IT_CHANGES, 2), ids=repr)
@pytest.mark.parametrize("exclude", some_of([None, 3, [1, 4]], 2))
@pytest.mark.parametrize("bounded", [True, False])
def test_a_crowd(kernels: ModuleType, weapon: Weapon, exclude: object, bounded: bool) -> None:
    """Many shots at a scene that stands still: in numpy they come to jump, if no object is refused."""
    scene, rng = crowd(7, (220, 160) if bounded else None), np.random.default_rng(3)
    ready, rows, alone = prepare(scene, weapon, exclude=exclude), 0, 0
    assert type(ready) is ReadyRay
    for step in range(3):
        for k in range(24):
            at = tuple((rng.integers(-60 * 256, 300 * 256, 2) / 256).tolist())
            shot = [{}, {"aim": float(rng.uniform(-720, 720))}, {"toward": (100, 60.5)}, {"aim": 45, "shot": 9}][k % 4]
            got = ready.fire(at, **shot)
            alone += type(got) is OneShotOfRays
            same(got, fire(scene, weapon, at, exclude=exclude, strategy="walk", **shot))
            rows += len(got)
        scene.move(scene.ids()[step::5], rng.uniform((0, 0), (220, 160), (8, 2)))
    assert 12 < rows < (72 if weapon.hits_most == 1 else 300) and alone > 60  # type: ignore[attr-defined]


SEVERAL: list[Weapon] = [
    Spread(Pistol(150), 8, 9), Spread(Pistol(90, falloff="linear"), 32, 14), Spread(Pistol(120, width=5), 5, 6),
    Spread(Rifle(120, max_hits=1), 3, 0.5), Spread(Pistol(90, inside="ignore_until_exit"), 4, 8),
    Rounds(Pistol(120), 5, (-7.3, 4.6), 11), Rounds(Pistol(90, falloff="smooth"), 3, recoil_xy=(0.5, 9)),
    Rounds(Spread(Pistol(120), 4, 9), 3, (3.1, -2), -20), Rounds(Sweep(Pistol(90), 40, 3), 4, recoil_deg=35),
    Sweep(Pistol(120), 90, 5), Sweep(Pistol(90, falloff="linear", width=3), 360, 8),
]  # fmt: skip


@pytest.mark.parametrize("weapon", some_of(SEVERAL, 2), ids=repr)
@pytest.mark.parametrize("bounded", [True, False])
def test_a_shot_of_a_few_rays(kernels: ModuleType, weapon: Weapon, bounded: bool) -> None:
    """Rays that hit the same object are one row of a round, that of the nearest; so is a pixel that several hit."""
    scene, rng = crowd(7, (220, 160) if bounded else None), np.random.default_rng(3)
    ready, rows, alone = prepare(scene, weapon, exclude=[1, 4], seed=3), 0, 0
    assert type(ready) is ReadyRays
    for step in range(3):
        for k in range(24):
            at = tuple((rng.integers(-20 * 256, 240 * 256, 2) / 256).tolist())
            shot = [{}, {"aim": float(rng.uniform(-720, 720))}, {"toward": (100, 60.5)}, {"aim": 45, "shot": k}][k % 4]
            got = ready.fire(at, **shot)
            alone += type(got) is OneShotOfRays
            truth = fire(scene, weapon, at, exclude=[1, 4], seed=3, strategy="walk", **shot)
            same(got, truth)
            assert got.rays == truth.rays and got.passes == truth.passes and got.stop == truth.stop
            rows += sum(row.pellets > 1 for row in got) if weapon.kind == "spread" else len(got)
        scene.move(scene.ids()[step::5], rng.uniform((0, 0), (220, 160), (8, 2)))
    is_alone = kernels is not raycast or ready.rays < 6
    assert rows > 10 and (alone > 40 or not is_alone)  # in numpy more rays are followed together


def test_a_burst_of_rays_that_end_where_they_are_aimed_turns_about_its_start(kernels: ModuleType) -> None:
    scene, weapon = crowd(7, None), Rounds(Pistol(None), 4, (3.5, -2), 9)
    ready, rows = prepare(scene, weapon), 0
    for toward in np.random.default_rng(5).uniform((0, 0), (220, 160), (12, 2)):
        got = ready.fire((110.0, 80.0), toward=tuple(toward.tolist()))
        assert type(got) is OneShotOfRays
        same(got, fire(scene, weapon, (110.0, 80.0), toward=toward, strategy="walk"))
        rows += len(got)
    assert rows > 20


@pytest.mark.parametrize("weapon", [Spread(Pistol(9), 8, 2), Spread(Pistol(9, falloff="linear"), 8, 2)], ids=str)
def test_a_pixel_that_several_pellets_hit_counts_once(kernels: ModuleType, weapon: Weapon) -> None:
    scene = Scene()
    wall = scene.add(np.ones((9, 1), np.bool_), (4, 0))
    shot, truth = prepare(scene, weapon).fire((0, 0)), fire(scene, weapon, (0, 0), strategy="walk")
    (row,) = shot
    assert row == (0, 0, wall, 8, row.pixels, row.weight, 8, (4, 0), 16) and row.pixels < 8
    same(shot, truth)


THROUGH = [
    Laser(300), Rifle(range=250, max_hits=2), Rifle(range=300, max_hits=4, falloff="linear"), Laser(None),
    Laser(300, width=5), Rifle(250, max_hits=2, width=3), Rifle(range=300, max_hits=3, width=1), Pistol(None, width=8),
    Rifle(300, max_hits=3, width=14),
]  # fmt: skip


@pytest.mark.parametrize("aim", [0, 45, 30])
def test_a_budget_that_just_lasts_and_one_that_does_not(kernels: ModuleType, aim: float) -> None:
    """Through boards of 9 px, one behind the other."""
    scene = Scene()
    for distance in (20, 40, 60):
        scene.add(Sprite.box(9, 60), (distance * unit(aim)[0] / 2**30, distance * unit(aim)[1] / 2**30), angle=aim)
    seen = set()
    for budget in np.arange(4, 34, 0.5).tolist():
        weapon = Rifle(90, budget=budget)
        hits = prepare(scene, weapon).fire((0, 0), aim)
        assert type(hits) is OneShotOfRays
        same(hits, fire(scene, weapon, (0, 0), aim=aim, strategy="walk"))
        seen.add(len(hits))
    assert seen == {1, 2, 3}


@examples(30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32))
def test_rays_that_go_on_through_corners_and_along_edges(kernels: ModuleType, seed: int) -> None:
    """All places are on half pixels, so that rays enter several cells at once, and end on corners."""
    rng, scene = np.random.default_rng(seed), Scene((300, 200)) if seed % 2 else Scene()
    for _ in range(rng.integers(1, 25)):
        sides = rng.integers(1, 40, 2)
        masks = np.ones(sides, np.bool_), rng.random(sides) < rng.random(), np.eye(*sides) > 0
        role = "occluder" if rng.random() < 0.15 else "hittable"
        at = np.round(2 * rng.uniform((0, 0), (300, 200))) / 2
        scene.add(masks[rng.integers(3)], at, role=role, layer=int(rng.integers(3)))
    for weapon in THROUGH:
        ready = prepare(scene, weapon)
        for k in range(8):
            at, toward = (np.round(2 * rng.uniform(-20, 320, 2)) / 2 for _ in range(2))
            aimed = {"toward": tuple(toward.tolist())} if k % 2 or weapon.range is None else {"aim": 45.0 * k}
            shot = {"at": tuple(at.tolist()), **aimed}
            told = both(ready, scene, weapon, {}, shot)
            if not isinstance(told, str):
                same(*told)
                assert told[0].stop == told[1].stop


@pytest.mark.parametrize("to", [(x, y) for x in (-40, -9, 9, 40) for y in (-40, -9, 9, 40)])
def test_a_ray_that_ends_on_a_corner_enters_cells_of_a_row_at_once(kernels: ModuleType, to: tuple[int, int]) -> None:
    for side in [(2, 1), (1, 2), (2, 2)]:
        for place in np.ndindex(2, 2):
            scene, end = Scene(), (to[0] + 0.5, to[1] + 0.5)
            scene.add(np.ones(side, np.bool_), (to[0] + place[0], to[1] + place[1]))
            shot = {"at": (0.5, 0.5), "toward": end}
            same(*both(prepare(scene, Laser(None)), scene, Laser(None), {}, shot))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "weapon"), [(Ray, Rifle(400, max_hits=2)), (WideRay, Rifle(400, max_hits=2, width=4))], ids=repr
)
def test_few_rays_that_go_on_are_left_to_arrays(kind: Any, weapon: Weapon, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that enter an item together with the occluder that ends them, not those that end in what they have hit."""
    scene, told, inner = Scene(), [], kind.passed
    for x, y, side, role in [
        (100, 50, 9, "hittable"), (200, 50, 9, "hittable"), (203, 50, 9, "hittable"),
        (300, 80, 9, "occluder"), (296, 80, 1, "hittable"), (100, 20, 9, "hittable"), (100, 20, 9, "hittable"),
    ]:  # fmt: skip
        scene.add(Sprite.box(side, side), (x, y), role=role)
    monkeypatch.setattr(kind, "passed", lambda *of: told.append(inner(*of)) or told[-1])
    ready = prepare(scene, weapon)
    for at, left in [((20, 50), False), ((100, 50), False), ((150, 50), False), ((250, 80), True), ((50, 20), False)]:
        told.clear()
        hits = ready.fire(at)
        assert [found is None for found in told] == [left]
        assert hits == fire(scene, weapon, at, strategy="walk")
    first = Pistol(400, width=weapon.width)  # type: ignore[attr-defined]
    assert prepare(scene, first).fire((50, 20)).object.tolist() == [6] and told[-1] is not None


@pytest.mark.parametrize(
    ("at", "by", "pixels", "wall"),
    [
        ((0, 0.5), (20, 0.5), [(5, 0), (6, 0)], (6, 1)),  # along a border, in two cells at a time
        ((0, 0), (9, 9), [(0, 0), (1, 0)], (1, 1)),  # through a corner, where the box of what it hits ends
    ],
)
def test_at_its_end_a_ray_walks_the_cell_of_the_occluder_alone(
    at: tuple[float, float], by: tuple[float, float], pixels: list[tuple[int, int]], wall: tuple[int, int]
) -> None:
    scene, mask = Scene(), np.zeros((1, 7), np.bool_)
    for x, y in pixels:
        mask[y, x] = True
    scene.add(Sprite.from_mask(mask, pivot_xy=(0, 0)))
    scene.add([[1]], wall, role="occluder")
    ready = prepare(scene, Laser(None))
    for _ in range(2):
        assert [(row.object, row.samples, row.first_xy) for row in ready.fire(at, toward=by)] == [(0, 1, pixels[0])]


@pytest.mark.parametrize(("weapon", "left"), [(Laser(900), 1), (Laser(900, width=4), 1), (Pistol(900, width=4), 0)])
def test_a_ray_that_looks_at_many_rows_is_left_to_arrays(
    weapon: Weapon, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, cast = Scene(), list[Any]()
    for k in range(150):
        scene.add(Sprite.box(4, 4), (20 + 6 * k, 50))
    monkeypatch.setattr(one_ray, "cast_together", lambda *of: cast.append(of) or raycast.cast_together(*of))
    hits = prepare(scene, weapon).fire((0, 50))
    assert len(cast) == left
    assert hits == fire(scene, weapon, (0, 50), strategy="walk")


@pytest.fixture
def casts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of casts in numpy: the last counts on, and whoever begins to count appends a 0."""
    counts, inner = [0], one_ray.follower

    def counted(*of: Any) -> Any:
        cast = inner(*of)

        def one(*ray: int) -> one_ray.Followed | None:
            counts[-1] += 1
            return cast(*ray)

        return one

    monkeypatch.setattr(one_ray, "follower", counted)
    return counts


def test_rays_march_once_a_scene_stood_still_for_long_enough(casts: list[int]) -> None:
    scene = crowd(5)
    ready = prepare(scene, Pistol(200))
    for _ in range(2):
        for k in range(80):
            ready.fire((20.5, k), aim=0.5)
        scene.move(0, (50, 50))
        casts.append(0)
    assert 0 < casts[0] < 40 and 0 < casts[1] < 40


def test_a_ray_along_a_surface_does_not_march_pixel_by_pixel(casts: list[int]) -> None:
    """It is cast, as the wall that it passes by has no pixel on its way."""
    scene = Scene((4000, 60))
    scene.add(np.ones((10, 3800), np.bool_), (2000, 50))
    scene.add(np.ones((9, 9), np.bool_), (3900, 42))
    fire(scene, Pistol(3900), (30, 42.25), strategy="march")  # the distance field is there
    casts.append(0)
    hits = prepare(scene, Pistol(3900)).fire((30, 42.25))
    assert casts[-1] == 1
    assert hits == fire(scene, Pistol(3900), (30, 42.25), strategy="walk") and len(hits) == 1


@pytest.mark.parametrize("weapon", [Pistol(200), Laser(200), Rifle(200, max_hits=2, width=4)], ids=repr)
def test_what_is_asked_of_a_ray(kernels: ModuleType, weapon: Weapon) -> None:
    """Whatever reads an answer of `fire` reads this one."""
    scene = crowd(2)
    ready = prepare(scene, weapon, exclude=3)
    for aim in range(0, 360, 60):
        got, truth = ready.fire(AT, aim=aim), fire(scene, weapon, AT, aim=aim, exclude=3, strategy="walk")
        assert isinstance(got, OneShotOfRays) and isinstance(truth, RayHits)
        assert got.passes == truth.passes and got.stop == truth.stop and got.rays == truth.rays == 1
        assert got.by_owner() == truth.by_owner()
        assert got.why_not() == truth.why_not() and got.nearest_miss() == truth.nearest_miss()
        assert got.blockers() == truth.blockers() and got.margins() == truth.margins()
        assert got.pixels_at() == truth.pixels_at() and got.passes_at(0) == truth.passes_at(0)
        told = [{k: v for k, v in hits.to_dict().items() if k != "plan"} for hits in (got, truth)]
        assert told[0] == told[1] and repr(got) == repr(truth)
        assert got.plan.ran[0].name == "prepared"
        with pytest.raises(InputError, match="got those of rays"):
            got.shares()


@pytest.mark.parametrize("weapon", [Pistol(120), Laser(120, width=3)], ids=repr)
def test_a_ray_of_the_past_is_still_what_it_was(kernels: ModuleType, weapon: Weapon) -> None:
    scene, rng = crowd(4), np.random.default_rng(4)
    ready = prepare(scene, weapon)
    places = [tuple(at) for at in rng.uniform((0, 0), (220, 160), (20, 2)).tolist()]
    truths = [fire(scene, weapon, at, aim=30, strategy="walk") for at in places]
    told = [(list(one), one.passes, one.stop, one.by_owner()) for one in truths if isinstance(one, RayHits)]
    shots = [ready.fire(at, aim=30) for at in places]
    scene.move(scene.ids(), rng.uniform((0, 0), (220, 160), (len(scene), 2)))
    scene.remove(scene.ids()[::2])
    scene.set(scene.ids(), owner=scene.ids()[0])
    for got, (rows, passes, stop, bodies) in zip(shots, told, strict=True):
        assert isinstance(got, RayHits)
        assert list(got) == rows and got.passes == passes and got.stop == stop and got.by_owner() == bodies
        with pytest.raises(InputError, match=r"read this before the scene changes, or fire at scene\.copy\(\)"):
            got.why_not()


@pytest.mark.parametrize("shot", [
    {"at": AT, "aim": "up"}, {"at": AT, "aim": 30, "toward": TOWARD}, {"at": AT, "toward": AT}, {"at": (1, 2, 3)},
    {"at": AT, "aim": float("nan")}, {"at": (float("inf"), 0)}, {"at": AT, "shot": -1}, {"at": AT, "shot": 1.5},
    {"at": AT, "toward": (1e300, 0)}, {"at": None},
], ids=repr)  # fmt: skip
def test_bad_input_is_refused_as_by_fire(kernels: ModuleType, shot: dict[str, Any]) -> None:
    scene = crowd(1)
    assert isinstance(both(prepare(scene, Pistol(90)), scene, Pistol(90), {}, shot), str)


def test_a_ray_without_a_range(kernels: ModuleType) -> None:
    """It must be told where it goes, and not too far."""
    scene, weapon = crowd(1), Pistol(None)
    ready = prepare(scene, weapon)
    for shot in ({"at": AT}, {"at": AT, "aim": 3}, {"at": AT, "toward": (2e7, 0)}):
        assert isinstance(both(ready, scene, weapon, {}, shot), str)
    for toward in (TOWARD, (30, 40), (-5e3, 0.5), (30.25, 99)):
        same(ready.fire(AT, toward=toward), fire(scene, weapon, AT, toward=toward))


@pytest.mark.parametrize("at", [[30, 40], np.array([30.5, 40]), np.array([[30.5, 40], [7, 9]]), (np.float32(30), 40)])
def test_positions_of_any_kind(kernels: ModuleType, at: object) -> None:
    scene = crowd(1)
    same_rows = prepare(scene, Pistol(300)).fire(at, aim=10), fire(scene, Pistol(300), at, aim=10, strategy="walk")
    assert same_rows[0] == same_rows[1]


@pytest.mark.parametrize("weapon", [
    Projectile(90, 3, steps=4), Projectile(0, 9),
    Rounds(Laser(90), 2), Spread(Laser(90), 3, 4), Spread(Pistol(90), 33, 4), Rounds(Spread(Pistol(90), 11, 4), 3),
], ids=repr)  # fmt: skip
def test_other_weapons_of_rays_go_the_way_of_fire(weapon: Weapon) -> None:
    scene = crowd(3)
    ready = prepare(scene, weapon, accept=["glass"], seed=3)
    assert type(ready) is Ready
    assert ready.fire(AT, aim=77, shot=2) == fire(scene, weapon, AT, aim=77, accept=["glass"], seed=3, shot=2)


def test_a_projectile_among_items_that_begin_to_move(kernels: ModuleType) -> None:
    """It is cast as long as they stand still."""
    scene, weapon = crowd(3), Projectile(90, 3)
    ready = prepare(scene, weapon)
    for velocity, alone in (((0, 0), True), ((40, -30), False), ((0, 0), True)):
        scene.set(scene.ids(), velocity_xy=velocity)
        for aim in range(0, 360, 45):
            got = ready.fire(AT, aim=aim)
            assert type(got) is OneShotOfRays if alone else type(got) is RayHits
            same(got, fire(scene, weapon, AT, aim=aim, strategy="walk"))


def test_far_off_and_as_long_as_can_be(kernels: ModuleType) -> None:
    scene = Scene(None)
    for x in (2.0**39, -(2.0**39)):
        scene.add(np.ones((40, 40), np.bool_), (x, -x))
    weapon = Pistol(2**20 - 400)
    ready = prepare(scene, weapon)
    for x in (2.0**39, -(2.0**39)):
        for away in (0.25, 700.5, 1e6):
            for aim in (180.0, 0, 179.9999):
                assert ready.fire((x + away, -x), aim=aim) == fire(scene, weapon, (x + away, -x), aim=aim)


@given(st.floats(-(2.0**40), 2.0**40) | st.integers(-720, 720).map(float) | st.sampled_from([44.99999, 45.0, -45.0]))
def test_directions_are_those_of_unit(degrees: float) -> None:
    assert unit_of(degrees) == tuple(int(v) for v in unit(degrees))


@pytest.mark.parametrize("weapon", [Pistol(200), Laser(200, width=3)], ids=repr)
def test_threads_fire_one_ready_weapon(kernels: ModuleType, weapon: Weapon) -> None:
    scene, rng = crowd(9), np.random.default_rng(9)
    ready = prepare(scene, weapon)
    shots = [(tuple(at), aim) for at, aim in zip(rng.uniform(0, 160, (150, 2)).tolist(), range(0, 450, 3), strict=True)]
    truths = [fire(scene, weapon, at, aim=aim, strategy="walk") for at, aim in shots]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda one: ready.fire(one[0], aim=one[1]), shots))
    assert found == truths


def test_kernels_may_change_between_shots() -> None:
    pytest.importorskip("numba")
    scene = crowd(6)
    ready = prepare(scene, Pistol(200))
    truth = fire(scene, Pistol(200), AT, aim=20, strategy="walk")
    try:
        for compiled in (True, False, True):
            use_jit(compiled)
            assert ready.fire(AT, aim=20) == truth
            scene.move(0, (1000, 1000))
    finally:
        use_jit(None)


@examples(60, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0, 100, 300, 1500]))
def test_cells_up_to_an_end_are_counted_as_one_by_one(seed: int, radius: int) -> None:
    """Also those of a row that a wide ray enters before others, which lie nearer to its start."""
    rng = np.random.default_rng(seed)
    start, step = rng.integers(-128, 128, 2).tolist(), rng.integers(-6000, 6001, 2).tolist()
    ray = WideRay(start, step, radius) if radius else Ray(start, step)
    runs = [(row, ray.run(row)) for row in range(-24, 25)]
    full = [(row, first, bytes([1]) * (last - first + 1)) for row, (first, last) in runs if first <= last]
    cells = sorted(ray.entered(row, first + k) for row, first, run in full for k in range(len(run)))
    cells = [cell for cell in cells if cell[0] < NEVER]
    for number in range(0, len(cells), max(len(cells) // 9, 1)):
        last = cells[number]
        sooner = [cell for cell in cells if cell[0] < last[0]]
        for alone, rank, count in ((False, 4, number), (True, 4, len(sooner)), (True, 3, len(sooner) + 1)):
            assert ray.walked(iter(full), (*last, 3, 1, 0), alone, rank) == count
