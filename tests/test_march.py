"""Rays that march: the distance field, the first cell of a ray that is taken, and the same answers as by walking."""

from __future__ import annotations

import random
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import oracle_rays
import pytest
from examples import examples
from hypothesis import HealthCheck, example, given, note
from hypothesis import strategies as st
from ray_battles import Battle, Body, Gun, Shot, some_battle, some_place, some_target
from some_of import in_turn
from test_rays import check_columns

from hitplanes import (
    ALL,
    Disc,
    History,
    Hits,
    InputError,
    Laser,
    Pistol,
    Point,
    RayHits,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sweep,
    Weapon,
    fire,
    prepare,
)
from hitplanes.planes.bits import distance_field
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.scene import derived
from hitplanes.planes.scene.derived import View
from hitplanes.weapons.fire.plan import Plan
from hitplanes.weapons.rays import ray_call

worlds = st.randoms(use_true_random=False)
FAR = 2**20 - 400


@pytest.fixture
def kernels(jit: bool) -> ModuleType:
    """The kernels, and their compiled twins."""
    return kernels_of(distance_field)


def some_plane(rng: random.Random) -> np.ndarray[Any, np.dtype[np.bool_]]:
    h, w, chance = rng.randint(1, 9), rng.randint(1, 9), rng.choice([0.0, 0.05, 0.1, 0.3, 0.7, 1.0])
    plane = np.array([[rng.random() < chance for _ in range(w)] for _ in range(h)])
    if rng.random() < 0.3:  # a wall that has nothing but corners
        side = min(h, w)
        plane[range(side), range(side - 1, -1, -1) if rng.random() < 0.5 else range(side)] = True
    return plane


# Kernels


@examples(34, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds)
def test_the_clearance_is_the_distance_in_city_blocks(rng: random.Random) -> None:
    plane = some_plane(rng)
    found = distance_field.distances_of(plane)
    assert found.dtype == np.uint8 and found.shape == tuple(n + 2 * distance_field.PAD for n in plane.shape)
    taken = [
        (y + distance_field.PAD, x + distance_field.PAD)
        for y, x in zip(*map(np.ndarray.tolist, np.nonzero(plane)), strict=True)
    ]
    for (y, x), distance in np.ndenumerate(found):
        assert distance == min((abs(y - v) + abs(x - u) for v, u in taken), default=distance_field.FAR)


def test_the_clearance_ends_at_what_a_byte_holds() -> None:
    plane = np.zeros((2, 700), np.bool_)
    plane[1, 650] = True
    row = distance_field.distances_of(plane)[distance_field.PAD].tolist()
    assert row == [min(abs(x - distance_field.PAD - 650) + 1, distance_field.FAR) for x in range(704)]


