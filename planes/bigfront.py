"""What a few placed patterns hit of the tiles of a stack where they lie, front to back, in Python's own integers.

`fronttoback` tells the same with arrays. For a few placements one call of numpy there takes as long as it takes here to
see what a pattern and a tile share: a shift and an `&` of two integers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from planes.arrays import Ints
from planes.bigrows import BigPattern, stride_of
from planes.bitrows import Placed
from planes.spans import Box
from planes.stack import Stack
from planes.tiles import Tiles

__all__ = ["Ground", "Hit", "hit_by_few", "hit_by_one", "pays"]

PAIR_NS, BIT_NS = 3000.0, 0.16
"""What a tile near a placement takes, of which a part is hit, and more for each bit of the pattern's rows."""

ARRAYS_NS = 350_000.0
"""What arrays take for a few placements: with more than that, they are as fast."""

Hit = tuple[int, int, int, int, int, int]
"""A placement; the squared distance, y and x of the nearest pixel; the rank of the item; and how many pixels."""

Pair = tuple[int, int, int, int, int, bool]
"""A placement, and a tile near it: its corner, px, its first row in the atlas, the rank of its item, and whether that
only blocks."""


class Ground(NamedTuple):
    """What patterns are placed on.

    Parameters
    ----------
    stack : the items
    tiles, boxes_xyxy : theirs, and where they lie (T, 4)
    pierce : whether objects let through; occluders do not
    bounds : beyond them nothing is hit
    """

    stack: Stack
    tiles: Tiles
    boxes_xyxy: Ints
    pierce: bool
    bounds: Box | None


def pays(pairs: int, wide: int, high: int) -> bool:
    """Whether integers are faster than arrays, for pairs of a pattern (columns, rows) and a tile near it."""
    return pairs * (PAIR_NS + BIT_NS * stride_of(wide) * high) <= ARRAYS_NS


def hit_by_few(placed: Placed, patterns: Sequence[BigPattern], near: tuple[Ints, Ints], ground: Ground) -> list[Hit]:
    """What placed patterns hit, in the order of rows.

    Parameters
    ----------
    placed : distances are counted from the pixels that patterns are placed on
    patterns : the distinct ones
    near : pairs (n,) of a placement and a tile that it does not refuse and may meet, sorted
    """
    hits: list[Hit] = []
    for who, close in groupby(_near(*near, ground), itemgetter(0)):
        pattern, x, y = patterns[placed.pattern.item(who)], placed.x.item(who), placed.y.item(who)
        hits += _hit_by(pattern, x, y, close, ground)
    return _in_order(hits, ground)


def hit_by_one(pattern: BigPattern, x: int, y: int, near: tuple[Ints, Ints], ground: Ground) -> list[Hit]:
    """The same of one pattern on a pixel."""
    return _in_order(list(_hit_by(pattern, x, y, _near(*near, ground), ground)), ground)


def _near(placement: Ints, tile: Ints, ground: Ground) -> Iterator[Pair]:
    """Pairs of placements and tiles, with what is told of these."""
    if not len(tile):
        return iter(())
    rank, box = ground.tiles.rank[tile], ground.boxes_xyxy[tile]
    blocks = ground.stack.occluder[rank] if ground.stack.has_occluders else np.zeros(len(rank), np.bool_)
    columns = placement, box[:, 0], box[:, 1], ground.tiles.begin[tile], rank, blocks
    return zip(*(column.tolist() for column in columns), strict=True)


def _hit_by(pattern: BigPattern, x: int, y: int, near: Iterator[Pair], ground: Ground) -> Iterator[Hit]:
    """What one placed pattern hits of each tile, front to back."""
    _, tiles, _, pierce, bounds = ground
    rest = pattern.rows if bounds is None else pattern.within(x, y, bounds)
    stride, known, nearest = pattern.stride, tiles.big(pattern.stride), pattern.depths.nearest
    corner = (y + pattern.y) * stride + x + pattern.x
    for who, left, top, begin, rank, blocks in near:
        rows = known.get(begin)
        if rows is None:
            rows = known.read(tiles.words, begin)
        shift = top * stride + left - corner
        hit = (rows << shift if shift >= 0 else rows >> -shift) & rest
        if hit:
            if not blocks:
                distance2, down, right = nearest(hit)
                yield who, distance2, y + down, x + right, rank, hit.bit_count()
            if blocks or not pierce:
                rest ^= hit
                if not rest:
                    return


def _in_order(hits: list[Hit], ground: Ground) -> list[Hit]:
    """Rows, of what is hit of tiles."""
    if not ground.tiles.whole:
        every: dict[tuple[int, int], Hit] = {}
        for hit in hits:
            of = hit[0], hit[4]
            other = every.get(of)
            every[of] = hit if other is None else (*min(hit[:5], other[:5]), hit[5] + other[5])
        hits = list(every.values())
    return sorted(hits)
