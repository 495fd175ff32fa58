"""Projectiles against a slow exact reference: swept and tested in steps, at targets that stand still and that move.

Times of swept discs are whole numbers over |d|^2, rounded inward, where d is the displacement relative to the target,
and over 2**60 where things move. So a time is at most 1 / |d|^2 late (below 1e-9 from 124 px a frame on), and which of
two things comes first is not asserted where they are nearer than that, unless both are met at exactly the same time by
the same d. Whether anything is met at all is exact. In steps a test that lies so close to the begin or the end of a
touch may tell otherwise: those shots are left out by the reference's `doubtful`, and counted.
"""

from collections.abc import Sequence
from fractions import Fraction
from importlib.util import find_spec

import numpy as np
import pytest
from oracle_projectile import Thing, Vector, doubtful, flight, impacts, last_miss
from some_of import in_turn

from hitplanes import InputError, Projectile, RayHits, Reason, Scene, fire, use_jit

SUB = 256
ONE = np.ones((1, 1), np.bool_)
SPEEDS = (0, 0.5, 3, 17, 80.25, 1000, 10**6)
RADII = (0, 0.3, 0.62, 1, 3.7, 12)
AHEAD = ((1, 0), (0, -1), (-1, 0), (0, 1), (1, 1), (-1, 1), (3, 4), (-4, 3))


def scene_of(things: Sequence[Thing], refused: Sequence[Thing] = (), shift: Vector = (0, 0)) -> Scene:
    """A scene in which the id of each thing is its place in the list; those refused have another category."""
    scene = Scene(categories=("ghost",))
    for thing in (*things, *refused):
        x, y = np.array(sorted(thing.pixels)).T
        mask = np.zeros((y.max() - y.min() + 1, x.max() - x.min() + 1), np.bool_)
        mask[y - y.min(), x - x.min()] = True
        height, width = mask.shape
        place = x.min() + shift[0] + (width - 1) / 2, y.min() + shift[1] + (height - 1) / 2
        scene.add(
            mask,
            place,
            role="occluder" if thing.occluder else "hittable",
            layer=thing.layer,
            velocity_xy=np.array(thing.velocity) / SUB,
            categories=2 if thing in refused else 1,
        )
    return scene


def things_of(rng: np.random.Generator, count: int, moving: bool) -> list[Thing]:
    """Small random masks near (0, 0); those that move often do so by whole pixels, or like another one."""
    velocities = [(0, 0), *(tuple(v) for v in rng.integers(-40, 41, (2, 2)) * SUB), tuple(rng.integers(-9999, 9999, 2))]
    things = []
    for number in range(count):
        corner, size = rng.integers(-14, 14, 2), rng.integers(1, 5, 2)
        grid = np.argwhere(rng.random(size) < 0.7) if size.max() > 1 else np.zeros((1, 2), np.int64)
        pixels = frozenset((int(x), int(y)) for x, y in grid + corner) or frozenset([(0, number)])
        vx, vy = velocities[rng.integers(len(velocities))] if moving else (0, 0)
        things.append(Thing(number, pixels, bool(rng.random() < 0.3), int(rng.integers(2)), (int(vx), int(vy))))
    return things


def shots_of(
    rng: np.random.Generator, count: int, speed: int, things: Sequence[Thing], along: Vector | None = None
) -> list[tuple[Vector, Vector]]:
    """Starts and points aimed at, 1/256 px: flights past a pixel of a thing; every other begins on half a pixel."""
    shots = []
    for number in range(count):
        ahead = AHEAD[rng.integers(len(AHEAD))] if number % 2 else tuple(rng.integers(-(2**30), 2**30, 2).tolist())
        ahead = along or ahead
        thing = things[rng.integers(len(things))]
        pixel = sorted(thing.pixels)[rng.integers(len(thing.pixels))]
        v, part = flight(speed, ahead), float(rng.uniform(-0.1, 1.1))
        aside = rng.integers(-10, 11, 2) * 128 if number % 2 else rng.integers(-2500, 2500, 2)
        start = [
            round(SUB * pixel[i] + int(aside[i]) - part * (v[i] - thing.velocity[i])) // (128 if number % 2 else 1)
            for i in (0, 1)
        ]
        a = (start[0] * 128, start[1] * 128) if number % 2 else (start[0], start[1])
        shots.append((a, (a[0] + ahead[0] * SUB, a[1] + ahead[1] * SUB)))
    return shots


