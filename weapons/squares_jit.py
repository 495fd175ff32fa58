"""What `squares` tells, compiled: one call of a kernel answers a shot.

At first each shot walks the stack from the front. When shots have spent as much on that as it takes to compose what can
be seen of the objects, that is done, and listed by cells of shot positions.

The kernel is given the address of a buffer, in which there are those of the scene and of the pixels of a round. It does
not let other threads run: that would take as long as many a shot.
"""

from __future__ import annotations

import struct
import threading
from typing import Any, NamedTuple

import numpy as np
from numba import carray, njit, types

from planes.addresses import address, ints_at, pointer, words_at
from planes.arrays import Bools, Ints
from planes.bitrows_jit import FEW_ROWS, in_order, key_of, shared, sort_places
from planes.bits import WORD, Words
from planes.cells import Cells
from planes.cells_jit import cell_at
from planes.compiled import compiled
from planes.constants import WEIGHT_FULL
from planes.fronttoback_jit import PAD, cut_off, laid, near_of, struck, take
from planes.items import Stack
from planes.scene import Scene
from planes.spans import Spans
from planes.visible import Composition
from weapons.costs import COMPILED
from weapons.hits import HitRow
from weapons.oneshot import Answer, Filter, answer_of
from weapons.pieces import Frame, Round
from weapons.squares import FARTHEST, ODD, PIXEL, Look, new
from weapons.weapon import Weapon
from weapons.windows import columns_of

__all__ = ["Squares"]

ROWS = 256
"""Rows that a buffer has room for at first."""

TILE_NS, MET_NS = 1, 50
"""What a shot spends on each tile when it walks the stack, and more on each that it meets."""

PIECE_BYTES = 400
"""What a round costs beside its pixels, bytes."""

FAR = 2**42
"""Beyond all positions."""

COMPOSE, UNKNOWN = -1, -2
"""Instead of a number of rows: it is worth composing; the position is none that is looked up."""

LEFT, TOP, RIGHT, LOW, PIERCE, SPENT, WORTH, COMPOSED = range(8)
X, Y, BITS, WIDE, HIGH, BEGIN, LISTED, TILES, BOX, RANK, ITEM, BLOCKS, WORD_OF, WORDS, SCRATCH = range(8, 23)
"""Of a scene: its bounds; whether shots go through objects; what shots have spent on walking, and what is worth
composing; whether that is done. Its cells, and how many tiles; then addresses: of lists, of columns of tiles, of words,
and of 5 numbers a tile to work with."""

ROUND_LEFT, ROUND_TOP, ROUND_RIGHT, ROUND_LOW, STEP, COLUMNS, PIXELS = range(7)
"""Of a round: its box about its pixel; words from one column of 64 px to the next, how many, and from where on they
lie."""

SCENE, ROUND, ROOM, FOUND = range(4)
"""Of a buffer: addresses of the scene and the round, for how many rows it has room, and from where on they lie; after
them there is room for what is left of the round."""

ROW = 5
"""Numbers of a row: item, samples, squared distance, x, y."""

FIRST, ROW_BYTES = 8 * FOUND, 8 * ROW
read = struct.Struct("5q").unpack_from


@njit
def _listed(scene, box, x, y, left, top, right, bottom, near):
    """Tiles in the cell of a pixel whose boxes meet one, front to back; how many."""
    cell, count = cell_at(x, y, scene[X], scene[Y], scene[BITS], scene[WIDE], scene[HIGH]), 0
    if cell < 0:
        return 0
    begin, listed = ints_at(scene[BEGIN]), ints_at(scene[LISTED])
    for entry in range(begin[cell], begin[cell + 1]):
        tile = listed[entry]
        across = (box[tile, 0] <= right) & (box[tile, 2] >= left)
        near[count] = tile
        count += across & (box[tile, 1] <= bottom) & (box[tile, 3] >= top)
    return count


NONE = np.zeros(0, np.int64)


@njit
def _walked(scene, box, left, top, right, bottom, near):
    """Tiles whose boxes meet one, front to back: all are looked at, and that is counted."""
    count = near_of(box, NONE, NONE, NONE, left, top, right, bottom, near)
    scene[SPENT] += TILE_NS * len(box) + MET_NS * count
    return count


@njit
def _left_of(shape, pixels, scene, left, top, rest):
    """Copy the pixels of a round that lie within the bounds."""
    rows, bottom, right = shape[ROUND_LOW] - shape[ROUND_TOP] + 1, shape[ROUND_LOW], shape[ROUND_RIGHT]
    laid(pixels, PAD, shape[COLUMNS], shape[STEP], rows, rest)
    right, bottom = left + right - shape[ROUND_LEFT], top + bottom - shape[ROUND_TOP]
    if left < scene[LEFT] or top < scene[TOP] or right > scene[RIGHT] or bottom > scene[LOW]:
        bounds = scene[LEFT], scene[TOP], scene[RIGHT], scene[LOW]
        cut_off(rest, shape[COLUMNS], shape[STEP], left, top, rows, *bounds)


