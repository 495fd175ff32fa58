"""Other libraries, each adapted here alone: pymunk, shapely and pygame-ce, for studies, stability runs and benchmarks.

pymunk is asked about convex hulls of masks, shapely about the union of their pixel squares, pygame about the masks. A
library that is not installed takes no part. pymunk and pygame are called row by row, shapely with whole columns.

Left out of stability runs are pygame's rectangles, which exclude two of their sides by design, and
`pygame.FRect.clipline`, which does not return for some rays far from the origin. pymunk's circles and capsules take
part although touching is a miss there.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.common.limits import SUB, TRIG_BITS
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.volumes import fit

from ..kinds.areas import Disc
from .study.methods import Curve, Decisions, Method, Target

PYGAME_MOST = 2**30  # px in pygame's rectangles; they hold C ints, and a sum of two coordinates must fit
Array = npt.NDArray[Any]
Run = Callable[[], Any]


def library(name: str) -> Any:
    """Import a library, without the greeting of pygame."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    return import_module(name)


# Objects, as each library holds them


def hulls_in_pymunk(pymunk: Any, targets: Sequence[Target]) -> tuple[Any, dict[Any, int]]:
    """Make a space with the convex hull of each mask; return it and the object of each shape."""
    space, item_of = pymunk.Space(), {}
    for item, mask, corner in targets:
        shape = pymunk.Poly(space.static_body, fit.hull(mask).translated(corner).points.tolist())
        space.add(shape)
        item_of[shape] = item
    space.step(1)  # builds its index
    return space, item_of


def squares_in_shapely(shapely: Any, targets: Sequence[Target]) -> Array:
    """Return the union of the pixel squares of each mask."""
    shapes = []
    for _, mask, (x, y) in targets:
        runs = Spans.from_mask(mask)
        rows = shapely.box(runs.x_first + x - 0.5, runs.y + y - 0.5, runs.x_last + x + 0.5, runs.y + y + 0.5)
        shapes.append(shapely.union_all(rows))
    return np.array(shapes, object)


def masks_in_pygame(pygame: Any, targets: Sequence[Target]) -> list[tuple[Any, Any]]:
    """Return a rectangle and a mask for each target."""
    world = []
    for _, mask, corner in targets:
        rgba, size = np.repeat(np.where(mask, 255, 0).astype(np.uint8)[..., None], 4, axis=2), mask.shape[::-1]
        surface = pygame.image.frombuffer(rgba.tobytes(), size, "RGBA")
        world.append((pygame.Rect(corner, size), pygame.mask.from_surface(surface)))
    return world


# Curves of a study


class Segments(NamedTuple):
    """Starts and ends of rays, (N, 2) px."""

    start_xy: Floats
    end_xy: Floats


def disc_curves(targets: list[Target], at: Floats, radius: float) -> list[Curve]:
    """Return a curve of each library for discs around points (N, 2) against all targets."""
    ids, far = _ids(targets), float(np.abs(at).max(initial=0))
    disc = np.array(Disc(radius).spans(1 << TRIG_BITS, 0).to_mask()[0])
    corner = np.floor(at + 0.5).astype(np.int64) - len(disc) // 2

    def on_masks(found: Ints) -> Decisions:
        """Convert shots, ranks, numbers of pixels and places in the disc."""
        place = (found[:, 3:] + corner[found[:, 0]]).astype(np.float64)
        return Decisions(found[:, 0], ids[found[:, 1]], place, found[:, 2] / disc.sum())

    hulls = "an easier question: convex hulls of the masks; in floats; the place is one of the edge"
    outlines = "outlines of the pixels of the masks; in floats"
    masks = "masks; a place is the first pixel that it finds, not the nearest"
    return [
        _curve("pymunk", hulls, lambda m: _near_hulls(m, targets, at, radius), _decided),
        _curve("shapely", outlines, lambda m: _near_outlines(m, targets, at, radius), lambda f: _nearest(f, ids, at)),
        _curve("pygame", masks, lambda m: _overlaps(m, targets, disc, corner), lambda f: on_masks(_rows(f, 5)), far),
    ]


