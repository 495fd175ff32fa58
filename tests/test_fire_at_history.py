"""Shots fired at the past of a scene: each as if it were fired alone at its tick, whatever has happened since."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from some_of import some_of
from test_fire import square

from hitplanes import (
    Beam,
    Disc,
    History,
    Hits,
    InputError,
    Laser,
    Pistol,
    Point,
    Projectile,
    RayHits,
    Rifle,
    Rounds,
    Scene,
    ShotRecord,
    Spread,
    Sprite,
    Sweep,
    Weapon,
    fire,
    replay,
)
from hitplanes.weapons.fire.hits import HitRow

PATTERNS: list[Weapon] = [
    Point(),
    Disc(12, falloff="linear"),
    Beam(90, 5, pierce=True),
    Spread(Disc(3), 7, 20),
    Rounds(Spread(Point(), 4, 9), 3, (2, 1), 15),
]
RAYS: list[Weapon] = [
    Pistol(120),
    Rifle(120, max_hits=2, falloff="smooth"),
    Rifle(150, budget=12.5, width=4),
    Laser(150, width=3, inside="ignore_until_exit"),
    Projectile(80, 2),
    Projectile(80, 2, steps=5),
    Sweep(Laser(90), 60, 4),
    Spread(Pistol(90), 5, 25),
    Rounds(Rifle(100, max_hits=1), 2, (1, 0), 8),
]
SIGHT: list[Weapon] = [Laser(None), Spread(Pistol(None), 3, 6)]
ROUNDS = 6


def moving(seed: int = 0, interpolate: bool = False, ticks: int = 64) -> tuple[Scene, History]:
    """A crowd that moves, turns, comes, goes, and changes sides, recorded at some ticks."""
    rng = random.Random(seed)
    scene = Scene((160, 120), categories=["red", "blue"])
    masks = [np.random.default_rng(seed + i).random((7 + 3 * i, 9 + i)) < 0.8 for i in range(3)]
    sprites = [Sprite.from_mask(mask) for mask in masks]

    def come() -> int:
        return scene.add(
            rng.choice(sprites), (rng.uniform(0, 160), rng.uniform(0, 120)), angle=rng.uniform(0, 360),
            role="occluder" if rng.random() < 0.2 else "hittable", layer=rng.randint(-1, 1), cost=rng.randint(0, 3),
            categories=[rng.choice(["red", "blue"])], velocity_xy=(rng.uniform(-9, 9), rng.uniform(-9, 9)),
        )  # fmt: skip

    for _ in range(16):
        come()
    history = History(scene, ticks, interpolate)
    for step in range(ROUNDS):
        history.record(10 * step)
        ids = scene.ids().tolist()
        some = rng.sample(ids, 8)
        scene.set(some, position_xy=[(rng.uniform(0, 160), rng.uniform(0, 120)) for _ in some])
        scene.set(some[:3], angle=[rng.uniform(0, 360) for _ in range(3)])
        scene.set(some[3:5], categories=["red"], cost=2, velocity_xy=(4, -2), layer=2)
        scene.remove(some[7])
        come()
    return scene, history


def volley(weapon: Weapon, n: int, rng: random.Random) -> dict[str, Any]:
    """Arguments of a batch, each of them one for each shot."""
    shots: dict[str, Any] = {
        "at": [(round(rng.uniform(0, 160), 2), round(rng.uniform(0, 120), 2)) for _ in range(n)],
        "accept": [rng.choice([7, 7, 2, 4]) for _ in range(n)],
        "exclude": [[rng.randint(-1, 15), rng.randint(-1, 15)] for _ in range(n)],
        "seed": [rng.getrandbits(63) for _ in range(n)],
        "shot": [rng.getrandbits(60) for _ in range(n)],
    }
    if weapon in SIGHT or rng.random() < 0.3:
        shots["toward"] = [(x + rng.choice([-50, 30]), rng.uniform(0, 120)) for x, _ in shots["at"]]
    else:
        shots["aim"] = [rng.uniform(0, 360) for _ in range(n)]
    return shots


def rows_of(hits: Hits, shot: int) -> list[tuple[Any, ...]]:
    return [tuple(row)[1:] for row in hits.of(shot)]


def columns_of(columns: Any, first_row: int = 0) -> list[dict[str, Any]]:
    """Passes or stops, without the number of their shot, and with rows counted from the shot's first."""
    rows = columns.to_rows()
    for row in rows:
        del row["shot"]
        if "row" in row:
            row["row"] -= first_row
    return rows


