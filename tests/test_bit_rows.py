"""Kernels on bit rows, in numpy and compiled: each gives what sets of pixels, counted one by one, give."""

from __future__ import annotations

import importlib
import itertools
import random
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from examples import examples
from hypothesis import given, settings

from hitplanes import Disc, Scene, Sprite, fire, use_jit
from hitplanes.planes.bits import bit_rows, cells, front_to_back, visible
from hitplanes.planes.bits.bit_rows import WORD, Placed
from hitplanes.planes.bits.front_to_back import OrderedTiles, Rule
from hitplanes.planes.bits.tiles import STRIDE, TileAtlas, Tiles
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import InputError
from hitplanes.planes.grid import spans
from hitplanes.planes.grid.fixed_point import ONE
from hitplanes.planes.grid.spans import Spans
from hitplanes.weapons.kinds import weapon
from hitplanes.weapons.kinds.areas import pattern_of
from hitplanes.weapons.kinds.weapon import Pattern

Pixel = tuple[int, int]
SEEDS = st.integers(0, 2**32)


@pytest.fixture(params=["hitplanes.planes.bits.bit_rows", "hitplanes.planes.jit.bit_rows"])
def rows(request: pytest.FixtureRequest) -> Any:
    if ".jit." in request.param:
        pytest.importorskip("numba")
    return importlib.import_module(request.param)


def mask_of(rng: random.Random, width: int, height: int) -> np.ndarray:
    """Dense, sparse or a single pixel; not empty, with a pixel on each side."""
    chance = rng.choice([0.05, 0.5, 0.9, 1])
    mask = np.array([[rng.random() < chance for _ in range(width)] for _ in range(height)])
    mask[rng.randrange(height), 0] = mask[rng.randrange(height), -1] = True
    mask[0, rng.randrange(width)] = mask[-1, rng.randrange(width)] = True
    return mask


def pixels_of(mask: np.ndarray, left: int, top: int) -> set[Pixel]:
    return {(left + x, top + y) for y, x in np.argwhere(mask).tolist()}


def as_read(column: np.ndarray, rng: random.Random) -> np.ndarray:
    """The same numbers, read-only, strided or, if they are all one, broadcast."""
    if len(column) and (column == column[0]).all() and rng.random() < 0.5:
        return np.broadcast_to(column[0], column.shape)
    if rng.random() < 0.5:
        column = np.repeat(column, 3)[::3]
    column.flags.writeable = False
    return column


