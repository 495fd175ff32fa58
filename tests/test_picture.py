"""Reports: facts that agree with the hits, and pictures that show them, on any OpenCV."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_of import some_of

from hitplanes import (
    Disc,
    InputError,
    Laser,
    Pistol,
    Projectile,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Sweep,
    Weapon,
    fire,
    load_scene,
    weapons_of,
)
from hitplanes.planes.scene.render import blend, draw_view
from hitplanes.weapons.replay.shot_log import fire_request, requests_of
from hitplanes.weapons.report.canvas import EDGE, TOP, World, factor_of, legend_of
from hitplanes.weapons.report.overlay import Overlay
from hitplanes.weapons.report.picture import picture_of_report
from hitplanes.weapons.report.report import report_of
from hitplanes.weapons.report.symbols import MARKS, TINT, glyph

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"


def told(scene: Scene, *shots: tuple[Weapon, tuple[float, float]]) -> dict[str, Any]:
    return report_of(scene, [fire(scene, weapon, at) for weapon, at in shots])


def gallery_report(scene: Scene, prefilter: str | None = None, broadphase: str | None = None) -> dict[str, Any]:
    requests = requests_of(scene, weapons_of(scene))
    fired, names = [fire_request(scene, request) for request in requests], [request.name for request in requests]
    return report_of(scene, fired, names, prefilter=prefilter, broadphase=broadphase)


def ray_report(scene: Scene, prefilter: str | None = None, broadphase: str | None = None) -> dict[str, Any]:
    """Every traced weapon, and every reason to end."""
    shots: list[tuple[Weapon, tuple[float, float], float]] = [
        (Rifle(600, budget=60), (20.25, 170.5), -3),
        (Rifle(300, max_hits=2, width=5), (440, 190), -170),
        (Sweep(Laser(260), 50, 9), (250, 160), -80),
        (Spread(Pistol(300), 8, 40), (30, 60), 10),
        (Rounds(Laser(90, width=2, falloff="linear"), 3, recoil_deg=-9), (330, 130), -60),
        (Projectile(120, 4), (40, 130), 14),
        (Projectile(160, 6, steps=5), (60, 110), 4),
        (Pistol(10**6), (-900, 140), 0.5),
    ]
    fired = [fire(scene, weapon, at, aim=aim, seed=4) for weapon, at, aim in shots]
    return report_of(scene, fired, prefilter=prefilter, broadphase=broadphase)


def blank(scene: Scene | None, view: tuple[int, int, int, int], factor: int) -> World:
    """A view on which nothing is painted yet."""
    world = World(scene, None, view, factor)
    world.image[:] = 0
    world.painted.clear()
    return world


def small_scene() -> tuple[Scene, int]:
    scene = Scene((32, 24))
    target = scene.add(np.ones((6, 6), np.bool_), (10, 10), name="target")
    scene.add(np.ones((3, 12), np.bool_), (10, 12), role="occluder", layer=1, name="wall")
    return scene, target


def test_facts_agree_with_the_hits() -> None:
    scene = load_scene(GALLERY)
    requests = requests_of(scene, weapons_of(scene))
    fired = [fire_request(scene, request) for request in requests]
    report = report_of(scene, fired, [request.name for request in requests])
    assert json.loads(json.dumps(report)) == report
    for told, given, hits in zip(report["shots"], requests, fired, strict=True):
        assert (told["weapon"], tuple(told["at"]), told["seed"]) == (given.name, given.at, given.seed)
        assert [row["object"] for row in told["rows"]] == hits.object.tolist()
        assert told["verdicts"] == hits.verdict_counts(0)
        samples = hits.samples_at(0)
        pixels = {tuple(p) for p in samples.xy.tolist()}
        assert sum(last - first + 1 for runs in told["samples"].values() for _, first, last in runs) == len(pixels)


def test_every_sample_is_marked_with_its_shape() -> None:
    scene, _ = small_scene()
    report = told(scene, (Disc(6), (10, 10)))
    samples = report["shots"][0]["samples"]
    assert set(samples) == {"hit", "occluded", "empty"}
    factor, view = 8, (2, 3, 20, 19)
    for verdict, runs in samples.items():
        world = blank(None, view, factor)
        world.mark_samples([{"samples": {verdict: runs}}])
        wanted = np.zeros(world.image.shape[:2], np.bool_)
        for y, first, last in runs:
            for x in range(max(first, 2), last + 1):
                if y >= 3:
                    wanted[(y - 3) * factor :, (x - 2) * factor :][:factor, :factor] = glyph(verdict, factor)
        assert np.array_equal(world.image.max(axis=2) > 2 * TINT, wanted), verdict
        assert wanted.any()


def test_shapes_differ_from_each_other_without_colour() -> None:
    for size in (3, 4, 6, 12, 24):
        drawn = {verdict: glyph(verdict, size).tobytes() for verdict in MARKS}
        assert len(set(drawn.values())) == len(MARKS), size


@pytest.mark.parametrize(
    ("scene", "shots"),
    [
        (Scene((32, 24)), []),
        (Scene((32, 24)), [(Disc(3), (500, 500))]),
        (Scene((1920, 1080)), [(Disc(40), (900, 500))]),
        (Scene(), [(Disc(2), (10**9, -(10**9)))]),
        (Scene((1, 1)), [(Disc(0), (0, 0))]),
        (Scene((2**40, 2**40)), [(Disc(30), (2**39, 2**39))]),
    ],
    ids=["no shot", "outside", "large", "no bounds, far", "one pixel", "huge world"],
)
def test_any_scene_has_a_picture(scene: Scene, shots: list[tuple[Weapon, tuple[float, float]]]) -> None:
    report = told(scene, *shots)
    picture = picture_of_report(report, scene)
    assert picture.dtype == np.uint8 and picture.shape[2] == 3
    assert max(picture.shape) <= 4000


def test_long_and_foreign_names_and_many_objects_are_drawn() -> None:
    scene = Scene((200, 100), name="a very long name " * 11)
    for i in range(300):
        scene.add(Sprite.circle(4), (5 + i % 20 * 10, 5 + i // 20 * 6), name=f"objet numéro {i} " + "x" * 80)
    picture = picture_of_report(told(scene, (Disc(60), (100, 50))), scene)
    assert picture.shape[0] < 10_000


def test_text_is_a_layer_of_its_own() -> None:
    scene, _ = small_scene()
    report = told(scene, (Disc(6), (10, 10)))
    with_text, without = picture_of_report(report, scene), picture_of_report(report, scene, text=False)
    assert with_text.shape == without.shape
    assert not np.array_equal(with_text, without)


def test_a_heat_picture_names_what_was_hit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside it, and covering no pixel of it; what was not hit has no name."""
    scene = Scene((200, 100))
    for name, x in (("cat", 30), ("dog", 100), ("hen", 170)):
        scene.add(Sprite.circle(9), (x, 50), name=name)
    report = report_of(scene, [fire(scene, Disc(4), [(30 + 70 * (i % 2), 50) for i in range(30)])])
    texts: list[Any] = []
    monkeypatch.setattr("hitplanes.weapons.report.picture.draw_texts", lambda page, every: texts.extend(every))
    with_names, without = picture_of_report(report, scene), picture_of_report(report, scene, text=False)
    y, x = (with_names != without).any(axis=2).nonzero()
    factor, names = factor_of((0, 0, 199, 99)), [text for text in texts if text.middle]
    assert sorted(text.text for text in names) == ["cat", "dog"]
    for text, middle in zip(sorted(names), (30, 100), strict=True):
        assert abs(text.x - EDGE - factor * (middle + 0.5)) < 2 and TOP < text.y < TOP + factor * (50 - 9)
    assert x.min() >= EDGE and x.max() < EDGE + factor * 115 and y.min() >= TOP and y.max() < TOP + factor * (50 - 9)


