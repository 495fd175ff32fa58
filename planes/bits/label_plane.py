"""The label plane: the item in front at each pixel, redrawn only where something changed.

One read finds the first item that a sample meets:

    label = 2 * (row + 1) + more     the front item (0: none), and a bit for "something lies behind it"

A coarse map of occupied cells spares most reads. `jit.areas` has the compiled kernels.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.backend import kernels_of
from ..common.checks import Bools, InputError, Ints, Labels
from ..common.limits import HALF, ITEMS_UINT16, PLANE_AREA_MAX, PLANE_SIDE_MAX, SUB
from ..grid.fixed_point import pixel
from ..grid.spans import Box, clipped, meets
from ..scene.derived import OF_ALL, Derivative, View
from ..scene.items import Items, Stack
from .cells import within


def places_of(stack: Stack) -> Ints:
    """Places (M, 6) of the items of a stack, from which they are drawn: box, offset of the mask, and label in front."""
    places = np.empty((len(stack), 6), np.int64)
    places[:, :4], places[:, 4] = stack.box_xyxy, stack.offset
    np.multiply(stack.rows + 1, 2, out=places[:, 5])
    return places


def paint(labels: Labels, x: int, y: int, dirty: Ints, places: Ints, masks: Bools) -> None:
    """Redraw boxes of a label plane, back to front.

    Parameters
    ----------
    labels : (h, w) plane, changed in place
    x, y : pixel of the world at [0, 0]
    dirty : (n, 4) inclusive boxes, none empty, inside the plane
    places : places of the items, front to back
    masks : flat booleans of all masks
    """
    boxes = places[:, :4]
    for box in dirty:
        left, top, right, low = box.tolist()
        block = labels[top - y : low - y + 1, left - x : right - x + 1]
        block[:] = 0
        for item_x, item_y, x_max, y_max, offset, label in reversed(places[meets(box, boxes)].tolist()):
            width = x_max - item_x + 1
            x0, y0, x1, y1 = max(left, item_x), max(top, item_y), min(right, x_max), min(low, y_max)
            mask = masks[offset + (y0 - item_y) * width : offset + (y1 - item_y + 1) * width].reshape(-1, width)
            part = block[y0 - top : y1 - top + 1, x0 - left : x1 - left + 1]
            more = (part != 0) + block.dtype.type(label)
            np.copyto(part, more, where=mask[:, x0 - item_x : x1 - item_x + 1])


SUB_BITS = SUB.bit_length() - 1

CELL_BITS = 3
"""Cells of the coarse map have sides of 2**CELL_BITS = 8 px; that of a 1920 x 1080 plane fits the level-1 cache."""


def occupied(labels: Labels) -> Bools:
    """The coarse map of a label plane (h, w): whether anything lies in each cell; the last cells may be cut."""
    side, cells = 1 << CELL_BITS, labels
    for _ in range(2):  # rows, then columns
        joined = cells[::side].copy()
        for k in range(1, side):
            part = cells[k::side]
            joined[: len(part)] |= part
        cells = joined.T
    return np.ascontiguousarray(cells != 0)


class Front(NamedTuple):
    """Objects in front at positions: place (n,) of the position, label of the object, and pixel (n, 2)."""

    place: Ints
    label: Ints
    xy: Ints


# house: hit rule of areas
def front_at(labels: Labels, cells: Bools | None, plane_xyxy: Box, at_256: Ints, objects: Bools) -> Front:
    """Objects in front at positions (N, 2) in 1/256 px, by the label plane.

    Parameters
    ----------
    labels, plane_xyxy : the label plane (h, w), and its box in the world
    cells : its coarse map, or None to read the plane alone
    objects : whether a label is of an object; False at 0
    """
    x, y = (at_256[:, axis] + (HALF - SUB * plane_xyxy[axis]) for axis in (0, 1))  # from the corner of its first pixel
    high, wide = labels.shape
    kept = within(x, y, wide << SUB_BITS, high << SUB_BITS)
    if cells is not None:
        kept = _narrowed(kept, _read(cells, x, y, kept, SUB_BITS + CELL_BITS).nonzero()[0])
    front = _read(labels, x, y, kept, SUB_BITS) >> 1
    hit = objects.take(front).nonzero()[0]
    place = _narrowed(kept, hit)
    return Front(place, front.take(hit).astype(np.int64), pixel(at_256.take(place, axis=0)))


def _narrowed(kept: Ints | None, rows: Ints) -> Ints:
    """Rows of a selection; None selects all."""
    return rows if kept is None else kept.take(rows)


def _read(plane: Labels | Bools, x: Ints, y: Ints, kept: Ints | None, bits: int) -> Labels | Bools:
    """Values of a plane (h, w) with cells of 2**bits / 256 px, at selected positions in 1/256 px."""
    if kept is not None:
        x, y = x.take(kept), y.take(kept)
    place = y >> bits
    place *= plane.shape[1]
    place += x >> bits
    return plane.reshape(-1).take(place)


def plane_fits(box_xyxy: Box) -> bool:
    """Whether a plane of this inclusive box may be made."""
    width, height = box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1
    return max(width, height) <= PLANE_SIDE_MAX and width * height <= PLANE_AREA_MAX


def id_plane(stack: Stack, box_xyxy: Box) -> npt.NDArray[np.int32]:
    """Front item of each pixel of a box, as id + 1; 0 if there is none."""
    _check_plane(box_xyxy)
    labels = np.empty((box_xyxy[3] - box_xyxy[1] + 1, box_xyxy[2] - box_xyxy[0] + 1), np.uint32)
    kernels = kernels_of(sys.modules[__name__])
    kernels.paint(labels, *box_xyxy[:2], np.array([box_xyxy]), places_of(stack), stack.masks)
    ids = np.zeros(len(stack.rank_by_label), np.int32)
    ids[stack.rows + 1] = stack.ids + 1
    return ids.take(labels >> 1)


class LabelPlane(Derivative):
    """The label plane of the items that a view accepts in a box of the world, kept up to date from the journal.

    Parameters
    ----------
    labels : (h, w) as they were read last; None if they were not, or if all must be drawn anew
    redrawn : pixels of the old and new boxes that the last read drew
    """

    def __init__(self, box_xyxy: Box, view: View = OF_ALL[False]) -> None:
        super().__init__()
        _check_plane(box_xyxy)
        self.box_xyxy, self.view = box_xyxy, view
        self.size = (box_xyxy[2] - box_xyxy[0] + 1) * (box_xyxy[3] - box_xyxy[1] + 1)
        self.labels: Labels | None = None
        self.redrawn = 0
        self._dirty: list[Ints] = []  # of the changes up to `_seen`
        self._cost = self.size
        self._cells: Bools | None = None
        self._looks = 0

    def cost(self, items: Items) -> int:
        """Pixels that must be redrawn before the plane can be read; each change is counted once."""
        if self._seen != items.version:
            with self._lock:
                self._follow(items)
        return self._cost

    @property
    def dirty_boxes(self) -> int:
        """Boxes of items that changed, which the next read draws anew."""
        return sum(map(len, self._dirty))

    def _follow(self, items: Items) -> None:
        """Note the boxes that changes since the last call make dirty; if they are unknown or too many, give up."""
        known = self.labels is not None and self.labels.dtype == _kind(items)
        changes = self._unseen(items)
        for _, _, before, after in changes or () if known else ():
            boxes, pixels = _dirt(np.reshape(before, (-1, 4)), np.reshape(after, (-1, 4)), self.box_xyxy)
            self._dirty.append(boxes)
            self._cost += pixels
        if not known or changes is None or self._cost >= self.size:
            self.labels, self._dirty, self._cost = None, [], self.size

    def read(self, items: Items) -> Labels:
        """Labels (h, w) of the present version."""
        with self._lock:
            if self._seen != items.version:
                self._follow(items)
            labels, dirty, self.redrawn = self.labels, self._dirty, self._cost
            if labels is None:
                x, y, x_max, y_max = self.box_xyxy
                labels, dirty = np.empty((y_max - y + 1, x_max - x + 1), _kind(items)), [np.array([self.box_xyxy])]
            if dirty:
                stack, kernels = items.stack(), kernels_of(sys.modules[__name__])
                places = places_of(stack)[self.view.accepts(stack)]
                kernels.paint(labels, *self.box_xyxy[:2], np.concatenate(dirty), places, stack.masks)
                self._cells, self._looks = None, 0
            self.labels, self._dirty, self._cost = labels, [], 0
            return labels

    def front(self, labels: Labels, at_256: Ints, objects: Bools) -> Front:
        """Objects in front at positions (N, 2), by labels that were read; see `front_at`."""
        kernels, cells = kernels_of(sys.modules[__name__]), self.cells(len(at_256))
        front: Front = kernels.front_at(labels, cells, self.box_xyxy, at_256, objects)
        return front

    def cells(self, looks: int) -> Bools | None:
        """The coarse map, once enough pixels were looked up since the last change to pay for it; else None.

        It is also None if more than half of its cells are occupied.
        """
        with self._lock:
            before, self._looks = self._looks, self._looks + looks
            pays = self.size >> 2 * CELL_BITS
            if self.labels is not None and before < pays <= self._looks:
                cells = occupied(self.labels)
                self._cells = cells if 2 * int(cells.sum()) <= cells.size else None
            return self._cells


def _kind(items: Items) -> type[np.uint16 | np.uint32]:
    """Type of the labels."""
    return np.uint16 if items.table.height <= ITEMS_UINT16 else np.uint32


def _dirt(before: Ints, after: Ints, plane: Box) -> tuple[Ints, int]:
    """Boxes (n, 4) of a plane to redraw after moves of items, and the pixels of old and new boxes (m, 4).

    The two boxes of an item are joined if the one around both is no larger.
    """
    old, new = clipped(before, plane), clipped(after, plane)
    was, now = _areas(old), _areas(new)
    around = np.concatenate([np.minimum(old[:, :2], new[:, :2]), np.maximum(old[:, 2:], new[:, 2:])], axis=1)
    joint = (was > 0) & (now > 0) & (_areas(around) <= was + now)
    return np.concatenate([around[joint], old[~joint & (was > 0)], new[~joint & (now > 0)]]), int(was.sum() + now.sum())


def _areas(boxes_xyxy: Ints) -> Ints:
    """Pixels of each inclusive box; 0 for an empty one."""
    sides = np.maximum(boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1, 0)
    return np.asarray(sides[:, 0] * sides[:, 1])


def _check_plane(box_xyxy: Box) -> None:
    if not plane_fits(box_xyxy):
        size = (box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1)
        limit = f"sides up to {PLANE_SIDE_MAX} px and at most {PLANE_AREA_MAX} px in all"
        raise InputError(f"bounds: expected a plane of {limit}, got {size[0]} x {size[1]}")
