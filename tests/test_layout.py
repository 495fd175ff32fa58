"""The layout that the code promises: who may import whom, what lies at the top, and what importing costs."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

ORDER = {
    "planes": (
        "constants", "arrays", "heap", "twins", "compiled", "addresses", "schema", "exact", "sines", "sines_jit",
        "grid256", "snapping", "snapping_jit", "spans", "strips", "stack", "bits", "nearest", "bitrows", "bitrows_jit",
        "itemrows", "cells", "cells_jit", "pellets", "lookup", "lookup_jit", "fronttoback", "fronttoback_jit",
        "bigrows", "tiles", "bigfront", "rasterise", "rings", "volumes", "parts", "axes", "overlap", "boxes", "grids",
        "quadtree", "bvh", "broadphase", "triangles", "slabs", "image", "kept", "turning",
        "turning_jit", "forms", "sprite", "hull", "cover", "outline", "fit", "bounding", "placing",
        "placing_jit", "items", "cropping", "cropping_jit", "visible", "index", "painting",
        "painting_jit", "steps", "steps_jit", "pointquery", "pointquery_jit", "compose", "jumps",
        "jumps_jit", "clearance", "raycast", "raycast_jit", "labels", "poses", "scenefile", "scene", "loading",
        "history", "render", "sampling",
    ),
    "weapons": (
        "draws", "draws_jit", "weapon", "columns", "pattern", "windows", "guns", "arsenal", "volley",
        "rays", "trace", "narrow", "candidates", "costs", "plan", "resolve", "explain", "margins",
        "hits", "counting", "fewfire", "oneshot", "pieces", "squares", "squares_jit", "runfire", "bitfire",
        "meetings", "flight", "ends", "passes", "tracing", "rayexplain", "leaving", "raymargins",
        "rayhits", "firsthits", "rayways", "jumping", "casting", "rayfire", "firing", "ready", "castone",
        "castone_jit", "readyray", "preparing", "clock", "orders",
        "heat", "rayfacts", "thennow", "sieve", "facts", "schemas", "jsondiff", "record", "words",
        "raywords", "marks", "strokes", "signs", "world", "ghosts", "sketch", "panel", "overlay",
        "raymarks", "inset", "cards", "picture", "raychanges", "differences", "versus", "goldfile",
        "goldshow", "goldpage", "goldcheck", "goldstale", "golden", "shotlog", "part", "progress",
        "stream", "folders", "starter", "animation", "decisions", "timing", "targets", "peerworlds",
        "byfire", "pixeltruth", "raypeers", "raystudy", "moverstudy", "spreadstudy", "shapetruth",
        "copies", "discs", "planestudy", "volumestudy", "areapeers", "kinds", "study", "studywords",
        "figures", "diagram", "studyfiles", "demo", "truth", "families", "pointfamilies",
        "shotfamilies", "naive", "peers", "predicates", "tally", "heatfigure", "stability", "helptexts",
        "cli", "__main__",
    ),
}  # fmt: skip
"""Each module imports only from those before it, here or in the package above."""

TOP = {"pyproject.toml", "planes", "weapons", "tests", "fixtures", "README.md"}
PLACES = [(package, name) for package, names in ORDER.items() for name in names]


def imported(source: str) -> Iterator[str]:
    """Modules that a source imports anywhere, also inside functions: a package's own as package.module."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "a relative import"
            module = node.module or ""
            if module in ORDER:
                yield from (f"{module}.{alias.name}" for alias in node.names)
            else:
                yield module


def inner_imports(path: Path) -> list[str]:
    return [name for name in imported(path.read_text()) if name.split(".")[0] in ORDER]


@pytest.mark.parametrize("package", ORDER)
def test_every_module_has_its_place(package: str) -> None:
    found = {path.stem for path in (ROOT / package).rglob("*.py")} - {"__init__"}
    assert found <= set(ORDER[package])


