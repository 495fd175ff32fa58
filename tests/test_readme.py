"""What the README shows is run as written."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from planes import load_scene
from planes.image import read_png
from weapons import arsenal_of
from weapons.arsenal import KINDS
from weapons.candidates import PREFILTERS
from weapons.cli import main
from weapons.costs import BROADPHASES
from weapons.orders import fire_order, orders_of

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def section(heading: str) -> str:
    return README.split(f"\n## {heading}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize("heading", ["Run it", "Test it"])
def test_each_command_is_one_block_of_one_line(heading: str) -> None:
    (block,) = re.findall(r"```sh\n(.*?)```", section(heading), flags=re.DOTALL)
    assert len(block.strip().splitlines()) == 1


def test_ten_lines_print_what_is_shown() -> None:
    code, shown = blocks("python")[0], blocks("text")[0]
    assert len([line for line in code.splitlines() if line]) <= 10
    words = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout == shown


def test_batch_example_runs() -> None:
    subprocess.run([sys.executable, "-W", "error", "-c", blocks("python")[1]], cwd=ROOT, check=True)


def test_report_example_writes_a_picture(tmp_path: Path) -> None:
    code = blocks("python")[2].replace("fixtures/", f"{ROOT}/fixtures/")
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=tmp_path, env=env, check=True)
    assert read_png(tmp_path / "flame.png").shape[0] > 500


def test_log_example_answers_what_is_shown(tmp_path: Path) -> None:
    shot, answer = (block for block in blocks("text") if block.startswith('{"'))
    (tmp_path / "shots.jsonl").write_text(shot)
    assert (
        main(
            ["fire", str(ROOT / "fixtures" / "gallery"), str(tmp_path / "shots.jsonl"), "-o", str(tmp_path / "h.jsonl")]
        )
        == 0
    )
    assert (tmp_path / "h.jsonl").read_text().splitlines(keepends=True)[1] == answer


def test_golden_example_is_written_accepted_and_says_what_changed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A user's golden test, in a folder of its own."""
    tmp_path = pytester.path
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("COLUMNS", "200")
    (code,) = (block for block in blocks("python") if "hits_golden" in block)
    (told,) = re.findall(r"```text\n(.*?)```", section("A golden test of your own game"), flags=re.DOTALL)
    (tmp_path / "test_blast.py").write_text(code)
    shutil.copytree(ROOT / "fixtures" / "gallery", tmp_path / "level1")

    def pytest_run(*words: str) -> tuple[int, str]:
        done = pytester.runpytest_inprocess("-q", "-p", "no:cacheprovider", *words)
        return int(done.ret), done.stdout.str()

    assert pytester.runpytest_subprocess("-q").ret == 1 and not (tmp_path / "goldens").exists()
    assert (tmp_path / "hits-failures" / "index.html").is_file()
    assert pytest_run("--hits-update")[0] == 0 and pytest_run()[0] == 0
    scene = tmp_path / "level1" / "scene.json"
    scene.write_text(scene.read_text().replace("[405.5, 212.5]", "[402.5, 212.5]"))
    code_, printed = pytest_run()
    assert code_ == 1 and told in printed
    (tmp_path / "test_blast.py").write_text(code.replace("test_blast_behind", "test_boom_behind"))
    assert pytest_run("--hits-update")[0] == 0
    code_, printed = pytest_run("--hits-stale")
    assert code_ == 1 and "test_blast_behind_the_counter.json" in printed


def test_every_fixture_is_named() -> None:
    told = section("Where things are")
    for path in (ROOT / "fixtures").glob("*/scene.json"):
        assert f"`{path.parent.name}`" in told


