"""Shots to placed patterns: every round and every pellet of every shot, each on its whole pixel."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from planes.arrays import InputError, Ints, array_of, each, integer, integers, reals
from planes.constants import ALL, POSITION_MAX, REACH_MAX, SEED_MAX, SUB
from planes.grid256 import ONE, pixel, snap, turned, unit, unit_toward
from planes.poses import points
from planes.twins import kernels_of
from weapons import draws
from weapons.arsenal import Plain, has_no_range, parts_of, pattern_of
from weapons.pattern import PatternTable
from weapons.weapon import Weapon

__all__ = ["Shots", "Volley", "check_aimed", "checked_shots", "placements_of", "recoiled", "volley_of"]

OWNER_MAX = 2**31
EVERY = np.int64(ALL)

FEW = 1024
"""Rows that are sooner written than spread."""


@dataclass(frozen=True, eq=False)
class Shots:
    """A checked batch.

    Parameters
    ----------
    at_256 : (N, 2) positions in 1/256 px
    direction : (N, 2) cos and sin of the aim times 2**30
    toward_256 : (N, 2) from there to the points that they are aimed at, in 1/256 px; None if they have an angle
    accept : (N,) category bits
    exclude : (N, K) owners, -1 for none
    number : (N,) shot numbers, for the draws
    seed : (N,) uint64, of the draws
    row : (N,) their places in the call, for errors
    """

    at_256: Ints
    direction: Ints
    toward_256: Ints | None
    accept: Ints
    exclude: Ints
    number: Ints
    seed: draws.Words
    row: Ints

    def __len__(self) -> int:
        return len(self.number)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        toward = 0 if self.toward_256 is None else self.toward_256.nbytes
        words = (self.at_256, self.direction, self.accept, self.exclude, self.number, self.seed, self.row)
        return toward + sum(column.nbytes for column in words)

    @cached_property
    def choosy(self) -> bool:
        """Whether any shot may refuse an item."""
        return bool((self.accept != ALL).any() or self.exclude.shape[1])

    def take(self, first: int, last: int) -> Shots:
        """Shots first .. last - 1."""
        return self if first == 0 and last >= len(self) else self.pick(slice(first, last))

    def pick(self, rows: Ints | slice) -> Shots:
        """Some of the shots."""
        columns: list[Any] = [getattr(self, f.name) for f in fields(self)]
        some: list[Any] = [None if column is None else column[rows] for column in columns]
        return Shots(*some)


@dataclass(frozen=True, eq=False)
class Volley:
    """Placed patterns, sorted by (shot, round, pellet), as columns.

    Parameters
    ----------
    table : the distinct patterns
    pattern : (P,) which of them
    xy : (P, 2) whole pixel it is placed on
    origin_xy : (P, 2) whole pixel of its round, from which distances are counted
    shot, round, pellet : (P,) whose it is; `shot` counts from 0 within the batch
    """

    table: PatternTable
    pattern: Ints
    xy: Ints
    origin_xy: Ints
    shot: Ints
    round: Ints
    pellet: Ints

    @property
    def boxes(self) -> Ints:
        """Inclusive boxes (P, 4); an empty pattern has x_max < x_min."""
        return np.asarray(self.table.box_xyxy[self.pattern] + np.concatenate([self.xy, self.xy], axis=1))

    @property
    def nbytes(self) -> int:
        """Bytes of the table and the columns."""
        columns = (self.pattern, self.origin_xy, self.shot, self.round, self.pellet)
        scattered = 0 if self.xy is self.origin_xy else self.xy.nbytes
        return self.table.nbytes + scattered + sum(column.nbytes for column in columns)

    @property
    def count(self) -> Ints:
        """Samples (P,) of each."""
        return self.table.count[self.pattern]

    @property
    def rounds(self) -> int:
        """Rounds of a shot."""
        return int(self.round.max(initial=0)) + 1

    @property
    def scattered(self) -> bool:
        """Whether a round has several pellets."""
        return self.xy is not self.origin_xy


def checked_shots(
    weapon: Weapon,
    at: object,
    aim: object,
    toward: object,
    accept: object,
    exclude: object,
    seed: object,
    shot: object,
) -> Shots:
    """Check the arguments of `fire`; each of them is one for all shots or one for each."""
    at_256, single = _places(at)
    n = len(at_256)
    numbers = np.arange(n)
    offset = None if toward is None else _offsets(at_256, aim, toward)
    check_aimed(weapon, offset)
    return Shots(
        at_256,
        _directions(n, aim, offset),
        offset,
        _accepted(accept, n),
        _owners(exclude, n, single),
        numbers if shot is None else integers("shot", each("shot", shot, n), (n,), 0, 2**63 - 1),
        _seeds(seed, n),
        numbers,
    )


def _places(at: object) -> tuple[Ints, bool]:
    """Positions (N, 2) in 1/256 px, and whether it was one shot's alone (2,)."""
    plain = at if type(at) is np.ndarray and at.dtype == np.float64 and at.shape[1:] == (2,) else None
    if plain is not None and (np.abs(plain) <= POSITION_MAX).all():  # NaN is not
        return snap(plain), False
    single = array_of("at", at).shape == (2,)
    return snap(reals("at", at, (2,) if single else (None, 2), POSITION_MAX)).reshape(-1, 2), single


