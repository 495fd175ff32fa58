"""Images and shapes to placed masks, against a reference that asks one pixel at a time, and the laws of placement."""

import copy
import dataclasses
import itertools
import math
import os
import pickle
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import oracle_raster
import oracle_sprite as oracle
import pytest
from examples import examples
from hypothesis import HealthCheck, assume, example, given
from hypothesis import strategies as st
from some_of import in_turn

from hitplanes.planes.common.backend import LruCache, kernels_of
from hitplanes.planes.common.checks import InputError
from hitplanes.planes.common.limits import VARIANT_BYTES
from hitplanes.planes.grid import rasterize
from hitplanes.planes.scene import variants
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite, as_sprite, rows_of
from hitplanes.planes.scene.variants import Transform, Variant, picture_of, transform_of, variant_of, variants_of
from hitplanes.planes.volumes.fit import bounding

ROOT = Path(__file__).parent.parent

AGAINST = examples(80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
LAWS = examples(54, deadline=None)

FULL = 1 << 16
FLIPS = ("none", "x", "y", "xy")
FLIPPED_X = {"none": "x", "x": "none", "y": "xy", "xy": "y"}
SCALES = ((1.0, 1.0), (2.0, 2.0), (0.5, 0.5), (1.5, 1.5), (2.0, 0.5), (0.3, 0.3), (1.0, 3.0), (0.7, 1.0), (0.01, 0.01))
WHITE = (255, 255, 255)

Pixels = set[tuple[int, int]]

angles = st.one_of(
    st.integers(-8, 8).map(lambda n: 45.0 * n), st.integers(-24, 24).map(lambda n: 15.0 * n), st.floats(-400, 400)
)
scales = st.one_of(st.sampled_from(SCALES), st.tuples(st.floats(0.2, 2.5), st.floats(0.2, 2.5)))
positions = st.tuples(*2 * [st.one_of(st.integers(-5, 5).map(lambda n: 128 * n), st.integers(-2000, 2000))])
pivots = st.none() | st.tuples(*2 * [st.one_of(st.integers(-3, 9).map(lambda n: 128 * n), st.integers(-700, 2000))])


@st.composite
def masks(draw: st.DrawFn, most: int = 6) -> np.ndarray:
    """Draw masks: any pixels, a single one, a ring around a hole, a full one, an empty one."""
    height, width = draw(st.integers(1, most)), draw(st.integers(1, most))
    kind = draw(st.sampled_from(["any", "any", "any", "single", "hole", "full", "empty"]))
    mask = np.zeros((height, width), np.bool_)
    if kind == "any":
        mask[:] = np.array(draw(st.lists(st.booleans(), min_size=mask.size, max_size=mask.size))).reshape(mask.shape)
    elif kind == "single":
        mask[draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))] = True
    elif kind in ("hole", "full"):
        mask[:] = True
        mask[1:-1, 1:-1] = kind == "full"
    return mask


def pixels_of(variant: Variant, position: tuple[int, int]) -> Pixels:
    """World pixels of a variant at a position, by the rule of the top-left corner."""
    left, top = (position[0] - variant.pivot_x + 128) // 256, (position[1] - variant.pivot_y + 128) // 256
    return {(int(x) + left, int(y) + top) for y, x in np.argwhere(variant.mask)}


def placed(sprite: Sprite, position: tuple[int, int], **pose: Any) -> Pixels:
    return pixels_of(variant_of(sprite, posed(sprite, **pose)), position)


def posed(
    sprite: Sprite, flip: str = "none", scale: tuple[float, float] = (1, 1), angle: float = 0.0, frame: int = 0
) -> Transform:
    return transform_of(sprite, frame, flip, scale, angle)


def turn_of(flip: str, scale: tuple[float, float], angle: float) -> oracle.Turn:
    sx, sy = (round(v * FULL) for v in scale)
    return oracle.Turn(flip, (sx, sy), *oracle_raster.quarter_turns(angle))


def sprite_of(mask: np.ndarray, pivot: tuple[int, int] | None = None) -> Sprite:
    return Sprite.from_mask(mask, pivot_xy=None if pivot is None else (pivot[0] / 256, pivot[1] / 256))


# Placement against the reference


@AGAINST
@given(masks(), pivots, st.sampled_from(FLIPS), scales, angles, positions)
@example(np.ones((3, 2), np.bool_), None, "x", (1.0, 1.0), 45.0, (128, -128))
@example(np.eye(5, dtype=np.bool_), None, "none", (2.0, 0.5), -45.0, (0, 0))
@example(np.ones((1, 1), np.bool_), (2000, -700), "xy", (0.3, 0.3), 135.0, (1, 1))
@example(np.ones((60, 90), np.bool_), None, "none", (1 / 256, 8.0), 40.0, (1, 1))  # corners 120,000 px from the frame
@example(np.ones((4, 3), np.bool_), (129, 127), "y", (1.5, 1.5), 90.0, (64, 192))
def test_placed_mask_is_the_reference(
    jit: bool,
    mask: np.ndarray,
    pivot: tuple[int, int] | None,
    flip: str,
    scale: tuple[float, float],
    angle: float,
    position: tuple[int, int],
) -> None:
    expected = oracle.placed_mask(mask.tolist(), pivot, turn_of(flip, scale, angle), position)
    assert placed(sprite_of(mask, pivot), position, flip=flip, scale=scale, angle=angle) == expected


