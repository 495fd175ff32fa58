"""Boxes of a code plane drawn anew, in numpy and compiled: every pixel as one that is asked by itself."""

import importlib
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_compose import brute_codes, random_scene

from hitplanes import Scene
from hitplanes.planes.bits import label_plane as compose
from hitplanes.planes.bits import label_plane as painting
from hitplanes.planes.bits import label_plane as steps
from hitplanes.planes.bits.label_plane import LabelPlane, label_plane

BOX = (-9, 4, 40, 33)
NAMES = ["hitplanes.planes.bits.label_plane", "hitplanes.planes.jit.scene"]


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


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32), st.sampled_from([0, 1, 3, 7, 8, 9, 16, 17, 40]), st.integers(0, 9))
@pytest.mark.parametrize("each", [False, True])
@pytest.mark.parametrize("kind", [np.uint16, np.uint32])
def test_drawn_anew_is_what_each_pixel_says(kernels: Any, kind: Any, each: bool, seed: int, count: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    scene = heap(rng, count)
    dirty, stack, truth = boxes_in(rng, n), scene.items.stack(), brute_codes(scene, BOX)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(painting, "PAIRS", int(rng.choice([1, 20, 2**18])))
        if each:
            patch.setattr(painting, "GROUPED_AREA", int(rng.choice([0, 100])))
        labels = np.full(truth.shape, 999, kind)
        kernels.paint(labels, BOX[0], BOX[1], dirty, painting.places_of(stack), stack.masks)
    drawn = np.zeros(truth.shape, np.bool_)
    for x, y, x_max, y_max in dirty.tolist():
        drawn[y - BOX[1] : y_max - BOX[1] + 1, x - BOX[0] : x_max - BOX[0] + 1] = True
    assert np.array_equal(labels, np.where(drawn, truth, 999))


@pytest.fixture(params=["hitplanes.planes.bits.label_plane", "hitplanes.planes.jit.scene"])
def stepping(request: pytest.FixtureRequest) -> Any:
    if ".jit." in request.param:
        pytest.importorskip("numba")
    return importlib.import_module(request.param)


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32), st.integers(1, 30), st.sampled_from([1, 3, 60, 10**9]))
@pytest.mark.parametrize("kind", [np.uint16, np.uint32])
def test_a_plane_that_follows_steps_is_what_each_pixel_says(
    monkeypatch: pytest.MonkeyPatch, stepping: Any, kind: Any, seed: int, count: int, reach: int
) -> None:
    """Short and long ones, over the edge and off it, of one item and of many."""
    rng = np.random.default_rng(seed)
    scene, (x, y, x_max, y_max) = heap(rng, count), BOX
    stack, size = scene.items.stack(), (y_max - y + 1, x_max - x + 1)
    places = painting.places_of(stack)
    near, labels = painting.near_of(places, x, y, *size), brute_codes(scene, BOX).astype(kind)
    monkeypatch.setattr(painting, "GROUPED_AREA", int(rng.choice([0, 2**14])))
    for _ in range(6 if len(stack) else 0):
        rank = rng.permutation(len(stack))[: rng.choice([1, 1, 4])]
        old = places[rank, :4]
        now = old + np.tile(rng.integers(-reach, reach + 1, (len(rank), 2)), 2)
        scene.move(stack.ids[rank], scene.items.position_256[stack.ids[rank]] / 256 + (now - old)[:, :2])
        if len(rank) == 1:
            pixels = stepping.follow(labels, x, y, int(rank[0]), *now[0].tolist(), places, near, stack.masks)
        else:
            pixels = stepping.follow_all(labels, x, y, rank, now, places, near, stack.masks)
        assert np.array_equal(labels, brute_codes(scene, BOX))
        assert pixels == sum(inside(box).sum() for box in [*old.tolist(), *now.tolist()])
        assert np.array_equal(places, painting.places_of(scene.items.stack()))
        assert np.array_equal(near, painting.near_of(places, x, y, *size))


def inside(box: list[int]) -> Any:
    """Pixels of BOX that are in a box."""
    column, row = np.meshgrid(np.arange(BOX[0], BOX[2] + 1), np.arange(BOX[1], BOX[3] + 1))
    return (box[0] <= column) & (column <= box[2]) & (box[1] <= row) & (row <= box[3])


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
        assert np.array_equal(plane.read(scene.items), brute_codes(scene))
    labels = label_plane(scene.items.stack(), BOX)
    assert np.array_equal(labels, brute_codes(scene, BOX) >> 1)


@pytest.mark.parametrize("many", [False, True])
def test_a_short_step_is_drawn_as_one_box(many: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The boxes before and after are joined where that is no more to draw, also with those whose form changed."""
    drawn: list[list[int]] = []
    monkeypatch.setattr(steps, "draw", lambda _, box, __, ___: drawn.append(list(box)))
    scene = Scene((100, 60))
    ids = [scene.add(np.ones((4, 10), np.bool_), (20.5, 10.5))]
    ids += [scene.add(np.ones((4, 10), np.bool_), role="mover")] if many else []
    plane = scene.label_plane()
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
        (_, _, before, after), *_ = scene.items.changes(scene.version - 1)  # type: ignore[misc]
        plane.read(scene.items)
        assert drawn == boxes
        assert compose._dirt(before, after, plane.box_xyxy)[0].tolist() == boxes
        drawn.clear()
