"""The package as users get it, from a wheel, an editable and a strict editable install, beside a game's own modules."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path
from typing import NamedTuple

import pytest
from test_without_opencv import SHOTS

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
VERSION = PROJECT["project"]["version"]
SETUPTOOLS = PROJECT["build-system"]["requires"]
NEEDED = PROJECT["project"]["dependencies"]
OPENCV = [need for need in NEEDED if need.startswith("opencv")]
SCRIPTS = "Scripts" if os.name == "nt" else "bin"
FOLDERS = ("tests", "fixtures")
CACHES = {"__pycache__", ".pytest_cache", ".hypothesis"}
KINDS = ("wheel", "editable", "strict")

BUILD = """
import sys
from setuptools import build_meta
print(getattr(build_meta, "build_" + sys.argv[1])(sys.argv[2]))
"""

GAMES = {
    "modules": {"planes.py": "OWN = 'planes of the game'", "weapons.py": "OWN = 'weapons of the game'"},
    "packages": {
        "planes.py": "OWN = 'planes of the game'",
        "weapons/__init__.py": "OWN = 'weapons of the game'",
        "weapons/fire.py": "OWN = 'fire of the game'",
    },
}
"""Files of two projects, which have the names of our folders."""

GAME_TEST = """
import planes, weapons

def test_own_modules():
    assert planes.OWN == "planes of the game" and weapons.OWN == "weapons of the game"
"""

QUIET = """
import sys

def pytest_sessionfinish(session):
    ours = {name for name in sys.modules if name.split(".")[0] == "hitplanes"}
    assert ours == {"hitplanes", "hitplanes.weapons", "hitplanes.weapons.golden"}, ours
    assert not {"numpy", "cv2", "numba", "matplotlib"} & set(sys.modules)
"""
"""A conftest.py of a project that does not use the fixture."""

GAME_SCRIPT = """
import planes, weapons
from hitplanes import Disc, Scene, Sprite, fire

scene = Scene((99, 99))
scene.add(Sprite.circle(5), (50, 50), name="duck")
print(planes.OWN, weapons.OWN, [scene.name_of(row.object) for row in fire(scene, Disc(3), (50, 50))])
"""

GOLDEN_TEST = """
from hitplanes import Disc, Scene, Sprite, fire

def test_golden(hits_golden):
    scene = Scene((99, 99))
    scene.add(Sprite.circle(5), (50, 50), name="duck")
    hits_golden(fire(scene, Disc(3), (50, 50)))
"""


def run(*words: str | Path, cwd: Path, path: Path | None = None, expected: int = 0) -> str:
    """Run a command, with nothing of this project on its path; its standard output."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "PYTEST", "COV"))}
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == expected, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def pip(*words: str | Path, cwd: Path, path: Path | None = None) -> None:
    run(sys.executable, "-m", "pip", "--disable-pip-version-check", *words, cwd=cwd, path=path)


def copy_of_tree(to: Path) -> Path:
    """A copy of the repository to build from: builds leave files."""
    to.mkdir(parents=True)
    skip = shutil.ignore_patterns(*CACHES)
    for folder in ("planes", "weapons", *FOLDERS):
        shutil.copytree(ROOT / folder, to / folder, ignore=skip)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, to / name)
    return to


class Environment(NamedTuple):
    """A virtual environment: its folder, its site-packages, and the names that were there when it was empty."""

    folder: Path
    site: Path
    before: frozenset[str]

    @property
    def python(self) -> Path:
        return self.folder / SCRIPTS / "python"

    @property
    def command(self) -> Path:
        return self.folder / SCRIPTS / "hitplanes"

    def names(self) -> set[str]:
        """What was installed, but for metadata."""
        return {path.name for path in self.site.iterdir() if path.suffix != ".dist-info"} - self.before


