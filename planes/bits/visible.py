"""The visible set: the bit rows of each object without the pixels that items in front of it cover.

A shot hits the front item of a pixel and nothing else, so its hits on an object are the object's visible pixels that
it covers; a shot that pierces hits all pixels that no occluder hides. Visible pixels depend on the view of shots, not
on their positions: they are computed once for a version of a scene, or only for the objects near the shots.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from ..common.backend import LruCache, kernels_of
from ..common.checks import Bools, Ints
from ..common.limits import ALL
from ..grid.spans import Box
from ..scene.items import Items, Stack
from . import bit_rows, cells
from .bit_rows import WORD, Words
from .cells import Cells
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


def moved(rows: Words, kept: Ints, sides: Ints, height: int) -> Words:
    """Rows (n, height) of tiles, moved so that the box of their pixels begins in row 0 and column 0.

    Parameters
    ----------
    rows : (V, h) rows of all tiles
    kept : (n,) tiles to move
    sides : (n, 4) boxes of their pixels, no higher than `height`
    """
    step = np.arange(height)
    inside = step <= (sides[:, 3] - sides[:, 1])[:, None]
    row = np.where(inside, step + (sides[:, 1] + kept * rows.shape[1])[:, None], 0)
    found = rows.reshape(-1).take(row)
    found >>= sides[:, :1].astype(np.uint64)
    found *= inside
    return found


VIEWS_MOST = 4
"""Most visible sets that a scene keeps, one for each view."""

CELLS_BYTES = 2**25
"""Size of the cache of cells of a visible set, for the last few boxes of patterns, bytes."""

WITHOUT_MOST = 128
"""Most placements of a call that are compared with all visible tiles; making cells takes about as long."""

PAIRS_MOST = 2**20
"""Most pairs of placements and tiles that a call compares without cells."""

SHOT_BITS = 4
"""Cells of shot positions have sides of 2**SHOT_BITS px; larger ones list more boxes that no pattern meets."""


class View(NamedTuple):
    """What shots accept: whether they pierce, the category bits, and the owners whose items they skip."""

    pierce: bool
    accept: int
    exclude: tuple[int, ...]

    def accepts(self, stack: Stack) -> Bools:
        """Which items (M,) of a stack such shots accept."""
        if self.accept == ALL and not (self.exclude or stack.has_unmet):
            return np.ones(len(stack), np.bool_)
        there = (stack.categories & self.accept) != 0
        for owner in self.exclude:
            there &= stack.owner != owner
        return np.asarray(there)


class VisibleSet:
    """The visible pixels of all objects of one version of a scene, and cells to look them up; it never changes.

    Parameters
    ----------
    stack, tiles, bounds : those of the scene at that version
    view : what the shots accept
    """

    # house: hit rule of areas
    def __init__(self, stack: Stack, tiles: Tiles, bounds: Box | None, view: View) -> None:
        there = view.accepts(stack)
        boxes = tiles.boxes(stack.box_xyxy)
        occluders = there & stack.occluder if stack.has_occluders else np.zeros_like(there)
        objects = np.flatnonzero((there & ~occluders)[tiles.rank])
        blocks = (occluders if view.pierce else there)[tiles.rank]
        rows = _rows(tiles, boxes, bounds, objects, *in_front(boxes, objects, blocks))
        self.seen = cropped(tiles.rank[objects], boxes[objects], rows)
        self._cells: LruCache[tuple[int, ...], Cells] = LruCache(CELLS_BYTES, lambda made: made.nbytes)

    def cells(self, reach_xyxy: Ints) -> Cells:
        """Tiles that a pattern with this box may meet, by cells of its position; kept for the last few boxes."""
        boxes = self.seen.box_xyxy
        return self._cells.get(tuple(reach_xyxy.tolist()), lambda: cells.cells_of(boxes, reach_xyxy, SHOT_BITS))

    def cells_for(self, reach_xyxy: Ints, placements: int) -> tuple[Cells | None, int]:
        """Cells for a number of placements, and the bytes newly made; None for a few, which look at all tiles."""
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


class VisibleSets:
    """Visible sets of a scene for the last few views, and the time that calls lost for want of one.

    Threads may read them as long as none changes the scene.
    """

    def __init__(self) -> None:
        self._version = -1
        self._kept: dict[View, VisibleSet] = {}
        self._regret: dict[View, float] = {}
        self._lock = threading.Lock()

    def kept(self, view: View, version: int) -> VisibleSet | None:
        """The visible set of a view and version, if it is made."""
        return self._kept.get(view) if self._version == version else None

    def worth_building(self, view: View, version: int, lost: float, cost: float) -> bool:
        """Whether a view's calls, including this one, have lost as much time as the visible set costs.

        So the total is at most twice that of the better choice (Karlin et al., "Competitive snoopy caching", 1988).
        The count begins anew when a visible set is made, or the scene changes.
        """
        with self._lock:
            self._forget(version)
            self._regret[view] = self._regret.get(view, 0.0) + max(lost, 0.0)
            return self._regret[view] > cost

    def regret(self, view: View, version: int) -> float:
        """The time that a view's calls have lost for want of its visible set, ns."""
        return self._regret.get(view, 0.0) if self._version == version else 0.0

    def read(self, view: View, items: Items, bounds: Box | None) -> VisibleSet:
        """The visible set of the items as they are now, within the bounds of the scene."""
        found = self.kept(view, items.version)
        if found is None:
            found = VisibleSet(items.stack(), items.tiles(), bounds, view)
            with self._lock:
                self._forget(items.version)
                self._regret[view] = 0.0
                self._kept = dict([*self._kept.items(), (view, found)][-VIEWS_MOST:])
        return found

    def _forget(self, version: int) -> None:
        if self._version != version:
            self._kept, self._regret, self._version = {}, {}, version  # in this order: `kept` holds no lock


