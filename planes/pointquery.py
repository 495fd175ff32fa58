"""What lies in front at single pixels.

In a code plane: reads of it, most of which its coarse map spares. In a stack: items one by one, front to back.

Functions from arrays to arrays; `pointquery_jit` has the same ones, compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planes.arrays import Bools, Codes, Ints
from planes.cells import met_boxes, within
from planes.constants import HALF, SUB
from planes.grid256 import pixel
from planes.spans import Box, begins
from planes.stack import Stack

__all__ = ["CELL_BITS", "Front", "front_at", "front_of", "occupied"]

SUB_BITS = SUB.bit_length() - 1

CELL_BITS = 3
"""Cells of the coarse map have sides of 8 px: the map of a plane of 1920 x 1080 fits the level-1 cache."""


def occupied(codes: Codes) -> Bools:
    """Whether anything lies in each cell of a code plane (h, w), the last ones cut: its coarse map."""
    side = 1 << CELL_BITS
    rows = codes[::side].copy()
    for k in range(1, side):
        some = codes[k::side]
        rows[: len(some)] |= some
    cells = rows[:, ::side].copy()
    for k in range(1, side):
        some = rows[:, k::side]
        cells[:, : some.shape[1]] |= some
    return np.not_equal(cells, 0)


class Front(NamedTuple):
    """What lies in front at some of many positions: which of them (n,), the id of the object, and the pixel (n, 2)."""

    place: Ints
    object: Ints
    xy: Ints


def front_at(codes: Codes, cells: Bools | None, plane_xyxy: Box, at_256: Ints, objects: Bools) -> Front:
    """Objects that lie in front at positions (N, 2) in 1/256 px.

    Parameters
    ----------
    codes, plane_xyxy : a code plane (h, w), see `planes.compose`, and its box in the world
    cells : its coarse map, or None to read the plane alone
    objects : by id + 1, whether it can be hit; False by 0
    """
    x, y = (at_256[:, axis] + (HALF - SUB * plane_xyxy[axis]) for axis in (0, 1))  # from the corner of its first pixel
    high, wide = codes.shape
    some = within(x, y, wide << SUB_BITS, high << SUB_BITS)
    if cells is not None:
        some = _narrowed(some, _read(cells, x, y, some, SUB_BITS + CELL_BITS).nonzero()[0])
    front = _read(codes, x, y, some, SUB_BITS) >> 1
    hit = objects.take(front).nonzero()[0]
    place = _narrowed(some, hit)
    return Front(place, front.take(hit).astype(np.int64) - 1, pixel(at_256.take(place, axis=0)))


def front_of(stack: Stack, bounds: Box | None, at_256: Ints) -> Front:
    """Objects that lie in front at positions (N, 2) in 1/256 px, of all items of a stack, within bounds."""
    xy = pixel(at_256)
    place, rank = met_boxes(np.concatenate([xy, xy], axis=1), stack.box_xyxy)
    down = xy.take(place, axis=0) - stack.box_xyxy[:, :2].take(rank, axis=0)
    texel = stack.offset.take(rank) + down[:, 1] * stack.width.take(rank) + down[:, 0]
    on = stack.masks.take(texel).nonzero()[0]
    place, rank = place.take(on), rank.take(on)
    front = begins(place)
    if stack.has_occluders:
        front &= ~stack.occluder.take(rank)
    if bounds is not None:
        x, y = xy[:, 0].take(place), xy[:, 1].take(place)
        front &= (x >= bounds[0]) & (x <= bounds[2]) & (y >= bounds[1]) & (y <= bounds[3])
    some = front.nonzero()[0]
    place = place.take(some)
    return Front(place, stack.ids.take(rank.take(some)), xy.take(place, axis=0))


def _narrowed(some: Ints | None, rows: Ints) -> Ints:
    """Some of the rows that were picked, None of all."""
    return rows if some is None else some.take(rows)


def _read(plane: Codes | Bools, x: Ints, y: Ints, some: Ints | None, bits: int) -> Codes | Bools:
    """What a plane (h, w) of cells of 2**bits / 256 px has at some positions (n,), in 1/256 px."""
    if some is not None:
        x, y = x.take(some), y.take(some)
    place = y >> bits
    place *= plane.shape[1]
    place += x >> bits
    return plane.reshape(-1).take(place)
