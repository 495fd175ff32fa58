"""A few shots, counted in integers: pictures by hand, and the rows of the arrays on random piles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_areas import some_scene, some_shots

from hitplanes import Box, Disc, Rounds, Scene, Sprite, Stencil, Weapon, fire, prepare, use_jit
from hitplanes.planes.bits.tiles import BigTiles, big_pattern
from hitplanes.planes.common import costs
from hitplanes.planes.grid.spans import Spans
from hitplanes.weapons.kinds.weapon import Pattern, big_of, big_of_bits, pattern_bits_of
from hitplanes.weapons.prepared import position_cache


@pytest.fixture(autouse=True)
def in_numpy() -> Any:
    use_jit(False)
    yield
    use_jit(None)


def is_few(hits: Any) -> bool:
    """Whether the plan tells that the shots were counted in integers."""
    return any(stage.name == "samples" and stage.why.startswith("counted in integers") for stage in hits.plan.ran)


def rows_of(hits: Any) -> list[tuple[int, int, int, tuple[int, int], int]]:
    assert is_few(hits)
    return [(row.shot, row.object, row.samples, row.first_xy, row.distance2) for row in hits]


def test_a_picture_by_hand() -> None:
    """The wall takes its column of the box; the front object a pixel of the one behind; outside nothing is hit.

        x  0 1 2 3 4 5 6
    y = 0  a a | b b . .
    y = 1  a a | b b c c
    y = 2  . . | . . c c
    """
    scene = Scene((7, 3))
    b = scene.add(np.ones((2, 2), np.bool_), (3.5, 0.5))
    c = scene.add(np.ones((2, 3), np.bool_), (5, 1.5))  # its first column lies under b
    a = scene.add(np.ones((2, 2), np.bool_), (0.5, 0.5))
    scene.set([b], layer=1)
    scene.add(np.ones((3, 1), np.bool_), (2, 1), role="occluder", layer=2)
    every = rows_of(fire(scene, Box(15, 9), (3, 1)))
    assert every == [(0, b, 4, (3, 1), 0), (0, c, 5, (4, 2), 2), (0, a, 4, (1, 1), 4)]
    pierced = rows_of(fire(scene, Box(15, 9, pierce=True), (3, 1)))
    assert pierced == [(0, b, 4, (3, 1), 0), (0, c, 6, (4, 1), 1), (0, a, 4, (1, 1), 4)]
    glass = rows_of(fire(scene, Box(3, 1), [(1, 0), (5, 0), (-1, 1), (0, 1)], exclude=[b, b, a, -1]))
    assert glass == [(0, a, 2, (1, 0), 0), (3, a, 2, (0, 1), 0)]


@pytest.mark.parametrize("far", [0, 2**31, -(2**39)])
def test_wide_masks_are_counted_once(far: int) -> None:
    """Of an object in several tiles: one row, the nearest pixel of all of them."""
    scene = Scene()
    wide = scene.add(np.ones((70, 200), np.bool_), (far, far))
    near = [(x, y) for x in range(-40, 41) for y in range(-40, 41) if x * x + y * y <= 1600]
    samples = [sum(-99 <= x + at <= 100 and -34 <= y <= 35 for x, y in near) for at in (-120, 34)]
    hits = fire(scene, Rounds(Disc(40), 2, (154, 0)), (far - 120, far))
    assert rows_of(hits) == [
        (0, wide, samples[0], (far - 99, far), 21 * 21), (0, wide, samples[1], (far + 34, far), 0)
    ]  # fmt: skip
    assert hits.round.tolist() == [0, 1]


def test_random_piles() -> None:
    """Filters, layers, bounds, wide masks, single pixels; a few shots at a time."""
    rng, rows = np.random.default_rng(4), 0
    weapons: list[Weapon] = [
        Disc(9.3), Disc(12, pierce=True), Disc(40), Box(5, 4), Stencil([".."]), Rounds(Disc(5), 3, (3, 2)),
        Disc(30, falloff="linear"), Box(41, 7, falloff="smooth"), Rounds(Disc(11, falloff="smooth"), 2, (5, 0)),
    ]  # fmt: skip
    for _ in range(120):
        scene = some_scene(rng, 40, 20)
        weapon = weapons[rng.integers(len(weapons))]
        at, how = some_shots(rng, scene, 9)
        hits = fire(scene, weapon, at, **how)
        assert hits == fire(scene, weapon, at, strategy="direct", **how)
        rows += len(hits)
    assert rows > 100


def test_weights_of_a_subset_are_added_up_with_planes_and_without() -> None:
    rng = np.random.default_rng(5)
    spans, weights = Spans.from_mask(rng.random((9, 80)) < 0.7, (-3, -4)), rng.integers(0, 65536, 700)
    pattern = big_of(Pattern(spans, np.cumsum([0, *weights[: spans.count]])))
    before = pattern.nbytes
    for _ in range(20):
        chosen = rng.random(spans.count) < rng.random()
        rows = sum(1 << int(y + 4) * pattern.stride + int(x + 3) for x, y in spans.pixels()[chosen].tolist())
        assert pattern.share(rows, int(chosen.sum())) == int(weights[: spans.count][chosen].sum())
    assert before == pattern.nbytes > big_pattern(spans).nbytes
    assert big_pattern(spans).share(0b101, 2) == 2 * 65535


def test_a_pattern_without_pixels_has_no_weights_to_add_up() -> None:
    nothing, full = (
        Pattern(Spans.empty(), np.zeros(1, np.int64)),
        Pattern(Spans.from_mask(np.ones((2, 3), np.bool_)), np.arange(7)),
    )
    bits = pattern_bits_of([full, nothing])
    assert big_of(nothing).rows == big_of_bits(bits, 1).rows == 0
    assert big_of_bits(bits, 0).share(big_of(full).rows, 6) == 6


@pytest.mark.parametrize("bounds", [(-9, -9, 9, 9), (-2, -9, 9, 9), (-9, 0, 9, 9), (-9, -9, 1, 9), (-9, -9, 9, -1)])
@pytest.mark.parametrize("at", [(0, 0), (2, -3)])
def test_patterns_within_bounds(bounds: tuple[int, int, int, int], at: tuple[int, int]) -> None:
    spans = Spans.from_mask(np.random.default_rng(2).random((6, 80)) < 0.5, (-3, -4))
    pattern = big_pattern(spans)
    assert pattern.stride == 192 and pattern.wide + 63 <= pattern.stride
    pixels = spans.pixels() + at
    inside = ((pixels >= bounds[:2]) & (pixels <= bounds[2:])).all(axis=1)
    truth = sum(1 << int(y - at[1] + 4) * 192 + int(x - at[0] + 3) for x, y in pixels[inside].tolist())
    assert pattern.within(*at, bounds) == truth
    assert pattern.within(50, 50, bounds) == 0


def test_tiles_as_integers_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.bits.tiles.TILES_BYTES_MOST", 4 * 64 * 16)
    words = np.arange(9 * 64, dtype=np.uint64)
    tiles = BigTiles(128)
    for begin in range(0, 8 * 64, 64):
        assert tiles.read(words, begin) == sum(int(words[begin + row]) << 128 * row for row in range(64))
        assert len(tiles) <= 5


def test_masks_that_are_no_longer_used_leave_no_integers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their places in the atlas are those of other masks later."""
    monkeypatch.setattr("hitplanes.planes.bits.tiles.ATLAS_SLACK", 0)
    rng, scene, dropped = np.random.default_rng(3), Scene((60, 60)), 0
    for k in range(30):
        ids = [scene.add(rng.random((9, 9)) < 0.5, rng.uniform(20, 40, 2)) for _ in range(1 + k % 7)]
        places = scene.items.tiles().bigs
        assert fire(scene, Disc(15), (30, 30)) == fire(scene, Disc(15), (30, 30), strategy="direct")
        scene.remove(ids)
        dropped += scene.items.tiles().bigs is not places
    assert dropped > 3


