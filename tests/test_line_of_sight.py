"""Line of sight of area weapons: against an oracle that walks one segment a pixel, by every way, and by laws."""

from __future__ import annotations

import itertools
import json
import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import oracle_shelter
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from oracle_stack import Item
from some_of import some_of
from test_fire import Battle, Placements, expected, items_of, parts_of, rounds_of, some_battle, told

from hitplanes import (
    ALL,
    Beam,
    Box,
    Cone,
    Disc,
    History,
    InputError,
    Point,
    Ring,
    Rounds,
    Scene,
    ShotRecord,
    Spread,
    Sprite,
    Verdict,
    Weapon,
    fire,
    fire_shots,
    load_scene,
    picture_of_report,
    prepare,
    replay,
    report_of,
    weapons_of,
)
from hitplanes.planes.bits import blockers as blockers_module
from hitplanes.planes.bits import exits, shadows
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.grid.spans import rectangles
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.fire import shelter
from hitplanes.weapons.fire.shelter import ways_box
from hitplanes.weapons.kinds.placements import placements_for

SIGHTS = ("occluders", "all")
WAYS = ("spans", "tiles", "visible")


def seen_battle(seed: int) -> Battle:
    """A random world, and a weapon that needs a line of sight; half of the shots accept the same."""
    rng = random.Random(f"sight {seed}")
    sight: dict[str, Any] = {
        "line_of_sight": rng.choice(SIGHTS), "inside": rng.choice(["hit", "ignore_until_exit"]),
        "pierce": rng.random() < 0.3, "falloff": rng.choice([None, "linear"]),
    }  # fmt: skip
    plain = rng.choice([
        Disc(rng.randint(8, 80) / 8, **sight), Cone(rng.randint(4, 14), rng.choice([20, 90, 200]), **sight),
        Beam(rng.randint(4, 18), rng.randint(0, 5), **sight), Box(rng.randint(3, 19), rng.randint(3, 15), **sight),
        Ring(4, rng.randint(5, 10), **sight),
    ])  # fmt: skip
    weapon: Weapon = rng.choice([plain, plain, Spread(plain, 3, 4), Rounds(plain, 2, (3, -2), 40)])
    battle = some_battle(seed)
    shots = battle.volley.shots
    if rng.random() < 0.5:
        shots = [replace(s, accept=ALL, blocked_by=shots[0].blocked_by, exclude=shots[0].exclude) for s in shots]
    return replace(battle, volley=Placements(weapon, shots, battle.volley.seed))


def check(seeds: range) -> None:
    hit = sheltered = 0
    for seed in seeds:
        battle = seen_battle(seed)
        scene = battle.scene()
        truth = expected(scene, battle.volley)
        for way, prefilter in itertools.product(WAYS, ("auto", "box")):
            hits = battle.volley.fired(scene, strategy=way, prefilter=prefilter)
            assert told(hits) == truth, f"{seed=} {way} {prefilter}"
        one = battle.volley.alone(scene, 1)
        assert told(one)[1] == truth[1][1:2] and len(one) == sum(row[0] == 1 for row in truth[0]), f"{seed=} alone"
        hit += sum(c["hit"] for c in truth[1])
        sheltered += sum(c["occluded"] for c in truth[1])
    assert min(hit, sheltered) > 10 * len(seeds)


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("part", some_of(range(4), 2))
def test_every_way_agrees_with_one_segment_a_pixel(part: int) -> None:
    check(range(15 * part, 15 * (part + 1)))


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("part", some_of(range(4), 2))
def test_large_masks_are_covered_near_the_shots(monkeypatch: pytest.MonkeyPatch, part: int) -> None:
    """Masks of a few pixels are large here, and few items a crowd, of which most are far from a shot: many pieces."""
    monkeypatch.setattr(blockers_module, "BLOCK", 3)
    monkeypatch.setattr(shadows, "CHUNK_SAMPLES", 40)
    monkeypatch.setattr(shadows, "CHUNK_PAIRS", 40)
    monkeypatch.setattr(shadows, "FEW_WAYS", 1)
    monkeypatch.setattr(shelter, "CHUNK_CELLS", 400)
    check(range(400 + 15 * part, 400 + 15 * (part + 1)))


