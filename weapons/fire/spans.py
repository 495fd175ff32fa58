"""The reference of areas: spans of placed patterns walk the stack, front to back, and are added up to rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hitplanes.planes.bits.span_walk import (
    HIT,
    LIVE,
    OF_PATTERNS,
    SHELTERED,
    VERDICT_OF,
    Events,
    Kinds,
    Pairs,
    Runs,
    Verdict,
    walk,
)
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import CHUNK_PAIRS, CHUNK_SAMPLES
from hitplanes.planes.grid.spans import area, begins, clipped, merged_runs, pieces, row_order, sorted_once
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.areas import parts_of
from ..kinds.placements import Placements, Shots, placements_for
from ..kinds.weapon import Weapon
from .areas import Request, refuse_starts
from .hits import Rows
from .plan import Plan
from .prefilter import Candidates, QueryContext, kinds, may_refuse, near_pairs, refused

SPARSE = 4
"""If items fill less than 1 / SPARSE of the box around them, spans are cut to each item's box, not to that one."""


# house: way of areas
def by_spans(request: Request) -> list[Rows]:
    """Rows by the reference: spans of placed patterns walk the stack."""
    shots, plan, rows = request.shots, request.plan, []
    first = placements_for(request.weapon, shots.take(0, 1))
    for begin, part in chunks(shots, first, request.candidates):
        placements = first if len(shots) == 1 else placements_for(request.weapon, part)
        plan.run("patterns", f"different patterns: {len(placements.table)}", placements.nbytes)
        if placements.table.prefix is not None:
            plan.run("weights", "falloff of the hit pixels, by prefix sums", placements.table.prefix.nbytes)
        refuse_starts(request, part, placements)
        rows.append(rows_of_span_hits(direct(placements, part, request), placements, request.stack.ids, begin))
        plan.run("rows", "", rows[-1].nbytes)
    return rows


def chunks(shots: Shots, first: Placements, candidates: Candidates) -> Iterator[tuple[int, Shots]]:
    """Cut a batch into parts that stay within CHUNK_SAMPLES and CHUNK_PAIRS; patterns are as large as the first shot's.

    With a broad phase, parts grow as long as placements meet few items.
    """
    placements = max(len(first.shot), 1)
    most = max(1, CHUNK_SAMPLES // max(int(first.count.sum()), placements))
    step = max(1, min(most, CHUNK_PAIRS // (placements * max(len(candidates.stack), 1))))
    begin = 0
    while begin < len(shots):
        yield begin, shots.take(begin, min(begin + step, len(shots)))
        begin += step
        if candidates.index is not None:
            step = max(1, min(2 * step, most, CHUNK_PAIRS * begin // max(candidates.met, 1)))


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


def direct(placements: Placements, shots: Shots, context: QueryContext, counted: bool = False) -> SpanHits:
    """Walk the stack under every placement, but only where an item may be.

    If the counts are asked for, samples on no item that lie sheltered are looked at, too; else they count as empty.
    """
    boxes = placements.boxes
    counts = inside(placements, boxes, context)
    if not len(context.stack):
        return _met(placements, Runs.joined([]), [], counts, context.plan)
    placement, rank = near_pairs(placements, np.arange(len(boxes)), boxes, context)
    pairs = Pairs(placement, rank, _kinds(rank, placements.shot[placement], shots, context))
    runs = _under_items(placements, pairs, context)
    context.plan.run("samples", "runs where items may be", runs.nbytes)
    if counted and context.blockers is not None:
        every = boxes if context.bounds is None else clipped(boxes, context.bounds)
        laid = _laid(placements, np.arange(len(boxes)), every)
        _shelter(counts, late.shelter.sheltered_pixels(laid, placements, shots, context.stack, context.blockers))
    walked = _walked(placements, shots, runs, pairs, context, counts, counted)
    return _met(placements, runs, walked, counts, context.plan)


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
    placements: Placements, shots: Shots, runs: Runs, pairs: Pairs, context: QueryContext, counts: Ints, counted: bool
) -> list[Events]:
    """Walk runs strip by strip, and add to the counts; if `counted`, sheltered samples stand in them already."""
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
        if counted and shelter is not None:
            hidden = np.repeat(part.placement, part.lengths)[(state & SHELTERED) != 0]
            _shelter(counts, -np.bincount(hidden, minlength=len(counts)))
        plan.run("verdicts", "")
    return found


def _shelter(counts: Ints, samples: Ints) -> None:
    """Move sheltered samples (P,) from EMPTY to OCCLUDED."""
    counts[:, Verdict.OCCLUDED] += samples
    counts[:, Verdict.EMPTY] -= samples


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


def rows_of_span_hits(met: SpanHits, placements: Placements, ids: Ints, first_shot: int) -> Rows:
    """Add runs of hit pixels up to rows; a pixel hit by several pellets counts once in `pixels`."""
    rounds = int(placements.round.max(initial=0)) + 1
    shot, round_ = placements.shot[met.placement], placements.round[met.placement]
    group = (shot * rounds + round_) * max(len(ids), 1) + met.rank
    origin = placements.origin_xy[met.placement]
    x = np.clip(origin[:, 0], met.x_first, met.x_last)  # the pixel of a run that is nearest to the origin
    distance2 = (x - origin[:, 0]) ** 2 + (met.y - origin[:, 1]) ** 2
    order = row_order(group, distance2, met.y, x)
    group, distance2 = group[order], distance2[order]
    new = begins(group)
    first = np.flatnonzero(new)
    best = order[first]
    lengths = (met.x_last - met.x_first + 1)[order]
    samples = np.add.reduceat(lengths, first) if len(first) else lengths
    weight = np.add.reduceat(met.weight[order], first) if len(first) else lengths
    pellets, pixels = np.ones_like(samples), samples
    if int(placements.pellet.max(initial=0)):
        pellets, pixels = _distinct(met, np.cumsum(new) - 1, order, len(first))
    sort = row_order(shot[best], round_[best], distance2[first], met.y[best], x[best], met.rank[best])
    best = best[sort]
    return Rows(
        shot[best] + first_shot, round_[best], ids[met.rank[best]], samples[sort], pixels[sort], weight[sort],
        pellets[sort], np.stack([x[best], met.y[best]], axis=1), distance2[first][sort],
    )  # fmt: skip


def _distinct(met: SpanHits, group: Ints, order: Ints, groups: int) -> tuple[Ints, Ints]:
    """Pellets that hit, and pixels counted once, of each group."""
    of = int(met.placement.max(initial=0)) + 1
    pellets = np.bincount(sorted_once(group * of + met.placement[order]) // of, minlength=groups)
    y = met.y[order] - met.y.min(initial=0)
    rows = int(y.max(initial=0)) + 1
    which, x_first, x_last = merged_runs(group * rows + y, met.x_first[order], met.x_last[order])
    pixels = np.bincount(group[which], x_last - x_first + 1, groups).astype(np.int64)
    return pellets, pixels
