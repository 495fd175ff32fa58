"""What every weapon is: fields checked by a table, equal when their JSON is."""

from __future__ import annotations

import json
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from typing import Any, ClassVar

from planes.arrays import InputError, shown
from planes.constants import REACH_MAX
from planes.schema import Number, Ref, Value

__all__ = ["LENGTH", "Part", "Weapon"]

LENGTH = Number(0, REACH_MAX)
"""A length that a weapon may have, px."""


@dataclass(frozen=True)
class Part(Ref):
    """A weapon within a weapon; its JSON is made a weapon before it comes here."""

    kinds: tuple[type, ...]
    told: str

    def check(self, name: str, value: object) -> object:
        """Check that it is of a kind that may be a part."""
        if not isinstance(value, self.kinds):
            raise InputError(f"{name}: expected {self.told}, got {shown(value)}")
        return value


@dataclass(frozen=True, eq=False)
class Weapon:
    """What is fired; two are equal when their JSON is."""

    kind: ClassVar[str]
    table: ClassVar[dict[str, Value]]

    def __post_init__(self) -> None:
        """Check every field by the table, and keep plain Python values."""
        for name, value in self.table.items():
            self._keep(name, value.check(name, getattr(self, name)))

    @cached_property
    def _text(self) -> str:
        return json.dumps(self.to_json(), sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Weapon) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)

    def _keep(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone, for copies: what is worked out of them is worked out again."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def to_json(self) -> dict[str, Any]:
        """The weapon as a scene file has it; fields at their defaults are left out."""
        shown: dict[str, Any] = {"kind": self.kind}
        for f in fields(self):
            value = getattr(self, f.name)
            if f.default is MISSING or value != f.default:
                shown[f.name] = _plain_json(value)
        return shown


def _plain_json(value: object) -> Any:
    if isinstance(value, Weapon):
        return value.to_json()
    if isinstance(value, tuple | list):
        return [_plain_json(v) for v in value]
    return value
