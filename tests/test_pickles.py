"""Sprites, weapons of every kind, hits and histories are copied and pickled; the copies answer alike, elsewhere too."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from some_of import in_turn

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    History,
    Hits,
    InputError,
    Laser,
    Pistol,
    Point,
    Polygon,
    Projectile,
    RayHits,
    Rifle,
    Ring,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Sweep,
    fire,
    prepare,
)

AREAS: dict[str, Any] = {
    "point": Point(),
    "disc": Disc(6, falloff="smooth"),
    "ring": Ring(4, 9, pierce=True),
    "box": Box(9, 6),
    "polygon": Polygon([(-5, -5), (9, 0), (-5, 5)]),
    "cone": Cone(20, 40),
    "beam": Beam(30, 3),
    "stencil": Stencil(np.eye(9, dtype=np.bool_)),
    "spread": Spread(Disc(2), count=5, radius=12),
    "rounds": Rounds(Spread(Disc(2), count=3, radius=9), count=2, recoil_xy=(2, -1)),
}
RAYS: dict[str, Any] = {
    "pistol": Pistol(70),
    "rifle": Rifle(range=80, budget=20),
    "laser": Laser(90, falloff="linear"),
    "projectile": Projectile(60, radius=2),
    "pellets": Spread(Pistol(80), count=5, radius=20),
    "sweep": Sweep(Laser(50), 90, 7),
    "burst": Rounds(Pistol(70), count=3, recoil_xy=(0, 2)),
}
WEAPONS = AREAS | RAYS

WAYS: dict[str, Callable[[Any], Any]] = {
    "copy.copy": copy.copy,
    "copy.deepcopy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "twice": lambda value: pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(value)))),
}
AT = np.mgrid[3:90:17, 4:60:15].reshape(2, -1).T


def arena() -> Scene:
    scene = Scene((90, 60), name="arena")
    sheet = Sprite.from_images(
        [np.full((5, 9, 3), 90, np.uint8), np.full((7, 4, 3), 9, np.uint8)], frame_names=["a", "b"]
    )
    ids = [scene.add(sheet, (11 * k, 7 * k), frame=k % 2, angle=13 * k, layer=k % 2) for k in range(8)]
    scene.add(Sprite.circle(4), (44, 30), owner=ids[4])
    scene.add(Sprite.box(4, 30), (60, 30), role="occluder")
    scene.carve({ids[3]: [[33, 21], [34, 21]]})
    return scene


def told(hits: Hits, shots: int) -> Any:
    """Everything that an answer tells, as plain values."""
    parts: list[Any] = [[row._asdict() for row in hits], hits.verdicts.tolist(), hits.starts.tolist(), hits.by_owner()]
    for shot in range(shots):
        parts.append([column.tolist() for column in hits.samples_at(shot)])
        parts.append([hits.why_not(shot), hits.blockers(shot), hits.verdict_counts(shot)])
        parts.append({key: spans.runs().tolist() for key, spans in hits.pixels_at(shot).items()})
    if isinstance(hits, RayHits):
        parts += [hits.passes.to_rows(), hits.stop.to_rows(), hits.rays]
    else:
        parts.append(hits.shares())
    return parts, hits.plan, hits.to_dict()


@pytest.mark.parametrize(("name", "way"), in_turn(WEAPONS, WAYS))
def test_a_weapon_of_every_kind_is_copied(name: str, way: str) -> None:
    weapon, scene = WEAPONS[name], arena()
    fire(scene, weapon, AT, aim=20)  # what it keeps for later goes along, or is made again
    made = WAYS[way](weapon)
    assert type(made) is type(weapon) and made == weapon and made.to_json() == weapon.to_json()
    assert fire(scene, made, AT, aim=20, seed=4) == fire(scene, weapon, AT, aim=20, seed=4)


@pytest.mark.parametrize(("name", "way"), in_turn(WEAPONS, WAYS))
def test_hits_are_copied_and_tell_the_same(name: str, way: str) -> None:
    scene = arena()
    for strategy in ("direct", "built"):
        hits = fire(scene, WEAPONS[name], AT, aim=20, seed=4, strategy=strategy)
        assert hits
        made = WAYS[way](hits)
        assert made == hits and type(made) is type(hits) and made.weapon == hits.weapon and len(made) == len(hits)
        assert told(made, 6) == told(hits, 6)
        assert not made.object.flags.writeable and not made.verdicts.flags.writeable
        if isinstance(made, RayHits):
            assert not made.passes.entry_xy.flags.writeable and not made.stop.item.flags.writeable
        assert (made.scene is scene) == (way == "copy.copy")
        if made.scene is not scene:
            assert made.scene.carve(made) and hits.why_not(0) is not None


@pytest.mark.parametrize(("name", "way"), in_turn(["disc", "box", "spread", "pistol", "rifle"], WAYS))
def test_answers_of_prepared_weapons_become_plain_hits(name: str, way: str) -> None:
    scene = arena()
    ready, struck = prepare(scene, WEAPONS[name]), 0
    for at in AT.tolist():
        hits = ready.fire(tuple(at), 20.0)
        made = WAYS[way](hits)
        assert made == hits == fire(scene, WEAPONS[name], at, aim=20) and type(made) in (Hits, RayHits)
        assert told(made, 1)[0] == told(hits, 1)[0]
        struck += bool(made)
    assert struck


@pytest.mark.parametrize("weapon", [Disc(3), Pistol(70), Sweep(Laser(50), 90, 7)], ids=lambda weapon: weapon.kind)
@pytest.mark.parametrize("way", [pickle.dumps, copy.copy, copy.deepcopy], ids=lambda way: way.__name__)
def test_a_prepared_weapon_says_what_to_pickle_instead(weapon: Any, way: Callable[[Any], object]) -> None:
    ready = prepare(Scene((50, 50)), weapon)
    told = "^ready: a prepared weapon cannot be pickled or copied: pickle or copy its scene and its weapon instead, and"
    with pytest.raises(InputError, match=told):
        way(ready)


@pytest.mark.parametrize("way", ["copy.deepcopy", "pickle"])
@pytest.mark.parametrize("name", ["disc", "pistol"])
def test_a_copy_belongs_to_the_copy_of_its_scene(name: str, way: str) -> None:
    scene = arena()
    hits = fire(scene, WEAPONS[name], AT, aim=20)
    other, made = WAYS[way]((scene, hits))
    assert made.scene is other
    told = hits.why_not(0)
    scene.move(0, (1, 1))
    scene.remove(1)
    assert made.why_not(0) == told
    stale = WAYS[way](hits)
    assert stale == hits
    if name == "disc":  # what explains patterns stays
        assert stale.why_not(0) == told and stale.shares() == made.shares() and stale.by_owner() == made.by_owner()
    else:
        for answer in (hits, stale):
            with pytest.raises(InputError, match="read this before the scene changes"):
                answer.why_not(0)
    other.move(0, (1, 1))
    if name == "disc":
        assert made.why_not(0) == told
    else:
        with pytest.raises(InputError, match="read this before the scene changes"):
            made.why_not(0)


def past() -> History:
    scene = arena()
    history = History(scene, ticks=6, interpolate=True)
    for tick in range(9):
        history.record(3 * tick)
        if tick == 5:
            scene.set(2, angle=80)
            scene.carve(fire(scene, Disc(4), (44, 28)))
        if tick != 3:
            scene.move(list(scene), scene.position(list(scene)) + np.array([1, 0.5]))
    return history


@pytest.mark.parametrize(("way", "name"), in_turn(WAYS, ["disc", "spread", "pistol"]))
def test_hits_at_a_history_are_copied(name: str, way: str) -> None:
    history = past()
    ticks = np.linspace(9, 24, len(AT))
    for tick in (12, ticks):
        hits = fire(history, WEAPONS[name], AT, aim=20, tick=tick)
        made = WAYS[way](hits)
        assert made == hits and told(made, len(AT)) == told(hits, len(AT))
        if way != "copy.copy":
            made.scene_of(0).move(0, (0, 0))  # a copy of the past is a scene that can be changed
            if isinstance(tick, int) and name != "pistol":  # what explains patterns at one scene stays
                assert made.why_not(0) == hits.why_not(0)
                continue
            with pytest.raises(InputError, match="read this before the scene changes"):
                made.why_not(0)


def at_all_ticks(history: History) -> list[Any]:
    ticks = [*history.ticks, history.ticks[0] + 0.5, history.ticks[1] + 1.25]
    return [
        [history.at(tick).content_hash(), [row._asdict() for row in fire(history, weapon, AT, aim=20, tick=tick)]]
        for tick in ticks
        for weapon in (Disc(6), Pistol(70))
    ]


@pytest.mark.parametrize("way", WAYS)
def test_a_history_is_copied_and_goes_on(way: str) -> None:
    history = past()
    expected = at_all_ticks(history)
    made = WAYS[way](history)
    assert made.ticks == history.ticks and at_all_ticks(made) == expected
    assert (made.scene is history.scene) == (way == "copy.copy")
    for one in (made, history):
        one.record(30)
        one.record(31)
    assert at_all_ticks(made) == at_all_ticks(history) != expected
    if way != "copy.copy":
        made.scene.move(0, (2, 2))
        made.record(40)
        assert made.at(40).position(0).tolist() == [2, 2] and history.scene.position(0).tolist() != [2, 2]
    first, second = (made._moments[tick].snapshot for tick in (30, 31))
    assert first is second or first.columns["layer"] is second.columns["layer"]  # equal columns are stored once


def test_moments_of_a_pickled_history_share_what_did_not_change() -> None:
    scene = Scene()
    scene.add(np.ones((300, 300), np.bool_), (0, 0))
    history = History(scene, ticks=64)
    for tick in range(64):
        scene.move(0, (tick, 0))
        history.record()
    text = pickle.dumps(history)
    assert len(text) < 2 * 300 * 300 + 64 * 3000
    made = pickle.loads(text)
    assert len({id(moment.snapshot.atlas.flat) for moment in made._moments.values()}) == 1


@pytest.mark.parametrize("way", ["copy.deepcopy", "pickle"])
def test_a_sprite_is_copied_with_its_frames_names_and_holes(way: str) -> None:
    scene = arena()
    sprite = scene.sprite(3)
    made = WAYS[way](sprite)
    assert made.uid != sprite.uid and made.frame_names == ("a", "b") and sprite.carvings
    assert not made.carvings[1].gone.flags.writeable and not made.frames[0].mask.flags.writeable
    before = scene.content_hash()
    scene.set(3, sprite=made)
    assert scene.content_hash() == before


def answer(weapon: Any, hits: Any, history: Any, sprite: Any) -> Any:
    """What another process makes of pickles; it has a scene of its own first, so that numbers of sprites differ."""
    own = Scene((90, 60))
    own.add(sprite, (30, 30))
    return (
        [row._asdict() for row in fire(own, weapon, AT, aim=20, seed=4)], told(hits, 3), hits, at_all_ticks(history),
    )  # fmt: skip


def test_everything_goes_to_another_process_and_comes_back() -> None:
    scene, history = arena(), past()
    cases = []
    for weapon in WEAPONS.values():
        hits = fire(scene, weapon, AT, aim=20, seed=4)
        cases.append((weapon, hits, history, scene.sprite(3)))
    cases.append((Disc(6), fire(history, Disc(6), AT, tick=np.linspace(9, 24, len(AT))), history, scene.sprite(3)))
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        answers = pool.starmap(answer, cases)
    for (weapon, hits, *rest), (rows, theirs, back, ticks) in zip(cases, answers, strict=True):
        assert rows == answer(weapon, hits, *rest)[0] and back == hits
        assert theirs == told(hits, 3) and ticks == at_all_ticks(history)
