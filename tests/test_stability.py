"""`hitplanes stability` asks hard questions, counts rightly, keeps what it asked, and tells it in three forms."""

from __future__ import annotations

import dataclasses
import importlib.util
import io
import itertools
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from some_of import some_of

from hitplanes import InputError
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.lab import peers
from hitplanes.weapons.lab.stability import families, stability, textbook
from hitplanes.weapons.lab.stability import stability as heatfigure
from hitplanes.weapons.lab.stability import stability as tally
from hitplanes.weapons.lab.stability.families import FAMILIES
from hitplanes.weapons.lab.stability.predicates import PREDICATES, Predicate
from hitplanes.weapons.lab.stability.stability import (
    FILES,
    NAIVE,
    OURS,
    Cell,
    Count,
    Study,
    load_study,
    markdown,
    run_stability,
    summary,
)
from hitplanes.weapons.lab.study.study import save_figure

CELLS = [(predicate, family) for predicate in PREDICATES for family in predicate.families]
ROWS = 40

SHAPELY = ("shapely", "polygons")


def with_predicates(monkeypatch: pytest.MonkeyPatch, *predicates: Predicate) -> None:
    for module in (tally, heatfigure, stability):
        monkeypatch.setattr(module, "PREDICATES", predicates)


def named(name: str, **changes: Any) -> Predicate:
    (found,) = (p for p in PREDICATES if p.name == name)
    return dataclasses.replace(found, quick=ROWS, **changes)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three predicates of three kinds, few rows of each, and no picture."""
    with_predicates(monkeypatch, named("circles"), named("polygons", block=20), named("ray, 1-px target"))
    monkeypatch.setattr(stability, "find_spec", lambda name: None)


# The questions


@pytest.mark.parametrize(("predicate", "family"), some_of(CELLS, 2), ids=lambda v: v if isinstance(v, str) else v.name)
def test_ours_is_right_and_the_question_can_be_missed(predicate: Predicate, family: str) -> None:
    """Of every cell some are true and some false; the same seed asks the same."""
    n = ROWS if predicate.cost > 5 else 3 * ROWS
    columns, again = (predicate.families[family](np.random.default_rng(4), n) for _ in range(2))
    assert all(np.array_equal(a, b) and len(a) == n for a, b in zip(columns, again, strict=True))
    true = predicate.true(columns)
    assert np.array_equal(predicate.ours(*columns), true)
    assert 0.05 < true.mean() < 1


def test_every_family_is_asked_of_something() -> None:
    assert {family for _, family in CELLS} == set(FAMILIES)
    assert len({p.name for p in PREDICATES}) == len(PREDICATES) == 14


def test_families_are_as_extreme_as_they_say() -> None:
    made = {family: PREDICATES[0].families[family](np.random.default_rng(1), 400) for family in PREDICATES[0].families}
    most = {family: np.abs(columns[0]).max() for family, columns in made.items()}
    assert most["far"] > 1e11 and most["huge"] > 1e149 and most["subnormal"] < 1e-300
    assert (np.abs(made["far"][0]).max(axis=1) > 100).mean() > 0.7
    radii = np.stack([made["ratio"][1], made["ratio"][3]])
    assert (radii.max(axis=0) / radii.min(axis=0)).max() > 1e11
    walls = np.sort(np.stack([made["walls"][1], made["walls"][3]]), axis=0)
    assert (walls[0] <= 1e-6).all() and (walls[1] >= 1e5).all()
    discs = {p.name: p for p in PREDICATES}["disc's pixels"]
    radius = discs.families["vast"](np.random.default_rng(1), 100)[0] / 256
    assert (3.1 * radius**2).max() > 0.95e8
    start, unit, times, *_ = {p.name: p for p in PREDICATES}["projectile, 1-px target"].families["fast"](
        np.random.default_rng(1), 100
    )
    assert (np.sqrt((unit**2).sum(axis=1)) * times / 256).max() > 0.9e6 and len(start) == 100


def test_directions_are_of_every_quarter() -> None:
    way = families.directions(np.random.default_rng(0), 400)
    assert np.allclose((way * way).sum(axis=1), 1)
    assert {(bool(x > 0), bool(y > 0)) for x, y in way} == {(True, True), (True, False), (False, True), (False, False)}


BOX, FAR_BOX = ([(0, 0), (2, 0), (2, 2), (0, 2)], [(5, 0), (7, 0), (7, 2), (5, 2)])
NEAR_BOX = [(x + 1.3, y + 0.6) for x, y in BOX]
EASY: dict[str, tuple[list[Any], list[Any]]] = {
    "circles": ([(0, 0), 2, (1, 1), 1], [(0, 0), 2, (9, 1), 1]),
    "boxes": ([(0, 0), (2, 2), (1, 1), (3, 3)], [(0, 0), (2, 2), (5, 1), (6, 3)]),
    "capsule, circle": ([(0, 0), (4, 0), 1, (2, 1), 1], [(0, 0), (4, 0), 1, (2, 5), 1]),
    "point in polygon": ([BOX, (0.7, 1.1)], [BOX, (3, 1)]),
    "circle, polygon": ([BOX, (2.5, 1), 1], [BOX, (9, 1), 1]),
    "polygons": ([BOX, NEAR_BOX], [BOX, FAR_BOX]),
    "oriented boxes": ([BOX, NEAR_BOX], [BOX, FAR_BOX]),
    "triangles in space": (
        [[(0, 0, 0), (4, 0, 0), (0, 4, 0)], [(1, 1, -1), (1, 1, 1), (1, 2, 2)]],
        [[(0, 0, 0), (4, 0, 0), (0, 4, 0)], [(1, 1, 1), (1, 1, 3), (1, 2, 2)]],
    ),
    "ray's pixels": ([(0, 5), (2560, 700), (5, 1)], [(0, 5), (2560, 700), (5, 3)]),
    "ray, 1-px target": ([(0, 5), (2560, 700), (5, 1)], [(0, 5), (2560, 700), (5, 3)]),
    "projectile, 1-px target": ([(0, 0), (3, 4), 600, 300, (3, 4), (9, 2)], [(0, 0), (3, 4), 600, 300, (3, 9), (9, 2)]),
    "disc's pixels": ([2000, (3, 4), (7, 7)], [2000, (7, 7), (7, 7)]),
    "beam's pixels": ([(3, 4), 500, 300, (5, 6), (7, 7)], [(3, 4), 500, 300, (-5, 6), (7, 7)]),
    "polygon's pixels": (
        [[(0, 0), (1990, 0), (1990, 2000), (0, 2001), (0, 2001)], (3, 4), (7, 7)],
        [[(0, 0), (1990, 0), (1990, 2000), (0, 2001), (0, 2001)], (9, 4), (7, 7)],
    ),
}


@pytest.mark.parametrize("method", [OURS, NAIVE, *peers.PEERS])
def test_every_method_is_asked_fairly(method: str) -> None:
    """What is plainly so, or not, each of them tells: their errors are their own, not those of how they are asked."""
    if method in peers.PEERS and not peers.installed(method):
        pytest.skip("not installed")
    asked = 0
    for predicate in PREDICATES:
        answers = {OURS: predicate.ours, NAIVE: predicate.naive}.get(method) or peers.of_peer(method, predicate.name)
        if answers is None:
            continue
        columns = tuple(np.array(column) for column in zip(*EASY[predicate.name], strict=True))
        if predicate.quick > 200 and columns[0].dtype.kind == "i" and "ray" not in predicate.name:
            columns = tuple(column.astype(np.float64) for column in columns)
        assert predicate.true(columns).tolist() == [True, False], predicate.name
        with np.errstate(all="ignore"):
            assert answers(*columns).tolist() == [True, False], predicate.name
        asked += 1
    assert asked == {OURS: 14, NAIVE: 14, "shapely": 13, "pymunk": 7, "pygame-ce": 1}[method]


MOVED = {
    "circles": (2,), "boxes": (2, 3), "capsule, circle": (3,), "point in polygon": (1,), "circle, polygon": (1,),
    "polygons": (1,), "oriented boxes": (1,), "triangles in space": (1,),
}  # fmt: skip
"""Columns of the second shape's points."""


