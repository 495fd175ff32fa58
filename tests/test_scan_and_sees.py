"""One place and many aims, lines of sight, and scans."""

from __future__ import annotations

import json
import math
import random
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ray_battles import Battle, Close, Gun, Place, Shot, pair, some_body, some_place, some_target

from hitplanes import (
    ALL,
    Beam,
    Cone,
    Disc,
    History,
    InputError,
    Laser,
    Pistol,
    Reason,
    Rounds,
    Scene,
    ShotRecord,
    Spread,
    Sweep,
    Weapon,
    fire,
    prepare,
    replay,
    report_of,
    scan,
    sees,
)
from hitplanes.weapons.fire.strategy import chosen_ray_way
from hitplanes.weapons.rays import one_ray, ray_call, sight

WEAPONS: dict[str, Weapon] = {
    "disc": Disc(30),
    "cone": Cone(40, 30),
    "pellets": Spread(Disc(4), count=8, radius=30),
    "beams": Rounds(Beam(50, 3), count=2, recoil_deg=5),
    "pistol": Pistol(60),
    "line of sight": Pistol(None),
    "fan": Sweep(Pistol(60), 40, 5),
}
HERE = (20.25, 30.5)
TARGETS = [(60, 31), (44, 8), (20, 55), (21, 30)]
AIMS = [0.0, -45.0, 90.0, 17.5]


def yard() -> Scene:
    """Three objects and a wall about a place."""
    scene = Scene((80, 60))
    for xy in [(50, 30), (40, 12), (24, 50)]:
        scene.add(np.ones((9, 9), np.bool_), xy)
    scene.add(np.ones((20, 3), np.bool_), (40, 34), role="occluder")
    return scene


# One place, many aims


@pytest.mark.parametrize("name", WEAPONS)
def test_one_place_is_that_of_every_target(name: str) -> None:
    scene, weapon = yard(), WEAPONS[name]
    expected = fire(scene, weapon, [HERE] * 4, toward=TARGETS, seed=3)
    found = fire(scene, weapon, HERE, toward=TARGETS, seed=3)
    assert len(found.shots) == 4 and found == expected and len(found)
    assert np.array_equal(found.verdicts, expected.verdicts)
    assert fire(scene, weapon, np.array(HERE), toward=np.array(TARGETS[:1]), seed=3).of(0) == expected.of(0)
    assert len(fire(scene, weapon, HERE, toward=np.zeros((0, 2))).shots) == 0


@pytest.mark.parametrize("name", [name for name in WEAPONS if name != "line of sight"])
def test_one_place_is_that_of_every_aim(name: str) -> None:
    scene, weapon = yard(), WEAPONS[name]
    expected = fire(scene, weapon, [HERE] * 4, aim=AIMS, seed=3)
    assert fire(scene, weapon, HERE, aim=AIMS, seed=3) == expected
    assert fire(scene, weapon, HERE, aim=np.array(AIMS), seed=3) == expected


def test_many_places_have_one_target() -> None:
    scene, places = yard(), [HERE, (5, 5), (70, 50)]
    for weapon in WEAPONS.values():
        assert fire(scene, weapon, places, toward=(44, 30)) == fire(scene, weapon, places, toward=[(44, 30)] * 3)


def test_filters_and_ticks_are_those_of_each_aim() -> None:
    scene = yard()
    many = [HERE] * 4
    for how in ({"accept": [1, 0, 1, 0]}, {"exclude": [0, 1, -1, 2]}, {"exclude": [[0, 1]]}, {"shot": [4, 3, 2, 1]}):
        assert fire(scene, Disc(30), HERE, aim=AIMS, **how) == fire(scene, Disc(30), many, aim=AIMS, **how)
    history = History(scene, ticks=4)
    for tick in range(3):
        history.record(tick)
        scene.move(0, (50 + tick, 30))
    ticks = [2, 0, 1, 2]
    found = fire(history, Pistol(60), HERE, toward=TARGETS, tick=ticks)
    assert found == fire(history, Pistol(60), many, toward=TARGETS, tick=ticks)