def _accepted(accept: object, n: int) -> Ints:
    """Category bits (n,)."""
    if accept is ALL:
        return _spread(EVERY, n)
    return integers("accept", each("accept", accept, n), (n,), 0, ALL)


def _spread(value: np.int64 | int | Ints, n: int) -> Ints:
    """One value, or one row of values, for all of n shots; for many it is there once."""
    one = np.asarray(value)
    if n <= FEW:
        return np.full((n, *one.shape), one)
    return np.broadcast_to(one, (n, *one.shape))


def placements_of(weapon: Weapon) -> int:
    """Placements of one shot: pellets of all rounds."""
    burst, spread, _ = parts_of(weapon)
    return (burst.count if burst else 1) * (spread.count if spread else 1)


def volley_of(weapon: Weapon, shots: Shots) -> Volley:
    """Place every pellet of every round of every shot."""
    burst, spread, plain = parts_of(weapon)
    if not burst and not spread:
        xy, none = pixel(shots.at_256), _spread(0, len(shots))
        table, pattern = _patterns(plain, shots.direction)
        return Volley(table, pattern, xy, xy, np.arange(len(shots)), none, none)
    rounds, pellets = burst.count if burst else 1, spread.count if spread else 1
    shot = np.repeat(np.arange(len(shots)), rounds * pellets)
    round_ = np.tile(np.repeat(np.arange(rounds), pellets), len(shots))
    pellet = np.tile(np.arange(pellets), len(shots) * rounds)
    origin = shots.at_256[shot]
    direction = shots.direction[shot] if plain.directed else _spread(np.zeros(2, np.int64), len(shot))
    if burst:
        origin = origin + round_[:, None] * snap(burst.recoil_xy)
        direction = recoiled(direction, round_, burst.recoil_deg) if plain.directed else direction
    origin_xy = pixel(origin)
    xy = origin_xy
    if spread:
        offsets = kernels_of(draws).disc_offsets(
            int(snap(spread.radius)), shots.seed[shot], shots.number[shot], round_, pellet
        )
        xy = origin_xy + offsets
    table, pattern = _patterns(plain, direction)
    return Volley(table, pattern, xy, origin_xy, shot, round_, pellet)


