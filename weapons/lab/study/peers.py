"""Discs and rays tested by pymunk, shapely and pygame, as their users would; only the installed libraries take part."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.common.limits import SCALE_BITS, SUB, TRIG_BITS
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.volumes import fit

from ...kinds.areas import Disc
from .methods import Curve, Decisions, Method, Question, Target, drawn_places, size_of, targets_of
from .truth import Round, Straight, discs_on_shapes, parts_of_discs, placed_rings

PYGAME_MOST = 2**30
"""Largest coordinate for pygame's rectangles, px; they hold C ints, and a sum of two coordinates must fit."""


def module_of(name: str) -> Any:
    """Import a module, without the greeting of pygame."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    return import_module(name)


def installed(name: str) -> Any:
    """Import a module; None if it is not installed."""
    try:
        return module_of(name)
    except ImportError:
        return None


def absent(name: str) -> Curve:
    """Return an empty curve, with a note that the library is not installed."""
    return Curve(name, left_out=f"{name} is not installed")


def pairs(*columns: Floats) -> list[tuple[tuple[float, ...], ...]]:
    """Return rows of points (N, 2) as tuples of tuples, for libraries that take one at a time."""
    return list(zip(*([tuple(xy) for xy in column.tolist()] for column in columns), strict=True))


def hulls_in_pymunk(pymunk: Any, targets: list[Target]) -> tuple[Any, dict[Any, int]]:
    """Make a space with the convex hull of each mask; return it and the object of each shape."""
    space, item_of = pymunk.Space(), {}
    for item, mask, corner in targets:
        hull = fit.hull(mask).translated(corner).points
        shape = pymunk.Poly(space.static_body, hull.tolist())
        space.add(shape)
        item_of[shape] = item
    space.step(1)  # builds its index
    return space, item_of


def squares_in_shapely(shapely: Any, targets: list[Target]) -> npt.NDArray[Any]:
    """Return the union of the pixel squares of each mask."""
    shapes = []
    for _, mask, (x, y) in targets:
        runs = Spans.from_mask(mask)
        rows = shapely.box(runs.x_first + x - 0.5, runs.y + y - 0.5, runs.x_last + x + 0.5, runs.y + y + 0.5)
        shapes.append(shapely.union_all(rows))
    return np.array(shapes, object)


def masks_in_pygame(pygame: Any, targets: list[Target]) -> list[tuple[Any, Any]]:
    """Return a rectangle and a mask for each target."""
    world = []
    for _, mask, (x, y) in targets:
        surface = pygame.Surface(mask.shape[::-1], pygame.SRCALPHA, 32)
        alpha = pygame.surfarray.pixels_alpha(surface)
        alpha[:] = np.where(mask.T, 255, 0)
        del alpha  # it locks the surface
        world.append((pygame.Rect(x, y, mask.shape[1], mask.shape[0]), pygame.mask.from_surface(surface)))
    return world


REACH = 8
"""Median size of the objects, in radii of the disc."""

RADIUS_MAX = 32
"""Largest radius of a disc, px; at scale 4 it becomes 128 px, with 51,000 samples per shot."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Shots with discs of one radius, and the objects that they are fired at.

    Parameters
    ----------
    scene : the objects, numbered from 0
    exact : (M,) whether the exact shape of an object is known
    at : (N, 2) px; whole numbers if no shape is exact
    aimed : (N,) the object near which a shot is
    radius : px
    """

    scene: Scene
    exact: Bools
    at: Floats
    aimed: Ints
    radius: float


def discs_at(alone: Scene, shots: int, seed: int) -> Discs:
    """Draw discs, each uniformly in the box of an object grown by twice the radius.

    Parameters
    ----------
    alone : the objects, numbered from 0, each with a pixel
    shots : number of discs
    seed : random seed of the places
    """
    targets, count = targets_of(alone), len(alone)
    exact = np.array([_is_exact(alone, item) for item in range(count)], np.bool_)
    radius = min(max(1, round(size_of(targets) / REACH)), RADIUS_MAX)
    place, _, near = drawn_places(targets, shots, seed, 2 * SUB * radius, lambda xy: np.zeros(len(xy), np.bool_))
    at = place / SUB if exact.any() else pixel(place).astype(np.float64)
    items = np.array([item for item, _, _ in targets] or [0])
    return Discs(alone, exact, at, items[near], float(radius))


def areas_question(discs: Discs, curves: Sequence[Curve]) -> Question:
    """Return the question which objects discs touch, with its true answers."""
    exact, masks = int(discs.exact.sum()), int((~discs.exact).sum())
    texts = [f"exact shapes of {exact} objects"] * bool(exact) + [f"masks at full scale of {masks}"] * bool(masks)
    asks = f"Which objects does a disc of radius {discs.radius:g} px touch?"
    truth = " and ".join(texts) or "nothing can be hit"
    return Question("areas", asks, len(discs.at), _truth(discs), truth, tuple(curves), aimed=discs.aimed)


def _truth(discs: Discs) -> Decisions:
    """Return the exact shapes and the masks that discs touch, with places and shares."""
    exact = np.flatnonzero(discs.exact)
    of = discs_on_shapes(discs.at, discs.radius, [_shape(discs.scene, item) for item in exact.tolist()])
    masks = [target for target in targets_of(discs.scene) if not discs.exact[target[0]]]
    on = parts_of_discs(np.floor(discs.at + 0.5).astype(np.int64), int(discs.radius), masks)
    return Decisions.joined(
        [
            Decisions(of.shot, exact[of.object], of.xy, of.share),
            Decisions(on.disc, on.object, on.nearest_xy.astype(np.float64), on.pixels / on.whole),
        ]
    )


def _is_exact(scene: Scene, item: int) -> bool:
    """Whether the exact shape of an object is known, which holds for polygons and circles, but not for ellipses."""
    form, outline = scene.items.forms[item], scene.items.sprites[item].outline
    return outline is not None and (outline.radius is None or form.scale_x == form.scale_y)


def _shape(scene: Scene, item: int) -> Round | Straight:
    """Return the exact shape of an object in the world."""
    form, outline = scene.items.forms[item], scene.items.sprites[item].outline
    assert outline is not None  # it is exact
    position = scene.items.position_256[item] / SUB
    scale = form.scale_x / (1 << SCALE_BITS), form.scale_y / (1 << SCALE_BITS)
    if outline.radius is not None:
        return Round(position, outline.radius / SUB * scale[0])
    rings = [ring / SUB for ring in outline.rings]
    return Straight(placed_rings(rings, form.flip, scale, scene.items.angles[item], position))


class Segments(NamedTuple):
    """Starts and ends of rays, (N, 2) px."""

    start_xy: Floats
    end_xy: Floats


def peer_curves(targets: list[Target], rays: Segments) -> tuple[Curve, ...]:
    """Return a curve of each library for rays against targets, given front to back."""
    return _pymunk_rays(targets, rays), _shapely_rays(targets, rays), _pygame_rays(targets, rays)


def _entered(rays: Segments, shot: Ints, item: Ints, point: Floats) -> Decisions:
    """Convert points on borders to the pixels that the rays enter there, half a unit of the grid farther."""
    way = rays.end_xy[shot] - rays.start_xy[shot]
    length = np.maximum(np.sqrt((way**2).sum(axis=1, keepdims=True)), 1 / SUB)
    return Decisions.of(shot, item, np.rint(point + way / length / (2 * SUB)))


def _pymunk_rays(targets: list[Target], rays: Segments) -> Curve:
    pymunk = installed("pymunk")
    if pymunk is None:
        return absent("pymunk")

    def read(answer: FirstHits) -> Decisions:
        shot, item, alpha = _along(answer)
        return _entered(rays, shot, item, rays.start_xy[shot] + alpha[:, None] * (rays.end_xy - rays.start_xy)[shot])

    note = "an easier question: convex hulls of the masks; in floats"
    return Curve("pymunk", "", (Method(None, lambda: _first_hulls(pymunk, targets, rays, 0.0), read),), note)


def mover_peer_curve(targets: list[Target], flights: Segments, radius: float, moving: bool) -> Curve:
    """Return pymunk's curve for flying discs against hulls, which uses thick segments as swept discs.

    Parameters
    ----------
    moving : whether objects move; the curve is then left out, as objects stand still in a query of pymunk
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
"""The first hit of each segment, or None, and the object of each shape."""


