"""What is derived from a shot when it is asked for: each sample, shares, blockers, why not."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from planes.arrays import InputError, Ints
from planes.constants import CHUNK_SAMPLES, DETAIL_SAMPLES_MAX, NEAR_PX
from planes.items import Stack
from planes.sampling import BLOCK, HIT, SKIP, VERDICT_OF, Events, Runs, Verdict, walk
from planes.scene import Scene
from planes.spans import Box, Spans, each_pixel
from weapons.arsenal import pierces
from weapons.candidates import pairs_of, refused
from weapons.volley import Shots, Volley, volley_of
from weapons.weapon import Weapon

__all__ = [
    "REASONS", "Behind", "Blocked", "Detail", "Samples", "Share", "WhyNot", "blockers_of", "detail_of", "hit_spans",
    "samples_of", "shares_of", "why_not_of",
]  # fmt: skip


class Samples(NamedTuple):
    """Every sample of a shot, ordered by (round, pellet, y, x).

    `item` is the object that was hit first, the occluder that ended the walk, or the first item that was skipped;
    -1 where there is none.
    """

    xy: Ints
    round: Ints
    pellet: Ints
    verdict: Ints
    item: Ints


class Share(NamedTuple):
    """What part of the pattern hit, and what part of the object was hit, as seen by this weapon and as a whole."""

    of_pattern: float
    of_visible: float
    of_mask: float


class Behind(NamedTuple):
    """An object behind an occluder: samples on it that the occluder ended, and the one nearest their mean."""

    object: int
    samples: int
    at_xy: tuple[int, int]


class Blocked(NamedTuple):
    """An occluder, the samples whose walk it ended, and the accepted objects behind it on those samples."""

    occluder: int
    samples: int
    behind: tuple[Behind, ...]


REASONS = ("missed", "category", "excluded", "behind", "outside", "inside", "tunnelled")


class WhyNot(NamedTuple):
    """Why an object near the shot was not hit.

    `reason` is "missed" (no sample on it), "category", "excluded", "behind" (every sample on it ended in front of
    it), "outside" (of the bounds), "inside" (of a ray that ignores what it starts in) or "tunnelled" (a projectile went
    through it between two tests); `samples` counts those on it;
    `by` tells what ended them, as {id: samples}; `distance` is that from the pattern, px, 0 where a sample is on it.
    """

    object: int
    reason: str
    samples: int
    by: dict[int, int]
    distance: float


@dataclass(frozen=True, eq=False)
class Detail:
    """Shots sample by sample, of one walk.

    Parameters
    ----------
    stack, shots, volley : what was walked, by whom, with what
    runs, run, x : runs of pixels; for each sample its run and its column
    hit : runs that hit an object, all of them where the weapon pierces
    verdict : of each sample
    rank, ended : what decided its verdict, and what ended its walk, as ranks in the stack, -1 for none
    """

    stack: Stack
    shots: Shots
    volley: Volley
    runs: Runs
    run: Ints
    x: Ints
    hit: Events
    verdict: Ints
    rank: Ints
    ended: Ints

    @cached_property
    def start(self) -> Ints:
        """Number of the sample at x = 0 of each run."""
        return np.asarray(np.cumsum(self.runs.lengths) - self.runs.lengths - self.runs.x_first)

    def on(self, rank: int) -> Ints:
        """Samples that lie on an item of the stack."""
        x0, y0, x1, y1 = self.stack.box_xyxy[rank].tolist()
        runs = self.runs
        first, last = np.maximum(runs.x_first, x0), np.minimum(runs.x_last, x1)
        meets = np.flatnonzero((first <= last) & (runs.y >= y0) & (runs.y <= y1))
        piece, x = each_pixel(first[meets], last[meets])
        run = meets[piece]
        return np.asarray((self.start[run] + x)[self.stack.mask(rank)[runs.y[run] - y0, x - x0]])


def samples_of(detail: Detail) -> Samples:
    """All samples of one shot."""
    volley = detail.volley
    placement = detail.runs.placement[detail.run]
    ids = np.append(detail.stack.ids, -1)
    xy = np.stack([detail.x, detail.runs.y[detail.run]], axis=1)
    return Samples(xy, volley.round[placement], volley.pellet[placement], detail.verdict, ids[detail.rank])


def hit_spans(detail: Detail) -> dict[tuple[int, int], Spans]:
    """Pixels that each round hit of each object, as {(round, object): pixels}, each pixel once."""
    under = detail.runs.take(detail.hit.run)
    found: dict[tuple[int, int], Spans] = {}
    keys = np.stack([detail.volley.round[under.placement], detail.stack.ids[detail.hit.rank]], axis=1)
    order = np.lexsort(keys.T[::-1])
    begins = np.flatnonzero((np.diff(keys[order], axis=0, prepend=-1) != 0).any(axis=1)).tolist()
    for first, last in pairwise([*begins, len(order)]):
        own = order[first:last]
        round_, item = keys[own[0]].tolist()
        found[round_, item] = Spans.from_runs(under.y[own], detail.hit.x_first[own], detail.hit.x_last[own])
    return found


def blockers_of(detail: Detail) -> list[Blocked]:
    """Occluders that ended samples, most first, then by id, with what they hid."""
    stack, ended = detail.stack, detail.ended
    blocked = np.where((ended >= 0) & stack.occluder[ended], ended, -1) if len(stack) else ended
    ranks, counts = np.unique(blocked[blocked >= 0], return_counts=True)
    if not len(ranks):
        return []
    behind: dict[int, list[Behind]] = {rank: [] for rank in ranks.tolist()}
    every = np.unique(pairs_of(detail.volley.boxes, detail.volley.shot, detail.shots, stack).rank)
    refuses = refused(stack, every, detail.shots, np.zeros(len(every), np.int64))
    for rank in every[~refuses & ~stack.occluder[every]].tolist():
        on = detail.on(rank)
        on = on[(blocked[on] >= 0) & (blocked[on] < rank)]
        for front in np.unique(blocked[on]).tolist():
            behind[front].append(_behind(detail, rank, on[blocked[on] == front]))
    found = [
        Blocked(int(stack.ids[rank]), count, tuple(sorted(behind[rank], key=lambda b: (-b.samples, b.object))))
        for rank, count in zip(ranks.tolist(), counts.tolist(), strict=True)
    ]
    return sorted(found, key=lambda b: (-b.samples, b.occluder))


def _behind(detail: Detail, rank: int, samples: Ints) -> Behind:
    x, y = detail.x[samples], detail.runs.y[detail.run[samples]]
    dx, dy = (v - v.min() - int((v - v.min()).sum()) // len(v) for v in (x, y))  # from the pixel of their mean
    nearest = int(np.lexsort((x, y, dx**2 + dy**2))[0])
    return Behind(int(detail.stack.ids[rank]), len(samples), (int(x[nearest]), int(y[nearest])))


def shares_of(scene: Scene, weapon: Weapon, shots: Shots, rows: Sequence[Any]) -> list[Share]:
    """Share of each row; what an object shows is worked out once for each filter."""
    stack = scene.items.stack()
    visible: dict[tuple[object, ...], int] = {}
    shares = []
    in_round: dict[int, Ints] = {}
    for row in rows:
        rank = int(stack.rank_of[row.object])
        key = (rank, int(shots.accept[row.shot]), *shots.exclude[row.shot].tolist())
        if key not in visible:
            visible[key] = _visible(scene, rank, pierces(weapon), shots.take(row.shot, row.shot + 1))
        if row.shot not in in_round:
            volley = volley_of(weapon, shots.take(row.shot, row.shot + 1))
            in_round[row.shot] = np.bincount(volley.round, volley.count).astype(np.int64)
        fired = int(in_round[row.shot][row.round])
        shares.append(
            Share(row.samples / fired, row.pixels / visible[key], row.pixels / scene.items.variants[row.object].area)
        )
    return shares


def why_not_of(detail: Detail, hit: Set[int]) -> list[WhyNot]:
    """Objects within NEAR_PX of the pattern of one shot that were not hit, nearest first, then by id."""
    stack, volley = detail.stack, detail.volley
    boxes = volley.boxes + np.array([-NEAR_PX, -NEAR_PX, NEAR_PX, NEAR_PX])
    near = np.unique(pairs_of(boxes, volley.shot, detail.shots, stack).rank)
    found = []
    for rank in near.tolist():
        if stack.occluder[rank] or int(stack.ids[rank]) in hit:
            continue
        distance = math.sqrt(_distance2(detail.runs, stack, rank))
        if distance <= NEAR_PX:
            found.append(_why(detail, rank, distance))
    return sorted(found, key=lambda w: (w.distance, w.object))


def detail_of(scene: Scene, weapon: Weapon, shots: Shots) -> Detail:
    """Walk every sample of shots and keep what decided it."""
    stack, bounds = scene.items.stack(), scene.bounds
    volley = volley_of(weapon, shots)
    if int(volley.count.sum()) > DETAIL_SAMPLES_MAX:
        got = int(volley.count.sum())
        raise InputError(f"samples: expected a shot of at most {DETAIL_SAMPLES_MAX} to tell one by one, got {got}")
    runs = volley.table.laid(volley.pattern, volley.xy[:, 0], volley.xy[:, 1], volley.boxes)
    run, x = each_pixel(runs.x_first, runs.x_last)
    pairs = pairs_of(volley.boxes, volley.shot, shots, stack)
    events, state = walk(runs, pairs, stack, pierces(weapon), HIT | BLOCK | SKIP)
    rank = np.full(len(x), -1, np.int64)
    start = np.cumsum(runs.lengths) - runs.lengths - runs.x_first
    ended = rank.copy()
    for kind in (SKIP, BLOCK, HIT):  # of one kind the first counts; a hit outranks a block, a block a skip
        told = events.take(np.flatnonzero(events.kind == kind)[::-1])
        event, column = each_pixel(told.x_first, told.x_last)
        rank[start[told.run][event] + column] = told.rank[event]
        if kind == BLOCK or (kind == HIT and not pierces(weapon)):
            ended[start[told.run][event] + column] = told.rank[event]
    verdict = VERDICT_OF[state]
    if bounds is not None:
        y = runs.y[run]
        outside = (x < bounds[0]) | (y < bounds[1]) | (x > bounds[2]) | (y > bounds[3])
        verdict = np.where(outside, Verdict.OUTSIDE, verdict)
        rank[outside] = ended[outside] = -1
    hit = _inside(events.take(np.flatnonzero(events.kind == HIT)), runs, bounds)
    return Detail(stack, shots, volley, runs, run, x, hit, verdict, rank, ended)


def _inside(events: Events, runs: Runs, bounds: Box | None) -> Events:
    """Events cut to the bounds."""
    if bounds is None:
        return events
    y = runs.y[events.run]
    first, last = np.maximum(events.x_first, bounds[0]), np.minimum(events.x_last, bounds[2])
    some = (first <= last) & (y >= bounds[1]) & (y <= bounds[3])
    return Events(events.kind, events.rank, events.run, first, last).take(np.flatnonzero(some))


def _why(detail: Detail, rank: int, distance: float) -> WhyNot:
    """Reason of one object that was not hit."""
    stack, shot = detail.stack, detail.shots
    item, on = int(stack.ids[rank]), detail.on(rank)
    ended = detail.ended[on]
    by_rank = np.unique(ended[ended >= 0], return_counts=True)
    by = {int(stack.ids[p]): int(n) for p, n in zip(*by_rank, strict=True)}
    if refused(stack, np.array([rank]), shot, np.zeros(1, np.int64))[0]:
        foreign = not int(stack.categories[rank]) & int(shot.accept[0])
        return WhyNot(item, "category" if foreign else "excluded", len(on), by, distance)
    if not len(on):
        return WhyNot(item, "missed", 0, {}, distance)
    outside = (detail.verdict[on] == Verdict.OUTSIDE).all()
    return WhyNot(item, "outside" if outside else "behind", len(on), by, distance)


def _distance2(runs: Runs, stack: Stack, rank: int) -> int:
    """Least squared distance between the pixels of a pattern and those of an item, px^2; beyond NEAR_PX, any."""
    x, y, x_max, y_max = stack.box_xyxy[rank].tolist()
    spans = Spans.from_mask(stack.mask(rank), (x, y))
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


def _visible(scene: Scene, rank: int, pierce: bool, shot: Shots) -> int:
    """Pixels of an object that a pattern covering everything would hit."""
    stack, bounds = scene.items.stack(), scene.bounds
    x, y = stack.box_xyxy[rank, :2].tolist()
    spans = Spans.from_mask(stack.mask(rank), (x, y))
    zero = np.zeros(len(spans), np.int64)
    runs = Runs(zero, spans.y, spans.x_first, spans.x_last, zero)
    if bounds is not None:
        first, last = np.maximum(spans.x_first, bounds[0]), np.minimum(spans.x_last, bounds[2])
        some = (first <= last) & (spans.y >= bounds[1]) & (spans.y <= bounds[3])
        runs = Runs(zero, spans.y, first, last, zero).take(some)
    box = stack.box_xyxy[rank][None]
    pairs = pairs_of(box, np.zeros(1, np.int64), shot, stack)
    events, _ = walk(runs, pairs, stack, pierce, HIT)
    own = events.rank == rank
    return int((events.x_last - events.x_first + 1)[own].sum())
