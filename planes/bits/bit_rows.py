"""Bit rows: 64 pixels of a row in one word; `&` gives the pixels that two sets share, and popcount their number.

Rows lie one after another in flat arrays, with empty rows around each tile or pattern, so that reads at any row offset
need no test. All functions map arrays to arrays; `jit.bit_rows` has the compiled kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Ints
from ..grid.spans import NO_STRIPS, Box, RowRuns, Spans, begins, meets_strip, ragged

Words = npt.NDArray[np.uint64]
Sums = npt.NDArray[np.uint32]
NO_SUMS: Sums = np.zeros(0, np.uint32)
Kind = TypeVar("Kind", bound=np.generic)

WORD = 64
"""Columns of a tile, and rows at most."""


def packed(masks: Sequence[Bools]) -> Words:
    """Rows (n, 64) of masks (h, w), each of at most 64 x 64 pixels."""
    bits = np.zeros((len(masks), WORD, WORD), np.bool_)
    for own, mask in zip(bits, masks, strict=True):
        own[: mask.shape[0], : mask.shape[1]] = mask
    return np.packbits(bits.reshape(-1), bitorder="little").view("<u8").astype(np.uint64).reshape(-1, WORD)


def rows_of(words: npt.NDArray[Kind], height: int, begin: Ints) -> npt.NDArray[Kind]:
    """Rows (n, height) of a flat array, from places (n,) on; each stretch is picked as one value."""
    stretch = np.dtype((np.void, words.itemsize * height))
    every = np.ndarray((len(words) - height + 1,), stretch, words, 0, words.strides)
    return np.asarray(every[begin].view(words.dtype)).reshape(len(begin), height)


_BIT = np.uint64(1)
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
    before = (met[np.arange(len(met)), row] >> (column - step).view(np.uint64)) & _BIT  # of two it comes first
    return distance2, away + np.where(before, -step, step), down


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


WORDS_AT_ONCE = 2**16
"""Words of pairs worked on at a time: 512 KB; with fewer, calls take longer, with more, the caches overflow."""

_FULL = np.uint64(2**64 - 1)
_PAST_LAST = np.array([[0], [1]])  # added to the first and last pixels of runs, makes them half-open


class PatternBits(NamedTuple):
    """Bit rows of patterns, from which windows of 64 columns are read, as columns by pattern.

    A pattern is stored as columns of words, so that a window of many rows is two stretches of memory and a shift. There
    are WORD empty rows before the first column, and after each.

    Parameters
    ----------
    box_xyxy : (n, 4) boxes of the patterns about the pixel that they are placed on
    first : (n,) place in `words` of the corner of each pattern's box
    rows : (n,) words from one column of words to the next
    words : the bit rows of all patterns, flat
    strips : (n, 4) strips of the patterns, see `hitplanes.planes.grid.spans`; (0, 4) if boxes are as tight
    sums : sums of the weights along the rows of each box, each row from 0 on, modulo 2**32; empty at full weight
    first_sum : (n,) place in `sums` of the corner of each pattern's box
    """

    box_xyxy: Ints
    first: Ints
    rows: Ints
    words: Words
    strips: Ints
    sums: Sums
    first_sum: Ints


def bits_of_runs(runs: RowRuns, count: int, normal: Ints) -> PatternBits | None:
    """Bit rows of `count` patterns from their runs; None if one is empty.

    Parameters
    ----------
    normal : (count, 2) normals of the strips, or none
    """
    shape, y, parts = runs
    first, last = parts[0]
    for begin, end in parts[1:]:
        first, last = np.minimum(first, begin), np.maximum(last, end)
    filled = first <= last
    if not filled.all():
        shape, y, first, last = shape[filled], y[filled], first[filled], last[filled]
        parts = [(begin[filled], end[filled]) for begin, end in parts]
    begin = begins(shape).nonzero()[0]
    if len(begin) < count:
        return None
    end = np.append(begin[1:], len(shape)) - 1
    box = np.stack([np.minimum.reduceat(first, begin), y[begin], np.maximum.reduceat(last, begin), y[end]], axis=1)
    rows = box[:, 3] - box[:, 1] + (1 + WORD)
    size = rows * ((2 * WORD - 2 + box[:, 2] - box[:, 0] + 1) // WORD + 1)
    corner = np.cumsum(size) - size + WORD
    words = np.zeros(WORD + int(size.sum()), np.uint64)
    at, left, step = (corner - box[:, 1])[shape] + y, (box[:, 0] - (WORD - 1))[shape], rows[shape]
    for part in parts:
        _lay_runs(words, at, step, *(side - left for side in part))
    strips = NO_STRIPS
    if len(normal):
        a, b = normal.T
        across, ends = b[shape] * y, (a[shape] * first, a[shape] * last)
        low = np.minimum.reduceat(np.minimum(*ends) + across, begin)
        strips = np.stack([a, b, low, np.maximum.reduceat(np.maximum(*ends) + across, begin)], axis=1)
    return PatternBits(box, corner, rows, words, strips, NO_SUMS, np.zeros(len(box), np.int64))


def columns_of(spans: Spans) -> Words:
    """Words (columns of words, rows) of a pattern, with 63 empty pixels before it and 64 empty rows after its own."""
    x, y, x_max, y_max = spans.box_xyxy or (0, 0, -1, -1)
    columns = (WORD - 2 + x_max - x + 1) // WORD + 2
    made = np.zeros((columns, y_max - y + 1 + WORD), np.uint64)
    column = x - (WORD - 1) + WORD * np.arange(columns)
    row = np.flatnonzero(np.diff(spans.y, prepend=y - 1))
    if len(row):
        runs = words_of(np.stack([spans.x_first, spans.x_last]), column)
        made[:, spans.y[row] - y] = np.bitwise_or.reduceat(runs, row, axis=0).T
    return made


def words_of(ends: Ints, column: Ints) -> Words:
    """Words (..., k, columns) of runs with first and last pixels (..., 2, k), given the columns of their bits 0."""
    bits = (ends + _PAST_LAST)[..., None] - column
    shifted: Words = _FULL << np.minimum(np.maximum(bits, 0, out=bits), WORD, out=bits).view(np.uint64)
    return shifted[..., 0, :, :] & ~shifted[..., 1, :, :]  # by 64 all is shifted out


def _lay_runs(words: Words, at: Ints, step: Ints, first: Ints, last: Ints) -> None:
    """Set the bits of runs (k,), each in a row of its own.

    Parameters
    ----------
    at, step : (k,) place of the row's first word, and from there to the next word of the row
    first, last : (k,) bits of the row
    """
    if (first > last).any():
        there = (first <= last).nonzero()[0]
        at, step, first, last = at[there], step[there], first[there], last[there]
    more = (last >> 6) - (first >> 6)
    begin, end = _FULL << (first & 63).view(np.uint64), _FULL >> (~last & 63).view(np.uint64)
    at = at + (first >> 6) * step
    words[at] |= np.where(more == 0, begin & end, begin)
    far = more.nonzero()[0]
    at, step, more, end = at[far], step[far], more[far], end[far]
    words[at + more * step] |= end
    for k in range(1, int(more.max(initial=0))):
        between = (more > k).nonzero()[0]
        words[at[between] + k * step[between]] = _FULL


class Placed(NamedTuple):
    """Placed patterns (n,): pattern, pixel that it is placed on, and pixel from which distances are counted."""

    pattern: Ints
    x: Ints
    y: Ints
    origin_x: Ints
    origin_y: Ints


# house: hit rule of areas
def take_away(rows: Words, words: Words, of: Ints, front: Ints, right: Ints) -> None:
    """Clear the pixels of rows (n, height) that tiles in front cover, because they end there.

    Parameters
    ----------
    words : flat rows of all tiles
    of : (m,) rows that are covered, sorted
    front : (m,) row of the tile in front that lies on the first of the covered ones
    right : (m,) columns by which the tile in front lies to the right, -63 .. 63
    """
    height = rows.shape[1]
    step = max(WORDS_AT_ONCE // height, 1)
    for first in range(0, len(of), step):
        part = slice(first, first + step)
        own, shift = of[part], right[part]
        cover = rows_of(words, height, front[part])
        cover <<= np.maximum(shift, 0).view(np.uint64)[:, None]
        cover >>= np.maximum(-shift, 0).view(np.uint64)[:, None]
        np.invert(cover, out=cover)
        new = begins(own).nonzero()[0]
        if len(new) < len(own):
            own, cover = own[new], np.bitwise_and.reduceat(cover, new, axis=0)
        rows[own] &= cover


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


def pixels_within(placed: Placed, windows: PatternBits, count: Ints, bounds: Box) -> Ints:
    """Pixels (P,) of placed patterns within bounds; `count` has those of each pattern."""
    left, top, right, low = placed_boxes(placed, windows)
    over = (left < bounds[0]) | (top < bounds[1])
    over |= (right > bounds[2]) | (low > bounds[3])
    at, inside = over.nonzero()[0], count.take(placed.pattern)
    if not len(at):
        return inside
    kind, left, top = placed.pattern[at], left[at] - (WORD - 1), top[at]
    high, first = low[at] - top + 1, np.maximum(bounds[1] - top, 0)
    rows = np.maximum(np.minimum(high, bounds[3] - top + 1) - first, 0)
    first = np.minimum(first, high)  # those beyond the bounds have no rows
    of, column = ragged((right[at] - left >> 6) + 1)
    left = left[of] + WORD * column
    begin, end = np.maximum(bounds[0] - left, 0), np.maximum(left + WORD - 1 - bounds[2], 0)
    begin, end = np.minimum(begin, WORD), np.minimum(end, WORD)
    kept = (_FULL << begin.view(np.uint64)) & (_FULL >> end.view(np.uint64))
    place, rows = (windows.first[kind] + first)[of] + column * windows.rows[kind][of], rows[of]
    total = np.concatenate([[0], np.cumsum(np.bitwise_count(windows.words), dtype=np.int64)])
    pixels = (total[place + rows] - total[place]) * (kept != 0)
    cut = (pixels > 0) & (kept != _FULL)
    word, row = ragged(rows[cut])
    left = np.bitwise_count(windows.words[place[cut][word] + row] & kept[cut][word])
    pixels[cut] = np.bincount(word, left, np.count_nonzero(cut))
    inside[at] = np.bincount(of, pixels, len(at)).astype(np.int64)
    return inside


def pixels_of_patterns(bits: PatternBits) -> Ints:
    """Pixels (n,) of each pattern."""
    count: Ints = np.add.reduceat(np.bitwise_count(bits.words), bits.first, dtype=np.int64)
    return count


def which(placed: Placed, windows: PatternBits, placement: Ints) -> Ints | int:
    """Patterns of placements; 0 if there is one pattern."""
    return placed.pattern[placement] if len(windows.first) > 1 else 0


def windows_at(windows: PatternBits, height: int, pattern: Ints | int, left: Ints, top: Ints) -> Words:
    """Windows (n, height) of patterns: 64 columns from `left` on, rows from `top` on, relative to their pixel."""
    column = left - (windows.box_xyxy[pattern, 0] - (WORD - 1))
    begin = top - (windows.box_xyxy[pattern, 1] - windows.first[pattern])
    shift = (column & (WORD - 1)).view(np.uint64)[:, None]
    column >>= 6
    begin += column * windows.rows[pattern]
    low = rows_of(windows.words, height, begin)
    high = rows_of(windows.words, height, begin + windows.rows[pattern])
    low >>= shift
    high <<= np.uint64(WORD) - shift
    low |= high
    return low


def weights_of(rows: Words, windows: PatternBits, pattern: Ints | int, left: Ints, top: Ints) -> Ints:
    """Sum of the weights of pixels (n, height) of patterns; column 0 and row 0 lie at `left` and `top` (n,).

    The pixels of a word are taken run by run, each as a difference of two sums.
    """
    box, height = windows.box_xyxy[pattern], rows.shape[1]
    wide = box[..., 2] - box[..., 0] + 2
    corner = windows.first_sum[pattern] + (top - box[..., 1]) * wide + left - box[..., 0]
    place = (rows != 0).reshape(-1).nonzero()[0]
    pair = place // height
    words = rows.reshape(-1)[place]
    begin = corner[pair] + (place - pair * height) * (wide[pair] if np.ndim(wide) else wide)
    total = np.zeros(len(rows), np.int64)
    while len(words):
        lowest = words & (~words + _BIT)
        carried = words + lowest  # the lowest run becomes the bit after it
        first = begin + np.bitwise_count(lowest - _BIT)
        last = first + np.bitwise_count(words & ~carried)
        total += np.bincount(pair, windows.sums[last] - windows.sums[first], len(rows)).astype(np.int64)
        words &= carried
        rest = words.nonzero()[0]
        words, begin, pair = words[rest], begin[rest], pair[rest]
    return total
