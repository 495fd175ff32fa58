"""Compiled twins of the kernels of `jumps`."""

from __future__ import annotations

import numpy as np
from numba import njit

from planes.arrays import Bools, Ints
from planes.constants import HALF, SUB
from planes.jumps import EXACT, FAR, LONGEST, NOTHING, PAD, UNDECIDED, Clearance

__all__ = ["clearance_of", "first_taken"]

COLUMNS = 12
BLOCK = 256
"""Rays that go on together, so that none waits for another's look: their columns fit the fastest cache."""


@njit(cache=True)
def clearance_of(taken: Bools) -> Clearance:
    """See `jumps.clearance_of`."""
    h, w = taken.shape
    distance = np.full((h + 2 * PAD, w + 2 * PAD), FAR, np.uint8)
    for y in range(PAD, h + PAD):
        for x in range(w):
            if taken[y - PAD, x]:
                distance[y, x + PAD] = 0
    height, width = distance.shape
    for y in range(1, height):
        for x in range(width):
            distance[y, x] = min(distance[y, x], distance[y - 1, x] + 1)
        _spread_along(distance[y])
    for y in range(height - 2, -1, -1):
        for x in range(width):
            distance[y, x] = min(distance[y, x], distance[y + 1, x] + 1)
        _spread_along(distance[y])
    return distance


@njit(cache=True)
def _spread_along(row: Clearance) -> None:
    """Let each cell of a row be at most 1 farther than those beside it."""
    for x in range(1, len(row)):
        row[x] = min(row[x], row[x - 1] + 1)
    for x in range(len(row) - 2, -1, -1):
        row[x] = min(row[x], row[x + 1] + 1)


@njit(cache=True)
def first_taken(clearance: Clearance, start_256: Ints, step_256: Ints) -> tuple[Ints, Ints, Bools]:
    """See `jumps.first_taken`."""
    count, flat = len(start_256), clearance.reshape(-1)
    height, width = clearance.shape
    entry, cell, several = np.full(count, NOTHING), np.zeros(count, np.int64), np.zeros(count, np.bool_)
    columns, at = np.empty((BLOCK, COLUMNS)), np.empty(BLOCK)
    rays, live = np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int64)
    for begin in range(0, count, BLOCK):
        left = 0
        for ray in range(begin, min(begin + BLOCK, count)):
            x, y = start_256[ray, 0], start_256[ray, 1]
            first = _way(height, width, x, y, step_256[ray, 0], step_256[ray, 1], columns, left)
            if first < 0:
                entry[ray] = first
            elif first == 0 and _between(flat, columns, left, x, y):
                entry[ray], cell[ray], several[ray] = 0, np.int64(columns[left, 5]), True
            else:
                rays[left], live[left], at[left] = ray, left, first
                left += 1
        _follow(flat, columns, at, rays, live, left, entry, cell, several)
    return entry, cell, several


@njit(cache=True)
def _between(flat, columns, one, x_256, y_256):  # type: ignore[no-untyped-def]
    """Whether a ray starts on a border of cells, of which another than the one that it goes into is taken."""
    on_x, on_y = (x_256 & (SUB - 1)) == HALF, (y_256 & (SUB - 1)) == HALF
    if not (on_x or on_y):
        return False
    across, base = np.int64(columns[one, 4]), np.int64(columns[one, 5])
    step = np.int64(columns[one, 3]) + across
    if on_x and flat[base - step] == 0:
        return True
    return on_y and (flat[base - across] == 0 or (on_x and flat[base - step - across] == 0))


@njit(cache=True)
def _entry(i, j, columns, one):  # type: ignore[no-untyped-def]
    """When a ray enters a cell that lies so many columns and rows ahead."""
    dx, dy = np.int64(columns[one, 7]), np.int64(columns[one, 8])
    ax, ay = np.int64(columns[one, 9]), np.int64(columns[one, 10])
    return max((SUB * i - HALF - ax) * max(dy, 1), (SUB * j - HALF - ay) * max(dx, 1), 0)


