"""Carving: an object loses exactly the pixels that were hit, in any pose, and its holes go where it goes."""

from __future__ import annotations

import math
import pickle
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from hitplanes import (
    Disc,
    History,
    InputError,
    Pistol,
    Point,
    Projectile,
    Rifle,
    Scene,
    Spread,
    Sprite,
    fire,
    load_scene,
    prepare,
)  # fmt: skip
from hitplanes.planes.bits import tiles as tiles_module
from hitplanes.planes.bits.tiles import WORD, TileAtlas
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.scene.carving import cells_per_px
from hitplanes.planes.scene.items import Items

Pixels = set[tuple[int, int]]

RNG = np.random.default_rng(4)
PICTURE = RNG.integers(0, 256, (9, 24, 4), np.uint8)
SHAPES: dict[str, Callable[[], Sprite]] = {
    "mask": lambda: Sprite.from_mask(RNG.random((7, 11)) < 0.8, pivot_xy=(2.25, 9)),
    "solid": lambda: Sprite.from_mask(np.ones((7, 9), np.bool_)),
    "sheet": lambda: Sprite.from_image(PICTURE, grid_wh=(8, 9), alpha_threshold=60),
    "trimmed": lambda: Sprite.from_images(
        [PICTURE[:, :7], PICTURE[:5, 9:], PICTURE], alpha_threshold=30, pivot_xy=[(1, 2), (-3, 0.5), (11, 4)]
    ),
    "circle": lambda: Sprite.circle(6.5),
    "polygon": lambda: Sprite.polygon([(-7, -5), (9, -2), (3, 8)], [[(-1, -1), (2, -1), (1, 2)]]),
    "in steps": lambda: Sprite.polygon([(-7, -5), (9, -2), (3, 8)], angle_step=40),
}
POSES = st.fixed_dictionaries({
    "position_xy": st.tuples(*[st.integers(-2600, 2600).map(lambda v: v / 256)] * 2),
    "angle": st.sampled_from([0, 90, 180, -90, 45, 30, 271.5, 12.25]),
    "scale": st.sampled_from([(1, 1), (1, 1), (2, 2), (0.5, 0.5), (0.25, 0.25), (1.25, 1.25), (1, 3), (0.3, 2.5)]),
    "flip": st.sampled_from(["none", "x", "y", "xy"]),
})  # fmt: skip


def pixels_of(scene: Scene, item: int) -> Pixels:
    """World pixels of an object's mask, one by one."""
    mask, (x, y) = scene.mask(item)
    return {(x + int(i), y + int(j)) for j, i in np.argwhere(mask)}


def made_anew(scene: Scene) -> Scene:
    """The same scene from its pickle: its masks are made of the sprites again, and none comes from a cache."""
    return pickle.loads(pickle.dumps(scene))


def pose_again(scene: Scene, item: int, pose: dict[str, Any]) -> None:
    """`set` takes a pair of scales as a row."""
    scene.set(item, **{key: [value] if key == "scale" else value for key, value in pose.items()})


def samples_of_a_shot() -> Any:
    return fire(Scene(), Disc(2), (3, 3)).samples_at(0)


def rows(pixels: Pixels) -> np.ndarray:
    return np.array(sorted(pixels), np.int64).reshape(-1, 2)


# The law


@examples(60)
@given(st.sampled_from(sorted(SHAPES)), st.lists(POSES, min_size=1, max_size=3), st.integers(0, 10**6), st.data())
def test_an_object_loses_exactly_what_was_carved(
    kind: str, poses: list[dict[str, Any]], seed: int, data: st.DataObject
) -> None:
    rng, scene, sprite = random.Random(seed), Scene(), SHAPES[kind]()
    frame = data.draw(st.integers(0, sprite.frame_count - 1))
    item, other = scene.add(sprite, frame=frame), scene.add(sprite, frame=frame)
    whole = pixels_of(scene, other)
    for pose in poses:
        pose_again(scene, item, pose)
        before = pixels_of(scene, item)
        chosen = {p for p in before if rng.random() < rng.choice([0.1, 0.5, 0.9])}
        around = {(x + rng.randint(-9, 9), y + rng.randint(-9, 9)) for x, y in chosen}
        given_as: Any = rows(chosen | around)
        if rng.random() < 0.5:
            given_as = Spans.from_runs(given_as[:, 1], given_as[:, 0], given_as[:, 0])
        version = scene.version
        lost = scene.carve({item: given_as})
        expected = before - chosen - around
        assert pixels_of(scene, item) == expected == pixels_of(made_anew(scene), item)
        assert lost == {item: len(before) - len(expected)}
        assert scene.version == version + bool(lost[item])
        assert scene.position(item).tolist() == [float(v) for v in pose["position_xy"]]
        assert scene.angle(item) == pose["angle"] and scene.frame(item) == frame
    assert pixels_of(scene, other) == whole


