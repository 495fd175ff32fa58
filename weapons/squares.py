"""Squares of shot positions, each with the objects that a pattern fired from there may hit, and what is seen of them.

A square is made when the first shot falls into it, and what is seen of an object when the first square needs it: its
mask without what lies before it, as integer rows. After a change of the scene those near what changed are made anew.
After all has moved shots walk the items instead, front to back, until the scene stands still for more of them.
`squares_jit` walks the stack, or what is composed of it, compiled.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from planes.arrays import Bools
from planes.bigfront import Ground, hit_by_one, pays
from planes.bigrows import BigPattern, big_pattern, packed
from planes.constants import POSITION_MAX, WEIGHT_FULL
from planes.items import Stack
from planes.kept import Kept
from planes.scene import Scene
from planes.spans import Box, meets
from planes.turning import sides_of
from weapons.candidates import refused
from weapons.fewfire import accepted
from weapons.hits import HitRow
from weapons.oneshot import Answer, Filter, answer_of
from weapons.pieces import Frame, Round, pieces_of
from weapons.weapon import Weapon

__all__ = [
    "CELL_SHIFT", "EDGE", "FARTHEST", "ODD", "PIXEL", "SIDE", "Cell", "Look", "Made", "Seen", "Shared", "Squares",
    "new",
]  # fmt: skip

Kind = TypeVar("Kind")

CELL_SHIFT = 5
SIDE = 1 << CELL_SHIFT
"""Side of a square, px: of a larger one more objects lie near, of a smaller one more squares must be made."""

BLOCK_SHIFT = 2
"""A square looks for items in those near its block, of 2**2 x 2**2 squares."""

TILE_MIN, TILE = 32, 64
"""Objects are looked up whole, or in tiles of so many px a side: of a larger one most is empty where a shot falls."""

WALKS_LEAST, WALKS_AT_FIRST, WALKS_MOST = 4, 64, 2**12
"""After all has moved shots walk, instead of making a square: so many into that square, or in all, and twice as many as
walked when all had moved before; how many that is taken for at first, and at most.

To make a square takes as long as a few of them where all has moved, and less than one of them where nothing does.
"""

FEW = 8
"""So many changes, or of a quarter of the items, are not taken for those of all."""

BIGS_BYTES = 2**25
"""Patterns of shots that walk, kept for one prepared weapon, bytes."""

KEPT_BYTES = 64 * 2**20
"""Squares and objects kept for one prepared weapon, bytes; beyond it all are made anew."""

EDGE = (POSITION_MAX >> CELL_SHIFT) - 2**12
"""Squares beyond it are not made: a shot that finds one needs no check of its range."""

FARTHEST = SIDE * EDGE // 2
"""Positions beyond it, px, go the way of `fire`."""

PIXEL = 257 / 512
"""The floor of a position moved by it is its whole pixel, (rint(256 v) + 128) // 256: a tie on the edge is even."""

ODD = math.nextafter(1 - PIXEL, 0)
"""The only position within the limits at which that sum is rounded up to a whole number."""

CELL_BYTES, SEEN_BYTES = 400, 400
"""What a square costs, and what is seen of an object beside its pixels, bytes."""

PIECE_BYTES = 200
"""What a piece costs beside its pixels, bytes."""

Seen = tuple[int, int, int, int, int, int, int]
"""Of a tile of an object: the least and greatest x, and y, where a part of a shot is looked up whose box meets it; what
is seen of it as integer rows, and their place as a number of bits in the world; and the id."""

Cell = tuple[Seen, ...]

UNMADE: Cell = ((0, -1, 0, -1, 0, 0, 0),)
"""Instead of a square that is not made yet."""

Shared = tuple[int, int, int, int, int, int]
"""What a round shares with an object: of the nearest pixel the squared distance, y and x, from the round's pixel; a
number that rises front to back; id of the object; and how many pixels."""

Look = Callable[[Any, Any, Answer], None]
"""Of a round whose pixel is x and y, tell an answer what it hits, in order.

One of compiled kernels takes any position, and raises an error of a key or a value if it is none whose pixel it knows.
"""

new = tuple.__new__
"""It makes a row in half the time that `HitRow` takes."""


ZERO = np.zeros(1, np.int64)
"""The number of the only shot."""


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
    """Squares as [i][j], each made when it is first asked for; none is so near to the ends of the range.

    Parameters
    ----------
    make : of i and j; it keeps what it made here, if it likes
    """

    def __init__(self, make: Callable[[int, int], Kind]) -> None:
        super().__init__()
        self.make = make

    def __missing__(self, i: int) -> Column[Kind]:
        if not -EDGE < i < EDGE:
            raise KeyError(i)
        return self.setdefault(i, Column(self, i))


class Column(dict[int, Kind]):
    """Squares of one i."""

    def __init__(self, made: Made[Kind], i: int) -> None:
        super().__init__()
        self.made, self.i = made, i

    def __missing__(self, j: int) -> Kind:
        if not -EDGE < j < EDGE:
            raise KeyError(j)
        return self.made.make(self.i, j)


