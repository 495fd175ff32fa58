"""The one loop of areas: placed patterns against tiles of bit rows, front to back.

It serves tiles as they lie in the stack, which need no preparation, and the visible tiles of a scene that stands still,
which hide nothing from each other and are listed by cells. All functions map arrays to arrays; `jit.areas` has the
compiled form of the loop. The rule is that of `span_walk.walk`, the reference, and is compared with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import late
from ..common.backend import kernels_of
from ..common.checks import Bools, Ints
from ..grid.spans import Box, begins, ragged, row_order, sorted_once
from . import bit_rows
from .bit_rows import PatternBits, Placed, Words, nearest, rows_of, weights_of
from .cells import Cells, listed_at, met_boxes

if TYPE_CHECKING:
    from .blockers import Blockers

FRONTS_AT_ONCE = 2**14
"""Most pairs of tiles near the same placement that are all listed; of more, only those that meet are listed."""

COLUMNS = 8
"""Numbers that a pair takes beside its rows."""

NO_FLAGS, NO_NUMBERS = np.zeros(0, np.bool_), np.zeros(0, np.int64)


class OrderedTiles(NamedTuple):
    """Tiles at their places in the world, front to back, as columns.

    Parameters
    ----------
    rank : (T,) place in the stack of each tile's item, rising
    box_xyxy : (T, 4) inclusive, px
    begin : (T,) first row in `words`
    words : flat rows, with WORD empty ones before and after each tile
    occluder : (T,) whether the item is an occluder, which no shot hits; (0,) if there are none
    categories, owner : (T,) category bits and owner of the item; (0,) if no shot refuses an item
    """

    rank: Ints
    box_xyxy: Ints
    begin: Ints
    words: Words
    occluder: Bools = NO_FLAGS
    categories: Ints = NO_NUMBERS
    owner: Ints = NO_NUMBERS


class Rule(NamedTuple):
    """What pixels of placements are stopped by.

    Parameters
    ----------
    pierce : whether they go on through objects; they end at occluders
    bounds : box beyond which nothing is hit
    meets : filter of the items that all placements meet, or (P,) of each; None refuses nothing
    exclude : owners whose items are skipped, (1, K) for all placements or (P, K), -1 for none
    blockers : items that shelter what lies behind them from the pixel of the placement; None if no way is looked at
    """

    pierce: bool
    bounds: Box | None = None
    meets: Ints | int | None = None
    exclude: Ints | None = None
    blockers: Blockers | None = None


class RoundHits(NamedTuple):
    """Pixels shared by rounds and items, as columns (n,), sorted by (turn, distance2, y, x, rank).

    Parameters
    ----------
    turn : number of the round among those of all shots
    rank : place of the item in the stack
    samples : pixels of all pellets
    distance2, x, y : the hit pixel that is nearest to the round's own, the first by (distance2, y, x)
    weight : sum of the weights of the pixels; None at full weight
    pixels, pellets : distinct pixels, and pellets that hit; None if a round has one pellet
    """

    turn: Ints
    rank: Ints
    samples: Ints
    distance2: Ints
    x: Ints
    y: Ints
    weight: Ints | None = None
    pixels: Ints | None = None
    pellets: Ints | None = None


class TileHits(NamedTuple):
    """Pixels that placements and tiles share, as columns (n,), sorted by (placement, tile); see `RoundHits`.

    `pixels` counts those that no earlier pellet of the round hit on the tile.
    """

    placement: Ints
    rank: Ints
    samples: Ints
    distance2: Ints
    x: Ints
    y: Ints
    weight: Ints | None
    pixels: Ints | None


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
    each: int,
    windows: PatternBits,
    tiles: OrderedTiles,
    rule: Rule,
    near: Cells | tuple[Ints, Ints] | None = None,
) -> RoundHits:
    """Hits of placed patterns: each pixel of a pattern ends at the first accepted item that covers it, front to back.

    Parameters
    ----------
    placed : pellets, sorted by round, `each` of a round
    near : lists of the tiles, by cells for the box around the patterns; or sorted pairs (n,) of a placement and a tile
        that may meet; None: all boxes are compared
    """
    pairs, height = _near(placed, windows, tiles, rule, near)
    hides = not rule.pierce or len(tiles.occluder) > 0
    parts = []
    for these in _parts(pairs, max(bit_rows.WORDS_AT_ONCE // (height + COLUMNS), 1), each):
        part, rows = these, _shared(placed, windows, tiles, these, height)
        if hides:
            kept = np.bitwise_or.reduce(rows, axis=1).nonzero()[0]
            part, rows = these.at(kept), rows[kept]
            _hide(rows, tiles, part, rule.pierce)
        if rule.bounds is not None:
            bit_rows.cut_off(rows, part.left, part.top, rule.bounds)
        if rule.blockers is not None:
            _shelter(rows, placed, windows, tiles, part, rule, rule.blockers)
        parts.append(_counted(placed, each, windows, tiles, part, rows))
    return hits_of_rounds(_joined(parts), each)


def some_rounds(placed: Placed, each: int, rule: Rule, turn: Ints) -> tuple[Placed, Rule]:
    """The placements of rounds (n,), `each` of a round, and what stops them."""
    own = turn if each == 1 else (turn[:, None] * each + np.arange(each)).reshape(-1)
    pattern, x, y = (column[own] for column in placed[:3])
    if isinstance(rule.meets, np.ndarray):
        rule = rule._replace(meets=rule.meets[own])
    if rule.exclude is not None and len(rule.exclude) > 1:
        rule = rule._replace(exclude=rule.exclude[own])
    return Placed(pattern, x, y, placed.origin_x[turn], placed.origin_y[turn]), rule


def _near(
    placed: Placed, windows: PatternBits, tiles: OrderedTiles, rule: Rule, near: Cells | tuple[Ints, Ints] | None
) -> tuple[Near, int]:
    """Pairs of a placement and an accepted tile whose box and strip meet; and the number of rows to compare."""
    asked, sides = bit_rows.placed_boxes(placed, windows), tiles.box_xyxy.T
    if near is None:
        placement, tile = met_boxes(asked.T, tiles.box_xyxy)
    else:
        placement, tile = listed_at(near, placed.x, placed.y) if isinstance(near, Cells) else near
        placement, tile = _meeting(asked, sides, placement, tile)
    placement, tile = bit_rows.crossing(placed, windows, sides, placement, tile)
    if rule.meets is not None:
        rows = _accepted(tiles, rule.meets, rule.exclude, placement, tile).nonzero()[0]
        placement, tile = placement.take(rows), tile.take(rows)
    high, low = (int(np.maximum.reduce(box[3] - box[1], initial=0)) + 1 for box in (sides, windows.box_xyxy.T))
    top = sides[1].take(tile) if low >= high else asked[1].take(placement)
    return Near(placement, tile, sides[0].take(tile), top), min(high, low)


def _meeting(asked: Ints, sides: Ints, placement: Ints, tile: Ints) -> tuple[Ints, Ints]:
    """Pairs (n,) whose boxes share a pixel; `asked` and `sides` are the sides (4, m) of boxes."""
    for axis in (0, 1):
        met = sides[axis].take(tile) <= asked[axis + 2].take(placement)
        met &= sides[axis + 2].take(tile) >= asked[axis].take(placement)
        rows = met.nonzero()[0]
        placement, tile = placement.take(rows), tile.take(rows)
    return placement, tile


def _accepted(
    tiles: OrderedTiles | Blockers, meets: Ints | int, exclude: Ints | None, placement: Ints, tile: Ints
) -> Bools:
    """Which tiles, or blockers, of pairs (n,) their placements accept."""
    bits = meets if isinstance(meets, int) else meets[placement]
    accepted = (tiles.categories[tile] & bits) != 0
    if exclude is not None:
        owners = exclude[placement] if len(exclude) > 1 else exclude
        accepted &= (tiles.owner[tile][:, None] != owners).all(axis=1)
    return np.asarray(accepted)


def _parts(near: Near, most: int, each: int) -> Iterator[Near]:
    """Parts of about `most` pairs; those of a round stay together."""
    count, begin = len(near.tile), 0
    while begin < count:
        end = min(begin + most, count)
        if end < count:
            end = int(near.placement.searchsorted((near.placement[end] // each + 1) * each))
        yield near if end - begin == count else near.at(slice(begin, end))
        begin = end


def _shared(placed: Placed, windows: PatternBits, tiles: OrderedTiles, near: Near, height: int) -> Words:
    """Pixels (n, height) that pairs share."""
    rows, placement = rows_of(tiles.words, height, _first(tiles, near.tile, near.top)), near.placement
    left, top = near.left - placed.x.take(placement), near.top - placed.y.take(placement)
    rows &= bit_rows.windows_at(windows, height, bit_rows.which(placed, windows, placement), left, top)
    return rows


def _first(tiles: OrderedTiles, tile: Ints, top: Ints) -> Ints:
    """Places (n,) in `words` of the rows at y = `top`; up to WORD rows before a tile's first or after its last."""
    first = tiles.begin[tile]
    first -= tiles.box_xyxy[:, 1][tile]
    first += top
    return first


