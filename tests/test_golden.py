"""The fixture hits_golden: it fails when a single pixel moves, says what changed, and touches only what it should."""

from __future__ import annotations

import dataclasses
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from some_of import some_of

from hitplanes import Disc, Hits, InputError, Scene, Sprite, fire, read_png
from hitplanes.planes.files.png import write_png
from hitplanes.weapons.golden.check import (
    FOLDER,
    PAGE,
    RED,
    Call,
    Outcome,
    claimed,
    note_files,
    replace_page,
    safe_name,
    scene_of,
    settle,
)
from hitplanes.weapons.golden.file import golden_of, pixels_unlike, unlike

ROOT = Path(__file__).parents[1]

DUCK, CAN, WALL = np.ones((6, 6), np.bool_), np.ones((4, 3), np.bool_), np.ones((2, 6), np.bool_)


def without(mask: np.ndarray[Any, Any], x: int, y: int) -> np.ndarray[Any, Any]:
    out = mask.copy()
    out[y, x] = False
    return out


def shot(
    duck: Any = DUCK, can: Any = CAN, wall: Any = WALL, width: int = 48, color: tuple[int, int, int] = (9, 90, 9)
) -> Hits:
    """A blast at a duck half behind a wall; the can is too far away to be told of."""
    scene = Scene((width, 16))
    scene.add(Sprite.from_mask(duck, color=color), (6, 8), name="duck")
    scene.add(can, (44, 8), name="can")
    scene.add(wall, (6, 6), role="occluder", layer=1, name="wall")
    return fire(scene, Disc(4), (6, 8))


def call(folder: Path, *, update: bool = False) -> Call:
    base = folder / "goldens" / "test_a" / "test_x"
    return Call("t/test_a.py::test_x", "test_a.py::test_x", None, base, folder, folder, update)


@pytest.fixture
def golden(tmp_path: Path) -> Callable[..., Outcome]:
    """Accept the shot as it is; then compare others with it."""
    plane = {"heat": np.arange(6, dtype=np.float32).reshape(2, 3)}
    assert settle(call(tmp_path, update=True), shot(), plane).kind == "updated"

    def compare(hits: Hits | None = None, planes: Any = plane, *, update: bool = False) -> Outcome:
        return settle(call(tmp_path, update=update), shot() if hits is None else hits, planes)

    return compare


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted((folder / "goldens" / "test_a").iterdir())}


# One call


