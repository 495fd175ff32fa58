"""Tiles: masks cut into bit rows of up to 64 x 64 px; and sets of pixels as Python integers, for a few shots.

An integer holds all rows of a set of pixels. A shift places a pattern on a tile, and `&` gives the shared pixels:

    y = 0   . # # .        stride 5: 0b01111_00110, the first pixel lowest
    y = 1   # # # #

The stride leaves room for both sets side by side, so that pixels shifted out of a row meet nothing in the next.
`front_to_back` answers the same shots with arrays; for a few placements one call of numpy takes as long as a pair here.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby, takewhile
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..common import costs
from ..common.checks import Bools, Ints
from ..common.limits import WEIGHT_FULL
from ..grid.spans import Box, Spans, meets, ragged
from ..scene.items import Stack
from ..scene.variants import Carved
from .bit_rows import WORD, Placed, Sums, Words, packed
from .front_to_back import NO_NUMBERS, OrderedTiles

OFTEN = 32
"""Answers of a pattern after which the planes of its depths, and of its weights, are made; they take as long."""

NO_PIXEL = (1 << 62, 0, 0)
"""Squared distance, y and x of no pixel, which are greater than those of any."""

PATTERN_BYTES = 500
"""Memory of a pattern beside its pixels, bytes."""

PLANES = 10
"""Approximate number of copies of its pixels that a pattern holds, including the planes of its depths."""

TILES_BYTES_MOST = 2**23
"""Size of the cache of tiles as integers of one stride, bytes."""


def packed_integer(mask: Bools, stride: int) -> int:
    """Rows of a mask (h, w) as one integer; w <= stride."""
    padded = np.zeros((mask.shape[0], stride), np.bool_)
    padded[:, : mask.shape[1]] = mask
    return int.from_bytes(np.packbits(padded.reshape(-1), bitorder="little").tobytes(), "little")


def rows_of_spans(spans: Spans, corner_xy: tuple[int, int], stride: int) -> int:
    """Rows of a set of pixels as one integer that begins at a corner; no pixel lies left of or above it."""
    mask, (x, y) = spans.to_mask()
    return packed_integer(mask, stride) << (y - corner_xy[1]) * stride + x - corner_xy[0] if mask.size else 0


def pixels_of(bits: int, stride: int) -> Ints:
    """Pixels (n, 2) of an integer, rows (x, y) ordered by (y, x)."""
    data = np.frombuffer(bits.to_bytes((bits.bit_length() + 7) // 8, "little"), np.uint8)
    y, x = np.divmod(np.flatnonzero(np.unpackbits(data, bitorder="little")), stride)
    return np.stack([x, y], axis=1)


def nearest_of(bits: int, stride: int, left: int, top: int) -> tuple[int, int, int]:
    """Squared distance, y and x of the nearest pixel of a set from pixel (0, 0); ties go to the least (y, x).

    Rows are looked at from y = 0 on, down and then up, until they lie farther away than the nearest pixel.

    Parameters
    ----------
    bits, stride : the pixels, at least one, as an integer
    left, top : its first column and row
    """
    first = ((bits & -bits).bit_length() - 1) // stride
    top, size, zero = top + first, stride >> 3, -left
    count = (bits.bit_length() - 1) // stride + 1 - first
    rows = (bits >> first * stride).to_bytes(count * size, "little")
    begin = min(max(-top, 0), count - 1)
    best = NO_PIXEL
    down = takewhile(lambda k: (top + k) ** 2 <= best[0], range(begin, count))
    up = takewhile(lambda k: (top + k) ** 2 <= best[0], range(begin - 1, -1, -1))
    for k in chain(down, up):
        y, row = top + k, int.from_bytes(rows[k * size : (k + 1) * size], "little")
        if zero >= 0:
            behind = row & (2 << zero) - 1
            if behind:
                x = behind.bit_length() - 1 - zero
                best = min(best, (x * x + y * y, y, x))
            row >>= zero + 1
        if row:
            x = (row & -row).bit_length() + (0 if zero >= 0 else left - 1)
            best = min(best, (x * x + y * y, y, x))
    return best


class Depths:
    """Planes that find the nearest pixel of a subset of a pattern, or of a part of it.

    Distances are numbered from 0, the nearest. Each binary digit has a plane of the pixels whose number has a 0 there.
    From the highest digit on, pixels of the subset that lie in the plane are nearer than those that do not.

    Parameters
    ----------
    rows, stride : the pixels as an integer
    x, y : first column and row, relative to the round's pixel
    """

    def __init__(self, rows: int, stride: int, x: int, y: int) -> None:
        self._rows, self._stride, self._x, self._y = rows, stride, x, y
        self._planes: list[int] | None = None
        self._calls = 0

    @property
    def nbytes(self) -> int:
        """Bytes of the pixels and the planes; a Python integer holds 30 bits in 4 bytes."""
        return PLANES * self._rows.bit_length() // 7

    def nearest(self, bits: int) -> tuple[int, int, int]:
        """Squared distance, y and x of the nearest pixel of a subset, from the round's; ties go to the least (y, x)."""
        if self._planes is None:
            self._calls += 1
            if self._calls <= OFTEN:
                return nearest_of(bits, self._stride, self._x, self._y)
            self._planes = self._made()
        for plane in self._planes:
            nearer = bits & plane
            if nearer:
                bits = nearer
        y, x = divmod((bits ^ bits - 1).bit_length() - 1, self._stride)
        x, y = x + self._x, y + self._y
        return x * x + y * y, y, x

    def _made(self) -> list[int]:
        """The planes, that of the highest digit first."""
        pixels = pixels_of(self._rows, self._stride)
        pixels_xy = pixels + np.array([self._x, self._y])
        distance2 = (pixels_xy**2).sum(axis=1)
        number = np.unique(distance2, return_inverse=True)[1].reshape(-1)
        places = np.arange(int(number.max(initial=0)).bit_length() - 1, -1, -1)
        mask = np.zeros((len(places), int(pixels[:, 1].max(initial=0)) + 1, self._stride), np.bool_)
        mask[:, pixels[:, 1], pixels[:, 0]] = (number >> places[:, None]) & 1 == 0
        return [packed_integer(plane, self._stride) for plane in mask]


