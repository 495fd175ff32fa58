"""Compiled twins of the kernels of `jumps`."""

from __future__ import annotations

import numpy as np
from numba import njit

from planes.arrays import Bools, Ints
from planes.constants import HALF, SUB
from planes.jumps import EXACT, FAR, LONGEST, NOTHING, PAD, UNDECIDED, Clearance

__all__ = ["clearance_of", "first_taken"]

BLOCK = 128
"""Rays that go on together, so that none waits for another's look: their columns fit the fastest cache."""

ROUNDS = 3
"""Jumps of each ray of a block, before those that are done make room for others."""

N, STOP, ALONG, ACROSS, BASE, A, B, C, ASIDE, RAY, COLUMNS = range(11)
"""Columns of a block: after how many crossings a ray looks next, and the others as of `jumps._ways`."""


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


@njit(cache=True, error_model="numpy")
def first_taken(clearance: Clearance, start_256: Ints, step_256: Ints) -> tuple[Ints, Ints, Bools]:
    """See `jumps.first_taken`."""
    count, flat = len(start_256), clearance.reshape(-1)
    height, width = clearance.shape
    entry, cell, several = np.full(count, NOTHING), np.zeros(count, np.int64), np.zeros(count, np.bool_)
    block, look, jump = np.empty((COLUMNS, BLOCK)), np.empty(BLOCK, np.int32), np.empty(BLOCK, np.uint8)
    left = ray = 0
    while left or ray < count:
        while left < BLOCK and ray < count:
            x, y = start_256[ray, 0], start_256[ray, 1]
            why = _way(height, width, x, y, step_256[ray, 0], step_256[ray, 1], block, left)
            if why < 0:
                entry[ray] = why
            elif block[N, left] == 0 and _between(flat, block, left, x, y):
                entry[ray], cell[ray], several[ray] = 0, np.int64(block[BASE, left]), True
            else:
                block[RAY, left] = ray
                left += 1
            ray += 1
        for _ in range(ROUNDS):
            _look(block, left, look)
            _jump(flat, block, left, look, jump)
        left = _left(block, left, look, jump, width, start_256, step_256, entry, cell, several)
    return entry, cell, several


@njit(cache=True, error_model="numpy")
def _look(block, count, look):  # type: ignore[no-untyped-def]
    """Places of the cells that rays look at: at a corner ~place, one less than what is taken from 0."""
    for one in range(count):
        n = block[N, one]
        quotient = (block[A, one] * n + block[C, one]) / block[B, one]
        i = np.floor(quotient)
        place = np.int32(block[BASE, one] + i * block[ALONG, one] + n * block[ACROSS, one])
        look[one] = ~place if i == quotient else place


@njit(cache=True)
def _jump(flat, block, count, look, jump):  # type: ignore[no-untyped-def]
    """Let rays jump, up to their ends."""
    for one in range(count):
        place = look[one]
        two = place < 0
        far = min(flat[~place], flat[~place - np.int32(block[ASIDE, one])]) if two else flat[np.uint32(place)]
        jump[one] = far
        block[N, one] = min(block[N, one] + far, block[STOP, one])


@njit(cache=True)
def _left(block, count, look, jump, width, start_256, step_256, entry, cell, several):  # type: ignore[no-untyped-def]
    """Tell where rays came to something, and move those that go on to the front; how many they are."""
    left = 0
    for one in range(count):
        if block[N, one] < block[STOP, one]:
            if jump[one]:
                for column in range(COLUMNS):
                    block[column, left] = block[column, one]
                left += 1
            else:
                ray, place = np.int64(block[RAY, one]), np.int64(look[one])
                several[ray] = place < 0
                cell[ray] = place = max(place, ~place)
                entry[ray] = _entry(place % width, place // width, start_256[ray], step_256[ray])
    return left


@njit(cache=True)
def _entry(x, y, start_256, step_256):  # type: ignore[no-untyped-def]
    """When a ray enters a cell."""
    ahead_x, ahead_y = SUB * x - start_256[0], SUB * y - start_256[1]
    dx, dy = step_256[0], step_256[1]
    ahead_x, ahead_y = ahead_x if dx >= 0 else -ahead_x, ahead_y if dy >= 0 else -ahead_y
    return max((ahead_x - HALF) * max(abs(dy), 1), (ahead_y - HALF) * max(abs(dx), 1), 0)


@njit(cache=True)
def _between(flat, block, one, x_256, y_256):  # type: ignore[no-untyped-def]
    """Whether a ray starts on a border of cells, of which another than the one that it goes into is taken."""
    on_x, on_y = (x_256 & (SUB - 1)) == HALF, (y_256 & (SUB - 1)) == HALF
    if not (on_x or on_y):
        return False
    across, base = np.int64(block[ACROSS, one]), np.int64(block[BASE, one])
    step = np.int64(block[ALONG, one]) + across
    if on_x and flat[base - step] == 0:
        return True
    return on_y and (flat[base - across] == 0 or (on_x and flat[base - step - across] == 0))


@njit(cache=True, error_model="numpy")
def _over(numerator, denominator):  # type: ignore[no-untyped-def]
    """The quotient of whole numbers, rounded down; division in floats is several times as fast."""
    if abs(numerator) < EXACT:
        return np.int64(np.floor(float(numerator) / float(denominator)))
    return numerator // denominator


@njit(cache=True, error_model="numpy")
def _way(height, width, x_256, y_256, step_x, step_y, block, one):  # type: ignore[no-untyped-def]
    """Put the columns of a ray into its block; or tell why it has none, below 0."""
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
    block[ASIDE, one] = along
    if dx == 0 and ax == -HALF:
        block[ASIDE, one] = 1
    if dy == 0 and ay == -HALF:
        block[ASIDE, one], c = width, 0
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
    block[A, one], block[B, one], block[C, one] = a, b, c
    block[ALONG, one], block[ACROSS, one], block[BASE, one] = along, across, y * width + x
    block[N, one], block[STOP, one] = first, stop
    return 0 if first < stop else NOTHING
