"""The label plane: the item in front at each pixel, redrawn only where something changed.

One read finds the first item that a sample meets:

    label = 2 * (id + 1) + more     the front item (0: none), and a bit for "something lies behind it"

A coarse map of occupied cells spares most reads. Redrawing a box needs the items near it. Each item has a number of
four fields of 14 bits, pixels of the plane divided by 4, with a guard bit between them:

    . x/4 . y/4 . -x_max/4 . -y_max/4          fields of an item; those of a box are right, low, -left, -top
    1     1     1          1                   guard bits, set in the box; one stays set if the box's field is no less

A box and an item may meet if all four guard bits are set after a subtraction. `jit.scene` has the compiled kernels.
"""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.backend import kernels_of
from ..common.checks import Bools, InputError, Ints, Labels
from ..common.limits import HALF, ITEMS_UINT16, PLANE_AREA_MAX, PLANE_SIDE_MAX, SUB
from ..grid.fixed_point import pixel
from ..grid.spans import Box, begins, meets
from ..scene.items import NEVER, NO_BOXES, Change, Items, Stack, clipped
from .cells import met_boxes, within

PAIRS = 2**18
"""Pairs of boxes that are compared at a time."""

GROUP = 8
"""Items that are drawn at a time, each as one bit of a byte."""

GROUPED_AREA = 2**14
"""Largest box, px, in which items are drawn in groups; in larger boxes each is drawn alone."""

WEIGHTS = np.array([1 << k for k in range(GROUP)], np.uint64)


def _entry(bits: int) -> int:
    """Place of a byte's label among those of a group: 0, then two for each item, the second if more bits are set."""
    return 2 * (bits & -bits).bit_length() - (bits.bit_count() == 1) if bits else 0


ENTRIES = np.array([_entry(bits) for bits in range(1 << GROUP)])


def places_of(stack: Stack) -> Ints:
    """Places (M, 6) of the items of a stack, from which they are drawn: box, offset of the mask, and label in front."""
    places = np.empty((len(stack), 6), np.int64)
    places[:, :4], places[:, 4] = stack.box_xyxy, stack.offset
    np.multiply(stack.ids + 1, 2, out=places[:, 5])
    return places


