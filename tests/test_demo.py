"""The demo shows what a broad phase does, not what it might do: its cells, and the boxes that it compares."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from hitplanes import InputError
from hitplanes.planes.broadphase.boxes import BroadPhase, BruteForce, Work
from hitplanes.planes.common.checks import Image
from hitplanes.planes.files.png import read_png
from hitplanes.planes.grid.spans import meets
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.lab import demo
from hitplanes.weapons.lab import demo as animation
from hitplanes.weapons.lab.demo import KINDS, demo_frames, moments, write_demo

EACH = pytest.mark.parametrize("kind", KINDS)


@EACH
def test_both_steps_are_what_the_structure_does(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Work] = []
    work_of = BroadPhase.work

    def work(self: BroadPhase, boxes: object) -> Work:
        told.append(work_of(self, boxes))
        return told[-1]

    monkeypatch.setattr(BroadPhase, "work", work)
    for moment in moments(kind, 20):
        work = told[-1]
        assert set(moment.cells.number[moment.visited]) == set(work.visited[1])
        assert set(np.flatnonzero(moment.tested)) == set(work.tested[1])
        assert moment.nodes == work.compared >= moment.visited.sum() - 1, "the root of a quadtree is always looked into"
        assert moment.tests == work.tested.shape[1] >= moment.tested.sum()
        assert np.array_equal(np.flatnonzero(moment.found), BruteForce(moment.boxes).query(moment.query[None])[1])
        opened = demo._distinct(moment.cells.box[moment.entered])
        assert moment.cells.leaf[moment.entered].all() and meets(opened, moment.query).all()
        assert meets(moment.boxes[moment.tested][:, None], opened).any(axis=1).all(), "compared out of any open leaf"
    assert len(told) == 20


def test_cells_split_and_merge_as_boxes_move() -> None:
    for kind in ("quadtree", "grid"):
        leaves = np.array([len(np.unique(moment.cells.box[moment.cells.leaf], axis=0)) for moment in moments(kind, 40)])
        assert (np.diff(leaves) > 0).any() and (np.diff(leaves) < 0).any()
    assert len({moment.cells.box.tobytes() for moment in moments("bvh", 40)}) > 20


@EACH
def test_most_tests_are_saved(kind: str) -> None:
    all_moments = list(moments(kind, 20))
    assert sum(m.cost for m in all_moments) < 0.3 * sum(len(m.boxes) for m in all_moments)
    assert any(m.found.any() for m in all_moments)


def test_motion_is_steady_and_ends_where_it_began() -> None:
    boxes = np.array([moment.boxes for moment in moments("grid")])
    steps = np.diff(np.concatenate((boxes, boxes[:2])), axis=0)
    assert np.abs(steps).max() < 25
    bends = np.abs(steps[1:] - steps[:-1]).mean(axis=(1, 2))
    assert 0.5 < bends[-2:].max() / bends.mean() < 1.5, "the end does not lead to the beginning"


@EACH
def test_frames_are_the_same_each_time(kind: str) -> None:
    first, second = (list(demo_frames(kind, 3)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert len(first) == 3 and not np.array_equal(first[0], first[1])
    assert first[0].shape == (392, 640, 3) and first[0].dtype == np.uint8


def alone(moment: demo.Moment) -> np.ndarray:
    """Boxes with no other one near, and not where the query's frame is drawn: their middles show one colour."""
    wide = moment.boxes + np.array([-4, -4, 4, 4])
    others = meets(wide[:, None], wide).sum(axis=1) - 1
    inner, outer = moment.query + np.array([5, 5, -5, -5]), moment.query + np.array([-5, -5, 5, 5])
    on_frame = meets(moment.boxes, outer) & ~(
        (moment.boxes[:, :2] >= inner[:2]) & (moment.boxes[:, 2:] <= inner[2:])
    ).all(axis=1)
    return (others == 0) & ~on_frame


