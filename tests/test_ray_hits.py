"""What rays hit, as an answer: rows by body, JSON, equality, counts, what was missed and why; parts of a batch."""

from __future__ import annotations

import copy
import json
import math
import pickle
import random
from collections import Counter
from collections.abc import Collection
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given, note
from hypothesis import strategies as st
from ray_battles import Battle, Body, Gun, Pixel, Shot, some_battle, some_body, some_place, some_target
from some_of import some_of
from test_rays import bar, harmless, same

from hitplanes import (
    Disc,
    InputError,
    Laser,
    Pistol,
    Projectile,
    RayHits,
    Reason,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Sweep,
    Verdict,
    Weapon,
    fire,
)
from hitplanes.weapons.fire.hits import HitRow
from hitplanes.weapons.rays.ray_walk import trace

FAR = 10**9
worlds = st.randoms(use_true_random=False)


def fired(battle: Battle, **options: Any) -> RayHits:
    hits = battle.fired(**options)
    assert isinstance(hits, RayHits)
    return hits


def many(rng: random.Random, count: int = 9) -> Battle:
    """A battle of more shots, each as good as the others."""
    battle = harmless(some_battle(rng))
    shots = []
    for number in range(count):
        at = some_place(rng, battle.bodies)
        shot = replace(rng.choice(battle.shots), at=at, number=number)
        shots.append(replace(shot, toward=some_target(rng, at, battle.bodies)) if shot.toward is not None else shot)
    return replace(battle, shots=shots)


# Parts of a batch


