"""Two reports side by side: the counts of the pixels, the pictures, and the command that compares."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from hitplanes import Disc, Laser, Point, Scene, Spread, Sprite, fire, load_scene, read_png, report_of, weapons_of
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.cli.report_file import read_report
from hitplanes.weapons.report.canvas import factor_of
from hitplanes.weapons.report.differences import differences
from hitplanes.weapons.report.overlay import Overlay
from hitplanes.weapons.report.picture import AROUND, compared_pixels, picture_of_difference
from hitplanes.weapons.report.symbols import MARKS

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"


def yard(x: int = 20) -> Scene:
    scene = Scene((60, 40), name="yard")
    scene.add(Sprite.box(9, 9), (x, 20), name="crate")
    scene.add(Sprite.box(3, 30), (34, 20), role="occluder", layer=1, name="post")
    return scene


def shot_at(scene: Scene, x: int = 24) -> dict[str, Any]:
    return report_of(scene, [fire(scene, Disc(8), (x, 20))])


def test_only_shots_that_differ_are_numbered(monkeypatch: pytest.MonkeyPatch) -> None:
    """All are if none differs, or if the shots are not as many as they were."""
    numbered: list[int] = []
    monkeypatch.setattr(Overlay, "shot", lambda _, shot, number: numbered.append(number))

    def numbers(*places: list[tuple[int, int]]) -> list[int]:
        numbered.clear()
        picture_of_difference(*(report_of(scene, [fire(scene, Disc(2), at)]) for at in places), (scene, scene))
        return sorted(numbered)

    scene, first = yard(), [(3, 3), (20, 20), (50, 30)]
    assert numbers(first, [(3, 3), (21, 20), (50, 30)]) == [1, 1]
    assert numbers(first, first) == [0, 0, 1, 1, 2, 2] and numbers(first, first[:2]) == [0, 0, 1, 1, 2]


def by_hand(a: dict[str, Any], b: dict[str, Any]) -> dict[str, int]:
    """The counts, from sets of pixels."""

    def pixels(report: dict[str, Any]) -> dict[tuple[int, int], set[str]]:
        found: dict[tuple[int, int], set[str]] = {}
        for shot in report["shots"]:
            for verdict, runs in shot["samples"].items():
                for y, first, last in runs:
                    for x in range(first, last + 1):
                        found.setdefault((x, y), set()).add(verdict)
        return found

    mine, other = pixels(a), pixels(b)
    counts = dict.fromkeys(("both", "other verdict", "only expected", "only got"), 0)
    for p in mine.keys() | other.keys():
        was, now = mine.get(p, set()), other.get(p, set())
        if "hit" in was and "hit" in now:
            counts["both"] += 1
        elif "hit" in was:
            counts["only expected"] += 1
        elif "hit" in now:
            counts["only got"] += 1
        elif was != now:
            counts["other verdict"] += 1
    return counts


@pytest.mark.parametrize(("x", "at"), [(20, 24), (21, 24), (20, 25), (40, 24), (20, 50)])
def test_pixels_are_counted_by_who_hit_them(x: int, at: int) -> None:
    a, b = shot_at(yard()), shot_at(yard(x), at)
    counts = {name: int(plane.sum()) for name, plane in compared_pixels(a, b, (-10, -10, 80, 60)).items()}
    assert counts == by_hand(a, b)
    if (x, at) == (20, 24):
        assert {name for name, n in counts.items() if n} == {"both"}


def test_a_batch_is_compared_by_its_heat() -> None:
    at = np.random.default_rng(1).uniform(0, 50, (60, 2))
    a, b = (report_of(scene, [fire(scene, Spread(Disc(1), 3, 5), at)]) for scene in (yard(), yard(23)))
    counts = {name: int(plane.sum()) for name, plane in compared_pixels(a, b, (0, 0, 59, 39)).items()}
    assert counts["only expected"] > 0 and counts["only got"] > 0 and counts["both"] > 0
    assert picture_of_difference(a, b).std() > 5


def test_the_third_picture_marks_each_pixel() -> None:
    """In the middle of each pixel of the difference lies the colour of its kind."""
    a, b = shot_at(yard()), shot_at(yard(22))
    picture = picture_of_difference(a, b, text=False)
    kinds = compared_pixels(a, b, (0, 0, 59, 39))
    rows, columns = np.nonzero(kinds["only expected"] | kinds["only got"])
    view = (max(columns.min() - AROUND, 0), max(rows.min() - AROUND, 0))
    end = (min(columns.max() + AROUND, 59), min(rows.max() + AROUND, 39))
    factor = factor_of((*view, *end), 640, 720)
    wide = (end[0] - view[0] + 1) * factor
    third = picture[44:, 16 + 2 * (wide + 12) :][: (end[1] - view[1] + 1) * factor, :wide]
    for name, verdict in (("only got", "hit"), ("only expected", "occluded"), ("both", "empty")):
        for y, x in np.argwhere(kinds[name]):
            square = third[(y - view[1]) * factor :, (x - view[0]) * factor :][:factor, :factor].astype(int)
            assert (np.abs(square - MARKS[verdict][0]).max(axis=2) < 70).any(), (name, x, y)


def test_scenes_are_drawn_where_they_are_known() -> None:
    before, after = yard(), yard(22)
    a, b = shot_at(before), shot_at(after)
    scenes = (None, None), (before, None), (None, after)
    pictures = [picture_of_difference(a, b, pair, text=False) for pair in scenes]
    assert len({p.tobytes() for p in pictures}) == 3 and len({p.shape for p in pictures}) == 1
    wide = (pictures[0].shape[1] - 2 * 16 - 2 * 12) // 3
    sides = [[p[44:500, 16 + i * (wide + 12) :][:, :wide].tobytes() for i in range(3)] for p in pictures]
    nothing, old, new = sides
    assert old[0] != nothing[0] and old[1] == nothing[1] and old[2] == nothing[2]
    assert new[0] == nothing[0] and new[1] != nothing[1] and new[2] != nothing[2]


@pytest.mark.parametrize("far", [0, 10**9])
def test_odd_reports_have_a_picture(far: int) -> None:
    scene = Scene()
    scene.add(Sprite.circle(3), (far, far))
    hit, none = report_of(scene, [fire(scene, Point(), (far, far))]), report_of(scene, [])
    for a, b in ((hit, none), (none, hit), (none, none), (hit, hit)):
        assert picture_of_difference(a, b, (scene, scene)).shape[2] == 3
    elsewhere = Scene((10, 10))
    assert max(picture_of_difference(hit, shot_at(elsewhere)).shape) < 4200


def test_compare_tells_by_its_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = load_scene(GALLERY)
    weapons = weapons_of(scene)
    paths = [tmp_path / name for name in ("a.json", "b.json")]
    paths[0].write_text(json.dumps(report_of(scene, [fire(scene, weapons["blast"], (390, 110))])))
    scene.move(scene.find("bandit"), (369.5, 111.5))
    paths[1].write_text(json.dumps(report_of(scene, [fire(scene, weapons["blast"], (390, 110))])))
    a, b, png = (str(path) for path in (*paths, tmp_path / "diff.png"))
    assert main(["compare", a, a]) == 0
    assert capsys.readouterr().out == "no difference\n"
    scene.save(tmp_path / "moved")
    both = ["--scene", str(GALLERY), "--scene", str(tmp_path / "moved")]
    reports = [read_report(path) for path in paths]
    for words, scenes in ((both[:2], (load_scene(GALLERY), None)), (both, (load_scene(GALLERY), scene))):
        assert main(["compare", a, b, "-o", png, *words]) == 1
        assert np.array_equal(read_png(png)[:, :, :3], picture_of_difference(*reports, scenes))
    told = capsys.readouterr().out
    assert '"bandit"' in told and "px, was" in told
    assert cv2.imread(png).std() > 10
    before = Path(png).read_bytes()
    paths[1].write_text("{")
    assert main(["compare", a, b, "-o", png]) == 2
    assert main(["compare", a, str(tmp_path / "none.json")]) == 2
    assert main(["compare", a, a, "--scene", str(tmp_path)]) == 2
    assert main(["compare", a, a, "--scene", str(GALLERY.parent / "empty")]) == 2
    assert main(["compare", a, a, "-o", str(tmp_path / "diff.jpg")]) == 2
    assert capsys.readouterr().err.count("\n") == 5 and Path(png).read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "b.json", "diff.png", "moved"]


def test_shots_are_called_by_the_number_that_the_picture_has() -> None:
    scene, moved = yard(), yard(22)
    a, b = (report_of(s, [fire(s, Point(), (58, 38)), fire(s, Disc(8), (24, 20))]) for s in (scene, moved))
    assert differences(a, b)[0].startswith("shot 1 (disc at 24, 20): object 0")


def test_rays_are_drawn_in_both_pictures_and_told() -> None:
    scenes = yard(), yard(26)
    reports = [report_of(scene, [fire(scene, Laser(50), (4, 20), aim=0)]) for scene in scenes]
    picture = picture_of_difference(*reports, scenes, text=False)
    third = picture.shape[1] // 3
    white = [(picture[:, k * third : (k + 1) * third] == 255).all(axis=2) for k in range(3)]
    rows = [side.sum(axis=1).max() for side in white]
    assert min(rows[:2]) > 60 and rows[2] < 20, "an arrow in each, none in the difference"
    lines = differences(*reports)
    where = 'in object 0 "crate" from 17.5 px to 26.5 px, was from 11.5 px to 20.5 px'
    assert f"shot 0 (laser at 4, 20): ray: {where}" in lines
