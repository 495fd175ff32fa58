"""The ways to answer shots of area weapons, and the choice of the one that serves a call.

scene -> stack -> weapon -> placed patterns -> pre-filter -> pixels shared with items -> rows

- Spans (`fired_by_runs`): the reference, for falloff and for patterns too large for bit rows.
- Bit rows, composed: placements against the visible set, by cells of shot positions.
- Bit rows, direct: placements against ordered tiles, front to back.
- Bit rows, direct, for pellets or with a pre-filter: placements against the visible pixels of the items near them.
- Integers: a few shots of small patterns, where kernels are not compiled.
- One pixel: the label plane is read, or the items' masks if shots are few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from hitplanes.planes.bits import bit_rows, front_to_back, label_plane
from hitplanes.planes.bits.bit_rows import WORD, Beside, PatternBits, Placed, TileHits
from hitplanes.planes.bits.cells import met_boxes
from hitplanes.planes.bits.front_to_back import NOT_BESIDE, RoundHits, gathered
from hitplanes.planes.bits.label_plane import Front, LabelPlane
from hitplanes.planes.bits.span_walk import OF_PATTERNS
from hitplanes.planes.bits.tiles import Ground, Hit, Tiles, hit_by_few, pays
from hitplanes.planes.bits.visible import SHOT_BITS, View, VisibleSet, in_front, visible_tiles_of
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import ALL, CHUNK_PAIRS, CHUNK_SAMPLES, SUB
from hitplanes.planes.grid.fixed_point import ONE
from hitplanes.planes.scene.items import Items, Stack
from hitplanes.planes.scene.scene import Scene

from ..kinds.areas import parts_of, pattern_of, pierces
from ..kinds.placements import Placements, Shots, placements_for, placements_of
from ..kinds.weapon import Weapon, big_of, fits, pattern_bits_of
from .hits import Hits, Rows, rows_of_span_hits
from .plan import Plan, leave_out_uncounted, leave_out_unused
from .prefilter import Candidates, may_refuse, refused
from .spans import QueryContext, composed, direct, near_pairs
from .strategy import chosen_candidates, chosen_form, chosen_strategy, sweep_pays


def placed_of(volley: Placements) -> Placed:
    """Columns of placements, as the kernels take them; distances are counted from the pixels of the rounds."""
    return Placed(volley.pattern, *volley.xy.T, *volley.turn_xy.T)


def rows_of(volley: Placements, found: TileHits, ids: Ints) -> Rows:
    """Rows of weapons without pellets: each placement has rows of its own.

    Parameters
    ----------
    found : hits in the order of rows
    ids : (T,) id of the item of each tile
    """
    shot, round_ = volley.turn_of(found.placement)
    rows = {
        "shot": shot, "object": ids[found.seen], "samples": found.samples, "first_xy": _joined(found.x, found.y),
        "distance2": found.distance2,
    }  # fmt: skip
    return Rows.of(rows if round_ is None else {**rows, "round": round_})


def rows_of_rounds(volley: Placements, found: RoundHits, ids: Ints) -> Rows:
    """Rows of weapons with pellets: those of a round count together.

    Parameters
    ----------
    ids : (M,) ids of the items of the stack
    """
    shot, round_ = volley.shot_of(found.turn)
    several = volley.pellets > 1
    return Rows(
        shot, round_, ids[found.rank], found.samples, found.pixels if several else None, None,
        found.pellets if several else None, _joined(found.x, found.y), found.distance2,
    )  # fmt: skip


def _joined(x: Ints, y: Ints) -> Ints:
    """Pixels (n, 2)."""
    xy = np.empty((len(x), 2), np.int64)
    xy[:, 0], xy[:, 1] = x, y
    return xy


REACH = 48
"""Largest reach of a pattern that is counted in integers, px; arrays are as fast for larger ones."""

PLACEMENTS_MOST = 64
"""Most placements that are counted in integers."""

BOXES_MOST = 2**15
"""Most pairs of placements and tiles whose boxes are compared for integers; of more, too many meet."""


# house: way of areas
def fired_by_few(scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, placements: int, plan: Plan) -> Rows | None:
    """Rows of a few shots counted in integers; None if kernels are compiled, or patterns or tiles near are too many."""
    plain = parts_of(weapon)[2]
    if kernels_of(front_to_back) is not front_to_back or not 0 < placements <= PLACEMENTS_MOST:
        return None
    if plain.reach_256 > SUB * REACH:
        return None
    tiles = scene.items.tiles()
    if placements * len(tiles) > BOXES_MOST:
        return None
    volley = placements_for(weapon, shots)
    ground = Ground(stack, tiles, tiles.boxes(stack.box_xyxy), plain.pierce, scene.bounds)
    near, box = met_boxes(volley.boxes, ground.boxes_xyxy), volley.table.box_xyxy
    wide, high = (int((box[:, axis + 2] - box[:, axis]).max()) + 1 for axis in (0, 1))
    if not pays(len(near[0]), wide, high):
        return None
    patterns = [big_of(pattern) for pattern in volley.table.patterns]
    plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ground.boxes_xyxy.nbytes)
    plan.run("patterns", f"{len(patterns)} distinct", volley.nbytes)
    hits = hit_by_few(placed_of(volley), patterns, accepted(near, ground, shots, volley.shot), ground)
    rows = _rows_of(volley, hits, stack)
    plan.run("samples", "counted in integers, front to back: boxes, filters and occluders, too", rows.nbytes)
    return rows


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


def _rows_of(volley: Placements, hits: list[Hit], stack: Stack) -> Rows:
    """Rows of hits, given in the order of rows."""
    if not hits:
        return Rows.none()
    placement, distance2, y, x, rank, samples = np.array(hits, np.int64).T
    return rows_of(volley, TileHits(placement, rank, samples, distance2, x, y), stack.ids)


def fired_by_runs(
    scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, how: tuple[str, str, str], plan: Plan
) -> Hits:
    """Decide by spans what shots hit; `how` is (pre-filter, broad phase, strategy)."""
    prefilter, broadphase, strategy = how
    first = placements_for(weapon, shots.take(0, 1))
    plan.run("patterns", "" if len(shots) else "no shots", first.nbytes)
    placements = len(first.shot) * len(shots)
    name, why = chosen_strategy(strategy, scene, stack, first.table, placements)
    asked = placements if name == "direct" or pierces(weapon) or shots.choosy else 0
    swept = sweep_pays(stack, first.table, asked)
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, swept, asked)
    context = QueryContext(stack, scene.bounds, pierces(weapon), candidates, plan)
    drawn = None
    plan.run("plan", f"{name}: {why}")
    if name == "composed" and (plane := scene.label_plane()):
        drawn = plane.read(scene.items), plane.box_xyxy
        plan.run("code plane", f"{plane.redrawn} px drawn anew; {why}", plane.redrawn * drawn[0].itemsize)
    rows, verdicts = [], [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for begin, part in _chunks(shots, first, candidates):
        volley = first if len(shots) == 1 else placements_for(weapon, part)
        _tell_patterns(plan, volley, 0 if volley is first else volley.nbytes)
        met = composed(volley, part, context, *drawn) if drawn else direct(volley, part, context)
        rows.append(rows_of_span_hits(met, volley, stack.ids, begin))
        plan.run("rows", "", rows[-1].nbytes)
        verdicts.append(met.counts.reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1))
        plan.run("verdicts", "", verdicts[-1].nbytes)
    hits = Hits(Rows.joined(rows), lambda: np.concatenate(verdicts), scene, weapon, shots, plan)
    plan.run("rows", "")
    leave_out_unused(plan, scene, candidates, first.table, may_refuse(stack, shots), why)
    plan.run("plan", "")
    return hits


def verdicts_of(weapon: Weapon, shots: Shots, context: QueryContext) -> Ints:
    """Samples (N, 5) of shots by verdict; the stack is the one that they were fired at."""
    boxes = Candidates(context.candidates.items, context.stack)
    then = QueryContext(context.stack, context.bounds, context.pierce, boxes, Plan())
    verdicts = [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for _, part in _chunks(shots, placements_for(weapon, shots.take(0, 1)), boxes):
        counts = direct(placements_for(weapon, part), part, then).counts
        verdicts.append(counts.reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1))
    return np.concatenate(verdicts)


def _tell_patterns(plan: Plan, volley: Placements, made: int) -> None:
    """Record the patterns of a part of the shots, and their weights."""
    plan.run("patterns", f"{len(volley.table.count)} distinct", made + volley.table.spans.nbytes)
    if volley.table.prefix is not None:
        plan.run("weights", "falloff of the hit pixels, by prefix sums", volley.table.prefix.nbytes)


def _chunks(shots: Shots, first: Placements, candidates: Candidates) -> Iterator[tuple[int, Shots]]:
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


PLACEMENTS_AT_ONCE = 2**15
"""Most placements of a part of a batch: 256 KB for each of their columns."""

WALKED_MOST = 2**14
"""Most pairs of one-pixel shots and items for which each shot looks at all items."""

NEAR_AT_ONCE = 2**12
"""Most placements whose near objects are listed at a time; in a crowd each has a hundred."""

BESIDE_BYTES_MOST = 2**26
"""Most memory for distances along the rows of tiles, bytes."""

AUTO = "auto", "auto", "auto"
"""Pre-filter, broad phase and strategy of a call that names none of them."""

OF_ALL = View(False, ALL, ()), View(True, ALL, ())
"""Views of shots that accept everything: without and with pierce."""

NO_PATTERNS = "patterns", "each shot is one pixel"
"""Stage that one-pixel shots leave out, and why."""

REACH_COUNTED = 2**11
"""Largest reach at which patterns fit bit rows at any turn, px."""


class Traits(NamedTuple):
    """What the choice of a way depends on in a weapon."""

    counted: bool  # bit rows serve it: no falloff, and patterns that are not too large
    placements: int  # of each shot
    scattered: bool  # it has pellets
    pierces: bool  # its samples go on through objects
    is_point: bool  # its shot is one pixel


def traits_of(weapon: Weapon) -> Traits:
    """Traits of an area weapon; they are kept with it, as a weapon does not change."""
    kept: Traits | None = getattr(weapon, "_traits", None)
    if kept is None:
        burst, spread, plain = parts_of(weapon)
        near, full = plain.reach_256 <= SUB * REACH_COUNTED, plain.falloff is None
        alone = full and not plain.directed and (near or fits([pattern_of(plain, ONE, 0)]))
        point = alone and not burst and not spread and pattern_of(plain, ONE, 0).spans.box_xyxy == (0, 0, 0, 0)
        kept = Traits(full and (near or alone), placements_of(weapon), spread is not None, plain.pierce, point)
        weapon._keep("_traits", kept)
    return kept


def fired_by_bits(
    scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, how: tuple[str, str, str], plan: Plan
) -> Hits:
    """Decide by bit rows, labels or integers what shots hit; `how` is (pre-filter, broad phase, strategy)."""
    prefilter, broadphase, strategy = how
    traits = traits_of(weapon)
    each, view = traits.placements, view_of(traits.pierces, shots)
    placements = each * len(shots)
    point = traits.is_point and view == OF_ALL[False] and not stack.has_unmet
    each_alone = how == AUTO and not point and not traits.scattered
    few = fired_by_few(scene, weapon, shots, stack, placements, plan) if each_alone else None
    if few is not None:
        plan.run("plan", "direct: few shots")
        context = QueryContext(stack, scene.bounds, traits.pierces, Candidates(scene.items, stack), plan)
        return _hits(scene, weapon, shots, context, [few], ("direct", "few shots"))
    alone = not traits.scattered and prefilter == broadphase == "auto"
    kind = point, traits.scattered
    name, why = chosen_form(strategy, (prefilter, broadphase), scene, stack, view, kind, placements)
    asked = 0 if alone or name == "composed" else placements
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, False, asked)
    context = QueryContext(stack, scene.bounds, traits.pierces, candidates, plan)
    plan.run("plan", f"{name}: {why}")
    plane = scene.label_plane() if point and name == "composed" else None
    if plane is not None:
        parts = _read_plane(plane, shots, context)
    elif point and alone and name == "direct" and placements * len(stack) <= WALKED_MOST:
        parts = [_walked(shots, context)]
    else:
        read, first, most = _reader(scene, name, view, alone, context)
        part_of = _parts(weapon, shots, first // each, most // each, candidates)
        parts = [read(part, volley).later(begin) for begin, part, volley in part_of]
    return _hits(scene, weapon, shots, context, parts, (name, why))


def _hits(
    scene: Scene, weapon: Weapon, shots: Shots, context: QueryContext, parts: list[Rows], chosen: tuple[str, str]
) -> Hits:
    """Join the rows of parts of a batch, and complete the plan; `chosen` is the strategy and why."""
    rows, plan, candidates = Rows.joined(parts), context.plan, context.candidates
    hits = Hits(rows, lambda: verdicts_of(weapon, shots, context), scene, weapon, shots, plan)
    leave_out_uncounted(plan, scene, candidates, may_refuse(context.stack, shots), *chosen)
    plan.run("rows", "in their order", rows.nbytes if len(parts) > 1 else 0)
    return hits


Reader = Callable[[Shots, Placements], Rows]


def _reader(scene: Scene, name: str, view: View | None, alone: bool, context: QueryContext) -> tuple[Reader, int, int]:
    """The function that finds rows of placements; how many it takes in the first part, and at most.

    Parameters
    ----------
    alone : whether the weapon has no pellets, and the call names no pre-filter or broad phase
    """
    if name == "composed" and view is not None:
        known = scene.visible_sets()
        kept = known.kept(view, scene.version)
        visible_set = kept or known.read(view, scene.items, scene.bounds)
        context.plan.run("composition", "what can be seen of all objects", 0 if kept else visible_set.nbytes)
        return _by_visible_set(visible_set, context), PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE
    if alone:
        return _by_ordered_tiles(scene.items, view, context), PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE
    first = min(CHUNK_PAIRS // max(len(context.stack), 1), NEAR_AT_ONCE)
    return _by_items(scene.items, view, context), first, NEAR_AT_ONCE


def _parts(
    weapon: Weapon, shots: Shots, first: int, most: int, candidates: Candidates
) -> Iterator[tuple[int, Shots, Placements]]:
    """Parts of a batch whose pairs and patterns fit their chunks, as (first shot, shots, placements).

    Parts grow as long as their placements meet few items.
    """
    begin, step = 0, first
    while begin < len(shots):
        part = shots.take(begin, min(begin + max(step, 1), len(shots)))
        volley = placements_for(weapon, part)
        if len(part) > 1 < len(volley.table.patterns) and not fits(volley.table.patterns):
            step = len(part) // 2
            continue
        yield begin, part, volley
        begin += len(part)
        step = min(2 * step, most, CHUNK_PAIRS * begin // max(candidates.met, 1))


def _windows(volley: Placements, plan: Plan) -> PatternBits:
    """Bit rows of the patterns of placements."""
    compiled = kernels_of(bit_rows) is not bit_rows
    windows = pattern_bits_of(volley.table.patterns, 0 if compiled else len(volley))
    plan.run("patterns", f"{len(volley.table.patterns)} distinct", volley.nbytes)
    return windows


# house: way of areas
def _read_plane(plane: LabelPlane, shots: Shots, context: QueryContext) -> list[Rows]:
    """Answer one-pixel shots by the label plane."""
    labels, objects, parts = plane.read(context.candidates.items), context.stack.is_object, []
    context.plan.run("code plane", f"{plane.redrawn} px drawn anew", plane.redrawn * labels.itemsize)
    for begin in range(0, len(shots), PLACEMENTS_AT_ONCE):
        at_256 = shots.at_256[begin : begin + PLACEMENTS_AT_ONCE]
        front = kernels_of(label_plane).front_at(labels, plane.cells(len(at_256)), plane.box_xyxy, at_256, objects)
        rows = _rows_in_front(front)
        context.plan.run("read", "one code for each sample", rows.nbytes)
        parts.append(rows.later(begin))
    context.plan.leave_out(*NO_PATTERNS)
    return parts


# house: way of areas
def _walked(shots: Shots, context: QueryContext) -> Rows:
    """Answer a few one-pixel shots by the masks of all items, front to back."""
    rows = _rows_in_front(kernels_of(label_plane).front_of(context.stack, context.bounds, shots.at_256))
    context.plan.run("samples", "each pixel is looked for in the items, front to back: boxes, too", rows.nbytes)
    context.plan.leave_out(*NO_PATTERNS)
    return rows


def _rows_in_front(front: Front) -> Rows:
    """Rows of one-pixel shots."""
    return Rows.of({"shot": front.place, "object": front.object, "first_xy": front.xy})


# house: way of areas
def _by_visible_set(visible_set: VisibleSet, context: QueryContext) -> Reader:
    """A reader that counts what placements cover of the visible pixels of all objects."""

    def read(_: Shots, volley: Placements) -> Rows:
        """Count placements against the tiles that are listed in their cells."""
        seen, plan = visible_set.seen, context.plan
        windows = _windows(volley, plan)
        listed, made = visible_set.cells_for(_reach(windows.box_xyxy), len(volley))
        text = "all tiles" if listed.wide * listed.high == 1 else f"cells of {1 << listed.bits} px"
        plan.run("pre-filter", text + ", strips" * bool(len(windows.strips)), made)
        kernels = kernels_of(front_to_back)
        if volley.scattered:
            together = kernels.gathered_up(placed_of(volley), windows, seen, listed, volley.pellets)
            rows = rows_of_rounds(volley, together, context.stack.ids)
            plan.run("samples", "counted by bit rows", rows.nbytes)
            return rows
        beside, made = _beside(visible_set, volley) if kernels is front_to_back else (NOT_BESIDE, 0)
        found = kernels.looked_up(placed_of(volley), windows, seen, listed, beside)
        rows = rows_of(volley, found, visible_set.ids)
        plan.run("samples", "counted by bit rows", rows.nbytes + made)
        return rows

    return read


def _beside(visible_set: VisibleSet, volley: Placements) -> tuple[Beside, int]:
    """Distances along the rows of visible tiles if many discs are placed, else none; and the bytes newly made."""
    seen = visible_set.seen
    many = len(seen.rank) < len(volley) and len(seen.rank) * WORD * seen.height <= BESIDE_BYTES_MOST
    if not many or not _is_disc(volley):
        return NOT_BESIDE, 0
    known = "beside" in vars(visible_set)
    return visible_set.beside, 0 if known else visible_set.beside.nbytes


# house: way of areas
def _by_ordered_tiles(items: Items, view: View | None, context: QueryContext) -> Reader:
    """A reader that counts placements against the ordered tiles, front to back."""
    tiles, stack = items.tiles(), context.stack
    ordered = tiles.ordered(stack)
    context.plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ordered.box_xyxy.nbytes)

    def read(shots: Shots, volley: Placements) -> Rows:
        """Let each tile, front to back, take its pixels from the rest of each placed pattern."""
        windows = _windows(volley, context.plan)
        accept: Ints | int | None = None
        exclude: Ints | None = None
        if may_refuse(stack, shots) and view is not None:
            accept, exclude = view.accept, np.array([view.exclude], np.int64)
        elif view is None:
            accept, exclude = shots.accept[volley.shot], shots.exclude[volley.shot]
        found = kernels_of(front_to_back).front_to_back(
            placed_of(volley), windows, ordered, accept, exclude, context.pierce, context.bounds
        )
        rows = rows_of(volley, found, tiles.each(stack.ids))
        tests = f"boxes, {'strips, ' * bool(len(windows.strips))}filters and occluders"
        context.plan.run("samples", f"counted by bit rows, front to back: {tests}, too", rows.nbytes)
        return rows

    return read


# house: way of areas
def _by_items(items: Items, view: View | None, context: QueryContext) -> Reader:
    """A reader that counts what placements cover of the visible pixels of the objects near them."""
    tiles = items.tiles()
    boxes = tiles.boxes(context.stack.box_xyxy)
    context.plan.run("tiles", "bit rows of the masks", boxes.nbytes)

    def read(shots: Shots, volley: Placements) -> Rows:
        """Find the tiles near placements, their visible pixels, and what pellets cover of those."""
        windows = _windows(volley, context.plan)
        placement, rank = _near_objects(shots, volley, context)
        pair, tile = tiles.of(rank)
        if view is None:
            which, near, of, front = _seen_by_each(tiles, boxes, tile, volley.shot[placement[pair]], shots, context)
        else:
            which, near, of, front = _seen_by_all(tiles, boxes, tile, view, context)
        seen = visible_tiles_of(tiles, boxes, context.bounds, which, of, front)
        context.plan.run("visible", "what is in front of the tiles near placements", seen.words.nbytes)
        together = gathered(placed_of(volley), windows, seen, placement[pair], near, volley.pellets)
        rows = rows_of_rounds(volley, together, context.stack.ids)
        context.plan.run("samples", "counted by bit rows", rows.nbytes)
        return rows

    return read


def _near_objects(shots: Shots, volley: Placements, context: QueryContext) -> tuple[Ints, Ints]:
    """Pairs of placements and ranks of accepted objects that they may touch."""
    stack, plan = context.stack, context.plan
    placement, rank = near_pairs(volley, np.arange(len(volley)), volley.boxes, context)
    if stack.has_occluders:
        objects = ~stack.occluder[rank]
        placement, rank = placement[objects], rank[objects]
    if may_refuse(stack, shots):
        mask = ~refused(stack, rank, shots, volley.shot[placement])
        plan.run("filter", "categories and owners", mask.nbytes, (int(mask.sum()), len(rank)))
        placement, rank = placement[mask], rank[mask]
    return placement, rank


# house: hit rule of areas
def _seen_by_all(
    tiles: Tiles, boxes: Ints, tile: Ints, view: View, context: QueryContext
) -> tuple[Ints, Ints, Ints, Ints]:
    """Distinct tiles (V,), the place of each pair's (n,) tile among them, and pairs of a place and a tile in front."""
    there = view.accepts(context.stack)
    blocks = there & context.stack.occluder if context.pierce else there
    which, near = _distinct(tile, len(tiles))
    return which, near, *in_front(boxes, which, tiles.each(blocks))


