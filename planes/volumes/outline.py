"""Box covers of a mask, and simple polygons around it; both contain the whole mask.

Boxes are rows (x, y, x_end, y_end) of whole pixels, ends exclusive. An outline is made in five steps, in integers:

1. Where two pixels touch only by a corner, a third is added, so that no boundary passes a point twice.
2. Parts are joined to the nearest part by paths of pixels (city-block distance, minimum spanning tree).
3. The boundary through the topmost corner is walked; holes have boundaries of their own, and are filled by this.
4. Inner corners are removed, the cheapest first, while all corners removed between two neighbours lie within the
   tolerance of their edge, and no other corner lies in the added triangle. So the ring stays simple, and only grows.
5. Outer edges are removed in the same way: their neighbours are extended until they meet, rounded outward to 1/256 px,
   if no other corner or edge lies in the added area.

Beyond OUTLINE_PIXELS or OUTLINE_CORNERS steps 1 to 3 use square blocks of pixels, clipped to the box of the mask. The
outline then lies up to a block's diagonal further out.
"""

from __future__ import annotations

import heapq
import itertools
import math

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, Ints
from ..common.limits import BOXES_MAX, OUTLINE_CORNERS, OUTLINE_PIXELS, SUB
from ..grid.spans import Box, Spans
from .polygons import Point, extents, turn


def cover(mask: Bools, k: int) -> Ints:
    """Cover a mask that is not empty by at most k boxes (n, 4) with few false pixels.

    Two heuristics are tried, and the better result is returned: cutting the worst box in two, starting with one box;
    and joining the cheapest two, starting with BOXES_MAX boxes. In neither does one box more ever cover more pixels.
    """
    if k == 1:
        rows, first, last = extents(mask)
        return np.array([[first.min(), rows[0], last.max() + 1, rows[-1] + 1]])
    few, many = _cut(mask, k)
    area = int((few[:, 2:] - few[:, :2]).prod(axis=1).sum())  # the boxes are disjoint
    return min((few, area), _join(many, k), key=lambda found: found[1])[0]


def _cut(mask: Bools, k: int) -> tuple[Ints, Ints]:
    """Cut boxes in two, largest saving first; return the boxes at k, and at BOXES_MAX."""
    boxes: dict[int, Box] = {}
    few: list[Box] = []
    heap: list[tuple[int, int, int, list[Box]]] = []  # of a box: -saved and -false pixels, its number, its halves
    numbers = itertools.count()
    halves = [(0, 0, *mask.shape[::-1])]
    while True:
        for half in halves:
            number = next(numbers)
            boxes[number], false, saved, cut = _tight(mask, *half)
            if false:
                heapq.heappush(heap, (-saved, -false, number, cut))
        if len(boxes) <= k:
            few = list(boxes.values())
        if not heap or len(boxes) == BOXES_MAX:
            return np.array(few), np.array(list(boxes.values()))
        *_, number, halves = heapq.heappop(heap)
        del boxes[number]


def _tight(mask: Bools, x: int, y: int, x_end: int, y_end: int) -> tuple[Box, int, int, list[Box]]:
    """Shrink a box to its pixels: the box, its false pixels, what its best cut saves of them, and the two halves."""
    inside = mask[y:y_end, x:x_end]
    rows, first, last = extents(inside)
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(first.min()), int(last.max()) + 1
    inside = inside[top:bottom, left:right]
    box = (x + left, y + top, x + right, y + bottom)
    false = inside.size - int(np.count_nonzero(inside))
    if not false:
        return box, 0, 0, []
    by_row = _best_cut(rows - top, first, last, bottom - top)
    by_column = _best_cut(*extents(inside.T), right - left)
    x, y, x_end, y_end = box
    if by_column < by_row:
        area, _, at = by_column
        halves = [(x, y, x + at, y_end), (x + at, y, x_end, y_end)]
    else:
        area, _, at = by_row
        halves = [(x, y, x_end, y + at), (x, y + at, x_end, y_end)]
    return box, false, inside.size - area, halves


