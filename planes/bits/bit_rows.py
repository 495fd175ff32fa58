"""Bit rows: 64 pixels of a row in one word; `&` gives the pixels that two sets share, and popcount their number.

Rows lie one after another in flat arrays, with empty rows around each tile or pattern, so that reads at any row offset
need no test. All functions map arrays to arrays; `jit.bit_rows` has the compiled kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Ints
from ..grid.spans import Box, begins, meets_strip

Words = npt.NDArray[np.uint64]
Kind = TypeVar("Kind", bound=np.generic)

WORD = 64
"""Columns of a tile, and rows at most."""

PAD = 32
"""Empty rows between visible tiles; patterns of at most so many rows are compared in their own rows."""


class VisibleTiles(NamedTuple):
    """Visible pixels of tiles, as columns.

    Parameters
    ----------
    rank : (V,) place in the stack of each tile's item
    box_xyxy : (V, 4) inclusive, px
    begin : (V,) first row in `words`
    words : flat rows, with PAD empty ones around each tile
    height : rows of the highest tile, rounded up to a multiple of 8
    """

    rank: Ints
    box_xyxy: Ints
    begin: Ints
    words: Words
    height: int


def packed(masks: Sequence[Bools]) -> Words:
    """Rows (n, 64) of masks (h, w), each of at most 64 x 64 pixels."""
    bits = np.zeros((len(masks), WORD, WORD), np.bool_)
    for own, mask in zip(bits, masks, strict=True):
        own[: mask.shape[0], : mask.shape[1]] = mask
    return np.packbits(bits.reshape(-1), bitorder="little").view("<u8").astype(np.uint64).reshape(-1, WORD)


def rows_of(words: npt.NDArray[Kind], height: int, begin: Ints) -> npt.NDArray[Kind]:
    """Rows (n, height) of a flat array, from places (n,) on."""
    return rows_at(every_stretch(words, height), begin, height, words.dtype)


def every_stretch(words: npt.NDArray[Any], height: int) -> npt.NDArray[np.void]:
    """All stretches of `height` numbers of an array, each as one value; picking them takes half the time of rows."""
    kind = np.dtype((np.void, words.itemsize * height))
    return np.ndarray((len(words) - height + 1,), kind, words, 0, words.strides)


def rows_at(every: npt.NDArray[np.void], begin: Ints, height: int, kind: np.dtype[Kind]) -> npt.NDArray[Kind]:
    """Stretches from places (n,) on, as rows (n, height)."""
    return np.asarray(every[begin].view(kind)).reshape(len(begin), height)


Beside = npt.NDArray[np.uint8]

BESIDE_REACH = 113
"""Radius of the largest disc whose nearest pixel is found by distances along rows, px; sums of squares fit uint16."""

NOWHERE = BESIDE_REACH + 1
"""Distance, px, that stands for a row without pixels, and for rows farther away; it is never the least."""

_BIT = np.uint64(1)
_PLACES = _BIT << np.arange(WORD, dtype=np.uint64)
_ROW_BITS = 6
"""Bits of the row in a number that sorts as (squared distance, row)."""


def nearest(met: Words, left: Ints, top: Ints) -> tuple[Ints, Ints, Ints]:
    """Pixel of each non-empty set (n, height) that is nearest to the origin; of equally near ones the least (y, x).

    Parameters
    ----------
    left, top : (n,) column 0 and row 0, relative to the origin

    Returns
    -------
    squared distance, x, y, relative to the origin
    """
    column = np.minimum(np.maximum(-left, 0), WORD - 1)  # the nearest to the origin
    away = left + column
    across = np.abs(away)
    place = (met != 0).reshape(-1).nonzero()[0]  # few rows have a pixel
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
    """Distances (n,) from a column of each word, none 0, to the word's nearest pixel."""
    own = column.view(np.uint64)
    after = words >> own
    below = after - _BIT
    np.invert(after, out=after)
    after &= below
    before = words << (np.uint64(WORD - 1) - own)
    np.right_shift(before, _BIT, out=below)
    np.invert(below, out=below)
    before &= below
    # The exponent of the float is the place of the highest bit; clearing the bit below each set one stops rounding up.
    exponent = before.astype(np.float64).view(np.int64)
    exponent >>= 52
    np.subtract(1023 + WORD - 1, exponent, out=exponent)
    np.minimum(exponent, np.bitwise_count(after), out=exponent)
    return exponent


def beside_of(seen: VisibleTiles) -> Beside:
    """Distance (V, 64, height) from each pixel of a tile to the nearest visible one in its row; NOWHERE if none is."""
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


