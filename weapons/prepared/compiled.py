"""Compiled form of the position cache: one call of the kernel of areas answers a shot.

A shot walks the stack from front to back at first. When the shots have spent as much time on that as the visible set
costs, it is made, and its tiles are listed by cells of shot positions.

Arrays are handed over by address, because unpacking them would take ten times as long as a shot. The kernel does not
release the interpreter's lock, because that would take as long as a shot; so all calls can share one scratch memory.
"""

from __future__ import annotations

import struct
import threading
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types
from numba.extending import intrinsic

from hitplanes.planes.bits.bit_rows import WORD
from hitplanes.planes.bits.cells import Cells
from hitplanes.planes.bits.front_to_back import NO_NUMBERS, OrderedTiles
from hitplanes.planes.bits.visible import VisibleSet
from hitplanes.planes.common.checks import Ints
from hitplanes.planes.common.costs import COMPILED
from hitplanes.planes.common.limits import WEIGHT_FULL
from hitplanes.planes.jit import bit_rows
from hitplanes.planes.jit.areas import KEY, NOBODY, RANK, SAMPLES, X, Y, match
from hitplanes.planes.jit.bit_rows import BOXES, EVERYWHERE, FEW_ROWS, FLAGS, cell_at
from hitplanes.planes.jit.cache import compiled
from hitplanes.planes.scene.items import NO_BOXES, Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import HitRow
from ..kinds.weapon import Weapon
from .one_shot import Answer, Filter, Round, answer_of
from .position_cache import FARTHEST, ODD, PIXEL, Look, new

EACH_TILE, EACH_SHOT = int(COMPILED.prepared_tile), int(COMPILED.prepared_near)

PIECE_BYTES = 400
"""Memory of a round in addition to its pixels, bytes."""

MAKE_VISIBLE = -1
"""Returned by `_shot` instead of a number of rows: the visible set is worth making."""

UNKNOWN = -2
"""Returned by `_shot` instead of a number of rows: the shot is left to `fire`."""

PIERCE, SPENT, WORTH, IS_VISIBLE, LEFT, TOP, RIGHT, LOW, CELLS = *range(8), slice(8, 13)
TILES, OCCLUDERS, LISTED, BEGIN, ITEM, RANK_OF, BOX, WORD_OF, WORDS, BLOCKS, NEAR, OUT = range(13, 25)
"""Fields of a scene for shots:

- whether shots pierce; time spent on walking; cost of the visible set; whether that is in use; the bounds
- CELLS: the grid of cells; TILES, OCCLUDERS: number of tiles, and of flags of occluders, which may be 0
- LISTED, BEGIN: addresses of the lists of tiles by cell
- ITEM to BLOCKS: addresses of the columns of the tiles; NEAR, OUT: addresses of scratch memory and of rows
"""

SHAPE, FIRST, STEP, LENGTH, PIXELS = slice(0, 4), 4, 5, 6, 7
"""Fields of a round: its box relative to its pixel; place of its first word; words a column; all words; the words."""

SCENE, ROUND, FOUND = range(3)
"""Fields of a buffer: addresses of the scene and the round; first of the rows. Scratch memory follows the rows."""

ROW = 5
"""Numbers of a row: item, samples, squared distance, x, y."""

FOUND_AT, ROW_BYTES = 8 * FOUND, 8 * ROW
read = struct.Struct("5q").unpack_from
NO_SUMS, NO_STRIPS, ZERO = np.zeros(0, np.uint32), np.zeros((0, 4), np.int64), np.zeros(1, np.int64)


@intrinsic
def pointer(_: Any, address: Any) -> Any:
    """An address as a pointer."""

    def made(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.int64), made


@njit(inline="always")
def ints_at(address):
    """Array of int64 from an address on."""
    return carray(pointer(address), (2**40,), np.int64)


@njit(inline="always")
def words_at(address):
    """Array of uint64 from an address on."""
    return carray(pointer(address), (2**40,), np.uint64)


@njit(inline="always")
def flags_at(address):
    """Array of booleans from an address on."""
    return carray(pointer(address), (2**40,), np.bool_)


def address(array: Any) -> int:
    """Address of an array's first value."""
    assert array.flags.c_contiguous
    return int(array.__array_interface__["data"][0])


NUMBERS = types.Array(types.int64, 1, "C", readonly=True)


