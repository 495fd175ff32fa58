"""Where rays end: at an occluder, at the last object that they may hit, where their budget is used up, or nowhere.

A ray walks its cells in the order (time of entry, cells with an accepted occluder first, y, x), and in each cell the
items from the front.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np

from planes.arrays import Bools, Floats, Ints
from planes.items import Stack
from weapons.guns import Traced
from weapons.meetings import Meetings, stretches
from weapons.plan import Plan
from weapons.trace import ROOM, Lines

__all__ = ["Ends", "Reason", "endless", "ends_of"]

NEVER = 2**62
"""A time after every end."""


class Reason(IntEnum):
    """Why a ray ended."""

    RANGE = 0
    OCCLUDER = 1
    HITS = 2
    BUDGET = 3


@dataclass(frozen=True, eq=False)
class Ends:
    """The ends of rays, as columns.

    Parameters
    ----------
    reason : (R,) of `Reason`
    time : (R,) when the cell is entered where it ends; of a budget one more than the last whole time that it lasts;
        NEVER for its range
    y, x, rank : (R,) that cell, and the item that ended it; -1 for its range
    alone : (R,) whether of the cells entered at that time it walks that one only
    fraction : (R,) of the ray's length
    """

    reason: Ints
    time: Ints
    y: Ints
    x: Ints
    rank: Ints
    alone: Bools
    fraction: Floats

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return sum(int(column.nbytes) for column in vars(self).values())

    @classmethod
    def joined(cls, parts: Sequence[Ends]) -> Ends:
        """All ends of one list or more."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    def replaced(self, rays: Bools, other: Ends) -> Ends:
        """These ends, but for some rays those of another list."""
        columns = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Ends(*(np.where(rays, new, old) for old, new in columns))

    def put(self, rays: Ints, other: Ends) -> None:
        """Set the ends of some rays (n,) to those of a list of their own."""
        for f in fields(self):
            getattr(self, f.name)[rays] = getattr(other, f.name)

    def walked(self, met: Meetings) -> Bools:
        """Which cells (K,) of meetings were walked before the end."""
        return self.reaches(met.ray[met.pair], met.entry, met.y, met.x, met.rank[met.pair])

    def reaches(self, ray: Ints, entry: Ints, y: Ints, x: Ints, rank: Ints | int = -1) -> Bools:
        """Whether rays come to cells, and there to items; by default to the cells as such."""
        time, last_y, last_x = self.time[ray], self.y[ray], self.x[ray]
        here = (y == last_y) & (x == last_x) & (rank <= self.rank[ray])
        before = ~self.alone[ray] & ((y < last_y) | ((y == last_y) & (x < last_x)))
        return np.asarray((entry < time) | ((entry == time) & (here | before)))


def ends_of(met: Meetings, lines: Lines, stack: Stack, cost: Ints, ray: Traced, plan: Plan) -> Ends:
    """Find the end of each ray.

    Parameters
    ----------
    met : what accepted items it touches
    lines : (R,) the rays
    cost : (M,) of the items of the stack, by their place
    plan : to be told what was looked for
    """
    ends = endless(len(lines))
    objects = np.ones(len(met), np.bool_)
    plan.run("stops", "where each ray ends", ends.nbytes)
    if stack.has_occluders:
        _end_at_occluders(ends, met, stack)
        objects = ~stack.occluder[met.rank]
        plan.run("occluders", "the first on the way of each ray", objects.nbytes)
    if ray.hits_most is not None:
        _end_at_hits(ends, met.take(np.flatnonzero(objects)), ray.hits_most)
    if ray.budget_256 is not None:
        _end_at_budget(ends, met.take(np.flatnonzero(objects & (cost[met.rank] > 0))), lines, cost, ray.budget_256)
    told = (ends.reason == Reason.OCCLUDER) | (ends.reason == Reason.HITS)
    ends.fraction[told] = ends.time[told] / lines.scale[told]
    plan.run("stops", "")
    return ends


def endless(n: int) -> Ends:
    """Ends of n rays that nothing ends before their range."""
    return Ends(
        np.full(n, Reason.RANGE, np.int64),
        np.full(n, NEVER),
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.full(n, -1),
        np.zeros(n, np.bool_),
        np.ones(n),
    )


def _end_at_occluders(ends: Ends, met: Meetings, stack: Stack) -> None:
    """Let rays end at the first occluder that they meet."""
    blocking = np.flatnonzero(stack.occluder[met.rank])
    _end(ends, met, *_earliest(met, blocking, met.first[blocking]), Reason.OCCLUDER)
    ends.alone[:] = ends.reason == Reason.OCCLUDER


