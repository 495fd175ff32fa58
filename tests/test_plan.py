"""What each stage of a call costs in time and bytes, and that a scene pays only for what it has."""

from __future__ import annotations

import json
import re
import runpy
import subprocess
import sys
import time
import tracemalloc
from collections import Counter
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.ma  # np.unique loads it, once in a process, which a count of bytes would tell of a stage
import pytest

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    History,
    Laser,
    Pistol,
    Point,
    Polygon,
    Rifle,
    Ring,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Sweep,
    Weapon,
    fire,
    prepare,
    report_of,
)
from hitplanes.planes.bits import bit_rows, distance_field, front_to_back, label_plane, visible
from hitplanes.planes.broadphase import boxes
from hitplanes.planes.scene import items, render
from hitplanes.weapons.fire import areas, call, prefilter, spans
from hitplanes.weapons.fire import plan as plan_module
from hitplanes.weapons.fire.hits import Hits
from hitplanes.weapons.fire.plan import Plan, PlanSum, Stage, plan_lines
from hitplanes.weapons.fire.prefilter import Candidates
from hitplanes.weapons.kinds import weapon as weapon_module
from hitplanes.weapons.kinds.weapon import PatternTable
from hitplanes.weapons.rays import contacts, first_hit, ray_call, ray_walk, raycast

ROOT = Path(__file__).parent.parent
LEFT_OUT = runpy.run_path(str(ROOT / "fixtures" / "left_out.py"))
SHOTS = [(20 + 5 * i, 30 + 3 * i) for i in range(9)]
IMAGERY = ("background", "mover", "hud")


