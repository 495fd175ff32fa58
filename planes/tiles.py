"""Masks as bit rows: cut into tiles of up to 64 x 64 pixels, packed once for each mask, placed with their items."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Ints
from planes.bigrows import BigTiles
from planes.bits import WORD, Words, packed
from planes.fronttoback import Pile
from planes.spans import ragged
from planes.stack import Stack

__all__ = ["TileAtlas", "Tiles"]

STRIDE = 3 * WORD
"""Words from one tile to the next: its rows with as many empty ones before and after."""

ATLAS_SLACK = 1024
"""Tiles no longer in use that an atlas keeps, beside as many as are."""

STRIDES_MOST = 8
"""Strides of which tiles are kept as integers."""

PACKED_AT_ONCE = 1024
"""Tiles whose pixels, 4 KB each, are packed in one go."""

NO_FLAGS, NO_NUMBERS = np.zeros(0, np.bool_), np.zeros(0, np.int64)


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
    bigs : tiles as integers, by their stride
    """

    rank: Ints
    left: Ints
    top: Ints
    size_wh: Ints
    begin: Ints
    words: Words
    whole: bool
    bigs: dict[int, BigTiles]

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

    def big(self, stride: int) -> BigTiles:
        """Tiles as integer rows of a stride, by `begin`."""
        known = self.bigs.get(stride)
        if known is None:
            if len(self.bigs) >= STRIDES_MOST:
                self.bigs.clear()
            known = self.bigs[stride] = BigTiles(stride)
        return known

    def pile(self, stack: Stack) -> Pile:
        """The tiles where they lie, with what decides who hits them; `stack` is the one whose they are."""
        occluder = self.each(stack.occluder) if stack.has_occluders else NO_FLAGS
        whose = self.each(stack.categories), self.each(stack.owner)
        return Pile(self.rank, self.boxes(stack.box_xyxy), self.begin, self.words, occluder, *whose)


class TileAtlas:
    """Tiles of masks, by the number of the mask; those no longer in use are dropped in time.

    Each has a slot of STRIDE words, which is written once: tiles that were handed out stay.
    """

    def __init__(self) -> None:
        self.words: Words = np.zeros(4 * STRIDE, np.uint64)
        self._columns = np.zeros((4, 4), np.int64)  # left, top, width, height
        self._used = self._enough = 0  # slots; with more than enough, tiles no longer in use are looked for
        self._places: dict[int, tuple[int, int]] = {}  # of each mask: its first slot, and how many
        self._number, self._slots = NO_NUMBERS, np.zeros((0, 2), np.int64)  # of the last stack: masks, their places
        self._last: tuple[int, Tiles] | None = None
        self._bigs: dict[int, BigTiles] = {}
        self._lock = threading.Lock()

    def known(self, forms: int) -> Tiles | None:
        """Tiles of the last stack, if it was of these forms."""
        last = self._last
        return last[1] if last is not None and last[0] == forms else None

    def tiles(self, mask_of: Callable[[int], Bools], number: Ints, forms: int) -> Tiles:
        """Tiles of the items of a stack.

        Parameters
        ----------
        mask_of : tells the mask (h, w) of the item of a rank
        number : (M,) of the mask of each item; equal masks may have the same
        forms : of the stack: another of the same has the same tiles
        """
        with self._lock:
            if self._last is None or self._last[0] != forms:
                self._last = forms, self._listed(*self._found(mask_of, number))
            return self._last[1]

    def _listed(self, first: Ints, count: Ints) -> Tiles:
        """Tiles of masks, each of some slots from a first one on."""
        whole = bool((count == 1).all())
        rank, place = (np.arange(len(count)), 0) if whole else ragged(count)
        slot = first[rank] + place
        columns = self._columns.take(slot, axis=0)
        whole &= not columns[:, :2].any()
        left, top, size = columns[:, 0], columns[:, 1], columns[:, 2:]
        return Tiles(rank, left, top, size, slot * STRIDE + WORD, self.words, whole, self._bigs)

    def _found(self, mask_of: Callable[[int], Bools], number: Ints) -> Ints:
        """First slot and count (2, M) of each mask of a stack; only what the last stack had not is looked for."""
        if len(self._number) != len(number) or self._used > self._enough:
            self._drop_unused(number)
            self._number, self._slots = np.full(len(number), -1), np.zeros((len(number), 2), np.int64)
        changed = np.flatnonzero(self._number != number)
        numbers = number[changed].tolist()
        missing = {one: rank for one, rank in zip(numbers, changed.tolist(), strict=True) if one not in self._places}
        self._add([(one, mask_of(rank)) for one, rank in missing.items()])
        self._slots[changed] = np.array([self._places[one] for one in numbers], np.int64).reshape(-1, 2)
        self._number = number
        return self._slots.T

    def _drop_unused(self, number: Ints) -> None:
        """Keep only the tiles of some masks, if that halves the atlas."""
        used = {one: self._places[one] for one in sorted(set(number.tolist())) if one in self._places}
        first, count = np.array(list(used.values()), np.int64).reshape(-1, 2).T
        kept = int(count.sum())
        self._enough = 2 * kept + ATLAS_SLACK
        if self._used <= self._enough:
            return
        which, place = ragged(count)
        slots, words, columns = first[which] + place, self.words.reshape(-1, STRIDE), self._columns
        self._allot(max(2 * kept, 4))
        self.words.reshape(-1, STRIDE)[:kept], self._columns[:kept] = words[slots], columns[slots]
        begin = (np.cumsum(count) - count).tolist()
        self._places = dict(zip(used, zip(begin, count.tolist(), strict=True), strict=True))
        self._used, self._bigs = kept, {}

    def _allot(self, slots: int) -> None:
        self.words, self._columns = np.zeros(slots * STRIDE, np.uint64), np.zeros((slots, 4), np.int64)

    def _add(self, masks: Sequence[tuple[int, Bools]]) -> None:
        """Cut masks into tiles, without those that have no pixel."""
        parts = [
            (which, left, top, mask[top : top + WORD, left : left + WORD])
            for which, (_, mask) in enumerate(masks)
            for top in range(0, mask.shape[0], WORD)
            for left in range(0, mask.shape[1], WORD)
        ]
        begin, count = self._used, np.zeros(len(masks), np.int64)
        for first in range(0, len(parts), PACKED_AT_ONCE):
            count += np.bincount(self._put(parts[first : first + PACKED_AT_ONCE]), minlength=len(masks))
        places = zip((begin + np.cumsum(count) - count).tolist(), count.tolist(), strict=True)
        self._places.update(zip((number for number, _ in masks), places, strict=True))

    def _put(self, parts: Sequence[tuple[int, int, int, Bools]]) -> Ints:
        """Pack parts (h, w) of masks, each from some left and top on, into the next slots; tell whose each is."""
        rows = packed([part for *_, part in parts])
        columns = np.array([(which, left, top, *part.shape[::-1]) for which, left, top, part in parts])
        full = np.flatnonzero(rows.any(axis=1))
        end = self._used + len(full)
        if end > len(self._columns):
            old = self.words, self._columns
            self._allot(max(end, 2 * len(old[1])))
            self.words[: len(old[0])], self._columns[: len(old[1])] = old
        self.words.reshape(-1, STRIDE)[self._used : end, WORD : 2 * WORD] = rows[full]
        self._columns[self._used : end] = columns[full, 1:]
        self._used = end
        return np.asarray(columns[full, 0])
