"""The clearance plane of a scene: how far each pixel lies from anything that decides hits."""

from __future__ import annotations

import threading

import numpy as np

from planes import jumps
from planes.arrays import Codes, Ints
from planes.compose import CodePlane
from planes.items import Items
from planes.jumps import PAD, Clearance
from planes.spans import Box, meets
from planes.twins import kernels_of

__all__ = ["ClearancePlane"]


class ClearancePlane:
    """City-block distances from what is on the code plane of a scene, made anew when that has changed.

    Threads may read that of a scene that none of them changes.

    Parameters
    ----------
    codes : the code plane
    missed : nanoseconds that it would have saved since the scene changed last, had it been there
    """

    def __init__(self, codes: CodePlane) -> None:
        self.codes = codes
        self.missed = 0.0
        self._clearance: Clearance | None = None
        self._seen = -1
        self._lock = threading.Lock()

    @property
    def corner_xy(self) -> Ints:
        """Pixel of the world at [0, 0]."""
        return np.array(self.codes.box_xyxy[:2]) - PAD

    def is_made(self, items: Items) -> bool:
        """Whether it is there as the scene is now."""
        with self._lock:
            return self._is_made(items)

    def _is_made(self, items: Items) -> bool:
        if self._seen != items.version:
            changes = items.changes(self._seen)
            if changes is None or any(self._holds(box) for _, _, *both in changes for box in both):
                self._clearance, self.missed = None, 0.0
            self._seen = items.version
        return self._clearance is not None

    def _holds(self, boxes_xyxy: Ints | Box) -> bool:
        """Whether one of some boxes lies on the plane, at least in part; those that end before they begin are empty."""
        box = np.reshape(boxes_xyxy, (-1, 4))
        return bool(
            (meets(box, np.array(self.codes.box_xyxy)) & (box[:, 0] <= box[:, 2]) & (box[:, 1] <= box[:, 3])).any()
        )

    def read(self, items: Items, codes: Codes) -> Clearance:
        """Distances (h + 2 PAD, w + 2 PAD) of the present version; `codes` are what the code plane reads then."""
        with self._lock:
            if not self._is_made(items) or self._clearance is None:
                self._clearance = kernels_of(jumps).clearance_of(codes != 0)
            return self._clearance
