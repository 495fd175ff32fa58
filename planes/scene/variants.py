"""Masks of sprites in poses: flipped, scaled and turned in integers, many at a time.

A turn of 90 k + r degrees turns the array exactly k times, and maps it inversely by r before. A pixel of the result is
set if its centre, mapped back, lies in a closed square of a set pixel. So a mirrored sprite turns into the mirror
image, unless the rounded direction is an odd multiple of 45 degrees and only one of width and height is odd: there the
quarter turn decides. Picture and mask go through the same map: what is drawn is what is tested.
"""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..common.backend import LruCache, keep_arena, kernels_of
from ..common.checks import Bools, Image, Ints, choice, real
from ..common.limits import (
    ATLAS_SLACK_BYTES,
    HALF,
    MAPPED_PIXELS,
    MASK_AREA_MAX,
    SCALE_BITS,
    SCALE_MAX,
    SCALE_MIN,
    SUB,
    TRIG_BITS,
    VARIANT_BYTES,
    VARIANT_CACHE_BYTES,
)
from ..grid import rasterize
from ..grid.fixed_point import over_one, quarter_turns, rounded_div, turned
from ..grid.rasterize import ellipse, quarter_turned
from ..grid.spans import Box, Spans
from .sprite import UIDS, Outline, Sprite, check_size, fits, frame_number, frame_pivot, frozen, local_grid, size_of

Ints32 = npt.NDArray[np.int32]

FLIPS = ("none", "x", "y", "xy")
ONE = 1 << SCALE_BITS
QUARTERS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])  # matrices of turns

SIDES_SURE = math.isqrt(MASK_AREA_MAX) - 16  # of a sum of two sides; grids are a few pixels wider

FINE_BITS = TRIG_BITS - SCALE_BITS  # bits by which a turned position is finer than a scaled one


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

    @property
    def direction(self) -> tuple[int, int]:
        """Cosine and sine of the whole turn, times 2**30."""
        c, s = self.c, self.s
        for _ in range(self.quarter):
            c, s = -s, c
        return c, s

    @property
    def signs(self) -> tuple[int, int]:
        """-1 for each axis that is flipped, else 1."""
        return -1 if "x" in self.flip else 1, -1 if "y" in self.flip else 1


def transform_of(sprite: Sprite, frame: object, flip: object, scale_xy: tuple[float, float], angle: float) -> Transform:
    """Check a pose and reduce it to its Transform."""
    number = frame_number(sprite, frame)
    x, y = whole_scale(*scale_xy)
    return Transform(number, choice("flip", flip, FLIPS), x, y, *quarter_turns(sprite.stepped(angle)))


def whole_scale(x: float, y: float) -> tuple[int, int]:
    """Check a scale and round it to 1/65536."""
    x, y = real("scale[0]", x, SCALE_MIN, SCALE_MAX), real("scale[1]", y, SCALE_MIN, SCALE_MAX)
    return round(x * ONE), round(y * ONE)


def surely_fits(sprite: Sprite, transform: Transform) -> bool:
    """Whether a mask surely is not too large, by the sum of the sides of its sprite, which no turn makes longer."""
    return sprite.sides * max(transform.scale_x, transform.scale_y) <= SIDES_SURE * ONE


Carved = tuple[tuple[int, Box], ...]
"""The masks of the same size before a carved one, the latest first: number, and box of the hole made in it."""


@dataclass(eq=False)  # a frozen one takes six times as long to make
class Variant:
    """The mask of a sprite in one pose, cropped and read-only, with its pivot in 1/256 px from the centre of [0, 0].

    `carved` has the masks that it was carved out of.
    """

    transform: Transform
    mask: Bools
    pivot_x: int
    pivot_y: int
    area: int
    carved: Carved = ()
    uid: int = field(default_factory=UIDS.__next__, init=False)


_kept: LruCache[tuple[int, Transform], Variant] = LruCache(
    VARIANT_CACHE_BYTES, lambda variant: variant.mask.nbytes + VARIANT_BYTES
)


