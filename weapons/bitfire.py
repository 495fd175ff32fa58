"""Fire patterns by bit rows: the whole flow of a counted weapon on one screen.

scene -> stack -> weapon -> patterns -> windows -> near -> visible -> shared -> rows
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from planes import bitrows, cells
from planes.arrays import Ints
from planes.bitrows import Beside, Seen, Windows
from planes.compose import CodePlane
from planes.constants import ALL, CHUNK_PAIRS, SUB
from planes.items import HITTABLE, Items, Stack
from planes.scene import Scene
from planes.tiles import Tiles
from planes.twins import kernels_of
from planes.visible import SHOT_BITS, Composition, View, in_front, seen_of
from weapons.arsenal import parts_of, pierces
from weapons.candidates import may_refuse, refused
from weapons.counting import counted, points
from weapons.hits import Hits, Rows
from weapons.plan import Plan, chosen_candidates, chosen_form, leave_out_uncounted
from weapons.resolve import Sight, near_pairs
from weapons.runfire import verdicts_of
from weapons.volley import Shots, Volley, volley_of
from weapons.weapon import Weapon
from weapons.windows import fits, windows_of

__all__ = ["counts", "fired_by_bits", "view_of"]

OFTEN = 64
"""Shots that are worth all 64 shifts of a pattern."""

PLACEMENTS_AT_ONCE = 2**14
"""Placements of a part of a batch at most: 128 KB for each of their columns."""

REACH_COUNTED = 2**11
"""Reach of the weapons whose patterns fit bit rows whatever way they are turned, px."""


def counts(weapon: Weapon, first: Volley) -> bool:
    """Whether bit rows serve a weapon: one without weights, whose patterns are not too large."""
    if first.table.prefix is not None:
        return False
    plain = parts_of(weapon)[2]
    return plain.reach_256 <= SUB * REACH_COUNTED or (not plain.directed and fits(first.table.patterns))


def fired_by_bits(
    scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, first: Volley, how: tuple[str, str, str], plan: Plan
) -> Hits:
    """Decide what shots hit; `first` is the volley of the first, `how` the pre-filter, broad phase and strategy."""
    prefilter, broadphase, strategy = how
    plan.run("patterns", "" if len(shots) else "no shots", first.nbytes)
    view = view_of(pierces(weapon), shots)
    placements = len(first.shot) * len(shots)
    point = is_point(first, view, stack)
    name, why = chosen_form(strategy, (prefilter, broadphase), scene, stack, view, point, placements)
    asked = 0 if name == "composed" else placements
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, False, asked)
    sight = Sight(stack, scene.bounds, pierces(weapon), candidates, plan)
    plan.run("plan", f"{name}: {why}")
    if name == "composed" and point and (plane := scene.code_plane()):
        read, most = _by_plane(plane, scene.items, sight), PLACEMENTS_AT_ONCE
    elif name == "composed" and view is not None:
        composition = scene.compositions().read(view, scene.items, scene.bounds)
        plan.run("composition", "what can be seen of all objects", composition.nbytes)
        read, most = _by_composition(composition, sight), PLACEMENTS_AT_ONCE
    else:
        read, most = _by_items(scene.items, view, sight), CHUNK_PAIRS // max(len(stack), 1)
    rows = [Rows.none()]
    begin = 0
    for part, volley, windows in _parts(weapon, shots, first, max(1, min(most, PLACEMENTS_AT_ONCE))):
        if volley is not first:
            plan.run("patterns", "", volley.nbytes)
        some = read(part, volley, windows)
        rows.append(replace(some, shot=some.shot + begin) if begin else some)
        begin += len(part)
        plan.run("rows", "", rows[-1].nbytes)
    hits = Hits(
        Rows.joined(rows[1:] or rows), lambda: verdicts_of(weapon, shots, first, sight), scene, weapon, shots, plan
    )
    plan.run("rows", "")
    leave_out_uncounted(plan, scene, candidates, may_refuse(stack, shots), name, why)
    plan.run("plan", "")
    return hits


Reader = Callable[[Shots, Volley, Windows], Rows]


def _parts(weapon: Weapon, shots: Shots, first: Volley, most: int) -> Iterator[tuple[Shots, Volley, Windows]]:
    """Parts of a batch of at most so many placements, and of as many patterns as fit memory at a time."""
    step = max(1, most // max(len(first.shot), 1))
    for begin in range(0, len(shots), step):
        yield from _fitting(weapon, shots.take(begin, min(begin + step, len(shots))), first, len(shots) > OFTEN)


def _fitting(weapon: Weapon, shots: Shots, first: Volley, often: bool) -> Iterator[tuple[Shots, Volley, Windows]]:
    volley = first if len(shots) == 1 == len(first.shot) and not shots.row[0] else volley_of(weapon, shots)
    if fits(volley.table.patterns) or len(shots) == 1:
        yield shots, volley, windows_of(volley.table.patterns, often)
        return
    half = len(shots) // 2
    for begin, end in ((0, half), (half, len(shots))):
        yield from _fitting(weapon, shots.take(begin, end), first, often)


def _by_plane(plane: CodePlane, items: Items, sight: Sight) -> Reader:
    """Read what lies in front at each placement of one pixel."""
    codes = plane.read(items)
    sight.plan.run("code plane", f"{plane.redrawn} px drawn anew", plane.redrawn * codes.itemsize)
    objects = items.role[: items.count] == HITTABLE

    def read(_: Shots, volley: Volley, windows: Windows) -> Rows:
        rows = points(volley, windows, codes, plane.box_xyxy, objects, kernels_of(bitrows))
        sight.plan.run("read", "one code for each sample", rows.nbytes)
        return rows

    return read


def _by_composition(composition: Composition, sight: Sight) -> Reader:
    """Count what placements cover of what can be seen of all objects."""

    def read(_: Shots, volley: Volley, windows: Windows) -> Rows:
        listed = composition.cells(_reach(windows.box_xyxy))
        placement, near = kernels_of(cells).listed_at(listed, volley.xy[:, 0], volley.xy[:, 1])
        sight.plan.run("pre-filter", f"cells of {1 << listed.bits} px", placement.nbytes + near.nbytes)
        beside = NOT_BESIDE
        if kernels_of(bitrows) is bitrows and len(near) > len(composition.seen.rank) and _is_disc(volley):
            beside = composition.beside
        return _counted(volley, windows, placement, near, composition.seen, beside, sight)

    return read


def _by_items(items: Items, view: View | None, sight: Sight) -> Reader:
    """Count what placements cover of what can be seen of the objects that they come near."""
    tiles = items.tiles()
    boxes = tiles.boxes(sight.stack.box_xyxy)
    sight.plan.run("tiles", "bit rows of the masks", boxes.nbytes)

    def read(shots: Shots, volley: Volley, windows: Windows) -> Rows:
        placement, rank = _near_objects(shots, volley, sight)
        pair, tile = tiles.of(rank)
        seer = None if view is not None else volley.shot[placement[pair]]
        which, near, of, front = _seen_by(tiles, boxes, tile, seer, view, shots, sight)
        seen = seen_of(tiles, boxes, sight.bounds, which, of, front)
        sight.plan.run("visible", "what is in front of the tiles near placements", seen.words.nbytes)
        return _counted(volley, windows, placement[pair], near, seen, NOT_BESIDE, sight)

    return read


def _near_objects(shots: Shots, volley: Volley, sight: Sight) -> tuple[Ints, Ints]:
    """Placements and ranks of the objects that they may touch and accept."""
    stack, plan = sight.stack, sight.plan
    placement, rank = near_pairs(volley, np.arange(len(volley.shot)), volley.boxes, sight)
    some = ~stack.occluder[rank]
    if may_refuse(stack, shots):
        some &= ~refused(stack, rank, shots, volley.shot[placement])
        plan.run("filter", "categories and owners", some.nbytes, (int(some.sum()), len(rank)))
    return placement[some], rank[some]


def _seen_by(
    tiles: Tiles, boxes: Ints, tile: Ints, seer: Ints | None, view: View | None, shots: Shots, sight: Sight
) -> tuple[Ints, Ints, Ints, Ints]:
    """Tiles to be seen, each once, or once for each shot that sees it; which of them each pair has; what covers them.

    Returns
    -------
    which tiles (V,); of each pair (n,) its place among them; and (of, front) as `seen_of` takes them
    """
    stack = sight.stack
    blocks = stack.occluder if sight.pierce else np.ones(len(stack), np.bool_)
    if view is not None or seer is None:
        which, near = np.unique(tile, return_inverse=True)
        there = blocks if view is None else blocks & view.accepts(stack)
        return which, near, *in_front(boxes, which, there[tiles.rank])
    pairs, near = np.unique(seer * len(tiles) + tile, return_inverse=True)
    shot, which = np.divmod(pairs, len(tiles))
    of, front = in_front(boxes, which, blocks[tiles.rank])
    accepted = ~refused(stack, tiles.rank[front], shots, shot[of])
    return which, near, of[accepted], front[accepted]


NOT_BESIDE = np.zeros((0, 64, 8), np.uint8)


def view_of(pierce: bool, shots: Shots) -> View | None:
    """What all shots accept; None if they differ in it."""
    if not shots.choosy or not len(shots):
        return View(pierce, ALL, ())
    accept, exclude = shots.accept, shots.exclude
    if (accept != accept[0]).any() or (exclude != exclude[0]).any():
        return None
    return View(pierce, int(accept[0]), tuple(sorted(set(exclude[0].tolist()) - {-1})))


def is_point(volley: Volley, view: View | None, stack: Stack) -> bool:
    """Whether placements are of one pixel each, for shots that end at the first item there is."""
    one = len(volley.shot) == 1 and volley.table.count[0] == 1
    return one and view == View(False, ALL, ()) and not stack.has_unmet


def _is_disc(volley: Volley) -> bool:
    """Whether all placements are of one pattern that holds all pixels nearer to its origin than one of its own."""
    return not volley.scattered and len(volley.table.patterns) == 1 and volley.table.patterns[0].is_disc


def _counted(
    volley: Volley, windows: Windows, placement: Ints, near: Ints, seen: Seen, beside: Beside, sight: Sight
) -> Rows:
    rows = counted(volley, windows, placement, near, seen, beside, sight.stack.ids, kernels_of(bitrows))
    sight.plan.run("samples", "counted by bit rows", rows.nbytes)
    return rows


def _reach(boxes_xyxy: Ints) -> Ints:
    """Box around patterns; of several a little larger, so that the cells made for it serve the next call, too."""
    low, high = boxes_xyxy[:, :2].min(axis=0), boxes_xyxy[:, 2:].max(axis=0)
    if len(boxes_xyxy) > 1:
        low, high = low >> SHOT_BITS << SHOT_BITS, -(-high >> SHOT_BITS << SHOT_BITS)
    return np.concatenate([low, high])
