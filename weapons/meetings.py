"""Where rays touch items: pairs of a ray and an item, and the cells of each pair, with their times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planes.arrays import Bools, Ints
from planes.constants import CHUNK_SAMPLES
from planes.items import Stack, clipped
from planes.spans import Box, merged_runs, pieces, ragged
from weapons.trace import Lines

__all__ = ["Meetings", "first_of_each", "last_of_each", "meet", "stretches"]


@dataclass(frozen=True, eq=False)
class Meetings:
    """Pairs of a ray and an item that it touches, as columns, each with one cell or more.

    Parameters
    ----------
    ray, rank : (P,) the ray, and the place of the item in the stack
    count : (P,) cells of each; the cells of all pairs follow each other
    x, y, entry, leave : (K,) cells about the whole pixel of their ray, and when it enters and leaves them
    """

    ray: Ints
    rank: Ints
    count: Ints
    x: Ints
    y: Ints
    entry: Ints
    leave: Ints

    def __len__(self) -> int:
        return len(self.ray)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return 3 * self.ray.nbytes + 4 * self.x.nbytes

    @cached_property
    def begin(self) -> Ints:
        """First cell of each pair."""
        return np.asarray(np.cumsum(self.count) - self.count)

    @cached_property
    def pair(self) -> Ints:
        """Pair of each cell."""
        return np.repeat(np.arange(len(self)), self.count)

    @cached_property
    def first(self) -> Ints:
        """First cell of each pair in the order of the walk: by (entry, y, x)."""
        return first_of_each(self.begin, self.pair, (self.entry, self.y, self.x))

    def of_rays(self, live: Bools) -> Meetings:
        """Pairs of some of the rays."""
        return self.take(np.flatnonzero(live[self.ray]))

    def take(self, pairs: Ints) -> Meetings:
        """Some of the pairs, with all of their cells."""
        group, place = ragged(self.count[pairs])
        cell = self.begin[pairs][group] + place
        return self._of(pairs, self.count[pairs], cell)

    def only(self, keep: Bools) -> Meetings:
        """Keep some of the cells (K,), and the pairs that are left with one."""
        count = np.bincount(self.pair[keep], minlength=len(self))
        some = np.flatnonzero(count)
        return self._of(some, count[some], np.flatnonzero(keep))

    def at_times(self, entry: Ints, leave: Ints) -> Meetings:
        """The same cells at other times."""
        return Meetings(self.ray, self.rank, self.count, self.x, self.y, entry, leave)

    def _of(self, pairs: Ints, count: Ints, cells: Ints) -> Meetings:
        columns = (column[cells] for column in (self.x, self.y, self.entry, self.leave))
        return Meetings(self.ray[pairs], self.rank[pairs], count, *columns)

    @classmethod
    def none(cls) -> Meetings:
        """No pairs."""
        return cls(*[np.zeros(0, np.int64)] * 7)

    @classmethod
    def joined(cls, parts: Sequence[Meetings]) -> Meetings:
        """All pairs of several lists."""
        if len(parts) == 1:
            return parts[0]
        every = [cls.none(), *parts]
        names = ("ray", "rank", "count", "x", "y", "entry", "leave")
        return cls(*(np.concatenate([getattr(part, name) for part in every]) for name in names))


def meet(lines: Lines, ray: Ints, rank: Ints, stack: Stack, bounds: Box | None, origin_xy: Ints) -> Meetings:
    """Cells in which rays touch the pixels of items.

    Parameters
    ----------
    lines : one for each pair
    ray, rank : (P,) the pairs
    origin_xy : (P, 2) whole pixels that the lines are told about
    """
    shift = np.concatenate([origin_xy, origin_xy], axis=1)
    boxes_xyxy = stack.box_xyxy[rank] - shift
    inside = boxes_xyxy if bounds is None else clipped(stack.box_xyxy[rank], bounds) - shift
    size = boxes_xyxy[:, 2:] - boxes_xyxy[:, :2] + 1
    most = size.prod(axis=1) if lines.radius else 2 * size.sum(axis=1)
    found = []
    for part in pieces(most, CHUNK_SAMPLES) if len(rank) else ():
        here = np.arange(part.start, part.stop)
        own = lines.take(here)
        pair, x, y = own.candidates(inside[here])
        box = boxes_xyxy[here]
        item = rank[here]
        texel = (y - box[pair, 1]) * (box[pair, 2] - box[pair, 0] + 1) + x - box[pair, 0] + stack.offset[item][pair]
        on = stack.masks[texel]
        pair, x, y = pair[on], x[on], y[on]
        entry, leave = own.times(pair, x, y)
        order = np.flatnonzero(entry <= leave)
        order = order[np.argsort(pair[order], kind="stable")]
        count = np.bincount(pair[order], minlength=len(here))
        some = np.flatnonzero(count)
        found.append(Meetings(ray[here][some], item[some], count[some], x[order], y[order], entry[order], leave[order]))
    return Meetings.joined(found)


def first_of_each(begin: Ints, group: Ints, keys: Sequence[Ints]) -> Ints:
    """Index of the least element of each group, none empty, by keys of falling weight."""
    return _extreme_of_each(begin, group, keys, np.minimum, np.iinfo(np.int64).max)


def last_of_each(begin: Ints, group: Ints, keys: Sequence[Ints]) -> Ints:
    """Index of the greatest element of each group, none empty, by keys of falling weight."""
    return _extreme_of_each(begin, group, keys, np.maximum, np.iinfo(np.int64).min)


def _extreme_of_each(begin: Ints, group: Ints, keys: Sequence[Ints], better: np.ufunc, worst: int) -> Ints:
    still = np.ones(len(group), np.bool_)
    for key in keys:
        if not len(begin):
            break
        best = better.reduceat(np.where(still, key, worst), begin)
        still &= key == best[group]
    index = np.flatnonzero(still)
    return np.asarray(index[np.searchsorted(group[index], np.arange(len(begin)))])


def stretches(group: Ints, entry: Ints, leave: Ints) -> tuple[Ints, Ints, Ints]:
    """Union of closed stretches of time of each group: (group, first, last), sorted; what touches is joined."""
    times, place = np.unique(np.concatenate([entry, leave]), return_inverse=True)
    first, last = np.split(2 * place.reshape(-1), 2)  # twice: neighbouring numbers would count as touching
    which, first, last = merged_runs(group, first, last)
    return group[which], times[first // 2], times[last // 2]
