"""How many examples a property test draws: a third by default, all of them in the long run (`tests/conftest.py`)."""

from __future__ import annotations

from typing import Any

from hypothesis import settings

ALL, SOME = 100, 33


def examples(many: int, **more: Any) -> settings:
    """Settings for `many` examples in the long run, and for a third of them, but not fewer than five, by default."""
    few = max(5, many * SOME // ALL)
    return settings(max_examples=many if settings().max_examples == ALL else min(few, many), **more)
