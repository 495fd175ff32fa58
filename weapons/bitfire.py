"""Fire patterns by bit rows: the whole flow of a counted weapon on one screen.

scene -> stack -> weapon -> patterns -> windows -> what they share with tiles of items -> rows

Composed: with what can be seen of all, by cells of shot positions. Direct: with tiles where they lie, front to back; of
pellets that scatter, and where a pre-filter is asked for, with what can be seen of the items that they come near. Shots
of one pixel need no bit rows: they read the code plane, or, a few of them, the masks of the items themselves. A few
shots of small patterns are counted in integers where there are no compiled kernels: `fewfire`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from planes import bitrows, fronttoback, lookup, pointquery
from planes.arrays import Ints
from planes.bitrows import Windows
from planes.bits import WORD
from planes.compose import CodePlane
from planes.constants import ALL, CHUNK_PAIRS, SUB
from planes.grid256 import ONE
from planes.items import Items, Stack
from planes.nearest import Beside
from planes.pellets import NOT_BESIDE, gathered
from planes.pointquery import Front
from planes.scene import Scene
from planes.tiles import Tiles
from planes.twins import expect, kernels_of
from planes.visible import SHOT_BITS, Composition, View, in_front, seen_of
from weapons.arsenal import parts_of, pattern_of
from weapons.candidates import Candidates, may_refuse, refused
from weapons.costs import chosen_candidates, chosen_form
from weapons.counting import placed_of, rows_of, rows_of_rounds
from weapons.fewfire import fired_by_few
from weapons.hits import Hits, Rows
from weapons.plan import Plan, leave_out_uncounted
from weapons.resolve import Sight, near_pairs
from weapons.runfire import verdicts_of
from weapons.volley import Shots, Volley, placements_of, volley_of
from weapons.weapon import Weapon
from weapons.windows import fits, windows_of

__all__ = ["fired_by_bits", "traits_of", "view_of"]

SHOT_NS, ITEM_NS = 300.0, 3.0
"""What a placement of a disc of 40 px takes in numpy, and more for each item: by `tests/bench/speed.py`."""

PLACEMENTS_AT_ONCE = 2**15
"""Placements of a part of a batch at most: 256 KB for each of their columns."""

WALKED_MOST = 2**14
"""Pairs of shots of one pixel and items up to which each shot looks at all items."""

NEAR_AT_ONCE = 2**12
"""Placements at most whose objects are looked up at a time: in a crowd each meets a hundred."""

BESIDE_BYTES_MOST = 2**26
"""Distances along the rows of tiles are not made if they take more."""

AUTO = "auto", "auto", "auto"
"""Pre-filter, broad phase and strategy, of which none was asked for."""

OF_ALL = View(False, ALL, ()), View(True, ALL, ())
"""What shots see that refuse nothing: the front, and all that they pierce."""

NO_PATTERNS = "patterns", "each shot is one pixel"
"""What is told of the patterns of such shots: they were left out, and why."""

REACH_COUNTED = 2**11
"""Reach of the weapons whose patterns fit bit rows whatever way they are turned, px."""


class Traits(NamedTuple):
    """What holds for all shots of a weapon.

    Parameters
    ----------
    counted : whether bit rows serve it: it has no weights, and its patterns are not too large
    placements : of each shot
    scattered : whether it has pellets
    pierces : whether its samples go on through objects
    is_point : whether its shot is one pixel
    """

    counted: bool
    placements: int
    scattered: bool
    pierces: bool
    is_point: bool


def traits_of(weapon: Weapon) -> Traits:
    """Traits of a weapon of patterns, kept with it, as it does not change."""
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
    """Decide what shots hit; `how` are the pre-filter, broad phase and strategy."""
    prefilter, broadphase, strategy = how
    traits = traits_of(weapon)
    each, view = traits.placements, view_of(traits.pierces, shots)
    placements = each * len(shots)
    point = traits.is_point and view == OF_ALL[False] and not stack.has_unmet
    each_alone = how == AUTO and not point and not traits.scattered
    few = fired_by_few(scene, weapon, shots, stack, placements, plan) if each_alone else None
    if few is not None:
        plan.run("plan", "direct: few shots")
        sight = Sight(stack, scene.bounds, traits.pierces, Candidates(scene.items, stack), plan)
        return _hits(scene, weapon, shots, sight, [few], ("direct", "few shots"))
    alone = not traits.scattered and prefilter == broadphase == "auto"
    expect(placements * (SHOT_NS + len(stack) * ITEM_NS))
    kind = point, traits.scattered
    name, why = chosen_form(strategy, (prefilter, broadphase), scene, stack, view, kind, placements)
    asked = 0 if alone or name == "composed" else placements
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, False, asked)
    sight = Sight(stack, scene.bounds, traits.pierces, candidates, plan)
    plan.run("plan", f"{name}: {why}")
    plane = scene.code_plane() if point and name == "composed" else None
    if plane is not None:
        parts = _read_plane(plane, shots, sight)
    elif point and alone and name == "direct" and placements * len(stack) <= WALKED_MOST:
        parts = [_walked(shots, sight)]
    else:
        read, first, most = _reader(scene, name, view, alone, sight)
        part_of = _parts(weapon, shots, first // each, most // each, candidates)
        parts = [read(part, volley).later(begin) for begin, part, volley in part_of]
    return _hits(scene, weapon, shots, sight, parts, (name, why))


def _hits(scene: Scene, weapon: Weapon, shots: Shots, sight: Sight, parts: list[Rows], chosen: tuple[str, str]) -> Hits:
    """Hits of parts of a batch, and what they did not need; `chosen` are the strategy and why."""
    rows, plan, candidates = Rows.joined(parts), sight.plan, sight.candidates
    hits = Hits(rows, lambda: verdicts_of(weapon, shots, sight), scene, weapon, shots, plan)
    leave_out_uncounted(plan, scene, candidates, may_refuse(sight.stack, shots), *chosen)
    plan.run("rows", "in their order", rows.nbytes if len(parts) > 1 else 0)
    return hits


Reader = Callable[[Shots, Volley], Rows]


def _reader(scene: Scene, name: str, view: View | None, alone: bool, sight: Sight) -> tuple[Reader, int, int]:
    """How rows of placements are found, and of how many at first and at most at a time.

    Parameters
    ----------
    alone : whether each placement has rows of its own, and no pre-filter or broad phase was asked for
    """
    if name == "composed" and view is not None:
        known = scene.compositions()
        kept = known.kept(view, scene.version)
        composition = kept or known.read(view, scene.items, scene.bounds)
        sight.plan.run("composition", "what can be seen of all objects", 0 if kept else composition.nbytes)
        return _by_composition(composition, sight), PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE
    if alone:
        return _by_pile(scene.items, view, sight), PLACEMENTS_AT_ONCE, PLACEMENTS_AT_ONCE
    first = min(CHUNK_PAIRS // max(len(sight.stack), 1), NEAR_AT_ONCE)
    return _by_items(scene.items, view, sight), first, NEAR_AT_ONCE


def _parts(
    weapon: Weapon, shots: Shots, first: int, most: int, candidates: Candidates
) -> Iterator[tuple[int, Shots, Volley]]:
    """Parts of a batch, and where each begins: as many shots as have pairs and patterns that fit their chunks.

    Parts grow as long as their placements meet few items.
    """
    begin, step = 0, first
    while begin < len(shots):
        part = shots.take(begin, min(begin + max(step, 1), len(shots)))
        volley = volley_of(weapon, part)
        if len(part) > 1 < len(volley.table.patterns) and not fits(volley.table.patterns):
            step = len(part) // 2
            continue
        yield begin, part, volley
        begin += len(part)
        step = min(2 * step, most, CHUNK_PAIRS * begin // max(candidates.met, 1))


def _windows(volley: Volley, plan: Plan) -> Windows:
    """Windows of the patterns of placements."""
    compiled = kernels_of(bitrows) is not bitrows
    windows = windows_of(volley.table.patterns, 0 if compiled else len(volley))
    plan.run("patterns", f"{len(volley.table.patterns)} distinct", volley.nbytes)
    return windows


def _read_plane(plane: CodePlane, shots: Shots, sight: Sight) -> list[Rows]:
    """Read what lies in front at each shot of one pixel."""
    codes, objects, parts = plane.read(sight.candidates.items), sight.stack.is_object, []
    sight.plan.run("code plane", f"{plane.redrawn} px drawn anew", plane.redrawn * codes.itemsize)
    for begin in range(0, len(shots), PLACEMENTS_AT_ONCE):
        at_256 = shots.at_256[begin : begin + PLACEMENTS_AT_ONCE]
        front = kernels_of(pointquery).front_at(codes, plane.cells(len(at_256)), plane.box_xyxy, at_256, objects)
        rows = _rows_in_front(front)
        sight.plan.run("read", "one code for each sample", rows.nbytes)
        parts.append(rows.later(begin))
    sight.plan.leave_out(*NO_PATTERNS)
    return parts


def _walked(shots: Shots, sight: Sight) -> Rows:
    """Look for each shot of one pixel in all items, front to back."""
    rows = _rows_in_front(kernels_of(pointquery).front_of(sight.stack, sight.bounds, shots.at_256))
    sight.plan.run("samples", "each pixel is looked for in the items, front to back: boxes, too", rows.nbytes)
    sight.plan.leave_out(*NO_PATTERNS)
    return rows


def _rows_in_front(front: Front) -> Rows:
    """Rows of what lies in front at shots of one pixel."""
    return Rows.of({"shot": front.place, "object": front.object, "first_xy": front.xy})


def _by_composition(composition: Composition, sight: Sight) -> Reader:
    """Count what placements cover of what can be seen of all objects."""

    def read(_: Shots, volley: Volley) -> Rows:
        """Look up the tiles that are listed where placements lie."""
        seen, plan = composition.seen, sight.plan
        windows = _windows(volley, plan)
        listed, made = composition.cells_for(_reach(windows.box_xyxy), len(volley))
        told = "all tiles" if listed.wide * listed.high == 1 else f"cells of {1 << listed.bits} px"
        plan.run("pre-filter", told + ", strips" * bool(len(windows.strips)), made)
        kernels = kernels_of(lookup)
        if volley.scattered:
            together = kernels.gathered_up(placed_of(volley), windows, seen, listed, volley.pellets)
            rows = rows_of_rounds(volley, together, sight.stack.ids)
            plan.run("samples", "counted by bit rows", rows.nbytes)
            return rows
        beside, made = _beside(composition, volley) if kernels is lookup else (NOT_BESIDE, 0)
        found = kernels.looked_up(placed_of(volley), windows, seen, listed, beside)
        rows = rows_of(volley, found, composition.ids)
        plan.run("samples", "counted by bit rows", rows.nbytes + made)
        return rows

    return read


def _beside(composition: Composition, volley: Volley) -> tuple[Beside, int]:
    """Distances along the rows of tiles, where many discs make them worth it; and the bytes that were made for that."""
    seen = composition.seen
    many = len(seen.rank) < len(volley) and len(seen.rank) * WORD * seen.height <= BESIDE_BYTES_MOST
    if not many or not _is_disc(volley):
        return NOT_BESIDE, 0
    known = "beside" in vars(composition)
    return composition.beside, 0 if known else composition.beside.nbytes


def _by_pile(items: Items, view: View | None, sight: Sight) -> Reader:
    """Count what placements cover of tiles where they lie, front to back."""
    tiles, stack = items.tiles(), sight.stack
    pile = tiles.pile(stack)
    sight.plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else pile.box_xyxy.nbytes)

    def read(shots: Shots, volley: Volley) -> Rows:
        """Let each placement take its pixels from what is left of its pattern."""
        windows = _windows(volley, sight.plan)
        accept: Ints | int | None = None
        exclude: Ints | None = None
        if may_refuse(stack, shots) and view is not None:
            accept, exclude = view.accept, np.array([view.exclude], np.int64)
        elif view is None:
            accept, exclude = shots.accept[volley.shot], shots.exclude[volley.shot]
        found = kernels_of(fronttoback).front_to_back(
            placed_of(volley), windows, pile, accept, exclude, sight.pierce, sight.bounds
        )
        rows = rows_of(volley, found, tiles.each(stack.ids))
        tests = f"boxes, {'strips, ' * bool(len(windows.strips))}filters and occluders"
        sight.plan.run("samples", f"counted by bit rows, front to back: {tests}, too", rows.nbytes)
        return rows

    return read


def _by_items(items: Items, view: View | None, sight: Sight) -> Reader:
    """Count what placements cover of what can be seen of the objects that they come near."""
    tiles = items.tiles()
    boxes = tiles.boxes(sight.stack.box_xyxy)
    sight.plan.run("tiles", "bit rows of the masks", boxes.nbytes)

    def read(shots: Shots, volley: Volley) -> Rows:
        """Find the tiles near placements, what can be seen of them, and what pellets cover of that."""
        windows = _windows(volley, sight.plan)
        placement, rank = _near_objects(shots, volley, sight)
        pair, tile = tiles.of(rank)
        if view is None:
            which, near, of, front = _seen_by_each(tiles, boxes, tile, volley.shot[placement[pair]], shots, sight)
        else:
            which, near, of, front = _seen_by_all(tiles, boxes, tile, view, sight)
        seen = seen_of(tiles, boxes, sight.bounds, which, of, front)
        sight.plan.run("visible", "what is in front of the tiles near placements", seen.words.nbytes)
        together = gathered(placed_of(volley), windows, seen, placement[pair], near, volley.pellets)
        rows = rows_of_rounds(volley, together, sight.stack.ids)
        sight.plan.run("samples", "counted by bit rows", rows.nbytes)
        return rows

    return read


def _near_objects(shots: Shots, volley: Volley, sight: Sight) -> tuple[Ints, Ints]:
    """Placements and ranks of the objects that they may touch and accept."""
    stack, plan = sight.stack, sight.plan
    placement, rank = near_pairs(volley, np.arange(len(volley)), volley.boxes, sight)
    if stack.has_occluders:
        objects = ~stack.occluder[rank]
        placement, rank = placement[objects], rank[objects]
    if may_refuse(stack, shots):
        some = ~refused(stack, rank, shots, volley.shot[placement])
        plan.run("filter", "categories and owners", some.nbytes, (int(some.sum()), len(rank)))
        placement, rank = placement[some], rank[some]
    return placement, rank


def _seen_by_all(tiles: Tiles, boxes: Ints, tile: Ints, view: View, sight: Sight) -> tuple[Ints, Ints, Ints, Ints]:
    """Tiles (V,) to be seen, each once; which of them each pair (n,) has; what covers them, as `seen_of` takes it."""
    there = view.accepts(sight.stack)
    blocks = there & sight.stack.occluder if sight.pierce else there
    which, near = _distinct(tile, len(tiles))
    return which, near, *in_front(boxes, which, tiles.each(blocks))


def _seen_by_each(
    tiles: Tiles, boxes: Ints, tile: Ints, shot: Ints, shots: Shots, sight: Sight
) -> tuple[Ints, Ints, Ints, Ints]:
    """The same for shots that accept different items: a tile is seen once by each shot (n,) that has it in a pair."""
    stack = sight.stack
    blocks = stack.occluder if sight.pierce else np.ones(len(stack), np.bool_)
    seen, near = np.unique(shot * len(tiles) + tile, return_inverse=True)
    seer, which = np.divmod(seen, len(tiles))
    of, front = in_front(boxes, which, tiles.each(blocks))
    accepted = ~refused(stack, tiles.rank[front], shots, seer[of])
    return which, near, of[accepted], front[accepted]


def _distinct(values: Ints, most: int) -> tuple[Ints, Ints]:
    """Distinct numbers below `most`, rising, and the place of each value among them."""
    there = np.zeros(most, np.bool_)
    there[values] = True
    distinct = there.nonzero()[0]
    place = np.empty(most, np.int64)
    place[distinct] = np.arange(len(distinct))
    return distinct, place[values]


def view_of(pierce: bool, shots: Shots) -> View | None:
    """What all shots accept; None if they differ in it."""
    if not shots.choosy or not len(shots):
        return OF_ALL[pierce]
    accept, exclude = shots.accept, shots.exclude
    if (accept != accept[0]).any() or (exclude != exclude[0]).any():
        return None
    return View(pierce, int(accept[0]), tuple(sorted(set(exclude[0].tolist()) - {-1})))


def _is_disc(volley: Volley) -> bool:
    """Whether all placements are of one pattern that holds all pixels nearer to its origin than one of its own."""
    return not volley.scattered and len(volley.table.patterns) == 1 and volley.table.patterns[0].is_disc


def _reach(boxes_xyxy: Ints) -> Ints:
    """Box around patterns; of several a little larger, so that the cells made for it serve the next call, too."""
    if len(boxes_xyxy) == 1:
        return np.asarray(boxes_xyxy[0])
    low, high = boxes_xyxy[:, :2].min(axis=0), boxes_xyxy[:, 2:].max(axis=0)
    return np.concatenate([low >> SHOT_BITS << SHOT_BITS, -(-high >> SHOT_BITS << SHOT_BITS)])
