"""A record of what was fired on what: each shot with its result, to be fired again and compared.

The first line tells the format; then a JSON object to a line, of one shot:

    {"scene": "9f0c12ab", "tick": 12, "weapon": {"kind": "pistol", ...}, "at": [62, 86], "direction": [1073741824, 0],
     "accept": 1, "exclude": [], "seed": 0, "shot": 0, "result": {"rows": [...], ...}, "hash": "51ab..."}
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from planes.arrays import InputError, shown, within
from planes.constants import ALL, POSITION_MAX, SEED_MAX, SUB, TEXT_BYTES_MAX, TICK_MAX
from planes.grid256 import ONE, snap
from planes.history import History, PastScene
from planes.image import check_output
from planes.scene import Scene
from planes.schema import Const, Keys, Number, Numbers, Optional, Ref, Rows, Text, Whole, Wholes, json_of, typed
from weapons.arsenal import weapon_from_json
from weapons.firing import fire, fired
from weapons.hits import Hits
from weapons.jsondiff import Entry, by_path, first_of, key_of, pairs
from weapons.jsondiff import shown as number_of
from weapons.rayhits import RayHits, Reason
from weapons.volley import Shots, check_aimed
from weapons.weapon import Weapon

__all__ = ["Difference", "ShotRecord", "replay"]

FORMAT = "hitplanes-shots/1"
HEADER = Keys({"format": Const(FORMAT), "version": Text()}, ("format", "version"))
AWAY = Wholes((2,), -2 * SUB * POSITION_MAX, 2 * SUB * POSITION_MAX)
PARTS = ("rows", "passes", "stops")
RESULT = Keys({**{part: Rows(Ref("columns")) for part in PARTS}, "verdicts": Ref("columns")})
LINE = Keys(
    {
        "scene": Text(),
        "tick": Optional(Number(-TICK_MAX, TICK_MAX)),
        "weapon": Ref("weapon"),
        "at": Numbers((2,), POSITION_MAX),
        "direction": Wholes((2,), -ONE, ONE),
        "toward_256": Optional(AWAY),
        "accept": Whole(0, ALL),
        "exclude": Wholes((None,), 0, 2**31),
        "seed": Whole(0, SEED_MAX),
        "shot": Whole(0, 2**63 - 1),
        "result": Ref("result"),
        "hash": Text(),
    },
    ("scene", "weapon", "at", "direction", "accept", "exclude", "seed", "shot", "result", "hash"),
)

AT_ONCE, BYTES_AT_ONCE = 1024, 2**21
"""Shots, and bytes of their lines, that are fired again in one call, if they are of one weapon on one scene: more would
be no faster, and take more memory."""

NUMBER_MAX = 2**63
"""No number of a result is larger, either way."""


class Difference(NamedTuple):
    """The first shot of a record that differs: its line in the file, from 1, its number, and how."""

    line: int
    shot: int
    told: tuple[str, ...]


class ShotRecord:
    """Fires shots, and writes each with its result to a new file.

        with ShotRecord("match.jsonl") as record:
            hits = record.fire(scene, pistol, at=(62, 86), aim=10)

    Parameters
    ----------
    path : a new file; each call of `fire` adds its lines at once

    Raises
    ------
    InputError
        If there is a file of that name, or none can be made.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = _path(path)
        check_output(self.path)
        try:
            self._file = self.path.open("xb", buffering=0)
        except OSError as error:
            raise InputError(f"record: expected a new file, got {self.path}: {error.strerror}") from error
        self._hashes = Hashes()
        self._size = 0
        self._write([{"format": FORMAT, "version": version("hitplanes")}])

    def __enter__(self) -> ShotRecord:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def fire(self, scene: Scene | History, weapon: Weapon, at: object, **arguments: Any) -> Hits:
        """Fire, write, and return what was hit; the arguments are those of `weapons.fire`.

        Raises
        ------
        InputError
            If it cannot be fired, or not be written: then the file has nothing of this call.
        """
        if self._file.closed:
            raise InputError(f"record: expected one that is open, got {self.path}, which is closed")
        hits = fire(scene, weapon, at, **arguments)
        self._write([self._line(hits, row) for row in range(len(hits.shots))])
        return hits

    def _write(self, lines: Sequence[Mapping[str, Any]]) -> None:
        """Append lines, or nothing at all."""
        text = "".join(json.dumps(line, separators=(",", ":"), allow_nan=False) + "\n" for line in lines).encode()
        left = memoryview(text)
        try:
            while len(left):
                left = left[self._file.write(left) :]
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._size)
                self._file.seek(self._size)
            raise InputError(f"record: cannot write {self.path}: {error.strerror}") from error
        self._size += len(text)

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
            "exclude": [owner for owner in shots.exclude[row].tolist() if owner >= 0],
            "seed": int(shots.seed[row]),
            "shot": int(shots.number[row]),
            "result": result,
            "hash": hash_of(result),
        }


