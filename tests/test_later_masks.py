"""Masks of new looks: made when something first reads them, all together, and nothing tells when that was."""

import threading
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_label_plane import change, changed_boxes, random_scene
from test_moves import told

from hitplanes import Box, Disc, History, InputError, Point, Scene, Sprite, fire, prepare
from hitplanes.planes.common.limits import MASK_AREA_MAX, MASK_SIDE_MAX, SCALE_MIN
from hitplanes.planes.scene import items as items_module
from hitplanes.planes.scene import variants as variants_module
from hitplanes.planes.scene.variants import surely_fits, transform_of

AT = np.stack(np.meshgrid(np.arange(-12, 26, 5), np.arange(-6, 24, 4)), axis=-1).reshape(-1, 2)
WAYS = (Point(), "labels"), (Point(), "spans"), (Disc(3), "visible"), (Disc(3), "tiles"), (Box(7, 2), "integers")


def said(scene: Scene) -> list[Any]:
    """What the ways to answer shots say of a scene, each by what it keeps of it."""
    shots = [fire(scene, weapon, AT, strategy=way) for weapon, way in WAYS]
    return [told(scene.items.stack()), shots, scene.box(scene.ids()).tolist(), scene.planes().hittable.tolist()]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """Quarter turns of the masks that items make, call by call."""
    calls: list[list[int]] = []
    inner = items_module.variants_of

    def variants_of(sprites: Any, transforms: Any) -> Any:
        calls.append([transform.quarter for transform in transforms])
        return inner(sprites, transforms)

    monkeypatch.setattr(items_module, "variants_of", variants_of)
    return calls


@examples(60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32))
def test_what_is_read_between_changes_makes_no_difference(jit: bool, seed: int) -> None:
    scenes = [random_scene(np.random.default_rng(seed), 9) for _ in range(2)]
    ready = [prepare(scene, Disc(2)) for scene in scenes]
    reads, draws = np.random.default_rng(seed + 1), [np.random.default_rng(seed + 2) for _ in scenes]
    for _ in range(8):
        for scene, rng in zip(scenes, draws, strict=True):
            change(scene, rng)
            some = scene.ids()[:2]
            scene.move(some.copy() if rng.random() < 0.5 else some.tolist(), rng.uniform(-9, 9, (len(some), 2)))
        said(scenes[0])
        ready[0].fire((3, 4))
        if reads.random() < 0.3:
            said(scenes[1])
    assert said(scenes[0]) == said(scenes[1]) == said(scenes[1].copy())
    assert [one.fire((3, 4)) for one in ready] == [fire(scenes[0], Disc(2), (3, 4))] * 2


def test_a_loop_of_single_changes_makes_its_masks_together(made: list[Any]) -> None:
    scene = Scene((99, 99))
    ids = [scene.add(np.ones((3, 5), np.bool_), (9 * k, 9), angle=90) for k in range(4)]
    scene.add(np.ones((2, 2), np.bool_), (50, 50))
    assert made == []
    assert scene.box(ids[0]).tolist() == [-1, 7, 1, 11] and made == [[1, 1, 1, 1, 0]]
    for angle in (180, 270):
        for item in ids[:3]:
            scene.set(item, angle=angle)
            scene.move(item, (9 * item, 20))
            assert scene.angle(item) == angle and scene.position(item).tolist() == [9 * item, 20]
    assert len(made) == 1
    assert fire(scene, Point(), (9, 21)).object.tolist() == [ids[1]] and made[1:] == [[3, 3, 3]]
    scene.move(ids, (30, 30))
    scene.box(ids)
    assert len(made) == 2


def test_what_reads_no_mask_makes_none_and_what_is_gone_keeps_none(made: list[Any]) -> None:
    scene = Scene((99, 99))
    item = scene.add(np.ones((3, 5), np.bool_), (9, 9))
    assert (len(scene), scene.ids().tolist(), item in scene, scene.name_of(item)) == (1, [item], True, "hittable 0")
    scene.set(item, layer=3)
    assert made == [] and scene.layer(item) == 3
    scene.box(item)
    scene.set(item, angle=[90])
    assert scene.items.atlas.live == 15 and len(made) == 2
    scene.set(item, angle=270)
    scene.remove([item, scene.add(np.ones((3, 5), np.bool_), (9, 9))])
    assert list(scene._items.unmade) == [item]  # what came and went unseen leaves no trace
    assert len(scene.items.stack()) == 0 and scene.items.atlas.live == 0 and len(made) == 2


