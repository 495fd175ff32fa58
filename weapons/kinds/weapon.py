"""The base of all weapons, whose fields are checked by a table, and patterns of pixels, as spans and as bit rows."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar
from weakref import ref

import numpy as np
import numpy.typing as npt

from hitplanes.planes.bits import bit_rows
from hitplanes.planes.bits.bit_rows import NO_SUMS, WORD, PatternBits, Sums, Words, columns_of, words_of
from hitplanes.planes.bits.span_walk import Runs
from hitplanes.planes.bits.tiles import BigPattern, Depths, big_pattern, stride_of
from hitplanes.planes.common.backend import LruCache, in_parts, jit_is_on, kernels_of
from hitplanes.planes.common.checks import InputError, Ints, kind_of, shown
from hitplanes.planes.common.limits import MASK_AREA_MAX, REACH_MAX, SUB, WEIGHT_FULL
from hitplanes.planes.common.tables import Number, Ref, Value
from hitplanes.planes.grid import fixed_point
from hitplanes.planes.grid.fixed_point import ONE
from hitplanes.planes.grid.spans import NO_STRIPS, WIDEST, RowRuns, Spans, Strip, ragged, strip_of, strips_of

if TYPE_CHECKING:
    from .areas import AreaWeapon

Kind = TypeVar("Kind", bound=np.generic)

LENGTH = Number(0, REACH_MAX)
"""A length that a weapon may have, px."""


@dataclass(frozen=True)
class Part(Ref):
    """A field that holds a weapon, already made from its JSON."""

    kinds: tuple[type, ...]
    expected: str

    def check(self, name: str, value: object) -> object:
        """Check that the value is a weapon of one of the kinds."""
        if not isinstance(value, self.kinds):
            got = kind_of(value) if isinstance(value, type) else shown(value)
            raise InputError(f"{name}: expected {self.expected}, got {got}")
        return value


@dataclass(frozen=True, eq=False, repr=False)
class Weapon:
    """The base of all weapons; two weapons are equal when their JSON is equal."""

    kind: ClassVar[str] = ""
    table: ClassVar[dict[str, Value]]

    def __post_init__(self) -> None:
        """Check every field by the table, and keep plain Python values."""
        for name, value in self.table.items():
            self._keep(name, value.check(name, getattr(self, name)))

    @cached_property
    def text(self) -> str:
        """The weapon as JSON text; equal weapons have equal text."""
        return json.dumps(self.to_json(), sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Weapon) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __repr__(self) -> str:
        """The fields that are not at their defaults; those that have none come first, as they are given first."""
        ordered = sorted(fields(self), key=lambda f: f.default is not MISSING)
        told = [(f.name, getattr(self, f.name), f.default) for f in ordered]
        texts = [f"{name}={shown(value)}" for name, value, default in told if value != default]
        return f"{type(self).__name__}({', '.join(texts)})"

    def _keep(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def __getstate__(self) -> dict[str, Any]:
        """The fields, for copies; a copy computes its cached values anew."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def to_json(self) -> dict[str, Any]:
        """The weapon as a scene file has it; fields at their defaults are left out."""
        shown: dict[str, Any] = {"kind": self.kind}
        for f in fields(self):
            value = getattr(self, f.name)
            if f.default is MISSING or value != f.default:
                shown[f.name] = _plain_json(value)
        return shown


def _plain_json(value: object) -> Any:
    if isinstance(value, Weapon):
        return value.to_json()
    if isinstance(value, tuple | list):
        return [_plain_json(v) for v in value]
    return value


Swept = tuple[Ints, Ints, int]
"""Ends (2,) of a segment and a radius, in 1/256 px."""

FALLOFFS = ("linear", "smooth")

PATTERN_BYTES = 2048
"""Memory of a pattern beside its columns, bytes."""

_DOUBT = 2.0**-30  # the float is exact to 2**-34; if it is nearer than this to a whole number, integers decide


