"""Compiled forms of prepared shots: one call of the kernel of areas, or of rays, answers a shot.

A pattern walks the stack from front to back at first. When shots have spent as much time on that as the visible set
costs, it is made, and its tiles are listed by cells of shot positions.

Kernels are given structs of arrays, because unpacking an array for each column would take as long as the shot.
"""

from __future__ import annotations

import struct
import threading
from math import isqrt
from typing import Any

import numpy as np
from numba import types
from numba.experimental import structref

from hitplanes.planes.bits.front_to_back import NO_NUMBERS
from hitplanes.planes.bits.tiles import visible_ns
from hitplanes.planes.bits.visible import VisibleSet
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.costs import COMPILED
from hitplanes.planes.common.limits import HALF, WEIGHT_FULL
from hitplanes.planes.grid.rasterize import DIAGONAL
from hitplanes.planes.grid.spans import Box
from hitplanes.planes.jit import raycast as cast
from hitplanes.planes.jit.areas import (
    CELLS,
    KEY,
    NOBODY,
    OWNERS,
    PATTERNS,
    PELLETS,
    PIXELS,
    RANK,
    RULE,
    SAMPLES,
    TILES,
    WEIGHT,
    X,
    Y,
    match,
)
from hitplanes.planes.jit.bit_rows import EVERYWHERE, FEW_ROWS, INTS, ROWS_OUT, cell_at
from hitplanes.planes.jit.cache import compiled
from hitplanes.planes.jit.raycast import NOWHERE, fits, follow
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import HitRow
from ..rays.one_ray import Follow, Followed
from .one_shot import Filter, OneShot, Round
from .position_cache import FARTHEST, ODD, PIXEL, Look, new

PIECE_BYTES = 400
"""Memory of a round in addition to its pixels, bytes."""

MAKE_VISIBLE = -1
"""Returned by `_shot` instead of a number of rows: the visible set is worth making."""

UNKNOWN = -2
"""Returned by `_shot` instead of a number of rows: the shot is left to `fire`."""

ROW = 8
"""Numbers of a row: item, samples, pixels, weight, pellets, x, y, squared distance."""

ROW_BYTES, OUT = 8 * ROW, (Y + 1) * FEW_ROWS
read = struct.Struct("8q").unpack_from
ZERO = np.zeros(1, np.int64)
ACCEPT_ALL = NO_NUMBERS, NOBODY


@structref.register
class ShotTilesType(types.StructRef):
    """Type of `ShotTiles` in kernels."""


class ShotTiles(structref.StructRefProxy):
    """What shots at a scene look up, in kernels.

    Parameters
    ----------
    item : ids by rank
    tiles : columns of `OrderedTiles`
    cells : columns of `Cells`; no cells if shots walk all tiles
    pierce, bounds : as in `front_to_back.Rule`
    meets, exclude : filter of the shots, as columns; (0,) and (1, 0) if they accept all items
    worth, spent : ns that the visible set takes, and that shots have walked for want of it; 0 if it is there
    """


OF_TILES = [
    ("item", INTS), ("tiles", TILES), ("cells", CELLS),
    *zip(("pierce", "bounds", "meets", "exclude"), RULE, strict=True),
    ("worth", types.float64), ("spent", types.float64),
]  # fmt: skip


@structref.register
class ShapeType(types.StructRef):
    """Type of `Shape` in kernels."""


class Shape(structref.StructRefProxy):
    """A round in kernels: columns of `PatternBits`, of one pattern, and the pixels of its pellets."""


OF_SHAPE = [("pattern", PATTERNS), ("pellet_x", INTS), ("pellet_y", INTS)]


def struct_of(proxy: type, of: type, fields: list[tuple[str, Any]]) -> Any:
    """Type of a struct with the given fields, which kernels make and Python holds."""
    structref.define_constructor(proxy, of, [name for name, _ in fields])
    structref.define_boxing(of, proxy)
    return of(fields)


SHOT_TILES, SHAPE = struct_of(ShotTiles, ShotTilesType, OF_TILES), struct_of(Shape, ShapeType, OF_SHAPE)


@compiled(SHOT_TILES(*[of for _, of in OF_TILES[:-1]]))
def _shot_tiles(item, tiles, cells, pierce, bounds, meets, exclude, worth):
    return ShotTiles(item, tiles, cells, pierce, bounds, meets, exclude, worth, 0.0)


@compiled(SHAPE(*[of for _, of in OF_SHAPE]))
def _shape(pattern, pellet_x, pellet_y):
    return Shape(pattern, pellet_x, pellet_y)


