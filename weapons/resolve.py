"""Placed patterns to what they met: by walking the stack (direct), or by reading the code plane (composed)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planes.arrays import Codes, Ints
from planes.compose import area
from planes.constants import CHUNK_SAMPLES
from planes.items import Stack, clipped
from planes.sampling import (
    HIT,
    LIVE,
    OF_PATTERNS,
    SKIP,
    VERDICT_OF,
    Events,
    Kinds,
    Pairs,
    Runs,
    Verdict,
    read_codes,
    walk,
)
from planes.spans import Box, merged_runs, pieces
from weapons.candidates import Candidates, kinds, may_refuse, refused
from weapons.plan import Plan
from weapons.volley import Shots, Volley

__all__ = ["Met", "Sight", "composed", "direct", "near_pairs"]

SPARSE = 4
"""Items that fill less than one part in so many of the box around them are laid under one by one."""


@dataclass(eq=False, slots=True)
class Sight:
    """What a volley looks at, how, and where what was done is recorded."""

    stack: Stack
    bounds: Box | None
    pierce: bool
    candidates: Candidates
    plan: Plan


@dataclass(frozen=True, eq=False)
class Met:
    """Runs of pixels that hit an object, and the verdict counts of each placement.

    Parameters
    ----------
    placement, rank, y, x_first, x_last, weight : (n,) int64; rank of the object in the stack
    counts : (P, 5) samples by verdict
    """

    placement: Ints
    rank: Ints
    y: Ints
    x_first: Ints
    x_last: Ints
    weight: Ints
    counts: Ints


def direct(volley: Volley, shots: Shots, sight: Sight) -> Met:
    """Walk the stack under every placement; only where an item may be is looked at all."""
    boxes = volley.boxes
    counts = _inside(volley, boxes, sight)
    if not len(sight.stack):
        return _met(volley, Runs.joined([]), [], counts, sight.plan)
    pairs = _candidates(volley, np.arange(len(boxes)), boxes, shots, sight)
    runs = _under_items(volley, pairs, sight)
    sight.plan.run("samples", "runs where items may be", runs.nbytes)
    return _met(volley, runs, _walked(runs, pairs, sight, counts), counts, sight.plan)


def composed(volley: Volley, shots: Shots, sight: Sight, codes: Codes, plane_xyxy: Box) -> Met:
    """Read the front item under every sample; walk the stack only where a shot looks behind it."""
    counts = _inside(volley, volley.boxes, sight)
    plan, stack = sight.plan, sight.stack
    every = np.arange(len(volley.shot))
    runs = _laid(volley, every, np.broadcast_to(np.array(plane_xyxy), (len(every), 4)))
    plan.run("samples", "runs inside the bounds", runs.nbytes)
    plan.run("read", "one code for each sample", stack.rank_by_code.nbytes)
    events, behind = [], []
    for strip in pieces(runs.lengths, CHUNK_SAMPLES) if len(runs) else ():
        part = runs.take(strip)
        run, x_first, x_last, code = read_codes(part, codes, plane_xyxy)
        rank = stack.rank_by_code[code >> 1]
        plan.run("read", "", int(part.lengths.sum()) * codes.itemsize + 5 * rank.nbytes)
        kind = _kinds(rank, volley.shot[part.placement[run]], shots, sight)
        more = (code & 1 == 1) & ((kind == SKIP) | (sight.pierce & (kind == HIT)))
        _count(counts, part.placement[run[~more]], kind[~more], (x_last - x_first + 1)[~more])
        plan.run("verdicts", "")
        told = ~more & (kind == HIT)
        events.append(Events(kind[told], rank[told], run[told] + strip.start, x_first[told], x_last[told]))
        seen = part.take(run[more])
        behind.append(Runs(seen.placement, seen.y, x_first[more], x_last[more], seen.ordinal))
        plan.run("read", "", events[-1].nbytes + behind[-1].nbytes)
    front = _met(volley, runs, events, counts, plan)
    rest = Runs.joined(behind)
    return _joined(front, _look_behind(volley, rest, shots, sight, counts)) if len(rest) else front


def _under_items(volley: Volley, pairs: Pairs, sight: Sight) -> Runs:
    """Runs of the placements where the items are that they are paired with."""
    busy, first = np.unique(pairs.placement, return_index=True)
    if not len(busy):
        return Runs.joined([])
    items = sight.stack.box_xyxy[pairs.rank]
    low = np.minimum.reduceat(items[:, :2], first, axis=0)
    hull = np.concatenate([low, np.maximum.reduceat(items[:, 2:], first, axis=0)], axis=1)
    if area(hull) <= SPARSE * area(items):
        return _laid(volley, busy, hull if sight.bounds is None else clipped(hull, sight.bounds))
    runs = _laid(volley, pairs.placement, items if sight.bounds is None else clipped(items, sight.bounds))
    y = runs.y - runs.y.min(initial=0)
    rows = int(y.max(initial=0)) + 1
    which, x_first, x_last = merged_runs(runs.placement * rows + y, runs.x_first, runs.x_last)
    runs = runs.take(which)
    return Runs(runs.placement, runs.y, x_first, x_last, runs.ordinal)


def _look_behind(volley: Volley, runs: Runs, shots: Shots, sight: Sight, counts: Ints) -> Met:
    """Walk the stack under the samples that the code plane could not answer."""
    busy, first = np.unique(runs.placement, return_index=True)
    last = np.append(first[1:], len(runs)) - 1
    left, right = np.minimum.reduceat(runs.x_first, first), np.maximum.reduceat(runs.x_last, first)
    boxes = np.stack([left, runs.y[first], right, runs.y[last]], axis=1)
    pairs = _candidates(volley, busy, boxes, shots, sight)
    return _met(volley, runs, _walked(runs, pairs, sight, counts), counts, sight.plan)


def _candidates(volley: Volley, placements: Ints, boxes: Ints, shots: Shots, sight: Sight) -> Pairs:
    """Items that placements may touch, and what they do to samples."""
    placement, rank = near_pairs(volley, placements, boxes, sight)
    return Pairs(placement, rank, _kinds(rank, volley.shot[placement], shots, sight))


def near_pairs(volley: Volley, placements: Ints, boxes: Ints, sight: Sight) -> tuple[Ints, Ints]:
    """Placements and ranks of the items that they may touch, sorted, and the record of how they were found."""
    candidates, plan = sight.candidates, sight.plan
    row, rank = candidates.meeting(boxes)
    placement = placements[row]
    made = row.nbytes + rank.nbytes + placement.nbytes
    if index := candidates.index:
        plan.run("broad phase", f"{index.structure}: {index.followed} boxes placed anew", made)
        made = 0
    if candidates.prefilter.volume:
        plan.run("pre-filter", candidates.why, made)
        near, met = candidates.near(volley, placement, rank), len(rank)
        placement, rank = placement[near], rank[near]
        plan.run("volumes", str(candidates.prefilter), near.nbytes + placement.nbytes + rank.nbytes, (len(rank), met))
        made = 0
    plan.run("pre-filter", candidates.why, made, (len(rank), len(placements) * len(sight.stack)))
    return placement, rank


def _kinds(rank: Ints, shot: Ints, shots: Shots, sight: Sight) -> Kinds:
    """What items do to samples of shots: each of the two lookups only where it may tell something."""
    stack, plan, refuses = sight.stack, sight.plan, None
    if may_refuse(stack, shots):
        refuses = refused(stack, rank, shots, shot)
        plan.run("filter", "categories and owners", refuses.nbytes, (int((~refuses).sum()), len(rank)))
    kind = kinds(stack, rank, refuses)
    if stack.has_occluders:
        plan.run("occluders", "looked up of what is met", kind.nbytes)
    return kind


def _walked(runs: Runs, pairs: Pairs, sight: Sight, counts: Ints) -> list[Events]:
    """Walk runs strip by strip; add to the counts."""
    found, plan = [], sight.plan
    for strip in pieces(runs.lengths, CHUNK_SAMPLES) if len(runs) else ():
        part = runs.take(strip)
        near = slice(*np.searchsorted(pairs.placement, [part.placement[0], part.placement[-1] + 1]).tolist())
        here = Pairs(pairs.placement[near], pairs.rank[near], pairs.kind[near])
        events, state = walk(part, here, sight.stack, sight.pierce, HIT)
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


def _inside(volley: Volley, boxes: Ints, sight: Sight) -> Ints:
    """Counts (P, 5) before anything is met: all samples inside the bounds are EMPTY, the others OUTSIDE."""
    counts = np.zeros((len(boxes), len(OF_PATTERNS)), np.int64)
    counts[:, Verdict.EMPTY] = volley.count
    sight.plan.run("verdicts", "counted for each placement", counts.nbytes)
    if sight.bounds is None:
        return counts
    x, y, x_max, y_max = bounds = sight.bounds
    over = np.flatnonzero((boxes[:, :2] < (x, y)).any(axis=1) | (boxes[:, 2:] > (x_max, y_max)).any(axis=1))
    if not len(over):
        sight.plan.run("outside", "no placement reaches over the bounds")
        return counts
    runs = _laid(volley, over, np.broadcast_to(np.array(bounds), (len(over), 4)))
    inside = np.bincount(runs.placement, runs.lengths, len(boxes)).astype(np.int64)[over]
    counts[over, Verdict.OUTSIDE] = counts[over, Verdict.EMPTY] - inside
    counts[over, Verdict.EMPTY] = inside
    sight.plan.run("outside", "some placements reach over the bounds", runs.nbytes)
    return counts


def _laid(volley: Volley, placements: Ints, boxes: Ints) -> Runs:
    """Runs of some of the placements, each clipped to a box."""
    x, y = volley.xy[placements].T
    runs = volley.table.laid(volley.pattern[placements], x, y, boxes)
    return Runs(placements[runs.placement], runs.y, runs.x_first, runs.x_last, runs.ordinal)


def _met(volley: Volley, runs: Runs, events: list[Events], counts: Ints, plan: Plan) -> Met:
    hit = Events.joined(events)
    under = runs.take(hit.run)
    plan.run("rows", "hit pixels, gathered by object", hit.nbytes + under.nbytes)
    weight = volley.table.weight(under.ordinal, hit.x_first, hit.x_last)
    if volley.table.prefix is not None:
        plan.run("weights", "", weight.nbytes)
    return Met(under.placement, hit.rank, under.y, hit.x_first, hit.x_last, weight, counts)


def _joined(a: Met, b: Met) -> Met:
    """Met before and behind; both hold the same counts."""
    names = ("placement", "rank", "y", "x_first", "x_last", "weight")
    return Met(**{n: np.concatenate([getattr(a, n), getattr(b, n)]) for n in names}, counts=a.counts)