@pytest.mark.parametrize("package", ORDER)
def test_the_readme_lists_the_modules_in_order(package: str) -> None:
    listed = (ROOT / "README.md").read_text().split(f"\n- `{package}`: ")[1].split("\n- ")[0]
    assert [name.strip() for name in listed.split(",")] == [name for name in ORDER[package] if name != "__main__"]


@pytest.mark.parametrize(("package", "name"), PLACES, ids=lambda v: v)
def test_a_module_imports_only_those_before_it(package: str, name: str) -> None:
    path = ROOT / package / f"{name}.py"
    if not path.exists():
        pytest.skip("not in this version")
    known = [f"{p}.{n}" for p, n in PLACES]
    before = known[: known.index(f"{package}.{name}")]
    assert [module for module in inner_imports(path) if module not in before] == []


def test_sampling_knows_no_scene() -> None:
    """Kernels read stacks and planes of codes."""
    allowed = {"planes.arrays", "planes.constants", "planes.spans", "planes.items", "planes.compose"}
    assert set(inner_imports(ROOT / "planes" / "sampling.py")) <= allowed


def test_planes_never_import_weapons() -> None:
    for path in (ROOT / "planes").glob("*.py"):
        assert not [name for name in imported(path.read_text()) if name.startswith("weapons")], path.name


def test_the_reader_of_imports_sees_them_all() -> None:
    source = """
import numpy as np, planes.scene
from planes import spans, arrays
def late():
    from weapons.cli import main
if True:
    import weapons
"""
    assert sorted(imported(source)) == [
        "numpy", "planes.arrays", "planes.scene", "planes.spans", "weapons", "weapons.cli",
    ]  # fmt: skip


def test_top_level() -> None:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    try:
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no git, or no repository")
    names = {line.split("/")[0] for line in listed.stdout.splitlines()}
    assert {name for name in names if not name.startswith(".")} <= TOP
    assert {"pyproject.toml", "planes", "weapons", "tests"} <= names


def loaded_by(code: str) -> set[str]:
    script = f"import sys\n{code}\nprint(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_importing_costs_little() -> None:
    extra = loaded_by("import planes, weapons") - loaded_by("pass")
    assert not {name for name in extra if name.split(".")[0] in ("numpy", "cv2")}
    assert {name for name in extra if name.split(".")[0] in ORDER} == set(ORDER)
    assert len(extra) < 60


def test_a_first_shot_loads_little_beside_numpy() -> None:
    """What errors, hashes, files and angles near to a tie need waits for them; numba for a batch that pays."""
    numpy = "import numpy, numpy.typing"
    shot = (
        "from planes import Scene; from weapons import Disc, fire; scene = Scene((9, 9)); fire(scene, Disc(3), (2, 2))"
    )
    extra = loaded_by(f"{numpy}\n{shot}") - loaded_by(numpy)
    assert not extra & {"hashlib", "secrets", "random", "fractions", "decimal", "difflib", "numba", "cv2"}
    assert len([name for name in extra if name.split(".")[0] not in ORDER]) < 20


@pytest.mark.parametrize("package", ORDER)
def test_whatever_a_package_lists_is_there(package: str) -> None:
    code = f"import {package}\nassert dir({package}) and all(getattr({package}, n) is not None for n in dir({package}))"
    assert f"{package}.{ORDER[package][0]}" in loaded_by(code)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        __import__(package).nothing  # noqa: B018


RAYS = {
    f"weapons.{name}" for name in ("trace", "tracing", "meetings", "ends", "passes", "rayfire", "rayhits", "rayexplain")
}


def test_shots_of_patterns_load_neither_rays_nor_the_past() -> None:
    code = "from planes import Scene; from weapons import Disc, Pistol, fire; scene = Scene(); fire(scene, {}, (0, 0))"
    assert not loaded_by(code.format("Disc(3)")) & {"planes.history", *RAYS}
    assert loaded_by(code.format("Pistol(3)")) >= RAYS
