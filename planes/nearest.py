"""The pixel that is nearest to an origin, of those that bit rows have."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from planes.arrays import Ints
from planes.bits import WORD, Seen, Words, rows_of
from planes.spans import begins

__all__ = ["BESIDE_REACH", "NOWHERE", "Beside", "beside_of", "nearest", "nearest_seen"]

Beside = npt.NDArray[np.uint8]

BESIDE_REACH = 113
"""Radius of the largest disc whose nearest pixel is told by distances along rows, px.

The squares of what lies beyond it, twice as far to the side, add up within uint16.
"""

NOWHERE = BESIDE_REACH + 1
"""Instead of the distance along a row that has no pixel, and of one up or down that is farther: it loses."""

_ONE = np.uint64(1)
_PLACES = _ONE << np.arange(WORD, dtype=np.uint64)
_ROW_BITS = 6
"""Of the row of a tile, in a number that sorts as (squared distance, row)."""


def nearest(met: Words, left: Ints, top: Ints) -> tuple[Ints, Ints, Ints]:
    """Pixel of each set (n, height), none empty, that is nearest to the origin; of those as near the least (y, x).

    Parameters
    ----------
    left, top : (n,) where column 0 and row 0 lie, about the origin

    Returns
    -------
    squared distance, x, y, about the origin
    """
    column = np.minimum(np.maximum(-left, 0), WORD - 1)  # the nearest to the origin
    away = left + column
    across = np.abs(away)
    place = (met != 0).reshape(-1).nonzero()[0]  # of some 40 rows few have a pixel
    pair = place // met.shape[1]
    row = place - pair * met.shape[1]
    key = _steps(met.reshape(-1).take(place), column.take(pair))
    key += across.take(pair)
    key *= key
    down = top.take(pair)
    down += row
    down *= down
    key += down
    key <<= _ROW_BITS
    key |= row
    key = np.minimum.reduceat(key, begins(pair).nonzero()[0])
    row, distance2 = key & (WORD - 1), key >> _ROW_BITS
    down = row + top
    step = np.sqrt((distance2 - down * down).astype(np.float64)).astype(np.int64)  # of a square that a float holds
    step -= across
    return distance2, away + _aside(met[np.arange(len(met)), row], column, step), down


def _steps(words: Words, column: Ints) -> Ints:
    """Distances (n,) from columns of words, none 0, to their nearest pixels."""
    own = column.view(np.uint64)
    after = words >> own
    below = after - _ONE
    np.invert(after, out=after)
    after &= below
    before = words << (np.uint64(WORD - 1) - own)
    np.right_shift(before, _ONE, out=below)
    np.invert(below, out=below)
    before &= below
    # The exponent of a float is the place of the highest bit, once no bit below it can round it up.
    exponent = before.astype(np.float64).view(np.int64)
    exponent >>= 52
    np.subtract(1023 + WORD - 1, exponent, out=exponent)
    np.minimum(exponent, np.bitwise_count(after), out=exponent)
    return exponent


def beside_of(seen: Seen) -> Beside:
    """Distance (V, 64, height) from each pixel of a tile to the nearest visible one of its row, NOWHERE if none is."""
    rows = rows_of(seen.words, seen.height, seen.begin)
    made = np.empty((len(seen.rank), WORD, seen.height), np.uint8)
    for columns in (range(WORD), range(WORD - 1, -1, -1)):
        last = np.full((len(seen.rank), seen.height), NOWHERE, np.uint8)
        for column in columns:
            last += last != NOWHERE
            last[(rows & _PLACES[column]) != 0] = 0
            if columns.step > 0:
                made[:, column] = last
            else:
                np.minimum(made[:, column], last, out=made[:, column])
    return made


def nearest_seen(seen: Seen, beside: Beside, near: Ints, left: Ints, top: Ints) -> tuple[Ints, Ints, Ints]:
    """Like `nearest`, of all visible pixels of tiles: a disc up to BESIDE_REACH that hits any hits the nearest."""
    column = np.minimum(np.maximum(-left, 0), WORD - 1)
    away = left + column
    across = beside.reshape(-1, seen.height).take(near * WORD + column, axis=0)
    up = -min(int(np.minimum.reduce(top, initial=0)), 0)
    down = np.abs(np.arange(-up, max(int(np.maximum.reduce(top, initial=0)), 0) + seen.height))
    squares = (np.minimum(down, NOWHERE) ** 2).astype(np.uint16)
    distance2 = across + np.abs(away).astype(np.uint16)[:, None]
    distance2 *= distance2
    distance2 += rows_of(squares, seen.height, top + up)
    row = distance2.argmin(axis=1)
    every = np.arange(len(near))
    step = across[every, row].astype(np.int64)
    across_x = away + _aside(seen.words[seen.begin[near] + row], column, step)
    return distance2[every, row].astype(np.int64), across_x, row + top


def _aside(words: Words, column: Ints, step: Ints) -> Ints:
    """Where the nearest pixels of words lie, `step` from columns (n,): before these if there is one, else after."""
    before = (words >> (column - step).view(np.uint64)) & _ONE
    return np.where(before, -step, step)
