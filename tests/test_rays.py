"""Traced weapons against the walk of one cell at a time, and the laws that change no row."""

from __future__ import annotations

import math
import random
import re
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from itertools import pairwise, product
from typing import Any

import numpy as np
import oracle_rays
import pytest
from examples import examples
from hypothesis import given, note
from hypothesis import strategies as st
from oracle_rays import Item, StartsInside, Walk, mask_normal
from ray_battles import (
    Battle,
    Body,
    Close,
    Gun,
    Pixel,
    Place,
    Ray,
    Shot,
    pair,
    pass_of,
    rows_of,
    some_battle,
    some_place,
    some_target,
    stop_of,
)
from some_of import in_turn, some_of

from hitplanes import Hits, InputError, Laser, Scene, Sprite, Sweep, Verdict, Weapon, fire, use_jit
from hitplanes.planes.grid import fixed_point, rasterize
from hitplanes.weapons.rays import ray_call, ray_walk

PASS_COLUMNS = (
    "shot", "round", "pellet", "object", "order", "entry_xy", "exit_xy", "entry", "exit", "entry_px", "exit_px",
    "material", "normal_xy", "weight", "point_xy",
)  # fmt: skip
STOP_COLUMNS = (
    "shot", "round", "pellet", "reason", "item", "cell_xy", "fraction", "distance", "point_xy", "normal_xy",
)  # fmt: skip
PREFILTERS = ("box", "circle", "oriented box", "1 boxes", "3 boxes", "polygon", "swept")
FAR = 10**9
SCENES_IN_PART = 100
PARTS, LONG_PARTS = 2, 80

worlds = st.randoms(use_true_random=False)


def columns(table: Any, names: tuple[str, ...]) -> list[dict[str, Any]]:
    """Rows of a table of columns."""
    return [
        dict(zip(names, row, strict=True))
        for row in zip(*(np.asarray(getattr(table, name)).tolist() for name in names), strict=True)
    ]


def told(hits: Hits) -> tuple[list[Any], list[Any], list[Any], list[Any]]:
    """All that the library answers."""
    rows = [tuple(row) for row in hits]
    place = {row[:3]: number for number, row in enumerate(rows)}
    passes = columns(hits.passes, PASS_COLUMNS)
    for row in passes:
        row["row"] = place[row["shot"], row["round"], row["object"]]
    return rows, passes, columns(hits.stop, STOP_COLUMNS), hits.verdicts.tolist()


def agree(found: list[dict[str, Any]], truth: list[dict[str, Any]], what: str) -> None:
    """Equal but for what the truth leaves open."""
    assert len(found) == len(truth), (what, found, truth)
    for number, (row, true) in enumerate(zip(found, truth, strict=True)):
        for name, value in true.items():
            assert value is None or row[name] == value, f"{what}[{number}].{name}: {row[name]}, truly {value}"


# Against the oracle


def check_columns(hits: Hits, walks: list[list[tuple[Ray, Walk]]], falloff: str | None) -> None:
    """Every column of the passes, of the stops and of the rows."""
    flat = [(which, ray, walked) for which, rays in enumerate(walks) for ray, walked in rays]
    passes = [pass_of(which, ray, walked, one, falloff) for which, ray, walked in flat for one in walked.passes]
    rows, found, stops, _ = told(hits)
    agree(found, passes, "passes")
    agree(stops, [stop_of(*one) for one in flat], "stop")
    truth = [row for which, rays in enumerate(walks) for row in rows_of(which, rays, falloff)]
    assert rows == truth
    for row, (_, _, walked) in zip(stops, flat, strict=True):
        cells, cell = walked.path.cells, tuple(row["cell_xy"])
        if row["reason"] == 3 and walked.passes:
            assert cell in next(one for one in walked.passes if one.object == row["item"]).cells
        if row["reason"] == 0:
            assert cells[cell][1] == max(leave for _, leave in cells.values()), "the far end lies in its cell"


def verdicts_of(walked: Walk, items: list[Item], refused: list[Body], battle: Battle) -> Iterator[tuple[Any, ...]]:
    """For each cell of a ray, in order: its verdict, and its item where that is known."""
    met: dict[Pixel, list[int]] = {}
    for one in walked.passes:
        for cell in one.cells:
            met.setdefault(cell, []).append(one.object)
    for number, cell in enumerate(walked.order):
        covering = [item.id for item in items if cell in item.pixels]
        if oracle_rays.outside(cell, battle.bounds):
            yield Verdict.OUTSIDE, -1
        elif number >= walked.walked:
            yield Verdict.BEYOND, None
        elif cell in met:
            yield Verdict.HIT, next(i for i in covering if i in met[cell])
        elif cell == walked.stop.cell_xy:
            yield Verdict.OCCLUDED, walked.stop.item
        elif covering or any(cell in body.pixels for body in refused):
            yield Verdict.FILTERED, None  # also what the ray starts in and is told to ignore
        else:
            yield Verdict.EMPTY, -1


def check_samples(battle: Battle, hits: Hits, walks: list[list[tuple[Ray, Walk]]]) -> None:
    """Every cell of every ray, and the counts; those past the stop in any order."""
    for which, rays in enumerate(walks):
        samples = hits.samples_at(which)
        items = battle.accepted(battle.shots[which])
        known = {item.id for item in items}
        refused = [body for i, body in enumerate(battle.bodies) if i not in known]
        names = ("round", "pellet", "xy", "verdict", "item")
        found = [tuple(row.values()) for row in columns(samples, names)]
        for ray, walked in rays:
            mine, found = found[: len(walked.order)], found[len(walked.order) :]
            assert {row[:2] for row in mine} == {ray[:2]}, (which, ray)
            cells = [tuple(row[2]) for row in mine]
            assert cells[: walked.walked] == walked.order[: walked.walked] and sorted(cells) == sorted(walked.order)
            truth = dict(zip(walked.order, verdicts_of(walked, items, refused, battle), strict=True))
            for (_, _, _, verdict, item), cell in zip(mine, cells, strict=True):
                assert verdict == truth[cell][0], (which, ray, cell, Verdict(verdict), truth[cell])
                assert truth[cell][1] is None or item == truth[cell][1], (which, ray, cell, item, truth[cell])
        assert not found
        counts = np.bincount(samples.verdict, minlength=len(Verdict)).tolist()
        assert hits.verdicts[which].tolist() == counts and int(hits.fired[which]) == len(samples.xy)


def other_forms(battle: Battle) -> Iterator[Hits]:
    """The library's answers by the reference, and by compiled kernels."""
    yield battle.fired(strategy="walk")
    if find_spec("numba"):
        use_jit()
        try:
            yield battle.fired()
        finally:
            use_jit(None)