class Case:
    """Random tiles, patterns and placements of them, as columns and as sets of pixels."""

    def __init__(self, seed: int) -> None:
        rng = self.rng = random.Random(seed)
        sides = rng.choice([(1, 8), (1, WORD), (50, WORD)])
        heights = rng.choice([(1, 8), (1, WORD)])
        masks = [mask_of(rng, rng.randint(*sides), rng.randint(*heights)) for _ in range(rng.randint(1, 5))]
        corners = [(rng.randint(-40, 40), rng.randint(-40, 40)) for _ in masks]
        self.tiles = [pixels_of(mask, *corner) for mask, corner in zip(masks, corners, strict=True)]
        boxes = np.array(
            [(x, y, x + m.shape[1] - 1, y + m.shape[0] - 1) for m, (x, y) in zip(masks, corners, strict=True)]
        )
        height = -(-max(m.shape[0] for m in masks) // 8) * 8
        packed = np.zeros((len(masks), height), np.uint64)
        for row, mask in zip(packed, masks, strict=True):
            row[: len(mask)] = bit_rows.packed([mask])[0, : len(mask)]
        self.seen: OrderedTiles = visible._laid_out(np.arange(len(masks)), boxes, packed)
        most = rng.choice([3, 12, 40, 150])
        self.patterns = []
        for _ in range(rng.choice([1, 1, 3])):
            mask = mask_of(rng, rng.randint(1, most), rng.randint(1, rng.choice([6, most])))
            if rng.random() < 0.3:  # a long one, of which the boxes of most tiles tell less than its strip
                mask = np.eye(rng.randint(100, 300), dtype=np.bool_)[:: rng.choice([-1, 1])]
            self.patterns.append((Spans.from_mask(mask, (0, 0)), rng.randint(-20, 5), rng.randint(-20, 5), mask))
        self.weighted = rng.random() < 0.5
        self.weights = [{pixel: rng.randrange(2**16) for pixel in self.pixels(k)} for k in range(len(self.patterns))]
        prefixes = [np.array([0, *itertools.accumulate(own.values())]) for own in self.weights]
        self.windows = weapon._made(
            [
                Pattern(Spans.from_mask(mask, (left, top)), prefix if self.weighted else None)
                for (_, left, top, mask), prefix in zip(self.patterns, prefixes, strict=True)
            ]
        )
        count = rng.randint(1, 6)
        pattern = np.array([rng.randrange(len(self.patterns)) for _ in range(count)])
        x, y = np.array([[rng.randint(-60, 60) for _ in range(count)] for _ in range(2)])
        far = rng.choice([0, 9, 5000, 2**21])
        shift = np.array([[rng.randint(-far, far) for _ in range(count)] for _ in range(2)])
        self.placed = Placed(*(as_read(c, rng) for c in (pattern, x, y, x + shift[0], y + shift[1])))
        pairs = [(p, t) for p in range(count) for t in range(len(masks)) if rng.random() < 0.8]
        self.placement, self.near = (as_read(np.array(c, np.int64), rng) for c in np.array(pairs).reshape(-1, 2).T)

    def pixels(self, pattern: int) -> list[Pixel]:
        """Pixels of a pattern, row by row."""
        _, left, top, mask = self.patterns[pattern]
        return [(left + x, top + y) for y, x in np.argwhere(mask).tolist()]

    def weight(self, placement: int, pixels: set[Pixel]) -> int:
        """Sum of the weights of pixels of a placement."""
        x, y = int(self.placed.x[placement]), int(self.placed.y[placement])
        own = self.weights[int(self.placed.pattern[placement])]
        return sum(own[px - x, py - y] for px, py in pixels)

    def shared(self, placement: int, tile: int) -> set[Pixel]:
        _, left, top, mask = self.patterns[int(self.placed.pattern[placement])]
        x, y = int(self.placed.x[placement]) + left, int(self.placed.y[placement]) + top
        return pixels_of(mask, x, y) & self.tiles[tile]

    def found(self) -> list[tuple[int, ...]]:
        """What pairs share, in the order of rows."""
        told = []
        for who, at in zip(self.placement.tolist(), self.near.tolist(), strict=True):
            shared = self.shared(who, at)
            if shared:
                ox, oy = int(self.placed.origin_x[who]), int(self.placed.origin_y[who])
                best = min(((x - ox) ** 2 + (y - oy) ** 2, y - oy, x - ox) for x, y in shared)
                told.append((who, at, len(shared), best[0], ox + best[2], oy + best[1], self.weight(who, shared)))
        return sorted(told, key=lambda row: (row[0], row[3], row[5], row[4], row[1]))

    def scatter(self, count: int) -> None:
        """Place so many patterns near the tiles, and so near to each other that they often lie on the same pixels."""
        rng = self.rng
        near = rng.choice([2, 20, 60, 300])
        pattern = np.array([rng.randrange(len(self.patterns)) for _ in range(count)])
        x, y, origin_x, origin_y = np.array([[rng.randint(-near, near) for _ in range(count)] for _ in range(4)])
        self.placed = Placed(*(as_read(c, rng) for c in (pattern, x, y, origin_x, origin_y)))

    def gathered(self, pellets: range, ranks: list[int], turn: int, origin: Pixel) -> list[tuple[int, ...]]:
        """What pellets of one round share with items."""
        rows = []
        for rank in sorted(set(ranks)):
            tiles = [tile for tile, own in enumerate(ranks) if own == rank]
            hit = {(who, tile): shared for who in pellets for tile in tiles if (shared := self.shared(who, tile))}
            if hit:
                once = sum(len(set().union(*(s for (_, t), s in hit.items() if t == tile))) for tile in tiles)
                every = {(x - origin[0], y - origin[1]) for s in hit.values() for x, y in s}
                distance2, y, x = min((x * x + y * y, y, x) for x, y in every)
                samples, hitting = sum(map(len, hit.values())), len({who for who, _ in hit})
                weight = sum(self.weight(who, shared) for (who, _), shared in hit.items())
                nearest = distance2, origin[0] + x, origin[1] + y
                rows.append((turn, rank, samples, *nearest, weight, once, hitting))
        return sorted(rows, key=lambda row: (row[3], row[5], row[4], row[1]))


@examples(120, deadline=None)
@given(SEEDS, st.sampled_from([64, 200, 2**15]))
def test_what_patterns_and_tiles_share(seed: int, at_once: int) -> None:
    """Of given pairs, which may not meet."""
    case = Case(seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bit_rows, "WORDS_AT_ONCE", at_once)
        pairs = case.placement, case.near
        found = front_to_back.front_to_back(case.placed, 1, case.windows, case.seen, Rule(True), pairs)
    assert columns_of(found, case.weighted) == [row if case.weighted else row[:6] for row in case.found()]


def columns_of(found: front_to_back.RoundHits, weighted: bool) -> list[tuple[int, ...]]:
    assert (found.weight is not None) == weighted or not len(found.turn)
    return list(zip(*(column.tolist() for column in found if column is not None), strict=True))


@examples(80, deadline=None)
@given(SEEDS, st.sampled_from([1, 64]), st.sampled_from([5, 2**16]))
@pytest.mark.parametrize("name", ["hitplanes.planes.bits.front_to_back", "hitplanes.planes.jit.areas"])
def test_what_pellets_of_a_round_share_with_items(name: str, seed: int, room: int, at_once: int) -> None:
    """Items of one or two tiles that may lie on each other; every pixel counted once, and by pellet."""
    if ".jit." in name:
        pytest.importorskip("numba")
        bitrows_jit = importlib.import_module("hitplanes.planes.jit.bit_rows")
    case, kernels = Case(seed), importlib.import_module(name)
    case.scatter(12)
    each = case.rng.choice([1, 3, 4, 6])
    seen = case.seen._replace(rank=np.arange(len(case.tiles)) // case.rng.choice([1, 2]))
    box = case.windows.box_xyxy
    reach = np.concatenate([box[:, :2].min(axis=0), box[:, 2:].max(axis=0)])
    listed = cells.cells_of(seen.box_xyxy, reach, case.rng.choice([2, 5]))
    placed = case.placed._replace(origin_x=case.placed.origin_x[::each], origin_y=case.placed.origin_y[::each])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bit_rows, "WORDS_AT_ONCE", at_once)
        if ".jit." in name:
            patch.setattr(bitrows_jit, "ROOM", 0)
            patch.setattr(bitrows_jit, "ROOM_LEAST", room)
        found = kernels.front_to_back(placed, each, case.windows, seen, Rule(True), listed)
    told = []
    for turn in range(len(placed.origin_x)):
        origin = int(placed.origin_x[turn]), int(placed.origin_y[turn])
        told += case.gathered(range(turn * each, turn * each + each), seen.rank.tolist(), turn, origin)
    told = [row[:6] + row[6:7] * case.weighted + row[7:] * (each > 1) for row in told]
    assert columns_of(found, case.weighted) == told


@examples(100, deadline=None)
@given(SEEDS, st.sampled_from([64, 2**15]))
def test_what_lies_in_front_is_not_seen(seed: int, at_once: int) -> None:
    rng = random.Random(seed)
    masks = [mask_of(rng, rng.randint(1, WORD), rng.randint(1, WORD)) for _ in range(rng.randint(1, 6))]
    words = np.zeros(STRIDE * len(masks) + WORD, np.uint64)
    begin = np.arange(len(masks)) * STRIDE + WORD
    for mask, first in zip(masks, begin.tolist(), strict=True):
        words[first : first + WORD] = bit_rows.packed([mask])[0]
    pairs = sorted((rng.randrange(len(masks)), rng.randrange(len(masks))) for _ in range(rng.randint(0, 9)))
    shift = [(rng.randint(-63, 63), rng.randint(-63, 63)) for _ in pairs]
    of, other = np.array(pairs, np.int64).reshape(-1, 2).T
    right, down = np.array(shift, np.int64).reshape(-1, 2).T
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bit_rows, "WORDS_AT_ONCE", at_once)
        seen = bit_rows.rows_of(words, WORD, begin)
        bit_rows.take_away(seen, words, as_read(of.copy(), rng), begin[other] - down, right)
    for number, mask in enumerate(masks):
        left = pixels_of(mask, 0, 0)
        for (own, front), corner in zip(pairs, shift, strict=True):
            left -= pixels_of(masks[front], *corner) if own == number else set()
        told = {(x, y) for y, word in enumerate(seen[number].tolist()) for x in range(WORD) if word >> x & 1}
        assert told == left