def ray_curves(targets: list[Target], rays: Segments) -> tuple[Curve, ...]:
    """Return a curve of each library for the first hits of rays on targets, given front to back."""
    ids, far = _ids(targets), max(float(np.abs(xy).max(initial=0)) for xy in rays)

    def on_masks(found: list[tuple[int, int, int, int]]) -> Decisions:
        """Convert shots, ranks and pixels."""
        rows = _rows(found, 4)
        return Decisions.of(rows[:, 0], ids[rows[:, 1]], rows[:, 2:].astype(np.float64))

    easier = "an easier question: convex hulls of the masks; in floats"
    walked = "from whole pixel to whole pixel: the line is clipped to each rectangle, then its mask is read each px"
    return (
        _curve("pymunk", easier, lambda m: _first_hulls(m, targets, rays, 0.0),
               lambda found: _entered(rays, *_along(rays, found))),
        _curve("shapely", "outlines of the masks; in floats", lambda m: _first_outlines(m, targets, rays),
               lambda found: _entered(rays, found[0], ids[found[1]], found[2])),
        _curve("pygame", walked, lambda m: _first_masks(m, targets, rays), on_masks, far),
    )  # fmt: skip


def mover_curve(targets: list[Target], flights: Segments, radius: float, moving: bool) -> Curve:
    """Return pymunk's curve for flying discs against hulls, which uses thick segments as swept discs.

    It is left out if objects move, as they stand still in a query of pymunk.
    """
    note = "a thick segment, swept, against convex hulls of the masks; in floats"
    run, read = partial(_first_hulls, targets=targets, rays=flights, radius=radius), partial(_along, flights)
    curve = _curve("pymunk", note, run, lambda found: Decisions.of(*read(found)))
    if curve.methods and moving:
        return Curve("pymunk", left_out="objects move, and stand still during its queries")
    return curve


def _curve(
    name: str, note: str, prepare: Callable[[Any], Run], read: Callable[[Any], Decisions], far: float = 0.0
) -> Curve:
    """Return a curve of one point; `prepare` takes the library, and `far` is pygame's largest coordinate."""
    try:
        module = library(name)
    except ImportError:
        return Curve(name, left_out=f"{name} is not installed")
    if far > PYGAME_MOST:
        return Curve(name, left_out=f"places beyond {PYGAME_MOST} px do not fit its rectangles")
    return Curve(name, "", (Method(None, partial(prepare, module), read),), note)


def _ids(targets: Sequence[Target]) -> Ints:
    return np.array([item for item, _, _ in targets], np.int64)


def _rows(found: Sequence[Any], width: int) -> Ints:
    """Return rows of whole numbers as an array (K, width)."""
    return np.array(found, np.int64).reshape(-1, width)


def _pairs(*columns: Floats) -> list[tuple[tuple[float, ...], ...]]:
    """Return rows of points (N, 2) as tuples of tuples, for libraries that take one at a time."""
    return list(zip(*([tuple(xy) for xy in column.tolist()] for column in columns), strict=True))


def _decided(found: list[tuple[int, int, Any]]) -> Decisions:
    """Convert rows of shot, object and point."""
    rows = np.array([(shot, item, *point) for shot, item, point in found], np.float64).reshape(-1, 4)
    return Decisions.of(rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2:])


def _near_hulls(pymunk: Any, targets: list[Target], at: Floats, radius: float) -> Run:
    space, item_of = hulls_in_pymunk(pymunk, targets)
    ask, every, shots = space.point_query, pymunk.ShapeFilter(), _pairs(at)
    return lambda: [
        (shot, item_of[info.shape], info.point)
        for shot, (place,) in enumerate(shots)
        for info in ask(place, radius, every)
    ]


