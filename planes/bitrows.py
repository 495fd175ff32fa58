"""Kernels on bit rows: 64 pixels of a row as one word, bit j for column j; a tile is up to 64 such rows.

What two sets of pixels share is `&` of their words, its size their population count. Rows lie one after another in
flat arrays, with empty rows around each tile or pattern, so that any row offset reads as many rows without a test.
Every function is from arrays to arrays; `bitrows_jit` has the same ones, compiled.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Codes, Ints
from planes.spans import Box

__all__ = [
    "PAD",
    "WORD",
    "Beside",
    "Found",
    "Placed",
    "Seen",
    "Windows",
    "Words",
    "found",
    "beside_of",
    "front_at",
    "packed",
    "row_order",
    "rows_of",
    "union",
    "visible",
]

Words = npt.NDArray[np.uint64]
Beside = npt.NDArray[np.uint8]

WORD = 64
"""Columns of a tile, and rows at most."""

PAD = 16
"""Empty rows between seen tiles: patterns of so few rows are counted by their own."""

NOWHERE = 255
"""Instead of the distance along a row that has no pixel."""

WORDS_AT_ONCE = 2**15
"""Words of pairs worked on at a time: 256 KB, which stay in the level-2 cache with their windows and counts."""

_FULL = np.uint64(2**64 - 1)
_ONE = np.uint64(1)
_PLACES = _ONE << np.arange(WORD, dtype=np.uint64)
_BYTES = np.uint64(0x00FF00FF00FF00FF)
_SUM = np.uint64(0x0001000100010001)
_NONE = 2**16 - 1
_FAR, _FAR_SMALL = 2**22, 2**14
"""Farther from the origin than any pixel of a pattern, px; and of one whose squares fit int32, with a sum of two."""


class Seen(NamedTuple):
    """Visible pixels of tiles, as columns.

    Parameters
    ----------
    rank : (V,) place in the stack of the item of each
    box_xyxy : (V, 4) inclusive, px
    begin : (V,) its first row in `words`
    words : flat rows, with PAD empty ones around each tile
    height : rows of the highest tile, rounded up to a multiple of 8
    """

    rank: Ints
    box_xyxy: Ints
    begin: Ints
    words: Words
    height: int


class Windows(NamedTuple):
    """The windows of 64 columns of patterns, as columns by pattern.

    A pattern's rows are kept as columns of words, so that the window of many rows at one column is one stretch of
    memory, or two neighbouring ones and a shift.

    Parameters
    ----------
    box_xyxy : (n, 4) boxes of the patterns about the pixel that they are placed on
    first : (n,) the word of each pattern's box corner, at its first column of words
    rows : (n,) words from one column to the next
    words : flat
    shifted : words from one of all 64 shifts to the next; 0 if none are made
    """

    box_xyxy: Ints
    first: Ints
    rows: Ints
    words: Words
    shifted: int


class Placed(NamedTuple):
    """Placed patterns: which (n,), on which pixel, and the pixel from which distances are counted."""

    pattern: Ints
    x: Ints
    y: Ints
    origin_x: Ints
    origin_y: Ints


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


def packed(mask: Bools) -> Words:
    """Rows (h,) of a mask (h, w) of at most 64 columns."""
    return np.asarray((mask * _PLACES[: mask.shape[1]]).sum(axis=1, dtype=np.uint64))


def rows_of(words: Words, height: int, begin: Ints) -> Words:
    """Rows (n, height) of a flat array from each of (n,) places on."""
    return np.asarray(_every(words, height)[begin])


def _every(words: Words, height: int) -> Words:
    """Rows of a view, of which each begins a word after the one before."""
    return np.lib.stride_tricks.as_strided(words, (len(words) - height + 1, height), (8, 8), writeable=False)


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
    rows = _every(words, height)
    step = np.arange(len(of)) - np.searchsorted(of, of)
    at_once = WORDS_AT_ONCE // height
    by_step = np.argsort(step, kind="stable")
    ends = np.searchsorted(step[by_step], np.arange(int(step.max(initial=-1)) + 2)).tolist()
    for first, last in pairwise(ends):
        for at in range(first, last, at_once):
            now = by_step[at : min(at + at_once, last)]
            cover = rows[front[now]]
            cover <<= np.maximum(right[now], 0).astype(np.uint64)[:, None]
            cover >>= np.maximum(-right[now], 0).astype(np.uint64)[:, None]
            seen[of[now]] &= ~cover
    return seen


def found(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, beside: Beside) -> Found:
    """Count what placed patterns and seen tiles share.

    Parameters
    ----------
    placement, near : (n,) pairs of them that may meet, sorted
    beside : of the seen tiles, if each pattern holds all pixels that are nearer to its origin than one of its own; or
        empty
    """
    met = _meets(placed, windows, seen, placement, near).nonzero()[0]
    placement, near = placement[met], near[met]
    height, top = _rows_counted(placed, windows, seen, placement, near)
    left = seen.box_xyxy[near, 0]
    tile = seen.begin[near] + top - seen.box_xyxy[near, 1]
    parts = [Found(*[np.zeros(0, np.int64)] * 6)]
    step = WORDS_AT_ONCE // height
    for first in range(0, len(near), step):
        now = slice(first, first + step)
        who, at = placement[now], near[now]
        rows = _every(seen.words, height)[tile[now]]
        rows &= _windows(placed, windows, height, who, left[now], top[now])
        samples = _sums(np.bitwise_count(rows))
        hit = samples.nonzero()[0]
        who, at = who[hit], at[hit]
        if len(beside):
            distance2, x, y = _nearest_seen(placed, seen, beside, who, at)
        else:
            across, down = left[now][hit] - placed.origin_x[who], top[now][hit] - placed.origin_y[who]
            distance2, x, y = _nearest(rows[hit], across, down)
        parts.append(Found(who, at, samples[hit], distance2, x + placed.origin_x[who], y + placed.origin_y[who]))
    return Found(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _meets(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints) -> Bools:
    """Whether the boxes of pairs share a pixel."""
    pattern, boxes = _which(placed, windows, placement), windows.box_xyxy
    x, y, tiles = placed.x[placement], placed.y[placement], seen.box_xyxy[near]
    met = tiles[:, 0] - x <= boxes[pattern, 2]
    met &= tiles[:, 2] - x >= boxes[pattern, 0]
    met &= tiles[:, 1] - y <= boxes[pattern, 3]
    met &= tiles[:, 3] - y >= boxes[pattern, 1]
    return np.asarray(met)


def _which(placed: Placed, windows: Windows, placement: Ints) -> Ints | int:
    """Patterns of placements; 0 where there is but one."""
    return placed.pattern[placement] if len(windows.first) > 1 else 0


def _rows_counted(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints) -> tuple[int, Ints]:
    """How many rows are compared, and the first (n,) of each pair: the tile's, or the pattern's if it is low."""
    box = windows.box_xyxy
    high = -(-int((box[:, 3] - box[:, 1]).max(initial=0) + 1) // 8) * 8
    if high <= PAD and high < seen.height:
        return high, placed.y[placement] + box[_which(placed, windows, placement), 1]
    return seen.height, seen.box_xyxy[near, 1]


def _windows(placed: Placed, windows: Windows, height: int, placement: Ints, left: Ints, top: Ints) -> Words:
    """Windows (n, height) of placed patterns: of 64 columns from `left` on, of rows from `top` on, in the world."""
    pattern = _which(placed, windows, placement)
    column = left - placed.x[placement] - windows.box_xyxy[pattern, 0] + WORD - 1
    row = top - placed.y[placement] - windows.box_xyxy[pattern, 1]
    word, shift = column >> 6, column & (WORD - 1)
    begin = windows.first[pattern] + word * windows.rows[pattern] + row
    rows = _every(windows.words, height)
    if windows.shifted:
        return np.asarray(rows[begin + shift * windows.shifted])
    by = shift.astype(np.uint64)[:, None]
    low, high = rows[begin], rows[begin + windows.rows[pattern]]
    return np.asarray((low >> by) | (high << (np.uint64(WORD) - by)))


def union(placed: Placed, windows: Windows, seen: Seen, placement: Ints, near: Ints, first: Ints) -> Ints:
    """Pixels that the placements of each group together share with their tile.

    Parameters
    ----------
    placement, near : (n,) pairs, those of one group and so of one tile after one another
    first : (g,) where each group begins
    """
    left, top = seen.box_xyxy[near, 0], seen.box_xyxy[near, 1]
    rows = _every(seen.words, seen.height)[seen.begin[near]]
    rows &= _windows(placed, windows, seen.height, placement, left, top)
    together = np.bitwise_or.reduceat(rows, first, axis=0)
    return np.asarray(np.bitwise_count(together).sum(axis=1, dtype=np.int64))


def front_at(codes: Codes, plane_xyxy: Box, x: Ints, y: Ints, objects: Bools) -> tuple[Ints, Ints]:
    """Objects that lie in front at pixels (n,), as (place, id).

    Parameters
    ----------
    codes, plane_xyxy : a code plane (h, w), see `planes.compose`, and its box in the world
    objects : by id, whether it can be hit
    """
    height, width = codes.shape
    column, row = x - plane_xyxy[0], y - plane_xyxy[1]
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    place = inside.nonzero()[0]
    if len(place) < len(column):
        column, row = column[place], row[place]
    code = codes.reshape(-1)[row * width + column]
    some = code.nonzero()[0]
    item = (code[some] >> 1).astype(np.int64) - 1
    hit = objects[item]
    return place[some[hit]], item[hit]


def row_order(group: Ints, distance2: Ints, y: Ints, x: Ints) -> Ints:
    """Places of rows in the order of (group, distance2, y, x, place); groups are sorted already."""
    keys = (group, distance2, y, x)
    count = len(group)
    least = [int(key.min(initial=0)) for key in keys]
    bits = [int(key.max(initial=0) - low).bit_length() for key, low in zip(keys, least, strict=True)]
    place = max(count - 1, 0).bit_length()
    if sum(bits) + place >= WORD - 1:
        return np.lexsort(keys[::-1])
    number = group - least[0]
    for key, low, size in zip(keys[1:], least[1:], bits[1:], strict=True):
        number <<= size
        number |= key - low
    number <<= place
    number |= np.arange(count)
    number.sort()
    number &= (1 << place) - 1
    return number


def _sums(counts: npt.NDArray[np.uint8]) -> Ints:
    """Sums (n,) of rows (n, m), m a multiple of 8 up to 64, of numbers up to 64: eight of them at a time."""
    eights = counts.view(np.uint64)
    pairs = eights & _BYTES
    pairs += (eights >> np.uint64(8)) & _BYTES
    total = pairs[:, 0].copy()
    for column in range(1, pairs.shape[1]):
        total += pairs[:, column]
    total *= _SUM
    total >>= np.uint64(48)
    return total.astype(np.int64)


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


def _nearest_seen(placed: Placed, seen: Seen, beside: Beside, placement: Ints, near: Ints) -> tuple[Ints, Ints, Ints]:
    """Like `_nearest`, of all visible pixels of tiles: a disc that hits any of them hits the nearest."""
    left, top = seen.box_xyxy[near, 0] - placed.origin_x[placement], seen.box_xyxy[near, 1] - placed.origin_y[placement]
    column = np.minimum(np.maximum(-left, 0), WORD - 1)
    across, away = beside[near, column], np.abs(left + column)
    far = max(int(away.max(initial=0)) + WORD, int(np.abs(top).max(initial=0)) + WORD)
    kind = np.uint16 if 2 * far * far < _NONE else np.int64
    distance2: npt.NDArray[Any] = across + away.astype(kind)[:, None]
    np.square(distance2, out=distance2)
    down = np.abs(top[:, None] + np.arange(seen.height)).astype(kind)
    distance2 += np.square(down, out=down)
    distance2[across == NOWHERE] = np.iinfo(kind).max
    row = distance2.argmin(axis=1)
    every = np.arange(len(near))
    step = across[every, row].astype(np.int64)
    word = seen.words[seen.begin[near] + row]
    before = (word >> np.maximum(column - step, 0).astype(np.uint64)) & _ONE
    x = np.where((before == 1) & (step <= column), column - step, column + step) + left
    return distance2[every, row].astype(np.int64), x, row + top


def _nearest(met: Words, left: Ints, top: Ints) -> tuple[Ints, Ints, Ints]:
    """Pixel of each set (n, height), none empty, that is nearest to the origin; of those as near the least (y, x).

    Parameters
    ----------
    left, top : (n,) where column 0 and row 0 lie, about the origin

    Returns
    -------
    squared distance, x, y, about the origin
    """
    kind = np.int32 if _small(left, top, met.shape[1]) else np.int64
    distance = np.empty(met.shape, kind)
    beyond, ahead = left >= 0, left <= 1 - WORD
    for some, sides in ((beyond, (_after,)), (ahead, (_before,)), (~(beyond | ahead), (_before, _after))):
        pairs = some.nonzero()[0]
        if len(pairs):
            word, column = met[pairs], -left[pairs, None]
            parts = [side(word, column, kind) for side in sides]
            distance[pairs] = parts[0] if len(parts) == 1 else np.minimum(*parts)
    row, distance2 = _least(distance, top, kind)
    word = met[np.arange(len(met)), row]
    before, after = _before(word, -left, np.int64), _after(word, -left, np.int64)
    return distance2, np.where(before <= after, -before, after), row + top


def _small(left: Ints, top: Ints, height: int) -> bool:
    """Whether squared distances from the origin fit int32."""
    return max(int(np.abs(left).max(initial=0)), int(np.abs(top).max(initial=0))) + WORD < _FAR_SMALL


def _least(distance: npt.NDArray[Any], top: Ints, kind: type) -> tuple[Ints, Ints]:
    """Row of least distance from the origin, of distances (n, height) along the rows, and its square."""
    down: npt.NDArray[Any] = top.astype(kind)[:, None] + np.arange(distance.shape[1], dtype=kind)
    np.square(distance, out=distance)
    np.square(down, out=down)
    distance += down
    row = distance.argmin(axis=1)
    return row, distance[np.arange(len(row)), row].astype(np.int64)


def _after(word: Words, column: Ints, kind: type) -> npt.NDArray[Any]:
    """Distance from a column to the nearest pixel of words at or after it; far if none is."""
    right = word & (_FULL << np.minimum(np.maximum(column, 0), WORD).astype(np.uint64))
    distance = np.bitwise_count((right - _ONE) & ~right).astype(kind)
    distance -= column.astype(kind)
    distance[right == 0] = _FAR if kind is np.int64 else _FAR_SMALL
    return np.asarray(distance)


def _before(word: Words, column: Ints, kind: type) -> npt.NDArray[Any]:
    """Distance from a column to the nearest pixel of words at or before it; far if none is."""
    left = word & ~(_FULL << np.minimum(np.maximum(column + 1, 0), WORD).astype(np.uint64))
    # The exponent of a float is the place of the highest bit, once no bit below it can round it up.
    top = (left & ~(left >> _ONE)).astype(np.float64).view(np.int64) >> 52
    distance = np.subtract(column + 1023, top, dtype=np.int64).astype(kind)
    distance[left == 0] = _FAR if kind is np.int64 else _FAR_SMALL
    return np.asarray(distance)
