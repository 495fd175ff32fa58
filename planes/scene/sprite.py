"""Sprites: frames cut from images or made of shapes, and their masks flipped, scaled and turned in integers.

A turn of 90 k + r degrees turns the array exactly k times, and then maps it inversely by r. A pixel of the result is
set if its centre, mapped back, lies in a closed square of a set pixel. So a mirrored sprite turns into the mirror
image, unless the rounded direction is an odd multiple of 45 degrees and only one of width and height is odd: there the
quarter turn decides. Picture and mask go through the same map: what is drawn is what is tested.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.backend import LruCache, kernels_of
from ..common.checks import (
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
    within,
)
from ..common.limits import (
    ALPHA_THRESHOLD,
    FRAMES_MAX,
    HALF,
    MASK_AREA_MAX,
    MASK_SIDE_MAX,
    SCALE_BITS,
    SCALE_MAX,
    SCALE_MIN,
    SUB,
    TRIG_BITS,
    VARIANT_BYTES,
    VARIANT_CACHE_BYTES,
)
from ..common.tables import inside
from ..grid.fixed_point import over_one, quarter_turns, rounded_div, snap, turned
from ..grid.rasterize import ellipse, polygon
from ..grid.spans import Box, Spans


def resample(
    inside: Bools, size_wh: tuple[int, int], first: tuple[int, int], step: tuple[int, int], unit: tuple[int, int]
) -> tuple[Ints, Bools]:
    """Map each pixel centre of a result back to a pixel of a frame whose closed square holds it, a set one if possible.

    Parameters
    ----------
    inside : (h, w) mask of the frame, contiguous
    size_wh : size of the result
    first : column and row of the frame at the first centre of the result, in parts
    step : (cos, sin) in parts: a step right adds cos to the column and -sin to the row, a step down sin and cos
    unit : number of parts of a column, and of a row

    Returns
    -------
    (height, width) flat index of the frame's pixel, -1 for none; and whether that pixel is set
    """
    (h, w), (width, height) = inside.shape, size_wh
    across, down = np.arange(width), np.arange(height)[:, None]
    columns = _squares(first[0] + across * step[0] + down * step[1], unit[0])
    rows = _squares(first[1] + down * step[0] - across * step[1], unit[1])
    found, held = np.full(height * width, -1), np.zeros(height * width, np.bool_)
    for row, column in product(rows, columns):
        valid = (row >= 0) & (row < h) & (column >= 0) & (column < w)
        pixels = np.flatnonzero(valid.ravel() & ~held)
        source = row.take(pixels) * w + column.take(pixels)
        found[pixels], held[pixels] = source, inside.take(source)
    return found.reshape(height, width), held.reshape(height, width)


def _squares(place: Ints, unit: int) -> list[Ints]:
    """Columns (or rows) of the closed squares that hold coordinates; two of them for a coordinate on a border."""
    column = place // unit
    border = place == column * unit
    return [column, column - border] if border.any() else [column]


def sides_of(mask: Bools) -> tuple[Box, int]:
    """Inclusive box around the set pixels of a mask (h, w), and their number; without pixels x_max < x_min."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return (0, 0, -1, -1), 0
    return (int(columns[0]), int(rows[0]), int(columns[-1]), int(rows[-1])), int(np.count_nonzero(mask))


FLIPS = ("none", "x", "y", "xy")
ONE = 1 << SCALE_BITS

FINE_BITS = TRIG_BITS - SCALE_BITS
"""Bits by which a turned position is finer than a scaled one."""


class Transform(NamedTuple):
    """The part of a pose that changes a mask, in integers: frame, flip, scale in 1/65536, quarter turns and a rest."""

    frame: int = 0
    flip: str = "none"
    scale_x: int = ONE
    scale_y: int = ONE
    quarter: int = 0
    c: int = 1 << TRIG_BITS
    s: int = 0

    @property
    def plain(self) -> bool:
        """Whether it has only flips and quarter turns, so that no inverse mapping is needed."""
        return self.scaled == self.s == 0

    @property
    def scaled(self) -> bool:
        """Whether its scale is not 1."""
        return self.scale_x != ONE or self.scale_y != ONE


def whole_scale(x: float, y: float) -> tuple[int, int]:
    """Check a scale and round it to 1/65536."""
    x, y = real("scale[0]", x, SCALE_MIN, SCALE_MAX), real("scale[1]", y, SCALE_MIN, SCALE_MAX)
    return round(x * ONE), round(y * ONE)


