"""Placed patterns against tiles of bit rows: against ordered tiles, front to back, or against visible tiles, by cells.

Ordered tiles need no preparation: they serve scenes in which everything moves, few shots, and shots that accept
different items. All functions map arrays to arrays; `jit.areas` has the compiled kernels.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import isqrt
from types import ModuleType
from typing import NamedTuple

import numpy as np

from ..common.backend import kernels_of
from ..common.checks import Bools, Ints
from ..grid.spans import Box, begins, ragged
from . import bit_rows
from .bit_rows import (
    WORD,
    Beside,
    PatternBits,
    Placed,
    TileHits,
    VisibleTiles,
    Words,
    found,
    nearest,
    placed_boxes,
    rows_of,
)
from .cells import Cells, listed_at, met_boxes

NOT_BESIDE: Beside = np.zeros((0, WORD, 0), np.uint8)
"""No distances along rows: the nearest pixel is searched among the pixels that are hit."""

PAIRS_AT_ONCE = 2**16
"""Approximate number of pairs of placements and tiles counted at a time: 512 KB for each of their columns."""

PAIRED = 8
"""Most pellets on one tile whose boxes are compared pair by pair."""


class RoundHits(NamedTuple):
    """Pixels shared by rounds and items, as columns (n,), sorted by (turn, distance2, y, x, rank).

    Parameters
    ----------
    turn : number of the round among those of all shots
    rank : place of the item in the stack
    samples, pixels, pellets : pixels of all pellets; distinct pixels; pellets that hit
    distance2, x, y : the hit pixel that is nearest to the round's own
    """

    turn: Ints
    rank: Ints
    samples: Ints
    pixels: Ints
    pellets: Ints
    distance2: Ints
    x: Ints
    y: Ints


def gathered(
    placed: Placed, windows: PatternBits, seen: VisibleTiles, placement: Ints, near: Ints, each: int
) -> RoundHits:
    """Count the pixels that rounds of `each` pellets share with items, as many pairs at a time as fit the cache.

    Parameters
    ----------
    placed : pellets, sorted by round; the origins are those of the rounds (T,)
    placement, near : (n,) sorted pairs of a pellet and a visible tile that may meet
    """
    origin = placed.origin_x, placed.origin_y
    if each > 1:
        placed = Placed(*placed[:3], *(column.repeat(each) for column in origin))
    edges = [0, len(placement)]
    if len(placement) > PAIRS_AT_ONCE:
        turn = placement // each
        wanted = turn[PAIRS_AT_ONCE::PAIRS_AT_ONCE]
        edges = [0, *np.unique(np.searchsorted(turn, wanted)).tolist(), len(placement)]
    kernels = kernels_of(bit_rows)
    parts = [
        _counted_by_round(placed, windows, seen, placement[a:b], near[a:b], each, kernels) for a, b in pairwise(edges)
    ]
    return parts[0] if len(parts) == 1 else RoundHits(*map(np.concatenate, zip(*parts, strict=True)))


def _counted_by_round(
    placed: Placed,
    windows: PatternBits,
    seen: VisibleTiles,
    placement: Ints,
    near: Ints,
    each: int,
    kernels: ModuleType,
) -> RoundHits:
    """Like `gathered`, for one part of the pairs; those of a round are in one part."""
    found: TileHits = kernels.found(placed, windows, seen, placement, near, NOT_BESIDE)
    rank, samples = seen.rank[found.seen], found.samples
    turn = found.placement // each
    pixels, pellets = samples, np.ones_like(samples)
    if each > 1 or (seen.rank[1:] == seen.rank[:-1]).any():
        order = kernels.row_order(turn, rank, found.seen, found.placement)
        found, rank, turn = TileHits(*(column[order] for column in found)), rank[order], turn[order]
        first = np.flatnonzero(begins(turn) | begins(rank))
        samples = pixels = _sums(found.samples, first)
        if each > 1:
            pellets, pixels = _distinct(placed, windows, seen, found, first, kernels)
        best = _nearest(found, first, kernels)
        found, rank, turn = TileHits(*(column[best] for column in found)), rank[best], turn[best]
    order = kernels.row_order(turn, found.distance2, found.y, found.x)
    columns = turn, rank, samples, pixels, pellets[: len(turn)], found.distance2, found.x, found.y
    return RoundHits(*(column[order] for column in columns))


def _sums(values: Ints, first: Ints) -> Ints:
    """Sums of groups that begin at `first`."""
    return np.add.reduceat(values, first) if len(first) else np.zeros(0, np.int64)


def _nearest(found: TileHits, first: Ints, kernels: ModuleType) -> Ints:
    """The pair of each group whose pixel is nearest to the origin."""
    new = np.zeros(len(found.seen), np.int64)
    new[first] = 1
    group = np.cumsum(new)
    return np.asarray(kernels.row_order(group, found.distance2, found.y, found.x)[first])


def _distinct(
    placed: Placed, windows: PatternBits, seen: VisibleTiles, found: TileHits, first: Ints, kernels: ModuleType
) -> tuple[Ints, Ints]:
    """Pellets that hit, and distinct pixels, of each group; its pairs are sorted by (tile, placement)."""
    new = begins(found.seen)
    new[first] = True
    tile = np.flatnonzero(new)
    together, length = _sums(found.samples, tile), np.diff(tile, append=len(new))
    several = np.flatnonzero(length > 1)
    several = several[_may_overlap(placed, windows, found.placement, tile[several], length[several])]
    if len(several):
        length = length[several]
        group, place = ragged(length)
        pair = tile[several][group] + place
        first_of = np.cumsum(length) - length
        together[several] = kernels.union(placed, windows, seen, found.placement[pair], found.seen[pair], first_of)
    group = np.searchsorted(first, np.arange(len(new)), side="right") - 1
    order = kernels.row_order(group, found.placement, group, group)
    new = begins(found.placement[order])
    new[first] = True
    return _sums(new.astype(np.int64), first), _sums(together, np.searchsorted(tile, first))


def _may_overlap(placed: Placed, windows: PatternBits, placement: Ints, begin: Ints, length: Ints) -> Bools:
    """Whether boxes of pellets overlap in each group (n,), of `length` placements from `begin` on.

    The answer is True for groups of more than PAIRED pellets.
    """
    few = np.flatnonzero(length <= PAIRED)
    group, place = ragged(length[few])
    pair, step = ragged(length[few][group] - 1 - place)
    group, place = few[group[pair]], place[pair]
    pellets = placed._replace(pattern=placed.pattern[placement], x=placed.x[placement], y=placed.y[placement])
    left, top, right, low = placed_boxes(pellets, windows)
    a = begin[group] + place
    b = a + 1 + step
    met = (left[a] <= right[b]) & (left[b] <= right[a])
    met &= (top[a] <= low[b]) & (top[b] <= low[a])
    overlap = length > PAIRED
    overlap[group[met]] = True
    return overlap


def item_rows(found: TileHits, placed: Placed, rank: Ints) -> TileHits:
    """Hits of items from hits of tiles: those of one placement and item are added up.

    Parameters
    ----------
    found : sorted by (placement, tile)
    rank : (T,) place in the stack of the item of each tile, rising

    Returns
    -------
    for each item the first of its tiles that is hit, the samples of all of them, and the nearest pixel; sorted by
    (placement, distance2, y, x, tile)
    """
    order = _row_order(found, placed)
    item, who = rank[found.seen], found.placement
    same = (item[1:] == item[:-1]) & (who[1:] == who[:-1])
    if not np.logical_or.reduce(same):
        return TileHits(who, *[column[order] for column in found[1:]])
    first = np.concatenate(([True], ~same)).nonzero()[0]
    turn = np.empty_like(order)
    turn[order] = np.arange(len(order))
    soonest = np.minimum.reduceat(turn, first)
    by_turn = soonest.argsort()
    nearest = order[soonest[by_turn]]
    samples = np.add.reduceat(found.samples, first)[by_turn]
    return TileHits(who[nearest], found.seen[first[by_turn]], samples, *[column[nearest] for column in found[3:]])


# house: row order
def _row_order(found: TileHits, placed: Placed) -> Ints:
    """Order of pairs (n,) by (placement, distance2, y, x, place); they are sorted by placement already."""
    who = found.placement
    most = int(np.maximum.reduce(found.distance2, initial=0))
    high = isqrt(most) + 1  # no pixel lies so far above or below its origin
    if len(who) and (int(who[-1]) + 1) * (most + 1) * (2 * high) * 2 >= 2**63:
        return np.lexsort((found.x, found.y, found.distance2, who))
    key = who * (most + 1)
    key += found.distance2
    key *= 2 * high
    key += found.y - placed.origin_y[who]
    key += key
    key += found.x > placed.origin_x[who]  # at most one pixel of a row lies at this distance on each side
    return key.argsort(kind="stable")


WORDS_AT_ONCE = 2**16
"""Words of pairs worked on at a time: 512 KB; with fewer, the calls of numpy take longer."""

FRONTS_AT_ONCE = 2**14
"""Most pairs of tiles near the same placement that are all listed; of more, only those that meet are listed."""


class OrderedTiles(NamedTuple):
    """The tiles of a stack at their places in the world, front to back, as columns.

    Parameters
    ----------
    rank : (T,) place in the stack of each tile's item, rising
    box_xyxy : (T, 4) inclusive, px
    begin : (T,) first row in `words`
    words : flat rows, with WORD empty ones before and after each tile
    occluder : (T,) whether the item is an occluder, which no shot hits; (0,) if there are none
    categories, owner : (T,) category bits and owner of the item
    """

    rank: Ints
    box_xyxy: Ints
    begin: Ints
    words: Words
    occluder: Bools
    categories: Ints
    owner: Ints


class Near(NamedTuple):
    """Sorted pairs (n,) of a placement and a tile near it.

    Parameters
    ----------
    placement, tile : (n,) the pairs
    left, top : (n,) corner of the compared rows, px: the tile's; if patterns are low, `top` is the pattern's
    """

    placement: Ints
    tile: Ints
    left: Ints
    top: Ints

    def at(self, rows: Ints | slice) -> Near:
        """Some of the pairs."""
        return Near(*[column[rows] for column in self])


def front_to_back(
    placed: Placed,
    windows: PatternBits,
    ordered: OrderedTiles,
    accept: Ints | int | None,
    exclude: Ints | None,
    pierce: bool,
    bounds: Box | None,
) -> TileHits:
    """Hits of placed patterns: each pixel of a pattern ends at the first accepted item that covers it, front to back.

    Parameters
    ----------
    accept : category bits of all placements, or (P,) of each; None refuses nothing
    exclude : owners whose items are skipped, (1, K) for all placements or (P, K), -1 for none; or None
    pierce : whether pixels go on through objects; they end at occluders
    bounds : box beyond which nothing is hit

    Returns
    -------
    pairs of a placement and an item: `seen` is the item's first tile that is hit, `samples` those of all its tiles,
    and the pixel the nearest to the origin; sorted by (placement, distance2, y, x, rank)
    """
    near, height = _near(placed, windows, ordered, accept, exclude)
    parts = []
    for part in _parts(near, max(WORDS_AT_ONCE // height, 1)):
        pairs, rows = _shared(placed, windows, ordered, part, height)
        if len(rows):
            _hide(rows, ordered, pairs, pierce)
            if bounds is not None:
                bit_rows.cut_off(rows, pairs.left, pairs.top, bounds)
            parts.append(_counted(placed, ordered, pairs, rows))
    if not parts:
        return TileHits(*[np.zeros(0, np.int64)] * 6)
    found = parts[0] if len(parts) == 1 else TileHits(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return item_rows(found, placed, ordered.rank)


def _near(
    placed: Placed, windows: PatternBits, ordered: OrderedTiles, accept: Ints | int | None, exclude: Ints | None
) -> tuple[Near, int]:
    """Pairs of a placement and an accepted tile whose box and strip meet; and the number of rows to compare."""
    asked = bit_rows.placed_boxes(placed, windows)
    placement, tile = met_boxes(asked.T, ordered.box_xyxy)
    placement, tile = bit_rows.crossing(placed, windows, ordered.box_xyxy.T, placement, tile)
    left, top = ordered.box_xyxy[:, 0], ordered.box_xyxy[:, 1]
    high = int(np.maximum.reduce(ordered.box_xyxy[:, 3] - top, initial=0)) + 1
    low = int(np.maximum.reduce(asked[3] - asked[1], initial=0)) + 1
    near = Near(placement, tile, left[tile], top[tile] if low >= high else asked[1][placement])
    if accept is None:
        return near, min(high, low)
    return near.at(_accepted(ordered, accept, exclude, placement, tile).nonzero()[0]), min(high, low)


def _accepted(ordered: OrderedTiles, accept: Ints | int, exclude: Ints | None, placement: Ints, tile: Ints) -> Bools:
    """Which tiles of pairs (n,) their placements accept."""
    bits = accept if isinstance(accept, int) else accept[placement]
    accepted = (ordered.categories[tile] & bits) != 0
    if exclude is not None:
        owners = exclude[placement] if len(exclude) > 1 else exclude
        accepted &= (ordered.owner[tile][:, None] != owners).all(axis=1)
    return np.asarray(accepted)


def _parts(near: Near, most: int) -> Iterator[Near]:
    """Parts of about `most` pairs; those of a placement stay together."""
    count, begin = len(near.tile), 0
    while begin == 0 or begin < count:
        end = min(begin + most, count)
        if end < count:
            end = int(near.placement.searchsorted(near.placement[end], side="right"))
        yield near if end - begin == count else near.at(slice(begin, end))
        begin = max(end, 1)


def _shared(placed: Placed, windows: PatternBits, ordered: OrderedTiles, near: Near, height: int) -> tuple[Near, Words]:
    """Pairs that share pixels, and those pixels (n, height)."""
    rows = rows_of(ordered.words, height, _first(ordered, near.tile, near.top))
    who = near.placement
    pattern = bit_rows.which(placed, windows, who)
    rows &= bit_rows.windows_at(windows, height, pattern, near.left - placed.x[who], near.top - placed.y[who])
    some = np.bitwise_or.reduce(rows, axis=1).nonzero()[0]
    return near.at(some), rows[some]


def _first(ordered: OrderedTiles, tile: Ints, top: Ints) -> Ints:
    """Places (n,) in `words` of the rows at y = `top`; up to WORD rows before a tile's first or after its last."""
    first = ordered.begin[tile]
    first -= ordered.box_xyxy[:, 1][tile]
    first += top
    return first


