"""Kernels that draw boxes of a code plane anew; `painting_jit` has the compiled twins."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Codes, Ints
from planes.spans import Box, meets
from planes.stack import Stack

__all__ = ["draw", "paint", "places_of"]


PAIRS = 2**18
"""Boxes against boxes that are compared at a time."""

GROUP = 8
"""Items that are drawn at a time, each as one bit of a byte."""

GROUPED_AREA = 2**14
"""Pixels of a box up to which groups pay; in larger ones each item is drawn by itself."""

WEIGHTS = np.array([1 << k for k in range(GROUP)], np.uint64)


def _entry(bits: int) -> int:
    """Which of the codes of a group, 0 and two for each item, is that of a byte: the second if it has more bits."""
    return 2 * (bits & -bits).bit_length() - (bits.bit_count() == 1) if bits else 0


ENTRIES = np.array([_entry(bits) for bits in range(1 << GROUP)])


def places_of(stack: Stack) -> Ints:
    """What the items of a stack are drawn from: rows (M, 6) of box, offset of the mask, and code in front."""
    places = np.empty((len(stack), 6), np.int64)
    places[:, :4], places[:, 4] = stack.box_xyxy, stack.offset
    np.multiply(stack.ids + 1, 2, out=places[:, 5])
    return places


def paint(codes: Codes, x: int, y: int, dirty: Ints, places: Ints, masks: Bools) -> None:
    """Draw boxes of a code plane anew.

    Parameters
    ----------
    codes : (h, w) plane, changed in place
    x, y : pixel of the world at [0, 0]
    dirty : (n, 4) inclusive boxes, none empty, inside the plane
    places : of the items, front to back
    masks : flat booleans of all masks
    """
    boxes = places[:, :4]
    step = max(1, PAIRS // max(len(places), 1))
    for begin in range(0, len(dirty), step):
        part = dirty[begin : begin + step]
        ends, rank = _met(part, boxes)
        rows = places.take(rank, axis=0).tolist()
        for number, (left, top, right, low) in enumerate(part.tolist()):
            block = codes[top - y : low - y + 1, left - x : right - x + 1]
            draw(block, (left, top, right, low), rows[ends[number] : ends[number + 1]], masks)


def _met(dirty: Ints, boxes: Ints) -> tuple[list[int], Ints]:
    """Find the boxes that each dirty one meets, in order, one after another; and where each one's begin and end."""
    if len(dirty) == 1:
        rank = np.flatnonzero(meets(dirty[0], boxes))
        return [0, len(rank)], rank
    row, rank = np.nonzero(meets(dirty[:, None], boxes))
    return np.searchsorted(row, np.arange(len(dirty) + 1)).tolist(), rank


def draw(block: Codes, box: Box, rows: list[list[int]], masks: Bools) -> None:
    """Draw the part of a plane in a box anew.

    Parameters
    ----------
    block : that part, changed in place
    rows : places of all items that meet it, front to back, and perhaps of others
    """
    if block.size <= GROUPED_AREA:
        _draw_grouped(block, box, rows, masks)
    else:
        _draw_each(block, box, rows, masks)


def _draw_grouped(block: Codes, box: Box, rows: list[list[int]], masks: Bools) -> None:
    """Draw a block: groups of items, the last in front, a bit for each; a table tells the code of each byte."""
    last = len(rows) - 1
    for begin in range(last - last % GROUP, -1, -GROUP):
        group = rows[begin : begin + GROUP]
        bits = _bits(block.shape, box, group, masks)
        front = _table(group, block.dtype).take(bits)
        if begin + GROUP <= last:
            front = np.where(bits, front | (block != 0), block)
        block[:] = front
    if last < 0:
        block[:] = 0


def _table(group: list[list[int]], kind: npt.DTypeLike) -> Codes:
    """The code of each byte, a bit for each item of a group: that of the lowest, and whether there are more."""
    codes = [0]
    for row in group:
        codes += (row[5], row[5] + 1)
    return np.array(codes, kind).take(ENTRIES[: 1 << len(group)])


@functools.cache
def _row_of(width: int) -> np.dtype[np.void]:
    """So many bytes that are copied as a whole."""
    return np.dtype(f"V{width}")


def _bits(shape: tuple[int, ...], box: Box, group: list[list[int]], masks: Bools) -> npt.NDArray[np.uint8]:
    """Which of up to eight items cover each pixel of a box: the lowest bit is the first."""
    (height, width), (left, top, right, low) = shape, box
    words = (height * width + 7) // 8
    planes = np.zeros((len(group), words), np.uint64)  # a byte for each pixel, 0 or 1: eight at a time are added up
    begin = -top * width - left
    for x, y, x_max, y_max, offset, _ in group:
        x0, y0 = x if x > left else left, y if y > top else top
        x1, y1 = x_max if x_max < right else right, y_max if y_max < low else low
        if x0 <= x1 and y0 <= y1:
            rows, row, own = (y1 - y0 + 1,), _row_of(x1 - x0 + 1), x_max - x + 1
            source = np.ndarray(rows, row, masks, offset + (y0 - y) * own + x0 - x, (own,))
            np.ndarray(rows, row, planes, begin + y0 * width + x0, (width,))[:] = source
        begin += 8 * words
    bits = WEIGHTS[: len(group)] @ planes
    return bits.view(np.uint8)[: height * width].reshape(shape)


def _draw_each(block: Codes, box: Box, rows: list[list[int]], masks: Bools) -> None:
    """Draw a block item by item, back to front."""
    left, top, right, low = box
    block[:] = 0
    for x, y, x_max, y_max, offset, code in reversed(rows):
        width = x_max - x + 1
        x0, y0, x1, y1 = max(left, x), max(top, y), min(right, x_max), min(low, y_max)
        if x0 > x1 or y0 > y1:
            continue
        mask = masks[offset + (y0 - y) * width : offset + (y1 - y + 1) * width].reshape(-1, width)
        part = block[y0 - top : y1 - top + 1, x0 - left : x1 - left + 1]
        more = (part != 0) + block.dtype.type(code)
        np.copyto(part, more, where=mask[:, x0 - x : x1 - x + 1])
