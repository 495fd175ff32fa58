"""The cache of compiled kernels on disk, valid while the sources of both packages are unchanged.

numba's own cache does not serve, for three reasons:

- It checks only the kernel's own file, but kernels call kernels, and contain constants, of other files.
- A damaged entry raises an error in the call.
- It loads pickles, which can run any code, from folders that others may write to.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba import njit
from numba.core import config
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.misc.appdirs import AppDirs

from ..common.backend import tell

DIGEST_BYTES = 32


@cache
def _stamp() -> bytes:
    """Hash of the sources of both packages."""
    digest = hashlib.sha256()
    for package in ("hitplanes.planes", "hitplanes.weapons"):
        for name, source in _sources(files(package), package):
            digest.update(f"{name} ".encode() + hashlib.sha256(source).digest())
    return digest.digest()


def _sources(folder: Traversable, path: str) -> Iterator[tuple[str, bytes]]:
    """Names and contents of all Python files in a folder and its subfolders, sorted by name."""
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        name = f"{path}/{entry.name}"
        if entry.is_dir():
            yield from _sources(entry, name)
        elif name.endswith(".py"):
            yield name, entry.read_bytes()


@cache
def _folder() -> Path | None:
    """The folder of this user's machine code for these packages; None if it is not safe, as the plan then reports."""
    try:
        user = AppDirs("hitplanes", appauthor=False).user_cache_dir
        if not (config.CACHE_DIR or Path(user).is_absolute()):
            raise OSError("the user has no folder for caches")
        packages = hashlib.sha256(str(files("hitplanes.planes")).encode()).hexdigest()[:16]
        return _private(Path(config.CACHE_DIR or user).resolve() / f"kernels-{packages}")
    except (OSError, RuntimeError) as error:  # a missing home, or circular links, are a RuntimeError
        _tell_unkept(str(error))
        return None


def _private(folder: Path) -> Path:
    """A folder that only this user can write to, made if missing; an OSError if others can write to or replace it."""
    for place in (*reversed(folder.parents), folder):
        place.mkdir(0o700, exist_ok=True)
    if not hasattr(os, "geteuid"):  # on Windows the user's folders are private
        return folder
    user, root = os.geteuid(), Path(folder.anchor).stat().st_uid
    for place in (folder, *folder.parents):
        status, own = place.stat(), place in (folder, folder.parent)
        if status.st_uid not in ((user,) if own else (user, root)):
            raise OSError(f"{place} belongs to another user")
        sticky = bool(status.st_mode & stat.S_ISVTX) and not own  # like /tmp: only an entry's owner can replace it
        if status.st_mode & (stat.S_IWGRP * own | stat.S_IWOTH) and not sticky:
            raise OSError(f"others can write to {place}")
    return folder


def _tell_unkept(why: str) -> None:
    tell(f"compiled for this process alone, as they cannot be kept: {why}")


class _Kept(NullCache):  # type: ignore[misc]
    """Machine code of a kernel on disk, in numba's interface: a file for each signature, which begins with a digest.

    A file that is missing, unreadable, damaged or made from other sources is ignored: the kernel is compiled, and the
    file replaced atomically.
    """

    def __init__(self, kernel: Callable[..., Any]) -> None:
        self._kernel = kernel

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Machine code for types of arguments, or None."""
        target_context.refresh()
        folder, name = _folder(), self._name(signature, target_context.codegen())
        if folder is None:
            return None
        try:
            held = (folder / name).read_bytes()
            digest, code = held[:DIGEST_BYTES], held[DIGEST_BYTES:]
            if digest == _digest(name, code):
                return CompileResult._rebuild(target_context, *pickle.loads(code))
        except Exception:  # whatever is wrong with the file, the kernel can be compiled
            pass
        return None

    def save_overload(self, signature: Any, made: Any) -> None:
        """Keep machine code for types of arguments, which was just compiled."""
        tell(f"compiled {self._kernel.__name__}, which hitplanes warm-up does at a better time")
        folder = _folder()
        if folder is None or made.library.has_dynamic_globals:
            return
        name, code = self._name(signature, made.codegen), dumps(made._reduce())
        part = folder / f"{name}.{uuid4().hex}.part"
        try:
            part.write_bytes(_digest(name, code) + code)
            part.replace(folder / name)
        except OSError as error:
            with suppress(OSError):
                part.unlink()
            _tell_unkept(f"{error.strerror}: {folder}")

    def _name(self, signature: Any, codegen: Any) -> str:
        """Name of a file, with a hash of the kernel, its argument types, the machine, and the compiler's version."""
        kernel, code = self._kernel, self._kernel.__code__
        of = kernel.__qualname__, code.co_firstlineno, code.co_code, signature, codegen.magic_tuple()
        by = numba.__version__, sys.implementation.cache_tag
        return (
            f"{kernel.__module__}.{kernel.__name__}-{hashlib.sha256(repr((of, by)).encode()).hexdigest()[:16]}.kernel"
        )


def _digest(name: str, code: bytes) -> bytes:
    """Digest of machine code, its name and the sources."""
    return hashlib.sha256(_stamp() + hashlib.sha256(name.encode()).digest() + code).digest()


def compiled(*signatures: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a kernel for the given signatures, or, without any, for those of its calls; other threads may run.

    Parameters
    ----------
    options : options of numba that differ from the default
    """

    def made(kernel: Callable[..., Any]) -> Any:
        """Compile the kernel, or load it from disk."""
        dispatcher = njit(**{"nogil": True, "no_cfunc_wrapper": True, **options})(kernel)
        dispatcher._cache = _Kept(kernel)
        for signature in signatures:
            dispatcher.compile(signature)
        if signatures:
            dispatcher.disable_compile()
        return dispatcher

    return made


def helper(*, allocates: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function that kernels alone call. It has no entry for Python: a call from there crashes.

    Entries took a fifth of the time to compile all kernels. Kernels copy arrays by loops, because numba compiles
    its formatting of text for the error message of `a[i:j] = b`, which takes two seconds.

    Parameters
    ----------
    allocates : whether it makes or returns an array, or calls a helper that returns one. Others do not count references
        to their arguments, which took 6 ns an array and call: more than the work of many.
    options : options of numba that differ from the default: "inline" suits small helpers, "forceinline" large ones
    """
    return njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=allocates, **options)
