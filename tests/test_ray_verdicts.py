"""Cells of rays by verdict, counted without a list of them: as many as in the list, which other tests judge."""

from __future__ import annotations

import pickle
import random
from copy import copy
from typing import Any

import numpy as np
import pytest
from some_of import some_of

from hitplanes import (
    History,
    Hits,
    InputError,
    Laser,
    Pistol,
    Projectile,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sweep,
    Verdict,
    Weapon,
    fire,
    prepare,
)  # fmt: skip
from hitplanes.planes.grid.rasterize import DIAGONAL, Lines, cells_of
from hitplanes.weapons.explain import ray_verdicts
from hitplanes.weapons.explain.ray_verdicts import cells_in
from hitplanes.weapons.rays.contacts import Reason, Terminations

RADII = (0, 50, 128, DIAGONAL - 1, DIAGONAL, 200, 256, 640)


def lines_of(rng: np.random.Generator, n: int, radius: int) -> Lines:
    """Lines of all kinds: on borders of pixels and beside them, along axes and diagonals, through corners, points."""
    start = np.where(rng.random((n, 2)) < 0.5, rng.choice([-128, 0, 127], (n, 2)), rng.integers(-128, 128, (n, 2)))
    kinds = [
        rng.integers(-2000, 2001, (n, 2)), 128 * rng.integers(-8, 9, (n, 2)), rng.integers(-3, 4, (n, 2)),
        rng.integers(-60, 61, (n, 2)) * rng.integers(1, 60, (n, 1)),
    ]  # fmt: skip
    step = np.choose(rng.integers(0, 4, (n, 1)), kinds)
    return Lines(start, step, radius)


def counted_one_by_one(lines: Lines, box_xyxy: np.ndarray, ends: Terminations | None = None) -> np.ndarray:
    line, xy, entry, _, _ = cells_of(lines.start, lines.start + lines.step, lines.radius)
    on = ((xy >= box_xyxy[line, :2]) & (xy <= box_xyxy[line, 2:])).all(axis=1)
    if ends is not None:
        on &= ends.reaches(line, entry, xy[:, 1], xy[:, 0])
    return np.bincount(line[on], minlength=len(lines))


def some_ends(rng: np.random.Generator, lines: Lines) -> Terminations:
    """Ends in a cell of each line, by an occluder or a hit, or between two cells, by a budget."""
    line, xy, entry, _, _ = cells_of(lines.start, lines.start + lines.step, lines.radius)
    order = rng.permutation(len(line))
    last = order[np.unique(line[order], return_index=True)[1]]
    reason = rng.choice([Reason.OCCLUDER, Reason.HITS, Reason.BUDGET], len(lines))
    x, y, one = xy[last, 0], xy[last, 1], np.zeros(len(lines))
    return Terminations(reason, entry[last], y, x, one.astype(np.int64), rng.random(len(lines)) < 0.5, one)


@pytest.mark.parametrize("radius", RADII)
def test_cells_are_counted_as_they_are_listed(radius: int) -> None:
    """In boxes that hold the whole line, a part of it, or nothing; and before ends."""
    rng = np.random.default_rng(radius)
    for _ in range(4):
        lines = lines_of(rng, 300, radius)
        extent = lines.box_xyxy
        box = np.sort(rng.integers(-9, 10, (300, 2, 2)), axis=1).reshape(-1, 4)
        cut = np.concatenate([np.maximum(box[:, :2], extent[:, :2]), np.minimum(box[:, 2:], extent[:, 2:])], axis=1)
        ends = some_ends(rng, lines)
        for within in (extent, cut):
            assert np.array_equal(cells_in(lines, within), counted_one_by_one(lines, within))
            assert np.array_equal(cells_in(lines, within, ends), counted_one_by_one(lines, within, ends))
        assert (cells_in(lines, cut) < cells_in(lines, extent)).any()


