"""One simple polygon around a mask: parts are bridged, holes filled, and inner corners left out within a tolerance.

1. Pixels that meet by a corner alone get a third: no boundary passes a point twice.
2. Parts are joined by paths of pixels, each to the nearest (city-block distance, a least spanning tree).
3. The boundary through the topmost corner is walked: holes have boundaries of their own, and are left behind.
4. Inner corners go, the cheapest first, as long as all that was left out between two neighbours lies within the
   tolerance of their edge, and no other corner lies in the triangle that is added: so it stays simple, and only grows.

5. Outer edges go the same way: their neighbours are drawn out until they meet, at a place of 1/256 px that is rounded
   outward, as long as no other corner or edge lies in what is added.

All on whole numbers. Beyond OUTLINE_PIXELS or OUTLINE_CORNERS the mask is taken by square
blocks of pixels, cut off at its box, in steps 1 to 3: it holds all pixels, up to a block's diagonal further out.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Floats, Ints
from planes.constants import OUTLINE_CORNERS, OUTLINE_PIXELS, SUB
from planes.hull import Point, extents, turn
from planes.spans import Spans

__all__ = ["outline"]


def outline(mask: Bools, tolerance: float) -> Floats:
    """Outline (n, 2) in px of a mask that is not empty, simple, within `tolerance` px of its filled, bridged pixels."""
    rows, first, last = extents(mask)
    left, right, top, bottom = int(first.min()), int(last.max()) + 1, int(rows[0]), int(rows[-1]) + 1
    cropped = mask[top:bottom, left:right]
    block = 1
    while cropped.size > OUTLINE_PIXELS * block * block:
        block *= 2
    while len(ring := _boundary(_joined(_blocks(cropped, block)))) > OUTLINE_CORNERS:
        block *= 2
    corners = np.minimum(np.array(ring) * block, (right - left, bottom - top)) + np.array([left, top])
    simpler = _Simpler(corners, tolerance)
    return np.array(_without_edges(simpler.points(), simpler.offs(), tolerance)) / SUB - 0.5


def _blocks(mask: Bools, block: int) -> Bools:
    """Whether a block of pixels holds any of the mask."""
    starts = (np.arange(0, size, block) for size in mask.shape)
    rows, columns = starts
    return np.asarray(np.logical_or.reduceat(np.logical_or.reduceat(mask, rows, axis=0), columns, axis=1))


def _joined(mask: Bools) -> Bools:
    """One part, joined by sides."""
    mask = _without_crossings(mask)
    labels, parts = _labels(mask)
    if parts == 1:
        return mask
    return _without_crossings(_bridged(labels, parts))


def _without_crossings(mask: Bools) -> Bools:
    """Fill a pixel wherever two meet by a corner alone, until none do."""
    mask = mask.copy()
    while True:
        a, b, c, d = mask[:-1, :-1], mask[:-1, 1:], mask[1:, :-1], mask[1:, 1:]
        falling, rising = a & d & ~b & ~c, b & c & ~a & ~d
        if not (falling.any() or rising.any()):
            return mask
        mask[:-1, 1:] |= falling
        mask[:-1, :-1] |= rising


def _root(parents: list[int], i: int) -> int:
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


def _labels(mask: Bools) -> tuple[Ints, int]:
    """Number the parts that hang together by sides: labels (h, w), -1 off the mask, and how many."""
    runs = Spans.from_mask(mask)
    width = mask.shape[1] + 1
    first, last = runs.y * width + runs.x_first, runs.y * width + runs.x_last
    begin, end = np.searchsorted(last, first - width), np.searchsorted(first, last - width, side="right")
    parents = list(range(len(runs)))
    for i, (low, high) in enumerate(zip(begin.tolist(), end.tolist(), strict=True)):
        for above in range(low, high):
            parents[_root(parents, above)] = _root(parents, i)
    roots = np.array([_root(parents, i) for i in range(len(runs))])
    names, number = np.unique(roots, return_inverse=True)
    labels = np.full(mask.shape, -1, np.int64)
    labels[mask] = np.repeat(number, runs.lengths)
    return labels, len(names)


def _bridged(labels: Ints, parts: int) -> Bools:
    """Join parts by shortest paths: where the land nearest to one part meets that of another there is a bridge."""
    padded = np.pad(labels, 1, constant_values=-2)  # beyond the frame nothing is reached
    near, came, steps = _nearest(padded.reshape(-1), padded.shape[1])
    cells = np.flatnonzero(near >= 0)
    pairs = np.concatenate([np.stack([cells, cells + step]) for step in (1, padded.shape[1])], axis=1)
    pairs = pairs[:, (near[pairs[1]] >= 0) & (near[pairs[0]] != near[pairs[1]])]
    order = np.argsort(steps[pairs[0]] + steps[pairs[1]], kind="stable")
    parents = list(range(parts))
    for one, other in pairs[:, order].T.tolist():
        a, b = _root(parents, int(near[one])), _root(parents, int(near[other]))
        if a != b:
            parents[a] = b
            for cell in (one, other):
                _draw_back(padded.reshape(-1), came, cell)
    return padded[1:-1, 1:-1] >= 0


def _nearest(labels: Ints, width: int) -> tuple[Ints, Ints, Ints]:
    """Spread labels over unlabelled cells (-1) ring by ring: the label, the cell before, and the steps of each."""
    near, came, steps = labels.copy(), np.arange(len(labels)), np.zeros(len(labels), np.int64)
    front, count = np.flatnonzero(near >= 0), 0
    while len(front):
        count += 1
        reached = []
        for step in (1, -1, width, -width):
            source = front[near[front + step] == -1]
            near[source + step], came[source + step], steps[source + step] = near[source], source, count
            reached.append(source + step)
        front = np.concatenate(reached)
    return near, came, steps


def _draw_back(labels: Ints, came: Ints, cell: int) -> None:
    while labels[cell] < 0:
        labels[cell] = 0
        cell = int(came[cell])


def _boundary(mask: Bools) -> list[Point]:
    """Outer boundary of one part without crossings, as corners of pixels (pixel [0, 0] is from (0, 0) to (1, 1)).

    In each row of corners the first is joined to the second, the third to the fourth, and so on; in each column, too.
    """
    padded = np.pad(mask, 1).astype(np.int8)
    around = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
    y, x = np.nonzero(around & 1)
    across = np.arange(len(x)) ^ 1
    by_column = np.lexsort((y, x))
    down = np.empty(len(x), np.int64)
    down[by_column] = by_column[across]
    xs, ys, mates = x.tolist(), y.tolist(), (across.tolist(), down.tolist())
    ring, at, way = [(xs[0], ys[0])], mates[0][0], 1
    while at != 0:
        ring.append((xs[at], ys[at]))
        at, way = mates[way][at], 1 - way
    return ring


class _Simpler:
    """A simple ring that loses inner corners; `corners` (n, 2) whole numbers that turn from +x toward +y."""

    def __init__(self, corners: Ints, tolerance: float) -> None:
        self.corners, self.tolerance = corners, tolerance
        self.at: list[Point] = [(x, y) for x, y in corners.tolist()]
        n = len(self.at)
        self.before, self.after = [(i - 1) % n for i in range(n)], [(i + 1) % n for i in range(n)]
        self.left = np.ones(n, np.bool_)
        self.heap: list[tuple[float, int, int, int]] = []
        for i in range(n):
            self._offer(i)
        while self.heap:
            self._leave_out(*heapq.heappop(self.heap)[1:])

    def points(self) -> list[Point]:
        """Corners that are left, in order, in 1/256 px."""
        return [(x * SUB, y * SUB) for x, y in self.corners[self.left].tolist()]

    def offs(self) -> list[float]:
        """How far the edge from each corner that is left is from what was left out there, px."""
        return [self._off(i, self.after[i]) for i in np.flatnonzero(self.left).tolist()]

    def _offer(self, i: int) -> None:
        """Put an inner corner on the heap, if its neighbours' edge would be near enough to all between them."""
        a, c = self.before[i], self.after[i]
        if turn(self.at[a], self.at[i], self.at[c]) > 0:
            return
        off = self._off(a, c)
        if off <= self.tolerance:
            heapq.heappush(self.heap, (off, i, a, c))

    def _off(self, a: int, c: int) -> float:
        """Largest distance of the first outline's corners between two to the segment between them."""
        between = self.corners[a + 1 : c] if a < c else np.concatenate([self.corners[a + 1 :], self.corners[:c]])
        return _distance(between, self.at[a], self.at[c])

    def _leave_out(self, i: int, a: int, c: int) -> None:
        if not self.left[i] or (self.before[i], self.after[i]) != (a, c) or not self._is_free(i, a, c):
            return
        self.left[i] = False
        self.after[a], self.before[c] = c, a
        for near in (a, c):
            self._offer(near)

    def _is_free(self, i: int, a: int, c: int) -> bool:
        """Whether no other corner lies in the closed triangle that is added."""
        three = (self.at[a], self.at[i], self.at[c])
        xs, ys = self.corners[:, 0], self.corners[:, 1]
        low, high = tuple(map(min, *three)), tuple(map(max, *three))
        boxed = self.left & (xs >= low[0]) & (xs <= high[0]) & (ys >= low[1]) & (ys <= high[1])
        p, q, r = three
        for other in np.flatnonzero(boxed).tolist():
            at = self.at[other]
            if other not in (a, i, c) and turn(p, q, at) <= 0 and turn(q, r, at) <= 0 and turn(r, p, at) <= 0:
                return False
        return True


