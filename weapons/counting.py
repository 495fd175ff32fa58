"""What placed patterns hit, counted by bit rows, as rows.

What they can hit of each object is `planes.visible`; what they cover of it is `planes.bitrows`.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from planes.arrays import Ints
from planes.bitrows import WORD, Beside, Found, Placed, Seen, Windows
from planes.spans import ragged
from weapons.hits import Rows
from weapons.volley import Volley

__all__ = ["NOT_BESIDE", "counted", "placed_of", "rows_of"]

NOT_BESIDE: Beside = np.zeros((0, WORD, 0), np.uint8)
"""No distances along rows: the nearest pixel is looked for in what is hit."""


def placed_of(volley: Volley) -> Placed:
    """Placements as the kernels take them."""
    x, y = volley.xy[:, 0], volley.xy[:, 1]
    if not volley.scattered:
        return Placed(volley.pattern, x, y, x, y)
    return Placed(volley.pattern, x, y, *volley.origin_xy.T)


def rows_of(volley: Volley, found: Found, ids: Ints) -> Rows:
    """Rows of what each placement hit by itself.

    Parameters
    ----------
    found : a pair for each row, in the order of rows
    ids : of the item of each tile
    """
    shot, round_ = volley.turn_of(found.placement)
    first_xy = np.empty((len(found.x), 2), np.int64)
    first_xy[:, 0], first_xy[:, 1] = found.x, found.y
    rows = {
        "shot": shot, "object": ids[found.seen], "samples": found.samples, "first_xy": first_xy,
        "distance2": found.distance2,
    }  # fmt: skip
    return Rows.of(rows if round_ is None else {**rows, "round": round_})


def counted(
    volley: Volley,
    windows: Windows,
    placement: Ints,
    near: Ints,
    seen: Seen,
    ids: Ints,
    kernels: ModuleType,
) -> Rows:
    """Rows of what placements hit of the tiles near them.

    Parameters
    ----------
    placement, near : (n,) pairs of placements and seen tiles that may meet, sorted
    ids : (M,) of the items of the stack
    kernels : `planes.bitrows` or its twin
    """
    placed = placed_of(volley)
    found: Found = kernels.found(placed, windows, seen, placement, near, NOT_BESIDE)
    rank, samples = seen.rank[found.seen], found.samples
    turn = found.placement // volley.pellets
    pixels, pellets = samples, np.ones_like(samples)
    if volley.scattered or not _rising(seen.rank):
        order = kernels.row_order(turn, rank, found.seen, found.placement)
        found, rank, turn = Found(*(column[order] for column in found)), rank[order], turn[order]
        first = np.flatnonzero((np.diff(turn, prepend=-1) != 0) | (np.diff(rank, prepend=-1) != 0))
        samples = pixels = _sums(found.samples, first)
        if volley.scattered:
            pellets, pixels = _distinct(placed, windows, seen, found, first, kernels)
        best = _nearest(found, first, kernels)
        found, rank, turn = Found(*(column[best] for column in found)), rank[best], turn[best]
        pellets = pellets[: len(best)]
    order = kernels.row_order(turn, found.distance2, found.y, found.x)
    placement, samples = found.placement[order], samples[order]
    return Rows(
        *volley.turn_of(placement), ids[rank[order]], samples, pixels[order] if volley.scattered else None, None,
        pellets[order], np.stack([found.x[order], found.y[order]], axis=1), found.distance2[order],
    )  # fmt: skip


def _sums(values: Ints, first: Ints) -> Ints:
    """Sums of groups that begin at `first`."""
    return np.add.reduceat(values, first) if len(first) else np.zeros(0, np.int64)


def _nearest(found: Found, first: Ints, kernels: ModuleType) -> Ints:
    """The pair of each group whose pixel is nearest to the origin."""
    begins = np.zeros(len(found.seen), np.int64)
    begins[first] = 1
    group = np.cumsum(begins)
    return np.asarray(kernels.row_order(group, found.distance2, found.y, found.x)[first])


def _distinct(
    placed: Placed, windows: Windows, seen: Seen, found: Found, first: Ints, kernels: ModuleType
) -> tuple[Ints, Ints]:
    """Pellets that hit, and pixels counted once, of each group; its pairs are sorted by (tile, placement)."""
    begins = np.diff(found.seen, prepend=-1) != 0
    begins[first] = True
    tile = np.flatnonzero(begins)
    together = _sums(found.samples, tile)
    several = np.flatnonzero(np.diff(tile, append=len(begins)) > 1)
    if len(several):
        length = np.diff(tile, append=len(begins))[several]
        group, place = ragged(length)
        pair = tile[several][group] + place
        first_of = np.cumsum(length) - length
        together[several] = kernels.union(placed, windows, seen, found.placement[pair], found.seen[pair], first_of)
    group = np.searchsorted(first, np.arange(len(begins)), side="right") - 1
    order = kernels.row_order(group, found.placement, group, group)
    new = np.diff(found.placement[order], prepend=-1) != 0
    new[first] = True
    return _sums(new.astype(np.int64), first), _sums(together, np.searchsorted(tile, first))


def _rising(rank: Ints) -> bool:
    """Whether no item has two tiles."""
    return not (rank[1:] == rank[:-1]).any()
