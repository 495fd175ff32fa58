"""A weapon that `fire` gets alone again is made ready: the answers are the same, and so are the errors."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from ray_battles import some_battle as some_ray_battle
from test_fire import Placements, expected, some_battle, told
from test_prepare import WEAPONS, changed, crowd, same

from hitplanes import (
    ALL,
    Beam,
    Box,
    Disc,
    History,
    InputError,
    Laser,
    Pistol,
    Rifle,
    Scene,
    Spread,
    Weapon,
    fire,
    use_jit,
    weapon_from_json,
)
from hitplanes.planes.scene import derived
from hitplanes.weapons.prepared import prepare

AT = (60.5, 50.25)


def is_ready(hits: Any) -> bool:
    """Whether the weapon of a shot was ready for the scene."""
    return [stage.name for stage in hits.plan.ran][:1] == ["prepared"]


def readiness(scene: Scene, weapon: Weapon, n: int, **how: Any) -> list[bool]:
    """The same of n shots, each a call."""
    return [is_ready(fire(scene, weapon, AT, **how)) for _ in range(n)]


@pytest.mark.parametrize("weapon", [Disc(3), Box(9, 4), Pistol(50), Spread(Pistol(50), 3, 9)], ids=str)
def test_a_weapon_is_ready_from_the_second_shot_on(weapon: Weapon, jit: bool) -> None:
    scene = crowd(1)
    assert readiness(scene, weapon, 3) == [False, True, True]
    assert readiness(scene, weapon, 2, aim=33) == readiness(scene, weapon, 2, toward=(9, 9)) == [True, True]
    assert readiness(crowd(1), weapon, 2) == [False, True]  # another scene, though like it


OTHERS: list[dict[str, Any]] = [
    {"accept": ["glass"]}, {"blocked_by": 0}, {"exclude": 4}, {"exclude": np.int64(8)}, {"seed": 3},
    {"exclude": [4, 8]}, {"exclude": (np.int64(8), -1, 3)}, {"exclude": []},
    {"exclude": np.array([4, 8], np.uint8)},
]  # fmt: skip


@pytest.mark.parametrize("weapon", [Disc(3), Pistol(50), Spread(Disc(1), 3, 5)], ids=lambda weapon: weapon.kind)
def test_another_filter_or_seed_is_ready_at_once(weapon: Weapon, jit: bool) -> None:
    scene = crowd(1)
    assert readiness(scene, weapon, 2) == [False, True]
    for how in OTHERS:
        assert readiness(scene, weapon, 2, **how) == [True, True]
        assert fire(scene, weapon, AT, **how) == fire(scene, weapon, AT, strategy="direct", **how)
    assert readiness(scene, weapon, 1, accept="glass") == [True]
    assert readiness(scene, weapon_from_json(weapon.to_json()), 1) == [True]  # an equal one


@pytest.mark.parametrize("weapon", [Beam(90, 5), Box(9, 4), Laser(150)], ids=lambda weapon: weapon.kind)
def test_numbers_of_numpy_are_ready_as_those_of_python(weapon: Weapon, jit: bool) -> None:
    scene = crowd(1)
    assert readiness(scene, weapon, 2) == [False, True]
    for number in (np.float64(33.3), np.float32(33.3), np.float16(33.3), np.int64(-7), np.uint8(200)):
        hits = fire(scene, weapon, AT, aim=number, shot=np.int32(4))
        assert is_ready(hits)
        same(hits, fire(scene, weapon, AT, aim=number, shot=np.int32(4), strategy="direct"))
        same(fire(scene, weapon, AT, aim=number.item(), shot=4), hits)


@pytest.mark.parametrize("weapon", [Beam(90, 5), Laser(150)], ids=lambda weapon: weapon.kind)
def test_owners_are_those_of_each_aim(weapon: Weapon, jit: bool) -> None:
    """One position with several aims is several shots, each with owners of its own."""
    scene = crowd(1)
    aims: list[dict[str, Any]] = [{"aim": [0, 90]}, {"toward": [(99, 50), (60, 90)]}, {"aim": np.array([0.0, 90.0])}]
    struck = [set(fire(scene, weapon, AT, aim=aim, strategy="direct").object.tolist()) for aim in (0, 90)]
    first, second = (min(own) for own in struck)
    for how in aims:
        for exclude in ([second, first], (second, first), np.array([second, first]), [first, second]):
            truth = fire(scene, weapon, AT, exclude=exclude, strategy="direct", **how)
            for _ in range(3):
                assert fire(scene, weapon, AT, exclude=exclude, **how) == truth
            assert ({first, second} <= set(truth.object.tolist())) == (list(exclude) == [second, first])


@pytest.mark.parametrize(
    "weapon",
    [
        Rifle(90, budget=20),
        Rifle(90, budget=4),
        Rifle(90, width=3, budget=4),
        Rifle(90, budget=0),
        Laser(90, inside="ignore_until_exit"),
        Laser(90, width=3, inside="error"),
    ],
    ids=str,
)
def test_rays_that_must_not_walk_are_ready(weapon: Weapon, jit: bool) -> None:
    """Those with a budget, and those that begin in no item."""
    scene = Scene()
    scene.add(np.ones((9, 9), np.bool_), (20, 0))
    scene.add(np.ones((9, 9), np.bool_), (0, 60), role="occluder")
    budget = getattr(weapon, "budget", None)
    fire(scene, weapon, (0.0, 0.0))
    for aim, at, begins in (
        (0, (0.0, 0.0), False), (90, (0.0, 0.0), False), (180, (0.0, 0.0), False),
        (0, (20.0, 0.0), True), (180, (24.5, 0.0), True), (0, (0.0, 60.0), True),
    ):  # fmt: skip
        if begins and getattr(weapon, "inside", "") == "error":
            with pytest.raises(InputError):
                fire(scene, weapon, at, aim=aim)
            continue
        hits, truth = fire(scene, weapon, at, aim=aim), fire(scene, weapon, at, aim=aim, strategy="walk")
        same(hits, truth)
        assert hits.stop == truth.stop and hits.passes == truth.passes
        assert is_ready(hits) == (not begins if budget is None else budget > 0)


@pytest.mark.parametrize("most", [None, 2])
def test_a_budget_that_would_be_used_up_behind_the_end(most: int | None, jit: bool) -> None:
    """An occluder, or the last object, lies in the midst of an object which would use up the budget behind it."""
    scene = Scene()
    scene.add(np.ones((9, 9), np.bool_), (20, 0))
    scene.add(np.ones((9, 1), np.bool_), (20, 0), role="hittable" if most else "occluder")
    weapon = Rifle(90, budget=6, max_hits=most)
    for _ in range(2):
        hits = fire(scene, weapon, (0.0, 0.0), aim=0)
    same(hits, fire(scene, weapon, (0.0, 0.0), aim=0, strategy="walk"))
    assert is_ready(hits) and hits.samples.tolist() == ([4, 1] if most else [4])


def test_each_shooter_of_many_is_ready(jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each excludes itself, and the filters of the last few are kept; also those that are made anew hit the same."""
    monkeypatch.setattr(prepare, "FILTERS_MOST", 20)
    scene = crowd(3)
    owners = scene.ids()[:23].tolist()
    assert len(owners) == 23
    assert not is_ready(fire(scene, Disc(30), AT))
    for _ in range(2):
        for owner in owners:
            hits = fire(scene, Disc(30), AT, exclude=owner, seed=owner)
            assert is_ready(hits)
            same(hits, fire(scene, Disc(30), AT, exclude=owner, seed=owner, strategy="direct"))
            assert hits.shots.exclude.tolist() == [[owner]]
            assert hits.shots.seed.tolist() == [owner]
        scene.move(owners, (3, 4))


