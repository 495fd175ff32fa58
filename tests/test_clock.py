"""Fixed steps under any rate of pictures."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import FixedStep, InputError, Projectile, Scene, fire

SECOND = 10**9


@given(st.integers(1, 10**5), st.lists(st.integers(0, 3 * SECOND), max_size=30))
def test_steps_depend_on_the_sum_of_the_times_alone(rate: int, nanoseconds: list[int]) -> None:
    clock, total = FixedStep(rate), sum(nanoseconds)
    steps = sum(len(clock.advance(ns / SECOND)) for ns in nanoseconds)
    assert steps == clock.tick == total * rate // SECOND
    assert clock.fraction == total * rate % SECOND / SECOND
    assert clock.dropped == 0


@given(st.integers(1, 10**9), st.floats(0, 10**6))
def test_the_part_that_is_left_is_less_than_a_step(rate: int, elapsed: float) -> None:
    clock = FixedStep(rate)
    steps = len(clock.advance(elapsed))
    assert 0 <= clock.fraction < 1
    assert (steps + clock.fraction) / rate == pytest.approx(elapsed, abs=0.6 / SECOND, rel=1e-15)


@given(st.integers(1, 50), st.lists(st.integers(0, SECOND // 4), max_size=30))
def test_a_limit_drops_whole_steps_and_tells(most: int, nanoseconds: list[int]) -> None:
    clock, free = FixedStep(60, most=most), FixedStep(60)
    for ns in nanoseconds:
        due = len(free.advance(ns / SECOND))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            assert len(clock.advance(ns / SECOND)) == min(due, most)
        over = due - min(due, most)
        messages = [str(warning.message) for warning in told]
        assert messages == (
            [f"FixedStep: dropped {over} of {due} steps that were due at tick {clock.tick}"] if over else []
        )
    assert clock.tick + clock.dropped == free.tick
    assert clock.fraction == free.fraction


def test_a_warning_names_the_line_that_called() -> None:
    with pytest.warns(RuntimeWarning, match="dropped 230 of 240 steps that were due at tick 10") as told:
        FixedStep(240, most=10).advance(1)
    assert told[0].filename == __file__


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (0, "rate_hz: expected a whole number from 1 to 1000000000, got 0"),
        (59.94, "rate_hz: expected a whole number from 1 to 1000000000, got 59.94"),
        (True, "rate_hz: .* got True"),
        ("60", "rate_hz: .* got '60'"),
        (None, "rate_hz: .* got None"),
    ],
)
def test_a_bad_rate_is_named(rate: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        FixedStep(rate)  # type: ignore[arg-type]


@pytest.mark.parametrize("most", [0, -1, 1.5, "2", True])
def test_a_bad_limit_is_named(most: object) -> None:
    with pytest.raises(InputError, match="most: expected a whole number from 1 to"):
        FixedStep(60, most=most)  # type: ignore[arg-type]


@pytest.mark.parametrize("elapsed", [-1e-3, math.nan, math.inf, 2e6, "1", None, True, [1.0], 10**400])
def test_a_bad_time_is_named_and_changes_nothing(elapsed: object) -> None:
    clock = FixedStep(60)
    clock.advance(0.12)
    before = clock.tick, clock.fraction
    with pytest.raises(InputError, match="elapsed_s: expected"):
        clock.advance(elapsed)  # type: ignore[arg-type]
    assert (clock.tick, clock.fraction) == before


@pytest.mark.parametrize("elapsed", [1, 1.0, np.float32(1), np.int64(1)])
def test_any_kind_of_number_is_a_time(elapsed: float) -> None:
    assert FixedStep(60).advance(elapsed) == range(60)


def flown(pictures_a_second: float, jitter: float = 0) -> list[tuple[int, int, tuple[int, int], float]]:
    """Fly a projectile for half a second at 240 steps a second; what it hits at which tick, where, and when.

    Targets are 1 px wide, and it flies 3 px a step; it goes on through what it hits.
    """
    rng = np.random.default_rng(1)
    scene = Scene()
    for x in range(40, 360, 31):
        scene.add(np.ones((9, 1), np.bool_), (x + 0.25, 7))
    clock, found = FixedStep(240), []
    velocity, start = np.array((240 * (3 + 17 / 256), 0)), np.array((5, 6.5))
    shell = Projectile(velocity[0] / 240, 0.75, inside="ignore_until_exit")
    left = 0.5
    while left > 0:
        passed = min(left, (1 + jitter * rng.uniform(-1, 1)) / pictures_a_second)
        left -= passed
        for tick in clock.advance(passed):
            hits = fire(scene, shell, start + tick * velocity / 240)
            found += [(tick, row.object, row.first_xy, float(hits.passes.entry[0])) for row in hits]
    return found


def test_a_projectile_hits_the_same_at_the_same_ticks_under_any_rate_of_pictures() -> None:
    expected = flown(60)
    assert len(expected) == 11
    assert sorted(row[1] for row in expected) == list(range(11))
    for pictures, jitter in ((30, 0), (144, 0), (7, 0), (90, 0.9)):
        assert flown(pictures, jitter) == expected