def some_ray(rng: random.Random, h: int, w: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """A start and a step, 1/256 px: inside, around, on borders, level, diagonal, through corners, or any."""
    grid = rng.choice([1, 32, 128, 256])
    x, y = (rng.randint(-8 * 256 // grid, (n + 8) * 256 // grid) * grid for n in (w, h))
    length = rng.choice([1, 3, 30]) * 256 // grid
    dx, dy = (rng.randint(-length, length) * grid for _ in range(2))
    kind = rng.choice(["any", "any", "any", "level", "upright", "diagonal", "still"])
    step = {"level": (dx, 0), "upright": (0, dy), "diagonal": (dx, rng.choice([dx, -dx])), "still": (0, 0)}
    return (x, y), step.get(kind, (dx, dy))


@examples(134, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds)
def test_the_first_taken_cell_is_the_first_that_the_oracle_meets(kernels: ModuleType, rng: random.Random) -> None:
    plane = some_plane(rng)
    rays = [some_ray(rng, *plane.shape) for _ in range(rng.choice([1, 7, 80]))]
    start, step = (np.array(column) for column in zip(*rays, strict=True))
    note(f"{plane.astype(int).tolist()} {rays}")
    distances = distance_field.distances_of(plane)
    entry, cell, several = kernels.first_taken(distances, start + 256 * distance_field.PAD, step)
    for k, (at, by) in enumerate(rays):
        if entry[k] == distance_field.UNDECIDED:
            assert by == (0, 0)
            continue
        cells, _ = oracle_rays.thin_times(at, (at[0] + by[0], at[1] + by[1]))
        met = {
            (x, y): time
            for (x, y), (time, _) in cells.items()
            if 0 <= x < plane.shape[1] and 0 <= y < plane.shape[0] and plane[y, x]
        }
        assert entry[k] == min(met.values(), default=distance_field.NOTHING)
        first = [(x, y) for (x, y), time in met.items() if time == entry[k]]
        y, x = divmod(int(cell[k]), distances.shape[1])
        assert not first or several[k] or first == [(x - distance_field.PAD, y - distance_field.PAD)]


def test_rays_from_anywhere_read_nothing_beyond_the_plane(kernels: ModuleType) -> None:
    """Also those that begin or end as far off as a position may be, or are too long to be followed."""
    plane = np.zeros((5, 7), np.bool_)
    plane[2, 3] = True
    distances = distance_field.distances_of(plane)
    rng = np.random.default_rng(1)
    start = rng.integers(-(2**48), 2**48, (2000, 2))
    step = rng.integers(-(2**29), 2**29, (2000, 2))
    assert (kernels.first_taken(distances, start, step)[0] == distance_field.NOTHING).all()
    ends = np.array([[2**23, 77], [-(2**23), 2**23 - 5], [2**29, 2**29], [2**35, 1]] * 5)
    middle = np.array([(3 + distance_field.PAD) * 256, (2 + distance_field.PAD) * 256])
    for sign in (1, -1):
        entry, cell, _ = kernels.first_taken(distances, middle - sign * ends, 2 * sign * ends)
        decided = entry != distance_field.UNDECIDED
        alone = [kernels.first_taken(distances, middle - sign * end[None], 2 * sign * end[None]) for end in ends[:4]]
        assert [int(one[0][0]) for one in alone][:2] == entry[:2].tolist() and alone[3][0][
            0
        ] == distance_field.UNDECIDED
        assert decided.tolist() == [True, True, False, False] * 5 and (cell[decided] == 4 * 11 + 5).all()


# The same answers


def single(rng: random.Random, count: int) -> Battle:
    """A battle with a weapon that ends at its first hit, of many shots."""
    battle = some_battle(rng)
    inside = rng.choice(["hit", "hit", battle.gun.inside])
    kind = rng.choice(["pistol", "rifle"])
    gun = replace(battle.gun, kind=kind, max_hits=1, budget=None, width=0, inside=inside)
    shots = []
    for number in range(count):
        at = some_place(rng, battle.bodies)
        shot = replace(rng.choice(battle.shots), at=at, number=number)
        shots.append(replace(shot, toward=some_target(rng, at, battle.bodies)) if shot.toward is not None else shot)
    bodies = battle.bodies
    if rng.random() < 0.6:  # nothing is refused
        shots = [replace(shot, accept=ALL, exclude=()) for shot in shots]
        bodies = [replace(body, categories=body.categories or 1) for body in bodies]
    elif rng.random() < 0.8:  # all refuse the same
        filters = {name: getattr(shots[0], name) for name in ("accept", "blocked_by", "exclude")}
        shots = [replace(shot, **filters) for shot in shots]
    bounds = rng.choice([(0, 0, 11, 9), (2, 1, 7, 8), (-20, -20, 40, 40)])
    return replace(battle, gun=gun, shots=shots, bodies=bodies, bounds=bounds)


def answer(battle: Battle, strategy: str) -> Hits | str:
    try:
        return battle.fired(strategy=strategy)
    except InputError as error:
        return str(error)


@examples(70, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds, count=st.integers(1, 12))
def test_rays_that_jump_hit_what_rays_that_walk_hit(kernels: ModuleType, rng: random.Random, count: int) -> None:
    battle = single(rng, count)
    note(repr(battle))
    walked, marched = (answer(battle, strategy) for strategy in ("walk", "march"))
    assert walked == marched
    if isinstance(walked, RayHits):
        assert walked.verdicts.tolist() == marched.verdicts.tolist()  # type: ignore[union-attr]


@examples(40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds)
def test_rays_that_jump_hit_what_the_oracle_hits(kernels: ModuleType, rng: random.Random) -> None:
    battle = single(rng, 3)
    note(repr(battle))
    if battle.gun.inside == "error":
        battle = replace(battle, gun=replace(battle.gun, inside="hit"))
    check_columns(battle.fired(strategy="march"), battle.walks(), battle.gun.falloff)


def body(*pixels: tuple[int, int], **values: Any) -> Body:
    return Body(frozenset(pixels), **values)


CORNERS: dict[str, tuple[list[Body], int]] = {
    "a side, and behind it the diagonal": ([body((1, 0)), body((1, 1), occluder=True)], 1),
    "both sides, the upper one first": ([body((0, 1)), body((1, 0))], 1),
    "an occluder at the lower side": ([body((1, 0)), body((0, 1), occluder=True)], 1),
    "an occluder under the object at the lower side": (
        [body((1, 0)), body((0, 1), layer=2), body((0, 1), occluder=True)], 1),
    "an object under another is no occluder": ([body((1, 0)), body((0, 1), layer=2), body((0, 1))], 0),
    "only the one that is passed by": ([body((0, 1))], 0),
    "only the diagonal": ([body((1, 1))], 0),
}  # fmt: skip


@pytest.mark.parametrize(("name", "turn"), in_turn(CORNERS, range(4)))
@pytest.mark.parametrize("start", [(0.0, 0.0), (0.5, 0.5), (-3.0, -3.0)])
def test_what_comes_first_at_a_corner(
    kernels: ModuleType, name: str, turn: int, start: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody walks: what is taken at once is told from the planes."""
    monkeypatch.setattr(ray_call, "trace", lambda *_: pytest.fail("walked"))
    bodies, _ = CORNERS[name]
    sx, sy = 1 - 2 * (turn & 1), 1 - (turn & 2)
    turned = [replace(b, pixels=frozenset((sx * x, sy * y) for x, y in b.pixels)) for b in bodies]
    shot = Shot((sx * start[0], sy * start[1]), (sx * 6.0, sy * 6.0))
    battle = Battle(Gun("pistol"), [shot, replace(shot, number=1)], turned, (-9, -9, 9, 9))
    check_columns(battle.fired(strategy="march"), battle.walks(), None)


def test_a_refused_occluder_does_not_come_first_at_a_corner(kernels: ModuleType) -> None:
    """It lies under an object of the lower side, and makes that side no better than the upper one."""
    sides = [body((1, 0)), body((0, 1), layer=2), body((0, 1), occluder=True, categories=2)]
    shots = [Shot((-3.0, -3.0), (6.0, 6.0), blocked_by=bits, number=k) for k, bits in enumerate((1, 3, ALL))]
    found = []
    for shot in shots:
        battle = Battle(Gun("pistol"), [shot, replace(shot, number=9)], sides, (-9, -9, 9, 9))
        hits = battle.fired(strategy="march")
        check_columns(hits, battle.walks(), None)
        assert hits.plan.has_run("march")
        found.append(hits.object.tolist())
    assert found == [[0, 0], [1, 1], [1, 1]]


def test_rays_of_any_reach(kernels: ModuleType) -> None:
    """From far off the bounds, and of the longest range, over batches that are cut into parts."""
    rng = np.random.default_rng(3)
    scene = Scene((300, 200), (-40, 7))
    for _ in range(40):
        scene.add(
            rng.random((9, 12)) < 0.7, rng.uniform((-60, 0), (280, 220)), role=rng.choice(["hittable", "occluder"])
        )
    angle = rng.uniform(0, 2 * np.pi, 400)
    for away in (100.0, 5000.0, 1e6):
        target = rng.uniform((-40, 7), (260, 207), (400, 2))
        at = target + away * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        for weapon in (Pistol(None), Pistol(min(2 * away, FAR), falloff="smooth"), Pistol(FAR)):
            hits = fire(scene, weapon, at, toward=target, strategy="march")
            assert hits == fire(scene, weapon, at, toward=target, strategy="walk") and len(hits) > 30


SEVERAL: list[Weapon] = [
    Sweep(Pistol(90), 40, 5), Spread(Pistol(90, falloff="linear"), 6, 9), Rounds(Pistol(90), 3, (1.5, 2), 4),
    Rounds(Spread(Rifle(70, max_hits=1), 3, 5), 2, (0, 3), 10),
]  # fmt: skip


@pytest.mark.parametrize("weapon", SEVERAL, ids=repr)
def test_shots_of_several_rays_in_parts(weapon: Weapon, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    scene, at = some_scene(rng), rng.uniform(0, 100, (70, 2))
    whole = fire(scene, weapon, at, aim=30, strategy="march")
    monkeypatch.setattr(ray_call, "RAYS_AT_ONCE", 64)
    for strategy in ("march", "walk", "cast"):
        hits = fire(scene, weapon, at, aim=30, strategy=strategy)
        assert hits == whole and len(hits.stop) == hits.rays > len(hits) > 35  # type: ignore[attr-defined]


def some_scene(rng: np.random.Generator, size_wh: tuple[int, int] = (100, 100)) -> Scene:
    scene = Scene(size_wh)
    for k in range(30):
        scene.add(rng.random((8, 8)) < 0.8, rng.uniform(0, 100, 2), role="occluder" if k % 5 == 0 else "hittable")
    return scene


# What is kept


def test_the_plane_follows_the_scene() -> None:
    rng = np.random.default_rng(7)
    scene, at, aim = some_scene(rng), rng.uniform(0, 100, (200, 2)), rng.uniform(0, 360, 200)
    mover = scene.add(np.ones((5, 5), np.bool_), (50, 50), role="mover")

    def marched() -> dict[str, tuple[str, int]]:
        hits = fire(scene, Pistol(80), at, aim=aim, strategy="march")
        assert hits == fire(scene, Pistol(80), at, aim=aim, strategy="walk")
        return {stage.name: (stage.why, stage.bytes_made) for stage in hits.plan.ran}

    for change in (
        lambda: scene.move(3, (50, 50)), lambda: scene.remove(3), lambda: scene.set(5, role="occluder"),
        lambda: scene.add(np.ones((3, 3), np.bool_), (20, 20)), lambda: scene.set(8, angle=45),
    ):  # fmt: skip
        change()
        assert marched()["distance field"] == ("measured anew", 104 * 104)
        assert marched()["distance field"] == ("as it was", 0)
    scene.move(mover, (20, 20))
    scene.move(9, (1000, 1000))
    marched()
    scene.move(9, (2000, 1000))  # off the bounds before and after
    assert marched()["distance field"] == ("as it was", 0)


def test_what_is_told_later_is_of_the_scene_as_it_was() -> None:
    rng = np.random.default_rng(9)
    scene, at, aim = some_scene(rng), rng.uniform(0, 100, (50, 2)), rng.uniform(0, 360, 50)
    hits, same = (fire(scene, Pistol(80), at, aim=aim, strategy=s) for s in ("march", "walk"))
    assert isinstance(hits, RayHits) and isinstance(same, RayHits)
    passes, stop = same.passes, same.stop
    scene.move(scene.ids(), (5, 5))
    for _ in range(20):
        scene.add(rng.random((30, 30)) < 0.5, (50, 50))
    scene.remove(range(20))
    fire(scene, Pistol(80), at, aim=aim, strategy="march")
    assert hits.passes == passes and hits.stop == stop
    with pytest.raises(ValueError, match="read-only"):
        hits.stop.item[0] = 3


def test_shots_at_the_past_jump_there() -> None:
    rng = np.random.default_rng(11)
    scene, at, aim = some_scene(rng), rng.uniform(0, 100, (60, 2)), rng.uniform(0, 360, 60)
    history = History(scene)
    for tick in range(3):
        scene.move(scene.ids(), rng.uniform(0, 100, (len(scene), 2)))
        history.record(tick)
    ticks = rng.integers(0, 3, 60)
    marched, walked = (fire(history, Pistol(80), at, aim=aim, tick=ticks, strategy=s) for s in ("march", "walk"))
    assert marched == walked and marched.plan.has_run("march") and not walked.plan.has_run("march")


# The choice


@pytest.mark.usefixtures("fixed_costs")
def test_rays_jump_where_it_pays() -> None:
    """A plane that has to be made is made for many rays, or for the last of many calls; a weapon that pierces walks."""
    rng = np.random.default_rng(13)
    scene = Scene((1920, 1080))
    for _ in range(100):
        scene.add(np.ones((48, 48), np.bool_), rng.uniform(0, (1920, 1080)))

    def marches_by(weapon: Weapon, rays: int, **how: Any) -> bool:
        plan = fire(scene, weapon, rng.uniform(0, 1000, (rays, 2)), aim=rng.uniform(0, 360, rays), **how).plan
        assert plan.has_run("march") != (
            plan.has_left_out("march") or not isinstance(weapon, Pistol) or weapon.width > 0
        )
        return plan.has_run("march")

    assert not marches_by(Pistol(1000), 3)
    assert marches_by(Pistol(1000), 3000) and marches_by(Pistol(1000), 3)
    assert not marches_by(Pistol(1000), 3000, prefilter="box") and not marches_by(Pistol(1000), 3000, strategy="walk")
    assert not marches_by(Laser(1000), 300) and not marches_by(Pistol(1000, width=2), 300)
    scene.move(0, (500, 500))
    assert not marches_by(Pistol(1000), 3)
    assert [marches_by(Pistol(1000), 20) for _ in range(100)].index(True) > 1
    assert marches_by(Pistol(1000), 1)


def way_of(plan: Plan) -> str:
    """The one way by which rays were found."""
    (way,) = (name for name in ("walk", "cast", "march") if plan.has_run(name))
    return way


@pytest.mark.usefixtures("fixed_costs")
@pytest.mark.parametrize("made", [False, True])
@pytest.mark.parametrize("lost_us", [0, 5000, 10**6])
def test_the_same_call_at_the_same_scene_goes_the_same_way(kernels: ModuleType, made: bool, lost_us: int) -> None:
    """Whatever was fired before: it hangs on whether the field is made, and what was lost without it."""
    rng = np.random.default_rng(17)
    at, aim = rng.uniform(0, 400, (6000, 2)), rng.uniform(0, 360, 6000)
    ways = set()
    for rays in (1, 40, 6000):
        found = []
        for busy in (False, True):
            scene = some_scene(np.random.default_rng(19), (400, 300))
            field = scene.derived.distance_field()
            assert field is not None
            if made:
                fire(scene, Pistol(90), (2, 4), strategy="march")
            if busy:
                for weapon in (Laser(90), Pistol(90, width=3), Disc(4), Pistol(90)):
                    for strategy in ("walk", "cast", "auto"):
                        fire(scene, weapon, at[:50], aim=30, strategy=strategy, prefilter="box")
                    prepare(some_scene(rng), weapon).fire((3, 4))
                for strategy in ("walk", "cast"):
                    fire(scene, Pistol(90), at[:300], aim=aim[:300], strategy=strategy)
            assert field.is_made(scene.items) == made
            assert field.regret == 0, "only calls that choose count"
            field.regret = 1e3 * lost_us
            found.append(way_of(fire(scene, Pistol(90), at[:rays], aim=aim[:rays]).plan))
        assert len(set(found)) == 1
        ways.add(found[0])
    always = kernels is distance_field and (made or lost_us > 0)  # compiled, few rays are cast in any case
    assert ways == ({"march"} if always else {"cast", "march"})


@pytest.mark.usefixtures("fixed_costs")
def test_the_plan_tells_what_was_lost_without_a_field() -> None:
    scene = some_scene(np.random.default_rng(21), (400, 300))
    field = scene.derived.distance_field()
    assert field is not None
    told = []
    for _ in range(2):
        plan = fire(scene, Pistol(90), [(2.25, 4)]).plan
        told.append(next(stage.why for stage in plan.left_out if stage.name == "march"))
        lost = f"which would take 945 us to make: {field.regret / 1e3:.0f} us lost so far"
        assert told[-1].endswith(lost) and told[-1].startswith("about ")
    assert told[0] != told[1]


def test_rays_that_accept_different_items_do_not_march() -> None:
    """Others walk not one cell, whatever they refuse, also what lies in front of something."""
    scene = Scene((60, 60))
    for x in (20, 40, 41):
        scene.add(np.ones((5, 5), np.bool_), (x, 20))
    at = [(10, 20.25), (10, 21.5), (20, 10.5), (0.5, 0.5), (10, 22.5), (20.25, 20.25)]
    toward = [(55, 20.5), (55, 21.5), (20, 55), (55.5, 55.5), (5, 22.5), (57, 20.5)]
    plan = fire(scene, Pistol(None), at, toward=toward, strategy="march").plan
    assert plan.has_left_out("walk") and plan.has_left_out("pre-filter") and not plan.has_run("walk")
    hits = fire(scene, Pistol(None), at[::5], toward=toward[::5], exclude=0, strategy="march")
    assert hits.object.tolist() == [1, 1] and hits.plan.has_left_out("walk")
    hits = fire(scene, Pistol(None), toward[:1] * 2, toward=at[:1] * 2, exclude=2, strategy="march")
    assert hits.object.tolist() == [1, 1] and hits.plan.has_left_out("walk") and hits.plan.has_left_out("cast")
    hits = fire(scene, Pistol(None), toward[:1] * 2, toward=at[:1] * 2, exclude=[2, -1], strategy="march")
    assert hits.object.tolist() == [1, 2] and not hits.plan.has_run("march")
    whys = {stage.name: stage.why for stage in hits.plan.left_out}
    assert whys["march"].startswith("march is passed over: rays accept different items; ")


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("seed", range(4))
def test_each_filter_marches_through_a_plane_of_its_own(seed: int) -> None:
    """What rays refuse is not in it, and behind it lies what it hid; so it is as fast as where nothing is refused."""
    rng = np.random.default_rng(seed)
    scene = Scene((40, 30), categories=("red", "blue"))
    for k in range(300):
        role, categories = "occluder" if k % 2 == 0 else "hittable", ["red", "blue"][k // 2 % 2 :]
        at, layer = rng.integers(0, 40, 2), int(rng.integers(0, 3))
        scene.add(np.ones(rng.integers(1, 3, 2), np.bool_), at, role=role, categories=categories, layer=layer)
    at, aim = rng.uniform(-2, 42, (400, 2)), rng.uniform(0, 360, 400)
    at[::2], aim[::2] = np.floor(at[::2]) + 0.5, np.floor(aim[::2] / 90) * 90 + 45  # through corners
    filters: list[dict[str, Any]] = [
        {"accept": ["red"]}, {"blocked_by": ["red"]}, {"accept": [], "exclude": 3}, {"exclude": [[1, 4, 9]]},
    ]  # fmt: skip
    for how in filters:
        found = fire(scene, Pistol(90), at, aim=aim, **how, strategy="march")
        slow = fire(scene, Pistol(90), at, aim=aim, **how, strategy="walk")
        assert found == slow and found.plan.has_run("march") and not found.plan.has_run("filter")
        assert [found.stops_at(k) for k in range(400)] == [slow.stops_at(k) for k in range(400)]
        points = fire(scene, Point(), at, **how, strategy="labels")
        assert points == fire(scene, Point(), at, **how, strategy="spans") and points.plan.has_run("label plane")


def test_planes_of_the_last_filters_are_kept_and_a_large_one_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(derived, "PLANES_BYTES", 5 * 3 * 90 * 70)
    scene = Scene((90, 70))
    views = [View(False, 1 << k, ()) for k in range(4)]
    fields = [scene.derived.distance_field(view) for view in views[:3]]
    assert all(scene.derived.distance_field(view) is field for view, field in zip(views, fields, strict=False))
    assert all(field is not None and field.labels is scene.derived.label_plane(field.labels.view) for field in fields)
    scene.derived.distance_field(views[3])
    assert (
        scene.derived.distance_field(views[1]) is fields[1] and scene.derived.distance_field(views[0]) is not fields[0]
    )
    monkeypatch.setattr(derived, "PLANES_BYTES", 9)
    large = Scene((90, 70))
    only = large.derived.distance_field(views[0])
    assert only is large.derived.distance_field(views[0]) is not None
    assert large.derived.distance_field(views[1]) is not only is not large.derived.distance_field(views[0])


@example(1)
@example(50)
@given(st.integers(1, 200))
@examples(15, deadline=None)
def test_how_many_are_followed_together_changes_nothing(few: int) -> None:
    rng = np.random.default_rng(few)
    plane = rng.random((60, 90)) < 0.01
    distances = distance_field.distances_of(plane)
    start, step = rng.integers(-20 * 256, 110 * 256, (300, 2)), rng.integers(-100 * 256, 100 * 256, (300, 2))
    start[:100] &= -128
    step[:100] &= -128
    truth = distance_field.first_taken(distances, start, step)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distance_field, "FEW", few)
        found = distance_field.first_taken(distances, start, step)
    assert all(np.array_equal(a, b) for a, b in zip(found, truth, strict=True))
