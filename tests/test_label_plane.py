"""Label planes against a reference that asks each pixel by itself, in numpy and compiled, after any change."""

import importlib
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from hitplanes.planes.bits import label_plane as module
from hitplanes.planes.bits.label_plane import LabelPlane, id_plane, plane_fits
from hitplanes.planes.common.checks import InputError
from hitplanes.planes.scene.objects import ROLES, Role
from hitplanes.planes.scene.scene import Scene

BOUNDS = (-6, 2, 17, 16)
SIZE = (24, 15)
MASKS = [np.random.default_rng(n).random((1 + n % 6, 1 + n % 7)) < 0.75 for n in range(14)]
MASKS += [np.ones((9, 9), np.bool_), np.pad(np.zeros((4, 4), np.bool_), 2, constant_values=True)]


def changed_boxes(scene: Scene, version: int) -> Any:
    """Boxes (n, 4), old and new, of deciding items that changed after a version; None if that is forgotten."""
    changes = scene.items.changes(version)
    if changes is None:
        return None
    none = np.zeros((0, 4), np.int64)
    every = np.concatenate([none, *(np.reshape(box, (-1, 4)) for _, _, *both in changes for box in both)])
    return every[every[:, 0] <= every[:, 2]]


BOX = (-9, 4, 40, 33)
NAMES = ["hitplanes.planes.bits.label_plane", "hitplanes.planes.jit.areas"]


def front_to_back(scene: Scene) -> list[int]:
    """Greater layer, then occluders before objects, then the later added."""
    deciding = [i for i in scene if scene.role(i) in ("hittable", "occluder")]
    return sorted(deciding, key=lambda i: (-scene.layer(i), scene.role(i) != "occluder", -i))


def brute_labels(scene: Scene, box: tuple[int, int, int, int] = BOUNDS) -> np.ndarray:
    """Ask each pixel what lies in front there, and whether anything lies behind it."""
    order = front_to_back(scene)
    covered = {}
    for item in order:
        mask, (left, top) = scene.mask(item)
        covered[item] = {(int(x) + left, int(y) + top) for y, x in np.argwhere(mask)}
    x, y, x_max, y_max = box
    labels = np.zeros((y_max - y + 1, x_max - x + 1), np.int64)
    for row, column in np.ndindex(labels.shape):
        here = [item for item in order if (column + x, row + y) in covered[item]]
        if here:
            labels[row, column] = 2 * (scene.items.table.row(here[0]) + 1) + (len(here) > 1)
    return labels


def random_scene(rng: np.random.Generator, count: int) -> Scene:
    scene = Scene(SIZE, BOUNDS[:2])
    for _ in range(count):
        add_one(scene, rng)
    return scene


def add_one(scene: Scene, rng: np.random.Generator) -> None:
    role = ROLES[rng.choice(5, p=[0.05, 0.55, 0.05, 0.3, 0.05])]
    layer, angle = int(rng.integers(-1, 2)), float(rng.choice([0, 90, 37]))
    scene.add(MASKS[rng.integers(len(MASKS))], place(rng), role=role, layer=layer, angle=angle)


def place(rng: np.random.Generator) -> np.ndarray:
    """Somewhere in the bounds, over their edge, or out of them."""
    return np.array([rng.uniform(-12, 24), rng.uniform(-4, 22)])


def change(scene: Scene, rng: np.random.Generator) -> None:
    """One random change of a few objects."""
    ids = scene.ids()
    some = rng.choice(ids, rng.integers(1, min(len(ids), 3) + 1), replace=False) if len(ids) else ids
    kind = rng.choice(["add", "remove", "move", "angle", "scale", "flip", "layer", "role", "all"])
    if kind == "add" or not len(ids):
        add_one(scene, rng)
    elif kind == "remove":
        scene.remove(some)
    else:
        values: dict[str, Any] = {
            "position_xy": place(rng),
            "angle": float(rng.uniform(0, 360)),
            "scale": float(rng.choice([0.4, 1, 2])),
            "flip": str(rng.choice(["none", "x", "xy"])),
            "layer": int(rng.integers(-2, 3)),
            "role": ROLES[rng.integers(5)],
        }
        wanted = {"move": "position_xy"}.get(kind, kind)
        scene.set(some, **(values if kind == "all" else {wanted: values[wanted]}))


