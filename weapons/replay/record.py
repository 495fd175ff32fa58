"""Records of shots and their results, which can be fired again and compared.

The first line of a record names the format. Each line after it is a JSON object for one shot:

    {"scene": "9f0c12ab", "tick": 12, "weapon": {"kind": "pistol", ...}, "at": [62, 86], "direction": [1073741824, 0],
     "accept": 1, "exclude": [], "seed": 0, "shot": 0, "result": {"rows": [...], ...}, "hash": "51ab...",
     "chain": "c07d..."}

The last line, {"end": 1, "chain": "..."}, counts the shots; a record that was not closed lacks it. `chain` is the first
16 digits of the SHA-256 of all earlier bytes of the file, so it reveals every change of a line and of their order.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple, Unpack, overload
from weakref import WeakKeyDictionary

import numpy as np

from hitplanes.planes.common.checks import InputError, kind_of, path_of, printable, shown, within
from hitplanes.planes.common.limits import ALL, POSITION_MAX, SEED_MAX, SUB, TEXT_BYTES_MAX, TICK_MAX
from hitplanes.planes.common.tables import (
    Const,
    Keys,
    Number,
    Numbers,
    Optional,
    Ref,
    Rows,
    Text,
    Value,
    Whole,
    Wholes,
    json_of,
    typed,
)
from hitplanes.planes.files.png import check_output, possible
from hitplanes.planes.grid.fixed_point import ONE, snap
from hitplanes.planes.scene.history import History, PastScene
from hitplanes.planes.scene.scene import Scene

from ..fire.call import fire, fired
from ..fire.hits import Hits
from ..kinds.areas import Rays, check_aimed, weapon_from_json
from ..kinds.placements import Shots, filter_of
from ..kinds.weapon import Weapon
from ..rays.contacts import Reason
from ..rays.ray_hits import RayHits
from ..report.differences import Entry, by_path, first_of, key_of, pairs
from ..report.differences import shown as number_of
from .shot_log import hash_of

if TYPE_CHECKING:
    from ..fire.call import Fired, Places

FORMAT = "hitplanes-shots/3"
WITHOUT_CHAIN = "hitplanes-shots/1"  # oldest format, without chain and end
ONE_FILTER = ("hitplanes-shots/2", WITHOUT_CHAIN)  # older formats, in which `accept` is the filter of what blocks, too
SEAL = b',"chain":"%b"}\n'
SEAL_BYTES = len(SEAL % bytes(16))
HEADER = Keys({"format": Text(), "version": Text()}, ("format", "version"))
END = Keys({"end": Whole(0, 2**63 - 1)}, ("end",))
AWAY = Wholes((2,), -2 * SUB * POSITION_MAX, 2 * SUB * POSITION_MAX)
PARTS = ("rows", "passes", "stops")
RESULT = Keys({**{part: Rows(Ref("columns")) for part in PARTS}, "verdicts": Ref("columns")})
COLUMNS: dict[str, Value] = {
    "scene": Text(), "tick": Optional(Number(-TICK_MAX, TICK_MAX)), "weapon": Ref("weapon"),
    "at": Numbers((2,), POSITION_MAX), "direction": Wholes((2,), -ONE, ONE), "toward_256": Optional(AWAY),
    "accept": Whole(0, ALL), "blocked_by": Whole(0, ALL), "exclude": Wholes((None,), 0, 2**31),
    "seed": Whole(0, SEED_MAX), "shot": Whole(0, 2**63 - 1), "result": Ref("result"), "hash": Text(),
}  # fmt: skip
LINE = Keys(COLUMNS, tuple(name for name in COLUMNS if name not in ("tick", "toward_256")))

AT_ONCE, BYTES_AT_ONCE = 1024, 2**21  # most shots, and about most bytes of lines, of one call; more are no faster
SAME = "all shots do the same again"
NO_END = "has no end: it was not closed, as after a crash, and may lack shots"
NUMBER_MAX = 2**63  # largest absolute value of a number in a result


class Difference(NamedTuple):
    """The first shot of a record that differs: its line in the file (from 1), its number, and the differences."""

    line: int
    shot: int
    told: tuple[str, ...]


class ShotRecord:
    """Writer that fires shots and appends each with its result to a new file.

        with ShotRecord("match.jsonl") as record:
            hits = record.fire(scene, pistol, at=(62, 86), aim=10)

    Parameters
    ----------
    path : a new file; each call of `fire` writes its lines at once, and `close` writes the last line

    Raises
    ------
    InputError
        If the file exists or cannot be made.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path_of("record", path)
        check_output(self.path)
        with possible(f"record: expected a new file, got {self.path}"):
            self._file = self.path.open("xb", buffering=0)
        self._hashes = Hashes()
        self._lock = Lock()
        self._chain, self._size, self._shots = Chain(), 0, 0
        self._write([{"format": FORMAT, "version": version("hitplanes")}])

    def __enter__(self) -> ShotRecord:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            self.close()
        except InputError:
            if error is None:  # the first error says more
                raise

    def close(self) -> None:
        """Write the last line, which counts the shots, and close the file.

        Raises
        ------
        InputError
            If the line cannot be written; the record then has no end.
        """
        if self._file.closed:
            return
        try:
            self._write([{"end": self._shots}])
        finally:
            self._file.close()

    @overload
    def fire(self, scene: Scene | History, weapon: Rays, at: Places, **arguments: Unpack[Fired]) -> RayHits: ...
    @overload
    def fire(self, scene: Scene | History, weapon: Weapon, at: Places, **arguments: Unpack[Fired]) -> Hits: ...
    def fire(self, scene: Scene | History, weapon: Weapon, at: Places, **arguments: Unpack[Fired]) -> Hits:
        """Fire like `hitplanes.fire`, write the shots, and return the hits.

        Parameters
        ----------
        arguments : those of `hitplanes.fire`

        Raises
        ------
        InputError
            If the call cannot be fired or written; the file then holds nothing of it.
        """
        if self._file.closed:
            raise InputError(f"record: expected one that is open, got {self.path}, which is closed")
        hits = fire(scene, weapon, at, **arguments)
        self._write([self._line(hits, row) for row in range(len(hits.shots))], len(hits.shots))
        return hits

    def _write(self, lines: Sequence[Mapping[str, Any]], shots: int = 0) -> None:
        """Append all lines, or none if an error or an interrupt comes."""
        texts = [json.dumps(line, separators=(",", ":"), allow_nan=False)[:-1].encode() for line in lines]
        with self._lock:
            chain = self._chain.copy()
            text = b"".join(map(chain.sealed, texts))
            left = memoryview(text)
            try:
                while len(left):
                    left = left[self._file.write(left) :]
                self._chain, self._size, self._shots = chain, self._size + len(text), self._shots + shots
            except BaseException as error:
                with suppress(OSError):
                    self._file.truncate(self._size)
                    self._file.seek(self._size)
                if isinstance(error, OSError):
                    raise InputError(f"record: cannot write {self.path}: {error.strerror}") from error
                raise

    def _line(self, hits: Hits, row: int) -> dict[str, Any]:
        scene, shots = hits.scene_of(row), hits.shots
        result = result_of(hits, row)
        aimed = {} if shots.toward_256 is None else {"toward_256": shots.toward_256[row].tolist()}
        return {
            "scene": self._hashes.of(scene),
            "tick": scene.tick if isinstance(scene, PastScene) else None,
            "weapon": hits.weapon.to_json(),
            "at": (shots.at_256[row] / SUB).tolist(),
            "direction": shots.direction[row].tolist(),
            **aimed,
            "accept": int(shots.accept[row]),
            "blocked_by": int(shots.blocked_by[row]),
            "exclude": [owner for owner in shots.exclude[row].tolist() if owner >= 0],
            "seed": int(shots.seed[row]),
            "shot": int(shots.number[row]),
            "result": result,
            "hash": hash_of(result),
        }


