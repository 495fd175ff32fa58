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

@njit
def told(number):
    return number + {}
"""
ASK = "from planes.calling_jit import asked as a; print(a(1), sum(a.stats.cache_hits.values()), end='')"


@pytest.mark.long
def test_a_kernel_is_compiled_anew_when_one_that_it_calls_changes(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    for package in ("planes", "weapons"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "planes" / "calling_jit.py").write_text(CALLING)

    def ask() -> str:
        run = subprocess.run([sys.executable, "-c", ASK], cwd=tmp_path, capture_output=True, text=True, check=True)
        return run.stdout

    for number, expected in ((1, ("2 0", "2 1")), (2, ("3 0", "3 1"))):
        (tmp_path / "planes" / "called_jit.py").write_text(CALLED.format(number))
        assert (ask(), ask()) == expected