def fired(scene: Scene, weapon: Projectile, shots: Sequence[tuple[Vector, Vector]], shift: Vector = (0, 0)) -> RayHits:
    at, toward = np.array(shots).reshape(-1, 2, 2).transpose(1, 0, 2) / SUB + shift
    hits = fire(scene, weapon, at, toward=toward, accept=1, blocked_by=1)
    assert isinstance(hits, RayHits)
    assert hits == fire(scene, weapon, at, toward=toward, accept=1, blocked_by=1, strategy="walk")
    if find_spec("numba"):
        use_jit()
        try:
            assert hits == fire(scene, weapon, at, toward=toward, accept=1, blocked_by=1)
        finally:
            use_jit(None)
    return hits


def late(d: Vector, radius: int) -> Fraction:
    """How late a time may be told: by what times are counted over."""
    counted = d[0] ** 2 + d[1] ** 2 if radius else max(abs(d[0]), 1) * max(abs(d[1]), 1)
    return max(Fraction(1, max(counted, 1)) + Fraction(1, 2**59), Fraction(1, 10**9))


def relative(v: Vector, thing: Thing) -> Vector:
    return v[0] - thing.velocity[0], v[1] - thing.velocity[1]


def agrees(hits: RayHits, i: int, a: Vector, v: Vector, radius: int, things: Sequence[Thing], steps: int | None) -> str:
    """Assert that shot i is what the reference says; which way it was compared."""
    touched = impacts(a, v, radius, things, steps)
    passes = np.flatnonzero(hits.passes.shot == i)
    reason = Reason(hits.stop.reason[i])
    assert (reason is Reason.RANGE) == (not touched), (a, v, radius, things, steps)
    if not touched:
        assert len(passes) == 0
        return "missed"
    time, thing, pixel = touched[0]
    told = Fraction(float(hits.stop.fraction[i]))
    slack = max(late(relative(v, thing), radius) for _, thing, _ in touched)
    assert abs(time - told) < Fraction(1, 10**12) if steps else time - Fraction(1, 10**12) <= told <= time + slack, (
        a,
        v,
        radius,
        things,
        steps,
    )
    here = [row for row in touched if row[0] - time <= 2 * slack]
    same = {(row[0] == time or steps is not None, relative(v, row[1])) for row in here}
    if steps is None and len(same) > 1 and not all(row[0] == 0 for row in here):
        assert hits.stop.item[i] in {row[1].id for row in here}
        return "close"
    assert reason is (Reason.OCCLUDER if thing.occluder else Reason.HITS), (a, v, radius, things, steps)
    assert hits.stop.item[i] == thing.id, (a, v, radius, things, steps)
    assert tuple(hits.stop.cell_xy[i]) == pixel, (a, v, radius, things, steps)
    assert hits.passes.object[passes].tolist() == ([] if thing.occluder else [thing.id])
    if not thing.occluder:
        assert tuple(hits.passes.entry_xy[passes[0]]) == pixel
        assert hits.passes.entry[passes[0]] == hits.stop.fraction[i]
    return "hit"


def compare(seed: int, moving: bool, scenes: int, steps: Sequence[int | None]) -> dict[str, int]:
    """Fire at random scenes; how many shots were compared which way."""
    told = dict.fromkeys(("missed", "hit", "close", "doubtful"), 0)
    for number in range(scenes):
        rng = np.random.default_rng((seed, number))
        things = things_of(rng, int(rng.integers(1, 6)), moving)
        scene = scene_of(things, things_of(rng, 2, moving))
        speed, radius, n = SPEEDS[number % 7], RADII[number % 6], steps[number % len(steps)]
        shots = shots_of(rng, 12, int(speed * SUB), things)
        weapon = Projectile(speed, radius, steps=n)
        hits = fired(scene, weapon, shots)
        for i, (a, toward) in enumerate(shots):
            v = flight(round(speed * SUB), (toward[0] - a[0], toward[1] - a[1]))
            if n and doubtful(a, v, round(radius * SUB), things, n):
                told["doubtful"] += 1
                continue
            told[agrees(hits, i, a, v, round(radius * SUB), things, n)] += 1
    return told


