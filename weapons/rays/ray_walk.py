"""Ray walk, the reference for all rays: the contacts of each ray with items, cell by cell, and its end.

Only cells inside the boxes of items are tested. A ray that may end early is followed in stretches, each longer than the
one before, until its end is known, so that in a crowd it is tested against few items.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from hitplanes.planes.bits.distance_field import DistanceField
from hitplanes.planes.common.checks import Floats, InputError, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, HALF, SUB
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import Box, slabs
from hitplanes.planes.scene.items import Items, Stack

from ..fire.plan import Plan
from ..fire.prefilter import Candidates, may_refuse, refused
from ..kinds.placements import Shots
from ..kinds.rays import Projectile, RayWeapon, is_moving
from .contacts import (
    Contacts,
    Rays,
    Terminations,
    at_steps,
    common_scale,
    find_contacts,
    in_frame,
    relative_lines,
    steps_of,
    stretches,
    terminations_of,
)

STRETCH_PAIRS, STRETCH_GROWTH = 150, 2
"""Pairs of rays and boxes expected in the first stretch of a walk, at least one a ray, which cost as much as a stretch;
ratio of the lengths of two stretches in a row."""

SLACK = 2.0**-20
"""Tolerance of the float test that finds the stretch in which a ray enters a box: a fraction of its length, and px."""


@dataclass(frozen=True, eq=False)
class Looked:
    """Record of the search for items: the boxes (n, 4) asked for, and the pairs (ray, rank) compared pixel by pixel."""

    boxes_xyxy: list[Ints] = field(default_factory=list)
    pairs: list[tuple[Ints, Ints]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Range:
    """The items that rays are tested against, and the records of the work.

    `field` is that of a scene within bounds, for rays that march; it holds what all of them accept. `looked` is set
    only for a report; `whole` follows rays in one stretch, beyond their ends.
    """

    items: Items
    stack: Stack
    bounds: Box | None
    candidates: Candidates
    plan: Plan
    looked: Looked | None = None
    whole: bool = False
    field: DistanceField | None = None


# house: way of rays
def trace(rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> tuple[Contacts, Terminations, Lines, Lines]:
    """Follow rays to their ends.

    Returns
    -------
    the contacts with accepted items, some of them beyond the ends; the ends; the lines (R,) of the rays; and the line
    of each pair, relative to the motion of its item

    Raises
    ------
    InputError
        If a ray starts inside an item and the weapon forbids it; names the shot and the item.
    """
    lines = lines_of(rays, ray)
    cost = through.items.cost[through.stack.rows]
    common = common_scale(ray, through.items, through.stack)
    timed = Lines(lines.start, lines.step, lines.radius, common) if common else lines
    edges = _edges(lines, ray, through)
    live = np.ones(len(rays), np.bool_)
    found: list[Contacts] = []
    pending, ends = Contacts.none(), None
    for near, far in pairwise(edges):
        pairs = _pairs(rays, ray, lines, np.flatnonzero(live), (near, far), through)
        possible = len(rays) * len(through.stack) if near == -np.inf else 0
        found.append(_touched(rays, ray, lines, shots, pairs, possible, through))
        through.plan.run("walk", "")
        pending = Contacts.joined([pending.of_rays(live), found[-1]]) if len(pending) else found[-1]
        now = terminations_of(pending, timed, through.stack, cost, ray, through.plan)
        ends = now if ends is None else ends.replaced(live, now)
        live &= (now.fraction + SLACK) * lines.length >= far
        if not live.any():
            break
    assert ends is not None  # there is one stretch at least
    met = Contacts.joined(found)
    return met, ends, timed, relative_lines(lines, ray, met.ray, through.stack.rows[met.rank], through.items)


def has_whole_walk(ray: RayWeapon, items: Items, stack: Stack) -> bool:
    """Whether a weapon's rays hit what they meet in all cells before their ends, at times of their own."""
    return ray.inside != "ignore_until_exit" and steps_of(ray) is None and not is_moving(ray, items, stack)


def touching(rays: Rays, ray: RayWeapon, through: Range) -> tuple[Contacts, Lines]:
    """Contacts of the whole length of rays with all items, including refused ones and cells out of bounds.

    Returns
    -------
    the contacts; and the line of each pair, relative to the motion of its item
    """
    lines = lines_of(rays, ray)
    row, rank = _pairs(rays, ray, lines, np.arange(len(rays)), (-np.inf, np.inf), through)
    own = relative_lines(lines, ray, row, through.stack.rows[rank], through.items)
    met = find_contacts(own, row, rank, through.stack, None, rays.origin_xy[row])
    return met, relative_lines(lines, ray, met.ray, through.stack.rows[met.rank], through.items)


