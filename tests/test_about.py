"""What a package index shows, and the changes: their examples run, and each name that they tell is there."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
ABOUT, CHANGES, README = (
    (ROOT / name).read_text(encoding="utf-8") for name in ("planes/ABOUT.md", "planes/CHANGES.md", "README.md")
)


def test_the_description_needs_no_other_file() -> None:
    """A package index has neither the pictures of the repository nor its files."""
    assert not re.findall(r"!\[|\]\((?!https://)", ABOUT)


def test_the_example_of_the_description_is_that_of_the_readme() -> None:
    blocks = re.findall(r"```(?:python|text)\n.*?```", ABOUT, flags=re.DOTALL)
    code, shown = (re.sub(r"^```\w+\n|```$", "", block) for block in blocks)
    assert all(block in README for block in blocks)
    run = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == shown


def test_the_changes_name_modules_that_are_there() -> None:
    """Each row of the table of imports."""
    table = CHANGES.split("### Imports")[1].split("###")[0]
    rows = re.findall(r"^\| `([\w.]+)` \| `([\w.]+)` \|$", table, flags=re.MULTILINE)
    assert len(rows) >= 8
    for before, now in rows:
        assert before.split(".")[0] in ("planes", "weapons") and import_module(now).__doc__, now


def test_the_changes_name_the_formats_that_are_written() -> None:
    from hitplanes.weapons.replay import record, stream

    for module in (record, stream):
        assert f"`{module.FORMAT}`" in CHANGES
