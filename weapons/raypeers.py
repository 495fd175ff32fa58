"""Rays by other libraries, as their users would ask them: pymunk, shapely and pygame, where they are installed."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from planes import fit
from planes.arrays import Bools, Floats, Ints
from planes.constants import SUB
from planes.spans import Spans
from weapons.decisions import Curve, Decisions, Method
from weapons.targets import Target

__all__ = ["Segments", "peer_curves"]

WHOLE_MAX = 2**30
"""pygame's rectangles hold C ints: places within this, and twice it for a sum."""


class Segments(NamedTuple):
    """Rays: where they begin and end, (N, 2) px."""

    start_xy: Floats
    end_xy: Floats


def peer_curves(targets: list[Target], rays: Segments) -> tuple[Curve, ...]:
    """Rays against targets, front to back, by each of the peers."""
    return _pymunk_curve(targets, rays), _shapely_curve(targets, rays), _pygame_curve(targets, rays)


def _installed(name: str) -> Any:
    """A module, or None where it is not installed."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        return import_module(name)
    except ImportError:
        return None


def _absent(name: str) -> Curve:
    return Curve(name, left_out=f"{name} is not installed")


def _entered(rays: Segments, shot: Ints, item: Ints, point: Floats) -> Decisions:
    """Decisions of points on borders: the pixel entered is that of half a unit of the grid farther along the ray."""
    way = rays.end_xy[shot] - rays.start_xy[shot]
    length = np.maximum(np.sqrt((way**2).sum(axis=1, keepdims=True)), 1 / SUB)
    return Decisions.of(shot, item, np.rint(point + way / length / (2 * SUB)))


def _pymunk_curve(targets: list[Target], rays: Segments) -> Curve:
    pymunk = _installed("pymunk")
    if pymunk is None:
        return _absent("pymunk")

    def prepare() -> Callable[[], tuple[list[Any], dict[Any, int]]]:
        space, item_of = pymunk.Space(), {}
        for item, mask, corner in targets:
            hull = fit.hull(mask).translated(corner).points
            shape = pymunk.Poly(space.static_body, hull.tolist())
            space.add(shape)
            item_of[shape] = item
        space.step(1)  # builds its index
        ask, every, shots = space.segment_query_first, pymunk.ShapeFilter(), _pairs(rays)
        return lambda: ([ask(start, end, 0, every) for start, end in shots], item_of)

    def read(answer: tuple[list[Any], dict[Any, int]]) -> Decisions:
        found, item_of = answer
        hit = [(shot, item_of[one.shape], one.alpha) for shot, one in enumerate(found) if one is not None]
        rows = np.array(hit, np.float64).reshape(-1, 3)
        shot, item = rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64)
        # Of a hull in which a segment begins the alpha is 0, but the point that it tells is the segment's end.
        way = rows[:, 2:] * (rays.end_xy - rays.start_xy)[shot]
        return _entered(rays, shot, item, rays.start_xy[shot] + way)

    return Curve(
        "pymunk", "", (Method(None, prepare, read),), "an easier question: convex hulls of the masks; in floats"
    )


def _pairs(rays: Segments) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    return [(tuple(a), tuple(b)) for a, b in zip(rays.start_xy.tolist(), rays.end_xy.tolist(), strict=True)]


def _shapely_curve(targets: list[Target], rays: Segments) -> Curve:
    shapely = _installed("shapely")
    if shapely is None:
        return _absent("shapely")

    def prepare() -> Callable[[], tuple[Ints, Ints, Floats]]:
        shapes = np.array([_squares(shapely, mask, corner) for _, mask, corner in targets], object)
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


def _squares(shapely: Any, mask: Bools, corner: tuple[int, int]) -> Any:
    """The pixel squares of a mask as one shape: its rows of runs, joined."""
    runs, (x, y) = Spans.from_mask(mask), corner
    rows = shapely.box(runs.x_first + x - 0.5, runs.y + y - 0.5, runs.x_last + x + 0.5, runs.y + y + 0.5)
    return shapely.union_all(rows)


def _pygame_curve(targets: list[Target], rays: Segments) -> Curve:
    pygame = _installed("pygame")
    if pygame is None:
        return _absent("pygame")
    far = max([0.0, *(abs(float(v)) for xy in rays for v in (xy.min(), xy.max()))])
    if far > WHOLE_MAX:
        return Curve("pygame", left_out=f"places beyond {WHOLE_MAX} px do not fit its rectangles")

    def prepare() -> Callable[[], list[tuple[int, int, int] | None]]:
        world = [(_rect(pygame, target), _mask(pygame, target[1])) for target in targets]
        shots = _pairs(Segments(np.rint(rays.start_xy), np.rint(rays.end_xy)))
        return lambda: [_walked(world, start, end) for start, end in shots]

    def read(found: list[tuple[int, int, int] | None]) -> Decisions:
        hit = [(shot, targets[one[0]][0], *one[1:]) for shot, one in enumerate(found) if one is not None]
        rows = np.array(hit, np.int64).reshape(-1, 4)
        return Decisions.of(rows[:, 0], rows[:, 1], rows[:, 2:].astype(np.float64))

    note = "from whole pixel to whole pixel: the line is clipped to each rectangle, then its mask is read each px"
    return Curve("pygame", "", (Method(None, prepare, read),), note)


def _rect(pygame: Any, target: Target) -> Any:
    _, mask, (x, y) = target
    return pygame.Rect(x, y, mask.shape[1], mask.shape[0])


def _mask(pygame: Any, mask: Bools) -> Any:
    surface = pygame.Surface(mask.shape[::-1], pygame.SRCALPHA, 32)
    alpha = pygame.surfarray.pixels_alpha(surface)
    alpha[:] = np.where(mask.T, 255, 0)
    del alpha  # it locks the surface
    return pygame.mask.from_surface(surface)


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
