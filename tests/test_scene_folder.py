"""Scene folders: every source, there and back again, and errors that name the place."""

import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hitplanes import Disc, fire, picture_of_report, report_of
from hitplanes.planes.common.checks import InputError
from hitplanes.planes.common.tables import Mask
from hitplanes.planes.files import scene_folder
from hitplanes.planes.files.png import read_png, write_png
from hitplanes.planes.files.scene_folder import images_of, load_scene
from hitplanes.planes.scene.items import Items
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite

FORMAT = "hitplanes-scene/2"
GALLERY = Path(__file__).parent.parent / "fixtures" / "gallery"
RNG = np.random.default_rng(23)

SHEET = RNG.integers(0, 256, (4, 6, 4)).astype(np.uint8)
KEYED = np.full((3, 3, 3), 90, np.uint8)
KEYED[1, 1] = (255, 0, 255)

FULL: dict[str, Any] = {
    "format": FORMAT,
    "name": "all kinds",
    "bounds": {"origin_xy": [-10, 5], "size_wh": [120, 80]},
    "categories": ["target", "glass"],
    "objects": {
        "background": [{"image": "sheet.png", "position_xy": [40, 40]}],
        "hittable": [
            {
                "name": "fish",
                "image": "sheet.png",
                "frames": {"grid_wh": [3, 2]},
                "frame": 3,
                "position_xy": [10.25, 20],
                "pivot_xy": [0.5, 1],
                "angle": 33,
                "scale": [2, 1.5],
                "flip": "xy",
                "layer": -2,
                "categories": ["glass", "default"],
                "alpha_threshold": 40,
            },
            {"name": "keyed", "image": "sub/keyed.png", "color_key": [255, 0, 255], "position_xy": [30, 30]},
            {
                "name": "plate",
                "polygon": [[-12, -9], [12, -9], [0, 14]],
                "holes": [[[-3, -3], [3, -3], [0, 3]]],
                "color": [220, 40, 40],
                "position_xy": [60, 60],
                "owner": "fish",
            },
            {"name": "ball", "circle": 4.3, "position_xy": [5, 15], "scale": [1, 2], "angle": 20},
            {"box_wh": [7, 3.3], "position_xy": [80, 30], "angle": 45, "categories": []},
            {"mask": ["..#", ".##"], "position_xy": [90, 70], "pivot_xy": [0, 0], "color": [1, 2, 3], "owner": 2},
            {"mask": [[1, 0], [1, 1]], "position_xy": [92, 70]},
        ],
        "movers": [{"circle": 2, "position_xy": [9, 9]}],
        "occluders": [
            {"image": "sheet.png", "frames": {"rects_xywh": [[1, 0, 5, 4], [0, 0, 2, 2]]}, "position_xy": [12, 22]},
            {"box_wh": [3, 3], "position_xy": [61, 61], "categories": ["glass"]},
        ],
        "hud": [{"mask": ["#"], "position_xy": [2, 2]}],
    },
    "weapons": {"pistol": {"kind": "point", "anything": [1, 2, {"deep": None}]}},
    "shots": [{"weapon": "pistol", "at": [1, 2]}],
}


def folder_of(path: Path, data: Any) -> Path:
    """Make a scene folder with a few images."""
    (path / "sub").mkdir(parents=True, exist_ok=True)
    write_png(path / "sheet.png", SHEET)
    write_png(path / "sub" / "keyed.png", KEYED)
    text = data if isinstance(data, str) else json.dumps(data)
    (path / "scene.json").write_text(text, encoding="utf-8")
    return path


def with_object(**values: Any) -> dict[str, Any]:
    """A scene file with a good object and then this one."""
    good = {"circle": 2, "position_xy": [0, 0]}
    return {"format": FORMAT, "categories": ["target"], "objects": {"hittable": [good, values]}}


def poses(scene: Scene) -> list[Any]:
    items = scene.items
    return [
        (items.names[i], items.transforms[i], items.angles[i], *(getattr(items, c)[i].tolist() for c in COLUMNS))
        for i in items.rows.tolist()
    ]


COLUMNS = ("role", "layer", "categories", "owner", "position_256", "pivot_256", "size_wh")


# Reading