def test_all_ways_lie_in_their_box() -> None:
    """Of every weapon, with pellets and recoil; and the box is not much larger."""
    rng, slack = np.random.default_rng(7), []
    for seed in range(150):
        battle = seen_battle(seed)
        plain = parts_of(battle.volley.weapon)[2]
        far = Spread(plain, 30, 90), Rounds(plain, 6, (25, -40), 77), Rounds(Spread(plain, 20, 50), 3, (0, 30))
        for weapon in (plain, battle.volley.weapon, *far):
            shots = fire(battle.scene(), weapon, rng.uniform(-99, 99, (3, 2)), aim=rng.uniform(0, 360)).shots
            x, y, x_max, y_max = ways_box(weapon, shots)
            placed = placements_for(weapon, shots)
            every = np.concatenate([placed.boxes, np.tile(placed.xy, 2)]) - np.array([x, y, x_max, y_max])
            least = np.concatenate([every[:, :2], -every[:, 2:]]).min(axis=0).min()
            assert least >= 0, (seed, weapon)
            slack.append(least)
    assert min(slack) <= 2


def test_a_shot_covers_the_blocks_that_it_may_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """Terrain is a new mask after each hole, so only what is near an explosion is covered anew."""
    made: list[tuple[int, ...]] = []
    monkeypatch.setattr(blockers_module, "rectangles", lambda mask: made.append(mask.shape) or rectangles(mask))
    scene = Scene((1300, 700))
    ground = scene.add(np.arange(400)[:, None] + np.zeros(1300) > 99, (649.5, 499.5))
    scene.add(np.ones((9, 9), np.bool_), (320, 395))
    bomb, counts = Disc(30, line_of_sight="all"), []
    for at in ((300, 390), (310, 390), (340, 390)):
        hits = fire(scene, bomb, at)
        assert hits == fire(scene, bomb, at, strategy="spans") and ground in hits.object
        counts.append(len(made))
        scene.carve(hits)
    assert max(counts) < 20 and all(max(size) <= blockers_module.BLOCK for size in made)
    made.clear()
    fire(scene, bomb, (300, 390))
    fire(scene, bomb, (301, 391))
    first = len(made)
    assert 1 <= first <= 4
    fire(scene, Disc(900, line_of_sight="all"), (600, 300))
    assert len(made) == 11 * 3  # each block of the ground once; of the box nothing is left


@pytest.mark.long
@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("part", range(4, 16))
def test_more_worlds_agree(part: int) -> None:
    check(range(15 * part, 15 * (part + 1)))


def test_every_sample_is_judged_like_one_segment() -> None:
    """Verdict, decider and shelter of each sample, and what blocked, by the oracle."""
    told_by = 0
    for seed in range(60):
        battle = seen_battle(seed)
        scene, volley = battle.scene(), battle.volley
        plain, items = parts_of(volley.weapon)[2], items_of(scene)
        for which, shot in enumerate(volley.shots):
            samples = volley.alone(scene, which).samples_at(0)
            number = 0
            for _, pellets in rounds_of(volley.weapon, shot.at, shot.aim, shot.toward, volley.seed, shot.number):
                for own, pellet in pellets:
                    for pixel, _ in sorted(pellet, key=lambda sample: (sample[0][1], sample[0][0])):
                        truth = oracle_shelter.judge(
                            items, own, pixel, line_of_sight=plain.line_of_sight, inside=plain.inside,
                            accept=shot.accept, blocked_by=shot.blocked_by, exclude=shot.exclude, pierce=plain.pierce,
                            bounds=scene.bounds,
                        )  # fmt: skip
                        assert tuple(samples.xy[number].tolist()) == pixel
                        assert Verdict(samples.verdict[number]).name.lower() == truth.verdict, (seed, which, pixel)
                        by = truth.sheltered_by
                        assert bool(samples.sheltered[number]) == (by is not None), (seed, which, pixel)
                        if by is not None:
                            told_by += 1
                            assert samples.item[number] == by.id, (seed, which, pixel)
                        number += 1
            assert number == len(samples.xy)
    assert told_by > 2000


