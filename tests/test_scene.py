"""The scene: what is placed, how it is changed, all or nothing, and what it gives out."""

import gc
import itertools
import math
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from weakref import ref

import numpy as np
import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from test_label_plane import changed_boxes

from hitplanes import Disc, Laser, Point, fire
from hitplanes.planes.common.backend import LruCache
from hitplanes.planes.common.checks import InputError
from hitplanes.planes.common.limits import ALL
from hitplanes.planes.files.scene_folder import load_scene
from hitplanes.planes.scene.history import History
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.render import Planes
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite

DOT = np.ones((1, 1), np.bool_)
BLOCK = np.ones((2, 3), np.bool_)
FIELDS = {"background": "background", "hittable": "hittable", "mover": "movers", "occluder": "occluders", "hud": "hud"}


def sheet() -> Sprite:
    """Two frames of 2 x 2: full, and one pixel."""
    image = np.zeros((2, 4, 4), np.uint8)
    image[:, :2] = 255
    image[1, 3] = 255
    return Sprite.from_image(image, grid_wh=(2, 2))


def three() -> Scene:
    """Three dots in a row, ids 0 to 2."""
    scene = Scene((8, 4), categories=["target", "glass"])
    for x in range(3):
        scene.add(DOT, (x, 1), name="abc"[x])
    return scene


def pixels(scene: Scene, item: int) -> set[tuple[int, int]]:
    mask, (x, y) = scene.mask(item)
    return {(int(column) + x, int(row) + y) for row, column in np.argwhere(mask)}


def state(scene: Scene) -> list[Any]:
    """All that a change could reach."""
    items = scene.items
    masks = [pixels(scene, i) for i in scene.ids().tolist()]
    columns = [
        getattr(items, c)[: items.table.height].tolist() for c in ("size_wh", "role", "layer", "categories", "owner")
    ]
    lists = [len(v) for v in (items.sprites, items.transforms, items.angles, items.variants, items.names)]
    return [items.count, len(scene), items.version, masks, columns, list(items.angles), list(items.transforms), lists]


# Adding and removing


def test_ids_count_up_and_are_never_used_again() -> None:
    scene = three()
    scene.remove(1)
    assert scene.add(DOT) == 3
    scene.remove([3, 0])
    assert scene.add(DOT) == 4
    assert scene.ids().tolist() == [2, 4]
    assert len(scene) == 2
    scene.remove(scene.ids())
    assert (len(scene), scene.ids().tolist(), scene.add(DOT)) == (0, [], 5)


