"""Turns of masks: by quarter turns, and to many directions at once, by the edges of rectangles that cover the mask."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Ints
from ..common.limits import HALF, SUB, TRIG_BITS
from .fixed_point import pixel
from .rasterize import runs_between
from .spans import RowRuns, each_pixel, in_rows, ragged, rectangles


def quarter_turned(array: npt.NDArray[Any], x: int, y: int, turns: int) -> tuple[npt.NDArray[Any], int, int]:
    """A view of an array (h, w, ...) and its pivot (x, y), turned by quarter turns.

    `numpy.rot90` takes five times as long for the same view.
    """
    for _ in range(turns):
        x, y = SUB * (len(array) - 1) - y, x
        array = array.swapaxes(0, 1)[:, ::-1]
    return array, x, y


class Edges(NamedTuple):
    """Rectangles that cover a mask in each of its four quarter turns, relative to its pivot."""

    begin: Ints  # (5,) first rectangle of each turn, and their number
    sides: Ints  # (4, k) left, right, top and low, 1/256 px
    pivots: Ints  # (4, 2) of each turn, from the centre of the pixel that holds it, 1/256 px


def edges_of(mask: Bools, pivot_256: tuple[int, int]) -> Edges:
    """Edges of a mask: a rectangle for all runs of equal columns in rows that follow each other."""
    sides, pivots = [], []
    for turns in range(4):
        source, *pivot = quarter_turned(mask, *pivot_256, turns)
        left, top, right, low = rectangles(np.asarray(source)).T
        edges = np.stack([left, right + 1, top, low + 1])
        sides.append(SUB * edges - HALF - np.repeat(pivot, 2)[:, None])
        pivots.append(pivot + SUB * pixel(-np.array(pivot)))
    return Edges(np.cumsum([0, *(part.shape[1] for part in sides)]), np.concatenate(sides, axis=1), np.array(pivots))


def turned_runs(edges: Edges, quarter: Ints, c: Ints, s: Ints) -> RowRuns:
    """Runs of a mask that is turned to n directions, as `variants_of` turns it, from the pixel of its pivot.

    A pixel is set if its centre, turned back, lies in one of the closed rectangles: between its ends,
    `left <= dx c + dy s <= right`, and between its sides, `top <= dy c - dx s <= low`. Rounded directions
    are not of length 1, so that corners are up to 1/256 px beyond the rows to which they turn.

    Parameters
    ----------
    quarter, c, s : (n,) directions, as `quarters` splits them
    """
    aim, place = ragged(np.diff(edges.begin)[quarter])
    left, right, top, low = edges.sides[:, edges.begin[quarter][aim] + place]
    c, s, pivot = c[aim], s[aim], edges.pivots[quarter][aim]
    ends = left * s, right * s
    first_row = (np.minimum(*ends) + top * c >> TRIG_BITS) + pivot[:, 1] - 1 >> 8
    last_row = (np.maximum(*ends) + low * c >> TRIG_BITS) + pivot[:, 1] + 1 >> 8
    run, row = each_pixel(first_row, last_row)
    c, s, (x, y) = c[run], s[run], pivot[run].T
    down = SUB * row - y
    across = [(side[run] << TRIG_BITS) - down * s + x * c for side in (left, right)]
    along = [down * c - (side[run] << TRIG_BITS) + x * s for side in (low, top)]
    (first, last), (begin, end) = runs_between(across[0], across[1], c), runs_between(along[0], along[1], s)
    return in_rows(aim[run], row, np.maximum(first, begin), np.minimum(last, end))