@pytest.mark.parametrize(
    "kind", some_of(["shots", "batch", "circles", "boxes", "out of view", "polygons", "rays", "rays, boxes"], 2)
)
def test_picture_without_text_is_the_same_on_every_opencv(kind: str) -> None:
    scene = load_scene(GALLERY)
    weapons = weapons_of(scene)
    reports = {
        "shots": lambda: gallery_report(scene),
        "circles": lambda: gallery_report(scene, "circle", "quadtree"),
        "boxes": lambda: gallery_report(scene, "4 boxes", "grid"),
        "polygons": lambda: gallery_report(scene, "polygon", "bvh"),
        "batch": lambda: report_of(scene, [fire(scene, weapons["shotgun"], [(8 * i, 5 * i) for i in range(60)])]),
        "out of view": lambda: told(scene, (weapons["blast"], (-300, 100)), (weapons["point"], (1e4, 9e4))),
    }
    reports["rays"] = lambda: ray_report(scene)
    reports["rays, boxes"] = lambda: ray_report(scene, "4 boxes", "grid")
    picture = picture_of_report(reports[kind](), scene, text=False)
    assert hashlib.sha256(picture.tobytes()).hexdigest()[:16] == PICTURE_HASHES[kind]


PICTURE_HASHES = {
    "shots": "6a419542aeceeb09",
    "batch": "d45ea7528a3a98ec",
    "out of view": "ef14ea21b7c2bff0",
    "circles": "484e7ac8e8fe2da3",
    "boxes": "9132ed929da2f872",
    "polygons": "8228d0d954fc5111",
    "rays": "bfb37d0a9a31fe55",
    "rays, boxes": "aa3143bad18fb20b",
}
"""Of pictures without text; look at a picture before changing its hash."""


