"""Rays of shots, their contacts with items, and their terminations.

A ray walks its cells in the order (time of entry, cells with an accepted occluder first, y, x), and the items of a cell
from front to back. It ends at its range, at an occluder, at the last object that it may hit, or when its budget is used
up. At the moment when the budget is used up the ray enters no further cell, even if something else ends it then, too.

A projectile is tested against a moving item along the difference of their velocities; the item's mask does not change
within a frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, SUB
from hitplanes.planes.grid import fixed_point
from hitplanes.planes.grid.fixed_point import muldiv, pixel, scaled, snap
from hitplanes.planes.grid.rasterize import COMMON, ROOM, Lines
from hitplanes.planes.grid.spans import Box, Columns, begins, clipped, merged_runs, pieces, ragged
from hitplanes.planes.scene.items import Items, Stack

from ..fire.plan import Plan
from ..kinds.areas import RayParts, Spread
from ..kinds.placements import ZEROS, Shots, pellets_of, recoiled
from ..kinds.rays import Projectile, RayWeapon, Sweep, is_moving


@dataclass(frozen=True, eq=False)
class Rays(Columns):
    """Columns of rays, sorted by (shot, round, pellet).

    Parameters
    ----------
    start_256, step_256 : (R, 2) start, and vector from the start to the end
    origin_xy : (R, 2) pixel of the start
    shot, round, pellet : (R,) numbers of the shot, the round and the pellet; `shot` counts from 0 within the batch
    """

    start_256: Ints
    step_256: Ints
    origin_xy: Ints
    shot: Ints
    round: Ints
    pellet: Ints

    @property
    def rounds(self) -> int:
        """Number of rounds of the shot that has most."""
        return int(self.round.max(initial=0)) + 1


def rays_of(parts: RayParts, shots: Shots) -> Rays:
    """Make the ray of every pellet of every round of every shot; `parts` are the weapon's."""
    burst, several, _ = parts
    rounds, pellets = burst.count if burst else 1, several.count if several else 1
    shot, start, origin_xy = np.arange(len(shots)), shots.at_256, shots.xy
    round_ = ZEROS[: len(shots)]
    if burst:
        shot, round_ = shot.repeat(rounds), np.tile(np.arange(rounds), len(shots))
        start = start[shot] + round_[:, None] * snap(burst.recoil_xy)
        origin_xy = pixel(start)
    step, pellet = _steps(parts, shots, shot, round_), ZEROS[: len(shot)]
    if several:
        pellet = np.arange(len(shot) * pellets) % pellets
        start, origin_xy, shot, round_ = (c.repeat(pellets, axis=0) for c in (start, origin_xy, shot, round_))
    return Rays(start, step, origin_xy, shot, round_, pellet)


