"""Runs of pytest with hits_golden, as a game's tests have them: what is written, told, left, and called stale."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_of import some_of

from hitplanes import Scene
from hitplanes.planes.common.checks import Image
from hitplanes.weapons.golden import file
from hitplanes.weapons.golden.check import FOLDER, PAGE

ROOT = Path(__file__).parents[1]

LEVEL = """
import json
from pathlib import Path
from hitplanes import Disc, Scene, fire

def blast(x=6):
    pixels = json.loads(Path(__file__).with_name("level.json").read_text())
    scene = Scene((16, 16))
    scene.add([[1] * 6, [1] * pixels + [0] * (6 - pixels)], (x, 8), name="duck")
    return fire(scene, Disc(4), (6, 8))
"""

TESTS = """
import pytest
from level import blast

def test_one(hits_golden):
    hits_golden(blast())

def test_two(hits_golden):
    hits_golden(blast(7))
    hits_golden(blast(8), name="again")

@pytest.mark.parametrize("x", [9, 10])
def test_each(hits_golden, x):
    hits_golden(blast(x))

class TestGun:
    def test_it(self, hits_golden):
        hits_golden(blast(11))

def test_without():
    pass
"""


def tiny(report: Any, scene: Scene, *, text: bool) -> Image:
    """Stands for the picture, which takes most of the time of a run and is not what is tested here."""
    told = json.dumps([report["shots"], [scene.mask(item)[0].tolist() for item in scene.ids().tolist()], text])
    return np.frombuffer(hashlib.sha256(told.encode()).digest()[:27], np.uint8).reshape(3, 3, 3)


@pytest.fixture
def untouched(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, pytestconfig: pytest.Config
) -> pytest.Pytester:
    """A game without goldens."""
    assert pytestconfig.pluginmanager.hasplugin("hitplanes"), "the plugin is not there: pip install -e . again"
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    pytester.makeini("[pytest]\nfilterwarnings = error\naddopts = -p no:hypothesispytest")
    for name, text in (("level.py", LEVEL), ("level.json", "6"), ("test_gun.py", TESTS)):
        (pytester.path / name).write_text(text)
    return pytester


@pytest.fixture(scope="module")
def accepted() -> dict[str, bytes]:
    """The goldens of the game, once a test has made them."""
    return {}


@pytest.fixture
def game(untouched: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, accepted: dict[str, bytes]) -> pytest.Pytester:
    """A game with goldens of its tests, and small pictures."""
    monkeypatch.setattr(file, "picture_of_report", tiny)
    if not accepted:
        assert untouched.runpytest_inprocess("--hits-update").ret == 0
        accepted |= {name: data for name, (_, data) in goldens(untouched).items()}
    for name, data in accepted.items():
        (untouched.path / name).parent.mkdir(parents=True, exist_ok=True)
        (untouched.path / name).write_bytes(data)
    return untouched


def goldens(game: pytest.Pytester) -> dict[str, tuple[int, bytes]]:
    files = (game.path / "goldens").rglob("*.*")
    return {p.relative_to(game.path).as_posix(): (p.stat().st_mtime_ns, p.read_bytes()) for p in files}


def summary(result: pytest.RunResult) -> list[str]:
    """What the run told of its goldens at its end."""
    lines = result.outlines
    begin = next((i for i, line in enumerate(lines) if re.fullmatch(r"=+ hits_golden =+", line)), len(lines))
    return list(itertools.takewhile(lambda line: line.strip() and not line.startswith("="), lines[begin + 1 :]))


def change(game: pytest.Pytester) -> None:
    """Take one pixel away from the duck."""
    (game.path / "level.json").write_text("5")


ALL = [
    "  goldens/test_gun/TestGun-test_it-fc97880529.json",
    "  goldens/test_gun/test_each[10].json",
    "  goldens/test_gun/test_each[9].json",
    "  goldens/test_gun/test_one.json",
    "  goldens/test_gun/test_two.json",
    "  goldens/test_gun/test_two-again.json",
]


def test_a_missing_golden_fails_and_leaves_a_candidate_elsewhere(game: pytest.Pytester) -> None:
    (game.path / "test_new.py").write_text("from level import blast\ndef test_a(hits_golden): hits_golden(blast(12))")
    before = goldens(game)
    result = game.runpytest_inprocess("test_new.py")
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        [
            "E * Failed: there is no golden of these hits yet",
            "E * golden: goldens/test_new/test_a.json",
            f"E * look: {FOLDER}/{PAGE}",
            "E * accept: run again with --hits-update",
        ]
    )
    assert summary(result) == [f"1 golden failed: {FOLDER}/{PAGE}"]
    assert goldens(game) == before
    (candidate,) = (game.path / FOLDER).glob("*/got.json")
    updated = game.runpytest_inprocess("test_new.py", "--hits-update")
    assert updated.ret == 0
    assert summary(updated) == ["1 golden updated:", "  goldens/test_new/test_a.json"]
    assert not (game.path / FOLDER).exists(), "nothing has failed since"
    assert set(goldens(game)) - set(before) == {f"goldens/test_new/test_a.{kind}" for kind in ("json", "npz", "png")}
    assert not candidate.exists() and game.runpytest_inprocess("test_new.py").ret == 0


def test_an_update_touches_only_what_fails(game: pytest.Pytester) -> None:
    for path in (game.path / "goldens").rglob("*.*"):
        os.utime(path, (1, 1))
    before = goldens(game)
    source = (game.path / "test_gun.py").read_text()
    (game.path / "test_gun.py").write_text(source.replace("blast(8)", "blast(5)"))
    failed = game.runpytest_inprocess()
    failed.assert_outcomes(failed=1, passed=5)
    assert goldens(game) == before
    updated = game.runpytest_inprocess("--hits-update")
    assert updated.ret == 0
    assert summary(updated) == ["1 golden updated:", "  goldens/test_gun/test_two-again.json"]
    after = goldens(game)
    assert {name for name in before if before[name] != after[name]} == {
        f"goldens/test_gun/test_two-again.{kind}" for kind in ("json", "npz", "png")
    }
    assert summary(game.runpytest_inprocess("--hits-update")) == []


def test_a_newer_golden_fails_even_an_update(game: pytest.Pytester) -> None:
    path = game.path / "goldens" / "test_gun" / "test_one.json"
    path.write_text(path.read_text().replace("hitplanes-golden/1", "hitplanes-golden/2"))
    before = goldens(game)
    result = game.runpytest_inprocess("--hits-update")
    result.assert_outcomes(failed=1, passed=5)
    result.stdout.fnmatch_lines(["*test_one.json: expected 'hitplanes-golden/1'*made by a newer hitplanes*"])
    assert goldens(game) == before


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("hits_golden(blast()); hits_golden(blast())", "name: * got a second golden without one"),
        ("hits_golden(blast(), name='a'); hits_golden(blast(), name='a')", "name: * got 'a' again"),
        ("hits_golden(blast(), name='')", "name: expected a text of 1 to 200 characters, got ''"),
        ("hits_golden(list(blast()))", "hits: expected Hits, as fire returns them, got list"),
        ("hits_golden(blast(), planes=[1])", "planes: expected arrays by name, got list"),
    ],
)
def test_a_wrong_call_is_an_error(game: pytest.Pytester, body: str, told: str) -> None:
    (game.path / "test_new.py").write_text(f"from level import blast\ndef test_a(hits_golden):\n    {body}\n")
    result = game.runpytest_inprocess("test_new.py", "--hits-update")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"E * hitplanes.planes.common.checks.InputError: {told}*"])


def test_the_page_is_that_of_the_last_run_that_used_the_fixture(game: pytest.Pytester) -> None:
    change(game)
    every = game.runpytest_inprocess()
    every.assert_outcomes(failed=5, passed=1)
    assert summary(every) == [f"5 goldens failed: {FOLDER}/{PAGE}"]
    page = game.path / FOLDER / PAGE
    assert page.read_text().count("<h2") == 5
    names = re.findall(r"</a>: goldens/test_gun/(.*?).json</li>", page.read_text())
    assert len(names) == 5 and {"test_one", "test_two"} < set(names)
    assert "<figcaption>got (goldens have no text)</figcaption>" in page.read_text()
    game.runpytest_inprocess("-k", "test_without")
    assert page.read_text().count("<h2") == 5, "a run that did not use it leaves it alone"
    game.runpytest_inprocess("-x")
    assert page.read_text().count("<h2") == 1
    assert len([p for p in (game.path / FOLDER).iterdir() if p.is_dir()]) == 1
    (game.path / "level.json").write_text("6")
    assert game.runpytest_inprocess("-k", "test_one").ret == 0
    assert not (game.path / FOLDER).exists()


def test_a_test_that_runs_again_counts_as_it_ended(game: pytest.Pytester) -> None:
    (game.path / "conftest.py").write_text(
        """