def _first_hulls(pymunk: Any, targets: list[Target], rays: Segments, radius: float) -> Callable[[], FirstHits]:
    """Return a run that finds the first hull on each segment."""
    space, item_of = hulls_in_pymunk(pymunk, targets)
    ask, every, shots = space.segment_query_first, pymunk.ShapeFilter(), pairs(rays.start_xy, rays.end_xy)
    return lambda: ([ask(start, end, radius, every) for start, end in shots], item_of)


def _along(answer: FirstHits) -> tuple[Ints, Ints, Floats]:
    """Return the segments that hit, their objects, and the fraction of the segment at which each hits.

    The fraction is used as it is right (0) for a segment that begins in a hull; pymunk's point is then the end.
    """
    found, item_of = answer
    hit = [(shot, item_of[info.shape], info.alpha) for shot, info in enumerate(found) if info is not None]
    rows = np.array(hit, np.float64).reshape(-1, 3)
    return rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2]


def _shapely_rays(targets: list[Target], rays: Segments) -> Curve:
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


def _pygame_rays(targets: list[Target], rays: Segments) -> Curve:
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
        hit = [(shot, targets[first[0]][0], *first[1:]) for shot, first in enumerate(found) if first is not None]
        rows = np.array(hit, np.int64).reshape(-1, 4)
        return Decisions.of(rows[:, 0], rows[:, 1], rows[:, 2:].astype(np.float64))

    note = "from whole pixel to whole pixel: the line is clipped to each rectangle, then its mask is read each px"
    return Curve("pygame", "", (Method(None, prepare, read),), note)


