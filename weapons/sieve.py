"""What a pre-filter looked at, for reports: the volumes of patterns, the objects tested, the cells opened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from planes.arrays import Floats, InputError, Ints, choice
from planes.constants import SUB
from planes.index import STRUCTURES, Index
from planes.parts import Parts
from planes.scene import Scene
from planes.spans import Box, meets
from planes.volumes import Capsules, Volumes
from weapons.arsenal import ray_parts_of
from weapons.candidates import PREFILTERS, Candidates, Prefilter, prefilter_of
from weapons.hits import Hits
from weapons.narrow import pattern_volumes
from weapons.plan import Plan
from weapons.rayhits import RayHits
from weapons.rays import rays_of
from weapons.trace import Lines
from weapons.tracing import Looked, Range, trace
from weapons.volley import Shots, Volley, volley_of

__all__ = ["Sieve", "outline_of", "rectangle", "sieve_of"]

CELLS_MAX = 4096
"""More cells than these are not told, but for those that were opened."""

PATTERNS_MAX = 64
"""Volumes told of one shot: of its first pellets."""

SHOTS_AT_A_TIME = 2**8
"""Shots of a batch whose cells are told at once."""

ROUND_CORNERS = 72
"""Corners of a circle that is drawn."""


@dataclass(frozen=True, eq=False)
class Sieve:
    """A pre-filter and a broad phase, and what of them a report tells.

    Parameters
    ----------
    view_xyxy : box of the world that is shown
    """

    scene: Scene
    prefilter: Prefilter
    index: Index | None
    view_xyxy: Box

    def to_dict(self, opened: Ints) -> dict[str, Any]:
        """As JSON: names, and the boxes of the cells of the view; `opened` are the numbers of those looked into."""
        number, boxes = self._cells()
        if len(boxes) > CELLS_MAX:
            some = np.flatnonzero(np.isin(number, opened))[:CELLS_MAX]
            number, boxes = number[some], boxes[some]
        cells = [{"box_xyxy": box, "opened": bool(n in opened)} for n, box in zip(number, boxes.tolist(), strict=True)]
        return {
            "prefilter": str(self.prefilter),
            "broadphase": self.index.structure if self.index else "none",
            "cells": cells,
        }

    def told(self, hits: Hits, row: int) -> dict[str, Any]:
        """What the pixels of a shot were compared with, of how many, as JSON; and how many cells were opened for it."""
        shot, stack = hits.shots.take(row, row + 1), self.scene.items.stack()
        if isinstance(hits, RayHits):
            boxes, ranks, lines = self._rays(hits, shot)
            patterns = self._capsules(boxes, lines)
        else:
            volley = volley_of(hits.weapon, shot)
            boxes = _boxes_of(volley)
            candidates = self._candidates()
            placement, ranks = candidates.meeting(volley.boxes)
            if candidates.prefilter.volume:
                ranks = ranks[candidates.near(volley, placement, ranks)]
            patterns = self._patterns(volley)
        return {
            "objects": np.unique(stack.ids[ranks]).tolist(),
            "of": len(stack),
            "opened": len(self._visited(boxes)),
            "patterns": [{"points": points.tolist()} for points in patterns],
        }

    def opened(self, hits: Hits) -> Ints:
        """Numbers of the cells or nodes that were looked into for all shots."""
        if self.index is None:
            return np.zeros(0, np.int64)
        each = (
            self._rays(hits, hits.shots.take(i, i + SHOTS_AT_A_TIME))[0]
            if isinstance(hits, RayHits)
            else _boxes_of(volley_of(hits.weapon, hits.shots.take(i, i + SHOTS_AT_A_TIME)))
            for i in range(0, len(hits.shots), SHOTS_AT_A_TIME)
        )
        return np.unique(np.concatenate([np.zeros(0, np.int64), *(self._visited(boxes) for boxes in each)]))

    def _visited(self, boxes_xyxy: Ints) -> Ints:
        """Numbers of the cells or nodes that are looked into for boxes (n, 4)."""
        if self.index is None:
            return np.zeros(0, np.int64)
        return np.unique(self.index.read(self.scene.items).work(boxes_xyxy.astype(np.float64)).visited[1])

    def _candidates(self) -> Candidates:
        return Candidates(self.scene.items, self.scene.items.stack(), self.prefilter, self.index)

    def _rays(self, hits: RayHits, shots: Shots) -> tuple[Ints, Ints, Lines]:
        """Trace rays again: the boxes (n, 4) that they asked for, ranks compared by their pixels, and the rays."""
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
        """Numbers and boxes (C, 4) of the cells of the view, cut to it."""
        if self.index is None:
            return np.zeros(0, np.int64), np.zeros((0, 4))
        cells = self.index.read(self.scene.items).cell_boxes()
        view = np.array(self.view_xyxy, np.float64)
        seen = meets(view, cells.box) & (cells.box[:, 0] <= cells.box[:, 2])
        low, high = np.maximum(cells.box[seen, :2], view[:2] - 1), np.minimum(cells.box[seen, 2:], view[2:] + 1)
        return cells.number[seen], np.concatenate([low, high], axis=1)

    def _patterns(self, volley: Volley) -> list[Floats]:
        """Outlines of the volumes of the first placements, in the world."""
        some = np.flatnonzero(volley.count > 0)[:PATTERNS_MAX]
        if not len(some) or self.prefilter.name == "none":
            return []
        if not self.prefilter.volume:
            return [rectangle(box) for box in volley.boxes[some]]
        fired = [volley.table.patterns[i] for i in volley.pattern[some].tolist()]
        volumes = pattern_volumes(self.prefilter.name, fired)
        return [outline_of(volumes, i)[0] + volley.xy[p] for i, p in enumerate(some.tolist())]

    def _capsules(self, boxes_xyxy: Ints, lines: Lines) -> list[Floats]:
        """Outlines of the first boxes that rays asked for, or of the capsules around the first rays."""
        if self.prefilter.name == "none":
            return []
        if not self.prefilter.volume:
            return [rectangle(box) for box in boxes_xyxy[:PATTERNS_MAX]]
        some = lines.take(np.arange(min(len(lines), PATTERNS_MAX)))
        capsules = Capsules(some.start / SUB, (some.start + some.step) / SUB, some.radius / SUB)
        return [outline_of(capsules, i)[0] for i in range(len(some))]


def _boxes_of(volley: Volley) -> Ints:
    """Boxes (n, 4) of the placements that have pixels."""
    return volley.boxes[volley.count > 0]


def sieve_of(scene: Scene, view_xyxy: Box, prefilter: str | None, broadphase: str | None) -> Sieve | None:
    """Check what a report shall show of the way to its hits; None for nothing.

    Parameters
    ----------
    prefilter : as for `fire`; None is "box" where a broad phase is named
    broadphase : "grid", "quadtree", "bvh"; None is "none" where a pre-filter is named

    Raises
    ------
    InputError
        If one is not known, or is "auto", or a broad phase is named without a pre-filter.
    """
    if prefilter is None and broadphase is None:
        return None
    wanted = prefilter_of("box" if prefilter is None else prefilter)
    if wanted.name == "auto":
        raise InputError(f"prefilter: expected one to be shown, of {', '.join(PREFILTERS[1:])}, got 'auto'")
    structure = choice("broadphase", "none" if broadphase is None else broadphase, tuple(STRUCTURES))
    if wanted.name == "none" and structure != "none":
        raise InputError(f"broadphase: expected 'none' without a pre-filter, got {structure!r}")
    return Sieve(scene, wanted, None if structure == "none" else scene.index(structure), view_xyxy)


def outline_of(volumes: Volumes, row: int) -> list[Floats]:
    """Outlines (n, 2) of the parts of one row, px: polygons, and what is round with many corners."""
    one = volumes.take([row])
    core = (one.parts if isinstance(one, Parts) else one).core()
    return [
        ring if not core.radius[i] else _round(ring, float(core.radius[i]))
        for i, ring in enumerate(np.split(core.points, core.starts[1:]))
    ]


def rectangle(box_xyxy: Ints) -> Floats:
    """Outline (4, 2) of the squares of an inclusive box of pixels."""
    x, y, x_max, y_max = (v + half for v, half in zip(box_xyxy.tolist(), (-0.5, -0.5, 0.5, 0.5), strict=True))
    return np.array([(x, y), (x_max, y), (x_max, y_max), (x, y_max)])


def _round(points: Floats, radius: float) -> Floats:
    """Outline of a point, or of a segment, grown by a radius: half a circle about each end."""
    a, b = points[0], points[-1]
    along = np.arctan2(*(b - a)[::-1]) if (a != b).any() else 0.0
    turn = along + np.pi / 2 + np.linspace(0, np.pi, ROUND_CORNERS // 2)
    half = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([a + half, b - half])