class Squares:
    """Squares of one scene, and of a weapon with its filter.

    A pattern's row `stride` bits long is shifted by `y * stride + x - place` to lie on a tile of an object.

    Parameters
    ----------
    made : tiles near each square
    quick : the same, where a whole round is looked up: no look is needed where nothing is near; else empty
    """

    def __init__(self, scene: Scene, weapon: Weapon, pierce: bool, kept: Filter, frame: Frame) -> None:
        self.made: Made[Cell] = Made(self._asked)
        self._walked: dict[tuple[int, int], int] = {}  # shots that walked since all was forgotten, by square
        self._walks, self._before = WALKS_AT_FIRST, 0  # all of them, and before that
        self._bigs: Kept[object, BigPattern] = Kept(BIGS_BYTES, lambda big: big.nbytes)
        self._crowded = False  # whether anything was too much for a shot to walk
        self.stride = self._tile = 0
        self._tell = answer_of(weapon)[1]
        self._scene, self._shots, self._pierce = scene, kept.shots(weapon, (0, 0), (None, None, None)), pierce
        self._frame, self._corner, self._side = frame, frame.corner, frame.side
        self._stack: Stack | None = None
        self._ground: Ground | None = None
        self._seen = -1
        self._blocks: dict[tuple[int, int], list[Near]] = {}
        self._tiles: dict[int, dict[tuple[int, int], Seen]] = {}
        self.quick: Any = {} if frame.tiled else self.made
        self._cut = frame.tiled  # whether an object, or a round, may be met in several parts
        self.nbytes = 0
        self._lock = threading.Lock()

    def look(self, one: Round) -> tuple[Look, int]:
        """A function that looks up what a round hits; and how many bytes are kept for it."""
        made, stride, number, tell = self.made, self.stride, one.number, self._tell
        pieces, own = pieces_of(one.spans, self._frame, stride), object()

        def look(x: int, y: int, hits: Answer) -> None:
            """Look up the tiles near a pixel, and tell what is shared with them, the nearest first."""
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
        """Walk the tiles that a round may meet: squared distance, y, x, id and count of each object that it hits.

        Parameters
        ----------
        own : what no other round has

        Raises
        ------
        KeyError
            If they are so many, and it is so large, that `fire` is faster.
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
        """What shots walk; it is made for the first of them."""
        with self._lock:
            if self._ground is None:
                stack, tiles = self._stack, self._scene.items.tiles()
                assert stack is not None  # `follow` goes before
                boxes_xyxy = np.asfortranarray(tiles.boxes(stack.box_xyxy))  # side after side, as they are compared
                self._ground = Ground(stack, tiles, boxes_xyxy, self._pierce, self._scene.bounds)
            return self._ground

    def follow(self, stack: Stack) -> None:
        """Take note of the scene as it is now: what lies near a change is forgotten."""
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
        """Whether so much changed that squares will hardly pay, if that goes on; not at first."""
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
        """Forget what lies near what changed; False if that is not known, or so much that all may as well go."""
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
        """The square (i, j), if it is worth it by now to make it."""
        if self._crowded:
            return UNMADE
        often = self._walks >= WALKS_LEAST + 2 * self._before or self._walked.get((i, j), 0) >= WALKS_LEAST
        return self._square(i, j) if often else UNMADE

    def _square(self, i: int, j: int) -> Cell:
        """Make the square (i, j), if it is not there."""
        with self._lock:
            if self.nbytes > KEPT_BYTES:
                self._clear()
            column = self.made[i]
            if j not in column:
                column[j] = self._found(i, j)
                self.nbytes += _size(column[j])
            return column[j]

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
                    if seen[4]:
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

    def _placed(self, mask: Bools, x: int, y: int, item: int) -> Seen:
        """What is seen of a tile, in the box of what is; a part looked up at (x, y) begins at its first pixel."""
        (left, top, right, low), pixels = sides_of(mask)
        if not pixels:
            return 0, -1, 0, -1, 0, 0, item
        box = x + left - self._side + 1, x + right, y + top - self._side + 1, y + low
        bits = packed(mask[top : low + 1, left : right + 1], self.stride)
        return (*box, bits, (y + top) * self.stride + x + left, item)

    def _part(self, one: Near, box: Box) -> Bools:
        """Mask of an item in a box inside of its own."""
        assert self._stack is not None
        x, y, x_max, y_max = box
        return self._stack.mask(one.rank)[y - one.y : y_max - one.y + 1, x - one.x : x_max - one.x + 1]


def _gathered(shared: list[Shared]) -> list[Shared]:
    """Add up what lies in several tiles, or pieces, by object."""
    every: dict[int, Shared] = {}
    for one in shared:
        other = every.get(one[4])
        every[one[4]] = one if other is None else (*min(one[:4], other[:4]), one[4], one[5] + other[5])
    return list(every.values())


def _bytes(seen: Seen) -> int:
    """Bytes of what is kept of a tile of an object."""
    return SEEN_BYTES + seen[4].bit_length() // 7


def _size(cell: Cell) -> int:
    """Bytes of a square."""
    return CELL_BYTES + 8 * len(cell)
