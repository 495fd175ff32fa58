"""The bundled scene is what its script draws."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from planes import Role, load_scene
from planes.image import read_png
from weapons import arsenal_of
from weapons.arsenal import KINDS
from weapons.orders import fire_order, orders_of

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"


def test_script_draws_the_gallery(tmp_path: Path) -> None:
    shutil.copy(GALLERY / "draw.py", tmp_path)
    subprocess.run([sys.executable, "-W", "error", str(tmp_path / "draw.py")], check=True, cwd=GALLERY.parents[1])
    names = {path.name for path in GALLERY.iterdir()} - {"__pycache__"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert (tmp_path / "scene.json").read_text() == (GALLERY / "scene.json").read_text()
    for name in sorted(n for n in names if n.endswith(".png")):
        assert np.array_equal(read_png(tmp_path / name), read_png(GALLERY / name)), name


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
