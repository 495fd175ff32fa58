"""Discs by other libraries, as their users would ask them: pymunk, shapely and pygame, where they are installed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from planes.arrays import Floats, Ints
from planes.constants import TRIG_BITS
from weapons.arsenal import Disc
from weapons.decisions import Curve, Decisions, Method
from weapons.discs import Discs
from weapons.peerworlds import (
    PYGAME_MOST,
    absent,
    hulls_in_pymunk,
    installed,
    masks_in_pygame,
    pairs,
    squares_in_shapely,
)
from weapons.targets import Target, targets_of

__all__ = ["area_peer_curves"]


def area_peer_curves(discs: Discs) -> list[Curve]:
    """Discs against the objects, by each of the peers."""
    targets = targets_of(discs.scene)
    asked = {"pymunk": _pymunk_curve, "shapely": _shapely_curve, "pygame": _pygame_curve}
    modules = {name: installed(name) for name in asked}
    return [curve(modules[name], targets, discs) if modules[name] else absent(name) for name, curve in asked.items()]


def _pymunk_curve(pymunk: Any, targets: list[Target], discs: Discs) -> Curve:
    def prepare() -> Callable[[], list[tuple[int, int, Any]]]:
        space, item_of = hulls_in_pymunk(pymunk, targets)
        ask, every, shots = space.point_query, pymunk.ShapeFilter(), pairs(discs.at)
        return lambda: [
            (shot, item_of[one.shape], one.point)
            for shot, (at,) in enumerate(shots)
            for one in ask(at, discs.radius, every)
        ]

    def read(found: list[tuple[int, int, Any]]) -> Decisions:
        rows = np.array([(shot, item, *point) for shot, item, point in found], np.float64).reshape(-1, 4)
        return Decisions.of(rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2:])

    note = "an easier question: convex hulls of the masks; in floats; the place is one of the edge"
    return Curve("pymunk", "", (Method(None, prepare, read),), note)


def _shapely_curve(shapely: Any, targets: list[Target], discs: Discs) -> Curve:
    def prepare() -> Callable[[], tuple[Any, Ints, Ints]]:
        shapes = squares_in_shapely(shapely, targets)
        tree = shapely.STRtree(shapes)

        def run() -> tuple[Any, Ints, Ints]:
            shot, rank = tree.query(shapely.points(discs.at), predicate="dwithin", distance=discs.radius)
            return shapes, shot, rank

        return run

    def read(found: tuple[Any, Ints, Ints]) -> Decisions:
        shapes, shot, rank = found
        points = shapely.points(discs.at[shot])
        ways = shapely.shortest_line(points, shapes[rank])
        nearest: Floats = shapely.get_coordinates(ways).reshape(-1, 2, 2)[:, 1]
        ids = np.array([item for item, _, _ in targets], np.int64)
        return Decisions.of(shot, ids[rank], nearest)

    return Curve("shapely", "", (Method(None, prepare, read),), "outlines of the pixels of the masks; in floats")


def _pygame_curve(pygame: Any, targets: list[Target], discs: Discs) -> Curve:
    if len(discs.at) and np.abs(discs.at).max() > PYGAME_MOST:
        return Curve("pygame", left_out=f"places beyond {PYGAME_MOST} px do not fit its rectangles")
    disc = np.array(Disc(discs.radius).spans(1 << TRIG_BITS, 0).to_mask()[0])
    corner = np.floor(discs.at + 0.5).astype(np.int64) - len(disc) // 2

    def prepare() -> Callable[[], list[tuple[int, int, int, Any]]]:
        world = masks_in_pygame(pygame, targets)
        ((box, pattern),) = masks_in_pygame(pygame, [(0, disc, (0, 0))])
        rects, shots = [rect for rect, _ in world], pairs(corner.astype(np.float64))

        def run() -> list[tuple[int, int, int, Any]]:
            found = []
            for shot, (at,) in enumerate(shots):
                box.topleft = (int(at[0]), int(at[1]))
                for rank in box.collidelistall(rects):
                    rect, mask = world[rank]
                    offset = rect.x - box.x, rect.y - box.y
                    pixels = pattern.overlap_area(mask, offset)
                    if pixels:
                        found.append((shot, rank, pixels, pattern.overlap(mask, offset)))
            return found

        return run

    def read(found: list[tuple[int, int, int, Any]]) -> Decisions:
        rows = np.array([(s, r, n, *xy) for s, r, n, xy in found], np.int64).reshape(-1, 5)
        ids = np.array([item for item, _, _ in targets], np.int64)
        place = (rows[:, 3:] + corner[rows[:, 0]]).astype(np.float64)
        return Decisions(rows[:, 0], ids[rows[:, 1]], place, rows[:, 2] / disc.sum())

    note = "masks; a place is the first pixel that it finds, not the nearest"
    return Curve("pygame", "", (Method(None, prepare, read),), note)
