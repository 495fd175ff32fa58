"""Compiled functions, kept on disk as long as the files of all of them are as they were.

numba keeps what it compiled of a function until the function's own file changes; but kernels call those of other files.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

from numba import njit

__all__ = ["compiled"]


@cache
def _stamp() -> str:
    """What tells whether any of the files of kernels has changed."""
    every = [file for package in ("planes", "weapons") for file in files(package).iterdir()]
    kernels = sorted((file.name, file.read_bytes()) for file in every if file.name.endswith("_jit.py"))
    return hashlib.sha256(repr(kernels).encode()).hexdigest()


def compiled(*signatures: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a kernel for its signatures, or without any for those of its calls; it lets other threads run.

    Parameters
    ----------
    options : of numba, where they are others
    """

    def made(kernel: Callable[..., Any]) -> Any:
        dispatcher = njit(**{"nogil": True, **options})(kernel)
        dispatcher.enable_caching()
        dispatcher._cache._cache_file._source_stamp = _stamp()
        for signature in signatures:
            dispatcher.compile(signature)
        if signatures:
            dispatcher.disable_compile()
        return dispatcher

    return made
