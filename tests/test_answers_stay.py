"""Answers are of the scene that was fired at, whatever becomes of it; what cannot be told later says how to keep it."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_ray_hits import fired, many

from hitplanes import (
    Disc,
    History,
    Hits,
    InputError,
    Laser,
    Pistol,
    RayHits,
    Rifle,
    Scene,
    Spread,
    Sprite,
    Sweep,
    fire,
    prepare,
)
from hitplanes.weapons.explain.owners import OwnerRow

STALE = r"^hits: expected the scene at version \d+, got version \d+: read this before the scene changes, or fire at "
STALE += r"scene\.copy\(\) or at a History, which stay as they are$"


def squad() -> tuple[Scene, list[int]]:
    """Two bodies of a torso and a head, and a wall before one of them."""
    scene = Scene((120, 60))
    bodies = []
    for x in (30, 60):
        torso = scene.add(Sprite.box(10, 20), (x, 35))
        scene.add(Sprite.circle(5), (x, 20), owner=torso, layer=1)
        bodies.append(torso)
    scene.add(Sprite.box(4, 30), (66, 30), role="occluder", layer=2)
    return scene, bodies


def end_all(scene: Scene) -> None:
    """Change all that an answer could look at: owners, places, masks, layers, costs, and who is there."""
    ids = scene.ids()
    scene.set(ids, owner=ids[-1], layer=7, cost=9, angle=33, velocity_xy=(4, 4), categories=2)
    scene.move(ids, (500, 500))
    scene.remove(ids[:3])
    for _ in range(20):
        scene.add(Sprite.box(40, 40), (40, 30))


def told_of(hits: Hits) -> dict[str, Any]:
    """The answer as JSON, without the plan: the stack is put in order for the first of two calls."""
    return {name: value for name, value in hits.to_dict().items() if name != "plan"}


def all_of_a_ray(hits: RayHits) -> list[Any]:
    """All that can be read of rays after the scene changed."""
    columns = [column.tolist() for table in (hits.passes, hits.stop) for column in vars(table).values()]
    return [list(hits), hits.by_owner(), hits.to_rows(), hits.to_numpy().tobytes(), told_of(hits), columns]


def all_of_an_area(hits: Hits) -> list[Any]:
    """All that can be read of areas."""
    told = [list(hits), hits.by_owner(), hits.to_rows(), told_of(hits), hits.shares(), hits.margins()]
    for shot in range(len(hits.shots)):
        samples = [column.tolist() for column in hits.samples_at(shot)]
        pixels = {key: spans.pixels().tolist() for key, spans in hits.pixels_at(shot).items()}
        told += [samples, pixels, hits.why_not(shot), hits.blockers(shot)]
    return told


AREAS = [Disc(30), Disc(30, pierce=True, falloff="linear"), Spread(Disc(6), 9, 30), Disc(30, line_of_sight="all")]
RAYS = [Pistol(200), Laser(200, width=3), Rifle(200, budget=20), Spread(Laser(200), 9, 30), Sweep(Laser(90), 60, 9)]


@pytest.mark.parametrize("weapon", [*AREAS, *RAYS], ids=lambda weapon: weapon.text)
def test_answers_are_read_after_the_scene_changed(weapon: Any) -> None:
    told: Callable[[Any], list[Any]] = all_of_an_area if weapon in AREAS else all_of_a_ray
    scene, _ = squad()
    shots = {"at": [(45, 30), (5, 25), (100, 40)], "toward": [(60, 20), (90, 30), (0, 33)]}
    before, after = (fire(scene, weapon, **shots) for _ in range(2))
    truth = told(before)
    end_all(scene)
    assert len(before) and told(after) == truth and told(before) == truth


def test_passes_of_random_rays_are_read_after_the_scene_changed() -> None:
    for seed in range(30):
        battles = [many(random.Random(seed), 4) for _ in range(2)]
        (_, truth), (scene, hits) = ((fired_at.scene, fired_at) for fired_at in map(fired, battles))
        told = all_of_a_ray(truth)
        if len(scene):
            scene.set(scene.ids(), layer=3, cost=2, owner=0, velocity_xy=(1, 0))
            scene.remove(scene.ids()[::2])
        assert all_of_a_ray(hits) == told


def test_the_dead_are_removed_while_the_answer_is_walked() -> None:
    scene, (near, far) = squad()
    health = {near: 100, far: 100}
    for row in fire(scene, Disc(20), (40, 30)).by_owner():
        health[row.owner] -= row.pixels
        if health[row.owner] < 0:
            scene.remove(row.objects)
    assert health[near] < 0 < health[far] and len(scene) == 3


def test_bodies_by_hand() -> None:
    """Of two pellets on a torso and its head: the nearest pixel, and both pellets once."""
    scene, (body, _) = squad()
    hits = fire(scene, Spread(Disc(6), 2, 0), (30, 25))
    rows = {row.object: row for row in hits}
    head, torso = rows[body + 1], rows[body]
    assert (head.first_xy, head.distance2, torso.first_xy, torso.distance2) == ((30, 25), 0, (29, 25), 1)
    assert hits.by_owner() == [
        OwnerRow(0, body, head.samples + torso.samples, head.pixels + torso.pixels, head.weight + torso.weight, 2,
                 (30, 25), 0, (body + 1, body))
    ]  # fmt: skip


STALE_CALLS: dict[str, Callable[[RayHits], object]] = {
    "samples_at": lambda hits: hits.samples_at(),
    "pixels_at": lambda hits: hits.pixels_at(),
    "why_not": lambda hits: hits.why_not(),
    "blockers": lambda hits: hits.blockers(),
    "nearest_miss": lambda hits: hits.nearest_miss(),
    "margins": lambda hits: hits.margins(),
    "scene_of": lambda hits: hits.scene_of(0),
}


@pytest.mark.parametrize("call", STALE_CALLS.values(), ids=STALE_CALLS)
@pytest.mark.parametrize("prepared", [False, True])
def test_what_rays_need_of_the_scene_says_so_and_how_to_keep_it(
    call: Callable[[RayHits], object], prepared: bool
) -> None:
    scene, _ = squad()
    hits = prepare(scene, Pistol(200)).fire((5, 25)) if prepared else fire(scene, Pistol(200), (5, 25))
    kept, history = scene.copy(), History(scene)
    tick = history.record()
    end_all(scene)
    with pytest.raises(InputError, match=STALE):
        call(hits)
    for answer in (fire(kept, Pistol(200), (5, 25)), fire(history, Pistol(200), (5, 25), tick=tick)):
        assert answer == hits
        call(answer)


@pytest.mark.parametrize("weapon", [Spread(Disc(8), 5, 9), Spread(Laser(200), 5, 9)], ids=lambda weapon: weapon.text)
def test_bodies_of_several_ticks_have_the_owners_of_their_tick(weapon: Any) -> None:
    scene, (one, other) = squad()
    history = History(scene)
    history.record(0)
    scene.set(one + 1, owner=other)
    history.record(1)
    at, tick = [(30, 26)] * 4, [1, 0, 0, 1]
    hits = fire(history, weapon, at, toward=(30, 0), tick=tick, shot=5)
    alone = [fire(history.at(t), weapon, at[0], toward=(30, 0), shot=5).by_owner() for t in tick]
    end_all(scene)
    assert hits.by_owner() == [row._replace(shot=shot) for shot, rows in enumerate(alone) for row in rows]
    assert [len(rows) for rows in alone] == [2, 1, 1, 2]


def test_an_answer_keeps_no_more_of_a_scene_than_its_stack() -> None:
    """A copied answer and its copy tell the same; the columns of the stack are not those that the scene changes."""
    scene, _ = squad()
    hits = fire(scene, Disc(30), (40, 30))
    stack = scene.items.stack()
    columns = {name: np.copy(getattr(stack, name)) for name in ("ids", "owner", "categories", "box_xyxy", "offset")}
    masks = [stack.mask(rank).copy() for rank in range(len(stack))]
    end_all(scene)
    fire(scene, Disc(30), (40, 30))
    assert all(np.array_equal(getattr(stack, name), column) for name, column in columns.items())
    assert all(np.array_equal(stack.mask(rank), mask) for rank, mask in enumerate(masks))
    assert copy.copy(hits).by_owner() == hits.by_owner()
