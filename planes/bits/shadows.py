"""Shadows: which pixels an item hides from an origin, because it lies on the way to them.

The way from pixel o to pixel p is every pixel but p whose closed square meets the segment between their centres. An
item shelters p if one of its pixels lies on the way:

    o . # - - -        o sees the wall, but not what is behind it
    . . # - - -

A mask is covered by rectangles. The pixels of a row behind a rectangle form one interval, whose ends are quotients of
whole numbers: the segment from (0, 0) to (x, y) meets a box if it is not separated from it by a side of the box or by
its own line. The item's own pixels hide those behind them; the bare ones, which nothing of the rectangle lies before,
are told apart. In the rows beyond a connected part of a mask one interval is left, between its outermost corners.
`jit.bit_rows` has the compiled form of `hide_behind`; `exits` has the items in which ways begin.

References
----------
Ericson, *Real-Time Collision Detection* (2005), 5.3.3 (segment against box).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .. import late
from ..common.checks import Bools, Floats, Ints
from ..common.limits import CHUNK_PAIRS, CHUNK_SAMPLES
from ..grid.spans import Columns, begins, each_pixel, merged_runs, pieces, ragged, sorted_once
from .bit_rows import WORD, Words
from .blockers import Blockers
from .cells import met_boxes
from .span_walk import Runs
from .visible import sides_of

NEVER = np.iinfo(np.int64).max

ROWS_AT_ONCE = 2**15
"""Rows of rectangles worked on at a time: 256 KB for each of their columns."""

NEAREST = 4
"""Blockers of a row in the first round; each later round has as many as those before it."""

FARTHEST = 2**40
"""A row, and a distance, beyond all others, px."""

FEW_WAYS = 2**8
"""Most pairs of a way and a blocker that need neither an angle test nor rounds, and most rectangles without wedges: for
so few these cost more than they save.
"""

FULL = np.uint64(2**64 - 1)


def ways_met(boxes_xyxy: Ints, origin_xy: Ints, blockers: Blockers) -> Iterator[tuple[Ints, Ints]]:
    """Sorted pairs (row, blocker) of which the box may meet the way from an origin (n, 2) to pixels of a box (n, 4).

    They come in parts, as a large blast in a crowd has millions of them.
    """
    step = max(CHUNK_PAIRS // max(len(blockers.rank), 1), 1)
    for begin in range(0, max(len(boxes_xyxy), 1), step):
        box, origin = boxes_xyxy[begin : begin + step], origin_xy[begin : begin + step]
        low, high = np.minimum(box[:, :2], origin), np.maximum(box[:, 2:], origin)
        row, blocker = met_boxes(np.concatenate([low, high], axis=1), blockers.box_xyxy)
        if len(row) > FEW_WAYS:
            seen, far = (side - np.tile(origin[row], 2) for side in (blockers.box_xyxy[blocker], box[row]))
            kept = _between(seen, far).nonzero()[0]
            row, blocker = row[kept], blocker[kept]
        yield row + begin, blocker


def nearest_first(row: Ints, blocker: Ints, origin_xy: Ints, blockers: Blockers) -> Iterator[tuple[Ints, Ints]]:
    """Sorted pairs (k,) of a row and a blocker, in rounds: blockers near the row's origin come first.

    In a crowd the nearest blockers leave most rows dark, and a dark row need not be asked about the others. Pairs of a
    round are sorted by row. If what a way begins in is ignored up to its exit, which takes long, it comes last.
    """
    if len(row) <= FEW_WAYS:
        yield row, blocker
        return
    box, origin = blockers.box_xyxy[blocker], origin_xy[row]
    distance = np.abs(box[:, :2] + box[:, 2:] - 2 * origin).max(axis=1)
    if blockers.until_exit:
        distance[((box[:, :2] <= origin) & (origin <= box[:, 2:])).all(axis=1)] = FARTHEST
    order = np.lexsort((distance, row))
    turn = np.frexp((np.arange(len(row)) - row.searchsorted(row)) // NEAREST)[1]
    for number in range(int(turn.max()) + 1):
        now = order[turn == number]
        yield row[now], blocker[now]


def all_ways_met(boxes_xyxy: Ints, origin_xy: Ints, blockers: Blockers) -> tuple[Ints, Ints]:
    """All pairs of `ways_met`."""
    row, blocker = zip(*ways_met(boxes_xyxy, origin_xy, blockers), strict=True)
    return np.concatenate(row), np.concatenate(blocker)


def begun_in(origin_xy: Ints, blockers: Blockers) -> tuple[Ints, Ints]:
    """Sorted pairs (row, blocker) of origins (n, 2) that lie on a blocker."""
    row, blocker = all_ways_met(np.tile(origin_xy, 2), origin_xy, blockers)
    inside = begun(origin_xy[row], blockers, blocker)[0]
    return row[inside], blocker[inside]


def begun(origin_xy: Ints, blockers: Blockers, blocker: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Ways (k,) that begin in their blocker: (place of the way, rectangles (m, 4), first rectangle, their number)."""
    box = blockers.box_xyxy[blocker]
    near = np.flatnonzero(((box[:, :2] <= origin_xy) & (origin_xy <= box[:, 2:])).all(axis=1))
    place, rects, _ = blockers.rects_of(blocker[near], origin_xy[near])
    inside = sorted_once(place[_holds_origin(rects)])
    first = place.searchsorted(inside)
    return near[inside], rects, first, place.searchsorted(inside, side="right") - first


