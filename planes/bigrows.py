"""Rows of pixels in one Python integer: bit `y * stride + x` is pixel (x, y). What a single shot is answered with.

A shift places a pattern on an object and `&` gives the pixels that they share, however many rows there are:

    y = 0   . # # .        stride 5: 0b01111_00110, the first pixel lowest
    y = 1   # # # #

The stride leaves room for both side by side, so that what sticks out of a row meets nothing in the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planes.arrays import Bools, Ints
from planes.bits import WORD, Words
from planes.spans import Box, Spans

__all__ = ["BigPattern", "BigTiles", "Depths", "big_pattern", "packed", "pixels_of", "rows_of_spans", "stride_of"]

OFTEN = 8
"""Answers of a piece after which it is worth to make planes of its pixels: they take as long as so many without."""

PATTERN_BYTES, PLANES = 500, 10
"""What a pattern costs beside its pixels, bytes; and about as many times it has them, with the planes of its depths."""

TILES_BYTES_MOST = 2**23
"""Tiles are not kept as integers of one stride beyond it."""


def packed(mask: Bools, stride: int) -> int:
    """Rows of a mask (h, w) with w <= stride."""
    padded = np.zeros((mask.shape[0], stride), np.bool_)
    padded[:, : mask.shape[1]] = mask
    return int.from_bytes(np.packbits(padded.reshape(-1), bitorder="little").tobytes(), "little")


def rows_of_spans(spans: Spans, corner_xy: tuple[int, int], stride: int) -> int:
    """Rows of a set of pixels, of which none lies before a corner."""
    mask, (x, y) = spans.to_mask()
    return packed(mask, stride) << (y - corner_xy[1]) * stride + x - corner_xy[0] if mask.size else 0


def pixels_of(bits: int, stride: int) -> Ints:
    """Pixels as rows (x, y), ordered by (y, x)."""
    data = np.frombuffer(bits.to_bytes((bits.bit_length() + 7) // 8, "little"), np.uint8)
    y, x = np.divmod(np.flatnonzero(np.unpackbits(data, bitorder="little")), stride)
    return np.stack([x, y], axis=1)


class Depths:
    """The pixels of a piece by their distance from the round's pixel.

    Each distance has a number, the nearest 0. For each binary place there is a plane of the pixels whose number has no
    bit there: from the highest place on, what something shares with a plane is nearer than all else of it.

    Parameters
    ----------
    rows, stride : the piece
    x, y : its first column and row, from the round's pixel
    """

    def __init__(self, rows: int, stride: int, x: int, y: int) -> None:
        self._rows, self._stride, self._x, self._y, self._corner = rows, stride, x, y, np.array([x, y])
        self._planes: list[int] | None = None
        self._calls = 0

    @property
    def nbytes(self) -> int:
        """Bytes of the pixels, with the planes that tell the nearest of them: an integer has 30 bits in 4 bytes."""
        return PLANES * self._rows.bit_length() // 7

    def nearest(self, bits: int) -> tuple[int, int, int]:
        """Of some pixels of the piece the nearest: squared distance, y and x from the round's pixel; ties by (y, x)."""
        if self._planes is None:
            self._calls += 1
            if self._calls <= OFTEN:
                pixels, distance2 = self._pixels(bits)
                first = int(distance2.argmin())
                x, y = (pixels[first] + self._corner).tolist()
                return int(distance2[first]), y, x
            self._planes = self._made()
        for plane in self._planes:
            nearer = bits & plane
            if nearer:
                bits = nearer
        y, x = divmod((bits ^ bits - 1).bit_length() - 1, self._stride)
        x, y = x + self._x, y + self._y
        return x * x + y * y, y, x

    def _pixels(self, bits: int) -> tuple[Ints, Ints]:
        """Pixels (n, 2) of the piece, and their squared distances."""
        pixels = pixels_of(bits, self._stride)
        return pixels, ((pixels + self._corner) ** 2).sum(axis=1)

    def _made(self) -> list[int]:
        """The planes, the highest place first."""
        pixels, distance2 = self._pixels(self._rows)
        number = np.unique(distance2, return_inverse=True)[1].reshape(-1)
        places = np.arange(int(number.max(initial=0)).bit_length() - 1, -1, -1)
        mask = np.zeros((len(places), int(pixels[:, 1].max(initial=0)) + 1, self._stride), np.bool_)
        mask[:, pixels[:, 1], pixels[:, 0]] = (number >> places[:, None]) & 1 == 0
        return [packed(plane, self._stride) for plane in mask]


@dataclass(frozen=True, eq=False)
class BigPattern:
    """A pattern as integer rows, which leave room for a tile on either side.

    Parameters
    ----------
    x, y : its first column and row, about the pixel that it is placed on
    wide, high : its columns and rows
    stride : a multiple of WORD
    rows : its pixels
    depths : their order by distance
    """

    x: int
    y: int
    wide: int
    high: int
    stride: int
    rows: int
    depths: Depths

    @property
    def nbytes(self) -> int:
        """Bytes of the pixels, with the planes that tell the nearest of them."""
        return PATTERN_BYTES + self.depths.nbytes

    def within(self, x: int, y: int, bounds: Box) -> int:
        """Its pixels within bounds, where it is placed on a pixel."""
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
    """Stride of a pattern of so many columns."""
    return WORD * -(-(wide + WORD - 1) // WORD)


def big_pattern(spans: Spans) -> BigPattern:
    """A set of pixels about the pixel that it is placed on."""
    x, y, x_max, y_max = spans.box_xyxy or (0, 0, 0, 0)
    stride = stride_of(x_max - x + 1)
    rows = rows_of_spans(spans, (x, y), stride)
    return BigPattern(x, y, x_max - x + 1, y_max - y + 1, stride, rows, Depths(rows, stride, x, y))


class BigTiles(dict[int, int]):
    """Tiles as integer rows of one stride, by their first row in an atlas; each is made when it is first asked for."""

    def __init__(self, stride: int) -> None:
        super().__init__()
        self._columns, self._most = stride // WORD, TILES_BYTES_MOST // (WORD * stride // 8)

    def read(self, words: Words, begin: int) -> int:
        """A tile of 64 rows from a place on, each a word."""
        if len(self) > self._most:
            self.clear()
        rows = np.zeros((WORD, self._columns), "<u8")
        rows[:, 0] = words[begin : begin + WORD]
        made = self[begin] = int.from_bytes(rows.tobytes(), "little")
        return made
