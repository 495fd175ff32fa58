"""The pre-filter: which items may a placed pattern touch, and which of them does the shot refuse.

It may keep too much; it never drops a hit.
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Bools, Ints
from planes.items import Stack, overlapping
from planes.sampling import Pairs
from weapons.volley import Shots

__all__ = ["PREFILTERS", "pairs_of", "refused"]

PREFILTERS = ("auto", "none", "box")


def pairs_of(boxes_xyxy: Ints, shot: Ints, shots: Shots, stack: Stack, prefilter: str) -> Pairs:
    """Pairs of placements and items, front to back.

    Parameters
    ----------
    boxes_xyxy : (P, 4) inclusive boxes of the placements
    shot : (P,) whose they are
    prefilter : "none" pairs everything; "box" (and "auto") what shares a pixel of its box
    """
    if prefilter == "none":
        placement = np.repeat(np.arange(len(boxes_xyxy)), len(stack))
        rank = np.tile(np.arange(len(stack)), len(boxes_xyxy))
    else:
        placement, rank = np.nonzero(overlapping(boxes_xyxy[:, None], stack.box_xyxy[None]))
    return Pairs(placement, rank, refused(stack, rank, shots, shot[placement]))


def refused(stack: Stack, rank: Ints, shots: Shots, shot: Ints) -> Bools:
    """Whether shots refuse items: no category in common with `accept`, or an excluded owner."""
    foreign = (stack.categories[rank] & shots.accept[shot]) == 0
    if not shots.exclude.shape[1]:
        return np.asarray(foreign)
    return np.asarray(foreign | (stack.owner[rank][:, None] == shots.exclude[shot]).any(axis=1))