@settings(deadline=None)
@given(SEEDS, st.sampled_from([1, 3, 2**21, 2**40, 2**60]), st.sampled_from([1, 64]))
def test_the_order_of_rows(seed: int, far: int, few: int) -> None:
    """Also where the keys together do not fit one number."""
    rng = random.Random(seed)
    count = rng.choice([0, 1, 2, 9, 60])
    keys = [sorted(rng.randint(0, 3) for _ in range(count))]
    keys += [[rng.randint(-min(far, 9), far) for _ in range(count)] for _ in range(3)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spans, "FEW_ROWS", few)
        order = spans.row_order(*(as_read(np.array(key, np.int64), rng) for key in keys))
    assert order.tolist() == sorted(range(count), key=lambda i: [key[i] for key in keys])


def boxes(rng: np.random.Generator, count: int, far: int, side: int) -> np.ndarray:
    low = rng.integers(-far, far + 1, (count, 2))
    return np.concatenate([low, low + rng.integers(0, side, (count, 2))], axis=1)


@examples(100, deadline=None)
@given(SEEDS, st.sampled_from([5, 90, 2**40]), st.integers(0, 7), st.sampled_from([1, 9, 2**20]))
def test_no_box_that_meets_is_missing_in_a_cell(seed: int, far: int, bits: int, most: int) -> None:
    rng = np.random.default_rng(seed)
    some, reach = boxes(rng, int(rng.integers(0, 9)), far, 40), boxes(rng, 1, 30, 60)[0]
    x, y = np.concatenate([rng.integers(-far - 50, far + 50, (2, 30)), some[:, :2].T, some[:, 2:].T], axis=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cells, "CELLS_MOST", most)
        made = cells.cells_of(some, reach, bits)
    place, box = cells.listed_at(made, x, y)
    told = list(zip(place.tolist(), box.tolist(), strict=True))
    assert told == sorted(set(told)) and made.wide * made.high <= most
    for i, (px, py) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        for k, (left, top, right, bottom) in enumerate(some.tolist()):
            a, b, c, d = np.add(reach, (px, py, px, py)).tolist()
            if a <= right and c >= left and b <= bottom and d >= top:
                assert (i, k) in told


