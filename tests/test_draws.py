"""The random draws: the published mixer, every row on its own, uniform over the disc."""

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes.weapons.kinds import draws

GOLDEN_GAMMA = 0x9E3779B97F4A7C15
WRAP = 2**64
FEW = examples(60, deadline=None)

# First outputs of splitmix64: seed 1234567 as listed by Rosetta Code, seed 0 as in Java's SplittableRandom tests.
PUBLISHED = {
    1234567: [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821],
    0: [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F],
}

seeds = st.one_of(st.integers(0, 5), st.integers(0, WRAP - 1), st.just(WRAP - 1))
numbers = st.one_of(st.integers(0, 9), st.integers(0, 2**40))
counters = st.tuples(numbers, numbers, st.integers(0, 60))  # shot, round, pellet


def offsets(radius_256: int, seed, shot, round_, pellet) -> np.ndarray:
    """Draw for rows (n,), each of one pellet; the seed and the three counters are broadcast to one length."""
    rows = np.broadcast_arrays(*(np.atleast_1d(np.asarray(word, np.uint64)) for word in (seed, shot, round_, pellet)))
    turns, which = np.unique(np.stack(rows[:3], axis=1), axis=0, return_inverse=True)
    seed, *numbers = turns.T
    drawn = draws.disc_offsets(radius_256, seed, *(word.astype(np.int64) for word in numbers), int(rows[3].max()) + 1)
    return drawn[which.reshape(-1), rows[3].astype(np.int64)]


def chi_square(counts: np.ndarray) -> float:
    """Squared deviation from equal counts, in units of what is expected."""
    expected = counts.sum() / counts.size
    return float(((counts - expected) ** 2).sum() / expected)


def chi_square_limit(cells: int) -> float:
    """Give a value that chance passes about once in 30,000 times: mean and four standard deviations."""
    freedom = cells - 1
    return freedom + 4 * (2 * freedom) ** 0.5 + 6


def cell_of(drawn: np.ndarray, radius: int) -> np.ndarray:
    """Number the pixels of a disc (radius in px) from 0, in rows; fails for a pixel outside it."""
    index = np.full((2 * radius + 1, 2 * radius + 1), -1)
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    inside = x * x + y * y <= radius * radius
    index[inside] = np.arange(inside.sum())
    assert np.abs(drawn).max() <= radius
    cells = index[drawn[:, 1] + radius, drawn[:, 0] + radius]
    assert (cells >= 0).all()
    return cells


# mix64


@pytest.mark.parametrize("seed", PUBLISHED)
def test_mix64_gives_the_published_numbers(seed: int) -> None:
    states = [(seed + k * GOLDEN_GAMMA) % WRAP for k in range(1, len(PUBLISHED[seed]) + 1)]
    assert draws.mix64(np.array(states, dtype=np.uint64)).tolist() == PUBLISHED[seed]


def mix64_by_hand(z: int) -> int:
    """Follow splitmix64.c (Vigna, 2015) in Python integers."""
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % WRAP
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % WRAP
    return z ^ (z >> 31)


@FEW
@given(st.lists(st.integers(0, WRAP - 1), min_size=1, max_size=30))
def test_mix64_is_the_finaliser(values: list[int]) -> None:
    x = np.array(values, dtype=np.uint64)
    mixed = draws.mix64(x)
    assert mixed.dtype == np.uint64
    assert mixed.tolist() == [mix64_by_hand(v) for v in values]
    assert x.tolist() == values


# disc_offsets


@pytest.mark.parametrize("radius_256", [0, 1, 255])
def test_a_disc_of_one_pixel_has_no_choice(radius_256: int) -> None:
    assert offsets(radius_256, 3, np.arange(50), 0, 0).tolist() == [[0, 0]] * 50


def test_no_rows() -> None:
    none = np.zeros(0, np.int64)
    drawn = draws.disc_offsets(512, none.astype(np.uint64), none, none, 3)
    assert drawn.shape == (0, 3, 2)
    assert drawn.dtype == np.int64


@pytest.mark.parametrize("radius_256", [256, 361, 362, 363, 512, 1000, 22 * 256, 2**20, 2**28 - 1, 2**28])
def test_draws_stay_in_the_disc(radius_256: int) -> None:
    drawn = offsets(radius_256, 11, np.arange(2000), 0, 0)
    assert drawn.shape == (2000, 2)
    assert drawn.dtype == np.int64
    assert ((256 * drawn) ** 2).sum(axis=1).max() <= radius_256**2
    # and they use all of it, not a box or a disc within
    assert np.abs(256 * drawn).max() >= 0.9 * radius_256 - 256


@pytest.mark.parametrize("radius_256", [256, 362, 363, 512])
def test_every_pixel_of_the_disc_comes_up(radius_256: int) -> None:
    reach = range(-2, 3)
    disc = {(x, y) for x in reach for y in reach if (256 * x) ** 2 + (256 * y) ** 2 <= radius_256**2}
    assert {tuple(p) for p in offsets(radius_256, 11, np.arange(1000), 0, 0).tolist()} == disc


@FEW
@given(st.integers(0, 40 * 256), seeds, st.lists(counters, min_size=1, max_size=30), st.data())
def test_a_row_depends_on_itself_alone(radius_256: int, seed: int, rows: list[tuple[int, int, int]], data) -> None:
    whole = offsets(radius_256, seed, *np.array(rows, dtype=np.int64).T)
    order = data.draw(st.permutations(range(len(rows))))
    shuffled = offsets(radius_256, seed, *np.array(rows, dtype=np.int64)[list(order)].T)
    assert np.array_equal(shuffled, whole[list(order)])
    for i in order[:3]:
        assert np.array_equal(offsets(radius_256, seed, *rows[i])[0], whole[i])


