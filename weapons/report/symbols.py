"""Symbols of verdicts and of rays: one shape and one colour each, readable in grey, the same for any OpenCV.

The ink of a pixel depends on the distance of its middle from the edge of a stroke. Points are in coordinates of the
picture, where pixel (x, y) is the square from (x, y) to (x + 1, y + 1).
"""

from __future__ import annotations

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, Image, Ints
from hitplanes.planes.grid.spans import slabs

Color = tuple[int, int, int]

MARKS: dict[str, tuple[Color, int]] = {
    "beyond": ((178, 184, 196), 190),
    "empty": ((255, 255, 255), 190),
    "outside": ((240, 228, 66), 220),
    "filtered": ((230, 140, 200), 235),
    "occluded": ((86, 180, 233), 245),
    "hit": ((255, 125, 15), 240),
}
"""Colour (after Okabe and Ito) and opacity of each verdict, in the order of drawing."""

HEAT = (
    (66, 10, 104), (106, 23, 110), (147, 38, 103), (188, 55, 84), (221, 81, 58), (243, 120, 25), (252, 165, 10),
    (246, 215, 70), (252, 255, 164),
)  # fmt: skip
"""Colours of heat, from the least to the most: after inferno (Smith, van der Walt 2015), rising in lightness."""

LET_THROUGH, PASSED_OVER = "let through to the pixels", "passed over, by box or volume"
SKETCH = {
    LET_THROUGH: (96, 226, 150),
    PASSED_OVER: (150, 156, 168),
    "volume of the shot": (255, 255, 255),
    "cell opened": (86, 180, 233),
    "cell": (96, 102, 114),
}
"""Colours of what may be drawn of a pre-filter: volumes of items, volumes of shots, cells."""

MARK_GROUND = (70, 74, 82)  # colour of the ground of a mark in a legend
TINT = 40  # opacity of a mark's ground, which shows all samples, even those too small for a shape each
EYE_MIN = 8  # least size of a block with an eye, px; the eye sets a hit off from the object in grey
SHAPE_MIN = 6  # least size of a shape on the page, px; smaller samples share one