# The label plane


@examples(20, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 12))
def test_the_label_plane_follows_every_change(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, count)
    plane = LabelPlane(BOUNDS)
    for _ in range(8):
        assert np.array_equal(plane.read(scene.items), brute_labels(scene))
        for _ in range(rng.integers(0, 4)):
            change(scene, rng)
    assert np.array_equal(plane.read(scene.items), LabelPlane(BOUNDS).read(scene.items))


def test_a_small_plane_by_hand() -> None:
    scene = Scene((4, 2))
    scene.add([[1, 1, 1]], (1, 0))
    scene.add([[1, 1]], (1.5, 0), role="occluder")
    scene.add([[1], [1]], (3, 0.5), layer=-1)
    scene.add([[1, 1, 1, 1]], (1.5, 1), role="hud")
    assert LabelPlane((0, 0, 3, 1)).read(scene.items).tolist() == [[2, 5, 5, 6], [0, 0, 0, 6]]
    scene.set(2, layer=1)
    scene.move(2, (2, 0.5))
    assert LabelPlane((0, 0, 3, 1)).read(scene.items).tolist() == [[2, 5, 7, 0], [0, 0, 6, 0]]


def test_only_what_changed_is_redrawn() -> None:
    scene = Scene((100, 100))
    for x in range(5):
        scene.add(np.ones((4, 6), np.bool_), (10 * x + 2.5, 11.5))
    plane = scene.derived.label_plane()
    assert plane is not None
    assert plane.cost(scene.items) == 10_000
    plane.read(scene.items)
    assert plane.redrawn == 10_000
    changes: list[tuple[dict[str, Any], int]] = [
        ({"position_xy": (3.5, 11.5)}, 48),  # where it was and where it is
        ({"angle": 90}, 48),
        ({"layer": 1}, 48),
        ({"role": "mover"}, 24),
        ({"position_xy": (50.5, 50.5)}, 0),  # what a mover does changes no plane
        ({"role": "occluder"}, 24),
        ({"position_xy": (-0.5, 50.5)}, 24 + 2 * 6),  # turned, and cut by the bounds
        ({"position_xy": (-90, 50.5)}, 2 * 6),
        ({"position_xy": (-80, 50.5)}, 0),
    ]
    for values, pixels in changes:
        scene.set(0, **values)
        assert plane.cost(scene.items) == pixels, values
        assert np.array_equal(plane.read(scene.items), brute_labels(scene, (0, 0, 99, 99))), values
        assert plane.redrawn == pixels, values
        assert plane.cost(scene.items) == 0
    plane.read(scene.items)
    assert plane.redrawn == 0
    scene.remove([1, 2])
    scene.add(np.ones((2, 2), np.bool_), (90.5, 90.5))
    assert plane.cost(scene.items) == 24 + 24 + 4
    plane.read(scene.items)
    assert plane.redrawn == 52


def test_pixels_outside_the_dirty_boxes_are_not_touched() -> None:
    scene = Scene((20, 20))
    scene.add(np.ones((2, 2), np.bool_), (5.5, 5.5))
    plane = LabelPlane((0, 0, 19, 19))
    labels = plane.read(scene.items)
    labels[15, 15] = 999
    scene.move(0, (6.5, 5.5))
    assert plane.read(scene.items) is labels
    assert labels[15, 15] == 999
    assert (labels[5:7, 5] == 0).all()
    assert (labels[5:7, 6:8] == 2).all()


def test_more_dirt_than_plane_is_a_whole_plane() -> None:
    scene = Scene((6, 6))
    scene.add(np.ones((5, 5), np.bool_), (2, 2))
    plane = LabelPlane((0, 0, 5, 5))
    plane.read(scene.items)
    scene.move(0, (3, 3))
    assert plane.cost(scene.items) == 36
    assert np.array_equal(plane.read(scene.items), brute_labels(scene, (0, 0, 5, 5)))
    assert plane.redrawn == 36