class Weights:
    """Sums of the weights of subsets of a pattern.

    Each binary digit of the weights has a plane of the pixels whose weight has a 1 there.

    Parameters
    ----------
    each : (h, w) weight of each pixel of the pattern's box, up to WEIGHT_FULL
    stride : of the integers
    """

    def __init__(self, each: Ints, stride: int) -> None:
        self.each, self._stride = each, stride
        self._planes: list[int] | None = None
        self._calls = 0

    @property
    def nbytes(self) -> int:
        """Bytes of the weights and of the planes."""
        planes = WEIGHT_FULL.bit_length() * len(self.each) * self._stride // 7
        return planes + int(self.each.nbytes)

    def of(self, bits: int) -> int:
        """Sum of the weights of a subset."""
        if self._planes is None:
            self._calls += 1
            if self._calls <= OFTEN:
                x, y = pixels_of(bits, self._stride).T
                return int(self.each[y, x].sum())
            digits = [self.each >> digit & 1 == 1 for digit in range(WEIGHT_FULL.bit_length())]
            self._planes = [packed_integer(plane, self._stride) for plane in digits]
        return sum((bits & plane).bit_count() << digit for digit, plane in enumerate(self._planes))


@dataclass(frozen=True, eq=False)
class BigPattern:
    """A pattern as one integer, whose stride leaves room for a tile on either side.

    Parameters
    ----------
    x, y : first column and row, relative to the pixel that it is placed on
    wide, high : columns and rows
    stride : a multiple of WORD
    rows : the pixels
    depths : the planes that find the nearest pixel
    weights : of the pixels; None if all are at full weight
    """

    x: int
    y: int
    wide: int
    high: int
    stride: int
    rows: int
    depths: Depths
    weights: Weights | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of the pixels and of the planes of their depths and weights."""
        return PATTERN_BYTES + self.depths.nbytes + (self.weights.nbytes if self.weights else 0)

    def weighted(self, sums: Sums) -> BigPattern:
        """The same pattern with weights, given as sums along its rows, as `PatternBits` has them."""
        each = np.diff(sums[: self.high * (self.wide + 1)].reshape(self.high, self.wide + 1), axis=1)
        return replace(self, weights=Weights(each.astype(np.int64), self.stride))

    def share(self, bits: int, count: int) -> int:
        """What a hit on a tile, of so many pixels, adds to that on its item: the weights of the pixels."""
        return self.weights.of(bits) if self.weights else count * WEIGHT_FULL

    def counted(self, share: int, pixels: int) -> tuple[int, int, int]:
        """Samples, weight and pellets of a hit on an item."""
        return pixels, share, 1

    def within(self, x: int, y: int, bounds: Box) -> int:
        """Its pixels within bounds, if it is placed on pixel (x, y)."""
        left, top = x + self.x, y + self.y
        first, last = max(bounds[0] - left, 0), min(bounds[2] - left, self.wide - 1)
        upper, lower = max(bounds[1] - top, 0), min(bounds[3] - top, self.high - 1)
        if (first, upper, last, lower) == (0, 0, self.wide - 1, self.high - 1):
            return self.rows
        if first > last or upper > lower:
            return 0
        row = ((1 << last - first + 1) - 1 << first).to_bytes(self.stride // 8, "little")
        return self.rows & int.from_bytes(row * (lower - upper + 1), "little") << self.stride * upper


def stride_of(wide: int) -> int:
    """Stride of a pattern of `wide` columns, px."""
    return WORD * -(-(wide + WORD - 1) // WORD)


def big_pattern(spans: Spans) -> BigPattern:
    """A pattern as one integer."""
    x, y, x_max, y_max = spans.box_xyxy or (0, 0, 0, 0)
    stride = stride_of(x_max - x + 1)
    rows = rows_of_spans(spans, (x, y), stride)
    return BigPattern(x, y, x_max - x + 1, y_max - y + 1, stride, rows, Depths(rows, stride, x, y))


class BigTiles(dict[int, int]):
    """Tiles as integers of one stride, by their first row in an atlas; each is made when it is first read."""

    def __init__(self, stride: int) -> None:
        super().__init__()
        self._columns, self.nbytes_each = stride // WORD, WORD * stride // 8
        self._most = TILES_BYTES_MOST // self.nbytes_each

    def read(self, words: Words, begin: int) -> int:
        """Make the tile whose 64 rows begin at a place in `words`."""
        if len(self) > self._most:
            self.clear()
        rows = np.zeros((WORD, self._columns), "<u8")
        rows[:, 0] = words[begin : begin + WORD]
        made = self[begin] = int.from_bytes(rows.tobytes(), "little")
        return made


STRIDE = 3 * WORD
"""Words from one tile to the next: 64 rows of pixels, with 64 empty rows before and after."""

ATLAS_SLACK = 4096
"""Unused tiles that an atlas may keep, 6 MB, beyond as many as are in use."""

STRIDES_MOST = 8
"""Most strides for which tiles are kept as integers."""

PACKED_AT_ONCE = 1024
"""Tiles packed at a time; their unpacked pixels take 4 KB each."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """The tiles of a stack, front to back, as columns.

    Parameters
    ----------
    rank : (T,) place in the stack of each tile's item, rising
    inside_xyxy : (T, 4) inclusive box of the tile on its item's mask, up to 64 px wide and high
    begin : (T,) first row in `words`
    words : flat rows of all tiles
    whole : whether each item is one tile
    bigs : tiles as integers, by stride
    """

    rank: Ints
    inside_xyxy: Ints
    begin: Ints
    words: Words
    whole: bool
    bigs: dict[int, BigTiles]

    def __len__(self) -> int:
        return len(self.rank)

    def of(self, rank: Ints) -> tuple[Ints, Ints]:
        """Tiles of items of ranks (n,), as (place in `rank`, tile)."""
        if self.whole:
            return np.arange(len(rank)), rank
        begin = np.searchsorted(self.rank, rank)
        place, tile = ragged(np.searchsorted(self.rank, rank, side="right") - begin)
        return place, begin[place] + tile

    def each(self, column: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """A column of items (M,) as a column of their tiles (T,)."""
        return column if self.whole else column[self.rank]

    def boxes(self, items_xyxy: Ints) -> Ints:
        """Inclusive boxes (T, 4) of tiles, from the boxes (M, 4) of the stack's items."""
        if self.whole:
            return items_xyxy
        boxes: Ints = items_xyxy.take(self.rank, axis=0)
        boxes[:, 2:] = boxes[:, :2]
        boxes += self.inside_xyxy
        return boxes

    def big(self, stride: int) -> BigTiles:
        """Tiles as integers of a stride, by `begin`."""
        known = self.bigs.get(stride)
        if known is None:
            if len(self.bigs) >= STRIDES_MOST:
                self.bigs.clear()
            known = self.bigs[stride] = BigTiles(stride)
        return known

    def ordered(self, stack: Stack, covers: Bools, choosy: bool) -> OrderedTiles:
        """The tiles of a stack at their places in the world; with the columns of filters if a shot may refuse items.

        Parameters
        ----------
        covers : (M,) items that hide others and are not hit; (0,) if there are none
        """
        whose = (self.each(stack.categories), self.each(stack.owner)) if choosy else ()
        covers = self.each(covers) if len(covers) else covers
        return OrderedTiles(self.rank, self.boxes(stack.box_xyxy), self.begin, self.words, covers, *whose)


