"""A quadtree of boxes: cells that split in four, and leaves that list every box that overlaps them.

A box goes left if its min <= the middle, right if its max >= the middle, and both ways if it straddles the middle.
Cells at the border are unbounded, so no box is ever outside. A cell is split if

- it holds more boxes than the capacity,
- it is not yet at the deepest level, and
- at most half of its boxes straddle a middle: those would be copied, not separated.

So the tree depends on the boxes and the root cell, but not on the order of insertion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Floats, InputError, Ints, integer
from ..common.limits import CHUNK_SAMPLES, QUADTREE_CAPACITY, QUADTREE_DEPTH
from ..grid.spans import ragged, sorted_once
from .boxes import LARGEST, BroadPhase, Cells, Pairs, Work, listed, piled, sorted_pairs

Nodes = dict[str, npt.NDArray[Any]]  # rows of nodes, one array per field of FIELDS

FIELDS: dict[str, tuple[type, int]] = {
    "cell": (np.float64, 4),  # as drawn: the root in quarters
    "mid": (np.float64, 2),
    "child": (np.int64, 0),  # first of four, -1 for a leaf
    "depth": (np.int64, 0),  # -1 when the row is free
    "total": (np.int64, 0),  # boxes that reach into it
    "straddle": (np.int64, 0),  # those of them that cross a middle
    "start": (np.int64, 0),  # of a leaf's ids in the pool
    "length": (np.int64, 0),
}
Paths = tuple[Ints, Ints, Bools]
BULK = 64  # the root cell leaves out one box in this many on each side, and is then doubled: outliers do not stretch it


class Quadtree(BroadPhase):
    """A quadtree of boxes in 2-D.

    Parameters
    ----------
    boxes : (N, 4) float
    capacity : most boxes of a leaf before it splits
    depth : deepest level; the root is level 0

    Raises
    ------
    InputError
        For boxes as in `BroadPhase`, boxes in 3-D, a capacity below 1 or a depth below 0.
    """

    def __init__(self, boxes: object, capacity: int = QUADTREE_CAPACITY, depth: int = QUADTREE_DEPTH) -> None:
        super().__init__(boxes)
        if self.dim != 2:
            raise InputError(f"boxes: expected shape (any, 4), got {self._rows.shape}")
        self.capacity = integer("capacity", capacity, 1, 2**31)
        self.depth = integer("depth", depth, 0, 1000)
        self._outside = self._least = 0
        """Number of boxes that extend beyond the root cell, and the least such number since the root was made."""
        self._build()

    @property
    def leaves(self) -> Floats:
        """Cells of the leaves, (L, 4) float; those at the border extend beyond these numbers."""
        return np.asarray(self._nodes["cell"][self._leaf_numbers()])

    def cell_boxes(self) -> Cells:
        """Cells from the root down; those at the border are unbounded."""
        number = np.flatnonzero(self._nodes["depth"] >= 0)
        number = number[np.argsort(self._nodes["depth"][number], kind="stable")]
        cell, root = self._nodes["cell"][number], self._nodes["cell"][0]
        box = np.where(cell == root, (-np.inf, -np.inf, np.inf, np.inf), cell)
        return Cells(number, box, self._nodes["child"][number] < 0)

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        super().check()
        nodes, ids = self._nodes, self.ids
        used = np.flatnonzero(nodes["depth"] >= 0)
        inner = used[nodes["child"][used] >= 0]
        children = (nodes["child"][inner][:, None] + np.arange(4)).ravel()
        assert np.array_equal(np.sort(np.append(children, 0)), used), "a node is not the child of one parent"
        assert (nodes["depth"][children] == np.repeat(nodes["depth"][inner] + 1, 4)).all(), "a depth is wrong"
        assert len(used) + 4 * len(self._free) == len(nodes["depth"]), "a row is neither in use nor free"
        box, node, straddle = self._paths(ids, self._rows[ids])
        reaching, crossing = (np.bincount(part, minlength=len(nodes["depth"])) for part in (node, node[straddle]))
        assert np.array_equal(nodes["total"][used], reaching[used]), "a total is wrong"
        assert np.array_equal(nodes["straddle"][used], crossing[used]), "straddling boxes are miscounted"
        assert np.array_equal(self._overfull(used), nodes["child"][used] >= 0), "a cell should split or merge"
        leaf = nodes["child"][node] < 0
        due = sorted_pairs(node[leaf], box[leaf], self._count)
        listed = sorted_pairs(*self._entries(self._leaf_numbers()), self._count)
        assert np.array_equal(due, listed), "leaves do not list the boxes that reach into them"
        assert self._count_out(self._rows[ids]) == self._outside, "boxes outside are miscounted"

    def _find(self, queries: Floats, work: Work | None) -> list[Pairs]:
        leaves: list[Pairs] = []
        for query, node, _ in self._steps(queries):
            leaf = np.flatnonzero(self._nodes["child"].take(node) < 0)
            leaves.append((query.take(leaf), node.take(leaf)))
            if work is not None:
                work.visits.append((query, node))
                work.compared += 4 * (len(query) - len(leaf))
        query, leaf = piled(leaves)
        return self._in_leaves(queries, query, leaf, work)

    def _in_leaves(self, queries: Floats, query: Ints, leaf: Ints, work: Work | None) -> list[Pairs]:
        """Search leaves; both boxes of a pair may reach several, so repeats are dropped, some at a time."""
        found: list[Pairs] = []
        length = self._nodes["length"].take(leaf)
        filled = np.flatnonzero(length)
        query, leaf, length = query.take(filled), leaf.take(filled), length.take(filled)
        for asked, box in listed(query, self._nodes["start"].take(leaf), length, self._pool):
            first, second = sorted_pairs(*self._meeting(queries, asked, box, work), self._count, once=True)
            found.append((first, second))
        return found

    def _enter(self, ids: Ints) -> None:
        self._outside += self._count_out(self._rows[ids])
        if not self._rebuilt():
            self._change(self._paths(ids[:0], self._rows[:0]), self._paths(ids, self._rows[ids]))

    def _leave(self, ids: Ints) -> None:
        self._outside -= self._count_out(self._rows[ids])
        self._least = min(self._least, self._outside)
        self._change(self._paths(ids, self._rows[ids]), self._paths(ids[:0], self._rows[:0]))

    def _shift(self, ids: Ints, rows: Floats) -> None:
        old = self._rows[ids]
        self._rows[ids] = rows
        self._outside += self._count_out(rows) - self._count_out(old)
        self._least = min(self._least, self._outside)
        if self._rebuilt():
            return
        goes = self._rerouted(old, rows)
        if goes.any():
            self._change(self._paths(ids[goes], old[goes]), self._paths(ids[goes], rows[goes]))

    def _build(self) -> None:
        """Build the tree anew, with a root cell that suits the present boxes."""
        ids = self.ids
        rows = self._rows[ids]
        self._nodes = nodes = _nodes(1)
        nodes["cell"][0] = _root_of(rows)
        nodes["mid"][:] = _middle(nodes["cell"])
        nodes["child"][0] = -1
        self._free = np.empty(0, np.int64)
        self._pool = np.empty(0, np.int64)
        self._used = 0
        self._outside = self._least = self._count_out(rows)
        nodes["total"][0] = len(ids)
        nodes["straddle"][0] = np.count_nonzero(_straddling(_quarters(rows, nodes["mid"])))
        self._settle(np.zeros_like(ids), ids, np.zeros(1, np.int64))

    def _rebuilt(self) -> bool:
        """Build the tree anew if more than a quarter of the boxes have left the root cell or were added outside it.

        Boxes larger than any root cell would extend beyond a new one, too, and do not count.
        """
        if 4 * (self._outside - self._least) <= len(self):
            return False
        self._build()
        return True

    def _count_out(self, rows: Floats) -> int:
        """Number of boxes that extend beyond the root cell."""
        x, y, x_max, y_max = self._nodes["cell"][0].tolist()
        out = (rows[:, 0] < x) | (rows[:, 1] < y) | (rows[:, 2] > x_max) | (rows[:, 3] > y_max)
        return int(np.count_nonzero(out))

    def _overfull(self, node: Ints) -> Bools:
        """Whether each cell must be split."""
        total, depth, straddle = (self._nodes[name][node] for name in ("total", "depth", "straddle"))
        return np.asarray((total > self.capacity) & (depth < self.depth) & (2 * straddle <= total))

    def _reached(self, box: Ints, node: Ints) -> Bools:
        return _quarters(self._rows.take(box, axis=0), self._nodes["mid"].take(node, axis=0))

    def _steps(self, rows: Floats) -> Iterator[tuple[Ints, Ints, Bools]]:
        """Every (box, node, quarters that it reaches) on the way from the root to the leaves, some at a time."""
        every = np.arange(len(rows))
        stack = [(every, np.zeros_like(every))]
        while stack:
            which, node = stack.pop()
            if len(which) > CHUNK_SAMPLES:  # bounds the memory of a wide search
                half = len(which) // 2
                stack += [(which[half:], node[half:]), (which[:half], node[:half])]
                continue
            mid, child = self._nodes["mid"].take(node, axis=0), self._nodes["child"].take(node)
            reached = _quarters(rows.take(which, axis=0), mid)
            yield which, node, reached
            inner = np.flatnonzero(child >= 0)
            row, quarter = np.divmod(np.flatnonzero(reached.take(inner, axis=0)), 4)
            row = inner.take(row)
            if len(row):
                stack.append((which.take(row), child.take(row) + quarter))

    def _paths(self, ids: Ints, rows: Floats) -> Paths:
        """Every (id, node, whether it straddles) on the way from the root to the leaves."""
        steps = [(ids[which], node, _straddling(reached)) for which, node, reached in self._steps(rows)]
        none = (ids[:0], ids[:0], np.zeros(0, np.bool_))
        found, node, straddle = (np.concatenate(parts) for parts in zip(none, *steps, strict=True))
        return found, node, straddle

    def _rerouted(self, old: Floats, rows: Floats) -> Bools:
        """Whether moved boxes take another path, or straddle other middles."""
        goes = np.zeros(len(rows), np.bool_)
        for which, node, before in self._steps(old):
            after = _quarters(rows.take(which, axis=0), self._nodes["mid"].take(node, axis=0))
            goes[which.take(np.flatnonzero(before != after) >> 2)] = True
        return goes

    def _change(self, before: Paths, after: Paths) -> None:
        """Take boxes off their old paths and put them on new ones, then merge and split cells as needed."""
        nodes = self._nodes
        for (_, node, straddle), sign in ((before, -1), (after, 1)):
            np.add.at(nodes["total"], node, sign)
            np.add.at(nodes["straddle"], node[straddle], sign)
        touched = sorted_once(np.concatenate((before[1], after[1])))
        self.written += len(touched)
        leaves = touched[nodes["child"][touched] < 0]
        node, box = self._entries(leaves)
        off, on = (nodes["child"][path[1]] < 0 for path in (before, after))
        keep = ~np.isin(node * self._count + box, before[1][off] * self._count + before[0][off])
        node = np.concatenate((node[keep], after[1][on]))
        box = np.concatenate((box[keep], after[0][on]))
        inner = touched[nodes["child"][touched] >= 0]
        node, box, leaves = self._merge(inner[~self._overfull(inner)], node, box, leaves)
        self._settle(node, box, leaves)

    def _merge(self, tops: Ints, node: Ints, box: Ints, leaves: Ints) -> tuple[Ints, Ints, Ints]:
        """Turn cells into leaves; return the entries and leaves to be written, with those of the cells."""
        nodes = self._nodes
        tops = np.setdiff1d(tops, self._below(tops)[0])  # a cell inside another merged cell needs no merge of its own
        if not len(tops):
            return node, box, leaves
        below, top, firsts = self._below(tops)
        order = np.argsort(below)
        below, top = below[order], top[order]
        left = below[(nodes["child"][below] < 0) & ~np.isin(below, leaves)]
        more_node, more_box = self._entries(left)
        node, box = np.concatenate((node, more_node)), np.concatenate((box, more_box))
        place = np.minimum(np.searchsorted(below, node), len(below) - 1)
        node = np.where(below[place] == node, top[place], node)
        node, box = sorted_pairs(node, box, self._count, once=True)
        nodes["length"][below] = 0
        nodes["depth"][below] = -1
        nodes["child"][tops] = -1
        self._free = np.sort(np.concatenate((self._free, firsts)))
        return node, box, np.union1d(np.setdiff1d(leaves, below), tops)

    def _below(self, tops: Ints) -> tuple[Ints, Ints, Ints]:
        """All nodes below the given ones, the given node above each, and the first of each four siblings."""
        below, owner, firsts = [tops[:0]], [tops[:0]], [tops[:0]]
        node, top = tops, tops
        while len(node):
            inner = self._nodes["child"][node] >= 0
            first, top = self._nodes["child"][node[inner]], np.repeat(top[inner], 4)
            node = (first[:, None] + np.arange(4)).ravel()
            below.append(node)
            owner.append(top)
            firsts.append(first)
        return np.concatenate(below), np.concatenate(owner), np.concatenate(firsts)

    def _settle(self, node: Ints, box: Ints, leaves: Ints) -> None:
        """Write the entries of leaves, and split leaves that hold too many, level by level."""
        done = [(node[:0], box[:0], leaves[:0])]
        while len(leaves):
            splits = leaves[self._overfull(leaves)]
            self._nodes["length"][splits] = 0
            goes = np.isin(node, splits)
            done.append((node[~goes], box[~goes], np.setdiff1d(leaves, splits)))
            if not len(splits):
                break
            self._split(splits)
            node, box = node[goes], box[goes]
            row, quarter = np.divmod(np.flatnonzero(self._reached(box, node)), 4)
            node, box = self._nodes["child"].take(node.take(row)) + quarter, box.take(row)
            leaves = np.sort((self._nodes["child"][splits][:, None] + np.arange(4)).ravel())
            straddle = _straddling(self._reached(box, node))
            place = np.searchsorted(leaves, node)
            self._nodes["total"][leaves] = np.bincount(place, minlength=len(leaves))
            self._nodes["straddle"][leaves] = np.bincount(place[straddle], minlength=len(leaves))
        all_node, all_box, all_leaves = (np.concatenate(parts) for parts in zip(*done, strict=True))
        self._write(all_node, all_box, np.sort(all_leaves))

    def _split(self, splits: Ints) -> None:
        """Give cells four empty children; the length of a free row is 0."""
        short = max(0, len(splits) - len(self._free))
        if short:
            rows = len(self._nodes["depth"])
            short = max(short, rows // 4)
            more = _nodes(4 * short)
            more["depth"][:] = -1
            self._free = np.append(self._free, rows + 4 * np.arange(short))
            self._nodes.update({name: np.concatenate((self._nodes[name], more[name])) for name in FIELDS})
        nodes = self._nodes
        first, self._free = self._free[: len(splits)], self._free[len(splits) :]
        self.written += 4 * len(first)
        nodes["child"][splits] = first
        for quarter in range(4):
            right, down, child = quarter % 2, quarter // 2, first + quarter
            part = nodes["cell"][splits]
            part[:, 0 if right else 2] = nodes["mid"][splits, 0]
            part[:, 1 if down else 3] = nodes["mid"][splits, 1]
            nodes["cell"][child], nodes["mid"][child] = part, _middle(part)
            nodes["child"][child] = -1
            nodes["depth"][child] = nodes["depth"][splits] + 1

    def _write(self, node: Ints, box: Ints, leaves: Ints) -> None:
        """Append the entries of leaves to the pool; compact it when half is unused."""
        node, box = sorted_pairs(node, box, self._count)
        length = np.bincount(np.searchsorted(leaves, node), minlength=len(leaves))
        self._nodes["length"][leaves] = length
        if self._used + len(box) > len(self._pool):
            kept = np.setdiff1d(self._leaf_numbers(), leaves)
            _, old = self._entries(kept)
            self._nodes["start"][kept] = np.cumsum(self._nodes["length"][kept]) - self._nodes["length"][kept]
            self._pool = np.concatenate((old, np.zeros(2 * len(box) + len(old), np.int64)))
            self._used = len(old)
            self.written += len(old)
        self._nodes["start"][leaves] = self._used + np.cumsum(length) - length
        self._pool[self._used : self._used + len(box)] = box
        self._used += len(box)
        self.written += len(box)

    def _entries(self, leaves: Ints) -> Pairs:
        """Entries of leaves, as (leaf, box)."""
        group, place = ragged(self._nodes["length"][leaves])
        return leaves[group], self._pool[self._nodes["start"][leaves][group] + place]

    def _leaf_numbers(self) -> Ints:
        return np.flatnonzero((self._nodes["depth"] >= 0) & (self._nodes["child"] < 0))


def _nodes(n: int) -> Nodes:
    return {name: np.zeros((n, wide) if wide else n, kind) for name, (kind, wide) in FIELDS.items()}


def _quarters(rows: Floats, mid: Floats) -> Bools:
    """Whether boxes overlap each quarter: (N, 4), by x, then y."""
    left, up = rows[:, 0] <= mid[:, 0], rows[:, 1] <= mid[:, 1]
    right, down = rows[:, 2] >= mid[:, 0], rows[:, 3] >= mid[:, 1]
    reached = np.empty((len(rows), 4), np.bool_)
    for quarter, (x, y) in enumerate(((left, up), (right, up), (left, down), (right, down))):
        np.logical_and(x, y, out=reached[:, quarter])
    return reached


def _straddling(reached: Bools) -> Bools:
    """Whether more than one quarter is reached; the four booleans are read as one 32-bit number."""
    number = reached.view(np.uint32)[:, 0]
    return np.asarray(number & (number - 1) != 0)


def _middle(cell: Floats) -> Floats:
    """Middle of cells; coordinates are halved before they are added, or the sum could overflow."""
    return np.asarray(cell[:, :2] / 2 + cell[:, 2:] / 2)


def _root_of(rows: Floats) -> Floats:
    """Find a square around the bulk of the boxes."""
    n = len(rows)
    if not n:
        return np.zeros(4)
    low, high = rows[:, :2].min(axis=0), rows[:, 2:].max(axis=0)
    first, last = n // BULK, n - 1 - n // BULK
    bulk = np.partition(rows[:, :2] / 2 + rows[:, 2:] / 2, (first, last), axis=0)
    half = bulk[last] / 2 - bulk[first] / 2
    if half.max() > 0:
        with np.errstate(over="ignore"):
            low, high = np.maximum(low, bulk[first] - half), np.minimum(high, bulk[last] + half)
    centre, half = low / 2 + high / 2, (high / 2 - low / 2).max()
    with np.errstate(over="ignore"):
        return np.asarray(np.clip(np.concatenate((centre - half, centre + half)), -LARGEST, LARGEST))