def test_every_kind_of_source_is_read(tmp_path: Path) -> None:
    scene = load_scene(folder_of(tmp_path, FULL))
    assert (scene.name, scene.bounds, scene.categories) == (
        "all kinds",
        (-10, 5, 109, 84),
        ("default", "target", "glass"),
    )
    assert (scene.weapons, scene.shots) == (FULL["weapons"], FULL["shots"])
    assert [len(scene.ids(role)) for role in Role] == [1, 7, 1, 2, 1]
    expected = Scene((120, 80), (-10, 5), categories=["target", "glass"])
    fish = Sprite.from_image(SHEET, grid_wh=(3, 2), pivot_xy=(0.5, 1), alpha_threshold=40)
    plate = Sprite.polygon(FULL["objects"]["hittable"][2]["polygon"], FULL["objects"]["hittable"][2]["holes"])
    pose = {"angle": 33, "scale": (2, 1.5), "flip": "xy", "layer": -2, "frame": 3}
    expected.add(SHEET, (40, 40), role="background")
    expected.add(fish, (10.25, 20), categories=["glass", "default"], **pose)
    expected.add(Sprite.from_image(KEYED, color_key=(255, 0, 255)), (30, 30))
    expected.add(plate, (60, 60), owner=1)
    expected.add(Sprite.circle(4.3), (5, 15), scale=(1, 2), angle=20)
    expected.add(Sprite.box(7, 3.3), (80, 30), angle=45, categories=0)
    expected.add(Sprite.from_mask([[0, 0, 1], [0, 1, 1]], pivot_xy=(0, 0)), (90, 70), owner=2)
    expected.add([[True, False], [True, True]], (92, 70))
    expected.add(Sprite.circle(2), (9, 9), role="mover")
    expected.add(Sprite.from_image(SHEET, rects_xywh=[[1, 0, 5, 4], [0, 0, 2, 2]]), (12, 22), role="occluder")
    expected.add(Sprite.box(3, 3), (61, 61), role="occluder", categories=["glass"])
    expected.add([[True]], (2, 2), role="hud")
    assert scene.content_hash() == expected.content_hash()
    for plane in ("background", "movers", "hud"):
        assert np.array_equal(getattr(scene.planes(), plane), getattr(expected.planes(), plane))
    assert (scene.find("fish"), scene.name_of(5), scene.items.sprites[3].color) == (1, "hittable 5", (220, 40, 40))


def test_what_may_be_left_out_may_be_left_out(tmp_path: Path) -> None:
    scene = load_scene(folder_of(tmp_path / "empty room", {"format": FORMAT}))
    assert (scene.name, scene.bounds, len(scene), scene.weapons, scene.shots) == ("empty room", None, 0, {}, [])
    item = load_scene(folder_of(tmp_path, with_object(circle=1, position_xy=[3, 4]))).items
    assert (item.angles[1], item.layer[1], item.categories[1], item.owner[1]) == (0, 0, 1, 1)


def test_objects_of_one_source_share_a_sprite(tmp_path: Path) -> None:
    rows = [{"image": "sheet.png", "position_xy": [x, 0]} for x in range(3)]
    rows.append({"image": "sheet.png", "position_xy": [0, 0], "alpha_threshold": 3})
    scene = load_scene(folder_of(tmp_path, {"format": FORMAT, "objects": {"hittable": rows}}))
    assert [len({id(s) for s in scene.items.sprites[:n]}) for n in (3, 4)] == [1, 2]


def test_ids_of_a_file_are_kept(tmp_path: Path) -> None:
    rows = [{"circle": 1, "position_xy": [x, 0], "id": x, "name": f"n{x}"} for x in (7, 2, 40)]
    occluders = [{"circle": 1, "position_xy": [3, 0], "id": 3}]
    scene = load_scene(folder_of(tmp_path, {"format": FORMAT, "objects": {"hittable": rows, "occluders": occluders}}))
    assert scene.ids().tolist() == [2, 3, 7, 40]
    assert [scene.name_of(i) for i in (2, 7, 40)] == ["n2", "n7", "n40"]
    assert scene.add([[True]]) == 41
    with pytest.raises(InputError, match="expected an object in the scene, got 5"):
        scene.mask(5)


def test_masks_as_rows() -> None:
    assert Mask().check("mask", ["#.", ".#", ".."]).tolist() == [[True, False], [False, True], [False, False]]
    assert Mask().check("mask", [[1, 0]]).tolist() == [[True, False]]


# There and back again


def reloaded(scene: Scene, folder: Path) -> Scene:
    scene.save(folder)
    again = load_scene(folder)
    assert again.content_hash() == scene.content_hash()
    assert poses(again) == poses(scene)
    assert (again.weapons, again.shots, again.name) == (scene.weapons, scene.shots, scene.name)
    assert not list(folder.glob("*.part"))
    return again


def test_a_scene_of_every_kind_is_saved_and_loaded(tmp_path: Path) -> None:
    scene = load_scene(folder_of(tmp_path / "first", FULL))
    again = reloaded(scene, tmp_path / "second" / "deep")
    assert again.categories == scene.categories
    for plane in ("background", "hittable", "movers", "occluders", "hud"):
        assert np.array_equal(getattr(again.planes(), plane), getattr(scene.planes(), plane))
    assert [s.color for s in again.items.sprites] == [s.color for s in scene.items.sprites]
    third = reloaded(again, tmp_path / "third")
    for name in [p.name for p in (tmp_path / "second" / "deep").glob("*.png")]:
        assert np.array_equal(read_png(tmp_path / "third" / name), read_png(tmp_path / "second" / "deep" / name))
    assert third.content_hash() == scene.content_hash()


def test_steps_of_angles_are_read_and_saved(tmp_path: Path) -> None:
    """One object of each kind of source, with a step, and the same without, turned to the step itself."""
    sources: list[dict[str, Any]] = [
        {"image": "sheet.png"},
        {"polygon": [[-9, 0], [9, 0], [4, 3]]},
        {"circle": 4},
        {"box_wh": [9, 2]},
    ]
    sources.append({"mask": ["###.", "#..."]})
    pose = {"position_xy": [20, 20], "scale": [2, 1]}
    stepped = [{**source, **pose, "angle": 47, "angle_step": 45} for source in sources]
    free = [{**source, **pose, "angle": 45} for source in sources]
    scene = load_scene(folder_of(tmp_path / "first", {"format": FORMAT, "objects": {"hittable": stepped + free}}))
    for each in (scene, reloaded(scene, tmp_path / "second")):
        variants = each.items.variants
        assert all(np.array_equal(*(v.mask for v in pair)) for pair in zip(variants[:5], variants[5:], strict=True))
        assert [sprite.angle_step for sprite in each.items.sprites] == [45] * 5 + [None] * 5