# Hand-written


def lit(rows: list[str], line_of_sight: str, **options: Any) -> list[str]:
    """What a disc at '@' sees of a plane: '#' occluders, 'a' and 'b' objects; '.' lit, '-' sheltered, capitals hit."""
    plane = np.array([list(row) for row in rows])
    scene = Scene(plane.shape[::-1])
    for letter in "ab#":
        if (plane == letter).any():
            y, x = np.argwhere(plane == letter).min(axis=0).tolist()
            sprite = Sprite.from_mask((plane == letter)[y:, x:], pivot_xy=(0, 0))
            scene.add(sprite, (x, y), role="occluder" if letter == "#" else "hittable")
    (y, x), _ = *np.argwhere(plane == "@").tolist(), None
    samples = fire(scene, Disc(99, line_of_sight=line_of_sight, **options), (x, y)).samples_at(0)
    drawn = plane.copy()
    for (i, j), verdict, hidden in zip(samples.xy.tolist(), samples.verdict, samples.sheltered, strict=True):
        if verdict == Verdict.HIT:
            drawn[j, i] = plane[j, i].upper()
        elif hidden:
            drawn[j, i] = "-"
    return ["".join(row) for row in drawn.tolist()]


def test_a_wall_casts_a_shadow() -> None:
    """The segment from @ to the corner of the picture touches the wall's lower right corner, and is stopped by it."""
    assert lit(["......", "......", "..#...", "......", "@....."], "occluders") == [
        "...---", "..----", "..#-..", "......", "@.....",
    ]  # fmt: skip
    assert lit(["@..#...", ".......", "......."], "occluders") == ["@..#---", ".....--", "......."]
    assert lit(["@.#....", ".......", "......."], "occluders") == ["@.#----", "...----", "......-"]


def test_objects_shelter_each_other_but_not_themselves() -> None:
    assert lit(["@.aa.bb"], "all") == ["@.AA---"]
    assert lit(["@.aa.bb"], "occluders") == ["@.AA.BB"]
    assert lit(["@.a#a.b"], "all") == ["@.A----"]


def test_a_start_in_an_occluder() -> None:
    """The wall under the shot shelters all but the shot's own pixel, unless it is ignored up to the exit."""
    scene = Scene((9, 1))
    wall = scene.add(Sprite.from_mask(np.array([[1, 1, 0, 0, 1]], np.bool_), pivot_xy=(0, 0)), (0, 0), role="occluder")
    box = scene.add(Sprite.from_mask(np.ones((1, 5), np.bool_), pivot_xy=(0, 0)), (2, 0))

    def hit(inside: str) -> list[int]:
        hits = fire(scene, Disc(9, line_of_sight="occluders", inside=inside), (1, 0))
        return [row.pixels for row in hits]

    assert hit("hit") == [] and hit("ignore_until_exit") == [2]
    with pytest.raises(InputError, match=rf"at\[0\]: expected a start outside .* got one inside of id {wall}, '"):
        hit("error")
    with pytest.raises(InputError, match=r"at\[1\]: .* id 0"):
        fire(scene, Disc(1, line_of_sight="occluders", inside="error"), [(7, 0), (4, 0)])
    with pytest.raises(InputError, match=r"at\[0\]: .* id 0"):
        fire(scene, Point(line_of_sight="occluders", inside="error"), (0, 0))
    assert not fire(scene, Disc(0, line_of_sight="occluders", inside="error"), (0, 0), blocked_by=[])
    assert fire(scene, Disc(1, line_of_sight="all", inside="error"), (3, 0), exclude=box).verdict_counts()["hit"] == 0


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("strategy", WAYS)
@pytest.mark.parametrize("samples", [2**18, 50])
def test_shots_that_begin_in_walls_of_three_and_of_four_rectangles(
    monkeypatch: pytest.MonkeyPatch, strategy: str, samples: int
) -> None:
    """Together they hit what each hits alone, however many samples are looked at together."""
    comb, broken = np.zeros((2, 8), np.bool_), np.array([[1, 1, 0, 0, 1, 0, 1]], np.bool_)
    comb[0], comb[1, 2::2] = True, True
    scene = Scene()
    for wall, x in ((comb, -1000), (broken, 0)):
        scene.add(Sprite.from_mask(wall, pivot_xy=(0, 0)), (x, 0), role="occluder")
        scene.add(Sprite.from_mask(np.ones((3, 9), np.bool_), pivot_xy=(0, 0)), (x + 2, 0))
    weapon = Disc(9, line_of_sight="occluders", inside="ignore_until_exit")
    alone = [fire(scene, weapon, at, strategy="spans")[0] for at in ((-1000, 0), (1, 0))]
    monkeypatch.setattr(shadows, "CHUNK_SAMPLES", samples)
    hits = fire(scene, weapon, [(-1000, 0), (1, 0)], strategy=strategy)
    assert [row.pixels for row in hits] == [row.pixels for row in alone]


