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
from ..grid.spans import begins, each_pixel, pieces, sorted_once
from .bit_rows import WORD, Words
from .blockers import Blockers
from .shadows import NEVER, begun, exit_of, shadow, spells, times
from .span_walk import Runs

NO_RECT = np.array([[1, 1, -1, -1]])
"""A rectangle without a pixel, which no way meets."""


def hide_after_exit(
    rows: Words, corner_xy: Ints, origin_xy: Ints, blockers: Blockers, pair: Ints, blocker: Ints
) -> tuple[Ints, Ints]:
    """Clear the pixels that blockers shelter once the ways that begin in them have left them.

    Parameters are those of `hide_behind`. Returned are the other pairs, of ways that begin elsewhere.
    """
    inside, rects, first, count = begun(origin_xy[pair], blockers, blocker)
    own, about = pair[inside], np.ceil(np.log2(count)).astype(np.int64)
    for size in sorted_once(about).tolist():  # blockers of about as many rectangles are looked at together
        alike = np.flatnonzero(about == size)
        for part in pieces(np.full(len(alike), rows.shape[1] * WORD), CHUNK_SAMPLES):
            now = alike[part]
            _clear_after_exit(rows, corner_xy - origin_xy, own[now], rects, first[now], count[now])
    return np.delete(pair, inside), np.delete(blocker, inside)


def _clear_after_exit(rows: Words, corner_xy: Ints, own: Ints, rects: Ints, first: Ints, count: Ints) -> None:
    """Clear the pixels of rows `own` that a blocker of each shelters once the way from (0, 0) has left it.

    Parameters
    ----------
    corner_xy : (n, 2) pixel of bit 0 of the first row
    first, count : (k,) the rectangles of the blockers
    """
    pair, bit, column = _pixels_of(rows[own])
    x, y = np.stack([column, bit]) + corner_xy[own[pair]].T
    place, every = np.arange(count.max()), np.append(rects, NO_RECT, axis=0)
    step = max(CHUNK_SAMPLES // len(place), 1)
    for begin in range(0, len(pair), step):
        now = slice(begin, begin + step)
        new = begins(pair[now])
        here, which = pair[now][new], np.cumsum(new) - 1
        of_pair = every[np.where(place < count[here, None], first[here, None] + place, -1)]
        hidden = _met_after_exit(of_pair, which, x[now], y[now]) + begin
        pixels = ~(np.uint64(1) << column[hidden].astype(np.uint64))
        np.bitwise_and.at(rows, (own[pair[hidden]], bit[hidden]), pixels)


def _met_after_exit(rects: Ints, item: Ints, x: Ints, y: Ints) -> Ints:
    """Pixels (s,) that an item, in which the way to them begins, shelters once the way has left it.

    Parameters are those of `left_and_met`.
    """
    again = kernels_of(sys.modules[__name__]).left_and_met(rects, item, x, y)
    hidden = times(rects[item[again]].swapaxes(0, 1), x[again], y[again], True)[0].any(axis=0)
    return np.asarray(again[hidden])


def _pixels_of(rows: Words) -> tuple[Ints, Ints, Ints]:
    """Set bits of words (n, height), as (number, row, column)."""
    octets = np.ascontiguousarray(rows, "<u8").view(np.uint8)
    number, row, column = np.unpackbits(octets, axis=1, bitorder="little").reshape(*rows.shape, WORD).nonzero()
    return number, row, column


def left_and_met(rects: Ints, item: Ints, x: Ints, y: Ints) -> Ints:
    """Pixels (s,) on the way to which from pixel (0, 0) an item is left and met again.

    The rectangles of an item share no pixel, so the parts of the way in them do not overlap. If they are shorter in sum
    than the way up to the last exit, there is a gap.

    Parameters
    ----------
    rects : (B, m, 4) of each item, of which one holds pixel (0, 0)
    item : (s,) item of each pixel
    """
    of_pixel = rects if len(rects) == 1 else rects[item]
    entry, leave = spells(of_pixel, x[:, None], y[:, None])
    inside = np.maximum(leave - entry, 0).sum(axis=1)
    return np.flatnonzero(inside < np.where(entry <= leave, leave, 0).max(axis=1))


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
    """Pixels (s,) that an item (m, 4), which holds pixel (0, 0), shelters once the way to them has left it.

    All ways between the directions of two corners that follow each other meet the same rectangles, in the same order.
    So one way of each such sector tells which rectangle is met first after the exit, and what the others hide there
    lies behind it. Ways through a corner may touch others; pixels in these directions are looked at one by one.
    """
    sides = 2 * rects + np.array([-1, -1, 1, 1])  # in halves of a pixel
    corners = np.concatenate([sides[:, which] for which in ([0, 1], [2, 1], [2, 3], [0, 3])])
    directions, first = np.unique(_direction(*corners.T), return_index=True)
    corners, own = corners[first], _direction(x, y)
    after = directions.searchsorted(own, side="right")
    through = (directions[after - 1] == own).nonzero()[0]
    sectors, sector = np.unique(after, return_inverse=True)
    ways = corners[sectors - 1] + corners[sectors % len(corners)]  # less than half a turn lies between the two
    ways *= (np.abs(sides).max() // np.abs(ways).max(axis=1) + 1)[:, None]  # to beyond the item
    step = max(CHUNK_SAMPLES // len(rects), 1)
    found = [_next_after_exit(rects, *ways[begin : begin + step].T) for begin in range(0, len(ways), step)]
    rect = np.concatenate(found)[sector]
    low, high, bare_low, bare_high = shadow(rects[rect], y)
    hidden = (rect >= 0) & (low <= x) & (x <= high) & ~((bare_low <= x) & (x <= bare_high))
    hidden[through] = False
    for begin in range(0, len(through), step):
        now = through[begin : begin + step]
        hidden[now[_met_after_exit(rects[None], np.zeros_like(now), x[now], y[now])]] = True
    return hidden.nonzero()[0]


def _direction(x: Ints, y: Ints) -> Floats:
    """Numbers that rise with the angle of vectors, from -1 to 3; those of different directions are different.

    They are quotients of whole numbers below 2**22, of which different ones are different as floats, too.
    """
    slope = y / np.maximum(np.abs(x) + np.abs(y), 1)
    return np.asarray(np.where(x < 0, 2 - slope, slope))


def _next_after_exit(rects: Ints, x: Ints, y: Ints) -> Ints:
    """Rectangle of an item that ways (n,) from pixel (0, 0) to a pixel beyond it meet once they have left it; or -1."""
    entry, leave = spells(rects[:, None], x, y)
    met = entry <= leave
    entry = np.where(met, entry, NEVER)
    entry[entry <= exit_of(entry, np.where(met, leave, -1))] = NEVER
    rect = entry.argmin(axis=0)
    return np.where(entry[rect, np.arange(len(rect))] < NEVER, rect, -1)
