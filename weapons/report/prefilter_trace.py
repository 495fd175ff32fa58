"""Trace of a pre-filter: volumes of patterns, objects tested, cells opened; as JSON, and drawn over the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hitplanes.planes.broadphase.boxes import Index
from hitplanes.planes.common.checks import Floats, InputError, Ints, choice
from hitplanes.planes.common.limits import STRUCTURES, SUB
from hitplanes.planes.grid.rasterize import Lines
from hitplanes.planes.grid.spans import Box, meets, ragged
from hitplanes.planes.scene.render import blend
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.volumes.volumes import Capsules, Parts, Volumes

from ..fire.hits import Hits
from ..fire.plan import Plan
from ..fire.prefilter import PREFILTERS, Candidates, Prefilter, pattern_volumes, prefilter_of
from ..kinds.areas import ray_parts_of
from ..kinds.placements import Placements, Shots, placements_for
from ..rays.contacts import rays_of
from ..rays.ray_hits import RayHits
from ..rays.ray_walk import Looked, Range, trace
from .canvas import OUTLINES_MAX, World
from .symbols import LET_THROUGH, PASSED_OVER, SKETCH, within

CELLS_MAX = 4096  # if there are more cells than these, only opened cells are reported
PATTERNS_MAX = 64  # most volumes reported for one shot, those of its first pellets
SHOTS_AT_A_TIME = 2**8  # shots of a batch whose cells are found at once
ROUND_CORNERS = 72  # number of corners with which a circle is drawn


@dataclass(frozen=True, eq=False)
class PrefilterTrace:
    """Trace of a pre-filter and a broad phase for a report."""

    scene: Scene
    prefilter: Prefilter
    index: Index | None
    view_xyxy: Box  # box of the world that is shown

    def add_tests(self, fired: Sequence[Hits], shots: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Add what was tested to the JSON of shots, of all of hits or of none; return the cells of the view as JSON."""
        each = ((hits, row) for hits in fired for row in range(len(hits.shots)))
        for shot, (hits, row) in zip(shots, each, strict=False):
            shot["tested"] = self.tests_of(hits, row)
        number, boxes = self._cells()
        opened = np.unique(np.concatenate([np.zeros(0, np.int64), *(self.opened(hits) for hits in fired)]))
        if len(boxes) > CELLS_MAX:
            kept = np.flatnonzero(np.isin(number, opened))[:CELLS_MAX]
            number, boxes = number[kept], boxes[kept]
        cells = [{"box_xyxy": box, "opened": bool(n in opened)} for n, box in zip(number, boxes.tolist(), strict=True)]
        return {
            "prefilter": self.prefilter.name,
            "broadphase": self.index.structure if self.index else "none",
            "cells": cells,
        }

    def tests_of(self, hits: Hits, row: int) -> dict[str, Any]:
        """Objects whose pixels a shot was tested against, number of all items, and number of opened cells, as JSON."""
        shot, stack = hits.shots.take(row, row + 1), self.scene.items.stack()
        fired: Lines | Placements
        if isinstance(hits, RayHits):
            boxes, ranks, fired = self._rays(hits, shot)
        else:
            fired = placements_for(hits.weapon, shot)
            boxes = fired.boxes[fired.count > 0]
            candidates = self._candidates()
            placement, ranks = candidates.meeting(fired.boxes)
            if self.prefilter.volume:
                ranks = ranks[candidates.near(fired, placement, ranks)]
        return {
            "objects": np.unique(stack.ids[ranks]).tolist(),
            "of": len(stack),
            "opened": len(self._visited(boxes)),
            "patterns": [{"points": points.tolist()} for points in self._patterns(boxes, fired)],
        }

    def opened(self, hits: Hits) -> Ints:
        """Numbers of the cells or nodes that were opened for all shots."""
        found = [np.zeros(0, np.int64)]
        for first in range(0, len(hits.shots) if self.index else 0, SHOTS_AT_A_TIME):
            shots = hits.shots.take(first, first + SHOTS_AT_A_TIME)
            if isinstance(hits, RayHits):
                found.append(self._visited(self._rays(hits, shots)[0]))
            else:
                placements = placements_for(hits.weapon, shots)
                found.append(self._visited(placements.boxes[placements.count > 0]))
        return np.unique(np.concatenate(found))

    def _visited(self, boxes_xyxy: Ints) -> Ints:
        """Numbers of the cells or nodes that are opened for boxes (n, 4)."""
        if self.index is None:
            return np.zeros(0, np.int64)
        return np.unique(self.index.read(self.scene.items).work(boxes_xyxy.astype(np.float64)).visited[1])

    def _candidates(self) -> Candidates:
        return Candidates(self.scene.items, self.scene.items.stack(), self.prefilter, self.index)

    def _rays(self, hits: RayHits, shots: Shots) -> tuple[Ints, Ints, Lines]:
        """Walk rays again: boxes (n, 4) that they asked for, ranks of items tested by their pixels, and the rays."""
        parts = ray_parts_of(hits.weapon)
        assert parts is not None  # its hits are those of rays
        rays, looked = rays_of(parts, shots), Looked()
        through = Range(
            self.scene.items, self.scene.items.stack(), self.scene.bounds, self._candidates(), Plan(), looked
        )
        trace(rays, parts[2], shots, through)
        boxes = np.concatenate([np.zeros((0, 4), np.int64), *looked.boxes_xyxy])
        ranks = np.concatenate([np.zeros(0, np.int64), *(rank for _, rank in looked.pairs)])
        return boxes, ranks, Lines(rays.start_256, rays.step_256, parts[2].radius_256)

    def _cells(self) -> tuple[Ints, Floats]:
        """Numbers of the cells of the view, and their boxes (C, 4) cut to it."""
        if self.index is None:
            return np.zeros(0, np.int64), np.zeros((0, 4))
        cells = self.index.read(self.scene.items).cell_boxes()
        view = np.array(self.view_xyxy, np.float64)
        seen = meets(view, cells.box) & (cells.box[:, 0] <= cells.box[:, 2])
        low, high = np.maximum(cells.box[seen, :2], view[:2] - 1), np.minimum(cells.box[seen, 2:], view[2:] + 1)
        return cells.number[seen], np.concatenate([low, high], axis=1)

    def _patterns(self, boxes_xyxy: Ints, fired: Placements | Lines) -> list[Floats]:
        """Outlines, in the world, of the first boxes that were asked for, or of the volumes of what was fired first."""
        if self.prefilter.name == "none" or (not len(boxes_xyxy) and isinstance(fired, Placements)):
            return []
        if not self.prefilter.volume:
            return [rectangle(box) for box in boxes_xyxy[:PATTERNS_MAX]]
        if isinstance(fired, Lines):
            lines = fired.take(np.arange(min(len(fired), PATTERNS_MAX)))
            capsules = Capsules(lines.start / SUB, (lines.start + lines.step) / SUB, lines.radius / SUB)
            return [outline_of(capsules, i)[0] for i in range(len(lines))]
        kept = np.flatnonzero(fired.count > 0)[:PATTERNS_MAX]
        volumes = pattern_volumes(self.prefilter.name, [fired.table.patterns[i] for i in fired.pattern[kept].tolist()])
        return [outline_of(volumes, i)[0] + fired.xy[p] for i, p in enumerate(kept.tolist())]