@pytest.mark.parametrize("moving", [False, True])
def test_a_swept_projectile_agrees_with_the_reference(moving: bool) -> None:
    told = compare(1, moving, 60, [None])
    assert told["hit"] > 250
    assert told["close"] <= (18 if moving else 0)


@pytest.mark.parametrize("moving", [False, True])
def test_a_projectile_in_steps_agrees_with_the_reference(moving: bool) -> None:
    told = compare(2, moving, 60, [1, 2, 7, 64])
    assert told["hit"] > 120
    assert told["close"] == 0
    assert told["doubtful"] < 12


@pytest.mark.long
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("steps", [None, 1, 2, 3, 10, 240], ids=str)
def test_many_projectiles_agree_with_the_reference(steps: int | None, moving: bool) -> None:
    told = compare(3, moving, 500, [steps])
    assert told["hit"] > 300


@pytest.mark.parametrize("radius", [0, 3])
def test_the_time_of_a_step_is_its_number_over_all(radius: float) -> None:
    scene = Scene((20, 5))
    scene.add(np.ones((5, 2), np.bool_), (12, 2))
    hits = fire(scene, Projectile(16, radius, steps=7), (2, 2))
    assert isinstance(hits, RayHits)
    k = np.rint(hits.stop.fraction * 7)
    assert hits.stop.fraction == pytest.approx(k / 7, abs=1e-9)


@pytest.mark.parametrize("velocity", [(0, 0), (5, 0)])
def test_a_disc_that_rests_on_a_thing_touches_it_at_every_step(velocity: Vector) -> None:
    scene = Scene()
    scene.add(ONE, velocity_xy=velocity)
    assert fire(scene, Projectile(velocity[0], 1, steps=4), (0, 0))


def test_between_its_centre_and_its_corner_a_pixel_is_not_touched() -> None:
    scene = Scene()
    scene.add(ONE)
    weapon = Projectile(870 / SUB, 158 / SUB, steps=2)
    start = (-302 / SUB, 257 / SUB)
    assert not fire(scene, weapon, start, toward=((832 - 302) / SUB, (257 - 256) / SUB))
    assert fire(scene, Projectile(870 / SUB, 158 / SUB), start, toward=((832 - 302) / SUB, (257 - 256) / SUB))


def test_what_a_projectile_in_steps_starts_in_can_be_ignored() -> None:
    scene = Scene()
    scene.add(np.ones((1, 9), np.bool_))
    assert not fire(scene, Projectile(2, 0.3, steps=4, inside="ignore_until_exit"), (0, 0))


def test_a_start_inside_is_a_hit_at_once_or_ignored_or_an_error() -> None:
    scene = Scene()
    scene.add(np.ones((1, 9), np.bool_))
    beyond = scene.add(ONE, (40, 0))
    assert fire(scene, Projectile(100, 2), (0, 0)).passes.entry.tolist() == [0]
    through = fire(scene, Projectile(100, 2, inside="ignore_until_exit"), (0, 0))
    assert through.passes.object.tolist() == [beyond]
    assert through.passes.entry.tolist() == [0.38]
    with pytest.raises(InputError, match=r"at\[0\]: expected a start outside of every item, got one inside of id 0, '"):
        fire(scene, Projectile(100, 2, inside="error"), (0, 0))
    assert len(fire(scene, Projectile(100, 2, inside="error"), (7, 0))) == 1


@pytest.mark.parametrize("velocity", [(0, 0), (-64, 32)])
def test_a_disc_that_does_not_fly_meets_what_is_there_or_comes(velocity: Vector) -> None:
    scene = Scene()
    scene.add(ONE, (10, 0), velocity_xy=velocity)
    beside, on = (4, 1), (10, 2)
    hits = fire(scene, Projectile(0, 2), [beside, on])
    assert hits.passes.shot.tolist() == ([0, 1] if velocity[0] else [1])
    assert hits.passes.entry[-1] == 0