def _best_cut(rows: Ints, first: Ints, last: Ints, height: int) -> tuple[int, int, int]:
    """Cut between filled rows so that the two tight boxes are smallest; of equal cuts take the nearest to the middle.

    Returned are the area of both boxes, the distance of the cut from the middle, and the first row of the lower box.
    """
    if len(rows) < 2:
        return height * int(last[0] - first[0] + 1), height, 0
    above = (rows + 1) * _widths(first, last)
    below = (height - rows) * _widths(first[::-1], last[::-1])[::-1]
    areas = above[:-1] + below[1:]
    off_middle = np.abs(2 * rows[1:] - height)
    best = np.lexsort((off_middle, areas))[0]
    return int(areas[best]), int(off_middle[best]), int(rows[best + 1])


def _widths(first: Ints, last: Ints) -> Ints:
    """Width of the box of the rows up to each row."""
    return np.maximum.accumulate(last) - np.minimum.accumulate(first) + 1


def _join(boxes: Ints, k: int) -> tuple[Ints, int]:
    """Join the two boxes whose common box adds the least area, until k are left; return the boxes and their area.

    All corners lie on the lines of the first boxes: boxes are stored as line numbers, areas per cell between lines.
    """
    xs, ys = np.unique(boxes[:, 0::2]), np.unique(boxes[:, 1::2])
    cells = np.stack([np.searchsorted(lines, v) for lines, v in zip((xs, ys, xs, ys), boxes.T, strict=True)], axis=1)
    free = np.diff(ys)[:, None] * np.diff(xs)
    whole = int(free.sum())
    for x, y, x_end, y_end in cells.tolist():
        free[y:y_end, x:x_end] = 0
    ones, others = np.tril_indices(len(cells), -1)  # the pairs of the first n boxes come first
    while (n := len(cells)) > k:
        first, second = ones[: n * (n - 1) // 2], others[: n * (n - 1) // 2]
        low, high = np.minimum(cells[first, :2], cells[second, :2]), np.maximum(cells[first, 2:], cells[second, 2:])
        best = np.argmin(_sums(free, low, high))
        (x, y), (x_end, y_end) = low[best].tolist(), high[best].tolist()
        free[y:y_end, x:x_end] = 0
        within = (cells[:, :2] >= (x, y)).all(axis=1) & (cells[:, 2:] <= (x_end, y_end)).all(axis=1)
        cells = np.concatenate([cells[~within], [[x, y, x_end, y_end]]])
    joined = np.stack([xs[cells[:, 0]], ys[cells[:, 1]], xs[cells[:, 2]], ys[cells[:, 3]]], axis=1)
    return joined, whole - int(free.sum())


def _sums(values: Ints, low: Ints, high: Ints) -> Ints:
    """Sums of a table over boxes of its cells, by a summed-area table."""
    height, width = values.shape
    table = np.zeros((height + 1, width + 1), np.int64)
    values.cumsum(axis=0).cumsum(axis=1, out=table[1:, 1:])
    flat, (x, y), (x_end, y_end) = table.reshape(-1), low.T, high.T
    top, bottom = y * (width + 1), y_end * (width + 1)
    sums: Ints = flat[bottom + x_end] - flat[top + x_end] - flat[bottom + x] + flat[top + x]
    return sums


def outline(mask: Bools, tolerance: float) -> Floats:
    """Simple outline (n, 2), px, of a mask that is not empty, within `tolerance` px of its filled, bridged pixels."""
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
    return np.array(_without_edges(simpler.points, simpler.offs, tolerance)) / SUB - 0.5


def _blocks(mask: Bools, block: int) -> Bools:
    """Whether each block of pixels holds a set pixel."""
    starts = (np.arange(0, size, block) for size in mask.shape)
    rows, columns = starts
    return np.asarray(np.logical_or.reduceat(np.logical_or.reduceat(mask, rows, axis=0), columns, axis=1))


def _joined(mask: Bools) -> Bools:
    """The mask as one part that is connected by sides."""
    mask = _without_crossings(mask)
    labels, parts = _labels(mask)
    return mask if parts == 1 else _without_crossings(_bridged(labels, parts))


def _without_crossings(mask: Bools) -> Bools:
    """Fill a pixel wherever two pixels touch only by a corner, until none do."""
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
    """Label the parts that are connected by sides: labels (h, w), -1 off the mask, and their number."""
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
    """Join parts by shortest paths, which cross where the cells nearest to one part touch those of another.

    Labels (h, w) number the parts from 0; off the mask they are -1.
    """
    padded = np.pad(labels, 1, constant_values=-2)  # nothing spreads beyond the frame
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
    """Spread labels over unlabelled cells (-1) ring by ring: label, previous cell and number of steps of each."""
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
    """Outer boundary of one part without crossings, as corners of pixels; pixel [0, 0] is from (0, 0) to (1, 1).

    In each row of corners the first is joined to the second, the third to the fourth, and so on; columns likewise.
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
    """Removal of inner corners from a simple ring; `corners` (n, 2) are integers that turn from +x toward +y."""

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
        kept = np.flatnonzero(self.left).tolist()
        self.points: list[Point] = [(self.at[i][0] * SUB, self.at[i][1] * SUB) for i in kept]
        """Remaining corners, in order, in 1/256 px."""
        self.offs = [self._off(i, self.after[i]) for i in kept]
        """Distance from the edge at each remaining corner to the farthest corner removed there, px."""

    def _offer(self, i: int) -> None:
        """Put an inner corner on the heap if the edge of its neighbours is near enough to all corners between them."""
        a, c = self.before[i], self.after[i]
        if turn(self.at[a], self.at[i], self.at[c]) > 0:
            return
        off = self._off(a, c)
        if off <= self.tolerance:
            heapq.heappush(self.heap, (off, i, a, c))

    def _off(self, a: int, c: int) -> float:
        """Largest distance from the first outline's corners between a and c to the segment ac."""
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
        """Whether no other corner lies in the closed, added triangle."""
        others = self.left.copy()
        others[[a, i, c]] = False
        return not _any_within((self.at[c], self.at[i], self.at[a]), self.corners[others])


def _distance(points: npt.NDArray[np.int64], a: Point, c: Point) -> float:
    """Largest distance of points (n, 2) to a segment, with rounding: it only limits the simplification."""
    dx, dy = c[0] - a[0], c[1] - a[1]
    x, y = points[:, 0] - a[0], points[:, 1] - a[1]
    share = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1), 0, 1)
    return math.sqrt(float(((x - share * dx) ** 2 + (y - share * dy) ** 2).max(initial=0)))