def _hide(rows: Words, tiles: OrderedTiles, near: Near, pierce: bool) -> None:
    """Clear the pixels (n, height) that are covered by a tile in front at which they end."""
    of, front, right = _fronts(tiles, near, rows.shape[1])
    if pierce:
        ends = tiles.occluder[front].nonzero()[0]
        of, front, right = of[ends], front[ends], right[ends]
    bit_rows.take_away(rows, tiles.words, of, _first(tiles, front, near.top[of]), right)


def _shelter(
    rows: Words, placed: Placed, windows: PatternBits, tiles: OrderedTiles, near: Near, rule: Rule, blockers: Blockers
) -> None:
    """Clear the pixels (n, height) that other items shelter from the pixel of their placement."""
    placement, shadows = near.placement, late.shadows
    asked, boxes = bit_rows.placed_boxes(placed, windows)[:, placement].T, tiles.box_xyxy[near.tile]
    boxes = np.concatenate([np.maximum(boxes[:, :2], asked[:, :2]), np.minimum(boxes[:, 2:], asked[:, 2:])], axis=1)
    origin_xy = np.stack([placed.x.take(placement), placed.y.take(placement)], axis=1)
    corner_xy = np.stack([near.left, near.top], axis=1)
    for pair, blocker in shadows.ways_met(boxes, origin_xy, blockers):
        other = blockers.rank[blocker] != tiles.rank[near.tile[pair]]
        if rule.meets is not None and len(blockers.categories):
            other &= _accepted(blockers, rule.meets, rule.exclude, placement[pair], blocker)
        for own, blocker_now in shadows.nearest_first(pair[other], blocker[other], origin_xy, blockers):
            lit = np.bitwise_or.reduce(rows, axis=1)[own] != 0
            kernels_of(shadows).hide_behind(rows, corner_xy, origin_xy, blockers, own[lit], blocker_now[lit])


