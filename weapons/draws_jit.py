"""The draws of `draws`, compiled: the same whole numbers, pellet by pellet."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from planes.arrays import Ints
from planes.compiled import compiled
from planes.constants import SUB
from weapons.draws import GOLDEN, Words

__all__ = ["disc_offsets"]

INTS = types.Array(types.int64, 1, "A", readonly=True)
PELLETS = types.Array(types.int64, 2, "A", readonly=True)
SEEDS = types.Array(types.uint64, 1, "A", readonly=True)

AT_ONCE = 256
"""Pellets that are drawn at a time, or those of a round."""


@njit(inline="always")
def _mixed(z):
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled(types.void(types.int64, types.int64, types.uint64, SEEDS, INTS, INTS, PELLETS, types.int64[:, ::1]))
def _disc_offsets(reach, radius2, bits, seed, shot, round_, pellet, offsets):
    rows, pellets = pellet.shape
    room = max(AT_ONCE, pellets)
    state, drawn, place = np.empty(room, np.uint64), np.empty(room, np.uint64), np.empty(room, np.int64)
    row = 0
    while row < rows:
        count = 0
        while row < rows and count + pellets <= room:
            turn = _mixed(seed[row])
            turn = _mixed((turn ^ np.uint64(shot[row])) + GOLDEN)
            turn = _mixed((turn ^ np.uint64(round_[row])) + GOLDEN)
            for k in range(pellets):
                state[count + k] = _mixed((turn ^ np.uint64(pellet[row, k])) + GOLDEN)
                place[count + k] = row * pellets + k
            count += pellets
            row += 1
        while count:
            for i in range(count):  # several at a time, as nothing is decided
                state[i] += GOLDEN
                drawn[i] = _mixed(state[i])
            rest = 0
            for i in range(count):  # what is not in the disc is written over: without a branch
                x = np.int64(drawn[i] & bits) - reach
                y = np.int64((drawn[i] >> np.uint64(32)) & bits) - reach
                offsets[place[i], 0], offsets[place[i], 1] = x, y
                state[rest], place[rest] = state[i], place[i]
                rest += SUB * SUB * (x * x + y * y) > radius2
            count = rest


def disc_offsets(radius_256: int, seed: int | Words, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """See `draws.disc_offsets`."""
    seed, reach = np.asarray(seed, np.uint64), radius_256 // SUB
    shape = np.broadcast_shapes(*(word.shape for word in (seed, shot, round_, pellet)))
    wide = shape if len(shape) > 1 else (*shape, 1)
    *turns, pellets = (np.broadcast_to(word, shape).reshape(wide) for word in (seed, shot, round_, pellet))
    offsets = np.empty((*pellets.shape, 2), np.int64)
    bits = np.uint64((1 << (2 * reach).bit_length()) - 1)
    _disc_offsets(reach, radius_256**2, bits, *(word[:, 0] for word in turns), pellets, offsets.reshape(-1, 2))
    return offsets.reshape(*shape, 2)
