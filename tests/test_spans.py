"""Spans: a set of pixels, however it was given, has one form."""

import itertools
import random
from typing import Any

import numpy as np
import oracle_raster as oracle
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import InputError
from hitplanes.planes.grid.spans import Spans, begins
from hitplanes.planes.volumes import fit

LAWS = examples(200, deadline=None)

Runs = list[tuple[int, int, int]]  # (y, x_first, x_last); x_first > x_last is an empty run

runs_near = st.lists(st.tuples(st.integers(-3, 3), st.integers(-8, 8), st.integers(-8, 8)), max_size=16)
runs_far = st.lists(
    st.tuples(
        st.integers(-3, 3).map(lambda y: y + 2**40),
        st.integers(-8, 8).map(lambda x: x - 2**40),
        st.integers(-8, 8).map(lambda x: x - 2**40),
    ),
    max_size=8,
)
any_runs = st.one_of(runs_near, runs_near, runs_far)


def make(runs: Runs) -> Spans:
    y, x_first, x_last = np.array(runs, dtype=np.int64).reshape(-1, 3).T
    return Spans.from_runs(y, x_first, x_last)


def pixel_set(spans: Spans) -> set[tuple[int, int]]:
    return oracle.pixel_set(spans.y, spans.x_first, spans.x_last)


def runs_of(runs: Runs) -> set[tuple[int, int]]:
    return oracle.pixel_set(*zip(*runs, strict=True)) if runs else set()


def check(spans: Spans, expected: set[tuple[int, int]]) -> None:
    """The pixels are these, and the runs are the one canonical way to write them."""
    assert pixel_set(spans) == expected
    columns = (spans.y, spans.x_first, spans.x_last)
    assert all(column.dtype == np.int64 and column.shape == (len(spans),) for column in columns)
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    assert all(first <= last for _, first, last in rows)
    for (y, _, last), (y_next, first_next, _) in itertools.pairwise(rows):
        assert y < y_next or (y == y_next and last + 1 < first_next), "unsorted, overlapping or adjacent runs"
    assert spans.count == len(expected)
    xs, ys = [x for x, _ in expected], [y for _, y in expected]
    assert spans.box_xyxy == ((min(xs), min(ys), max(xs), max(ys)) if expected else None)


@LAWS
@given(any_runs)
def test_runs_become_their_union(runs: Runs) -> None:
    check(make(runs), runs_of(runs))


@LAWS
@given(runs_near, st.randoms(use_true_random=False))
def test_order_and_repeats_do_not_matter(runs: Runs, rng: random.Random) -> None:
    shuffled = runs + runs[:3]
    rng.shuffle(shuffled)
    assert make(shuffled) == make(runs)


@LAWS
@given(any_runs)
def test_single_pixels_make_the_same_spans(runs: Runs) -> None:
    assert make([(y, x, x) for x, y in runs_of(runs)]) == make(runs)


def test_a_set_made_by_hand_is_checked_when_it_is_asked() -> None:
    some = Spans(np.array([3, 4]), np.array([1, 7]), np.array([2, 9]))
    assert some.count == 5 and some.box_xyxy == (1, 3, 9, 4) and some.union(some) == some
    assert Spans([3], [1], [2]).translated(2, -3).runs().tolist() == [[0, 3, 4]]  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^x_last\[1\]: expected at least x_first, 7, got 6$"):
        _ = Spans(np.array([3, 4]), np.array([1, 7]), np.array([2, 6])).count
    with pytest.raises(InputError, match=r"^dx: expected a whole number"):
        some.translated(0.5, 0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^spans: expected Spans, got list"):
        some.union([3])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("runs", "told"),
    [
        (([0], [1.5], [3]), r"^x_first\[0\]: expected a whole number .*, got 1.5"),
        ((np.zeros(2), np.zeros(3), np.zeros(3)), r"^x_first: expected shape \(2,\), got \(3,\)"),
        ((np.zeros(2, int), np.zeros(3, int), np.zeros(2, int)), r"^x_first: expected shape \(2,\), got \(3,\)"),
        ((["a"], [1], [3]), r"^y: expected numbers, got \['a'\]"),
        ((0, 1, 3), r"^y: expected shape \(any,\), got \(\)"),
        ((np.array([[0]]), np.array([[0]]), np.array([[0]])), r"^y: expected shape \(any,\), got \(1, 1\)"),
        (([0], [True], [3]), r"^x_first: expected numbers, got \[True\]"),
        (([2**50], [0], [3]), r"^y\[0\]: expected a whole number"),
    ],
)
def test_runs_are_of_whole_pixels(runs: Any, told: str) -> None:
    with pytest.raises(InputError, match=told):
        Spans.from_runs(*runs)
    with pytest.raises(InputError, match=told.replace("^", "^pixels: ")):
        fit.box(Spans(*runs))
    for ask in (lambda s: s.count, lambda s: s.box_xyxy, lambda s: s.translated(1, 0), lambda s: s.union(s)):
        with pytest.raises(InputError, match=told):
            ask(Spans(*runs))
    assert Spans.from_runs([4, 3], (7.0, 1), [9, 2]).runs().tolist() == [[3, 1, 2], [4, 7, 9]]  # type: ignore[arg-type]


def test_from_runs_leaves_its_input_alone() -> None:
    y, first, last = np.array([1, 0, 0]), np.array([5, 3, 0]), np.array([9, 4, 2])
    Spans.from_runs(y, first, last)
    assert (y.tolist(), first.tolist(), last.tolist()) == ([1, 0, 0], [5, 3, 0], [9, 4, 2])


