"""A record of shots fired again: the same, or the line, the shot and how it differs; and files that are damaged."""

from __future__ import annotations

import gc
import hashlib
import json
import os
import random
import re
import resource
import subprocess
import sys
import threading
import tracemalloc
from collections.abc import Callable, Iterable
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    History,
    InputError,
    Laser,
    Pistol,
    Point,
    Polygon,
    Projectile,
    Rifle,
    Ring,
    Rounds,
    Scene,
    ShotRecord,
    Spread,
    Sprite,
    Stencil,
    Sweep,
    Weapon,
    fire,
    load_scene,
    replay,
)
from hitplanes.weapons.kinds.areas import KINDS
from hitplanes.weapons.replay import record
from hitplanes.weapons.replay.record import hash_of

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "fixtures" / "gallery"

scene = load_scene(GALLERY)
RIFLE = Rifle(400, max_hits=2)
ARSENAL: list[Weapon] = [
    Point(),
    Disc(12, pierce=True, falloff="linear"),
    Ring(4, 9),
    Box(30, 8),
    Polygon([(0, 0), (40, -9), (44, 12)]),
    Cone(60, 40, falloff="smooth"),
    Beam(200, 3, pierce=True),
    Stencil(np.eye(9, dtype=bool)),
    Pistol(300, falloff="smooth"),
    RIFLE,
    Rifle(400, budget=45.5, width=5),
    Laser(500, width=3, inside="ignore_until_exit"),
    Projectile(150, 2.5),
    Projectile(150, 2.5, steps=7),
    Spread(Disc(2), 9, 14),
    Spread(Pistol(200), 9, 30),
    Sweep(RIFLE, 30, 5),
    Rounds(Spread(Point(), 5, 9), 3, (1.5, -2), 4),
    Rounds(Sweep(Laser(200), 20, 3), 2, (0.25, 1), -3),
    Rounds(Projectile(90, 1), 2, (3, 0)),
]
SIGHT: list[Weapon] = [
    Laser(None),
    Pistol(None, width=2),
    Spread(Rifle(None, max_hits=3), 5, 9),
    Rounds(Laser(None), 3, (1, 1), 5),
]


