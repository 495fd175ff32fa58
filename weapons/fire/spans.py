"""The reference of areas: spans of placed patterns walk the stack, front to back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hitplanes.planes.bits.span_walk import (
    HIT,
    LIVE,
    OF_PATTERNS,
    VERDICT_OF,
    Events,
    Kinds,
    Pairs,
    Runs,
    Verdict,
    walk,
)
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES
from hitplanes.planes.grid.spans import Box, area, clipped, merged_runs, pieces
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.areas import parts_of
from ..kinds.placements import Placements, Shots
from ..kinds.weapon import Weapon
from .plan import Plan
from .prefilter import Candidates, kinds, may_refuse, refused

if TYPE_CHECKING:
    from hitplanes.planes.bits.shadows import Blockers

SPARSE = 4
"""If items fill less than 1 / SPARSE of the box around them, spans are cut to each item's box, not to that one."""


@dataclass(eq=False, slots=True)
class QueryContext:
    """What placements are tested against: the stack, its bounds, whether they pierce, the pre-filter, and the plan.

    `blockers` are the items that may shelter pixels; None if there is none, or the weapon needs no line of sight.
    """

    stack: Stack
    bounds: Box | None
    pierce: bool
    candidates: Candidates
    plan: Plan
    blockers: Blockers | None


def context_of(scene: Scene, stack: Stack, weapon: Weapon, shots: Shots | None = None, shift: int = 0) -> QueryContext:
    """What shots of a weapon were tested against: a stack of the scene, which may have changed since.

    If `shots` are given, no others are looked at, and no pixels but theirs, or those of shots that are shifted by up to
    `shift` px.
    """
    plain, blockers = parts_of(weapon)[2], None
    if plain.line_of_sight:
        near = None if shots is None else late.shelter.ways_box(weapon, shots, shift)
        blockers = late.shelter.blockers_of(scene, stack, plain.line_of_sight, plain.inside, None, near)
    return QueryContext(stack, scene.bounds, plain.pierce, Candidates(scene.items, stack), Plan(), blockers)


@dataclass(frozen=True, eq=False)
class SpanHits:
    """Runs of pixels that hit an object, and the verdict counts of each placement.

    Parameters
    ----------
    placement, rank, y, x_first, x_last, weight : (n,) rank of the object in the stack; sum of the pixels' weights
    counts : (P, 5) samples by verdict
    """

    placement: Ints
    rank: Ints
    y: Ints
    x_first: Ints
    x_last: Ints
    weight: Ints
    counts: Ints


def direct(placements: Placements, shots: Shots, context: QueryContext) -> SpanHits:
    """Walk the stack under every placement, but only where an item may be."""
    boxes = placements.boxes
    counts = inside(placements, boxes, context)
    if not len(context.stack):
        return _met(placements, Runs.joined([]), [], counts, context.plan)
    placement, rank = near_pairs(placements, np.arange(len(boxes)), boxes, context)
    pairs = Pairs(placement, rank, _kinds(rank, placements.shot[placement], shots, context))
    if context.blockers is not None and len(boxes):  # what lies on no item may be sheltered, too
        every = np.arange(len(boxes))
        runs = _laid(placements, every, boxes if context.bounds is None else clipped(boxes, context.bounds))
    else:
        runs = _under_items(placements, pairs, context)
    context.plan.run("samples", "runs where items may be", runs.nbytes)
    return _met(placements, runs, _walked(placements, shots, runs, pairs, context, counts), counts, context.plan)


def _under_items(placements: Placements, pairs: Pairs, context: QueryContext) -> Runs:
    """Runs of placements, clipped to the items that they are paired with."""
    busy, first = np.unique(pairs.placement, return_index=True)
    if not len(busy):
        return Runs.joined([])
    items = context.stack.box_xyxy[pairs.rank]
    low = np.minimum.reduceat(items[:, :2], first, axis=0)
    hull = np.concatenate([low, np.maximum.reduceat(items[:, 2:], first, axis=0)], axis=1)
    if area(hull) <= SPARSE * area(items):
        return _laid(placements, busy, hull if context.bounds is None else clipped(hull, context.bounds))
    runs = _laid(placements, pairs.placement, items if context.bounds is None else clipped(items, context.bounds))
    y = runs.y - runs.y.min(initial=0)
    rows = int(y.max(initial=0)) + 1
    which, x_first, x_last = merged_runs(runs.placement * rows + y, runs.x_first, runs.x_last)
    runs = runs.take(which)
    return Runs(runs.placement, runs.y, x_first, x_last, runs.ordinal)


