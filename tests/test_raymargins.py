"""Margins of rays: against shifts tried one by one, and laws."""

import math
import random
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


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_margins_against_shifts_that_are_tried(first: int) -> None:
    counts = [check(some_battle(seed)) for seed in range(first, first + 20)]
    total = {name: sum(count[name] for count in counts) for name in counts[0]}
    assert min(total["left"], total["touched"], total["none"], total["fragile"]) >= 5, total