@examples(100, deadline=None)
@given(
    SEEDS,
    st.sampled_from([5, 90, 2**14, 40_000, 2**30, 2**31, 2**40]),
    st.sampled_from([0, 10, 2**20]),
    st.sampled_from([0, 2**14]),
    st.sampled_from([1, 2**17]),
)
def test_boxes_that_meet(seed: int, far: int, brute: int, few: int, at_once: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = (boxes(rng, int(rng.integers(0, 12)), far, 60) for _ in range(2))
    if rng.random() < 0.2 and len(a):
        a[0, 2] = a[0, 0] - 1  # empty
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cells, "BRUTE_PAIRS", brute)
        patch.setattr(cells, "PAIRS_AT_ONCE", at_once)
        patch.setattr(cells, "FEW_PAIRS", few)
        row, box = cells.met_boxes(a, b)
    truth = [
        (i, k)
        for i, p in enumerate(a.tolist())
        for k, q in enumerate(b.tolist())
        if p[0] <= q[2] and p[2] >= q[0] and p[1] <= q[3] and p[3] >= q[1]
    ]
    assert list(zip(row.tolist(), box.tolist(), strict=True)) == truth


# Tiles, and what of them is seen


def tiled(masks: list[np.ndarray], atlas: TileAtlas, arrangement: int) -> Tiles:
    return atlas.tiles(masks.__getitem__, np.arange(len(masks)), arrangement)


def pixels_in(words: np.ndarray, begin: int, left: int, top: int, height: int) -> set[Pixel]:
    rows_ = words[begin : begin + height].tolist()
    return {(left + x, top + y) for y, word in enumerate(rows_) for x in range(WORD) if word >> x & 1}


