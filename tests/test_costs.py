"""Costs and velocities of objects: given, changed, saved, hashed, kept by a history, and what they do to a shot."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from bench.schemas import schemas
from test_fire import square

from hitplanes import Disc, History, InputError, Projectile, Rifle, Scene, fire, load_scene
from hitplanes.planes.scene.items import COLUMNS

FIXTURES = Path(__file__).parents[1] / "fixtures"
SCHEMA = schemas()["scene"]
HASHES = {
    "gallery": "faa9a226bd8363f6",
    "crowd": "2d4e4a400fb2d73a",
    "edges": "bec0a074fbbce6cc",
    "empty": "3be6af57b2daa6c7",
    "far": "4d7679f36e5d9861",
    "targets": "9219537257d17ad4",
}
"""Of the fixtures, as they were before objects had a cost and a velocity."""


def three(**values: Any) -> Scene:
    """Three squares in a row; the values are those of the second."""
    scene = Scene((60, 20), name="row")
    for i, own in enumerate(({}, values, {})):
        scene.add(square(5), (15 * i + 10, 10), name=f"box {i}", **own)
    return scene


def costs_of(scene: Scene) -> list[int]:
    return scene.items.cost[: scene.items.count].tolist()


def velocities_of(scene: Scene) -> list[list[int]]:
    """In 1/256 px a frame."""
    return scene.items.velocity_256[: scene.items.count].tolist()


# Given and changed


def test_the_defaults_are_one_and_at_rest() -> None:
    assert costs_of(three()) == [1, 1, 1] and velocities_of(three()) == [[0, 0]] * 3


def test_values_of_one_object_are_its_own() -> None:
    scene = three(cost=7, velocity_xy=(1.5, -0.25))
    assert costs_of(scene) == [1, 7, 1] and velocities_of(scene) == [[0, 0], [384, -64], [0, 0]]


@pytest.mark.parametrize(("given", "kept"), [(1 / 512, 0), (3 / 512, 2), (1 / 256, 1), (-(2.0**20), -(2**28))])
def test_velocities_are_rounded_to_a_256th_half_to_even(given: float, kept: int) -> None:
    scene = three(velocity_xy=(given, 0))
    assert velocities_of(scene)[1] == [kept, 0]
    scene.set(2, velocity_xy=(0, given))
    assert velocities_of(scene)[2] == [0, kept]


def test_one_or_many_are_changed_at_once() -> None:
    scene = three()
    scene.set(1, cost=255, velocity_xy=(2, 0))
    assert costs_of(scene) == [1, 255, 1] and velocities_of(scene)[1] == [512, 0]
    scene.set([0, 2], cost=0, velocity_xy=(0, 1))
    assert costs_of(scene) == [0, 255, 0] and velocities_of(scene) == [[0, 256], [512, 0], [0, 256]]
    scene.set([2, 0], cost=[3, 4], velocity_xy=[(1, 1), (2, 2)])
    assert costs_of(scene) == [4, 255, 3] and velocities_of(scene) == [[512, 512], [512, 0], [256, 256]]
    scene.set(np.arange(3), velocity_xy=np.zeros((3, 2)), cost=np.ones(3))
    assert costs_of(scene) == [1, 1, 1] and velocities_of(scene) == [[0, 0]] * 3


def test_a_change_of_either_is_a_new_version_and_moves_nothing() -> None:
    scene = three()
    masks = [(scene.mask(i)[0].tolist(), scene.mask(i)[1]) for i in range(3)]
    for values in ({"cost": 9}, {"velocity_xy": (3, 4)}):
        before = scene.version
        scene.set(1, **values)  # type: ignore[arg-type]
        assert scene.version > before
    assert [(scene.mask(i)[0].tolist(), scene.mask(i)[1]) for i in range(3)] == masks


ERRORS: dict[str, tuple[Callable[[Scene], object], str]] = {
    "add, cost -1": (lambda s: s.add(square(3), cost=-1), "cost: expected a whole number from 0 to 255, got -1"),
    "add, cost 256": (lambda s: s.add(square(3), cost=256), "cost: expected a whole number from 0 to 255, got 256"),
    "add, half": (lambda s: s.add(square(3), cost=0.5), "cost: expected a whole number .*got 0.5"),  # type: ignore[arg-type]
    "add, true": (lambda s: s.add(square(3), cost=True), "cost: expected a whole number .*got True"),
    "add, velocity of 3": (lambda s: s.add(square(3), velocity_xy=(1, 2, 3)), r"velocity_xy: expected shape \(2,\)"),
    "add, NaN": (lambda s: s.add(square(3), velocity_xy=(1, np.nan)), r"velocity_xy\[1\]: expected a finite number"),
    "add, fast": (lambda s: s.add(square(3), velocity_xy=(2e6, 0)), r"velocity_xy\[0\]: expected a number within"),
    "set, cost 256": (lambda s: s.set(1, cost=256), r"cost\[0\]: expected a whole number from 0 to 255, got 256"),
    "set, a bad one": (lambda s: s.set([0, 1], cost=[1, -3]), r"cost\[1\]: expected a whole number .*got -3"),
    "set, too many": (lambda s: s.set([0, 1], cost=[1, 2, 3]), r"cost: expected shape \(2,\), got \(3,\)"),
    "set, half": (lambda s: s.set(0, cost=2.5), r"cost\[0\]: expected a whole number .*got 2.5"),
    "set, velocity word": (lambda s: s.set(0, velocity_xy="up"), "velocity_xy: expected .*numbers"),
    "set, velocity inf": (
        lambda s: s.set([0, 1], velocity_xy=[(0, 0), (np.inf, 0)]), r"velocity_xy\[1\]\[0\]: expected a finite number"),
    "set, velocity far": (
        lambda s: s.set([0, 1], velocity_xy=[(0, 0), (0, 2**21)]), r"velocity_xy\[1\]\[1\]: expected a number within"),
    "set, velocities": (lambda s: s.set([0, 1], velocity_xy=[(0, 0)] * 3), r"velocity_xy: expected shape"),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_bad_values_are_named_and_change_nothing(name: str) -> None:
    call, told = ERRORS[name]
    scene = three(cost=7, velocity_xy=(1, 2))
    before = scene.version, scene.content_hash(), len(scene)
    with pytest.raises(InputError, match=f"^{told}"):
        call(scene)
    assert (scene.version, scene.content_hash(), len(scene)) == before


# Saved


def test_a_folder_keeps_both_and_leaves_defaults_out(tmp_path: Path) -> None:
    scene = three(cost=7, velocity_xy=(1.5, -0.25))
    scene.save(tmp_path)
    data = json.loads((tmp_path / "scene.json").read_text())
    first, second, third = data["objects"]["hittable"]
    assert second["cost"] == 7 and second["velocity_xy"] == [1.5, -0.25]
    assert not {"cost", "velocity_xy"} & (first.keys() | third.keys())
    jsonschema.validate(data, SCHEMA)
    again = load_scene(tmp_path)
    assert costs_of(again) == [1, 7, 1] and velocities_of(again) == velocities_of(scene)
    assert again.content_hash() == scene.content_hash()


@pytest.mark.parametrize(
    "values", [{"cost": 0}, {"cost": 255}, {"velocity_xy": (0, 1 / 256)}, {"velocity_xy": (-9, 0)}]
)
def test_one_without_the_other_is_kept(values: dict[str, Any], tmp_path: Path) -> None:
    scene = three(**values)
    scene.save(tmp_path)
    (box,) = (
        b for b in json.loads((tmp_path / "scene.json").read_text())["objects"]["hittable"] if b["name"] == "box 1"
    )
    assert {"cost", "velocity_xy"} & box.keys() == values.keys()
    again = load_scene(tmp_path)
    assert (costs_of(again), velocities_of(again)) == (costs_of(scene), velocities_of(scene))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"cost": 256}, r"objects.hittable\[0\]: cost: expected a whole number from 0 to 255, got 256"),
        ({"cost": "dear"}, r"objects.hittable\[0\]: cost: expected a whole number"),
        ({"velocity_xy": 3}, r"objects.hittable\[0\]: velocity_xy: expected shape \(2,\)"),
        ({"velocity_xy": [1e9, 0]}, r"objects.hittable\[0\]: velocity_xy\[0\]: expected a number within"),
        ({"velocity": [1, 0]}, r"objects.hittable\[0\]: key: .*did you mean 'velocity_xy'"),
    ],
)
def test_bad_values_of_a_file_are_named_with_their_place(values: dict[str, Any], told: str, tmp_path: Path) -> None:
    one = {"box_wh": [3, 3], "position_xy": [5, 5], **values}
    (tmp_path / "scene.json").write_text(json.dumps({"format": "hitplanes-scene/2", "objects": {"hittable": [one]}}))
    with pytest.raises(InputError, match=told):
        load_scene(tmp_path)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(json.loads((tmp_path / "scene.json").read_text()), SCHEMA)


# Hashed


@pytest.mark.parametrize("name", HASHES)
def test_a_scene_of_defaults_has_the_hash_that_it_had_before_there_were_any(name: str) -> None:
    scene = load_scene(FIXTURES / name)
    assert scene.content_hash() == HASHES[name]
    ids = scene.ids()
    if len(ids):
        scene.set(ids, cost=1, velocity_xy=(0, 0))
        assert scene.content_hash() == HASHES[name]


def test_each_of_them_is_in_the_hash() -> None:
    hashes = [
        three(**values).content_hash()
        for values in (
            {}, {"cost": 0}, {"cost": 2}, {"velocity_xy": (1, 0)}, {"velocity_xy": (0, 1)}, {"velocity_xy": (-1, 0)},
            {"cost": 2, "velocity_xy": (1, 0)},
        )
    ]  # fmt: skip
    assert len(set(hashes)) == len(hashes)
    other = three()
    other.set(2, cost=2)
    assert other.content_hash() not in hashes
    other.set(2, cost=1)
    assert other.content_hash() == hashes[0]


def test_what_decides_no_hit_is_not_in_the_hash() -> None:
    scene = three()
    before = scene.content_hash()
    scene.add(square(5), role="background", cost=9, velocity_xy=(3, 3))
    gone = scene.add(square(5), (50, 10), cost=9)
    assert scene.content_hash() != before
    scene.remove(gone)
    assert scene.content_hash() == before


# Kept by a history


def test_a_history_keeps_them() -> None:
    scene = three(cost=7, velocity_xy=(1, 0))
    history = History(scene, interpolate=True)
    told = []
    for tick in range(3):
        history.record()
        told.append((costs_of(scene), velocities_of(scene), scene.content_hash()))
        scene.set([0, 1], cost=[tick + 3, tick], velocity_xy=[(tick, 1), (0, -tick)])
    assert {"cost", "velocity_256"} <= COLUMNS.keys() and len({str(one) for one in told}) == 3
    for tick, one in enumerate(told):
        past = history.at(tick)
        assert (costs_of(past), velocities_of(past), past.content_hash()) == one
    between = history.at(1.75)
    assert (costs_of(between), velocities_of(between)) == told[1][:2]


def test_a_shot_at_the_past_spends_what_things_cost_then() -> None:
    scene = three(cost=3)
    history = History(scene)
    history.record()
    scene.set([0, 1], cost=[0, 1])
    history.record()
    rifle = Rifle(60, budget=6.5)
    hits = fire(history, rifle, [(0, 10)] * 2, tick=[0, 1])
    assert hits.object.tolist() == [0, 1, 0, 1, 2]
    assert hits.stop.distance.tolist() == [24.5 + 0.5, 39.5 + 1.5]  # type: ignore[attr-defined]
    assert fire(scene, rifle, (0, 10)).stop.distance.tolist() == [41.0]  # type: ignore[attr-defined]


def test_a_projectile_at_the_past_meets_what_flew_then() -> None:
    scene = three()
    history = History(scene)
    history.record()
    scene.set(0, velocity_xy=(0, -40))
    history.record()
    hits = fire(history, Projectile(40, 1), [(0, 10)] * 2, tick=[0, 1])
    assert hits.object.tolist() == [0, 1]


def test_patterns_know_nothing_of_either() -> None:
    plain, other = three(), three(cost=200, velocity_xy=(30, 0))
    assert fire(plain, Disc(30), (25, 10)) == fire(other, Disc(30), (25, 10))
