"""Bounding volume hierarchies of boxes in 2-D and 3-D, and one of objects made of parts.

A tree is built from the top: each group is halved at its median along its widest axis, all groups of a level at once.
Halves differ by at most one box, so the tree needs no pointers: node k of a level has the children 4k..4k+3. Boxes
inserted later get a tree of their own, which absorbs earlier trees that are not much larger.
"""

from __future__ import annotations

import numpy as np

from ..common.checks import Bools, Floats, InputError, Ints, integers, real
from ..common.limits import BVH_LEAF, BVH_SMALL, CHUNK_SAMPLES
from ..grid.spans import begins, meets, ragged, sorted_once
from .boxes import LARGEST, BroadPhase, Cells, Pairs, Work, box_rows, listed, sorted_pairs


class Tree:
    """A tree of one or more boxes, rows (N, 2d); it stores outer boxes, which leave the boxes room to move.

    A leaf may grow by a length, the slack, before it counts as worn.
    """

    def __init__(self, ids: Ints, rows: Floats, slack: float) -> None:
        bits = 0
        while len(ids) > BVH_LEAF << bits:
            bits += 1
        order = _halved(rows, bits)
        self.ids = ids[order]
        """Ids by place; -1 for a removed box."""
        self.outer = rows[order]
        self.gone = 0
        self.starts = len(ids) * np.arange(2**bits + 1) >> bits
        self.levels = [_hulls(self.outer, self.starts[:-1])]
        while len(self.levels[0]) > 2:
            self.levels.insert(0, _hulls(self.levels[0], np.arange(0, len(self.levels[0]), 4)))
        self._slack = slack
        self._new = _girths(self.levels[-1])
        self._worn = np.zeros(len(self._new), np.bool_)

    @property
    def living(self) -> Ints:
        """Ids that are not removed."""
        return self.ids[self.ids >= 0]

    @property
    def worn(self) -> bool:
        """Whether a quarter of the leaves have doubled in size, or half of the boxes are removed."""
        return bool(4 * np.count_nonzero(self._worn) > len(self._worn) or 2 * self.gone >= len(self.ids))

    def refit(self, places: Ints) -> int:
        """Update the nodes above changed outer boxes; return the number of rows read and written."""
        leaf = sorted_once(np.searchsorted(self.starts, places, side="right") - 1)
        group, place = ragged(self.starts[leaf + 1] - self.starts[leaf])
        first = np.flatnonzero(begins(group))
        hulls = _hulls(self.outer[self.starts[leaf][group] + place], first)
        self.levels[-1][leaf] = hulls
        written = len(group) + len(leaf)
        self._worn[leaf] = _girths(hulls) / 2 - self._slack > self._new[leaf]
        for upper, lower in zip(self.levels[-2::-1], self.levels[:0:-1], strict=True):
            leaf = sorted_once(leaf >> 2)
            children = lower[(leaf[:, None] << 2) + np.arange(4)]
            upper[leaf] = _hulls(children.reshape(-1, children.shape[-1]), np.arange(0, 4 * len(leaf), 4))
            written += len(leaf)
        return written

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        assert np.array_equal(self.levels[-1], _hulls(self.outer, self.starts[:-1])), "a leaf is not its boxes' hull"
        for upper, lower in zip(self.levels, self.levels[1:], strict=False):
            due = _hulls(lower, np.arange(0, len(lower), 4))
            assert np.array_equal(upper, due), "a node is not its children's hull"
        assert self.gone == np.count_nonzero(self.ids < 0), "boxes that have gone are miscounted"