def prefilter_trace(scene: Scene, view_xyxy: Box, prefilter: str | None, broadphase: str | None) -> PrefilterTrace:
    """Make the trace of a pre-filter (None stands for "box") and a broad phase (None stands for "none").

    An InputError says if one is not known, or is "auto", or if a broad phase is named without a pre-filter.
    """
    wanted = prefilter_of("box" if prefilter is None else prefilter)
    if wanted.name == "auto":
        raise InputError(f"prefilter: expected one to be shown, of {', '.join(PREFILTERS[1:])}, got 'auto'")
    structure = choice("broadphase", "none" if broadphase is None else broadphase, tuple(STRUCTURES))
    if wanted.name == "none" and structure != "none":
        raise InputError(f"broadphase: expected 'none' without a pre-filter, got {structure!r}")
    return PrefilterTrace(scene, wanted, None if structure == "none" else scene.derived.index(structure), view_xyxy)


def outline_of(volumes: Volumes, row: int) -> list[Floats]:
    """Outlines (n, 2) of the parts of one row of volumes, px, as polygons; round parts have many corners."""
    one = volumes.take([row])
    core = (one.parts if isinstance(one, Parts) else one).core()
    return [
        ring if not core.radius[i] else _round(ring, float(core.radius[i]))
        for i, ring in enumerate(np.split(core.points, core.starts[1:]))
    ]


