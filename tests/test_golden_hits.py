"""Goldens of hits alone: what may change without a failure, the tolerances, and a scene that has moved since."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_of import in_turn, some_of
from test_golden import AT, CAN, DUCK, WALL, call, contents, shot, without

from hitplanes import Disc, Hits, InputError, Laser, Pistol, Scene, Spread, Sprite, Weapon, fire, read_png
from hitplanes.weapons.golden.check import FOLDER, Outcome, settle
from hitplanes.weapons.golden.file import EXACT, Tolerance, check_present, tolerance_of

Settle = Callable[..., Outcome]


def alone(folder: Path, hits: Hits, *, update: bool = False, only: str | None = "hits", **most: int) -> Outcome:
    one = call(folder, update=update)
    made = type(one)(*list(vars(one).values())[:7], only, Tolerance(**most))
    return settle(made, hits, {})


@pytest.fixture
def golden(tmp_path: Path) -> Settle:
    """Accept the hits of the shot alone; then compare others with them."""
    assert alone(tmp_path, shot(), update=True).kind == "updated"
    return lambda hits=None, **how: alone(tmp_path, shot() if hits is None else hits, **how)


def yard(
    *, duck_xy: tuple[int, int] = (6, 8), can_xy: tuple[int, int] = (44, 8), crate_xy: tuple[int, int] = (30, 8),
    name: str = "duck", weapon: Weapon | None = None, at: Any = (6, 8), aim: float = 0,
) -> Hits:  # fmt: skip
    """The duck half behind the wall, as `shot` has it, and a crate and smoke that may be anywhere."""
    scene = Scene((48, 16))
    scene.add(Sprite.from_mask(DUCK, color=(9, 90, 9)), duck_xy, name=name)
    scene.add(CAN, can_xy, name="can")
    scene.add(WALL, (6, 6), role="occluder", layer=1, name="wall")
    scene.add(Sprite.box(3, 3), crate_xy, role="occluder", name="crate")
    scene.add(Sprite.box(2, 2), crate_xy, role="mover", name="smoke")
    return fire(scene, weapon or Disc(4), at, aim=aim)


def test_it_keeps_rows_and_nothing_else(golden: Settle, tmp_path: Path) -> None:
    (text,) = (json.loads(data) for data in contents(tmp_path).values())
    assert text["only"] == "hits" and text["planes"] == []
    (kept,) = text["report"]["shots"]
    assert set(kept) == {"shot", "weapon", "at", "aim", "seed", "accept", "blocked_by", "exclude", "rows"}
    (row,) = kept["rows"]
    assert (row["name"], row["pixels"], row["first_xy"], row["distance2"]) == ("duck", 23, [6, 8], 0)
    assert not {"shares", "margin"} & set(row)
    assert golden() == Outcome("same") == golden(update=True)
    assert not (tmp_path / FOLDER).exists()


ELSEWHERE: dict[str, dict[str, Any]] = {
    "crate far away": {"crate_xy": (40, 9)},
    "crate near, where the margins and misses change": {"crate_xy": (14, 8)},
    "crate under an empty part of the blast": {"crate_xy": (9, 4)},
}


@pytest.mark.parametrize(
    ("weapon", "case"), in_turn([Disc(4), Spread(Disc(2), 5, 3), Laser(5), Pistol(5)], ELSEWHERE), ids=str
)
def test_a_crate_that_moves_elsewhere_fails_nothing(tmp_path: Path, case: str, weapon: Weapon) -> None:
    at = (6, 8) if weapon.kind in ("disc", "spread") else (2, 10)
    before, after = yard(weapon=weapon, at=at), yard(weapon=weapon, at=at, **ELSEWHERE[case])
    assert before and list(after) == list(before), "no hit has changed"
    for only in ("hits", None):
        folder = tmp_path / str(only)
        folder.mkdir()
        assert alone(folder, before, update=True, only=only).kind == "updated"
        assert alone(folder, after, only=only).kind == ("same" if only else "failed")


CHANGED: dict[str, tuple[Hits, str]] = {
    "a pixel": (shot(duck=without(DUCK, 2, 5)), f'{AT}: object 0 "duck": 22 px, was 23; lost at (6, 11)'),
    "its cover": (shot(wall=without(WALL, 0, 0)), f'{AT}: object 0 "duck": 24 px, was 23; gained at (4, 6)'),
    "missed": (yard(duck_xy=(60, 8)), f'{AT}: object 0 "duck" is no longer hit'),
    "new": (yard(can_xy=(2, 8)), f'{AT}: object 1 "can" is newly hit: 5 px, first at (3, 8)'),
    "renamed": (yard(name="goose"), f'{AT}: object 0 "goose": name "goose", was "duck"'),
    "another shot": (yard(at=[(6, 8), (6, 8)]), "shot 1 (disc at 6, 8) is new"),
}


@pytest.mark.parametrize("case", CHANGED)
def test_a_hit_that_changes_fails_and_is_told(golden: Settle, tmp_path: Path, case: str) -> None:
    hits, line = CHANGED[case]
    before = contents(tmp_path)
    outcome = golden(hits)
    told = outcome.message.splitlines()
    assert outcome.kind == "failed" and told[0].startswith(line), told
    assert told[1:] == [
        "golden: goldens/test_a/test_x.json", f"look: {FOLDER}/index.html", "accept: run again with --hits-update",
    ]  # fmt: skip
    folder = tmp_path / FOLDER / outcome.failure["folder"]
    drawn = {file for row in outcome.failure["rows"] for _, file in row} | set(outcome.failure["texts"])
    pair = {"hits.png"} if case != "another shot" else set()
    assert drawn == {p.name for p in folder.iterdir()} == {"expected.json", "got.json", "got.png"} | pair
    assert contents(tmp_path) == before
    assert golden(hits, update=True).kind == "updated" and golden(hits) == Outcome("same")


@pytest.mark.parametrize("case", ["missed", "new", "another shot"])
def test_no_tolerance_is_for_what_is_hit_at_all(golden: Settle, case: str) -> None:
    hits, line = CHANGED[case]
    assert golden(hits, pixels=10**6, px=10**6).message.startswith(line)


def test_how_a_shot_was_fired_is_not_compared(golden: Settle) -> None:
    """Another weapon, aim and filter that hit the same."""
    scene = shot().scene
    other = fire(scene, Disc(4, falloff=None, pierce=True), (6, 8), aim=40, seed=7, accept=1)
    assert golden(other) == Outcome("same")


def plank(pixels: int, x: int = 6, layer: int = 0) -> Hits:
    """A row of pixels from x on, in front of a board that is hit, too; a laser goes through both."""
    scene = Scene((48, 16))
    scene.add(Sprite.from_mask(np.ones((1, pixels), np.bool_), pivot_xy=(0, 0)), (x, 8), name="plank", layer=layer)
    scene.add(np.ones((3, 3), np.bool_), (2, 8), name="board")
    return fire(scene, Disc(30, pierce=True, falloff="linear"), (0, 8))


TOLERATED = {
    "within both": (plank(13, 8), {"pixels": 3, "px": 2}, []),
    "exactly as many": (plank(13), {"pixels": 3}, []),
    "exactly as far": (plank(10, 8), {"px": 2}, []),
    "one pixel more": (plank(14), {"pixels": 3}, ["4 px more, tolerance_pixels=3"]),
    "fewer": (plank(5), {"pixels": 4, "px": 1}, ["5 px less, tolerance_pixels=4"]),
    "farther": (plank(10, 9), {"pixels": 3, "px": 2}, ["first hit 3.0 px away, tolerance_px=2"]),
    "only pixels are asked for": (plank(11, 7), {"pixels": 3}, ["first hit 1.0 px away, tolerance_px=0"]),
    "only places are asked for": (plank(11, 7), {"px": 3}, ["1 px more, tolerance_pixels=0"]),
    "both": (
        plank(15, 9), {"pixels": 3, "px": 2},
        ["5 px more, tolerance_pixels=3", "first hit 3.0 px away, tolerance_px=2"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", some_of(TOLERATED, 2))
def test_a_tolerance_is_as_wide_as_it_says(tmp_path: Path, case: str) -> None:
    hits, most, exceeded = TOLERATED[case]
    assert alone(tmp_path, plank(10), update=True).kind == "updated"
    outcome = alone(tmp_path, hits, **most)
    assert (outcome.kind == "same") == (not exceeded)
    told = outcome.message.splitlines()
    assert [line for line in told if "tolerance" in line] == [f"shot 0: object 0: {line}" for line in exceeded]
    assert not exceeded or (
        told[0].startswith('shot 0 (disc at 0, 8): object 0 "plank": ') and "board" not in str(told)
    )
    assert alone(tmp_path, hits).kind == "failed"


def test_places_are_measured_straight() -> None:
    """3 px right and 4 px down are 5 px."""
    was, now = {"pixels": 1, "first_xy": [0, 0]}, {"pixels": 1, "first_xy": [3, -4]}
    assert Tolerance(px=5).exceeded(was, now) == []
    assert Tolerance(px=4).exceeded(was, now) == ["first hit 5.0 px away, tolerance_px=4"]


def test_the_order_of_rows_is_not_compared(tmp_path: Path) -> None:
    """Two objects on one pixel: the layers say which row comes first."""
    orders = []
    for layer in (-1, 1):
        scene = Scene((9, 9))
        for each in (0, layer):
            scene.add(np.ones((3, 3), np.bool_), (4, 4), layer=each)
        hits = fire(scene, Disc(1, pierce=True), (4, 4))
        orders.append(hits.object.tolist())
        assert alone(tmp_path, hits, update=layer < 0).kind == ("updated" if layer < 0 else "same")
    assert orders == [[0, 1], [1, 0]]


def many(duck: Any = DUCK, crate_xy: tuple[int, int] = (30, 8)) -> Hits:
    """More shots than a report lists one by one."""
    scene = Scene((48, 16))
    scene.add(duck, (6, 8), name="duck")
    scene.add(Sprite.box(3, 3), crate_xy, role="occluder", name="crate")
    return fire(scene, Disc(2), [(x, 8) for x in range(30)])


def test_a_batch(tmp_path: Path) -> None:
    assert alone(tmp_path, many(), update=True).kind == "updated"
    assert alone(tmp_path, many(crate_xy=(40, 3))) == Outcome("same")
    changed = many(without(DUCK, 2, 2))
    message = alone(tmp_path, changed).message
    assert message.startswith('batch: shot 4: object 0 "duck": 8 px, was 9') and "heat" not in message
    assert alone(tmp_path, changed, pixels=1, px=1) == Outcome("same")
    two = without(without(DUCK, 2, 2), 3, 2)
    assert "shot 6: object 0: 2 px less, tolerance_pixels=1" in alone(tmp_path, many(two), pixels=1, px=2).message
    assert alone(tmp_path, shot()).message.startswith("shots listed one by one, was shots listed as a batch")


@pytest.mark.parametrize("first", ["hits", None])
def test_what_is_kept_changes_by_an_update(tmp_path: Path, first: str | None) -> None:
    """From the whole to hits alone the planes and the picture go, and back they come; other hits are told before."""
    files, second = (
        {"hits": ["test_x.json"], None: ["test_x.json", "test_x.npz", "test_x.png"]},
        None if first else "hits",
    )
    assert alone(tmp_path, shot(), update=True, only=first).kind == "updated"
    asked = {"hits": "hits alone (only='hits')", None: "the whole answer"}
    line = f"the golden keeps {asked[first]}, the test asks for {asked[second]}"
    told = alone(tmp_path, shot(), only=second).message.splitlines()
    assert told[0] == line and "the hits are the same" in told
    told = alone(tmp_path, shot(duck=without(DUCK, 2, 5)), only=second).message.splitlines()
    assert told[0].startswith(f'{AT}: object 0 "duck": 22 px, was 23') and told[1] == line
    assert list(contents(tmp_path)) == files[first]
    assert alone(tmp_path, shot(), update=True, only=second).kind == "updated"
    assert list(contents(tmp_path)) == files[second]
    assert alone(tmp_path, shot(), only=second) == Outcome("same")


def test_the_picture_shows_the_hits_of_both(golden: Settle, tmp_path: Path) -> None:
    """Of a pixel that is no longer hit the picture differs from that of the same hits."""
    pictures = []
    for hits in (CHANGED["a pixel"][0], CHANGED["its cover"][0]):
        folder = tmp_path / FOLDER / golden(hits).failure["folder"]
        pictures.append(read_png(folder / "hits.png"))
    assert pictures[0].shape != pictures[1].shape or (pictures[0] != pictures[1]).any()


DAMAGE: dict[str, Callable[[dict[str, Any]], object]] = {
    "no rows": lambda report: report["shots"][0].pop("rows"),
    "no pixels": lambda report: report["shots"][0]["rows"][0].pop("pixels"),
    "a text for pixels": lambda report: report["shots"][0]["rows"][0].update(pixels="many"),
    "no place": lambda report: report["shots"][0]["rows"][0].update(first_xy=None),
    "a number for a row": lambda report: report["shots"][0].update(rows=[5]),
    "no batch": lambda report: report.pop("batch"),
    "a text for the batch": lambda report: report.update(batch="many"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_is_damaged_fails_by_name_and_is_repaired(golden: Settle, tmp_path: Path, damage: str) -> None:
    before, path = contents(tmp_path), tmp_path / "goldens" / "test_a" / "test_x.json"
    data = json.loads(path.read_text())
    DAMAGE[damage](data["report"])
    path.write_text(json.dumps(data))
    outcome = golden(pixels=1)
    assert outcome.kind == "failed" and f"{path}: expected a golden, got one that is damaged" in outcome.message
    assert golden(update=True).kind == "updated" and contents(tmp_path) == before


@pytest.mark.parametrize(
    ("only", "pixels", "px", "told"),
    [
        ("hit", 0, 0, r"only: expected one of 'hits', got 'hit' \(did you mean 'hits'\?\)"),
        (True, 0, 0, "only: expected one of 'hits', got True"),
        (None, 3, 0, "tolerance_pixels: expected together with only='hits', got 3 for a whole golden"),
        (None, 0, 2, "tolerance_px: expected together with only='hits', got 2 for a whole golden"),
        ("hits", -1, 0, "tolerance_pixels: expected a whole number from 0 to .*, got -1"),
        ("hits", 0, 0.5, "tolerance_px: expected a whole number from 0 to .*, got 0.5"),
        ("hits", True, 0, "tolerance_pixels: expected a whole number from 0 to .*, got True"),
    ],
)
def test_bad_arguments(only: Any, pixels: Any, px: Any, told: str) -> None:
    with pytest.raises(InputError, match=told):
        tolerance_of(only, pixels, px)


def test_hits_alone_have_no_planes(tmp_path: Path) -> None:
    one = type(call(tmp_path))(*list(vars(call(tmp_path)).values())[:7], "hits", EXACT)
    with pytest.raises(InputError, match="planes: expected none with only='hits', got 1"):
        settle(one, shot(), {"heat": np.zeros((2, 2))})


# A scene that has moved since


def test_a_scene_that_has_moved_is_told_by_what_has_changed() -> None:
    hits = shot()
    assert check_present(hits) is hits
    hits.scene.move(1, (9, 9))
    hits.scene.set(2, layer=3)
    told = (
        r'^hits: expected the scene at version 3, as it was fired at, got 5: changed since: object 1 "can", 2 "wall": '
    )
    with pytest.raises(InputError, match=told + "fire again, or compare before it changes$"):
        check_present(hits)
    for item in range(12):
        hits.scene.add(CAN, (item, 3))
    with pytest.raises(InputError, match=r"8 \"hittable 8\" and 6 more: fire again"):
        check_present(hits)
    for k in range(5000):
        hits.scene.move(0, (k, 0))
    with pytest.raises(InputError, match=r"got 5017(: changed since: .*)?: fire again"):
        check_present(hits)


@pytest.mark.parametrize("rest", ["", ", only='hit'", ", tolerance_px=3", ", name=''", ", planes=[1]"])
def test_a_scene_that_has_moved_is_told_before_anything_else(pytester: pytest.Pytester, rest: str) -> None:
    pytester.makepyfile(
        f"""
        from hitplanes import Disc, Scene, fire

        def test_a(hits_golden):
            scene = Scene((9, 9))
            scene.add([[1, 1]], (4, 4), name="duck")
            hits = fire(scene, Disc(2), (4, 4))
            scene.move(0, (5, 5))
            hits_golden(hits{rest})
        """
    )
    result = pytester.runpytest_inprocess("-p", "no:hypothesispytest", "--hits-update")
    result.assert_outcomes(failed=1)
    told = (
        '*InputError: hits: expected the scene at version 1, as it was fired at, got 2: changed since: object 0 "duck"'
    )
    result.stdout.fnmatch_lines([f"E {told}*"])


def test_the_fixture_takes_hits_alone(pytester: pytest.Pytester) -> None:
    text = """
        from hitplanes import Disc, Scene, fire

        def test_a(hits_golden):
            scene = Scene((9, 9))
            scene.add([[1, 1, {}]], (4, 4), name="duck")
            hits_golden(fire(scene, Disc(2), (4, 4)), only="hits", tolerance_pixels={}, tolerance_px=1)
        """
    for pixel, most, ret in ((1, 0, 1), (0, 0, 1), (0, 1, 0)):
        pytester.makepyfile(test_gun=text.format(pixel, most))
        if pixel:
            assert pytester.runpytest_inprocess("-p", "no:hypothesispytest", "--hits-update").ret == 0
            assert [p.name for p in (pytester.path / "goldens" / "test_gun").iterdir()] == ["test_a.json"]
            continue
        result = pytester.runpytest_inprocess("-p", "no:hypothesispytest", "--hits-stale")
        assert result.ret == ret
        if ret:
            result.stdout.fnmatch_lines(["E *shot 0: object 0: 1 px less, tolerance_pixels=0"])
