"""The past of a scene: at each recorded tick it answers as the scene did, whatever happens to that later."""

from __future__ import annotations

import copy
import gc
import pickle
import random
import threading
import weakref
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import hypothesis.strategies as st
import numpy as np
import pytest
from examples import examples
from hypothesis import Phase, given, settings
from hypothesis.stateful import initialize, precondition, rule, run_state_machine_as_test
from test_fire import some_volley, some_weapon, square
from test_fire_stateful import ORIGIN_XY, QUIET, SIZE_WH, ChangingScene, Model, places

from hitplanes import (
    Beam,
    Disc,
    History,
    InputError,
    PastScene,
    Pistol,
    Point,
    Rounds,
    Scene,
    Spread,
    Sprite,
    fire,
    load_scene,
    picture_of_report,
    report_of,
)
from hitplanes.planes.grid.fixed_point import snap
from hitplanes.planes.scene import history as history_module
from hitplanes.planes.scene import items as items_module
from hitplanes.planes.scene import variants as variants_module
from hitplanes.planes.scene.items import COLUMNS, Items, Stack
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.render import draw_view
from hitplanes.planes.volumes.volumes import Circles

ROOT = Path(__file__).parents[1]
WEAPONS = (Point(), Disc(9), Disc(30, pierce=True, falloff="linear"), Beam(60, 3), Rounds(Spread(Disc(2), 5, 9), 2))
LISTS = ("sprites", "names", "angles", "variants", "transforms")


