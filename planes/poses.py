"""Arguments of a pose, one for all objects or one for each, to what the columns hold."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from planes.arrays import Floats, InputError, Ints, array_of, choice, each, integer, integers, reals, within
from planes.constants import POSITION_MAX, SUB
from planes.forms import FLIPS, Form, whole_scale
from planes.grid256 import quarter_turns
from planes.items import Items

__all__ = ["are_rows", "changed_forms", "one_place", "points", "scale_pair"]

NUMBERS = frozenset((int, float, np.float64))
FLOAT64 = np.dtype(np.float64)


def points(field: str, values: object, n: int, limit: float = POSITION_MAX) -> Floats:
    """Positions or velocities (n, 2), or one (2,) for all, px."""
    if array_of(field, values).shape == (2,):
        return np.broadcast_to(reals(field, values, (2,), limit), (n, 2))
    return reals(field, values, (n, 2), limit)


def are_rows(ids: object, xy: object) -> bool:
    """Whether these are plain arrays of ids (n,) and of positions (n, 2), each in one piece."""
    if type(ids) is not np.ndarray or type(xy) is not np.ndarray or ids.dtype != np.int64 or xy.dtype != np.float64:
        return False
    return ids.ndim == 1 and xy.shape == (len(ids), 2) and ids.flags.c_contiguous and xy.flags.c_contiguous


def one_place(xy: object) -> tuple[int, int] | None:
    """One position in range on the 1/256-px grid, rounded as `snap` does; None of anything else, bad or good."""
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


def scale_pair(scale: object) -> tuple[float, float]:
    """One number, or (sx, sy)."""
    values = array_of("scale", scale)
    sx, sy = reals("scale", values if values.ndim else np.stack([values, values]), (2,)).tolist()
    return sx, sy


def changed_forms(
    items: Items, rows: Ints, angle: object, scale: object, flip: object, frame: object
) -> tuple[list[float], list[Form] | None]:
    """Angles and forms of objects after a change; no forms if nothing of them changes."""
    n, ids = len(rows), rows.tolist()
    angles = [items.angles[item] for item in ids]
    if angle is None and scale is None and flip is None and frame is None:
        return angles, None
    columns: Iterable[Any] = zip(*(items.forms[item] for item in ids), strict=True) if n else ((),) * len(Form())
    frames, flips, x, y, *turns = columns
    if angle is not None:
        angles = reals("angle", each("angle", angle, n), (n,)).tolist()
        turns = list(zip(*map(quarter_turns, angles), strict=True))
    if scale is not None:
        x, y = _scale_rows(scale, n)
    if frame is not None:
        frames = _frame_rows(frame, [items.sprites[item].frame_count for item in ids])
    if flip is not None:
        flips = _flip_rows(flip, n)
    return angles, list(map(Form, frames, flips, x, y, *turns))


def _frame_rows(frame: object, counts: list[int]) -> list[int]:
    """One number, or one for each (n,) of objects whose sprites have so many frames."""
    n = len(counts)
    numbers: list[int] = integers("frame", each("frame", frame, n), (n,), 0, 2**31).tolist()
    for row, (number, count) in enumerate(zip(numbers, counts, strict=True)):
        if number >= count:
            with within(f"row {row}"):
                integer("frame", number, 0, count - 1)
    return numbers


def _flip_rows(flip: object, n: int) -> list[str]:
    """One word, or one for each (n,)."""
    words: list[str] = each("flip", flip, n).tolist()
    if len(words) != n:
        raise InputError(f"flip: expected one for all or {n}, got {len(words)}")
    for row, word in enumerate(words):
        with within(f"row {row}"):
            choice("flip", word, FLIPS)
    return words


def _scale_rows(scale: object, n: int) -> tuple[list[int], list[int]]:
    """Scales in x and y, in 1/65536, of one number, one for each (n,), or pairs (n, 2) or (1, 2)."""
    values = array_of("scale", scale)
    if values.ndim < 2:
        values = each("scale", values, n)[:, None]
    fits = values.ndim == 2 and values.shape[0] in (1, n) and values.shape[1] in (1, 2)
    pairs = reals("scale", np.broadcast_to(values, (n, 2)) if fits else values, (n, 2))
    whole = []
    for row, (x, y) in enumerate(pairs.tolist()):
        with within(f"row {row}"):
            whole.append(whole_scale(x, y))
    return [x for x, _ in whole], [y for _, y in whole]
