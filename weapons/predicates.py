"""What is asked and judged: each predicate with its truth, its families, this project's answer, and the textbook's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools
from planes.constants import SUB
from planes.overlap import contains_point, overlap
from planes.parts import ConcavePolygons
from planes.scene import Scene
from planes.sprite import Sprite
from planes.triangles import triangles_meet
from planes.volumes import Aabbs, Capsules, Circles, Obbs, Polygons, Volumes
from weapons import naive, truth
from weapons.arsenal import Beam, Disc, Polygon
from weapons.families import MAKERS, Columns, Rng, shape_pairs
from weapons.firing import fire
from weapons.guns import Laser, Projectile
from weapons.hits import Hits
from weapons.pointfamilies import POINT_FAMILIES, TRIANGLE_FAMILIES
from weapons.shotfamilies import (
    BEAM_FAMILIES,
    CELL_FAMILIES,
    DISC_FAMILIES,
    FLIGHT_FAMILIES,
    PATTERN_FAMILIES,
    RAY_FAMILIES,
)
from weapons.trace import cells as cells_of_rays
from weapons.weapon import Weapon

__all__ = ["PREDICATES", "Predicate"]

Array = npt.NDArray[Any]
Method = Callable[..., Bools]
Families = Mapping[str, Callable[[Rng, int], Columns]]

APART = 2**22
"""Whole pixels between the grounds of two rows, in x: more than twice as far as any shot reaches."""

ABREAST = 32
"""Grounds side by side."""


@dataclass(frozen=True)
class Predicate:
    """One question.

    Parameters
    ----------
    truth : takes a row of plain numbers
    ours, naive : take columns
    families : make columns
    rows, quick : how many are asked in full, and in a quick run
    block : how many at a time
    cost : of a row, in some unit
    """

    name: str
    truth: Callable[..., bool]
    ours: Method
    naive: Method
    families: Families
    rows: int
    quick: int
    block: int
    cost: int

    def true(self, columns: Columns) -> Bools:
        """The truth of each row."""
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return np.array([self.truth(*row) for row in rows], np.bool_)


def _pairs(*kinds: str, without: tuple[str, ...] = ()) -> Families:
    both = (kinds[0], kinds[1])
    return {family: shape_pairs(both, family) for family in MAKERS if family not in without}


# Ours: volumes


def _circles(center_a: Array, radius_a: Array, center_b: Array, radius_b: Array) -> Bools:
    return overlap(Circles(center_a, radius_a), Circles(center_b, radius_b))


def _boxes(low_a: Array, high_a: Array, low_b: Array, high_b: Array) -> Bools:
    return overlap(Aabbs(low_a, high_a), Aabbs(low_b, high_b))


def _capsule_circle(a: Array, b: Array, radius: Array, center: Array, radius_c: Array) -> Bools:
    return overlap(Capsules(a, b, radius), Circles(center, radius_c))


def _point_polygon(rings: Array, points: Array) -> Bools:
    """Rows in turn that ask the same polygon share it."""
    new = np.concatenate([[True], (rings[1:] != rings[:-1]).any(axis=(1, 2))])
    some = rings[new]
    made = ConcavePolygons(some.reshape(-1, 2), _starts(some))
    return contains_point(made.take(np.cumsum(new) - 1), points)


def _circle_polygon(rings: Array, center: Array, radius: Array) -> Bools:
    return overlap(_polygons(rings), Circles(center, radius))


def _starts(rings: Array) -> Array:
    return np.arange(0, rings.shape[0] * rings.shape[1], rings.shape[1])


def _polygons(rings: Array) -> Volumes:
    return Polygons(rings.reshape(-1, 2), _starts(rings))


def _polygon_pair(a: Array, b: Array) -> Bools:
    return overlap(_polygons(a), _polygons(b))


def _oriented_boxes(a: Array, b: Array) -> Bools:
    return overlap(Obbs.from_corners(a), Obbs.from_corners(b))


# Ours: rays, and projectiles and patterns, each with its target on a ground of its own


def _ray_cells(start: Array, end: Array, cells: Array) -> Bools:
    ray, met, *_ = cells_of_rays(start, end)
    found = np.zeros(len(cells), np.bool_)
    near = (met == cells[ray]).all(axis=1)
    found[ray[near]] = True
    return found


def _grounds(n: int) -> Array:
    """Whole pixels (n, 2) by which rows are moved, so that no shot reaches the target of another."""
    row = np.arange(n)
    return APART * np.stack([row % ABREAST, row // ABREAST], axis=1)


def _scene(cells: Array, velocity: Array | None = None) -> Scene:
    """A target of one pixel for each row."""
    scene, target = Scene(), Sprite.from_mask(np.ones((1, 1), np.bool_))
    moves = np.zeros_like(cells) if velocity is None else velocity / SUB
    for cell, move in zip(cells.tolist(), moves.tolist(), strict=True):
        scene.add(target, cell, velocity_xy=move)
    return scene


def _own(hits: Hits, rows: Array) -> Bools:
    """Which shots of some rows hit the target of their own row."""
    found = np.zeros(len(rows), np.bool_)
    found[hits.shot[hits.object == rows[hits.shot]]] = True
    return found


def _ray_targets(start: Array, end: Array, cells: Array) -> Bools:
    hits = fire(_scene(cells), Laser(None), start / SUB, toward=end / SUB)  # it goes through the targets of others
    return _own(hits, np.arange(len(cells)))


def _flights(start: Array, unit: Array, times: Array, radius: Array, cells: Array, velocity: Array) -> Bools:
    length = np.rint(np.sqrt((unit * unit).sum(axis=1))).astype(np.int64)
    keys = np.stack([length * times, radius], axis=1)
    by = _grounds(len(cells))
    scene = _scene(cells + by, velocity)
    found = np.zeros(len(cells), np.bool_)
    for speed, reach in np.unique(keys, axis=0).tolist():
        rows = np.flatnonzero((keys == (speed, reach)).all(axis=1))
        at = start[rows] / SUB + by[rows]
        hits = fire(scene, Projectile(speed / SUB, reach / SUB), at, toward=at + unit[rows])
        found[rows] = _own(hits, rows)
    return found


# Ours: patterns, rows of one weapon together


def _by_weapon(keys: Array, weapon: Callable[[list[Any]], Weapon], columns: Columns) -> Bools:
    """Fire rows of one weapon together, each on a ground of its own; a third column is a direction."""
    cells, places, *toward = columns
    found = np.zeros(len(cells), np.bool_)
    _, which = np.unique(keys.reshape(len(keys), -1), axis=0, return_inverse=True)
    for k in range(which.max(initial=-1) + 1):
        rows = np.flatnonzero(which == k)
        at = places[rows] + _grounds(len(rows))
        aim: Any = {"toward": at + toward[0][rows]} if toward else {}
        hits = fire(_scene(at + cells[rows]), weapon(keys[rows[0]].tolist()), at.astype(np.float64), **aim)
        found[rows] = _own(hits, np.arange(len(rows)))
    return found


def _disc_pixels(radius: Array, cells: Array, places: Array) -> Bools:
    return _by_weapon(radius, lambda r: Disc(r / SUB), (cells, places))  # type: ignore[operator]


def _beam_pixels(unit: Array, times: Array, radius: Array, cells: Array, places: Array) -> Bools:
    length = np.rint(np.sqrt((unit * unit).sum(axis=1))).astype(np.int64) * times
    keys = np.stack([length, radius], axis=1)
    return _by_weapon(keys, lambda k: Beam(k[0] / SUB, 2 * k[1] / SUB), (cells, places, unit))


def _pattern_pixels(rings: Array, cells: Array, places: Array) -> Bools:
    def weapon(ring: list[Any]) -> Weapon:
        points = [p for k, p in enumerate(ring) if p != ring[k - 1]]
        return Polygon([(x / SUB, y / SUB) for x, y in points])

    return _by_weapon(rings, weapon, (cells, places))


# Truth of rows


def _flies_into(start: Any, unit: Any, times: int, radius: int, cell: Any, velocity: Any) -> bool:
    return truth.disc_flies_into(start, [times * v for v in unit], radius, cell, velocity)


def _in_disc(radius: int, cell: Any, place: Any) -> bool:
    return truth.in_disc(radius, cell)


def _in_beam(unit: Any, times: int, radius: int, cell: Any, place: Any) -> bool:
    return truth.in_beam([times * v for v in unit], radius, cell)


def _in_pattern(ring: Any, cell: Any, place: Any) -> bool:
    return truth.polygon_holds(ring, [SUB * v for v in cell])


ROUND = ("needles", "parallel", "shared")
"""Families that circles have no sides for."""

CLOSED, HULLS, FIRED = (10**6, 1000, 25_000, 1), (5 * 10**4, 300, 5000, 5), (10**4, 200, 1000, 30)
"""Rows, and so on, of what has a closed form, of what has corners, and of what goes through a whole scene."""

PREDICATES = (
    Predicate(
        "circles", truth.circles_meet, _circles, naive.circles, _pairs("circle", "circle", without=ROUND), *CLOSED,
    ),
    Predicate("boxes", truth.boxes_meet, _boxes, naive.boxes, _pairs("box", "box", without=("walls",)), *CLOSED),
    Predicate(
        "capsule, circle", truth.capsule_meets_circle, _capsule_circle, naive.capsule_circle,
        _pairs("capsule", "circle", without=("parallel", "shared")), *CLOSED,
    ),
    Predicate("point in polygon", truth.polygon_holds, _point_polygon, naive.point_polygon, POINT_FAMILIES, *HULLS),
    Predicate(
        "circle, polygon", truth.circle_meets_polygon, _circle_polygon, naive.circle_polygon,
        _pairs("polygon", "circle", without=("parallel", "shared")), *HULLS,
    ),
    Predicate(
        "polygons", truth.polygons_meet, _polygon_pair, naive.polygons,
        _pairs("polygon", "polygon", without=("walls",)), *HULLS,
    ),
    Predicate(
        "oriented boxes", truth.polygons_meet, _oriented_boxes, naive.oriented_boxes,
        _pairs("oriented box", "oriented box", without=("walls",)), *HULLS,
    ),
    Predicate("triangles in space", truth.triangles_meet, triangles_meet, naive.triangles, TRIANGLE_FAMILIES, *HULLS),
    Predicate("ray's pixels", truth.segment_meets_cell, _ray_cells, naive.ray_cells, CELL_FAMILIES, *HULLS),
    Predicate("ray, 1-px target", truth.segment_meets_cell, _ray_targets, naive.ray_targets, RAY_FAMILIES, *FIRED),
    Predicate("projectile, 1-px target", _flies_into, _flights, naive.flights, FLIGHT_FAMILIES, *FIRED),
    Predicate("disc's pixels", _in_disc, _disc_pixels, naive.disc_pixels, DISC_FAMILIES, *FIRED),
    Predicate("beam's pixels", _in_beam, _beam_pixels, naive.beam_pixels, BEAM_FAMILIES, *FIRED),
    Predicate("polygon's pixels", _in_pattern, _pattern_pixels, naive.pattern_pixels, PATTERN_FAMILIES, *FIRED),
)  # fmt: skip
"""In the order of the table."""
