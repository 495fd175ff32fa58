"""Report JSON to pixels: the scene dimmed, what was hit outlined, each sample marked by its verdict, and a table.

Everything is drawn in whole numbers; text comes last, as a layer of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from planes.arrays import Bools, Image, InputError
from planes.compose import label_plane
from planes.items import Role
from planes.render import blend, draw_view
from planes.scene import Scene
from planes.spans import Box
from weapons.marks import MARKS, TINT, tiled_glyph
from weapons.panel import HATCH, OUTLINE, OUTLINE_HIT, Text, draw_texts, page_of

__all__ = ["mark_samples", "picture_of_report", "view_of"]

WIDTH, HEIGHT, LARGEST = 1600, 1200, 24
"""The scene is enlarged by the greatest whole factor, up to LARGEST, that stays within these pixels."""

VIEW_MAX = 2048
"""A longer side of the world is not drawn whole: the view is then what the shots reach, px."""

NEAR_OUTSIDE = 48
"""How far beyond the bounds samples are shown, px."""

DIM = 125
"""How much of the scene's light is left, of 255."""


def picture_of_report(report: Mapping[str, Any], scene: Scene, *, text: bool = True) -> Image:
    """Draw a report.

    Parameters
    ----------
    report : as `report_of` makes it
    scene : the scene that it was made of
    text : False leaves the text layer out

    Returns
    -------
    (h, w, 3) bytes, RGB

    Raises
    ------
    InputError
        If the scene is not the one of the report.
    """
    if scene.content_hash() != report["scene"]["hash"]:
        raise InputError(f"scene: expected hash {report['scene']['hash']}, got {scene.content_hash()}: it has changed")
    view = view_of(report, scene)
    factor = min(WIDTH // (view[2] - view[0] + 1), HEIGHT // (view[3] - view[1] + 1), LARGEST)
    factor = max(factor, 1)
    world, texts = _world(report, scene, view, factor)
    page, texts = page_of(report, world, texts)
    if text:
        draw_texts(page, texts)
    return page


def view_of(report: Mapping[str, Any], scene: Scene) -> Box:
    """Box of the world that a picture shows: the scene, and samples a little outside of it."""
    runs = np.array([r for shot in report["shots"] for rs in shot["samples"].values() for r in rs], np.int64)
    x, y, x_max, y_max = scene.extent()
    if max(x_max - x, y_max - y) >= VIEW_MAX:
        middle = np.array([shot["at_xy"] for shot in report["shots"]] or [[x, y]], np.int64)
        low, high = middle.min(axis=0) - VIEW_MAX // 8, middle.max(axis=0) + VIEW_MAX // 8
        x, y = max(x, int(low[0])), max(y, int(low[1]))
        x_max, y_max = min(x_max, int(high[0]), x + VIEW_MAX), min(y_max, int(high[1]), y + VIEW_MAX)
        return x, y, max(x, x_max), max(y, y_max)
    if len(runs):
        reach = 1 << 40 if scene.bounds is None else NEAR_OUTSIDE
        reach = min(reach, VIEW_MAX // 4)
        x, y = max(min(x, int(runs[:, 1].min()) - 2), x - reach), max(min(y, int(runs[:, 0].min()) - 2), y - reach)
        x_max = min(max(x_max, int(runs[:, 2].max()) + 2), x_max + reach)
        y_max = min(max(y_max, int(runs[:, 0].max()) + 2), y_max + reach)
    return x, y, x_max, y_max


def _world(report: Mapping[str, Any], scene: Scene, view: Box, factor: int) -> tuple[Image, list[Text]]:
    """The view, enlarged, with hatching, outlines, marks and badges."""
    plain = draw_view(scene.items, view).astype(np.uint32)
    grey = (plain * (54, 183, 19)).sum(axis=2, keepdims=True) // 256
    dimmed = ((plain * 3 + grey * 2) // 5 * DIM // 255).astype(np.uint8)
    if scene.bounds is not None:
        _shade_outside(dimmed, view, scene.bounds)
    world = _enlarged(dimmed, factor)
    if scene.bounds is not None and view != scene.bounds:
        _frame(world, view, scene.bounds, factor)
    front = label_plane(scene.items.stack(), view)
    _hatch(world, np.isin(front, scene.ids(Role.OCCLUDER) + 1), factor)
    hit = {row["object"] for shot in report["shots"] for row in shot["rows"]}
    for item in scene.ids(Role.HITTABLE).tolist():
        if item not in hit:
            _outline(world, scene, item, view, factor, hit=False)
    for verdict in MARKS:
        mark_samples(world, report, verdict, view, factor)
    for item in sorted(hit):
        _outline(world, scene, item, view, factor, hit=True)
    return world, _badges(world, report, view, factor)


def _shade_outside(picture: Image, view: Box, bounds: Box) -> None:
    """Darken what lies beyond the bounds."""
    y, x = np.ogrid[view[1] : view[3] + 1, view[0] : view[2] + 1]
    outside = (x < bounds[0]) | (y < bounds[1]) | (x > bounds[2]) | (y > bounds[3])
    picture[outside] = (18, 19, 22)


def _frame(world: Image, view: Box, bounds: Box, factor: int) -> None:
    """Draw a line around the bounds."""
    corners = [(v - low) * factor for v, low in zip(bounds, (view[0], view[1]) * 2, strict=True)]
    x, y, x_max, y_max = np.clip(corners, -factor, max(world.shape) + factor).tolist()
    cv2.rectangle(world, (x - 1, y - 1), (x_max + factor, y_max + factor), (120, 126, 136), 1)


def _hatch(world: Image, occluding: Bools, factor: int) -> None:
    """Hatch what can be seen of the occluders."""
    y, x = np.ogrid[: world.shape[0], : world.shape[1]]
    stripe = (x + y) % 12 < 2
    _lay(world, _enlarged(occluding, factor) & stripe, HATCH, 80)


def _outline(world: Image, scene: Scene, item: int, view: Box, factor: int, *, hit: bool) -> None:
    """Draw the border of an object's mask, inside of its pixels."""
    mask, (x, y) = scene.mask(item)
    left, top = max(x, view[0]), max(y, view[1])
    right, low = min(x + mask.shape[1], view[2] + 1), min(y + mask.shape[0], view[3] + 1)
    if left >= right or top >= low:
        return
    inside = np.pad(_enlarged(mask[top - y : low - y, left - x : right - x], factor), 2)
    rows = slice((top - view[1]) * factor, (low - view[1]) * factor)
    columns = slice((left - view[0]) * factor, (right - view[0]) * factor)
    window = world[rows, columns]
    core = _core(inside)
    if hit and factor > 1:
        core = _core(core)  # a thicker line, so that hits stand out in grey, too
    _lay(window, (inside & ~core)[2:-2, 2:-2], OUTLINE_HIT if hit else OUTLINE, 255 if hit else 130)


def _core(inside: Bools) -> Bools:
    """Pixels of a set whose four neighbours belong to it."""
    up, down = np.roll(inside, 1, axis=0), np.roll(inside, -1, axis=0)
    return np.asarray(inside & up & down & np.roll(inside, 1, axis=1) & np.roll(inside, -1, axis=1))


def mark_samples(world: Image, report: Mapping[str, Any], verdict: str, view: Box, factor: int) -> None:
    """Mark the samples of one verdict, each with the verdict's shape."""
    at = np.zeros((view[3] - view[1] + 1, view[2] - view[0] + 1), np.bool_)
    for shot in report["shots"]:
        for y, x_first, x_last in shot["samples"].get(verdict, ()):
            if view[1] <= y <= view[3]:
                at[y - view[1], max(x_first - view[0], 0) : max(x_last - view[0] + 1, 0)] = True
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


def _badges(world: Image, report: Mapping[str, Any], view: Box, factor: int) -> list[Text]:
    """Number the shots: a disc beside the pattern, a line to the shot's pixel, and a cross on it."""
    texts, taken = [], np.zeros(world.shape[:2], np.bool_)
    for shot in report["shots"]:
        for runs in shot["samples"].values():
            for y, x_first, x_last in runs:
                row = slice(max((y - view[1]) * factor, 0), max((y - view[1] + 1) * factor, 0))
                taken[row, max((x_first - view[0]) * factor, 0) : max((x_last - view[0] + 1) * factor, 0)] = True
    for number, shot in enumerate(report["shots"], 1):
        x, y = ((v - low) * factor + factor // 2 for v, low in zip(shot["at_xy"], view[:2], strict=True))
        if not (0 <= x < world.shape[1] and 0 <= y < world.shape[0]):
            continue
        bx, by = _free_spot(taken, x, y)
        cv2.line(world, (x, y), (bx, by), (255, 255, 255), 1)
        _cross(world, x, y, max(3, factor))
        cv2.circle(world, (bx, by), 10, (20, 22, 26), -1)
        cv2.circle(world, (bx, by), 10, (255, 255, 255), 1)
        taken[max(by - 11, 0) : by + 12, max(bx - 11, 0) : bx + 12] = True
        label = str(number)
        texts.append(Text(bx - 4 * len(label), by + 4, label, (255, 255, 255), bold=True))
    return texts


def _free_spot(taken: Bools, x: int, y: int) -> tuple[int, int]:
    """Nearest of some spots around a point whose disc covers no sample and no other badge."""
    height, width = taken.shape
    for distance in range(22, 400, 12):
        step = distance * 7 // 10
        slanted = [(-step, -step), (step, -step), (-step, step), (step, step)]
        for dx, dy in (*slanted, (0, -distance), (-distance, 0), (distance, 0), (0, distance)):
            bx, by = x + dx, y + dy
            inside = 12 <= bx < width - 12 and 12 <= by < height - 12
            if inside and not taken[by - 11 : by + 12, bx - 11 : bx + 12].any():
                return bx, by
    return min(max(x, 12), width - 13), min(max(y - 22, 12), height - 13)


def _cross(world: Image, x: int, y: int, size: int) -> None:
    """Mark the shot's own pixel."""
    for color, thickness in (((20, 22, 26), 3), ((255, 255, 255), 1)):
        cv2.line(world, (x - size, y), (x + size, y), color, thickness)
        cv2.line(world, (x, y - size), (x, y + size), color, thickness)


def _enlarged(plane: np.ndarray[Any, Any], factor: int) -> np.ndarray[Any, Any]:
    return np.repeat(np.repeat(plane, factor, axis=0), factor, axis=1)


def _lay(world: Image, where: Bools, color: tuple[int, int, int], alpha: int) -> None:
    """Blend one colour over the pixels of a mask."""
    blend(world, color, np.where(where, alpha, 0).astype(np.uint8), 0, 0)
