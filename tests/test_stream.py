"""A log of shots in, a log of hits out: the answers of single shots, bad lines, and every way to be interrupted."""

from __future__ import annotations

import io
import json
import os
import pty
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from some_of import in_turn, some_of

from hitplanes import InputError, RayHits, Reason, Scene, load_scene, weapons_of
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.replay import shot_log, stream
from hitplanes.weapons.replay.shot_log import LINE_MAX, fire_request, request_from_json
from hitplanes.weapons.replay.stream import Progress

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "fixtures" / "gallery"
COMMAND = [sys.executable, "-W", "error", "-m", "hitplanes", "fire"]

scene = load_scene(GALLERY)
weapons = weapons_of(scene)


def line_of(shot: Any) -> bytes:
    return json.dumps(shot).encode() + b"\n"


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def run(log: Path, output: Path) -> stream.Streamed:
    return stream.fire_log(scene, log, output, Progress(io.StringIO()))


def answers_of(lines: bytes, folder: Path) -> list[dict[str, Any]]:
    """What the stream answers to a log."""
    log, output = folder / "shots.jsonl", folder / "hits.jsonl"
    log.write_bytes(lines)
    run(log, output)
    return [json.loads(line) for line in output.read_bytes().splitlines()[1:]]


def alone(data: Any, number: int, scene: Scene = scene) -> dict[str, Any]:
    """What one shot answers, fired by itself."""
    request = request_from_json(data, scene, weapons, number=number)
    hits = fire_request(scene, request)
    rows = [
        [r.object, r.round, r.samples, r.pixels, r.weight, r.pellets, *r.first_xy, r.distance2] for r in hits
    ]  # fmt: skip
    return {"shot": request.shot, "rows": rows, "verdicts": list(hits.verdict_counts().values())}


# The same answers as shot by shot

coordinate = st.one_of(st.integers(-20, 500), st.floats(-20, 500).map(lambda v: round(v, 3)))
point = st.lists(coordinate, min_size=2, max_size=2)
usual = st.fixed_dictionaries(
    {"weapon": st.sampled_from(sorted(weapons)), "at": point},
    optional={
        "accept": st.lists(st.sampled_from(scene.categories), unique=True),
        "blocked_by": st.lists(st.sampled_from(scene.categories), unique=True),
        "exclude": st.lists(st.sampled_from(["duck 1", "fly", "wall", 0, 3, 17, "clown"]), max_size=3),
        "seed": st.sampled_from([0, 1, 2**53 + 1, 2**63, 2**64 - 1]),
        "shot": st.sampled_from([0, 5, 2**53 + 1, 2**63 - 1]),
    },
)
aimed = st.one_of(
    usual,
    st.builds(lambda shot, aim: {**shot, "aim": aim}, usual, st.one_of(st.none(), coordinate)),
    st.builds(lambda shot, x, y: {**shot, "toward": [shot["at"][0] + x, y]}, usual, st.integers(1, 99), coordinate),
)
unusual = st.one_of(
    st.builds(lambda shot: {**shot, "seed": 7.0}, aimed), st.builds(lambda shot: {**shot, "exclude": [3.0]}, aimed)
)


