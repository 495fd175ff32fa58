"""The kernels of `snapping`, compiled: one pass each."""

from __future__ import annotations

import numpy as np
from numba import types

from planes.arrays import Floats, Ints
from planes.compiled import compiled
from planes.constants import HALF, POSITION_MAX, SUB

__all__ = ["pixels", "snapped"]

FLOATS = types.Array(types.float64, 1, "C", readonly=True)
INTS = types.Array(types.int64, 1, "C", readonly=True)


@compiled(types.boolean(FLOATS, types.int64[::1]))
def _snapped(at, whole):
    good = True
    for i in range(len(at)):
        good &= abs(at[i]) <= POSITION_MAX  # of what is not a number it is not
        whole[i] = np.int64(np.rint(at[i] * SUB))
    return good


def snapped(at: Floats) -> Ints | None:
    """See `snapping.snapped`."""
    whole = np.empty(at.shape, np.int64)
    return whole if _snapped(at.ravel(), whole.ravel()) else None


@compiled(types.void(INTS, types.int64[::1]))
def _pixels(at_256, whole):
    for i in range(len(at_256)):
        whole[i] = (at_256[i] + HALF) >> 8


def pixels(at_256: Ints) -> Ints:
    """See `snapping.pixels`."""
    whole = np.empty(at_256.shape, np.int64)
    _pixels(at_256.ravel(), whole.ravel())
    return whole
