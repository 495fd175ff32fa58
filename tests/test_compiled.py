"""Compiled kernels on disk are those of the files as they are, whole, and this user's; without a disk they work."""

from __future__ import annotations

import ast
import errno
import importlib
import json
import os
import pickle
import shutil
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hitplanes import Disc, History, InputError, Pistol, Scene, Sprite, fire, warm_up
from hitplanes.planes.common import backend

ROOT = Path(__file__).parent.parent

CALLING = """
from numba import types
from hitplanes.planes.called import told
from hitplanes.planes.jit.cache import compiled

@compiled(types.int64(types.int64))
def asked(number):
    return told(number)
"""
CALLED = """
from numba import njit
from hitplanes.planes.under.below.named import MORE

@njit
def told(number):
    return number + MORE + {}
"""
ASK = "from hitplanes.planes.calling import asked as a; print(a(1), sum(a.stats.cache_hits.values()), end='')"


def more(number: Any) -> Any:
    return number + 1


def news() -> list[str]:
    """What the next plan tells, but that `more` was compiled."""
    return [text for text in backend.news() if not text.startswith("compiled more,")]


@pytest.fixture
def compiling(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module that compiles, as in a process that has neither compiled nor told anything."""
    pytest.importorskip("numba")
    module = importlib.import_module("hitplanes.planes.jit.cache")
    monkeypatch.setattr(backend, "_news", deque())
    monkeypatch.setattr(backend, "_told", set())
    module._folder.cache_clear()
    yield module
    module._folder.cache_clear()


@pytest.fixture
def kept(tmp_path: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a user wants kernels to be kept: there is no such folder yet."""
    monkeypatch.setattr(compiling.config, "CACHE_DIR", str(tmp_path / "user" / "kept"))
    return tmp_path / "user" / "kept"


def asked(compiling: Any, number: float = 1) -> tuple[Any, int]:
    """What a kernel tells when it is new to the process, and how often it was found on disk."""
    kernel = compiling.compiled()(more)
    return kernel(number), sum(kernel.stats.cache_hits.values())


def copied(folder: Path) -> dict[str, str]:
    """Copy the packages, and tell the environment of processes that use the copy, and keep kernels beside it."""
    for source, place in (("weapons/api", ""), ("planes", "planes"), ("weapons", "weapons")):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / source, folder / "hitplanes" / place, ignore=ignored, dirs_exist_ok=True)
    return {**os.environ, "NUMBA_CACHE_DIR": str(folder / "kept")}


def run(folder: Path, environment: dict[str, str], code: str) -> str:
    words = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout


# Of the files as they are