def tiled_glyph(verdict: str, factor: int, shape: tuple[int, ...]) -> Bools:
    """Marks side by side over a page (height, width), one for each sample, or for a few where they are small."""
    size = factor if factor >= SHAPE_MIN // 2 else -(-SHAPE_MIN // factor) * factor
    tile = glyph(verdict, size)
    return np.tile(tile, (-(-shape[0] // size), -(-shape[1] // size)))[: shape[0], : shape[1]]


def glyph(verdict: str, size: int) -> Bools:
    """Shape (size, size) of a mark: block with an eye, cross, bar, frame, dot, dashes; a block if it is too small."""
    if size < 3:
        return np.ones((size, size), np.bool_)
    free = int(size > 3)  # larger marks leave a line between neighbours
    last = size - 1 - free
    y, x = np.mgrid[:size, :size]
    thick = max(1, size // 6)
    dot = (abs(2 * x - last) <= thick) & (abs(2 * y - last) <= thick)
    shapes = {
        "hit": ~dot if size >= EYE_MIN else np.ones((size, size), np.bool_),
        "occluded": (abs(x - y) < thick) | (abs(x + y - last) < thick),
        "filtered": abs(2 * y - last) <= thick,
        "outside": (x < thick) | (y < thick) | (x > last - thick) | (y > last - thick),
        "empty": dot,
        "beyond": (abs(2 * y - last) <= thick) & (x * 5 // size % 2 == 0),
    }
    return np.asarray(shapes[verdict] & (x <= last) & (y <= last), np.bool_)


def mark_of(where: Bools, color: Color, ground: Color = MARK_GROUND) -> Image:
    """Mark (h, w, 3) of a legend, in one colour on a ground."""
    return np.where(where[:, :, None], np.array(color, np.uint8), np.array(ground, np.uint8))


def verdict_mark(verdict: str, size: int = 14) -> Image:
    """Mark (size, size, 3) of a verdict, for a legend."""
    return mark_of(glyph(verdict, size), MARKS[verdict][0])


def sketch_mark(name: str) -> Image:
    """Mark of a volume, a rhombus unlike the outline of an object; or of a cell, filled if it was opened."""
    color = SKETCH[name]
    columns = np.abs(2 * np.arange(14) - 13)
    rows = columns[:, None]
    if name.startswith("cell"):
        ground = (np.array(color) + 2 * np.array(MARK_GROUND)) // 3 if name == "cell opened" else MARK_GROUND
        return mark_of(np.maximum(rows, columns) == 13, color, ground)
    away = rows + columns
    return mark_of((away <= 13) & (away > (7 if name == LET_THROUGH else 9)), color)


CASING = 1.5  # width of the dark border of a stroke, px; it makes light lines visible on light ground
DARK, DARK_ALPHA = (14, 16, 20), 190


class Strokes:
    """Strokes of one colour with a dark ground, on a picture (h, w); crossing strokes do not cover each other."""

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

    def lay(self, image: Image, color: Color, alpha: int, grounded: bool) -> None:
        """Blend the strokes over a picture (h, w, 3), on their ground or bare."""
        if grounded:
            paint(image, DARK, self.ground.astype(np.int64) * DARK_ALPHA * alpha // (255 * 255))
        paint(image, color, self.ink.astype(np.int64) * alpha // 255)

    def _put(self, x: Floats, y: Floats, inside: Floats) -> None:
        """Ink pixels by how far their middles lie inside a stroke, px; each pixel is given once."""
        column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        for plane, reach in ((self.ink, 0.0), (self.ground, CASING)):
            cover = np.rint(255 * np.clip(inside + reach + 0.5, 0, 1)).astype(np.uint8)
            plane[row, column] = np.maximum(plane[row, column], cover)

    def _near(self, begin: Floats, end: Floats, reach: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Middles (x, y) of the pixels near a segment, their distances from it, and their distances along it."""
        reach += CASING + 1
        cut_from, cut_to = within(begin[None], end[None], np.array(self.shape[::-1]), 2 * reach)
        if not len(cut_from):
            return (np.zeros(0),) * 4
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


def _pixels(a: Floats, b: Floats, reach: float, shape: tuple[int, int]) -> tuple[Floats, Floats]:
    """Middles (x, y) of the pixels of a picture within `reach` of a segment, and of some more; each once."""
    low = np.floor(np.maximum(np.minimum(a, b) - reach, 0))
    high = np.ceil(np.minimum(np.maximum(a, b) + reach, shape[::-1]))
    step = b - a
    main = int(abs(step[1]) > abs(step[0]))
    at = np.arange(low[main], high[main]) + 0.5
    part = np.clip((at - a[main]) / step[main], 0, 1) if step[main] else np.zeros(len(at))
    wide, whole = np.ceil(reach * np.sqrt(2.0)), high[1 - main] - low[1 - main]
    if 2 * wide < whole:
        across = np.floor(a[1 - main] + part * step[1 - main])[:, None] + np.arange(-wide, wide + 1) + 0.5
    else:
        across = np.broadcast_to(low[1 - main] + np.arange(whole) + 0.5, (len(at), int(max(whole, 0))))
    kept: Bools = (across > low[1 - main]) & (across < high[1 - main])
    along, across = np.broadcast_to(at[:, None], across.shape)[kept], across[kept]
    return (across, along) if main else (along, across)


def within(begin: Floats, end: Floats, size: Floats | Ints, over: float) -> tuple[Floats, Floats]:
    """Segments (n, 2) cut to a picture and a border of `over` px; segments outside are left out."""
    step = end - begin
    first, last = slabs(begin, step, np.full(2, -over), size + over)
    first, last = np.maximum(first, 0), np.minimum(last, 1)
    kept = first <= last
    return (begin + first[:, None] * step)[kept], (begin + last[:, None] * step)[kept]


def paint(image: Image, color: Color | Image, alpha: Ints) -> None:
    """Blend one colour, or colours (h, w, 3), over the pixels of an opacity (h, w) that is not 0, to the nearest."""
    row, column = np.nonzero(alpha)
    a = alpha[row, column][:, None]
    over, under = (np.broadcast_to(colors, image.shape)[row, column].astype(np.int64) for colors in (color, image))
    image[row, column] = (under * (255 - a) + over * a + 127) // 255


WHITE, ORANGE, BLUE = (255, 255, 255), MARKS["hit"][0], MARKS["occluded"][0]
MINT, YELLOW = (120, 240, 190), (255, 236, 130)
THROUGH = "in and out of an object"

SIGNS: dict[str, tuple[Color, int, bool]] = {
    "swept": (WHITE, 34, False),
    "what it sweeps": (WHITE, 150, False),
    "tested only here": (WHITE, 220, True),
    "beyond its end": (WHITE, 120, False),
    "near miss": (MINT, 255, True),
    "ray": (WHITE, 255, True),
    THROUGH: (ORANGE, 255, True),
    "goes in": (ORANGE, 255, True),
    "comes out": (ORANGE, 255, True),
    "first contact": (YELLOW, 255, True),
    "ends: last hit": (ORANGE, 255, True),
    "ends: budget": (ORANGE, 255, True),
    "ends: occluder": (BLUE, 255, True),
    "normal": (YELLOW, 255, True),
    "number": (ORANGE, 255, True),
}
"""Colour, opacity, and whether there is a dark ground, of each ray symbol, in the order of drawing."""

ENDS = {"hits": "ends: last hit", "budget": "ends: budget", "occluder": "ends: occluder"}
"""Symbol of each reason why a ray ended; a ray that comes to its range has an open head."""

FINE = 1.4  # width of thin lines, px
DASH = 6.0  # length of dashes, px
HEAD = 13.0  # length of the head of an arrow, px
DOT, RING, CROSS, BAR = 3.4, 4.2, 5.5, 8.0
"""Radius of the dot at an entry and of the ring at an exit, half sizes of the cross and the bar at an end, px."""

NEAR_MISS = 16  # largest miss that is drawn, px of the world; larger ones are only in the text
SEVERAL, CROWDED = 24, 120  # numbers of rays above which all rays of a picture are drawn thinner, and thinnest
BADGE = 8.5  # radius of the disc of a number, px
NORMAL = 17.0  # length of a normal, px


class Signs:
    """Ray symbols on one picture (h, w), in px of it; they are collected, then laid over it in order.

    Many rays are drawn thinner, and very many without the dashes beyond their ends.
    """

    def __init__(self, shape: tuple[int, int], rays: int = 1) -> None:
        self.shape = shape
        self.crowded = rays > CROWDED
        self.size = 0.4 if self.crowded else 0.7 if rays > SEVERAL else 1.0
        self.strokes: dict[str, Strokes] = {}

    def of(self, name: str) -> Strokes:
        """Strokes of one symbol."""
        return self.strokes.setdefault(name, Strokes(self.shape))

    def ray(self, begin: Floats, stop: Floats, end: Floats, reason: str) -> None:
        """Draw an arrow to the stop of a ray, the symbol of its reason, and dashes to the end of its range."""
        ahead = _unit(end - begin)
        length = np.sqrt(((stop - begin) ** 2).sum())
        head = min(HEAD * self.size, float(length))
        width = 2.4 * self.size
        if (stop != end).any() and not self.crowded:
            self.of("beyond its end").line(stop, end, FINE, DASH)
        shaft = self.of("ray")
        shaft.line(begin, stop, width)
        if reason == "range":
            for side in (-1, 1):
                back = stop - head * ahead * 0.85 + side * head * 0.5 * _across(ahead)
                shaft.line(stop, back, width)
            return
        if head > 0:
            self.of(ENDS["hits"] if reason == "hits" else "ray").head(stop, ahead, head)
        if reason == "budget":
            reach = BAR * self.size * _across(ahead)
            self.of(ENDS[reason]).line(stop - reach, stop + reach, 3.0 * self.size)
        if reason == "occluder":
            for reach in CROSS * self.size * np.array([(1.0, 1.0), (1.0, -1.0)]):
                self.of(ENDS[reason]).line(stop - reach, stop + reach, 2.6 * self.size)

    def through(self, begin: Floats, end: Floats, comes_out: bool = True) -> None:
        """Draw the part of a ray that lies in an object, where it goes in, and where it comes out, if it does."""
        self.of(THROUGH).line(begin, end, 3.2 * self.size)
        self.of("goes in").line(begin, begin, 2 * DOT * self.size)
        if comes_out:
            self.of("comes out").around(end, end, RING * self.size, 1.8 * self.size)

    def normal(self, at: Floats, direction: Floats) -> None:
        """Draw the normal where a ray goes in."""
        ahead = _unit(direction)
        tip = at + NORMAL * ahead
        self.of("normal").line(at + DOT * ahead, tip - 3 * ahead, FINE)
        self.of("normal").head(tip, ahead, 7.0)

    def miss(self, begin: Floats, end: Floats) -> None:
        """Draw the distance by which an object was missed as a dotted line between two bars."""
        strokes, across = self.of("near miss"), 4.5 * _across(_unit(end - begin))
        strokes.line(begin, end, FINE, 3.0)
        for at in (begin, end):
            strokes.line(at - across, at + across, FINE)

    def sweep(self, begin: Floats, end: Floats, radius: float, name: str = "what it sweeps") -> None:
        """Draw the area that a disc sweeps between two points, with an outline of that name."""
        self.of("swept").line(begin, end, 2 * radius)
        self.of(name).around(begin, end, radius, FINE)

    def contact(self, at: Floats, radius: float, pixel: Floats, factor: float) -> None:
        """Draw the disc at its first contact, and the middle of the pixel (of so many px) that it touches."""
        self.of("first contact").around(at, at, radius, FINE)
        half = factor / 2
        corners = pixel + half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
        for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            self.of("first contact").line(corner, following, 1.8)

    def lay(self, image: Image) -> set[str]:
        """Lay all symbols over a picture (h, w, 3), and return the names of the visible ones."""
        seen = set()
        for name, (color, alpha, grounded) in SIGNS.items():
            if name in self.strokes and self.strokes[name].ink.any():
                self.strokes[name].lay(image, color, alpha, grounded)
                seen.add(name)
        return seen


def sign_mark(name: str) -> Image:
    """Mark (14, w, 3) of a ray symbol, for a legend."""
    wide = 14 if name == "first contact" else 30
    signs = Signs((14, wide), SEVERAL + 1)
    left, middle, right = (np.array([x, 7.0]) for x in (2.0, wide / 2, wide - 4.0))
    if name in ENDS.values():
        signs.ray(left, right - 3, right - 3, next(reason for reason, sign in ENDS.items() if sign == name))
    elif name == "ray":
        signs.ray(left, right, right, "range")
    elif name == "beyond its end":
        signs.of(name).line(left, right, FINE, 4.0)
    elif name == "near miss":
        signs.miss(left, right)
    elif name == THROUGH:
        signs.through(left + 3, right - 4)
    elif name == "normal":
        signs.normal(left - 3, np.array([1.0, 0.0]))
    elif name == "what it sweeps":
        signs.sweep(left + 4, right - 4, 5.0)
    else:
        signs.of(name).around(middle, middle, RING, FINE)
    mark = np.full((14, wide, 3), MARK_GROUND, np.uint8)
    signs.lay(mark)
    return mark


def _unit(step: Floats) -> Floats:
    """Direction of a step with length 1; to the right for a step of length 0."""
    length = float(np.sqrt(step[0] ** 2 + step[1] ** 2))
    return np.asarray(step / length if length else np.array([1.0, 0.0]))


def _across(ahead: Floats) -> Floats:
    return np.array([-ahead[1], ahead[0]])