def paint(labels: Labels, x: int, y: int, dirty: Ints, places: Ints, masks: Bools) -> None:
    """Redraw boxes of a label plane.

    Parameters
    ----------
    labels : (h, w) plane, changed in place
    x, y : pixel of the world at [0, 0]
    dirty : (n, 4) inclusive boxes, none empty, inside the plane
    places : places of the items, front to back
    masks : flat booleans of all masks
    """
    boxes = places[:, :4]
    step = max(1, PAIRS // max(len(places), 1))
    for begin in range(0, len(dirty), step):
        part = dirty[begin : begin + step]
        ends, rank = _met(part, boxes)
        rows = places.take(rank, axis=0).tolist()
        for number, (left, top, right, low) in enumerate(part.tolist()):
            block = labels[top - y : low - y + 1, left - x : right - x + 1]
            draw(block, (left, top, right, low), rows[ends[number] : ends[number + 1]], masks)


def _met(dirty: Ints, boxes: Ints) -> tuple[list[int], Ints]:
    """Boxes that each dirty box meets, in order; and where the list of each dirty box begins and ends."""
    if len(dirty) == 1:
        rank = np.flatnonzero(meets(dirty[0], boxes))
        return [0, len(rank)], rank
    row, rank = np.nonzero(meets(dirty[:, None], boxes))
    return np.searchsorted(row, np.arange(len(dirty) + 1)).tolist(), rank


def draw(block: Labels, box: Box, rows: list[list[int]], masks: Bools) -> None:
    """Redraw the block of a plane in a box.

    Parameters
    ----------
    block : the block, changed in place
    rows : places of the items that meet it, front to back; other items may be among them
    """
    if block.size <= GROUPED_AREA:
        _draw_grouped(block, box, rows, masks)
    else:
        _draw_each(block, box, rows, masks)


def _draw_grouped(block: Labels, box: Box, rows: list[list[int]], masks: Bools) -> None:
    """Draw a block by groups of items, the front group last; a byte has a bit for each item of a group."""
    last = len(rows) - 1
    for begin in range(last - last % GROUP, -1, -GROUP):
        group = rows[begin : begin + GROUP]
        bits = _bits(block.shape, box, group, masks)
        front = _table(group, block.dtype).take(bits)
        if begin + GROUP <= last:
            front = np.where(bits, front | (block != 0), block)
        block[:] = front
    if last < 0:
        block[:] = 0


def _table(group: list[list[int]], kind: npt.DTypeLike) -> Labels:
    """Label of each byte of a group: that of the item of the lowest bit, and whether there are more."""
    labels = [0]
    for row in group:
        labels += (row[5], row[5] + 1)
    return np.array(labels, kind).take(ENTRIES[: 1 << len(group)])


@functools.cache
def _row_of(width: int) -> np.dtype[np.void]:
    """Type of a row of `width` bytes that is copied as a whole."""
    return np.dtype(f"V{width}")


def _bits(shape: tuple[int, ...], box: Box, group: list[list[int]], masks: Bools) -> npt.NDArray[np.uint8]:
    """Byte of each pixel of a box: bit k is set if item k of a group covers it."""
    (height, width), (left, top, right, low) = shape, box
    words = (height * width + 7) // 8
    planes = np.zeros((len(group), words), np.uint64)  # a byte for each pixel, 0 or 1, added eight at a time
    begin = -top * width - left
    for x, y, x_max, y_max, offset, _ in group:
        x0, y0 = x if x > left else left, y if y > top else top
        x1, y1 = x_max if x_max < right else right, y_max if y_max < low else low
        if x0 <= x1 and y0 <= y1:
            rows, row, own = (y1 - y0 + 1,), _row_of(x1 - x0 + 1), x_max - x + 1
            source = np.ndarray(rows, row, masks, offset + (y0 - y) * own + x0 - x, (own,))
            np.ndarray(rows, row, planes, begin + y0 * width + x0, (width,))[:] = source
        begin += 8 * words
    bits = WEIGHTS[: len(group)] @ planes
    return bits.view(np.uint8)[: height * width].reshape(shape)


def _draw_each(block: Labels, box: Box, rows: list[list[int]], masks: Bools) -> None:
    """Draw a block item by item, back to front."""
    left, top, right, low = box
    block[:] = 0
    for x, y, x_max, y_max, offset, code in reversed(rows):
        width = x_max - x + 1
        x0, y0, x1, y1 = max(left, x), max(top, y), min(right, x_max), min(low, y_max)
        if x0 > x1 or y0 > y1:
            continue
        mask = masks[offset + (y0 - y) * width : offset + (y1 - y + 1) * width].reshape(-1, width)
        part = block[y0 - top : y1 - top + 1, x0 - left : x1 - left + 1]
        more = (part != 0) + block.dtype.type(code)
        np.copyto(part, more, where=mask[:, x0 - x : x1 - x + 1])


FIELD = 2**14 - 1
"""Greatest value of a field; planes are so small that no box has it on all sides."""

GUARDS = 1 << 14 | 1 << 29 | 1 << 44 | 1 << 59
"""The guard bits above the fields."""

NOWHERE = FIELD | FIELD << 15 | FIELD << 30 | FIELD << 45
"""Number of an item that is not on the plane; it meets no box."""


def near_of(places: Ints, x: int, y: int, height: int, width: int) -> Ints:
    """Number (M,) of each item, by which the items near a box are found: see the module's docstring."""
    left, top = np.maximum(places[:, 0] - x, 0), np.maximum(places[:, 1] - y, 0)
    right, low = np.minimum(places[:, 2] - x, width - 1), np.minimum(places[:, 3] - y, height - 1)
    fields = left >> 2 | top >> 2 << 15 | (FIELD - (right >> 2)) << 30 | (FIELD - (low >> 2)) << 45
    return np.where((left <= right) & (top <= low), fields, NOWHERE)


def follow_all(labels: Labels, x: int, y: int, rank: Ints, now: Ints, places: Ints, near: Ints, masks: Bools) -> int:
    """Move items (n,) to boxes (n, 4), one after another; see `follow`."""
    pixels = 0
    for item, (left, top, right, low) in zip(rank.tolist(), now.tolist(), strict=True):
        pixels += follow(labels, x, y, item, left, top, right, low, places, near, masks)
    return pixels


def follow(
    labels: Labels, x: int, y: int, rank: int, left: int, top: int, right: int, low: int, places: Ints, near: Ints,
    masks: Bools,
) -> int:  # fmt: skip
    """Move one item to another box, and redraw what that changes.

    If the old and new box are nearly the same, they are drawn as one.

    Parameters
    ----------
    labels : (h, w) plane, changed in place
    x, y : pixel of the world at [0, 0]
    rank : rank of the item
    left, top, right, low : its new box, of the same size
    places : places of all items, changed in place; see `places_of`
    near : (M,) their numbers, changed in place; see `near_of`
    masks : flat booleans of all masks

    Returns
    -------
    pixels of the plane in the old and the new box
    """
    height, width = labels.shape
    edge = (x, y, x + width - 1, y + height - 1)
    place, box = places[rank], (left, top, right, low)
    boxes, pixels = joined(cut(place.tolist(), edge), new := cut(box, edge))
    place[:4] = box
    near[rank] = _fields(new, x, y) if new else NOWHERE
    for left, top, right, low in boxes:
        limits = _fields((right, low, left, top), x, y) | GUARDS
        found = ((limits - near) & GUARDS == GUARDS).nonzero()[0]
        block = labels[top - y : low - y + 1, left - x : right - x + 1]
        draw(block, (left, top, right, low), places.take(found, axis=0).tolist(), masks)
    return pixels


def _fields(box: Box, x: int, y: int) -> int:
    """Four numbers of pixels as fields; (x, y) is the pixel [0, 0] of the plane."""
    left, top, right, low = box
    return left - x >> 2 | top - y >> 2 << 15 | FIELD - (right - x >> 2) << 30 | FIELD - (low - y >> 2) << 45


def cut(place: Sequence[int], edge: Box) -> Box | None:
    """Intersection of two boxes, the first given by a place; None if it is empty."""
    x, y, x_max, y_max = place[:4]
    left, top, right, low = edge
    x, y = x if x > left else left, y if y > top else top
    x_max, y_max = x_max if x_max < right else right, y_max if y_max < low else low
    return (x, y, x_max, y_max) if x <= x_max and y <= y_max else None


def joined(old: Box | None, new: Box | None) -> tuple[Sequence[Box], int]:
    """Boxes to redraw after a move: old and new, or the one around both if it is no larger; and the pixels of both."""
    if not old or not new:
        box = old or new
        return ((box,), _pixels(box)) if box else ((), 0)
    pixels = _pixels(old) + _pixels(new)
    (x, y, x_max, y_max), (left, top, right, low) = old, new
    around = (
        x if x < left else left, y if y < top else top,
        x_max if x_max > right else right, y_max if y_max > low else low,
    )  # fmt: skip
    return (around,) if _pixels(around) <= pixels else (old, new), pixels


def _pixels(box: Box) -> int:
    return (box[2] - box[0] + 1) * (box[3] - box[1] + 1)


SUB_BITS = SUB.bit_length() - 1

CELL_BITS = 3
"""Cells of the coarse map have sides of 2**CELL_BITS = 8 px; that of a 1920 x 1080 plane fits the level-1 cache."""


def occupied(labels: Labels) -> Bools:
    """The coarse map of a label plane (h, w): whether anything lies in each cell; the last cells may be cut."""
    side = 1 << CELL_BITS
    rows = labels[::side].copy()
    for k in range(1, side):
        part = labels[k::side]
        rows[: len(part)] |= part
    cells = rows[:, ::side].copy()
    for k in range(1, side):
        part = rows[:, k::side]
        cells[:, : part.shape[1]] |= part
    return np.not_equal(cells, 0)


class Front(NamedTuple):
    """Objects in front at positions: place (n,) of the position, id of the object, and pixel (n, 2)."""

    place: Ints
    object: Ints
    xy: Ints


# house: hit rule of areas
def front_at(labels: Labels, cells: Bools | None, plane_xyxy: Box, at_256: Ints, objects: Bools) -> Front:
    """Objects in front at positions (N, 2) in 1/256 px, by the label plane.

    Parameters
    ----------
    labels, plane_xyxy : the label plane (h, w), and its box in the world
    cells : its coarse map, or None to read the plane alone
    objects : whether item id + 1 is an object; False at 0
    """
    x, y = (at_256[:, axis] + (HALF - SUB * plane_xyxy[axis]) for axis in (0, 1))  # from the corner of its first pixel
    high, wide = labels.shape
    some = within(x, y, wide << SUB_BITS, high << SUB_BITS)
    if cells is not None:
        some = _narrowed(some, _read(cells, x, y, some, SUB_BITS + CELL_BITS).nonzero()[0])
    front = _read(labels, x, y, some, SUB_BITS) >> 1
    hit = objects.take(front).nonzero()[0]
    place = _narrowed(some, hit)
    return Front(place, front.take(hit).astype(np.int64) - 1, pixel(at_256.take(place, axis=0)))


# house: hit rule of areas
def front_of(stack: Stack, bounds: Box | None, at_256: Ints) -> Front:
    """Objects in front at positions (N, 2) in 1/256 px within bounds, by the masks of all items of a stack."""
    xy = pixel(at_256)
    place, rank = met_boxes(np.concatenate([xy, xy], axis=1), stack.box_xyxy)
    down = xy.take(place, axis=0) - stack.box_xyxy[:, :2].take(rank, axis=0)
    texel = stack.offset.take(rank) + down[:, 1] * stack.width.take(rank) + down[:, 0]
    on = stack.masks.take(texel).nonzero()[0]
    place, rank = place.take(on), rank.take(on)
    front = begins(place)
    if stack.has_occluders:
        front &= ~stack.occluder.take(rank)
    if bounds is not None:
        x, y = xy[:, 0].take(place), xy[:, 1].take(place)
        front &= (x >= bounds[0]) & (x <= bounds[2]) & (y >= bounds[1]) & (y <= bounds[3])
    some = front.nonzero()[0]
    place = place.take(some)
    return Front(place, stack.ids.take(rank.take(some)), xy.take(place, axis=0))


def _narrowed(some: Ints | None, rows: Ints) -> Ints:
    """Rows of a selection; None selects all."""
    return rows if some is None else some.take(rows)


def _read(plane: Labels | Bools, x: Ints, y: Ints, some: Ints | None, bits: int) -> Labels | Bools:
    """Values of a plane (h, w) with cells of 2**bits / 256 px, at selected positions in 1/256 px."""
    if some is not None:
        x, y = x.take(some), y.take(some)
    place = y >> bits
    place *= plane.shape[1]
    place += x >> bits
    return plane.reshape(-1).take(place)


FEW = 16
"""Most changed items that are redrawn without comparing the cost with that of the whole plane."""


def plane_fits(box_xyxy: Box) -> bool:
    """Whether a plane of this inclusive box may be made."""
    width, height = box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1
    return max(width, height) <= PLANE_SIDE_MAX and width * height <= PLANE_AREA_MAX


def label_plane(stack: Stack, box_xyxy: Box) -> npt.NDArray[np.int32]:
    """Front item of each pixel of a box, as id + 1; 0 if there is none."""
    _check_plane(box_xyxy)
    labels = np.empty((box_xyxy[3] - box_xyxy[1] + 1, box_xyxy[2] - box_xyxy[0] + 1), np.uint32)
    kernels = kernels_of(sys.modules[__name__])
    kernels.paint(labels, *box_xyxy[:2], np.array([box_xyxy]), places_of(stack), stack.masks)
    return (labels >> 1).astype(np.int32)


class Drawing:
    """A drawn label plane and the columns that it was drawn from; it follows items that only move.

    Parameters
    ----------
    items : the items, drawn as they are now
    box_xyxy : box of the plane
    """

    def __init__(self, items: Items, box_xyxy: Box) -> None:
        x, y, x_max, y_max = box_xyxy
        self._corner = x, y
        self.labels: Labels = np.empty((y_max - y + 1, x_max - x + 1), _kind(items))
        self._near: Ints | None = None
        self._cells: Bools | None = None
        self._looks = 0
        self.draw(items.stack(), np.array([box_xyxy]))

    def draw(self, stack: Stack, dirty: Ints) -> None:
        """Redraw boxes (n, 4) from a stack that differs from the last one only there."""
        self.forms, self._rank_of, self._masks = stack.forms, stack.rank_of, stack.masks
        self._places, self._near = places_of(stack), None
        self._cells, self._looks = None, 0
        kernels = kernels_of(sys.modules[__name__])
        kernels.paint(self.labels, *self._corner, dirty, self._places, self._masks)

    def follow(self, changes: Sequence[Change]) -> int:
        """Redraw what moves of items change, given the last first; return the number of pixels of their boxes."""
        if self._near is None:
            self._near = near_of(self._places, *self._corner, *self.labels.shape)
        if changes:
            self._cells, self._looks = None, 0
        pixels = 0
        for _, ids, _, after in reversed(changes):
            if isinstance(after, tuple):
                rank = self._rank_of.item(ids)
                if rank >= 0:
                    follow = kernels_of(sys.modules[__name__]).follow
                    pixels += follow(self.labels, *self._corner, rank, *after, self._places, self._near, self._masks)
            else:
                ranks = self._rank_of.take(ids)
                rows = np.flatnonzero(ranks >= 0)
                many = ranks.take(rows), np.asarray(after).take(rows, axis=0)
                follow = kernels_of(sys.modules[__name__]).follow_all
                pixels += follow(self.labels, *self._corner, *many, self._places, self._near, self._masks)
        return pixels

    def cells(self, looks: int) -> Bools | None:
        """The coarse map, once enough pixels were looked up since the last change to pay for it; else None.

        It is also None if more than half of its cells are occupied.
        """
        before, self._looks = self._looks, self._looks + looks
        pays = self.labels.size >> 2 * CELL_BITS
        if before < pays <= self._looks:
            cells = occupied(self.labels)
            self._cells = cells if 2 * int(cells.sum()) <= cells.size else None
        return self._cells


class LabelPlane:
    """The label plane of a box of the world, kept up to date from the journal.

    Threads may read it as long as none changes the scene.
    """

    def __init__(self, box_xyxy: Box) -> None:
        _check_plane(box_xyxy)
        self.box_xyxy = box_xyxy
        self.size = (box_xyxy[2] - box_xyxy[0] + 1) * (box_xyxy[3] - box_xyxy[1] + 1)
        self.redrawn = 0
        self._drawing: Drawing | None = None
        self._drawn = self._counted = NEVER  # versions: of what is drawn, and of the cost
        self._cost = 0
        self._lock = threading.Lock()

    @property
    def labels(self) -> Labels | None:
        """Labels (h, w) as they were read last; None if they were not, or cannot be updated."""
        return None if self._drawing is None else self._drawing.labels

    def cost(self, items: Items) -> int:
        """Pixels that must be redrawn before the plane can be read; each change is counted once."""
        if self._drawing is not None and self._drawn == items.version:
            return 0
        with self._lock:
            return self._owed(items)

    def _owed(self, items: Items) -> int:
        changes = self._changes(items, self._counted) if items.knows(self._drawn) else None
        for _, _, before, after in changes or ():
            self._cost += _dirt(before, after, self.box_xyxy)[1]
        self._counted = items.version
        if changes is None or self._cost >= self.size:
            self._drawing, self._cost = None, 0
            return self.size
        return self._cost

    def _changes(self, items: Items, version: int) -> list[Change] | None:
        """Changes after a version, the last first; None if the whole plane must be redrawn."""
        drawing = self._drawing
        if drawing is None or (drawing.forms != items.arrangement and drawing.labels.dtype != _kind(items)):
            return None
        return items.changes(version)

    def read(self, items: Items) -> Labels:
        """Labels (h, w) of the present version; `redrawn` is then the number of pixels of the old and new boxes."""
        with self._lock:
            if self._drawing is not None and self._drawn == items.version:
                self.redrawn = 0
                return self._drawing.labels
            changes = self._changes(items, self._drawn)
            if changes is not None and not _are_few(changes) and self._owed(items) == self.size:
                changes = None
            if changes is None or self._drawing is None:
                self._drawing, self.redrawn = Drawing(items, self.box_xyxy), self.size
            elif self._drawing.forms == items.arrangement:
                self.redrawn = self._drawing.follow(changes)
            else:
                dirt = [_dirt(before, after, self.box_xyxy) for _, _, before, after in changes]
                self.redrawn = sum(pixels for _, pixels in dirt)
                self._drawing.draw(items.stack(), np.concatenate([NO_BOXES, *(boxes for boxes, _ in dirt)]))
            self._drawn = self._counted = items.version
            self._cost = 0
            return self._drawing.labels

    def cells(self, looks: int) -> Bools | None:
        """The coarse map for a number of look-ups, if there is one: see `Drawing.cells`."""
        with self._lock:
            return None if self._drawing is None else self._drawing.cells(looks)


def _kind(items: Items) -> type[np.uint16 | np.uint32]:
    """Type of the labels."""
    return np.uint16 if items.count <= ITEMS_UINT16 else np.uint32


def _are_few(changes: Sequence[Change]) -> bool:
    """Whether at most FEW items changed."""
    rows = 0
    for _, ids, _, _ in changes:
        rows += 1 if isinstance(ids, int) else len(ids)
    return rows <= FEW


def _dirt(before: Ints | Box, after: Ints | Box, plane: Box) -> tuple[Ints, int]:
    """Boxes (n, 4) of a plane to redraw after moves of items, as of `joined`; and the pixels of old and new boxes."""
    if isinstance(before, tuple) and isinstance(after, tuple):
        boxes, pixels = joined(cut(before, plane), cut(after, plane))
        return np.array(boxes, np.int64).reshape(-1, 4), pixels
    old, new = clipped(np.asarray(before), plane), clipped(np.asarray(after), plane)
    was, now = _areas(old), _areas(new)
    around = np.concatenate([np.minimum(old[:, :2], new[:, :2]), np.maximum(old[:, 2:], new[:, 2:])], axis=1)
    one = (was > 0) & (now > 0) & (_areas(around) <= was + now)
    return np.concatenate([around[one], old[~one & (was > 0)], new[~one & (now > 0)]]), int(was.sum() + now.sum())


def area(boxes_xyxy: Ints) -> int:
    """Sum of the pixels of inclusive boxes."""
    sides = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1
    return int((sides[:, 0] * sides[:, 1]).sum())


def _areas(boxes_xyxy: Ints) -> Ints:
    """Pixels of each inclusive box; 0 for an empty one."""
    sides = np.maximum(boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1, 0)
    return np.asarray(sides[:, 0] * sides[:, 1])


def _check_plane(box_xyxy: Box) -> None:
    if not plane_fits(box_xyxy):
        size = (box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1)
        limit = f"sides up to {PLANE_SIDE_MAX} px and at most {PLANE_AREA_MAX} px in all"
        raise InputError(f"bounds: expected a plane of {limit}, got {size[0]} x {size[1]}")