def derived(hits: Hits, shot: int) -> list[Any]:
    """All that may be asked about one shot."""
    samples = [column.tolist() for column in hits.samples_at(shot)]
    pixels = {key: spans.pixels().tolist() for key, spans in hits.pixels_at(shot).items()}
    told = [samples, pixels, hits.verdict_counts(shot), hits.why_not(shot), hits.blockers(shot)]
    told.append([margin[1:] for margin in hits.margins(shot)] if hits.has_margins else None)
    return [*told, hits.nearest_miss(shot) if isinstance(hits, RayHits) else hits.shares(shot)]


def same_as_alone(history: History, weapon: Weapon, shots: dict[str, Any], ticks: list[float]) -> Hits:
    """Each shot of a batch at mixed ticks is that shot fired alone at the scene of its tick."""
    hits = fire(history, weapon, tick=ticks, **shots)
    bodies, shares = [], []
    for shot, tick in enumerate(ticks):
        mine = {name: value[shot : shot + 1] for name, value in shots.items()}
        alone = fire(history.at(tick), weapon, **mine)
        first = int(hits.starts[shot])
        assert rows_of(hits, shot) == rows_of(alone, 0), (shot, tick)
        assert derived(hits, shot) == derived(alone, 0), (shot, tick)
        assert hits.scene_of(shot) is history.at(tick) and hits.fired[shot] == alone.fired[0]
        if isinstance(hits, RayHits):
            assert isinstance(alone, RayHits)
            assert columns_of(hits.passes_at(shot), first) == columns_of(alone.passes)
            assert columns_of(hits.stops_at(shot)) == columns_of(alone.stop)
        else:
            shares += alone.shares()
        bodies += [row._replace(shot=shot) for row in alone.by_owner()]
    assert hits.by_owner() == bodies
    assert hits.shot.tolist() == sorted(hits.shot.tolist()) and len(hits.shots) == len(ticks)
    if isinstance(hits, RayHits):
        assert hits.passes.shot.tolist() == sorted(hits.passes.shot.tolist())
        assert hits.passes.row.tolist() == [
            next(i for i, r in enumerate(hits) if (r.shot, r.round, r.object) == (p["shot"], p["round"], p["object"]))
            for p in hits.passes.to_rows()
        ]
    else:
        assert hits.shares() == shares
    return hits


# The same as alone


@pytest.mark.parametrize("interpolate", [False, True])
@pytest.mark.parametrize("weapon", some_of([*PATTERNS, *RAYS, *SIGHT], 2), ids=lambda w: f"{w.to_json()}"[:60])
def test_each_shot_is_fired_at_its_tick(weapon: Weapon, interpolate: bool) -> None:
    _, history = moving(3, interpolate)
    rng = random.Random(7)
    hit = 0
    for n in (1, 40 if weapon == Point() else 9 if weapon in PATTERNS else 6):
        choices = [0, 10, 25.5, 31.25, 49 + 1 / 256] if interpolate else history.ticks
        hit += len(same_as_alone(history, weapon, volley(weapon, n, rng), [rng.choice(choices) for _ in range(n)]))
    assert hit


@examples(17, deadline=None)
@given(st.randoms(use_true_random=False))
def test_any_batch_at_any_ticks(rng: random.Random) -> None:
    interpolate = rng.random() < 0.5
    _, history = moving(rng.randrange(50), interpolate)
    weapon = rng.choice([*PATTERNS, *RAYS, *SIGHT])
    n = rng.randint(1, 6)
    ticks = [rng.uniform(0, 50) if interpolate and rng.random() < 0.5 else rng.choice(history.ticks) for _ in range(n)]
    same_as_alone(history, weapon, volley(weapon, n, rng), ticks)


