"""Checked shots, and their placements: the pattern and pixel of each pellet of each round, by seeded draws.

No state is kept, so any shot of a batch can be fired again alone, in any order, on any machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from hitplanes.planes.bits.bit_rows import Words
from hitplanes.planes.common.backend import cached_attribute, kernels_of
from hitplanes.planes.common.checks import Floats, InputError, Ints, array_of, each, ids_of, integer, integers, reals
from hitplanes.planes.common.limits import ALL, CATEGORY_BITS, EVERYTHING, POSITION_MAX, SEED_MAX
from hitplanes.planes.grid import fixed_point
from hitplanes.planes.grid.fixed_point import ONE, Whole, pixel, snap, turned, unit, unit_of, unit_toward
from hitplanes.planes.grid.spans import Columns, row_order
from hitplanes.planes.scene.poses import is_angle, one_place, points

from .. import late
from .areas import AreaWeapon, Spread, check_aimed, parts_of, pattern_of, patterns_of, pellets_in
from .weapon import PatternTable, Weapon

C = TypeVar("C", bound="ShotColumns")

ZEROS, ONES = (np.broadcast_to(np.int64(value), 2**48) for value in (0, 1))
"""Constants whose slices are columns of one value that take no memory."""


@dataclass(frozen=True, eq=False)
class ShotColumns(Columns):
    """Columns of equal length, sorted by the first, `shot`."""

    shot: Ints

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(np.array_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    __hash__ = None  # type: ignore[assignment]

    def of_shot(self: C, shot: int) -> C:
        """Rows of one shot."""
        return self.take(slice(*np.searchsorted(self.shot, [shot, shot + 1]).tolist()))

    def to_rows(self) -> list[dict[str, Any]]:
        """Rows as JSON."""
        names = [f.name for f in fields(self)]
        columns = [getattr(self, name).tolist() for name in names]
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]

    @classmethod
    def gathered(cls: type[C], parts: Sequence[C], shots: Sequence[Ints]) -> C:
        """Rows of several parts in the order of shots; `shots` are the shot numbers of each part."""
        every = cls.joined([replace(part, shot=own[part.shot]) for part, own in zip(parts, shots, strict=True)])
        return every.take(row_order(every.shot))


OWNER_MAX = 2**31
STRAIGHT = (ONE, 0)


@dataclass(eq=False, repr=False)
class Shots:
    """A checked batch of shots. A value that all shots share is given once; its column is made when it is read.

    Parameters
    ----------
    at_256 : (N, 2) positions in 1/256 px
    direction : (N, 2) cos and sin of the aim times 2**30, or one pair; None if shots are aimed at points
    toward_256 : (N, 2) offsets to the points that shots are aimed at, in 1/256 px; None if they have an angle
    meets : (N,) category bits of what may be hit, and CATEGORY_BITS higher those of what blocks; or one value
    exclude : (N, K) owners, -1 for none, or one row
    number : (N,) shot numbers for the draws, or the first of a range
    seed : (N,) uint64 seeds of the draws, or one value
    row : (N,) places in the call, for error texts, or the first of a range
    aim : (N,) angles as they were given, degrees, or one value; None if none was given
    """

    at_256: Ints
    _direction: Ints | tuple[int, int] | None
    toward_256: Ints | None
    _meets: Ints | int
    _exclude: Ints | tuple[int, ...]
    _number: Ints | int
    _seed: Words | int
    _row: Ints | int
    _aim: Floats | float | None = None

    def __len__(self) -> int:
        return len(self.at_256)

    @cached_attribute
    def xy(self) -> Ints:
        """Whole pixels (N, 2) of the positions."""
        return pixel(self.at_256)

    @property
    def one_direction(self) -> tuple[int, int] | None:
        """The direction of all shots, if one was given for all; else None."""
        return self._direction if isinstance(self._direction, tuple) else None

    @cached_attribute
    def direction(self) -> Ints:
        """Cosine and sine (N, 2) of the aims, times 2**30."""
        if self._direction is None and self.toward_256 is not None:
            return np.stack(unit_toward(self.toward_256[:, 0], self.toward_256[:, 1]), axis=1)
        return _spread(self._direction, len(self))

    @property
    def aim(self) -> Floats | None:
        """Angles (N,) of the aims as they were given, degrees; None if none was given."""
        return self._aim if self._aim is None else np.broadcast_to(np.asarray(self._aim), len(self))

    @cached_attribute
    def meets(self) -> Ints:
        """Filters (N,) of the items that the shots meet; the others are passed over."""
        return _spread(self._meets, len(self))

    @property
    def accept(self) -> Ints:
        """Category bits (N,) of what may be hit."""
        return accepted_of(self.meets)

    @property
    def blocked_by(self) -> Ints:
        """Category bits (N,) of what blocks."""
        return blocking_of(self.meets)

    @cached_attribute
    def exclude(self) -> Ints:
        """Owners (N, K) that are passed over, -1 for none."""
        return _spread(self._exclude, len(self))

    @property
    def owners(self) -> Ints | tuple[int, ...]:
        """Owners that are passed over, as they were given: one row for all shots, or (N, K)."""
        return self._exclude

    @cached_attribute
    def number(self) -> Ints:
        """Shot numbers (N,), for the draws."""
        return self._number + np.arange(len(self)) if isinstance(self._number, int) else self._number

    @cached_attribute
    def seed(self) -> Words:
        """Seeds (N,) of the draws."""
        return np.broadcast_to(np.uint64(self._seed), len(self)) if isinstance(self._seed, int) else self._seed

    @cached_attribute
    def row(self) -> Ints:
        """Places (N,) in the call."""
        return self._row + np.arange(len(self)) if isinstance(self._row, int) else self._row

    @property
    def nbytes(self) -> int:
        """Bytes of the columns; values that all shots share do not count."""
        rest = self._meets, self._exclude, self._number, self._seed, self._row
        columns = self.toward_256, self._direction, self._aim, *rest
        return self.at_256.nbytes + sum([column.nbytes for column in columns if isinstance(column, np.ndarray)])

    @cached_attribute
    def choosy(self) -> bool:
        """Whether any shot may refuse an item."""
        if isinstance(self._meets, int) and isinstance(self._exclude, tuple):
            return self._meets != EVERYTHING or bool(self._exclude)
        return bool((self.meets != EVERYTHING).any() or self.exclude.shape[1])

    def aimed(self, direction: Ints | tuple[int, int]) -> Shots:
        """The same shots in other directions (N, 2), or all in one."""
        return replace(self, _direction=direction, _aim=None)

    def aimed_at(self, toward_256: Ints) -> Shots:
        """The same shots, aimed at points at offsets (N, 2)."""
        return replace(self, _direction=None, toward_256=toward_256, _aim=None)

    def take(self, first: int, last: int) -> Shots:
        """Shots first .. last - 1."""
        return self if first == 0 and last >= len(self) else self.pick(slice(first, last))

    def pick(self, rows: Ints | slice) -> Shots:
        """Shots of rows (n,), or of a slice with a start."""
        begin = rows.start if isinstance(rows, slice) else rows

        def picked(column: Any) -> Any:
            return column[rows] if isinstance(column, np.ndarray) else column

        def counted(column: Ints | int) -> Ints | int:
            return column[rows] if isinstance(column, np.ndarray) else column + begin

        return Shots(
            self.at_256[rows], picked(self._direction), picked(self.toward_256), picked(self._meets),
            picked(self._exclude), counted(self._number), picked(self._seed), counted(self._row), picked(self._aim),
        )  # fmt: skip


@dataclass(eq=False, repr=False)
class Placements:
    """Placed patterns, sorted by (shot, round, pellet), as columns.

    Parameters
    ----------
    table : the distinct patterns
    pattern : (P,) pattern of each placement; None if all have the first
    xy : (P, 2) whole pixel that the pattern is placed on
    turn_xy : (T, 2) whole pixel of each round of each shot; distances are counted from it
    rounds, pellets : rounds of a shot, and pellets of a round
    """

    table: PatternTable
    _pattern: Ints | None
    xy: Ints
    turn_xy: Ints
    rounds: int = 1
    pellets: int = 1

    def __len__(self) -> int:
        return len(self.xy)

    @cached_attribute
    def pattern(self) -> Ints:
        """Pattern (P,) of each placement."""
        return ZEROS[: len(self.xy)] if self._pattern is None else self._pattern

    @cached_attribute
    def shot(self) -> Ints:
        """Shot (P,) of each, counted from 0 within the batch."""
        return self.turn_of(np.arange(len(self.xy)))[0]

    @cached_attribute
    def round(self) -> Ints:
        """Round (P,) of each."""
        round_ = self.turn_of(np.arange(len(self.xy)))[1]
        return ZEROS[: len(self.xy)] if round_ is None else round_

    @cached_attribute
    def pellet(self) -> Ints:
        """Pellet (P,) of each."""
        return ZEROS[: len(self.xy)] if self.pellets == 1 else np.arange(len(self.xy)) % self.pellets

    @cached_attribute
    def origin_xy(self) -> Ints:
        """Whole pixel (P, 2) of the round of each."""
        return self.turn_xy if self.pellets == 1 else self.turn_xy.repeat(self.pellets, axis=0)

    def turn_of(self, placement: Ints) -> tuple[Ints, Ints | None]:
        """Shots and rounds of placements (n,); the rounds are None if each shot has one."""
        return self.shot_of(placement if self.pellets == 1 else placement // self.pellets)

    def shot_of(self, turn: Ints) -> tuple[Ints, Ints | None]:
        """Shots and rounds of turns (n,), which number the rounds of all shots; no rounds if each shot has one."""
        round_ = None
        if self.rounds > 1:
            turn, round_ = np.divmod(turn, self.rounds)
        return turn, round_

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
        """Whether pellets are placed off the pixel of their round."""
        return self.xy is not self.turn_xy


def checked_shots(
    weapon: Weapon,
    at: object,
    aim: object,
    toward: object,
    accept: object,
    blocked_by: object,
    exclude: object,
    seed: object,
    shot: object,
) -> Shots:
    """Check the arguments of `fire`; each of them is one for all shots or one for each."""
    toward = None if toward is None else array_of("toward", toward)
    toward = toward.reshape(0, 2) if toward is not None and toward.shape == (0,) else toward  # an empty list of points
    aim = aim if aim is None or isinstance(aim, int | float) else array_of("aim", aim)
    aimed = ("aim", aim) if toward is None else ("toward", toward)
    at_256, single = _for_each_aim(*places_256("at", at), *aimed)
    n = len(at_256)
    offset = None if toward is None else _offsets(at_256, aim, toward)
    check_aimed(weapon, offset)
    angles = None if aim is None else _angles(n, aim)
    return Shots(
        at_256,
        _directions(angles) if offset is None else None,
        offset,
        checked_filter(accept, blocked_by, n),
        checked_owners(exclude, n, single),
        0 if shot is None else integers("shot", each("shot", shot, n), (n,), 0, 2**63 - 1),
        checked_seeds(seed, n),
        0,
        angles,
    )


def unaimed_shots(field: str, at: object, accept: object, blocked_by: object, exclude: object) -> Shots:
    """Check places and filters of shots that are aimed later; the places are the value of the field."""
    at_256, single = places_256(field, at)
    n = len(at_256)
    meets, owners = checked_filter(accept, blocked_by, n), checked_owners(exclude, n, single)
    return Shots(at_256, STRAIGHT, None, meets, owners, 0, 0, 0)


def places_256(field: str, at: object) -> tuple[Ints, bool]:
    """Positions (N, 2) in 1/256 px, and whether one position (2,) was given."""
    if type(at) is np.ndarray and at.shape[1:] == (2,) and at.dtype == np.float64 and at.flags.aligned:
        many: Ints | None = kernels_of(fixed_point).snapped(at)
        if many is not None:
            return many, False
    place = one_place(at)
    if place is not None:
        return np.array((place,), np.int64), True
    given = array_of(field, at)
    if given.ndim == 1 and given.dtype.kind in "iuf" and len(given) not in (0, 2):
        raise InputError(f"{field}: expected shape (2,) or (any, 2), got {given.shape}")
    single = given.shape == (2,)
    return snap(reals(field, at, (2,) if single else (None, 2), POSITION_MAX)).reshape(-1, 2), single


def _for_each_aim(at_256: Ints, single: bool, field: str, value: object) -> tuple[Ints, bool]:
    """Positions (N, 2) of all shots, and whether there is one shot.

    One position is that of all aims (N,) or targets (N, 2), which are the value of the field.
    """
    shape: tuple[int, ...] = value.shape if isinstance(value, np.ndarray) else ()
    if len(shape) != {"aim": 1, "toward": 2}[field]:
        return at_256, single
    if single:
        return np.repeat(at_256, shape[0], axis=0), False
    if shape[0] != len(at_256):
        expected = (len(at_256), *shape[1:])
        raise InputError(f"{field}: expected shape {expected}, as at has shape {at_256.shape}, got {shape}")
    return at_256, False


def filter_of(accept: Ints | int, blocked_by: Ints | int) -> Ints | int:
    """Filter of what shots meet, a signed word: `accept` for objects, and CATEGORY_BITS higher `blocked_by`."""
    top = 1 << CATEGORY_BITS - 1
    signed = (blocked_by ^ top) - top
    return accept | signed << CATEGORY_BITS


def accepted_of(meets: Whole) -> Whole:
    """Category bits in a filter of what may be hit."""
    bits: Whole = meets & ALL
    return bits


def blocking_of(meets: Whole) -> Whole:
    """Category bits in a filter of what blocks."""
    bits: Whole = meets >> CATEGORY_BITS & ALL
    return bits


def checked_filter(accept: object, blocked_by: object, n: int) -> Ints | int:
    """Filter (n,) of what shots meet, or one value for all."""
    return filter_of(_bits("accept", accept, n), _bits("blocked_by", blocked_by, n))


def _bits(name: str, bits: object, n: int) -> Ints | int:
    """Category bits (n,), or one value for all shots."""
    if type(bits) is int and 0 <= bits <= ALL:
        return bits
    return integers(name, each(name, bits, n), (n,), 0, ALL)


def _spread(column: Ints | int | tuple[int, ...] | None, n: int) -> Ints:
    """A column unchanged; or one value, or row of values, broadcast to n shots."""
    if isinstance(column, np.ndarray):
        return column
    value = np.array(column, np.int64)
    return np.broadcast_to(value, (n, *value.shape))


def placements_of(weapon: Weapon) -> int:
    """Number of placements of one shot: the pellets of all rounds."""
    return pellets_in(parts_of(weapon))


def placements_for(weapon: Weapon, shots: Shots) -> Placements:
    """Place every pellet of every round of every shot."""
    burst, spread, plain = parts_of(weapon)
    if not burst and not spread:
        return Placements(*distinct_patterns(plain, shots.one_direction or shots.direction), shots.xy, shots.xy)
    rounds, pellets = burst.count if burst else 1, spread.count if spread else 1
    shot, round_ = np.repeat(np.arange(len(shots)), rounds), np.tile(np.arange(rounds), len(shots))
    direction: Ints | tuple[int, int] = STRAIGHT
    if plain.directed:
        direction = recoiled(shots.direction[shot], round_, burst.recoil_deg if burst else 0)
    table, pattern = distinct_patterns(plain, direction)
    turn_xy = pixel(shots.at_256[shot] + round_[:, None] * snap(burst.recoil_xy)) if burst else shots.xy
    if not spread:
        return Placements(table, pattern, turn_xy, turn_xy, rounds)
    xy = pellets_of(spread, shots.seed[shot], shots.number[shot], round_) + turn_xy[:, None]
    pattern = None if pattern is None else pattern.repeat(pellets)
    return Placements(table, pattern, xy.reshape(-1, 2), turn_xy, rounds, pellets)


def pellets_of(spread: Spread[Any], seed: Words, shot: Ints, round_: Ints) -> Ints:
    """Offsets (T, K, 2) of the pellets of rounds, from their seeds, shots and rounds (T,)."""
    offsets: Ints = kernels_of(late.draws).disc_offsets(int(snap(spread.radius)), seed, shot, round_, spread.count)
    return offsets


def distinct_patterns(plain: AreaWeapon, direction: Ints | tuple[int, int]) -> tuple[PatternTable, Ints | None]:
    """Distinct patterns of directions (P, 2), or of one, and the pattern of each direction; None if there is one."""
    if not plain.directed or not len(direction):
        direction = STRAIGHT
    elif not isinstance(direction, tuple) and (direction == direction[0]).all():
        c, s = direction[0].tolist()
        direction = c, s
    if isinstance(direction, tuple):
        if direction == STRAIGHT:
            return pattern_of(plain, *STRAIGHT).table, None
        return patterns_of(plain, np.array([direction])), None
    number, which = np.unique(direction[:, 0] * (4 * ONE) + direction[:, 1], return_inverse=True)  # |c|, |s| <= ONE
    c = (number + 2 * ONE) // (4 * ONE)
    return patterns_of(plain, np.stack([c, number - c * (4 * ONE)], axis=1)), which


def _angles(n: int, aim: object) -> Floats | float:
    """Angles (n,) of aims, degrees, or one for all shots."""
    if isinstance(aim, int | float):
        return float(aim if is_angle(aim) else reals("aim", aim, ()))
    return reals("aim", each("aim", aim, n), (n,))


def _directions(angles: Floats | float | None) -> Ints | tuple[int, int]:
    """Directions (n, 2) of angles, or one for all shots."""
    if angles is None:
        return STRAIGHT
    return unit_of(angles) if isinstance(angles, float) else np.stack(unit(angles), axis=1)


def _offsets(at_256: Ints, aim: object, toward: object) -> Ints:
    """Offsets (N, 2) from shots to the points that they are aimed at, in 1/256 px."""
    if aim is not None:
        raise InputError("aim: expected aim or toward, got both")
    targets = points("toward", toward, len(at_256))
    offset = snap(targets) - at_256
    same = np.flatnonzero((offset == 0).all(axis=1))
    if len(same):
        got = targets[same[0]].tolist()
        raise InputError(f"toward[{same[0]}]: expected a point other than the shot's own, got {got}")
    return offset


def recoiled(direction: Ints, round_: Ints, degrees: float) -> Ints:
    """Directions, or other vectors, turned by the recoil of all earlier rounds."""
    if not degrees:
        return direction
    c, s = unit(degrees * np.arange(int(round_.max(initial=0)) + 1))
    return turned(direction, c[round_], s[round_])


def checked_seeds(seed: object, n: int) -> Words | int:
    """Seeds (n,), or one value for all shots."""
    if type(seed) is int and 0 <= seed <= SEED_MAX:
        return seed
    # As objects: numpy would turn a list with numbers on both sides of 2**63 into float64, and lose their last bits.
    given = seed if isinstance(seed, np.ndarray) else array_of("seed", seed, dtype=object)
    if given.ndim == 0:
        return integer("seed", given.item(), 0, SEED_MAX)
    if given.shape != (n,):
        raise InputError(f"seed: expected one, or one for each of {n} shots, got shape {given.shape}")
    if given.dtype.kind != "u":
        given = np.array([integer(f"seed[{i}]", v, 0, SEED_MAX) for i, v in enumerate(given.tolist())], np.uint64)
    return given.astype(np.uint64)


def checked_owners(exclude: object, n: int, single: bool) -> Ints | tuple[int, ...]:
    """Owners (n, K): a number, one for each shot (n,), or several for all (1, K) or for each (n, K); -1 for none."""
    if exclude is None:
        return ()
    if type(exclude) is int and -1 <= exclude <= OWNER_MAX:
        return (exclude,)
    if single and isinstance(exclude, tuple | list) and all(type(v) is int and -1 <= v <= OWNER_MAX for v in exclude):
        return tuple(exclude)
    given = ids_of("exclude", exclude)
    owners = integers("exclude", given, (None,) * given.ndim, -1, OWNER_MAX)
    if owners.ndim < 2:
        owners = owners.reshape((1, -1) if single or not owners.ndim else (-1, 1))
    if owners.ndim == 2 and len(owners) == 1:
        owners = owners.repeat(n, axis=0)
    if len(owners) != n:
        raise InputError(
            f"exclude: expected an owner for each of {n} shots, or one list for all of them, as [[1, 2]], "
            f"got shape {given.shape}"
        )
    if owners.ndim > 2:
        raise InputError(f"exclude: expected shape ({n}, any), got {given.shape}")
    return owners