@njit
def _met(scene, shape, box, near, close, rest, x, y):
    """How many items a round shares pixels with, in tiles that are near it, front to back.

    After the list of those come columns: keys, columns of the nearest pixel, items, samples, and room for its rows.
    """
    rank, items, blocks, first = (
        ints_at(scene[RANK]),
        ints_at(scene[ITEM]),
        ints_at(scene[BLOCKS]),
        ints_at(scene[WORD_OF]),
    )
    tiles, step, room = words_at(scene[WORDS]), shape[STEP], scene[TILES]
    key, across = near[room:], near[2 * room :]
    item, samples = near[3 * room :], near[4 * room :]
    left, top, bottom, count, last = x + shape[ROUND_LEFT], y + shape[ROUND_TOP], y + shape[ROUND_LOW], 0, -1
    for i in range(close):
        at = near[i]
        low, high = max(box[at, 1], top), min(box[at, 3], bottom)
        offset = box[at, 0] - left + WORD - 1
        tile, word, shift = first[at] - box[at, 1], PAD + (offset >> 6) * step - top, offset & 63
        if blocks[at]:
            take(tiles, tile, rest, word, step, shift, low, high)
            continue
        if scene[PIERCE]:
            n, distance2, dx, dy = shared(tiles, tile, rest, word, step, shift, low, high, x - box[at, 0], y)
        else:
            n, distance2, dx, dy = struck(tiles, tile, rest, word, step, shift, low, high, x - box[at, 0], y)
        if n == 0:
            continue
        nearest = key_of(distance2, dx, dy)
        if rank[at] != last:
            key[count], across[count], item[count], samples[count], last = nearest, dx, items[at], n, rank[at]
            count += 1
            continue
        samples[count - 1] += n
        if nearest < key[count - 1]:
            key[count - 1], across[count - 1] = nearest, dx
    return count


@njit
def _tell(met, every, count, x, y, buffer_at, room):
    """Write what `_met` told to a buffer, in order."""
    key, across, item = met[every:], met[2 * every :], met[3 * every :]
    samples, down = met[4 * every :], met[5 * every :]
    in_order(0, count, x, y, item, samples, key, across, down)
    order = met  # where the list of tiles was
    for row in range(count):
        order[row] = row
    if count > FEW_ROWS:
        sort_places(order[:count], key, down, across)
    found = carray(pointer(buffer_at + 8 * FOUND), (room, ROW), np.int64)
    for row in range(count):
        at = order[row]
        found[row, 0], found[row, 1], found[row, 2] = item[at], samples[at], key[at]
        found[row, 3], found[row, 4] = across[at], down[at]


@compiled(types.int64(types.float64, types.float64, types.int64), nogil=False)
def _shot(at_x, at_y, buffer_at):
    """How many rows a round has at a position; they are told, unless the buffer has no room for so many."""
    if not (-FARTHEST < at_x < FARTHEST and -FARTHEST < at_y < FARTHEST) or at_x == ODD or at_y == ODD:
        return UNKNOWN
    x, y = np.int64(np.floor(at_x + PIXEL)), np.int64(np.floor(at_y + PIXEL))
    buffer = ints_at(buffer_at)
    scene, shape = ints_at(buffer[SCENE]), ints_at(buffer[ROUND])
    box, near = carray(pointer(scene[BOX]), (scene[TILES], 4), np.int64), ints_at(scene[SCRATCH])
    left, top, right, bottom = x + shape[ROUND_LEFT], y + shape[ROUND_TOP], x + shape[ROUND_RIGHT], y + shape[ROUND_LOW]
    if scene[COMPOSED]:
        close = _listed(scene, box, x, y, left, top, right, bottom, near)
    else:
        close = _walked(scene, box, left, top, right, bottom, near)
        if scene[SPENT] > scene[WORTH]:
            return COMPOSE
    if close == 0:
        return 0
    room, rest = buffer[ROOM], words_at(buffer[ROUND] + 8 * PIXELS)
    if not scene[COMPOSED]:
        pixels, rest = rest, words_at(buffer_at + 8 * (FOUND + ROW * room))
        _left_of(shape, pixels, scene, left, top, rest)
    count = _met(scene, shape, box, near, close, rest, x, y)
    if count <= room:
        _tell(near, scene[TILES], count, x, y, buffer_at, room)
    return count


shot = _shot.overloads[_shot.signatures[0]].entry_point
"""It, without the choice among its types, which takes twice as long as the call."""


class Pile(NamedTuple):
    """Tiles, front to back: place in the stack, item, whether it only blocks, and first row in `words`."""

    rank: Ints
    item: Ints
    blocks: Ints
    begin: Ints
    words: Words


class Buffer(NamedTuple):
    """Where a shot tells its rows: an address, for how many there is room, the bytes, and what must be kept."""

    address: int
    room: int
    view: memoryview
    numbers: Ints


