"""Cases of which the default run takes some, and the long run the others."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def some_of(cases: Iterable[Any], each: int = 3) -> list[Any]:
    """Cases for `parametrize`: the first and every `each`-th after it run by default, the others are long."""
    return [case if k % each == 0 else _long(case) for k, case in enumerate(cases)]


def in_turn(ones: Iterable[Any], others: Collection[Any]) -> list[Any]:
    """Pairs for `parametrize`: by default each of the ones runs with one of the others, in turn; the rest is long."""
    pairs = [(k, one, j, other) for k, one in enumerate(ones) for j, other in enumerate(others)]
    return [(one, other) if k % len(others) == j else _long((one, other)) for k, one, j, other in pairs]


def _long(case: Any) -> Any:
    return pytest.param(*(case if type(case) is tuple else (case,)), marks=pytest.mark.long)
