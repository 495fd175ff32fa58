"""Arguments of a pose, one for all objects or one for each, to what the columns hold."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, InputError, Ints, array_of, each, integers, reals
from planes.constants import POSITION_MAX, SCALE_BITS, SUB
from planes.items import Items
from planes.sprite import Form, form_of

__all__ = ["are_rows", "changed_forms", "one_place", "points", "scale_pair"]

ONE = 1 << SCALE_BITS
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
    old = [items.forms[item] for item in ids]
    angles = [items.angles[item] for item in ids]
    if angle is None and scale is None and flip is None and frame is None:
        return angles, None
    if angle is not None:
        angles = reals("angle", each("angle", angle, n), (n,)).tolist()
    scales = [[form.scale_x / ONE, form.scale_y / ONE] for form in old]
    if scale is not None:
        scales = _scale_rows(scale, n).tolist()
    frames = [form.frame for form in old]
    if frame is not None:
        frames = integers("frame", each("frame", frame, n), (n,), 0, 2**31).tolist()
    flips = [form.flip for form in old]
    if flip is not None:
        flips = each("flip", flip, n).tolist()
        if len(flips) != n:
            raise InputError(f"flip: expected one for all or {n}, got {len(flips)}")
    forms: list[Form] = []
    try:
        for item, number, side, (sx, sy), turn in zip(ids, frames, flips, scales, angles, strict=True):
            forms.append(form_of(items.sprites[item], number, side, (sx, sy), turn))
    except InputError as error:
        raise InputError(f"row {len(forms)}: {error}") from error
    return angles, forms


def _scale_rows(scale: object, n: int) -> Floats:
    """One number, one for each (n,), or pairs (n, 2) or (1, 2)."""
    values = array_of("scale", scale)
    if values.ndim < 2:
        values = each("scale", values, n)[:, None]
    fits = values.ndim == 2 and values.shape[0] in (1, n) and values.shape[1] in (1, 2)
    return reals("scale", np.broadcast_to(values, (n, 2)) if fits else values, (n, 2))
