"""Kernels that let a code plane follow items that only moved; `steps_jit` has the compiled twins.

Which items lie near a box is told by one number for each of them: four fields of 14 bits, with a bit between them.

    . x/4 . y/4 . -x_max/4 . -y_max/4          fields of an item; of a box: right, low, -left, -top
    1     1     1          1                   set in the box: what is left of each where its field is no less

A box and an item may meet where all four are left after a subtraction. The fields are the pixels of the plane by 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planes.arrays import Bools, Codes, Ints
from planes.painting import draw
from planes.spans import Box

__all__ = ["FIELD", "GUARDS", "NOWHERE", "cut", "follow", "follow_all", "joined", "near_of"]

FIELD = 2**14 - 1
"""The greatest that a field holds; planes are so small that no box has it on all sides."""

GUARDS = 1 << 14 | 1 << 29 | 1 << 44 | 1 << 59
NOWHERE = FIELD | FIELD << 15 | FIELD << 30 | FIELD << 45
"""Of an item that is not on the plane: no box has as great fields."""


def near_of(places: Ints, x: int, y: int, height: int, width: int) -> Ints:
    """The number of each item (M,) by which those near a box are found; see `follow` and `painting.places_of`."""
    left, top = np.maximum(places[:, 0] - x, 0), np.maximum(places[:, 1] - y, 0)
    right, low = np.minimum(places[:, 2] - x, width - 1), np.minimum(places[:, 3] - y, height - 1)
    fields = left >> 2 | top >> 2 << 15 | (FIELD - (right >> 2)) << 30 | (FIELD - (low >> 2)) << 45
    return np.where((left <= right) & (top <= low), fields, NOWHERE)


def follow_all(codes: Codes, x: int, y: int, rank: Ints, now: Ints, places: Ints, near: Ints, masks: Bools) -> int:
    """Let many items take their steps, (n,) of them to boxes (n, 4), one after another; see `follow`."""
    pixels = 0
    for item, (left, top, right, low) in zip(rank.tolist(), now.tolist(), strict=True):
        pixels += follow(codes, x, y, item, left, top, right, low, places, near, masks)
    return pixels


def follow(
    codes: Codes, x: int, y: int, rank: int, left: int, top: int, right: int, low: int, places: Ints, near: Ints,
    masks: Bools,
) -> int:  # fmt: skip
    """Move one item to another box, and draw anew what that changes.

    Where its old and new box are nearly the same, they are drawn as one.

    Parameters
    ----------
    codes : (h, w) plane, changed in place
    x, y : pixel of the world at [0, 0]
    rank : of the item
    left, top, right, low : its box now, of the same size
    places : of all items, changed in place; see `painting.places_of`
    near : (M,) of `near_of`, changed in place
    masks : flat booleans of all masks

    Returns
    -------
    pixels of the plane in its boxes, before and now
    """
    height, width = codes.shape
    edge = (x, y, x + width - 1, y + height - 1)
    place, box = places[rank], (left, top, right, low)
    boxes, pixels = joined(cut(place.tolist(), edge), new := cut(box, edge))
    place[:4] = box
    near[rank] = _fields(new, x, y) if new else NOWHERE
    for left, top, right, low in boxes:
        limits = _fields((right, low, left, top), x, y) | GUARDS
        found = ((limits - near) & GUARDS == GUARDS).nonzero()[0]
        block = codes[top - y : low - y + 1, left - x : right - x + 1]
        draw(block, (left, top, right, low), places.take(found, axis=0).tolist(), masks)
    return pixels


def _fields(box: Box, x: int, y: int) -> int:
    """Four numbers of pixels as fields; (x, y) is the pixel [0, 0] of the plane."""
    left, top, right, low = box
    return left - x >> 2 | top - y >> 2 << 15 | FIELD - (right - x >> 2) << 30 | FIELD - (low - y >> 2) << 45


def cut(place: Sequence[int], edge: Box) -> Box | None:
    """The part of a box, the first four numbers of a place, that lies in another; None if there is none."""
    x, y, x_max, y_max = place[:4]
    left, top, right, low = edge
    x, y = x if x > left else left, y if y > top else top
    x_max, y_max = x_max if x_max < right else right, y_max if y_max < low else low
    return (x, y, x_max, y_max) if x <= x_max and y <= y_max else None


def joined(old: Box | None, new: Box | None) -> tuple[Sequence[Box], int]:
    """Boxes to be drawn where an item was and is, one where that is no more to draw; and the pixels of both."""
    if not old or not new:
        one = old or new
        return ((one,), _pixels(one)) if one else ((), 0)
    pixels = _pixels(old) + _pixels(new)
    (x, y, x_max, y_max), (left, top, right, low) = old, new
    around = (
        x if x < left else left, y if y < top else top,
        x_max if x_max > right else right, y_max if y_max > low else low,
    )  # fmt: skip
    return (around,) if _pixels(around) <= pixels else (old, new), pixels


def _pixels(box: Box) -> int:
    return (box[2] - box[0] + 1) * (box[3] - box[1] + 1)
