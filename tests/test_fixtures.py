"""Each bundled scene is what its script draws, and what its name says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planes import Role, load_scene
from planes.image import read_png
from weapons import arsenal_of
from weapons.arsenal import KINDS
from weapons.orders import fire_order, orders_of

ROOT = Path(__file__).parents[1]
FIXTURES = ROOT / "fixtures"
GALLERY = FIXTURES / "gallery"
SCENES = sorted(path.parent.name for path in FIXTURES.glob("*/scene.json"))


def files_of(folder: Path) -> set[str]:
    """Names of what a script draws: all but scripts."""
    return {path.name for path in folder.iterdir() if path.suffix != ".py" and path.name != "__pycache__"}


def test_every_scene_has_a_script() -> None:
    assert [path.parent.name for path in sorted(FIXTURES.glob("*/draw.py"))] == SCENES


@pytest.mark.parametrize("name", SCENES)
def test_script_draws_what_is_in_the_folder(name: str, tmp_path: Path) -> None:
    folder = FIXTURES / name
    words = [sys.executable, "-W", "error", str(folder / "draw.py"), str(tmp_path)]
    subprocess.run(words, check=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert files_of(tmp_path) == files_of(folder)
    assert (tmp_path / "scene.json").read_bytes() == (folder / "scene.json").read_bytes()
    for file in sorted(file for file in files_of(folder) if file.endswith(".png")):
        assert np.array_equal(read_png(tmp_path / file), read_png(folder / file)), file


def test_gallery_has_what_a_first_scene_should_show() -> None:
    scene = load_scene(GALLERY)
    assert all(len(scene.ids(role)) for role in Role)
    assert {weapon.kind for weapon in arsenal_of(scene).values()} == set(KINDS)
    assert 1 in scene.mask(scene.find("robot"))[0].sum(axis=1), "a mast of one pixel"
    hoop, _ = scene.mask(scene.find("hoop"))
    assert not hoop[hoop.shape[0] // 2, hoop.shape[1] // 2], "a ring with a hole"
    layers = scene.items.layer
    assert layers[scene.find("back waves")] < layers[scene.find("duck 1")] < layers[scene.find("front waves")]


def test_gallery_shots_show_every_outcome() -> None:
    scene = load_scene(GALLERY)
    found = [fire_order(scene, order) for order in orders_of(scene, arsenal_of(scene))]
    counts = sum(hits.verdicts for hits in found).sum(axis=0)
    assert (counts[:4] > 0).all()
    names = [[scene.name_of(row.object) for row in hits] for hits in found]
    assert names[1] == ["coin", "hoop"], "pellets through the ring's hole"
    assert names[3] == ["duck 1", "duck 2", "duck 3"], "a beam that pierces"
    assert found[6].why_not(0)[0].reason == "category"
