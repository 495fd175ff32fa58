"""Triangles in space: rows by hand, laws over families, and truth by whole numbers; faces of meshes by brute force."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from itertools import permutations, product
from pathlib import Path
from typing import Any

import adversarial
import numpy as np
import oracle_volumes
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import InputError
from hitplanes.planes.broadphase import triangles
from hitplanes.planes.broadphase.triangles import Mesh, meeting_faces, triangles_meet
from hitplanes.planes.common.limits import CHUNK_ROWS
from hitplanes.planes.volumes import exact

ROOT = Path(__file__).parent.parent
TINY = 5e-324
UP = float(np.nextafter(2.0, 3))

FLOOR = ((0, 0, 0), (4, 0, 0), (0, 4, 0))
TILTED = ((0, 0, 0), (4, 0, 4), (0, 4, 8))
LINE = ((0, 0, 0), (1, 2, 3), (2, 4, 6))
SPOT = ((1, 2, 3),) * 3
FAR = 2.0**40
SLIVER = ((0, 0, 0), (FAR, 1, 0), (0, 1, 0))
FLOORS: Any = np.array(FLOOR, float)

HAND: dict[str, tuple[Any, Any, bool]] = {
    "shared edge": (FLOOR, ((0, 0, 0), (4, 0, 0), (0, 1, 5)), True),
    "shared edge, coplanar": (FLOOR, ((0, 0, 0), (4, 0, 0), (1, -3, 0)), True),
    "part of an edge shared": (FLOOR, ((1, 0, 0), (3, 0, 0), (0, 1, 5)), True),
    "on the line of an edge, beyond it": (FLOOR, ((5, 0, 0), (7, 0, 0), (6, 1, 5)), False),
    "shared corner": (FLOOR, ((4, 0, 0), (5, 1, 1), (5, -1, 2)), True),
    "shared corner, each through the other's plane": (FLOOR, ((0, 0, 0), (-5, 1, 1), (-5, 1, -1)), True),
    "corner on the face": (FLOOR, ((1, 1, 0), (1, 1, 1), (2, 1, 1)), True),
    "corner above the face": (FLOOR, ((1, 1, TINY), (1, 1, 1), (2, 1, 1)), False),
    "corner in the plane, off the face": (FLOOR, ((3, 3, 0), (1, 1, 1), (2, 1, 1)), False),
    "corner on an edge": (FLOOR, ((2, 2, 0), (3, 3, 1), (3, 3, -1)), True),
    "corner beside an edge": (FLOOR, ((UP, 2, 0), (3, 3, 1), (3, 3, -1)), False),
    "edge on the face": (FLOOR, ((1, 1, 0), (2, 1, 0), (2, 1, 3)), True),
    "edge across the face": (FLOOR, ((-1, 1, 0), (9, 1, 0), (2, 1, 3)), True),
    "edge in the plane, off the face": (FLOOR, ((-1, 0, 0), (0, -1, 0), (0, 0, 1)), False),
    "edge in the plane, one end on an edge": (FLOOR, ((2, 2, 0), (3, 3, 0), (2, 2, 3)), True),
    "edges cross": (FLOOR, ((2, -1, -1), (2, 1, 1), (2, -9, 5)), True),
    "edges cross, an ulp apart": (FLOOR, ((2, -1 - 2**-52, -1), (2, 1, 1), (2, -9, 5)), False),
    "like a cross": (((-2, 0, -1), (2, 0, -1), (0, 0, 2)), ((0, -2, 0), (0, 2, 0), (0, 0, 3)), True),
    "through the inside": (FLOOR, ((1, 1, 1), (1, 1, -1), (9, 9, 0)), True),
    "around it": (((1, 1, -1), (1, 1, 1), (2, 1, 0)), ((-9, -9, 0), (30, 0, 0), (0, 30, 0)), True),
    "through the plane beside it": (FLOOR, ((UP, 2, 1), (UP, 2, -1), (3, 3, 1)), False),
    "both through the other's plane, one after the other": (FLOOR, ((5, 1, -1), (5, 1, 1), (9, 1, 0)), False),
    "intervals touch": (FLOOR, ((3, 1, -1), (3, 1, 1), (9, 1, 0)), True),
    "coplanar, inside": (FLOOR, ((0.5, 0.5, 0), (1, 0.5, 0), (0.5, 1, 0)), True),
    "coplanar, touching in a corner": (FLOOR, ((2, 2, 0), (5, 2, 0), (5, 3, 0)), True),
    "coplanar, corner to corner": (FLOOR, ((4, 0, 0), (5, 0, 0), (5, 1, 0)), True),
    "coplanar, like a star": (FLOOR, ((2, -1, 0), (-1, 2, 0), (2.5, 2.5, 0)), True),
    "coplanar, apart": (FLOOR, ((5, 5, 0), (6, 5, 0), (5, 6, 0)), False),
    "coplanar, apart while their boxes meet": (FLOOR, ((3, 3, 0), (4, 2, 0), (4, 4, 0)), False),
    "tilted, coplanar, touching": (TILTED, ((2, 2, 6), (3, 3, 9), (3, 2, 7)), True),
    "tilted, coplanar, apart": (TILTED, ((3, 3, 9), (3, 2, 7), (2, 3, 8)), False),
    "parallel planes": (FLOOR, ((0, 0, 1), (4, 0, 1), (0, 4, 1)), False),
    "parallel planes, the least apart": (FLOOR, ((0, 0, TINY), (4, 0, TINY), (0, 4, TINY)), False),
    "equal": (TILTED, TILTED, True),
    "equal, turned over": (TILTED, TILTED[::-1], True),
    "slivers that cross": (SLIVER, ((FAR / 2, 0.5, -9), (FAR / 2, 0.5, 9), (0, 0, 10)), True),
    "slivers, side by side": (SLIVER, ((0, -1, 0), (FAR, -1, 0), (FAR, 0, 0)), False),
    "slivers, side on side": (SLIVER, ((-FAR, -1, 0), (2 * FAR, 2, 0), (2 * FAR, -1, 0)), True),
    "slivers, an ulp aside": (SLIVER, ((-FAR, -1, 0), (2 * FAR, 2 - 2**-52, 0), (2 * FAR, -1, 0)), False),
    "signed zeros": (((0.0, -0.0, 0), (4, -0.0, 0), (0, 4, -0.0)), ((-0.0, 0, -0.0), (-4, 0, -1), (-4, -1, 0)), True),
    "segment through the face": (FLOOR, ((1, 1, -1), (1, 1, 2), (1, 1, 0.5)), True),
    "segment past the face": (FLOOR, ((3, 3, -1), (3, 3, 2), (3, 3, 0.5)), False),
    "segment through a corner": (FLOOR, ((4, 0, -1), (4, 0, 2), (4, 0, 0.5)), True),
    "segment past a corner, in a line with an edge": (FLOOR, ((5, 0, -1), (5, 0, 2), (5, 0, 0.5)), False),
    "segment ends on the face": (FLOOR, ((1, 1, 0), (1, 1, 2), (1, 1, 1)), True),
    "segment ends above the face": (FLOOR, ((1, 1, 1), (1, 1, 2), (1, 1, 3)), False),
    "segment on the face": (TILTED, ((1, 1, 3), (2, 1, 4), (3, 1, 5)), True),
    "segment in the plane, off the face": (TILTED, ((3, 2, 7), (4, 2, 8), (5, 2, 9)), False),
    "segment with two equal corners": (FLOOR, ((1, 1, -1), (1, 1, -1), (1, 1, 2)), True),
    "segments that cross": (LINE, ((1, 2, 0), (1, 2, 9), (1, 2, 5)), True),
    "segments that touch in an end": (LINE, ((2, 4, 6), (2, 4, 9), (2, 4, 8)), True),
    "segments that are skew": (LINE, ((1, UP, 0), (1, UP, 9), (1, UP, 5)), False),
    "segments in one plane, apart": (((0, 0, 0), (4, 0, 0), (2, 0, 0)), ((1, 1, 0), (3, 5, 0), (2, 3, 0)), False),
    "segments that would cross farther on": (LINE, ((1, 2, 4), (1, 2, 9), (1, 2, 5)), False),
    "segments that are parallel": (LINE, ((1, 0, 0), (2, 2, 3), (3, 4, 6)), False),
    "segments on a line, apart": (LINE, ((3, 6, 9), (4, 8, 12), (5, 10, 15)), False),
    "segments on a line, end to end": (LINE, ((2, 4, 6), (3, 6, 9), (4, 8, 12)), True),
    "segments on a line, one in the other": (LINE, ((0.25, 0.5, 0.75), (0.5, 1, 1.5), (0.5, 1, 1.5)), True),
    "point on the face": (FLOOR, ((1, 1, 0),) * 3, True),
    "point on the face, tilted": (TILTED, ((1, 1, 3),) * 3, True),
    "point on a corner": (FLOOR, ((4, 0, 0),) * 3, True),
    "point above the face": (FLOOR, ((1, 1, 1),) * 3, False),
    "point in the plane, off the face": (FLOOR, ((3, 3, 0),) * 3, False),
    "point on the segment": (LINE, ((0.5, 1, 1.5),) * 3, True),
    "point beside the segment": (LINE, ((0.5, 1, 1.25),) * 3, False),
    "point beyond the segment": (LINE, ((3, 6, 9),) * 3, False),
    "point and itself": (SPOT, SPOT, True),
    "point and another": (SPOT, ((1, 2, 4),) * 3, False),
}  # fmt: skip
BY_HAND = pytest.mark.parametrize(("a", "b", "expected"), HAND.values(), ids=HAND)
WHOLE = [row for name, row in HAND.items() if all(float(v).is_integer() for p in row[:2] for v in np.ravel(p))]


def rows_of(cases: list[tuple[Any, Any]]) -> tuple[Any, Any]:
    a, b = (np.array([case[k] for case in cases], float).reshape(-1, 3, 3) for k in (0, 1))
    return a, b


def adversarial_rows(count: int, seed: int, *families: str) -> tuple[list[str], Any, Any]:
    made = list(adversarial.triangle_cases(count, seed, families or tuple(adversarial.TRIANGLE_FAMILIES)))
    return [name for name, *_ in made], *rows_of([(a, b) for _, a, b in made])


def truth(a: Any, b: Any) -> Any:
    rows = [[tuple(map(tuple, p)) for p in pair] for pair in zip(a.tolist(), b.tolist(), strict=True)]
    return np.array([oracle_volumes.triangles_meet(p, q) for p, q in rows], bool)


# By hand


@BY_HAND
def test_by_hand(a: Any, b: Any, expected: bool) -> None:
    """In every order of the corners, and both ways round."""
    p, q = rows_of(list(product(permutations(a), permutations(b))))
    assert (triangles_meet(p, q) == expected).all()
    assert (triangles_meet(q, p) == expected).all()
    assert not expected or triangles_meet(a, b, conservative=True)


def test_hand_rows_are_true() -> None:
    a, b = rows_of([row[:2] for row in HAND.values()])
    assert truth(a, b).tolist() == [row[2] for row in HAND.values()]


MOVES: dict[str, Callable[[Any], Any]] = {
    "whole numbers": lambda p: p + np.array([2.0**45, -7, 12345]),
    "mirrored": lambda p: p * [1, -1, 1],
    "turned inside out": lambda p: -p,
    "axes turned": lambda p: p[..., [1, 2, 0]],
    "axes swapped": lambda p: p[..., [1, 0, 2]],
    "small": lambda p: p * 2.0**-200,
    "least": lambda p: p * 2.0**-1074,
    "large": lambda p: p * 2.0**200,
    "largest": lambda p: p * 2.0**970,
    "each axis by its own": lambda p: p * [2.0**-300, 2.0**300, 1],
    "sheared": lambda p: p + p[..., [1]] * [3, 0, -2],
}


@pytest.mark.parametrize("move", MOVES)
def test_whole_numbers_moved(move: str) -> None:
    """What keeps whole numbers exact changes nothing, on rows by hand and on a lattice, with planes of its own."""
    rng = np.random.default_rng(3)
    a, b = rng.integers(-2, 3, (2, 600, 3, 3)).astype(float)
    a[:200, :, 2] = b[:200, :, 2] = 1
    for rows, one, other in ((slice(200, 300), 1, 2), (slice(300, 400), 0, 2), (slice(400, 500), 0, 1)):
        a[rows, :, one], b[rows, :, one] = a[rows, :, other], b[rows, :, other]
    hand = rows_of([row[:2] for row in WHOLE])
    a, b = np.concatenate((hand[0], a)), np.concatenate((hand[1], b))
    before = triangles_meet(a, b)
    assert 0.2 < before.mean() < 0.8
    assert (triangles_meet(MOVES[move](a), MOVES[move](b)) == before).all()


# Laws over families


@pytest.mark.parametrize("family", adversarial.TRIANGLE_FAMILIES)
def test_laws(family: str) -> None:
    """Symmetric; the same for any order of corners; mirrored; conservative never says no wrongly."""
    rng = np.random.default_rng(5)
    _, a, b = adversarial_rows(150, 2, family)
    found = triangles_meet(a, b)
    assert found.dtype == np.bool_ and found.shape == (150,) and 0 < found.sum() < 150
    assert (found == truth(a, b)).all()
    assert (triangles_meet(b, a) == found).all()
    order = rng.permuted(np.tile(np.arange(3), (150, 1)), axis=1)
    assert (triangles_meet(np.take_along_axis(a, order[..., None], axis=1), b) == found).all()
    assert (triangles_meet(-a, -b) == found).all()
    assert (triangles_meet(a[..., ::-1], b[..., ::-1]) == found).all()
    assert triangles_meet(a, b, conservative=True)[found].all()
    assert triangles_meet(a, a).all() and triangles_meet(a, a[:, [0, 0, 0]]).all()


@pytest.mark.parametrize("family", adversarial.TRIANGLE_FAMILIES)
def test_scaling(family: str) -> None:
    """By powers of two, which round nothing: products of three are then huge, or lose digits, or are lost."""
    _, a, b = adversarial_rows(150, 3, family)
    found = triangles_meet(a, b)
    for power in (300, -300, -345, -350, -355, -600):
        with np.errstate(all="ignore"):
            p, q = np.ldexp(a, power), np.ldexp(b, power)
            same = (np.ldexp(p, -power) == a) & (np.ldexp(q, -power) == b) & np.isfinite(p) & np.isfinite(q)
        rows = same.all(axis=(1, 2))
        assert (triangles_meet(p[rows], q[rows]) == found[rows]).all()


@pytest.mark.parametrize("axis", range(3))
def test_stretched_along_an_axis(axis: int) -> None:
    """What is near a plane is in doubt, however large one coordinate makes all the others look small."""
    _, a, b = adversarial_rows(400, 4, "near_touching", "near_coplanar")
    stretch = np.ones(3)
    stretch[axis] = 2.0**40
    assert (triangles_meet(a * stretch, b * stretch) == truth(a, b)).all()


def test_one_is_small_and_the_other_reaches_far_from_it() -> None:
    """A corner of the small one touches the large one at its corner, or all of it lies in the other's plane."""
    rng = np.random.default_rng(8)
    sides = rng.uniform(1e9, 2e9, (2, 300, 3))
    corner = rng.uniform(0, 1, (300, 3))
    large = np.stack((corner, corner + sides[0], corner + sides[1]), axis=1)
    shares = rng.uniform(0, 2e-10, (2, 300, 1))
    place = corner + shares[0] * sides[0] + shares[1] * sides[1]
    normal = np.cross(sides[0] / 1e9, sides[1] / 1e9)
    away = rng.normal(size=(2, 300, 3))
    away *= np.sign((away * normal).sum(axis=2))[..., None]
    small = np.stack((place, place + away[0], place + away[1]), axis=1)
    shares = rng.uniform(-2e-10, 4e-10, (2, 300, 3, 1))
    level = corner[:, None] + shares[0] * sides[0][:, None] + shares[1] * sides[1][:, None]
    for near in (small, level):
        expected = truth(near, large)
        assert 0.2 < expected.mean() < 0.8
        for sign in (1, -1):
            assert (triangles_meet(near * sign, large * sign) == expected).all()
            assert (triangles_meet(large * sign, near * sign) == expected).all()


