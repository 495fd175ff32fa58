"""A few shots, counted in integers: pictures by hand, and the rows of the arrays on random piles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_bitfire import some_scene, some_shots

from hitplanes import Box, Disc, Rounds, Scene, Sprite, Stencil, Weapon, fire, prepare, use_jit
from hitplanes.planes.bits.tiles import BigTiles, big_pattern
from hitplanes.planes.grid.spans import Spans
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
    glass = rows_of(fire(scene, Box(3, 1), [(1, 0), (5, 0), (-1, 1), (0, 1)], exclude=[b, b, a, 99]))
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
        Disc(9.3), Disc(12, pierce=True), Disc(40), Box(5, 4), Stencil([".."]), Rounds(Disc(5), 3, (3, 2))
    ]  # fmt: skip
    for _ in range(120):
        scene = some_scene(rng, 40, 20)
        weapon = weapons[rng.integers(len(weapons))]
        at, how = some_shots(rng, scene, 9)
        hits = fire(scene, weapon, at, **how)
        assert hits == fire(scene, weapon, at, strategy="direct", **how)
        rows += len(hits)
    assert rows > 100


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


def test_where_all_moves_no_square_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shots walk; when the scene stands still for twice as many of them as before, squares are made."""
    scene, rng = Scene((400, 400)), np.random.default_rng(1)
    ids = [scene.add(Sprite.circle(9), rng.uniform(0, 400, 2)) for _ in range(60)]
    made: list[tuple[int, int]] = []
    real = position_cache.PositionCache._found
    monkeypatch.setattr(
        position_cache.PositionCache, "_found", lambda own, i, j: made.append((i, j)) or real(own, i, j)
    )
    ready = prepare(scene, Disc(20))

    def shots(count: int) -> None:
        for x, y in rng.uniform(0, 400, (count, 2)).tolist():
            assert ready.fire((x, y)) == fire(scene, Disc(20), (x, y))

    shots(9)
    assert made
    for _ in range(5):
        scene.move(ids, rng.uniform(0, 400, (60, 2)))
        made.clear()
        shots(9)
    assert not made
    scene.move(ids[:3], rng.uniform(0, 400, (3, 2)))  # a change of a few is not one of all
    shots(20)
    assert made
    made.clear()
    scene.move(ids, rng.uniform(0, 400, (60, 2)))
    for _ in range(position_cache.WALKS_LEAST + 1):
        assert ready.fire((5, 5)) == fire(scene, Disc(20), (5, 5))
    assert made == [(0, 0)]


@pytest.mark.parametrize(
    ("count", "moved", "times", "all_of_it"),
    [(1, 1, 1, True), (8, 8, 1, True), (12, 8, 1, False), (60, 16, 1, True), (60, 8, 3, False)],
)
def test_what_counts_as_all_that_moved(
    count: int, moved: int, times: int, all_of_it: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of a few, or more than a quarter of many; one that moved several times is one."""
    scene = Scene((400, 400))
    ids = [scene.add(Sprite.circle(9), (6.0 * k, 100)) for k in range(count)]
    walked: list[int] = []
    real = position_cache.hit_by_one
    monkeypatch.setattr(position_cache, "hit_by_one", lambda *told: walked.append(1) or real(*told))
    ready = prepare(scene, Disc(20))
    for k in range(4):
        assert ready.fire((70, 90)) == fire(scene, Disc(20), (70, 90))
        assert len(walked) == (k if all_of_it else 0)
        for _ in range(times):
            scene.move(ids[:moved], [(6.0 * i, 100 + k) for i in range(moved)])


def test_at_a_scene_that_stands_still_nothing_is_walked() -> None:
    """Nor are all masks made into tiles for it: a square needs what lies near it."""
    scene = Scene((4000, 4000))
    for k in range(5):
        scene.add(Sprite.box(3000, 40), (2000, 400 * k))
    far = scene.add(Sprite.circle(9), (3900, 3900))
    for weapon in (Disc(20), Disc(90)):
        ready = prepare(scene, weapon)
        for k in range(5):
            assert len(ready.fire((500, 10 + k))) == 1
            scene.move(far, (3900 - k, 3900))
        assert not scene.items._tiles


def test_where_much_is_near_large_patterns_go_the_way_of_fire() -> None:
    """Where all moves neither integers nor squares are made of what arrays answer sooner."""
    scene, rng = Scene((400, 400)), np.random.default_rng(1)
    ids = [scene.add(Sprite.circle(9), rng.uniform(0, 400, 2)) for _ in range(60)]
    ready = prepare(scene, Disc(150))
    assert ready.fire((200, 200)).plan.ran[0].name == "prepared"
    for k in range(9):
        scene.move(ids, rng.uniform(0, 400, (60, 2)))
        for at, first in (((200, 200 + k), "shots"), ((-90, -90), "prepared")):
            hits = ready.fire(at)
            assert hits == fire(scene, Disc(150), at)
            assert hits.plan.ran[0].name == first
    for _ in range(99):
        assert ready.fire((-90, -90)) == fire(scene, Disc(150), (-90, -90))
    assert ready.fire((200, 200)).plan.ran[0].name == "shots"
    scene.move(ids, [(390, 390)] * 60)  # nothing is crowded now
    for _ in range(300):
        assert not ready.fire((20, 20))
    assert any(vars(ready)["_squares"].made.values())


def test_shots_that_walked_before_all_moved_are_not_counted() -> None:
    scene = Scene((400, 400))
    ids = [scene.add(Sprite.circle(9), (6.0 * k, 100)) for k in range(9)]
    ready: Any = prepare(scene, Disc(20))
    for k in range(9):
        for _ in range(position_cache.WALKS_LEAST - 1):
            assert ready.fire((70, 90)) == fire(scene, Disc(20), (70, 90))
        assert not k or not any(ready._squares.made.values())
        scene.move(ids, [(6.0 * i, 100 + k) for i in range(9)])


@pytest.mark.usefixtures("fixed_costs")
def test_many_near_tiles_are_left_to_arrays() -> None:
    scene = Scene((400, 400))
    for k in range(40):
        scene.add(Sprite.circle(9), (170 + k, 200))
    few, many = (fire(scene, Disc(40), [(200, 200 + k) for k in range(shots)]) for shots in (1, 9))
    assert [is_few(few), is_few(many)] == [True, False] and many.of(0) == list(few)