def test_inside_needs_a_line_of_sight_and_words_are_checked() -> None:
    with pytest.raises(InputError, match="inside: expected 'hit' of a weapon without line_of_sight, got 'error'"):
        Disc(3, inside="error")
    with pytest.raises(InputError, match="line_of_sight: "):
        Disc(3, line_of_sight="walls")
    with pytest.raises(InputError, match="inside: "):
        Disc(3, line_of_sight="all", inside="out")


# What answers tell


def street() -> Scene:
    scene = Scene((60, 30))
    scene.add(Sprite.box(5, 9), (45, 15), name="guard")
    scene.add(Sprite.box(2, 9), (30, 19), role="occluder", name="crate")
    return scene


def test_shares_blockers_and_why_not() -> None:
    scene, at = street(), (15, 15)
    (row,) = fire(scene, Disc(45, line_of_sight="occluders"), at)
    hits = fire(scene, Disc(45, line_of_sight="occluders"), at)
    (share,) = hits.shares()
    assert share.of_visible == 1 * row.pixels / 45 == share.exposed and 0.2 < share.exposed < 0.8
    (part,) = fire(scene, Disc(29, line_of_sight="occluders"), at).shares()
    assert part.of_visible < part.exposed == share.exposed
    (blocked,) = hits.blockers()
    assert (blocked.occluder, blocked.behind[0].object, blocked.behind[0].samples) == (1, 0, 45 - row.pixels)
    assert fire(scene, Disc(45), at).shares()[0].exposed is None

    scene.move(1, (30, 15))
    (why,) = fire(scene, Disc(45, line_of_sight="occluders"), at).why_not()
    assert (why.object, why.reason, why.by) == (0, "behind", {1: 45})
    near = fire(scene, Spread(Disc(3, line_of_sight="occluders"), 4, 9), (40, 15), seed=2).shares()
    assert all(share.exposed == 1 for share in near)


def test_exposed_is_what_any_pellet_sees() -> None:
    """Pellets on both sides of a crate each see another part of the guard behind it."""
    scene = Scene((90, 60))
    guard = scene.add(Sprite.box(9, 31), (70, 30))
    scene.add(Sprite.box(3, 11), (40, 30), role="occluder")
    hits = fire(scene, Spread(Disc(60, line_of_sight="occluders"), 4, 25), (15, 30), seed=3)
    alone = [
        fire(scene, Disc(99, line_of_sight="occluders"), own).pixels_at()
        for own in placements_for(hits.weapon, hits.shots).xy.tolist()
    ]
    seen = [set(map(tuple, pixels[0, guard].pixels().tolist())) for pixels in alone if pixels]
    (share,) = hits.shares()
    assert share.exposed == len(set.union(*seen)) / (9 * 31) > max(map(len, seen)) / (9 * 31)


@pytest.mark.parametrize("strategy", WAYS)
def test_the_plan_says_what_may_shelter(strategy: str) -> None:
    near, far = (fire(street(), Disc(9, line_of_sight="all"), at, strategy=strategy).plan for at in ((38, 15), (9, 9)))
    assert {stage.name: stage.why for stage in near.ran}["line of sight"] == "items that may shelter: 2"
    left_out = {stage.name: stage.why for stage in far.left_out}
    assert left_out["line of sight"] == "no item near the shots may shelter" and not far.has_run("line of sight")
    assert not fire(street(), Disc(9), (9, 9), strategy=strategy).plan.has_run("line of sight")