def test_products_at_the_end_of_the_range() -> None:
    """A sum of three products may be infinite and have the wrong sign; all rows at once, and some one by one."""
    rng = np.random.default_rng(9)
    a, b = rng.uniform(-1, 1, (2, 2000, 3, 3))
    found = triangles_meet(a, b)
    for power in range(326, 346, 2):
        large = np.ldexp(a, power), np.ldexp(b, power)
        assert (triangles_meet(*large) == found).all()
        assert triangles_meet(*large, conservative=True)[found].all()
    few = np.ldexp(a[600:800], 342), np.ldexp(b[600:800], 342)
    assert [bool(triangles_meet(*pair)) for pair in zip(*few, strict=True)] == found[600:800].tolist()


# Against truth


def test_adversarial_rows_are_right() -> None:
    names, a, b = adversarial_rows(4400, 1)
    wrong = [names[i] for i in np.flatnonzero(triangles_meet(a, b) != truth(a, b))]
    assert wrong == []


def test_near_coplanar_rows_are_right() -> None:
    _, a, b = adversarial_rows(1500, 2, "near_coplanar")
    assert (triangles_meet(a, b) == truth(a, b)).all()


@pytest.mark.long
@pytest.mark.parametrize("family", adversarial.TRIANGLE_FAMILIES)
def test_many_rows_are_right(family: str) -> None:
    """20,000 of each family, and nearly coplanar ones three times."""
    for seed in (11, 12, 13) if family == "near_coplanar" else (11,):
        _, a, b = adversarial_rows(20_000, seed, family)
        expected = truth(a, b)
        assert (triangles_meet(a, b) == expected).all()
        assert triangles_meet(a, b, conservative=True)[expected].all()


