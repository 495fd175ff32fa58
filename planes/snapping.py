"""Checked positions on the 1/256-px grid, and their pixels, many at once; `snapping_jit` has the compiled twins."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, Ints
from planes.constants import POSITION_MAX, SUB
from planes.grid256 import pixel

__all__ = ["pixels", "snapped"]

LIMIT, SCALE = np.array(float(POSITION_MAX)), np.array(float(SUB))

ROUNDING = np.array(1.5 * 2.0**52)
"""A float64 of this size has no fraction: what is added to it is rounded to a whole number, half to even."""

ROUNDING_BITS = ROUNDING.view(np.int64)
"""Of the sum, beyond these, the bits are that whole number: so none is converted, which takes twice as long."""


def snapped(at: Floats) -> Ints | None:
    """Positions (N, 2), px, in 1/256 px, as `grid256.snap` rounds them; None if one is no number within the limits."""
    if not (at.max(initial=0) <= LIMIT and at.min(initial=0) >= -LIMIT):  # if one is not a number, neither are these
        return None
    made = at * SCALE
    made += ROUNDING
    whole: Ints = made.view(np.int64)
    whole -= ROUNDING_BITS
    return whole


def pixels(at_256: Ints) -> Ints:
    """Whole pixels (N, 2) of positions in 1/256 px, as `grid256.pixel` tells them."""
    return pixel(at_256)