WEAPONS: dict[str, Any] = {
    "disc": Disc(6),
    "spread": Spread(Disc(2), count=6, radius=9),
    "piercing": Disc(7, pierce=True),
    "pistol": Pistol(80),
    "rifle": Rifle(range=80, budget=9),
    "pellets": Spread(Pistol(80), count=5, radius=20),
    "thick": Projectile(60, radius=2),
}


@pytest.mark.parametrize("weapon", WEAPONS)
@pytest.mark.parametrize("count", [1, 25])
def test_shots_take_what_they_hit_and_hit_it_no_more(weapon: str, count: int) -> None:
    rng = np.random.default_rng(len(weapon))
    scene = Scene((90, 60))
    ids = [
        scene.add(SHAPES[kind](), (rng.uniform(5, 85), rng.uniform(5, 55)), angle=rng.choice([0, 33]), layer=k % 2,
                  scale=rng.choice([1, 1.5]), flip=rng.choice(["none", "x"]))
        for k, kind in enumerate([*SHAPES, *SHAPES])
    ]  # fmt: skip
    wall = scene.add(np.ones((30, 4), np.bool_), (40, 30), role="occluder", layer=1)
    at = np.stack([rng.uniform(0, 90, count), rng.uniform(0, 60, count)], axis=1)
    aims = rng.uniform(0, 360, count)
    hits = fire(scene, WEAPONS[weapon], at, aim=aims, seed=3)
    before = {item: pixels_of(scene, item) for item in (*ids, wall)}
    hit: dict[int, Pixels] = {item: set() for item in before}
    for shot in range(count):
        for (_, item), spans in hits.pixels_at(shot).items():
            hit[item] |= {(x, y) for x, y in spans.pixels().tolist()}
    assert {item: set(map(tuple, spans.pixels().tolist())) for item, spans in hits.object_pixels().items()} == {
        item: pixels for item, pixels in hit.items() if pixels
    }
    lost = scene.carve(hits)
    assert {item: pixels_of(scene, item) for item in before} == {i: before[i] - hit[i] for i in before}
    assert lost == {item: len(pixels) for item, pixels in hit.items() if pixels} and wall not in lost
    for shot in range(count):
        again = fire(scene, WEAPONS[weapon], at[shot], aim=aims[shot], seed=3, shot=shot)
        for (_, item), spans in again.pixels_at().items():
            assert not hit[item] & set(map(tuple, spans.pixels().tolist()))
    if count == 25:
        assert len(lost) > 2


# Where the holes are in other poses


@pytest.mark.parametrize("angle", [0, 90, 180, 30, 45, 200.5])
@pytest.mark.parametrize("scale", [1, 2, 0.5, 1.5])
@pytest.mark.parametrize("flip", ["none", "x", "xy"])
def test_a_frame_carved_upright_is_the_frame_without_these_pixels(angle: float, scale: float, flip: str) -> None:
    mask, hole = RNG.random((9, 14)) < 0.7, RNG.random((9, 14)) < 0.4
    scene = Scene()
    carved, drawn = scene.add(mask, (20, 20.5)), scene.add(mask & ~hole, (20, 20.5))
    y, x = np.nonzero(hole)
    left, top = np.array([20, 20.5]) - ((14 - 1) / 2, (9 - 1) / 2)
    scene.carve({carved: np.stack([x + math.floor(left + 0.5), y + math.floor(top + 0.5)], axis=1)})
    for item in (carved, drawn):
        scene.set(item, angle=angle, scale=scale, flip=flip)
    assert pixels_of(scene, carved) == pixels_of(scene, drawn) == pixels_of(made_anew(scene), carved)