CORNERS = st.tuples(*[st.integers(-2, 2)] * 3)
TRIANGLES = st.tuples(CORNERS, CORNERS, CORNERS)


@given(st.lists(st.tuples(TRIANGLES, TRIANGLES), min_size=1, max_size=20), st.sampled_from([1.0, 2.0**-1074, 1e150]))
@examples(100, deadline=None)
def test_a_small_lattice_is_right(cases: list[Any], unit: float) -> None:
    a, b = rows_of(cases)
    assert (triangles_meet(a * unit, b * unit) == truth(a, b)).all()
    assert triangles_meet(a * unit, b * unit, conservative=True)[truth(a, b)].all()


def test_a_plane_of_few_numbers_is_right() -> None:
    """Coplanar, in planes of all directions, a third of them segments."""
    rng = np.random.default_rng(6)
    flat = rng.integers(-2, 3, (2, 900, 3, 2)).astype(float)
    flat[0, ::3, 2] = flat[0, ::3, 0]
    flat[1, ::4, 2] = flat[1, ::4, 1]
    frame = rng.integers(-2, 3, (900, 2, 3)).astype(float)
    a, b = (flat[..., 0, None] * frame[:, None, 0] + flat[..., 1, None] * frame[:, None, 1]) + 5
    assert (triangles_meet(a, b) == truth(a, b)).all()


