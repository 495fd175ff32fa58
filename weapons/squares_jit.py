"""The squares of `squares`, compiled: each shot walks the stack from the front, and a square tells if that is needed.

One call answers a shot. A call of a compiled function takes 100 ns more for each array that it is given, so this one
is given addresses: of the scene, of the pixels of a round, and of a buffer for what they share.
"""

from __future__ import annotations

import struct
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types
from numba.extending import intrinsic

from planes import cells_jit
from planes.arrays import Ints
from planes.bitrows import WORD, Words
from planes.bitrows_jit import shared
from planes.cells import Cells
from planes.compiled import compiled
from planes.constants import WEIGHT_FULL
from planes.items import Stack
from planes.scene import Scene
from planes.spans import Spans
from planes.visible import View
from weapons.hits import HitRow
from weapons.oneshot import Answer, Filter
from weapons.pieces import Frame, Round
from weapons.squares import CELL_SHIFT, SIDE, Look, Made, new
from weapons.weapon import Weapon

__all__ = ["Squares"]

SQUARES_MOST = 2**18
"""Squares of which it is kept whether anything is near: some 25 MB."""

LISTED_NS, CELLS_NS = 100, 10**5
"""What it takes to list a tile by cells, and all of them beside that; to look at one takes a ns. When as much was spent
on looking at all of them, they are listed: so the cost is never more than twice that of the better choice."""

ROWS = 256
"""Rows that a buffer has room for at first."""

read = struct.Struct("=6q").unpack_from
"""What a round shares with an object, 48 bytes: see `squares.Shared`."""

PIECE_BYTES = 400
"""What a piece costs beside its pixels, bytes."""

FAR = 2**42
"""Beyond all positions."""

X, Y, BITS, WIDE, HIGH, BEGIN, LISTED, BOX, TILE, TILES, WORDS, LEFT, TOP, RIGHT, LOW, PIERCE, LOOKED, WORTH = range(18)
"""Of a scene: its cells; addresses of their lists, and of the columns and words of its tiles; how many tiles; its
bounds; whether shots go through objects; tiles looked at since it changed, and at how many it is worth listing them."""

ROUND_LEFT, ROUND_TOP, ROUND_RIGHT, ROUND_LOW, PIXELS = range(5)
"""Of a round: its box about its pixel, and from where on its words lie: columns of 64 px, with an empty one before and
after, and PAD empty rows below."""

PAD = 8
"""Rows are counted so many at a time."""

ROOM, FOUND = range(2)
"""Of a buffer: how many rows it has room for; from where on they lie, and after them room for what is left of a round
when something was hit."""