def test_margins_count_shifts_of_the_whole_shot() -> None:
    """One px up, the ray to the guard's last row clears the crate."""
    scene = Scene((60, 30))
    scene.add(np.ones((1, 1), np.bool_), (40, 10))
    scene.add(np.ones((9, 1), np.bool_), (20, 14), role="occluder")
    (margin,) = fire(scene, Disc(30, line_of_sight="occluders"), (12, 10)).margins()
    assert not margin.hit and margin.shift_xy == (0, -1)
    hits = fire(scene, Disc(30, line_of_sight="occluders"), [(12, 10), (12, 9)])
    assert hits.object.tolist() == [0] and hits.shot.tolist() == [1]


def test_the_report_draws_the_edges_of_shadows() -> None:
    scene = street()
    sighted, plain = (fire(scene, Disc(45, line_of_sight=sight), (15, 15)) for sight in ("occluders", None))
    (told,), (other,) = (report_of(scene, [hits])["shots"] for hits in (sighted, plain))
    assert "sheltered" not in other and "exposed" not in other["rows"][0]["shares"]
    assert sum(last - first + 1 for _, first, last in told["sheltered"]) == sighted.samples_at(0).sheltered.sum() > 99
    report = report_of(scene, [sighted])
    without = {**report, "shots": [{**report["shots"][0], "sheltered": []}]}
    assert (picture_of_report(report, scene) != picture_of_report(without, scene)).any()


def test_a_prepared_weapon_and_a_point() -> None:
    scene = street()
    weapon = Disc(45, line_of_sight="occluders")
    ready = prepare(scene, weapon)
    assert ready.fire((15, 15)) == fire(scene, weapon, (15, 15))
    scene.move(1, (30, 11))
    assert ready.fire((15, 15)) == fire(scene, weapon, (15, 15))
    assert fire(scene, Point(line_of_sight="all"), (45, 15)) == fire(scene, Point(), (45, 15))
    plan = fire(scene, Point(line_of_sight="all"), [(45, 15)] * 9, strategy="labels").plan
    assert plan.has_run("label plane")


# Laws


def test_without_blockers_nothing_changes() -> None:
    for seed in range(40):
        battle = seen_battle(seed)
        plain = parts_of(battle.volley.weapon)[2]
        scene = battle.scene()
        scene.remove(scene.ids("occluder"))
        blind = replace(plain, line_of_sight=None, inside="hit")
        for shot in battle.volley.shots:
            how = {"aim": shot.aim or 3, "accept": shot.accept}
            sighted = replace(plain, line_of_sight="occluders")
            assert fire(scene, sighted, shot.at, **how) == fire(scene, blind, shot.at, **how)


@pytest.mark.parametrize("sight", SIGHTS)
def test_more_blockers_never_expose_more(sight: str) -> None:
    rng = random.Random(sight)
    lost = 0
    for _ in range(40):
        scene = Scene((50, 50))
        for _ in range(6):
            mask = np.array([[rng.random() < 0.8 for _ in range(7)] for _ in range(7)])
            scene.add(mask, (rng.randrange(50), rng.randrange(50)))
        weapon, at = Disc(24, line_of_sight=sight), (rng.randrange(50), rng.randrange(50))
        counts = []
        for _ in range(4):
            counts.append({row.object: row.pixels for row in fire(scene, weapon, at)})
            scene.add(np.ones((5, 5), np.bool_), (rng.randrange(50), rng.randrange(50)), role="occluder", layer=-1)
        for fewer, more in itertools.pairwise(counts):
            assert all(pixels <= fewer.get(item, 0) for item, pixels in more.items())
        lost += sum(counts[0].values()) - sum(counts[-1].values())
    assert lost > 300


