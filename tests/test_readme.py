"""What the README and the guides show is run as written, and what they link to is there."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path

import pytest
from guides import (
    GLOSSARY,
    GUIDES,
    PAGES,
    RAYS,
    README,
    ROOT,
    SHOT,
    SPEED,
    WORLD,
    Example,
    blocks,
    broken,
    examples,
    links,
    name_of,
    section,
    text_of,
)
from some_of import some_of

from hitplanes import load_scene, weapons_of
from hitplanes.planes.files.png import read_png
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.fire.prefilter import PREFILTERS
from hitplanes.weapons.fire.strategy import BROADPHASES
from hitplanes.weapons.kinds.areas import KINDS
from hitplanes.weapons.replay.shot_log import fire_request, requests_of

README_LINES, GUIDE_LINES = 250, 299

EXAMPLES = [example for guide in GUIDES for example in examples(guide)]


def named(example: Example) -> str:
    return f"{name_of(example.guide)}-{example.number}"


@pytest.mark.parametrize("heading", ["Run it", "Test it"])
def test_each_command_is_one_block_of_one_line(heading: str) -> None:
    (block,) = blocks(section(README, heading), "sh")
    assert len(block.strip().splitlines()) == 1


@pytest.mark.parametrize("example", examples(README), ids=named)
def test_examples_of_the_readme_have_ten_lines(example: Example) -> None:
    assert len([line for line in example.code.splitlines() if line]) <= 10


@pytest.mark.parametrize("guide", GUIDES, ids=name_of)
def test_a_guide_is_short(guide: Path) -> None:
    assert len(text_of(guide).splitlines()) <= (README_LINES if guide == README else GUIDE_LINES)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_to_files_and_headings(page: Path) -> None:
    assert broken(page) == []


def test_every_guide_can_be_reached_from_the_readme() -> None:
    linked = {(ROOT / link).resolve() for link in links(text_of(README))}
    index = ROOT / "planes" / "ABOUT.md"  # the README for package indexes
    assert set(GUIDES) - {README, index} <= linked


def test_links_that_lead_nowhere_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("guides.ROOT", tmp_path)
    page = tmp_path / "page.md"
    (tmp_path / "other.md").write_text("# One `x`, two?\n## Same\n## Same\n```sh\n# no heading\n```\n")
    page.write_text(
        "[a](other.md) ![b](none.png) [c](other.md#one-x-two) [d](other.md#same-1) [e](other.md#same-2) [f](#here)\n"
        "[g](other.md#no-heading) [h](../up.md) `[i](code)` [j](https://example.org) [k](#deep)\n### Deep\n"
        "```text\n[l](inside)\n```\n"
    )
    assert broken(page) == ["none.png", "other.md#same-2", "#here", "other.md#no-heading", "../up.md"]


def test_an_example_is_shown_with_the_text_that_follows_at_once(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\na\n```\n\n```text\nb\n```\n\n```python\nc\n```\n\nso:\n\n```text\nd\n```\n")
    assert examples(page) == [Example(page, 0, "a\n", "b\n"), Example(page, 1, "c\n", "")]


RUN_ALONE = [one for one in EXAMPLES if "hits_golden" not in one.code]
QUIET = os.environ | {"PYGAME_HIDE_SUPPORT_PROMPT": "1"}


def can_run(example: Example) -> bool:
    """Whether what an example imports is there; pygame is a peer, which tests do without."""
    return "import pygame" not in example.code or find_spec("pygame") is not None


TOGETHER = """
import contextlib, io, json, os, sys
printed = []
for number, code in enumerate(json.load(sys.stdin)):
    os.mkdir(str(number))
    with contextlib.chdir(str(number)), contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(code, f"example {number}", "exec"), {"__name__": "__main__"})
    printed.append(out.getvalue())
