"""The scene as the ground of a report: dimmed and enlarged, occluders hatched, masks outlined, samples marked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Image
from planes.compose import label_plane
from planes.items import Role
from planes.render import GROUND, blend, draw_view
from planes.scene import Scene
from planes.spans import Box
from weapons.marks import HEAT, MARKS, TINT, tiled_glyph

__all__ = [
    "HATCH", "OUTLINES", "factor_of", "fill", "ground_of", "heat_boxes", "heat_step", "lay", "mark_heat",
    "mark_samples", "outline", "outline_seen",
]  # fmt: skip

WIDTH, HEIGHT, LARGEST = 1600, 1200, 24
"""A view is enlarged by the greatest whole factor, up to LARGEST, that stays within these pixels."""

DIM = 125
"""How much of the scene's light is left, of 255."""

HATCH = (200, 212, 230)
OUTLINES = {"hit": ((255, 200, 40), 255), "blocked": ((86, 180, 233), 255), "other": ((240, 240, 240), 130)}
"""Colour and opacity of the outline of an object that was hit, that was only blocked, and of any other."""

DASH = 5
"""Dashes of the outline of a blocked object, px."""


def factor_of(view: Box, width: int = WIDTH, height: int = HEIGHT) -> int:
    """Whole factor that enlarges a view to fill a page."""
    return max(1, min(width // (view[2] - view[0] + 1), height // (view[3] - view[1] + 1), LARGEST))


def ground_of(scene: Scene | None, bounds: Sequence[int] | None, view: Box, factor: int, light: int = DIM) -> Image:
    """Draw a view of a scene, or an empty one, as the ground for marks.

    Parameters
    ----------
    scene : what is drawn; None draws the bounds alone
    bounds : of the world (x_min, y_min, x_max, y_max), or None
    view : inclusive box of the world, px
    factor : pixels of the picture for one of the world
    light : how much of the scene's light is left, of 255
    """
    if scene is None:
        dimmed = np.full((view[3] - view[1] + 1, view[2] - view[0] + 1, 3), GROUND, np.uint8)
    else:
        plain = draw_view(scene.items, view, scene.extent()[:2]).astype(np.uint32)
        grey = (plain * (54, 183, 19)).sum(axis=2, keepdims=True) // 256
        dimmed = ((plain * 3 + grey * 2) // 5 * light // 255).astype(np.uint8)
    if bounds is not None:
        _shade_outside(dimmed, view, bounds)
    ground = _enlarged(dimmed, factor)
    if bounds is not None and view != tuple(bounds):
        _frame(ground, view, bounds, factor)
    if scene is not None and len(scene.ids(Role.OCCLUDER)):
        front = label_plane(scene.items.stack(), view)
        _hatch(ground, np.isin(front, scene.ids(Role.OCCLUDER) + 1), factor)
    return ground


def outline_seen(world: Image, scene: Scene, items: Sequence[int], view: Box, factor: int) -> None:
    """Draw the borders of what is seen of objects."""
    front = label_plane(scene.items.stack(), view)
    for item in items:
        outline(world, scene, item, view, factor, "other", front)


def outline(
    world: Image,
    scene: Scene,
    item: int,
    view: Box,
    factor: int,
    kind: str,
    front: npt.NDArray[np.int32] | None = None,
) -> None:
    """Draw the border of an object's mask, inside of its pixels; thicker where it was hit, dashed where blocked.

    With `front`, the labels (h, w) of what is seen in the view, only what is seen of it.
    """
    mask, (x, y) = scene.mask(item)
    left, top = max(x, view[0]), max(y, view[1])
    right, low = min(x + mask.shape[1], view[2] + 1), min(y + mask.shape[0], view[3] + 1)
    if left >= right or top >= low:
        return
    part = mask[top - y : low - y, left - x : right - x]
    if front is not None:
        part = part & (front[top - view[1] : low - view[1], left - view[0] : right - view[0]] == item + 1)
    inside = np.pad(_enlarged(part, factor), 2)
    core = _core(inside)
    if kind != "other" and factor > 1:
        core = _core(core)  # so that it stands out in grey, too
    border = (inside & ~core)[2:-2, 2:-2]
    if kind == "blocked":
        rows, columns = np.ogrid[: border.shape[0], : border.shape[1]]
        border &= (rows + columns) // DASH % 2 == 0
    window = world[(top - view[1]) * factor : (low - view[1]) * factor]
    color, alpha = OUTLINES[kind]
    _lay(window[:, (left - view[0]) * factor : (right - view[0]) * factor], border, color, alpha)


def mark_samples(world: Image, shots: Sequence[Mapping[str, Any]], verdict: str, view: Box, factor: int) -> None:
    """Mark the samples of one verdict, each with the verdict's shape."""
    at = np.zeros((view[3] - view[1] + 1, view[2] - view[0] + 1), np.bool_)
    for shot in shots:
        for y, x_first, x_last in shot["samples"].get(verdict, ()):
            fill(at, view, (x_first, y, x_last, y))
    lay(world, at, verdict, factor)


def lay(world: Image, at: Bools, verdict: str, factor: int) -> None:
    """Mark the set pixels of a plane (h, w) of the view with the shape of a verdict."""
    rows, columns = np.nonzero(at)
    if not len(rows):
        return
    y0, x0 = int(rows.min()), int(columns.min())
    part = _enlarged(at[y0 : rows.max() + 1, x0 : columns.max() + 1], factor)
    shape = tiled_glyph(verdict, factor, part.shape)
    color, alpha = MARKS[verdict]
    window = world[y0 * factor :, x0 * factor :]
    _lay(window, part, color, TINT)
    _lay(window, part & shape, color, alpha)


def mark_heat(world: Image, heat: Mapping[str, Any], verdict: str, view: Box, factor: int) -> None:
    """Colour each cell by its count of samples of one verdict: from one to the most, in steps of the logarithm."""
    runs = heat["counts"].get(verdict, ())
    most = max((count for *_, count in runs), default=0)
    steps = np.zeros((view[3] - view[1] + 1, view[2] - view[0] + 1), np.uint8)
    for count, box in heat_boxes(heat, verdict):
        fill(steps, view, box, 1 + heat_step(count, most))
    there = _enlarged(steps > 0, factor)
    if verdict != "hit":
        _lay(world, there & tiled_glyph(verdict, factor, there.shape), MARKS[verdict][0], MARKS[verdict][1] // 2)
        return
    colors = np.array(HEAT, np.uint8)[np.maximum(steps, 1) - 1]
    blend(world, _enlarged(colors, factor), np.where(there, 235, 0).astype(np.uint8), 0, 0)


def heat_boxes(heat: Mapping[str, Any], verdict: str) -> Iterator[tuple[int, Box]]:
    """Counts of one verdict, and the boxes of the world that they belong to."""
    cell, (x, y) = heat["cell"], heat["origin_xy"]
    for row, first, last, count in heat["counts"].get(verdict, ()):
        yield count, (x + first * cell, y + row * cell, x + (last + 1) * cell - 1, y + (row + 1) * cell - 1)


def fill(plane: npt.NDArray[Any], view: Box, box: Box, value: int = 1) -> None:
    """Set what lies of a box of the world in a plane (h, w) of a view."""
    x0, y0, x1, y1 = (max(v - low, -1) for v, low in zip(box, (view[0], view[1]) * 2, strict=True))
    plane[max(y0, 0) : y1 + 1, max(x0, 0) : x1 + 1] = value


def heat_step(count: int, most: int) -> int:
    """Step of a count on the scale of heat: by its number of binary digits, from 1 to the most."""
    return (count.bit_length() - 1) * (len(HEAT) - 1) // max(most.bit_length() - 1, 1)


def _shade_outside(picture: Image, view: Box, bounds: Sequence[int]) -> None:
    """Darken what lies beyond the bounds."""
    y, x = np.ogrid[view[1] : view[3] + 1, view[0] : view[2] + 1]
    outside = (x < bounds[0]) | (y < bounds[1]) | (x > bounds[2]) | (y > bounds[3])
    picture[outside] = (18, 19, 22)


def _frame(world: Image, view: Box, bounds: Sequence[int], factor: int) -> None:
    """Draw a line around the bounds."""
    corners = [(v - low) * factor for v, low in zip(bounds, (view[0], view[1]) * 2, strict=True)]
    x, y, x_max, y_max = np.clip(corners, -factor, max(world.shape) + factor).tolist()
    cv2.rectangle(world, (x - 1, y - 1), (x_max + factor, y_max + factor), (120, 126, 136), 1)


def _hatch(world: Image, occluding: Bools, factor: int) -> None:
    """Hatch what can be seen of the occluders."""
    y, x = np.ogrid[: world.shape[0], : world.shape[1]]
    stripe = (x + y) % 12 < 2
    _lay(world, _enlarged(occluding, factor) & stripe, HATCH, 80)


def _core(inside: Bools) -> Bools:
    """Pixels of a set whose four neighbours belong to it."""
    up, down = np.roll(inside, 1, axis=0), np.roll(inside, -1, axis=0)
    return np.asarray(inside & up & down & np.roll(inside, 1, axis=1) & np.roll(inside, -1, axis=1))


def _enlarged(plane: npt.NDArray[Any], factor: int) -> npt.NDArray[Any]:
    return np.repeat(np.repeat(plane, factor, axis=0), factor, axis=1)


def _lay(world: Image, where: Bools, color: tuple[int, int, int], alpha: int) -> None:
    """Blend one colour over the pixels of a mask."""
    blend(world, color, np.where(where, alpha, 0).astype(np.uint8), 0, 0)
