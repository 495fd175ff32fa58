"""Copies of the objects of a scene that can be hit, alone and at any scale: what the study fires at."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, Ints
from planes.constants import SCALE_BITS, SUB
from planes.scene import Scene
from planes.sprite import Sprite

__all__ = ["copied", "enlarged", "scaled", "unscaled"]


def scaled(xy: Floats, factor: float) -> Floats:
    """Points of a world of which each pixel becomes `factor` of them: edges of pixels stay edges of pixels."""
    return (xy + 0.5) * factor - 0.5


def unscaled(xy: Floats, factor: float) -> Floats:
    """Points of the scaled world in that of before."""
    return (xy + 0.5) / factor - 0.5


def copied(scene: Scene, ids: Ints, factor: float = 1.0) -> Scene:
    """Objects alone, numbered from 0 in the order given, at a scale: no bounds, nothing in front, layers kept.

    Shapes are filled from their points at that scale, and masks are mapped back from their frames.
    """
    alone, items = Scene(), scene.items
    for item in ids.tolist():
        form = items.forms[item]
        alone.add(
            items.sprites[item],
            scaled(items.position_256[item] / SUB, factor).tolist(),
            angle=items.angles[item],
            scale=[v / (1 << SCALE_BITS) * factor for v in (form.scale_x, form.scale_y)],
            flip=form.flip,
            frame=form.frame,
            layer=int(items.layer[item]),
            velocity_xy=(items.velocity_256[item] / SUB * factor).tolist(),
            name=items.names[item],
        )
    return alone


def enlarged(scene: Scene, ids: Ints, factor: int) -> Scene:
    """Objects alone as `copied` numbers them, each pixel of their masks as a square of `factor` by `factor`."""
    alone, square = Scene(), np.ones((factor, factor), np.bool_)
    for item in ids.tolist():
        mask, corner_xy = scene.mask(item)
        big = Sprite.from_mask(np.kron(mask, square), pivot_xy=(0, 0))
        alone.add(big, tuple(factor * v for v in corner_xy), layer=int(scene.items.layer[item]))
    return alone