def _near_outlines(shapely: Any, targets: list[Target], at: Floats, radius: float) -> Run:
    shapes = squares_in_shapely(shapely, targets)
    tree = shapely.STRtree(shapes)
    return lambda: (shapes, *tree.query(shapely.points(at), predicate="dwithin", distance=radius))


def _nearest(found: tuple[Any, Ints, Ints], ids: Ints, at: Floats) -> Decisions:
    """Convert outlines, shots and ranks; the place is the point of the outline nearest to the shot."""
    shapely, (shapes, shot, rank) = library("shapely"), found
    ways = shapely.shortest_line(shapely.points(at[shot]), shapes[rank])
    return Decisions.of(shot, ids[rank], shapely.get_coordinates(ways).reshape(-1, 2, 2)[:, 1])


def _overlaps(pygame: Any, targets: list[Target], disc: Bools, corner: Ints) -> Run:
    """Return a run that finds shots, ranks of masks, numbers of shared pixels, and the first of these."""
    world = masks_in_pygame(pygame, targets)
    ((box, pattern),) = masks_in_pygame(pygame, [(0, disc, (0, 0))])
    rects, shots = [rect for rect, _ in world], _pairs(corner.astype(np.float64))

    def run() -> list[tuple[int, ...]]:
        """Ask the masks of all rectangles that the box of a shot meets."""
        found = []
        for shot, (at,) in enumerate(shots):
            box.topleft = (int(at[0]), int(at[1]))
            for rank in box.collidelistall(rects):
                rect, mask = world[rank]
                offset = rect.x - box.x, rect.y - box.y
                pixels = pattern.overlap_area(mask, offset)
                if pixels:
                    found.append((shot, rank, pixels, *pattern.overlap(mask, offset)))
        return found

    return run


def _first_hulls(pymunk: Any, targets: list[Target], rays: Segments, radius: float) -> Run:
    """Return a run that finds the first hull on each segment."""
    space, item_of = hulls_in_pymunk(pymunk, targets)
    ask, every, shots = space.segment_query_first, pymunk.ShapeFilter(), _pairs(rays.start_xy, rays.end_xy)
    return lambda: ([ask(start, end, radius, every) for start, end in shots], item_of)


def _along(rays: Segments, answer: tuple[list[Any], dict[Any, int]]) -> tuple[Ints, Ints, Floats]:
    """Return the segments that hit, their objects, and the points, at a fraction of the segment.

    The fraction is used as it is right (0) for a segment that begins in a hull; pymunk's point is then the end.
    """
    found, item_of = answer
    hit = [(shot, item_of[info.shape], info.alpha) for shot, info in enumerate(found) if info is not None]
    rows = np.array(hit, np.float64).reshape(-1, 3)
    shot, item = rows[:, :2].T.astype(np.int64)
    return shot, item, rays.start_xy[shot] + rows[:, 2:] * (rays.end_xy - rays.start_xy)[shot]


def _entered(rays: Segments, shot: Ints, item: Ints, point: Floats) -> Decisions:
    """Convert points on borders to the pixels that the rays enter there, half a unit of the grid farther."""
    way = rays.end_xy[shot] - rays.start_xy[shot]
    length = np.maximum(np.sqrt((way**2).sum(axis=1, keepdims=True)), 1 / SUB)
    return Decisions.of(shot, item, np.rint(point + way / length / (2 * SUB)))


def _first_outlines(shapely: Any, targets: list[Target], rays: Segments) -> Run:
    """Return a run that finds the shots that hit, the rank of the first outline of each, and the point."""
    shapes = squares_in_shapely(shapely, targets)
    tree = shapely.STRtree(shapes)

    def run() -> tuple[Ints, Ints, Floats]:
        """Intersect the rays with outlines, and take the nearest point of each ray."""
        lines = shapely.linestrings(np.stack([rays.start_xy, rays.end_xy], axis=1))
        shot, rank = tree.query(lines, predicate="intersects")
        inside = shapely.intersection(lines[shot], shapes[rank])
        ways = shapely.shortest_line(shapely.points(rays.start_xy)[shot], inside)
        order = np.lexsort((rank, shapely.length(ways), shot))
        first = order[np.flatnonzero(np.diff(shot[order], prepend=-1))]
        return shot[first], rank[first], shapely.get_coordinates(ways[first]).reshape(-1, 2, 2)[:, 1]

    return run


