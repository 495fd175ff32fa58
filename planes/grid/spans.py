"""Sets of pixels as row spans (y, x_first, x_last), and tests before pixels are counted: boxes, strips, slabs.

y = 0   . # # . #      (0, 1, 2) (0, 4, 4)
y = 1   # # # # #      (1, 0, 4)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, InputError, Ints, bools, integer, integers, kind_of
from ..common.limits import POSITION_MAX

Box = tuple[int, int, int, int]


class Columns:
    """Base of dataclasses whose fields are columns of equal length."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.__dataclass_fields__))))

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return sum(int(getattr(self, name).nbytes) for name in self.__dataclass_fields__)

    def take(self, rows: Ints | Bools | slice) -> Self:
        """Some of the rows, in order."""
        return type(self)(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Rows of several parts, one after another; the columns of no parts are int64."""
        if len(parts) == 1:
            return parts[0]
        none = [np.zeros(0, np.int64)] * (not parts)
        names = cls.__dataclass_fields__
        return cls(*(np.concatenate([*none, *(getattr(part, name) for part in parts)]) for name in names))


def begins(group: Ints) -> Bools:
    """Whether each number (n,) differs from the one before it, and so begins a group."""
    new = np.ones(len(group), np.bool_)
    np.not_equal(group[1:], group[:-1], out=new[1:])
    return new


def clipped(boxes_xyxy: Ints, box_xyxy: Box | Ints) -> Ints:
    """Clip inclusive boxes (n, 4) to a box; those outside get x_max < x_min or y_max < y_min."""
    low, high = np.maximum(boxes_xyxy[:, :2], box_xyxy[:2]), np.minimum(boxes_xyxy[:, 2:], box_xyxy[2:])
    return np.concatenate([low, high], axis=1)


def sorted_once(numbers: Ints) -> Ints:
    """Each of the numbers (n,) once, sorted; `np.unique` of NumPy 2.3 hashes them, and takes 20 times as long."""
    numbers = np.sort(numbers)
    return numbers[begins(numbers)]


def ragged(lengths: Ints) -> tuple[Ints, Ints]:
    """Number the elements of groups: [2, 3] gives groups [0, 0, 1, 1, 1] and places [0, 1, 0, 1, 2]."""
    if len(lengths) == 1:  # most calls of numpy take as long as for a hundred groups
        place = np.arange(lengths.item())
        return np.zeros_like(place), place
    group = np.repeat(np.arange(len(lengths)), lengths)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def each_pixel(x_first: Ints, x_last: Ints) -> tuple[Ints, Ints]:
    """List the pixels of runs, as (run number, x)."""
    run, place = ragged(x_last - x_first + 1)
    return run, x_first[run] + place


def pieces(lengths: Ints, limit: int) -> list[slice]:
    """Cut a list of groups into slices of about `limit` elements; a larger group is a slice of its own."""
    total = np.cumsum(lengths)
    if not len(lengths) or total[-1] <= limit:
        return [slice(0, len(lengths))]
    cuts = np.flatnonzero(np.diff(total // limit)) + 1
    edges = [0, *cuts.tolist(), len(lengths)]
    return [slice(a, b) for a, b in pairwise(edges)]


def meets(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> Bools:
    """Whether boxes (..., 2d) overlap or touch; the two arrays broadcast.

    A row has the least coordinate of each axis and then the greatest; inclusive boxes of pixels that touch share one.
    """
    dim = a.shape[-1] // 2
    good = (a[..., 0] <= b[..., dim]) & (b[..., 0] <= a[..., dim])
    for axis in range(1, dim):
        good &= a[..., axis] <= b[..., dim + axis]
        good &= b[..., axis] <= a[..., dim + axis]
    return np.asarray(good)


FEW_ROWS, KEY_BITS = 64, 63
"""So few rows are sorted by their keys, as they are: finding out how large those are takes longer. Bits of a key."""


# house: row order
def row_order(*keys: npt.NDArray[Any]) -> Ints:
    """Order of rows by keys (n,), the most important first, then by place: whole keys as one number, if that fits."""
    if len(keys[0]) <= FEW_ROWS or any(key.dtype.kind == "f" for key in keys):
        return np.lexsort(keys[::-1])
    least = [int(np.minimum.reduce(key)) for key in keys]
    bits = [(int(np.maximum.reduce(key)) - low).bit_length() for key, low in zip(keys, least, strict=True)]
    if sum(bits) > KEY_BITS:
        return np.lexsort(keys[::-1])
    number = keys[0] - least[0]
    for key, low, size in zip(keys[1:], least[1:], bits[1:], strict=True):
        number <<= size
        number |= key - low
    return np.asarray(number.argsort(kind="stable"))


def merged_runs(row: Ints, x_first: Ints, x_last: Ints) -> tuple[Ints, Ints, Ints]:
    """Union of runs on numbered rows, as maximal runs sorted by (row, x_first); empty runs are dropped.

    Returned are the number of the first run that went into each maximal run, x_first, and x_last.
    """
    filled = np.flatnonzero(x_first <= x_last)
    order = filled[row_order(row[filled], x_first[filled])]
    row, x_first, x_last = row[order], x_first[order], x_last[order]
    if not len(row):
        return order, x_first, x_last
    # Put all rows on one line, two pixels apart, so that one running maximum serves all.
    left = x_first.min()
    shift = np.cumsum(np.diff(row, prepend=row[0]) != 0) * (x_last.max() - left + 3) - left
    reach = np.maximum.accumulate(x_last + shift)
    begins = np.concatenate(([True], (x_first + shift)[1:] > reach[:-1] + 1))
    ends = np.concatenate((begins[1:], [True]))
    return order[begins], x_first[begins], (reach - shift)[ends]


def checked_runs(y: object, x_first: object, x_last: object) -> tuple[Ints, Ints, Ints]:
    """Check columns (n,) of runs that a caller made, whole px."""
    rows = integers("y", y, (None,), -POSITION_MAX, POSITION_MAX)
    ends = (("x_first", x_first), ("x_last", x_last))
    first, last = (integers(name, column, rows.shape, -POSITION_MAX, POSITION_MAX) for name, column in ends)
    return rows, first, last


def columns_of(spans: object) -> tuple[Ints, Ints, Ints]:
    """The columns of a set, which are checked if it was made by hand."""
    if not isinstance(spans, Spans):
        raise InputError(f"spans: expected Spans, got {kind_of(spans)}")
    y, *_ = columns = spans.y, spans.x_first, spans.x_last
    if not all(type(c) is np.ndarray and c.dtype == np.int64 and c.shape == (y.size,) for c in columns):
        y, *_ = columns = checked_runs(*columns)
    empty = np.flatnonzero(columns[1] > columns[2])
    if len(empty):
        _, first, last = (int(column[empty[0]]) for column in columns)
        raise InputError(f"x_last[{empty[0]}]: expected at least x_first, {first}, got {last}")
    return columns


def area(boxes_xyxy: Ints) -> int:
    """Sum of the pixels of inclusive boxes."""
    sides = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1
    return int((sides[:, 0] * sides[:, 1]).sum())


@dataclass(frozen=True, eq=False)
class Spans:
    """A set of pixels as runs x_first .. x_last in rows y; runs are maximal, disjoint, sorted by (y, x_first).

    Parameters
    ----------
    y, x_first, x_last : (n,) int64, px
    """

    y: Ints
    x_first: Ints
    x_last: Ints

    @classmethod
    def from_runs(cls, y: Ints, x_first: Ints, x_last: Ints) -> Spans:
        """Union of any runs: unsorted, overlapping, or empty (x_first > x_last)."""
        columns = y, x_first, x_last
        if not all(type(c) is np.ndarray and c.dtype == np.int64 and c.shape == (y.size,) for c in columns):
            y, x_first, x_last = checked_runs(*columns)
        which, first, last = merged_runs(y, x_first, x_last)
        return cls(y[which], first, last)

    @classmethod
    def empty(cls) -> Spans:
        """The empty set."""
        none = np.zeros(0, np.int64)
        return cls(none, none, none)

    @classmethod
    def from_mask(cls, mask: Bools, origin_xy: tuple[int, int] = (0, 0)) -> Spans:
        """Set pixels of a mask (h, w) of booleans, or of 0 and 1, whose pixel [0, 0] lies at `origin_xy`, whole px."""
        if type(mask) is not np.ndarray or mask.dtype != np.bool_ or mask.ndim != 2:
            mask = bools("mask", mask, (None, None))
        if type(origin_xy) is not tuple or [*map(type, origin_xy)] != [int, int]:
            x, y = integers("origin_xy", origin_xy, (2,), -POSITION_MAX, POSITION_MAX).tolist()
            origin_xy = x, y
        padded = np.zeros((mask.shape[0], mask.shape[1] + 2), np.int8)
        padded[:, 1:-1] = mask
        edges = padded[:, 1:] - padded[:, :-1]
        y, x_first = np.nonzero(edges == 1)
        x_last = np.nonzero(edges == -1)[1] - 1
        return cls(y + origin_xy[1], x_first + origin_xy[0], x_last + origin_xy[0])

    def __len__(self) -> int:
        return len(self.y)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Spans):
            return NotImplemented
        pairs = ((self.y, other.y), (self.x_first, other.x_first), (self.x_last, other.x_last))
        return all(np.array_equal(a, b) for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]

    @property
    def lengths(self) -> Ints:
        """Number of pixels of each run."""
        return self.x_last - self.x_first + 1

    @cached_property
    def count(self) -> int:
        """Number of pixels of the set."""
        _, first, last = columns_of(self)
        return int((last - first + 1).sum())

    @cached_property
    def box_xyxy(self) -> Box | None:
        """(x_min, y_min, x_max, y_max), inclusive; None for the empty set."""
        y, first, last = columns_of(self)
        return (int(first.min()), int(y.min()), int(last.max()), int(y.max())) if len(y) else None

    def to_mask(self) -> tuple[Bools, tuple[int, int]]:
        """Mask (h, w) of the box of the set, and the position of its pixel [0, 0]."""
        box = self.box_xyxy
        if box is None:
            return np.zeros((0, 0), np.bool_), (0, 0)
        x, y, x_max, y_max = box
        edges = np.zeros((y_max - y + 1, x_max - x + 2), np.int8)
        edges[self.y - y, self.x_first - x] = 1
        edges[self.y - y, self.x_last - x + 1] = -1  # runs are maximal: no run begins right after another
        return np.cumsum(edges, axis=1, dtype=np.int8)[:, :-1].astype(np.bool_), (x, y)

    def runs(self) -> Ints:
        """Runs (n, 3) as rows [y, x_first, x_last]."""
        return np.stack([self.y, self.x_first, self.x_last], axis=1)

    def pixels(self) -> Ints:
        """Pixels as rows (x, y), ordered by (y, x)."""
        run, x = each_pixel(self.x_first, self.x_last)
        return np.stack([x, self.y[run]], axis=1)

    def translated(self, dx: int, dy: int) -> Spans:
        """Shift the set by whole pixels."""
        most = 2 * POSITION_MAX
        dx, dy = integer("dx", dx, -most, most), integer("dy", dy, -most, most)
        y, first, last = columns_of(self)
        return Spans(y + dy, first + dx, last + dx)

    def union(self, other: Spans) -> Spans:
        """Pixels of either set."""
        return Spans.from_runs(*map(np.concatenate, zip(columns_of(self), columns_of(other), strict=True)))


Strip = tuple[int, int, int, int]

NO_STRIPS: Ints = np.zeros((0, 4), np.int64)

SCALE = 2**10  # approximate length of the normals of strips: they are whole numbers
TILE = 48  # typical side of the boxes that patterns are tested against, px: a strip rejects larger boxes less often
PAYS = 0.75  # strips are used if at most this part of the boxes that overlap a pattern's box pass its strip, too


def strips_of(strips: Sequence[Strip] | Ints, boxes_xyxy: Ints) -> Ints:
    """Strips (n, 4) of patterns with boxes (n, 4); an empty array (0, 4) if they would reject too few boxes."""
    made = np.array(strips, np.int64).reshape(-1, 4)
    normal, side = np.abs(made[:, :2]), boxes_xyxy[:, 2:] - boxes_xyxy[:, :2]
    grown = TILE * normal.sum(axis=1)
    met = (made[:, 3] - made[:, 2] + grown) / np.maximum((normal * side).sum(axis=1) + grown, 1)
    return made if met.mean() <= PAYS else NO_STRIPS


def strip_of(spans: Spans) -> Strip:
    """The narrow strip that holds a set of pixels, as (a, b, low, high): low <= a * x + b * y <= high.

    Its normal is the direction in which the pixels are least spread, by their second moments. This is the separating
    axis of an oriented box (Gottschalk, Lin and Manocha, "OBBTree: a hierarchical structure for rapid interference
    detection", 1996); compiled kernels have the same test inline.
    """
    if not len(spans):
        return 0, 0, 0, 0
    length = (spans.x_last - spans.x_first + 1).astype(np.float64)
    x, y = (spans.x_first + spans.x_last) / 2, spans.y.astype(np.float64)
    x, y = x - np.average(x, weights=length), y - np.average(y, weights=length)
    xx, xy, yy = (float((length * part).sum()) for part in (x * x + (length * length - 1) / 12, x * y, y * y))
    along = math.atan2(2 * xy, xx - yy) / 2
    a, b = round(-SCALE * math.sin(along)), round(SCALE * math.cos(along))
    ends = np.concatenate([a * spans.x_first, a * spans.x_last]) + b * np.concatenate([spans.y, spans.y])
    return a, b, int(ends.min()), int(ends.max())


def meets_strip(strips: Ints, which: Ints | int, left: Ints, top: Ints, wide: int, high: int) -> Ints:
    """Rows of the boxes that touch the strip of their pattern.

    Parameters
    ----------
    strips, which : (m, 4) strips, and the row of the strip for each box
    left, top : (n,) corners of the boxes relative to the pattern's origin
    wide, high : largest width and height of a box
    """
    a, b = strips[:, 0], strips[:, 1]
    least = strips[:, 2] - np.maximum(a, 0) * (wide - 1) - np.maximum(b, 0) * (high - 1)
    most = strips[:, 3] - np.minimum(a, 0) * (wide - 1) - np.minimum(b, 0) * (high - 1)
    across = a[which] * left
    across += b[which] * top
    met = across >= least[which]
    met &= across <= most[which]
    return np.asarray(met.nonzero()[0])


Reals = npt.NDArray[np.floating[Any]]


def slabs(begin: Reals, step: Reals, low: Reals, high: Reals) -> tuple[Floats, Floats]:
    """Clip segments to boxes: the fractions of each segment at which it enters and leaves its box.

    An axis along which a segment does not move is ignored. A segment misses its box if it leaves before it enters, or
    if that interval lies outside [0, 1].

    Parameters
    ----------
    begin, step : (..., d) starts of the segments, and vectors to their ends
    low, high : (..., d) sides of the boxes

    References
    ----------
    Kay and Kajiya, "Ray tracing complex scenes" (1986); Liang and Barsky, "A new concept and method for line clipping"
    (1984).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (low - begin) / step, (high - begin) / step
    level = step == 0
    first = np.where(level, -np.inf, np.minimum(to_low, to_high)).max(axis=-1)
    last = np.where(level, np.inf, np.maximum(to_low, to_high)).min(axis=-1)
    return np.asarray(first), np.asarray(last)


WIDEST = 2**40  # a column beyond all others, px


class RowRuns(NamedTuple):
    """Runs of several shapes, row by row."""

    shape: Ints  # of each run (k,), sorted
    y: Ints  # row of each run (k,), sorted within its shape
    parts: Sequence[tuple[Ints, Ints]] | Ints  # first and last pixels (k,); an empty part is (WIDEST, -WIDEST)

    def spans(self) -> Spans:
        """The pixels of a single shape."""
        (first, last), *more = self.parts
        for begin, end in more:
            apart = np.maximum(first, begin) > np.minimum(last, end) + 1
            if (apart & (first <= last) & (begin <= end)).any():
                columns = zip(*((self.y, *part) for part in self.parts), strict=True)
                return Spans.from_runs(*map(np.concatenate, columns))
            first, last = np.minimum(first, begin), np.maximum(last, end)
        filled = first <= last
        return Spans(self.y[filled], first[filled], last[filled])

    def masks(self, count: int) -> list[tuple[Bools, tuple[int, int]]]:
        """Mask (h, w) of each of so many shapes, cropped to its pixels, and the position of its pixel [0, 0]."""
        begin, end = self.parts[0]
        for first, last in self.parts[1:]:
            begin, end = np.minimum(begin, first), np.maximum(end, last)
        rows = np.flatnonzero(begin <= end)  # the others are empty
        starts = np.searchsorted(self.shape[rows], np.arange(count + 1))
        full, box = np.flatnonzero(np.diff(starts)), np.zeros((4, count), np.int64)
        top, low = self.y[rows[starts[full]]], self.y[rows[starts[full + 1] - 1]]
        left, right = np.minimum.reduceat(begin[rows], starts[full]), np.maximum.reduceat(end[rows], starts[full])
        box[:, full] = left, top, right - left + 2, low - top + 1  # a column beyond each mask, where its runs end
        edges = np.concatenate([[0], np.cumsum(box[2] * box[3])])
        shape = self.shape[rows]
        line = edges[shape] + (self.y[rows] - box[1, shape]) * box[2, shape] - box[0, shape]
        change = np.zeros(edges[-1], np.int8 if len(self.parts) < 128 else np.int32)
        for first, last in self.parts:  # each has one run in a row, so no pixel is listed twice
            here = np.flatnonzero(first[rows] <= last[rows])
            change[line[here] + first[rows[here]]] += 1
            change[line[here] + last[rows[here]] + 1] -= 1
        held = np.cumsum(change, dtype=change.dtype, out=change) > 0
        parts = zip(*box.tolist(), pairwise(edges.tolist()), strict=True)
        return [(held[slice(*part)].reshape(h, w)[:, :-1], (x, y)) for x, y, w, h, part in parts]


def in_rows(shape: Ints, y: Ints, first: Ints, last: Ints) -> RowRuns:
    """Unite the runs of each row of each shape, which has all rows from its first to its last."""
    kept = np.flatnonzero(first <= last)
    shape, y, first, last = shape[kept], y[kept], first[kept], last[kept]
    top = int(y.min(initial=0))
    line = shape * (int(y.max(initial=0)) - top + 1) + (y - top)
    which, first, last = merged_runs(line, first, last)
    shape, y, line = shape[which], y[which], line[which]
    begin = np.flatnonzero(begins(shape))
    end = np.append(begin[1:], len(y))[: len(begin)]
    own, row = each_pixel(y[begin], y[end - 1])
    at = np.searchsorted(own, np.cumsum(begins(shape)) - 1) + y - y[begin].repeat(end - begin)
    place = np.arange(len(line)) - np.searchsorted(line, line)
    parts = [(np.full(len(row), WIDEST), np.full(len(row), -WIDEST)) for _ in range(int(place.max(initial=0)) + 1)]
    for number, ends in enumerate(parts):
        here = place == number
        ends[0][at[here]], ends[1][at[here]] = first[here], last[here]
    return RowRuns(shape[begin][own], row, parts)


def rectangles(mask: Bools) -> Ints:
    """Rectangles (k, 4) that cover a mask (h, w): runs of equal columns in rows that follow each other, as one."""
    runs = Spans.from_mask(mask)
    order = np.lexsort((runs.y, runs.x_last, runs.x_first))
    y, first, last = runs.y[order], runs.x_first[order], runs.x_last[order]
    new = begins(first) | begins(last) | begins(y - np.arange(len(y)))
    begin, end = new.nonzero()[0], np.append(new[1:], True)[: len(y)].nonzero()[0]
    return np.stack([first[begin], y[begin], last[begin], y[end]], axis=1)