def nearest_visible(seen: VisibleTiles, beside: Beside, near: Ints, left: Ints, top: Ints) -> tuple[Ints, Ints, Ints]:
    """Like `nearest`, of all visible pixels of tiles; a disc that hits a tile hits its nearest pixel, too."""
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
    """Offset (n,) of a pixel that lies `step` from a column: before it if there is one, else after."""
    before = (words >> (column - step).view(np.uint64)) & _BIT
    return np.where(before, -step, step)


WORDS_AT_ONCE = 2**17
"""Words of pairs worked on at a time: 1 MB; with fewer, calls take longer, with more, the caches overflow."""

PAIRS_AT_ONCE = 2**16
"""Pairs whose boxes are compared at a time: 512 KB a column."""

_ONE, _FULL = np.uint64(1), np.uint64(2**64 - 1)
_BYTES = np.uint64(0x00FF00FF00FF00FF)
_SUM = np.uint64(0x0001000100010001)


class PatternBits(NamedTuple):
    """Bit rows of patterns, from which windows of 64 columns are read, as columns by pattern.

    A pattern is stored as columns of words, so that a window of many rows is one stretch of memory, or two stretches
    and a shift.

    Parameters
    ----------
    box_xyxy : (n, 4) boxes of the patterns about the pixel that they are placed on
    first : (n,) place in `words` of the corner of each pattern's box
    rows : (n,) words from one column of words to the next
    words : the bit rows of all patterns, flat
    shifted : words from the window at one column to that at the next; 0 if windows are shifted when they are read
    strips : (n, 4) strips of the patterns, see `hitplanes.planes.grid.spans`; (0, 4) if boxes are as tight
    """

    box_xyxy: Ints
    first: Ints
    rows: Ints
    words: Words
    shifted: int
    strips: Ints


class Placed(NamedTuple):
    """Placed patterns (n,): pattern, pixel that it is placed on, and pixel from which distances are counted."""

    pattern: Ints
    x: Ints
    y: Ints
    origin_x: Ints
    origin_y: Ints


class Meeting(NamedTuple):
    """Pairs (n,) of a placement and a tile that may share pixels; the tile's corner relative to the placement."""

    placement: Ints
    tile: Ints
    left: Ints
    top: Ints


class TileHits(NamedTuple):
    """Sorted pairs (n,) of a placement and a visible tile that share pixels; how many, and the nearest to the origin.

    The nearest pixel is the first by (distance2, y, x); x and y are those of the world.
    """

    placement: Ints
    seen: Ints
    samples: Ints
    distance2: Ints
    x: Ints
    y: Ints


def visible(words: Words, height: int, begin: Ints, of: Ints, front: Ints, right: Ints) -> Words:
    """Pixels (n, height) of tiles that no tile in front covers.

    Parameters
    ----------
    words : flat rows of all tiles
    begin : (n,) first row of each tile
    of : (m,) sorted places of covered tiles, for pairs with a tile in front
    front : (m,) row of the tile in front that lies on the covered tile's first row
    right : (m,) columns by which the tile in front lies to the right, -63 .. 63
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
    """Clear pixels (n, height) beyond the bounds; column 0 and row 0 lie at `left` and `top` (n,)."""
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


def found(
    placed: Placed, windows: PatternBits, seen: VisibleTiles, placement: Ints, near: Ints, beside: Beside
) -> TileHits:
    """Count the pixels that placed patterns and visible tiles share.

    Parameters
    ----------
    placement, near : (n,) sorted pairs of a placement and a tile that may meet
    beside : distances along the rows of the visible tiles, if all patterns are discs; else empty
    """
    height = _rows_counted(windows, seen)
    step = WORDS_AT_ONCE // height
    tiles = seen.box_xyxy.T.copy()
    parts = [TileHits(*[np.zeros(0, np.int64)] * 6)]
    for first in range(0, len(near), PAIRS_AT_ONCE):
        now = slice(first, first + PAIRS_AT_ONCE)
        met = _meeting(placed, windows, tiles, placement[now], near[now])
        parts += [
            _counted(placed, windows, seen, Meeting(*[column[i : i + step] for column in met]), height, beside)
            for i in range(0, len(met.tile), step)
        ]
    return TileHits(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _meeting(placed: Placed, windows: PatternBits, tiles: Ints, placement: Ints, near: Ints) -> Meeting:
    """Pairs (n,) whose boxes share a pixel and whose tile meets the strip of the pattern.

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
        rows = met.nonzero()[0]
        placement, near = placement.take(rows), near.take(rows)
        corner = [side.take(rows) for side in (*corner, low)]
    if not len(windows.strips):
        return Meeting(placement, near, *corner)
    placement, near = crossing(placed, windows, tiles, placement, near)
    left, top = tiles[0].take(near) - placed.x.take(placement), tiles[1].take(near) - placed.y.take(placement)
    return Meeting(placement, near, left, top)