# house: hit rule of areas
def _hide(rows: Words, ordered: OrderedTiles, near: Near, pierce: bool) -> None:
    """Clear the pixels (n, height) that are covered by a tile in front at which they end."""
    of, front, right = _fronts(ordered, near, rows.shape[1])
    if pierce:
        ends = ordered.occluder[front].nonzero()[0] if len(ordered.occluder) else np.zeros(0, np.int64)
        of, front, right = of[ends], front[ends], right[ends]
    height = rows.shape[1]
    step = max(WORDS_AT_ONCE // height, 1)
    for first in range(0, len(of), step):
        now = slice(first, first + step)
        own, by = of[now], right[now]
        cover = rows_of(ordered.words, height, _first(ordered, front[now], near.top[own]))
        cover <<= np.maximum(by, 0).view(np.uint64)[:, None]
        cover >>= np.maximum(-by, 0).view(np.uint64)[:, None]
        np.invert(cover, out=cover)
        new = begins(own).nonzero()[0]
        if len(new) < len(own):
            own, cover = own[new], np.bitwise_and.reduceat(cover, new, axis=0)
        rows[own] &= cover


def _fronts(ordered: OrderedTiles, near: Near, height: int) -> tuple[Ints, Ints, Ints]:
    """Tiles in front of those of pairs (n,) near the same placement, as sorted (pair, tile, columns to the right)."""
    count = len(near.tile)
    start = near.placement.searchsorted(near.placement)
    before = np.arange(count) - start
    end = before.cumsum()
    total = int(end[-1])
    if not total:
        return end[:0], end[:0], end[:0]
    if total > FRONTS_AT_ONCE:
        return _fronts_of_many(ordered, near)
    of = np.arange(count).repeat(before)
    other = np.arange(total) - (end - before - start).repeat(before)
    right, down = near.left[other] - near.left[of], near.top[other] - near.top[of]
    wide = int(np.maximum.reduce(ordered.box_xyxy[:, 2] - ordered.box_xyxy[:, 0])) + 1
    met = ((np.abs(right) < wide) & (np.abs(down) < height)).nonzero()[0]
    return of[met], near.tile[other[met]], right[met]


def _fronts_of_many(ordered: OrderedTiles, near: Near) -> tuple[Ints, Ints, Ints]:
    """Like `_fronts`, for crowds, in which most tiles near a placement do not meet: those that meet are found first."""
    distinct, which = np.unique(near.tile, return_inverse=True)
    boxes = ordered.box_xyxy[distinct]
    own, other = met_boxes(boxes, boxes)
    before = (other < own).nonzero()[0]
    own, other = own[before], other[before]
    begin = own.searchsorted(np.arange(len(distinct) + 1))
    of, place = ragged((begin[1:] - begin[:-1])[which])
    front = distinct[other[begin[which][of] + place]]
    pairs = near.placement * len(ordered.rank) + near.tile
    asked = near.placement[of] * len(ordered.rank) + front
    there = (pairs[pairs.searchsorted(asked, side="right") - 1] == asked).nonzero()[0]
    of, front = of[there], front[there]
    return of, front, ordered.box_xyxy[front, 0] - near.left[of]


def _counted(placed: Placed, ordered: OrderedTiles, near: Near, rows: Words) -> TileHits:
    """Hits of objects, from the pixels (n, height) that are left."""
    samples = np.add.reduce(np.bitwise_count(rows), axis=1, dtype=np.int64)
    if len(ordered.occluder):
        samples[ordered.occluder[near.tile]] = 0
    hit = samples.nonzero()[0]
    if len(hit) < len(samples):
        near, rows, samples = near.at(hit), rows[hit], samples[hit]
    who = near.placement
    origin_x, origin_y = placed.origin_x[who], placed.origin_y[who]
    distance2, x, y = nearest(rows, near.left - origin_x, near.top - origin_y)
    return TileHits(who, near.tile, samples, distance2, x + origin_x, y + origin_y)


def looked_up(placed: Placed, windows: PatternBits, seen: VisibleTiles, cells: Cells, beside: Beside) -> TileHits:
    """Hits of placed patterns on visible tiles, the nearest item of a placement first.

    Parameters
    ----------
    cells : lists of the visible tiles, for the box around the patterns
    beside : distances along the rows of the visible tiles, or empty: see `bit_rows.found`

    Returns
    -------
    as `item_rows`
    """
    placement, near = listed_at(cells, placed.x, placed.y)
    return item_rows(found(placed, windows, seen, placement, near, beside), placed, seen.rank)


def gathered_up(placed: Placed, windows: PatternBits, seen: VisibleTiles, cells: Cells, each: int) -> RoundHits:
    """Hits of rounds of `each` pellets on visible tiles; `cells` list the tiles, for the box around the patterns."""
    placement, near = listed_at(cells, placed.x, placed.y)
    return gathered(placed, windows, seen, placement, near, each)
