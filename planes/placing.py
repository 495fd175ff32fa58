"""Kernels that place many items at once; `placing_jit` has the compiled twins."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, Ints, all_within, rising
from planes.constants import POSITION_MAX
from planes.grid256 import snap

__all__ = ["boxes_at", "place"]


def place(
    ids: Ints, xy: Floats, count: int, alive: Ints, edge: Ints, position_256: Ints, box: Ints, before: Ints, after: Ints
) -> bool:
    """Place items at new positions and tell whether that was done: all or nothing.

    Nothing is done unless the ids are rising, all in the scene, and all positions finite and in range.

    Parameters
    ----------
    ids, xy : (n,) and (n, 2), px; neither is kept
    count : of the ids of the scene
    alive, edge, position_256, box : columns of `Items`; the last two are changed
    before, after : (n, 4) is filled with the items' boxes
    """
    if not (rising(ids, count) and all_within(xy, -POSITION_MAX, POSITION_MAX) and alive.take(ids).all()):
        return False
    n, first = len(ids), int(ids[0]) if len(ids) else 0
    some = slice(first, first + n) if n and ids[-1] - first == n - 1 else ids
    now = snap(xy)
    before[:] = box[some]
    after[:] = boxes_at(now, edge[some])
    position_256[some], box[some] = now, after
    return True


def boxes_at(position_256: Ints, edge: Ints) -> Ints:
    """Boxes (n, 4) of items at positions (n, 2); `edge` is the way to the first and last pixel (n, 4), 1/256 px."""
    pairs = np.ascontiguousarray(position_256).view(np.complex128)  # x and y are copied as one
    boxes = np.repeat(pairs, 2).view(np.int64).reshape(-1, 4)
    boxes += edge
    boxes >>= 8
    return np.asarray(boxes)