def test_scene_example_loads_and_hits(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_text(blocks("json")[0])
    scene = load_scene(tmp_path)
    (order,) = orders_of(scene, arsenal_of(scene))
    assert [scene.name_of(row.object) for row in fire_order(scene, order)] == ["duck"]


def test_every_weapon_and_scene_key_is_told() -> None:
    told = section("The scene folder")
    for kind, weapon in KINDS.items():
        assert f"`{kind}`" in told
        for field in fields(weapon):
            assert f"`{field.name}`" in told, f"{kind}: {field.name}"


def test_pictures_are_there() -> None:
    names = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert len(names) == 5
    assert all((ROOT / name).stat().st_size < 420_000 for name in names)


@pytest.mark.parametrize(
    "heading", ["Volumes and broad phases", "Rays and projectiles", "Rewind, and a record of what was fired"]
)
def test_an_example_prints_what_is_shown(heading: str, tmp_path: Path) -> None:
    told = section(heading)
    code, shown = (re.findall(rf"```{word}\n(.*?)```", told, flags=re.DOTALL)[0] for word in ("python", "text"))
    words = [sys.executable, "-W", "error", "-c", code.replace("fixtures/", f"{ROOT}/fixtures/")]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, env=env, check=True)
    assert done.stdout == shown


def test_volumes_are_as_false_as_the_table_tells() -> None:
    bench = runpy.run_path(str(ROOT / "tests" / "bench" / "volumes.py"))
    mask, box = bench["masks"]()["duck 1"], bench["fit"].box
    kinds = {bench["BOXES"]: (box, box)} | {
        name: (make, bench["fit"].least_circle) for name, make in bench["FITS"].items()
    }
    rows = []
    for name, (make, of_disc) in kinds.items():
        volume = make(mask)
        wrong = bench["false_area"](volume, int(mask.sum())), bench["false_hits"](volume, mask, of_disc)
        rows.append([name, f"{bench['numbers_of'](volume):,}", *(f"{100 * share:.0f} %" for share in wrong)])
    rows.append([bench["PIXELS"], f"{mask.size:,}", "0 %", "0 %"])
    table = [
        line.strip("| ").split(" | ") for line in section("Volumes and broad phases").split("--- |\n")[1].splitlines()
    ]
    assert [row[:4] for row in table[: len(rows)]] == rows and table[0][4] == "1.0"


def test_volumes_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = section("Volumes and broad phases")
    report, demo = re.findall(r"^- `hitplanes (.*?)`", told, flags=re.MULTILINE)
    monkeypatch.chdir(ROOT)
    assert main([*report.split(), "-o", str(tmp_path / "report.png")]) == 0
    assert demo == "demo quadtree -o demo.gif"
    assert all(f'"{name}"' in told for name in (*BROADPHASES[1:], *PREFILTERS[1:]) if name != "boxes")


def test_a_plan_is_printed_as_it_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for the times."""
    told = section("What a shot costs")
    (command,) = re.findall(r"`hitplanes (report .*?)`", told)
    monkeypatch.chdir(ROOT)
    assert main([*command.split(), "-o", str(tmp_path / "report.png")]) == 0
    texts = capsys.readouterr().out, re.findall(r"```text\n(.*?)```", told, flags=re.DOTALL)[0]
    printed, shown = (re.sub(r" +", " ", re.sub(r"[\d,]+\.\d us", "us", text)) for text in texts)
    assert printed == shown


def test_what_a_scene_pays_for_is_as_the_table_tells() -> None:
    left_out = runpy.run_path(str(ROOT / "fixtures" / "left_out.py"))
    rows = left_out["table"]("a disc, direct", False)
    chosen = [0, *(rows[0].index(name) for name in left_out["SHORT"])]
    some = [[row[i] for i in chosen] for row in rows]
    some = [row for row in some if set(row[1:]) - {"-", ""}]
    assert left_out["markdown"](some) in section("What a shot costs")


def test_glossary_names_every_verdict() -> None:
    counts = json.loads(blocks("text")[0].splitlines()[-1].replace("'", '"'))
    assert all(verdict in section("Glossary") for verdict in counts)