def mapped(mask: Bools, pivot_256: tuple[int, int], form: Transform) -> tuple[Ints, Bools, int, int]:
    """Flip, scale and turn a frame.

    Returns
    -------
    for each pixel of the result the flat index of its source pixel in the flipped frame, -1 for none; whether that is
    set; and the pivot (x, y)
    """
    h, w = mask.shape
    x, y = pivot_256
    held = flipped(mask, form.flip)
    source = np.arange(h * w).reshape(h, w)
    if "x" in form.flip:
        x = SUB * (w - 1) - x
    if form.flip in ("y", "xy"):
        y = SUB * (h - 1) - y
    if not form.plain and mask.size:
        source, held, x, y = _inverse_mapped(held, x, y, form)
    for _ in range(form.quarter):
        source, held, x, y = source.T[:, ::-1], held.T[:, ::-1], SUB * (held.shape[0] - 1) - y, x
    return source, held, x, y


def flipped(array: npt.NDArray[Any], flip: str) -> npt.NDArray[Any]:
    """A flipped array (h, w, ...), contiguous."""
    return np.ascontiguousarray(array[:: -1 if flip in ("y", "xy") else 1, :: -1 if "x" in flip else 1])


def _inverse_mapped(inside: Bools, x: int, y: int, form: Transform) -> tuple[Ints, Bools, int, int]:
    """Scale and turn by r: map each centre of the result back to the squares of the frame that hold it.

    A centre at (dx, dy) from the pivot lies at (dx c + dy s, dy c - dx s) from it on the frame, in 2**-38 px of the
    result. Dividing by the scale and counting from the border of pixel [0, 0] gives column and row.
    """
    h, w = inside.shape
    (left, top), size_wh = _result_grid((w, h), (x, y), form)
    c, s = form.c, form.s
    column = (x + HALF) * (form.scale_x << FINE_BITS) - left * c - top * s
    row = (y + HALF) * (form.scale_y << FINE_BITS) - top * c + left * s
    unit = (SUB * form.scale_x << FINE_BITS, SUB * form.scale_y << FINE_BITS)
    kernel = kernels_of(sys.modules[__name__]).resample
    source, held = kernel(inside, size_wh, (column, row), (SUB * c, SUB * s), unit)
    return source, held, left, top


