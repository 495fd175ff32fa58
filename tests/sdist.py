"""A source distribution with all that the tests need: without a MANIFEST.in setuptools takes only tests/test*.py."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from setuptools.command.sdist import sdist

FOLDERS = ("tests", "fixtures")
CACHES = {"__pycache__", ".pytest_cache", ".hypothesis"}


def files_of(root: Path) -> list[str]:
    """Files of the folders, relative to the root, in order; caches are left out."""
    paths = (path for folder in FOLDERS for path in (root / folder).rglob("*"))
    return sorted(path.relative_to(root).as_posix() for path in paths if path.is_file() and not CACHES & {*path.parts})


class WithTests(sdist):
    """The command that makes the source distribution."""

    def make_release_tree(self, base_dir: str, files: Iterable[str]) -> None:
        """Copy files into the tree that is packed."""
        super().make_release_tree(base_dir, [*dict.fromkeys([*files, *files_of(Path.cwd())])])