@pytest.mark.parametrize("radius", RADII)
def test_cells_of_points_in_boxes_of_one_column_or_row(radius: int) -> None:
    """A disc that does not move covers no corner of the square around it."""
    rng = np.random.default_rng(radius)
    lines = Lines(rng.integers(-128, 128, (400, 2)), np.zeros((400, 2), np.int64), radius)
    box, at, side = lines.box_xyxy.copy(), np.arange(400), rng.integers(0, 2, 400)
    box[at, side] = box[at, side + 2] = rng.integers(-3, 4, 400)
    assert np.array_equal(cells_in(lines, box), counted_one_by_one(lines, box))


@pytest.mark.parametrize(
    ("start", "end", "cells"),
    [
        ((0, 0), (3, 0), 4),
        ((0, 0), (3, 3), 10),  # three corners, at each of which it touches two cells more
        ((0, 0), (2, 1), 4),  # no corner: it crosses one border after the other
        ((0.5, 0.5), (0.5, 0.5), 4),  # a point on a corner
        ((0.5, 0), (0.5, 3), 8),  # along a border, between two columns
        ((0.5, 0.5), (2.5, 2.5), 10),  # from corner to corner
    ],
)
def test_cells_of_small_rays_by_hand(start: tuple[float, float], end: tuple[float, float], cells: int) -> None:
    at, to = np.array([start]), np.array([end])
    origin = np.floor(at + 0.5)
    lines = Lines(np.int64(256 * (at - origin)), np.int64(256 * (to - at)), 0)
    assert cells_in(lines, lines.box_xyxy).tolist() == [cells]


def test_lines_of_great_length_are_counted() -> None:
    """Those along a diagonal touch 3 n + 1 cells, and of steps without a common divisor one for each border."""
    n = 2**21
    lines = Lines(np.zeros((3, 2), np.int64), 256 * np.array([[n, n], [-n, n - 1], [n, 0]]), 0)
    assert cells_in(lines, lines.box_xyxy).tolist() == [3 * n + 1, 2 * n, n + 1]


WEAPONS: tuple[Any, ...] = (
    lambda rng, reach: Pistol(reach),
    lambda rng, reach: Laser(reach),
    lambda rng, reach: Laser(reach, width=rng.choice([0.3, 1, 1.5, 2, 9])),
    lambda rng, reach: Rifle(reach, max_hits=rng.randrange(1, 4)),
    lambda rng, reach: Rifle(reach, budget=rng.choice([0, 1, 3, 10])),
    lambda rng, reach: Projectile(reach, radius=rng.choice([0.5, 1, 3])),
    lambda rng, reach: Spread(Laser(reach), 5, 9),
    lambda rng, reach: Sweep(Pistol(reach), 360, 7),
    lambda rng, reach: Rounds(Rifle(reach, max_hits=2), 2, recoil_xy=(1, 0.5)),
    lambda rng, reach: Laser(None),
    lambda rng, reach: Pistol(None),
)


def crowd(rng: np.random.Generator, items: int, at: int, bounded: bool) -> Scene:
    """Items of up to 14 px with holes, many on the same cells, some of them occluders."""
    names = ["a", "b", "c"]
    scene = Scene((60, 50), (at, at), categories=names) if bounded else Scene(categories=names)
    for _ in range(items):
        scene.add(
            rng.random(rng.integers(1, 15, 2)) < rng.choice([0.4, 0.9, 1]), at + rng.integers(-5, 65, 2),
            role="occluder" if rng.random() < 0.25 else "hittable", layer=int(rng.integers(3)),
            categories=[names[k] for k in np.flatnonzero(rng.random(3) < 0.5)],
        )  # fmt: skip
    return scene


def shot_at(rng: random.Random, low: int, high: int) -> float:
    """A coordinate in the middle of a pixel, on a border, on the grid of 1/256 px, or anywhere."""
    fine = rng.choice([1, 2, 256, 2**20])
    return rng.randrange(fine * low, fine * high) / fine


