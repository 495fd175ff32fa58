"""What callers say of poses: places, scales, flips and frames, checked and rounded, and the looks that follow."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from ..common.checks import Floats, InputError, array_of, choice, each, integers, reals, repeated, within
from ..common.limits import POSITION_MAX, SUB
from ..grid.fixed_point import all_quarter_turns, snap
from .sprite import Sprite, as_sprite, frame_number
from .variants import FLIPS, Transform, whole_scale

NUMBERS = frozenset((int, float, np.float64))
FLOAT64 = np.dtype(np.float64)


def points(field: str, values: object, n: int, limit: float = POSITION_MAX) -> Floats:
    """Positions or velocities (n, 2), or one (2,) for all, px."""
    if array_of(field, values).shape == (2,):
        return np.broadcast_to(reals(field, values, (2,), limit), (n, 2))
    return reals(field, values, (n, 2), limit)


def are_rows(ids: object, xy: object) -> bool:
    """Whether these are contiguous arrays of ids (n,) and of positions (n, 2), n > 0."""
    if type(ids) is not np.ndarray or type(xy) is not np.ndarray or ids.dtype != np.int64 or xy.dtype != np.float64:
        return False
    fit = ids.ndim == 1 and len(ids) > 0 and xy.shape == (len(ids), 2)
    return fit and ids.flags.c_contiguous and xy.flags.c_contiguous


def one_place(xy: object) -> tuple[int, int] | None:
    """Round one position in range as `snap` does; None for any other value, valid or not."""
    if type(xy) is np.ndarray:
        if xy.dtype != FLOAT64 or xy.shape != (2,):
            return None
        x, y = xy.tolist()
    elif isinstance(xy, tuple | list) and len(xy) == 2 and type(xy[0]) in NUMBERS and type(xy[1]) in NUMBERS:
        x, y = xy
    else:
        return None
    if not (-POSITION_MAX <= x <= POSITION_MAX and -POSITION_MAX <= y <= POSITION_MAX):
        return None
    return round(x * SUB), round(y * SUB)


def place_256(field: str, xy: object, limit: float) -> tuple[int, int]:
    """Check one position or velocity, px, and round it to 1/256 px."""
    place = one_place(xy)
    if place is None or max(map(abs, place)) >= SUB * limit:
        x, y = snap(reals(field, xy, (2,), limit)).tolist()
        return x, y
    return place


def is_angle(value: object) -> TypeGuard[float]:
    """Whether a value is one valid angle as it stands; others are checked as arrays, valid or not."""
    return math.isfinite(value) if type(value) is float else type(value) is int and abs(value) <= POSITION_MAX


def scale_pair(scale: object) -> tuple[float, float]:
    """Check a scale, one number or (sx, sy), and return the pair."""
    if type(scale) is float:
        return scale, scale  # `whole_scale` checks it
    if array_of("scale", scale).ndim == 0:
        one = float(reals("scale", scale, ()))
        return one, one
    sx, sy = reals("scale", scale, (2,)).tolist()
    return sx, sy


class Looks(NamedTuple):
    """What the masks of n objects are made of: a sprite, an angle in degrees, and a transform of each."""

    sprites: list[Sprite]
    angles: list[float]
    transforms: list[Transform]

    def changed(self, sprite: object, angle: object, scale: object, flip: object, frame: object) -> Looks:
        """Looks after a change, of which each part is one for all, one per object, or None for no change."""
        n = len(self.sprites)
        sprites, angles = self.sprites, self.angles
        columns: Iterable[Any] = zip(*self.transforms, strict=True) if n else ((),) * len(Transform())
        frames, flips, x, y, *turns = columns
        if sprite is not None:
            sprites = _sprite_rows(sprite, n)
        if angle is not None:
            angles = [float(angle)] * n if is_angle(angle) else reals("angle", each("angle", angle, n), (n,)).tolist()
        if angle is not None or sprite is not None:
            turns = all_quarter_turns([sprite.stepped(angle) for sprite, angle in zip(sprites, angles, strict=True)])
        if scale is not None:
            x, y = _scale_rows(scale, n)
        if frame is not None:
            frames = _frame_rows(frame, sprites)
        elif sprite is not None:
            _check_frames(frames, sprites)
        if flip is not None:
            flips = _flip_rows(flip, n)
        return Looks(sprites, angles, list(map(Transform, frames, flips, x, y, *turns)))


def _sprite_rows(sprite: object, n: int) -> list[Sprite]:
    """Check sprites, one for all or a list (n,); each may be a mask or an image."""
    if not isinstance(sprite, list | tuple) or not any(isinstance(value, Sprite | np.ndarray) for value in sprite):
        return [as_sprite(sprite)] * n
    if len(sprite) != n:
        raise InputError(f"sprite: expected one for all or {n}, got {len(sprite)}")
    made = []
    for row, value in enumerate(sprite):
        with within(f"row {row}"):
            made.append(as_sprite(value))
    return made


def _frame_rows(frame: object, sprites: list[Sprite]) -> list[int]:
    """Check frames of objects, one for all or (n,), as numbers or as names in their sprites."""
    given = repeated("frame", frame, len(sprites))
    if given.dtype.kind == "U" and given.shape != (len(sprites),):
        raise InputError(f"frame: expected one for all or {len(sprites)}, got {given.size}")
    numbers: list[Any] = given.tolist()
    if given.dtype.kind != "U":
        numbers = integers("frame", given, (len(sprites),), 0, 2**31).tolist()
    for row, sprite in enumerate(sprites):
        if isinstance(numbers[row], str) or numbers[row] >= sprite.frame_count:
            with within(f"row {row}"):
                numbers[row] = frame_number(sprite, numbers[row])
    return numbers


def _check_frames(frames: Sequence[int], sprites: list[Sprite]) -> None:
    """Check that the new sprites of objects have the frames that these show."""
    for row, (number, sprite) in enumerate(zip(frames, sprites, strict=True)):
        if number >= sprite.frame_count:
            found = f"the object shows frame {number}, and its new sprite has {sprite.frame_count}"
            raise InputError(f"row {row}: frame: expected one of the new sprite, as {found}")


def _flip_rows(flip: object, n: int) -> list[str]:
    """Check flips, one word for all or (n,)."""
    words: list[str] = repeated("flip", flip, n).tolist()
    if len(words) != n:
        raise InputError(f"flip: expected one for all or {n}, got {len(words)}")
    for row, word in enumerate(words):
        with within(f"row {row}"):
            choice("flip", word, FLIPS)
    return words


def _scale_rows(scale: object, n: int) -> tuple[list[int], list[int]]:
    """Scales in x and y, in 1/65536; given are one number, (n,), pairs (n, 2) or (1, 2), or (2,) of one object."""
    values = array_of("scale", scale)
    if values.shape == (2,) and n == 1:
        values = values[None]
    elif values.ndim < 2:
        values = reals("scale", each("scale", values, n), (n,))[:, None]
    fits = values.ndim == 2 and values.shape[0] in (1, n) and values.shape[1] in (1, 2)
    pairs = reals("scale", np.broadcast_to(values, (n, 2)) if fits else values, (n, 2))
    whole = []
    for row, (x, y) in enumerate(pairs.tolist()):
        with within(f"row {row}"):
            whole.append(whole_scale(x, y))
    return [x for x, _ in whole], [y for _, y in whole]
