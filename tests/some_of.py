"""Cases of which the default run takes some, and the long run the others."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def some_of(cases: Iterable[Any], each: int = 3) -> list[Any]:
    """Cases for `parametrize`: the first and every `each`-th after it run by default, the others are long."""
    return [case if k % each == 0 else _long(case) for k, case in enumerate(cases)]


def _long(case: Any) -> Any:
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.long)