class Chain:
    """Running hash of a record; each line ends with it."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()

    def copy(self) -> Chain:
        """Return an independent copy."""
        other = Chain()
        other._sha = self._sha.copy()
        return other

    def sealed(self, text: bytes) -> bytes:
        """Complete the next line, given its JSON object without the last brace."""
        self._sha.update(text)
        seal = SEAL % self._sha.hexdigest()[:16].encode()
        self._sha.update(seal)
        return text + seal

    def opened(self, line: bytes) -> bytes:
        """Return the JSON object of the next line, after checking that it follows the lines before it unchanged."""
        text, seal = line[:-SEAL_BYTES], line[-SEAL_BYTES:]
        expected = self.sealed(text)
        if line != expected:
            found = seal[-19:-3]
            text_found = shown(found.decode("utf-8", "replace")) if seal == SEAL % found else "nothing"
            why = "the line was changed, or does not follow the one before it"
            raise InputError(f"chain: expected {expected[-19:-3].decode()!r}, got {text_found}: {why}")
        return text + b"}"


class Hashes:
    """Cache of content hashes, keyed by living scene and its version."""

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Scene, tuple[int, str]] = WeakKeyDictionary()

    def of(self, scene: Scene) -> str:
        """Return the content hash of a scene in its present version."""
        known = self._known.get(scene)
        if known is None or known[0] != scene.version:
            known = self._known[scene] = scene.version, scene.content_hash()
        return known[1]


def result_of(hits: Hits, row: int) -> dict[str, Any]:
    """Return the result of one shot as JSON: rows and verdicts, or for rays rows, passes and stops."""
    rows = [{**hit._asdict(), "first_xy": list(hit.first_xy)} for hit in hits.of(row)]
    result: dict[str, list[dict[str, Any]]] = {"rows": rows}
    if isinstance(hits, RayHits):
        result |= {"passes": hits.passes_at(row).to_rows(), "stops": hits.stops_at(row).to_rows()}
    for entry in (entry for part in result.values() for entry in part):
        entry.pop("shot")
        entry.pop("row", None)
    return result if isinstance(hits, RayHits) else {**result, "verdicts": hits.verdict_counts(row)}


def replay(path: str | Path, scene: Scene | History | Callable[[float | None], Scene]) -> Difference | None:
    """Fire the shots of a record again, and compare the results.

    Parameters
    ----------
    path : a file that `ShotRecord` wrote
    scene : a scene, a History for shots that have a tick, or a function that returns the scene of a tick

    Returns
    -------
    the first shot whose result differs; if all results are the same, the first shot that was fired on a scene with
    another content hash; otherwise None

    Raises
    ------
    InputError
        Naming the file, the line and the field. For a line that was changed or moved, the field is the chain.

    Warns
    -----
    UserWarning
        If the record was not closed, so that shots may be missing.
    """
    found, endless = replayed(path, scene)
    if endless:
        warnings.warn(f"{path} {NO_END}", stacklevel=2)
    return found


def replayed(
    path: str | Path, scene: Scene | History | Callable[[float | None], Scene]
) -> tuple[Difference | None, bool]:
    """Return what `replay` returns, and whether the end of the record is missing."""
    path = path_of("record", path)
    if isinstance(scene, type) or not (isinstance(scene, Scene | History) or callable(scene)):
        raise InputError(f"scene: expected a Scene, a History or a function of a tick, got {kind_of(scene)}")
    with possible(f"{path}: cannot read it"), path.open("rb") as lines:
        reading = Reading(path, lines)
        return _first_difference(path, _groups(iter(reading)), scene), reading.endless


class Recorded(NamedTuple):
    """A checked line: its number in the file (from 1), its length in bytes, its weapon and its data."""

    line: int
    size: int
    weapon: Weapon
    data: dict[str, Any]

    @property
    def call(self) -> tuple[Any, ...]:
        """Key that shots must share to be fired in one call."""
        return self.data["scene"], self.data.get("tick"), self.weapon, self.data.get("toward_256") is None


class Reading:
    """Reader that checks each line of a record, a file at its first line, whose path errors name.

    `endless` says whether all lines were read and the end is missing.
    """

    def __init__(self, path: Path, lines: BinaryIO) -> None:
        self._path, self._lines, self.endless = path, lines, False
        self._chain: Chain | None = None
        with within(f"{path} line 1"):
            line = self._lines.readline(TEXT_BYTES_MAX + 1)
            header = typed("header", self._json_of(line), dict)
            if header.get("format") != WITHOUT_CHAIN:
                Const(FORMAT, ONE_FILTER).check("format", header.get("format"))
                self._chain = Chain()
                header = self._json_of(line)
            HEADER.check("header", header)
            self._one_filter = header["format"] in ONE_FILTER

    def __iter__(self) -> Iterator[Recorded]:
        number, ended, written, weapon = 1, False, None, None
        while line := self._lines.readline(TEXT_BYTES_MAX + 1):
            number += 1
            with within(f"{self._path} line {number}"):
                if ended:
                    raise InputError("expected nothing behind the end of a record, got a line")
                data = self._json_of(line)
                ended = self._is_end(data, number - 2)
                if ended:
                    continue
                if self._one_filter and isinstance(data, dict):
                    data = {"blocked_by": data.get("accept"), **data}
                data = _checked_shot(data)
                if weapon is None or data["weapon"] != written:
                    written, weapon = data["weapon"], weapon_from_json(data["weapon"])
            yield Recorded(number, len(line), weapon, data)
        self.endless = self._chain is not None and not ended

    def _json_of(self, line: bytes) -> Any:
        """Parse the next line, after checking that it is complete and in its place; it may end with CRLF."""
        if len(line) > TEXT_BYTES_MAX:
            raise InputError(f"expected at most {TEXT_BYTES_MAX} bytes, got more")
        if not line.endswith(b"\n"):
            found = "one that is cut off, as by a crash: take it out" if line else "an empty file"
            raise InputError(f"expected a whole line of a record, got {found}")
        if line.endswith(b"\r\n"):  # as git and editors of Windows write it; no line holds a bare CR
            line = line[:-2] + b"\n"
        text = line if self._chain is None else self._chain.opened(line)
        return json_of(text.decode("utf-8", "replace"))

    def _is_end(self, data: Any, shots: int) -> bool:
        """Return whether a line is the end, and check its count of the shots before it."""
        if self._chain is None or type(data) is not dict or "end" not in data:
            return False
        count = END.check("end", data)["end"]
        if count != shots:
            raise InputError(f"end: expected {shots}, the number of shots, got {count}")
        return True


def _checked_shot(data: Any) -> dict[str, Any]:
    """Check the data of a shot, and that its result has the recorded hash."""
    shot = LINE.check("shot", data)
    _check_result(shot["result"])
    if not -1 <= math.hypot(*shot["direction"]) - ONE <= 1:
        raise InputError(f"direction: expected one of length {ONE}, got {list(shot['direction'])}")
    if hash_of(shot["result"]) != shot["hash"]:
        raise InputError(f"hash: expected that of the result, {hash_of(shot['result'])}, got {shot['hash']}")
    return shot


def _check_result(result: object) -> None:
    """Check that a result consists of columns of numbers."""
    typed("result", result, dict)
    with within("result"):
        for part, rows in RESULT.check("result", result).items():
            for i, row in enumerate([rows] if part == "verdicts" else rows):
                with within(part if part == "verdicts" else f"{part}[{i}]"):
                    for name, value in typed("columns", row, dict).items():
                        if not (_is_number(value) or (type(value) is list and all(map(_is_number, value)))):
                            raise InputError(f"{name}: expected a number, or two, got {shown(value)}")


def _is_number(value: object) -> bool:
    return type(value) in (int, float) and abs(value) <= NUMBER_MAX  # type: ignore[arg-type]


def _groups(entries: Iterator[Recorded]) -> Iterator[list[Recorded]]:
    """Group consecutive shots that one call can fire; the group before a bad line comes before its error."""
    group: list[Recorded] = []
    size = 0
    try:
        for entry in entries:
            if group and (entry.call != group[0].call or len(group) == AT_ONCE or size > BYTES_AT_ONCE):
                yield group
                group, size = [], 0
            group.append(entry)
            size += entry.size
    except InputError:
        if group:
            yield group
        raise
    if group:
        yield group


def _first_difference(path: Path, groups: Iterator[list[Recorded]], scene: Any) -> Difference | None:
    hashes, changed = Hashes(), None
    for group in groups:
        line, _, _, first = group[0]
        with within(f"{path} line {line}"):
            present = _scene_at(scene, first.get("tick"))
        texts: list[str] = []
        if (found := hashes.of(present)) != first["scene"]:
            texts = [f"scene: its content hash is {found}, was {first['scene']}{_at_tick(scene, first.get('tick'))}"]
            changed = changed or Difference(line, first["shot"], (*texts, SAME))
        for entry, result in zip(group, _results(path, present, group), strict=True):
            was = entry.data["result"]
            if result != was:
                texts += first_of(map(printable, [*_lines(present, was, result)] or by_path("", was, result)))
                return Difference(entry.line, entry.data["shot"], tuple(texts))
    return changed


def _results(path: Path, scene: Scene, group: Sequence[Recorded]) -> Iterator[dict[str, Any]]:
    """Fire the shots of a group, and yield their results."""
    weapon, shots = group[0].weapon, _shots_of([entry.data for entry in group])
    try:
        check_aimed(weapon, shots.toward_256)
        hits = fired(scene, weapon, shots)
    except InputError as error:
        if len(group) == 1:
            raise InputError(f"{path} line {group[0].line}: {error}") from error
        for entry in group:
            yield from _results(path, scene, [entry])
        return
    for row in range(len(group)):
        yield json.loads(json.dumps(result_of(hits, row)))


def _scene_at(scene: Any, tick: float | None) -> Scene:
    if isinstance(scene, History):
        if tick is None:
            raise InputError("scene: expected a Scene, as a shot has no tick, got a History")
        return scene.at(tick)
    found = scene(tick) if callable(scene) else scene
    if not isinstance(found, Scene):
        raise InputError(f"scene: expected a Scene, got {kind_of(found)}")
    return found


def _at_tick(scene: Any, tick: float | None) -> str:
    """Return the text for the tick of a shot that is fired again at a scene without ticks."""
    if tick is None or not isinstance(scene, Scene):
        return ""
    return f" at tick {tick:g}: one scene stands still here, but hitplanes.replay in Python takes a History"


def _shots_of(entries: Sequence[Mapping[str, Any]]) -> Shots:
    """Return the checked shots of some entries."""
    n, most = len(entries), max(len(entry["exclude"]) for entry in entries)
    owners = np.full((n, most), -1)
    for row, entry in enumerate(entries):
        owners[row, : len(entry["exclude"])] = entry["exclude"]
    toward = None
    if entries[0].get("toward_256") is not None:
        toward = np.array([entry["toward_256"] for entry in entries], np.int64).reshape(-1, 2)
    return Shots(
        snap([entry["at"] for entry in entries]).reshape(-1, 2),
        np.array([entry["direction"] for entry in entries], np.int64).reshape(-1, 2),
        toward,
        filter_of(*(np.array([entry[key] for entry in entries]) for key in ("accept", "blocked_by"))),
        owners,
        np.array([entry["shot"] for entry in entries], np.int64),
        np.array([entry["seed"] for entry in entries], np.uint64),
        np.arange(n),
    )


def _lines(scene: Scene, was: Entry, now: Entry) -> Iterator[str]:
    """Differences of two results as lines: objects hit, passes, ends of rays, verdicts; the order of rows has none."""
    whole = set()
    for row, old, new in pairs(was.get("rows"), now.get("rows"), "round", "object"):
        if old is None or new is None:
            whole.add(key_of(row, "round", "object"))
        yield from _compared(f"{_item(scene, row)}{_of(row, 'round')}", old, new, ("round", "object"))
    names = "round", "pellet", "object"
    for entry, old, new in pairs(was.get("passes"), now.get("passes"), *names):
        if key_of(entry, "round", "object") not in whole:
            through = f"pass{_of(entry, 'round', 'pellet')} through {_item(scene, entry)}"
            yield from _compared(through, old, new, names)
    for stop, old, new in pairs(was.get("stops"), now.get("stops"), "round", "pellet"):
        ray = f"ray{_of(stop, 'round', 'pellet')}"
        if old is None or new is None or _stopped(scene, old) == _stopped(scene, new):
            yield from _compared(ray, old, new, ("round", "pellet"))
        else:
            yield f"{ray}: stopped {_stopped(scene, new)}, was {_stopped(scene, old)}"
    yield from _compared("verdicts", was.get("verdicts"), now.get("verdicts"), ())


def _compared(what: str, was: Entry | None, now: Entry | None, names: Sequence[str]) -> Iterator[str]:
    """Yield one line with all columns that differ, without those that name the row."""
    if was is None or now is None:
        if was is not now:
            yield f"{what}: {'is new' if was is None else 'is gone'}"
        return
    columns = [name for name in dict.fromkeys([*was, *now]) if name not in names]
    texts = [text for name in columns for text in by_path(name, was.get(name), now.get(name))]
    if texts:
        yield f"{what}: {'; '.join(text.replace(': ', ' ', 1) for text in texts)}"


def _of(entry: Entry, *names: str) -> str:
    """Return the text for round and pellet, without those that are 0."""
    texts = [f"{name} {number_of(entry[name])}" for name in names if entry.get(name)]
    return f" of {', '.join(texts)}" if texts else ""


def _item(scene: Scene, entry: Entry, key: str = "object", word: str = "object") -> str:
    item: Any = entry.get(key)
    known = isinstance(item, int) and 0 <= item < scene.items.count
    return f"{word} {number_of(item)}{f' {scene.name_of(item)!r}' if known else ''}"


def _stopped(scene: Scene, stop: Entry) -> str:
    """Return the text for where and by what a ray ended."""
    far = stop.get("distance")
    at = f"at {far:.1f} px" if isinstance(far, int | float) else "nowhere"
    words = {
        Reason.RANGE: "by its range",
        Reason.OCCLUDER: f"by {_item(scene, stop, 'item', 'occluder')}",
        Reason.HITS: f"by {_item(scene, stop, 'item')}",
        Reason.BUDGET: "by its budget" + (f" in {_item(scene, stop, 'item')}" if stop.get("item") != -1 else ""),
    }
    reason = stop.get("reason")
    return f"{words[Reason(reason)] if reason in tuple(Reason) else f'by reason {number_of(reason)}'} {at}"