def test_segments_of_few_numbers_are_right() -> None:
    """Pairs of segments and points, of any directions: skew, crossing, on one line."""
    rng = np.random.default_rng(7)
    a, b = rng.integers(-1, 2, (2, 1500, 3, 3)).astype(float)
    a[:, 2] = 2 * a[:, 1] - a[:, 0]
    b[:, 1] = np.where(rng.random((1500, 1)) < 0.5, b[:, 0], (b[:, 0] + b[:, 2]) / 2)
    a[:100], b[:100] = a[:100, :1], b[:100, :1]
    order = rng.permutation(3)
    assert (triangles_meet(a[:, order], b) == truth(a, b)).all()


# Rows and chunks


def test_leading_axes_broadcast() -> None:
    _, a, b = adversarial_rows(24, 4)
    grid = triangles_meet(a[:, None], b)
    assert grid.shape == (24, 24)
    for i in range(24):
        assert (grid[i] == triangles_meet(a[i], b)).all() and (grid[i] == triangles_meet([a[i].tolist()] * 24, b)).all()
    one = triangles_meet(FLOOR, TILTED)
    assert one.shape == () and one.dtype == np.bool_ and bool(one)
    assert triangles_meet(a[:0], b[:0]).shape == (0,) == triangles_meet(a[:0], FLOOR).shape
    assert triangles_meet(a[:0, None], b).shape == (0, 24)


