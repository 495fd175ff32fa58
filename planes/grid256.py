"""The 1/256-px grid: positions and directions as integers, each rounded once.

A position is `snap(v) = rint(256 v)`, half to even. A direction is (cos, sin) times 2**30, correctly rounded, so that
it is the same on every machine, and so that quarter turns and mirrors are exact.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TypeVar

import numpy as np

from planes import sines
from planes.arrays import InputError, Ints
from planes.constants import HALF, SUB, TRIG_BITS
from planes.twins import kernels_of

__all__ = [
    "isqrt",
    "over_one",
    "pixel",
    "quarter_turns",
    "rounded_div",
    "scaled",
    "snap",
    "toward",
    "turned",
    "unit",
    "unit_toward",
]

ONE = 1 << TRIG_BITS
Whole = TypeVar("Whole", int, Ints)
_PI = (31415926535897932384626433832795028841971693993751, 10**49)
_FIXED_BITS = 160  # as exact as _PI

ANGLES_KEPT = 2**12
"""Angles whose directions are kept: objects turn by the same steps again and again."""


def snap(values: object) -> Ints:
    """Round positions in px to the 1/256-px grid, half to even: the only rounding of a position."""
    return np.rint(np.asarray(values, np.float64) * SUB).astype(np.int64)


def pixel(position_256: Ints) -> Ints:
    """Whole pixel that holds a position; on a pixel border, the one to the right or below."""
    moved = position_256 + HALF
    moved >>= 8  # in the same array
    return moved


def rounded_div(numerator: Ints, denominator: Ints | int) -> Ints:
    """Divide integers (denominator > 0), rounding half to even: an odd function of the numerator."""
    quotient, rest = np.divmod(np.asarray(numerator), denominator)
    twice = 2 * rest
    up = (twice > denominator) | ((twice == denominator) & (quotient & 1 == 1))
    return np.asarray(quotient + up)


def isqrt(values: Ints) -> Ints:
    """Floor of the square root of non-negative int64 values, exactly."""
    values = np.asarray(values, np.int64)
    root = np.sqrt(values.astype(np.float64)).astype(np.int64)
    root = np.minimum(root, 3_037_000_499)  # floor(sqrt(2**63 - 1)): its square must not wrap
    root -= root * root > values
    above = np.minimum(root + 1, 3_037_000_499)
    return np.where((above * above <= values) & (above > root), above, root)


def unit(degrees: object) -> tuple[Ints, Ints]:
    """(cos, sin) times 2**30 of angles in degrees, correctly rounded.

    A value too near to a tie for the float sine is worked out in integers.
    """
    angle = np.asarray(degrees, np.float64)
    each = angle.ravel()
    c, s, doubt = kernels_of(sines).nearest(each)
    for i in doubt.tolist():
        c[i], s[i] = _exactly(float(each[i]))
    return c.reshape(angle.shape), s.reshape(angle.shape)


def unit_toward(dx: Ints | int, dy: Ints | int) -> tuple[Ints, Ints]:
    """Direction of integer vectors, (cos, sin) times 2**30, correctly rounded, without an angle."""
    x, y = np.broadcast_arrays(np.asarray(dx, np.int64), np.asarray(dy, np.int64))
    pairs = [toward(int(a), int(b)) for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    both = np.array(pairs, np.int64).reshape((*x.shape, 2))
    return both[..., 0], both[..., 1]


@lru_cache(maxsize=ANGLES_KEPT)
def quarter_turns(degrees: float) -> tuple[int, int, int]:
    """Split an angle into k quarter turns and a rest in [-45, 45), as (k mod 4, cos, sin) of the rest."""
    folded = math.fmod(degrees, 360.0)
    k = math.floor((folded + 45) / 90)
    k += (folded - 90 * k >= 45) - (folded - 90 * k < -45)
    radians = math.radians(folded - 90 * k)
    c, s = math.cos(radians) * ONE, math.sin(radians) * ONE
    if max(abs(c - round(c)), abs(s - round(s))) > 0.5 - sines.DOUBT:
        c, s = _exactly(folded - 90 * k)
    return k % 4, round(c), round(s)


def turned(points_256: Ints, c: Ints | int, s: Ints | int) -> Ints:
    """Turn points (N, 2) by a direction, or each by its own (N,), about the origin; rounded once, half to even."""
    x, y = points_256[..., 0], points_256[..., 1]
    return np.stack([over_one(x * c - y * s), over_one(x * s + y * c)], axis=-1)


def scaled(directions: Ints, length_256: int) -> Ints:
    """Directions, (cos, sin) times 2**30, at a length; rounded once, half to even."""
    return over_one(directions * length_256)


def over_one(numerator: Whole) -> Whole:
    """Divide by 2**30, rounding half to even: up from a half if what is below it is odd."""
    return (numerator + (ONE // 2 - 1) + ((numerator >> TRIG_BITS) & 1)) >> TRIG_BITS


def _exactly(degrees: float) -> tuple[int, int]:
    """As `unit`, of one angle, in integers."""
    folded = math.fmod(abs(degrees), 360.0)
    down = folded > 180
    folded = 360 - folded if down else folded
    left = folded > 90
    folded = 180 - folded if left else folded
    steep = folded > 45
    s, c = (_taylor(90 - folded if steep else folded, first) for first in (1 - steep, int(steep)))
    return -c if left else c, -s if down ^ (degrees < 0) else s


def _taylor(degrees: float, first: int) -> int:
    """Round 2**30 times the sine (first = 1) or cosine (first = 0) of [0, 45] degrees, from 30 terms in fixed point."""
    part, whole = float(degrees).as_integer_ratio()
    x = (part * _PI[0] << _FIXED_BITS) // (whole * 180 * _PI[1])
    term = total = x if first else 1 << _FIXED_BITS
    for n in range(first + 1, first + 30, 2):
        term = -(term * x * x >> 2 * _FIXED_BITS) // (n * (n + 1))
        total += term
    return (2 * total * ONE + (1 << _FIXED_BITS)) >> (_FIXED_BITS + 1)


def toward(dx: int, dy: int) -> tuple[int, int]:
    """As `unit_toward`, of one vector, in Python's integers."""
    if dx == dy == 0:
        raise InputError("toward: expected a point other than the shot's own position, got the same")
    return _over_length(dx, dx * dx + dy * dy), _over_length(dy, dx * dx + dy * dy)


def _over_length(component: int, squared_length: int) -> int:
    """Round 2**30 component / sqrt(squared_length): the floor of twice the value tells the nearest."""
    twice = math.isqrt((component * component << (2 * TRIG_BITS + 2)) // squared_length)
    return int(math.copysign((twice + 1) // 2, component))
