"""Bounding volumes hold the pixel squares of turned, scaled and flipped masks, in exact arithmetic."""

import itertools
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
import pytest
from examples import examples
from hypothesis import example, given
from hypothesis import strategies as st

from hitplanes import Scene
from hitplanes.planes.common.checks import Bools, InputError
from hitplanes.planes.common.limits import CORNERS, PLACE
from hitplanes.planes.scene.sprite import Sprite, frame_pivot
from hitplanes.planes.scene.variants import Variant, transform_of, variant_of
from hitplanes.planes.volumes import fit
from hitplanes.planes.volumes.fit import bounding, fitted, moved
from hitplanes.planes.volumes.volumes import Aabbs, Circles, Parts, Polygons, Volumes

Number = int | Fraction
Point = tuple[Number, Number]
EVERY = ["circle", "oriented box", "1 boxes", "5 boxes", "polygon"]

POSES = [
    ("none", (1, 1), 0), ("x", (1, 1), 90), ("y", (1, 1), 180), ("xy", (1, 1), 270), ("none", (1, 1), 37),
    ("x", (1, 1), 45), ("none", (2, 2), 0), ("none", (0.5, 0.5), 0), ("y", (3, 0.4), 0), ("x", (0.3, 2.7), 200.5),
    ("none", (1, 1), 1e-4), ("none", (0.01, 0.01), 12), ("xy", (7.3, 7.3), -61),
]  # fmt: skip


def masks(rng: np.random.Generator, count: int, side: int) -> Iterator[Bools]:
    """Noise of all densities, now and then a single pixel, or a thin line."""
    for i in range(count):
        mask = rng.random(rng.integers(1, side + 1, 2)) < rng.choice([0.03, 0.2, 0.5, 0.95])
        if i % 7 == 3:
            mask = np.eye(int(rng.integers(1, side + 1)), dtype=np.bool_)
        if not mask.any():
            mask[tuple(rng.integers(0, mask.shape))] = True
        yield mask


def outside(piece: list[Point], a: Point, b: Point) -> tuple[list[Point], list[Point]]:
    """Cut a convex piece by the line through a and b: what is left of it inside, and outside."""
    sides = [(b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) for p in piece]
    inner: list[Point] = []
    outer: list[Point] = []
    for i, (p, s) in enumerate(zip(piece, sides, strict=True)):
        q, t = piece[(i + 1) % len(piece)], sides[(i + 1) % len(piece)]
        if s >= 0:
            inner.append(p)
        if s <= 0:
            outer.append(p)
        if s * t < 0:
            part = Fraction(s, s - t)
            cut = (p[0] + (q[0] - p[0]) * part, p[1] + (q[1] - p[1]) * part)
            inner.append(cut)
            outer.append(cut)
    return inner, outer


def area(piece: list[Point]) -> Number:
    return sum(p[0] * q[1] - p[1] * q[0] for p, q in zip(piece, piece[1:] + piece[:1], strict=True))


def covered(square: list[Point], rings: list[list[Point]]) -> bool:
    """Whether convex rings cover a square: ring after ring takes its part away, and no area is left."""
    left = [square]
    for ring in rings:
        rest = []
        for piece in left:
            inner = piece
            for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
                inner, outer = outside(inner, a, b)
                if area(outer):
                    rest.append(outer)
                if not area(inner):
                    break
        left = rest
    return not left