@dataclass(frozen=True, eq=False)
class Pattern:
    """A set of pixels about the origin, and prefix sums of their weights in span order (None: all at full weight).

    `swept` is the segment that the pixels lie along, if the weapon has one: each pixel's centre lies within the radius
    of the segment, or its square meets it.
    """

    spans: Spans
    prefix: Ints | None
    swept: Swept | None = None

    @cached_property
    def window_bytes(self) -> int:
        """Memory of its bit rows, and of the sums of its weights, bytes."""
        x, y, x_max, y_max = self.spans.box_xyxy or (0, 0, -1, -1)
        return _window_bytes(x_max - x + 1, y_max - y + 1, self.prefix is not None)

    @cached_property
    def strip(self) -> Strip:
        """The strip between two parallel lines that its pixels lie in."""
        return strip_of(self.spans)

    @cached_property
    def normal(self) -> tuple[int, int] | None:
        """Normal of its strip; None if strips would not pay, taken over all directions that it may be turned to."""
        a, b, low, high = self.strip
        x, y, x_max, y_max = self.spans.box_xyxy or (0, 0, 0, 0)
        side, along = (x_max - x + y_max - y) * 2 / math.pi, math.hypot(a, b) * 2 / math.pi  # the means of them
        pays = len(strips_of(np.array([[along, along, low, high]]), np.array([[0, 0, side, side]])))
        return (a, b) if pays else None

    @property
    def table(self) -> PatternTable:
        """A table of this one pattern.

        The pattern keeps the table's columns, not the table: a reference cycle would outlive its place in a cache.
        """
        return PatternTable((self,))

    @cached_property
    def sizes(self) -> tuple[Ints, Ints]:
        """Pixel count (1,) and box (1, 4), as columns of a table."""
        return _sizes([self.spans])

    @cached_property
    def columns(self) -> TableSpans:
        """Spans, as columns of a table."""
        return _columns([self.spans], 0)

    @property
    def nbytes(self) -> int:
        """Bytes that it holds, including values computed later: two more columns of spans, and small objects."""
        return 5 * self.spans.y.nbytes + (0 if self.prefix is None else self.prefix.nbytes) + PATTERN_BYTES


def make_pattern(spans: Spans, falloff: str | None, reach_256: int, swept: Swept | None = None) -> Pattern:
    """Make a pattern; with a falloff its pixels are weighted by their distance from the origin."""
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
    """Weights of a falloff, from those of the linear one."""
    if falloff == "smooth":
        return linear * linear * (3 * WEIGHT_FULL - 2 * linear) // WEIGHT_FULL**2
    return linear


class TableSpans(NamedTuple):
    """Spans of several patterns, one after another, as columns.

    Parameters
    ----------
    y, x_first, x_last : (n,) the spans
    ordinal : (n,) number of the span's first pixel in the prefix sums, minus its `x_first`
    row : (n,) a number that rises with (pattern, y); a search in it finds the spans of a range of rows
    top, rows : the least y, and the number of rows
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


TABLE_BYTES = 40
"""Bytes of a pattern's count and box in a table."""