def check(battle: Battle, samples: bool = True) -> list[list[tuple[Ray, Walk]]]:
    """The library's answer is the oracle's."""
    try:
        walks = battle.walks()
    except StartsInside as inside:
        with pytest.raises(InputError) as error:
            battle.fired()
        message = str(error.value)
        numbers = set(map(int, re.findall(r"\d+", message)))
        assert any({row, item} <= numbers for row, item in inside.args), (message, inside.args)
        return []
    hits = battle.fired()
    for other in other_forms(battle):
        assert other == hits
    check_columns(hits, walks, battle.gun.falloff)
    if samples:
        check_samples(battle, hits, walks)
    return walks


@examples(80, deadline=None)
@given(worlds)
def test_random_worlds(rng: random.Random) -> None:
    battle = some_battle(rng)
    note(repr(battle))
    check(battle)


def check_part(part: int) -> None:
    passes = 0
    for seed in range(part * SCENES_IN_PART, (part + 1) * SCENES_IN_PART):
        battle = some_battle(random.Random(seed))
        try:
            passes += sum(len(walked.passes) for rays in check(battle) for _, walked in rays)
        except AssertionError as error:
            raise AssertionError(f"{seed=} {battle}") from error
    assert passes > SCENES_IN_PART // 2, "too little was hit to mean anything"


@pytest.mark.parametrize("part", range(PARTS))
def test_worlds_by_number(part: int) -> None:
    check_part(part)


@pytest.mark.long
@pytest.mark.parametrize("part", range(PARTS, PARTS + LONG_PARTS))
def test_more_worlds_by_number(part: int) -> None:
    check_part(part)


def test_the_random_worlds_reach_every_case() -> None:
    """What the comparison is worth: every end, policy and tie occurs, and often."""
    seen: dict[str, int] = dict.fromkeys(
        (
            "range", "occluder", "hits", "budget", "error", "no length", "holes", "entered at 0", "thick", "cut",
            "equal entries", "a wall first", "ignored", "ended behind", "just enough", "no normal",
        ), 0,
    )  # fmt: skip
    for seed in range(1000):
        battle = some_battle(random.Random(seed))
        try:
            walks = battle.walks()
        except StartsInside:
            seen["error"] += 1
            continue
        for ray, walked in (one for rays in walks for one in rays):
            seen[walked.stop.reason] += 1
            seen["no length"] += ray[2] == ray[3]
            seen["thick"] += battle.gun.width > 0
            cells, scale = walked.path.cells, walked.path.scale
            seen["holes"] += any(
                len(oracle_rays.joined(cells[c] for c in one.cells)) > 1 and one.cells for one in walked.passes
            )
            seen["entered at 0"] += any(one.entry == 0 for one in walked.passes)
            seen["cut"] += any(oracle_rays.outside(c, battle.bounds) for c in walked.order)
            seen["equal entries"] += len({c[0] for c in cells.values()}) < len(cells)
            plain = sorted(cells, key=lambda c: (cells[c][0], c[1], c[0]))
            seen["a wall first"] += plain != walked.order
            seen["ended behind"] += walked.stop.reason == "occluder" and bool(
                any(walked.stop.cell_xy in one.cells for one in walked.passes)
            )
            seen["no normal"] += any(one.normal == (0, 0) for one in walked.passes)
            seen["ignored"] += battle.gun.inside == "ignore_until_exit" and any(
                cells[c][0] == 0 for b in battle.bodies for c in b.pixels if c in cells
            )
            if walked.stop.reason == "budget" and battle.gun.budget_256:
                seen["just enough"] += isinstance(walked.stop.time, int) or walked.stop.time.denominator == 1
            assert scale > 0
    assert min(seen.values()) >= 5, seen


# Laws


def same(a: Hits, b: Hits) -> None:
    assert a == b and told(a) == told(b)


def harmless(battle: Battle) -> Battle:
    """Without the policy that is an error."""
    if battle.gun.inside == "error":
        return replace(battle, gun=replace(battle.gun, inside="hit"))
    return battle


@examples(34, deadline=None)
@given(worlds)
def test_no_prefilter_changes_a_row(rng: random.Random) -> None:
    battle = harmless(some_battle(rng))
    scene = battle.scene()
    first = battle.fired(scene, prefilter="none")
    for prefilter in ("box", "auto", rng.choice(PREFILTERS)):
        same(first, battle.fired(scene, prefilter=prefilter))
    prefilter, broadphase = rng.choice(PREFILTERS), rng.choice(["none", "grid", "quadtree", "bvh"])
    same(first, battle.fired(battle.scene(), prefilter=prefilter, broadphase=broadphase))


@examples(34, deadline=None)
@given(worlds)
def test_a_batch_is_its_shots_one_by_one(rng: random.Random) -> None:
    battle = harmless(some_battle(rng))
    scene = battle.scene()
    hits = battle.fired(scene)
    rows, passes, stops, verdicts = told(hits)
    for which, shot in enumerate(battle.shots):
        alone = told(replace(battle, shots=[shot]).fired(scene))
        first = sum(row[0] < which for row in rows)
        assert [row[1:] for row in rows if row[0] == which] == [row[1:] for row in alone[0]]
        mine = [row | {"shot": 0, "row": row["row"] - first} for row in passes if row["shot"] == which]
        assert mine == alone[1]
        assert [row | {"shot": 0} for row in stops if row["shot"] == which] == alone[2]
        assert verdicts[which] == alone[3][0]


@examples(34, deadline=None)
@given(worlds, st.integers(1, 60), st.integers(1, 60))
def test_the_size_of_parts_changes_nothing(rng: random.Random, cells_at_once: int, pairs_at_once: int) -> None:
    battle = harmless(some_battle(rng))
    truth = battle.fired()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(ray_call, "CHUNK_CELLS", cells_at_once)
        patched.setattr(ray_call, "CHUNK_PAIRS", pairs_at_once)
        patched.setattr(ray_walk, "CHUNK_SAMPLES", pairs_at_once)
        same(battle.fired(), truth)
        same(battle.fired(prefilter="none"), truth)


