"""What lies in front at single pixels, with and without the coarse map, against a look at each."""

import importlib
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hitplanes import Point, Scene, Sprite, fire
from hitplanes.planes.bits.label_plane import occupied

SEEDS = st.integers(0, 2**32)
QUIET = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(params=["hitplanes.planes.bits.label_plane", "hitplanes.planes.jit.areas"])
def kernels(request: pytest.FixtureRequest) -> ModuleType:
    if ".jit." in request.param:
        pytest.importorskip("numba")
    return importlib.import_module(request.param)


def plane(rng: np.random.Generator, kind: type) -> np.ndarray:
    """Codes of a few items in a plane of any size, most of it empty."""
    height, width = rng.integers(1, 30, 2)
    labels = rng.choice([2, 3, 4, 5, 6, 7], (height, width)).astype(kind)
    labels[rng.random((height, width)) < rng.choice([0, 0.5, 0.97, 1])] = 0
    return labels


@QUIET
@given(SEEDS, st.sampled_from([np.uint16, np.uint32]), st.booleans())
def test_what_lies_in_front_at_a_pixel(kernels: ModuleType, seed: int, kind: type, coarse: bool) -> None:
    rng = np.random.default_rng(seed)
    labels, objects = plane(rng, kind), rng.random(4) < 0.6
    objects[0] = False
    height, width = labels.shape
    left, top = (int(c) for c in rng.integers(-20, 20, 2))
    beyond, count = int(rng.choice([0, 1, 3, 2**40])), int(rng.choice([0, 1, 2, 40]))
    x = left + rng.integers(-beyond, width + beyond, count)
    y = top + rng.integers(-beyond, height + beyond, count)
    cells = occupied(labels) if coarse else None
    at_256 = np.stack([x, y], axis=1) * 256 + rng.integers(-128, 128, (count, 2))
    place, label, xy = kernels.front_at(labels, cells, (left, top, left + width - 1, top + height - 1), at_256, objects)
    told = []
    for i, (column, row) in enumerate(zip((x - left).tolist(), (y - top).tolist(), strict=True)):
        code = int(labels[row, column]) if 0 <= column < width and 0 <= row < height else 0
        if objects[code // 2]:
            told.append((i, code // 2))
    assert list(zip(place.tolist(), label.tolist(), strict=True)) == told
    assert xy.tolist() == np.stack([x, y], axis=1)[place].tolist()


@pytest.mark.parametrize("coarse", [False, True])
def test_one_pixel_beyond_the_edges_there_is_nothing(kernels: ModuleType, coarse: bool) -> None:
    labels, objects = np.full((9, 16), 2, np.uint16), np.array([False, True])
    cells = occupied(labels) if coarse else None
    for x, y in ((-1, 3), (16, 3), (3, -1), (3, 9), (-1, -1), (16, 9)):
        for also in ([], [5]):
            at = np.array([[x, y], *([k, k] for k in also)])
            place, *_ = kernels.front_at(labels, cells, (0, 0, 15, 8), 256 * at, objects)
            assert place.tolist() == [1] * len(also)


@QUIET
@given(SEEDS)
def test_cells_of_the_coarse_map_are_those_that_hold_something(seed: int) -> None:
    labels = plane(np.random.default_rng(seed), np.uint16)
    height, width = labels.shape
    told = [[labels[y : y + 8, x : x + 8].any() for x in range(0, width, 8)] for y in range(0, height, 8)]
    assert occupied(labels).tolist() == told


def test_the_coarse_map_is_made_when_it_pays_and_gone_after_a_change(jit: bool) -> None:
    scene = Scene((64, 64))
    some = scene.add(Sprite.from_mask(np.ones((5, 5), np.bool_)), (20, 20))

    def hits(x: float, looks: int) -> int:
        return len(fire(scene, Point(), np.full((looks, 2), x), strategy="built"))

    assert [hits(20, 30), hits(50, 33)] == [30, 0]
    plane = scene.derived.label_plane()
    assert plane is not None and plane.cells(0) is None  # 63 looks were made, and it has 64 cells
    assert hits(20, 1) == 1
    cells = plane.cells(0)
    assert cells is not None and cells.shape == (8, 8) and cells.sum() == 1
    assert [hits(20, 9), hits(50, 9)] == [9, 0]
    scene.move(some, (50, 50))
    assert [hits(20, 1), hits(50, 1)] == [0, 1] and plane.cells(0) is None
    assert [hits(20, 62), hits(50, 1), hits(20, 1)] == [0, 1, 0] and plane.cells(0) is not None
    scene.add(Sprite.from_mask(np.ones((50, 50), np.bool_)), (28, 28))
    assert [hits(4, 64), hits(4, 1)] == [64, 1] and plane.cells(0) is None  # more than half of it holds something