@pytest.mark.parametrize("role", ["hittable", "occluder"])
def test_a_pixel_that_comes_from_above_is_entered_from_below(role: str) -> None:
    """A pixel alone has no slope. Seen from it the disc flies up, though it flies to the right and hardly up."""
    scene = Scene()
    scene.add(ONE, (500, 500), role=role)
    scene.add(ONE, (4, -40), role=role, velocity_xy=(0, 76))
    hits = fire(scene, Projectile(8, 1), [(0, 0), (499, 500)], aim=[-1, 0])
    assert hits.stop.item.tolist() == [1, 0]
    assert hits.stop.normal_xy.tolist() == [[0, 1], [-1, 0]]
    assert hits.passes.normal_xy.tolist() == ([[0, 1], [-1, 0]] if role == "hittable" else [])


@pytest.mark.parametrize("velocity", [(0, 0), (0, 256)])
def test_things_met_at_one_time_are_taken_in_order(velocity: Vector) -> None:
    """A disc of radius 2 flies down x = 0 between pixels at (-2, 9) and (2, 9)."""
    for left, right, first in (("hittable", "hittable", -2), ("hittable", "occluder", 2), ("occluder", "hittable", -2)):
        scene = Scene()
        scene.add(ONE, (-2, 9), role=left, velocity_xy=velocity)
        scene.add(ONE, (2, 9), role=right, velocity_xy=velocity)
        stop = fire(scene, Projectile(500, 2), (0, 0), aim=90).stop
        assert stop.cell_xy.tolist() == [[first, 9]]
        assert stop.fraction == pytest.approx(9 / (500 - velocity[1]))
    scene = Scene()
    below = scene.add(ONE, (0, 9), velocity_xy=velocity)
    assert fire(scene, Projectile(500, 2), (0, 0), aim=90).stop.item.tolist() == [below]
    scene.add(ONE, (0, 9), role="occluder", layer=-1, velocity_xy=velocity)
    assert fire(scene, Projectile(500, 2), (0, 0), aim=90).stop.item.tolist() == [below]
    scene.set(1, layer=0)
    assert fire(scene, Projectile(500, 2), (0, 0), aim=90).stop.item.tolist() == [1]


def flights_at_one_pixel(
    rng: np.random.Generator, count: int, speed: int, radius: int, velocity: Vector
) -> tuple[list[tuple[Vector, Vector]], list[tuple[Vector, Vector]]]:
    """Flights that only just touch the pixel at (0, 0), and the same 1/256 px farther aside, which only just miss it.

    The distance from a line to a point is their cross product over |d|: the last start that touches is a division.
    """
    touching, passing = [], []
    while len(touching) < count:
        ahead = (int(rng.integers(-(2**30), 2**30)), int(rng.integers(-(2**30), 2**30)))
        v = flight(speed, ahead)
        d = v[0] - velocity[0], v[1] - velocity[1]
        if abs(d[0]) + abs(d[1]) < 64 * SUB:
            continue
        axis = int(abs(d[0]) > abs(d[1]))  # aside is along the axis on which it flies less far
        part = Fraction(int(rng.integers(2, 15)), 16) if d[0] and d[1] else Fraction(1, 2)
        along = round(-part * d[1 - axis])
        # cross = w_x d_y - w_y d_x with w_axis = s and w_(1 - axis) = along.
        sign = 1 if axis == 0 else -1
        factor, rest = sign * d[1 - axis], -sign * along * d[axis]
        most = last_miss(d, radius)
        side = 1 if rng.random() < 0.5 else -1
        s = (side * most - rest) // factor if side * factor > 0 else -((side * most - rest) // -factor)
        out = 1 if side * factor > 0 else -1
        for shift, shots in ((0, touching), (out, passing)):
            a = (s + shift, along) if axis == 0 else (along, s + shift)
            shots.append((a, (a[0] + ahead[0], a[1] + ahead[1])))
    return touching, passing