@pytest.mark.parametrize(
    ("weapon", "shots"),
    [
        (Laser(600, width=30), 100),
        pytest.param(Laser(600, width=30), 400, marks=pytest.mark.long),
        pytest.param(Sweep(Laser(1400), 360, 4000), 1, marks=pytest.mark.long),
    ],
)
def test_many_rays_through_a_crowd_need_little_memory(weapon: Weapon, shots: int) -> None:
    """Boxes that they may meet, and cells that they touch, are worked on in parts."""
    scene, rng = Scene(), np.random.default_rng(5)
    for xy in rng.integers(0, 1000, (1500, 2)).tolist():
        scene.add(Sprite.circle(6), xy)
    scene.add(Sprite.box(900, 900), (500, 500))
    at = rng.integers(0, 500, (shots, 2))
    tracemalloc.start()
    try:
        hits = fire(scene, weapon, at, aim=45)
        assert hits.samples.sum() > 1000
        assert tracemalloc.get_traced_memory()[1] < 320 * 2**20
    finally:
        tracemalloc.stop()


@examples(34, deadline=None)
@given(worlds, st.sampled_from([-FAR, -1, 0, 7, FAR]), st.sampled_from([-FAR, 3, FAR]))
def test_a_world_elsewhere_is_the_same_world(rng: random.Random, dx: int, dy: int) -> None:
    """Everything but the floats of points is the same to the last bit."""
    battle = harmless(some_battle(rng))
    here, there = told(battle.fired()), told(battle.moved(dx, dy).fired())
    assert [(*row[:7], (row[7][0] + dx, row[7][1] + dy), row[8]) for row in here[0]] == there[0]
    for table in (1, 2):
        for row, moved in zip(here[table], there[table], strict=True):
            for name in ("entry_xy", "exit_xy", "cell_xy"):
                if name in row:
                    assert [row[name][0] + dx, row[name][1] + dy] == moved.pop(name)
                    del row[name]
            x, y = row.pop("point_xy")
            assert [Close(x + dx, FAR), Close(y + dy, FAR)] == moved.pop("point_xy")
            assert row == moved
    assert here[3] == there[3]


def cells_between(a: Place, b: Place, width: float = 0) -> list[Pixel]:
    """Cells of a ray, in the order of its walk."""
    samples = Battle(Gun(width=width), [Shot(a, b)]).fired().samples_at(0)
    assert set(samples.verdict.tolist()) == {int(Verdict.EMPTY)}
    return [(x, y) for x, y in samples.xy.tolist()]


WIDTHS = [0, 1 / 128, 0.5, 1, 1.5, 2, 3.25, 6]


@examples(34, deadline=None)
@given(worlds, st.sampled_from(WIDTHS))
def test_a_ray_and_the_way_back_meet_the_same_cells(rng: random.Random, width: float) -> None:
    a = some_place(rng)
    b = some_target(rng, a)
    there, back = cells_between(a, b, width), cells_between(b, a, width)
    assert set(there) == set(back) and len(set(there)) == len(there) == len(back)


@examples(27, deadline=None)
@given(worlds)
def test_a_wider_ray_covers_a_narrower_one(rng: random.Random) -> None:
    a = some_place(rng)
    b = some_target(rng, a)
    cells = [set(cells_between(a, b, width)) for width in WIDTHS]
    for narrow, wide in pairwise(cells):
        assert narrow <= wide


TURNS: dict[str, Callable[[Any, Any], Any]] = {
    "left to right": lambda x, y: (-x, y),
    "upside down": lambda x, y: (x, -y),
    "about the diagonal": lambda x, y: (y, x),
    "a quarter": lambda x, y: (-y, x),
    "half": lambda x, y: (-x, -y),
}


def turned_world(battle: Battle, turn: Callable[[Any, Any], Any]) -> Battle:
    bodies = [replace(b, pixels=frozenset(turn(x, y) for x, y in b.pixels)) for b in battle.bodies]
    shots = [replace(s, at=turn(*s.at), toward=turn(*(s.toward or s.at))) for s in battle.shots]
    bounds = battle.bounds
    if bounds:
        (x0, y0), (x1, y1) = turn(*bounds[:2]), turn(*bounds[2:])
        bounds = min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)
    return replace(battle, bodies=bodies, shots=shots, bounds=bounds)


@examples(34, deadline=None)
@given(worlds, st.sampled_from(sorted(TURNS)))
def test_a_mirrored_or_turned_world_is_hit_alike(rng: random.Random, name: str) -> None:
    """Where no limit and no wall choose among cells that are entered at once, all but their order is the same."""
    battle = harmless(some_battle(rng))
    gun = replace(battle.gun, range=None, max_hits=None, sweep=None, spread=None, rounds=None)
    gun = replace(gun, kind="laser") if gun.kind == "pistol" else gun
    shots = [replace(s, toward=some_target(rng, s.at, battle.bodies)) for s in battle.shots]
    bodies = [replace(b, occluder=False) for b in battle.bodies]
    battle = replace(battle, gun=gun, shots=shots, bodies=bodies)
    here, there = battle.fired(), turned_world(battle, TURNS[name]).fired()

    def passes(hits: Hits) -> list[tuple[Any, ...]]:
        names = ("shot", "object", "entry", "exit", "weight", "material")
        samples = {tuple(row[:3:2]): row.samples for row in hits}
        rows = sorted(tuple(row.values()) for row in columns(hits.passes, names))
        return [(*row[:-1], Close(row[-1], 1.0), samples[row[:2]]) for row in rows]

    assert [(*row[:5], row[5].value, row[6]) for row in passes(here)] == passes(there)
    ends = [[(row["reason"], row["fraction"]) for row in columns(h.stop, STOP_COLUMNS)] for h in (here, there)]
    assert [(reason, Close(part)) for reason, part in ends[0]] == ends[1]
    for which in range(len(shots)):
        xy = {tuple(cell) for cell in here.samples_at(which).xy.tolist()}
        assert {TURNS[name](*cell) for cell in xy} == {tuple(c) for c in there.samples_at(which).xy.tolist()}


@examples(34, deadline=None)
@given(worlds, st.sampled_from(sorted(TURNS)))
def test_walls_stop_alike_in_a_mirrored_or_turned_world(rng: random.Random, name: str) -> None:
    """The place of the stop, and all that was entered before it."""
    battle = harmless(some_battle(rng))
    gun = replace(battle.gun, kind="laser", range=None, sweep=None, spread=None, rounds=None)
    shots = [replace(s, toward=some_target(rng, s.at, battle.bodies)) for s in battle.shots]
    battle = replace(battle, gun=gun, shots=shots)

    def answer(hits: Hits) -> tuple[list[Any], list[Any]]:
        stops = [(row["reason"], row["fraction"]) for row in columns(hits.stop, STOP_COLUMNS)]
        rows = columns(hits.passes, ("shot", "object", "entry"))
        return stops, sorted(tuple(row.values()) for row in rows if row["entry"] < stops[row["shot"]][1])

    assert answer(battle.fired()) == answer(turned_world(battle, TURNS[name]).fired())