def _fronts(tiles: OrderedTiles, near: Near, height: int) -> tuple[Ints, Ints, Ints]:
    """Tiles in front of those of pairs (n,) near the same placement, as sorted (pair, tile, columns to the right)."""
    count = len(near.tile)
    start = near.placement.searchsorted(near.placement)
    before = np.arange(count) - start
    end = before.cumsum()
    total = int(end[-1]) if count else 0
    if not total:
        return end[:0], end[:0], end[:0]
    if total > FRONTS_AT_ONCE:
        return _fronts_of_many(tiles, near)
    of = np.arange(count).repeat(before)
    other = np.arange(total) - (end - before - start).repeat(before)
    right, down = near.left[other] - near.left[of], near.top[other] - near.top[of]
    wide = int(np.maximum.reduce(tiles.box_xyxy[:, 2] - tiles.box_xyxy[:, 0])) + 1
    met = ((np.abs(right) < wide) & (np.abs(down) < height)).nonzero()[0]
    return of[met], near.tile[other[met]], right[met]


def _fronts_of_many(tiles: OrderedTiles, near: Near) -> tuple[Ints, Ints, Ints]:
    """Like `_fronts`, for crowds, in which most tiles near a placement do not meet: those that meet are found first."""
    distinct = sorted_once(near.tile)
    which = distinct.searchsorted(near.tile)
    boxes = tiles.box_xyxy[distinct]
    own, other = met_boxes(boxes, boxes)
    before = (other < own).nonzero()[0]
    own, other = own[before], other[before]
    begin = own.searchsorted(np.arange(len(distinct) + 1))
    of, place = ragged((begin[1:] - begin[:-1])[which])
    front = distinct[other[begin[which][of] + place]]
    pairs = near.placement * len(tiles.rank) + near.tile
    asked = near.placement[of] * len(tiles.rank) + front
    there = (pairs[pairs.searchsorted(asked, side="right") - 1] == asked).nonzero()[0]
    of, front = of[there], front[there]
    return of, front, tiles.box_xyxy[front, 0] - near.left[of]


