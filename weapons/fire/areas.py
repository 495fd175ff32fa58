"""The ways to answer shots of area weapons; `strategy` chooses one of them for a call.

scene -> stack -> weapon -> placed patterns -> pre-filter -> samples -> rows

- `by_spans`: the reference. It serves all shots; verdicts, samples and margins are read from it.
- `by_tiles`: placements against the tiles of the stack, front to back, by bit rows.
- `by_visible_set`: the same loop against what is visible of a scene that stands still.
- `by_labels`: one-pixel shots read the label plane.
- `by_integers`: a few shots of small patterns, counted in Python's integers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hitplanes.planes.bits import front_to_back
from hitplanes.planes.bits.bit_rows import NO_SUMS, PatternBits, Placed
from hitplanes.planes.bits.cells import met_boxes
from hitplanes.planes.bits.front_to_back import NO_FLAGS, OrderedTiles, RoundHits, Rule
from hitplanes.planes.bits.span_walk import OF_PATTERNS, Verdict
from hitplanes.planes.bits.tiles import Ground, hit_by_few
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import CHUNK_PAIRS, CHUNK_SAMPLES
from hitplanes.planes.grid.fixed_point import ONE
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.areas import parts_of, pattern_of
from ..kinds.placements import Placements, Shots, placements_for, placements_of
from ..kinds.weapon import Weapon, fits, fits_at_reach
from .hits import Rows, rows_of_span_hits
from .plan import Plan
from .prefilter import Candidates, may_refuse, refused, view_of
from .spans import QueryContext, direct, inside, near_pairs

if TYPE_CHECKING:
    from hitplanes.planes.bits.shadows import Blockers

PLACEMENTS_AT_ONCE = 2**15
"""Most placements of a part of a batch: 256 KB for each of their columns."""

NEAR_AT_ONCE = 2**12
"""Most placements whose near items are listed at a time, if a pre-filter is named; in a crowd each has a hundred."""


class Traits(NamedTuple):
    """What the choice of a way depends on in a weapon."""

    fits: bool  # its patterns are small enough for bit rows, at any aim
    placements: int  # of each shot
    scattered: bool  # it has pellets
    weighted: bool  # its pixels have weights
    pierces: bool  # its samples go on through objects
    is_point: bool  # its shot is one pixel
    reach: int  # px
    sight: str | None  # its line of sight; None of one pixel, to which there is no way
    inside: str  # what an item that a way begins in does


def traits_of(weapon: Weapon) -> Traits:
    """Traits of an area weapon; they are kept with it, as a weapon does not change."""
    kept: Traits | None = getattr(weapon, "_traits", None)
    if kept is None:
        burst, spread, plain = parts_of(weapon)
        weighted, reach = plain.falloff is not None, -(-plain.reach_256 >> 8)
        small = fits_at_reach(reach, weighted) or (not plain.directed and fits([pattern_of(plain, ONE, 0)]))
        point = small and not (weighted or plain.directed or burst or spread) and plain.reach_256 < 2**9
        point = point and pattern_of(plain, ONE, 0).spans.box_xyxy == (0, 0, 0, 0)
        sight = None if point and plain.inside != "error" else plain.line_of_sight
        count, scattered = placements_of(weapon), spread is not None
        kept = Traits(small, count, scattered, weighted, plain.pierce, point, reach, sight, plain.inside)
        weapon._keep("_traits", kept)
    return kept


@dataclass(frozen=True, eq=False, slots=True)
class Request:
    """What a call asks of area weapons.

    Parameters
    ----------
    view : what all shots accept; None if they accept different items
    filtered : whether the call names a pre-filter or a broad phase
    placements : number of placements of all shots
    blockers : items that may shelter pixels; None if there is none, or the weapon needs no line of sight
    """

    scene: Scene
    weapon: Weapon
    shots: Shots
    stack: Stack
    traits: Traits
    view: View | None
    filtered: bool
    placements: int
    blockers: Blockers | None = None


def request_of(scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, filtered: bool) -> Request:
    """What a call asks."""
    traits = traits_of(weapon)
    view, placements = view_of(traits.pierces, shots), traits.placements * len(shots)
    blockers = late.shelter.blockers_of(scene, stack, traits.sight, traits.inside, view) if traits.sight else None
    return Request(scene, weapon, shots, stack, traits, view, filtered, placements, blockers)


# house: way of areas
def by_spans(request: Request, context: QueryContext) -> list[Rows]:
    """Rows by the reference: spans of placed patterns walk the stack."""
    shots, plan, rows = request.shots, context.plan, []
    first = placements_for(request.weapon, shots.take(0, 1))
    for begin, part in chunks(shots, first, context.candidates):
        placements = first if len(shots) == 1 else placements_for(request.weapon, part)
        plan.run("patterns", f"{len(placements.table)} distinct", placements.nbytes)
        if placements.table.prefix is not None:
            plan.run("weights", "falloff of the hit pixels, by prefix sums", placements.table.prefix.nbytes)
        _refuse_starts(request, part, placements)
        rows.append(rows_of_span_hits(direct(placements, part, context), placements, request.stack.ids, begin))
        plan.run("rows", "", rows[-1].nbytes)
    return rows


def verdicts_by_spans(request: Request, context: QueryContext) -> Ints:
    """Samples (N, 5) of shots by verdict, by the reference; the stack is the one that they were fired at."""
    boxes, weapon, shots = Candidates(context.candidates.items, context.stack), request.weapon, request.shots
    then = QueryContext(context.stack, context.bounds, context.pierce, boxes, Plan(), context.blockers)
    verdicts = [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for _, part in chunks(shots, placements_for(weapon, shots.take(0, 1)), boxes):
        counts = direct(placements_for(weapon, part), part, then).counts
        verdicts.append(counts.reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1))
    return np.concatenate(verdicts)


def verdicts_by_tiles(request: Request, context: QueryContext) -> Ints:
    """Samples (N, 5) of shots by verdict, by bit rows: the first item that a sample meets decides what becomes of it.

    So occluders are counted like objects, and no shot pierces. A shot that refuses items is counted again as one that
    accepts all: what it then meets besides is filtered. The tiles of a stack that the scene has left behind are gone,
    unless items only moved; then the reference counts.
    """
    stack, items = request.stack, request.scene.items
    if items.stack().forms != stack.forms or request.blockers is not None or not request.traits.fits:
        return verdicts_by_spans(request, context)
    choosy, free = may_refuse(stack, request.shots), Rule(False, context.bounds)
    tiles = items.tiles().ordered(stack, choosy)._replace(occluder=NO_FLAGS)
    then = QueryContext(stack, context.bounds, False, Candidates(items, stack), Plan())
    verdicts = [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for _, part, placements in _parts(request, PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE, then.candidates):
        counts = inside(placements, placements.boxes, then).reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1)
        rule = _rule(request, part, placements)._replace(pierce=False) if choosy else free
        own = _first_met(placements, tiles, rule, stack, len(part))
        every = _first_met(placements, tiles, free, stack, len(part)) if choosy else own
        counts[:, (Verdict.HIT, Verdict.OCCLUDED)] = own
        counts[:, Verdict.FILTERED] = every.sum(axis=1) - own.sum(axis=1)
        counts[:, Verdict.EMPTY] -= every.sum(axis=1)
        verdicts.append(counts)
    return np.concatenate(verdicts)


def _first_met(placements: Placements, tiles: OrderedTiles, rule: Rule, stack: Stack, shots: int) -> Ints:
    """Samples (N, 2) of shots that meet an object first, and an occluder first."""
    windows = placements.table.bits._replace(sums=NO_SUMS)
    found = kernels_of(front_to_back).front_to_back(placed_of(placements), placements.pellets, windows, tiles, rule)
    shot, _ = placements.shot_of(found.turn)
    column = 2 * shot + stack.occluder[found.rank]
    return np.bincount(column, found.samples, 2 * shots).astype(np.int64).reshape(-1, 2)


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


# house: way of areas
def by_tiles(request: Request, context: QueryContext) -> list[Rows]:
    """Rows by the tiles of the stack, front to back: each takes its pixels from the rest of each placed pattern."""
    stack, tiles, plan, parts = request.stack, request.scene.items.tiles(), context.plan, []
    choosy = may_refuse(stack, request.shots)
    free = Rule(request.traits.pierces, request.scene.bounds, blockers=request.blockers)
    ordered = tiles.ordered(stack, choosy)
    plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ordered.box_xyxy.nbytes)
    most = NEAR_AT_ONCE if request.filtered else PLACEMENTS_AT_ONCE
    first = min(CHUNK_PAIRS // max(len(stack), 1), most) if request.filtered else most
    for begin, part, placements in _parts(request, first, most, context.candidates):
        windows, near = _windows(placements, plan), None
        rule = _rule(request, part, placements) if choosy else free
        if request.filtered:
            placement, rank = near_pairs(placements, np.arange(len(placements)), placements.boxes, context)
            place, tile = tiles.of(rank)
            near = placement[place], tile
        found = kernels_of(front_to_back).front_to_back(
            placed_of(placements), placements.pellets, windows, ordered, rule, near
        )
        tests = f"{'' if request.filtered else 'boxes, '}{'strips, ' * bool(len(windows.strips))}filters and occluders"
        parts.append(_rows_of(placements, found, stack.ids).later(begin))
        plan.run("samples", f"counted by bit rows, front to back: {tests}, too", parts[-1].nbytes)
    return parts


def _rule(request: Request, shots: Shots, placements: Placements) -> Rule:
    """What ends the pixels of a part of the shots, which may refuse items."""
    pierce, bounds, view = request.traits.pierces, request.scene.bounds, request.view
    if view is None:
        meets, exclude = shots.meets[placements.shot], shots.exclude[placements.shot]
        return Rule(pierce, bounds, meets, exclude, request.blockers)
    return Rule(pierce, bounds, view.meets, np.array([view.exclude], np.int64), request.blockers)


def by_visible_set(request: Request, context: QueryContext) -> list[Rows]:
    """Rows by the loop of `by_tiles` over the tiles of what is visible, listed by cells of shot positions."""
    assert request.view is not None  # the strategy has asked
    scene, plan, parts = request.scene, context.plan, []
    visible = scene.derived.visible(request.view)
    kept = visible.made(scene.items)
    visible_set = kept or visible.read(scene.items)
    rule = Rule(True, blockers=request.blockers)
    plan.run("visible set", "what can be seen of all objects", 0 if kept else visible_set.nbytes)
    for begin, _, placements in _parts(request, PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE, context.candidates):
        windows = _windows(placements, plan)
        listed, made = visible_set.cells_for(windows.box_xyxy, len(placements))
        text = "all tiles" if listed is None else f"cells of {1 << listed.bits} px"
        plan.run("pre-filter", text + ", strips" * bool(len(windows.strips)), made)
        found = kernels_of(front_to_back).front_to_back(
            placed_of(placements), placements.pellets, windows, visible_set.seen, rule, listed
        )
        parts.append(_rows_of(placements, found, request.stack.ids).later(begin))
        plan.run("samples", "counted by bit rows", parts[-1].nbytes)
    return parts


def _parts(request: Request, first: int, most: int, candidates: Candidates) -> Iterator[tuple[int, Shots, Placements]]:
    """Parts of a batch whose pairs and patterns fit their chunks, as (first shot, shots, placements).

    Parameters
    ----------
    first, most : placements of the first part, and at most; parts grow as long as their placements meet few items
    """
    shots, each = request.shots, request.traits.placements
    begin, step, most = 0, first // each, most // each
    while begin < len(shots):
        part = shots.take(begin, min(begin + max(step, 1), len(shots)))
        placements = placements_for(request.weapon, part)
        if len(part) > 1 < len(placements.table) and not placements.table.fits:
            step = most = len(part) // 2
            continue
        _refuse_starts(request, part, placements)
        yield begin, part, placements
        begin += len(part)
        step = min(2 * step, most, CHUNK_PAIRS * begin // max(candidates.met, 1))


def _refuse_starts(request: Request, shots: Shots, placements: Placements) -> None:
    """Refuse shots that begin inside a blocker, if their weapon does."""
    if request.blockers is not None and request.traits.inside == "error":
        late.shelter.refuse_starts_inside(placements, shots, request.stack, request.blockers)


def _windows(placements: Placements, plan: Plan) -> PatternBits:
    """Bit rows of the patterns of placements."""
    windows = placements.table.bits
    plan.run("patterns", f"{len(placements.table)} distinct", placements.nbytes)
    if len(windows.sums):
        plan.run("weights", "falloff of the hit pixels, by sums along rows")
    return windows


def placed_of(placements: Placements) -> Placed:
    """Columns of placements, as the kernels take them; distances are counted from the pixels of the rounds."""
    return Placed(placements.pattern, *placements.xy.T, *placements.turn_xy.T)


def _rows_of(placements: Placements, found: RoundHits, ids: Ints) -> Rows:
    """Rows of rounds that hit; `ids` are those of the items of the stack."""
    shot, round_ = placements.shot_of(found.turn)
    xy = np.empty((len(found.x), 2), np.int64)
    xy[:, 0], xy[:, 1] = found.x, found.y
    columns = {
        "shot": shot, "round": round_, "object": ids[found.rank], "samples": found.samples, "pixels": found.pixels,
        "weight": found.weight, "pellets": found.pellets, "first_xy": xy, "distance2": found.distance2,
    }  # fmt: skip
    return Rows.of({name: column for name, column in columns.items() if column is not None})


# house: way of areas
def by_labels(request: Request, context: QueryContext) -> list[Rows]:
    """Rows of one-pixel shots, by the label of each pixel."""
    assert request.view is not None  # the strategy has asked
    plane, plan, parts = request.scene.derived.label_plane(request.view), context.plan, []
    assert plane is not None  # so here
    labels, objects = plane.read(request.scene.items), request.stack.is_object
    plan.run("label plane", f"{plane.redrawn} px drawn anew", plane.redrawn * labels.itemsize)
    for begin in range(0, len(request.shots), PLACEMENTS_AT_ONCE):
        at_256 = request.shots.at_256[begin : begin + PLACEMENTS_AT_ONCE]
        front = plane.front(labels, at_256, objects)
        rows = Rows.of({"shot": front.place, "object": front.object, "first_xy": front.xy})
        plan.run("samples", "one label for each", rows.nbytes)
        parts.append(rows.later(begin))
    plan.leave_out("patterns", "each shot is one pixel")
    return parts


# house: way of areas
def by_integers(request: Request, context: QueryContext) -> list[Rows]:
    """Rows of a few shots, counted in integers."""
    scene, shots, plan = request.scene, request.shots, context.plan
    tiles, placements = scene.items.tiles(), placements_for(request.weapon, shots)
    ground = Ground(request.stack, tiles, tiles.boxes(request.stack.box_xyxy), context.pierce, context.bounds)
    plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ground.boxes_xyxy.nbytes)
    patterns = placements.table.bigs
    plan.run("patterns", f"{len(patterns)} distinct", placements.nbytes)
    near = accepted(met_boxes(placements.boxes, ground.boxes_xyxy), ground, shots, placements.shot)
    hits = hit_by_few(placed_of(placements), patterns, near, ground)
    columns = np.array(hits, np.int64).reshape(-1, 6).T
    turn, distance2, y, x, rank, samples = columns
    rows = _rows_of(placements, RoundHits(turn, rank, samples, distance2, x, y), request.stack.ids)
    plan.run("samples", "counted in integers, front to back: boxes, filters and occluders, too", rows.nbytes)
    return [rows]


def accepted(near: tuple[Ints, Ints], ground: Ground, shots: Shots, shot: Ints) -> tuple[Ints, Ints]:
    """Pairs of placements and tiles whose items the shots accept.

    Parameters
    ----------
    near : pairs (n,) of a placement and a tile
    shot : (P,) shot of each placement
    """
    placement, tile = near
    if not may_refuse(ground.stack, shots):
        return near
    rows = (~refused(ground.stack, ground.tiles.rank[tile], shots, shot[placement])).nonzero()[0]
    return placement[rows], tile[rows]