def _holds_origin(rects: Ints) -> Bools:
    return np.asarray(((rects[:, :2] <= 0) & (rects[:, 2:] >= 0)).all(axis=1))


# house: hit rule of areas
def shadow(rects: Ints, y: Ints) -> tuple[Floats, Floats, Floats, Floats]:
    """Columns of rows that rectangles hide from pixel (0, 0), and the columns of the rectangles that they leave bare.

    The quotients are exact: their terms stay below 2**43, so no rounding reaches a whole number.

    Parameters
    ----------
    rects : (..., 4) inclusive sides x_min, y_min, x_max, y_max, px
    y : (...) rows; both broadcast

    Returns
    -------
    first, last, bare_first, bare_last : (...); an interval is empty if its first column is the greater one
    """
    x_min, y_min, x_max, y_max = np.moveaxis(rects.astype(np.float64), -1, 0)
    down, away = y >= 0, np.abs(y)
    near, far = np.where(down, y_min, -y_max), np.where(down, y_max, -y_min)  # rows, counted away from the origin
    left, right, top, bottom = 2 * x_min - 1, 2 * x_max + 1, 2 * near - 1, 2 * far + 1  # sides, in halves of a pixel
    ahead, aside = near > 0, (left > 0) | (right < 0)
    first = np.where(ahead, np.ceil(left * away / top), -np.inf)
    first = np.where(left > 0, np.maximum(x_min, np.ceil(left * away / bottom)), first)
    last = np.where(ahead, np.floor(right * away / top), np.inf)
    last = np.where(right < 0, np.minimum(x_max, np.floor(right * away / bottom)), last)
    first = np.where((far < 0) | (away < near), np.inf, first)
    side = np.where(left > 0, x_min, x_max)
    nearest = ahead & (away == near)
    alone = aside & (away >= near) & (away <= far)
    alone &= (np.abs(side) > away) | (nearest & (np.abs(side) == away))
    here = ~aside & ~ahead & (far >= 0) & (away == 0)  # the origin itself
    bare_first = np.where(nearest, np.maximum(x_min, 1 - away), np.where(here, 0, np.inf))
    bare_last = np.where(nearest, np.minimum(x_max, away - 1), np.where(here, 0, -np.inf))
    return first, last, np.where(alone, side, bare_first), np.where(alone, side, bare_last)


class Edges(NamedTuple):
    """Rectangles, seen from origins, and the rows in which each is looked at by itself.

    Parameters
    ----------
    place : (n,) number of the way, rising
    low, high : (n,) first and last row
    boxes : (n, 4) inclusive sides, px
    """

    place: Ints
    low: Ints
    high: Ints
    boxes: Ints

    def columns(self, which: Ints, y: Ints) -> tuple[Floats, Floats, Floats, Floats]:
        """Columns that some hide in rows; see `shadow`."""
        return shadow(self.boxes[which], y)