def crossing(placed: Placed, windows: PatternBits, tiles: Ints, placement: Ints, near: Ints) -> tuple[Ints, Ints]:
    """Pairs (n,) whose tile meets the strip of the pattern; `tiles` are the sides (4, V) of the tiles' boxes."""
    if not len(windows.strips) or not len(near):
        return placement, near
    wide, high = (int(np.maximum.reduce(tiles[side + 2] - tiles[side])) + 1 for side in (0, 1))
    left, top = tiles[0].take(near) - placed.x.take(placement), tiles[1].take(near) - placed.y.take(placement)
    rows = meets_strip(windows.strips, which(placed, windows, placement), left, top, wide, high)
    return placement.take(rows), near.take(rows)


def placed_boxes(placed: Placed, windows: PatternBits) -> Ints:
    """Sides (4, P) of the boxes of placed patterns."""
    box = windows.box_xyxy.T
    asked = np.empty((4, len(placed.x)), np.int64)
    for side, place in enumerate((placed.x, placed.y, placed.x, placed.y)):
        np.add(place, box[side].take(placed.pattern) if len(windows.first) > 1 else box[side], out=asked[side])
    return asked


def _counted(
    placed: Placed, windows: PatternBits, seen: VisibleTiles, met: Meeting, height: int, beside: Beside
) -> TileHits:
    """Count the pixels that pairs share, in `height` rows each."""
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
        distance2, across, down = nearest_visible(seen, beside, at, left, top)
    across += origin_x
    down += origin_y
    return TileHits(who, at, samples.take(hit), distance2, across, down)


def which(placed: Placed, windows: PatternBits, placement: Ints) -> Ints | int:
    """Patterns of placements; 0 if there is one pattern."""
    return placed.pattern[placement] if len(windows.first) > 1 else 0


def _rows_counted(windows: PatternBits, seen: VisibleTiles) -> int:
    """Number of rows to compare: the tiles', or the patterns' if those are low."""
    box = windows.box_xyxy
    high = -(-int((box[:, 3] - box[:, 1]).max(initial=0) + 1) // 8) * 8
    return high if high <= PAD and high < seen.height else seen.height


def windows_at(windows: PatternBits, height: int, pattern: Ints | int, left: Ints, top: Ints) -> Words:
    """Windows (n, height) of patterns: 64 columns from `left` on, rows from `top` on, relative to their pixel."""
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


def union(placed: Placed, windows: PatternBits, seen: VisibleTiles, placement: Ints, near: Ints, first: Ints) -> Ints:
    """Number of distinct pixels that the placements of each group share with their tile.

    Parameters
    ----------
    placement, near : (n,) pairs of a placement and a tile; those of a group, which have one tile, are together
    first : (g,) where each group begins
    """
    left, top = seen.box_xyxy[near, 0] - placed.x[placement], seen.box_xyxy[near, 1] - placed.y[placement]
    rows = rows_of(seen.words, seen.height, seen.begin[near])
    rows &= windows_at(windows, seen.height, which(placed, windows, placement), left, top)
    together = np.bitwise_or.reduceat(rows, first, axis=0)
    return np.asarray(np.bitwise_count(together).sum(axis=1, dtype=np.int64))


# house: row order
def row_order(group: Ints, distance2: Ints, y: Ints, x: Ints) -> Ints:
    """Order of rows by (group, distance2, y, x, place); groups are sorted already."""
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
    """Sums (n,) of rows (n, m) of numbers up to 64, eight at a time; m is a multiple of 8 up to 64."""
    eights = counts.view(np.uint64)
    total = np.zeros(len(counts), np.uint64)
    for first in range(0, eights.shape[1], 3):  # the sum of three fits a byte
        sums = eights[:, first].copy()
        for column in range(first + 1, min(first + 3, eights.shape[1])):
            sums += eights[:, column]
        total += sums & _BYTES
        sums >>= np.uint64(8)
        sums &= _BYTES
        total += sums
    total *= _SUM
    total >>= np.uint64(48)
    return total.astype(np.int64)
