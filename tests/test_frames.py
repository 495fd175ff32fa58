"""Frames of a sprite: images of their own, names, and a pivot for each, in Python and in scene files."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import oracle_sprite
import pytest

from hitplanes import InputError, Scene, Sprite, load_scene, write_png

SIZES = [(7, 5), (3, 4), (9, 2)]
NAMES = ["idle", "run_1", "run_2"]
PIVOTS = [(3, 2.5), (-4, 1.25), (8.5, 9)]


def images() -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    return [rng.integers(0, 256, (h, w, 4), np.uint8) for w, h in SIZES]


def runner(**options: Any) -> Sprite:
    return Sprite.from_images(images(), **{"pivot_xy": PIVOTS, "frame_names": NAMES, **options})


def sheet() -> tuple[np.ndarray, list[list[int]]]:
    """The images on one sheet, trimmed, each at a place of its own."""
    plane, rects = np.zeros((20, 20, 4), np.uint8), []
    for number, image in enumerate(images()):
        h, w = image.shape[:2]
        x, y = 3 + 2 * number, 6 * number + 1
        plane[y : y + h, x : x + w] = image
        rects.append([x, y, w, h])
    return plane, rects


def pixels_of(scene: Scene, item: int) -> set[tuple[int, int]]:
    mask, (x, y) = scene.mask(item)
    return {(x + int(i), y + int(j)) for j, i in np.argwhere(mask)}


@pytest.mark.parametrize("flip", ["none", "x", "xy"])
@pytest.mark.parametrize("made", ["images", "sheet"])
def test_each_frame_is_placed_by_its_own_pivot(made: str, flip: str) -> None:
    plane, rects = sheet()
    cut = Sprite.from_image(plane, rects_xywh=rects, pivot_xy=PIVOTS, frame_names=NAMES)
    scene = Scene()
    item = scene.add(runner() if made == "images" else cut, (40.25, 30), flip=flip)
    for number, (image, pivot) in enumerate(zip(images(), PIVOTS, strict=True)):
        scene.set(item, frame=number)
        at = tuple(round(256 * v) for v in pivot)
        turn = oracle_sprite.Turn(flip=flip)
        expected = oracle_sprite.placed_mask((image[:, :, 3] > 127).tolist(), at, turn, (40 * 256 + 64, 30 * 256))
        assert pixels_of(scene, item) == expected
        scene.set(item, angle=90)
        turn = oracle_sprite.Turn(flip=flip, quarter=1)
        expected = oracle_sprite.placed_mask((image[:, :, 3] > 127).tolist(), at, turn, (40 * 256 + 64, 30 * 256))
        assert pixels_of(scene, item) == expected
        scene.set(item, angle=0)


def test_one_pivot_is_that_of_every_frame_and_none_is_the_centre_of_each() -> None:
    scene = Scene()
    for options, pivots in (({"pivot_xy": (1, 2)}, [(1, 2)] * 3), ({"pivot_xy": None}, [(3, 2), (1, 1.5), (4, 0.5)])):
        item, each = scene.add(runner(**options)), scene.add(runner(pivot_xy=pivots))
        for frame in NAMES:
            scene.set([item, each], frame=frame)
            assert pixels_of(scene, item) == pixels_of(scene, each)


def test_frames_have_names() -> None:
    scene = Scene()
    a, b = scene.add(runner(), frame="run_2"), scene.add(runner())
    assert scene.frame([a, b]).tolist() == [2, 0]
    scene.set([a, b], frame=["idle", "run_1"])
    assert scene.frame([a, b]).tolist() == [0, 1]
    scene.set([a, b], frame="run_2")
    assert scene.frame([a, b]).tolist() == [2, 2] and scene.sprite(a).frame_names == tuple(NAMES)
    scene.set(a, sprite=Sprite.from_images(images()[:1], frame_names=["wreck"]), frame="wreck")
    assert scene.frame(a) == 0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("jump", r"row 0: frame: expected one of 'idle', 'run_1', 'run_2', got 'jump'"),
        (["idle", "run1"], r"row 1: frame: expected a number from 0 to 0, as the frames have no names, got 'run1'"),
        (["idle", "run_1", "idle"], "frame: expected one for all or 2, got 3"),
        ([0, 3], r"row 1: frame: expected a whole number from 0 to 0, got 3"),
    ],
)
def test_a_frame_that_is_not_there_changes_nothing(change: Any, told: str) -> None:
    scene = Scene()
    ids = [scene.add(runner()), scene.add(np.ones((2, 2), np.bool_))]
    version = scene.version
    with pytest.raises(InputError, match=told):
        scene.set(ids, frame=change)
    assert scene.version == version and scene.frame(ids).tolist() == [0, 0]
    with pytest.raises(InputError, match=r"frame: expected one of 'idle', 'run_1', 'run_2', got 'run1' \(did you mean"):
        scene.add(runner(), frame="run1")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"images": []}, "images: expected 1 to 65536, got none"),
        ({"images": 5}, "images: expected a list, got 5"),
        ({"images": [images()[0], np.ones((3, 3))]}, r"images\[1\]: expected bytes of shape \(h, w, 3 or 4\), got"),
        ({"pivot_xy": PIVOTS[:2]}, r"pivot_xy: expected shape \(3, 2\), got \(2, 2\)"),
        ({"pivot_xy": [(1, 2), (3, 4), (5, float("nan"))]}, r"pivot_xy\[2\]\[1\]: expected a finite number, got nan"),
        ({"frame_names": ["a", "b"]}, "frame_names: expected one for each of 3 frames, got 2"),
        ({"frame_names": ["a", "b", "a"]}, "frame_names: expected distinct names"),
        ({"frame_names": ["a", "", "c"]}, r"frame_names\[1\]: expected a text"),
    ],
)
def test_frames_that_are_refused(options: dict[str, Any], told: str) -> None:
    given = {"images": images(), **options}
    with pytest.raises(InputError, match=told):
        Sprite.from_images(given.pop("images"), **given)


def test_frames_are_saved_loaded_and_pickled(tmp_path: Path) -> None:
    scene = Scene()
    ids = [scene.add(runner(), (20 * k, 9), frame=k) for k in range(3)]
    scene.save(tmp_path / "a")
    load_scene(tmp_path / "a").save(tmp_path / "b")
    for other in (load_scene(tmp_path / "a"), load_scene(tmp_path / "b"), pickle.loads(pickle.dumps(scene))):
        assert other.content_hash() == scene.content_hash() and other.sprite(1).frame_names == tuple(NAMES)
        for name in NAMES:
            for one in (scene, other):
                one.set(ids, frame=name)
            assert other.content_hash() == scene.content_hash()
        scene.set(ids, frame=[0, 1, 2])


def file_of(tmp_path: Path, entry: dict[str, Any]) -> Path:
    for number, image in enumerate(images()):
        write_png(tmp_path / f"{number}.png", image)
    objects = {"hittable": [{"position_xy": [9, 9], **entry}]}
    (tmp_path / "scene.json").write_text(json.dumps({"format": "hitplanes-scene/2", "objects": objects}))
    return tmp_path


def test_a_scene_file_lists_images(tmp_path: Path) -> None:
    entry = {"images": ["0.png", "1.png", "2.png"], "pivot_xy": PIVOTS, "frame_names": NAMES, "frame": "run_1"}
    scene = load_scene(file_of(tmp_path, entry))
    drawn = Scene()
    drawn.add(runner(), (9, 9), frame=1)
    assert scene.content_hash() == drawn.content_hash() and scene.frame(0) == 1
    scene.save(tmp_path)
    assert load_scene(tmp_path).content_hash() == drawn.content_hash()
    for number, image in enumerate(images()):
        write_png(tmp_path / "again.png", image)
        assert (tmp_path / "again.png").read_bytes() == (tmp_path / f"{number}.png").read_bytes()


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ({"images": ["0.png", "9.png"]}, "9.png"),
        ({"images": []}, "images: expected 1 to 65536, got none"),
        ({"images": ["../0.png"]}, "expected a path inside the scene's folder"),
        ({"images": ["0.png"], "image": "1.png"}, "source: expected one of .*, got image and images"),
        ({"images": ["0.png"], "frame": "x", "frame_names": ["y"]}, "frame: expected one of 'y', got 'x'"),
        ({"images": ["0.png"], "pivot_xy": [[1, 2], [3, 4]]}, r"pivot_xy: expected shape \(1, 2\), got \(2, 2\)"),
        ({"circle": 4, "carved": [{"image": "0.png"}]}, r"carved\[0\]: image: expected 13 x 13 cells, got 7 x 5"),
        ({"image": "0.png", "carved": [{"image": "0.png", "cells_per_px": 3}]}, "expected a power of two, got 3"),
        (
            {"image": "0.png", "carved": [{"image": "0.png"}] * 2},
            r"carved\[1\]: frame: expected each once, got 0 again",
        ),
        ({"image": "0.png", "carved": [{"image": "0.png", "frame": 1}]}, "frame: expected a whole number from 0 to 0"),
        ({"image": "0.png", "carved": [{"frame": 0}]}, "image: expected a value, got nothing"),
    ],
)
def test_scene_files_that_are_refused(tmp_path: Path, entry: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        load_scene(file_of(tmp_path, entry))