@pytest.fixture
def lean(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No slack, no caches that scenes share, and no garbage collector: what is held is what must be."""
    monkeypatch.setattr("hitplanes.planes.scene.variants.ATLAS_SLACK_BYTES", 0)
    monkeypatch.setattr("hitplanes.planes.scene.items.JOURNAL_ROWS", 64)
    monkeypatch.setattr("hitplanes.planes.bits.tiles.ATLAS_SLACK", 8)
    monkeypatch.setattr("hitplanes.planes.broadphase.boxes.INDEX_SLACK", 8)
    for cache in ("hitplanes.planes.scene.variants._kept", "hitplanes.planes.volumes.fit._fitted"):
        monkeypatch.setattr(cache, LruCache(1, lambda _: 2))
    gc.collect()
    gc.disable()
    yield
    gc.enable()
    tracemalloc.stop()


BLAST, RAY = Disc(3), Laser(300)


def fire_some(scene: Scene) -> None:
    for strategy in ("direct", "built"):
        fire(scene, BLAST, [(9, 9), (50, 50)], strategy=strategy, prefilter="circle", broadphase="grid")
    fire(scene, BLAST, [(9, 9)] * 20)
    fire(scene, RAY, (0, 9), aim=0)


@pytest.mark.parametrize("every", [0, pytest.param(4, marks=pytest.mark.long)])
@pytest.mark.parametrize("at_once", [1, 25])
@pytest.mark.usefixtures("lean")
def test_of_an_object_that_was_removed_little_is_kept(every: int, at_once: int) -> None:
    """As a server does for days: each has a mask of its own, of 4 kB; shots are fired at some of them, or at none."""
    scene = Scene((120, 120))
    stays = scene.add(DOT, (9, 9), name="stays")

    def live(lives: int) -> None:
        for life in range(lives // at_once):
            ids = [scene.add(np.ones((64, 64), np.bool_), (50 + i, 50)) for i in range(at_once)]
            scene.set(ids[0], flip="x")
            if every and life % every == 0:
                fire_some(scene)
            scene.remove(ids)
        if every:
            fire_some(scene)

    live(100)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    live(500)
    gc.collect()  # numpy has cycles of its own
    held = tracemalloc.get_traced_memory()[0] - before
    assert held < 400 * 500 + 2**17, f"{held / 500:.0f} bytes for each"
    assert scene.ids().tolist() == [stays] and scene.name_of(500) == "hittable 500"
    assert fire(scene, Point(), (9, 9)).object.tolist() == [stays]


@pytest.mark.usefixtures("lean")
def test_a_sprite_goes_with_the_last_object_that_has_it() -> None:
    scene, sprite = Scene((40, 40)), Sprite.from_mask(np.ones((20, 20), np.bool_))
    known, ids = ref(sprite), [scene.add(sprite, (9, 9), angle=angle) for angle in (0, 30, 60)]
    masks = [ref(scene.items.variants[item]) for item in ids]
    del sprite
    fire_some(scene)
    scene.remove(ids[:2])
    assert known() is not None and fire(scene, Point(), (9, 9)).object.tolist() == ids[2:]
    scene.remove(ids[2])
    assert known() is None and not any(mask() for mask in masks[:2])
    assert scene.items.atlas.used == 0


@pytest.mark.usefixtures("lean")
def test_masks_that_were_removed_go_before_anybody_fires_again() -> None:
    scene = Scene()
    scene.add(np.ones((20, 20), np.bool_))
    fire(scene, Point(), (0, 0), strategy="direct")
    masks = ref(scene.items.stack().masks)
    scene.remove(0)
    assert masks() is None


def test_a_journal_is_no_longer_than_what_it_is_worth(monkeypatch: pytest.MonkeyPatch) -> None:
    """With few objects it costs less to begin anew than to follow many changes."""
    monkeypatch.setattr("hitplanes.planes.scene.items.JOURNAL_FEW", 5)
    scene = three()
    start = scene.version
    for x in range(17):
        scene.move(0, (x, 0))
    assert len(changed_boxes(scene, start)) == 34  # 5 changes, and 4 for each of 3
    scene.move(0, (7, 0))
    assert changed_boxes(scene, start) is None
    scene.remove([0, 1])
    assert changed_boxes(scene, scene.version - 1) is not None
    assert len(scene.items._journal) == 8


def test_more_objects_than_the_first_columns_hold() -> None:
    scene = Scene()
    for number in range(100):
        assert scene.add(DOT, (3 * number, number)) == number
    assert all(pixels(scene, number) == {(3 * number, number)} for number in range(100))


def test_an_object_is_what_it_was_added_as() -> None:
    scene = Scene(categories=["target"])
    first = scene.add(DOT)
    item = scene.add(
        BLOCK, (4, 5), role="occluder", angle=90, layer=-3, categories=["target", "default"], owner=first, name="wall"
    )
    items = scene.items
    assert (items.layer[item], items.categories[item], items.owner[item]) == (-3, 3, first)
    assert (scene.name_of(item), scene.find("wall")) == ("wall", item)
    assert scene.ids(Role.OCCLUDER).tolist() == scene.ids("occluder").tolist() == [item]
    assert pixels(scene, item) == {(x, y) for x in (4, 5) for y in (4, 5, 6)}


@pytest.mark.parametrize("role", Role)
def test_defaults_by_role(role: Role) -> None:
    scene = Scene()
    scene.add(DOT)
    item = scene.add(DOT, role=role)
    assert scene.name_of(item) == f"{role.value} 1"
    assert scene.items.categories[item] == (ALL if role is Role.OCCLUDER else 1)
    assert (scene.items.owner[item], scene.items.layer[item]) == (item, 0)


def test_positions_are_rounded_half_to_even_and_then_to_the_pixel() -> None:
    """1/512 px is half of a step; 0.5 px is the border of two pixels and belongs to the right one."""
    scene = Scene()
    for x, expected in ((0.5, 1), (0.5 - 1 / 512, 1), (0.5 - 3 / 512, 0), (-0.5, 0), (-0.5 - 1 / 256, -1), (2.25, 2)):
        assert pixels(scene, scene.add(DOT, (x, 0))) == {(expected, 0)}
    assert pixels(scene, scene.add(DOT, (10**9 + 0.5, -(10**9)))) == {(10**9 + 1, -(10**9))}


@pytest.mark.parametrize("angle", [0, 90, 180, -90])
@pytest.mark.parametrize("side", [1, 2, 3, 4])
def test_a_pivot_on_a_half_pixel_lies_half_a_pixel_right_of_and_below_a_whole_position(side: int, angle: float) -> None:
    """Pixel (0, 0) goes to the pixel that holds the position less the pivot, which by default is the middle."""
    scene = Scene()
    mask = np.ones((side, side), np.bool_)
    for x in (-3, 10, 10.25, 10.5, 10.75):
        item = scene.add(mask, (x, 0), angle=angle)
        left, top = (math.floor(v - (side - 1) / 2 + 0.5) for v in (x, 0))
        assert pixels(scene, item) == {(left + i, top + j) for i in range(side) for j in range(side)}
        if x == round(x):
            assert sum(column for column, _ in pixels(scene, item)) / side**2 == x + (side % 2 == 0) / 2
    held = scene.add(Sprite.from_mask(mask, pivot_xy=(0.5, 1.5)), (10, 10))
    assert pixels(scene, held) == {(10 + i, 9 + j) for i in range(side) for j in range(side)}


def test_an_object_that_cannot_be_added_leaves_no_trace() -> None:
    """A mask that grows too large is found out late."""
    scene = three()
    before = state(scene)
    bad: list[dict[str, Any]] = [
        {"sprite": np.ones((300, 300), np.bool_), "scale": 256},
        {"sprite": DOT, "flip": "left"},
        {"sprite": DOT, "owner": 4},
        {"sprite": DOT, "categories": ["glas"]},
        {"sprite": DOT, "position_xy": (0, 2**41)},
    ]
    for values in bad:
        with pytest.raises(InputError):
            scene.add(**values)
        assert state(scene) == before
    item = scene.add(BLOCK, (4, 0.5))
    assert item == 3
    assert pixels(scene, item) == {(x, y) for x in (3, 4, 5) for y in (0, 1)}


# Changes


def test_move_takes_one_position_or_one_for_each() -> None:
    scene = three()
    scene.move([2, 0], [[5, 1], [6, 2]])
    assert [pixels(scene, i) for i in range(3)] == [{(6, 2)}, {(1, 1)}, {(5, 1)}]
    scene.move(scene.ids(), (0, 0))
    assert all(pixels(scene, i) == {(0, 0)} for i in range(3))
    scene.move(np.int64(1), np.array([7.0, 3.0]))
    assert pixels(scene, 1) == {(7, 3)}


def test_set_takes_one_value_or_one_for_each() -> None:
    scene = Scene(categories=["target"])
    for x in range(3):
        scene.add(sheet(), (10 * x + 0.5, 0.5))
    items = scene.items
    scene.set([0, 2], layer=[4, -1], categories=np.array([0, 3]), owner=[2, 1], frame=[1, 1])
    assert items.layer[:3].tolist() == [4, 0, -1]
    assert items.categories[:3].tolist() == [0, 1, 3]
    assert items.owner[:3].tolist() == [2, 1, 1]
    assert [pixels(scene, i) for i in (0, 2)] == [{(1, 1)}, {(21, 1)}]
    scene.set([0, 1], flip=["xy", "none"], role="occluder")
    assert pixels(scene, 0) == {(0, 0)}
    assert scene.ids("occluder").tolist() == [0, 1]
    scene.set([0, 1, 2], frame=0, flip="none", categories=["target"], layer=7, owner=0)
    assert items.categories[:3].tolist() == [2, 2, 2]
    scene.set([0, 1], categories=[["target", "default"], []])
    assert items.categories[:3].tolist() == [3, 0, 2]
    assert items.layer[:3].tolist() == [7, 7, 7]
    assert items.owner[:3].tolist() == [0, 0, 0]
    scene.set(range(3), angle=[0, 90, 45.5])
    assert items.angles[:3] == [0, 90, 45.5]


@pytest.mark.parametrize(
    ("scale", "sizes"),
    [
        (3, [(6, 6), (6, 6)]),
        ([1, 3], [(2, 2), (6, 6)]),
        ([[1, 2], [2, 3]], [(2, 4), (4, 6)]),
        ([[1, 2]], [(2, 4), (2, 4)]),
    ],
)
def test_scale_is_one_number_one_for_each_or_pairs(scale: Any, sizes: list[tuple[int, int]]) -> None:
    scene = Scene()
    for _ in range(2):
        scene.add(np.ones((2, 2), np.bool_))
    scene.set([0, 1], scale=scale)
    assert [scene.mask(i)[0].shape[::-1] for i in range(2)] == sizes


def test_one_object_may_be_given_one_pair() -> None:
    scene = Scene()
    scene.add(np.ones((2, 2), np.bool_))
    for ids in (0, [0]):
        scene.set(ids, scale=(1, 3))
        assert scene.mask(0)[0].shape == (6, 2)
        scene.set(ids, scale=1)


def test_a_change_of_one_thing_keeps_the_others() -> None:
    """A pose set step by step is the pose given at once."""
    pose: dict[str, Any] = {"angle": 33.25, "scale": (1.5, 0.7), "flip": "y", "frame": 1, "layer": 2}
    scene = Scene()
    expected = scene.add(sheet(), (3, 4), **pose)
    item = scene.add(sheet())
    for name, value in {**pose, "position_xy": (3, 4)}.items():
        scene.set(item, **{name: [value] if name == "scale" else value})
    assert pixels(scene, item) == pixels(scene, expected)
    assert scene.items.transforms[item] == scene.items.transforms[expected]
    scene.set(item, angle=0)
    scene.set(item, angle=33.25)
    assert scene.items.transforms[item] == scene.items.transforms[expected]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"ids": [0, 3], "layer": 1}, r"ids\[1\]: expected a whole number from 0 to 2, got 3"),
        ({"ids": [0, -1], "layer": 1}, r"ids\[1\]: .*got -1"),
        ({"ids": [0, 1, 0], "layer": 1}, r"ids\[2\]: expected each object once, got 0 again"),
        ({"ids": [[0, 1]], "layer": 1}, r"ids: expected shape \(any,\)"),
        ({"ids": None, "layer": 1}, "ids: expected a number, got None"),
        ({"ids": [True], "layer": 1}, r"ids: expected numbers, got \[?True"),
        ({"ids": [[0], [1, 2]], "layer": 1}, "ids: expected"),
        ({"ids": [0, 1], "position_xy": [[0, 0], [0, np.nan]]}, r"position_xy\[1\]\[1\]: expected a finite number"),
        ({"ids": [0, 1], "position_xy": [[0, 0], [2**41, 0]]}, r"position_xy\[1\]\[0\]: expected a number within"),
        ({"ids": [0, 1], "position_xy": [[0, 0]] * 3}, r"position_xy: expected shape \(2, 2\), got \(3, 2\)"),
        ({"ids": [0, 1], "position_xy": [[0, 0], [1]]}, "position_xy: expected"),
        ({"ids": [0, 1], "angle": [0, np.inf]}, r"angle\[1\]: expected a finite number"),
        ({"ids": [0, 1], "angle": [0, 1, 2]}, r"angle: expected shape \(2,\), got \(3,\)"),
        ({"ids": [0, 1], "angle": [[0], [1, 2]]}, "angle: expected"),
        ({"ids": [0, 1], "angle": "up"}, "angle: expected a number, got .up."),
        ({"ids": [0, 1], "scale": [1, 257]}, r"row 1: scale\[0\]: expected a number"),
        ({"ids": [0, 1], "scale": [[1, 1], [1, 0]]}, r"row 1: scale\[1\]: expected a number"),
        ({"ids": [0, 1], "scale": [1, 2, 3]}, r"scale: expected shape \(2,\), got \(3,\)"),
        ({"ids": 1, "scale": [1, 2, 3]}, r"scale: expected shape \(1,\), got \(3,\)"),
        ({"ids": [0, 1], "scale": [1, [2, 3]]}, r"scale: expected"),
        ({"ids": [0, 1], "flip": ["x", "z"]}, "row 1: flip: expected one of 'none', 'x', 'y', 'xy', got 'z'"),
        ({"ids": [0, 1], "flip": 5}, "row 0: flip: expected one of"),
        ({"ids": [0, 1], "flip": ["x"] * 3}, "flip: expected"),
        ({"ids": [0, 1], "frame": [0, 1]}, "row 1: frame: expected a whole number from 0 to 0, got 1"),
        ({"ids": [0, 1], "frame": [0, 0.5]}, r"frame\[1\]: expected a whole number"),
        ({"ids": [0, 1], "layer": [0, 2**40]}, r"layer\[1\]: expected a whole number"),
        ({"ids": [0, 1], "layer": [0, 10**400]}, r"layer\[1\]: expected a whole number from .*got 1000"),
        ({"ids": [0, 1], "layer": [1, 2, 3]}, r"layer: expected shape \(2,\), got \(3,\)"),
        ({"ids": [0, 1], "owner": [0, 3]}, r"owner\[1\]: expected a whole number from 0 to 2, got 3"),
        ({"ids": [0, 1], "categories": [1, 2**32]}, r"categories\[1\]: expected a whole number"),
        ({"ids": [0, 1], "categories": 2**32}, "categories: expected a whole number"),
        ({"ids": [0, 1], "categories": ["glas"]}, "categories: expected one of .*did you mean 'glass'"),
        ({"ids": [0, 1], "categories": "glas"}, "categories: expected one of .*did you mean 'glass'"),
        ({"ids": [0, 1], "categories": [["glass"], ["glas"]]}, r"categories\[1\]: .*did you mean 'glass'"),
        ({"ids": [0, 1], "categories": [["glass"], "glass"]}, r"categories\[1\]: expected a list of names, got"),
        ({"ids": [0, 1], "categories": [["glass"], [4]]}, r"categories\[1\]: expected one of .*got 4"),
        ({"ids": [0, 1], "categories": [["glass"]] * 3}, "categories: expected 2 lists of names, .*got 3"),
        ({"ids": [0, 1], "role": "occluders"}, "role: expected one of .*did you mean 'occluder'"),
    ],
)  # fmt: skip
def test_a_bad_row_changes_nothing(values: dict[str, Any], message: str) -> None:
    """Whatever else is right in the call."""
    scene = three()
    before = state(scene)
    good = {"position_xy": (3, 3), "angle": 90, "layer": 5, "owner": 2, "role": "occluder", "categories": 2}
    with pytest.raises(InputError, match=message):
        scene.set(**{**good, **values})
    assert state(scene) == before


def test_a_mask_that_would_be_too_large_changes_nothing() -> None:
    scene = three()
    item = scene.add(np.ones((300, 300), np.bool_))
    before = state(scene)
    with pytest.raises(InputError, match="scale: expected a mask of sides up to"):
        scene.set([0, item], scale=[2, 256], position_xy=(0, 0))
    assert state(scene) == before


def test_to_move_nothing_changes_nothing() -> None:
    scene = three()
    before = scene.version
    for ids, xy in (([], []), (np.zeros(0, np.int64), np.zeros((0, 2))), ([], (3, 4))):
        scene.move(ids, xy)
    assert scene.version == before
    with pytest.raises(InputError, match="xy"):
        scene.move([], [(1, 2)])


def test_a_removed_object_is_named() -> None:
    scene = three()
    scene.remove(1)
    acts = [lambda: scene.remove([1, 0]), lambda: scene.mask(1), lambda: scene.move(1, (0, 0))]
    for act in acts:
        with pytest.raises(InputError, match=r"ids\[0\]: expected an object in the scene, got 1, which was removed"):
            act()
    assert scene.ids().tolist() == [0, 2]
    assert scene.name_of(1) == "b"


def test_a_change_of_no_objects_is_no_error() -> None:
    scene = three()
    scene.set([], layer=3, angle=4, position_xy=(1, 1))
    scene.remove(np.zeros(0, np.int64))
    assert scene.ids().tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"position_xy": (1, [2])}, "position_xy: expected"),
        ({"position_xy": (1, 2, 3)}, r"position_xy: expected shape \(2,\), got \(3,\)"),
        ({"position_xy": (np.nan, 2)}, r"position_xy\[0\]: expected a finite number"),
        ({"angle": "up"}, "angle: expected a number"),
        ({"angle": [1, 2]}, r"angle: expected shape \(\)"),
        ({"scale": (1, 2, 3)}, r"scale: expected shape \(2,\)"),
        ({"scale": (1, [2])}, "scale: expected"),
        ({"scale": 0}, r"scale\[0\]: expected a number from"),
        ({"flip": "yx"}, "flip: expected one of .*got 'yx'"),
        ({"frame": 1}, "frame: expected a whole number from 0 to 0, got 1"),
        ({"layer": 0.5}, "layer: expected a whole number"),
        ({"layer": None}, "layer: expected a whole number"),
        ({"owner": 4}, "owner: expected a whole number from 0 to 2, got 4"),
        ({"role": "hittible"}, "role: .*did you mean 'hittable'"),
        ({"categories": ["targte"]}, "categories: .*did you mean 'target'"),
        ({"categories": -1}, "categories: expected a whole number"),
        ({"categories": True}, "categories: expected a whole number"),
        ({"categories": 1.5}, "categories: expected bits or a list of names, got 1.5"),
    ],
)
def test_a_bad_value_is_named(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        three().add(DOT, **values)


# Names and categories


def test_find_knows_the_names_of_now_and_of_then() -> None:
    """Ids are found also where rows are used again, after changes, in copies, and in the past."""
    scene = Scene()
    history = History(scene, ticks=4)
    first = [scene.add(Sprite.circle(2), (9 * k, 0), name=f"duck {k}") for k in range(5)]
    history.record(0)
    scene.remove(first[1:3])
    other = scene.add(Sprite.circle(2), (0, 40), name="duck 1")
    assert scene.find("duck 1") == scene.copy().find("duck 1") == other != first[1]
    past = history.at(0)
    assert [past.find(f"duck {k}") for k in range(5)] == first
    for name in ("duck 2", "", 3):
        with pytest.raises(InputError, match="name: expected one of"):
            scene.find(name)  # type: ignore[arg-type]


def test_find_suggests_a_name() -> None:
    scene = Scene()
    scene.add(DOT, name="bullseye")
    scene.add(DOT, name="duck")
    scene.add(DOT, name="duck")
    assert scene.find("bullseye") == 0
    with pytest.raises(InputError, match=r"name: expected one of .*got 'bulseye' \(did you mean 'bullseye'"):
        scene.find("bulseye")
    with pytest.raises(InputError, match="name: expected one object named 'duck', got 2"):
        scene.find("duck")
    scene.remove(1)
    assert scene.find("duck") == 2
    with pytest.raises(InputError, match="item: expected a whole number from 0 to 2"):
        scene.name_of(3)


def test_categories_are_bits() -> None:
    scene = Scene(categories=["target", "glass"])
    assert scene.category_bits() == 0
    assert [scene.category_bits(name) for name in ("default", "target", "glass")] == [1, 2, 4]
    assert scene.category_bits("glass", "default") == 5
    assert scene.category_bits("target", "target") == 2
    assert scene.items.categories[scene.add(DOT, categories=["target", "target"])] == 2
    with pytest.raises(InputError, match="name: there is none to choose from, got 'duck'"):
        Scene().find("duck")
    with pytest.raises(InputError, match="category: expected one of 'default', 'target', 'glass', got 'wood'"):
        scene.category_bits("wood")


def test_there_are_31_names_beside_the_default() -> None:
    names = [f"c{i}" for i in range(32)]
    assert Scene(categories=names[:31]).category_bits("c30") == 2**31
    with pytest.raises(InputError, match="categories: expected at most 31 names, got 32"):
        Scene(categories=names)
    for twice in (["a", "b", "a"], ["default"]):
        with pytest.raises(InputError, match="categories: expected distinct names"):
            Scene(categories=twice)


# Bounds


def test_extent_is_the_bounds_or_all_that_is_placed() -> None:
    assert Scene((5, 3), (-2, 7)).extent() == (-2, 7, 2, 9)
    scene = Scene()
    assert scene.extent() == (0, 0, 0, 0)
    scene.add(np.zeros((4, 4), np.bool_), (90, 90))
    scene.add(BLOCK, (100, 50.5), role="mover")
    scene.add(DOT, (-7, 60), role="background")
    scene.add(DOT, (500, 500), role="hud")
    assert scene.extent() == (-7, 50, 101, 60)
    scene.remove(2)
    assert scene.extent() == (99, 50, 101, 51)


@pytest.mark.parametrize(
    ("size", "origin", "message"),
    [
        ((0, 4), (0, 0), r"size_wh\[0\]: expected a whole number from 1"),
        ((4, 2.5), (0, 0), r"size_wh\[1\]: .*got 2.5"),
        ((4,), (0, 0), r"size_wh: expected shape \(2,\)"),
        ((4, 4), (0, 2**41), r"origin_xy\[1\]: expected a whole number"),
    ],
)
def test_bad_bounds_are_named(size: Any, origin: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Scene(size, origin)


# Planes in and out


def test_labels_are_objects() -> None:
    labels = np.array([[0, 7, 7, 0], [0, 3, 7, 0], [9, 0, 0, 9]])
    scene = Scene.from_planes(hittable=labels, origin_xy=(10, -5))
    assert scene.bounds == (10, -5, 13, -3)
    assert [scene.name_of(i) for i in scene.ids().tolist()] == ["3", "7", "9"]
    for name in (3, 7, 9):
        expected = {(int(x) + 10, int(y) - 5) for y, x in np.argwhere(labels == name)}
        assert pixels(scene, scene.find(str(name))) == expected
    assert scene.mask(scene.find("7"))[0].shape == (2, 2)


@pytest.mark.parametrize("kind", [np.uint8, np.int64, np.uint64, np.float32, "lists"])
def test_labels_of_every_kind(kind: Any) -> None:
    labels = np.random.default_rng(3).integers(0, 5, (6, 9))
    given = labels.tolist() if kind == "lists" else labels.astype(kind)
    scene = Scene.from_planes(hittable=given)
    assert np.array_equal(scene.planes().hittable, labels)


def test_masks_stacks_of_masks_and_images() -> None:
    rng = np.random.default_rng(5)
    mask, stack = rng.random((6, 7)) < 0.4, rng.random((3, 6, 7)) < 0.4
    image = rng.integers(0, 256, (6, 7, 4)).astype(np.uint8)
    picture = rng.integers(0, 256, (6, 7, 3)).astype(np.uint8)
    hud = np.zeros((6, 7), np.bool_)
    hud[5, 1] = True
    given = [mask, stack, image, picture, hud]
    before = [array.copy() for array in given]
    scene = Scene.from_planes(
        background=picture, hittable=stack, movers=mask, occluders=image, hud=hud, origin_xy=(100, 200)
    )
    roles = [[scene.name_of(i) for i in scene.ids(role).tolist()] for role in Role]
    assert roles == [["background"], ["hittable 0", "hittable 1", "hittable 2"], ["mover"], ["occluder"], ["hud"]]

    def at(plane: np.ndarray, x: int, y: int) -> set[tuple[int, int]]:
        return {(int(column) + x, int(row) + y) for row, column in np.argwhere(plane)}

    for number in range(3):
        assert pixels(scene, scene.find(f"hittable {number}")) == at(stack[number], 100, 200)
    assert pixels(scene, scene.find("mover")) == at(mask, 100, 200)
    assert pixels(scene, scene.find("occluder")) == at(image[:, :, 3] > 127, 100, 200)
    assert pixels(scene, scene.find("background")) == at(np.ones((6, 7)), 100, 200)
    assert pixels(scene, scene.find("hud")) == {(1, 5)}
    assert all(np.array_equal(a, b) for a, b in zip(given, before, strict=True))


def test_planes_without_anything_in_them() -> None:
    scene = Scene.from_planes(hittable=np.zeros((3, 4), np.int64), occluders=np.zeros((3, 4), np.bool_))
    assert scene.ids("hittable").tolist() == []
    assert not scene.planes().occluders.any()
    assert scene.bounds == (0, 0, 3, 2)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "planes: expected one or more"),
        ({"hittable": np.zeros((3, 4)), "movers": np.zeros((4, 3))}, "planes: .* size, got hittable of 4 x 3 px, mov"),
        ({"hittable": np.zeros((2, 3, 4), np.bool_), "hud": np.zeros((3, 5))}, "planes: .*all of one size"),
        ({"hittable": np.zeros(5)}, r"hittable: expected a plane .*got \(5,\)"),
        ({"occluders": np.zeros((0, 5))}, r"occluders: expected a plane .*got \(0, 5\)"),
        ({"hittable": [[0, -1]]}, r"hittable\[0\]\[1\]: expected a whole number from 0"),
        ({"hittable": [[0, 0.5]]}, r"hittable\[0\]\[1\]: expected a whole number"),
        ({"hittable": [[0, np.nan]]}, r"hittable\[0\]\[1\]: expected a whole number"),
        ({"hittable": [["a"]]}, "hittable: expected numbers"),
        ({"hittable": [[1], [1, 2]]}, "hittable: expected"),
        ({"movers": np.full((2, 3, 5), 2)}, r"movers\[0\]\[0\]\[0\]: expected 0 or 1, got 2"),
        ({"hittable": [[1]], "origin_xy": (0.5, 0)}, r"origin_xy\[0\]: expected a whole number"),
    ],
)  # fmt: skip
def test_bad_planes_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Scene.from_planes(**given)


def test_planes_are_read_only_copies() -> None:
    scene = three()
    planes = scene.planes()
    for field in FIELDS.values():
        plane = getattr(planes, field)
        assert plane.dtype == np.int32
        assert plane.shape == (4, 8)
        with pytest.raises(ValueError, match="read-only"):
            plane[0, 0] = 1
    before = planes.hittable.copy()
    scene.move(0, (6, 3))
    assert np.array_equal(planes.hittable, before)
    assert scene.planes().hittable[3, 6] == 1
    mask, _ = scene.mask(0)
    with pytest.raises(ValueError, match="read-only"):
        mask[0, 0] = False


def brute_planes(scene: Scene) -> Planes:
    """Every pixel asked by itself which of its items is in front: greater layer, then the later added."""
    x, y, x_max, y_max = scene.extent()
    shape = (y_max - y + 1, x_max - x + 1)
    out: dict[str, np.ndarray] = {field: np.zeros(shape, np.int32) for field in FIELDS.values()}
    order = sorted(scene.ids().tolist(), key=lambda i: (scene.items.layer[i], i))
    for role, item in itertools.product(Role, order):
        if item not in scene.ids(role):
            continue
        left, top = (0, 0) if role is Role.HUD else (x, y)
        for column, row in pixels(scene, item):
            if 0 <= column - left < shape[1] and 0 <= row - top < shape[0]:
                out[FIELDS[role.value]][row - top, column - left] = item + 1
    return Planes((x, y), **out)


@examples(20, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_planes_are_the_front_most_items(seed: int, bounded: bool) -> None:
    rng = np.random.default_rng(seed)
    scene = Scene((12, 9), (-4, 3)) if bounded else Scene()
    for _ in range(int(rng.integers(0, 15))):
        sprite = rng.random(tuple(rng.integers(1, 6, 2))) < 0.7
        position = rng.integers(-8, 14, 2) + rng.integers(0, 256, 2) / 256
        role, layer = list(Role)[rng.integers(5)], int(rng.integers(-1, 2))
        scene.add(sprite, position, role=role, layer=layer, angle=rng.uniform(0, 360))
    found, expected = scene.planes(), brute_planes(scene)
    assert found.origin_xy == expected.origin_xy
    for field in FIELDS.values():
        assert np.array_equal(getattr(found, field), getattr(expected, field)), field


def test_planes_in_are_planes_out() -> None:
    rng = np.random.default_rng(11)
    given = {field: rng.integers(0, 4, (10, 13)) for field in FIELDS.values()}
    scene = Scene.from_planes(**given, origin_xy=(-3, 1000))
    planes = scene.planes()
    assert planes.origin_xy == (-3, 1000)
    for field, labels in given.items():
        found = getattr(planes, field)
        names = [0, *(int(scene.name_of(i)) for i in range(scene.items.count))]
        assert np.array_equal(np.array(names)[found], labels), field
    again = Scene.from_planes(**{field: getattr(planes, field) for field in given}, origin_xy=planes.origin_xy)
    for field in given:
        assert np.array_equal(getattr(again.planes(), field), getattr(planes, field))
    assert again.content_hash() == scene.content_hash()


# Versions and the hash


def test_every_change_is_a_new_version() -> None:
    scene = three()
    seen = [scene.version]
    for change in (
        lambda: scene.add(DOT),
        lambda: scene.move(0, (1, 1)),
        lambda: scene.set([1, 2], layer=1),
        lambda: scene.set(0, categories=4),
        lambda: scene.remove(2),
    ):
        change()
        seen.append(scene.version)
    assert seen == sorted(set(seen))
    scene.planes()
    scene.content_hash()
    assert scene.version == seen[-1]


def test_the_journal_tells_where_deciding_items_were_and_are() -> None:
    scene = three()
    start = scene.version
    scene.move(0, (5, 3))
    hud = scene.add(DOT, (1, 1), role="hud")
    assert changed_boxes(scene, start).tolist() == [[0, 1, 0, 1], [5, 3, 5, 3]]
    scene.move(hud, (2, 2))
    scene.set(hud, role="occluder")
    assert changed_boxes(scene, start + 2).tolist() == [[2, 2, 2, 2]]
    scene.remove([1])
    assert changed_boxes(scene, start + 4).tolist() == [[1, 1, 1, 1]]
    assert changed_boxes(scene, scene.version).tolist() == []


def test_a_journal_that_is_too_long_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.scene.items.JOURNAL_ROWS", 4)
    scene = three()
    start = scene.version
    for x in range(4):
        scene.move(0, (x, 0))
    assert len(changed_boxes(scene, start)) == 8
    scene.move(0, (7, 0))
    assert changed_boxes(scene, start) is None
    assert len(changed_boxes(scene, start + 1)) == 8
    scene.move([0, 1, 2], (7, 0))
    assert changed_boxes(scene, start + 4) is not None
    assert changed_boxes(scene, start + 3) is None


def scene_of_all() -> Scene:
    scene = Scene((30, 20), categories=["a"])
    scene.add(sheet(), (5, 5), angle=20, layer=1)
    scene.add(Sprite.circle(3), (12, 9), categories=["a"])
    scene.add(BLOCK, (11.5, 9.5), role="occluder", owner=0)
    scene.add(BLOCK, (1, 1), role="hud")
    return scene


def test_equal_scenes_have_equal_hashes() -> None:
    assert scene_of_all().content_hash() == scene_of_all().content_hash()
    assert len(scene_of_all().content_hash()) == 16
    scene = scene_of_all()
    before = scene.content_hash()
    scene.move(0, (9, 9))
    assert scene.content_hash() != before
    scene.move(0, (5, 5))
    assert scene.content_hash() == before


@pytest.mark.parametrize(
    "values",
    [
        {"ids": 0, "position_xy": (6, 5)},
        {"ids": 2, "angle": 90},
        {"ids": 0, "frame": 1},
        {"ids": 1, "scale": 1.1},
        {"ids": 1, "layer": 2},
        {"ids": 2, "layer": 1},
        {"ids": 2, "layer": -1},
        {"ids": 2, "role": "hittable"},
        {"ids": 2, "role": "mover"},
        {"ids": 2, "owner": 2},
        {"ids": 1, "categories": 1},
    ],
)
def test_whatever_decides_hits_changes_the_hash(values: dict[str, Any]) -> None:
    scene = scene_of_all()
    before = scene.content_hash()
    scene.set(**values)
    assert scene.content_hash() != before


def test_what_decides_nothing_leaves_the_hash() -> None:
    scene = scene_of_all()
    before = scene.content_hash()
    scene.move(3, (9, 9))
    scene.add(BLOCK, role="background")
    assert scene.content_hash() == before


@pytest.mark.parametrize("pixel", [(0, 0), (5, 8), (3, 4)])
def test_one_pixel_changes_the_hash(pixel: tuple[int, int]) -> None:
    mask = np.ones((6, 9), np.bool_)
    mask[3, 4] = False
    one, other = Scene((20, 20)), Scene((20, 20))
    one.add(mask)
    changed = mask.copy()
    changed[pixel] ^= True
    other.add(changed)
    assert one.content_hash() != other.content_hash()


def test_bounds_are_part_of_the_hash() -> None:
    scenes = [Scene((4, 4)), Scene((4, 5)), Scene((4, 4), (1, 0)), Scene()]
    assert len({scene.content_hash() for scene in scenes}) == 4


def test_bounds_cannot_be_changed() -> None:
    scene = Scene((40, 30), (5, 6))
    assert scene.bounds == (5, 6, 44, 35)
    with pytest.raises(AttributeError):
        scene.bounds = (0, 0, 99, 99)  # type: ignore[misc]


def test_a_new_role_brings_its_categories_unless_others_were_set() -> None:
    scene = Scene(categories=["glass"])
    wall = scene.add(np.ones((3, 3), np.bool_))
    pane = scene.add(np.ones((3, 3), np.bool_), categories=["glass"])
    scene.set([wall, pane], role="occluder")
    assert scene.items.categories[[wall, pane]].tolist() == [2**32 - 1, 2]
    scene.set([wall, pane], role="hittable")
    assert scene.items.categories[[wall, pane]].tolist() == [1, 2]


@pytest.mark.parametrize("categories", ["glass", None, 3])
def test_categories_of_a_scene_are_a_list(categories: Any) -> None:
    with pytest.raises(InputError, match="categories: expected a list of names"):
        Scene(categories=categories)


def test_a_whole_float_beyond_int64_is_refused() -> None:
    with pytest.raises(InputError, match="owner"):
        Scene().add(np.ones((3, 3), np.bool_), owner=float(2**63))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"shot\[0\]: expected a whole number"):
        fire(Scene(), Point(), (0, 0), shot=[float(2**63)])


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda s: s.mask([]), "item: expected a whole number"),
        (lambda s: s.mask("x"), "item: expected a whole number"),
        (lambda s: s.add(np.ones((2, 2), np.bool_), name=np.ones(3)), "name: expected a text"),
        (lambda s: s.add("frog.png"), "sprite: expected a Sprite, .* got str"),
        (lambda s: s.find(np.ones(3)), "name: expected one of"),
        (lambda s: s.find(None), "name: expected one of"),
        (lambda s: s.save(3), "folder: expected a path, got 3"),
        (lambda s: load_scene(None), "folder: expected a path, got None"),
    ],
)
def test_what_is_of_the_wrong_kind_is_named(call: Any, told: str) -> None:
    scene = Scene()
    scene.add(np.ones((2, 2), np.bool_), name="one")
    with pytest.raises(InputError, match=told):
        call(scene)
    assert len(scene) == 1


def test_the_path_of_the_file_will_do_for_its_folder(tmp_path: Path) -> None:
    scene = Scene((9, 9))
    scene.save(tmp_path)
    assert load_scene(tmp_path / "scene.json").content_hash() == scene.content_hash()


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["add", "remove", "read", "skip"]), st.integers(0, 9)), max_size=30))
def test_the_ids_are_those_of_what_was_added_and_not_removed(steps: list[tuple[str, int]]) -> None:
    scene, living = Scene(), []
    for step, number in steps:
        if step == "add":
            living.append(scene.add(DOT, role=("hittable", "mover")[number % 2]))
        elif step == "remove" and living:
            scene.remove(living.pop(number % len(living)))
        elif step == "skip":
            scene.items.table.skip_to(scene.items.count + number)
        elif step == "read":
            scene.ids()[:] = 99  # what a caller does with them is the caller's own
            assert scene.ids().tolist() == living and len(scene) == len(living)
    assert list(scene) == living == sorted({*scene.ids("hittable").tolist(), *scene.ids("mover").tolist()})
    assert scene.copy().ids().tolist() == living
