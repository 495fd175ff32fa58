"""Other libraries, asked the same questions: shapely, pymunk and pygame-ce, where they are installed.

Each is asked by the function that decides; pymunk and pygame row by row. Not asked: what has no such question; pygame's
rectangles, which leave out two of their sides by design; and `pygame.FRect.clipline`, which for some rays far from the
origin does not return. pymunk's circles and capsules count touching as a miss, and are asked all the same.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools
from weapons.peerworlds import module_of

__all__ = ["PEERS", "installed", "of_peer"]

Array = npt.NDArray[Any]
Method = Callable[..., Bools]

PEERS = ("shapely", "pymunk", "pygame-ce")
"""Names of distributions."""


def installed(peer: str) -> bool:
    """Whether a library can be asked."""
    if peer == "pymunk" and not __debug__:
        return False  # by an assertion it says that there is no contact
    try:
        return bool(version(peer))
    except PackageNotFoundError:
        return False


def of_peer(peer: str, predicate: str) -> Method | None:
    """How a library answers; None if it is not asked."""
    return TABLE[peer].get(predicate)


# shapely: whole columns


def _shapely_circles(center_a: Array, radius_a: Array, center_b: Array, radius_b: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.dwithin(s.points(center_a), s.points(center_b), radius_a + radius_b))


def _shapely_boxes(low_a: Array, high_a: Array, low_b: Array, high_b: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.intersects(s.box(*low_a.T, *high_a.T), s.box(*low_b.T, *high_b.T)))


def _shapely_capsule(a: Array, b: Array, radius: Array, center: Array, radius_c: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.dwithin(s.linestrings(np.stack([a, b], axis=1)), s.points(center), radius + radius_c))


def _shapely_point_polygon(rings: Array, points: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.intersects(_shapely_polygons(rings), s.points(points)))


def _shapely_circle_polygon(rings: Array, center: Array, radius: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.dwithin(_shapely_polygons(rings), s.points(center), radius))


def _shapely_polygon_pair(a: Array, b: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.intersects(_shapely_polygons(a), _shapely_polygons(b)))


def _shapely_polygons(rings: Array) -> Any:
    s = module_of("shapely")
    return s.polygons(s.linearrings(rings))


def _shapely_ray(start: Array, end: Array, cells: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.intersects(_shapely_lines(start / 256, end / 256), _shapely_squares(cells)))


def _shapely_lines(a: Array, b: Array) -> Any:
    return module_of("shapely").linestrings(np.stack([a, b], axis=1))


def _shapely_squares(cells: Array) -> Any:
    return module_of("shapely").box(*(cells - 0.5).T, *(cells + 0.5).T)


def _shapely_flight(start: Array, unit: Array, times: Array, radius: Array, cells: Array, velocity: Array) -> Bools:
    s = module_of("shapely")
    lines = _shapely_lines(start / 256, (start + unit * times[:, None] - velocity) / 256)
    near = s.dwithin(lines, s.points(cells.astype(float)), radius / 256)
    return np.asarray(near | s.intersects(lines, _shapely_squares(cells)))


def _shapely_disc(radius: Array, cells: Array, places: Array) -> Bools:
    s = module_of("shapely")
    return np.asarray(s.dwithin(s.points(places.astype(float)), s.points((cells + places).astype(float)), radius / 256))


def _shapely_beam(unit: Array, times: Array, radius: Array, cells: Array, places: Array) -> Bools:
    s = module_of("shapely")
    lines = _shapely_lines(places.astype(float), places + unit * times[:, None] / 256)
    at = cells + places
    near = s.dwithin(lines, s.points(at.astype(float)), radius / 256)
    return np.asarray(near | s.intersects(lines, _shapely_squares(at)))


def _shapely_pattern(rings: Array, cells: Array, places: Array) -> Bools:
    return _shapely_point_polygon(rings / 256 + places[:, None], (cells + places).astype(float))


# pymunk: row by row


def _rows(columns: tuple[Array, ...]) -> Any:
    return zip(*(column.tolist() for column in columns), strict=True)


def _pymunk_pairs(make_a: Callable[..., Any], make_b: Callable[..., Any], taken: int) -> Method:
    """Two shapes a row, from the first columns and the rest."""

    def method(*columns: Array) -> Bools:
        body = module_of("pymunk").Body(body_type=module_of("pymunk").Body.STATIC)
        found = []
        for row in _rows(columns):
            one, other = make_a(body, *row[:taken]), make_b(body, *row[taken:])
            one.cache_bb()
            other.cache_bb()
            found.append(_collide(one, other))
        return np.array(found, np.bool_)

    return method


def _collide(one: Any, other: Any) -> bool:
    """Whether two shapes have a contact: pymunk 7 asserts that there is one."""
    try:
        return len(one.shapes_collide(other).points) > 0
    except AssertionError:
        return False


def _pymunk_circle(body: Any, center: Any, radius: float) -> Any:
    return module_of("pymunk").Circle(body, radius, tuple(center))


def _pymunk_segment(body: Any, a: Any, b: Any, radius: float) -> Any:
    return module_of("pymunk").Segment(body, tuple(a), tuple(b), radius)


def _pymunk_poly(body: Any, ring: Any) -> Any:
    return module_of("pymunk").Poly(body, [tuple(p) for p in ring])


def _pymunk_boxes(*columns: Array) -> Bools:
    box = module_of("pymunk").BB
    return np.array([box(*a, *b).intersects(box(*c, *d)) for a, b, c, d in _rows(columns)], np.bool_)


def _pymunk_square(body: Any, cell: Any) -> Any:
    x, y = cell
    return _pymunk_poly(body, [(x - 0.5, y - 0.5), (x + 0.5, y - 0.5), (x + 0.5, y + 0.5), (x - 0.5, y + 0.5)])


def _pymunk_ray(start: Array, end: Array, cells: Array) -> Bools:
    body = module_of("pymunk").Body(body_type=module_of("pymunk").Body.STATIC)
    found = []
    for a, b, cell in _rows((start / 256, end / 256, cells)):
        square = _pymunk_square(body, cell)
        square.cache_bb()
        inside = square.point_query(tuple(a)).distance <= 0  # a ray that starts in a shape tells nothing of it
        found.append(inside or square.segment_query(tuple(a), tuple(b), 0) is not None)
    return np.array(found, np.bool_)


# pygame-ce: row by row


def _pygame_circles(*columns: Array) -> Bools:
    circle = module_of("pygame.geometry").Circle
    found = []
    for a, ra, b, rb in _rows(columns):
        try:
            found.append(bool(circle(a, ra).collidecircle(circle(b, rb))))
        except ValueError:  # a radius of 0
            found.append(False)
    return np.array(found, np.bool_)


TABLE: dict[str, dict[str, Method]] = {
    "shapely": {
        "circles": _shapely_circles,
        "boxes": _shapely_boxes,
        "capsule, circle": _shapely_capsule,
        "point in polygon": _shapely_point_polygon,
        "circle, polygon": _shapely_circle_polygon,
        "polygons": _shapely_polygon_pair,
        "oriented boxes": _shapely_polygon_pair,
        "ray's pixels": _shapely_ray,
        "ray, 1-px target": _shapely_ray,
        "projectile, 1-px target": _shapely_flight,
        "disc's pixels": _shapely_disc,
        "beam's pixels": _shapely_beam,
        "polygon's pixels": _shapely_pattern,
    },
    "pymunk": {
        "circles": _pymunk_pairs(_pymunk_circle, _pymunk_circle, 2),
        "boxes": _pymunk_boxes,
        "capsule, circle": _pymunk_pairs(_pymunk_segment, _pymunk_circle, 3),
        "circle, polygon": _pymunk_pairs(_pymunk_poly, _pymunk_circle, 1),
        "polygons": _pymunk_pairs(_pymunk_poly, _pymunk_poly, 1),
        "oriented boxes": _pymunk_pairs(_pymunk_poly, _pymunk_poly, 1),
        "ray, 1-px target": _pymunk_ray,
    },
    "pygame-ce": {"circles": _pygame_circles},
}
