"""Kernels on bit rows: what two sets of pixels share is `&` of their words, its size their population count.

Every function is from arrays to arrays; `bitrows_jit` has the same ones, compiled.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from planes.arrays import Ints
from planes.bits import PAD, WORD, Seen, Words, every_stretch, rows_at, rows_of
from planes.nearest import Beside, nearest, nearest_seen
from planes.spans import Box
from planes.strips import meets_strip

__all__ = [
    "Found", "Placed", "Windows", "crossing", "cut_off", "found", "placed_boxes", "row_order", "union", "visible",
    "which", "windows_at",
]  # fmt: skip

WORDS_AT_ONCE = 2**17
"""Words of pairs worked on at a time: a megabyte; with fewer the calls weigh more, with more the caches overflow."""

PAIRS_AT_ONCE = 2**16
"""Pairs whose boxes are compared at a time: 512 KB a column; of those that meet, so many as have enough words."""

_ONE, _FULL = np.uint64(1), np.uint64(2**64 - 1)
_BYTES = np.uint64(0x00FF00FF00FF00FF)
_SUM = np.uint64(0x0001000100010001)


class Windows(NamedTuple):
    """The windows of 64 columns of patterns, as columns by pattern.

    A pattern's rows are kept as columns of words, so that the window of many rows at one column is one stretch of
    memory, or two neighbouring ones and a shift.

    Parameters
    ----------
    box_xyxy : (n, 4) boxes of the patterns about the pixel that they are placed on
    first : (n,) the word of each pattern's box corner, at its first column of words
    rows : (n,) words from one column of words to the next
    words : flat
    shifted : words from the window at one column to that at the next; 0 if not all 64 shifts of each word are made
    strips : (n, 4) of the patterns, see `planes.strips`; (0, 4) where boxes tell as much
    """

    box_xyxy: Ints
    first: Ints
    rows: Ints
    words: Words
    shifted: int
    strips: Ints


class Placed(NamedTuple):
    """Placed patterns: which (n,), on which pixel, and the pixel from which distances are counted."""

    pattern: Ints
    x: Ints
    y: Ints
    origin_x: Ints
    origin_y: Ints


class Meeting(NamedTuple):
    """Pairs (n,) of a placement and a tile that may share pixels; `left`, `top` are its corner about the placement."""

    placement: Ints
    tile: Ints
    left: Ints
    top: Ints


class Found(NamedTuple):
    """Pairs (n,) of a placement and a seen tile that share pixels, sorted; how many, and the nearest to the origin.

    Of pixels as near as the nearest it is the first by (y, x); where it lies in the world.
    """

    placement: Ints
    seen: Ints
    samples: Ints
    distance2: Ints
    x: Ints
    y: Ints


def visible(words: Words, height: int, begin: Ints, of: Ints, front: Ints, right: Ints) -> Words:
    """Pixels (n, height) of tiles on which no other lies.

    Parameters
    ----------
    words : flat rows of all tiles
    begin : (n,) first row of each
    of : (m,) which of them is covered by another, sorted
    front : (m,) the row of the other that lies on its first row
    right : (m,) columns by which the other lies to its right, -63 .. 63
    """
    seen = rows_of(words, height, begin)
    every = every_stretch(words, height)
    step = np.arange(len(of)) - np.searchsorted(of, of)
    at_once = WORDS_AT_ONCE // height
    by_step = np.argsort(step, kind="stable")
    ends = np.searchsorted(step[by_step], np.arange(int(step.max(initial=-1)) + 2)).tolist()
    for first, last in pairwise(ends):
        for at in range(first, last, at_once):
            now = by_step[at : min(at + at_once, last)]
            cover = rows_at(every, front[now], height, words.dtype)
            cover <<= np.maximum(right[now], 0).astype(np.uint64)[:, None]
            cover >>= np.maximum(-right[now], 0).astype(np.uint64)[:, None]
            seen[of[now]] &= ~cover
    return seen


def cut_off(rows: Words, left: Ints, top: Ints, bounds: Box) -> None:
    """Take away of pixels (n, height) what lies beyond the bounds; column 0 and row 0 lie at `left` and `top` (n,)."""
    x, y, x_max, y_max = bounds
    height = rows.shape[1]
    over = (left < x) | (left > x_max - WORD + 1)
    over |= (top < y) | (top > y_max - height + 1)
    at = over.nonzero()[0]
    if not len(at):
        return
    left, row = left[at], top[at][:, None] + np.arange(height)
    first, last = (np.maximum(far, 0).view(np.uint64) for far in (x - left, left + (WORD - 1 - x_max)))
    inside = (row >= y) & (row <= y_max)
    rows[at] &= ((_FULL << first) & (_FULL >> last))[:, None] * inside


def found(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, beside: Beside) -> Found:
    """Count what placed patterns and seen tiles share.

    Parameters
    ----------
    placement, near : (n,) pairs of them that may meet, sorted
    beside : of the seen tiles, if each pattern holds all pixels that are nearer to its origin than one of its own; or
        empty
    """
    height = _rows_counted(windows, seen)
    step = WORDS_AT_ONCE // height
    tiles = seen.box_xyxy.T.copy()
    parts = [Found(*[np.zeros(0, np.int64)] * 6)]
    for first in range(0, len(near), PAIRS_AT_ONCE):
        now = slice(first, first + PAIRS_AT_ONCE)
        met = _meeting(placed, windows, tiles, placement[now], near[now])
        parts += [
            _counted(placed, windows, seen, Meeting(*[column[i : i + step] for column in met]), height, beside)
            for i in range(0, len(met.tile), step)
        ]
    return Found(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _meeting(placed: Placed, windows: Windows, tiles: Ints, placement: Ints, near: Ints) -> Meeting:
    """Those of pairs (n,) whose boxes share a pixel, and that are not beyond the strips of their patterns.

    Parameters
    ----------
    tiles : (4, V) sides of the boxes of tiles
    """
    box = windows.box_xyxy.T
    corner: list[Ints] = []
    for axis, place in ((0, placed.x), (1, placed.y)):
        own, pattern = place.take(placement), which(placed, windows, placement)
        low, high = tiles[axis].take(near), tiles[axis + 2].take(near)
        low -= own
        high -= own
        met = low <= box[axis + 2].take(pattern)
        met &= high >= box[axis].take(pattern)
        some = met.nonzero()[0]
        placement, near = placement.take(some), near.take(some)
        corner = [side.take(some) for side in (*corner, low)]
    if not len(windows.strips):
        return Meeting(placement, near, *corner)
    placement, near = crossing(placed, windows, tiles, placement, near)
    left, top = tiles[0].take(near) - placed.x.take(placement), tiles[1].take(near) - placed.y.take(placement)
    return Meeting(placement, near, left, top)


def crossing(placed: Placed, windows: Windows, tiles: Ints, placement: Ints, near: Ints) -> tuple[Ints, Ints]:
    """Those of pairs (n,) of placements and tiles that are not beyond the strips of their patterns.

    Parameters
    ----------
    tiles : (4, V) sides of the boxes of tiles
    """
    if not len(windows.strips) or not len(near):
        return placement, near
    wide, high = (int(np.maximum.reduce(tiles[side + 2] - tiles[side])) + 1 for side in (0, 1))
    left, top = tiles[0].take(near) - placed.x.take(placement), tiles[1].take(near) - placed.y.take(placement)
    some = meets_strip(windows.strips, which(placed, windows, placement), left, top, wide, high)
    return placement.take(some), near.take(some)


def placed_boxes(placed: Placed, windows: Windows) -> Ints:
    """Sides (4, P) of the boxes of placed patterns."""
    box = windows.box_xyxy.T
    asked = np.empty((4, len(placed.x)), np.int64)
    for side, place in enumerate((placed.x, placed.y, placed.x, placed.y)):
        np.add(place, box[side].take(placed.pattern) if len(windows.first) > 1 else box[side], out=asked[side])
    return asked


def _counted(placed: Placed, windows: Windows, seen: Seen, met: Meeting, height: int, beside: Beside) -> Found:
    """What pairs share, compared in so many rows."""
    who, at, left, top = met
    pattern, begin, low = which(placed, windows, who), seen.begin[at], height < seen.height
    if low:
        begin -= top
        top = np.full_like(top, windows.box_xyxy[pattern, 1])
        begin += top
    rows = rows_of(seen.words, height, begin)
    rows &= windows_at(windows, height, pattern, left, top)
    samples = _sums(np.bitwise_count(rows))
    hit = samples.nonzero()[0]
    who, at = who.take(hit), at.take(hit)
    origin_x, origin_y = placed.origin_x.take(who), placed.origin_y.take(who)
    left, top = left.take(hit) + placed.x.take(who) - origin_x, top.take(hit) + placed.y.take(who) - origin_y
    if low or not len(beside):
        distance2, across, down = nearest(rows.take(hit, axis=0), left, top)
    else:
        distance2, across, down = nearest_seen(seen, beside, at, left, top)
    across += origin_x
    down += origin_y
    return Found(who, at, samples.take(hit), distance2, across, down)


def which(placed: Placed, windows: Windows, placement: Ints) -> Ints | int:
    """Patterns of placements; 0 where there is but one."""
    return placed.pattern[placement] if len(windows.first) > 1 else 0


def _rows_counted(windows: Windows, seen: Seen) -> int:
    """How many rows are compared: the tiles', or the patterns' if they are low."""
    box = windows.box_xyxy
    high = -(-int((box[:, 3] - box[:, 1]).max(initial=0) + 1) // 8) * 8
    return high if high <= PAD and high < seen.height else seen.height


def windows_at(windows: Windows, height: int, pattern: Ints | int, left: Ints, top: Ints) -> Words:
    """Windows (n, height) of patterns: of 64 columns from `left` on, of rows from `top` on, about their pixel."""
    column = left - (windows.box_xyxy[pattern, 0] - (WORD - 1))
    begin = top - (windows.box_xyxy[pattern, 1] - windows.first[pattern])
    every, kind = every_stretch(windows.words, height), windows.words.dtype
    if windows.shifted:
        column *= windows.shifted
        begin += column
        return rows_at(every, begin, height, kind)
    shift = (column & (WORD - 1)).view(np.uint64)[:, None]
    column >>= 6
    begin += column * windows.rows[pattern]
    low = rows_at(every, begin, height, kind)
    high = rows_at(every, begin + windows.rows[pattern], height, kind)
    low >>= shift
    high <<= np.uint64(WORD) - shift
    low |= high
    return low


def union(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, first: Ints) -> Ints:
    """Pixels that the placements of each group together share with their tile.

    Parameters
    ----------
    placement, near : (n,) pairs, those of one group and so of one tile after one another
    first : (g,) where each group begins
    """
    left, top = seen.box_xyxy[near, 0] - placed.x[placement], seen.box_xyxy[near, 1] - placed.y[placement]
    rows = rows_of(seen.words, seen.height, seen.begin[near])
    rows &= windows_at(windows, seen.height, which(placed, windows, placement), left, top)
    together = np.bitwise_or.reduceat(rows, first, axis=0)
    return np.asarray(np.bitwise_count(together).sum(axis=1, dtype=np.int64))


def row_order(group: Ints, distance2: Ints, y: Ints, x: Ints) -> Ints:
    """Places of rows in the order of (group, distance2, y, x, place); groups are sorted already."""
    keys = (group, distance2, y, x)
    least = [int(np.minimum.reduce(key, initial=0)) for key in keys]
    most = [int(np.maximum.reduce(key, initial=0)) for key in keys]
    bits = [(high - low).bit_length() for low, high in zip(least, most, strict=True)]
    if sum(bits) >= WORD:
        return np.lexsort(keys[::-1])
    number = group - least[0]
    for key, low, size in zip(keys[1:], least[1:], bits[1:], strict=True):
        number <<= size
        number |= key - low
    return number.argsort(kind="stable")


def _sums(counts: npt.NDArray[np.uint8]) -> Ints:
    """Sums (n,) of rows (n, m), m a multiple of 8 up to 64, of numbers up to 64: eight of them at a time."""
    eights = counts.view(np.uint64)
    total = np.zeros(len(counts), np.uint64)
    for first in range(0, eights.shape[1], 3):  # three of them fit a byte
        some = eights[:, first].copy()
        for column in range(first + 1, min(first + 3, eights.shape[1])):
            some += eights[:, column]
        total += some & _BYTES
        some >>= np.uint64(8)
        some &= _BYTES
        total += some
    total *= _SUM
    total >>= np.uint64(48)
    return total.astype(np.int64)
