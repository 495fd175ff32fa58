"""Margins of rays: against shifts tried one by one, and laws."""

import math
import random
import tracemalloc
from dataclasses import replace
from fractions import Fraction

import numpy as np
import oracle_margins
import oracle_rays
import pytest
import ray_battles
from oracle_margins import Segment
from oracle_rays import StartsInside, Walk
from ray_battles import Battle, Ray
from some_of import some_of

from hitplanes import InputError, Laser, Pistol, Projectile, Rounds, Scene, Spread, Sprite, Sweep, fire, report_of
from hitplanes.weapons.explain.ray_margins import RAYS_MAX

NEAR = 1e-6
"""Shifts are tried to this part of a px short of a margin, and as far beyond."""

WIDTHS = (0, 0, 0, 0, 0.25, 0.5, 1, 1.4, 1.5, 2, 3, 4.5)


def some_battle(seed: int) -> Battle:
    rng = random.Random(seed)
    battle = ray_battles.some_battle(rng)
    return replace(battle, gun=replace(battle.gun, width=rng.choice(WIDTHS)))


def cut(ray: Ray, walked: Walk, r: int) -> Segment:
    """A ray up to its end."""
    part = Fraction(walked.stop.time) / walked.path.scale
    a, b = ([Fraction(v) for v in end] for end in ray[2:])
    return a, [p + part * (q - p) for p, q in zip(a, b, strict=True)], r


def segments(battle: Battle, which: int, walks: list[tuple[Ray, Walk]], endless: bool) -> list[Segment]:
    """Rays of a shot up to where they ended, or would have if no object had ended them."""
    r = ray_battles.snapped(battle.gun.width / 2)
    if not endless:
        return [cut(ray, walked, r) for ray, walked in walks]
    items, inside = battle.accepted(battle.shots[which]), battle.gun.inside
    return [
        cut(ray, oracle_rays.walk(ray[2], ray[3], r, items, bounds=battle.bounds, inside=inside), r) for ray, _ in walks
    ]


def check(battle: Battle) -> dict[str, int]:
    """Hold all margins of a battle against shifts that are tried, and count what came up."""
    counts = dict.fromkeys(("left", "touched", "zero", "fragile", "none", "ignored"), 0)
    try:
        walks = battle.walks()
    except StartsInside:
        return counts
    hits = battle.fired()
    for which, shot in enumerate(battle.shots):
        told = {margin.object: margin for margin in hits.margins(which)}
        assert list(told) == sorted(told)
        known = {item.id for item in battle.accepted(shot) if not item.occluder}
        assert set(told) <= known
        for item in battle.accepted(shot):
            if item.occluder:
                continue
            hit = any(one.object == item.id for _, walked in walks[which] for one in walked.passes)
            pixels = [p for p in item.pixels if not oracle_rays.outside(p, battle.bounds)]
            ways = segments(battle, which, walks[which], hit)
            starts = [(a, a, r) for a, _, r in ways]
            if battle.gun.inside == "ignore_until_exit" and any(
                oracle_margins.touches(start, p) for start in starts for p in item.pixels
            ):
                assert item.id not in told
                counts["ignored"] += 1
                continue
            margin = told.get(item.id)
            reach = 8.0 if margin is None else margin.distance - NEAR
            slack = NEAR / 100 if hit else -NEAR / 100
            if reach > 0:
                tried = oracle_margins.disc_grid(reach)
                touched = oracle_margins.touched_at(ways, pixels, tried, slack)
                assert (touched == hit).all(), (which, item.id, margin, tried[touched != hit][:3])
            if margin is None:
                counts["none"] += 1
                continue
            assert (margin.shot, margin.hit) == (which, hit)
            assert math.isclose(margin.distance, math.hypot(*margin.shift_xy), rel_tol=1e-12, abs_tol=1e-300)
            around = np.array(margin.shift_xy) + np.concatenate([oracle_margins.disc_grid(k * NEAR) for k in (1, 100)])
            touched = oracle_margins.touched_at(ways, pixels, around, -slack / 1000)
            assert (touched != hit).any(), (which, item.id, margin)
            if not hit:
                still = any(oracle_margins.touches(way, p) for way in ways for p in pixels)
                assert (margin.distance == 0) == still, (which, item.id, margin)
            counts["left" if hit else "touched"] += 1
            counts["zero"] += margin.distance == 0
            counts["fragile"] += margin.fragile
    return counts