def in_front(boxes_xyxy: Ints, tiles: Ints, blocks: Bools) -> tuple[Ints, Ints]:
    """Pairs of a tile and a tile in front of it whose boxes meet, as (place in `tiles`, tile in front), sorted.

    Parameters
    ----------
    boxes_xyxy : (T, 4) boxes of all tiles, front to back
    tiles : (n,) the tiles that may be covered
    blocks : (T,) whether a tile can cover others
    """
    front = np.arange(len(boxes_xyxy)) if blocks.all() else np.flatnonzero(blocks)
    place, other = kernels_of(cells).met_boxes(boxes_xyxy[tiles], boxes_xyxy[front])
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
    height = -(-int(tiles.size_wh[which, 1].max(initial=1)) // 8) * 8
    boxes = boxes_xyxy[which]
    right, down = (boxes_xyxy[front, :2] - boxes[of, :2]).T
    rows = kernels_of(bit_rows).visible(tiles.words, height, tiles.begin[which], of, tiles.begin[front] - down, right)
    if bounds is not None:
        bit_rows.cut_off(rows, boxes[:, 0], boxes[:, 1], bounds)
    return np.asarray(rows)


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
    sides = sides[kept]
    height = -(-int((sides[:, 3] - sides[:, 1]).max(initial=0) + 1) // 8) * 8
    corner = boxes_xyxy[kept, :2]
    return _laid_out(rank[kept], sides + np.concatenate([corner, corner], axis=1), moved(rows, kept, sides, height))


def _laid_out(rank: Ints, boxes_xyxy: Ints, rows: Words) -> OrderedTiles:
    """Rows (V, height) of tiles as one flat array, with WORD empty rows around each tile."""
    count, height = rows.shape
    stride = height + WORD
    words = np.zeros(count * stride + WORD, np.uint64)
    words[WORD:].reshape(count, stride)[:, :height] = rows
    return OrderedTiles(rank, boxes_xyxy, np.arange(count) * stride + WORD, words)
