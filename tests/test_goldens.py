"""Shots of every fixture scene against their goldens: the hits in words, the planes, the picture without text."""

from __future__ import annotations

from pathlib import Path

import pytest

from planes import load_scene
from weapons import arsenal_of
from weapons.golden import HitsGolden
from weapons.orders import fire_order, orders_of

FIXTURES = Path(__file__).parents[1] / "fixtures"
SCENES = sorted(path.parent.name for path in FIXTURES.glob("*/scene.json"))


@pytest.mark.parametrize("row", [0, 2])
@pytest.mark.parametrize("name", SCENES)
def test_fired_at(name: str, row: int, hits_golden: HitsGolden) -> None:
    scene = load_scene(FIXTURES / name)
    hits_golden(fire_order(scene, orders_of(scene, arsenal_of(scene))[row]))
