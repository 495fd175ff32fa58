"""Check one call of `hits_golden`, draw its failure, and find the goldens that no test uses."""

from __future__ import annotations

import hashlib
import html
import json
import os
import re
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote

import numpy as np
import numpy.typing as npt
import pytest

from hitplanes.planes.common.checks import Bools, Image, InputError, printable
from hitplanes.planes.common.tables import DEVICE
from hitplanes.planes.files.png import put_in_place, write_png, write_text
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.render import plane_objects
from hitplanes.planes.scene.scene import Scene

from ..report.canvas import enlarged
from ..report.differences import first_of
from ..report.phrases import counted
from ..report.picture import picture_of_difference, picture_of_report
from .file import (
    EXACT,
    SCENE_PLANES,
    DamagedGoldenError,
    ForeignGoldenError,
    Golden,
    Tolerance,
    Unlike,
    golden_of,
    opaque,
    pixels_unlike,
    read_golden,
    reports_of_hits,
    unlike,
)

RED = (255, 40, 40)  # colour of pixels that differ
GROUND = (12, 13, 16)  # colour of the zeros of a plane
NOWHERE = (60, 62, 68)  # colour of pixels outside the smaller one of two pictures
DIM = 140  # brightness of pixels that do not differ, of 255
PICTURE_CLOSE, PLANE_CLOSE = 80, 40  # width of the part that a close view shows of a picture and of a plane, px
CLOSE_SIDE = 320  # approximate width at which a close view is drawn, px
GAP = 8  # gap between close views, px
COMPARED = "hits.png"  # picture of the expected hits and those got, side by side

HASH = np.array([73_856_093, 19_349_663, 83_492_791], np.uint64)
"""Primes that give neighbouring labels different colours: Teschner et al., "Optimized Spatial Hashing" (2003)."""

Plane = npt.NDArray[Any]

Write = Callable[[str, Image], None]  # writes a picture, given the name of its file
Row = list[tuple[str, str]]  # caption and file of pictures that are shown side by side
SIDE_BY_SIDE, TEXTLESS = "hits: expected, got, difference", " (goldens have no text)"


def draw_difference(write: Write, expected: Golden | None, got: Golden, changed: Unlike) -> list[Row]:
    """Write pictures of the expected and the actual hits, and of their difference; return the rows of the page."""
    picture = got.picture
    if picture is None:
        assert got.whole is not None and got.scene is not None  # golden_of has made it
        picture = picture_of_report(got.whole, got.scene, text=False)
    write("got.png", picture)
    rows: list[Row] = []
    if expected is None or expected.picture is None or got.picture is None:
        pair = [] if expected is None or got.whole is None else reports_of_hits(got.whole, expected.report, got.report)
        if pair and changed.hits:
            write(COMPARED, picture_of_difference(pair[0], pair[1], (got.scene, got.scene)))
            rows += [[(SIDE_BY_SIDE, COMPARED)]]
        return [*rows, [(f"got{TEXTLESS}", "got.png")]]
    write("expected.png", expected.picture)
    if changed.hits:
        scenes = scene_of(expected), got.scene
        write(COMPARED, picture_of_difference(expected.report, got.report, scenes))
        rows += [[(SIDE_BY_SIDE, COMPARED)]]
    rows += [[(f"expected{TEXTLESS}", "expected.png"), (f"got{TEXTLESS}", "got.png")]]
    if changed.picture:
        was, now = opaque(expected.picture), opaque(got.picture)
        rows[-1] += [("difference", "difference.png")]
        rows += [_close(write, "", was, now, _differ(was, now), PICTURE_CLOSE)]
    for number, name in enumerate(name for name in changed.planes if name in expected.planes and name in got.planes):
        was, now = expected.planes[name], got.planes[name]
        prefix, differ = f"plane-{number}-", _differ(was, now)  # the name may not be valid in that of a file
        rows += [_close(write, prefix, coloured(was), coloured(now), differ, PLANE_CLOSE, f"plane {name}: ")]
    return rows