def yard(n: int = 40) -> Scene:
    """Sprites of an irregular outline in rows, every fifth an occluder."""
    scene = Scene((200, 120), categories=["target"], name="yard")
    rng = random.Random(n)
    sprite = Sprite.from_mask(np.random.default_rng(n).random((9, 12)) < 0.7)
    for i in range(n):
        role = "occluder" if i % 5 == 4 else "hittable"
        scene.add(sprite, (25 * (i % 8), 25 * (i // 8)), role=role, layer=rng.randint(0, 2))
    scene.weapons["gun"] = Disc(4).to_json()
    scene.shots.append({"weapon": "gun", "at": [20, 20]})
    return scene


def answers(scene: Scene) -> list[Any]:
    """What some weapons hit all over a scene, by each strategy, and its hash."""
    at = np.random.default_rng(5).uniform(0, (200, 120), (12, 2))
    strategies = ("auto", "direct") if scene.bounds is None else ("auto", "direct", "built")
    fired = [fire(scene, weapon, at, aim=30, seed=3, strategy=s) for weapon in WEAPONS for s in strategies]
    return [scene.content_hash(), *(hits.to_dict()["rows"] for hits in fired)]


def masks(scene: Scene) -> list[Any]:
    """Each object's mask and its place."""
    return [(i, scene.mask(i)[0].tolist(), scene.mask(i)[1]) for i in scene.ids().tolist()]


def names(scene: Scene) -> list[str]:
    """Each object's name."""
    return [scene.name_of(i) for i in scene.ids().tolist()]


# Ticks


def test_ticks_count_up_from_0_and_the_oldest_goes() -> None:
    history = History(yard(), ticks=3)
    assert history.ticks == []
    assert [history.record() for _ in range(3)] == [0, 1, 2]
    assert (history.record(7), history.record(), history.ticks) == (7, 8, [2, 7, 8])
    assert [history.at(tick).tick for tick in history.ticks] == [2, 7, 8]
    assert type(history.at(7.0).tick) is int
    assert History(yard()).record(-5) == -5


def test_by_default_64_ticks_are_kept() -> None:
    history = History(yard(3))
    for _ in range(100):
        history.record()
    assert history.ticks == list(range(36, 100))


def recorded(*ticks: int, interpolate: bool = False) -> History:
    history = History(yard(3), interpolate=interpolate)
    for tick in ticks:
        history.record(tick)
    return history


@pytest.mark.parametrize(
    "call, told",
    [
        (lambda: recorded(*range(100)).at(12), "tick: expected one of 36 to 99, got 12"),
        (lambda: recorded(*range(100)).at(100), "tick: expected one of 36 to 99, got 100"),
        (lambda: recorded(0, 1, 2, 5, 7, 8).at(6), "tick: expected one of 0 to 2, 5, 7 to 8, got 6"),
        (lambda: recorded(*range(0, 80, 4)).at(6), "tick: expected one of the 20 recorded from 0 to 76, got 6"),
        (
            lambda: recorded(0, 1).at(0.5),
            "tick: expected one of 0 to 1, got 0.5; to read between them, make the History with interpolate=True",
        ),
        (
            lambda: recorded(0, 1).at(1e-9),
            "tick: expected one of 0 to 1, got 1e-09; to read between them, make the History with interpolate=True",
        ),
        (lambda: recorded(4).at(6), "tick: expected one of 4, got 6"),
        (lambda: recorded().at(0), "tick: expected one that is recorded, got 0: none is yet"),
        (lambda: recorded(0).at(True), "tick: expected a number, got True"),
        (lambda: recorded(0).at("now"), "tick: expected a number, got 'now'"),
        (lambda: recorded(0).at(float("nan")), "tick: expected a finite number, got nan"),
        (lambda: recorded(0, 1, interpolate=True).at(1.5), "tick: expected a number from 0 to 1, got 1.5"),
        (lambda: recorded(2, 3, interpolate=True).at(1.99), "tick: expected a number from 2 to 3, got 1.99"),
        (lambda: recorded(5).record(5), "tick: expected a whole number from 6 to 35184372088832, got 5"),
        (lambda: recorded(5).record(6.5), "tick: expected a whole number from 6 to 35184372088832, got 6.5"),
        (
            lambda: recorded(2**45).record(),
            "tick: expected a whole number from 35184372088833 to 35184372088832, got 35184372088833",
        ),
        (lambda: History(7), "scene: expected a Scene, got int"),
        (lambda: History(Scene(), ticks=0), "ticks: expected a whole number from 1 to 65536, got 0"),
        (lambda: History(Scene(), interpolate=1), "interpolate: expected true or false, got 1"),
    ],
)
def test_bad_input_is_named(call: Callable[[], object], told: str) -> None:
    with pytest.raises(InputError, match=f"^{told}$"):
        call()


def test_a_tick_that_cannot_be_recorded_leaves_no_trace() -> None:
    history = recorded(5)
    with pytest.raises(InputError):
        history.record(5)
    assert history.ticks == [5]


# The moment


def test_a_moment_is_what_it_was() -> None:
    """Every kind of change, and then each tick as it was told at its time."""
    scene, told = yard(), []
    history = History(scene)
    changes: list[Callable[[], object]] = [
        lambda: scene.move([0, 7], [(33, 44), (90.25, 20)]),
        lambda: scene.set(range(40), angle=30),
        lambda: scene.remove([3, 4]),
        lambda: scene.add(square(20), (50, 50), layer=3),
        lambda: scene.set([5, 6], role="occluder"),
        lambda: scene.set([5, 9], layer=7),
        lambda: scene.set([11, 12], categories=["target"], owner=1),
        lambda: scene.set([13], scale=2, flip="x"),
        lambda: [scene.add(square(5 + i), (3 * i, 2 * i)) for i in range(30)],
        lambda: scene.remove(scene.ids()),
    ]
    for change in changes:
        history.record()
        told.append((len(scene), scene.ids().tolist(), scene.version, names(scene), masks(scene), answers(scene)))
        change()
    hash_now, version_now = scene.content_hash(), scene.version
    for tick, truth in zip(history.ticks, told, strict=True):
        past = history.at(tick)
        assert (len(past), past.ids().tolist(), past.version, names(past), masks(past), answers(past)) == truth
        lists = [getattr(past.items, name) for name in (*COLUMNS, *LISTS)]
        assert {len(values) for values in lists} == {past.items.table.height}
    assert len({str(truth[-1]) for truth in told}) == len(told)
    assert (scene.content_hash(), scene.version) == (hash_now, version_now)


def test_the_past_has_the_face_of_a_scene(tmp_path: Path) -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    history = History(scene)
    history.record()
    past = history.at(0)
    assert isinstance(past, PastScene) and isinstance(past, Scene)
    assert (past.name, past.categories, past.bounds) == (scene.name, scene.categories, scene.bounds)
    assert (past.weapons, past.shots) == (scene.weapons, scene.shots) and past.weapons and past.shots
    assert names(past) == names(scene)
    assert past.find("duck 1") == scene.find("duck 1")
    assert past.ids("occluder").tolist() == scene.ids("occluder").tolist()
    assert past.category_bits("target") == scene.category_bits("target")
    for kind in ("box", "circle", "4 boxes", "polygon"):
        ours, theirs = (s.volumes(s.ids("hittable"), kind).bounds() for s in (past, scene))
        np.testing.assert_array_equal(ours.min, theirs.min)
        np.testing.assert_array_equal(ours.max, theirs.max)
    for then, now in zip(vars(past.planes()).values(), vars(scene.planes()).values(), strict=True):
        np.testing.assert_array_equal(then, now)
    past.save(tmp_path / "past")
    scene.save(tmp_path / "scene")
    assert (tmp_path / "past/scene.json").read_bytes() == (tmp_path / "scene/scene.json").read_bytes()
    assert load_scene(tmp_path / "past").content_hash() == scene.content_hash()


def test_extent_without_bounds() -> None:
    scene = Scene()
    scene.add(square(3), (5, 6))
    history = History(scene)
    history.record()
    scene.move(0, (50, 60))
    assert history.at(0).extent() == (5, 6, 7, 8)


def test_a_report_and_a_picture_of_the_past() -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    history = History(scene)
    history.record()
    now = fire(scene, Disc(20), (180, 150))
    report = report_of(scene, [now])
    picture = picture_of_report(report, scene)
    scene.remove(scene.ids("hittable"))
    past = history.at(0)
    hits = fire(past, Disc(20), (180, 150))
    assert hits == now and report_of(past, [hits]) == report
    np.testing.assert_array_equal(picture_of_report(report, past), picture)
    assert hits.shares() and hits.blockers() is not None and hits.why_not(0) is not None and hits.margins() is not None


def test_weapons_shots_names_of_the_scene_are_those_of_the_moment() -> None:
    scene = yard(3)
    history = History(scene)
    history.record()
    scene.weapons["gun"]["radius"] = 99
    scene.shots[0]["at"][0] = 99
    scene.name, scene.categories = "other", (*scene.categories, "more")
    history.record()
    first, second = history.at(0), history.at(1)
    assert (first.weapons["gun"]["radius"], first.shots[0]["at"][0], first.name) == (4, 20, "yard")
    assert (second.weapons["gun"]["radius"], second.shots[0]["at"][0], second.name) == (99, 99, "other")
    assert (first.categories, second.categories) == (("default", "target"), ("default", "target", "more"))
    first.weapons.clear()
    del first, second
    gc.collect()
    assert history.at(0).weapons


@pytest.mark.parametrize(
    "change",
    [
        lambda past: past.add(square(2), (5, 5)),
        lambda past: past.remove(0),
        lambda past: past.move([0], (5, 5)),
        lambda past: past.set(ids=0, angle=20),
        lambda past: past.rename(0, "other"),
    ],
)
def test_the_past_cannot_be_changed(change: Callable[[Scene], object]) -> None:
    history = recorded(12)
    past = history.at(12)
    before = (past.content_hash(), past.version, len(past))
    with pytest.raises(InputError, match=r"^scene: expected the present one, got that of tick 12, which is read-only$"):
        change(past)
    assert (past.content_hash(), past.version, len(past)) == before
    assert not any(getattr(past.items, name).flags.writeable for name in COLUMNS)


def test_a_tick_between_two_is_named_when_it_is_changed() -> None:
    with pytest.raises(InputError, match=r"got that of tick 0.25, which"):
        recorded(0, 1, interpolate=True).at(0.25).move(0, (1, 1))


def test_an_answer_of_the_past_is_never_stale() -> None:
    scene = yard()
    history = History(scene, ticks=1)
    history.record()
    hits = fire(history.at(0), Disc(20), (30, 30))
    shares = hits.shares()
    scene.remove(scene.ids())
    history.record()
    assert history.ticks == [1]
    assert hits.shares() == shares and len(shares) > 1
    assert hits.scene.items.changed_rows(hits.version - 1) is None  # it does not know what was before


def test_a_scene_that_is_kept_outlives_its_tick() -> None:
    scene = yard()
    history = History(scene, ticks=2)
    history.record()
    kept, truth = history.at(0), answers(scene)
    for turn in range(9):
        scene.set(range(40), angle=7 * turn + 1)
        history.record()
    assert 0 not in history.ticks
    assert answers(kept) == truth
    with pytest.raises(InputError, match="expected one of 8 to 9, got 0"):
        history.at(0)


def test_new_columns_are_taken_along(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(COLUMNS, "cost", ())
    monkeypatch.setitem(COLUMNS, "velocity_256", (2,))
    scene = yard(4)
    history = History(scene)
    scene.items.cost[:4] = [1, 5, 9, 255]  # type: ignore[attr-defined]
    history.record()
    scene.items.cost[1] = 0  # type: ignore[attr-defined]
    scene.items.velocity_256[2] = (3, -4)  # type: ignore[attr-defined]
    scene.move(0, (1, 1))
    history.record()
    assert [history.at(t).items.cost.tolist() for t in (0, 1)] == [[1, 5, 9, 255], [1, 0, 9, 255]]  # type: ignore[attr-defined]
    assert [history.at(t).items.velocity_256[2].tolist() for t in (0, 1)] == [[0, 0], [3, -4]]  # type: ignore[attr-defined]


# What was removed since


def test_what_was_removed_is_there_as_long_as_a_tick_shows_it() -> None:
    scene, sprite = Scene((40, 40)), Sprite.from_mask(np.ones((9, 9), np.bool_))
    known, history = weakref.ref(sprite), History(scene, ticks=3, interpolate=True)
    scene.add(square(3), (30, 30))
    item = scene.add(sprite, (9, 9), angle=20)
    del sprite
    history.record()
    scene.set(item, angle=60)
    history.record()
    before = masks(history.at(0)), masks(history.at(0.5)), masks(history.at(1))
    scene.remove(item)
    history.record()
    for past, shown in zip((0, 0.5, 1), before, strict=True):
        history.at(2)  # what was made for the tick before goes
        assert masks(history.at(past)) == shown
        assert fire(history.at(past), Point(), (9, 9)).object.tolist() == [item]
        assert known() is not None and history.at(past).name_of(item) == "hittable 1"
    assert not fire(history.at(2), Point(), (9, 9)) and not fire(history.at(1.5), Point(), (30, 9))
    history.record()
    assert history.at(3).ids().tolist() == [0] and known() is not None
    history.record()
    gc.collect()
    assert known() is None


# Masks laid out anew


@pytest.mark.parametrize("fired", [False, True])
def test_masks_that_are_laid_out_anew(fired: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 0)
    scene, truth = yard(), {}
    history, rng, atlases = History(scene), random.Random(2), {}
    for _ in range(30):
        scene.set(rng.sample(range(40), 9), angle=[rng.uniform(0, 360) for _ in range(9)])
        if fired:
            fire(scene, Point(), (5, 5))
        tick = history.record()
        atlases[id(scene.items.atlas)] = scene.items.atlas
        truth[tick] = masks(scene), scene.content_hash() if fired else None
        scene.add(square(30 + tick), (20, 20))
        scene.remove(scene.ids()[-1:])
    assert len(atlases) > 5
    for tick, (masks_then, hash_then) in truth.items():
        past = history.at(tick)
        assert masks(past) == masks_then
        offset, stack = past.items.offset, past.items.stack()
        assert past.items.offset is offset, "what is past was laid out anew"
        for rank, item in enumerate(stack.ids.tolist()):
            np.testing.assert_array_equal(stack.mask(rank), past.mask(item)[0])
        assert hash_then in (None, past.content_hash())


def test_a_scene_that_is_only_recorded_does_not_fill_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Firing throws out masks that are no longer in use; a server that fires at the past alone never does that."""
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 0)
    scene = yard()
    history = History(scene, ticks=3)
    for turn in range(50):
        scene.set(range(40), angle=1 + 3 * turn)
        history.record()
        assert scene.items.atlas.used <= 2 * scene.items.atlas.live


def test_recording_waits_for_a_thread_that_lays_masks_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another thread fires at the scene, which begins to lay its masks out anew: half of that is not recorded."""
    scene = yard()
    scene.set(range(40), angle=list(range(40)))
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", -scene.items.atlas.used - 1)
    half, go_on, lay_out = threading.Event(), threading.Event(), items_module.Items._compact

    def slowly(items: items_module.Items) -> None:
        whole = items.atlas
        items.atlas = variants_module.MaskAtlas()
        half.set()
        go_on.wait(10)
        items.atlas = whole
        lay_out(items)

    monkeypatch.setattr(items_module.Items, "_compact", slowly)
    history = History(scene)
    first = threading.Thread(target=scene.items.stack)
    second = threading.Thread(target=history.record)
    first.start()
    assert half.wait(10)
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 2**20)
    second.start()
    second.join(0.05)
    go_on.set()
    first.join()
    second.join()
    monkeypatch.undo()
    assert history.at(0).content_hash() == scene.content_hash()


# What is shared


def test_what_did_not_change_is_kept_once() -> None:
    scene = yard()
    history = History(scene)
    history.record()
    history.record()
    first, second = history.at(0), history.at(1)
    assert first is not second and first.items is second.items and first.items.atlas is not scene.items.atlas
    scene.move([3], (50, 50))
    history.record()
    third = history.at(2).items
    assert {name for name in COLUMNS if getattr(third, name) is not getattr(first.items, name)} == {"position_256"}
    assert all(getattr(third, name) is getattr(first.items, name) for name in (*LISTS, "atlas"))
    scene.set([3], angle=20)
    history.record()
    fourth = history.at(3).items
    assert {name for name in COLUMNS if getattr(fourth, name) is getattr(third, name)} >= {"position_256", "layer"}
    assert fourth.names is third.names and fourth.sprites is third.sprites and fourth.transforms is not third.transforms
    scene.weapons["gun"]["radius"] = 5
    history.record()
    assert history.at(4).items is fourth


def test_a_moment_that_did_not_change_takes_no_room() -> None:
    history = History(yard(), ticks=50)
    for _ in range(50):
        history.record()
    assert len({id(moment) for moment in history._moments.values()}) == 1


def served(gone: int, seed: int) -> tuple[Scene, History]:
    """A scene that changes from tick to tick, of which some objects were there before and are gone."""
    rng, scene = np.random.default_rng(seed), Scene((200, 120))
    for _ in range(gone):
        scene.add(square(3), name="gone")
    scene.remove(range(gone))
    history = History(scene, interpolate=True)
    for step in range(6):
        living = scene.ids()
        for _ in range(int(rng.integers(0, 4))):
            scene.add(square(int(rng.integers(3, 9))), rng.uniform(0, 100, 2), name=f"of {step}")
        if len(living) and rng.random() < 0.5:
            scene.remove(int(living[rng.integers(len(living))]))
        ids = scene.ids()
        scene.move(ids, rng.uniform(0, 100, (len(ids), 2)))
        if rng.random() < 0.6:
            scene.set(ids[::2], angle=rng.uniform(-400, 400, len(ids[::2])))
        if rng.random() < 0.3:
            scene.set(ids[:2], role="occluder", layer=2)
        history.record()
    return scene, history


def told_of(past: Scene, first: int) -> list[Any]:
    """All that is read of a scene, with ids as they would be if the first had not been there."""
    ids = past.ids()
    at = np.random.default_rng(2).uniform(0, 100, (20, 2))
    hits = [fire(past, weapon, at, aim=30) for weapon in (Disc(9), Pistol(60))]
    owners = (past.owner(ids) - first).tolist()
    return [
        (ids - first).tolist(), owners, past.position(ids).tolist(), past.angle(ids).tolist(), past.box(ids).tolist(),
        [mask for _, mask, _ in masks(past)], names(past), past.layer(ids).tolist(), past.role(ids).tolist(), len(past),
        [(row.shot, row.object - first, row.samples) for own in hits for row in own],
    ]  # fmt: skip


@examples(40, deadline=None)
@given(st.integers(1, 300), st.integers(0, 2**32))
def test_what_was_removed_before_makes_no_difference_to_the_past(gone: int, seed: int) -> None:
    (_, plain), (scene, history) = served(0, seed), served(gone, seed)
    copies = [history, copy.deepcopy(history), pickle.loads(pickle.dumps(history))]
    for tick in (0, 0.25, 1, 1.5, 2, 3.75, 5):
        truth = told_of(plain.at(tick), 0)
        for one in copies:
            past = one.at(tick)
            assert told_of(past, gone) == told_of(past.copy(), gone) == truth
            assert past.name_of(0) == "gone" and 0 not in past
    told = told_of(scene, gone)
    scene.add(square(4))
    scene.remove(scene.ids())
    assert told_of(history.at(5), gone) == told


def test_a_moment_has_as_many_rows_as_there_were_objects_at_once() -> None:
    scene, ids = Scene((99, 99)), [0]
    history = History(scene)
    for _ in range(300):
        ids.append(scene.add(square(3), (9, 9)))
        if len(ids) > 2:
            scene.remove(ids[-2])
    for x in range(3):
        scene.move(ids[-1], (x, 5))
        history.record()
    kept = [moment.snapshot for moment in history._moments.values()]
    assert {len(column) for items in kept for column in items.columns.values()} == {2}
    assert {len(values) for items in kept for values in items.lists.values()} == {2}
    assert all(items.lists is kept[0].lists and items.table.known[0] is kept[0].table.known[0] for items in kept)
    assert [history.at(tick).position(ids[-1])[0] for tick in range(3)] == [0, 1, 2]


def test_ids_that_are_left_out_make_a_moment_of_their_own() -> None:
    scene = yard(3)
    history = History(scene)
    history.record()
    scene.items.table.skip_to(7)
    history.record()
    assert [history.at(tick).items.count for tick in (0, 1)] == [3, 7]


# What is made for a moment


def test_the_scene_of_a_tick_is_the_same_while_it_is_in_use() -> None:
    history = recorded(0, 1)
    past = history.at(0)
    history.at(1)
    assert history.at(0) is past and history.at(0.0) is past
    released = weakref.ref(past)
    del past
    assert history.at(0) is released()
    history.at(1)
    gc.collect()
    assert released() is None


def test_caches_are_there_for_the_next_shot() -> None:
    scene = yard()
    history = History(scene)
    history.record()
    at = np.random.default_rng(1).uniform(0, 100, (50, 2))
    weapons = Disc(3), Disc(3, falloff="linear"), Point()
    for weapon in weapons:
        fire(history.at(0), weapon, at, strategy="built")
        fire(history.at(0), weapon, at, broadphase="grid")
    scene.move(0, (50, 50))
    history.record()
    past = history.at(0)
    plane = past.derived.label_plane()
    assert plane is not None and plane.labels is not None and past.derived.index("grid").boxes is not None
    for weapon in weapons:
        hits = fire(past, weapon, at, strategy="built")
        assert hits == fire(past, weapon, at, strategy="direct", prefilter="none")
        made = {stage.name: stage.bytes_made for stage in hits.plan.ran}
        assert made["label plane" if weapon == Point() else "visible set"] == 0
    assert plane.redrawn == 0


def test_a_few_shots_make_no_plane_and_no_index() -> None:
    scene = yard()
    history = History(scene)
    history.record()
    past = history.at(0)
    for falloff, whole in ((None, "visible set"), ("linear", "label plane")):
        for _ in range(3):
            hits = fire(past, Disc(3, falloff=falloff), (30, 30))
        plane = past.derived.label_plane()
        assert plane is not None and plane.labels is None
        assert past.derived.index("bvh").boxes is None
        assert {whole, "broad phase", "volumes"} <= {stage.name for stage in hits.plan.left_out}


def test_the_stack_is_kept_with_the_moment() -> None:
    history = recorded(0, 1)
    stack = history.at(0).items.stack()
    history.at(1)
    gc.collect()
    assert history.at(0).items.stack() is stack


def test_the_order_of_a_moment_is_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of one at which nobody fired, and between two, whose items are made anew for each reader."""
    scene = yard(5)
    scene.remove([1])
    history = History(scene, interpolate=True)
    for x in range(3):
        scene.move([0], (x, 0))
        history.record()
    assert [moment.snapshot.order for moment in history._moments.values()] == [None] * 3
    stack_of, versions = Items.stack_of, []

    def counted(items: Items, *roles: Role) -> Stack:
        versions.append(items.version)
        return stack_of(items, *roles)

    monkeypatch.setattr(Items, "stack_of", counted)
    for tick in (0.5, 0.25, 0, 2, 2, 0.75):
        history.at(tick).items.stack()
    assert len(versions) == len(set(versions)) == 2


def test_volumes_of_masks_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = yard()
    history = History(scene)
    scene.volumes(scene.ids(), "circle")
    history.record()
    scene.move(1, (33, 33))
    history.record()
    monkeypatch.setattr("hitplanes.planes.volumes.fit.bounding", lambda *_: pytest.fail("a volume was made again"))
    for tick in (0, 1):
        circles = history.at(tick).volumes([1], "circle")
        assert isinstance(circles, Circles)
    np.testing.assert_array_equal(circles.center, scene.volumes([1], "circle").center)  # type: ignore[union-attr]


# Between ticks


def two_ends(first: dict[str, Any], last: dict[str, Any], ticks: tuple[int, int] = (0, 1)) -> History:
    """One object, as it is at two ticks."""
    scene = Scene()
    pose = {name: value for name, value in first.items() if name != "position_xy"}
    scene.add(Sprite.from_mask(np.ones((3, 8), bool)), first.get("position_xy", (0, 0)), **pose)
    history = History(scene, interpolate=True)
    history.record(ticks[0])
    scene.set(0, **last)
    history.record(ticks[1])
    return history


def position_of(past: Scene) -> list[int]:
    return past.items.position_256[0].tolist()


whole = st.integers(-(2**48), 2**48)
near = st.integers(-600, 600)


@examples(300, deadline=None)
@given(
    st.tuples(near | whole, near | whole),
    st.tuples(near | whole, near | whole),
    st.integers(-(2**40), 2**40) | st.integers(-3, 3),
    st.integers(1, 4) | st.integers(1, 200) | st.integers(1, 2**22),
    st.integers(0, 2**30),
)
def test_positions_are_those_of_fractions(
    begin: tuple[int, int], end: tuple[int, int], first: int, gap: int, part: int
) -> None:
    history = two_ends(
        {"position_xy": np.array(begin) / 256}, {"position_xy": np.array(end) / 256}, (first, first + gap)
    )
    part %= 256 * gap + 1
    steps = [Fraction((b - a) * part, 256 * gap) for a, b in zip(begin, end, strict=True)]
    assert position_of(history.at(first + part / 256)) == [a + round(v) for a, v in zip(begin, steps, strict=True)]


def test_a_position_is_rounded_half_to_even() -> None:
    history = two_ends({"position_xy": (1 / 256, 1 / 256)}, {"position_xy": (2 / 256, 0)})
    assert position_of(history.at(0.5)) == [1, 1]
    history = two_ends({"position_xy": (1 / 256, 1 / 256)}, {"position_xy": (4 / 256, -2 / 256)})
    assert position_of(history.at(0.5)) == [3, -1]
    history = two_ends({"position_xy": (0, 0)}, {"position_xy": (384 / 256, -640 / 256)})
    assert position_of(history.at(1 / 256)) == [2, -2]


def test_a_very_long_way_between_two_ticks() -> None:
    end = (2**40, (2**32 - 1) / 256)
    history = two_ends({"position_xy": (-(2**40), 0)}, {"position_xy": end}, (-(2**45), 2**45))
    assert position_of(history.at(0)) == [0, 2**31]
    assert position_of(history.at(2**44)) == [2**47, 3 * 2**30 - 1]
    x, _ = position_of(history.at(2**44 + 1 / 256))
    assert abs(x - 2**47) <= 2**49 // 2**30


@pytest.mark.parametrize(
    "given, rounded", [(0.5 + 1 / 512, 0.5), (0.5 + 3 / 512, 0.5 + 2 / 256), (0.001, 0), (0.999, 1), (1, 1)]
)
def test_ticks_are_rounded_to_a_256th_half_to_even(given: float, rounded: float) -> None:
    history = two_ends({"position_xy": (0, 0)}, {"position_xy": (256, 0)})
    past = history.at(given)
    assert (past.tick, position_of(past)[0]) == (rounded, 65536 * rounded)
    assert past is history.at(rounded)
    assert type(past.tick) is (float if rounded % 1 else int)


@pytest.mark.parametrize(
    "begin, end, half",
    [
        (0, 90, 45), (90, 0, 45), (10, 350, 0), (350, 10, 360), (-170, 170, -180), (170, -170, 180),
        (0, 180, 90), (180, 0, 270), (0, -180, 90), (90, 270, 180), (270, 90, 360), (-90, 90, 0),
        (0, 720, 0), (30, 390, 30), (0, 540, 90), (5, 3, 4), (-350, 350, -360), (1e6, 1e6 + 2, 1e6 + 1),
    ],
)  # fmt: skip
def test_angles_go_the_short_way(begin: float, end: float, half: float) -> None:
    past = two_ends({"angle": begin}, {"angle": end}).at(0.5)
    assert past.items.angles == [half]
    fresh = Scene()
    fresh.add(Sprite.from_mask(np.ones((3, 8), bool)), angle=half)
    assert masks(past) == masks(fresh)
    assert fire(past, Disc(9), (3, 1)) == fire(fresh, Disc(9), (3, 1))
    view = (-9, -9, 9, 9)
    np.testing.assert_array_equal(draw_view(past.items, view), draw_view(fresh.items, view))


def test_objects_that_turn_between_two_ticks_have_masks_of_their_own() -> None:
    sprites = [Sprite.from_mask(np.ones((3, wide), bool)) for wide in (4, 8, 13)] + [Sprite.box(9, 4)]
    scene, fresh = Scene(), Scene()
    for k, sprite in enumerate(sprites):
        scene.add(sprite, (20 * k, 0), scale=1 + k)
        fresh.add(sprite, (20 * k, 0), scale=1 + k, angle=5 * k)
    history = History(scene, interpolate=True)
    history.record()
    scene.set(range(4), angle=[10 * k for k in range(4)])
    history.record()
    assert masks(history.at(0.5)) == masks(fresh)


def test_all_else_is_as_at_the_earlier_tick() -> None:
    sheet = Sprite.from_image(np.random.default_rng(0).integers(0, 256, (6, 15, 4), np.uint8), grid_wh=(5, 6))
    scene = Scene((99, 99), categories=["a"])
    for place in (20, 60):
        scene.add(sheet, (place, 20), frame=1, flip="x", scale=2, layer=1, owner=0)
    history = History(scene, interpolate=True)
    history.record()
    early = History(scene)
    early.record()
    scene.set(1, frame=2, flip="y", scale=1, layer=5, categories=["a"], owner=1, role="occluder")
    history.record()
    assert history.at(0.75).content_hash() == early.at(0).content_hash() != history.at(1).content_hash()
    assert history.at(0.75).version == early.at(0).version


def test_what_is_at_one_end_alone_stays_as_at_the_earlier() -> None:
    scene = Scene()
    for place in (0, 50, 100):
        scene.add(square(9), (place, 0))
    history = History(scene, interpolate=True)
    history.record()
    scene.move([0, 2], [(0, 40), (100, 40)])
    scene.set(2, angle=90)
    scene.remove([1, 2])
    scene.add(square(9), (200, 0))
    history.record(2)
    past = history.at(1)
    assert [mask[2] for mask in masks(past)] == [(0, 20), (50, 0), (100, 0)]
    assert history.at(2).ids().tolist() == [0, 3]


def test_at_recorded_ticks_nothing_is_between() -> None:
    scene, truth = yard(), []
    history = History(scene, interpolate=True)
    for turn in range(4):
        scene.set(range(0, 40, 2), angle=40 * turn, position_xy=np.random.default_rng(turn).uniform(0, 99, (20, 2)))
        history.record(3 * turn)
        truth.append(answers(scene))
    assert [answers(history.at(tick)) for tick in history.ticks] == truth
    assert answers(history.at(1)) not in truth
    assert [answers(history.at(tick)) for tick in history.ticks] == truth


def test_only_what_turns_gets_a_new_mask(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = yard()
    scene.set(range(10), angle=33)
    history = History(scene, interpolate=True)
    history.record()
    scene.move(range(40), (50, 50))
    scene.set([4, 5], angle=[20, 393])
    history.record()
    before, made = history.at(0).items, []
    flat = before.atlas.flat
    inner = history_module.variants_of
    monkeypatch.setattr(history_module, "variants_of", lambda sprites, new: made.extend(new) or inner(sprites, new))
    monkeypatch.setattr(items_module, "variants_of", lambda *_: pytest.fail("a mask was made"))
    past = history.at(0.5).items
    assert len(made) == 1
    assert [i for i in range(40) if past.variants[i] is not before.variants[i]] == [4]
    assert not any(getattr(past, name).flags.writeable for name in COLUMNS)
    assert before.atlas.flat is flat is not past.atlas.flat
    scene.move(range(40), (60, 60))
    history.record()
    moved, begin = history.at(1.5).items, history.at(1).items
    assert {name for name in COLUMNS if getattr(moved, name) is not getattr(begin, name)} == {"position_256"}
    assert not moved.position_256.flags.writeable


def test_a_moment_that_lasts_is_its_own_middle() -> None:
    history = recorded(0, 1, interpolate=True)
    assert history.at(0.5).items is history.at(0).items


def test_a_turn_through_a_mask_that_is_too_large_is_named() -> None:
    scene = Scene()
    scene.add(Sprite.from_mask(np.ones((1, 100), bool)))
    scene.add(Sprite.from_mask(np.ones((30, 200), bool)), scale=(160, 2))
    history = History(scene, interpolate=True)
    history.record()
    scene.set(1, angle=90)
    history.record()
    with pytest.raises(InputError, match=r"^object 1 at 22\.5 degrees: scale: expected a mask of sides up to"):
        history.at(0.25)
    assert history.at(0).content_hash() != history.at(1).content_hash()


def test_masks_of_a_middle_do_not_reach_the_live_scene() -> None:
    """The live atlas has room behind what the moments use: the next masks of the scene go there."""
    scene = yard()
    history = History(scene, interpolate=True)
    history.record()
    scene.set(range(40), angle=80)
    history.record()
    scene.set(range(40), angle=95)
    truth, middle = masks(scene), answers(history.at(0.5))
    scene.set(range(40), angle=[3 * i for i in range(40)])
    scene.set(range(40), angle=95)
    stack = scene.items.stack()
    assert all((stack.mask(rank) == scene.mask(i)[0]).all() for rank, i in enumerate(stack.ids.tolist()))
    assert masks(scene) == truth and answers(history.at(0.5)) == middle


def test_threads_read_and_record() -> None:
    scene = yard()
    history, truth, wrong = History(scene, ticks=8, interpolate=True), {}, []
    for turn in range(8):
        scene.set(range(40), angle=7 * turn, position_xy=(2 * turn, turn))
        truth[history.record()] = scene.content_hash()
    done = threading.Event()

    def read(seed: int) -> None:
        rng = random.Random(seed)
        while not done.is_set():
            tick = rng.randrange(8)
            try:
                wrong.extend([tick] * (history.at(tick).content_hash() != truth[tick]))
                history.at(tick - 0.5).content_hash()
            except InputError as error:
                wrong.extend([error] * ("tick: expected a number from" not in str(error)))

    threads = [threading.Thread(target=read, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for turn in range(8):
        scene.set(range(40), angle=5 * turn)
        history.record()
    done.set()
    for thread in threads:
        thread.join()
    assert not wrong and history.ticks == list(range(8, 16))


# All changes at random, against a list of what was there


class Record(NamedTuple):
    """What was there at a tick: all that a new scene is made of, and what the scene was called by then."""

    models: dict[int, Model]
    count: int
    content_hash: str

    def rebuilt(self, bounded: bool) -> Scene:
        """A scene that never changed."""
        scene = Scene(SIZE_WH if bounded else None, ORIGIN_XY)
        for number, model in sorted(self.models.items()):
            scene.items.table.skip_to(number)
            scene.add(model.sprite, model.position, **{k: v for k, v in model.pose.items() if k != "owner"})
        scene.items.table.skip_to(self.count)
        for number, model in self.models.items():
            scene.set(number, owner=model.pose["owner"])
        return scene

    def toward(self, later: Record, part: Fraction) -> Record:
        """What was there when a part of the time to a later tick had passed, one object at a time."""
        models = dict(self.models)
        for number in models.keys() & later.models.keys():
            model, other = self.models[number], later.models[number]
            begin, end = snap(model.position).tolist(), snap(other.position).tolist()
            x, y = ((a + round((b - a) * part)) / 256 for a, b in zip(begin, end, strict=True))
            angle = model.pose.get("angle", 0.0)
            turn = (other.pose.get("angle", 0.0) - angle) % 360
            angle += (turn if turn <= 180 else turn - 360) * float(part)
            models[number] = Model(model.sprite, (x, y), {**model.pose, "angle": angle})
        return Record(models, self.count, "")


class RecordedScene(ChangingScene):
    """Change a scene, record it, and compare its past with scenes made of plain lists."""

    fire = planes_are_up_to_date = scene_counts_what_is_there = save_and_load = an_old_answer_is_stale = None  # type: ignore[assignment]
    a_bad_change_changes_nothing = None  # type: ignore[assignment]

    @initialize(
        size=st.sampled_from([SIZE_WH, SIZE_WH, None]),
        shared=st.lists(places, max_size=5),
        ticks=st.sampled_from([1, 2, 3, 64]),
        interpolate=st.booleans(),
    )
    def begin(
        self, size: tuple[int, int] | None, shared: list[tuple[float, float]], ticks: int, interpolate: bool
    ) -> None:
        ChangingScene.begin(self, size, shared)
        self.most, self.interpolate = ticks, interpolate
        self.history = History(self.scene, ticks, interpolate)
        self.records: dict[int, Record] = {}
        self.kept: list[tuple[PastScene, Record]] = []

    @rule(gap=st.sampled_from([None, None, 1, 2, 5, 300]))
    def record(self, gap: int | None) -> None:
        last = max(self.records, default=-1)
        version, content = self.scene.version, self.scene.content_hash()
        tick = self.history.record(None if gap is None else last + gap)
        assert tick == last + (gap or 1)
        assert (self.scene.version, self.scene.content_hash()) == (version, content)
        models = {n: Model(m.sprite, m.position, dict(m.pose)) for n, m in self.models.items()}
        self.records[tick] = Record(models, self.scene.items.count, content)
        assert self.history.ticks == sorted(self.records)[-self.most :]

    def _here(self) -> list[int]:
        return sorted(self.records)[-self.most :]

    @precondition(lambda self: self.records)
    @rule(data=st.data(), seed=st.integers(0, 500), keep=st.booleans())
    def at_a_tick(self, data: st.DataObject, seed: int, keep: bool) -> None:
        tick = data.draw(st.sampled_from(self._here()))
        past, truth = self.history.at(tick), self.records[tick]
        assert past.content_hash() == truth.content_hash and past.tick == tick
        self._equal(past, truth, seed)
        if keep:
            self.kept.append((past, truth))

    @precondition(lambda self: self.records)
    @rule(data=st.data(), seed=st.integers(0, 500), part=st.integers(1, 256 * 300 - 1))
    def at_any_time(self, data: st.DataObject, seed: int, part: int) -> None:
        here = self._here()
        first = data.draw(st.sampled_from(here))
        if first == here[-1] or not self.interpolate:
            with pytest.raises(InputError, match="tick: expected"):
                self.history.at(first + 1 / 256)
            return
        last = here[here.index(first) + 1]
        part = part % (256 * (last - first) - 1) + 1
        between = self.records[first].toward(self.records[last], Fraction(part, 256 * (last - first)))
        past = self.history.at(first + part / 256)
        self._equal(past, between, seed)

    @precondition(lambda self: self.records)
    @rule(data=st.data())
    def of_a_tick_that_went(self, data: st.DataObject) -> None:
        gone = sorted(self.records.keys() - set(self._here()))
        if gone:
            with pytest.raises(InputError, match="tick: expected"):
                self.history.at(data.draw(st.sampled_from(gone)))

    @precondition(lambda self: self.kept)
    @rule(data=st.data(), seed=st.integers(0, 500))
    def of_a_scene_that_was_kept(self, data: st.DataObject, seed: int) -> None:
        self._equal(*data.draw(st.sampled_from(self.kept)), seed)

    def _equal(self, past: Scene, truth: Record, seed: int) -> None:
        rebuilt, rng = truth.rebuilt(past.bounds is not None), random.Random(seed)
        assert past.content_hash() == rebuilt.content_hash()
        assert masks(past) == masks(rebuilt)
        where = [(0.0, 9.0), *(model.position for model in truth.models.values())]
        strategies = ("auto", "direct") if past.bounds is None else ("auto", "direct", "built")
        for strategy in strategies:
            volley = some_volley(rng, some_weapon(rng), where, len(truth.models))
            assert volley.fired(past, strategy=strategy) == volley.fired(rebuilt, strategy="direct")

    def teardown(self) -> None:
        for tick in getattr(self, "history", recorded()).ticks:
            self._equal(self.history.at(tick), self.records[tick], tick)


def test_the_past_of_a_scene_that_changes() -> None:
    phases = [Phase.explicit, Phase.reuse, Phase.generate]
    few = settings(max_examples=20, stateful_step_count=30, phases=phases, **QUIET)
    run_state_machine_as_test(RecordedScene, settings=few)


@pytest.mark.long
def test_the_past_of_a_scene_that_changes_for_long() -> None:
    run_state_machine_as_test(RecordedScene, settings=settings(max_examples=320, stateful_step_count=60, **QUIET))