@pytest.mark.parametrize("first", some_of(range(0, 30, 10), 2))
def test_margins_against_shifts_that_are_tried(first: int) -> None:
    counts = [check(some_battle(seed)) for seed in range(first, first + 10)]
    total = {name: sum(count[name] for count in counts) for name in counts[0]}
    assert min(total["left"], total["touched"], total["none"], total["fragile"]) >= 3, total


@pytest.mark.long
@pytest.mark.parametrize("first", range(30, 1030, 100))
def test_margins_against_more_shifts(first: int) -> None:
    for seed in range(first, first + 100):
        check(some_battle(seed))


# Small pictures


def world(*bodies: tuple[tuple[int, int], tuple[int, int]], role: str = "hittable") -> Scene:
    """Boxes of pixels, from one to another."""
    scene = Scene()
    for (x, y), (x_last, y_last) in bodies:
        mask = np.ones((y_last - y + 1, x_last - x + 1), np.bool_)
        scene.add(Sprite.from_mask(mask, pivot_xy=(0, 0)), (x, y), role=role)
    return scene


def wall(scene: Scene, x: int, y: int, x_last: int, y_last: int) -> Scene:
    mask = np.ones((y_last - y + 1, x_last - x + 1), np.bool_)
    scene.add(Sprite.from_mask(mask, pivot_xy=(0, 0)), (x, y), role="occluder", layer=1)
    return scene


TARGET = ((10, -1), (12, 1))

PICTURES = {
    "sideways": (world(TARGET), Laser(30), (0, 0), [(0, True, 1.5, (0, -1.5))]),
    "out of the middle": (world(TARGET), Laser(30), (0, 0.25), [(0, True, 1.25, (0, 1.25))]),
    "a pistol's ray goes on": (world(TARGET), Pistol(30), (0, 0), [(0, True, 1.5, (0, -1.5))]),
    "its range is short": (world(TARGET), Pistol(10), (0, 0), [(0, True, 0.5, (-0.5, 0))]),
    "it ends at the wall": (wall(world(((10, -9), (12, 9))), 13, -9, 13, 9), Pistol(30), (0, 0),
                            [(0, True, 3.0, (-3, 0))]),
    "along an edge": (world(TARGET), Laser(30), (0, 1.5), [(0, True, 0.0, (0, 0))]),
    "along a seam": (world(((10, 0), (14, 1))), Laser(30), (0, 0.5), [(0, True, 1.0, (0, -1))]),
    "along the seam of two steps": (world(((10, 0), (12, 0)), ((12, 1), (14, 1))), Laser(30), (0, 0.5),
                                    [(0, True, 0.0, (0, 0)), (1, True, 0.0, (0, 0))]),
    "thick": (world(TARGET), Laser(30, width=3), (0, 0), [(0, True, 2.5, (0, -2.5))]),
    "hardly thick": (world(TARGET), Laser(30, width=0.5), (0, 0), [(0, True, 1.5, (0, -1.5))]),
    "missed": (world(((10, 4), (12, 5))), Laser(30), (0, 0), [(0, False, 3.5, (0, 3.5))]),
    "missed by what is thick": (world(((10, 4), (12, 5))), Laser(30, width=3), (0, 0), [(0, False, 2.5, (0, 2.5))]),
    "missed by little": (world(((10, 1), (12, 5))), Laser(30), (0, 127 / 256), [(0, False, 1 / 256, (0, 1 / 256))]),
    "short of it": (world(((12, 3), (13, 4))), Laser(8.5), (0, 0), [(0, False, math.sqrt(3**2 + 2.5**2), (3, 2.5))]),
    "8 px": (world(((10, 8), (12, 9))), Laser(30), (0, -0.5), [(0, False, 8.0, (0, 8))]),
    "more": (world(((10, 8), (12, 9))), Laser(30), (0, -129 / 256), []),
    "behind a wall": (wall(world(((14, 0), (15, 0))), 10, -1, 11, 1), Laser(30), (0, 0), [(0, False, 4.0, (4, 0))]),
    "on the wall": (wall(world(((10, 0), (11, 0))), 10, -1, 11, 1), Laser(30), (0, 0), [(0, False, 0.0, (0, 0))]),
    "from inside": (world(((-2, -2), (2, 2))), Laser(30), (0, 0), [(0, True, 2.5, (0, -2.5))]),
    "from inside, ahead": (world(((-9, -9), (2, 9))), Laser(30), (0, 0), [(0, True, 2.5, (2.5, 0))]),
    "ignored": (world(((-2, -2), (2, 2))), Laser(30, inside="ignore_until_exit"), (0, 0), []),
    "through a gap of a px": (world(((10, -1), (12, 0)), ((10, 2), (12, 3))), Laser(30), (0, 1),
                              [(0, False, 0.5, (0, -0.5)), (1, False, 0.5, (0, 0.5))]),
}  # fmt: skip


