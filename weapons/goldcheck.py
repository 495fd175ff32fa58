"""One call of hits_golden: where its golden lies, and whether it passes, is written anew, or fails and is shown."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from planes.arrays import InputError
from planes.image import write_text
from planes.scenefile import DEVICE
from weapons.goldfile import (
    DamagedGoldenError,
    ForeignGoldenError,
    Golden,
    Unlike,
    golden_of,
    read_golden,
    unlike,
)
from weapons.goldpage import FOLDER, PAGE, claimed, note_files, relative
from weapons.goldshow import draw_difference, pictures_of

__all__ = ["Call", "Outcome", "safe_name", "settle"]

LINES_MAX, PAGE_LINES_MAX = 20, 500
"""Lines of a failure's message, and on the page."""

NAME_LETTERS, HASH_DIGITS = 80, 10

PLAIN = re.compile(r"[a-z0-9_]+(\[[a-z0-9_.,=+-]*\])?"), re.compile(r"[a-z0-9_]([a-z0-9_.-]*[a-z0-9_])?")


@dataclass(frozen=True)
class Call:
    """Which golden is asked for.

    Parameters
    ----------
    node : id of the test in this run
    test : from its file's name on, which is the same wherever pytest runs
    name : given in the test, or None
    base : path of the golden's files, without their endings
    root, here : what paths are relative to: those of tests, and those that are shown
    update : whether a golden that is missing or differs is written
    """

    node: str
    test: str
    name: str | None
    base: Path
    root: Path
    here: Path
    update: bool

    def shown(self, path: Path) -> str:
        """A path as it is told."""
        return relative(path, self.here)


@dataclass(frozen=True)
class Outcome:
    """What became of a call: "same", "updated" or "failed"; the message if it failed, and what the page shows of it."""

    kind: str
    message: str = ""
    failure: dict[str, Any] = field(default_factory=dict)


def safe_name(test: str, name: str | None = None) -> str:
    """Name of a file for a test within its module, and a golden's name; two never share one, whatever the system.

    What is of small letters and short is called as it is, all else by its letters and a hash: systems differ in which
    other characters they take, in whether case counts, and in how long a name may be.
    """
    whole = test if name is None else f"{test}-{name}"
    plain = PLAIN[0].fullmatch(test) and PLAIN[1].fullmatch("_" if name is None else name)
    like_hashed = re.fullmatch(rf".*-[0-9a-f]{{{HASH_DIGITS}}}", whole)
    if plain and len(whole) <= NAME_LETTERS and not DEVICE.fullmatch(whole) and not like_hashed:
        return whole
    digest = hashlib.sha256(repr((test, name)).encode()).hexdigest()[:HASH_DIGITS]
    letters = re.sub(r"[^A-Za-z0-9_]+", "-", whole).strip("-")[:NAME_LETTERS]
    return f"{letters}-{digest}".lstrip("-")


def settle(call: Call, hits: object, planes: Mapping[str, object]) -> Outcome:
    """Compare hits with their golden; write it if that is wanted; show what differs if not.

    Raises
    ------
    InputError
        If the hits or the planes are none.
    """
    got = golden_of(hits, planes, call.test, call.name)
    expected, changed, ours = None, None, True
    try:
        expected = read_golden(call.base)
        changed = unlike(expected, got) if expected else None
        lines = ["there is no golden of these hits yet"] if changed is None else changed.lines
    except DamagedGoldenError as error:
        lines = [str(error)]
    except ForeignGoldenError as error:
        lines, ours = [str(error)], False
    if not lines:
        return Outcome("same")
    if call.update and ours:
        call.base.parent.mkdir(parents=True, exist_ok=True)
        got.write(call.base, changed)
        return Outcome("updated")
    failure, look = _show(call, lines, expected, got, changed or Unlike())
    more = [f"and {len(lines) - LINES_MAX} more"] if len(lines) > LINES_MAX else []
    accept = ["accept: run again with --hits-update"] if ours else []
    if changed is not None and not changed.hits:
        more.append("the hits are the same")
    message = [*lines[:LINES_MAX], *more, f"golden: {failure['golden']}", f"look: {look}", *accept]
    return Outcome("failed", "\n".join(message), failure)


def _show(
    call: Call, lines: list[str], expected: Golden | None, got: Golden, changed: Unlike
) -> tuple[dict[str, Any], str]:
    """Write what failed among the failures: what the page shows of it, and where to look."""
    golden = f"{call.shown(call.base)}.json"
    failure: dict[str, Any] = {"test": call.node, "golden": golden, "lines": lines[:PAGE_LINES_MAX]}
    failure |= {"folder": "", "texts": [], "rows": []}
    folder, name = call.root / FOLDER, safe_name(relative(call.base, call.root))
    if not claimed(folder):
        return failure, f"nowhere: {call.shown(folder)} is there, and not ours"
    texts = {"expected.json": expected, "got.json": got}
    try:
        note_files(folder, [f"{name}/{file}" for file in (*texts, *pictures_of(changed))])
        (folder / name).mkdir(exist_ok=True)
        for file, side in texts.items():
            if side is not None:
                write_text(folder / name / file, side.text())
        rows = draw_difference(folder / name, expected, got, changed)
    except (OSError, InputError) as error:
        return failure, f"nowhere: {error}"
    failure |= {"folder": name, "texts": [file for file, side in texts.items() if side is not None], "rows": rows}
    return failure, call.shown(folder / PAGE)