@EACH
def test_what_is_compared_and_what_is_found_look_different(kind: str) -> None:
    seen = set()
    for moment in moments(kind, 16):
        pane = demo._second_step(moment)
        for number in np.flatnonzero(alone(moment)):
            x, y = np.rint((moment.boxes[number, :2] + moment.boxes[number, 2:]) / 2).astype(int)
            patch = pane[max(y - 8, 0) : y + 9, max(x - 8, 0) : x + 9].reshape(-1, 3)
            middle = tuple(pane[y, x])
            state = "found" if moment.found[number] else "tested" if moment.tested[number] else "rest"
            seen.add(state)
            if state == "tested":
                assert middle != demo.TESTED and np.abs(patch.astype(int) - demo.TESTED).sum(axis=1).min() < 120
            else:
                assert middle == (demo.FOUND if state == "found" else demo.REST)
    assert seen == {"found", "tested", "rest"}


@EACH
def test_opened_leaves_are_filled_and_outlined(kind: str) -> None:
    for moment in moments(kind, 6):
        pane = demo._first_step(moment)
        plain = np.array(demo.CARD, np.uint8)
        inside = np.zeros(pane.shape[:2], np.bool_)
        for box in np.rint(np.clip(moment.cells.box[moment.entered], 0, 300)).astype(int):
            inside[box[1] : box[3] + 1, box[0] : box[2] + 1] = True
        assert inside.any()
        assert not (pane[inside] == plain).all(axis=1).any(), "an opened leaf has the colour of the ground"
        once = (np.array(demo.CARD) * (255 - demo.TINT) + np.array(demo.VISITED) * demo.TINT + 127) // 255
        twice = (once * (255 - demo.TINT) + np.array(demo.VISITED) * demo.TINT + 127) // 255
        assert (pane[inside] == once).all(axis=1).any()
        assert kind == "bvh" or not (pane[inside] == twice).all(axis=1).any(), "a cell was filled twice"
        blue = (pane == demo.VISITED).all(axis=2)
        assert blue.any() and not (blue & ~inside).any()


