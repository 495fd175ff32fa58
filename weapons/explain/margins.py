"""Margins: the shortest shift of a shot that changes whether it hits an object. The shot is fired again at each shift.

A pattern lies on whole pixels, and is shifted by whole pixels. Rays are shifted by parts of a pixel, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import InputError, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, FRAGILE_PX, MARGIN_PX, SUB
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.call import fired
from ..fire.plan import Plan
from ..fire.spans import context_of, direct
from ..fire.strategy import AUTO
from ..kinds.areas import RayParts, parts_of, pellets_in
from ..kinds.placements import Shots, placements_for
from ..kinds.rays import Pistol
from ..kinds.weapon import Weapon
from ..rays.contacts import Reason

Shifts = npt.NDArray[Any]
"""Shifts (n, 2), px."""

RAYS_MAX = 1024  # most rays of a shot that has margins
FINE_RAYS = 64  # most rays of a shot that is fired at all of RAY_SHIFTS, 933 of them; others at those of patterns, 197
RAYS_AT_ONCE = 4096  # most rays that are fired at a time


class Margin(NamedTuple):
    """Shortest shift of a shot that changes whether it hits an object.

    `hit` says whether the shot as fired hits the object; `distance` is the length of `shift_xy`, px. The shift is the
    first by (y, x) of equally short ones. For patterns it is in whole pixels. Rays are also shifted by whole quarters
    of a pixel up to 2 px, by whole 16ths up to 1/2 px, by 64ths up to 1/8 px, and by 256ths up to 1/32 px, but for
    shots of more than 64 rays.
    """

    shot: int
    object: int
    hit: bool
    distance: float
    shift_xy: tuple[float, float]

    @property
    def fragile(self) -> bool:
        """Whether a shift of at most one pixel is enough."""
        return self.distance <= FRAGILE_PX


def _by_length(shifts: Shifts) -> Shifts:
    """Shifts sorted by (length, y, x), each once; the first is (0, 0)."""
    shifts = np.unique(shifts, axis=0)
    x, y = shifts.T
    return np.asarray(shifts[np.lexsort((x, y, x * x + y * y))])


SIDE = np.arange(-MARGIN_PX, MARGIN_PX + 1)
PATTERN_SHIFTS = _by_length(np.argwhere(SIDE**2 + SIDE[:, None] ** 2 <= MARGIN_PX**2)[:, ::-1] - MARGIN_PX)
"""Shifts of patterns: whole pixels, at most MARGIN_PX long."""

RAY_SHIFTS = _by_length(np.concatenate([PATTERN_SHIFTS / part for part in (1, 4, 16, 64, SUB)]))
"""Shifts of rays, px: the shorter they are, the finer, down to 1/256 px."""


def pattern_margins(scene: Scene, stack: Stack, weapon: Weapon, shot: Shots, number: int) -> list[Margin]:
    """Margins of the objects that a pattern comes to hit, or no longer hits, if it is shifted.

    They are sorted by object; `shot` is a batch of one, and `number` that of the shot. Once the scene has changed, or
    if a shifted shot may be refused, the reference answers, which needs nothing but the stack of then.
    """
    if not len(stack):
        return []
    anew = stack is not scene.items.stack() or parts_of(weapon)[2].inside == "error"
    context = context_of(scene, stack, weapon, shot, MARGIN_PX) if anew else None

    def hit_at(shifts: Shifts) -> tuple[Ints, Ints]:
        moved = _moved(shot, shifts)
        if context is None:
            hits = fired(scene, weapon, moved)
            return hits.shot, stack.ranks(hits.object)
        placements = placements_for(weapon, moved)
        met = direct(placements, moved, context)
        return placements.shot[met.placement], met.rank

    step = len(PATTERN_SHIFTS)
    if context is not None:
        step = max(1, CHUNK_SAMPLES // max(int(placements_for(weapon, shot).count.sum()), 1))
    return _margins(hit_at, PATTERN_SHIFTS, step, stack, number)


def ray_margins(scene: Scene, parts: RayParts, shot: Shots, number: int) -> list[Margin]:
    """Margins of the objects that a shot of rays comes to hit, or no longer hits, if all its rays are shifted together.

    A shift is passed over if the shot cannot be fired there, because it starts inside an item and its weapon forbids
    that. `parts` are the weapon's; `shot` is a batch of one, and `number` that of the shot.

    An InputError says if there are too many rays.
    """
    burst, _, ray = parts
    rays = pellets_in(parts)
    if rays > RAYS_MAX:
        raise InputError(f"shot: expected one of at most {RAYS_MAX} rays, got {rays}")
    stack, shifts = scene.items.stack(), RAY_SHIFTS if rays <= FINE_RAYS else PATTERN_SHIFTS.astype(np.float64)
    if not len(stack):
        return []
    if ray.inside == "error":
        start = Pistol(0, width=2 * ray.radius_256 / SUB)
        how = scene, start, (burst, None, start), _moved(shot, shifts), AUTO, Plan()
        stop = late.ray_call.fired_rays(*how).stop
        shifts = np.delete(shifts, stop.shot[stop.reason != Reason.RANGE], axis=0)
    step = max(1, RAYS_AT_ONCE // rays)
    return _margins(lambda some: late.ray_call.items_hit(scene, parts, _moved(shot, some)), shifts, step, stack, number)


def _moved(shot: Shots, shifts: Shifts) -> Shots:
    """A shot at each shift, with the same draws."""
    shots = shot.pick(np.zeros(len(shifts), np.int64))
    return replace(shots, at_256=shots.at_256 + (SUB * shifts).astype(np.int64))


def _margins(
    hit_at: Callable[[Shifts], tuple[Ints, Ints]], shifts: Shifts, step: int, stack: Stack, number: int
) -> list[Margin]:
    """Margins of a shot, by object.

    Parameters
    ----------
    hit_at : function of shifts (k, 2) that returns what the shot hits there: (place of the shift, rank of the item)
    shifts : (n, 2) px, sorted by length; the first is (0, 0)
    step : number of shifts to try at a time
    """
    still, flips = np.zeros(len(stack), np.bool_), np.full(len(stack), -1)
    for first in range(0, len(shifts), step):
        some = shifts[first : first + step]
        place, rank = hit_at(some)
        if not first:
            still[rank[place == 0]] = True
        near = np.union1d(rank, np.flatnonzero(still))
        hit = np.zeros((len(some), len(near)), np.bool_)
        hit[place, np.searchsorted(near, rank)] = True
        turned = hit != still[near]
        new = turned.any(axis=0) & (flips[near] < 0)
        flips[near[new]] = first + turned.argmax(axis=0)[new]
    found = []
    for item in np.flatnonzero(flips >= 0).tolist():
        x, y = shifts[flips[item]].tolist()
        found.append(Margin(number, int(stack.ids[item]), bool(still[item]), math.sqrt(x * x + y * y), (x, y)))
    return sorted(found)