class Wedges(NamedTuple):
    """Connected parts of masks, seen from origins, and the rows beyond each, in which it hides one interval.

    Parameters
    ----------
    place, low, high, boxes : as of `Edges`
    first, last : (2, n) first and last column over the distance of the row, as numerators and denominators
    """

    place: Ints
    low: Ints
    high: Ints
    boxes: Ints
    first: Ints
    last: Ints

    def columns(self, which: Ints, y: Ints) -> tuple[Floats, Floats, Floats, Floats]:
        """Columns that some hide in rows; none are left bare."""
        (left, top), (right, low) = self.first[:, which].astype(np.float64), self.last[:, which].astype(np.float64)
        away, none = np.abs(y), np.full(len(y), np.inf)
        return np.ceil(left * away / top), np.floor(right * away / low), none, -none


def seen_from(origin_xy: Ints, blockers: Blockers, blocker: Ints, height: int = WORD) -> Sequence[Wedges | Edges]:
    """Blockers (k,) as seen from origins (k, 2), to hide pixels in `height` rows.

    A part that lies above or below the origin as a whole has a connected shadow, as its rectangles touch: beyond it,
    that of all of them is what lies between the outermost corners. Few rectangles are each looked at in all rows.
    """
    place, rects, new = blockers.rects_of(blocker, origin_xy)
    if len(place) * height <= FEW_WAYS * WORD:
        every = np.full(len(place), FARTHEST)
        return [Edges(place, -every, every, rects)]
    new |= begins(place)
    begin, part = new.nonzero()[0], np.cumsum(new) - 1
    x_min, y_min, x_max, y_max = rects.T
    least, most = np.minimum.reduceat, np.maximum.reduceat
    boxes = np.stack([least(x_min, begin), least(y_min, begin), most(x_max, begin), most(y_max, begin)], axis=1)
    down, up = (boxes[:, 1] > 0)[part], (boxes[:, 3] < 0)[part]
    low = np.where(up, boxes[part, 1], np.where(down, y_min, -FARTHEST))
    high = np.where(down, boxes[part, 3], np.where(up, y_max, FARTHEST))
    near, far = 2 * np.where(down, y_min, -y_max) - 1, 2 * np.where(down, y_max, -y_min) + 1  # in halves of a pixel
    left, right = (_least(side, np.where(side < 0, near, far), begin, part) for side in (2 * x_min - 1, -2 * x_max - 1))
    right[0] *= -1
    apart = ((boxes[:, 1] > 0) | (boxes[:, 3] < 0)).nonzero()[0]
    under = boxes[apart, 1] > 0
    rows = np.where(under, boxes[apart, 3] + 1, -FARTHEST), np.where(under, FARTHEST, boxes[apart, 1] - 1)
    wedges = Wedges(place[begin[apart]], *rows, boxes[apart], left[:, apart], right[:, apart])
    return [wedges, Edges(place, low, high, rects)]


def _least(side: Ints, away: Ints, begin: Ints, part: Ints) -> Ints:
    """The least quotient of `side` and `away` in each part, as numerators and denominators (2, n)."""
    slope = side / away  # of numbers below 2**22, of which different ones are different as floats, too
    corner = (slope == np.minimum.reduceat(slope, begin)[part]).nonzero()[0]
    corner = corner[begins(part[corner])]
    return np.stack([side[corner], away[corner]])