TUNNELS = [
    (10**6, 0, (0, 0)),
    (10**6, 0.3, (0, 0)),
    (10**6, 3, (0, 0)),
    (10**6, 0, (-300.5, 90_000.25)),
    (10**6, 5.5, (1000, -1000)),
    (12_345.75, 1, (0, 3.5)),
    (900, 0.3, (-450.25, 17)),
    (300, 0, (0, 0)),
]


@pytest.mark.parametrize(("speed", "radius", "velocity"), TUNNELS)
def test_a_swept_projectile_never_tunnels(speed: float, radius: float, velocity: tuple[float, float]) -> None:
    """A target of one pixel, met by a hair, or missed by one; a test a frame hardly ever sees it."""
    rng = np.random.default_rng(int(speed) + int(radius * 10))
    w = round(velocity[0] * SUB), round(velocity[1] * SUB)
    touching, passing = flights_at_one_pixel(rng, 1000, round(speed * SUB), round(radius * SUB), w)
    scene = Scene()
    scene.add(ONE, velocity_xy=velocity)
    assert fired(scene, Projectile(speed, radius), touching).passes.shot.tolist() == list(range(1000))
    assert len(fired(scene, Projectile(speed, radius), passing)) == 0
    assert len(fired(scene, Projectile(speed, radius, steps=1), touching)) == 0
    assert len(fired(scene, Projectile(speed, radius, steps=64), touching)) < 300
    thing = Thing(0, frozenset([(0, 0)]), velocity=w)
    for shots, expected in ((touching[:40], 1), (passing[:40], 0)):
        for a, toward in shots:
            v = flight(round(speed * SUB), (toward[0] - a[0], toward[1] - a[1]))
            assert len(impacts(a, v, round(radius * SUB), [thing])) == expected


@pytest.mark.long
@pytest.mark.parametrize(("speed", "radius", "velocity"), TUNNELS)
def test_many_swept_projectiles_never_tunnel(speed: float, radius: float, velocity: tuple[float, float]) -> None:
    rng = np.random.default_rng(5)
    w = round(velocity[0] * SUB), round(velocity[1] * SUB)
    touching, passing = flights_at_one_pixel(rng, 40_000, round(speed * SUB), round(radius * SUB), w)
    scene = Scene()
    scene.add(ONE, velocity_xy=velocity)
    assert len(fired(scene, Projectile(speed, radius), touching)) == 40_000
    assert len(fired(scene, Projectile(speed, radius), passing)) == 0


def convex_targets(rng: np.random.Generator, moving: bool) -> tuple[Scene, float]:
    """One target that a flight touches for one stretch of time: a box and a point, or a pixel and a disc."""
    radius = float(rng.choice([0, 2.25, 9]))
    size = (1, 1) if radius else rng.integers(1, 12, 2)
    scene = Scene()
    scene.add(np.ones(size, np.bool_), velocity_xy=rng.integers(-60, 61, 2) if moving else (0, 0))
    return scene, radius


@pytest.mark.parametrize("moving", [False, True])
def test_more_steps_come_nearer_to_the_swept_flight(moving: bool) -> None:
    """k / n are among k / 2n: a target that is met with n steps is met with 2n, and not later."""
    counts = 1, 2, 4, 8, 16, 32, 64, 128, 256
    seen, there = np.zeros(len(counts)), 0
    for number in range(8):
        rng = np.random.default_rng((7, number))
        scene, radius = convex_targets(rng, moving)
        at = rng.uniform(-70, 70, (200, 2))
        aim = np.degrees(np.arctan2(-at[:, 1], -at[:, 0])) + rng.uniform(-12, 12, 200)
        swept = fire(scene, Projectile(128, radius), at, aim=aim).stop
        met = swept.reason == Reason.HITS
        before = np.ones(len(at))
        for i, n in enumerate(counts):
            stop = fire(scene, Projectile(128, radius, steps=n), at, aim=aim).stop
            stepped = stop.reason == Reason.HITS
            seen[i] += stepped.sum()
            assert not (stepped & ~met).any()
            behind = (stop.fraction - swept.fraction)[stepped]
            assert (behind >= -1e-9).all()
            assert (behind[swept.fraction[stepped] > 0] < 1 / n + 1e-9).all()
            assert (stop.fraction <= before + 1e-9).all()
            before = stop.fraction
        there += met.sum()
    assert there > 330
    assert (np.diff(seen) >= 0).all()
    assert seen[0] < 0.2 * there
    assert seen[-1] > 0.97 * there


