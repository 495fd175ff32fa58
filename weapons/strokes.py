"""Smooth lines, discs and rings over a picture: the same bytes on any OpenCV, also where they leave it.

A pixel is inked by how far its middle lies inside of a stroke. Points are those of the picture: pixel (x, y) is the
square from (x, y) to (x + 1, y + 1).
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Bools, Floats, Image, Ints
from planes.slabs import slabs

__all__ = ["Strokes", "within"]

CASING = 1.5
"""How far the dark ground of a stroke reaches beyond it, px: light lines can be told on light ground."""

DARK, DARK_ALPHA = (14, 16, 20), 190

BRUSH = 24.0
"""Wider strokes are looked for in their whole box, px; thinner ones along their line."""


class Strokes:
    """Strokes of one colour, and the dark ground under them: where they cross, none covers another.

    Parameters
    ----------
    shape : (h, w) of the picture
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self.ink: Image = np.zeros(shape, np.uint8)
        self.ground: Image = np.zeros(shape, np.uint8)

    def line(self, begin: Floats, end: Floats, width: float, dash: float = 0.0) -> None:
        """Draw a line with round ends; or dashes of a length, with gaps as long, counted from the beginning."""
        x, y, away, along = self._near(begin, end, width / 2)
        inside = width / 2 - away
        if dash:
            inside = np.minimum(inside, dash / 2 - np.abs(along % (2 * dash) - dash / 2))
        self._put(x, y, inside)

    def around(self, begin: Floats, end: Floats, radius: float, width: float) -> None:
        """Draw the outline of a capsule, or a ring about a point; the middle of the line is its edge."""
        x, y, away, _ = self._near(begin, end, radius + width / 2)
        self._put(x, y, width / 2 - np.abs(away - radius))

    def head(self, tip: Floats, ahead: Floats, length: float) -> None:
        """Draw the head of an arrow that goes along a direction of length 1."""
        x, y, _, _ = self._near(tip - length * ahead, tip, length)
        back = (tip[0] - x) * ahead[0] + (tip[1] - y) * ahead[1]
        beside = np.abs((tip[0] - x) * ahead[1] - (tip[1] - y) * ahead[0])
        slant = 0.5
        edge = (back * slant - beside) / np.sqrt(1 + slant * slant)
        self._put(x, y, np.minimum(edge, length - back))

    def lay(self, image: Image, color: tuple[int, int, int], alpha: int, grounded: bool) -> None:
        """Blend the strokes over a picture (h, w, 3), on their ground or bare."""
        if grounded:
            _blend(image, DARK, self.ground.astype(np.int64) * DARK_ALPHA * alpha // (255 * 255))
        _blend(image, color, self.ink.astype(np.int64) * alpha // 255)

    def _put(self, x: Floats, y: Floats, inside: Floats) -> None:
        """Ink pixels by how far their middles lie inside of a stroke, px; a pixel is told once."""
        column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        for plane, reach in ((self.ink, 0.0), (self.ground, CASING)):
            cover = np.rint(255 * np.clip(inside + reach + 0.5, 0, 1)).astype(np.uint8)
            plane[row, column] = np.maximum(plane[row, column], cover)

    def _near(self, begin: Floats, end: Floats, reach: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Middles (x, y) of the pixels near a segment, how far from it they are, and how far along."""
        reach += CASING + 1
        cut_from, cut_to = within(begin[None], end[None], np.array(self.shape[::-1]), 2 * reach)
        if not len(cut_from):
            return _NOWHERE
        a, b = cut_from[0], cut_to[0]
        x, y = _pixels(a, b, reach, self.shape)
        step = b - a
        length = float(np.sqrt(step[0] ** 2 + step[1] ** 2))
        ahead = step / length if length else step
        along = (x - a[0]) * ahead[0] + (y - a[1]) * ahead[1]
        over = along - np.clip(along, 0, length)
        beside = (x - a[0]) * ahead[1] - (y - a[1]) * ahead[0] if length else np.sqrt((x - a[0]) ** 2 + (y - a[1]) ** 2)
        before = a - begin
        along = along + np.sqrt(before[0] ** 2 + before[1] ** 2)
        return x, y, np.sqrt(beside**2 + over**2), along


_NOWHERE = (np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))


def _pixels(a: Floats, b: Floats, reach: float, shape: tuple[int, int]) -> tuple[Floats, Floats]:
    """Middles (x, y) of the pixels of a picture that lie so near to a segment, and of some beyond; each once."""
    low = np.floor(np.maximum(np.minimum(a, b) - reach, 0))
    high = np.ceil(np.minimum(np.maximum(a, b) + reach, shape[::-1]))
    if (low >= high).any():
        return np.zeros(0), np.zeros(0)
    if reach > BRUSH:
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]].reshape(2, -1) + 0.5
        return x, y
    step = b - a
    main = int(abs(step[1]) > abs(step[0]))
    at = np.arange(low[main], high[main]) + 0.5
    part = np.clip((at - a[main]) / step[main], 0, 1) if step[main] else np.zeros(len(at))
    wide = np.ceil(reach * np.sqrt(2.0))
    across = np.floor(a[1 - main] + part * step[1 - main])[:, None] + np.arange(-wide, wide + 1) + 0.5
    kept: Bools = (across > low[1 - main]) & (across < high[1 - main])
    along, across = np.broadcast_to(at[:, None], across.shape)[kept], across[kept]
    return (across, along) if main else (along, across)


def within(begin: Floats, end: Floats, size: Floats | Ints, over: float) -> tuple[Floats, Floats]:
    """Cut segments (n, 2) to a picture and so much around it; those that lie elsewhere are left out."""
    step = end - begin
    first, last = slabs(begin, step, np.full(2, -over), size + over)
    first, last = np.maximum(first, 0), np.minimum(last, 1)
    some = first <= last
    return (begin + first[:, None] * step)[some], (begin + last[:, None] * step)[some]


def _blend(image: Image, color: tuple[int, int, int], alpha: Ints) -> None:
    """Blend a colour over the pixels of an opacity (h, w) that is not 0; rounded to the nearest."""
    row, column = np.nonzero(alpha)
    a = alpha[row, column][:, None]
    under = image[row, column].astype(np.int64)
    image[row, column] = (under * (255 - a) + np.array(color) * a + 127) // 255
