"""What an item shelters in which a way begins, once the way has left it: the rule `inside="ignore_until_exit"`.

A pixel is sheltered if the way to it leaves the item, and then meets it again:

    # o # . # -        o lies in the item; the pixel behind the gap is sheltered, but not the item up to there

`jit.bit_rows` has the compiled form of `left_and_met`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from ..common.backend import kernels_of
from ..common.checks import Floats, Ints
from ..common.limits import CHUNK_SAMPLES
from ..grid.spans import each_pixel, meets, pieces
from .bit_rows import WORD, Words
from .blockers import Blockers
from .shadows import NEVER, begun, exit_of, shadow, spells, times
from .span_walk import Runs


def hide_after_exit(
    rows: Words, corner_xy: Ints, origin_xy: Ints, blockers: Blockers, pair: Ints, blocker: Ints
) -> tuple[Ints, Ints]:
    """Clear the pixels that blockers shelter once the ways that begin in them have left them.

    Parameters are those of `hide_behind`. Returned are the other pairs, of ways that begin elsewhere.
    """
    starts = np.column_stack([origin_xy[pair], blocker])
    ways, way = np.unique(starts, axis=0, return_inverse=True)
    inside, rects, first, count = begun(ways[:, :2], blockers, ways[:, 2])
    order, corner = np.argsort(way, kind="stable"), corner_xy - origin_xy
    begin, end = (way[order].searchsorted(inside, side=side).tolist() for side in ("left", "right"))
    for k, number in enumerate(count.tolist()):
        own = pair[order[begin[k] : end[k]]]
        for part in pieces(np.full(len(own), rows.shape[1] * WORD), CHUNK_SAMPLES):
            _clear_after_exit(rows, corner, own[part], rects[first[k] : first[k] + number])
    others = (~np.isin(way, inside)).nonzero()[0]
    return pair[others], blocker[others]


def _clear_after_exit(rows: Words, corner: Ints, own: Ints, rects: Ints) -> None:
    """Clear the pixels of rows `own` that an item, in which pixel (0, 0) lies, shelters once the way has left it.

    Parameters
    ----------
    corner : (n, 2) pixel of bit 0 of the first row, from (0, 0)
    """
    row, bit, column = _pixels_of(rows[own])
    x, y = np.stack([column, bit]) + corner[own[row]].T
    hidden = behind_exit(rects, x, y)
    np.bitwise_and.at(rows, (own[row[hidden]], bit[hidden]), ~(np.uint64(1) << column[hidden].astype(np.uint64)))


def _met_after_exit(rects: Ints, x: Ints, y: Ints) -> Ints:
    """`behind_exit` of few pixels, of which each is compared with each rectangle."""
    again = kernels_of(sys.modules[__name__]).left_and_met(rects, x, y)
    found = [again[:0]]
    for part in _parts(len(again), rects):
        now = again[part]
        found.append(now[times(rects[:, None], x[now], y[now], True)[0].any(axis=0)])
    return np.concatenate(found)


def _parts(n: int, rects: Ints) -> Iterator[slice]:
    """Parts of n ways, each of which is compared with all rectangles at a time."""
    step = max(CHUNK_SAMPLES // len(rects), 1)
    return (slice(begin, begin + step) for begin in range(0, n, step))


def _pixels_of(rows: Words) -> tuple[Ints, Ints, Ints]:
    """Set bits of words (n, height), as (number, row, column)."""
    octets = np.ascontiguousarray(rows, "<u8").view(np.uint8)
    number, row, column = np.unpackbits(octets, axis=1, bitorder="little").reshape(*rows.shape, WORD).nonzero()
    return number, row, column


def left_and_met(rects: Ints, x: Ints, y: Ints) -> Ints:
    """Pixels (s,) on the way to which from pixel (0, 0) an item is left and met again.

    The rectangles (m, 4) of an item, of which one holds pixel (0, 0), share no pixel, so the parts of the way in them
    do not overlap. If they are shorter in sum than the way up to the last exit, there is a gap.
    """
    found = [np.zeros(0, np.int64)]
    for part in _parts(len(x), rects):
        entry, leave = spells(rects[:, None], x[part], y[part])
        inside = np.maximum(leave - entry, 0).sum(axis=0)
        found.append(part.start + np.flatnonzero(inside < np.where(entry <= leave, leave, 0).max(axis=0)))
    return np.concatenate(found)


def hidden_after_exit(
    runs: Runs, placement: int, pair: int, origin_xy: Ints, rects: Ints
) -> Iterator[tuple[Ints, Ints, Ints, Ints]]:
    """Pixels of runs of a placement that a blocker shelters once the way has left it: (pair, run, x_first, x_last)."""
    own, (left, top) = (runs.placement == placement).nonzero()[0], origin_xy.tolist()
    for piece in pieces(runs.lengths[own], CHUNK_SAMPLES):
        run, column = each_pixel(runs.x_first[own[piece]], runs.x_last[own[piece]])
        run = own[piece][run]
        hidden = behind_exit(rects, column - left, runs.y[run] - top)
        yield np.full(len(hidden), pair), run[hidden], column[hidden], column[hidden]


def behind_exit(rects: Ints, x: Ints, y: Ints) -> Ints:
    """Pixels (s,) that an item (m, 4), which holds pixel (0, 0), shelters once the way to them has left it; rising.

    All ways between the directions of two corners that follow each other meet the same rectangles, in the same order.
    So one way of each such sector tells whether the item is met again, and by which rectangle first; what the others
    hide there lies behind it. Ways through a corner may touch others; pixels in these directions are looked at one by
    one.
    """
    low_xy, high_xy = (np.array([side(v, initial=0) for v in (x, y)]) for side in (np.min, np.max))
    rects = rects[meets(rects, np.concatenate([low_xy, high_xy]))]  # no way goes beyond this box
    if len(x) <= 4 * len(rects):  # no more than there are corners
        return _met_after_exit(rects, x, y)
    sides = 2 * rects + np.array([-1, -1, 1, 1])  # in halves of a pixel
    corners = np.concatenate([sides[:, which] for which in ([0, 1], [2, 1], [2, 3], [0, 3])])
    directions, first = np.unique(_direction(*corners.T), return_index=True)
    corners, n = corners[first], len(first)
    ways = np.concatenate([corners + np.roll(corners, 1, axis=0), corners])  # less than half a turn lies between two
    ways *= (np.abs(sides).max() // np.abs(ways).max(axis=1) + 1)[:, None]  # to beyond the item
    again = np.zeros(2 * n, np.bool_)
    again[kernels_of(sys.modules[__name__]).left_and_met(rects, *ways.T)] = True
    if not again.any():
        return np.zeros(0, np.int64)
    own = _direction(x, y)
    after = directions.searchsorted(own, side="right")
    through, after = directions[after - 1] == own, after % n
    one_by_one = (through & again[n + (after - 1) % n]).nonzero()[0]
    found = [one_by_one[_met_after_exit(rects, x[one_by_one], y[one_by_one])]]
    maybe = (~through & again[after]).nonzero()[0]
    sectors, sector = np.unique(after[maybe], return_inverse=True)
    rect = _next_after_exit(rects, ways[sectors])[sector]
    low, high, bare_low, bare_high = shadow(rects[rect], y[maybe])
    hidden = (low <= x[maybe]) & (x[maybe] <= high) & ~((bare_low <= x[maybe]) & (x[maybe] <= bare_high))
    found.append(maybe[hidden])
    return np.sort(np.concatenate(found))


def _direction(x: Ints, y: Ints) -> Floats:
    """Numbers that rise with the angle of vectors, from -1 to 3; those of different directions are different.

    They are quotients of whole numbers below 2**22, of which different ones are different as floats, too.
    """
    slope = y / np.maximum(np.abs(x) + np.abs(y), 1)
    return np.asarray(np.where(x < 0, 2 - slope, slope))


def _next_after_exit(rects: Ints, ways: Ints) -> Ints:
    """Rectangle of an item that ways (n, 2) from pixel (0, 0) to pixels beyond it meet first once they have left it."""
    found = [np.zeros(0, np.int64)]
    for part in _parts(len(ways), rects):
        entry, leave = spells(rects[:, None], *ways[part].T)
        met = entry <= leave
        entry = np.where(met, entry, NEVER)
        entry[entry <= exit_of(entry, np.where(met, leave, -1))] = NEVER
        found.append(entry.argmin(axis=0))
    return np.concatenate(found)
