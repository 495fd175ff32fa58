"""The command, as its user runs it."""

from __future__ import annotations

import itertools
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import cv2
import jsonschema
import numpy as np
import pytest
from some_of import some_of
from test_record import lines_of, write_record

from hitplanes import (
    Disc,
    Rifle,
    Scene,
    ShotRecord,
    Spread,
    Sprite,
    fire_shots,
    load_scene,
    picture_of_report,
    read_png,
    report_of,
    write_png,
)
from hitplanes.weapons.cli import starter
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.replay.record import hash_of
from hitplanes.weapons.replay.stream import Progress

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "fixtures" / "gallery"


def test_report_writes_picture_and_facts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    png, facts = tmp_path / "r.png", tmp_path / "r.json"
    assert main(["report", str(GALLERY), "-o", str(png), "--json", str(facts)]) == 0
    picture = cv2.imread(str(png))
    assert picture.shape[1] > 1000 and picture.std() > 20
    report = json.loads(facts.read_text())
    assert [shot["weapon"] for shot in report["shots"]][:2] == ["point", "shotgun"]
    assert "bullseye 1 px" in capsys.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.json", "r.png"]


def test_facts_go_to_standard_output_and_what_is_said_goes_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(GALLERY), "--json", "facts.json"]) == 0
    said = capsys.readouterr().out
    assert main(["report", str(GALLERY), "--json", "-"]) == 0
    out, err = capsys.readouterr()
    facts = json.loads(out), json.loads((tmp_path / "facts.json").read_text())
    assert [[shot["rows"] for shot in one["shots"]] for one in facts] == [
        [shot["rows"] for shot in facts[0]["shots"]]
    ] * 2
    assert err == said and sorted(path.name for path in tmp_path.iterdir()) == ["facts.json", "report.png"]


def test_one_shot_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    png, facts = tmp_path / "r.png", tmp_path / "r.json"
    words = ["report", str(GALLERY), "--weapon", "beam", "--at", "126,167", "--aim", "1", "--seed", "4"]
    assert main([*words, "-o", str(png), "--json", str(facts)]) == 0
    (shot,) = json.loads(facts.read_text())["shots"]
    assert shot["aim"] == 1 and shot["seed"] == 4
    assert [row["name"] for row in shot["rows"]] == ["duck 1", "duck 2", "duck 3"]


def test_a_line_of_sight_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    facts = tmp_path / "r.json"
    words = ["report", str(ROOT / "fixtures" / "corridor"), "--weapon", "sight", "--at", "330,194"]
    assert main([*words, "--toward", "400,194", "-o", str(tmp_path / "r.png"), "--json", str(facts)]) == 0
    (ray,) = json.loads(facts.read_text())["shots"][0]["rays"]
    assert ray["end"] == [400, 194] and ray["stop"]["item"]["name"] == "crate 1"
    assert main([*words, "-o", str(tmp_path / "r.png")]) == 2
    assert "toward: expected a point, as the weapon has no range" in capsys.readouterr().err