@compiled(types.int64(types.float64, types.float64, SHOT_TILES, SHAPE, types.int64[:, ::1]), nogil=False)
def _shot(at_x, at_y, ground, shape, found):
    """Number of rows of a round at a position, which are written to `found`, (FEW_ROWS, ROW)."""
    if not (-FARTHEST < at_x < FARTHEST and -FARTHEST < at_y < FARTHEST) or at_x == ODD or at_y == ODD:
        return UNKNOWN
    column, row = np.int64(np.floor(at_x + PIXEL)), np.int64(np.floor(at_y + PIXEL))
    left, top, bits, wide, high, begin, _ = ground.cells
    if wide:
        cell = cell_at(column, row, left, top, bits, wide, high)
        if cell < 0 or begin[cell] == begin[cell + 1]:
            return 0
    elif ground.worth:
        ground.spent += COMPILED.prepared_tile * len(ground.tiles[0]) + COMPILED.prepared_near
        if ground.spent > ground.worth:
            return MAKE_VISIBLE
    pellets = len(shape.pellet_x)
    scratch = np.empty(OUT + 2 + 3 * pellets, np.int64)
    out, origin_x, origin_y = scratch[:OUT].reshape(Y + 1, FEW_ROWS), scratch[OUT : OUT + 1], scratch[OUT + 1 : OUT + 2]
    x, y, kind = scratch[OUT + 2 :].reshape(3, pellets)
    origin_x[0], origin_y[0] = column, row
    for pellet in range(pellets):
        x[pellet], y[pellet], kind[pellet] = column + shape.pellet_x[pellet], row + shape.pellet_y[pellet], 0
    turn, rows, _ = match(
        0, 1, 0, out, (kind, x, y, origin_x, origin_y), shape.pattern, ground.tiles, ground.cells,
        ground.pierce, ground.bounds, ground.meets, ground.exclude, pellets,
    )  # fmt: skip
    if turn < 1:
        return UNKNOWN
    for row in range(rows):
        found[row, 0], found[row, 1], found[row, 2] = ground.item[out[RANK, row]], out[SAMPLES, row], out[PIXELS, row]
        found[row, 3] = out[WEIGHT, row] if len(shape.pattern[5]) else WEIGHT_FULL * out[SAMPLES, row]
        found[row, 4], found[row, 5], found[row, 6] = out[PELLETS, row], out[X, row], out[Y, row]
        found[row, 7] = out[KEY, row]
    return rows


shot = _shot.overloads[_shot.signatures[0]].entry_point
"""Its entry point, without the dispatch on argument types, which takes twice as long as the call."""


def filter_columns(view: View) -> tuple[Ints, Ints]:
    """Filter of the items that shots of a view meet, as columns of one shot."""
    return np.array([view.meets]), np.array([view.exclude], np.int64).reshape(1, -1)


class GroundCache:
    """Compiled form of `position_cache.GroundCache`: the items as columns of kernels."""

    def __init__(self, scene: Scene, pierce: bool) -> None:
        self.pierce = pierce
        self._scene = scene
        self._stack: Stack | None = None
        self._columns: Any = ()
        self._lock = threading.Lock()

    def read(self, stack: Stack) -> Any:
        """Ids of the items of a stack, and its `OrderedTiles`."""
        with self._lock:
            if stack is not self._stack:
                ordered = self._scene.items.tiles().ordered(stack, stack.covers, choosy=True)
                self._columns, self._stack = (stack.ids, tuple(map(np.ascontiguousarray, ordered))), stack
            return self._columns


