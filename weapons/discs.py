"""Which objects does a disc touch? The shots of the study's first question, and the truth about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planes.arrays import Bools, Floats, Ints
from planes.constants import SCALE_BITS, SUB
from planes.grid256 import pixel
from planes.scene import Scene
from weapons.decisions import Curve, Decisions, Question
from weapons.pixeltruth import parts_of_discs
from weapons.shapetruth import Round, Straight, discs_on_shapes, placed_rings
from weapons.targets import drawn_places, size_of, targets_of

__all__ = ["Discs", "areas_question", "discs_at"]

REACH = 8
"""Objects of the median size are so many times as large as the radius of the disc."""

RADIUS_MAX = 32
"""Largest radius of a disc, px: it is 128 px where the scale is 4, and each shot has 51,000 samples."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Shots, what they are fired at, and where that is known exactly.

    Parameters
    ----------
    scene : objects alone, numbered from 0
    exact : (M,) whether an object is a shape of which the points are known
    at : (N, 2) px; whole where no shape is exact
    aimed : (N,) the object near which a shot is
    radius : px
    """

    scene: Scene
    exact: Bools
    at: Floats
    aimed: Ints
    radius: float


def discs_at(alone: Scene, shots: int, seed: int) -> Discs:
    """Discs near objects: each evenly over the box of one and twice the radius around it.

    Parameters
    ----------
    alone : objects alone, numbered from 0, each with a pixel
    shots : how many
    seed : of their places
    """
    targets, count = targets_of(alone), len(alone)
    exact = np.array([_is_exact(alone, item) for item in range(count)], np.bool_)
    radius = min(max(1, round(size_of(targets) / REACH)), RADIUS_MAX)
    place, _, near = drawn_places(targets, shots, seed, 2 * SUB * radius, lambda xy: np.zeros(len(xy), np.bool_))
    at = place / SUB if exact.any() else pixel(place).astype(np.float64)
    items = np.array([item for item, _, _ in targets] or [0])
    return Discs(alone, exact, at, items[near], float(radius))


def areas_question(discs: Discs, curves: Sequence[Curve]) -> Question:
    """The question, with its true answers."""
    exact, masks = int(discs.exact.sum()), int((~discs.exact).sum())
    told = [f"exact shapes of {exact} objects"] * bool(exact) + [f"masks at full scale of {masks}"] * bool(masks)
    asks = f"Which objects does a disc of radius {discs.radius:g} px touch?"
    truth = " and ".join(told) or "nothing can be hit"
    return Question("areas", asks, len(discs.at), _truth(discs), truth, tuple(curves), aimed=discs.aimed)


def _truth(discs: Discs) -> Decisions:
    """What discs touch, with places and shares: exact shapes, and the pixels of masks."""
    exact = np.flatnonzero(discs.exact)
    of = discs_on_shapes(discs.at, discs.radius, [_shape(discs.scene, item) for item in exact.tolist()])
    masks = [target for target in targets_of(discs.scene) if not discs.exact[target[0]]]
    on = parts_of_discs(np.floor(discs.at + 0.5).astype(np.int64), int(discs.radius), masks)
    return Decisions.joined(
        [
            Decisions(of.shot, exact[of.object], of.xy, of.share),
            Decisions(on.disc, on.object, on.nearest_xy.astype(np.float64), on.pixels / on.whole),
        ]
    )


def _is_exact(scene: Scene, item: int) -> bool:
    """Whether the exact form of an object is known: of polygons, and of circles that are no ellipses."""
    form, outline = scene.items.forms[item], scene.items.sprites[item].outline
    return outline is not None and (outline.radius is None or form.scale_x == form.scale_y)


def _shape(scene: Scene, item: int) -> Round | Straight:
    """The exact form of an object in the world."""
    form, outline = scene.items.forms[item], scene.items.sprites[item].outline
    assert outline is not None  # it is exact
    position = scene.items.position_256[item] / SUB
    scale = form.scale_x / (1 << SCALE_BITS), form.scale_y / (1 << SCALE_BITS)
    if outline.radius is not None:
        return Round(position, outline.radius / SUB * scale[0])
    rings = [ring / SUB for ring in outline.rings]
    return Straight(placed_rings(rings, form.flip, scale, scene.items.angles[item], position))