def _first_masks(pygame: Any, targets: list[Target], rays: Segments) -> Run:
    """Return a run that finds the shots that hit, the rank of the first mask of each, and the pixel."""
    world = masks_in_pygame(pygame, targets)
    shots = _pairs(np.rint(rays.start_xy), np.rint(rays.end_xy))
    return lambda: [(shot, *first) for shot, ends in enumerate(shots) if (first := _first_mask(world, *ends))]


def _first_mask(world: list[tuple[Any, Any]], start: Any, end: Any) -> tuple[int, int, int] | None:
    """Return the index of the first mask on a line, and the pixel."""
    lines = [(rank, rect.clipline(start, end)) for rank, (rect, _) in enumerate(world)]
    ways = [(math.dist(start, clipped[0]), rank, clipped) for rank, clipped in lines if clipped]
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


# Predicates of a stability run

PEERS = {"shapely": "shapely", "pymunk": "pymunk", "pygame-ce": "pygame.geometry"}
"""Packages that provide the libraries, and the module that each is asked through."""


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of the packages that are installed."""
    found = {}
    for name in packages:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def installed(peer: str) -> bool:
    """Whether the package of a library is installed; pymunk without assertions cannot report a missing contact."""
    return bool(versions(peer)) and (peer != "pymunk" or __debug__)


def of_peer(peer: str, predicate: str) -> Callable[..., Bools] | None:
    """Return the function of columns by which a library decides a predicate; None if it has none."""
    answers = TABLE[peer].get(predicate)
    if answers is None:
        return None
    return lambda *columns: np.asarray(answers(library(PEERS[peer]), *columns), np.bool_)


def _polygons(shapely: Any, rings: Array) -> Any:
    return shapely.polygons(shapely.linearrings(rings))


def _lines(shapely: Any, a: Array, b: Array) -> Any:
    return shapely.linestrings(np.stack([a, b], axis=1))


def _squares(shapely: Any, cells: Array) -> Any:
    return shapely.box(*(cells - 0.5).T, *(cells + 0.5).T)


def _flies_into(shapely: Any, lines: Any, radius: Array, cells: Array) -> Any:
    """Whether a disc that flies along a line touches a pixel's centre, or its centre the pixel's square."""
    near = shapely.dwithin(lines, shapely.points(cells.astype(float)), radius / 256)
    return near | shapely.intersects(lines, _squares(shapely, cells))


def _by_row(columns: tuple[Array, ...]) -> Any:
    return zip(*(column.tolist() for column in columns), strict=True)


SHAPES: dict[str, Callable[..., Any]] = {
    "circle": lambda m, body, center, radius: m.Circle(body, radius, tuple(center)),
    "segment": lambda m, body, a, b, radius: m.Segment(body, tuple(a), tuple(b), radius),
    "poly": lambda m, body, ring: m.Poly(body, [tuple(p) for p in ring]),
}
"""How pymunk makes a shape from the numbers of a row."""


def _contacts(kind_a: str, kind_b: str, taken: int, pymunk: Any, *columns: Array) -> list[bool]:
    """Make two shapes per row, from the first columns and from the rest, and ask whether they are in contact."""
    body, found = pymunk.Body(body_type=pymunk.Body.STATIC), []
    for row in _by_row(columns):
        a, b = SHAPES[kind_a](pymunk, body, *row[:taken]), SHAPES[kind_b](pymunk, body, *row[taken:])
        a.cache_bb()
        b.cache_bb()
        try:
            found.append(len(a.shapes_collide(b).points) > 0)
        except AssertionError:  # pymunk 7 raises it for shapes that are apart
            found.append(False)
    return found


def _rays_on_squares(pymunk: Any, start: Array, end: Array, cells: Array) -> list[bool]:
    body, found = pymunk.Body(body_type=pymunk.Body.STATIC), []
    for a, b, (x, y) in _by_row((start / 256, end / 256, cells)):
        ring = [(x - 0.5, y - 0.5), (x + 0.5, y - 0.5), (x + 0.5, y + 0.5), (x - 0.5, y + 0.5)]
        square = pymunk.Poly(body, ring)
        square.cache_bb()
        inside = square.point_query(tuple(a)).distance <= 0  # segment_query misses a shape around the start
        found.append(inside or square.segment_query(tuple(a), tuple(b), 0) is not None)
    return found


def _circles_in_pygame(geometry: Any, *columns: Array) -> list[bool]:
    found = []
    for a, ra, b, rb in _by_row(columns):
        try:
            found.append(bool(geometry.Circle(a, ra).collidecircle(geometry.Circle(b, rb))))
        except ValueError:  # a radius of 0
            found.append(False)
    return found


TABLE: dict[str, dict[str, Callable[..., Any]]] = {
    "shapely": {
        "circles": lambda s, a, ra, b, rb: s.dwithin(s.points(a), s.points(b), ra + rb),
        "boxes": lambda s, a, a_max, b, b_max: s.intersects(s.box(*a.T, *a_max.T), s.box(*b.T, *b_max.T)),
        "capsule, circle": lambda s, a, b, r, c, rc: s.dwithin(_lines(s, a, b), s.points(c), r + rc),
        "point in polygon": lambda s, rings, p: s.intersects(_polygons(s, rings), s.points(p)),
        "circle, polygon": lambda s, rings, c, r: s.dwithin(_polygons(s, rings), s.points(c), r),
        "polygons": lambda s, a, b: s.intersects(_polygons(s, a), _polygons(s, b)),
        "oriented boxes": lambda s, a, b: s.intersects(_polygons(s, a), _polygons(s, b)),
        "ray's pixels": lambda s, a, b, cells: s.intersects(_lines(s, a / 256, b / 256), _squares(s, cells)),
        "ray, 1-px target": lambda s, a, b, cells: s.intersects(_lines(s, a / 256, b / 256), _squares(s, cells)),
        "projectile, 1-px target": lambda s, a, unit, times, r, cells, v: _flies_into(
            s, _lines(s, a / 256, (a + unit * times[:, None] - v) / 256), r, cells
        ),
        "disc's pixels": lambda s, r, cells, at: s.dwithin(
            s.points(at.astype(float)), s.points((cells + at).astype(float)), r / 256
        ),
        "beam's pixels": lambda s, unit, times, r, cells, at: _flies_into(
            s, _lines(s, at.astype(float), at + unit * times[:, None] / 256), r, cells + at
        ),
        "polygon's pixels": lambda s, rings, cells, at: s.intersects(
            _polygons(s, rings / 256 + at[:, None]), s.points((cells + at).astype(float))
        ),
    },
    "pymunk": {
        "circles": partial(_contacts, "circle", "circle", 2),
        "boxes": lambda m, *columns: [m.BB(*a, *b).intersects(m.BB(*c, *d)) for a, b, c, d in _by_row(columns)],
        "capsule, circle": partial(_contacts, "segment", "circle", 3),
        "circle, polygon": partial(_contacts, "poly", "circle", 1),
        "polygons": partial(_contacts, "poly", "poly", 1),
        "oriented boxes": partial(_contacts, "poly", "poly", 1),
        "ray, 1-px target": _rays_on_squares,
    },
    "pygame-ce": {"circles": _circles_in_pygame},
}
"""By library and predicate the function of its module and the predicate's columns."""
