"""Forms of JSON values, which check them.

A scene file, a weapon, a shot and a report each have one table of such forms. `tests/bench/schemas.py` makes JSON
Schemas of the tables.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Protocol

import numpy as np

from .checks import InputError, array_of, bools, choice, flag, integer, integers, real, reals, shown, within
from .limits import MASK_SIDE_MAX

TEXT_MAX = 200  # longest name, characters: a longer one would not fit a line of a report

DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)\s*(\..*)?", re.IGNORECASE)
"""File names that Windows reserves for devices, with any ending."""

Shape = tuple[int | None, ...]


class Value(Protocol):
    """A form: what one value may be."""

    def check(self, name: str, value: object) -> Any:
        """Return the value as plain Python, or raise InputError that begins with its name."""


@dataclass(frozen=True)
class Number:
    """A finite number in [low, high]."""

    low: float = -math.inf
    high: float = math.inf

    def check(self, name: str, value: object) -> float:
        """Check one number."""
        return real(name, value, self.low, self.high)


@dataclass(frozen=True)
class Whole:
    """A whole number in [low, high]."""

    low: int
    high: int

    def check(self, name: str, value: object) -> int:
        """Check one whole number."""
        return integer(name, value, self.low, self.high)


@dataclass(frozen=True)
class Numbers:
    """An array of finite numbers within ±limit, or in [low, limit]; None in the shape is any length.

    It has at least `least` rows.
    """

    shape: Shape
    limit: float = math.inf
    least: int = 0
    low: float | None = None

    def check(self, name: str, value: object) -> Any:
        """Check an array of numbers, and return it as tuples."""
        array = reals(name, value, self.shape, self.limit)
        if len(array) < self.least:
            raise InputError(f"{name}: expected {self.least} points or more, got {len(array)}")
        if self.low is not None:
            for i, number in enumerate(array.tolist()):
                real(f"{name}[{i}]", number, self.low, self.limit)
        return _tuples(array.tolist())


@dataclass(frozen=True)
class Wholes:
    """An array of whole numbers in [low, high]; None in the shape is any length."""

    shape: Shape
    low: int
    high: int

    def check(self, name: str, value: object) -> Any:
        """Check an array of whole numbers, and return it as tuples."""
        if isinstance(value, list) and not value and self.shape[0] is None:
            return ()
        return _tuples(integers(name, value, self.shape, self.low, self.high).tolist())


@dataclass(frozen=True)
class Text:
    """A text of 1 to 200 characters."""

    def check(self, name: str, value: object) -> str:
        """Check one text."""
        if (
            not isinstance(value, str)
            or not 0 < len(value) <= TEXT_MAX
            or any(0xD800 <= ord(c) < 0xE000 for c in value)
        ):
            raise InputError(f"{name}: expected a text of 1 to {TEXT_MAX} characters, got {shown(value)}")
        return value


def inside(name: str, value: object) -> str:
    """Check the path of a file in a scene's folder: on no system may it lead out of the folder."""
    text = Text().check(name, value)
    parts = PurePosixPath(text).parts
    devices = [part for part in parts if DEVICE.fullmatch(part)]  # Windows opens a device under such a name
    if any(mark in text for mark in "\\:\0") or text.startswith("/") or ".." in parts or devices:
        raise InputError(f"{name}: expected a path inside the scene's folder, got {shown(text)}")
    return text


@dataclass(frozen=True)
class Names:
    """A list of distinct texts."""

    def check(self, name: str, value: object) -> list[str]:
        """Check a list of texts."""
        names = [Text().check(f"{name}[{i}]", v) for i, v in enumerate(typed(name, value, list))]
        if len(set(names)) < len(names):
            raise InputError(f"{name}: expected distinct names, got {shown(names)}")
        return names


@dataclass(frozen=True)
class Word:
    """One of a few words."""

    words: tuple[str, ...]

    def check(self, name: str, value: object) -> str:
        """Check one word; the error suggests the nearest."""
        return choice(name, value, self.words)


@dataclass(frozen=True)
class Const:
    """One text and no other, or one of those that were written before."""

    value: str
    older: tuple[str, ...] = ()

    def check(self, name: str, value: object) -> str:
        """Check that the value is one of these texts."""
        if not isinstance(value, str) or value not in (self.value, *self.older):
            raise InputError(f"{name}: expected {self.value!r}, got {shown(value)}")
        return value


@dataclass(frozen=True)
class Flag:
    """True or false."""

    def check(self, name: str, value: object) -> bool:
        """Check one boolean."""
        return flag(name, value)


@dataclass(frozen=True)
class Mask:
    """A mask: rows of '#' (set) and '.' (not), or rows of 0 and 1."""

    def check(self, name: str, value: object) -> Any:
        """Check a mask and return it (h, w) as booleans."""
        if not (isinstance(value, list | tuple) and value and isinstance(value[0], str)):
            array = array_of(name, value)
            if array.ndim == 2 and not 1 <= min(array.shape) <= max(array.shape) <= MASK_SIDE_MAX:
                got = f"{array.shape[1]} x {array.shape[0]}"
                raise InputError(f"{name}: expected a mask of sides of 1 to {MASK_SIDE_MAX} px, got {got}")
            return bools(name, array, (None, None))
        for i, row in enumerate(value):
            if not isinstance(row, str) or len(row) != len(value[0]) or set(row) - set("#."):
                raise InputError(f"{name}[{i}]: expected {len(value[0])} of '#' and '.', got {shown(row)}")
        signs = np.frombuffer("".join(value).encode("ascii"), np.uint8).reshape(len(value), len(value[0]))
        return self.check(name, signs == ord("#"))


