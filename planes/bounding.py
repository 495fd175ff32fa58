"""Bounding volumes of items: fitted to a frame once, and moved with the object from there.

A pixel of a turned or scaled mask is set when its centre, mapped back, lies in a set pixel of the frame. So the frame's
volume, moved by the pose, holds the centres, and grown by half a pixel's diagonal it holds the pixel squares. Flips and
quarter turns are exact and need no growing. A shape has no frame: its volume is fitted to its mask as it is.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planes import fit
from planes.arrays import Bools, Floats, Ints
from planes.constants import (
    BOUNDING_BYTES,
    BOUNDING_CACHE_BYTES,
    BOUNDS_SLACK,
    CORNERS,
    GROWN_PX,
    PLACE,
    SCALE_BITS,
    SHARP,
    SUB,
    TRIG_BITS,
    TRIG_ERROR,
)
from planes.forms import Form
from planes.kept import Kept
from planes.parts import Parts, joined
from planes.rings import neighbours
from planes.sprite import Sprite, Variant, frame_pivot
from planes.volumes import Circles, Core, Polygons, Volumes

__all__ = ["KINDS", "Bounds", "Kind", "bounding", "fitted", "moved", "shifted"]

KINDS = ("circle", "oriented box", "boxes", "polygon")


@dataclass(frozen=True)
class Kind:
    """A kind of bounding volume, one of KINDS; `k` is the most boxes of "boxes"."""

    name: str
    k: int = 1


def bounding(kind: Kind, sprites: Sequence[Sprite], variants: Sequence[Variant]) -> Volumes:
    """Volumes of variants of sprites, one or more, one row each: they contain the pixel squares of the variants' masks.

    Coordinates are px, with pixel [0, 0] of each mask about the origin, and whole multiples of PLACE but for circles:
    a shift by whole pixels rounds nothing.
    """
    return joined([_bounding_of(kind, sprite, variant) for sprite, variant in zip(sprites, variants, strict=True)])


class Bounds:
    """Volumes of one kind of the masks in use, made when they are first asked for; threads may ask.

    Parameters
    ----------
    kind : of the volumes
    """

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self._volumes: Volumes | None = None
        self._masks = np.zeros(0, np.int64)
        self._row = np.zeros(0, np.int64)
        self._lock = threading.Lock()

    def rows(
        self, masks: Ints, sprites: Sequence[Sprite], variants: Sequence[Variant], ids: Ints, items: int
    ) -> tuple[Volumes, Ints]:
        """Volumes of masks, and the rows of those of items.

        Parameters
        ----------
        masks : (n,) a number for each item's mask, never used for another
        sprites, variants : of all items
        ids : (n,) which of them
        items : how many masks may be in use; many more than that are not kept
        """
        used, first, of = np.unique(masks, return_index=True, return_inverse=True)
        with self._lock:
            if len(self._masks) + len(used) > 2 * items + BOUNDS_SLACK:
                self._masks, self._row, self._volumes = masks[:0], masks[:0], None
            volumes = self._volumes = self._with(used, ids[first], sprites, variants)
            return volumes, np.asarray(self._row[np.searchsorted(self._masks, used)][of])

    def _with(self, used: Ints, ids: Ints, sprites: Sequence[Sprite], variants: Sequence[Variant]) -> Volumes:
        """The volumes, with those of masks that are new."""
        new = ~np.isin(used, self._masks)
        if self._volumes is not None and not new.any():
            return self._volumes
        items = ids[new].tolist()
        more = bounding(self.kind, [sprites[i] for i in items], [variants[i] for i in items])
        every = np.concatenate([self._masks, used[new]])
        order = np.argsort(every)
        self._masks, self._row = (
            every[order],
            np.concatenate([self._row, len(self._row) + np.arange(len(items))])[order],
        )
        return more if self._volumes is None else joined([self._volumes, more])


def shifted(volumes: Volumes, xy: Ints) -> Volumes:
    """Move rows by whole pixels (n, 2); where that rounds the centre of a circle, the circle grows by as much.

    Corners are whole multiples of PLACE: up to 2**36 px from the origin nothing is rounded.
    """
    there = volumes.translated(xy)
    if not isinstance(volumes, Circles) or not isinstance(there, Circles):
        return there
    rounded = np.where(there.center - xy == volumes.center, 0, np.spacing(np.abs(there.center))).sum(axis=1)
    return Circles(there.center, np.where(rounded > 0, np.nextafter(volumes.radius + rounded, np.inf), volumes.radius))


def fitted(kind: Kind, mask: Bools) -> Volumes:
    """Fit a volume of a kind to a mask with a pixel or more: one row, in px about its pixel [0, 0]."""
    if kind.name == "circle":
        return fit.least_circle(mask)
    if kind.name == "oriented box":
        return fit.oriented_box(mask)
    return fit.boxes(mask, kind.k) if kind.name == "boxes" else fit.convex(mask, CORNERS)


def moved(volume: Volumes, pivot_256: tuple[int, int], variant: Variant) -> Volumes:
    """Move a volume of a frame with its object, so that it contains the pixel squares of the variant's mask.

    Parameters
    ----------
    volume : one row that contains the pixel squares of the frame, in px about its pixel [0, 0]
    pivot_256 : pivot of the frame, in 1/256 px from there
    variant : the mask that the frame's flips, scale and turn make

    Returns
    -------
    one row, in px about pixel [0, 0] of the variant's mask: circles stay circles; boxes and polygons become polygons
    """
    form = variant.key[1]
    parts = volume.parts if isinstance(volume, Parts) else volume
    core = parts.core()
    offset = np.array(pivot_256) / SUB
    place = np.array([variant.pivot_x, variant.pivot_y]) / SUB
    most = max(form.scale_x, form.scale_y) / (1 << SCALE_BITS)
    reach = float(np.abs(core.points - offset).max() + core.radius.max()) * most
    grown = 0.0 if form.plain else GROWN_PX + reach * TRIG_ERROR
    if isinstance(parts, Circles):
        return Circles(_turned(core.points - offset, form) + place, core.radius * most + grown)
    points = _turned(core.points - offset, form) + place
    rings = Polygons.around(_placed(_grown(replace(core, points=points), grown)), core.starts)
    return Parts(rings, volume.starts) if isinstance(volume, Parts) else rings


def _turned(points: Floats, form: Form) -> Floats:
    """Vectors from the pivot, flipped, scaled and turned as the mask is."""
    x, y = (points / (1 << SCALE_BITS)).T * np.array([[form.scale_x], [form.scale_y]])
    x = -x if "x" in form.flip else x
    y = -y if form.flip in ("y", "xy") else y
    c, s = form.c, form.s
    for _ in range(form.quarter):
        c, s = -s, c
    return np.stack([x * c - y * s, x * s + y * c], axis=1) / (1 << TRIG_BITS)


def _grown(core: Core, by: float) -> Floats:
    """Corners of convex rings of which all edges move outward; a ring with a needle's point becomes its box."""
    if not by:
        return core.points
    outward, sharp = _outward(core)
    points = core.points + outward * by
    if not sharp.any():
        return points
    for first, count in zip(core.starts[sharp].tolist(), core.counts[sharp].tolist(), strict=True):
        ring = core.points[first : first + count]
        (x, y), (x_max, y_max) = ring.min(axis=0) - by, ring.max(axis=0) + by
        box = np.array([(x, y), (x_max, y), (x_max, y_max), (x, y_max)])
        points[first : first + count] = box[np.minimum(np.arange(count), 3)]
    return points