@pytest.mark.parametrize("kind", ["solid", "circle", "polygon"])
@pytest.mark.parametrize("first", [{"angle": 30}, {"angle": 75, "scale": 2}, {"scale": (1.5, 3)}, {"angle": 200}])
def test_a_hole_turns_flips_and_grows_with_its_object(kind: str, first: dict[str, Any]) -> None:
    """Mapped back to the pose of the shot, what is missing lies at the hole, and what is there does not."""
    second = {"angle": 110, "scale": 2, "flip": "x"}
    scene = Scene()
    item = scene.add(SHAPES[kind](), (0, 0), **first)
    hole = {(x, y) for x, y in pixels_of(scene, item) if (x - 3) ** 2 + (y - 1) ** 2 <= 9}
    scene.carve({item: rows(hole)})
    pose_again(scene, item, second)
    whole = (other := Scene()).add(SHAPES[kind](), (0, 0), **second)
    missing = pixels_of(other, whole) - pixels_of(scene, item)
    assert missing and pixels_of(scene, item) <= pixels_of(other, whole)
    for x, y in pixels_of(other, whole):
        at = forward(*back(x, y, second), first)
        near = {p for p in around(at) if math.dist(p, at) < 2}  # the pivot of a scaled frame is rounded to half a px
        assert (near & hole) if (x, y) in missing else (near - hole)


def around(at: tuple[float, float]) -> Pixels:
    column, row = round(at[0]), round(at[1])
    return {(column + i, row + j) for i in range(-2, 3) for j in range(-2, 3)}


def back(x: float, y: float, pose: dict[str, Any]) -> tuple[float, float]:
    turn, (sx, sy) = math.radians(pose.get("angle", 0)), np.broadcast_to(pose.get("scale", 1), 2).tolist()
    u, v = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    return (-u if "x" in pose.get("flip", "none") else u) / sx, v / sy


def forward(u: float, v: float, pose: dict[str, Any]) -> tuple[float, float]:
    turn, (sx, sy) = math.radians(pose.get("angle", 0)), np.broadcast_to(pose.get("scale", 1), 2).tolist()
    u, v = u * sx, v * sy
    return u * math.cos(turn) - v * math.sin(turn), u * math.sin(turn) + v * math.cos(turn)


def test_no_crumbs_are_left_along_the_rim_of_what_is_gone() -> None:
    scene, first, second = Scene(), {"angle": 30}, {"angle": 77, "flip": "y"}
    item = scene.add(np.ones((21, 41), np.bool_), (0, 0), **first)
    scene.carve({item: rows({(x, y) for x, y in pixels_of(scene, item) if x < 0})})
    scene.set(item, **second)
    assert pixels_of(scene, item)
    assert all(forward(*unflipped(*back(x, y, second)), first)[0] > -1.5 for x, y in pixels_of(scene, item))


def unflipped(u: float, v: float) -> tuple[float, float]:
    """`back` knows no flip in y."""
    return u, -v


@pytest.mark.parametrize("kind", ["solid", "circle", "polygon", "in steps"])
@pytest.mark.parametrize("pose", [{"angle": 30}, {"angle": 45, "scale": 0.5}, {"scale": 1.75, "flip": "y"}, {}])
def test_of_what_is_wholly_shot_away_no_crumb_is_left_in_any_pose(kind: str, pose: dict[str, Any]) -> None:
    scene = Scene()
    item = scene.add(SHAPES[kind](), (3, 4), name="tank", **pose)
    scene.carve({item: rows(pixels_of(scene, item))})
    for angle in (*range(0, 360, 30), pose.get("angle", 0)):
        scene.set(item, angle=angle)
        assert scene.mask(item)[0].size == 0 and scene.box(item).tolist() == [0, 0, -1, -1]
    assert scene.find("tank") == item and len(scene) == 1
    assert not fire(scene, Disc(40), (3, 4)) and scene.carve({item: [[3, 4]]}) == {item: 0}
    scene.move(item, (9, 9))
    scene.set(item, sprite=SHAPES[kind]())
    assert fire(scene, Disc(40), (3, 4)).object.tolist() == [item]


