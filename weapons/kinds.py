"""Kinds of shapes: what an object of a scene looks like, and a scene with each kind, for the study."""

from __future__ import annotations

import math

import numpy as np

from planes import fit
from planes.arrays import Bools
from planes.scene import Scene
from planes.sprite import Sprite

__all__ = ["kind_of", "kinds_scene"]

ROUND, LONG, HOLE, CONCAVE, PARTS, TURNED, COMPACT = (
    "round", "long and thin", "with a hole", "concave", "several parts", "turned", "compact",
)  # fmt: skip

ROUND_LEAST = 0.85
"""Part of its least circle that a round mask fills."""

LONG_LEAST = 3.0
"""Sides of the oriented box of a long and thin mask, as a ratio."""

CONCAVE_MOST = 0.85
"""Part of its hull that a concave mask fills."""

TURNED_DEG = 15.0
"""Least angle to the axes of what counts as turned, degrees."""


def kind_of(scene: Scene, item: int) -> str:
    """A word for the shape of an object that has a pixel: the first that fits, from the top of the list."""
    mask, _ = scene.mask(item)
    off = abs((scene.items.angles[item] + 45) % 90 - 45)
    sides, radius = _oriented_sides(mask), float(fit.least_circle(mask).radius[0])
    if _regions(mask, diagonal=True) > 1:
        return PARTS
    if _regions(~np.pad(mask, 1), diagonal=False) > 1:
        return HOLE
    if mask.sum() >= ROUND_LEAST * math.pi * radius**2:
        return ROUND
    if off >= TURNED_DEG:
        return TURNED
    if max(sides) >= LONG_LEAST * min(sides):
        return LONG
    return CONCAVE if mask.sum() < CONCAVE_MOST * _hull_area(mask) else COMPACT


def kinds_scene() -> Scene:
    """A scene with one exact shape of each kind, at places between the pixels."""
    scene = Scene(size_wh=(480, 320), name="shapes by kind")
    star = [(r * math.sin(a), -r * math.cos(a)) for r, a in ((30 - 18 * (k % 2), k * math.pi / 5) for k in range(10))]
    octagon = [(math.cos((k + 0.5) * math.pi / 4), math.sin((k + 0.5) * math.pi / 4)) for k in range(8)]
    ring = [[(30 * x, 30 * y) for x, y in octagon], [(19 * x, 19 * y) for x, y in octagon]]
    bars = [
        [(x - 6, y - 22), (x + 6, y - 22), (x + 6, y + 22), (x - 6, y + 22)] for x, y in ((-22, 4), (0, -4), (22, 4))
    ]
    for name, sprite, at, angle in (
        (ROUND, Sprite.circle(24), (80.3, 80.6), 0),
        (LONG, Sprite.box(92, 7), (240.7, 80.2), 0),
        (HOLE, Sprite.polygon(ring[0], holes=ring[1:]), (400.4, 80.9), 0),
        (CONCAVE, Sprite.polygon(star), (80.8, 230.3), 0),
        (PARTS, Sprite.polygon(bars[0], holes=bars[1:]), (240.1, 230.7), 0),
        (TURNED, Sprite.box(68, 22), (400.6, 230.4), 45),
    ):
        scene.add(sprite, at, angle=angle, name=name)
    return scene


def _regions(mask: Bools, diagonal: bool) -> int:
    """Number of connected regions of set pixels."""
    import cv2  # a study of shapes alone; a shot never counts regions

    return int(cv2.connectedComponents(mask.astype(np.uint8), connectivity=8 if diagonal else 4)[0]) - 1


def _oriented_sides(mask: Bools) -> tuple[float, float]:
    corners = fit.oriented_box(mask).points
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    return math.sqrt(float((first**2).sum())), math.sqrt(float((second**2).sum()))


def _hull_area(mask: Bools) -> float:
    x, y = fit.hull(mask).points.T
    return abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) / 2
