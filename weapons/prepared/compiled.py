"""Compiled kernels of prepared weapons: one call of a kernel answers a shot.

A shot walks the stack from front to back at first. When the shots have spent as much time on that as the visible set
costs, it is made, and its tiles are listed by cells of shot positions.

A kernel gets the address of a buffer that holds the addresses of the scene and of the pixels of a round. It does not
release the interpreter's lock, because that would take as long as a shot; so all calls can share one scratch memory.
"""

from __future__ import annotations

import struct
import threading
from typing import Any, NamedTuple

import numpy as np
from numba import carray, njit, types

from hitplanes.planes.bits.bit_rows import WORD, Words
from hitplanes.planes.bits.cells import Cells
from hitplanes.planes.bits.visible import VisibleSet
from hitplanes.planes.common.checks import Bools, Ints
from hitplanes.planes.common.costs import COMPILED
from hitplanes.planes.common.limits import WEIGHT_FULL
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.jit.areas import PAD, cut_off, laid, near_of, struck, take
from hitplanes.planes.jit.bit_rows import FEW_ROWS, cell_at, in_order, key_of, shared, sort_places
from hitplanes.planes.jit.cache import address, compiled, ints_at, pointer, words_at
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import HitRow
from ..kinds.weapon import Weapon, columns_of
from .one_shot import Answer, Filter, Round, answer_of
from .position_cache import FARTHEST, ODD, PIXEL, Look, new

ROWS = 256
"""Initial capacity of a buffer, rows."""

EACH_TILE, EACH_NEAR = int(COMPILED.prepared_tile), int(COMPILED.prepared_near)

PIECE_BYTES = 400
"""Memory of a round in addition to its pixels, bytes."""

FAR = 2**42
"""A coordinate beyond all positions, px."""

MAKE_VISIBLE = -1
"""Returned by `_shot` instead of a number of rows: the visible set is worth making."""

UNKNOWN = -2
"""Returned by `_shot` instead of a number of rows: the position is outside the range that is looked up."""

LEFT, TOP, RIGHT, LOW, PIERCE, SPENT, WORTH, IS_VISIBLE = range(8)
X, Y, BITS, WIDE, HIGH, BEGIN, LISTED, TILES, BOX, RANK, ITEM, BLOCKS, WORD_OF, WORDS, SCRATCH = range(8, 23)
"""Fields of a scene for shots:

- bounds; whether shots pierce; time spent on walking; cost of the visible set; whether that is in use
- X to HIGH: the grid of cells; BEGIN, LISTED: addresses of the lists of tiles by cell
- TILES: number of tiles; BOX to WORDS: addresses of their columns; SCRATCH: address of scratch memory, 6 numbers a tile
"""

ROUND_LEFT, ROUND_TOP, ROUND_RIGHT, ROUND_LOW, STEP, COLUMNS, PIXELS = range(7)
"""Fields of a round: its box relative to its pixel; words a column; columns of 64 px; first of the words."""

SCENE, ROUND, ROOM, FOUND = range(4)
"""Fields of a buffer: addresses of the scene and the round; capacity in rows; first of the rows. Scratch memory for the
clipped pixels of the round follows the rows."""

ROW = 5
"""Numbers of a row: item, samples, squared distance, x, y."""

FIRST, ROW_BYTES = 8 * FOUND, 8 * ROW
read = struct.Struct("5q").unpack_from


@njit
def _listed(scene, box, x, y, left, top, right, bottom, near):
    """Write to `near` the tiles in the cell of a pixel whose boxes meet a box, front to back; return their number."""
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


NOTHING_LISTED = np.zeros(0, np.int64)


@njit
def _walked(scene, box, left, top, right, bottom, near):
    """Write to `near` all tiles whose boxes meet a box, front to back, and count the time; return their number."""
    count = near_of(box, NOTHING_LISTED, NOTHING_LISTED, NOTHING_LISTED, left, top, right, bottom, near)
    scene[SPENT] += EACH_TILE * len(box) + EACH_NEAR * count
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


