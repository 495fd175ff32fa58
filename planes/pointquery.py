"""What lies in front at single pixels: reads of a code plane, most of which its coarse map spares.

Functions from arrays to arrays; `pointquery_jit` has the same ones, compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planes.arrays import Bools, Codes, Ints
from planes.grid256 import pixel
from planes.spans import Box

__all__ = ["CELL_BITS", "Front", "front_at", "occupied"]

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
    objects : by id, whether it can be hit
    """
    xy = pixel(at_256)
    column, row = xy[:, 0] - plane_xyxy[0], xy[:, 1] - plane_xyxy[1]
    some = _inside(column, row, codes.shape)
    if cells is not None:
        some = _narrowed(some, _read(cells, column, row, some, CELL_BITS).nonzero()[0])
    code = _read(codes, column, row, some, 0)
    front = code.nonzero()[0]
    item = (code.take(front) >> 1).astype(np.int64)
    item -= 1
    hit = objects.take(item).nonzero()[0]
    place = _narrowed(some, front.take(hit))
    return Front(place, item.take(hit), xy.take(place, axis=0))


def _inside(column: Ints, row: Ints, shape: tuple[int, ...]) -> Ints | None:
    """Which pixels (n,) a plane has; None if it has all."""
    height, width = shape
    far = column.view(np.uint64), row.view(np.uint64)  # what lies before the plane is far beyond it
    if int(far[0].max(initial=0)) < width and int(far[1].max(initial=0)) < height:
        return None
    return ((far[0] < width) & (far[1] < height)).nonzero()[0]


def _narrowed(some: Ints | None, rows: Ints) -> Ints:
    """Some of the rows that were picked, None of all."""
    return rows if some is None else some.take(rows)


def _read(plane: Codes | Bools, column: Ints, row: Ints, some: Ints | None, bits: int) -> Codes | Bools:
    """What a plane (h, w) of cells of 2**bits px has at some pixels (n,)."""
    if some is not None:
        column, row = column.take(some), row.take(some)
    place = row >> bits
    place *= plane.shape[1]
    place += column >> bits if bits else column
    return plane.reshape(-1).take(place)