# house: hit rule of areas
def _seen_by_each(
    tiles: Tiles, boxes: Ints, tile: Ints, shot: Ints, shots: Shots, context: QueryContext
) -> tuple[Ints, Ints, Ints, Ints]:
    """Like `_seen_by_all`, for shots (n,) that accept different items: a tile is listed once for each of its shots."""
    stack = context.stack
    blocks = stack.occluder if context.pierce else np.ones(len(stack), np.bool_)
    seen, near = np.unique(shot * len(tiles) + tile, return_inverse=True)
    seer, which = np.divmod(seen, len(tiles))
    of, front = in_front(boxes, which, tiles.each(blocks))
    accepted = ~refused(stack, tiles.rank[front], shots, seer[of])
    return which, near, of[accepted], front[accepted]


def _distinct(values: Ints, most: int) -> tuple[Ints, Ints]:
    """Distinct values in rising order, all below `most`, and the place of each value among them."""
    there = np.zeros(most, np.bool_)
    there[values] = True
    distinct = there.nonzero()[0]
    place = np.empty(most, np.int64)
    place[distinct] = np.arange(len(distinct))
    return distinct, place[values]


def view_of(pierce: bool, shots: Shots) -> View | None:
    """View of a batch: what all its shots accept; None if they accept different items."""
    if not shots.choosy or not len(shots):
        return OF_ALL[pierce]
    accept, exclude = shots.accept, shots.exclude
    if (accept != accept[0]).any() or (exclude != exclude[0]).any():
        return None
    return View(pierce, int(accept[0]), tuple(sorted(set(exclude[0].tolist()) - {-1})))


def _is_disc(volley: Placements) -> bool:
    """Whether all placements have one pattern, and it is a disc (see `Pattern.is_disc`)."""
    return not volley.scattered and len(volley.table.patterns) == 1 and volley.table.patterns[0].is_disc


def _reach(boxes_xyxy: Ints) -> Ints:
    """Box around all patterns; around several it is rounded outward, so that its cells serve the next call, too."""
    if len(boxes_xyxy) == 1:
        return np.asarray(boxes_xyxy[0])
    low, high = boxes_xyxy[:, :2].min(axis=0), boxes_xyxy[:, 2:].max(axis=0)
    return np.concatenate([low >> SHOT_BITS << SHOT_BITS, -(-high >> SHOT_BITS << SHOT_BITS)])