class Hashes:
    """Hashes of scenes, worked out once for each version of a scene, as long as someone has it."""

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Scene, tuple[int, str]] = WeakKeyDictionary()

    def of(self, scene: Scene) -> str:
        """Hash of a scene as it is."""
        known = self._known.get(scene)
        if known is None or known[0] != scene.version:
            known = self._known[scene] = scene.version, scene.content_hash()
        return known[1]


def result_of(hits: Hits, row: int) -> dict[str, Any]:
    """What one shot did, as JSON: its rows and verdicts, or of rays its passes and stops."""
    rows = [{**one._asdict(), "first_xy": list(one.first_xy)} for one in hits.of(row)]
    told: dict[str, list[dict[str, Any]]] = {"rows": rows}
    if isinstance(hits, RayHits):
        told |= {"passes": hits.passes_at(row).to_rows(), "stops": hits.stops_at(row).to_rows()}
    for one in (one for part in told.values() for one in part):
        one.pop("shot")
        one.pop("row", None)
    return told if isinstance(hits, RayHits) else {**told, "verdicts": hits.verdict_counts(row)}


def hash_of(result: Mapping[str, Any]) -> str:
    """Hash of a result."""
    return hashlib.sha256(json.dumps(result, sort_keys=True).encode()).hexdigest()[:16]


def replay(path: str | Path, scene: Scene | History | Callable[[float | None], Scene]) -> Difference | None:
    """Fire the shots of a record again.

    Parameters
    ----------
    path : a file that `ShotRecord` wrote
    scene : what they are fired at: a scene; a History, for shots that have a tick; or what gives the scene of a tick

    Returns
    -------
    the first shot whose result differs, and how; or the first that was fired on another scene, if all do the same
    again; None if nothing differs

    Raises
    ------
    InputError
        Naming the file, the line and the field.
    """
    path = _path(path)
    try:
        with path.open("rb") as lines:
            with within(f"{path} line 1"):
                header = typed("header", _json_of_line(lines.readline(TEXT_BYTES_MAX + 1)), dict)
                Const(FORMAT).check("format", header.get("format"))
                HEADER.check("header", header)
            return _first_difference(path, _groups(_entries(path, lines)), scene)
    except OSError as error:
        raise InputError(f"{path}: cannot read it: {error.strerror}") from error


class Recorded(NamedTuple):
    """A checked line: its number in the file, from 1, its length in bytes, its weapon, and what it holds."""

    line: int
    size: int
    weapon: Weapon
    data: dict[str, Any]

    @property
    def call(self) -> tuple[Any, ...]:
        """What shots that are fired in one call have in common."""
        return self.data["scene"], self.data.get("tick"), self.weapon, self.data.get("toward_256") is None


def _entries(path: Path, lines: BinaryIO) -> Iterator[Recorded]:
    """Lines of a record, each checked."""
    number, written, weapon = 1, None, None
    while line := lines.readline(TEXT_BYTES_MAX + 1):
        number += 1
        with within(f"{path} line {number}"):
            data = LINE.check("shot", _json_of_line(line))
            _check_result(data["result"])
            if not -1 <= math.hypot(*data["direction"]) - ONE <= 1:
                raise InputError(f"direction: expected one of length {ONE}, got {list(data['direction'])}")
            if hash_of(data["result"]) != data["hash"]:
                raise InputError(f"hash: expected that of the result, {hash_of(data['result'])}, got {data['hash']}")
            if weapon is None or data["weapon"] != written:
                written, weapon = data["weapon"], weapon_from_json(data["weapon"])
        yield Recorded(number, len(line), weapon, data)


def _json_of_line(line: bytes) -> Any:
    """JSON of a whole line."""
    if len(line) > TEXT_BYTES_MAX:
        raise InputError(f"expected at most {TEXT_BYTES_MAX} bytes, got more")
    if not line.endswith(b"\n"):
        told = "one that is cut off, as by a crash: take it out" if line else "an empty file"
        raise InputError(f"expected a whole line of a record, got {told}")
    return json_of(line.decode("utf-8", "replace"))


def _check_result(result: object) -> None:
    """Check that a result is made of columns of numbers."""
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
    """Neighbouring shots that one call fires again; those before a bad line come before its error."""
    some: list[Recorded] = []
    size = 0
    try:
        for entry in entries:
            if some and (entry.call != some[0].call or len(some) == AT_ONCE or size > BYTES_AT_ONCE):
                yield some
                some, size = [], 0
            some.append(entry)
            size += entry.size
    except InputError:
        if some:
            yield some
        raise
    if some:
        yield some


def _first_difference(path: Path, groups: Iterator[list[Recorded]], scene: Any) -> Difference | None:
    hashes, changed = Hashes(), None
    for group in groups:
        line, _, _, first = group[0]
        with within(f"{path} line {line}"):
            present = _scene_at(scene, first.get("tick"))
        told: list[str] = []
        if (found := hashes.of(present)) != first["scene"]:
            told = [f"scene: its content hash is {found}, was {first['scene']}"]
            changed = changed or Difference(line, first["shot"], (*told, "all shots do the same again"))
        for entry, result in zip(group, _results(path, present, group), strict=True):
            if result != entry.data["result"]:
                told += first_of(_told(present, entry.data["result"], result))
                return Difference(entry.line, entry.data["shot"], tuple(told))
    return changed


