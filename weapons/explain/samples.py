"""Explanations of shots of area weapons: samples, shares, blockers, and why not."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hitplanes.planes.bits.span_walk import BLOCK, HIT, SHELTERED, SKIP, VERDICT_OF, Events, Runs, Verdict, ends, walk
from hitplanes.planes.common.checks import Bools, InputError, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, DETAIL_SAMPLES_MAX, NEAR_PX
from hitplanes.planes.grid.spans import Box, Spans, clipped, each_pixel, pieces
from hitplanes.planes.scene.items import Stack

from ..fire.prefilter import QueryContext, pairs_of, refused
from ..fire.shelter import hidden_from, shelter_ranks, sheltered
from ..kinds.areas import parts_of
from ..kinds.placements import Placements, Shots, placements_for
from ..kinds.weapon import Weapon


class Samples(NamedTuple):
    """Every sample of a shot, ordered by (round, pellet, y, x).

    `item` is the object that was hit first, the first item on the way that shelters the sample, the occluder that ended
    the walk, or the first item that was skipped; -1 where there is none. `sheltered` says whether it was an item on
    the way from the pellet's pixel.
    """

    xy: Ints
    round: Ints
    pellet: Ints
    verdict: Ints
    item: Ints
    sheltered: Bools


class Share(NamedTuple):
    """Fraction of the round's samples that hit, and fractions of the object's visible and of all its pixels.

    `exposed` is the fraction of its visible pixels that are in the line of sight of a pellet of the round, also beyond
    the pattern; None if the weapon needs no line of sight.
    """

    of_pattern: float
    of_visible: float
    of_mask: float
    exposed: float | None = None


class Behind(NamedTuple):
    """An object behind a blocker: number of its samples that the blocker ended, and the one nearest their mean."""

    object: int
    samples: int
    at_xy: tuple[int, int]


class Blocked(NamedTuple):
    """An occluder, the samples that it ended or sheltered, and the accepted objects behind it on those samples.

    With `line_of_sight="all"` it may be an object.
    """

    occluder: int
    samples: int
    behind: tuple[Behind, ...]


REASONS = ("missed", "category", "excluded", "behind", "outside", "inside", "tunnelled", "budget")


class WhyNot(NamedTuple):
    """Why an object near the shot was not hit.

    `samples` counts the samples on the object, `by` those that each item ended, as {id: samples}, and `distance` is the
    distance from the pattern, px, 0 if a sample lies on the object. Else only its pixels within the bounds count, if it
    has any. `reason` is one of:

    - "missed": no sample lies on it
    - "category", "excluded": the filter refuses it
    - "behind": every sample on it ended in front of it
    - "outside": it lies out of bounds, or all samples on it do
    - "inside": the ray starts in it and ignores that
    - "tunnelled": a projectile went through it between two tests
    - "budget": the ray had a budget of 0
    """

    object: int
    reason: str
    samples: int
    by: dict[int, int]
    distance: float


@dataclass(frozen=True, eq=False)
class Detail:
    """Samples of one walk of shots."""

    stack: Stack
    shots: Shots
    placements: Placements
    runs: Runs  # runs of pixels
    run: Ints  # of each sample
    x: Ints  # column of each sample
    hit: Events  # runs that hit an object; all of them if the weapon pierces
    verdict: Ints  # of each sample
    rank: Ints  # of the item that decided a sample's verdict, -1 for none
    ended: Ints  # rank of the item that ended the walk of each sample, -1 for none
    sheltered: Bools  # whether an item on the way to a sample decided
    bounds: Box | None  # of the scene

    def on(self, rank: int) -> Ints:
        """Samples that lie on an item of the stack."""
        x0, y0, x1, y1 = self.stack.box_xyxy[rank].tolist()
        runs = self.runs
        first, last = np.maximum(runs.x_first, x0), np.minimum(runs.x_last, x1)
        meets = np.flatnonzero((first <= last) & (runs.y >= y0) & (runs.y <= y1))
        piece, x = each_pixel(first[meets], last[meets])
        run = meets[piece]
        return np.asarray((self.runs.start[run] + x)[self.stack.mask(rank)[runs.y[run] - y0, x - x0]])


def samples_of(detail: Detail) -> Samples:
    """All samples of one shot."""
    placements = detail.placements
    placement = detail.runs.placement[detail.run]
    ids = np.append(detail.stack.ids, -1)
    xy = np.stack([detail.x, detail.runs.y[detail.run]], axis=1)
    return Samples(
        xy, placements.round[placement], placements.pellet[placement], detail.verdict, ids[detail.rank],
        detail.sheltered,
    )  # fmt: skip


def hit_spans(detail: Detail) -> dict[tuple[int, int], Spans]:
    """Distinct pixels that each round hit of each object, as {(round, object): pixels}."""
    under = detail.runs.take(detail.hit.run)
    found: dict[tuple[int, int], Spans] = {}
    keys = np.stack([detail.placements.round[under.placement], detail.stack.ids[detail.hit.rank]], axis=1)
    order = np.lexsort(keys.T[::-1])
    begins = np.flatnonzero((np.diff(keys[order], axis=0, prepend=-1) != 0).any(axis=1)).tolist()
    for first, last in pairwise([*begins, len(order)]):
        own = order[first:last]
        round_, item = keys[own[0]].tolist()
        found[round_, item] = Spans.from_runs(under.y[own], detail.hit.x_first[own], detail.hit.x_last[own])
    return found


def object_spans(context: QueryContext, weapon: Weapon, shots: Shots) -> Iterator[tuple[int, Spans]]:
    """Pixels that shots hit, as (object, pixels); many shots are walked at a time."""
    placements = placements_for(weapon, shots)
    each = np.bincount(placements.shot, placements.count, len(shots)).astype(np.int64)
    for part in pieces(each, CHUNK_SAMPLES):
        detail = detail_of(context, weapon, shots.take(part.start, part.stop))
        yield from ((item, spans) for (_, item), spans in hit_spans(detail).items())


def united(parts: Iterable[tuple[int, Spans]]) -> dict[int, Spans]:
    """Union of the pixels of each object, by rising id."""
    found: dict[int, list[Spans]] = {}
    for item, spans in parts:
        found.setdefault(item, []).append(spans)
    return {
        item: Spans.from_runs(*np.concatenate([spans.runs() for spans in own]).T) for item, own in sorted(found.items())
    }


def blockers_of(detail: Detail) -> list[Blocked]:
    """Items that ended or sheltered samples, by falling number of samples, then by id, with the objects behind them."""
    stack, ended = detail.stack, detail.ended
    blocked = np.where((ended >= 0) & (detail.sheltered | stack.occluder[ended]), ended, -1) if len(stack) else ended
    ranks, counts = np.unique(blocked[blocked >= 0], return_counts=True)
    if not len(ranks):
        return []
    behind: dict[int, list[Behind]] = {rank: [] for rank in ranks.tolist()}
    every = np.unique(pairs_of(detail.placements.boxes, detail.placements.shot, detail.shots, stack).rank)
    refuses = refused(stack, every, detail.shots, np.zeros(len(every), np.int64))
    for rank in every[~refuses & ~stack.occluder[every]].tolist():
        on = detail.on(rank)
        on = on[(blocked[on] >= 0) & (detail.sheltered[on] & (blocked[on] != rank) | (blocked[on] < rank))]
        for front in np.unique(blocked[on]).tolist():
            behind[front].append(_behind(detail, rank, on[blocked[on] == front]))
    found = [
        Blocked(int(stack.ids[rank]), count, tuple(sorted(behind[rank], key=lambda b: (-b.samples, b.object))))
        for rank, count in zip(ranks.tolist(), counts.tolist(), strict=True)
    ]
    return sorted(found, key=lambda b: (-b.samples, b.occluder))


def _behind(detail: Detail, rank: int, samples: Ints) -> Behind:
    x, y = detail.x[samples], detail.runs.y[detail.run[samples]]
    dx, dy = (v - v.min() - int((v - v.min()).sum()) // len(v) for v in (x, y))  # relative to the pixel of their mean
    nearest = int(np.lexsort((x, y, dx**2 + dy**2))[0])
    return Behind(int(detail.stack.ids[rank]), len(samples), (int(x[nearest]), int(y[nearest])))


def shares_of(context: QueryContext, weapon: Weapon, shots: Shots, rows: Sequence[Any]) -> list[Share]:
    """Share of each row; the visible pixels of an object are counted once for each filter."""
    stack = context.stack
    visible: dict[tuple[object, ...], tuple[Bools, int, int]] = {}
    shares = []
    placed: dict[int, Placements] = {}
    for row in rows:
        shot = shots.take(row.shot, row.shot + 1)
        rank = int(stack.ranks(np.array(row.object)))
        key = (rank, int(shots.meets[row.shot]), *shots.exclude[row.shot].tolist())
        if key not in visible:
            mask = _visible(context, rank, shot)
            visible[key] = mask, int(np.count_nonzero(mask)), int(np.count_nonzero(stack.mask(rank)))
        if row.shot not in placed:
            placed[row.shot] = placements_for(weapon, shot)
        placements, (mask, seen, area) = placed[row.shot], visible[key]
        own, exposed = placements.round == row.round, None
        if parts_of(weapon)[2].line_of_sight:
            exposed = _exposed(mask, rank, placements.xy[own], shot, context) / seen
        fired = int(placements.count[own].sum())
        shares.append(Share(row.samples / fired, row.pixels / seen, row.pixels / area, exposed))
    return shares


def _exposed(visible: Bools, rank: int, origin_xy: Ints, shot: Shots, context: QueryContext) -> int:
    """Number of visible pixels of an object that lie in the line of sight of any pellet (P, 2) of one shot.

    A pellet is only asked about what is hidden from all pellets before it.
    """
    x, y = context.stack.box_xyxy[rank, :2].tolist()
    spans = Spans.from_mask(visible, (x, y))
    none = np.zeros_like(spans.y)
    hidden, blockers = Runs(none, spans.y, spans.x_first, spans.x_last, none), context.blockers
    if blockers is None:
        return spans.count
    for origin in np.unique(origin_xy, axis=0):
        hidden = hidden_from(origin, hidden, rank, shot, context.stack, blockers)
    return spans.count - int(hidden.lengths.sum())


def why_not_of(detail: Detail, hit: Set[int]) -> list[WhyNot]:
    """Objects within NEAR_PX of the pattern of one shot that were not hit, nearest first, then by id."""
    stack, placements = detail.stack, detail.placements
    boxes = placements.boxes + np.array([-NEAR_PX, -NEAR_PX, NEAR_PX, NEAR_PX])
    near = np.unique(pairs_of(boxes, placements.shot, detail.shots, stack).rank)
    near = near[~stack.occluder[near] & ~np.isin(stack.ids[near], list(hit))]
    found = [_why(detail, rank) for rank in near.tolist()]
    return sorted((why for why in found if why.distance <= NEAR_PX), key=lambda w: (w.distance, w.object))


def detail_of(context: QueryContext, weapon: Weapon, shots: Shots) -> Detail:
    """Walk every sample of shots and record its verdict and the items that decided it."""
    stack, bounds, blockers = context.stack, context.bounds, context.blockers
    placements = placements_for(weapon, shots)
    if (got := int(placements.count.sum())) > DETAIL_SAMPLES_MAX:
        raise InputError(f"samples: expected a shot of at most {DETAIL_SAMPLES_MAX} to tell one by one, got {got}")
    runs = placements.table.laid(placements.pattern, placements.xy[:, 0], placements.xy[:, 1], placements.boxes)
    run, x = each_pixel(runs.x_first, runs.x_last)
    pairs = pairs_of(placements.boxes, placements.shot, shots, stack)
    shelter = None if blockers is None else sheltered(runs, placements, shots, stack, blockers)
    events, state = walk(runs, pairs, stack, context.pierce, HIT | BLOCK | SKIP | SHELTERED, shelter)
    rank = np.full(len(x), -1, np.int64)
    start = runs.start
    ended = rank.copy()
    for kind in (SKIP, BLOCK, HIT):  # the first of a kind counts; a hit outranks a block, a block a skip
        latest = events.take(np.flatnonzero(events.kind == kind)[::-1])
        event, column = each_pixel(latest.x_first, latest.x_last)
        sample = start[latest.run][event] + column
        rank[sample] = latest.rank[event]
        if ends(latest.kind, context.pierce).all():
            ended[sample] = latest.rank[event]
    verdict, y = VERDICT_OF[state], runs.y[run]
    hidden = (state & SHELTERED != 0) & (verdict != Verdict.HIT)
    if blockers is not None and shelter is not None and hidden.any():
        own = _refused_first(events, start, len(x))
        ranks = shelter_ranks(runs, placements, shots, stack, blockers, shelter, own)
        rank[hidden] = ended[hidden] = ranks[hidden]
    if bounds is not None:
        outside = (x < bounds[0]) | (y < bounds[1]) | (x > bounds[2]) | (y > bounds[3])
        verdict = np.where(outside, Verdict.OUTSIDE, verdict)
        rank[outside] = ended[outside] = -1
        hidden &= ~outside
    hit = _inside(events.take(np.flatnonzero(events.kind == HIT)), runs, bounds)
    return Detail(stack, shots, placements, runs, run, x, hit, verdict, rank, ended, hidden, bounds)


def _refused_first(events: Events, start: Ints, samples: int) -> Ints:
    """Rank of the first object that each sample would have hit, had nothing sheltered it; -1 for none."""
    own = np.full(samples, -1)
    hidden = events.take(np.flatnonzero(events.kind == SHELTERED)[::-1])
    event, x = each_pixel(hidden.x_first, hidden.x_last)
    own[start[hidden.run][event] + x] = hidden.rank[event]
    return own


def _inside(events: Events, runs: Runs, bounds: Box | None) -> Events:
    """Events cut to the bounds."""
    if bounds is None:
        return events
    y = runs.y[events.run]
    first, last = np.maximum(events.x_first, bounds[0]), np.minimum(events.x_last, bounds[2])
    kept = (first <= last) & (y >= bounds[1]) & (y <= bounds[3])
    return Events(events.kind, events.rank, events.run, first, last).take(np.flatnonzero(kept))


def _why(detail: Detail, rank: int) -> WhyNot:
    stack, on = detail.stack, detail.on(rank)
    inside = pixels_in(stack, rank, detail.bounds)
    pixels = inside if len(inside) else pixels_in(stack, rank, None)
    distance = 0.0 if len(on) else math.sqrt(_distance2(detail.runs, pixels))
    ended = detail.ended[on]
    ranks, counts = np.unique(ended[ended >= 0], return_counts=True)
    by = dict(zip(stack.ids[ranks].tolist(), counts.tolist(), strict=True))
    outside = (detail.verdict[on] == Verdict.OUTSIDE).all()
    reason = unmet(stack, detail.shots, rank, len(on), not len(inside)) or ("outside" if outside else "behind")
    return WhyNot(int(stack.ids[rank]), reason, len(on), by, distance)


def unmet(stack: Stack, shot: Shots, rank: int, samples: int, out_of_bounds: bool) -> str | None:
    """Reason why an item was not hit that does not depend on what lies before it, as in `WhyNot`."""
    if refused(stack, np.array([rank]), shot, np.zeros(1, np.int64))[0]:
        return "excluded" if int(stack.categories[rank]) & int(shot.meets[0]) else "category"
    return "outside" if out_of_bounds else None if samples else "missed"


def _distance2(runs: Runs, spans: Spans) -> int:
    """Least squared distance between the pixels of a pattern and those of an item, px^2; not exact beyond NEAR_PX."""
    x, y, x_max, y_max = spans.box_xyxy or (0, 0, -1, -1)
    near = (runs.y >= y - NEAR_PX) & (runs.y <= y_max + NEAR_PX)
    near &= (runs.x_last >= x - NEAR_PX) & (runs.x_first <= x_max + NEAR_PX)
    runs = runs.take(near)
    least = (2 * NEAR_PX) ** 2
    step = max(1, CHUNK_SAMPLES // len(spans))
    for first in range(0, len(runs), step):
        part = runs.take(slice(first, first + step))
        gap = np.maximum(part.x_first[:, None] - spans.x_last, spans.x_first - part.x_last[:, None])
        apart = np.maximum(gap, 0) ** 2 + (part.y[:, None] - spans.y) ** 2
        least = min(least, int(apart.min()))
    return least


def _visible(context: QueryContext, rank: int, shot: Shots) -> Bools:
    """Mask of an object with the pixels that a pattern covering everything would hit, without a line of sight."""
    stack, box, seen = context.stack, context.stack.box_xyxy[rank], context.stack.mask(rank).copy()
    near = pairs_of(box[None], np.zeros(1, np.int64), shot, stack)
    front = near.rank[(near.rank < rank) & ends(near.kind, context.pierce)]
    for other, shared in zip(front.tolist(), clipped(stack.box_xyxy[front], box), strict=True):
        seen[_part(shared, box)] &= ~stack.mask(other)[_part(shared, stack.box_xyxy[other])]
    if context.bounds is not None:
        outside = np.ones_like(seen)
        outside[_part(clipped(box[None], context.bounds)[0], box)] = False
        seen[outside] = False
    return seen


def _part(part_xyxy: Ints, box_xyxy: Ints) -> tuple[slice, slice]:
    """Rows and columns of a part of a box, in its mask; none if the part is empty."""
    (x, y), (x_end, y_end) = part_xyxy[:2] - box_xyxy[:2], part_xyxy[2:] + 1 - box_xyxy[:2]
    return slice(y, max(y, y_end)), slice(x, max(x, x_end))


def pixels_in(stack: Stack, rank: int, bounds: Box | None) -> Spans:
    """Pixels of an item of the stack that lie within the bounds."""
    own = stack.box_xyxy[rank]
    part = own if bounds is None else clipped(own[None], bounds)[0]
    (x, y), rows_and_columns = part[:2].tolist(), _part(part, own)
    return Spans.from_mask(stack.mask(rank)[rows_and_columns], (x, y))