@examples(60, deadline=None)
@given(SEEDS)
def test_masks_are_cut_into_tiles_and_seen(seed: int) -> None:
    """Of any size, some of them empty; beyond the bounds, and under what is in front, nothing is seen."""
    rng = random.Random(seed)
    masks = [mask_of(rng, rng.randint(1, 150), rng.randint(1, 150)) for _ in range(rng.randint(1, 5))]
    masks[0][: rng.choice([0, 70, 200]), : rng.choice([0, 70, 200])] = False
    atlas, corners = TileAtlas(), [(rng.randint(-60, 60), rng.randint(-60, 60)) for _ in masks]
    tiles = tiled(masks, atlas, 1)
    items = np.array([(x, y, x + m.shape[1] - 1, y + m.shape[0] - 1) for m, (x, y) in zip(masks, corners, strict=True)])
    box = tiles.boxes(items)
    each = [
        pixels_in(tiles.words, *place)
        for place in zip(tiles.begin.tolist(), *box[:, :2].T.tolist(), [64] * len(box), strict=True)
    ]
    for rank, (mask, corner) in enumerate(zip(masks, corners, strict=True)):
        own = [k for k in range(len(tiles)) if tiles.rank[k] == rank]
        assert sum(len(each[k]) for k in own) == mask.sum() and all(each[k] for k in own)
        assert set().union(*(each[k] for k in own)) == pixels_of(mask, *corner)
        place, tile = tiles.of(np.array([rank]))
        assert tile.tolist() == own and not place.any()
    blocks = np.array([rng.random() < 0.6 for _ in each], np.bool_)
    which = np.array(sorted(rng.sample(range(len(each)), rng.randint(0, len(each)))), np.int64)
    of, front = visible.in_front(box, which, blocks)
    assert sorted(zip(of.tolist(), front.tolist(), strict=True)) == [
        (i, k) for i, tile in enumerate(which.tolist()) for k in range(tile) if blocks[k]
        and (box[k, :2] <= box[tile, 2:]).all() and (box[k, 2:] >= box[tile, :2]).all()
    ]  # fmt: skip
    bounds = rng.choice([None, (-30, -20, 100, 90), (0, 0, 0, 0), (500, 500, 501, 501)])
    rows = visible._rows(tiles, box, bounds, which, of, front)
    seen = visible._laid_out(tiles.rank[which], box[which], rows)
    truth = []
    for tile in which.tolist():
        left = each[tile].difference(*(each[k] for k in range(tile) if blocks[k]))
        if bounds:
            left = {(x, y) for x, y in left if bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]}
        truth.append((int(tiles.rank[tile]), left))
    cropped = visible.cropped(seen.rank, seen.box_xyxy, rows)
    for one, kept in ((seen, truth), (cropped, [(rank, left) for rank, left in truth if left])):
        told = zip(one.rank.tolist(), one.begin.tolist(), *one.box_xyxy[:, :2].T.tolist(), strict=True)
        assert [(rank, pixels_in(one.words, b, x, y, WORD)) for rank, b, x, y in told] == kept
        assert not one.words[:WORD].any() and not one.words[-WORD:].any()
    for own, (_, left) in zip(cropped.box_xyxy.tolist(), [t for t in truth if t[1]], strict=True):
        xs, ys = zip(*left, strict=True)
        assert own == [min(xs), min(ys), max(xs), max(ys)]


