"""Moves: stacks that follow them are those made anew, what was handed out stays, and every check is made."""

from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_label_plane import MASKS, add_one, change, changed_boxes, front_to_back, random_scene

from hitplanes import History, InputError, Scene, Sprite
from hitplanes.planes.bits.tiles import Tiles
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.objects import Role

BLINKING = Sprite.from_image(np.array([[[0] * 4] * 3 + [[255] * 4] * 3] * 4, np.uint8), grid_wh=(3, 4))
"""Two frames: nothing, and a block."""

COLUMNS = ("ids", "occluder", "categories", "owner", "box_xyxy", "layered")


def told(stack: Stack) -> list[Any]:
    """All that a stack says, with its masks."""
    columns = [np.array(getattr(stack, name)).tolist() for name in COLUMNS]
    ranks = stack.ranks(np.arange(40)).tolist()
    return [*columns, [stack.mask(rank).tolist() for rank in range(len(stack))], ranks]


def worked_out(stack: Stack) -> list[Any]:
    """What a stack works out of its columns, and keeps."""
    sizes = list(stack.sizes) if len(stack) else []
    numbers = stack.numbers.tolist(), stack.rank_by_label.tolist(), stack.is_object.tolist()
    return [stack.has_unmet, stack.has_occluders, stack.width.tolist(), stack.area, numbers, sizes]


def said_of(scene: Scene) -> list[Any]:
    """The same of a scene, one item at a time."""
    ids = [i for i in front_to_back(scene) if scene.mask(i)[0].size]
    masks = {i: scene.mask(i) for i in ids}
    boxes = [[x, y, x + mask.shape[1] - 1, y + mask.shape[0] - 1] for mask, (x, y) in masks.values()]
    occluder = [i in scene.ids("occluder") for i in ids]
    categories = [
        int(scene.categories_of(i).astype(np.uint64) << np.uint64(32 * block))
        for i, block in zip(ids, occluder, strict=True)
    ]
    categories, owner = [c - (c >> 63 << 64) for c in categories], [int(scene.owner(i)) for i in ids]
    ranks = [ids.index(i) if i in ids else -1 for i in range(40)]
    layered = len({int(scene.layer(i)) for i in ids}) > 1
    return [ids, occluder, categories, owner, boxes, layered, [masks[i][0].tolist() for i in ids], ranks]


def moved(scene: Scene, rng: np.random.Generator) -> None:
    """Move one, some, all or a run of the objects, in any order."""
    ids = scene.ids()
    if not len(ids):
        return
    begin = int(rng.integers(len(ids)))
    some: list[Any] = [
        int(rng.choice(ids)), [rng.choice(ids)], ids, rng.permutation(ids), ids[begin : begin + 3], ids[begin::-1],
    ]  # fmt: skip
    chosen = some[rng.integers(len(some))]
    n = np.size(chosen)
    xy = rng.uniform(-30, 30, (n, 2)) if n > 1 or rng.random() < 0.5 else np.array([rng.integers(-9, 9) + 0.5] * 2)
    scene.move(chosen, xy if n > 1 else xy.reshape(2))


@examples(27, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32), st.integers(0, 12))
def test_the_stack_after_any_change_is_the_one_made_anew(
    monkeypatch: pytest.MonkeyPatch, jit: bool, seed: int, count: int
) -> None:
    monkeypatch.setattr("hitplanes.planes.bits.tiles.ATLAS_SLACK", 2)
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, count)
    if rng.random() < 0.5:
        scene.add(np.zeros((3, 2), np.bool_))  # never in the stack
    scene.add(MASKS[14], (3, 3), scale=10.5)  # of several tiles
    blinking = scene.add(BLINKING, (3, 3), layer=int(rng.integers(-1, 2)))
    old: list[tuple[Stack, list[Any]]] = []
    for _ in range(12):
        (moved if rng.random() < 0.7 else change)(scene, rng)
        if rng.random() < 0.2:
            scene.set(scene.ids(), cost=int(rng.integers(9)), velocity_xy=(1, 2))
        if rng.random() < 0.2 and blinking in scene.ids():
            scene.set(blinking, frame=int(rng.integers(2)))
        if rng.random() < 0.2:
            scene.set(scene.ids()[:3], categories=int(rng.integers(3)), owner=int(rng.integers(scene.items.count)))
        if rng.random() < 0.3:
            continue
        stack = scene.items.stack()
        assert told(stack) == said_of(scene)
        assert worked_out(stack) == worked_out(scene.items.stack_of(Role.HITTABLE, Role.OCCLUDER))
        assert masks_of(scene.items.tiles(), stack) == [stack.mask(rank).tolist() for rank in range(len(stack))]
        old.append((stack, told(stack)))
    for stack, before in old:
        assert told(stack) == before, "a stack that was handed out changed"
    alike = {told_arrangement(stack) for stack, _ in old}
    assert len(alike) == len({number for number, _ in alike})