@compiled(types.void(types.int64[::1], *[NUMBERS] * 4, BOXES, NUMBERS, bit_rows.WORDS, FLAGS, NUMBERS, BOXES))
def _put_addresses(here, listed, begin, item, rank, box, word_of, words, blocks, near, out):
    """Write the addresses of the columns of the tiles to the fields of a scene, from LISTED on."""
    addresses = (
        listed.ctypes.data, begin.ctypes.data, item.ctypes.data, rank.ctypes.data, box.ctypes.data,
        word_of.ctypes.data, words.ctypes.data, blocks.ctypes.data, near.ctypes.data, out.ctypes.data,
    )  # fmt: skip
    for k in range(len(addresses)):
        here[LISTED + k] = addresses[k]


# house: way of areas
@compiled(types.int64(types.float64, types.float64, types.int64), nogil=False)
def _shot(at_x, at_y, buffer_at):
    """Number of rows of a round at a position, which are written to the buffer."""
    if not (-FARTHEST < at_x < FARTHEST and -FARTHEST < at_y < FARTHEST) or at_x == ODD or at_y == ODD:
        return UNKNOWN
    buffer = ints_at(buffer_at)
    scene, shape = ints_at(buffer[SCENE]), ints_at(buffer[ROUND])
    count = scene[TILES]
    pixel_x, pixel_y = np.int64(np.floor(at_x + PIXEL)), np.int64(np.floor(at_y + PIXEL))
    cells, begin, zero = scene[CELLS], ints_at(scene[BEGIN]), NO_NUMBERS
    if scene[IS_VISIBLE]:
        cell = cell_at(pixel_x, pixel_y, cells[0], cells[1], cells[2], cells[3], cells[4])
        if cell < 0 or begin[cell] == begin[cell + 1]:
            return 0
    else:
        scene[SPENT] += EACH_TILE * count + EACH_SHOT
        if scene[SPENT] > scene[WORTH]:
            return MAKE_VISIBLE
    x, y = buffer[FOUND : FOUND + 1], buffer[FOUND + 1 : FOUND + 2]  # until rows are written there
    x[0], y[0] = pixel_x, pixel_y
    out = carray(pointer(scene[OUT]), (Y + 1, FEW_ROWS), np.int64)
    rest = words_at(buffer_at + 8 * (FOUND + ROW * FEW_ROWS))
    turn, rows, _ = match(
        0, 1, 0, out, ZERO, x, y, x, y,
        carray(pointer(buffer[ROUND]), (1, 4), np.int64), shape[FIRST : FIRST + 1], shape[STEP : STEP + 1],
        words_at(buffer[ROUND] + 8 * PIXELS), NO_STRIPS, NO_SUMS, ZERO,
        ints_at(scene[RANK_OF])[:count], carray(pointer(scene[BOX]), (count, 4), np.int64), ints_at(scene[WORD_OF]),
        words_at(scene[WORDS]), flags_at(scene[BLOCKS])[: scene[OCCLUDERS]], zero, zero,
        cells[0], cells[1], cells[2], cells[3], cells[4], begin, ints_at(scene[LISTED]),
        scene[PIERCE] > 0, (scene[LEFT], scene[TOP], scene[RIGHT], scene[LOW]), zero, NOBODY, 1,
        ints_at(scene[NEAR]), rest, out[0], out[0], out[0], rest,
    )  # fmt: skip
    if turn < 1:
        return UNKNOWN
    found, item = carray(pointer(buffer_at + FOUND_AT), (FEW_ROWS, ROW), np.int64), ints_at(scene[ITEM])
    for row in range(rows):
        found[row, 0], found[row, 1], found[row, 2] = item[out[RANK, row]], out[SAMPLES, row], out[KEY, row]
        found[row, 3], found[row, 4] = out[X, row], out[Y, row]
    return rows


shot = _shot.overloads[_shot.signatures[0]].entry_point
"""Its entry point, without the dispatch on argument types, which takes twice as long as the call."""


Buffer = tuple[int, memoryview, Ints]
"""Memory to which a kernel writes rows: its address, bytes, and the array that owns them."""


