"""What is written of a long result so far: held by one process, checked, gone on with, renamed when it is complete."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from planes.arrays import InputError
from planes.image import check_output

try:
    import fcntl
except ImportError:  # Windows: two writers are not told apart there
    fcntl = None  # type: ignore[assignment]

__all__ = ["Part"]

HEADER_MAX = 2**20
"""Bytes that are looked at of a header other than the one expected, to say what differs."""


FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


class Part:
    """The file `<output>.part`, open for writing by this process alone.

    Nothing is kept back in memory: what `write` was given is in the file when it returns.

    Parameters
    ----------
    output : where the complete result goes
    header : its first line, with what an older part must have in common with this one

    Raises
    ------
    InputError
        If it cannot be written, if another process writes it, or if it answers another question.
    """

    def __init__(self, output: Path, header: bytes) -> None:
        self.output, self.path = output, self.path_of(output)
        for path in (self.output, self.path):
            check_output(path)
        with self._told():
            self._file = os.open(self.path, FLAGS, 0o666)
        try:
            self._hold()
            self._check(header)
            self._end = len(header)
        except BaseException:
            os.close(self._file)
            raise

    @staticmethod
    def path_of(output: Path) -> Path:
        """Where the part of an output lies."""
        return output.with_name(f"{output.name}.part")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._file >= 0:
            os.close(self._file)

    def lines(self) -> Iterator[bytes]:
        """Whole lines of an older part behind the header; what comes behind the last of them taken is cut off."""
        with self._told(), self.path.open("rb") as file:
            file.seek(self._end)
            for line in file:
                if not line.endswith(b"\n"):
                    break
                yield line
                self._end += len(line)

    def cut(self) -> None:
        """Begin to write behind the last whole line."""
        with self._told():
            os.ftruncate(self._file, self._end)
            os.lseek(self._file, self._end, os.SEEK_SET)

    def write(self, data: bytes) -> None:
        """Append; after an error, as of a full disk, the part may end in half a line."""
        view = memoryview(data)
        with self._told():
            while len(view):
                view = view[os.write(self._file, view) :]

    def finish(self) -> None:
        """Give the part, now complete, the name of the result."""
        with self._told():
            os.fsync(self._file)
            if fcntl is None:
                self._close()
            self.path.replace(self.output)  # still held: no other process can have begun to write to it

    def _close(self) -> None:
        os.close(self._file)
        self._file = -1

    def _hold(self) -> None:
        """Be the only one to write it."""
        if fcntl is None:
            return
        busy = InputError(f"output: cannot write {self.path}: another process is writing it")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise busy from error
        except OSError:  # a file system without locks
            return
        with self._told():
            if not self.path.exists() or not os.path.samestat(os.fstat(self._file), self.path.stat()):
                raise busy  # it was held until now, and has been renamed

    def _check(self, header: bytes) -> None:
        """Write the header of a new part; compare that of an older one."""
        with self._told():
            found = os.read(self._file, len(header))
            if found == header:
                return
            if header.startswith(found):
                os.lseek(self._file, 0, os.SEEK_SET)
                self.write(header)
                return
            os.lseek(self._file, 0, os.SEEK_SET)
            found = os.read(self._file, HEADER_MAX)
        raise InputError(f"{self.path}: {_difference(header, found)}: remove it to start anew")

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise InputError(f"output: cannot write {self.path}: {error.strerror}") from error


def _difference(header: bytes, found: bytes) -> str:
    """In what the header of a part differs from the one expected."""
    now = json.loads(header)
    try:
        then = json.loads(found.partition(b"\n")[0])
    except (ValueError, RecursionError):
        then = None
    if not isinstance(then, dict) or then.get("format") != now["format"]:
        return f"expected a part of {now['format']}, got something else"
    for key, value in now.items():
        if then.get(key) != value:
            return f"expected {key} {_short(value)}, got {_short(then.get(key))}"
    return "expected the header of this version, got another"


def _short(value: Any) -> str:
    return f"{json.dumps(value):.60}"