def test_shooters_keep_the_kernels_of_a_version() -> None:
    """A filter that is new after `use_jit` has the other kernels; those of before keep theirs until a change."""
    pytest.importorskip("numba")
    scene, weapon, how = crowd(3), Beam(90, 20), {"aim": 30.0}
    truths = [fire(scene, weapon, AT, exclude=owner, strategy="direct", **how) for owner in range(9)]
    try:
        for owner in range(9):
            use_jit(owner % 2 == 1)
            for k in range(owner + 1):
                same(fire(scene, weapon, AT, exclude=k, **how), truths[k])
    finally:
        use_jit(None)


def test_filters_of_a_spread_have_their_own_draws(jit: bool) -> None:
    scene, weapon = crowd(3), Spread(Disc(2), 9, 40)
    ready = prepare.prepare(scene, weapon)
    for shot in (0, 1, 0):
        for seed in (0, 5, 6):
            truth = fire(scene, weapon, AT, seed=seed, shot=shot, strategy="direct")
            same(prepare.filtered(ready, ALL, ALL, (), seed).fire(AT, shot=shot), truth)


def test_new_draws_of_a_spread_are_ready_at_once(jit: bool) -> None:
    scene, weapon = crowd(1), Spread(Disc(1), 3, 9)
    assert readiness(scene, weapon, 1) == [False]
    for shot in (1, 2, 2**40, np.int64(1)):
        assert readiness(scene, weapon, 1, shot=shot) == [True]
        same(fire(scene, weapon, AT, shot=shot), fire(scene, weapon, AT, shot=shot, strategy="direct"))
    with pytest.raises(InputError, match="shot"):
        fire(scene, weapon, AT, shot=[[1]])