@pytest.mark.parametrize("name", PICTURES)
def test_small_pictures(name: str) -> None:
    scene, weapon, at, expected = PICTURES[name]
    assert fire(scene, weapon, at, aim=0).margins() == [(0, *one) for one in expected]


def test_a_gap_in_an_object_is_a_way_out() -> None:
    """Of two bars with one empty row between: into the gap, which holds a thin ray, and not one that is wider."""
    scene = Scene()
    item = scene.add(Sprite.from_mask(np.array([[1], [1], [0], [1], [1]], np.bool_), pivot_xy=(0, 0)), (10, 0))
    assert fire(scene, Laser(30), (0, 1.25), aim=0).margins() == [(0, item, True, 0.25, (0, 0.25))]
    assert fire(scene, Laser(30, width=2), (0, 1.25), aim=0).margins() == [(0, item, True, 2.25, (0, -2.25))]


def test_between_two_rims() -> None:
    """The round end of a thick ray leaves two pixels at once where their rims cross; each alone were left sooner."""
    scene = Scene()
    item = scene.add(Sprite.from_mask(np.array([[1], [0], [1]], np.bool_), pivot_xy=(0, 0)), (10, -1))
    (margin,) = fire(scene, Laser(9, width=4), (0, 0), aim=0).margins()
    assert margin[:3] == (0, item, True) and margin.distance == pytest.approx(math.sqrt(3) - 1)
    assert margin.shift_xy == pytest.approx((1 - math.sqrt(3), 0))


def test_between_two_rims_that_touch() -> None:
    """The way out begins where two discs touch from outside: nothing is so near a gap that it is none."""
    assert check(some_battle(1079))["left"] >= 2


@pytest.mark.parametrize("up", [True, False])
def test_what_lies_at_the_end_of_a_ray_is_left_sideways_or_back(up: bool) -> None:
    """Six rows are passed through, eight lie at its end: out by the corner between them."""
    mask = np.zeros((8, 30), np.bool_)
    mask[2:, :6] = mask[:, 23:26] = True
    scene = Scene()
    item = scene.add(Sprite.from_mask(mask if up else mask[::-1], pivot_xy=(0, 0)), (15, -2 if up else -4))
    (margin,) = fire(scene, Laser(40), (0, 0.5), aim=0).margins()
    side = -1 if up else 1
    assert margin[:3] == (0, item, True) and margin.shift_xy == (-2.5, float(side))


@pytest.mark.parametrize("beyond", [0, 1])
@pytest.mark.parametrize("step", [(2**26 + 1, 2**25 + 5), (2**20 + 7, 2**27 - 1)])
def test_the_rim_of_a_long_thick_ray(step: tuple[int, int], beyond: int) -> None:
    """A centre lies just within the rim, or just beyond it: by less than floats of that size tell, and never by 0."""
    (dx, dy), r = step, 700
    length2 = dx * dx + dy * dy
    cross = math.isqrt(r * r * length2) + beyond
    p = pow(dy, -1, dx) * cross % dx
    q = (p * dy - cross) // dx
    pixel = round(p / 256), round(q / 256)
    a = 256 * pixel[0] - p, 256 * pixel[1] - q
    scene = Scene()
    item = scene.add(Sprite.from_mask(np.ones((1, 1), np.bool_), pivot_xy=(0, 0)), pixel)
    toward = ((a[0] + dx) / 256, (a[1] + dy) / 256)
    (margin,) = fire(scene, Laser(None, width=2 * r / 256), (a[0] / 256, a[1] / 256), toward=toward).margins()
    exactly = abs(Fraction(r * r * length2 - cross * cross)) / (2 * r * length2) / 256  # to the first order
    assert (margin.object, margin.hit) == (item, not beyond) and margin.distance > 0
    assert margin.distance == pytest.approx(float(exactly), rel=1e-6 if not beyond else 1e-3)