@dataclass(frozen=True)
class Optional:
    """A value, or null."""

    form: Value

    def check(self, name: str, value: object) -> Any:
        """Check a value that is not null."""
        return None if value is None else self.form.check(name, value)


@dataclass(frozen=True)
class Either:
    """One of two forms: the first if the value has the type `kind` (list or str), else the second."""

    kind: type
    first: Value
    second: Value

    def check(self, name: str, value: object) -> Any:
        """Check the value by the form that its type selects."""
        return (self.first if isinstance(value, self.kind) else self.second).check(name, value)


@dataclass(frozen=True)
class OneOrEach:
    """An array of one form for all, or an array of such arrays."""

    one: Value
    each: Value

    def check(self, name: str, value: object) -> Any:
        """Check the value by the form that its first row selects."""
        several = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
        return (self.each if several else self.one).check(name, value)


@dataclass(frozen=True)
class Rows:
    """A list whose rows all have one form."""

    form: Value

    def check(self, name: str, value: object) -> tuple[Any, ...]:
        """Check each row."""
        rows = value if isinstance(value, tuple) else typed(name, value, list)
        return tuple(self.form.check(f"{name}[{i}]", row) for i, row in enumerate(rows))


@dataclass(frozen=True)
class Mapped:
    """An object with any names as keys, whose values all have one form."""

    form: Value

    def check(self, name: str, value: object) -> dict[str, Any]:
        """Check each name and each value."""
        for key in typed(name, value, dict):
            Text().check(f"{name}: key", key)
        return {key: self.form.check(f"{name}.{key}", entry) for key, entry in typed(name, value, dict).items()}


@dataclass(frozen=True)
class Keys:
    """An object with known keys, some of them required; of a file, its format is checked before its other keys."""

    forms: Mapping[str, Value]
    needed: tuple[str, ...] = ()

    def check(self, name: str, value: object) -> dict[str, Any]:
        """Check that no key is unknown or missing, and check each value; errors begin with the key."""
        data = typed(name, value, dict)
        if "format" in data and "format" in self.forms:
            self.forms["format"].check("format", data["format"])
        for key in data:
            choice("key", key, self.forms)
        for key in self.needed:
            if key not in data:
                raise InputError(f"{key}: expected {_phrase(self.forms[key])}, got nothing")
        return {key: self.forms[key].check(key, entry) for key, entry in data.items()}


@dataclass(frozen=True)
class Within:
    """A form whose errors begin with the place of the value."""

    form: Value

    def check(self, name: str, value: object) -> Any:
        """Check the value; errors begin with its name."""
        with within(name):
            return self.form.check(name, value)


@dataclass(frozen=True)
class Ref:
    """A reference to a definition of the schema; any JSON passes here, and its reader checks it."""

    definition: str

    def check(self, name: str, value: object) -> Any:
        """Return the value unchecked."""
        return value


def json_of(text: str) -> Any:
    """Parse JSON; keys that come twice, NaN and Infinity are refused."""
    odd: list[str] = []

    def number(text: str) -> float:
        odd.append(text)
        return math.nan

    try:
        value = json.loads(text, object_pairs_hook=distinct_keys, parse_constant=number)
        place = next(_nans(value, ""), "") if odd else ""
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"expected one JSON value: {error}") from error
    if odd:
        raise InputError(f"{place or 'number'}: expected a finite number, got {odd[0]}")
    return value


def _nans(value: Any, place: str) -> Iterator[str]:
    """Places of numbers that are not finite in JSON, as errors name them."""
    if isinstance(value, float) and math.isnan(value):
        yield place
    elif isinstance(value, list):
        for i, part in enumerate(value):
            yield from _nans(part, f"{place}[{i}]")
    elif isinstance(value, dict):
        for key, part in value.items():
            yield from _nans(part, f"{place}: {key:.60}" if place else f"{key:.60}")


def distinct_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make a JSON object of its pairs, as an `object_pairs_hook`; a key that comes twice is refused."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [key for key, _ in pairs]
        raise InputError(f"key: expected each key once, got {shown(max(names, key=names.count))} again")
    return found


def typed(name: str, value: object, kind: type[dict[str, Any]] | type[list[Any]]) -> Any:
    """Check that JSON is an object, or a list."""
    if not isinstance(value, kind):
        raise InputError(f"{name}: expected {'an object' if kind is dict else 'a list'}, got {shown(value)}")
    return value


def _phrase(form: Value) -> str:
    """Words for a form whose value is missing."""
    if isinstance(form, Numbers) and form.shape == (2,):
        return "two numbers"
    return repr(form.value) if isinstance(form, Const) else "a value"


def _tuples(value: Any) -> Any:
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value
