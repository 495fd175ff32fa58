"""The second step of the pre-filter: the volumes of items against those of patterns, about the pattern's origin.

Loaded by a call that asks for it, or for which the plan does: most are served best by boxes alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planes import fit
from planes.arrays import Bools, Ints
from planes.bounding import Kind
from planes.constants import CORNERS, GROWN_PX, PAIRS_AT_ONCE, SUB
from planes.items import Items, Stack
from planes.overlap import overlap
from planes.parts import joined
from planes.volumes import Capsules, Volumes
from weapons.pattern import Pattern, Swept
from weapons.trace import Lines
from weapons.volley import Volley

__all__ = ["near", "near_rays", "pattern_volumes"]


def near(name: str, kind: Kind, items: Items, stack: Stack, volley: Volley, placement: Ints, rank: Ints) -> Bools:
    """Tell which pairs of placements and items may touch: whether their volumes meet, or floats cannot tell.

    Parameters
    ----------
    name : of the pre-filter, which chooses the patterns' volumes
    kind : of the items' volumes
    placement, rank : (P,) placements, none with an empty pattern, and places in the stack
    """
    if not len(rank):
        return np.zeros(0, np.bool_)
    fired, of_pattern = np.unique(volley.pattern[placement], return_inverse=True)
    patterns = pattern_volumes(name, [volley.table.patterns[i] for i in fired.tolist()])
    shift = stack.box_xyxy[rank, :2] - volley.xy[placement]
    return _meet(kind, items, stack.ids[rank], shift, patterns, of_pattern)


def near_rays(kind: Kind, items: Items, ids: Ints, corner_xy: Ints, lines: Lines) -> Bools:
    """Tell which rays may touch items, one for each: whether the capsule around a ray meets the item's volume.

    Parameters
    ----------
    corner_xy : (P, 2) of the items' masks, about the origin of the ray
    """
    if not len(ids):
        return np.zeros(0, np.bool_)
    capsules = Capsules(lines.start / SUB, (lines.start + lines.step) / SUB, lines.radius / SUB)
    return _meet(kind, items, ids, corner_xy, capsules, np.arange(len(ids)))


def _meet(kind: Kind, items: Items, ids: Ints, corner_xy: Ints, others: Volumes, of_other: Ints) -> Bools:
    """Tell which volumes of items, placed by the corners of their masks, meet other volumes."""
    volumes, row = items.bounding(kind, ids)
    found = np.zeros(len(ids), np.bool_)
    for first in range(0, len(ids), PAIRS_AT_ONCE):
        part = slice(first, first + PAIRS_AT_ONCE)
        here = volumes.take(row[part]).translated(corner_xy[part])
        found[part] = overlap(here, others.take(of_other[part]), conservative=True)
    return found


def pattern_volumes(name: str, patterns: Sequence[Pattern]) -> Volumes:
    """Volumes of patterns, one or more, none empty, for a pre-filter: rows that contain the pixel squares."""
    return joined([pattern.volume(name, lambda pattern: _fitted(name, pattern)) for pattern in patterns])


def _fitted(name: str, pattern: Pattern) -> Volumes:
    if name == "swept":
        return fit.capsule(pattern.spans) if pattern.swept is None else _along(pattern.swept)
    if name == "circle":
        return fit.least_circle(pattern.spans)
    return fit.oriented_box(pattern.spans) if name == "oriented box" else fit.convex(pattern.spans, CORNERS)


def _along(swept: Swept) -> Capsules:
    """Capsule around the squares whose centres are within the radius of a segment, and those that meet it."""
    a, b, radius = swept
    return Capsules(a[None] / SUB, b[None] / SUB, max(radius / SUB, GROWN_PX) + GROWN_PX)