def _steps(parts: RayParts, shots: Shots, shot: Ints, round_: Ints) -> Ints:
    """Vectors from the start of each ray to its end; `shot` and `round_` are those of each round of all shots."""
    burst, several, ray = parts
    length = ray.length_256
    ahead = shots.toward_256 if length is None else shots.direction
    assert ahead is not None  # checked with the shots
    if burst:
        ahead = recoiled(ahead[shot], round_, burst.recoil_deg)
    if isinstance(several, Sweep):
        ahead = kernels_of(fixed_point).turned_to(several.directions, ahead)
    step = ahead if length is None else scaled(ahead, length)
    if isinstance(several, Spread):
        step = step[:, None] + SUB * pellets_of(several, shots.seed[shot], shots.number[shot], round_)
    return step.reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class Contacts:
    """Columns of pairs of a ray and an item that it touches; each pair has one cell or more.

    Parameters
    ----------
    ray, rank : (P,) the ray, and the place of the item in the stack
    count : (P,) number of cells of each pair; the cells are listed pair after pair
    x, y, entry, leave : (K,) cell, relative to the pixel of the ray's start, and when the ray enters and leaves it
    """

    ray: Ints
    rank: Ints
    count: Ints
    x: Ints
    y: Ints
    entry: Ints
    leave: Ints

    def __len__(self) -> int:
        return len(self.ray)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return 3 * self.ray.nbytes + 4 * self.x.nbytes

    @cached_property
    def begin(self) -> Ints:
        """First cell of each pair."""
        return np.asarray(np.cumsum(self.count) - self.count)

    @cached_property
    def pair(self) -> Ints:
        """Pair of each cell."""
        return np.repeat(np.arange(len(self)), self.count)

    @cached_property
    def first(self) -> Ints:
        """First cell of each pair in the order of the walk: by (entry, y, x)."""
        return first_of_each(self.begin, self.pair, (self.entry, self.y, self.x))

    def of_rays(self, live: Bools) -> Contacts:
        """Pairs of the rays of a mask (R,)."""
        return self.take(np.flatnonzero(live[self.ray]))

    def take(self, pairs: Ints) -> Contacts:
        """Pairs by their numbers, with all of their cells."""
        group, place = ragged(self.count[pairs])
        cell = self.begin[pairs][group] + place
        return self._of(pairs, self.count[pairs], cell)

    def only(self, keep: Bools) -> Contacts:
        """Cells of a mask (K,), and the pairs that have one of them."""
        count = np.bincount(self.pair[keep], minlength=len(self))
        pairs = np.flatnonzero(count)
        return self._of(pairs, count[pairs], np.flatnonzero(keep))

    def at_times(self, entry: Ints, leave: Ints) -> Contacts:
        """The same cells at other times."""
        return Contacts(self.ray, self.rank, self.count, self.x, self.y, entry, leave)

    def _of(self, pairs: Ints, count: Ints, cells: Ints) -> Contacts:
        columns = (column[cells] for column in (self.x, self.y, self.entry, self.leave))
        return Contacts(self.ray[pairs], self.rank[pairs], count, *columns)

    @classmethod
    def none(cls) -> Contacts:
        """No pairs."""
        return cls(*[np.zeros(0, np.int64)] * 7)

    @classmethod
    def joined(cls, parts: Sequence[Contacts]) -> Contacts:
        """All pairs of several lists."""
        if len(parts) == 1:
            return parts[0]
        every = [cls.none(), *parts]
        names = ("ray", "rank", "count", "x", "y", "entry", "leave")
        return cls(*(np.concatenate([getattr(part, name) for part in every]) for name in names))


@dataclass(frozen=True, eq=False)
class Touches(Columns):
    """Columns of the objects that rays hit, sorted by (ray, entry, y, x, rank), with the first cell of each.

    Parameters
    ----------
    ray, rank : (P,) the ray, and the place of the object in the stack
    count : (P,) number of cells of the object that the ray walked
    x, y, entry : (P,) the first of them, relative to the pixel of the ray's start, and when the ray enters it
    """

    ray: Ints
    rank: Ints
    count: Ints
    x: Ints
    y: Ints
    entry: Ints


def find_contacts(lines: Lines, ray: Ints, rank: Ints, stack: Stack, bounds: Box | None, origin_xy: Ints) -> Contacts:
    """Cells in which rays touch the pixels of items.

    Parameters
    ----------
    lines : (P,) the line of each pair
    ray, rank : (P,) the pairs
    origin_xy : (P, 2) pixels that the lines are relative to
    """
    shift = np.concatenate([origin_xy, origin_xy], axis=1)
    boxes_xyxy = stack.box_xyxy[rank] - shift
    inside = boxes_xyxy if bounds is None else clipped(stack.box_xyxy[rank], bounds) - shift
    size = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1
    found = []
    for part in pieces(cells_most(lines, size), CHUNK_SAMPLES) if len(rank) else ():
        here = np.arange(part.start, part.stop)
        own = lines.take(here)
        pair, x, y = own.candidates(inside[here])
        box = boxes_xyxy[here]
        item = rank[here]
        texel = (y - box[pair, 1]) * (box[pair, 2] - box[pair, 0] + 1) + x - box[pair, 0] + stack.offset[item][pair]
        on = stack.masks[texel]
        pair, x, y = pair[on], x[on], y[on]
        entry, leave = own.times(pair, x, y)
        met = np.flatnonzero(entry <= leave)
        count = np.bincount(pair[met], minlength=len(here))
        kept = np.flatnonzero(count)
        found.append(Contacts(ray[here][kept], item[kept], count[kept], x[met], y[met], entry[met], leave[met]))
    return Contacts.joined(found)


