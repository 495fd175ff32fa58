"""The visible set: the bit rows of each object without the pixels that items in front of it cover.

A shot hits the front item of a pixel and nothing else, so its hits on an object are the object's visible pixels that
it covers; a shot that pierces hits all pixels that no occluder hides. Visible pixels depend on the view of shots, not
on their positions: they are computed once for a version of a scene, or only for the objects near the shots.
"""

from __future__ import annotations

import numpy as np

from ..common.backend import LruCache
from ..common.checks import Bools, Ints
from ..grid.spans import Box
from ..scene.derived import NEVER, Derivative, View
from ..scene.items import Items, Stack
from . import bit_rows
from .bit_rows import WORD, Words
from .cells import Cells, cells_of, met_boxes
from .front_to_back import OrderedTiles
from .tiles import Tiles


def sides_of(rows: Words) -> Ints:
    """Inclusive boxes (V, 4) of the pixels in rows (V, height) of tiles; (0, 0, -1, -1) of an empty tile."""
    sides = np.empty((len(rows), 4), np.int64)
    filled = rows != 0
    columns = np.bitwise_or.reduce(rows, axis=1)
    sides[:, 0] = np.bitwise_count(~columns & (columns - np.uint64(1)))
    sides[:, 1], sides[:, 3] = filled.argmax(axis=1), rows.shape[1] - 1 - filled[:, ::-1].argmax(axis=1)
    for bits in (1, 2, 4, 8, 16, 32):
        columns |= columns >> np.uint64(bits)
    sides[:, 2] = np.bitwise_count(columns)
    sides[:, 2] -= 1
    sides[columns == 0] = 0, 0, -1, -1
    return sides


CELLS_BYTES = 2**25
"""Size of the cache of cells of a visible set, for the last few boxes of patterns, bytes."""

WITHOUT_MOST = 128
"""Most placements of a call that are compared with all visible tiles; making cells takes about as long."""

PAIRS_MOST = 2**20
"""Most pairs of placements and tiles that a call compares without cells."""

SHOT_BITS = 4
"""Cells of shot positions have sides of 2**SHOT_BITS px; larger ones list more boxes that no pattern meets."""


class VisibleSet:
    """The visible pixels of all objects of one version of a scene, and cells to look them up; it never changes.

    Parameters
    ----------
    stack, tiles, bounds : those of the scene at that version
    view : what the shots accept
    """

    def __init__(self, stack: Stack, tiles: Tiles, bounds: Box | None, view: View) -> None:
        there = view.accepts(stack)
        boxes = tiles.boxes(stack.box_xyxy)
        occluders = there & stack.occluder if stack.has_occluders else np.zeros_like(there)
        wanted = np.flatnonzero((occluders if view.of_occluders else there & ~occluders)[tiles.rank])
        blocks = (occluders if view.pierce else there)[tiles.rank]
        rows = _rows(tiles, boxes, bounds, wanted, *in_front(boxes, wanted, blocks))
        self.seen = cropped(tiles.rank[wanted], boxes[wanted], rows)
        self._cells: LruCache[tuple[int, ...], Cells] = LruCache(CELLS_BYTES, lambda made: made.nbytes)

    def cells(self, reach_xyxy: Ints) -> Cells:
        """Tiles that a pattern with this box may meet, by cells of its position; kept for the last few boxes."""
        boxes = self.seen.box_xyxy
        return self._cells.get(tuple(reach_xyxy.tolist()), lambda: cells_of(boxes, reach_xyxy, SHOT_BITS))

    def cells_for(self, boxes_xyxy: Ints, placements: int) -> tuple[Cells | None, int]:
        """Cells for placements of patterns with boxes (n, 4), and the bytes newly made; None for few placements.

        Those look at all tiles.
        """
        reach_xyxy = _reach(boxes_xyxy)
        reach = tuple(reach_xyxy.tolist())
        if reach in self._cells.values:
            return self.cells(reach_xyxy), 0
        if placements <= WITHOUT_MOST and placements * len(self.seen.rank) <= PAIRS_MOST:
            return None, 0
        made = self.cells(reach_xyxy)
        return made, made.nbytes

    @property
    def nbytes(self) -> int:
        """Bytes of the visible tiles."""
        seen = self.seen
        return sum(int(column.nbytes) for column in (seen.rank, seen.box_xyxy, seen.begin, seen.words))


