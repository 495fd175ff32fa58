"""Items to whole planes, and only where something changed.

The code plane answers "what does a sample meet first" in one read:

    code = 2 * (id + 1) + more      the front item (0: none), and a bit for "something lies behind it"
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import InputError, Ints
from planes.constants import ITEMS_UINT16, PLANE_AREA_MAX, PLANE_SIDE_MAX
from planes.items import Items, Stack, clipped
from planes.spans import Box, meets

__all__ = ["CodePlane", "area", "label_plane", "plane_fits"]

Codes = npt.NDArray[np.unsignedinteger[Any]]


def plane_fits(box_xyxy: Box) -> bool:
    """Whether a whole plane of this inclusive box may be made."""
    width, height = box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1
    return max(width, height) <= PLANE_SIDE_MAX and width * height <= PLANE_AREA_MAX


def label_plane(stack: Stack, box_xyxy: Box) -> npt.NDArray[np.int32]:
    """Front-most item of each pixel of a box, as id + 1, and 0 where there is none."""
    _check_plane(box_xyxy)
    codes = np.zeros((box_xyxy[3] - box_xyxy[1] + 1, box_xyxy[2] - box_xyxy[0] + 1), np.uint32)
    _paint(codes, box_xyxy, stack, box_xyxy)
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
            boxes = items.changed_boxes(self._seen)
            if boxes is not None:
                boxes = clipped(boxes, self.box_xyxy)
                self._pending.append(boxes[(boxes[:, :2] <= boxes[:, 2:]).all(axis=1)])
                self._cost += area(self._pending[-1])
            self._seen = items.version
            if boxes is None or self._cost >= self.size:
                self.codes, self._pending, self._cost = None, [], 0
                return self.size
        return self._cost

    def read(self, items: Items) -> Codes:
        """Codes (h, w) of the present version; `redrawn` tells how many pixels were drawn for it."""
        with self._lock:
            self.redrawn = self._owed(items)
            if self.codes is None or self.redrawn == self.size:
                x, y, x_max, y_max = self.box_xyxy
                kind = np.uint16 if items.count <= ITEMS_UINT16 else np.uint32
                self.codes = np.zeros((y_max - y + 1, x_max - x + 1), kind)
                boxes = np.array([self.box_xyxy])
            else:
                boxes = np.concatenate([np.zeros((0, 4), np.int64), *self._pending])
            for box in boxes.tolist():
                _paint(self.codes, self.box_xyxy, items.stack(), box)
            self._seen = items.version
            self._pending, self._cost = [], 0
            return self.codes


def area(boxes_xyxy: Ints) -> int:
    """Pixels of inclusive boxes, added up."""
    return int((boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1).prod(axis=1).sum())


def _paint(codes: Codes, plane_xyxy: Box, stack: Stack, box_xyxy: Box) -> None:
    """Draw one box of a plane anew, back to front."""
    x, y = plane_xyxy[:2]
    left, top, right, low = box_xyxy
    codes[top - y : low - y + 1, left - x : right - x + 1] = 0
    for rank in np.flatnonzero(meets(np.array(box_xyxy), stack.box_xyxy))[::-1].tolist():
        ix, iy, ix_max, iy_max = stack.box_xyxy[rank].tolist()
        x0, y0, x1, y1 = max(left, ix), max(top, iy), min(right, ix_max), min(low, iy_max)
        mask = stack.mask(rank)[y0 - iy : y1 - iy + 1, x0 - ix : x1 - ix + 1]
        part = codes[y0 - y : y1 - y + 1, x0 - x : x1 - x + 1]
        code = (part != 0) + codes.dtype.type(2 * (int(stack.ids[rank]) + 1))
        np.copyto(part, code, where=mask, casting="same_kind")


def _check_plane(box_xyxy: Box) -> None:
    if not plane_fits(box_xyxy):
        size = (box_xyxy[2] - box_xyxy[0] + 1, box_xyxy[3] - box_xyxy[1] + 1)
        limit = f"sides up to {PLANE_SIDE_MAX} px and at most {PLANE_AREA_MAX} px in all"
        raise InputError(f"bounds: expected a plane of {limit}, got {size[0]} x {size[1]}")
