"""Goldens that no test uses any more: what a run knows of its tests, and what follows for the files."""

from __future__ import annotations

import json
from collections.abc import Generator, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

__all__ = ["Collected", "stale_goldens"]

KINDS = (".json", ".npz", ".png")
"""Files of a golden."""


class Collected:
    """A plugin that notes which tests there are in files beside which there are goldens.

    Parameters
    ----------
    folder : name of the folders of goldens

    `files` are the test files by path, as node ids; `whole` are the files and classes of which all is known; `known`
    is what was found in them, chosen to run or not.
    """

    def __init__(self, folder: str, *, whole: bool) -> None:
        self._folder, self._whole = folder, whole
        self.files: dict[str, str] = {}
        self.whole: set[str] = set()
        self.known: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        """Note what a file or a class holds."""
        report = yield
        above = isinstance(collector, pytest.Session | pytest.Directory)
        if not above and (collector.path.parent / self._folder).is_dir():
            if isinstance(collector, pytest.File):
                self.files[str(collector.path)] = collector.nodeid
            self.known |= {node.nodeid for node in report.result or ()}
            if report.passed and self._whole:
                self.whole.add(collector.nodeid)
        return report

    def to_json(self) -> dict[str, Any]:
        """What was noted, to be sent."""
        return {"files": self.files, "whole": sorted(self.whole), "known": sorted(self.known)}

    def add(self, sent: Mapping[str, Any]) -> None:
        """Take what another process has noted."""
        self.files |= sent["files"]
        self.whole |= set(sent["whole"])
        self.known |= set(sent["known"])


def stale_goldens(collected: Collected, folder: str, used: set[str], passed: set[str]) -> list[Path]:
    """Goldens, without their endings, that no test uses.

    A test that passed and did not ask for its golden has none; nor has one that is no longer there. Of a test that was
    left out, skipped or failed nothing is known.

    Parameters
    ----------
    used : goldens that were asked for
    passed : node ids of tests that passed
    """
    by_place = {(Path(path).parent, Path(path).stem): node for path, node in collected.files.items()}
    stale = []
    for place in sorted({place for place, _ in by_place}):
        there = {path.stem for path in place.iterdir() if path.is_file()}
        for goldens in sorted(path for path in (place / folder).glob("*") if path.is_dir()):
            file = by_place.get((place, goldens.name))
            for base in _bases(goldens):
                gone = goldens.name not in there
                if gone or (file is not None and _is_stale(base, file, collected, used, passed)):
                    stale.append(base)
    return stale


def _is_stale(base: Path, file: str, collected: Collected, used: set[str], passed: set[str]) -> bool:
    if str(base) in used:
        return False
    inside = _test_of(base)
    if inside is None:
        tests = {node for node in collected.known if node.startswith(f"{file}::")} - collected.whole
        return file in collected.whole and tests <= passed
    node = f"{file}::{inside}"
    if node in collected.known or node in passed:
        return node in passed
    above = [file, *(known for known in _prefixes(file, inside) if known in collected.known)]
    return all(part in collected.whole for part in above)


def _prefixes(file: str, inside: str) -> Iterator[str]:
    """Node ids of the classes around a test."""
    names = inside.split("::")
    for i in range(1, len(names)):
        yield "::".join([file, *names[:i]])


def _bases(folder: Path) -> Iterable[Path]:
    """Goldens of a folder, by their names without endings."""
    return sorted({path.with_name(path.stem) for path in folder.iterdir() if path.suffix in KINDS})


def _test_of(base: Path) -> str | None:
    """Test of a golden, as its module knows it; None if that cannot be read."""
    try:
        test = json.loads(base.with_name(f"{base.name}.json").read_text(encoding="utf-8"))["test"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return test.partition("::")[2] if isinstance(test, str) else None