@examples(34, deadline=None)
@given(worlds)
def test_rows_and_passes_have_a_total_order(rng: random.Random) -> None:
    hits = harmless(some_battle(rng)).fired()
    rows, passes, stops, _ = told(hits)
    keys = [row[:3] for row in rows]
    assert len(set(keys)) == len(keys) and [key[:2] for key in keys] == sorted(key[:2] for key in keys)
    walked = [tuple(row[n] for n in ("shot", "round", "pellet", "order")) for row in passes]
    assert walked == sorted(walked) and len(set(walked)) == len(walked)
    through = [tuple(row[n] for n in ("shot", "round", "pellet", "object")) for row in passes]
    assert len(set(through)) == len(through)
    rays = [tuple(row[n] for n in ("shot", "round", "pellet")) for row in stops]
    assert rays == sorted(rays) and len(set(rays)) == len(rays)
    assert {row[:3] for row in walked} <= set(rays)
    for ray in set(rays):
        mine = [row for row, of in zip(passes, walked, strict=True) if of[:3] == ray]
        assert [row["order"] for row in mine] == list(range(len(mine)))
        assert [row["entry"] for row in mine] == sorted(row["entry"] for row in mine)
    nearest = [min((p["entry_px"], p["pellet"], p["order"]) for p in passes if p["row"] == n) for n in range(len(rows))]
    for a, b, first, second in zip(keys, keys[1:], nearest, nearest[1:], strict=False):
        assert a[:2] != b[:2] or first <= second


def test_cells_past_the_stop_keep_the_order_of_the_walk() -> None:
    for seed in range(150):
        battle = harmless(some_battle(random.Random(seed)))
        hits = battle.fired()
        for which, rays in enumerate(battle.walks()):
            order = [cell for _, walked in rays for cell in walked.order]
            assert [(x, y) for x, y in hits.samples_at(which).xy.tolist()] == order, f"{seed=}"


@examples(34, deadline=None)
@given(worlds)
def test_a_pass_tells_its_row(rng: random.Random) -> None:
    hits = harmless(some_battle(rng)).fired()
    assert hits.passes.row.tolist() == [row["row"] for row in told(hits)[1]]


@examples(34, deadline=None)
@given(worlds)
def test_a_shotgun_of_rays_is_its_pellets_one_by_one(rng: random.Random) -> None:
    battle = harmless(some_battle(rng))
    gun = replace(battle.gun, range=None, sweep=None, rounds=None, spread=(rng.randint(2, 5), rng.randint(4, 20) / 4))
    shots = [replace(s, toward=some_target(rng, s.at, battle.bodies)) for s in battle.shots]
    battle = replace(battle, gun=gun, shots=shots)
    scene = battle.scene()
    whole, single = battle.fired(scene), replace(gun, spread=None)
    rows, passes, stops, verdicts = told(whole)
    for which, shot in enumerate(shots):
        pellets = []
        for _, _, _, (x, y) in battle.rays(which):
            gun = replace(single, range=0) if (x, y) == pair(shot.at) else single
            toward = None if gun.range == 0 else (x / 256, y / 256)
            one = replace(battle, gun=gun, shots=[replace(shot, toward=toward)])
            pellets.append(told(one.fired(scene)))
        alone = [{**row, "shot": which, "pellet": n} for n, p in enumerate(pellets) for row in p[1]]
        assert [{**row, "row": 0} for row in passes if row["shot"] == which] == [{**row, "row": 0} for row in alone]
        ends = [{**row, "shot": which, "pellet": n} for n, p in enumerate(pellets) for row in p[2]]
        assert [row for row in stops if row["shot"] == which] == ends
        assert verdicts[which] == [sum(column) for column in zip(*(p[3][0] for p in pellets), strict=True)]
        for row in (row for row in rows if row[0] == which):
            parts = [part for p in pellets for part in p[0] if part[2] == row[2]]
            assert row[3] == sum(p[3] for p in parts) and row[5] == sum(p[5] for p in parts)
            assert row[6] == len(parts) and max(p[4] for p in parts) <= row[4] <= row[3]
        assert {row[2] for row in rows if row[0] == which} == {part[2] for p in pellets for part in p[0]}


@examples(34, deadline=None)
@given(worlds)
def test_a_budget_is_never_overspent_and_more_of_it_reaches_as_far(rng: random.Random) -> None:
    """What is spent, by the materials of the passes, is the budget where that ends a ray, and else no more."""
    battle = harmless(some_battle(rng))
    bodies = [replace(b, cost=min(b.cost, 9)) for b in battle.bodies]
    gun = replace(battle.gun, kind="rifle", max_hits=None, budget=rng.randint(0, 24) / 4)
    battle = replace(battle, gun=gun, bodies=bodies)
    more = replace(battle, gun=replace(gun, budget=(gun.budget or 0) + 1))
    scene = battle.scene()
    hits, further = battle.fired(scene), more.fired(scene)
    spent: dict[tuple[int, ...], float] = {}
    for row in columns(hits.passes, PASS_COLUMNS):
        ray = row["shot"], row["round"], row["pellet"]
        spent[ray] = spent.get(ray, 0.0) + bodies[row["object"]].cost * row["material"]
    for row in columns(hits.stop, STOP_COLUMNS):
        of = spent.get((row["shot"], row["round"], row["pellet"]), 0.0)
        if row["reason"] == 3:
            assert Close(of, 1.0) == gun.budget
        else:
            assert of <= (gun.budget or 0) * (1 + 1e-12)
    assert np.all(hits.stop.fraction <= further.stop.fraction)


# Small pictures through the whole library


def bar(x0: int, x1: int, y0: int = -1, y1: int = 1, **values: Any) -> Body:
    """A full rectangle, both ends included."""
    return Body(frozenset((x, y) for x in range(x0, x1 + 1) for y in range(y0, y1 + 1)), **values)


@pytest.mark.parametrize("width", [0, 0.5, 1, 4])
def test_a_ray_of_no_length_enters_and_leaves_at_once(width: float) -> None:
    """Also what begins on its border; of a thick one also what it covers on all sides."""
    bodies = [bar(0, 2), bar(-3, -1)]
    for inside, struck in (("hit", [0, 1]), ("ignore_until_exit", [])):
        battle = Battle(Gun(range=0, width=width, inside=inside), [Shot((-0.5, 0.25))], bodies)
        check(battle)
        hits = battle.fired()
        assert sorted(hits.passes.object.tolist()) == struck
        for column in (hits.passes.entry, hits.passes.exit, hits.passes.exit_px, hits.passes.material):
            assert column.tolist() == [0.0] * len(struck)
        assert (hits.stop.reason.tolist(), hits.stop.fraction.tolist(), hits.stop.distance.tolist()) == (
            [0],
            [1.0],
            [0.0],
        )