def cells_most(lines: Lines, size_wh: Ints) -> Ints:
    """Most cells of boxes of some sizes (n, 2) that are looked at for a line."""
    return np.asarray(np.minimum(size_wh.prod(axis=1), size_wh.max(axis=1) * (3 * lines.radius // SUB + 3)))


def first_of_each(begin: Ints, group: Ints, keys: Sequence[Ints]) -> Ints:
    """Index of the least element of each group by keys, the most important first; no group is empty."""
    return _extreme_of_each(begin, group, keys, np.minimum)


def last_of_each(begin: Ints, group: Ints, keys: Sequence[Ints]) -> Ints:
    """Index of the greatest element of each group by keys, the most important first; no group is empty."""
    return _extreme_of_each(begin, group, keys, np.maximum)


def _extreme_of_each(begin: Ints, group: Ints, keys: Sequence[Ints], better: np.ufunc) -> Ints:
    index = np.arange(len(group))
    for key in keys:
        if len(index) == len(begin):  # one of each group is left
            break
        value = key[index]
        best = np.flatnonzero(value == better.reduceat(value, begin)[group])
        index, group = index[best], group[best]
        begin = np.flatnonzero(begins(group))
    return index[begin]


def stretches(group: Ints, entry: Ints, leave: Ints) -> tuple[Ints, Ints, Ints]:
    """Union of the closed time intervals of each group: sorted (group, first, last), with no two that touch."""
    if len(group):  # most touch the one before
        at = np.flatnonzero(begins(group) | np.append(True, (entry[1:] > leave[:-1]) | (leave[1:] < entry[:-1])))
        group, entry, leave = group[at], np.minimum.reduceat(entry, at), np.maximum.reduceat(leave, at)
    times, place = np.unique(np.concatenate([entry, leave]), return_inverse=True)
    first, last = np.split(2 * place.reshape(-1), 2)  # doubled, because neighbouring numbers would count as touching
    which, first, last = merged_runs(group, first, last)
    return group[which], times[first // 2], times[last // 2]


def steps_of(ray: RayWeapon) -> int | None:
    """Number of moments of a frame at which a projectile is tested; None for a swept projectile or any other ray."""
    return ray.steps if isinstance(ray, Projectile) else None


def common_scale(ray: RayWeapon, items: Items, stack: Stack) -> int:
    """Denominator of the times of all rays; 0 if each ray has its own."""
    return steps_of(ray) or (COMMON if is_moving(ray, items, stack) else 0)


def relative_lines(lines: Lines, ray: RayWeapon, row: Ints, item: Ints, items: Items) -> Lines:
    """Lines of pairs of a ray and an item, relative to the motion of the item."""
    own = lines.take(row)
    if not isinstance(ray, Projectile):
        return own
    return Lines(own.start, own.step - items.velocity_256[item], ray.radius_256)


def in_frame(met: Contacts, own: Lines, moving: bool) -> Contacts:
    """Contacts with times as fractions of the frame, over one common scale if items move.

    Parameters
    ----------
    own : the line of each pair, relative to the motion of its item
    """
    scale, (entry, leave) = own.scale[met.pair], _lasting(own, met, met.entry, met.leave)
    if moving:
        entry, leave = muldiv(entry, COMMON, scale), muldiv(leave, COMMON, scale)
    return met.at_times(entry, leave)


def at_steps(met: Contacts, own: Lines, steps: int) -> Contacts:
    """Cells touched at any of the moments k / steps, k >= 1; their times are the first and the last such k.

    Parameters
    ----------
    own : the line of each pair, relative to the motion of its item
    """
    scale = own.scale[met.pair]
    first, last = np.full(len(scale), steps + 1), np.zeros(len(scale), np.int64)
    for spell in own.spells(met.pair, met.x, met.y):
        touched = spell[0] <= spell[1]
        entry, leave = (np.where(touched, time, 0) for time in _lasting(own, met, *spell))
        begin, end = np.maximum(steps - muldiv(scale - entry, steps, scale), 1), muldiv(leave, steps, scale)
        touched &= begin <= end
        first = np.where(touched, np.minimum(first, begin), first)
        last = np.where(touched, np.maximum(last, end), last)
    tested = met.at_times(first, last)
    return tested.only(tested.entry <= tested.leave)


def _lasting(own: Lines, met: Contacts, entry: Ints, leave: Ints) -> tuple[Ints, Ints]:
    """Times of cells; a projectile that does not move touches its cells during the whole frame."""
    rests = (own.length2 == 0)[met.pair]
    return entry, np.where(rests & (entry <= leave), own.scale[met.pair], leave)


NEVER = 2**62
"""A time later than every end."""


class Reason(IntEnum):
    """Why a ray ended."""

    RANGE = 0
    OCCLUDER = 1
    HITS = 2
    BUDGET = 3


def cells_hit(met: Contacts, ends: Terminations, stack: Stack) -> Contacts:
    """Cells of objects that rays walked before their ends."""
    keep = ends.walked(met)
    return met.only(keep & ~stack.occluder[met.rank][met.pair] if stack.has_occluders else keep)


def reasons_at(stack: Stack, rank: Ints) -> Ints:
    """Why rays end at items: an occluder stops them, an object is hit."""
    return np.where(stack.occluder[rank], Reason.OCCLUDER, Reason.HITS)


@dataclass(frozen=True, eq=False)
class Terminations(Columns):
    """Columns of the ends of rays.

    Parameters
    ----------
    reason : (R,) value of `Reason`
    time : (R,) time at which the ray enters its last cell; BUDGET: first whole time at which nothing of it is left;
        RANGE: NEVER
    y, x, rank : (R,) last cell, and the item that ended the ray; BUDGET: the object that took the last of it; -1 for
        RANGE, and for a budget of 0
    alone : (R,) whether the last cell is the only one that the ray walks of those entered at that time
    fraction : (R,) where the ray ended, as a fraction of its length
    """

    reason: Ints
    time: Ints
    y: Ints
    x: Ints
    rank: Ints
    alone: Bools
    fraction: Floats

    def replaced(self, rays: Bools, other: Terminations) -> Terminations:
        """Copy in which the ends of the rays of a mask (R,) are those of another list."""
        columns = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Terminations(*(np.where(rays, new, old) for old, new in columns))

    def put(self, rays: Ints, other: Terminations) -> None:
        """Set the ends of rays (n,) to those of another list (n,)."""
        for f in fields(self):
            getattr(self, f.name)[rays] = getattr(other, f.name)

    def walked(self, met: Contacts) -> Bools:
        """Mask (K,) of the cells of contacts that were walked before the end."""
        return self.reaches(met.ray[met.pair], met.entry, met.y, met.x, met.rank[met.pair])

    def reaches(self, ray: Ints, entry: Ints, y: Ints, x: Ints, rank: Ints | int = -1) -> Bools:
        """Whether rays reach cells, or items in these cells if `rank` is given."""
        time, last_y, last_x = self.time[ray], self.y[ray], self.x[ray]
        here = (y == last_y) & (x == last_x) & (rank <= self.rank[ray])
        before = ~self.alone[ray] & ((y < last_y) | ((y == last_y) & (x < last_x)))
        same = (entry == time) & (self.reason[ray] != Reason.BUDGET)
        return np.asarray((entry < time) | (same & (here | before)))

    def last_whole(self, scale: Ints) -> Ints:
        """Last whole time (R,) that each ray reaches, over its scale; NEVER for RANGE."""
        return np.asarray(self.time - ((self.reason == Reason.BUDGET) & (self.fraction < self.time / scale)))


# house: hit rule of rays
def terminations_of(met: Contacts, lines: Lines, stack: Stack, cost: Ints, ray: RayWeapon, plan: Plan) -> Terminations:
    """Find the end of each ray.

    Parameters
    ----------
    met : contacts with accepted items
    lines : (R,) the rays
    cost : (M,) of each item of the stack
    plan : records what was searched
    """
    ends = endless(len(lines))
    objects = np.ones(len(met), np.bool_)
    plan.run("stops", "where each ray ends", ends.nbytes)
    if stack.has_occluders:
        end_at_occluders(ends, met, stack)
        objects = ~stack.occluder[met.rank]
        plan.run("occluders", "the first on the way of each ray", objects.nbytes)
    if ray.hits_most is not None:
        end_at_hits(ends, met.take(np.flatnonzero(objects)), ray.hits_most)
    if ray.budget_256 is not None:
        end_at_budget(ends, met.take(np.flatnonzero(objects & (cost[met.rank] > 0))), lines, cost, ray.budget_256)
    at_items = (ends.reason == Reason.OCCLUDER) | (ends.reason == Reason.HITS)
    ends.fraction[at_items] = ends.time[at_items] / lines.scale[at_items]
    plan.run("stops", "")
    return ends


def endless(n: int) -> Terminations:
    """Ends of n rays that all come to their range."""
    return Terminations(
        np.full(n, Reason.RANGE, np.int64),
        np.full(n, NEVER),
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.full(n, -1),
        np.zeros(n, np.bool_),
        np.ones(n),
    )


def end_at_occluders(ends: Terminations, met: Contacts, stack: Stack) -> None:
    """End rays at the first occluder that they touch."""
    blocking = np.flatnonzero(stack.occluder[met.rank])
    _end(ends, met, *_earliest(met, blocking, met.first[blocking]), Reason.OCCLUDER)
    ends.alone[:] = ends.reason == Reason.OCCLUDER


def _earliest(met: Contacts, pairs: Ints, cell: Ints) -> tuple[Ints, Ints]:
    """Earliest pair of each ray in the order of the walk, and its cell, given one cell of each pair."""
    order = np.lexsort((met.rank[pairs], met.x[cell], met.y[cell], met.entry[cell], met.ray[pairs]))
    first = order[begins(met.ray[pairs][order])]
    return pairs[first], cell[first]


def _end(ends: Terminations, met: Contacts, pairs: Ints, cell: Ints, reason: Reason) -> None:
    """End the rays of pairs in the given cells."""
    ray = met.ray[pairs]
    ends.reason[ray], ends.rank[ray] = reason, met.rank[pairs]
    ends.time[ray], ends.y[ray], ends.x[ray] = met.entry[cell], met.y[cell], met.x[cell]


def end_at_hits(ends: Terminations, met: Contacts, most: int) -> None:
    """End rays where they enter the last object that they may hit, if no occluder comes before."""
    met = met.only(ends.walked(met))
    cell = met.first
    order = np.lexsort((met.rank, met.x[cell], met.y[cell], met.entry[cell], met.ray))
    ray = met.ray[order]
    number = np.arange(len(ray)) - np.searchsorted(ray, ray)
    last = order[number == most - 1]
    alone = ends.alone[met.ray[last]] & (ends.time[met.ray[last]] == met.entry[cell[last]])
    _end(ends, met, last, cell[last], Reason.HITS)
    ends.alone[met.ray[last]] = alone


def end_at_budget(ends: Terminations, met: Contacts, lines: Lines, cost: Ints, budget_256: int) -> None:
    """End rays where the material along them uses up the budget, if nothing ends them sooner.

    `full` is the least whole number of units (time times cost) with (full * length / scale)^2 >= budget^2. The budget
    is used up when `full` is spent, or less than one unit before if the two sides are not equal (`even` is false).
    """
    if not budget_256:
        _end_inside(ends, met, np.arange(len(lines)), np.zeros(len(lines), np.int64))
        ends.fraction[:] = 0
        return
    ray, time, slope = _rates(met, cost)
    if not len(ray):
        return
    new = begins(ray)
    first, group = np.flatnonzero(new), np.cumsum(new) - 1
    fulls = [_full(lines, r, budget_256) for r in ray[first].tolist()]
    full, even = np.array([most for most, _ in fulls], object), np.array([exact for _, exact in fulls], np.bool_)
    spent = _spent(ray, time, slope, lines.scale[ray[first]])
    spent = spent - spent[first][group]
    enough = full if spent.dtype == object else np.minimum(full, NEVER).astype(np.int64)
    over = np.flatnonzero(spent >= enough[group])
    over = over[begins(ray[over])] - 1  # before the first of each ray
    left = full[group[over]] - spent[over]
    whole = np.asarray(time[over] - (-left // slope[over]), np.int64)
    even = even[group[over]] & np.asarray(left % slope[over] == 0, np.bool_)
    sooner = np.flatnonzero(whole <= ends.time[ray[over]])
    over, whole, even = over[sooner], whole[sooner], even[sooner]
    ray, time, spent, slope = ray[over], time[over], spent[over].astype(np.float64), slope[over]
    between = time + (budget_256 * (lines.scale[ray] / np.sqrt(lines.length2[ray])) - spent) / slope
    _end_inside(ends, met, ray, whole)
    ends.fraction[ray] = np.where(even, whole, np.clip(between, whole - 1, whole)) / lines.scale[ray]


def _rates(met: Contacts, cost: Ints) -> tuple[Ints, Ints, Ints]:
    """Times at which rays enter or leave objects, as sorted (ray, time, cost per time from then on)."""
    pair, first, last = stretches(met.pair, met.entry, met.leave)
    rate = cost[met.rank[pair]]
    ray = np.concatenate([met.ray[pair]] * 2)
    time, change = np.concatenate([first, last]), np.concatenate([rate, -rate])
    order = np.lexsort((time, ray))
    return (ray[order], time[order], np.cumsum(change[order]))  # a ray leaves all that it enters: the next starts at 0


def _spent(ray: Ints, time: Ints, slope: Ints, scale: Ints) -> npt.NDArray[Any]:
    """Cost spent before each time, summed over all rays; Python integers where int64 may overflow."""
    kind: Any = np.object_ if int(slope.max()) * int(scale.max()) >= ROOM else np.int64
    spent = np.cumsum(slope[:-1].astype(kind) * np.diff(time).astype(kind) * (np.diff(ray) == 0))
    return np.concatenate([np.zeros(1, kind), spent])


def _full(lines: Lines, ray: int, budget_256: int) -> tuple[int, bool]:
    """Least whole number with (number * length / scale)^2 >= budget^2, and whether they are equal."""
    square, length2 = (budget_256 * int(lines.scale[ray])) ** 2, max(int(lines.length2[ray]), 1)
    root = math.isqrt(square // length2)
    even = root * root * length2 == square
    return root + (not even), even


def _end_inside(ends: Terminations, met: Contacts, rays: Ints, times: Ints) -> None:
    """End rays at whole times, or less than one before, in the front-most object that they are in just before."""
    last = np.full(len(ends.time), -1)
    last[rays] = times - 1
    ends.reason[rays], ends.time[rays], ends.alone[rays] = Reason.BUDGET, times, True
    ends.rank[rays], ends.y[rays], ends.x[rays] = -1, 0, 0
    ray = met.ray[met.pair]
    within = np.flatnonzero((met.entry <= last[ray]) & (met.leave > last[ray]))
    ray, rank = ray[within], met.rank[met.pair[within]]
    order = np.lexsort((met.x[within], met.y[within], rank, ray))
    order = order[begins(ray[order])]
    ends.rank[ray[order]] = rank[order]
    ends.y[ray[order]], ends.x[ray[order]] = met.y[within[order]], met.x[within[order]]
