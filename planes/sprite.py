"""Images and shapes to masks: frames, and the masks that they have in each form; see `forms`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from planes import turning
from planes.arrays import (
    Bools,
    Image,
    InputError,
    Ints,
    array_of,
    bools,
    choice,
    integer,
    integers,
    listed,
    real,
    reals,
    shown,
)
from planes.constants import (
    ALPHA_THRESHOLD,
    FRAMES_MAX,
    HALF,
    MASK_SIDE_MAX,
    SUB,
    TRIG_BITS,
    VARIANT_BYTES,
    VARIANT_CACHE_BYTES,
)
from planes.forms import FLIPS, ONE, Form, check_size, flipped, mapped, whole_scale
from planes.grid256 import quarter_turns, rounded_div, snap, turned
from planes.kept import Kept
from planes.rasterise import ellipse, polygon
from planes.spans import Spans
from planes.twins import kernels_of

__all__ = ["Sprite", "Variant", "as_sprite", "form_of", "frame_pivot", "picture_of", "rows_of", "variant_of"]


@dataclass(frozen=True)
class Frame:
    """One picture of a sprite: mask (h, w) and, where there is one, the image (h, w, 4) that it came from."""

    mask: Bools
    image: Image | None = None


@dataclass(frozen=True)
class Outline:
    """A shape in 1/256 px about its position: rings of points, or the two semi-axes of a circle."""

    rings: tuple[Ints, ...] = ()
    radius: int | None = None


@dataclass(frozen=True, eq=False)
class Variant:
    """A mask as it is tested: cropped, read-only, with its pivot in 1/256 px from the centre of pixel [0, 0]."""

    key: tuple[int, Form]
    mask: Bools
    pivot_x: int
    pivot_y: int
    area: int
    uid: int = field(default_factory=itertools.count().__next__)


@dataclass(frozen=True, eq=False)
class Sprite:
    """What an object looks like and where it can be hit: frames of image and mask, or one shape.

    Made by the class methods; `source` is what a scene file says of it, as JSON, or None.
    """

    frames: tuple[Frame, ...]
    pivot_256: tuple[int, int] | None = None
    outline: Outline | None = None
    color: tuple[int, int, int] | None = None
    source: dict[str, Any] | None = None
    uid: int = field(default_factory=itertools.count().__next__)

    @classmethod
    def from_image(
        cls,
        image: object,
        *,
        alpha_threshold: int = ALPHA_THRESHOLD,
        color_key: Sequence[int] | None = None,
        grid_wh: Sequence[int] | None = None,
        rects_xywh: Sequence[Sequence[int]] | None = None,
        pivot_xy: Sequence[float] | None = None,
        source: dict[str, Any] | None = None,
    ) -> Sprite:
        """Cut an image into frames and their masks.

        Parameters
        ----------
        image : (h, w, 3) RGB or (h, w, 4) RGBA, bytes
        alpha_threshold : a pixel is in the mask when its alpha is greater
        color_key : RGB of the pixels that are transparent
        grid_wh : size of a frame; frames run left to right, then top to bottom
        rects_xywh : (n, 4) frames as rectangles
        pivot_xy : where a frame is held, px; by default its centre ((w-1)/2, (h-1)/2)

        Raises
        ------
        InputError
            Naming the field: not bytes, not an image, frames that leave it, a sheet that the grid does not divide.
        """
        if source is not None and not isinstance(source, dict):
            raise InputError(f"source: expected an object, got {shown(source)}")
        rgba = _as_rgba(image)
        threshold = integer("alpha_threshold", alpha_threshold, 0, 255)
        mask = rgba[:, :, 3] > threshold
        if color_key is not None:
            key = integers("color_key", color_key, (3,), 0, 255)
            mask &= (rgba[:, :, :3] != key).any(axis=2)
            rgba[:, :, 3] = np.where(mask, rgba[:, :, 3], 0)
        rects = _frame_rects(rgba.shape[1], rgba.shape[0], grid_wh, rects_xywh)
        frames = tuple(
            Frame(_frozen(mask[y : y + h, x : x + w]), _frozen(rgba[y : y + h, x : x + w])) for x, y, w, h in rects
        )
        return cls(frames, _pivot(pivot_xy), source={"alpha_threshold": threshold} | (source or {}))

    @classmethod
    def from_mask(
        cls,
        mask: object,
        *,
        pivot_xy: Sequence[float] | None = None,
        color: Sequence[int] | None = None,
        source: dict[str, Any] | None = None,
    ) -> Sprite:
        """Take a boolean array (h, w) as the mask of one frame."""
        given = array_of("mask", mask)
        if given.ndim == 2:
            check_size("mask", given.shape[1], given.shape[0])
        checked = bools("mask", given, (None, None))
        return cls((Frame(_frozen(checked)),), _pivot(pivot_xy), color=_color(color), source=source)

    @classmethod
    def polygon(cls, points_xy: object, holes: Sequence[object] = (), *, color: Sequence[int] | None = None) -> Sprite:
        """Shape of points (n, 2) in px about the position; holes by the even-odd rule; edges belong to it."""
        others = enumerate(listed("holes", holes, "a list of rings"))
        given = [("polygon", points_xy), *((f"holes[{i}]", hole) for i, hole in others)]
        rings = []
        for name, points in given:
            checked = reals(name, points, (None, 2), MASK_SIDE_MAX)
            if len(checked) < 3:
                raise InputError(f"{name}: expected 3 points or more, got {len(checked)}")
            rings.append(snap(checked))
        source: dict[str, Any] = {"polygon": (rings[0] / SUB).tolist()}
        if len(rings) > 1:
            source["holes"] = [(r / SUB).tolist() for r in rings[1:]]
        return cls((), (0, 0), Outline(tuple(rings)), _color(color), source)

    @classmethod
    def circle(cls, radius: float, *, color: Sequence[int] | None = None) -> Sprite:
        """Shape of the centres at most `radius` px from the position; scaled by (sx, sy) it is an ellipse."""
        r = int(snap(real("circle", radius, 0, MASK_SIDE_MAX)))
        return cls((), (0, 0), Outline(radius=r), _color(color), {"circle": r / SUB})

    @classmethod
    def box(cls, width: float, height: float, *, color: Sequence[int] | None = None) -> Sprite:
        """Closed rectangle of `width` x `height` px centred on the position."""
        w, h = (real(f"box_wh[{i}]", v, 0, MASK_SIDE_MAX) / 2 for i, v in enumerate((width, height)))
        shape = cls.polygon([(-w, -h), (w, -h), (w, h), (-w, h)], color=color)
        return cls((), (0, 0), shape.outline, shape.color, {"box_wh": [float(width), float(height)]})

    @property
    def frame_count(self) -> int:
        """Frames of the sprite; a shape has one."""
        return max(len(self.frames), 1)


def as_sprite(value: object) -> Sprite:
    """Take a Sprite, a boolean array (h, w) or an image (h, w, 3 or 4): whatever `numpy.asarray` takes."""
    if isinstance(value, Sprite):
        if not value.outline and not value.frames:
            raise InputError("sprite: expected one that a class method made, got one without a mask")
        return value
    array = array_of("sprite", value)
    if array.ndim == 2:
        return Sprite.from_mask(array)
    if array.ndim == 3:
        return Sprite.from_image(array)
    got = array.shape if array.ndim else type(value).__name__
    raise InputError(f"sprite: expected a Sprite, a mask (h, w) or an image (h, w, 3 or 4), got {got}")


def form_of(sprite: Sprite, frame: object, flip: object, scale_xy: tuple[float, float], angle: float) -> Form:
    """Check a pose and reduce it to what changes the mask."""
    number = integer("frame", frame, 0, sprite.frame_count - 1)
    x, y = whole_scale(*scale_xy)
    return Form(number, choice("flip", flip, FLIPS), x, y, *quarter_turns(angle))


_kept: Kept[tuple[int, Form], Variant] = Kept(VARIANT_CACHE_BYTES, lambda variant: variant.mask.nbytes + VARIANT_BYTES)


def variant_of(sprite: Sprite, form: Form) -> Variant:
    """Mask of a sprite in a form; the last ones asked for are kept, up to a number of bytes."""
    return _kept.get((sprite.uid, form), lambda: _make_variant(sprite, form))


def picture_of(sprite: Sprite, form: Form, color: tuple[int, int, int]) -> tuple[Image, int, int]:
    """Image (h, w, 4) of a sprite in a form, and its pivot (x, y) in 1/256 px; a bare mask is filled with `color`."""
    frame = sprite.frames[form.frame] if sprite.frames else None
    if frame is None or frame.image is None:
        variant = variant_of(sprite, form)
        image = np.zeros((*variant.mask.shape, 4), np.uint8)
        image[variant.mask] = (*(sprite.color or color), 255)
        return image, variant.pivot_x, variant.pivot_y
    source, _, pivot_x, pivot_y = mapped(frame.mask, frame_pivot(sprite, frame), form)
    image = flipped(frame.image, form.flip).reshape(-1, 4)[np.maximum(source, 0)]
    image[source < 0] = 0
    return image, pivot_x, pivot_y


def rows_of(mask: Bools) -> list[str]:
    """A mask as rows of '#' and '.', as scene files have it."""
    return ["".join("#" if v else "." for v in row) for row in mask.tolist()]


def _make_variant(sprite: Sprite, form: Form) -> Variant:
    if sprite.outline is not None:
        mask, (x, y) = _shape_spans(sprite.outline, form).to_mask()
        pivot_x, pivot_y = -SUB * x, -SUB * y
    else:
        frame = sprite.frames[form.frame]
        _, mask, pivot_x, pivot_y = mapped(frame.mask, frame_pivot(sprite, frame), form)
    (x, y, x_max, y_max), area = kernels_of(turning).sides_of(mask)
    if not area:
        return Variant((sprite.uid, form), np.zeros((0, 0), np.bool_), 0, 0, 0)
    cropped = _frozen(mask[y : y_max + 1, x : x_max + 1])
    return Variant((sprite.uid, form), cropped, pivot_x - SUB * x, pivot_y - SUB * y, area)


def _shape_spans(outline: Outline, form: Form) -> Spans:
    """A shape's points flipped, scaled and turned, then filled."""
    c, s = form.c, form.s
    for _ in range(form.quarter):
        c, s = -s, c
    if outline.radius is not None:
        a, b = (int(rounded_div(np.array(outline.radius * v), ONE)) for v in (form.scale_x, form.scale_y))
        half = (math.isqrt((a * c) ** 2 + (b * s) ** 2), math.isqrt((a * s) ** 2 + (b * c) ** 2))
        check_size("scale", *(2 * v // (SUB << TRIG_BITS) + 1 for v in half))
        return ellipse(a, b, c, s)
    sign = np.array([-1 if "x" in form.flip else 1, -1 if form.flip in ("y", "xy") else 1])
    scale = np.array([form.scale_x, form.scale_y])
    rings = [turned(rounded_div(r * sign * scale, ONE), c, s) for r in outline.rings]
    every = np.concatenate(rings)
    check_size("scale", *(int(v) // SUB + 1 for v in every.max(axis=0) - every.min(axis=0)))
    return polygon(rings)


def frame_pivot(sprite: Sprite, frame: Frame) -> tuple[int, int]:
    """Where a frame is held, in 1/256 px from the centre of its pixel [0, 0]."""
    h, w = frame.mask.shape
    return sprite.pivot_256 or ((w - 1) * HALF, (h - 1) * HALF)


def _pivot(pivot_xy: Sequence[float] | None) -> tuple[int, int] | None:
    if pivot_xy is None:
        return None
    x, y = snap(reals("pivot_xy", pivot_xy, (2,), MASK_SIDE_MAX)).tolist()
    return x, y


def _color(color: Sequence[int] | None) -> tuple[int, int, int] | None:
    if color is None:
        return None
    red, green, blue = integers("color", color, (3,), 0, 255).tolist()
    return red, green, blue


def _as_rgba(image: object) -> Image:
    array = array_of("image", image)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] not in (3, 4):
        raise InputError(f"image: expected bytes of shape (h, w, 3 or 4), got {array.dtype} {array.shape}")
    check_size("image", array.shape[1], array.shape[0])
    if array.shape[2] == 4:
        return array.copy()
    return np.dstack([array, np.full(array.shape[:2], 255, np.uint8)])


def _frame_rects(
    width: int, height: int, grid_wh: Sequence[int] | None, rects_xywh: Sequence[Sequence[int]] | None
) -> list[list[int]]:
    if grid_wh is not None and rects_xywh is not None:
        raise InputError("frames: expected grid_wh or rects_xywh, got both")
    if rects_xywh is not None:
        rects = integers("rects_xywh", rects_xywh, (None, 4), 0, MASK_SIDE_MAX)
        if not 1 <= len(rects) <= FRAMES_MAX:
            raise InputError(f"rects_xywh: expected 1 to {FRAMES_MAX} rectangles, got {len(rects) or 'none'}")
        for i, (x, y, w, h) in enumerate(rects.tolist()):
            if w < 1 or h < 1 or x + w > width or y + h > height:
                got = [x, y, w, h]
                raise InputError(f"rects_xywh[{i}]: expected to lie in the image of {width} x {height}, got {got}")
        return [list(r) for r in rects.tolist()]
    if grid_wh is None:
        return [[0, 0, width, height]]
    w, h = integers("grid_wh", grid_wh, (2,), 1, MASK_SIDE_MAX).tolist()
    if width % w or height % h:
        raise InputError(f"grid_wh: expected to divide the image of {width} x {height}, got {[w, h]}")
    if (width // w) * (height // h) > FRAMES_MAX:
        raise InputError(f"grid_wh: expected at most {FRAMES_MAX} frames, got {[w, h]} in {width} x {height}")
    return [[x, y, w, h] for y in range(0, height, h) for x in range(0, width, w)]


def _frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    out = np.array(array, order="C")
    out.flags.writeable = False
    return out
