"""Tables: what they check and what they tell as JSON Schema are the same; the shipped schemas are of these tables."""

from __future__ import annotations

import copy
import json
import random
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from bench.schemas import COMMAND, FOLDER, schema_of, schemas, write_schemas
from examples import examples
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from hitplanes import Disc, InputError, Rounds, Spread, fire, load_scene, report_of, weapon_from_json, weapons_of
from hitplanes.planes.common.tables import (
    Const,
    Either,
    Flag,
    Keys,
    Mapped,
    Mask,
    Names,
    Number,
    Numbers,
    Optional,
    Rows,
    Text,
    Value,
    Whole,
    Wholes,
    Within,
    Word,
    json_of,
)
from hitplanes.planes.files.scene_folder import SCENE
from hitplanes.weapons.cli.report_file import REPORT, read_report
from hitplanes.weapons.kinds.areas import KINDS
from hitplanes.weapons.replay.shot_log import SHOT, fire_request, requests_of

ROOT = Path(__file__).parents[1]
SCENES = sorted(path.parent.name for path in (ROOT / "fixtures").glob("*/scene.json"))
SCHEMAS = schemas()
VALIDATORS = {name: jsonschema.Draft202012Validator(schema) for name, schema in SCHEMAS.items()}


def valid(schema: dict[str, Any], value: Any) -> bool:
    return jsonschema.Draft202012Validator(schema).is_valid(value)


def passes(form: Value, value: Any) -> bool:
    try:
        form.check("value", value)
    except InputError:
        return False
    return True


# The parts, each against its own schema

numbers = st.one_of(st.integers(-5, 5), st.sampled_from([0.5, -2.25, 3.0, 1e300, -(10**30)]))
leaves = st.one_of(
    numbers, st.none(), st.booleans(), st.sampled_from(["", "a", "b", "#.", "x" * 200, "x" * 201, "red"])
)
values = st.recursive(
    leaves,
    lambda v: st.lists(v, max_size=4) | st.dictionaries(st.sampled_from(["a", "b", "c", ""]), v, max_size=3),
    max_leaves=8,
)
PARTS: dict[str, Value] = {
    "number": Number(-2, 3.5),
    "any number": Number(),
    "whole": Whole(0, 4),
    "pair": Numbers((2,), 3),
    "pair from 0": Numbers((2,), 3, low=0),
    "points": Numbers((None, 2), 4, least=1),
    "color": Wholes((3,), 0, 4),
    "rows of wholes": Wholes((None, 2), -2, 4),
    "text": Text(),
    "names": Names(),
    "word": Word(("a", "red")),
    "const": Const("a"),
    "flag": Flag(),
    "optional": Optional(Whole(0, 3)),
    "either": Either(list, Numbers((2,), 3), Number(0, 1)),
    "rows": Rows(Text()),
    "mapped": Mapped(Whole(0, 3)),
    "keys": Keys({"a": Number(), "b": Text()}, ("a",)),
    "within": Within(Keys({"a": Rows(Flag())})),
}


def told_by_schema(value: Any) -> bool:
    """Whether JSON Schema can judge it: bare arrays may be ragged or empty in ways that only a check sees."""
    return not isinstance(value, list) or bool(value)


@cache
def schema_of_part(part: str) -> dict[str, Any]:
    schema = schema_of(PARTS[part])
    jsonschema.Draft202012Validator.check_schema(schema)
    return schema


