"""Seeded draws: the offsets of pellets, each of which depends on its own numbers alone."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from hitplanes.planes.bits.bit_rows import Words
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import GOLDEN, SUB

ROWS_AT_ONCE = 2**15
"""Draws made at a time: 256 KB for each of their arrays; with fewer, the calls of numpy take longer."""

FEW = 64
"""Most draws that are made one after another in integers of Python; they take as long as the calls of numpy."""

WORD_MAX, STEP = 2**64 - 1, int(GOLDEN)
"""Greatest word, and what a state grows by before each draw."""


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


def disc_offsets(radius_256: int, seed: Words, shot: Ints, round_: Ints, pellets: int) -> Ints:
    """Whole-pixel offsets (n, k, 2) of k pellets of rounds, uniform over a disc's centres, by rejection on integers.

    Parameters
    ----------
    radius_256 : radius in 1/256 px
    seed : (n,) seed of each round
    shot, round_ : (n,) its numbers; the offset of a pellet depends on these three and its own number alone, 0 .. k - 1
    """
    shots, rounds = shot.astype(np.uint64), round_.astype(np.uint64)
    if len(shot) * pellets <= FEW:
        return np.array(_few(radius_256, (seed, shots, rounds), pellets), np.int64).reshape(-1, pellets, 2)
    offsets = np.empty((len(shot), pellets, 2), np.int64)
    at_once, pellet = max(ROWS_AT_ONCE // pellets, 1), np.arange(pellets).astype(np.uint64)
    for first in range(0, len(shot), at_once):
        now = slice(first, first + at_once)
        turn = _keyed_words(_keyed_words(mix64(seed[now]), shots[now]), rounds[now])
        key = _keyed_words(turn[:, None], pellet)
        offsets[now] = _in_disc(key.reshape(-1), radius_256 // SUB, radius_256**2).reshape(-1, pellets, 2)
    return offsets


def _keyed_words(states: Words, numbers: Words) -> Words:
    """States of draws that depend on one more number each; both broadcast. `_keyed` of many."""
    keyed: Words = (states ^ numbers) + GOLDEN
    _mix(keyed)
    return keyed


def _in_disc(state: Words, reach: int, radius2: int) -> Ints:
    """Offsets (n, 2) within a disc; each state is drawn again until its offset lies inside."""
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


def _few(radius_256: int, words: Sequence[Words], pellets: int) -> list[tuple[int, int]]:
    """Offsets of pellets of rounds, one after another; `words` are their seeds, shots and numbers."""
    turns = [reduce(_keyed, rest, _mixed(seed)) for seed, *rest in zip(*(w.tolist() for w in words), strict=True)]
    return [_offset(radius_256, _keyed(turn, pellet)) for turn in turns for pellet in range(pellets)]


def _keyed(state: int, number: int) -> int:
    """State of draws that depend on one more number."""
    return _mixed((state ^ number) + STEP & WORD_MAX)


def _offset(radius_256: int, state: int) -> tuple[int, int]:
    """Offset within a disc, drawn until it lies inside; `_in_disc` of one state."""
    reach = radius_256 // SUB
    bits = (1 << (2 * reach).bit_length()) - 1
    while True:
        state = state + STEP & WORD_MAX
        drawn = _mixed(state)
        x, y = (drawn & bits) - reach, (drawn >> 32 & bits) - reach
        if SUB**2 * (x * x + y * y) <= radius_256**2:
            return x, y


def _mixed(word: int) -> int:
    """`mix64` of one word."""
    word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 & WORD_MAX
    word = (word ^ word >> 27) * 0x94D049BB133111EB & WORD_MAX
    return word ^ word >> 31
