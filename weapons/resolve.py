"""Placed patterns to what they met: by walking the stack (direct), or by reading the code plane (composed)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planes.arrays import Ints
from planes.compose import Codes
from planes.constants import CHUNK_SAMPLES
from planes.items import Stack
from planes.sampling import BLOCK, HIT, LIVE, SKIP, VERDICT_OF, Events, Pairs, Runs, Verdict, read_codes, split, walk
from planes.spans import Box
from weapons.candidates import pairs_of, refused
from weapons.volley import Shots, Volley

__all__ = ["Met", "Sight", "composed", "direct"]


@dataclass(frozen=True, eq=False)
class Sight:
    """What a volley looks at: the stack, the bounds, and how."""

    stack: Stack
    bounds: Box | None
    pierce: bool
    prefilter: str


@dataclass(frozen=True, eq=False)
class Met:
    """Runs of pixels that hit an object, and the verdict counts of each placement.

    Parameters
    ----------
    owner, place, y, x_first, x_last, weight : (n,) int64; place of the object in the stack
    counts : (P, 5) samples by verdict
    """

    owner: Ints
    place: Ints
    y: Ints
    x_first: Ints
    x_last: Ints
    weight: Ints
    counts: Ints


def direct(volley: Volley, shots: Shots, sight: Sight) -> Met:
    """Walk the stack under every placement; only where an item may be is looked at all."""
    boxes = volley.boxes
    counts = _inside(volley, boxes, sight.bounds)
    pairs = pairs_of(boxes, volley.shot, shots, sight.stack, sight.prefilter)
    busy, first = np.unique(pairs.owner, return_index=True)
    if not len(busy):
        return _met(volley, Runs.joined([]), [], counts)
    items = sight.stack.box_xyxy[pairs.place]
    hull = np.concatenate(
        [np.minimum.reduceat(items[:, :2], first, axis=0), np.maximum.reduceat(items[:, 2:], first, axis=0)], axis=1
    )
    runs = _laid(volley, busy, _clipped(hull, sight.bounds))
    return _met(volley, runs, _walked(runs, pairs, sight, counts), counts)


def composed(volley: Volley, shots: Shots, sight: Sight, codes: Codes, plane_xyxy: Box) -> Met:
    """Read the front item under every sample; walk the stack only where a shot looks behind it."""
    counts = _inside(volley, volley.boxes, sight.bounds)
    every = np.arange(len(volley.shot))
    runs = _laid(volley, every, np.broadcast_to(np.array(plane_xyxy), (len(every), 4)))
    place_of = np.zeros(int(sight.stack.ids.max(initial=-1)) + 2, np.int64)
    place_of[sight.stack.ids + 1] = np.arange(len(sight.stack))
    events, behind = [], []
    for strip in split(runs.lengths, CHUNK_SAMPLES):
        part = runs.take(strip)
        run, x_first, x_last, code = read_codes(part, codes, plane_xyxy)
        some = code > 0
        run, x_first, x_last, code = run[some], x_first[some], x_last[some], code[some]
        place = place_of[code >> 1]
        skip = refused(sight.stack, place, shots, volley.shot[part.owner[run]])
        kind = np.where(skip, SKIP, np.where(sight.stack.occluder[place], BLOCK, HIT))
        more = (code & 1 == 1) & (skip | (sight.pierce & (kind == HIT)))
        _count(counts, part.owner[run[~more]], kind[~more], (x_last - x_first + 1)[~more])
        told = ~more & (kind == HIT)
        events.append(Events(kind[told], place[told], run[told] + strip.start, x_first[told], x_last[told]))
        seen = part.take(run[more])
        behind.append(Runs(seen.owner, seen.y, x_first[more], x_last[more], seen.ordinal))
    front = _met(volley, runs, events, counts)
    rest = Runs.joined(behind)
    return _joined(front, _look_behind(volley, rest, shots, sight, counts)) if len(rest) else front


def _look_behind(volley: Volley, runs: Runs, shots: Shots, sight: Sight, counts: Ints) -> Met:
    """Walk the stack under the samples that the code plane could not answer."""
    busy, first = np.unique(runs.owner, return_index=True)
    last = np.append(first[1:], len(runs)) - 1
    left, right = np.minimum.reduceat(runs.x_first, first), np.maximum.reduceat(runs.x_last, first)
    boxes = np.stack([left, runs.y[first], right, runs.y[last]], axis=1)
    near = pairs_of(boxes, volley.shot[busy], shots, sight.stack, sight.prefilter)
    pairs = Pairs(busy[near.owner], near.place, near.refused)
    return _met(volley, runs, _walked(runs, pairs, sight, counts), counts)


def _walked(runs: Runs, pairs: Pairs, sight: Sight, counts: Ints) -> list[Events]:
    """Walk runs strip by strip; add to the counts."""
    found = []
    for strip in split(runs.lengths, CHUNK_SAMPLES):
        part = runs.take(strip)
        near = slice(*np.searchsorted(pairs.owner, [part.owner[0], part.owner[-1] + 1]).tolist())
        events, state = walk(
            part, Pairs(pairs.owner[near], pairs.place[near], pairs.refused[near]), sight.stack, sight.pierce, HIT
        )
        found.append(Events(events.kind, events.place, events.run + strip.start, events.x_first, events.x_last))
        met = state != LIVE
        _count(counts, np.repeat(part.owner, part.lengths)[met], state[met], None)
    return found


def _count(counts: Ints, owner: Ints, state: Ints, samples: Ints | None) -> None:
    """Move samples from EMPTY to the verdicts of their states."""
    size = counts.size
    added = np.bincount(owner * len(Verdict) + VERDICT_OF[state], samples, size).astype(np.int64).reshape(counts.shape)
    counts += added
    counts[:, Verdict.EMPTY] -= added.sum(axis=1)


def _inside(volley: Volley, boxes: Ints, bounds: Box | None) -> Ints:
    """Counts (P, 5) before anything is met: all samples inside the bounds are EMPTY, the others OUTSIDE."""
    counts = np.zeros((len(boxes), len(Verdict)), np.int64)
    counts[:, Verdict.EMPTY] = volley.count
    if bounds is None:
        return counts
    x, y, x_max, y_max = bounds
    over = np.flatnonzero((boxes[:, :2] < (x, y)).any(axis=1) | (boxes[:, 2:] > (x_max, y_max)).any(axis=1))
    runs = _laid(volley, over, np.broadcast_to(np.array(bounds), (len(over), 4)))
    inside = np.bincount(runs.owner, runs.lengths, len(boxes)).astype(np.int64)[over]
    counts[over, Verdict.OUTSIDE] = counts[over, Verdict.EMPTY] - inside
    counts[over, Verdict.EMPTY] = inside
    return counts


def _laid(volley: Volley, placements: Ints, boxes: Ints) -> Runs:
    """Runs of some of the placements, clipped to boxes."""
    x, y = volley.xy[placements].T
    runs = volley.table.laid(volley.pattern[placements], x, y, boxes)
    return Runs(placements[runs.owner], runs.y, runs.x_first, runs.x_last, runs.ordinal)


def _clipped(boxes: Ints, bounds: Box | None) -> Ints:
    if bounds is None:
        return boxes
    return np.concatenate([np.maximum(boxes[:, :2], bounds[:2]), np.minimum(boxes[:, 2:], bounds[2:])], axis=1)


def _met(volley: Volley, runs: Runs, events: list[Events], counts: Ints) -> Met:
    hit = Events.joined(events)
    under = runs.take(hit.run)
    weight = volley.table.weight(under.ordinal, hit.x_first, hit.x_last)
    return Met(under.owner, hit.place, under.y, hit.x_first, hit.x_last, weight, counts)


def _joined(a: Met, b: Met) -> Met:
    names = ("owner", "place", "y", "x_first", "x_last", "weight")
    return Met(**{n: np.concatenate([getattr(a, n), getattr(b, n)]) for n in names}, counts=a.counts)
