"""Rows of pixels in one Python integer: bit `y * stride + x` is pixel (x, y). What a single shot is answered with.

A shift places a pattern on an object and `&` gives the pixels that they share, however many rows there are:

    y = 0   . # # .        stride 5: 0b01111_00110, the first pixel lowest
    y = 1   # # # #

The stride leaves room for both side by side, so that what sticks out of a row meets nothing in the next.
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Bools, Ints
from planes.spans import Spans

__all__ = ["packed", "pixels_of", "rows_of_spans"]


def packed(mask: Bools, stride: int) -> int:
    """Rows of a mask (h, w) with w <= stride."""
    padded = np.zeros((mask.shape[0], stride), np.bool_)
    padded[:, : mask.shape[1]] = mask
    return int.from_bytes(np.packbits(padded.reshape(-1), bitorder="little").tobytes(), "little")


def rows_of_spans(spans: Spans, corner_xy: tuple[int, int], stride: int) -> int:
    """Rows of a set of pixels, of which none lies before a corner."""
    mask, (x, y) = spans.to_mask()
    return packed(mask, stride) << (y - corner_xy[1]) * stride + x - corner_xy[0] if mask.size else 0


def pixels_of(bits: int, stride: int) -> Ints:
    """Pixels as rows (x, y), ordered by (y, x)."""
    data = np.frombuffer(bits.to_bytes((bits.bit_length() + 7) // 8, "little"), np.uint8)
    y, x = np.divmod(np.flatnonzero(np.unpackbits(data, bitorder="little")), stride)
    return np.stack([x, y], axis=1)