def variant_of(sprite: Sprite, transform: Transform) -> Variant:
    """Mask of a transformed sprite; the last used masks are cached."""
    return variants_of([sprite], [transform])[0]


def variants_of(sprites: Sequence[Sprite], transforms: Sequence[Transform]) -> list[Variant]:
    """Masks of sprites, each with its transform; those that are not cached are made together."""
    keys = [(sprite.uid, _unturned(sprite, transform)) for sprite, transform in zip(sprites, transforms, strict=True)]
    return _kept.get_all(keys, lambda rows: _made([sprites[row] for row in rows], [keys[row][1] for row in rows]))


def _unturned(sprite: Sprite, transform: Transform) -> Transform:
    """The transform itself; of a circle, whose mask is the same at every angle, one that is not turned."""
    outline = sprite.outline
    if outline is None or outline.radius is None or transform.scale_x != transform.scale_y or sprite.carvings:
        return transform
    return transform._replace(quarter=0, c=1 << TRIG_BITS, s=0)


def keep_variant(sprite: Sprite, variant: Variant) -> None:
    """Cache the mask of a sprite that was just made, in the pose in which it was made."""
    _kept.get((sprite.uid, variant.transform), lambda: variant)


LAYING_OUT = threading.Lock()  # threads may read the past of a scene, which shares its atlas, while the scene changes


@dataclass
class MaskAtlas:
    """All masks in use in one flat array; a mask that several items use is stored once.

    Masks are laid out when the array is read: areas are fired at tiles, and need none of it. Places are never reused.

    Parameters
    ----------
    laid : the array, as it was laid out last
    used, live : pixels of all masks, and of those that have a user
    later : flat masks that are not laid out yet; they come after the others
    """

    laid: Bools = field(default_factory=lambda: np.zeros(1 << 12, np.bool_))
    used: int = 0
    live: int = 0
    later: list[Bools] = field(default_factory=list)
    offsets: dict[int, int] = field(default_factory=dict)
    users: dict[int, int] = field(default_factory=dict)

    @property
    def flat(self) -> Bools:
        """The array with all masks."""
        if self.later:
            with LAYING_OUT:
                self._lay_out()
        return self.laid

    def take(self, variants: Sequence[Variant]) -> list[int]:
        """Count one more user of each mask, store those that are new, and return their offsets."""
        new: dict[int, Bools] = {}
        for variant in variants:
            uid = variant.uid
            users = self.users[uid] = self.users.get(uid, 0) + 1
            if users == 1:
                self.live += variant.mask.size
            if uid not in self.offsets:
                new[uid] = variant.mask.reshape(-1)
        if new:
            *begin, end = accumulate((mask.size for mask in new.values()), initial=self.used)
            self.offsets.update(zip(new, begin, strict=True))
            with LAYING_OUT:
                self.later += new.values()
                self.used = end
        return [self.offsets[variant.uid] for variant in variants]

    def drop(self, variant: Variant) -> None:
        """Count one user less of a mask, if it has any."""
        users = self.users.pop(variant.uid, 0)
        if users > 1:
            self.users[variant.uid] = users - 1
        elif users:
            self.live -= variant.mask.size

    @property
    def wasteful(self) -> bool:
        """Whether more than half of the array, beyond some slack, is unused."""
        return self.used > 2 * self.live + ATLAS_SLACK_BYTES

    def _lay_out(self) -> None:
        """Write the masks that came later."""
        laid, begin = self.laid, self.used - sum(mask.size for mask in self.later)
        if self.used > len(laid):
            laid = np.zeros(max(self.used, 2 * len(laid)), np.bool_)
            laid[:begin] = self.laid[:begin]
        if self.later:  # another thread may have done it
            np.concatenate(self.later, out=laid[begin : self.used])
        self.laid, self.later = laid, []


