"""What is derived from a shot when it is asked for: each sample, shares, blockers, why not, margins."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from planes.arrays import InputError, Ints
from planes.constants import CHUNK_SAMPLES, MARGIN_PX, MASK_AREA_MAX, NEAR_PX
from planes.items import Stack
from planes.sampling import BLOCK, HIT, SKIP, VERDICT_OF, Runs, Verdict, walk
from planes.scene import Scene
from planes.spans import Spans, each_pixel
from weapons.arsenal import Weapon, pierces
from weapons.candidates import pairs_of, refused
from weapons.plan import Plan
from weapons.resolve import Sight, direct
from weapons.volley import Shots, Volley, volley_of

__all__ = [
    "Blocked", "Samples", "Share", "WhyNot", "blockers_of", "margins_of", "samples_of", "shares_of",
    "why_not_of",
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


class Blocked(NamedTuple):
    """An occluder and the samples whose walk it ended."""

    occluder: int
    samples: int


class WhyNot(NamedTuple):
    """Why an object near the shot was not hit.

    `reason` is "missed" (no sample on it), "category", "excluded", "behind" (every sample on it ended in front of
    it), or "outside" (of the bounds); `samples` counts those on it; `by` tells what ended them, as {id: samples};
    `distance` is that from the pattern, px, 0 where a sample is on it.
    """

    object: int
    reason: str
    samples: int
    by: dict[int, int]
    distance: float


@dataclass(frozen=True, eq=False)
class _Detail:
    """One shot sample by sample.

    `rank` is what decided the verdict, `ended` what ended the walk, as ranks in the stack, -1 for none.
    """

    runs: Runs
    run: Ints
    x: Ints
    verdict: Ints
    rank: Ints
    ended: Ints


def samples_of(scene: Scene, weapon: Weapon, shot: Shots) -> Samples:
    """All samples of one shot."""
    volley = volley_of(weapon, shot)
    detail = _detail(scene, weapon, volley, shot)
    placement = detail.runs.placement[detail.run]
    ids = np.append(scene.items.stack().ids, -1)
    xy = np.stack([detail.x, detail.runs.y[detail.run]], axis=1)
    return Samples(xy, volley.round[placement], volley.pellet[placement], detail.verdict, ids[detail.rank])


def blockers_of(scene: Scene, weapon: Weapon, shot: Shots) -> list[Blocked]:
    """Occluders that ended samples, most first, then by id."""
    stack = scene.items.stack()
    ended = _detail(scene, weapon, volley_of(weapon, shot), shot).ended
    ended = ended[ended >= 0]
    ids, counts = np.unique(stack.ids[ended[stack.occluder[ended]]], return_counts=True)
    found = [Blocked(*pair) for pair in zip(ids.tolist(), counts.tolist(), strict=True)]
    return sorted(found, key=lambda b: (-b.samples, b.occluder))


def shares_of(scene: Scene, weapon: Weapon, shots: Shots, rows: Sequence[Any]) -> list[Share]:
    """Share of each row; what an object shows is worked out once for each filter."""
    stack = scene.items.stack()
    rank_of = {item: rank for rank, item in enumerate(stack.ids.tolist())}
    visible: dict[tuple[object, ...], int] = {}
    shares = []
    in_round: dict[int, Ints] = {}
    for row in rows:
        rank = rank_of[row.object]
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


def why_not_of(scene: Scene, weapon: Weapon, shot: Shots, hit: Set[int]) -> list[WhyNot]:
    """Objects within NEAR_PX of the pattern that were not hit, nearest first, then by id."""
    volley = volley_of(weapon, shot)
    stack = scene.items.stack()
    detail = _detail(scene, weapon, volley, shot)
    boxes = volley.boxes + np.array([-NEAR_PX, -NEAR_PX, NEAR_PX, NEAR_PX])
    near = np.unique(pairs_of(boxes, volley.shot, shot, stack, "box").rank)
    found = []
    for rank in near.tolist():
        if stack.occluder[rank] or int(stack.ids[rank]) in hit:
            continue
        distance = math.sqrt(_distance2(detail.runs, stack, rank))
        if distance <= NEAR_PX:
            found.append(_why(stack, rank, shot, detail, distance))
    return sorted(found, key=lambda w: (w.distance, w.object))


def margins_of(scene: Scene, weapon: Weapon, shot: Shots) -> dict[int, float]:
    """Length of the shortest whole-pixel shift of the pattern that flips each object, looked for up to MARGIN_PX."""
    side = np.arange(-MARGIN_PX, MARGIN_PX + 1)
    shift = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    shift = shift[(shift**2).sum(axis=1) <= MARGIN_PX**2]
    volley = volley_of(weapon, shot)
    stack = scene.items.stack()
    hit = np.zeros((len(shift), len(stack)), np.bool_)
    placements = len(volley.shot)
    sight = Sight(stack, scene.bounds, pierces(weapon), "box", Plan())
    step = max(1, CHUNK_SAMPLES // max(int(volley.count.sum()), 1))
    for first in range(0, len(shift), step):
        met = direct(_shifted(volley, shift[first : first + step]), shot, sight)
        hit[first + met.placement // placements, met.rank] = True
    length2 = (shift**2).sum(axis=1)
    flips = hit != hit[length2 == 0]
    shortest = np.where(flips, length2[:, None], MARGIN_PX**2 + 1).min(axis=0, initial=MARGIN_PX**2 + 1)
    found = [(int(stack.ids[p]), math.sqrt(int(shortest[p]))) for p in np.flatnonzero(shortest <= MARGIN_PX**2)]
    return dict(sorted(found))


def _shifted(volley: Volley, shift: Ints) -> Volley:
    """Place a volley once for each shift, with all placements as those of the first shot."""
    n = len(shift)
    return replace(
        volley,
        pattern=np.tile(volley.pattern, n),
        xy=np.tile(volley.xy, (n, 1)) + np.repeat(shift, len(volley.shot), axis=0),
        origin_xy=np.tile(volley.origin_xy, (n, 1)),
        shot=np.tile(volley.shot, n),
        round=np.tile(volley.round, n),
        pellet=np.tile(volley.pellet, n),
    )


def _detail(scene: Scene, weapon: Weapon, volley: Volley, shot: Shots) -> _Detail:
    """Walk every sample of one shot and keep what decided it."""
    stack, bounds = scene.items.stack(), scene.bounds
    if int(volley.count.sum()) > MASK_AREA_MAX:
        raise InputError(f"samples: expected a shot of at most {MASK_AREA_MAX} samples, got {int(volley.count.sum())}")
    runs = volley.table.laid(volley.pattern, volley.xy[:, 0], volley.xy[:, 1], volley.boxes)
    run, x = each_pixel(runs.x_first, runs.x_last)
    pairs = pairs_of(volley.boxes, volley.shot, shot, stack, "box")
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
    return _Detail(runs, run, x, verdict, rank, ended)


def _why(stack: Stack, rank: int, shot: Shots, detail: _Detail, distance: float) -> WhyNot:
    """Reason of one object that was not hit."""
    item = int(stack.ids[rank])
    x0, y0, x1, y1 = stack.box_xyxy[rank].tolist()
    y = detail.runs.y[detail.run]
    inside = np.flatnonzero((detail.x >= x0) & (detail.x <= x1) & (y >= y0) & (y <= y1))
    on = inside[stack.mask(rank)[y[inside] - y0, detail.x[inside] - x0]]
    ended = detail.ended[on]
    by_rank = np.unique(ended[ended >= 0], return_counts=True)
    by = {int(stack.ids[p]): int(n) for p, n in zip(*by_rank, strict=True)}
    here = np.array([rank])
    if refused(stack, here, shot, np.zeros(1, np.int64))[0]:
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
    pairs = pairs_of(box, np.zeros(1, np.int64), shot, stack, "box")
    events, _ = walk(runs, pairs, stack, pierce, HIT)
    own = events.rank == rank
    return int((events.x_last - events.x_first + 1)[own].sum())
