"""The pre-filter drawn over the world: the cells that were opened, and the volumes that were tested or passed over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from planes.arrays import Floats, InputError
from planes.bounding import Kind
from planes.render import blend
from planes.scene import Scene
from planes.spans import meets, ragged
from weapons.candidates import prefilter_of
from weapons.marks import LET_THROUGH, PASSED_OVER, SKETCH
from weapons.sieve import outline_of, rectangle
from weapons.strokes import within
from weapons.world import OUTLINES_MAX, World

__all__ = ["draw_cells", "draw_volumes"]

BEYOND = 4.0
"""How far lines are drawn beyond the picture, px: it cuts off what rounding may bend."""

BRUSH = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
"""Pixels that a thick line sets for each of its own."""

OPENED = 26
"""Opacity of the ground of a cell that was opened, of 255."""


def draw_cells(world: World, report: Mapping[str, Any]) -> None:
    """Draw the cells of the broad phase; those that were opened are filled, too."""
    cells = report["filter"]["cells"]
    for opened, name in ((False, "cell"), (True, "cell opened")):
        for cell in cells:
            if cell["opened"] is not opened:
                continue
            x, y, x_max, y_max = cell["box_xyxy"]
            ring = world.placed(np.array([(x, y), (x_max, y), (x_max, y_max), (x, y_max)]))
            if opened:
                (left, top), (right, low) = (
                    np.rint(np.clip(v, -1, max(world.image.shape))) for v in (ring[0], ring[2])
                )
                ground = np.full((max(int(low - top), 0), max(int(right - left), 0)), OPENED, np.uint8)
                blend(world.image, SKETCH[name], ground, int(left), int(top))
            _trace(world, ring, name)


def draw_volumes(world: World, report: Mapping[str, Any], scene: Scene) -> None:
    """Draw the volumes of what lies in view: of items that were passed over, of those tested, and of the shots."""
    if any("tested" not in shot for shot in report["shots"]):
        raise InputError("shots: expected 'tested' in each, as the report has a filter, got one without")
    tested = {item for shot in report["shots"] for item in shot["tested"]["objects"]}
    found = _item_outlines(world, report, scene)
    for name, wanted in ((PASSED_OVER, False), (LET_THROUGH, True)):
        for item, rings in found.items():
            if (item in tested) is wanted:
                _draw(world, rings, name)
    for shot in report["shots"]:
        _draw(world, [np.array(pattern["points"]) for pattern in shot["tested"]["patterns"]], "volume of the shot")


def _item_outlines(world: World, report: Mapping[str, Any], scene: Scene) -> dict[int, list[Floats]]:
    """Outlines of the volumes of items in view, in the world."""
    wanted, stack = prefilter_of(report["filter"]["prefilter"]), scene.items.stack()
    if wanted.name == "none":
        return {}
    reach = np.array(world.view) + np.array([-1, -1, 1, 1]) * (max(world.image.shape) // world.factor)
    seen = np.flatnonzero(meets(reach, stack.box_xyxy))[:OUTLINES_MAX]
    ids = stack.ids[seen]
    if not wanted.volume:
        return {item: [rectangle(box)] for item, box in zip(ids.tolist(), stack.box_xyxy[seen], strict=True)}
    volumes, row = scene.items.bounding(Kind(wanted.volume, wanted.k), ids)
    corner = stack.box_xyxy[seen, :2]
    return {
        item: [ring + corner[i] for ring in outline_of(volumes, int(row[i]))] for i, item in enumerate(ids.tolist())
    }


def _draw(world: World, rings: list[Floats], name: str) -> None:
    for ring in rings:
        _trace(world, world.placed(ring), name)


def _trace(world: World, ring: Floats, name: str) -> None:
    """Draw a closed line through points of the picture, twice as thick around what was let through.

    Not by OpenCV: where a line leaves the picture its pixels depend on the version.
    """
    height, width = world.image.shape[:2]
    begin, end = (np.rint(v) for v in within(ring, np.roll(ring, -1, axis=0), np.array([width, height]), BEYOND))
    step = (end - begin).astype(np.int64)
    edge, place = ragged(np.maximum(np.abs(step).max(axis=1, initial=0), 1))
    count = np.maximum(np.abs(step[edge]).max(axis=1, keepdims=True, initial=0), 1)
    at = begin[edge].astype(np.int64) + (2 * step[edge] * place[:, None] + count) // (2 * count)
    if name == LET_THROUGH:
        at = (at[:, None] + BRUSH).reshape(-1, 2)
    x, y = at[((at >= 0) & (at < (width, height))).all(axis=1)].T
    world.image[y, x] = SKETCH[name]
    if len(x):
        world.painted.add(name)