class PatternTable:
    """The distinct patterns of a call; their spans are joined when they are first read.

    Parameters
    ----------
    patterns : n patterns
    """

    def __init__(self, patterns: Sequence[Pattern]) -> None:
        self.patterns = patterns

    def __len__(self) -> int:
        return len(self.patterns)

    @cached_property
    def count(self) -> Ints:
        """Pixels (n,) of each."""
        return self.patterns[0].sizes[0] if len(self) == 1 else _sizes([p.spans for p in self.patterns])[0]

    @cached_property
    def box_xyxy(self) -> Ints:
        """Boxes (n, 4), inclusive; x_max < x_min for an empty pattern."""
        return self.patterns[0].sizes[1] if len(self) == 1 else _sizes([p.spans for p in self.patterns])[1]

    @property
    def fits(self) -> bool:
        """Whether the bit rows of all patterns are small enough to be made together."""
        return fits(self.patterns)

    @property
    def bigs(self) -> list[BigPattern]:
        """All patterns as integer rows; those of the last calls are kept."""
        return [big_of(pattern) for pattern in self.patterns]

    @property
    def bits(self) -> PatternBits:
        """Bit rows of all patterns; those of the last calls are kept."""
        return pattern_bits_of(self.patterns)

    def only_big(self) -> BigPattern:
        """The only pattern as integer rows."""
        return self.bigs[0]

    def only_bits(self) -> PatternBits:
        """Bit rows of the only pattern, without its strip."""
        return self.bits._replace(strips=NO_STRIPS)

    @cached_property
    def prefix(self) -> Ints | None:
        """Prefix sums of the weights of all patterns; None if all have full weight."""
        prefixes = [p.prefix for p in self.patterns if p.prefix is not None]
        return _joined(prefixes) if prefixes else None

    @cached_property
    def spans(self) -> TableSpans:
        """Spans of all patterns."""
        if len(self.patterns) == 1:
            return self.patterns[0].columns
        return _columns([p.spans for p in self.patterns], 0 if self.prefix is None else 1)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns of patterns, without spans and weights."""
        return TABLE_BYTES * len(self)

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
        mask = x_first <= x_last
        row = spans.y[span] + y[owner]
        ordinal = spans.ordinal[span] - x[owner]
        return Runs(owner[mask], row[mask], x_first[mask], x_last[mask], ordinal[mask])

    def weight(self, ordinal: Ints, x_first: Ints, x_last: Ints) -> Ints:
        """Sum of the weights of runs."""
        if self.prefix is None:
            return (x_last - x_first + 1) * WEIGHT_FULL
        return np.asarray(self.prefix[ordinal + x_last + 1] - self.prefix[ordinal + x_first])


class AimedTable(PatternTable):
    """Patterns of a weapon along several directions; their bit rows are made all at once, and patterns when read.

    Parameters
    ----------
    direction : (n, 2) cos and sin times 2**30
    make : function of a weapon, cos and sin that returns a pattern
    """

    def __init__(self, weapon: AreaWeapon, direction: Ints, make: Callable[[AreaWeapon, int, int], Pattern]) -> None:
        self._weapon, self._direction, self._make = weapon, direction, make
        self._side = 2 * -(-weapon.reach_256 // SUB) + 3  # rows and columns of a pattern, at most

    def __len__(self) -> int:
        return len(self._direction)

    @cached_property
    def patterns(self) -> Sequence[Pattern]:  # type: ignore[override]
        """All patterns."""
        return [self._make(self._weapon, c, s) for c, s in self._direction.tolist()]

    @cached_property
    def count(self) -> Ints:
        """Pixels (n,) of each."""
        return bit_rows.pixels_of_patterns(self.bits)

    @cached_property
    def box_xyxy(self) -> Ints:
        """Boxes (n, 4), inclusive; x_max < x_min for an empty pattern."""
        return self.bits.box_xyxy

    @property
    def fits(self) -> bool:
        """Whether the bit rows of all patterns are small enough to be made together."""
        return (
            len(self) * _window_bytes(self._side, self._side, self._weapon.falloff is not None) <= PATTERNS_BYTES_MOST
        )

    @cached_property
    def bits(self) -> PatternBits:
        """Bit rows of all patterns; those of the last calls are kept."""
        return _kept_aims.get((self._weapon.text, self._direction.tobytes()), self._rasterized)

    @property
    def bigs(self) -> list[BigPattern]:
        """All patterns as integer rows; those of the last calls are kept."""
        keys = ((self._weapon.text, direction.tobytes()) for direction in self._direction)
        return [_kept_bigs.get(key, lambda k=k: big_of_bits(self.bits, k)) for k, key in enumerate(keys)]  # type: ignore[misc]

    def only_big(self) -> BigPattern:
        """The only pattern as integer rows, which are not kept: a ready weapon keeps what it looks up."""
        weapon, runs = self._weapon, self._weapon.runs(self._direction)
        if runs is None:
            return super().only_big()
        big = big_of_runs(runs)
        if weapon.falloff is None or not big.rows:
            return big
        box = np.array([(big.x, big.y, big.x + big.wide - 1, big.y + big.high - 1)])
        return big.weighted(_sums_in(box, weapon.falloff, weapon.reach_256)[0])

    def only_bits(self) -> PatternBits:
        """Bit rows of the only pattern, without its strip, which are not kept."""
        runs = self._weapon.runs(self._direction)
        bits = None if runs is None else kernels_of(bit_rows).bits_of_runs(runs, 1, NO_NORMALS)
        return super().only_bits() if bits is None else self._weighted(bits)

    def _weighted(self, bits: PatternBits) -> PatternBits:
        """Add the sums of weights along rows, if the weapon has a falloff."""
        if self._weapon.falloff is None:
            return bits
        parts = _sums_in(bits.box_xyxy, self._weapon.falloff, self._weapon.reach_256)
        size = np.array([part.size for part in parts])
        return bits._replace(sums=_joined(parts), first_sum=np.cumsum(size) - size)

    def _rasterized(self) -> PatternBits:
        at_once = max(ROWS_AT_ONCE // self._side, 1)
        parts = list(chain(*in_parts(len(self), at_once if jit_is_on() else len(self), self._parts)))
        made = [part for part in parts if part is not None]
        if len(made) < len(parts):
            return _made(self.patterns)
        return self._weighted(made[0] if len(made) == 1 else _one_after_another(made))

    def _parts(self, first: int, last: int) -> list[PatternBits | None]:
        """Bit rows of patterns `first` .. `last` - 1, some at a time; None of those that must be made one by one."""
        normal, at_once = self._make(self._weapon, ONE, 0).normal, max(ROWS_AT_ONCE // self._side, 1)
        parts: list[PatternBits | None] = []
        for begin in range(first, last, at_once):
            direction, normals = self._direction[begin : min(begin + at_once, last)], NO_NORMALS
            runs = self._weapon.runs(direction)
            if runs is not None and normal:
                normals = kernels_of(fixed_point).turned_to(np.array([normal]), direction)[:, 0]
            parts.append(None if runs is None else kernels_of(bit_rows).bits_of_runs(runs, len(direction), normals))
        return parts


def _one_after_another(parts: Sequence[PatternBits]) -> PatternBits:
    """Bit rows of all patterns of several parts."""
    begin = np.cumsum([0, *(len(part.words) for part in parts[:-1])]).tolist()
    moved = [part._replace(first=part.first + at) for part, at in zip(parts, begin, strict=True)]
    return PatternBits(*map(np.concatenate, zip(*moved, strict=True)))


def _sums_in(boxes_xyxy: Ints, falloff: str, reach_256: int) -> list[Sums]:
    """Sums of weights along the rows of boxes; they depend on the place alone, so those of all are of one table."""
    every = _kept_sums.get((falloff, reach_256), lambda: _sums_around(falloff, reach_256))
    boxes = (boxes_xyxy + len(every) // 2).tolist()
    return [every[y : y_max + 1, x : x_max + 2].reshape(-1) for x, y, x_max, y_max in boxes]


def _sums_around(falloff: str, reach_256: int) -> Sums:
    """Sums of weights along the rows around the origin, modulo 2**32, as far as a pattern reaches, and 1 px more."""
    far = -(-reach_256 // SUB) + 1
    side = np.arange(-far, far + 1)
    weights = falloff_weights((side[:, None] ** 2 + side**2).reshape(-1), falloff, reach_256)
    sums = np.zeros((len(side), len(side) + 1), np.uint32)
    np.cumsum(weights.reshape(len(side), -1), axis=1, dtype=np.uint32, out=sums[:, 1:])
    return sums


def _joined(columns: Sequence[npt.NDArray[Kind]]) -> npt.NDArray[Kind]:
    """Columns one after another; a single one is not copied."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def _sizes(spans: Sequence[Spans]) -> tuple[Ints, Ints]:
    """Pixels (n,) and boxes (n, 4) of patterns."""
    boxes = [s.box_xyxy or (0, 0, -1, -1) for s in spans]
    return np.array([s.count for s in spans], np.int64), np.array(boxes, np.int64)


