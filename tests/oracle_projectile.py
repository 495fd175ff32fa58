"""Slow exact reference for projectiles: every pixel of every thing, one after another, in whole numbers and fractions.

Lengths are whole numbers in 1/256 px, times parts of the frame in [0, 1]. Pixel (x, y) is the closed square of side 256
around its centre (256 x, 256 y). A thing that moves by w while the disc moves by v is met by a disc that moves by
d = v - w. At time t the disc touches a pixel if the centre of the pixel is within the radius of a + t d, or if a + t d
lies in the pixel's square.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

__all__ = ["SAME", "Thing", "doubtful", "flight", "impacts", "intervals", "last_miss", "touches"]

Vector = tuple[int, int]
Interval = tuple[Fraction, Fraction]
Touch = tuple[Fraction, "Thing", Vector]

PX, HALF = 256, 128
FINE = 2**320
SAME = Fraction(1, 2**256)
"""Times closer than this are equal: two different roots of the quadratics below, whose coefficients are below 2**62,
differ by more than 2**-250. Roots are cut off at 1 / FINE."""


@dataclass(frozen=True)
class Thing:
    """An object or an occluder that the shot accepts: its pixels when the frame begins, and where it moves in it."""

    id: int
    pixels: frozenset[Vector]
    occluder: bool = False
    layer: int = 0
    velocity: Vector = (0, 0)


def flight(speed: int, toward: Vector) -> Vector:
    """Where a flight of some speed along a vector ends: the direction is rounded to 2**-30, then the end, once each."""
    square = toward[0] ** 2 + toward[1] ** 2
    one = 2**30
    along = [math.copysign((math.isqrt(4 * one * one * c * c // square) + 1) // 2, c) for c in toward]
    x, y = (round(Fraction(int(c) * speed, one)) for c in along)
    return x, y


def touches(a: Vector, d: Vector, radius: int, pixel: Vector, time: Fraction) -> bool:
    """Whether the disc touches a pixel at a time."""
    x, y = (a[i] + time * d[i] - PX * pixel[i] for i in (0, 1))
    return x * x + y * y <= radius * radius or (abs(x) <= HALF and abs(y) <= HALF)


def intervals(a: Vector, d: Vector, radius: int, pixel: Vector) -> list[Interval]:
    """When the disc has the pixel's centre within its radius, and when its centre is in the pixel's square."""
    w = a[0] - PX * pixel[0], a[1] - PX * pixel[1]
    return [found for found in (_in_disc(w, d, radius), _in_square(w, d)) if found]


def _in_disc(w: Vector, d: Vector, radius: int) -> Interval | None:
    """Solve |w + t d| <= radius: the signs of all that decides are those of whole numbers."""
    square, b = d[0] * d[0] + d[1] * d[1], w[0] * d[0] + w[1] * d[1]
    c = w[0] * w[0] + w[1] * w[1] - radius * radius
    if square == 0:
        return (Fraction(0), Fraction(1)) if c <= 0 else None
    q = b * b - square * c
    if q < 0:
        return None
    begins, ends = c <= 0, square + 2 * b + c <= 0  # inside at 0; at 1
    if (b > 0 and not begins) or (b + square < 0 and not ends):
        return None
    root = Fraction(math.isqrt(q * FINE * FINE), FINE)
    entry = Fraction(0) if begins else (-b - root) / square
    leave = Fraction(1) if ends else (-b + root) / square
    return entry, leave


def _in_square(w: Vector, d: Vector) -> Interval | None:
    entry, leave = Fraction(0), Fraction(1)
    for start, step in zip(w, d, strict=True):
        if step == 0:
            if abs(start) > HALF:
                return None
            continue
        edges = sorted((Fraction(-HALF - start, step), Fraction(HALF - start, step)))
        entry, leave = max(entry, edges[0]), min(leave, edges[1])
    return (entry, leave) if entry <= leave else None


def impacts(a: Vector, v: Vector, radius: int, things: Sequence[Thing], steps: int | None = None) -> list[Touch]:
    """Every pixel that is touched in the frame, with the first time at which it is, in the order of the rules.

    The earliest first; of those at one time pixels with an occluder first, then by (y, x), then from the front.

    Parameters
    ----------
    a, v : where the disc begins, and where it moves in the frame
    things : in the order in which they were added
    steps : touches count at the times k / steps alone, k = 1 .. steps
    """
    front = sorted(range(len(things)), key=lambda i: (-things[i].layer, not things[i].occluder, -i))
    found = []
    for rank, thing in enumerate(things[i] for i in front):
        d = v[0] - thing.velocity[0], v[1] - thing.velocity[1]
        for pixel in thing.pixels:
            time = _first(a, d, radius, pixel, steps)
            if time is not None:
                found.append((time, rank, thing, pixel))
    found.sort(key=lambda row: row[0])
    ordered = []
    for group in _at_one_time(found):
        blocked = {pixel for _, _, thing, pixel in group if thing.occluder}
        group.sort(key=lambda row: (row[3] not in blocked, row[3][1], row[3][0], row[1]))
        ordered += [(time, thing, pixel) for time, _, thing, pixel in group]
    return ordered


def _first(a: Vector, d: Vector, radius: int, pixel: Vector, steps: int | None) -> Fraction | None:
    """First time at which a pixel is touched, of all times or of k / steps."""
    found = intervals(a, d, radius, pixel)
    if steps is None:
        return min((entry for entry, _ in found), default=None)
    times = []
    for entry, leave in found:
        about = range(max(1, math.floor(entry * steps) - 1), min(steps, math.ceil(leave * steps) + 1) + 1)
        times.append(next((time for k in about if touches(a, d, radius, pixel, time := Fraction(k, steps))), None))
    return min((time for time in times if time is not None), default=None)


def _at_one_time(found: list) -> Iterator[list]:
    group: list = []
    for row in found:
        if group and row[0] - group[0][0] > SAME:
            yield group
            group = []
        group.append(row)
    if group:
        yield group


def doubtful(a: Vector, v: Vector, radius: int, things: Iterable[Thing], steps: int) -> bool:
    """Whether a test k / steps falls so close to an end of a touch that whole-number times may tell otherwise.

    Those are over |d|^2, rounded inward, and over 2**60 where things move.
    """
    for thing in things:
        d = v[0] - thing.velocity[0], v[1] - thing.velocity[1]
        slack = Fraction(1, max(d[0] * d[0] + d[1] * d[1], 1)) + Fraction(1, 2**59)
        for pixel in thing.pixels:
            for interval in intervals(a, d, radius, pixel):
                for end in interval:
                    if 0 < end < 1 and abs(round(end * steps) - end * steps) <= slack * steps:
                        return True
    return False


def last_miss(d: Vector, radius: int) -> int:
    """Greatest |w x d| at which the line through w along d touches the pixel at 0: beyond it, a flight passes by."""
    square = d[0] * d[0] + d[1] * d[1]
    return max(math.isqrt(radius * radius * square), HALF * (abs(d[0]) + abs(d[1])))
