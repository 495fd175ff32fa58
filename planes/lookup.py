"""Placed patterns against all that can be seen, by the cells in which they are placed.

Functions from arrays to arrays; `lookup_jit` has the same ones, compiled, in one pass.
"""

from __future__ import annotations

from planes.bitrows import Found, Placed, Windows, found
from planes.bits import Seen
from planes.cells import Cells, listed_at
from planes.itemrows import item_rows
from planes.nearest import Beside
from planes.pellets import Gathered, gathered

__all__ = ["gathered_up", "looked_up"]


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
    return item_rows(found(placed, windows, seen, placement, near, beside), placed, seen.rank)


def gathered_up(placed: Placed, windows: Windows, seen: Seen, cells: Cells, each: int) -> Gathered:
    """Count what rounds of so many pellets each share with what can be seen; see `pellets.gathered`.

    Parameters
    ----------
    cells : of the seen tiles and the box around the patterns
    """
    placement, near = listed_at(cells, placed.x, placed.y)
    return gathered(placed, windows, seen, placement, near, each)