def _result_grid(
    size_wh: tuple[int, int], pivot: tuple[int, int], form: Transform
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Pivot and size of a grid that holds the scaled and turned frame.

    The pivot keeps its offset from the pixel grid. If the frame is scaled, its edges decide the offset, to half a
    pixel: whole scales repeat pixels exactly, and a mirrored frame lies on the mirrored grid.
    """
    edges, places = [], []
    for size, v, scale in zip(size_wh, pivot, (form.scale_x, form.scale_y), strict=True):
        edges.append([(e - v) * scale // ONE + up for e, up in ((-HALF, 0), (SUB * size - HALF, 1))])
        if scale == ONE:
            places.append(v % SUB)
        else:
            halves = rounded_div(np.array((v + HALF) * scale - HALF * ONE), HALF * ONE)
            places.append(int(halves) * HALF % SUB)
    c, s = form.c, form.s
    across = [over_one(x * c - y * s) for x in edges[0] for y in edges[1]]
    down = [over_one(x * s + y * c) for x in edges[0] for y in edges[1]]
    low, high = (min(across) - 1, min(down) - 1), (max(across) + 1, max(down) + 1)
    x, y = (place - SUB * ((edge + place) // SUB) for place, edge in zip(places, low, strict=True))
    width, height = (high[0] + x) // SUB + 1, (high[1] + y) // SUB + 1
    check_size("scale" if form.scaled else "angle", width, height)
    return (x, y), (width, height)


def fits(width: int, height: int) -> bool:
    """Whether a mask may have this size, px."""
    return min(width, height) >= 1 and max(width, height) <= MASK_SIDE_MAX and width * height <= MASK_AREA_MAX


def check_size(name: str, width: int, height: int) -> None:
    """Check the size of a mask, px."""
    if not fits(width, height):
        limit = f"a mask of sides up to {MASK_SIDE_MAX} px and {MASK_AREA_MAX} px in all, not empty"
        raise InputError(f"{name}: expected {limit}, got {width} x {height}")


_uids = itertools.count()


class Known:
    """An object with a number `uid` that is unique in this process; a copy, even an unpickled one, gets its own."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Copy the fields, but take a new number: the old one may be in use in this process."""
        vars(self).update(state)
        vars(self)["uid"] = next(_uids)


@dataclass(frozen=True)
class Frame:
    """A frame of a sprite: the mask (h, w), and the image (h, w, 4) that it was made of, if any."""

    mask: Bools
    image: Image | None = None

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Copy the arrays, and make them read-only again."""
        vars(self).update(state)
        for array in (self.mask, self.image):
            if array is not None:
                array.flags.writeable = False


@dataclass(frozen=True)
class Outline:
    """A shape in 1/256 px relative to its position: rings of points, or the radius of a circle."""

    rings: tuple[Ints, ...] = ()
    radius: int | None = None


@dataclass(frozen=True, eq=False)
class Variant(Known):
    """The mask of a sprite in one pose, cropped and read-only, with its pivot in 1/256 px from the centre of [0, 0]."""

    form: Transform
    mask: Bools
    pivot_x: int
    pivot_y: int
    area: int
    uid: int = field(default_factory=_uids.__next__, init=False)


@dataclass(frozen=True, eq=False)
class Sprite(Known):
    """The look and the mask of an object: frames of image and mask, or one shape. The class methods make sprites.

    `source` is its entry in a scene file, as JSON, or None.
    """

    frames: tuple[Frame, ...]
    pivot_256: tuple[int, int] | None = None
    outline: Outline | None = None
    color: tuple[int, int, int] | None = None
    source: dict[str, Any] | None = None
    uid: int = field(default_factory=_uids.__next__, init=False)

    def __post_init__(self) -> None:
        """Refuse what is no frames, such as the array of a mask."""
        if not (isinstance(self.frames, tuple) and all(isinstance(frame, Frame) for frame in self.frames)):
            how = "Sprite.from_mask and Sprite.from_image make sprites of arrays"
            raise InputError(f"frames: expected a tuple of frames, got {shown(self.frames)}: {how}")

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
        alpha_threshold : a pixel is in the mask if its alpha is greater
        color_key : RGB of transparent pixels
        grid_wh : size of a frame; frames run left to right, then top to bottom
        rects_xywh : (n, 4) frames as rectangles
        pivot_xy : point of a frame that is put at the object's position, px; by default its centre ((w-1)/2, (h-1)/2)

        Raises
        ------
        InputError
            If the image is not such an array, frames leave it, or the grid does not divide it.
        """
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
        return cls(frames, _pivot(pivot_xy), source=(_source(source) or {}) | {"alpha_threshold": threshold})

    @classmethod
    def from_mask(
        cls,
        mask: object,
        *,
        pivot_xy: Sequence[float] | None = None,
        color: Sequence[int] | None = None,
        source: dict[str, Any] | None = None,
    ) -> Sprite:
        """Take a boolean array (h, w) as the mask of one frame.

        Parameters
        ----------
        mask : (h, w) booleans
        pivot_xy : where it is held, px; by default its centre ((w-1)/2, (h-1)/2)
        color : RGB in which pictures fill it
        source : what a scene file says of it, as JSON
        """
        given = array_of("mask", mask)
        if given.ndim == 2:
            check_size("mask", given.shape[1], given.shape[0])
        checked = bools("mask", given, (None, None))
        return cls((Frame(_frozen(checked)),), _pivot(pivot_xy), color=_color(color), source=_source(source))

    @classmethod
    def polygon(cls, points_xy: object, holes: Sequence[object] = (), *, color: Sequence[int] | None = None) -> Sprite:
        """Shape of points about the position; edges belong to it.

        Parameters
        ----------
        points_xy : (n, 2) px, 3 points or more
        holes : more rings of points, by the even-odd rule
        color : RGB in which pictures fill it
        """
        others = enumerate(listed("holes", holes, "a list of rings"))
        given = [("points_xy", points_xy), *((f"holes[{i}]", hole) for i, hole in others)]
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
        """Shape of the centres at most `radius` px from the position; scaled by (sx, sy) it is an ellipse.

        `color` is the RGB in which pictures fill it.
        """
        r = int(snap(real("radius", radius, 0, MASK_SIDE_MAX)))
        return cls((), (0, 0), Outline(radius=r), _color(color), {"circle": r / SUB})

    @classmethod
    def box(cls, width: float, height: float, *, color: Sequence[int] | None = None) -> Sprite:
        """Closed rectangle of `width` x `height` px centred on the position.

        `color` is the RGB in which pictures fill it.
        """
        w, h = (real(name, v, 0, MASK_SIDE_MAX) / 2 for name, v in (("width", width), ("height", height)))
        shape = cls.polygon([(-w, -h), (w, -h), (w, h), (-w, h)], color=color)
        return cls((), (0, 0), shape.outline, shape.color, {"box_wh": [float(width), float(height)]})

    @property
    def frame_count(self) -> int:
        """Number of frames; a shape has one."""
        return max(len(self.frames), 1)


def as_sprite(value: object) -> Sprite:
    """Return a Sprite as it is, or make one of a mask (h, w) or an image (h, w, 3 or 4)."""
    if isinstance(value, Sprite):
        if not value.outline and not value.frames:
            raise InputError("sprite: expected one that a class method made, got one without a mask")
        return value
    array = array_of("sprite", value)
    with within("sprite"):
        if array.ndim == 2:
            return Sprite.from_mask(array)
        if array.ndim == 3:
            return Sprite.from_image(array)
    got = array.shape if array.ndim else type(value).__name__
    raise InputError(f"sprite: expected a Sprite, a mask (h, w) or an image (h, w, 3 or 4), got {got}")


def transform_of(sprite: Sprite, frame: object, flip: object, scale_xy: tuple[float, float], angle: float) -> Transform:
    """Check a pose and reduce it to its Transform."""
    number = integer("frame", frame, 0, sprite.frame_count - 1)
    x, y = whole_scale(*scale_xy)
    return Transform(number, choice("flip", flip, FLIPS), x, y, *quarter_turns(angle))


_kept: LruCache[tuple[int, Transform], Variant] = LruCache(
    VARIANT_CACHE_BYTES, lambda variant: variant.mask.nbytes + VARIANT_BYTES
)


def variant_of(sprite: Sprite, form: Transform) -> Variant:
    """Mask of a transformed sprite; the last used masks are cached."""
    return _kept.get((sprite.uid, form), lambda: _make_variant(sprite, form))


def picture_of(sprite: Sprite, form: Transform, color: tuple[int, int, int]) -> tuple[Image, int, int]:
    """Image (h, w, 4) of a transformed sprite, and its pivot (x, y) in 1/256 px; a mask is filled with `color`."""
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
    """A mask as rows of '#' and '.', the form of scene files."""
    return ["".join("#" if v else "." for v in row) for row in mask.tolist()]


def _make_variant(sprite: Sprite, form: Transform) -> Variant:
    if sprite.outline is not None:
        field = next(iter(sprite.source or {}), "sprite")
        mask, (x, y) = _shape_spans(field, sprite.outline, form).to_mask()
        pivot_x, pivot_y = -SUB * x, -SUB * y
    else:
        frame = sprite.frames[form.frame]
        _, mask, pivot_x, pivot_y = mapped(frame.mask, frame_pivot(sprite, frame), form)
    (x, y, x_max, y_max), area = kernels_of(sys.modules[__name__]).sides_of(mask)
    if not area:
        return Variant(form, np.zeros((0, 0), np.bool_), 0, 0, 0)
    cropped = _frozen(mask[y : y_max + 1, x : x_max + 1])
    return Variant(form, cropped, pivot_x - SUB * x, pivot_y - SUB * y, area)


def _shape_spans(field: str, outline: Outline, form: Transform) -> Spans:
    """Flip, scale and turn the points of a shape, then fill it; `field` is for errors."""
    c, s = form.c, form.s
    for _ in range(form.quarter):
        c, s = -s, c
    if outline.radius is not None:
        a, b = (int(rounded_div(np.array(outline.radius * v), ONE)) for v in (form.scale_x, form.scale_y))
        half = (math.isqrt((a * c) ** 2 + (b * s) ** 2), math.isqrt((a * s) ** 2 + (b * c) ** 2))
        _check_shape(field, outline, form, *(2 * v // (SUB << TRIG_BITS) + 1 for v in half))
        return ellipse(a, b, c, s)
    sign = np.array([-1 if "x" in form.flip else 1, -1 if form.flip in ("y", "xy") else 1])
    scale = np.array([form.scale_x, form.scale_y])
    rings = [turned(rounded_div(r * sign * scale, ONE), c, s) for r in outline.rings]
    _check_shape(field, outline, form, *_size(rings))
    return polygon(rings)


def _check_shape(field: str, outline: Outline, form: Transform, width: int, height: int) -> None:
    """Check the size of a shape's mask; the error names what makes it too large, the scale, the shape or the angle."""
    if fits(width, height):
        return
    if form.scaled:
        check_size("scale", width, height)
    check_size(field, *((2 * outline.radius // SUB + 1,) * 2 if outline.radius else _size(outline.rings)))
    check_size("angle", width, height)


def _size(rings: Sequence[Ints]) -> tuple[int, int]:
    """Width and height of the box around rings, px."""
    every = np.concatenate(rings)
    width, height = (int(v) // SUB + 1 for v in every.max(axis=0) - every.min(axis=0))
    return width, height


def frame_pivot(sprite: Sprite, frame: Frame) -> tuple[int, int]:
    """Pivot of a frame, in 1/256 px from the centre of its pixel [0, 0]."""
    h, w = frame.mask.shape
    return sprite.pivot_256 or ((w - 1) * HALF, (h - 1) * HALF)


def _source(source: object) -> dict[str, Any] | None:
    """Check the source of a sprite in a scene file: its image, if any, must lie in the folder."""
    if source is None:
        return None
    if not isinstance(source, dict):
        raise InputError(f"source: expected an object, got {shown(source)}")
    if "image" in source:
        inside("source.image", source["image"])
    return dict(source)


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