@intrinsic
def _pointer(_: Any, address: Any) -> Any:
    """An address as a pointer."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.int64), made


@njit(inline="always")
def _ints(address):
    """Whole numbers at an address: as many as there are, which nothing checks."""
    return carray(_pointer(address), (2**40,), np.int64)


@njit(inline="always")
def _words(address):
    """The same, as words."""
    return carray(_pointer(address), (2**40,), np.uint64)


@njit
def _cut(pixels, rest, left, top, wide, step, scene):
    """Copy the words of a round, without what lies out of the bounds."""
    full = np.uint64(2**64 - 1)
    for column in range(wide):
        x = left + 64 * (column - 1)
        before, after = scene[LEFT] - x, x + 63 - scene[RIGHT]
        inside = np.uint64(0)
        if before < 64 and after < 64:
            inside = (full << np.uint64(max(before, 0))) & (full >> np.uint64(max(after, 0)))
        for row in range(step):
            kept = inside if scene[TOP] <= top + row <= scene[LOW] else np.uint64(0)
            rest[column * step + row] = pixels[column * step + row] & kept


@njit
def _erased(tiles, tile, rest, word, step, shift, low, high):
    """Take the pixels of a tile out of what is left of a round, in rows from `low` to `high` of the world."""
    for row in range(low, high + 1):
        rest[word + row] &= ~(tiles[tile + row] << np.uint64(shift))
        if shift:
            rest[word + step + row] &= ~(tiles[tile + row] >> np.uint64(64 - shift))


@njit(inline="always")
def _sooner(found, a, b):
    for k in range(3):
        if found[a + k] != found[b + k]:
            return found[a + k] < found[b + k]
    return found[a + 3] < found[b + 3]


@njit
def _in_order(found, count):
    """Sort rows by (distance2, y, x, place in the stack)."""
    step = 1
    while step < count // 3:
        step = 3 * step + 1
    while step:  # Shell (1959): a few rows are what there mostly is
        for row in range(step, count):
            at, other = 6 * row, 6 * (row - step)
            while other >= 0 and _sooner(found, at, other):
                for k in range(6):
                    moved = found[at + k]
                    found[at + k] = found[other + k]
                    found[other + k] = moved
                at, other = other, other - 6 * step
        step //= 3


@njit
def _noted(found, at, new, distance2, y, x, samples):
    """Begin a row, or add another tile of the same object to it."""
    found[at + 5] = samples + (0 if new else found[at + 5])
    nearer = new or distance2 < found[at]
    if not nearer and distance2 == found[at]:
        nearer = y < found[at + 1] or (y == found[at + 1] and x < found[at + 2])
    if nearer:
        found[at], found[at + 1], found[at + 2] = distance2, y, x


@compiled(types.int64(*[types.int64] * 5))
def _shot(scene_at, round_at, x, y, buffer_at):
    """Rows of a round placed on a pixel, which may be more than the buffer has room for; -1 if cells are worth it."""
    scene, shape, buffer = _ints(scene_at), _ints(round_at), _ints(buffer_at)
    column, line = (x - scene[X]) >> scene[BITS], (y - scene[Y]) >> scene[BITS]
    if column < 0 or line < 0 or column >= scene[WIDE] or line >= scene[HIGH]:
        return 0
    begin, lists = _ints(scene[BEGIN]), _ints(scene[LISTED])
    cell = line * scene[WIDE] + column
    scene[LOOKED] += begin[cell + 1] - begin[cell]
    if scene[LOOKED] > scene[WORTH]:
        return -1
    boxes, columns, tiles = _ints(scene[BOX]), _ints(scene[TILE]), _words(scene[WORDS])
    left, top, right, bottom = x + shape[ROUND_LEFT], y + shape[ROUND_TOP], x + shape[ROUND_RIGHT], y + shape[ROUND_LOW]
    step, wide = bottom - top + 1 + PAD, ((right - left) >> 6) + 3
    found = _ints(buffer_at + 8 * FOUND)
    pixels, left_over = _words(round_at + 8 * PIXELS), _words(buffer_at + 8 * (FOUND + 6 * buffer[ROOM]))
    rest, whole = pixels, True
    if left < scene[LEFT] or top < scene[TOP] or right > scene[RIGHT] or bottom > scene[LOW]:
        _cut(pixels, left_over, left, top, wide, step, scene)
        rest, whole = left_over, False
    count, last = 0, -1
    for entry in range(begin[cell], begin[cell + 1]):
        at = lists[entry]
        tile_left, tile_top = boxes[4 * at], boxes[4 * at + 1]
        if tile_left > right or tile_top > bottom or boxes[4 * at + 2] < left or boxes[4 * at + 3] < top:
            continue
        low, deep = max(tile_top, top), min(boxes[4 * at + 3], bottom)
        across = tile_left - left + 64
        word, shift, tile = (across >> 6) * step - top, across & 63, columns[4 * at] - tile_top
        if not columns[4 * at + 3]:
            own = x - tile_left
            samples, distance2, dx, dy = shared(tiles, tile, rest, word, step, shift, low, deep, own, y)
            if samples == 0:
                continue
            rank = columns[4 * at + 1]
            new = rank != last
            count, last = count + new, rank
            if count <= buffer[ROOM]:
                _noted(found, 6 * (count - 1), new, distance2, dy, dx, samples)
                found[6 * count - 3], found[6 * count - 2] = rank, columns[4 * at + 2]
            if scene[PIERCE]:
                continue
        if whole:
            for place in range(wide * step):
                left_over[place] = pixels[place]
            rest, whole = left_over, False
        _erased(tiles, tile, rest, word, step, shift, low, deep)
    if count <= buffer[ROOM]:
        _in_order(found, count)
    return count


@compiled(types.boolean(*[types.int64] * 5))
def _any_near(scene_at, left, top, right, bottom):
    """Whether any tile of an object meets a box."""
    scene = _ints(scene_at)
    boxes, columns = _ints(scene[BOX]), _ints(scene[TILE])
    for at in range(0, 4 * scene[TILES], 4):
        met = (boxes[at] <= right) & (boxes[at + 1] <= bottom) & (boxes[at + 2] >= left) & (boxes[at + 3] >= top)
        if met and not columns[at + 3]:
            return True
    return False


def _bare(compiled: Any) -> Any:
    """A compiled function without the choice among its types, which takes twice as long as the call."""
    return compiled.overloads[compiled.signatures[0]].entry_point


shot, any_near = _bare(_shot), _bare(_any_near)


def _address(array: Any) -> int:
    """Where an array lies: it must be kept as long as that is used."""
    assert array.flags.c_contiguous
    return int(array.__array_interface__["data"][0])


@dataclass(frozen=True, eq=False)
class Here:
    """A scene at one version, as `_shot` reads it, and what must be kept for that."""

    address: int
    numbers: Ints
    boxes: Ints
    kept: tuple[Any, ...]


Buffer = tuple[int, int, memoryview, Ints]
"""Its address, for how many rows it has room, and its bytes."""


class Squares:
    """See `squares.Squares`; `made` tells of each square whether any object is near, so that a shot must be walked."""

    def __init__(self, scene: Scene, weapon: Weapon, pierce: bool, kept: Filter, frame: Frame) -> None:
        self.made: Made[bool] = Made(self._near)
        self.whole = True
        self._scene, self._reach = scene, frame.reach
        self._words = (2 * frame.reach + 1 + PAD) * (2 * frame.reach // WORD + 3)
        self._view = View(pierce, kept.accept, tuple(set(kept.exclude[0].tolist()) - {-1}))
        self._here: Here
        self._forms = -1
        self._tiles: tuple[Ints | None, Ints, Words]
        self._count = 0
        self._buffers: list[Buffer] = []
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Take note of the scene as it is now."""
        with self._lock:
            tiles = self._scene.items.tiles()
            boxes = tiles.boxes(stack.box_xyxy)
            if stack.forms != self._forms:
                there = np.flatnonzero(self._view.accepts(stack)[tiles.rank])
                rank = tiles.rank[there]
                columns = np.stack([tiles.begin[there], rank, stack.ids[rank], stack.occluder[rank]], axis=1)
                which = None if len(there) == len(tiles) else there
                self._forms, self._tiles = stack.forms, (which, columns, tiles.words)
            which = self._tiles[0]
            boxes = np.ascontiguousarray(boxes if which is None else boxes[which])
            begin, listed = np.array([0, len(boxes)]), np.arange(len(boxes))
            everywhere = Cells(-FAR, -FAR, FAR.bit_length(), 1, 1, begin, listed)
            self._here = self._placed(boxes, everywhere, CELLS_NS + LISTED_NS * len(boxes))
            self.made.clear()
            self._count = 0

    def _placed(self, boxes: Ints, cells: Cells, worth: int) -> Here:
        _, columns, words = self._tiles
        kept = (cells.begin, cells.listed, boxes, columns)
        bounds = self._scene.bounds or (-FAR, -FAR, FAR, FAR)
        numbers = np.array(
            [*cells[:5], *map(_address, kept), len(boxes), _address(words), *bounds, self._view.pierce, 0, worth],
            np.int64,
        )
        return Here(_address(numbers), numbers, boxes, (*kept, words))

    def _list(self) -> None:
        """List the tiles by cells, as many shots were fired at one version."""
        with self._lock:
            if self._here.numbers[WORTH] < FAR:
                boxes, reach = self._here.boxes, self._reach
                cells = cells_jit.cells_of(boxes, np.array([-reach, -reach, reach, reach]), CELL_SHIFT)
                self._here = self._placed(boxes, cells, 2**62)

    def _near(self, i: int, j: int) -> bool:
        """Whether an object is near the square (i, j)."""
        side = SIDE + 2 * self._reach
        left, top = i * SIDE - self._reach, j * SIDE - self._reach
        here = self._here
        near = bool(any_near(here.address, left, top, left + side - 1, top + side - 1))
        with self._lock:
            self._count += 1
            if self._count > SQUARES_MOST:
                self.made.clear()
                self._count = 1
            self.made[i][j] = near
        return near

    def look(self, one: Round) -> tuple[Look, int]:
        """See `squares.Squares.look`."""
        numbers, number, buffers = _numbers(one.spans), one.number, self._buffers
        assert len(numbers) - PIXELS <= self._words  # what buffers have room for
        shape = _address(numbers), numbers

        def look(x: int, y: int, hits: Answer) -> None:
            try:
                buffer = buffers.pop()  # another thread has another one
            except IndexError:
                buffer = self._buffer(ROWS)
            here = self._here
            count = shot(here.address, shape[0], x, y, buffer[0])
            if count:
                _, room, view, _ = buffer
                if not 0 <= count <= room:
                    self._make_room(count)
                    return look(x, y, hits)
                for at in range(8 * FOUND, 8 * FOUND + 48 * count, 48):
                    distance2, dy, dx, _, item, n = read(view, at)
                    hits.append(new(HitRow, (0, number, item, n, n, n * WEIGHT_FULL, 1, (x + dx, y + dy), distance2)))
            buffers.append(buffer)

        return look, PIECE_BYTES + numbers.nbytes

    def _make_room(self, count: int) -> None:
        """Make a buffer for so many rows; if that is less than none, list the tiles by cells."""
        if count < 0:
            self._list()
        else:
            self._buffers.append(self._buffer(2 * count))

    def _buffer(self, rows: int) -> Buffer:
        numbers = np.zeros(FOUND + 6 * rows + self._words, np.int64)
        numbers[ROOM] = rows
        return _address(numbers), rows, memoryview(numbers).cast("B"), numbers


def _numbers(spans: Spans) -> Ints:
    """A round's box and words, as `_shot` reads them."""
    mask, (left, top) = spans.to_mask()
    high, width = mask.shape
    padded = np.zeros((high + PAD, ((width - 1) // WORD + 3) * WORD), np.bool_)
    padded[:high, WORD : WORD + width] = mask
    words = np.packbits(padded, axis=1, bitorder="little").view("<i8").T
    return np.concatenate([[left, top, left + width - 1, top + high - 1], words.reshape(-1)])