def test_the_gallery_is_saved_and_loaded(tmp_path: Path) -> None:
    reloaded(load_scene(GALLERY), tmp_path / "gallery")


def test_a_random_scene_is_saved_and_loaded(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    scene = Scene((200, 100), (-50, -50), categories=["a", "b"], name="random ä")
    sprites = [
        Sprite.from_mask(rng.random((5, 7)) < 0.5, pivot_xy=(1.25, -3)),
        Sprite.from_mask(rng.random((70, 80)) < 0.5, color=(1, 2, 3)),
        Sprite.from_image(SHEET, grid_wh=(2, 2)),
        Sprite.from_image(SHEET, rects_xywh=[[0, 0, 1, 4], [2, 1, 3, 2]], color_key=SHEET[1, 2, :3].tolist()),
        Sprite.circle(5.123),
        Sprite.box(3.3, 9.1),
        Sprite.polygon(rng.uniform(-9, 9, (5, 2)), [rng.uniform(-4, 4, (3, 2))], color=(9, 9, 9)),
    ]
    for _ in range(60):
        sprite = sprites[rng.integers(len(sprites))]
        scene.add(
            sprite,
            rng.uniform(-50, 150, 2),
            role=list(Role)[rng.integers(5)],
            angle=float(rng.choice([0, 90, rng.uniform(-720, 720)])),
            scale=rng.uniform(0.3, 3, 2) if rng.random() < 0.5 else 1,
            flip=str(rng.choice(["none", "x", "y", "xy"])),
            frame=int(rng.integers(sprite.frame_count)),
            layer=int(rng.integers(-3, 4)),
            categories=[None, 0, 5, 1 << 31][rng.integers(4)],
        )
    scene.set([3, 4, 5], owner=[9, 59, 3])
    scene.remove(rng.choice(58, 20, replace=False))
    scene.weapons, scene.shots = {"w": {"kind": "point"}}, [{"at": [1, 2.5]}]
    again = reloaded(scene, tmp_path)
    assert again.bounds == scene.bounds
    assert again.ids().tolist() == scene.ids().tolist()


def test_large_masks_look_the_same_after_saving(tmp_path: Path) -> None:
    """One without a colour has that of its role, also where a scaled image would be drawn in other pixels."""
    mask = np.tri(90, 80, dtype=np.bool_)
    scene = Scene((300, 300))
    wall = scene.add(Sprite.from_mask(mask, pivot_xy=(3, 4)), (60, 60), role="occluder", angle=33, name="wall")
    scene.add(scene.sprite(wall), (180, 60), scale=1.3)
    scene.add(Sprite.from_mask(~mask, color=(200, 30, 90), angle_step=5), (90, 190), angle=7, flip="x")
    again = reloaded(scene, tmp_path / "saved")
    assert again.sprite(wall).color is None
    pictures = [
        picture_of_report(report_of(each, [fire(each, Disc(40), (90, 90))]), each)
        for each in (scene, again, reloaded(again, tmp_path / "again"))
    ]
    assert np.array_equal(pictures[0], pictures[1]) and np.array_equal(pictures[0], pictures[2])
    assert images_of(again.sprite(wall)) == {"sprite.png"}


def test_a_mask_of_a_png_is_its_alpha(tmp_path: Path) -> None:
    scene = load_scene(folder_of(tmp_path, with_object(mask="sub/keyed.png", position_xy=[3, 3], color=[1, 2, 3])))
    assert scene.mask(1)[0].tolist() == [[True] * 3] * 3 and scene.sprite(1).color == (1, 2, 3)
    with pytest.raises(InputError, match=r"source\.mask: expected a path inside"):
        Sprite.from_mask([[1]], source={"mask": "../keyed.png"})


def test_unnamed_bits_are_kept(tmp_path: Path) -> None:
    scene = Scene(categories=["a"])
    for bits in (0, 1, 2, 4, 1 << 31, 5, 2**32 - 1):
        scene.add([[True]], categories=bits)
        scene.add([[True]], categories=bits, role="occluder")
    reloaded(scene, tmp_path)


def test_a_name_like_that_of_a_bit_is_kept_apart(tmp_path: Path) -> None:
    scene = Scene(categories=["bit 3"])
    scene.add([[True]], categories=1 << 3)
    reloaded(scene, tmp_path)


def test_a_scene_without_bounds_stays_without(tmp_path: Path) -> None:
    scene = Scene()
    scene.add([[True]], (10**9 + 0.25, -7))
    assert reloaded(scene, tmp_path).bounds is None


def test_an_alpha_threshold_is_kept(tmp_path: Path) -> None:
    scene = Scene()
    for threshold in (0, 40, 127, 254, 255, np.int64(41)):
        scene.add(Sprite.from_image(SHEET, alpha_threshold=threshold))
        scene.add(Sprite.from_image(SHEET, alpha_threshold=threshold, grid_wh=(3, 4)), frame=1)
    reloaded(scene, tmp_path)


def test_an_owner_that_was_removed_is_kept(tmp_path: Path) -> None:
    scene = Scene()
    for _ in range(3):
        scene.add([[True]])
    scene.set([0, 1], owner=2)
    scene.remove(2)
    again = reloaded(scene, tmp_path)
    assert again.owner([0, 1]).tolist() == [2, 2] and again.add([[True]]) == scene.add([[True]]) == 3


def test_ids_of_removed_objects_are_not_given_out_again(tmp_path: Path) -> None:
    """Also where no object is left, or the last ones belong to no one."""
    scene = Scene()
    for _ in range(4):
        scene.add([[True]])
    for gone in ([2, 3], [0, 1]):
        scene.remove(gone)
        assert reloaded(scene, tmp_path).add([[True]]) == 4
    file = tmp_path / "scene.json"
    scene.add([[True]])
    scene.save(tmp_path)
    assert "next_id" not in file.read_text()
    file.write_text(file.read_text().replace('"objects"', '"next_id": 3, "objects"'))
    with pytest.raises(InputError, match=r"next_id: expected a whole number from 5 to .*, got 3"):
        load_scene(tmp_path)


def test_owners_that_own_each_other(tmp_path: Path) -> None:
    """Owners are one level deep: each of the two is a part of the other, in Python and in a file."""
    scene = Scene()
    a, b = scene.add([[True]], (0, 0)), scene.add([[True]], (1, 0), owner=0)
    scene.set(a, owner=b)
    rows: list[dict[str, Any]] = [
        {"mask": ["#"], "position_xy": [0, 0], "name": "a", "owner": "b"},
        {"mask": ["#"], "position_xy": [1, 0], "name": "b", "owner": "a"},
    ]
    read = load_scene(folder_of(tmp_path / "file", {"format": FORMAT, "objects": {"hittable": rows}}))
    for each in (scene, reloaded(scene, tmp_path / "saved"), read):
        assert each.owner([a, b]).tolist() == [b, a]
        assert fire(each, Disc(3), (0, 0), exclude=a).object.tolist() == [a]


@pytest.mark.parametrize(
    "mask",
    [np.zeros((0, 5), np.bool_), np.zeros((3, 0), np.bool_), np.zeros((3, 2), np.bool_)],
    ids=["no rows", "no columns", "nothing set"],
)
def test_an_empty_mask_is_refused_or_kept(tmp_path: Path, mask: np.ndarray) -> None:
    scene = Scene()
    try:
        scene.add(mask)
        scene.add(np.dstack([mask.astype(np.uint8)] * 4))
    except InputError:
        assert mask.size == 0
    reloaded(scene, tmp_path)


@pytest.mark.parametrize("name", ["x" * 201, 5, "\ud800"], ids=["long", "number", "half a letter"])
def test_a_name_that_a_file_cannot_hold_is_refused(name: Any) -> None:
    for make in (lambda: Scene().add([[True]], name=name), lambda: Scene(name=name), lambda: Scene(categories=[name])):
        with pytest.raises(InputError, match="expected a text of 1 to 200 characters"):
            make()


def test_an_object_without_a_name_is_called_by_its_number(tmp_path: Path) -> None:
    scene = Scene()
    for name in (None, "", "x" * 200):
        scene.add([[True]], name=name)
    assert [reloaded(scene, tmp_path).name_of(i) for i in range(3)] == ["hittable 0", "hittable 1", "x" * 200]
    with pytest.raises(InputError, match="name: expected a text of 1 to 200 characters, got ''"):
        Scene(name="")


PARTS = st.sampled_from(["a", "b.c", "con", "Nul .x", "com1", "..", ".", "C:", "d\\e", "\0", "", "x" * 99, "y" * 97])
NOT_INSIDE = (
    "con.png",
    "C:x.png",
    "a\\b.png",
    "../x.png",
    "/x.png",
    "sub/aux.tar.png",
    "x\0.png",
    "",
    5,
    None,
    "x" * 201,
)


@given(
    st.lists(PARTS, min_size=1, max_size=4), st.sampled_from(["", "/", "-2", "x"]), st.sampled_from(["", ".png", "."])
)
@example(["x" * 99, "y" * 97], "/", "")
@example(["x" * 99, "y" * 97], "x", "")
def test_an_image_is_refused_or_can_be_loaded_again(parts: list[str], mark: str, ending: str) -> None:
    """Two sprites of one name, so that one is written under another."""
    name = mark.join(parts) + ending
    try:
        sprites = [Sprite.from_image(SHEET, source={"image": name}), Sprite.from_image(KEYED, source={"image": name})]
    except InputError as error:
        assert str(error).startswith("source.image: expected")
        return
    scene = Scene()
    for sprite in sprites:
        scene.add(sprite)
    with tempfile.TemporaryDirectory() as folder:
        reloaded(scene, Path(folder))


@pytest.mark.parametrize("name", NOT_INSIDE, ids=repr)
def test_an_image_that_could_not_be_loaded_is_refused_before_anything_is_written(name: Any, tmp_path: Path) -> None:
    for make in (
        lambda: Sprite.from_image(SHEET, source={"image": name}),
        lambda: Sprite.from_mask(np.ones((70, 70), bool), source={"image": name}),
    ):
        with pytest.raises(InputError, match=r"^source\.image: expected a (path inside the scene's folder|text of)"):
            make()
    scene, sprite = Scene(), Sprite.from_image(SHEET)
    scene.add(Sprite.from_image(KEYED))
    scene.add(sprite)
    assert sprite.source is not None
    sprite.source["image"] = name
    with pytest.raises(InputError, match=r"^object 1: source\.image: expected a"):
        scene.save(tmp_path / "saved")
    assert not list(tmp_path.iterdir())


def test_what_a_source_says_of_alpha_does_not_change_a_mask(tmp_path: Path) -> None:
    """A threshold that the image was not cut by; and one of a mask, whose pixels are opaque."""
    scene = Scene()
    scene.add(Sprite.from_image(SHEET, alpha_threshold=40, source={"alpha_threshold": 999}))
    scene.add(Sprite.from_mask(np.ones((70, 70), bool), source={"alpha_threshold": 255}))
    reloaded(scene, tmp_path)


def test_frames_that_make_a_wide_sheet_are_kept(tmp_path: Path) -> None:
    """Side by side they would be wider than an image may be."""
    scene = Scene()
    image = RNG.integers(0, 256, (2, 2000, 4)).astype(np.uint8)
    sprite = Sprite.from_image(image, rects_xywh=[[x, 0, 1950, 2] for x in range(20)])
    scene.add(sprite, frame=19)
    reloaded(scene, tmp_path)


@pytest.mark.parametrize("value", [math.nan, math.inf, np.int64(3), {1, 2}], ids=["nan", "inf", "numpy", "set"])
def test_weapons_that_are_not_json_are_refused(tmp_path: Path, value: Any) -> None:
    scene = Scene()
    scene.save(tmp_path)
    before = (tmp_path / "scene.json").read_bytes()
    scene.weapons = {"w": {"radius": value}}
    with pytest.raises(InputError, match="weapons"):
        scene.save(tmp_path)
    assert (tmp_path / "scene.json").read_bytes() == before


# Files are not lost


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_an_image_is_never_overwritten_with_another(tmp_path: Path) -> None:
    other = np.zeros((5, 5, 4), np.uint8)
    for name in ("sheet.png", "sprite.png"):
        write_png(tmp_path / name, other)
    before = contents(tmp_path)
    scene = load_scene(folder_of(tmp_path / "source", FULL))
    scene.add(SHEET)
    scene.save(tmp_path)
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert load_scene(tmp_path).content_hash() == scene.content_hash()
    files = sorted(p.name for p in tmp_path.glob("*.png"))
    scene.save(tmp_path)
    assert sorted(p.name for p in tmp_path.glob("*.png")) == files


def test_saving_a_scene_in_place_keeps_its_images(tmp_path: Path) -> None:
    """An image whose pixels are changed by a colour key is written beside its source."""
    folder = folder_of(tmp_path, FULL)
    before = contents(folder)
    scene = load_scene(folder)
    scene.save(folder)
    after = contents(folder)
    assert {k: v for k, v in after.items() if k in before and k != "scene.json"} == {
        k: v for k, v in before.items() if k != "scene.json"
    }
    assert load_scene(folder).content_hash() == scene.content_hash()


def test_a_file_that_is_no_image_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "sprite.png").write_text("notes")
    scene = Scene()
    scene.add(SHEET)
    scene.save(tmp_path)
    assert (tmp_path / "sprite.png").read_text() == "notes"
    assert load_scene(tmp_path).content_hash() == scene.content_hash() and (tmp_path / "sprite-2.png").is_file()