def battle(seed: int) -> tuple[Scene, Weapon, dict[str, Any]]:
    """A scene, a weapon and the shots."""
    rng, of_scene = random.Random(seed), np.random.default_rng(seed)
    at = rng.choice([0, 0, 10**6, -(10**9)])
    scene = crowd(of_scene, rng.randrange(0, 14), at, rng.random() < 0.7)
    weapon = rng.choice(WEAPONS)(rng, rng.choice([1, 5, 20, 64, 90]))
    start = np.array([[at + shot_at(rng, -3, 63), at + shot_at(rng, -3, 53)] for _ in range(20)])
    how: dict[str, Any] = {"at": start}
    if getattr(weapon, "range", 1) is None or rng.random() < 0.5:
        step = np.array([[rng.choice([0, shot_at(rng, -40, 40)]) for _ in range(2)] for _ in range(20)])
        how["toward"] = start + np.where((step == 0).all(axis=1, keepdims=True), 1, step)
    else:
        how["aim"] = [rng.choice([0, 45, 90, 135, 180, 270, rng.uniform(0, 360)]) for _ in range(20)]
    if rng.random() < 0.5:
        how |= {
            "accept": rng.choice([["a"], ["b"], ["a", "c"]]),
            "blocked_by": rng.choice([["a"], [], ["a", "b", "c"]]),
        }
    if len(scene.ids()) and rng.random() < 0.4:
        how["exclude"] = [rng.randrange(len(scene.ids())) for _ in range(20)]
    return scene, weapon, how


def listed(hits: Hits) -> list[list[int]]:
    """Verdicts of each shot, counted in the list of its cells."""
    return [np.bincount(hits.samples_at(k).verdict, minlength=6).tolist() for k in range(len(hits.shots))]


def told(monkeypatch: pytest.MonkeyPatch, hits: Hits) -> list[list[int]]:
    """Verdicts as they are counted without a list."""
    with monkeypatch.context() as patch:
        patch.delattr("hitplanes.weapons.explain.ray_samples.counted_verdicts")
        return hits.verdicts.tolist()


