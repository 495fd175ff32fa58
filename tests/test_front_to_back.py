"""What patterns hit of tiles front to back, in numpy and compiled: what sets of pixels, walked one by one, give."""

from __future__ import annotations

import random
from importlib.util import find_spec

import hypothesis.strategies as st
import numpy as np
import pytest
from examples import examples
from hypothesis import given

from hitplanes.planes.bits import bit_rows, front_to_back
from hitplanes.planes.bits.bit_rows import Placed
from hitplanes.planes.bits.front_to_back import OrderedTiles, Rule
from hitplanes.planes.bits.tiles import TileAtlas
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.grid.spans import Spans
from hitplanes.weapons.kinds import weapon
from hitplanes.weapons.kinds.weapon import Pattern

Pixel = tuple[int, int]


def mask_of(rng: random.Random, most: int) -> np.ndarray:
    """Dense, sparse, with an empty stripe, or without any pixel; cropped."""
    width, height = rng.randint(1, most), rng.randint(1, rng.choice([5, most]))
    chance = rng.choice([0.02, 0.3, 0.6, 0.9, 1, 1, 1])
    mask = np.array([[rng.random() < chance for _ in range(width)] for _ in range(height)])
    mask[rng.randrange(height)] &= rng.random() < 0.5
    mask[rng.randrange(height), rng.randrange(width)] = rng.random() < 0.9
    rows, columns = mask.any(axis=1).nonzero()[0], mask.any(axis=0).nonzero()[0]
    return mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] if len(rows) else mask


def pixels_of(mask: np.ndarray, left: int, top: int) -> list[Pixel]:
    return [(left + x, top + y) for y, x in np.argwhere(mask).tolist()]


