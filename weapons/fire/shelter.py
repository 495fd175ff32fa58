"""Line of sight of area weapons: the items of a call that shelter pixels from the shot's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hitplanes.planes import late
from hitplanes.planes.common.checks import InputError, Ints
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..kinds.placements import Placements, Shots
from .prefilter import refused

if TYPE_CHECKING:
    from hitplanes.planes.bits.shadows import Blockers, Shelter
    from hitplanes.planes.bits.span_walk import Runs
    from hitplanes.planes.scene.derived import View


def blockers_of(scene: Scene, stack: Stack, sight: str, inside: str, view: View | None) -> Blockers | None:
    """Items that may shelter pixels from shots; None if there is none.

    Parameters
    ----------
    sight, inside : `line_of_sight` and `inside` of the weapon of the pattern
    view : what all shots accept; None if they accept different items
    """
    there = stack.occluder if sight == "occluders" else np.ones(len(stack), np.bool_)
    rank = np.flatnonzero(there if view is None else there & view.accepts(stack))
    if not len(rank):
        return None
    whose = (stack.categories[rank], stack.owner[rank]) if view is None else (rank[:0], rank[:0])
    if stack.forms == scene.items.arrangement:
        rects = scene.items.covers(stack.ids[rank])
    else:  # the masks of then may be gone from the scene
        rects = late.shadows.joined([late.shadows.rectangles(stack.mask(r)) for r in rank.tolist()])
    return late.shadows.Blockers(
        rank, stack.box_xyxy[rank], *rects, *whose, scene.bounds, inside == "ignore_until_exit"
    )


def near_blockers(placements: Placements, shots: Shots, stack: Stack, blockers: Blockers) -> tuple[Ints, Ints]:
    """Sorted pairs of a placement and a blocker that its shot accepts, which may shelter pixels of its pattern."""
    placement, blocker = late.shadows.ways_met(placements.boxes, placements.xy, blockers)
    if len(blockers.categories):
        kept = ~refused(stack, blockers.rank[blocker], shots, placements.shot[placement])
        placement, blocker = placement[kept], blocker[kept]
    return placement, blocker


def sheltered(runs: Runs, placements: Placements, shots: Shots, stack: Stack, blockers: Blockers) -> Shelter:
    """What shelters the samples of runs of placed patterns."""
    placement, blocker = near_blockers(placements, shots, stack, blockers)
    first, last = runs.placement[[0, -1]].tolist() if len(runs) else (0, -1)
    kept = (placement >= first) & (placement <= last)
    return late.shadows.shelter_of(runs, placements.xy, blockers, placement[kept], blocker[kept])


def shelter_ranks(
    placements: Placements, shots: Shots, stack: Stack, blockers: Blockers, of: Ints, xy: Ints, own: Ints
) -> Ints:
    """Rank of the item that shelters each sample (s,): the first on the way, and in front of others there.

    Parameters
    ----------
    of, xy, own : (s,) placement, rising, (s, 2) pixel, and (s,) rank of an item that does not count, or -1
    """
    placement, blocker = near_blockers(placements, shots, stack, blockers)
    return late.shadows.sheltered_by(blockers, placement, blocker, of, xy, placements.xy, own)


def refuse_starts_inside(placements: Placements, shots: Shots, stack: Stack, blockers: Blockers) -> None:
    """Refuse shots of which the way to a pixel begins inside a blocker."""
    place, blocker = late.shadows.begun_in(placements.xy, blockers)
    shot, rank = placements.shot[place], blockers.rank[blocker]
    kept = np.flatnonzero(~refused(stack, rank, shots, shot))
    if len(kept):
        row, item = int(shots.row[shot[kept[0]]]), int(stack.ids[rank[kept[0]]])
        raise InputError(f"at[{row}]: expected a start outside of every item that blocks, got one inside of id {item}")
