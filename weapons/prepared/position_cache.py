"""Position cache: squares of shot positions, each with the visible pixels of the objects near it.

A square is made when a shot first falls into it. The visible pixels of an object, as integer rows, are made when a
square first needs them. A change of the scene discards what lies near it. After all items have moved, shots walk the
items from front to back until enough shots were fired at the unchanged scene. `compiled` has the compiled form.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from hitplanes.planes.bits.tiles import BigPattern, Ground, big_pattern, hit_by_one, packed_integer, pays
from hitplanes.planes.common.caches import LruCache
from hitplanes.planes.common.checks import Bools
from hitplanes.planes.common.limits import POSITION_MAX, WEIGHT_FULL
from hitplanes.planes.grid.spans import Box, meets
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import sides_of

from ..fire.areas import accepted
from ..fire.hits import HitRow
from ..fire.prefilter import refused
from ..kinds.weapon import Weapon
from .one_shot import Answer, Filter, Frame, Round, answer_of, pattern_chunks

Kind = TypeVar("Kind")

CELL_SHIFT = 5
SIDE = 1 << CELL_SHIFT
"""Side of a square, px. A larger square has more objects near it; smaller squares are made more often."""

BLOCK_SHIFT = 2
"""Binary logarithm of the side of a block, in squares; the squares of a block share one list of items near it."""

TILE_MIN, TILE = 32, 64
"""Least and greatest side of a tile of an object, px; larger tiles are mostly empty where a shot falls."""

WALKS_LEAST = 4
"""Shots that walk in a square, after all items have moved, before it is made; making one takes as long as a few walks.
It is also made after this number of walks anywhere plus twice those between the last two moves of all items."""

WALKS_AT_FIRST = 64
"""Number of walks that is assumed before the first move of all items."""

WALKS_MOST = 2**12
"""Greatest number of walks that is remembered of the time before a move of all items."""

FEW = 8
"""Up to so many changed items, or up to a quarter of all, do not count as a move of all items."""

BIGS_BYTES = 2**25
"""Most memory of the patterns of shots that walk, for one prepared weapon, bytes."""

KEPT_BYTES = 64 * 2**20
"""Most memory of squares and tiles for one prepared weapon, bytes; beyond it all are discarded."""

EDGE = (POSITION_MAX >> CELL_SHIFT) - 2**12
"""Squares beyond this index are not made, so that a shot that finds a square needs no check of its range."""

FARTHEST = SIDE * EDGE // 2
"""Positions beyond this coordinate, px, are left to `fire`."""

PIXEL = 257 / 512
"""Offset, px: floor(v + PIXEL) is the pixel of a position, (rint(256 v) + 128) // 256, with ties to even."""

ODD = math.nextafter(1 - PIXEL, 0)
"""The only coordinate within the limits at which v + PIXEL is rounded up to a whole number."""

CELL_BYTES = 400
"""Memory of a square, bytes."""

SEEN_BYTES = 400
"""Memory of a cached tile in addition to its pixels, bytes."""

PIECE_BYTES = 200
"""Memory of a pattern chunk in addition to its pixels, bytes."""

CachedTile = tuple[int, int, int, int, int, int, int]
"""Visible part of a tile of an object: x_min, x_max, y_min, y_max of the positions from which a chunk can meet it; its
pixels as integer rows; their place, as a number of bits; and the object's id."""

Cell = tuple[CachedTile, ...]

UNMADE: Cell = ((0, -1, 0, -1, 0, 0, 0),)
"""Stands for a square that is not made yet."""

Shared = tuple[int, int, int, int, int, int]
"""Hit of a round on an object: squared distance, y and x of the nearest pixel, relative to the round's pixel; a number
that rises from front to back; id of the object; number of pixels."""

Look = Callable[[Any, Any, Answer], None]
"""Function (x, y, answer) that appends the hits of a round at pixel (x, y) to an answer, in order.

The compiled form takes any position, and raises KeyError or ValueError for one outside the range that it looks up.
"""

new = tuple.__new__
"""Makes a row in half the time that `HitRow` takes."""


ZERO = np.zeros(1, np.int64)
"""Number of the only shot, as a column."""


class Near(NamedTuple):
    """An item near a block of squares."""

    x: int
    y: int
    x_max: int
    y_max: int
    rank: int
    item: int
    blocks: bool


class Made(dict[int, "Column[Kind]"], Generic[Kind]):
    """Squares as [i][j], each made when it is first asked for; those beyond EDGE raise KeyError.

    Parameters
    ----------
    make : function of i and j that returns a square, and may store it here
    """

    def __init__(self, make: Callable[[int, int], Kind]) -> None:
        super().__init__()
        self.make = make

    def __missing__(self, i: int) -> Column[Kind]:
        if not -EDGE < i < EDGE:
            raise KeyError(i)
        return self.setdefault(i, Column(self, i))