def test_other_frames_and_other_objects_stay_whole() -> None:
    sprite = SHAPES["sheet"]()
    scene = Scene()
    item, other = scene.add(sprite, (5, 5), frame=1), scene.add(sprite, (5, 5), frame=1)
    scene.carve({item: rows(pixels_of(scene, item))})
    assert not pixels_of(scene, item) and pixels_of(scene, other)
    for frame in (0, 2):
        scene.set([item, other], frame=frame)
        assert pixels_of(scene, item) == pixels_of(scene, other)
    scene.set(item, frame=1)
    assert not pixels_of(scene, item)
    assert scene.sprite(other) is sprite and scene.sprite(item).frames is sprite.frames


def test_cells_are_as_fine_as_a_pose_needs_and_no_finer() -> None:
    scene = Scene()
    for pose, expected in (
        ({}, 1), ({"angle": 90, "flip": "x"}, 1), ({"angle": 30}, 2), ({"scale": 0.5, "angle": 30}, 1),
        ({"scale": 2}, 4), ({"scale": 256}, 512), ({"scale": 255, "angle": 1}, 512), ({"scale": (1, 0.5)}, 2),
    ):  # fmt: skip
        item = scene.add(np.ones((2, 2), np.bool_), **pose)
        assert cells_per_px(scene.items.transforms[item]) == expected


@pytest.mark.parametrize("pose", [{"scale": 40}, {"scale": (31, 0.7), "angle": 1}, {"scale": (0.004, 9), "angle": 88}])
def test_extreme_scales_keep_the_law(pose: dict[str, Any]) -> None:
    scene = Scene()
    item = scene.add(np.ones((3, 2), np.bool_), **pose)
    before = pixels_of(scene, item)
    chosen = set(random.Random(1).sample(sorted(before), min(len(before), 9)))
    scene.carve({item: rows(chosen)})
    assert pixels_of(made_anew(scene), item) == before - chosen


def test_a_picture_shows_the_holes() -> None:
    from hitplanes.planes.scene.variants import picture_of

    for pose in ({}, {"angle": 30}, {"scale": 2, "flip": "y"}):
        scene = Scene()
        item = scene.add(np.full((20, 30, 4), 255, np.uint8), (0, 0), **pose)
        scene.carve(fire(scene, Disc(5), (4, 2)))
        image, pivot_x, pivot_y = picture_of(scene.sprite(item), scene.items.transforms[item], (1, 2, 3))
        left, top = (-pivot_x + 128) // 256, (-pivot_y + 128) // 256
        drawn = {(left + int(i), top + int(j)) for j, i in np.argwhere(image[:, :, 3] > 0)}
        assert drawn == pixels_of(scene, item)


# What it goes with


def terrain() -> tuple[Scene, int, int]:
    scene = Scene((60, 40), categories=["rock"], name="hills")
    hill = scene.add(np.full((20, 40, 3), 120, np.uint8), (30, 25), name="hill")
    tank = scene.add(Sprite.box(12, 7), (20, 12), angle=20, layer=1, name="tank")
    return scene, hill, tank


def test_a_history_tells_the_masks_before() -> None:
    scene, hill, tank = terrain()
    history = History(scene, ticks=8, interpolate=True)
    history.record()
    was = {item: pixels_of(scene, item) for item in (hill, tank)}
    scene.carve(fire(scene, Disc(7), (24, 16)))
    scene.set(tank, angle=50)
    history.record()
    now = {item: pixels_of(scene, item) for item in (hill, tank)}
    assert all(now[item] != was[item] for item in was)
    for tick, expected in ((0, was), (1, now)):
        past = history.at(tick)
        assert {item: pixels_of(past, item) for item in expected} == expected
    assert pixels_of(history.at(0.5), tank) and fire(history, Disc(7), (24, 16), tick=0)
    with pytest.raises(InputError, match="read-only"):
        history.at(0).carve({hill: [[24, 16]]})
    with pytest.raises(InputError, match="hits: expected those of this scene as it is"):
        scene.carve(fire(history, Disc(7), (24, 16), tick=0))


