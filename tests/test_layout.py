"""The layout that the code promises: which room may import which, what lies at the top, and what importing costs."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from bench import house

from hitplanes.planes.common import backend

ROOT = Path(__file__).parent.parent

ROOMS = (
    "planes.common", "planes.grid", "planes.scene", "planes.files", "planes.bits", "planes.jit", "planes.volumes",
    "planes.broadphase", "planes.bridges", "weapons.kinds", "weapons.fire", "weapons.rays", "weapons.prepared",
    "weapons.explain", "weapons.report", "weapons.golden", "weapons.replay", "weapons.lab", "weapons.cli",
    "weapons.api",
)  # fmt: skip
"""A room imports from itself and from those before it."""

LEAVES = {
    "planes.jit", "planes.volumes", "planes.broadphase", "planes.bridges", "weapons.prepared", "weapons.explain",
    "weapons.report", "weapons.golden", "weapons.replay", "weapons.lab", "weapons.cli", "weapons.api",
}  # fmt: skip
"""No other room imports from these: what the core asks of them it reads from `late`."""

TOP = {"pyproject.toml", "planes", "weapons", "tests", "fixtures", "README.md"}


class Import(NamedTuple):
    """One import: of which module, which names, and where it stands."""

    module: str
    names: tuple[str, ...]
    late: bool


def imports(source: str, package: str) -> Iterator[Import]:
    """Imports that run, inside functions too, as absolute names; those for the type checker alone are left out."""
    tree = ast.parse(source)
    typed = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in ast.walk(block)
    }
    for node in ast.walk(tree):
        if id(node) in typed:
            continue
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, (), node.col_offset > 0) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: -(node.level - 1) or None] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            yield Import(module, tuple(alias.name for alias in node.names), node.col_offset > 0)


def room_of(module: str) -> str:
    """The room of a module of ours, as planes.grid; empty for others."""
    parts = module.removeprefix("hitplanes.").split(".")
    return ".".join(parts[:2]) if module.startswith("hitplanes.") and len(parts) > 1 else ""


def rooms_of(path: Path) -> Iterator[tuple[str, Import]]:
    """Rooms that a file imports from, also where it names a room itself."""
    for found in imports(path.read_text(encoding="utf-8"), package_of(path)):
        if found.module in ("hitplanes.planes", "hitplanes.weapons"):
            yield from ((room_of(f"{found.module}.{name}"), found) for name in found.names)
        elif found.module.startswith("hitplanes"):
            yield room_of(found.module), found


def files() -> list[Path]:
    return [path for package in ("planes", "weapons") for path in sorted((ROOT / package).rglob("*.py"))]


def package_of(path: Path) -> str:
    return "hitplanes." + ".".join(path.relative_to(ROOT).parent.parts)


@pytest.mark.parametrize("path", files(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_room_imports_only_rooms_above_it(path: Path) -> None:
    here = room_of(package_of(path))
    if not here:
        return  # what lies in no room names rooms, and imports none: see the next test
    for there, found in rooms_of(path):
        if there == here or there.endswith(".late"):
            continue
        assert there in ROOMS and ROOMS.index(there) < ROOMS.index(here), f"{here} imports from {found.module}"
        if here not in LEAVES:
            assert there not in LEAVES, f"{here}, of the core, imports from {found.module}: read it from `late`"


@pytest.mark.parametrize("path", files(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_room_imports_only_public_names_of_others(path: Path) -> None:
    here = room_of(package_of(path))
    for found in imports(path.read_text(encoding="utf-8"), package_of(path)):
        if room_of(found.module) not in ("", here):
            assert not [name for name in found.names if name.startswith("_")], found


def test_what_lies_in_no_room_imports_none_before_it_is_asked() -> None:
    for path in files():
        if not room_of(package_of(path)):
            text = path.read_text(encoding="utf-8")
            assert not [found for found in imports(text, package_of(path)) if "hitplanes" in found.module], path


def test_the_reader_of_imports_sees_them_all() -> None:
    source = """
import numpy as np, hitplanes.planes.scene
from ..grid import spans, _inner
from . import here
def late():
    from hitplanes.weapons.cli import main
if TYPE_CHECKING:
    from ..lab import study
if True:
    import weapons
