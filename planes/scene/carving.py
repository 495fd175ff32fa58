"""Carving: pixels of an object that are shot away, taken out of its own sprite in any pose.

A sprite keeps its frames and shapes as they were made, and beside them cells that are gone. Cells are fine enough that
each of those that a pixel's centre falls on lies in that pixel alone: what is carved in a pose is exact in that pose.
In another pose the hole is where the cells are: it turns, flips and grows with the object.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from ..common.checks import Bools, InputError, Ints, integers, kind_of, shown, within
from ..common.limits import HALF, MASK_AREA_MAX, POSITION_MAX, SUB
from ..grid.fixed_point import over_one, rounded_div, turned
from ..grid.spans import Box, Spans, checked_runs
from .sprite import Carving, Sprite, fits, local_grid
from .variants import ONE, Transform, Variant, cropped, keep_variant

if TYPE_CHECKING:
    from .items import Items
    from .scene import Scene

SLACK = 17, 16  # a fraction above 1, by which cells are finer than they must be: it covers all rounding of positions
CARVED_KNOWN = 16  # most masks before a carved one that it knows: as many holes may be shot between two uses of tiles


class HitPixels(Protocol):
    """What `Scene.carve` asks of the hits of a call of `fire`."""

    scene: Scene

    def object_pixels(self) -> dict[int, Spans]:
        """Pixels that were hit of each object."""


def pixels_to_carve(scene: Scene, pixels: HitPixels | Mapping[int, object]) -> Mapping[int, object]:
    """Pixels of each object of a scene that hits, or a caller, want to be carved."""
    if isinstance(pixels, Mapping):
        return pixels
    if not hasattr(pixels, "object_pixels"):
        raise InputError(f"pixels: expected hits of this scene, or pixels of each id, got {shown(pixels)}")
    if pixels.scene is not scene:
        raise InputError("hits: expected those of this scene as it is, got those of another scene, or of the past")
    return pixels.object_pixels()


def carved_sprites(items: Items, pixels: Mapping[int, object]) -> tuple[list[Sprite], dict[int, int]]:
    """New sprites of the items of which pixels go, and how many pixels each of them loses; all by their rows."""
    sprites, lost = [], {}
    for row, xy in pixels.items():
        variant = copy(items.variants[row])
        variant.transform = items.transforms[row]  # a circle's is kept unturned
        place = f"pixels[{items.id[row]}]"
        hole = hole_of(place, xy, variant.mask, items.corner(row))
        if count := int(np.count_nonzero(hole.hit)):
            with within(place):
                sprites.append(carved(items.sprites[row], variant, hole))
            lost[row] = count
    return sprites, lost


class Hole(NamedTuple):
    """Pixels (h, w) of a mask that go, and the place (x, y) in the mask of the first."""

    hit: Bools
    x: int
    y: int

    def of(self, mask: Bools) -> Bools:
        """The part of the mask that it covers."""
        return mask[self.y : self.y + self.hit.shape[0], self.x : self.x + self.hit.shape[1]]

    @property
    def box(self) -> Box:
        """Its inclusive box in the mask."""
        return self.x, self.y, self.x + self.hit.shape[1] - 1, self.y + self.hit.shape[0] - 1


def hole_of(field: str, pixels: object, mask: Bools, corner_xy: tuple[int, int]) -> Hole:
    """The pixels of a mask (h, w) that are among pixels of the world, given as Spans or (n, 2) whole numbers.

    The mask has its pixel [0, 0] at a corner (x, y); `field` is for errors.
    """
    if isinstance(pixels, Spans):
        with within(field):
            y, x, x_last = checked_runs(pixels.y, pixels.x_first, pixels.x_last)
    else:
        if isinstance(pixels, tuple) and hasattr(pixels, "xy"):  # a named tuple, as samples_at gives
            raise InputError(f"{field}: expected Spans or whole numbers (n, 2), got {kind_of(pixels)}: pass its .xy")
        x, y = integers(field, pixels, (None, 2), -POSITION_MAX, POSITION_MAX).T
        x_last = x
    (height, width), (left, top) = mask.shape, corner_xy
    run = np.flatnonzero((y >= top) & (y < top + height))
    first, last = np.maximum(x[run] - left, 0), np.minimum(x_last[run] - left, width - 1)
    hit, (x0, y0) = Spans.from_runs(y[run] - top, first, last).to_mask()
    hole = Hole(hit, x0, y0)
    hole.hit[:] &= hole.of(mask)
    return hole


def carved(sprite: Sprite, variant: Variant, hole: Hole) -> Sprite:
    """A sprite without some pixels, a hole, of its mask in one pose, a variant; all others of that mask stay."""
    transform = variant.transform
    cells = _fine_cells(sprite, transform)
    gone, per_px, (_, pivot) = cells.gone, cells.per_px, local_grid(sprite, transform.frame)
    rest = _rest_of(variant, hole)
    if not rest.area:
        gone[:] = True  # no sliver that has no pixel in this pose comes back in another
    out = _with_rim(variant.mask, hole)
    near = zip(_cells_near(transform, variant, out, per_px, pivot), gone.shape[::-1], strict=True)
    columns, rows = (np.arange(max(first, 0), min(last, count)) for (first, last), count in near)
    if len(columns) and len(rows):
        x, y = _pixels_of_cells(transform, variant, per_px, pivot, (columns, rows))
        height, width = out.hit.shape  # whose outermost pixels do not go
        part = out.hit[(y - out.y).clip(0, height - 1), (x - out.x).clip(0, width - 1)]
        gone[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] |= part
    gone.flags.writeable = False
    made = replace(sprite, carvings={**sprite.carvings, transform.frame: Carving(gone, per_px)})
    keep_variant(made, rest)
    return made


def _rest_of(variant: Variant, hole: Hole) -> Variant:
    """What is left of a mask."""
    mask = variant.mask.copy()
    hole.of(mask)[hole.hit] = False
    if not (mask[0].any() and mask[-1].any() and mask[:, 0].any() and mask[:, -1].any()):
        return cropped(variant.transform, mask, (variant.pivot_x, variant.pivot_y))
    mask.flags.writeable = False
    left = variant.area - int(np.count_nonzero(hole.hit))
    carved = (variant.uid, hole.box), *variant.carved[: CARVED_KNOWN - 1]
    return Variant(variant.transform, mask, variant.pivot_x, variant.pivot_y, left, carved)


def cells_per_px(transform: Transform) -> int:
    """Number of cells along a pixel that carving in a pose needs, a power of two.

    A cell that a pixel's centre falls on has its own centre at most scale / (2 * number) px from it along each axis of
    the sprite; its centre has to stay in the pixel, half a px around.
    """
    if transform.plain:
        return 1
    x, y = transform.scale_x, transform.scale_y
    reach = max(x, y) if transform.s == 0 else math.isqrt(x * x + y * y) + 1
    number = 1
    while number * ONE * SLACK[1] <= reach * SLACK[0]:
        number *= 2
    return number


def _fine_cells(sprite: Sprite, transform: Transform) -> Carving:
    """A copy of the carving of a sprite's frame with cells that are fine enough for a pose."""
    (width, height), _ = local_grid(sprite, transform.frame)
    known = sprite.carvings.get(transform.frame, Carving(np.zeros((height, width), np.bool_)))
    per_px = max(cells_per_px(transform), known.per_px)
    if not fits(width * per_px, height * per_px):
        cut = f"that can be cut into {per_px} x {per_px} cells a px, {MASK_AREA_MAX} in all"
        raise InputError(f"sprite: expected one {cut}, got {width} x {height} px")
    finer = per_px // known.per_px
    gone = known.gone.copy() if finer == 1 else known.gone.repeat(finer, axis=0).repeat(finer, axis=1)
    return Carving(gone, per_px)