@pytest.mark.parametrize("asked", [False, True])
def test_a_plane_that_lags_behind_the_journal_is_drawn_anew(asked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless it was asked about each change, and so knows all of them."""
    monkeypatch.setattr("hitplanes.planes.scene.items.JOURNAL_ROWS", 3)
    scene = random_scene(np.random.default_rng(1), 6)
    plane = LabelPlane(BOUNDS)
    plane.read(scene.items)
    for x in range(5):
        scene.move(1, (x, 5))
        if asked:
            plane.cost(scene.items)
    assert (plane.cost(scene.items) == SIZE[0] * SIZE[1]) is not asked
    assert np.array_equal(plane.read(scene.items), brute_labels(scene))


def test_masks_that_are_laid_out_anew_are_read_from_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many masks that nothing uses any more; a stack that was handed out keeps its masks."""
    monkeypatch.setattr("hitplanes.planes.scene.variants.ATLAS_SLACK_BYTES", 100)
    scene = random_scene(np.random.default_rng(2), 5)
    plane = LabelPlane(BOUNDS)
    old = scene.items.stack()
    before = [old.mask(place).copy() for place in range(len(old))]
    atlases = set()
    for angle in range(0, 350, 7):
        scene.set(scene.ids(), angle=angle)
        assert np.array_equal(plane.read(scene.items), brute_labels(scene))
        atlases.add(id(scene.items.atlas))
        assert scene.items.atlas.used <= 2 * scene.items.atlas.live + 100 + 2000
    assert len(atlases) > 1
    assert all(np.array_equal(old.mask(place), mask) for place, mask in enumerate(before))


def test_equal_masks_are_stored_once() -> None:
    scene = Scene()
    scene.add(np.ones((10, 10), np.bool_))
    used = scene.items.atlas.used
    for x in range(5):
        scene.add(scene.items.sprites[0], (x, 0))
    assert scene.items.atlas.used == used == 100


# Drawing


@pytest.fixture(params=NAMES)
def kernels(request: pytest.FixtureRequest) -> Any:
    if ".jit." in request.param:
        pytest.importorskip("numba")
    return importlib.import_module(request.param)


def heap(rng: np.random.Generator, count: int) -> Scene:
    """Objects of any size, wider than 64 px too, most of them over the edge of BOX, on a few layers."""
    scene = Scene()
    masks = [rng.random((rng.integers(1, 40), rng.integers(1, 90))) < rng.choice([0.2, 0.9, 1]) for _ in range(5)]
    for _ in range(count):
        role = rng.choice(["hittable", "hittable", "occluder", "mover"])
        place = rng.integers((-30, -20), (60, 50)) + rng.random(2)
        scene.add(masks[rng.integers(5)], place, role=role, layer=int(rng.integers(3)))
    return scene


def boxes_in(rng: np.random.Generator, n: int) -> np.ndarray:
    """Boxes inside BOX, that overlap as they like."""
    x, y = np.sort(rng.integers(BOX[0], BOX[2] + 1, (2, n)), axis=0), np.sort(rng.integers(4, 34, (2, n)), axis=0)
    return np.stack([x[0], y[0], x[1], y[1]], axis=1)


@examples(25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32), st.sampled_from([0, 1, 3, 7, 8, 9, 16, 17, 40]), st.integers(0, 9))
@pytest.mark.parametrize("kind", [np.uint16, np.uint32])
def test_drawn_anew_is_what_each_pixel_says(kernels: Any, kind: Any, seed: int, count: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    scene = heap(rng, count)
    dirty, stack, truth = boxes_in(rng, n), scene.items.stack(), brute_labels(scene, BOX)
    labels = np.full(truth.shape, 999, kind)
    kernels.paint(labels, BOX[0], BOX[1], dirty, module.places_of(stack), stack.masks)
    drawn = np.zeros(truth.shape, np.bool_)
    for x, y, x_max, y_max in dirty.tolist():
        drawn[y - BOX[1] : y_max - BOX[1] + 1, x - BOX[0] : x_max - BOX[0] + 1] = True
    assert np.array_equal(labels, np.where(drawn, truth, 999))


def test_planes_follow_many_moves(jit: bool) -> None:
    """One object or many, near and far, once or twice before the plane is read."""
    rng = np.random.default_rng(jit)
    scene = random_scene(rng, 30)
    plane, ids = LabelPlane((-6, 2, 17, 16)), scene.ids()
    for _ in range(60):
        for _ in range(rng.integers(1, 3)):
            some = rng.choice(ids, rng.choice([1, 1, 2, 9]), replace=False)
            now = scene.items.position_256[some] / 256
            step = rng.choice([1, 30]) * rng.uniform(-1, 1, now.shape)
            one = len(some) == 1
            scene.move(int(some[0]) if one else some, (now + step)[0] if one else now + step)
        assert np.array_equal(plane.read(scene.items), brute_labels(scene))
    labels = id_plane(scene.items.stack(), BOX)
    assert np.array_equal(labels, brute_labels(scene, BOX) >> 1)


@pytest.mark.parametrize("many", [False, True])
def test_a_short_step_is_drawn_as_one_box(many: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The boxes before and after are joined where that is no more to draw, also with those whose form changed."""
    drawn: list[list[int]] = []
    monkeypatch.setattr(module, "paint", lambda _, __, ___, dirty, *rest: drawn.extend(dirty.tolist()))
    scene = Scene((100, 60))
    ids = [scene.add(np.ones((4, 10), np.bool_), (20.5, 10.5))]
    ids += [scene.add(np.ones((4, 10), np.bool_), role="mover")] if many else []
    plane = scene.derived.label_plane()
    assert plane is not None
    wanted: list[tuple[tuple[float, float], list[list[int]]]] = [
        ((22.5, 11.5), [[16, 9, 27, 13]]),  # 60 px, and 80 in two
        ((32.5, 11.5), [[18, 10, 37, 13]]),  # side by side
        ((42.5, 12.5), [[28, 10, 37, 13], [38, 11, 47, 14]]),  # 100 px, and 80 in two
        ((-1.5, 12.5), [[38, 11, 47, 14], [0, 11, 3, 14]]),
        ((-20.5, 12.5), [[0, 11, 3, 14]]),
        ((-21.5, 12.5), []),
        ((98.5, 57.5), [[94, 56, 99, 59]]),
        ((97.5, 58.5), [[93, 56, 99, 59]]),
    ]
    plane.read(scene.items)
    drawn.clear()  # the plane as it is at first
    for (x, y), boxes in wanted:
        scene.move(ids if many else ids[0], (x, y))
        plane.read(scene.items)
        assert drawn == boxes
        drawn.clear()


# Sixteen and thirty-two bits


def test_labels_grow_when_ids_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ITEMS_UINT16", 6)
    scene = random_scene(np.random.default_rng(3), 6)
    plane = LabelPlane(BOUNDS)
    assert plane.read(scene.items).dtype == np.uint16
    add_one(scene, np.random.default_rng(4))
    assert plane.cost(scene.items) == SIZE[0] * SIZE[1]
    labels = plane.read(scene.items)
    assert labels.dtype == np.uint32
    assert np.array_equal(labels, brute_labels(scene))
    scene.move(2, (3, 3))
    assert plane.cost(scene.items) < SIZE[0] * SIZE[1]
    assert np.array_equal(plane.read(scene.items), brute_labels(scene))


@pytest.mark.parametrize("count", [32_767, 32_768])
def test_the_last_row_of_sixteen_bits(count: int) -> None:
    scene = Scene((4, 1))
    scene.items.table.height = count - 1  # as if so many objects were there
    last = scene.add([[1, 1]], (0.5, 0))
    assert scene.items.table.row(last) == count - 1
    scene.set(last, layer=1)
    plane = LabelPlane((0, 0, 3, 0))
    labels = plane.read(scene.items)
    assert labels.dtype == (np.uint16 if count == 32_767 else np.uint32)
    assert labels.tolist() == [[2 * count, 2 * count, 0, 0]]


def test_more_behind_fits_beside_the_last_row_of_sixteen_bits() -> None:
    scene = Scene((2, 1))
    scene.items.table.height = 32_765
    for _ in range(2):
        scene.add([[1]], (0, 0))
    labels = LabelPlane((0, 0, 1, 0)).read(scene.items)
    assert (labels.dtype, labels.tolist()) == (np.uint16, [[65_535, 0]])


# The label plane, and limits


@examples(14, deadline=None)
@given(st.integers(0, 2**32), st.tuples(*2 * [st.integers(-9, 9)]), st.tuples(*2 * [st.integers(1, 20)]))
def test_the_label_plane_of_any_box(seed: int, corner: tuple[int, int], size: tuple[int, int]) -> None:
    scene = random_scene(np.random.default_rng(seed), 8)
    box = (*corner, corner[0] + size[0] - 1, corner[1] + size[1] - 1)
    labels = id_plane(scene.items.stack(), box)
    assert labels.dtype == np.int32
    assert np.array_equal(labels, brute_labels(scene, box) >> 1)


def test_the_label_plane_of_one_role() -> None:
    scene = Scene((3, 1))
    scene.add([[1, 1]], (0.5, 0), layer=3)
    scene.add([[1, 1]], (1.5, 0), role="occluder")
    scene.add([[1]], (1, 0), role="mover", layer=9)
    labels = {role: id_plane(scene.items.stack_of(role), (0, 0, 2, 0)).tolist() for role in Role}
    assert labels[Role.HITTABLE] == [[1, 1, 0]]
    assert labels[Role.OCCLUDER] == [[0, 2, 2]]
    assert labels[Role.MOVER] == [[0, 3, 0]]
    assert labels[Role.HUD] == labels[Role.BACKGROUND] == [[0, 0, 0]]


@pytest.mark.parametrize(
    ("size", "fits"),
    [
        ((65_535, 1), True),
        ((65_536, 1), False),
        ((1, 65_536), False),
        ((2**14, 2**14), True),
        ((2**14, 2**14 + 1), False),
    ],
)
def test_plane_limits(size: tuple[int, int], fits: bool) -> None:
    box = (-5, 10**9, size[0] - 6, 10**9 + size[1] - 1)
    assert plane_fits(box) is fits
    scene = Scene(size, box[:2])
    if fits:
        assert scene.derived.label_plane() is scene.derived.label_plane() is not None
        return
    assert scene.derived.label_plane() is None
    message = f"bounds: expected a plane of sides up to 65535 px .*got {size[0]} x {size[1]}"
    for make in (lambda: LabelPlane(box), lambda: id_plane(scene.items.stack(), box), scene.planes):
        with pytest.raises(InputError, match=message):
            make()


def test_a_world_without_bounds_has_no_label_plane() -> None:
    assert Scene().derived.label_plane() is None


def test_a_plane_that_is_not_read_costs_nothing_to_ask_about() -> None:
    """Each change is looked at once, and a plane that lags behind by its own size is given up."""
    scene = Scene((100, 100))
    item = scene.add(np.ones((10, 10), np.bool_), (20, 20))
    plane = LabelPlane((0, 0, 99, 99))
    plane.read(scene.items)
    costs = []
    for step in range(60):
        scene.move(item, (20 + step % 3, 20))
        costs.append(plane.cost(scene.items))
        assert plane.cost(scene.items) == costs[-1]
    assert costs[:3] == [200, 400, 600] and costs[-1] == 10_000
    assert plane.labels is None
    assert np.array_equal(plane.read(scene.items), brute_labels(scene, (0, 0, 99, 99)))


def test_a_plane_that_is_being_drawn_is_not_asked_what_it_lacks() -> None:
    scene = Scene((30, 20))
    item = scene.add(np.ones((5, 5), np.bool_), (9, 9))
    plane = LabelPlane((0, 0, 29, 19))
    plane.read(scene.items)
    scene.move(item, (3, 3))
    with ThreadPoolExecutor(1) as pool:
        with plane._lock:
            asked = pool.submit(plane.cost, scene.items)
            assert not wait([asked], timeout=0.2).done
        assert asked.result() == 50