@pytest.mark.parametrize(
    "how",
    [
        {"strategy": "direct"}, {"prefilter": "box"}, {"broadphase": "none"}, {"exclude": [[1, 2]]},
        {"accept": [3]}, {"seed": np.array([3], np.uint64)},
    ],
)  # fmt: skip
def test_what_asks_for_more_is_answered_by_the_scene(how: dict[str, Any]) -> None:
    assert readiness(crowd(1), Disc(3), 3, **how) == [False] * 3


@pytest.mark.parametrize("weapon", [Pistol(150), Laser(150, width=3), Rifle(99, max_hits=2)], ids=lambda w: w.kind)
def test_one_ray_at_the_past_is_ready_at_once(weapon: Weapon, jit: bool) -> None:
    """Of a recorded tick, and of one between two; each kind of filter, and errors, are those of a batch."""
    scene, rng = crowd(5), random.Random(2)
    history = History(scene, interpolate=True)
    for _ in range(4):
        history.record()
        changed(scene, rng)
    hit = 0
    for k in range(24):
        how: dict[str, Any] = [{}, {"accept": "glass"}, {"exclude": [k, 1]}, {"aim": 20.0 * k}, {"toward": (90, 80)}][
            k % 5
        ]
        at, tick = (rng.uniform(0, 200), rng.uniform(0, 150)), rng.choice([0, 2, 1.5, 0.25, np.float64(2.75)])
        hits = fire(history, weapon, at, tick=tick, **how)
        same(hits, fire(history, weapon, at, tick=tick, strategy="direct", **how))
        assert [stage.name for stage in hits.plan.ran][:2] == ["past", "prepared"]
        assert hits.scene_of(0).tick == tick
        hit += len(hits)
    assert hit > 9
    for bad in ({"tick": 9}, {"tick": True}, {"tick": 1, "exclude": 999}, {"tick": 1, "aim": "east"}):
        with pytest.raises(InputError) as told:
            fire(history, weapon, AT, **bad)
        with pytest.raises(InputError) as truth:
            fire(history, weapon, AT, strategy="direct", **bad)
        assert str(told.value) == str(truth.value)
    with pytest.raises(InputError, match=r"^scene: expected a Scene or a History, got list"):
        fire([], weapon, AT, tick=1)  # type: ignore[arg-type]


def test_batches_and_the_past_are_answered_by_the_scene() -> None:
    scene = crowd(1)
    history = History(scene, ticks=2)
    history.record(0)
    for _ in range(3):
        assert not is_ready(fire(scene, Disc(3), [AT, AT]))
        assert not is_ready(fire(scene, Disc(3), [AT]))
        assert not is_ready(fire(history, Disc(3), AT, tick=0))


def test_the_last_few_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    made, inner = [0], prepare.prepare
    monkeypatch.setattr(prepare, "prepare", lambda *of, **how: made.append(made.pop() + 1) or inner(*of, **how))
    for many, each in ((derived.AGAIN_MOST, 1), (derived.AGAIN_MOST + 1, 2)):
        scene, weapons = crowd(1), [Disc(radius) for radius in range(1, many + 1)]
        made[0] = 0
        for number in range(3):
            for weapon in weapons:
                assert is_ready(fire(scene, weapon, AT)) == (number > 0)
        assert made[0] == each * many


def test_weapons_that_were_fired_long_ago_are_forgotten() -> None:
    scene, weapons = crowd(1), [Disc(radius) for radius in range(1, derived.ASKED_MOST + 2)]
    for _ in range(2):
        for weapon in weapons:
            assert not is_ready(fire(scene, weapon, AT))