@pytest.mark.parametrize("several", [False, True])
def test_an_object_that_moves_before_its_mask_is_made_was_nowhere(several: bool) -> None:
    scene = Scene((99, 99))
    version, item = scene.items.version, scene.add(np.ones((3, 5), np.bool_), (9, 9))
    for xy in ((30.0, 30.0), (50.0, 50.0)):
        scene.move(np.array([item]) if several else item, np.array([xy]) if several else xy)
    boxes = changed_boxes(scene, version)
    assert boxes is not None and boxes.tolist() == [[48, 49, 52, 51]]


@pytest.mark.parametrize("what", ["version", "a shot", "a ready weapon", "a record"])
def test_a_change_is_seen_before_its_mask_is_made(what: str) -> None:
    scene = Scene((99, 99))
    item = scene.add(np.ones((3, 21), np.bool_), (50, 50))
    history, ready, version = History(scene), prepare(scene, Point()), scene.version
    assert not ready.fire((50, 58)) and ready.fire((58, 50))
    scene.set(item, angle=90)
    if what == "version":
        assert scene.version == version + 1 == fire(scene, Point(), (50, 58)).version
    elif what == "a shot":
        assert fire(scene, Point(), (50, 58)).object.tolist() == [item]
    elif what == "a ready weapon":
        assert ready.fire((50, 58)).object.tolist() == [item] and not ready.fire((58, 50))
    else:
        assert fire(history, Point(), (50, 58), tick=history.record()).object.tolist() == [item]


def test_threads_that_read_at_once_make_masks_once(jit: bool, made: list[Any]) -> None:
    scene = Scene((400, 400))
    rng = np.random.default_rng(5)
    ids = [scene.add(rng.random((20, 20)) < 0.6, rng.uniform(0, 400, 2)) for _ in range(60)]
    at = rng.uniform(0, 400, (50, 2))
    for turn in range(6):
        for item in ids:
            scene.set(item, angle=turn * 40 + item)
        begun, found = len(made), []
        threads = [threading.Thread(target=lambda to=found: to.append(fire(scene, Disc(5), at))) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(made) == begun + 1
        assert len(found) == 4 and all(hits == fire(scene, Disc(5), at, strategy="spans") for hits in found)


def test_a_mask_that_is_too_large_changes_nothing() -> None:
    scene = Scene()
    ids = [scene.add(np.ones((side, side), np.bool_), (0, 0)) for side in (3, 900)]
    before, version = said(scene), scene.version
    for act in (
        lambda: scene.set(ids, scale=12),
        lambda: scene.set(ids[::-1], scale=[9, 2], angle=45),
        lambda: scene.add(np.ones((900, 900), np.bool_), (0, 0), scale=12),
    ):
        with pytest.raises(InputError, match=r"^scale: expected a mask of sides up to"):
            act()
        assert (said(scene), scene.version) == (before, version)
    scene.set(ids[1], scale=8.9)  # not surely small enough, but it is
    assert scene.box(ids[1])[2] > 4000


sides = st.integers(1, MASK_SIDE_MAX)


@settings(deadline=None)
@given(sides, sides, st.floats(SCALE_MIN, 64), st.floats(SCALE_MIN, 64), st.floats(-400, 400), st.integers(-999, 999))
def test_what_surely_fits_does(width: int, height: int, sx: float, sy: float, angle: float, pivot: int) -> None:
    """Its grid is measured, without its mask."""
    sprite = Sprite.from_mask(np.ones((1, 1), np.bool_))
    transform = transform_of(sprite, 0, "none", (sx, sy), angle)
    vars(sprite)["sides"] = width + height
    if not surely_fits(sprite, transform):
        return
    grids = variants_module._grids_of([(width, height, pivot, -pivot)], np.zeros(1, np.int64), [transform])
    wide, high = grids.size_wh[0].tolist()
    assert max(wide, high) <= MASK_SIDE_MAX and wide * high <= MASK_AREA_MAX


@pytest.mark.parametrize(
    ("sprite", "largest"),
    [
        (Sprite.from_images([np.full((h, w, 4), 255, np.uint8) for w, h in ((30, 90), (80, 20), (10, 130))]), 140),
        (Sprite.circle(10), 42),
        (Sprite.polygon([(0, 0), (30, 0), (0, 5)]), 37),
    ],
)
def test_the_sides_of_a_sprite_are_those_of_its_largest_frame(sprite: Sprite, largest: int) -> None:
    """A shape has a few more, as its points are rounded when it turns."""
    assert largest <= sprite.sides <= largest + 10
    one, more = (transform_of(sprite, 0, "none", (1.0, sy), 45) for sy in (1.0, 8192 / sprite.sides))
    assert surely_fits(sprite, one) and not surely_fits(sprite, more)
