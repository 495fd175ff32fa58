"""The ways to answer shots of area weapons; `strategy` chooses one of them for a call.

scene -> stack -> weapon -> placed patterns -> pre-filter -> samples -> rows

- `spans.by_spans`: the reference. It serves all shots; verdicts, samples and margins are read from it.
- `by_tiles`: placements against the tiles of the stack, front to back, by bit rows.
- `by_visible_set`: the same loop against what is visible of a scene that stands still.
- `by_labels`: one-pixel shots read the label plane.
- `by_integers`: a few shots of small patterns, counted in Python's integers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hitplanes.planes.bits import front_to_back
from hitplanes.planes.bits.bit_rows import PatternBits, Placed
from hitplanes.planes.bits.cells import met_boxes
from hitplanes.planes.bits.front_to_back import RoundHits, Rule
from hitplanes.planes.bits.tiles import Ground, hit_by_few
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Ints
from hitplanes.planes.common.limits import CHUNK_PAIRS
from hitplanes.planes.grid.fixed_point import ONE
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.areas import parts_of, pattern_of
from ..kinds.placements import Placements, Shots, placements_for, placements_of
from ..kinds.weapon import Weapon, fits, fits_at_reach
from .hits import Rows
from .plan import Plan, absent, undrawn
from .prefilter import BOX, Candidates, QueryContext, may_refuse, near_pairs, refused

if TYPE_CHECKING:
    from hitplanes.planes.bits.label_plane import LabelPlane

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


@dataclass(eq=False, slots=True)
class Request(QueryContext):
    """What a call asks of area weapons: shots, and what they are tested against.

    Parameters
    ----------
    view : what all shots accept; None if they accept different items
    choosy : whether a shot may refuse an item
    filtered : whether the call names a pre-filter or a broad phase
    placements : number of placements of all shots
    covers : (M,) items that end pixels and have no rows: occluders, but as verdicts are counted; (0,) if there are none
    placed : placements of all shots, if they are made already
    """

    scene: Scene
    weapon: Weapon
    shots: Shots
    traits: Traits
    view: View | None
    choosy: bool
    filtered: bool
    placements: int
    covers: Bools
    placed: Placements | None = None


# house: way of areas
def by_tiles(request: Request) -> list[Rows]:
    """Rows by the tiles of the stack, front to back: each takes its pixels from the rest of each placed pattern."""
    stack, tiles, plan, parts = request.stack, request.scene.items.tiles(), request.plan, []
    free = Rule(request.pierce, request.bounds, blockers=request.blockers)
    ordered = tiles.ordered(stack, request.covers, request.choosy)
    plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ordered.box_xyxy.nbytes)
    most = NEAR_AT_ONCE if request.filtered else PLACEMENTS_AT_ONCE
    first = min(CHUNK_PAIRS // max(len(stack), 1), most) if request.filtered else most
    for begin, part, placements in parts_of_batch(request, first, most):
        windows, near = _windows(placements, plan), None
        rule = _rule(request, part, placements) if request.choosy else free
        if request.filtered:
            placement, rank = near_pairs(placements, np.arange(len(placements)), placements.boxes, request)
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
    pierce, bounds, view = request.pierce, request.bounds, request.view
    if view is None:
        meets, exclude = shots.meets[placements.shot], shots.exclude[placements.shot]
        return Rule(pierce, bounds, meets, exclude, request.blockers)
    return Rule(pierce, bounds, view.meets, np.array([view.exclude], np.int64), request.blockers)


def by_visible_set(request: Request) -> list[Rows]:
    """Rows by the loop of `by_tiles` over the tiles of what is visible, listed by cells of shot positions."""
    assert request.view is not None  # the strategy has asked
    scene, plan, parts = request.scene, request.plan, []
    visible = scene.derived.visible(request.view)
    kept = visible.made(scene.items)
    visible_set = kept or visible.read(scene.items)
    rule = Rule(True, blockers=request.blockers)
    plan.run("visible set", "what can be seen of all objects", 0 if kept else visible_set.nbytes)
    for begin, _, placements in parts_of_batch(request, PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE):
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


def parts_of_batch(request: Request, first: int, most: int) -> Iterator[tuple[int, Shots, Placements]]:
    """Parts of a batch whose pairs and patterns fit their chunks, as (first shot, shots, placements).

    Parameters
    ----------
    first, most : placements of the first part, and at most; parts grow as long as their placements meet few items
    """
    shots, each = request.shots, request.traits.placements
    if request.placed is not None:
        yield 0, shots, request.placed
        return
    begin, step, most = 0, first // each, most // each
    while begin < len(shots):
        part = shots.take(begin, min(begin + max(step, 1), len(shots)))
        placements = placements_for(request.weapon, part)
        if len(part) > 1 < len(placements.table) and not placements.table.fits:
            step = most = len(part) // 2
            continue
        refuse_starts(request, part, placements)
        yield begin, part, placements
        begin += len(part)
        step = min(2 * step, most, CHUNK_PAIRS * begin // max(request.candidates.met, 1))


def refuse_starts(request: Request, shots: Shots, placements: Placements) -> None:
    """Refuse shots that begin inside a blocker, if their weapon does."""
    if request.blockers is not None and request.traits.inside == "error":
        late.shelter.refuse_starts_inside(placements, shots, request.scene, request.stack, request.blockers)


def _windows(placements: Placements, plan: Plan) -> PatternBits:
    """Bit rows of the patterns of placements."""
    windows = placements.table.bits
    plan.run("patterns", f"different patterns: {len(placements.table)}", placements.nbytes)
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
    return Rows(
        shot, round_, ids[found.rank], found.samples, found.pixels, found.weight, found.pellets, xy, found.distance2
    )


def labels_for(request: Request) -> LabelPlane | None:
    """The label plane of what the shots of a request accept; None if the scene has none."""
    assert request.view is not None  # the strategy has asked
    return request.scene.derived.label_plane(request.view._replace(of_occluders=False))


# house: way of areas
def by_labels(request: Request) -> list[Rows]:
    """Rows of one-pixel shots, by the label of each pixel."""
    assert request.view is not None  # the strategy has asked
    plane, plan, parts = labels_for(request), request.plan, []
    assert plane is not None  # so here
    labels, objects = plane.read(request.scene.items), request.stack.is_object
    if request.view.of_occluders:
        objects = ~objects  # label 0 is of no item
        objects[0] = False
    plan.run("label plane", f"{plane.redrawn} px drawn anew", plane.redrawn * labels.itemsize)
    for begin in range(0, len(request.shots), PLACEMENTS_AT_ONCE):
        at_256 = request.shots.at_256[begin : begin + PLACEMENTS_AT_ONCE]
        front = plane.front(labels, at_256, objects)
        ids = request.stack.ids.take(request.stack.rank_by_label.take(front.label))
        rows = Rows(shot=front.place, object=ids, first_xy=front.xy)
        plan.run("samples", "one label for each", rows.nbytes)
        parts.append(rows.later(begin))
    plan.leave_out("patterns", "each shot is one pixel")
    return parts


# house: way of areas
def by_integers(request: Request) -> list[Rows]:
    """Rows of a few shots, counted in integers."""
    shots, plan = request.shots, request.plan
    tiles, placements = request.scene.items.tiles(), placements_for(request.weapon, shots)
    boxes_xyxy = tiles.boxes(request.stack.box_xyxy)
    ground = Ground(request.stack, tiles, boxes_xyxy, request.pierce, request.bounds, request.covers)
    plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ground.boxes_xyxy.nbytes)
    patterns = placements.table.bigs
    plan.run("patterns", f"different patterns: {len(patterns)}", placements.nbytes)
    if request.traits.weighted:
        plan.run("weights", "falloff of the hit pixels, by the binary digits of their weights")
    near = accepted(met_boxes(placements.boxes, ground.boxes_xyxy), ground, shots, placements.shot)
    hits = hit_by_few(placed_of(placements), patterns, near, ground)
    turn, distance2, y, x, rank, samples, weight = np.array(hits, np.int64).reshape(-1, 7).T
    found = RoundHits(turn, rank, samples, distance2, x, y, weight if request.traits.weighted else None)
    rows = _rows_of(placements, found, request.stack.ids)
    plan.run("samples", "counted in integers, front to back: boxes, filters and occluders, too", rows.nbytes)
    return [rows]


def leave_out_unused(request: Request, way: str) -> None:
    """Complete the plan of a call, answered by a way, with the stages that it left out."""
    has = request.traits.weighted, request.bounds is not None, request.choosy
    request.plan.leave_out_all(_unused, way, request.candidates, has, request.scene.items.imagery())


def _unused(
    way: str, candidates: Candidates, has: tuple[bool, bool, bool], imagery: Sequence[Role]
) -> Iterator[tuple[str, str]]:
    yield "broad phase", "the pre-filter lists tiles by cells" if way == "visible" else candidates.why_unindexed
    if not candidates.prefilter.volume:
        yield "volumes", "boxes are the pre-filter" if candidates.prefilter == BOX else "no pre-filter"
    yield from absent(candidates.stack, *has)
    yield "verdicts", "counted when asked for"
    if way == "spans":
        idle = "no sample needed the stack"
        yield from ((name, idle) for name in ("filter", "occluders", "pre-filter", "volumes"))
        yield "walk", "no sample lay where it needed one"
    if way != "visible":
        yield "visible set", f"{way} needs none"
    if way != "labels":
        yield "label plane", f"{way} needs none"
    yield from undrawn(imagery)


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
