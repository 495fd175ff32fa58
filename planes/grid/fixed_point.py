"""Fixed-point numbers: positions in 1/256 px and directions as integers, each rounded once.

A position is `snap(v) = rint(256 v)`, half to even. A direction is (cos, sin) times 2**30, correctly rounded: it is the
same on every machine, and quarter turns and mirrors are exact.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from ..common.backend import kernels_of
from ..common.checks import Bools, Floats, InputError, Ints, all_within, rising
from ..common.limits import HALF, POSITION_MAX, SUB, TRIG_BITS

ONE = 1 << TRIG_BITS  # 1 as a component of a direction
DOUBT = 2.0**-12  # a scaled sine nearer to a tie is in doubt; float sines err by a few ulp, 2**-21 after the scaling


def nearest(degrees: Floats) -> tuple[Ints, Ints, Ints]:
    """Cosines and sines of angles (n,), each times 2**30 and rounded, and the rows whose rounding is in doubt.

    The angle is folded into [0, 45] by differences that are exact in float64, so a quarter turn exactly swaps the two
    numbers, and a mirror exactly changes a sign.
    """
    rest, steep, left, down = _folded(degrees)
    radians = np.radians(rest)
    near, far = np.cos(radians) * ONE, np.sin(radians) * ONE
    whole_near, whole_far = np.rint(near), np.rint(far)
    doubt = np.maximum(np.abs(near - whole_near), np.abs(far - whole_far)) > 0.5 - DOUBT
    x, y = whole_near.astype(np.int64), whole_far.astype(np.int64)
    c, s = np.where(steep, y, x), np.where(steep, x, y)
    return np.where(left, -c, c), np.where(down, -s, s), np.flatnonzero(doubt)


def _folded(degrees: Floats | float) -> tuple[Floats, Bools, Bools, Bools]:
    """Angles in [0, 45], and whether the two numbers are swapped, the first is negative, and the second is."""
    folded = np.abs(degrees)
    if folded.max(initial=0) >= 360:
        folded = np.fmod(folded, 360.0)
    down = folded > 180
    folded = np.where(down, 360 - folded, folded)
    left = folded > 90
    folded = np.where(left, 180 - folded, folded)
    steep = folded > 45
    return np.where(steep, 90 - folded, folded), steep, left, np.asarray(down ^ (np.asarray(degrees) < 0))


Whole = TypeVar("Whole", int, Ints)
_PI = (31415926535897932384626433832795028841971693993751, 10**49)
_FIXED_BITS = 160  # as exact as _PI

FEW_ANGLES = 24  # most angles that are split one after another, which takes less time than the calls of numpy
ANGLES_KEPT = 2**12  # angles whose directions are kept: objects turn by the same steps again and again

EXACT_ROOT = 2**52  # up to it the float root, rounded down, is exact
DIGIT, DIVISORS_MOST = 20, 2**40
"""Bits of a digit of `muldiv`, and divisors of which a remainder, and a digit more, have room in int64."""


def snap(values: object) -> Ints:
    """Round positions in px to the 1/256-px grid, half to even; a position is rounded nowhere else."""
    return np.rint(np.asarray(values, np.float64) * SUB).astype(np.int64)


def pixel(position_256: Ints) -> Ints:
    """Pixel that holds a position; on a border, the pixel to the right or below."""
    moved = position_256 + HALF
    moved >>= 8  # in the same array
    return moved


def rounded_div(numerator: Ints, denominator: Ints | int) -> Ints:
    """Divide integers (denominator > 0), rounding half to even: an odd function of the numerator."""
    quotient, rest = np.divmod(np.asarray(numerator), denominator)
    twice = 2 * rest
    up = (twice > denominator) | ((twice == denominator) & (quotient & 1 == 1))
    return np.asarray(quotient + up)


def muldiv(values: Ints, factor: int, divisor: Ints) -> Ints:
    """Floor of values * factor / divisor, exactly, where no value is less than 0, or greater than its divisor.

    It divides digit by digit of the factor, as on paper. Python's integers have room for the remainders of divisors
    from 2**40 on.
    """
    kind: Any = np.int64 if int(divisor.max(initial=1)) < DIVISORS_MOST else object
    values, divisor = values.astype(kind), divisor.astype(kind)
    whole = rest = np.zeros(len(values), kind)
    for shift in reversed(range(0, factor.bit_length(), DIGIT)):
        rest = (rest << DIGIT) + values * (factor >> shift & ((1 << DIGIT) - 1))
        digit = rest // divisor
        whole, rest = (whole << DIGIT) + digit, rest - digit * divisor
    return whole.astype(np.int64)


def isqrt(values: Ints) -> Ints:
    """Floor of the square root of non-negative int64 values, exactly."""
    values = np.asarray(values, np.int64)
    root = np.sqrt(values.astype(np.float64)).astype(np.int64)
    if values.max(initial=0) <= EXACT_ROOT:
        return root
    root = np.minimum(root, 3_037_000_499)  # floor(sqrt(2**63 - 1)): its square must not wrap
    root -= root * root > values
    above = np.minimum(root + 1, 3_037_000_499)
    return np.where((above * above <= values) & (above > root), above, root)


def far_roots(radius: int, v: Ints, length2: Ints) -> Ints:
    """Roots of radius^2 length^2 - v^2, from 0 to 2**90, rounded down.

    The float root is so near that the remainder of the square fits int64, and is exact although the squares wrap
    around. Below 2**31 the remainder gives the square itself; above, one Newton step gives the root or 1 more.
    """
    side = radius * np.sqrt(length2)
    root = np.rint(np.sqrt(np.maximum((side - v) * (side + v), 0))).astype(np.int64)
    left = radius**2 * length2 - v * v - root * root
    small = root < 2**31
    step = left // np.maximum(2 * root, 1)
    newton = root + step - (left - 2 * root * step - step * step < 0)
    return np.where(small, isqrt(np.where(small, root * root + left, 0)), newton)


def unit(degrees: object) -> tuple[Ints, Ints]:
    """(cos, sin) times 2**30 of angles in degrees, correctly rounded.

    A value too near to a tie for the float sine is computed in integers.
    """
    angle = np.asarray(degrees, np.float64)
    each = angle.ravel()
    c, s, doubt = kernels_of(sys.modules[__name__]).nearest(each)
    for i in doubt.tolist():
        c[i], s[i] = _exactly(float(each[i]))
    return c.reshape(angle.shape), s.reshape(angle.shape)


def unit_toward(dx: Ints | int, dy: Ints | int) -> tuple[Ints, Ints]:
    """Directions of integer vectors as (cos, sin) times 2**30, correctly rounded, computed without an angle."""
    x, y = np.broadcast_arrays(np.asarray(dx, np.int64), np.asarray(dy, np.int64))
    pairs = [toward(int(a), int(b)) for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    both = np.array(pairs, np.int64).reshape((*x.shape, 2))
    return both[..., 0], both[..., 1]


def quarters(c: int, s: int) -> tuple[int, int, int]:
    """Split a rounded direction into k quarter turns and a rest in [-45, 45), as (k, cos, sin) of the rest.

    Every turn of a mask starts with this split.
    """
    k = 0
    while not -c <= s < c:
        k, c, s = k + 1, s, -c
    return k, c, s


def all_quarters(direction: Ints) -> tuple[Ints, Ints, Ints]:
    """`quarters` of directions (n, 2)."""
    (c, s), k = direction.T, np.zeros(len(direction), np.int64)
    for _ in range(3):
        more = (s < -c) | (s >= c)
        k, c, s = k + more, np.where(more, s, c), np.where(more, -c, s)
    return k, c, s


@lru_cache(maxsize=ANGLES_KEPT)
def quarter_turns(degrees: float) -> tuple[int, int, int]:
    """Split an angle into k quarter turns and a rest in [-45, 45), as (k mod 4, cos, sin) of the rest.

    The direction is rounded before it is split: an angle that rounds to the direction of 45 degrees is 45 degrees.
    """
    folded = math.fmod(degrees, 360.0)
    k = round(folded / 90)
    radians = math.radians(folded - 90 * k)
    c, s = math.cos(radians) * ONE, math.sin(radians) * ONE
    if max(abs(c - round(c)), abs(s - round(s))) > 0.5 - DOUBT:
        c, s = _exactly(folded - 90 * k)
    more, c, s = quarters(round(c), round(s))
    return (k + more) % 4, c, s


def all_quarter_turns(degrees: Sequence[float]) -> list[list[int]]:
    """`quarter_turns` of angles, as three columns; of a few one after another."""
    if 0 < len(degrees) <= FEW_ANGLES:
        return list(map(list, zip(*map(quarter_turns, degrees), strict=True)))
    return [column.tolist() for column in all_quarters(np.stack(unit(degrees), axis=1))]


def unit_of(degrees: float) -> tuple[int, int]:
    """`unit` of one angle, in Python integers."""
    quarter, c, s = quarter_turns(degrees)
    for _ in range(quarter):
        c, s = -s, c
    return c, s


def turned(points_256: Ints, c: Ints | int, s: Ints | int) -> Ints:
    """Turn points (N, 2) about the origin by one direction, or by one each (N,); rounded once, half to even."""
    x, y = points_256[..., 0], points_256[..., 1]
    return np.stack([over_one(x * c - y * s), over_one(x * s + y * c)], axis=-1)


def turned_to(points_256: Ints, direction: Ints) -> Ints:
    """Turn all points (m, 2) about the origin to each of the directions (n, 2), as (n, m, 2); see `turned`."""
    return turned(points_256, *direction.T[..., None])


def scaled(directions: Ints, length_256: int) -> Ints:
    """Vectors of a length along directions, (cos, sin) times 2**30; rounded once, half to even."""
    return over_one(directions * length_256)


def over_one(numerator: Whole) -> Whole:
    """Divide by 2**30, rounding half to even."""
    return (numerator + (ONE // 2 - 1) + ((numerator >> TRIG_BITS) & 1)) >> TRIG_BITS


def _exactly(degrees: float) -> tuple[int, int]:
    """`unit` of one angle, computed in integers."""
    rest, steep, left, down = _folded(degrees)
    s, c = (_taylor(float(rest), first) for first in (1 - int(steep), int(steep)))
    return -c if left else c, -s if down else s


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
    """`unit_toward` of one vector, in Python integers."""
    if dx == dy == 0:
        raise InputError("toward: expected a point other than the shot's own position, got the same")
    return _over_length(dx, dx * dx + dy * dy), _over_length(dy, dx * dx + dy * dy)


def _over_length(component: int, squared_length: int) -> int:
    """Round 2**30 component / sqrt(squared_length), by way of the floor of twice the value."""
    twice = math.isqrt((component * component << (2 * TRIG_BITS + 2)) // squared_length)
    return int(math.copysign((twice + 1) // 2, component))


def snapped(at: Floats) -> Ints | None:
    """Positions (N, 2) in px, rounded to 1/256 px as `snap` does; None if any is NaN or out of range."""
    return snap(at) if all_within(at, -POSITION_MAX, POSITION_MAX) else None


def place(
    ids: Ints, xy: Floats, count: int, row_of: npt.NDArray[np.int32], edge: Ints, position_256: Ints, box: Ints,
    rows: Ints, before: Ints, after: Ints,
) -> bool:  # fmt: skip
    """Move items of ids (n,) to new positions (n, 2), px; neither array is kept. Return whether that was done.

    Nothing is changed unless the ids, of which a scene has `count`, are rising and all in the scene, and all positions
    finite and in range. Of the columns of `Items` the last two are changed; `rows` (n,) is filled with the rows of the
    items in them, and `before` and `after` (n, 4) with their boxes.
    """
    if not (rising(ids, count) and all_within(xy, -POSITION_MAX, POSITION_MAX)):
        return False
    rows[:] = row_of.take(ids)
    if rows.min(initial=0) < 0:
        return False
    n, first, now = len(rows), int(rows[0]) if len(rows) else 0, snap(xy)
    at = slice(first, first + n) if n and rows[-1] - first == n - 1 and rising(rows, first + n) else rows
    before[:] = box[at]
    after[:] = boxes_at(now, edge[at])
    position_256[at], box[at] = now, after
    return True


def boxes_at(position_256: Ints, edge: Ints) -> Ints:
    """Boxes (n, 4) of items at positions (n, 2); `edge` (n, 4) leads to their first and last pixels, 1/256 px."""
    pairs = np.ascontiguousarray(position_256).view(np.complex128)  # x and y are copied as one
    boxes = np.repeat(pairs, 2).view(np.int64).reshape(-1, 4)
    boxes += edge
    boxes >>= 8
    return np.asarray(boxes)