@pytest.mark.parametrize("name", WEAPONS)
def test_every_weapon_in_a_crowd_that_changes(name: str, jit: bool) -> None:
    weapon, options = WEAPONS[name]
    scene, rng = crowd(7), random.Random(3)
    for k in range(12):
        at = rng.uniform(-60, 300), rng.uniform(-60, 220)
        how: dict[str, Any] = [{}, {"aim": 22.5}, {"toward": (at[0] - 3, at[1] + 1)}, {"shot": 9}][k % 4]
        if name == "line of sight":
            how = {"toward": (at[0] - 3 - k, at[1] + 1)}
        truth = fire(scene, weapon, at, strategy="direct", **options, **how)
        for _ in range(3):
            same(fire(scene, weapon, at, **options, **how), truth)
        if k % 3 == 2:
            changed(scene, rng)


@examples(25, deadline=None)
@given(st.integers(0, 10**6))
def test_random_scenes_against_the_oracle(seed: int) -> None:
    battle = some_battle(seed)
    scene, volley = battle.scene(), battle.volley
    for which, shot in enumerate(volley.shots):
        truth = expected(scene, Placements(volley.weapon, [shot], volley.seed))
        for _ in range(3):
            assert told(volley.alone(scene, which)) == truth, f"{seed=}"


@examples(25, deadline=None)
@given(st.randoms(use_true_random=False))
def test_random_rays_against_the_walk(rng: random.Random) -> None:
    battle = some_ray_battle(rng)
    scene, weapon = battle.scene(), battle.gun.weapon()
    for shot in battle.shots:
        how: dict[str, Any] = {"toward": shot.toward} if shot.toward else {"aim": shot.aim}
        how |= {"accept": shot.accept, "blocked_by": shot.blocked_by, "seed": battle.seed, "shot": shot.number}
        how["exclude"] = rng.sample(range(len(battle.bodies)), min(rng.randrange(4), len(battle.bodies)))
        try:
            truth = fire(scene, weapon, shot.at, strategy="walk", **how)
        except InputError:  # its eye is in what it must not start in
            for _ in range(3):
                with pytest.raises(InputError):
                    fire(scene, weapon, shot.at, **how)
            continue
        for _ in range(3):
            same(fire(scene, weapon, shot.at, **how), truth)


@pytest.mark.parametrize(
    "bad",
    [
        {"accept": True}, {"accept": -1}, {"accept": 1.5}, {"accept": ["glas"]}, {"blocked_by": True},
        {"exclude": True}, {"exclude": -2}, {"exclude": 10**6},
        {"exclude": [1, True]}, {"exclude": (1, 10**6)}, {"seed": True}, {"seed": -1}, {"shot": -1},
        {"aim": "left"},
        {"aim": np.float32("nan")}, {"aim": np.float64("inf")}, {"at": (10**400, 1)}, {"at": (2**70, 1)},
        {"aim": [3.5], "exclude": [1, 2]}, {"aim": [3.5, 4, 5], "exclude": [1, 2]}, {"toward": [], "exclude": [1, 2]},
        {"aim": 1, "toward": (1, 2)}, {"at": (1, float("nan"))}, {"at": (1, 2, 3)}, {"at": ("a", 2)}, {"tick": 3},
        {"weapon": "disc"}, {"scene": "world"}, {"strategy": "fast"}, {"prefilter": ["box"]}, {"broadphase": 3},
    ],
    ids=str,
)  # fmt: skip
def test_bad_input_is_refused_in_the_same_words_at_each_call(bad: dict[str, Any], jit: bool) -> None:
    """Also values that equal good ones, like True and 1, at a scene where a weapon is ready for these."""
    scene = crowd(6)
    for how in ({}, {"accept": 1}, {"blocked_by": 1}, {"exclude": 1}, {"seed": 1}):
        readiness(scene, Disc(3), 2, **how)
    given = {"scene": scene, "weapon": Disc(3), "at": AT} | bad
    texts = set()
    for _ in range(3):
        with pytest.raises(InputError) as error:
            fire(**given)
        texts.add(str(error.value))
    with pytest.raises(InputError) as alone:
        fire(**(given | {"scene": crowd(6)} | bad))
    assert texts == {str(alone.value)}
