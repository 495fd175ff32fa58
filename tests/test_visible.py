"""What can be seen is made, and listed by cells, when shots have lost as much without it; the rows are the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from hitplanes import Beam, Disc, Scene, Sprite, fire
from hitplanes.planes.bits import visible
from hitplanes.planes.bits.tiles import tiles_in
from hitplanes.planes.bits.visible import WITHOUT_MOST, View, VisibleSet
from hitplanes.planes.common.limits import EVERYTHING
from hitplanes.planes.scene.derived import VIEWS_MOST

CORNERS = [(0, 0), (-(10**9), 10**9), (10**12, -(10**12))]


def crowd(count: int = 60, corner: tuple[int, int] = (0, 0)) -> Scene:
    rng = np.random.default_rng(5)
    scene = Scene()
    for _ in range(count):
        at = corner + rng.integers(0, 400, 2)
        scene.add(rng.random((20, 30)) < 0.6, tuple(at.tolist()))
    return scene


@pytest.fixture
def made_sets(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[View]]:
    """Views of the visible sets that are made during a test."""
    made: list[View] = []
    begin = VisibleSet.__init__

    def noted(self: VisibleSet, *given: Any) -> None:
        made.append(given[-1])
        begin(self, *given)

    monkeypatch.setattr(VisibleSet, "__init__", noted)
    yield made


@pytest.mark.parametrize("more", [0, 1])
def test_each_of_the_kept_views_is_made_once_and_one_more_never_in_vain(made_sets: list[View], more: int) -> None:
    scene = crowd(300)
    views = [View(False, 1 << k, ()) for k in range(VIEWS_MOST + more)]
    lost, cost, rounds = 1.0, 10.0, 200
    for _ in range(rounds):
        for view in views:
            known = scene.derived.visible(view)
            if known.made(scene.items) is None and known.worth_building(lost, cost):
                known.read(scene.items)
    assert len(made_sets) == (0 if more else len(views))


def test_only_what_decides_hits_makes_a_visible_set_stale(made_sets: list[View]) -> None:
    scene = crowd()
    mover, hud = scene.add([[True]], role="mover"), scene.add([[True]], role="hud")
    objects = scene.ids("hittable")
    view = View(False, EVERYTHING, ())
    known = scene.derived.visible(view)
    first = known.read(scene.items)
    changes: list[tuple[Callable[[], object], bool]] = [
        (lambda: scene.move(mover, (5, 5)), False),
        (lambda: scene.move([mover, hud], [(6, 6), (7, 7)]), False),
        (lambda: scene.set(hud, angle=30), False),
        (lambda: scene.add([[True]], role="mover"), False),
        (lambda: scene.move([mover, objects[0]], [(6, 6), (7, 7)]), True),
        (lambda: scene.move(int(objects[1]), (8, 8)), True),
        (lambda: scene.set(mover, role="hittable"), True),
        (lambda: scene.set(objects[2], categories=2), True),
        (lambda: scene.remove(objects[3]), True),
        (lambda: scene.remove(hud), False),
    ]
    for change, stale in changes:
        change()
        assert (known.made(scene.items) is None) == stale
        again = known.read(scene.items)
        assert (again is not first) == stale
        assert fire(scene, Disc(9), [(50, 50), (200, 300)], strategy="visible") == fire(
            scene, Disc(9), [(50, 50), (200, 300)], strategy="direct"
        )
        first = again
    assert set(made_sets) == {view}


@pytest.mark.parametrize("corner", CORNERS)
def test_few_placements_do_without_lists(jit: bool, corner: tuple[int, int]) -> None:
    """Rows of few shots, of those that pay for lists, and of shots far off are those of direct ones."""
    scene = crowd(corner=corner)
    rng = np.random.default_rng(2)
    seen, rows = set(), 0
    for k in range(20):
        weapon, shots = Beam(60 + k % 20, 5) if k % 2 else Disc(3 + k), 4 if k % 3 else WITHOUT_MOST + 1
        at = np.array(corner) + rng.integers(-50, 450, (shots, 2)) + rng.choice([0, 0, 10**6], (shots, 1))
        hits = fire(scene, weapon, at, aim=float(k), strategy="built")
        rows += len(hits)
        assert hits == fire(scene, weapon, at, aim=float(k), strategy="direct")
        (stage,) = (stage for stage in hits.plan.ran if stage.name == "pre-filter")
        seen.add((stage.why.split(",")[0], stage.bytes_made > 0))
    assert rows > 50
    assert {told == "all tiles" for told, _ in seen} == {True, False}
    assert {made for told, made in seen if told == "all tiles"} == {False}
    assert ("cells of 16 px", True) in seen


def test_many_placements_are_worth_lists_and_those_that_are_there_cost_nothing() -> None:
    visible_set = VisibleSet(*what(crowd()))
    small, large = np.array([-3, -3, 3, 3]), np.array([-40, -40, 40, 40])
    cells, made = visible_set.cells_for(small[None], WITHOUT_MOST + 1)
    assert made == cells.nbytes > 0 and visible_set.cells_for(small[None], 1) == (cells, 0)
    for _ in range(2):
        assert visible_set.cells_for(large[None], WITHOUT_MOST) == (None, 0)
    assert visible_set.cells_for(large[None], WITHOUT_MOST + 1)[1] > 0


def test_pairs_of_placements_and_tiles_that_are_compared_are_not_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    visible_set = VisibleSet(*what(crowd()))
    monkeypatch.setattr(visible, "PAIRS_MOST", 2 * len(visible_set.seen.rank))
    reach = np.array([-3, -3, 3, 3])
    assert visible_set.cells_for(reach[None], 2)[1] == 0 and visible_set.cells_for(reach[None], 3)[1] > 0


def what(scene: Scene) -> Any:
    return scene.items.stack(), scene.items.tiles(), scene.bounds, View(False, EVERYTHING, ())


def test_nothing_can_be_seen_of_no_objects(jit: bool) -> None:
    visible_set = VisibleSet(*what(Scene()))
    assert visible_set.cells_for(np.array([[-3, -3, 3, 3]]), 1) == (None, 0) and not len(visible_set.seen.rank)
    assert not fire(Scene(), Disc(3), (0, 0), strategy="visible")


@pytest.mark.parametrize("size", [(1, 1), (250, 1), (1, 250), (70, 250)])
@pytest.mark.parametrize("corner", CORNERS)
def test_a_few_shots_find_all_that_is_visible(jit: bool, size: tuple[int, int], corner: tuple[int, int]) -> None:
    scene = Scene()
    for x in (0, size[0] - 1):
        for y in (0, size[1] - 1):
            scene.add([[True]], (corner[0] + x, corner[1] + y))
    left, top = scene.items.stack().box_xyxy.T[:2]
    at = [(x, y) for x in (left.min() - 40, left.max() + 2) for y in (top.min() - 5, top.max() + 30)]
    for place in at:
        hits = fire(scene, Disc(400), place, strategy="visible")
        assert hits == fire(scene, Disc(400), place, strategy="spans") and hits


def test_a_large_mask_counts_as_the_tiles_that_cover_it(jit: bool, made_sets: list[View]) -> None:
    """Among few objects and one wall of 375 tiles, shots lose so much that what can be seen is made for them."""
    scene = Scene((1600, 960))
    scene.add(np.ones((960, 1600), np.bool_), (799.5, 479.5), role="occluder")
    for x in range(50):
        scene.add(Sprite.box(9, 9), (30 * x, 9), layer=1)
    assert tiles_in(scene.items.stack()) == 375
    shots = [(30 * x, 9) for x in range(50)]
    hits = [fire(scene, Disc(40), shots) for _ in range(200)]
    assert made_sets and hits[0] == hits[-1] == fire(scene, Disc(40), shots, strategy="spans")


@pytest.mark.parametrize("objects", [10, 40])
def test_many_wide_shots_at_few_objects_soon_see_what_is_visible(
    jit: bool, objects: int, made_sets: list[View]
) -> None:
    """Tiles that lie near shots cost most, however few there are."""
    rng = np.random.default_rng(objects)
    scene = Scene((320, 320))
    for place in rng.uniform(0, 320, (objects, 2)):
        scene.add(Sprite.circle(8), place)
    shots = rng.uniform(0, 320, (1000, 2))
    for _ in range(5):
        fire(scene, Disc(60), shots)
    assert made_sets