json.dump(printed, sys.stdout)
"""


def code_of(example: Example) -> str:
    return example.code.replace("fixtures/", f"{ROOT}/fixtures/")


def has_written_pictures(example: Example, folder: Path) -> None:
    for name in re.findall(r"write_png\(\"(.*?)\"", example.code):
        picture = read_png(folder / name)
        assert picture.shape[0] > 500 and picture.std() > 10


def test_examples_print_what_is_shown(tmp_path: Path) -> None:
    """In one process, each with names and in a folder of its own; what prints nothing has no text after it."""
    run = list(filter(can_run, RUN_ALONE))
    words, codes = [sys.executable, "-W", "error", "-c", TOGETHER], json.dumps([code_of(one) for one in run])
    done = subprocess.run(words, input=codes, capture_output=True, text=True, cwd=tmp_path, env=QUIET, check=False)
    assert (done.stderr, done.returncode) == ("", 0)
    for number, (example, printed) in enumerate(zip(run, json.loads(done.stdout), strict=True)):
        assert printed == example.shown, named(example)
        has_written_pictures(example, tmp_path / str(number))


@pytest.mark.parametrize("example", some_of(RUN_ALONE, 5), ids=named)
def test_an_example_prints_what_is_shown(example: Example, tmp_path: Path) -> None:
    """In a folder of its own; what prints nothing has no text after it."""
    if not can_run(example):
        pytest.skip("pygame is not installed")
    words = [sys.executable, "-W", "error", "-c", code_of(example)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, env=QUIET, check=False)
    assert (done.stdout, done.stderr, done.returncode) == (example.shown, "", 0)
    has_written_pictures(example, tmp_path)


WITHOUT_PICTURES = [
    example
    for guide in (README, RAYS, SPEED)
    for example in examples(guide)
    if "hits_golden" not in example.code and "_png" not in example.code
]


@pytest.mark.parametrize("example", some_of(WITHOUT_PICTURES), ids=named)
def test_deciding_hits_needs_no_opencv(example: Example, tmp_path: Path) -> None:
    words = [sys.executable, "-c", f"import sys\nsys.modules['cv2'] = None\n{example.code}"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.stdout, done.stderr) == (example.shown, "")


@pytest.mark.parametrize("example", [one for one in EXAMPLES if "hits_golden" in one.code], ids=named)
def test_a_golden_example_is_accepted_and_holds(example: Example, pytester: pytest.Pytester) -> None:
    (pytester.path / "test_blast.py").write_text(example.code)
    shutil.copytree(ROOT / "fixtures" / "gallery", pytester.path / "level1")
    runs = [pytester.runpytest_inprocess("-q", "-p", "no:cacheprovider", *more) for more in ([], ["--hits-update"], [])]
    assert [int(done.ret) for done in runs] == [1, 0, 0]


def test_speeds_of_the_readme_are_rows_of_the_whole_table() -> None:
    told, whole = section(README, "How fast it is"), section(SPEED, "How fast is it?")
    rows = [line for line in told.splitlines() if line.startswith("|")]
    assert len(rows) > 5 and set(rows) <= set(whole.splitlines())


def test_log_example_answers_what_is_shown(tmp_path: Path) -> None:
    shot, answer = blocks(section(SHOT, "A log of shots"), "text")
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
    monkeypatch.setenv("COLUMNS", "200")
    text = section(SHOT, "A golden test of your own game")
    (code,), (told,) = blocks(text, "python"), blocks(text, "text")
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


def test_golden_of_hits_alone_says_what_exceeds_its_tolerance(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A can that moves by 3 px exceeds 2, and a bullseye that moves elsewhere fails nothing."""
    monkeypatch.setenv("COLUMNS", "200")
    text = section(SHOT, "A golden of hits alone")
    (code,), (told,) = blocks(text, "python"), blocks(text, "text")
    (pytester.path / "test_cans.py").write_text(code)
    shutil.copytree(ROOT / "fixtures" / "gallery", pytester.path / "level1")
    scene = pytester.path / "level1" / "scene.json"
    plain = scene.read_text()
    assert pytester.runpytest_inprocess("-q", "-p", "no:cacheprovider", "--hits-update").ret == 0
    for moved, ret in (
        (plain.replace("[405.5, 212.5]", "[402.5, 212.5]"), 1),
        (plain.replace("[58.5, 90.5]", "[49.5, 90.5]"), 0),
    ):
        assert moved != plain
        scene.write_text(moved)
        done = pytester.runpytest_inprocess("-q", "-p", "no:cacheprovider")
        assert done.ret == ret and (told in done.stdout.str()) == bool(ret), done.stdout.str()


