"""Shots counted by bit rows: every strategy, size of the parts, and both kinds of kernels give the rows of the runs."""

from __future__ import annotations

import itertools
from itertools import product
from typing import Any

import numpy as np
import pytest
from some_of import some_of
from test_fire import Placements, Shot, expected, told

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    History,
    Hits,
    Point,
    Polygon,
    Ring,
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
from hitplanes.planes.bits import bit_rows, cells, front_to_back, tiles, visible
from hitplanes.planes.bits.bit_rows import WORD
from hitplanes.planes.common.checks import Bools
from hitplanes.planes.common.limits import ALL
from hitplanes.planes.grid import spans as grid_spans
from hitplanes.planes.scene import variants as variants_module
from hitplanes.weapons.fire import areas
from hitplanes.weapons.fire import spans as spans_module
from hitplanes.weapons.fire import strategy as strategy_module
from hitplanes.weapons.fire import verdicts as verdicts_module
from hitplanes.weapons.fire.strategy import chosen_way
from hitplanes.weapons.kinds import weapon as weapon_module

STRATEGIES = ("direct", "built", "auto", "integers", "labels")
PICTURE = np.random.default_rng(5).random((30, 90)) < 0.3
WEAPONS: list[Weapon] = [
    Point(), Point(pierce=True), Disc(0.4), Disc(3), Disc(9.3), Disc(12, pierce=True), Disc(40), Disc(100), Box(5, 4),
    Box(30, 2), Box(1, 70), Ring(15, 20), Cone(50, 30), Beam(80, 6), Beam(80, 0, pierce=True), Stencil(PICTURE),
    Stencil([".."]), Polygon([(-9, -9), (70, 0), (-9, 9)], [[(0, -2), (3, 0), (0, 2)]]),
    Spread(Point(), count=9, radius=5), Spread(Disc(2), count=8, radius=20), Spread(Disc(3, pierce=True), 5, 9),
    Spread(Box(3, 1), count=2, radius=0), Spread(Stencil([".."]), 3, 9), Rounds(Disc(5), 3, (3, 2), 10),
    Rounds(Cone(40, 20), 3, (-3, 2), 45), Rounds(Spread(Disc(1), count=3, radius=6), 2, (3, 2)),
    Disc(30, falloff="linear"), Cone(70, 30, falloff="smooth"), Beam(80, 3, falloff="linear", pierce=True),
    Stencil(PICTURE, falloff="linear"), Spread(Disc(3, falloff="linear"), count=6, radius=9),
]  # fmt: skip
PARTS: dict[str, dict[str, int]] = {
    "whole": {},
    "parts": {
        "INTEGERS_PLACEMENTS": 0, "PLACEMENTS_AT_ONCE": 7, "NEAR_AT_ONCE": 3, "WORDS_AT_ONCE": 640, "PAIRS_AT_ONCE": 50,
        "BRUTE_PAIRS": 0, "FRONTS_AT_ONCE": 9, "FEW_ROWS": 0,
    },
    "single": {"CHUNK_PAIRS": 1, "WORDS_AT_ONCE": WORD, "PAIRS_AT_ONCE": 1, "PATTERNS_BYTES_MOST": 1},
    "few cells": {"WITHOUT_MOST": 0, "CELLS_MOST": 4, "BRUTE_PAIRS": 9, "ENTRIES_A_BOX": 2},
    "in integers": {"INTEGERS_REACH": 999, "INTEGERS_PLACEMENTS": 9999, "INTEGERS_PAIRS": 10**9, "OFTEN": 2},
}  # fmt: skip
"""Limits that cut a batch, and choose between two ways to do the same."""

OWNERS = areas, spans_module, strategy_module, weapon_module, tiles, bit_rows, front_to_back, cells, visible, grid_spans


@pytest.fixture
def kernels(jit: bool) -> str:
    """Kernels that are used for all calls of a test."""
    return "jit" if jit else "numpy"


def cut(patch: pytest.MonkeyPatch, limits: dict[str, int]) -> None:
    """Set limits wherever they are read."""
    for name, value in limits.items():
        owners = [owner for owner in OWNERS if hasattr(owner, name)]
        assert owners, name
        for owner in owners:
            patch.setattr(owner, name, value)


def by_runs(scene: Scene | History, weapon: Weapon, at: object, **how: Any) -> Hits:
    """The same shots, counted run by run."""
    hits = fire(scene, weapon, at, strategy="spans", prefilter="none", **how)
    assert hits.plan.has_run("walk") or hits.plan.has_left_out("walk")
    return hits