def test_one_tick_for_all_is_the_scene_of_that_tick() -> None:
    _, history = moving(1)
    for weapon in (*PATTERNS, *RAYS):
        shots = volley(weapon, 5, random.Random(2))
        past = fire(history.at(20), weapon, **shots)
        for tick in (20, 20.0, [20] * 5, np.full(5, 20)):
            hits = fire(history, weapon, tick=tick, **shots)
            assert hits == past and type(hits) is type(past) and hits.to_dict()["rows"] == past.to_dict()["rows"]
        one = {name: value[0] for name, value in shots.items()}
        assert fire(history, weapon, tick=20, **one).of(0) == fire(history.at(20), weapon, **one).of(0)


def test_equal_hits_at_mixed_ticks_are_equal() -> None:
    _, history = moving(1)
    for weapon in (Disc(20), Laser(150)):
        shots = volley(weapon, 8, random.Random(2))
        hits = fire(history, weapon, tick=[0, 20, 0, 40] * 2, **shots)
        assert hits == fire(history, weapon, tick=[0, 20, 0, 40] * 2, **shots)
        assert hits != fire(history, weapon, tick=[20, 0, 40, 50] * 2, **shots)
        assert json.loads(json.dumps(hits.to_dict()))["rows"] == [
            {**row._asdict(), "first_xy": list(row.first_xy)} for row in hits
        ]
        columns = [*(getattr(hits, name) for name in (*HitRow._fields, "verdicts", "starts", "fired"))]
        assert not any(column.flags.writeable for column in columns)


@pytest.mark.parametrize("weapon", [Disc(9), Pistol(30)])
def test_no_shots_at_all(weapon: Weapon) -> None:
    scene, history = moving()
    none = np.zeros((0, 2))
    for tick in (20, [], np.zeros(0)):
        hits = fire(history, weapon, none, tick=tick)
        assert (
            not hits
            and len(hits.shots) == 0
            and hits.verdicts.shape[0] == 0
            and type(hits) is type(fire(scene, weapon, none))
        )
    assert not fire(History(scene), weapon, none, tick=[])


def test_options_go_along() -> None:
    _, history = moving(2)
    shots = volley(Disc(15), 6, random.Random(1))
    ticks = [0, 10, 0, 30, 10, 50]
    first = fire(history, Disc(15), tick=ticks, **shots)
    for options in ({"strategy": "built"}, {"prefilter": "circle", "broadphase": "bvh"}, {"prefilter": "none"}):
        hits = fire(history, Disc(15), tick=ticks, **shots, **options)  # type: ignore[arg-type]
        assert hits == first
        ran = [stage.name for stage in hits.plan.ran]
        assert ("visible set" in ran) == (options == {"strategy": "built"})
    with pytest.raises(InputError, match="prefilter: expected one of"):
        fire(history, Disc(15), tick=ticks, **shots, prefilter="sphere")


# The present is left alone


