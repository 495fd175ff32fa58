"""Sprites: frames cut from images or masks, and shapes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.backend import cached_attribute
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
    kind_of,
    listed,
    real,
    reals,
    shown,
    within,
)
from ..common.limits import ALPHA_THRESHOLD, ANGLE_STEPS_MAX, FRAMES_MAX, HALF, MASK_AREA_MAX, MASK_SIDE_MAX, SUB
from ..common.tables import Names, inside
from ..grid.fixed_point import snap


def fits(width: int, height: int) -> bool:
    """Whether a mask may have this size, px."""
    return min(width, height) >= 1 and max(width, height) <= MASK_SIDE_MAX and width * height <= MASK_AREA_MAX


def check_size(name: str, width: int, height: int) -> None:
    """Check the size of a mask, px."""
    if not fits(width, height):
        limit = f"a mask of sides up to {MASK_SIDE_MAX} px and {MASK_AREA_MAX} px in all, not empty"
        raise InputError(f"{name}: expected {limit}, got {width} x {height}")


UIDS = itertools.count()  # numbers of sprites and of their masks, unique in this process

OUTLINE_MARGIN = 2  # pixels around a shape: scaled to 1/256, its points are rounded by up to 1 px of it as it was made


class ReadOnly:
    """An object whose arrays are read-only; so are those of a copy."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False


@dataclass(frozen=True)
class Frame(ReadOnly):
    """A frame of a sprite: the mask (h, w), the image (h, w, 4) that it was made of, if any, and a pivot of its own."""

    mask: Bools
    image: Image | None = None
    pivot_256: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class Carving(ReadOnly):
    """What was carved out of a frame or a shape: cells that are gone. It is flipped, scaled and turned with the sprite.

    A turned or enlarged sprite loses parts of its pixels, so a pixel has several cells.
    """

    gone: Bools  # (h * per_px, w * per_px) cells of the pixels of `local_grid`, True where nothing is left
    per_px: int = 1  # number of cells along a pixel, a power of two


