"""Shots to placed patterns: every round and every pellet of every shot, each on its whole pixel."""

from __future__ import annotations

from typing import Any

import numpy as np

from planes import snapping
from planes.arrays import InputError, Ints, array_of, each, integer, integers, reals
from planes.constants import ALL, POSITION_MAX, REACH_MAX, SEED_MAX, SUB
from planes.grid256 import ONE, pixel, snap, turned, unit, unit_toward
from planes.kept import once
from planes.poses import one_place, points
from planes.twins import kernels_of
from weapons import draws
from weapons.arsenal import Plain, has_no_range, parts_of, pattern_of
from weapons.columns import ZEROS
from weapons.pattern import PatternTable
from weapons.weapon import Weapon

__all__ = ["Shots", "Volley", "check_aimed", "checked_shots", "placements_of", "recoiled", "volley_of"]

OWNER_MAX = 2**31
STRAIGHT = (ONE, 0)


class Shots:
    """A checked batch. What is the same for all shots is given once; its column is made when it is read.

    Parameters
    ----------
    at_256 : (N, 2) positions in 1/256 px
    direction : (N, 2) cos and sin of the aim times 2**30, or those of all; None: toward their points
    toward_256 : (N, 2) from there to the points that they are aimed at, in 1/256 px; None if they have an angle
    accept : (N,) category bits, or those of all
    exclude : (N, K) owners, -1 for none, or those of all
    number : (N,) shot numbers, for the draws, or that of the first, from which they count up
    seed : (N,) uint64, of the draws, or that of all
    row : (N,) their places in the call, for errors, or that of the first
    """

    def __init__(
        self,
        at_256: Ints,
        direction: Ints | tuple[int, int] | None,
        toward_256: Ints | None,
        accept: Ints | int,
        exclude: Ints | tuple[int, ...],
        number: Ints | int,
        seed: draws.Words | int,
        row: Ints | int,
    ) -> None:
        self.at_256, self.toward_256 = at_256, toward_256
        self._direction, self._accept, self._exclude = direction, accept, exclude
        self._number, self._seed, self._row = number, seed, row

    def __len__(self) -> int:
        return len(self.at_256)

    @once
    def xy(self) -> Ints:
        """Whole pixels (N, 2) that they are on."""
        xy: Ints = kernels_of(snapping).pixels(self.at_256)
        return xy

    @property
    def one_direction(self) -> tuple[int, int] | None:
        """That of all, where one was given for all."""
        return self._direction if isinstance(self._direction, tuple) else None

    @once
    def direction(self) -> Ints:
        """Cosine and sine (N, 2) of the aims, times 2**30."""
        if self._direction is None and self.toward_256 is not None:
            return np.stack(unit_toward(self.toward_256[:, 0], self.toward_256[:, 1]), axis=1)
        return _spread(self._direction, len(self))

    @once
    def accept(self) -> Ints:
        """Category bits (N,)."""
        return _spread(self._accept, len(self))

    @once
    def exclude(self) -> Ints:
        """Owners (N, K) that are passed over, -1 for none."""
        return _spread(self._exclude, len(self))

    @once
    def number(self) -> Ints:
        """Shot numbers (N,), for the draws."""
        return self._number + np.arange(len(self)) if isinstance(self._number, int) else self._number

    @once
    def seed(self) -> draws.Words:
        """Seeds (N,) of the draws."""
        return np.broadcast_to(np.uint64(self._seed), len(self)) if isinstance(self._seed, int) else self._seed

    @once
    def row(self) -> Ints:
        """Places (N,) in the call."""
        return self._row + np.arange(len(self)) if isinstance(self._row, int) else self._row

    @property
    def nbytes(self) -> int:
        """Bytes of what is not the same for all."""
        columns = self.toward_256, self._direction, self._accept, self._exclude, self._number, self._seed, self._row
        return self.at_256.nbytes + sum([column.nbytes for column in columns if isinstance(column, np.ndarray)])

    @once
    def choosy(self) -> bool:
        """Whether any shot may refuse an item."""
        if isinstance(self._accept, int) and isinstance(self._exclude, tuple):
            return self._accept != ALL or bool(self._exclude)
        return bool((self.accept != ALL).any() or self.exclude.shape[1])

    def aimed(self, direction: Ints) -> Shots:
        """The same shots in other directions (N, 2)."""
        rest = self._accept, self._exclude, self._number, self._seed, self._row
        return Shots(self.at_256, direction, self.toward_256, *rest)

    def take(self, first: int, last: int) -> Shots:
        """Shots first .. last - 1."""
        return self if first == 0 and last >= len(self) else self.pick(slice(first, last))

    def pick(self, rows: Ints | slice) -> Shots:
        """Some of the shots: those of rows (n,), or of a slice that has a beginning."""
        begin = rows.start if isinstance(rows, slice) else rows

        def some(column: Any) -> Any:
            return column[rows] if isinstance(column, np.ndarray) else column

        def counted(column: Ints | int) -> Ints | int:
            return column[rows] if isinstance(column, np.ndarray) else column + begin

        return Shots(
            self.at_256[rows], some(self._direction), some(self.toward_256), some(self._accept), some(self._exclude),
            counted(self._number), some(self._seed), counted(self._row),
        )  # fmt: skip


