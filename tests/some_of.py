"""Cases of which the default run takes some, and the long run the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def some_of(cases: Iterable[Any], each: int = 3) -> Sequence[Any]:
    """Cases for `parametrize`: the first and every `each`-th after it run by default, the others are long."""
    listed = list(cases)
    return [case if k % each == 0 else _long(case) for k, case in enumerate(listed)]


def _long(case: Any) -> Any:
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, marks=[*case.marks, pytest.mark.long], id=case.id)
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.long)