def test_touching_runs_are_one_run() -> None:
    spans = make([(0, 3, 5), (0, 0, 2), (1, 6, 7), (0, 7, 7), (0, 9, 8)])
    assert (spans.y.tolist(), spans.x_first.tolist(), spans.x_last.tolist()) == ([0, 0, 1], [0, 7, 6], [5, 7, 7])
    assert len(spans) == 3
    assert spans.count == 9
    assert spans.box_xyxy == (0, 0, 7, 1)


def test_the_end_of_a_row_does_not_touch_the_start_of_the_next() -> None:
    spans = make([(0, 0, 3), (1, 4, 6), (2, 0, 0)])
    check(spans, {(0, 0), (1, 0), (2, 0), (3, 0), (4, 1), (5, 1), (6, 1), (0, 2)})


def test_a_long_run_swallows_later_short_ones() -> None:
    check(make([(0, 0, 9), (0, 1, 2), (0, 4, 5), (0, 8, 10)]), {(x, 0) for x in range(11)})


def test_empty() -> None:
    for spans in (Spans.empty(), make([]), make([(0, 1, 0)]), Spans.from_mask(np.zeros((3, 4), bool))):
        check(spans, set())
        assert len(spans) == 0
        assert spans == Spans.empty()
        assert spans.pixels().shape == (0, 2)
        assert not spans.to_mask()[0].any()
        assert spans.translated(3, -4) == Spans.empty()
        assert spans.union(spans) == Spans.empty()


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (5, 0)])
def test_a_mask_without_pixels(shape: tuple[int, int]) -> None:
    check(Spans.from_mask(np.zeros(shape, bool), origin_xy=(3, 4)), set())


widths = st.sampled_from([1, 2, 7, 63, 64, 65, 129])
masks = st.tuples(st.integers(1, 6), widths, st.integers(0, 2**32 - 1), st.floats(0, 1))


@LAWS
@given(masks, st.tuples(st.integers(-99, 99), st.integers(-99, 99)))
def test_masks_come_and_go(parts: tuple[int, int, int, float], origin: tuple[int, int]) -> None:
    height, width, seed, density = parts
    mask = np.random.default_rng(seed).random((height, width)) < density
    before = mask.copy()
    spans = Spans.from_mask(mask, origin_xy=origin)
    expected = {(x + origin[0], y + origin[1]) for y in range(height) for x in range(width) if mask[y, x]}
    check(spans, expected)
    assert np.array_equal(mask, before)
    back, (x0, y0) = spans.to_mask()
    assert back.dtype == bool
    assert {(int(x) + x0, int(y) + y0) for y, x in zip(*np.nonzero(back), strict=True)} == expected
    assert Spans.from_mask(back, origin_xy=(x0, y0)) == spans


def test_a_mask_starts_at_the_origin_unless_told() -> None:
    check(Spans.from_mask(np.array([[0, 1, 1], [1, 0, 1]], dtype=bool)), {(1, 0), (2, 0), (0, 1), (2, 1)})


def test_a_strided_mask_is_read_as_it_looks() -> None:
    mask = np.arange(60).reshape(6, 10) % 3 == 0
    for view in (mask[::-1], mask[:, ::-2], mask.T, mask[1:5, 2:9]):
        assert Spans.from_mask(view) == Spans.from_mask(view.copy())


def test_to_mask_fits_the_box() -> None:
    mask, origin = make([(2, -5, -3), (4, -4, 1)]).to_mask()
    assert tuple(origin) == (-5, 2)
    assert mask.astype(int).tolist() == [[1, 1, 1, 0, 0, 0, 0], [0] * 7, [0, 1, 1, 1, 1, 1, 1]]


@LAWS
@given(any_runs)
def test_pixels_are_listed_by_row_then_column(runs: Runs) -> None:
    listed = make(runs).pixels()
    assert listed.dtype == np.int64
    assert [tuple(p) for p in listed.tolist()] == sorted(runs_of(runs), key=lambda p: (p[1], p[0]))


@LAWS
@given(runs_near, st.integers(-(2**40), 2**40), st.integers(-(2**40), 2**40))
def test_translated(runs: Runs, dx: int, dy: int) -> None:
    spans = make(runs)
    check(spans.translated(dx, dy), {(x + dx, y + dy) for x, y in runs_of(runs)})
    check(spans, runs_of(runs))
    assert spans.translated(dx, dy).translated(-dx, -dy) == spans


@LAWS
@given(any_runs, any_runs)
def test_union(one: Runs, other: Runs) -> None:
    a, b = make(one), make(other)
    check(a.union(b), runs_of(one) | runs_of(other))
    assert a.union(b) == b.union(a)
    check(a, runs_of(one))
    check(b, runs_of(other))
    assert a.union(a) == a
    assert a.union(Spans.empty()) == a


@LAWS
@given(any_runs, any_runs)
def test_equal_when_the_pixels_are(one: Runs, other: Runs) -> None:
    same = runs_of(one) == runs_of(other)
    assert (make(one) == make(other)) is same
    assert (make(one) != make(other)) is not same


def test_unequal_by_one_pixel() -> None:
    spans = make([(0, 0, 4), (1, 2, 3)])
    for other in ([(0, 0, 4)], [(0, 0, 4), (1, 2, 4)], [(0, 0, 4), (1, 1, 3)], [(0, 0, 4), (2, 2, 3)], []):
        assert spans != make(other)


@given(st.lists(st.integers(-3, 3)))
def test_where_groups_begin(group: list[int]) -> None:
    assert begins(np.array(group, np.int64)).tolist() == [i == 0 or group[i - 1] != g for i, g in enumerate(group)]