def test_mirrors_and_quarter_turns() -> None:
    rng = random.Random(5)
    for _ in range(30):
        plane = np.array([[rng.random() < 0.06 for _ in range(41)] for _ in range(41)])
        target = np.array([[rng.random() < 0.5 for _ in range(41)] for _ in range(41)])
        weapon = Disc(18, line_of_sight="occluders")

        def seen(walls: np.ndarray, goal: np.ndarray) -> np.ndarray:
            scene = Scene.from_planes(hittable=goal, occluders=walls)
            got = np.zeros(goal.shape, np.bool_)
            for spans in fire(scene, weapon, (20, 20)).pixels_at().values():  # noqa: B023
                x, y = spans.pixels().T
                got[y, x] = True
            return got

        still = seen(plane, target)
        for turn in (np.fliplr, np.flipud, np.rot90, np.transpose):
            assert (seen(turn(plane), turn(target)) == turn(still)).all()


def test_ways_are_symmetric() -> None:
    """If a wall shelters b from a, it shelters a from b."""
    rng = random.Random(8)
    hidden = 0
    for _ in range(150):
        walls = np.array([[rng.random() < 0.05 for _ in range(31)] for _ in range(31)])
        (a, b) = ((rng.randrange(31), rng.randrange(31)) for _ in range(2))
        for x, y in (a, b):
            walls[y, x] = False
        scene = Scene.from_planes(occluders=walls)
        one, two = scene.add(np.ones((1, 1), np.bool_), a), scene.add(np.ones((1, 1), np.bool_), b)
        weapon = Disc(45, line_of_sight="occluders")
        there, back = (set(fire(scene, weapon, at).object.tolist()) for at in (a, b))
        assert (two in there) == (one in back)
        hidden += two not in there
    assert 20 < hidden < 130


@examples(200, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.data())
def test_rectangles_cover_a_mask_and_nothing_else(height: int, width: int, data: st.DataObject) -> None:
    mask = np.array(data.draw(st.lists(st.lists(st.booleans(), min_size=width, max_size=width),
                                       min_size=height, max_size=height)))  # fmt: skip
    covered = np.zeros_like(mask)
    for x, y, x_max, y_max in rectangles(mask).tolist():
        assert mask[y : y_max + 1, x : x_max + 1].all()
        covered[y : y_max + 1, x : x_max + 1] = True
    assert (covered == mask).all()


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("few", [2**8, 0])
@pytest.mark.parametrize("bounds", [None, (-9, -7, 12, 9)])
def test_shadows_of_masks_of_any_shape(
    monkeypatch: pytest.MonkeyPatch, few: int, bounds: tuple[int, int, int, int] | None
) -> None:
    """Rectangles one by one, and connected parts beyond their rows, against the way to each pixel."""
    monkeypatch.setattr(shadows, "FEW_WAYS", few)
    rng, parts, hidden = np.random.default_rng(8), [], 0
    for _ in range(60):
        mask = rng.random(rng.integers(1, 10, 2)) < rng.uniform(0.2, 1)
        corner = rng.integers(-12, 13, 2)
        rects, first = blockers_module.in_parts(rectangles(mask))
        parts.append(first.sum() - len(first))
        box = np.concatenate([corner, corner + np.array(mask.shape[::-1]) - 1])[None]
        none, begin = np.zeros(1, np.int64), np.array([0, len(rects)])
        blockers = blockers_module.Blockers(none, box, begin, rects, first, none[:0], none[:0], bounds, False)
        set_xy = np.argwhere(mask)[:, ::-1] + corner
        held = {(x, y) for x, y in set_xy.tolist() if not bounds or not oracle_shelter.outside((x, y), bounds)}
        rows = np.full((1, 45), 2**64 - 1, np.uint64)
        kernels_of(shadows).hide_behind(rows, np.array([[-32, -22]]), none.repeat(2)[None], blockers, none, none)
        for row, word in enumerate(rows[0].tolist()):
            for x in range(-32, 32):
                way = oracle_shelter.supercover(x, row - 22).keys() - {(x, row - 22)}
                assert (word >> (x + 32) & 1) == (not held & way), (mask, corner, x, row - 22)
                hidden += bool(held & way)
    assert min(parts) < -4 and max(parts) == 0 and hidden > 10_000


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("part", some_of(range(4), 2))
def test_parts_in_worlds(monkeypatch: pytest.MonkeyPatch, part: int) -> None:
    monkeypatch.setattr(shadows, "FEW_WAYS", 0)
    check(range(600 + 15 * part, 600 + 15 * (part + 1)))