def lines_of(rays: Rays, ray: RayWeapon) -> Lines:
    """Lines of rays, relative to the pixels of their starts."""
    return Lines(rays.start_256 - SUB * rays.origin_xy, rays.step_256, ray.radius_256)


def _edges(lines: Lines, ray: RayWeapon, through: Range) -> list[float]:
    """Distances at which rays are cut into stretches, px."""
    stack = through.stack
    endless = ray.hits_most is None and ray.budget_256 is None and not stack.has_occluders
    if (
        through.whole
        or endless
        or not len(stack)
        or through.candidates.prefilter.name == "none"
        or is_moving(ray, through.items, through.stack)
    ):
        return [-np.inf, np.inf]
    first = max(STRETCH_PAIRS / max(len(lines), 1), 1) / _pairs_per_px(stack, lines.radius)
    longest = float(lines.length.max(initial=0))
    if longest <= STRETCH_GROWTH * first:
        return [-np.inf, np.inf]
    edges = [-np.inf]
    while first < longest:
        edges.append(first)
        first *= STRETCH_GROWTH
    return [*edges, np.inf]


def _pairs_per_px(stack: Stack, radius: int) -> float:
    """Number of boxes that 1 px of a ray is expected to enter if they are spread evenly over the box around all."""
    (wide, high), (width, height) = stack.sizes
    return len(stack) * (wide + high + 4 * radius / SUB) / (width * height)


def expected_cells(rays: Rays, ray: RayWeapon, stack: Stack) -> float:
    """Number of cells of items that the longest ray is expected to touch up to its range, plus one."""
    if not len(stack):
        return 1.0
    length = float(np.sqrt((rays.step_256**2).sum(axis=1).max(initial=0))) / SUB
    (wide, high), radius = stack.mean_wh, ray.radius_256
    pairs = min(_pairs_per_px(stack, radius) * length, len(stack))
    return 1 + pairs * min(wide * high, (2 * radius / SUB + 1) * (wide + high))