class PositionCache:
    """Compiled form of `position_cache.PositionCache`, without squares: a kernel walks the stack or the visible set."""

    def __init__(self, scene: Scene, ground: GroundCache, kept: Filter, reach: int, _: int) -> None:
        self.quick = None  # each shot is looked up
        self.tiles: Any  # a ShotTiles
        self._scene, self._ground, self._view = scene, ground, kept.view(ground.pierce)
        self._reach = np.array([-reach, -reach, reach, reach])
        self._is_visible = False
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Read the scene as it is now."""
        with self._lock:
            visible_set = self._scene.derived.visible(self._view).made(self._scene.items)
            if visible_set is not None:
                self._use_visible(visible_set, stack)
                return
            bounds = self._scene.bounds or EVERYWHERE
            kept = filter_columns(self._view) if self._view.may_refuse(stack) else ACCEPT_ALL
            self.tiles = _shot_tiles(
                *self._ground.read(stack), NOWHERE, self._view.pierce, tuple(bounds), *kept,
                visible_ns(stack, COMPILED),
            )  # fmt: skip
            self._is_visible = False

    def _use_visible(self, visible_set: VisibleSet, stack: Stack) -> None:
        """Let shots look up the visible set; its tiles do not overlap and lie within the bounds."""
        cells, seen = tuple(visible_set.cells(self._reach)), tuple(map(np.ascontiguousarray, visible_set.seen))
        self.tiles = _shot_tiles(stack.ids, seen, cells, True, EVERYWHERE, *ACCEPT_ALL, 0.0)
        self._is_visible = True

    def make_visible(self) -> None:
        """Make the visible set, if no other thread has made it."""
        with self._lock:
            if not self._is_visible:
                scene = self._scene
                visible_set = scene.derived.visible(self._view).read(scene.items)
                self._use_visible(visible_set, scene.items.stack())


BUFFERS: list[tuple[Any, memoryview]] = []
"""Rows that kernels write to, of as many threads as shoot at a time."""


def look(fired: Round) -> tuple[Look, int]:
    """Function that looks up what a round hits, and the bytes kept for it."""
    bits, alone = fired.pattern.only_bits(), (ZERO, ZERO)
    shape = _shape(tuple(bits), *(alone if fired.pellets_xy is None else fired.pellets_xy.T))
    number, tell = fired.number, OneShot.append

    def look(x: float, y: float, hits: OneShot) -> None:
        """Call the kernel and read its rows from a buffer."""
        try:
            buffer = BUFFERS.pop()  # each thread takes its own
        except IndexError:
            found = np.empty((FEW_ROWS, ROW), np.int64)
            buffer = found, memoryview(found).cast("B")
        near = hits._present.near
        count = shot(x, y, near.tiles, shape, buffer[0])
        if count:
            if count < 0:
                BUFFERS.append(buffer)
                if count == UNKNOWN:
                    raise KeyError
                near.make_visible()
                return look(x, y, hits)
            view, at, end = buffer[1], 0, ROW_BYTES * count
            while at < end:  # faster than a range
                item, samples, pixels, weight, pellets, column, row, distance2 = read(view, at)
                tell(hits, new(HitRow, (0, number, item, samples, pixels, weight, pellets, (column, row), distance2)))
                at += ROW_BYTES
        BUFFERS.append(buffer)

    pellets = 0 if fired.pellets_xy is None else fired.pellets_xy.nbytes
    return look, PIECE_BYTES + bits.words.nbytes + bits.sums.nbytes + pellets


@structref.register
class TargetsType(types.StructRef):
    """Type of `Targets` in kernels."""


class Targets(structref.StructRefProxy):
    """What single rays are cast at, in kernels: columns of the items, the bounds, and the filter as in `ShotTiles`."""


OF_TARGETS = [("items", cast.ITEMS), ("bounds", cast.BOUNDS), ("meets", INTS), ("exclude", OWNERS)]
TARGETS = struct_of(Targets, TargetsType, OF_TARGETS)


@compiled(TARGETS(*[of for _, of in OF_TARGETS]))
def _targets(items, bounds, meets, exclude):
    return Targets(items, bounds, meets, exclude)


@compiled(types.UniTuple(types.int64, 7)(*[types.int64] * 8, TARGETS, ROWS_OUT), nogil=False)
def _one_ray(x, y, dx, dy, radius, side, wide_side, most, targets, others):
    """Number of objects that a ray hits, time at which it ends, and of the first: rank, count, x, y, and entry.

    The other objects that it hits are written to columns with the same five numbers.
    """
    items, room = targets.items, len(targets.items[0]) + 1
    near, found = np.empty(room, np.int64), np.empty((cast.COLUMNS, room), np.int64)
    wide, ends = (radius, side, wide_side, dx * dx + dy * dy), np.empty((6, 1), np.int64)
    origin_x, origin_y, first = (x + HALF) >> 8, (y + HALF) >> 8, (-1, 0, 0, 0, 0)
    count = follow(
        np.int64(0), x, y, dx, dy, wide, items, NOWHERE, targets.bounds, most, targets.meets, targets.exclude,
        near, found, ends,
    )  # fmt: skip
    for i in range(count):
        at = near[i]
        rank, column, row = found[cast.RANK, at], found[cast.X, at] + origin_x, found[cast.Y, at] + origin_y
        if i == 0:
            first = rank, found[cast.COUNT, at], column, row, found[cast.ENTRY, at]
            continue
        others[0, i - 1], others[1, i - 1], others[2, i - 1] = rank, found[cast.COUNT, at], column
        others[3, i - 1], others[4, i - 1] = row, found[cast.ENTRY, at]
    return count, ends[1, 0], first[0], first[1], first[2], first[3], first[4]


one_ray = _one_ray.overloads[_one_ray.signatures[0]].entry_point
"""Its entry point, without the dispatch on argument types, which takes longer than the call."""


def follower(stack: Stack, bounds: Box | None, view: View, radius: int, most: int | None) -> Follow:
    """See `rays.one_ray.follower`."""
    items = stack.box_xyxy, stack.offset, stack.masks, stack.occluder, stack.categories, stack.owner
    accepts = filter_columns(view) if view.may_refuse(stack) else ACCEPT_ALL
    within = EVERYWHERE if bounds is None else tuple(bounds)
    targets = _targets(tuple(map(np.ascontiguousarray, items)), within, *accepts)
    room, limit = (len(stack) if most is None else min(most, len(stack))) - 1, most or 0
    none = np.empty((5, 0), np.int64)

    def followed(x: int, y: int, dx: int, dy: int) -> Followed | None:
        """Follow one ray."""
        if not fits(max(abs(dx), abs(dy)), radius):
            return None
        side = wide_side = 0
        if radius:
            length2 = dx * dx + dy * dy
            side = wide_side = isqrt(radius * radius * length2)
            if radius < DIAGONAL:
                wide_side = isqrt(DIAGONAL * DIAGONAL * length2)
        others = np.empty((5, room), np.int64) if room > 0 else none
        count, time, *first = one_ray(x, y, dx, dy, radius, side, wide_side, limit, targets, others)
        if count < 2:
            return time, [first] if count else []
        return time, [first, *others[:, : count - 1].T.tolist()]

    return followed
