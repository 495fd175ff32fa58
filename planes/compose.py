"""Items to whole planes, and only where something changed.

The code plane answers "what does a sample meet first" in one read:

    code = 2 * (id + 1) + more      the front item (0: none), and a bit for "something lies behind it"
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from planes import painting, pointquery, steps
from planes.arrays import Bools, Codes, InputError, Ints
from planes.constants import ITEMS_UINT16, PLANE_AREA_MAX, PLANE_SIDE_MAX
from planes.items import NEVER, NO_BOXES, Change, Items, Stack, clipped
from planes.spans import Box
from planes.twins import kernels_of

__all__ = ["CodePlane", "Codes", "area", "label_plane", "plane_fits"]

PAINTED_NS = 1e4
"""What an item or a box takes to be drawn in numpy, at the most."""

STEP_NS = 3e4
"""What the step of an item takes in numpy."""

FEW = 16
"""Items that are drawn anew one by one, without asking whether the whole plane is cheaper."""


def plane_fits(box_xyxy: Box) -> bool:
    """Whether a whole plane of this inclusive box may be made."""
    width, height = box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1
    return max(width, height) <= PLANE_SIDE_MAX and width * height <= PLANE_AREA_MAX


def label_plane(stack: Stack, box_xyxy: Box) -> npt.NDArray[np.int32]:
    """Front-most item of each pixel of a box, as id + 1, and 0 where there is none."""
    _check_plane(box_xyxy)
    codes = np.empty((box_xyxy[3] - box_xyxy[1] + 1, box_xyxy[2] - box_xyxy[0] + 1), np.uint32)
    kernels = kernels_of(painting, len(stack) * PAINTED_NS)
    kernels.paint(codes, *box_xyxy[:2], np.array([box_xyxy]), painting.places_of(stack), stack.masks)
    return (codes >> 1).astype(np.int32)


class Drawing:
    """A code plane as it was drawn, and what it was drawn from: it follows items that only move.

    Parameters
    ----------
    items : as they are now
    box_xyxy : of the plane
    """

    def __init__(self, items: Items, box_xyxy: Box) -> None:
        x, y, x_max, y_max = box_xyxy
        self._corner = x, y
        self.codes: Codes = np.empty((y_max - y + 1, x_max - x + 1), _kind(items))
        self._near: Ints | None = None
        self._cells: Bools | None = None
        self._looks = 0
        self.draw(items.stack(), np.array([box_xyxy]))

    def draw(self, stack: Stack, dirty: Ints) -> None:
        """Draw boxes (n, 4) anew, from a stack that differs from the last one nowhere else."""
        self.forms, self._rank_of, self._masks = stack.forms, stack.rank_of, stack.masks
        self._places, self._near = painting.places_of(stack), None
        self._cells, self._looks = None, 0
        kernels = kernels_of(painting, (len(dirty) + len(stack)) * PAINTED_NS)
        kernels.paint(self.codes, *self._corner, dirty, self._places, self._masks)

    def follow(self, changes: Sequence[Change]) -> int:
        """Draw anew what the steps of items, the last first, change; tell how many pixels their boxes have."""
        if self._near is None:
            self._near = steps.near_of(self._places, *self._corner, *self.codes.shape)
        if changes:
            self._cells, self._looks = None, 0
        pixels = 0
        for _, ids, _, after in reversed(changes):
            if isinstance(after, tuple):
                rank = self._rank_of.item(ids)
                if rank >= 0:
                    follow = kernels_of(steps, STEP_NS).follow
                    pixels += follow(self.codes, *self._corner, rank, *after, self._places, self._near, self._masks)
            else:
                ranks = self._rank_of.take(ids)
                some = np.flatnonzero(ranks >= 0)
                many = ranks.take(some), np.asarray(after).take(some, axis=0)
                follow = kernels_of(steps, len(some) * STEP_NS).follow_all
                pixels += follow(self.codes, *self._corner, *many, self._places, self._near, self._masks)
        return pixels

    def cells(self, looks: int) -> Bools | None:
        """The coarse map, when as many pixels were looked up since the last change as would have paid for it.

        None as long as they were not, and where more than half of its cells hold something.
        """
        before, self._looks = self._looks, self._looks + looks
        pays = self.codes.size >> 2 * pointquery.CELL_BITS
        if before < pays <= self._looks:
            cells = pointquery.occupied(self.codes)
            self._cells = cells if 2 * int(cells.sum()) <= cells.size else None
        return self._cells


class CodePlane:
    """The code plane of a box of the world, kept up to date from the journal.

    Threads may read the plane of a scene that none of them changes.
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
    def codes(self) -> Codes | None:
        """Codes (h, w) as they were read last, if they were and can be kept up to date."""
        return None if self._drawing is None else self._drawing.codes

    def cost(self, items: Items) -> int:
        """Pixels that must be drawn anew before the plane can be read; each change is looked at once."""
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
        """What changed after a version, the last first; None if the whole plane must be drawn anew."""
        drawing = self._drawing
        if drawing is None or (drawing.forms != items.arrangement and drawing.codes.dtype != _kind(items)):
            return None
        return items.changes(version)

    def read(self, items: Items) -> Codes:
        """Codes (h, w) of the present version; `redrawn` tells how many pixels, of old and new boxes, that concerns."""
        with self._lock:
            if self._drawing is not None and self._drawn == items.version:
                self.redrawn = 0
                return self._drawing.codes
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
            return self._drawing.codes

    def cells(self, looks: int) -> Bools | None:
        """The coarse map of what was read, for as many looks, if there is one: see `Drawing.cells`."""
        with self._lock:
            return None if self._drawing is None else self._drawing.cells(looks)