class Volley:
    """Placed patterns, sorted by (shot, round, pellet), as columns.

    Parameters
    ----------
    table : the distinct patterns
    pattern : (P,) which of them; None: all have the first
    xy : (P, 2) whole pixel it is placed on
    turn_xy : (T, 2) whole pixel of each round of each shot, from which distances are counted
    rounds, pellets : of a shot, and of a round
    shot : of all, if they are placements of one shot, again and again
    """

    def __init__(
        self,
        table: PatternTable,
        pattern: Ints | None,
        xy: Ints,
        turn_xy: Ints,
        rounds: int = 1,
        pellets: int = 1,
        shot: int | None = None,
    ) -> None:
        self.table, self.xy, self.turn_xy, self.rounds, self.pellets = table, xy, turn_xy, rounds, pellets
        self._pattern, self._shot = pattern, shot

    def __len__(self) -> int:
        return len(self.xy)

    @once
    def pattern(self) -> Ints:
        """Which of the patterns (P,) each has."""
        return ZEROS[: len(self.xy)] if self._pattern is None else self._pattern

    @once
    def shot(self) -> Ints:
        """Shot (P,) of each, counted from 0 within the batch."""
        return self.turn_of(np.arange(len(self.xy)))[0]

    @once
    def round(self) -> Ints:
        """Round (P,) of each."""
        round_ = self.turn_of(np.arange(len(self.xy)))[1]
        return ZEROS[: len(self.xy)] if round_ is None else round_

    @once
    def pellet(self) -> Ints:
        """Pellet (P,) of each."""
        return ZEROS[: len(self.xy)] if self.pellets == 1 else np.arange(len(self.xy)) % self.pellets

    @once
    def origin_xy(self) -> Ints:
        """Whole pixel (P, 2) of the round of each."""
        return self.turn_xy if self.pellets == 1 else self.turn_xy.repeat(self.pellets, axis=0)

    def turn_of(self, placement: Ints) -> tuple[Ints, Ints | None]:
        """Shots and rounds of some placements (n,); no rounds where each shot has one."""
        return self.shot_of(placement if self.pellets == 1 else placement // self.pellets)

    def shot_of(self, turn: Ints) -> tuple[Ints, Ints | None]:
        """Shots and rounds of some of the rounds of all shots (n,); no rounds where each shot has one."""
        round_ = None
        if self.rounds > 1:
            turn, round_ = np.divmod(turn, self.rounds)
        return turn if self._shot is None else np.full_like(turn, self._shot), round_

    @property
    def boxes(self) -> Ints:
        """Inclusive boxes (P, 4); an empty pattern has x_max < x_min."""
        boxes = np.concatenate([self.xy, self.xy], axis=1)
        boxes += self.table.box_xyxy if self._pattern is None else self.table.box_xyxy[self._pattern]
        return boxes

    @property
    def nbytes(self) -> int:
        """Bytes of the table and of the columns."""
        words = self.xy.size + (0 if self._pattern is None else self._pattern.size)
        return self.table.nbytes + 8 * (words + (self.turn_xy.size if self.scattered else 0))

    @property
    def count(self) -> Ints:
        """Samples (P,) of each."""
        return self.table.count[self.pattern]

    @property
    def scattered(self) -> bool:
        """Whether pellets lie elsewhere than the pixel of their round."""
        return self.xy is not self.turn_xy


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
    offset = None if toward is None else _offsets(at_256, aim, toward)
    check_aimed(weapon, offset)
    return Shots(
        at_256,
        _directions(n, aim) if offset is None else None,
        offset,
        _accepted(accept, n),
        _owners(exclude, n, single),
        0 if shot is None else integers("shot", each("shot", shot, n), (n,), 0, 2**63 - 1),
        _seeds(seed, n),
        0,
    )


def _places(at: object) -> tuple[Ints, bool]:
    """Positions (N, 2) in 1/256 px, and whether it was one shot's alone (2,)."""
    if type(at) is np.ndarray and at.shape[1:] == (2,) and at.dtype == np.float64 and at.flags.aligned:
        many: Ints | None = kernels_of(snapping).snapped(at)
        if many is not None:
            return many, False
    one = one_place(at)
    if one is not None:
        return np.array((one,), np.int64), True
    single = array_of("at", at).shape == (2,)
    return snap(reals("at", at, (2,) if single else (None, 2), POSITION_MAX)).reshape(-1, 2), single


def _accepted(accept: object, n: int) -> Ints | int:
    """Category bits (n,), or those of all."""
    if type(accept) is int and 0 <= accept <= ALL:
        return accept
    return integers("accept", each("accept", accept, n), (n,), 0, ALL)


def _spread(column: Ints | int | tuple[int, ...] | None, n: int) -> Ints:
    """A column as it is, or one value, or row of values, for all of n shots, which is there once."""
    if isinstance(column, np.ndarray):
        return column
    one = np.array(column, np.int64)
    return np.broadcast_to(one, (n, *one.shape))


def placements_of(weapon: Weapon) -> int:
    """Placements of one shot: pellets of all rounds."""
    burst, spread, _ = parts_of(weapon)
    return (burst.count if burst else 1) * (spread.count if spread else 1)


def volley_of(weapon: Weapon, shots: Shots) -> Volley:
    """Place every pellet of every round of every shot."""
    burst, spread, plain = parts_of(weapon)
    if not burst and not spread:
        return Volley(*_patterns(plain, shots.one_direction or shots.direction), shots.xy, shots.xy)
    rounds, pellets = burst.count if burst else 1, spread.count if spread else 1
    shot, round_ = np.repeat(np.arange(len(shots)), rounds), np.tile(np.arange(rounds), len(shots))
    direction: Ints | tuple[int, int] = STRAIGHT
    if plain.directed:
        direction = recoiled(shots.direction[shot], round_, burst.recoil_deg if burst else 0)
    table, pattern = _patterns(plain, direction)
    turn_xy = pixel(shots.at_256[shot] + round_[:, None] * snap(burst.recoil_xy)) if burst else shots.xy
    if not spread:
        return Volley(table, pattern, turn_xy, turn_xy, rounds)
    turns = (column[shot, None] for column in (shots.seed, shots.number))
    xy = kernels_of(draws).disc_offsets(int(snap(spread.radius)), *turns, round_[:, None], np.arange(pellets))
    xy += turn_xy[:, None]
    pattern = None if pattern is None else pattern.repeat(pellets)
    return Volley(table, pattern, xy.reshape(-1, 2), turn_xy, rounds, pellets)


def _patterns(plain: Plain, direction: Ints | tuple[int, int]) -> tuple[PatternTable, Ints | None]:
    """Distinct patterns of directions (P, 2), or of that of all, and which is whose; None if there is one."""
    if not plain.directed or not len(direction):
        direction = STRAIGHT
    elif not isinstance(direction, tuple) and (direction == direction[0]).all():
        c, s = direction[0].tolist()
        direction = c, s
    if isinstance(direction, tuple):
        return pattern_of(plain, *direction).table, None
    number, which = np.unique(direction[:, 0] * (4 * ONE) + direction[:, 1], return_inverse=True)  # |c|, |s| <= ONE
    c = (number + 2 * ONE) // (4 * ONE)
    pairs = zip(c.tolist(), (number - c * (4 * ONE)).tolist(), strict=True)
    return PatternTable([pattern_of(plain, c, s) for c, s in pairs]), which


def _directions(n: int, aim: object) -> Ints | tuple[int, int]:
    """Directions (n, 2) of aims, or that of all."""
    if aim is None:
        return STRAIGHT
    if isinstance(aim, int | float):
        c, s = unit(reals("aim", aim, ()))
        return int(c), int(s)
    return np.stack(unit(reals("aim", each("aim", aim, n), (n,))), axis=1)


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


def _seeds(seed: object, n: int) -> draws.Words | int:
    """Seeds (n,), or that of all."""
    if type(seed) is int and 0 <= seed <= SEED_MAX:
        return seed
    # As objects: numpy would make float64 of a list with numbers on both sides of 2**63, and lose their last bits.
    given = seed if isinstance(seed, np.ndarray) else array_of("seed", seed, dtype=object)
    if given.ndim == 0:
        return integer("seed", given.item(), 0, SEED_MAX)
    if given.shape != (n,):
        raise InputError(f"seed: expected one, or one for each of {n} shots, got shape {given.shape}")
    if given.dtype.kind != "u":
        given = np.array([integer(f"seed[{i}]", v, 0, SEED_MAX) for i, v in enumerate(given.tolist())], np.uint64)
    return given.astype(np.uint64)


def _owners(exclude: object, n: int, single: bool) -> Ints | tuple[int, ...]:
    """Owners (n, K): a number, one for each shot (n,), or several for all (1, K) or for each (n, K); -1 for none."""
    if exclude is None:
        return ()
    if type(exclude) is int and -1 <= exclude <= OWNER_MAX:
        return (exclude,)
    array = array_of("exclude", exclude)
    if array.ndim == 0:
        array = np.broadcast_to(array, (n, 1))
    elif array.ndim == 1:
        array = array[None] if single else array[:, None]
    if array.ndim == 2 and len(array) == 1:
        array = np.broadcast_to(array, (n, array.shape[1]))
    return integers("exclude", array, (n, None), -1, OWNER_MAX)