def test_each_image_is_looked_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many want the same name."""
    scene = Scene()
    for i in range(40):
        scene.add(np.full((2, 2, 4), i + 1, np.uint8) | np.uint8(128), (i, 0))
    scene.save(tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    looked: list[str] = []

    def counted(path: Path) -> Any:
        looked.append(path.name)
        return read_png(path)

    monkeypatch.setattr(scene_folder, "read_png", counted)
    scene.save(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert len(looked) == len(set(looked)) > 20


def test_an_interrupted_save_leaves_the_old_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = folder_of(tmp_path, FULL)
    scene = load_scene(folder)
    before = scene.content_hash()
    scene.add(Sprite.from_image(SHEET[::-1]), (3, 30))

    def fail(path: Path, text: str) -> None:
        raise InputError("output: cannot write")

    monkeypatch.setattr(scene_folder, "write_text", fail)
    with pytest.raises(InputError, match="output"):
        scene.save(folder)
    assert load_scene(folder).content_hash() == before


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for folder in (tmp_path / "file", tmp_path / "file" / "deep"):
        with pytest.raises(InputError, match="folder: cannot make"):
            Scene().save(folder)


# What is refused


BAD_FILES: dict[str, tuple[Any, str]] = {
    "not JSON": ("{", r"expected one JSON value"),
    "empty": ("", r"expected one JSON value"),
    "a list": ("[]", r"scene: expected an object, got \[\]"),
    "byte order mark": ("\ufeff{}", "expected one JSON value"),
    "deep": ("[" * 200_000, "expected one JSON value"),
    "many digits": ('{"format": ' + "1" * 5000 + "}", r"scene\.json: "),
    "duplicate key": ('{"format": 1, "name": "a", "name": "b"}', "key: expected each key once, got 'name' again"),
    "deep duplicate": ('{"weapons": {"w": {"kind": 1, "kind": 2}}}', "expected each key once, got 'kind' again"),
    "NaN": ('{"format": NaN}', "format: expected a finite number, got NaN"),
    "-Infinity": ('{"weapons": {"w": -Infinity}}', "weapons: w: expected a finite number, got -Infinity"),
    "no format": ({}, "format: expected 'hitplanes-scene/2', got nothing"),
    "wrong format": ({"format": "hitplanes-scene/3"}, "format: expected .*got 'hitplanes-scene/3'"),
    "unknown key": ({"format": FORMAT, "object": {}}, "key: .*got 'object' .did you mean 'objects'"),
    "name": ({"format": FORMAT, "name": 5}, "name: expected a text of 1 to 200 characters, got 5"),
    "long name": ({"format": FORMAT, "name": "x" * 201}, "name: expected a text of 1 to 200"),
    "bounds": ({"format": FORMAT, "bounds": [1, 2]}, r"bounds: expected an object, got \[1, 2\]"),
    "bounds size": ({"format": FORMAT, "bounds": {"size_wh": [0, 5]}}, r"bounds: size_wh\[0\]: .*got 0"),
    "bounds without size": ({"format": FORMAT, "bounds": {}}, "bounds: size_wh: expected"),
    "bounds key": ({"format": FORMAT, "bounds": {"size": [4, 4]}}, "bounds: key: .*did you mean 'size_wh'"),
    "bounds origin": ({"format": FORMAT, "bounds": {"size_wh": [4, 4], "origin_xy": [0.5, 0]}}, r"bounds: origin_xy"),
    "categories": ({"format": FORMAT, "categories": "a"}, "categories: expected a list, got 'a'"),
    "category": ({"format": FORMAT, "categories": ["a", 5]}, r"categories\[1\]: expected a text"),
    "categories twice": ({"format": FORMAT, "categories": ["a", "a"]}, "categories: expected distinct names"),
    "category default": ({"format": FORMAT, "categories": ["default"]}, "categories: expected distinct names"),
    "32 categories": ({"format": FORMAT, "categories": [f"c{i}" for i in range(32)]}, "categories: .*at most 31"),
    "weapons": ({"format": FORMAT, "weapons": []}, r"weapons: expected an object, got \[\]"),
    "shots": ({"format": FORMAT, "shots": {}}, r"shots: expected a list, got \{\}"),
    "objects": ({"format": FORMAT, "objects": []}, r"objects: expected an object, got \[\]"),
    "section": ({"format": FORMAT, "objects": {"hitable": []}}, "got 'hitable' .did you mean 'hittable'"),
    "section list": ({"format": FORMAT, "objects": {"hud": {}}}, r"objects: hud: expected a list, got \{\}"),
    "object": ({"format": FORMAT, "objects": {"movers": [5]}}, r"objects\.movers\[0\]: expected an object"),
    "some ids": (
        {"format": FORMAT, "objects": {"movers": [{"circle": 1, "position_xy": [0, 0], "id": 1}],
                                       "hud": [{"circle": 1, "position_xy": [0, 0]}]}},
        "objects: expected an id for each object or for none",
    ),
    "owner that never was": (
        {"format": FORMAT, "objects": {"hud": [{"circle": 1, "position_xy": [0, 0], "id": 1, "owner": 2}]}},
        r"objects.hud\[0\]: owner: expected .* from 0 to 1, got 2: if .* removed, the scene needs a next_id of 3$",
    ),
    "next id": ({"format": FORMAT, "next_id": 2**28 + 1}, "next_id: expected a whole number from 0 to 268435456"),
    "ids twice": (
        {"format": FORMAT, "objects": {"hud": [{"circle": 1, "position_xy": [0, 0], "id": 1}] * 2}},
        "id: expected each id once, got 1 again",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_bad_file_is_named(tmp_path: Path, case: str) -> None:
    data, message = BAD_FILES[case]
    with pytest.raises(InputError, match=message) as caught:
        load_scene(folder_of(tmp_path, data))
    assert str(tmp_path / "scene.json") in str(caught.value)


PLACED: dict[str, Any] = {"circle": 3, "position_xy": [0, 0]}
IMAGE: dict[str, Any] = {"image": "sheet.png", "position_xy": [0, 0]}

BAD_OBJECTS: dict[str, tuple[dict[str, Any], str]] = {
    "no source": ({"position_xy": [0, 0]}, "source: expected one of image, .*got none"),
    "two sources": ({**PLACED, "mask": ["#"]}, "source: expected one of .*got circle and mask"),
    "no position": ({"circle": 3}, "position_xy: expected two numbers, got nothing"),
    "position": ({"circle": 3, "position_xy": 4}, r"position_xy: expected shape \(2,\), got \(\)"),
    "position of text": ({"circle": 3, "position_xy": ["1", "2"]}, "position_xy: expected numbers"),
    "position null": ({"circle": 3, "position_xy": [1, None]}, "position_xy: expected numbers"),
    "position ragged": ({"circle": 3, "position_xy": [1, [2]]}, "position_xy: expected"),
    "position far": ({"circle": 3, "position_xy": [0, 2e12]}, r"position_xy\[1\]: expected a number within"),
    "400 digits of a position": (
        {"circle": 3, "position_xy": [0, 10**400]}, r"position_xy\[1\]: expected a number within"),
    "unknown key": ({**PLACED, "positon": 3}, "key: .*got 'positon' .did you mean 'position_xy'"),
    "key of another source": ({**PLACED, "alpha_threshold": 3}, "key: .*got 'alpha_threshold'"),
    "pivot of a shape": ({**PLACED, "pivot_xy": [0, 0]}, "key: .*got 'pivot_xy'"),
    "name": ({**PLACED, "name": ""}, "name: expected a text of 1 to 200 characters, got ''"),
    "id": ({**PLACED, "id": -1}, "id: expected a whole number from 0"),
    "id text": ({**PLACED, "id": "1"}, "id: expected a whole number"),
    "angle": ({**PLACED, "angle": "up"}, "angle: expected a number"),
    "angle null": ({**PLACED, "angle": None}, "angle: expected a number"),
    "scale": ({**PLACED, "scale": 0}, "scale: expected a number from"),
    "scale of three": ({**PLACED, "scale": [1, 2, 3]}, r"scale: expected shape \(2,\)"),
    "scale ragged": ({**PLACED, "scale": [1, [2, 3]]}, "scale: expected"),
    "scale object": ({**PLACED, "scale": {}}, "scale: expected a number"),
    "scale too large": ({"mask": ["#" * 300] * 300, "position_xy": [0, 0], "scale": 256}, "scale: expected a mask of"),
    "flip": ({**PLACED, "flip": "left"}, "flip: expected one of .*got 'left'"),
    "flip list": ({**PLACED, "flip": ["x"]}, "flip: expected one of"),
    "frame": ({**PLACED, "frame": 1}, "frame: expected a whole number from 0 to 0, got 1"),
    "layer": ({**PLACED, "layer": 1.5}, "layer: expected a whole number"),
    "layer true": ({**PLACED, "layer": True}, "layer: expected a whole number .*got True"),
    "categories": ({**PLACED, "categories": "target"}, "categories: expected a list, got 'target'"),
    "category": ({**PLACED, "categories": ["targte"]}, "categories: .*got 'targte' .did you mean 'target'"),
    "category twice": ({**PLACED, "categories": ["target", "target"]}, "categories: expected distinct names"),
    "owner": ({**PLACED, "owner": "nobody"}, "owner: .*got 'nobody'"),
    "owner number": ({**PLACED, "owner": 7}, "owner"),
    "owner true": ({**PLACED, "owner": True}, "owner: expected a whole number"),
    "owner list": ({**PLACED, "owner": [0]}, "owner: expected a whole number"),
    "circle": ({"circle": -1, "position_xy": [0, 0]}, "circle: expected a number from 0"),
    "circle list": ({"circle": [1, 2], "position_xy": [0, 0]}, r"circle: expected shape \(\)"),
    "circle null": ({"circle": None, "position_xy": [0, 0]}, "circle: expected a number"),
    "box": ({"box_wh": [1], "position_xy": [0, 0]}, r"box_wh: expected shape \(2,\)"),
    "box negative": ({"box_wh": [1, -2], "position_xy": [0, 0]}, r"box_wh\[1\]: expected a number from 0"),
    "polygon": ({"polygon": [[0, 0], [1, 1]], "position_xy": [0, 0]}, "polygon: expected 3 points or more"),
    "polygon null": ({"polygon": None, "position_xy": [0, 0]}, "polygon: expected numbers"),
    "polygon point": (
        {"polygon": [[0, 0], [1, 1], [2]], "position_xy": [0, 0]},
        r"polygon: expected an array of shape \(any, 2\) with rows of one length, got \[\[0, 0\], \[1, 1\], \[2\]\]"),
    "holes": ({"polygon": [[0, 0], [1, 1], [2, 0]], "holes": 5, "position_xy": [0, 0]}, "holes: expected a list"),
    "hole": ({"polygon": [[0, 0], [1, 1], [2, 0]], "holes": [[[0, 0]]], "position_xy": [0, 0]}, r"holes\[0\]: "),
    "color": ({**PLACED, "color": "red"}, "color: expected numbers"),
    "color range": ({**PLACED, "color": [0, 0, 256]}, r"color\[2\]: .*from 0 to 255, got 256"),
    "mask rows": ({"mask": ["##", "#"], "position_xy": [0, 0]}, r"mask\[1\]: expected 2 of '#' and '.', got '#'"),
    "mask letters": ({"mask": ["#x"], "position_xy": [0, 0]}, r"mask\[0\]: expected 2 of '#' and '.', got '#x'"),
    "mask mixed": ({"mask": ["#", 1], "position_xy": [0, 0]}, r"mask\[1\]: expected 1 of"),
    "mask text": ({"mask": "##", "position_xy": [0, 0]}, "mask: expected a PNG file, got '##'"),
    "mask up": ({"mask": "../sheet.png", "position_xy": [0, 0]}, "mask: expected a path inside the scene's folder"),
    "mask empty": ({"mask": [], "position_xy": [0, 0]}, "mask: expected"),
    "mask of twos": ({"mask": [[0, 2]], "position_xy": [0, 0]}, r"mask\[0\]\[1\]: expected 0 or 1, got 2"),
    "image missing": ({**IMAGE, "image": "none.png"}, "image: expected a PNG file, got 'none.png'"),
    "image number": ({**IMAGE, "image": 5}, "image: expected a text"),
    "image is the scene": ({**IMAGE, "image": "scene.json"}, "image: 'scene.json': expected a PNG file"),
    "image is a folder": ({**IMAGE, "image": "sub"}, "image: expected a PNG file, got 'sub'"),
    "image up": ({**IMAGE, "image": "../sheet.png"}, "image: expected a path inside the scene's folder"),
    "image up and down": ({**IMAGE, "image": "sub/../sheet.png"}, "image: expected a path inside the scene's folder"),
    "image absolute": ({**IMAGE, "image": "/etc/passwd"}, "image: expected a path inside the scene's folder"),
    "image backslash": ({**IMAGE, "image": "sub\\keyed.png"}, "image: expected a path inside the scene's folder"),
    "image drive": ({**IMAGE, "image": "c:sheet.png"}, "image: expected a path inside the scene's folder"),
    "image link": ({**IMAGE, "image": "link.png"}, "image: expected a path inside .*which leads out of it"),
    "image linked folder": ({**IMAGE, "image": "linked/a.png"}, "image: expected a path inside .*leads out of it"),
    "image link to itself": ({**IMAGE, "image": "loop.png"}, "image: expected"),
    "image with a zero": ({**IMAGE, "image": "a\0.png"}, "image: expected"),
    "image half a letter": ({**IMAGE, "image": "\ud800.png"}, "image: expected"),
    "frames": ({**IMAGE, "frames": [3, 2]}, r"frames: expected an object, got \[3, 2\]"),
    "frames key": ({**IMAGE, "frames": {"grid": [3, 2]}}, "key: .*got 'grid' .did you mean 'grid_wh'"),
    "frames grid": ({**IMAGE, "frames": {"grid_wh": [4, 2]}}, "grid_wh: expected to divide the image of 6 x 4"),
    "frames rects": ({**IMAGE, "frames": {"rects_xywh": [[0, 0, 7, 1]]}}, r"rects_xywh\[0\]: expected to lie in"),
    "frames neither": ({**IMAGE, "frames": {}}, "frames: expected grid_wh or rects_xywh, got neither"),
    "frames both": ({**IMAGE, "frames": {"grid_wh": [3, 2], "rects_xywh": [[0, 0, 1, 1]]}}, "frames: .*got both"),
    "frame of sheet": ({**IMAGE, "frames": {"grid_wh": [3, 2]}, "frame": 4}, "frame: .*from 0 to 3, got 4"),
    "threshold": ({**IMAGE, "alpha_threshold": 300}, "alpha_threshold: .*from 0 to 255, got 300"),
    "color key": ({**IMAGE, "color_key": [1, 2]}, r"color_key: expected shape \(3,\)"),
    "pivot": ({**IMAGE, "pivot_xy": [1]}, r"pivot_xy: expected shape \(2,\)"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_OBJECTS)
def test_a_bad_object_is_named_with_its_section_and_row(tmp_path: Path, case: str) -> None:
    values, message = BAD_OBJECTS[case]
    folder = folder_of(tmp_path / "scene", with_object(**values))
    (folder / "link.png").symlink_to(tmp_path / "outside.png")
    (folder / "linked").symlink_to(tmp_path)
    (folder / "loop.png").symlink_to("loop.png")
    write_png(tmp_path / "outside.png", SHEET)
    write_png(tmp_path / "a.png", SHEET)
    with pytest.raises(InputError, match=message) as caught:
        load_scene(folder)
    assert f"{folder / 'scene.json'}: objects.hittable[1]: " in str(caught.value)


def test_a_link_that_stays_inside_is_followed(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, with_object(image="link.png", position_xy=[0, 0]))
    (folder / "link.png").symlink_to(folder / "sub" / "keyed.png")
    assert np.array_equal(load_scene(folder).mask(1)[0], np.ones((3, 3)))


def test_a_file_that_is_not_utf_8_is_named(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_bytes(b'{"format": "\xff"}')
    with pytest.raises(InputError, match=r"scene\.json: expected JSON in UTF-8"):
        load_scene(tmp_path)


@pytest.mark.parametrize("is_folder", [False, True])
def test_a_missing_scene_is_named(tmp_path: Path, is_folder: bool) -> None:
    if is_folder:
        (tmp_path / "scene.json").mkdir()
    with pytest.raises(InputError, match=r"scene\.json: cannot read it"):
        load_scene(tmp_path)


def test_an_id_far_away_does_not_fill_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns are made up to the largest id, so that one has to be within a limit."""
    reserve = Items._reserve

    def careful(self: Items, count: int) -> None:
        assert count < 10**8, "columns for that many objects"
        reserve(self, count)

    monkeypatch.setattr(Items, "_reserve", careful)
    with pytest.raises(InputError, match=r"id"):
        load_scene(folder_of(tmp_path, {"format": FORMAT, "objects": {"hud": [{**PLACED, "id": 2**31}]}}))


def test_masks_of_a_loaded_scene_are_made_all_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, made = Scene((99, 99)), []
    for k in range(20):
        scene.add(np.ones((5, 9), np.bool_), (50, 50), angle=7.0 * k + 1)
    scene.save(tmp_path / "scene")
    make = Items.make_masks
    monkeypatch.setattr(Items, "make_masks", lambda items: made.append(len(items.unmade)) or make(items))
    loaded = load_scene(tmp_path / "scene")
    assert fire(loaded, Disc(3), (50, 50)) and made == [20]
