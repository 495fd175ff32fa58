"""Masks as bit rows: cut into tiles of up to 64 x 64 pixels, packed once for each mask, placed with their items."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Ints
from planes.bitrows import WORD, Words, packed
from planes.fronttoback import Pile
from planes.spans import ragged
from planes.stack import Stack

__all__ = ["TileAtlas", "Tiles"]

STRIDE = 3 * WORD
"""Words from one tile to the next: its rows with as many empty ones before and after."""

ATLAS_SLACK = 1024
"""Tiles no longer in use that an atlas keeps, beside as many as are."""

NO_FLAGS = np.zeros(0, np.bool_)


@dataclass(frozen=True, eq=False)
class Tiles:
    """The tiles of a stack, front to back, as columns.

    Parameters
    ----------
    rank : (T,) place in the stack of the item of each, rising
    left, top : (T,) where it lies on its item's mask, px
    size_wh : (T, 2) px, up to 64
    begin : (T,) its first row in `words`
    words : flat rows of all tiles
    whole : whether each item is one tile
    """

    rank: Ints
    left: Ints
    top: Ints
    size_wh: Ints
    begin: Ints
    words: Words
    whole: bool

    def __len__(self) -> int:
        return len(self.rank)

    def of(self, rank: Ints) -> tuple[Ints, Ints]:
        """Tiles of items of ranks (n,), as (place in `rank`, tile)."""
        if self.whole:
            return np.arange(len(rank)), rank
        begin = np.searchsorted(self.rank, rank)
        place, tile = ragged(np.searchsorted(self.rank, rank, side="right") - begin)
        return place, begin[place] + tile

    def each(self, told: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """What is told of items (M,), of their tiles (T,)."""
        return told if self.whole else told[self.rank]

    def boxes(self, items_xyxy: Ints) -> Ints:
        """Inclusive boxes (T, 4) of tiles, of the boxes (M, 4) of the items of the stack."""
        if self.whole:
            return items_xyxy
        corner = np.stack([items_xyxy[self.rank, 0] + self.left, items_xyxy[self.rank, 1] + self.top], axis=1)
        return np.concatenate([corner, corner + self.size_wh - 1], axis=1)

    def pile(self, stack: Stack) -> Pile:
        """The tiles where they lie, with what decides who hits them; `stack` is the one whose they are."""
        occluder = self.each(stack.occluder) if stack.has_occluders else NO_FLAGS
        whose = self.each(stack.categories), self.each(stack.owner)
        return Pile(self.rank, self.boxes(stack.box_xyxy), self.begin, self.words, occluder, *whose)


class TileAtlas:
    """Tiles of masks, by the number of the mask; those no longer in use are dropped in time."""

    def __init__(self) -> None:
        self.words: Words = np.zeros(4 * STRIDE, np.uint64)
        self._used = 0
        self._first: dict[int, int] = {}
        self._count: dict[int, int] = {}
        self._columns = np.zeros((4, 4), np.int64)  # left, top, width, height
        self._last: tuple[int, Tiles] | None = None
        self._lock = threading.Lock()

    def known(self, forms: int) -> Tiles | None:
        """Tiles of the last stack, if it was of these forms."""
        last = self._last
        return last[1] if last is not None and last[0] == forms else None

    def tiles(self, masks: Iterable[tuple[int, Bools]], number: Ints, forms: int) -> Tiles:
        """Tiles of the items of a stack.

        Parameters
        ----------
        masks : number and mask (h, w) of all that are in use
        number : (M,) of the mask of each item
        forms : of the stack: another of the same has the same tiles
        """
        with self._lock:
            if self._last is None or self._last[0] != forms:
                self._last = forms, self._listed(masks, number)
            return self._last[1]

    def _listed(self, masks: Iterable[tuple[int, Bools]], number: Ints) -> Tiles:
        distinct, which = np.unique(number, return_inverse=True)
        kept = sum(self._count[uid] for uid in distinct.tolist() if uid in self._first)
        if self._used > 2 * kept + ATLAS_SLACK:
            self._first, self._used = {}, 0
            self.words, self._columns = np.zeros(4 * STRIDE, np.uint64), np.zeros((4, 4), np.int64)
        missing = set(distinct.tolist()) - self._first.keys()
        for uid, mask in masks if missing else ():
            if uid in missing and uid not in self._first:
                self._append(uid, mask)
        first = np.array([self._first[uid] for uid in distinct.tolist()], np.int64)[which]
        count = np.array([self._count[uid] for uid in distinct.tolist()], np.int64)[which]
        rank, place = ragged(count)
        slot = first[rank] + place
        left, top, width, height = self._columns[slot].T
        size = np.stack([width, height], axis=1)
        whole = len(rank) == len(number) and not left.any() and not top.any()
        return Tiles(rank, left, top, size, slot * STRIDE + WORD, self.words, whole)

    def _append(self, uid: int, mask: Bools) -> None:
        """Cut one mask into tiles, without those that have no pixel."""
        self._first[uid] = self._used
        for top in range(0, mask.shape[0], WORD):
            for left in range(0, mask.shape[1], WORD):
                part = mask[top : top + WORD, left : left + WORD]
                if part.any():
                    self._put(left, top, part)
        self._count[uid] = self._used - self._first[uid]

    def _put(self, left: int, top: int, part: Bools) -> None:
        if (self._used + 1) * STRIDE > len(self.words):
            grown = np.zeros(2 * len(self.words), np.uint64)
            grown[: len(self.words)] = self.words
            self.words = grown  # tiles that were handed out keep the old rows
            self._columns = np.concatenate([self._columns, np.zeros_like(self._columns)])
        begin = self._used * STRIDE + WORD
        self.words[begin : begin + part.shape[0]] = packed(part)
        self._columns[self._used] = left, top, part.shape[1], part.shape[0]
        self._used += 1
