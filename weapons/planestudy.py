"""Discs on pixel planes: at each scale, and at full scale behind each pre-filter and each broad phase."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from planes.arrays import Ints
from planes.constants import TRIG_BITS
from weapons.arsenal import Disc, Stencil
from weapons.byfire import fired_method
from weapons.copies import copied, enlarged, scaled, unscaled
from weapons.decisions import Curve, Decisions, Method
from weapons.discs import Discs
from weapons.firing import fire
from weapons.hits import Hits

__all__ = ["plane_curves"]

SCALES = (1 / 8, 1 / 4, 1 / 2, 1, 2, 4)
PREFILTERS = ("none", "box", "circle", "oriented box", "4 boxes", "polygon")
BROADPHASES = ("none", "grid", "quadtree", "bvh")

Fired = list[tuple[Hits, Ints]]
"""Hits, and the numbers of the objects that they were fired at."""


def plane_curves(discs: Discs) -> list[Curve]:
    """The curves of all ways to decide by pixels."""
    scales = tuple(Method(s, partial(_at_scale, discs, s), partial(_decided, scale=s)) for s in SCALES)
    before = tuple(_at_full_scale(discs, word, prefilter=word) for word in PREFILTERS)
    broad = tuple(_at_full_scale(discs, word, broadphase=word) for word in BROADPHASES)
    return [
        Curve("pixel planes", "scale", scales),
        Curve("pixels, pre-filter", "pre-filter", before, "at full scale"),
        Curve("pixels, broad phase", "broad phase", broad, "at full scale"),
    ]


def _at_full_scale(discs: Discs, word: str, **how: str) -> Method:
    """A run of `fire` with something before it."""
    every, weapon = np.arange(len(discs.scene)), Disc(discs.radius, pierce=True)
    return fired_method(word, discs.scene, weapon, lambda hits: _decided([(hits, every)], 1), at=discs.at, **how)


def _at_scale(discs: Discs, scale: float) -> Callable[[], Fired]:
    """A run at a scale.

    Shapes are drawn anew. A mask that is the truth has nothing finer in it: above full scale its pixels, and those of
    the disc, become squares of pixels.
    """
    exact = discs.exact | (scale <= 1)
    drawn, squares = np.flatnonzero(exact), np.flatnonzero(~exact)
    runs: list[Callable[[], tuple[Hits, Ints]]] = []
    if len(drawn) or not len(squares):
        alone, disc = copied(discs.scene, drawn, scale), Disc(discs.radius * scale, pierce=True)
        at = scaled(discs.at, scale)
        runs.append(lambda: (fire(alone, disc, at), drawn))
    if len(squares):
        k = int(scale)
        pixels = np.array(Disc(discs.radius).spans(1 << TRIG_BITS, 0).to_mask()[0])
        middle = k * len(pixels) // 2
        stencil = Stencil(np.kron(pixels, np.ones((k, k), np.bool_)), pivot_xy=(middle, middle), pierce=True)
        big, center = enlarged(discs.scene, squares, k), k * (np.floor(discs.at + 0.5) - len(pixels) // 2) + middle
        runs.append(lambda: (fire(big, stencil, center), squares))
    return lambda: [run() for run in runs]


def _decided(fired: Fired, scale: float) -> Decisions:
    """Hits as decisions: the first pixel, and the part of the disc's pixels that hit."""
    return Decisions.joined(
        [
            Decisions(
                hits.shot,
                ids[hits.object],
                unscaled(hits.first_xy.astype(np.float64), scale),
                hits.samples / hits.verdicts.sum(axis=1)[hits.shot],
            )
            for hits, ids in fired
        ]
    )