def squares(mask: Bools, one: int, corner: tuple[int, int] = (0, 0)) -> Iterator[list[Point]]:
    """Pixel squares that have a neighbour missing: a convex part, or a union with none of them open, holds the rest.

    In units of which an even number make a pixel; pixel [0, 0] lies at `corner`, px.
    """
    around = np.pad(mask, 1)
    inner = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    for row, column in np.argwhere(mask & ~inner).tolist():
        x, y = column + corner[0], row + corner[1]
        low, high = (x * one - one // 2, y * one - one // 2), (x * one + one // 2, y * one + one // 2)
        yield [low, (high[0], low[1]), high, (low[0], high[1])]


def whole(values: Sequence[float]) -> tuple[list[int], int]:
    """Floats as whole numbers of a unit so small that all are exact, and how many of it make a pixel."""
    one = math.lcm(2, *(v.as_integer_ratio()[1] for v in values))
    return [int(Fraction(v) * one) for v in values], one


def rings_of(volume: Volumes) -> tuple[list[list[Point]], int]:
    """Convex rings in whole units, and the units of a pixel."""
    core = volume.parts.core() if isinstance(volume, Parts) else volume.core()
    flat, one = whole(core.points.ravel().tolist())
    points = list(zip(flat[::2], flat[1::2], strict=True))
    starts = [*core.starts.tolist(), len(points)]
    return [points[first:last] for first, last in itertools.pairwise(starts)], one


def holds(volume: Volumes, mask: Bools, corner: tuple[int, int] = (0, 0)) -> bool:
    """Whether the one row of a volume contains the pixel squares of a mask whose pixel [0, 0] lies at `corner`."""
    assert len(volume) == 1
    if isinstance(volume, Circles):
        (x, y, r), one = whole([*volume.center[0].tolist(), float(volume.radius[0])])
        return all((p - x) ** 2 + (q - y) ** 2 <= r * r for square in squares(mask, one, corner) for p, q in square)
    rings, one = rings_of(volume)
    return all(covered(square, rings) for square in squares(mask, one, corner))


def variant(sprite: Sprite, pose: tuple[str, tuple[float, float], float], frame: int = 0) -> Variant:
    flip, scale, angle = pose
    return variant_of(sprite, transform_of(sprite, frame, flip, scale, angle))


def check(sprite: Sprite, pose: tuple[str, tuple[float, float], float]) -> None:
    seen = variant(sprite, pose)
    if not seen.area:
        return
    for kind in EVERY:
        volume = bounding(kind, [sprite], [seen])
        assert holds(volume, seen.mask), (kind, pose)
        if kind != "circle":
            points = (volume.parts if isinstance(volume, Parts) else volume).core().points / PLACE
            assert (points == np.rint(points)).all(), (kind, pose)


def test_the_check_sees_what_sticks_out() -> None:
    mask = np.ones((2, 3), np.bool_)
    assert holds(fit.box(mask), mask)
    assert holds(fit.boxes(mask, 3), mask)
    assert not holds(Aabbs([[-0.5, -0.5]], [[2.5, np.nextafter(1.5, 0)]]), mask)
    assert holds(Circles([[1, 0.5]], 1.8028), mask)
    assert not holds(Circles([[1, 0.5]], 1.8027), mask)  # the root of 1.5**2 + 1
    halves = Aabbs([[-0.5, -0.5], [1, -0.5]], [[1, 1.5], [2.5, 1.5]])
    assert holds(Parts(halves, [0]), mask)  # no half holds the middle pixels: both together do
    assert not holds(Parts(halves.translated([[0, 0], [1e-9, 0]]), [0]), mask)


@pytest.mark.parametrize("pose", POSES, ids=str)
def test_volumes_hold_turned_scaled_and_flipped_masks(pose: tuple[str, tuple[float, float], float]) -> None:
    rng = np.random.default_rng(7)
    for mask in masks(rng, 14, 9):
        pivot = None if rng.random() < 0.5 else rng.normal(3, 6, 2).tolist()
        check(Sprite.from_mask(mask, pivot_xy=pivot), pose)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
def test_volumes_hold_masks_of_many_poses(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    for mask in masks(rng, 120, 16):
        scale = np.exp(rng.normal(0, 0.8, 2)).tolist() if rng.random() < 0.5 else [float(np.exp(rng.normal(0, 1)))] * 2
        pose = (str(rng.choice(["none", "x", "y", "xy"])), (scale[0], scale[1]), float(rng.uniform(-400, 400)))
        check(Sprite.from_mask(mask, pivot_xy=rng.normal(0, 30, 2).tolist()), pose)


def test_far_pivots_and_great_scales() -> None:
    """The sine's last bit times the way from the pivot is more than the growing alone would cover."""
    mask = np.array([[True, False], [True, True]])
    for pose in (("none", (256.0, 256.0), 33.3), ("x", (256.0, 1 / 256), 10), ("none", (1 / 256, 1 / 256), 44)):
        sprite = Sprite.from_mask(mask, pivot_xy=(32000.25, -31000.5))
        seen = variant(sprite, pose)
        if not seen.area:
            continue
        edge = seen.mask & ~(np.random.default_rng(3).random(seen.mask.shape) < 0.99)
        for kind in EVERY:
            assert holds(bounding(kind, [sprite], [seen]), edge if edge.any() else seen.mask)


@pytest.mark.parametrize("name", ["circle", "oriented box", "polygon"])
def test_long_thin_masks(name: str) -> None:
    """Needles: corners go far when their edges move out."""
    mask = np.zeros((41, 1200), np.bool_)
    mask[np.arange(1200) // 30, np.arange(1200)] = True
    sprite = Sprite.from_mask(mask)
    for angle in (1.0, 33.0, 91.5):
        seen = variant(sprite, ("none", (1.0, 1.0), angle))
        assert holds(bounding(name, [sprite], [seen]), seen.mask & (np.arange(seen.mask.shape[1]) % 40 < 2))


def test_shapes_are_fitted_as_they_are() -> None:
    for sprite in (
        Sprite.circle(4.3), Sprite.box(7, 2.5), Sprite.polygon([(0, 0), (9, 1), (3, 8)]),
        Sprite.polygon([(-6, -6), (6, -6), (6, 6), (-6, 6)], [[(-2, -2), (2, -2), (2, 2), (-2, 2)]]),
    ):  # fmt: skip
        for pose in POSES:
            check(sprite, pose)


def test_flips_and_quarter_turns_are_exact() -> None:
    mask = np.array([[0, 1, 1, 0, 0], [1, 1, 0, 0, 1], [0, 1, 1, 1, 0]], np.bool_)
    sprite = Sprite.from_mask(mask, pivot_xy=(1.25, 7.5))
    for flip in ("none", "x", "y", "xy"):
        for angle in (0, 90, 180, 270):
            seen = variant(sprite, (flip, (1.0, 1.0), angle))
            for kind in ("4 boxes", "polygon"):
                volume, refitted = bounding(kind, [sprite], [seen]), fitted(kind, seen.mask)
                low, high = volume.bounds(), refitted.bounds()
                assert low.min.tolist() == high.min.tolist()
                assert low.max.tolist() == high.max.tolist()
            circle, again = (bounding("circle", [sprite], [v]) for v in (seen, variant(sprite, POSES[0])))
            assert isinstance(circle, Circles)
            assert isinstance(again, Circles)
            assert circle.radius == again.radius


def test_a_turn_about_the_pivot_keeps_the_circle_about_it() -> None:
    mask = np.array([[0, 1, 1], [1, 1, 0]], np.bool_)
    sprite = Sprite.from_mask(mask, pivot_xy=(0.5, 2))
    circle = fit.pivot_circle(mask, (0.5, 2))
    radii = set()
    for angle in (10, 20, 130, 300):
        seen = variant(sprite, ("none", (1.0, 1.0), angle))
        turned = moved(circle, frame_pivot(sprite, sprite.frames[0]), seen)
        assert isinstance(turned, Circles)
        assert holds(turned, seen.mask)
        assert np.allclose(turned.center[0] * 256, (seen.pivot_x, seen.pivot_y), rtol=0, atol=1e-9)
        radii.add(float(turned.radius[0]))
    assert len(radii) == 1
    assert circle.radius[0] < radii.pop() < circle.radius[0] + 0.72


def test_rows_are_those_of_one_at_a_time() -> None:
    sprites = [Sprite.from_mask(mask) for mask in masks(np.random.default_rng(5), 9, 7)]
    poses = [POSES[3 * i % len(POSES)] for i in range(9)]
    seen = [variant(sprite, pose) for sprite, pose in zip(sprites, poses, strict=True)]
    some = [(s, v) for s, v in zip(sprites, seen, strict=True) if v.area]
    for kind in EVERY:
        rows = bounding(kind, [s for s, _ in some], [v for _, v in some])
        assert isinstance(rows, {"circle": Circles, "1 boxes": Parts, "5 boxes": Parts}.get(kind, Polygons))
        assert len(rows) == len(some)
        for i, (sprite, one) in enumerate(some):
            alone, row = bounding(kind, [sprite], [one]), rows.take([i])
            assert row.bounds().min.tolist() == alone.bounds().min.tolist()
            assert row.bounds().max.tolist() == alone.bounds().max.tolist()


def test_kinds() -> None:
    mask = np.ones((9, 40), np.bool_) & (np.hypot(*np.meshgrid(np.arange(40) / 2, np.arange(9))) < 12)
    (ring,), _ = rings_of(fitted("polygon", mask))
    assert len(ring) <= CORNERS
    assert len(rings_of(fitted("6 boxes", mask))[0]) == 6


def test_the_last_bit_of_the_sine_far_from_the_pivot() -> None:
    """A turn by rounded sines stretches a little: 46,000 px from the pivot, 256 times enlarged, by 1/128 px."""
    pixel = Sprite.from_mask([[True]], pivot_xy=(32767, 32767))
    check(pixel, ("none", (256.0, 256.0), 43.24125))


def test_frames_have_volumes_of_their_own() -> None:
    image = np.zeros((4, 16, 4), np.uint8)
    image[:2, :2, 3] = image[:, 8:, 3] = 255
    sprite = Sprite.from_image(image, grid_wh=(8, 4))
    for kind in EVERY:
        for frame in (0, 1, 0):
            seen = variant(sprite, ("none", (1.0, 1.0), 30.0), frame)
            assert holds(bounding(kind, [sprite], [seen]), seen.mask)
            low, high = bounding(kind, [sprite], [seen]).bounds(), fitted(kind, seen.mask).bounds()
            assert (low.max - low.min <= 1.5 * (high.max - high.min) + 3).all()


@pytest.mark.parametrize("kind", EVERY, ids=str)
def test_masks_asked_for_one_after_another(kind: str) -> None:
    """Whatever the order, a mask has its own volume, and an equal one the same row."""
    rng = np.random.default_rng(3)
    scene = Scene()
    for mask in masks(rng, 20, 9):
        sprite = Sprite.from_mask(mask)
        for angle in (0.0, 25.0, 0.0):
            scene.add(sprite, rng.uniform(0, 99, 2), angle=angle)
    items, rows = scene.items, {}
    there = np.sort(items.stack().rows)  # a mask without a pixel has no volume
    for ids in (there[[41]], there[[3, 40, 3]], there[[0]], there[[50, 1, 2]], there[::-1], there):
        volumes, row = items.bounding(kind, ids)
        for item, at in zip(ids.tolist(), row.tolist(), strict=True):
            alone = bounding(kind, [items.sprites[item]], [items.variants[item]]).bounds()
            assert volumes.take([at]).bounds().min.tolist() == alone.min.tolist()
            assert volumes.take([at]).bounds().max.tolist() == alone.max.tolist()
            assert rows.setdefault(int(items.mask[item]), at) == at
    assert len(volumes) == len(set(items.mask[there].tolist()))


def test_masks_that_are_laid_out_anew() -> None:
    """Places of masks begin again when those in use are laid out without the others."""
    scene, kind = Scene(), "circle"
    sprites = [Sprite.from_mask(np.ones((n, 1200), np.bool_)) for n in (1000, 900, 500, 3)]
    ids = [scene.add(sprite, (0, 0)) for sprite in sprites]
    scene.items.bounding(kind, np.array(ids))
    scene.remove(ids[:3])
    stack = scene.items.stack()
    volumes, row = scene.items.bounding(kind, stack.ids)
    assert stack.offset.tolist() == [0]
    assert volumes.take(row).core().radius[0] == fit.least_circle(np.ones((3, 1200), np.bool_)).radius[0]


@pytest.mark.parametrize("kind", EVERY, ids=str)
def test_volumes_of_objects_lie_where_the_objects_are(kind: str) -> None:
    scene = Scene()
    mask = np.array([[0, 1, 1, 0], [1, 1, 1, 1]], np.bool_)
    ids = [scene.add(mask, xy, angle=angle) for xy, angle in (((1e9, -7.4), 0), ((3.2, 4), 90), ((0, 0), 31))]
    volumes = scene.volumes(ids, kind)
    bounds = volumes.bounds()
    for row, item in enumerate(ids):
        seen, (x, y) = scene.mask(item)
        assert holds(volumes.take([row]), seen, (x, y))
        side = max(seen.shape)
        assert (bounds.min[row] > (x - side, y - side)).all()
        assert (bounds.max[row] < (x + 2 * side, y + 2 * side)).all()
    assert len(scene.volumes([], kind)) == 0


def test_volumes_that_objects_do_not_have() -> None:
    scene = Scene()
    item, empty = scene.add([[True]], (1, 1)), scene.add([[False]], (1, 1))
    for ids, kind, told in (
        ([item], "sphere", "kind: expected one of 'box', 'circle', 'oriented box', '4 boxes', 'polygon', got 'sphere'"),
        ([item, empty], "circle", f"ids: expected objects with a pixel, got {empty}, whose mask is empty"),
        ([5], "circle", "id"),
    ):
        with pytest.raises(InputError, match=told):
            scene.volumes(ids, kind)
    with pytest.raises(InputError, match="kind: expected 1 to 64 boxes, got 0"):
        scene.volumes([item], "0 boxes")


def test_boxes_of_objects_are_those_of_their_masks() -> None:
    scene = Scene()
    ids = [scene.add(np.ones((2, 3), np.bool_), (10, 20), angle=angle) for angle in (0, 90, 30)]
    boxes = scene.volumes(ids, "box")
    for row, item in enumerate(ids):
        mask, (x, y) = scene.mask(item)
        assert boxes.bounds().min[row].tolist() == [x - 0.5, y - 0.5]
        assert boxes.bounds().max[row].tolist() == [x + mask.shape[1] - 0.5, y + mask.shape[0] - 0.5]


pixels = st.tuples(st.integers(1, 5), st.integers(1, 5)).flatmap(
    lambda shape: st.lists(st.booleans(), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]).map(
        lambda bits: np.array([*bits[:-1], True]).reshape(shape)
    )
)
flips = st.sampled_from(["none", "x", "y", "xy"])
scales = st.one_of(st.just((1.0, 1.0)), st.tuples(*2 * [st.floats(0.3, 3)]))
turns = st.one_of(
    st.integers(-4, 4).map(lambda k: 90.0 * k), st.integers(-9, 9).map(lambda k: 45.0 * k), st.floats(-400, 400)
)
far = st.builds(
    lambda sign, power, offset: sign * max(2.0**power - abs(offset) / 256, 0.0),
    st.sampled_from([-1, 1]), st.sampled_from([0, 30, 36, 37, 38, 39, 40]), st.integers(-3000, 3000),
)  # fmt: skip
SLOPING = np.array([[0, 0, 0, 0, 1, 1, 1, 0], [1, 0, 0, 0, 0, 0, 0, 0]], np.bool_)
ACROSS, DOWN = np.meshgrid(np.arange(-9, 10), np.arange(-9, 10))
OVAL = (0.01 * ACROSS + 0.23 * DOWN) ** 2 + (0.22 * DOWN - 0.18 * ACROSS) ** 2 < 1
FLIPPED = np.array([[1, 0, 1], [0, 1, 0], [0, 1, 0]], np.bool_)


@examples(100, deadline=None)
@pytest.mark.parametrize("kind", EVERY, ids=str)
@given(pixels, flips, scales, turns, st.tuples(far, far))
@example(FLIPPED, "y", (1.0, 1.0), 0.0, (0.0, 0.0))
@example(FLIPPED, "xy", (1.0, 1.0), 90.0, (2.0**37, 0.0))
@example(FLIPPED, "none", (1.0, 1.0), 0.0, (2.0**40, -(2.0**40)))
@example(SLOPING, "none", (1.0, 1.0), 0.0, (-(2.0**40), -(2.0**39)))
@example(OVAL, "none", (1.0, 1.0), 0.0, (2.0**40, 2.0**40))
@example(FLIPPED, "none", (1.7, 0.6), 33.0, (2.0**40, -(2.0**38)))
@example(np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 1]], np.bool_), "none", (0.5, 2.0), 23.0, (-1.0, -1.0))
def test_volumes_hold_every_pixel_square_wherever_the_object_is(
    kind: str, mask: Bools, flip: str, scale: tuple[float, float], angle: float, xy: tuple[float, float]
) -> None:
    """Up to the limit of positions, where float64 holds no more than 1/4096 px."""
    scene = Scene()
    item = scene.add(mask, xy, flip=flip, scale=scale, angle=angle)
    seen, corner = scene.mask(item)
    if not seen.any():
        return
    volume = scene.volumes([item], kind)
    assert holds(volume, seen, corner)
    low, high = volume.bounds().min[0] - corner, volume.bounds().max[0] - corner
    size = max(*mask.shape, 3) * max(*scale, 1)  # a mask that is scaled down may lose all pixels but one
    assert (low > -1.5 * size - 3).all()
    assert (high < 2.5 * size + 3).all()


