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
ROWS_AT_ONCE = 2**15
"""Draws made at a time: 256 KB for each of their arrays; with fewer the calls weigh more."""

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def mix64(words: Words) -> Words:
    """Mix 64 bits: the finaliser of splitmix64 (Steele, Lea, Flood 2014; constants by Stafford, variant 13)."""
    z = np.atleast_1d(np.asarray(words, np.uint64)).copy()
    _mix(z)
    return z


def _mix(z: Words) -> None:
    """Mix words in place."""
    z ^= z >> np.uint64(30)
    z *= np.uint64(0xBF58476D1CE4E5B9)
    z ^= z >> np.uint64(27)
    z *= np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)


def disc_offsets(radius_256: int, seed: int | Words, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """Whole-pixel offsets (n, 2), uniform over the centres of a disc, by rejection on integers.

    Parameters
    ----------
    radius_256 : radius in 1/256 px
    seed : 0 .. 2**64 - 1; one for all rows, or one for each (n,) uint64
    shot, round_, pellet : (n,) int64; a row depends on its seed and its own three numbers only. Or columns (n, 1), of
        the seeds, too, and pellets (k,) that all of them have: offsets are (n, k, 2) then, of the same numbers
    """
    words = np.asarray(seed, np.uint64), *(np.asarray(word).astype(np.uint64) for word in (shot, round_, pellet))
    shape = np.broadcast_shapes(*(word.shape for word in words))
    offsets = np.empty((*shape, 2), np.int64)
    at_once = max(ROWS_AT_ONCE // max(shape[-1], 1), 1) if len(shape) > 1 else ROWS_AT_ONCE
    for first in range(0, shape[0], at_once):
        now = slice(first, first + at_once)
        key, *rest = (word[now] if word.shape[:1] == shape[:1] and word.ndim == len(shape) else word for word in words)
        key = mix64(key)
        for word in rest:
            key = key ^ word  # of more rows, if these are pellets
            key += GOLDEN
            _mix(key)
        offsets[now] = _in_disc(key.reshape(-1), reach=radius_256 // SUB, radius2=radius_256**2).reshape(*key.shape, 2)
    return offsets


def _in_disc(state: Words, reach: int, radius2: int) -> Ints:
    """Offsets (n, 2) within a disc: draw after draw of each state until one is."""
    bits, high = np.uint64((1 << (2 * reach).bit_length()) - 1), np.uint64(32)
    offsets = np.empty((len(state), 2), np.int64)
    pending = np.arange(len(state))
    while len(pending):
        state += GOLDEN
        drawn = mix64(state)
        x, y = (drawn & bits).view(np.int64), ((drawn >> high) & bits).view(np.int64)
        x -= reach
        y -= reach
        distance2 = x * x
        distance2 += y * y
        within = distance2 <= radius2 // SUB**2
        good, rest = within.nonzero()[0], np.logical_not(within).nonzero()[0]
        row = pending.take(good)
        offsets[row, 0], offsets[row, 1] = x.take(good), y.take(good)
        pending, state = pending.take(rest), state.take(rest)
    return offsets
