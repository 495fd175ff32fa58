"""The truth that methods are judged by: right by hand, and by the tests' own oracles, which share no code with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import adversarial
import numpy as np
import oracle_projectile
import oracle_raster
import oracle_volumes
import pytest
from test_layout import imports

from hitplanes.weapons.lab.stability import truth

DOWN = math.nextafter(5.0, 4)
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
WEDGE = ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0))
FLAT = ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
NOTCH = ((0.0, 0.0), (8.0, 0.0), (8.0, 8.0), (4.0, 4.0), (0.0, 8.0))

TINY = 5e-324
KNOWN: list[tuple[Callable[..., bool], tuple[Any, ...], bool]] = [
    (truth.circles_meet, ((0.0, 0.0), 2.0, (3.0, 4.0), 3.0), True),
    (truth.circles_meet, ((0.0, 0.0), 2.0, (3.0, 4.0), math.nextafter(3.0, 0)), False),
    (truth.circles_meet, ((0.0, 0.0), 0.0, (0.0, 0.0), 0.0), True),
    (truth.circles_meet, ((0.0, 0.0), TINY, (2 * TINY, 0.0), TINY), True),
    (truth.circles_meet, ((0.0, 0.0), TINY, (3 * TINY, 0.0), TINY), False),
    (truth.circles_meet, ((3e150, 0.0), 2e150, (0.0, 4e150), 3e150), True),
    (truth.boxes_meet, ((0.0, 0.0), (1.0, 1.0), (1.0, 1.0), (2.0, 2.0)), True),
    (truth.boxes_meet, ((0.0, 0.0), (1.0, 1.0), (math.nextafter(1.0, 2), 1.0), (2.0, 2.0)), False),
    (truth.boxes_meet, ((0.0, 0.0), (9.0, 9.0), (4.0, 4.0), (5.0, 5.0)), True),
    (truth.capsule_meets_circle, ((0.0, 0.0), (4.0, 0.0), 0.5, (2.0, 2.0), 1.5), True),
    (truth.capsule_meets_circle, ((0.0, 0.0), (4.0, 0.0), 0.5, (2.0, math.nextafter(2.0, 3)), 1.5), False),
    (truth.capsule_meets_circle, ((0.0, 0.0), (4.0, 0.0), 1.0, (7.0, 4.0), 4.0), True),
    (truth.capsule_meets_circle, ((0.0, 0.0), (4.0, 0.0), 1.0, (-3.0, 4.0), math.nextafter(4.0, 0)), False),
    (truth.capsule_meets_circle, ((1.0, 1.0), (1.0, 1.0), 0.0, (1.0, 1.0), 0.0), True),
    (truth.polygon_holds, (NOTCH, (4.0, 4.0)), True),
    (truth.polygon_holds, (NOTCH, (4.0, math.nextafter(4.0, 5))), False),
    (truth.polygon_holds, (NOTCH, (0.0, 8.0)), True),
    (truth.polygon_holds, (NOTCH, (-1.0, 8.0)), False),
    (truth.polygon_holds, (NOTCH, (6.0, 6.0)), True),
    (truth.circle_meets_polygon, (WEDGE, (5.0, 5.5), 5.0), True),
    (truth.circle_meets_polygon, (WEDGE, (5.0, 5.5), DOWN), False),
    (truth.circle_meets_polygon, (WEDGE[::-1], (1.0, 1.0), 0.0), True),
    (truth.polygons_meet, (WEDGE, ((2.0, 1.5), (3.0, 3.0), (2.0, 3.0))), True),
    (truth.polygons_meet, (WEDGE, ((2.0, math.nextafter(1.5, 2)), (3.0, 3.0), (2.0, 3.0))), False),
    (truth.polygons_meet, (SQUARE, tuple((x + 1, y) for x, y in SQUARE)), True),
    (truth.polygons_meet, (SQUARE, SQUARE[::-1]), True),
    (truth.polygons_meet, (((-9.0, 0.0), (9.0, 0.0), (0.0, 1.0)), ((0.5, -9.0), (0.6, -9.0), (0.5, 9.0))), True),
    (truth.triangles_meet, (FLAT, ((1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (2.0, 1.0, 1.0))), True),
    (truth.triangles_meet, (FLAT, ((1.0, 1.0, TINY), (1.0, 1.0, 1.0), (2.0, 1.0, 1.0))), False),
    (truth.triangles_meet, (FLAT, ((1.0, 1.0, -1.0), (1.0, 1.0, 1.0), (9.0, 9.0, 1.0))), True),
    (truth.triangles_meet, (FLAT, ((2.0, 2.0, 0.0), (4.0, 4.0, 0.0), (5.0, 4.0, 0.0))), True),
    (truth.triangles_meet, (FLAT, ((2.0, math.nextafter(2.0, 3), 0.0), (4.0, 4.0, 0.0), (5.0, 4.0, 0.0))), False),
    (truth.triangles_meet, (FLAT, ((-9.0, 1.0, 0.0), (9.0, 1.0, 0.0), (0.0, 1.5, 0.0))), True),
    (truth.triangles_meet, (FLAT, ((2.0, 3.0, -1.0), (2.0, 3.0, 1.0), (3.0, 3.0, 1.0))), False),
    (truth.segment_meets_cell, ((0, 256), (256, 0), (0, 0)), True),
    (truth.segment_meets_cell, ((0, 257), (256, 1), (0, 0)), False),
    (truth.segment_meets_cell, ((200, 200), (300, 300), (0, 0)), False),
    (truth.segment_meets_cell, ((-300, -300), (300, 300), (0, 0)), True),
    (truth.segment_meets_cell, ((-300, 128), (300, 128), (0, 0)), True),
    (truth.segment_meets_cell, ((-300, 129), (300, 129), (0, 0)), False),
    (truth.segment_meets_cell, ((128, 128), (128, 128), (1, 1)), True),
    (truth.disc_flies_into, ((0, 0), (2560, 0), 200, (5, 0), (0, 0)), True),
    (truth.disc_flies_into, ((0, 456), (2560, 0), 200, (5, 1), (0, 0)), True),
    (truth.disc_flies_into, ((0, 457), (2560, 0), 200, (5, 1), (2560, 0)), False),
    (truth.disc_flies_into, ((0, 0), (0, 0), 0, (1, 0), (-128, 0)), True),
    (truth.disc_flies_into, ((0, 0), (0, 0), 0, (1, 0), (-127, 0)), False),
    (truth.in_disc, (5 * 256, (3, -4)), True),
    (truth.in_disc, (5 * 256 - 1, (3, -4)), False),
    (truth.in_beam, ((1024, 0), 256, (2, 1)), True),
    (truth.in_beam, ((1024, 0), 255, (2, 1)), False),
    (truth.in_beam, ((1024, 384), 0, (1, 1)), True),
]


@pytest.mark.parametrize(("judge", "row", "meet"), KNOWN)
def test_known_cases(judge: Callable[..., bool], row: tuple[Any, ...], meet: bool) -> None:
    assert judge(*row) is meet


def test_it_imports_nothing_of_what_it_judges() -> None:
    names = {found.module.split(".")[0] for found in imports(Path(truth.__file__).read_text(encoding="utf-8"), "")}
    assert names == {"__future__", "collections", "itertools", "typing"}


def test_whole_numbers_are_the_floats_exactly() -> None:
    values = [0.1, -3.0, 2.0**-1074, 1e300, 0.0, 7]
    numbers = truth.whole(values)
    unit = Fraction(values[0]) / numbers[0]
    assert [number * unit for number in numbers] == [Fraction(value) for value in values]


PLANAR: list[tuple[str, str, Callable[..., bool]]] = [
    ("circle", "circle", lambda a, b: truth.circles_meet(*a, *b)),
    ("aabb", "aabb", lambda a, b: truth.boxes_meet(*a, *b)),
    ("capsule", "circle", lambda a, b: truth.capsule_meets_circle(*a, *b)),
    ("polygon", "circle", lambda a, b: truth.circle_meets_polygon(a, *b)),
    ("polygon", "polygon", truth.polygons_meet),
]


@pytest.mark.parametrize(("one", "other", "judge"), PLANAR, ids=lambda v: v if isinstance(v, str) else "")
def test_it_agrees_with_another_truth(one: str, other: str, judge: Callable[..., bool]) -> None:
    count = 0
    for family, a, b in adversarial.cases(one, other, 480, seed=5):
        meeting = oracle_volumes.meets(one, a, other, b)
        assert judge(a, b) == meeting, (family, a, b)
        count += meeting
    assert 100 < count < 400


def test_triangles_agree_with_another_truth() -> None:
    families = [name for name in adversarial.TRIANGLE_FAMILIES if name != "flat"]
    count = 0
    for family, a, b in adversarial.triangle_cases(540, 5, families):
        if truth.has_area(a) and truth.has_area(b):
            assert truth.triangles_meet(a, b) == oracle_volumes.triangles_meet(a, b), (family, a, b)
            count += 1
    assert count > 350


def test_rays_discs_and_patterns_agree_with_other_truths() -> None:
    rng = np.random.default_rng(3)
    found = np.zeros(5, int)
    for _ in range(1500):
        a, b = (tuple(row) for row in (128 * rng.integers(-6, 7, (2, 2)) + rng.integers(-1, 2, (2, 2))).tolist())
        x, y = rng.integers(-3, 4, 2).tolist()
        radius, (wx, wy) = int(rng.choice([0, 100, 256, 360])), (128 * rng.integers(-3, 4, 2)).tolist()
        ring = [tuple(p) for p in (256 * rng.integers(-3, 4, (3, 2))).tolist()]
        step = b[0] - a[0], b[1] - a[1]
        flown = (step[0] - wx, step[1] - wy)
        told = [
            (truth.segment_meets_cell(a, b, (x, y)), oracle_raster.meets_segment_by_clipping(x, y, a, b)),
            (truth.disc_flies_into(a, step, radius, (x, y), (wx, wy)),
             bool(oracle_projectile.intervals(a, flown, radius, (x, y)))),
            (truth.in_disc(radius + 256, (x, y)), oracle_raster.in_disc(x, y, radius + 256)),
            (truth.in_beam(b, radius, (x, y)), oracle_raster.in_beam(x, y, (0, 0), b, radius)),
            (truth.polygon_holds(ring, (256 * x, 256 * y)), oracle_raster.in_polygon(x, y, [ring])),
        ]  # fmt: skip
        for k, (got, expected) in enumerate(told):
            assert got == expected, (k, a, b, (x, y), radius, (wx, wy), ring)
            found[k] += got
    assert (found > 100).all() and (found < 1400).all()


def test_shapes_are_what_they_are_taken_for() -> None:
    assert truth.is_convex(SQUARE) and truth.is_convex(WEDGE[::-1])
    assert not truth.is_convex(NOTCH) and not truth.is_convex([*SQUARE[:2], (1.0, 0.5), *SQUARE[2:]])
    star = [(0.0, 3.0), (2.0, -3.0), (-3.0, 1.0), (3.0, 1.0), (-2.0, -3.0)]  # turns one way, but goes round twice
    assert not truth.is_convex(star) and not truth.is_convex([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])
    assert truth.is_simple(NOTCH) and truth.is_simple(WEDGE)
    assert not truth.is_simple(star)
    assert not truth.is_simple([(0.0, 0.0), (8.0, 0.0), (8.0, 8.0), (4.0, 0.0), (0.0, 8.0)]), "touches itself"
    assert not truth.is_simple([(0.0, 0.0), (8.0, 0.0), (4.0, 0.0), (0.0, 8.0)]), "goes back on itself"
    assert not truth.is_simple([(0.0, 0.0), (0.0, 0.0), (4.0, 0.0), (0.0, 8.0)])
    assert truth.has_area(FLAT) and not truth.has_area(((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3.0, 3.0, 3.0)))