def test_inputs_in_any_memory_are_left_as_they_are() -> None:
    names, a, b = adversarial_rows(110, 8)
    before, found = (a.copy(), b.copy()), triangles_meet(a, b)
    assert (a == before[0]).all() and (b == before[1]).all()
    a.flags.writeable = False
    assert (triangles_meet(a[::-1], np.asfortranarray(b)[::-1]) == found[::-1]).all()
    whole = np.array([name == "lattice" for name in names])
    for kind in (np.int64, np.float32):
        assert (triangles_meet(a[whole].astype(kind), b[whole]) == found[whole]).all()


@pytest.mark.parametrize("rows", [CHUNK_ROWS - 1, CHUNK_ROWS, CHUNK_ROWS + 1, 2 * CHUNK_ROWS + 5])
def test_every_row_of_every_chunk_is_answered(rows: int) -> None:
    rng = np.random.default_rng(rows)
    a, b = rng.uniform(0, 9, (2, rows, 3, 3))
    hard = rng.integers(0, rows, 60)
    _, a[hard], b[hard] = adversarial_rows(60, 6)
    look = np.concatenate([hard, rng.integers(0, rows, 100), [0, rows - 1]])
    assert (triangles_meet(a, b)[look] == truth(a[look], b[look])).all()


def test_ordinary_rows_cost_no_integers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither do corners that both have, nor a corner level with a plane along an axis; a hard row does."""
    rng = np.random.default_rng(4)
    a, b = rng.uniform(0, 2000, (2, 20_000, 3, 3))
    found = triangles_meet(a, b)
    assert 0.1 < found.mean() < 0.9

    def none(*_: object) -> None:
        raise AssertionError("an exact stage")

    monkeypatch.setattr(exact, "_exact", none)
    assert (triangles_meet(a, b) == found).all()
    assert (triangles_meet(a, b, conservative=True) == found).all()
    other = b.copy()
    other[:, 1:] = a[:, :2]
    assert triangles_meet(a, other).all() and triangles_meet(other, a, conservative=True).all()
    assert not triangles_meet(FLOOR, ((3, 3, 0), (1, 1, 1), (2, 1, 1)))
    with pytest.raises(AssertionError, match="an exact stage"):
        triangles_meet(TILTED, ((1, 1, 3), (2, 1, 7), (2, 3, 19)))
    _, a, b = adversarial_rows(220, 9)
    assert triangles_meet(a, b, conservative=True).any()


def test_decided_rows_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second plane is made for what the first leaves, intervals for what both leave, and only the odd are odd."""
    seen: list[tuple[str, int]] = []

    def spied(name: str, place: int) -> None:
        true = getattr(triangles, name)

        def counted(*args: Any) -> Any:
            seen.append((name, np.shape(args[place])[-1]))
            return true(*args)

        monkeypatch.setattr(triangles, name, counted)

    for name, place in (("_sides", 1), ("_intervals_meet", 3), ("_special", 2)):
        spied(name, place)
    kinds = ["parallel planes", "corner above the face", "through the inside", "coplanar, inside", "shared corner"]
    counts = [50, 20, 10, 5, 3]
    a, b = rows_of([HAND[name][:2] for name, n in zip(kinds, counts, strict=True) for _ in range(n)])
    assert triangles_meet(a, b).sum() == 18
    assert seen == [("_sides", 88), ("_sides", 35), ("_special", 5), ("_intervals_meet", 10)]