@pytest.mark.parametrize("part", some_of(range(8)))
@pytest.mark.usefixtures("jit")
def test_verdicts_of_battles_are_those_of_the_cells(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = np.zeros(6, np.int64)
    for seed in range(12 * part, 12 * part + 12):
        scene, weapon, how = battle(seed)
        hits = fire(scene, weapon, **how)
        assert told(monkeypatch, hits) == listed(hits), (seed, weapon)
        seen += hits.verdicts.sum(axis=0)
    assert seen.all()


@pytest.mark.parametrize("width", [1, 3, 9])
@pytest.mark.usefixtures("jit")
def test_cells_of_wide_rays_that_walls_end_are_those_of_the_list(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """At all angles, so that some have many cells in a row of pixels, which end before the wall, at it, or behind."""
    scene, rng = Scene((160, 120)), np.random.default_rng(5)
    for _ in range(9):
        scene.add(np.ones((9, 9), np.bool_), rng.integers(0, (160, 120)), role="occluder")
    for weapon in (Pistol(90, width=width), Projectile(70, width / 2)):
        hits = fire(scene, weapon, rng.uniform(-9, (169, 129), (60, 2)), aim=np.arange(60) * 6.1)
        assert told(monkeypatch, hits) == listed(hits) and 9 < hits.verdicts[:, Verdict.OCCLUDED].sum() < 60


@pytest.mark.parametrize("width", [0, 1])
@pytest.mark.usefixtures("jit")
def test_an_object_behind_the_wall_that_stops_a_ray_is_not_hit_in_the_last_cell(width: float) -> None:
    """It lies on both sides of the edge of the wall, and was hit before it."""
    scene = Scene((30, 9))
    scene.add(np.ones((1, 10), np.bool_), (10, 4))
    scene.add(np.ones((1, 5), np.bool_), (12, 4), role="occluder", layer=1)
    (left, *_), (wall, *_) = scene.box(0), scene.box(1)
    counts = fire(scene, Laser(25, width=width), (2, 4)).verdicts[0]
    assert counts[Verdict.HIT] == wall - left > 0 and counts[Verdict.OCCLUDED] == 1
    assert counts[Verdict.EMPTY] == left - 2 and counts[Verdict.BEYOND] == 27 - wall


@pytest.mark.long
@pytest.mark.parametrize("part", range(3))
@pytest.mark.usefixtures("jit")
def test_verdicts_of_many_battles_are_those_of_the_cells(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(1000 + 100 * part, 1100 + 100 * part):
        scene, weapon, how = battle(seed)
        hits = fire(scene, weapon, **how)
        assert told(monkeypatch, hits) == listed(hits), (seed, weapon)


def test_verdicts_of_a_prepared_pistol_are_those_of_the_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    scene = crowd(rng, 12, 0, True)
    ready = prepare(scene, Pistol(60), accept=["a"])
    for at, aim in zip(rng.uniform(0, 50, (30, 2)).tolist(), rng.choice([0, 45, 90, 200], 30).tolist(), strict=True):
        hits = ready.fire(at, aim=aim)
        assert told(monkeypatch, hits) == listed(hits)


def test_parts_of_a_batch_are_counted_for_their_shots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rays are followed, and their cells listed, in parts."""
    rng = np.random.default_rng(4)
    scene = crowd(rng, 14, 0, True)
    how: dict[str, Any] = {"at": rng.integers(0, 50, (40, 2)), "aim": 45 * rng.integers(0, 8, 40), "accept": ["a", "b"]}
    how["exclude"] = rng.integers(0, len(scene.ids()), 40)
    for weapon in (Sweep(Laser(60), 90, 3), Pistol(60), Laser(60, width=3)):
        expected = fire(scene, weapon, **how).verdicts
        with monkeypatch.context() as patch:
            patch.setattr("hitplanes.weapons.rays.ray_call.RAYS_AT_ONCE", 12)
            patch.setattr("hitplanes.weapons.rays.ray_hits.CHUNK_CELLS", 9)
            patch.setattr(ray_verdicts, "CHUNK_SAMPLES", 9)
            patch.setattr(ray_verdicts, "RAYS_AT_ONCE", 5)
            assert np.array_equal(fire(scene, weapon, **how).verdicts, expected)


def test_verdicts_tell_of_the_scene_of_then() -> None:
    scene = Scene((60, 20))
    wall = scene.add(np.ones((20, 4), np.bool_), (40, 0), role="occluder")
    duck = scene.add(np.ones((5, 5), np.bool_), (20, 5))
    hits, again = (fire(scene, Laser(50), (0, 7), aim=0) for _ in range(2))
    expected = again.verdicts
    ready, history, copied = prepare(scene, Laser(50)), History(scene), copy(hits)
    prepared = ready.fire((0, 7), aim=0)
    history.record(0)
    scene.move([wall, duck], [(0, 0), (0, 0)])
    history.record(1)
    for answer in (hits, copied, pickle.loads(pickle.dumps(hits)), prepared):
        assert np.array_equal(answer.verdicts, expected)
    of_ticks = fire(history, Laser(50), [(0, 7)] * 3, aim=0, tick=[1, 0, 1])
    scene.move(duck, (90, 90))
    assert of_ticks.verdicts[1].tolist() == expected[0].tolist() != of_ticks.verdicts[0].tolist()
    assert np.array_equal(copy(of_ticks).verdicts, of_ticks.verdicts)
    assert hits.verdict_counts() == {"empty": 34, "hit": 5, "occluded": 1, "filtered": 0, "outside": 0, "beyond": 11}
    steps = fire(scene, Projectile(50, 1, steps=3), (30, 7), aim=0)
    scene.move(wall, (9, 9))
    with pytest.raises(InputError, match="expected the scene at version 4, got version 5"):
        steps.verdicts  # noqa: B018


def test_cells_with_several_items_are_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boxes lie at 6 to 15, 11 to 20, 18 to 27 (refused), 36 to 45, and 41 to 50, behind the last: the occluder."""
    scene = Scene((60, 9), categories=["a", "b"])
    box = np.ones((5, 10), np.bool_)
    for x, layer, name in ((10, 0, "a"), (15, 1, "a"), (22, 0, "b"), (40, 2, "a")):
        scene.add(box, (x, 2), layer=layer, categories=[name])
    scene.add(box, (45, 2), role="occluder", layer=1)
    hits = fire(scene, Laser(58), (0, 4), aim=0, accept=["a"])
    counts = dict(zip((v.name for v in Verdict), told(monkeypatch, hits)[0], strict=True))
    assert counts == {"EMPTY": 14, "HIT": 21, "OCCLUDED": 0, "FILTERED": 7, "OUTSIDE": 0, "BEYOND": 17}


def test_an_object_before_the_occluder_that_ends_the_ray_is_hit_there() -> None:
    scene = Scene((60, 9))
    scene.add(np.ones((5, 3), np.bool_), (10, 4), layer=1)
    scene.add(np.ones((5, 3), np.bool_), (12, 4), role="occluder")
    hits = fire(scene, Laser(30), (0, 4), aim=0)
    assert hits.verdicts.tolist() == [[9, 3, 0, 0, 0, 19]]


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("width", [0, 1])
def test_the_cell_of_the_occluder_that_ends_a_ray_is_not_filtered_too(width: int) -> None:
    """A refused object of 3 px at 9 to 11 lies on the first cell of the occluder; it is in front of it, or behind."""
    for layer in (-1, 1):
        scene = Scene((60, 1), categories=["a", "b"])
        scene.add(np.ones((1, 3), np.bool_), (10, 0), layer=layer, categories=["b"])
        scene.add(np.ones((1, 3), np.bool_), (12, 0), role="occluder", categories=["a"])
        hits = fire(scene, Laser(30, width=width), (0, 0), aim=0, accept=["a"], blocked_by=["a"])
        assert hits.verdicts.tolist() == [[9, 0, 1, 2, 0, 19]] == listed(hits)


@pytest.mark.parametrize("blocked_by", ["all", []])
def test_cells_with_occluders_come_first_of_those_entered_at_once(
    blocked_by: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At each corner a ray enters three cells. It ends in the last of them, and walks the other two before or not."""
    scene = Scene((20, 20))
    how: dict[str, Any] = {"at": (0, 0), "aim": 45} | ({} if blocked_by == "all" else {"blocked_by": blocked_by})
    scene.add(np.ones((1, 1), np.bool_), (5, 5), layer=1)
    assert told(monkeypatch, fire(scene, Pistol(12), **how))[0][:2] == [15, 1]
    scene.add(np.ones((1, 1), np.bool_), (5, 5), role="occluder")
    hits = fire(scene, Pistol(12), **how)
    assert told(monkeypatch, hits) == listed(hits)
    assert hits.verdicts[0, :2].tolist() == ([13, 1] if blocked_by == "all" else [15, 1])


def test_the_filter_of_each_shot_says_which_cells_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene((20, 20))
    scene.add(np.ones((1, 1), np.bool_), (5, 5), layer=1)
    scene.add(np.ones((1, 1), np.bool_), (5, 5), role="occluder")
    monkeypatch.setattr("hitplanes.weapons.rays.ray_call.RAYS_AT_ONCE", 1)
    hits = fire(scene, Pistol(12), [(0, 0)] * 3, aim=45, blocked_by=[0, 1, 0])
    assert hits.verdicts[:, 0].tolist() == [15, 13, 15]
