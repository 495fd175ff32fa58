"""Rays by other libraries, as their users would ask them: pymunk, shapely and pygame, where they are installed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from planes.arrays import Floats, Ints
from planes.constants import SUB
from weapons.decisions import Curve, Decisions, Method
from weapons.peerworlds import (
    PYGAME_MOST,
    absent,
    hulls_in_pymunk,
    installed,
    masks_in_pygame,
    pairs,
    squares_in_shapely,
)
from weapons.targets import Target

__all__ = ["Segments", "mover_peer_curve", "peer_curves"]


class Segments(NamedTuple):
    """Rays: where they begin and end, (N, 2) px."""

    start_xy: Floats
    end_xy: Floats


def peer_curves(targets: list[Target], rays: Segments) -> tuple[Curve, ...]:
    """Rays against targets, front to back, by each of the peers."""
    return _pymunk_curve(targets, rays), _shapely_curve(targets, rays), _pygame_curve(targets, rays)


def _entered(rays: Segments, shot: Ints, item: Ints, point: Floats) -> Decisions:
    """Decisions of points on borders: the pixel entered is that of half a unit of the grid farther along the ray."""
    way = rays.end_xy[shot] - rays.start_xy[shot]
    length = np.maximum(np.sqrt((way**2).sum(axis=1, keepdims=True)), 1 / SUB)
    return Decisions.of(shot, item, np.rint(point + way / length / (2 * SUB)))


def _pymunk_curve(targets: list[Target], rays: Segments) -> Curve:
    pymunk = installed("pymunk")
    if pymunk is None:
        return absent("pymunk")

    def read(answer: FirstHits) -> Decisions:
        shot, item, alpha = _along(answer)
        return _entered(rays, shot, item, rays.start_xy[shot] + alpha[:, None] * (rays.end_xy - rays.start_xy)[shot])

    note = "an easier question: convex hulls of the masks; in floats"
    return Curve("pymunk", "", (Method(None, lambda: _first_hulls(pymunk, targets, rays, 0.0), read),), note)


def mover_peer_curve(targets: list[Target], flights: Segments, radius: float, moving: bool) -> Curve:
    """Discs that fly along segments against hulls in pymunk, whose thick segments are swept discs.

    Parameters
    ----------
    moving : whether objects move: then there is no curve, as in a query of pymunk all stand still
    """
    pymunk = installed("pymunk")
    if pymunk is None:
        return absent("pymunk")
    if moving:
        return Curve("pymunk", left_out="objects move, and stand still during its queries")

    def read(answer: FirstHits) -> Decisions:
        shot, item, alpha = _along(answer)
        way = flights.end_xy - flights.start_xy
        return Decisions.of(shot, item, flights.start_xy[shot] + alpha[:, None] * way[shot])

    note = "a thick segment, swept, against convex hulls of the masks; in floats"
    return Curve("pymunk", "", (Method(None, lambda: _first_hulls(pymunk, targets, flights, radius), read),), note)


FirstHits = tuple[list[Any], dict[Any, int]]
"""What pymunk says of each segment, and the object of each shape."""


def _first_hulls(pymunk: Any, targets: list[Target], rays: Segments, radius: float) -> Callable[[], FirstHits]:
    """A run that asks for the first hull on each segment."""
    space, item_of = hulls_in_pymunk(pymunk, targets)
    ask, every, shots = space.segment_query_first, pymunk.ShapeFilter(), pairs(rays.start_xy, rays.end_xy)
    return lambda: ([ask(start, end, radius, every) for start, end in shots], item_of)


def _along(answer: FirstHits) -> tuple[Ints, Ints, Floats]:
    """Segments that hit, what, and at which part of them.

    Of a hull in which a segment begins that part is 0, but the point that pymunk tells is the segment's end.
    """
    found, item_of = answer
    hit = [(shot, item_of[one.shape], one.alpha) for shot, one in enumerate(found) if one is not None]
    rows = np.array(hit, np.float64).reshape(-1, 3)
    return rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2]


def _shapely_curve(targets: list[Target], rays: Segments) -> Curve:
    shapely = installed("shapely")
    if shapely is None:
        return absent("shapely")

    def prepare() -> Callable[[], tuple[Ints, Ints, Floats]]:
        shapes = squares_in_shapely(shapely, targets)
        tree = shapely.STRtree(shapes)

        def run() -> tuple[Ints, Ints, Floats]:
            lines = shapely.linestrings(np.stack([rays.start_xy, rays.end_xy], axis=1))
            shot, rank = tree.query(lines, predicate="intersects")
            inside = shapely.intersection(lines[shot], shapes[rank])
            ways = shapely.shortest_line(shapely.points(rays.start_xy)[shot], inside)
            order = np.lexsort((rank, shapely.length(ways), shot))
            first = order[np.flatnonzero(np.diff(shot[order], prepend=-1))]
            return shot[first], rank[first], shapely.get_coordinates(ways[first]).reshape(-1, 2, 2)[:, 1]

        return run

    def read(found: tuple[Ints, Ints, Floats]) -> Decisions:
        shot, rank, point = found
        ids = np.array([item for item, _, _ in targets], np.int64)
        return _entered(rays, shot, ids[rank], point)

    return Curve("shapely", "", (Method(None, prepare, read),), "outlines of the masks; in floats")


def _pygame_curve(targets: list[Target], rays: Segments) -> Curve:
    pygame = installed("pygame")
    if pygame is None:
        return absent("pygame")
    far = max([0.0, *(abs(float(v)) for xy in rays for v in (xy.min(), xy.max()))])
    if far > PYGAME_MOST:
        return Curve("pygame", left_out=f"places beyond {PYGAME_MOST} px do not fit its rectangles")

    def prepare() -> Callable[[], list[tuple[int, int, int] | None]]:
        world = masks_in_pygame(pygame, targets)
        shots = pairs(np.rint(rays.start_xy), np.rint(rays.end_xy))
        return lambda: [_walked(world, start, end) for start, end in shots]

    def read(found: list[tuple[int, int, int] | None]) -> Decisions:
        hit = [(shot, targets[one[0]][0], *one[1:]) for shot, one in enumerate(found) if one is not None]
        rows = np.array(hit, np.int64).reshape(-1, 4)
        return Decisions.of(rows[:, 0], rows[:, 1], rows[:, 2:].astype(np.float64))

    note = "from whole pixel to whole pixel: the line is clipped to each rectangle, then its mask is read each px"
    return Curve("pygame", "", (Method(None, prepare, read),), note)


def _walked(
    world: list[tuple[Any, Any]], start: tuple[float, ...], end: tuple[float, ...]
) -> tuple[int, int, int] | None:
    """First mask on a line: its place in the list, and the pixel."""
    ways = []
    for rank, (rect, _) in enumerate(world):
        clipped = rect.clipline(start, end)
        if clipped:
            ways.append((math.dist(start, clipped[0]), rank, clipped))
    best: tuple[float, int, int, int] | None = None
    for far, rank, clipped in sorted(ways):
        if best is not None and far > best[0]:
            break
        pixel = _first_set(*world[rank], clipped)
        if pixel is not None:
            found = (math.dist(start, pixel), rank, *pixel)
            best = found if best is None else min(best, found)
    return None if best is None else best[1:]


def _first_set(rect: Any, mask: Any, way: Any) -> tuple[int, int] | None:
    """First pixel of a mask on a line inside its rectangle."""
    (x, y), (x_end, y_end) = way
    steps = max(abs(x_end - x), abs(y_end - y), 1)
    for k in range(steps + 1):
        at = x + round(k * (x_end - x) / steps), y + round(k * (y_end - y) / steps)
        if mask.get_at((at[0] - rect.x, at[1] - rect.y)):
            return at
    return None