def _without_edges(ring: list[Point], offs: list[float], tolerance: float) -> list[Point]:
    """Remove outer edges of a simple ring of corners in 1/256 px, the nearest to its new corner first.

    Edge i, which begins at corner i, may already lie `offs[i]` px from the first outline, and at most `tolerance` px.
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
    """Point where the neighbours of edge i meet, rounded outward, and its distance; infinite if they do not meet."""
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
    if any(_any_within(triangle, others) for triangle in ((a, tip, b), (b, tip, c), (c, tip, d))):
        return False
    path = np.concatenate([[d], others, [a]])  # edges from d around to a
    return not (_cut_by(a, tip, path[:-1]) or _cut_by(tip, d, path[1:]))


def _any_within(triangle: tuple[Point, Point, Point], points: Ints) -> bool:
    """Whether a point lies in a closed triangle that turns from +x toward +y."""
    p, q, r = triangle
    low, high = tuple(map(min, p, q, r)), tuple(map(max, p, q, r))
    x, y = points.T
    at = points[(x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])].T
    return bool(((turn(p, q, at) >= 0) & (turn(q, r, at) >= 0) & (turn(r, p, at) >= 0)).any())


def _cut_by(a: Point, b: Point, path: Ints) -> bool:
    """Whether a polyline crosses a segment; touching counts."""
    start, end = path[:-1], path[1:]
    sides = np.sign(turn(a, b, path.T))
    begins, ends = (start - a)[:, ::-1] * (end - start), (start - b)[:, ::-1] * (end - start)
    of_a, of_b = (np.sign(v[:, 1] - v[:, 0]) for v in (begins, ends))
    low, high = np.minimum(a, b), np.maximum(a, b)
    near = ((np.maximum(start, end) >= low) & (np.minimum(start, end) <= high)).all(axis=1)
    return bool((near & (sides[:-1] * sides[1:] <= 0) & (of_a * of_b <= 0)).any())
