"""Position cache: squares of shot positions, each with the visible tiles near it, as Python integers.

Shots walk the tiles of the stack from front to back, until they have lost as much time as the visible set takes to
make. Then a square lists the visible tiles near it when a shot first falls into it; they do not hide each other. Any
change of the scene discards the squares. `compiled` has the compiled form.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

import numpy as np

from hitplanes.planes.bits.tiles import (
    BigPattern,
    BigTiles,
    Depths,
    Ground,
    Hit,
    Weights,
    hit_by_one,
    in_order,
    integers_ns,
    stride_of,
    visible_ns,
)
from hitplanes.planes.bits.visible import VisibleSet
from hitplanes.planes.common import costs
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.limits import POSITION_MAX, WEIGHT_FULL
from hitplanes.planes.grid.spans import meets
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.areas import accepted
from ..fire.hits import HitRow
from .one_shot import Filter, OneShot, Round

CELL_SHIFT = 5
SIDE = 1 << CELL_SHIFT
"""Side of a square, px. A larger square has more objects near it; smaller squares are made more often."""

KEPT_BYTES = 64 * 2**20
"""Most memory of the squares of one prepared weapon, bytes; beyond it all are discarded."""

FILTER_BYTES = 2**21
"""The same of each filter of a weapon that `fire` made ready, of which many are kept."""

EDGE = (POSITION_MAX >> CELL_SHIFT) - 2**12
"""Squares beyond this index are not made, so that a shot that finds a square needs no check of its range."""

FARTHEST = SIDE * EDGE // 2
"""Positions beyond this coordinate, px, are left to `fire`."""

PIXEL = 257 / 512
"""Offset, px: floor(v + PIXEL) is the pixel of a position, (rint(256 v) + 128) // 256, with ties to even."""

ODD = math.nextafter(1 - PIXEL, 0)
"""The only coordinate within the limits at which v + PIXEL is rounded up to a whole number."""

CELL_BYTES, ENTRY_BYTES = 400, 300
"""Memory of a square, and of each tile that it lists, bytes."""

SeenTile = tuple[int, int, int, int, int, int]
"""A visible tile: its box (left, top, right, bottom), first row in the words of the set, and the rank of its item."""

Square = tuple[SeenTile, ...]

UNMADE: Square = ((0, 0, 0, 0, 0, 0),)
"""Stands for a square that is not made yet."""

Look = Callable[[Any, Any, OneShot], None]
"""Function (x, y, answer) that appends the hits of a round at pixel (x, y) to an answer, in order.

The compiled form takes any position. Both raise KeyError for a shot that is left to `fire`.
"""

new = tuple.__new__
"""Makes a row in half the time that `HitRow` takes."""

ZERO = np.zeros(1, np.int64)
"""Number of the only shot, as a column."""


@dataclass(frozen=True, eq=False)
class Scattered(BigPattern):
    """Pellets of one pattern as one integer, of the pixels of all, and the shift and the integer of each."""

    pellets: tuple[tuple[int, int], ...] = ()

    @property
    def nbytes(self) -> int:
        """Bytes of the pixels, of all pellets and of each."""
        return super().nbytes + sum(pellet.bit_length() for _, pellet in self.pellets) // 7

    def share(self, bits: int, count: int) -> int:
        """The pixels themselves: tiles of an item share none, so that their sum has all."""
        return bits

    def counted(self, share: int, pixels: int) -> tuple[int, int, int]:
        """Samples, weight and pellets of a hit on an item."""
        hit = [(shift, bits) for shift, pellet in self.pellets if (bits := share & pellet)]
        samples = sum(bits.bit_count() for _, bits in hit)
        weights = self.weights
        weight = sum(weights.of(bits >> shift) for shift, bits in hit) if weights else samples * WEIGHT_FULL
        return samples, weight, len(hit)


