"""The kernel of `sines`, compiled: one pass, many angles at once."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from planes.arrays import Floats, Ints
from planes.compiled import compiled
from planes.sines import DOUBT, ONE

__all__ = ["nearest"]

TERMS = 8
"""Of each series: up to 45 degrees what is left out is below 2**-53."""

SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(TERMS))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(TERMS + 1))

RADIAN = math.pi / 180
FLOATS = types.Array(types.float64, 1, "C", readonly=True)


@compiled(types.boolean(FLOATS, types.int64[::1], types.int64[::1], types.boolean[::1]))
def _nearest(degrees, cosine, sine, doubt):
    folded, any_doubt = np.abs(degrees), False
    for i in range(len(folded)):
        if folded[i] >= 360:
            folded[i] = np.fmod(folded[i], 360.0)
    for i in range(len(folded)):
        angle = folded[i]
        down = angle > 180
        angle = 360 - angle if down else angle
        left = angle > 90
        angle = 180 - angle if left else angle
        steep = angle > 45
        x = (90 - angle if steep else angle) * RADIAN
        far, near = SINE[TERMS - 1], COSINE[TERMS]
        for k in range(TERMS - 2, -1, -1):
            far = far * (x * x) + SINE[k]
        for k in range(TERMS - 1, -1, -1):
            near = near * (x * x) + COSINE[k]
        far *= x
        c, s = (far if steep else near) * ONE, (near if steep else far) * ONE
        c, s = -c if left else c, -s if down ^ (degrees[i] < 0) else s
        whole_c, whole_s = np.rint(c), np.rint(s)
        cosine[i], sine[i] = np.int32(whole_c), np.int32(whole_s)
        doubt[i] = max(abs(c - whole_c), abs(s - whole_s)) > 0.5 - DOUBT
        any_doubt |= doubt[i]
    return any_doubt


def nearest(degrees: Floats) -> tuple[Ints, Ints, Ints]:
    """See `sines.nearest`."""
    count = len(degrees)
    cosine, sine, doubt = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.bool_)
    in_doubt = _nearest(degrees, cosine, sine, doubt)
    return cosine, sine, np.flatnonzero(doubt) if in_doubt else np.zeros(0, np.int64)
