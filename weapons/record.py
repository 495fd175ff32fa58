"""A record of what was fired on what: each shot with its result, to be fired again and compared.

The first line tells the format; then a JSON object to a line, of one shot:

    {"scene": "9f0c12ab", "tick": 12, "weapon": {"kind": "pistol", ...}, "at": [62, 86], "direction": [1073741824, 0],
     "accept": 1, "exclude": [], "seed": 0, "shot": 0, "result": {"rows": [...], ...}, "hash": "51ab..."}
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import version
from itertools import groupby, islice
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from planes.arrays import InputError, within
from planes.constants import ALL, POSITION_MAX, SEED_MAX, SUB, TICK_MAX
from planes.grid256 import ONE, snap
from planes.history import History, PastScene
from planes.image import check_output
from planes.scene import Scene
from planes.schema import Const, Keys, Mapped, Number, Numbers, Optional, Ref, Text, Whole, Wholes, json_of
from weapons.arsenal import weapon_from_json
from weapons.firing import fire, fired
from weapons.hits import Hits
from weapons.jsondiff import by_path, first_of
from weapons.rayhits import RayHits
from weapons.volley import Shots, check_aimed
from weapons.weapon import Weapon

__all__ = ["Difference", "ShotRecord", "replay"]

FORMAT = "hitplanes-shots/1"
HEADER = Keys({"format": Const(FORMAT), "version": Text()}, ("format", "version"))
AWAY = Wholes((2,), -2 * SUB * POSITION_MAX, 2 * SUB * POSITION_MAX)
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
        "result": Mapped(Ref("result")),
        "hash": Text(),
    },
    ("scene", "weapon", "at", "direction", "accept", "exclude", "seed", "shot", "result", "hash"),
)

AT_ONCE = 4096
"""Shots that are fired again in one call, if they are of one weapon on one scene."""


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
        self.path = Path(path)
        check_output(self.path)
        try:
            self._file: BinaryIO = self.path.open("xb", buffering=0)
        except OSError as error:
            raise InputError(f"record: expected a new file, got {self.path}: {error.strerror}") from error
        self._hashes: dict[int, tuple[Scene, int, str]] = {}
        self._write([{"format": FORMAT, "version": version("hitplanes")}])

    def __enter__(self) -> ShotRecord:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def fire(self, scene: Scene | History, weapon: Weapon, at: object, **arguments: Any) -> Hits:
        """Fire, write, and return what was hit; the arguments are those of `weapons.fire`."""
        hits = fire(scene, weapon, at, **arguments)
        self._write([self._line(hits, row) for row in range(len(hits.shots))])
        return hits

    def _write(self, lines: Sequence[Mapping[str, Any]]) -> None:
        text = "".join(json.dumps(line, separators=(",", ":"), allow_nan=False) + "\n" for line in lines)
        try:
            self._file.write(text.encode())
        except OSError as error:
            raise InputError(f"record: cannot write {self.path}: {error.strerror}") from error

    def _line(self, hits: Hits, row: int) -> dict[str, Any]:
        scene, shots = hits.scene_of(row), hits.shots
        result = result_of(hits, row)
        aimed = {} if shots.toward_256 is None else {"toward_256": shots.toward_256[row].tolist()}
        return {
            "scene": self._hash(scene),
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

    def _hash(self, scene: Scene) -> str:
        """Hash of a scene, worked out once for each of its versions."""
        known = self._hashes.get(id(scene))
        if known is None or known[0] is not scene or known[1] != scene.version:
            known = self._hashes[id(scene)] = scene, scene.version, scene.content_hash()
        return known[2]


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
    the first shot that differs, and how; None if all do the same again

    Raises
    ------
    InputError
        Naming the file, the line and the field.
    """
    try:
        with Path(path).open("rb") as lines:
            header = next(lines, b"")
            with within(f"{path} line 1"):
                HEADER.check("header", json_of(header.decode("utf-8", "replace")))
            return _first_difference(_entries(str(path), lines), scene)
    except OSError as error:
        raise InputError(f"{path}: cannot read it: {error.strerror}") from error


def _entries(name: str, lines: BinaryIO) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, line in enumerate(lines, 2):
        with within(f"{name} line {number}"):
            entry = LINE.check("shot", json_of(line.decode("utf-8", "replace")))
            if hash_of(entry["result"]) != entry["hash"]:
                raise InputError(f"hash: expected that of the result, {hash_of(entry['result'])}, got {entry['hash']}")
            entry["weapon"] = weapon_from_json(entry["weapon"])
        yield number, entry


def _first_difference(entries: Iterator[tuple[int, dict[str, Any]]], scene: Any) -> Difference | None:
    def alike(numbered: tuple[int, dict[str, Any]]) -> tuple[Any, ...]:
        entry = numbered[1]
        return entry["scene"], entry.get("tick"), entry["weapon"], entry.get("toward_256") is None

    for (hashed, tick, weapon, _), group in groupby(entries, alike):
        while some := list(islice(group, AT_ONCE)):
            present = _scene_at(scene, tick)
            found = present.content_hash()
            if found != hashed:
                return Difference(some[0][0], some[0][1]["shot"], (f"scene: {found}, was {hashed}",))
            shots = _shots_of([entry for _, entry in some])
            check_aimed(weapon, shots.toward_256)
            hits = fired(present, weapon, shots, "auto", "auto", "auto")
            for row, (line, entry) in enumerate(some):
                now = json.loads(json.dumps(result_of(hits, row)))
                if now != entry["result"]:
                    return Difference(line, entry["shot"], tuple(_told(present, entry["result"], now)))
    return None


def _scene_at(scene: Any, tick: float | None) -> Scene:
    if isinstance(scene, History):
        if tick is None:
            raise InputError("scene: expected a Scene, as a shot has no tick, got a History")
        return scene.at(tick)
    found = scene if isinstance(scene, Scene) else scene(tick)
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


def _told(scene: Scene, was: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What differs between two results, in words."""
    return first_of(by_path("", _named(scene, was), _named(scene, now)))


def _named(scene: Scene, result: Mapping[str, Any]) -> dict[str, Any]:
    """A result with its parts under names: what is gone or new is told by name."""
    named: dict[str, Any] = {f"verdict {key}": count for key, count in result.get("verdicts", {}).items()}
    for part, word in (("rows", ""), ("passes", "pass through "), ("stops", "stop")):
        for one in result.get(part, ()):
            own = dict(one)
            place = "".join(f" of {key} {own.pop(key)}" for key in ("round", "pellet") if own.get(key) is not None)
            item = own.pop("object", None)
            called = "" if item is None else f"object {item} {_name(scene, item)!r}"
            named[f"{word}{called}{place if place != ' of round 0' else ''}"] = own
    return named


def _name(scene: Scene, item: int) -> str:
    return scene.name_of(item) if item < scene.items.count else "?"