def scattered(pattern: BigPattern, offsets_xy: Ints) -> Scattered:
    """Pellets of a pattern at offsets (K, 2) from the pixel that all are placed on."""
    (left, top), (right, bottom) = offsets_xy.min(axis=0).tolist(), offsets_xy.max(axis=0).tolist()
    wide, high = pattern.wide + right - left, pattern.high + bottom - top
    stride = stride_of(wide)
    rows = restrided(pattern.rows, pattern.high, pattern.stride, stride)
    shifts = [(y - top) * stride + x - left for x, y in offsets_xy.tolist()]
    pellets = tuple((shift, rows << shift) for shift in shifts)
    every = reduce(or_, (pellet for _, pellet in pellets))
    x, y = pattern.x + left, pattern.y + top
    weights = Weights(pattern.weights.each, stride) if pattern.weights else None
    return Scattered(x, y, wide, high, stride, every, Depths(every, stride, x, y), weights, pellets)


def restrided(rows: int, high: int, stride: int, wider: int) -> int:
    """So many rows of a stride as rows of a wider one."""
    if stride == wider:
        return rows
    size, gap = stride >> 3, bytes(wider - stride >> 3)
    data = rows.to_bytes(high * size, "little")
    return int.from_bytes(b"".join([data[k : k + size] + gap for k in range(0, len(data), size)]), "little")


class Squares(dict[tuple[int, int], Square]):
    """Squares by column and row, each made when it is first asked for; those beyond EDGE raise KeyError.

    Parameters
    ----------
    make : function of a place that returns a square, and may store it here
    """

    def __init__(self, make: Callable[[tuple[int, int]], Square]) -> None:
        super().__init__()
        self.make = make

    def __missing__(self, place: tuple[int, int]) -> Square:
        if max(map(abs, place)) >= EDGE:
            raise KeyError(place)
        return self.make(place)


class GroundCache:
    """The items as shots walk them, front to back; made for the first shot of each state of a scene."""

    def __init__(self, scene: Scene, pierce: bool) -> None:
        self.pierce = pierce
        self._scene = scene
        self._ground: Ground | None = None
        self._lock = threading.Lock()

    def read(self, stack: Stack) -> Ground:
        """The items of a stack."""
        with self._lock:
            ground = self._ground
            if ground is None or ground.stack is not stack:
                tiles = self._scene.items.tiles()
                boxes_xyxy = np.asfortranarray(tiles.boxes(stack.box_xyxy))  # sides are compared one by one
                ground = Ground(stack, tiles, boxes_xyxy, self.pierce, self._scene.bounds, stack.covers)
                self._ground = ground
            return ground


# house: way of areas
def look(fired: Round) -> tuple[Look, int]:
    """Function that looks up what a round hits, and the bytes kept for it."""
    plain, number, tell = fired.pattern.only_big(), fired.number, OneShot.append
    pattern = plain if fired.pellets_xy is None else scattered(plain, fired.pellets_xy)
    share, counted = pattern.share, pattern.counted
    stride, rows, nearest = pattern.stride, pattern.rows, pattern.depths.nearest
    first_x, first_y, wide, high = pattern.x, pattern.y, pattern.wide - 1, pattern.high - 1

    def look(x: int, y: int, hits: OneShot) -> None:
        """Append the hits on the tiles near a pixel to an answer, the nearest first."""
        near: PositionCache = hits._present.near
        ids = hits._present.stack.ids
        square = near.made[x >> CELL_SHIFT, y >> CELL_SHIFT]
        found: list[Hit] = []
        if square is UNMADE:
            found, square = near.walked(pattern, x, y), ()
        left, top = x + first_x, y + first_y
        right, bottom, tiles = left + wide, top + high, near.tiles(stride)
        for x_min, y_min, x_max, y_max, begin, rank in square:
            if x_min <= right and left <= x_max and y_min <= bottom and top <= y_max:
                bits = tiles.get(begin)
                if bits is None:
                    bits = near.read(tiles, begin)
                shift = (y_min - top) * stride + x_min - left
                hit = (bits << shift if shift >= 0 else bits >> -shift) & rows
                if hit:
                    (distance2, down, right_by), n = nearest(hit), hit.bit_count()
                    found.append((0, distance2, y + down, x + right_by, rank, n, share(hit, n)))
        for _, distance2, py, px, rank, n, part in in_order(found) if len(found) > 1 else found:
            samples, weight, pellets = counted(part, n)
            tell(hits, new(HitRow, (0, number, ids.item(rank), samples, n, weight, pellets, (px, py), distance2)))

    return look, pattern.nbytes


