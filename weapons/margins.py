"""Margins: how far the verdicts of a shot of patterns are from flipping, by firing it again some pixels off."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from planes.arrays import Bools, Ints
from planes.constants import CHUNK_SAMPLES, FRAGILE_PX, MARGIN_PX
from planes.scene import Scene
from weapons.arsenal import pierces
from weapons.candidates import Candidates
from weapons.plan import Plan
from weapons.resolve import Sight, direct
from weapons.volley import Shots, Volley, volley_of
from weapons.weapon import Weapon

__all__ = ["Margin", "margins_of"]


class Margin(NamedTuple):
    """How far a shot is from hitting an object that it missed, or from missing one that it hit.

    `hit` is as it was fired; `distance` is the length of the shortest shift that turns it over, px, and `shift_xy` that
    shift: whole pixels for patterns, of several the first by (y, x).
    """

    shot: int
    object: int
    hit: bool
    distance: float
    shift_xy: tuple[float, float]

    @property
    def fragile(self) -> bool:
        """Whether one pixel is enough."""
        return self.distance <= FRAGILE_PX


def margins_of(scene: Scene, weapon: Weapon, shots: Shots, first_shot: int = 0) -> list[Margin]:
    """Margins of the objects of each shot that a whole-pixel shift of its pattern, up to MARGIN_PX, turns over.

    Parameters
    ----------
    first_shot : number of the first of the shots

    Returns
    -------
    by (shot, object)
    """
    stack = scene.items.stack()
    sight = Sight(stack, scene.bounds, pierces(weapon), Candidates(scene.items, stack), Plan())
    found = []
    for row in range(len(shots) if len(stack) else 0):
        still, flips = _flips(volley_of(weapon, shots.take(row, row + 1)), shots.take(row, row + 1), sight)
        for rank in sorted(np.flatnonzero(flips >= 0).tolist(), key=lambda rank: int(stack.ids[rank])):
            dx, dy = SHIFTS[flips[rank]].tolist()
            length = math.sqrt(dx * dx + dy * dy)
            found.append(Margin(first_shot + row, int(stack.ids[rank]), bool(still[rank]), length, (dx, dy)))
    return found


def _shifts() -> Ints:
    """Whole-pixel shifts (n, 2) by (length, y, x): none first."""
    side = np.arange(-MARGIN_PX, MARGIN_PX + 1)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    length2 = x * x + y * y
    order = np.lexsort((x, y, length2))
    return np.stack([x, y], axis=1)[order[length2[order] <= MARGIN_PX**2]]


SHIFTS = _shifts()


def _flips(volley: Volley, shot: Shots, sight: Sight) -> tuple[Bools, Ints]:
    """Whether a shot hits each item of the stack, and the number of the first shift that turns it over, -1 for none."""
    n, placements = len(sight.stack), len(volley)
    still, flips = np.zeros(n, np.bool_), np.full(n, -1)
    step = max(1, CHUNK_SAMPLES // max(int(volley.count.sum()), 1))
    edges = [0, 1, *range(1 + step, len(SHIFTS), step), len(SHIFTS)]
    for first, last in pairwise(edges):
        met = direct(_shifted(volley, SHIFTS[first:last]), shot, sight)
        hit = np.zeros((last - first, n), np.bool_)
        hit[met.placement // placements, met.rank] = True
        if not first:
            still = hit[0]
        turned = hit != still
        flips = np.where((flips < 0) & turned.any(axis=0), first + turned.argmax(axis=0), flips)
    return still, flips


def _shifted(volley: Volley, shift: Ints) -> Volley:
    """Place a volley once for each shift, with all placements as those of the first shot."""
    n = len(shift)
    xy = np.tile(volley.xy, (n, 1)) + np.repeat(shift, len(volley), axis=0)
    turn_xy = np.tile(volley.turn_xy, (n, 1))
    return Volley(volley.table, np.tile(volley.pattern, n), xy, turn_xy, volley.rounds, volley.pellets, shot=0)
