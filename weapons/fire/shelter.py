"""Line of sight of area weapons: the items of a call that shelter pixels from the shot's own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hitplanes.planes import late
from hitplanes.planes.common.checks import InputError, Ints
from hitplanes.planes.common.limits import CHUNK_CELLS, SUB
from hitplanes.planes.grid.fixed_point import snap
from hitplanes.planes.grid.spans import Box, begins, meets, pieces
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..kinds.areas import parts_of
from ..kinds.placements import Placements, Shots
from ..kinds.weapon import Weapon
from .prefilter import refused

if TYPE_CHECKING:
    from hitplanes.planes.bits.blockers import Blockers
    from hitplanes.planes.bits.shadows import Shelter
    from hitplanes.planes.bits.span_walk import Runs
    from hitplanes.planes.scene.derived import View


SLACK_PX = 2
"""Distance by which the pixels of a shot may lie beyond its reach, as directions and positions are rounded, px."""

FEW_NEAR = 64
"""Most items near the shots that are listed alone; of more, all are, as that list is kept for the next shots."""


def ways_box(weapon: Weapon, shots: Shots, shift: int = 0) -> Box:
    """Box around the ways to all pixels of some shots, each of which may be shifted, px."""
    burst, spread, plain = parts_of(weapon)
    reach_256 = plain.reach_256 + (int(snap(spread.radius)) if spread else 0)
    if burst:
        reach_256 += burst.count * int(np.abs(snap(burst.recoil_xy)).max())
    reach = reach_256 // SUB + SLACK_PX + shift
    if len(shots) < 2:
        x, y = x_max, y_max = shots.xy[0].tolist() if len(shots) else (0, 0)
    else:
        (x, y), (x_max, y_max) = shots.xy.min(axis=0).tolist(), shots.xy.max(axis=0).tolist()
    return x - reach, y - reach, x_max + reach, y_max + reach


def blockers_of(
    scene: Scene, stack: Stack, sight: str, inside: str, view: View | None, near_xyxy: Box | None
) -> Blockers | None:
    """Items that may shelter pixels from shots; None if there is none.

    Parameters
    ----------
    sight, inside : `line_of_sight` and `inside` of the weapon of the pattern
    view : what all shots accept; None if they accept different items
    near_xyxy : box around all ways that are looked at; None if any may be
    """
    there = stack.occluder if sight == "occluders" else np.ones(len(stack), np.bool_)
    if view is not None:
        there = there & view.accepts(stack)
    rank = np.flatnonzero(there)
    if near_xyxy is not None:
        near = rank[meets(stack.box_xyxy[rank], np.array(near_xyxy))]
        rank, near_xyxy = (near, near_xyxy) if len(near) <= FEW_NEAR else (rank, None)
    if not len(rank):
        return None
    boxes_xyxy = stack.box_xyxy[rank]
    if stack.arrangement == scene.items.arrangement:
        begin, cover = scene.items.covers(stack.rows[rank], boxes_xyxy, near_xyxy)
    else:  # the masks of then may be gone from the scene
        of = np.arange(len(rank))
        begin, cover = late.blockers.Covers().of(of, lambda row: stack.mask(rank[row]), boxes_xyxy, near_xyxy)
    whose = (stack.categories[rank], stack.owner[rank]) if view is None else (rank[:0], rank[:0])
    leaves = inside == "ignore_until_exit"
    return late.blockers.Blockers(rank, boxes_xyxy, begin, *cover, *whose, scene.bounds, leaves)


def _near(runs: Runs, placements: Placements, shots: Shots, stack: Stack, blockers: Blockers) -> tuple[Ints, Ints]:
    """Sorted pairs of a placement and a blocker that its shot accepts, which may shelter pixels of runs."""
    begin = begins(runs.placement).nonzero()[0]
    placement, end = runs.placement[begin], np.append(begin[1:], len(runs))[: len(begin)]
    left, right = np.minimum.reduceat(runs.x_first, begin), np.maximum.reduceat(runs.x_last, begin)
    boxes = np.stack([left, runs.y[begin], right, runs.y[end - 1]], axis=1)
    row, blocker = late.shadows.all_ways_met(boxes, placements.xy[placement], blockers)
    placement = placement[row]
    if len(blockers.categories):
        kept = ~refused(stack, blockers.rank[blocker], shots, placements.shot[placement])
        placement, blocker = placement[kept], blocker[kept]
    return placement, blocker


def sheltered(runs: Runs, placements: Placements, shots: Shots, stack: Stack, blockers: Blockers) -> Shelter:
    """What shelters the samples of runs of placed patterns."""
    near = _near(runs, placements, shots, stack, blockers)
    return late.shadows.shelter_of(runs, placements.xy, blockers, *near)


def sheltered_pixels(runs: Runs, placements: Placements, shots: Shots, stack: Stack, blockers: Blockers) -> Ints:
    """Number of sheltered pixels (P,) of each placement in runs."""
    counts = np.zeros(len(placements.xy), np.int64)
    placement, blocker = _near(runs, placements, shots, stack, blockers)
    rects = np.bincount(placement, (blockers.begin[1:] - blockers.begin[:-1])[blocker], len(counts))
    runs = runs.take(np.flatnonzero(rects[runs.placement]))
    for part in pieces(rects[runs.placement].astype(np.int64), CHUNK_CELLS):
        strip = runs.take(part)
        near = _near(strip, placements, shots, stack, blockers)
        run, first, last = late.shadows.sheltered_stretches(strip, placements.xy, blockers, *near)
        np.add.at(counts, strip.placement[run], last - first + 1)
    return counts


def hidden_from(origin_xy: Ints, runs: Runs, rank: int, shot: Shots, stack: Stack, blockers: Blockers) -> Runs:
    """What an origin (2,) of a single shot does not see of runs of one item, as it does not shelter itself."""
    if not len(runs):
        return runs
    box = np.array([[runs.x_first.min(), runs.y[0], runs.x_last.max(), runs.y[-1]]])
    place, blocker = late.shadows.all_ways_met(box, origin_xy[None], blockers)
    other = (blockers.rank[blocker] != rank) & ~refused(stack, blockers.rank[blocker], shot, place)
    near = place[other], blocker[other]
    run, first, last = late.shadows.sheltered_stretches(runs, origin_xy[None], blockers, *near)
    return replace(runs.take(run), x_first=first, x_last=last)


def shelter_ranks(
    runs: Runs, placements: Placements, shots: Shots, stack: Stack, blockers: Blockers, shelter: Shelter, own: Ints
) -> Ints:
    """Rank of the item that shelters each sample (s,): the first on the way, and in front of others there.

    Parameters
    ----------
    shelter : what shelters the samples of the runs; of a single item it is told at once
    own : (s,) rank of an item that does not count, or -1
    """
    several = shelter.items > 1
    if not several.any():
        return shelter.ranks
    near = _near(runs, placements, shots, stack, blockers)
    ranks = late.shadows.sheltered_by(runs, placements.xy, blockers, *near, several, own)
    return np.where(several, ranks, shelter.ranks)


def refuse_starts_inside(placements: Placements, shots: Shots, scene: Scene, stack: Stack, blockers: Blockers) -> None:
    """Refuse shots of which the way to a pixel begins inside a blocker."""
    place, blocker = late.shadows.begun_in(placements.xy, blockers)
    shot, rank = placements.shot[place], blockers.rank[blocker]
    kept = np.flatnonzero(~refused(stack, rank, shots, shot))
    if len(kept):
        row, item = int(shots.row[shot[kept[0]]]), int(stack.ids[rank[kept[0]]])
        got = f"one inside of id {item}, {scene.name_of(item)!r}"
        raise InputError(f"at[{row}]: expected a start outside of every item that blocks, got {got}")
