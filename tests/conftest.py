"""What several tests share."""

import signal
from collections.abc import Iterator

import pytest

from planes import use_jit


class HangError(BaseException):
    """Nothing of the project catches it."""


@pytest.fixture
def bounded() -> Iterator[None]:
    """No test that uses this takes longer, whatever is read or given."""

    def ring(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, 20)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(params=[False, True])
def jit(request: pytest.FixtureRequest) -> Iterator[bool]:
    """Whether compiled kernels are used for all calls of a test: once without, once with."""
    if request.param:
        pytest.importorskip("numba")
    use_jit(request.param)
    yield request.param
    use_jit(None)