def rectangle(box_xyxy: Ints) -> Floats:
    """Outline (4, 2) of the pixel squares of an inclusive box."""
    x, y, x_max, y_max = (v + half for v, half in zip(box_xyxy.tolist(), (-0.5, -0.5, 0.5, 0.5), strict=True))
    return np.array([(x, y), (x_max, y), (x_max, y_max), (x, y_max)])


def _round(points: Floats, radius: float) -> Floats:
    """Outline of a point or a segment grown by a radius, with half a circle about each end."""
    a, b = points[0], points[-1]
    along = np.arctan2(*(b - a)[::-1]) if (a != b).any() else 0.0
    turn = along + np.pi / 2 + np.linspace(0, np.pi, ROUND_CORNERS // 2)
    half = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([a + half, b - half])


BEYOND = 4.0  # lines are drawn up to this distance beyond the picture, px, so that rounding bends only what is cut off

BRUSH = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
"""Offsets (4, 2) of the pixels that a thick line sets for each pixel of a thin one."""

OPENED = 26  # opacity of the ground of a cell that was opened, of 255


def draw_cells(world: World, report: Mapping[str, Any]) -> None:
    """Draw the cells of the broad phase; those that were opened are filled, too."""
    for cell in sorted(report["filter"]["cells"], key=lambda cell: bool(cell["opened"])):
        x, y, x_max, y_max = cell["box_xyxy"]
        ring = np.array([(x, y), (x_max, y), (x_max, y_max), (x, y_max)])
        name = "cell opened" if cell["opened"] else "cell"
        if cell["opened"]:
            ends = np.rint(np.clip(world.placed(ring[::2]), -1, max(world.image.shape)))
            (left, top), (right, low) = ends.astype(np.int64).tolist()
            ground = np.full((max(low - top, 0), max(right - left, 0)), OPENED, np.uint8)
            blend(world.image, SKETCH[name], ground, left, top)
        _draw(world, [ring], name)


def draw_volumes(world: World, report: Mapping[str, Any], scene: Scene) -> None:
    """Draw the volumes in view: those of items passed over, of items tested, and of the shots."""
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
    volumes, row = scene.items.bounding(wanted.volume, stack.rows[seen])
    corner = stack.box_xyxy[seen, :2]
    return {
        item: [ring + corner[i] for ring in outline_of(volumes, int(row[i]))] for i, item in enumerate(ids.tolist())
    }


def _draw(world: World, rings: list[Floats], name: str) -> None:
    """Draw closed lines through points of the world, twice as thick around items that were let through.

    OpenCV is not used, because the pixels of a line that leaves the picture depend on its version.
    """
    height, width = world.image.shape[:2]
    for ring in map(world.placed, rings):
        ends = within(ring, np.roll(ring, -1, axis=0), np.array([width, height]), BEYOND)
        begin, end = (np.rint(v).astype(np.int64) for v in ends)
        step = end - begin
        edge, place = ragged(np.maximum(np.abs(step).max(axis=1, initial=0), 1))
        count = np.maximum(np.abs(step[edge]).max(axis=1, keepdims=True, initial=0), 1)
        at = begin[edge] + (2 * step[edge] * place[:, None] + count) // (2 * count)
        if name == LET_THROUGH:
            at = (at[:, None] + BRUSH).reshape(-1, 2)
        x, y = at[((at >= 0) & (at < (width, height))).all(axis=1)].T
        world.image[y, x] = SKETCH[name]
        if len(x):
            world.painted.add(name)
