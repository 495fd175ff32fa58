"""Cosines and sines of angles times 2**30, rounded as far as floats can tell; `sines_jit` has the compiled twin."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, Ints
from planes.constants import TRIG_BITS

__all__ = ["nearest"]

ONE = 1 << TRIG_BITS
DOUBT = 2.0**-12
"""Float sines are within a few ulp, 2**-21 after the scaling: nearer to a tie than this they are in doubt."""


def nearest(degrees: Floats) -> tuple[Ints, Ints, Ints]:
    """Whole numbers (n,) nearest to the cosines and sines of angles (n,) times 2**30, and the rows in doubt.

    The angle is folded into [0, 45] by differences that are exact in float64, so a quarter turn swaps the two numbers
    and a mirror changes a sign, to the last bit.
    """
    folded = np.abs(degrees)
    if folded.max(initial=0) >= 360:
        folded = np.fmod(folded, 360.0)
    down = folded > 180
    folded = np.where(down, 360 - folded, folded)
    left = folded > 90
    folded = np.where(left, 180 - folded, folded)
    steep = folded > 45
    radians = np.radians(np.where(steep, 90 - folded, folded))
    near, far = np.cos(radians) * ONE, np.sin(radians) * ONE
    whole_near, whole_far = np.rint(near), np.rint(far)
    doubt = np.maximum(np.abs(near - whole_near), np.abs(far - whole_far)) > 0.5 - DOUBT
    x, y = whole_near.astype(np.int64), whole_far.astype(np.int64)
    c, s = np.where(steep, y, x), np.where(steep, x, y)
    return np.where(left, -c, c), np.where(down ^ (degrees < 0), -s, s), np.flatnonzero(doubt)