@examples(17, deadline=None)
@given(worlds, st.sampled_from([1, 3, 10, 40]))
def test_a_batch_cut_anywhere_is_the_same(rng: random.Random, chunk: int) -> None:
    battle = many(rng)
    note(repr(battle))
    scene = battle.scene()
    whole = fired(battle, scene=scene)
    assert sorted(set(whole.stop.shot.tolist())) == list(range(9))
    walks: tuple[dict[str, Any], ...] = ({"strategy": "walk"}, {"prefilter": "none"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hitplanes.weapons.rays.ray_call.RAYS_AT_ONCE", 3 * chunk)
        patch.setattr("hitplanes.weapons.rays.raycast.BRUTE_PAIRS", chunk * 8)
        patch.setattr("hitplanes.weapons.rays.raycast.CHUNK_SAMPLES", chunk)
        patch.setattr("hitplanes.weapons.rays.ray_hits.CHUNK_CELLS", chunk)
        same(whole, fired(battle, scene=scene))
    for options in (*walks, {"broadphase": "bvh", "prefilter": rng.choice(["box", "circle"])}):
        calls: list[int] = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(
                "hitplanes.weapons.rays.ray_call.trace", lambda *given, calls=calls: calls.append(1) or trace(*given)
            )
            patch.setattr("hitplanes.weapons.rays.ray_call.WALKED_AT_ONCE", chunk)
            patch.setattr("hitplanes.weapons.rays.ray_call.CELLS_KEPT", 5 * chunk)
            patch.setattr("hitplanes.weapons.explain.ray_samples.CELLS_AT_ONCE", 50 * chunk)
            patch.setattr("hitplanes.planes.bits.cells.PAIRS_AT_ONCE", chunk * 8)
            patch.setattr("hitplanes.weapons.rays.contacts.CHUNK_SAMPLES", chunk)
            cut = fired(battle, scene=scene, **options)
            assert len(calls) >= -(-len(whole.stop) // chunk)
            assert np.array_equal(whole.verdicts, cut.verdicts)
        same(whole, cut)


def test_passes_are_made_when_they_are_read_also_if_the_scene_has_changed() -> None:
    scene = Scene()
    ids = [scene.add(np.ones((5, 5), np.bool_), (10 * i, 0)) for i in range(1, 4)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hitplanes.weapons.rays.ray_hits.normals_at", lambda *_: pytest.fail("nobody has asked"))
        hits = fire(scene, Laser(40), (0, 0))
    scene.remove(ids)
    assert hits.passes.object.tolist() == ids and hits.passes.material.tolist() == [5, 5, 5]
    assert hits.stop.reason.tolist() == [0]


@pytest.mark.parametrize("weapon", [Sweep(Laser(40), 6, 3), Sweep(Pistol(40), 2, 3)])
def test_pixels_of_several_rays_are_counted_when_they_are_read_also_if_the_scene_has_changed(weapon: Weapon) -> None:
    scene = Scene()
    ids = [scene.add(np.ones((9, 5), np.bool_), (10 * i, 0)) for i in range(1, 4)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hitplanes.weapons.rays.ray_hits.numbered", lambda *_: pytest.fail("nobody has asked"))
        hits = fire(scene, weapon, (0, 0))
        again = fire(scene, weapon, [(0, 0), (0, 1)])
        assert hits.pellets.tolist() == [3] * len(hits) and hits.samples.min() > 1
    drawn = {item: pixels.count for (_, item), pixels in hits.pixels_at().items()}
    copies = [pickle.loads(pickle.dumps(hits)), copy.deepcopy(again)]
    scene.remove(ids)
    assert dict(zip(hits.object.tolist(), hits.pixels.tolist(), strict=True)) == drawn
    assert hits.pixels[0] < hits.samples[0] and again.pixels[: len(hits)].tolist() == hits.pixels.tolist()
    assert [copied.pixels.tolist() for copied in copies] == [hits.pixels.tolist(), again.pixels.tolist()]


@pytest.mark.parametrize("rays", [1, 4, 128])
@pytest.mark.parametrize("bad", [[0], [3], [5], [2, 4]])
def test_a_start_inside_is_named_by_its_row_in_any_part(
    rays: int, bad: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hitplanes.weapons.rays.ray_call.WALKED_AT_ONCE", rays)
    for around in ({}, {"sweep": (30.0, 3)}, {"rounds": (2, (0.0, 0.0), 5.0)}):
        gun = Gun(range=9, inside="error", **around)  # type: ignore[arg-type]
        shots = [Shot((20 if i in bad else 0, 20)) for i in range(6)]
        battle = Battle(gun, shots, [bar(90, 99), bar(19, 21, 19, 21), bar(19, 21, 19, 21, occluder=True)])
        told = f"at[{bad[0]}]: expected a start outside of every item, got one inside of id 2, 'occluder 2'"
        with pytest.raises(InputError) as caught:
            battle.fired()
        assert str(caught.value) == told
        harmless(replace(battle, shots=[s for i, s in enumerate(shots) if i not in bad])).fired()


def test_a_way_that_cannot_serve_is_passed_over() -> None:
    scene = Scene((40, 40))
    scene.add([[True]], (5, 1))
    others: dict[str, tuple[tuple[Weapon, str], ...]] = {
        "march": (
            *((weapon, "only thin rays that end at their first hit do; ")
              for weapon in (Pistol(9, width=2), Sweep(Laser(9), 30, 3), Rounds(Spread(Rifle(9), 3, 2), 2))),
            (Projectile(9, 1), "only thin rays that end at their first hit do; "),
        ),
        "cast": (
            (Laser(9, inside="ignore_until_exit"), "items in which rays start are not hit; "),
            (Projectile(9, 1, steps=3), "a projectile is tested at moments of the frame; "),
        ),
    }  # fmt: skip
    for way, weapons in others.items():
        for weapon, why in weapons:
            hits, walked = fire(scene, weapon, (1, 1), strategy=way), fire(scene, weapon, (1, 1), strategy="walk")
            assert hits == walked and not hits.plan.has_run(way)
            told = {stage.name: stage.why for stage in hits.plan.left_out}[way]
            assert told.startswith(f"{way} is passed over: {why}")
    hits = fire(Scene(), Pistol(9), (1, 1), strategy="march")
    told = {stage.name: stage.why for stage in hits.plan.left_out}
    assert told["march"].startswith("march is passed over: no bounds that fit one plane; ")
    with pytest.raises(InputError, match=r"^strategy: expected one of .*did you mean 'walk'"):
        fire(scene, Pistol(9), (1, 1), strategy="wlak")


# What is told


@examples(40, deadline=None)
@given(worlds)
def test_rows_are_added_up_by_body(rng: random.Random) -> None:
    battle = many(rng, 4)
    hits = fired(battle)
    owner = {i: i if body.owner is None else body.owner for i, body in enumerate(battle.bodies)}
    truth: dict[tuple[int, int], list[HitRow]] = {}
    for row in hits:
        truth.setdefault((row.shot, owner[row.object]), []).append(row)
    found = hits.by_owner()
    assert [(one.shot, one.owner) for one in found] == list(truth)
    for one, rows in zip(found, truth.values(), strict=True):
        assert one[2:5] == tuple(sum(getattr(row, n) for row in rows) for n in ("samples", "pixels", "weight"))
        assert one.objects == tuple(dict.fromkeys(row.object for row in rows))
        nearest = sorted((row.distance2, row.first_xy[1], row.first_xy[0]) for row in rows)[0]
        assert (one.distance2, *one.first_xy[::-1]) == nearest
        struck = {
            (p["round"], p["pellet"])
            for p in hits.passes.to_rows()
            if (p["shot"], owner[p["object"]]) == (one.shot, one.owner)
        }
        assert one.pellets == len(struck)


@examples(40, deadline=None)
@given(worlds)
def test_the_answer_as_json_is_the_answer(rng: random.Random) -> None:
    hits = fired(many(rng, 4))
    data = hits.to_dict()
    text = json.dumps(data, allow_nan=False)
    assert json.loads(text) == data and list(data) == ["rows", "passes", "stops", "plan"]
    assert [HitRow(**{**row, "first_xy": tuple(row["first_xy"])}) for row in data["rows"]] == list(hits)
    for columns, rows in ((hits.passes, data["passes"]), (hits.stop, data["stops"])):
        assert len(rows) == len(columns)
        for f in fields(columns):
            np.testing.assert_array_equal(
                np.array([row[f.name] for row in rows]).reshape(getattr(columns, f.name).shape),
                getattr(columns, f.name),
            )


def test_hits_are_equal_when_rows_passes_and_stops_are() -> None:
    battle = Battle(Gun("rifle", range=20, max_hits=3), [Shot((0, 0)), Shot((0, 9))], [bar(4, 6), bar(9, 9)])
    hits = fired(battle)
    assert hits == fired(battle) and hits == fired(battle, prefilter="none")
    empty = replace(battle, bodies=[])
    assert fired(empty) != fired(replace(empty, gun=replace(battle.gun, range=21))), "the stops alone differ"
    longer = replace(battle, bodies=[bar(4, 6), bar(9, 9), Body(frozenset({(4, 20)}))])
    assert hits == fired(longer)
    thinner = fired(replace(battle, bodies=[Body(frozenset({(4, 0), (5, 0), (6, 0), (4, 1)})), bar(9, 9)]))
    assert [row[:-1] for row in thinner] == [row[:-1] for row in hits] and hits != thinner, "the normal alone differs"
    pattern = fire(battle.scene(), Disc(3), [(5, 0), (5, 9)])
    assert hits != pattern and pattern != hits and hits != 5
    with pytest.raises(TypeError, match="unhashable"):
        hash(hits)
    with pytest.raises(TypeError, match="unhashable"):
        hash(hits.passes)


def test_no_column_can_be_written() -> None:
    hits = fired(Battle(Gun(range=20), [Shot((0, 0))], [bar(4, 6)]))
    arrays = {name: getattr(hits, name) for name in (*HitRow._fields, "starts", "verdicts", "fired")}
    for columns in (hits.passes, hits.stop):
        arrays |= {f"{type(columns).__name__}.{f.name}": getattr(columns, f.name) for f in fields(columns)}
    assert len(arrays) > 30 and all(len(column) for column in arrays.values())
    for name, column in arrays.items():
        with pytest.raises(ValueError, match="read-only"):
            column[:] = 0
        assert not column.flags.writeable, name
    with pytest.raises(AttributeError):
        hits.passes.entry = hits.passes.exit  # type: ignore[misc]


# Cells


@examples(40, deadline=None)
@given(worlds)
def test_verdicts_add_up_to_all_cells(rng: random.Random) -> None:
    hits = fired(many(rng, 4))
    for shot in range(4):
        samples = hits.samples_at(shot)
        counts = Counter(Verdict(v).name.lower() for v in samples.verdict.tolist())
        assert {k: v for k, v in hits.verdict_counts(shot).items() if v} == dict(counts)
        assert sum(hits.verdict_counts(shot).values()) == len(samples.xy) == hits.fired[shot]
    assert sum(hits.verdict_counts().values()) == hits.fired.sum() == hits.verdicts.sum()
    assert hits.verdicts.shape == (4, len(Verdict))


def corners_on(a: Pixel, b: Pixel) -> int:
    """Corners of pixels on a segment whose ends lie on no border, in whole numbers."""
    (x0, y0), (x1, y1) = a, b
    dx, dy = x1 - x0, y1 - y0
    found = 0
    for x in range(min(x0, x1), max(x0, x1) + 1):
        if dx and x % 256 == 128:
            y = y0 + Fraction(dy * (x - x0), dx)
            found += y.denominator == 1 and y % 256 == 128
    return found


def test_the_cells_of_a_thin_ray_are_columns_and_rows_and_corners() -> None:
    """A ray that goes on to a next column or row meets one more cell, and at a corner both and one more."""
    rng = random.Random(8)
    passed = 0
    for _ in range(268):
        on_pixels = rng.random() < 0.5
        ends: list[int] = []
        for _ in range(4):
            part = 0 if on_pixels else rng.randint(-127, 127)
            ends.append(256 * rng.randint(-9, 9) + part)
        a, b = (ends[0], ends[1]), (ends[2], ends[3])
        shot = Shot((a[0] / 256, a[1] / 256), (b[0] / 256, b[1] / 256))
        if a == b:
            continue
        corners = corners_on(a, b)
        columns, rows = (abs((p + 128) // 256 - (q + 128) // 256) + 1 for p, q in zip(a, b, strict=True))
        hits = fired(Battle(Gun(), [shot], [bar(-3, 2), bar(4, 5, 3, 9, occluder=True)], (-7, -7, 7, 7)))
        assert sum(hits.verdict_counts().values()) == columns + rows - 1 + corners, (a, b)
        passed += corners
    assert passed > 67


@examples(40, deadline=None)
@given(worlds)
def test_pixels_are_those_of_the_rows_and_the_passes(rng: random.Random) -> None:
    hits = fired(many(rng, 4))
    for shot in range(4):
        pixels = hits.pixels_at(shot)
        rows = {(row.round, row.object): row for row in hits.of(shot)}
        passes = hits.passes_at(shot)
        samples: Counter[tuple[int, int]] = Counter()
        for r, o, n in zip(passes.round.tolist(), passes.object.tolist(), passes.samples.tolist(), strict=True):
            samples[r, o] += n
        assert pixels.keys() == rows.keys() == samples.keys()
        for key, row in rows.items():
            xy = [tuple(p) for p in pixels[key].pixels().tolist()]
            assert len(xy) == len(set(xy)) == row.pixels and samples[key] == row.samples
            assert row.first_xy in xy
            mine = (passes.round == key[0]) & (passes.object == key[1])
            ends = {tuple(p) for p in (*passes.entry_xy[mine].tolist(), *passes.exit_xy[mine].tolist())}
            assert ends <= set(xy)
            if mine.sum() == 1:
                assert row.pixels == row.samples


# What was missed


def squared(a: tuple[Fraction, Fraction], b: tuple[Fraction, Fraction], cell: Pixel) -> Fraction:
    """Squared distance of a segment from the closed square of a pixel, px^2, in fractions."""
    half = Fraction(1, 2)
    low, high = [Fraction(v) - half for v in cell], [Fraction(v) + half for v in cell]
    step = [q - p for p, q in zip(a, b, strict=True)]
    first, last = Fraction(0), Fraction(1)
    for p, d, lo, hi in zip(a, step, low, high, strict=True):
        if d == 0:
            first = first if lo <= p <= hi else Fraction(2)
        else:
            near, far = sorted(((lo - p) / d, (hi - p) / d))
            first, last = max(first, near), min(last, far)
    if first <= last:
        return Fraction(0)

    def of_point(p: tuple[Fraction, ...]) -> Fraction:
        return sum(((v - min(max(v, lo), hi)) ** 2 for v, lo, hi in zip(p, low, high, strict=True)), Fraction(0))

    def of_corner(x: Fraction, y: Fraction) -> Fraction:
        length2 = step[0] ** 2 + step[1] ** 2
        t = ((x - a[0]) * step[0] + (y - a[1]) * step[1]) / length2 if length2 else Fraction(0)
        t = min(max(t, Fraction(0)), Fraction(1))
        return (a[0] + t * step[0] - x) ** 2 + (a[1] + t * step[1] - y) ** 2

    corners = [of_corner(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])]
    return min(of_point(a), of_point(b), *corners)


def inside(pixels: Collection[Pixel], bounds: tuple[int, int, int, int] | None) -> set[Pixel]:
    """Pixels that lie within bounds: those that could be hit."""
    if bounds is None:
        return set(pixels)
    return {(x, y) for x, y in pixels if bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]}


def some_bounds(rng: random.Random, at: tuple[float, float]) -> tuple[int, int, int, int] | None:
    """None, or such as cut bodies near a place; it may lie out of them."""
    x, y = round(at[0]), round(at[1])
    near = x - rng.randint(-2, 9), y - rng.randint(-2, 9)
    return rng.choice([None, (*near, near[0] + rng.randint(3, 15), near[1] + rng.randint(3, 15))])


@examples(120, deadline=None)
@given(worlds)
def test_the_nearest_miss_is_the_nearest_of_all(rng: random.Random) -> None:
    battle = many(rng, 2)
    bodies = battle.bodies[:3]
    bodies += [some_body(rng, len(bodies)).moved(9, 5), some_body(rng, len(bodies)).moved(-9, 2)]
    bounds = rng.choice([battle.bounds, some_bounds(rng, battle.shots[0].at)])
    battle = replace(battle, bodies=bodies, bounds=bounds)
    note(repr(battle))
    hits = fired(battle)
    radius = round(battle.gun.width * 128) / 256
    for which, shot in enumerate(battle.shots):
        hit = {row.object for row in hits.of(which)}
        stops = hits.stops_at(which)
        segments = []
        for (_, _, a, b), part in zip(battle.rays(which), stops.fraction.tolist(), strict=True):
            start = Fraction(a[0], 256), Fraction(a[1], 256)
            end = tuple(p + Fraction(part) * (Fraction(q, 256) - p) for p, q in zip(start, b, strict=True))
            segments.append((start, end))
        distances = {}
        cells, owner = hits.samples_at(which), hits.scene.owner
        walked = {tuple(xy) for xy in cells.xy[cells.verdict < Verdict.OUTSIDE].tolist()}
        bodies_hit = {int(owner(item)) for item in hit}
        for item in battle.accepted(shot):
            if item.occluder or int(owner(item.id)) in bodies_hit or item.pixels & walked:
                continue
            if can_be_hit := inside(item.pixels, bounds):
                least = min(squared(a, b, cell) for a, b in segments for cell in can_be_hit)  # type: ignore[arg-type]
                distances[item.id] = max(math.sqrt(least) - radius, 0.0)
        grazed = {item for item, distance in distances.items() if not distance}  # met as the ray ended, or not at all
        miss = hits.nearest_miss(which)
        distances = {item: distance for item, distance in distances.items() if distance}
        if miss is None or not miss.distance:
            assert (miss is None and not distances) or (miss is not None and miss.object in grazed)
            continue
        assert miss is not None and miss.object not in hit
        nearest = min(distances.values())
        assert miss.distance == pytest.approx(nearest, abs=1e-9)
        assert distances[miss.object] == pytest.approx(nearest, abs=1e-9)
        body = battle.bodies[miss.object]
        nearby = inside(body.pixels, bounds)
        assert any(all(abs(p - q) <= 0.5 + 1e-9 for p, q in zip(miss.object_xy, c, strict=True)) for c in nearby)
        assert max(math.dist(miss.ray_xy, miss.object_xy) - radius, 0) == pytest.approx(nearest, abs=1e-9)
        rays = list(zip(stops.round.tolist(), stops.pellet.tolist(), strict=True))
        a, b = segments[rays.index((miss.round, miss.pellet))]
        assert off(tuple(Fraction(v) for v in miss.ray_xy), a, b) < 1e-9


def off(point: tuple[Fraction, ...], a: tuple[Fraction, ...], b: tuple[Fraction, ...]) -> float:
    """Distance of a point from a segment."""
    step = [q - p for p, q in zip(a, b, strict=True)]
    length2 = sum(d * d for d in step)
    t = sum((p - q) * d for p, q, d in zip(point, a, step, strict=True)) / length2 if length2 else Fraction(0)
    t = min(max(t, Fraction(0)), Fraction(1))
    return math.sqrt(sum((p - q - t * d) ** 2 for p, q, d in zip(point, a, step, strict=True)))


def test_the_nearest_miss_in_a_picture() -> None:
    """3 px above the ray, behind its stop, refused, hit: only what could have been hit counts."""
    bodies = [
        bar(4, 5), bar(9, 9, occluder=True), bar(13, 14), bar(2, 2, -8, -4), bar(6, 6, -3, -2, categories=2),
        bar(3, 3, 30, 30),
    ]  # fmt: skip
    hits = fired(Battle(Gun("laser", range=20), [Shot((0, 0), accept=1)], bodies))
    miss = hits.nearest_miss()
    assert miss == (3, 0, 0, 3.5, (1.5, 0.0), (1.5, -3.5)) or miss == (3, 0, 0, 3.5, (2.5, 0.0), (2.5, -3.5))
    behind = fired(Battle(Gun("laser", range=20), [Shot((0, 0))], [bodies[0], bodies[1], bodies[2]]))
    assert behind.stop.distance.tolist() == [8.5]
    assert behind.nearest_miss() == (2, 0, 0, 4.0, (8.5, 0.0), (12.5, 0.0))
    corner = Body(frozenset({(3, 8), (3, 9), (12, -8), (12, -9)}))
    for two in ([corner, bar(5, 6, 3, 4)], [bar(5, 6, 3, 4), corner]):  # a box that is crossed, and its pixels far
        near = fired(Battle(Gun("laser", range=20), [Shot((0, 0))], two)).nearest_miss()
        assert near is not None and near[0] == 1 - two.index(corner) and near.distance == 2.5
    outside = fired(Battle(Gun("laser", range=20), [Shot((0, 0))], [bar(13, 14)], (0, 0, 9, 9)))
    assert outside.nearest_miss() is None, "what lies out of bounds is no miss"
    slanted = Body(frozenset({(9, 5), (10, 3), (11, 1)}))
    cut = fired(Battle(Gun("laser", range=20), [Shot((0, 0))], [slanted], (0, 0, 9, 9)))
    assert (cut.nearest_miss() or [None] * 4)[3] == 4.5, "a pixel out of bounds cannot be hit"
    hook = Body(frozenset({(5, 4), (6, 4), (12, 0), (12, 1)}))
    touched = fired(Battle(Gun("laser", range=20), [Shot((0, 0))], [hook], (0, 0, 9, 9)))
    assert (touched.nearest_miss() or [None] * 4)[3] == 3.5, "a pixel out of bounds is no pixel that was touched"
    wide = fired(Battle(Gun("laser", range=20, width=4), [Shot((0, 0), accept=1)], [bodies[3]]))
    assert (wide.nearest_miss() or [None] * 4)[3] == 1.5
    assert fired(Battle(Gun(range=20), [Shot((0, 0))], [bodies[0]])).nearest_miss() is None


WHY: dict[str, tuple[Gun, Shot, list[Body], tuple[Any, ...]]] = {
    "missed": (Gun(range=20), Shot((0, 0)), [bar(5, 6, 3, 4)], (0, "missed", 0, {}, 2.5)),
    "missed, beyond the range": (Gun(range=20), Shot((0, 0)), [bar(25, 26)], (0, "missed", 0, {}, 4.5)),
    "category": (Gun(range=20), Shot((0, 0), accept=1), [bar(5, 6, categories=2)], (0, "category", 2, {}, 0.0)),
    "category, beside": (Gun(range=20), Shot((0, 0), accept=1), [bar(5, 6, 2, 2, categories=2)],
                         (0, "category", 0, {}, 1.5)),
    "excluded": (Gun(range=20), Shot((0, 0), exclude=(0,)), [bar(5, 6)], (0, "excluded", 2, {}, 0.0)),
    "behind a wall": (Gun(range=20), Shot((0, 0)), [bar(9, 12), bar(5, 5, occluder=True)],
                      (0, "behind", 4, {1: 1}, 0.0)),
    "behind the last hit": (Gun("pistol", range=20), Shot((0, 0)), [bar(9, 12), bar(5, 5)],
                            (0, "behind", 4, {1: 1}, 0.0)),
    "behind what took all": (Gun("rifle", range=20, budget=1.5), Shot((0, 0)), [bar(9, 12), bar(5, 6)],
                             (0, "behind", 4, {1: 1}, 0.0)),
    "behind what took all, just there": (Gun("rifle", range=20, budget=2), Shot((0, 0)), [bar(7, 12), bar(5, 6)],
                                         (0, "behind", 6, {1: 1}, 0.0)),
    "no budget": (Gun("rifle", range=20, budget=0), Shot((0, 0)), [bar(0, 2)], (0, "budget", 3, {}, 0.0)),
    "no budget, beside": (Gun("rifle", range=20, budget=0), Shot((0, 0)), [bar(5, 6, 3, 4)],
                          (0, "missed", 0, {}, math.hypot(4.5, 2.5))),
    "behind a wall in the same cell": (Gun(range=20), Shot((0, 0)), [bar(5, 5), bar(5, 5, occluder=True)],
                                       (0, "behind", 1, {1: 1}, 0.0)),
    "outside": (Gun(range=20), Shot((0, 0)), [bar(12, 13)], (0, "outside", 2, {}, 0.0)),
    "inside": (Gun(range=20, inside="ignore_until_exit"), Shot((0, 0)), [bar(-1, 1)], (0, "inside", 2, {}, 0.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", WHY)
def test_why_an_object_was_not_hit(name: str) -> None:
    gun, shot, bodies, told = WHY[name]
    bounds = (-9, -9, 10, 9) if name == "outside" else None
    hits = fired(Battle(gun, [shot], bodies, bounds))
    assert hits.why_not() == [told]
    if told[1] == "missed":
        assert hits.nearest_miss() is not None


def test_what_a_ray_touches_as_its_budget_is_used_up_is_no_miss() -> None:
    """Beside what took the last px, and a step behind it."""
    bodies = [bar(2, 4), bar(5, 6), bar(8, 9)]
    hits = fired(Battle(Gun("rifle", range=20, budget=3), [Shot((0, 0))], bodies))
    assert {margin.object: margin.distance for margin in hits.margins(0) if not margin.hit} == {1: 1.75, 2: 4.0}
    miss = hits.nearest_miss(0)
    assert miss is not None and (miss.object, miss.distance) == (2, 3.0)
    assert [why[:4] for why in hits.why_not(0)] == [(1, "behind", 2, {0: 1}), (2, "behind", 2, {0: 1})]


def test_what_a_projectile_slips_past() -> None:
    """It lies between two tests, or it moved away; in a world with and without bounds."""
    for scene in (Scene(), Scene((90, 90), (-9, -9))):
        board = scene.add(np.ones((9, 2), bool), (15, 0), velocity_xy=(0, 0))
        through = fire(scene, Projectile(40, 1, steps=1), (0, 0))
        assert through.why_not() == [(board, "tunnelled", 6, {}, 0.0)] and not through
        assert fire(scene, Projectile(40, 1), (0, 0)).object.tolist() == [board]
        scene.set(board, velocity_xy=(0, 60))
        away = fire(scene, Projectile(40, 1), (0, 0))
        assert not away and away.why_not()[0][:3] == (board, "missed", 0)
        for weapon in (Projectile(40, 1), Projectile(40, 1, steps=2)):
            ignored = fire(scene, replace(weapon, inside="ignore_until_exit"), (15, 0))
            assert ignored.why_not()[0][:2] == (board, "inside") and not ignored


def test_what_lies_partly_out_of_bounds() -> None:
    edge = Scene((20, 20))
    half = edge.add(np.ones((3, 6), bool), (20, 10))
    assert fire(edge, Projectile(40, 1, steps=1), (10, 10)).why_not()[0][:2] == (half, "tunnelled")
    assert [fire(edge, Laser(9), at, aim=90).why_not()[0][:2] for at in ((25, 10), (21, 5))] == [
        (half, "missed"), (half, "outside"),
    ]  # fmt: skip


@pytest.mark.parametrize("weapon", [Disc(2), Pistol(20), Laser(20, width=3)], ids=repr)
def test_only_what_lies_within_the_bounds_can_be_missed(weapon: Weapon) -> None:
    """A bracket of which one arm lies out of bounds, just above the shot; and a board that lies out of them."""
    scene, bracket = Scene((100, 100)), np.zeros((40, 60), np.bool_)
    bracket[:8] = bracket[:, :5] = True
    arm = scene.add(Sprite.from_mask(bracket, pivot_xy=(0, 0)), (30, -10))
    board = scene.add(Sprite.from_mask(np.ones((2, 9), np.bool_), pivot_xy=(0, 0)), (56, -14))
    hits = fire(scene, weapon, (60, 3), aim=0)
    near, far = hits.why_not()
    assert near[:2] == (board, "outside") and far[:2] == (arm, "missed")
    assert 23 < far.distance < 26 and 10 < near.distance < 16
    if isinstance(hits, RayHits):
        miss = hits.nearest_miss()
        assert miss is not None and (miss.object, miss.distance) == (arm, far.distance)


def test_why_not_looks_32_px_around_and_tells_the_nearest_first() -> None:
    bodies = [bar(5, 6, y, y) for y in (33, 32, 2, 4)]
    hits = fired(Battle(Gun(range=20), [Shot((0, 0))], bodies))
    assert [(why.object, why.distance) for why in hits.why_not()] == [(2, 1.5), (3, 3.5), (1, 31.5)]
    fan = fired(
        Battle(Gun("pistol", range=30, sweep=(90.0, 3)), [Shot((0, 0))], [bar(9, 9, -9, 9), bar(12, 12, -2, 2)])
    )
    assert [why[:2] for why in fan.why_not()] == [(1, "behind")]
    assert fan.why_not()[0].by == {0: 1}


def test_walls_that_ended_rays_and_what_lies_behind_them() -> None:
    bodies = [
        bar(9, 9, -9, 0, occluder=True), bar(12, 12, 1, 9, occluder=True), bar(15, 15, -9, 9), bar(18, 18, -1, 1),
        bar(15, 15, categories=2), bar(4, 4, -9, 9),
    ]  # fmt: skip
    gun = Gun("laser", range=30, sweep=(60.0, 5))
    hits = fired(Battle(gun, [Shot((0, 0), accept=1)], bodies))
    first, second = hits.blockers()
    assert hits.stop.item.tolist() == [0, 0, 0, 1, 1]
    assert (first.occluder, first.samples, second.occluder, second.samples) == (0, 3, 1, 2)
    assert [b.object for b in first.behind] == [2, 3] and [b.object for b in second.behind] == [2]
    assert {b.object: b.at_xy for b in first.behind}[3] == (18, 0)
    assert fired(Battle(gun, [Shot((0, 0))], bodies[2:])).blockers() == []


# Far, long, empty


def test_rays_of_every_weapon_through_nothing() -> None:
    guns: list[Weapon] = [
        Laser(50), Pistol(50, width=4), Rifle(0, budget=1), Projectile(9, 2), Projectile(9, 2, steps=3),
        Sweep(Laser(9), 90, 3), Spread(Laser(9), 3, 3), Rounds(Laser(5), 2, (1, 0)),
    ]  # fmt: skip
    nothing = Scene()
    empty = Scene((99, 99), (-9, -9))
    for role in ("hittable", "occluder"):
        empty.add(np.zeros((4, 4), bool), (3, 3), role=role)
    for scene in (nothing, empty):
        for gun in guns:
            hits = fire(scene, gun, [(0, 0), (5.5, 5.5)], aim=33)
            assert isinstance(hits, RayHits) and not hits and len(hits.passes) == 0
            assert set(hits.stop.reason.tolist()) == {Reason.RANGE} and set(hits.stop.fraction.tolist()) == {1.0}
            for shot in (0, 1):
                assert hits.nearest_miss(shot) is None and hits.why_not(shot) == [] == hits.blockers(shot)
                assert hits.pixels_at(shot) == {} and hits.verdict_counts(shot)["empty"] == hits.fired[shot] > 0
            none = fire(scene, gun, np.zeros((0, 2)))
            assert isinstance(none, RayHits) and len(none.stop) == 0 and none.verdicts.shape == (0, len(Verdict))
            assert none.to_dict()["stops"] == [] and none.by_owner() == []


@pytest.mark.parametrize(("x", "y"), some_of([(FAR, -FAR), (-FAR, FAR), (2**40, -(2**40))], 2))
def test_a_battle_far_away(x: int, y: int) -> None:
    """All that is derived, too, is what it is at home; points to what a float64 holds there."""
    for seed in range(20):
        battle = many(random.Random(seed), 3)
        here, there = fired(battle), fired(battle.moved(*(v - 40 * (v > 0) + 40 * (v < 0) for v in (x, y))))
        for which in range(3):
            assert here.why_not(which) == there.why_not(which)
            assert here.verdict_counts(which) == there.verdict_counts(which)
            one, other = here.nearest_miss(which), there.nearest_miss(which)
            assert (one and one[:4]) == (other and other[:4])
            assert [b[:2] for b in here.blockers(which)] == [b[:2] for b in there.blockers(which)]
            counts = [{k: len(v.pixels()) for k, v in hits.pixels_at(which).items()} for hits in (here, there)]
            assert counts[0] == counts[1]


def target_on(a: Pixel, b: Pixel, part: float) -> Pixel:
    """A pixel on a ray."""
    x, y = (p + round(part * (q - p)) for p, q in zip(a, b, strict=True))
    return (x + 128) // 256, (y + 128) // 256


@pytest.mark.parametrize("aim", [0, 45, 90, 33.3, -123.4])
@pytest.mark.parametrize("spread", [None, (5, 2.0**20)])
@pytest.mark.parametrize("at", [(0.25, -0.5), (FAR, -FAR)])
def test_the_longest_rays_end_where_they_should(aim: float, spread: Any, at: tuple[float, float]) -> None:
    """2^20 px, and pellets 2^20 px off: what lies far out on each is entered at its time, in fractions."""
    gun = Gun("laser", range=2**20, spread=spread)
    shot = Shot(at, aim=aim)
    rays = list(Battle(gun, [shot]).rays(0))
    cells = [target_on(a, b, part) for _, _, a, b in rays for part in (0.5, 0.999)]
    bodies = [Body(frozenset({cell})) for cell in cells]
    hits = fired(Battle(gun, [shot], bodies))
    found = {(p["pellet"], p["object"]): p for p in hits.passes.to_rows()}
    for number, (_, pellet, a, b) in enumerate(rays):
        assert hits.stop.point_xy[number].tolist() == [b[0] / 256, b[1] / 256]
        for k in (0, 1):
            item = 2 * number + k
            row = found[pellet, item]
            times = oracle_times(a, b, cells[item])
            assert row["entry"] == pytest.approx(float(times[0]), rel=1e-12) and row["samples"] == 1
            assert row["exit"] == pytest.approx(float(times[1]), rel=1e-12)
    assert {pellet for pellet, _ in found} == set(range(len(rays)))


def oracle_times(a: Pixel, b: Pixel, cell: Pixel) -> tuple[Fraction, Fraction]:
    """When a ray enters and leaves the closed square of a pixel."""
    first, last = Fraction(0), Fraction(1)
    for p, q, c in zip(a, b, cell, strict=True):
        if p != q:
            near, far = sorted((Fraction(256 * c - 128 - p, q - p), Fraction(256 * c + 128 - p, q - p)))
            first, last = max(first, near), min(last, far)
    assert first <= last
    return first, last


def test_a_long_thick_ray_tells_all_but_its_cells() -> None:
    gun = Gun("rifle", range=2**20, width=90, max_hits=2)
    bodies = [bar(9, 9), bar(2**19, 2**19), bar(2**19 + 50, 2**19 + 50), bar(2**18, 2**18, 46, 46)]
    hits = fired(Battle(gun, [Shot((0, 0))], bodies))
    assert hits.object.tolist() == [0, 1]
    miss = hits.nearest_miss()
    assert miss is not None and miss[:4] == (3, 0, 0, 0.5) and miss.object_xy[1] == 45.5
    assert math.dist(miss.ray_xy, miss.object_xy) == pytest.approx(45.5)
    assert [why[:2] for why in hits.why_not()] == [(2, "behind"), (3, "missed")]
    assert {key: len(spans.pixels()) for key, spans in hits.pixels_at().items()} == {(0, 0): 3, (0, 1): 1}
    assert hits.blockers() == []


def test_cells_that_are_too_many_are_refused_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.weapons.explain.ray_samples.DETAIL_SAMPLES_MAX", 500)
    hits = fired(Battle(Gun("rifle", range=100, width=9, max_hits=1), [Shot((0, 0))], [bar(9, 9), bar(50, 50)]))
    with pytest.raises(InputError, match=r"samples: expected a shot of at most 500 to tell one by one, got 1221"):
        hits.samples_at()
    assert sum(hits.verdict_counts().values()) == 69 + 9 * 100  # a disc and a rectangle
    assert hits.verdict_counts()["hit"] == hits.samples.sum()
    assert [why.object for why in hits.why_not()] == [1] and hits.nearest_miss() is not None
    assert list(hits.pixels_at()) == [(0, 0)] and hits.blockers() == []


@pytest.mark.parametrize("count", [2, 3, 4, 7, 8, 360])
def test_a_full_circle_fires_no_direction_twice_and_one_along_the_aim(count: int) -> None:
    hits = fire(Scene(), Sweep(Pistol(1000), 360, count), (0, 0), aim=30)
    x, y = hits.stop.point_xy.T
    around = np.sort(np.mod(np.degrees(np.arctan2(y, x)) - 30 + 1e-3, 360))
    assert np.allclose(around, 360 / count * np.arange(count) + 1e-3, atol=1e-3)


def test_a_circle_of_eight_hits_all_around() -> None:
    scene = Scene()
    ways = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    ids = [scene.add(np.ones((5, 5), np.bool_), (40 * x, 40 * y)) for x, y in ways]
    hits = fire(scene, Sweep(Pistol(80), 360, 8), (0, 0))
    assert sorted(hits.object.tolist()) == ids and hits.samples.tolist() == [1] * 8


def test_an_open_fan_has_a_ray_on_both_sides() -> None:
    hits = fire(Scene(), Sweep(Pistol(100), 90, 3), (0, 0))
    assert hits.stop.point_xy.round().tolist() == [[71, -71], [100, 0], [71, 71]]
