"""What type checkers say of right and wrong uses: each mark in `typed_uses.py` is an error, and nothing else is."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
USES = (ROOT / "tests" / "typed_uses.py").read_text()
CHECKERS = {
    "mypy": ["--strict", "--follow-imports=silent", "--no-incremental"],
    "pyright": ["--pythonpath", sys.executable],
}


@pytest.mark.long
@pytest.mark.parametrize("checker", CHECKERS)
def test_right_uses_pass_and_wrong_ones_do_not(checker: str, tmp_path: Path) -> None:
    pytest.importorskip(checker)
    for name, package in (("api", ""), ("../planes", "planes"), ("../weapons", "weapons")):
        shutil.copytree(ROOT / "weapons" / name, tmp_path / "hitplanes" / package, dirs_exist_ok=True)
    (tmp_path / "marked.py").write_text(USES)
    (tmp_path / "unmarked.py").write_text(re.sub(r" *# type: ignore.*", "", USES))
    command = [sys.executable, "-m", checker, *CHECKERS[checker], "marked.py", "unmarked.py"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    errors = [line for line in done.stdout.splitlines() if re.search(r"\berror\b", line)]
    assert [line for line in errors if "/marked.py" in f"/{line}"] == []
    wrong = {number for number, line in enumerate(USES.splitlines(), 1) if "# type: ignore" in line}
    named = {int(number) for number in re.findall(r"unmarked\.py:(\d+)", "\n".join(errors))}
    assert named == wrong and len(wrong) > 8