def _earliest(met: Meetings, pairs: Ints, cell: Ints) -> tuple[Ints, Ints]:
    """Of pairs and a cell of each, the earliest of every ray in the order of the walk."""
    order = np.lexsort((met.rank[pairs], met.x[cell], met.y[cell], met.entry[cell], met.ray[pairs]))
    first = order[np.flatnonzero(np.diff(met.ray[pairs][order], prepend=-1))]
    return pairs[first], cell[first]


def _end(ends: Ends, met: Meetings, pairs: Ints, cell: Ints, reason: Reason) -> None:
    """Let the rays of pairs end in a cell of each."""
    ray = met.ray[pairs]
    ends.reason[ray], ends.rank[ray] = reason, met.rank[pairs]
    ends.time[ray], ends.y[ray], ends.x[ray] = met.entry[cell], met.y[cell], met.x[cell]


def _end_at_hits(ends: Ends, met: Meetings, most: int) -> None:
    """Let rays end where they enter the last object that they may hit, if no occluder comes before."""
    met = met.only(ends.walked(met))
    cell = met.first
    order = np.lexsort((met.rank, met.x[cell], met.y[cell], met.entry[cell], met.ray))
    ray = met.ray[order]
    number = np.arange(len(ray)) - np.searchsorted(ray, ray)
    last = order[number == most - 1]
    alone = ends.alone[met.ray[last]] & (ends.time[met.ray[last]] == met.entry[cell[last]])
    _end(ends, met, last, cell[last], Reason.HITS)
    ends.alone[met.ray[last]] = alone


def _end_at_budget(ends: Ends, met: Meetings, lines: Lines, cost: Ints, budget_256: int) -> None:
    """Let rays end where the material that they went through uses up the budget, if nothing ends them before.

    Between two moments at which a ray enters or leaves an object what it spends grows evenly. In units of time times
    cost it may spend the greatest whole number `most` with (most * length / scale)^2 <= budget^2.
    """
    pair, first, last = stretches(met.pair, met.entry, met.leave)
    if not len(pair):
        return
    rate = cost[met.rank[pair]]
    ray = np.concatenate([met.ray[pair]] * 2)
    time, change = np.concatenate([first, last]), np.concatenate([rate, -rate])
    order = np.lexsort((time, ray))
    ray, time, change = ray[order], time[order], change[order]
    begins = np.flatnonzero(np.diff(ray, prepend=-1))
    group = np.cumsum(np.diff(ray, prepend=-1) != 0) - 1
    slope = np.cumsum(change)  # a ray leaves all that it enters: each begins at 0
    most = np.array([_affordable(lines, r, budget_256) for r in ray[begins].tolist()], object)
    wide = int(slope.max()) * int(lines.scale[ray[begins]].max()) >= ROOM
    kind: Any = np.object_ if wide else np.int64
    spent = np.cumsum(slope[:-1].astype(kind) * np.diff(time).astype(kind) * (np.diff(ray) == 0))
    spent = np.concatenate([np.zeros(1, kind), spent])
    spent = spent - spent[begins][group]
    over = np.flatnonzero(spent > (most if wide else np.minimum(most, NEVER).astype(np.int64))[group])
    over = over[np.flatnonzero(np.diff(ray[over], prepend=-1))]  # the first of each ray
    most = most[group[over]]
    whole = np.asarray(time[over - 1] + (most - spent[over - 1]) // slope[over - 1], np.int64)
    sooner = np.flatnonzero(whole < ends.time[ray[over]])
    over, whole = over[sooner], whole[sooner]
    ray, time, spent, slope = ray[over], time[over - 1], spent[over - 1], slope[over - 1]
    length = np.sqrt(lines.length2[ray])
    exactly = time + (budget_256 * (lines.scale[ray] / length) - spent.astype(np.float64)) / slope
    _end_inside(ends, met, ray, whole)
    ends.fraction[ray] = np.clip(exactly, whole, whole + 1) / lines.scale[ray]


def _affordable(lines: Lines, ray: int, budget_256: int) -> int:
    scale, length2 = int(lines.scale[ray]), int(lines.length2[ray])
    return math.isqrt(budget_256**2 * scale**2 // max(length2, 1))


def _end_inside(ends: Ends, met: Meetings, rays: Ints, times: Ints) -> None:
    """Let rays end between a whole time and the next, in the front-most object that they are in then."""
    last = np.full(len(ends.time), -1)
    last[rays] = times
    ends.reason[rays], ends.time[rays], ends.alone[rays] = Reason.BUDGET, times + 1, True
    ray = met.ray[met.pair]
    within = np.flatnonzero((met.entry <= last[ray]) & (met.leave > last[ray]))
    ray, rank = ray[within], met.rank[met.pair[within]]
    order = np.lexsort((met.x[within], met.y[within], rank, ray))
    order = order[np.flatnonzero(np.diff(ray[order], prepend=-1))]
    ends.rank[ray[order]] = rank[order]
    ends.y[ray[order]], ends.x[ray[order]] = met.y[within[order]], met.x[within[order]]
