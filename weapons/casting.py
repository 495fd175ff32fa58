"""Rays that are cast at all items where they lie, one by one, each up to the first that it touches.

Only thin rays that end at their first hit. Those that start inside of an item which is not hit then, or have no length,
are left to the walk.
"""

from __future__ import annotations

import numpy as np

from planes import raycast
from planes.arrays import Ints
from planes.jumps import UNDECIDED
from planes.raycast import Touched
from planes.stack import Stack
from planes.twins import kernels_of
from weapons.candidates import may_refuse
from weapons.ends import Ends, Reason, endless
from weapons.guns import Traced
from weapons.rays import Rays
from weapons.tracing import Range
from weapons.volley import Shots

__all__ = ["ends_by_casting", "ends_of_touched"]


def ends_by_casting(rays: Rays, ray: Traced, shots: Shots, through: Range) -> tuple[Ends, Ints]:
    """Find where rays end, but for the parts of their lengths.

    Returns
    -------
    the ends, and the rays for which they are yet to be found
    """
    stack = through.stack
    whose = (shots.accept[rays.shot], shots.exclude[rays.shot]) if may_refuse(stack, shots) else ()
    found = kernels_of(raycast).first_touched(stack, through.bounds, rays.start_256, rays.step_256, *whose)
    ends = ends_of_touched(found, rays.origin_xy, stack)
    through.plan.run("cast", "each ray to what it touches first: boxes, filters and occluders, too", ends.nbytes)
    unsure = found.entry == UNDECIDED
    if ray.inside != "hit":
        unsure |= found.entry == 0
    return ends, np.flatnonzero(unsure)


def ends_of_touched(found: Touched, origin_xy: Ints, stack: Stack) -> Ends:
    """Ends of rays at what they touch first, but for the parts of their lengths; `origin_xy` are where they begin."""
    ends, met = endless(len(origin_xy)), np.flatnonzero(found.entry >= 0)
    aside, rank = origin_xy[met], found.rank[met]
    ends.x[met], ends.y[met] = found.x[met] - aside[:, 0], found.y[met] - aside[:, 1]
    ends.rank[met], ends.time[met] = rank, found.entry[met]
    ends.reason[met] = np.where(stack.occluder[rank], Reason.OCCLUDER, Reason.HITS)
    return ends
