"""Random draws as whole numbers, each a function of (seed, shot, round, pellet, draw) alone.

No state is kept, so any shot of a batch can be fired again by itself, in any order, on any machine.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from planes.arrays import Ints
from planes.constants import SUB

__all__ = ["Words", "disc_offsets", "mix64"]

Words = npt.NDArray[np.uint64]
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def mix64(words: Words) -> Words:
    """Mix 64 bits: the finaliser of splitmix64 (Steele, Lea, Flood 2014; constants by Stafford, variant 13)."""
    z = np.atleast_1d(np.asarray(words, np.uint64)).copy()
    z ^= z >> np.uint64(30)
    z *= np.uint64(0xBF58476D1CE4E5B9)
    z ^= z >> np.uint64(27)
    z *= np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return z


def disc_offsets(radius_256: int, seed: int | Words, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """Whole-pixel offsets (n, 2), uniform over the centres of a disc, by rejection on integers.

    Parameters
    ----------
    radius_256 : radius in 1/256 px
    seed : 0 .. 2**64 - 1; one for all rows, or one for each (n,) uint64
    shot, round_, pellet : (n,) int64; a row depends on its seed and its own three numbers only
    """
    rows = np.broadcast_arrays(shot, round_, pellet)
    key = mix64(np.broadcast_to(np.asarray(seed, np.uint64), rows[0].shape))
    for word in rows:
        key = mix64((key ^ word.astype(np.uint64)) + GOLDEN)
    reach = radius_256 // SUB
    bits = np.uint64((1 << (2 * reach).bit_length()) - 1)
    offsets = np.zeros((len(key), 2), np.int64)
    pending = np.arange(len(key))
    state = key.copy()
    while len(pending):
        state[pending] += GOLDEN
        drawn = mix64(state[pending])
        pair = np.stack([drawn & bits, (drawn >> np.uint64(32)) & bits], axis=1).astype(np.int64) - reach
        good = (pair <= reach).all(axis=1) & (((SUB * pair) ** 2).sum(axis=1) <= radius_256**2)
        offsets[pending[good]] = pair[good]
        pending = pending[~good]
    return offsets
