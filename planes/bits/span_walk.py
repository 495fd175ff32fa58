"""The span walk: runs of samples go through the stack, front to back, or read the label plane.

A run is a stretch of one row of one placed pattern, its `placement`; a sample is a pixel of a run. The `rank` of an
item is its place in the stack, 0 in front.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..common.checks import Bools, Ints
from ..grid.spans import Columns, each_pixel, ragged
from ..scene.items import Stack

if TYPE_CHECKING:
    from .shadows import Shelter

Kinds = npt.NDArray[np.uint8]

HIT, BLOCK, SKIP, SHELTERED, LIVE = 1, 2, 4, 8, 16
"""State bits of a sample: it hit an object, an occluder ended its walk, it skipped an item, an item on the way from its
origin shelters it, it still walks.
"""


class Verdict(IntEnum):
    """The outcome of a sample."""

    EMPTY = 0
    HIT = 1
    OCCLUDED = 2
    FILTERED = 3
    OUTSIDE = 4
    BEYOND = 5


OF_PATTERNS = tuple(Verdict)[: Verdict.BEYOND]
"""Verdicts of the samples of patterns; rays also have BEYOND, for cells after their end."""


def _verdict(state: int) -> Verdict:
    if state & HIT:
        return Verdict.HIT
    if state & (BLOCK | SHELTERED):
        return Verdict.OCCLUDED
    return Verdict.FILTERED if state & SKIP else Verdict.EMPTY


VERDICT_OF = np.array([_verdict(state) for state in range(2 * LIVE)])


@dataclass(frozen=True, eq=False)
class Runs(Columns):
    """Runs of samples, sorted by (placement, y, x_first), disjoint within a placement.

    Parameters
    ----------
    placement, y, x_first, x_last : (n,) int64
    ordinal : (n,) number of the run's pixel x = 0 in its pattern's prefix sums
    """

    placement: Ints
    y: Ints
    x_first: Ints
    x_last: Ints
    ordinal: Ints

    @property
    def lengths(self) -> Ints:
        """Samples of each run."""
        return self.x_last - self.x_first + 1

    @property
    def start(self) -> Ints:
        """Number of the sample at x = 0 of each run, even if the run does not contain x = 0."""
        return np.asarray(np.cumsum(self.lengths) - self.lengths - self.x_first)

    def in_rows(self, placement: Ints, low: Ints, high: Ints) -> tuple[Ints, Ints]:
        """First run and number of runs of placements (k,) in rows `low` .. `high`, none if `low` is greater."""
        top, end = int(self.y.min(initial=0)), int(self.y.max(initial=0)) + 1
        line, before = self.placement * (end - top + 1) + self.y, placement * (end - top + 1)
        first = line.searchsorted(before + np.clip(low, top, end))
        return first, np.maximum(line.searchsorted(before + np.clip(high, top - 1, end - 1), side="right") - first, 0)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of a placement and an item that may touch, sorted by (placement, rank).

    Parameters
    ----------
    placement, rank : (k,) int64
    kind : (k,) what the item does to a sample: HIT, BLOCK or SKIP
    """

    placement: Ints
    rank: Ints
    kind: Kinds


@dataclass(frozen=True, eq=False)
class Events(Columns):
    """Events of the walk, in stretches of runs: kind, rank of the item, number of the run, and columns."""

    kind: npt.NDArray[np.integer[Any]]
    rank: Ints
    run: Ints
    x_first: Ints
    x_last: Ints