def _columns(spans: Sequence[Spans], first: int) -> TableSpans:
    """Spans of patterns, one after another; the prefix sums of each pattern begin with `first` zeros."""
    y, x_first, x_last = (_joined([getattr(s, side) for s in spans]) for side in ("y", "x_first", "x_last"))
    pattern = np.repeat(np.arange(len(spans)), [len(s) for s in spans])
    lengths = x_last - x_first + 1
    ordinal = np.cumsum(lengths) - lengths - x_first + first * pattern
    top = int(y.min(initial=0))
    rows = int(y.max(initial=0)) - top + 1
    return TableSpans(y, x_first, x_last, ordinal, pattern * (rows + 2) + y - top, top, rows)


PATTERN_BYTES_MOST = 2**25
"""Largest bit rows of a pattern, with the sums of its weights, bytes; larger patterns are counted by spans."""

PATTERNS_BYTES_MOST = 2**26
"""Largest bit rows of all patterns of a call, bytes."""

WINDOW_CACHE_BYTES = 2**26
"""Size of the caches of bit rows, of their columns of words, and of integer rows, bytes each."""

ENTRY_BYTES = 1024
"""Memory of a cache entry beside its arrays, bytes."""

KEY_BYTES = 128
"""Memory of a pattern in a cache key, bytes; it is a weak reference, so the pattern may go first."""