def _walked(
    world: list[tuple[Any, Any]], start: tuple[float, ...], end: tuple[float, ...]
) -> tuple[int, int, int] | None:
    """Return the index of the first mask on a line, and the pixel."""
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
    """Return the first pixel of a mask on a line inside its rectangle."""
    (x, y), (x_end, y_end) = way
    steps = max(abs(x_end - x), abs(y_end - y), 1)
    for k in range(steps + 1):
        at = x + round(k * (x_end - x) / steps), y + round(k * (y_end - y) / steps)
        if mask.get_at((at[0] - rect.x, at[1] - rect.y)):
            return at
    return None


def area_peer_curves(discs: Discs) -> list[Curve]:
    """Return a curve of each library for discs against the objects."""
    targets = targets_of(discs.scene)
    asked = {"pymunk": _pymunk_curve, "shapely": _shapely_curve, "pygame": _pygame_curve}
    modules = {name: installed(name) for name in asked}
    return [curve(modules[name], targets, discs) if modules[name] else absent(name) for name, curve in asked.items()]


def _pymunk_curve(pymunk: Any, targets: list[Target], discs: Discs) -> Curve:
    def prepare() -> Callable[[], list[tuple[int, int, Any]]]:
        space, item_of = hulls_in_pymunk(pymunk, targets)
        ask, every, shots = space.point_query, pymunk.ShapeFilter(), pairs(discs.at)
        return lambda: [
            (shot, item_of[info.shape], info.point)
            for shot, (at,) in enumerate(shots)
            for info in ask(at, discs.radius, every)
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