def test_a_prepared_weapon_a_record_and_a_report_have_a_shot_for_each_aim(tmp_path: Path) -> None:
    scene = yard()
    for weapon in (Pistol(60), Cone(40, 30)):
        expected = fire(scene, weapon, [HERE] * 4, toward=TARGETS, exclude=[[1, 3]])
        assert prepare(scene, weapon, exclude=[1, 3]).fire(HERE, toward=TARGETS) == expected
        file = tmp_path / f"{weapon.kind}.jsonl"
        with ShotRecord(file) as record:
            assert record.fire(scene, weapon, HERE, toward=TARGETS, exclude=[[1, 3]]) == expected
        lines = [json.loads(line) for line in file.read_text().splitlines()[1:-1]]
        assert [line["at"] for line in lines] == [list(HERE)] * 4 and [line["shot"] for line in lines] == [0, 1, 2, 3]
        assert replay(file, scene) is None
        found = fire(scene, weapon, HERE, toward=TARGETS, exclude=[[1, 3]])
        told, shots = (report_of(scene, [hits])["shots"] for hits in (found, expected))
        assert [shot | {"plan": None} for shot in told] == [shot | {"plan": None} for shot in shots]


BAD: list[tuple[dict[str, Any], str]] = [
    ({"at": [HERE] * 2, "toward": TARGETS}, r"toward: expected shape .2, 2., as at has shape .2, 2., got \(4, 2\)$"),
    ({"at": [HERE] * 2, "aim": AIMS}, r"aim: expected shape \(2,\), as at has shape \(2, 2\), got \(4,\)$"),
    ({"at": [HERE], "aim": AIMS}, r"aim: expected shape \(1,\), as at has shape \(1, 2\), got \(4,\)$"),
    ({"at": HERE, "toward": [[(1, 2)]]}, r"toward: expected shape \(1, 2\), got \(1, 1, 2\)"),
    ({"at": HERE, "toward": [(1, 2, 3)] * 4}, r"toward: expected shape \(4, 2\), got \(4, 3\)"),
    ({"at": HERE, "toward": [(1, 2), HERE]}, r"toward\[1\]: expected a point other than the shot's own"),
    ({"at": HERE, "toward": TARGETS, "aim": AIMS}, r"aim: expected aim or toward, got both"),
    ({"at": HERE, "aim": [1, 2], "accept": [1, 2, 3]}, r"accept: expected shape \(2,\), got \(3,\)"),
    ({"at": HERE, "aim": [1, 2], "exclude": [1, 2, 3]}, r"exclude: expected an owner for each of 2 shots"),
]


@pytest.mark.parametrize(("how", "told"), BAD)
def test_places_and_aims_of_different_numbers_are_named(how: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=f"^{told}"):
        fire(yard(), Pistol(60), **how)


# Lines of sight and scans, beside the oracle


WAYS = ("auto", "walk", "cast", "march", "cast alone", "march alone")


