"""Read, compare and write goldens: the hits that a test accepted.

A golden is `<name>.json` (the report), `<name>.npz` (whole planes) and `<name>.png` (the picture without text). One of
hits alone is a `<name>.json` without the parts of the report that what lies near may change.
"""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.common.checks import Bools, Image, InputError, array_of, choice, integer, kind_of, printable
from hitplanes.planes.common.limits import POSITION_MAX
from hitplanes.planes.common.tables import Text
from hitplanes.planes.files.png import read_png, write_bytes, write_png, write_text
from hitplanes.planes.files.scene_folder import laid_out
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import Hits
from ..report.differences import BATCH_COLUMNS, Entry, decisive, differences
from ..report.picture import picture_of_report
from ..report.report import report_of

FORMAT = "hitplanes-golden/1"

PLANES_AREA_MAX = 4 * 2**20  # largest scene whose planes are stored, px: two compressed planes take some tens of kB
SCENE_PLANES = ("hittable", "occluders")  # planes of a scene that decide hits
CHANGED_MAX = 8  # most changed objects that a line names
LINE_DEPTH = 5  # depth from which JSON stays on one line: a row, a blocker or the samples of a verdict

DAMAGE = (
    OSError, ValueError, KeyError, EOFError, MemoryError, NotImplementedError, RuntimeError, SyntaxError,
    struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""Errors that reading a damaged archive of arrays may raise."""

HITS = "hits"  # the only part that may be asked for alone

HOW = ("shot", "weapon", "at", "aim", "seed", "accept", "blocked_by", "exclude")
"""Keys of a shot that say how it was fired; they are kept to be read, and not compared."""

WHAT = ("object", "name", "round", "samples", "pixels", "weight", "pellets", "first_xy", "distance2", "runs")
"""Keys of a row that are kept; the others depend on what lies near."""

Plane = npt.NDArray[Any]


class DamagedGoldenError(InputError):
    """A golden cannot be read; an update replaces it."""


class ForeignGoldenError(InputError):
    """The file was written by a newer hitplanes or is no golden; it is never overwritten."""


@dataclass(frozen=True)
class Tolerance:
    """How much the rows of hits may differ."""

    pixels: int = 0  # most pixels by which the number of hit pixels of an object may differ
    px: int = 0  # farthest that the first hit pixel of an object may move, px

    def __bool__(self) -> bool:
        return bool(self.pixels or self.px)

    def exceeded(self, was: Entry, now: Entry) -> list[str]:
        """What exceeds it in two rows of one object, and by how much; empty if nothing does."""
        more = now["pixels"] - was["pixels"]
        far2 = sum((to - at) ** 2 for to, at in zip(now["first_xy"], was["first_xy"], strict=True))
        count = f"{abs(more)} px {'more' if more > 0 else 'less'}, tolerance_pixels={self.pixels}"
        lines = [count] if abs(more) > self.pixels else []
        return lines + ([f"first hit {far2**0.5:.1f} px away, tolerance_px={self.px}"] if far2 > self.px**2 else [])


EXACT = Tolerance()  # no difference is tolerated


@dataclass(frozen=True, eq=False)
class Golden:
    """Hits as a golden stores them."""

    test: str  # node id of the test, from its file's name on
    name: str | None  # given in the test, if it has several goldens
    report: dict[str, Any]  # report of the hits, without the parts that a comparison ignores
    planes: dict[str, Plane]  # planes (h, w) or (h, w, channels) by name: those of the scene, then the user's
    origin_xy: tuple[int, int]  # pixel of the world at [0, 0] of the scene's planes
    left_out: str | None  # why the scene's planes are not stored, or None
    picture: Image | None  # (h, w, 3 or 4) bytes, without text; None for hits alone
    only: str | None = None  # "hits" if there is nothing but the rows of hits, else None
    scene: Scene | None = None  # scene that was fired at, for texts and pictures; not stored
    whole: dict[str, Any] | None = None  # the whole report, for pictures; not stored

    def text(self) -> str:
        """Return the JSON, laid out so that texts compare well."""
        arrays = [{"name": k, "dtype": v.dtype.str[1:], "shape": list(v.shape)} for k, v in self.planes.items()]
        data = {
            "format": FORMAT,
            "test": self.test,
            "name": self.name,
            **({} if self.only is None else {"only": self.only}),
            "planes": arrays,
            "origin_xy": list(self.origin_xy),
            "left_out": self.left_out,
            "report": self.report,
        }
        return laid_out(data, whole=LINE_DEPTH) + "\n"

    def write(self, base: Path, changed: Unlike | None = None) -> None:
        """Write the files whose parts have changed, by default all; the JSON is written last."""
        if changed is None or changed.kept or changed.planes:
            _write_planes(_file(base, "npz"), self.planes)
        if self.picture is None:
            _file(base, "png").unlink(missing_ok=True)
        elif changed is None or changed.kept or changed.picture:
            write_png(_file(base, "png"), self.picture)
        text, path = self.text(), _file(base, "json")
        if changed is None or not path.is_file() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)


@dataclass(frozen=True)
class Unlike:
    """Differences between a golden and the hits got, as lines about the hits, what is kept, each plane, the picture."""

    hits: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    planes: dict[str, list[str]] = field(default_factory=dict)
    picture: list[str] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """All lines in printable form, hits first."""
        every = [*self.hits, *self.kept, *(line for lines in self.planes.values() for line in lines), *self.picture]
        return list(map(printable, every))


def check_present(hits: object) -> Hits:
    """Check that hits are Hits, and that their scene is as it was; an InputError names what has changed."""
    if not isinstance(hits, Hits):
        raise InputError(f"hits: expected Hits, as fire returns them, got {kind_of(hits)}")
    scene = hits.scene
    if hits.version == scene.version:
        return hits
    rows = scene.items.changed_rows(hits.version)
    gone = [item for item in hits._stack.ids.tolist() if item not in scene]
    there = [] if rows is None else scene.items.id[np.intersect1d(rows, scene.items.rows)].tolist()
    ids = sorted({*there, *gone})
    names = [f"{item} {json.dumps(scene.name_of(item))}" for item in ids[:CHANGED_MAX]]
    more = f" and {len(ids) - CHANGED_MAX} more" if len(ids) > CHANGED_MAX else ""
    changed = f": changed since: object {', '.join(names)}{more}" if names else ""
    versions = f"at version {hits.version}, as it was fired at, got {scene.version}"
    raise InputError(f"hits: expected the scene {versions}{changed}: fire again, or compare before it changes")


def golden_of(hits: object, planes: object, test: str, name: str | None, only: str | None = None) -> Golden:
    """Make a golden of hits and the user's planes, or of hits alone; an InputError says what is wrong."""
    hits = check_present(hits)
    scene = hits.scene
    report = report_of(scene, [hits])
    if only is not None:
        if planes:
            raise InputError(f"planes: expected none with only={only!r}, got {len(_own_planes(planes))}")
        part = json.loads(json.dumps(hits_alone(report)))
        return Golden(test, name, part, {}, (0, 0), None, None, only, scene, report)
    kept, origin_xy, left_out = _scene_planes(scene)
    kept |= _own_planes(planes)
    part, picture = json.loads(json.dumps(decisive(report))), picture_of_report(report, scene, text=False)
    return Golden(test, name, part, kept, origin_xy, left_out, picture, scene=scene)


def read_golden(base: Path) -> Golden | None:
    """Read a golden; None if there is none. A DamagedGoldenError or ForeignGoldenError names the file."""
    path = _file(base, "json")
    if not path.exists():
        return None
    data = _checked(path)
    try:
        planes = _read_planes(_file(base, "npz"), data["planes"]) if data["planes"] else {}
        report = dict(data["report"])
        for shot in report["shots"]:
            shot.setdefault("blocked_by", shot["accept"])  # before there were two filters, one was both
        only = data.get("only")
        part = hits_alone(report)
        hits_unlike(part, part, Tolerance(1))  # a damaged part fails here, and not when it is compared
        origin_xy = int(data["origin_xy"][0]), int(data["origin_xy"][1])
        picture = None if only == HITS else _read_picture(_file(base, "png"))
        return Golden(data["test"], data["name"], report, planes, origin_xy, data["left_out"], picture, only)
    except (AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
        if isinstance(error, DamagedGoldenError):
            raise
        raise DamagedGoldenError(f"{path}: expected a golden, got one that is damaged: {error!r:.80}") from error


def unlike(expected: Golden, got: Golden, tolerance: Tolerance = EXACT) -> Unlike:
    """Compare two goldens, of hits alone with a tolerance, and else exactly."""
    if expected.only is not None or got.only is not None:
        lines = hits_unlike(hits_alone(expected.report), hits_alone(got.report), tolerance)
        kept = [
            "the whole answer" if side.only is None else f"hits alone (only={side.only!r})" for side in (expected, got)
        ]
        return Unlike(lines, [] if kept[0] == kept[1] else [f"the golden keeps {kept[0]}, the test asks for {kept[1]}"])
    planes: dict[str, list[str]] = {}
    if expected.left_out != got.left_out:
        planes["scene"] = [f"planes of the scene: {got.left_out or 'kept'}, was {expected.left_out or 'kept'}"]
    if expected.origin_xy != got.origin_xy:
        planes["origin"] = [f"planes of the scene begin at {got.origin_xy}, was {expected.origin_xy}"]
    for name in dict.fromkeys([*expected.planes, *got.planes]):
        lines = _plane_lines(name, expected.planes.get(name), got)
        if lines:
            planes[name] = lines
    assert expected.picture is not None and got.picture is not None  # only hits alone have none
    picture = _picture_lines(expected.picture, got.picture)
    return Unlike(differences(expected.report, got.report), planes=planes, picture=picture)


def pixels_unlike(was: Plane, now: Plane) -> Bools:
    """Return where two arrays of one shape differ, as (h, w); NaN equals NaN."""
    differ = (was != now) & ~((was != was) & (now != now))
    return np.asarray(differ.any(axis=2) if differ.ndim == 3 else differ)


def _plane_lines(name: str, was: Plane | None, got: Golden) -> list[str]:
    now = got.planes.get(name)
    if was is None or now is None:
        return [f"plane {name!r} is {'new' if was is None else 'missing'}"]
    lines = []
    if was.dtype.str[1:] != now.dtype.str[1:]:
        lines.append(f"plane {name!r}: dtype {now.dtype}, was {was.dtype}")
    if was.shape != now.shape:
        return [*lines, f"plane {name!r}: shape {now.shape}, was {was.shape}"]
    differ = pixels_unlike(was, now)
    if differ.any():
        y, x = np.argwhere(differ)[0].tolist()
        after, before = ((_called(name, side[y, x], got.scene)) for side in (now, was))
        if name in SCENE_PLANES:
            x, y = x + got.origin_xy[0], y + got.origin_xy[1]
        lines.append(f"plane {name!r}: pixels differ: {differ.sum()}, first at ({x}, {y}): {after}, was {before}")
        labels = np.union1d(was[differ], now[differ])
        texts = [_called(name, label, got.scene) for label in labels[labels > 0]] if name in SCENE_PLANES else []
        if len(texts) > 1:
            more = f" and {len(texts) - CHANGED_MAX} more" if len(texts) > CHANGED_MAX else ""
            lines.append(f"plane {name!r}: changed: {', '.join(texts[:CHANGED_MAX])}{more}")
    return lines


def _called(plane: str, value: Any, scene: Scene | None) -> str:
    """Return the text of a plane's value; in a plane of the scene it is an object."""
    if plane not in SCENE_PLANES:
        return str(value.tolist())
    item = int(value) - 1
    if item < 0:
        return "nothing"
    known = scene is not None and item < scene.items.count
    return f"object {item}" + (f" {json.dumps(scene.name_of(item), ensure_ascii=False)}" if known else "")  # type: ignore[union-attr]


def _picture_lines(was: Image, now: Image) -> list[str]:
    was, now = (opaque(picture) for picture in (was, now))
    if was.shape != now.shape:
        return [f"picture: {now.shape[1]} x {now.shape[0]} px, was {was.shape[1]} x {was.shape[0]}"]
    differ = pixels_unlike(was, now)
    if not differ.any():
        return []
    y, x = np.nonzero(differ)
    box = f"({x.min()}, {y.min()}) to ({x.max()}, {y.max()})"
    return [f"picture: pixels differ: {len(x)}, in the box {box} of the picture; 0 may"]


def opaque(picture: Image) -> Image:
    """Return a picture with an alpha channel; a picture without one is opaque."""
    return picture if picture.shape[2] == 4 else np.pad(picture, ((0, 0), (0, 0), (0, 1)), constant_values=255)


def _scene_planes(scene: Scene) -> tuple[dict[str, Plane], tuple[int, int], str | None]:
    """Return the planes that decide hits, their origin, and why they are left out, or None."""
    x, y, x_max, y_max = scene.extent()
    width, height = x_max - x + 1, y_max - y + 1
    if width * height > PLANES_AREA_MAX:
        return {}, (x, y), f"left out: {width} x {height} px are more than {PLANES_AREA_MAX}"
    planes = scene.planes()
    return {name: getattr(planes, name) for name in SCENE_PLANES}, planes.origin_xy, None


def _own_planes(planes: object) -> dict[str, Plane]:
    """Check and copy the user's planes."""
    if not isinstance(planes, Mapping):
        raise InputError(f"planes: expected arrays by name, got {kind_of(planes)}")
    kept = {}
    for key, value in planes.items():
        name = Text().check("planes", key)
        array = array_of(f"planes[{name!r}]", value)
        if name in SCENE_PLANES:
            raise InputError(f"planes: expected a name other than {' and '.join(SCENE_PLANES)}, got {name!r}")
        if array.dtype.kind not in "biuf" or array.ndim not in (2, 3) or not array.size:
            got = f"shape {array.shape} of {array.dtype}"
            raise InputError(f"planes[{name!r}]: expected numbers (h, w) or (h, w, channels), got {got}")
        kept[name] = array.copy()
    return kept


def _file(base: Path, kind: str) -> Path:
    return base.with_name(f"{base.name}.{kind}")


def _checked(path: Path) -> dict[str, Any]:
    """Read the JSON of a golden, and check its format."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DamagedGoldenError(f"{path}: expected a golden, got no JSON: {error}") from error
    written = data.get("format") if isinstance(data, dict) else None
    if written == FORMAT:
        return dict(data)
    newer = isinstance(written, str) and re.fullmatch(r"hitplanes-golden/\d+", written)
    got = f"{written!r}: made by a newer hitplanes" if newer else f"format {written!r:.60}: no golden"
    raise ForeignGoldenError(f"{path}: expected {FORMAT!r}, got {got}; it is left alone")


def _read_planes(path: Path, listed: list[dict[str, Any]]) -> dict[str, Plane]:
    planes: dict[str, Plane] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            for entry in listed:
                data = io.BytesIO(archive.read(f"{entry['name']}.npy"))
                planes[entry["name"]] = np.lib.format.read_array(data, allow_pickle=False)
    except DAMAGE as error:
        got = "no file" if isinstance(error, FileNotFoundError) else f"a file that is damaged: {error}"
        raise DamagedGoldenError(f"{path}: expected the planes of a golden, got {got}") from error
    return planes


def _write_planes(path: Path, planes: Mapping[str, Plane]) -> None:
    """Write arrays as an npz archive; numpy.savez cannot store the name "file". Without arrays, delete the archive."""
    if not planes:
        with suppress(FileNotFoundError):
            path.unlink()
        return
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, plane in planes.items():
            data = io.BytesIO()
            np.lib.format.write_array(data, np.ascontiguousarray(plane), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy")  # of 1980: the same bytes at any time
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data.getvalue())
    write_bytes(path, whole.getvalue())


def _read_picture(path: Path) -> Image:
    try:
        return read_png(path, "picture")
    except InputError as error:
        raise DamagedGoldenError(f"{path}: {error}") from error


# Hits alone


def tolerance_of(only: object, tolerance_pixels: object, tolerance_px: object) -> Tolerance:
    """Check what is asked of a golden beside its name and planes."""
    if only is not None:
        choice("only", only, (HITS,))
    given = {"tolerance_pixels": tolerance_pixels, "tolerance_px": tolerance_px}
    pixels, px = (integer(name, value, 0, 2 * POSITION_MAX) for name, value in given.items())
    if only is None and (pixels or px):
        name = "tolerance_pixels" if pixels else "tolerance_px"
        raise InputError(f"{name}: expected together with only={HITS!r}, got {pixels or px} for a whole golden")
    return Tolerance(pixels, px)


def hits_alone(report: Entry) -> dict[str, Any]:
    """The part of a report that a golden of hits alone keeps: how each shot was fired, and its rows."""
    shots = [
        {key: shot[key] for key in HOW if key in shot}
        | {"rows": [{key: row[key] for key in WHAT if key in row} for row in shot["rows"]]}
        for shot in report["shots"]
    ]
    batch = report["batch"] and {
        "shots": report["batch"]["shots"],
        "objects": [{key: entry[key] for key in ("object", "name")} for entry in report["batch"]["objects"]],
        "rows": report["batch"]["rows"],
    }
    return {"weapons": report["weapons"], "shots": shots, "batch": batch}


def hits_unlike(expected: Entry, got: Entry, tolerance: Tolerance) -> list[str]:
    """Lines about the hits of two kept parts that differ by more than a tolerance.

    How the shots were fired is not compared, nor the order of the rows of a shot. An object that is newly hit, or no
    longer, differs whatever the tolerance. With a tolerance the numbers of pixels and the first pixels are compared;
    samples, weights and pellets follow from them.
    """
    was, now = _rows(expected), _rows(got)
    exceeded: list[str] = []
    for shot in range(min(len(was), len(now)) if tolerance else 0):
        after_of = {_key(row): row for row in now[shot]}
        for place, before in enumerate(was[shot]):
            after = after_of.get(_key(before), before)
            excess = tolerance.exceeded(before, after)
            exceeded += [f"shot {shot}: object {after['object']}: {line}" for line in excess]
            was[shot][place] = before if excess or _key(before) not in after_of else after
    parts = expected, got
    alike = got if len(was) == len(now) else expected
    objects = {entry["object"]: entry for part in parts for entry in (part["batch"] or {"objects": ()})["objects"]}
    before, after = (
        _compared(part, how, rows, [objects[item] for item in sorted(objects)])
        for part, how, rows in zip(parts, (alike, got), (was, now), strict=True)
    )
    return differences(before, after) + exceeded


def _rows(part: Entry) -> list[list[Entry]]:
    """Rows of each shot, sorted by object and round; those of a batch in the form of the others."""
    rows: list[list[Entry]] = [list(shot["rows"]) for shot in part["shots"]]
    if part["batch"]:
        rows = [[] for _ in range(part["batch"]["shots"])]
        for row in part["batch"]["rows"]:
            columns = dict(zip(BATCH_COLUMNS, row, strict=True))
            rows[row[0]].append({**columns, "first_xy": [columns["x"], columns["y"]]})
    return [sorted(own, key=_key) for own in rows]


def _key(row: Entry) -> tuple[int, int]:
    return row["object"], row["round"]


def _compared(part: Entry, how: Entry, rows: list[list[Entry]], objects: list[Entry]) -> dict[str, Any]:
    """Report of these rows for `differences`: its shots are described as in `how`, objects of a batch have names."""
    if part["batch"]:
        listed = [[row[column] for column in BATCH_COLUMNS] for own in rows for row in own]
        return {"batch": {"shots": len(rows), "objects": objects, "rows": listed}, "shots": []}
    hows = [{key: shot.get(key) for key in ("weapon", "at", "aim")} for shot in how["shots"]]
    return {"batch": None, "shots": [{**shot, "rows": own} for shot, own in zip(hows, rows, strict=True)]}


def reports_of_hits(whole: Entry, expected: Entry, got: Entry) -> list[dict[str, Any]]:
    """Two reports that show the expected hits and those got, and no other samples, on the scene as it is.

    They are made of the whole report of the hits got and of both kept parts. There are none if there is a batch, or not
    the same number of shots.
    """
    if not whole["shots"] or len(expected["shots"]) != len(whole["shots"]):
        return []
    reports = []
    for part in (expected, got):
        own = [shot["rows"] for shot in part["shots"]]
        runs = [{"hit": [run for row in rows for run in row["runs"]]} for rows in own]
        shots = zip(whole["shots"], own, runs, strict=True)
        reports.append({**whole, "shots": [{**shot, "rows": rows, "samples": hit} for shot, rows, hit in shots]})
    return reports
