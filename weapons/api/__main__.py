"""The command `hitplanes`, also as `python -m hitplanes`: it can be interrupted from its first import on."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from typing import NoReturn


def run() -> int:
    """Import the command, and run it."""
    interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if interruptible:
        signal.signal(signal.SIGINT, _leave)
    from hitplanes.weapons.cli.command import main

    try:
        if interruptible:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return main()
    except KeyboardInterrupt:  # before or after the command's own care for it
        _leave()


def _leave(*_: object) -> NoReturn:
    """End at once: an import that is interrupted by an error of its own may take it for another, and go on."""
    with suppress(OSError):
        os.write(2, b"hitplanes: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    sys.exit(run())
