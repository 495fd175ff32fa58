"""What type checkers take for the arguments of `fire`; nothing here runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, SupportsFloat, SupportsIndex, TypedDict

import numpy.typing as npt

Angles = SupportsFloat | Sequence[SupportsFloat] | npt.NDArray[Any]
Places = Sequence[SupportsFloat] | Sequence[Sequence[SupportsFloat]] | Sequence[npt.NDArray[Any]] | npt.NDArray[Any]
Wholes = SupportsIndex | Sequence[SupportsIndex] | npt.NDArray[Any]
Categories = str | Sequence[str] | Sequence[Sequence[str]] | Wholes
Owners = Wholes | Sequence[Sequence[SupportsIndex]]
"""What a type checker takes for numbers (N,), points (N, 2), whole numbers (N,), names or bits, and owners (N, K)."""


class Filtered(TypedDict, total=False):
    """What shots pass over, and the seed of their pellets, for type checkers; see `fire`."""

    accept: Categories
    blocked_by: Categories
    exclude: Owners | None
    seed: Wholes


class Fired(Filtered, total=False):
    """All named arguments of `fire`, for type checkers."""

    aim: Angles | None
    toward: Places | None
    shot: Wholes | None
    tick: Angles | None
    prefilter: str
    broadphase: str
    strategy: str
