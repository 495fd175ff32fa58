"""Compiled twins of `planes.painting`."""

from __future__ import annotations

from numba import njit

from planes.arrays import Bools, Codes, Ints

__all__ = ["paint"]


@njit(cache=True)
def paint(codes: Codes, x: int, y: int, dirty: Ints, ids: Ints, boxes: Ints, offset: Ints, masks: Bools) -> None:
    """Draw boxes of a code plane anew, back to front; see `planes.painting.paint`."""
    one, zero = codes.dtype.type(1), codes.dtype.type(0)
    for d in range(len(dirty)):
        left, top, right, low = dirty[d, 0], dirty[d, 1], dirty[d, 2], dirty[d, 3]
        for row in range(top - y, low - y + 1):
            codes[row, left - x : right - x + 1] = zero
        for rank in range(len(ids) - 1, -1, -1):
            if boxes[rank, 0] > right or boxes[rank, 2] < left or boxes[rank, 1] > low or boxes[rank, 3] < top:
                continue
            code = codes.dtype.type(2 * (ids[rank] + 1))
            width = boxes[rank, 2] - boxes[rank, 0] + 1
            x0, x1 = max(left, boxes[rank, 0]), min(right, boxes[rank, 2])
            y0, y1 = max(top, boxes[rank, 1]), min(low, boxes[rank, 3])
            begin = offset[rank] + (y0 - boxes[rank, 1]) * width + x0 - boxes[rank, 0]
            n = x1 - x0 + 1
            for row in range(y0 - y, y1 - y + 1):
                part, mask = codes[row, x0 - x : x1 - x + 1], masks[begin : begin + n]
                for i in range(n):
                    old = part[i]
                    new = code + one if old != zero else code
                    part[i] = new if mask[i] else old
                begin += width
