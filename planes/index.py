"""The boxes of a scene's items in a broad phase, kept up to date from the journal."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from planes.arrays import Ints, choice
from planes.constants import INDEX_SLACK
from planes.items import Items

if TYPE_CHECKING:
    from planes.boxes import BroadPhase

__all__ = ["STRUCTURES", "Index"]

STRUCTURES = {"none": "BruteForce", "grid": "Grid", "quadtree": "Quadtree", "bvh": "Bvh"}
"""Names, and classes of `planes.broadphase`, which is loaded when an index is first read."""


PENDING = 32
"""Lists of changes that wait for the next answer before they are joined to one."""


INDEX_GROWTH = 4
"""A structure is made anew when it has so many times the boxes that it was made of: its cells were chosen for those."""


class Index:
    """Inclusive pixel boxes of the items that decide, in one structure; a change costs what it changes.

    Threads may ask the index of a scene that none of them changes.

    Parameters
    ----------
    structure : one of STRUCTURES

    Attributes
    ----------
    boxes : the structure, None before the first answer
    followed : boxes that were placed for the last answer
    missed : what those who did without it have lost so far, in whatever unit they count
    """

    def __init__(self, structure: str) -> None:
        self.structure = choice("structure", structure, tuple(STRUCTURES))
        self.boxes: BroadPhase | None = None
        self.followed = 0
        self.missed = 0.0
        self._pending: list[Ints] = []
        self._seen = -1
        self._made_of = 0
        self._place_of = np.zeros(0, np.int64)
        self._item_of = np.zeros(0, np.int64)
        self._lock = threading.Lock()

    def owed(self, items: Items) -> int:
        """Boxes that must be placed before the next answer; each change is looked at once."""
        with self._lock:
            return self._owed(items)

    def read(self, items: Items) -> BroadPhase:
        """Bring the structure to the present version."""
        with self._lock:
            self.followed = self._owed(items)
            if self.boxes is None:
                from planes import broadphase

                self.missed = 0.0
                ids = np.sort(items.stack().ids)
                self.boxes = getattr(broadphase, STRUCTURES[self.structure])(items.boxes(ids))
                self._item_of, self._place_of = ids, np.full(items.count, -1)
                self._place_of[ids] = np.arange(len(ids))
                self._made_of = len(ids)
            elif self.followed:
                self._follow(self.boxes, items, np.unique(np.concatenate(self._pending)))
            self._pending = []
            return self.boxes

    def query(self, items: Items, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Find the items whose box shares a pixel with inclusive boxes (n, 4), none empty: (row, item id)."""
        row, place = self.read(items).query(boxes_xyxy.astype(np.float64))
        return row, self._item_of[place]

    def _owed(self, items: Items) -> int:
        if self.boxes is not None and self._seen != items.version:
            changed = items.changed_ids(self._seen)
            if changed is None:
                self.boxes = None
            else:
                self._pending.append(changed)
            if len(self._pending) > PENDING:
                self._pending = [np.unique(np.concatenate(self._pending))]
        self._seen = items.version
        if self.boxes is not None and (
            len(self._item_of) > 2 * len(self.boxes) + INDEX_SLACK
            or len(items.stack()) > INDEX_GROWTH * self._made_of + 16
        ):
            self.boxes = None
        if self.boxes is None:
            return len(items.stack())
        return sum(map(len, self._pending))

    def _follow(self, boxes: BroadPhase, items: Items, changed: Ints) -> None:
        """Insert, remove or move the boxes of items that changed."""
        self._place_of = np.concatenate([self._place_of, np.full(items.count - len(self._place_of), -1)])
        now = items.deciding_boxes(changed)
        there, place = now[:, 0] <= now[:, 2], self._place_of[changed]
        known = place >= 0
        boxes.remove(place[known & ~there])
        boxes.move(place[known & there], now[known & there])
        new = boxes.insert(now[~known & there])
        self._place_of[changed[~there]] = -1
        self._place_of[changed[~known & there]] = new
        self._item_of = np.concatenate([self._item_of, changed[~known & there]])