class TileAtlas:
    """Tiles of masks, by the number of the mask; unused tiles are dropped in time.

    Each has a slot of STRIDE words, which is written once, so that tiles that were handed out never change. Those of a
    mask have rows of columns one after another; a carved mask takes over the rows of the mask before it.
    """

    def __init__(self) -> None:
        self.words: Words = np.zeros(4 * STRIDE, np.uint64)
        self._columns = np.zeros((4, 5), np.int64)  # left, top, width, height, slot
        self._used = self._enough = 0  # slots, and as many rows; with more than enough, unused tiles are searched
        self._places: dict[int, tuple[int, int]] = {}  # by mask number: first row, and count
        self._number, self._rows = NO_NUMBERS, np.zeros((0, 2), np.int64)  # of the last stack: masks, places
        self._last: tuple[int, Tiles] | None = None
        self._bigs: dict[int, BigTiles] = {}
        self._lock = threading.Lock()

    def known(self, arrangement: int) -> Tiles | None:
        """Tiles of the last stack, if its arrangement had this number."""
        last = self._last
        return last[1] if last is not None and last[0] == arrangement else None

    def tiles(
        self, mask_of: Callable[[int], Bools], number: Ints, arrangement: int,
        carved_of: Callable[[int], Carved] = lambda _: (),
    ) -> Tiles:  # fmt: skip
        """Tiles of the items of a stack.

        Parameters
        ----------
        mask_of : returns the mask (h, w) of the item of a rank
        number : (M,) number of each item's mask; equal masks may have the same
        arrangement : number of the stack's arrangement; stacks with the same have the same tiles
        carved_of : returns the masks that the one of a rank was carved out of, see `Variant`
        """
        with self._lock:
            if self._last is None or self._last[0] != arrangement:
                self._last = arrangement, self._listed(*self._found(mask_of, number, carved_of))
            return self._last[1]

    def _listed(self, first: Ints, count: Ints) -> Tiles:
        """Tiles of masks (M,), each in `count` rows from `first` on."""
        whole = bool((count == 1).all())
        rank, place = (np.arange(len(count)), 0) if whole else ragged(count)
        columns = self._columns.take(first[rank] + place, axis=0)
        whole &= not columns[:, :2].any()
        return Tiles(rank, _boxes_of(columns), columns[:, 4] * STRIDE + WORD, self.words, whole, self._bigs)

    def _found(self, mask_of: Callable[[int], Bools], number: Ints, carved_of: Callable[[int], Carved]) -> Ints:
        """First row and count (2, M) of each mask of a stack; masks that the atlas does not hold are added."""
        every, fresh = np.arange(len(number)), len(self._number) != len(number)
        changed = every if fresh else np.flatnonzero(self._number != number)
        masks = zip(number[changed].tolist(), changed.tolist(), strict=True)
        missing = {mask: rank for mask, rank in masks if mask not in self._places}
        added = [rank for rank in missing.values() if not self._carve(rank, mask_of, number, carved_of(rank))]
        if fresh or self._used > self._enough:
            self._drop_unused(number)
            changed, self._rows = every, np.zeros((len(number), 2), np.int64)
        self._add([(number.item(rank), mask_of(rank)) for rank in added])
        places = [self._places[mask] for mask in number[changed].tolist()]
        self._rows[changed] = np.array(places, np.int64).reshape(-1, 2)
        self._number = number
        return self._rows.T

    def _drop_unused(self, number: Ints) -> None:
        """Keep only the tiles of the given masks, if that halves the atlas."""
        used = {mask: self._places[mask] for mask in sorted(set(number.tolist())) if mask in self._places}
        first, count = np.array(list(used.values()), np.int64).reshape(-1, 2).T
        kept = int(count.sum())
        self._enough = 2 * kept + ATLAS_SLACK
        if self._used <= self._enough:
            return
        which, place = ragged(count)
        columns, words = self._columns[first[which] + place], self.words.reshape(-1, STRIDE)
        self._allot(max(2 * kept, 4))
        self.words.reshape(-1, STRIDE)[:kept] = words[columns[:, 4]]
        columns[:, 4] = np.arange(kept)
        self._columns[:kept] = columns
        begin = (np.cumsum(count) - count).tolist()
        self._places = dict(zip(used, zip(begin, count.tolist(), strict=True), strict=True))
        self._used, self._bigs = kept, {}

    def _allot(self, slots: int) -> None:
        self.words, self._columns = np.zeros(slots * STRIDE, np.uint64), np.zeros((slots, 5), np.int64)

    def _add(self, masks: Sequence[tuple[int, Bools]]) -> None:
        """Cut masks into tiles; tiles without a pixel are left out."""
        parts = [
            (which, left, top, mask[top : top + WORD, left : left + WORD])
            for which, (_, mask) in enumerate(masks)
            for top in range(0, mask.shape[0], WORD)
            for left in range(0, mask.shape[1], WORD)
        ]
        begin, count = self._used, np.zeros(len(masks), np.int64)
        for first in range(0, len(parts), PACKED_AT_ONCE):
            count += np.bincount(self._put(parts[first : first + PACKED_AT_ONCE]), minlength=len(masks))
        places = zip((begin + np.cumsum(count) - count).tolist(), count.tolist(), strict=True)
        self._places.update(zip((number for number, _ in masks), places, strict=True))

    def _carve(self, rank: int, mask_of: Callable[[int], Bools], number: Ints, carved: Carved) -> bool:
        """Make the tiles of a carved mask of those of a mask before it, if the atlas has them and no item uses them.

        Only the few tiles that holes meet are packed. Returned is whether it was done.
        """
        ages = [age for age, (before, _) in enumerate(carved) if before in self._places]
        if not ages or (number == carved[ages[0]][0]).any():
            return False
        before, holes = carved[ages[0]][0], np.array([hole for _, hole in carved[: ages[0] + 1]])
        (first, count), mask, begin = self._places[before], mask_of(rank), self._used
        boxes = _boxes_of(self._columns[first : first + count])
        met = np.flatnonzero(meets(boxes[:, None], holes).any(axis=1))
        if len(met) > PACKED_AT_ONCE:
            return False
        corners = zip(met.tolist(), boxes[met, :2].tolist(), strict=True)
        filled = self._put([(row, x, y, mask[y : y + WORD, x : x + WORD]) for row, (x, y) in corners])
        columns = self._columns[first : first + count]  # `_put` may have laid them out anew
        columns[filled, 4] = np.arange(begin, self._used)
        left = np.delete(columns, np.setdiff1d(met, filled), axis=0)
        columns[: len(left)] = left
        self._places[number.item(rank)] = self._places.pop(before)[0], len(left)
        return True

    def _put(self, parts: Sequence[tuple[int, int, int, Bools]]) -> Ints:
        """Pack parts (mask, left, top, pixels) into the next slots; return the masks of those that have a pixel."""
        rows = packed([part for *_, part in parts])
        columns = np.array([(which, left, top, *part.shape[::-1]) for which, left, top, part in parts])
        full = np.flatnonzero(rows.any(axis=1))
        begin, end = self._used, self._used + len(full)
        if end > len(self._columns):
            old = self.words, self._columns
            self._allot(max(end, 2 * len(old[1])))
            self.words[: len(old[0])], self._columns[: len(old[1])] = old
        self.words.reshape(-1, STRIDE)[begin:end, WORD : 2 * WORD] = rows[full]
        self._columns[begin:end, :4], self._columns[begin:end, 4] = columns[full, 1:], np.arange(begin, end)
        self._used = end
        return np.asarray(columns[full, 0])


