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
from hitplanes.planes.grid.rasterize import cells_of
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite
from hitplanes.planes.volumes.overlap import contains_point, overlap
from hitplanes.planes.volumes.volumes import Aabbs, Capsules, Circles, ConcavePolygons, Obbs, Polygons, Volumes

from ...fire.call import fire
from ...kinds.areas import Beam, Disc, Polygon
from ...kinds.rays import Laser, Projectile
from ...kinds.weapon import Weapon
from . import textbook, truth
from .families import (
    MAKERS,
    POINT_FAMILIES,
    TRIANGLE_FAMILIES,
    TRIPLES,
    Columns,
    Make,
    Rng,
    across,
    either,
    random_sides,
    shape_pairs,
)

Whole = npt.NDArray[np.int64]

PX, HALF = 256, 128
MOST = 3  # largest distance by which rows are moved off a tie, 1/256 px
SHARED = 32  # consecutive rows that share a weapon
TENS = 10 ** np.arange(13)


def _places(rng: Rng, n: int, low: int = 0, high: int = 2) -> Whole:
    """Return random places (n, 2) whose coordinates are from 10^low to 10^high."""
    powers = rng.integers(1, 10, 2 * n) * TENS[rng.integers(low, high, 2 * n)]
    return np.asarray(powers.reshape(n, 2) * either(rng, (n, 2)))


def _held(values: Whole, n: int) -> Whole:
    """Repeat rows, so that SHARED consecutive ones of n are equal."""
    return np.repeat(values, SHARED, axis=0)[:n]


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


def _passing_ray(rng: Rng, n: int, size: int, least: int) -> Columns:
    """Make rays that pass corners, or begin or end there, of a few steps of a size."""
    cells, corner = _corner(rng, n)
    start, end = _through(rng, corner, _wide(rng, n, size), rng.integers(least, 4, n), rng.integers(least, 4, n))
    return start, end, cells


