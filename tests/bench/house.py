"""The measures of the house: how much there is to read, in how many places, and what a first shot loads.

`python tests/bench/house.py` prints them for this tree, each beside its target. What no parser can see is marked in the
code by a comment `# house: KIND`, at each place that answers a shot in a way of its own (`way of areas`, `way of
rays`), writes the hit rule down (`hit rule of areas`, `hit rule of rays`), or puts rows in order (`row order`).
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent.parent
PACKAGES = ("planes", "weapons")
CORE = (
    "planes/common", "planes/grid", "planes/scene", "planes/files", "planes/bits",
    "weapons/kinds", "weapons/fire", "weapons/rays",
)  # fmt: skip
"""Rooms that one must read to maintain `fire`."""

ROOM_FILES, FILE_LINES = 12, 600
TIMED = re.compile(r"^[A-Z][A-Z_]*_(NS|US)\b|^[A-Z_]+ = Costs\(|^[A-Z_]+: .*\bns\b", re.MULTILINE)
"""A constant in nanoseconds: a number that was tuned by timing."""

SHOT = """
import sys, numpy
from hitplanes import {weapon}, Scene, fire
fire(Scene((9, 9)), {weapon}(3), (2, 2))
print(sum(name.split(".")[0] == "hitplanes" for name in sys.modules))
"""


class Measure(NamedTuple):
    """One row: what is measured, what it is here, and what it should be at most."""

    name: str
    value: int
    target: int

    def __str__(self) -> str:
        return f"{self.name:<52} {self.value:>7,} {self.target:>7,}  {'' if self.value <= self.target else 'over'}"


def sources(root: Path = ROOT) -> dict[str, str]:
    """Text of each file of both packages, by its path."""
    paths = sorted(path for package in PACKAGES for path in (root / package).rglob("*.py"))
    return {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def rooms(files: dict[str, str]) -> Counter[str]:
    """How many files each room has."""
    return Counter(path.rpartition("/")[0] for path in files)


def marks(files: dict[str, str]) -> Counter[str]:
    """How often each kind of place is marked."""
    return Counter(kind.strip() for text in files.values() for kind in re.findall(r"# house: (.*)", text))


def loaded(weapon: str) -> int:
    """Modules of the library that a first shot loads."""
    run = subprocess.run([sys.executable, "-c", SHOT.format(weapon=weapon)], capture_output=True, text=True, check=True)
    return int(run.stdout)


def measures(root: Path = ROOT) -> list[Measure]:
    """All that the tree tells of itself."""
    files = sources(root)
    lines = {path: len(text.splitlines()) for path, text in files.items()}
    core = {path: count for path, count in lines.items() if path.startswith(CORE)}
    here = marks(files)
    compiled = [path for path, text in files.items() if re.search(r"^\s*@(compiled|njit)\b", text, re.MULTILINE)]
    return [
        Measure("lines in all", sum(lines.values()), 27_000),
        Measure("lines of the core", sum(core.values()), 10_500),
        Measure("files of the core", len(core), 45),
        Measure("files", len(files), 110),
        Measure("files of the largest room", max(rooms(files).values()), ROOM_FILES),
        Measure("lines of the longest file", max(lines.values()), FILE_LINES),
        Measure("modules that fire(scene, Disc(3), at) loads", loaded("Disc"), 32),
        Measure("ways to answer a shot of an area", here["way of areas"], 5),
        Measure("ways to answer a ray", here["way of rays"], 3),
        Measure("places that hold the hit rule of areas", here["hit rule of areas"], 3),
        Measure("places that hold the hit rule of rays", here["hit rule of rays"], 3),
        Measure("places that put rows in order", here["row order"], 2),
        Measure("files with a number tuned by timing", sum(bool(TIMED.search(text)) for text in files.values()), 1),
        Measure("compiled modules", len(compiled), 6),
        Measure("functions of more than 40 lines", sum(map(_long, files.values())), 0),
    ]


def _long(text: str) -> int:
    functions = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef))
    return sum((node.end_lineno or 0) - node.lineno >= 40 for node in functions)


def main() -> None:
    """Print a row for each measure."""
    print(f"{'':<52} {'here':>7} {'target':>7}")
    for measure in measures():
        print(measure)


if __name__ == "__main__":
    main()