def _distance(points: npt.NDArray[np.int64], a: Point, c: Point) -> float:
    """Largest distance of points (n, 2) to a segment, to rounding: it only says how far to simplify."""
    dx, dy = c[0] - a[0], c[1] - a[1]
    x, y = points[:, 0] - a[0], points[:, 1] - a[1]
    share = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1), 0, 1)
    return math.sqrt(float(((x - share * dx) ** 2 + (y - share * dy) ** 2).max(initial=0)))


def _without_edges(ring: list[Point], offs: list[float], tolerance: float) -> list[Point]:
    """Leave out outer edges of a simple ring, the nearest to its new corner first.

    Parameters
    ----------
    ring : corners in 1/256 px
    offs : how far edge i, which begins at corner i, may be from the first outline already, px
    tolerance : how far it may get, px
    """
    ring, offs = list(ring), list(offs)
    drawn = [_drawn_out(ring, offs, i) for i in range(len(ring))]
    while len(ring) > 3:
        i = min(range(len(ring)), key=lambda k: drawn[k][0])
        off, tip = drawn[i]
        if off > tolerance:
            break
        if not _is_clear(ring, i, tip):
            drawn[i] = math.inf, tip
            continue
        n = len(ring)
        offs[i - 1], offs[(i + 1) % n] = max(offs[i - 1], off), max(offs[(i + 1) % n], off)
        ring[i] = tip
        offs[i] = offs[(i + 1) % n]
        for values in (ring, offs, drawn):
            del values[(i + 1) % n]
        at = i - (i == n - 1)
        for near in range(at - 2, at + 2):
            drawn[near % (n - 1)] = _drawn_out(ring, offs, near % (n - 1))
    return ring