def _boxes_of(columns: Ints) -> Ints:
    """Inclusive boxes (n, 4) of tiles, from columns of an atlas."""
    return np.concatenate([columns[:, :2], columns[:, :2] + columns[:, 2:4] - 1], axis=1)


Hit = tuple[int, int, int, int, int, int, int]
"""Placement; squared distance, y and x of the nearest pixel; rank of the item; number of pixels, and their share."""

Pair = tuple[int, int, int, int, int, bool]
"""Placement, and a tile near it: left, top, first row in the atlas, rank of its item, whether that is an occluder."""


class Ground(NamedTuple):
    """What patterns are placed on.

    Parameters
    ----------
    stack : the items
    tiles, boxes_xyxy : their tiles, and the boxes (T, 4) of these
    pierce : whether pixels go on through objects; they end at occluders
    bounds : box beyond which nothing is hit
    covers : (M,) items that end pixels and are not hit: occluders; (0,) if there are none
    """

    stack: Stack
    tiles: Tiles
    boxes_xyxy: Ints
    pierce: bool
    bounds: Box | None
    covers: Bools


def tiles_in(stack: Stack) -> int:
    """About how many tiles the masks of a stack have: one each, or as many as cover them, if masks are large."""
    return max(len(stack), stack.area // WORD**2)


def visible_ns(stack: Stack, now: costs.Costs) -> float:
    """Time to make the visible set of a stack, ns."""
    return now.visible_made + tiles_in(stack) * now.visible_tile


def integers_ns(pairs: float, wide: int, high: int) -> float:
    """Time to count pairs of a tile and a pattern of `wide` columns and `high` rows, ns."""
    return pairs * (costs.NUMPY.integers_pair + costs.NUMPY.integers_bit * stride_of(wide) * high)


def hit_by_few(placed: Placed, patterns: Sequence[BigPattern], near: tuple[Ints, Ints], ground: Ground) -> list[Hit]:
    """Hits of placed patterns, in the order of rows.

    Parameters
    ----------
    placed : placements; distances are counted from the pixels that patterns are placed on
    patterns : the distinct patterns
    near : sorted pairs (n,) of a placement and an accepted tile that it may meet
    """
    hits: list[Hit] = []
    for placement, close in groupby(_near(*near, ground), itemgetter(0)):
        pattern, x, y = patterns[placed.pattern.item(placement)], placed.x.item(placement), placed.y.item(placement)
        hits += in_order(_hit_by(pattern, x, y, close, ground))
    return hits


def hit_by_one(pattern: BigPattern, x: int, y: int, near: tuple[Ints, Ints], ground: Ground) -> list[Hit]:
    """Like `hit_by_few`, for one pattern on pixel (x, y)."""
    return in_order(_hit_by(pattern, x, y, _near(*near, ground), ground))


def _near(placement: Ints, tile: Ints, ground: Ground) -> Iterator[Pair]:
    """Pairs of placements and tiles, with the columns of the tiles."""
    if not len(tile):
        return iter(())
    rank, box = ground.tiles.rank[tile], ground.boxes_xyxy[tile]
    blocks = ground.covers[rank] if len(ground.covers) else np.zeros(len(rank), np.bool_)
    columns = placement, box[:, 0], box[:, 1], ground.tiles.begin[tile], rank, blocks
    return zip(*(column.tolist() for column in columns), strict=True)


# house: hit rule of areas
def _hit_by(pattern: BigPattern, x: int, y: int, near: Iterator[Pair], ground: Ground) -> Iterator[Hit]:
    """Hits of one placed pattern on each tile, front to back."""
    _, tiles, _, pierce, bounds, _ = ground
    rest = pattern.rows if bounds is None else pattern.within(x, y, bounds)
    stride, known, nearest = pattern.stride, tiles.big(pattern.stride), pattern.depths.nearest
    corner = (y + pattern.y) * stride + x + pattern.x
    for placement, left, top, begin, rank, blocks in near:
        rows = known.get(begin)
        if rows is None:
            rows = known.read(tiles.words, begin)
        shift = top * stride + left - corner
        hit = (rows << shift if shift >= 0 else rows >> -shift) & rest
        if hit:
            if not blocks:
                (distance2, down, right), count = nearest(hit), hit.bit_count()
                yield placement, distance2, y + down, x + right, rank, count, pattern.share(hit, count)
            if blocks or not pierce:
                rest ^= hit
                if not rest:
                    return


# house: row order
def in_order(hits: Iterable[Hit]) -> list[Hit]:
    """Hits of a placement on items, in the order of rows, from those on tiles, front to back."""
    items: list[Hit] = []
    last = -1
    for hit in hits:
        if hit[4] == last:
            other = items.pop()
            items.append((*min(hit[:5], other[:5]), hit[5] + other[5], hit[6] + other[6]))
        else:
            items.append(hit)
            last = hit[4]
    items.sort()
    return items