@examples(200, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.data())
def test_parts_are_connected_and_do_not_touch(height: int, width: int, data: st.DataObject) -> None:
    mask = np.array(data.draw(st.lists(st.lists(st.booleans(), min_size=width, max_size=width),
                                       min_size=height, max_size=height)))  # fmt: skip
    rects, first = blockers_module.in_parts(rectangles(mask))
    number = np.full((height, width), -1)
    for (x, y, x_max, y_max), part in zip(rects.tolist(), np.cumsum(first).tolist(), strict=True):
        number[y : y_max + 1, x : x_max + 1] = part
    assert ((number >= 0) == mask).all()
    left = {(x, y) for y, x in np.argwhere(mask).tolist()}
    while left:
        part, edge = set(), [left.pop()]
        while edge:
            x, y = edge.pop()
            part.add((x, y))
            near = {(x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)} & left
            left -= near
            edge += near
        numbers = {int(number[y, x]) for x, y in part}
        assert len(numbers) == 1 and int((number == numbers.pop()).sum()) == len(part)


def has_a_gap(squares: list[tuple[int, int]], x: int, y: int) -> bool:
    """Whether the way from (0, 0) to (x, y) leaves closed squares, of which one holds (0, 0), and meets them again."""
    reached = Fraction(0)
    for first, last in sorted(part for part in (inside(square, x, y) for square in squares) if part):
        if first > reached:
            return True
        reached = max(reached, last)
    return False


def inside(square: tuple[int, int], x: int, y: int) -> tuple[Fraction, Fraction] | None:
    """The part of the way from (0, 0) to (x, y) that lies in the closed square around a point."""
    first, last = Fraction(0), Fraction(1)
    for at, step in zip(square, (x, y), strict=True):
        if step:
            sides = [Fraction(2 * at + side, 2 * step) for side in (-1, 1)]
            first, last = max(first, min(sides)), min(last, max(sides))
        elif at:
            return None
    return (first, last) if first <= last else None


@pytest.mark.usefixtures("jit")
def test_what_a_way_leaves_and_meets_again() -> None:
    """Items of any shape, which the ways begin in, against the squares of their pixels one by one."""
    rng, items, seen = np.random.default_rng(5), [], []
    for k in range(40):
        mask = rng.random(rng.integers(1, 9, 2)) < rng.uniform(0.2, 1)
        mask[tuple(rng.integers(mask.shape))] = True
        y, x = (int(v) for v in rng.permutation(np.argwhere(mask))[0])
        items.append(rectangles(mask) - np.array([x, y, x, y]))
        squares = [(int(right) - x, int(down) - y) for down, right in np.argwhere(mask)]
        ways = rng.integers(-9, 10, (40, 2)).tolist()
        seen += [(k, right, down, has_a_gap(squares, right, down)) for right, down in ways]
    of, every_x, every_y, gaps = np.array(seen).T
    for k, rects in enumerate(items):
        x, y, gap = every_x[of == k], every_y[of == k], gaps[of == k]
        assert kernels_of(exits).left_and_met(rects, x, y).tolist() == np.flatnonzero(gap).tolist()
    assert 200 < gaps.sum() < 1400 and (every_x == 0).any() and (every_y == 0).any()