@pytest.mark.long
def test_a_kernel_is_compiled_anew_when_what_it_calls_or_names_changes(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    environment = copied(tmp_path)
    (tmp_path / "hitplanes" / "planes" / "calling.py").write_text(CALLING)
    (tmp_path / "hitplanes" / "planes" / "under" / "below").mkdir(parents=True)
    for number, more, expected in ((1, 0, ("2 0", "2 1")), (2, 0, ("3 0", "3 1")), (2, 10, ("13 0", "13 1"))):
        (tmp_path / "hitplanes" / "planes" / "called.py").write_text(CALLED.format(number))
        (tmp_path / "hitplanes" / "planes" / "under" / "below" / "named.py").write_text(f"MORE = {more}\n")
        assert (run(tmp_path, environment, ASK), run(tmp_path, environment, ASK)) == expected


def test_the_stamp_is_of_all_files_of_python(tmp_path: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "files", lambda package: tmp_path / package.removeprefix("hitplanes."))
    stamp, seen = compiling._stamp.__wrapped__, set()
    for number, name in enumerate(
        ("planes/a.py", "weapons/a.py", "planes/b/a.py", "planes/b/c/a.py", "weapons/b/a.py")
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "weapons").mkdir(exist_ok=True)
        for text in ("A = 1\n", "A = 2\n"):
            (tmp_path / name).write_text(text)
            seen.add(stamp())
        assert len(seen) == 2 * number + 2 and stamp() in seen, name
    (tmp_path / "planes" / "b" / "a.pyc").write_text("no source")
    assert stamp() in seen
    (tmp_path / "planes" / "b" / "c" / "a.py").rename(tmp_path / "planes" / "b" / "d.py")
    assert stamp() not in seen


def test_kernels_of_other_files_are_not_used(kept: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for stamp in (b"one", b"other", b"one"):
        monkeypatch.setattr(compiling, "_stamp", lambda stamp=stamp: stamp)
        assert (asked(compiling), asked(compiling)) == ((2, 0), (2, 1))
    assert len(list(kept.rglob("*.kernel"))) == 1


# Whole


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def replace_by_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


DAMAGE: dict[str, Callable[[Path], Any]] = {
    "empty": lambda file: file.write_bytes(b""),
    "shorter than a digest": lambda file: file.write_bytes(file.read_bytes()[:9]),
    "cut": cut,
    "noise": lambda file: file.write_bytes(bytes(range(256)) * 99),
    "another pickle": lambda file: file.write_bytes(pickle.dumps(("0.1", {}))),
    "a folder": replace_by_folder,
    "gone": lambda file: file.unlink(),
}


def test_the_next_plan_tells_what_was_compiled(kept: Path, compiling: Any) -> None:
    assert asked(compiling) == (2, 0)
    assert backend.news() == ["compiled more, which hitplanes warm-up does at a better time"]
    assert asked(compiling) == (2, 1) and backend.news() == []


@pytest.mark.parametrize("kind", DAMAGE)
def test_what_is_damaged_is_compiled_and_kept_anew(kind: str, kept: Path, compiling: Any) -> None:
    assert (asked(compiling), asked(compiling)) == ((2, 0), (2, 1))
    (file,) = kept.rglob("*.kernel")
    DAMAGE[kind](file)
    assert asked(compiling) == (2, 0)
    again = asked(compiling)
    if kind == "a folder":
        assert again == (2, 0) and [str(file.parent) in told for told in news()] == [True]
    else:
        assert again == (2, 1) and news() == []
    assert list(kept.rglob("*.kernel")) == [file] and not list(kept.rglob("*.part"))


def test_no_bit_is_overlooked(kept: Path, compiling: Any) -> None:
    asked(compiling)
    (file,) = kept.rglob("*.kernel")
    whole = file.read_bytes()
    for part in range(8):
        held = bytearray(whole)
        held[part * len(held) // 8] ^= 1
        file.write_bytes(held)
        assert asked(compiling) == (2, 0), part
        assert file.read_bytes() != bytes(held)


@pytest.mark.parametrize("held", [("0.1", {}), ({}, 1, 2, 3, 4, 5, 6, 7, 8), 7])
def test_what_is_whole_but_no_kernel_is_compiled(held: object, kept: Path, compiling: Any) -> None:
    asked(compiling)
    (file,) = kept.rglob("*.kernel")
    file.write_bytes(compiling._digest(file.name, pickle.dumps(held)) + pickle.dumps(held))
    assert (asked(compiling), asked(compiling)) == ((2, 0), (2, 1))


def test_a_kernel_under_the_name_of_another_is_not_used(kept: Path, compiling: Any) -> None:
    asked(compiling, 1)
    (whole,) = kept.rglob("*.kernel")
    asked(compiling, 1.5)
    (real,) = set(kept.rglob("*.kernel")) - {whole}
    shutil.copy(whole, real)
    assert (asked(compiling, 1.5), asked(compiling, 1.5)) == ((2.5, 0), (2.5, 1))


def test_a_full_disk_is_told_once(kept: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(self: Path, held: bytes) -> None:
        with self.open("wb") as file:
            file.write(held[:50])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as full:
        full.setattr(Path, "write_bytes", write)
        assert [asked(compiling), asked(compiling), asked(compiling, 1.5)] == [(2, 0), (2, 0), (2.5, 0)]
    (told,) = news()
    assert os.strerror(errno.ENOSPC) in told and str(kept) in told
    assert [path for path in kept.rglob("*") if path.is_file()] == []
    assert (asked(compiling), asked(compiling)) == ((2, 0), (2, 1))


def test_who_writes_at_the_same_time_spoils_nothing(
    kept: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kernels of the same and of other types are kept between the first and the last byte of one."""
    inner = Path.write_bytes

    def write(self: Path, held: bytes) -> None:
        with monkeypatch.context() as other:
            other.setattr(Path, "write_bytes", inner)
            assert [asked(compiling), asked(compiling, 1.5)] == [(2, 0), (2.5, 0)]
            inner(self, held[: len(held) // 2])
            assert [asked(compiling), asked(compiling, 1.5)] == [(2, 1), (2.5, 1)]
        inner(self, held)

    with monkeypatch.context() as first:
        first.setattr(Path, "write_bytes", write)
        assert asked(compiling) == (2, 0)
    assert [asked(compiling), asked(compiling, 1.5)] == [(2, 1), (2.5, 1)]
    assert len(list(kept.rglob("*"))) == 3 and news() == []


@pytest.mark.long
def test_processes_that_start_at_the_same_time_spoil_nothing(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    environment = copied(tmp_path)
    (tmp_path / "hitplanes" / "planes" / "calling.py").write_text(CALLING.replace("types.int64(types.int64)", ""))
    (tmp_path / "hitplanes" / "planes" / "called.py").write_text(CALLED.format(1))
    (tmp_path / "hitplanes" / "planes" / "under" / "below").mkdir(parents=True)
    (tmp_path / "hitplanes" / "planes" / "under" / "below" / "named.py").write_text("MORE = 1\n")
    ask = "from hitplanes.planes.calling import asked as a; print({}, sum(a.stats.cache_hits.values()), end='')"
    words = [[sys.executable, "-c", ask.format(f"a({n})")] for n in ("1", "1.5", "1", "1.5")]
    pipe = subprocess.PIPE
    started = [subprocess.Popen(each, cwd=tmp_path, env=environment, stdout=pipe, text=True) for each in words]
    assert [one.communicate()[0].split()[0] for one in started] == ["3", "3.5", "3", "3.5"]
    assert run(tmp_path, environment, ask.format("a(1), a(1.5)")) == "3 3.5 2"


# This user's


def modes(*folders: Path) -> list[int]:
    return [folder.stat().st_mode & 0o7777 for folder in folders]


@pytest.mark.skipif(sys.platform != "linux", reason="caches lie elsewhere")
def test_the_folder_is_private(tmp_path: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "new" / "caches"))
    before = os.umask(0)
    try:
        assert (asked(compiling), asked(compiling)) == ((2, 0), (2, 1))
    finally:
        os.umask(before)
    (file,) = tmp_path.rglob("*.kernel")
    assert file.parent.parent == tmp_path / "new" / "caches" / "hitplanes"
    assert modes(*list(file.parents)[:4]) == [0o700] * 4


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners, no bits")
@pytest.mark.parametrize(("which", "mode", "used"), [
    ("kernels", 0o755, True), ("kernels", 0o770, False), ("kernels", 0o702, False), ("kept", 0o755, True),
    ("kept", 0o770, False), ("kept", 0o1777, False), ("user", 0o755, True), ("user", 0o777, False),
    ("user", 0o1777, True),
])  # fmt: skip
def test_a_folder_that_others_can_write_to_is_not_used(
    which: str, mode: int, used: bool, kept: Path, compiling: Any
) -> None:
    """Nor one that they can replace; from one with the sticky bit they cannot take what is not theirs."""
    asked(compiling)
    (file,) = kept.rglob("*.kernel")
    folder = {"kernels": file.parent, "kept": kept, "user": kept.parent}[which]
    folder.chmod(mode)
    compiling._folder.cache_clear()
    assert asked(compiling) == (2, used)
    assert asked(compiling, 1.5) == (2.5, 0)
    assert len(list(kept.rglob("*.kernel"))) == 1 + used
    assert [str(folder) in told for told in news()] == [True] * (not used)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners")
def test_a_folder_of_another_user_is_not_used(kept: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    asked(compiling)
    compiling._folder.cache_clear()
    monkeypatch.setattr(os, "geteuid", lambda: kept.stat().st_uid + 1)
    assert asked(compiling) == asked(compiling) == (2, 0)
    (told,) = news()
    assert "another user" in told


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners")
@pytest.mark.parametrize("which", ["kernels", "kept", "user"])
def test_a_folder_given_to_another_user_is_not_used(which: str, kept: Path, compiling: Any) -> None:
    asked(compiling)
    (file,) = kept.rglob("*.kernel")
    try:
        os.chown({"kernels": file.parent, "kept": kept, "user": kept.parent}[which], 65534, -1)
    except PermissionError:
        pytest.skip("only root can")
    compiling._folder.cache_clear()
    assert asked(compiling) == (2, 0) and len(news()) == 1


def file_in_the_way(tmp_path: Path) -> str:
    (tmp_path / "file").write_text("")
    return str(tmp_path / "file")


def circle(tmp_path: Path) -> str:
    (tmp_path / "link").symlink_to(tmp_path / "link")
    return str(tmp_path / "link")


@pytest.mark.parametrize("where", [file_in_the_way, circle])
def test_without_a_folder_each_process_compiles(
    where: Callable[[Path], str], tmp_path: Path, compiling: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling.config, "CACHE_DIR", where(tmp_path))
    assert asked(compiling) == asked(compiling) == (2, 0)
    assert len(news()) == 1 and news() == []


def test_a_user_without_a_home_has_no_folder(compiling: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling.config, "CACHE_DIR", "")
    monkeypatch.setattr(compiling, "AppDirs", lambda *_, **__: type("", (), {"user_cache_dir": "~/.cache/hitplanes"}))
    assert asked(compiling) == (2, 0)
    assert ["no folder for caches" in told for told in news()] == [True]


# Shots


@pytest.mark.parametrize("kind", ["disc", "ray", "past"])
def test_the_next_plan_tells_once(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "_news", deque())
    monkeypatch.setattr(backend, "_told", set())
    scene = Scene((50, 40))
    scene.add(Sprite.box(9, 9), (20, 20))
    past = History(scene)
    for tick in (0, 1):
        past.record(tick)

    def plan() -> list[str]:
        if kind == "past":
            hits = fire(past, Disc(3), [(20, 20)] * 2, tick=[0, 1])
        else:
            hits = fire(scene, Disc(3) if kind == "disc" else Pistol(9), [(20, 20)])
        assert len(hits) > 0
        return [stage.why for stage in hits.plan.ran if stage.name == "kernels"]

    before = plan()
    for what in ("one", "two", "one"):
        backend.tell(what)
    assert (before, plan(), plan()) == ([], ["one; two"], [])
    backend.tell("two")
    assert plan() == []


SHOOT = """
import json, sys
from hitplanes import Point, Scene, Sprite, fire, use_jit
scene, told = Scene((50, 40)), []
for x in range(9, 50, 7):
    scene.add(Sprite.box(9, 9), (x, 20), angle=x)
for jit in (False, True, True):
    use_jit(jit)
    hits = fire(scene, Point(), [(x, y) for x in range(50) for y in (9, 20)])
    rows = [[int(row.shot), int(row.object), row.pixels, *row.first_xy] for row in hits]
    told.append([rows, [stage.why for stage in hits.plan.ran if stage.name == "kernels"]])
assert "hitplanes.planes.jit.areas" in sys.modules
print(json.dumps(told))
"""


@pytest.mark.long
def test_shots_hit_the_same_where_nothing_can_be_written(tmp_path: Path) -> None:
    """Files lie in the way of all folders for kernels: those stop root, too."""
    pytest.importorskip("numba")
    environment = copied(tmp_path)
    for folder in [tmp_path / "hitplanes", *(tmp_path / "hitplanes").rglob("*/")]:
        (folder / "__pycache__").write_text("")
    del environment["NUMBA_CACHE_DIR"]
    nowhere = file_in_the_way(tmp_path)
    names = ("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA")
    told = json.loads(run(tmp_path, {**environment, **dict.fromkeys(names, nowhere)}, SHOOT))
    rows = [each for each, _ in told]
    assert len(rows[0]) > 20 and rows[0] == rows[1] == rows[2]
    (why,) = told[1][1]
    assert nowhere in why and told[0][1] == told[2][1] == []


@pytest.mark.long
def test_shots_hit_the_same_where_kernels_are_damaged(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    environment = copied(tmp_path)
    first = json.loads(run(tmp_path, environment, SHOOT))
    files = sorted((tmp_path / "kept").rglob("*.kernel"))
    assert len(files) >= len(DAMAGE) - 1
    for number, file in enumerate(files):
        list(DAMAGE.values())[number % len(DAMAGE)](file)
    second, third = (json.loads(run(tmp_path, environment, SHOOT)) for _ in range(2))
    for told in (first, second, third):
        assert [rows for rows, _ in told] == [first[0][0]] * 3
    assert all(told[0][1] == told[2][1] == [] for told in (first, second, third))
    assert all(told[1][1][0].startswith("compiled ") for told in (first, second, third))


AFTER_WARM_UP = """
import sys
import numpy as np
from hitplanes import Beam, Disc, Laser, Pistol, Point, Scene, Spread, Sprite, fire, prepare, use_jit, warm_up
from hitplanes.planes.common.backend import COMPILED
from hitplanes.planes.jit import cache

steps = []
assert warm_up(lambda done, of: steps.append((done, of))) > 0
assert [done for done, _ in steps] == list(range(steps[0][1] + 1)), steps
def ready():
    # argument types that each kernel is ready for
    jit = [vars(sys.modules[name]) for name in sorted(set(COMPILED.values())) if name in sys.modules]
    kernels = {id(kernel): kernel for module in jit for kernel in module.values()}
    return {k: len(v.signatures) for k, v in kernels.items() if isinstance(getattr(v, "_cache", None), cache._Kept)}

before = ready()
scene = Scene((300, 200))
ids = [scene.add(Sprite.circle(9), (20 * i, 90)) for i in range(1, 12)]
scene.add(Sprite.box(20, 20), (100, 120), role="occluder")
at = np.random.default_rng(1).uniform(0, 200, (300, 2))
for weapon in (Point(), Disc(20), Disc(20, falloff="linear"), Spread(Disc(2), 8, 20), Beam(50, 4)):
    for strategy in ("auto", "direct", "built"):
        fire(scene, weapon, at, aim=20, strategy=strategy)
    prepare(scene, weapon).fire((50, 50), aim=20)
for weapon in (Pistol(90), Laser(90), Laser(90, width=5)):
    for strategy in ("cast", "march", "walk"):
        fire(scene, weapon, at, aim=20, strategy=strategy)
    prepare(scene, weapon).fire((50, 50), aim=20)
scene.move(np.array(ids), np.random.default_rng(2).uniform(0, 200, (len(ids), 2)))
scene.move(ids[0], (5, 5))
scene.set(ids[1], angle=33)
fire(scene, Point(), at, strategy="labels")
scene.planes()
assert ready() == before
print(len(before), end="")
"""


def test_after_a_warm_up_nothing_is_compiled() -> None:
    pytest.importorskip("numba")
    for command in ([sys.executable, "-m", "hitplanes", "warm-up"], [sys.executable, "-c", AFTER_WARM_UP]):
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        if "warm-up" in command:
            assert run.stdout.startswith("all kernels are ready: ") and run.stderr.startswith("0 of ")
        else:
            assert int(run.stdout) > 20


def test_a_warm_up_needs_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.common.backend.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"^jit: expected numba, .* got no such module$"):
        warm_up()


def test_the_progress_of_a_warm_up_is_a_function() -> None:
    with pytest.raises(InputError, match=r"^progress: expected a function, got int$"):
        warm_up(5)  # type: ignore[arg-type]


def helpers_of(source: str) -> dict[str, tuple[ast.FunctionDef, bool]]:
    """Helpers of kernels in a source, by name, each with whether it says that it allocates."""
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    by = {
        node: [ast.unparse(of) for of in node.decorator_list if ast.unparse(of).startswith("helper(")]
        for node in functions
    }
    return {node.name: (node, "allocates=True" in of[0]) for node, of in by.items() if of}


def arrays_in(function: ast.FunctionDef) -> set[str]:
    """Names of a function that are arrays: they are read at an index and are no tuple, or are a slice."""
    nodes = list(ast.walk(function))
    read = {ast.unparse(node.value) for node in nodes if isinstance(node, ast.Subscript)}
    given = [(ast.unparse(node.targets[0]), node.value) for node in nodes if isinstance(node, ast.Assign)]
    tuples = {name for name, value in given if isinstance(value, ast.Tuple)}
    return read - tuples | {name for name, value in given if is_slice(value)}


def is_slice(node: ast.AST) -> bool:
    return isinstance(node, ast.Subscript) and any(isinstance(part, ast.Slice) for part in ast.walk(node.slice))


def unsafe(source: str, allocating: set[str]) -> list[str]:
    """Helpers without counts of references that return an array, or call one that returns a new array."""
    found = []
    for name, (function, allocates) in helpers_of(source).items():
        returns = [node.value for node in ast.walk(function) if isinstance(node, ast.Return) and node.value]
        parts = [part for value in returns for part in (value.elts if isinstance(value, ast.Tuple) else [value])]
        calls = {ast.unparse(node.func) for node in ast.walk(function) if isinstance(node, ast.Call)}
        if not allocates and (
            any(is_slice(part) or ast.unparse(part) in arrays_in(function) for part in parts) or calls & allocating
        ):
            found.append(name)
    return found


def returning(source: str) -> set[str]:
    """Helpers that allocate and return something."""
    return {
        name
        for name, (function, allocates) in helpers_of(source).items()
        if allocates and any(isinstance(node, ast.Return) and node.value for node in ast.walk(function))
    }


def test_helpers_that_count_no_references_return_no_array() -> None:
    """Else the memory of an array would be freed while it is in use, or never."""
    sources = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "planes" / "jit").glob("*.py"))]
    allocating = set().union(*map(returning, sources))
    assert {"layout", "more_parts", "_room_for"} <= allocating
    assert [name for source in sources for name in unsafe(source, allocating)] == []
    bad = "@helper()\ndef a(b):\n    return b[0], b\n@helper()\ndef c(b):\n    d = b[1:]\n    return d\n"
    assert unsafe(bad + "@helper()\ndef e(b):\n    return layout(b, b)[0][0]\n", allocating) == ["a", "c", "e"]