def yard(size_wh: tuple[int, int] | None = (99, 79), *, full: bool = False) -> Scene:
    """Twelve discs; and if it is full, occluders, another layer and imagery."""
    scene = Scene(size_wh, categories=["red"])
    for i in range(12):
        scene.add(Sprite.circle(6), (20 + 10 * (i % 4), 25 + 12 * (i // 4)))
    if full:
        scene.set([3, 4], layer=2)
        scene.add(Sprite.box(9, 9), (40, 40), role="occluder", layer=1)
        for role in IMAGERY:
            scene.add(Sprite.box(30, 30), (30, 30), role=role)
    return scene


def costs(hits: Hits) -> list[tuple[Any, ...]]:
    return [(stage.name, stage.bytes_made, stage.pairs) for stage in hits.plan.ran]


def names(hits: Hits) -> tuple[list[str], set[str]]:
    """Stages that ran, and those left out."""
    return [stage.name for stage in hits.plan.ran], {stage.name for stage in hits.plan.left_out}


# Times


class Clock:
    """Nanoseconds that pass only where the work is told to take some."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.ns, self.patch = 0, patch
        patch.setattr(plan_module, "perf_counter_ns", lambda: self.ns)

    def takes(self, owner: Any, name: str, ns: int) -> None:
        """Let every call of a function take so long."""
        work = getattr(owner, name)

        def slow(*args: Any, **values: Any) -> Any:
            self.ns += ns
            return work(*args, **values)

        self.patch.setattr(owner, name, slow)


FIRING, RESOLVE, TRACING, RAYFIRE = call, spans, ray_walk, ray_call
BITFIRE, RUNFIRE, PATTERNS = areas, spans, weapon_module
OF_ALL = [(FIRING, "checked_shots", "shots", 1), (items.Items, "stack_of", "stack", 10)]
OF_BITS = [
    *OF_ALL,
    (BITFIRE, "placements_for", "patterns", 200),
    (PATTERNS, "pattern_bits_of", "patterns", 400),
    (FIRING, "chosen_way", "plan", 10**3),
    (FIRING, "chosen_candidates", "plan", 2 * 10**3),
    (FIRING, "leave_out_unused", "rows", 4 * 10**3),
    (front_to_back, "front_to_back", "samples", 10**4),
    (BITFIRE, "_rows_of", "samples", 2 * 10**4),
]
OF_TILES = [*OF_BITS, (items.Items, "tiles", "tiles", 10**5)]
OF_PATTERNS = [
    *OF_ALL,
    (RUNFIRE, "placements_for", "patterns", 200),
    (FIRING, "chosen_way", "plan", 10**3),
    (FIRING, "chosen_candidates", "plan", 2 * 10**3),
    (FIRING, "leave_out_unused", "rows", 4 * 10**3),
    (RUNFIRE, "rows_of_span_hits", "rows", 10**4),
    (RESOLVE, "_count", "verdicts", 10**5),
    (PatternTable, "weight", "weights", 10**6),
    (RESOLVE, "refused", "filter", 10**7),
    (RESOLVE, "kinds", "occluders", 10**8),
]
OF_DIRECT = [
    *OF_PATTERNS,
    (Candidates, "near", "volumes", 10**9),
    (RESOLVE, "_under_items", "samples", 10**10),
    (RESOLVE, "walk", "walk", 10**11),
]
OF_RAYS = [
    *OF_ALL,
    (RAYFIRE, "chosen_candidates", "plan", 100),
    (RAYFIRE, "leave_out_absent", "plan", 200),
    (RAYFIRE, "rays_of", "rays", 10**3),
    (TRACING, "_enters", "pre-filter", 10**4),
    (TRACING, "refused", "filter", 10**5),
    (prefilter, "near_rays", "volumes", 10**6),
    (TRACING, "find_contacts", "walk", 10**7),
    (TRACING, "_started", "walk", 2 * 10**7),
    (contacts, "end_at_occluders", "occluders", 10**8),
    (contacts, "end_at_hits", "stops", 10**9),
    (RAYFIRE, "Walk", "passes", 10**10),
    (RAYFIRE, "rows_of_passes", "rows", 10**11),
]
GOES_ON = Rifle(60, max_hits=2)
"""A weapon whose rays are followed without all their cells, many at a time."""

OF_CAST = [
    *OF_ALL,
    (RAYFIRE, "chosen_candidates", "plan", 100),
    (RAYFIRE, "leave_out_absent", "plan", 200),
    (RAYFIRE, "rays_of", "rays", 10**3),
    (raycast, "near_items", "cast", 10**4),
    (raycast, "_firsts", "cast", 10**5),
    (raycast, "end_at_occluders", "cast", 10**6),
    (raycast, "end_at_hits", "cast", 10**7),
    (RAYFIRE, "rows_of_passes", "rows", 10**9),
]
OF_MARCH = [
    *OF_ALL,
    (RAYFIRE, "chosen_candidates", "plan", 100),
    (RAYFIRE, "leave_out_absent", "plan", 200),
    (RAYFIRE, "chosen_ray_way", "plan", 400),
    (RAYFIRE, "rays_of", "rays", 10**3),
    (label_plane.LabelPlane, "read", "label plane", 10**4),
    (distance_field.DistanceField, "read", "distance field", 10**5),
    (distance_field, "first_taken", "march", 10**6),
    (first_hit.FirstHits, "rows", "rows", 10**8),
]
BOXES, INDEX = (Candidates, "meeting", "pre-filter", 10**12), (Candidates, "meeting", "broad phase", 10**12)
CALLS: dict[str, tuple[Weapon, dict[str, Any], list[tuple[Any, str, str, int]]]] = {
    "tiles with a pre-filter": (
        Disc(9),
        {"strategy": "tiles", "prefilter": "circle"},
        [*OF_TILES, (Candidates, "near", "volumes", 10**6), BOXES],
    ),
    "tiles by an index": (
        Disc(9),
        {"strategy": "tiles", "prefilter": "circle", "broadphase": "grid"},
        [*OF_TILES, (Candidates, "near", "volumes", 10**6), INDEX],
    ),
    "tiles": (Spread(Disc(9, falloff="linear"), 3, 5), {"strategy": "tiles"}, OF_TILES),
    "visible": (
        Disc(9),
        {"strategy": "visible"},
        [
            *OF_BITS,
            (visible.Visible, "read", "visible set", 10**5),
            (visible.VisibleSet, "cells_for", "pre-filter", 10**6),
        ],
    ),
    "spans": (Disc(9, falloff="linear"), {"strategy": "spans", "prefilter": "circle"}, [*OF_DIRECT, BOXES]),
    "spans by an index": (
        Disc(9, falloff="linear"),
        {"strategy": "spans", "prefilter": "circle", "broadphase": "grid"},
        [*OF_DIRECT, INDEX],
    ),
    "rays": (Rifle(60, max_hits=2), {"aim": 30, "strategy": "walk", "prefilter": "circle"}, [*OF_RAYS, BOXES]),
    "rays that go on": (GOES_ON, {"aim": 30}, OF_CAST),
    "rays that march": (Pistol(60), {"aim": 30, "strategy": "march"}, OF_MARCH),
    "rays by an index": (
        Rifle(60, max_hits=2),
        {"aim": 30, "strategy": "walk", "prefilter": "circle", "broadphase": "bvh"},
        [*OF_RAYS, INDEX],
    ),
}


@pytest.mark.parametrize("past", [False, True])
@pytest.mark.parametrize("name", CALLS)
def test_the_time_of_each_stage_is_its_own(name: str, past: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    weapon, how, work = CALLS[name]
    scene: Any = yard(full=True)
    if past:
        history = History(scene)
        history.record(7)
        scene.move(0, (9, 9))
        history.record(8)
        scene, how = history, {**how, "tick": [7, 8, 7, 8, 7, 8, 7, 8, 7]}
        work = [*work, (FIRING, "moments_of", "past", 10**13), (Hits, "_gathered_rows", "rows", 10**14)]
    clock = Clock(monkeypatch)
    spent = dict.fromkeys({stage for *_, stage, _ in work}, 0)
    for owner, function, stage, ns in work:
        clock.takes(owner, function, ns)
        inner = getattr(owner, function)

        def counted(*args: Any, inner: Any = inner, stage: str = stage, ns: int = ns, **values: Any) -> Any:
            spent[stage] += ns
            return inner(*args, **values)

        monkeypatch.setattr(owner, function, counted)
    hits = fire(scene, weapon, SHOTS, accept=["default"], exclude=5, **how)
    took = {stage.name: stage.ns for stage in hits.plan.ran if stage.ns}
    assert took == spent and hits.plan.ns == clock.ns > 0
    assert all(spent.values())


def test_the_times_are_those_of_the_call() -> None:
    """What no stage counts is less than a tenth."""
    scene = yard(full=True)
    at = np.random.default_rng(3).uniform(0, 80, (3000, 2))
    for weapon, how in ((Disc(6), {"strategy": "direct"}), (Disc(6), {"strategy": "built"}), (Laser(90), {})):
        shares = []
        for _ in range(5):  # another process may come in between
            begin = time.perf_counter_ns()
            hits = fire(scene, weapon, at, **how)  # type: ignore[arg-type]
            shares.append(hits.plan.ns / (time.perf_counter_ns() - begin))
            assert all(stage.ns > 0 for stage in hits.plan.ran)
        assert 0.9 < max(shares) <= 1


def test_times_are_in_no_report_and_make_no_difference() -> None:
    scene = yard(full=True)
    fire(scene, Disc(5), SHOTS)
    first, second = (fire(scene, Disc(5), SHOTS, strategy="direct") for _ in range(2))
    assert [s.ns for s in first.plan.ran] != [s.ns for s in second.plan.ran]
    assert first.plan == second.plan and first == second
    told = [json.dumps([hits.to_dict(), report_of(scene, [hits])]) for hits in (first, second)]
    assert told[0] == told[1] and '"ns"' not in told[0]
    timed = first.plan.timed()
    assert [stage.pop("ns") for stage in timed["ran"]] == [
        s.ns for s in first.plan.ran
    ] and timed == first.plan.to_dict()


def test_what_ran_or_is_known_is_not_left_out_again() -> None:
    plan = Plan()
    plan.leave_out("hud", "none")
    plan.run("walk", "")
    assert [stage.name for stage in plan.ran] == ["walk"]  # also of a plan that was read before it was complete
    plan.run("walk", "by depth", 5)
    plan.run("rows", "", 7)
    for name in ("rows", "hud", "walk", "filter"):
        plan.leave_out(name, "idle")
    assert plan.to_dict() == {
        "ran": [{"stage": "walk", "why": "by depth", "bytes": 5}, {"stage": "rows", "why": "", "bytes": 7}],
        "left_out": [{"stage": "hud", "why": "none"}, {"stage": "filter", "why": "idle"}],
    }
    plan.run("hud", "after all")
    assert [stage.name for stage in plan.left_out] == ["filter"]  # another part of the call ran it
    other = deepcopy(plan)
    assert plan == other and "by depth" in repr(plan) and plan != "plan"
    other.run("walk", "", 1)
    assert plan != other and [stage.bytes_made for stage in other.ran] == [6, 7, 0]


# As a table


def told_plan(*stages: tuple[Any, ...], **left: str) -> Plan:
    plan = Plan()
    for name, why, made, pairs, ns in stages:
        plan.run(name, why, made, pairs)
        plan.ran[-1].ns = ns
    for name, why in left.items():
        plan.leave_out(name, why)
    return plan


def test_a_plan_is_told_as_a_table() -> None:
    one = told_plan(("shots", "1 checked", 64, None, 1_500), ("walk", "by depth", 12_345, None, 2_000_049), hud="none")
    assert plan_lines(one.timed()) == [
        "stage        time   bytes  why",
        "shots      1.5 us      64  1 checked",
        "walk   2,000.0 us  12,345  by depth",
        "all    2,001.5 us  12,409",
        "hud      left out          none",
    ]


def test_a_plan_is_printed_as_a_table() -> None:
    told = told_plan(("shots", "1 checked", 64, None, 1_500), hud="none")
    assert str(told).splitlines() == plan_lines(told.timed()) and "hud    left out" in str(told)


def test_plans_are_added_up() -> None:
    total = PlanSum()
    total.add(told_plan(("sieve", "boxes", 10, (1, 4), 1_000), ("walk", "it", 1, None, 500), hud="none"))
    total.add(told_plan(("sieve", "boxes", 5, (3, 1_200), 2_000), hud="none", walk="nothing met"))
    total.add(told_plan(("sieve", "other", 5, None, 1_000)))
    assert plan_lines(total.timed(), total.calls) == [
        "stage      time  bytes  why",
        "sieve    4.0 us     20  3 of 3 calls: boxes; 4 of 1,204 pairs left",
        "walk     0.5 us      1  1 of 3 calls: it",
        "all      4.5 us     21  3 calls",
        "hud    left out         2 of 3 calls: none",
        "walk   left out         1 of 3 calls: nothing met",
    ]


def test_what_an_answer_is_asked_for_later_is_added_to_its_plan() -> None:
    """It was left out of the call, or ran there, too; a call counts once."""
    total = PlanSum()
    total.add(told_plan(("walk", "it", 1, None, 500), verdicts="asked", hud="none"), Stage("verdicts", "all", 8, ns=70))
    total.add(told_plan(("verdicts", "here", 1, None, 30)), Stage("verdicts", "all", 8, ns=100))
    assert plan_lines(total.timed(), total.calls) == [
        "stage         time  bytes  why",
        "walk        0.5 us      1  1 of 2 calls: it",
        "verdicts    0.2 us     17  2 of 2 calls: all",
        "all         0.7 us     18  2 calls",
        "hud       left out         1 of 2 calls: none",
    ]


# Bytes


MOST, SLACK = 16, 60_000
"""While a stage works it holds at most so many times the bytes that it hands on, and some beside."""

WORDS_AT_ONCE = 2**15
"""Of parts so small that what is held for one is less than what is made of all."""

AT_ONCE = 5 * 8 * WORDS_AT_ONCE
"""Bytes that bit rows hold while some are counted: rows, windows, and three sets for the nearest."""

SELECTING = {"pre-filter", "broad phase", "volumes", "filter", "occluders", "verdicts", "plan"}
"""Stages that hand on less than they look at."""


@pytest.mark.parametrize("name", CALLS)
def test_bytes_are_what_was_made(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each stage allocates what it says that it made, and not many times as much; nor does the call."""
    weapon, how, _ = CALLS[name]
    how = {key: value for key, value in how.items() if key != "prefilter"}
    scene, at = yard((400, 300), full=True), np.random.default_rng(5).uniform(0, 80, (2000, 2))
    fire(scene, weapon, at, **how)  # windows of patterns are kept beside what a call makes
    scene.move(0, (21, 25))
    held: dict[str, int] = {}
    run, before, whole = Plan.run, [0], [0]

    def measured(plan: Plan, stage: str, why: str, made: int = 0, pairs: Any = None) -> None:
        now, most = tracemalloc.get_traced_memory()
        held[stage] = held.get(stage, 0) + most - before[0]
        run(plan, stage, why, made, pairs)
        tracemalloc.reset_peak()
        before[0], whole[0] = now, max(whole[0], most)

    monkeypatch.setattr(Plan, "run", measured)
    monkeypatch.setattr(bit_rows, "WORDS_AT_ONCE", WORDS_AT_ONCE // 2)
    tracemalloc.start()
    try:
        hits = fire(scene, weapon, at, accept=["default"], exclude=[5] * len(at), **how)
    finally:
        tracemalloc.stop()
    made = {stage.name: stage.bytes_made for stage in hits.plan.ran}
    for stage in made.keys() - SELECTING:
        assert made[stage] - SLACK <= 1.5 * held[stage] and held[stage] <= MOST * made[stage] + SLACK, stage
    assert sum(made.values()) / 3 < whole[0] < 3 * sum(made.values()) + AT_ONCE * ("walk" not in made)


def test_the_bytes_of_a_stage_are_those_of_its_arrays() -> None:
    """Of a square on a square all is known by hand: 9 samples in 3 runs, on one item."""
    scene = Scene((99, 99))
    scene.add(np.ones((5, 5), np.bool_), (20, 20))
    word, runs = 8, 3 * 5 * 8
    told = {
        "shots": 2 * word,
        "stack": 9 * word + 1,
        "patterns": (2 + 1 + 4) * word,
        "plan": 0,
        "weights": (9 + 1) * word + 3 * word,
        "verdicts": 5 * word,
        "outside": 0,
        "pre-filter": 3 * word,
        "samples": runs,
        "walk": 9 + 3 * (1 + 4 * word),
        "rows": runs + 10 * word,
    }
    weapon = Box(3, 3, falloff="linear")
    for now in (told, {**told, "stack": 0}):
        assert {s.name: s.bytes_made for s in fire(scene, weapon, (20, 20), strategy="spans").plan.ran} == now


# What is not done


def mixed() -> dict[str, Hits]:
    """A shot of each way, at nothing but objects on one layer, that nothing is asked of."""
    return {
        "spans": fire(yard(), Disc(9, falloff="linear"), SHOTS, strategy="spans"),
        "visible": fire(yard(), Disc(9, pierce=True, falloff="linear"), SHOTS, strategy="visible"),
        "tiles": fire(yard(), Disc(9), SHOTS, strategy="tiles"),
        "few": fire(yard(), Disc(9), SHOTS),
        "points": fire(yard(), Point(), SHOTS, strategy="built"),
        "rays": fire(yard(), Laser(60), SHOTS, aim=30),
        "unbounded": fire(yard(None), Disc(9, falloff="linear"), SHOTS),
    }


class Unread(np.ndarray[Any, Any]):
    """A column of which no entry may be looked up."""

    def __getitem__(self, key: Any) -> Any:
        pytest.fail("a column that the scene does not need is looked up")


def test_occluders_layers_and_filters_are_looked_up_only_where_there_are_any(monkeypatch: pytest.MonkeyPatch) -> None:
    sorted_by: list[int] = []
    lexsort, stack_of = np.lexsort, items.Items.stack_of
    monkeypatch.setattr(np, "lexsort", lambda keys: sorted_by.append(len(keys)) or lexsort(keys))

    def guarded(self: items.Items, *roles: items.Role) -> items.Stack:
        sorted_by.clear()
        stack = stack_of(self, *roles)
        assert sorted_by == [1 + stack.has_occluders + stack.layered]
        columns = {} if stack.has_occluders else {"occluder": stack.occluder.view(Unread)}
        refusing = {} if filtered else {name: getattr(stack, name).view(Unread) for name in ("categories", "owner")}
        return replace(stack, **columns, **refusing)

    monkeypatch.setattr(items.Items, "stack_of", guarded)
    filtered = False
    for hits in mixed().values():
        assert hits and names(hits)[1] >= {"occluders", "layers", "filter"}
    for way in ("spans", "tiles"):
        full = fire(yard(full=True), Disc(9), SHOTS, strategy=way)
        assert ("occluders" in names(full)[0]) == (way == "spans") and not {"occluders", "layers"} & names(full)[1]
    filtered = True
    assert "filter" not in names(fire(yard(), Disc(9), SHOTS, exclude=5))[1]
    unmet = yard()
    unmet.set(3, categories=0)
    assert "filter" not in names(fire(unmet, Disc(9), SHOTS))[1]


AIMED: list[Weapon] = [
    Pistol(40), Laser(40), Sweep(Pistol(40), 30, 3), Spread(Rifle(40), 3, 2), Cone(20, 40), Beam(20, 2), Box(4, 2),
    Polygon([(0, 0), (9, 0), (0, 4)]), Stencil(["##", "#."]), Spread(Beam(9, 1), 2, 3), Rounds(Cone(9, 30), 2),
]  # fmt: skip
ROUND: list[Weapon] = [Point(), Disc(4), Ring(2, 4), Spread(Disc(2), 3, 5), Rounds(Spread(Point(), 2, 3), 2)]


@pytest.mark.parametrize("weapon", [*AIMED, *ROUND], ids=repr)
def test_a_weapon_that_is_not_aimed_says_once_where_it_fires(weapon: Weapon) -> None:
    told = [Stage("aim", "none given, so to the right (0 degrees)")] if weapon in AIMED else []
    scene = yard()
    history = History(scene)
    history.record(0)
    history.record(1)
    ready = prepare(scene, weapon)
    unaimed = [
        fire(scene, weapon, SHOTS), fire(scene, weapon, SHOTS[0]), ready.fire(SHOTS[0]), ready.fire(SHOTS[0], shot=3),
        fire(history, weapon, SHOTS[:3], tick=[0, 1, 0]),
    ]  # fmt: skip
    for hits in unaimed:
        assert [stage for stage in hits.plan.left_out if stage.name == "aim"] == told
        assert sum("to the right" in line for line in plan_lines(hits.plan.timed())) == len(told)
    straight = fire(scene, weapon, SHOTS, aim=0)
    assert straight == unaimed[0]
    for hits in (straight, fire(scene, weapon, SHOTS, toward=(9, 9)), ready.fire(SHOTS[0], 0)):
        assert not hits.plan.has_left_out("aim")


def test_what_was_left_out_is_told_of_the_scene_as_it_was() -> None:
    """Also where the plan is first read when all of it has changed."""
    for weapon in (Disc(9), Disc(9, falloff="linear"), Laser(60)):
        scene = yard(full=True)
        hits, told = (fire(scene, weapon, SHOTS, aim=30, strategy="direct") for _ in range(2))
        before = told.plan.left_out
        scene.remove(scene.ids())
        scene.add(Sprite.box(9, 9), (40, 40))
        assert hits.plan.left_out == before and set(IMAGERY) <= names(hits)[1]


def test_no_call_is_made_for_what_a_scene_has_not(monkeypatch: pytest.MonkeyPatch) -> None:
    called = Counter[str]()

    def count(owner: Any, name: str) -> None:
        work = getattr(owner, name)

        def counted(*args: Any, **values: Any) -> Any:
            called[name] += 1
            return work(*args, **values)

        monkeypatch.setattr(owner, name, counted)

    for owner, name in (
        (RESOLVE, "refused"), (BITFIRE, "refused"), (TRACING, "refused"), (contacts, "end_at_occluders"),
        (weapon_module, "falloff_weights"), (label_plane.LabelPlane, "read"), (boxes.Index, "read"),
        (Candidates, "near"), (prefilter, "near_rays"), (render, "draw_view"), (PatternTable, "weight"),
        (RAYFIRE, "leave_out_absent"),
    ):  # fmt: skip
        count(owner, name)
    hits = {"direct": fire(yard(), Disc(9), SHOTS, strategy="direct"), "rays": fire(yard(), Laser(60), SHOTS, aim=30)}
    assert all(hits.values()) and called == {"leave_out_absent": 1}
    fire(yard(), Disc(9), SHOTS, strategy="built")
    assert called == {"leave_out_absent": 1}
    assert fire(yard(), Disc(9.03125), SHOTS).verdict_counts()["hit"]
    assert called == {"leave_out_absent": 1}
    assert fire(yard(), Disc(9.03125), SHOTS, strategy="spans").verdict_counts()["hit"]
    assert called == {"leave_out_absent": 1, "weight": 2}  # of the rows, and of the verdicts that are asked for
    called.clear()
    fire(yard(), Disc(9), SHOTS, strategy="spans", exclude=[[5], *[[4]] * 8], prefilter="box")
    assert called == {"refused": 1, "weight": 1}
    fire(yard(full=True), Disc(9.03125, falloff="linear"), SHOTS, strategy="built", exclude=5)
    fire(yard(full=True), Point(), SHOTS, strategy="built")
    fire(yard(full=True), Disc(9), SHOTS, strategy="direct", prefilter="circle", broadphase="grid")
    fire(yard(full=True), Laser(60), SHOTS, aim=30, exclude=5, prefilter="circle")
    assert set(called) == {
        "refused", "end_at_occluders", "falloff_weights", "read", "near", "near_rays", "weight",
        "leave_out_absent",
    }  # fmt: skip


def test_no_run_is_laid_out_for_bounds_that_nothing_reaches_over(monkeypatch: pytest.MonkeyPatch) -> None:
    laid: list[int] = []
    lay = PatternTable.laid
    monkeypatch.setattr(PatternTable, "laid", lambda *args: laid.append(1) or lay(*args))
    for size_wh, at, times in ((None, (20, 20), 1), ((99, 79), (20, 20), 1), ((99, 79), (8, 25), 2)):
        laid.clear()
        hits = fire(yard(size_wh), Disc(9, falloff="linear"), at, strategy="spans")
        assert len(laid) == times and bool(hits.verdict_counts()["outside"]) == (times == 2)


@pytest.mark.parametrize("way", ["direct", "built", "rays"])
def test_imagery_costs_a_shot_nothing(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Background, movers and HUD are told to be left out; else nothing changes."""
    scenes = yard(), yard()
    for role in IMAGERY:
        scenes[1].add(Sprite.from_image(np.full((400, 600, 4), 255, np.uint8)), (30, 30), role=role, layer=9)
    monkeypatch.setattr(render, "draw_view", lambda *args: pytest.fail("drawn"))
    weapon, how = (Laser(60), {"aim": 30}) if way == "rays" else (Disc(9), {"strategy": way})
    plain, pictured = (fire(scene, weapon, SHOTS, **how) for scene in scenes)  # type: ignore[arg-type]
    assert plain == pictured and plain and costs(plain) == costs(pictured)
    assert names(pictured)[1] - names(plain)[1] == set(IMAGERY) and not names(plain)[1] & set(IMAGERY)


LOADED = """
import sys, numpy.typing, numpy.random
{}
before = set(sys.modules)
{}
print(*(name for name in set(sys.modules) - before if name.split(".")[0] in ("hitplanes", "cv2", "numpy")))
"""
START = "from hitplanes import Disc, Pistol, Scene, fire; scene = Scene((99, 99)); fire"
SHOT = "scene.add([[True] * 9] * 9, (20, 20)); assert fire(scene, {}, (20, 20), strategy='direct')"
OF_SCENES = (
    "bits.bit_rows bits.cells bits.front_to_back bits.span_walk bits.tiles"
    " common.backend common.checks common.costs common.limits common.tables grid.fixed_point"
    " grid.rasterize grid.spans late scene.derived scene.items scene.objects scene.poses scene.scene"
    " scene.sprite scene.variants"
)
OF_FIRE = (
    "fire.areas fire.call fire.hits fire.plan fire.prefilter fire.strategy kinds.areas kinds.placements"
    " kinds.rays kinds.weapon late"
)
OF_A_RAY = "rays.contacts rays.first_hit rays.ray_call rays.ray_hits rays.ray_walk rays.raycast"


def loaded(before: str, code: str) -> set[str]:
    """Modules of the project, cv2 and numpy that are loaded by some code after other code."""
    script = LOADED.format(before, code)
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_what_is_loaded_by_importing_and_by_a_shot() -> None:
    """A shot of a pattern loads nothing that is not there by then; none loads cv2, volumes, broad phases, the past."""
    assert loaded("", "import hitplanes") == {"hitplanes"}
    started = {f"hitplanes.planes.{name}" for name in OF_SCENES.split()}
    started |= {f"hitplanes.weapons.{name}" for name in OF_FIRE.split()}
    rooms = {name.rpartition(".")[0] for name in started} - {"hitplanes"}
    assert loaded("import hitplanes", START) == started | rooms
    assert loaded(START, SHOT.format("Disc(3)")) == set()
    of_ray = {f"hitplanes.weapons.{name}" for name in OF_A_RAY.split()} | {
        "hitplanes.planes.bits.distance_field",
        "hitplanes.planes.bits.label_plane",
        "hitplanes.weapons.rays",
    }
    assert loaded(START, SHOT.format("Pistol(3)")) == of_ray


# The table


@pytest.mark.parametrize("weapon", LEFT_OUT["WEAPONS"])
def test_the_table_of_fixture_scenes_tells_what_the_code_does(weapon: str) -> None:
    """Bytes and what was left out; times are of one machine."""
    page = (ROOT / "fixtures" / "left_out.md").read_text()
    told = page.split(f"## {weapon[0].upper()}{weapon[1:]}\n\n")[1].split("\n\n")[0].rstrip() + "\n"
    assert re.sub(r" B, [\d,]+ us", "", told) == LEFT_OUT["markdown"](LEFT_OUT["table"](weapon, False))
    assert page.startswith(LEFT_OUT["INTRO"])


def test_each_thing_alone_adds_what_is_its_own() -> None:
    rows = LEFT_OUT["table"]("a disc by tiles", False)
    columns = {name: {row[0]: row[i] for row in rows} for i, name in enumerate(rows[0]) if i}
    base = columns["only hittable"]
    changed = {
        name: {stage for stage, cell in column.items() if cell != base[stage] and stage not in ("stage", "**all**")}
        for name, column in columns.items()
    }
    assert changed["layers"] == {"layers"} and changed["bounds"] == {"outside"}
    assert changed["imagery"] == set(IMAGERY)
    assert changed["occluders"] == {"stack", "tiles", "occluders", "samples"}
    assert changed["filter"] == {"filter", "samples"}
    assert changed["falloff"] == {"weights", "samples"}
