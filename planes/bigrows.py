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

__all__ = ["packed", "pixels_of", "rows_of_spans", "shared", "spans_of", "struck_from", "window"]


def packed(mask: Bools, stride: int) -> int:
    """Rows of a mask (h, w) with w <= stride."""
    padded = np.zeros((mask.shape[0], stride), np.bool_)
    padded[:, : mask.shape[1]] = mask
    return int.from_bytes(np.packbits(padded.reshape(-1), bitorder="little").tobytes(), "little")


def rows_of_spans(spans: Spans, corner_xy: tuple[int, int], stride: int) -> int:
    """Rows of a set of pixels, of which none lies before a corner."""
    mask, (x, y) = spans.to_mask()
    return packed(mask, stride) << (y - corner_xy[1]) * stride + x - corner_xy[0] if mask.size else 0


def shared(rows: int, bits: int, shift: int) -> int:
    """Pixels of `rows`, moved by `shift` bits, that are in `bits`; as rows of `bits`."""
    return rows << shift & bits if shift >= 0 else rows >> -shift & bits


def widened(bits: int, width: int) -> int:
    """Each pixel and those right of it, `width` in all."""
    reach = 1
    while 2 * reach <= width:
        bits |= bits << reach
        reach *= 2
    return bits | bits << width - reach


def struck_from(bits: int, spans: Spans, side: int, stride: int) -> int:
    """Places from which a pattern would meet some pixels, as rows that begin side - 1 px left of and above them.

    Parameters
    ----------
    spans : the pattern, in a box from (0, 0) to (side - 1, side - 1)
    """
    wide: dict[int, int] = {}
    found = 0
    for y, first, last in spans.runs().tolist():
        width = last - first + 1
        if width not in wide:
            wide[width] = widened(bits, width)
        found |= wide[width] << (side - 1 - y) * stride + side - 1 - last
    return found


def window(bits: int, x: int, y: int, side: int, stride: int) -> Bools:
    """Pixels of a square (side, side) that begins at (x, y), wherever that is."""
    part = bits >> y * stride if y >= 0 else bits << -y * stride
    part &= (1 << side * stride) - 1
    data = np.frombuffer(part.to_bytes((side * stride + 7) // 8, "little"), np.uint8)
    rows = np.unpackbits(data, count=side * stride, bitorder="little").reshape(side, stride)
    found = np.zeros((side, side), np.bool_)
    first, last = max(x, 0), min(x + side, stride)
    if first < last:
        found[:, first - x : last - x] = rows[:, first:last]
    return found


def pixels_of(bits: int, stride: int) -> Ints:
    """Pixels as rows (x, y), ordered by (y, x)."""
    data = np.frombuffer(bits.to_bytes((bits.bit_length() + 7) // 8, "little"), np.uint8)
    y, x = np.divmod(np.flatnonzero(np.unpackbits(data, bitorder="little")), stride)
    return np.stack([x, y], axis=1)


def spans_of(bits: int, stride: int) -> Spans:
    """The rows as runs."""
    high = -(-bits.bit_length() // stride)
    data = np.frombuffer(bits.to_bytes((high * stride + 7) // 8, "little"), np.uint8)
    return Spans.from_mask(np.unpackbits(data, count=high * stride, bitorder="little").reshape(high, stride) != 0)
