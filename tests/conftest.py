"""What several tests share."""

import os
import signal
from collections.abc import Iterator

import pytest

from hitplanes import use_jit

if os.name == "nt":
    collect_ignore = ["test_bad_files.py", "test_record.py", "test_stream.py"]  # they set limits, which Windows lacks


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


@pytest.fixture(params=[False, True])
def jit(request: pytest.FixtureRequest) -> Iterator[bool]:
    """Whether compiled kernels are used for all calls of a test: once without, once with."""
    if request.param:
        pytest.importorskip("numba")
    use_jit(request.param)
    yield request.param
    use_jit(None)