class Bvh(BroadPhase):
    """A bounding volume hierarchy, for worlds of any shape and boxes of very different sizes.

    Parameters
    ----------
    boxes : (N, 4) or (N, 6) float
    slack : distance that a moved box may move further, on each side, before the tree is updated; by default a quarter
        of the median of the boxes' longest sides, measured again whenever most of them get a new tree

    Raises
    ------
    InputError
        For boxes as in `BroadPhase`, or a slack below 0.
    """

    def __init__(self, boxes: object, slack: float | None = None) -> None:
        super().__init__(boxes)
        self._measures = slack is None
        self.slack = 0.0 if slack is None else real("slack", slack, 0, LARGEST)
        self._trees: list[Tree] = []
        if self._count:
            self._enter(self.ids)

    def cell_boxes(self) -> Cells:
        """Nodes, tree by tree, each tree from the root down."""
        levels = [(level, level is tree.levels[-1]) for tree in self._trees for level in tree.levels]
        box = np.concatenate([np.empty((0, 2 * self.dim)), *(level for level, _ in levels)])
        leaf = np.repeat([last for _, last in levels], [len(level) for level, _ in levels]).astype(np.bool_)
        return Cells(np.arange(len(box)), box, leaf)

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        super().check()
        for number, tree in enumerate(self._trees):
            tree.check()
            living = tree.living
            assert (self._home[living] == number).all(), "a box does not know its tree"
            assert np.array_equal(tree.ids[self._place[living]], living), "a box does not know its place"
            inner, outer = self._rows[living], tree.outer[self._place[living]]
            assert _holds(outer, inner).all(), "a box is beyond its outer box"
            assert not (tree.outer[tree.ids < 0, 0] < np.inf).any(), "a box that has gone takes up room"
            assert not tree.worn, "a worn tree was left as it was"
        listed = np.concatenate([np.empty(0, np.int64), *(tree.living for tree in self._trees)])
        assert np.array_equal(np.sort(listed), self.ids), "trees do not list each box once"

    def _find(self, queries: Floats, work: Work | None) -> list[Pairs]:
        """Descend with all queries at once; a large front is halved, which bounds the memory."""
        found: list[Pairs] = []
        stack: list[tuple[Tree, int, Ints, Ints]] = []
        for tree in self._trees:
            query, node = np.divmod(np.arange(len(queries) * len(tree.levels[0])), len(tree.levels[0]))
            stack.append((tree, 0, query, node))
        while stack:
            tree, level, query, node = stack.pop()
            if len(query) > CHUNK_SAMPLES:
                half = len(query) // 2
                stack += [(tree, level, query[half:], node[half:]), (tree, level, query[:half], node[:half])]
                continue
            good = np.flatnonzero(meets(tree.levels[level].take(node, axis=0), queries.take(query, axis=0)))
            if work is not None:
                work.compared += len(query)
                work.visits.append((query.take(good), self._number_of(tree, level) + node.take(good)))
            query, node = query.take(good), node.take(good)
            if not len(query):
                continue
            if level + 1 < len(tree.levels):
                stack.append((tree, level + 1, np.repeat(query, 4), ((node[:, None] << 2) + np.arange(4)).ravel()))
            else:
                found += self._in_leaves(tree, queries, query, node, work)
        return found

    def _number_of(self, tree: Tree, level: int) -> int:
        """Number of the first node of a level of a tree."""
        before = self._trees[: self._trees.index(tree)]
        return sum(len(nodes) for each in before for nodes in each.levels) + sum(map(len, tree.levels[:level]))

    def _in_leaves(self, tree: Tree, queries: Floats, query: Ints, leaf: Ints, work: Work | None) -> list[Pairs]:
        start, there = tree.starts[leaf], (lambda box: box >= 0) if tree.gone else None
        pairs = listed(query, start, tree.starts[leaf + 1] - start, tree.ids, there)
        return [self._meeting(queries, asked, box, work) for asked, box in pairs]

    def _enter(self, ids: Ints) -> None:
        while self._trees and len(self._trees[-1].living) <= max(2 * len(ids), BVH_SMALL):
            ids = np.concatenate((self._trees.pop().living, ids))
        self._plant(len(self._trees), ids)

    def _leave(self, ids: Ints) -> None:
        nowhere = np.repeat((np.inf, -np.inf), self.dim)
        for number in np.unique(self._home[ids]).tolist():
            tree = self._trees[number]
            places = self._place[ids[self._home[ids] == number]]
            tree.ids[places] = -1
            tree.gone += len(places)
            tree.outer[places] = nowhere
            self._follow(number, places)
        kept = [tree for tree in self._trees if len(tree.living)]
        if len(kept) < len(self._trees):
            self._trees = kept
            for number, tree in enumerate(kept):
                self._home[tree.living] = number

    def _shift(self, ids: Ints, rows: Floats) -> None:
        self._rows[ids] = rows
        for number in np.unique(self._home[ids]).tolist():
            tree = self._trees[number]
            mine = self._home[ids] == number
            places, wanted = self._place[ids[mine]], rows[mine]
            out = ~_holds(tree.outer[places], wanted)
            if out.any():
                tree.outer[places[out]] = self._roomy(wanted[out])
                self._follow(number, places[out])

    def _roomy(self, rows: Floats) -> Floats:
        with np.errstate(over="ignore"):
            low, high = rows[:, : self.dim] - self.slack, rows[:, self.dim :] + self.slack
        return np.clip(np.concatenate((low, high), axis=1), -LARGEST, LARGEST)

    def _follow(self, number: int, places: Ints) -> None:
        """Refit a changed tree, or rebuild it if it is worn."""
        tree = self._trees[number]
        self.written += tree.refit(places)
        if tree.worn and len(tree.living):
            self._plant(number, np.sort(tree.living))

    def _plant(self, number: int, ids: Ints) -> None:
        rows = self._rows[ids]
        if self._measures and 4 * len(ids) >= 3 * len(self):
            quarters = (rows[:, self.dim :] / 4 - rows[:, : self.dim] / 4).max(axis=1)
            self.slack = float(np.partition(quarters, len(ids) // 2)[len(ids) // 2])
        tree = Tree(ids, rows, self.slack)
        self._trees[number : number + 1] = [tree]
        self.written += len(ids) + sum(map(len, tree.levels))
        self._home[tree.ids] = number
        self._place[tree.ids] = np.arange(len(tree.ids))


class PartsBvh:
    """A two-level hierarchy of objects made of parts: a tree of the objects' bounds, and lists of their parts.

    An object overlaps if any of its parts does. All parts of an object are tested, so this suits objects of some dozens
    of parts; for a mesh use `Bvh` over its triangles.

    Parameters
    ----------
    boxes : (P, 4) or (P, 6) float, the parts, object by object
    starts : (N + 1,) int, object k has the parts starts[k] to starts[k + 1] - 1, at least one

    Raises
    ------
    InputError
        For boxes as in `BroadPhase`, or starts that do not ascend from 0 to the number of parts.
    """

    def __init__(self, boxes: object, starts: object) -> None:
        self._parts, self._starts = _checked_parts(boxes, starts, None)
        self._bounds = Bvh(_hulls(self._parts, self._starts[:-1]))

    def __len__(self) -> int:
        return len(self._bounds)

    def query(self, boxes: object) -> Ints:
        """Find the objects that overlap each of these boxes: (2, K) int64 [query, object], sorted."""
        query, owner, _ = self.query_parts(boxes)
        return sorted_pairs(query, owner, len(self._starts), once=True)

    def query_parts(self, boxes: object) -> Ints:
        """Find the parts that overlap each of these boxes: (3, K) int64 [query, object, part of it], sorted."""
        rows = box_rows("boxes", boxes, self._bounds.dim)
        query, owner = self._bounds.query(rows)
        group, part, row = self._parts_of(owner)
        query, owner = query.take(group), owner.take(group)
        good = np.flatnonzero(meets(rows.take(query, axis=0), self._parts.take(row, axis=0)))
        return np.stack((query, owner, part)).take(good, axis=1)

    def pairs(self) -> Ints:
        """Find the objects that overlap each other: (2, K) int64 [i, j] with i < j, sorted."""
        first, second = self._bounds.pairs()
        group, _, left = self._parts_of(first)
        again, _, right = self._parts_of(second[group])
        met = meets(self._parts.take(left.take(again), axis=0), self._parts.take(right, axis=0))
        good = group[again[met]]
        return sorted_pairs(first[good], second[good], len(self._starts), once=True)

    def _parts_of(self, objects: Ints) -> tuple[Ints, Ints, Ints]:
        """All parts of objects: (place of the object, number of the part, row)."""
        group, part = ragged(self._starts[objects + 1] - self._starts[objects])
        return group, part, self._starts[objects].take(group) + part

    def insert(self, boxes: object, starts: object) -> Ints:
        """Add objects and return their ids, (N,) int64."""
        parts, begins = _checked_parts(boxes, starts, self._bounds.dim)
        self._starts = np.concatenate((self._starts, len(self._parts) + begins[1:]))
        self._parts = np.concatenate((self._parts, parts))
        return self._bounds.insert(_hulls(parts, begins[:-1]))

    def remove(self, ids: object) -> None:
        """Take objects out: `ids` is one id or several (N,)."""
        self._bounds.remove(ids)

    def move(self, ids: object, boxes: object) -> None:
        """Give all parts of the objects `ids` (N,) new boxes: as many rows as they have parts, object by object."""
        moved = self._bounds._living(ids)
        group, _, row = self._parts_of(moved)
        begins = np.searchsorted(group, np.arange(len(moved) + 1))
        parts, _ = _checked_parts(boxes, begins, self._bounds.dim)
        self._parts[row] = parts
        self._bounds.move(moved, _hulls(parts, begins[:-1]))

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        self._bounds.check()
        assert self._starts[-1] == len(self._parts), "there are parts of no object"
        ids = self._bounds.ids
        hulls = _hulls(self._parts, self._starts[:-1])
        assert np.array_equal(self._bounds.boxes, hulls[ids]), "an object's bounds are not its parts' hull"


def _checked_parts(boxes: object, starts: object, dim: int | None) -> tuple[Floats, Ints]:
    rows = box_rows("boxes", boxes, dim)
    begins = integers("starts", starts, (None,), 0, 2**62)
    if not len(begins) or begins[0] != 0 or begins[-1] != len(rows):
        raise InputError(f"starts: expected whole numbers from 0 to {len(rows)}, got {begins}")
    bad = np.flatnonzero(np.diff(begins) < 1)
    if len(bad):
        row = int(bad[0]) + 1
        raise InputError(f"starts[{row}]: expected more than {begins[row - 1]}, got {begins[row]}")
    return rows, begins


def _halved(rows: Floats, bits: int) -> Ints:
    """Order boxes so that each of 2**bits runs of about equal length is a compact group."""
    n, dim = len(rows), rows.shape[1] // 2
    centre = rows[:, :dim] / 2 + rows[:, dim:] / 2
    ranked = [np.argsort(centre[:, axis], kind="stable") for axis in range(dim)]
    rank = np.empty((dim, n), np.int64)
    for axis in range(dim):
        rank[axis, ranked[axis]] = np.arange(n)
    by_rank = np.concatenate(ranked)
    rank_of = rank.ravel()
    order = np.arange(n)
    for level in range(bits):
        edges = n * np.arange(2**level + 1) >> level
        group = np.repeat(np.arange(2**level), np.diff(edges))
        hull = _hulls(np.tile(centre[order], 2), edges[:-1])
        with np.errstate(over="ignore"):
            axis_of = np.argmax(hull[:, dim:] - hull[:, :dim], axis=1)[group]
        key = np.sort(group * n + rank_of[axis_of * n + order])
        order = by_rank[(axis_of - group) * n + key]
    return order


def _hulls(rows: Floats, first: Ints) -> Floats:
    """Smallest boxes around runs of boxes; each run ends before the first row of the next."""
    dim = rows.shape[1] // 2
    if not len(first):
        return rows[:0]
    low, high = np.minimum.reduceat(rows[:, :dim], first), np.maximum.reduceat(rows[:, dim:], first)
    return np.concatenate((low, high), axis=1)


def _holds(outer: Floats, inner: Floats) -> Bools:
    dim = outer.shape[1] // 2
    good = outer[:, 0] <= inner[:, 0]
    for axis in range(1, dim):
        good &= outer[:, axis] <= inner[:, axis]
    for axis in range(dim, 2 * dim):
        good &= inner[:, axis] <= outer[:, axis]
    return good


def _girths(rows: Floats) -> Floats:
    """Sums of the sides of boxes; -inf for an empty box."""
    dim = rows.shape[1] // 2
    with np.errstate(over="ignore"):
        return np.asarray((rows[:, dim:] - rows[:, :dim]).sum(axis=1))