@given(st.integers(0, 2**32))
@examples(30, deadline=None)
def test_rows_are_cropped_to_their_pixels(seed: int) -> None:
    """Few pixels, many or none, also in the first and last row and column."""
    rng = random.Random(seed)
    height = 8 * rng.randint(1, 8)
    spots = [
        (rng.choice([0, 63, rng.randrange(64)]), rng.choice([0, height - 1, rng.randrange(height)])) for _ in "abc"
    ]
    tiles = [set(rng.sample(spots, rng.randint(0, 3))) for _ in range(rng.randint(0, 9))]
    tiles.append({(x, y) for x in range(64) for y in range(height)})
    rows = np.zeros((len(tiles), height), np.uint64)
    for tile, pixels in enumerate(tiles):
        for x, y in pixels:
            rows[tile, y] |= np.uint64(1 << x)
    before, sides = rows.copy(), visible.sides_of(rows)
    for pixels, side in zip(tiles, sides.tolist(), strict=True):
        xs, ys = zip(*pixels, strict=True) if pixels else ((), ())
        assert side == ([min(xs), min(ys), max(xs), max(ys)] if pixels else [0, 0, -1, -1])
    corners = np.array([[rng.randint(-99, 99), rng.randint(-99, 99)] * 2 for _ in tiles])
    seen = visible.cropped(np.arange(len(tiles)), corners, rows)
    assert seen.rank.tolist() == [tile for tile, pixels in enumerate(tiles) if pixels]
    for tile, begin, box in zip(seen.rank.tolist(), seen.begin.tolist(), seen.box_xyxy.tolist(), strict=True):
        assert box == (sides[tile] + corners[tile]).tolist()
        left, top, _, low = sides[tile].tolist()
        for row in range(-WORD, low - top + 1 + WORD):  # what is read before and after it is empty
            told = pixels_in(seen.words, begin + row, left, top + row, 1)
            assert told == {(x, y) for x, y in tiles[tile] if y == top + row}
    assert np.array_equal(rows, before)


def test_an_atlas_grows_and_drops_masks(monkeypatch: pytest.MonkeyPatch) -> None:
    """All, some or none of the masks are new ones, in any order; tiles that were handed out stay; memory follows."""
    monkeypatch.setattr("hitplanes.planes.bits.tiles.ATLAS_SLACK", 4)
    monkeypatch.setattr("hitplanes.planes.bits.tiles.PACKED_AT_ONCE", 3)
    rng, atlas, made, number = random.Random(1), TileAtlas(), [], [0, 0, 0]
    old, kept = atlas.tiles([].__getitem__, np.zeros(0, np.int64), -1), atlas.words
    for arrangement in range(120):
        made += [mask_of(rng, rng.randint(1, 140), rng.randint(1, 70)) for _ in "abc"]
        fresh = range(len(made) - 3, len(made))
        number = [rng.choice(fresh) if rng.random() < 0.4 else one for one in number]
        if arrangement in (10, 20, 30):
            number = rng.choices(fresh, k=rng.randint(0, 4))
        rng.shuffle(number)
        tiles = atlas.tiles([made[one] for one in number].__getitem__, np.array(number, np.int64), arrangement)
        words = tiles.words.copy()
        assert atlas.tiles([].__getitem__, np.array(number), arrangement) is tiles
        for rank, one in enumerate(number):
            own = [k for k in range(len(tiles)) if tiles.rank[k] == rank]
            inside = [tiles.inside_xyxy[k].tolist() for k in own]
            told = [pixels_in(words, tiles.begin.item(k), x, y, 64) for k, (x, y, *_) in zip(own, inside, strict=True)]
            assert set().union(*told) == pixels_of(made[one], 0, 0)
            high, wide = made[one].shape
            assert [box[2:] for box in inside] == [
                [min(x + 64, wide) - 1, min(y + 64, high) - 1] for x, y, *_ in inside
            ]
        assert tiles.whole == (tiles.rank.tolist() == list(range(len(number))) and not tiles.inside_xyxy[:, :2].any())
        assert all(np.array_equal(old.words[b : b + 64], kept[b : b + 64]) for b in old.begin.tolist())
        assert len(atlas.words) <= 128 * STRIDE and len(atlas._columns) * STRIDE == len(atlas.words)
        old, kept = tiles, words


def test_bit_rows_of_patterns_are_kept() -> None:
    """Of one pattern, of several together; and what is too large for them is known before they are made."""
    mask = np.ones((5, 9), np.bool_)
    pattern, other = (Pattern(Spans.from_mask(mask, (x, 0)), None) for x in (0, 3))
    assert weapon.pattern_bits_of([pattern]) is weapon.pattern_bits_of([pattern])
    assert weapon.pattern_bits_of([pattern, other]) is not weapon.pattern_bits_of([other, pattern])
    assert weapon.fits([pattern, other]) and weapon.fits([])
    for reach in (3, 70, 300):
        for weighted in (False, True):
            disc = pattern_of(Disc(reach, falloff="linear" if weighted else None), ONE, 0)
            made = weapon.pattern_bits_of([disc])
            assert disc.window_bytes == made.words.nbytes + made.sums.nbytes
            assert disc.window_bytes <= weapon._window_bytes(2 * reach + 3, 2 * reach + 3, weighted)
    assert weapon.fits_at_reach(2048, False) and not weapon.fits_at_reach(2**14, False)
    assert weapon.fits_at_reach(1300, True) and not weapon.fits_at_reach(2048, True)


