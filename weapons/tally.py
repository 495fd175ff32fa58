"""What a run of `hitplanes stability` found: decisions of each method, cell by cell, as `stability.json` has it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from planes.arrays import Bools, InputError
from weapons.families import FAMILIES
from weapons.peers import PEERS
from weapons.predicates import PREDICATES

__all__ = ["FORMAT", "NAIVE", "OURS", "Cell", "Count", "Study", "load_study"]

FORMAT = "hitplanes-stability/1"
OURS, NAIVE = "hitplanes", "naive float64"


@dataclass
class Count:
    """Decisions of one method in one cell."""

    cases: int = 0
    missed: int = 0
    false: int = 0

    @property
    def wrong(self) -> int:
        """Both kinds."""
        return self.missed + self.false

    @property
    def per_million(self) -> float:
        """Wrong decisions in a million."""
        return 1e6 * self.wrong / self.cases

    def add(self, true: Bools, said: Bools) -> None:
        """Count one block."""
        self.cases += len(true)
        self.missed += int((true & ~said).sum())
        self.false += int((~true & said).sum())


@dataclass
class Cell:
    """What was asked of one predicate in one family, how each method answered, and who failed to."""

    predicate: str
    family: str
    asked: int
    methods: dict[str, Count] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Rows that were asked, and answered by any method."""
        return max((count.cases for count in self.methods.values()), default=0)

    @property
    def complete(self) -> bool:
        """Whether all rows were asked."""
        return self.rows == self.asked


@dataclass
class Study:
    """A run: its seed, whether it was a quick one, the versions of what was asked, and the cells so far."""

    seed: int
    quick: bool
    versions: dict[str, str]
    cells: list[Cell] = field(default_factory=list)

    @property
    def methods(self) -> list[str]:
        """Who was asked anything: ours and the textbook's first."""
        return [OURS, NAIVE, *(name for name in PEERS if name in self.versions)]

    @property
    def complete(self) -> bool:
        """Whether every cell is there, and complete."""
        return len(self.cells) == sum(len(p.families) for p in PREDICATES) and all(c.complete for c in self.cells)

    def cell(self, predicate: str, family: str) -> Cell | None:
        """One cell, if it has been asked."""
        return next((c for c in self.cells if (c.predicate, c.family) == (predicate, family)), None)

    @property
    def right(self) -> bool:
        """Whether all that hitplanes was asked it answered, and rightly."""
        return not self.total(OURS).wrong and not any(OURS in cell.failed for cell in self.cells)

    def total(self, method: str) -> Count:
        """All decisions of a method."""
        found = [c.methods[method] for c in self.cells if method in c.methods]
        return Count(*(sum(getattr(c, name) for c in found) for name in ("cases", "missed", "false")))

    def to_json(self) -> dict[str, Any]:
        """As `stability.json` has it."""
        return {
            "format": FORMAT,
            "seed": self.seed,
            "quick": self.quick,
            "complete": self.complete,
            "versions": self.versions,
            "families": FAMILIES,
            "cells": [
                {
                    "predicate": cell.predicate,
                    "family": cell.family,
                    "asked": cell.asked,
                    "methods": {name: {"cases": c.cases, "missed": c.missed, "false": c.false}
                                for name, c in cell.methods.items()},
                    "failed": cell.failed,
                }
                for cell in self.cells
            ],
        }  # fmt: skip


def load_study(path: Path) -> Study:
    """Read a `stability.json`.

    Raises
    ------
    InputError
        If it is not one.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["format"] != FORMAT:
            raise InputError(f"format: expected {FORMAT!r}, got {data['format']!r}")
        cells = [
            Cell(
                c["predicate"], c["family"], c["asked"],
                {name: Count(**n) for name, n in c["methods"].items()}, c["failed"],
            )
            for c in data["cells"]
        ]  # fmt: skip
        return Study(data["seed"], data["quick"], data["versions"], cells)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected what `hitplanes stability` writes, got {error}") from error