def _kind(items: Items) -> type[np.uint16 | np.uint32]:
    """Of the numbers of a code plane."""
    return np.uint16 if items.count <= ITEMS_UINT16 else np.uint32


def _are_few(changes: Sequence[Change]) -> bool:
    """Whether so little changed that the whole plane need not be thought of."""
    rows = 0
    for _, ids, _, _ in changes:
        rows += 1 if isinstance(ids, int) else len(ids)
    return rows <= FEW


def _dirt(before: Ints | Box, after: Ints | Box, plane: Box) -> tuple[Ints, int]:
    """Boxes (n, 4) of a plane that are drawn anew where items were and are; and the pixels of all, before and after.

    Where the old and new box of an item are nearly the same, they are drawn as one.
    """
    if isinstance(before, tuple) and isinstance(after, tuple):
        boxes, pixels = steps.joined(steps.cut(before, plane), steps.cut(after, plane))
        return np.array(boxes, np.int64).reshape(-1, 4), pixels
    old, new = clipped(np.asarray(before), plane), clipped(np.asarray(after), plane)
    was, now = _areas(old), _areas(new)
    around = np.concatenate([np.minimum(old[:, :2], new[:, :2]), np.maximum(old[:, 2:], new[:, 2:])], axis=1)
    one = (was > 0) & (now > 0) & (_areas(around) <= was + now)
    return np.concatenate([around[one], old[~one & (was > 0)], new[~one & (now > 0)]]), int(was.sum() + now.sum())


def area(boxes_xyxy: Ints) -> int:
    """Pixels of inclusive boxes, added up."""
    sides = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1
    return int((sides[:, 0] * sides[:, 1]).sum())


def _areas(boxes_xyxy: Ints) -> Ints:
    """Pixels of each inclusive box; 0 of one that is nowhere."""
    sides = np.maximum(boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1, 0)
    return np.asarray(sides[:, 0] * sides[:, 1])


def _check_plane(box_xyxy: Box) -> None:
    if not plane_fits(box_xyxy):
        size = (box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1)
        limit = f"sides up to {PLANE_SIDE_MAX} px and at most {PLANE_AREA_MAX} px in all"
        raise InputError(f"bounds: expected a plane of {limit}, got {size[0]} x {size[1]}")