# house: hit rule of areas
def walk(
    runs: Runs, pairs: Pairs, stack: Stack, pierce: bool, emit: int, shelter: Shelter | None = None
) -> tuple[Events, Kinds]:
    """Walk each sample through the items that cover it, front to back.

    A refused item is skipped. An accepted occluder ends the walk. An accepted object is hit, and ends the walk unless
    the weapon pierces; an object that others shelter from the sample's origin ends it likewise, but is not hit. All
    placements meet their first item in one step, their second in the next.

    Parameters
    ----------
    emit : kinds of events to return, as bits HIT, BLOCK, SKIP, and SHELTERED of objects that are not hit for it
    shelter : what shelters the samples, if the weapon needs a line of sight

    Returns
    -------
    events, and the state of each sample, in the order of the runs
    """
    state = np.full(int(runs.lengths.sum()), LIVE, np.uint8)
    kind, keep = pairs.kind, np.where(ends(pairs.kind, pierce), ~LIVE & 31, 31).astype(np.uint8)
    pair, run, x_first, x_last = _meetings(runs, pairs, stack)
    box, item = stack.box_xyxy, pairs.rank[pair]
    sample = runs.start[run]
    texel = stack.offset[item] + (runs.y[run] - box[item, 1]) * stack.width[item] - box[item, 0]
    emitted = [(np.zeros(0, np.int64), np.zeros(0, np.int64), kind[:0])]
    for now in _steps(pairs, pair):
        piece, x = each_pixel(x_first[now], x_last[now])
        meeting = now[piece]
        index = sample[meeting] + x
        on = stack.masks[texel[meeting] + x] & (state[index] >= LIVE)
        meeting, x, index = meeting[on], x[on], index[on]
        does = kind[pair[meeting]]
        if shelter is not None:
            does = np.where((does == HIT) & shelter.hides(index, item[meeting]), np.uint8(SHELTERED), does)
        state[index] = (state[index] | does) & keep[pair[meeting]]
        wanted = (does & emit) != 0
        emitted.append((meeting[wanted], x[wanted], does[wanted]))
    if shelter is not None:
        state[shelter.items > 0] |= SHELTERED
    return _events_of(emitted, item, run), state


def ends(kind: npt.NDArray[np.integer[Any]], pierce: bool) -> Bools:
    """Whether items that do this to a sample end its walk: an accepted item does, an object unless shots pierce."""
    return np.asarray((kind == BLOCK) | ((kind == HIT) & (not pierce)))


def _events_of(emitted: list[tuple[Ints, Ints, Kinds]], item: Ints, run: Ints) -> Events:
    """Events of meetings, each with the column and what the item did there; `item` and `run` are those of meetings."""
    meeting, x, does = (np.concatenate(column) for column in zip(*emitted, strict=True))
    first, last = _stretches(meeting, x, does)
    met = meeting[first]
    return Events(does[first], item[met], run[met], x[first], x[last])


def _steps(pairs: Pairs, pair: Ints) -> Iterator[Ints]:
    """Numbers of the meetings (n,) of pairs with the first item of each placement, with the second, and so on."""
    depth = np.arange(len(pairs.placement)) - np.searchsorted(pairs.placement, pairs.placement)
    order = np.argsort(depth[pair], kind="stable")
    steps = np.flatnonzero(np.diff(depth[pair][order], prepend=-1, append=-1))
    return (order[begin:end] for begin, end in pairwise(steps))


def _meetings(runs: Runs, pairs: Pairs, stack: Stack) -> tuple[Ints, Ints, Ints, Ints]:
    """Stretches of runs inside the boxes of the items that they are paired with: (pair, run, x_first, x_last)."""
    box = stack.box_xyxy[pairs.rank]
    first, count = runs.in_rows(pairs.placement, box[:, 1], box[:, 3])
    pair, place = ragged(count)
    run = first[pair] + place
    x_first = np.maximum(runs.x_first[run], box[pair, 0])
    x_last = np.minimum(runs.x_last[run], box[pair, 2])
    mask = x_first <= x_last
    return pair[mask], run[mask], x_first[mask], x_last[mask]


def _stretches(group: Ints, x: Ints, value: Kinds) -> tuple[Ints, Ints]:
    """First and last index of each stretch of neighbours that have one group and one value."""
    if not len(x):
        none = np.zeros(0, np.int64)
        return none, none
    cut = np.flatnonzero((group[1:] != group[:-1]) | (x[1:] != x[:-1] + 1) | (value[1:] != value[:-1]))
    return np.concatenate([[0], cut + 1]), np.concatenate([cut, [len(x) - 1]])
