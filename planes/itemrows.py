"""Pairs of placements and tiles as rows: of placements and items, the nearest first."""

from __future__ import annotations

from math import isqrt

import numpy as np

from planes.arrays import Ints
from planes.bitrows import Found, Placed

__all__ = ["item_rows"]


def item_rows(found: Found, placed: Placed, rank: Ints) -> Found:
    """Pairs of placements and items, of those of placements and tiles.

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
        return Found(who, *[column[order] for column in found[1:]])
    first = np.concatenate(([True], ~same)).nonzero()[0]
    turn = np.empty_like(order)
    turn[order] = np.arange(len(order))
    soonest = np.minimum.reduceat(turn, first)
    by_turn = soonest.argsort()
    nearest = order[soonest[by_turn]]
    samples = np.add.reduceat(found.samples, first)[by_turn]
    return Found(who[nearest], found.seen[first[by_turn]], samples, *[column[nearest] for column in found[3:]])


def _row_order(found: Found, placed: Placed) -> Ints:
    """Order by (placement, distance2, y, x, place) of pairs (n,) that are sorted by placement."""
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
    key += found.x > placed.origin_x[who]  # of pixels as far in the same row there is at most one on each side
    return key.argsort(kind="stable")