def masks_of(tiles: Tiles, stack: Stack) -> list[Any]:
    """The masks of a stack, put together of tiles, each of which has a pixel."""
    masks = [np.zeros_like(stack.mask(rank)) for rank in range(len(stack))]
    columns = (column.tolist() for column in (tiles.rank, tiles.inside_xyxy, tiles.begin))
    for rank, (left, top, right, low), begin in zip(*columns, strict=True):
        width, height = right - left + 1, low - top + 1
        words = tiles.words[begin - 64 : begin + 128].tolist()
        assert not any(words[:64]) and not any(words[64 + height :]) and any(words)
        for y, x in np.ndindex(height, width):
            masks[rank][top + y, left + x] = words[64 + y] >> x & 1
        assert not any(word >> width for word in words)
    return [mask.tolist() for mask in masks]


def told_arrangement(stack: Stack) -> tuple[int, str]:
    """The number of its arrangement, and what it says beside the places."""
    all_but_boxes = told(stack)
    del all_but_boxes[COLUMNS.index("box_xyxy")]
    return stack.arrangement, repr([*all_but_boxes, [b - a for a, b in zip(*sides(stack), strict=True)]])


def sides(stack: Stack) -> tuple[list[int], list[int]]:
    box = stack.box_xyxy
    return box[:, :2].ravel().tolist(), box[:, 2:].ravel().tolist()


def test_moves_keep_the_arrangement_and_share_all_but_the_boxes() -> None:
    scene = random_scene(np.random.default_rng(1), 20)
    first = scene.items.stack()
    assert first.rank_by_label is first.rank_by_label and not first.rank_by_label.flags.writeable
    ids = scene.ids()
    for act in (
        lambda: scene.move(int(ids[3]), (5, 5)),
        lambda: scene.move(ids, (0, 0)),
        lambda: scene.set(ids[2:5], position_xy=(7, 7)),
        lambda: scene.set(ids[2:5], cost=4),
        lambda: scene.set(ids, velocity_xy=(3, 0), position_xy=(1, 1)),
    ):
        act()
        stack = scene.items.stack()
        assert stack is not first and stack.arrangement == first.arrangement
        for name in ("ids", "occluder", "categories", "owner", "offset", "masks", "rows", "rank_by_label"):
            assert getattr(stack, name) is getattr(first, name), name
    seen = {first.arrangement}
    for values in ({"layer": 1}, {"angle": 40}, {"categories": 5}, {"owner": 0}, {"role": "mover"}, {"scale": 2}):
        scene.set(int(ids[-1]), **values)  # type: ignore[arg-type]
        seen.add(scene.items.stack().arrangement)
    scene.remove(int(ids[-1]))
    seen.add(scene.items.stack().arrangement)
    add_one(scene, np.random.default_rng(2))
    seen.add(scene.items.stack().arrangement)
    assert len(seen) == 9
    assert Scene().items.stack().arrangement not in seen


def test_the_sizes_of_a_stack_are_its_own() -> None:
    """They depend on where items are."""
    scene = Scene((99, 99))
    ids = [scene.add(np.ones((3, 3), np.bool_), (x, 5)) for x in (4, 9)]
    assert scene.items.stack().sizes[1] == (8, 3)
    scene.move(ids[1], (24, 15))
    assert scene.items.stack().sizes[1] == (23, 13)
    for x in range(40):
        scene.add(np.ones((3, 3), np.bool_), (2 * x, x))
    (wide, high), (width, height) = scene.items.stack().sizes
    assert (wide, high) == (3, 3) and 66 < width <= 81 and 33 < height <= 42  # around some of the 42 items