def test_the_present_scene_is_not_touched(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, history = moving(4)
    before = scene.version, scene.content_hash()
    monkeypatch.setattr(scene.derived, "index", lambda structure: pytest.fail("an index of the present"))
    monkeypatch.setattr(scene.derived, "label_plane", lambda *_: pytest.fail("a plane of the present"))
    monkeypatch.setattr(scene.items, "stack", lambda: pytest.fail("a stack of the present"))
    for weapon in (*PATTERNS, *RAYS):
        for strategy in ("auto", "direct", "walk"):
            shots = volley(weapon, 40, random.Random(2))
            fire(
                history,
                weapon,
                tick=[random.Random(3).choice(history.ticks) for _ in range(40)],
                **shots,
                strategy=strategy,
            )
    fire(history, Disc(30), [(50, 50)] * 40, tick=[20] * 40, broadphase="bvh")
    fire(history, Disc(30), [(50, 50)] * 40, tick=[20] * 40, strategy="built")
    assert not scene.derived._planes.values and scene.derived._indexes == {}
    monkeypatch.undo()
    assert before == (scene.version, scene.content_hash())


def test_answers_stay_right_when_their_tick_has_left_and_the_scene_has_changed() -> None:
    scene, history = moving(5, ticks=ROUNDS)
    for weapon in (Disc(20), Beam(90, 5), Laser(150), Rifle(120, max_hits=2)):
        shots = volley(weapon, 4, random.Random(8))
        ticks = history.ticks[:4]
        kept, other = (fire(history, weapon, tick=ticks, **shots) for _ in range(2))
        told = [derived(kept, shot) for shot in range(4)], kept.verdict_counts(), kept.by_owner()
        scene.set(scene.ids(), position_xy=(-500, -500))
        last = history.ticks[-1]
        for tick in range(last + 1, last + 1 + ROUNDS):
            history.record(tick)
        assert not set(ticks) & set(history.ticks)
        assert ([derived(other, shot) for shot in range(4)], other.verdict_counts(), other.by_owner()) == told


# Errors


NONE_YET = History(Scene())
ERRORS: dict[str, tuple[Callable[[Scene, History], object], str]] = {
    "no tick": (lambda s, h: fire(h, Point(), (1, 1)), "tick: expected one, or one for each shot, as it is a History"),
    "left the ring": (lambda s, h: fire(h, Point(), (1, 1), tick=0), r"tick: expected one of 30, 40, 50, got 0"),
    "not yet": (lambda s, h: fire(h, Point(), [(1, 1)] * 2, tick=[30, 60]), r"tick\[1\]: expected one of 30, 40, 50"),
    "between": (lambda s, h: fire(h, Point(), (1, 1), tick=35), "tick: expected one of 30, 40, 50, got 35"),
    "none recorded": (lambda s, h: fire(NONE_YET, Point(), (1, 1), tick=0), "tick: expected one that is recorded, got"),
    "too many": (lambda s, h: fire(h, Point(), [(1, 1)] * 2, tick=[30] * 3), r"tick: expected shape \(2,\), got \(3"),
    "too few": (lambda s, h: fire(h, Point(), [(1, 1)] * 2, tick=[30]), r"tick: expected shape \(2,\), got \(1,\)"),
    "list of lists": (lambda s, h: fire(h, Point(), (1, 1), tick=[[30]]), r"tick: expected shape \(1,\), got \(1, 1\)"),
    "nan": (lambda s, h: fire(h, Point(), [(1, 1)] * 2, tick=[30, np.nan]), r"tick\[1\]: expected a finite number"),
    "word": (lambda s, h: fire(h, Point(), (1, 1), tick="now"), r"tick: expected a number, got 'now'"),
    "true": (lambda s, h: fire(h, Point(), (1, 1), tick=True), "tick: expected a number, got True"),
    "of a Scene": (lambda s, h: fire(s, Point(), (1, 1), tick=3), "tick: expected none, as a Scene has no past, got 3"),
    "of a moment": (lambda s, h: fire(h.at(30), Point(), (1, 1), tick=30), "tick: expected none, as a Scene has"),
    "no scene": (lambda s, h: fire(h.ticks, Point(), (1, 1)), "scene: expected a Scene or a History, got list"),  # type: ignore[arg-type]
    "a bad shot": (lambda s, h: fire(h, Point(), [(1, 1), (1, np.inf)], tick=30), r"at\[1\]\[1\]: expected a finite"),
    "an unknown strategy of a ray": (
        lambda s, h: fire(h, Pistol(9, width=2), (1, 1), tick=30, strategy="wlak"), "strategy: .*got 'wlak'"),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_bad_ticks_are_named(name: str) -> None:
    call, told = ERRORS[name]
    scene, history = moving(0, ticks=3)
    with pytest.raises(InputError, match=f"^{told}"):
        call(scene, history)


@pytest.mark.parametrize("bad", [0, 3, 5])
def test_a_bad_shot_is_named_by_its_place_in_the_call(bad: int) -> None:
    scene = Scene()
    scene.add(np.ones((9, 9), bool), (50, 50))
    history = History(scene)
    history.record()
    scene.move(0, (10, 10))
    history.record()
    at = [(90.0, 90.0)] * 6
    at[bad] = (10.0, 10.0)
    ticks = [0, 1, 0, 1, 1, 0]
    ticks[bad] = 1
    with pytest.raises(
        InputError, match=rf"^at\[{bad}\]: expected a start outside of every item, got one inside of id 0"
    ):
        fire(history, Laser(20, inside="error"), at, tick=ticks)
    ticks[bad] = 0
    assert not fire(history, Laser(20, inside="error"), at, tick=ticks)


# Records, and rates


def test_records_made_at_ticks_replay_at_them(tmp_path: Path) -> None:
    path = tmp_path / "match.jsonl"
    scene, history = moving(6, interpolate=True)
    with ShotRecord(path) as record:
        for weapon in (*PATTERNS, *RAYS, *SIGHT):
            record.fire(history, weapon, tick=[0, 33.5, 10, 33.5, 50], **volley(weapon, 5, random.Random(1)))
    scene.set(scene.ids(), position_xy=(9, 9))
    assert replay(path, history) is None
    again = moving(6, interpolate=True)[1]
    assert replay(path, again) is None
    other = moving(7, interpolate=True)[1]
    assert (found := replay(path, other)) is not None and found.told[0].startswith("scene: its content hash is ")


def recorded(every: int) -> History:
    """One motion of 24 steps, recorded at every so many of them."""
    scene = Scene((200, 80))
    for i in range(6):
        scene.add(square(8), (20 * i, 40), owner=None)
    history = History(scene, interpolate=every > 1)
    for step in range(25):
        ids = scene.ids().tolist()
        scene.set(
            ids, position_xy=[(20 * i + 3.7 * step + i * step / 7, 40 + (-1) ** i * step) for i in ids],
            angle=[step * (5 - 2 * i) for i in ids],
        )  # fmt: skip
        if step == 9:
            scene.remove(2)
        if step % every == 0:
            history.record(step)
    return history


@pytest.mark.parametrize("rates", [(3, 12), pytest.param((2, 3, 6, 12), marks=pytest.mark.long)], ids=str)
def test_the_rate_at_which_it_is_recorded_changes_no_row(rates: tuple[int, ...]) -> None:
    dense = recorded(1)
    for every in rates:
        sparse = recorded(every)
        ticks = [step for step in range(25) if step % every == 0]
        assert sparse.ticks == ticks
        for weapon in (*PATTERNS, *RAYS):
            shots = volley(weapon, len(ticks), random.Random(every))
            shots["accept"] = [1] * len(ticks)
            shots["exclude"] = [[owner if owner < 6 else -1 for owner in owners] for owners in shots["exclude"]]
            found, truth = (fire(history, weapon, tick=ticks, **shots) for history in (sparse, dense))
            assert found == truth
            alone = [
                fire(dense.at(tick), weapon, **{k: v[i : i + 1] for k, v in shots.items()})
                for i, tick in enumerate(ticks)
            ]
            assert [rows_of(found, i) for i in range(len(ticks))] == [rows_of(one, 0) for one in alone]


@pytest.mark.parametrize("far", [10**9, -(10**9), 2**39])
def test_a_past_far_from_the_origin_is_the_same_past(far: int) -> None:
    """Moving the world and the shots by whole pixels changes no row, also between two ticks."""

    def moved(by: int) -> History:
        scene = Scene()
        items = [scene.add(Sprite.circle(9), (by + 40 * i, 60 - by)) for i in range(6)]
        scene.add(Sprite.box(9, 41), (by + 150, 60 - by), role="occluder")
        history = History(scene, interpolate=True)
        for tick in range(12):
            scene.move(items, [(by + 40 * i + 3.25 * tick, 60 - by + tick * i % 7) for i in range(6)])
            history.record(tick)
        return history

    at, ticks = np.array([(0.5, 61.25), (300, 40), (100, 10)]), [2, 5.5, 11]
    near, away, shift = moved(0), moved(far), np.array([far, -far])
    for weapon in (Pistol(400), Rifle(400, budget=30), Laser(400, width=5), Disc(30), Projectile(350, 2)):
        here = fire(near, weapon, at, aim=[3, 170, 80], tick=ticks)
        there = fire(away, weapon, at + shift, aim=[3, 170, 80], tick=ticks)
        assert [row[:7] for row in here] == [row[:7] for row in there] and len(here)
        assert (here.first_xy + shift == there.first_xy).all()