def _results(path: Path, scene: Scene, group: Sequence[Recorded]) -> Iterator[dict[str, Any]]:
    """What the shots of a group do now, one by one as they are read."""
    weapon, shots = group[0].weapon, _shots_of([entry.data for entry in group])
    try:
        check_aimed(weapon, shots.toward_256)
        hits = fired(scene, weapon, shots, "auto", "auto", "auto")
    except InputError as error:
        if len(group) == 1:
            raise InputError(f"{path} line {group[0].line}: {error}") from error
        for entry in group:
            yield from _results(path, scene, [entry])
        return
    for row in range(len(group)):
        yield json.loads(json.dumps(result_of(hits, row)))


def _path(path: object) -> Path:
    if not isinstance(path, str | Path):
        raise InputError(f"record: expected a path, got {shown(path)}")
    return Path(path)


def _scene_at(scene: Any, tick: float | None) -> Scene:
    if isinstance(scene, History):
        if tick is None:
            raise InputError("scene: expected a Scene, as a shot has no tick, got a History")
        return scene.at(tick)
    found = scene(tick) if callable(scene) else scene
    if not isinstance(found, Scene):
        raise InputError(f"scene: expected a Scene, got {type(found).__name__}")
    return found


def _shots_of(entries: Sequence[Mapping[str, Any]]) -> Shots:
    """Shots as they were checked when they were fired."""
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
        np.array([entry["accept"] for entry in entries], np.int64),
        owners,
        np.array([entry["shot"] for entry in entries], np.int64),
        np.array([entry["seed"] for entry in entries], np.uint64),
        np.arange(n),
    )


def _told(scene: Scene, was: Entry, now: Entry) -> Iterator[str]:
    """What differs between two results, in words: objects that were hit, passes, ends of rays, verdicts."""
    lines = 0
    for line in _lines(scene, was, now):
        lines += 1
        yield line
    if not lines:  # as where rows are told in another order
        yield from by_path("", was, now)


def _lines(scene: Scene, was: Entry, now: Entry) -> Iterator[str]:
    whole = set()
    for old, new in pairs(was.get("rows"), now.get("rows"), "round", "object"):
        if old is None or new is None:
            whole.add(key_of(old or new or {}, "round", "object"))
        yield from _compared(f"{_item(scene, old or new)}{_of(old or new, 'round')}", old, new, ("round", "object"))
    names = "round", "pellet", "object"
    for old, new in pairs(was.get("passes"), now.get("passes"), *names):
        if key_of(old or new or {}, "round", "object") not in whole:
            through = f"pass{_of(old or new, 'round', 'pellet')} through {_item(scene, old or new)}"
            yield from _compared(through, old, new, names)
    for old, new in pairs(was.get("stops"), now.get("stops"), "round", "pellet"):
        ray = f"ray{_of(old or new, 'round', 'pellet')}"
        if old is None or new is None or _stopped(scene, old) == _stopped(scene, new):
            yield from _compared(ray, old, new, ("round", "pellet"))
        else:
            yield f"{ray}: stopped {_stopped(scene, new)}, was {_stopped(scene, old)}"
    yield from _compared("verdicts", was.get("verdicts"), now.get("verdicts"), ())


def _compared(what: str, was: Entry | None, now: Entry | None, names: Sequence[str]) -> Iterator[str]:
    """One line of all columns that differ, but for those that name the row."""
    if was is None or now is None:
        if was is not now:
            yield f"{what}: {'is new' if was is None else 'is gone'}"
        return
    columns = [name for name in dict.fromkeys([*was, *now]) if name not in names]
    told = [part for name in columns for part in by_path(name, was.get(name), now.get(name))]
    if told:
        yield f"{what}: {'; '.join(part.replace(': ', ' ', 1) for part in told)}"


def _of(entry: Entry | None, *names: str) -> str:
    """Which round and pellet, where they are not the first."""
    told = [f"{name} {number_of(entry[name])}" for name in names if entry and entry.get(name)]
    return f" of {', '.join(told)}" if told else ""


def _item(scene: Scene, entry: Entry | None, key: str = "object", word: str = "object") -> str:
    item: Any = (entry or {}).get(key)
    known = isinstance(item, int) and 0 <= item < scene.items.count
    return f"{word} {number_of(item)}{f' {scene.name_of(item)!r}' if known else ''}"


def _stopped(scene: Scene, stop: Entry) -> str:
    """Where and by what a ray ended."""
    far = stop.get("distance")
    at = f"at {far:.1f} px" if isinstance(far, int | float) else "nowhere"
    words = {
        Reason.RANGE: "by its range",
        Reason.OCCLUDER: f"by {_item(scene, stop, 'item', 'occluder')}",
        Reason.HITS: f"by {_item(scene, stop, 'item')}",
        Reason.BUDGET: f"by its budget in {_item(scene, stop, 'item')}",
    }
    reason = stop.get("reason")
    return f"{words[Reason(reason)] if reason in tuple(Reason) else f'by reason {number_of(reason)}'} {at}"