def mapping(rng: random.Random, frames: list[np.ndarray], grids: int) -> tuple[np.ndarray, variants.Grids]:
    """Grids of one size, a frame and a scale for each, many of whose places are on borders, or a few parts beside."""
    which, size = np.array([rng.randrange(len(frames)) for _ in range(grids)]), [rng.randint(1, 12), rng.randint(1, 12)]
    fine, off = rng.choice([(1, 0), (1 << 20, 2), (1 << 40, 2)])
    unit = np.array([[rng.randint(1, 6) * fine for _ in range(2)] for _ in which])
    step = [[[rng.randint(-9, 9) * fine + rng.randint(-off, off) for _ in range(2)] for _ in range(2)] for _ in which]
    sides = np.array([frames[k].shape[::-1] for k in which])
    first = [
        [rng.randint(-9, u * w // fine + 9) * fine for u, w in zip(*row, strict=True)]
        for row in zip(unit.tolist(), sides.tolist(), strict=True)
    ]
    return which, variants.Grids(np.zeros_like(unit), np.array([size] * grids), np.array(first), np.array(step), unit)


def squares_at(place: np.ndarray, unit: np.ndarray, shape: tuple[int, ...]) -> set[tuple[int, int]]:
    """Squares (row, column) of a frame that hold a place: two of them on a border, four at a corner."""
    x, y = ({int(p // u), int(-(-p // u) - 1)} for p, u in zip(place, unit, strict=True))
    return {(row, column) for row in y & set(range(shape[0])) for column in x & set(range(shape[1]))}


@LAWS
@given(masks(), masks(), st.integers(0, 2**32))
def test_centres_are_mapped_back_to_the_closed_squares_that_hold_them(
    mask: np.ndarray, other: np.ndarray, seed: int
) -> None:
    frames = [mask, other]
    which, grids = mapping(random.Random(seed), frames, 3)
    h, w = (max(frame.shape[axis] for frame in frames) for axis in (0, 1))
    planes = np.zeros((2, h + 2, w + 2), np.bool_)
    for plane, frame in zip(planes, frames, strict=True):
        plane[1 : frame.shape[0] + 1, 1 : frame.shape[1] + 1] = frame
    width, height = grids.size_wh.max(axis=0).tolist()
    found = variants.resample(planes, which, grids.first, grids.step, grids.unit, (width, height))
    for n, j, i in itertools.product(range(3), range(height), range(width)):
        place = grids.first[n] + i * grids.step[n, :, 0] + j * grids.step[n, :, 1]
        inside = squares_at(place, grids.unit[n], (h, w))
        k, row, column = (int(v) for v in np.unravel_index(found[n, j, i], planes.shape))
        assert k == which[n]
        assert planes[k, row, column] == any(planes[k, row + 1, column + 1] for row, column in inside)
        assert (row - 1, column - 1) in inside if inside else not planes[k, row, column]


def test_a_place_just_beyond_a_frame_is_not_held(jit: bool) -> None:
    """The second centre lies 2**-22 px below the last row; the first pixel of the next frame is set."""
    frames = [np.array([[1], [0], [0], [0], [0]], np.bool_), np.ones((1, 1), np.bool_)]
    unit, first = np.array([[6 << 20, 4 << 20]]), np.array([[12 << 20, 16 << 20]])
    step = np.array([[[2 - (9 << 20), (8 << 20) - 1], [1 + (4 << 20), 1]]])
    grids = variants.Grids(np.zeros_like(unit), np.array([[12, 1]]), first, step, unit)
    turned = kernels_of(variants).turned_masks(frames, np.array([0]), grids)
    assert turned.area.tolist() == [0]


@AGAINST
@given(masks(), masks(), st.integers(0, 2**32))
def test_a_pixel_is_set_if_a_set_square_holds_its_centre(
    jit: bool, mask: np.ndarray, other: np.ndarray, seed: int
) -> None:
    """Before it is cropped, pixel by pixel."""
    frames, rng = [mask, other], random.Random(seed)
    which, grids = mapping(rng, frames, 5)
    turned = kernels_of(variants).turned_masks(frames, which, grids)
    for n, (found, corner, area) in enumerate(zip(*turned, strict=True)):
        (width, height), frame = grids.size_wh[n].tolist(), frames[which[n]]
        places = {
            (j, i): grids.first[n] + i * grids.step[n, :, 0] + j * grids.step[n, :, 1]
            for j, i in itertools.product(range(height), range(width))
        }
        held = {at for at, p in places.items() if any(frame[s] for s in squares_at(p, grids.unit[n], frame.shape))}
        assert area == len(held)
        if held:
            top, left = (min(at[axis] for at in held) for axis in (0, 1))
            whole = np.zeros([max(at[axis] for at in held) + 1 for axis in (0, 1)], np.bool_)
            whole[tuple(np.array(sorted(held)).T)] = True
            assert corner.tolist() == [left, top] and np.array_equal(found, whole[top:, left:])
        else:
            assert found.size == 0


@AGAINST
@given(st.lists(st.tuples(masks(), pivots, st.sampled_from(FLIPS), scales, angles), min_size=1, max_size=6))
def test_masks_that_are_made_together_are_those_made_alone(jit: bool, poses: list[tuple]) -> None:
    """Frames of several sizes and scales, some of them twice; large ones are made in strips."""
    sprites = [sprite_of(mask, pivot) for mask, pivot, *_ in poses]
    transforms = [posed(sprite, *pose) for sprite, (_, _, *pose) in zip(sprites, poses, strict=True)]
    alone = [
        [variant_of(Sprite(sprite.frames, sprite.pivot_256), transform) for transform in transforms]
        for sprite in sprites
    ]
    pairs = list(itertools.product(sprites, transforms))
    with mock.patch.object(kernels_of(variants), "MAPPED_PIXELS", 60):
        together = variants_of(*zip(*pairs, strict=True))
        again = variants_of(*zip(*pairs, strict=True))
    assert all(one is other for one, other in zip(together, again, strict=True))
    for one, other in zip(together, itertools.chain.from_iterable(alone), strict=True):
        assert np.array_equal(one.mask, other.mask)
        assert (one.transform, one.pivot_x, one.pivot_y, one.area) == (
            other.transform,
            other.pivot_x,
            other.pivot_y,
            other.area,
        )
        assert not one.mask.flags.writeable


@pytest.mark.parametrize(("scale", "flip"), in_turn(SCALES, FLIPS))
@pytest.mark.parametrize("angle", [0, 90, 180, 270, 45, -45, 135, 30])
def test_every_transform_of_an_uneven_mask_is_the_reference(
    scale: tuple[float, float], angle: float, flip: str
) -> None:
    mask = np.array([[1, 1, 0, 1], [1, 0, 0, 0], [1, 1, 1, 0]], np.bool_)
    expected = oracle.placed_mask(mask.tolist(), None, turn_of(flip, scale, angle), (77, -300))
    assert placed(sprite_of(mask), (77, -300), flip=flip, scale=scale, angle=angle) == expected


@pytest.mark.parametrize("pivot", [(37, 200), (-60, 300), (513, 449), (64, 65)])
@pytest.mark.parametrize("angle", [30, 45, 107.5, -12])
def test_a_turn_keeps_the_pivot_where_it_is_between_the_pixels(angle: float, pivot: tuple[int, int]) -> None:
    mask = np.array([[1, 1, 0, 1], [1, 0, 0, 0], [1, 1, 1, 0]], np.bool_)
    for scale in ((1.0, 1.0), (1.0, 1.5)):
        expected = oracle.placed_mask(mask.tolist(), pivot, turn_of("x", scale, angle), (77, -300))
        assert placed(sprite_of(mask, pivot), (77, -300), flip="x", scale=scale, angle=angle) == expected


@pytest.mark.parametrize("steps", [1, 2, 7, 72, 65_536])
def test_a_sprite_with_a_step_turns_by_whole_steps_of_a_turn(steps: int) -> None:
    mask = np.array([[1, 1, 0, 1, 0], [1, 0, 0, 0, 0], [1, 1, 1, 0, 0]], bool)
    stepped, free = Sprite.from_mask(mask, angle_step=360 / steps), Sprite.from_mask(mask)
    for turn, number, rest in itertools.product((-360 * 10**9, 0, 360), (0, 1, 2, steps - 1), (-0.49, 0, 0.49)):
        asked, nearest = turn + (number + rest) * 360 / steps, number % steps * 360 / steps
        transform = posed(stepped, angle=asked)
        assert transform == posed(free, angle=nearest), asked
        assert np.array_equal(variant_of(stepped, transform).mask, variant_of(free, transform).mask)


def test_steps_hold_for_every_kind_of_sprite_and_in_the_scene() -> None:
    image = np.full((3, 9, 4), 255, np.uint8)
    outline = [(-9, -1), (9, -1), (4, 2)]
    kinds: list[tuple[Callable[..., Sprite], tuple]] = [
        (Sprite.from_image, (image,)),
        (Sprite.from_mask, (image[..., 3] > 0,)),
        (Sprite.polygon, (outline,)),
        (Sprite.box, (9, 2)),
        (Sprite.circle, (9,)),
    ]
    scene, poses = Scene(), ((0, 0), (14.9, 0), (15.1, 30), (350, 0), (-40, -30), (44, 30))
    for (make, what), (angle, nearest) in itertools.product(kinds, poses):
        sprites = make(*what, angle_step=30), make(*what)
        stepped, free = (scene.add(sprite, (0, 0), scale=(2, 1)) for sprite in sprites)
        scene.set([stepped, free], angle=[angle, nearest])
        assert np.array_equal(*(scene.items.variants[item].mask for item in (stepped, free)))
        assert scene.items.angles[stepped] == angle


def test_the_scene_places_by_the_same_rule() -> None:
    mask = np.array([[1, 0], [1, 1], [0, 1]], np.bool_)
    scene = Scene()
    item = scene.add(mask, (3.5, -2.25), angle=100, scale=(1.5, 2), flip="x")
    found, (x, y) = scene.mask(item)
    expected = oracle.placed_mask(mask.tolist(), None, turn_of("x", (1.5, 2), 100), (896, -576))
    assert {(int(j) + x, int(i) + y) for i, j in np.argwhere(found)} == expected


def test_a_diagonal_turn_as_a_picture() -> None:
    """A plus turned by 45 degrees; a centre on the border of a set pixel is in."""
    plus = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.bool_)
    assert rows_of(variant_of(as_sprite(plus), posed(as_sprite(plus), angle=45)).mask) == ["#.#", ".#.", "#.#"]
    square = as_sprite(np.ones((3, 3), np.bool_))
    assert rows_of(variant_of(square, posed(square, angle=45)).mask) == ["..#..", ".###.", "#####", ".###.", "..#.."]


# Laws


@LAWS
@given(masks(), pivots, st.sampled_from(FLIPS), scales, angles)
def test_four_quarter_turns_are_the_identity(
    mask: np.ndarray, pivot: tuple[int, int] | None, flip: str, scale: tuple[float, float], angle: float
) -> None:
    """One quarter turn more turns the variant and its pivot by the array; four of them give it back."""
    sprite = sprite_of(mask, pivot)
    base = transform_of(sprite, 0, flip, scale, angle)
    transforms = [
        Transform(0, flip, base.scale_x, base.scale_y, (base.quarter + k) % 4, base.c, base.s) for k in range(5)
    ]
    made = [variant_of(sprite, transform) for transform in transforms]
    assert (made[4].pivot_x, made[4].pivot_y) == (made[0].pivot_x, made[0].pivot_y)
    assert np.array_equal(made[4].mask, made[0].mask)
    for before, after in itertools.pairwise(made):
        assert np.array_equal(after.mask, np.rot90(before.mask, -1))
        if before.area:
            height = before.mask.shape[0]
            assert (after.pivot_x, after.pivot_y) == (256 * (height - 1) - before.pivot_y, before.pivot_x)


@pytest.mark.parametrize("angle", [0.0, 90.0, 180.0, 270.0, 37.5])
def test_whole_turns_change_nothing(angle: float) -> None:
    sprite = as_sprite(np.tri(5, 3, dtype=np.bool_))
    assert {posed(sprite, angle=angle + 360 * k) for k in (-1, 0, 1, 2)} == {posed(sprite, angle=angle)}


@LAWS
@given(masks(), st.sampled_from(FLIPS), scales, angles)
@example(np.eye(3, dtype=np.bool_), "none", (1.5, 1.5), 30.0)
@example(np.eye(4, dtype=np.bool_), "y", (1.5, 1.5), -45.0)
def test_a_mirrored_sprite_turns_into_the_mirror_image(
    mask: np.ndarray, flip: str, scale: tuple[float, float], angle: float
) -> None:
    """Along a diagonal, which belongs to one of two quarters, only where both lie on the same grid."""
    across, down = oracle_raster.unit(angle)
    assume(abs(across) != abs(down) or (mask.shape[0] == mask.shape[1] and scale[0] == scale[1]))
    sprite = sprite_of(mask)
    one = variant_of(sprite, posed(sprite, flip=flip, scale=scale, angle=angle))
    other = variant_of(sprite, posed(sprite, flip=FLIPPED_X[flip], scale=scale, angle=-angle))
    assert np.array_equal(other.mask, one.mask[:, ::-1])
    if one.area:
        assert (other.pivot_x, other.pivot_y) == (256 * (one.mask.shape[1] - 1) - one.pivot_x, one.pivot_y)


@LAWS
@given(masks(), pivots, st.integers(1, 5), st.integers(1, 5))
def test_whole_scales_repeat_pixels(mask: np.ndarray, pivot: tuple[int, int] | None, across: int, down: int) -> None:
    sprite = sprite_of(mask, pivot)
    variant = variant_of(sprite, posed(sprite, scale=(across, down)))
    repeated = np.repeat(np.repeat(mask, down, axis=0), across, axis=1)
    assert np.array_equal(variant.mask, cropped(repeated))


def cropped(mask: np.ndarray) -> np.ndarray:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] if len(rows) else np.zeros((0, 0), np.bool_)


def test_variants_are_cropped_counted_and_read_only() -> None:
    mask = np.zeros((7, 9), np.bool_)
    mask[2:5, 3:8] = [[1, 0, 1, 1, 0], [0, 0, 0, 0, 1], [1, 1, 0, 0, 0]]
    sprite = as_sprite(mask)
    variant = variant_of(sprite, Transform())
    assert np.array_equal(variant.mask, mask[2:5, 3:8])
    assert (variant.pivot_x, variant.pivot_y, variant.area) == (256, 256, 6)
    assert not variant.mask.flags.writeable


def test_an_empty_mask_stays_empty() -> None:
    sprite = as_sprite(np.zeros((4, 4), np.bool_))
    for transform in (Transform(), posed(sprite, angle=30), posed(sprite, scale=(3, 2), angle=91)):
        variant = variant_of(sprite, transform)
        assert (variant.mask.shape, variant.area) == ((0, 0), 0)


@LAWS
@given(masks(), st.integers(0, 2**32), pivots, st.sampled_from(FLIPS), scales, angles)
def test_what_is_drawn_is_what_is_tested(
    mask: np.ndarray, seed: int, pivot: tuple[int, int] | None, flip: str, scale: tuple[float, float], angle: float
) -> None:
    """The drawn image is opaque where the mask is set and nowhere else, on the same pixels of the world."""
    image = np.random.default_rng(seed).integers(0, 256, (*mask.shape, 4)).astype(np.uint8)
    image[:, :, 3] = np.where(mask, image[:, :, 3] | 128, image[:, :, 3] & 127)
    sprite = Sprite.from_image(image, pivot_xy=None if pivot is None else (pivot[0] / 256, pivot[1] / 256))
    transform = posed(sprite, flip=flip, scale=scale, angle=angle)
    drawn, pivot_x, pivot_y = picture_of(sprite, transform, WHITE)
    opaque = drawn[:, :, 3] > 127
    left, top = (128 - pivot_x) // 256, (128 - pivot_y) // 256
    drawn_at = {(int(x) + left, int(y) + top) for y, x in np.argwhere(opaque)}
    assert drawn_at == pixels_of(variant_of(sprite, transform), (0, 0))
    known = {tuple(pixel) for pixel in image.reshape(-1, 4).tolist()} | {(0, 0, 0, 0)}
    assert {tuple(pixel) for pixel in drawn.reshape(-1, 4).tolist()} <= known


def test_a_plain_image_is_drawn_as_it_is() -> None:
    image = np.arange(3 * 4 * 4, dtype=np.uint8).reshape(3, 4, 4) * 5
    sprite = Sprite.from_image(image)
    for transform, expected in (
        (Transform(), image),
        (Transform(flip="x"), image[:, ::-1]),
        (Transform(quarter=1), np.rot90(image, -1)),
    ):
        assert np.array_equal(picture_of(sprite, transform, WHITE)[0], expected)


@pytest.mark.parametrize(("own", "used"), [(None, (1, 2, 3)), ((9, 8, 7), (9, 8, 7))])
def test_bare_masks_and_shapes_are_drawn_in_one_colour(
    own: tuple[int, int, int] | None, used: tuple[int, int, int]
) -> None:
    for sprite in (Sprite.from_mask([[True, False], [True, True]], color=own), Sprite.circle(3, color=own)):
        variant = variant_of(sprite, Transform())
        image, pivot_x, pivot_y = picture_of(sprite, Transform(), (1, 2, 3))
        assert np.array_equal(image[:, :, 3] == 255, variant.mask)
        assert (pivot_x, pivot_y) == (variant.pivot_x, variant.pivot_y)
        assert {tuple(p) for p in image[variant.mask].tolist()} == {(*used, 255)}


# Shapes

POINTS = st.tuples(*2 * [st.integers(-1500, 1500)])


@AGAINST
@given(
    st.lists(st.lists(POINTS, min_size=3, max_size=5), min_size=1, max_size=2),
    st.sampled_from(FLIPS),
    scales,
    angles,
    positions,
)
def test_placed_polygon_is_the_reference(
    rings: list[list[tuple[int, int]]], flip: str, scale: tuple[float, float], angle: float, position: tuple[int, int]
) -> None:
    first, *holes = [np.array(ring) / 256 for ring in rings]
    expected = oracle.placed_polygon(rings, turn_of(flip, scale, angle), position)
    assert placed(Sprite.polygon(first, holes), position, flip=flip, scale=scale, angle=angle) == expected


@AGAINST
@given(st.integers(0, 1800), st.sampled_from(FLIPS), scales, angles, positions)
@example(0, "none", (1.0, 1.0), 45.0, (0, 0))
@example(1280, "x", (2.0, 0.01), 90.0, (128, 128))
def test_placed_circle_is_the_reference(
    radius: int, flip: str, scale: tuple[float, float], angle: float, position: tuple[int, int]
) -> None:
    expected = oracle.placed_circle(radius, turn_of(flip, scale, angle), position)
    assert placed(Sprite.circle(radius / 256), position, flip=flip, scale=scale, angle=angle) == expected


def test_a_square_of_one_pixel() -> None:
    """Edges are in: a box of 2 px has three centres across, one of less than 2 px has one."""
    assert placed(Sprite.box(1, 1), (0, 0)) == {(0, 0)}
    assert placed(Sprite.box(0, 0), (255, 128)) == {(1, 1)}
    assert len(placed(Sprite.box(2, 2), (0, 0))) == 9
    assert len(placed(Sprite.box(2 - 2 / 256, 2), (0, 0))) == 3
    assert placed(as_sprite([[True]]), (0, 0), angle=33) == {(0, 0)}


def test_a_scaled_circle_is_an_ellipse_and_turns() -> None:
    circle = Sprite.circle(4)
    upright = variant_of(circle, posed(circle, scale=(1, 0.5)))
    assert rows_of(upright.mask) == ["....#....", ".#######.", "#########", ".#######.", "....#...."]
    turned = variant_of(circle, posed(circle, scale=(1, 0.5), angle=90))
    assert np.array_equal(turned.mask, upright.mask.T)


def test_a_polygon_with_a_hole_turns_by_quarters() -> None:
    ring = Sprite.polygon([(-3, -2), (3, -2), (3, 2), (-1, 2)], [[(-1.5, -0.5), (1.5, -0.5), (1.5, 1.5)]])
    made = [variant_of(ring, posed(ring, angle=90 * k)) for k in range(4)]
    assert 0 < made[0].area < made[0].mask.size
    assert not made[0].mask[2, 3]
    for before, after in itertools.pairwise([*made, made[0]]):
        assert np.array_equal(after.mask, np.rot90(before.mask, -1))


@LAWS
@given(st.integers(0, 900), st.integers(0, 900), st.sampled_from(FLIPS), angles)
def test_a_box_is_its_polygon(width: int, height: int, flip: str, angle: float) -> None:
    w, h = width / 128, height / 128
    corners = [(-w / 2, -h / 2), (w / 2, -h / 2), (w / 2, h / 2), (-w / 2, h / 2)]
    pose = {"flip": flip, "angle": angle}
    assert placed(Sprite.box(w, h), (5, 9), **pose) == placed(Sprite.polygon(corners), (5, 9), **pose)


# Frames, transparency, what is taken


SHEET = np.arange(4 * 6 * 4).reshape(4, 6, 4).astype(np.uint8)
SHEET[:, :, 3] = np.where(np.arange(24).reshape(4, 6) % 3 == 0, 0, 255)


def test_a_grid_cuts_left_to_right_then_down() -> None:
    sprite = Sprite.from_image(SHEET, grid_wh=(3, 2))
    assert sprite.frame_count == 4
    for number, (x, y) in enumerate([(0, 0), (3, 0), (0, 2), (3, 2)]):
        frame = sprite.frames[number]
        assert np.array_equal(frame.image, SHEET[y : y + 2, x : x + 3])
        assert np.array_equal(frame.mask, SHEET[y : y + 2, x : x + 3, 3] > 127)
        assert placed(sprite, (256, 128), frame=number) == placed(as_sprite(frame.mask), (256, 128))


def test_rectangles_cut_what_they_say() -> None:
    rects = [[1, 0, 2, 4], [0, 3, 6, 1], [5, 3, 1, 1], [0, 0, 6, 4]]
    sprite = Sprite.from_image(SHEET, rects_xywh=rects)
    assert sprite.frame_count == 4
    for frame, (x, y, w, h) in zip(sprite.frames, rects, strict=True):
        assert np.array_equal(frame.image, SHEET[y : y + h, x : x + w])


def test_a_pivot_holds_for_every_frame() -> None:
    sprite = Sprite.from_image(SHEET, rects_xywh=[[0, 0, 6, 4], [2, 0, 2, 4]], pivot_xy=(1, 0.5))
    for frame in range(2):
        mask = sprite.frames[frame].mask
        expected = oracle.placed_mask(mask.tolist(), (256, 128), turn_of("none", (1, 1), 90), (0, 0))
        assert placed(sprite, (0, 0), frame=frame, angle=90) == expected


@pytest.mark.parametrize("threshold", [0, 1, 127, 128, 254, 255])
def test_alpha_must_be_greater_than_the_threshold(threshold: int) -> None:
    image = np.zeros((1, 256, 4), np.uint8)
    image[0, :, 3] = np.arange(256)
    mask = Sprite.from_image(image, alpha_threshold=threshold).frames[0].mask
    assert np.flatnonzero(mask[0]).tolist() == list(range(threshold + 1, 256))


def test_a_colour_key_is_transparent_in_mask_and_picture() -> None:
    image = np.full((2, 3, 3), 200, np.uint8)
    image[0, 1] = image[1, 2] = (255, 0, 255)
    image[1, 0] = (255, 0, 254)
    sprite = Sprite.from_image(image, color_key=(255, 0, 255))
    assert rows_of(sprite.frames[0].mask) == ["#.#", "##."]
    assert np.array_equal(picture_of(sprite, Transform(), WHITE)[0][:, :, 3] > 0, sprite.frames[0].mask)


def test_an_image_without_alpha_is_all_mask() -> None:
    image = np.arange(5 * 3 * 3, dtype=np.uint8).reshape(5, 3, 3)
    sprite = as_sprite(image)
    assert sprite.frames[0].mask.all()
    assert np.array_equal(picture_of(sprite, Transform(), WHITE)[0][:, :, :3], image)


def _kinds(array: np.ndarray) -> Iterator[tuple[str, Any]]:
    wide = np.repeat(array, 2, axis=1)
    frozen = array.copy()
    frozen.flags.writeable = False
    yield "Fortran order", np.asfortranarray(array)
    yield "strided", wide[:, ::2]
    yield "reversed view", array[::-1, ::-1].copy()[::-1, ::-1]
    yield "read-only", frozen
    yield "memoryview", memoryview(np.ascontiguousarray(array))
    if array.dtype == np.bool_:
        yield "lists", array.tolist()
        yield "tuples", tuple(map(tuple, array.tolist()))
        yield "0 and 1", array.astype(np.int8)
        yield "unsigned", array.astype(np.uint64)


MASK = np.array([[1, 0, 1, 1], [0, 0, 1, 0], [1, 1, 1, 0]], np.bool_)
PICTURE = np.dstack([np.arange(12).reshape(3, 4) * 9, np.zeros((3, 4)), np.ones((3, 4)), MASK * 255]).astype(np.uint8)


@pytest.mark.parametrize(("kind", "given"), list(_kinds(MASK)), ids=lambda v: v if isinstance(v, str) else "")
def test_masks_of_every_kind_are_taken(kind: str, given: Any) -> None:
    before = np.array(given)
    sprite = as_sprite(given)
    found = variant_of(sprite, posed(sprite, flip="x", scale=(2, 1), angle=30))
    same = as_sprite(MASK)
    expected = variant_of(same, posed(same, flip="x", scale=(2, 1), angle=30))
    assert np.array_equal(found.mask, expected.mask), kind
    assert np.array_equal(np.array(given), before)


@pytest.mark.parametrize(("kind", "given"), list(_kinds(PICTURE)), ids=lambda v: v if isinstance(v, str) else "")
def test_images_of_every_kind_are_taken(kind: str, given: Any) -> None:
    before = np.array(given)
    sprite = Sprite.from_image(given, color_key=(9, 0, 1), grid_wh=(2, 3))
    assert np.array_equal(np.hstack([f.mask for f in sprite.frames]), MASK & (PICTURE[:, :, 0] != 9)), kind
    assert np.array_equal(np.array(given), before)


def test_a_sprite_keeps_what_it_was_given() -> None:
    """What happens to an array later does not reach the sprite, and the sprite cannot be written to."""
    mask, image = MASK.copy(), PICTURE.copy()
    sprites = as_sprite(mask), as_sprite(image)
    mask[:], image[:] = False, 0
    for sprite in sprites:
        assert np.array_equal(sprite.frames[0].mask, MASK)
        assert not sprite.frames[0].mask.flags.writeable
    assert as_sprite(sprites[0]) is sprites[0]


# What is refused


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: as_sprite(None), r"sprite: expected a Sprite, a mask .*got NoneType"),
        (lambda: as_sprite([True]), r"sprite: .*got \(1,\)"),
        (lambda: as_sprite([[True], [True, False]]), "sprite: expected"),
        (lambda: as_sprite([[0.0, 1.0]]), r"mask: expected booleans, got \[\[0\.0"),
        (lambda: as_sprite([[0, 2]]), r"mask\[0\]\[1\]: expected 0 or 1, got 2"),
        (lambda: as_sprite(np.zeros((2, 2, 3))), r"image: expected bytes .*got float64 \(2, 2, 3\)"),
        (lambda: as_sprite(np.zeros((2, 2, 2), np.uint8)), r"image: expected bytes .*got uint8 \(2, 2, 2\)"),
        (lambda: Sprite.from_mask(np.zeros((1, 32769), np.bool_)), "mask: .*sides up to 32768 px .*got 32769 x 1"),
        (lambda: Sprite.from_image(np.zeros((32769, 1, 3), np.uint8)), "image: .*got 1 x 32769"),
        (lambda: Sprite.from_mask(MASK, pivot_xy=(1, math.nan)), r"pivot_xy\[1\]: expected a finite number"),
        (lambda: Sprite.from_mask(MASK, pivot_xy=(1, 2, 3)), r"pivot_xy: expected shape \(2,\), got \(3,\)"),
        (lambda: Sprite.from_mask(MASK, color=(1, 2, 256)), r"color\[2\]: .*from 0 to 255, got 256"),
        (lambda: Sprite.from_image(PICTURE, alpha_threshold=256), "alpha_threshold: .*from 0 to 255, got 256"),
        (lambda: Sprite.from_image(PICTURE, alpha_threshold=True), "alpha_threshold: .*got True"),
        (lambda: Sprite.from_image(PICTURE, color_key=(1, 2)), r"color_key: expected shape \(3,\)"),
        (lambda: Sprite.from_image(PICTURE, grid_wh=(3, 3)), r"grid_wh: expected to divide .*4 x 3, got \[3, 3\]"),
        (lambda: Sprite.from_image(PICTURE, grid_wh=(0, 3)), r"grid_wh\[0\]: .*got 0"),
        (lambda: Sprite.from_image(PICTURE, rects_xywh=[]), "rects_xywh: expected"),
        (lambda: Sprite.from_image(PICTURE, rects_xywh=[[0, 0, 1, 1], [3, 0, 2, 1]]), r"rects_xywh\[1\]: .*4 x 3"),
        (lambda: Sprite.from_image(PICTURE, rects_xywh=[[0, 0, 0, 1]]), r"rects_xywh\[0\]:"),
        (lambda: Sprite.from_image(PICTURE, rects_xywh=[[0, 0, 1, 1]], grid_wh=(1, 1)), "frames: .*got both"),
        (lambda: Sprite.polygon([(0, 0), (1, 1)]), "points_xy: expected 3 points or more, got 2"),
        (lambda: Sprite.polygon([(0, 0), (1, 1), (2, math.inf)]), r"points_xy\[2\]\[1\]: expected a finite number"),
        (lambda: Sprite.polygon([(0, 0, 0)] * 3), r"points_xy: expected shape \(any, 2\), got \(3, 3\)"),
        (lambda: Sprite.polygon([(0, 0), (1, 1), (2, 0)], [[(0, 0)]]), r"holes\[0\]: expected 3 points"),
        (lambda: Sprite.polygon([(0, 0), (1, 1), (2**16, 0)]), r"points_xy\[2\]\[0\]: expected a number within"),
        (lambda: Sprite.circle(3, angle_step=7), "angle_step: expected 360 degrees by a whole number, .*got 7"),
        (lambda: Sprite.from_mask(MASK, angle_step=0), "angle_step: expected a number from 0.0054.* to 360, got 0"),
        (lambda: Sprite.box(3, 1, angle_step=math.nan), "angle_step: expected a finite number"),
        (lambda: Sprite.circle(-1), "radius: expected a number from 0 to 32768, got -1"),
        (lambda: Sprite.circle("3"), "radius: expected a number"),  # type: ignore[arg-type]
        (lambda: Sprite.box(1, -1), "height: expected a number from 0"),
        (lambda: posed(as_sprite(MASK), flip="left"), "flip: expected one of 'none', 'x', 'y', 'xy', got 'left'"),
        (lambda: posed(as_sprite(MASK), frame=1), "frame: .*from 0 to 0, got 1"),
        (lambda: posed(Sprite.circle(1), frame=1), "frame: .*from 0 to 0, got 1"),
        (lambda: posed(as_sprite(MASK), scale=(1, 257)), r"scale\[1\]: expected a number from .*256, got 257"),
        (lambda: posed(as_sprite(MASK), scale=(0, 1)), r"scale\[0\]: .*got 0"),
        (lambda: Sprite.from_image([[1], [1, 2]]), "image: expected"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_a_pose_that_makes_a_mask_too_large_is_refused() -> None:
    large = as_sprite(np.ones((300, 300), np.bool_))
    for sprite in (large, Sprite.circle(300), Sprite.box(300, 300)):
        with pytest.raises(InputError, match="scale: expected a mask of sides up to"):
            variant_of(sprite, posed(sprite, scale=(256, 256)))


@pytest.mark.parametrize("sprite", [Sprite.box(60, 1), Sprite.circle(30)], ids=["box", "ellipse"])
def test_a_thin_shape_that_turns_into_a_large_mask_is_refused(sprite: Sprite, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lying flat it is 60 x 1; turned by 45 degrees its mask is 43 x 43."""
    monkeypatch.setattr("hitplanes.planes.scene.sprite.MASK_AREA_MAX", 600)
    flat = (1.0, 1 / 64)
    assert variant_of(sprite, posed(sprite, scale=flat)).area > 0
    with pytest.raises(InputError, match="scale: expected a mask"):
        variant_of(sprite, posed(sprite, scale=flat, angle=45))


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Sprite.circle(20000), "circle"),
        (lambda: Sprite.box(30000, 30000), "box_wh"),
        (lambda: Sprite.polygon([(-20000, 0), (20000, 0), (0, 9)]), "polygon"),
    ],
)
@pytest.mark.parametrize("pose", [{}, {"angle": 90}, {"angle": 30, "flip": "x"}])
def test_a_shape_that_is_too_large_is_named_by_its_source(
    make: Callable[[], Sprite], field: str, pose: dict[str, Any]
) -> None:
    """One that a small scale makes fit is not refused."""
    sprite = make()
    with pytest.raises(InputError, match=f"^{field}: expected a mask of sides up to"):
        Scene().add(sprite, **pose)
    with pytest.raises(InputError, match=r"^scale: expected a mask of sides up to"):
        Scene().add(sprite, scale=2, **pose)
    assert len(Scene().ids()) == 0 == Scene().add(sprite, scale=1 / 64, **pose)


@pytest.mark.parametrize("make", [lambda: Sprite.box(30000, 2000), lambda: as_sprite(np.ones((2000, 30000), bool))])
def test_a_turn_that_makes_a_mask_too_large_is_named(make: Callable[[], Sprite]) -> None:
    with pytest.raises(InputError, match=r"^angle: expected a mask of sides up to"):
        Scene().add(make(), angle=45)


# The cache


def test_variants_are_made_once() -> None:
    sprite = as_sprite(MASK)
    assert variant_of(sprite, posed(sprite, angle=30)) is variant_of(sprite, posed(sprite, angle=390))
    other = as_sprite(MASK)
    assert variant_of(other, posed(other, angle=30)) is not variant_of(sprite, posed(sprite, angle=30))


def test_the_cache_is_bounded_and_forgets_the_longest_unused(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = LruCache(20_000, variants._kept.size)
    monkeypatch.setattr(variants, "_kept", kept)
    sprite = as_sprite(np.ones((20, 20), np.bool_))
    first = variant_of(sprite, Transform())
    for angle in range(1, 90):
        variant_of(sprite, posed(sprite, angle=angle))
        assert variant_of(sprite, Transform()) is first  # used all the time, so it stays
        held = sum(v.mask.nbytes + VARIANT_BYTES for v in kept.values.values())
        assert kept.bytes == held <= 20_000
    assert len(kept.values) > 3
    assert posed(sprite, angle=1) not in {transform for _, transform in kept.values}
    large = as_sprite(np.ones((200, 200), np.bool_))
    assert variant_of(large, Transform()).area == 40_000  # one that is larger than the cache is made all the same
    assert kept.bytes == 40_000 + VARIANT_BYTES


# Copies, and sprites of other processes

SOURCES: dict[str, Callable[[], Sprite]] = {
    "alpha": lambda: Sprite.from_image(PICTURE, alpha_threshold=3),
    "colour key": lambda: Sprite.from_image(PICTURE, color_key=(9, 0, 1), pivot_xy=(0.5, 2)),
    "grid": lambda: Sprite.from_image(SHEET, grid_wh=(3, 2)),
    "rectangles": lambda: Sprite.from_image(SHEET, rects_xywh=[[0, 0, 3, 4], [1, 1, 5, 3]]),
    "mask": lambda: Sprite.from_mask(MASK, pivot_xy=(1, -2), color=(1, 2, 3)),
    "circle": lambda: Sprite.circle(4.3, color=(3, 2, 1)),
    "box": lambda: Sprite.box(7, 2.5),
    "polygon": lambda: Sprite.polygon([(-5, -4), (6, 0), (-5, 4)], [[(-3, -1), (0, 0), (-3, 1)]]),
}
COPIES: dict[str, Callable[[Sprite], Sprite]] = {
    **{
        f"pickle {number}": lambda sprite, number=number: pickle.loads(pickle.dumps(sprite, number))
        for number in range(pickle.HIGHEST_PROTOCOL + 1)
    },
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "replace": dataclasses.replace,
}


def answers(sprite: Sprite, transform: Transform) -> list[Any]:
    """All that a sprite tells of a transform: mask, picture, volumes."""
    variant = variant_of(sprite, transform)
    image, *pivot = picture_of(sprite, transform, WHITE)
    kinds = ("circle", "oriented box", "3 boxes", "polygon") if variant.area else ()
    volumes = [bounding(kind, [sprite], [variant]).bounds() for kind in kinds]
    return [
        variant.mask.tolist(), variant.area, variant.pivot_x, variant.pivot_y, image.tolist(), pivot,
        *((box.min.tolist(), box.max.tolist()) for box in volumes), sprite.frame_count, sprite.source, sprite.color,
    ]  # fmt: skip


@LAWS
@given(
    st.sampled_from(sorted(SOURCES)),
    st.sampled_from(sorted(SOURCES)),
    st.sampled_from(sorted(COPIES)),
    st.integers(0, 3),
    st.sampled_from(FLIPS),
    scales,
    angles,
)
def test_a_copy_answers_as_the_sprite_that_it_came_from(
    source: str, other: str, copied: str, frame: int, flip: str, scale: tuple[float, float], angle: float
) -> None:
    """Also one from another process, which may have counted its sprites up to a number that one has here."""
    foreign, here = SOURCES[source](), SOURCES[other]()
    transform = posed(foreign, flip, scale, angle, frame % foreign.frame_count)
    expected = answers(foreign, transform)
    own = answers(here, transform._replace(frame=0)), answers(here, Transform())
    object.__setattr__(foreign, "uid", here.uid)
    again = COPIES[copied](foreign)
    assert answers(again, transform) == expected
    assert (answers(here, transform._replace(frame=0)), answers(here, Transform())) == own
    assert not any(one.mask.flags.writeable for one in again.frames)
    assert not any(one.image.flags.writeable for one in again.frames if one.image is not None)


def test_a_copy_with_another_pivot_is_held_there() -> None:
    sprite = Sprite.from_mask(MASK)
    assert variant_of(sprite, Transform()).pivot_x == 384
    assert variant_of(dataclasses.replace(sprite, pivot_256=(0, 0)), Transform()).pivot_x == 0


FOREIGN = """
import base64, pickle
from hitplanes import Sprite
print(base64.b64encode(pickle.dumps([Sprite.circle(20), Sprite.box(9, 9)])).decode())
"""
LOCAL = """
import base64, pickle
import numpy as np
from hitplanes import Scene, Sprite
scene = Scene()
for _ in range(3):
    scene.add(Sprite.from_mask(np.ones((1, 1), bool)))
both = [scene.add(sprite) for sprite in pickle.loads(base64.b64decode(pickled))]
print(*(int(scene.mask(item)[0].sum()) for item in both))
"""
FORKED = """
import os, pickle
from hitplanes import Scene, Sprite
Sprite.circle(1)
ends = []
for radius in (3, 30):
    read, write = os.pipe()
    if not os.fork():
        os.write(write, pickle.dumps(Sprite.circle(radius)))
        os._exit(0)
    ends.append(read)
scene = Scene()
for end in ends:
    print(int(scene.mask(scene.add(pickle.loads(os.read(end, 65536))))[0].sum()))
"""


def ran(code: str) -> str:
    run = [sys.executable, "-c", code]
    return subprocess.run(run, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout


def test_a_sprite_of_another_process_is_hit_where_it_is() -> None:
    """That process counted its sprites from 0, and so did this one."""
    assert ran(f"pickled = {ran(FOREIGN).strip()!r}\n{LOCAL}").split() == ["1257", "81"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_sprites_of_two_forked_processes_are_two() -> None:
    assert ran(FORKED).split() == ["29", "2821"]


@pytest.mark.parametrize("frames", [np.ones((3, 3), np.bool_), [], (np.ones((3, 3), np.bool_),), "disc.png", None])
def test_a_sprite_is_not_made_of_an_array_by_its_own_name(frames: Any) -> None:
    with pytest.raises(InputError, match=r"^frames: expected a tuple of frames, got .*: Sprite.from_mask and"):
        Sprite(frames)


def test_a_circle_has_one_mask_at_all_angles() -> None:
    """It is made once; an ellipse and a carved circle turn."""
    circle = Sprite.circle(9.3)
    upright = variant_of(circle, posed(circle))
    for angle in (0.1, 45, 90, 271.5, 359):
        assert variant_of(circle, posed(circle, angle=angle)) is upright
        transform = posed(circle, angle=angle)
        spans = rasterize.ellipse(circle.outline.radius, circle.outline.radius, *transform.direction)  # type: ignore[union-attr]
        assert np.array_equal(spans.to_mask()[0], upright.mask)
        assert variant_of(circle, posed(circle, scale=(2, 2), angle=angle)) is variant_of(
            circle, posed(circle, scale=(2, 2))
        )
    ellipse = posed(circle, scale=(2, 1), angle=90)
    assert variant_of(circle, ellipse).mask.shape == variant_of(circle, posed(circle, scale=(2, 1))).mask.shape[::-1]
    scene = Scene()
    item = scene.add(circle, (0, 0))
    scene.carve({item: [(5, 0), (6, 0)]})
    scene.set(item, angle=90)
    assert not scene.mask(item)[0][9 + 5, 9] and scene.mask(item)[0][9, 9 + 5]


SHAPES: list[Callable[[], Sprite]] = [
    lambda: Sprite.box(20, 7), lambda: Sprite.box(3.5, 30), lambda: Sprite.circle(6), lambda: Sprite.box(0, 9),
    lambda: Sprite.polygon([(0, -9), (12, 5), (-7, 8)]), lambda: Sprite.polygon([(0, 0), (9, 0), (2, 2), (0, 9)]),
    lambda: Sprite.polygon([(-9, -9), (9, -9), (9, 9), (-9, 9)], holes=[[(-3, -3), (3, -3), (3, 3)]]),
]  # fmt: skip


@given(st.randoms(use_true_random=False), st.integers(2, 12))
@examples(40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.usefixtures("jit")
def test_shapes_made_together_are_those_of_each_alone(rng: random.Random, count: int) -> None:
    makers = [rng.choice(SHAPES) for _ in range(count)]
    poses = [
        {"angle": rng.choice([0, 90, 45, rng.uniform(-400, 400)]), "flip": rng.choice(["none", "x", "xy"]),
         "scale": rng.choice([(1, 1), (2, 0.5), (1.3, 1.3)])}
        for _ in makers
    ]  # fmt: skip
    sprites, others = ([make() for make in makers] for _ in range(2))
    transforms = [posed(sprite, **pose) for sprite, pose in zip(sprites, poses, strict=True)]
    together = variants_of(sprites, transforms)
    for one, other, transform in zip(together, others, transforms, strict=True):
        alone = variant_of(other, transform)
        assert np.array_equal(one.mask, alone.mask) and one.area == alone.area
        assert (one.pivot_x, one.pivot_y) == (alone.pivot_x, alone.pivot_y)


@pytest.mark.parametrize(
    ("sprite", "text"),
    [
        (Sprite.circle(3.5), "<Sprite: circle of radius 3.5 px>"),
        (Sprite.polygon([(0, 0), (9, 0), (0, 9)]), "<Sprite: polygon of 3 points>"),
        (Sprite.from_mask(np.ones((3, 4), np.bool_)), "<Sprite: 4 x 3 px>"),
        (Sprite.from_images([np.zeros((4, 5, 4), np.uint8)] * 2), "<Sprite: 2 frames, the first 5 x 4 px>"),
    ],
)
def test_a_sprite_prints_what_it_is(sprite: Sprite, text: str) -> None:
    assert repr(sprite) == text
