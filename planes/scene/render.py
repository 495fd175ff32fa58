"""Rendering: a scene as an RGB picture, and whole planes by role in and out. Neither decides a hit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Image, InputError, bools, integers, within
from ..common.limits import ITEMS_MAX, PLANE_AREA_MAX, PLANE_SIDE_MAX, SCALE_BITS, SUB
from ..grid.fixed_point import pixel
from ..grid.spans import Box
from .items import Items
from .objects import ROLES, Role
from .sprite import Sprite, frame_pivot
from .variants import picture_of

BARE = {
    Role.BACKGROUND: (58, 62, 70),
    Role.HITTABLE: (214, 190, 150),
    Role.MOVER: (150, 170, 150),
    Role.OCCLUDER: (104, 112, 124),
    Role.HUD: (230, 230, 230),
}
"""Colour of a mask or shape without a colour of its own."""

GROUND = (38, 41, 47)


def draw_view(items: Items, view_xyxy: Box, screen_xy: tuple[int, int] | None = None) -> Image:
    """Draw a view of a scene, as (h, w, 3) bytes, RGB: the background, then the layers, then the HUD.

    The HUD begins at the world pixel at the top left of the player's screen, by default that of the view.
    """
    x, y, x_max, y_max = view_xyxy
    screen_x, screen_y = (x, y) if screen_xy is None else screen_xy
    picture = np.empty((y_max - y + 1, x_max - x + 1, 3), np.uint8)
    picture[:] = GROUND
    for row in _back_to_front(items):
        if _beyond(items, row, view_xyxy):
            continue
        role = ROLES[int(items.role[row])]
        image, pivot_x, pivot_y = picture_of(items.sprites[row], items.transforms[row], BARE[role])
        left, top = pixel(items.position_256[row] - (pivot_x, pivot_y)).tolist()
        if role is Role.HUD:
            left, top = left + screen_x, top + screen_y
        blend(picture, image[:, :, :3], image[:, :, 3], left - x, top - y)
    return picture


def blend(
    picture: Image, color: npt.NDArray[np.uint8] | tuple[int, int, int], alpha: Image, left: int, top: int
) -> None:
    """Blend an image (h, w, 3), or one colour, over a picture with alpha (h, w), clipped; rounded to the nearest."""
    height, width = alpha.shape
    x0, y0, x1, y1 = max(left, 0), max(top, 0), min(left + width, picture.shape[1]), min(top + height, picture.shape[0])
    if x0 >= x1 or y0 >= y1:
        return
    part = (slice(y0 - top, y1 - top), slice(x0 - left, x1 - left))
    over = np.broadcast_to(np.asarray(color, np.uint32), (height, width, 3))[part]
    a = alpha[part].astype(np.uint32)[:, :, None]
    under = picture[y0:y1, x0:x1]
    under[:] = (under * (255 - a) + over * a + 127) // 255


def _beyond(items: Items, row: int, view_xyxy: Box) -> bool:
    """Whether an image surely lies out of view: its pivot is farther away than its sides and scale can reach."""
    sprite, transform = items.sprites[row], items.transforms[row]
    if not sprite.frames or ROLES[int(items.role[row])] is Role.HUD:
        return False
    height, width = sprite.frames[transform.frame].mask.shape
    pivot = max(map(abs, frame_pivot(sprite, sprite.frames[transform.frame]))) // SUB
    scale = max(transform.scale_x, transform.scale_y, 1 << SCALE_BITS) >> SCALE_BITS
    reach = (height + width + 2 * pivot + 2) * scale * 2
    x, y = pixel(items.position_256[row]).tolist()
    return not (view_xyxy[0] - reach <= x <= view_xyxy[2] + reach and view_xyxy[1] - reach <= y <= view_xyxy[3] + reach)


def _back_to_front(items: Items) -> list[int]:
    """Rows in drawing order: the background, the stack from back to front with movers among its objects, the HUD."""
    rows, role = items.rows, items.role.take(items.rows)
    plane = np.select([role == ROLES.index(Role.BACKGROUND), role == ROLES.index(Role.HUD)], [0, 2], 1)
    order = np.lexsort((items.ids, role == ROLES.index(Role.OCCLUDER), items.layer[rows], plane))
    return [int(row) for row in rows[order]]


@dataclass(frozen=True)
class Planes:
    """Planes of a scene by role: id + 1 of the front object at each pixel (h, w), 0 for none."""

    origin_xy: tuple[int, int]
    background: npt.NDArray[np.int32]
    hittable: npt.NDArray[np.int32]
    movers: npt.NDArray[np.int32]
    occluders: npt.NDArray[np.int32]
    hud: npt.NDArray[np.int32]


def plane_size(field: str, array: npt.NDArray[Any]) -> tuple[int, int]:
    """Check the size and the number of masks of a plane, and return its width and height."""
    image = _is_image(array)
    if array.ndim not in (2, 3) or 0 in array.shape:
        expected = "a plane (h, w), masks (n, h, w) or an image (h, w, 3 or 4)"
        raise InputError(f"{field}: expected {expected}, got {array.shape}")
    height, width = array.shape[:2] if image else array.shape[-2:]
    if max(width, height) > PLANE_SIDE_MAX or width * height > PLANE_AREA_MAX:
        limit = f"sides up to {PLANE_SIDE_MAX} px and at most {PLANE_AREA_MAX} px in all"
        raise InputError(f"{field}: expected a plane of {limit}, got {width} x {height}")
    if array.ndim == 3 and not image:
        _check_count(field, len(array))
    return width, height


def plane_objects(field: str, role: str, array: npt.NDArray[Any]) -> list[tuple[str, Sprite, int, int]]:
    """Objects of a plane as (name, sprite with its pivot at the top left, x, y); `field` is for errors."""
    if _is_image(array):
        with within(field):
            return [(role, Sprite.from_image(array, pivot_xy=(0, 0)), 0, 0)]
    if array.ndim == 3:
        masks = bools(field, array, (None, None, None))
        return [_cropped(f"{field}[{i}]", f"{role} {i}", mask, 0, 0) for i, mask in enumerate(masks)]
    if array.dtype.kind == "b":
        return [_cropped(field, role, array, 0, 0)]
    labels = integers(field, array, (None, None), 0, 2**31 - 1)
    y, x = np.nonzero(labels)
    order = np.argsort(labels[y, x], kind="stable")
    y, x = y[order], x[order]
    names, first = np.unique(labels[y, x], return_index=True)
    if not len(names):
        return []
    _check_count(field, len(names))
    low = [np.minimum.reduceat(v, first).tolist() for v in (x, y)]
    high = [np.maximum.reduceat(v, first).tolist() for v in (x, y)]
    return [
        _cropped(f"{field}: label {name}", str(name), labels[y0 : y1 + 1, x0 : x1 + 1] == name, x0, y0)
        for name, x0, y0, x1, y1 in zip(names.tolist(), *low, *high, strict=True)
    ]


def _check_count(field: str, count: int) -> None:
    if count > ITEMS_MAX:
        raise InputError(f"{field}: expected at most {ITEMS_MAX} objects, got {count}")


def _cropped(place: str, name: str, mask: Bools, x: int, y: int) -> tuple[str, Sprite, int, int]:
    with within(place):
        return name, Sprite.from_mask(mask, pivot_xy=(0, 0)), x, y


def _is_image(array: npt.NDArray[Any]) -> bool:
    return array.ndim == 3 and array.dtype == np.uint8 and array.shape[2] in (3, 4)
