"""Raycast: what each ray hits, how many cells of it, and where the ray ends, without all its cells.

The rows of an answer need no more. Cells, with the times at which a ray enters and leaves them, are found again when
passes are read. `jit.raycast` has the compiled kernel; `ray_walk.trace` is the reference, and serves budgets, items
that move during a ray, and most weapons that do not hit what their rays start in.

1. Items whose boxes a ray enters, in the order of entry.
2. The first cell of each item, and the number of its cells. Rays that may end early look at few items at a time.
3. Ends, and the cells of those items that a ray is still in when it ends.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hitplanes.planes.bits.cells import BRUTE_PAIRS, is_sparse, met_boxes
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, HALF, SUB
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.grid.rasterize import DIAGONAL, Lines
from hitplanes.planes.grid.spans import Box, Columns, begins, clipped, pieces
from hitplanes.planes.scene.items import Stack

from .. import late
from ..fire.prefilter import Filters, filters_of, refused_by
from ..fire.strategy import are_few
from ..kinds.placements import Shots
from ..kinds.rays import RayWeapon
from .contacts import (
    NEVER,
    Contacts,
    Rays,
    Reason,
    Terminations,
    Touches,
    cells_most,
    end_at_budget,
    end_at_hits,
    end_at_occluders,
    endless,
    find_contacts,
    first_of_each,
)
from .ray_hits import Walk
from .ray_walk import Range, lines_of

RAYS_AT_ONCE = 1024
"""Most rays that are followed at a time; the columns of their pairs fit the processor's cache."""

FEW, GROWTH, ROUND_PAIRS = 4, 2, 128
"""Boxes of each ray in the first round, the ratio of the numbers of two rounds in a row, and as many pairs of a ray and
a box as take the time of a round."""


@dataclass(frozen=True, eq=False)
class Crossed(Columns):
    """Pairs of a ray and an item whose box it enters, sorted by (ray, least).

    Parameters
    ----------
    ray, rank : (P,) the ray, and the place of the item in the stack
    box_xyxy : (P, 4) box of the item within the bounds, relative to the pixel of the ray's start
    least, most : (P,) bounds of the times at which the ray enters cells of the item
    """

    ray: Ints
    rank: Ints
    box_xyxy: Ints
    least: Ints
    most: Ints


@dataclass(frozen=True, eq=False)
class Firsts(Columns):
    """Pairs of a ray and an item that it touches.

    Parameters
    ----------
    ray, rank : (P,) the ray, and the place of the item in the stack
    count : (P,) number of cells of the item on the whole ray
    x, y, entry : (P,) the first of them by (entry, y, x), relative to the pixel of the ray's start, and its time
    most : (P,) bound of the times of all of them
    """

    ray: Ints
    rank: Ints
    count: Ints
    x: Ints
    y: Ints
    entry: Ints
    most: Ints