@dataclass(frozen=True)
class Outline:
    """A shape in 1/256 px relative to its position: rings of points, or the radius of a circle."""

    rings: tuple[Ints, ...] = ()
    radius: int | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Sprite:
    """The look and the mask of an object: frames of image and mask, or one shape. The class methods make sprites.

    `source` is its entry in a scene file, as JSON, or None. `carvings` has what `Scene.carve` took out of frames, by
    their numbers.
    """

    frames: tuple[Frame, ...]
    pivot_256: tuple[int, int] | None = None
    outline: Outline | None = None
    color: tuple[int, int, int] | None = None
    source: dict[str, Any] | None = None
    angle_step: float | None = None
    frame_names: tuple[str, ...] = ()
    carvings: dict[int, Carving] = field(default_factory=dict)
    uid: int = field(default_factory=UIDS.__next__, init=False)

    def __post_init__(self) -> None:
        """Refuse what is no frames, such as the array of a mask."""
        if not (isinstance(self.frames, tuple) and all(isinstance(frame, Frame) for frame in self.frames)):
            how = "Sprite.from_mask and Sprite.from_image make sprites of arrays"
            raise InputError(f"frames: expected a tuple of frames, got {shown(self.frames)}: {how}")

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Copy the fields, but take a new number: the old one may be in use in this process."""
        vars(self).update(state, uid=next(UIDS))

    def __repr__(self) -> str:
        sizes = [f"{frame.mask.shape[1]} x {frame.mask.shape[0]} px" for frame in self.frames]
        what = f"{len(sizes)} frames, the first {sizes[0]}" if len(sizes) > 1 else "".join(sizes)
        if self.outline is not None:
            points, radius = sum(map(len, self.outline.rings)), self.outline.radius
            what = f"polygon of {points} points" if radius is None else f"circle of radius {radius / SUB:g} px"
        return f"<Sprite: {what}>"

    @classmethod
    def from_image(
        cls, image: object, *, alpha_threshold: int = ALPHA_THRESHOLD, color_key: Sequence[int] | None = None,
        grid_wh: Sequence[int] | None = None, rects_xywh: Sequence[Sequence[int]] | None = None,
        pivot_xy: Sequence[float] | Sequence[Sequence[float]] | None = None, frame_names: Sequence[str] = (),
        angle_step: float | None = None, source: dict[str, Any] | None = None,
    ) -> Sprite:  # fmt: skip
        """Cut an image into frames and their masks.

        Parameters
        ----------
        image : (h, w, 3) RGB or (h, w, 4) RGBA, bytes
        alpha_threshold : a pixel is in the mask if its alpha is greater
        color_key : RGB of transparent pixels
        grid_wh : size of a frame; frames run left to right, then top to bottom
        rects_xywh : (n, 4) frames as rectangles
        pivot_xy : point of a frame that is put at the object's position, px from its pixel [0, 0]; one for all frames,
            or one for each (n, 2), as trimmed sheets have; by default the centre ((w-1)/2, (h-1)/2) of each
        frame_names : a name for each frame, which `scene.set(ids, frame=...)` takes as well as its number
        angle_step : degrees, a whole number of which make a turn: the mask is turned to the nearest multiple

        Raises
        ------
        InputError
            If the image is not such an array, frames leave it, or the grid does not divide it.
        """
        threshold = integer("alpha_threshold", alpha_threshold, 0, 255)
        rgba, mask = _keyed("image", image, threshold, color_key)
        rects = _frame_rects(rgba.shape[1], rgba.shape[0], grid_wh, rects_xywh)
        parts = [(mask[y : y + h, x : x + w], rgba[y : y + h, x : x + w]) for x, y, w, h in rects]
        return cls._of_parts(parts, threshold, pivot_xy, frame_names, angle_step, source)

    @classmethod
    def from_images(
        cls, images: Sequence[object], *, alpha_threshold: int = ALPHA_THRESHOLD,
        color_key: Sequence[int] | None = None, pivot_xy: Sequence[float] | Sequence[Sequence[float]] | None = None,
        frame_names: Sequence[str] = (), angle_step: float | None = None, source: dict[str, Any] | None = None,
    ) -> Sprite:  # fmt: skip
        """Take images as frames, each of a size of its own; the other parameters are those of `from_image`.

        Parameters
        ----------
        images : n of them, each (h, w, 3) RGB or (h, w, 4) RGBA, bytes
        """
        threshold, given = integer("alpha_threshold", alpha_threshold, 0, 255), listed("images", images, "a list")
        if not 1 <= len(given) <= FRAMES_MAX:
            raise InputError(f"images: expected 1 to {FRAMES_MAX}, got {len(given) or 'none'}")
        parts = [_keyed(f"images[{i}]", image, threshold, color_key)[::-1] for i, image in enumerate(given)]
        return cls._of_parts(parts, threshold, pivot_xy, frame_names, angle_step, source)

    @classmethod
    def _of_parts(
        cls, parts: Sequence[tuple[Bools, Image]], threshold: int,
        pivot_xy: Sequence[float] | Sequence[Sequence[float]] | None, frame_names: Sequence[str],
        angle_step: float | None, source: dict[str, Any] | None,
    ) -> Sprite:  # fmt: skip
        """A sprite of masks and images."""
        pivot, pivots = _pivots(pivot_xy, len(parts))
        names = _frame_names(frame_names, len(parts))
        frames = tuple(
            Frame(frozen(mask), frozen(image), own) for (mask, image), own in zip(parts, pivots, strict=True)
        )
        known = (_source(source) or {}) | {"alpha_threshold": threshold}
        return cls(frames, pivot, source=known, angle_step=_angle_step(angle_step), frame_names=names)

    @classmethod
    def from_mask(
        cls, mask: object, *, pivot_xy: Sequence[float] | None = None, color: Sequence[int] | None = None,
        angle_step: float | None = None, source: dict[str, Any] | None = None,
    ) -> Sprite:  # fmt: skip
        """Take a boolean array (h, w) as the mask of one frame.

        Parameters
        ----------
        mask : (h, w) booleans
        pivot_xy : where it is held, px; by default its centre ((w-1)/2, (h-1)/2)
        color : RGB in which pictures fill it
        angle_step : degrees, a whole number of which make a turn: the mask is turned to the nearest multiple
        source : what a scene file says of it, as JSON
        """
        given = array_of("mask", mask)
        if given.ndim == 2:
            check_size("mask", given.shape[1], given.shape[0])
        checked = bools("mask", given, (None, None))
        frames, step = (Frame(frozen(checked)),), _angle_step(angle_step)
        return cls(frames, _pivot(pivot_xy), color=_color(color), source=_source(source), angle_step=step)

    @classmethod
    def polygon(
        cls, points_xy: object, holes: Sequence[object] = (), *, color: Sequence[int] | None = None,
        angle_step: float | None = None,
    ) -> Sprite:  # fmt: skip
        """Shape of points about the position; edges belong to it.

        Parameters
        ----------
        points_xy : (n, 2) px, 3 points or more
        holes : more rings of points, by the even-odd rule
        color : RGB in which pictures fill it
        angle_step : degrees, a whole number of which make a turn: it is turned to the nearest multiple
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
        return cls((), (0, 0), Outline(tuple(rings)), _color(color), source, _angle_step(angle_step))

    @classmethod
    def circle(cls, radius: float, *, color: Sequence[int] | None = None, angle_step: float | None = None) -> Sprite:
        """Shape of the centres at most `radius` px from the position; scaled by (sx, sy) it is an ellipse.

        `color` is the RGB in which pictures fill it; `angle_step` as for a polygon.
        """
        r = int(snap(real("radius", radius, 0, MASK_SIDE_MAX)))
        return cls((), (0, 0), Outline(radius=r), _color(color), {"circle": r / SUB}, _angle_step(angle_step))

    @classmethod
    def box(
        cls, width: float, height: float, *, color: Sequence[int] | None = None, angle_step: float | None = None
    ) -> Sprite:
        """Closed rectangle of `width` x `height` px centred on the position.

        `Sprite.box(2, 2)` covers 9 px, where the weapon `Box(2, 2)` covers 4: a shape has every pixel whose centre lies
        in it or on its sides, here those at -1, 0 and 1 along each axis; the weapon counts its pixels.

        `color` is the RGB in which pictures fill it; `angle_step` as for a polygon.
        """
        w, h = (real(name, v, 0, MASK_SIDE_MAX) / 2 for name, v in (("width", width), ("height", height)))
        shape = cls.polygon([(-w, -h), (w, -h), (w, h), (-w, h)], color=color, angle_step=angle_step)
        return replace(shape, source={"box_wh": [float(width), float(height)]})

    def stepped(self, angle: float) -> float:
        """Angle that the mask is turned by: the multiple of `angle_step` next to an angle, or the angle itself."""
        if self.angle_step is None:
            return angle
        steps = round(360 / self.angle_step)
        return round(angle / 360 * steps) % steps * 360 / steps

    @property
    def frame_count(self) -> int:
        """Number of frames; a shape has one."""
        return max(len(self.frames), 1)

    @cached_attribute
    def sides(self) -> int:
        """Greatest sum of width and height of its frames, px, or that of its shape."""
        return max(sum(local_grid(self, number)[0]) for number in range(self.frame_count))


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
    got = array.shape if array.ndim else kind_of(value)
    raise InputError(f"sprite: expected a Sprite, a mask (h, w) or an image (h, w, 3 or 4), got {got}")