@pytest.mark.parametrize("method", [NAIVE, *peers.PEERS])
@pytest.mark.parametrize("name", MOVED)
def test_ordinary_input_is_no_trouble(name: str, method: str) -> None:
    """Shapes of about the same size that do not touch but overlap or are apart: every method is right."""
    predicate = named(name)
    answers = predicate.naive if method == NAIVE else peers.of_peer(method, name)
    if answers is None or (method in peers.PEERS and not peers.installed(method)):
        pytest.skip("not asked")
    rng = np.random.default_rng(6)
    columns = list(predicate.families["near"](rng, 240))
    by = rng.uniform(-0.5, 0.5, (240, columns[MOVED[name][0]].shape[-1]))
    for k in MOVED[name]:
        columns[k] = columns[k] + (by if columns[k].ndim == 2 else by[:, None])
    true = predicate.true(tuple(columns))
    assert np.array_equal(answers(*columns), true) and 0.2 < true.mean() < 0.8


def test_the_textbook_is_wrong_where_it_is_known_to_be() -> None:
    """0.1 + 0.2 is not 0.3: circles that touch but for a rounding."""
    row = np.array([[0.0, 0.0]]), np.array([0.1]), np.array([[0.1 + 0.2, 0.0]]), np.array([0.2])
    assert not PREDICATES[0].true((np.array([[0.0, 0.0]]), *row[1:2], np.array([[0.30000000000000004, 0.0]]), row[3]))[
        0
    ]
    assert textbook.circles(row[0], row[1], np.array([[0.30000000000000004, 0.0]]), row[3])[0]


