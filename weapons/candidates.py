"""The pre-filter: which items may a placed pattern touch, and which of them does the shot refuse.

1. Boxes: one by one, or by a broad phase (grid, quadtree, BVH) that follows the scene.
2. Volumes: the item's and the pattern's (circle, oriented box, k boxes, polygon, swept), about the pattern's origin.

It may keep too much; it never drops a hit: a pixel that is shared lies, with its whole square, in both volumes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planes import cells
from planes.arrays import Bools, Ints, choice
from planes.constants import BOXES_MAX
from planes.index import Index
from planes.items import Items, Stack, boxes_in
from planes.sampling import BLOCK, HIT, SKIP, Kinds, Pairs
from planes.spans import meets
from planes.twins import kernels_of
from weapons.volley import Shots, Volley

__all__ = [
    "PREFILTERS", "Candidates", "Prefilter", "kinds", "may_refuse", "pairs_of", "prefilter_of", "refused"
]  # fmt: skip

PREFILTERS = ("auto", "none", "box", "circle", "oriented box", "4 boxes", "polygon", "swept")
"""Names of pre-filters; any number of boxes up to BOXES_MAX is one."""


class Prefilter(NamedTuple):
    """What goes before the pixels.

    Parameters
    ----------
    name : one of PREFILTERS
    volume : the items' kind of volume, one of `planes.bounding.KINDS`; empty for boxes alone, or nothing
    k : the most boxes of "boxes"
    """

    name: str
    volume: str = ""
    k: int = 1

    def __str__(self) -> str:
        return f"{self.k} boxes" if self.name == "boxes" else self.name


BOX = Prefilter("box")


def prefilter_of(name: object) -> Prefilter:
    """Read the name of a pre-filter: one of PREFILTERS, with any number of boxes."""
    return _known(name) if isinstance(name, str) else _named(name)


@lru_cache(maxsize=len(PREFILTERS) + BOXES_MAX)
def _known(name: str) -> Prefilter:
    return _named(name)


def _named(name: object) -> Prefilter:
    k = boxes_in("prefilter", name)
    if k is not None:
        return Prefilter("boxes", "boxes", k)
    known = choice("prefilter", name, PREFILTERS)
    if known in PREFILTERS[:3]:
        return Prefilter(known)
    return Prefilter(known, "circle" if known == "swept" else known)


def pairs_of(boxes_xyxy: Ints, shot: Ints, shots: Shots, stack: Stack) -> Pairs:
    """Pairs of placements and items whose boxes share a pixel, front to back.

    Parameters
    ----------
    boxes_xyxy : (P, 4) inclusive boxes of the placements
    shot : (P,) whose they are
    """
    placement, rank = np.nonzero(meets(boxes_xyxy[:, None], stack.box_xyxy[None]))
    return Pairs(placement, rank, kinds(stack, rank, refused(stack, rank, shots, shot[placement])))


def may_refuse(stack: Stack, shots: Shots) -> bool:
    """Whether any shot may refuse any item."""
    return shots.choosy or stack.has_unmet


def kinds(stack: Stack, rank: Ints, refuses: Bools | None) -> Kinds:
    """What items do to the samples of shots that refuse some of them, or none: HIT, BLOCK or SKIP."""
    kind = np.full(len(rank), HIT, np.uint8)
    if stack.has_occluders:
        kind[stack.occluder[rank]] = BLOCK
    if refuses is not None:
        kind[refuses] = SKIP
    return kind


def refused(stack: Stack, rank: Ints, shots: Shots, shot: Ints) -> Bools:
    """Whether shots refuse items: no category in common with `accept`, or an excluded owner."""
    foreign = (stack.categories[rank] & shots.accept[shot]) == 0
    if not shots.exclude.shape[1]:
        return np.asarray(foreign)
    return np.asarray(foreign | (stack.owner[rank][:, None] == shots.exclude[shot]).any(axis=1))


@dataclass
class Candidates:
    """The pre-filter of one call.

    Parameters
    ----------
    items, stack : what may be hit, and its order
    prefilter : what goes before the pixels
    index : the broad phase; None compares all boxes
    why, why_unindexed : why this pre-filter, and why no broad phase
    met : pairs of boxes that met, so far
    """

    items: Items
    stack: Stack
    prefilter: Prefilter = BOX
    index: Index | None = None
    why: str = "boxes that share a pixel"
    why_unindexed: str = "as asked for"
    met: int = 0

    def meeting(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Rows and ranks of boxes (P, 4) and items that share a pixel; of all, without a pre-filter."""
        if self.prefilter.name == "none":
            return self.every(len(boxes_xyxy))
        row, rank = self._meeting(boxes_xyxy)
        self.met += len(rank)
        return row, rank

    def every(self, n: int) -> tuple[Ints, Ints]:
        """Rows and ranks of n boxes and all items."""
        m = len(self.stack)
        self.met += n * m
        return np.repeat(np.arange(n), m), np.tile(np.arange(m), n)

    def _meeting(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        if self.index is None:
            found: tuple[Ints, Ints] = kernels_of(cells).met_boxes(boxes_xyxy, self.stack.box_xyxy)
            return found
        m = len(self.stack)
        some = np.flatnonzero((boxes_xyxy[:, :2] <= boxes_xyxy[:, 2:]).all(axis=1))
        row, item = self.index.query(self.items, boxes_xyxy[some])
        row, rank = np.divmod(np.sort(some[row] * m + self.stack.rank_of[item]), m)
        return row, rank

    def near(self, volley: Volley, placement: Ints, rank: Ints) -> Bools:
        """Whether the volumes of pattern and item meet, or may; of pairs whose boxes do."""
        from planes.bounding import Kind  # nothing of volumes is loaded before they are asked for
        from weapons.narrow import near

        kind = Kind(self.prefilter.volume, self.prefilter.k)
        found = volley.count[placement] > 0  # the box of an empty pattern lies within others
        found[found] = near(self.prefilter.name, kind, self.items, self.stack, volley, placement[found], rank[found])
        return found