def test_a_carved_scene_is_saved_loaded_copied_and_carved_again(tmp_path: Path) -> None:
    scene, _, tank = terrain()
    flag = scene.add(SHAPES["trimmed"](), (44, 9), frame=2, scale=1.25, angle=10, name="flag")
    disc = scene.add(Sprite.circle(5), (50, 30), flip="x", name="disc")
    for at in ((24, 16), (44, 9), (49, 31), (30, 25)):
        scene.carve(fire(scene, Disc(4), at))
    scene.set(flag, frame=0)
    scene.carve({flag: rows(pixels_of(scene, flag))[::3]})
    scene.set(flag, frame=2)
    for number in range(3):
        scene.save(tmp_path / "a")
        loaded = load_scene(tmp_path / "a")
        assert loaded.content_hash() == scene.content_hash() == scene.copy().content_hash()
        for one in (scene, loaded):
            one.set([tank, flag], angle=70 + number)
            one.set(flag, frame=[0, 2, 1][number])
            one.carve(fire(one, Disc(3), (21 + number, 12)))
        assert {i: pixels_of(loaded, i) for i in loaded} == {i: pixels_of(scene, i) for i in scene}
        scene = loaded
    assert disc in scene


@pytest.mark.parametrize("pose", [{}, {"angle": 30}])
def test_every_way_sees_the_carved_terrain(pose: dict[str, Any]) -> None:
    scene = Scene((80, 60))
    scene.add(np.ones((30, 60), np.bool_), (40, 35), **pose)
    tank = scene.add(np.ones((5, 9), np.bool_), (40, 30))
    ready, line = prepare(scene, Disc(2)), prepare(scene, Pistol(70))
    rng = np.random.default_rng(1)
    at = rng.uniform((0, 0), (80, 60), (120, 2))
    for step in range(4):
        for strategy in ("spans", "tiles", "visible"):
            assert fire(scene, Disc(2), at, strategy=strategy) == fire(made_anew(scene), Disc(2), at, strategy="spans")
        for strategy in ("walk", "cast", "march"):
            aimed = fire(scene, Pistol(70), at, aim=33, strategy=strategy)
            assert aimed == fire(made_anew(scene), Pistol(70), at, aim=33, strategy="walk")
        assert fire(scene, Point(), at, strategy="labels") == fire(made_anew(scene), Point(), at, strategy="spans")
        for place in at[:20]:
            assert ready.fire(tuple(place)) == fire(scene, Disc(2), place)
            assert line.fire(tuple(place), 33) == fire(scene, Pistol(70), place, aim=33)
        scene.carve(fire(scene, Disc(4), at[step * 5 : step * 5 + 5]))
        scene.move(tank, (40 + step, 30))


def test_holes_are_mapped_alike_by_compiled_kernels(jit: None) -> None:
    scene = Scene()
    item = scene.add(SHAPES["sheet"](), (0, 0), angle=20, frame=1)
    before = pixels_of(scene, item)
    scene.carve({item: rows(before)[::3]})
    assert pixels_of(made_anew(scene), item) == before - set(map(tuple, rows(before)[::3].tolist()))


# What is refused


# What is kept of masks


def tiles_of(items: Items) -> list[Any]:
    """Rank, box and rows of each tile of the stack."""
    return pictured(items.tiles())


def tiles_made_anew(items: Items) -> list[Any]:
    """The same of an atlas that has seen no mask before."""
    stack = items.stack()
    return pictured(TileAtlas().tiles(lambda rank: stack.mask(rank).copy(), np.arange(len(stack)), 0))


def pictured(tiles: Any) -> list[Any]:
    words = [tiles.words[begin - WORD : begin + 2 * WORD].tolist() for begin in tiles.begin.tolist()]
    return [tiles.rank.tolist(), tiles.inside_xyxy.tolist(), words, bool(tiles.whole)]


