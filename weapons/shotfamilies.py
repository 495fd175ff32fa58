"""Shots that are hard to decide, from a seed: rays through corners, fast discs, and pixels at the rims of patterns.

All numbers are whole, in 1/256 px, but for cells, which are pixels. A row asks if its shot meets its pixel. Shots
whose end is rounded go along whole vectors of whole length, where nothing is lost by that.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from weapons.families import TRIPLES, Columns, Rng, across, either
from weapons.truth import is_simple

__all__ = ["BEAM_FAMILIES", "CELL_FAMILIES", "DISC_FAMILIES", "FLIGHT_FAMILIES", "PATTERN_FAMILIES", "RAY_FAMILIES"]

Whole = npt.NDArray[np.int64]
Make = Callable[[Rng, int], Columns]

PX, HALF = 256, 128

MOST = 3
"""How far off a tie rows are moved at most, 1/256 px."""

SHARED = 32
"""Rows in turn that have one weapon."""

TENS = 10 ** np.arange(13)


def _powers(rng: Rng, n: int, low: int, high: int) -> Whole:
    """Whole numbers from 10^low to 10^high."""
    return np.asarray(rng.integers(1, 10, n) * TENS[rng.integers(low, high, n)])


def _wide(rng: Rng, n: int, size: Any) -> Whole:
    """Vectors (n, 2) of whole numbers up to a size either way."""
    return np.asarray(rng.integers(-size, size + 1, (n, 2)))


def _corner(rng: Rng, n: int) -> tuple[Whole, Whole]:
    """Pixels, and a corner of each."""
    cells = _wide(rng, n, 40)
    return cells, PX * cells + HALF * either(rng, (n, 2))


def _through(rng: Rng, places: Whole, step: Whole, before: Whole, after: Whole, off: int = MOST) -> tuple[Whole, Whole]:
    """Segments along whole steps through places, or a little off them."""
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
    """From corner to corner, from centre to centre, or through a corner from anywhere: exactly."""
    cells, corner = _corner(rng, n)
    step = np.where(rng.random((n, 1)) < 0.6, HALF * _wide(rng, n, 9), _wide(rng, n, 900))
    start, end = _through(rng, corner, step, rng.integers(0, 4, n), rng.integers(0, 4, n), 0)
    centre = rng.random((n, 1)) < 0.3
    return np.where(centre, PX * (start // PX), start), np.where(centre, PX * (end // PX), end), cells


def _lattice_ray(rng: Rng, n: int) -> Columns:
    """Small whole numbers of half pixels."""
    return HALF * _wide(rng, n, 8), HALF * _wide(rng, n, 8), _wide(rng, n, 3)


def _level_ray(rng: Rng, n: int, length: int) -> Columns:
    """Almost along a row or column of pixels: off by a few 1/256 px over its length."""
    cells, corner = _corner(rng, n)
    slope = _wide(rng, n, 2)[:, 0]
    step = np.stack([either(rng, n) * rng.integers(length // 2, length, n), slope], axis=1)
    swap = rng.random((n, 1)) < 0.5
    start, end = _through(
        rng, corner, np.where(swap, step[:, ::-1], step), rng.integers(0, 2, n), np.ones(n, np.int64), 1
    )
    return start, end, cells


def _fast_ray(rng: Rng, n: int) -> Columns:
    """About 10^6 px long."""
    cells, corner = _corner(rng, n)
    start, end = _through(rng, corner, _wide(rng, n, 3 * 10**7), rng.integers(1, 4, n), rng.integers(1, 4, n))
    return start, end, cells


def _shifted(make: Make, low: int, high: int) -> Make:
    """The same far away, by whole pixels."""

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
    """Ask for a pixel near the one that was aimed at."""

    def made(rng: Rng, n: int) -> Columns:
        start, end, cells = make(rng, n)
        return start, end, cells + _wide(rng, n, 1) * (rng.random((n, 1)) < 0.6)

    return made


def _aimed(make: Make) -> Make:
    """A shot has a length: where there is none, one of 1/256 px."""

    def made(rng: Rng, n: int) -> Columns:
        start, end, cells = make(rng, n)
        return start, end + (start == end).all(axis=1)[:, None], cells

    return made


CELL_FAMILIES = {name: _around(make) for name, make in RAYS.items() if name != "fast"}
RAY_FAMILIES = {name: _aimed(make) for name, make in RAYS.items()}


# Flights: start, unit vector and how often it is flown, radius, pixel, where that moves


def _flight(rng: Rng, n: int, most: int) -> Columns:
    """Discs that touch the centre of a pixel, or the pixel by their middle; rows in turn share speed and radius."""
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
    """Radii, and pixels at the rim: at whole vectors of whole length exactly, off by 1 to 3, or anywhere on it."""
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
    """Radii up to a pixel and a half."""
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
    """Beams along whole vectors: unit, how often, radius, pixel, place. Pixels lie on a side or an end, or near it."""
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
    """Beams of 10^4 px that are at most 3/256 px wide: their pixels are those of the axis."""
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
    """Polygons on 1/256 px, some on whole pixels, and pixels on their sides, or near them."""
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