def hide_behind(rows: Words, corner_xy: Ints, origin_xy: Ints, blockers: Blockers, pair: Ints, blocker: Ints) -> None:
    """Clear the pixels (n, height) that blockers shelter from their origins.

    Parameters
    ----------
    corner_xy : (n, 2) pixel of bit 0 of the first row
    origin_xy : (n, 2) pixels from which the ways begin
    pair, blocker : (k,) sorted pairs of a row of `rows` and a blocker
    """
    if blockers.until_exit:
        pair, blocker = late.exits.hide_after_exit(rows, corner_xy, origin_xy, blockers, pair, blocker)
    corner = corner_xy - origin_xy
    for seen in seen_from(origin_xy[pair], blockers, blocker):
        own, box = pair[seen.place], sides_of(rows) + np.tile(corner, 2)
        box = box[own]
        met = (seen.low <= box[:, 3]) & (seen.high >= box[:, 1]) & (np.bitwise_or.reduce(rows, axis=1)[own] != 0)
        which = met.nonzero()[0]
        which = which[_between(seen.boxes[which], box[which])]
        step = max(ROWS_AT_ONCE // rows.shape[1], 1)
        for begin in range(0, len(which), step):
            now = which[begin : begin + step]
            _hide(rows, corner, own[now], seen, now)


def _hide(rows: Words, corner: Ints, own: Ints, seen: Edges | Wedges, which: Ints) -> None:
    """Clear the pixels of rows `own` that some rectangles or wedges hide; `corner` is that of all rows, from (0, 0)."""
    rect, row = rows[own].nonzero()
    left, y = corner[own[rect]].T
    y = y + row
    inside = ((seen.low[which[rect]] <= y) & (y <= seen.high[which[rect]])).nonzero()[0]
    rect, row, left = rect[inside], row[inside], left[inside]
    first, last, bare_first, bare_last = seen.columns(which[rect], y[inside])
    hidden = np.zeros((len(own), rows.shape[1]), np.uint64)
    hidden[rect, row] = _columns(first, last, left) & ~_columns(bare_first, bare_last, left)
    new = begins(own).nonzero()[0]
    rows[own[new]] &= ~np.bitwise_or.reduceat(hidden, new, axis=0)


def spells(rects: Ints, x: Ints, y: Ints) -> tuple[Ints, Ints]:
    """When the ways from pixel (0, 0) to pixels (...) enter and leave rectangles (..., 4); all broadcast.

    Times are in units of 1 / (2 max(1, abs(x)) max(1, abs(y))) of the way. One that is not met is left before it is
    entered.
    """
    across, down = np.maximum(np.abs(x), 1), np.maximum(np.abs(y), 1)
    entry, leave = np.zeros(1, np.int64), 2 * across * down
    for axis, (step, scale) in enumerate(((x, down), (y, across))):
        low, high = 2 * rects[..., axis] - 1, 2 * rects[..., axis + 2] + 1  # in halves of a pixel
        near, far = np.where(step > 0, low, -high) * scale, np.where(step > 0, high, -low) * scale
        beside = (low > 0) | (high < 0)
        entry = np.where(step == 0, entry, np.maximum(entry, near))
        leave = np.where(step == 0, np.where(beside, -1, leave), np.minimum(leave, far))
    return entry, leave


def _between(rects: Ints, boxes_xyxy: Ints) -> Bools:
    """Whether rectangles (m, 4) may meet a segment from pixel (0, 0) to a pixel of a box (m, 4).

    All segments lie between the two lines through (0, 0) that touch the box. They touch it at corners: at the near one
    of each side that the origin lies beyond, at the far one of the others.
    """
    x_min, y_min, x_max, y_max = boxes_xyxy.T
    met = (rects[:, 0] <= np.maximum(x_max, 0)) & (rects[:, 2] >= np.minimum(x_min, 0))
    met &= (rects[:, 1] <= np.maximum(y_max, 0)) & (rects[:, 3] >= np.minimum(y_min, 0))
    beside, around = (y_min <= 0) & (y_max >= 0), (x_min <= 0) & (x_max >= 0)
    side, near = np.where(x_min > 0, x_min, x_max), np.where(y_min > 0, y_min, y_max)
    far = y_min + y_max - near
    right = np.where(beside, side, x_max), np.where(beside, y_min, np.where(x_max > 0, near, far))
    left = np.where(beside, side, x_min), np.where(beside, y_max, np.where(x_min < 0, near, far))
    corners = 2 * rects + np.array([-1, -1, 1, 1])
    turn = np.sign(right[0] * left[1] - right[1] * left[0])
    for (x, y), inward in ((right, turn), (left, -turn)):
        across, down = inward * x, -inward * y
        most = np.maximum(across * corners[:, 1], across * corners[:, 3])
        most += np.maximum(down * corners[:, 0], down * corners[:, 2])
        met &= (most >= 0) | (beside & around)
    return np.asarray(met)


def _columns(first: Floats, last: Floats, left: Ints) -> Words:
    """Words (n,) whose bits are the columns of intervals (n,); bit 0 is column `left`."""
    low = np.clip(first - left, 0, WORD)
    high = np.clip(last - left, -1, WORD - 1)
    filled = low <= high
    low, high = low * filled, np.where(filled, high, 0)
    words: Words = FULL << low.astype(np.uint64)
    words &= FULL >> (WORD - 1 - high).astype(np.uint64)
    words *= filled
    return words


@dataclass(frozen=True, eq=False)
class Shelter(Columns):
    """What shelters samples from the origins of their placements, as columns.

    Parameters
    ----------
    items : number of items that shelter each sample
    ranks : sum of their ranks
    """

    items: Ints
    ranks: Ints

    def hides(self, sample: Ints, rank: Ints) -> Bools:
        """Whether an item other than that of a rank (n,), or of one for all, shelters a sample (n,)."""
        count = self.items[sample]
        return np.asarray((count > 1) | ((count == 1) & (self.ranks[sample] != rank)))


def shelter_of(runs: Runs, origin_xy: Ints, blockers: Blockers, placement: Ints, blocker: Ints) -> Shelter:
    """Items that shelter the samples of runs.

    Parameters
    ----------
    runs : samples, sorted by placement
    origin_xy : (P, 2) pixels from which the ways of placements begin
    placement, blocker : (k,) pairs whose blocker may shelter a sample
    """
    pair, run, first, last = _hidden_by_pairs(runs, origin_xy, blockers, placement, blocker)
    start = runs.start
    count = np.zeros((2, int(runs.lengths.sum()) + 1), np.int64)
    rank = blockers.rank[blocker[pair]]
    for row, weight in enumerate((np.ones_like(rank), rank)):
        np.add.at(count[row], start[run] + first, weight)
        np.subtract.at(count[row], start[run] + last + 1, weight)
    items, ranks = np.cumsum(count, axis=1)[:, :-1]
    return Shelter(items, ranks)


def _hidden_by_pairs(
    runs: Runs, origin_xy: Ints, blockers: Blockers, placement: Ints, blocker: Ints
) -> tuple[Ints, Ints, Ints, Ints]:
    """Stretches of runs that the blocker of each pair shelters, as (pair, run, x_first, x_last), sorted and apart."""
    pair, run, first, last = _hidden(runs, origin_xy, blockers, placement, blocker)
    which, first, last = merged_runs(pair * len(runs) + run, first, last)
    return pair[which], run[which], first, last


def sheltered_stretches(
    runs: Runs, origin_xy: Ints, blockers: Blockers, placement: Ints, blocker: Ints
) -> tuple[Ints, Ints, Ints]:
    """Stretches of runs that any blocker shelters, as (run, x_first, x_last), sorted and apart; see `shelter_of`."""
    run, first, last = _hidden(runs, origin_xy, blockers, placement, blocker)[1:]
    which, first, last = merged_runs(run, first, last)
    return run[which], first, last


def _hidden(
    runs: Runs, origin_xy: Ints, blockers: Blockers, placement: Ints, blocker: Ints
) -> tuple[Ints, Ints, Ints, Ints]:
    """Stretches of runs that blockers shelter, as (pair, run, x_first, x_last); those of a pair may overlap."""
    origin, pair = origin_xy[placement], np.arange(len(placement))
    found: list[tuple[Ints, ...]] = []
    if blockers.until_exit:
        inside, rects, begin, count = begun(origin, blockers, blocker)
        for k, first, number in zip(inside.tolist(), begin.tolist(), count.tolist(), strict=True):
            found += late.exits.hidden_after_exit(runs, placement[k], k, origin[k], rects[first : first + number])
        pair = np.delete(pair, inside)
    for seen in seen_from(origin[pair], blockers, blocker[pair], len(runs)):
        of = pair[seen.place]
        begin, count = runs.in_rows(placement[of], seen.low + origin[of, 1], seen.high + origin[of, 1])
        for piece in pieces(count, CHUNK_SAMPLES):
            rect, place = ragged(count[piece])
            rect += piece.start
            run, own = begin[rect] + place, of[rect]
            for which, first, last in _stretches(runs, run, origin[own], seen, rect):
                found.append((own[which], run[which], first, last))
    columns = [np.concatenate(column) for column in zip(*found, strict=True)]
    return columns[0], columns[1], columns[2], columns[3]


def _stretches(
    runs: Runs, run: Ints, origin_xy: Ints, seen: Edges | Wedges, rect: Ints
) -> Iterator[tuple[Ints, Ints, Ints]]:
    """Stretches of runs (k,) that a rectangle or wedge of each hides, as (place in `run`, x_first, x_last)."""
    x, y = origin_xy.T
    first, last, bare_first, bare_last = seen.columns(rect, runs.y[run] - y)
    first, last = np.maximum(first, runs.x_first[run] - x), np.minimum(last, runs.x_last[run] - x)
    bare = (bare_first <= bare_last).nonzero()[0]  # these split what is hidden
    after = np.maximum(bare_last[bare] + 1, first[bare]), last[bare]
    last[bare] = np.minimum(bare_first[bare] - 1, last[bare])
    for every, low, high in ((np.arange(len(run)), first, last), (bare, *after)):
        kept = (low <= high).nonzero()[0]
        which = every[kept]
        yield which, low[kept].astype(np.int64) + x[which], high[kept].astype(np.int64) + x[which]


def times(rects: Ints, x: Ints, y: Ints, until_exit: bool) -> tuple[Bools, Ints]:
    """Which rectangles of an item lie on the way from pixel (0, 0) to pixels (s,), and when the way enters them.

    Parameters
    ----------
    rects : (m, s, 4), or (m, 1, 4) of the same item for all pixels
    until_exit : whether what the way enters before it has left the item for the first time does not count

    Returns
    -------
    hidden, entry : (m, s); times in units of 1 / (2 max(1, abs(x)) max(1, abs(y))) of the segment
    """
    first, last, bare_first, bare_last = shadow(rects, y)
    met = (first <= x) & (x <= last)
    hidden = met & ~((bare_first <= x) & (x <= bare_last))
    entry, leave = spells(rects, x, y)
    if until_exit and len(x):
        hidden &= entry > exit_of(np.where(met, entry, NEVER), np.where(met, leave, -1))
    return hidden, entry


def exit_of(entry: Ints, leave: Ints) -> Ints:
    """When ways (s,) leave an item that they begin in, by the times (m, s) at which they enter and leave its parts."""
    order = np.argsort(entry, axis=0)
    reach = np.maximum.accumulate(np.take_along_axis(leave, order, axis=0), axis=0)
    later = np.concatenate([np.take_along_axis(entry, order, axis=0)[1:], np.full((1, entry.shape[1]), NEVER)])
    return np.asarray(np.take_along_axis(reach, (later > reach).argmax(axis=0)[None], axis=0)[0])


def sheltered_by(
    runs: Runs, origin_xy: Ints, blockers: Blockers, placement: Ints, blocker: Ints, wanted: Bools, own: Ints
) -> Ints:
    """Rank of the item that the way to each sample (s,) enters first, in front of others; -1 if it enters none.

    Parameters
    ----------
    runs, origin_xy, placement, blocker : see `shelter_of`
    wanted : (s,) whether it is asked for a sample; for the others it is -1
    own : (s,) rank of an item that does not shelter the sample, or -1
    """
    soonest, blocker_rank = np.full(len(own), NEVER), np.full(len(own), -1)
    pair, run, first, last = _hidden_by_pairs(runs, origin_xy, blockers, placement, blocker)
    begin, start = begins(pair).nonzero()[0], runs.start
    for k, part in zip(pair[begin].tolist(), np.split(np.arange(len(pair)), begin[1:]), strict=False):
        stretch, column = each_pixel(first[part], last[part])
        on, origin, rank = run[part][stretch], origin_xy[placement[k]], int(blockers.rank[blocker[k]])
        kept = (wanted[start[on] + column] & (own[start[on] + column] != rank)).nonzero()[0]
        sample, x, y = (start[on] + column)[kept], column[kept] - origin[0], runs.y[on[kept]] - origin[1]
        rects = blockers.rects_of(blocker[k : k + 1], origin[None])[1]
        time = _entered(rects, x, y, blockers.until_exit)
        sooner = (time < soonest[sample]).nonzero()[0]
        soonest[sample[sooner]], blocker_rank[sample[sooner]] = time[sooner], rank
    return blocker_rank


def _entered(rects: Ints, x: Ints, y: Ints, until_exit: bool) -> Ints:
    """When ways from pixel (0, 0) to pixels (s,) first enter a rectangle that shelters them, as in `_times`."""
    inside = bool(_holds_origin(rects).any())
    if inside and not until_exit:
        return np.zeros_like(x)
    parts = [np.zeros(0, np.int64)]
    step = max(CHUNK_SAMPLES // len(rects), 1)
    for first in range(0, len(x), step):
        now = slice(first, first + step)
        hidden, entry = times(rects[:, None], x[now], y[now], inside)
        parts.append(np.where(hidden, entry, NEVER).min(axis=0))
    return np.concatenate(parts)