def rows_of(mask: Bools) -> list[str]:
    """A mask as rows of '#' and '.', the form of scene files."""
    return [row.tobytes().decode("ascii") for row in np.where(mask, np.uint8(ord("#")), np.uint8(ord(".")))]


def size_of(rings: Sequence[Ints]) -> tuple[int, int]:
    """Width and height of the box around rings, px."""
    every = np.concatenate(rings)
    width, height = (int(v) // SUB + 1 for v in every.max(axis=0) - every.min(axis=0))
    return width, height


def frame_pivot(sprite: Sprite, frame: Frame) -> tuple[int, int]:
    """Pivot of a frame, in 1/256 px from the centre of its pixel [0, 0]."""
    h, w = frame.mask.shape
    return frame.pivot_256 or sprite.pivot_256 or ((w - 1) * HALF, (h - 1) * HALF)


def local_grid(sprite: Sprite, number: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Width and height of the pixel grid of a frame or a shape as it was made, and its pivot.

    The pivot is in 1/256 px from the centre of pixel [0, 0]. The grid of a shape has a margin, as the points of a
    transformed shape are rounded.
    """
    if sprite.outline is None:
        frame = sprite.frames[number]
        return frame.mask.shape[::-1], frame_pivot(sprite, frame)
    radius = sprite.outline.radius
    points = np.concatenate(sprite.outline.rings) if radius is None else np.array([[-radius] * 2, [radius] * 2])
    low = points.min(axis=0) // SUB - OUTLINE_MARGIN
    width, height = (-(-points.max(axis=0) // SUB) + OUTLINE_MARGIN + 1 - low).tolist()
    x, y = (-SUB * low).tolist()
    return (width, height), (x, y)


def _source(source: object) -> dict[str, Any] | None:
    """Check the source of a sprite in a scene file: its image, if any, must lie in the folder."""
    if source is None:
        return None
    if not isinstance(source, dict):
        raise InputError(f"source: expected an object, got {shown(source)}")
    if "image" in source:
        inside("source.image", source["image"])
    if isinstance(source.get("mask"), str):
        inside("source.mask", source["mask"])
    for i, name in enumerate(source.get("images", ())):
        inside(f"source.images[{i}]", name)
    return dict(source)


def _pivot(pivot_xy: Sequence[float] | None) -> tuple[int, int] | None:
    if pivot_xy is None:
        return None
    x, y = snap(reals("pivot_xy", pivot_xy, (2,), MASK_SIDE_MAX)).tolist()
    return x, y


Pair = tuple[int, int] | None


def _pivots(pivot_xy: Sequence[float] | Sequence[Sequence[float]] | None, n: int) -> tuple[Pair, list[Pair]]:
    """The pivot of all frames, and a pivot of each, in 1/256 px; the given ones are either."""
    if pivot_xy is None or array_of("pivot_xy", pivot_xy).ndim < 2:
        return _pivot(pivot_xy), [None] * n  # type: ignore[arg-type]
    return None, [(x, y) for x, y in snap(reals("pivot_xy", pivot_xy, (n, 2), MASK_SIDE_MAX)).tolist()]


def _frame_names(frame_names: Sequence[str], n: int) -> tuple[str, ...]:
    """Check the names of frames: none, or a different one for each."""
    names = Names().check("frame_names", listed("frame_names", frame_names, "a list of names"))
    if names and len(names) != n:
        raise InputError(f"frame_names: expected one for each of {n} frames, got {len(names)}")
    return tuple(names)


def frame_number(sprite: Sprite, frame: object) -> int:
    """Check the number or the name of a frame, and return its number."""
    if isinstance(frame, str) and sprite.frame_names:
        return sprite.frame_names.index(choice("frame", frame, sprite.frame_names))
    if isinstance(frame, str):
        count = sprite.frame_count
        raise InputError(f"frame: expected a number from 0 to {count - 1}, as the frames have no names, got {frame!r}")
    return integer("frame", frame, 0, sprite.frame_count - 1)


def _color(color: Sequence[int] | None) -> tuple[int, int, int] | None:
    if color is None:
        return None
    red, green, blue = integers("color", color, (3,), 0, 255).tolist()
    return red, green, blue


def _angle_step(value: float | None) -> float | None:
    """Check a step of angles: a turn has a whole number of them, so that its last step is as long as the others."""
    if value is None:
        return None
    step = real("angle_step", value, 360 / ANGLE_STEPS_MAX, 360)
    if abs(round(360 / step) * step - 360) > 1e-9 * 360:
        raise InputError(f"angle_step: expected 360 degrees by a whole number, such as 5 or 360 / 64, got {step:g}")
    return step


def _keyed(field: str, image: object, threshold: int, color_key: Sequence[int] | None) -> tuple[Image, Bools]:
    """An image as RGBA, transparent where it has the colour key, and its mask."""
    rgba = _as_rgba(field, image)
    mask = rgba[:, :, 3] > threshold
    if color_key is not None:
        key = integers("color_key", color_key, (3,), 0, 255)
        mask &= (rgba[:, :, :3] != key).any(axis=2)
        rgba[:, :, 3] = np.where(mask, rgba[:, :, 3], 0)
    return rgba, mask


def _as_rgba(field: str, image: object) -> Image:
    array = array_of(field, image)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] not in (3, 4):
        raise InputError(f"{field}: expected bytes of shape (h, w, 3 or 4), got {array.dtype} {array.shape}")
    check_size(field, array.shape[1], array.shape[0])
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


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A contiguous read-only copy."""
    out = array.copy()
    out.setflags(write=False)
    return out