@examples(17, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(shots=st.lists(st.one_of(aimed, aimed, aimed, aimed, unusual), max_size=40), chunk=st.sampled_from([1, 7, 1024]))
def test_a_line_answers_what_its_shot_answers_alone(shots: list[dict[str, Any]], chunk: int, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stream, "LINES_FIRST", chunk)
        answers = answers_of(b"".join(map(line_of, shots)), tmp_path)
    told = [{k: v for k, v in a.items() if k not in ("of", "crc")} for a in answers]
    assert told == [alone(s, i) for i, s in enumerate(shots)]
    assert [a["of"] for a in answers] == [f"{zlib.crc32(json.dumps(s).encode()):08x}" for s in shots]


def test_names_of_what_is_passed_over(tmp_path: Path) -> None:
    """A part stands for its owner; a name that two objects have stands for neither."""
    scene = Scene((40, 40))
    body = scene.add(np.ones((9, 9), bool), (10, 10), name="body")
    scene.add(np.ones((5, 5), bool), (10, 10), layer=1, owner=body, name="hat")
    for x in (20, 30):
        scene.add(np.ones((5, 5), bool), (x, 10), name="twin")
    scene.weapons["gun"] = {"kind": "disc", "radius": 40, "pierce": True}
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    lists: list[list[Any]] = [[], ["hat"], [2], ["hat", 3], ["body", 2, 3], ["hat"]]
    log.write_bytes(b"".join(line_of({"weapon": "gun", "at": [20, 10], "exclude": owners}) for owners in lists))
    stream.fire_log(scene, log, output, Progress(io.StringIO()))
    answers = [json.loads(line) for line in output.read_bytes().splitlines()[1:]]
    hit = [sorted(row[0] for row in answer["rows"]) for answer in answers]
    assert hit == [[0, 1, 2, 3], [2, 3], [0, 1, 3], [2], [], [2, 3]]
    log.write_bytes(line_of({"weapon": "gun", "at": [20, 10], "exclude": ["twin"]}))
    with pytest.raises(InputError, match=r"line 1: exclude\[0\]: name: expected one object named 'twin', got 2"):
        stream.fire_log(scene, log, output, Progress(io.StringIO()))


def test_usual_lines_are_read_together_and_an_unusual_one_only_with_its_neighbours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    read: list[int] = []
    one_by_one = shot_log.ShotReader._one_by_one

    def counted(self: Any, bodies: list[bytes], first: int) -> Any:
        read.append(len(bodies))
        return one_by_one(self, bodies, first)

    monkeypatch.setattr(shot_log.ShotReader, "_one_by_one", counted)
    shots: list[Any] = [{"weapon": "point", "at": [i, i], "accept": ["target"], "exclude": [3]} for i in range(256)]
    reader = shot_log.ShotReader(scene, weapons, "log")
    bodies = [json.dumps(shot).encode() for shot in shots]
    assert [request.shot for request in reader.read(bodies, 0)[0]] == list(range(256)) and not read
    bodies[77] += b" "
    requests, error = reader.read(bodies, 0)
    assert [request.shot for request in requests] == list(range(256)) and error is None and sum(read) == shot_log.FEW


def test_the_first_line_tells_what_was_fired_at_and_names_objects(tmp_path: Path) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    lines = [b'{"weapon": "point", "at": [62, 86]}', b'{"weapon": "point", "at": [162, 172]}']
    log.write_bytes(b"\r\n".join(lines))
    done = run(log, output)
    header, first, second = map(json.loads, output.read_bytes().splitlines())
    assert header["format"] == "hitplanes-hits/3" and header["scene"] == scene.content_hash()
    assert header["verdicts"] == ["empty", "hit", "occluded", "filtered", "outside"]
    row = dict(zip(header["columns"], first["rows"][0], strict=True))
    assert header["objects"][str(row["object"])] == "bullseye" and (row["x"], row["y"]) == (62, 86)
    assert second["of"] == f"{zlib.crc32(lines[1]):08x}" and second["shot"] == 1
    assert (done.shots, done.hit, done.resumed) == (2, 2, 0)
    assert names_in(tmp_path) == ["hits.jsonl", "shots.jsonl"]


def test_chunks_follow_the_time_that_they_take(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("hitplanes.weapons.replay.stream.time.monotonic", lambda: now[0])
    taken = []
    for chunk in stream._chunks(io.BytesIO(GOOD * 100_000)):
        taken.append(len(chunk))
        now[0] += len(chunk) * (1e-6 if len(taken) < 8 else 1e-3)
        if len(taken) > 16:
            break
    assert taken[:8] == [16, 64, 256, 1024, 4096, 16384, 16384, 16384]
    assert taken[8:15] == [8192, 4096, 2048, 1024, 512, 256, 256]


def test_no_shots_at_all(tmp_path: Path) -> None:
    assert answers_of(b"", tmp_path) == []


# Logs of rays

RAYS: dict[str, Any] = {
    "rifle": {"kind": "rifle", "range": 300, "max_hits": 3, "falloff": "linear"},
    "tank": {"kind": "rifle", "range": 400, "budget": 70.5, "width": 5},
    "beam": {"kind": "laser", "range": 250, "inside": "ignore_until_exit"},
    "sight": {"kind": "laser", "range": None},
    "fan": {"kind": "sweep", "ray": {"kind": "pistol", "range": 200}, "angle": 40, "count": 5},
    "slugs": {"kind": "spread", "pellet": {"kind": "pistol", "range": 200}, "count": 4, "radius": 30},
    "burst": {"kind": "rounds", "weapon": {"kind": "laser", "range": 90}, "count": 3, "recoil_xy": [2, 1]},
    "shell": {"kind": "projectile", "speed": 180, "radius": 2.5},
    "careful": {"kind": "laser", "range": 50, "inside": "error"},
}


@pytest.fixture(scope="module")
def armed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The gallery with rays among its weapons."""
    folder = tmp_path_factory.mktemp("armed") / "scene"
    load = load_scene(GALLERY)
    load.weapons |= RAYS
    load.save(folder)
    return folder


def mixed(n: int, seed: int = 0) -> list[dict[str, Any]]:
    """Shots of rays and of patterns, of any arguments."""
    rng = random.Random(seed)
    names = [name for name in [*RAYS, "point", "blast", "shotgun"] if name != "careful"]
    shots: list[dict[str, Any]] = []
    for _ in range(n):
        at = [round(rng.uniform(60, 420), 2), round(rng.uniform(60, 230), 2)]
        shot: dict[str, Any] = {"weapon": rng.choice(names), "at": at}
        if shot["weapon"] == "sight" or rng.random() < 0.3:
            shot["toward"] = [round(rng.uniform(0, 480), 1), 100]
        elif rng.random() < 0.8:
            shot["aim"] = rng.randint(-1800, 1800) / 10
        if rng.random() < 0.3:
            shot |= {"accept": ["target"], "exclude": rng.sample(["duck 1", "fly", 3], rng.randint(0, 2))}
        if rng.random() < 0.3:
            shot |= {"seed": rng.getrandbits(64), "shot": rng.getrandbits(60)}
        shots.append(shot)
    return shots


def columns_of(told: list[str]) -> list[str]:
    """Names of the numbers of a list: one that ends in _xy stands for two."""
    return [name for one in told for name in ((one[:-3] + "_x", one[:-3] + "_y") if one.endswith("_xy") else (one,))]


def table_of(columns: Any, names: list[str]) -> list[list[float]]:
    """The same numbers, of the library's columns."""
    rows = []
    for number in range(len(columns)):
        row: list[float] = []
        for name in names:
            value = getattr(columns, name)[number].tolist()
            row += value if isinstance(value, list) else [value]
        rows.append(row)
    return rows


@pytest.mark.parametrize("chunk", [1, 7, 1024])
def test_lines_of_rays_answer_what_their_shots_answer_alone(chunk: int, armed: Path, tmp_path: Path) -> None:
    world = load_scene(armed)
    weapons = weapons_of(world)
    shots = mixed(60)
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(b"".join(map(line_of, shots)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stream, "LINES_FIRST", chunk)
        done = stream.fire_log(world, log, output, Progress(io.StringIO()))
    header, *answers = [json.loads(line) for line in output.read_bytes().splitlines()]
    assert header["reasons"] == [reason.name.lower() for reason in Reason]
    kinds = {"rays": 0, "patterns": 0, "passes": 0}
    for number, (shot, answer) in enumerate(zip(shots, answers, strict=True)):
        request = request_from_json(shot, world, weapons, number=number)
        hits = fire_request(world, request)
        rows = [[r.object, r.round, r.samples, r.pixels, r.weight, r.pellets, *r.first_xy, r.distance2] for r in hits]
        expected: dict[str, Any] = {"shot": request.shot, "of": f"{zlib.crc32(json.dumps(shot).encode()):08x}"}
        expected["rows"] = rows
        if isinstance(hits, RayHits):
            expected["passes"] = table_of(hits.passes, header["passes"])
            expected["stops"] = table_of(hits.stop, header["stops"])
            kinds["rays"] += 1
            kinds["passes"] += len(hits.passes)
        else:
            expected["verdicts"] = list(hits.verdict_counts().values())
            kinds["patterns"] += 1
        assert len(answer.pop("crc")) == 8 and answer == expected and list(answer) == list(expected)
    assert min(kinds.values()) > 10 and done.hit == sum(bool(answer["rows"]) for answer in answers)


def test_the_header_names_each_number_of_passes_and_stops(armed: Path, tmp_path: Path) -> None:
    """One shot read by the header alone."""
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(line_of({"weapon": "rifle", "at": [100, 167], "aim": 0}))
    stream.fire_log(load_scene(armed), log, output, Progress(io.StringIO()))
    header, answer = map(json.loads, output.read_bytes().splitlines())
    first, *_ = [dict(zip(columns_of(header["passes"]), row, strict=True)) for row in answer["passes"]]
    (stop,) = [dict(zip(columns_of(header["stops"]), row, strict=True)) for row in answer["stops"]]
    assert header["objects"][str(first["object"])] == "duck 1" and (first["entry_x"], first["entry_y"]) == (138, 167)
    assert first["entry_px"] == 37.5 and first["order"] == first["round"] == first["pellet"] == 0
    assert header["reasons"][stop["reason"]] == "hits" and stop["item"] == answer["passes"][-1][0]
    assert stop["distance"] == answer["passes"][-1][columns_of(header["passes"]).index("entry_px")]


@pytest.mark.parametrize(("kept", "seed"), in_turn([0.0, 0.3, 0.7, 1.0], [1, 2]))
def test_a_log_of_rays_cut_anywhere_goes_on_to_the_same_bytes(
    kept: float, seed: int, armed: Path, tmp_path: Path
) -> None:
    world = load_scene(armed)
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(b"".join(map(line_of, mixed(50, seed))))
    stream.fire_log(world, log, output, Progress(io.StringIO()))
    whole = output.read_bytes()
    lines = whole.splitlines(keepends=True)
    for cut in (sum(map(len, lines[: 1 + int(50 * kept)])), int(len(whole) * kept)):
        output.unlink()
        output.with_name("hits.jsonl.part").write_bytes(whole[:cut])
        done = stream.fire_log(world, log, output, Progress(io.StringIO()))
        assert output.read_bytes() == whole and done.shots == 50
        assert done.resumed == max(whole[:cut].count(b"\n") - 1, 0)


@pytest.mark.parametrize("name", ["passes", "stops", "rows"])
def test_a_damaged_answer_of_rays_is_answered_again(name: str, armed: Path, tmp_path: Path) -> None:
    world = load_scene(armed)
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(line_of({"weapon": "fan", "at": [100, 167]}) * 8)
    stream.fire_log(world, log, output, Progress(io.StringIO()))
    whole = output.read_bytes()
    lines = whole.splitlines(keepends=True)
    for bad in (lines[4].replace(b'"%b":[' % name.encode(), b'"%b":[x' % name.encode()), b"{}\n"):
        output.with_name("hits.jsonl.part").write_bytes(b"".join([*lines[:4], bad, *lines[5:]]))
        output.unlink()
        assert stream.fire_log(world, log, output, Progress(io.StringIO())).resumed == 3
        assert output.read_bytes() == whole


def test_every_answer_is_known_when_it_is_read_again(armed: Path, tmp_path: Path) -> None:
    """Whatever numbers it has, as those of a far place."""
    scene = Scene()
    scene.add(np.ones((3, 3), bool), (10**9, -(10**9)))
    scene.weapons |= RAYS
    shots = [{"weapon": "rifle", "at": [10**9 - x, -(10**9)], "aim": 1e-7 * x} for x in (0, 1, 2, 1.4999, 250)]
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(b"".join(map(line_of, shots)))
    stream.fire_log(scene, log, output, Progress(io.StringIO()))
    whole = output.read_bytes()
    output.rename(output.with_name("hits.jsonl.part"))
    assert stream.fire_log(scene, log, output, Progress(io.StringIO())).resumed == len(shots)
    assert output.read_bytes() == whole


def test_a_ray_that_starts_where_it_may_not_is_named_with_its_line(
    armed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    good, bad = ({"weapon": "careful", "at": at} for at in ([5, 5], [160, 172]))
    context = {"weapon": "sight", "at": [5, 5]}
    for line, told in ((bad, "at[0]: expected a start outside of every item"), (context, "toward: expected a point")):
        log.write_bytes(line_of(good) * 5 + line_of(line) + line_of(good) * 5)
        assert main(["fire", str(armed), str(log), "-o", str(output)]) == 2
        error = capsys.readouterr().err
        assert f"{log} line 6: {told}" in error and error.count("\n") == 1
        log.write_bytes(line_of(good) * 11)
        assert main(["fire", str(armed), str(log), "-o", str(output)]) == 0
        assert "answers 5 shots: going on" in capsys.readouterr().err


# Bad lines

GOOD = b'{"weapon": "point", "at": [62, 86]}\n'
BAD = {
    b'{"weapon": "point", "at": [62, NaN]}': "at[1]: expected a finite number, got nan",
    b'{"weapon": "point", "at": [62, 1e999]}': "at[1]: expected a finite number, got inf",
    b'{"weapon": "point", "at": [62, 1e40]}': "at[1]: expected a number within",
    b'{"weapon": "point", "at": [true, false]}': "at: expected numbers, got [True, False]",
    b'{"weapon": "point", "at": [62]}': "at: expected shape (2,), got (1,)",
    b'{"weapon": "point", "at": "ab"}': "at: expected numbers",
    b'{"weapon": "point"}': "at: expected two numbers, got nothing",
    b'{"weapon": "poimt", "at": [62, 86]}': "did you mean 'point'?",
    b'{"weapon": ["point"], "at": [62, 86]}': "weapon: expected a text",
    b'{"weapon": "point", "at": [62, 86], "sede": 1}': "key: expected one of 'weapon', 'at', 'aim', 'toward'",
    b'{"weapon": "point", "at": [62, 86], "at": [1, 2]}': "key: expected each key once, got 'at' again",
    b'{"weapon": "point", "at": [62, 86], "aim": NaN}': "aim: expected a finite number, got nan",
    b'{"weapon": "point", "at": [62, 86], "aim": 1, "toward": [1, 2]}': "aim: expected aim or toward, got both",
    b'{"weapon": "point", "at": [62, 86], "toward": [62, 86]}': "toward[0]: expected a point other than",
    b'{"weapon": "point", "at": [62, 86], "toward": [62, NaN]}': "toward[1]: expected a finite number, got nan",
    b'{"weapon": "point", "at": [62, 86], "seed": 18446744073709551616}': "seed: expected a whole number",
    b'{"weapon": "point", "at": [62, 86], "seed": -1}': "seed: expected a whole number",
    b'{"weapon": "point", "at": [62, 86], "seed": true}': "seed: expected a whole number",
    b'{"weapon": "point", "at": [62, 86], "shot": 9223372036854775808}': "shot: expected a whole number",
    b'{"weapon": "point", "at": [62, 86], "shot": null}': "shot: expected a whole number",
    b'{"weapon": "point", "at": [62, 86], "accept": null}': "accept: expected a list, got None",
    b'{"weapon": "point", "at": [62, 86], "accept": ["target", "target"]}': "accept: expected distinct names",
    b'{"weapon": "point", "at": [62, 86], "accept": ["tarket"]}': "did you mean 'target'?",
    b'{"weapon": "point", "at": [62, 86], "Seeds": 3}': "did you mean 'seed'?",
    b'{"wepon": "point", "at": [62, 86]}': "did you mean 'weapon'?",
    b'{"weapon": "point", "at": [62, 86], "blocked_by": 3}': "blocked_by: expected a list, got 3",
    b'{"weapon": "point", "at": [62, 86], "blocked_by": ["tarket"]}': "did you mean 'target'?",
    b'{"weapon": "point", "at": [62, 86], "exclude": [true]}': "exclude[0]: expected a whole number",
    b'{"weapon": "point", "at": [62, 86], "exclude": ["dukc 1"]}': "did you mean 'duck 1'?",
    b'{"weapon": "point", "at": [62, 86], "exclude": [99]}': "exclude[0]: owner: expected a whole number from 0 to",
    b'{"weapon": "point", "at": [62, 86]} {}': "expected JSON: Extra data at column 37",
    b'{"weapon": "point", "at": [62, 86]': "expected JSON: Expecting ',' delimiter at column",
    b'[{"weapon": "point", "at": [62, 86]}]': "shot: expected an object",
    b'"\xff"': "expected JSON in UTF-8: 'utf-8' codec can't decode byte 0xff",
    b"[" * 100_000: "expected JSON in UTF-8: maximum recursion depth",
    b"1" * 5000: "expected JSON in UTF-8: Exceeds the limit",
    b'{"weapon": "point", "at": [62, 86'
    + b" " * (LINE_MAX - 34)
    + b"]}": f"expected at most {LINE_MAX} bytes, got more",
    b"": "expected a shot, got an empty line",
    b"  \r": "expected a shot, got an empty line",
}


@pytest.mark.parametrize("bad", some_of(BAD), ids=lambda bad: bad[:60].decode(errors="replace"))
def test_a_bad_line_is_named_and_the_answers_before_it_are_kept(
    bad: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    words = ["fire", str(GALLERY), str(log), "-o", str(output)]
    log.write_bytes(GOOD * 20 + bad + b"\n" + GOOD * 20)
    assert main(words) == 2
    told = capsys.readouterr()
    assert told.err.startswith(f"hitplanes: {log} line 21: {BAD[bad]}") or BAD[bad].startswith("did you mean")
    assert BAD[bad] in told.err and told.err.count("\n") == 1 and len(told.err) < 600 and not told.out
    assert not output.exists()
    log.write_bytes(GOOD * 41)
    assert main(words) == 0
    told = capsys.readouterr()
    assert told.err == f"hitplanes: {output}.part answers 20 shots: going on after them\n"
    assert told.out == f"41 shots, 41 hit something, in {output}\n"
    resumed = output.read_bytes()
    assert main(words) == 0
    assert output.read_bytes() == resumed and not capsys.readouterr().err


def test_a_shot_that_cannot_be_fired_is_named_in_any_chunk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "LINES_FIRST", 4)
    bad = line_of({"weapon": "point", "at": [62, 86], "toward": [62, 86]})
    with pytest.raises(InputError, match=r"shots.jsonl line 8: toward\[0\]: expected a point other than"):
        answers_of(GOOD * 7 + bad + GOOD, tmp_path)


def test_a_bad_first_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(b"[]\n" + GOOD * 99)
    assert main(["fire", str(GALLERY), str(log), "-o", str(output)]) == 2
    assert f"{log} line 1: shot: expected an object" in capsys.readouterr().err
    assert output.with_name("hits.jsonl.part").read_bytes().count(b"\n") == 1


def test_a_line_may_be_as_long_as_the_limit(tmp_path: Path) -> None:
    body = GOOD.strip() + b" " * (LINE_MAX - len(GOOD.strip()))
    assert len(answers_of(body + b"\r\n" + body, tmp_path)) == 2


# Another log, scene or weapons


@pytest.fixture
def begun(tmp_path: Path) -> Iterator[tuple[Path, Path, Path]]:
    """A copy of the scene, a log of 30 shots, and the part of an output that answers 12 of them."""
    folder, log, output = tmp_path / "scene", tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    shutil.copytree(GALLERY, folder, ignore=shutil.ignore_patterns("draw.py", "__pycache__"))
    log.write_bytes(b"".join(line_of({"weapon": "blast", "at": [10 * i, 90]}) for i in range(30)))
    run(log, output)
    lines = output.read_bytes().splitlines(keepends=True)
    part = output.with_name("hits.jsonl.part")
    part.write_bytes(b"".join(lines[:13]) + lines[13][:20])
    output.unlink()
    yield folder, log, output


def test_half_a_line_is_cut_off(begun: tuple[Path, Path, Path]) -> None:
    _, log, output = begun
    done = run(log, output)
    assert (done.shots, done.resumed, done.plan.calls) == (30, 12, 2)
    again = output.with_name("again.jsonl")
    assert run(log, again).resumed == 0
    assert again.read_bytes() == output.read_bytes()
    assert not output.with_name("hits.jsonl.part").exists()


def test_half_a_line_is_cut_off_where_no_shot_is_left(begun: tuple[Path, Path, Path]) -> None:
    _, log, output = begun
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[:12]))
    assert run(log, output).resumed == 12
    lines = output.read_bytes().splitlines(keepends=True)
    assert len(lines) == 13 and lines[-1].endswith(b"}\n")


@pytest.mark.parametrize("length", [0, 1, 50, 300])
def test_half_a_first_line_is_no_part_yet(length: int, begun: tuple[Path, Path, Path]) -> None:
    _, log, output = begun
    part = output.with_name("hits.jsonl.part")
    part.write_bytes(part.read_bytes()[:length])
    assert run(log, output).resumed == 0


@pytest.mark.parametrize("damage", ["zeros", "short", "letters"])
def test_a_damaged_answer_and_what_follows_it_are_answered_again(damage: str, begun: tuple[Path, Path, Path]) -> None:
    """As a loss of power leaves a page of a file."""
    _, log, output = begun
    part = output.with_name("hits.jsonl.part")
    lines = part.read_bytes().splitlines(keepends=True)
    bad = {"zeros": lines[6][:60] + b"\0" * (len(lines[6]) - 61) + b"\n", "short": lines[6][:45] + b"\n",
           "letters": lines[6].replace(b'"rows":[', b'"rows":[x')}[damage]  # fmt: skip
    part.write_bytes(b"".join([*lines[:6], bad, *lines[7:]]))
    assert run(log, output).resumed == 5
    again = output.with_name("again.jsonl")
    assert run(log, again).resumed == 0 and again.read_bytes() == output.read_bytes()


def damaged_line(part: bytes, log: Path, output: Path, capsys: pytest.CaptureFixture[str]) -> int | None:
    """Go on with a part, to the bytes of a whole run; the line that is told to be damaged."""
    whole, path = output.read_bytes(), output.with_name("hits.jsonl.part")
    output.unlink()
    path.write_bytes(part)
    assert main(["fire", str(GALLERY), str(log), "-o", str(output)]) == 0
    assert output.read_bytes() == whole
    told = capsys.readouterr().err
    found = re.match(rf"hitplanes: {path} line (\d+) is damaged: it and what follows are answered again\n", told)
    kept = int(found[1]) - 2 if found else part.count(b"\n") - 1
    rest = told[found.end() :] if found else told
    assert rest == (f"hitplanes: {path} answers {kept} shots: going on after them\n" if kept else "")
    return int(found[1]) if found else None


@pytest.mark.parametrize("first", some_of(range(1, 10, 3)))
def test_each_byte_of_an_answer_that_was_changed_is_seen(
    first: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each ninth one, and of it another bit; not the last byte, without which the last line is one that is cut off."""
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(GOOD + line_of({"weapon": "blast", "at": [100, 167]}) + GOOD)
    run(log, output)
    whole = output.read_bytes()
    for at in [*range(whole.index(b"\n") + first, len(whole), 9), len(whole) - 1]:
        part = whole[:at] + bytes([whole[at] ^ 1 << at % 8]) + whole[at + 1 :]
        line = 1 + whole[:at].count(b"\n") if at < len(whole) - 1 else None
        assert damaged_line(part, log, output, capsys) == line, part


def test_answers_that_were_lost_doubled_or_swapped_are_seen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Even where all lines of the log are the same."""
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(GOOD * 5)
    run(log, output)
    lines = output.read_bytes().splitlines(keepends=True)
    for i in range(1, 5):
        lost, doubled = [*lines[:i], *lines[i + 1 :]], [*lines[: i + 1], *lines[i:]]
        swapped = [*lines[:i], lines[i + 1], lines[i], *lines[i + 2 :]]
        for part, line in ((lost, i + 1), (doubled, i + 2), (swapped, i + 1)):
            assert damaged_line(b"".join(part), log, output, capsys) == line


def test_crc_is_that_of_all_bytes_before_it(tmp_path: Path) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(GOOD * 3)
    run(log, output)
    whole = output.read_bytes()
    for match in re.finditer(rb',"crc":"(.{8})"}\n', whole):
        assert match[1].decode() == f"{zlib.crc32(whole[: match.start()]):08x}"
    assert whole.count(b',"crc":"') == 3


def test_a_line_changed_or_taken_out_of_the_log_is_refused(begun: tuple[Path, Path, Path]) -> None:
    _, log, output = begun
    part = output.with_name("hits.jsonl.part")
    before, lines = part.read_bytes(), log.read_bytes().splitlines(keepends=True)
    for changed, number in (
        ([*lines[:7], lines[7].replace(b"70", b"71"), *lines[8:]], 8),
        ([*lines[:3], *lines[4:]], 4),
        (lines[:10], 11),
    ):
        log.write_bytes(b"".join(changed))
        told = rf"shots.jsonl line {number} is not the one that .*hits.jsonl.part answers: remove .*.part to start anew"
        with pytest.raises(InputError, match=told):
            run(log, output)
        assert part.read_bytes() == before and not output.exists()


def rewritten(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    data = json.loads((folder / "scene.json").read_text())
    change(data)
    (folder / "scene.json").write_text(json.dumps(data))


CHANGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "scene": lambda data: data["objects"]["hittable"][0].update(position_xy=[1, 1]),
    "weapons": lambda data: data["weapons"]["blast"].update(radius=31),
    "names": lambda data: data["objects"]["movers"][0].update(name="moth"),
    "name": lambda data: data.update(name="Another"),
}


@pytest.mark.parametrize("key", CHANGES)
def test_a_part_of_another_scene_is_refused(
    key: str, begun: tuple[Path, Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, log, output = begun
    part = output.with_name("hits.jsonl.part")
    before = part.read_bytes()
    old = json.loads(before.splitlines()[0])[key]
    rewritten(folder, CHANGES[key])
    assert main(["fire", str(folder), str(log), "-o", str(output)]) == 2
    error = capsys.readouterr().err
    assert f"hits.jsonl.part: expected {key} " in error and f', got "{old}": remove it to start anew' in error
    assert part.read_bytes() == before


def test_categories_that_change_places_are_another_question(begun: tuple[Path, Path, Path]) -> None:
    """Same bits, same hash of the scene; but "accept" means others."""
    folder, log, output = begun
    text = (folder / "scene.json").read_text()
    swapped = text.replace('"target"', '"?"').replace('"bonus"', '"target"').replace('"?"', '"bonus"')
    (folder / "scene.json").write_text(swapped)
    assert load_scene(folder).content_hash() == scene.content_hash()
    with pytest.raises(InputError, match="expected names"):
        stream.fire_log(load_scene(folder), log, output, Progress(io.StringIO()))


def test_a_part_of_another_version_is_refused(begun: tuple[Path, Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    _, log, output = begun
    monkeypatch.setattr(stream, "version", lambda name: "9.9")
    with pytest.raises(InputError, match=r'expected version "9.9", got "\d'):
        run(log, output)


def test_a_part_of_an_older_format_is_refused(begun: tuple[Path, Path, Path]) -> None:
    _, log, output = begun
    part = output.with_name("hits.jsonl.part")
    before = part.read_bytes().replace(b"hitplanes-hits/3", b"hitplanes-hits/1", 1)
    part.write_bytes(before)
    told = 'hits.jsonl.part: expected format "hitplanes-hits/3", got "hitplanes-hits/1": remove it to start anew'
    with pytest.raises(InputError, match=told):
        run(log, output)
    assert part.read_bytes() == before


@pytest.mark.parametrize("content", [b"my notes\n", b'{"format": "x"}\n', b"\0" * 5000, b"[1]\n"])
def test_a_file_that_is_no_part_is_left_alone(content: bytes, begun: tuple[Path, Path, Path]) -> None:
    _, log, output = begun
    part = output.with_name("hits.jsonl.part")
    part.write_bytes(content)
    with pytest.raises(InputError, match="expected a part of hitplanes-hits/3, got something else"):
        run(log, output)
    assert part.read_bytes() == content


# Where it cannot be written


def test_places_that_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "shots.jsonl"
    log.write_bytes(GOOD)
    (tmp_path / "link.jsonl").symlink_to(log)
    (tmp_path / "folder.jsonl").mkdir()
    (tmp_path / "blocked.jsonl.part").mkdir()
    os.mkfifo(tmp_path / "pipe.jsonl")
    before = names_in(tmp_path)
    for name, told in {
        "shots.jsonl": "expected another file than the log",
        "link.jsonl": "expected another file than the log",
        "folder.jsonl": "expected the name of a file",
        "pipe.jsonl": "expected the name of a file",
        "blocked.jsonl": "blocked.jsonl.part: expected the name of a file",
        "none/hits.jsonl": "no folder",
        "scene.json": "expected a name that ends in .jsonl, got 'scene.json'",
    }.items():
        assert main(["fire", str(GALLERY), str(log), "-o", str(tmp_path / name)]) == 2, name
        error = capsys.readouterr().err
        assert told in error and error.count("\n") == 1, error
    for missing in (tmp_path / "none.jsonl", tmp_path):
        assert main(["fire", str(GALLERY), str(missing), "-o", str(tmp_path / "hits.jsonl")]) == 2
        assert f"{missing}: cannot read it" in capsys.readouterr().err
    assert names_in(tmp_path) == before and log.read_bytes() == GOOD


def test_a_log_is_not_its_own_part(tmp_path: Path) -> None:
    log = tmp_path / "hits.jsonl.part"
    log.write_bytes(GOOD)
    with pytest.raises(InputError, match="expected another file than the log"):
        run(log, tmp_path / "hits.jsonl")
    assert log.read_bytes() == GOOD


def test_a_pipe_will_do_for_a_log(tmp_path: Path) -> None:
    output = tmp_path / "hits.jsonl"
    words = [*COMMAND, str(GALLERY), "/dev/stdin", "-o", str(output)]
    done = subprocess.run(words, input=GOOD * 3000, capture_output=True, cwd=ROOT, check=True)
    assert done.stdout.decode() == f"3000 shots, 3000 hit something, in {output}\n" and not done.stderr


def test_a_full_disk_is_one_line_and_the_part_goes_on_later(tmp_path: Path) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(GOOD * 3000)
    words = [*COMMAND, str(GALLERY), str(log), "-o", str(output)]

    def small() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (120_001, 120_001))

    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}  # cut short, a .pyc would spoil the runs after this
    full = subprocess.run(
        words, capture_output=True, text=True, cwd=ROOT, check=False, preexec_fn=small, env=environment
    )
    assert full.returncode == 2
    assert full.stderr == f"hitplanes: output: cannot write {output}.part: File too large\n"
    assert (tmp_path / "hits.jsonl.part").stat().st_size == 120_001 and not output.exists()
    assert run(log, output).resumed > 1000
    lines = output.read_bytes().splitlines()
    assert len(lines) == 3001 and len({line.split(b'"of"')[1].split(b'"crc"')[0] for line in lines[1:]}) == 1


def test_two_processes_do_not_write_one_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    os.mkfifo(log)
    first = subprocess.Popen([*COMMAND, str(GALLERY), str(log), "-o", str(output)], cwd=ROOT)
    with log.open("wb") as pipe:
        pipe.write(GOOD)
        until(lambda: (tmp_path / "hits.jsonl.part").exists() and (tmp_path / "hits.jsonl.part").stat().st_size > 0)
        other = tmp_path / "other.jsonl"
        other.write_bytes(GOOD * 2)
        assert main(["fire", str(GALLERY), str(other), "-o", str(output)]) == 2
        assert "hits.jsonl.part: another process is writing it" in capsys.readouterr().err
    assert first.wait(20) == 0
    assert len(output.read_bytes().splitlines()) == 2


def test_a_part_that_was_renamed_meanwhile_is_not_written_to(
    begun: tuple[Path, Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, log, output = begun
    part = output.with_name("hits.jsonl.part")
    before = part.read_bytes()
    monkeypatch.setattr("hitplanes.weapons.replay.stream.fcntl.flock", lambda file, how: part.rename(output))
    with pytest.raises(InputError, match="another process is writing it"):
        run(log, output)
    assert output.read_bytes() == before


# Killed, interrupted, gone on with


def until(condition: Callable[[], bool], seconds: float = 20) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came to pass"
        time.sleep(0.002)


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """A log that takes a second or so, and what it answers when nothing interrupts it."""
    folder = tmp_path_factory.mktemp("long")
    log, output = folder / "shots.jsonl", folder / "hits.jsonl"
    names = ["point", "blast", "shotgun", "blast"]
    shots = ({"weapon": names[i % 4], "at": [i * 7 % 480, i * 3 % 270], "seed": i} for i in range(16_000))
    log.write_bytes(b"".join(map(line_of, shots)))
    run(log, output)
    return log, output.read_bytes()


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_run_cut_short_goes_on_to_the_same_bytes(
    sign: signal.Signals, long_log: tuple[Path, bytes], tmp_path: Path
) -> None:
    log, whole = long_log
    output, part = tmp_path / "hits.jsonl", tmp_path / "hits.jsonl.part"
    output.write_bytes(b"an older result\n")
    words = [*COMMAND, str(GALLERY), str(log), "-o", str(output)]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it would be ignored
    process = subprocess.Popen(words, cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, before)
    until(lambda: part.exists() and part.stat().st_size > 50_000)
    process.send_signal(sign)
    told = process.communicate(timeout=20)
    assert process.returncode == (130 if sign == signal.SIGINT else -sign) and not told[0]
    if sign == signal.SIGINT:
        assert told[1] == f"hitplanes: interrupted: {part} is kept, and the same command goes on with it\n"
    assert output.read_bytes() == b"an older result\n"
    kept = part.read_bytes()
    assert whole.startswith(kept) and len(kept) < len(whole)
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
    answered = kept.count(b"\n") - 1
    assert done.stderr == f"hitplanes: {part} answers {answered} shots: going on after them\n" and answered > 100
    assert output.read_bytes() == whole
    hit = sum(b'"rows":[]' not in line for line in whole.splitlines()[1:])
    assert done.stdout == f"16000 shots, {hit} hit something, in {output}\n"
    assert names_in(tmp_path) == ["hits.jsonl"]


# What is shown


def test_progress_is_one_line_on_a_terminal_and_cleared(long_log: tuple[Path, bytes], tmp_path: Path) -> None:
    master, slave = pty.openpty()
    words = [*COMMAND, str(GALLERY), str(long_log[0]), "-o", str(tmp_path / "hits.jsonl")]
    process = subprocess.Popen(words, cwd=ROOT, stderr=slave, stdout=subprocess.DEVNULL)
    os.close(slave)
    until((tmp_path / "hits.jsonl.part").exists)
    process.send_signal(signal.SIGSTOP)  # a fast machine is through before the line is drawn once
    time.sleep(2 * stream.SECONDS)
    process.send_signal(signal.SIGCONT)
    shown = b""
    while True:
        try:
            shown += os.read(master, 4096)
        except OSError:
            break
    os.close(master)
    assert process.wait() == 0 and b"\n" not in shown
    drawn = shown.decode().split("\r")
    assert drawn[0] == "" and drawn[-1] == "" and drawn[-2].strip() == ""
    assert 1 <= len(drawn) - 3 <= 25
    assert all(" shots, " in text and " %, " in text and text.rstrip().endswith(" left") for text in drawn[1:-2])


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_is_drawn_a_few_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("hitplanes.weapons.replay.stream.time.monotonic", lambda: now[0])
    monkeypatch.setenv("COLUMNS", "60")
    terminal, plain = Terminal(), io.StringIO()
    for out in (terminal, plain):
        progress = Progress(out)
        progress.begin(10_000, 1000, 1000)
        for step in range(1, 101):
            now[0] += 0.01
            progress.show(1000 + 20 * step, 1000 + 20 * step)
        progress.clear()
    drawn = terminal.getvalue().split("\r")
    assert plain.getvalue() == ""
    assert 4 <= len(drawn) - 3 <= 5
    assert drawn[-3] in ("3,000 shots, 30 %, 2,000/s, 0:00:04 left", "2,980 shots, 29 %, 2,000/s, 0:00:04 left")
    assert drawn[-2].strip() == "" and len(drawn[-2]) == len(drawn[-3])
    progress = Progress(terminal)
    progress.begin(0, 0, 0)
    now[0] += 1
    progress.show(5, 99)
    assert terminal.getvalue().endswith("\r5 shots, 5/s")


def test_no_one_has_to_read_what_is_said(tmp_path: Path) -> None:
    log, output = tmp_path / "shots.jsonl", tmp_path / "hits.jsonl"
    log.write_bytes(GOOD * 3)
    assert run(log, output).shots == 3
    part = output.with_name("hits.jsonl.part")
    part.write_bytes(b"".join(output.read_bytes().splitlines(keepends=True)[:2]))
    whole = output.read_bytes()
    output.unlink()
    read, write = os.pipe()
    os.close(read)
    subprocess.run([*COMMAND, str(GALLERY), str(log), "-o", str(output)], cwd=ROOT, check=False, stderr=write)
    os.close(write)
    assert output.read_bytes() == whole and not part.exists()


def test_the_plan_is_added_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "shots.jsonl"
    shots: list[Any] = [{"weapon": "point", "at": [62, 86]}, {"weapon": "blast", "at": [62, 86]}] * 3
    shots += [{"weapon": {"kind": "laser", "range": 90}, "at": [62, 86]}]
    log.write_bytes(b"".join(map(line_of, shots)))
    assert main(["fire", str(GALLERY), str(log), "-o", str(tmp_path / "hits.jsonl"), "--plan"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^  weights +[\d,]+\.\d us +[\d,]+  1 of 3 calls: falloff of the hit pixels, ", out, re.M)
    assert re.search(r"^  stack +[\d,]+\.\d us +[\d,]+  3 of 3 calls: \d+ items, ", out, re.M)
    assert re.search(r"^  weights +left out +2 of 3 calls: the weapon has no falloff$", out, re.M)
    assert re.search(r"^  all +[\d,]+\.\d us +[\d,]+  3 calls$", out, re.M)
    assert re.search(r"^  verdicts +[\d,]+\.\d us +[\d,]+  2 of 3 calls: counted for the answers$", out, re.M)
    assert re.search(r"^  passes +[\d,]+\.\d us +[\d,]+  1 of 3 calls: told for the answers, as", out, re.M)
    assert re.search(r"^  verdicts +left out +1 of 3 calls: counted when asked for$", out, re.M)
