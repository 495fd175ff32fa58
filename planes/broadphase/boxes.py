"""The contract of every broad phase, the brute-force one, and the index of a scene's items.

A box is a row (min of each axis, max of each axis). Two boxes overlap if their closed intervals do on every axis. Boxes
have ids, and can be inserted, moved and removed.

Searches read rows by `take` and `flatnonzero`: indexing by brackets takes up to ten times as long.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..common.checks import Bools, Floats, InputError, Ints, array_of, choice, integers, reals, shown
from ..common.limits import CHUNK_PAIRS, CHUNK_SAMPLES, INDEX_SLACK, STRUCTURES
from ..grid.spans import meets, pieces, ragged, sorted_once
from ..scene.derived import Derivative
from ..scene.items import Items
from ..volumes.volumes import Aabbs, Volumes

Pairs = tuple[Ints, Ints]
AXES = "xyz"
LARGEST = float(np.finfo(np.float64).max)


def box_rows(field: str, values: object, dim: int | None = None) -> Floats:
    """Check boxes, Aabbs or finite rows (N, 4) or (N, 6) with min <= max on every axis, and return a copy as rows.

    An InputError names the row of the first bad box.
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


def sorted_pairs(first: Ints, second: Ints, n: int, once: bool = False) -> Ints:
    """Pairs as (2, K), sorted by (first, second), and without repeats if `once`; every second is below n."""
    key = first * n + second
    return np.stack(np.divmod(sorted_once(key) if once else np.sort(key), max(n, 1)))


def piled(found: Sequence[Pairs]) -> Ints:
    """Join lists of pairs: (2, K) int64."""
    return np.concatenate([np.empty((2, 0), np.int64), *(np.stack(piece) for piece in found)], axis=1)


def listed(
    query: Ints, start: Ints, length: Ints, entry: Ints, there: Callable[[Ints], Bools] | None = None
) -> Iterator[Pairs]:
    """Every (query, box) of runs (n,) of a list of boxes, some at a time; of all boxes, or of those that are there."""
    for piece in pieces(length, CHUNK_SAMPLES):
        group, place = ragged(length[piece])
        asked, box = query[piece].take(group), entry.take(start[piece].take(group) + place)
        if there is not None:
            kept = np.flatnonzero(there(box))
            asked, box = asked.take(kept), box.take(kept)
        yield asked, box


class Cells(NamedTuple):
    """Nodes of a structure, for drawing: grid cells, quadtree cells, or boxes of a tree; parents before children.

    Parameters
    ----------
    number : (C,) int64, the node numbers of `Work.visited`
    box : (C, 2d) float64, in the units of the boxes; infinite if the cell is unbounded, min > max if the node is empty
    leaf : (C,) bool, whether the node lists boxes itself
    """

    number: Ints
    box: Floats
    leaf: Bools


@dataclass
class Work:
    """The nodes and boxes that a query visited and tested; a box may be tested more than once.

    Parameters
    ----------
    nodes : number of nodes of the structure
    compared : number of comparisons of a node with a query, and of look-ups of nodes
    visits, tests : lists of (query, node) and (query, box), in the order of the search
    """

    nodes: int
    compared: int = 0
    visits: list[Pairs] = field(default_factory=list)
    tests: list[Pairs] = field(default_factory=list)

    @property
    def visited(self) -> Ints:
        """Nodes that overlap the query and were searched: (2, K) int64 [query, node], in the order of the search."""
        return piled(self.visits)

    @property
    def tested(self) -> Ints:
        """Boxes that were compared with the query: (2, K) int64 [query, box], in the order of the search."""
        return piled(self.tests)


