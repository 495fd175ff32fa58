"""Rays that are cast at items: the first that each touches, the way that is chosen, and the same hits as by walking."""

from __future__ import annotations

import random
from types import ModuleType
from typing import Any

import numpy as np
import oracle_rays
import pytest
from examples import examples
from hypothesis import HealthCheck, given, note
from hypothesis import strategies as st
from test_march import answer, single, some_ray
from test_rays import check_columns

from hitplanes import Laser, Pistol, Projectile, Rifle, Rounds, Scene, Spread, Sweep, Weapon, fire, prepare
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.scene.derived import EVERYTHING, View
from hitplanes.planes.scene.items import Stack
from hitplanes.weapons.kinds.placements import filter_of
from hitplanes.weapons.rays import one_ray, ray_call, raycast

worlds = st.randoms(use_true_random=False)
Bounds = tuple[int, int, int, int]


@pytest.fixture(params=["alone", "together"])
def kernels(jit: bool, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The kernels, for any number of rays those of a few or of many; and their compiled twins."""
    if jit and request.param == "alone":
        pytest.skip("a compiled kernel follows any number of rays")
    monkeypatch.setattr(raycast, "are_few", lambda *_: request.param == "alone")
    return kernels_of(raycast)


def some_stack(rng: random.Random) -> Stack:
    """Items that overlap, some of them empty or with holes, some occluders, of three categories and owners."""
    scene = Scene(None, categories=["a", "b"])
    for number in range(rng.choice([0, 1, 3, 12])):
        h, w, chance = rng.randint(1, 6), rng.randint(1, 6), rng.choice([0.2, 0.6, 1.0])
        mask = np.array([[rng.random() < chance for _ in range(w)] for _ in range(h)])
        role = rng.choice(["hittable", "hittable", "occluder"])
        where = rng.randint(-7, 7), rng.randint(-7, 7)
        scene.add(
            mask,
            where,
            role=role,
            layer=rng.randint(0, 1),
            categories=rng.randint(0, 3),
            owner=rng.randint(0, min(number, 2)),
        )
    return scene.items.stack()


@examples(40, deadline=None)
@given(worlds, st.sampled_from([None, 1, 2]), st.sampled_from([0, 128, 700]))
def test_rays_that_pass_too_many_rows_are_cast_together(rng: random.Random, most: int | None, radius: int) -> None:
    """All rays of a call, some of them or none: the rows and ends are those of a cast of all."""
    stack, n = some_stack(rng), 16
    start, step = (np.array([[rng.randint(-2500, 2500) for _ in range(2)] for _ in range(n)]) for _ in range(2))
    filters = None
    if rng.random() < 0.5:
        filters = np.array([filter_of(rng.randint(0, 3), 3) for _ in range(n)]), np.full((n, 1), rng.randint(-1, 2))
    call = stack, None, Lines(start, step, radius), most, filters
    hits, ends = raycast.cast_together(*call)
    for rows_most in (0, 2, 4, 6, 9, 999):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(one_ray, "ROWS_MOST", rows_most)
            found = one_ray.follow_each(*call)
        assert np.array_equal(found[0], hits) and np.array_equal(found[1], ends), rows_most


First = tuple[int, int, int, int]
NOTHING = -1, 0, 0, -1
"""Time, cell, and rank of what a ray touches first."""


def first_touched(
    kernels: ModuleType,
    stack: Stack,
    bounds: Bounds | None,
    rays: list[tuple[tuple[int, int], tuple[int, int]]],
    meets: list[int] | None = None,
    exclude: list[list[int]] | None = None,
) -> list[First]:
    """The ends of rays that end at their first hit, in one batch; each alone ends there, too."""
    start, step = (np.array(column) for column in zip(*rays, strict=True))
    filters = None if meets is None or exclude is None else (np.array(meets), np.array(exclude))
    _, (reason, time, y, x, rank, _) = kernels.hits_and_ends(stack, bounds, Lines(start, step, 0), 1, filters)
    x, y = x + pixel(start)[:, 0], y + pixel(start)[:, 1]
    columns = (np.where(reason, column, gone) for column, gone in zip((time, x, y, rank), NOTHING, strict=True))
    found: list[First] = list(zip(*(column.tolist() for column in columns), strict=True))
    for k, (at, by) in enumerate(rays):
        view = View(False, EVERYTHING, ())
        if meets is not None and exclude is not None:
            view = View(False, meets[k], tuple(sorted({*exclude[k]} - {-1})))
        elif stack.has_unmet:
            continue
        seen = stack, bounds, view, 0, 1
        followed = kernels_of(one_ray).follower(*seen)(*at, *by) or one_ray.follow_in_arrays(*at, *by, *seen)
        objects = [] if found[k][3] < 0 or stack.occluder[found[k][3]] else [found[k]]
        assert [(entry, x, y, rank) for rank, _, x, y, entry in followed[1]] == objects
        assert found[k] == NOTHING or followed[0] == found[k][0]
    return found


def first_by_the_oracle(
    stack: Stack,
    bounds: Bounds | None,
    at: tuple[int, int],
    by: tuple[int, int],
    bits: tuple[int, int] | None,
    exclude: list[int],
) -> First:
    """Of all cells of a ray the first with an accepted item, one by one."""
    cells, _ = oracle_rays.thin_times(at, (at[0] + by[0], at[1] + by[1]))
    found = []
    for (x, y), (time, _) in cells.items():
        if bounds is not None and not (bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]):
            continue
        there = []
        for rank in range(len(stack)):
            left, top, right, low = stack.box_xyxy[rank].tolist()
            if left <= x <= right and top <= y <= low and stack.mask(rank)[y - top, x - left]:
                there.append(rank)
        if bits is not None:
            blocks = [bool(stack.categories[k] >> 32 & bits[1]) for k in there]
            met = [
                b if stack.occluder[k] else stack.categories[k] & bits[0] for k, b in zip(there, blocks, strict=True)
            ]
            there = [k for k, some in zip(there, met, strict=True) if some and stack.owner[k] not in exclude]
        if there:
            found.append((time, not any(stack.occluder[k] for k in there), y, x, there[0]))
    if not found:
        return NOTHING
    time, _, y, x, rank = min(found)
    return time, x, y, rank


@examples(150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds)
def test_what_a_ray_touches_first_is_what_the_oracle_meets_first(kernels: ModuleType, rng: random.Random) -> None:
    stack, bounds = some_stack(rng), rng.choice([None, (-4, -3, 5, 6), (2, 2, 2, 2), (-30, -30, 30, 30)])
    rays = [some_ray(rng, 3, 3) for _ in range(rng.choice([1, 6]))]
    bits = [(rng.choice([1, 2, 3]), rng.choice([0, 1, 2, 3])) for _ in rays]
    meets = [filter_of(*two) for two in bits]
    exclude = [[rng.choice([-1, 1, 2]) for _ in range(2)] for _ in rays]
    note(f"{bounds} {stack.box_xyxy.tolist()} {rays} {bits} {exclude}")
    found = first_touched(kernels, stack, bounds, rays, meets, exclude)
    every = first_touched(kernels, stack, bounds, rays)
    for k, (at, by) in enumerate(rays):
        assert found[k] == first_by_the_oracle(stack, bounds, at, by, bits[k], exclude[k])
        assert every[k] == first_by_the_oracle(stack, bounds, at, by, None, [])


CORNERS: dict[str, tuple[list[tuple[tuple[int, int], str, int]], int]] = {
    "both sides, the upper one first": ([((0, 1), "hittable", 0), ((1, 0), "hittable", 0)], 1),
    "an occluder at the lower side": ([((1, 0), "hittable", 0), ((0, 1), "occluder", 0)], 1),
    "an occluder under the object at the lower side": (
        [((1, 0), "hittable", 0), ((0, 1), "hittable", 2), ((0, 1), "occluder", 0)], 1),
    "an object under another is no occluder": (
        [((1, 0), "hittable", 0), ((0, 1), "hittable", 2), ((0, 1), "hittable", 0)], 0),
    "only the one that is passed by": ([((0, 1), "hittable", 0)], 0),
    "a side, and behind it the diagonal": ([((1, 0), "hittable", 0), ((1, 1), "occluder", 0)], 1),
}  # fmt: skip


@pytest.mark.parametrize("name", CORNERS)
@pytest.mark.parametrize("start", [(0, 0), (128, 128), (-768, -768)], ids=["inside", "on the corner", "before"])
def test_what_is_entered_at_once(kernels: ModuleType, name: str, start: tuple[int, int]) -> None:
    pixels, expected = CORNERS[name]
    scene = Scene(None)
    for xy, role, layer in pixels:
        scene.add(np.ones((1, 1), np.bool_), xy, role=role, layer=layer)
    stack = scene.items.stack()
    ((time, _, _, rank),) = first_touched(kernels, stack, None, [(start, (1536, 1536))])
    assert stack.ids[rank] == expected and time == max(0, 128 - start[0]) * 1536


@pytest.mark.parametrize("forth", [True, False])
@pytest.mark.parametrize("level", [True, False])
def test_a_ray_along_a_border_touches_the_nearer_of_both_rows(kernels: ModuleType, level: bool, forth: bool) -> None:
    """One object has a far pixel in the first row and a near one in the second."""
    mask = np.zeros((2, 9), np.bool_)
    mask[0, 6 if forth else 2], mask[1, 3 if forth else 5] = True, True
    scene = Scene(None)
    scene.add(mask if level else mask.T, (0, 0))
    stack = scene.items.stack()
    left, top = stack.box_xyxy[0, :2].tolist()
    along, step = 256 * (-20 if forth else 20), 256 * 40 * (1 if forth else -1)
    at, by = ((along, 128), (step, 0)) if level else ((128, along), (0, step))
    ((_, x, y, _),) = first_touched(kernels, stack, None, [((at[0] + 256 * left, at[1] + 256 * top), by)])
    assert (x - left, y - top) == ((0 if forth else 3, 1) if level else (1, 0 if forth else 3))


def test_rays_from_anywhere(kernels: ModuleType) -> None:
    """From as far off as a position may be, with the longest steps that can be followed, and longer ones."""
    far, ones = 2**39, np.ones((40, 40), np.bool_)
    scene = Scene(None)
    for sign in (1, -1):
        scene.add(ones, (sign * far, -sign * far))
    stack, half = scene.items.stack(), 2**29
    rays = [
        ((256 * (far - 2_000_000), 256 * -far), (half, 1)),
        ((256 * -far, 256 * (far + 2_000_000)), (-7, -half)),
        ((256 * (far - 1_500_000), 256 * (1_500_000 - far)), (half, -half)),
    ]
    found = first_touched(kernels, stack, None, rays)
    assert found == [first_by_fractions(stack, *ray) for ray in rays] and all(one[3] >= 0 for one in found)
    (x, y), _ = rays[0]
    longer = (x - 256 * 3, y), (half + 256 * 3, 1)
    if kernels is raycast:
        assert first_touched(kernels, stack, None, [longer]) == [first_by_fractions(stack, *longer)]
    else:
        lines = Lines(np.array([longer[0]]), np.array([longer[1]]), 0)
        assert kernels.hits_and_ends(stack, None, lines, 1) is None


def first_by_fractions(stack: Stack, at: tuple[int, int], by: tuple[int, int]) -> First:
    """The first cell of the solid boxes of a stack that a long ray touches: only cells of their borders may be."""
    scale, found = max(abs(by[0]), 1) * max(abs(by[1]), 1), []
    for rank in range(len(stack)):
        left, top, right, low = stack.box_xyxy[rank].tolist()
        for x in range(left, right + 1):
            for y in range(top, low + 1):
                entry, leave = 0, scale
                for v, begin, step, across in ((x, at[0], by[0], abs(by[1])), (y, at[1], by[1], abs(by[0]))):
                    sides = sorted(
                        ((256 * v + half - begin) * (1 if step > 0 else -1) * across) for half in (-128, 128)
                    )
                    entry, leave = max(entry, sides[0]), min(leave, sides[1])
                if entry <= leave:
                    found.append((entry, y, x, rank))
    time, y, x, rank = min(found)
    return time, x, y, rank


@pytest.mark.parametrize("way", ["cast", "march", "ready", "ready, marching"])
@pytest.mark.parametrize("accept", [1, 2, 3])
@pytest.mark.parametrize("exclude", [None, 0, 1, [0, 1], [0, 2]], ids=repr)
def test_a_ray_goes_through_what_it_refuses(kernels: ModuleType, way: str, accept: int, exclude: object) -> None:
    """Of four objects in a row it hits the first of a category that it accepts, of an owner that is not excluded."""
    scene, out = Scene((99, 9), categories=["other"]), np.atleast_1d(-1 if exclude is None else exclude)
    for k in range(4):
        scene.add(np.ones((3, 3), np.bool_), (20 + 20 * k, 4), categories=1 + k % 2)
    if way.endswith("marching"):
        fire(scene, Pistol(90), (2, 4), strategy="march")  # the distance field is there
    if way.startswith("ready"):
        hits = prepare(scene, Pistol(90), accept=accept, exclude=exclude).fire((2, 4))
    else:
        hits = fire(scene, Pistol(90), (2, 4), accept=accept, exclude=exclude, strategy=way)
    assert hits.object.tolist() == [k for k in range(4) if accept & 1 + k % 2 and k not in out][:1]


@pytest.mark.parametrize("aim", [0.0, 90.0, 30.0])
def test_many_boxes_that_are_entered_and_not_touched(kernels: ModuleType, aim: float) -> None:
    """The object behind them is found; in numpy a ray alone is left to a batch of one, as it would take long."""
    scene, frame = Scene(None), np.ones((41, 41), np.bool_)
    frame[1:-1, 1:-1] = False
    turn = np.array([np.cos(np.radians(aim)), np.sin(np.radians(aim))])
    for far in range(300):
        scene.add(frame, np.rint(turn * 3 * far), categories=2)
    behind = scene.add(np.ones((3, 3), np.bool_), np.rint(turn * 1000))
    for accept, first in ((1, behind), (3, None)):
        hits = fire(scene, Pistol(2000), (0, 0), aim=aim, accept=accept, strategy="cast")
        assert hits == fire(scene, Pistol(2000), (0, 0), aim=aim, accept=accept, prefilter="box")
        assert len(hits) == 1 and (first is None or hits.object[0] == first)
    hollow, corners = Scene(None), np.zeros((41, 41), np.bool_)
    corners[0, 0] = corners[40, 40] = True
    for far in range(300):
        hollow.add(corners, (3 * far, 10))
    last = hollow.add(np.ones((99, 3), np.bool_), (1000, 10))
    hits = fire(hollow, Pistol(2000), (-5, 10), strategy="cast")
    assert hits == fire(hollow, Pistol(2000), (-5, 10), prefilter="box") and hits.object.tolist() == [last]
    assert hits.plan.has_run("cast") and not hits.plan.has_run("walk")
    assert prepare(hollow, Pistol(2000)).fire((-5, 10)) == hits
    sooner = hollow.add(np.ones((99, 3), np.bool_), (50, 10))  # some twenty boxes are entered before
    assert fire(hollow, Pistol(2000), (-5, 10), strategy="cast").object.tolist() == [sooner]


def test_a_true_byte_may_be_any(kernels: ModuleType) -> None:
    scene = Scene((99, 99))
    scene.add(np.full((6, 6), 254, np.uint8).view(np.bool_), (50, 50))
    for how in ({}, {"prefilter": "box"}, {"strategy": "march"}, {"strategy": "cast"}):
        assert len(fire(scene, Pistol(90), (2.0, 50.0), **how)) == 1
    assert len(prepare(scene, Pistol(90)).fire((2.0, 50.0))) == 1


# Fired


@examples(60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rng=worlds, count=st.integers(1, 4))
def test_rays_that_are_cast_hit_what_rays_that_walk_hit(kernels: ModuleType, rng: random.Random, count: int) -> None:
    battle = single(rng, count)
    note(repr(battle))
    cast = answer(battle, "cast")
    assert cast == answer(battle, "walk")
    if not isinstance(cast, str):
        check_columns(cast, battle.walks(), battle.gun.falloff)


SEVERAL: list[Weapon] = [
    Pistol(90), Sweep(Pistol(90), 40, 5), Spread(Pistol(90, falloff="linear"), 6, 9),
    Rounds(Pistol(90), 3, (1.5, 2), 4), Rounds(Spread(Rifle(70, max_hits=1), 3, 5), 2, (0, 3), 10),
]  # fmt: skip


@pytest.mark.parametrize("weapon", SEVERAL, ids=repr)
def test_all_weapons_that_end_at_their_first_hit_are_cast(
    kernels: ModuleType, weapon: Weapon, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    scene, at = Scene((100, 100)), rng.uniform(0, 100, (40, 2))
    for k in range(30):
        scene.add(rng.random((8, 8)) < 0.8, rng.uniform(0, 100, 2), role="occluder" if k % 5 == 0 else "hittable")
    walked = fire(scene, weapon, at, aim=30, prefilter="box")
    monkeypatch.setattr(ray_call, "trace", lambda *_: pytest.fail("walked"))
    cast = fire(scene, weapon, at, aim=30, strategy="cast")
    assert cast == walked and len(cast) > 20
    stages = {stage.name for stage in cast.plan.ran}, {stage.name for stage in cast.plan.left_out}
    assert "cast" in stages[0] and {"walk", "pre-filter", "broad phase", "march", "stops"} <= stages[1]


def test_threads_share_rays_out(jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not jit:
        pytest.skip("only compiled kernels do")
    from hitplanes.planes.jit import bit_rows

    kernels = kernels_of(raycast)
    rng = np.random.default_rng(6)
    scene = Scene((200, 200))
    for _ in range(50):
        scene.add(rng.random((9, 9)) < 0.7, rng.uniform(0, 200, 2), categories=int(rng.integers(1, 4)))
    lines = Lines(rng.integers(0, 51200, (90, 2)), rng.integers(-51200, 51200, (90, 2)), 0)
    how = scene.items.stack(), scene.bounds, lines, 1, (rng.integers(1, 4, 90), np.full((90, 1), -1))
    alone = kernels.hits_and_ends(*how)
    parts: list[Any] = []

    def shared(count: int, _: float, work: Any) -> Any:
        parts.append(count)
        return [work(0, 31), work(31, 90)]

    monkeypatch.setattr(bit_rows, "in_parts", shared)
    again = kernels.hits_and_ends(*how)
    assert parts == [90] and all((a == b).all() for a, b in zip(alone, again, strict=True))


def test_rays_are_cast_where_they_can_be(kernels: ModuleType) -> None:
    """Any number of them, of all weapons but those that need each cell, unless a pre-filter is asked for."""
    scene, rng = Scene(None), np.random.default_rng(7)
    for _ in range(100):
        scene.add(np.ones((48, 48), np.bool_), rng.uniform(0, (1920, 1080)))

    def is_cast(rays: int, weapon: Weapon, **how: Any) -> bool:
        plan = fire(scene, weapon, rng.uniform(0, 1000, (rays, 2)), aim=rng.uniform(0, 360, rays), **how).plan
        assert plan.has_run("walk") != plan.has_run("cast")
        return plan.has_run("cast")

    several = Sweep(Rifle(300, max_hits=2), 30, 4)
    for weapon in (Pistol(1000), Laser(900, width=4), Rifle(900, budget=3), Projectile(200, 3), several):
        assert is_cast(1, weapon) and is_cast(3, weapon) and is_cast(300, weapon)
        assert not is_cast(2, weapon, prefilter="box") and not is_cast(2, weapon, strategy="direct")
    for weapon in (Laser(90, inside="ignore_until_exit"), Projectile(90, 3, steps=2)):
        assert not is_cast(2, weapon, strategy="cast")
    hits = fire(scene, Pistol(90, inside="ignore_until_exit"), [(-500, 3), (-500, 9)])
    assert hits.plan.has_run("cast") and not hits.plan.has_run("walk")
    scene.set(scene.ids(), velocity_xy=(1, 0))
    assert not is_cast(2, Projectile(200, 3)) and is_cast(2, Laser(200))
