"""Whole planes: labels, masks and images of one size to sprites and where they lie; and planes of a scene, by role."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, InputError, bools, integers, within
from planes.constants import ITEMS_MAX, PLANE_AREA_MAX, PLANE_SIDE_MAX
from planes.sprite import Sprite

__all__ = ["Planes", "plane_objects", "plane_size"]


@dataclass(frozen=True)
class Planes:
    """Whole planes of a scene, one for each role: front-most id + 1 at each pixel (h, w), 0 where there is none."""

    origin_xy: tuple[int, int]
    background: npt.NDArray[np.int32]
    hittable: npt.NDArray[np.int32]
    movers: npt.NDArray[np.int32]
    occluders: npt.NDArray[np.int32]
    hud: npt.NDArray[np.int32]


def plane_size(field: str, array: npt.NDArray[Any]) -> tuple[int, int]:
    """Width and height of a plane that is not too large, nor has too many masks."""
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
    """Objects of a plane: name, sprite held at its top left, and where that is; `field` is for errors."""
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
