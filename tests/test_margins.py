"""Conditioning: how little a shot of patterns may change when it moves a little, and how far verdicts hold."""

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import Beam, Box, Cone, Disc, Hits, Point, Ring, Rounds, Scene, Spread, Sprite, Stencil, Weapon, fire
from hitplanes.weapons.explain.margins import Margin

WEAPONS = (
    Point(), Disc(2), Disc(3.5, pierce=True), Ring(2, 4), Box(4, 3), Cone(7, 50), Beam(8, 2), Stencil(["#.#", ".#."]),
    Spread(Disc(1), 4, 4), Spread(Beam(5, 0, pierce=True), 3, 3), Rounds(Disc(1.5), 3, (0.5, -0.25)),
    Rounds(Spread(Point(), 6, 3), 2, (1, 0)),
)  # fmt: skip

SHIFTS = [(x, y) for y in range(-8, 9) for x in range(-8, 9) if x * x + y * y <= 64]


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Some boxes and discs in 24 x 20 px, in several layers; some block, some hang over the edge."""
    scene = Scene((24, 20) if draw(st.booleans()) else None)
    for _ in range(draw(st.integers(0, 6))):
        sprite = draw(st.sampled_from((Sprite.box(3, 3), Sprite.circle(3), Sprite.box(1, 1), Sprite.box(9, 2))))
        role = draw(st.sampled_from(("hittable", "hittable", "hittable", "occluder")))
        at = draw(st.integers(-2, 25)), draw(st.integers(-2, 21))
        scene.add(sprite, at, role=role, layer=draw(st.integers(-1, 1)), categories=draw(st.sampled_from((1, 2, 3))))
    return scene


places = st.tuples(st.integers(-2 * 256, 26 * 256), st.integers(-2 * 256, 22 * 256))
weapons = st.sampled_from(WEAPONS)
options = st.fixed_dictionaries({
    "aim": st.sampled_from((0, 30, -90, 135.5)), "accept": st.sampled_from((1, 2, 3)), "seed": st.integers(0, 3),
})  # fmt: skip


def placed(hits: Hits) -> Counter[tuple[int, ...]]:
    """How often each pellet of each round has each pixel."""
    samples = hits.samples_at()
    return Counter(zip(samples.round.tolist(), samples.pellet.tolist(), *samples.xy.T.tolist(), strict=True))


def steps(before: Hits, after: Hits) -> set[tuple[int, int]]:
    """By how many pixels each pellet of each round has moved; its pattern is the same."""
    moved = set()
    first, last = before.samples_at(), after.samples_at()
    for key in set(zip(first.round.tolist(), first.pellet.tolist(), strict=True)):
        a, b = (s.xy[(s.round == key[0]) & (s.pellet == key[1])] for s in (first, last))
        moved |= {(int(x), int(y)) for x, y in b - a}
    return moved


@examples(60)
@given(scenes(), weapons, places, st.sampled_from(((1, 0), (0, 1), (-1, 0), (0, -1))), options)
def test_a_small_step_changes_little(
    scene: Scene, weapon: Weapon, at_256: tuple[int, int], step: tuple[int, int], how: dict[str, Any]
) -> None:
    """A step of 1/256 px moves a pattern by no or one pixel; what it gains of an object came in, what it loses left."""
    before, after = (
        fire(scene, weapon, ((at_256[0] + n * step[0]) / 256, (at_256[1] + n * step[1]) / 256), **how) for n in (0, 1)
    )
    assert steps(before, after) <= {(0, 0), step}
    entered, left = ((placed(b) - placed(a)).total() for a, b in ((before, after), (after, before)))
    fired = int(before.fired[0])
    assert entered == left and int(after.fired[0]) == fired
    had, has = Counter[int](), Counter[int]()
    share = Counter[int]()
    for hits, count, sign in ((before, had, -1), (after, has, 1)):
        for row, part in zip(hits, hits.shares(), strict=True):
            count[row.object] += row.samples
            share[row.object] += sign * part.of_pattern
    in_round = fired / (1 + int(before.samples_at().round.max()))
    for item in had | has:
        assert -left <= has[item] - had[item] <= entered
        assert abs(share[item]) <= entered / in_round + 1e-9


@pytest.mark.parametrize("weapon", WEAPONS, ids=lambda w: w.kind)
@pytest.mark.parametrize("axis", [0, pytest.param(1, marks=pytest.mark.long)])
def test_of_256_small_steps_one_moves_the_shot(weapon: Weapon, axis: int) -> None:
    scene = Scene((24, 20))
    scene.add(Sprite.box(24, 20), (12, 10))
    at = np.tile([12.25, 9.5], (257, 1))
    at[:, axis] += np.arange(257) / 256
    hits = fire(scene, weapon, at, seed=3, shot=[0] * 257)
    corner = np.array([hits.samples_at(i).xy.min(axis=0) for i in range(257)])
    moved = np.diff(corner, axis=0)
    assert set(moved[:, 1 - axis].tolist()) == {0} and set(moved[:, axis].tolist()) == {0, 1}
    assert moved[:, axis].sum() == 1


@examples(40)
@given(scenes(), weapons, places, options)
def test_a_verdict_holds_for_all_shifts_shorter_than_its_margin(
    scene: Scene, weapon: Weapon, at_256: tuple[int, int], how: dict[str, Any]
) -> None:
    at = np.array(at_256) / 256
    told = {margin.object: margin for margin in fire(scene, weapon, at, **how).margins()}
    hits = fire(scene, weapon, at + SHIFTS, shot=[0] * len(SHIFTS), **how)
    hit = {shift: {row.object for row in hits.of(i)} for i, shift in enumerate(SHIFTS)}
    for item in scene.ids("hittable"):
        margin = told.get(item)
        still = item in hit[0, 0]
        flips = sorted((math.hypot(*s), s[1], s[0]) for s in SHIFTS if (item in hit[s]) != still)
        assert (margin is None) == (not flips)
        if margin is not None:
            length, y, x = flips[0]
            assert margin == (0, item, still, length, (x, y)) and margin.fragile == (length == 1)


def test_a_margin_of_one_px_is_fragile() -> None:
    assert Margin(0, 0, True, 1.0, (1, 0)).fragile and not Margin(0, 0, True, math.sqrt(2), (1, 1)).fragile


def test_margins_of_a_batch() -> None:
    """By shot, then by object; of none, none."""
    scene = Scene()
    a, b = scene.add(Sprite.box(2, 2), (5, 0)), scene.add(Sprite.box(2, 2), (0, 0))
    hits = fire(scene, Point(), [(0, 0), (100, 100), (5, 0)])
    assert [margin[:3] for margin in hits.margins()] == [(0, a, False), (0, b, True), (2, a, True), (2, b, False)]
    assert hits.margins(1) == [] and hits.margins(2) == hits.margins()[2:]


def test_margins_with_a_line_of_sight_know_what_lies_beyond_the_reach_of_the_shot() -> None:
    """A wall that only the ways of a shifted shot come to shelters what lies behind it."""
    scene = Scene((60, 41))
    target = scene.add(np.ones((1, 1), np.bool_), (30, 20))
    for weapon, found in ((Disc(5), [target]), (Disc(5, line_of_sight="occluders"), [target])):
        assert [margin.object for margin in fire(scene, weapon, (20, 20)).margins()] == found
    scene.add(np.ones((41, 1), np.bool_), (29, 20), role="occluder")
    assert not fire(scene, Disc(5, line_of_sight="occluders"), (20, 20)).margins()
    assert [margin.object for margin in fire(scene, Disc(5), (20, 20)).margins()] == [target]


@pytest.mark.parametrize("weapon", WEAPONS, ids=lambda w: w.kind)
def test_margins_do_not_depend_on_how_many_shifts_are_tried_at_a_time(
    weapon: Weapon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor on whether the scene has changed, which leaves them to the reference."""
    scene = Scene()
    for at in ((0, 3), (6, 0), (-9, 2), (1, -8)):
        scene.add(Sprite.box(3, 3), at)
    hits = fire(scene, weapon, (0, 0))
    told = hits.margins()
    scene.move(0, (0, -3))
    assert hits.margins() == told
    monkeypatch.setattr("hitplanes.weapons.explain.margins.CHUNK_SAMPLES", 30)
    assert hits.margins() == told != []


@pytest.mark.parametrize("inside", ["hit", "ignore_until_exit", "error"])
def test_margins_of_cover_are_those_of_the_reference(inside: str, jit: bool) -> None:
    """Of a shot that some shifts would begin inside a wall, too."""
    scene, weapon = Scene((90, 80)), Disc(20, line_of_sight="occluders", inside=inside)
    for k, at in enumerate(np.random.default_rng(4).integers(5, 75, (24, 2)).tolist()):
        scene.add(Sprite.box(5, 3), at, role="occluder" if k % 4 == 0 else "hittable", angle=31 * k)
    starts = [(x, y) for x in (20, 44, 66) for y in (17, 40, 60) if fire(scene, Point(), (x, y)).verdicts[0, 1] == 0]
    hits = fire(scene, weapon, starts)
    told = hits.margins()
    scene.move(0, (-50, -50))
    assert hits.margins() == told and len({margin.distance for margin in told}) > 3
