"""The scene as the ground of a report: dimmed and enlarged, occluders hatched, masks outlined, samples marked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Floats, Image, Ints
from planes.compose import label_plane
from planes.items import Role
from planes.render import GROUND, blend, draw_view
from planes.scene import Scene
from planes.spans import Box, Spans, each_pixel
from weapons.marks import HEAT, MARKS, TINT, tiled_glyph

__all__ = ["HATCH", "OUTLINES", "World", "enlarged", "factor_of", "fill", "fill_runs", "heat_boxes", "heat_step"]

WIDTH, HEIGHT, LARGEST = 1600, 1200, 24
"""A view is enlarged by the greatest whole factor, up to LARGEST, that stays within these pixels."""

DIM = 125
"""How much of the scene's light is left, of 255."""

HATCH = (200, 212, 230)
OUTLINES = {
    "hit": ((255, 200, 40), 255),
    "blocked": ((86, 180, 233), 255),
    "other": ((240, 240, 240), 130),
    "now": ((206, 156, 255), 255),
}
"""Colour and opacity of the outline of an object that was hit, that was only blocked, of any other, and of where what
has moved is now."""

DASHED = ("blocked", "now")

DASH = 5
"""Dashes of the outline of a blocked object, px."""

SHADOW, SHADOW_ALPHA = (12, 14, 18), 170
"""What lies under the marks of hits, and its opacity, of 255: gaps between them are dark on any ground."""

HEAT_ALPHA = 235
"""Opacity of the heat of hits, of 255."""

OUTLINES_MAX = 1000
"""More objects than these are not outlined, unless they were hit or blocked."""