def test_a_changed_scene_is_refused() -> None:
    scene, target = small_scene()
    report = told(scene, (Disc(6), (10, 10)))
    scene.move(target, (11, 10))
    with pytest.raises(InputError, match="it has changed"):
        picture_of_report(report, scene)


def test_drawing_changes_nothing_that_decides() -> None:
    scene, _ = small_scene()
    before = scene.content_hash(), scene.version
    hits = fire(scene, Disc(6), (10, 10))
    picture_of_report(told(scene, (Disc(6), (10, 10))), scene)
    assert (scene.content_hash(), scene.version) == before
    assert hits == fire(scene, Disc(6), (10, 10))


def test_view_draws_by_layer_and_hud_last() -> None:
    scene = Scene((4, 1))
    scene.add(Sprite.from_mask(np.ones((1, 4), np.bool_), color=(10, 0, 0)), (1.5, 0), role="background", layer=9)
    scene.add(Sprite.from_mask(np.ones((1, 3), np.bool_), color=(20, 0, 0)), (2, 0), layer=2)
    scene.add(Sprite.from_mask(np.ones((1, 2), np.bool_), color=(30, 0, 0)), (2.5, 0), role="mover", layer=3)
    scene.add(Sprite.from_mask(np.ones((1, 1), np.bool_), color=(40, 0, 0)), (3, 0), role="hud", layer=-5)
    assert draw_view(scene.items, (0, 0, 3, 0))[0, :, 0].tolist() == [10, 20, 30, 40]


def test_blend_rounds_to_the_nearest_and_clips() -> None:
    picture = np.full((2, 2, 3), 100, np.uint8)
    blend(picture, (200, 200, 200), np.full((3, 3), 128, np.uint8), -1, -1)
    assert picture.tolist() == [[[150] * 3] * 2] * 2


def test_the_hud_stays_where_the_player_has_it() -> None:
    """Placed from the corner of the player's screen, also where the view begins elsewhere."""
    scene = Scene((4, 1))
    scene.add(Sprite.from_mask(np.ones((1, 1), np.bool_), color=(40, 0, 0)), (1, 0), role="hud")
    assert (draw_view(scene.items, (0, 0, 3, 0))[0, :, 0] == 40).tolist() == [False, True, False, False]
    assert (draw_view(scene.items, (5, 7, 8, 7))[0, :, 0] == 40).tolist() == [False, True, False, False]
    assert (draw_view(scene.items, (-2, 0, 3, 0), (0, 0))[0, :, 0] == 40).tolist() == [False] * 3 + [True] + [False] * 2
    assert (draw_view(scene.items, (5, 0, 6, 0), (0, 0))[0, :, 0] == 40).tolist() == [False, False]


