"""The question of shares: how much of a blast lies on each object, by pellets or by every pixel."""

from __future__ import annotations

import numpy as np

from planes.arrays import Ints
from planes.constants import SUB
from planes.grid256 import pixel
from planes.scene import Scene
from weapons.arsenal import Disc, Point, Spread
from weapons.byfire import fired_method
from weapons.decisions import Curve, Decisions, Method, Question
from weapons.hits import Hits
from weapons.pixeltruth import parts_of_discs
from weapons.targets import checked_draw, drawn_places, only_hittable, size_of, targets_of

__all__ = ["spread_question"]

PELLETS = tuple(2**k for k in range(2, 13))

RADIUS_MAX = 64
"""Largest radius of a blast, px: the truth looks at each of its pixels for each shot and object."""


def spread_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask how much of blasts lies on each object, whatever lies in front of it.

    Blasts have a radius of half the median size of the objects, whole px, at most 64. Each has its centre in the box
    of an object that is grown by the radius: see `drawn_places`.

    Parameters
    ----------
    scene : of which the hittable objects take part
    shots : how many blasts
    seed : of the places, and of the pellets
    """
    shots, seed = checked_draw(shots, seed)
    alone = only_hittable(scene)
    targets = targets_of(alone)
    radius = min(max(1, round(size_of(targets) / 2)), RADIUS_MAX)
    place, _, _ = drawn_places(targets, shots, seed, SUB * radius, lambda xy: np.zeros(len(xy), np.bool_))
    at = pixel(place)
    parts = parts_of_discs(at, radius, targets)

    return Question(
        "spread",
        f"How much of a blast of {radius} px lies on each object?",
        shots,
        Decisions(parts.disc, parts.object, parts.nearest_xy.astype(np.float64), parts.pixels / parts.whole),
        "every pixel of the blast is looked up in the mask of every object, at full scale",
        _curves(alone, at, radius, parts.whole, seed),
        by_share=True,
    )


def _curves(alone: Scene, at: Ints, radius: int, whole: int, seed: int) -> tuple[Curve, ...]:
    def by_pellets(n: int) -> Method:
        weapon = Spread(Point(pierce=True), n, radius)
        return fired_method(n, alone, weapon, lambda hits: _shares(hits, n), at=at, seed=seed)

    every = fired_method(None, alone, Disc(radius, pierce=True), lambda hits: _parts(hits, whole), at=at)
    note = "a share is a part of the pellets; it does not tell where it hit"
    return (
        Curve("pellets", "pellets", tuple(map(by_pellets, PELLETS)), note),
        Curve("every pixel", "", (every,)),
    )


def _shares(hits: Hits, pellets: int) -> Decisions:
    return Decisions.of(hits.shot, hits.object, share=hits.samples / pellets)


def _parts(hits: Hits, whole: int) -> Decisions:
    return Decisions(hits.shot, hits.object, hits.first_xy.astype(np.float64), hits.samples / whole)
