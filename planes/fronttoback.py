"""What placed patterns hit of the tiles of a stack where they lie, front to back.

Nothing is made beforehand: for scenes in which everything moves, for few shots, and for shots that accept different
items. Functions from arrays to arrays; `fronttoback_jit` has the same ones, compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planes import bitrows
from planes.arrays import Bools, Ints
from planes.bitrows import WORD, WORDS_AT_ONCE, Found, Placed, Windows, Words
from planes.cells import met_boxes
from planes.spans import Box, ragged

__all__ = ["Pile", "front_to_back"]


class Pile(NamedTuple):
    """The tiles of a stack where they lie, front to back, as columns.

    Parameters
    ----------
    rank : (T,) place in the stack of the item of each, rising
    box_xyxy : (T, 4) inclusive, px
    begin : (T,) its first row in `words`
    words : flat rows, with WORD empty ones before and after each tile
    occluder : (T,) whether it is of an occluder, which no shot hits; (0,) where there is none
    categories, owner : (T,) of its item: category bits, and whose it is
    """

    rank: Ints
    box_xyxy: Ints
    begin: Ints
    words: Words
    occluder: Bools
    categories: Ints
    owner: Ints


def front_to_back(
    placed: Placed,
    windows: Windows,
    pile: Pile,
    accept: Ints | int | None,
    exclude: Ints | None,
    pierce: bool,
    bounds: Box | None,
) -> Found:
    """What placed patterns hit of items: each pixel ends at the first that accepts it, front to back.

    Parameters
    ----------
    accept : category bits, of all placements or (P,) of each; None: nothing is refused, nor looked up for it
    exclude : owners that are passed over, of all (1, K) or (P, K) of each, -1 for none; or None
    pierce : whether objects let through; occluders do not
    bounds : beyond them nothing is hit

    Returns
    -------
    pairs of a placement and an item, `seen` the first of its tiles that is hit; `samples` of all of them; the nearest
    pixel to the origin. Sorted by (placement, distance2, y, x, rank).
    """
    boxes = windows.box_xyxy[placed.pattern] + np.stack([placed.x, placed.y] * 2, axis=1)
    placement, tile = met_boxes(boxes, pile.box_xyxy)
    if accept is not None:
        some = _accepted(pile, accept, exclude, placement, tile)
        placement, tile = placement[some], tile[some]
    left, top = pile.box_xyxy[tile, 0], pile.box_xyxy[tile, 1]
    height = -(-int((pile.box_xyxy[:, 3] - pile.box_xyxy[:, 1]).max(initial=0) + 1) // 8) * 8
    rows = bitrows.rows_of(pile.words, height, pile.begin[tile])
    rows &= bitrows._windows(placed, windows, height, placement, left, top)
    if bounds is not None:
        rows &= _inside(left, top, height, bounds)
    _take_away_front(rows, pile, accept, exclude, pierce, placement, tile)
    if len(pile.occluder):
        rows[pile.occluder[tile]] = 0
    samples = np.bitwise_count(rows).sum(axis=1, dtype=np.int64)
    hit = samples.nonzero()[0]
    who = placement[hit]
    origin_x, origin_y = placed.origin_x[who], placed.origin_y[who]
    distance2, x, y = bitrows._nearest(rows[hit], left[hit] - origin_x, top[hit] - origin_y)
    return _by_item(Found(who, tile[hit], samples[hit], distance2, x + origin_x, y + origin_y), pile.rank)


def _accepted(pile: Pile, accept: Ints | int, exclude: Ints | None, placement: Ints, tile: Ints) -> Bools:
    """Which tiles of pairs (n,) are there at all for their placement."""
    bits = accept if isinstance(accept, int) else accept[placement]
    accepted = (pile.categories[tile] & bits) != 0
    if exclude is not None:
        owners = exclude[placement] if len(exclude) > 1 else exclude
        accepted &= (pile.owner[tile][:, None] != owners).all(axis=1)
    return np.asarray(accepted)


def _inside(left: Ints, top: Ints, height: int, bounds: Box) -> Words:
    """Pixels (n, height) of tiles that lie within bounds."""
    x, y, x_max, y_max = bounds
    first, last = (np.clip(edge - left, 0, WORD).astype(np.uint64) for edge in (x, x_max + 1))
    full = np.uint64(2**64 - 1)
    columns = (full << first) & ~(full << last)
    row = top[:, None] + np.arange(height)
    return np.where((row >= y) & (row <= y_max), columns[:, None], np.uint64(0))


def _take_away_front(
    rows: Words, pile: Pile, accept: Ints | int | None, exclude: Ints | None, pierce: bool, placement: Ints, tile: Ints
) -> None:
    """Take away of the pixels of tiles (n, height) those on which one lies that ends the placement's pixels before."""
    distinct, which = np.unique(tile, return_inverse=True)
    boxes = pile.box_xyxy[distinct]
    own, other = met_boxes(boxes, boxes)
    before = (other < own).nonzero()[0]
    own, other = own[before], other[before]
    begin = np.searchsorted(own, np.arange(len(distinct) + 1))
    pair, place = ragged((begin[1:] - begin[:-1])[which])
    front = distinct[other[begin[which][pair] + place]]
    if accept is not None:
        ends = _accepted(pile, accept, exclude, placement[pair], front)
        pair, front = pair[ends], front[ends]
    if pierce:
        ends = pile.occluder[front] if len(pile.occluder) else np.zeros(len(front), np.bool_)
        pair, front = pair[ends], front[ends]
    height = rows.shape[1]
    step = max(WORDS_AT_ONCE // height, 1)
    for first in range(0, len(pair), step):
        of, by = (column[first : first + step] for column in (pair, front))
        right, down = (pile.box_xyxy[by, axis] - pile.box_xyxy[tile[of], axis] for axis in (0, 1))
        cover = bitrows.rows_of(pile.words, height, pile.begin[by] - down)
        cover <<= np.maximum(right, 0).astype(np.uint64)[:, None]
        cover >>= np.maximum(-right, 0).astype(np.uint64)[:, None]
        group = np.flatnonzero(np.diff(of, prepend=-1))
        rows[of[group]] &= ~np.bitwise_or.reduceat(cover, group, axis=0)


def _by_item(found: Found, rank: Ints) -> Found:
    """Pairs of placements and tiles, sorted, as those of placements and items in the order of rows."""
    item = rank[found.seen]
    order = np.lexsort((found.x, found.y, found.distance2, item, found.placement))
    new = (np.diff(found.placement[order], prepend=-1) != 0) | (np.diff(item[order], prepend=-1) != 0)
    first = np.flatnonzero(new)
    samples, seen = found.samples[order], found.seen[order]
    if len(first):
        samples, seen = np.add.reduceat(samples, first), np.minimum.reduceat(seen, first)
    best = order[first]
    one = Found(found.placement[best], seen, samples, found.distance2[best], found.x[best], found.y[best])
    order = np.lexsort((item[best], one.x, one.y, one.distance2, one.placement))
    return Found(*(column[order] for column in one))