@pytest.mark.parametrize("part", PARTS)
@examples(67, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(value=values)
def test_a_part_checks_what_its_schema_tells(part: str, value: Any) -> None:
    schema = schema_of_part(part)
    if told_by_schema(value):
        assert passes(PARTS[part], value) == valid(schema, value), value


@pytest.mark.parametrize(
    ("part", "good", "bad"),
    [
        ("number", [0, 3.5, -2], [4, "1", None, [1], True, float("nan")]),
        ("whole", [0, 4, 2.0], [-1, 5, 0.5, "1", True]),
        ("pair", [[1, 2.5], [-3, 3]], [[1], [1, 2, 3], [1, 4], [1, "2"], 5, {}]),
        ("pair from 0", [[0, 3]], [[-1, 0], [0, 4]]),
        ("points", [[[1, 2]], [[1, 2], [3, 4]]], [[], [[1]], [[1, 2], [3]], [1, 2]]),
        ("color", [[0, 1, 4]], [[0, 1], [0, 1, 5], [0, 1, 0.5]]),
        ("rows of wholes", [[], [[1, 2]]], [[[1]], [[1, 9]], 3]),
        ("text", ["a", "x" * 200], ["", "x" * 201, 3, None]),
        ("names", [[], ["a", "b"]], [["a", "a"], "a", [3]]),
        ("word", ["red"], ["rot", 3, None]),
        ("flag", [True, False], [0, 1, "true", None]),
        ("optional", [None, 3], [4, "a"]),
        ("either", [0.5, [1, 2]], [2, [1], "a"]),
        ("mapped", [{}, {"a": 1}], [[], {"a": 9}, {"": 1}]),
        ("keys", [{"a": 1}, {"a": 1, "b": "x"}], [{}, {"a": 1, "c": 2}, {"a": "1"}, []]),
    ],
)
def test_parts_by_hand(part: str, good: list[Any], bad: list[Any]) -> None:
    form = PARTS[part]
    assert [v for v in good if not passes(form, v) or not valid(schema_of(form), v)] == []
    assert [v for v in bad if passes(form, v)] == []


def test_a_mask_is_rows_of_marks_or_of_bits() -> None:
    for value, shape in ((["#.", ".#"], (2, 2)), ([[1, 0, 1]], (1, 3)), ([[True]], (1, 1))):
        assert Mask().check("mask", value).shape == shape and valid(schema_of(Mask()), value)
    for value in (["#", "##"], ["#x"], [[2]], [], "#", None, [["#"]]):
        assert not passes(Mask(), value)
    assert not any(valid(schema_of(Mask()), value) for value in (["#x"], [[2]], "#", None))


def test_json_is_read_once_and_finite() -> None:
    assert json_of('{"a": [1, 2.5, null]}') == {"a": [1, 2.5, None]}
    for text in ('{"a": 1, "a": 2}', "[NaN]", "[-Infinity]", "{", "", "[" * 100_000):
        with pytest.raises(InputError):
            json_of(text)


# What is shipped


def test_shipped_schemas_are_made_of_the_tables(tmp_path: Path) -> None:
    write_schemas(tmp_path)
    shipped = ROOT / "weapons" / "schemas"
    assert {p.name for p in shipped.iterdir()} == {p.name for p in tmp_path.iterdir()}
    assert {p.name for p in FOLDER.glob("*.json")} == {p.name for p in tmp_path.iterdir()}, "where it writes by default"
    for path in tmp_path.iterdir():
        assert path.read_text() == (shipped / path.name).read_text(), f"run {COMMAND}: {path.name}"
        jsonschema.Draft202012Validator.check_schema(json.loads(path.read_text()))


@pytest.mark.parametrize("name", SCENES)
def test_every_fixture_is_valid(name: str) -> None:
    data = json.loads((ROOT / "fixtures" / name / "scene.json").read_text())
    VALIDATORS["scene"].validate(data)
    scene = load_scene(ROOT / "fixtures" / name)
    requests = requests_of(scene, weapons_of(scene))
    for shot in data["shots"]:
        VALIDATORS["shot"].validate(shot)
    fired = [fire_request(scene, request) for request in requests]
    report = report_of(scene, fired, [request.name for request in requests])
    VALIDATORS["report"].validate(report)
    REPORT.check("report", json.loads(json.dumps(report)))


def test_a_batch_report_is_valid() -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    at = np.random.default_rng(3).uniform(-20, 500, (60, 2))
    report = report_of(scene, [fire(scene, weapons_of(scene)["shotgun"], at)])
    VALIDATORS["report"].validate(report)
    REPORT.check("report", json.loads(json.dumps(report)))


NASTY: list[Any] = [
    None,
    True,
    -1,
    0.5,
    "x",
    "",
    [],
    {},
    [1],
    [[1, 2]],
    {"kind": "point"},
    10**13,
    "point",
    [1, 2],
    ["a"],
]


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path] if path else []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return found + [p for key, entry in items for p in places(entry, (*path, key))]


def changed(value: Any, rng: random.Random) -> Any:
    """A copy with one value replaced, dropped, or joined by an unknown key."""
    out = copy.deepcopy(value)
    path = rng.choice(places(out))
    holder = out
    for key in path[:-1]:
        holder = holder[key]
    act = rng.randrange(4)
    if act == 0 and isinstance(holder, dict):
        del holder[path[-1]]
    elif act == 1 and isinstance(holder, dict):
        holder["unknown"] = 1
    else:
        holder[path[-1]] = rng.choice(NASTY)
    return out