"""
    assert sorted(imports(source, "hitplanes.planes.scene")) == [
        ("hitplanes.planes.grid", ("spans", "_inner"), False),
        ("hitplanes.planes.scene", (), False),
        ("hitplanes.planes.scene", ("here",), False),
        ("hitplanes.weapons.cli", ("main",), True),
        ("numpy", (), False),
        ("weapons", (), True),
    ]


def test_rooms_and_files_stay_small() -> None:
    sources = house.sources()
    assert all(count <= house.ROOM_FILES for count in house.rooms(sources).values()), house.rooms(sources)
    assert not [path for path, text in sources.items() if len(text.splitlines()) > house.FILE_LINES]
    for path in files():
        assert room_of(package_of(path)) in {*ROOMS, ""}, path


def test_every_package_is_installed() -> None:
    told = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    found = {package_of(path) for path in files() if path.name == "__init__.py"}
    assert set(told["packages"]) == (found - {"hitplanes.weapons.api"}) | {"hitplanes"}
    assert {package_of(path) for path in files()} == found


def test_whatever_is_no_module_is_shipped() -> None:
    """Guides, changes, schemas and the mark of types are package data; the licence is beside the metadata."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    tool = project["tool"]["setuptools"]
    folders = {package: ROOT / folder for package, folder in tool["package-dir"].items()}
    data = {path for package, globs in tool["package-data"].items() for g in globs for path in folders[package].glob(g)}
    licences = {ROOT / name for name in project["project"]["license-files"]}
    others = {
        path
        for package in ("planes", "weapons")
        for path in (ROOT / package).rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    }
    assert others == data | licences
    assert {"py.typed", "CHANGES.md", "ABOUT.md", "LICENSE", "scene.json"} <= {path.name for path in others}


def test_every_pair_of_kernel_modules_shares_functions() -> None:
    """A module whose kernels went elsewhere is no pair."""
    for name, compiled in backend.COMPILED.items():
        paths = (ROOT / f"{module.removeprefix('hitplanes.').replace('.', '/')}.py" for module in (name, compiled))
        plain, twins = (defined(path.read_text(encoding="utf-8")) for path in paths)
        assert plain & twins, name


def defined(source: str) -> set[str]:
    """Public functions and classes of a module."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return {node.name for node in ast.parse(source).body if isinstance(node, kinds) and node.name[0] != "_"}


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
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_this_run_has_one_copy_of_every_module() -> None:
    """With the root of the repository on the path, `import planes` would load a second one."""
    assert not {name for name in sys.modules if name.split(".")[0] in ("planes", "weapons")}


def test_importing_costs_little() -> None:
    extra = loaded_by("import hitplanes") - loaded_by("pass")
    assert not {name for name in extra if name.split(".")[0] in ("numpy", "cv2")}
    assert {name for name in extra if name.split(".")[0] == "hitplanes"} == {"hitplanes"}
    assert len(extra) < 60


def test_a_first_shot_loads_little_beside_numpy() -> None:
    """What errors, hashes, files and angles near to a tie need waits for them; numba for a batch that pays."""
    numpy = "import numpy, numpy.typing"
    shot = "from hitplanes import Disc, Scene, fire; scene = Scene((9, 9)); fire(scene, Disc(3), (2, 2))"
    extra = loaded_by(f"{numpy}\n{shot}") - loaded_by(numpy)
    assert not extra & {"hashlib", "secrets", "random", "fractions", "decimal", "difflib", "numba", "cv2"}
    ours = {name for name in extra if name.split(".")[0] == "hitplanes"}
    assert len(extra - ours) < 20
    assert len(ours) <= 45


def test_whatever_the_api_lists_is_there() -> None:
    code = "import hitplanes\nassert dir(hitplanes) and all(getattr(hitplanes, n) is not None for n in dir(hitplanes))"
    assert "hitplanes.planes.scene.scene" in loaded_by(code)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        __import__("hitplanes").nothing  # noqa: B018


def test_shots_of_patterns_load_neither_rays_nor_the_past() -> None:
    code = "from hitplanes import Disc, Pistol, Scene, fire; scene = Scene(); fire(scene, {}, (0, 0))"
    rays = {"hitplanes.weapons.rays.ray_call", "hitplanes.weapons.rays.ray_walk", "hitplanes.weapons.rays.ray_hits"}
    assert not loaded_by(code.format("Disc(3)")) & {"hitplanes.planes.scene.history", *rays}
    assert loaded_by(code.format("Pistol(3)")) >= rays