def _reach(boxes_xyxy: Ints) -> Ints:
    """Box around all patterns; around several it is rounded outward, so that its cells serve the next call, too."""
    if len(boxes_xyxy) == 1:
        return np.asarray(boxes_xyxy[0])
    low, high = boxes_xyxy[:, :2].min(axis=0), boxes_xyxy[:, 2:].max(axis=0)
    return np.concatenate([low >> SHOT_BITS << SHOT_BITS, -(-high >> SHOT_BITS << SHOT_BITS)])


class Visible(Derivative):
    """The visible set of one view of a scene; changes of items that decide no hit leave it as it is.

    Parameters
    ----------
    bounds : inclusive box of the world, or None
    """

    def __init__(self, view: View, bounds: Box | None) -> None:
        super().__init__()
        self._view, self._bounds = view, bounds
        self._decided = NEVER
        self._made: VisibleSet | None = None

    def made(self, items: Items) -> VisibleSet | None:
        """The visible set of the items as they are now, if it is made."""
        if self._seen != items.version:
            with self._lock:
                if self._decided != items.decided:
                    self._made, self.regret, self._decided = None, 0.0, items.decided
                self._seen = items.version
        return self._made

    def read(self, items: Items) -> VisibleSet:
        """The visible set of the items as they are now."""
        found = self.made(items)
        if found is None:
            found = VisibleSet(items.stack(), items.tiles(), self._bounds, self._view)
            with self._lock:
                self._made, self.regret = found, 0.0
        return found


def in_front(boxes_xyxy: Ints, tiles: Ints, blocks: Bools) -> tuple[Ints, Ints]:
    """Pairs of a tile and a tile in front of it whose boxes meet, as (place in `tiles`, tile in front), sorted.

    Parameters
    ----------
    boxes_xyxy : (T, 4) boxes of all tiles, front to back
    tiles : (n,) the tiles that may be covered
    blocks : (T,) whether a tile can cover others
    """
    front = np.arange(len(boxes_xyxy)) if blocks.all() else np.flatnonzero(blocks)
    place, other = met_boxes(boxes_xyxy[tiles], boxes_xyxy[front])
    before = (front[other] < tiles[place]).nonzero()[0]
    return place[before], front[other[before]]


def _rows(tiles: Tiles, boxes_xyxy: Ints, bounds: Box | None, which: Ints, of: Ints, front: Ints) -> Words:
    """Visible pixels of tiles, as rows (V, height).

    Parameters
    ----------
    boxes_xyxy : (T, 4) boxes of all tiles
    bounds : bounds of the scene; pixels beyond them cannot be hit
    which : (V,) the tiles to look at
    of, front : (n,) pairs of a place in `which`, sorted, and a tile that covers it
    """
    height = int((tiles.inside_xyxy[which, 3] - tiles.inside_xyxy[which, 1]).max(initial=0)) + 1
    boxes = boxes_xyxy[which]
    right, down = (boxes_xyxy[front, :2] - boxes[of, :2]).T
    rows = bit_rows.rows_of(tiles.words, height, tiles.begin[which])
    bit_rows.take_away(rows, tiles.words, of, tiles.begin[front] - down, right)
    if bounds is not None:
        bit_rows.cut_off(rows, boxes[:, 0], boxes[:, 1], bounds)
    return rows


def cropped(rank: Ints, boxes_xyxy: Ints, rows: Words) -> OrderedTiles:
    """Tiles with a visible pixel, each cropped to the box of its visible pixels.

    Parameters
    ----------
    rank : (V,) place in the stack of the item of each tile
    boxes_xyxy : (V, 4) boxes of the tiles
    rows : (V, height) their visible pixels
    """
    sides = sides_of(rows)
    kept = np.flatnonzero(sides[:, 2] >= 0)
    sides, corner = sides[kept], boxes_xyxy[kept, :2]
    boxes = sides + np.concatenate([corner, corner], axis=1)
    whole = _laid_out(rank[kept], boxes, rows[kept] >> sides[:, :1].astype(np.uint64))
    return whole._replace(begin=whole.begin + sides[:, 1])


def _laid_out(rank: Ints, boxes_xyxy: Ints, rows: Words) -> OrderedTiles:
    """Rows (V, height) of tiles as one flat array, with WORD empty rows around each tile."""
    count, height = rows.shape
    stride = height + WORD
    words = np.zeros(count * stride + WORD, np.uint64)
    words[WORD:].reshape(count, stride)[:, :height] = rows
    return OrderedTiles(rank, boxes_xyxy, np.arange(count) * stride + WORD, words)
