"""A report of the past beside the present: what has moved, what is gone or new, and what the same shot hits now."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from hitplanes import (
    Disc,
    History,
    InputError,
    Laser,
    Pistol,
    Scene,
    Sprite,
    Weapon,
    fire,
    picture_of_report,
    report_of,
)
from hitplanes.weapons.cli.report_file import REPORT
from hitplanes.weapons.report import report as thennow
from hitplanes.weapons.report.canvas import OUTLINES


def lane() -> tuple[Scene, History]:
    """A runner, a post and a crate at tick 0; now the runner is elsewhere, the crate gone and a barrel new."""
    scene = Scene((120, 80), name="lane")
    runner = scene.add(Sprite.box(9, 9), (40, 40), name="runner")
    scene.add(Sprite.box(3, 21), (80, 40), name="post")
    crate = scene.add(Sprite.box(5, 5), (100, 10), name="crate")
    history = History(scene)
    history.record(0)
    scene.move(runner, (40, 64))
    scene.remove(crate)
    scene.add(Sprite.box(7, 7), (20, 40), name="barrel")
    return scene, history


def told(weapon: Weapon, at: Any = (60, 40), aim: float = 180) -> tuple[dict[str, Any], History]:
    scene, history = lane()
    report = report_of(history.at(0), [fire(history, weapon, at, aim=aim, tick=0)], now=scene)
    report = json.loads(json.dumps(report, allow_nan=False))
    REPORT.check("report", report)
    return report, history


def test_what_moved_and_what_the_shot_hits_now() -> None:
    report, history = told(Pistol(100))
    now = report["now"]
    assert [row["name"] for row in report["shots"][0]["rows"]] == ["runner"]
    assert now["shots"] == [[{"object": 3, "name": "barrel", "pixels": 1}]]
    (moved,) = now["moved"]
    assert (moved["name"], moved["from_xy"], moved["to_xy"]) == ("runner", [40, 40], [40, 64])
    assert moved["runs"] == [[y, 36, 44] for y in range(60, 69)]
    assert [entry["name"] for entry in now["gone"]] == ["crate"]
    assert [entry["name"] for entry in now["new"]] == ["barrel"]
    assert now["tick"] == 0 and now["hash"] == history.scene.content_hash() != report["scene"]["hash"]


def test_a_turn_is_a_move_and_nothing_else_is() -> None:
    scene = Scene((60, 60))
    bar = scene.add(Sprite.box(11, 3), (20, 20), name="bar")
    scene.add(Sprite.box(5, 5), (40, 40))
    history = History(scene)
    history.record()
    scene.set(bar, angle=90)
    hits = fire(history, Disc(4), (20, 20), tick=0)
    moved = report_of(history.at(0), [hits], now=scene)["now"]["moved"]
    assert [entry["name"] for entry in moved] == ["bar"]
    scene.set(bar, angle=0)
    assert report_of(history.at(0), [hits], now=scene)["now"]["moved"] == []
    assert "now" not in report_of(history.at(0), [hits])


def test_what_is_out_of_view_or_too_many_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene()
    far = scene.add(Sprite.circle(3), (10**6, 0))
    near = [scene.add(Sprite.circle(3), (20 * i, 0)) for i in range(9)]
    history = History(scene)
    history.record()
    scene.move([far, *near], [(10**6, 5), *((20 * i, 5) for i in range(9))])
    hits = fire(history, Disc(4), (0, 0), tick=0)
    assert [m["object"] for m in report_of(history.at(0), [hits], now=scene)["now"]["moved"]] == near
    monkeypatch.setattr(thennow, "MOVED_MAX", 4)
    assert len(report_of(history.at(0), [hits], now=scene)["now"]["moved"]) == 4


def test_a_shot_that_would_start_in_something_now_is_told() -> None:
    report, history = told(Laser(30, inside="error"), at=(20, 40), aim=0)
    assert report["now"]["shots"] == [None]
    assert picture_of_report(report, history.at(0)).shape[2] == 3


def test_the_present_is_outlined_where_it_is() -> None:
    report, history = told(Disc(6), at=(40, 40))
    past = history.at(0)
    plain = {key: value for key, value in report.items() if key != "now"}
    with_now, without = (picture_of_report(one, past, text=False) for one in (report, plain))
    color = np.array(OUTLINES["now"][0])
    drawn = [(np.abs(picture.astype(int) - color) < 3).all(axis=2) for picture in (with_now, without)]
    assert drawn[0].sum() > 60 and not drawn[1].any()


def test_what_is_no_present_is_refused() -> None:
    scene, history = lane()
    hits = fire(history, Disc(6), (40, 40), tick=0)
    with pytest.raises(InputError, match="now: expected a Scene, got History"):
        report_of(history.at(0), [hits], now=history)  # type: ignore[arg-type]
    mixed = fire(history, Disc(6), [(40, 40)] * 2, tick=0)
    history.record(1)
    mixed = fire(history, Disc(6), [(40, 40)] * 2, tick=[0, 1])
    with pytest.raises(InputError, match=r"fired\[0\]: expected shots at one tick, got several"):
        report_of(history.at(0), [mixed], now=scene)
