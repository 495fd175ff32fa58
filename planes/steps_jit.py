"""Compiled twins of `planes.steps`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from planes.arrays import Bools, Codes, Ints
from planes.compiled import compiled
from planes.painting_jit import paint_item
from planes.steps import FIELD, GUARDS, NOWHERE, near_of

__all__ = ["follow", "follow_all", "near_of"]


@compiled()
def follow_all(codes: Codes, x: int, y: int, rank: Ints, now: Ints, places: Ints, near: Ints, masks: Bools) -> int:
    """Let many items take their steps; see `planes.steps.follow_all`."""
    pixels = 0
    for i in range(len(rank)):
        pixels += follow(codes, x, y, rank[i], now[i, 0], now[i, 1], now[i, 2], now[i, 3], places, near, masks)
    return pixels


@compiled()
def follow(
    codes: Codes, x: int, y: int, rank: int, left: int, top: int, right: int, low: int, places: Ints, near: Ints,
    masks: Bools,
) -> int:  # fmt: skip
    """Move one item to another box, and draw anew what that changes; see `planes.steps.follow`."""
    edge = x, y, x + codes.shape[1] - 1, y + codes.shape[0] - 1
    old = _cut(places[rank, 0], places[rank, 1], places[rank, 2], places[rank, 3], edge)
    new = _cut(left, top, right, low, edge)
    places[rank, 0], places[rank, 1], places[rank, 2], places[rank, 3] = left, top, right, low
    was, there = _pixels(old), _pixels(new)
    near[rank] = _fields(new[0] - x, new[1] - y, new[2] - x, new[3] - y) if there else NOWHERE
    around = min(old[0], new[0]), min(old[1], new[1]), max(old[2], new[2]), max(old[3], new[3])
    if was and there and _pixels(around) <= was + there:
        _draw(codes, x, y, around, places, near, masks)
        return was + there
    if was:
        _draw(codes, x, y, old, places, near, masks)
    if there:
        _draw(codes, x, y, new, places, near, masks)
    return was + there


@njit(inline="always")
def _cut(x: Any, y: Any, x_max: Any, y_max: Any, edge: Any) -> Any:
    """The part of a box that lies in another; it ends before it begins if there is none."""
    return max(x, edge[0]), max(y, edge[1]), min(x_max, edge[2]), min(y_max, edge[3])


@njit(inline="always")
def _pixels(box: Any) -> Any:
    """Pixels of a box; 0 of one that ends before it begins."""
    return max(box[2] - box[0] + 1, 0) * max(box[3] - box[1] + 1, 0)


@njit(inline="always")
def _fields(x: Any, y: Any, x_max: Any, y_max: Any) -> Any:
    """Four numbers of pixels of the plane as fields."""
    return x >> 2 | y >> 2 << 15 | (FIELD - (x_max >> 2)) << 30 | (FIELD - (y_max >> 2)) << 45


@compiled()
def _draw(codes: Codes, x: int, y: int, box: Any, places: Ints, near: Ints, masks: Bools) -> None:
    """Draw a box anew, with the items near it, back to front."""
    left, top, right, low = box
    codes[top - y : low - y + 1, left - x : right - x + 1] = 0
    limits = _fields(right - x, low - y, left - x, top - y) | GUARDS
    found, count = np.empty(len(near), np.int64), 0
    for rank in range(len(near)):
        if (limits - near[rank]) & GUARDS == GUARDS:
            found[count] = rank
            count += 1
    for i in range(count - 1, -1, -1):
        paint_item(codes, x, y, left, top, right, low, places[found[i]], masks)