@examples(60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32), st.sampled_from([0, 4, 4096]), st.sampled_from([2, 1024]))
def test_tiles_of_carved_masks_are_those_made_anew(
    monkeypatch: pytest.MonkeyPatch, seed: int, slack: int, most: int
) -> None:
    """Whether they were read between two holes or not; also in the past, and of items that shared a mask."""
    monkeypatch.setattr(tiles_module, "ATLAS_SLACK", slack)
    monkeypatch.setattr(tiles_module, "PACKED_AT_ONCE", most)
    rng = random.Random(seed)
    scene = Scene()
    sprite = Sprite.from_mask(np.random.default_rng(seed).random((150, 200)) < rng.choice([0.02, 0.6, 1]))
    hills = [scene.add(sprite, (100, 75)), scene.add(sprite, (300, 75)), scene.add(Sprite.circle(70), (100, 300))]
    history, handed = History(scene, ticks=40), []
    for _ in range(rng.choice([4, 12, 30])):
        hill = rng.choice(hills)
        x, y, x_end, y_end = scene.box(hill).tolist()
        left, top = rng.randint(x - 9, x_end), rng.randint(y - 9, y_end)
        size = rng.choice([1, 9, 70])
        scene.carve({hill: [(left + i, top + j) for i in range(size) for j in range(rng.choice([1, size]))]})
        if rng.random() < 0.2:
            scene.add(sprite, (500, 75))
        if rng.random() < 0.5:
            history.record()
        if rng.random() < 0.5:
            assert tiles_of(scene.items) == tiles_made_anew(scene.items)
            handed.append((scene.items.tiles(), tiles_of(scene.items)))
        if history.ticks and rng.random() < 0.3:
            past = history.at(rng.choice(history.ticks)).items
            assert tiles_of(past) == tiles_made_anew(past)
    assert all(pictured(tiles) == told for tiles, told in handed), "tiles that were handed out changed"


