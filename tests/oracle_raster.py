"""Slow exact references for grid256 and rasterise: one pixel, one direction, one number at a time.

Frame: x right, y down; pixel (x, y) is the closed square around its centre (256 x, 256 y). Every length, point
and radius is an integer in 1/256 px. Directions (c, s) are cosine and sine times 2**30. Whole numbers and
fractions only: nothing here rounds unless its name says so.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction

__all__ = [
    "PI_DIGITS",
    "in_beam",
    "in_cone",
    "in_disc",
    "in_ellipse",
    "in_polygon",
    "in_ring",
    "meets_segment",
    "meets_segment_by_clipping",
    "on_edge",
    "pi_digits",
    "pixel_set",
    "pixels",
    "quarter_turns",
    "rounded",
    "turned",
    "unit",
    "unit_toward",
]

Point = Sequence[int]
Ring = Sequence[Point]
Box = tuple[int, int, int, int]

PX = 256  # units in a pixel
HALF = 128  # from a pixel's centre to its edge
ONE = 2**30  # the unit of a direction
PI_DIGITS = 31415926535897932384626433832795028841971693993751058209749445  # pi * 10**61, cut off
PI_SCALE = 10**61
# The Taylor sums below are good to far less than this; a value closer than this to a rounding tie stops the test.
TIE_GUARD = Fraction(1, 10**40)


# Rounding and directions


def rounded(value: Fraction | int) -> int:
    """Round to a whole number, half to even."""
    low = math.floor(value)
    rest = Fraction(value) - low
    if rest == Fraction(1, 2):
        return low + low % 2
    return low + (rest > Fraction(1, 2))


def pi_digits(digits: int) -> int:
    """Give floor(pi * 10**digits) by Machin's formula, to check the constant above."""
    guard = 10**10
    scale = 10**digits * guard

    def arctan_inverse(n: int) -> int:
        total, power, k = 0, scale // n, 0
        while power:
            total += (-1) ** k * (power // (2 * k + 1))
            power //= n * n
            k += 1
        return total

    return 4 * (4 * arctan_inverse(5) - arctan_inverse(239)) // guard


def _cos_sin(degrees: Fraction) -> tuple[Fraction, Fraction]:
    """Sum Taylor's series for an angle in [0, 90], to about 50 digits."""
    radians = degrees * Fraction(PI_DIGITS, 180 * PI_SCALE)
    scale = 10**60
    x = rounded(radians * scale)
    sums, term, k = [0, 0, 0, 0], scale, 0
    while term:
        sums[k % 4] += term
        k += 1
        term = term * x // (scale * k)
    return Fraction(sums[0] - sums[2], scale), Fraction(sums[1] - sums[3], scale)


def _rounded_off_ties(value: Fraction) -> int:
    """Round a value that is known only nearly; sine and cosine have no ties but whole numbers."""
    nearest_tie = math.floor(value) + Fraction(1, 2)
    assert abs(value - nearest_tie) > TIE_GUARD, "too close to a tie for the digits at hand"
    return rounded(value)


def unit(degrees: float | Fraction) -> tuple[int, int]:
    """Give cosine and sine times 2**30, correctly rounded.

    The only rational values of sine and cosine at rational degrees are 0, 1/2 and 1 (Niven), whole numbers
    here, so no value lies on a tie.
    """
    angle = Fraction(degrees) % 360
    quarter = math.floor(angle / 90)
    cos, sin = _cos_sin(angle - 90 * quarter)
    c, s = _rounded_off_ties(cos * ONE), _rounded_off_ties(sin * ONE)
    for _ in range(quarter):
        c, s = -s, c
    return c, s


def unit_toward(dx: int, dy: int) -> tuple[int, int]:
    """Give the direction of a vector times 2**30, correctly rounded."""
    length2 = dx * dx + dy * dy
    assert length2 > 0

    def component(v: int) -> int:
        # twice the component's size, floored: floor(sqrt(q)) = isqrt(floor(q))
        numerator = (2 * ONE * v) ** 2
        twice = math.isqrt(numerator // length2)
        exact = twice * twice * length2 == numerator
        size = rounded(Fraction(twice, 2)) if exact else (twice + 1) // 2
        return size if v >= 0 else -size

    return component(dx), component(dy)


def quarter_turns(degrees: float | Fraction) -> tuple[int, int, int]:
    """Give (k, c, s) with degrees = 90 k + r modulo 360, r in [-45, 45) and (c, s) the direction of r.

    What rounds to the direction of an odd multiple of 45 degrees is that multiple.
    """
    angle = Fraction(degrees)
    across, down = unit(angle)
    if abs(across) == abs(down):
        angle = Fraction(45 * round(angle / 45))
    k = math.floor((angle + 45) / 90)
    return (k % 4, *unit(angle - 90 * k))


def turned(point: Point, c: int, s: int) -> tuple[int, int]:
    """Turn a point by a direction; each coordinate is rounded once."""
    x, y = point
    return rounded(Fraction(x * c - y * s, ONE)), rounded(Fraction(x * s + y * c, ONE))


# Sets of pixels


def pixels(predicate: Callable[[int, int], bool], box: Box) -> set[tuple[int, int]]:
    """Ask every pixel of a box (x_min, y_min, x_max, y_max), ends included."""
    x_min, y_min, x_max, y_max = box
    return {(x, y) for y in range(y_min, y_max + 1) for x in range(x_min, x_max + 1) if predicate(x, y)}


def pixel_set(y: Iterable[int], x_first: Iterable[int], x_last: Iterable[int]) -> set[tuple[int, int]]:
    """Write out runs as single pixels (x, y); a run with x_first > x_last has none."""
    return {
        (x, int(row))
        for row, first, last in zip(y, x_first, x_last, strict=True)
        for x in range(int(first), int(last) + 1)
    }


# Shapes: does one pixel belong?


def in_disc(x: int, y: int, radius: int) -> bool:
    """Centre within a closed disc around the origin."""
    return (PX * x) ** 2 + (PX * y) ** 2 <= radius**2


def in_ring(x: int, y: int, inner: int, outer: int) -> bool:
    """Centre within a closed ring around the origin: both edges belong to it."""
    return inner**2 <= (PX * x) ** 2 + (PX * y) ** 2 <= outer**2


def in_ellipse(x: int, y: int, radius_x: int, radius_y: int, c: int, s: int) -> bool:
    """Centre within a closed turned ellipse; a zero semi-axis leaves a segment or a point."""
    along = PX * (x * c + y * s)
    across = PX * (y * c - x * s)
    length2 = c * c + s * s  # along and across are this much too long, squared
    if radius_x == 0 or radius_y == 0:
        return along**2 <= radius_x**2 * length2 and across**2 <= radius_y**2 * length2
    return Fraction(along**2, radius_x**2) + Fraction(across**2, radius_y**2) <= length2


def on_edge(p: Point, a: Point, b: Point) -> bool:
    """Point on a closed segment; a segment without length is a point."""
    cross = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    in_x = min(a[0], b[0]) <= p[0] <= max(a[0], b[0])
    in_y = min(a[1], b[1]) <= p[1] <= max(a[1], b[1])
    return cross == 0 and in_x and in_y


def in_polygon(x: int, y: int, rings: Sequence[Ring]) -> bool:
    """Even-odd over all rings; a centre on any edge is in."""
    p = (PX * x, PX * y)
    inside = False
    for ring in rings:
        for i, a in enumerate(ring):
            b = ring[i - 1]
            if on_edge(p, a, b):
                return True
            if (a[1] <= p[1]) != (b[1] <= p[1]):  # the edge crosses the centre's row, its upper end counted once
                x_there = a[0] + Fraction((p[1] - a[1]) * (b[0] - a[0]), b[1] - a[1])
                inside ^= x_there > p[0]
    return inside


def _distance2(p: Point, a: Point, b: Point) -> Fraction:
    """Squared distance from a point to a closed segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    t = Fraction(0)
    if length2:
        t = min(max(Fraction((p[0] - a[0]) * dx + (p[1] - a[1]) * dy, length2), Fraction(0)), Fraction(1))
    return (a[0] + t * dx - p[0]) ** 2 + (a[1] + t * dy - p[1]) ** 2


def meets_segment(x: int, y: int, a: Point, b: Point) -> bool:
    """Closed square meets closed segment: neither the square's axes nor the segment's normal part them."""
    ax, ay, bx, by = a[0] - PX * x, a[1] - PX * y, b[0] - PX * x, b[1] - PX * y
    if min(ax, bx) > HALF or max(ax, bx) < -HALF or min(ay, by) > HALF or max(ay, by) < -HALF:
        return False
    dx, dy = bx - ax, by - ay
    return abs(dx * ay - dy * ax) <= HALF * (abs(dx) + abs(dy))


def meets_segment_by_clipping(x: int, y: int, a: Point, b: Point) -> bool:
    """Closed square meets closed segment: some of the segment is left when it is cut to the square."""
    t_first, t_last = Fraction(0), Fraction(1)
    for start, end, centre in ((a[0], b[0], PX * x), (a[1], b[1], PX * y)):
        low, high, step = centre - HALF - start, centre + HALF - start, end - start
        if step == 0:
            if low > 0 or high < 0:
                return False
            continue
        enter, leave = sorted((Fraction(low, step), Fraction(high, step)))
        t_first, t_last = max(t_first, enter), min(t_last, leave)
    return t_first <= t_last


def in_beam(x: int, y: int, a: Point, b: Point, radius: int) -> bool:
    """Centre within a distance of a segment, or square on the segment itself."""
    return meets_segment(x, y, a, b) or _distance2((PX * x, PX * y), a, b) <= radius**2


def in_cone(x: int, y: int, reach: int, c: int, s: int, c_half: int, s_half: int) -> bool:
    """Centre within a reach of the origin and half an angle of the axis, or square on the axis itself.

    The axis runs from the origin to the point at the end of the reach, which is rounded to 1/256 px.
    """
    if meets_segment(x, y, (0, 0), turned((reach, 0), c, s)):
        return True
    if not in_disc(x, y, reach):
        return False
    along, across = x * c + y * s, abs(y * c - x * s)
    if s_half == 0 and c_half > 0:  # no angle at all: the axis forward, and not its other half
        return across == 0 and along >= 0
    return across * c_half <= along * s_half