def test_what_was_accepted_is_the_same(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    before = contents(tmp_path)
    assert sorted(before) == ["test_x.json", "test_x.npz", "test_x.png"]
    assert golden() == Outcome("same")
    assert golden(update=True) == Outcome("same")
    assert contents(tmp_path) == before
    assert not (tmp_path / FOLDER).exists()


def test_files_are_the_same_bytes_at_any_time(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    before = contents(tmp_path)
    (tmp_path / "goldens" / "test_a" / "test_x.json").unlink()
    assert golden(update=True).kind == "updated"
    assert contents(tmp_path) == before
    with np.load(tmp_path / "goldens" / "test_a" / "test_x.npz", allow_pickle=False) as planes:
        assert sorted(planes) == ["heat", "hittable", "occluders"]
    lines = before["test_x.json"].decode().splitlines()
    assert len(lines) > 20 and sum('"name": "duck"' in line and '"pixels"' in line for line in lines) == 1


AT = "shot 0 (disc at 6, 8)"


@pytest.mark.parametrize(
    ("hits", "planes", "lines"),
    [
        (
            shot(duck=without(DUCK, 2, 5)),
            None,
            [
                f'{AT}: object 0 "duck": 22 px, was 23; lost at (6, 11)',
                f"{AT}: verdicts: 15 empty, was 14; 22 hit, was 23",
                "plane 'hittable': pixels differ: 1, first at (6, 11): nothing, was object 0 \"duck\"",
                "picture: pixels differ: ",
            ],
        ),
        (
            shot(can=without(CAN, 2, 3)),
            None,
            [
                "plane 'hittable': pixels differ: 1, first at (45, 10): nothing, was object 1 \"can\"",
                "picture: pixels differ: ",
            ],
        ),
        (
            shot(wall=without(WALL, 0, 0)),
            None,
            [
                f'{AT}: object 0 "duck": 24 px, was 23; gained at (4, 6)',
                "plane 'occluders': pixels differ: 1, first at (4, 6): nothing, was object 2 \"wall\"",
            ],
        ),
        (
            shot(width=49),
            None,
            [
                "scene: bounds_xyxy [0, 0, 48, 15], was [0, 0, 47, 15]",
                "plane 'hittable': shape (16, 49), was (16, 48)",
                "plane 'occluders': shape (16, 49), was (16, 48)",
                "picture: ",
            ],
        ),
        (shot(color=(9, 91, 9)), None, ["picture: pixels differ: "]),
        (shot(), {"heat": np.arange(6, dtype=np.float64).reshape(2, 3)}, ["plane 'heat': dtype float64, was float32"]),
        (
            shot(),
            {"heat": np.array([[0, 1, 2], [3, 4, 6]], np.float32)},
            ["plane 'heat': pixels differ: 1, first at (2, 1): 6.0, was 5.0"],
        ),
        (shot(), {"heat": np.zeros((3, 2), np.float32)}, ["plane 'heat': shape (3, 2), was (2, 3)"]),
        (shot(), {}, ["plane 'heat' is missing"]),
    ],
    ids=["object", "object not shot at", "verdict", "size", "colour", "dtype", "value", "shape", "plane"],
)
def test_the_least_change_fails_and_is_told(
    golden: Callable[..., Outcome], tmp_path: Path, hits: Hits, planes: Any, lines: list[str]
) -> None:
    before = contents(tmp_path)
    outcome = golden(hits) if planes is None else golden(hits, planes)
    assert outcome.kind == "failed"
    told = outcome.message.splitlines()
    found = [next((i for i, other in enumerate(told) if other.startswith(line)), None) for line in lines]
    assert None not in found and found == sorted(found), told
    assert sum(line.startswith(("shot", "plane")) for line in told) >= sum(
        line.startswith(("shot", "plane")) for line in lines
    )
    assert told[0].startswith(lines[0])
    if not lines[0].startswith(("shot", "scene")):
        assert not any(line.startswith("shot") for line in told)
    assert told[-3:] == [
        "golden: goldens/test_a/test_x.json", f"look: {FOLDER}/{PAGE}", "accept: run again with --hits-update",
    ]  # fmt: skip
    assert contents(tmp_path) == before


def test_what_fails_is_drawn(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    failure = golden(shot(duck=without(DUCK, 2, 5))).failure
    folder = tmp_path / FOLDER / failure["folder"]
    drawn = {file for row in failure["rows"] for _, file in row} | set(failure["texts"])
    assert drawn == {p.name for p in folder.iterdir()} == {
        "expected.json", "got.json", "hits.png", "expected.png", "got.png", "difference.png", "crop.png",
        "plane-0-difference.png", "plane-0-crop.png",
    }  # fmt: skip
    red = (read_png(folder / "plane-0-difference.png")[:, :, :3] == RED).all(axis=2)
    assert np.argwhere(red).tolist() == [[11, 6]]
    crop = read_png(folder / "plane-0-crop.png")[:, :, :3]
    red = (crop == RED).all(axis=2)
    factor = int(np.sqrt(red.sum()))
    rows, columns = np.nonzero(red)
    assert factor > 1 and red.sum() == factor**2 and np.ptp(rows) == np.ptp(columns) == factor - 1
    expected, got = (read_png(folder / name)[:, :, :3] for name in ("expected.png", "got.png"))
    differ = (expected != got).any(axis=2)
    red = (read_png(folder / "difference.png")[:, :, :3] == RED).all(axis=2)
    assert differ.any() and (red == differ).all()
    assert json.loads((folder / "expected.json").read_text())["report"]["shots"][0]["rows"][0]["pixels"] == 23
    assert json.loads((folder / "got.json").read_text())["report"]["shots"][0]["rows"][0]["pixels"] == 22


@pytest.mark.parametrize("channel", [0, 3])
def test_one_pixel_of_the_picture_is_red(golden: Callable[..., Outcome], tmp_path: Path, channel: int) -> None:
    """Also if only its transparency has changed."""
    path = tmp_path / "goldens" / "test_a" / "test_x.png"
    picture = read_png(path)
    picture[400, 300, channel] ^= 1
    write_png(path, picture)
    outcome = golden()
    assert outcome.message.startswith("picture: pixels differ: 1, in the box (300, 400) to (300, 400)")
    folder = tmp_path / FOLDER / outcome.failure["folder"]
    difference, crop = (read_png(folder / name)[:, :, :3] for name in ("difference.png", "crop.png"))
    assert np.argwhere((difference == RED).all(axis=2)).tolist() == [[400, 300]]
    assert (crop == RED).all(axis=2).sum() == 4**2, "enlarged"
    assert not (folder / "hits.png").exists()
    assert "\nthe hits are the same\n" in outcome.message
    assert golden(update=True).kind == "updated" and golden().kind == "same"


def test_a_picture_that_grew_is_told(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    path = tmp_path / "goldens" / "test_a" / "test_x.png"
    picture = read_png(path)
    write_png(path, picture[:-1])
    height, width = picture.shape[:2]
    outcome = golden()
    assert outcome.message.startswith(f"picture: {width} x {height} px, was {width} x {height - 1}")
    difference = read_png(tmp_path / FOLDER / outcome.failure["folder"] / "difference.png")[:, :, :3]
    assert ((difference == RED).all(axis=2) == (np.arange(height) == height - 1)[:, None]).all()


def pickled(path: Path) -> None:
    np.savez(path, hittable=np.array([{}], object), occluders=np.zeros((1, 1)), heat=np.zeros((1, 1)))


DAMAGE: dict[str, tuple[str, Callable[[Path], object]]] = {
    "a merge": ("json", lambda p: p.write_bytes(b"<<<<<<< ours\n" + p.read_bytes())),
    "half a json": ("json", lambda p: p.write_bytes(p.read_bytes()[:-9])),
    "no utf-8": ("json", lambda p: p.write_bytes(b"\xff\xfe")),
    "deep json": ("json", lambda p: p.write_text("[" * 100_000)),
    "no report": ("json", lambda p: p.write_text(p.read_text().replace('"report"', '"reports"'))),
    "a report of another form": (
        "json", lambda p: p.write_text(json.dumps({**json.loads(p.read_text()), "report": 5})),
    ),
    "planes of another form": (
        "json", lambda p: p.write_text(json.dumps({**json.loads(p.read_text()), "planes": [5]})),
    ),
    "no archive": ("npz", lambda p: p.unlink()),
    "half an archive": ("npz", lambda p: p.write_bytes(p.read_bytes()[:-40])),
    "another archive": ("npz", lambda p: p.write_bytes(b"PK\x05\x06")),
    "a changed archive": ("npz", lambda p: p.write_bytes(p.read_bytes().replace(b"\x93", b"\x92").replace(b"x", b"y"))),
    "a pickle": ("npz", pickled),
    "no picture": ("png", lambda p: p.unlink()),
    "another picture": ("png", lambda p: p.write_text("no picture")),
    "a folder": ("png", lambda p: (p.unlink(), p.mkdir())),
}  # fmt: skip


@pytest.mark.parametrize("damage", some_of(DAMAGE))
def test_what_is_damaged_fails_by_name_and_is_repaired(
    golden: Callable[..., Outcome], tmp_path: Path, damage: str
) -> None:
    before = contents(tmp_path)
    kind, do = DAMAGE[damage]
    path = tmp_path / "goldens" / "test_a" / f"test_x.{kind}"
    do(path)
    outcome = golden()
    assert outcome.kind == "failed" and str(path) in outcome.message.splitlines()[0]
    assert len(outcome.message.splitlines()) == 4
    assert (tmp_path / FOLDER / outcome.failure["folder"] / "got.png").is_file()
    if path.is_dir():
        path.rmdir()
    assert golden(update=True).kind == "updated"
    assert contents(tmp_path) == before and golden().kind == "same"


def test_planes_that_are_missing_are_not_called_damaged(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    path = tmp_path / "goldens" / "test_a" / "test_x.npz"
    path.unlink()
    assert golden().message.splitlines()[0] == f"{path}: expected the planes of a golden, got no file"


def test_half_a_picture_fails(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    path = tmp_path / "goldens" / "test_a" / "test_x.png"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert golden().kind == "failed"
    assert golden(update=True).kind == "updated" and golden().kind == "same"


@pytest.mark.parametrize(
    ("written", "told"),
    [('"hitplanes-golden/2"', "made by a newer hitplanes"), ('"a-game/7"', "no golden"), ("null", "no golden")],
)
def test_a_newer_format_is_left_alone(golden: Callable[..., Outcome], tmp_path: Path, written: str, told: str) -> None:
    path = tmp_path / "goldens" / "test_a" / "test_x.json"
    path.write_text(path.read_text().replace('"hitplanes-golden/1"', written))
    before = contents(tmp_path)
    for update in (False, True):
        outcome = golden(shot(width=50), update=update)
        assert outcome.kind == "failed"
        assert str(path) in outcome.message and told in outcome.message
        assert "accept" not in outcome.message
    assert contents(tmp_path) == before


def test_an_update_writes_the_files_that_differ(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    files = sorted((tmp_path / "goldens" / "test_a").iterdir())
    for path in files:
        os.utime(path, (1, 1))
    assert golden(shot(color=(1, 2, 3)), update=True).kind == "updated"
    assert [path.suffix for path in files if path.stat().st_mtime > 1] == [".png"]
    assert golden(shot(color=(1, 2, 3))).kind == "same"


def test_large_scenes_keep_no_planes(tmp_path: Path) -> None:
    scene = Scene((3000, 2000))
    scene.add(Sprite.circle(4), (6, 8), name="duck")
    hits = fire(scene, Disc(3), (6, 8))
    assert settle(call(tmp_path, update=True), hits, {}).kind == "updated"
    assert sorted(contents(tmp_path)) == ["test_x.json", "test_x.png"]
    assert "left out: 3000 x 2000 px are more than 4194304" in contents(tmp_path)["test_x.json"].decode()
    assert settle(call(tmp_path), hits, {}).kind == "same"


def test_a_world_that_moved_as_a_whole_is_told() -> None:
    """Without bounds its planes are the same arrays elsewhere."""
    goldens = []
    for x in (0, 5):
        scene = Scene()
        scene.add(DUCK, (x, 8), name="duck")
        goldens.append(golden_of(fire(scene, Disc(4), (90, 90)), {}, "t", None))
    assert "planes of the scene begin at (3, 6), was (-2, 6)" in unlike(*goldens).lines


def test_pixels_of_planes_are_told_by_their_place_in_the_world() -> None:
    goldens = []
    for mask in (DUCK, without(DUCK, 2, 3)):
        scene = Scene()
        scene.add(mask, (-100, 70), name="duck")
        goldens.append(golden_of(fire(scene, Disc(4), (9, 9)), {}, "t", None))
    changed = "plane 'hittable': pixels differ: 1, first at (-100, 71): nothing, was object 0 \"duck\""
    assert changed in unlike(*goldens).lines


def test_planes_are_compared_exactly() -> None:
    nan = np.array([[np.nan, 0.0], [np.inf, 1.0]])
    assert not pixels_unlike(nan, nan).any()
    assert pixels_unlike(nan, np.array([[0, 0.0], [np.inf, np.nextafter(1.0, 2.0)]])).tolist() == [
        [True, False],
        [False, True],
    ]
    image = np.zeros((2, 2, 4), np.uint8)
    other = image.copy()
    other[1, 0, 3] = 1
    assert pixels_unlike(image, other).tolist() == [[False, False], [True, False]]


@pytest.mark.parametrize(
    ("hits", "planes", "told"),
    [
        ([1], {}, "hits: expected Hits, as fire returns them, got list"),
        (None, {}, "hits: expected Hits, as fire returns them, got NoneType"),
        (shot(), [1], "planes: expected arrays by name, got list"),
        (shot(), {"occluders": DUCK}, "planes: expected a name other than hittable and occluders, got 'occluders'"),
        (shot(), {"": DUCK}, "planes: expected a text of 1 to 200 characters"),
        (
            shot(),
            {"a": np.zeros(3)},
            r"planes\['a'\]: expected numbers \(h, w\) or \(h, w, channels\), got shape \(3,\)",
        ),
        (shot(), {"a": np.array([["x"]])}, r"planes\['a'\]: expected numbers"),
        (shot(), {"a": np.zeros((0, 3))}, r"planes\['a'\]: expected numbers"),
    ],
)
def test_bad_arguments(tmp_path: Path, hits: Any, planes: Any, told: str) -> None:
    with pytest.raises(InputError, match=told):
        settle(call(tmp_path), hits, planes)


def test_hits_of_a_scene_that_changed(tmp_path: Path) -> None:
    hits = shot()
    hits.scene.move(0, (9, 9))
    with pytest.raises(InputError, match='changed since: object 0 "duck": fire again'):
        settle(call(tmp_path), hits, {})


def test_any_name_of_a_plane_is_kept(tmp_path: Path) -> None:
    planes = {name: np.full((1, 2), i) for i, name in enumerate(("file", "allow_pickle", "a/b", "../c", "Ä", "heat\n"))}
    assert settle(call(tmp_path, update=True), shot(), planes).kind == "updated"
    assert settle(call(tmp_path), shot(), planes).kind == "same"
    changed = {name: plane + 1 for name, plane in planes.items()}
    outcome = settle(call(tmp_path), shot(), changed)
    assert outcome.message.count("pixels differ: 2") == len(planes)
    assert {p.parent for p in tmp_path.rglob("*.png")} == {
        tmp_path / "goldens" / "test_a",
        tmp_path / FOLDER / outcome.failure["folder"],
    }


# Names

TESTS = st.from_regex(r"\A(Test[A-Za-z]{0,3}::)?test_[a-zA-Z_é]{0,4}(\[[ -~]{0,5}\])?\Z") | st.text(max_size=100)
NAMES = st.none() | st.text(min_size=1, max_size=4) | st.from_regex(r"\A[a-z-]{0,3}-[0-9a-f]{10}\Z")


@given(st.lists(st.tuples(TESTS, NAMES), unique=True, max_size=8))
@examples(34, deadline=None)
def test_no_two_tests_share_a_file(ids: list[tuple[str, str | None]]) -> None:
    like = safe_name("test_b[a/b]").removeprefix("test_b-")
    ids += [("test_x", None), ("test_X", None), ("test_x", "a"), ("test_x-a", None), ("test_b[a/b]", None)]
    ids += [("test_b", like), (safe_name("test_X"), None)]
    names = [safe_name(test, name).casefold() for test, name in dict.fromkeys(ids)]
    assert len(set(names)) == len(names)
    for name in names:
        assert re.fullmatch(r"[a-z0-9_.,=+\[\]-]{1,100}", name)
        assert name[0] not in ".-" and name[-1] != "." and name.split(".")[0] not in ("con", "nul", "com1")


def test_names_that_are_simple_are_files_as_they_are() -> None:
    assert safe_name("test_blast") == "test_blast"
    assert safe_name("test_blast", "second") == "test_blast-second"
    assert safe_name("test_blast[32-1.5]") == "test_blast[32-1.5]"
    assert re.fullmatch(r"TestGun-test_blast-[0-9a-f]{10}", safe_name("TestGun::test_blast"))
    assert re.fullmatch(r"test_blast-a-b-[0-9a-f]{10}", safe_name("test_blast[a/b]"))
    assert re.fullmatch(r"con-[0-9a-f]{10}", safe_name("con"))


# The folder of failures


def test_of_the_folder_only_our_files_are_deleted(tmp_path: Path) -> None:
    folder = tmp_path / FOLDER
    assert claimed(folder) and claimed(folder)
    (folder / "one").mkdir()
    note_files(folder, ["one/got.png", "one/never written.png", "../beside", "/abs", "one/../../beside"])
    for path in (folder / "one" / "got.png", folder / "one" / "mine.txt", folder / "mine.txt", tmp_path / "beside"):
        path.write_text("x")
    assert not replace_page(folder, [])
    left = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file())
    assert left == ["beside", f"{FOLDER}/mine.txt", f"{FOLDER}/one/mine.txt"]
    assert not claimed(folder), "what is left is somebody else's"


def test_a_folder_of_somebody_else_is_not_written_to(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    folder = tmp_path / FOLDER
    folder.mkdir()
    (folder / "mine.txt").write_text("x")
    outcome = golden(shot(width=50))
    assert "scene: bounds_xyxy" in outcome.message
    assert f"look: nowhere: {FOLDER} is there, and not ours: move or remove it\n" in outcome.message
    assert not replace_page(folder, [outcome.failure])
    assert [p.name for p in folder.iterdir()] == ["mine.txt"]
    (folder / "mine.txt").unlink()
    assert FOLDER + "/" + PAGE in golden(shot(width=50)).message, "an empty one is nobody's"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["goldens", FOLDER]


def test_a_folder_of_hidden_files_is_taken_and_keeps_them(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    folder, hidden = tmp_path / FOLDER, {f"{FOLDER}/.DS_Store", f"{FOLDER}/one/.DS_Store"}
    (folder / "one").mkdir(parents=True)
    for path in hidden:
        (tmp_path / path).write_text("x")
    for _ in range(2):
        outcome = golden(shot(width=50))
        assert f"look: {FOLDER}/{PAGE}" in outcome.message
        assert replace_page(folder, [outcome.failure])
        assert not replace_page(folder, [])
        assert {p.relative_to(tmp_path).as_posix() for p in folder.rglob("*") if p.is_file()} == hidden
    (folder / ".gitignore").write_text("mine")
    assert not claimed(folder) and (folder / ".gitignore").read_text() == "mine"


def test_the_page_shows_words_then_pictures_and_needs_nothing_else(
    golden: Callable[..., Outcome], tmp_path: Path
) -> None:
    failure = golden(shot(duck=without(DUCK, 2, 5))).failure
    nasty = {**failure, "test": "test_a.py::<script>[&]", "lines": [*failure["lines"], "</pre><img src=x>"]}
    assert replace_page(tmp_path / FOLDER, [nasty, failure])
    page = (tmp_path / FOLDER / PAGE).read_text(encoding="utf-8")
    assert "<h1>2 goldens failed</h1>" in page and "&lt;script&gt;[&amp;]" in page
    assert "<script" not in page and "http" not in page and "<img src=x" not in page
    assert page.index("22 px, was 23") < page.index('<img src="')
    linked = re.findall(r'(?:src|href)="([^"#]+)"', page)
    assert len(linked) > 10 and all((tmp_path / FOLDER / path).is_file() for path in linked)


def test_all_objects_that_a_plane_has_changed_are_named(golden: Callable[..., Outcome]) -> None:
    message = golden(shot(duck=without(DUCK, 0, 5), can=without(CAN, 0, 0))).message
    assert 'plane \'hittable\': changed: object 0 "duck", object 1 "can"\n' in message
    assert "changed:" not in golden(shot(can=without(CAN, 0, 0))).message, "one is named already"


def test_what_was_expected_is_drawn_on_what_was_there(golden: Callable[..., Outcome], tmp_path: Path) -> None:
    """The scene of a golden is not kept, but its planes are: under the same ids, where they were."""
    scene = Scene((48, 16))
    scene.add(np.ones((16, 48), np.bool_), (24, 8), role="background")  # so that the ids of the others have gaps
    scene.add(DUCK, (6, 8))
    scene.add(DUCK, (5, 8), role="mover")
    scene.add(WALL, (6, 6), role="occluder", layer=1)
    kept = golden_of(fire(scene, Disc(4), (6, 8)), {}, "test_a.py::test_x", None)
    left = scene_of(kept)
    assert left is not None
    for name in ("hittable", "occluders"):
        again = getattr(left.planes(), name)
        x, y, *_ = left.extent()
        rows, columns = np.nonzero(kept.planes[name])
        assert np.array_equal(again[rows - y, columns - x], kept.planes[name][rows, columns])
        assert (again > 0).sum() == len(rows)
    assert scene_of(dataclasses.replace(kept, planes={})) is None
    outcome = golden(shot(duck=without(DUCK, 2, 5)))
    picture = read_png(tmp_path / FOLDER / outcome.failure["folder"] / "hits.png")
    wide = (picture.shape[1] - 2 * 16 - 2 * 12) // 3
    assert len(np.unique(picture[44:400, 16 : 16 + wide].reshape(-1, 4), axis=0)) > 8, "more than an empty ground"


COMMANDS = "".join(map(chr, (0x1B, 0x7F, *range(0x80, 0xA0), 0x61C, 0x200E, 0x200F, *range(0x2028, 0x202F)))) + (
    "".join(map(chr, range(0x2066, 0x206A)))
)
"""What a terminal or a page obeys: control characters, line breaks, marks of the direction of writing."""


def test_no_name_speaks_to_the_terminal_or_the_page(tmp_path: Path) -> None:
    node = f"t/test_a.py::test_{COMMANDS}"
    for name, mask, update in ((f"can {COMMANDS}", CAN, True), (f"can{COMMANDS}", without(CAN, 0, 0), False)):
        scene = Scene((16, 16), name=name)
        scene.add(mask, (8, 8), name=name)
        base = tmp_path / f"goldens{COMMANDS}" / "test_x"
        one = Call(node, node, None, base, tmp_path, tmp_path, update)
        plane = {f"heat{COMMANDS}": np.full((2, 2), int(update))}
        outcome = settle(one, fire(scene, Disc(4), (8, 8)), plane)
    assert outcome.kind == "failed" and r"\x7f" in outcome.message and r"\u202e" in outcome.message
    assert not set(COMMANDS) & set(outcome.message)
    assert replace_page(tmp_path / FOLDER, [outcome.failure, outcome.failure])
    page = (tmp_path / FOLDER / PAGE).read_text(encoding="utf-8")
    assert not set(COMMANDS) & set(page)
    assert all(told in page for told in (r"plane heat\x1b", r"test_\x1b", r"goldens\x1b", r"can\u001b\x7f"))