def agree(schema: dict[str, Any], value: Any, check: Any) -> None:
    """What the schema refuses, the check refuses; the check may see more."""
    if not valid(schema, value):
        with pytest.raises(InputError):
            check(value)


@pytest.mark.parametrize("count", [50, pytest.param(150, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", KINDS)
def test_what_the_schema_of_a_weapon_refuses_is_refused(kind: str, count: int) -> None:
    weapons = json.loads((ROOT / "fixtures" / "gallery" / "scene.json").read_text())["weapons"].values()
    schema = {"$ref": "#/$defs/weapon", "$defs": SCHEMAS["scene"]["$defs"]}
    rng = random.Random(kind)
    for weapon in (w for w in weapons if w["kind"] == kind):
        for _ in range(count):
            agree(schema, changed(weapon, rng), weapon_from_json)


def test_what_the_schema_of_a_shot_refuses_is_refused() -> None:
    shot = {"weapon": "gun", "at": [1, 2], "aim": 3, "accept": ["a"], "exclude": ["b", 2], "seed": 5, "shot": 3}
    rng = random.Random(3)
    for weapon in ("gun", Rounds(Spread(Disc(3), 4, 9), 2).to_json()):
        assert valid(SCHEMAS["shot"], {**shot, "weapon": weapon})
        for _ in range(400):
            agree(SCHEMAS["shot"], changed({**shot, "weapon": weapon}, rng), lambda value: SHOT.check("shot", value))


def test_what_the_schema_of_a_report_refuses_is_refused() -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    weapons = weapons_of(scene)
    fired = [
        fire(scene, weapons["blast"], (390, 110), accept=["target"]),
        fire(scene, weapons["point"], [(62, 86)] * 30),
    ]
    rng = random.Random(4)
    for report in (report_of(scene, fired[:1]), report_of(scene, fired[1:])):
        for _ in range(150):
            agree(SCHEMAS["report"], changed(report, rng), lambda value: REPORT.check("report", value))


@pytest.mark.parametrize("count", [50, pytest.param(150, marks=pytest.mark.long)])
def test_what_the_schema_of_a_scene_refuses_is_refused(count: int, tmp_path: Path) -> None:
    scene = json.loads((ROOT / "fixtures" / "targets" / "scene.json").read_text())
    for path in (ROOT / "fixtures" / "targets").glob("*.png"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    rng = random.Random(5)

    def load(value: Any) -> None:
        (tmp_path / "scene.json").write_text(json.dumps(value))
        loaded = load_scene(tmp_path)
        requests_of(loaded, weapons_of(loaded))

    for _ in range(count):
        agree(SCHEMAS["scene"], changed(scene, rng), load)
    assert SCENE.check("scene", scene)


def test_a_report_is_read_and_named_when_it_is_bad(tmp_path: Path) -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    report = report_of(scene, [fire(scene, weapons_of(scene)["point"], (62, 86))])
    path = tmp_path / "r.json"
    path.write_text(json.dumps(report))
    assert read_report(path) == report
    for key, value, message in (
        ("format", "hitplanes-report/9", r"r\.json: format: expected 'hitplanes-report/1', got 'hitplanes-report/9'"),
        ("view_xyxy", [0, 0, 10**9, 5], r"r\.json: view_xyxy: expected a box of at most 4096 px a side"),
        ("view_xyxy", [9, 0, 0, 5], r"r\.json: view_xyxy: expected a box"),
        ("shots", [{}], r"r\.json: shots\[0\]: shot: expected a value, got nothing"),
    ):
        path.write_text(json.dumps({**report, key: value}))
        with pytest.raises(InputError, match=message):
            read_report(path)
    batch = report_of(scene, [fire(scene, weapons_of(scene)["point"], [(62, 86)] * 30)])
    batch["batch"]["heat"]["counts"]["hit"][0][3] = 0
    path.write_text(json.dumps(batch))
    with pytest.raises(InputError, match="batch: heat: counts: hit: expected counts from 1, got 0"):
        read_report(path)
    for text, message in (
        ('{"format": "hitplanes-scene/2", "name": "a"}', r"r\.json: format: expected 'hitplanes-report/1', got"),
        ("{}\n{}\n", r"r\.json: expected one JSON value: Extra data: line 2"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_report(path)
    path.write_bytes(b"\xff")
    with pytest.raises(InputError, match="expected JSON in UTF-8"):
        read_report(path)
    with pytest.raises(InputError, match=r"none\.json: cannot read it"):
        read_report(tmp_path / "none.json")