def test_pellets_move_together() -> None:
    """One leaves where another comes in: all have to be out at once."""
    scene = world(((10, 0), (10, 0)))
    laser = Sweep(Laser(40), 0, 2)
    assert fire(scene, laser, (0, 0), aim=0).margins() == [(0, 0, True, 0.5, (0, -0.5))]
    burst = Rounds(Laser(40), 2, recoil_xy=(0, 0.75))
    assert fire(scene, burst, (0, 0), aim=0).margins() == [(0, 0, True, 0.5, (0, 0.5))]
    assert fire(scene, Rounds(Laser(40), 2, recoil_xy=(0, 2)), (0, -0.25), aim=0).margins() == [
        (0, 0, True, 0.25, (0, -0.25))
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
    battle = some_battle(1000 + seed)
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


def test_steps_and_very_many_rays_have_no_margins() -> None:
    """They say so; a report of theirs tells none."""
    scene = world(TARGET)
    stepped = fire(scene, Projectile(30, 1, steps=3), (0, 0), aim=0)
    with pytest.raises(InputError, match="hits: expected those of a ray or of a projectile without steps, got steps=3"):
        stepped.margins()
    crowd = fire(scene, Spread(Pistol(30), RAYS_MAX + 1, 9), (0, 0), aim=0)
    with pytest.raises(InputError, match=r"shot: expected one of at most 1024 rays, got 1025"):
        crowd.margins()
    for hits in (stepped, crowd):
        assert not hits.has_margins
        (told,) = report_of(scene, [hits])["shots"]
        assert not any("margin" in entry for entry in [*told["rows"], *told["why_not"]])


def test_margins_of_an_old_answer_are_refused() -> None:
    scene = world(TARGET)
    hits = fire(scene, Laser(30), np.zeros((0, 2)), aim=[])
    assert hits.margins() == []
    scene.add(Sprite.box(1, 1), (3, 3))
    with pytest.raises(InputError, match="read this before the scene changes"):
        hits.margins()


@pytest.mark.parametrize("side", [-1, 0, 1])
@pytest.mark.parametrize("pixel", [(2**17, 2**16), (2**18 - 5, 3), (1001, 2**18)])
def test_long_rays_touch_or_do_not(pixel: tuple[int, int], side: int) -> None:
    """A corner lies beside a long ray by one part of (1/256 px)^2 over its length: 0 is told only of what touches."""
    scene = Scene()
    item = scene.add(Sprite.from_mask(np.ones((3, 3), np.bool_), pivot_xy=(0, 0)), pixel)
    a = next(
        (i, j) for i in range(9) for j in range(9) if math.gcd(256 * pixel[0] + 640 - i, 256 * pixel[1] - 128 - j) == 1
    )
    p, q = 256 * pixel[0] + 640 - a[0], 256 * pixel[1] - 128 - a[1]  # to the upper right corner
    dx = pow(q, -1, p) * -side % p  # so that p * dy - q * dx = side
    dy = (side + q * dx) // p
    dx, dy = dx + p, dy + q
    assert p * dy - q * dx == side
    hits = fire(scene, Laser(None), (a[0] / 256, a[1] / 256), toward=((a[0] + dx) / 256, (a[1] + dy) / 256))
    (margin,) = hits.margins()
    assert (margin.object, margin.hit) == (item, side >= 0)
    assert margin.distance == pytest.approx(abs(side) / math.hypot(dx, dy) / 256, rel=1e-12, abs=0)


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
