"""Shots to rays: every round and every pellet of every shot, both ends on the 1/256-px grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planes.arrays import Ints
from planes.constants import SUB
from planes.grid256 import pixel, scaled, snap, turned, unit
from planes.twins import kernels_of
from weapons import draws
from weapons.arsenal import Rounds, Spread
from weapons.columns import ZEROS
from weapons.guns import Sweep, Traced
from weapons.volley import Shots, recoiled

__all__ = ["Rays", "rays_of"]


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays, sorted by (shot, round, pellet), as columns.

    Parameters
    ----------
    start_256, step_256 : (R, 2) where they begin, and from there to their ends
    origin_xy : (R, 2) whole pixel that they begin on
    shot, round, pellet : (R,) whose they are; `shot` counts from 0 within the batch
    """

    start_256: Ints
    step_256: Ints
    origin_xy: Ints
    shot: Ints
    round: Ints
    pellet: Ints

    def __len__(self) -> int:
        return len(self.shot)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return sum(int(column.nbytes) for column in vars(self).values())

    def take(self, first: int, last: int) -> Rays:
        """Rays first .. last - 1."""
        part = slice(first, last)
        return replace(self, **{name: getattr(self, name)[part] for name in self.__dataclass_fields__})

    def pick(self, rows: Ints) -> Rays:
        """Some of the rays."""
        return replace(self, **{name: getattr(self, name)[rows] for name in self.__dataclass_fields__})


Parts = tuple[Rounds | None, Spread | Sweep | None, Traced]


def rays_of(parts: Parts, shots: Shots) -> Rays:
    """Place every pellet of every round of every shot; `parts` are those of the weapon."""
    burst, several, _ = parts
    rounds, pellets = burst.count if burst else 1, several.count if several else 1
    shot = np.arange(len(shots)).repeat(rounds * pellets)
    one = rounds * pellets == 1
    round_ = ZEROS[: len(shots)] if one else np.tile(np.repeat(np.arange(rounds), pellets), len(shots))
    pellet = ZEROS[: len(shots)] if one else np.tile(np.arange(pellets), len(shots) * rounds)
    start, origin_xy = (shots.at_256, shots.xy) if one else (shots.at_256[shot], shots.xy[shot])
    if burst:
        start = start + round_[:, None] * snap(burst.recoil_xy)
        origin_xy = pixel(start)
    return Rays(start, _steps(parts, shots, shot, round_, pellet), origin_xy, shot, round_, pellet)


def _steps(parts: Parts, shots: Shots, shot: Ints, round_: Ints, pellet: Ints) -> Ints:
    """From the start of each ray to its end."""
    burst, several, ray = parts
    length = ray.length_256
    ahead = shots.toward_256 if length is None else shots.direction
    assert ahead is not None  # checked with the shots
    ahead = ahead if len(shot) == len(shots) else ahead[shot]
    if burst:
        ahead = recoiled(ahead, round_, burst.recoil_deg)
    if isinstance(several, Sweep):
        # Both sides of the fan are mirrors of each other: an odd numerator over the same number.
        c, s = unit(several.angle * ((2 * np.arange(several.count) - several.count + 1) / (2 * (several.count - 1))))
        ahead = turned(ahead, c[pellet], s[pellet])
    step = ahead if length is None else scaled(ahead, length)
    if isinstance(several, Spread):
        key = shots.seed[shot], shots.number[shot], round_, pellet
        step = step + SUB * kernels_of(draws).disc_offsets(int(snap(several.radius)), *key)
    return step
