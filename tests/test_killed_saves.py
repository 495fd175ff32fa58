"""A save that is killed at any step leaves the old scene or the new one, whole, and can be saved again."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_of import in_turn

from hitplanes import Disc, Scene, Sprite, fire, load_scene

FILES = ("open", "os.rename", "os.remove", "os.mkdir")
"""Audit events of what changes or opens files."""

KILLED, DONE = 7, 0

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="a save is killed in a forked process")


def scene_of(shade: int) -> Scene:
    scene = Scene((90, 60), name=f"shade {shade}")
    pictures = [np.full((9, 12 + k, 3), shade + k, np.uint8) for k in range(2)]
    for k in range(4):
        scene.add(Sprite.from_images(pictures[: 1 + k % 2]), (20 * k + shade % 3, 30), angle=9 * k)
    scene.add(np.ones((80, 90), np.bool_), (40, 50), role="occluder", layer=-1)
    scene.carve(fire(scene, Disc(5), (20, 30)))
    return scene


def killed_after(step: int, save: Callable[[], None], folder: Path, *, halfway: bool = False) -> int:
    """Save in a process that dies at its step-th use of a file, or halfway in its step-th write; how it ended."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    left, write = [step], Path.write_bytes

    def die_in_turn() -> None:
        left[0] -= 1
        if left[0] < 0:
            os._exit(KILLED)

    def watch(event: str, given: tuple[Any, ...]) -> None:
        if event in FILES and str(given[0]).startswith(str(folder)):
            die_in_turn()

    def write_half(path: Path, data: bytes) -> int:
        if left[0] == 0:
            write(path, data[: len(data) // 2])
        die_in_turn()
        return write(path, data)

    try:
        if halfway:
            Path.write_bytes = write_half  # type: ignore[method-assign]
        else:
            sys.addaudithook(watch)
        save()
        os._exit(DONE)
    finally:
        os._exit(1)


@pytest.mark.parametrize(("first", "halfway"), in_turn([True, False], [False, True]))
def test_a_save_that_is_killed_leaves_one_of_the_scenes_whole(tmp_path: Path, first: bool, halfway: bool) -> None:
    old, new = scene_of(50), scene_of(100)
    whole, folder = {}, tmp_path / "level"
    for scene in (old, new):
        scene.save(tmp_path / scene.name)
        whole[scene.content_hash()] = load_scene(tmp_path / scene.name)
    seen: list[str] = []
    for step in range(1000):
        shutil.rmtree(folder, ignore_errors=True)
        if first:
            old.save(folder)
        ended = killed_after(step, lambda: new.save(folder), folder, halfway=halfway)
        assert ended in (KILLED, DONE)
        if first or (folder / "scene.json").exists():
            seen.append(load_scene(folder).content_hash())
            left = whole[seen[-1]]
            assert load_scene(folder).name == left.name
            assert pictures_of(load_scene(folder)) == pictures_of(left)
        new.save(folder)
        assert load_scene(folder).content_hash() == new.content_hash()
        if ended == DONE:
            break
    assert ended == DONE and step >= (4 if halfway else 10) and seen[-1] == new.content_hash()
    assert not first or seen[0] == old.content_hash()
    if not halfway:
        assert seen == sorted(seen, key=[old.content_hash(), new.content_hash()].index)


def pictures_of(scene: Scene) -> list[bytes]:
    """Every image of a scene, which its hash leaves out."""
    frames = [frame.image for item in scene for frame in scene.sprite(item).frames]
    return [image.tobytes() for image in frames if image is not None]
