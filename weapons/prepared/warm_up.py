"""Compile all kernels at once, at a time that the user chooses, instead of at the first call that needs them."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module

import numpy as np

from hitplanes.planes.common.backend import COMPILED, use_jit
from hitplanes.planes.common.checks import InputError, kind_of
from hitplanes.planes.scene.scene import Scene

from ..fire.call import fire
from ..kinds.rays import Pistol


def warm_up(progress: Callable[[int, int], None] | None = None) -> float:
    """Compile all kernels now, and use them from now on, as `use_jit` does.

    The machine code is kept on disk: later processes of the same user only load it.

    Parameters
    ----------
    progress : called with the number of steps done, and of all steps

    Returns
    -------
    seconds that it took

    Raises
    ------
    InputError
        If numba (the extra `jit`) is not installed, or `progress` is no function.
    """
    if progress is not None and not callable(progress):
        raise InputError(f"progress: expected a function, got {kind_of(progress)}")
    begin = time.perf_counter()
    use_jit()
    steps: list[Callable[[], object]] = [
        *(lambda module=module: import_module(module) for module in sorted(set(COMPILED.values()))),
        _few_shots,
    ]
    for done, step in enumerate(steps):
        if progress is not None:
            progress(done, len(steps))
        step()
    if progress is not None:
        progress(len(steps), len(steps))
    return time.perf_counter() - begin


def _few_shots() -> None:
    """Call the kernels that are compiled for the types of their first arguments."""
    scene = Scene((64, 64))
    ids = np.array([scene.add(np.ones((5, 5), np.bool_)) for _ in range(2)])
    scene.move(ids, np.array([(9.0, 9.0), (30.0, 9.0)]))
    scene.planes()
    fire(scene, Pistol(30), [(1, 9), (40, 40)], strategy="march")
