"""Shapes to pixels, exactly: a pixel belongs to a filled shape when its centre does.

All arguments are integers in 1/256 px, about an origin that is the centre of pixel (0, 0). Every comparison is of
integers, so a centre on an edge is in, on every machine and for every size. A shape with an axis (beam, cone) also has
the closed supercover of its axis: however thin, it has no gaps, and a wider one covers a narrower one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from planes.arrays import Ints
from planes.constants import HALF, SUB
from planes.grid256 import isqrt, turned
from planes.spans import Spans, ragged

Runs = tuple[Ints, Ints, Ints]

__all__ = ["beam", "cone", "disc", "ellipse", "polygon", "ring", "segment"]


def disc(radius: int) -> Spans:
    """Centres at most `radius` from the origin."""
    return _union([_disc_runs(np.zeros(2, np.int64), radius)])


def ring(inner: int, outer: int) -> Spans:
    """Centres p with inner <= |p| <= outer: both edges belong to it."""
    y = _rows(-outer, outer)
    edge = isqrt(outer * outer - (SUB * y) ** 2)
    rest = inner * inner - (SUB * y) ** 2
    # The hole is open: the first centre outside it has x * x >= rest, so x >= the root rounded up.
    root = isqrt(np.maximum(rest, 0))
    hole = np.where(rest > 0, root + (root * root < rest), 0)
    return _union([_closed(y, -edge, -hole), _closed(y, hole, edge)])


def ellipse(radius_x: int, radius_y: int, c: int, s: int) -> Spans:
    """Centres inside an ellipse whose semi-axes are turned by the direction (c, s); a flat one is a segment.

    With u = x c + y s and v = y c - x s: (ry u)^2 + (rx v)^2 <= rx^2 ry^2 (c^2 + s^2). For one row that is
    |A x + B| <= sqrt(D) with integers of up to 200 bits, so the rows are worked out in Python integers.
    """
    if radius_x == 0 or radius_y == 0:
        return _flat_ellipse(radius_x, radius_y, c, s)
    xx, yy = radius_x**2, radius_y**2
    a, b = yy * c * c + xx * s * s, (yy - xx) * c * s
    last = xx * yy * (c * c + s * s)
    y = _rows(-max(radius_x, radius_y), max(radius_x, radius_y))
    rows = []
    for row in y.tolist():
        v = SUB * row
        squared = (b * v) ** 2 - a * ((yy * s * s + xx * c * c) * v * v - last)
        if squared >= 0:
            root = math.isqrt(squared)
            rows.append((row, -((b * v + root) // (SUB * a)), (root - b * v) // (SUB * a)))
    runs = np.array(rows, np.int64).reshape(-1, 3).T
    return Spans.from_runs(*runs)


def polygon(rings: Sequence[Ints]) -> Spans:
    """Centres inside rings of points (N, 2) by the even-odd rule over all of them; a centre on any edge is in.

    A centre is inside when an odd number of crossings lies at or left of it. Crossings are rounded up to centres
    before they are sorted, which changes no count, so rationals are never compared with each other.
    """
    start = np.concatenate([np.asarray(r, np.int64) for r in rings])
    end = np.concatenate([np.roll(np.asarray(r, np.int64), -1, axis=0) for r in rings])
    down = (start[:, 1] > end[:, 1])[:, None]
    top, low = np.where(down, end, start), np.where(down, start, end)
    first, last = -(-top[:, 1] // SUB), low[:, 1] // SUB
    edge, place = ragged(np.maximum(last - first + 1, 0))
    y = first[edge] + place
    flat = top[edge, 1] == low[edge, 1]
    left, right = _crossings(top[edge], low[edge], y)
    touching = (y, left, right)
    crossing = ~flat & (SUB * y < low[edge, 1])  # half-open in y: a vertex between two edges counts once
    y, x = y[crossing], left[crossing]
    order = np.lexsort((x, y))
    y, x = y[order], x[order]
    return _union([touching, (y[::2], x[::2], x[1::2] - 1)])


def beam(a: Ints, b: Ints, radius: int) -> Spans:
    """Centres at most `radius` from the segment ab, and the closed supercover of ab."""
    (ax, ay), (bx, by) = np.asarray(a).tolist(), np.asarray(b).tolist()
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    parts = [_segment_runs(a, b), _disc_runs(a, radius), _disc_runs(b, radius)]
    if length2 == 0:
        return _union(parts)
    # Beside the segment: 0 <= (p - a) . d <= |d|^2, and |(p - a) x d| <= radius |d|.
    side = math.isqrt(radius * radius * length2)
    y = _rows(min(ay, by) - radius, max(ay, by) + radius)
    v = SUB * y - ay
    along, across = dx * ax - dy * v, dy * ax + dx * v
    x_min, x_max = ax * np.ones_like(y) + min(0, dx) - radius, ax * np.ones_like(y) + max(0, dx) + radius
    for slope, low, high in ((dx, along, along + length2), (dy, across - side, across + side)):
        x_min, x_max = _between(slope, low, high, x_min, x_max)
    return _union([*parts, _closed(y, x_min, x_max)])


def cone(reach: int, c: int, s: int, c_half: int, s_half: int) -> Spans:
    """Centres within `reach` and within the half angle of the direction (c, s), and the supercover of the axis.

    With u = x c + y s and v = y c - x s: |v| c_half <= u s_half. Correctly rounded cosines fall and sines rise with
    the half angle up to 90 degrees, so a wider cone covers a narrower one; the products pass 64 bits and are Python
    integers.
    """
    y = _rows(-reach, reach)
    half = isqrt(reach * reach - (SUB * y) ** 2)
    axis = _segment_runs(np.zeros(2, np.int64), turned(np.array([reach, 0]), c, s))
    if s_half == 0 and c_half > 0:
        return _union([axis])
    sides = []
    for sign in (1, -1):  # sign * v * c_half <= u * s_half  is  slope * x <= limit * y
        slope = -sign * s * c_half - c * s_half
        limit = (s * s_half - sign * c * c_half) * SUB
        sides.append(_half_plane(slope, y.astype(object) * limit, -half, half))
    (a_min, a_max), (b_min, b_max) = sides
    if c_half >= 0:
        return _union([axis, _closed(y, np.maximum(a_min, b_min), np.minimum(a_max, b_max))])
    return _union([axis, _closed(y, a_min, a_max), _closed(y, b_min, b_max)])


def segment(a: Ints, b: Ints) -> Spans:
    """Closed supercover: every pixel whose closed square meets the closed segment, the ends in either order."""
    return _union([_segment_runs(a, b)])


def _segment_runs(a: Ints, b: Ints) -> Runs:
    (x0, y0), (x1, y1) = sorted([np.asarray(a).tolist(), np.asarray(b).tolist()], key=lambda p: (p[1], p[0]))
    y = np.arange(-((HALF - y0) // SUB), (y1 + HALF) // SUB + 1)
    dx, dy = x1 - x0, y1 - y0
    if dy == 0:
        low, high, per = np.full_like(y, x0), np.full_like(y, x1), 1
    else:
        enter = x0 * dy + (np.maximum(y0, SUB * y - HALF) - y0) * dx
        leave = x0 * dy + (np.minimum(y1, SUB * y + HALF) - y0) * dx
        low, high, per = np.minimum(enter, leave), np.maximum(enter, leave), dy
    return y, -((HALF * per - low) // (SUB * per)), (high + HALF * per) // (SUB * per)


def _disc_runs(center: Ints, radius: int) -> Runs:
    """Centres at most `radius` from a point."""
    cx, cy = np.asarray(center).tolist()
    y = _rows(cy - radius, cy + radius)
    half = isqrt(radius * radius - (SUB * y - cy) ** 2)
    return _closed(y, cx - half, cx + half)


def _union(parts: Sequence[Runs]) -> Spans:
    """Merge all runs at once."""
    y, x_first, x_last = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Spans.from_runs(y, x_first, x_last)


def _rows(low: int, high: int) -> Ints:
    """Rows whose centres lie in [low, high]."""
    return np.arange(-(-low // SUB), high // SUB + 1, dtype=np.int64)


def _closed(y: Ints, low: Ints, high: Ints) -> Runs:
    """Centres of rows y from low to high."""
    return y, -(-low // SUB), high // SUB


def _crossings(top: Ints, low: Ints, y: Ints) -> tuple[Ints, Ints]:
    """Where edges meet rows: the first centre at or right of it, the last at or left; a flat edge, from end to end."""
    dy = low[:, 1] - top[:, 1]
    per = np.maximum(dy, 1)
    x = top[:, 0] * per + (SUB * y - top[:, 1]) * (low[:, 0] - top[:, 0])
    flat = dy == 0
    left = np.where(flat, np.minimum(top[:, 0], low[:, 0]), x)
    right = np.where(flat, np.maximum(top[:, 0], low[:, 0]), x)
    return -(-left // (SUB * per)), right // (SUB * per)


def _between(slope: int, low: Ints, high: Ints, x_min: Ints, x_max: Ints) -> tuple[Ints, Ints]:
    """Narrow [x_min, x_max] to low <= slope * x <= high."""
    if slope == 0:
        return np.where((low <= 0) & (high >= 0), x_min, x_max + 1), x_max
    if slope < 0:
        slope, low, high = -slope, -high, -low
    return np.maximum(x_min, -(-low // slope)), np.minimum(x_max, high // slope)


def _half_plane(slope: int, limit: Ints, x_min: Ints, x_max: Ints) -> tuple[Ints, Ints]:
    """Narrow [x_min, x_max] to the positions with slope * x <= limit; limits are Python integers of any size."""
    if slope == 0:
        return np.where(limit >= 0, x_min, x_max + 1), x_max
    if slope > 0:
        return x_min, np.minimum(x_max, limit // slope).astype(np.int64)
    return np.maximum(x_min, -(limit // -slope)).astype(np.int64), x_max


def _flat_ellipse(radius_x: int, radius_y: int, c: int, s: int) -> Spans:
    """Centres on the segment that an ellipse without width is."""
    longest = max(radius_x, radius_y)
    if radius_y > radius_x:
        c, s = -s, c
    if c == 0 or s == 0:
        y = np.arange(-(longest // SUB), longest // SUB + 1)
        zero = np.zeros_like(y)
        return Spans.from_runs(y, zero, zero) if c == 0 else Spans.from_runs(zero[:1], y[:1], y[-1:])
    y = _rows(-longest, longest)
    x = y * c // s
    near = np.abs(x) <= longest // SUB  # of a shallow direction others are so far that their squares overflow
    on = near & (x * s == y * c) & ((SUB * x) ** 2 + (SUB * y) ** 2 <= longest * longest)
    return Spans.from_runs(y[on], x[on], x[on])