@pytest.mark.parametrize("kind", EVERY, ids=str)
def test_volumes_of_shapes_hold_every_pixel_square_far_away(kind: str) -> None:
    """They are fitted to the turned mask: nothing but the shift grows them."""
    shapes = [Sprite.circle(7.3), Sprite.box(19, 2.5), Sprite.polygon([(0, 0), (9, 1), (3, 8)])]
    places = [(2.0**40, 2.0**40), (-(2.0**38) + 0.3, 5.0), (2.0**37, -(2.0**40) + 11.7)]
    scene = Scene()
    for shape, xy, angle in itertools.product(shapes, places, (0, 12.5, 33, 70)):
        item = scene.add(shape, xy, angle=angle)
        seen, corner = scene.mask(item)
        volume = scene.volumes([item], kind)
        assert holds(volume, seen, corner), (shape.source, xy, angle)


@pytest.mark.parametrize("kind", EVERY, ids=str)
def test_a_volume_far_away_does_not_depend_on_the_others(kind: str) -> None:
    scene = Scene()
    places = [(0.0, 3.0), (2.0**38, 5.5), (7.0, -(2.0**40)), (2.0**40, 2.0**40)]
    ids = [scene.add(FLIPPED, xy, angle=31.0) for xy in places]
    together = scene.volumes(ids, kind).bounds()
    for row, item in enumerate(ids):
        alone = scene.volumes([item], kind).bounds()
        assert together.min[row].tolist() == alone.min[0].tolist()
        assert together.max[row].tolist() == alone.max[0].tolist()