def _counted(placed: Placed, each: int, windows: PatternBits, tiles: OrderedTiles, near: Near, rows: Words) -> TileHits:
    """Hits on objects, from the pixels (n, height) that are left."""
    samples = np.bitwise_count(rows).sum(axis=1, dtype=np.int64)
    if len(tiles.occluder):
        samples[tiles.occluder[near.tile]] = 0
    hit = samples.nonzero()[0]
    if len(hit) < len(samples):
        near, rows, samples = near.at(hit), rows.take(hit, axis=0), samples.take(hit)
    placement = near.placement
    turn = placement // each if each > 1 else placement
    origin_x, origin_y = placed.origin_x.take(turn), placed.origin_y.take(turn)
    distance2, x, y = nearest(rows, near.left - origin_x, near.top - origin_y)
    weight = None
    if len(windows.sums):
        left, top = near.left - placed.x.take(placement), near.top - placed.y.take(placement)
        weight = weights_of(rows, windows, bit_rows.which(placed, windows, placement), left, top)
    pixels = _distinct(turn, near, tiles, rows, samples) if each > 1 else None
    xy = x + origin_x, y + origin_y
    return TileHits(placement, tiles.rank.take(near.tile), samples, distance2, *xy, weight, pixels)


def _distinct(turn: Ints, near: Near, tiles: OrderedTiles, rows: Words, samples: Ints) -> Ints:
    """Pixels (n,) of pairs that no earlier pellet of the round hit on the tile: all with the first that hit it."""
    order = row_order(turn, near.tile)
    new = begins(turn[order]) | begins(near.tile[order])
    first = new.nonzero()[0]
    pixels = np.zeros_like(samples)
    pixels[order[first]] = samples[order[first]]
    length = np.diff(first, append=len(order))
    shared = length > 1  # tiles that several pellets of a round hit
    group = order[shared.repeat(length)]
    first, length = first[shared], length[shared]
    if not len(group):
        return pixels
    together = np.zeros((len(group), 2 * bit_rows.WORD), np.uint64)  # rows from the tile's own first one on
    row = np.arange(rows.shape[1]) + (near.top - tiles.box_xyxy[near.tile, 1])[group][:, None]
    np.put_along_axis(together, row % (2 * bit_rows.WORD), rows[group], axis=1)  # rows before it are empty
    union = np.bitwise_or.reduceat(together, np.cumsum(length) - length, axis=0)
    pixels[order[first]] = np.bitwise_count(union).sum(axis=1, dtype=np.int64)
    return pixels


def _joined(parts: list[TileHits]) -> TileHits:
    """Hits of all parts, one after another."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        none = NO_NUMBERS
        return TileHits(none, none, none, none, none, none, None, None)
    columns: list[Any] = [None if column[0] is None else np.concatenate(column) for column in zip(*parts, strict=True)]
    return TileHits(*columns)


def hits_of_rounds(found: TileHits, each: int) -> RoundHits:
    """Hits of rounds on items, from those of their pellets on tiles."""
    turn, rank = found.placement // each if each > 1 else found.placement, found.rank
    samples, distance2, x, y, weight, pixels = found[2:]
    pellets: Ints | None = None
    if each > 1 or np.logical_or.reduce((rank[1:] == rank[:-1]) & (turn[1:] == turn[:-1])):
        order = row_order(turn, rank, found.placement)
        new = begins(turn[order]) | begins(rank[order])
        first = new.nonzero()[0]
        samples = _added(samples[order], first)
        weight, pixels = (None if column is None else _added(column[order], first) for column in (weight, pixels))
        if each > 1:
            pellets = _added((new | begins(found.placement[order])).astype(np.int64), first)
        group = np.empty_like(turn)
        group[order] = np.cumsum(new) - 1
        best = row_order(group, distance2, y, x)[first]
        turn, rank, distance2, x, y = (column[best] for column in (turn, rank, distance2, x, y))
    order = row_order(turn, distance2, y, x)
    every = turn, rank, samples, distance2, x, y, weight, pixels, pellets
    columns: list[Any] = [None if column is None else column.take(order) for column in every]
    return RoundHits(*columns)


def _added(values: Ints, first: Ints) -> Ints:
    """Sums of groups that begin at `first`."""
    return np.add.reduceat(values, first) if len(first) else values[:0]
