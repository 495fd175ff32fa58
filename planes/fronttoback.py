"""What placed patterns hit of the tiles of a stack where they lie, front to back.

Nothing is made beforehand: for scenes in which everything moves, for few shots, and for shots that accept different
items. Functions from arrays to arrays; `fronttoback_jit` has the same ones, compiled.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from planes import bitrows
from planes.arrays import Bools, Ints
from planes.bitrows import Found, Placed, Windows
from planes.bits import Words, rows_of
from planes.cells import met_boxes
from planes.itemrows import item_rows
from planes.nearest import nearest
from planes.spans import Box, begins, ragged

__all__ = ["Pile", "front_to_back"]

WORDS_AT_ONCE = 2**16
"""Words of pairs worked on at a time: 512 KB; with fewer the calls weigh more."""

FRONTS_AT_ONCE = 2**14
"""Pairs of tiles near one placement that are compared one by one; in a larger crowd only those that meet are listed."""


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


class Near(NamedTuple):
    """Pairs (n,) of a placement and a tile near it, sorted.

    Parameters
    ----------
    placement, tile : which
    left, top : (n,) the corner of the rows that are looked at, px: the tile's, or on its columns the pattern's if it is
        low
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
    near, height = _near(placed, windows, pile, accept, exclude)
    parts = []
    for part in _parts(near, max(WORDS_AT_ONCE // height, 1)):
        some, rows = _shared(placed, windows, pile, part, height)
        if len(rows):
            _hide(rows, pile, some, pierce)
            if bounds is not None:
                bitrows.cut_off(rows, some.left, some.top, bounds)
            parts.append(_counted(placed, pile, some, rows))
    if not parts:
        return Found(*[np.zeros(0, np.int64)] * 6)
    found = parts[0] if len(parts) == 1 else Found(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return item_rows(found, placed, pile.rank)


def _near(
    placed: Placed, windows: Windows, pile: Pile, accept: Ints | int | None, exclude: Ints | None
) -> tuple[Near, int]:
    """Pairs whose boxes and strips meet, of tiles that are there for the placement; and how many rows are looked at."""
    asked = bitrows.placed_boxes(placed, windows)
    placement, tile = met_boxes(asked.T, pile.box_xyxy)
    placement, tile = bitrows.crossing(placed, windows, pile.box_xyxy.T, placement, tile)
    left, top = pile.box_xyxy[:, 0], pile.box_xyxy[:, 1]
    high = int(np.maximum.reduce(pile.box_xyxy[:, 3] - top, initial=0)) + 1
    low = int(np.maximum.reduce(asked[3] - asked[1], initial=0)) + 1
    near = Near(placement, tile, left[tile], top[tile] if low >= high else asked[1][placement])
    if accept is None:
        return near, min(high, low)
    return near.at(_accepted(pile, accept, exclude, placement, tile).nonzero()[0]), min(high, low)


def _accepted(pile: Pile, accept: Ints | int, exclude: Ints | None, placement: Ints, tile: Ints) -> Bools:
    """Which tiles of pairs (n,) are there at all for their placement."""
    bits = accept if isinstance(accept, int) else accept[placement]
    accepted = (pile.categories[tile] & bits) != 0
    if exclude is not None:
        owners = exclude[placement] if len(exclude) > 1 else exclude
        accepted &= (pile.owner[tile][:, None] != owners).all(axis=1)
    return np.asarray(accepted)


def _parts(near: Near, most: int) -> Iterator[Near]:
    """Pairs, so many at a time or a little more, all of a placement together."""
    count, begin = len(near.tile), 0
    while begin == 0 or begin < count:
        end = min(begin + most, count)
        if end < count:
            end = int(near.placement.searchsorted(near.placement[end], side="right"))
        yield near if end - begin == count else near.at(slice(begin, end))
        begin = max(end, 1)


def _shared(placed: Placed, windows: Windows, pile: Pile, near: Near, height: int) -> tuple[Near, Words]:
    """Pairs that share pixels at all, and those pixels (n, height)."""
    rows = rows_of(pile.words, height, _first(pile, near.tile, near.top))
    who = near.placement
    pattern = bitrows.which(placed, windows, who)
    rows &= bitrows.windows_at(windows, height, pattern, near.left - placed.x[who], near.top - placed.y[who])
    some = np.bitwise_or.reduce(rows, axis=1).nonzero()[0]
    return near.at(some), rows[some]


def _first(pile: Pile, tile: Ints, top: Ints) -> Ints:
    """The row (n,) of tiles at a height in the world; up to WORD before their first one or behind their last."""
    first = pile.begin[tile]
    first -= pile.box_xyxy[:, 1][tile]
    first += top
    return first


def _hide(rows: Words, pile: Pile, near: Near, pierce: bool) -> None:
    """Take away of pixels (n, height) those on which a tile lies that ends the placement's pixels before."""
    of, front, right = _fronts(pile, near, rows.shape[1])
    if pierce:
        ends = pile.occluder[front].nonzero()[0] if len(pile.occluder) else np.zeros(0, np.int64)
        of, front, right = of[ends], front[ends], right[ends]
    height = rows.shape[1]
    step = max(WORDS_AT_ONCE // height, 1)
    for first in range(0, len(of), step):
        now = slice(first, first + step)
        own, by = of[now], right[now]
        cover = rows_of(pile.words, height, _first(pile, front[now], near.top[own]))
        cover <<= np.maximum(by, 0).view(np.uint64)[:, None]
        cover >>= np.maximum(-by, 0).view(np.uint64)[:, None]
        np.invert(cover, out=cover)
        new = begins(own).nonzero()[0]
        if len(new) < len(own):
            own, cover = own[new], np.bitwise_and.reduceat(cover, new, axis=0)
        rows[own] &= cover


def _fronts(pile: Pile, near: Near, height: int) -> tuple[Ints, Ints, Ints]:
    """Tiles in front of those of pairs (n,), near the same placement, as (pair, tile, columns to its right), sorted."""
    count = len(near.tile)
    start = near.placement.searchsorted(near.placement)
    before = np.arange(count) - start
    end = before.cumsum()
    total = int(end[-1])
    if not total:
        return end[:0], end[:0], end[:0]
    if total > FRONTS_AT_ONCE:
        return _fronts_of_many(pile, near)
    of = np.arange(count).repeat(before)
    other = np.arange(total) - (end - before - start).repeat(before)
    right, down = near.left[other] - near.left[of], near.top[other] - near.top[of]
    wide = int(np.maximum.reduce(pile.box_xyxy[:, 2] - pile.box_xyxy[:, 0])) + 1
    met = ((np.abs(right) < wide) & (np.abs(down) < height)).nonzero()[0]
    return of[met], near.tile[other[met]], right[met]


def _fronts_of_many(pile: Pile, near: Near) -> tuple[Ints, Ints, Ints]:
    """The same, of tiles that meet: where many of them lie near a placement, most do not meet each other."""
    distinct, which = np.unique(near.tile, return_inverse=True)
    boxes = pile.box_xyxy[distinct]
    own, other = met_boxes(boxes, boxes)
    before = (other < own).nonzero()[0]
    own, other = own[before], other[before]
    begin = own.searchsorted(np.arange(len(distinct) + 1))
    of, place = ragged((begin[1:] - begin[:-1])[which])
    front = distinct[other[begin[which][of] + place]]
    pairs = near.placement * len(pile.rank) + near.tile
    asked = near.placement[of] * len(pile.rank) + front
    there = (pairs[pairs.searchsorted(asked, side="right") - 1] == asked).nonzero()[0]
    of, front = of[there], front[there]
    return of, front, pile.box_xyxy[front, 0] - near.left[of]


def _counted(placed: Placed, pile: Pile, near: Near, rows: Words) -> Found:
    """What is left of objects, of their pixels (n, height)."""
    samples = np.add.reduce(np.bitwise_count(rows), axis=1, dtype=np.int64)
    if len(pile.occluder):
        samples[pile.occluder[near.tile]] = 0
    hit = samples.nonzero()[0]
    if len(hit) < len(samples):
        near, rows, samples = near.at(hit), rows[hit], samples[hit]
    who = near.placement
    origin_x, origin_y = placed.origin_x[who], placed.origin_y[who]
    distance2, x, y = nearest(rows, near.left - origin_x, near.top - origin_y)
    return Found(who, near.tile, samples, distance2, x + origin_x, y + origin_y)
