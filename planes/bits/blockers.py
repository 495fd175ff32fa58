"""Blockers: items that hide what lies behind them, with the rectangles that cover their masks.

Large masks are covered block by block, only near the shots. Rectangles that touch, also at corners, are a connected
part; those of a part follow each other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from ..common.backend import LruCache
from ..common.checks import Bools, Ints
from ..grid.spans import Box, begins, clipped, ragged, rectangles
from .cells import met_boxes

COVERS_BYTES, MASK_BYTES = 2**25, 200
"""Size of the caches of rectangles, and memory of a mask's beside its numbers, bytes."""

BLOCK = 128
"""Side of the blocks in which a larger mask is covered, px; only those near the shots are."""

ONE_BLOCK = 0, 0, 1, 1

NO_RECTS, NO_FLAGS = np.zeros((0, 4), np.int64), np.zeros(0, np.bool_)


class Blockers(NamedTuple):
    """Items that hide what lies behind them, front to back, with the rectangles that cover their masks.

    Parameters
    ----------
    rank : (B,) places in the stack
    box_xyxy : (B, 4) inclusive, px
    begin : (B + 1,) first rectangle of each
    rects : (R, 4) inclusive x_min, y_min, x_max, y_max, px, from the corner of the item's mask
    first : (R,) whether a rectangle is the first of a connected part
    categories, owner : (B,) category bits and owner; (0,) if all shots are blocked by all of them
    bounds : box beyond which no item has pixels; None if there is none
    until_exit : whether an item that the way begins in is ignored up to where the way leaves it
    """

    rank: Ints
    box_xyxy: Ints
    begin: Ints
    rects: Ints
    first: Bools
    categories: Ints
    owner: Ints
    bounds: Box | None
    until_exit: bool

    @property
    def nbytes(self) -> int:
        """Bytes of the columns, without the rectangles, which are kept with the masks."""
        return sum(int(column.nbytes) for column in (self.rank, self.box_xyxy, self.categories, self.owner))

    def rects_of(self, blocker: Ints, origin_xy: Ints) -> tuple[Ints, Ints, Bools]:
        """Rectangles of blockers (k,), seen from origins (k, 2), as (place in `blocker`, (m, 4), first of a part).

        No rectangle is empty. What the bounds leave of a part may not be connected, so each rectangle of an item that
        they cut counts as a part of its own.
        """
        place, number = ragged((self.begin[1:] - self.begin[:-1])[blocker])
        rect = self.begin[blocker][place] + number
        seen, first = self.rects[rect], self.first[rect]
        seen += np.tile(self.box_xyxy[blocker, :2], 2)[place]
        if self.bounds is not None:
            boxes = self.box_xyxy[blocker]
            first |= (boxes != clipped(boxes, self.bounds)).any(axis=1)[place]
            seen = clipped(seen, self.bounds)
            kept = ((seen[:, 0] <= seen[:, 2]) & (seen[:, 1] <= seen[:, 3])).nonzero()[0]
            place, seen, first = place[kept], seen[kept], first[kept]
        seen -= np.tile(origin_xy, 2)[place]
        return place, seen, first


class Cover(NamedTuple):
    """Rectangles (R, 4) of masks, from their corners, and whether each is the first of a connected part."""

    rects: Ints
    first: Bools

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return self.rects.nbytes + self.first.nbytes


class Covers:
    """Rectangles that cover masks, block by block, by the number of the mask; the last ones asked for are kept."""

    def __init__(self) -> None:
        self._of_block: LruCache[tuple[int, int, int], Cover] = LruCache(
            COVERS_BYTES, lambda cover: cover.nbytes + MASK_BYTES
        )
        self._of_masks: LruCache[bytes, tuple[Ints, Cover]] = LruCache(
            COVERS_BYTES, lambda made: made[0].nbytes + made[1].nbytes, len
        )

    def of(
        self, number: Ints, mask_of: Callable[[int], Bools], boxes_xyxy: Ints, near_xyxy: Box | None
    ) -> tuple[Ints, Cover]:
        """Begin (B + 1,) of the rectangles of each mask, and all rectangles.

        Parameters
        ----------
        number : (B,) numbers of masks
        mask_of : returns the mask (h, w) of a place in `number`
        boxes_xyxy : (B, 4) boxes of the masks
        near_xyxy : box that large masks are covered in, or a little more; None for all of them
        """

        def made() -> tuple[Ints, Cover]:
            counts, every = [0], [Cover(NO_RECTS, NO_FLAGS)]
            for row, mask in enumerate(number.tolist()):
                x, y, x_end, y_end = blocks.get(row, ONE_BLOCK)
                places = product(range(y, y_end), range(x, x_end))
                covers = [self._of_block.get((mask, *at), partial(_cover_of, mask_of, row, at)) for at in places]
                counts.append(sum(len(cover.rects) for cover in covers))
                every += covers
            rects, first = zip(*every, strict=True)
            return np.cumsum(counts), Cover(np.concatenate(rects), np.concatenate(first))

        blocks = _blocks_of_large(boxes_xyxy, near_xyxy)
        key = number.tobytes() + str(blocks).encode() if blocks else number.tobytes()
        return self._of_masks.get(key, made)


def _blocks_of_large(boxes_xyxy: Ints, near_xyxy: Box | None) -> dict[int, tuple[int, ...]]:
    """First, and last + 1, column and row of the blocks of large boxes (B, 4) that may meet a box, by their row."""
    size = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2]
    if size.max(initial=0) < BLOCK:
        return {}
    large = (size.max(axis=1) >= BLOCK).nonzero()[0]
    first, end = np.zeros((len(large), 2), np.int64), size[large] // BLOCK + 1
    if near_xyxy is not None:
        near = np.array(near_xyxy) - np.tile(boxes_xyxy[large, :2], 2)
        first, end = np.maximum(near[:, :2] // BLOCK, 0), np.minimum(near[:, 2:] // BLOCK + 1, end)
    return dict(zip(large.tolist(), map(tuple, np.concatenate([first, end], axis=1).tolist()), strict=True))


def _cover_of(mask_of: Callable[[int], Bools], row: int, block: tuple[int, int]) -> Cover:
    """Rectangles of a block of a mask, from the corner of the mask."""
    y, x = (BLOCK * place for place in block)
    rects = rectangles(mask_of(row)[y : y + BLOCK, x : x + BLOCK]) + np.array([x, y, x, y])
    return Cover(*in_parts(rects))


def in_parts(rects: Ints) -> tuple[Ints, Bools]:
    """Rectangles (k, 4), part by part, and whether each is the first of a connected part; corners may connect."""
    part = np.arange(len(rects))
    one, other = met_boxes(rects + np.array([-1, -1, 1, 1]), rects)
    while True:
        least = part.copy()
        np.minimum.at(least, one, part[other])
        least = least[least]
        if (least == part).all():
            break
        part = least
    order = np.argsort(part, kind="stable")
    return rects[order], begins(part[order])