NAN, INF, FAR = float("nan"), float("inf"), 2.0**40
BAD: list[tuple[Any, Any]] = [
    (17, (1, 1)), (-1, (1, 1)), (3, (1, 1)), (True, (1, 1)), (1.5, (1, 1)), (None, (1, 1)), ("a", (1, 1)),
    ([0, 0], (1, 1)), ([0, 3], (1, 1)), ([0, 19], (1, 1)), ([0, -1], (1, 1)), ([[0]], (1, 1)), ([1, 0, 1], (1, 1)),
    (np.array([0, 1, 1]), (1, 1)), (np.array([0, 2, 3]), (1, 1)), (np.array([-1, 0]), (1, 1)), (np.array([2, 19]), 1),
    (0, (NAN, 1)), (0, (1, INF)), (0, (1, 2 * FAR)), (0, (-2 * FAR, 1)), (0, (1, 2, 3)), (0, (True, 1)), (0, (1, True)),
    (0, "ab"),
    (0, ("1", 1)), (0, 5), (0, np.array([True, False])), (0, np.array([1, "a"], object)), (np.array([0, 99]), (1, 1)),
    (0, np.array([NAN, 1])), (0, np.array([1, -INF])), (0, np.array([1, 1 + FAR])),
    (np.array([0, 1]), np.array([[1, 1], [1, NAN]])), (np.array([0, 4]), np.array([[1, INF], [1, 1]])),
    (np.array([0, 1]), np.array([[1, 1], [-FAR - 1, 1]])), (np.array([0, 4]), np.array([[1, FAR + 1], [1, 1]])),
    (np.array([1, 0, 1]), np.ones((3, 2))), (np.array([0, 2, 3]), np.ones((3, 2))),
    (np.array([-1, 0]), np.ones((2, 2))),
    (np.array([0, 99]), np.ones((2, 2))), (np.array([0, 16]), np.ones((2, 2))), (np.array([0, 0]), np.ones((2, 2))),
    (np.array([0, 1]), np.ones((3, 2))), (np.array([0, 1]), np.ones((2, 3))), (np.array([[0, 1]]), np.ones((2, 2))),
    (np.array([[0], [1]]), np.ones((2, 2))), (np.array([False, True]), np.ones((2, 2))),
    (0, np.ma.masked_array([1.0, 2.0], [True, False])), ([0, 1], [[1, 1], [1, NAN]]), ([0, 1], [[1, 1], [INF, 1]]),
    ([0, 1], [[1, 1], [-INF, 1]]), ([0, 1], [[1, 1], [1, 1 + FAR]]), ([0, 1], [[1, 1], [-FAR - 1, 1]]),
    ([0, 1], [[1, 1]] * 3), ([0, 1], [1, 1, 1]), ([0, 1], [[1, 1j], [1, 1]]), (0, (10**400, 1)), (0, (1, 2**60)),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(BAD)))
def test_a_move_is_refused_as_a_change_of_position_is(jit: bool, number: int) -> None:
    ids, xy = BAD[number]
    scene = Scene((20, 20))
    for place in range(16):  # as many as the first columns hold
        scene.add(np.ones((2, 2), np.bool_), (place, place))
    scene.remove(3)
    before, version = said_of(scene), scene.version
    refusals = []
    for act in (lambda: scene.move(ids, xy), lambda: scene.set(ids, position_xy=xy)):
        with pytest.raises(InputError) as refused:
            act()
        refusals.append(str(refused.value))
        assert (said_of(scene), scene.version) == (before, version)
    assert refusals[0] == refusals[1].replace("position_xy", "xy")


def test_a_move_to_nowhere_is_refused() -> None:
    scene = random_scene(np.random.default_rng(4), 2)
    for ids in (0, [0, 1]):
        with pytest.raises(InputError, match=r"^xy: expected numbers, got None"):
            scene.move(ids, None)


ties = st.integers(-(2**20), 2**20).map(lambda k: k / 512)
places = st.one_of(ties, st.floats(-FAR, FAR), st.integers(-(2**40), 2**40))


@given(places, places, st.sampled_from([tuple, list, np.array, lambda pair: tuple(map(np.float64, pair))]))
def test_one_object_is_placed_as_many_are(x: float, y: float, kind: Any) -> None:
    scene = Scene()
    for mask in (MASKS[5], MASKS[5]):
        scene.add(mask, (3, 4))
    scene.move(0, kind((x, y)))
    scene.move([1], [[x, y]])
    assert scene.items.position_256[0].tolist() == scene.items.position_256[1].tolist()
    assert scene.mask(0)[1] == scene.mask(1)[1]
    boxes = scene.items.stack().box_xyxy.tolist()
    assert boxes[0] == boxes[1] and boxes[0][:2] == list(scene.mask(0)[1])


