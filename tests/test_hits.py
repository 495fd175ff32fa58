"""What can be asked of hits: laws of the result, and every derived answer against brute force."""

from __future__ import annotations

import copy
import json
import math
import re
import tracemalloc
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import oracle_shelter
import oracle_stack
import pytest
from some_of import some_of
from test_fire import Battle, Placements, Shot, expected, items_of, parts_of, rounds_of, some_battle, square, told

from hitplanes import (
    ALL,
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
    Rifle,
    Ring,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Verdict,
    Weapon,
    fire,
    prepare,
    report_of,
)
from hitplanes.weapons.fire.hits import HitRow
from hitplanes.weapons.kinds.areas import AreaWeapon

SEEDS = range(0, 600, 6)
MARGIN_SEEDS = range(0, 600, 12)
VERDICT_OF = {verdict.name.lower(): verdict for verdict in Verdict if verdict is not Verdict.BEYOND}


def fired(seed: int) -> tuple[Battle, Scene, Hits]:
    battle = some_battle(seed)
    scene = battle.scene()
    return battle, scene, battle.volley.fired(scene)


def wide(seed: int) -> tuple[Battle, Scene, Hits]:
    """The same, its objects four times as far apart, some of them out of sight."""
    battle = some_battle(seed)
    battle.objects = [
        (sprite, tuple(4 * p - 3 * at for p, at in zip(place, battle.volley.shots[0].at, strict=True)), pose)  # type: ignore[misc]
        for sprite, place, pose in battle.objects
    ]
    scene = battle.scene()
    return battle, scene, battle.volley.fired(scene)


def samples_of(volley: Placements, shot: Shot) -> list[tuple[int, int, int, int]]:
    """Samples of one shot as (round, pellet, y, x), in that order."""
    every = rounds_of(volley.weapon, shot.at, shot.aim, shot.toward, volley.seed, shot.number)
    return sorted(
        (number, pellet, y, x)
        for number, (_, pellets) in enumerate(every)
        for pellet, (_, samples) in enumerate(pellets)
        for (x, y), _ in samples
    )


def walks_of(battle: Battle, scene: Scene, shot: Shot) -> list[oracle_shelter.ShelteredWalk]:
    """The oracle's walk of every sample of one shot; what shelters a sample has ended it."""
    items, plain, owns = items_of(scene), parts_of(battle.volley.weapon)[2], pellets_of(battle.volley, shot)
    walks = []
    for number, pellet, y, x in samples_of(battle.volley, shot):
        walk = oracle_shelter.judge(
            items, owns[number, pellet], (x, y), line_of_sight=plain.line_of_sight, inside=plain.inside,
            accept=shot.accept, blocked_by=shot.blocked_by, exclude=shot.exclude, pierce=plain.pierce,
            bounds=scene.bounds,
        )  # fmt: skip
        walk.ended_by = walk.sheltered_by or walk.ended_by
        walks.append(walk)
    return walks


def pellets_of(volley: Placements, shot: Shot) -> dict[tuple[int, int], tuple[int, int]]:
    """The own pixel of each (round, pellet) of one shot."""
    every = rounds_of(volley.weapon, shot.at, shot.aim, shot.toward, volley.seed, shot.number)
    return {(n, k): own for n, (_, pellets) in enumerate(every) for k, (own, _) in enumerate(pellets)}


def pierced(battle: Battle) -> bool:
    return parts_of(battle.volley.weapon)[2].pierce


# Laws of the result


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_rows_by_shot(seed: int) -> None:
    battle, _, hits = fired(seed)
    rows = list(hits)
    assert len(hits) == len(rows) and bool(hits) == bool(rows)
    assert hits.starts.shape == (len(battle.volley.shots) + 1,)
    assert (hits.starts[0], hits.starts[-1]) == (0, len(rows))
    assert [row for i in range(len(battle.volley.shots)) for row in hits.of(i)] == rows
    assert all(row.shot == i for i in range(len(battle.volley.shots)) for row in hits.of(i))
    for name in ("shot", "round", "object", "samples", "pixels", "weight", "pellets", "distance2"):
        column = getattr(hits, name)
        assert column.dtype == np.int64 and column.tolist() == [getattr(row, name) for row in rows]
    assert hits.first_xy.tolist() == [list(row.first_xy) for row in rows]


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_rows_have_a_total_order(seed: int) -> None:
    _, scene, hits = fired(seed)
    place = {int(item): i for i, item in enumerate(scene.items.stack().ids)}
    keys = [(r.shot, r.round, r.distance2, r.first_xy[1], r.first_xy[0], place[r.object]) for r in hits]
    assert keys == sorted(keys) and len(set(keys)) == len(keys)


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_verdicts_add_up_to_the_samples_fired(seed: int) -> None:
    battle, _, hits = fired(seed)
    fired_samples = [len(samples_of(battle.volley, shot)) for shot in battle.volley.shots]
    assert hits.fired.tolist() == fired_samples
    each = [hits.verdict_counts(i) for i in range(len(fired_samples))]
    assert [sum(counts.values()) for counts in each] == fired_samples
    assert hits.verdict_counts() == {name: sum(counts[name] for counts in each) for name in VERDICT_OF}
    for i, counts in enumerate(each):
        samples = sum(row.samples for row in hits.of(i))
        assert samples >= counts["hit"] if pierced(battle) else samples == counts["hit"]
    for row in hits:
        assert 1 <= row.pellets <= row.samples and 1 <= row.pixels <= row.samples
        assert 0 <= row.weight <= 65535 * row.samples


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_bodies_add_up(seed: int) -> None:
    """A body has the sums of its rows, the nearest of its pixels, and each of its pellets once."""
    battle, scene, hits = fired(seed)
    keys = list(dict.fromkeys((row.shot, int(scene.owner(row.object))) for row in hits))
    bodies = hits.by_owner()
    assert [(body.shot, body.owner) for body in bodies] == keys
    for body in bodies:
        rows = [r for r in hits.of(body.shot) if scene.owner(r.object) == body.owner]
        for name in ("samples", "pixels", "weight"):
            assert getattr(body, name) == sum(getattr(row, name) for row in rows)
        assert body.objects == tuple(dict.fromkeys(row.object for row in rows))
        nearest = sorted((row.distance2, row.first_xy[1], row.first_xy[0]) for row in rows)[0]
        assert (body.distance2, *body.first_xy[::-1]) == nearest
    for shot, one in enumerate(battle.volley.shots):
        pairs = zip(samples_of(battle.volley, one), walks_of(battle, scene, one), strict=True)
        struck = {(item.owner, *sample[:2]) for sample, walk in pairs for item in walk.hit}
        truth = Counter(owner for owner, _, _ in struck)
        assert {body.owner: body.pellets for body in bodies if body.shot == shot} == truth


