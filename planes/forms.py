"""What of a pose changes a mask, as integers; and frames flipped, scaled and turned by it.

A turn is 90 k + r degrees: k by exact turns of the array, r by inverse mapping in integers. A pixel of the result is
set when its centre, mapped back, lies in a closed pixel square that is set; so a mirrored sprite turns into the mirror
image (but at odd multiples of 45 degrees where width and height are odd and even: there the quarter turn settles how
the pixels lie). Picture and mask go through the same map: what is drawn is what is tested.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from planes import turning
from planes.arrays import Bools, InputError, Ints, real
from planes.constants import (
    HALF,
    MASK_AREA_MAX,
    MASK_SIDE_MAX,
    SCALE_BITS,
    SCALE_MAX,
    SCALE_MIN,
    SUB,
    TRIG_BITS,
)
from planes.grid256 import over_one, rounded_div
from planes.twins import kernels_of

__all__ = ["FLIPS", "ONE", "Form", "check_size", "flipped", "mapped", "whole_scale"]

FLIPS = ("none", "x", "y", "xy")
ONE = 1 << SCALE_BITS

FINE_BITS = TRIG_BITS - SCALE_BITS
"""By what a turned position is finer than one that is scaled."""

MAPPED_NS = 20
"""What it takes in numpy to turn a pixel of a mask."""


class Form(NamedTuple):
    """All of a pose that changes a mask, as integers: frame, flip, scale in 1/65536, quarter turns and the rest."""

    frame: int = 0
    flip: str = "none"
    scale_x: int = ONE
    scale_y: int = ONE
    quarter: int = 0
    c: int = 1 << TRIG_BITS
    s: int = 0

    @property
    def plain(self) -> bool:
        """No inverse mapping is needed: nothing but flips and quarter turns."""
        return self.scale_x == self.scale_y == ONE and self.s == 0


def whole_scale(x: float, y: float) -> tuple[int, int]:
    """Check a scale and round it to 1/65536."""
    x, y = real("scale[0]", x, SCALE_MIN, SCALE_MAX), real("scale[1]", y, SCALE_MIN, SCALE_MAX)
    return round(x * ONE), round(y * ONE)


def mapped(mask: Bools, pivot_256: tuple[int, int], form: Form) -> tuple[Ints, Bools, int, int]:
    """Flip, scale and turn a frame.

    Returns
    -------
    for each pixel of the result the flat index of the flipped frame's pixel that it comes from, -1 for none; whether
    that one is set; and the pivot (x, y)
    """
    h, w = mask.shape
    x, y = pivot_256
    held = flipped(mask, form.flip)
    source = np.arange(h * w).reshape(h, w)
    if "x" in form.flip:
        x = SUB * (w - 1) - x
    if form.flip in ("y", "xy"):
        y = SUB * (h - 1) - y
    if not form.plain and mask.size:
        source, held, x, y = _inverse_mapped(held, x, y, form)
    for _ in range(form.quarter):
        source, held, x, y = source.T[:, ::-1], held.T[:, ::-1], SUB * (held.shape[0] - 1) - y, x
    return source, held, x, y


def flipped(array: npt.NDArray[Any], flip: str) -> npt.NDArray[Any]:
    """An array (h, w, ...) flipped, in one piece."""
    return np.ascontiguousarray(array[:: -1 if flip in ("y", "xy") else 1, :: -1 if "x" in flip else 1])


def _inverse_mapped(inside: Bools, x: int, y: int, form: Form) -> tuple[Ints, Bools, int, int]:
    """Scale and turn by r: map each centre of the result back to the squares of the frame that hold it.

    A centre (dx, dy) from the pivot is (dx c + dy s, dy c - dx s) from it on the frame, in 2**-38 px of the result:
    divided by the scale, and counted from the border of pixel [0, 0], it tells column and row.
    """
    h, w = inside.shape
    (left, top), size_wh = _result_grid((w, h), (x, y), form)
    c, s = form.c, form.s
    column = (x + HALF) * (form.scale_x << FINE_BITS) - left * c - top * s
    row = (y + HALF) * (form.scale_y << FINE_BITS) - top * c + left * s
    unit = (SUB * form.scale_x << FINE_BITS, SUB * form.scale_y << FINE_BITS)
    kernel = kernels_of(turning, size_wh[0] * size_wh[1] * MAPPED_NS).inverse_mapped
    source, held = kernel(inside, size_wh, (column, row), (SUB * c, SUB * s), unit)
    return source, held, left, top


def _result_grid(
    size_wh: tuple[int, int], pivot: tuple[int, int], form: Form
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Pivot and size of a grid that holds the scaled and turned frame.

    The pivot keeps its place between the pixels. A scaled one goes where the edges of the frame put it, to half a
    pixel: whole scales repeat pixels exactly, and a mirrored frame lies on the mirrored grid.
    """
    edges, places = [], []
    for size, v, scale in zip(size_wh, pivot, (form.scale_x, form.scale_y), strict=True):
        edges.append([(e - v) * scale // ONE + up for e, up in ((-HALF, 0), (SUB * size - HALF, 1))])
        if scale == ONE:
            places.append(v % SUB)
        else:
            halves = rounded_div(np.array((v + HALF) * scale - HALF * ONE), HALF * ONE)
            places.append(int(halves) * HALF % SUB)
    c, s = form.c, form.s
    across = [over_one(x * c - y * s) for x in edges[0] for y in edges[1]]
    down = [over_one(x * s + y * c) for x in edges[0] for y in edges[1]]
    low, high = (min(across) - 1, min(down) - 1), (max(across) + 1, max(down) + 1)
    x, y = (place - SUB * ((edge + place) // SUB) for place, edge in zip(places, low, strict=True))
    width, height = (high[0] + x) // SUB + 1, (high[1] + y) // SUB + 1
    check_size("scale", width, height)
    return (x, y), (width, height)


def check_size(name: str, width: int, height: int) -> None:
    """Check the size of a mask, px."""
    if min(width, height) < 1 or max(width, height) > MASK_SIDE_MAX or width * height > MASK_AREA_MAX:
        limit = f"a mask of sides up to {MASK_SIDE_MAX} px and {MASK_AREA_MAX} px in all, not empty"
        raise InputError(f"{name}: expected {limit}, got {width} x {height}")