def picture_of(sprite: Sprite, transform: Transform, color: tuple[int, int, int]) -> tuple[Image, int, int]:
    """Image (h, w, 4) of a transformed sprite, and its pivot (x, y) in 1/256 px; a mask is filled with `color`."""
    frame = sprite.frames[transform.frame] if sprite.frames else None
    if frame is None or frame.image is None:
        variant = variant_of(sprite, transform)
        image = np.zeros((*variant.mask.shape, 4), np.uint8)
        image[variant.mask] = (*(sprite.color or color), 255)
        return image, variant.pivot_x, variant.pivot_y
    mask, (x, y) = _flipped_frame(sprite, transform)
    image = _flipped(frame.image, transform.flip)
    if transform.plain:
        image, x, y = quarter_turned(image, x, y, transform.quarter)
    else:
        only = np.zeros(1, np.int64)
        grids = _grids_of([(*mask.shape[::-1], x, y)], only, [transform])
        image = _mapped(grids, [mask], only, [image])[0]
        x, y = grids.pivot_256[0].tolist()
    if transform.frame in sprite.carvings:
        image = image.copy()
        image[~_left(sprite, transform, image.shape[1::-1], (x, y), masked=False), 3] = 0
    return image, x, y


def _made(sprites: Sequence[Sprite], transforms: Sequence[Transform]) -> list[Variant]:
    """Make masks; frames that are scaled, or turned by more than quarter turns, are mapped together."""
    if len(transforms) > 1:
        keep_arena()
    made, mapped, polygons = {}, {}, {}
    for row, (sprite, transform) in enumerate(zip(sprites, transforms, strict=True)):
        if sprite.outline is not None and sprite.outline.radius is not None:
            made[row] = _of_shape(transform, *_ellipse_of(sprite, sprite.outline.radius, transform).to_mask())
        elif sprite.outline is not None:
            polygons[row] = sprite, transform
        elif transform.plain:
            mask, pivot = _flipped_frame(sprite, transform)
            mask, x, y = quarter_turned(mask, *pivot, transform.quarter)
            made[row] = cropped(transform, mask, (x, y))
        else:
            mapped[row] = sprite, transform
    if mapped:
        made |= zip(mapped, _mapped_frames(*zip(*mapped.values(), strict=True)), strict=True)
    made |= _polygons_of(polygons)
    for row, (sprite, transform) in enumerate(zip(sprites, transforms, strict=True)):
        if transform.frame in sprite.carvings and made[row].area:
            mask, pivot = made[row].mask, (made[row].pivot_x, made[row].pivot_y)
            made[row] = cropped(transform, mask & _left(sprite, transform, mask.shape[::-1], pivot, masked=True), pivot)
    return [made[row] for row in range(len(transforms))]