@pytest.mark.usefixtures("fixed_costs")
def test_squares_are_made_once_the_visible_set_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shots walk, and what they lose is counted anew after each change, until they lost as much as the set takes."""
    scene, rng = Scene((400, 400)), np.random.default_rng(1)
    ids = [scene.add(Sprite.circle(9), rng.uniform(0, 400, 2)) for _ in range(60)]
    made: list[tuple[int, ...]] = []
    real = position_cache.PositionCache._square
    monkeypatch.setattr(position_cache.PositionCache, "_square", lambda *told: made.append(told[2:]) or real(*told))
    ready: Any = prepare(scene, Disc(20))

    def shots(count: int) -> None:
        for x, y in rng.uniform(0, 400, (count, 2)).tolist():
            assert ready.fire((x, y)) == fire(scene, Disc(20), (x, y), strategy="spans")

    for _ in range(30):
        scene.move(ids, rng.uniform(0, 400, (60, 2)))
        shots(9)
    assert not made
    cost = costs.NUMPY.visible_made + 60 * costs.NUMPY.visible_tile
    shots(int(cost / costs.NUMPY.integers_placement) + 1)
    assert made and any(ready._near.made.values())
    scene.move(ids[0], (5, 5))
    made.clear()
    shots(9)
    assert not made and not any(ready._near.made.values())


def test_a_visible_set_that_is_there_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of `fire`, if it was made of the scene as it is."""
    monkeypatch.setattr(position_cache, "hit_by_one", lambda *_: pytest.fail("walked"))
    scene, rng = Scene((400, 400)), np.random.default_rng(1)
    ids = [scene.add(Sprite.circle(9), rng.uniform(0, 400, 2)) for _ in range(60)]
    ready = prepare(scene, Disc(20), exclude=3)
    for _ in range(3):
        scene.move(ids, rng.uniform(0, 400, (60, 2)))
        truth = fire(scene, Disc(20), (200, 200), exclude=3, strategy="visible")
        assert ready.fire((200, 200)) == truth


def test_where_much_is_near_large_patterns_go_the_way_of_fire() -> None:
    """Whether shots walk, or look up squares."""
    scene, rng = Scene((400, 400)), np.random.default_rng(1)
    ids = [scene.add(Sprite.circle(9), rng.uniform(0, 400, 2)) for _ in range(60)]
    ready: Any = prepare(scene, Disc(150))
    for k in range(9):
        scene.move(ids, rng.uniform(0, 400, (60, 2)))
        for strategy in ("spans", "visible"):
            for at, first in (((200, 200 + k), "shots"), ((-90, -90), "prepared")):
                truth = fire(scene, Disc(150), at, strategy=strategy)
                hits = ready.fire(at)
                assert hits == truth and hits.plan.ran[0].name == first
    scene.move(ids, [(390, 390)] * 60)  # nothing is crowded now
    assert not ready.fire((20, 20))


@pytest.mark.usefixtures("fixed_costs")
def test_many_near_tiles_are_left_to_arrays() -> None:
    scene = Scene((400, 400))
    for k in range(40):
        scene.add(Sprite.circle(9), (170 + k, 200))
    few, many = (fire(scene, Disc(40), [(200, 200 + k) for k in range(shots)]) for shots in (1, 9))
    assert [is_few(few), is_few(many)] == [True, False] and many.of(0) == list(few)