class Case:
    """A random pile of items of one or more tiles, and placed patterns with filters."""

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)
        far = rng.choice([0, 0, 2**15, 2**33, -(2**40)])
        spread, most = rng.choice([(3, 3), (8, 20), (20, 60), (50, 150)])
        masks = [mask_of(rng, most) for _ in range(rng.choice([0, 1, 4, 9, 14, 14]))]
        if masks and rng.random() < 0.3:  # all alike, so that what is said of the largest tile holds of each
            masks = [np.ones_like(masks[0])] * len(masks)
        corners = [(far + rng.randint(-spread, spread), rng.randint(-spread, spread)) for _ in masks]
        tiles = TileAtlas().tiles(masks.__getitem__, np.arange(len(masks)), 1)
        boxes = np.array(
            [(x, y, x + m.shape[1] - 1, y + m.shape[0] - 1) for m, (x, y) in zip(masks, corners, strict=True)], np.int64
        )
        share = rng.choice([0, 0.3])
        self.occluder = [rng.random() < share for _ in masks]
        self.categories = [rng.choice([1, 1, 1, 2, 6, 0]) for _ in masks]
        self.owner = [rng.randint(0, 3) for _ in masks]
        told = (
            np.array(self.occluder * any(self.occluder), np.bool_),
            np.array(self.categories, np.int64),
            np.array(self.owner, np.int64),
        )
        self.ordered = OrderedTiles(
            tiles.rank, tiles.boxes(boxes.reshape(-1, 4)), tiles.begin, tiles.words,
            *(column[tiles.rank] if len(column) else column for column in told),
        )  # fmt: skip
        self.items = [pixels_of(mask, *corner) for mask, corner in zip(masks, corners, strict=True)]
        self._place(rng, far, spread, most)

    def _place(self, rng: random.Random, far: int, spread: int, size: int) -> None:
        most = rng.choice([3, size, size, 150])
        self.patterns = [
            (mask_of(rng, most), -rng.randint(0, most // 2), -rng.randint(0, most // 2))
            for _ in range(rng.randint(1, 3))
        ]
        if rng.random() < 0.2:  # a long one, of which the boxes of most tiles tell less than its strip
            line = np.eye(rng.randint(100, 200), dtype=np.bool_)[:: rng.choice([-1, 1])]
            self.patterns = [(line, -rng.randint(0, 100), -rng.randint(0, 100))]
        spans = [Pattern(Spans.from_mask(mask, (left, top)), None) for mask, left, top in self.patterns]
        self.windows = weapon._made(spans)
        count = 0 if rng.random() < 0.05 else rng.choice([1, 2, 5])
        pattern = np.array([rng.randrange(len(spans)) for _ in range(count)], np.int64)
        x, y = np.array([[rng.randint(-spread, spread) for _ in range(count)] for _ in range(2)], np.int64)
        apart = rng.choice([0, 0, 9, 5000, 2**21])
        off = np.array([[rng.randint(-apart, apart) for _ in range(count)] for _ in range(2)], np.int64)
        x += far
        self.placed = Placed(pattern, x, y, x + off[0], y + off[1])
        self.accept: np.ndarray | int | None = rng.choice([None, None, 2**32 - 1, 1, 3])
        if rng.random() < 0.3:
            self.accept = np.array([rng.choice([1, 2, 4, 7]) for _ in range(count)], np.int64)
        owners = np.array([[rng.randint(-1, 3) for _ in range(2)] for _ in range(max(count, 1))], np.int64)
        self.exclude = rng.choice([None, owners[:1, : rng.randint(0, 2)], owners[:count, : rng.randint(0, 2)]])
        self.pierce = rng.random() < 0.3
        low, high = [-rng.randint(0, 40) for _ in range(2)], [rng.randint(0, 90) for _ in range(2)]
        tight = (far + low[0], low[1], far + high[0], high[1])
        self.bounds = rng.choice([None, tight, tight, (5 * 10**12,) * 4 if rng.random() < 0.1 else None])

    def refuses(self, who: int, item: int) -> bool:
        if self.accept is None:
            return False
        bits = self.accept if isinstance(self.accept, int) else int(self.accept[who])
        owners = [] if self.exclude is None else self.exclude[who if len(self.exclude) > 1 else 0].tolist()
        return not self.categories[item] & bits or self.owner[item] in owners

    def inside(self, x: int, y: int) -> bool:
        return self.bounds is None or (self.bounds[0] <= x <= self.bounds[2] and self.bounds[1] <= y <= self.bounds[3])

    def hits(self, who: int) -> list[tuple[int, list[Pixel]]]:
        """Items that a placement hits, and where: each of its pixels walks the stack."""
        mask, left, top = self.patterns[int(self.placed.pattern[who])]
        x, y = int(self.placed.x[who]) + left, int(self.placed.y[who]) + top
        live = {p for p in pixels_of(mask, x, y) if self.inside(*p)}
        met = []
        for item, pixels in enumerate(self.items):
            if self.refuses(who, item):
                continue
            here = [p for p in pixels if p in live]
            if here and not self.occluder[item]:
                met.append((item, here))
            if self.occluder[item] or not self.pierce:
                live -= set(here)
        return met

    def found(self) -> list[tuple[int, ...]]:
        rows = []
        for who in range(len(self.placed.x)):
            ox, oy = int(self.placed.origin_x[who]), int(self.placed.origin_y[who])
            for item, pixels in self.hits(who):
                nearest = min(((x - ox) ** 2 + (y - oy) ** 2, y, x) for x, y in pixels)
                rows.append((who, *nearest, item, len(pixels)))
        return [(who, item, count, d2, x, y) for who, d2, y, x, item, count in sorted(rows)]


@examples(80, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([64, 2**15]), st.sampled_from([0, 2**14]))
def judged(seed: int, at_once: int, crowd: int) -> None:
    case = Case(seed)
    kernels = kernels_of(front_to_back)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bit_rows, "WORDS_AT_ONCE", at_once)
        patch.setattr(front_to_back, "FRONTS_AT_ONCE", crowd)
        rule = Rule(case.pierce, case.bounds, case.accept, case.exclude)
        found = kernels.front_to_back(case.placed, 1, case.windows, case.ordered, rule)[:6]
    assert all(column.dtype == np.int64 for column in found)
    assert list(zip(*(column.tolist() for column in found), strict=True)) == case.found()


def test_each_pixel_ends_at_the_first_item_that_the_shot_accepts(jit: bool) -> None:
    if jit and find_spec("hitplanes.planes.jit.areas") is None:
        pytest.skip("no compiled twin")
    judged()


def test_tiles_reach_into_the_cells_beside_and_below(jit: bool) -> None:
    """A tile of 64 x 64 px is hit at its corners wherever it lies among the cells, which begin with another tile."""
    tiles = TileAtlas().tiles(([np.ones((64, 64), np.bool_)] * 2).__getitem__, np.arange(2), 1)
    every, none = np.full(2, 1), np.zeros(0, np.bool_)
    dot = weapon._made([Pattern(Spans.from_mask(np.ones((1, 1), np.bool_), (0, 0)), None)])
    for offset in range(64):
        corner = np.array([(-64, -128), (offset, offset)])
        boxes = np.concatenate([corner, corner + 63], axis=1)
        ordered = OrderedTiles(tiles.rank, boxes, tiles.begin, tiles.words, none, every, every)
        x, y = offset + np.array([(0, 0, 63, 63, 64, -1), (0, 63, 0, 63, 0, 0)])
        found = kernels_of(front_to_back).front_to_back(Placed(0 * x, x, y, x, y), 1, dot, ordered, Rule(False))
        assert found.turn.tolist() == [0, 1, 2, 3] and found.rank.tolist() == [1] * 4


def test_pixels_as_near_come_row_by_row_and_none_from_beyond_the_bounds(jit: bool) -> None:
    """Twelve items of a pixel on one circle, in any order of the stack, and the last rows of a tall one cut off."""
    around = [(x, y) for x in range(-5, 6) for y in range(-5, 6) if x * x + y * y == 25]
    tall, none = np.ones((20, 1), np.bool_), np.zeros(0, np.int64)
    spans = Spans.from_mask(np.ones((41, 41), np.bool_), (-20, -20))
    zero = np.zeros(1, np.int64)
    for seed in range(9):
        corners = random.Random(seed).sample(around, len(around))
        masks = [tall, *[np.ones((1, 1), np.bool_)] * len(corners)]
        tiles = TileAtlas().tiles(masks.__getitem__, np.arange(len(masks)), 1)
        boxes = np.array([(9, 0, 9, 19), *[(x, y, x, y) for x, y in corners]])
        ordered = OrderedTiles(tiles.rank, boxes, tiles.begin, tiles.words, np.zeros(0, np.bool_), none, none)
        found = kernels_of(front_to_back).front_to_back(
            Placed(zero, zero, zero, zero, zero),
            1,
            weapon._made([Pattern(spans, None)]),
            ordered,
            Rule(False, (-20, -20, 20, 10)),
        )
        rows = list(zip(found.y.tolist(), found.x.tolist(), found.samples.tolist(), strict=True))
        assert rows == [*((y, x, 1) for y, x in sorted((y, x) for x, y in around)), (0, 9, 11)]