def test_outlines_differ_by_what_became_of_the_object() -> None:
    """A plain line, a thicker one, a dashed one; and only what is seen, where it is told what is."""
    scene = Scene((12, 12))
    item = scene.add(np.ones((6, 6), np.bool_), (5, 5))
    scene.add(np.ones((12, 3), np.bool_), (2, 5), role="occluder", layer=1)
    drawn = {}
    for kind in ("other", "blocked", "hit"):
        world = blank(scene, (0, 0, 11, 11), 8)
        world.outline(item, kind)
        drawn[kind] = world.image.any(axis=2)
        assert world.painted == {f"object {kind}"}
    assert drawn["other"].sum() == 4 * 47 and drawn["hit"].sum() == 4 * 47 + 4 * 45
    assert (drawn["blocked"] <= drawn["hit"]).all() and 0.3 < drawn["blocked"].sum() / drawn["hit"].sum() < 0.7
    world = blank(scene, (0, 0, 11, 11), 8)
    world.outline_seen([item])
    columns = np.flatnonzero(world.image.any(axis=2).any(axis=0))
    assert (columns.min() // 8, columns.max() // 8) == (4, 8), "three of its columns are hidden"


def test_an_object_that_the_view_cuts_has_no_border_there() -> None:
    scene = Scene()
    item = scene.add(np.ones((9, 9), np.bool_), (4, 4))
    for draw in (lambda w: w.outline(item, "hit"), lambda w: w.outline_seen([item])):
        world = blank(scene, (2, 2, 6, 6), 8)
        draw(world)
        assert not world.image.any() and not world.painted, "its border lies out of view"
        world = blank(scene, (2, 2, 9, 9), 8)
        draw(world)
        assert world.image.any() and not world.image[0, 0].any()


@pytest.mark.parametrize(("radius", "named"), [(4, ["tank"]), (90, [])])
def test_an_object_that_fills_the_picture_is_named_on_itself(radius: int, named: list[str]) -> None:
    """Beside its samples, if they leave room."""
    scene = Scene((64, 48))
    scene.add(Sprite.from_mask(np.ones((48, 64), np.bool_), pivot_xy=(0, 0)), (0, 0), name="tank")
    report = told(scene, (Disc(radius), (30, 20)))
    view = 0, 0, 63, 47
    overlay = Overlay(World(scene, None, view, factor_of(view)))
    overlay.keep_free(report["shots"], scene)
    samples = overlay.taken & ~overlay.bodies
    overlay.names(report["shots"], scene)
    assert [label.text for label in overlay.texts] == named
    for label in overlay.texts:
        place = samples[label.y - 14 : label.y + 4, label.x - 18 : label.x + 18]
        assert place.shape == (18, 36) and samples.any() and not place.any()


def test_the_legend_has_what_the_picture_has() -> None:
    """Not what lies out of view or hidden."""
    scene, _ = small_scene()
    scene.add(Sprite.circle(1), (14, 12), name="hidden")
    report = told(scene, (Disc(6), (10, 10)))
    world = blank(scene, tuple(report["view_xyxy"]), 8)
    words = [entry.word for entry in legend_of(report, world.painted, 900).entries]
    assert words == []
    world = World(scene, None, tuple(report["view_xyxy"]), 8)
    world.mark_samples(report["shots"])
    words = [entry.word for entry in legend_of(report, world.painted, 900).entries]
    assert words == ["hit", "occluded", "empty", "occluder"]
    far = told(scene, (Disc(1), (-4000, 5)))
    picture_of_report(far, scene)
    world = World(scene, None, tuple(far["view_xyxy"]), 8)
    world.mark_samples(far["shots"])
    assert "outside" not in [entry.word for entry in legend_of(far, world.painted, 900).entries]


def test_a_legend_takes_as_many_lines_as_it_needs() -> None:
    scene, _ = small_scene()
    report = told(scene, (Disc(6), (10, 10)))
    painted = {*MARKS, "occluder", "object hit", "object blocked", "object other"}
    wide, narrow = (legend_of(report, painted, width) for width in (2000, 400))
    assert wide.height < narrow.height and len(wide.entries) == len(narrow.entries) == len(painted)
    for legend, width in ((wide, 2000), (narrow, 400)):
        ends = [x + e.mark.shape[1] + 8 * len(e.word) for (x, _), e in zip(legend.places, legend.entries, strict=True)]
        assert max(ends) < width
