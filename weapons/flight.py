"""Fast movers: a projectile as each item sees it, swept through the frame, or tested at some moments of it.

An item that moves sees a projectile move by the difference of their velocities; its mask stays as the frame finds it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Ints
from planes.items import Items, Stack
from weapons.guns import Projectile, Traced
from weapons.meetings import Meetings
from weapons.trace import COMMON, Lines

__all__ = ["at_steps", "common_scale", "in_frame", "is_moving", "relative_lines", "steps_of"]


def steps_of(ray: Traced) -> int | None:
    """In how many steps a frame is tested; None if it is swept, as for all but projectiles."""
    return ray.steps if isinstance(ray, Projectile) else None


def is_moving(ray: Traced, items: Items, stack: Stack) -> bool:
    """Whether any item moves while the ray does: that of a projectile takes a frame, others no time."""
    return isinstance(ray, Projectile) and bool(items.velocity_256[stack.ids].any())


def common_scale(ray: Traced, items: Items, stack: Stack) -> int:
    """What the times of all rays are counted over; 0 for each ray its own scale."""
    return steps_of(ray) or (COMMON if is_moving(ray, items, stack) else 0)


def relative_lines(lines: Lines, ray: Traced, row: Ints, ids: Ints, items: Items) -> Lines:
    """Lines of pairs of a ray and an item, as the item sees them."""
    own = lines.take(row)
    if not isinstance(ray, Projectile):
        return own
    return Lines(own.start, own.step - items.velocity_256[ids], ray.radius_256)


def in_frame(met: Meetings, own: Lines, moving: bool) -> Meetings:
    """Times as parts of the frame; where items move, over one scale for all instead of that of each pair.

    Parameters
    ----------
    own : for each pair the ray as the item sees it
    """
    scale, (entry, leave) = own.scale[met.pair], _lasting(own, met, met.entry, met.leave)
    if moving:
        entry, leave = (np.asarray(time.astype(object) * COMMON // scale, np.int64) for time in (entry, leave))
    return met.at_times(entry, leave)


def at_steps(met: Meetings, own: Lines, steps: int) -> Meetings:
    """Cells that are touched at one of the moments k / steps, k from 1 on: the first and the last of those, as k.

    Parameters
    ----------
    own : for each pair the ray as the item sees it
    """
    scale = own.scale[met.pair]
    first: npt.NDArray[Any] = np.full(len(scale), steps + 1, object)
    last: npt.NDArray[Any] = np.zeros(len(scale), object)
    for spell in own.spells(met.pair, met.x, met.y):
        touched = spell[0] <= spell[1]
        entry, leave = (time.astype(object) for time in _lasting(own, met, *spell))
        begin, end = np.maximum(-(-entry * steps // scale), 1), leave * steps // scale
        touched &= np.asarray(begin <= end, np.bool_)
        first = np.where(touched, np.minimum(first, begin), first)
        last = np.where(touched, np.maximum(last, end), last)
    told = met.at_times(np.asarray(first, np.int64), np.asarray(last, np.int64))
    return told.only(told.entry <= told.leave)


def _lasting(own: Lines, met: Meetings, entry: Ints, leave: Ints) -> tuple[Ints, Ints]:
    """Times of cells; what a projectile rests on it touches all the time."""
    rests = (own.length2 == 0)[met.pair]
    return entry, np.where(rests & (entry <= leave), own.scale[met.pair], leave)