def near_pairs(placements: Placements, which: Ints, boxes: Ints, context: QueryContext) -> tuple[Ints, Ints]:
    """Pairs of placements and ranks of the items that they may touch, sorted; the plan records how they were found."""
    candidates, plan = context.candidates, context.plan
    row, rank = candidates.meeting(boxes)
    placement = which[row]
    made = row.nbytes + rank.nbytes + placement.nbytes
    if index := candidates.index:
        plan.run("broad phase", f"{index.structure}: {index.followed} boxes placed anew", made)
        made = 0
    if candidates.prefilter.volume:
        plan.run("pre-filter", candidates.why, made)
        near, met = candidates.near(placements, placement, rank), len(rank)
        placement, rank = placement[near], rank[near]
        plan.run("volumes", candidates.prefilter.name, near.nbytes + placement.nbytes + rank.nbytes, (len(rank), met))
        made = 0
    plan.run("pre-filter", candidates.why, made, (len(rank), len(which) * len(context.stack)))
    return placement, rank


def _kinds(rank: Ints, shot: Ints, shots: Shots, context: QueryContext) -> Kinds:
    """What items do to samples of shots; filters and occluders are looked up only if there are any."""
    stack, plan, refuses = context.stack, context.plan, None
    if may_refuse(stack, shots):
        refuses = refused(stack, rank, shots, shot)
        plan.run("filter", "categories and owners", refuses.nbytes, (int((~refuses).sum()), len(rank)))
    kind = kinds(stack, rank, refuses)
    if stack.has_occluders:
        plan.run("occluders", "looked up of what is met", kind.nbytes)
    return kind


def _walked(
    placements: Placements, shots: Shots, runs: Runs, pairs: Pairs, context: QueryContext, counts: Ints
) -> list[Events]:
    """Walk runs strip by strip, and add to the counts."""
    found, plan = [], context.plan
    for strip in pieces(runs.lengths, CHUNK_SAMPLES) if len(runs) else ():
        part = runs.take(strip)
        near = slice(*np.searchsorted(pairs.placement, [part.placement[0], part.placement[-1] + 1]).tolist())
        here = Pairs(pairs.placement[near], pairs.rank[near], pairs.kind[near])
        shelter = None
        if context.blockers is not None:
            shelter = late.shelter.sheltered(part, placements, shots, context.stack, context.blockers)
            plan.run("line of sight", "what lies on the way to each sample", shelter.nbytes)
        events, state = walk(part, here, context.stack, context.pierce, HIT, shelter)
        found.append(Events(events.kind, events.rank, events.run + strip.start, events.x_first, events.x_last))
        plan.run("walk", "samples through the stack, front to back", state.nbytes + events.nbytes)
        met = state != LIVE
        _count(counts, np.repeat(part.placement, part.lengths)[met], state[met], None)
        plan.run("verdicts", "")
    return found


def _count(counts: Ints, placement: Ints, state: Ints, samples: Ints | None) -> None:
    """Move samples from EMPTY to the verdicts of their states."""
    column = placement * len(OF_PATTERNS) + VERDICT_OF[state]
    added = np.bincount(column, samples, counts.size).astype(np.int64).reshape(counts.shape)
    counts += added
    counts[:, Verdict.EMPTY] -= added.sum(axis=1)


def inside(placements: Placements, boxes: Ints, context: QueryContext) -> Ints:
    """Counts (P, 5) before the walk: samples inside the bounds are EMPTY, the others OUTSIDE."""
    counts = np.zeros((len(boxes), len(OF_PATTERNS)), np.int64)
    counts[:, Verdict.EMPTY] = placements.count
    context.plan.run("verdicts", "counted for each placement", counts.nbytes)
    if context.bounds is None:
        return counts
    x, y, x_max, y_max = bounds = context.bounds
    over = np.flatnonzero((boxes[:, :2] < (x, y)).any(axis=1) | (boxes[:, 2:] > (x_max, y_max)).any(axis=1))
    if not len(over):
        context.plan.run("outside", "no placement reaches over the bounds")
        return counts
    runs = _laid(placements, over, np.broadcast_to(np.array(bounds), (len(over), 4)))
    inside = np.bincount(runs.placement, runs.lengths, len(boxes)).astype(np.int64)[over]
    counts[over, Verdict.OUTSIDE] = counts[over, Verdict.EMPTY] - inside
    counts[over, Verdict.EMPTY] = inside
    context.plan.run("outside", "some placements reach over the bounds", runs.nbytes)
    return counts


def _laid(placements: Placements, which: Ints, boxes: Ints) -> Runs:
    """Runs of some of the placements, each clipped to a box."""
    x, y = placements.xy[which].T
    runs = placements.table.laid(placements.pattern[which], x, y, boxes)
    return Runs(which[runs.placement], runs.y, runs.x_first, runs.x_last, runs.ordinal)


def _met(placements: Placements, runs: Runs, events: list[Events], counts: Ints, plan: Plan) -> SpanHits:
    hit = Events.joined(events)
    under = runs.take(hit.run)
    joined = hit.nbytes if len(events) > 1 else 0  # of one part nothing is copied
    plan.run("rows", "hit pixels, gathered by object", joined + under.nbytes)
    weight = placements.table.weight(under.ordinal, hit.x_first, hit.x_last)
    if placements.table.prefix is not None:
        plan.run("weights", "falloff of the hit pixels, by prefix sums", weight.nbytes)
    return SpanHits(under.placement, hit.rank, under.y, hit.x_first, hit.x_last, weight, counts)
