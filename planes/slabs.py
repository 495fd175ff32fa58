"""Between which parts of it a segment lies within a box, axis by axis."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Floats

__all__ = ["slabs"]

Reals = npt.NDArray[np.floating[Any]]


def slabs(begin: Reals, step: Reals, low: Reals, high: Reals) -> tuple[Floats, Floats]:
    """First and last part of segments at which they are between the sides of boxes, on every axis that they go along.

    An axis along which a segment does not go leaves it out of account. A segment that misses its box has its first part
    after its last, or one of them beyond its ends.

    Parameters
    ----------
    begin, step : (..., d) where segments begin, and from there to their ends
    low, high : (..., d) sides of the boxes

    References
    ----------
    Kay and Kajiya, "Ray tracing complex scenes" (1986); Liang and Barsky, "A new concept and method for line clipping"
    (1984).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (low - begin) / step, (high - begin) / step
    level = step == 0
    first = np.where(level, -np.inf, np.minimum(to_low, to_high)).max(axis=-1)
    last = np.where(level, np.inf, np.maximum(to_low, to_high)).min(axis=-1)
    return np.asarray(first), np.asarray(last)
