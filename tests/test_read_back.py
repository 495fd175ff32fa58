"""What was given to a scene can be read from it again; and scenes that are copied, pickled and given other sprites."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import Disc, History, InputError, Pistol, Scene, Sprite, fire, load_scene
from hitplanes.planes.scene.items import COLUMNS

ROOT = Path(__file__).parents[1]
FLAT, TALL = np.ones((2, 6), np.bool_), np.ones((8, 3), np.bool_)
SHEET = Sprite.from_image(np.full((4, 12, 4), 255, np.uint8), grid_wh=(4, 4))

POSES = st.fixed_dictionaries({
    "position_xy": st.tuples(*[st.integers(-9000, 9000).map(lambda v: v / 256)] * 2),
    "angle": st.sampled_from([0.0, 30.0, -45.5, 90.0, 720.25]),
    "scale": st.sampled_from([(1.0, 1.0), (2.0, 0.5), (1.5, 1.25)]),
    "flip": st.sampled_from(["none", "x", "y", "xy"]),
    "frame": st.integers(0, 2),
    "layer": st.integers(-5, 5),
    "role": st.sampled_from(["background", "hittable", "mover", "occluder", "hud"]),
    "categories": st.sampled_from([["tank"], ["wall", "default"], 5]),
    "cost": st.integers(0, 255),
    "velocity_xy": st.tuples(*[st.integers(-900, 900).map(lambda v: v / 256)] * 2),
})  # fmt: skip

READ: dict[str, Callable[[Scene, Any], Any]] = {
    "position_xy": Scene.position,
    "angle": Scene.angle,
    "scale": Scene.scale,
    "flip": Scene.flip,
    "frame": Scene.frame,
    "layer": Scene.layer,
    "role": Scene.role,
    "categories": Scene.categories_of,
    "cost": Scene.cost,
    "velocity_xy": Scene.velocity,
}


def arena() -> Scene:
    return Scene((90, 60), categories=["tank", "wall"], name="arena")


def answers(scene: Scene) -> list[Any]:
    """What shots of every kind hit."""
    at = np.mgrid[0:90:15, 0:60:15].reshape(2, -1).T
    fired = [fire(scene, Disc(9), at), fire(scene, Pistol(60), at, aim=33), fire(scene, Disc(9, pierce=True), at)]
    return [[column.tolist() for column in (hits.shot, hits.object, hits.first_xy, hits.pixels)] for hits in fired]


# What was given


@examples(60)
@given(st.lists(POSES, min_size=1, max_size=5))
def test_what_was_given_is_read(poses: list[dict[str, Any]]) -> None:
    scene = arena()
    ids = [scene.add(SHEET, **pose) for pose in poses]
    for key, read in READ.items():
        expected = [scene.category_bits(*v) if isinstance(v, list) else v for v in (pose[key] for pose in poses)]
        assert read(scene, ids).tolist() == [list(v) if isinstance(v, tuple) else v for v in expected]
        for item, value in zip(ids, expected, strict=True):
            assert read(scene, item).tolist() == (list(value) if isinstance(value, tuple) else value)
    assert scene.owner(ids).tolist() == ids and [scene.sprite(item) for item in ids] == [SHEET] * len(ids)
    for item in ids:
        mask, (x, y) = scene.mask(item)
        assert scene.box(item).tolist() == [x, y, x + mask.shape[1] - 1, y + mask.shape[0] - 1]


def test_ids_may_come_again_and_be_none_and_of_any_shape_of_list() -> None:
    scene = arena()
    a, b = scene.add(FLAT, (9, 9)), scene.add(TALL, (30.5, 20), owner=0, angle=90)
    assert scene.position([b, a, b]).tolist() == [[30.5, 20], [9, 9], [30.5, 20]]
    assert scene.owner(np.array([b, b])).tolist() == [a, a]
    for read in (*READ.values(), Scene.owner, Scene.box):
        assert len(read(scene, [])) == 0
    assert scene.box(scene.add(np.zeros((3, 3), np.bool_), (5, 5))).tolist() == [0, 0, -1, -1]


def test_what_is_read_is_the_callers_own() -> None:
    scene = arena()
    item = scene.add(FLAT, (9, 9), layer=2)
    for read in (Scene.position, Scene.layer, Scene.categories_of, Scene.velocity, Scene.box, Scene.cost):
        read(scene, [item])[:] = 7
    assert scene.position(item).tolist() == [9, 9] and scene.layer(item) == 2 and scene.cost(item) == 1


def test_objects_are_told_by_id() -> None:
    scene = arena()
    a, b, c = scene.add(FLAT, (9, 9)), scene.add(TALL, (30, 20), role="occluder"), scene.add(FLAT, (1, 1))
    assert list(scene) == [a, b, c] and np.int64(b) in scene
    scene.remove(b)
    assert list(scene) == [a, c] and b not in scene and 99 not in scene and -1 not in scene and "a" not in scene
    assert repr(scene) == "<Scene 'arena', bounds (0, 0, 89, 59): 2 hittable>"
    assert repr(Scene()) == "<Scene 'scene', bounds None: empty>"
    with pytest.raises(InputError, match=r"ids\[1\]: expected an object in the scene, got 1, which was removed"):
        scene.position([a, b])
    with pytest.raises(InputError, match=r"ids: expected a whole number from 0 to 2, got 7"):
        scene.layer(7)
    scene.rename(c, "boss")
    assert scene.find("boss") == c
    with pytest.raises(InputError, match="name: expected a text"):
        scene.rename(c, "")


def test_a_name_of_the_past_stays() -> None:
    scene = arena()
    item = scene.add(FLAT, (9, 9), name="before")
    history = History(scene, ticks=4)
    history.record()
    scene.rename(item, "after")
    history.record()
    assert [history.at(tick).name_of(item) for tick in (0, 1)] == ["before", "after"]


# Other sprites


def test_an_object_takes_another_sprite_and_keeps_its_id_and_pose() -> None:
    scene = arena()
    tank, other = (scene.add(FLAT, (x, 30), angle=90, layer=3) for x in (30, 60))
    before = answers(scene)
    scene.set(tank, sprite=TALL)
    fresh = arena()
    fresh.add(TALL, (30, 30), angle=90, layer=3)
    fresh.add(FLAT, (60, 30), angle=90, layer=3)
    assert answers(scene) == answers(fresh) != before and scene.content_hash() == fresh.content_hash()
    assert scene.position(tank).tolist() == [30, 30] and scene.angle(tank) == 90
    scene.set([tank, other], sprite=[Sprite.from_mask(FLAT), TALL], angle=[0, 45])
    again = arena()
    again.add(FLAT, (30, 30), layer=3)
    again.add(TALL, (60, 30), angle=45, layer=3)
    assert answers(scene) == answers(again)
    scene.set([tank, other], sprite=TALL)
    assert scene.sprite(tank) is scene.sprite(other)


def test_a_sprite_in_steps_turns_the_pose_it_gets() -> None:
    scene = arena()
    tank = scene.add(TALL, (30, 30), angle=40)
    scene.set(tank, sprite=Sprite.from_mask(TALL, angle_step=90))
    assert scene.mask(tank)[0].shape == TALL.shape and scene.angle(tank) == 40


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"sprite": FLAT}, "row 0: frame: expected one of the new sprite, as the object shows frame 2"),
        ({"sprite": [FLAT, TALL, FLAT], "frame": 0}, r"sprite: expected one for all or 2, got 3"),
        ({"sprite": [FLAT, 5], "frame": 0}, r"row 1: .*got"),
        ({"sprite": "tank.png"}, r"expected a Sprite"),
    ],
)
def test_a_sprite_that_does_not_fit_changes_nothing(change: dict[str, Any], told: str) -> None:
    scene = arena()
    ids = [scene.add(SHEET, (x, 30), frame=2) for x in (30, 60)]
    before, version = answers(scene), scene.version
    with pytest.raises(InputError, match=told):
        scene.set(ids, **change)
    assert answers(scene) == before and scene.version == version


# Copies


WAYS: dict[str, Callable[[Scene], Scene]] = {
    "copy": Scene.copy,
    "copy.copy": copy.copy,
    "copy.deepcopy": copy.deepcopy,
    "pickle": lambda scene: pickle.loads(pickle.dumps(scene)),
}


def crowded() -> Scene:
    scene = arena()
    ids = [scene.add(SHEET, (9 * i, 7 * i), angle=11 * i, frame=i % 3, layer=i % 2) for i in range(8)]
    scene.add(TALL, (44, 33), role="occluder", layer=1, categories=["wall"], owner=2, velocity_xy=(1, 2), cost=7)
    scene.remove(ids[3])
    scene.weapons, scene.shots = {"blast": Disc(4).to_json()}, [{"weapon": "blast", "at": [1, 2]}]
    return scene


@pytest.mark.parametrize("way", WAYS)
def test_a_copy_answers_alike_and_goes_its_own_way(way: str) -> None:
    scene = crowded()
    before = answers(scene)
    made = WAYS[way](scene)
    assert answers(made) == before and made.content_hash() == scene.content_hash()
    assert list(made) == list(scene) and repr(made) == repr(scene) and made.categories == scene.categories
    assert [made.name_of(i) for i in range(9)] == [scene.name_of(i) for i in range(9)]
    assert made.items.table.living == scene.items.table.living == len(made) == 8
    for name in COLUMNS:
        if name not in ("offset", "mask"):
            mine, its = (getattr(items, name)[items.rows] for items in (scene.items, made.items))
            assert (its == mine).all(), name
    assert (made.weapons, made.shots) == (scene.weapons, scene.shots)

    made.move(list(made), (80, 50))
    made.set(0, angle=5)
    made.remove(1)
    made.rename(2, "other")
    made.shots.clear()
    made.weapons["blast"]["radius"] = 99
    assert answers(scene) == before and answers(made) != before
    assert scene.name_of(2) != "other" and scene.shots and scene.weapons["blast"]["radius"] == 4
    assert made.add(FLAT, (1, 1)) == scene.add(FLAT, (1, 1)) == 9


def test_a_copy_of_the_past_can_be_changed() -> None:
    scene = crowded()
    history = History(scene, ticks=4, interpolate=True)
    history.record()
    scene.set(list(scene), angle=80, position_xy=(44, 30))
    history.record()
    for tick in (0, 0.5, 1):
        past = history.at(tick)
        for way in WAYS.values():
            made = way(past)
            assert answers(made) == answers(past)
            made.move(0, (3, 3))
            assert made.position(0).tolist() == [3, 3]
    assert scene.position(0).tolist() == [44, 30]


def test_a_pickle_answers_alike_in_another_process(tmp_path: Path) -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    (tmp_path / "scene.pickle").write_bytes(pickle.dumps(scene))
    code = f"""
import pickle
from hitplanes import Disc, Scene, fire
own = Scene()
own.add([[True] * 9] * 9, (5, 5))
with open({str(tmp_path / "scene.pickle")!r}, "rb") as file:
    scene = pickle.load(file)
print(scene.content_hash(), fire(scene, Disc(40), (200, 100)).object.tolist(), fire(own, Disc(2), (5, 5)).pixels)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    expected = fire(scene, Disc(40), (200, 100)).object.tolist()
    assert expected and done.stdout.split("\n")[0].startswith(f"{scene.content_hash()} {expected} [")
