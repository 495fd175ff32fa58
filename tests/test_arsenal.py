"""The weapons: their patterns, their JSON, their weights, and what they refuse."""

from __future__ import annotations

import copy
import json
import pickle
from fractions import Fraction
from math import floor, isqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planes import InputError, Scene, Sprite
from planes.grid256 import ONE, unit
from planes.kept import Kept
from planes.spans import Spans
from weapons import (
    Beam,
    Box,
    Cone,
    Disc,
    Laser,
    Point,
    Polygon,
    Ring,
    Rounds,
    Spread,
    Stencil,
    Sweep,
    Weapon,
    arsenal,
    fire,
    weapon_from_json,
)
from weapons.arsenal import Plain, pattern_of
from weapons.pattern import falloff_weights

ARROW = ["..#..", ".###.", "#####", "..#.."]
PLAIN: list[Plain] = [
    Point(),
    Disc(4.5, falloff="linear"),
    Ring(3, 6.25),
    Box(5, 4, pierce=True),
    Polygon([(-5, -4), (6, 0), (-5, 4)], holes=[[(-3, -1), (0, 0), (-3, 1)]]),
    Cone(9, 40, falloff="smooth"),
    Beam(12, 1.5, pierce=True),
    Stencil(ARROW, pivot_xy=(2, 1)),
]
EVERY: list[Weapon] = [
    *PLAIN,
    Spread(Disc(2), count=8, radius=20),
    Rounds(Spread(Point(), count=3, radius=4), count=3, recoil_xy=(1, -6.5), recoil_deg=2),
]


def drawn(spans: Spans) -> list[str]:
    mask, _ = spans.to_mask()
    return ["".join("#" if v else "." for v in row) for row in mask.tolist()]


@pytest.mark.parametrize("weapon", EVERY, ids=lambda w: w.kind)
def test_json_round_trip(weapon: Weapon) -> None:
    again = weapon_from_json(weapon.to_json())
    assert again == weapon and hash(again) == hash(weapon)
    scene = Scene((40, 40))
    scene.add(np.ones((30, 30), np.bool_), (20, 20))
    shots = [(18, 18), (3.7, 29)]
    assert fire(scene, weapon, shots, aim=33, seed=5) == fire(scene, again, shots, aim=33, seed=5)


def test_weapons_differ_by_any_field() -> None:
    assert Disc(4) != Disc(5) and Disc(4) != Disc(4, pierce=True) and Disc(4) != Ring(0, 4)
    assert len({Disc(4), Disc(4), Disc(5)}) == 2