def scene_of(golden: Golden) -> Scene | None:
    """Rebuild the scene of a golden from its planes: the visible parts of objects and occluders, under their ids."""
    if not set(SCENE_PLANES) <= golden.planes.keys():
        return None
    scene = Scene()
    fields = zip(SCENE_PLANES, (Role.HITTABLE, Role.OCCLUDER), strict=True)
    found = [(role, *item) for name, role in fields for item in plane_objects(name, role.value, golden.planes[name])]
    for role, label, sprite, left, top in sorted(found, key=lambda item: int(item[1])):
        scene.items.table.skip_to(int(label) - 1)
        scene.add(sprite, (left + golden.origin_xy[0], top + golden.origin_xy[1]), role=role)
    return scene


def picture_of_pixels(now: Image, differ: Bools) -> Image:
    """Return a dimmed picture, red where it differs."""
    out = np.full((*differ.shape, 3), NOWHERE, np.uint8)
    grey = now[:, :, :3].astype(np.uint32).sum(axis=2, keepdims=True) // 3 * DIM // 255
    out[: now.shape[0], : now.shape[1]] = grey
    out[differ] = RED
    return out


def coloured(plane: Plane) -> Image:
    """Colour a plane (h, w) or (h, w, channels): labels in distinct colours, floats from dark to light."""
    if plane.dtype == np.uint8 and plane.ndim == 3 and plane.shape[2] in (3, 4):
        return plane[:, :, :3]
    flat = plane if plane.ndim == 2 else plane.max(axis=2, initial=0)
    out = np.full((*flat.shape, 3), GROUND, np.uint8)
    if flat.dtype.kind == "f":
        known = np.where(np.isfinite(flat), flat, 0).astype(np.float64)
        top = max(float(np.abs(known).max(initial=0)), np.finfo(np.float64).tiny)
        out[:] = (np.abs(known) / top * 255).astype(np.uint8)[:, :, None]
        return out
    mask = flat != 0
    labels = flat[mask].astype(np.int64).astype(np.uint64)
    out[mask] = 80 + (labels[:, None] * HASH >> np.uint64(7)) % np.uint64(176)
    return out


def _differ(was: Plane, now: Plane) -> Bools:
    """Return where two planes differ, as a mask that spans both; pixels that only one of them has differ."""
    height, width = (max(sides) for sides in zip(was.shape[:2], now.shape[:2], strict=True))
    out = np.ones((height, width), np.bool_)
    rows, columns = (min(sides) for sides in zip(was.shape[:2], now.shape[:2], strict=True))
    was, now = ((side if side.ndim == 3 else side[:, :, None])[:rows, :columns] for side in (was, now))
    channels = min(was.shape[2], now.shape[2])
    out[:rows, :columns] = pixels_unlike(was[:, :, :channels], now[:, :, :channels])
    return out