class Kitchen:
    """Builds and installs, each once, in a folder; what must be downloaded is put beside the environments."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.needs, self.opencv, self.dist = folder / "needs", folder / "opencv", folder / "dist"
        self._environments: dict[str, Environment] = {}
        others = [need for need in NEEDED if need not in OPENCV]
        pip("install", "--quiet", "--target", self.needs, *others, *SETUPTOOLS, "pytest", cwd=folder)
        pip("install", "--quiet", "--target", self.opencv, "--no-deps", *OPENCV, cwd=folder)
        self.tree = copy_of_tree(folder / "tree")
        self.wheel = self.build("wheel", self.tree, self.dist)

    def build(self, what: str, tree: Path, to: Path) -> Path:
        """Build a wheel or an sdist as pip does."""
        to.mkdir(exist_ok=True)
        return to / run(sys.executable, "-c", BUILD, what, to, cwd=tree, path=self.needs).splitlines()[-1]

    def environment(self, kind: str, opencv: bool = True) -> Environment:
        """An environment with the package in it."""
        name = f"{kind} {opencv}"
        if name not in self._environments:
            self._environments[name] = self._made(name, kind, opencv)
        return self._environments[name]

    def _made(self, name: str, kind: str, opencv: bool) -> Environment:
        folder = self.folder / name.replace(" ", "_")
        run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=self.folder)
        python = folder / SCRIPTS / "python"
        where = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=self.folder)
        site = Path(where.strip())
        others = [self.needs, self.opencv] if opencv else [self.needs]
        (site / "others.pth").write_text("".join(f"{other}\n" for other in others))
        environment = Environment(folder, site, frozenset(path.name for path in site.iterdir()))
        install = ("--python", python, "install", "--quiet", "--no-deps", "--no-build-isolation")
        if kind == "wheel":
            pip(*install, self.wheel, cwd=self.folder)
        else:
            tree = copy_of_tree(self.folder / f"tree_{kind}")
            settings = ("--config-settings", "editable_mode=strict") if kind == "strict" else ()
            pip(*install, "-e", tree, *settings, cwd=self.folder)
        return environment


@pytest.fixture(scope="module")
def kitchen(tmp_path_factory: pytest.TempPathFactory) -> Kitchen:
    return Kitchen(tmp_path_factory.mktemp("kitchen"))


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)


# What is built


def in_wheel() -> dict[str, Path]:
    """Each file of the packages, by its place in a wheel; the licence lies beside the metadata."""
    found = {}
    for path in (path for folder in ("planes", "weapons") for path in (ROOT / folder).rglob("*")):
        if path.is_file() and not CACHES & {*path.parts} and path.name != "LICENSE":
            name = f"hitplanes/{path.relative_to(ROOT).as_posix()}"
            found[name.replace("hitplanes/weapons/api/", "hitplanes/")] = path
    return found


def test_a_wheel_has_what_the_packages_have(kitchen: Kitchen) -> None:
    with zipfile.ZipFile(kitchen.wheel) as wheel:
        files = {name: wheel.read(name) for name in wheel.namelist()}
    info = f"hitplanes-{VERSION}.dist-info/"
    assert {name for name in files if not name.startswith(info)} == set(in_wheel())
    assert all(files[name] == path.read_bytes() for name, path in in_wheel().items())
    assert files[f"{info}licenses/planes/LICENSE"] == (ROOT / "planes" / "LICENSE").read_bytes()
    told = message_from_bytes(files[f"{info}METADATA"])
    assert (told["License-Expression"], told["License-File"]) == ("MIT", "planes/LICENSE")
    assert told["Description-Content-Type"] == "text/markdown"
    assert str(told.get_payload()).strip() == (ROOT / "planes" / "ABOUT.md").read_text(encoding="utf-8").strip()
    assert files[f"{info}top_level.txt"].split() == [b"hitplanes"]


def test_an_sdist_has_what_its_tests_need_and_makes_the_same_wheel(kitchen: Kitchen, tmp_path: Path) -> None:
    sdist = kitchen.build("sdist", kitchen.tree, kitchen.dist)
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    tree = tmp_path / f"hitplanes-{VERSION}"
    for folder in ("planes", "weapons", *FOLDERS):
        there, here = (
            {
                path.relative_to(root): path.read_bytes()
                for path in (root / folder).rglob("*")
                if path.is_file() and not CACHES & {*path.parts}
            }
            for root in (tree, ROOT)
        )
        assert there == here
    assert {path.name for path in tree.iterdir()} >= {"README.md", "pyproject.toml"}
    wheels = (kitchen.wheel, kitchen.build("wheel", tree, tmp_path))
    first, second = ({item.filename: item.CRC for item in zipfile.ZipFile(wheel).infolist()} for wheel in wheels)
    assert first == second


# What is installed


@pytest.mark.parametrize("kind", KINDS)
def test_one_import_name_is_installed(kitchen: Kitchen, kind: str, tmp_path: Path) -> None:
    environment = kitchen.environment(kind)
    names = environment.names()
    if kind == "wheel":
        assert names == {"hitplanes"}
    else:
        assert names and all(name.startswith(("__editable__", "__pycache__")) for name in names)
    code = "from importlib.util import find_spec as f; print([bool(f(n)) for n in ('hitplanes', 'planes', 'weapons')])"
    assert run(environment.python, "-c", code, cwd=tmp_path) == "[True, False, False]\n"


@pytest.mark.parametrize("game", GAMES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_game_keeps_modules_of_these_names(kitchen: Kitchen, kind: str, game: str, tmp_path: Path) -> None:
    python = kitchen.environment(kind).python
    write(tmp_path, GAMES[game] | {"test_game.py": GAME_TEST, "conftest.py": QUIET, "script.py": GAME_SCRIPT})
    pytest_words = (python, "-W", "error", "-m", "pytest", "-q", "-p", "no:cacheprovider")
    assert "1 passed" in run(*pytest_words, cwd=tmp_path)
    printed = run(python, "-W", "error", "script.py", cwd=tmp_path)
    assert printed == "planes of the game weapons of the game ['duck']\n"


@pytest.mark.parametrize("kind", KINDS)
def test_the_plugin_and_the_command_are_installed(kitchen: Kitchen, kind: str, tmp_path: Path) -> None:
    environment = kitchen.environment(kind)
    words = (environment.python, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    write(tmp_path, {"test_golden.py": GOLDEN_TEST})
    run(*words, cwd=tmp_path, expected=1)
    assert "1 golden updated" in run(*words, "--hits-update", cwd=tmp_path)
    assert "1 passed" in run(*words, cwd=tmp_path)
    for command in ([environment.command], [environment.python, "-m", "hitplanes"]):
        assert run(*command, "--version", cwd=tmp_path) == f"hitplanes {VERSION}\n"
    run(environment.command, "new", "range", cwd=tmp_path)
    run(environment.python, "-m", "hitplanes", "report", "range", cwd=tmp_path)
    assert (tmp_path / "report.png").stat().st_size > 10_000
    assert (tmp_path / "range" / "scene.schema.json").is_file()


def test_an_environment_without_opencv_decides_hits(kitchen: Kitchen, tmp_path: Path) -> None:
    python = kitchen.environment("wheel", opencv=False).python
    run(python, "-c", "import cv2", cwd=tmp_path, expected=1)
    run(python, "-W", "error", "-c", SHOTS, cwd=tmp_path)
