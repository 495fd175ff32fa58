"""The predicates of the stability run, each with its exact answer, hard cases, and answers of hitplanes and textbooks.

Rows of shots ask whether a shot touches a pixel. Their numbers are integers in 1/256 px, except cells, which are
pixels. Shots whose end is rounded go along integer vectors of integer length, so that rounding changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.broadphase.triangles import triangles_meet
from hitplanes.planes.common.checks import Bools
from hitplanes.planes.common.limits import SUB
from hitplanes.planes.grid.rasterize import cells as cells_of_rays
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite
from hitplanes.planes.volumes.overlap import contains_point, overlap
from hitplanes.planes.volumes.volumes import Aabbs, Capsules, Circles, ConcavePolygons, Obbs, Polygons, Volumes

from ...fire.call import fire
from ...fire.hits import Hits
from ...kinds.areas import Beam, Disc, Polygon
from ...kinds.rays import Laser, Projectile
from ...kinds.weapon import Weapon
from . import rivals, truth
from .families import MAKERS, POINT_FAMILIES, TRIANGLE_FAMILIES, TRIPLES, Columns, Rng, across, either, shape_pairs
from .truth import is_simple

Whole = npt.NDArray[np.int64]
Make = Callable[[Rng, int], Columns]

PX, HALF = 256, 128

MOST = 3
"""Largest distance by which rows are moved off a tie, 1/256 px."""

SHARED = 32
"""Consecutive rows that share a weapon."""

TENS = 10 ** np.arange(13)


def _powers(rng: Rng, n: int, low: int, high: int) -> Whole:
    """Return random integers from 10^low to 10^high."""
    return np.asarray(rng.integers(1, 10, n) * TENS[rng.integers(low, high, n)])


def _wide(rng: Rng, n: int, size: Any) -> Whole:
    """Return random integer vectors (n, 2), -size to size."""
    return np.asarray(rng.integers(-size, size + 1, (n, 2)))


def _corner(rng: Rng, n: int) -> tuple[Whole, Whole]:
    """Return random pixels, and a corner of each."""
    cells = _wide(rng, n, 40)
    return cells, PX * cells + HALF * either(rng, (n, 2))


def _through(rng: Rng, places: Whole, step: Whole, before: Whole, after: Whole, off: int = MOST) -> tuple[Whole, Whole]:
    """Return segments along integer steps through places, or a little off them."""
    n = len(places)
    moved = _wide(rng, n, off) * (rng.random((n, 1)) < 0.6)
    turned = _wide(rng, n, off) * (rng.random((n, 1)) < 0.3)
    return places - before[:, None] * step + moved, places + after[:, None] * step + moved + turned


# Rays: start, end, pixel


def _near_ray(rng: Rng, n: int) -> Columns:
    cells, corner = _corner(rng, n)
    start, end = _through(rng, corner, _wide(rng, n, 1500), rng.integers(0, 4, n), rng.integers(0, 4, n))
    return start, end, cells


def _corner_ray(rng: Rng, n: int) -> Columns:
    """Make rays exactly from corner to corner, from centre to centre, or through a corner."""
    cells, corner = _corner(rng, n)
    step = np.where(rng.random((n, 1)) < 0.6, HALF * _wide(rng, n, 9), _wide(rng, n, 900))
    start, end = _through(rng, corner, step, rng.integers(0, 4, n), rng.integers(0, 4, n), 0)
    centre = rng.random((n, 1)) < 0.3
    return np.where(centre, PX * (start // PX), start), np.where(centre, PX * (end // PX), end), cells


def _lattice_ray(rng: Rng, n: int) -> Columns:
    """Make rays of small multiples of half pixels."""
    return HALF * _wide(rng, n, 8), HALF * _wide(rng, n, 8), _wide(rng, n, 3)


def _level_ray(rng: Rng, n: int, length: int) -> Columns:
    """Make rays almost along a row or column of pixels, off by a few 1/256 px over the length."""
    cells, corner = _corner(rng, n)
    slope = _wide(rng, n, 2)[:, 0]
    step = np.stack([either(rng, n) * rng.integers(length // 2, length, n), slope], axis=1)
    swap = rng.random((n, 1)) < 0.5
    start, end = _through(
        rng, corner, np.where(swap, step[:, ::-1], step), rng.integers(0, 2, n), np.ones(n, np.int64), 1
    )
    return start, end, cells


def _fast_ray(rng: Rng, n: int) -> Columns:
    """Make rays about 10^6 px long."""
    cells, corner = _corner(rng, n)
    start, end = _through(rng, corner, _wide(rng, n, 3 * 10**7), rng.integers(1, 4, n), rng.integers(1, 4, n))
    return start, end, cells


def _shifted(make: Make, low: int, high: int) -> Make:
    """Move rays far away, by whole pixels."""

    def made(rng: Rng, n: int) -> Columns:
        *points, cells = make(rng, n)
        by = _powers(rng, 2 * n, low, high).reshape(n, 2) * either(rng, (n, 2))
        return *(p + PX * by for p in points), cells + by

    return made


RAYS: dict[str, Make] = {
    "near": _near_ray,
    "far": _shifted(_near_ray, 0, 12),
    "parallel": partial(_level_ray, length=10**4),
    "lattice": _lattice_ray,
    "corners": _corner_ray,
    "fast": _fast_ray,
    "scene": _shifted(_corner_ray, 9, 10),
}


def _around(make: Make) -> Make:
    """Replace pixels by others near the ones aimed at."""

    def made(rng: Rng, n: int) -> Columns:
        start, end, cells = make(rng, n)
        return start, end, cells + _wide(rng, n, 1) * (rng.random((n, 1)) < 0.6)

    return made


def _aimed(make: Make) -> Make:
    """Give shots without length a length of 1/256 px."""

    def made(rng: Rng, n: int) -> Columns:
        start, end, cells = make(rng, n)
        return start, end + (start == end).all(axis=1)[:, None], cells

    return made


CELL_FAMILIES = {name: _around(make) for name, make in RAYS.items() if name != "fast"}
RAY_FAMILIES = {name: _aimed(make) for name, make in RAYS.items()}


# Flights: start, unit vector and how often it is flown, radius, pixel, where that moves


def _flight(rng: Rng, n: int, most: int) -> Columns:
    """Make discs that just touch a pixel's centre or square; consecutive rows share speed and radius."""
    groups = -(-n // SHARED)
    triple = np.repeat(TRIPLES[rng.integers(0, len(TRIPLES), groups)], SHARED, axis=0)[:n]
    unit, length = triple[:, :2] * either(rng, (n, 2)), triple[:, 2]
    times = np.repeat(rng.integers(most // 2, most, groups), SHARED)[:n] // length + 1
    share = np.repeat(np.where(rng.random(groups) < 0.3, 0, rng.integers(0, 1500, groups)), SHARED)[:n] // length
    cells, corner = _corner(rng, n)
    by_corner = (rng.random((n, 1)) < 0.3) | (share == 0)[:, None]
    place = np.where(by_corner, corner, PX * cells + across(unit) * (share * either(rng, n))[:, None])
    slower = rng.integers(-3, 4, n) * (rng.random(n) < 0.4)
    velocity = unit * slower[:, None] + _wide(rng, n, 300) * (rng.random((n, 1)) < 0.3)
    done = rng.integers(0, times + 1)
    start = place - unit * done[:, None] + _wide(rng, n, MOST) * (rng.random((n, 1)) < 0.6)
    return start, unit, times, length * share, cells, velocity


def _far_flight(make: Make, low: int, high: int) -> Make:
    def made(rng: Rng, n: int) -> Columns:
        start, unit, times, radius, cells, velocity = make(rng, n)
        by = _powers(rng, 2 * n, low, high).reshape(n, 2) * either(rng, (n, 2))
        return start + PX * by, unit, times, radius, cells + by, velocity

    return made


FLIGHT_FAMILIES: dict[str, Make] = {
    "near": partial(_flight, most=20_000),
    "far": _far_flight(partial(_flight, most=20_000), 0, 12),
    "fast": partial(_flight, most=PX * 10**6),
    "scene": _far_flight(partial(_flight, most=20_000), 9, 10),
}


# Patterns: what they are, the pixel that is asked for from the shot's own, and where that is


def _places(rng: Rng, n: int, low: int = 0, high: int = 2) -> Whole:
    return np.asarray(_powers(rng, 2 * n, low, high).reshape(n, 2) * either(rng, (n, 2)))


def _disc(rng: Rng, n: int, least: int, most: int, places: tuple[int, int] = (0, 2)) -> Columns:
    """Make discs and pixels at their rim: exactly on it, off by 1 to 3, or anywhere."""
    groups = -(-n // SHARED)
    triple = TRIPLES[rng.integers(0, len(TRIPLES), groups)]
    times = rng.integers(least, most + 1, groups) // triple[:, 2] + (least > 0)
    radius = PX * triple[:, 2] * times + rng.integers(-MOST, MOST + 1, groups) * (rng.random(groups) < 0.6)
    radius, rim = (np.repeat(v, SHARED, axis=0)[:n] for v in (np.maximum(radius, 0), triple[:, :2] * times[:, None]))
    reach = radius // PX
    x = rng.integers(-reach, reach + 1)
    y = np.rint(np.sqrt(reach * reach - x * x)).astype(np.int64) + rng.integers(-1, 2, n)
    cells = np.where(rng.random((n, 1)) < 0.5, rim, np.stack([x, y], axis=1)) * either(rng, (n, 2))
    cells = np.where(rng.random((n, 1)) < 0.5, cells, cells[:, ::-1])
    return radius, cells, _places(rng, n, *places)


def _one_px_disc(rng: Rng, n: int) -> Columns:
    """Make discs with radii up to a pixel and a half."""
    radius = np.repeat(rng.integers(0, 6, -(-n // SHARED)) * HALF // 2, SHARED)[:n]
    radius = np.maximum(radius + np.repeat(rng.integers(-1, 2, -(-n // SHARED)), SHARED)[:n], 0)
    return radius, _wide(rng, n, 1), _places(rng, n)


DISC_FAMILIES: dict[str, Make] = {
    "near": partial(_disc, least=5, most=400),
    "far": partial(_disc, least=5, most=400, places=(0, 12)),
    "lattice": partial(_disc, least=1, most=40),
    "one": _one_px_disc,
    "vast": partial(_disc, least=5500, most=5642),
    "scene": partial(_disc, least=5, most=400, places=(9, 10)),
}


def _beam(rng: Rng, n: int, most: int, places: tuple[int, int] = (0, 2)) -> Columns:
    """Make beams along integer vectors (unit, times, radius, pixel, place), with pixels on or near a side or an end."""
    groups = -(-n // SHARED)
    triple = np.repeat(TRIPLES[rng.integers(0, len(TRIPLES), groups)], SHARED, axis=0)[:n]
    unit, length = triple[:, :2] * either(rng, (n, 2)), triple[:, 2]
    long = np.repeat(rng.integers(most // 2, most + 1, groups), SHARED)[:n] // length + 1
    wide = np.repeat(rng.integers(0, most // 2 + 1, groups), SHARED)[:n] // length
    off = np.repeat(rng.integers(-MOST, MOST + 1, groups) * (rng.random(groups) < 0.6), SHARED)[:n]
    beside = unit * rng.integers(0, long + 1)[:, None] + across(unit) * (wide * either(rng, n))[:, None]
    ends = unit * np.where(rng.random(n) < 0.5, -wide, long + wide)[:, None]
    cells = np.where(rng.random((n, 1)) < 0.8, beside, ends) + _wide(rng, n, 1) * (rng.random((n, 1)) < 0.3)
    return unit, PX * long, np.maximum(PX * wide * length + off, 0), cells, _places(rng, n, *places)


def _thin_beam(rng: Rng, n: int) -> Columns:
    """Make beams of 10^4 px at most 3/256 px wide, whose pixels are those of the axis."""
    unit, times, _, _, places = _beam(rng, n, 10_000)
    along = unit * rng.integers(0, times // PX + 1)[:, None]
    radius = np.repeat(rng.integers(0, MOST + 1, -(-n // SHARED)), SHARED)[:n]
    return unit, times, radius, along + _wide(rng, n, 1), places


BEAM_FAMILIES: dict[str, Make] = {
    "near": partial(_beam, most=400),
    "far": partial(_beam, most=400, places=(0, 12)),
    "needles": _thin_beam,
    "lattice": partial(_beam, most=20),
    "vast": partial(_beam, most=10_000),
    "scene": partial(_beam, most=400, places=(9, 10)),
}


def _pattern(rng: Rng, n: int, size: int, places: tuple[int, int] = (0, 2), thin: int = 1) -> Columns:
    """Make polygons on 1/256 px, some on whole pixels, and pixels on or near their sides."""
    rings: list[Whole] = []
    groups = -(-n // SHARED)
    while len(rings) < groups:
        ring = np.rint(rng.uniform(-1, 1, (int(rng.integers(3, 6)), 2)) * size * np.array([1, 1 / thin])).astype(
            np.int64
        )
        ring = PX * ring if rng.random() < 0.6 else PX * ring + _wide(rng, len(ring), HALF)
        if is_simple(ring.tolist()):
            rings.append(np.concatenate([ring, np.repeat(ring[-1:], 5 - len(ring), axis=0)]))
    every = np.repeat(np.array(rings), SHARED, axis=0)[:n]
    rows, side = np.arange(n), rng.integers(0, 5, n)
    p, q = every[rows, side], every[rows, (side + 1) % 5]
    share = np.where(rng.random(n) < 0.5, rng.choice([0.0, 0.5], n), rng.random(n))[:, None]
    near = np.rint((p + share * (q - p)) / PX).astype(np.int64)
    return every, near + _wide(rng, n, 1) * (rng.random((n, 1)) < 0.3), _places(rng, n, *places)


PATTERN_FAMILIES: dict[str, Make] = {
    "near": partial(_pattern, size=300),
    "far": partial(_pattern, size=300, places=(0, 12)),
    "needles": partial(_pattern, size=5000, thin=1000),
    "lattice": partial(_pattern, size=6),
    "one": partial(_pattern, size=1),
    "vast": partial(_pattern, size=10_000),
    "scene": partial(_pattern, size=300, places=(9, 10)),
}


Array = npt.NDArray[Any]
Method = Callable[..., Bools]
Families = Mapping[str, Callable[[Rng, int], Columns]]

APART = 2**22
"""Distance between the areas of two rows, px; more than twice the reach of any shot."""

ABREAST = 32
"""Areas side by side in x."""


@dataclass(frozen=True)
class Predicate:
    """A predicate that methods decide.

    Parameters
    ----------
    truth : exact answer, given a row of numbers
    ours, naive : answers of hitplanes and of the textbook, given columns
    families : makers of columns
    rows, quick : number of rows of a family in a full run, and in a quick one
    block : number of rows at a time
    cost : relative cost of a row
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
        """Return the exact answer of each row."""
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
    """Test points; consecutive rows with equal polygons share one."""
    new = np.concatenate([[True], (rings[1:] != rings[:-1]).any(axis=(1, 2))])
    distinct = rings[new]
    made = ConcavePolygons(distinct.reshape(-1, 2), _starts(distinct))
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


# Ours: rays, projectiles and patterns, each with its target in a separate area


def _ray_cells(start: Array, end: Array, cells: Array) -> Bools:
    ray, met, *_ = cells_of_rays(start, end)
    found = np.zeros(len(cells), np.bool_)
    near = (met == cells[ray]).all(axis=1)
    found[ray[near]] = True
    return found


def _grounds(n: int) -> Array:
    """Return offsets (n, 2), px, that separate the rows so that no shot reaches the target of another."""
    row = np.arange(n)
    return APART * np.stack([row % ABREAST, row // ABREAST], axis=1)


def _scene(cells: Array, velocity: Array | None = None) -> Scene:
    """Make a scene with a target of one pixel for each row."""
    scene, target = Scene(), Sprite.from_mask(np.ones((1, 1), np.bool_))
    moves = np.zeros_like(cells) if velocity is None else velocity / SUB
    for cell, move in zip(cells.tolist(), moves.tolist(), strict=True):
        scene.add(target, cell, velocity_xy=move)
    return scene


def _own(hits: Hits, rows: Array) -> Bools:
    """Return which shots hit the target of their own row."""
    found = np.zeros(len(rows), np.bool_)
    found[hits.shot[hits.object == rows[hits.shot]]] = True
    return found


def _ray_targets(start: Array, end: Array, cells: Array) -> Bools:
    hits = fire(_scene(cells), Laser(None), start / SUB, toward=end / SUB)  # passes through other rows' targets
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
    """Fire all rows of a weapon in one call, each in a separate area; a third column is a direction."""
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


# Exact answers of rows


def _flies_into(start: Any, unit: Any, times: int, radius: int, cell: Any, velocity: Any) -> bool:
    return truth.disc_flies_into(start, [times * v for v in unit], radius, cell, velocity)


def _in_disc(radius: int, cell: Any, place: Any) -> bool:
    return truth.in_disc(radius, cell)


def _in_beam(unit: Any, times: int, radius: int, cell: Any, place: Any) -> bool:
    return truth.in_beam([times * v for v in unit], radius, cell)


def _in_pattern(ring: Any, cell: Any, place: Any) -> bool:
    return truth.polygon_holds(ring, [SUB * v for v in cell])


ROUND = ("needles", "parallel", "shared")
"""Families that need sides, which circles lack."""

CLOSED, HULLS, FIRED = (10**6, 1000, 25_000, 1), (5 * 10**4, 300, 5000, 5), (10**4, 200, 1000, 30)
"""Rows, quick, block and cost of predicates with a closed form, with corners, and with a whole scene."""

PREDICATES = (
    Predicate(
        "circles", truth.circles_meet, _circles, rivals.circles, _pairs("circle", "circle", without=ROUND), *CLOSED,
    ),
    Predicate("boxes", truth.boxes_meet, _boxes, rivals.boxes, _pairs("box", "box", without=("walls",)), *CLOSED),
    Predicate(
        "capsule, circle", truth.capsule_meets_circle, _capsule_circle, rivals.capsule_circle,
        _pairs("capsule", "circle", without=("parallel", "shared")), *CLOSED,
    ),
    Predicate("point in polygon", truth.polygon_holds, _point_polygon, rivals.point_polygon, POINT_FAMILIES, *HULLS),
    Predicate(
        "circle, polygon", truth.circle_meets_polygon, _circle_polygon, rivals.circle_polygon,
        _pairs("polygon", "circle", without=("parallel", "shared")), *HULLS,
    ),
    Predicate(
        "polygons", truth.polygons_meet, _polygon_pair, rivals.polygons,
        _pairs("polygon", "polygon", without=("walls",)), *HULLS,
    ),
    Predicate(
        "oriented boxes", truth.polygons_meet, _oriented_boxes, rivals.oriented_boxes,
        _pairs("oriented box", "oriented box", without=("walls",)), *HULLS,
    ),
    Predicate("triangles in space", truth.triangles_meet, triangles_meet, rivals.triangles, TRIANGLE_FAMILIES, *HULLS),
    Predicate("ray's pixels", truth.segment_meets_cell, _ray_cells, rivals.ray_cells, CELL_FAMILIES, *HULLS),
    Predicate("ray, 1-px target", truth.segment_meets_cell, _ray_targets, rivals.ray_targets, RAY_FAMILIES, *FIRED),
    Predicate("projectile, 1-px target", _flies_into, _flights, rivals.flights, FLIGHT_FAMILIES, *FIRED),
    Predicate("disc's pixels", _in_disc, _disc_pixels, rivals.disc_pixels, DISC_FAMILIES, *FIRED),
    Predicate("beam's pixels", _in_beam, _beam_pixels, rivals.beam_pixels, BEAM_FAMILIES, *FIRED),
    Predicate("polygon's pixels", _in_pattern, _pattern_pixels, rivals.pattern_pixels, PATTERN_FAMILIES, *FIRED),
)  # fmt: skip
"""All predicates, in the order of the table."""