def test_each_item_is_ignored_until_its_own_first_exit() -> None:
    """The long one while the short one is already met again; what only touches the short one is met at once."""
    short = Body(frozenset({(0, 0), (1, 0), (5, 0), (8, 0)}))
    bodies = [short, bar(0, 3), bar(2, 2), Body(frozenset({(0, 0), (7, 0)}), occluder=True)]
    battle = Battle(Gun(inside="ignore_until_exit"), [Shot((0, 0), (9, 0))], bodies)
    check(battle)
    hits = battle.fired()
    assert dict(zip(hits.passes.object.tolist(), hits.passes.entry_px.tolist(), strict=True)) == {2: 1.5, 0: 4.5}
    assert (hits.stop.item.tolist(), hits.stop.distance.tolist()) == ([3], [6.5])


@pytest.mark.parametrize("width", [0.5, 1, 1.4, 3, 6.5])
def test_times_of_a_thick_ray_are_entered_rounded_up_and_left_rounded_down(width: float) -> None:
    """In parts of its squared length: from when the disc has the centre or the point the square to when neither has."""
    rounded = 0
    for end in ((13.25, 5.5), (-7, 9.125), (11, -0.25)):
        dx, dy = pair(end)
        full, r = dx * dx + dy * dy, round(128 * width)
        for x, y in {(round(end[0] * part), round(end[1] * part) + aside) for part in (0.25, 0.5) for aside in (0, 1)}:
            hits = Battle(Gun(width=width), [Shot((0, 0), end)], [bar(x, x, y, y)]).fired()
            along, cross = 256 * (x * dx + y * dy), 256 * (x * dy - y * dx)
            times = []
            if cross * cross <= r * r * full:
                root = oracle_rays.root(Fraction(r * r * full - cross * cross))
                times.append((along - root, along + root))
            thin = oracle_rays.thin_cells((0, 0), (dx, dy)).get((x, y))
            times += [(full * thin[0], full * thin[1])] if thin else []
            assert len(hits.passes) == bool(times)
            if times:
                entry = max(min(first for first, _ in times), Fraction(0))
                leave = min(max(last for _, last in times), Fraction(full))
                rounded += entry.denominator > 1
                assert hits.passes.entry.tolist() == [math.ceil(entry) / full]
                assert hits.passes.exit.tolist() == [math.floor(leave) / full]
    assert rounded


def test_a_rifle_through_three_boards() -> None:
    boards = [bar(x, x + 1) for x in (2, 5, 8)]
    battle = Battle(Gun("rifle", budget=4.5), [Shot((0, 0), (12, 0))], boards)
    (walked,) = [walked for rays in check(battle) for _, walked in rays]
    assert [one.object for one in walked.passes] == [0, 1, 2]
    hits = battle.fired()
    assert hits.passes.material.tolist() == [2.0, 2.0, 0.5]
    assert hits.passes.exit_px.tolist() == [3.5, 6.5, 8.0]
    assert (hits.stop.reason.tolist(), hits.stop.distance.tolist(), hits.stop.item.tolist()) == ([3], [8.0], [2])
    assert hits.passes.normal_xy.tolist()[0] == list(mask_normal(boards[0].pixels, (2, 0)))


def test_no_ray_passes_a_diagonal_wall() -> None:
    wall = Body(frozenset((i, -i) for i in range(-12, 13)), occluder=True)
    shots = [Shot((-x / 2, -y / 2), (y / 2, x / 2)) for x in range(2, 9) for y in range(2, 9)]
    hits = Battle(Gun(), shots, [wall, bar(-9, 9, -9, 9, layer=-1)]).fired()
    assert set(hits.stop.reason.tolist()) == {1} and set(hits.stop.item.tolist()) == {0}


def test_walls_and_objects_in_one_place() -> None:
    """A wall behind what is hit in the same cell ends the ray there; one in front hides it."""
    for layer, struck in ((1, [0]), (0, []), (-1, [])):
        bodies = [bar(2, 4, layer=layer), bar(2, 2, layer=0, occluder=True), bar(6, 7)]
        battle = Battle(Gun(falloff="linear"), [Shot((0, 0), (9, 0)), Shot((0.5, 0.5), (9, 0.5))], bodies)
        check(battle)
        hits = battle.fired()
        assert hits.object.tolist() == struck * 2 and hits.stop.item.tolist() == [1, 1]


