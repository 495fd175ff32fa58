"""Samples of shots by verdict, counted when they are asked for, by the ways that answer shots.

1. Hit: the samples in the rows of the call, or in those of the same shots without pierce.
2. Occluded: the same for the occluders that samples meet first.
3. Filtered, if a shot refuses items: what a shot that accepts all meets besides.
4. Outside the bounds: by the pixels of the patterns. The rest is empty.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hitplanes.planes.bits.bit_rows import pixels_within
from hitplanes.planes.bits.front_to_back import NO_FLAGS
from hitplanes.planes.bits.span_walk import OF_PATTERNS, Verdict
from hitplanes.planes.common.checks import Ints

from ..kinds.placements import Placements, placements_for
from .areas import PLACEMENTS_AT_ONCE, Request, by_tiles, parts_of_batch, placed_of
from .hits import Rows
from .plan import Plan
from .prefilter import Candidates
from .spans import chunks, direct
from .strategy import chosen_way


def verdicts_of(request: Request, rows: Rows, way: str) -> Ints:
    """Samples (N, 5) of shots by verdict; the stack is the one that they were fired at.

    Parameters
    ----------
    rows, way : what the shots hit, and the way that found it

    The tiles of a stack that the scene has left behind are gone, unless items only moved; then the reference counts.
    """
    stack, items = request.stack, request.scene.items
    gone = items.stack().arrangement != stack.arrangement
    first = replace(request, candidates=Candidates(items, stack), filtered=False, plan=Plan())  # not that of the call
    if way == "spans" or gone or request.blockers is not None or not request.traits.fits:
        return _by_spans(first)
    fired, inside, first.placed = _fired_and_inside(first)
    first.pierce, first.view = False, first.view and first.view._replace(pierce=False)
    hit = _samples(_rows(first) if request.pierce else rows, len(fired))
    occluded = np.zeros_like(hit)
    if stack.has_occluders:
        first.view, first.covers = first.view and first.view._replace(of_occluders=True), ~stack.occluder
        occluded = _samples(_rows(first), len(fired))
    met = hit + occluded
    if request.choosy:
        first.choosy, first.covers = False, NO_FLAGS
        met = _samples(Rows.joined(by_tiles(first)), len(fired))
    counts = np.empty((len(fired), len(OF_PATTERNS)), np.int64)
    for verdict, samples in (
        (Verdict.EMPTY, inside - met), (Verdict.OUTSIDE, fired - inside), (Verdict.FILTERED, met - hit - occluded),
        (Verdict.OCCLUDED, occluded), (Verdict.HIT, hit),
    ):  # fmt: skip
        counts[:, verdict] = samples
    return counts


def _samples(rows: Rows, shots: int) -> Ints:
    """Samples (N,) of each shot in rows."""
    return np.bincount(rows.shot, rows.samples, shots).astype(np.int64)


def _rows(request: Request) -> Rows:
    """Rows by the cheapest way; what is derived from a scene serves no stack that the scene has left behind."""
    if request.scene.items.stack() is not request.stack:
        return Rows.joined(by_tiles(request))
    return Rows.joined(chosen_way("auto", request)[0].engine(request))


def _fired_and_inside(request: Request) -> tuple[Ints, Ints, Placements | None]:
    """Samples (N,) of shots, those within the bounds, and the placements, unless they are many."""
    bounds, each = request.bounds, request.traits.placements
    fired, within = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    placements = None
    for _, _, placements in parts_of_batch(request, PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE):
        count, table = placements.count, placements.table
        inside = count
        if bounds is not None:
            inside = pixels_within(placed_of(placements), table.bits, table.count, bounds)
        fired.append(count if each == 1 else count.reshape(-1, each).sum(axis=1))
        within.append(inside if each == 1 else inside.reshape(-1, each).sum(axis=1))
    return np.concatenate(fired), np.concatenate(within), placements if len(fired) == 2 else None


def _by_spans(request: Request) -> Ints:
    """Samples (N, 5) of shots by verdict, by the reference."""
    weapon, shots = request.weapon, request.shots
    verdicts = [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for _, part in chunks(shots, placements_for(weapon, shots.take(0, 1)), request.candidates):
        counts = direct(placements_for(weapon, part), part, request, counted=True).counts
        verdicts.append(counts.reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1))
    return np.concatenate(verdicts)