class BroadPhase(ABC):
    """A set of boxes in 2-D or 3-D that finds those that overlap a query; all structures return the same rows.

    Parameters
    ----------
    boxes : Aabbs, or (N, 4) or (N, 6) float, min of each axis, then max of each; their ids are 0..N-1. Ids count up
        and are never used again.

    Raises
    ------
    InputError
        If a box is not finite, or has min > max.
    """

    def __init__(self, boxes: object) -> None:
        rows = box_rows("boxes", boxes)
        self.dim = rows.shape[1] // 2
        self._count = len(rows)
        self._rows = rows
        self._here = np.ones(len(rows), np.bool_)
        self._home, self._place = np.zeros((2, len(rows)), np.int64)  # where a structure lists each box, if it needs to
        self.written = 0
        """Entries and nodes written so far to build and change the structure, a measure of cost without a clock."""

    def __len__(self) -> int:
        return int(np.count_nonzero(self._here[: self._count]))

    @property
    def ids(self) -> Ints:
        """Ids of the boxes, sorted."""
        return np.flatnonzero(self._here[: self._count])

    @property
    def boxes(self) -> Floats:
        """A copy of the boxes, in the order of `ids`."""
        return self._rows[self.ids]

    def query(self, boxes: object) -> Ints:
        """Find the boxes that overlap or touch each query box.

        Returns
        -------
        (2, K) int64 [query, id], sorted
        """
        rows = box_rows("boxes", boxes, self.dim)
        query, found = piled(self._find(rows, None))
        return sorted_pairs(query, found, self._count, once=True)

    def pairs(self) -> Ints:
        """Find the boxes that overlap each other: (2, K) int64 ids [i, j] with i < j, sorted."""
        ids = self.ids
        query, found = piled(self._find(self._rows[ids], None))
        first = ids[query]
        keep = first < found
        return sorted_pairs(first[keep], found[keep], self._count, once=True)

    def work(self, boxes: object) -> Work:
        """Nodes and boxes that a query of these boxes visits and tests."""
        work = Work(len(self.cell_boxes().number))
        self._find(box_rows("boxes", boxes, self.dim), work)
        return work

    def insert(self, boxes: object) -> Ints:
        """Add boxes and return their ids, (N,) int64."""
        rows = box_rows("boxes", boxes, self.dim)
        ids = np.arange(self._count, self._count + len(rows))
        self._reserve(self._count + len(rows))
        self._rows[ids], self._here[ids] = rows, True
        self._count += len(rows)
        if len(ids):
            self._enter(ids)
        return ids

    def remove(self, ids: object) -> None:
        """Remove boxes by id."""
        gone = self._living(ids)
        if len(gone):
            self._leave(gone)
            self._here[gone] = False

    def move(self, ids: object, boxes: object) -> None:
        """Replace boxes by id; a small move costs little."""
        moved = self._living(ids)
        rows = box_rows("boxes", boxes, self.dim)
        if len(rows) != len(moved):
            raise InputError(f"boxes: expected shape ({len(moved)}, {2 * self.dim}), one for each id, got {rows.shape}")
        if len(moved):
            self._shift(moved, rows)

    @abstractmethod
    def cell_boxes(self) -> Cells:
        """Nodes that a query may visit."""

    def check(self) -> None:
        """Raise AssertionError naming the first invariant that does not hold."""
        rows = self.boxes
        assert np.isfinite(rows).all(), "a box is not finite"
        assert (rows[:, : self.dim] <= rows[:, self.dim :]).all(), "a box has its min beyond its max"

    @abstractmethod
    def _find(self, queries: Floats, work: Work | None) -> list[Pairs]:
        """Overlapping (query, id), in any order and any pieces; a pair may be found more than once."""

    def _enter(self, ids: Ints) -> None:  # noqa: B027
        """Insert boxes that are new in the table."""

    def _leave(self, ids: Ints) -> None:  # noqa: B027
        """Remove boxes that are still in the table."""

    def _shift(self, ids: Ints, rows: Floats) -> None:
        """Write new rows into the table and update the structure."""
        self._rows[ids] = rows

    def _meeting(self, queries: Floats, query: Ints, ids: Ints, work: Work | None) -> Pairs:
        """The candidates whose present boxes overlap the query."""
        if work is not None:
            work.tests.append((query, ids))
        good = np.flatnonzero(meets(queries.take(query, axis=0), self._rows.take(ids, axis=0)))
        return query.take(good), ids.take(good)

    def _meeting_all(self, queries: Floats, which: Ints, ids: Ints, work: Work | None) -> list[Pairs]:
        """Test every named query against every named box, some millions of pairs at a time."""
        wide = max(1, min(len(ids), CHUNK_PAIRS))
        tall = max(1, CHUNK_PAIRS // wide)
        found: list[Pairs] = []
        for left in range(0, len(ids) if len(which) else 0, wide):
            chunk = ids[left : left + wide]
            boxes = self._rows.take(chunk, axis=0)
            for top in range(0, len(which), tall):
                rows = which[top : top + tall]
                if work is not None:
                    work.tests.append((np.repeat(rows, len(chunk)), np.tile(chunk, len(rows))))
                q, b = np.nonzero(meets(queries[rows][:, None], boxes))
                found.append((rows[q], chunk[b]))
        return found

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
        """Make room for n rows; the room doubles, so that rows inserted one by one are rarely copied."""
        if n > len(self._rows):
            more = max(n, 2 * len(self._rows)) - len(self._rows)
            for name in ("_rows", "_here", "_home", "_place"):
                column = getattr(self, name)
                setattr(self, name, np.concatenate((column, np.zeros((more, *column.shape[1:]), column.dtype))))


class BruteForce(BroadPhase):
    """Brute force: every query against every box. It is the reference, and the fastest for a few dozen boxes."""

    def cell_boxes(self) -> Cells:
        """The only node, a box around all boxes, or none."""
        rows = self.boxes
        hull = np.concatenate((rows[:, : self.dim].min(axis=0), rows[:, self.dim :].max(axis=0))) if len(rows) else rows
        rows = hull.reshape(-1, 2 * self.dim)
        return Cells(np.arange(len(rows)), rows, np.ones(len(rows), np.bool_))

    def _find(self, queries: Floats, work: Work | None) -> list[Pairs]:
        every = np.arange(len(queries))
        if work is not None and len(self):
            work.visits.append((every, np.zeros_like(every)))
        return self._meeting_all(queries, every, self.ids, work)


INDEX_GROWTH = 4  # growth in boxes at which a structure is rebuilt: its cells were chosen for the first boxes


class Index(Derivative):
    """The broad phase of the items of a scene that decide hits, over their inclusive pixel boxes.

    It follows the changes of the scene, at a cost proportional to them. `structure` is one of STRUCTURES.
    """

    def __init__(self, structure: str) -> None:
        super().__init__()
        self.structure = choice("structure", structure, tuple(STRUCTURES))
        self.boxes: BroadPhase | None = None  # before the first query
        self.followed = 0  # number of boxes that were updated for the last query
        self._pending = np.zeros(0, np.int64)
        self._made_of = 0
        self._place_of = np.zeros(0, np.int64)
        self._item_of = np.zeros(0, np.int64)

    def build_cost(self, items: Items) -> int:
        """Number of boxes that must be updated before the next query; each change is read once."""
        with self._lock:
            if self.boxes is not None and self._seen != items.version:
                changed = items.changed_rows(self._seen)
                if changed is None:
                    self.boxes = None
                else:
                    self._pending = np.union1d(self._pending, changed)
            self._seen = items.version
            if self.boxes is not None and (
                len(self._item_of) > 2 * len(self.boxes) + INDEX_SLACK
                or len(items.stack()) > INDEX_GROWTH * self._made_of + 16
            ):
                self.boxes = None
            return len(items.stack()) if self.boxes is None else len(self._pending)

    def read(self, items: Items) -> BroadPhase:
        """Update the structure to the present version, and return it."""
        with self._lock:
            self.followed = self.build_cost(items)
            if self.boxes is None:
                from .. import broadphase

                self.regret = 0.0
                rows = np.sort(items.stack().rows)
                self.boxes = getattr(broadphase, STRUCTURES[self.structure])(items.boxes(rows))
                self._item_of, self._place_of = rows, np.full(items.table.height, -1)
                self._place_of[rows] = np.arange(len(rows))
                self._made_of = len(rows)
            elif self.followed:
                self._follow(self.boxes, items, self._pending)
            self._pending = self._pending[:0]
            return self.boxes

    def query(self, items: Items, boxes_xyxy: Ints) -> tuple[Ints, Ints]:
        """Find the items whose boxes share a pixel with inclusive, non-empty boxes (n, 4): (box, row of the item)."""
        row, place = self.read(items).query(boxes_xyxy.astype(np.float64))
        return row, self._item_of[place]

    def _follow(self, boxes: BroadPhase, items: Items, changed: Ints) -> None:
        """Insert, remove or move the boxes of items that changed."""
        self._place_of = np.concatenate([self._place_of, np.full(items.table.height - len(self._place_of), -1)])
        now = items.deciding_boxes(changed)
        there, place = now[:, 0] <= now[:, 2], self._place_of[changed]
        known = place >= 0
        boxes.remove(place[known & ~there])
        boxes.move(place[known & there], now[known & there])
        new = boxes.insert(now[~known & there])
        self._place_of[changed[~there]] = -1
        self._place_of[changed[~known & there]] = new
        self._item_of = np.concatenate([self._item_of, changed[~known & there]])
