"""Compiled kernels on disk are those of the files as they are."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

CALLING = """
from numba import types
from planes.called_jit import told
from planes.compiled import compiled

@compiled(types.int64(types.int64))
def asked(number):
    return told(number)
"""
CALLED = """
from numba import njit
from planes.named import MORE

@njit
def told(number):
    return number + MORE + {}
"""
ASK = "from planes.calling_jit import asked as a; print(a(1), sum(a.stats.cache_hits.values()), end='')"


@pytest.mark.long
def test_a_kernel_is_compiled_anew_when_what_it_calls_or_names_changes(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    for package in ("planes", "weapons"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "planes" / "calling_jit.py").write_text(CALLING)

    def ask() -> str:
        run = subprocess.run([sys.executable, "-c", ASK], cwd=tmp_path, capture_output=True, text=True, check=True)
        return run.stdout

    for number, more, expected in ((1, 0, ("2 0", "2 1")), (2, 0, ("3 0", "3 1")), (2, 10, ("13 0", "13 1"))):
        (tmp_path / "planes" / "called_jit.py").write_text(CALLED.format(number))
        (tmp_path / "planes" / "named.py").write_text(f"MORE = {more}\n")
        assert (ask(), ask()) == expected
