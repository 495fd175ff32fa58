"""The 1/256-px grid: positions and directions as integers, each rounded once.

A position is `snap(v) = rint(256 v)`, half to even. A direction is (cos, sin) times 2**30, correctly rounded, so that
it is the same on every machine, and so that quarter turns and mirrors are exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from planes.arrays import Floats, InputError, Ints
from planes.constants import HALF, SUB, TRIG_BITS

__all__ = ["isqrt", "pixel", "quarter_turns", "rounded_div", "scaled", "snap", "turned", "unit", "unit_toward"]

ONE = 1 << TRIG_BITS
_PI = (31415926535897932384626433832795028841971693993751, 10**49)
_FIXED_BITS = 160  # as exact as _PI
_DOUBT = 2.0**-12  # numpy's sine is within a few ulp (2**-21 after the scaling); nearer to a tie than this, ask again

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

    The angle is folded into [0, 45] by differences that are exact in float64, so a quarter turn swaps the two numbers
    and a mirror changes a sign, to the last bit. A value too near to a tie for the float sine is worked out in
    integers.
    """
    angle = np.asarray(degrees, np.float64)
    folded = np.abs(np.fmod(angle, 360.0))
    down = folded > 180
    folded = np.where(down, 360 - folded, folded)
    left = folded > 90
    folded = np.where(left, 180 - folded, folded)
    steep = folded > 45
    folded = np.where(steep, 90 - folded, folded)
    radians = np.radians(folded)
    near = _rounded(np.cos(radians) * ONE, folded, _exact_cos)
    far = _rounded(np.sin(radians) * ONE, folded, _exact_sin)
    c, s = np.where(steep, far, near), np.where(steep, near, far)
    return np.where(left, -c, c), np.where(down ^ (angle < 0), -s, s)


def unit_toward(dx: Ints | int, dy: Ints | int) -> tuple[Ints, Ints]:
    """Direction of integer vectors, (cos, sin) times 2**30, correctly rounded, without an angle."""
    x, y = np.broadcast_arrays(np.asarray(dx, np.int64), np.asarray(dy, np.int64))
    pairs = [_toward(int(a), int(b)) for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    both = np.array(pairs, np.int64).reshape((*x.shape, 2))
    return both[..., 0], both[..., 1]


@lru_cache(maxsize=ANGLES_KEPT)
def quarter_turns(degrees: float) -> tuple[int, int, int]:
    """Split an angle into k quarter turns and a rest in [-45, 45), as (k mod 4, cos, sin) of the rest."""
    folded = math.fmod(degrees, 360.0)
    k = math.floor((folded + 45) / 90)
    k += (folded - 90 * k >= 45) - (folded - 90 * k < -45)
    c, s = unit(folded - 90 * k)
    return k % 4, int(c), int(s)


def turned(points_256: Ints, c: Ints | int, s: Ints | int) -> Ints:
    """Turn points (N, 2) by a direction, or each by its own (N,), about the origin; rounded once, half to even."""
    x, y = points_256[..., 0], points_256[..., 1]
    return np.stack([_over_one(x * c - y * s), _over_one(x * s + y * c)], axis=-1)


def scaled(directions: Ints, length_256: int) -> Ints:
    """Directions, (cos, sin) times 2**30, at a length; rounded once, half to even."""
    return _over_one(directions * length_256)


def _over_one(numerator: Ints) -> Ints:
    """Divide by 2**30, rounding half to even: up from a half if what is below it is odd."""
    return np.asarray((numerator + (ONE // 2 - 1) + ((numerator >> TRIG_BITS) & 1)) >> TRIG_BITS)


def _rounded(scaled: Floats, folded: Floats, exactly: Callable[[float], int]) -> Ints:
    """Round to integers; where the float is nearer to a tie than its error, decide in integers."""
    rounded = np.rint(scaled)
    doubt = np.abs(scaled - rounded) > 0.5 - _DOUBT
    nearest = rounded.astype(np.int64)
    if not doubt.any():
        return nearest
    flat = nearest.ravel()
    for i in np.flatnonzero(doubt):
        flat[i] = exactly(float(folded.flat[i]))
    return flat.reshape(nearest.shape)


def _exact_sin(degrees: float) -> int:
    return _taylor(degrees, first=1)


def _exact_cos(degrees: float) -> int:
    return _taylor(degrees, first=0)


def _taylor(degrees: float, first: int) -> int:
    """Round 2**30 times the sine (first = 1) or cosine (first = 0) of [0, 45] degrees, from 30 terms in fixed point."""
    part, whole = float(degrees).as_integer_ratio()
    x = (part * _PI[0] << _FIXED_BITS) // (whole * 180 * _PI[1])
    term = total = x if first else 1 << _FIXED_BITS
    for n in range(first + 1, first + 30, 2):
        term = -(term * x * x >> 2 * _FIXED_BITS) // (n * (n + 1))
        total += term
    return (2 * total * ONE + (1 << _FIXED_BITS)) >> (_FIXED_BITS + 1)


def _toward(dx: int, dy: int) -> tuple[int, int]:
    if dx == dy == 0:
        raise InputError("toward: expected a point other than the shot's own position, got the same")
    return _over_length(dx, dx * dx + dy * dy), _over_length(dy, dx * dx + dy * dy)


def _over_length(component: int, squared_length: int) -> int:
    """Round 2**30 component / sqrt(squared_length): the floor of twice the value tells the nearest."""
    twice = math.isqrt((component * component << (2 * TRIG_BITS + 2)) // squared_length)
    return int(math.copysign((twice + 1) // 2, component))
