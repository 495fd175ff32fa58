"""Strips of patterns: each pixel lies in its own, boxes that share one meet it, and boxes beyond it are left out."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hitplanes import Beam, Box, Disc
from hitplanes.planes.grid.fixed_point import unit
from hitplanes.planes.grid.spans import NO_STRIPS, Spans, meets_strip, strip_of, strips_of
from hitplanes.weapons.kinds.areas import AreaWeapon, pattern_of
from hitplanes.weapons.kinds.weapon import Pattern

SEEDS = st.integers(0, 2**32)


def along(weapon: AreaWeapon, aim: float) -> Pattern:
    c, s = unit(np.array(aim))
    return pattern_of(weapon, int(c), int(s))


def some_pattern(rng: np.random.Generator) -> Spans:
    """Pixels strewn along a line, far or near."""
    count, far = int(rng.integers(0, 12)), int(rng.choice([3, 60, 2000]))
    angle, part = rng.uniform(0, math.tau), rng.uniform(-1, 1, count)
    off = rng.integers(-2, 3, (2, count))
    x, y = (np.rint(far * part * side).astype(np.int64) for side in (math.cos(angle), math.sin(angle)))
    return Spans.from_runs(y + off[0] + 7, x + off[1] - 9, x + off[1] - 9 + rng.integers(0, 3, count))


@settings(deadline=None)
@given(SEEDS)
def test_boxes_that_share_a_pixel_meet_the_strip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    patterns = [some_pattern(rng) for _ in range(3)]
    strips = np.array([strip_of(spans) for spans in patterns])
    which, (wide, high) = rng.integers(0, 3, 30), (int(side) for side in rng.integers(1, 50, 2))
    near = [patterns[k].pixels() for k in which]
    left, top = (
        np.array([int(rng.choice(p[:, axis]) if len(p) else 0) - int(rng.integers(-1, side + 1)) for p in near])
        for axis, side in ((0, wide), (1, high))
    )
    kept = set(meets_strip(strips, which, left, top, wide, high).tolist())
    for i, (x, y) in enumerate(zip(left.tolist(), top.tolist(), strict=True)):
        pixels = near[i].tolist()
        if any(x <= px < x + wide and y <= py < y + high for px, py in pixels):
            assert i in kept
        a, b, low, high_ = strips[which[i]].tolist()
        assert all(low <= a * px + b * py <= high_ for px, py in pixels)
        corners = [a * cx + b * cy for cx in (x, x + wide - 1) for cy in (y, y + high - 1)]
        assert (i in kept) == (max(corners) >= low and min(corners) <= high_)


@pytest.mark.parametrize("aim", range(0, 180, 15))
def test_the_strip_of_a_beam_is_as_wide_as_the_beam(aim: int) -> None:
    a, b, low, high = strip_of(along(Beam(300, 6), aim).spans)
    assert abs(math.degrees(math.atan2(-a, b)) - aim) % 180 in (pytest.approx(0, abs=1), pytest.approx(180, abs=1))
    assert (high - low) / math.hypot(a, b) < 9


def test_strips_are_there_where_they_tell_more_than_boxes() -> None:
    def made(weapon: AreaWeapon, aims: list[float]) -> int:
        patterns = [along(weapon, aim) for aim in aims]
        boxes = np.array([pattern.spans.box_xyxy for pattern in patterns])
        return len(strips_of([pattern.strip for pattern in patterns], boxes))

    assert made(Beam(300, 6), [45]) == 1 and made(Beam(300, 6), [0, 30, 60]) == 3
    assert made(Beam(300, 6), [0]) == made(Beam(20, 6), [45]) == made(Disc(40), [0]) == made(Box(200, 200), [45]) == 0
    assert NO_STRIPS.shape == (0, 4) and strip_of(Spans.empty()) == (0, 0, 0, 0)
