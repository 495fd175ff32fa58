"""A set of pixels as row runs: masks and patterns alike.

y = 0   . # # . #      (0, 1, 2) (0, 4, 4)
y = 1   # # # # #      (1, 0, 4)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Ints

__all__ = ["Spans", "begins", "each_pixel", "meets", "merged_runs", "pieces", "ragged"]

Box = tuple[int, int, int, int]


def begins(group: Ints) -> Bools:
    """Which of numbers (n,) differ from those before them: the first ones of groups."""
    new = np.ones(len(group), np.bool_)
    np.not_equal(group[1:], group[:-1], out=new[1:])
    return new


def ragged(lengths: Ints) -> tuple[Ints, Ints]:
    """Number the elements of groups: [2, 3] gives groups [0, 0, 1, 1, 1] and places [0, 1, 0, 1, 2]."""
    group = np.repeat(np.arange(len(lengths)), lengths)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def each_pixel(x_first: Ints, x_last: Ints) -> tuple[Ints, Ints]:
    """Write runs out pixel by pixel, as (run number, x)."""
    run, place = ragged(x_last - x_first + 1)
    return run, x_first[run] + place


def pieces(lengths: Ints, limit: int) -> list[slice]:
    """Cut groups into runs of about so many elements; a larger group is a run of its own."""
    total = np.cumsum(lengths)
    if not len(lengths) or total[-1] <= limit:
        return [slice(0, len(lengths))]
    cuts = np.flatnonzero(np.diff(total // limit)) + 1
    edges = [0, *cuts.tolist(), len(lengths)]
    return [slice(a, b) for a, b in pairwise(edges)]


def meets(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> Bools:
    """Whether boxes, least and then greatest of each axis, overlap: (..., 2d) against (..., 2d), broadcast.

    Touching counts: inclusive boxes of pixels that meet share one.
    """
    dim = a.shape[-1] // 2
    good = (a[..., 0] <= b[..., dim]) & (b[..., 0] <= a[..., dim])
    for axis in range(1, dim):
        good &= a[..., axis] <= b[..., dim + axis]
        good &= b[..., axis] <= a[..., dim + axis]
    return np.asarray(good)


def merged_runs(row: Ints, x_first: Ints, x_last: Ints) -> tuple[Ints, Ints, Ints]:
    """Union of runs on numbered rows, as maximal runs sorted by (row, x_first); an empty run is dropped.

    Returns
    -------
    number of the first of the runs that went into each, x_first, x_last
    """
    some = np.flatnonzero(x_first <= x_last)
    order = some[np.lexsort((x_first[some], row[some]))]
    row, x_first, x_last = row[order], x_first[order], x_last[order]
    if not len(row):
        return order, x_first, x_last
    # Lay all rows on one line, two pixels apart, so that one running maximum serves them all.
    left = x_first.min()
    shift = np.cumsum(np.diff(row, prepend=row[0]) != 0) * (x_last.max() - left + 3) - left
    reach = np.maximum.accumulate(x_last + shift)
    begins = np.concatenate(([True], (x_first + shift)[1:] > reach[:-1] + 1))
    ends = np.concatenate((begins[1:], [True]))
    return order[begins], x_first[begins], (reach - shift)[ends]


@dataclass(frozen=True, eq=False)
class Spans:
    """Pixels (x, y) with x_first <= x <= x_last in row y; runs are maximal, disjoint, sorted by (y, x_first).

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
        row = np.asarray(y, np.int64)
        which, first, last = merged_runs(row, np.asarray(x_first, np.int64), np.asarray(x_last, np.int64))
        return cls(row[which], first, last)

    @classmethod
    def empty(cls) -> Spans:
        """No pixel at all."""
        none = np.zeros(0, np.int64)
        return cls(none, none, none)

    @classmethod
    def from_mask(cls, mask: Bools, origin_xy: tuple[int, int] = (0, 0)) -> Spans:
        """Pixels that are set in a mask (h, w) whose pixel [0, 0] lies at `origin_xy`."""
        edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
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
        """Pixels of each run."""
        return self.x_last - self.x_first + 1

    @cached_property
    def count(self) -> int:
        """Pixels of the set."""
        return int(self.lengths.sum())

    @cached_property
    def box_xyxy(self) -> Box | None:
        """(x_min, y_min, x_max, y_max), inclusive; None for the empty set."""
        if not len(self):
            return None
        return int(self.x_first.min()), int(self.y[0]), int(self.x_last.max()), int(self.y[-1])

    def to_mask(self) -> tuple[Bools, tuple[int, int]]:
        """Mask (h, w) of the set's box, and where its pixel [0, 0] lies."""
        box = self.box_xyxy
        if box is None:
            return np.zeros((0, 0), np.bool_), (0, 0)
        x, y, x_max, y_max = box
        edges = np.zeros((y_max - y + 1, x_max - x + 2), np.int8)
        edges[self.y - y, self.x_first - x] = 1
        edges[self.y - y, self.x_last - x + 1] = -1  # runs are maximal: the pixel behind a run begins no other
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
        return Spans(self.y + dy, self.x_first + dx, self.x_last + dx)

    def union(self, other: Spans) -> Spans:
        """Pixels of either set."""
        y = np.concatenate([self.y, other.y])
        return Spans.from_runs(
            y, np.concatenate([self.x_first, other.x_first]), np.concatenate([self.x_last, other.x_last])
        )