def _pairs(
    rays: Rays, ray: RayWeapon, lines: Lines, live: Ints, edges: tuple[float, float], through: Range
) -> tuple[Ints, Ints]:
    """Pairs (ray, rank) for which the ray enters the item's box at a distance in (near, far], px.

    Rays are taken in chunks of about CHUNK_SAMPLES pairs; chunks grow as long as rays meet few boxes.
    """
    found: list[tuple[Ints, Ints]] = []
    begin, met = 0, through.candidates.met
    step = max(1, CHUNK_SAMPLES // max(len(through.stack), 1))
    while begin < len(live) and len(through.stack):
        found.append(_entered(rays, ray, lines, live[begin : begin + step], edges, through))
        begin += step
        step = max(1, min(2 * step, CHUNK_SAMPLES * begin // max(through.candidates.met - met, 1)))
    if len(found) == 1:
        return found[0]
    row, rank = (np.concatenate([np.zeros(0, np.int64), *(part[side] for part in found)]) for side in (0, 1))
    return row, rank


def _entered(
    rays: Rays, ray: RayWeapon, lines: Lines, live: Ints, edges: tuple[float, float], through: Range
) -> tuple[Ints, Ints]:
    """Pairs of one chunk of the rays."""
    candidates, asked = through.candidates, _stretch_boxes(rays, lines, live, *edges)
    if is_moving(ray, through.items, through.stack):  # to wherever an item may move during the ray
        fastest = -(-np.abs(through.items.velocity_256[through.stack.rows]).max(axis=0) // SUB)
        asked += np.concatenate([-fastest, fastest])
    row, rank = candidates.meeting(asked)
    if candidates.prefilter.name == "none":
        return live[row], rank
    if through.looked:
        through.looked.boxes_xyxy.append(asked)
    if candidates.index is not None:
        why = f"{candidates.index.structure}: {candidates.index.followed} boxes placed anew"
        through.plan.run("broad phase", why, row.nbytes + rank.nbytes)
    relative = relative_lines(lines, ray, live[row], through.stack.rows[rank], through.items)
    enters = _enters(rays.origin_xy[live[row]], relative, through.stack.box_xyxy[rank])
    kept = np.flatnonzero((enters > edges[0]) & (enters <= edges[1]))
    return live[row[kept]], rank[kept]


def _stretch_boxes(rays: Rays, lines: Lines, live: Ints, near: float, far: float) -> Ints:
    """Inclusive boxes (n, 4), a little too large, around what rays touch between two distances."""
    safe = np.maximum(lines.length[live], SLACK)[:, None]
    start, step = lines.start[live] / SUB, lines.step[live] / SUB
    ends = [start + np.clip(edge / safe, 0, 1) * step for edge in (near, far)]
    wide = lines.radius / SUB + 1
    low, high = np.floor(np.minimum(*ends) - wide), np.ceil(np.maximum(*ends) + wide)
    origin = rays.origin_xy[live]
    return np.concatenate([low.astype(np.int64) + origin, high.astype(np.int64) + origin], axis=1)


def _enters(origin_xy: Ints, lines: Lines, boxes_xyxy: Ints) -> Floats:
    """Distance along each line at which it enters its box, px, or a little less; NaN if it passes by."""
    grown = (lines.radius + HALF) / SUB + SLACK
    start, step = lines.start / SUB, lines.step / SUB
    low, high = boxes_xyxy[:, :2] - origin_xy - grown, boxes_xyxy[:, 2:] - origin_xy + grown
    first, last = slabs(start, step, low, high)
    beside = ((step == 0) & ((low > start) | (high < start))).any(axis=1)
    missed = beside | (first > last + SLACK) | (first > 1 + SLACK) | (last < -SLACK)
    return np.where(missed, np.nan, np.maximum(first, 0) * lines.length - SLACK)


def _touched(
    rays: Rays, ray: RayWeapon, lines: Lines, shots: Shots, pairs: tuple[Ints, Ints], possible: int, through: Range
) -> Contacts:
    """Contacts with accepted items, by the weapon's rules for steps and for items in which rays start."""
    stack, plan = through.stack, through.plan
    row, rank = pairs
    plan.run("pre-filter", through.candidates.why, row.nbytes + rank.nbytes)
    if may_refuse(stack, shots):
        accepted = ~refused(stack, rank, shots, rays.shot[row])
        row, rank = row[accepted], rank[accepted]
        plan.run("filter", "categories and owners", row.nbytes + rank.nbytes, (len(rank), len(accepted)))
    own, origin = relative_lines(lines, ray, row, stack.rows[rank], through.items), rays.origin_xy[row]
    wanted = through.candidates.prefilter
    if wanted.volume:
        from ..fire.prefilter import near_rays

        corner = stack.box_xyxy[rank, :2] - origin
        kept = near_rays(wanted.volume, through.items, stack.rows[rank], corner, own)
        row, rank, own, origin = row[kept], rank[kept], own.take(kept), origin[kept]
        plan.run("volumes", wanted.name, kept.nbytes + row.nbytes + rank.nbytes, (len(rank), len(kept)))
    if through.looked:
        through.looked.pairs.append((row, rank))
    plan.run("pre-filter", "", 0, (len(rank), possible))
    met = find_contacts(own, row, rank, stack, through.bounds, origin)
    plan.run("walk", "cells of rays on pixels of items", met.nbytes)
    if not isinstance(ray, Projectile):
        return _started(met, rays, ray, shots, through)
    moving = is_moving(ray, through.items, stack)
    own = relative_lines(lines, ray, met.ray, stack.rows[met.rank], through.items)
    met = _started(in_frame(met, own, moving), rays, ray, shots, through)
    if ray.steps is None:
        return met
    return at_steps(met, relative_lines(lines, ray, met.ray, stack.rows[met.rank], through.items), ray.steps)


def _started(met: Contacts, rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> Contacts:
    """Apply the weapon's rule to items in which rays start."""
    if ray.inside == "hit" or not len(met):
        return met
    inside = np.flatnonzero(met.entry[met.first] == 0)
    if ray.inside == "error" and len(inside):
        pair = inside[np.lexsort((met.rank[inside], met.ray[inside]))[0]]
        shot, item = int(shots.row[rays.shot[met.ray[pair]]]), int(through.stack.ids[met.rank[pair]])
        got = f"one inside of id {item}, {through.items.name_of(item)!r}"
        raise InputError(f"at[{shot}]: expected a start outside of every item, got {got}")
    out = np.full(len(met), -1)
    if len(inside):
        pair, first, last = stretches(met.pair, met.entry, met.leave)
        out[pair[first == 0]] = last[first == 0]
    return met.only(met.entry > out[met.pair])
