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
PELLETS = types.Array(types.int64, 2, "A", readonly=True)
SEEDS = types.Array(types.uint64, 1, "A", readonly=True)
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@njit(inline="always")
def _mixed(z):
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled(types.void(types.int64, types.int64, types.uint64, SEEDS, INTS, INTS, PELLETS, types.int64[:, :, ::1]))
def _disc_offsets(reach, radius2, bits, seed, shot, round_, pellet, offsets):
    rows, pellets = pellet.shape
    for row in range(rows):
        turn = _mixed(seed[row])
        turn = _mixed((turn ^ np.uint64(shot[row])) + GOLDEN)
        turn = _mixed((turn ^ np.uint64(round_[row])) + GOLDEN)
        for k in range(pellets):
            state = _mixed((turn ^ np.uint64(pellet[row, k])) + GOLDEN)
            while True:
                state += GOLDEN
                drawn = _mixed(state)
                x = np.int64(drawn & bits) - reach
                y = np.int64((drawn >> np.uint64(32)) & bits) - reach
                if SUB * SUB * (x * x + y * y) <= radius2:
                    offsets[row, k, 0], offsets[row, k, 1] = x, y
                    break


def disc_offsets(radius_256: int, seed: int | Words, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """See `draws.disc_offsets`."""
    seed, reach = np.asarray(seed, np.uint64), radius_256 // SUB
    shape = np.broadcast_shapes(*(word.shape for word in (seed, shot, round_, pellet)))
    wide = shape if len(shape) > 1 else (*shape, 1)
    *turns, pellets = (np.broadcast_to(word, shape).reshape(wide) for word in (seed, shot, round_, pellet))
    offsets = np.empty((*pellets.shape, 2), np.int64)
    bits = np.uint64((1 << (2 * reach).bit_length()) - 1)
    _disc_offsets(reach, radius_256**2, bits, *(word[:, 0] for word in turns), pellets, offsets)
    return offsets.reshape(*shape, 2)