def test_every_fixture_is_named() -> None:
    told = section(README, "Where things are")
    for path in (ROOT / "fixtures").glob("*/scene.json"):
        assert f"`{path.parent.name}`" in told


def test_scene_example_loads_and_hits(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_text(blocks(section(WORLD, "The scene folder"), "json")[0])
    scene = load_scene(tmp_path)
    (request,) = requests_of(scene, weapons_of(scene))
    assert [scene.name_of(row.object) for row in fire_request(scene, request)] == ["duck"]


def test_every_weapon_and_its_fields_are_told() -> None:
    told = section(SHOT, "The weapons")
    for kind, weapon in KINDS.items():
        assert f"`{kind}`" in told
        for field in fields(weapon):
            assert f"`{field.name}`" in told, f"{kind}: {field.name}"


def test_every_key_of_an_object_and_of_a_shot_is_told() -> None:
    told = section(WORLD, "The scene folder")
    schema = json.loads((ROOT / "weapons" / "schemas" / "scene.json").read_text())["$defs"]
    sources = (set(one["properties"]) for one in schema["object"]["anyOf"])
    keys = set(schema["shot"]["properties"]).union(*sources) - {"name"}
    assert len(keys) > 20 and {key for key in keys if f"`{key}`" not in told} == set()


PICTURES = ("gallery", "corridor", "rewind", "volumes", "study/kinds/areas")


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_are_shown(name: str) -> None:
    path = ROOT / "fixtures" / f"{name}.png"
    assert path in {(guide.parent / link).resolve() for guide in GUIDES for link in links(text_of(guide))}


def test_pictures_are_small() -> None:
    shown = {(guide.parent / link).resolve() for guide in GUIDES for link in links(text_of(guide))}
    assert all(path.stat().st_size < 420_000 for path in shown if path.suffix == ".png")


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
    told = section(WORLD, "Volumes and broad phases").split("--- |\n")[1]
    table = [line.strip("| ").split(" | ") for line in told.splitlines()]
    assert [row[:4] for row in table[: len(rows)]] == rows and table[0][4] == "1.0"


def test_volumes_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = section(WORLD, "Volumes and broad phases")
    report, demo = re.findall(r"^- `hitplanes (.*?)`", told, flags=re.MULTILINE)
    monkeypatch.chdir(ROOT)
    assert main([*report.split(), "-o", str(tmp_path / "report.png")]) == 0
    assert demo == "demo quadtree -o demo.gif"
    assert all(f'"{name}"' in told for name in (*BROADPHASES[1:], *PREFILTERS[1:]) if name != "boxes")


def test_a_plan_is_printed_as_it_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for the times, also those by which its way was chosen."""
    told = section(SPEED, "What a shot costs")
    (command,) = re.findall(r"`hitplanes (report .*?)`", told)
    monkeypatch.chdir(ROOT)
    assert main([*command.split(), "-o", str(tmp_path / "report.png")]) == 0
    texts = capsys.readouterr().out, blocks(told, "text")[0]
    printed, shown = (re.sub(r" +", " ", re.sub(r"[\d,.]+ us", "us", text)) for text in texts)
    assert printed == shown


def test_what_a_scene_pays_for_is_as_the_table_tells() -> None:
    left_out = runpy.run_path(str(ROOT / "fixtures" / "left_out.py"))
    rows = left_out["table"]("a disc by tiles", False)
    chosen = [0, *(rows[0].index(name) for name in left_out["SHORT"])]
    some = [[row[i] for i in chosen] for row in rows]
    some = [row for row in some if set(row[1:]) - {"-", ""}]
    assert left_out["markdown"](some) in section(SPEED, "What a shot costs")


def test_glossary_names_every_verdict() -> None:
    counts = json.loads(examples(README)[0].shown.splitlines()[-1].replace("'", '"'))
    assert all(verdict in text_of(GLOSSARY) for verdict in counts)
