"""The pre-filter: it finds the items that a placed pattern may touch, and those that the shot refuses.

1. Boxes: one by one, or by a broad phase (grid, quadtree, BVH) that follows the scene.
2. Volumes: the item's and the pattern's (circle, oriented box, k boxes, polygon, swept), about the pattern's origin.

It may keep too many items, but never drops a hit: each volume contains the squares of its pixels. Most calls are
served best by boxes alone; volumes are loaded by the call that needs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple
from weakref import ref

import numpy as np

from hitplanes.planes import late
from hitplanes.planes.bits.cells import met_boxes
from hitplanes.planes.bits.span_walk import BLOCK, HIT, SKIP, Kinds, Pairs
from hitplanes.planes.common.backend import LruCache
from hitplanes.planes.common.checks import Bools, Ints, boxes_in, choice
from hitplanes.planes.common.limits import BOUNDING_BYTES, BOUNDING_CACHE_BYTES, CORNERS, GROWN_PX, PAIRS_AT_ONCE, SUB
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import Box, meets, sorted_once
from hitplanes.planes.scene.derived import OF_ALL, View
from hitplanes.planes.scene.items import Items, Stack

from ..kinds.placements import Placements, Shots
from ..kinds.weapon import Pattern, Swept
from .plan import Plan

if TYPE_CHECKING:
    from hitplanes.planes.bits.blockers import Blockers
    from hitplanes.planes.broadphase.boxes import Index
    from hitplanes.planes.volumes.volumes import Capsules, Volumes


PREFILTERS = ("auto", "none", "box", "circle", "oriented box", "4 boxes", "polygon", "swept")
"""Names of pre-filters; "k boxes" is one for each k up to BOXES_MAX."""


class Prefilter(NamedTuple):
    """The test before the pixels.

    Parameters
    ----------
    name : one of PREFILTERS, or another number of boxes
    volume : the items' kind of volume, as in `hitplanes.planes.volumes.fit.bounding`; "" for boxes alone, or for none
    """

    name: str
    volume: str = ""


BOX = Prefilter("box")


def prefilter_of(name: object) -> Prefilter:
    """Read the name of a pre-filter: one of PREFILTERS, with any number of boxes."""
    k = boxes_in("prefilter", name)
    if k is not None:
        return Prefilter(f"{k} boxes", f"{k} boxes")
    known = choice("prefilter", name, PREFILTERS)
    if known in PREFILTERS[:3]:
        return Prefilter(known)
    return Prefilter(known, "circle" if known == "swept" else known)


def pairs_of(boxes_xyxy: Ints, shot: Ints, shots: Shots, stack: Stack) -> Pairs:
    """Pairs of placements and items whose boxes share a pixel, front to back.

    Parameters
    ----------
    boxes_xyxy : (P, 4) inclusive boxes of the placements
    shot : (P,) shot of each placement
    """
    placement, rank = np.nonzero(meets(boxes_xyxy[:, None], stack.box_xyxy[None]))
    return Pairs(placement, rank, kinds(stack, rank, refused(stack, rank, shots, shot[placement])))


def may_refuse(stack: Stack, shots: Shots) -> bool:
    """Whether any shot may refuse any item."""
    return shots.choosy or stack.has_unmet


def view_of(pierce: bool, shots: Shots) -> View | None:
    """View of a batch: what all its shots accept; None if they accept different items."""
    if not shots.choosy or not len(shots):
        return OF_ALL[pierce]
    meets, exclude = shots.meets, shots.exclude
    if (meets != meets[0]).any() or (exclude != exclude[0]).any():
        return None
    return View(pierce, int(meets[0]), tuple(sorted(set(exclude[0].tolist()) - {-1})))


def kinds(stack: Stack, rank: Ints, refuses: Bools | None) -> Kinds:
    """What items do to samples: SKIP if the shot refuses the item, else BLOCK of an occluder, else HIT."""
    kind = np.full(len(rank), HIT, np.uint8)
    if stack.has_occluders:
        kind[stack.occluder[rank]] = BLOCK
    if refuses is not None:
        kind[refuses] = SKIP
    return kind


def refused(stack: Stack, rank: Ints, shots: Shots, shot: Ints) -> Bools:
    """Whether shots refuse items: those of which they meet no category, and those of an excluded owner."""
    return refused_by((shots.meets, shots.exclude), stack, rank, shot)


Filters = tuple[Ints, Ints]
"""Of each ray or shot (n,) the bits of the items that it meets, and (n, K) the owners whose items it skips."""


def filters_of(stack: Stack, shots: Shots, shot: Ints) -> Filters | None:
    """Filters of the shots with the given numbers; None if they refuse nothing."""
    return (shots.meets[shot], shots.exclude[shot]) if may_refuse(stack, shots) else None


def refused_by(filters: Filters, stack: Stack, rank: Ints, row: Ints) -> Bools:
    """Whether items are refused by the filters of rows (n,)."""
    meets, exclude = filters
    foreign = (stack.categories[rank] & meets[row]) == 0
    if not exclude.shape[1]:
        return np.asarray(foreign)
    return np.asarray(foreign | (stack.owner[rank][:, None] == exclude[row]).any(axis=1))


@dataclass
class Candidates:
    """The pre-filter of one call.

    Parameters
    ----------
    items, stack : the items, and their order
    prefilter : the test before the pixels
    index : the broad phase; None compares all boxes
    why, why_unindexed : reason of this pre-filter, and of no broad phase
    met : number of pairs of boxes that met so far
    """

    items: Items
    stack: Stack
    prefilter: Prefilter = BOX
    index: Index | None = None
    why: str = "boxes that share a pixel"
    why_unindexed: str = "as asked for"
    met: int = 0

    def meeting(self, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Pairs of boxes (P, 4) and items that share a pixel, as (row, rank); all pairs without a pre-filter."""
        if self.prefilter.name == "none":
            return self.every(len(boxes_xyxy))
        if self.index is None:
            row, rank = met_boxes(boxes_xyxy, self.stack.box_xyxy)
        else:
            m, rows = len(self.stack), np.flatnonzero((boxes_xyxy[:, :2] <= boxes_xyxy[:, 2:]).all(axis=1))
            row, item = self.index.query(self.items, boxes_xyxy[rows])
            row, rank = np.divmod(np.sort(rows[row] * m + self.stack.rank_by_label[item + 1]), m)
        self.met += len(rank)
        return row, rank

    def every(self, n: int) -> tuple[Ints, Ints]:
        """All pairs of n boxes and the items, as (row, rank)."""
        m = len(self.stack)
        self.met += n * m
        return np.repeat(np.arange(n), m), np.tile(np.arange(m), n)

    def near(self, placements: Placements, placement: Ints, rank: Ints) -> Bools:
        """Whether the volumes of pattern and item meet, or floats cannot tell, for pairs whose boxes do."""
        found = placements.count[placement] > 0  # the box of an empty pattern lies within others
        placement, rank, prefilter = placement[found], rank[found], self.prefilter
        if len(rank):
            fired = sorted_once(placements.pattern[placement])
            of_pattern = fired.searchsorted(placements.pattern[placement])
            patterns = pattern_volumes(prefilter.name, [placements.table.patterns[i] for i in fired.tolist()])
            corner_xy = self.stack.box_xyxy[rank, :2] - placements.xy[placement]
            found[found] = _meet(prefilter.volume, self.items, self.stack.rows[rank], corner_xy, patterns, of_pattern)
        return found