@pytest.mark.parametrize("position", [1e6, 3e7 + 0.3, 1e9, 2.0**36])
def test_circles_far_away_hold_what_they_hold_here(position: float) -> None:
    rng = np.random.default_rng(5)
    scene = Scene()
    for mask in masks(rng, 60, 9):
        item = scene.add(mask, (position, -position / 3), angle=float(rng.integers(4) * 90))
        seen, (x, y) = scene.mask(item)
        if not seen.any():
            continue
        circle = scene.volumes([item], "circle")
        assert isinstance(circle, Circles)
        (cx, cy, r), one = whole([*circle.center[0].tolist(), float(circle.radius[0])])
        corners = (p for square in squares(seen, one) for p in square)
        assert all((p + x * one - cx) ** 2 + (q + y * one - cy) ** 2 <= r * r for p, q in corners)
        assert circle.radius[0] < np.hypot(*seen.shape) + 1


def test_uneven_scales_grow_a_volume_by_no_more() -> None:
    """Wide and flat: by a pixel on each side, not by a pixel of the frame, which is wide now."""
    sprite = Sprite.from_mask(np.ones((40, 8), np.bool_))
    for scale in ((4.0, 0.25), (8.0, 0.0625), (0.25, 4.0)):
        seen = variant(sprite, ("none", scale, 0))
        for kind in EVERY[1:]:
            low, high = bounding(kind, [sprite], [seen]).bounds(), fit.box(seen.mask)
            assert (low.min > high.min - 1.8).all()
            assert (low.max < high.max + 1.8).all()


def test_a_needle_has_a_box() -> None:
    """A corner that is all but straight back would go far as its sides move out."""
    y, x = np.mgrid[-6:7, -100:101]
    lens = Sprite.from_mask(np.abs(y) <= 4 * (1 - (x / 100) ** 2))
    for scale, angle in (((1.0, 1.0), 20.0), ((1.5, 0.4), 100.0), ((1.0, 0.3), 0.0)):
        seen = variant(lens, ("none", scale, angle))
        for kind in ("oriented box", "polygon"):
            volume = bounding(kind, [lens], [seen])
            edges = seen.mask & (np.arange(seen.mask.shape[1]) % 7 < 2)
            assert holds(volume, edges)
    sharp = bounding("polygon", [lens], [variant(lens, ("none", (1.5, 0.4), 0.0))])
    assert len(sharp.core().points) == 4  # the box in its place


def test_masks_of_the_past_are_not_kept_for_ever() -> None:
    scene = Scene()
    item = scene.add(np.ones((3, 5), np.bool_), (0, 0))
    rows = []
    for angle in range(700):
        scene.set(item, angle=angle / 3)
        rows.append(len(scene.items.bounding("polygon", np.array([item]))[0]))
    assert 100 < max(rows) < 300