def test_rows_of_all_sizes_in_one_chunk() -> None:
    """One huge triangle makes the chunk's bound useless: each row has its own."""
    _, a, b = adversarial_rows(330, 10)
    assert (triangles_meet(a, b) == [bool(triangles_meet(p, q)) for p, q in zip(a, b, strict=True)]).all()


def test_conservative_tells_apart_what_boxes_or_planes_tell() -> None:
    """It says yes where a corner might be in a plane, unless the boxes are apart."""
    for name in ("coplanar, apart", "segments on a line, apart", "parallel planes", "point above the face"):
        assert not triangles_meet(*HAND[name][:2], conservative=True)
    assert triangles_meet(*HAND["coplanar, apart while their boxes meet"][:2], conservative=True)


# Bad input


BAD: list[tuple[Callable[[], Any], str]] = [
    (lambda: triangles_meet(FLOOR[:2], FLOOR), r"a: expected shape \(\.\.\., 3, 3\), got \(2, 3\)"),
    (lambda: triangles_meet(FLOOR, 5), r"b: expected shape \(\.\.\., 3, 3\), got \(\)"),
    (lambda: triangles_meet(FLOOR, [[SPOT[0], SPOT[0], (0, 1, np.nan)]]), r"b\[0\]\[2\]\[2\]: .* number, got nan"),
    (lambda: triangles_meet([[0, 0, -np.inf]] * 3, FLOOR), r"a\[0\]\[2\]: .* a finite number, got -inf"),
    (lambda: triangles_meet(FLOOR, [[0, np.inf, 0]] * 3), r"b\[0\]\[1\]: .* a finite number, got inf"),
    (lambda: triangles_meet([["x"] * 3] * 3, FLOOR), "a: expected numbers"),
    (lambda: triangles_meet([FLOOR] * 2, [FLOOR] * 3), r"b: .* broadcast with \(2, 3, 3\), got \(3, 3, 3\)"),
    (lambda: triangles_meet(FLOOR, FLOOR, 1), "conservative: expected true or false, got 1"),  # type: ignore[arg-type]
    (lambda: Mesh([[0, 0]], [[0, 0, 0]]), r"points: expected shape \(any, 3\), got \(1, 2\)"),
    (lambda: Mesh([[0, 0, np.nan]], [[0, 0, 0]]), r"points\[0\]\[2\]: expected a finite number"),
    (lambda: Mesh(FLOOR, [[0, 1, 3]]), r"faces\[0\]\[2\]: expected a whole number from 0 to 2, got 3"),
    (lambda: Mesh(FLOOR, [[0, 1, -1]]), r"faces\[0\]\[2\]: expected a whole number from 0 to 2, got -1"),
    (lambda: Mesh(FLOOR, [[0, 1]]), r"faces: expected shape \(any, 3\), got \(1, 2\)"),
    (lambda: meeting_faces(Mesh(FLOOR, [[0, 1, 2]]), FLOOR), "b: expected a mesh, got tuple"),  # type: ignore[arg-type]
    (lambda: meeting_faces([], Mesh(FLOOR, [[0, 1, 2]])), "a: expected a mesh, got list"),  # type: ignore[arg-type]
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), BAD)
def test_bad_input_is_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