def _corner_ray(rng: Rng, n: int) -> Columns:
    """Make rays exactly from corner to corner, from centre to centre, or through a corner."""
    cells, corner = _corner(rng, n)
    step = np.where(rng.random((n, 1)) < 0.6, HALF * _wide(rng, n, 9), _wide(rng, n, 900))
    start, end = _through(rng, corner, step, rng.integers(0, 4, n), rng.integers(0, 4, n), 0)
    centre = rng.random((n, 1)) < 0.3
    return np.where(centre, PX * (start // PX), start), np.where(centre, PX * (end // PX), end), cells


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


def _then(make: Make, change: Callable[..., Columns]) -> Make:
    """Change rows after they are made."""
    return lambda rng, n: change(rng, *make(rng, n))


def _shifted(rng: Rng, *columns: Whole, units: Mapping[int, int], low: int, high: int) -> Columns:
    """Move shots and targets far away by whole pixels; `units` are the lengths of a pixel in columns of places."""
    by = _places(rng, len(columns[0]), low, high)
    return tuple(column + units[k] * by if k in units else column for k, column in enumerate(columns))


_near_ray = partial(_passing_ray, size=1500, least=0)
_far_ray = partial(_shifted, units={0: PX, 1: PX, 2: 1})

RAYS: dict[str, Make] = {
    "near": _near_ray,
    "far": _then(_near_ray, partial(_far_ray, low=0, high=12)),
    "parallel": partial(_level_ray, length=10**4),
    "lattice": lambda rng, n: (HALF * _wide(rng, n, 8), HALF * _wide(rng, n, 8), _wide(rng, n, 3)),
    "corners": _corner_ray,
    "fast": partial(_passing_ray, size=3 * 10**7, least=1),  # about 10^6 px long
    "scene": _then(_corner_ray, partial(_far_ray, low=9, high=10)),
}
CELL_FAMILIES = {  # of pixels near the ones aimed at
    name: _then(make, lambda rng, a, b, c: (a, b, c + _wide(rng, len(c), 1) * (rng.random((len(c), 1)) < 0.6)))
    for name, make in RAYS.items()
    if name != "fast"
}
RAY_FAMILIES = {  # shots without length have one of 1/256 px
    name: _then(make, lambda _, a, b, cells: (a, b + (a == b).all(axis=1)[:, None], cells))
    for name, make in RAYS.items()
}


# Flights: start, unit vector and how often it is flown, radius, pixel, where that moves


def _flight(rng: Rng, n: int, most: int) -> Columns:
    """Make discs that just touch a pixel's centre or square; consecutive rows share speed and radius."""
    groups = -(-n // SHARED)
    triple = _held(TRIPLES[rng.integers(0, len(TRIPLES), groups)], n)
    unit, length = triple[:, :2] * either(rng, (n, 2)), triple[:, 2]
    times = _held(rng.integers(most // 2, most, groups), n) // length + 1
    share = _held(np.where(rng.random(groups) < 0.3, 0, rng.integers(0, 1500, groups)), n) // length
    cells, corner = _corner(rng, n)
    by_corner = (rng.random((n, 1)) < 0.3) | (share == 0)[:, None]
    place = np.where(by_corner, corner, PX * cells + across(unit) * (share * either(rng, n))[:, None])
    slower = rng.integers(-3, 4, n) * (rng.random(n) < 0.4)
    velocity = unit * slower[:, None] + _wide(rng, n, 300) * (rng.random((n, 1)) < 0.3)
    done = rng.integers(0, times + 1)
    start = place - unit * done[:, None] + _wide(rng, n, MOST) * (rng.random((n, 1)) < 0.6)
    return start, unit, times, length * share, cells, velocity


_near_flight = partial(_flight, most=20_000)
_far_flight = partial(_shifted, units={0: PX, 4: 1})

FLIGHT_FAMILIES: dict[str, Make] = {
    "near": _near_flight,
    "far": _then(_near_flight, partial(_far_flight, low=0, high=12)),
    "fast": partial(_flight, most=PX * 10**6),
    "scene": _then(_near_flight, partial(_far_flight, low=9, high=10)),
}


# Patterns: what they are, the pixel that is asked for from the shot's own, and where that is


def _placed(make: Callable[..., Columns], **others: Make) -> dict[str, Make]:
    """Return the families of patterns near the origin, far from it, and in scenes at 10^9, with others between them."""
    return {"near": make, "far": partial(make, places=(0, 12)), **others, "scene": partial(make, places=(9, 10))}


def _disc(rng: Rng, n: int, least: int, most: int, places: tuple[int, int] = (0, 2)) -> Columns:
    """Make discs and pixels at their rim: exactly on it, off by 1 to 3, or anywhere."""
    groups = -(-n // SHARED)
    triple = TRIPLES[rng.integers(0, len(TRIPLES), groups)]
    times = rng.integers(least, most + 1, groups) // triple[:, 2] + (least > 0)
    radius = PX * triple[:, 2] * times + rng.integers(-MOST, MOST + 1, groups) * (rng.random(groups) < 0.6)
    radius, rim = (_held(v, n) for v in (np.maximum(radius, 0), triple[:, :2] * times[:, None]))
    reach = radius // PX
    x = rng.integers(-reach, reach + 1)
    y = np.rint(np.sqrt(reach * reach - x * x)).astype(np.int64) + rng.integers(-1, 2, n)
    cells = np.where(rng.random((n, 1)) < 0.5, rim, np.stack([x, y], axis=1)) * either(rng, (n, 2))
    cells = np.where(rng.random((n, 1)) < 0.5, cells, cells[:, ::-1])
    return radius, cells, _places(rng, n, *places)


def _one_px_disc(rng: Rng, n: int) -> Columns:
    """Make discs with radii up to a pixel and a half."""
    groups = -(-n // SHARED)
    radius = HALF * rng.integers(0, 6, groups) // 2
    radius = _held(np.maximum(radius + rng.integers(-1, 2, groups), 0), n)
    return radius, _wide(rng, n, 1), _places(rng, n)


DISC_FAMILIES = _placed(
    partial(_disc, least=5, most=400), lattice=partial(_disc, least=1, most=40), one=_one_px_disc,
    vast=partial(_disc, least=5500, most=5642),
)  # fmt: skip


def _beam(rng: Rng, n: int, most: int, places: tuple[int, int] = (0, 2)) -> Columns:
    """Make beams along integer vectors (unit, times, radius, pixel, place), with pixels on or near a side or an end."""
    groups = -(-n // SHARED)
    triple = _held(TRIPLES[rng.integers(0, len(TRIPLES), groups)], n)
    unit, length = triple[:, :2] * either(rng, (n, 2)), triple[:, 2]
    long = _held(rng.integers(most // 2, most + 1, groups), n) // length + 1
    wide = _held(rng.integers(0, most // 2 + 1, groups), n) // length
    off = _held(rng.integers(-MOST, MOST + 1, groups) * (rng.random(groups) < 0.6), n)
    beside = unit * rng.integers(0, long + 1)[:, None] + across(unit) * (wide * either(rng, n))[:, None]
    ends = unit * np.where(rng.random(n) < 0.5, -wide, long + wide)[:, None]
    cells = np.where(rng.random((n, 1)) < 0.8, beside, ends) + _wide(rng, n, 1) * (rng.random((n, 1)) < 0.3)
    return unit, PX * long, np.maximum(PX * wide * length + off, 0), cells, _places(rng, n, *places)


def _thin_beam(rng: Rng, n: int) -> Columns:
    """Make beams of 10^4 px at most 3/256 px wide, whose pixels are those of the axis."""
    unit, times, _, _, places = _beam(rng, n, 10_000)
    along = unit * rng.integers(0, times // PX + 1)[:, None]
    radius = _held(rng.integers(0, MOST + 1, -(-n // SHARED)), n)
    return unit, times, radius, along + _wide(rng, n, 1), places


BEAM_FAMILIES = _placed(
    partial(_beam, most=400), needles=_thin_beam, lattice=partial(_beam, most=20), vast=partial(_beam, most=10_000)
)


def _pattern(rng: Rng, n: int, size: int, places: tuple[int, int] = (0, 2), thin: int = 1) -> Columns:
    """Make polygons on 1/256 px, some on whole pixels, and pixels on or near their sides."""
    rings: list[Whole] = []
    groups = -(-n // SHARED)
    while len(rings) < groups:
        corners = rng.uniform(-1, 1, (int(rng.integers(3, 6)), 2)) * size * np.array([1, 1 / thin])
        ring = np.rint(corners).astype(np.int64)
        ring = PX * ring if rng.random() < 0.6 else PX * ring + _wide(rng, len(ring), HALF)
        if truth.is_simple(ring.tolist()):
            rings.append(np.concatenate([ring, np.repeat(ring[-1:], 5 - len(ring), axis=0)]))
    every = _held(np.array(rings), n)
    p, q = random_sides(rng, every)
    share = np.where(rng.random(n) < 0.5, rng.choice([0.0, 0.5], n), rng.random(n))[:, None]
    near = np.rint((p + share * (q - p)) / PX).astype(np.int64)
    return every, near + _wide(rng, n, 1) * (rng.random((n, 1)) < 0.3), _places(rng, n, *places)


PATTERN_FAMILIES = _placed(
    partial(_pattern, size=300), needles=partial(_pattern, size=5000, thin=1000), lattice=partial(_pattern, size=6),
    one=partial(_pattern, size=1), vast=partial(_pattern, size=10_000),
)  # fmt: skip


Array = npt.NDArray[Any]
Method = Callable[..., Bools]
Families = Mapping[str, Make]
APART = 2**22  # px between the areas of two rows; more than twice the reach of any shot
ABREAST = 32  # areas side by side in x


@dataclass(frozen=True)
class Predicate:
    """A predicate that methods decide.

    `truth` is the exact answer, given a row of numbers; `ours` and `naive` are the answers of hitplanes and of the
    textbook, given the columns that a family makes. A family has so many rows in a full run and in a quick one, made by
    the block; `cost` is the relative cost of a row.
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
    return {family: shape_pairs((kinds[0], kinds[1]), family) for family in MAKERS if family not in without}


# Ours: volumes


def _polygons(rings: Array, kind: type[Polygons | ConcavePolygons] = Polygons) -> Volumes:
    return kind(rings.reshape(-1, 2), np.arange(0, rings.shape[0] * rings.shape[1], rings.shape[1]))


def _point_polygon(rings: Array, points: Array) -> Bools:
    """Test points; consecutive rows with equal polygons share one."""
    new = np.concatenate([[True], (rings[1:] != rings[:-1]).any(axis=(1, 2))])
    return contains_point(_polygons(rings[new], ConcavePolygons).take(np.cumsum(new) - 1), points)


# Ours: shots, each with its target


def _ray_cells(start: Array, end: Array, cells: Array) -> Bools:
    ray, met, *_ = cells_of(start, end)
    found = np.zeros(len(cells), np.bool_)
    found[ray[(met == cells[ray]).all(axis=1)]] = True
    return found


def _hit(weapon: Weapon, cells: Array, at: Array, toward: Array | None = None, velocity: Array | None = None) -> Bools:
    """Fire a shot for each row, and return which hit the target of their own row, which is one pixel."""
    scene, target = Scene(), Sprite.from_mask(np.ones((1, 1), np.bool_))
    moves = np.zeros_like(cells) if velocity is None else velocity / SUB
    for cell, move in zip(cells.tolist(), moves.tolist(), strict=True):
        scene.add(target, cell, velocity_xy=move)
    aim: Any = {} if toward is None else {"toward": toward}
    hits = fire(scene, weapon, at, **aim)
    found = np.zeros(len(cells), np.bool_)
    found[hits.shot[hits.object == hits.shot]] = True
    return found


def _by_weapon(
    keys: Array, weapon: Callable[[Any], Weapon], cells: Array, at: Array,
    along: Array | None = None, velocity: Array | None = None,
) -> Bools:  # fmt: skip
    """Fire all rows of a weapon in one call, each in a separate area, so that no shot reaches another row's target."""
    found = np.zeros(len(cells), np.bool_)
    _, which = np.unique(keys.reshape(len(keys), -1), axis=0, return_inverse=True)
    for k in range(which.max(initial=-1) + 1):
        rows = np.flatnonzero(which == k)
        area = np.arange(len(rows))
        by = APART * np.stack([area % ABREAST, area // ABREAST], axis=1)
        start = (at[rows] + by).astype(np.float64)
        toward = None if along is None else start + along[rows]
        own = None if velocity is None else velocity[rows]
        found[rows] = _hit(weapon(keys[rows[0]].tolist()), cells[rows] + by, start, toward, own)
    return found


def _long(unit: Array, times: Array, radius: Array) -> Array:
    """Return lengths and radii as keys (n, 2)."""
    return np.stack([np.rint(np.sqrt((unit * unit).sum(axis=1))).astype(np.int64) * times, radius], axis=1)


def _flights(start: Array, unit: Array, times: Array, radius: Array, cells: Array, velocity: Array) -> Bools:
    keys = _long(unit, times, radius)
    return _by_weapon(keys, lambda k: Projectile(k[0] / SUB, k[1] / SUB), cells, start / SUB, unit, velocity)


def _beam_pixels(unit: Array, times: Array, radius: Array, cells: Array, places: Array) -> Bools:
    keys = _long(unit, times, radius)
    return _by_weapon(keys, lambda k: Beam(k[0] / SUB, 2 * k[1] / SUB), cells + places, places, unit)


ROUND = ("needles", "parallel", "shared")  # families that need sides, which circles lack

CLOSED, HULLS, FIRED = (10**6, 1000, 25_000, 1), (5 * 10**4, 300, 5000, 5), (10**4, 200, 1000, 30)
"""Rows, quick, block and cost of predicates with a closed form, with corners, and with a whole scene."""

PREDICATES = (
    Predicate(
        "circles", truth.circles_meet, lambda a, r, b, s: overlap(Circles(a, r), Circles(b, s)), textbook.circles,
        _pairs("circle", "circle", without=ROUND), *CLOSED,
    ),
    Predicate(
        "boxes", truth.boxes_meet, lambda a, a_max, b, b_max: overlap(Aabbs(a, a_max), Aabbs(b, b_max)), textbook.boxes,
        _pairs("box", "box", without=("walls",)), *CLOSED,
    ),
    Predicate(
        "capsule, circle", truth.capsule_meets_circle,
        lambda a, b, r, center, s: overlap(Capsules(a, b, r), Circles(center, s)), textbook.capsule_circle,
        _pairs("capsule", "circle", without=("parallel", "shared")), *CLOSED,
    ),
    Predicate("point in polygon", truth.polygon_holds, _point_polygon, textbook.point_polygon, POINT_FAMILIES, *HULLS),
    Predicate(
        "circle, polygon", truth.circle_meets_polygon,
        lambda rings, center, r: overlap(_polygons(rings), Circles(center, r)), textbook.circle_polygon,
        _pairs("polygon", "circle", without=("parallel", "shared")), *HULLS,
    ),
    Predicate(
        "polygons", truth.polygons_meet, lambda a, b: overlap(_polygons(a), _polygons(b)), textbook.polygons,
        _pairs("polygon", "polygon", without=("walls",)), *HULLS,
    ),
    Predicate(
        "oriented boxes", truth.polygons_meet, lambda a, b: overlap(Obbs.from_corners(a), Obbs.from_corners(b)),
        partial(textbook.polygons, sides=2), _pairs("oriented box", "oriented box", without=("walls",)), *HULLS,
    ),
    Predicate(
        "triangles in space", truth.triangles_meet, triangles_meet, textbook.triangles, TRIANGLE_FAMILIES, *HULLS,
    ),
    Predicate("ray's pixels", truth.segment_meets_cell, _ray_cells, textbook.ray_cells, CELL_FAMILIES, *HULLS),
    Predicate(
        "ray, 1-px target", truth.segment_meets_cell,
        lambda start, end, cells: _hit(Laser(None), cells, start / SUB, end / SUB),  # through other rows' targets
        textbook.ray_targets, RAY_FAMILIES, *FIRED,
    ),
    Predicate(
        "projectile, 1-px target",
        lambda a, unit, times, r, cell, v: truth.disc_flies_into(a, [times * u for u in unit], r, cell, v),
        _flights, textbook.flights, FLIGHT_FAMILIES, *FIRED,
    ),
    Predicate(
        "disc's pixels", lambda r, cell, _: truth.in_disc(r, cell),
        lambda r, cells, places: _by_weapon(r, lambda key: Disc(key / SUB), cells + places, places),
        textbook.disc_pixels, DISC_FAMILIES, *FIRED,
    ),
    Predicate(
        "beam's pixels", lambda unit, times, r, cell, _: truth.in_beam([times * u for u in unit], r, cell),
        _beam_pixels, textbook.beam_pixels, BEAM_FAMILIES, *FIRED,
    ),
    Predicate(
        "polygon's pixels", lambda ring, cell, _: truth.polygon_holds(ring, [SUB * v for v in cell]),
        lambda rings, cells, places: _by_weapon(
            rings, lambda ring: Polygon([(x / SUB, y / SUB) for k, (x, y) in enumerate(ring) if [x, y] != ring[k - 1]]),
            cells + places, places,
        ),
        textbook.pattern_pixels, PATTERN_FAMILIES, *FIRED,
    ),
)  # fmt: skip
"""All predicates, in the order of the table."""