def _bytes(windows: PatternBits) -> int:
    return ENTRY_BYTES + sum(column.nbytes for column in windows if isinstance(column, np.ndarray))


NO_NORMALS = np.zeros((0, 2), np.int64)

ROWS_AT_ONCE = 2**16
"""Most rows of patterns that are rasterized at a time: 512 KB for each of their columns."""

_kept: LruCache[tuple[ref[Pattern], ...], PatternBits] = LruCache(
    WINDOW_CACHE_BYTES, _bytes, lambda key: KEY_BYTES * len(key)
)

_kept_aims: LruCache[tuple[str, bytes], PatternBits] = LruCache(
    WINDOW_CACHE_BYTES, _bytes, lambda key: len(key[0]) + len(key[1])
)

_kept_sums: LruCache[tuple[str, int], Sums] = LruCache(WINDOW_CACHE_BYTES, lambda sums: sums.nbytes)

_kept_columns: LruCache[ref[Pattern], Words] = LruCache(WINDOW_CACHE_BYTES, lambda words: words.nbytes + ENTRY_BYTES)

_kept_bigs: LruCache[ref[Pattern] | tuple[str, bytes], BigPattern] = LruCache(
    WINDOW_CACHE_BYTES, lambda big: big.nbytes + ENTRY_BYTES
)


