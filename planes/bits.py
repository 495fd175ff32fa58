"""Bit rows: 64 pixels of a row as one word, bit j for column j; a tile is up to 64 such rows.

Rows lie one after another in flat arrays, with empty rows around each tile or pattern, so that any row offset reads as
many rows without a test.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Ints

__all__ = ["PAD", "WORD", "Seen", "Words", "every_stretch", "packed", "rows_at", "rows_of"]

Words = npt.NDArray[np.uint64]
Kind = TypeVar("Kind", bound=np.generic)

WORD = 64
"""Columns of a tile, and rows at most."""

PAD = 32
"""Empty rows between seen tiles: patterns of so few rows are counted by their own."""


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


def packed(masks: Sequence[Bools]) -> Words:
    """Rows (n, 64) of masks (h, w), each of at most 64 x 64 pixels."""
    bits = np.zeros((len(masks), WORD, WORD), np.bool_)
    for own, mask in zip(bits, masks, strict=True):
        own[: mask.shape[0], : mask.shape[1]] = mask
    return np.packbits(bits.reshape(-1), bitorder="little").view("<u8").astype(np.uint64).reshape(-1, WORD)


def rows_of(words: npt.NDArray[Kind], height: int, begin: Ints) -> npt.NDArray[Kind]:
    """Rows (n, height) of a flat array from each of (n,) places on."""
    return rows_at(every_stretch(words, height), begin, height, words.dtype)


def every_stretch(words: npt.NDArray[Any], height: int) -> npt.NDArray[np.void]:
    """Stretches of so many numbers, of which each begins a number after the one before: each is one value.

    Some of them are picked in half the time that rows of a matrix take.
    """
    kind = np.dtype((np.void, words.itemsize * height))
    return np.ndarray((len(words) - height + 1,), kind, words, 0, words.strides)


def rows_at(every: npt.NDArray[np.void], begin: Ints, height: int, kind: np.dtype[Kind]) -> npt.NDArray[Kind]:
    """Some stretches as rows (n, height)."""
    return np.asarray(every[begin].view(kind)).reshape(len(begin), height)
