"""A uniform grid of squares or cubes: each cell lists the boxes that overlap it.

Cell k of an axis is origin + cell * [k, k + 1). Rounding may move a border, but by the same amount for boxes and
queries, and never past another border. So two boxes that share a point share a cell, at any size of the coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..common.checks import Floats, InputError, Ints, integer, integers, real
from ..common.limits import CHUNK_SAMPLES, GRID_FRESH, OVERSIZED_CELLS
from ..grid.spans import begins, pieces, ragged
from .boxes import LARGEST, BroadPhase, Cells, Pairs, Work, listed, sorted_pairs

NOWHERE, BESIDE, MAIN, FRESH = range(4)
"""Where a box is listed: not at all, in the list of oversized boxes, in the sorted cells, in the fresh entries."""

KEY_BITS = {2: 31, 3: 21}  # bits of a key for the cell on each axis, by dimension; cells beyond share the last number

SMALLEST = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, eq=False)
class Listing:
    """Boxes by cell: entry[start[k] : start[k + 1]] are those that overlap the cell of key[k]; keys ascend."""

    key: Ints
    start: Ints
    entry: Ints

    @classmethod
    def of(cls, key: Ints, entry: Ints) -> Listing:
        """Sort entries by cell."""
        order = np.argsort(key, kind="stable")
        key = key[order]
        start = np.flatnonzero(begins(key))
        return cls(key[start], np.append(start, len(key)), entry[order])

    def entries(self) -> Pairs:
        """All entries as (key, entry)."""
        return np.repeat(self.key, np.diff(self.start)), self.entry

    def runs(self, key: Ints) -> Pairs:
        """Find the entries of cells, as (start, length)."""
        if not len(self.key):
            return np.zeros_like(key), np.zeros_like(key)
        place = np.minimum(np.searchsorted(self.key, key), len(self.key) - 1)
        length = np.where(self.key[place] == key, self.start[place + 1] - self.start[place], 0)
        return self.start[place], length


class Grid(BroadPhase):
    """A uniform grid, for worlds where most boxes are of about one size.

    Parameters
    ----------
    boxes : (N, 4) or (N, 6) float
    cell : side of a cell; by default the median of the boxes' longest sides. It is measured again, and the grid is
        rebuilt, when at least three of four boxes are new or have left their cells

    Raises
    ------
    InputError
        For boxes as in `BroadPhase`, or a side that is not positive.
    """

    def __init__(self, boxes: object, cell: float | None = None) -> None:
        super().__init__(boxes)
        self._measures = cell is None
        self.cell = 1.0 if cell is None else real("cell", cell, SMALLEST, LARGEST)
        self.origin = _middle(self._rows[:, : self.dim])
        self._bits = KEY_BITS[self.dim]
        self._reach = 2 ** (self._bits - 1) - 1
        self._kept = 0
        self._clear()
        self._enter(self.ids)

    def _clear(self) -> None:
        """Forget all cells."""
        self._home[:] = NOWHERE
        self._place = np.zeros((len(self._rows), 2, self.dim), np.int64)
        self._listings = [Listing.of(np.empty(0, np.int64), np.empty(0, np.int64))] * 2
        self._beside = np.empty(0, np.int64)
        self._stale = 0

    def _measured(self, ids: Ints) -> Ints:
        """Measure the cell again if few boxes are unchanged; return the boxes to enter, which are then all."""
        self._kept = min(self._kept, len(self) - len(ids))
        if not self._measures or 4 * self._kept > len(self):
            return ids
        rows = self.boxes
        self.cell, self.origin, self._kept = _side_of(rows), _middle(rows[:, : self.dim]), len(rows)
        self._clear()
        return self.ids

    def owners(self, cell: object) -> Ints:
        """Sorted ids of the boxes that overlap a cell, (d,) whole numbers."""
        at = integers("cell", cell, (self.dim,), -self._reach, self._reach)
        first, last = self._place[self._beside].swapaxes(0, 1)
        found = [self._beside[((first <= at) & (at <= last)).all(axis=1)]]
        for home, listing in zip((MAIN, FRESH), self._listings, strict=True):
            start, length = (int(v[0]) for v in listing.runs(self._keys(at[None])))
            listed = listing.entry[start : start + length]
            found.append(listed[self._home[listed] == home])
        return np.sort(np.concatenate(found))

    def cells(self, box: int) -> Ints:
        """Sorted cells (K, d) that a box overlaps.

        Raises
        ------
        InputError
            If there is no such box, or it is oversized and kept beside the cells.
        """
        ids = self._living([integer("box", box, 0, 2**62)])
        if self._home[ids[0]] == BESIDE:
            raise InputError(f"box: expected one over at most {OVERSIZED_CELLS} cells, got {box}, which is over more")
        _, at = _written_out(self._place[ids])
        return at[np.lexsort(at.T[::-1])]

    def cell_boxes(self) -> Cells:
        """Cells that list boxes; a cell with both settled and fresh entries has two numbers."""
        key = np.concatenate([listing.key for listing in self._listings])
        at = np.stack([key >> self._bits * axis for axis in reversed(range(self.dim))], axis=1) & 2**self._bits - 1
        with np.errstate(over="ignore"):
            low = self.origin + self.cell * (at - self._reach)
            box = np.clip(np.concatenate((low, low + self.cell), axis=1), -LARGEST, LARGEST)
        main = self._listings[0]
        living = np.append(0, np.cumsum(self._home[main.entry] == MAIN))[main.start]
        box[np.flatnonzero(np.diff(living) == 0)] = np.repeat((np.inf, -np.inf), self.dim)
        return Cells(np.arange(len(key)), box, np.ones(len(key), np.bool_))

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        super().check()
        ids = self.ids
        assert (self._place[ids] == self._span(self._rows[ids])).all(), "a box is listed where it was"
        large = _sizes(self._place[ids]) > OVERSIZED_CELLS
        assert np.array_equal(np.sort(self._beside), ids[large]), "the list beside the grid is not the large boxes"
        homes = self._home[ids]
        assert ((homes == BESIDE) == large).all(), "a large box has a home in the grid"
        assert (homes != NOWHERE).all(), "a box has no home"
        kept = []
        for home, listing in zip((MAIN, FRESH), self._listings, strict=True):
            assert (np.diff(listing.key) > 0).all(), "cells are not in order"
            key, entry = listing.entries()
            good = self._home[entry] == home
            assert home == MAIN or good.all(), "a box that has gone is listed among the fresh ones"
            assert home == FRESH or self._stale == np.count_nonzero(~good), "stale entries are miscounted"
            kept.append(np.stack((key[good], entry[good])))
        listed = np.concatenate(kept, axis=1)
        due = np.stack(self._listed(ids[~large]))
        assert np.array_equal(_in_order(listed), _in_order(due)), "cells do not list the boxes that reach into them"

    def _find(self, queries: Floats, work: Work | None) -> list[Pairs]:
        span = self._span(queries)
        sizes = _sizes(span)
        wide = sizes > max(OVERSIZED_CELLS, len(self._listings[0].entry) // 8)
        found = self._meeting_all(queries, np.flatnonzero(wide), self.ids, work) if wide.any() else []
        narrow = np.flatnonzero(~wide)
        found += self._meeting_all(queries, narrow, self._beside, work)
        for piece in pieces(sizes[narrow].astype(np.int64), CHUNK_SAMPLES):
            rows = narrow[piece]
            group, at = _written_out(span[rows])
            for home in (MAIN, FRESH):
                found += self._in_cells(queries, rows.take(group), at, home, work)
        return found

    def _in_cells(self, queries: Floats, query: Ints, at: Ints, home: int, work: Work | None) -> list[Pairs]:
        """Search cells; both boxes of a pair may share several, so repeats are dropped before they are tested."""
        listing = self._listings[home - MAIN]
        start, length = listing.runs(self._keys(at))
        if work is not None and len(listing.key):
            work.compared += len(at)
        filled = np.flatnonzero(length)
        if not len(filled):
            return []
        query, start, length = (part.take(filled) for part in (query, start, length))
        if work is not None:
            before = len(self._listings[0].key) if home == FRESH else 0
            work.visits.append((query, before + np.searchsorted(listing.start, start)))
        there = (lambda box: self._home.take(box) == MAIN) if home == MAIN and self._stale else None
        pairs = listed(query, start, length, listing.entry, there)
        once = (sorted_pairs(asked, box, self._count, once=True) for asked, box in pairs)
        return [self._meeting(queries, asked, box, work) for asked, box in once]

    def _enter(self, ids: Ints) -> None:
        ids = self._measured(ids)
        self._place[ids] = self._span(self._rows[ids])
        large = _sizes(self._place[ids]) > OVERSIZED_CELLS
        self._home[ids] = np.where(large, BESIDE, FRESH)
        self._beside = np.concatenate((self._beside, ids[large]))
        both = zip(self._listings[1].entries(), self._listed(ids[~large]), strict=True)
        self._list(*(np.concatenate(parts) for parts in both))

    def _listed(self, ids: Ints) -> Pairs:
        """Cells of boxes that are not oversized, as (key, entry)."""
        group, at = _written_out(self._place[ids])
        return self._keys(at), ids[group]

    def _leave(self, ids: Ints) -> None:
        homes = self._home[ids]
        self._stale += int(_sizes(self._place[ids])[homes == MAIN].sum())
        self._home[ids] = NOWHERE
        if (homes == BESIDE).any():
            self._beside = self._beside[self._home[self._beside] == BESIDE]
        key, entry = self._listings[1].entries()
        keep = self._home[entry] == FRESH
        self._list(key[keep], entry[keep])

    def _shift(self, ids: Ints, rows: Floats) -> None:
        goes = (self._span(rows) != self._place[ids]).any(axis=(1, 2))
        if goes.any():
            self._leave(ids[goes])
        self._rows[ids] = rows
        if goes.any():
            self._enter(ids[goes])

    def _list(self, key: Ints, entry: Ints) -> None:
        """Sort the fresh entries; if these or the stale ones are many, sort all, and drop the stale ones."""
        settled = len(self._listings[0].entry)
        if settled and len(key) <= max(GRID_FRESH, settled // 16) and 2 * self._stale <= settled:
            self._listings[1] = Listing.of(key, entry)
            self.written += len(key)
            return
        old_key, old_entry = self._listings[0].entries()
        keep = self._home[old_entry] == MAIN
        self._home[entry] = MAIN
        main = Listing.of(np.concatenate((old_key[keep], key)), np.concatenate((old_entry[keep], entry)))
        self._listings = [main, Listing.of(key[:0], entry[:0])]
        self.written += len(main.entry)
        self._stale = 0

    def _span(self, rows: Floats) -> Ints:
        """First and last cell of boxes on each axis, (N, 2, d)."""
        with np.errstate(over="ignore"):
            at = np.floor((rows.reshape(-1, 2, self.dim) - self.origin) / self.cell)
        return np.clip(at, -self._reach, self._reach).astype(np.int64)

    def _keys(self, at: Ints) -> Ints:
        """Keys of cells (N, d), one whole number each."""
        key: Ints = at[:, 0] + self._reach
        for axis in range(1, self.dim):
            key = (key << self._bits) | (at[:, axis] + self._reach)
        return key


def _sizes(span: Ints) -> Floats:
    """Number of cells of boxes; floats, because it may exceed 2**63."""
    return np.asarray(np.prod(span[:, 1].astype(np.float64) - span[:, 0] + 1, axis=1))


def _written_out(span: Ints) -> Pairs:
    """List every cell of a few boxes, as (box number, cell (K, d))."""
    low, sides = span[:, 0], span[:, 1] - span[:, 0] + 1
    group, place = ragged(np.prod(sides, axis=1))
    at = np.empty((len(group), low.shape[1]), np.int64)
    for axis in reversed(range(low.shape[1])):
        place, step = np.divmod(place, sides[group, axis])
        at[:, axis] = low[group, axis] + step
    return group, at


def _in_order(entries: Ints) -> Ints:
    return entries[:, np.lexsort(entries)]


def _middle(values: Floats) -> Floats:
    """Median of each column, always one of its values: a mean of two could overflow."""
    if not len(values):
        return np.zeros(values.shape[1])
    return np.asarray(np.partition(values, len(values) // 2, axis=0)[len(values) // 2])


def _side_of(rows: Floats) -> float:
    """Median of the longest sides; for boxes that are points, the spacing of their middle half."""
    dim = rows.shape[1] // 2
    with np.errstate(over="ignore"):
        longest = np.minimum((rows[:, dim:] - rows[:, :dim]).max(axis=1, initial=0), LARGEST)
    longest = longest[longest > 0]
    if not len(longest) and len(rows):
        n = len(rows)
        part = np.partition(rows[:, :dim], (n // 4, 3 * n // 4), axis=0)
        with np.errstate(over="ignore"):
            longest = (part[3 * n // 4] - part[n // 4]).max(keepdims=True) / max(1, n / 2) ** (1 / dim)
    side = float(_middle(longest[:, None])[0]) if len(longest) else 1.0
    return min(max(side, SMALLEST), LARGEST) if side > 0 else 1.0
