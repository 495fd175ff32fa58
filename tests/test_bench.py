"""The benchmark of speed runs, its JSON is whole, and a wrong row of any side ends it."""

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import hitplanes
from hitplanes import use_jit
from hitplanes.planes.common.costs import Costs

for library in ("pygame", "pymunk", "shapely"):
    pytest.importorskip(library)
sys.path.append(str(Path(__file__).parent / "bench"))

import calibrate  # noqa: E402
import speed  # noqa: E402
import speed_heat  # noqa: E402
import speed_weapons  # noqa: E402
from speed_clock import Cell, DisagreementError, Side, Times, race  # noqa: E402
from speed_peers import Baked, Masks  # noqa: E402
from speed_targets import TARGETS, judged  # noqa: E402
from speed_world import PATTERNS  # noqa: E402

TINY = replace(
    speed.QUICK, objects=(6,), moving=(6,), single=(6,), planner=(6,), redrawn=6, huge=6, shots=60, rewound=20,
    batches=(4,), frames=2, steps=4, calls=10, starts=1, rounds=1, seconds=0.002,
)  # fmt: skip


@pytest.fixture(autouse=True)
def _kernels_as_before() -> Iterator[None]:
    yield
    use_jit(None)


def test_a_quick_run_tells_tables_and_writes_json(tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.setattr(speed, "QUICK", TINY)
    path = tmp_path / "speed.json"
    speed.main(["--quick", "--objects", "10", "--only", "static,moving,moving rays,redrawn", "--json", str(path)])
    found = json.loads(path.read_text())
    told = capsys.readouterr().out
    assert [cell["what"] for cell in found["cells"] if cell["section"] == "static"] == list(PATTERNS)
    assert {cell["objects"] for cell in found["cells"] if cell["section"] == "moving"} == {10}
    assert len(found["targets"]) == len(TARGETS)
    for cell in found["cells"]:
        assert cell["what"] in told
        for name, side in cell["sides"].items():
            assert 0 < side["min_ns"] <= side["median_ns"]
            if name in ("A pygame", "C pygame", "numpy plane"):
                assert side["rows_compared"], (cell["what"], name)
            if name in ("pymunk", "shapely"):
                assert side["easier"] and not side["rows_compared"]


def test_the_other_sections_run(monkeypatch: Any) -> None:
    monkeypatch.setattr(speed, "bandwidth", dict)
    lines: list[str] = []
    found = speed.measured(
        TINY, ["special", "weapons", "single", "preparation", "rewind", "huge", "planner", "floors"], lines.append
    )
    assert {cell["section"] for cell in found["cells"]} == {
        "special", "weapons", "single", "preparation", "rewind", "huge", "planner", "floors",
    }  # fmt: skip
    assert all(cell["sides"] for cell in found["cells"])
    panel = speed_heat.draw(found).axes[0]
    assert [label.get_text() for label in panel.get_yticklabels()] == list(speed_weapons.WEAPONS)
    cells = [cell for cell in found["cells"] if cell["section"] == "weapons"]
    with_peer = sum(bool(cell["sides"].keys() & set(speed_heat.PEERS)) for cell in cells)
    assert len(panel.texts) == with_peer + sum(not cell["what"].endswith(", rows") for cell in cells) > 60


class Ready:
    """What `prepare` is to give, by `fire`; `samples` more than there are."""

    def __init__(self, scene: Any, weapon: Any, samples: int) -> None:
        self.given, self.samples = (scene, weapon), samples

    def fire(self, at: Any, **aim: Any) -> Any:
        return [row._replace(samples=row.samples + self.samples) for row in hitplanes.fire(*self.given, at, **aim)]


def test_the_prepared_call_is_compared_too(monkeypatch: Any) -> None:
    crowded = replace(TINY, single=(300,), calls=50)
    monkeypatch.setattr(hitplanes, "prepare", lambda *given: Ready(*given, 0), raising=False)
    assert next(speed.single(crowded)).sides["ready, numpy"].compared
    monkeypatch.setattr(hitplanes, "prepare", lambda *given: Ready(*given, 1))
    with pytest.raises(DisagreementError, match="ready, numpy differ"):
        next(speed.single(crowded))


@pytest.mark.parametrize("peer", [Masks, Baked])
def test_a_wrong_row_ends_the_run(peer: Any, monkeypatch: Any) -> None:
    name = "areas" if peer is Masks else "alike"
    right = getattr(peer, name)
    monkeypatch.setattr(peer, name, lambda *given: [(s, i, n + 1) for s, i, n in right(*given)])
    crowded = replace(TINY, objects=(300,))
    with pytest.raises(DisagreementError, match="differ"):
        list(speed.static(crowded))


def test_a_missing_row_ends_the_run() -> None:
    sides = [
        Side("numpy", lambda work, units: [(0, 1, 5), (1, 2, 7)], list, whole=True),
        Side("A pygame", lambda work, units: [(0, 1, 5)], list, whole=True),
    ]
    with pytest.raises(DisagreementError, match=r"only numpy: \[\(1, 2, 7\)\]"):
        race(Cell("static", "point", 6), sides, [[None], [None]], 2, 0.001)
    easier = [sides[0], Side("pymunk", lambda work, units: 3, easier="hulls", whole=True)]
    assert not race(Cell("static", "point", 6), easier, [[None], [None]], 2, 0.001).sides["pymunk"].compared


def test_works_of_a_run_are_answered_in_a_row_and_all_compared() -> None:
    """As many as there is time for; a part of the first by a side that is not whole."""
    asked: dict[str, list[Any]] = {"numpy": [], "jit": [], "A pygame": []}

    def side(name: str, wrong: int, whole: bool) -> Side:
        def answer(work: int, units: int) -> list[Any]:
            asked[name].append((work, units))
            return [(shot, 1, 5 + (work == wrong)) for shot in range(units)]

        return Side(name, answer, list, whole=whole)

    runs = [[0, 1, 2], [10, 11, 12], [20, 21, 22]]
    sides = [side("numpy", -1, True), side("jit", 22, True), side("A pygame", 11, False)]
    cell = Cell("static", "point", 6)
    with pytest.raises(DisagreementError, match="numpy and jit differ"):
        race(cell, sides, runs, 64, 10.0)
    assert [work for work, _ in asked["numpy"][-6:]] == [10, 11, 12, 20, 21, 22]
    assert [work for work, _ in asked["A pygame"][-2:]] == [10, 20]
    sides[1] = side("jit", -1, True)
    cell = race(Cell("static", "point", 6), sides, runs, 64, 10.0)
    assert cell.sides["numpy"].units == 3 * 64 and cell.rows == 1
    assert set(cell.values["first of a run, median"]) == {"numpy", "jit"}
    short = race(Cell("static", "point", 6), sides, runs, 64, 1e-9)
    assert short.sides["numpy"].units == 64 and short.sides["A pygame"].units == 1


def test_targets_are_judged_by_the_worst_cell() -> None:
    cells = [
        Cell("static", "point", m, {"numpy": Times([10.0, 90.0]), "A pygame": Times([a]), "C pygame": Times([30.0])})
        for m, a in ((10, 1.0), (100, 900.0), (1000, 500.0))
    ]
    lines = {line["target"]: line for line in judged(cells, ["numpy"])}
    a, c = lines["static point, M >= 100, x A"], lines["static point, M >= 100, x C"]
    assert (a["measured"], a["reached"], a["where"]) == (50.0, True, "point, M = 1000")
    assert (c["measured"], c["reached"]) == (3.0, False)
    assert lines["static disc r=40, every M, x A"]["reached"] is None


def test_a_row_of_many_objects_is_judged_beside_one_of_few() -> None:
    costs = {10: 100.0, 100: 900.0, 10_000: 250.0}
    cells = [Cell("at objects", "disc r=40", m, values={"ns a row, numpy": ns}) for m, ns in costs.items()]
    moved = Cell("redrawn", "1 moved", 1000, values={"ns a moved object, numpy": 20_000.0})
    lines = {line["target"]: line for line in judged([*cells, moved], ["numpy"])}
    row = lines["r=40 at objects: a row, M = 10,000 over 10"]
    assert (row["measured"], row["sense"], row["reached"]) == (2.5, "at most", False)
    assert lines["moved object redrawn, M = 1000, us"]["measured"] == 20
    assert lines["moved object redrawn, M = 1000, us"]["reached"]
    few = judged(cells[:2], ["numpy"])
    assert all(line["measured"] is None for line in few)


def test_calibration_measures_every_cost(tmp_path: Path, monkeypatch: Any) -> None:
    """Each number is written anew, but those of ways that a form does not have; the rest of the module stays."""
    monkeypatch.setattr(calibrate, "SHOTS", (1, 9))
    monkeypatch.setattr(calibrate, "ITEMS", (5, 20))
    path = tmp_path / "costs.py"
    text = re.sub(r"=[\d.]+", "=0", calibrate.FILE.read_text())
    path.write_text(text)
    calibrate.main([str(path), "--rounds", "1"])
    assert re.sub(r"=[\d.]+", "=0", path.read_text()) == text
    numbers = dict(re.findall(r"(\w+ = Costs|\w+)[=(]([\d.]+|inf)", path.read_text()))
    assert len(numbers) == len(Costs._fields) and all(float(number) > 0 for number in numbers.values())