@njit(cache=True)
def _over(numerator, denominator):  # type: ignore[no-untyped-def]
    """The quotient of whole numbers, rounded down; division in floats is several times as fast."""
    if abs(numerator) < EXACT:
        return np.int64(np.floor(float(numerator) / float(denominator)))
    return numerator // denominator


@njit(cache=True)
def _follow(flat, columns, at, rays, live, count, entry, cell, several):  # type: ignore[no-untyped-def]
    """Let the rays of a block go on, one jump each in turn, until all are done."""
    while count:
        left = 0
        for place in range(count):
            one = live[place]
            n, along = at[one], columns[one, 3]
            quotient = (columns[one, 0] * n + columns[one, 2]) / columns[one, 1]
            i = np.floor(quotient)
            look = np.int64(columns[one, 5] + i * along + n * columns[one, 4])
            jump = flat[look]
            if i == quotient:
                jump = min(jump, flat[look - np.int64(columns[one, 11])])
            at[one] = n + jump
            live[left] = one
            left += jump > 0 and n + jump < columns[one, 6]
            if jump == 0:
                ray = rays[one]
                entry[ray] = _entry(np.int64(i), np.int64(n - i), columns, one)
                cell[ray], several[ray] = look, i == quotient
        count = left


@njit(cache=True)
def _way(height, width, x_256, y_256, step_x, step_y, columns, one):  # type: ignore[no-untyped-def]
    """Crossings after which a ray comes to the plane, or why it has none.

    Its column is A, B and so on as of `jumps._ways`, and |dx|, |dy|, ax and ay before the last.
    """
    dx, dy = abs(step_x), abs(step_y)
    x, y = (x_256 + HALF - (step_x < 0)) >> 8, (y_256 + HALF - (step_y < 0)) >> 8
    ax, ay = x_256 - (x << 8), y_256 - (y << 8)
    ax, ay = ax if step_x >= 0 else -ax, ay if step_y >= 0 else -ay
    if dx + dy == 0 or dx > LONGEST or dy > LONGEST:
        return UNDECIDED
    last_x, last_y = (dx + ax + HALF) >> 8, (dy + ay + HALF) >> 8
    room_x, owed_x = (width - 2 - x, 1 - x) if step_x >= 0 else (x - 1, x - width + 2)
    room_y, owed_y = (height - 2 - y, 1 - y) if step_y >= 0 else (y - 1, y - height + 2)
    if room_x < 0 or room_y < 0 or owed_x > last_x or owed_y > last_y:
        return NOTHING
    a, b, c = SUB * dx, SUB * (dx + dy), dx * (HALF - ay) + dy * (HALF + ax)
    across = width if step_y >= 0 else -width
    along = (1 if step_x >= 0 else -1) - across
    columns[one, 11] = along
    if dx == 0 and ax == -HALF:
        columns[one, 11] = 1
    if dy == 0 and ay == -HALF:
        columns[one, 11], c = width, 0
    first, stop = 0, last_x + last_y + 1
    if last_x > room_x:
        stop = min(stop, -_over(c - b * (room_x + 1), a))
    if last_y > room_y:
        stop = min(stop, _over(c + b * room_y, SUB * dy) + 1)
    if owed_x > 0:
        first = max(first, -_over(c - b * owed_x, a))
    if owed_y > 0:
        first = max(first, _over(c + b * (owed_y - 1), SUB * dy) + 1)
    if float(a) * stop + c >= EXACT:
        return UNDECIDED
    columns[one, 0], columns[one, 1], columns[one, 2] = a, b, c
    columns[one, 3], columns[one, 4] = along, across
    columns[one, 5], columns[one, 6] = y * width + x, stop
    columns[one, 7], columns[one, 8], columns[one, 9], columns[one, 10] = dx, dy, ax, ay
    return first if first < stop else NOTHING
