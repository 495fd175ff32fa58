"""Boxes that come, move and go under ids of their own: the contract of every broad phase, and the plainest one.

A box is a row (min of each axis, max of each axis); two overlap when their closed intervals do, on every axis.

Searches read rows by `take` and `flatnonzero`: by brackets numpy takes up to ten times as long for the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from planes.arrays import Bools, Floats, InputError, Ints, array_of, integers, reals, shown
from planes.constants import CHUNK_PAIRS
from planes.spans import meets
from planes.volumes import Aabbs, Volumes

__all__ = ["BroadPhase", "BruteForce", "Cells", "Work", "box_rows", "piled", "sorted_pairs"]

Pairs = tuple[Ints, Ints]
AXES = "xyz"


def box_rows(field: str, values: object, dim: int | None = None) -> Floats:
    """Check boxes: Aabbs, or rows (N, 4) or (N, 6), finite, min <= max on every axis. They come as a copy.

    Raises
    ------
    InputError
        If they are not; it names the row.
    """
    if isinstance(values, Aabbs):
        values = np.concatenate([values.min, values.max], axis=1)
    array = None if isinstance(values, Volumes) else array_of(field, values)
    if array is None or not array.ndim:
        shapes = " or ".join(f"(N, {2 * d})" for d in (2, 3) if dim in (None, d))
        got = shown(values) if array is not None else f"{type(values).__name__} (their .bounds() are boxes)"
        raise InputError(f"{field}: expected Aabbs or rows {shapes}, got {got}")
    if dim is None:
        width = array.shape[-1] if array.ndim == 2 else 0
        if width not in (4, 6):
            raise InputError(f"{field}: expected shape (any, 4) or (any, 6), got {array.shape}")
        dim = width // 2
    rows = reals(field, values, (None, 2 * dim))
    bad = rows[:, :dim] > rows[:, dim:]
    if bad.any():
        row, axis = np.argwhere(bad)[0].tolist()
        low, high = rows[row, axis], rows[row, dim + axis]
        raise InputError(f"{field}[{row}]: expected min <= max in {AXES[axis]}, got {low:.17g} and {high:.17g}")
    return rows


def sorted_pairs(first: Ints, second: Ints, n: int) -> Ints:
    """Pairs as (2, K), sorted by (first, second); every second is below n."""
    key = np.sort(first * n + second) if n else first
    return np.stack(np.divmod(key, n)) if n else np.empty((2, 0), np.int64)


def piled(found: Sequence[Pairs]) -> Ints:
    """Join pairs that were found in pieces: (2, K) int64."""
    return np.concatenate([np.empty((2, 0), np.int64), *(np.stack(piece) for piece in found)], axis=1)


class Cells(NamedTuple):
    """Nodes of a structure, to be drawn: cells, quarters, boxes about boxes; each before what is in it.

    Parameters
    ----------
    number : (C,) int64, as `Work.visited` names them
    box : (C, 2d) float64, in the units of the boxes: infinite where a cell has no end, and with its min beyond its max
        where a node holds nothing any more
    leaf : (C,) bool, whether it lists boxes itself
    """

    number: Ints
    box: Floats
    leaf: Bools


@dataclass
class Work:
    """What a query looked at, as (2, K) rows [query, node] and [query, box]; a box may be tested more than once.

    Parameters
    ----------
    nodes : how many the structure has in all
    compared : how often a node was compared with a query, or looked up, to learn whether to look into it
    visits, tests : pieces of both, in the order of the search
    """

    nodes: int
    compared: int = 0
    visits: list[Pairs] = field(default_factory=list)
    tests: list[Pairs] = field(default_factory=list)

    @property
    def visited(self) -> Ints:
        """Nodes that meet the query and were looked into: (2, K) int64 [query, node], in the order of the search."""
        return piled(self.visits)

    @property
    def tested(self) -> Ints:
        """Boxes that were compared with the query: (2, K) int64 [query, box], in the order of the search."""
        return piled(self.tests)


class BroadPhase(ABC):
    """Boxes in 2-D or 3-D, and which of them overlap a query: each structure gives the same rows.

    Parameters
    ----------
    boxes : Aabbs, or (N, 4) or (N, 6) float, min of each axis, then max of each; their ids are 0..N-1. Ids count up
        and are never used again.

    Raises
    ------
    InputError
        If a box is not finite, or its min is beyond its max.
    """

    def __init__(self, boxes: object) -> None:
        rows = box_rows("boxes", boxes)
        self.dim = rows.shape[1] // 2
        self._count = len(rows)
        self._rows = rows
        self._here = np.ones(len(rows), np.bool_)
        self.written = 0
        """Entries and nodes that were written so far, to build and to change: what changes cost, without a clock."""

    def __len__(self) -> int:
        return int(np.count_nonzero(self._here[: self._count]))

    @property
    def ids(self) -> Ints:
        """Ids of the boxes that are there, sorted."""
        return np.flatnonzero(self._here[: self._count])

    @property
    def boxes(self) -> Floats:
        """Boxes of `ids`, as a copy."""
        return self._rows[self.ids]

    def query(self, boxes: object) -> Ints:
        """Find the boxes that overlap each of these; touching counts.

        Returns
        -------
        (2, K) int64 [query, id], sorted
        """
        rows = box_rows("boxes", boxes, self.dim)
        return sorted_pairs(*self._find(rows, None), self._count)

    def pairs(self) -> Ints:
        """Find the boxes that overlap each other: (2, K) int64 ids [i, j] with i < j, sorted."""
        ids = self.ids
        query, found = self._find(self._rows[ids], None)
        first = ids[query]
        keep = first < found
        return sorted_pairs(first[keep], found[keep], self._count)

    def work(self, boxes: object) -> Work:
        """Tell what a query of these boxes would look at."""
        work = Work(self._node_count())
        self._find(box_rows("boxes", boxes, self.dim), work)
        return work

    def insert(self, boxes: object) -> Ints:
        """Add boxes; give their ids, (N,) int64."""
        rows = box_rows("boxes", boxes, self.dim)
        ids = np.arange(self._count, self._count + len(rows))
        self._reserve(self._count + len(rows))
        self._rows[ids], self._here[ids] = rows, True
        self._count += len(rows)
        if len(ids):
            self._enter(ids)
        return ids

    def remove(self, ids: object) -> None:
        """Take boxes out, by id."""
        gone = self._living(ids)
        if len(gone):
            self._leave(gone)
            self._here[gone] = False

    def move(self, ids: object, boxes: object) -> None:
        """Give boxes a new place and size; a small move costs little."""
        moved = self._living(ids)
        rows = box_rows("boxes", boxes, self.dim)
        if len(rows) != len(moved):
            raise InputError(f"boxes: expected shape ({len(moved)}, {2 * self.dim}), one for each id, got {rows.shape}")
        if len(moved):
            self._shift(moved, rows)

    @abstractmethod
    def cell_boxes(self) -> Cells:
        """Tell where the nodes are that a query may visit."""

    @abstractmethod
    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""

    @abstractmethod
    def _find(self, queries: Floats, work: Work | None) -> Pairs:
        """Overlapping (query, id), each once, in any order."""

    @abstractmethod
    def _node_count(self) -> int:
        """How many nodes `work` may name."""

    @abstractmethod
    def _enter(self, ids: Ints) -> None:
        """Take in boxes that are new in the table."""

    @abstractmethod
    def _leave(self, ids: Ints) -> None:
        """Forget boxes that are still in the table."""

    @abstractmethod
    def _shift(self, ids: Ints, rows: Floats) -> None:
        """Write new rows into the table, and follow."""

    def _meeting(self, queries: Floats, query: Ints, ids: Ints, work: Work | None) -> Bools:
        """Test candidates against the boxes as they are now."""
        if work is not None:
            work.tests.append((query, ids))
        return meets(queries.take(query, axis=0), self._rows.take(ids, axis=0))

    def _meeting_all(self, queries: Floats, which: Ints, ids: Ints, work: Work | None) -> Pairs:
        """Test every named query against every named box, some millions of pairs at a time."""
        wide = max(1, min(len(ids), CHUNK_PAIRS))
        tall = max(1, CHUNK_PAIRS // wide)
        found: list[Pairs] = []
        for left in range(0, len(ids) if len(which) else 0, wide):
            some = ids[left : left + wide]
            boxes = self._rows.take(some, axis=0)
            for top in range(0, len(which), tall):
                rows = which[top : top + tall]
                if work is not None:
                    work.tests.append((np.repeat(rows, len(some)), np.tile(some, len(rows))))
                q, b = np.nonzero(meets(queries[rows][:, None], boxes))
                found.append((rows[q], some[b]))
        query, box = piled(found)
        return query, box

    def _living(self, ids: object) -> Ints:
        array = integers("ids", ids, (None,), 0, 2**62)
        known = array < self._count
        known[known] = self._here[array[known]]
        if not known.all():
            row = int(np.argmin(known))
            raise InputError(f"ids[{row}]: expected the id of a box that is there, got {array[row]}")
        _, first = np.unique(array, return_index=True)
        if len(first) < len(array):
            row = int(np.setdiff1d(np.arange(len(array)), first)[0])
            raise InputError(f"ids[{row}]: expected each id once, got {array[row]} again")
        return array

    def _reserve(self, n: int) -> None:
        """Make room for n rows, twice as much as before, so that rows that come one by one are not copied each time."""
        if n > len(self._rows):
            more = max(n, 2 * len(self._rows)) - len(self._rows)
            self._rows = np.concatenate((self._rows, np.zeros((more, 2 * self.dim))))
            self._here = np.concatenate((self._here, np.zeros(more, np.bool_)))

    def _check_table(self) -> None:
        rows = self.boxes
        assert np.isfinite(rows).all(), "a box is not finite"
        assert (rows[:, : self.dim] <= rows[:, self.dim :]).all(), "a box has its min beyond its max"


class BruteForce(BroadPhase):
    """Every query against every box: the reference, and the fastest for a few dozen."""

    def cell_boxes(self) -> Cells:
        """Tell where the nodes are that a query may visit: one box about all, or none."""
        rows = self.boxes
        hull = np.concatenate((rows[:, : self.dim].min(axis=0), rows[:, self.dim :].max(axis=0))) if len(rows) else rows
        some = hull.reshape(-1, 2 * self.dim)
        return Cells(np.arange(len(some)), some, np.ones(len(some), np.bool_))

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        self._check_table()

    def _find(self, queries: Floats, work: Work | None) -> Pairs:
        every = np.arange(len(queries))
        if work is not None and len(self):
            work.visits.append((every, np.zeros_like(every)))
        return self._meeting_all(queries, every, self.ids, work)

    def _node_count(self) -> int:
        return min(len(self), 1)

    def _enter(self, ids: Ints) -> None:
        pass

    def _leave(self, ids: Ints) -> None:
        pass

    def _shift(self, ids: Ints, rows: Floats) -> None:
        self._rows[ids] = rows