def _four(ring: list[Point], i: int) -> tuple[Point, Point, Point, Point]:
    n = len(ring)
    return ring[i - 1], ring[i], ring[(i + 1) % n], ring[(i + 2) % n]


def _drawn_out(ring: list[Point], offs: list[float], i: int) -> tuple[float, Point]:
    """Where the neighbours of edge i meet, rounded outward, and how far off that is; infinite if nowhere."""
    a, b, c, d = _four(ring, i)
    nowhere = math.inf, b
    (p, q), (u, v) = (b[0] - a[0], b[1] - a[1]), (c[0] - d[0], c[1] - d[1])
    angle = u * q - v * p
    if turn(a, b, c) <= 0 or turn(b, c, d) <= 0 or angle <= 0:
        return nowhere
    share = turn(b, c, d)
    near = (b[0] + p * share // angle, b[1] + q * share // angle)
    around = ((near[0] + x, near[1] + y) for x in (-1, 0, 1, 2) for y in (-1, 0, 1, 2))
    tips = [tip for tip in around if turn(a, tip, b) >= 0 and turn(tip, d, c) >= 0 and turn(b, tip, c) > 0]
    if not tips:
        return nowhere
    tip = min(tips, key=lambda t: (turn(b, t, c), t))
    return offs[i] + _distance(np.array([tip]), b, c) / SUB, tip


def _is_clear(ring: list[Point], i: int, tip: Point) -> bool:
    """Whether no other corner lies in the three closed triangles that a new corner adds, and no edge cuts them."""
    a, b, c, d = _four(ring, i)
    n = len(ring)
    others = np.array([ring[(i + 3 + k) % n] for k in range(n - 4)], np.int64).reshape(-1, 2)
    for triangle in ((a, tip, b), (b, tip, c), (c, tip, d)):
        low, high = np.min(triangle, axis=0), np.max(triangle, axis=0)
        close = others[((others >= low) & (others <= high)).all(axis=1)]
        sides = [_turns(triangle[k], triangle[(k + 1) % 3], close) for k in range(3)]
        if (np.min(sides, axis=0) >= 0).any():
            return False
    path = np.concatenate([[d], others, [a]])  # edges from d around to a
    return not (_cut_by(a, tip, path[:-1]) or _cut_by(tip, d, path[1:]))


def _turns(a: Point, b: Point, points: Ints) -> Ints:
    found: Ints = (b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0])
    return found


def _cut_by(a: Point, b: Point, path: Ints) -> bool:
    """Whether a polyline crosses a segment; touching counts."""
    start, end = path[:-1], path[1:]
    sides = np.sign(_turns(a, b, path))
    begins, ends = (start - a)[:, ::-1] * (end - start), (start - b)[:, ::-1] * (end - start)
    of_a, of_b = (np.sign(v[:, 1] - v[:, 0]) for v in (begins, ends))
    low, high = np.minimum(a, b), np.maximum(a, b)
    near = ((np.maximum(start, end) >= low) & (np.minimum(start, end) <= high)).all(axis=1)
    return bool((near & (sides[:-1] * sides[1:] <= 0) & (of_a * of_b <= 0)).any())
