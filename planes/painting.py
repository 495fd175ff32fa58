"""Kernels that draw boxes of a code plane anew; `painting_jit` has the compiled twins."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Codes, Ints
from planes.spans import Box, meets

__all__ = ["paint"]


PAIRS = 2**18
"""Boxes against boxes that are compared at a time."""

GROUP = 8
"""Items that are drawn at a time, each as one bit of a byte."""

GROUPED_AREA = 2**14
"""Pixels of a box up to which groups pay; in larger ones each item is drawn by itself."""

LOWEST = np.array([max((bits & -bits).bit_length() - 1, 0) for bits in range(1 << GROUP)])
"""Place of the lowest bit of a byte, and 0 where it has none."""

SEVERAL = np.array([bits.bit_count() > 1 for bits in range(1 << GROUP)])
"""Whether a byte has more bits than one."""

PLACES = np.arange(GROUP, dtype=np.uint8)[:, None]


def paint(codes: Codes, x: int, y: int, dirty: Ints, ids: Ints, boxes: Ints, offset: Ints, masks: Bools) -> None:
    """Draw boxes of a code plane anew.

    Parameters
    ----------
    codes : (h, w) plane, changed in place
    x, y : pixel of the world at [0, 0]
    dirty : (n, 4) inclusive boxes, none empty, inside the plane
    ids, boxes, offset, masks : columns of a `Stack`, front to back
    """
    step = max(1, PAIRS // max(len(ids), 1))
    for begin in range(0, len(dirty), step):
        part = dirty[begin : begin + step]
        ends, rank = _met(part, boxes)
        code, place = (2 * ids.take(rank) + 2).astype(codes.dtype), boxes.take(rank, axis=0).tolist()
        where = offset.take(rank).tolist()
        for number, (left, top, right, low) in enumerate(part.tolist()):
            of = slice(ends[number], ends[number + 1])
            block = codes[top - y : low - y + 1, left - x : right - x + 1]
            draw = _draw_grouped if block.size <= GROUPED_AREA else _draw_each
            draw(block, (left, top, right, low), code[of], place[of], where[of], masks)


def _met(dirty: Ints, boxes: Ints) -> tuple[list[int], Ints]:
    """Find the boxes that each dirty one meets, in order, one after another; and where each one's begin and end."""
    if len(dirty) == 1:
        rank = np.flatnonzero(meets(dirty[0], boxes))
        return [0, len(rank)], rank
    row, rank = np.nonzero(meets(dirty[:, None], boxes))
    return np.searchsorted(row, np.arange(len(dirty) + 1)).tolist(), rank


def _draw_grouped(block: Codes, box: Box, code: Codes, place: list[list[int]], where: list[int], masks: Bools) -> None:
    """Draw a block: groups of items, the last in front, a bit for each; a table tells the code of each byte."""
    last = len(code) - 1
    for begin in range(last - last % GROUP, -1, -GROUP):
        group = slice(begin, begin + GROUP)
        bits = _bits(block.shape, box, place[group], where[group], masks)
        table = code[group].take(LOWEST[: 1 << len(place[group])])
        table += SEVERAL[: len(table)]
        table[0] = 0
        front = table.take(bits)
        if begin + GROUP <= last:
            front = np.where(bits, front | (block != 0), block)
        block[:] = front
    if last < 0:
        block[:] = 0


def _bits(
    shape: tuple[int, ...], box: Box, place: list[list[int]], where: list[int], masks: Bools
) -> npt.NDArray[np.uint8]:
    """Which of up to eight items cover each pixel of a box: the lowest bit is the first."""
    (height, width), (left, top, right, low) = shape, box
    planes = np.zeros((len(place), height * width), np.uint8)
    begin = -top * width - left
    for (x, y, x_max, y_max), offset in zip(place, where, strict=True):
        x0, y0 = x if x > left else left, y if y > top else top
        x1, y1 = x_max if x_max < right else right, y_max if y_max < low else low
        rows, row, own = (y1 - y0 + 1,), f"V{x1 - x0 + 1}", x_max - x + 1  # rows are copied as wholes
        source = np.ndarray(rows, row, masks, offset + (y0 - y) * own + x0 - x, (own,))
        np.ndarray(rows, row, planes, begin + y0 * width + x0, (width,))[:] = source
        begin += height * width
    planes <<= PLACES[: len(place)]
    return np.asarray(np.bitwise_or.reduce(planes, axis=0)).reshape(shape)


def _draw_each(block: Codes, box: Box, code: Codes, place: list[list[int]], where: list[int], masks: Bools) -> None:
    """Draw a block item by item, back to front."""
    left, top, right, low = box
    block[:] = 0
    for item, (x, y, x_max, y_max), offset in zip(code[::-1], place[::-1], where[::-1], strict=True):
        width = x_max - x + 1
        x0, y0, x1, y1 = max(left, x), max(top, y), min(right, x_max), min(low, y_max)
        rows = masks[offset + (y0 - y) * width : offset + (y1 - y + 1) * width].reshape(-1, width)
        part = block[y0 - top : y1 - top + 1, x0 - left : x1 - left + 1]
        more = (part != 0) + item
        np.copyto(part, more, where=rows[:, x0 - x : x1 - x + 1])
