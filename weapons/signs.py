"""Signs of rays, drawn on pictures and in their legend: arrows, where they go in and out, why they ended."""

from __future__ import annotations

import numpy as np

from planes.arrays import Floats, Image
from weapons.marks import MARKS
from weapons.strokes import Strokes

__all__ = [
    "BADGE", "BLUE", "CROWDED", "MINT", "NEAR_MISS", "ORANGE", "SEVERAL", "SIGNS", "THROUGH", "YELLOW", "Signs",
    "sign_mark",
]  # fmt: skip

WHITE, ORANGE, BLUE = (255, 255, 255), MARKS["hit"][0], MARKS["occluded"][0]
MINT, YELLOW = (120, 240, 190), (255, 236, 130)

THROUGH = "in and out of an object"

SIGNS: dict[str, tuple[tuple[int, int, int], int, bool]] = {
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
"""Colour, opacity and whether there is a dark ground, of what is told of rays, in the order of drawing."""

ENDS = {"hits": "ends: last hit", "budget": "ends: budget", "occluder": "ends: occluder"}
"""The sign of why a ray ended; one that comes to its range has an open head."""

FINE = 1.4
"""Width of thin lines, px."""

DASH = 6.0
"""Length of dashes, px."""

HEAD = 13.0
"""Length of the head of an arrow, px."""

DOT, RING, CROSS, BAR = 3.4, 4.2, 5.5, 8.0
"""Radius of where a ray goes in and of where it comes out, reach of the cross and of the bar at its end, px."""

NEAR_MISS = 16
"""Misses by more px of the world are told in words alone: lines to them would cross the picture."""

SEVERAL, CROWDED = 24, 120
"""More rays in one picture are drawn thinner, and thinner still."""

BADGE = 8.5
"""Radius of the disc of a number, px."""

NORMAL = 17.0
"""Length of a normal, px."""


class Signs:
    """Signs on one picture, in px of it: collected, then laid over it in order.

    Parameters
    ----------
    shape : (h, w) of the picture
    rays : how many there will be: more are drawn thinner, and at last without what lies beyond their ends
    """

    def __init__(self, shape: tuple[int, int], rays: int = 1) -> None:
        self.shape = shape
        self.crowded = rays > CROWDED
        self.size = 0.4 if self.crowded else 0.7 if rays > SEVERAL else 1.0
        self.strokes: dict[str, Strokes] = {}

    def of(self, name: str) -> Strokes:
        """The strokes of one kind of sign."""
        return self.strokes.setdefault(name, Strokes(self.shape))

    def ray(self, begin: Floats, stop: Floats, end: Floats, reason: str) -> None:
        """Draw an arrow to where a ray stopped, with the sign of why, and dashes to where it would have gone."""
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
            self.cross(stop)

    def cross(self, at: Floats) -> None:
        """Mark where an occluder ended a ray."""
        for slant in (np.array([1.0, 1.0]), np.array([1.0, -1.0])):
            reach = CROSS * self.size * slant
            self.of(ENDS["occluder"]).line(at - reach, at + reach, 2.6 * self.size)

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

    def badge(self, at: Floats) -> None:
        """Draw the disc of a number."""
        self.of("number").line(at, at, 2 * BADGE)

    def miss(self, begin: Floats, end: Floats) -> None:
        """Draw how far an object was missed, as one measures on a plan: a dotted line between two bars."""
        strokes, across = self.of("near miss"), 4.5 * _across(_unit(end - begin))
        strokes.line(begin, end, FINE, 3.0)
        for at in (begin, end):
            strokes.line(at - across, at + across, FINE)

    def sweep(self, begin: Floats, end: Floats, radius: float) -> None:
        """Draw what something of a radius touches between two points."""
        self.of("swept").line(begin, end, 2 * radius)
        self.of("what it sweeps").around(begin, end, radius, FINE)

    def tested(self, at: Floats, radius: float) -> None:
        """Draw a disc at a point where alone it was tested."""
        self.of("swept").line(at, at, 2 * radius)
        self.of("tested only here").around(at, at, radius, FINE)

    def contact(self, at: Floats, radius: float, pixel: Floats, factor: float) -> None:
        """Draw the disc at its first contact, and the middle of the pixel (of so many px) that it touches."""
        self.of("first contact").around(at, at, radius, FINE)
        half = factor / 2
        corners = pixel + half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
        for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            self.of("first contact").line(corner, following, 1.8)

    def lay(self, image: Image) -> set[str]:
        """Lay all over a picture (h, w, 3), and tell what can be seen."""
        seen = set()
        for name, (color, alpha, grounded) in SIGNS.items():
            if name in self.strokes and self.strokes[name].ink.any():
                self.strokes[name].lay(image, color, alpha, grounded)
                seen.add(name)
        return seen


def sign_mark(name: str) -> Image:
    """Mark (14, w, 3) of a kind of sign, for a legend."""
    wide = 14 if name == "first contact" else 30
    signs = Signs((14, wide), SEVERAL + 1)
    left, middle, right = (np.array([x, 7.0]) for x in (2.0, wide / 2, wide - 4.0))
    if name in ENDS.values():
        signs.ray(left, right - 3, right - 3, next(reason for reason, told in ENDS.items() if told == name))
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
    mark = np.empty((14, wide, 3), np.uint8)
    mark[:] = (70, 74, 82)
    signs.lay(mark)
    return mark


def _unit(step: Floats) -> Floats:
    """Direction of length 1; of nothing, to the right."""
    length = float(np.sqrt(step[0] ** 2 + step[1] ** 2))
    return np.asarray(step / length if length else np.array([1.0, 0.0]))


def _across(ahead: Floats) -> Floats:
    return np.array([-ahead[1], ahead[0]])
