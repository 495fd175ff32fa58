"""Placed patterns against all that can be seen, by the cells in which they are placed.

A function from arrays to arrays; `lookup_jit` has the same one, compiled, in one pass.
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Ints
from planes.bitrows import Beside, Found, Placed, Seen, Windows, found, row_order
from planes.cells import Cells, listed_at

__all__ = ["looked_up", "merged"]


def looked_up(placed: Placed, windows: Windows, seen: Seen, cells: Cells, beside: Beside) -> Found:
    """Count what placed patterns share with what can be seen, as rows: by item, the nearest first.

    Parameters
    ----------
    cells : of the seen tiles and the box around the patterns
    beside : of the seen tiles, or empty, as `bitrows.found` takes it

    Returns
    -------
    Pairs of a placement and an item, told by the first tile of it that is hit; samples are those of all its
    tiles; sorted by (placement, distance2, y, x, tile).
    """
    placement, near = listed_at(cells, placed.x, placed.y)
    return merged(found(placed, windows, seen, placement, near, beside), seen.rank)


def merged(every: Found, rank: Ints) -> Found:
    """Pairs of placements and tiles as rows of placements and items.

    Parameters
    ----------
    every : sorted by (placement, tile)
    rank : (V,) place in the stack of the item of each tile, rising
    """
    if (rank[1:] == rank[:-1]).any():
        item = rank[every.seen]
        group = np.cumsum((np.diff(every.placement, prepend=-1) != 0) | (np.diff(item, prepend=-1) != 0))
        first = np.flatnonzero(np.diff(group, prepend=0))
        nearest = row_order(group, every.distance2, every.y, every.x)[first]
        samples = np.add.reduceat(every.samples, first) if len(first) else every.samples
        every = Found(every.placement[first], every.seen[first], samples, *(c[nearest] for c in every[3:]))
    order = row_order(every.placement, every.distance2, every.y, every.x)
    return Found(*(column[order] for column in every))
