"""Patterns as bit rows: the windows of 64 columns in which tiles meet them; and as rows in one integer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planes.bigrows import BigPattern, big_pattern
from planes.bitrows import Windows
from planes.bits import WORD, Words
from planes.kept import Kept
from planes.spans import Spans
from planes.strips import strips_of
from weapons.pattern import Pattern

__all__ = ["big_of", "columns_of", "fits", "windows_of"]

TABLE_BYTES_MOST = 2**22
"""All shifts of a pattern are not made beyond it: in a larger table each window is a miss of the cache."""

PATTERN_BYTES_MOST, PATTERNS_BYTES_MOST = 2**22, 2**26
"""A pattern whose rows of words would be larger, or all of a call, are counted run by run."""

OFTEN = 64
"""Placements of a pattern, in all calls, that are worth all of its shifts."""

WINDOW_CACHE_BYTES = 2**26
"""Windows kept for the next call, and columns of words kept for windows with other patterns, bytes."""

_kept: Kept[tuple[tuple[Pattern, ...], bool], Windows] = Kept(
    WINDOW_CACHE_BYTES, lambda windows: windows.words.nbytes + windows.box_xyxy.nbytes
)

_kept_columns: Kept[Pattern, Words] = Kept(WINDOW_CACHE_BYTES, lambda words: words.nbytes)

_kept_bigs: Kept[Pattern, BigPattern] = Kept(WINDOW_CACHE_BYTES, lambda big: big.nbytes)

_FULL = np.uint64(2**64 - 1)


def fits(patterns: Sequence[Pattern]) -> bool:
    """Whether windows of patterns, all at once, may be made."""
    sizes = [pattern.window_bytes for pattern in patterns]
    return max(sizes, default=0) <= PATTERN_BYTES_MOST and sum(sizes) <= PATTERNS_BYTES_MOST


def windows_of(patterns: Sequence[Pattern], placements: int) -> Windows:
    """Windows of patterns; those of the last calls are kept.

    Parameters
    ----------
    placements : for which all shifts would serve; 0: they would not
    """
    often = bool(placements) and len(patterns) == 1 and patterns[0].window_bytes * WORD <= TABLE_BYTES_MOST
    if often:
        told = vars(patterns[0])
        told["placed"] = placed = told.get("placed", 0) + placements
        often = placed > OFTEN
    return _kept.get((tuple(patterns), often), lambda: _made(patterns, often))


def big_of(pattern: Pattern) -> BigPattern:
    """A pattern as integer rows; those of the last calls are kept."""
    return _kept_bigs.get(pattern, lambda: big_pattern(pattern.spans))


def _made(patterns: Sequence[Pattern], often: bool) -> Windows:
    boxes = np.array([pattern.spans.box_xyxy or (0, 0, -1, -1) for pattern in patterns])
    strips = strips_of([pattern.strip for pattern in patterns], boxes)
    columns = [_columns(pattern) for pattern in patterns]
    rows = np.array([words.shape[1] for words in columns])
    if often:
        words = columns[0]
        shifts = np.arange(WORD, dtype=np.uint64)[:, None]
        table = (words[:-1, None] >> shifts) | (words[1:, None] << (np.uint64(WORD) - shifts))
        return Windows(boxes, np.array([WORD]), WORD * rows, table.reshape(-1), words.shape[1], strips)
    first = np.cumsum([0, *(words.size for words in columns[:-1])]) + WORD
    return Windows(boxes, first, rows, np.concatenate([words.reshape(-1) for words in columns]), 0, strips)


def _columns(pattern: Pattern) -> Words:
    """Those of `columns_of`, of a pattern: other calls have it among others."""
    return _kept_columns.get(pattern, lambda: columns_of(pattern.spans))


def columns_of(spans: Spans) -> Words:
    """Words (columns of words, rows) of a pattern, with 63 empty pixels before it and 64 empty rows around it."""
    x, y, x_max, y_max = spans.box_xyxy or (0, 0, -1, -1)
    columns = (WORD - 2 + x_max - x + 1) // WORD + 2
    made = np.zeros((columns, y_max - y + 1 + 2 * WORD), np.uint64)
    column = x - (WORD - 1) + WORD * np.arange(columns)
    first, last = (np.clip(end[:, None] - column, 0, WORD).view(np.uint64) for end in (spans.x_first, spans.x_last + 1))
    row = np.flatnonzero(np.diff(spans.y, prepend=y - 1))
    if len(row):
        runs = (_FULL << first) & ~(_FULL << last)  # by 64 all is shifted out
        made[:, spans.y[row] - y + WORD] = np.bitwise_or.reduceat(runs, row, axis=0).T
    return made