def force(monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    """Answer by one way wherever it serves, together or one ray after another."""
    way, _, alone = way.partition(" ")
    for module in (ray_call, one_ray):
        monkeypatch.setattr(module, "chosen_ray_way", lambda _, *rest, **how: chosen_ray_way(way, *rest, **how))
    if way != "auto":
        monkeypatch.setattr(ray_call, "are_faster_alone", lambda *_: bool(alone))


@dataclass(frozen=True)
class World:
    """A small world, places, targets and angles, and the filters of each place."""

    battle: Battle
    places: list[Place]
    targets: list[Place]
    angles: list[float]
    range: float
    accept: list[int]
    blocked_by: list[int]
    exclude: list[int]

    @property
    def filters(self) -> dict[str, Any]:
        return {"accept": self.accept, "blocked_by": self.blocked_by, "exclude": self.exclude}

    def walked(self, gun: Gun, row: int, shots: list[Shot]) -> list[tuple[str, float]]:
        """How the oracle ends the rays of a place: why, and how far on."""
        filters = {"accept": self.accept[row], "blocked_by": self.blocked_by[row], "exclude": (self.exclude[row],)}
        battle = replace(self.battle, gun=gun, shots=[replace(shot, **filters) for shot in shots])
        ends = [(walk.stop.reason, walk.path.px(walk.stop.time)) for ((_, walk),) in battle.walks()]
        return ends

    def sees(self) -> list[list[bool]]:
        """Who sees whom, pair by pair."""
        table = []
        for row, eye in enumerate(self.places):
            apart = [target for target in self.targets if pair(target) != pair(eye)]
            ends = iter(self.walked(Gun("pistol", None), row, [Shot(eye, target) for target in apart]))
            table.append([pair(target) == pair(eye) or next(ends)[0] == "range" for target in self.targets])
        return table

    def scan(self) -> list[list[Any]]:
        """How far beams go, one by one."""
        gun, table = Gun("pistol", self.range), []
        for row, at in enumerate(self.places):
            ends = self.walked(gun, row, [Shot(at, aim=angle) for angle in self.angles])
            table.append([math.inf if reason == "range" else Close(px) for reason, px in ends])
        return table


def some_world(rng: random.Random) -> World:
    """A crowded little world; some targets are places, and some places lie on pixels."""
    bodies = [some_body(rng, number) for number in range(rng.choice([1, 3, 5, 8]))]
    places = [some_place(rng, bodies) for _ in range(rng.randint(1, 3))]
    targets = [some_target(rng, rng.choice(places), bodies) for _ in range(rng.randint(0, 4))]
    targets += rng.sample(places, rng.randint(0, len(places)))
    bounds = rng.choice([None, (0, 0, 11, 9), (2, 1, 7, 8), (-9, -9, 30, 30)])
    n = len(places)
    return World(
        Battle(Gun(), [], bodies, bounds), places, targets,
        [rng.choice([0, 90, 180, -90, 45, -135, rng.randint(-30, 30) * 12.5]) for _ in range(rng.randint(0, 5))],
        rng.choice([4, 7.25, 12, 0]), [rng.choice([0, 0, ALL, 1, 6]) for _ in range(n)],
        [rng.choice([ALL, ALL, ALL, 1, 6, 0]) for _ in range(n)],
        [rng.choice([-1, -1, rng.randrange(len(bodies))]) for _ in range(n)],
    )  # fmt: skip


def told(world: World, scene: Scene | None = None) -> tuple[np.ndarray, np.ndarray]:
    """What the library says."""
    scene, targets = scene or world.battle.scene(), np.reshape(world.targets, (-1, 2))
    seen = sees(scene, world.places, targets, **world.filters)
    found = scan(scene, world.places, world.angles, world.range, **world.filters)
    assert seen.dtype == np.bool_ and seen.shape == (len(world.places), len(targets))
    for row, place in enumerate(world.places):
        own = {name: values[row] for name, values in world.filters.items()}
        alone = [sees(scene, tuple(place), tuple(target), **own) for target in world.targets]
        assert np.array_equal(np.concatenate([*alone, np.zeros((0, 1))]).T, seen[row : row + 1])
    assert found.dtype == np.float64 and found.shape == (len(world.places), len(world.angles))
    return seen, found


def compare(worlds: int, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    force(monkeypatch, way)
    answers = set()
    for seed in range(worlds):
        world = some_world(random.Random(f"{seed} of {way}"))
        seen, found = told(world)
        assert seen.tolist() == world.sees(), seed
        assert world.scan() == found.tolist(), seed
        answers |= {str(one) for one in seen.reshape(-1)}
        answers |= {"inside" if px == 0 else "far" if px == math.inf else "met" for px in found.reshape(-1)}
        dx, dy = 10**9, -(10**9)
        there = replace(
            world, battle=world.battle.moved(dx, dy), places=[(x + dx, y + dy) for x, y in world.places],
            targets=[(x + dx, y + dy) for x, y in world.targets],
        )  # fmt: skip
        if there.battle.bounds is None or seed % 4 == 0:
            moved = told(there)
            assert np.array_equal(moved[0], seen) and np.array_equal(moved[1], found), seed
    assert answers == {"False", "True", "inside", "far", "met"}


@pytest.mark.parametrize("way", WAYS)
def test_lines_of_sight_and_beams_are_those_of_the_slow_walk(
    way: str, jit: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    compare(40, way, monkeypatch)


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS)
def test_many_lines_of_sight_are_those_of_the_slow_walk(way: str, jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    compare(1000, way, monkeypatch)


@pytest.mark.parametrize("at_once", [3, 2**14])
def test_beams_are_rays_of_a_pistol_and_sight_that_of_a_laser(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit by bit, for each way, and whatever the chunks."""
    monkeypatch.setattr(sight, "RAYS_AT_ONCE", at_once)
    scene, rng = yard(), np.random.default_rng(4)
    places, angles = rng.uniform(-5, 80, (7, 2)), rng.uniform(0, 360, 9)
    at, targets = np.repeat(places, 9, axis=0), rng.uniform(-5, 80, (9, 2))
    for way in WAYS:
        force(monkeypatch, way)
        stop = fire(scene, Pistol(40), at, aim=np.tile(angles, 7), exclude=1, strategy="walk").stop
        far = np.where(stop.reason == Reason.RANGE, np.inf, stop.distance).reshape(7, 9)
        assert np.array_equal(scan(scene, places, angles, 40, exclude=1), far)
        assert np.array_equal(scan(scene, places, np.tile(angles, (7, 1)), 40, exclude=1), far)
        own = angles + 40 * np.arange(7)[:, None]
        rows = [scan(scene, place, row, 40, exclude=[1])[0] for place, row in zip(places, own, strict=True)]
        assert np.array_equal(scan(scene, places, own, 40, exclude=1), rows) and not np.array_equal(rows, far)
        assert np.array_equal(scan(scene, places[2], angles, 40, exclude=[1]), far[2:3])
        clear = fire(scene, Laser(None), at, toward=np.tile(targets, (7, 1))).stop.reason == Reason.RANGE
        assert np.array_equal(sees(scene, places, targets), clear.reshape(7, 9))
        assert np.array_equal(sees(scene, places[2], targets), clear.reshape(7, 9)[2:3])
    assert len(np.unique(far)) > 7 and 0 < clear.sum() < 63


def test_few_rays_are_followed_one_after_another(jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of several views, or too many, are not; nor are any if one of them cannot be."""
    scene, alone = yard(), []
    chosen = one_ray.chosen_follower
    monkeypatch.setattr(one_ray, "chosen_follower", lambda *of, **how: alone.append(of) or chosen(*of, **how))
    for places, how, expected in (
        ([HERE], {}, 1), ([HERE] * 2, {}, 1), ([HERE] * 2, {"exclude": [0, 1]}, 0), ([HERE] * 99, {}, 0)
    ):  # fmt: skip
        alone.clear()
        truth = np.concatenate([sees(scene, [place], TARGETS[:1]) for place in places])
        alone.clear()
        assert np.array_equal(sees(scene, places, TARGETS[:1], **how), truth) and len(alone) == expected
    not_level = lambda *of, **how: (lambda *line: chosen(*of, **how)[0](*line) if line[3] else None, False)  # noqa: E731
    monkeypatch.setattr(one_ray, "chosen_follower", not_level)
    level = [(60, HERE[1]), (1, HERE[1])]
    assert sees(scene, HERE, level).tolist() == [[False, True]]


def test_who_sees_is_seen(jit: bool) -> None:
    scene, rng = yard(), np.random.default_rng(2)
    spots = np.concatenate([rng.uniform(0, 80, (30, 2)), rng.integers(0, 160, (30, 2)) / 2, [HERE, (40, 30)]])
    for how in ({}, {"accept": ALL}, {"blocked_by": []}, {"exclude": 3}):
        seen = sees(scene, spots, spots, **how)
        assert np.array_equal(seen, seen.T) and seen.diagonal().all()
        assert seen.all() == (how in ({"blocked_by": []}, {"exclude": 3}))


def test_whoever_stands_in_a_wall_sees_only_itself() -> None:
    scene = yard()  # the wall: x from 39 to 41, y from 24 to 43
    spots = [(40, 30), (41.5, 30), (41.75, 30), (60, 30)]
    assert sees(scene, spots, spots).tolist() == [
        [True, False, False, False],
        [False, True, False, False],
        [False, False, True, True],
        [False, False, True, True],
    ]
    assert scan(scene, spots[:2], [0, 180], 50).tolist() == [[0, 0], [0, 0]]
    assert scan(scene, (41.75, 30), [0, 180], 50).tolist() == [[3.75, 0.25]]
    assert scan(scene, (41.75, 30), [0, 180], 50, exclude=[0, 3]).tolist() == [[math.inf, math.inf]]
    assert scan(scene, (41.75, 30), [0, 180], 3.75, accept=[]).tolist() == [[math.inf, 0.25]]


@pytest.mark.parametrize("way", WAYS)
def test_walls_alone_block(way: str, jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without objects nothing is refused, as far as filters let it."""
    force(monkeypatch, way)
    scene = Scene((80, 60), categories=["wall", "glass"])
    for x, category in ((20, "wall"), (40, "glass")):
        scene.add(np.ones((60, 3), np.bool_), (x, 30), role="occluder", categories=[category])
    for accept in ([], "wall", ALL):
        targets = [(15, 40), (30, 20), (60, 45)]
        assert sees(scene, (5, 30), targets, accept=accept).tolist() == [[True, False, False]]
        assert sees(scene, (30, 30), targets, accept=accept, blocked_by="wall").tolist() == [[False, True, True]]
        assert sees(scene, (30, 30), targets, accept=accept, exclude=[0, 1]).tolist() == [[True, True, True]]
    with pytest.raises(InputError, match=r"^accept: .*hare"):
        sees(scene, (5, 30), (1, 2), accept="hare")


def test_no_eyes_no_targets_no_beams() -> None:
    scene, none = yard(), np.zeros((0, 2))
    history = History(scene, ticks=2)
    history.record(0)
    for where, how in ((scene, {}), (Scene(), {}), (history, {"tick": 0})):
        assert sees(where, HERE, none, **how).shape == (1, 0) and sees(where, none, TARGETS, **how).shape == (0, 4)
        assert sees(where, none, none, **how).shape == (0, 0) and sees(where, HERE, HERE, **how).tolist() == [[True]]
        assert scan(where, none, AIMS, 5, **how).shape == (0, 4) and scan(where, HERE, [], 5, **how).shape == (1, 0)
        assert scan(where, none, np.zeros((0, 3)), 5, **how).shape == (0, 3)


def test_past_ticks_are_seen_and_scanned() -> None:
    scene = yard()
    history = History(scene, ticks=4)
    for tick in range(3):
        history.record(tick)
        scene.move(3, (40 + 3 * tick, 34))
    eyes = [HERE, (39, 5), HERE, (60, 55)]
    ticks = [2, 0, 1, 2]
    seen, found = sees(history, eyes, TARGETS, tick=ticks), scan(history, eyes, AIMS, 70, tick=ticks)
    for row, (eye, tick) in enumerate(zip(eyes, ticks, strict=True)):
        assert np.array_equal(seen[row : row + 1], sees(history.at(tick), eye, TARGETS))
        assert np.array_equal(found[row : row + 1], scan(history.at(tick), eye, AIMS, 70))
        assert np.array_equal(found[row : row + 1], scan(history, eye, AIMS, 70, tick=tick))


def test_categories_have_names() -> None:
    scene = Scene((40, 20), categories=["glass", "wall"])
    for x, category in ((10, "glass"), (20, "wall")):
        scene.add(np.ones((20, 3), np.bool_), (x, 10), role="occluder", categories=[category])
    guard = scene.add(np.ones((4, 4), np.bool_), (5, 10), categories=["glass"])
    targets = [(7, 10), (15, 10), (30, 10)]
    assert sees(scene, (1, 10), targets).tolist() == [[True, False, False]]
    assert sees(scene, (1, 10), targets, blocked_by="wall").tolist() == [[True, True, False]]
    assert sees(scene, (1, 10), targets, blocked_by=["wall"], accept="glass").tolist() == [[False, False, False]]
    assert scan(scene, (1, 10), [0], 90, exclude=guard).tolist() == [[7.5]]
    assert scan(scene, (1, 10), [0], 90, exclude=guard, blocked_by="wall").tolist() == [[17.5]]


NONSENSE: list[tuple[Any, str]] = [
    (lambda s: sees(None, HERE, HERE), "scene: expected a Scene or a History, got NoneType"),  # type: ignore[arg-type]
    (lambda s: sees(s, (1, 2, 3), HERE), r"eyes: expected shape \(2,\) or \(any, 2\), got \(3,\)"),
    (lambda s: sees(s, [HERE, (math.nan, 2)], HERE), r"eyes\[1\]\[0\]: expected a finite number, got nan"),
    (lambda s: sees(s, HERE, "here"), r"targets: expected numbers, got 'here'"),
    (lambda s: sees(s, HERE, [(1, 2), (2, math.inf)]), r"targets\[1\]\[1\]: expected a finite number, got inf"),
    (
        lambda s: sees(s, [HERE, (0, 0)], [HERE, (2**20 + 1, 0)]),
        r"targets\[1\]: expected a point within 1048576 px of eyes\[1\], got one at \[1048577.0, 0.0\] of it",
    ),
    (lambda s: sees(s, HERE, HERE, tick=3), "tick: expected none, as a Scene has no past, got 3"),
    (lambda s: sees(History(s), HERE, HERE), "tick: expected one, or one for each shot"),
    (lambda s: sees(s, HERE, HERE, accept="hare"), "accept: .*got 'hare'"),
    (lambda s: sees(s, [HERE] * 2, HERE, blocked_by=[1, 2, 3]), r"blocked_by: expected shape \(2,\), got \(3,\)"),
    (lambda s: scan(s, [HERE] * 2, AIMS, 5, exclude=[1, 2, 3]), r"exclude: expected an owner for each of 2 shots"),
    (lambda s: scan(s, "x", AIMS, 5), "at: expected numbers, got 'x'"),
    (lambda s: scan(s, HERE, 3, 5), r"angles: expected a list of them, one for each beam, got 3"),
    (lambda s: scan(s, [HERE] * 2, [AIMS] * 3, 5), r"angles: expected shape \(2, any\), got \(3, 4\)"),
    (lambda s: scan(s, HERE, [0, math.nan], 5), r"angles\[1\]: expected a finite number, got nan"),
    (lambda s: scan(s, HERE, AIMS, None), "range: expected a number, got None"),
    (lambda s: scan(s, HERE, AIMS, -1), "range: expected a number from 0 to 1048576, got -1"),
    (lambda s: scan(s, HERE, AIMS, 2**20 + 1), "range: expected a number from 0 to 1048576, got 1048577"),
]


@pytest.mark.parametrize(("call", "said"), NONSENSE)
def test_nonsense_is_named(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        call(yard())
    scene = yard()
    for _ in range(2):  # so that a ray is ready
        sees(scene, HERE, TARGETS[0])
    with pytest.raises(InputError, match=f"^{said}"):
        call(scene)


def test_a_pair_is_seen_as_it_is_now(jit: bool) -> None:
    """One pair a call, while objects move, come and go; numbers of any type."""
    scene, wall = yard(), 3
    for step in range(12):
        if step < 8:
            scene.move(wall, (40, 34 + 3 * step))
        elif step == 8:
            scene.remove(wall)
        for eye, target in (
            (HERE, (60, 31)),
            (np.float32(HERE), [60, 31]),
            ((20, np.float64(30.5)), np.array([60, 31])),
        ):
            seen = sees(scene, eye, target)
            assert seen.dtype == np.bool_ and seen.tolist() == sees(scene, [eye], [target]).tolist() == [[step > 2]]
        assert sees(scene, HERE, (60, 31), accept=ALL).tolist() == sees(scene, [HERE], [(60, 31)], accept=ALL).tolist()
        assert sees(scene, HERE, HERE).tolist() == sees(scene, (40, 34), (40, 34)).tolist() == [[True]]