def test_only_the_tiles_that_holes_meet_are_packed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several holes may be shot before the tiles are read again."""
    scene = Scene()
    hill = scene.add(np.ones((640, 1280), np.bool_), (640, 320))
    fire(scene, Disc(9), (100, 100), strategy="tiles")
    packed, inner = [], tiles_module.packed
    monkeypatch.setattr(tiles_module, "packed", lambda masks: packed.append(len(masks)) or inner(masks))
    for holes, expected in (([(32, 32)], 1), ([(200, 96), (200, 128), (330, 330)], 3), ([(128, 128)], 4)):
        for x, y in holes:
            scene.carve({hill: [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]})
        hits = fire(scene, Disc(9), holes[-1], strategy="tiles")
        assert hits == fire(made_anew(scene), Disc(9), holes[-1], strategy="spans")
        assert packed.pop(0) == expected and not packed


def test_masks_are_laid_out_when_something_reads_them_one_by_one() -> None:
    """Areas are fired at tiles. A stack of an earlier look, read for the first time now, tells the masks of then."""
    scene = Scene()
    hills = [scene.add(np.ones((90, 70 + i), np.bool_), (100 * i, 0)) for i in range(3)]
    stacks, masks = [], []
    for step in range(60):
        scene.carve({hills[step % 3]: [(100 * (step % 3) + step // 6, step % 7)]})
        assert fire(scene, Disc(2), (100 * (step % 3) + 20, 0), strategy="tiles")
        assert scene.items.atlas.later, "nothing of this asks for pixels"
        stacks.append(scene.items.stack())
        masks.append([scene.mask(i)[0] for i in stacks[-1].ids.tolist()])
        if step % 20 == 19:
            assert fire(scene, Pistol(200), (50, 0), aim=0) == fire(made_anew(scene), Pistol(200), (50, 0), aim=0)
            assert not scene.items.atlas.later
    assert len({id(stack.atlas) for stack in stacks}) == 1
    for stack, expected in zip(stacks[::-1], masks[::-1], strict=True):
        assert all(np.array_equal(stack.mask(rank), mask) for rank, mask in enumerate(expected))


def test_hits_must_be_of_the_scene_as_it_is() -> None:
    scene, _, tank = terrain()
    other = scene.copy()
    hits = fire(scene, Disc(7), (24, 16))
    with pytest.raises(InputError, match="hits: expected those of this scene as it is, got those of another"):
        other.carve(hits)
    scene.carve(hits)
    for stale in (hits, fire(other, Disc(1), (0, 0))):
        other.move(tank, (20, 12))
        with pytest.raises(InputError, match="read this before the scene changes"):
            stale.scene.carve(stale)


@pytest.mark.parametrize(
    ("pixels", "told"),
    [
        (5, "pixels: expected hits of this scene, or pixels of each id, got 5"),
        ({9: [[1, 1]]}, "id of pixels: expected a whole number from 0 to 1, got 9"),
        ({0: [[30, 25]], 1: [[1, 2, 3]]}, r"pixels\[1\]: expected shape \(any, 2\), got \(1, 3\)"),
        ({0: [[30, 25]], 1: [[1.5, 2]]}, r"pixels\[1\]\[0\]\[0\]: expected a whole number"),
        ({0: Spans([25], [30], [0.5])}, r"pixels\[0\]: x_last\[0\]: expected a whole number .*, got 0.5"),
        ({0: Spans(np.array([25.5]), np.array([3]), np.array([4]))}, r"pixels\[0\]: y\[0\]: expected a whole .*25.5"),
        ({0: Spans([25, 26], [3], [4])}, r"pixels\[0\]: x_first: expected shape \(2,\), got \(1,\)"),
        ({0: Spans([25], ["a"], [4])}, r"pixels\[0\]: x_first: expected numbers, got \['a'\]"),
        ({0: Spans(np.array([25]), np.array([-(2**63)]), np.array([40]))}, r"pixels\[0\]: x_first\[0\]: expected"),
        ({0: samples_of_a_shot()}, r"pixels\[0\]: expected Spans .*, got Samples: pass its \.xy$"),
        ({"hill": [[1, 1]]}, "id of pixels: expected a whole number from 0 to 1, got 'hill'"),
    ],
)
def test_bad_pixels_change_nothing(pixels: Any, told: str) -> None:
    scene, _, _ = terrain()
    version, content = scene.version, scene.content_hash()
    with pytest.raises(InputError, match=told):
        scene.carve(pixels)
    assert (scene.version, scene.content_hash()) == (version, content)


def test_runs_made_by_hand_are_carved() -> None:
    """As lists, out of order and overlapping."""
    runs = [(26, 20, 23), (25, 18, 30), (25, 28, 33), (26, 2, -5)]
    by_hand, made = (terrain()[0] for _ in range(2))
    y, x_first, x_last = map(list, zip(*runs, strict=True))
    lost = by_hand.carve({0: Spans(y, x_first, x_last)})  # type: ignore[arg-type]
    assert lost == made.carve({0: Spans.from_runs(y, x_first, x_last)}) == {0: 20}  # type: ignore[arg-type]
    assert by_hand.content_hash() == made.content_hash()


def test_a_sprite_too_large_to_be_cut_is_refused() -> None:
    scene = Scene()
    item = scene.add(np.ones((60, 80), np.bool_), (0, 0), scale=(64, 1))
    with pytest.raises(
        InputError, match=r"pixels\[0\]: sprite: expected one that can be cut into 128 x 128 cells a px"
    ):
        scene.carve({item: [[0, 0]]})


def test_a_removed_object_is_not_carved() -> None:
    scene, hill, _ = terrain()
    scene.remove(hill)
    with pytest.raises(InputError, match="expected an object in the scene, got 0, which was removed"):
        scene.carve({hill: [[1, 1]]})


def test_the_stack_is_not_sorted_anew_for_a_hole(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, _, _ = terrain()
    fire(scene, Disc(2), (24, 18))
    monkeypatch.setattr(Items, "stack_of", None)
    scene.carve(fire(scene, Disc(2), (24, 18)))
    hits = fire(scene, Disc(2), (24, 18))
    monkeypatch.undo()
    assert hits == fire(made_anew(scene), Disc(2), (24, 18))