class Column(dict[int, Kind]):
    """Squares of one column i."""

    def __init__(self, made: Made[Kind], i: int) -> None:
        super().__init__()
        self.made, self.i = made, i

    def __missing__(self, j: int) -> Kind:
        if not -EDGE < j < EDGE:
            raise KeyError(j)
        return self.made.make(self.i, j)


class PositionCache:
    """Squares of one scene for a weapon and its filter.

    The integer rows of a pattern, `stride` bits each, are shifted by `y * stride + x - place` to lie on a tile.

    Parameters
    ----------
    made : cached tiles near each square
    quick : `made` if rounds are looked up whole, so that a shot in an empty square needs no look-up; else empty
    """

    def __init__(self, scene: Scene, weapon: Weapon, pierce: bool, kept: Filter, frame: Frame) -> None:
        self.made: Made[Cell] = Made(self._asked)
        self._walked: dict[tuple[int, int], int] = {}  # walks since the last move of all items, by square
        self._walks, self._before = WALKS_AT_FIRST, 0  # walks since the last such move, and between the last two
        self._bigs: LruCache[object, BigPattern] = LruCache(BIGS_BYTES, lambda big: big.nbytes)
        self._crowded = False  # whether a walk was more expensive than `fire`
        self.stride = self._tile = 0
        self._tell = answer_of(weapon)[1]
        self._scene, self._shots, self._pierce = scene, kept.shots(weapon, (0, 0), (None, None, None)), pierce
        self._frame, self._corner, self._side = frame, frame.corner, frame.side
        self._stack: Stack | None = None
        self._ground: Ground | None = None
        self._seen = -1
        self._blocks: dict[tuple[int, int], list[Near]] = {}
        self._tiles: dict[int, dict[tuple[int, int], CachedTile]] = {}
        self.quick: Any = {} if frame.tiled else self.made
        self._cut = frame.tiled  # whether a round is looked up in several chunks
        self.nbytes = 0
        self._lock = threading.Lock()

    # house: way of areas
    # house: row order
    def look(self, one: Round) -> tuple[Look, int]:
        """Function that looks up what a round hits, and the bytes kept for it."""
        made, stride, number, tell = self.made, self.stride, one.number, self._tell
        pieces, own = pattern_chunks(one.spans, self._frame, stride), object()

        def look(x: int, y: int, hits: Answer) -> None:
            """Append the hits on the tiles near a pixel to an answer, the nearest first."""
            shared: list[Shared] = []
            for dx, dy, rows, depths in pieces:
                left, top = x + dx, y + dy
                cell = made[left >> CELL_SHIFT][top >> CELL_SHIFT]
                if cell is UNMADE:
                    for distance2, py, px, item, n in self._hit_by(one, own, x, y):
                        tell(hits, new(HitRow, (0, number, item, n, n, n * WEIGHT_FULL, 1, (px, py), distance2)))
                    return
                for x_min, x_max, y_min, y_max, bits, place, item in cell:
                    if x_min <= left <= x_max and y_min <= top <= y_max:
                        shift = top * stride + left - place
                        hit = (bits >> shift if shift >= 0 else bits << -shift) & rows
                        if hit:
                            shared.append((*depths.nearest(hit), len(shared), item, hit.bit_count()))  # front to back
            if len(shared) > 1:
                if self._cut:
                    shared = _gathered(shared)
                shared.sort()
            for distance2, dy, dx, _, item, n in shared:
                tell(hits, new(HitRow, (0, number, item, n, n, n * WEIGHT_FULL, 1, (x + dx, y + dy), distance2)))

        return look, sum(PIECE_BYTES + depths.nbytes for *_, depths in pieces)

    def _hit_by(self, one: Round, own: object, x: int, y: int) -> Iterator[tuple[int, int, int, int, int]]:
        """Walk the tiles that a round may meet; yield squared distance, y, x, id and count of each object that it hits.

        Parameters
        ----------
        own : key that no other round has

        Raises
        ------
        KeyError
            If there are so many tiles, and the round is so large, that `fire` is faster.
        """
        pattern, ground = self._bigs.get(own, lambda: big_pattern(one.spans)), self._walked_on()
        left, top = x + pattern.x, y + pattern.y
        box = np.array([left, top, left + pattern.wide - 1, top + pattern.high - 1])
        tile = meets(box, ground.boxes_xyxy).nonzero()[0]
        if not pays(len(tile), pattern.wide, pattern.high):
            self._crowded = True
            raise KeyError(x, y)
        square = x >> CELL_SHIFT, y >> CELL_SHIFT
        self._walked[square] = self._walked.get(square, 0) + 1
        self._walks += 1
        near = accepted((np.zeros_like(tile), tile), ground, self._shots, ZERO)
        for _, distance2, py, px, rank, n in hit_by_one(pattern, x, y, near, ground):
            yield distance2, py, px, ground.stack.ids.item(rank), n

    def _walked_on(self) -> Ground:
        """Items that shots walk; made for the first of them."""
        with self._lock:
            if self._ground is None:
                stack, tiles = self._stack, self._scene.items.tiles()
                assert stack is not None  # `follow` is called first
                boxes_xyxy = np.asfortranarray(tiles.boxes(stack.box_xyxy))  # sides are compared one by one
                self._ground = Ground(stack, tiles, boxes_xyxy, self._pierce, self._scene.bounds)
            return self._ground

    def follow(self, stack: Stack) -> None:
        """Read the scene as it is now, and discard what lies near a change."""
        with self._lock:
            items = self._scene.items
            if self._stack is None:
                largest = int((stack.box_xyxy[:, 2:] - stack.box_xyxy[:, :2]).max(initial=0)) + 1
                self._tile = min(max(largest, TILE_MIN), TILE) if len(stack) else TILE
                self.stride = self._side + self._tile - 1
            if self._all_moved(stack):
                self._before, self._walks, self._crowded = min(self._walks, WALKS_MOST), 0, False
                self._walked.clear()
                self._clear()
            elif not self._forget(stack):
                self._clear()
            self._blocks.clear()
            self._ground = None
            self._stack, self._seen = stack, items.version

    def _all_moved(self, stack: Stack) -> bool:
        """Whether so many items changed that it counts as a move of all; False for the first scene."""
        if self._stack is None:
            return False
        changes = self._scene.items.changes(self._seen)
        if changes is None:
            return True
        ids = [np.ravel(ids) for _, ids, _, _ in changes]
        few = min(max(len(stack) // 4, FEW), max(len(stack) - 1, 0))
        return sum(map(len, ids)) > few and len(np.unique(np.concatenate(ids)) if len(ids) > 1 else ids[0]) > few

    def _clear(self) -> None:
        self.made.clear()
        self._tiles.clear()
        self.nbytes = 0

    def _forget(self, stack: Stack) -> bool:
        """Discard what lies near a change; False if the changes are not known, or if it is cheaper to discard all."""
        items, wide = self._scene.items, (SIDE + self._side) >> CELL_SHIFT
        boxes_xyxy, ids = items.changed_boxes(self._seen), items.changed_ids(self._seen)
        if boxes_xyxy is None or ids is None or len(boxes_xyxy) * wide * wide > sum(map(len, self.made.values())):
            return False
        hidden = meets(boxes_xyxy[:, None], stack.box_xyxy).any(axis=0)
        for item in (*ids.tolist(), *stack.ids[hidden].tolist()):
            for seen in self._tiles.pop(item, {}).values():
                self.nbytes -= _bytes(seen)
        for x, y, x_max, y_max in np.concatenate([boxes_xyxy, stack.box_xyxy[hidden]]).tolist():
            for i in range(
                (x - self._corner - self._side + 1) >> CELL_SHIFT, ((x_max - self._corner) >> CELL_SHIFT) + 1
            ):
                column: dict[int, Cell] = self.made.get(i, {})
                first, last = (y - self._corner - self._side + 1) >> CELL_SHIFT, (y_max - self._corner) >> CELL_SHIFT
                for j in range(first, last + 1) if column else ():
                    if j in column:
                        self.nbytes -= _size(column.pop(j))
        return True

    def _asked(self, i: int, j: int) -> Cell:
        """Square (i, j), or UNMADE if it is not worth making yet."""
        if self._crowded:
            return UNMADE
        often = self._walks >= WALKS_LEAST + 2 * self._before or self._walked.get((i, j), 0) >= WALKS_LEAST
        return self._square(i, j) if often else UNMADE

    def _square(self, i: int, j: int) -> Cell:
        """Square (i, j); it is made if it does not exist."""
        with self._lock:
            if self.nbytes > KEPT_BYTES:
                self._clear()
            column = self.made[i]
            if j not in column:
                column[j] = self._found(i, j)
                self.nbytes += _size(column[j])
            return column[j]

    def _found(self, i: int, j: int) -> Cell:
        """Cached tiles of the objects near a square."""
        left, top = (i << CELL_SHIFT) + self._corner, (j << CELL_SHIFT) + self._corner
        right, low = left + SIDE + self._side - 2, top + SIDE + self._side - 2
        near, tile, found = self._near(i, j), self._tile, []
        for one in near:
            x, y, x_max, y_max, _, item, blocks = one
            if blocks or x > right or y > low or x_max < left or y_max < top:
                continue
            tiles = self._tiles.setdefault(item, {})
            for row in range(max(top - y, 0) // tile, (min(low, y_max) - y) // tile + 1):
                for column in range(max(left - x, 0) // tile, (min(right, x_max) - x) // tile + 1):
                    seen = tiles.get((column, row))
                    if seen is None:
                        seen = tiles[column, row] = self._tile_of(one, column, row, near)
                    if seen[4]:
                        found.append(seen)
        return tuple(found)

    def _near(self, i: int, j: int) -> list[Near]:
        """Accepted items near the block of a square, and those that may hide them, front to back."""
        key = i >> BLOCK_SHIFT, j >> BLOCK_SHIFT
        found = self._blocks.get(key)
        if found is None:
            stack, side = self._stack, SIDE << BLOCK_SHIFT
            assert stack is not None  # `follow` is called first
            left, top = (k * side + self._corner - self._tile for k in key)
            reach = side + self._side + 2 * self._tile
            rank = np.flatnonzero(meets(np.array([left, top, left + reach, top + reach]), stack.box_xyxy))
            rank = rank[~refused(stack, rank, self._shots, np.zeros(len(rank), np.int64))]
            columns = (*stack.box_xyxy[rank].T, rank, stack.ids[rank], stack.occluder[rank])
            rows = zip(*(column.tolist() for column in columns), strict=True)
            found = self._blocks[key] = list(map(Near._make, rows))
        return found

    # house: hit rule of areas
    def _tile_of(self, one: Near, column: int, row: int, near: list[Near]) -> CachedTile:
        """Visible part, within the bounds, of a tile of an object."""
        self._cut |= column > 0 or row > 0
        x, y = one.x + column * self._tile, one.y + row * self._tile
        x_max, y_max = min(one.x_max, x + self._tile - 1), min(one.y_max, y + self._tile - 1)
        mask = self._part(one, (x, y, x_max, y_max)).copy()
        for other in near:
            left, top, right, low, rank, _, blocks = other
            if rank >= one.rank:
                break
            if left <= x_max and right >= x and top <= y_max and low >= y and (blocks or not self._pierce):
                part = max(x, left), max(y, top), min(x_max, right), min(y_max, low)
                mask[part[1] - y : part[3] - y + 1, part[0] - x : part[2] - x + 1] &= ~self._part(other, part)
        if self._scene.bounds is not None:
            left, top, right, low = self._scene.bounds
            mask[: max(top - y, 0)] = mask[max(low - y + 1, 0) :] = False
            mask[:, : max(left - x, 0)] = mask[:, max(right - x + 1, 0) :] = False
        seen = self._placed(mask, x - self._corner, y - self._corner, one.item)
        self.nbytes += _bytes(seen)
        return seen

    def _placed(self, mask: Bools, x: int, y: int, item: int) -> CachedTile:
        """Cached tile of a mask at (x, y), cropped to its visible pixels."""
        (left, top, right, low), pixels = sides_of(mask)
        if not pixels:
            return 0, -1, 0, -1, 0, 0, item
        box = x + left - self._side + 1, x + right, y + top - self._side + 1, y + low
        bits = packed_integer(mask[top : low + 1, left : right + 1], self.stride)
        return (*box, bits, (y + top) * self.stride + x + left, item)

    def _part(self, one: Near, box: Box) -> Bools:
        """Mask of an item within a part of its box."""
        assert self._stack is not None
        x, y, x_max, y_max = box
        return self._stack.mask(one.rank)[y - one.y : y_max - one.y + 1, x - one.x : x_max - one.x + 1]


def _gathered(shared: list[Shared]) -> list[Shared]:
    """Sum the hits of several tiles or chunks up by object."""
    every: dict[int, Shared] = {}
    for one in shared:
        other = every.get(one[4])
        every[one[4]] = one if other is None else (*min(one[:4], other[:4]), one[4], one[5] + other[5])
    return list(every.values())


def _bytes(seen: CachedTile) -> int:
    """Bytes of a cached tile."""
    return SEEN_BYTES + seen[4].bit_length() // 7


def _size(cell: Cell) -> int:
    """Bytes of a square."""
    return CELL_BYTES + 8 * len(cell)
