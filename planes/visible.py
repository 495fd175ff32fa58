"""What of each object can be seen by a shot: its bit rows without those of the items in front.

A shot that accepts all items hits the front item of a pixel and nothing else, so what it hits of an object is what it
covers of the object's visible pixels; one that pierces hits all that no occluder hides. What is visible hangs on no
shot: it is worked out once for a version of a scene, or only for the objects that shots come near.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from planes import bitrows, cells, cropping
from planes.arrays import Bools, Ints
from planes.bits import PAD, Seen, Words
from planes.cells import Cells
from planes.items import Items, Stack
from planes.kept import Kept, once
from planes.nearest import Beside, beside_of
from planes.spans import Box
from planes.tiles import Tiles
from planes.twins import kernels_of

__all__ = ["Composition", "Compositions", "View", "cropped", "in_front", "seen_of"]

VIEWS_MOST = 4
"""Compositions that a scene keeps: shots that accept other items see others."""

CELLS_BYTES = 2**25
"""Cells that a composition keeps for the last few boxes of patterns, bytes."""

WITHOUT_MOST = 128
"""So many placements are compared with all tiles that can be seen in the time that it takes to list those by cells."""

PAIRS_MOST = 2**20
"""Pairs of placements and tiles that a call compares like that, at most."""

SHOT_BITS = 4
"""Of the side of the cells of shot positions: 16 px; in larger ones more boxes are listed that no pattern meets."""


class View(NamedTuple):
    """What shots that see alike accept: whether they pierce, category bits, and owners that are passed over."""

    pierce: bool
    accept: int
    exclude: tuple[int, ...]

    def accepts(self, stack: Stack) -> Bools:
        """Which items (M,) of a stack are there at all for such shots."""
        there = (stack.categories & self.accept) != 0
        for owner in self.exclude:
            there &= stack.owner != owner
        return np.asarray(there)


class Composition:
    """All that can be seen of the objects of one version of a scene, and where to look for it; it never changes.

    Parameters
    ----------
    stack, tiles : of the version
    bounds : of the scene
    view : of the shots
    """

    def __init__(self, stack: Stack, tiles: Tiles, bounds: Box | None, view: View) -> None:
        there = view.accepts(stack)
        boxes = tiles.boxes(stack.box_xyxy)
        objects = np.flatnonzero((there & ~stack.occluder)[tiles.rank])
        blocks = (there & stack.occluder if view.pierce else there)[tiles.rank]
        rows = _rows(tiles, boxes, bounds, objects, *in_front(boxes, objects, blocks))
        self.seen = cropped(tiles.rank[objects], boxes[objects], rows)
        self.ids = stack.ids[self.seen.rank]
        self._cells: Kept[tuple[int, ...], Cells] = Kept(CELLS_BYTES, lambda made: made.nbytes)
        self._without = 0

    @once
    def beside(self) -> Beside:
        """Distances along the rows of what is seen: with them the nearest pixel to the origin of a disc is found."""
        return beside_of(self.seen)

    def cells(self, reach_xyxy: Ints) -> Cells:
        """What patterns of a box may meet, by where they are placed; those of the last few boxes are kept."""
        make = kernels_of(cells).cells_of
        return self._cells.get(tuple(reach_xyxy.tolist()), lambda: make(self.seen.box_xyxy, reach_xyxy, SHOT_BITS))

    def cells_for(self, reach_xyxy: Ints, placements: int) -> tuple[Cells, int]:
        """The same for so many placements, and the bytes that were made; where few ask for a box, one cell with all.

        When so many did with that as take as long as lists to be made, those of the next box are made.
        """
        reach = tuple(reach_xyxy.tolist())
        if reach in self._cells.values:
            return self.cells(reach_xyxy), 0
        self._without += placements
        if self._without <= WITHOUT_MOST and placements * len(self.seen.rank) <= PAIRS_MOST:
            return self._everything(*reach), 0
        self._without = 0
        made = self.cells(reach_xyxy)
        return made, made.nbytes

    def _everything(self, left: int, top: int, right: int, low: int) -> Cells:
        """One cell with all tiles, where a pattern of a box may meet any."""
        x, y, x_max, y_max = self._around
        size = max(x_max - left - (x - right), y_max - top - (y - low))
        return Cells(x - right, y - low, size.bit_length(), 1, 1, *self._listed)

    @once
    def _listed(self) -> tuple[Ints, Ints]:
        """Where the list of that cell begins and ends, and the list."""
        count = len(self.seen.rank)
        return np.array([0, count]), np.arange(count)

    @once
    def _around(self) -> Box:
        """Box around all tiles."""
        low = self.seen.box_xyxy[:, :2].min(axis=0, initial=0)
        high = self.seen.box_xyxy[:, 2:].max(axis=0, initial=0)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    @property
    def nbytes(self) -> int:
        """Bytes of what is seen."""
        seen = self.seen
        return sum(int(column.nbytes) for column in (seen.rank, seen.box_xyxy, seen.begin, seen.words))


class Compositions:
    """Compositions of a scene for the last few views, and what those who did without them lost.

    Threads may ask for those of a scene that none of them changes.
    """

    def __init__(self) -> None:
        self._version = -1
        self._kept: dict[View, Composition] = {}
        self._missed: dict[View, float] = {}
        self._lock = threading.Lock()

    def kept(self, view: View, version: int) -> Composition | None:
        """The composition of a version, if it is there."""
        return self._kept.get(view) if self._version == version else None

    def pays(self, view: View, version: int, lost: float, cost: float) -> bool:
        """Whether a view has lost as much as a composition costs, with what it would lose now.

        So the cost is never more than twice that of the better choice (Karlin et al., "Competitive snoopy caching",
        1988). One that had a composition, and finds it gone, loses anew.
        """
        with self._lock:
            self._forget(version)
            self._missed[view] = self._missed.get(view, 0.0) + max(lost, 0.0)
            return self._missed[view] > cost

    def read(self, view: View, items: Items, bounds: Box | None) -> Composition:
        """The composition of the items as they are now, within the bounds of the scene."""
        found = self.kept(view, items.version)
        if found is None:
            found = Composition(items.stack(), items.tiles(), bounds, view)
            with self._lock:
                self._forget(items.version)
                self._missed[view] = 0.0
                self._kept = dict([*self._kept.items(), (view, found)][-VIEWS_MOST:])
        return found

    def _forget(self, version: int) -> None:
        if self._version != version:
            self._kept, self._missed, self._version = {}, {}, version  # in this order: `kept` holds no lock


def in_front(boxes_xyxy: Ints, tiles: Ints, blocks: Bools) -> tuple[Ints, Ints]:
    """Pairs of some tiles and those in front of them whose boxes meet, as (place in `tiles`, tile), sorted.

    Parameters
    ----------
    boxes_xyxy : (T, 4) of all tiles, front to back
    tiles : (n,) those asked for
    blocks : (T,) which can cover another
    """
    front = np.arange(len(boxes_xyxy)) if blocks.all() else np.flatnonzero(blocks)
    place, other = kernels_of(cells).met_boxes(boxes_xyxy[tiles], boxes_xyxy[front])
    before = (front[other] < tiles[place]).nonzero()[0]
    return place[before], front[other[before]]


def seen_of(tiles: Tiles, boxes_xyxy: Ints, bounds: Box | None, which: Ints, of: Ints, front: Ints) -> Seen:
    """Visible pixels of some tiles, one row for each.

    Parameters
    ----------
    boxes_xyxy : (T, 4) of all tiles
    bounds : of the scene; beyond them nothing can be hit
    which : (V,) those asked for
    of, front : (n,) which of those, sorted, is covered by which tile
    """
    return _laid_out(tiles.rank[which], boxes_xyxy[which], _rows(tiles, boxes_xyxy, bounds, which, of, front))


def _rows(tiles: Tiles, boxes_xyxy: Ints, bounds: Box | None, which: Ints, of: Ints, front: Ints) -> Words:
    """Rows (V, height) of the visible pixels of some tiles; see `seen_of`."""
    height = -(-int(tiles.size_wh[which, 1].max(initial=1)) // 8) * 8
    boxes = boxes_xyxy[which]
    right, down = (boxes_xyxy[front, :2] - boxes[of, :2]).T
    rows = kernels_of(bitrows).visible(tiles.words, height, tiles.begin[which], of, tiles.begin[front] - down, right)
    if bounds is not None:
        bitrows.cut_off(rows, boxes[:, 0], boxes[:, 1], bounds)
    return np.asarray(rows)


def cropped(rank: Ints, boxes_xyxy: Ints, rows: Words) -> Seen:
    """Tiles of which a pixel can be seen, each in the box of what can.

    Parameters
    ----------
    rank : (V,) place in the stack of the item of each tile
    boxes_xyxy : (V, 4) of the tiles
    rows : (V, height) of what can be seen of them
    """
    kernels = kernels_of(cropping)
    sides = kernels.sides_of(rows)
    kept = np.flatnonzero(sides[:, 2] >= 0)
    sides = sides[kept]
    height = -(-int((sides[:, 3] - sides[:, 1]).max(initial=0) + 1) // 8) * 8
    corner = boxes_xyxy[kept, :2]
    return _laid_out(
        rank[kept], sides + np.concatenate([corner, corner], axis=1), kernels.moved(rows, kept, sides, height)
    )


def _laid_out(rank: Ints, boxes_xyxy: Ints, rows: Words) -> Seen:
    """Rows (V, height) one tile after another, with empty ones around each."""
    count, height = rows.shape
    stride = height + PAD
    words = np.zeros(count * stride + PAD, np.uint64)
    words[PAD:].reshape(count, stride)[:, :height] = rows
    return Seen(rank, boxes_xyxy, np.arange(count) * stride + PAD, words, height)