@pytest.mark.usefixtures("jit")
@pytest.mark.parametrize("kind", ["crumbs", "stripes", "checks", "frame"])
def test_what_lies_behind_an_item_that_ways_begin_in(kind: str) -> None:
    """All pixels around a mask at once, also those in the directions of its corners, against the pixels on each way."""
    rng, hidden = np.random.default_rng(11), 0
    for _ in range(8):
        mask = rng.random(rng.integers(3, 9, 2)) < 0.6
        row, column = np.indices(mask.shape)
        shape = {"stripes": column % 2 == 0, "checks": (column + row) % 2 == 0, "frame": (column == 0) | (row == 0)}
        mask |= shape.get(kind, mask)
        down, right = (int(v) for v in rng.permutation(np.argwhere(mask))[0])
        pixels = frozenset((int(x) - right, int(y) - down) for y, x in np.argwhere(mask))
        item, entered = Item(0, False, 0, 1, 0, pixels), oracle_shelter.entered
        x, y = (side.ravel() for side in np.mgrid[-12:13, -12:13])
        found = exits.behind_exit(rectangles(mask) - np.array([right, down, right, down]), x, y)
        ways = zip(x.tolist(), y.tolist(), strict=True)
        expected = [
            k for k, way in enumerate(ways) if entered(item, (0, 0), way, "ignore_until_exit", None) is not None
        ]
        assert found.tolist() == expected
        hidden += len(found)
    assert hidden > 500


@pytest.mark.usefixtures("jit")
def test_far_away_and_far_reaching() -> None:
    """The same rows 10^9 px away, and at the ends of long ways."""
    walls = [(70, 3), (700, -20), (-400, 90), (5, 5)]
    targets = [(1000, 10), (900, -200), (-900, 200), (30, 30), (140, 6)]
    rows = []
    for shift in (0, 10**9, -(10**9)):
        scene = Scene()
        for x, y in targets:
            scene.add(np.ones((9, 9), np.bool_), (x + shift, y - shift))
        for x, y in walls:
            scene.add(np.ones((3, 9), np.bool_), (x + shift, y - shift), role="occluder")
        weapon = Disc(1010, line_of_sight="occluders")
        for strategy in ("spans", "auto"):
            hits = fire(scene, weapon, (shift, -shift), strategy=strategy)
            rows.append([(row.object, row.pixels, row.distance2) for row in hits])
    assert all(row == rows[0] for row in rows) and 0 < len(rows[0]) < 5


def test_only_samples_on_items_are_looked_at_for_rows() -> None:
    """A blast of three thousand million pixels, and three small items."""
    scene = Scene()
    for x, role in ((500, "hittable"), (-400, "hittable"), (550, "occluder")):
        scene.add(np.ones((9, 9), np.bool_), (x, 0), role=role)
    for sight in SIGHTS:
        hits = fire(scene, Disc(32_000, line_of_sight=sight), (0, 0))
        assert [(row.object, row.pixels) for row in hits] == [(1, 81), (0, 81)]
        assert max(stage.bytes_made for stage in hits.plan.ran) < 10**7


def test_cover_in_files_logs_records_and_the_past(tmp_path: Path) -> None:
    """Scene file, record and replay, log of shots, golden's report, and a rewind all keep the line of sight."""
    scene, weapon = street(), Spread(Disc(30, line_of_sight="all", inside="ignore_until_exit"), 2, 3)
    scene.weapons = {"bomb": weapon.to_json()}
    scene.shots = [{"weapon": "bomb", "at": [20, 15], "seed": 4}]
    scene.save(tmp_path / "street")
    loaded = load_scene(tmp_path / "street")
    (again,) = fire_shots(loaded)
    truth = fire(scene, weapon, (20, 15), seed=4)
    assert again == truth and truth.verdict_counts()["occluded"] > 50 and weapons_of(loaded)["bomb"] == weapon

    with ShotRecord(tmp_path / "match.jsonl") as record:
        record.fire(scene, weapon, (20, 15), seed=4)
    assert replay(tmp_path / "match.jsonl", loaded) is None
    loaded.move(1, (30, 9))
    assert replay(tmp_path / "match.jsonl", loaded) is not None

    history = History(scene)
    history.record(0)
    scene.move(1, (30, 5))
    history.record(1)
    then, now = (fire(history, weapon, (20, 15), seed=4, tick=tick) for tick in (0, 1))
    assert then == truth != now

    log, answers = tmp_path / "log.jsonl", tmp_path / "answers.jsonl"
    log.write_text('{"weapon": "bomb", "at": [20, 15], "seed": 4}\n')
    assert main(["fire", str(tmp_path / "street"), str(log), "-o", str(answers)]) == 0
    assert json.loads(answers.read_text().splitlines()[1])["verdicts"] == list(truth.verdict_counts().values())
