"""The draws of `draws`, compiled: the same whole numbers, pellet by pellet."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from planes.arrays import Ints
from planes.compiled import compiled
from planes.constants import SUB
from weapons.draws import Words

__all__ = ["disc_offsets"]

INTS = types.Array(types.int64, 1, "A", readonly=True)
SEEDS = types.Array(types.uint64, 1, "A", readonly=True)
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@njit(inline="always")
def _mixed(z):
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled(types.void(types.int64, types.int64, types.uint64, SEEDS, INTS, INTS, INTS, types.int64[:, ::1]))
def _disc_offsets(reach, radius2, bits, seed, shot, round_, pellet, offsets):
    for row in range(len(shot)):
        state = _mixed(seed[row])
        state = _mixed((state ^ np.uint64(shot[row])) + GOLDEN)
        state = _mixed((state ^ np.uint64(round_[row])) + GOLDEN)
        state = _mixed((state ^ np.uint64(pellet[row])) + GOLDEN)
        while True:
            state += GOLDEN
            drawn = _mixed(state)
            x = np.int64(drawn & bits) - reach
            y = np.int64((drawn >> np.uint64(32)) & bits) - reach
            if SUB * SUB * (x * x + y * y) <= radius2:
                offsets[row, 0], offsets[row, 1] = x, y
                break


def disc_offsets(radius_256: int, seed: int | Words, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """See `draws.disc_offsets`."""
    rows = np.broadcast_arrays(shot, round_, pellet)
    seeds = np.broadcast_to(np.asarray(seed, np.uint64), rows[0].shape)
    reach = radius_256 // SUB
    offsets = np.empty((len(seeds), 2), np.int64)
    bits = np.uint64((1 << (2 * reach).bit_length()) - 1)
    _disc_offsets(reach, radius_256**2, bits, seeds, *rows, offsets)
    return offsets