@given(st.lists(st.tuples(st.integers(0, 11), places, places), unique_by=lambda row: row[0]), st.booleans())
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_many_are_placed_as_each_is_alone(jit: bool, rows: list[tuple[int, float, float]], in_one_piece: bool) -> None:
    """Rising ids in plain arrays take a path of their own; all but those of objects that decide nothing have boxes."""
    scenes = [random_scene(np.random.default_rng(8), 12) for _ in range(2)]
    begun = [scene.items.version for scene in scenes]
    rows.sort()
    ids, xy = np.array([row[0] for row in rows], np.int64), np.array([row[1:] for row in rows], np.float64)
    scenes[0].move(ids, xy.reshape(-1, 2) if in_one_piece else xy.reshape(-1, 2).copy(order="F"))
    for item, x, y in rows:
        scenes[1].move(item, (x, y))
    assert scenes[0].items.position_256.tolist() == scenes[1].items.position_256.tolist()
    assert told(scenes[0].items.stack()) == told(scenes[1].items.stack()) == said_of(scenes[0])
    boxes = [sorted(changed_boxes(scene, version).tolist()) for scene, version in zip(scenes, begun, strict=True)]  # type: ignore[union-attr]
    assert boxes[0] == boxes[1]


def test_the_arrays_of_a_caller_are_not_kept(jit: bool) -> None:
    """Neither the ids nor the positions: what the caller does with them later changes nothing."""
    scene = random_scene(np.random.default_rng(4), 9)
    ids, xy, start = scene.ids(), np.full((9, 2), 3.0), scene.version
    scene.move(ids, xy)
    before = said_of(scene)
    ids[:], xy[:] = 0, 9
    assert scene.items.changed_rows(start).tolist() == list(range(9))  # type: ignore[union-attr]
    assert said_of(scene) == before == told(scene.items.stack())


def test_what_decides_nothing_is_moved_without_a_box() -> None:
    scene = Scene((20, 20))
    ids = [scene.add(np.ones((2, 2), np.bool_), role=role) for role in ("mover", "hittable", "hud")]
    ids.append(scene.add(np.zeros((2, 2), np.bool_)))
    start = scene.version
    scene.move(ids, [[5, 5]] * 4)
    scene.move(ids[0], (7, 7))
    boxes = changed_boxes(scene, start)
    assert boxes is not None and boxes.tolist() == [[0, 0, 1, 1], [5, 5, 6, 6]]
    assert scene.items.position_256[ids[0]].tolist() == [7 * 256, 7 * 256]
    assert len(scene.items.stack()) == 1


def test_ids_that_are_left_out_are_in_no_stack() -> None:
    scene = Scene()
    scene.add(MASKS[5])
    scene.items.table.skip_to(3)
    last = scene.add(MASKS[5])
    assert (last, scene.items.stack().ids.tolist()) == (3, [3, 0])
    assert scene.items.stack().ranks(np.arange(5)).tolist() == [1, -1, -1, 0, -1]
    assert Scene().items.stack().ranks(np.arange(2)).tolist() == [-1, -1]


def test_a_stack_of_other_roles_has_an_arrangement_of_its_own() -> None:
    scene = random_scene(np.random.default_rng(3), 9)
    arrangements = [
        scene.items.stack_of(*roles).arrangement for roles in ((Role.MOVER,), (Role.HUD,), (Role.HITTABLE,))
    ]
    assert len({*arrangements, scene.items.stack().arrangement}) == 4


def test_the_journal_forgets_no_more_than_it_must(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.scene.items.JOURNAL_ROWS", 5)
    scene = random_scene(np.random.default_rng(3), 9)
    ids = [*scene.ids("hittable"), *scene.ids("occluder")][:3]
    assert scene.items.version == 9
    for x in range(9):
        scene.move(ids, (x, 0))
        scene.move(int(ids[0]), (x, 1))
    for lag, rows in ((0, 0), (1, 2), (2, 8), (3, 10)):
        boxes = changed_boxes(scene, scene.version - lag)
        assert boxes is not None and len(boxes) == rows
    assert changed_boxes(scene, scene.version - 4) is None


def test_the_stacks_of_the_past_are_those_of_their_time() -> None:
    """Whether the order was known when they were recorded, or not."""
    rng = np.random.default_rng(6)
    scene = random_scene(rng, 12)
    history, then = History(scene), []
    for tick in range(30):
        (moved if tick % 5 else change)(scene, rng)
        if tick % 3:
            scene.items.stack()
        history.record(tick)
        then.append(said_of(scene))
    assert [told(history.at(tick).items.stack()) for tick in history.ticks] == then
    arrangements = {history.at(tick).items.stack().arrangement for tick in history.ticks}
    assert len(arrangements) < 15, "what only moved keeps its arrangement"
