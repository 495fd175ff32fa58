"""Which kernels are used: those in numpy, or their compiled twins (the extra `jit`), row for row the same.

The twin of `planes/name.py` is `planes/name_jit.py`, with the same functions. It is imported when it is asked for, or
by a batch that would take so long in numpy that loading it pays.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from planes.arrays import InputError

__all__ = ["expect", "kernels_of", "use_jit"]

LOADING_NS = 2e9
"""A call that is expected to take longer in numpy loads the compiled twins of itself, which takes about 1 s."""

_asked: list[bool] = []
_twins: dict[str, ModuleType] = {}


def use_jit(on: bool | None = True) -> None:
    """Use compiled kernels from now on; False: only numpy; None: from the first call on that pays, as it is at first.

    They change no result. The first calls of all compile them, and keep them on disk.

    Raises
    ------
    InputError
        If they are asked for and numba, the extra `jit`, is not there.
    """
    if on and find_spec("numba") is None:
        raise InputError("jit: expected numba, which the extra 'jit' installs, got no such module")
    _asked[:] = [] if on is None else [bool(on)]


def expect(ns: float) -> None:
    """Tell how long a call is expected to take in numpy: from one on that is long enough, compiled kernels are used."""
    if not _asked and ns > LOADING_NS and find_spec("numba") is not None:
        use_jit(True)


def kernels_of(module: ModuleType, expected_ns: float = 0.0) -> ModuleType:
    """The module of kernels itself, or its compiled twin, for work that is expected to take so long in numpy."""
    expect(expected_ns)
    if not _asked or not _asked[0]:
        return module
    if module.__name__ not in _twins:
        _twins[module.__name__] = import_module(f"{module.__name__}_jit")
    return _twins[module.__name__]