def factor_of(view: Box, width: int = WIDTH, height: int = HEIGHT) -> int:
    """Whole factor that enlarges a view to fill a page."""
    return max(1, min(width // (view[2] - view[0] + 1), height // (view[3] - view[1] + 1), LARGEST))


class World:
    """A view of the world, enlarged; what is painted on it is remembered for the legend.

    Parameters
    ----------
    scene : what is drawn; None draws the bounds alone
    bounds : of the world (x_min, y_min, x_max, y_max), or None
    view : inclusive box of the world, px
    factor : pixels of the picture for one of the world
    light : how much of the scene's light is left, of 255
    """

    def __init__(
        self, scene: Scene | None, bounds: Sequence[int] | None, view: Box, factor: int, light: int = DIM
    ) -> None:
        self.scene, self.view, self.factor = scene, view, factor
        self.painted: set[str] = set()
        shape = view[3] - view[1] + 1, view[2] - view[0] + 1
        ground = np.full((*shape, 3), GROUND, np.uint8) if scene is None else _dimmed(scene, view, light)
        if bounds is not None:
            _shade_outside(ground, view, bounds)
        self.image: Image = enlarged(ground, factor)
        if bounds is not None and view != tuple(bounds):
            _frame(self.image, view, bounds, factor)
        if scene is not None and len(scene.ids(Role.OCCLUDER)):
            self._hatch(np.isin(label_plane(scene.items.stack(), view), scene.ids(Role.OCCLUDER) + 1))

    def placed(self, points: Floats) -> Floats:
        """Points (n, 2) of the world in the picture."""
        return np.asarray((points - self.view[:2] + 0.5) * self.factor)

    def mark_samples(self, shots: Sequence[Mapping[str, Any]], verdict: str) -> None:
        """Mark the samples of one verdict, each with the verdict's shape."""
        at = np.zeros((self.view[3] - self.view[1] + 1, self.view[2] - self.view[0] + 1), np.bool_)
        for shot in shots:
            fill_runs(at, self.view, shot["samples"].get(verdict, ()))
        self.lay(at, verdict)

    def lay(self, at: Bools, verdict: str) -> None:
        """Mark the set pixels of a plane (h, w) of the view with the shape of a verdict."""
        rows, columns = np.nonzero(at)
        if not len(rows):
            return
        self.painted.add(verdict)
        y0, x0 = int(rows.min()), int(columns.min())
        part = enlarged(at[y0 : rows.max() + 1, x0 : columns.max() + 1], self.factor)
        shape = tiled_glyph(verdict, self.factor, part.shape)
        color, alpha = MARKS[verdict]
        window = self.image[y0 * self.factor :, x0 * self.factor :]
        if verdict == "hit":
            _lay(window, part, SHADOW, SHADOW_ALPHA)
        _lay(window, part, color, TINT)
        _lay(window, part & shape, color, alpha)

    def mark_heat(self, heat: Mapping[str, Any], verdict: str) -> None:
        """Colour each cell by its count of samples of one verdict: from one to the most, in steps of the logarithm."""
        most = max((run[3] for run in heat["counts"].get(verdict, ())), default=0)
        steps = np.zeros((self.view[3] - self.view[1] + 1, self.view[2] - self.view[0] + 1), np.uint8)
        for count, box in heat_boxes(heat, verdict):
            fill(steps, self.view, box, 1 + heat_step(count, most))
        if not steps.any():
            return
        self.painted.add(verdict)
        there = enlarged(steps > 0, self.factor)
        if verdict != "hit":
            color, alpha = MARKS[verdict]
            _lay(self.image, there & tiled_glyph(verdict, self.factor, there.shape), color, alpha // 2)
            return
        colors = np.array(HEAT, np.uint8)[np.maximum(steps, 1) - 1]
        blend(self.image, enlarged(colors, self.factor), np.where(there, HEAT_ALPHA, 0).astype(np.uint8), 0, 0)

    def outline(self, item: int, kind: str) -> None:
        """Draw the border of an object's mask, inside of its pixels; thicker where it was hit, dashed where blocked."""
        if self.scene is not None:
            self._border(*self.scene.mask(item), kind)

    def outline_pixels(self, spans: Spans, kind: str) -> None:
        """Draw the border of a set of pixels."""
        self._border(*spans.to_mask(), kind)

    def outline_seen(self, items: Sequence[int]) -> None:
        """Draw the borders of what is seen of objects, at most OUTLINES_MAX of them."""
        if self.scene is None:
            return
        x, y = self.view[:2]
        around = (x - 1, y - 1, self.view[2] + 1, self.view[3] + 1)  # where the view ends, an object may not
        front = label_plane(self.scene.items.stack(), around)
        for item in items[:OUTLINES_MAX]:
            mask, (left, top) = self.scene.mask(item)
            box = max(left, around[0]), max(top, around[1])
            end = min(left + mask.shape[1], around[2] + 1), min(top + mask.shape[0], around[3] + 1)
            if box[0] < end[0] and box[1] < end[1]:
                rows, columns = slice(box[1] - y + 1, end[1] - y + 1), slice(box[0] - x + 1, end[0] - x + 1)
                self._border(front[rows, columns] == item + 1, box, "other")

    def _border(self, mask: Bools, corner: tuple[int, int], kind: str) -> None:
        (x, y), (height, width), view, factor = corner, mask.shape, self.view, self.factor
        left, top, right, low = (
            max(x, view[0]),
            max(y, view[1]),
            min(x + width, view[2] + 1),
            min(y + height, view[3] + 1),
        )
        if left >= right or top >= low:
            return
        inside = enlarged(np.pad(mask, 1)[top - y : low - y + 2, left - x : right - x + 2], factor)
        core = _core(inside)
        if kind != "other" and factor > 1:
            core = _core(core)  # so that it stands out in grey, too
        border = (inside & ~core)[factor:-factor, factor:-factor]
        if not border.any():
            return
        self.painted.add(f"object {kind}")
        if kind in DASHED:
            rows, columns = np.ogrid[: border.shape[0], : border.shape[1]]
            border &= (rows + columns) // DASH % 2 == 0
        window = self.image[(top - view[1]) * factor : (low - view[1]) * factor]
        _lay(window[:, (left - view[0]) * factor : (right - view[0]) * factor], border, *OUTLINES[kind])

    def _hatch(self, occluding: Bools) -> None:
        """Hatch what can be seen of the occluders."""
        if not occluding.any():
            return
        self.painted.add("occluder")
        y, x = np.ogrid[: self.image.shape[0], : self.image.shape[1]]
        _lay(self.image, enlarged(occluding, self.factor) & ((x + y) % 12 < 2), HATCH, 80)


def heat_boxes(heat: Mapping[str, Any], verdict: str) -> Iterator[tuple[int, Box]]:
    """Counts of one verdict, and the boxes of the world that they belong to."""
    cell, (x, y) = heat["cell"], heat["origin_xy"]
    for row, first, last, count in heat["counts"].get(verdict, ()):
        yield count, (x + first * cell, y + row * cell, x + (last + 1) * cell - 1, y + (row + 1) * cell - 1)


def fill(plane: npt.NDArray[Any], view: Box, box: Box, value: int = 1) -> None:
    """Set what lies of a box of the world in a plane (h, w) of a view."""
    x0, y0, x1, y1 = (max(v - low, -1) for v, low in zip(box, (view[0], view[1]) * 2, strict=True))
    plane[max(y0, 0) : y1 + 1, max(x0, 0) : x1 + 1] = value


def fill_runs(plane: Bools, view: Box, runs: Sequence[Sequence[int]] | Ints) -> None:
    """Set what lies of runs [y, x_first, x_last] of the world in a plane (h, w) of a view."""
    y, first, last = np.array(runs, np.int64).reshape(-1, 3).T
    seen = (y >= view[1]) & (y <= view[3])
    first, last = np.maximum(first[seen], view[0]), np.minimum(last[seen], view[2])
    run, x = each_pixel(first, np.maximum(last, first - 1))
    plane[y[seen][run] - view[1], x - view[0]] = True


def heat_step(count: int, most: int) -> int:
    """Step of a count on the scale of heat: by its number of binary digits, from 1 to the most."""
    return (count.bit_length() - 1) * (len(HEAT) - 1) // max(most.bit_length() - 1, 1)


def _dimmed(scene: Scene, view: Box, light: int) -> Image:
    """The scene with less light, and a little greyer."""
    plain = draw_view(scene.items, view, scene.extent()[:2]).astype(np.uint32)
    grey = (plain * (54, 183, 19)).sum(axis=2, keepdims=True) // 256
    return np.asarray((plain * 3 + grey * 2) // 5 * light // 255, np.uint8)


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


def _core(inside: Bools) -> Bools:
    """Pixels of a set whose four neighbours belong to it."""
    up, down = np.roll(inside, 1, axis=0), np.roll(inside, -1, axis=0)
    return np.asarray(inside & up & down & np.roll(inside, 1, axis=1) & np.roll(inside, -1, axis=1))


def enlarged(plane: npt.NDArray[Any], factor: int) -> npt.NDArray[Any]:
    """Each pixel of a plane (h, w) or a picture (h, w, 3) as a square of so many pixels a side."""
    return np.repeat(np.repeat(plane, factor, axis=0), factor, axis=1)


def _lay(world: Image, where: Bools, color: tuple[int, int, int], alpha: int) -> None:
    """Blend one colour over the pixels of a mask."""
    blend(world, color, np.where(where, alpha, 0).astype(np.uint8), 0, 0)
