"""Pairs of pellets and tiles as rows: of rounds and the items that their pellets hit, the nearest first."""

from __future__ import annotations

from itertools import pairwise
from types import ModuleType
from typing import NamedTuple

import numpy as np

from planes import bitrows
from planes.arrays import Bools, Ints
from planes.bitrows import Found, Placed, Windows, placed_boxes
from planes.bits import WORD, Seen
from planes.nearest import Beside
from planes.spans import begins, ragged
from planes.twins import kernels_of

__all__ = ["NOT_BESIDE", "Gathered", "gathered"]

NOT_BESIDE: Beside = np.zeros((0, WORD, 0), np.uint8)
"""No distances along rows: the nearest pixel is looked for in what is hit."""

PAIRS_AT_ONCE = 2**16
"""Pairs of placements and tiles counted at a time, about: half a megabyte for each of their columns."""

PAIRED = 8
"""Pellets on one tile up to which each is compared with each other."""


class Gathered(NamedTuple):
    """What rounds and items share, as columns (n,), sorted by (turn, distance2, y, x, rank).

    Parameters
    ----------
    turn : which round of all shots
    rank : place in the stack of the item
    samples, pixels, pellets : pixels of all pellets; each of them once; pellets that hit
    distance2, x, y : of the hit pixel that is nearest to the round's own
    """

    turn: Ints
    rank: Ints
    samples: Ints
    pixels: Ints
    pellets: Ints
    distance2: Ints
    x: Ints
    y: Ints


def gathered(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, each: int) -> Gathered:
    """Count what rounds of so many pellets each share with items, so many pairs at a time as fit the cache.

    Parameters
    ----------
    placed : pellets, sorted by round; their origins are those of the rounds (T,)
    placement, near : (n,) pairs of them and seen tiles that may meet, sorted
    """
    origin = placed.origin_x, placed.origin_y
    if each > 1:
        placed = Placed(*placed[:3], *(column.repeat(each) for column in origin))
    edges = [0, len(placement)]
    if len(placement) > PAIRS_AT_ONCE:
        turn = placement // each
        wanted = turn[PAIRS_AT_ONCE::PAIRS_AT_ONCE]
        edges = [0, *np.unique(np.searchsorted(turn, wanted)).tolist(), len(placement)]
    kernels = kernels_of(bitrows)
    parts = [_counted(placed, windows, seen, placement[a:b], near[a:b], each, kernels) for a, b in pairwise(edges)]
    return parts[0] if len(parts) == 1 else Gathered(*map(np.concatenate, zip(*parts, strict=True)))


def _counted(
    placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, each: int, kernels: ModuleType
) -> Gathered:
    """The same of some pairs, all of a round together."""
    found: Found = kernels.found(placed, windows, seen, placement, near, NOT_BESIDE)
    rank, samples = seen.rank[found.seen], found.samples
    turn = found.placement // each
    pixels, pellets = samples, np.ones_like(samples)
    if each > 1 or (seen.rank[1:] == seen.rank[:-1]).any():
        order = kernels.row_order(turn, rank, found.seen, found.placement)
        found, rank, turn = Found(*(column[order] for column in found)), rank[order], turn[order]
        first = np.flatnonzero(begins(turn) | begins(rank))
        samples = pixels = _sums(found.samples, first)
        if each > 1:
            pellets, pixels = _distinct(placed, windows, seen, found, first, kernels)
        best = _nearest(found, first, kernels)
        found, rank, turn = Found(*(column[best] for column in found)), rank[best], turn[best]
    order = kernels.row_order(turn, found.distance2, found.y, found.x)
    columns = turn, rank, samples, pixels, pellets[: len(turn)], found.distance2, found.x, found.y
    return Gathered(*(column[order] for column in columns))


def _sums(values: Ints, first: Ints) -> Ints:
    """Sums of groups that begin at `first`."""
    return np.add.reduceat(values, first) if len(first) else np.zeros(0, np.int64)


def _nearest(found: Found, first: Ints, kernels: ModuleType) -> Ints:
    """The pair of each group whose pixel is nearest to the origin."""
    new = np.zeros(len(found.seen), np.int64)
    new[first] = 1
    group = np.cumsum(new)
    return np.asarray(kernels.row_order(group, found.distance2, found.y, found.x)[first])


def _distinct(
    placed: Placed, windows: Windows, seen: Seen, found: Found, first: Ints, kernels: ModuleType
) -> tuple[Ints, Ints]:
    """Pellets that hit, and pixels counted once, of each group; its pairs are sorted by (tile, placement)."""
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


def _may_overlap(placed: Placed, windows: Windows, placement: Ints, begin: Ints, length: Ints) -> Bools:
    """Whether boxes of pellets overlap in each group (n,), of `length` placements from `begin` on.

    Of large groups, whose pairs are many, it is taken for granted.
    """
    few = np.flatnonzero(length <= PAIRED)
    group, place = ragged(length[few])
    pair, step = ragged(length[few][group] - 1 - place)
    group, place = few[group[pair]], place[pair]
    some = placed._replace(pattern=placed.pattern[placement], x=placed.x[placement], y=placed.y[placement])
    left, top, right, low = placed_boxes(some, windows)
    a = begin[group] + place
    b = a + 1 + step
    met = (left[a] <= right[b]) & (left[b] <= right[a])
    met &= (top[a] <= low[b]) & (top[b] <= low[a])
    overlap = length > PAIRED
    overlap[group[met]] = True
    return overlap
