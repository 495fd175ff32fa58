"""A scene as a player sees it: an RGB picture of a view, blended in whole numbers. It decides nothing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from planes.arrays import Image
from planes.constants import SCALE_BITS, SUB
from planes.grid256 import pixel
from planes.items import ROLES, Items, Role
from planes.spans import Box
from planes.sprite import picture_of

__all__ = ["blend", "draw_view"]

BARE = {
    Role.BACKGROUND: (58, 62, 70),
    Role.HITTABLE: (214, 190, 150),
    Role.MOVER: (150, 170, 150),
    Role.OCCLUDER: (104, 112, 124),
    Role.HUD: (230, 230, 230),
}
"""Colour of a mask or shape that brings none of its own."""

GROUND = (38, 41, 47)


def draw_view(items: Items, view_xyxy: Box, screen_xy: tuple[int, int] | None = None) -> Image:
    """Draw what lies in a view: background, then by layer, then the HUD.

    Parameters
    ----------
    view_xyxy : inclusive box of the world, px
    screen_xy : pixel of the world at the player's top left, from which the HUD is placed; by default the view's

    Returns
    -------
    (h, w, 3) bytes, RGB
    """
    x, y, x_max, y_max = view_xyxy
    screen_x, screen_y = (x, y) if screen_xy is None else screen_xy
    picture = np.empty((y_max - y + 1, x_max - x + 1, 3), np.uint8)
    picture[:] = GROUND
    for item in _back_to_front(items):
        if _beyond(items, item, view_xyxy):
            continue
        role = ROLES[int(items.role[item])]
        image, pivot_x, pivot_y = picture_of(items.sprites[item], items.forms[item], BARE[role])
        left, top = pixel(items.position_256[item] - (pivot_x, pivot_y)).tolist()
        if role is Role.HUD:
            left, top = left + screen_x, top + screen_y
        blend(picture, image[:, :, :3], image[:, :, 3], left - x, top - y)
    return picture


def blend(
    picture: Image, color: npt.NDArray[np.uint8] | tuple[int, int, int], alpha: Image, left: int, top: int
) -> None:
    """Lay a colour (h, w, 3), or one colour, over a picture with alpha (h, w), clipped; rounded to the nearest."""
    height, width = alpha.shape
    x0, y0, x1, y1 = max(left, 0), max(top, 0), min(left + width, picture.shape[1]), min(top + height, picture.shape[0])
    if x0 >= x1 or y0 >= y1:
        return
    part = (slice(y0 - top, y1 - top), slice(x0 - left, x1 - left))
    over = np.broadcast_to(np.asarray(color, np.uint32), (height, width, 3))[part]
    a = alpha[part].astype(np.uint32)[:, :, None]
    under = picture[y0:y1, x0:x1]
    under[:] = (under * (255 - a) + over * a + 127) // 255


def _beyond(items: Items, item: int, view_xyxy: Box) -> bool:
    """Whether an image surely lies out of view: farther from its pivot than all its sides and its scale allow."""
    sprite, form = items.sprites[item], items.forms[item]
    if not sprite.frames or ROLES[int(items.role[item])] is Role.HUD:
        return False
    height, width = sprite.frames[form.frame].mask.shape
    pivot = max(map(abs, sprite.pivot_256 or (0, 0))) // SUB
    reach = (height + width + 2 * pivot + 2) * (max(form.scale_x, form.scale_y, 1 << SCALE_BITS) >> SCALE_BITS) * 2
    x, y = pixel(items.position_256[item]).tolist()
    return not (view_xyxy[0] - reach <= x <= view_xyxy[2] + reach and view_xyxy[1] - reach <= y <= view_xyxy[3] + reach)


def _back_to_front(items: Items) -> list[int]:
    """Ids in the order of drawing: the stack from behind, with movers as objects; background first, HUD last."""
    ids = np.flatnonzero(items.alive[: items.count] == 1)
    role = items.role[ids]
    plane = np.select([role == ROLES.index(Role.BACKGROUND), role == ROLES.index(Role.HUD)], [0, 2], 1)
    order = np.lexsort((ids, role == ROLES.index(Role.OCCLUDER), items.layer[ids], plane))
    return [int(i) for i in ids[order]]