def _window_bytes(wide: int, high: int, weighted: bool) -> int:
    return 4 * weighted * high * (wide + 1) + 8 * (WORD + ((wide - 1) // WORD + 3) * (high + WORD))


def fits_at_reach(reach: int, weighted: bool) -> bool:
    """Whether the bit rows of a pattern that reaches so many px are small enough at any aim."""
    return _window_bytes(2 * reach + 3, 2 * reach + 3, weighted) <= PATTERN_BYTES_MOST


def fits(patterns: Sequence[Pattern]) -> bool:
    """Whether the bit rows of patterns are small enough to be made together."""
    sizes = [pattern.window_bytes for pattern in patterns]
    return max(sizes, default=0) <= PATTERN_BYTES_MOST and sum(sizes) <= PATTERNS_BYTES_MOST


def pattern_bits_of(patterns: Sequence[Pattern]) -> PatternBits:
    """Bit rows of patterns; those of the last calls are kept."""
    return _kept.get(tuple(map(ref, patterns)), lambda: _made(patterns))


def big_of(pattern: Pattern) -> BigPattern:
    """A pattern as integer rows; those of the last calls are kept."""

    def make() -> BigPattern:
        big = big_pattern(pattern.spans)
        if pattern.prefix is None or not len(pattern.spans):
            return big
        return big.weighted(sums_along_rows(pattern.spans, pattern.prefix))

    return _kept_bigs.get(ref(pattern), make)


def big_of_bits(bits: PatternBits, k: int) -> BigPattern:
    """Pattern k of several as integer rows; the last column of words is empty."""
    x, y, x_max, y_max = bits.box_xyxy[k].tolist()
    stride, high, step = stride_of(x_max - x + 1), y_max - y + 1, bits.rows.item(k)
    first = bits.first.item(k)
    columns = [bits.words[first + c * step : first + c * step + high] for c in range(stride // WORD)]
    rows = int.from_bytes(np.stack(columns, axis=1).astype("<u8", copy=False).tobytes(), "little") >> WORD - 1
    big = BigPattern(x, y, x_max - x + 1, high, stride, rows, Depths(rows, stride, x, y))
    return big.weighted(bits.sums[bits.first_sum[k] :]) if len(bits.sums) else big


def big_of_runs(runs: RowRuns) -> BigPattern:
    """The runs of a single shape as integer rows."""
    ends = np.asarray(runs.parts)
    first, last, filled = ends[:, 0], ends[:, 1], ends[:, 0] <= ends[:, 1]
    x, x_max = int(first.min(where=filled, initial=WIDEST)), int(last.max(where=filled, initial=-WIDEST))
    if x > x_max:
        return big_pattern(Spans.empty())
    stride = stride_of(x_max - x + 1)
    words: Words = np.bitwise_or.reduce(words_of(ends, x + WORD * np.arange(stride // WORD)), axis=0)
    rows = int.from_bytes(words.astype("<u8", copy=False).tobytes(), "little")
    empty = ((rows & -rows).bit_length() - 1) // stride  # rows before the first that has a pixel
    y, rows = runs.y.item(0) + empty, rows >> empty * stride
    high = (rows.bit_length() - 1) // stride + 1
    return BigPattern(x, y, x_max - x + 1, high, stride, rows, Depths(rows, stride, x, y))


def _made(patterns: Sequence[Pattern]) -> PatternBits:
    boxes = np.array([pattern.spans.box_xyxy or (0, 0, -1, -1) for pattern in patterns])
    strips = strips_of([pattern.strip for pattern in patterns], boxes)
    columns = [_pattern_words(pattern) for pattern in patterns]
    rows = np.array([words.shape[1] for words in columns])
    first = np.cumsum([0, *(words.size for words in columns[:-1])]) + WORD
    sums = [sums_along_rows(pattern.spans, pattern.prefix) for pattern in patterns if pattern.prefix is not None]
    first_sum = np.cumsum([0, *(table.size for table in sums[:-1])])
    words = np.concatenate([np.zeros(WORD, np.uint64), *(words.reshape(-1) for words in columns)])
    return PatternBits(boxes, first, rows, words, strips, _joined(sums) if sums else NO_SUMS, first_sum)


def sums_along_rows(spans: Spans, prefix: Ints) -> Sums:
    """Sums of the weights along each row of a pattern's box, from 0 on, modulo 2**32, row after row.

    Parameters
    ----------
    prefix : prefix sums of the weights of its pixels, in span order
    """
    x, y, x_max, y_max = spans.box_xyxy or (0, 0, -1, -1)
    weights = np.zeros((y_max - y + 1, x_max - x + 2), np.uint32)
    xy = spans.pixels()
    weights[xy[:, 1] - y, xy[:, 0] - x + 1] = np.diff(prefix)
    return np.cumsum(weights, axis=1, dtype=np.uint32).reshape(-1)


def _pattern_words(pattern: Pattern) -> Words:
    """`columns_of` a pattern, kept for calls that have it together with other patterns."""
    return _kept_columns.get(ref(pattern), lambda: columns_of(pattern.spans))
