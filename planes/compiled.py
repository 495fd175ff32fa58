"""Compiled functions, kept on disk as long as the files of both packages are as they were.

numba keeps what it compiled of a function until the function's own file changes; but kernels call those of other files,
and numbers that other files name are part of what is compiled.
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
    """What tells whether any of the files has changed."""
    told = hashlib.sha256()
    for package in ("planes", "weapons"):
        for file in sorted(files(package).iterdir(), key=lambda file: file.name):
            if file.name.endswith(".py"):
                told.update(f"{file.name} ".encode() + hashlib.sha256(file.read_bytes()).digest())
    return told.hexdigest()


def compiled(*signatures: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a kernel for its signatures, or without any for those of its calls; it lets other threads run.

    Parameters
    ----------
    options : of numba, where they are others
    """

    def made(kernel: Callable[..., Any]) -> Any:
        """Compile it, or find what is kept on disk."""
        dispatcher = njit(**{"nogil": True, **options})(kernel)
        dispatcher.enable_caching()
        dispatcher._cache._cache_file._source_stamp = _stamp()
        for signature in signatures:
            dispatcher.compile(signature)
        if signatures:
            dispatcher.disable_compile()
        return dispatcher

    return made