@settings(deadline=None)
@given(SEEDS)
def test_words_of_a_pattern_hold_its_pixels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random(rng.integers(0, [20, 150])) < rng.choice([0, 0.02, 0.5, 1])
    spans = Spans.from_mask(mask, tuple(rng.integers(-200, 200, 2).tolist()))
    words, (left, top, *_) = weapon.columns_of(spans), spans.box_xyxy or (0, 0)
    told = {
        (left - WORD + 1 + WORD * column + bit, top + row)
        for column, row in zip(*(each.tolist() for each in words.nonzero()), strict=True)
        for bit in range(WORD)
        if int(words[column, row]) >> bit & 1
    }
    assert told == {(x, y) for x, y in spans.pixels().tolist()}


@examples(100, deadline=None)
@given(SEEDS, st.sampled_from([0, 2**40]))
def test_pixels_of_patterns_within_bounds(seed: int, far: int) -> None:
    rng = np.random.default_rng(seed)
    masks = [rng.random(rng.integers(0, [20, 150])) < rng.choice([0, 0.5, 1]) for _ in range(rng.integers(1, 4))]
    spans = [Spans.from_mask(mask, tuple(rng.integers(-99, 99, 2).tolist())) for mask in masks]
    bits = weapon.pattern_bits_of([Pattern(own, None) for own in spans])
    count = bit_rows.pixels_of_patterns(bits)
    assert count.tolist() == [own.count for own in spans]
    which, place = rng.integers(0, len(spans), 30), rng.integers(-250, 250, (2, 30)) + far
    low, size = rng.integers(-99, 99, 2) + far, rng.integers(1, 150, 2)
    bounds = *low.tolist(), *(low + size - 1).tolist()
    inside = bit_rows.pixels_within(Placed(which, *place, *place), bits, count, bounds)
    for kind, *xy, found in np.stack([which, *place, inside], axis=1).tolist():
        pixels = spans[kind].pixels() + xy
        assert found == ((pixels >= low) & (pixels < low + size)).all(axis=1).sum()


# Which kernels


def test_kernels_are_chosen() -> None:
    pytest.importorskip("numba")
    twin = importlib.import_module("hitplanes.planes.jit.bit_rows")
    assert kernels_of(bit_rows) is bit_rows
    try:
        for on, expected in ((True, twin), (False, bit_rows), (True, twin), (None, bit_rows)):
            use_jit(on)
            assert kernels_of(bit_rows) is expected
    finally:
        use_jit(None)


def test_no_batch_changes_the_kernels() -> None:
    """Nor one of a billion pairs of shots and items."""
    scene, sprite = Scene(), Sprite.box(1, 1)
    for x in range(2000):
        scene.add(sprite, (9 * x, 0))
    assert kernels_of(bit_rows) is bit_rows
    assert len(fire(scene, Disc(1), np.full((500_000, 2), 1e6))) == 0
    assert kernels_of(bit_rows) is bit_rows


def test_without_numba_there_is_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.common.backend.find_spec", lambda name: None)
    try:
        with pytest.raises(InputError, match=r"^jit: expected numba, .* got no such module"):
            use_jit(True)
        assert kernels_of(bit_rows) is bit_rows
    finally:
        use_jit(None)


@pytest.mark.parametrize("apart", [2**15, 2**16, 2**31, 2**32, 2**40])
def test_boxes_far_apart_do_not_meet(apart: int) -> None:
    row, box = cells.met_boxes(
        np.array([[0, 0, 9, 9], [apart, 0, apart + 9, 9]]), np.array([[5, 5, 6, 6], [5, apart, 6, apart]])
    )
    assert (row.tolist(), box.tolist()) == ([0], [0])
