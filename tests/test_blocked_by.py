"""What blocks, apart from what may be hit: one gate, asked in every way in which shots are fired and told."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hitplanes import (
    Disc,
    History,
    Hits,
    InputError,
    Pistol,
    Scene,
    ShotRecord,
    Weapon,
    fire,
    load_scene,
    prepare,
    replay,
    weapons_of,
)
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.golden.file import golden_of, read_golden
from hitplanes.weapons.replay.shot_log import ShotReader, fire_request, requests_of
from hitplanes.weapons.report.cards import shot_card
from hitplanes.weapons.report.report import report_of

AT = (4, 10)
WEAPONS: dict[str, Weapon] = {"pistol": Pistol(40), "blast": Disc(30)}

FILTERS: list[tuple[dict[str, Any], bool]] = [
    ({}, False),
    ({"accept": ["target"]}, False),
    ({"accept": ["target"], "blocked_by": ["wall"]}, False),
    ({"accept": ["target", "wall"], "blocked_by": ["target"]}, True),
    ({"accept": ["target"], "blocked_by": ["smoke", "target"]}, True),
    ({"accept": ["target"], "blocked_by": []}, True),
    ({"accept": ["wall"], "blocked_by": []}, False),
    ({"accept": [], "blocked_by": []}, False),
]
"""What a shot says, and whether it hits the target behind the wall."""


def gate() -> Scene:
    """A target behind a wall of a category of its own, which covers it, too."""
    scene = Scene((40, 20), categories=["target", "wall", "smoke"])
    scene.add(np.ones((4, 4), np.bool_), (30, 10), categories=["target"], name="target")
    scene.add(np.ones((20, 16), np.bool_), (24, 10), role="occluder", layer=1, categories=["wall"], name="wall")
    return scene


def save(scene: Scene, folder: Path, shots: list[dict[str, Any]]) -> None:
    scene.weapons, scene.shots = {name: one.to_json() for name, one in WEAPONS.items()}, shots
    scene.save(folder)


def ways(scene: Scene, weapon: str, how: dict[str, Any], folder: Path) -> Iterator[tuple[str, Hits]]:
    """The same shot, fired in every way."""
    fired = WEAPONS[weapon]
    yield "alone", fire(scene, fired, AT, **how)
    yield "in a batch", fire(scene, fired, [AT, AT], **how)
    yield "prepared", prepare(scene, fired, **how).fire(AT)
    yield "prepared, in a batch", prepare(scene, fired, **how).fire([AT, AT])
    history = History(scene, ticks=2)
    history.record()
    yield "in the past", fire(history.at(0), fired, AT, **how)
    save(scene, folder, [{"weapon": weapon, "at": list(AT), **how}])
    loaded = load_scene(folder)
    (request,) = requests_of(loaded, weapons_of(loaded))
    yield "from a file", fire_request(loaded, request)


@pytest.mark.parametrize("weapon", WEAPONS)
@pytest.mark.parametrize(("how", "hit"), FILTERS)
def test_a_wall_blocks_unless_its_category_is_left_out(
    how: dict[str, Any], hit: bool, weapon: str, tmp_path: Path
) -> None:
    for way, hits in ways(gate(), weapon, how, tmp_path / "gate"):
        assert bool(len(hits)) == hit, way
        if not hit and how.get("accept") not in (["wall"], []):
            assert hits.verdict_counts()["occluded"] > 0, way


@pytest.mark.parametrize("weapon", WEAPONS)
@pytest.mark.parametrize(("how", "hit"), FILTERS)
def test_a_log_answers_as_fire_does(how: dict[str, Any], hit: bool, weapon: str, tmp_path: Path) -> None:
    save(gate(), tmp_path / "gate", [])
    log, answers = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_text(json.dumps({"weapon": weapon, "at": list(AT), **how}) + "\n")
    assert main(["fire", str(tmp_path / "gate"), str(log), "-o", str(answers)]) == 0
    _, answer = [json.loads(line) for line in answers.read_text().splitlines()]
    assert bool(answer["rows"]) == hit


def test_a_line_that_is_none_takes_nothing_from_those_before(tmp_path: Path) -> None:
    save(gate(), tmp_path / "gate", [])
    scene = load_scene(tmp_path / "gate")
    shots = [{"weapon": "pistol", "at": list(AT), "accept": [], "blocked_by": ["wall"]} for _ in range(99)]
    lines = [json.dumps(shot).encode() for shot in shots]
    requests, error = ShotReader(scene, weapons_of(scene), "shots.jsonl").read([*lines, b"{}"], 0)
    assert error is not None and [(request.blocked_by, request.accept) for request in requests] == [(4, 0)] * 99


def test_shots_of_a_batch_are_blocked_each_by_its_own() -> None:
    scene = gate()
    wall, smoke = scene.category_bits("wall"), scene.category_bits("smoke")
    for weapon in WEAPONS.values():
        hits = fire(scene, weapon, [AT] * 4, accept=["target"], blocked_by=[wall, smoke, 0, wall | smoke])
        assert sorted(set(hits.shot.tolist())) == [1, 2]


def test_an_owner_that_is_excluded_does_not_block() -> None:
    scene = gate()
    for weapon in WEAPONS.values():
        assert len(fire(scene, weapon, AT, blocked_by=["wall"], exclude=scene.find("wall")))


@pytest.mark.parametrize("weapon", WEAPONS)
def test_a_record_keeps_what_blocks(weapon: str, tmp_path: Path) -> None:
    scene = gate()
    with ShotRecord(tmp_path / "match.jsonl") as record:
        hits = [record.fire(scene, WEAPONS[weapon], AT, **how) for how, _ in FILTERS]
    assert [bool(len(one)) for one in hits] == [hit for _, hit in FILTERS]
    assert replay(tmp_path / "match.jsonl", scene) is None
    lines = [json.loads(line) for line in (tmp_path / "match.jsonl").read_text().splitlines()[1:-1]]
    assert [line["blocked_by"] for line in lines[:4]] == [2**32 - 1, 2**32 - 1, 4, 2]


def test_reports_and_cards_tell_what_blocks() -> None:
    scene = gate()
    told = []
    for how in ({}, {"blocked_by": ["wall", "smoke"]}, {"blocked_by": []}):
        (shot,) = report_of(scene, [fire(scene, WEAPONS["pistol"], AT, accept=["target"], **how)])["shots"]
        told.append((shot["blocked_by"], shot_card(shot, 0, scene).fired.partition("accepts target")[2]))
    assert told == [(None, ""), (["wall", "smoke"], ", blocked by wall smoke"), ([], ", blocked by nothing")]


def test_what_was_written_with_one_filter_means_what_it_meant(tmp_path: Path) -> None:
    """Scenes and records in which `accept` chose what blocks, too; and goldens, which have one filter and say so."""
    scene = gate()
    how: dict[str, Any] = {"accept": ["target"]}
    save(scene, tmp_path / "gate", [{"weapon": "pistol", "at": list(AT), **how}])
    file = tmp_path / "gate" / "scene.json"
    file.write_text(file.read_text().replace("hitplanes-scene/2", "hitplanes-scene/1"))
    loaded = load_scene(tmp_path / "gate")
    (request,) = requests_of(loaded, weapons_of(loaded))
    assert len(fire_request(loaded, request)) == 1
    loaded.save(tmp_path / "again")
    assert json.loads((tmp_path / "again" / "scene.json").read_text())["shots"][0]["blocked_by"] == ["target"]

    both = {**how, "blocked_by": ["target"]}
    with ShotRecord(tmp_path / "match.jsonl") as record:
        record.fire(scene, WEAPONS["pistol"], AT, **both)
    lines = [json.loads(line) for line in (tmp_path / "match.jsonl").read_text().splitlines()]
    lines[0]["format"] = "hitplanes-shots/1"
    del lines[0]["chain"], lines[1]["chain"], lines[1]["blocked_by"]
    older = tmp_path / "older.jsonl"
    older.write_text("".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines[:2]))
    assert replay(older, scene) is None

    golden = golden_of(fire(scene, WEAPONS["pistol"], AT, **both), {}, "t", None)
    golden.write(tmp_path / "golden")
    file = tmp_path / "golden.json"
    data = json.loads(file.read_text())
    del data["report"]["shots"][0]["blocked_by"]
    file.write_text(json.dumps(data))
    read = read_golden(tmp_path / "golden")
    assert read is not None and read.report == golden.report


@pytest.mark.parametrize(
    ("blocked_by", "told"),
    [
        (["wal"], r"blocked_by: .*did you mean 'wall'"),
        ("banana", r"blocked_by: .*got 'banana'"),
        (3.5, r"blocked_by\[0\]: expected a whole number"),
        ([1, 2], r"blocked_by: .*shape"),
    ],
)
def test_a_filter_that_is_none_is_named(blocked_by: Any, told: str) -> None:
    with pytest.raises(InputError, match=told):
        fire(gate(), Disc(3), AT, blocked_by=blocked_by)
    with pytest.raises(InputError, match=told):
        prepare(gate(), Disc(3), blocked_by=blocked_by)
