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
from weapons.volley import Volley

__all__ = ["near", "pattern_volumes"]


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
    volumes, row = items.bounding(kind, stack.ids[rank])
    fired, of_pattern = np.unique(volley.pattern[placement], return_inverse=True)
    patterns = pattern_volumes(name, [volley.table.patterns[i] for i in fired.tolist()])
    found = np.zeros(len(rank), np.bool_)
    for first in range(0, len(rank), PAIRS_AT_ONCE):
        part = slice(first, first + PAIRS_AT_ONCE)
        shift = stack.box_xyxy[rank[part], :2] - volley.xy[placement[part]]
        here = volumes.take(row[part]).translated(shift)
        found[part] = overlap(here, patterns.take(of_pattern[part]), conservative=True)
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