def _close(write: Write, prefix: str, was: Image, now: Image, differ: Bools, side: int, caption: str = "") -> Row:
    """Write a picture of the difference, and enlarged views of both pictures and of it around the first pixel."""
    difference = picture_of_pixels(now, differ)
    write(f"{prefix}difference.png", difference)
    y, x = (int(v[0]) for v in np.nonzero(differ)) if differ.any() else (0, 0)
    width, height = min(side, differ.shape[1]), min(side * 3 // 4, differ.shape[0])
    left = min(max(x - width // 2, 0), differ.shape[1] - width)
    top = min(max(y - height // 2, 0), differ.shape[0] - height)
    factor = max(CLOSE_SIDE // width, 1)
    views = []
    for picture in (was, now, difference):
        view = np.full((height, width, 3), NOWHERE, np.uint8)
        part = picture[top : top + height, left : left + width, :3]
        view[: part.shape[0], : part.shape[1]] = part
        views.append(np.pad(enlarged(view, factor), ((0, 0), (0, GAP), (0, 0))))
    write(f"{prefix}crop.png", np.concatenate(views, axis=1)[:, :-GAP])
    around = f"{caption}around ({x}, {y}), {factor} times: expected, got, difference"
    whole = [(f"{caption}difference", f"{prefix}difference.png")] if caption else []
    return [*whole, (around, f"{prefix}crop.png")]


GOLDENS = "goldens"  # name of the folder of goldens beside the test files
FOLDER = "hits-failures"  # folder of failures, in the root of the tests
PAGE = "index.html"  # page of the failures
LIST = "files.txt"  # list of the files that belong to us; its first line is MARK
IGNORE = ".gitignore"
MARK = "hitplanes-failures/1: the files listed here are ours, and go with the next run that uses hits_golden"

STYLE = """
body { margin: 2rem auto; max-width: 110rem; padding: 0 1.5rem; font: 16px/1.5 system-ui, sans-serif;
  background: #18191d; color: #eef0f4; }
h1, h2 { font-weight: 600; } h2 { margin: 3rem 0 .25rem; overflow-wrap: anywhere; }
a { color: #8ec5ff; } .where, figcaption { color: #9ea4ae; font-size: .9rem; }
pre { background: #23262c; padding: 1rem; overflow-x: auto; border-left: 4px solid #ff2828; white-space: pre-wrap; }
.row { display: flex; flex-wrap: wrap; gap: 1rem; } figure { margin: 1rem 0; flex: 1 1 24rem; min-width: 0; }
img { max-width: 100%; image-rendering: pixelated; background: #000; }
"""


def claimed(folder: Path) -> bool:
    """Make the folder with our mark in it; False if it exists and is not ours, or cannot be made.

    Folder and mark appear in one step, so one of several processes makes them and the others see both. A folder of
    hidden files alone, as file managers leave them, gets the mark and keeps its files.
    """
    if _is_ours(folder):
        return True
    aside = folder.with_name(f"{folder.name}.{os.getpid()}.part")
    with suppress(OSError):
        aside.mkdir()
        (aside / LIST).write_text(MARK + "\n", encoding="utf-8")
        (aside / IGNORE).write_text("*\n", encoding="utf-8")
        with suppress(OSError):
            folder.rmdir()  # an empty folder belongs to nobody
        if _all_hidden(folder):
            os.link(aside / LIST, folder / LIST)  # the file appears with its text, and never in place of another
            os.link(aside / IGNORE, folder / IGNORE)
        else:
            put_in_place(aside, folder)
        note_files(folder, [IGNORE])
    for name in (LIST, IGNORE):
        with suppress(OSError):
            (aside / name).unlink()
    with suppress(OSError):
        aside.rmdir()
    return _is_ours(folder)


def note_files(folder: Path, names: Iterable[str]) -> None:
    """Add files to the list of ours; called before they are written."""
    with (folder / LIST).open("a", encoding="utf-8", newline="\n") as file:
        file.write("".join(f"{name}\n" for name in names))


def replace_page(folder: Path, failures: Sequence[dict[str, Any]]) -> bool:
    """Write the page of this run's failures, and delete the files of earlier runs.

    Without failures the folder is deleted too, unless it holds files of others. A failure is a dict with "test",
    "golden", "lines", "folder", "texts" (files) and "rows" of (caption, file). Returned is whether there is a page.
    """
    if not _is_ours(folder):
        return False
    ours = [PAGE] if failures else []
    for failure in failures:
        files = [*failure["texts"], *(file for row in failure["rows"] for _, file in row)]
        ours += [f"{failure['folder']}/{file}" for file in files]
    _delete(folder, [name for name in _listed(folder) if name not in ours and name != IGNORE])
    if failures:
        (folder / PAGE).write_text(_page(failures), encoding="utf-8", newline="\n")
        (folder / LIST).write_text("\n".join([MARK, IGNORE, *ours]) + "\n", encoding="utf-8", newline="\n")
        return True
    _delete(folder, [IGNORE, LIST])
    with suppress(OSError):
        folder.rmdir()
    return False


def relative(path: Path, start: Path) -> str:
    """Return a path relative to `start`, with slashes; absolute if they are on different drives."""
    try:
        return os.path.relpath(path, start).replace(os.sep, "/")
    except ValueError:
        return path.as_posix()


def printed(path: Path, start: Path) -> str:
    """Return a path relative to `start` as it is printed."""
    return printable(relative(path, start))


def _delete(folder: Path, names: Iterable[str]) -> None:
    """Delete files of the folder, and its subfolders that become empty."""
    for name in names:
        path = folder / name
        if path.parent.is_symlink():
            continue
        with suppress(OSError):
            path.unlink()
        if path.parent != folder:
            with suppress(OSError):
                path.parent.rmdir()


def _page(failures: Sequence[dict[str, Any]]) -> str:
    """Return the HTML of the page, which refers to local files only."""
    count = f"{counted(len(failures), 'golden')} failed"
    parts = [f"<h1>{count}</h1>"]
    if len(failures) > 1:
        links = (
            f'<li><a href="#{i}">{_escaped(f["test"])}</a>: {_escaped(f["golden"])}</li>'
            for i, f in enumerate(failures)
        )
        parts.append(f"<ol>{''.join(links)}</ol>")
    parts += [_section(i, failure) for i, failure in enumerate(failures)]
    head = f'<meta charset="utf-8"><title>{count}</title><style>{STYLE}</style>'
    body = "\n".join(parts)
    return f'<!doctype html>\n<html lang="en">\n<head>{head}</head>\n<body>\n{body}\n</body>\n</html>\n'


def _section(number: int, failure: dict[str, Any]) -> str:
    """Return the HTML of one failure: its text, then its pictures."""
    folder = quote(failure["folder"])
    texts = ", ".join(f'<a href="{folder}/{quote(name)}">{_escaped(name)}</a>' for name in failure["texts"])
    rows = "".join(f'<div class="row">{"".join(_figure(folder, *c) for c in row)}</div>' for row in failure["rows"])
    return (
        f'<h2 id="{number}">{_escaped(failure["test"])}</h2>\n'
        f'<p class="where">{_escaped(failure["golden"])} ({texts})</p>\n'
        f"<pre>{chr(10).join(map(_escaped, failure['lines']))}</pre>\n{rows}"
    )


def _figure(folder: str, caption: str, name: str) -> str:
    path, text = f"{folder}/{quote(name)}", _escaped(caption)
    image = f'<a href="{path}"><img src="{path}" alt="{text}"></a>'
    return f"<figure><figcaption>{text}</figcaption>{image}</figure>"


def _escaped(text: str) -> str:
    """Escape a text for HTML."""
    return html.escape(printable(text))


def _is_ours(folder: Path) -> bool:
    try:
        with (folder / LIST).open(encoding="utf-8") as file:
            return file.readline().startswith("hitplanes-failures/")
    except (OSError, ValueError):
        return False


def _all_hidden(folder: Path) -> bool:
    """Whether a folder is there with no files but hidden ones; a .gitignore counts, as ours would go in its place."""
    names = (name for _, _, files in os.walk(folder) for name in files)
    return folder.is_dir() and all(name.startswith(".") and name != IGNORE for name in names)


def _listed(folder: Path) -> list[str]:
    """Return the listed files, which lie in the folder or in a subfolder of it; other paths are ignored."""
    names = (folder / LIST).read_text(encoding="utf-8").splitlines()[1:]
    paths = [(name, PurePosixPath(name)) for name in dict.fromkeys(names)]
    return [
        name
        for name, path in paths
        if 0 < len(path.parts) <= 2 and ".." not in path.parts and not path.is_absolute() and "\\" not in name
    ]


LINES_MAX, PAGE_LINES_MAX = 20, 500  # most lines of a failure's message, and of its text on the page
NAME_LETTERS, HASH_DIGITS = 80, 10  # most letters of a file's name, and digits of the hash in it
PLAIN = re.compile(r"[a-z0-9_]+(\[[a-z0-9_.,=+-]*\])?"), re.compile(r"[a-z0-9_]([a-z0-9_.-]*[a-z0-9_])?")


@dataclass(frozen=True)
class Call:
    """One call of `hits_golden`."""

    node: str  # id of the test in this run
    test: str  # id of the test from its file's name on, which does not depend on where pytest runs
    name: str | None  # given in the test, or None
    base: Path  # path of the golden's files, without their endings
    root: Path  # folder to which the paths of tests are relative
    here: Path  # folder to which printed paths are relative
    update: bool  # whether to write a golden that is missing or differs
    only: str | None = None  # "hits" for hits alone, None for the whole answer
    tolerance: Tolerance = EXACT  # how much the rows of hits alone may differ

    @classmethod
    def of(cls, item: pytest.Item, name: str | None, only: str | None, tolerance: Tolerance) -> Call:
        """Return the call of a test."""
        inside, config = item.nodeid.partition("::")[2], item.config
        base = item.path.parent / GOLDENS / item.path.stem / safe_name(inside, name)
        here, update = config.invocation_params.dir, bool(config.getoption("hits_update"))
        test = f"{item.path.name}::{inside}"
        return cls(item.nodeid, test, name, base, config.rootpath, here, update, only, tolerance)


@dataclass(frozen=True)
class Outcome:
    """Outcome of a call: "same", "updated" or "failed", and for a failure its message and its entry on the page."""

    kind: str
    message: str = ""
    failure: dict[str, Any] = field(default_factory=dict)


def safe_name(test: str, name: str | None = None) -> str:
    """Return a file name for a golden of a test, unique and valid on every system.

    A short name of small letters stays as it is. Others become their letters and a hash, as systems differ in the
    characters, the case and the length that they accept.
    """
    whole = test if name is None else f"{test}-{name}"
    plain = PLAIN[0].fullmatch(test) and PLAIN[1].fullmatch("_" if name is None else name)
    like_hashed = re.fullmatch(rf".*-[0-9a-f]{{{HASH_DIGITS}}}", whole)
    if plain and len(whole) <= NAME_LETTERS and not DEVICE.fullmatch(whole) and not like_hashed:
        return whole
    digest = hashlib.sha256(repr((test, name)).encode()).hexdigest()[:HASH_DIGITS]
    letters = re.sub(r"[^A-Za-z0-9_]+", "-", whole).strip("-")[:NAME_LETTERS]
    return f"{letters}-{digest}".lstrip("-")


def settle(call: Call, hits: object, planes: Mapping[str, object]) -> Outcome:
    """Compare hits with their golden; if they differ, update the golden or write the failure.

    An InputError says if the hits or the planes are of a wrong type.
    """
    got = golden_of(hits, planes, call.test, call.name, call.only)
    expected, changed, ours = None, None, True
    try:
        expected = read_golden(call.base)
        changed = unlike(expected, got, call.tolerance) if expected else None
        lines = ["there is no golden of these hits yet"] if changed is None else changed.lines
    except DamagedGoldenError as error:
        lines = [str(error)]
    except ForeignGoldenError as error:
        lines, ours = [str(error)], False
    if not lines:
        return Outcome("same")
    if call.update and ours:
        call.base.parent.mkdir(parents=True, exist_ok=True)
        got.write(call.base, changed)
        return Outcome("updated")
    failure, look = _show(call, lines, expected, got, changed or Unlike())
    accept = ["accept: run again with --hits-update"] if ours else []
    same = ["the hits are the same"] if changed is not None and not changed.hits else []
    message = [*first_of(lines, LINES_MAX), *same, f"golden: {failure['golden']}", f"look: {look}", *accept]
    return Outcome("failed", "\n".join(message), failure)


def _show(
    call: Call, lines: list[str], expected: Golden | None, got: Golden, changed: Unlike
) -> tuple[dict[str, Any], str]:
    """Write the files of a failure; return its entry on the page, and the path to look at."""
    golden = f"{printed(call.base, call.here)}.json"
    failure: dict[str, Any] = {"test": call.node, "golden": golden, "lines": lines[:PAGE_LINES_MAX]}
    failure |= {"folder": "", "texts": [], "rows": []}
    folder, name = call.root / FOLDER, safe_name(relative(call.base, call.root))
    if not claimed(folder):
        why = "is there, and not ours: move or remove it" if folder.exists() else "cannot be made"
        return failure, f"nowhere: {printed(folder, call.here)} {why}"
    texts = {"got.json": got} if expected is None else {"expected.json": expected, "got.json": got}

    def write(file: str, picture: Image) -> None:
        note_files(folder, [f"{name}/{file}"])
        write_png(folder / name / file, picture)

    try:
        note_files(folder, [f"{name}/{file}" for file in texts])
        (folder / name).mkdir(exist_ok=True)
        for file, side in texts.items():
            write_text(folder / name / file, side.text())
        rows = draw_difference(write, expected, got, changed)
    except (OSError, InputError) as error:
        return failure, f"nowhere: {error}"
    failure |= {"folder": name, "texts": list(texts), "rows": rows}
    return failure, printed(folder / PAGE, call.here)


KINDS = (".json", ".npz", ".png")  # endings of the files of a golden


class Collected:
    """Plugin that lists the tests of all files that have goldens beside them.

    `whole` says whether pytest reports all tests of a file.
    """

    def __init__(self, *, whole: bool) -> None:
        self._whole = whole
        self.files: dict[str, str] = {}  # node ids of test files, by path
        self.whole: set[str] = set()  # node ids of the files and classes whose tests are all known
        self.known: set[str] = set()  # node ids of the tests and classes in them, whether selected to run or not

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        """Note the tests of a file or a class."""
        report = yield
        above = isinstance(collector, pytest.Session | pytest.Directory)
        if not above and (collector.path.parent / GOLDENS).is_dir():
            if isinstance(collector, pytest.File):
                self.files[str(collector.path)] = collector.nodeid
            self.known |= {node.nodeid for node in report.result or ()}
            if report.passed and self._whole:
                self.whole.add(collector.nodeid)
        return report

    def to_json(self) -> dict[str, Any]:
        """Return the lists as JSON, to be sent to the main process."""
        return {"files": self.files, "whole": sorted(self.whole), "known": sorted(self.known)}

    def add(self, sent: Mapping[str, Any]) -> None:
        """Add the lists of another process."""
        self.files |= sent["files"]
        self.whole |= set(sent["whole"])
        self.known |= set(sent["known"])


def stale_goldens(collected: Collected, used: set[str], passed: set[str]) -> list[Path]:
    """Return the paths, without endings, of goldens that no test uses.

    A golden is stale if its test passed without using it, or no longer exists. A test that was deselected, skipped or
    failed says nothing about its goldens. In this run some goldens were used, and tests of some node ids passed.
    """
    by_place = {(Path(path).parent, Path(path).stem): node for path, node in collected.files.items()}
    stale = []
    for place in sorted({place for place, _ in by_place}):
        there = {path.stem for path in place.iterdir() if path.is_file()}
        for goldens in sorted(path for path in (place / GOLDENS).glob("*") if path.is_dir()):
            file = by_place.get((place, goldens.name))
            for base in sorted({path.with_name(path.stem) for path in goldens.iterdir() if path.suffix in KINDS}):
                gone = goldens.name not in there
                if gone or (file is not None and _is_stale(base, file, collected, used, passed)):
                    stale.append(base)
    return stale


def _is_stale(base: Path, file: str, collected: Collected, used: set[str], passed: set[str]) -> bool:
    if str(base) in used:
        return False
    inside = _test_of(base)
    if inside is None:
        tests = {node for node in collected.known if node.startswith(f"{file}::")} - collected.whole
        return file in collected.whole and tests <= passed
    node = f"{file}::{inside}"
    if node in collected.known or node in passed:
        return node in passed
    names = inside.split("::")
    classes = ("::".join([file, *names[:i]]) for i in range(1, len(names)))
    return all(part in collected.whole for part in [file, *(known for known in classes if known in collected.known)])


def _test_of(base: Path) -> str | None:
    """Return the name of a golden's test within its module; None if the golden cannot be read."""
    try:
        test = json.loads(base.with_name(f"{base.name}.json").read_text(encoding="utf-8"))["test"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return test.partition("::")[2] if isinstance(test, str) else None