def far_battle(reach: int, slope: float, width: float, name: str) -> Battle:
    """A board at the muzzle, a line off it, and two boards at the far end of a long ray."""
    bodies = [
        bar(3, 4),
        bar(9, min(reach // 2, 30_000), 3, 3),
        bar(reach - 9, reach - 7, -9, 9),
        bar(reach + 1, reach + 3, -9, 9),
    ]
    battle = Battle(Gun("rifle", width=width, budget=99, falloff="linear"), [Shot((0, 0.25), (reach, slope))], bodies)
    return turned_world(battle, TURNS[name])


@pytest.mark.parametrize(
    ("reach", "name"), some_of([*((150, name) for name in TURNS), (2000, "half"), (2000, "a quarter")], 2)
)
@pytest.mark.parametrize("width", [0, pytest.param(2, marks=pytest.mark.long), 6.5])
def test_long_rays(reach: int, width: float, name: str) -> None:
    """As far as products of lengths are large, and the middle of a thick ray does not tell all."""
    for slope in (0.25, 0.25 + 1 / 256, 1.5):
        check(far_battle(reach, slope, width, name))


@pytest.mark.long
@pytest.mark.parametrize(("reach", "width"), [(2**20 - 1, 0), (2**16, 2), (2**16, 9)])
def test_the_longest_rays(reach: int, width: float) -> None:
    check(far_battle(reach, 0.75, width, "left to right"))


@pytest.mark.parametrize(("width", "reach"), in_turn([1 / 128, 0.25, 0.5, 1, 1.25, 1.75], [20, 150, 2000]))
def test_narrow_rays(reach: int, width: float) -> None:
    """Thick, but less than a pixel's diagonal: the square of a cell may last longer than its centre."""
    for slope, name in ((0.25, "half"), (0.25 + 1 / 256, "a quarter"), (1.5, "about the diagonal"), (-2, "half")):
        check(far_battle(reach, slope, width, name))


C_SHAPE = frozenset({(x, y) for x in range(5) for y in (0, 2)} | {(0, 1)})
CORNERS = [bar(2, 4, -1, 9), bar(1, 1, 2, 2), bar(5, 5, 5, 5), bar(5, 5, 6, 6)]
"""What a ray through (1.5, 1.5) and (4.5, 5.5) goes through; its neighbours there: two are but touched at a corner."""

PICTURES = {
    "used up behind the first": (
        Gun("rifle", budget=3), Shot((0, 0), (9, 0)), [bar(2, 4), bar(7, 8)],
    ),
    "used up where the second begins": (Gun("rifle", budget=3), Shot((0, 0), (9, 0)), [bar(2, 4), bar(5, 8)]),
    "used up where a wall begins": (
        Gun("rifle", budget=3), Shot((0, 0), (9, 0)), [bar(2, 4), bar(5, 8, occluder=True)],
    ),
    "used up where the last begins": (
        Gun("rifle", max_hits=2, budget=3), Shot((0, 0), (9, 0)), [bar(2, 4), bar(5, 8)],
    ),
    "used up where the range ends": (
        Gun("rifle", budget=3), Shot((0, 0), (4.5, 0)), [bar(2, 4), bar(5, 6, occluder=True)],
    ),
    "used up, and more to come that is free": (
        Gun("rifle", budget=3), Shot((0, 0), (9, 0)), [bar(2, 4), bar(1, 6, cost=0, layer=1), bar(5, 6, cost=0)],
    ),
    "used up at a corner": (Gun("rifle", budget=5), Shot((0, -0.5), (9, 11.5)), CORNERS),
    "a little left at a corner": (Gun("rifle", budget=5 + 1 / 256), Shot((0, -0.5), (9, 11.5)), CORNERS),
    "used up where a thick ray leaves": (
        Gun("rifle", width=4, budget=6), Shot((0, 0), (12, 0)), [bar(3, 3, 0, 0), bar(5, 5, 0, 0), bar(7, 8)],
    ),
    "used up in a gap of an object": (
        Gun("rifle", budget=1), Shot((0, 0), (9, 0)), [Body(frozenset({(2, 0), (4, 0)}))],
    ),
    "nothing to spend, at a wall": (Gun("rifle", budget=0), Shot((0, 0), (9, 0)), [bar(0, 1, occluder=True)]),
    "nothing to spend, and no length": (Gun("rifle", range=0, budget=0), Shot((0, 0)), [bar(0, 1)]),
    "something to spend, and no length": (Gun("rifle", range=0, budget=1 / 256), Shot((0, 0)), [bar(0, 1)]),
    "used up in the last cell": (Gun("rifle", budget=2.5), Shot((0, 0), (4.25, 0)), [bar(2, 6)]),
    "used up at the end": (Gun("rifle", budget=2.75), Shot((0, 0), (4.25, 0)), [bar(2, 6)]),
    "two in one place, one dearer": (
        Gun("rifle", budget=6), Shot((0, 0), (9, 0)), [bar(1, 4), bar(1, 4, cost=3)],
    ),
    "nothing to spend, on a border": (Gun("rifle", budget=0), Shot((6, 0.5), (7, 0)), [bar(6, 6, 0, 1)]),
    "nothing to spend, and nothing asked": (Gun("rifle", budget=0), Shot((0, 0), (9, 0)), [bar(2, 4, cost=0)]),
    "a border of two rows is one way": (Gun("rifle", budget=2.5), Shot((0, 0.5), (9, 0.5)), [bar(2, 6)]),
    "limit and wall in one cell": (
        Gun("rifle", max_hits=2), Shot((0, 0), (9, 0)),
        [bar(2, 4), bar(5, 6, layer=1), bar(5, 6, occluder=True), bar(5, 6, layer=2)],
    ),
    "hit before, and behind what ends the ray": (
        Gun("pistol"), Shot((0, 0), (9, 0)), [bar(2, 2), bar(2, 3, layer=1)],
    ),
    "an object seen again behind the last one": (
        Gun("rifle", max_hits=2), Shot((0, 0), (9, 0)), [Body(frozenset({(2, 0), (6, 0)})), bar(6, 6)],
    ),
    "a wall at the corner goes before the cells beside it": (
        Gun(), Shot((0, 0), (2, 2)), [Body(frozenset({(1, 0), (0, 1)})), Body(frozenset({(1, 1)}), occluder=True)],
    ),
    "out of a C and into it": (Gun(inside="ignore_until_exit"), Shot((2, 0), (2, 3)), [Body(C_SHAPE)]),
    "out of a C from its border": (Gun(inside="ignore_until_exit"), Shot((2, 0.5), (2, 3)), [Body(C_SHAPE)]),
    "out of a walled C": (Gun(inside="ignore_until_exit"), Shot((2, 0), (2, 3)), [Body(C_SHAPE, occluder=True)]),
    "along a C without leaving it": (Gun(inside="ignore_until_exit"), Shot((3, 0), (-2, 0)), [Body(C_SHAPE)]),
    "in a C that is not entered": (Gun(inside="error"), Shot((2, 1), (2, 1.25)), [Body(C_SHAPE)]),
    "in a C that may not be": (Gun(inside="error"), Shot((2, 0.5), (2, 1)), [Body(C_SHAPE, occluder=True)]),
    "just off a C that may not be entered": (
        Gun(inside="error"), Shot((-0.5 - 1 / 256, 0), (9, 0)), [Body(C_SHAPE), Body(C_SHAPE, occluder=True)],
    ),
    "just off a C that would be ignored": (
        Gun(inside="ignore_until_exit"), Shot((4.5 + 1 / 256, 2), (-1, 2)), [Body(C_SHAPE)],
    ),
    "steps that meet at corners are one stay": (
        Gun(inside="ignore_until_exit"), Shot((0, 0), (4, 4)), [Body(frozenset({(0, 0), (1, 1), (3, 3)}))],
    ),
    "no length, on a corner": (Gun(range=0), Shot((0.5, 0.5)), [bar(0, 0, 0, 0), bar(1, 1, 1, 1), bar(0, 0, 1, 1)]),
    "no length, on a wall's corner": (
        Gun(range=0), Shot((0.5, 0.5)), [bar(1, 1, 1, 1, occluder=True), bar(0, 0, 0, 0)],
    ),
    "one pixel, through a corner": (Gun(), Shot((0, 0), (4, 4)), [bar(2, 2, 2, 2)]),
    "one pixel, from within": (Gun(), Shot((2.25, 2), (4, 4)), [bar(2, 2, 2, 2)]),
    "one pixel, from its border": (Gun(), Shot((1.5, 2), (4, 2.25)), [bar(2, 2, 2, 2)]),
    "two pixels in the middle of a thick ray": (
        Gun(width=4), Shot((0, 0), (9, 3)), [bar(4, 4, 0, 1), bar(6, 6, 4, 4, occluder=True)],
    ),
    "fully off the bounds": (Gun(), Shot((-5, -5), (-2, -1)), [bar(-9, 9, -9, 9)]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "bounds"), in_turn(PICTURES, [None, (0, 0, 9, 9)]))
def test_pictures(name: str, bounds: tuple[int, int, int, int] | None) -> None:
    gun, shot, bodies = PICTURES[name]
    check(Battle(gun, [shot], bodies, bounds))


@pytest.mark.parametrize(("times", "short"), some_of(product([1, 7, 40], [-1, 0, 1]), 2))
@pytest.mark.parametrize("cost", [1, 7])
def test_a_slanted_budget_is_compared_exactly(times: int, cost: int, short: int) -> None:
    """5 px through 3 columns, 3 : 4 down: only 1/256 px more than enough lets the ray meet the second board."""
    boards = [bar(2, 4, -1, 20, cost=cost), bar(7, 9, -1, 20)]
    for name in TURNS:
        shot = Shot((0, 0), (9 * times, 12 * times))
        battle = Battle(Gun("rifle", budget=5 * cost - short / 256), [shot], boards)
        (((_, walked),),) = check(turned_world(battle, TURNS[name])) if times < 40 or name == "half" else battle.walks()
        assert [one.object for one in walked.passes] == ([0] if short >= 0 else [0, 1])
        if not short:
            last = walked.passes[0]
            assert (walked.stop.reason, walked.stop.item, walked.stop.time) == ("budget", 0, last.exit)


def test_a_budget_ends_where_an_object_ends() -> None:
    """Neither a touch at that moment nor what lies beyond is hit; a touch before is."""
    for budget, objects in ((5, [0, 1]), (5 + 1 / 256, [0, 1, 2, 3])):
        hits = Battle(Gun("rifle", budget=budget), [Shot((0, -0.5), (9, 11.5))], CORNERS).fired()
        assert sorted(hits.object.tolist()) == objects
    hits = Battle(Gun("rifle", budget=5), [Shot((0, -0.5), (9, 11.5))], CORNERS).fired()
    assert dict(zip(hits.passes.object.tolist(), hits.passes.material.tolist(), strict=True)) == {0: 5.0, 1: 0.0}
    assert hits.stop.to_rows() == [
        {
            "shot": 0, "round": 0, "pellet": 0, "reason": 3, "item": 0, "cell_xy": [4, 5], "fraction": 0.5,
            "distance": 7.5, "point_xy": [4.5, 5.5], "normal_xy": [0, 0],
        }
    ]  # fmt: skip
    told = {tuple(xy): verdict for xy, verdict in zip(*(v.tolist() for v in hits.samples_at(0)[::3]), strict=True)}
    assert {xy for xy in ((4, 5), (4, 6), (5, 5), (5, 6)) if told[xy] == Verdict.BEYOND} == {(4, 6), (5, 5), (5, 6)}
    assert hits.verdicts.sum() == hits.fired[0] == len(told)


@pytest.mark.parametrize("cost", [3, 7])
@pytest.mark.parametrize("step", [(72, 135), (100, 105), (420, 441)])
def test_a_ray_whose_budget_ends_with_an_object_ends_just_there(step: Pixel, cost: int) -> None:
    """Floats that are worked out from lengths would end a hair before it."""
    columns, length = {72: (8, 17), 100: (20, 29), 420: (20, 29)}[step[0]]
    bodies = [bar(2, 1 + columns, -1, 60, cost=cost), bar(2 + columns, 3 + columns, -1, 60)]
    battle = Battle(Gun("rifle", budget=cost * length), [Shot((0, 0), step)], bodies)
    check(battle, samples=False)
    hits = battle.fired()
    assert hits.stop.fraction.tolist() == hits.passes.exit.tolist() == [(1.5 + columns) / step[0]]
    assert [why[:2] for why in hits.why_not(0)] == [(1, "behind")] and hits.nearest_miss(0) is None


def test_a_budget_used_up_ends_before_what_else_would_end_the_ray() -> None:
    for name in ("where a wall begins", "where the last begins", "where the range ends"):
        gun, shot, bodies = PICTURES[f"used up {name}"]
        stop = Battle(gun, [shot], bodies).fired().stop
        assert (stop.reason.tolist(), stop.item.tolist(), stop.point_xy.tolist()) == ([3], [0], [[4.5, 0.0]])


def test_every_ray_has_its_own_budget() -> None:
    for more in ({"sweep": (0, 3)}, {"spread": (3, 0)}, {"rounds": (3, (0, 0), 0)}):
        gun = Gun("rifle", range=9, budget=3, **more)  # type: ignore[arg-type]
        hits = Battle(gun, [Shot((0, 0))], [bar(2, 4), bar(7, 8)]).fired()
        assert hits.stop.distance.tolist() == [4.5] * 3 and set(hits.object.tolist()) == {0}


@pytest.mark.parametrize("budget", [0, 0.001])
def test_a_budget_of_nothing_is_used_up_at_the_muzzle(budget: float) -> None:
    """Nothing is hit, not even what the ray starts in, at no cost."""
    bodies = [bar(-1, 1, cost=0), bar(-1, 1, occluder=True)]
    hits = Battle(Gun("rifle", range=9, budget=budget), [Shot((0.25, 0))], bodies).fired()
    assert not len(hits) and hits.verdicts.tolist() == [[0, 0, 0, 0, 0, 10]]
    assert (hits.stop.reason.tolist(), hits.stop.item.tolist()) == ([3], [-1])
    assert (hits.stop.cell_xy.tolist(), hits.stop.point_xy.tolist()) == ([[0, 0]], [[0.25, 0.0]])


def test_a_budget_by_a_hair() -> None:
    """On a diagonal n px cost 256 sqrt(2) n c: those nearest to whole numbers, and the budgets on both sides."""

    def off(product: int) -> Fraction:
        whole = 2 * (256 * product) ** 2
        low = math.isqrt(whole)
        return min(Fraction(whole - low**2, 2 * low), Fraction((low + 1) ** 2 - whole, 2 * low))

    pairs = sorted(((c, n) for c in range(1, 256) for n in range(1, 13)), key=lambda pair: off(pair[0] * pair[1]))
    for cost, n in pairs[:12]:
        assert off(cost * n) < Fraction(1, 100)
        low = math.isqrt(2 * (256 * cost * n) ** 2)
        boards = [bar(2, 1 + n, -2, 30, cost=cost), bar(2 + n, 9 + n, -2, 30, cost=0), bar(3 + n, 3 + n, -2, 30)]
        for budget, far in ((low, False), (low + 1, True)):
            battle = Battle(Gun("rifle", budget=budget / 256), [Shot((0, 0), (20, 20))], boards)
            (((_, walked),),) = check(battle)
            assert (len(walked.passes) == 3) == far


def test_far_ends_are_turned_and_rounded_step_by_step() -> None:
    """By the round's recoil, then by its place in the fan; each direction to 2^-30, the end to 1/256 px."""
    for degrees in (0, 45, 11.7, -123.4):
        for around in ({"sweep": (33.3, 5)}, {"spread": (4, 9)}, {}):
            gun = Gun(range=2**20, rounds=(3, (1.5, -0.25), 7.3), **around)  # type: ignore[arg-type]
            battle = Battle(gun, [Shot((0.25, 3), aim=degrees), Shot((-5, 0.5), aim=degrees + 1)])
            ends = [[v / 256 for v in b] for which in (0, 1) for _, _, _, b in battle.rays(which)]
            assert battle.fired().stop.point_xy.tolist() == ends


# Cells, by the million


def test_roots_of_far_and_wide_rays_are_exact() -> None:
    rng = random.Random(8)
    for _ in range(300):
        radius = rng.randint(2, 2 ** rng.randint(2, 28))
        length2 = rng.randint(1, min(2**59, 2**90 // radius**2))
        side = math.isqrt(radius * radius * length2)
        v = [rng.randint(-side, side) for _ in range(20)]
        v += [rng.choice([-1, 1]) * max(side - rng.randint(0, 2 ** rng.randint(0, 40)), 0) for _ in range(20)]
        found = fixed_point.far_roots(radius, np.array(v), np.full(len(v), length2))
        assert found.tolist() == [math.isqrt(radius * radius * length2 - one * one) for one in v]


def test_roots_just_below_a_whole_number_are_exact() -> None:
    rng = random.Random(9)
    for _ in range(300):
        v, root = rng.randint(2**27, 2**28) << 16, (rng.randint(1, 8) << 31) + 1
        length2, rest = divmod(v * v + root * root - 1, 2**32)
        assert rest == 0
        assert fixed_point.far_roots(2**16, np.array([v]), np.array([length2])).tolist() == [root - 1]


def lattice_rays(rng: random.Random, count: int) -> list[tuple[Pixel, Pixel]]:
    """Short rays that end on corners, borders and centres, are aimed at corners, or are any."""

    def end(kind: str) -> Pixel:
        if kind == "any":
            return rng.randint(-700, 700), rng.randint(-700, 700)
        step = {"half": 128, "quarter": 64, "corner": 256}[kind]
        shift = 128 if kind == "corner" else 0
        return tuple(step * rng.randint(-700 // step, 700 // step) + shift for _ in (0, 1))  # type: ignore[return-value]

    kinds = ("half", "half", "quarter", "corner", "any", "aimed")
    rays = []
    for _ in range(count):
        kind = rng.choice(kinds)
        if kind == "aimed":  # through a corner, and as far again or twice beyond it
            a, corner, times = end("any"), end("corner"), rng.randint(1, 3)
            b = tuple(p + times * (q - p) for p, q in zip(a, corner, strict=True))
            rays.append((a, b) if rng.random() < 0.5 else (b, a))
            continue
        a, b = end(kind), end(rng.choice(kinds[:5]))
        rays.append((a, b) if rng.random() < 0.95 else (a, (a[0], b[1])))
    return [(a, b) for a, b in rays if max(abs(p - q) for p, q in zip(a, b, strict=True)) <= 6 * 256]  # type: ignore[misc]


def check_cells(rays: list[tuple[Pixel, Pixel]], shift: Pixel = (0, 0)) -> int:
    """The library's cells of a batch, with their times and order, are those of the whole-number oracle."""
    ray, xy, entry, leave, scales = [], [], [], [], []
    for number, (a, b) in enumerate(rays):
        cells, scale = oracle_rays.thin_times(a, b)
        rows = sorted((entered, y, x, left) for (x, y), (entered, left) in cells.items())
        ray += [number] * len(rows)
        xy += [(x, y) for _, y, x, _ in rows]
        entry += [row[0] for row in rows]
        leave += [row[3] for row in rows]
        scales.append(scale)
    ends = np.array(rays, np.int64) + 256 * np.array(shift)
    *cells, scale = rasterize.cells_of(ends[:, 0], ends[:, 1])
    order = np.lexsort((cells[1][:, 0], cells[1][:, 1], cells[2], cells[0]))
    found = *(column[order] for column in cells), scale
    truth = (ray, np.array(xy) + np.array(shift), entry, leave, scales)
    for name, column, true in zip(("ray", "xy", "entry", "exit", "scale"), found, truth, strict=True):
        np.testing.assert_array_equal(column, true, err_msg=name)
    return len(ray)


def test_cells_of_short_rays() -> None:
    rng = random.Random(0)
    assert check_cells(lattice_rays(rng, 4000)) > 20_000
    for shift in ((FAR, -FAR), (-(2**40) + 20, 2**40 - 20)):
        check_cells(lattice_rays(rng, 300), shift)


@pytest.mark.long
@pytest.mark.parametrize("part", range(10))
def test_cells_of_a_million_rays(part: int) -> None:
    rng = random.Random(part)
    count = 0
    while count < 100_000:
        rays = lattice_rays(rng, 20_000)
        check_cells(rays, rng.choice([(0, 0), (FAR, -FAR)]))
        count += len(rays)


def test_cells_of_longer_rays() -> None:
    rng = random.Random(5)
    rays = []
    for reach in (40, 40, 40, 90):
        rays += [
            (a, (a[0] + x, a[1] + y))
            for a in [(rng.randint(-999, 999), 128)]
            for x, y in [
                (rng.randint(-reach, reach) * 256, rng.randint(-reach, reach) * 128),
                (256 * reach, -256 * reach),
                (reach * 256, 0),
            ]
        ]
    check_cells(rays)


@pytest.mark.long
def test_cells_of_the_longest_rays() -> None:
    """2^20 px along a row or a column, and almost."""
    reach = 2**28
    for a, b in (((0, 128), (reach, 128)), ((-5, 3), (-5 - reach, 300)), ((130, 0), (-130, -reach))):
        assert check_cells([(a, b)]) > 2**20


def test_cells_of_no_rays() -> None:
    none = np.zeros((0, 2), np.int64)
    assert [len(column) for column in rasterize.cells_of(none, none)] == [0] * 5


def test_inputs_are_left_as_they_were() -> None:
    ends = np.array([[[0, 0], [700, -300]], [[128, 128], [128, 128]]], np.int64)
    kept = ends.copy()
    rasterize.cells_of(ends[:, 0], ends[:, 1])
    np.testing.assert_array_equal(ends, kept)