def _outward(core: Core) -> tuple[Floats, Bools]:
    """How far each corner of convex rings moves when all edges move outward by 1 px, and which rings have needles."""
    before, after = neighbours(core.starts, len(core.points))
    step = core.points[after] - core.points
    turning = step[before, 0] * step[:, 1] - step[before, 1] * step[:, 0]
    sense = np.where(np.add.reduceat(turning, core.starts) < 0, -1, 1).repeat(core.counts)  # a flip turns a ring round
    normal = np.stack([step[:, 1], -step[:, 0]], axis=1) * (sense / np.sqrt((step**2).sum(axis=1)))[:, None]
    open_ = 1 + (normal[before] * normal).sum(axis=1)
    sharp = np.minimum.reduceat(open_, core.starts) < SHARP
    return (normal[before] + normal) / np.maximum(open_, SHARP)[:, None], np.asarray(sharp)


def _placed(points: Floats) -> Floats:
    return np.rint(points / PLACE) * PLACE


def _bytes(row: Volumes) -> int:
    core = row.parts.core() if isinstance(row, Parts) else row.core()
    return core.points.nbytes + BOUNDING_BYTES


_fitted: Kept[tuple[Any, ...], Volumes] = Kept(BOUNDING_CACHE_BYTES, _bytes)


def _bounding_of(kind: Kind, sprite: Sprite, variant: Variant) -> Volumes:
    """The volume of a shape's mask as it is; or that of the frame, moved."""
    if sprite.outline is not None:
        return _fitted.get((kind, *variant.key), lambda: _on_grid(fitted(kind, variant.mask)))
    number = variant.key[1].frame
    frame = sprite.frames[number]
    volume = _fitted.get((kind, sprite.uid, number), lambda: _on_grid(fitted(kind, frame.mask)))
    return moved(volume, frame_pivot(sprite, frame), variant)


def _on_grid(volume: Volumes) -> Volumes:
    """Circles as they are; of others polygons, corners on whole multiples of PLACE, outward where they are moved."""
    if isinstance(volume, Parts):
        return Parts(_on_grid(volume.parts), volume.starts)
    if isinstance(volume, Circles):
        return volume
    core = volume.core()
    if (_placed(core.points) == core.points).all():
        return Polygons.around(core.points, core.starts)
    return Polygons.around(_placed(_grown(core, 2 * PLACE)), core.starts)