def test_a_pellet_that_hits_two_parts_of_a_body_is_one_pellet() -> None:
    scene = Scene()
    body = scene.add(square(4), (0, 0))
    scene.add(square(4), (4, 0), owner=body)
    for pellet in (Disc(6), Pistol(9), Laser(9)):
        hits = fire(scene, Rounds(Spread(pellet, 3, 0), 2), (-1, 1), aim=0)
        (one,) = hits.by_owner()
        parts = 1 if isinstance(pellet, Pistol) and not isinstance(pellet, Laser) else len(one.objects)
        assert hits.pellets.tolist() == [3] * 2 * parts and one.pellets == 6
        (one,) = fire(scene, Rounds(pellet, 2), (-1, 1), aim=0).by_owner()
        assert one.pellets == 2


def test_owners_are_one_level_deep() -> None:
    """A wheel is a part of its car, and none of the driver whose part the car is."""
    scene = Scene()
    driver = scene.add(Sprite.box(3, 3), (0, 0))
    car = scene.add(Sprite.box(3, 3), (0, 9), owner=driver)
    wheel = scene.add(Sprite.box(3, 3), (0, 18), owner=car)
    for weapon in (Box(3, 60), Laser(60)):
        shot: dict[str, Any] = {"at": (0, -5), "aim": 90} if isinstance(weapon, Laser) else {"at": (0, 0)}
        bodies = [(body.owner, body.objects) for body in fire(scene, weapon, **shot).by_owner()]
        assert bodies == [(driver, (driver, car)), (car, (wheel,))]
        for owner, left in ((driver, [wheel]), (car, [driver, car])):
            assert fire(scene, weapon, **shot, exclude=[owner]).object.tolist() == left


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_json(seed: int) -> None:
    _, _, hits = fired(seed)
    data = json.loads(json.dumps(hits.to_dict(), allow_nan=False))
    assert data["rows"] == hits.to_rows() and hits.to_rows() == [
        row._asdict() | {"first_xy": list(row.first_xy)} for row in hits
    ]
    rows = [tuple({**row, "first_xy": tuple(row["first_xy"])}.values()) for row in data["rows"]]
    assert rows == [tuple(row) for row in hits]
    assert all(tuple(row) == type(one)._fields for row, one in zip(data["rows"], hits, strict=True))
    assert data["verdicts"] == [hits.verdict_counts(i) for i in range(len(hits.shots))]
    assert data["plan"] == hits.plan.to_dict()


def test_equality_leaves_out_plan_and_version() -> None:
    scene = Scene((9, 9))
    item = scene.add(square(5), (1, 1))
    direct, composed = (fire(scene, Disc(2), (3, 3), strategy=s) for s in ("direct", "built"))
    assert direct == composed and direct.plan != composed.plan
    scene.move(item, (1, 1))
    again = fire(scene, Disc(2), (3, 3))
    assert again == direct and again.version != direct.version
    assert direct != fire(scene, Disc(2), (3, 4))
    assert direct != fire(scene, Disc(2), [(3, 3), (8, 8)])
    for name in ("samples", "first_xy", "weight", "verdicts", "object"):
        other = copy.copy(direct)
        setattr(other, name, getattr(direct, name) + 1)
        assert other != direct, name
    assert direct != [*direct] and direct != 1
    with pytest.raises(TypeError):
        hash(direct)
    assert "1 rows of 1 shots" in repr(direct)


def test_what_is_not_a_shot_of_the_batch() -> None:
    hits = fire(Scene(), Point(), [(0, 0), (1, 1)])
    for number in (2, -1, 0.5, "0", True):
        for call in (hits.of, hits.verdict_counts, hits.samples_at, hits.why_not, hits.blockers, hits.margins):
            with pytest.raises(InputError, match="shot"):
                call(number)


