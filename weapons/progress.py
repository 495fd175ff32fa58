"""How far a long run is: one line on a terminal, redrawn a few times a second; nothing where no one looks."""

from __future__ import annotations

import shutil
import time
from contextlib import suppress
from typing import TextIO

__all__ = ["Progress"]

SECONDS = 0.2
"""Least time between two drawings."""

BAR = 24
"""Letters of a bar."""


class Progress:
    """Draws on a terminal; on any other stream it only says what it is told to say.

    Parameters
    ----------
    stream : where to draw, as stderr
    what : is counted
    """

    def __init__(self, stream: TextIO, what: str = "shots") -> None:
        self._stream, self._draws, self._what = stream, stream.isatty(), what
        self._size = 0
        self._begin = self._drawn = time.monotonic()
        self._before = (0, 0)
        self._width = 0

    def begin(self, size: int, shots: int, at: int) -> None:
        """Count speed from here on.

        Parameters
        ----------
        size : bytes of the whole log; 0 where it is not known, as of a pipe
        shots, at : done before, by another run, and the bytes that they take
        """
        self._size, self._before = size, (shots, at)
        self._begin = time.monotonic()

    def say(self, text: str) -> None:
        """Write a line, on any stream."""
        self.clear()
        self._write(f"hitplanes: {text}\n")

    def show(self, shots: int, at: int) -> None:
        """Draw the line, unless it was drawn a moment ago.

        Parameters
        ----------
        shots : done so far
        at : bytes of the log that they take
        """
        now = time.monotonic()
        if not self._draws or now - self._drawn < SECONDS:
            return
        self._drawn = now
        self._draw(self._text(shots, at, max(now - self._begin, SECONDS)))

    def step(self, what: str, done: int, of: int) -> None:
        """Draw what is at work, and how much of all is done, unless the line was drawn a moment ago."""
        now = time.monotonic()
        if self._draws and now - self._drawn >= SECONDS:
            self._drawn = now
            full = BAR * done // max(of, 1)
            self._draw(f"[{'#' * full}{'.' * (BAR - full)}] {done} of {of}, {what}")

    def clear(self) -> None:
        """Leave the terminal's line empty."""
        if self._width:
            self._draw("")

    def _text(self, shots: int, at: int, seconds: float) -> str:
        shots_before, at_before = self._before
        told = [f"{shots:,} {self._what}", f"{(shots - shots_before) / seconds:,.0f}/s"]
        if self._size:
            told.insert(1, f"{100 * at // self._size} %")
            rate = (at - at_before) / seconds
            if rate > 0:
                left = round(max(self._size - at, 0) / rate)
                told.append(f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02} left")
        return ", ".join(told)

    def _draw(self, text: str) -> None:
        text = text[: shutil.get_terminal_size().columns - 1]
        self._write(f"\r{text:{self._width}}" if text else f"\r{text:{self._width}}\r")
        self._width = len(text)

    def _write(self, text: str) -> None:
        with suppress(OSError):  # that no one reads it stops no work
            self._stream.write(text)
            self._stream.flush()