# Meshes


def heap(n: int, seed: int, reach: int = 6) -> Mesh:
    """Faces over few whole points: many share them, some are flat."""
    rng = np.random.default_rng(seed)
    return Mesh(rng.integers(-reach, reach + 1, (n, 3)), rng.integers(0, n, (2 * n, 3)))


def brute(a: Mesh, b: Mesh) -> Any:
    return np.argwhere(triangles_meet(a.corners[:, None], b.corners)).T


@pytest.mark.parametrize("pieces", [None, 7])
def test_meeting_faces_are_those_of_brute_force(monkeypatch: pytest.MonkeyPatch, pieces: int | None) -> None:
    if pieces:
        monkeypatch.setattr(triangles, "CHUNK_SAMPLES", pieces)
    for seed, reach in ((1, 3), (2, 40)):
        a, b = heap(15, seed, reach), heap(20, seed + 10, reach)
        found = meeting_faces(a, b)
        assert found.dtype == np.int64 and (found == brute(a, b)).all() and 0 < found.shape[1] < 30 * 40
        assert (meeting_faces(b, a) == brute(b, a)).all()
        quick = set(map(tuple, meeting_faces(a, b, conservative=True).T.tolist()))
        assert quick >= set(map(tuple, found.T.tolist()))


def test_boxes_meet_but_faces_do_not() -> None:
    a, b = Mesh(FLOOR, [[0, 1, 2]]), Mesh(((3, 3, 0), (4, 2, 0), (4, 4, 0)), [[0, 1, 2]])
    assert b.tree.query(a.boxes).shape == (2, 1) and meeting_faces(a, b).shape == (2, 0)
    assert meeting_faces(a, b, conservative=True).tolist() == [[0], [0]]


def test_empty_meshes() -> None:
    none, some = Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), heap(5, 1)
    bare = Mesh(FLOOR, np.zeros((0, 3)))
    assert len(none) == len(bare) == 0 and len(some) == 10
    for pair in ((none, some), (some, none), (none, none), (bare, some), (bare, none)):
        found = meeting_faces(*pair)
        assert found.shape == (2, 0) and found.dtype == np.int64


def test_a_mesh_keeps_what_it_was_made_of() -> None:
    points, faces = np.array(FLOOR, float), np.array([[0, 1, 2], [2, 2, 1]])
    mesh = Mesh(points, faces)
    points[:], faces[:] = 9, 0
    assert mesh.corners.tolist() == [np.array(FLOOR).tolist(), [[0, 4, 0], [0, 4, 0], [4, 0, 0]]]
    assert mesh.boxes.tolist() == [[0, 0, 0, 4, 4, 0], [0, 0, 0, 4, 4, 0]]
    assert mesh.tree is mesh.tree and len(mesh.tree) == 2
    for column in (mesh.points, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            column[0, 0] = 1


def test_a_shot_loads_no_triangles() -> None:
    code = """
import sys
from hitplanes import Disc, fire, load_scene
assert fire(load_scene("fixtures/targets"), Disc(300), at=(200, 100))
assert "hitplanes.planes.scene.scene" in sys.modules and "hitplanes.planes.broadphase.triangles" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