@FEW
@given(st.integers(0, 40 * 256), st.lists(st.tuples(seeds, counters), min_size=1, max_size=30))
def test_rows_with_seeds_of_their_own(radius_256: int, rows: list[tuple[int, tuple[int, int, int]]]) -> None:
    whole = offsets(radius_256, np.array([s for s, _ in rows], np.uint64), *np.array([c for _, c in rows]).T)
    assert np.array_equal(whole, np.concatenate([offsets(radius_256, seed, *numbers) for seed, numbers in rows]))


def test_a_big_batch_can_be_fired_again_one_by_one() -> None:
    # many rows, so that some need many tries
    whole = offsets(5 * 256, 99, np.arange(20_000), 1, 2)
    for i in [0, 1, 4095, 4096, 8191, 8192, 12_345, 19_999]:
        assert np.array_equal(offsets(5 * 256, 99, i, 1, 2)[0], whole[i])
    assert np.array_equal(offsets(5 * 256, 99, np.arange(7000, 7300), 1, 2), whole[7000:7300])


@pytest.mark.parametrize("radius_256", [0, 256, 5 * 256, 5 * 256 + 99])
def test_a_few_draws_are_those_of_many(radius_256: int, monkeypatch: pytest.MonkeyPatch) -> None:
    turns = np.arange(30)
    rows = np.full(30, WRAP - 3, np.uint64), turns, turns % 3
    many = draws.disc_offsets(radius_256, *rows, 40)
    monkeypatch.setattr(draws, "FEW", 30 * 40)
    assert np.array_equal(draws.disc_offsets(radius_256, *rows, 40), many)
    assert np.array_equal(draws.disc_offsets(radius_256, *(row[7:8] for row in rows), 40), many[7:8])


@pytest.mark.parametrize("few", [0, 99])
def test_the_counters_are_left_alone(few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draws, "FEW", few)
    seed, shot, round_ = np.full(9, 5, np.uint64), np.arange(9), np.arange(9) % 3
    draws.disc_offsets(700, seed, shot, round_, 2)
    assert seed.tolist() == [5] * 9 and shot.tolist() == list(range(9)) and round_.tolist() == [0, 1, 2] * 3


N = 130_000
STREAMS = {
    "shot": lambda n: (7, n, 0, 0),
    "round": lambda n: (7, 0, n, 0),
    "pellet": lambda n: (7, 0, 0, n),
    "shot and pellet": lambda n: (7, n // 8, 0, n % 8),
    "far shot": lambda n: (7, n + 2**40, 0, 0),
    "strided shot": lambda n: (7, n * 256, 0, 0),
    "largest seed": lambda n: (WRAP - 1, n, 0, 0),
    "seed of the gamma": lambda n: (GOLDEN_GAMMA, n, 0, 0),
}


@pytest.mark.parametrize("stream", STREAMS)
def test_draws_are_uniform_over_the_disc(stream: str) -> None:
    counts = np.bincount(cell_of(offsets(512, *STREAMS[stream](np.arange(N))), 2), minlength=13)
    assert counts.size == 13
    assert chi_square(counts) < chi_square_limit(13)


@pytest.mark.parametrize("stream", STREAMS)
def test_neighbours_in_a_stream_do_not_follow_each_other(stream: str) -> None:
    cells = cell_of(offsets(512, *STREAMS[stream](np.arange(N))), 2)
    for step in (1, 8):
        pairs = np.bincount(cells[:-step] * 13 + cells[step:], minlength=169)
        assert chi_square(pairs) < chi_square_limit(169)


def test_each_key_has_a_stream_of_its_own() -> None:
    n = np.arange(N)
    base = (7, n, 0, 0)
    other_seeds = [(8, n, 0, 0), (7 + WRAP // 2, n, 0, 0)]
    other_counters = [(7, n, 1, 0), (7, n, 0, 1), (7, 0, n, 0), (7, 0, 0, n), (7, n + 1, 0, 0)]
    first = cell_of(offsets(512, *base), 2)
    for other in other_seeds + other_counters:
        pairs = np.bincount(first * 13 + cell_of(offsets(512, *other), 2), minlength=169)
        assert chi_square(pairs) < chi_square_limit(169), other


def test_counters_do_not_add_up() -> None:
    # a key that only sums its parts gives (1, 0, 0), (0, 1, 0) and (0, 0, 1) the same pellets
    keys = [(a, b, c) for a in range(4) for b in range(4) for c in range(4)]
    drawn = offsets(2**20, 7, *np.array(keys).T)
    assert len({tuple(p) for p in drawn.tolist()}) == len(keys)


@pytest.mark.parametrize("radius", [9, 100])
def test_larger_discs_are_filled_evenly(radius: int) -> None:
    x, y = offsets(256 * radius, 21, np.arange(N), 0, 0).T.astype(float)
    sector = ((np.arctan2(y, x) + np.pi / 12) % (2 * np.pi) // (np.pi / 6)).astype(int)
    away = (x != 0) | (y != 0)
    opposite = np.bincount(sector[away], minlength=12)
    # whole pixels make sectors unequal, but a turn by a half must not change them
    low, high = opposite[:6], opposite[6:]
    assert np.abs((low - high) / np.sqrt(low + high)).max() < 4.5
    deviation = (x * x + y * y).mean() - radius * radius / 2
    assert abs(deviation) < 4.5 * radius * radius / np.sqrt(12 * N) + radius
    assert abs(x.mean()) < 4.5 * radius / 2 / np.sqrt(N)
    assert abs(y.mean()) < 4.5 * radius / 2 / np.sqrt(N)