def way_of(hits: Hits) -> str:
    """The way that answered a call, as its plan tells."""
    return next(stage.why for stage in hits.plan.ran if stage.name == "plan").split(":")[0]


def some_mask(rng: np.random.Generator, most: int) -> Bools:
    """Holes, lines, single pixels far apart, nothing; sometimes over many tiles, some of which are empty."""
    h, w = rng.integers(1, most, 2)
    if rng.random() < 0.15:
        h, w = rng.integers(60, 150, 2)
    mask = rng.random((h, w)) < rng.choice([0, 0.1, 0.5, 0.9, 1, 1])
    if rng.random() < 0.2:
        mask[h // 4 :, : 3 * w // 4] = False
    if rng.random() < 0.1:
        mask[:] = False
        mask[rng.integers(h), rng.integers(w)] = mask[rng.integers(h), rng.integers(w)] = True
    return np.asarray(mask)


def some_scene(rng: np.random.Generator, most: int = 40, count: int = 25) -> Scene:
    """Objects and occluders on some layers, of some categories and owners, in bounds or none, over the edges."""
    scene = Scene((200, 160), tuple(rng.integers(-5, 5, 2).tolist())) if rng.random() < 0.7 else Scene()
    plain, flat = rng.random(2) < 0.3
    for i in range(int(rng.integers(0, count))):
        scene.add(
            some_mask(rng, most),
            rng.uniform((-20, -20), (220, 180)) if i % 2 else rng.uniform(50, 110, 2),
            role="hittable" if plain or rng.random() < 0.7 else "occluder",
            layer=0 if flat else int(rng.integers(-1, 2)),
            categories=1 if plain else int(rng.choice([0, 1, 2, 3, 7])),
            owner=None if i == 0 or rng.random() < 0.5 else int(rng.integers(0, i)),
        )
    return scene


def some_shots(rng: np.random.Generator, scene: Scene, most: int = 40) -> tuple[np.ndarray, dict[str, Any]]:
    """Places and filters, one for all or one for each."""
    count, items = int(rng.integers(1, most)), scene.items.count
    how: dict[str, Any] = {"aim": rng.integers(0, 8, count) * 45.0 if rng.random() < 0.5 else 30.0}
    if rng.random() < 0.5:
        how["accept"] = int(rng.choice([1, 2, 7, ALL])) if rng.random() < 0.5 else rng.integers(0, 8, count)
    if rng.random() < 0.4:
        how["blocked_by"] = int(rng.choice([0, 1, 6])) if rng.random() < 0.5 else rng.integers(0, 8, count)
    if rng.random() < 0.4:
        how["exclude"] = rng.integers(-1, items, (count, 2) if rng.random() < 0.7 else (1, 2))
    low, high = ((-50, -50), (250, 210)) if rng.random() < 0.4 else (40, 130)
    return rng.uniform(low, high, (count, 2)), how


@pytest.mark.parametrize("limits", PARTS)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 3))])
def test_every_way_is_that_of_the_runs(kernels: str, seed: int, limits: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if kernels == "jit" and limits == "in integers":
        pytest.skip("compiled kernels count all shots")
    rng = np.random.default_rng([seed, len(limits)])
    cut(monkeypatch, PARTS[limits])
    rows, ways = 0, set()
    for _ in range(4 if seed else 2):
        scene = some_scene(rng)
        for weapon in WEAPONS:
            at, how = some_shots(rng, scene)
            truth = by_runs(scene, weapon, at, **how)
            for strategy in STRATEGIES:
                hits = fire(scene, weapon, at, strategy=strategy, **how)
                assert hits == truth, f"{weapon} {strategy} {how}"
                assert not hits.plan.has_run("verdicts")
                ways.add(way_of(hits))
            rows += len(truth)
    assert rows > 250 and ways >= {"tiles", "visible"}
    assert "integers" in ways or limits != "in integers"


def test_the_oracle_says_the_same(kernels: str) -> None:
    """Sample by sample, of masks and patterns that are wider than a word, too."""
    rng = np.random.default_rng(7)
    rows = 0
    for _ in range(25):
        scene = some_scene(rng, 40, 20)
        weapon = WEAPONS[rng.integers(len(WEAPONS))]
        at = rng.uniform(40, 130, (3, 2))
        bits = rng.choice([1, 2, 3, ALL, ALL], (3, 2)).tolist()
        shots = [Shot((x, y), 90.0 * rng.integers(4), None, *two) for (x, y), two in zip(at, bits, strict=True)]
        for number, shot in enumerate(shots):
            shot.exclude, shot.number = (
                (() if rng.random() < 0.6 else (int(rng.integers(-1, scene.items.count)),)),
                number,
            )
        if rng.random() < 0.5:
            for shot in shots:
                shot.accept, shot.blocked_by, shot.exclude = ALL, ALL, ()
        volley = Placements(weapon, shots, seed=3)
        truth = expected(scene, volley)
        for strategy in STRATEGIES:
            assert told(volley.fired(scene, strategy=strategy)) == truth, f"{weapon} {strategy}"
        rows += len(truth[0])
    assert rows > 40


@pytest.mark.parametrize("seed", some_of(range(2)))
def test_changes_between_shots_are_seen(kernels: str, seed: int) -> None:
    """No visible set, cell list, tile or plane is older than the scene."""
    rng = np.random.default_rng([seed, 11])
    scene = some_scene(rng)
    for _ in range(4):
        scene.add(some_mask(rng, 50), rng.uniform(0, 150, 2))
    at = rng.uniform((-10, -10), (210, 170), (70, 2))
    for step in range(30):
        ids = scene.ids()
        some = rng.choice(ids, min(len(ids), 3), replace=False)
        change = step % 6
        if change == 0:
            scene.move(some, rng.uniform(0, 150, (len(some), 2)))
        elif change == 1:
            scene.set(some, layer=int(rng.integers(3)), categories=int(rng.integers(4)))
        elif change == 2:
            scene.set(some, angle=float(rng.uniform(0, 360)), scale=float(rng.choice([0.5, 1, 2])))
        elif change == 3 and len(ids) > 5:
            scene.remove(int(some[0]))
        elif change == 4:
            scene.add(some_mask(rng, 70), rng.uniform(0, 150, 2), role="occluder" if step % 4 else "hittable")
        for weapon, strategy in itertools.product((Point(), Disc(9), Disc(5, pierce=True)), STRATEGIES):
            assert fire(scene, weapon, at, strategy=strategy) == by_runs(scene, weapon, at), f"{step=} {weapon}"


def test_masks_come_and_go(kernels: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles of dropped masks are never those of new ones."""
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 0)
    monkeypatch.setattr(tiles, "ATLAS_SLACK", 0)
    rng = np.random.default_rng(3)
    scene, at = Scene((90, 90)), rng.uniform(0, 90, (40, 2))
    for _ in range(40):
        ids = [scene.add(some_mask(rng, 30), rng.uniform(0, 90, 2)) for _ in range(3)]
        for strategy in ("direct", "built"):
            assert fire(scene, Disc(6), at, strategy=strategy) == by_runs(scene, Disc(6), at)
        scene.remove(ids[:2])
        if len(scene) > 6:
            scene.remove(scene.ids()[:3])


def test_the_past_is_counted_as_it_was(kernels: str) -> None:
    rng = np.random.default_rng(4)
    scene = some_scene(rng)
    ids = [scene.add(some_mask(rng, 40), rng.uniform(0, 150, 2)) for _ in range(8)]
    history = History(scene)
    for tick in range(5):
        history.record(tick)
        scene.move(ids, rng.uniform(0, 150, (8, 2)))
    scene.remove(ids[:4])
    at, ticks = rng.uniform(0, 160, (60, 2)), rng.integers(0, 5, 60)
    for weapon in (Point(), Disc(9), Disc(9, pierce=True), Spread(Disc(2), 4, 9)):
        truth = by_runs(history, weapon, at, tick=ticks)
        for strategy in STRATEGIES:
            hits = fire(history, weapon, at, tick=ticks, strategy=strategy)
            assert hits == truth and truth and not hits.plan.has_run("verdicts"), f"{weapon} {strategy}"


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("weapon", [Point(), Disc(9), Spread(Disc(2, pierce=True), 4, 9)])
def test_verdicts_are_those_of_the_moment_of_the_shot(
    kernels: str, weapon: Weapon, strategy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are counted when they are asked for, of the scene and the shots as they were."""
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 0)
    monkeypatch.setattr(tiles, "ATLAS_SLACK", 0)
    rng = np.random.default_rng(6)
    scene = Scene((150, 150))
    ids = [scene.add(rng.random((20, 20)) < 0.7, rng.uniform(0, 150, 2), layer=i % 3) for i in range(30)]
    scene.set(ids[:5], role="occluder")
    at, accept, exclude = rng.uniform(-5, 155, (50, 2)), np.full(50, ALL), rng.integers(0, 30, 50)
    truth = [by_runs(scene, weapon, at), by_runs(scene, weapon, at, accept=accept, exclude=exclude)]
    kept = [hits.verdicts.copy() for hits in truth]
    late = [
        fire(scene, weapon, at, strategy=strategy),
        fire(scene, weapon, at, strategy=strategy, accept=accept, exclude=exclude),
    ]
    at[:], accept[:], exclude[:] = 0, 0, -1
    scene.move(ids, rng.uniform(0, 150, (30, 2)))
    scene.set(ids, layer=0, categories=0, angle=45)
    scene.remove(ids[3:])
    for _ in range(20):
        scene.add(rng.random((20, 20)) < 0.7, rng.uniform(0, 150, 2))
    fire(scene, weapon, at, strategy=strategy)
    for hits, verdicts in zip(late, kept, strict=True):
        assert np.array_equal(hits.verdicts, verdicts) and len(np.unique(verdicts[:, 1])) > 1
        assert not hits.verdicts.flags.writeable


@pytest.mark.parametrize("weapon", [Point(), Disc(9), Disc(9, pierce=True)])
def test_verdicts_are_those_of_before_a_move(kernels: str, weapon: Weapon) -> None:
    scene, rng = Scene((150, 150)), np.random.default_rng(3)
    ids = [scene.add(np.ones((20, 20), np.bool_), rng.uniform(0, 150, 2)) for _ in range(20)]
    scene.set(ids[:9], role="occluder")
    at = rng.uniform(0, 150, (40, 2))
    for strategy in STRATEGIES:
        truth = by_runs(scene, weapon, at).verdicts
        hits = fire(scene, weapon, at, strategy=strategy)
        scene.move(ids, rng.uniform(0, 150, (20, 2)))
        fire(scene, weapon, at, strategy="built").verdict_counts()
        assert np.array_equal(hits.verdicts, truth)


@pytest.mark.parametrize("way", ["tiles", "visible", "labels", "integers"])
def test_verdicts_are_counted_by_every_way(kernels: str, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ran, seen = [], 0
    monkeypatch.setattr(
        verdicts_module, "chosen_way", lambda _, request: ran.append(chosen_way(way, request)) or ran[-1]
    )
    rng = np.random.default_rng([9, len(way)])
    for _ in range(4):
        scene = some_scene(rng)
        for weapon in WEAPONS:
            at, how = some_shots(rng, scene)
            hits = fire(scene, weapon, at, **how)
            assert np.array_equal(hits.verdicts, by_runs(scene, weapon, at, **how).verdicts), f"{weapon} {how}"
            seen = seen + hits.verdicts.sum(axis=0)
    assert (way, kernels) == ("integers", "jit") or any(made.name == way for made, _ in ran)
    assert np.all(np.array(seen) > 500), seen


def test_no_shots_no_objects(kernels: str) -> None:
    scene = Scene((50, 50))
    for weapon, strategy in itertools.product(WEAPONS, STRATEGIES):
        assert not fire(scene, weapon, np.zeros((0, 2)), strategy=strategy)
        empty = fire(scene, weapon, [(9, 9), (70, 70)], strategy=strategy)
        assert not empty and empty.starts.tolist() == [0, 0, 0] and empty == by_runs(scene, weapon, [(9, 9), (70, 70)])
    item = scene.add(np.zeros((5, 100), np.bool_), (9, 9))
    for weapon, strategy in itertools.product(WEAPONS, STRATEGIES):
        assert not fire(scene, weapon, [(9, 9), (30, 9)], strategy=strategy)
    scene.set(item, role="occluder")
    assert not fire(scene, Disc(9), (9, 9))


def test_far_from_the_origin_of_the_world(kernels: str) -> None:
    """Positions near the limit, and objects as far apart as can be."""
    scene = Scene()
    far = 2.0**40
    ids = [scene.add(np.ones((70, 70), np.bool_), place) for place in ((-far + 99, 3), (far - 99, far - 99), (0, 0))]
    at = [(-far + 99, 3), (far - 99, far - 99), (5, 5), (far, far), (-far, -far)]
    for weapon, strategy in itertools.product((Point(), Disc(40), Spread(Disc(3), 4, 9)), STRATEGIES):
        hits = fire(scene, weapon, at, strategy=strategy)
        assert hits == by_runs(scene, weapon, at) and hits.object.tolist() == ids


def test_points_hit_no_occluder(jit: bool) -> None:
    """One code tells the item in front; which ids are objects follows roles, ids that went, and those that came."""
    scene = Scene((40, 20))
    for x in (5, 15, 25, 35):
        scene.add(Sprite.box(9, 9), (x, 9), role="occluder" if x in (15, 35) else "hittable")
    at = np.array([[5.0, 9], [15, 9], [25, 9], [35, 9]])

    def hit() -> list[int]:
        hits = fire(scene, Point(), at, strategy="built")
        assert way_of(hits) == "labels"
        return hits.object.tolist()

    assert hit() == [0, 2]
    scene.set([1], role="hittable")
    scene.set([2], role="occluder")
    assert hit() == [0, 1]
    scene.remove(1)
    scene.add(Sprite.box(9, 9), (15, 9))
    assert hit() == [0, 4]


@pytest.mark.parametrize("radius", [130, 113])
def test_large_discs_hit_the_nearest_pixel_of_what_is_far(radius: int) -> None:
    """Masks of a few pixels each, most of them near the edge of most discs."""
    rng = np.random.default_rng(radius)
    scene = Scene()
    for _ in range(20):
        mask = np.zeros((64, 64), np.bool_)
        mask[tuple(rng.integers(0, 64, (2, 4)))] = True
        scene.add(mask, rng.integers(0, 200, 2))
    turn, far = rng.uniform(0, 2 * np.pi, 300), rng.uniform(radius - 40, radius + 4, 300)
    at = rng.integers(0, 200, (300, 2)) + np.stack([np.cos(turn), np.sin(turn)], axis=1) * far[:, None]
    hits = fire(scene, Disc(radius), at, strategy="built")
    assert len(hits) > 1000 and hits == by_runs(scene, Disc(radius), at)


@pytest.mark.parametrize(
    ("name", "strategy", "pierce"), some_of(product(["disc", "spread", "ready"], ["direct", "built"], [False, True]), 5)
)
def test_a_shot_that_hits_hundreds_tells_them_in_order(name: str, strategy: str, pierce: bool, jit: bool) -> None:
    """Objects of one pixel, some on one another: the nearest first, by (y, x), front to back."""
    rng = np.random.default_rng(1)
    scene = Scene()
    places = rng.integers(-60, 60, (900, 2)).tolist()
    for place in places:
        scene.add([[True]], place)
    radius = 40
    weapon: Any = Disc(radius, pierce=pierce)
    if name == "spread":
        weapon = Spread(weapon, count=2, radius=0)
    if name == "ready":
        fire(scene, weapon, np.zeros((2, 2)), strategy=strategy)
        hits = prepare(scene, weapon).fire((0, 0))
    else:
        hits = fire(scene, weapon, (0, 0), strategy=strategy)
    expected, met = [], set()
    for item in range(len(places) - 1, -1, -1):
        x, y = places[item]
        if x * x + y * y <= radius * radius and (pierce or (x, y) not in met):
            expected.append((x * x + y * y, y, x, len(places) - item))
            met.add((x, y))
    expected.sort()
    assert len(expected) > 200
    found = [(row.distance2, row.first_xy[1], row.first_xy[0], len(places) - row.object) for row in hits]
    assert found == expected


@pytest.mark.parametrize("seed", [0, 1])
def test_rows_of_a_crowd_by_many_pellets_are_the_same_compiled(seed: int) -> None:
    """A pellet may hit an item at first behind, and then another the pixel that is nearest of it and one in front."""
    pytest.importorskip("numba")
    rng = np.random.default_rng(seed)
    scene = Scene()
    for place in rng.integers(-70, 70, (400, 2)).tolist():
        scene.add(rng.random((14, 14)) < 0.4, place)
    weapon, told = Spread(Disc(4, pierce=True), count=30, radius=60), []
    try:
        for on in (False, True):
            use_jit(on)
            told.append(fire(scene, weapon, np.zeros((3, 2)), seed=seed, strategy="built"))
    finally:
        use_jit(None)
    assert told[0] == told[1] and len(told[0]) > 300
