"""What differs between two JSON values: each leaf under its path, and entries of lists paired by what names them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

__all__ = [
    "ABSENT", "LINES_MAX", "Entry", "by_path", "entries", "first_of", "key_of", "pairs", "same", "shown",
    "text_of_json",
]  # fmt: skip

LINES_MAX = 12
"""Lines of one list; what is beyond is counted."""

VALUE_LETTERS = 80
"""Letters of a value that a line shows."""

ABSENT = object()
"""Stands for a key that an object does not have."""

Entry = Mapping[str, Any]


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal as JSON: a number is no truth value, a tuple is a list."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return isinstance(a, bool) == isinstance(b, bool) and bool(a == b)


def by_path(path: str, was: Any, now: Any) -> Iterator[str]:
    """Each leaf that differs, under its path."""
    if same(was, now):
        return
    if isinstance(was, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*was, *now]):
            yield from by_path(f"{path}.{key}" if path else str(key), was.get(key, ABSENT), now.get(key, ABSENT))
    elif isinstance(was, list | tuple) and isinstance(now, list | tuple) and len(was) == len(now):
        for i, pair in enumerate(zip(was, now, strict=True)):
            yield from by_path(f"{path}[{i}]", *pair)
    elif isinstance(was, list | tuple) and isinstance(now, list | tuple):
        yield f"{path}: {len(now)} entries, was {len(was)}"
    else:
        yield f"{path}: {shown(now)}, was {shown(was)}"


def pairs(was: Any, now: Any, *names: str) -> Iterator[tuple[Entry | None, Entry | None]]:
    """Entries of two lists that agree in some fields, in the order of the first, then those only in the second."""
    before, after = ({key_of(entry, *names): entry for entry in entries(side)} for side in (was, now))
    for key in dict.fromkeys([*before, *after]):
        yield before.get(key), after.get(key)


def entries(value: Any) -> list[Entry]:
    """Objects of a list; none of what is no list."""
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list | tuple) else []


def key_of(entry: Entry, *names: str) -> str:
    """Some fields of an entry as one text, whatever they hold."""
    return text_of_json([entry.get(name) for name in names])


def text_of_json(value: Any) -> str:
    """A value as JSON with its keys in order; what is none is shown as Python has it."""
    return json.dumps(value, sort_keys=True, default=repr)


def first_of(lines: Iterable[str]) -> list[str]:
    """The first of many lines, and the count of the others."""
    every = list(lines)
    more = len(every) - LINES_MAX
    return every if more <= 0 else [*every[:LINES_MAX], f"and {more} more"]


def shown(value: Any) -> str:
    """A value as a line shows it: short, and without line breaks."""
    if value is None or value is ABSENT:
        return "missing" if value is ABSENT else "none"
    text = json.dumps(value, ensure_ascii=False, default=repr)
    if isinstance(value, float):
        text = text.removesuffix(".0")
    return text if len(text) <= VALUE_LETTERS else text[: VALUE_LETTERS - 3] + "..."