class PositionCache:
    """Compiled form of `position_cache.PositionCache`, without squares: a kernel walks the stack or the visible set."""

    def __init__(self, scene: Scene, weapon: Weapon, pierce: bool, kept: Filter, reach: int) -> None:
        self.quick = None  # each shot is looked up
        self._scene, self._tell = scene, answer_of(weapon)[1]
        self._reach = np.array([-reach, -reach, reach, reach])
        self._view = kept.view(pierce)
        self._forms = -1
        self._there: Ints
        self._tiles: OrderedTiles
        self._out = np.empty((Y + 1, FEW_ROWS), np.int64)
        self._here = np.zeros(OUT + 1, np.int64)  # changed in place, because buffers have its address
        self._kept: tuple[Any, ...] = ()
        self._lock = threading.Lock()

    def follow(self, stack: Stack) -> None:
        """Read the scene as it is now."""
        with self._lock:
            visible_set = self._scene.derived.visible(self._view).made(self._scene.items)
            if visible_set is not None:
                self._use_visible(visible_set, stack)
                return
            tiles = self._scene.items.tiles()
            if stack.forms != self._forms:
                there = self._view.accepts(stack)[tiles.rank].nonzero()[0]
                rank, *_, occluder = tiles.ordered(stack, False)[:5]
                blocks = occluder[there] if stack.has_occluders else occluder
                self._tiles = OrderedTiles(rank[there], NO_BOXES, tiles.begin[there], tiles.words, blocks)
                self._forms, self._there = stack.forms, there
            boxes_xyxy = tiles.boxes(stack.box_xyxy)
            if len(self._there) < len(boxes_xyxy):
                boxes_xyxy = boxes_xyxy.take(self._there, axis=0)
            ordered = self._tiles._replace(box_xyxy=boxes_xyxy)
            worth = int(COMPILED.visible_made + COMPILED.visible_item * len(stack))
            bounds = self._scene.bounds or EVERYWHERE
            cells = Cells(0, 0, 0, 0, 0, NO_NUMBERS, NO_NUMBERS)
            self._place(ordered, cells, stack, (self._view.pierce, 0, worth, False, *bounds))

    def _use_visible(self, visible_set: VisibleSet, stack: Stack) -> None:
        """Let shots look up the visible set; its tiles do not overlap and lie within the bounds."""
        self._place(visible_set.seen, visible_set.cells(self._reach), stack, (True, 0, 0, True, *EVERYWHERE))

    def _place(self, tiles: OrderedTiles, cells: Cells, stack: Stack, told: tuple[int, ...]) -> None:
        """Write the addresses of the tiles to the fields of the scene."""
        columns = tuple(map(np.ascontiguousarray, (cells.listed, cells.begin, stack.ids, *tiles[:5])))
        near = np.empty(len(tiles.rank), np.int64)
        self._here[:LISTED] = *told, *cells[:5], len(tiles.rank), len(tiles.occluder)
        _put_addresses(self._here, *columns, near, self._out)
        self._kept = columns, near  # last, because another thread may still read the old columns

    def look(self, one: Round) -> tuple[Look, int]:
        """Function that looks up what a round hits, and the bytes kept for it."""
        numbers, number, tell = _numbers(one), one.number, self._tell
        buffers: list[Buffer] = []

        def look(x: float, y: float, hits: Answer) -> None:
            """Call the kernel and read its rows from a buffer."""
            try:
                buffer = buffers.pop()  # each thread takes its own
            except IndexError:
                buffer = self._buffer(numbers)
            count = shot(x, y, buffer[0])
            if count:
                if count < 0:
                    buffers.append(buffer)
                    if count == UNKNOWN:
                        raise KeyError
                    self._make_visible()
                    return look(x, y, hits)
                view, at, end = buffer[1], FOUND_AT, FOUND_AT + ROW_BYTES * count
                while at < end:  # faster than a range
                    item, n, distance2, column, row = read(view, at)
                    tell(hits, new(HitRow, (0, number, item, n, n, n * WEIGHT_FULL, 1, (column, row), distance2)))
                    at += ROW_BYTES
            buffers.append(buffer)

        return look, PIECE_BYTES + numbers.nbytes

    def _make_visible(self) -> None:
        with self._lock:
            if not self._here[IS_VISIBLE]:
                scene = self._scene
                visible_set = scene.derived.visible(self._view).read(scene.items)
                self._use_visible(visible_set, scene.items.stack())

    def _buffer(self, pixels: Ints) -> Buffer:
        numbers = np.zeros(FOUND + ROW * FEW_ROWS + len(pixels), np.int64)
        numbers[:FOUND] = address(self._here), address(pixels)
        return address(numbers), memoryview(numbers).cast("B"), numbers


def _numbers(one: Round) -> Ints:
    """Fields of a round, as `_shot` reads them."""
    words = one.pattern.words
    head = *one.pattern.box_xyxy[0].tolist(), WORD, words.shape[1], words.size
    return np.concatenate([np.array(head, np.int64), np.zeros(WORD, np.int64), words.reshape(-1).view(np.int64)])