# Derived answers against brute force


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_samples_at(seed: int) -> None:
    battle, scene, hits = fired(seed)
    for i, shot in enumerate(battle.volley.shots):
        walks = walks_of(battle, scene, shot)
        decided = [(*walk.hit, *filter(None, [walk.ended_by]), *walk.skipped) for walk in walks]
        found = hits.samples_at(i)
        assert list(zip(found.round, found.pellet, found.xy[:, 1], found.xy[:, 0], strict=True)) == samples_of(
            battle.volley, shot
        )
        assert found.verdict.tolist() == [VERDICT_OF[walk.verdict] for walk in walks]
        assert found.item.tolist() == [by[0].id if by else -1 for by in decided]


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_blockers(seed: int) -> None:
    battle, scene, hits = fired(seed)
    for i, shot in enumerate(battle.volley.shots):
        walks = walks_of(battle, scene, shot)
        counts = Counter(w.ended_by.id for w in walks if w.ended_by and (w.ended_by.occluder or w.sheltered_by))
        found = hits.blockers(i)
        assert [entry[:2] for entry in found] == sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_blockers_name_what_is_behind_them(seed: int) -> None:
    battle, scene, hits = fired(seed)
    items = oracle_stack.front_to_back(items_of(scene))
    for i, shot in enumerate(battle.volley.shots):
        behind: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for walk, (*_, y, x) in zip(walks_of(battle, scene, shot), samples_of(battle.volley, shot), strict=True):
            wall = walk.ended_by
            if wall is None or not (wall.occluder or walk.sheltered_by):
                continue
            behind_it = items[items.index(wall) + 1 :] if walk.sheltered_by is None else set(items) - {wall}
            for item in behind_it:
                refused = oracle_stack.refused(item, shot.accept, shot.blocked_by, shot.exclude)
                if not item.occluder and not refused and (x, y) in item.pixels:
                    behind.setdefault((wall.id, item.id), []).append((x, y))
        found = {(b.occluder, o.object): o for b in hits.blockers(i) for o in b.behind}
        assert {pair: hidden.samples for pair, hidden in found.items()} == {p: len(at) for p, at in behind.items()}
        for pair, hidden in found.items():
            middle = [sum(v) // len(v) for v in zip(*behind[pair], strict=True)]
            away = [(x - middle[0]) ** 2 + (y - middle[1]) ** 2 for x, y in behind[pair]]
            x, y = hidden.at_xy
            assert hidden.at_xy in behind[pair] and (x - middle[0]) ** 2 + (y - middle[1]) ** 2 == min(away)
        for blocked in hits.blockers(i):
            assert list(blocked.behind) == sorted(blocked.behind, key=lambda b: (-b.samples, b.object))


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_pixels_at(seed: int) -> None:
    battle, scene, hits = fired(seed)
    for i, shot in enumerate(battle.volley.shots):
        struck: dict[tuple[int, int], set[tuple[int, int]]] = {}
        for walk, (number, _, y, x) in zip(walks_of(battle, scene, shot), samples_of(battle.volley, shot), strict=True):
            for item in walk.hit:
                struck.setdefault((number, item.id), set()).add((x, y))
        found = hits.pixels_at(i)
        assert {key: {tuple(p) for p in spans.pixels().tolist()} for key, spans in found.items()} == struck
        assert {(row.round, row.object): row.pixels for row in hits.of(i)} == {k: s.count for k, s in found.items()}


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_shares(seed: int) -> None:
    battle, scene, hits = fired(seed)
    items = {item.id: item for item in items_of(scene)}
    shares = hits.shares()
    assert len(shares) == len(hits)
    for row, share in zip(hits, shares, strict=True):
        shot, item = battle.volley.shots[row.shot], items[row.object]
        in_round = sum(number == row.round for number, *_ in samples_of(battle.volley, shot))
        visible = exposed = 0
        plain = parts_of(battle.volley.weapon)[2]
        how: dict[str, Any] = {"accept": shot.accept, "blocked_by": shot.blocked_by, "exclude": shot.exclude}
        blocking = oracle_shelter.blockers(list(items.values()), plain.line_of_sight, **how)
        owns = {own for (n, _), own in pellets_of(battle.volley, shot).items() if n == row.round}
        for pixel in item.pixels:
            walk = oracle_stack.at_pixel(
                list(items.values()), pixel, accept=shot.accept, blocked_by=shot.blocked_by, exclude=shot.exclude,
                pierce=pierced(battle), bounds=scene.bounds,
            )  # fmt: skip
            visible += item in walk.hit
            if item in walk.hit and plain.line_of_sight:
                shelters = (
                    oracle_shelter.shelters(blocking, own, pixel, inside=plain.inside, bounds=scene.bounds)
                    for own in owns
                )
                exposed += any({by.id for by in every} <= {item.id} for every in shelters)
        assert share[:3] == (row.samples / in_round, row.pixels / visible, row.pixels / len(item.pixels))
        assert share.exposed == (exposed / visible if plain.line_of_sight else None)
        assert max(share[:3]) <= 1


def why_not(battle: Battle, scene: Scene, which: int, hit: set[int]) -> list[tuple[Any, ...]]:
    """What `why_not` answers, from the walk of every sample."""
    shot = battle.volley.shots[which]
    samples = np.array([(x, y) for _, _, y, x in samples_of(battle.volley, shot)]).reshape(-1, 2)
    walks = walks_of(battle, scene, shot)
    found = []
    for item in items_of(scene):
        if item.occluder or item.id in hit or not item.pixels or not len(samples):
            continue
        x, y, x_max, y_max = scene.bounds or (-math.inf, -math.inf, math.inf, math.inf)
        reached = sorted(at for at in item.pixels if x <= at[0] <= x_max and y <= at[1] <= y_max)
        pixels = np.array(reached or sorted(item.pixels))
        distance2 = int(((samples[:, None] - pixels[None]) ** 2).sum(axis=-1).min())
        if not {*map(tuple, samples.tolist())}.isdisjoint(item.pixels):
            distance2 = 0
        if distance2 > 32**2:
            continue
        on = [walk for walk, xy in zip(walks, samples.tolist(), strict=True) if tuple(xy) in item.pixels]
        ended = Counter(walk.ended_by.id for walk in on if walk.ended_by is not None)
        if oracle_stack.refused(item, shot.accept, shot.blocked_by, shot.exclude):
            reason = "excluded" if item.categories & shot.accept else "category"
        elif not reached:
            reason = "outside"
        elif not on:
            reason = "missed"
        else:
            reason = "outside" if all(walk.verdict == "outside" for walk in on) else "behind"
        found.append((math.sqrt(distance2), item.id, reason, len(on), dict(ended)))
    return sorted(found, key=lambda why: why[:2])


def check_why_not(battle: Battle, scene: Scene, hits: Hits) -> Counter[str]:
    """Compare, and return how often each reason came up."""
    reasons: Counter[str] = Counter()
    for which in range(len(battle.volley.shots)):
        truth = why_not(battle, scene, which, {row.object for row in hits.of(which)})
        found = [(why.distance, why.object, why.reason, why.samples, why.by) for why in hits.why_not(which)]
        assert found == truth
        reasons.update(why[2] for why in found)
    return reasons


@cache
def checked_reasons(seed: int) -> Counter[str]:
    return check_why_not(*fired(seed)) + check_why_not(*wide(seed))


@pytest.mark.parametrize("seed", some_of(SEEDS, 4))
def test_why_not(seed: int) -> None:
    checked_reasons(seed)


def test_why_not_behind_what_was_pierced() -> None:
    """Front to back: an object that is pierced, a wall that ends the walk, an object that is not reached."""
    scene = Scene()
    behind = scene.add(square(3))
    wall = scene.add(square(3), layer=1, role="occluder")
    front = scene.add(square(3), layer=2)
    hits = fire(scene, Disc(1, pierce=True), (1, 1))
    assert hits.object.tolist() == [front]
    assert hits.why_not() == [(behind, "behind", 5, {wall: 5}, 0.0)] and hits.blockers() == [
        (wall, 5, ((behind, 5, (1, 1)),))
    ]


def test_every_reason_comes_up() -> None:
    reasons = sum(map(checked_reasons, SEEDS), Counter())
    assert set(reasons) == {"missed", "category", "excluded", "behind", "outside"}
    assert min(reasons.values()) >= 5, reasons


def test_why_not_tells_each_reason() -> None:
    """One object for each reason, at distances that are known."""
    scene = Scene((60, 20))
    hit = scene.add(square(2), (10, 10))
    wall = scene.add(square(2), (12, 10), role="occluder", layer=1)
    behind = scene.add(square(2), (12, 10))
    foreign = scene.add(square(1), (9, 10), categories=2)
    own = scene.add(square(1), (8, 10))
    outside = scene.add(square(1), (11, -2))
    missed = scene.add(square(1), (15, 14))
    at_32 = scene.add(square(1), (45, 10))
    scene.add(square(1), (46, 9))
    hits = fire(scene, Polygon([(-3, -12), (3, -12), (3, 0), (-3, 0)]), (10, 10), accept=ALL & ~2, exclude=own)
    assert hits.object.tolist() == [hit] and hits.blockers() == [(wall, 2, ((behind, 2, (12, 10)),))]
    assert hits.why_not() == [
        (behind, "behind", 2, {wall: 2}, 0.0),
        (foreign, "category", 1, {}, 0.0),
        (own, "excluded", 1, {}, 0.0),
        (outside, "outside", 1, {}, 0.0),
        (missed, "missed", 0, {}, math.sqrt(2**2 + 4**2)),
        (at_32, "missed", 0, {}, 32.0),
    ]


def hit_at_shifts(volley: Placements, scene: Scene, which: int) -> dict[tuple[int, int], set[int]]:
    """Objects hit when one shot is fired elsewhere, for all whole-pixel shifts of up to 8 px."""
    shot = volley.shots[which]
    shifts = [(dx, dy) for dx in range(-8, 9) for dy in range(-8, 9) if dx * dx + dy * dy <= 64]
    moved = []
    for dx, dy in shifts:
        target = None if shot.toward is None else (shot.toward[0] + dx, shot.toward[1] + dy)
        moved.append(replace(shot, at=(shot.at[0] + dx, shot.at[1] + dy), toward=target))
    hits = Placements(volley.weapon, moved, volley.seed).fired(scene)
    return {shift: {row.object for row in hits.of(i)} for i, shift in enumerate(shifts)}


@pytest.mark.parametrize("seed", some_of(MARGIN_SEEDS))
def test_margins(seed: int) -> None:
    battle, scene, hits = fired(seed)
    for which in range(len(battle.volley.shots)):
        by_shift = hit_at_shifts(battle.volley, scene, which)
        still = by_shift[0, 0]
        truth: dict[int, tuple[int, int, int]] = {}
        for (dx, dy), objects in by_shift.items():
            for item in objects ^ still:
                truth[item] = min(truth.get(item, (99, 0, 0)), (dx * dx + dy * dy, dy, dx))
        told = [(which, item, item in still, math.sqrt(n), (dx, dy)) for item, (n, dy, dx) in sorted(truth.items())]
        assert hits.margins(which) == told
        assert [margin.fragile for margin in hits.margins(which)] == [n <= 1 for _, (n, _, _) in sorted(truth.items())]
    assert hits.margins() == [m for which in range(len(battle.volley.shots)) for m in hits.margins(which)]


def test_margins_of_a_small_picture() -> None:
    """A 3x3 object shot in its middle is lost after 2 px; one 8 px away is found after 8, one 9 px away is not."""
    scene = Scene()
    middle, near = scene.add(square(3), (-1, -1)), scene.add(square(1), (8, 0))
    scene.add(square(1), (0, 9))
    assert fire(scene, Point(), (0, 0)).margins() == [(0, middle, True, 2.0, (0, -2)), (0, near, False, 8.0, (8, 0))]


# Extremes


GIANTS = [
    (Disc(2**20), (5, 5)),
    (Disc(2**20), (2**20 + 12, 10)),
    (Ring(2**19, 2**20), (2**19 + 10, 10)),
    (Cone(2**18, 90), (-5, 10)),
    (Beam(2**20, 0), (-5, 12)),
    (Beam(2**20 - 1, 2), (-(2**19), 12)),
    (Box(2**20, 3), (0, 11)),
]


@pytest.mark.parametrize("bounded", [True, pytest.param(False, marks=pytest.mark.long)])
@pytest.mark.parametrize("weapon, at", GIANTS, ids=lambda v: getattr(v, "kind", str(v)))
def test_giant_patterns(weapon: Any, at: tuple[int, int], bounded: bool) -> None:
    """Of a pattern of up to 10^12 samples only those are walked or read that a scene of 40 x 30 px can meet."""
    scene = Scene((40, 30) if bounded else None)
    a, b = scene.add(square(5), (10, 10)), scene.add(square(5), (20, 10))
    scene.add(square(2, 5), (20, 10), role="occluder", layer=1)
    spans = weapon.spans(2**30, 0)
    results = [fire(scene, weapon, at, strategy=s) for s in (("direct", "built") if bounded else ("direct",))]
    shares = results[0].shares()
    assert all(
        stage.bytes_made <= 8 * 40 * 30 for hits in results for stage in hits.plan.ran if stage.name != "patterns"
    )
    assert all(hits == results[0] for hits in results)
    counts = {}
    for item, x_first in ((a, 10), (b, 22)):
        on_row = (spans.y + at[1] >= 10) & (spans.y + at[1] <= 14)
        x = np.minimum(spans.x_last + at[0], 14 if item == a else 24) - np.maximum(spans.x_first + at[0], x_first) + 1
        counts[item] = int(np.maximum(x, 0)[on_row].sum())
    assert {row.object: row.samples for row in results[0]} == {item: n for item, n in counts.items() if n}
    assert sum(counts.values()) > 0
    assert int(results[0].fired[0]) == spans.count == sum(results[0].verdict_counts().values())
    for row, share in zip(results[0], shares, strict=True):
        assert share.of_pattern == row.samples / spans.count


def test_margins_of_a_large_pattern_need_little_memory() -> None:
    scene = Scene((40, 30))
    item = scene.add(square(5), (10, 10))
    hits = fire(scene, Disc(2**13), (2**13 + 12, 12))
    tracemalloc.start()
    try:
        assert [margin[1:4] for margin in hits.margins()] == [(item, True, 3.0)]
        assert tracemalloc.get_traced_memory()[1] < 64 * 2**20
    finally:
        tracemalloc.stop()


def test_too_many_samples_are_refused_not_tried() -> None:
    hits = fire(Scene((40, 30)), Disc(2**20), (0, 0))
    for call in (hits.samples_at, hits.why_not, hits.blockers):
        with pytest.raises(InputError, match="samples: expected a shot of at most"):
            call()


@pytest.mark.parametrize("x", [-(2**40), 2**40])
@pytest.mark.parametrize("y", [-(2**40), 2**40])
@pytest.mark.parametrize("bounded", [True, False])
def test_the_ends_of_the_world(x: int, y: int, bounded: bool) -> None:
    """All that can be asked near the origin can be asked there, with the same answer."""
    answers = []
    for left, top in ((0, 0), (x, y)):
        scene = Scene((20, 20) if bounded else None, (max(left - 10, -(2**40)), max(top - 10, -(2**40))))
        if not left:
            scene = Scene((20, 20) if bounded else None, (-10 if x > 0 else 0, -10 if y > 0 else 0))
        scene.add(square(3), (left, top))
        scene.add(square(2), (left, top), role="occluder", layer=1, categories=3)
        scene.add(square(1), (left, top))
        volley = Placements(Rounds(Spread(Disc(2, falloff="linear"), 3, 2), 2, (0.5, 0)), [Shot((left, top))] * 2)
        hits = volley.fired(scene)
        assert told(hits) == expected(scene, volley)
        rows = [(*row[:7], (row.first_xy[0] - left, row.first_xy[1] - top), row.distance2) for row in hits]
        behind = [[(*o[:2], o.at_xy[0] - left, o.at_xy[1] - top) for o in b.behind] for b in hits.blockers()]
        blocked = [b[:2] for b in hits.blockers()], behind
        bodies = [(*b[:6], (b.first_xy[0] - left, b.first_xy[1] - top), *b[7:]) for b in hits.by_owner()]
        derived = (hits.shares(), hits.why_not(), blocked, hits.margins(), bodies)
        answers.append((rows, hits.verdict_counts(), derived, hits.samples_at().xy - (left, top)))
    assert answers[0][:3] == answers[1][:3]
    np.testing.assert_array_equal(answers[0][3], answers[1][3])


def test_far_apart_in_one_batch() -> None:
    scene = Scene()
    ends = [(-(2**40), 2**40), (0, 0), (2**40, -(2**40))]
    ids = [scene.add(square(1), end) for end in ends]
    hits = fire(scene, Spread(Disc(1), 2, 1), ends)
    assert hits.object.tolist() == ids
    assert told(hits) == expected(scene, Placements(hits.weapon, [Shot(end, number=i) for i, end in enumerate(ends)]))


@pytest.mark.parametrize("weapon", [Point(), Beam(5, 1), Spread(Disc(2), 3, 2), Rounds(Beam(3, 1), 2, (1, 0), 5.0)])
@pytest.mark.parametrize("strategy", ["auto", "direct", "built"])
def test_no_shots(weapon: Any, strategy: str) -> None:
    scene = Scene((9, 9))
    scene.add(square(3), (3, 3))
    at = np.zeros((0, 2))
    hits = fire(scene, weapon, at, strategy=strategy)
    assert not hits and hits.starts.tolist() == [0] and hits.verdicts.shape == (0, 5) and hits.first_xy.shape == (0, 2)
    assert (
        list(hits) == hits.by_owner() == hits.shares() == hits.margins() == []
        and sum(hits.verdict_counts().values()) == 0
    )
    assert json.loads(json.dumps(hits.to_dict()))["rows"] == []
    assert hits == fire(scene, weapon, at, toward=np.zeros((0, 2)), accept=[], exclude=np.zeros((0, 1)), shot=[])
    with pytest.raises(InputError, match="shot"):
        hits.of(0)


@pytest.mark.parametrize("bounded", [True, False])
def test_an_empty_scene(bounded: bool) -> None:
    """Nothing at all, nothing that decides, nothing of any pixel, or nothing any more: nothing is hit."""
    scene = Scene((9, 9) if bounded else None)
    for change in (
        lambda: None,
        lambda: scene.add(square(3), role="mover"),
        lambda: scene.add(np.zeros((3, 3), bool)),
        lambda: scene.remove(scene.add(square(3))),
    ):
        change()
        for strategy in ("auto", "direct", *(["built"] if bounded else [])):
            hits = fire(scene, Disc(3, pierce=True), [(4, 4), (0, 0)], strategy=strategy)
            assert not hits and hits.verdicts[:, 1:4].sum() == 0 and hits.fired.tolist() == [29, 29]
            assert hits.margins() == hits.why_not() == hits.blockers() == hits.shares() == []


def test_a_pattern_of_no_pixel() -> None:
    scene = Scene((9, 9))
    scene.add(square(9))
    for strategy in ("direct", "built"):
        hits = fire(scene, Stencil([".."], falloff="linear"), (4, 4), strategy=strategy)
        assert not hits and hits.fired.tolist() == [0]
        assert hits.why_not() == hits.shares() == hits.margins() == [] and len(hits.samples_at().xy) == 0


# The plan


def stages(hits: Hits) -> tuple[dict[str, str], dict[str, str], dict[str, int]]:
    """Why each stage ran, why each was left out, and the bytes made."""
    ran = {stage.name: stage.why for stage in hits.plan.ran}
    return ran, {s.name: s.why for s in hits.plan.left_out}, {s.name: s.bytes_made for s in hits.plan.ran}


BEGIN = ["shots", "stack", "plan", "patterns"]


def test_direct_makes_no_plane() -> None:
    scene = Scene((50, 40))
    scene.add(square(5), (3, 3))
    ran, left_out, _ = stages(fire(scene, Disc(3), (4, 4), strategy="direct"))
    plane = scene.derived.label_plane()
    assert plane is not None and plane.labels is None
    assert list(ran) == ["shots", "stack", "plan", "tiles", "patterns", "samples", "rows"]
    assert left_out["visible set"] == left_out["label plane"] == "tiles needs none"
    ran, left_out, _ = stages(fire(scene, Disc(3, falloff="linear"), (4, 4), strategy="direct"))
    assert plane.labels is None
    assert list(ran) == ["shots", "stack", "plan", "tiles", "patterns", "weights", "samples", "rows"]
    ran, left_out, _ = stages(fire(scene, Disc(3, falloff="linear"), (4, 4), strategy="spans"))
    assert list(ran) == [*BEGIN, "weights", "verdicts", "outside", "pre-filter", "samples", "walk", "rows"]
    assert left_out["visible set"] == left_out["label plane"] == "spans needs none"


def test_labels_tell_what_was_drawn() -> None:
    scene = Scene((50, 40))
    item = scene.add(square(5), (3, 3))
    made = []
    for change in (lambda: None, lambda: None, lambda: scene.move(item, (20, 20)), lambda: scene.move(item, (0, 0))):
        change()
        ran, left_out, bytes_made = stages(fire(scene, Point(), (4, 4), strategy="built"))
        assert list(ran) == ["shots", "stack", "plan", "label plane", "samples", "rows"]
        assert left_out["patterns"] == "each shot is one pixel"
        made.append(bytes_made["label plane"])
    assert made == [2 * 50 * 40, 0, 2 * 2 * 25, 2 * 2 * 25]


def test_composed_bit_rows_tell_what_they_made() -> None:
    scene = Scene((50, 40))
    item = scene.add(square(5), (3, 3))
    made = []
    for change in (lambda: None, lambda: None, lambda: scene.move(item, (20, 20))):
        change()
        ran, left_out, bytes_made = stages(fire(scene, Disc(3), (4, 4), strategy="built"))
        assert list(ran)[:5] == ["shots", "stack", "plan", "visible set", "patterns"]
        assert list(ran)[5:] == ["pre-filter", "samples", "rows"] and "verdicts" in left_out
        made.append(bytes_made["visible set"])
    assert made[0] == made[2] > 0 == made[1]


def test_what_a_scene_does_not_need_is_left_out() -> None:
    scene = Scene()
    hits = fire(scene, Disc(3), (4, 4))
    _, left_out, bytes_made = stages(hits)
    unused = {"weights", "outside", "occluders", "layers", "filter", "broad phase", "volumes"}
    unused |= {"visible set", "label plane"}
    assert unused | {"verdicts"} == set(left_out) and bytes_made["patterns"] > 0
    _, left_out, bytes_made = stages(fire(scene, Disc(3, falloff="linear"), (4, 4), strategy="spans"))
    assert unused - {"weights"} | {"pre-filter", "walk"} == set(left_out) and bytes_made["patterns"] > 0
    for role in ("background", "mover", "hud"):
        scene.add(square(3), role=role)
    assert {"background", "mover", "hud"} <= set(stages(fire(scene, Disc(3), (4, 4)))[1])
    scene.add(square(3), role="occluder")
    ran, left_out, _ = stages(fire(scene, Disc(3, falloff="linear"), (4, 4), strategy="spans"))
    assert "walk" in ran and not {"weights", "occluders", "walk"} & set(left_out)
    bounded = Scene((9, 9))
    assert "outside" not in stages(fire(bounded, Disc(3), (4, 4)))[1]


def way(hits: Hits) -> str:
    """The way that answered a call, and why."""
    return stages(hits)[0]["plan"]


@pytest.mark.usefixtures("fixed_costs")
def test_auto_makes_what_pays_and_says_why() -> None:
    """A hundred shots are not worth a visible set, 4000 are; what is there is read, but for a few shots."""
    scene = Scene((64, 64))
    for number in range(200):
        scene.add(square(9), (number * 7 % 64, number * 11 % 64), layer=number % 5)
    at = np.stack([np.arange(4000) % 64, np.arange(4000) // 64], axis=1)
    for weapon in (Disc(8), Disc(8, falloff="linear")):
        scene.move(0, (1, 1))
        scene.move(0, (0, 0))
        assert re.fullmatch(r"tiles: visible would take \d+ us to make, \d+ us lost so far; about \d+ us",
                            way(fire(scene, weapon, at[:99])))  # fmt: skip
        many = fire(scene, weapon, at)
        assert re.fullmatch(r"visible: calls have lost the \d+ us that it takes to make what it needs", way(many))
        assert many == fire(scene, weapon, at, strategy="spans") and many
        assert re.fullmatch(r"visible: about \d+ us", way(fire(scene, weapon, at[:99])))
    assert re.fullmatch(r"integers: about \d+ us", way(fire(scene, Disc(8), at[0])))
    asked = "tiles: not labels, as shots are not one pixel; not visible, as a pre-filter is asked for; asked for"
    assert way(fire(scene, Disc(8), at[0], prefilter="box", strategy="built")) == asked
    differ = fire(scene, Disc(8), at[:2], exclude=[1, 2], strategy="visible")
    assert way(differ).startswith("integers: not visible, as shots accept different items; about")
    scene.move(0, (9, 9))
    assert way(fire(scene, Disc(8), at[:99])).startswith("tiles: visible would take")


def test_what_is_too_large_for_bit_rows_is_counted_by_spans() -> None:
    scene = Scene()
    scene.add(square(9), (4000, 50))
    at, large = [(0, 0), (3, 9)], Disc(9000)
    assert way(fire(scene, large, at)) == "spans: the patterns are too large for bit rows"
    assert len(fire(scene, large, at)) == 2


@pytest.mark.usefixtures("fixed_costs")
def test_the_same_call_at_the_same_scene_takes_the_same_way() -> None:
    """Whatever was fired at other scenes, with the same weapon or another, before or between."""
    rng = np.random.default_rng(5)
    at = rng.uniform(0, 64, (400, 2))
    calls = [(Disc(4), at[:1]), (Disc(4), at), (Point(), at), (Disc(9, falloff="linear"), at[:50]), (Disc(4), at)] * 3

    def ways(between: bool) -> list[str]:
        scene, other = (Scene((64, 64)) for _ in range(2))
        for number in range(60):
            scene.add(square(9), (number * 7 % 64, number * 11 % 64), layer=number % 5)
            other.add(square(3), (number, number))
        taken = []
        for weapon, places in calls:
            if between:
                fire(other, weapon, at)
            taken.append(way(fire(scene, weapon, places)))
        return taken

    assert ways(False) == ways(True) == ways(False)
    assert {text.split(":")[0] for text in ways(False)} >= {"integers", "tiles", "visible", "labels"}


# Bad arguments


NAN, INF = math.nan, math.inf
AT = [(0, 0), (1, 1)]
BAD: list[tuple[dict[str, Any], str]] = [
    ({"weapon": "disc"}, r"weapon: expected a weapon, got str"),
    ({"at": (0, 0, 0)}, r"at: expected shape \(2,\) or \(any, 2\), got \(3,\)"),
    ({"at": [[]]}, r"at: expected shape"),
    ({"at": "x"}, r"at: "),
    ({"at": None}, r"at: expected numbers"),
    ({"at": [(0, 0), (NAN, 0)]}, r"at\[1\]\[0\]: expected a finite number, got nan"),
    ({"at": [(0, 0), (0, 2.0**40 + 1)]}, r"at\[1\]\[1\]: expected a number within"),
    ({"at": [(1j, 0)]}, r"at: expected numbers"),
    ({"aim": [0, INF]}, r"aim\[1\]: expected a finite number, got inf"),
    ({"aim": [0, 1, 2]}, r"aim: expected shape \(2,\), as at has shape \(2, 2\), got \(3,\)"),
    ({"aim": "up"}, r"aim: expected a number, got 'up'"),
    ({"aim": 0, "toward": (5, 5)}, r"aim: expected aim or toward, got both"),
    ({"toward": [(5, 5), (1, 1)]}, r"toward\[1\]: expected a point other than the shot's own"),
    ({"toward": [(5, 5)] * 3}, r"toward: expected shape \(2, 2\)"),
    ({"toward": (NAN, 0)}, r"toward\[0\]: expected a finite number"),
    ({"accept": [1, -1]}, r"accept\[1\]: expected a whole number from 0 to 4294967295, got -1"),
    ({"accept": 2**32}, r"accept\[0\]: expected"),
    ({"accept": 0.5}, r"accept\[0\]: expected a whole number"),
    ({"accept": True}, r"accept: expected a number, got True"),
    ({"accept": {"default": 1}}, "accept: expected category names or bits"),
    ({"accept": None}, "accept: expected category names or bits"),
    ({"exclude": [1, 2, 3]}, "exclude: expected an owner for each of 2 shots, .* got shape .3"),
    ({"exclude": [[0], [0.5]]}, r"exclude\[1\]\[0\]: expected a whole number"),
    ({"exclude": -2}, r"exclude: expected a whole number from -1"),
    ({"exclude": "me"}, "exclude: expected ids, got 'me': scene.find"),
    ({"seed": -1}, r"seed: expected a whole number"),
    ({"seed": 2**64}, r"seed: expected a whole number"),
    ({"seed": 1.5}, r"seed: expected a whole number"),
    ({"seed": None}, r"seed: expected a whole number"),
    ({"shot": [0, -1]}, r"shot\[1\]: expected a whole number from 0"),
    ({"shot": [0, 1, 2]}, r"shot: expected shape \(2,\)"),
    ({"strategy": "fast"}, r"strategy: expected one of 'auto', 'direct', 'built', .*, got 'fast'"),
    ({"prefilter": "bax"}, r"prefilter: expected one of .* \(did you mean 'box'\?\)"),
]


@pytest.mark.parametrize("bad, message", BAD, ids=[str(bad)[:40] for bad, _ in BAD])
def test_bad_arguments(bad: dict[str, Any], message: str) -> None:
    scene = Scene()
    scene.add(square(3))
    arguments = {"weapon": Spread(Disc(1), 2, 1), "at": AT, **bad}
    with pytest.raises(InputError, match=message):
        fire(scene, arguments.pop("weapon"), arguments.pop("at"), **arguments)


@pytest.mark.parametrize(
    ("exclude", "place"),
    [(4, ""), ([-1, 3, 9], "[2]"), ([[3, -1], [-1, -1], [0, 2**31]], "[2][1]"), ([[1, 4]], "[0][1]")],
)
def test_an_owner_that_never_was_is_an_error(exclude: object, place: str) -> None:
    """The text names the first one, and the owners of the greatest ids."""
    scene = Scene()
    for name in ("duck", "can", "arm", "crow"):
        scene.add(square(3), name=name, owner=0 if name == "arm" else None)
    first = next(owner for owner in np.ravel(exclude).tolist() if owner > 3)  # type: ignore[call-overload]
    told = f"exclude{place}: expected an owner that the scene has or had, got {first}; the nearest are "
    with pytest.raises(InputError, match=re.escape(told + "0 'duck', 1 'can', 3 'crow'") + "$"):
        fire(scene, Disc(1), [(0, 0)] * 3, exclude=exclude)
    if not place:
        for _ in range(3):  # alone the first time, then made ready
            with pytest.raises(InputError, match=re.escape(told)):
                fire(scene, Disc(1), (0, 0), exclude=exclude)
        with pytest.raises(InputError, match=re.escape(told)):
            prepare(scene, Disc(1), exclude=exclude)
        with pytest.raises(InputError, match=r"got 0; it never had any$"):
            fire(Scene(), Disc(1), (0, 0), exclude=0)


def test_an_owner_of_any_time_may_be_excluded() -> None:
    """One that was removed, and in the past one that came later."""
    scene = Scene()
    scene.add(square(3))
    history = History(scene)
    history.record(0)
    late = scene.add(square(3))
    scene.remove(late)
    past = history.at(0)
    for at in (scene, past, scene.copy()):
        assert fire(at, Disc(1), (0, 0), exclude=late).object.tolist() == [0]
        assert not fire(at, Disc(1), (0, 0), exclude=[0, late, -1])
    assert fire(history, Disc(1), (0, 0), exclude=late, tick=0).object.tolist() == [0]
    assert report_of(past, [fire(past, Disc(1), (0, 0), exclude=late)])["shots"][0]["exclude"] == [
        {"owner": 1, "name": "hittable 1"}
    ]
    for at in (past, history):
        with pytest.raises(InputError, match=r"exclude: .* got 2; the nearest are 0 .*, 1 'hittable 1'"):
            fire(at, Disc(1), (0, 0), exclude=2, tick=None if at is past else 0)


@pytest.mark.parametrize("name", ["at", "aim", "toward", "accept", "exclude", "shot"])
def test_rows_of_different_length(name: str) -> None:
    arguments: dict[str, Any] = {"at": AT, name: [[1, 2], [3]]}
    with pytest.raises(InputError, match=name):
        fire(Scene(), Disc(1), arguments.pop("at"), **arguments)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Disc(-1),
        lambda: Disc(2**20 + 1),
        lambda: Disc(NAN),
        lambda: Disc(1, falloff="cubic"),
        lambda: Disc(1, pierce=1),
        lambda: Ring(3, 2),
        lambda: Box(0, 1),
        lambda: Box(1.5, 1),
        lambda: Polygon([(0, 0), (1, 1)]),
        lambda: Cone(1, 361),
        lambda: Beam(1, -1),
        lambda: Stencil(["#.", "#"]),
        lambda: Spread(Spread(Point(), 1, 1), 1, 1),
        lambda: Spread(Point(), 0, 1),
        lambda: Rounds(Rounds(Point(), 1), 1),
        lambda: Rounds(Point(), 65_537),
        lambda: Rounds(Point(), 1, (0, 0, 0)),
    ],
)
def test_bad_weapons(make: Any) -> None:
    with pytest.raises(InputError, match=r"^[a-z_]+(\[\d+\])*: expected .*, got "):
        make()


@pytest.mark.parametrize("weapon", [None, "laser", Disc, {"kind": "point"}, AreaWeapon()])
def test_what_is_no_weapon_is_refused(weapon: Any) -> None:
    with pytest.raises(InputError, match="weapon: expected a weapon, got"):
        fire(Scene(), weapon, (0, 0))


def test_what_is_no_scene_is_refused() -> None:
    with pytest.raises(InputError, match="scene: expected a Scene or a History, got str"):
        fire("scene", Disc(1), (0, 0))  # type: ignore[arg-type]


def test_giants_need_little_memory() -> None:
    """Only the rows of a pattern that can meet something are laid out."""
    scene = Scene((40, 30))
    item = scene.add(square(5), (10, 10))
    noisy = Scene()
    noisy.add(np.indices((60, 60)).sum(axis=0) % 2 == 0, (400, 0))
    giant = fire(scene, Disc(2**18), (2**18 + 12, 12))
    crowd = fire(noisy, Spread(Disc(20), 400, 150), (0, 0))
    tracemalloc.start()
    try:
        assert [margin[1:4] for margin in giant.margins()] == [(item, True, 3.0)]
        assert fire(scene, Spread(Disc(2**16), 20, 3), (10, 10)).object.tolist() == [item]
        crowd.why_not()
        assert tracemalloc.get_traced_memory()[1] < 128 * 2**20
    finally:
        tracemalloc.stop()


def test_results_cannot_be_written() -> None:
    scene = Scene((50, 40))
    scene.add(square(5), (3, 3))
    hits = fire(scene, Disc(3), [(4, 4), (5, 5)])
    for name in ("samples", "object", "first_xy", "verdicts", "starts", "fired"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(hits, name)[:] = 0


def test_any_whole_number_names_a_shot() -> None:
    scene = Scene((50, 40))
    scene.add(square(5), (3, 3))
    hits = fire(scene, Disc(3), [(4, 4)] * 256)
    assert hits.of(np.uint8(255)) == hits.of(255) == hits.of(255.0) != []  # type: ignore[arg-type]
    assert hits.why_not(np.uint8(255)) == hits.why_not(255)  # type: ignore[arg-type]


def test_accept_takes_names() -> None:
    scene = Scene((50, 40), categories=["red", "blue"])
    red = scene.add(square(5), (3, 3), categories=["red"])
    blue = scene.add(square(5), (9, 3), categories=["blue"])
    assert fire(scene, Disc(9), (6, 3), accept=["red"]).object.tolist() == [red]
    assert sorted(fire(scene, Disc(9), (6, 3), accept=("red", "blue")).object.tolist()) == [red, blue]
    with pytest.raises(InputError, match="did you mean 'blue'"):
        fire(scene, Disc(9), (6, 3), accept=["blu"])


def test_far_apart_items_under_a_giant_are_laid_one_by_one() -> None:
    """What lies between them costs nothing, and overlapping boxes count their pixels once."""
    scene = Scene()
    near = [scene.add(square(5), (x, 0)) for x in (0, 3, 5)]
    far = scene.add(square(5), (100_000, 90_000), layer=2)
    giant = fire(scene, Disc(2**18, falloff=None), (0, 0))
    assert sorted(giant.object.tolist()) == [*near, far]
    assert giant == fire(scene, Disc(2**18), (0, 0), prefilter="none")
    assert int(giant.samples.sum()) == giant.verdict_counts()["hit"] == 5 * 10 + 25
    walked = next(stage for stage in giant.plan.ran if stage.name == "walk")
    events = 33 * 4 * 5
    assert 75 <= walked.bytes_made <= 75 + events


@pytest.mark.parametrize("strategy", ["built", "auto"])
def test_threads_that_fire_at_once_agree(strategy: str) -> None:
    rng = np.random.default_rng(5)
    scene = Scene((300, 200))
    ids = [scene.add(rng.random((20, 20)) < 0.7, rng.uniform((0, 0), (300, 200))) for _ in range(40)]
    at = rng.uniform((0, 0), (300, 200), (400, 2))
    with ThreadPoolExecutor(4) as pool:
        for _ in range(12):
            scene.move(ids, rng.uniform((0, 0), (300, 200), (40, 2)))
            asked = [pool.submit(fire, scene, Disc(9), at, strategy=strategy) for _ in range(4)]
            truth = fire(scene, Disc(9), at, strategy="direct")
            assert all(answer.result() == truth for answer in asked)


# Rows as sequences and arrays


@pytest.mark.parametrize("prepared", [False, True])
@pytest.mark.parametrize("weapon", [Disc(30), Disc(30, pierce=True), Pistol(90), Spread(Rifle(90), 5, 9)])
def test_rows_by_number_and_as_an_array(weapon: Weapon, prepared: bool) -> None:
    scene = Scene((99, 99))
    for k in range(5):
        scene.add(np.ones((9, 9), np.bool_), (30 + 11 * k, 40))
    hits = prepare(scene, weapon).fire((25, 40)) if prepared else fire(scene, weapon, [(25, 40), (60, 41)])
    rows = list(hits)
    assert rows and [hits[k] for k in range(len(rows))] == rows == hits[:] and hits[np.int64(0)] == rows[0]
    assert hits[-1] == rows[-1] and hits[1:] == rows[1:] and hits[::-1] == rows[::-1] and hits[5:2] == []
    assert all(type(value) in (int, tuple) for value in hits[0])
    for wrong, error in ((len(rows), IndexError), (-len(rows) - 1, IndexError), (0.5, TypeError), ("0", TypeError)):
        with pytest.raises(error, match=rf"^hits: expected the number of one of {len(rows)} rows, .*, got {wrong!r}"):
            hits[wrong]

    table = hits.to_numpy()
    assert table.dtype.names == HitRow._fields and table.shape == (len(rows),)
    assert [(*row[:7], tuple(row[7]), row[8]) for row in table.tolist()] == rows
    table["object"] = 99
    assert [row.object for row in hits] == [row.object for row in rows]


def test_no_rows_are_an_empty_array() -> None:
    hits = fire(Scene(), Disc(3), (5, 5))
    assert len(hits.to_numpy()) == 0 and hits[:] == []
