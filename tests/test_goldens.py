"""Shots of every fixture scene against their goldens: the hits in words, the planes, the picture without text.

All weapons of rays are in a record of the corridor, one line a shot; --hits-update writes it anew, too.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hitplanes import Scene, load_scene, weapons_of
from hitplanes.weapons.golden.__init__ import HitsGolden
from hitplanes.weapons.rays.contacts import Reason
from hitplanes.weapons.replay.record import ShotRecord, replay
from hitplanes.weapons.replay.shot_log import fire_request, requests_of

FIXTURES = Path(__file__).parents[1] / "fixtures"
SCENES = sorted(path.parent.name for path in FIXTURES.glob("*/scene.json"))


@pytest.mark.parametrize("row", [0, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", SCENES)
def test_fired_at(name: str, row: int, hits_golden: HitsGolden) -> None:
    scene = load_scene(FIXTURES / name)
    hits_golden(fire_request(scene, requests_of(scene, weapons_of(scene))[row]))


RECORD = Path(__file__).parent / "goldens" / "corridor.jsonl"

WAYS = [((41, 125), (452, 105.25)), ((152.5, 172), (284, 172)), ((263, 57), (410, 57)), ((338, 170), (452, 195))]
"""Along the corridor, across the drone, through the doorway, and through glass: from where to where."""

NOT_GLASS = ["target", "friend", "wood"]


def record_all(scene: Scene, path: Path) -> None:
    """Fire every weapon along every way."""
    with ShotRecord(path) as record:
        for weapon in weapons_of(scene).values():
            for at, toward in WAYS:
                record.fire(scene, weapon, at, toward=toward, accept=NOT_GLASS, blocked_by=NOT_GLASS, seed=5)


def test_weapons_of_rays_do_what_they_did(request: pytest.FixtureRequest) -> None:
    scene = load_scene(FIXTURES / "corridor")
    if request.config.getoption("hits_update"):
        RECORD.unlink(missing_ok=True)
        record_all(scene, RECORD)
    assert replay(RECORD, scene) is None


def test_the_record_has_every_weapon_way_and_end() -> None:
    scene = load_scene(FIXTURES / "corridor")
    lines = [json.loads(line) for line in RECORD.read_text(encoding="utf-8").splitlines()[1:-1]]
    fired = [(weapon.to_json(), list(at)) for weapon in weapons_of(scene).values() for at, _ in WAYS]
    assert [(line["weapon"], line["at"]) for line in lines] == fired
    reasons = {stop["reason"] for line in lines for stop in line["result"]["stops"]}
    assert reasons == {int(reason) for reason in Reason}
