"""One place and many aims, lines of sight, and scans."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hitplanes import (
    Beam,
    Cone,
    Disc,
    History,
    InputError,
    Pistol,
    Rounds,
    Scene,
    ShotRecord,
    Spread,
    Sweep,
    Weapon,
    fire,
    prepare,
    replay,
    report_of,
)

WEAPONS: dict[str, Weapon] = {
    "disc": Disc(30),
    "cone": Cone(40, 30),
    "pellets": Spread(Disc(4), count=8, radius=30),
    "beams": Rounds(Beam(50, 3), count=2, recoil_deg=5),
    "pistol": Pistol(60),
    "line of sight": Pistol(None),
    "fan": Sweep(Pistol(60), 40, 5),
}
HERE = (20.25, 30.5)
TARGETS = [(60, 31), (44, 8), (20, 55), (21, 30)]
AIMS = [0.0, -45.0, 90.0, 17.5]


def yard() -> Scene:
    """Three objects and a wall about a place."""
    scene = Scene((80, 60))
    for xy in [(50, 30), (40, 12), (24, 50)]:
        scene.add(np.ones((9, 9), np.bool_), xy)
    scene.add(np.ones((20, 3), np.bool_), (40, 34), role="occluder")
    return scene


# One place, many aims


@pytest.mark.parametrize("name", WEAPONS)
def test_one_place_is_that_of_every_target(name: str) -> None:
    scene, weapon = yard(), WEAPONS[name]
    expected = fire(scene, weapon, [HERE] * 4, toward=TARGETS, seed=3)
    found = fire(scene, weapon, HERE, toward=TARGETS, seed=3)
    assert len(found.shots) == 4 and found == expected and len(found)
    assert np.array_equal(found.verdicts, expected.verdicts)
    assert fire(scene, weapon, np.array(HERE), toward=np.array(TARGETS[:1]), seed=3).of(0) == expected.of(0)
    assert len(fire(scene, weapon, HERE, toward=np.zeros((0, 2))).shots) == 0


@pytest.mark.parametrize("name", [name for name in WEAPONS if name != "line of sight"])
def test_one_place_is_that_of_every_aim(name: str) -> None:
    scene, weapon = yard(), WEAPONS[name]
    expected = fire(scene, weapon, [HERE] * 4, aim=AIMS, seed=3)
    assert fire(scene, weapon, HERE, aim=AIMS, seed=3) == expected
    assert fire(scene, weapon, HERE, aim=np.array(AIMS), seed=3) == expected


def test_many_places_have_one_target() -> None:
    scene, places = yard(), [HERE, (5, 5), (70, 50)]
    for weapon in WEAPONS.values():
        assert fire(scene, weapon, places, toward=(44, 30)) == fire(scene, weapon, places, toward=[(44, 30)] * 3)


def test_filters_and_ticks_are_those_of_each_aim() -> None:
    scene = yard()
    many = [HERE] * 4
    for how in ({"accept": [1, 0, 1, 0]}, {"exclude": [0, 1, -1, 2]}, {"exclude": [[0, 1]]}, {"shot": [4, 3, 2, 1]}):
        assert fire(scene, Disc(30), HERE, aim=AIMS, **how) == fire(scene, Disc(30), many, aim=AIMS, **how)
    history = History(scene, ticks=4)
    for tick in range(3):
        history.record(tick)
        scene.move(0, (50 + tick, 30))
    ticks = [2, 0, 1, 2]
    found = fire(history, Pistol(60), HERE, toward=TARGETS, tick=ticks)
    assert found == fire(history, Pistol(60), many, toward=TARGETS, tick=ticks)


def test_a_prepared_weapon_a_record_and_a_report_have_a_shot_for_each_aim(tmp_path: Path) -> None:
    scene = yard()
    for weapon in (Pistol(60), Cone(40, 30)):
        expected = fire(scene, weapon, [HERE] * 4, toward=TARGETS, exclude=[[1, 3]])
        assert prepare(scene, weapon, exclude=[1, 3]).fire(HERE, toward=TARGETS) == expected
        file = tmp_path / f"{weapon.kind}.jsonl"
        with ShotRecord(file) as record:
            assert record.fire(scene, weapon, HERE, toward=TARGETS, exclude=[[1, 3]]) == expected
        lines = [json.loads(line) for line in file.read_text().splitlines()[1:-1]]
        assert [line["at"] for line in lines] == [list(HERE)] * 4 and [line["shot"] for line in lines] == [0, 1, 2, 3]
        assert replay(file, scene) is None
        found = fire(scene, weapon, HERE, toward=TARGETS, exclude=[[1, 3]])
        told, shots = (report_of(scene, [hits])["shots"] for hits in (found, expected))
        assert [shot | {"plan": None} for shot in told] == [shot | {"plan": None} for shot in shots]


BAD: list[tuple[dict[str, Any], str]] = [
    ({"at": [HERE] * 2, "toward": TARGETS}, r"toward: expected shape .2, 2., as at has shape .2, 2., got \(4, 2\)$"),
    ({"at": [HERE] * 2, "aim": AIMS}, r"aim: expected shape \(2,\), as at has shape \(2, 2\), got \(4,\)$"),
    ({"at": [HERE], "aim": AIMS}, r"aim: expected shape \(1,\), as at has shape \(1, 2\), got \(4,\)$"),
    ({"at": HERE, "toward": [[(1, 2)]]}, r"toward: expected shape \(1, 2\), got \(1, 1, 2\)"),
    ({"at": HERE, "toward": [(1, 2, 3)] * 4}, r"toward: expected shape \(4, 2\), got \(4, 3\)"),
    ({"at": HERE, "toward": [(1, 2), HERE]}, r"toward\[1\]: expected a point other than the shot's own"),
    ({"at": HERE, "toward": TARGETS, "aim": AIMS}, r"aim: expected aim or toward, got both"),
    ({"at": HERE, "aim": [1, 2], "accept": [1, 2, 3]}, r"accept: expected shape \(2,\), got \(3,\)"),
    ({"at": HERE, "aim": [1, 2], "exclude": [1, 2, 3]}, r"exclude: expected shape \(2, any\)"),
]


@pytest.mark.parametrize(("how", "told"), BAD)
def test_places_and_aims_of_different_numbers_are_named(how: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=f"^{told}"):
        fire(yard(), Pistol(60), **how)
