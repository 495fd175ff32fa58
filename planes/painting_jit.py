"""Compiled twins of `planes.painting`."""

from __future__ import annotations

from typing import Any

from planes.arrays import Bools, Codes, Ints
from planes.compiled import compiled

__all__ = ["paint", "paint_item"]


@compiled()
def paint(codes: Codes, x: int, y: int, dirty: Ints, places: Ints, masks: Bools) -> None:
    """Draw boxes of a code plane anew, back to front; see `planes.painting.paint`."""
    for d in range(len(dirty)):
        left, top, right, low = dirty[d, 0], dirty[d, 1], dirty[d, 2], dirty[d, 3]
        codes[top - y : low - y + 1, left - x : right - x + 1] = 0
        for rank in range(len(places) - 1, -1, -1):
            place = places[rank]
            if place[0] <= right and place[2] >= left and place[1] <= low and place[3] >= top:
                paint_item(codes, x, y, left, top, right, low, place, masks)


@compiled()
def paint_item(
    codes: Codes, x: int, y: int, left: int, top: int, right: int, low: int, place: Any, masks: Bools
) -> None:
    """Lay the part of an item that is in a box over what is drawn there."""
    zero, one = codes.dtype.type(0), codes.dtype.type(1)
    code = codes.dtype.type(place[5])
    width = place[2] - place[0] + 1
    x0, x1, y0, y1 = max(left, place[0]), min(right, place[2]), max(top, place[1]), min(low, place[3])
    begin = place[4] + (y0 - place[1]) * width + x0 - place[0]
    n = x1 - x0 + 1
    for row in range(y0 - y, y1 - y + 1):
        part, mask = codes[row, x0 - x : x1 - x + 1], masks[begin : begin + n]
        for i in range(n):
            old = part[i]
            new = code + one if old != zero else code
            part[i] = new if mask[i] else old
        begin += width