@pytest.mark.parametrize(("width", "height"), [(1, 1), (4, 3), (5, 2), (6, 6)])
def test_box_is_exactly_its_size_and_even_sides_lie_right_and_below(width: int, height: int) -> None:
    spans = Box(width, height).spans(ONE, 0)
    assert spans.box_xyxy == (-((width - 1) // 2), -((height - 1) // 2), width // 2, height // 2)
    assert spans.count == width * height


@pytest.mark.parametrize("weapon", PLAIN, ids=lambda w: w.kind)
@pytest.mark.parametrize("degrees", [0, 11, 45, 100.5])
def test_a_quarter_turn_of_the_aim_turns_the_pattern(weapon: Plain, degrees: float) -> None:
    c, s = (int(v) for v in unit(degrees))
    turned = {(-y, x) for x, y in weapon.spans(c, s).pixels().tolist()}
    assert {tuple(p) for p in weapon.spans(-s, c).pixels().tolist()} == turned


def test_stencil_is_aimed_like_a_sprite() -> None:
    stencil = Stencil(ARROW, pivot_xy=(2, 1))
    assert drawn(stencil.spans(ONE, 0)) == ARROW
    assert drawn(stencil.spans(0, ONE)) == [".#..", ".##.", "####", ".##.", ".#.."]
    assert stencil.spans(ONE, 0).box_xyxy == (-2, -1, 2, 2)


def test_arrays_are_taken_and_left_as_they_were() -> None:
    mask = np.eye(3, dtype=np.bool_)
    stencil = Stencil(mask)
    mask[0, 0] = False
    assert drawn(stencil.spans(ONE, 0)) == ["#..", ".#.", "..#"]
    points = np.array([(-2.0, -2), (2, -2), (0, 3)])
    polygon = Polygon(points)  # type: ignore[arg-type]
    points[:] = 0
    assert polygon.spans(ONE, 0).count > 8


@given(st.integers(0, 10**6), st.integers(1, 2**28), st.sampled_from(["linear", "smooth"]))
def test_weights_are_exact(distance2: int, reach_256: int, falloff: str) -> None:
    lost = isqrt(int(Fraction(65535 * 256, reach_256) ** 2 * distance2))
    weight = max(65535 - lost, 0)
    if falloff == "smooth":
        weight = weight**2 * (3 * 65535 - 2 * weight) // 65535**2
    assert falloff_weights(np.array([distance2]), falloff, reach_256).tolist() == [weight]


@given(st.integers(2**15, 65535), st.integers(2**27, 2**28))
def test_weights_are_exact_just_short_of_a_whole_number(lost: int, reach_256: int) -> None:
    """The greatest distance that loses less than `lost`: the float is often nearer to it than its error."""
    distance2 = ((lost * reach_256) ** 2 - 1) // (65535 * 256) ** 2
    weights = falloff_weights(np.array([distance2, distance2 + 1]), "linear", reach_256)
    assert weights.tolist() == [65535 - (lost - 1), 65535 - lost]


def test_weights_at_whole_parts_of_the_reach() -> None:
    distances = np.array([0, 1, 9, 25, 225, 226])
    assert falloff_weights(distances, "linear", 15 * 256).tolist() == [65535, 61166, 52428, 43690, 0, 0]
    smooth = falloff_weights(np.arange(16) ** 2, "smooth", 15 * 256)
    assert smooth[0] == 65535 and smooth[15] == 0 and (np.diff(smooth) < 0).all()


def test_falloff_goes_into_the_rows() -> None:
    scene = Scene()
    scene.add(np.ones((1, 30), np.bool_), (15, 0))
    for at in ((0, 0), (20, 0)):
        (row,) = fire(scene, Beam(10, 0, falloff="linear"), at)
        seen = [abs(x - at[0]) for x in range(at[0], at[0] + 11) if 0 <= x - 1 < 30]
        assert row.weight == sum(65535 - isqrt(65535**2 * d * d // 100) for d in seen)
    (full,) = fire(scene, Beam(10, 0), (5, 0))
    assert full.weight == 65535 * full.samples


def test_patterns_are_made_once() -> None:
    assert pattern_of(Disc(7), ONE, 0) is pattern_of(Disc(7), ONE, 0)


DISC = {"kind": "disc", "radius": 3}
BAD: list[tuple[Any, str]] = [
    (7, "expected an object with a kind"),
    ({}, "kind: expected one of"),
    ({"kind": "disk", "radius": 3}, "did you mean 'disc'?"),
    ({"kind": "disc"}, "radius: expected a value, got nothing"),
    ({**DISC, "radios": 3}, "key: expected one of"),
    ({**DISC, "radius": "3"}, "radius: expected numbers"),
    ({**DISC, "radius": [3]}, "radius: expected shape ()"),
    ({**DISC, "radius": -1}, "radius: expected a number from 0"),
    ({**DISC, "radius": float("nan")}, "radius: expected a finite number"),
    ({**DISC, "radius": 2**20 + 1}, "radius: expected a number from 0 to"),
    ({**DISC, "pierce": 1}, "pierce: expected true or false"),
    ({**DISC, "falloff": "lineer"}, "did you mean 'linear'?"),
    ({"kind": "ring", "inner_radius": 5, "outer_radius": 4}, "inner_radius: expected at most 4"),
    ({"kind": "box", "width": 2.5, "height": 3}, "width: expected a whole number"),
    ({"kind": "box", "width": 0, "height": 3}, "width: expected a whole number"),
    ({"kind": "polygon", "points": [[0, 0], [1, 1]]}, "points: expected 3 points or more, got 2"),
    ({"kind": "polygon", "points": [[0, 0, 0]] * 3}, "points: expected shape (any, 2)"),
    ({"kind": "polygon", "points": [[0, 0], [1, float("inf")], [2, 2]]}, "points[1][1]: expected a finite number"),
    ({"kind": "polygon", "points": [[0, 0], [4, 0], [0, 4]], "holes": [[[1, 1]]]}, "holes[0]: expected 3 points"),
    ({"kind": "polygon", "points": [[0, 0], [4, 0], [0, 4]], "holes": 3}, "holes: expected a list"),
    ({"kind": "cone", "reach": 9, "angle": 361}, "angle: expected a number from 0 to 360"),
    ({"kind": "beam", "length": -9, "width": 1}, "length: expected a number from 0"),
    ({"kind": "stencil", "mask": ["##", "#"]}, "mask[1]: expected 2 of '#' and '.'"),
    ({"kind": "stencil", "mask": ["#x"]}, "mask[0]: expected 2 of '#' and '.'"),
    ({"kind": "stencil", "mask": 5}, "mask: expected"),
    ({"kind": "stencil", "mask": [[0, 2]]}, "mask[0][1]: expected 0 or 1"),
    ({"kind": "spread", "pellet": 3, "count": 2, "radius": 1}, "pellet: expected an object with a kind"),
    ({"kind": "spread", "pellet": {**DISC, "radius": -1}, "count": 2, "radius": 1}, "pellet: radius: expected"),
    ({"kind": "spread", "pellet": DISC, "count": 0, "radius": 1}, "count: expected a whole number from 1"),
    ({"kind": "spread", "pellet": DISC, "count": 10**9, "radius": 1}, "count: expected a whole number from 1"),
    ({"kind": "rounds", "weapon": DISC, "count": 2, "recoil_xy": [1]}, "recoil_xy: expected shape (2,)"),
    ({"kind": "rounds", "weapon": DISC, "count": True}, "count: expected a whole number"),
]


@pytest.mark.parametrize(("data", "told"), BAD)
def test_bad_weapons_are_refused_by_name(data: Any, told: str) -> None:
    with pytest.raises(InputError) as caught:
        weapon_from_json(data, "weapons.gun")
    assert str(caught.value).startswith("weapons.gun: ") and told in str(caught.value)


def test_a_spread_holds_one_pattern_and_rounds_no_rounds() -> None:
    spread = {"kind": "spread", "pellet": DISC, "count": 2, "radius": 3}
    with pytest.raises(InputError, match=r"pellet: kind: expected one of .*'projectile', got 'spread'"):
        weapon_from_json({**spread, "pellet": spread})
    rounds = {"kind": "rounds", "weapon": DISC, "count": 2}
    with pytest.raises(InputError, match=r"weapon: kind: expected one of .*'sweep', got 'rounds'"):
        weapon_from_json({**rounds, "weapon": rounds})
    with pytest.raises(InputError, match="pellet: expected a weapon of one pattern"):
        Spread(Rounds(Disc(1), 2), 2, 3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="weapon: expected a weapon other than rounds"):
        Rounds(Rounds(Disc(1), 2), 2)  # type: ignore[arg-type]


def test_recoil_shifts_and_turns_each_round() -> None:
    scene = Scene()
    scene.add(np.ones((101, 101), np.bool_), (0, 0))
    hits = fire(scene, Rounds(Point(), count=4, recoil_xy=(2.5, -3)), (0, 0))
    assert hits.first_xy.tolist() == [[0, 0], [3, -3], [5, -6], [8, -9]]
    assert hits.distance2.tolist() == [0, 0, 0, 0]
    turned = fire(scene, Rounds(Beam(20, 0), count=2, recoil_deg=90), (0, 0), aim=0)
    alone = [fire(scene, Beam(20, 0), (0, 0), aim=angle).samples_at(0).xy.tolist() for angle in (0, 90)]
    assert turned.samples_at(0).xy.tolist() == alone[0] + alone[1]


def test_a_shot_aimed_toward_a_point_passes_through_it() -> None:
    for x, y in ((30, 40), (-7.2, 2.1), (0.25, -60), (-50, -50), (3.4, 90.3)):
        xy = fire(Scene(), Beam(100, 0), (0, 0), toward=(x, y)).samples_at(0).xy.tolist()
        assert [floor(x + 0.5), floor(y + 0.5)] in xy


@pytest.mark.parametrize(
    ("weapon", "plain"),
    [
        (Disc(np.int64(3), pierce=np.bool_(True)), Disc(3, pierce=True)),  # type: ignore[arg-type]
        (Disc(np.float32(2.5)), Disc(2.5)),  # type: ignore[arg-type]
        (Box(3.0, np.int8(4)), Box(3, 4)),  # type: ignore[arg-type]
        (Cone(np.array(9), 40), Cone(9.0, 40.0)),  # type: ignore[arg-type]
        (Spread(Point(), np.int64(4), 3), Spread(Point(), 4, 3.0)),  # type: ignore[arg-type]
        (Rounds(Point(), np.uint8(2), np.array([1, 2])), Rounds(Point(), 2, (1.0, 2.0))),  # type: ignore[arg-type]
    ],
)
def test_numbers_of_numpy_are_kept_as_plain_ones(weapon: Weapon, plain: Weapon) -> None:
    assert weapon == plain and hash(weapon) == hash(plain)
    assert json.loads(json.dumps(weapon.to_json())) == plain.to_json()
    assert fire(Scene(), weapon, (0, 0)) == fire(Scene(), plain, (0, 0))


def test_pellets_of_a_burst_are_limited_as_a_whole() -> None:
    assert Rounds(Spread(Point(), 256, 5), 256).count == 256
    with pytest.raises(InputError, match="count: expected a whole number from 1 to 256, got 257"):
        Rounds(Spread(Point(), 256, 5), 257)


def test_patterns_that_are_kept_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Kept(20_000, arsenal._kept.size)
    monkeypatch.setattr(arsenal, "_kept", kept)
    for degrees in range(60):
        pattern_of(Beam(40, 2), *(int(v) for v in unit(degrees)))
        assert kept.bytes == sum(p.nbytes for p in kept.values.values()) <= 20_000
    assert len(kept.values) > 3


@pytest.mark.parametrize(
    "weapon", [Disc(3), Rounds(Spread(Disc(2), 3, 4), 2), Sweep(Laser(9), 3, 20), Stencil(["##", "#."])]
)
def test_a_weapon_that_was_fired_can_be_copied(weapon: Weapon) -> None:
    """What is worked out of its fields and kept with it is no part of it."""
    scene = Scene((30, 30))
    scene.add(Sprite.circle(5), (15, 15))
    hits, told = fire(scene, weapon, (12, 12)), repr(weapon)
    for copied in (copy.deepcopy(weapon), pickle.loads(pickle.dumps(weapon))):
        assert copied == weapon and repr(copied) == told and fire(scene, copied, (12, 12)) == hits
