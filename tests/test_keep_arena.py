"""Large blocks that were freed are kept for the next step of a batch, where the C library lets them be."""

import os
import subprocess
import sys

import pytest

BLOCKS = """
import ctypes
import numpy as np
from hitplanes import Disc, Scene, fire

class Told(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in "arena ordblks smblks blocks mapped a b c d e".split()]

told = getattr(ctypes.CDLL(None), "mallinfo2", None)
if told is None:
    raise SystemExit("no glibc")
told.restype = Told

scene = Scene()
mask = scene.add(np.ones((9, 9), np.bool_), (20, 20))
{then}
before = told().blocks
block = np.empty(2**23, np.uint8)
print(told().blocks > before)
"""


@pytest.mark.parametrize("environment", [{}, {"MALLOC_TRIM_THRESHOLD_": "131072"}], ids=["plain", "as in a container"])
@pytest.mark.parametrize(
    ("then", "from_the_system"),
    [
        ("fire(scene, Disc(3), (0, 0)); scene.set(mask, angle=3); scene.box(mask)", True),
        ("fire(scene, Disc(3), np.zeros((2, 2)))", False),
        ("scene.set([mask, scene.add(np.eye(3) > 0, (0, 0))], angle=3); scene.box(mask)", False),
    ],
)
def test_a_batch_lets_large_blocks_be_kept(then: str, from_the_system: bool, environment: dict[str, str]) -> None:
    """Also where a variable of the environment switches off that the library learns it by itself."""
    command = [sys.executable, "-c", BLOCKS.format(then=then)]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **environment})
    if "no glibc" in run.stderr:
        pytest.skip("another C library")
    assert run.stdout.strip() == str(from_the_system), run.stderr
