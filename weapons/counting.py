"""What placed patterns hit, counted by bit rows, as rows of hits.

What they can hit of each object is `planes.visible`; what they cover of it is `planes.bitrows`.
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Ints
from planes.bitrows import Found, Placed
from planes.pellets import Gathered
from weapons.hits import Rows
from weapons.volley import Volley

__all__ = ["placed_of", "rows_of", "rows_of_rounds"]


def placed_of(volley: Volley) -> Placed:
    """Placements as the kernels take them; their origins are those of the rounds."""
    return Placed(volley.pattern, *volley.xy.T, *volley.turn_xy.T)


def rows_of(volley: Volley, found: Found, ids: Ints) -> Rows:
    """Rows of what each placement hit by itself.

    Parameters
    ----------
    found : a pair for each row, in the order of rows
    ids : of the item of each tile
    """
    shot, round_ = volley.turn_of(found.placement)
    rows = {
        "shot": shot, "object": ids[found.seen], "samples": found.samples, "first_xy": _joined(found.x, found.y),
        "distance2": found.distance2,
    }  # fmt: skip
    return Rows.of(rows if round_ is None else {**rows, "round": round_})


def rows_of_rounds(volley: Volley, found: Gathered, ids: Ints) -> Rows:
    """Rows of what the pellets of each round hit together.

    Parameters
    ----------
    ids : (M,) of the items of the stack
    """
    shot, round_ = volley.shot_of(found.turn)
    several = volley.pellets > 1
    return Rows(
        shot, round_, ids[found.rank], found.samples, found.pixels if several else None, None,
        found.pellets if several else None, _joined(found.x, found.y), found.distance2,
    )  # fmt: skip


def _joined(x: Ints, y: Ints) -> Ints:
    """Pixels (n, 2)."""
    xy = np.empty((len(x), 2), np.int64)
    xy[:, 0], xy[:, 1] = x, y
    return xy