def _patterns(plain: Plain, direction: Ints) -> tuple[PatternTable, Ints]:
    """Distinct patterns of directions (P, 2), and which is whose."""
    if not plain.directed or not len(direction) or not direction.strides[0] or (direction == direction[0]).all():
        c, s = direction[0].tolist() if plain.directed and len(direction) else (ONE, 0)
        return pattern_of(plain, c, s).table, _spread(0, len(direction))
    number, which = np.unique(direction[:, 0] * (4 * ONE) + direction[:, 1], return_inverse=True)  # |c|, |s| <= ONE
    c = (number + 2 * ONE) // (4 * ONE)
    pairs = zip(c.tolist(), (number - c * (4 * ONE)).tolist(), strict=True)
    return PatternTable([pattern_of(plain, c, s) for c, s in pairs]), which


def _directions(n: int, aim: object, offset: Ints | None) -> Ints:
    if offset is None and (aim is None or isinstance(aim, int | float)):
        c, s = (ONE, 0) if aim is None else unit(reals("aim", aim, ()))
        return _spread(np.array([int(c), int(s)]), n)
    if offset is None:
        return np.stack(unit(reals("aim", each("aim", aim, n), (n,))), axis=1)
    return np.stack(unit_toward(offset[:, 0], offset[:, 1]), axis=1)


def _offsets(at_256: Ints, aim: object, toward: object) -> Ints:
    """From shots to the points that they are aimed at."""
    if aim is not None:
        raise InputError("aim: expected aim or toward, got both")
    targets = points("toward", toward, len(at_256))
    offset = snap(targets) - at_256
    same = np.flatnonzero((offset == 0).all(axis=1))
    if len(same):
        got = targets[same[0]].tolist()
        raise InputError(f"toward[{same[0]}]: expected a point other than the shot's own, got {got}")
    return offset


def check_aimed(weapon: Weapon, offset: Ints | None) -> None:
    """Check that a ray without a range has an end, and within reach."""
    if not has_no_range(weapon):
        return
    if offset is None:
        raise InputError("toward: expected a point, as the weapon has no range, got none")
    far = np.flatnonzero((np.abs(offset) > SUB * REACH_MAX).any(axis=1))
    if len(far):
        got = (offset[far[0]] / SUB).tolist()
        raise InputError(
            f"toward[{far[0]}]: expected a point within {REACH_MAX} px of the shot, got one at {got} of it"
        )


def recoiled(direction: Ints, round_: Ints, degrees: float) -> Ints:
    """Directions, or other vectors, turned by the recoil of the rounds before theirs."""
    if not degrees:
        return direction
    c, s = unit(degrees * np.arange(int(round_.max(initial=0)) + 1))
    return turned(direction, c[round_], s[round_])


def _seeds(seed: object, n: int) -> draws.Words:
    """Seeds (n,): one for all, or one for each."""
    # As objects: numpy would make float64 of a list with numbers on both sides of 2**63, and lose their last bits.
    if type(seed) is int and 0 <= seed <= SEED_MAX:
        return np.broadcast_to(np.uint64(seed), (n,))
    given = seed if isinstance(seed, np.ndarray) else array_of("seed", seed, dtype=object)
    if given.ndim == 0:
        return np.broadcast_to(np.uint64(integer("seed", given.item(), 0, SEED_MAX)), (n,))
    if given.shape != (n,):
        raise InputError(f"seed: expected one, or one for each of {n} shots, got shape {given.shape}")
    if given.dtype.kind != "u":
        given = np.array([integer(f"seed[{i}]", v, 0, SEED_MAX) for i, v in enumerate(given.tolist())], np.uint64)
    return given.astype(np.uint64)


def _owners(exclude: object, n: int, single: bool) -> Ints:
    """Owners (n, K): a number, one for each shot (n,), or several for all (1, K) or for each (n, K); -1 for none."""
    if exclude is None:
        return np.zeros((n, 0), np.int64)
    array = array_of("exclude", exclude)
    if array.ndim == 0:
        array = np.broadcast_to(array, (n, 1))
    elif array.ndim == 1:
        array = array[None] if single else array[:, None]
    if array.ndim == 2 and len(array) == 1:
        array = np.broadcast_to(array, (n, array.shape[1]))
    return integers("exclude", array, (n, None), -1, OWNER_MAX)