class Squares:
    """See `squares.Squares`; there are no squares here: a shot is looked up in what is kept of the scene."""

    def __init__(self, scene: Scene, weapon: Weapon, pierce: bool, kept: Filter, frame: Frame) -> None:
        self.quick = None  # each shot is looked up
        self._scene, self._tell = scene, answer_of(weapon)[1]
        self._reach = np.array([-frame.reach, -frame.reach, frame.reach, frame.reach])
        self._view = kept.view(pierce)
        self._forms = -1
        self._tiles: tuple[Bools, Pile]
        self._here = np.zeros(SCRATCH + 1, np.int64)  # it is changed in place: buffers have its address
        self._kept: tuple[Any, ...] = ()
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Take note of the scene as it is now."""
        with self._lock:
            composed = self._scene.compositions().kept(self._view, self._scene.version)
            if composed is not None:
                self._compose(composed)
                return
            tiles = self._scene.items.tiles()
            if stack.forms != self._forms:
                there = self._view.accepts(stack)[tiles.rank]
                rank = tiles.rank[there]
                pile = Pile(
                    rank, stack.ids[rank], stack.occluder[rank].astype(np.int64), tiles.begin[there], tiles.words
                )
                self._forms, self._tiles = stack.forms, (there, pile)
            there, pile = self._tiles
            cells = Cells(0, 0, 0, 0, 0, NONE, NONE)
            bounds = self._scene.bounds or (-FAR, -FAR, FAR, FAR)
            worth = int(COMPILED.compose + COMPILED.item * len(stack))
            self._place(pile, tiles.boxes(stack.box_xyxy)[there], cells, (*bounds, self._view.pierce, 0, worth, False))

    def _compose(self, composed: Composition) -> None:
        """Look up what can be seen: nothing in it covers another, and it lies within the bounds."""
        seen, cells = composed.seen, composed.cells(self._reach)
        pile = Pile(seen.rank, composed.ids, np.zeros(len(seen.rank), np.int64), seen.begin, seen.words)
        self._place(pile, seen.box_xyxy, cells, (-FAR, -FAR, FAR, FAR, True, 0, 0, True))

    def _place(self, pile: Pile, boxes_xyxy: Ints, cells: Cells, told: tuple[int, ...]) -> None:
        """Tell the kernel where all lies."""
        columns = tuple(map(np.ascontiguousarray, (cells.begin, cells.listed, boxes_xyxy, *pile)))
        scratch = np.empty(6 * len(boxes_xyxy), np.int64)
        begin, listed, *rest = map(address, columns)
        here = [*told, *cells[:5], begin, listed, len(boxes_xyxy), *rest, address(scratch)]
        self._here[:] = np.array(here, np.int64)
        self._kept = columns, scratch  # after that: until then another thread may read what was there before

    def look(self, one: Round) -> tuple[Look, int]:
        """See `squares.Squares.look`."""
        numbers, number, tell = _numbers(one.spans), one.number, self._tell
        buffers: list[Buffer] = []

        def look(x: float, y: float, hits: Answer) -> None:
            """Let the kernel look, and read its rows from a buffer."""
            try:
                buffer = buffers.pop()  # another thread has another one
            except IndexError:
                buffer = self._buffer(numbers, ROWS)
            count = shot(x, y, buffer[0])
            if count:
                _, room, view, _ = buffer
                if not 0 < count <= room:
                    buffers.append(self._room_for(count, buffer, numbers))
                    if count == UNKNOWN:
                        raise KeyError
                    return look(x, y, hits)
                at, end = FIRST, FIRST + ROW_BYTES * count
                while at < end:  # to make a range takes longer than to read a row
                    item, n, distance2, column, row = read(view, at)
                    tell(hits, new(HitRow, (0, number, item, n, n, n * WEIGHT_FULL, 1, (column, row), distance2)))
                    at += ROW_BYTES
            buffers.append(buffer)

        return look, PIECE_BYTES + numbers.nbytes

    def _room_for(self, count: int, buffer: Buffer, numbers: Ints) -> Buffer:
        """A buffer for so many rows; if shots have spent as much as that takes, compose what can be seen."""
        if count > 0:
            return self._buffer(numbers, 2 * count)
        with self._lock:
            if count == COMPOSE and not self._here[COMPOSED]:
                scene = self._scene
                self._compose(scene.compositions().read(self._view, scene.items, scene.bounds))
        return buffer

    def _buffer(self, pixels: Ints, rows: int) -> Buffer:
        numbers = np.zeros(FOUND + ROW * rows + len(pixels), np.int64)
        numbers[:FOUND] = address(self._here), address(pixels), rows
        return Buffer(address(numbers), rows, memoryview(numbers).cast("B"), numbers)


def _numbers(spans: Spans) -> Ints:
    """A round's box and words, as `_shot` reads them."""
    words = columns_of(spans)
    return np.concatenate([spans.box_xyxy, words.shape[::-1], words.reshape(-1).view(np.int64)])