@pytest.mark.parametrize("moving", [False, True])
def test_whatever_steps_meet_a_swept_flight_meets_not_later(moving: bool) -> None:
    met = 0
    for number in range(40):
        rng = np.random.default_rng((8, number))
        things = things_of(rng, 5, moving)
        scene, speed, radius = scene_of(things), SPEEDS[1 + number % 6], RADII[number % 6]
        shots = shots_of(rng, 40, int(speed * SUB), things)
        swept, stepped = (fired(scene, Projectile(speed, radius, steps=n), shots).stop for n in (None, 1 + number % 9))
        stops = stepped.reason != Reason.RANGE
        met += int(stops.sum())
        assert not (stops & (swept.reason == Reason.RANGE)).any()
        slack = 2.0**-17 if number % 6 == 0 else 2.0**-50  # half a px a frame: times are whole numbers over 128^2
        assert (stepped.fraction >= swept.fraction - slack).all()
    assert met > 100


def columns(hits: RayHits) -> list[np.ndarray]:
    stop = hits.stop
    return [stop.reason, stop.item, stop.cell_xy, stop.fraction, hits.passes.entry_xy, hits.passes.material]


@pytest.mark.parametrize(("moving", "steps"), in_turn([False, True], [None, 5]))
def test_a_batch_is_its_shots_and_whole_shifts_change_nothing(moving: bool, steps: int | None) -> None:
    for number in range(10):
        rng = np.random.default_rng((9, number))
        things = things_of(rng, 5, moving)
        weapon = Projectile(SPEEDS[number % 7], RADII[number % 6], steps=steps)
        shots = shots_of(rng, 12, int(weapon.speed * SUB), things)
        shift = (int(rng.integers(-(10**9), 10**9)), (10**9, -(10**9))[number % 2])
        here, there = scene_of(things), scene_of(things, shift=shift)
        together, shifted = fired(here, weapon, shots), fired(there, weapon, shots, shift)
        for a, b in zip(columns(together), columns(shifted), strict=True):
            moved = a + shift if a.ndim == 2 else a
            assert np.array_equal(moved, b)
        alone = [columns(fired(here, weapon, [shot])) for shot in shots]
        for i, column in enumerate(columns(together)):
            assert np.array_equal(column, np.concatenate([one[i] for one in alone]))


def test_only_relative_velocity_counts() -> None:
    """A target that moves at w, met at v, is met like one that rests, met at v - w."""
    met = 0
    for number in range(40):
        rng = np.random.default_rng((10, number))
        base = things_of(rng, 4, moving=True)
        fast, slow = (int(rng.integers(20, 5000)) * 16 for _ in range(2))
        one, other = (AHEAD[i] for i in rng.choice(len(AHEAD), 2, replace=False))
        v, u = flight(fast, one), flight(slow, other)
        w = v[0] - u[0], v[1] - u[1]
        boosted = [
            Thing(t.id, t.pixels, t.occluder, t.layer, (t.velocity[0] + w[0], t.velocity[1] + w[1])) for t in base
        ]
        shots = shots_of(rng, 30, slow, base, other)
        at = [a for a, _ in shots]
        radius = RADII[number % 6]
        hits = []
        for things, speed, ahead in ((base, slow, other), (boosted, fast, one)):
            aimed = [(a, (a[0] + SUB * ahead[0], a[1] + SUB * ahead[1])) for a in at]
            hits.append(fired(scene_of(things), Projectile(speed / SUB, radius), aimed))
        for name in ("reason", "item", "fraction"):
            assert np.array_equal(getattr(hits[0].stop, name), getattr(hits[1].stop, name))
        assert np.array_equal(hits[0].passes.entry, hits[1].passes.entry)
        assert np.array_equal(hits[0].passes.entry_xy, hits[1].passes.entry_xy)
        met += len(hits[0].passes)
    assert met > 100