def places(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform((20, 20), (300, 200), (n, 2)).round(2)


def owners(n: int, most: int) -> list[list[int]]:
    """So many for each shot, and sometimes fewer."""
    rng = random.Random(most)
    return [[i if rng.random() < 0.7 else -1 for i in rng.sample(range(20), most)] for _ in range(n)]


def lines_of(path: Path) -> list[dict[str, Any]]:
    """The header and the shots, without their chain."""
    lines = [json.loads(line) for line in path.read_bytes().splitlines()]
    return [{key: value for key, value in line.items() if key != "chain"} for line in lines if "end" not in line]


def write_sealed(path: Path, lines: Iterable[bytes]) -> None:
    """JSON objects as a record has them: each ends with the hash of all bytes before it."""
    so_far = hashlib.sha256()
    with path.open("wb") as file:
        for line in lines:
            text = line.rstrip()[:-1]
            so_far.update(text)
            seal = f',"chain":"{so_far.hexdigest()[:16]}"}}\n'.encode()
            so_far.update(seal)
            file.write(text + seal)


def write_record(path: Path, entries: list[dict[str, Any]]) -> None:
    """A record as someone would forge it, with its chain and its end."""
    write_sealed(path, (json.dumps(entry).encode() for entry in [*entries, {"end": len(entries) - 1}]))


def write_first_format(path: Path) -> None:
    """Turn a record into one of the first format: no chain, no end."""
    entries = lines_of(path)
    entries[0]["format"] = "hitplanes-shots/1"
    path.write_text("".join(json.dumps(entry, separators=(",", ":")) + "\n" for entry in entries))


def says_no_end(path: Path) -> Any:
    told = f"{path} has no end: it was not closed, as after a crash, and may lack shots"
    return pytest.warns(UserWarning, match=f"^{re.escape(told)}$")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "match.jsonl"


# The same again


def test_every_kind_of_weapon_is_here() -> None:
    assert {type(weapon) for weapon in ARSENAL} == set(KINDS.values())


def fire_all(record: ShotRecord, at: Scene | History, **arguments: Any) -> int:
    """Every weapon, alone and in batches, with every argument; the number of shots."""
    n = 0
    for number, weapon in enumerate([*ARSENAL, *SIGHT]):
        xy = places(7, number)
        aimed: dict[str, Any] = {"aim": [15 * i for i in range(7)]}
        if weapon in SIGHT or number % 3 == 0:
            aimed = {"toward": places(7, 100 + number)}
        one = {name: value[0] for name, value in aimed.items()}
        ticks = {name: value[0] for name, value in arguments.items()}
        every = {"seed": 2**64 - 1 - np.arange(7, dtype=np.uint64), "shot": [2**62 + i for i in range(7)]}
        record.fire(at, weapon, xy, **aimed, **every, **arguments)
        record.fire(at, weapon, xy, **aimed, accept=["target"], exclude=owners(7, number % 4), **arguments)
        record.fire(at, weapon, xy[0], **one, accept=3, exclude=[8, 9], seed=number, **ticks)
        n += 15
    return n


def test_the_same_again_is_no_difference(path: Path) -> None:
    with ShotRecord(path) as record:
        n = fire_all(record, scene)
    entries = lines_of(path)[1:]
    assert len(entries) == n and replay(path, scene) is None and replay(str(path), load_scene(GALLERY)) is None
    assert sum(bool(entry["result"]["rows"]) for entry in entries) > n // 4
    assert {len(entry["exclude"]) for entry in entries} >= {0, 1, 2, 3}
    assert {len(entry["weapon"]) for entry in entries} and {entry["tick"] for entry in entries} == {None}


def test_a_record_with_line_ends_of_windows_is_the_same(path: Path) -> None:
    """Git and editors write them; a changed line is still found."""
    with ShotRecord(path) as record:
        record.fire(scene, Disc(9), places(5))
    crlf = path.read_bytes().replace(b"\n", b"\r\n")
    path.write_bytes(crlf)
    assert replay(path, scene) is None
    path.write_bytes(crlf.replace(b'"seed":0', b'"seed":1', 1))
    with pytest.raises(InputError, match="line 2: chain: expected"):
        replay(path, scene)


def test_what_is_returned_is_what_was_hit(path: Path) -> None:
    with ShotRecord(path) as record:
        for weapon in ARSENAL:
            assert record.fire(scene, weapon, places(3), aim=9) == fire(scene, weapon, places(3), aim=9)


def test_no_shots_are_no_lines(path: Path) -> None:
    with ShotRecord(path) as record:
        assert not record.fire(scene, Point(), np.zeros((0, 2)))
    assert len(lines_of(path)) == 1 and replay(path, scene) is None


def test_a_line_can_be_read_while_the_file_is_open(path: Path) -> None:
    record = ShotRecord(path)
    record.fire(scene, Point(), (62, 86))
    assert len(lines_of(path)) == 2
    with says_no_end(path):
        assert replay(path, scene) is None
    record.close()
    assert replay(path, scene) is None


def moving() -> tuple[Scene, History]:
    """The gallery, its ducks a little farther at each tick."""
    world = load_scene(GALLERY)
    history = History(world, interpolate=True)
    for tick in range(5):
        world.set([8, 9, 10], position_xy=[(100 + 60 * i + 3.25 * tick, 172) for i in range(3)], angle=4 * tick)
        history.record(10 * tick)
    return world, history


def test_shots_at_ticks_are_fired_at_them_again(path: Path) -> None:
    world, history = moving()
    ticks = [20, 0, 40, 12.5, 20, 0, 33]
    with ShotRecord(path) as record:
        n = fire_all(record, history, tick=ticks)
        record.fire(history.at(10), RIFLE, (60, 172))
        record.fire(history, Disc(20), (110, 172), tick=30)
    entries = lines_of(path)[1:]
    assert [entry["tick"] for entry in entries[:7]] == ticks and len(entries) == n + 2
    assert [entry["tick"] for entry in entries[-2:]] == [10, 30]
    assert replay(path, history) is None and replay(path, history.at) is None
    found = replay(path, world)
    assert found is not None and re.fullmatch(
        r"scene: its content hash is \w+, was \w+ at tick 20: one scene stands still here, .* takes a History",
        found.told[0],
    )


@pytest.mark.parametrize(
    ("given", "got"), [("x", "str"), (None, "NoneType"), (Scene, "the class Scene, not one made of it")], ids=str
)
def test_what_is_no_scene_is_no_fault_of_a_line(path: Path, given: Any, got: str) -> None:
    with ShotRecord(path) as record:
        record.fire(scene, Point(), (62, 86))
    with pytest.raises(InputError, match=f"^scene: expected a Scene, a History or a function of a tick, got {got}$"):
        replay(path, given)


def test_a_tick_that_has_left_is_named(path: Path) -> None:
    world, history = moving()
    with ShotRecord(path) as record:
        record.fire(history, Point(), places(2), tick=[0, 10])
    short = History(world, ticks=1)
    short.record(10)
    with pytest.raises(InputError, match=r"match.jsonl line 2: tick: expected one of 10, got 0"):
        replay(path, short)


def test_a_shot_without_a_tick_is_not_fired_at_a_history(path: Path) -> None:
    with ShotRecord(path) as record:
        record.fire(scene, Point(), (62, 86))
    history = moving()[1]
    for scenes, told in (
        (history, "line 2: scene: expected a Scene, as a shot has no tick, got a History"),
        (lambda tick: tick, "line 2: scene: expected a Scene, got NoneType"),
        (GALLERY, "^scene: expected a Scene, a History or a function of a tick, got PosixPath"),
    ):
        with pytest.raises(InputError, match=told):
            replay(path, scenes)


# What differs


SAME = "all shots do the same again"


def test_a_scene_that_changed_is_told_with_line_and_shot(path: Path) -> None:
    world = load_scene(GALLERY)
    with ShotRecord(path) as record:
        record.fire(world, RIFLE, places(3), shot=[5, 6, 7])
        before = world.content_hash()
        world.move(8, (99, 99))
        record.fire(world, RIFLE, places(2), shot=[8, 9])
    now = world.content_hash()
    assert replay(path, world) == (2, 5, (f"scene: its content hash is {now}, was {before}", SAME))
    assert replay(path, scene) == (5, 8, (f"scene: its content hash is {before}, was {now}", SAME))


Result = dict[str, list[dict[str, Any]]]


def changed(path: Path, number: int, change: Callable[[Result], object]) -> None:
    """Change the result of one line by hand, and its hash with it."""
    entries = lines_of(path)
    change(entries[number]["result"])
    entries[number]["hash"] = hash_of(entries[number]["result"])
    write_record(path, entries)


def told(path: Path, weapon: Weapon, change: Callable[[Result], object], **aim: Any) -> list[str]:
    """What a replay tells of the second of three shots at the ducks, whose record says something else."""
    with ShotRecord(path) as record:
        record.fire(scene, weapon, [(100, 167)] * 3, shot=[4, 5, 6], **aim)
    changed(path, 2, change)
    found = replay(path, scene)
    assert found is not None and (found.line, found.shot) == (3, 5)
    return list(found.told)


DUCK, NEXT = "object 8 'duck 1'", "object 9 'duck 2'"
WALL = next(i for i in scene.ids("occluder").tolist())
HAND: dict[str, tuple[Weapon, Callable[[Result], object], list[str]]] = {
    "one pixel": (
        Beam(100, 1),
        lambda r: r["rows"][0].update(pixels=r["rows"][0]["pixels"] - 3),
        [f"{DUCK}: pixels 38, was 35"],
    ),
    "several columns": (
        Beam(100, 1),
        lambda r: r["rows"][0].update(pixels=1, first_xy=[139, 9], weight=65535),
        [f"{DUCK}: pixels 38, was 1; weight 2490330, was 65535; first_xy[1] 168, was 9"],
    ),
    "a missing row": (Beam(100, 1), lambda r: r["rows"].clear(), [f"{DUCK}: is new"]),
    "one row more": (
        Beam(100, 1),
        lambda r: r["rows"].append({**r["rows"][0], "object": 3}),
        [f"object 3 '{scene.name_of(3)}': is gone"],
    ),
    "a row of what is not there": (
        Beam(100, 1),
        lambda r: r["rows"].append({**r["rows"][0], "object": 999}),
        ["object 999: is gone"],
    ),
    "verdicts": (
        Beam(100, 1),
        lambda r: r["verdicts"].update(hit=37, empty=0),  # type: ignore[attr-defined]
        ["verdicts: empty 65, was 0; hit 38, was 37"],
    ),
    "a row of a burst": (
        Rounds(Beam(100, 1), 2),
        lambda r: r["rows"][1].update(samples=9),
        [f"{DUCK} of round 1: samples 38, was 9"],
    ),
    "an entry": (
        RIFLE,
        lambda r: r["passes"][1].update(entry_px=12.5),
        [f"pass through {NEXT}: entry_px 101.51545923126065, was 12.5"],
    ),
    "a missing pass": (RIFLE, lambda r: r["passes"].pop(), [f"pass through {NEXT}: is new"]),
    "a missing row and its pass": (
        RIFLE,
        lambda r: (r["passes"].pop(), r["rows"].pop()),
        [f"{NEXT}: is new"],
    ),
    "a pass of a fan": (
        Sweep(Laser(400), 2, 3),
        lambda r: r["passes"].pop(-1),
        ["pass of pellet 2 through object 16 'can 6': is new"],
    ),
    "a range": (
        RIFLE,
        lambda r: r["stops"][0].update(reason=0, item=-1, distance=400.0),
        [f"ray: stopped by {NEXT} at 101.5 px, was by its range at 400.0 px"],
    ),
    "an occluder": (
        Laser(90),
        lambda r: r["stops"][0].update(reason=1, item=WALL, distance=44.5),
        [f"ray: stopped by its range at 90.0 px, was by occluder {WALL} '{scene.name_of(WALL)}' at 44.5 px"],
    ),
    "a budget": (
        Rounds(Rifle(400, budget=20), 2),
        lambda r: r["stops"][1].update(reason=2),
        [f"ray of round 1: stopped by its budget in {DUCK} at 58.5 px, was by {DUCK} at 58.5 px"],
    ),
    "a budget of nothing": (
        Rifle(400, budget=0),
        lambda r: r["stops"][0].update(reason=3, item=8, distance=58.5),
        [f"ray: stopped by its budget at 0.0 px, was by its budget in {DUCK} at 58.5 px"],
    ),
    "a reason that is none": (
        Laser(90),
        lambda r: r["stops"][0].update(reason=9, item=2.5),
        ["ray: stopped by its range at 90.0 px, was by reason 9 at 90.0 px"],
    ),
    "the normal of a stop": (
        RIFLE,
        lambda r: r["stops"][0].update(normal_xy=[0, 7]),
        ["ray: normal_xy[0] -36, was 0; normal_xy[1] 0, was 7"],
    ),
    "a missing stop": (
        Rounds(Sweep(Laser(9), 2, 3), 2),
        lambda r: r["stops"].pop(),
        ["ray of round 1, pellet 2: is new"],
    ),
    "another order": (
        RIFLE,
        lambda r: r["rows"].reverse(),
        ["rows[0].object: 8, was 9"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HAND)
def test_a_result_that_was_changed_is_told_in_words(name: str, path: Path) -> None:
    weapon, change, lines = HAND[name]
    found = told(path, weapon, change, aim=1)
    assert found[: len(lines)] == lines and (len(found) == len(lines) or name == "another order")


def test_much_that_differs_is_told_in_short(path: Path) -> None:
    found = told(path, Sweep(Laser(400), 10, 60), lambda r: [stop.update(reason=2) for stop in r["stops"]], aim=1)
    assert len(found) == 13 and found[-1] == "and 48 more"


def test_the_first_difference_comes_before_a_later_bad_line(path: Path) -> None:
    told(path, RIFLE, lambda r: r["rows"].clear())
    with path.open("ab") as file:
        file.write(b"{}\n")
    found = replay(path, scene)
    assert found is not None and found.line == 3


# Damage


@pytest.fixture
def match(path: Path) -> Path:
    """A record of three weapons and seven shots."""
    with ShotRecord(path) as record:
        record.fire(scene, RIFLE, places(3), aim=5)
        record.fire(scene, Disc(20), places(2), exclude=[[3], [-1]])
        record.fire(scene, Laser(None), places(2), toward=(200, 100))
    return path


def rewritten(path: Path, number: int, change: Callable[[dict[str, Any]], object]) -> None:
    """Change one line, the first is 1; its result keeps its hash, and the record a chain."""
    entries = lines_of(path)
    change(entries[number - 1])
    write_record(path, entries)


DAMAGE: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "hash": (lambda e: e.update(hash="51ab"), "hash: expected that of the result, [0-9a-f]{16}, got 51ab"),
    "result": (lambda e: e["result"]["stops"][0].update(distance=3), "hash: expected that of the result, "),
    "kind": (lambda e: e["weapon"].update(kind="rifel"), "weapon: kind: .*'rifel' .did you mean 'rifle'?"),
    "field": (lambda e: e["weapon"].update(rang=3), "weapon: key: .*'rang' .did you mean 'range'?"),
    "range": (lambda e: e["weapon"].update(range=-3), "weapon: range: expected a number from 0 to 1048576, got -3"),
    "no weapon": (lambda e: e.update(weapon="rifle"), "weapon: expected an object with a kind, got 'rifle'"),
    "key": (lambda e: e.update(sede=3), "key: expected one of 'scene', 'tick'.*got 'sede'"),
    "missing": (lambda e: e.pop("seed"), "seed: expected a value, got nothing"),
    "at": (lambda e: e.update(at=[1]), r"at: expected shape \(2,\), got \(1,\)"),
    "at, text": (lambda e: e.update(at="here"), "at: expected numbers, got 'here'"),
    "at, far": (lambda e: e.update(at=[1e30, 1]), r"at\[0\]: expected a number within"),
    "direction": (lambda e: e.update(direction=[0, 0]), r"direction: expected one of length 1073741824, got \[0, 0\]"),
    "direction, short": (lambda e: e.update(direction=[2**29, 0]), "direction: expected one of length 1073741824"),
    "direction, long": (lambda e: e.update(direction=[2**30, 2**29]), "direction: expected one of length 1073741824"),
    "direction, half": (lambda e: e.update(direction=[0.5, 1]), r"direction\[0\]: expected a whole number"),
    "toward": (lambda e: e.update(toward_256=[1, 2**60]), r"toward_256\[1\]: expected a whole number"),
    "accept": (lambda e: e.update(accept=-1), "accept: expected a whole number from 0 to"),
    "exclude": (lambda e: e.update(exclude=[-1]), r"exclude\[0\]: expected a whole number from 0 to"),
    "exclude, one": (lambda e: e.update(exclude=3), r"exclude: expected shape \(any,\), got \(\)"),
    "seed": (lambda e: e.update(seed=2**64), "seed: expected a whole number from 0 to"),
    "shot": (lambda e: e.update(shot=True), "shot: expected a whole number from 0 to"),
    "tick": (lambda e: e.update(tick="now"), "tick: expected a number, got 'now'"),
    "scene": (lambda e: e.update(scene=7), "scene: expected a text"),
    "no result": (lambda e: e.update(result=[]), "result: expected an object"),
    "another part": (lambda e: e["result"].update(row=[]), "result: key: expected one of 'rows', .*got 'row'"),
    "rows": (lambda e: e["result"].update(rows=5), "result: rows: expected a list, got 5"),
    "a row": (lambda e: e["result"].update(rows=[5]), r"result: rows\[0\]: columns: expected an object, got 5"),
    "a column": (
        lambda e: e["result"]["rows"].append({"object": "duck"}),
        r"result: rows\[\d\]: object: expected a number, or two, got 'duck'",
    ),
    "a huge column": (
        lambda e: e["result"]["stops"][0].update(distance=10**400),
        r"result: stops\[0\]: distance: expected a number, or two, got",
    ),
    "a deep column": (
        lambda e: e["result"]["stops"][0].update(cell_xy=[[1]]),
        r"result: stops\[0\]: cell_xy: expected a number, or two, got",
    ),
    "verdicts": (lambda e: e["result"].update(verdicts=[1]), "result: verdicts: columns: expected an object"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_damaged_line_is_named(name: str, match: Path) -> None:
    change, error = DAMAGE[name]
    rewritten(match, 3, change)
    with pytest.raises(InputError, match=rf"match.jsonl line 3: {error}") as caught:
        replay(match, scene)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 600


def test_a_shot_that_cannot_be_fired_is_named_with_its_line(match: Path) -> None:
    """A point too far for a ray without a range; a start inside of what may not be."""
    rewritten(match, 8, lambda e: e.update(toward_256=[2**29, 0]))
    with pytest.raises(InputError, match=r"match.jsonl line 8: toward\[0\]: expected a point within 1048576 px"):
        replay(match, scene)
    rewritten(match, 8, lambda e: e.update(toward_256=[2**8, 0]))
    for line in (2, 3, 4):
        rewritten(match, line, lambda e: e["weapon"].update(inside="error"))
    rewritten(match, 4, lambda e: e.update(at=[160, 172]))
    with pytest.raises(InputError, match=r"match.jsonl line 4: at\[0\]: expected a start outside of every item"):
        replay(match, scene)


LINES: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "letters": (lambda line: b"x" + line, "expected one JSON value"),
    "zeros": (lambda line: b"\0" * 60 + line[60:], "expected one JSON value"),
    "no UTF-8": (lambda line: line.replace(b'"scene":"', b'"scene":"\xff'), "line 3"),
    "twice a key": (lambda line: line.replace(b"{", b'{"seed":1,', 1), "key: expected each key once, got 'seed' again"),
    "NaN": (lambda line: line.replace(b'"seed":0', b'"seed":NaN'), "seed: expected a finite number, got NaN"),
    "empty": (lambda line: b"\n", "expected one JSON value"),
    "no object": (lambda line: b"[]\n", "shot: expected an object, got"),
    "deep": (lambda line: b"[" * 10**5 + b"\n", "expected one JSON value: maximum recursion depth"),
    "digits": (lambda line: line.replace(b'"seed":0', b'"seed":' + b"1" * 5000), "expected one JSON value: Exceeds"),
}


@pytest.mark.parametrize("name", LINES)
def test_a_line_that_is_no_shot_is_named(name: str, match: Path) -> None:
    """By what it is in the first format, by the chain in the present one."""
    change, error = LINES[name]
    lines = match.read_bytes().splitlines(keepends=True)
    match.write_bytes(b"".join([*lines[:2], change(lines[2]), *lines[3:]]))
    with pytest.raises(InputError, match=r"match.jsonl line 3: chain: expected '[0-9a-f]{16}', got ('|nothing)"):
        replay(match, scene)
    match.write_bytes(b"".join(lines))
    write_first_format(match)
    lines = match.read_bytes().splitlines(keepends=True)
    match.write_bytes(b"".join([*lines[:2], change(lines[2]), *lines[3:]]))
    if name == "no UTF-8":
        found = replay(match, scene)
        assert found is not None and found.line == 3
        return
    with pytest.raises(InputError, match=f"match.jsonl line 3: {error}"):
        replay(match, scene)


@pytest.mark.parametrize("kept", [1, 30, 300])
def test_a_line_cut_off_by_a_crash_is_told_and_those_before_it_replay(kept: int, match: Path) -> None:
    lines = match.read_bytes().splitlines(keepends=True)
    match.write_bytes(b"".join([*lines[:5], lines[5][:kept]]))
    with pytest.raises(InputError, match="line 6: expected a whole line of a record, got one that is cut off, as by a"):
        replay(match, scene)
    match.write_bytes(b"".join(lines[:5]))
    with says_no_end(match):
        assert replay(match, scene) is None


def test_headers_that_are_none(match: Path) -> None:
    header, *lines = match.read_bytes().splitlines(keepends=True)
    first = b'{"format":"hitplanes-shots/1"'
    for other, error in {
        b"": "expected a whole line of a record, got an empty file",
        header.rstrip(): "expected a whole line of a record, got one that is cut off",
        header.replace(b"shots/3", b"shots/4"): "format: expected 'hitplanes-shots/3', got 'hitplanes-shots/4'",
        header.replace(b"shots/3", b"shots/1"): "key: expected one of 'format', 'version', got 'chain'",
        header.replace(b'"0.', b'"1.'): "chain: expected '[0-9a-f]{16}', got '[0-9a-f]{16}': the line was changed",
        b'{"format":"hitplanes-shots/3","version":"1"}\n': "chain: expected '[0-9a-f]{16}', got nothing",
        b'{"format":"hitplanes-hits/1"}\n': "format: expected 'hitplanes-shots/3', got 'hitplanes-hits/1'",
        first + b"}\n": "version: expected a value, got nothing",
        first + b',"version":"1","rows":1}\n': "key: expected one of 'format', 'version', got 'rows'",
        b"\x89PNG\r\n\x1a\n": "expected one JSON value",
        lines[0]: "format: expected 'hitplanes-shots/3', got None",
        b"[]\n": "header: expected an object",
    }.items():
        match.write_bytes(other + b"".join(lines) if other.endswith(b"\n") else other)
        with pytest.raises(InputError, match=f"match.jsonl line 1: ({error})"):
            replay(match, scene)


def test_endless_files_are_read_no_further_than_a_line(match: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "TEXT_BYTES_MAX", 5000)
    assert replay(match, scene) is None
    match.write_bytes(b"".join(match.read_bytes().splitlines(keepends=True)[:-1]))
    os.truncate(match, 2**26)  # zeros
    tracemalloc.start()
    with pytest.raises(InputError, match="line 9: expected at most 5000 bytes, got more"):
        replay(match, scene)
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()
    with pytest.raises(InputError, match="/dev/zero line 1: expected at most 5000 bytes, got more"):
        replay("/dev/zero", scene)


@pytest.mark.parametrize("first_format", [False, True])
def test_whatever_is_damaged_it_ends_in_words(first_format: bool, match: Path) -> None:
    """The first format lets some of it through, the chain nothing."""
    rng = random.Random(3)
    if first_format:
        write_first_format(match)
    good = match.read_bytes()
    for _ in range(200):
        data = bytearray(good)
        for _ in range(rng.randint(1, 3)):
            begin = rng.randrange(len(data))
            kind = rng.choice(["byte", "cut", "twice", "digit"])
            if kind == "byte":
                data[begin] = rng.randrange(256)
            elif kind == "digit":
                digits = [i for i, byte in enumerate(data) if chr(byte).isdigit()]
                data[rng.choice(digits)] = ord(rng.choice("0123456789-.e"))
            elif kind == "cut":
                del data[begin : begin + rng.randint(1, 400)]
            else:
                data[begin:begin] = data[begin : begin + rng.randint(1, 400)]
        match.write_bytes(data)
        try:
            found = replay(match, scene)
        except InputError as error:
            assert str(match) in str(error) and "\n" not in str(error)
        else:
            assert data == good or (first_format and (found is None or found.told))


# The chain


def small_record(path: Path) -> History:
    """A record of two calls at three ticks, one of them a batch, and the history that they were fired at."""
    world = Scene((40, 40))
    box = world.add(np.ones((5, 5), bool), (20, 20))
    history = History(world)
    for tick in range(3):
        world.move(box, (20 + tick, 20))
        history.record(tick)
    with ShotRecord(path) as made:
        made.fire(history, Point(), [(22, 20), (1, 1)], tick=[2, 0])
        made.fire(history, Pistol(30), (4, 20), tick=1)
    return history


def test_each_line_ends_with_the_hash_of_all_bytes_before(path: Path) -> None:
    small_record(path)
    data = path.read_bytes()
    found = list(re.finditer(rb',"chain":"(.{16})"}\n', data))
    assert [one[1].decode() for one in found] == [hashlib.sha256(data[: one.start()]).hexdigest()[:16] for one in found]
    assert len(found) == 5 and data.splitlines()[-1].startswith(b'{"end":3,"chain":')


def test_each_byte_that_was_changed_is_seen_in_its_line(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Even if the shots do the same again: here they do what the record says."""
    history = small_record(path)
    data = path.read_bytes()
    monkeypatch.setattr(record, "_results", lambda path, at, group: [entry.data["result"] for entry in group])
    with path.open("r+b", buffering=0) as file:
        for at, byte in enumerate(data):
            for other in {byte ^ 1 << at % 8, b"0 1\n2-3."[at // 8 % 8]} - {byte}:
                file.seek(at)
                file.write(bytes([other]))
                with pytest.raises(InputError, match=f"match.jsonl line {1 + data[:at].count(10)}: "):
                    replay(path, history)
            file.seek(at)
            file.write(bytes([byte]))


@examples(150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    order=st.one_of(
        st.permutations(range(5)),
        st.lists(st.integers(0, 4), min_size=1, max_size=7),
        st.builds(lambda n, more: [*range(n), *more], st.integers(0, 5), st.lists(st.integers(0, 4), max_size=3)),
    ).filter(bool)
)
def test_lines_that_are_lost_doubled_or_moved_are_seen_where_they_are(order: list[int], tmp_path: Path) -> None:
    """The first line that does not follow the one before it; a record that only ends too early has no end."""
    path = tmp_path / "match.jsonl"
    path.unlink(missing_ok=True)
    history = small_record(path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[i] for i in order))
    right = next((i for i, line in enumerate(order) if i >= len(lines) or line != i), len(order))
    if order == [*range(5)]:
        assert replay(path, history) is None
    elif right == len(order):
        with says_no_end(path):
            assert replay(path, history) is None
    else:
        with pytest.raises(InputError, match=f"match.jsonl line {right + 1}: "):
            replay(path, history)


def test_a_break_of_the_chain_tells_what_was_expected_and_what_came(path: Path) -> None:
    """The line that came has the chain of the file that it was written to."""
    history = small_record(path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], *lines[3:]]))
    text, came = lines[3][:-29], lines[3][-19:-3].decode()
    expected = hashlib.sha256(b"".join([*lines[:2], text])).hexdigest()[:16]
    told = (
        f"line 3: chain: expected '{expected}', got '{came}': the line was changed, or does not follow the one before"
    )
    with pytest.raises(InputError, match=re.escape(told)):
        replay(path, history)


@pytest.mark.parametrize(
    ("end", "told"),
    [
        ({"end": 2}, "line 5: end: expected 3, the number of shots, got 2"),
        ({"end": True}, "line 5: end: expected a whole number from 0 to"),
        ({"end": 3, "seed": 1}, "line 5: key: expected one of 'end', got 'seed'"),
    ],
)
def test_an_end_that_does_not_count_the_shots_is_named(end: dict[str, Any], told: str, path: Path) -> None:
    history = small_record(path)
    write_sealed(path, (json.dumps(entry).encode() for entry in [*lines_of(path), end]))
    with pytest.raises(InputError, match=f"match.jsonl {told}"):
        replay(path, history)


def test_nothing_comes_behind_the_end(path: Path) -> None:
    history = small_record(path)
    entries = lines_of(path)
    write_sealed(path, (json.dumps(entry).encode() for entry in [*entries, {"end": 3}, entries[3]]))
    with pytest.raises(
        InputError, match=r"match.jsonl line 6: expected nothing behind the end of a record, got a line"
    ):
        replay(path, history)


def test_a_scene_that_changed_is_told_of_a_record_without_an_end(path: Path) -> None:
    world = load_scene(GALLERY)
    made = ShotRecord(path)
    made.fire(world, Point(), (5, 5))
    world.move(8, (99, 99))
    with says_no_end(path):
        found = replay(path, world)
    assert found is not None and found.told[1] == SAME
    made.close()


def test_an_older_record_without_a_chain_replays(path: Path) -> None:
    with ShotRecord(path) as made:
        made.fire(scene, RIFLE, [(100, 167), (100, 90)], aim=1)
    write_first_format(path)
    assert (
        path.read_bytes().startswith(b'{"format":"hitplanes-shots/1","version":"') and b"chain" not in path.read_bytes()
    )
    assert replay(path, scene) is None
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:2]))
    assert replay(path, scene) is None
    path.write_bytes(b"".join([*lines, b'{"end":2}\n']))
    with pytest.raises(InputError, match=r"match.jsonl line 4: key: expected one of 'scene', .*got 'end'"):
        replay(path, scene)


class Interrupted:
    """A file of which one write is interrupted, after some bytes."""

    def __init__(self, file: Any, taken: int) -> None:
        self._file, self._taken, self._rung = file, taken, False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def write(self, data: memoryview) -> int:
        if self._rung:
            return int(self._file.write(data))
        self._rung = True
        self._file.write(data[: self._taken])
        raise KeyboardInterrupt


@pytest.mark.parametrize("taken", [0, 1, 500, 10**6])
def test_an_interrupt_leaves_all_lines_of_a_call_or_none(taken: int, path: Path) -> None:
    with ShotRecord(path) as made:
        made.fire(scene, Point(), places(2))
        made._file = Interrupted(made._file, taken)  # type: ignore[assignment]
        with pytest.raises(KeyboardInterrupt):
            made.fire(scene, Point(), places(3), shot=[5, 6, 7])
        made.fire(scene, Point(), places(2), shot=[8, 9])
    assert [entry["shot"] for entry in lines_of(path)[1:]] == [0, 1, 8, 9]
    assert replay(path, scene) is None


def test_threads_may_fire_into_one_record(path: Path) -> None:
    with ShotRecord(path) as made:

        def fire_some(first: int) -> None:
            for number in range(first, first + 30):
                made.fire(scene, Point(), places(2), shot=[number, number])

        threads = [threading.Thread(target=fire_some, args=(1000 * i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(lines_of(path)) == 241 and replay(path, scene) is None


# Files


def test_places_that_cannot_be_read(tmp_path: Path) -> None:
    for place, error in ((tmp_path / "none.jsonl", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(InputError, match=f"^{place}: cannot read it: {error}"):
            replay(place, scene)
    with pytest.raises(InputError, match="record: expected a path, got 5"):
        replay(5, scene)  # type: ignore[arg-type]


def test_a_file_that_is_there_is_never_written_over(match: Path, tmp_path: Path) -> None:
    before = match.read_bytes()
    with pytest.raises(InputError, match=f"record: expected a new file, got {match}: File exists"):
        ShotRecord(match)
    assert match.read_bytes() == before
    (tmp_path / "link.jsonl").symlink_to(tmp_path / "gone.jsonl")
    for place, error in (
        (tmp_path / "link.jsonl", "link.jsonl: expected the name of a file"),
        (tmp_path, "expected the name of a file"),
        (tmp_path / "no" / "such.jsonl", "no folder"),
        (tmp_path / "a\0b", "record: expected a path, got .*zero byte"),
        (None, "record: expected a path, got None"),
    ):
        with pytest.raises(InputError, match=error):
            ShotRecord(place)  # type: ignore[arg-type]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.jsonl", "match.jsonl"]


def test_a_call_that_cannot_be_fired_is_not_in_the_record(path: Path) -> None:
    with ShotRecord(path) as record:
        record.fire(scene, Point(), (62, 86))
        with pytest.raises(InputError, match=r"at\[1\]"):
            record.fire(scene, Point(), [(62, 86), (62, float("nan"))])
        with pytest.raises(InputError, match=r"at\[1\]: expected a start outside of every item"):
            record.fire(scene, Laser(9, inside="error"), [(5, 5), (160, 172)])
        record.fire(scene, Point(), (62, 86))
    assert len(lines_of(path)) == 3 and replay(path, scene) is None


def test_a_record_that_is_closed_fires_no_more(path: Path) -> None:
    with ShotRecord(path) as record:
        record.fire(scene, Point(), (62, 86))
    record.close()
    with pytest.raises(InputError, match=f"record: expected one that is open, got {path}, which is closed"):
        record.fire(scene, Point(), (62, 86))


FULL = """
import resource, sys
from pathlib import Path
from hitplanes import InputError, Point, ShotRecord, load_scene
scene = load_scene("fixtures/gallery")
path, room = Path(sys.argv[1]), int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
with ShotRecord(path) as record:
    for n in range(99):
        try:
            record.fire(scene, Point(), [(62, 86)] * 2, shot=[2 * n, 2 * n + 1])
        except InputError as error:
            print(n, error)
            break
    print(path.stat().st_size)
"""


def on_a_full_disk(path: Path, room: int) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    words = [sys.executable, "-W", "error", "-c", FULL, str(path), str(room)]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, env=environment)


def test_a_full_disk_is_told_and_leaves_whole_lines(path: Path) -> None:
    done = on_a_full_disk(path, 5101)
    assert done.returncode == 0
    (n, error), size = done.stdout.splitlines()[0].split(" ", 1), done.stdout.splitlines()[1]
    assert error == f"record: cannot write {path}: File too large"
    end = path.read_bytes().splitlines(keepends=True)[-1]
    assert path.stat().st_size == int(size) + len(end) < 5101
    assert [entry["shot"] for entry in lines_of(path)[1:]] == list(range(2 * int(n)))
    assert int(n) > 3 and replay(path, scene) is None


def test_a_disk_too_full_for_the_end_is_told(path: Path) -> None:
    size = int(on_a_full_disk(path, 5101).stdout.splitlines()[1])
    path.unlink()
    done = on_a_full_disk(path, size + 9)
    assert done.returncode == 1
    assert done.stderr.endswith(
        f"hitplanes.planes.common.checks.InputError: record: cannot write {path}: File too large\n"
    )
    assert path.stat().st_size == size
    with says_no_end(path):
        assert replay(path, scene) is None


def test_an_error_of_the_game_is_not_hidden_by_one_of_the_end(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise InputError("full")

    with pytest.raises(KeyError), ShotRecord(path) as made:
        monkeypatch.setattr(made, "_write", full)
        raise KeyError
    with pytest.raises(InputError, match="full"), ShotRecord(path.with_name("other.jsonl")) as made:
        monkeypatch.setattr(made, "_write", full)


def test_a_write_in_pieces_is_whole(path: Path) -> None:
    """As a pipe or a disk that fills up may take them."""

    class Slow:
        closed = False

        def __init__(self) -> None:
            self.taken = b""

        def write(self, data: memoryview) -> int:
            self.taken += bytes(data[:7])
            return min(len(data), 7)

    record = ShotRecord(path)
    file, record._file = record._file, Slow()  # type: ignore[assignment]
    record.fire(scene, Disc(9), places(3))
    file.write(record._file.taken)  # type: ignore[attr-defined]
    file.close()
    assert len(lines_of(path)) == 4
    with says_no_end(path):
        assert replay(path, scene) is None


# Long records


def test_lines_of_one_weapon_are_fired_together_in_parts(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ShotRecord(path) as made:
        for weapon in (Point(), Disc(9), Point()):
            made.fire(scene, weapon, places(10))
    calls: list[int] = []

    def counted(at: Scene, weapon: Weapon, shots: Any) -> Any:
        calls.append(len(shots))
        return fired(at, weapon, shots)

    fired = record.fired
    monkeypatch.setattr(record, "fired", counted)
    assert replay(path, scene) is None and calls == [10, 10, 10]
    calls.clear()
    monkeypatch.setattr(record, "AT_ONCE", 4)
    assert replay(path, scene) is None and calls == [4, 4, 2] * 3
    calls.clear()
    monkeypatch.setattr(record, "BYTES_AT_ONCE", 1)
    assert replay(path, scene) is None and calls == [1] * 30
    calls.clear()
    monkeypatch.setattr(record, "BYTES_AT_ONCE", 3000)
    assert replay(path, scene) is None and 1 < min(calls) <= max(calls) < 10 and len(set(calls[:-1])) < 4


def test_a_scene_is_hashed_once_for_each_of_its_versions(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world = load_scene(GALLERY)
    hashed: list[int] = []
    monkeypatch.setattr(Scene, "content_hash", lambda self: hashed.append(self.version) or "abc")
    with ShotRecord(path) as made:
        for n in range(4):
            made.fire(world, Point(), places(3))
            made.fire(world, Disc(3 + n), places(3))
    assert len(hashed) == 1 and replay(path, world) is None and len(hashed) == 2
    world.move(8, (3, 3))
    assert replay(path, world) is None and len(hashed) == 3


def test_a_record_keeps_no_scene_of_the_past(path: Path) -> None:
    """An hour of ticks would fill memory."""
    world = load_scene(GALLERY)
    history = History(world, ticks=2)
    with ShotRecord(path) as made:
        for _ in range(50):
            made.fire(history, Point(), (62, 86), tick=history.record())
        assert len(made._hashes._known) <= 2


def long_record(path: Path, lines: int) -> Scene:
    """The same shot, over and over."""
    world = Scene((40, 40))
    world.add(np.ones((5, 5), bool), (20, 20))
    with ShotRecord(path) as made:
        made.fire(world, Pistol(30), (4, 20))
    header, line = (json.dumps(entry).encode() for entry in lines_of(path))
    write_sealed(path, chain([header], repeat(line, lines), [b'{"end":%d}' % lines]))
    return world


def test_a_record_is_read_in_a_stream(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python keeps up to 2000 freed tuples of a size, until it collects garbage: they are not counted."""
    results = record._results

    def collected(*group: Any) -> Any:
        gc.collect()
        return results(*group)

    monkeypatch.setattr(record, "AT_ONCE", 10)
    monkeypatch.setattr(record, "_results", collected)
    gc.freeze()  # so little is left that each collection is fast
    peaks = []
    for lines in (100, 500):
        path.unlink(missing_ok=True)
        world = long_record(path, lines)
        tracemalloc.start()
        assert replay(path, world) is None
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    gc.unfreeze()
    assert peaks[1] < 2 * peaks[0]


@pytest.mark.long
def test_a_long_record_takes_little_memory(path: Path) -> None:
    world = long_record(path, 10**5)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert replay(path, world) is None
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert path.stat().st_size > 50 * 2**20 and grown < 40 * 2**10


def test_a_difference_can_be_printed_whatever_things_are_called(tmp_path: Path) -> None:
    name = "a\x7f\x9b\u2028\u202e\u2066"
    world = Scene((40, 30))
    world.add(Sprite.circle(4), (10, 10), name=name)
    path = tmp_path / "match.jsonl"
    with ShotRecord(path) as written:
        written.fire(world, Pistol(30), (0, 10), aim=0)
    lines = lines_of(path)
    lines[1]["result"]["stops"][0][name] = 5  # what is no column is told by its name
    lines[1]["hash"] = hash_of(lines[1]["result"])
    write_record(path, lines)
    found = replay(path, world)
    assert found is not None and r"\x7f" in "".join(found.told)
    assert all(line.isprintable() for line in found.told)