def test_the_textbook_is_asked_as_it_is_best() -> None:
    """Boxes that are given by their ends are compared by these, which is exact: no error is made for it."""
    boxes = named("boxes")
    for family, make in boxes.families.items():
        columns = make(np.random.default_rng(7), 200)
        assert np.array_equal(textbook.boxes(*columns), boxes.true(columns)), family


# A run


def test_a_run_is_told_in_three_forms(
    few: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stability, "find_spec", importlib.util.find_spec)
    folder = tmp_path / "out"
    assert main(["stability", "--quick", "-o", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == set(FILES)
    data = json.loads((folder / "stability.json").read_text())
    assert data["format"] == "hitplanes-stability/1" and data["complete"] and data["seed"] == 0 and data["quick"]
    assert data["versions"]["hitplanes"] and data["versions"]["numpy"]
    cells = {(c["predicate"], c["family"]): c for c in data["cells"]}
    assert len(cells) == len(data["cells"]) == 7 + 9 + 7
    for cell in cells.values():
        assert cell["methods"][OURS] == {"cases": ROWS, "missed": 0, "false": 0}
        assert cell["asked"] == cell["methods"][NAIVE]["cases"] == ROWS
    assert sum(c["methods"][NAIVE]["false"] + c["methods"][NAIVE]["missed"] for c in cells.values()) > 20
    told = (folder / "stability.md").read_text()
    assert f"- hitplanes: 0 wrong of {ROWS * 23:,}" in told and "not complete" not in told
    assert told.count("| circles |") >= 3 and "| ray, 1-px target | 0 | 0 | - |" in told
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == f"hitplanes: 0 wrong of {ROWS * 23:,}" and shown[1].startswith("naive float64: ")
    picture = cv2.imread(str(folder / "stability.png"))
    assert picture.shape[1] == 1760 and 600 < picture.shape[0] < 2400 and picture.std() > 20
    assert load_study(folder / "stability.json").to_json() == data


def test_the_same_seed_asks_and_tells_the_same(few: None, tmp_path: Path) -> None:
    folders = [tmp_path / name for name in "abc"]
    first, again, other = (
        run_stability(folder, seed, quick=True, stream=io.StringIO())
        for folder, seed in zip(folders, (3, 3, 4), strict=True)
    )
    assert first.cells == again.cells != other.cells
    for name in FILES[:2]:
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes()


def test_blocks_ask_no_row_twice(few: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    seen: list[np.ndarray] = []
    predicate = named("polygons", block=20)

    def ours(a: np.ndarray, b: np.ndarray) -> Any:
        seen.append(a)
        return predicate.ours(a, b)

    with_predicates(
        monkeypatch, dataclasses.replace(predicate, ours=ours, families={"near": predicate.families["near"]})
    )
    study = run_stability(tmp_path / "out", quick=True, stream=io.StringIO())
    assert [len(a) for a in seen] == [20, 20] and study.complete
    assert len(np.unique(np.concatenate(seen).reshape(ROWS, -1), axis=0)) == ROWS


def test_a_wrong_decision_of_ours_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = named("circles")
    with_predicates(monkeypatch, dataclasses.replace(broken, ours=broken.naive), named("capsule, circle"))
    assert main(["stability", "--quick", "-o", str(tmp_path / "out")]) == 1
    study = load_study(tmp_path / "out" / "stability.json")
    ours, textbook = study.total(OURS), study.total(NAIVE)
    assert ours.wrong > 10 and ours.wrong < textbook.wrong
    assert all(c.methods[OURS] == c.methods[NAIVE] for c in study.cells if c.predicate == "circles")
    assert "hitplanes: " in capsys.readouterr().out and "most in circles, subnormals" in summary(study)[0]


def test_missed_and_false_are_told_apart() -> None:
    count = Count()
    count.add(np.array([True, True, False, False, True]), np.array([True, False, True, True, False]))
    count.add(np.array([True]), np.array([False]))
    assert (count.cases, count.missed, count.false, count.wrong) == (6, 3, 2, 5)
    assert count.per_million == pytest.approx(833_333.33)
    study = Study(0, True, {}, [Cell("circles", "near", 6, {OURS: count})])
    assert "| circles | 3 + 2 of 6 |" in markdown(study)


def test_an_interrupt_keeps_what_was_asked(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = 0
    predicate = named("polygons", block=20)

    def ours(a: np.ndarray, b: np.ndarray) -> Any:
        nonlocal calls
        calls += 1
        if calls == 4:  # in the last block of all
            raise KeyboardInterrupt
        return predicate.ours(a, b)

    last = {family: predicate.families[family] for family in ("near", "far")}
    with_predicates(monkeypatch, named("circles"), dataclasses.replace(predicate, ours=ours, families=last))
    folder = tmp_path / "out"
    assert main(["stability", "--quick", "-o", str(folder)]) == 130
    assert "it is not complete" in capsys.readouterr().err
    study = load_study(folder / "stability.json")
    assert not study.complete and [c.complete for c in study.cells] == [True] * 8 + [False]
    assert all(count.cases == 20 for count in study.cells[-1].methods.values())
    assert "not complete" in (folder / "stability.md").read_text() and (folder / "stability.png").exists()


@pytest.mark.parametrize("complete", [True, False])
def test_an_interrupt_of_the_picture_says_that_it_is_missing(
    complete: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with_predicates(monkeypatch, named("circles"))

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(stability, "heat_figure", interrupted)
    if not complete:
        ask = stability._ask
        monkeypatch.setattr(stability, "_ask", lambda *given: interrupted(ask(*given)))
        monkeypatch.setattr(Study, "complete", False)
    folder = tmp_path / "out"
    assert main(["stability", "--quick", "-o", str(folder)]) == 130
    missing = "only the picture is missing" if complete else "it is not complete, and the picture is missing"
    assert capsys.readouterr().err == f"hitplanes: interrupted: what was asked is in {folder}; {missing}\n"
    assert sorted(path.name for path in folder.iterdir()) == ["stability.json", "stability.md"]


def test_a_run_is_kept_cell_by_cell(few: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Whatever ends it; before the first cell is done the folder is that of the run before."""

    class KilledError(Exception):
        pass

    def killed(columns: Any, after: int = 2) -> Any:
        seen.append(columns)
        if len(seen) > after:
            raise KilledError
        return true(columns)

    seen: list[Any] = []
    circles = named("circles")
    true = circles.true
    for name in FILES:
        (tmp_path / name).write_text("of before")
    monkeypatch.setattr(Predicate, "true", lambda self, columns: killed(columns))
    with_predicates(monkeypatch, circles)
    with pytest.raises(KilledError):
        run_stability(tmp_path, quick=True, stream=io.StringIO())
    assert [path.name for path in tmp_path.iterdir()] == [FILES[0]]
    study = load_study(tmp_path / FILES[0])
    assert [cell.rows for cell in study.cells] == [ROWS] * 2 and not study.complete


def test_an_interrupt_before_the_first_answer_leaves_the_last_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt

    for name in FILES:
        (tmp_path / name).write_text("of before")
    with_predicates(monkeypatch, named("circles", ours=interrupted))
    assert main(["stability", "--quick", "-o", str(tmp_path)]) == 130
    assert {path.read_text() for path in tmp_path.iterdir()} == {"of before"}
    assert main(["stability", "--quick", "-o", str(tmp_path / "new")]) == 130 and not (tmp_path / "new").exists()


def test_a_line_tells_how_far_it_is(few: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("hitplanes.weapons.replay.stream.SECONDS", 0)
    stream = Terminal()
    monkeypatch.setattr("hitplanes.weapons.replay.stream.time.monotonic", iter(range(10**6)).__next__)
    run_stability(tmp_path / "out", quick=True, stream=stream)
    drawn = [line for line in stream.getvalue().split("\r") if "decisions" in line]
    parts = [int(line.split(" decisions, ")[1].split(" %")[0]) for line in drawn]
    assert parts == sorted(parts) and parts[-1] == 100 and len(parts) > 20
    assert drawn[-1].startswith(f"{23 * ROWS:,} decisions")


# Where it is written


def test_a_folder_of_other_things_is_left_alone(few: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "a" / "b").mkdir(parents=True)
    bad = {tmp_path: "'a' in it", tmp_path / "notes.txt": "the file", tmp_path / "none" / "deep": "cannot make"}
    for folder, told in bad.items():
        assert main(["stability", "--quick", "-o", str(folder)]) == 2
        error = capsys.readouterr().err
        assert error.startswith("hitplanes: --output: ") and told in error
    assert main(["stability", "--quick", "--seed", "-1", "-o", str(tmp_path / "a" / "c")]) == 2
    assert "seed: expected" in capsys.readouterr().err and not (tmp_path / "a" / "c").exists()
    for _ in range(2):  # an empty one, and its own
        assert main(["stability", "--quick", "-o", str(tmp_path / "a" / "b")]) == 0


def test_without_matplotlib_there_is_no_picture(few: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "stability.png").write_text("of another run")
    assert main(["stability", "--quick", "-o", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"stability.json", "stability.md"}
    assert "without a picture: matplotlib is not installed" in capsys.readouterr().out


def test_fewer_rows_than_were_asked_are_told() -> None:
    methods = {OURS: Count(10, 0, 0), NAIVE: Count(4, 0, 0)}
    told = markdown(Study(0, False, {OURS: "9.9"}, [Cell("circles", "near", 10, methods)]))
    ours, naive_rows = (told.split(f"## {name}")[1] for name in (OURS, NAIVE))
    assert "| circles | 0 |" in ours and "| circles | 0 of 4 |" in naive_rows


def test_without_other_libraries_two_are_asked(few: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability, "installed", lambda peer: False)
    study = run_stability(tmp_path / "out", quick=True, stream=io.StringIO())
    assert study.methods == [OURS, NAIVE] and study.complete
    told = (tmp_path / "out" / "stability.md").read_text()
    assert "Not installed, so not asked: shapely, pymunk, pygame-ce." in told and "## shapely" not in told


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"format": "hitplanes-scene/2"}', '{"format": "hitplanes-stability/1"}']
)
def test_other_files_are_no_runs(text: str, tmp_path: Path) -> None:
    path = tmp_path / "stability.json"
    path.write_text(text)
    with pytest.raises(InputError):
        load_study(path)
    with pytest.raises(InputError, match=r"none\.json"):
        load_study(tmp_path / "none.json")


def test_a_library_that_fails_is_left_out_of_a_cell(few: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def answers(a: np.ndarray, b: np.ndarray) -> Any:
        if np.abs(a).max() > 1e100:
            raise OverflowError("too far")
        return textbook.polygons(a, b)

    with_predicates(monkeypatch, named("polygons"))
    monkeypatch.setattr(stability, "of_peer", lambda peer, name: answers if (peer, name) == SHAPELY else None)
    monkeypatch.setattr(stability, "installed", lambda peer: peer == "shapely")
    monkeypatch.setattr(stability, "versions", lambda *names: dict.fromkeys(names, "1"))
    study = run_stability(tmp_path / "out", quick=True, stream=io.StringIO())
    assert study.complete and [c.family for c in study.cells if c.failed] == ["huge"]
    assert study.total("shapely").cases == 8 * ROWS
    assert "it failed in 1 cells, first by OverflowError: too far" in summary(study)[2]
    assert load_study(tmp_path / "out" / "stability.json").to_json() == study.to_json()


def test_a_failure_of_ours_is_told_and_no_success(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    circles = named("circles")

    def fails(*columns: Any) -> Any:
        if np.abs(columns[0]).max() > 1e100:
            raise InputError("center: expected less, got more")
        return circles.ours(*columns)

    with_predicates(monkeypatch, named("circles", ours=fails))
    assert main(["stability", "--quick", "-o", str(tmp_path)]) == 1
    assert "hitplanes: 0 wrong of 240; it failed in 1 cells, first by InputError: center" in capsys.readouterr().out
    study = load_study(tmp_path / "stability.json")
    assert study.complete and [c.family for c in study.cells if OURS in c.failed] == ["huge"]
    assert "| failed |" in (tmp_path / "stability.md").read_text()
    with_predicates(monkeypatch, named("circles", ours=lambda *_: 1 / 0))
    assert main(["stability", "--quick", "-o", str(tmp_path)]) == 1
    assert "hitplanes: 0 wrong of 0; it failed in 7 cells" in capsys.readouterr().out


# The picture


def test_each_cell_says_what_it_counts() -> None:
    """A zero has its own sign; a colour is the darker the more are wrong, in grey, too."""
    counts = {"near": (0, 0), "far": (1, 0), "ratio": (40, 2), "lattice": (0, 700_000)}
    cells = [Cell("circles", f, 10**6, {OURS: Count(10**6, *wrong)}) for f, wrong in counts.items()]
    figure = heatfigure.heat_figure(Study(0, False, {OURS: "9.9"}, cells))
    block = figure.axes[0]
    said = {text.get_text(): text for text in block.texts}
    assert {"0", "1 ppm", "42 ppm", "70 %", f"{OURS} 9.9", "700,043 wrong of 4,000,000"} == set(said)
    faces = [p.get_facecolor()[:3] for p in block.patches if p.get_width() == 0.94]
    grey = [0.3 * r + 0.59 * g + 0.11 * b for r, g, b in faces]
    assert grey[0] > 0.99 and all(light > dark + 0.05 for light, dark in itertools.pairwise(grey))
    assert block.patches[0].get_hatch() and "(not complete)" in figure.texts[0].get_text()
    assert [label.get_text() for label in block.get_xticklabels()][8] == "10$^{150}$"


@pytest.mark.parametrize(
    ("per_million", "told"),
    [(1e6, "100 %"), (123_456, "12 %"), (12_345, "1.2 %"), (1000, "0.1 %"), (999, "999 ppm"), (0.25, "0.25 ppm")],
)
def test_parts_are_told_in_few_letters(per_million: float, told: str) -> None:
    assert heatfigure.rate(per_million) == told


def test_figures_look_alike_whatever_the_user_set(few: None, tmp_path: Path) -> None:
    mpl = pytest.importorskip("matplotlib")
    study = Study(0, True, {}, [Cell("circles", "near", 6, {OURS: Count(6, 1, 0)})])
    save_figure(heatfigure.heat_figure(study), tmp_path / "a.png")
    with mpl.rc_context({"font.size": 30, "savefig.dpi": 20, "ytick.labelsize": 30}):
        save_figure(heatfigure.heat_figure(study), tmp_path / "b.png")
        assert mpl.rcParams["font.size"] == 30
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
def test_ours_is_right_on_other_seeds(seed: int, tmp_path: Path) -> None:
    study = run_stability(tmp_path / "out", 100 + seed, quick=True, stream=io.StringIO())
    assert study.complete and study.total(OURS).wrong == 0
    assert study.total(NAIVE).wrong > 0.05 * study.total(NAIVE).cases