class PositionCache:
    """Squares of one scene for a weapon and its filter.

    Parameters
    ----------
    ground : the items as shots walk them
    reach : greatest distance of a pixel of a round from the round's own, px
    room : most memory of the squares, bytes
    made : visible tiles near each square; `prepare` reads it as `quick`, as a shot in an empty square needs no look-up
    """

    def __init__(self, scene: Scene, ground: GroundCache, kept: Filter, reach: int, room: int) -> None:
        self.made = Squares(self._asked)
        self.quick: Any = self.made
        self.nbytes, self._room = 0, room
        self._scene, self._ground, self._reach, self._view = scene, ground, reach, kept.view(ground.pierce)
        self._shots = kept.shot_at_origin(None, 0)
        self._stack: Stack | None = None
        self._visible: VisibleSet | None = None
        self._bigs: dict[int, BigTiles] = {}
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Read the scene as it is now."""
        with self._lock:
            self._stack, self._visible = stack, None
            self._clear()

    def _clear(self) -> None:
        self.made.clear()
        for tiles in self._bigs.values():
            tiles.clear()
        self.nbytes = 0

    def tiles(self, stride: int) -> BigTiles:
        """The visible tiles that shots have met, as integers of a stride."""
        tiles = self._bigs.get(stride)
        return self._bigs.setdefault(stride, BigTiles(stride)) if tiles is None else tiles

    def read(self, tiles: BigTiles, begin: int) -> int:
        """Make a visible tile as an integer."""
        visible = self._visible
        assert visible is not None  # squares list its tiles
        self.nbytes += tiles.nbytes_each
        return tiles.read(visible.seen.words, begin)

    def walked(self, pattern: BigPattern, x: int, y: int) -> list[Hit]:
        """Walk the tiles that a round at pixel (x, y) may meet; return what it hits, in order.

        Raises
        ------
        KeyError
            If there are so many tiles, and the round is so large, that `fire` is faster.
        """
        assert self._stack is not None  # `follow` is called first
        ground, left, top = self._ground.read(self._stack), x + pattern.x, y + pattern.y
        box = np.array([left, top, left + pattern.wide - 1, top + pattern.high - 1])
        tile = meets(box, ground.boxes_xyxy).nonzero()[0]
        self._lose(integers_ns(len(tile), pattern.wide, pattern.high))
        near = accepted((np.zeros_like(tile), tile), ground, self._shots, ZERO)
        return hit_by_one(pattern, x, y, near, ground)

    def _lose(self, ns: float) -> None:
        """Count the time of a walk, which a visible set would save; make the set once that pays."""
        items, visible, now = self._scene.items, self._scene.derived.visible(self._view), costs.NUMPY
        made = visible_ns(items.stack(), now)
        if visible.made(items) or visible.worth_building(now.integers_placement + ns, made):
            self._visible = visible.read(items)
        if ns > now.tiles_call:
            raise KeyError

    def _asked(self, place: tuple[int, int]) -> Square:
        """Square of a column and a row, which is made if it does not exist; UNMADE if there is no visible set."""
        visible = self._visible or self._scene.derived.visible(self._view).made(self._scene.items)
        if visible is None:
            return UNMADE
        with self._lock:
            self._visible = visible
            if self.nbytes > self._room:
                self._clear()
            if place not in self.made:
                square = self._square(visible, *(k << CELL_SHIFT for k in place))
                side = 2 * self._reach + 1
                crowded = integers_ns(len(square), side, side) > costs.NUMPY.tiles_call
                self.made[place] = UNMADE if crowded else square  # so each shot finds out whether `fire` is faster
                self.nbytes += CELL_BYTES + ENTRY_BYTES * len(square)
            return self.made[place]

    def _square(self, visible: VisibleSet, x: int, y: int) -> Square:
        """Visible tiles near the square that begins at a pixel, front to back."""
        seen, reach = visible.seen, self._reach
        box = np.array([x - reach, y - reach, x + SIDE - 1 + reach, y + SIDE - 1 + reach])
        near = meets(box, seen.box_xyxy).nonzero()[0]
        columns = (*seen.box_xyxy[near].T, seen.begin[near], seen.rank[near])
        return tuple(zip(*(column.tolist() for column in columns), strict=True))