# house: hit rule of areas
@njit
def _met(scene, shape, box, near, close, rest, x, y):
    """Number of items that a round hits in the tiles listed in `near`.

    The columns of the hits follow the list of tiles: keys, x of the nearest pixel, items, samples, and room for its y.
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
    """Sort the hits that `_met` found and write them to the buffer."""
    key, across, item = met[every:], met[2 * every :], met[3 * every :]
    samples, down = met[4 * every :], met[5 * every :]
    in_order(0, count, x, y, item, samples, key, across, down)
    order = met  # reuses the list of tiles
    for row in range(count):
        order[row] = row
    if count > FEW_ROWS:
        sort_places(order[:count], key, down, across)
    found = carray(pointer(buffer_at + 8 * FOUND), (room, ROW), np.int64)
    for row in range(count):
        at = order[row]
        found[row, 0], found[row, 1], found[row, 2] = item[at], samples[at], key[at]
        found[row, 3], found[row, 4] = across[at], down[at]


# house: way of areas
@compiled(types.int64(types.float64, types.float64, types.int64), nogil=False)
def _shot(at_x, at_y, buffer_at):
    """Number of rows of a round at a position; the rows are written to the buffer if it has room for all of them."""
    if not (-FARTHEST < at_x < FARTHEST and -FARTHEST < at_y < FARTHEST) or at_x == ODD or at_y == ODD:
        return UNKNOWN
    x, y = np.int64(np.floor(at_x + PIXEL)), np.int64(np.floor(at_y + PIXEL))
    buffer = ints_at(buffer_at)
    scene, shape = ints_at(buffer[SCENE]), ints_at(buffer[ROUND])
    box, near = carray(pointer(scene[BOX]), (scene[TILES], 4), np.int64), ints_at(scene[SCRATCH])
    left, top, right, bottom = x + shape[ROUND_LEFT], y + shape[ROUND_TOP], x + shape[ROUND_RIGHT], y + shape[ROUND_LOW]
    if scene[IS_VISIBLE]:
        close = _listed(scene, box, x, y, left, top, right, bottom, near)
    else:
        close = _walked(scene, box, left, top, right, bottom, near)
        if scene[SPENT] > scene[WORTH]:
            return MAKE_VISIBLE
    if close == 0:
        return 0
    room, rest = buffer[ROOM], words_at(buffer[ROUND] + 8 * PIXELS)
    if not scene[IS_VISIBLE]:
        pixels, rest = rest, words_at(buffer_at + 8 * (FOUND + ROW * room))
        _left_of(shape, pixels, scene, left, top, rest)
    count = _met(scene, shape, box, near, close, rest, x, y)
    if count <= room:
        _tell(near, scene[TILES], count, x, y, buffer_at, room)
    return count


shot = _shot.overloads[_shot.signatures[0]].entry_point
"""Its entry point, without the dispatch on argument types, which takes twice as long as the call."""


class OrderedTiles(NamedTuple):
    """Columns of tiles, front to back: rank and id of the item, whether it is an occluder, first row in `words`."""

    rank: Ints
    item: Ints
    blocks: Ints
    begin: Ints
    words: Words


class Buffer(NamedTuple):
    """Memory to which a kernel writes rows: its address, capacity in rows, bytes, and the array that owns them."""

    address: int
    room: int
    view: memoryview
    numbers: Ints


class PositionCache:
    """Compiled form of `position_cache.PositionCache`, without squares: a kernel walks the stack or the visible set."""

    def __init__(self, scene: Scene, weapon: Weapon, pierce: bool, kept: Filter, reach: int) -> None:
        self.quick = None  # each shot is looked up
        self._scene, self._tell = scene, answer_of(weapon)[1]
        self._reach = np.array([-reach, -reach, reach, reach])
        self._view = kept.view(pierce)
        self._forms = -1
        self._tiles: tuple[Bools, OrderedTiles]
        self._here = np.zeros(SCRATCH + 1, np.int64)  # changed in place, because buffers have its address
        self._kept: tuple[Any, ...] = ()
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Read the scene as it is now."""
        with self._lock:
            visible_set = self._scene.visible_sets().kept(self._view, self._scene.version)
            if visible_set is not None:
                self._use_visible(visible_set)
                return
            tiles = self._scene.items.tiles()
            if stack.forms != self._forms:
                there = self._view.accepts(stack)[tiles.rank]
                rank = tiles.rank[there]
                ordered = OrderedTiles(
                    rank, stack.ids[rank], stack.occluder[rank].astype(np.int64), tiles.begin[there], tiles.words
                )
                self._forms, self._tiles = stack.forms, (there, ordered)
            there, ordered = self._tiles
            cells = Cells(0, 0, 0, 0, 0, NOTHING_LISTED, NOTHING_LISTED)
            bounds = self._scene.bounds or (-FAR, -FAR, FAR, FAR)
            worth = int(COMPILED.visible_made + COMPILED.visible_item * len(stack))
            self._place(
                ordered, tiles.boxes(stack.box_xyxy)[there], cells, (*bounds, self._view.pierce, 0, worth, False)
            )

    def _use_visible(self, visible_set: VisibleSet) -> None:
        """Let shots look up the visible set; its tiles do not overlap and lie within the bounds."""
        seen, cells = visible_set.seen, visible_set.cells(self._reach)
        ids = self._scene.items.stack().ids[seen.rank]
        ordered = OrderedTiles(seen.rank, ids, np.zeros(len(seen.rank), np.int64), seen.begin, seen.words)
        self._place(ordered, seen.box_xyxy, cells, (-FAR, -FAR, FAR, FAR, True, 0, 0, True))

    def _place(self, ordered: OrderedTiles, boxes_xyxy: Ints, cells: Cells, told: tuple[int, ...]) -> None:
        """Write the addresses of the tiles to the fields of the scene."""
        columns = tuple(map(np.ascontiguousarray, (cells.begin, cells.listed, boxes_xyxy, *ordered)))
        scratch = np.empty(6 * len(boxes_xyxy), np.int64)
        begin, listed, *rest = map(address, columns)
        here = [*told, *cells[:5], begin, listed, len(boxes_xyxy), *rest, address(scratch)]
        self._here[:] = np.array(here, np.int64)
        self._kept = columns, scratch  # last, because another thread may still read the old columns

    def look(self, one: Round) -> tuple[Look, int]:
        """Function that looks up what a round hits, and the bytes kept for it."""
        numbers, number, tell = _numbers(one.spans), one.number, self._tell
        buffers: list[Buffer] = []

        def look(x: float, y: float, hits: Answer) -> None:
            """Call the kernel and read its rows from a buffer."""
            try:
                buffer = buffers.pop()  # each thread takes its own
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
                while at < end:  # faster than a range
                    item, n, distance2, column, row = read(view, at)
                    tell(hits, new(HitRow, (0, number, item, n, n, n * WEIGHT_FULL, 1, (column, row), distance2)))
                    at += ROW_BYTES
            buffers.append(buffer)

        return look, PIECE_BYTES + numbers.nbytes

    def _room_for(self, count: int, buffer: Buffer, numbers: Ints) -> Buffer:
        """Buffer for so many rows; for MAKE_VISIBLE make the visible set and return the same buffer."""
        if count > 0:
            return self._buffer(numbers, 2 * count)
        with self._lock:
            if count == MAKE_VISIBLE and not self._here[IS_VISIBLE]:
                scene = self._scene
                self._use_visible(scene.visible_sets().read(self._view, scene.items, scene.bounds))
        return buffer

    def _buffer(self, pixels: Ints, rows: int) -> Buffer:
        numbers = np.zeros(FOUND + ROW * rows + len(pixels), np.int64)
        numbers[:FOUND] = address(self._here), address(pixels), rows
        return Buffer(address(numbers), rows, memoryview(numbers).cast("B"), numbers)


def _numbers(spans: Spans) -> Ints:
    """Fields of a round, as `_shot` reads them."""
    words = columns_of(spans)
    return np.concatenate([spans.box_xyxy, words.shape[::-1], words.reshape(-1).view(np.int64)])
