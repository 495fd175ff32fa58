"""Margins of rays: against shots that are fired again at every shift, and small pictures."""

import math
import random
import tracemalloc
from collections.abc import Set
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import ray_battles
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from oracle_margins import SHIFTS, Shift, margins
from oracle_rays import StartsInside
from ray_battles import Battle

from hitplanes import (
    Hits,
    InputError,
    Laser,
    Pistol,
    Projectile,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Sweep,
    Weapon,
    fire,
    report_of,
)
from hitplanes.weapons.explain.margins import FINE_RAYS, RAYS_MAX

WEAPONS = (
    Laser(16), Laser(9.5, width=3), Laser(None), Laser(12, inside="ignore_until_exit"), Pistol(16),
    Pistol(16, width=1.5), Pistol(None, inside="error"), Rifle(16, max_hits=2), Rifle(16, budget=4.5),
    Rifle(16, max_hits=3, budget=9, width=2), Projectile(7.5, 1), Projectile(5, 0.5, inside="ignore_until_exit"),
    Projectile(9, 1.5, steps=3),
    Projectile(6, 1, inside="error"), Projectile(9, 1.5, steps=3, inside="error"),
    Sweep(Pistol(14), 40, 3), Spread(Laser(12), 3, 4), Spread(Pistol(12, width=1), 4, 5),
    Rounds(Pistol(14), 3, (0.25, -0.5)), Rounds(Rifle(14, max_hits=1), 2, recoil_deg=12),
    Rounds(Spread(Pistol(10, inside="error"), 2, 3), 2, (3, 1)),
)  # fmt: skip


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Some boxes and discs in 24 x 20 px, some at one place; some block, move, or belong to a body."""
    scene = Scene((24, 20) if draw(st.booleans()) else None)
    for _ in range(draw(st.integers(1, 7))):
        sprite = draw(st.sampled_from((Sprite.box(3, 3), Sprite.circle(3), Sprite.box(1, 1), Sprite.box(2, 9))))
        scene.add(
            sprite, (draw(st.integers(0, 23)), draw(st.integers(0, 19))),
            role=draw(st.sampled_from(("hittable", "hittable", "hittable", "occluder"))),
            layer=draw(st.integers(-1, 1)), categories=draw(st.sampled_from((1, 1, 2, 3))),
            owner=draw(st.sampled_from((None, None, 0))), cost=draw(st.sampled_from((0, 1, 3))),
            velocity_xy=draw(st.sampled_from(((0, 0), (0, 0), (2, -1)))),
        )  # fmt: skip
    return scene


places = st.tuples(st.integers(-256, 24 * 256), st.integers(-256, 20 * 256))
options = st.fixed_dictionaries({
    "accept": st.sampled_from((1, 2, 3)), "blocked_by": st.sampled_from((0, 1, 3)), "seed": st.integers(0, 3),
    "exclude": st.sampled_from((None, 0)),
})  # fmt: skip


def hit_at(scene: Scene, weapon: Weapon, at: Any, toward: Any, **how: Any) -> dict[Shift, Set[int]]:
    """What the shot, walked, hits at each shift; shifts from which it cannot be fired are left out."""
    found: dict[Shift, Set[int]] = {}
    parts = [SHIFTS]
    while parts:
        part = parts.pop()
        try:
            hits = fire(
                scene, weapon, np.add(at, part), toward=np.add(toward, part), shot=[0] * len(part), strategy="walk",
                **how,
            )  # fmt: skip
            found |= {shift: {row.object for row in hits.of(i)} for i, shift in enumerate(part)}
        except InputError:  # one of them starts inside an item, and may not
            middle = len(part) // 2
            parts += [part[:middle], part[middle:]] if middle else []
    return found


def told_of(hits: Hits, shot: int = 0) -> list[tuple[Any, ...]]:
    """Margins without the number of the shot."""
    assert all(margin.shot == shot for margin in hits.margins(shot))
    return [margin[1:] for margin in hits.margins(shot)]


@examples(200, deadline=None)
@given(scenes(), st.sampled_from(WEAPONS), places, places, options)
def test_a_shot_that_is_fired_again_hits_what_its_margins_tell(
    scene: Scene, weapon: Weapon, at_256: tuple[int, int], toward_256: tuple[int, int], how: dict[str, Any]
) -> None:
    at, toward = np.array(at_256) / 256, np.array(toward_256) / 256
    if at_256 == toward_256:
        toward = toward + 1
    try:
        hits = fire(scene, weapon, at, toward=toward, **how)
    except InputError:
        return
    assert told_of(hits) == margins(hit_at(scene, weapon, at, toward, **how), scene.ids("hittable"))


def walked_at(battle: Battle) -> dict[Shift, Set[int]]:
    """What the one shot of a battle hits at each shift, by the oracle of rays."""
    (shot,), found = battle.shots, {}
    for x, y in SHIFTS:
        at, toward = ((place[0] + x, place[1] + y) if place else None for place in (shot.at, shot.toward))
        assert at is not None
        try:
            (walks,) = replace(battle, shots=[replace(shot, at=at, toward=toward)]).walks()
        except StartsInside:
            continue
        found[x, y] = {one.object for _, walked in walks for one in walked.passes}
    return found


@pytest.mark.parametrize("seed", [*range(8), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(8, 100))])
def test_margins_against_the_oracle_of_rays(seed: int) -> None:
    battle = ray_battles.some_battle(random.Random(seed))
    objects = [number for number, body in enumerate(battle.bodies) if not body.occluder]
    try:
        hits = battle.fired()
    except InputError:
        return
    for which, shot in enumerate(battle.shots):
        assert told_of(hits, which) == margins(walked_at(replace(battle, shots=[shot])), objects)


@pytest.mark.parametrize("at_once", [1, 7, 100])
@pytest.mark.parametrize("seed", range(6))
def test_margins_do_not_depend_on_how_many_shifts_are_tried_at_a_time(
    seed: int, at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    hits = ray_battles.some_battle(random.Random(seed)).fired()
    told = hits.margins()
    monkeypatch.setattr("hitplanes.weapons.explain.margins.RAYS_AT_ONCE", at_once)
    assert hits.margins() == told


# Small pictures


def filled(x: int, y: int, x_last: int, y_last: int) -> Sprite:
    return Sprite.from_mask(np.ones((y_last - y + 1, x_last - x + 1), np.bool_), pivot_xy=(0, 0))


def world(*bodies: tuple[tuple[int, int], tuple[int, int]]) -> Scene:
    """Boxes of pixels, from one to another."""
    scene = Scene()
    for at, last in bodies:
        scene.add(filled(*at, *last), at)
    return scene


def wall(scene: Scene, x: int, y: int, x_last: int, y_last: int) -> Scene:
    scene.add(filled(x, y, x_last, y_last), (x, y), role="occluder", layer=1)
    return scene


TARGET, BEHIND = ((10, -1), (12, 1)), ((13, -1), (15, 1))

PICTURES = {
    "sideways": (world(TARGET), Laser(30), (0, 0), [(0, True, 1.75, (0, -1.75))]),
    "out of the middle": (world(TARGET), Laser(30), (0, 0.25), [(0, True, 1.5, (0, 1.5))]),
    "its range is short": (world(TARGET), Pistol(10), (0, 0), [(0, True, 0.75, (-0.75, 0))]),
    "it ends at the wall": (wall(world(((10, -9), (12, 9))), 13, -9, 13, 9), Pistol(12), (0, 0),
                            [(0, True, 3.0, (-3, 0))]),
    "along an edge": (world(TARGET), Laser(30), (0, 1.5), [(0, True, 1 / 256, (0, 1 / 256))]),
    "along a seam": (world(((10, 0), (14, 1))), Laser(30), (0, 0.5), [(0, True, 1.25, (0, -1.25))]),
    "along the seam of two steps": (world(((10, 0), (12, 0)), ((12, 1), (14, 1))), Laser(30), (0, 0.5),
                                    [(0, True, 1 / 256, (0, 1 / 256)), (1, True, 1 / 256, (0, -1 / 256))]),
    "thick": (world(TARGET), Laser(30, width=3), (0, 0), [(0, True, 3.0, (0, -3))]),
    "missed": (world(((10, 4), (12, 5))), Laser(30), (0, 0), [(0, False, 4.0, (0, 4))]),
    "missed by what is thick": (world(((10, 4), (12, 5))), Laser(30, width=3), (0, 0), [(0, False, 3.0, (0, 3))]),
    "missed by little": (world(((10, 1), (12, 5))), Laser(30), (0, 127 / 256), [(0, False, 1 / 256, (0, 1 / 256))]),
    "short of it": (world(((12, 3), (13, 4))), Laser(8.5), (0, 0), [(0, False, math.sqrt(3**2 + 3**2), (3, 3))]),
    "8 px": (world(((10, 8), (12, 9))), Laser(30), (0, -0.5), [(0, False, 8.0, (0, 8))]),
    "more": (world(((10, 8), (12, 9))), Laser(30), (0, -129 / 256), []),
    "behind what ended it": (world(TARGET, BEHIND), Pistol(30), (0, 0), [(0, True, 1.75, (0, -1.75))]),
    "beside what ended it": (world(TARGET, ((13, 0), (15, 2))), Pistol(30), (0, 0),
                             [(0, True, 1.75, (0, -1.75)), (1, False, 1.75, (0, 1.75))]),
    "something else ends it": (world(TARGET, ((4, 1), (5, 9))), Pistol(30), (0, 0),
                               [(0, True, 0.5, (0, 0.5)), (1, False, 0.5, (0, 0.5))]),
    "the last of two": (world(TARGET, BEHIND, ((16, -1), (17, 0))), Rifle(30, max_hits=2), (0, 0),
                        [(0, True, 1.75, (0, -1.75)), (1, True, 1.75, (0, -1.75))]),
    "its budget": (world(((10, -1), (12, 0)), BEHIND), Rifle(30, budget=3), (0, 0),
                   [(0, True, 0.75, (0, 0.75)), (1, False, 0.75, (0, 0.75))]),
    "behind a wall": (wall(world(((14, 0), (15, 0))), 10, -1, 11, 1), Laser(30), (0, 0), []),
    "on the wall": (wall(world(((10, 0), (11, 2))), 10, -1, 11, 1), Laser(30), (0, 0), [(0, False, 1.75, (0, 1.75))]),
    "past a wall": (wall(world(((8, 0), (9, 0))), 3, -30, 4, 30), Laser(30), (0, 0),
                                    [(0, False, 5.0, (5, 0))]),
    "from inside": (world(((-2, -2), (2, 2))), Laser(30), (0, 0), [(0, True, 3.0, (0, -3))]),
    "from inside, ahead": (world(((-9, -9), (2, 9))), Laser(30), (0, 0), [(0, True, 3.0, (3, 0))]),
    "ignored": (world(((-2, -2), (2, 2))), Laser(30, inside="ignore_until_exit"), (0, 0), [(0, False, 3.0, (-3, 0))]),
    "not to be fired from inside": (world(((1, -9), (2, 9))), Laser(30, inside="error"), (0, 0),
                                    [(0, True, 3.0, (3, 0))]),
    "not to be fired from inside, a later round": (
        world(((1, -9), (2, 9))), Rounds(Laser(30, inside="error"), 2, recoil_xy=(-3, 0)), (0, 0),
        [(0, True, 6.0, (6, 0))]),
    "through a gap of a px": (world(((10, -1), (12, 0)), ((10, 2), (12, 3))), Laser(30), (0, 1),
                              [(0, False, 0.5, (0, -0.5)), (1, False, 0.5, (0, 0.5))]),
}  # fmt: skip


@pytest.mark.parametrize("name", PICTURES)
def test_small_pictures(name: str) -> None:
    scene, weapon, at, expected = PICTURES[name]
    assert told_of(fire(scene, weapon, at, aim=0)) == expected


def test_a_gap_in_an_object_is_a_way_out() -> None:
    """Of two bars with one empty row between: into the gap, which holds a thin ray, and not one that is wider."""
    scene = Scene()
    item = scene.add(Sprite.from_mask(np.array([[1], [1], [0], [1], [1]], np.bool_), pivot_xy=(0, 0)), (10, 0))
    assert fire(scene, Laser(30), (0, 1.25), aim=0).margins() == [(0, item, True, 0.3125, (0, 0.3125))]
    assert fire(scene, Laser(30, width=2), (0, 1.25), aim=0).margins() == [(0, item, True, 3.0, (0, -3))]


@pytest.mark.parametrize("up", [True, False])
def test_what_lies_at_the_end_of_a_ray_is_left_sideways_or_back(up: bool) -> None:
    """Six rows are passed through, eight lie at its end: out by the corner between them."""
    mask = np.zeros((8, 30), np.bool_)
    mask[2:, :6] = mask[:, 23:26] = True
    scene = Scene()
    item = scene.add(Sprite.from_mask(mask if up else mask[::-1], pivot_xy=(0, 0)), (15, -2 if up else -4))
    (margin,) = fire(scene, Laser(40), (0, 0.5), aim=0).margins()
    side = -1 if up else 1
    assert margin[:3] == (0, item, True) and margin.shift_xy == (-3.0, 2.0 * side)


def test_pellets_move_together() -> None:
    """One leaves where another comes in: all have to be out at once."""
    scene = world(((10, 0), (10, 0)))
    laser = Sweep(Laser(40), 0, 2)
    assert fire(scene, laser, (0, 0), aim=0).margins() == [(0, 0, True, 0.75, (0, -0.75))]
    burst = Rounds(Laser(40), 2, recoil_xy=(0, 0.75))
    assert fire(scene, burst, (0, 0), aim=0).margins() == [(0, 0, True, 0.75, (0, 0.75))]
    assert fire(scene, Rounds(Laser(40), 2, recoil_xy=(0, 2)), (0, -0.25), aim=0).margins() == [
        (0, 0, True, 0.3125, (0, -0.3125))
    ]


def test_out_of_bounds_there_is_nothing_to_touch() -> None:
    scene = Scene((20, 10))
    scene.add(Sprite.box(3, 9), (10, 9))
    assert fire(scene, Laser(30), (0, 3), aim=0).margins() == [(0, 0, False, 1.5, (0, 1.5))]
    scene = Scene((20, 5))
    scene.add(Sprite.box(3, 9), (10, 9))
    assert fire(scene, Laser(30), (0, 3), aim=0).margins() == []


@pytest.mark.parametrize("seed", range(12))
def test_margins_are_the_same_anywhere(seed: int) -> None:
    """Of rays that are moved by whole pixels with their world, also far."""
    battle = ray_battles.some_battle(random.Random(1000 + seed))
    try:
        here = battle.fired().margins()
    except InputError:
        return
    assert battle.moved(10**9, -(10**9) + 7).fired().margins() == here


@pytest.mark.parametrize("seed", range(20))
def test_a_projectile_flies_relative_to_what_it_meets(seed: int) -> None:
    """An object that moves is met as one at rest is by a ray of the relative velocity."""
    rng = random.Random(seed)
    radius, at = rng.choice([0.5, 1, 2.25]), (rng.randint(-512, 512) / 256, rng.randint(-512, 512) / 256)
    aim, ahead = rng.choice([(0, (1, 0)), (90, (0, 1)), (180, (-1, 0))])
    speed, moves = rng.randint(1, 3000) / 256, (rng.randint(-3000, 3000) / 256, rng.randint(-3000, 3000) / 256)
    mask = np.array([[rng.random() < 0.7 for _ in range(5)] for _ in range(4)])
    still, moving = Scene(), Scene()
    for scene, velocity in ((still, (0, 0)), (moving, moves)):
        scene.add(Sprite.from_mask(mask, pivot_xy=(0, 0)), (4, 2), velocity_xy=velocity)
    toward = (at[0] + speed * ahead[0] - moves[0], at[1] + speed * ahead[1] - moves[1])
    thrown = fire(moving, Projectile(speed, radius), at, aim=aim).margins()
    aimed = fire(still, Laser(None, width=2 * radius), at, toward=toward).margins()
    assert [margin[:3] for margin in thrown] == [margin[:3] for margin in aimed]
    assert [margin.distance for margin in thrown] == pytest.approx([margin.distance for margin in aimed])


# Refusals, and what it costs


@pytest.mark.parametrize(("rays", "distance"), [(FINE_RAYS, 0.25), (FINE_RAYS + 1, 1)])
def test_many_rays_are_shifted_by_whole_pixels(rays: int, distance: float) -> None:
    scene = Scene()
    box = scene.add(Sprite.box(3, 3), (8, 2))
    (margin,) = fire(scene, Spread(Pistol(12), rays, 0), (0, 0.25), aim=0).margins()
    assert (margin.object, margin.hit, margin.distance, margin.shift_xy) == (box, False, distance, (0, distance))


def test_very_many_rays_have_no_margins() -> None:
    """They say so; a report of theirs tells none."""
    scene = world(TARGET)
    crowd = fire(scene, Spread(Pistol(30), RAYS_MAX + 1, 9), (0, 0), aim=0)
    with pytest.raises(InputError, match=r"shot: expected one of at most 1024 rays, got 1025"):
        crowd.margins()
    assert not crowd.has_margins
    (told,) = report_of(scene, [crowd])["shots"]
    assert not any("margin" in entry for entry in [*told["rows"], *told["why_not"]])
    assert fire(scene, Spread(Pistol(30), RAYS_MAX, 9), (0, 0), aim=0).has_margins


def test_a_projectile_that_is_tested_in_steps_has_margins() -> None:
    """It goes through a wall between its tests at 10 and 20 px, and touches it at 16 px."""
    scene = world(((15, -5), (15, 5)))
    (margin,) = fire(scene, Projectile(20, 1, steps=2), (0, 0), aim=0).margins()
    assert margin == (0, 0, False, 4.0, (-4, 0))


def test_margins_of_an_old_answer_are_refused() -> None:
    scene = world(TARGET)
    hits = fire(scene, Laser(30), np.zeros((0, 2)), aim=[])
    assert hits.margins() == []
    scene.add(Sprite.box(1, 1), (3, 3))
    with pytest.raises(InputError, match="read this before the scene changes"):
        hits.margins()


def test_margins_need_little_memory() -> None:
    """Of a large object, long rays and a fat one: only what is near counts."""
    scene = Scene()
    item = scene.add(Sprite.circle(400), (1000, 0))
    far = scene.add(Sprite.circle(400), (2**19, 50_000))
    fired = [
        fire(scene, Spread(Laser(2**19), 16, 2000), (0, 0), aim=0),
        fire(scene, Laser(2000, width=100), (0, 440), aim=1),
        fire(scene, Laser(None), (1000, -350), toward=(2**19, 50_397)),
    ]
    tracemalloc.start()
    try:
        told = [hits.margins() for hits in fired]
        assert tracemalloc.get_traced_memory()[1] < 96 * 2**20
    finally:
        tracemalloc.stop()
    assert {margin.object for margins in told for margin in margins} <= {item, far}
    assert told[2][-1].object == far and told[2][-1].hit