def _with_rim(mask: Bools, hole: Hole) -> Hole:
    """A hole with the pixels beside the mask that touch only pixels of the hole.

    Cells at the rim of a sprite may lie in pixels that are not in the mask; without the pixels that they touch they
    would be left as crumbs. The hole gets a border of pixels that do not go.
    """
    x, y = hole.x - 2, hole.y - 2
    goes = np.pad(hole.hit, 2)
    y_end, x_end = y + goes.shape[0], x + goes.shape[1]
    sides = (max(-y, 0), max(y_end - mask.shape[0], 0)), (max(-x, 0), max(x_end - mask.shape[1], 0))
    held = np.pad(mask[max(y, 0) : y_end, max(x, 0) : x_end], sides)
    return Hole(goes | (_around(goes) & ~_around(held & ~goes) & ~held), x, y)


def _around(mask: Bools) -> Bools:
    """A mask with the eight neighbours of each pixel."""
    grown = mask.copy()
    grown[1:] |= mask[:-1]
    grown[:-1] |= mask[1:]
    wide = grown.copy()
    wide[:, 1:] |= grown[:, :-1]
    wide[:, :-1] |= grown[:, 1:]
    return wide


def _cells_near(
    transform: Transform, variant: Variant, hole: Hole, per_px: int, pivot: tuple[int, int]
) -> list[list[int]]:
    """First and last + 1 of the columns and of the rows of cells that may lie in a hole of a variant."""
    x, y = (np.array([at, at + n]) for at, n in zip(hole[1:], hole.hit.shape[::-1], strict=True))
    corners = np.array([[i, j] for i in x.tolist() for j in y.tolist()]) * SUB - HALF
    corners -= variant.pivot_x, variant.pivot_y
    c, s = transform.direction
    scale = np.array([transform.scale_x, transform.scale_y])
    back = rounded_div(turned(corners, c, -s) * ONE, scale) * transform.signs + pivot + HALF
    margin = 2 + 2 * per_px * ONE // (SUB * int(scale.min()))  # positions were rounded to 1/256 px
    cells = back * per_px // SUB
    bounds: list[list[int]] = np.stack([cells.min(axis=0) - margin, cells.max(axis=0) + margin], axis=1).tolist()
    return bounds


def _pixels_of_cells(
    transform: Transform, variant: Variant, per_px: int, pivot: tuple[int, int], cells: tuple[Ints, Ints]
) -> tuple[Ints, Ints]:
    """Column and row (h, w) of a variant's grid in which the centres of cells lie."""
    (c, s), scales = transform.direction, (transform.scale_x, transform.scale_y)
    x, y = (
        rounded_div(((2 * cell + 1 - per_px) * SUB - 2 * per_px * at) * int(sign) * scale, 2 * per_px * ONE)
        for cell, at, sign, scale in zip(cells, pivot, transform.signs, scales, strict=True)
    )
    across, down = x[None, :], y[:, None]
    return (
        (over_one(across * c - down * s) + variant.pivot_x + HALF) >> 8,
        (over_one(across * s + down * c) + variant.pivot_y + HALF) >> 8,
    )
