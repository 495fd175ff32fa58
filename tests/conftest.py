"""What the tests of bad input share."""

import signal
from collections.abc import Iterator

import pytest


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
