"""Items to whole planes, and only where something changed.

The code plane answers "what does a sample meet first" in one read:

    code = 2 * (id + 1) + more      the front item (0: none), and a bit for "something lies behind it"
"""

from __future__ import annotations

import threading

import numpy as np
import numpy.typing as npt

from planes import painting
from planes.arrays import Codes, InputError, Ints
from planes.constants import ITEMS_UINT16, PLANE_AREA_MAX, PLANE_SIDE_MAX
from planes.items import Items, Stack, clipped
from planes.spans import Box
from planes.twins import kernels_of

__all__ = ["CodePlane", "Codes", "area", "label_plane", "plane_fits"]

PAINTED_NS = 1e4
"""What an item or a box takes to be drawn in numpy, at the most."""


def plane_fits(box_xyxy: Box) -> bool:
    """Whether a whole plane of this inclusive box may be made."""
    width, height = box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1
    return max(width, height) <= PLANE_SIDE_MAX and width * height <= PLANE_AREA_MAX


def label_plane(stack: Stack, box_xyxy: Box) -> npt.NDArray[np.int32]:
    """Front-most item of each pixel of a box, as id + 1, and 0 where there is none."""
    _check_plane(box_xyxy)
    codes = np.empty((box_xyxy[3] - box_xyxy[1] + 1, box_xyxy[2] - box_xyxy[0] + 1), np.uint32)
    _paint(codes, box_xyxy, stack, np.array([box_xyxy]))
    return (codes >> 1).astype(np.int32)


class CodePlane:
    """The code plane of a box of the world, kept up to date from the journal.

    Threads may read the plane of a scene that none of them changes.
    """

    def __init__(self, box_xyxy: Box) -> None:
        _check_plane(box_xyxy)
        self.box_xyxy = box_xyxy
        self.codes: Codes | None = None
        self.redrawn = 0
        self._pending: list[Ints] = []
        self._seen = -1
        self._cost = 0
        self._lock = threading.Lock()

    @property
    def size(self) -> int:
        """Pixels of the whole plane."""
        x, y, x_max, y_max = self.box_xyxy
        return (x_max - x + 1) * (y_max - y + 1)

    def cost(self, items: Items) -> int:
        """Pixels that must be drawn anew before the plane can be read; each change is looked at once."""
        with self._lock:
            return self._owed(items)

    def _owed(self, items: Items) -> int:
        if self.codes is None or (self.codes.dtype == np.uint16 and items.count > ITEMS_UINT16):
            return self.size
        if self._seen != items.version:
            changes = items.changes(self._seen)
            for _, _, before, after in changes or ():
                self._note(before, after)
            self._seen = items.version
            if changes is None or self._cost >= self.size:
                self.codes, self._pending, self._cost = None, [], 0
                return self.size
        return self._cost

    def _note(self, before: Ints | Box, after: Ints | Box) -> None:
        """Note where items were and are; where that is nearly the same, it is drawn anew as one."""
        if isinstance(before, tuple) and isinstance(after, tuple):
            boxes = [box for box in (_cut(before, self.box_xyxy), _cut(after, self.box_xyxy)) if box]
            pixels = sum(map(_pixels, boxes))
            if len(boxes) == 2:
                (x, y, x_max, y_max), (left, top, right, low) = boxes
                hull = (min(x, left), min(y, top), max(x_max, right), max(y_max, low))
                if _pixels(hull) <= pixels:
                    boxes = [hull]
            self._cost += pixels
            if boxes:
                self._pending.append(np.array(boxes))
            return
        old, new = clipped(np.asarray(before), self.box_xyxy), clipped(np.asarray(after), self.box_xyxy)
        was, now = _areas(old), _areas(new)
        around = np.concatenate([np.minimum(old[:, :2], new[:, :2]), np.maximum(old[:, 2:], new[:, 2:])], axis=1)
        one = (was > 0) & (now > 0) & (_areas(around) <= was + now)
        self._cost += int(was.sum() + now.sum())
        self._pending += [around[one], old[~one & (was > 0)], new[~one & (now > 0)]]

    def read(self, items: Items) -> Codes:
        """Codes (h, w) of the present version; `redrawn` tells how many pixels, of old and new boxes, that concerns."""
        with self._lock:
            self.redrawn = self._owed(items)
            if self.codes is None or self.redrawn == self.size:
                x, y, x_max, y_max = self.box_xyxy
                kind = np.uint16 if items.count <= ITEMS_UINT16 else np.uint32
                self.codes = np.empty((y_max - y + 1, x_max - x + 1), kind)
                self._pending = [np.array([self.box_xyxy])]
            if self._pending:
                dirty = self._pending[0] if len(self._pending) == 1 else np.concatenate(self._pending)
                _paint(self.codes, self.box_xyxy, items.stack(), dirty)
            self._seen = items.version
            self._pending, self._cost = [], 0
            return self.codes


def area(boxes_xyxy: Ints) -> int:
    """Pixels of inclusive boxes, added up."""
    sides = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1
    return int((sides[:, 0] * sides[:, 1]).sum())


def _areas(boxes_xyxy: Ints) -> Ints:
    """Pixels of each inclusive box; 0 of one that is nowhere."""
    sides = np.maximum(boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1, 0)
    return np.asarray(sides[:, 0] * sides[:, 1])


def _pixels(box: Box) -> int:
    return (box[2] - box[0] + 1) * (box[3] - box[1] + 1)


def _cut(box: Box, plane: Box) -> Box | None:
    """The part of a box that lies in a plane."""
    x, y, x_max, y_max = box
    left, top, right, low = plane
    x, y = x if x > left else left, y if y > top else top
    x_max, y_max = x_max if x_max < right else right, y_max if y_max < low else low
    return (x, y, x_max, y_max) if x <= x_max and y <= y_max else None


def _paint(codes: Codes, plane_xyxy: Box, stack: Stack, dirty: Ints) -> None:
    """Draw boxes (n, 4) of a plane anew."""
    kernels = kernels_of(painting, (len(dirty) + len(stack)) * PAINTED_NS)
    kernels.paint(codes, *plane_xyxy[:2], dirty, stack.ids, stack.box_xyxy, stack.offset, stack.masks)


def _check_plane(box_xyxy: Box) -> None:
    if not plane_fits(box_xyxy):
        size = (box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1)
        limit = f"sides up to {PLANE_SIDE_MAX} px and at most {PLANE_AREA_MAX} px in all"
        raise InputError(f"bounds: expected a plane of {limit}, got {size[0]} x {size[1]}")