import pytest
from _pytest.runner import runtestprotocol

def pytest_runtest_protocol(item, nextitem):
    for pixels in ("5", "6"):
        (item.path.parent / "level.json").write_text(pixels)
        item._initrequest()
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        for report in reports:
            if report.failed and pixels == "5":
                report.outcome = "rerun"
            item.ihook.pytest_runtest_logreport(report=report)
    return True
"""
    )
    result = game.runpytest_inprocess("test_gun.py::test_one", "-p", "no:terminal")
    assert result.ret == 0 and not (game.path / FOLDER).exists()


@pytest.mark.parametrize(
    "words", some_of(["-p no:cacheprovider", "-p no:xdist", "-p no:terminal", "--rootdir=..", "-qq", "--no-summary"])
)
def test_runs_of_other_kinds(game: pytest.Pytester, words: str) -> None:
    assert game.runpytest_inprocess("--hits-stale", *words.split()).ret == 0
    change(game)
    assert game.runpytest_inprocess("--hits-stale", *words.split()).ret == 1
    folder = (game.path.parent if "--rootdir=.." in words else game.path) / FOLDER
    assert (folder / PAGE).read_text().count("<h2") == 5


def test_paths_are_told_from_where_pytest_was_called(game: pytest.Pytester) -> None:
    change(game)
    (game.path / "sub").mkdir()
    os.chdir(game.path / "sub")
    result = game.runpytest_inprocess("--rootdir=..", "../test_gun.py::test_one")
    result.stdout.fnmatch_lines(["E * golden: ../goldens/test_gun/test_one.json", f"E * look: ../{FOLDER}/{PAGE}"])


# Goldens that no test uses


def rewritten(old: str, new: str) -> Callable[[pytest.Pytester], object]:
    def rewrite(game: pytest.Pytester) -> None:
        path = game.path / "test_gun.py"
        source = path.read_text()
        assert old in source
        path.write_text(source.replace(old, new))

    return rewrite


def nothing(game: pytest.Pytester) -> None:
    """The tests as they are."""


def first_fails(game: pytest.Pytester) -> None:
    path = game.path / "goldens" / "test_gun" / "test_two.png"
    path.write_bytes(b"")


def file_gone(game: pytest.Pytester) -> None:
    (game.path / "test_gun.py").unlink()
    (game.path / "test_other.py").write_text("def test_a(): pass")


def last_failed(game: pytest.Pytester) -> None:
    path = game.path / "test_gun.py"
    source = path.read_text()
    path.write_text(source.replace("    pass", "    assert False"))
    game.runpytest_inprocess()
    path.write_text(source)


def damaged(game: pytest.Pytester) -> None:
    (game.path / "goldens" / "test_gun" / "old.json").write_text("{")
    (game.path / "goldens" / "test_gun" / "mine.txt").write_text("x")


def orphan(game: pytest.Pytester) -> None:
    (game.path / "goldens" / "test_gun" / "test_one.json").rename(game.path / "goldens" / "test_gun" / "copy.json")
    game.runpytest_inprocess("--hits-update", "-k", "test_one")


STALE: dict[str, tuple[Callable[[pytest.Pytester], object], list[str], list[str]]] = {
    "all are used": (nothing, [], []),
    "deselected by -k": (nothing, ["-k", "test_one or test_without"], []),
    "deselected by -m": (nothing, ["-m", "parametrize"], []),
    "deselected by name": (nothing, ["--deselect", "test_gun.py::test_two"], []),
    "one test": (nothing, ["test_gun.py::test_one"], []),
    "one class": (nothing, ["test_gun.py::TestGun"], []),
    "last failed": (last_failed, ["--lf"], []),
    "skipped": (rewritten("def test_one", "@pytest.mark.skip\ndef test_one"), [], []),
    "skipped inside": (rewritten("    hits_golden(blast())", "    pytest.skip()\n    hits_golden(blast())"), [], []),
    "failed before": (rewritten("    hits_golden(blast())", "    assert 0\n    hits_golden(blast())"), [], []),
    "expected to fail": (
        rewritten("def test_one(hits_golden):", "@pytest.mark.xfail\ndef test_one(hits_golden):\n    assert 0"), [], [],
    ),
    "failed between": (first_fails, [], []),
    "stopped": (rewritten("    hits_golden(blast())", "    assert 0"), ["-x"], []),
    "broken file": (rewritten("import pytest", "import no_such_module"), [], []),
    "skipped file": (rewritten("import pytest", "import pytest; pytest.skip(allow_module_level=True)"), [], []),
    "test gone": (rewritten("def test_one", "def helper"), [], ["test_one"]),
    "test gone, another chosen": (rewritten("def test_one", "def helper"), ["test_gun.py::test_two"], ["test_one"]),
    "name gone": (rewritten('    hits_golden(blast(8), name="again")', ""), [], ["test_two-again"]),
    "name gone, deselected": (rewritten('    hits_golden(blast(8), name="again")', ""), ["-k", "test_one"], []),
    "parameter gone": (rewritten("[9, 10]", "[9]"), [], ["test_each[10]"]),
    "method gone": (rewritten("def test_it", "def helper"), [], ["TestGun-test_it-fc97880529"]),
    "class gone": (rewritten("class TestGun", "class Gun"), [], ["TestGun-test_it-fc97880529"]),
    "method gone, another chosen": (rewritten("def test_it", "def helper"), ["test_gun.py::test_one"], []),
    "file gone": (file_gone, [], [line.split("/")[-1].removesuffix(".json") for line in ALL]),
    "damaged and foreign": (damaged, [], ["old"]),
    "damaged, deselected": (damaged, ["-k", "test_one"], []),
    "a copy": (orphan, [], ["copy"]),
}  # fmt: skip


@pytest.mark.parametrize("case", some_of(STALE, 2))
def test_goldens_that_no_test_uses(game: pytest.Pytester, case: str) -> None:
    prepare, words, stale = STALE[case]
    prepare(game)
    before = goldens(game)
    result = game.runpytest_inprocess("--hits-stale", *words)
    told = [line for line in summary(result) if " failed: " not in line]
    count = f"{len(stale)} golden" + ("" if len(stale) == 1 else "s")
    expected = [f"  goldens/test_gun/{name}.json" for name in stale]
    assert told == ([f"{count} that no test uses (--hits-stale):", *expected] if stale else [])
    failed = result.parseoutcomes().keys() & {"failed", "error", "errors"}
    assert (result.ret == 1) == bool(stale or (failed and result.ret != 2))
    assert goldens(game) == before
    if stale and not failed:
        silent = game.runpytest_inprocess(*words)
        assert silent.ret == 0 and summary(silent) == []


# Workers


@pytest.mark.long
def test_workers_leave_the_same_page_and_the_same_lists(untouched: pytest.Pytester) -> None:
    pytest.importorskip("xdist")
    written = untouched.runpytest_subprocess("--hits-update", "-n", "2")
    assert summary(written) == ["6 goldens updated:", *ALL]
    assert written.ret == 0 and not (untouched.path / FOLDER).exists()
    (untouched.path / "goldens" / "test_gun" / "gone.json").write_text('{"test": "test_gun.py::test_gone"}')
    change(untouched)
    told, left = [], []
    for run, words in ((untouched.runpytest_subprocess, "-n 2"), (untouched.runpytest_inprocess, "-p no:xdist")):
        result = run("--hits-stale", *words.split())
        result.assert_outcomes(failed=5, passed=1)
        told.append(summary(result))
        left.append({p.relative_to(untouched.path): p.read_bytes() for p in (untouched.path / FOLDER).rglob("*.*")})
    assert told[0] == told[1]
    assert told[0] == [
        "1 golden that no test uses (--hits-stale):", "  goldens/test_gun/gone.json",
        f"5 goldens failed: {FOLDER}/{PAGE}",
    ]  # fmt: skip
    assert left[0] == left[1] and len(left[0]) > 20


def test_a_run_that_does_not_use_it_pays_nothing(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    pytester.makepyfile(
        """
        import json, sys
        from pathlib import Path

        def test_a():
            Path("modules.json").write_text(json.dumps(sorted(sys.modules)))
        """
    )
    loaded: list[set[str]] = []
    for words in ([], ["-p", "no:hitplanes"]):
        assert pytester.runpytest_subprocess(*words).ret == 0
        loaded.append(set(json.loads((pytester.path / "modules.json").read_text())))
    assert loaded[0] - loaded[1] == {"hitplanes.weapons.golden", "hitplanes.weapons", "hitplanes"}
    assert not {name for name in loaded[0] if name.split(".")[0] in ("numpy", "cv2")}
