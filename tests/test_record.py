"""A record of shots fired again: the same, or the line, the shot and how it differs; and files that are damaged."""

from __future__ import annotations

import json
import os
import random
import resource
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planes import History, InputError, Scene, load_scene
from weapons import (
    Beam,
    Box,
    Cone,
    Disc,
    Laser,
    Pistol,
    Point,
    Polygon,
    Projectile,
    Rifle,
    Ring,
    Rounds,
    ShotRecord,
    Spread,
    Stencil,
    Sweep,
    Weapon,
    fire,
    record,
    replay,
)
from weapons.arsenal import KINDS
from weapons.record import hash_of

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
    return [json.loads(line) for line in path.read_bytes().splitlines()]


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
    assert len(lines_of(path)) == 2 and replay(path, scene) is None
    record.close()


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
    assert found is not None and found.told[0].startswith("scene: its content hash is ")


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
        (GALLERY, "line 2: scene: expected a Scene, got PosixPath"),
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
    path.write_text("".join(json.dumps(entry) + "\n" for entry in entries))


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
    """Change one line, the first is 1; its result keeps its hash."""
    entries = lines_of(path)
    change(entries[number - 1])
    path.write_text("".join(json.dumps(entry) + "\n" for entry in entries))


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
    "tick": (lambda e: e.update(tick="now"), "tick: expected numbers, got 'now'"),
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
    "letters": (lambda line: b"x" + line, "expected JSON in UTF-8"),
    "zeros": (lambda line: b"\0" * 60 + line[60:], "expected JSON in UTF-8"),
    "no UTF-8": (lambda line: line.replace(b'"scene":"', b'"scene":"\xff'), "line 3"),
    "twice a key": (lambda line: line.replace(b"{", b'{"seed":1,', 1), "key: expected each key once, got 'seed' again"),
    "NaN": (lambda line: line.replace(b'"seed":0', b'"seed":NaN'), "number: expected a finite number, got NaN"),
    "empty": (lambda line: b"\n", "expected JSON in UTF-8"),
    "no object": (lambda line: b"[]\n", "shot: expected an object, got"),
    "deep": (lambda line: b"[" * 10**5 + b"\n", "expected JSON in UTF-8: maximum recursion depth"),
    "digits": (lambda line: line.replace(b'"seed":0', b'"seed":' + b"1" * 5000), "expected JSON in UTF-8: Exceeds"),
}


@pytest.mark.parametrize("name", LINES)
def test_a_line_that_is_no_shot_is_named(name: str, match: Path) -> None:
    change, error = LINES[name]
    lines = match.read_bytes().splitlines(keepends=True)
    lines[2] = change(lines[2])
    match.write_bytes(b"".join(lines))
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
    assert replay(match, scene) is None


def test_headers_that_are_none(match: Path) -> None:
    header, *lines = match.read_bytes().splitlines(keepends=True)
    for other, error in {
        b"": "expected a whole line of a record, got an empty file",
        header.rstrip(): "expected a whole line of a record, got one that is cut off",
        header.replace(b"shots/1", b"shots/2"): "format: expected 'hitplanes-shots/1', got 'hitplanes-shots/2'",
        b'{"format":"hitplanes-hits/1"}\n': "format: expected 'hitplanes-shots/1', got 'hitplanes-hits/1'",
        b'{"format":"hitplanes-shots/1"}\n': "version: expected a value, got nothing",
        header.replace(b"{", b'{"rows":1,'): "key: expected one of 'format', 'version', got 'rows'",
        b"\x89PNG\r\n\x1a\n": "expected JSON in UTF-8",
        lines[0]: "format: expected 'hitplanes-shots/1', got None",
        b"[]\n": "header: expected an object",
    }.items():
        match.write_bytes(other + b"".join(lines) if other.endswith(b"\n") else other)
        with pytest.raises(InputError, match=f"match.jsonl line 1: ({error})"):
            replay(match, scene)


def test_endless_files_are_read_no_further_than_a_line(match: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "TEXT_BYTES_MAX", 5000)
    assert replay(match, scene) is None
    os.truncate(match, 2**26)  # zeros
    tracemalloc.start()
    with pytest.raises(InputError, match="line 9: expected at most 5000 bytes, got more"):
        replay(match, scene)
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()
    with pytest.raises(InputError, match="/dev/zero line 1: expected at most 5000 bytes, got more"):
        replay("/dev/zero", scene)


def test_whatever_is_damaged_it_ends_in_words(match: Path) -> None:
    rng = random.Random(3)
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
            assert found is None or found.told


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
        (tmp_path / "a\0b", "null byte|expected the name"),
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
from planes import InputError, load_scene
from weapons import Point, ShotRecord
scene = load_scene("fixtures/gallery")
resource.setrlimit(resource.RLIMIT_FSIZE, (5001, 5001))
with ShotRecord(sys.argv[1]) as record:
    for n in range(99):
        try:
            record.fire(scene, Point(), [(62, 86)] * 2, shot=[2 * n, 2 * n + 1])
        except InputError as error:
            print(n, error)
            break
    print(record._size)
"""


def test_a_full_disk_is_told_and_leaves_whole_lines(path: Path) -> None:
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    words = [sys.executable, "-W", "error", "-c", FULL, str(path)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True, env=environment)
    (n, error), size = done.stdout.splitlines()[0].split(" ", 1), done.stdout.splitlines()[1]
    assert error == f"record: cannot write {path}: File too large"
    assert path.stat().st_size == int(size) < 5001
    assert [entry["shot"] for entry in lines_of(path)[1:]] == list(range(2 * int(n)))
    assert int(n) > 3 and replay(path, scene) is None


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
    assert len(lines_of(path)) == 4 and replay(path, scene) is None


# Long records


def test_lines_of_one_weapon_are_fired_together_in_parts(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ShotRecord(path) as made:
        for weapon in (Point(), Disc(9), Point()):
            made.fire(scene, weapon, places(10))
    calls: list[int] = []

    def counted(at: Scene, weapon: Weapon, shots: Any, *how: str) -> Any:
        calls.append(len(shots))
        return fired(at, weapon, shots, *how)

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
    header, line = path.read_bytes().splitlines(keepends=True)
    with path.open("wb") as file:
        file.write(header)
        for _ in range(lines // 100):
            file.write(line * 100)
    return world


def test_a_record_is_read_in_a_stream(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "AT_ONCE", 10)
    peaks = []
    for lines in (100, 500):
        path.unlink(missing_ok=True)
        world = long_record(path, lines)
        tracemalloc.start()
        assert replay(path, world) is None
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2 * peaks[0]


@pytest.mark.long
def test_a_long_record_takes_little_memory(path: Path) -> None:
    world = long_record(path, 10**5)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert replay(path, world) is None
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert path.stat().st_size > 50 * 2**20 and grown < 40 * 2**10
