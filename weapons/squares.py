"""Squares of shot positions, each with the objects that a pattern fired from there may hit, and what is seen of them.

A square is made when the first shot falls into it, and what is seen of an object when the first square needs it: its
mask without what lies before it. After a change of the scene those near what changed are made anew.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from planes.arrays import Bools, Ints
from planes.bigrows import packed, struck_from, window
from planes.constants import POSITION_MAX
from planes.items import Stack
from planes.scene import Scene
from planes.spans import Box, Spans, meets
from weapons.candidates import refused
from weapons.volley import Shots

__all__ = ["CELL_SHIFT", "Cell", "Cells", "Seen", "Square", "Squares"]

CELL_SHIFT = 5
SIDE = 1 << CELL_SHIFT
"""Side of a square, px: of a larger one more objects lie near, of a smaller one more squares must be made."""

BLOCK_SHIFT = 2
"""A square looks for items in those near its block, of 2**2 x 2**2 squares."""

TILE_MIN, TILE = 32, 64
"""Objects are looked up whole, or in tiles of so many px a side: of a larger one most is empty where a shot falls."""

OFTEN = 16
"""Shots into a square after which their answers are tabled: that takes some 100 us, and saves up to 5 us a shot."""

TABLED_MAX = 62
"""Objects near a square whose answers are tabled: a bit for each in an int64."""

KEPT_BYTES = 64 * 2**20
"""Squares and objects kept for one prepared weapon, bytes; beyond it all are made anew."""

EDGE = (POSITION_MAX >> CELL_SHIFT) - 2**12
"""Squares so near to the largest position are not kept: a shot that finds one needs no check of its range."""

NOWHERE = bytes(SIDE * SIDE)
"""Table of a square from where nothing is hit."""

CELL_BYTES, SEEN_BYTES, ANSWER_BYTES = 400, 300, 60
"""What a square costs, what is seen of an object beside its pixels, and an answer, bytes."""

BYTE = 256
"""Answers whose numbers fit one byte."""


Seen = tuple[int, int, int]
"""Of a tile of an object: id, what is seen of it as integer rows, and its place as a number of bits in the world."""

Cell = tuple[Seen, ...]

Square = tuple[Cell, bytes | memoryview | None, tuple[tuple[int, ...], ...]]
"""Of a square of shot positions: what is seen of the objects around it; for each of its pixels the number of its
answer, if it was shot at often; and these answers, sets of objects that are hit. (Plain tuples are read fastest.)"""

Squares = dict[int, dict[int, Square]]
"""Squares (i, j): of the pixels from 32 i and 32 j on."""


class Near(NamedTuple):
    """An item near a block of squares."""

    x: int
    y: int
    x_max: int
    y_max: int
    rank: int
    item: int
    blocks: bool


class Cells:
    """Squares of one scene for patterns within one box, for one filter.

    A pattern's row `stride` bits long is shifted by `y * stride + x - place` to lie on a tile of an object.

    Parameters
    ----------
    scene, shots, pierce : what is fired at, one shot with its filter, and whether it goes through objects
    corner, side : the box of the pattern begins at (corner, corner) from the pixel where it is looked up
    """

    def __init__(self, scene: Scene, shots: Shots, pierce: bool, corner: int, side: int) -> None:
        self.made: Squares = {}
        self.stride = self._tile = 0
        self._scene, self._shots, self._pierce = scene, shots, pierce
        self._corner, self._side = corner, side
        self._stack: Stack | None = None
        self._seen = -1
        self._blocks: dict[tuple[int, int], list[Near]] = {}
        self._tiles: dict[int, dict[tuple[int, int], Seen]] = {}
        self._place_of: dict[Seen, tuple[int, int]] = {}
        self._struck: dict[Seen, int] = {}
        self._shot_at: dict[tuple[int, int], int] = {}
        self.nbytes = 0
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Take note of the scene as it is now: what lies near a change is forgotten."""
        with self._lock:
            items = self._scene.items
            if self._stack is None:
                largest = int((stack.box_xyxy[:, 2:] - stack.box_xyxy[:, :2]).max(initial=0)) + 1
                self._tile = min(max(largest, TILE_MIN), TILE) if len(stack) else TILE
                self.stride = self._side + self._tile + SIDE
            boxes, ids = items.changed_boxes(self._seen), items.changed_ids(self._seen)
            if boxes is None or ids is None or not self._forget(boxes, ids, stack):
                self._clear()
            self._blocks.clear()
            self._stack, self._seen = stack, items.version

    def _clear(self) -> None:
        self.made.clear()
        for kept in (self._tiles, self._place_of, self._struck, self._shot_at):
            kept.clear()
        self.nbytes = 0

    def _forget(self, boxes_xyxy: Ints, ids: Ints, stack: Stack) -> bool:
        """Forget what lies near boxes; False if that is so much that all may as well go."""
        wide = (SIDE + self._side) >> CELL_SHIFT
        if len(boxes_xyxy) * wide * wide > sum(map(len, self.made.values())):
            return not len(boxes_xyxy)
        hidden = meets(boxes_xyxy[:, None], stack.box_xyxy).any(axis=0)
        for item in (*ids.tolist(), *stack.ids[hidden].tolist()):
            for seen in self._tiles.pop(item, {}).values():
                self._place_of.pop(seen, None)
                self.nbytes -= _bytes(seen[1]) + _bytes(self._struck.pop(seen, 0))
        for x, y, x_max, y_max in np.concatenate([boxes_xyxy, stack.box_xyxy[hidden]]).tolist():
            for i in range(
                (x - self._corner - self._side + 1) >> CELL_SHIFT, ((x_max - self._corner) >> CELL_SHIFT) + 1
            ):
                column = self.made.get(i, {})
                first, last = (y - self._corner - self._side + 1) >> CELL_SHIFT, (y_max - self._corner) >> CELL_SHIFT
                for j in range(first, last + 1) if column else ():
                    self._shot_at.pop((i, j), None)
                    if j in column:
                        self.nbytes -= _size(column.pop(j))
        return True

    def square(self, i: int, j: int) -> Square:
        """The square (i, j), which is made if it is not there."""
        with self._lock:
            if self.nbytes > KEPT_BYTES:
                self._clear()
            column = self.made.get(i, {})
            if j in column:
                return column[j]
            near = self._found(i, j)
            square: Square = (near, None if near else NOWHERE, ((),))
            if max(abs(i), abs(j)) < EDGE:
                self.made.setdefault(i, column)[j] = square
                self.nbytes += _size(square)
            return square

    def count(self, i: int, j: int, pattern: Spans) -> None:
        """Note a shot into a square without a table; of one that is shot at often the answers are tabled."""
        shots = self._shot_at[i, j] = self._shot_at.get((i, j), 0) + 1
        if shots < OFTEN:
            return
        with self._lock:
            square = self.made.get(i, {}).get(j)
            if square is not None and square[1] is None and len(square[0]) <= TABLED_MAX:
                tabled = self.made[i][j] = self._tabled(i * SIDE, j * SIDE, square[0], pattern)
                self.nbytes += _size(tabled) - _size(square)

    def _tabled(self, x: int, y: int, near: Cell, pattern: Spans) -> Square:
        """A square with the answer of each pixel, for a pattern in the box."""
        codes = np.zeros((SIDE, SIDE), np.int64)
        for bit, seen in enumerate(near):
            left, top = self._place_of[seen]
            struck = self._struck.get(seen)
            if struck is None:
                struck = self._struck[seen] = struck_from(seen[1], pattern, self._side, self.stride)
                self.nbytes += _bytes(struck)
            across, down = x - left + self._side - 1, y - top + self._side - 1
            codes |= window(struck, across, down, SIDE, self.stride).astype(np.int64) << bit
        distinct, which = np.unique(codes, return_inverse=True)
        items = [item for item, _, _ in near]
        answers = tuple(
            tuple(dict.fromkeys(item for bit, item in enumerate(items) if code >> bit & 1))
            for code in distinct.tolist()
        )
        if len(distinct) <= BYTE:
            return near, which.astype(np.uint8).tobytes(), answers
        return near, memoryview(which.astype(np.uint16).tobytes()).cast("H"), answers

    def _found(self, i: int, j: int) -> Cell:
        """What is seen of the objects in the surroundings of a square."""
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
                    if seen[1]:
                        found.append(seen)
        return tuple(found)

    def _near(self, i: int, j: int) -> list[Near]:
        """Accepted items near the block of a square, and around those, front to back."""
        key = i >> BLOCK_SHIFT, j >> BLOCK_SHIFT
        found = self._blocks.get(key)
        if found is None:
            stack, side = self._stack, SIDE << BLOCK_SHIFT
            assert stack is not None  # `follow` goes before
            left, top = (k * side + self._corner - self._tile for k in key)
            reach = side + self._side + 2 * self._tile
            rank = np.flatnonzero(meets(np.array([left, top, left + reach, top + reach]), stack.box_xyxy))
            rank = rank[~refused(stack, rank, self._shots, np.zeros(len(rank), np.int64))]
            columns = (*stack.box_xyxy[rank].T, rank, stack.ids[rank], stack.occluder[rank])
            rows = zip(*(column.tolist() for column in columns), strict=True)
            found = self._blocks[key] = list(map(Near._make, rows))
        return found

    def _tile_of(self, one: Near, column: int, row: int, near: list[Near]) -> Seen:
        """A tile of an object without what lies before it, or out of the bounds."""
        x, y = one.x + column * self._tile, one.y + row * self._tile
        box = x, y, min(one.x_max, x + self._tile - 1), min(one.y_max, y + self._tile - 1)
        mask = self._part(one, box).copy()
        for other in near:
            if other.rank >= one.rank:
                break
            if other.blocks or not self._pierce:
                part = max(x, other.x), max(y, other.y), min(box[2], other.x_max), min(box[3], other.y_max)
                if part[0] <= part[2] and part[1] <= part[3]:
                    mask[part[1] - y : part[3] - y + 1, part[0] - x : part[2] - x + 1] &= ~self._part(other, part)
        if self._scene.bounds is not None:
            left, top, right, low = self._scene.bounds
            mask[: max(top - y, 0)] = mask[max(low - y + 1, 0) :] = False
            mask[:, : max(left - x, 0)] = mask[:, max(right - x + 1, 0) :] = False
        left, top = x - self._corner, y - self._corner
        seen = one.item, packed(mask, self.stride), top * self.stride + left
        self._place_of[seen] = left, top
        self.nbytes += _bytes(seen[1])
        return seen

    def _part(self, one: Near, box: Box) -> Bools:
        """Mask of an item in a box inside of its own."""
        assert self._stack is not None
        x, y, x_max, y_max = box
        return self._stack.mask(one.rank)[y - one.y : y_max - one.y + 1, x - one.x : x_max - one.x + 1]


def _bytes(bits: int) -> int:
    """Bytes of what is kept of a tile of an object; none of nothing."""
    return SEEN_BYTES + bits.bit_length() // 7 if bits else 0


def _size(square: Square) -> int:
    """Bytes of a square."""
    near, table, answers = square
    size = CELL_BYTES + 8 * len(near)
    if table is not None and table is not NOWHERE:
        size += 2 * SIDE * SIDE + sum(ANSWER_BYTES + 8 * len(answer) for answer in answers)
    return size
