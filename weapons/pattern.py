"""Patterns: the pixels of a shot about its whole pixel, with their weights; and many of them as one table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from planes.arrays import InputError, Ints
from planes.bits import WORD
from planes.constants import MASK_AREA_MAX, SUB, WEIGHT_FULL
from planes.nearest import BESIDE_REACH
from planes.sampling import Runs
from planes.spans import Spans, ragged
from planes.strips import Strip, strip_of

if TYPE_CHECKING:
    from planes.volumes import Volumes

__all__ = ["FALLOFFS", "Pattern", "PatternTable", "Swept", "falloff_weights", "make_pattern", "smoothed"]

Swept = tuple[Ints, Ints, int]
"""Ends (2,) of a segment and a radius, in 1/256 px."""

FALLOFFS = ("linear", "smooth")
_DOUBT = 2.0**-30  # the float below is right to 2**-34; nearer to a whole number than this, integers decide


@dataclass(frozen=True, eq=False)
class Pattern:
    """A set of pixels about the origin, and prefix sums of their weights in span order (None: all at full weight).

    `swept` is the segment that the pixels lie along, if the weapon has one: their centres lie within the radius of it,
    or their squares meet it.
    """

    spans: Spans
    prefix: Ints | None
    swept: Swept | None = None
    _volumes: dict[str, Volumes] = field(default_factory=dict, repr=False)

    @cached_property
    def window_bytes(self) -> int:
        """What its bit rows take in `weapons.windows`."""
        x, y, x_max, y_max = self.spans.box_xyxy or (0, 0, -1, -1)
        return ((x_max - x) // WORD + 3) * (y_max - y + 1 + 2 * WORD) * 8

    @cached_property
    def strip(self) -> Strip:
        """The strip that its pixels lie in."""
        return strip_of(self.spans)

    @cached_property
    def table(self) -> PatternTable:
        """The table of this one pattern."""
        return PatternTable([self])

    def volume(self, name: str, fitted: Callable[[Pattern], Volumes]) -> Volumes:
        """A volume of the pixels, made once for each name."""
        if name not in self._volumes:
            self._volumes[name] = fitted(self)
        return self._volumes[name]

    @cached_property
    def is_disc(self) -> bool:
        """Whether it holds all pixels that are nearer to the origin than one of its own, or as near; of small ones."""
        if not self.spans.count or max(map(abs, self.spans.box_xyxy or ())) > BESIDE_REACH:
            return False
        farthest = int((self.spans.pixels() ** 2).sum(axis=1).max())
        x = np.array([math.isqrt(farthest - y * y) for y in range(math.isqrt(farthest) + 1)])
        row = 2 * x + 1
        return self.spans.count == int(row[0] + 2 * row[1:].sum())

    @property
    def nbytes(self) -> int:
        """Bytes that it holds, with those of its own objects."""
        return 3 * self.spans.y.nbytes + (0 if self.prefix is None else self.prefix.nbytes) + 1024


def make_pattern(spans: Spans, falloff: str | None, reach_256: int, swept: Swept | None = None) -> Pattern:
    """Weigh the pixels of a set by their distance from the origin."""
    if falloff is None:
        return Pattern(spans, None, swept)
    if spans.count > MASK_AREA_MAX:
        raise InputError(f"falloff: expected a pattern of at most {MASK_AREA_MAX} px, got {spans.count}")
    weights = falloff_weights((spans.pixels() ** 2).sum(axis=1), falloff, reach_256)
    return Pattern(spans, np.concatenate([[0], np.cumsum(weights)]), swept)


def falloff_weights(distance2: Ints, falloff: str, reach_256: int) -> Ints:
    """Whole weights from 65,535 at the origin to 0 at the reach.

    Parameters
    ----------
    distance2 : squared distances from the origin, px^2, whole numbers
    falloff : "linear", or "smooth": 3 t^2 - 2 t^3 of the linear weight t (Perlin's smoothstep)
    reach_256 : distance at which the weight is 0, in 1/256 px
    """
    distance2 = np.asarray(distance2, np.int64)
    if reach_256 == 0:
        return np.where(distance2 == 0, WEIGHT_FULL, 0)
    lost = np.sqrt(distance2.astype(np.float64)) * (WEIGHT_FULL * SUB) / reach_256
    whole = np.floor(lost).astype(np.int64)
    for i in np.flatnonzero(np.abs(lost - np.rint(lost)) < _DOUBT):
        near = round(float(lost[i]))
        reached = (near * reach_256) ** 2 <= int(distance2[i]) * (WEIGHT_FULL * SUB) ** 2
        whole[i] = near if reached else near - 1
    return smoothed(np.maximum(WEIGHT_FULL - whole, 0), falloff)


def smoothed(linear: Ints, falloff: str) -> Ints:
    """Weights of a falloff, of those of the linear one."""
    if falloff == "smooth":
        return linear * linear * (3 * WEIGHT_FULL - 2 * linear) // WEIGHT_FULL**2
    return linear


class TableSpans(NamedTuple):
    """Spans of several patterns, one after another, as columns.

    Parameters
    ----------
    y, x_first, x_last : of each
    ordinal : (n,) number of its first pixel in the prefix sums, less its `x_first`
    row : (n,) a number that rises with pattern and row, by which the spans of a range of rows are found
    top, rows : the least row, and how many there are
    """

    y: Ints
    x_first: Ints
    x_last: Ints
    ordinal: Ints
    row: Ints
    top: int
    rows: int

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return 5 * self.y.nbytes


class PatternTable:
    """The distinct patterns of a call; their spans, one after another, are put together when they are asked for.

    Parameters
    ----------
    patterns : they themselves
    count : (n,) pixels of each
    box_xyxy : (n, 4) inclusive; x_max < x_min for an empty pattern
    """

    def __init__(self, patterns: Sequence[Pattern]) -> None:
        self.patterns = patterns
        self.count = np.array([p.spans.count for p in patterns], np.int64)
        self.box_xyxy = np.array([p.spans.box_xyxy or (0, 0, -1, -1) for p in patterns], np.int64)

    @property
    def runs(self) -> int:
        """Spans of all patterns."""
        return sum(len(p.spans) for p in self.patterns)

    @cached_property
    def prefix(self) -> Ints | None:
        """Prefix sums of the weights of all patterns; None if all have full weight."""
        prefixes = [p.prefix for p in self.patterns if p.prefix is not None]
        return np.concatenate(prefixes) if prefixes else None

    @cached_property
    def spans(self) -> TableSpans:
        """Spans of all patterns."""
        spans = [p.spans for p in self.patterns]
        y, x_first, x_last = (np.concatenate([getattr(s, side) for s in spans]) for side in ("y", "x_first", "x_last"))
        pattern = np.repeat(np.arange(len(spans)), [len(s) for s in spans])
        lengths = x_last - x_first + 1
        ordinal = np.cumsum(lengths) - lengths - x_first
        if self.prefix is not None:
            ordinal += pattern  # each prefix begins with a 0
        top = int(y.min(initial=0))
        rows = int(y.max(initial=0)) - top + 1
        return TableSpans(y, x_first, x_last, ordinal, pattern * (rows + 2) + y - top, top, rows)

    @property
    def nbytes(self) -> int:
        """Bytes of what there is for each pattern, without their spans and weights."""
        return self.count.nbytes + self.box_xyxy.nbytes

    def laid(self, pattern: Ints, x: Ints, y: Ints, boxes_xyxy: Ints) -> Runs:
        """Runs of placed patterns (n,), each clipped to its own inclusive box (n, 4)."""
        spans, rows = self.spans, self.spans.rows
        low, high = (np.clip(boxes_xyxy[:, side] - y - spans.top, -1, rows) for side in (1, 3))
        first = np.searchsorted(spans.row, pattern * (rows + 2) + low)
        last = np.searchsorted(spans.row, pattern * (rows + 2) + high, side="right")
        owner, place = ragged(np.maximum(last - first, 0))
        span = first[owner] + place
        box = boxes_xyxy[owner]
        x_first = np.maximum(spans.x_first[span] + x[owner], box[:, 0])
        x_last = np.minimum(spans.x_last[span] + x[owner], box[:, 2])
        some = x_first <= x_last
        row = spans.y[span] + y[owner]
        ordinal = spans.ordinal[span] - x[owner]
        return Runs(owner[some], row[some], x_first[some], x_last[some], ordinal[some])

    def weight(self, ordinal: Ints, x_first: Ints, x_last: Ints) -> Ints:
        """Sum of the weights of runs."""
        if self.prefix is None:
            return (x_last - x_first + 1) * WEIGHT_FULL
        return np.asarray(self.prefix[ordinal + x_last + 1] - self.prefix[ordinal + x_first])
