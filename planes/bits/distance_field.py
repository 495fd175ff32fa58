"""The distance field: the city-block distance of each pixel from the label plane's items, and rays that march by it.

A thin ray crosses from cell to cell, along x or y. After n crossings it is in a cell at city-block distance n from the
first. If nothing lies nearer to its cell than a distance d, it may jump d crossings: neither the cells in between nor
those that it touches at their corners are taken.

    after n crossings, i(n) of them along x:    i(n) = floor((A n + C) / B)
    A = 256 |dx|     B = 256 (|dx| + |dy|)      C = |dx| (128 - ay) + |dy| (128 + ax)

(ax, ay) is the start, in 1/256 px ahead of the middle of its cell; on a border the cell is the one that the ray enters.
If the quotient is whole, the ray goes through a corner. It crosses along x first, and looks at the cell that it touches
on the other side of the corner from there. Along a border of two rows or columns the quotient is always whole (C = 0),
and each step looks at the cell on the other side.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, Ints, Labels
from ..common.limits import HALF, SUB
from ..grid.spans import Box, meets
from ..scene.derived import Derivative
from ..scene.items import Items
from .label_plane import LabelPlane

PAD = 2
"""Free cells around a plane: a ray looks at most two cells beyond it."""

FAR = 254
"""Greatest distance, px; one more still fits a byte."""

NOTHING, UNDECIDED = -1, -2
"""Entries of rays that touch nothing, and of rays that this method cannot follow."""

EXACT = 2.0**52
"""Bound of whole numbers whose quotients have an exact floor in floats."""

LONGEST = 2**30
"""Longest step along an axis, 1/256 px; products with it fit int64."""

WORTH_TAKING = 0.75
"""Finished rays are removed when at most this fraction is left."""

LOOKS_MOST = 512
"""Most cells that one ray looks at in Python integers; along a surface it goes pixel by pixel."""

FEW = 50
"""Number of rays left at which they are followed one by one, in Python integers."""

ONE_BY_ONE = 16
"""Most rays of a call that are followed one by one from the start."""

Clearance = npt.NDArray[np.uint8]


def distances_of(taken: Bools) -> Clearance:
    """City-block distances of all cells from the taken ones, up to FAR.

    Parameters
    ----------
    taken : (h, w)

    Returns
    -------
    (h + 2 PAD, w + 2 PAD) distances, 0 for taken cells; cells beyond the plane are free
    """
    h, w = taken.shape
    distance = np.full((h + 2 * PAD, w + 2 * PAD), FAR, np.uint8)
    np.multiply(~taken, np.uint8(FAR), out=distance[PAD:-PAD, PAD:-PAD])
    _spread(distance)
    upright = np.ascontiguousarray(distance.T)
    _spread(upright)
    return np.ascontiguousarray(upright.T)


def _spread(distance: Clearance) -> None:
    """Let each row be at most 1 farther than those above and below it."""
    farther = np.empty(distance.shape[1], np.uint8)
    for rows in (distance, distance[::-1]):
        for before, here in pairwise(rows):
            np.add(before, 1, out=farther)
            np.minimum(here, farther, out=here)


def first_taken(distances: Clearance, start_256: Ints, step_256: Ints) -> tuple[Ints, Ints, Bools]:
    """The first cell of each ray that is taken.

    Parameters
    ----------
    distances : (H, W) of `distances_of`
    start_256, step_256 : (R, 2) rays, relative to the middle of pixel [0, 0] of `distances`, up to 2**48

    Returns
    -------
    entry : (R,) time of entry, a whole number over max(1, |dx|) max(1, |dy|); NOTHING; or UNDECIDED for a ray without
        length, for one that may be too long, and in numpy for one of a few that looks at more than LOOKS_MOST cells
    cell : (R,) place of the cell in `distances`
    several : (R,) whether the ray comes to several cells at once, any of which may be the taken one: those in which it
        starts, those on both sides of a border, or this cell, the one beside a corner along y, and the one behind
    """
    count = len(start_256)
    if count <= ONE_BY_ONE:
        return _each(distances, start_256, step_256)
    entry, cell, several = np.full(count, NOTHING), np.zeros(count, np.int64), np.zeros(count, np.bool_)
    start, step = np.ascontiguousarray(start_256.T), np.ascontiguousarray(step_256.T)
    rays, first, columns = _ways(distances.shape, start, step, entry)
    n, flat = first.astype(np.float64), distances.reshape(-1)
    between = _between(flat, columns, n, start[:, rays])
    several[rays[between]], cell[rays[between]] = True, columns[5, between]
    found = [rays[between]]
    if len(between):
        others = np.delete(np.arange(len(n)), between)
        rays, n, columns = rays[others], n[others], columns[:, others]
    found.append(_follow(flat, rays, n, columns, cell, several))
    hit_rays = np.concatenate(found)
    entry[hit_rays] = _entries(cell[hit_rays], distances.shape[1], start[:, hit_rays], step[:, hit_rays])
    return entry, cell, several


def _follow(flat: Clearance, rays: Ints, n: Floats, columns: Floats, cell: Ints, several: Bools) -> Ints:
    """March rays, one jump each in turn, until all are done; return those that hit, and fill `cell` and `several`."""
    found: list[Ints] = []
    while len(n) > FEW:
        k, at_corner, jump = _looked(flat, columns, n)
        n += jump
        np.minimum(n, columns[6], out=n)
        live = n < columns[6]
        hit = live & (jump == 0)
        live ^= hit
        if np.count_nonzero(live) > WORTH_TAKING * len(n):
            continue
        met, left = np.flatnonzero(hit), np.flatnonzero(live)
        which = rays[met]
        cell[which], several[which] = k[met], at_corner[met]
        found.append(which)
        rays, n, columns = rays[left], n[left], columns.take(left, axis=1)
    for ray, column, crossings in zip(rays.tolist(), columns.T.tolist(), n.tolist(), strict=True):
        place, corner = _alone(flat.data, [int(v) for v in column], int(crossings))
        if place != NOTHING:
            cell[ray], several[ray] = place, corner
            found.append(np.array([ray]))
    return np.concatenate([np.zeros(0, np.int64), *found])


def _each(distances: Clearance, start_256: Ints, step_256: Ints) -> tuple[Ints, Ints, Bools]:
    """Like `first_taken`, for a few rays."""
    flat, shape = distances.reshape(-1).data, distances.shape
    rays = zip(start_256.tolist(), step_256.tolist(), strict=True)
    found = [one_taken(flat, shape, start, step) for start, step in rays]
    entry, cell, several = zip(*found, strict=True) if found else ((), (), ())
    return np.array(entry, np.int64), np.array(cell, np.int64), np.array(several, np.bool_)


def one_taken(
    flat: memoryview, shape: tuple[int, ...], start: Sequence[int], step: Sequence[int]
) -> tuple[int, int, bool]:
    """Entry and place of the first taken cell of one ray, and whether it is one of several: see `first_taken`.

    Off the plane the ray jumps by its distance from the plane.
    """
    (height, width), back_x, back_y = shape, step[0] < 0, step[1] < 0
    dx, dy = abs(step[0]), abs(step[1])
    if dx == 0 == dy or dx > LONGEST or dy > LONGEST:
        return UNDECIDED, 0, False
    x, y = (start[0] + HALF - back_x) >> 8, (start[1] + HALF - back_y) >> 8
    sx, sy = 1 - 2 * back_x, 1 - 2 * back_y
    ax, ay = sx * (start[0] - SUB * x), sy * (start[1] - SUB * y)
    last_x, last_y = (dx + ax + HALF) >> 8, (dy + ay + HALF) >> 8
    if _is_beside(x, x + sx * last_x, width) or _is_beside(y, y + sy * last_y, height):
        return NOTHING, 0, False
    level, upright = dy == 0 and ay == -HALF, dx == 0 and ax == -HALF
    a, b, c = SUB * dx, SUB * (dx + dy), 0 if level else dx * (HALF - ay) + dy * (HALF + ax)
    aside = width if level else 1 if upright else sx - sy * width
    back = sx * (ax == -HALF), sy * width * (ay == -HALF)
    n = looks = 0
    while n <= last_x + last_y:
        looks += 1
        if looks > LOOKS_MOST:
            return UNDECIDED, 0, False
        i, rest = divmod(a * n + c, b)
        u, v = x + sx * i, y + sy * (n - i)
        off = 0
        if not (0 < u < width - 1 and 0 < v < height - 1):
            off = max(1 - u, u - width + 2, 0) + max(1 - v, v - height + 2, 0)
        cell = v * width + u
        jump = off or (flat[cell] if rest else min(flat[cell], flat[cell - aside]))
        if not n and not off and back != (0, 0) and _starts_beside(flat, cell, back):
            return 0, cell, True
        if not jump:
            times = (SUB * i - HALF - ax) * max(dy, 1), (SUB * (n - i) - HALF - ay) * max(dx, 1)
            return max(*times, 0), cell, not rest
        n += jump
    return NOTHING, 0, False


def _is_beside(first: int, last: int, size: int) -> bool:
    """Whether cells from the first to the last, along one axis, lie off the plane."""
    return (first < 1 and last < 1) or (first > size - 2 and last > size - 2)


def _starts_beside(flat: memoryview, cell: int, back: tuple[int, int]) -> bool:
    """Whether a ray that starts on a border of its cell touches another cell there that is taken."""
    return any(step and not flat[cell - step] for step in (*back, sum(back)))


def _alone(flat: memoryview, column: list[int], n: int) -> tuple[int, bool]:
    """First taken cell of one ray from crossing n on, or NOTHING, and whether it is at a corner."""
    a, b, c, along, across, base, stop, aside = column
    while n < stop:
        i, rest = divmod(a * n + c, b)
        cell = base + i * along + n * across
        jump: int = flat[cell]
        if not rest:
            jump = min(jump, flat[cell - aside])
        if not jump:
            return cell, not rest
        n += jump
    return NOTHING, False


def _entries(cell: Ints, width: int, start: Ints, step: Ints) -> Ints:
    """Times at which rays (2, n) enter cells."""
    ahead = np.stack([cell % width, cell // width])
    ahead *= SUB
    ahead -= start
    np.negative(ahead, out=ahead, where=step < 0)
    ahead -= HALF
    ahead *= np.maximum(np.abs(step[::-1]), 1)
    entry: Ints = np.maximum(ahead[0], ahead[1])
    return np.maximum(entry, 0, out=entry)


def _between(flat: Clearance, columns: Floats, first: Floats, start: Ints) -> Ints:
    """Rays that start on a border and touch a taken cell there, other than the one that they enter."""
    on_border = (start & (SUB - 1)) == HALF
    at = np.flatnonzero((on_border[0] | on_border[1]) & (first == 0))
    if not len(at):
        return at
    along, across, base = columns[3:6, at].astype(np.int64)
    x, y = (along + across) * on_border[0, at], across * on_border[1, at]
    taken = [(flat[base - step] == 0) & (step != 0) for step in (x, y, x + y)]
    return at[np.any(taken, axis=0)]


def _looked(flat: Clearance, columns: Floats, n: Floats) -> tuple[npt.NDArray[np.intp], Bools, Clearance]:
    """Cells of rays after n crossings, whether they are at a corner, and how far the rays may jump."""
    a, b, c, along, across, base, _, aside = columns
    quotient = a * n
    quotient += c
    quotient /= b
    place = np.floor(quotient)
    corner = place == quotient
    place *= along
    place += base
    np.multiply(across, n, out=quotient)
    place += quotient
    cell = place.astype(np.intp)
    jump = flat.take(cell)
    if corner.any():  # the cell is entered along x, so both cells lie within the padded plane
        at = np.flatnonzero(corner)
        jump[at] = np.minimum(jump[at], flat[cell[at] - aside[at].astype(np.intp)])
    return cell, corner, jump


def _ways(shape: tuple[int, ...], start: Ints, step: Ints, entry: Ints) -> tuple[Ints, Ints, Floats]:
    """Rays (2, R) that come to the plane: numbers, first crossings, and columns; entries of undecided rays are set.

    The columns (8, n) are A, B, C; the change of a cell's place by a crossing along x instead of y, and along y; the
    place of the first cell; the number of crossings to the ray's end, or off the plane; and the difference of the
    places of this cell and the one on the other side, where both are touched.
    """
    height, width = shape
    back, length = step < 0, np.abs(step)
    cell = (start + (HALF - back)) >> 8
    ahead = start - (cell << 8)
    np.negative(ahead, out=ahead, where=back)
    last = (length + ahead + HALF) >> 8
    before, behind = cell - 1, np.array([[width - 2], [height - 2]]) - cell
    room, owed = np.where(back, before, behind), -np.where(back, behind, before)
    reached = (room >= 0) & (owed <= last)
    odd = (length[0] + length[1] == 0) | (np.maximum(*length) > LONGEST)
    rays = np.flatnonzero(reached[0] & reached[1] & ~odd)
    entry[odd] = UNDECIDED
    if len(rays) < len(odd):
        length, ahead, last, room, owed = (v.take(rays, axis=1) for v in (length, ahead, last, room, owed))
        back, cell = back[:, rays], cell[:, rays]
    (dx, dy), (ax, ay) = length, ahead
    a, b, c = SUB * dx, SUB * (dx + dy), dx * (HALF - ay) + dy * (HALF + ax)
    c[(dy == 0) & (ay == -HALF)] = 0
    first, stop = np.zeros_like(dx), last[0] + last[1] + 1
    for axis in (0, 1):
        _reach(np.minimum, stop, np.flatnonzero(last[axis] > room[axis]), axis, room[axis] + 1, (a, b, c, dy))
        _reach(np.maximum, first, np.flatnonzero(owed[axis] > 0), axis, owed[axis], (a, b, c, dy))
    across = np.where(back[1], -width, width)
    along = 1 - 2 * back[0] - across
    columns = np.array([a, b, c, along, across, cell[1] * width + cell[0], stop, along], np.float64)
    columns[7, (dx == 0) & (ax == -HALF)], columns[7, (dy == 0) & (ay == -HALF)] = 1, width
    long = columns[0] * stop + c >= EXACT
    entry[rays[long]] = UNDECIDED
    kept = np.flatnonzero((first < stop) & ~long)
    return (rays, first, columns) if len(kept) == len(rays) else (rays[kept], first[kept], columns[:, kept])


def _reach(better: Any, crossings: Ints, rays: Ints, axis: int, place: Ints, of: tuple[Ints, ...]) -> None:
    """Bound numbers of crossings by that at which rays come to a column (axis 0) or row (1) `place` cells ahead."""
    if not len(rays):
        return
    a, b, c, dy = (v[rays] for v in of)
    at = (c + b * (place[rays] - 1)) // (SUB * dy) + 1 if axis else -((c - b * place[rays]) // a)
    crossings[rays] = better(crossings[rays], at)


class DistanceField(Derivative):
    """City-block distances from the items on a label plane, made anew when the plane has changed."""

    def __init__(self, labels: LabelPlane) -> None:
        super().__init__()
        self.labels = labels
        self._made: Clearance | None = None

    @property
    def corner_xy(self) -> Ints:
        """Pixel of the world at [0, 0]."""
        return np.array(self.labels.box_xyxy[:2]) - PAD

    def is_made(self, items: Items) -> bool:
        """Whether the field is made for the scene as it is now."""
        with self._lock:
            if self._seen != items.version:
                changes = self._unseen(items)
                if changes is None or any(self._holds(box) for _, _, *both in changes for box in both):
                    self._made, self.regret = None, 0.0
            return self._made is not None

    def _holds(self, boxes_xyxy: Ints | Box) -> bool:
        """Whether any box overlaps the plane; a box that ends before it begins is empty."""
        box = np.reshape(boxes_xyxy, (-1, 4))
        return bool(
            (meets(box, np.array(self.labels.box_xyxy)) & (box[:, 0] <= box[:, 2]) & (box[:, 1] <= box[:, 3])).any()
        )

    def read(self, items: Items, labels: Labels) -> Clearance:
        """Distances (h + 2 PAD, w + 2 PAD) of the present version, from the labels of that version."""
        with self._lock:
            if not self.is_made(items) or self._made is None:
                self._made = distances_of(labels != 0)
            return self._made