# house: way of rays
def cast_rays(rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> list[Walk] | None:
    """Follow rays to their ends, in parts whose cells can be found again; None if the kernel does not serve them.

    A kernel serves no rays that are too long or too wide for it.
    """
    stack, plan = through.stack, through.plan
    lines, filters = Lines(rays.start_256, rays.step_256, ray.radius_256), filters_of(stack, shots, rays.shot)
    kernels = kernels_of(sys.modules[__name__])
    found = kernels.hits_and_ends(stack, through.bounds, lines, ray.hits_most, filters)
    if found is None:
        return None
    plan.run("cast", "each ray to its end: boxes, filters and occluders, too", sum(part.nbytes for part in found))
    walks = walk_of(rays, ray, stack, through.bounds, found).parts()
    if ray.budget_256 is None:
        return walks
    plan.run("stops", "where budgets are used up")
    cost = through.items.cost[stack.rows]
    return [spent(walk, cost, ray.budget_256) for walk in walks]


def spent(walk: Walk, cost: Ints, budget_256: int) -> Walk:
    """Rays as they end by a budget, from the same rays without one; `cost` (M,) is that of a px of each item.

    Most rays cannot spend all. Of those that hit many objects, most end in the first few of them, which are looked at
    beforehand.
    """
    hit, ray = walk.hit, walk.hit.ray
    most = np.bincount(ray, cost[hit.rank] * hit.count, len(walk.rays)) * longest_in_cell(walk.lines.radius)
    looked = (most >= budget_256)[ray]
    many = np.flatnonzero(looked & (np.bincount(ray, minlength=len(most))[ray] > 2 * FEW))
    if len(many):
        few = many[many - np.searchsorted(ray, ray[many]) < FEW]
        looked &= hit.entry <= _ends_by_budget(walk, few, cost, budget_256)[0].time[ray]
    pairs, walked = np.flatnonzero(looked), np.zeros(len(ray), np.int64)
    ends, walked[pairs] = _ends_by_budget(walk, pairs, cost, budget_256)
    count = np.where(ends.reason[ray] == Reason.BUDGET, walked, hit.count)
    return replace(walk, hit=replace(hit, count=count).take(np.flatnonzero(count)), ends=ends)


def longest_in_cell(radius_256: int) -> int:
    """Bound on the way of a ray in a cell, 1/256 px: its width and the diagonal of the cell."""
    return 2 * (DIAGONAL + radius_256)


def _ends_by_budget(walk: Walk, pairs: Ints, cost: Ints, budget_256: int) -> tuple[Terminations, Ints]:
    """Ends of rays by a budget that some of their hits (n,) take from, and the cells of these that are walked."""
    ends, met = walk.ends.take(np.arange(len(walk.rays))), replace(walk, hit=walk.hit.take(pairs)).contacts()[0]
    end_at_budget(ends, met.take(np.flatnonzero(cost[met.rank] > 0)), walk.lines, cost, budget_256)
    return ends, np.bincount(met.pair[ends.walked(met)], minlength=len(pairs))


def walk_of(rays: Rays, ray: RayWeapon, stack: Stack, bounds: Box | None, found: tuple[Ints, Ints]) -> Walk:
    """Rays that were followed to their ends; `found` is what they hit and their ends, as `hits_and_ends` returns it."""
    lines, (reason, time, y, x, rank, alone) = lines_of(rays, ray), found[1]
    fraction, at_items = np.ones(len(rays)), np.flatnonzero(reason)
    fraction[at_items] = time[at_items] / lines.scale[at_items]
    ends = Terminations(reason, time, y, x, rank, alone != 0, fraction)
    return Walk(rays, lines, Touches(*found[0]), ends, stack, bounds, ray.fades)


def cast_to_ends(rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> tuple[Terminations, Ints]:
    """Ends of rays that end at their first hit; and the rays left to the walk."""
    walks = cast_rays(rays, ray, shots, through)
    if walks is None:
        return endless(len(rays)), np.arange(len(rays))
    ends = Terminations.joined([walk.ends for walk in walks])
    return ends, np.flatnonzero((ends.time == 0) & (ray.inside != "hit"))


def hits_and_ends(
    stack: Stack, bounds: Box | None, lines: Lines, most: int | None, filters: Filters | None = None
) -> tuple[Ints, Ints]:
    """Follow rays to their ends, as `trace` does, and count the cells of what they hit.

    Parameters
    ----------
    lines : (R,) the rays, in the world
    most : number of objects that a ray may hit, or None
    filters : of each ray; None refuses nothing

    Returns
    -------
    what rays hit, in order, as (ray, rank, count, x, y, entry) (6, P); and their ends, as (reason, time, y, x, rank,
    alone) (6, R); a compiled kernel returns None for rays that are too long or too wide for it
    """
    if are_few(len(lines), stack, most):
        return late.one_ray.follow_each(stack, bounds, lines, most, filters)
    return cast_together(stack, bounds, lines, most, filters)


# house: hit rule of rays
def cast_together(
    stack: Stack, bounds: Box | None, lines: Lines, most: int | None, filters: Filters | None
) -> tuple[Ints, Ints]:
    """`hits_and_ends` in arrays, some rays at a time."""
    step, found, size = RAYS_AT_ONCE, [], np.abs(lines.step).max(axis=0, initial=0) // SUB + 2 * lines.radius // SUB + 2
    if not len(stack) or not is_sparse(stack.sizes, size):  # all boxes are compared
        step = max(1, min(step, BRUTE_PAIRS // max(len(stack), 1)))
    for begin in range(0, max(len(lines), 1), step):
        part = slice(begin, begin + step)
        own = filters and (filters[0][part], filters[1][part])
        found.append(_cast_together(stack, bounds, lines.take(part), most, own))
        found[-1][0][0] += begin
    if len(found) == 1:
        return found[0]
    hit, ends = (np.concatenate(columns, axis=1) for columns in zip(*found, strict=True))
    return hit, ends


def _cast_together(
    stack: Stack, bounds: Box | None, lines: Lines, most: int | None, filters: Filters | None
) -> tuple[Ints, Ints]:
    """`cast_together` of some rays."""
    origin = pixel(lines.start)
    own = Lines(lines.start - SUB * origin, lines.step, lines.radius)
    near = near_items(stack, bounds, lines, own, origin, filters)
    firsts, ends = NO_FIRSTS, endless(len(lines))
    for batch in _rounds(near, len(lines), most, stack):
        now = batch[near.least[batch] <= ends.time[near.ray[batch]]]
        if len(now):
            firsts = Firsts.joined([firsts, first_cells(near.take(now), own, origin, stack)])
            ends = _ends(firsts, len(lines), most, origin, bounds, stack)
    hit = _hit(firsts, ends, stack)
    last = (hit.entry == ends.time[hit.ray]) & (hit.x == ends.x[hit.ray]) & (hit.y == ends.y[hit.ray])
    hit.count[last] = 1  # all other cells of the item come after the first
    last = np.flatnonzero((hit.most >= ends.time[hit.ray]) & ~last)
    if len(last):
        ray = hit.ray[last]
        cells = find_contacts(own.take(ray), ray, hit.rank[last], stack, bounds, origin[ray])
        hit.count[last] = cells.only(ends.walked(cells)).count
    columns = ends.reason, ends.time, ends.y, ends.x, ends.rank, ends.alone.astype(np.int64)
    return np.stack([hit.ray, hit.rank, hit.count, hit.x, hit.y, hit.entry]), np.stack(columns)


def near_items(
    stack: Stack, bounds: Box | None, lines: Lines, own: Lines, origin: Ints, filters: Filters | None
) -> Crossed:
    """Accepted items whose boxes rays enter; `own` are the lines relative to their pixels of origin."""
    ray, rank = met_boxes(lines.box_xyxy, stack.box_xyxy)
    if filters is not None:
        accepted = ~refused_by(filters, stack, rank, ray)
        ray, rank = ray[accepted], rank[accepted]
    kept = _crossing(lines, ray, rank, stack.box_xyxy)
    ray, rank = ray[kept], rank[kept]
    box = stack.box_xyxy[rank] if bounds is None else clipped(stack.box_xyxy[rank], bounds)
    box = box - np.concatenate([origin, origin], axis=1)[ray]
    least, most = times_in(own, ray, box)
    kept = np.flatnonzero((least <= most) & (box[:, 0] <= box[:, 2]) & (box[:, 1] <= box[:, 3]))
    kept = kept[np.lexsort((least[kept], ray[kept]))]
    return Crossed(ray[kept], rank[kept], box[kept], least[kept], most[kept])


def _crossing(lines: Lines, ray: Ints, rank: Ints, boxes_xyxy: Ints) -> Ints:
    """Numbers of the pairs of a ray and an item whose box meets the infinite axis of the ray, or its sides."""
    left, top, right, low = HALF * boxes_xyxy.T
    (x, y), (dx, dy) = lines.start.T, lines.step.T
    wide, high = np.abs(dx), np.abs(dy)
    reach = lines.wide_sides if lines.radius else HALF * (wide + high)
    across = ((left + right)[rank] - x[ray]) * dy[ray] - ((top + low)[rank] - y[ray]) * dx[ray]
    return np.flatnonzero(
        np.abs(across) <= (right - left)[rank] * high[ray] + (low - top)[rank] * wide[ray] + reach[ray]
    )


def times_in(own: Lines, ray: Ints, box: Ints) -> tuple[Ints, Ints]:
    """Bounds of the times at which rays enter cells of boxes; the second is less if a ray touches none."""
    (x, y), (dx, dy) = own.start[ray].T, own.step[ray].T
    left, top, right, low = (SUB * box - np.stack([x, y, x, y], axis=1)).T
    if own.radius:
        u = [np.minimum(left * dx, right * dx) + np.minimum(top * dy, low * dy)]
        u.append(np.maximum(left * dx, right * dx) + np.maximum(top * dy, low * dy))
        aside = np.minimum(left * dy, right * dy) - np.maximum(top * dx, low * dx)
        other = np.maximum(left * dy, right * dy) - np.minimum(top * dx, low * dx)
        reach, length2 = own.wide_sides[ray], own.length2[ray]
        least, most = u[0] - reach - 2, u[1] + reach + 2
        missed = (aside > reach) | (other < -reach) | (least > length2) | (most < 0)
        return least, np.where(missed, least - 1, most)
    across_x, across_y = np.maximum(np.abs(dy), 1), np.maximum(np.abs(dx), 1)
    entry, leave = np.zeros(len(ray), np.int64), across_x * across_y
    for first, last, step, across in ((left, right, dx, across_x), (top, low, dy, across_y)):
        near, far = (
            (np.where(step < 0, -last, first) - HALF) * across,
            (np.where(step < 0, -first, last) + HALF) * across,
        )
        beside = (step == 0) & ((near > 0) | (far < 0))
        entry = np.where(step == 0, entry, np.maximum(entry, near))
        leave = np.where(step == 0, np.where(beside, -1, leave), np.minimum(leave, far))
    return entry, leave


def _rounds(near: Crossed, rays: int, most: int | None, stack: Stack) -> Iterator[Ints]:
    """Numbers of the pairs that are looked at one after another: occluders, and the next few objects of each ray.

    Of rays that go through all objects, or meet few boxes, all objects are next.
    """
    early = len(near) > FEW * rays + ROUND_PAIRS
    object_ = np.arange(len(near))
    if early and stack.has_occluders:
        blocks = stack.occluder[near.rank]
        yield np.flatnonzero(blocks)
        object_ = np.flatnonzero(~blocks)
    if not early or most is None:
        yield object_
        return
    ray = near.ray[object_]
    place = np.arange(len(ray)) - np.searchsorted(ray, ray)
    first, size, last = 0, max(FEW, most), int(place.max(initial=-1))
    while first <= last:
        yield object_[(place >= first) & (place < first + size)]
        first, size = first + size, size * GROWTH


def first_cells(near: Crossed, own: Lines, origin: Ints, stack: Stack) -> Firsts:
    """The first cells of items, and the numbers of their cells."""
    side = near.box_xyxy[:, 2:] - near.box_xyxy[:, :2] + 1
    parts = pieces(cells_most(own, side), CHUNK_SAMPLES) if len(near) else []
    return Firsts.joined([_firsts(near.take(part), own, origin, stack) for part in parts]) if parts else NO_FIRSTS


NO_FIRSTS = Firsts(*[np.zeros(0, np.int64)] * 7)


def _firsts(near: Crossed, own: Lines, origin: Ints, stack: Stack) -> Firsts:
    """`first_cells` for a part of the pairs."""
    lines = own.take(near.ray)
    pair, row, first, last = lines.runs(near.box_xyxy)
    run, place = _pixels(near, lines, origin, stack, (pair, row, first), last - first + 1)
    cells = np.bincount(pair, np.bincount(run, minlength=len(pair)), len(near)).astype(np.int64)
    entries = _thick_entries if own.radius else _thin_entries
    reached, entry, count = entries(lines, (pair, row, first), run, place, cells)
    run, place = run[reached], place[reached]
    of = pair[run]
    begin = np.flatnonzero(begins(of))
    met = of[begin]
    soonest = np.zeros(len(near), np.int64)
    if len(begin):
        soonest[met] = np.minimum.reduceat(entry, begin)
    tied = np.flatnonzero(entry == soonest[of])
    run, of = run[tied], of[tied]
    u, v, steep = first[run] + place[tied], row[run], lines.steep[of]
    x, y, new = np.where(steep, v, u), np.where(steep, u, v), begins(of)
    cell = first_of_each(np.flatnonzero(new), np.cumsum(new) - 1, (y, x))
    return Firsts(near.ray[met], near.rank[met], count[met], x[cell], y[cell], soonest[met], near.most[met])


Runs = tuple[Ints, Ints, Ints]
"""Runs of cells (n,) along the longer axes of rays: pair, row, and first cell."""


def _pixels(near: Crossed, lines: Lines, origin: Ints, stack: Stack, runs: Runs, length: Ints) -> tuple[Ints, Ints]:
    """Pixels of items in runs, as (run, place in it)."""
    pair, row, first = runs
    width, corner = stack.width[near.rank], stack.box_xyxy[near.rank, :2] - origin[near.ray]
    along, across = np.where(lines.steep, width, 1), np.where(lines.steep, 1, width)
    begin = (stack.offset[near.rank] - corner[:, 1] * width - corner[:, 0])[pair] + first * along[pair]
    begin += row * across[pair]
    start = np.cumsum(length) - length
    texel = np.repeat(along[pair], length)
    if len(begin):  # the steps from pixel to pixel, and from run to run
        texel[start[1:]] = begin[1:] - (begin + (length - 1) * along[pair])[:-1]
        texel[0] = begin[0]
    on = np.flatnonzero(stack.masks[np.cumsum(texel, out=texel)])
    run = np.repeat(np.arange(len(length)), length)[on]
    return run, on - start[run]


def _thin_entries(lines: Lines, runs: Runs, run: Ints, place: Ints, cells: Ints) -> tuple[slice, Ints, Ints]:
    """Pixels that may be the first of their pairs, when rays enter them, and the number of cells of each pair.

    Parameters
    ----------
    run, place : (k,) the pixels: the run, and the place in it
    cells : (P,) number of pixels of each pair
    """
    pair, row, first = runs
    u, v, along, aside = lines.flat
    ahead, per = np.sign(along), np.maximum(np.abs(aside), 1)
    by_row = (SUB * row - v[pair]) * np.sign(aside)[pair] - HALF
    by_row = np.maximum(by_row * np.maximum(np.abs(along), 1)[pair], 0)
    by_column, step = ((SUB * first - u[pair]) * ahead[pair] - HALF) * per[pair], (SUB * ahead * per)[pair]
    entry = step[run]
    entry *= place
    entry += by_column[run]
    return slice(None), np.maximum(entry, by_row[run], out=entry), cells


def _thick_entries(lines: Lines, runs: Runs, run: Ints, place: Ints, cells: Ints) -> tuple[Ints, Ints, Ints]:
    """`_thin_entries` of thick rays.

    Beside a ray, between its ends, all cells are touched that are near enough to its axis. A ray enters a cell at most
    `reach` before the time at which its own centre passes it, so few of these cells may be the first.
    """
    (pair, row, first), (u, v, along, aside), reach = runs, lines.flat, lines.wide_sides
    passes, step = (SUB * first - u[pair]) * along[pair] + (SUB * row - v[pair]) * aside[pair], (SUB * along)[pair]
    length = np.zeros(len(pair), np.int64)
    length[run] = place  # the last pixel of each run
    last, end = passes + length * step, lines.length2[pair]
    surely = (np.minimum(passes, last) >= 0) & (np.maximum(passes, last) <= end) & (end > 0)
    surely &= lines.radius >= DIAGONAL
    time = step[run]
    time *= place
    time += np.where(surely, passes, NEVER)[run]
    latest, begin = np.full(len(cells), NEVER), np.flatnonzero(begins(pair[run]))
    if len(begin):
        latest[pair[run[begin]]] = np.minimum.reduceat(time, begin)
    kept = np.flatnonzero(time <= np.where(surely, (latest + reach + 1)[pair], np.iinfo(np.int64).max)[run])
    there, column, line = pair[run[kept]], first[run[kept]] + place[kept], row[run[kept]]
    steep = lines.steep[there]
    entry, leave = lines.times(there, np.where(steep, line, column), np.where(steep, column, line))
    missed = np.bincount(there[entry > leave], minlength=len(cells))  # a cell that is touched surely is not missed
    touched = np.flatnonzero(entry <= leave)
    return kept[touched], entry[touched], cells - missed


def _ends(firsts: Firsts, rays: int, most: int | None, origin: Ints, bounds: Box | None, stack: Stack) -> Terminations:
    """Ends of rays, without `fraction`; the cells of items that rays enter as they end become the last cells."""
    one, ends = np.ones(len(firsts), np.int64), endless(rays)
    met = Contacts(firsts.ray, firsts.rank, one, firsts.x, firsts.y, firsts.entry, firsts.entry)
    if stack.has_occluders:
        end_at_occluders(ends, met, stack)
        here = np.flatnonzero((firsts.entry == ends.time[firsts.ray]) & (firsts.rank < ends.rank[firsts.ray]))
        ray = firsts.ray[here]
        here = here[covers(stack, firsts.rank[here], ends.x[ray], ends.y[ray], origin[ray], bounds)]
        ray = firsts.ray[here]
        firsts.x[here], firsts.y[here] = ends.x[ray], ends.y[ray]  # of the cells entered then, it walks that one alone
        met = met.take(np.flatnonzero(~stack.occluder[firsts.rank]))
    if most is not None:
        end_at_hits(ends, met, most)
    return ends


def _hit(firsts: Firsts, ends: Terminations, stack: Stack) -> Firsts:
    """Objects that rays hit before their ends, in order."""
    reached = ends.reaches(firsts.ray, firsts.entry, firsts.y, firsts.x, firsts.rank)
    if stack.has_occluders:
        reached &= ~stack.occluder[firsts.rank]
    hit = firsts.take(np.flatnonzero(reached))
    return hit.take(np.lexsort((hit.rank, hit.x, hit.y, hit.entry, hit.ray)))


def covers(stack: Stack, rank: Ints, x: Ints, y: Ints, origin: Ints, bounds: Box | None) -> Bools:
    """Whether items have pixels (n,), given relative to the pixels of origin (n, 2), within the bounds."""
    x, y = x + origin[:, 0], y + origin[:, 1]
    full = stack.box_xyxy[rank]
    box = full if bounds is None else clipped(full, bounds)
    on = (box[:, 0] <= x) & (x <= box[:, 2]) & (box[:, 1] <= y) & (y <= box[:, 3])
    texel = stack.offset[rank] + (y - full[:, 1]) * stack.width[rank] + x - full[:, 0]
    return on & stack.masks[np.where(on, texel, 0)]