def _left(
    sprite: Sprite, transform: Transform, size_wh: tuple[int, int], pivot_256: tuple[int, int], *, masked: bool
) -> Bools:
    """Which pixels (h, w) of a grid about the pivot of a transformed sprite its carving leaves.

    A pixel is left if its centre, mapped back, lies in the closed square of a cell that is left, and in the frame's
    mask if `masked`.
    """
    carving, (size, pivot) = sprite.carvings[transform.frame], local_grid(sprite, transform.frame)
    left = ~carving.gone
    if masked and sprite.outline is None:
        left &= sprite.frames[transform.frame].mask.repeat(carving.per_px, axis=0).repeat(carving.per_px, axis=1)
    left, (x, y) = _flipped(left, transform.flip), _flipped_pivot(size, pivot, transform.flip)
    if transform.plain and carving.per_px == 1:
        turned_left, x, y = quarter_turned(left, x, y, transform.quarter)
        row, column = (y - pivot_256[1]) // SUB, (x - pivot_256[0]) // SUB
        return turned_left[row : row + size_wh[1], column : column + size_wh[0]]
    c, s = transform.direction
    back, at = np.array([[c, s], [-s, c]]), np.array(pivot_256)
    fine = np.array([transform.scale_x, transform.scale_y]) << FINE_BITS
    first = (np.array([x, y]) + HALF) * fine - (back * at).sum(axis=1)
    grid = Grids(at[None], np.array([size_wh]), first[None], (SUB * back)[None], (SUB * fine // carving.per_px)[None])
    out: Bools = _mapped(grid, [left], np.zeros(1, np.int64), [left])[0]
    return out


def cropped(transform: Transform, mask: Bools, pivot_256: tuple[int, int]) -> Variant:
    """Variant of the part of a mask that holds all its set pixels; `pivot_256` is from the centre of its [0, 0]."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)).tolist() for axis in (1, 0))
    if not rows:
        return Variant(transform, frozen(np.zeros((0, 0), np.bool_)), 0, 0, 0)
    part = frozen(mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
    x, y = pivot_256[0] - SUB * columns[0], pivot_256[1] - SUB * rows[0]
    return Variant(transform, part, x, y, int(np.count_nonzero(part)))


def _mapped_frames(sprites: Sequence[Sprite], transforms: Sequence[Transform]) -> list[Variant]:
    """Variants of frames that are mapped inversely; a frame that several of them show is flipped once."""
    numbers: dict[tuple[int, int, str], int] = {}
    which: list[int] = []
    frames: list[tuple[Bools, tuple[int, int]]] = []
    for sprite, transform in zip(sprites, transforms, strict=True):
        key = sprite.uid, transform.frame, transform.flip
        number = numbers.setdefault(key, len(frames))
        if number == len(frames):
            frames.append(_flipped_frame(sprite, transform))
        which.append(number)
    own = np.array(which)
    grids = _grids_of([(*mask.shape[::-1], *pivot) for mask, pivot in frames], own, transforms)
    found = kernels_of(sys.modules[__name__]).turned_masks([mask for mask, _ in frames], own, grids)
    pivots = np.where(found.area[:, None] > 0, grids.pivot_256 - SUB * found.corner_xy, 0)
    columns = transforms, found.masks, *pivots.T.tolist(), found.area.tolist()
    return list(map(Variant, *columns))


class Turned(NamedTuple):
    """Read-only masks that were cropped out of grids, their corners on these, and the numbers of their pixels."""

    masks: list[Bools]
    corner_xy: Ints  # (n, 2)
    area: Ints  # (n,)


def turned_masks(masks: Sequence[Bools], which: Ints, grids: Grids) -> Turned:
    """Masks of frames at the centres of grids (n,), cropped to their pixels; `which` (n,) is each grid's frame."""
    made, corner_xy, area = {}, np.empty((len(which), 2), np.int64), np.empty(len(which), np.int64)
    for batch in _batches(grids):
        used = sorted(set(which[batch].tolist()))
        own, planes = np.searchsorted(used, which[batch]), [masks[number] for number in used]
        held = _mapped(Grids(*(column[batch] for column in grids)), planes, own, planes)
        rows, columns = np.asarray(held.any(axis=2)), np.asarray(held.any(axis=1))
        sides = np.stack([plane.argmax(axis=1) for plane in (columns, rows, columns[:, ::-1], rows[:, ::-1])], axis=1)
        areas, (height, width) = np.count_nonzero(held, axis=(1, 2)), held.shape[1:]
        sides[areas == 0] = 0, 0, width, height
        corner_xy[batch], area[batch] = sides[:, :2], areas
        for row, mask, (left, top, right, low) in zip(batch, held, sides.tolist(), strict=True):
            made[row] = frozen(mask[top : height - low, left : width - right])
    return Turned([made[row] for row in range(len(which))], corner_xy, area)


def _batches(grids: Grids) -> Iterator[list[int]]:
    """Rows of nearly one size, as many as are mapped at a time."""
    sizes = grids.size_wh.tolist()
    batch: list[int] = []
    wide = high = 0
    for row in sorted(range(len(sizes)), key=lambda row: sizes[row][0] * sizes[row][1]):
        wide, high = max(wide, sizes[row][0]), max(high, sizes[row][1])
        if batch and (len(batch) + 1) * wide * high > MAPPED_PIXELS:
            yield batch
            batch, (wide, high) = [], sizes[row]
        batch.append(row)
    yield batch


class Grids(NamedTuple):
    """Pixel grids that hold scaled and turned frames, and how their centres are mapped back to the frames.

    Columns and rows of a frame are in parts, from the border of its pixel [0, 0].
    """

    pivot_256: Ints  # (n, 2) from the centre of pixel [0, 0], 1/256 px
    size_wh: Ints  # (n, 2) px
    first: Ints  # (n, 2) column and row of the frame at the first centre
    step: Ints  # (n, 2, 2) by how much column and row grow with a step right, and with a step down
    unit: Ints  # (n, 2) number of parts of a column, and of a row


def _grids_of(frames: Sequence[tuple[int, int, int, int]], which: Ints, transforms: Sequence[Transform]) -> Grids:
    """Grids of frames, each given by its width, its height and its pivot (x, y); `which` (n,) is each grid's frame.

    The pivot keeps its offset from the pixel grid. If the frame is scaled, its edges decide the offset, to half a
    pixel: whole scales repeat pixels exactly, and a mirrored frame lies on the mirrored grid. A centre at (dx, dy) from
    the pivot lies at (dx c + dy s, dy c - dx s) from it on the frame, in 2**-38 px of the result.
    """
    frame = np.array(frames).take(which, axis=0)
    size, pivot = frame[:, :2], frame[:, 2:]
    _, _, scale_x, scale_y, quarter, *rest = zip(*transforms, strict=True)
    scale, turn = np.array([scale_x, scale_y]).T, QUARTERS.take(quarter, axis=0)
    axis = turn @ np.array(rest).T[..., None]
    forth = np.concatenate([axis, QUARTERS[1] @ axis], axis=2)  # the matrix of the turn, [[c, -s], [s, c]]
    back = forth.swapaxes(1, 2)
    edges = np.empty_like(forth)
    edges[:, :, 0] = (-HALF - pivot) * scale // ONE
    edges[:, :, 1] = (SUB * size - HALF - pivot) * scale // ONE + 1
    corners = np.sort(forth[..., None] * edges[:, None], axis=3)
    reach = over_one(corners[:, :, 0] + corners[:, :, 1])
    low, high = reach[..., 0] - 1, reach[..., 1] + 1
    held = pivot
    if (scale != ONE).any():
        halves = rounded_div((pivot + HALF) * scale - HALF * ONE, HALF * ONE)
        held = np.where(scale == ONE, pivot, halves * HALF)
    held = (turn @ held[..., None])[..., 0] % SUB
    held -= SUB * ((held + low) // SUB)
    size_wh = (high + held) // SUB + 1
    if not fits(1, size_wh.max()) or size_wh.prod(axis=1).max() > MASK_AREA_MAX:
        for transform, (width, height) in zip(transforms, size_wh.tolist(), strict=True):
            check_size("scale" if transform.scaled else "angle", width, height)
    fine = scale << FINE_BITS
    first = (pivot + HALF) * fine - (back @ held[..., None])[..., 0]
    return Grids(held, size_wh, first, SUB * back, SUB * fine)


def _mapped(grids: Grids, masks: Sequence[Bools], which: Ints, values: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Values (n, height, width, ...) of frames at the centres of grids (n,); 0 outside the frames.

    Frames have masks (h, w) and values (h, w, ...); `which` (n,) is the number of the frame of each grid.
    """
    planes = _bordered(masks)
    picked = planes if values is masks else _bordered(values)
    cells = picked.reshape(-1, *picked.shape[3:])
    width, height = grids.size_wh.max(axis=0).tolist()
    rows, strips = max(1, MAPPED_PIXELS // (len(which) * width)), []
    for y in range(0, height, rows):
        first = grids.first + y * grids.step[:, :, 1]
        source = resample(planes, which, first, grids.step, grids.unit, (width, min(rows, height - y)))
        strips.append(cells.take(source, axis=0))
    return strips[0] if len(strips) == 1 else np.concatenate(strips, axis=1)


def _bordered(arrays: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Arrays (h, w, ...) stacked, each in the upper left of a plane, with a border of zeros one pixel wide."""
    height, width = (max(array.shape[axis] for array in arrays) for axis in (0, 1))
    planes = np.zeros((len(arrays), height + 2, width + 2, *arrays[0].shape[2:]), arrays[0].dtype)
    for plane, array in zip(planes, arrays, strict=True):
        plane[1 : array.shape[0] + 1, 1 : array.shape[1] + 1] = array
    return planes


def resample(planes: Bools, which: Ints, first: Ints, step: Ints, unit: Ints, size_wh: tuple[int, int]) -> Ints:
    """Map each pixel centre of grids back to a pixel of a frame whose closed square holds it, a set one if possible.

    Frames are masks in planes (k, h + 2, w + 2), each with a border that is not set; `which` (n,) is the number of the
    frame of each grid, and `first`, `step` and `unit` are those of `Grids`, whose size is one. Returned are flat
    indices (n, height, width) in the planes; for a centre outside the frame, of a pixel of the border.

    A column and a row are rounded to 32 bits, which take half the time of 64. Where they may be those of another
    square, or lie on the border of one, they are worked out exactly.
    """
    _, rows, columns = planes.shape
    first = first + unit
    place, near = _rounded(first.T[..., None], step.T[..., None], unit.T[..., None], size_wh)
    np.maximum(place, 0, out=place)
    column, row = place
    source: Ints = np.minimum(row, rows - 1, out=row).astype(np.int64)
    source *= columns
    source += np.minimum(column, columns - 1, out=column)
    if len(planes) > 1:
        source += (which * (rows * columns))[:, None, None]
    if len(near):
        grid, y, x = np.unravel_index(near, source.shape)
        exact = first[grid] + step[grid, :, 0] * x[:, None] + step[grid, :, 1] * y[:, None]
        source.reshape(-1)[near] = _at_borders(planes, which[grid], exact, unit[grid])
    return source


def _rounded(first: Ints, step: Ints, unit: Ints, size_wh: tuple[int, int]) -> tuple[Ints32, Ints]:
    """Columns and rows (2, n, height, width) of frames at centres; and the centres where these may be wrong or borders.

    Both summands are rounded down, so their sum is too small by less than 2 in its last bit.

    Parameters
    ----------
    first, step, unit : (2, n, 1), (2, 2, n, 1) and (2, n, 1), with the axes of `Grids` first, in reverse
    """
    width, height = size_wh
    along, over = (first + step[0] * np.arange(width)) / unit, step[1] * np.arange(height) / unit
    reach = int(np.abs(along).max() + np.abs(over).max())
    bits = 30 - reach.bit_length()
    along, over = (np.floor(places * (1 << bits)).astype(np.int32) for places in (along, over))
    over += 2
    place = over[..., None] + along[:, :, None]
    rest = place & np.int32((1 << bits) - 4)
    near = np.flatnonzero(np.minimum(rest[0], rest[1], out=rest[0]) == 0)
    place >>= bits
    return place, near


def _at_borders(planes: Bools, which: Ints, place: Ints, unit: Ints) -> Ints:
    """Flat index of the first set square of those that meet at places; of the last in the frame if none is set.

    Parameters
    ----------
    place, unit : (n, 2) column and row, and the number of parts of each
    """
    (_, rows, columns) = planes.shape
    found, held = which * (rows * columns), np.zeros(len(which), np.bool_)
    squares = [(at // parts, -(-at // parts) - 1) for at, parts in zip(place.T[::-1], unit.T[::-1], strict=True)]
    for j, i in product(*squares):
        inside = (j > 0) & (j < rows - 1) & (i > 0) & (i < columns - 1) & ~held
        cell = which[inside] * (rows * columns) + j[inside] * columns + i[inside]
        found[inside] = cell
        held[inside] = planes.reshape(-1).take(cell)
    return np.asarray(found)


def _flipped(array: npt.NDArray[Any], flip: str) -> npt.NDArray[Any]:
    """A view of an array (h, w, ...), flipped."""
    return array[:: -1 if flip in ("y", "xy") else 1, :: -1 if "x" in flip else 1]


def _flipped_frame(sprite: Sprite, transform: Transform) -> tuple[Bools, tuple[int, int]]:
    """Flipped mask of a frame, and its pivot (x, y) in 1/256 px."""
    frame = sprite.frames[transform.frame]
    h, w = frame.mask.shape
    return _flipped(frame.mask, transform.flip), _flipped_pivot((w, h), frame_pivot(sprite, frame), transform.flip)


def _flipped_pivot(size_wh: tuple[int, int], pivot_256: tuple[int, int], flip: str) -> tuple[int, int]:
    """Pivot (x, y) of a flipped grid, in 1/256 px."""
    (w, h), (x, y) = size_wh, pivot_256
    return SUB * (w - 1) - x if "x" in flip else x, SUB * (h - 1) - y if flip in ("y", "xy") else y


def _of_shape(transform: Transform, mask: Bools, corner_xy: tuple[int, int]) -> Variant:
    """Variant of a shape that was filled, from its mask and the position of the mask's pixel [0, 0]."""
    return Variant(transform, frozen(mask), -SUB * corner_xy[0], -SUB * corner_xy[1], int(np.count_nonzero(mask)))


def _polygons_of(polygons: Mapping[int, tuple[Sprite, Transform]]) -> dict[int, Variant]:
    """Variants of polygons, by their rows; those of the same numbers of points are turned and filled together."""
    alike: dict[tuple[int, ...], list[int]] = {}
    for row, (sprite, _) in polygons.items():
        alike.setdefault(tuple(map(len, _rings_of(sprite))), []).append(row)
    made = {}
    for sizes, rows in alike.items():
        points = _turned_points([polygons[row] for row in rows])
        runs = kernels_of(rasterize).polygons(points, np.array([0, *accumulate(sizes[:-1])]))
        for row, (mask, corner_xy) in zip(rows, runs.masks(len(rows)), strict=True):
            made[row] = _of_shape(polygons[row][1], mask, corner_xy)
    return made


def _turned_points(polygons: Sequence[tuple[Sprite, Transform]]) -> Ints:
    """Flip, scale and turn the points of polygons, of m each, as (n, m, 2)."""
    sprites = {sprite.uid: sprite for sprite, _ in polygons}
    of_sprite = {uid: np.concatenate(_rings_of(sprite)) for uid, sprite in sprites.items()}
    points = np.stack([of_sprite[sprite.uid] for sprite, _ in polygons])
    rows = [(*transform.signs, transform.scale_x, transform.scale_y, *transform.direction) for _, transform in polygons]
    table = np.array(rows)[:, None]
    signs, scale, c, s = table[..., :2], table[..., 2:4], table[..., 4], table[..., 5]
    points = turned(rounded_div(points * signs * scale, ONE), c, s)
    sizes = (points.max(axis=1) - points.min(axis=1)) // SUB + 1
    for (sprite, transform), (width, height) in zip(polygons, sizes.tolist(), strict=True):
        _check_shape(sprite, transform, width, height)
    return points


def _rings_of(sprite: Sprite) -> tuple[Ints, ...]:
    """Rings of points of a polygon."""
    return sprite.outline.rings if sprite.outline else ()


def _ellipse_of(sprite: Sprite, radius: int, transform: Transform) -> Spans:
    """Scale and turn a circle, then fill it."""
    c, s = transform.direction
    a, b = (int(rounded_div(np.array(radius * v), ONE)) for v in (transform.scale_x, transform.scale_y))
    half = (math.isqrt((a * c) ** 2 + (b * s) ** 2), math.isqrt((a * s) ** 2 + (b * c) ** 2))
    _check_shape(sprite, transform, *(2 * v // (SUB << TRIG_BITS) + 1 for v in half))
    return ellipse(a, b, c, s)


def _check_shape(sprite: Sprite, transform: Transform, width: int, height: int) -> None:
    """Check the size of a shape's mask; the error names what makes it too large, the scale, the shape or the angle."""
    if fits(width, height):
        return
    if transform.scaled:
        check_size("scale", width, height)
    outline = sprite.outline or Outline()
    own = (2 * outline.radius // SUB + 1,) * 2 if outline.radius else size_of(outline.rings)
    check_size(next(iter(sprite.source or {}), "sprite"), *own)
    check_size("angle", width, height)