def test_a_negative_position_is_written_with_an_equals_sign(tmp_path: Path) -> None:
    facts = tmp_path / "r.json"
    words = ["report", str(GALLERY), "--weapon", "point", "--at=-5,3", "-o", str(tmp_path / "r.png")]
    assert main([*words, "--json", str(facts)]) == 0
    (shot,) = json.loads(facts.read_text())["shots"]
    assert shot["at_xy"] == [-5, 3] and shot["verdicts"]["outside"] == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["report", "nowhere"], "nowhere/scene.json: cannot read it"),
        (["report", str(GALLERY), "--weapon", "bean", "--at", "1,2"], "did you mean 'beam'?"),
        (["report", str(GALLERY), "--weapon", "beam"], "--at: expected X,Y"),
        (
            ["report", str(GALLERY), "--weapon", "beam", "--at", "1,2", "--toward", "a,b"],
            "--toward: expected two numbers",
        ),
        (["report", str(GALLERY), "--weapon", "beam", "--at", "5"], "--at: expected two numbers X,Y, got '5'"),
        (["report", str(GALLERY), "--weapon", "beam", "--at", "1,2,3"], "--at: expected two numbers X,Y, got '1,2,3'"),
        (["report", str(GALLERY), "--weapon", "beam", "--at", "1;2"], "--at: expected two numbers X,Y, got '1;2'"),
        (["report", str(GALLERY), "--weapon", "beam", "--at", "1,nan"], "at[1]: expected a finite number"),
        (["report", str(GALLERY), "--weapon", "beam", "--at", "1,2", "--aim", "inf"], "aim: expected a finite number"),
        (["report", str(GALLERY), "--weapon", "beam", "--at", "1,2", "--seed", "-1"], "seed: expected a whole number"),
        (["report", str(GALLERY), "--at", "1,2"], "--at: expected only together with --weapon"),
        (["report", str(GALLERY), "--shots", "none.jsonl"], "none.jsonl: cannot read it: No such file"),
        (["report", str(GALLERY), "--shots", "x", "--at", "1,2"], "--at: expected without --shots, got both"),
        (
            ["report", str(GALLERY), "--shots", "x", "--json", "x"],
            "output: expected another file than the log of shots",
        ),
        (["report", str(GALLERY), "-o", "/no/such/folder/r.png"], "cannot write /no/such/folder/r.png"),
        (["report", str(GALLERY), "-o", "/"], "output: cannot write /: expected the name of a file"),
        (["report", str(GALLERY), "--json", "."], "output: cannot write .: expected the name of a file"),
        (["report", str(GALLERY), "--json", "/no/such/r.json"], "cannot write /no/such/r.json"),
        (["report", str(GALLERY), "-o", "a.png", "--json", "a.png"], "--json: expected another file"),
        (["report", str(GALLERY), "-o", "a.jpg"], "--output: expected a name that ends in .png"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_what_is_no_file_is_never_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.png"
    os.mkfifo(pipe)
    assert main(["report", str(GALLERY), "-o", str(pipe)]) == 2
    assert pipe.is_fifo() and sorted(tmp_path.iterdir()) == [pipe]


def test_an_interrupt_is_one_line_and_leaves_the_old_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    png = tmp_path / "r.png"
    assert main(["report", str(GALLERY), "-o", str(png)]) == 0
    before = png.read_bytes()

    def interrupted(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hitplanes.weapons.cli.command.picture_of_report", interrupted)
    capsys.readouterr()
    assert main(["report", str(GALLERY), "-o", str(png)]) == 130
    assert capsys.readouterr().err == "hitplanes: interrupted\n"
    assert png.read_bytes() == before and list(tmp_path.iterdir()) == [png]


RUN = [sys.executable, "-W", "error", "-m", "hitplanes"]


@pytest.mark.parametrize("word", ["report", "fire", "new", "compare", "replay", "demo"])
def test_help_shows_examples(word: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as ended:
        main([word, "--help"])
    shown, code = capsys.readouterr().out, ended.value.code
    assert code == 0
    examples = shown.split("examples:\n")[1].splitlines()
    assert any(line.startswith(f"  hitplanes {word} ") for line in examples)
    assert all(len(line) <= 120 for line in shown.splitlines())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["rapport"], "argument COMMAND: invalid choice: 'rapport' (choose from "),
        ([], "the following arguments are required: COMMAND (see hitplanes --help)"),
        (["report"], "the following arguments are required: SCENE (see hitplanes report --help)"),
        (["report", "x", "--aim", "left"], "argument --aim: invalid float value: 'left'"),
        (["fire", "x"], "the following arguments are required: SHOTS.jsonl"),
        (["replay", "x"], "the following arguments are required: RECORD.jsonl (see hitplanes replay --help)"),
        (["new", "a", "b\nc"], "unrecognized arguments: b c"),
        (["demo", "octree"], "argument KIND: invalid choice: 'octree' (choose from "),
    ],
)
def test_bad_words_are_one_line_and_exit_2(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    error = capsys.readouterr().err
    assert ended.value.code == 2
    assert error.startswith("hitplanes: ") and told in error and error.count("\n") == 1


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0 and re.fullmatch(r"hitplanes \d+\.\d+\.\d+\n", capsys.readouterr().out)


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    png = tmp_path / "r.png"
    read, write = os.pipe()
    os.close(read)
    env = {**os.environ, "PYTHONUNBUFFERED": ""}
    done = subprocess.run(
        [*RUN, "report", str(GALLERY), "-o", str(png)], check=False, stdout=write, stderr=subprocess.PIPE, env=env
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"") and png.exists()


def test_a_log_of_shots_is_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """More than 24 of them as a heat picture; a bad line is named, and so is a log that is too long."""
    log, facts, png = tmp_path / "shots.jsonl", tmp_path / "r.json", tmp_path / "r.png"
    words = ["report", str(GALLERY), "--shots", str(log), "-o", str(png), "--json", str(facts)]
    shots = [{"weapon": "shotgun", "at": [3 * i, 90], "seed": i} for i in range(40)]
    for count in (2, 40):
        scene = load_scene(GALLERY)
        scene.shots = shots[:count]
        log.write_text("".join(json.dumps(shot) + "\n" for shot in scene.shots))
        assert main(words) == 0
        fired = report_of(scene, fire_shots(scene), ["shotgun"] * count)
        assert json.loads(facts.read_text()) == json.loads(json.dumps(fired))
        assert np.array_equal(read_png(png)[:, :, :3], picture_of_report(fired, scene))
    assert capsys.readouterr().out.splitlines()[-1].startswith("40 shots, ")
    monkeypatch.setattr("hitplanes.weapons.replay.shot_log.REPORTED_MAX", 39)
    assert main(words) == 2
    assert f"{log}: expected at most 39 shots for one picture, got more" in capsys.readouterr().err
    log.write_text('{"weapon": "shotgun", "at": [1, 2]}\n{"weapon": "shotgn", "at": [1, 2]}\n')
    before = facts.read_bytes()
    assert main(words) == 2 and facts.read_bytes() == before
    assert re.search(r"shots.jsonl line 2: weapon: .* .did you mean 'shotgun'", capsys.readouterr().err)


def test_the_plan_of_each_shot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["report", str(GALLERY), "--weapon", "blast", "--at", "390,110", "-o", str(tmp_path / "r.png")]
    assert main(words) == 0
    without = capsys.readouterr().out
    assert main([*words, "--plan"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(without) and without.count("\n") == 1
    assert shown.removeprefix(without).splitlines()[0].split() == ["stage", "time", "bytes", "why"]
    assert re.search(
        r"^  weights +[\d,]+\.\d us +[\d,]+  falloff of the hit pixels, by the binary digits of their weights$",
        shown,
        re.M,
    )
    assert re.search(r"^  hud +left out +drawn only for a picture$", shown, re.M)


# new


def test_new_makes_a_scene_that_reports_hits_occluded_and_missed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "my range"]) == 0
    told = capsys.readouterr().out
    assert told == "a scene is in my range; now try: hitplanes report 'my range'\n"
    assert main([*shlex.split(told.split(": hitplanes ")[1]), "--json", "r.json"]) == 0
    shotgun, blast, pistol = json.loads(Path("r.json").read_text())["shots"]
    assert [row["name"] for row in shotgun["rows"]] == ["bullseye"] and shotgun["verdicts"]["occluded"] > 20
    assert [row["name"] for row in blast["rows"]] == ["balloon"]
    assert not pistol["rows"] and pistol["why_not"][0]["reason"] == "missed"
    files = {path.name: path.stat().st_size for path in Path("my range").iterdir()}
    assert len(files) == 8 and sum(files.values()) < 70_000
    schema = json.loads((Path("my range") / "scene.schema.json").read_text())
    jsonschema.validate(json.loads((Path("my range") / "scene.json").read_text()), schema)
    assert cv2.imread("report.png").std() > 20
    Path("shots.jsonl").write_text('{"weapon": "point", "at": [88, 60]}\n')
    assert main(["fire", "my range", "shots.jsonl"]) == 0
    assert capsys.readouterr().out.endswith("1 shot, 1 hit something, in hits.jsonl\n")


def sprite_png(path: Path, rows: list[str], alpha: dict[str, int]) -> Path:
    """A PNG of one colour with these alphas."""
    pixels = np.array([[(200, 90, 40, alpha[letter]) for letter in row] for row in rows], np.uint8)
    write_png(path, pixels)
    return path


def test_new_makes_a_scene_of_a_sprite(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its opaque pixels are an object; the shot is at the one that is nearest to the middle."""
    monkeypatch.chdir(tmp_path)
    rows = ["..#####...", ".#.....#..", ".#..o..#..", "..#####..."]
    given = sprite_png(tmp_path / "my tank.png", rows, {".": 0, "o": 127, "#": 128})
    assert main(["new", "tank", "--from-image", str(given)]) == 0
    assert capsys.readouterr().out == "a scene is in tank; now try: hitplanes report tank\n"
    assert sorted(path.name for path in Path("tank").iterdir()) == ["my tank.png", "scene.json", "scene.schema.json"]
    schema = json.loads(Path("tank/scene.schema.json").read_text())
    jsonschema.validate(json.loads(Path("tank/scene.json").read_text()), schema)
    scene = load_scene("tank")
    assert (scene.name, scene.bounds, scene.ids().tolist()) == ("my tank", (0, 0, 9, 3), [0])
    mask, corner = scene.mask(scene.find("my tank"))
    assert corner == (1, 0) and ["".join(".#"[v] for v in row) for row in mask.tolist()] == [
        row.replace("o", ".")[1:8] for row in rows
    ]
    assert (read_png("tank/my tank.png") == read_png(given)).all()
    assert main(["report", "tank", "--json", "r.json"]) == 0
    (shot,) = json.loads(Path("r.json").read_text())["shots"]
    assert shot["at"] == [4, 0], "of the nearest to the middle at (4.5, 1.5) the first"
    assert [(row["name"], row["pixels"]) for row in shot["rows"]] == [("my tank", 3)]


def test_new_makes_a_scene_of_a_screenshot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the background, and a target stands in its middle."""
    monkeypatch.chdir(tmp_path)
    given = sprite_png(tmp_path / "level.png", ["#" * 40] * 32, {"#": 128})
    assert main(["new", "level", "--from-image", "level.png"]) == 0
    scene = load_scene("level")
    assert scene.bounds == (0, 0, 39, 31) and scene.role([0, 1]).tolist() == ["background", "hittable"]
    assert (read_png("level/level.png") == read_png(given)).all() and scene.position(1).tolist() == [19.5, 15.5]
    assert scene.box(0).tolist() == [0, 0, 39, 31] and scene.name_of(1) == "target"
    assert main(["report", "level", "--json", "r.json"]) == 0
    (shot,) = json.loads(Path("r.json").read_text())["shots"]
    assert [row["name"] for row in shot["rows"]] == ["target"] and shot["verdicts"]["empty"] > 20


@pytest.mark.parametrize("rows", [["#"], ["#."], [".", "#"]], ids=repr)
def test_the_smallest_pictures(tmp_path: Path, rows: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sprite_png(Path("a.png"), rows, {".": 0, "#": 255})
    assert main(["new", "a", "--from-image", "a.png"]) == 0
    assert main(["report", "a", "--json", "r.json"]) == 0
    (shot,) = json.loads(Path("r.json").read_text())["shots"]
    assert len(shot["rows"]) == 1


@pytest.mark.parametrize("name", ["con.png", "a\\b.png", "scene.json", "x" * 197 + ".png", "\u202e.png", "noending"])
def test_any_name_of_a_picture_makes_a_scene(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sprite_png(Path("a.png"), ["#."], {".": 0, "#": 255}).rename(name)
    assert main(["new", "a", "--from-image", name]) == 0
    (image,) = Path("a").glob("*.png")
    odd = name in ("con.png", "a\\b.png") or len(name) > 200
    assert image.stem == load_scene("a").name == ("picture" if odd else Path(name).stem)


def test_a_bad_picture_makes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.png").write_text("no picture")
    sprite_png(Path("cut.png"), ["#." * 40] * 9, {".": 0, "#": 255})
    Path("cut.png").write_bytes(Path("cut.png").read_bytes()[:-30])
    sprite_png(Path("clear.png"), ["o."], {".": 0, "o": 127})
    sprite_png(Path("good.png"), ["#."], {".": 0, "#": 255})
    Path("full").mkdir()
    Path("full/mine.txt").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    for folder, picture, told in (
        ("new", "none.png", "--from-image: "),
        ("new", "full", "--from-image: "),
        ("new", "text.png", "--from-image: 'text.png': "),
        ("new", "cut.png", "--from-image: 'cut.png': "),
        ("new", "clear.png", "--from-image: expected a picture with a pixel of alpha over 127, got alpha up to 127"),
        ("full", "good.png", "folder: expected a new or empty folder"),
    ):
        assert main(["new", folder, "--from-image", picture]) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"hitplanes: {told}") and error.count("\n") == 1, error
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("where", ["write_png", "write_text"])
def test_an_interrupted_new_of_a_picture_leaves_nothing(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, write = sprite_png(tmp_path / "good.png", ["#."], {".": 0, "#": 255}), getattr(starter, where)

    def interrupted(path: Path, data: object) -> None:
        write(path, data)
        raise KeyboardInterrupt

    monkeypatch.setattr(starter, where, interrupted)
    assert main(["new", str(tmp_path / "new"), "--from-image", str(given)]) == 130
    assert list(tmp_path.rglob("*")) == [given]


def test_new_writes_into_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "."]) == 0
    assert len(load_scene(tmp_path)) == 6


def test_new_overwrites_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    full, file, closed = tmp_path / "full", tmp_path / "file", tmp_path / "no" / "such"
    full.mkdir()
    (full / "mine.txt").write_text("mine")
    file.write_text("mine")
    for place, told in (
        (full, "expected a new or empty folder, got"),
        (file, "expected a new folder, got the file"),
        (closed, "folder: cannot make"),
    ):
        assert main(["new", str(place)]) == 2
        error = capsys.readouterr().err
        assert told in error and error.count("\n") == 1
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "full", "mine.txt"]


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("where", ["write_bytes", "write_text"])
def test_an_interrupted_new_leaves_nothing(
    there: bool, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "range"
    if there:
        folder.mkdir()
    write = getattr(starter, where)

    def interrupted(path: Path, data: object) -> None:
        write(path, data)
        if path.name in ("crate.png", "scene.json"):
            raise KeyboardInterrupt

    monkeypatch.setattr(starter, where, interrupted)
    assert main(["new", str(folder)]) == 130
    assert capsys.readouterr().err == "hitplanes: interrupted\n"
    assert list(tmp_path.rglob("*")) == ([folder] if there else [])


def test_the_scene_comes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed at any time, it leaves nothing that loads, or all."""
    written = []
    for name in ("write_bytes", "write_text"):
        monkeypatch.setattr(starter, name, lambda path, data: written.append(path.name))
    starter.write_starter(tmp_path / "range")
    assert written[-1] == "scene.json" and len(written) == 8


def test_a_report_is_never_written_over_the_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "range"]) == 0
    (tmp_path / "link.png").symlink_to(tmp_path / "range" / "crate.png")
    before = {path: path.read_bytes() for path in (tmp_path / "range").iterdir()}
    for words in (["--json", "range/scene.json"], ["-o", "range/crate.png"], ["-o", "link.png"]):
        for scene in ("range", "range/scene.json"):
            assert main(["report", scene, *words]) == 2
            assert "output: expected another file than those of the scene" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (tmp_path / "range").iterdir()} == before
    assert main(["report", "range", "-o", "range/mine.png"]) == 0


def test_an_object_without_a_pixel_is_noted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    objects = {"hittable": [{"name": "ghost", "mask": ["..", ".."], "position_xy": [5, 5]}]}
    (tmp_path / "scene.json").write_text(json.dumps({"format": "hitplanes-scene/2", "objects": objects}))
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "r.png")]) == 0
    assert "note: ghost has no pixel: nothing hits it" in capsys.readouterr().out


def test_shots_that_do_not_fit_the_picture_are_noted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = Scene((3000, 100))
    scene.shots = [{"weapon": {"kind": "disc", "radius": 4}, "at": [x, 50]} for x in (10, 2900)]
    scene.save(tmp_path)
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "r.png")]) == 0
    note = "note: 1 of 2 shots does not fit this picture (x 0..2048, y 0..99): report it alone"
    assert note in capsys.readouterr().out


def test_a_closed_output_is_no_traceback(tmp_path: Path) -> None:
    run = f"exec {shlex.quote(sys.executable)} -m hitplanes new {shlex.quote(str(tmp_path / 'range'))} >&-"
    done = subprocess.run(["sh", "-c", run], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "") and (tmp_path / "range" / "scene.json").exists()


def test_a_value_that_begins_with_a_minus_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["report", str(GALLERY), "--weapon", "point", "--at", "-5,3"])
    assert "one that begins with a minus is written --at=-5,3" in capsys.readouterr().err


def test_weapons_and_shots_of_a_file_are_named_with_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = {"format": "hitplanes-scene/2", "weapons": {"gun": {"kind": "disc", "radius": -1}}, "shots": []}
    (tmp_path / "scene.json").write_text(json.dumps(data))
    for scene in (tmp_path, tmp_path / "scene.json"):
        assert main(["report", str(scene), "-o", str(tmp_path / "r.png")]) == 2
        told = capsys.readouterr().err
        assert told.startswith(f"hitplanes: {tmp_path / 'scene.json'}: weapons.gun: radius: expected a number from 0")
    data |= {"weapons": {"gun": {"kind": "point"}}, "shots": [{"weapon": "gun", "at": [1]}]}
    (tmp_path / "scene.json").write_text(json.dumps(data))
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "r.png")]) == 2
    assert f"{tmp_path / 'scene.json'}: shots[0]: at: expected shape (2,)" in capsys.readouterr().err


def test_many_shots_of_a_file_are_told_as_a_batch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", str(tmp_path / "range")]) == 0
    path = tmp_path / "range" / "scene.json"
    data = json.loads(path.read_text())
    data["shots"] = [{"weapon": "point", "at": [70 + i, 60]} for i in range(30)]
    path.write_text(json.dumps(data))
    capsys.readouterr()
    assert main(["report", str(tmp_path / "range"), "-o", str(tmp_path / "r.png"), "--plan"]) == 0
    told = capsys.readouterr().out
    assert re.match(r"30 shots, \d+ hit something\n", told) and re.search(
        r"^  weights +left out +30 of 30 calls: the weapon has no falloff$", told, re.M
    )


# replay


@pytest.fixture
def match(tmp_path: Path) -> Path:
    """A record of shots at the gallery."""
    path, scene = tmp_path / "match.jsonl", load_scene(GALLERY)
    with ShotRecord(path) as record:
        record.fire(scene, Rifle(400, max_hits=2), [(100, 167), (100, 90)], aim=1)
        record.fire(scene, Spread(Disc(3), 9, 20), (160, 165), seed=7)
    return path


def test_replay_says_that_all_is_the_same(match: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for scene in (GALLERY, GALLERY / "scene.json"):
        assert main(["replay", str(scene), str(match)]) == 0
        told = capsys.readouterr()
        assert (told.out, told.err) == ("all shots do the same again\n", "")


def test_replay_tells_the_first_that_differs(match: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = lines_of(match)
    lines[2]["result"]["stops"][0].update(reason=0, item=-1, distance=400)
    lines[2]["result"]["rows"].append({**lines[1]["result"]["rows"][0], "object": 15})
    lines[2]["hash"] = hash_of(lines[2]["result"])
    write_record(match, lines)
    assert main(["replay", str(GALLERY), str(match)]) == 1
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"{match} line 3, shot 1: object 15 'can 5': is gone"
    assert re.fullmatch(rf"{match} line 3, shot 1: ray: stopped by .* px, was by its range at 400.0 px", second)
    assert main(["new", str(tmp_path / "range")]) == 0
    capsys.readouterr()
    assert main(["replay", str(tmp_path / "range"), str(match)]) == 1
    told = capsys.readouterr().out
    assert re.fullmatch(rf"({match} line 2, shot 0: .*\n)+", told) and "scene: its content hash is" in told


def test_replay_says_of_all_shots_that_they_do_the_same_at_another_scene(
    match: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = load_scene(GALLERY)
    scene.add(Sprite.circle(1), (470, 10), name="far away")
    scene.save(tmp_path / "other")
    assert main(["replay", str(tmp_path / "other"), str(match)]) == 1
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{match} line 2, shot 0: scene: its content hash is ")
    assert second == "all shots do the same again"
    with pytest.raises(SystemExit):
        main(["replay", "--help"])
    assert "1 a result or the content of the scene differs" in capsys.readouterr().out


def test_replay_tells_of_a_record_without_an_end(match: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = match.read_bytes().splitlines(keepends=True)
    for kept in (1, 3, 4):
        match.write_bytes(b"".join(lines[:kept]))
        assert main(["replay", str(GALLERY), str(match)]) == 0
        told = f"note: {match} has no end: it was not closed, as after a crash, and may lack shots"
        assert capsys.readouterr() == (f"all shots do the same again\n{told}\n", "")


def test_replay_names_what_is_no_record(match: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = match.read_bytes().splitlines(keepends=True)
    empty, cut, other, lost = (tmp_path / f"{name}.jsonl" for name in ("empty", "cut", "other", "lost"))
    empty.touch()
    lost.write_bytes(b"".join([*lines[:2], *lines[3:]]))
    cut.write_bytes(b"".join(lines[:2]) + lines[2][:80])
    other.write_bytes(b'{"format": "hitplanes-hits/1"}\n')
    for scene, path, told in (
        (GALLERY, empty, f"{empty} line 1: expected a whole line of a record, got an empty file"),
        (GALLERY, cut, f"{cut} line 3: expected a whole line of a record, got one that is cut off, as by a crash"),
        (GALLERY, other, f"{other} line 1: format: expected 'hitplanes-shots/3', got 'hitplanes-hits/1'"),
        (GALLERY, lost, f"{lost} line 3: chain: expected '"),
        (GALLERY, tmp_path, f"{tmp_path}: cannot read it: Is a directory"),
        (GALLERY, tmp_path / "none", f"{tmp_path / 'none'}: cannot read it: No such file"),
        (tmp_path, match, f"{tmp_path / 'scene.json'}: cannot read it"),
    ):
        assert main(["replay", str(scene), str(path)]) == 2
        error = capsys.readouterr()
        assert error.err.startswith(f"hitplanes: {told}") and error.err.count("\n") == 1 and not error.out


def test_examples_of_fire_and_replay_run(
    match: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("fixtures").symlink_to(ROOT / "fixtures")
    Path("shots.jsonl").write_text('{"weapon": "point", "at": [62, 86]}\n' * 3)
    ran = 0
    for word in ("fire", "replay"):
        with pytest.raises(SystemExit):
            main([word, "--help"])
        for line in capsys.readouterr().out.split("examples:\n")[1].splitlines():
            if line.startswith("  hitplanes "):
                assert main(shlex.split(line)[1:]) == 0, line
                ran += 1
    assert ran == 3


# Streams, places and interrupts


COMMANDS: dict[str, tuple[int, list[str]]] = {
    "fire": (0, ["fire", str(GALLERY), "shots.jsonl", "-o", "{}.jsonl", "--plan"]),
    "fire, a bad line": (2, ["fire", str(GALLERY), "bad.jsonl", "-o", "{}.jsonl"]),
    "no such scene": (2, ["report", "nowhere", "-o", "{}.png"]),
    "no such word": (2, ["rapport"]),
    "compare, the same": (0, ["compare", "a.json", "a.json"]),
    "compare, other": (1, ["compare", "a.json", "b.json"]),
    "help": (0, ["fire", "--help"]),
    "version": (0, ["--version"]),
}
STREAMS = ("read", "closed", "full", "gone")
BOTH_READ = ("read", "read")
PAIRS = [("full", "read"), ("gone", "read"), ("read", "full"), ("closed", "closed"), ("gone", "gone")]
"""By default each command meets half of them, and in the long run all that there are."""
ALL_PAIRS = [pair for pair in itertools.product(STREAMS, STREAMS) if pair != BOTH_READ]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs and reports to try the command on."""
    folder = tmp_path_factory.mktemp("place")
    good = '{"weapon": "point", "at": [62, 86]}\n' * 3
    (folder / "shots.jsonl").write_text(good)
    (folder / "bad.jsonl").write_text(good + "no\n")
    for name, at in (("a", "62,86"), ("b", "1,1")):
        words = ["report", str(GALLERY), "--weapon", "point", "--at", at, "--json", str(folder / f"{name}.json")]
        assert main([*words, "-o", str(folder / "r.png")]) == 0
    return folder


def started(words: list[str], place: Path, out: str, err: str, unbuffered: bool) -> subprocess.Popen[str]:
    """The command, its outputs read, closed, on a full device, or into a pipe that no one reads."""
    reader, gone = os.pipe()
    os.close(reader)
    full = os.open("/dev/full", os.O_WRONLY)
    ends = {"read": subprocess.PIPE, "closed": subprocess.PIPE, "full": full, "gone": gone}
    shut = " ".join(f"{number}>&-" for number, end in ((1, out), (2, err)) if end == "closed")
    line = f"exec {shlex.join([*RUN, *words])} {shut}"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1" if unbuffered else ""}
    run = subprocess.Popen(["sh", "-c", line], cwd=place, stdout=ends[out], stderr=ends[err], text=True, env=env)
    os.close(gone)
    os.close(full)
    return run


@pytest.mark.parametrize("others", [False, pytest.param(True, marks=pytest.mark.long)], ids=["some", "others"])
@pytest.mark.parametrize("name", some_of(COMMANDS, 2))
def test_exit_codes_hold_whatever_becomes_of_the_outputs(name: str, others: bool, place: Path) -> None:
    code, words = COMMANDS[name]
    some = PAIRS[list(COMMANDS).index(name) % 2 :: 2]
    pairs = [BOTH_READ, *([pair for pair in ALL_PAIRS if pair not in some] if others else some)]
    runs = {}
    for out, err in pairs:
        mine = [word.format(f"{out} {err} {others}") for word in words]
        runs[out, err] = started(mine, place, out, err, unbuffered=err == "full")
    read = {pair: run.communicate() for pair, run in runs.items()}
    for (out, err), run in runs.items():
        printed, told = read[out, err]
        expected = 2 if out == "full" and code < 2 else code
        assert run.returncode == expected, (out, err, told)
        assert (told or "").count("\n") == (1 if expected == 2 and err == "read" else 0), (out, err, told)
        if name == "fire":
            assert (place / f"{out} {err} {others}.jsonl").read_bytes() == (
                place / f"read read {others}.jsonl"
            ).read_bytes()
            assert out != "read" or printed.startswith("3 shots, 3 hit something")


def test_no_file_takes_the_place_of_a_closed_output(tmp_path: Path) -> None:
    streams = "from hitplanes.weapons.cli.command import open_streams; open_streams()"
    code = f"import os; {streams}; print(os.open('x', os.O_CREAT))"
    code += "; os.write(1, b'1'); os.write(2, b'2'); os._exit(os.open('x', 0) > 4)"
    line = shlex.join([sys.executable, "-c", code])
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    for shut in ("1>&-", "2>&-", "1>&- 2>&-"):
        run = subprocess.run(["sh", "-c", f"exec {line} {shut}"], cwd=tmp_path, env=env, check=False)
        assert run.returncode == 0 and not (tmp_path / "x").read_bytes()


def test_progress_without_a_stream_is_silent() -> None:
    progress = Progress(None)
    progress.begin(9, 0, 0)
    progress.say("going on")
    progress.show(1, 1)
    progress.step("rays", 1, 2)
    progress.clear()


@pytest.mark.parametrize(
    "words", [["report", str(GALLERY)], ["report", "gallery"], ["fire", str(GALLERY), "s"], ["new", "x"]]
)
def test_a_folder_that_is_gone_is_one_line(words: list[str], tmp_path: Path) -> None:
    line = f"cd gone && rmdir ../gone && exec {shlex.join([*RUN, *words])}"
    (tmp_path / "gone").mkdir()
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    run = subprocess.run(["sh", "-c", line], cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 2 and run.stderr.startswith("hitplanes: ") and run.stderr.count("\n") == 1


INTERRUPTED = """
import os, signal, sys, time
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(1)
except KeyboardInterrupt:
    raise ImportError("as some modules make of it") from None
sys.exit(7)
"""


@pytest.mark.parametrize("name", ["numpy", "argparse", "difflib"])
def test_an_interrupt_while_modules_are_loaded_is_one_line(name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").write_text(INTERRUPTED)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    words = [*RUN, "rapport"] if name != "difflib" else [*RUN, "compare", "a", "b"]
    run = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (130, "hitplanes: interrupted\n")


def test_an_interrupt_that_is_ignored_stays_ignored(tmp_path: Path) -> None:
    (tmp_path / "numpy.py").write_text(INTERRUPTED)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    line = f"trap '' INT; exec {shlex.join([*RUN, 'rapport'])}"
    run = subprocess.run(["sh", "-c", line], cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 7


def test_an_interrupt_while_words_are_read_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hitplanes.weapons.cli.command.parser", interrupted)
    assert main(["new", "x"]) == 130
    assert capsys.readouterr().err == "hitplanes: interrupted\n"


def test_what_the_system_refuses_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(_: object) -> None:
        raise PermissionError(13, "Permission denied", "some\nplace")

    monkeypatch.setattr("hitplanes.weapons.cli.command.load_scene", refused)
    assert main(["report", "x"]) == 2
    assert capsys.readouterr().err == "hitplanes: some\\nplace: Permission denied\n"
