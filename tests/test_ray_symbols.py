"""Rays over the world: arrows and their signs lie where they must, whatever the view; and the words of their cards."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest

from hitplanes import Laser, Pistol, Projectile, Rifle, Rounds, Scene, Spread, Sprite, Sweep, Weapon, fire
from hitplanes.planes.common.checks import Bools, Image
from hitplanes.weapons.report.canvas import NAMED_SIGNS, World, legend_of
from hitplanes.weapons.report.cards import CELL, COLUMNS, ROWS, inset_of, shot_card
from hitplanes.weapons.report.overlay import Overlay, draw_rays
from hitplanes.weapons.report.phrases import apart, missed
from hitplanes.weapons.report.picture import picture_of_report
from hitplanes.weapons.report.report import report_of
from hitplanes.weapons.report.symbols import (
    BADGE,
    BLUE,
    CROWDED,
    MINT,
    NEAR_MISS,
    ORANGE,
    SEVERAL,
    SIGNS,
    THROUGH,
    YELLOW,
    Strokes,
    sign_mark,
    within,
)

FACTOR = 8
VIEW = (0, 0, 59, 39)


def ray(start: Any, stop: Any, end: Any, reason: str = "range", *passes: dict[str, Any]) -> dict[str, Any]:
    length, far = np.hypot(*np.subtract(end, start)), np.hypot(*np.subtract(stop, start))
    told = {
        "reason": reason,
        "item": None if reason == "range" else {"object": 1, "name": "wall"},
        "cell_xy": np.rint(stop).astype(int).tolist(),
        "point": list(stop),
        "distance": float(far),
        "fraction": float(far / length) if length else 0.0,
    }
    return {"round": 0, "pellet": 0, "start": list(start), "end": list(end), "stop": told, "passes": list(passes)}


def crossing(start: Any, end: Any, into: float, out: float, order: int, normal: Any) -> dict[str, Any]:
    """A pass from one part of a ray to another."""
    point = np.add(start, np.multiply(into, np.subtract(end, start))).tolist()
    return {"order": order, "entry": into, "exit": out, "point": point, "normal": list(normal), "object": 0}


def shot(*rays: dict[str, Any], radius: float = 0.0, miss: dict[str, Any] | None = None) -> dict[str, Any]:
    return {"weapon": "gun", "rays": list(rays), "radius": radius, "nearest_miss": miss}


def drawn(
    *shots: dict[str, Any], view: tuple[int, int, int, int] = VIEW, kind: dict[str, Any] | None = None
) -> tuple[World, list[Any]]:
    world = World(None, None, view, FACTOR)
    world.image[:] = 0
    texts, taken = draw_rays(world, {"shots": list(shots), "weapons": {"gun": kind or {"kind": "laser"}}})
    assert not world.image[~taken].any(), "labels keep off what is drawn"
    return world, texts


def at(world: World, x: float, y: float) -> tuple[int, ...]:
    """The pixel of the picture at a point of the world."""
    column, row = np.floor(world.placed(np.array([[x, y]]))[0]).astype(int)
    return tuple(world.image[row, column].tolist())


def near(image: Image, color: tuple[int, int, int], off: int = 12) -> Bools:
    """Pixels of a picture that have a colour, or nearly."""
    return np.asarray((np.abs(image.astype(int) - color) <= off).all(axis=2))


def like(image: Image, color: tuple[int, int, int]) -> Bools:
    """Pixels of a picture that have a colour, or half of it: thin lines are smooth."""
    most = image.max(axis=2, keepdims=True).astype(float)
    same = np.abs(image / np.maximum(most, 1) - np.array(color) / max(color)).max(axis=2) < 0.04
    return np.asarray(same & (most[:, :, 0] > 110))


def has(world: World, color: tuple[int, int, int], x: float, y: float, reach: float = 0.5) -> bool:
    """Whether a colour occurs within some px of the world around a point."""
    column, row = np.floor(world.placed(np.array([[x, y]]))[0]).astype(int)
    r = int(reach * FACTOR)
    return bool(like(world.image[max(row - r, 0) : row + r + 1, max(column - r, 0) : column + r + 1], color).any())


WHITE = (255, 255, 255)


def test_an_arrow_goes_from_start_to_stop_and_dashes_to_the_end() -> None:
    world, _ = drawn(shot(ray((5, 10), (30, 10), (50, 10), "hits")))
    for x in np.arange(5.5, 28, 0.5):
        assert at(world, x, 10) == WHITE, x
    row = world.image[int(10.5 * FACTOR), int(31.5 * FACTOR) : int(50 * FACTOR)].max(axis=1) > 60
    changes = np.flatnonzero(np.diff(row.astype(int)))
    assert 0.4 < row.mean() < 0.6 and 20 < len(changes) < 30, "dashes as long as their gaps, 6 px"
    assert world.image[:, : int(4.9 * FACTOR)].max() == 0 and world.image[:, int(51 * FACTOR) :].max() == 0
    assert world.image[: int(9 * FACTOR)].max() == 0 and world.image[int(12 * FACTOR) :].max() == 0


def test_what_is_beyond_is_faint_and_nothing_where_a_ray_has_its_range() -> None:
    ways = (((30, 10), "hits"), ((50, 10), "range"))
    ended, free = (drawn(shot(ray((5, 10), stop, (50, 10), why)))[0] for stop, why in ways)
    assert 60 < ended.image[:, int(32 * FACTOR) :].max() < 160
    assert "ray: beyond its end" in ended.painted and "ray: beyond its end" not in free.painted


def test_the_head_is_at_the_stop() -> None:
    world, _ = drawn(shot(ray((5, 10), (30, 10), (30, 10), "occluder")))
    inked = near(world.image, WHITE)
    tall = inked.sum(axis=0)
    tip = int(30.5 * FACTOR)
    assert tall[tip - 12] >= 9 and tall[tip - 40] <= 4, "the head is wider than the shaft"
    assert not inked[:, tip + 2 :].any()
    sharp, _ = drawn(shot(ray((5, 10), (30, 10), (30, 10), "hits")))
    assert not near(sharp.image, WHITE)[:, tip - 5 :].any(), "the shaft ends within the head"
    back, _ = drawn(shot(ray((30, 10), (5, 10), (5, 10), "occluder")))
    assert near(back.image, WHITE).sum(axis=0)[int(5.5 * FACTOR) + 12] >= 9, "it points where the ray goes"


@pytest.mark.parametrize(
    ("reason", "name", "color"),
    [("occluder", "ends: occluder", BLUE), ("budget", "ends: budget", ORANGE), ("hits", "ends: last hit", ORANGE)],
)
def test_why_a_ray_ended_has_a_sign_of_its_own(reason: str, name: str, color: tuple[int, int, int]) -> None:
    world, _ = drawn(shot(ray((5, 10), (30, 10), (50, 10), reason)))
    others = {f"ray: ends: {word}" for word in ("occluder", "budget", "last hit")} - {f"ray: {name}"}
    assert f"ray: {name}" in world.painted and not world.painted & others
    where = {"occluder": (30, 10), "budget": (30, 10.7), "hits": (29, 10)}[reason]
    assert has(world, color, *where, reach=0.2)
    assert not has(world, color, 20, 10, reach=4)
    free, _ = drawn(shot(ray((5, 10), (30, 10), (30, 10), "range")))
    assert not near(free.image, color).any() and free.painted == {"ray: ray"}
    x, y = int(30.5 * FACTOR), int(10.5 * FACTOR)
    assert free.image[y + 2, x - 10].max() < 60 and free.image[y + 4 : y + 8, x - 10].max() > 180, "an open head"


def test_signs_of_ends_differ_without_colour() -> None:
    """In grey, and where an orange is as light as a blue."""
    shapes = set()
    for reason in ("occluder", "budget", "hits", "range"):
        world, _ = drawn(shot(ray((5, 10), (30, 10), (30, 10), reason)))
        shapes.add((world.image.max(axis=2) > 60).tobytes())
    assert len(shapes) == 4
    marks = {sign_mark(name).max(axis=2).tobytes() for name in NAMED_SIGNS}
    assert len(marks) == len(NAMED_SIGNS)


def test_entries_are_numbered_and_exits_are_rings() -> None:
    a, b = (5, 20), (55, 20)
    passes = [crossing(a, b, 0.2, 0.4, 0, (-3, -4)), crossing(a, b, 0.6, 0.8, 1, (-5, 0))]
    world, texts = drawn(shot(ray(a, b, b, "range", *passes)))
    assert [text.text for text in texts] == ["1", "2"]
    assert {"ray: goes in", "ray: comes out", "ray: normal", "ray: number", f"ray: {THROUGH}"} <= world.painted
    assert at(world, 15, 20) == ORANGE and at(world, 20, 20) == ORANGE and at(world, 29, 20) == WHITE
    for text, x in zip(texts, (15, 35), strict=True):
        middle = (text.x + 4) / FACTOR - 0.5, (text.y - 4) / FACTOR - 0.5
        assert abs(middle[0] - x) < 0.2 and 1 < abs(middle[1] - 20) < 3
        assert has(world, ORANGE, *middle, reach=0.1)
        assert has(world, ORANGE, middle[0] + (BADGE - 2) / FACTOR, middle[1], reach=0.1)
    assert texts[0].y > 20.5 * FACTOR, "away from the normal"
    _, (text,) = drawn(shot(ray(a, b, b, "range", crossing(a, b, 0.2, 0.4, 0, (-3, 4)))))
    assert text.y < 20.5 * FACTOR
    ring = world.placed(np.array([[25.0, 20.0]]))[0].astype(int)
    assert not near(world.image[ring[1] - 2 : ring[1] - 1, ring[0] + 2 : ring[0] + 3], ORANGE).any(), "it is hollow"
    assert has(world, YELLOW, 15 - 0.6 * 1.5, 20 - 0.8 * 1.5, reach=0.15), "the normal"
    assert not has(world, YELLOW, 15 + 1.5, 20 + 1.5, reach=0.8)


def test_a_ray_that_ends_in_an_object_does_not_come_out() -> None:
    a, b = (5, 20), (55, 20)
    inside, _ = drawn(shot(ray(a, (30, 20), b, "budget", crossing(a, b, 0.3, 0.5, 0, (-5, 0)))))
    assert "ray: goes in" in inside.painted and "ray: comes out" not in inside.painted
    at_its_entry, texts = drawn(shot(ray(a, (30, 20), b, "hits", crossing(a, b, 0.5, 0.5, 0, (-5, 0)))))
    assert not at_its_entry.painted & {"ray: goes in", "ray: comes out", f"ray: {THROUGH}"}
    assert len(texts) == 1 and {"ray: normal", "ray: ends: last hit"} <= at_its_entry.painted


def test_shots_of_many_rays_have_no_numbers_and_numbers_have_room() -> None:
    a, b = (5, 20), (55, 20)
    one = ray(a, b, b, "range", crossing(a, b, 0.2, 0.4, 0, (-5, 0)))
    many, texts = drawn(shot(one, one, one, one))
    assert not texts and not many.painted & {"ray: number", "ray: normal"} and "ray: goes in" in many.painted
    close = [crossing(a, b, 0.5 + k / 100, 0.505 + k / 100, k, (-5, 0)) for k in range(9)]
    _, texts = drawn(shot(ray(a, b, b, "range", *close)))
    spots = [(text.x, text.y) for text in texts]
    assert 2 <= len(spots) < 9
    apart = [np.hypot(p[0] - q[0], p[1] - q[1]) for i, p in enumerate(spots) for q in spots[:i]]
    assert min(apart) > 2 * BADGE


def test_of_many_rays_each_is_thinner() -> None:
    one = ray((5, 10), (30, 10), (50, 10), "occluder")
    inked = []
    for count in (1, SEVERAL + 1, CROWDED + 1):
        world, _ = drawn(shot(*[one] * count))
        inked.append(int(world.image[:, : 20 * FACTOR].astype(int).sum()))
        assert ("ray: beyond its end" in world.painted) == (count <= CROWDED)
    assert inked[0] > 1.2 * inked[1] > 1.2 * 1.2 * inked[2] > 0


def test_a_ray_out_of_view_draws_nothing() -> None:
    for start, end in (
        ((-50, 10), (-10, 10)),
        ((0, 300), (60, 300)),
        ((-9, 60), (-9, -60)),
        ((10**12, 5), (10**12 + 9, 5)),
    ):
        passes = crossing(start, end, 0.1, 0.2, 0, (1, 1))
        miss = {"distance": 3.0, "ray_xy": list(start), "object_xy": [start[0], start[1] - 3]}
        world, texts = drawn(shot(ray(start, end, end, "occluder", passes), radius=2, miss=miss))
        assert not world.image.any() and not world.painted and not texts


@pytest.mark.parametrize("reason", ["occluder", "range"])
def test_a_view_shows_its_part_of_a_larger_one(reason: str) -> None:
    """Also of a ray that begins and ends outside of it, dashes and all."""
    a, b, c = (-30.25, -4.5), (70.5, 47.25), (109.5, 67.2)
    told = shot(ray(a, b, c, reason, crossing(a, c, 0.3, 0.4, 0, (-3, 5))), radius=3.0)
    rest = shot(ray((3, 3), (9, 9), (90, 9), "hits"))
    past = shot(ray((-30, 30), (-11.3, 30.2), (90, 31.3), "hits"))
    large, _ = drawn(told, rest, past, view=(-40, -20, 119, 79))
    small, _ = drawn(told, rest, past)
    part = large.image[20 * FACTOR : 60 * FACTOR, 40 * FACTOR : 100 * FACTOR]
    assert small.image.any() and np.abs(part.astype(int) - small.image).max() <= 1


def test_far_away_a_picture_is_the_same() -> None:
    for far in (10**9, -(10**9) + 7):
        pictures = []
        for o in (0, far):
            a, b = (o + 5.25, o + 10.5), (o + 50.5, o + 30.25)
            told = shot(ray(a, b, b, "range", crossing(a, b, 0.25, 0.5, 0, (-5, 1))), radius=1.5)
            pictures.append(drawn(told, view=(o, o, o + 59, o + 39))[0].image)
        assert np.array_equal(*pictures)


@pytest.mark.parametrize("reason", ["range", "occluder", "hits", "budget"])
def test_a_ray_of_no_length_is_a_point(reason: str) -> None:
    for radius in (0.0, 3.0):
        world, _ = drawn(shot(ray((20, 20), (20, 20), (20, 20), reason), radius=radius))
        y, x = np.nonzero(world.image.any(axis=2))
        assert len(y) and max(abs(y - 20.5 * FACTOR).max(), abs(x - 20.5 * FACTOR).max()) < (radius + 2) * FACTOR
        assert "ray: beyond its end" not in world.painted


def test_what_is_thick_has_an_outline_and_a_projectile_its_first_contact() -> None:
    told = ray((10, 20), (40, 20), (50, 20), "occluder")
    told["stop"]["cell_xy"] = [44, 20]
    laser, _ = drawn(shot(told, radius=4.0))
    flight, _ = drawn(shot(told, radius=4.0), kind={"kind": "projectile", "speed": 40, "radius": 4})
    for world in (laser, flight):
        for x, y in ((20, 16), (30, 24), (6, 20)):
            assert max(at(world, x, y)) > 100, "the outline"
        assert 20 < max(at(world, 20, 18)) < 50, "its ground"
        assert max(at(world, 20, 15)) == 0 and max(at(world, 47, 16)) == 0
    assert "ray: first contact" in flight.painted and "ray: first contact" not in laser.painted
    assert (
        has(flight, YELLOW, 40, 16, 0.2) and has(flight, YELLOW, 44.5, 20, 0.2) and not has(laser, YELLOW, 40, 16, 0.2)
    )
    struck = ray((10, 20), (40, 20), (50, 20), "hits", crossing((10, 20), (50, 20), 0.75, 0.75, 0, (-5, 0)))
    _, (text,) = drawn(shot(struck, radius=4.0), kind={"kind": "projectile", "radius": 4})
    assert abs((text.y - 4) / FACTOR - 0.5 - 20) > 4 + BADGE / FACTOR, "a number beside it"
    missed, _ = drawn(shot(ray((10, 20), (50, 20), (50, 20)), radius=4.0), kind={"kind": "projectile", "radius": 4})
    assert "ray: first contact" not in missed.painted


def test_a_projectile_of_steps_is_drawn_where_it_is_tested() -> None:
    kind = {"kind": "rounds", "count": 1, "weapon": {"kind": "projectile", "speed": 40, "radius": 2, "steps": 4}}
    world, _ = drawn(shot(ray((10, 20), (50, 20), (50, 20)), radius=2.0), kind=kind)
    assert {"ray: swept", "ray: tested only here", "ray: ray"} == world.painted
    for x in (20, 30, 40, 50):
        assert max(at(world, x, 18)) > 150, x
    for x in (10, 15, 25, 35, 45):
        assert max(at(world, x, 18)) == 0, x
    ended, _ = drawn(shot(ray((10, 20), (30, 20), (50, 20), "occluder"), radius=2.0), kind=kind)
    assert max(at(ended, 30, 18)) > 150 and max(at(ended, 40, 18)) == 0


def test_a_near_miss_is_measured_and_a_far_one_is_not() -> None:
    def told(distance: float) -> dict[str, Any]:
        miss = {"object": 0, "name": "bee", "distance": distance, "ray_xy": [20, 30], "object_xy": [20, 30 - distance]}
        return shot(ray((5, 30), (50, 30), (50, 30)), miss=miss)

    near_one, far_one, none = (drawn(told(d))[0] for d in (8.0, NEAR_MISS + 1.0, 0.0))
    assert "ray: near miss" in near_one.painted
    assert not {"ray: near miss"} & (far_one.painted | none.painted)
    assert has(near_one, MINT, 20, 22, 0.2) and has(near_one, MINT, 20, 26, 0.8) and not has(near_one, MINT, 20, 20, 1)
    overlay = Overlay(near_one)
    overlay.distances([told(8.0), told(NEAR_MISS + 1.0), {"rays": [], "nearest_miss": None}, {}])
    (text,) = overlay.texts
    assert text.text == "8.0 px" and abs(text.y - 26.5 * FACTOR) < 60


def test_strokes_that_cross_do_not_add_up() -> None:
    one, both = Strokes((40, 60)), Strokes((40, 60))
    a, b = np.array([5.0, 20.0]), np.array([55.0, 20.0])
    one.line(a, b, 4.0)
    for _ in range(3):
        both.line(a, b, 4.0)
    assert np.array_equal(one.ink, both.ink)
    assert abs(one.ink.sum() / 255 - (50 * 4 + np.pi * 4)) < 1
    ring = Strokes((40, 60))
    ring.around(np.array([30.0, 20.0]), np.array([30.0, 20.0]), 10.0, 2.0)
    assert abs(ring.ink.sum() / 255 - 2 * np.pi * 10 * 2) < 2
    assert ring.ink[20, 30] == 0 and ring.ground[20, 30] == 0
    head = Strokes((40, 60))
    head.head(np.array([30.0, 20.0]), np.array([1.0, 0.0]), 12.0)
    assert abs(head.ink.sum() / 255 - 12 * 12 / 2) < 3


def test_a_stroke_of_any_width_takes_the_memory_of_the_picture() -> None:
    wide = Strokes((40, 60))
    tracemalloc.start()
    wide.line(np.array([-(10.0**7), 20.0]), np.array([10.0**7, 20.0]), 2.0 * 10**7)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (wide.ink == 255).all() and peak < 2**20


def test_segments_are_cut_where_they_leave() -> None:
    a, b = np.array([[-10.0, 5], [5, 5], [-9, -9]]), np.array([[30.0, 5], [6, 6], [-5, 90]])
    begin, end = within(a, b, np.array([20, 10]), 2.0)
    assert begin.tolist() == [[-2, 5], [5, 5]] and end.tolist() == [[22, 5], [6, 6]]


# Reports


def range_() -> Scene:
    scene = Scene((170, 110), name="range")
    scene.add(Sprite.circle(9), (60, 20), name="apple")
    scene.add(Sprite.box(13, 13), (100, 20), name="crate", cost=2)
    scene.add(Sprite.circle(4), (78, 8), name="bee")
    scene.add(Sprite.box(4, 26), (150, 22), role="occluder", layer=1, name="wall")
    scene.add(Sprite.circle(3), (165, 22), name="thief")
    return scene


def told(scene: Scene, weapon: Weapon, at: tuple[float, float] = (10, 20), aim: float | None = 0, **more: Any) -> Any:
    (one,) = report_of(scene, [fire(scene, weapon, at, aim=aim, **more)])["shots"]
    return one


def test_a_card_tells_the_way_of_one_ray() -> None:
    scene = range_()
    lines = shot_card(told(scene, Rifle(160)), 0, scene).lines
    assert lines[:4] == [
        ("object hit", "in", "out", "material"),
        ("1. apple", "40.5 px", "59.5 px", "19.0 px"),
        ("2. crate", "83.5 px", "96.5 px", "13.0 px"),
        ["ended at wall, 137.5 px: occluder"],
    ]
    assert lines[4] == ("wall ends 1 ray", "in front of thief")
    assert lines[5] == ("nearest bee", "missed low by 7.5 px")
    assert ("not thief", "behind wall") in lines and not any("not bee" in line for line in lines)
    budget = shot_card(told(scene, Rifle(160, budget=30)), 0, scene).lines
    assert ["ended in crate, 89.0 px: budget used up"] in budget
    just = shot_card(told(scene, Rifle(160, budget=19)), 0, scene).lines
    assert ["ended in apple, 59.5 px: budget used up"] in just and ("not crate", "behind apple") in just
    nothing = shot_card(told(scene, Rifle(160, budget=0)), 0, scene).lines
    assert ["ended after 0.0 px: budget used up"] in nothing and ("not crate", "no budget to begin with") in nothing
    pistol = shot_card(told(scene, Pistol(160)), 0, scene).lines
    assert ["ended at apple, 40.5 px: last hit"] in pistol
    free = shot_card(told(scene, Laser(30), (10, 90)), 0, scene).lines
    assert ["ended after 30.0 px: range"] in free
    faded = shot_card(told(scene, Laser(160, falloff="linear")), 0, scene).lines
    assert faded[0][-1] == "weight" and faded[1][-1] == "0.75"


def test_a_card_tells_many_rays_together() -> None:
    scene = range_()
    shot = told(scene, Sweep(Laser(160), 20, 7))
    lines = shot_card(shot, 0, scene).lines
    assert lines[0] == ("object hit", "rays", "in", "out", "material")
    name, rays, into, out, material = lines[1]
    passes = [p for r in shot["rays"] for p in r["passes"] if p["name"] == "apple"]
    assert (name, rays) == ("apple", str(len(passes))) and len(passes) > 1
    assert (
        into == f"{min(p['entry_px'] for p in passes):.1f} px" and out == f"{max(p['exit_px'] for p in passes):.1f} px"
    )
    assert material == f"{sum(p['material'] for p in passes):.1f} px"
    ends = [line[0] for line in lines if len(line) == 1]
    reasons = [r["stop"]["reason"] for r in shot["rays"]]
    assert f"{reasons.count('range')} rays ended at their range" in ends
    assert any(line.endswith("ended at wall: occluder") for line in ends)
    bursts = shot_card(told(scene, Rounds(Rifle(160), 2, recoil_deg=1)), 0, scene).lines
    assert {line[0] for line in bursts} >= {"apple, round 0", "apple, round 1"}


@pytest.mark.parametrize(
    ("to", "way"),
    [
        ((0, -9), "missed low by 5.0 px"), ((0, 9), "missed high by 5.0 px"), ((-9, 0), "missed right by 5.0 px"),
        ((9, 0), "missed left by 5.0 px"), ((9, 9), "missed high and left by 5.0 px"),
        ((-9, -9), "missed low and right by 5.0 px"), ((1, -9), "missed low by 5.0 px"),
        ((5, 9), "missed high and left by 5.0 px"), ((9, -5), "missed low and left by 5.0 px"),
        ((0, 0), "missed by 5.0 px"),
    ],
)  # fmt: skip
def test_a_miss_says_where_the_ray_went_by(to: tuple[int, int], way: str) -> None:
    miss = {"name": "bee", "distance": 5.0, "ray_xy": [20, 30], "object_xy": [20 + to[0], 30 + to[1]]}
    assert missed(shot(ray((5, 30), (50, 30), (50, 30)), miss=miss)) == ("nearest bee", way)


def test_a_miss_ahead_of_the_end_is_short() -> None:
    for object_xy, way in (([59, 31], "ended 9.0 px short of it"), ([50, 20], "missed low by 9.0 px")):
        miss = {"name": "bee", "distance": 9.0, "ray_xy": [50, 30], "object_xy": object_xy}
        assert missed(shot(ray((5, 30), (50, 30), (90, 30), "occluder"), miss=miss)) == ("nearest bee", way)
    assert missed(shot(ray((5, 30), (50, 30), (90, 30)))) is None


def test_a_ray_that_started_inside_says_so() -> None:
    scene = range_()
    shot = told(scene, Laser(20, inside="ignore_until_exit"), (60, 20))
    assert not shot["rows"]
    lines = shot_card(shot, 0, scene).lines
    assert ("not apple", "it started inside of it") in lines
    assert not any("nearest apple" in line[0] for line in lines)


def test_a_card_draws_its_only_ray_from_end_to_end() -> None:
    scene = range_()
    card = shot_card(told(scene, Rifle(160)), 0, scene)
    page = np.zeros((card.height, 464, 3), np.uint8)
    card.draw(page, 0, 0, 464)
    strip = page[36:45, 10:454]
    orange = np.flatnonzero(near(strip, ORANGE).sum(axis=0) > 4)
    assert abs(orange.min() - 40.5 / 160 * 444) < 3 and abs(orange.max() - 96.5 / 160 * 444) < 9
    blue = np.flatnonzero(near(strip, BLUE).all(axis=0))
    assert len(blue) == 2 and abs(blue.min() - 137.5 / 160 * 444) < 3
    assert shot_card(told(scene, Sweep(Laser(160), 20, 7)), 0, scene).ray is None


def test_counts_have_what_lies_beyond() -> None:
    scene = range_()
    shot = told(scene, Pistol(160))
    card, beyond = shot_card(shot, 0, scene), shot["verdicts"]["beyond"]
    texts = [text.text for text in card.draw(np.zeros((card.height, 464, 3), np.uint8), 0, 0, 464)]
    assert any(text.startswith(f"{beyond} beyond, ") for text in texts) and beyond > 100


def test_under_rays_only_what_they_meet_is_marked() -> None:
    scene = range_()
    report = report_of(scene, [fire(scene, Laser(160, width=7), (10, 20), aim=0)])
    picture = picture_of_report(report, scene, text=False)
    factor = (picture.shape[1] - 32) // (report["view_xyxy"][2] - report["view_xyxy"][0] + 1)
    left = (picture.shape[1] - (report["view_xyxy"][2] - report["view_xyxy"][0] + 1) * factor) // 2
    x0, y0 = report["view_xyxy"][:2]

    def cell(x: int, y: int) -> Image:
        top = 44 + (y - y0) * factor
        return picture[top : top + factor, left + (x - x0) * factor : left + (x + 1 - x0) * factor]

    assert len(np.unique(cell(30, 22).reshape(-1, 3), axis=0)) == 1, "no mark where it meets nothing"
    assert near(cell(60, 22), ORANGE, 40).any()


def test_the_inset_shows_the_ray() -> None:
    scene = range_()
    inset = inset_of(told(scene, Rifle(160)), scene)
    assert inset is not None
    middle = inset.image[ROWS // 2 * CELL + CELL // 2]
    assert near(middle[None, 2 : 3 * CELL], WHITE).all() and near(middle[None, -3 * CELL : -2], ORANGE).all()
    assert len(middle) == COLUMNS * CELL


def test_a_shot_of_rays_is_numbered_where_it_starts() -> None:
    scene = range_()
    report = report_of(scene, [fire(scene, Rifle(20), (10.25, 80.5), aim=0)])
    world = World(scene, scene.bounds, tuple(report["view_xyxy"]), FACTOR)
    overlay = Overlay(world)
    overlay.shot(report["shots"][0], 0)
    x, y = np.floor(world.placed(np.array([10.25, 80.5]))).astype(int)
    assert (world.image[y, x - 5 : x + 6] == 255).all() and (world.image[y - 5 : y + 6, x] == 255).all()


def test_the_legend_tells_what_is_drawn_of_rays() -> None:
    scene = range_()
    shots = [
        fire(scene, Rifle(160), (10, 20), aim=0),
        fire(scene, Projectile(30, 2), (20, 90), aim=0),
        fire(scene, Spread(Pistol(99), count=5, radius=3), (10, 22), aim=0),
    ]
    words = []
    for hits in shots:
        report = report_of(scene, [hits])
        world = World(scene, scene.bounds, tuple(report["view_xyxy"]), 4)
        draw_rays(world, report)
        words.append([e.word for e in legend_of(report, world.painted, 2000).entries if e.word in SIGNS])
    assert words == [
        ["beyond its end", "near miss", "ray", THROUGH, "ends: occluder", "normal"],
        ["what it sweeps", "ray"],
        ["beyond its end", "ray", "ends: last hit"],
    ]


def test_a_miss_by_little_is_not_told_as_none() -> None:
    assert [apart(distance) for distance in (0.001, 0.049, 0.05, 12.34)] == [
        "< 0.1 px",
        "< 0.1 px",
        "0.1 px",
        "12.3 px",
    ]