@dataclass(eq=False, slots=True)
class QueryContext:
    """What placements are tested against: the stack, its bounds, whether they pierce, the pre-filter, and the plan.

    `blockers` are the items that may shelter pixels; None if there is none, or the weapon needs no line of sight.
    """

    stack: Stack
    bounds: Box | None
    pierce: bool
    candidates: Candidates
    plan: Plan
    blockers: Blockers | None


def near_pairs(placements: Placements, which: Ints, boxes: Ints, context: QueryContext) -> tuple[Ints, Ints]:
    """Pairs of placements and ranks of the items that they may touch, sorted; the plan records how they were found."""
    candidates, plan = context.candidates, context.plan
    row, rank = candidates.meeting(boxes)
    placement = which[row]
    made = row.nbytes + rank.nbytes + placement.nbytes
    if index := candidates.index:
        plan.run("broad phase", f"{index.structure}: {index.followed} boxes placed anew", made)
        made = 0
    if candidates.prefilter.volume:
        plan.run("pre-filter", candidates.why, made)
        near, met = candidates.near(placements, placement, rank), len(rank)
        placement, rank = placement[near], rank[near]
        plan.run("volumes", candidates.prefilter.name, near.nbytes + placement.nbytes + rank.nbytes, (len(rank), met))
        made = 0
    plan.run("pre-filter", candidates.why, made, (len(rank), len(which) * len(context.stack)))
    return placement, rank


_kept: LruCache[tuple[ref[Pattern], str], Volumes] = LruCache(
    BOUNDING_CACHE_BYTES, lambda volume: volume.core().points.nbytes + BOUNDING_BYTES
)
"""Volumes of patterns; the key is a weak reference, so the patterns are not kept alive."""


def near_rays(kind: str, items: Items, rows: Ints, corner_xy: Ints, lines: Lines) -> Bools:
    """Which pairs of a ray and an item may touch: the capsule around the ray meets the item's volume.

    Parameters
    ----------
    corner_xy : (P, 2) corners of the items' masks, about the origin of the ray
    """
    if not len(rows):
        return np.zeros(0, np.bool_)
    capsules = late.volumes.Capsules(lines.start / SUB, (lines.start + lines.step) / SUB, lines.radius / SUB)
    return _meet(kind, items, rows, corner_xy, capsules, np.arange(len(rows)))


def _meet(kind: str, items: Items, rows: Ints, corner_xy: Ints, others: Volumes, of_other: Ints) -> Bools:
    """Which volumes of items, placed by the corners of their masks, meet other volumes."""
    volumes, of = items.bounding(kind, rows)
    found = np.zeros(len(rows), np.bool_)
    for first in range(0, len(rows), PAIRS_AT_ONCE):
        part = slice(first, first + PAIRS_AT_ONCE)
        here = volumes.take(of[part]).translated(corner_xy[part])
        found[part] = late.overlap.overlap(here, others.take(of_other[part]), conservative=True)
    return found


def pattern_volumes(name: str, patterns: Sequence[Pattern]) -> Volumes:
    """Volumes of one or more patterns, none empty, for a pre-filter; each contains the squares of its pixels."""
    return late.volumes.joined(
        [_kept.get((ref(pattern), name), partial(_fitted, name, pattern)) for pattern in patterns]
    )


def _fitted(name: str, pattern: Pattern) -> Volumes:
    if name == "swept":
        return late.fit.capsule(pattern.spans) if pattern.swept is None else _along(pattern.swept)
    if name == "circle":
        return late.fit.least_circle(pattern.spans)
    return late.fit.oriented_box(pattern.spans) if name == "oriented box" else late.fit.convex(pattern.spans, CORNERS)


def _along(swept: Swept) -> Capsules:
    """Capsule around the pixel squares whose centres lie within the radius of a segment, or that meet it."""
    a, b, radius = swept
    return late.volumes.Capsules(a[None] / SUB, b[None] / SUB, max(radius / SUB, GROWN_PX) + GROWN_PX)