@EACH
def test_the_counters_add_up(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    monkeypatch.setattr(demo, "draw_texts", lambda page, every: texts.extend(text.text for text in every))
    all_moments = list(moments(kind, 5))
    demo.picture_of(kind, all_moments, 5)
    now = all_moments[-1]
    opened = {tuple(box) for box in now.cells.box[now.entered].tolist() if box[0] <= box[2]}
    living = {tuple(box) for box in now.cells.box[now.cells.leaf].tolist() if box[0] <= box[2]}
    word = "cells" if kind == "grid" else "nodes"
    assert f"{now.tests} boxes + {now.nodes} {word}" in texts and "300 boxes" in texts
    assert "tests saved so far" in texts
    word = "cells" if kind == "grid" else "leaves"
    assert f"1  find the {word}: {len(opened)} of {len(living)}" in texts
    assert f"2  compare within them: {now.found.sum()} found" in texts
    assert f"{100 - sum(m.nodes + m.tests for m in all_moments) / 15:.1f} %" in texts


@EACH
def test_the_bar_has_a_part_for_what_is_found_for_boxes_and_for_nodes(kind: str) -> None:
    all_moments = list(moments(kind, 16))
    now, page = all_moments[-1], demo.picture_of(kind, all_moments, 16)
    top, left = demo.TOP + demo.HEIGHT + 72, demo.MARGIN + demo.NAME
    bar = page[top, left : left + demo.BAR]
    ends = [round(demo.BAR * count / 300) for count in (0, now.found.sum(), now.tests, now.tests + now.nodes)]
    for color, first, last in zip((demo.FOUND, demo.TESTED, demo.VISITED), ends, ends[1:], strict=False):
        assert (bar[first:last] == color).all()
    assert ends[3] > ends[2] > 0 and (bar[ends[3]] == demo.PAGE_GROUND).all()


@pytest.mark.skipif(not animation.can_write_gif(), reason="this OpenCV writes no GIF")
@EACH
def test_a_gif_shows_the_frames(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.GIF"
    assert write_demo(kind, path, 3) == path and list(tmp_path.iterdir()) == [path]
    good, read = cv2.imreadanimation(str(path))
    assert good and len(read.frames) == 3 and read.loop_count == 0 and set(read.durations) == {demo.MILLISECONDS}
    for got, due in zip(read.frames, demo_frames(kind, 3), strict=True):
        far = np.abs(got[:, :, 2::-1].astype(int) - due)
        assert far.mean() < 1 and np.mean(far > 24) < 0.002
    assert path.stat().st_size < 3 * 26_000, "80 frames would take more than 2 MB"


def test_a_folder_gets_numbered_pictures(tmp_path: Path) -> None:
    assert write_demo("bvh", tmp_path / "frames", 3) == tmp_path / "frames"
    names = sorted(path.name for path in (tmp_path / "frames").iterdir())
    assert names == ["000.png", "001.png", "002.png"]
    for name, due in zip(names, demo_frames("bvh", 3), strict=True):
        assert np.array_equal(read_png(tmp_path / "frames" / name)[:, :, :3], due)


def test_where_no_gif_can_be_written_pictures_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "haveImageWriter", lambda name: False)
    assert write_demo("grid", tmp_path / "a.gif", 2) == tmp_path / "a"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["000.png", "001.png", "a"]
    with pytest.raises(InputError, match="writes no GIF"):
        animation.write_gif(tmp_path / "b.gif", demo_frames("grid", 1), 50)


def interrupted(kind: str, frames: int) -> Iterator[Image]:
    yield np.zeros((4, 4, 3), np.uint8)
    raise KeyboardInterrupt


@pytest.mark.parametrize("name", ["a.gif", "frames", "there"])
def test_an_interrupt_leaves_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "there").mkdir()
    monkeypatch.setattr(demo, "demo_frames", interrupted)
    assert main(["demo", "grid", "-o", str(tmp_path / name)]) == 130
    assert capsys.readouterr().err == "hitplanes: interrupted\n"
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


@pytest.mark.parametrize(
    ("output", "told"),
    [
        ("no/such/a.gif", "output: cannot write" if animation.can_write_gif() else "folder: cannot make"),
        ("no/such", "cannot make"),
        ("a.mp4", "--output: expected a name that ends in .gif, or of a folder, without an ending, got 'a.mp4'"),
        ("full", "expected a new or empty folder"),
        ("file", "expected a new folder, got the file"),
    ],
)
def test_a_bad_output_is_one_line(
    output: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "000.png").write_text("mine")
    (tmp_path / "file").write_text("mine")
    monkeypatch.setattr(demo, "picture_of", lambda *_: pytest.fail("drawn before the output was looked at"))
    assert main(["demo", "quadtree", "-o", str(tmp_path / output)]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1
    assert (tmp_path / "full" / "000.png").read_text() == "mine"


@EACH
def test_the_command_says_where_it_is(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hitplanes.weapons.lab.demo.write_demo", partial(write_demo, frames=1))
    assert main(["demo", kind, "-o", str(tmp_path / "x")]) == 0
    name = {"bvh": "BVH"}.get(kind, kind)
    assert capsys.readouterr().out == f"a {name} in motion is in {tmp_path / 'x'}\n"


@pytest.mark.parametrize("frames", [0, -1, 1.5])
def test_no_frames_are_refused(frames: int) -> None:
    with pytest.raises(InputError, match="frames: expected a whole number from 1"):
        next(demo_frames("grid", frames))


def test_a_folder_that_is_there_may_have_a_dot_in_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.frames").mkdir()
    assert write_demo("grid", tmp_path / "a.frames", 1) == tmp_path / "a.frames"


def test_an_unknown_structure_is_named() -> None:
    with pytest.raises(InputError, match="kind: expected one of 'quadtree', 'grid', 'bvh', got 'octree'"):
        next(moments("octree"))
