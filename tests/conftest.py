"""What several tests share."""

import os
import signal
from collections.abc import Iterator
from functools import cache

import pytest
from examples import ALL, SOME
from hypothesis import is_hypothesis_test, settings

from hitplanes import use_jit, warm_up
from hitplanes.planes.common import backend, costs

if os.name == "nt":
    collect_ignore = ["test_bad_files.py", "test_record.py", "test_stream.py"]  # they set limits, which Windows lacks


settings.register_profile("all", max_examples=ALL)
settings.register_profile("some", max_examples=SOME)


def whole(config: pytest.Config) -> bool:
    """Whether long tests are asked for, and so every example of a property test."""
    return config.option.markexpr != "not long"


def pytest_configure(config: pytest.Config) -> None:
    settings.load_profile("all" if whole(config) else "some")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Property tests belong to the long run, too, which draws all their examples."""
    for item in items:
        if whole(config) and is_hypothesis_test(getattr(item, "obj", None)):
            item.add_marker(pytest.mark.long)


class HangError(BaseException):
    """Nothing of the project catches it."""


@pytest.fixture
def bounded() -> Iterator[None]:
    """No test that uses this takes longer, whatever is read or given."""

    if not hasattr(signal, "SIGALRM"):  # Windows: a job that hangs ends by its own limit
        yield
        return

    def ring(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, 20)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


@cache
def all_compiled() -> None:
    """Compile what is not on disk, so that no plan tells that its call did."""
    warm_up()
    backend.news()


@pytest.fixture(params=[False, True])
def jit(request: pytest.FixtureRequest) -> Iterator[bool]:
    """Whether compiled kernels are used for all calls of a test: once without, once with."""
    if request.param:
        pytest.importorskip("numba")
        all_compiled()
    use_jit(request.param)
    yield request.param
    use_jit(None)


@pytest.fixture
def fixed_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Round costs instead of those that were measured last, for tests that count when a way pays."""
    both = {
        "tiles_near": 0, "visible_near": 0,
        "visible_tile": 2500, "labels_call": 300_000, "labels_item": 7500, "labels_pixel": 0.5, "labels_box": 20_000,
        "integers_call": 30_000, "integers_placement": 2000, "integers_pair": 3000, "integers_bit": 0.16,
        "march_call": 190_000, "march_ray": 400, "field_pixel": 5.5,
    }  # fmt: skip
    numpy = {
        "tiles_call": 350_000, "tiles_placement": 800, "tiles_pair": 4, "visible_call": 300_000,
        "visible_placement": 300, "visible_made": 2_000_000, "cast_call": 600_000, "cast_ray": 12_000, "cast_pair": 30,
    }  # fmt: skip
    compiled = {
        "tiles_call": 50_000, "tiles_placement": 170, "tiles_pair": 0.3, "visible_call": 45_000,
        "visible_placement": 50, "visible_made": 100_000, "cast_call": 170_000, "cast_ray": 600, "cast_pair": 1.3,
    }  # fmt: skip
    monkeypatch.setattr(costs, "NUMPY", costs.NUMPY._replace(**both, **numpy))
    monkeypatch.setattr(costs, "COMPILED", costs.COMPILED._replace(**both, **compiled))
