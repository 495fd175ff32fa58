"""Shots as JSON, read and written, and logs with one shot a line, read into checked columns."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from hitplanes.planes.common.checks import InputError, choice, integer, within
from hitplanes.planes.common.limits import ALL, IDS_MAX, POSITION_MAX, SEED_MAX, SUB
from hitplanes.planes.common.tables import (
    Either,
    Keys,
    Names,
    Number,
    Numbers,
    Optional,
    Ref,
    Rows,
    Text,
    Whole,
    distinct_keys,
)
from hitplanes.planes.files.png import possible
from hitplanes.planes.grid.fixed_point import snap
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.call import fire
from ..fire.hits import Hits
from ..kinds.areas import has_no_range, weapon_from_json, weapons_of
from ..kinds.placements import Shots
from ..kinds.weapon import Weapon

AIM_MAX = 10**9  # largest absolute value of an aim, degrees; floats beyond it are too coarse for an angle


class WeaponJson(Ref):
    """A weapon as JSON, validated by the table of its kind."""

    def check(self, name: str, value: object) -> Weapon:
        """Make the weapon."""
        return weapon_from_json(value, name)


SHOT = Keys({
    "weapon": Either(dict, WeaponJson("weapon"), Text()), "at": Numbers((2,), POSITION_MAX),
    "aim": Optional(Number(-AIM_MAX, AIM_MAX)), "toward": Optional(Numbers((2,), POSITION_MAX)), "accept": Names(),
    "blocked_by": Names(), "exclude": Rows(Either(str, Text(), Whole(0, IDS_MAX - 1))), "seed": Whole(0, SEED_MAX),
    "shot": Whole(0, 2**63 - 1),
}, ("weapon", "at"))  # fmt: skip
"""Table that validates a shot."""


class ShotRequest(NamedTuple):
    """One checked shot. `accept` and `blocked_by` hold category bits, `exclude` ids of owners.

    `name` is that of the weapon, or None for a weapon that the shot itself describes.
    """

    name: str | None
    weapon: Weapon
    at: Sequence[float]
    aim: float | None = None
    toward: Sequence[float] | None = None
    accept: int = ALL
    blocked_by: int = ALL
    exclude: tuple[int, ...] = ()
    seed: int = 0
    shot: int = 0


def requests_of(scene: Scene, weapons: Mapping[str, Weapon]) -> list[ShotRequest]:
    """Return the shots of a scene's file; a shot without a number gets its index."""
    return [request_from_json(data, scene, weapons, f"shots[{row}]", row) for row, data in enumerate(scene.shots)]


def request_from_json(
    data: object, scene: Scene, weapons: Mapping[str, Weapon], place: str = "shot", number: int = 0
) -> ShotRequest:
    """Check one shot, given as JSON; an InputError names its place and the field.

    `number` is that of the shot if the JSON has none.
    """
    with within(place):
        shot = SHOT.check("shot", data)
        name = None if isinstance(shot["weapon"], Weapon) else choice("weapon", shot["weapon"], weapons)
        weapon: Weapon = shot["weapon"] if name is None else weapons[name]
        _check_aim(weapon, shot)
        accept, blocked_by = (
            scene.category_bits(*shot[key], field=key) if key in shot else ALL for key in ("accept", "blocked_by")
        )
        excluded = tuple(_owner(scene, value, i) for i, value in enumerate(shot.get("exclude", ())))
        aims, draws = (shot.get("aim"), shot.get("toward")), (shot.get("seed", 0), shot.get("shot", number))
        return ShotRequest(name, weapon, shot["at"], *aims, accept, blocked_by, excluded, *draws)


def _check_aim(weapon: Weapon, shot: Mapping[str, Any]) -> None:
    """Refuse a shot with two aims, one toward its own place, and one without the end that its weapon needs."""
    aim, toward = shot.get("aim"), shot.get("toward")
    if aim is not None and toward is not None:
        raise InputError("aim: expected aim or toward, got both")
    if toward is not None and not (snap(toward) - snap(shot["at"])).any():
        raise InputError(f"toward: expected a point other than the shot's own, got {list(toward)}")
    if toward is None and has_no_range(weapon):
        raise InputError("toward: expected a point, as the weapon has no range, got none")


def fire_request(scene: Scene, request: ShotRequest, prefilter: str = "auto", broadphase: str = "auto") -> Hits:
    """Fire one shot; the pre-filter and the broad phase are those of `fire`."""
    return fire(
        scene, request.weapon, request.at, aim=request.aim, toward=request.toward, accept=request.accept,
        blocked_by=request.blocked_by, exclude=request.exclude or None, seed=request.seed, shot=[request.shot],
        prefilter=prefilter, broadphase=broadphase,
    )  # fmt: skip


def fire_shots(scene: Scene) -> list[Hits]:
    """Fire the shots of a scene's file, `scene.shots`, each for itself.

    Raises
    ------
    InputError
        If a weapon or a shot is invalid; the text names its place and the field.
    """
    return [fire_request(scene, request) for request in requests_of(scene, weapons_of(scene))]


def shot_json(weapon: Weapon, shot: Shots, scene: Scene, stack: Stack) -> dict[str, Any]:
    """One shot, a batch of one, as a scene file has it: the inverse of `request_from_json`.

    Defaults are left out, but for the number, and so are excluded owners that own nothing of the stack that was fired
    at, as a file need not have their ids. The scene is asked for its weapons and names.
    """
    name = next((name for name, other in weapons_of(scene).items() if other == weapon), None)
    aimed: dict[str, Any] = {}
    if shot.aim is not None:
        (aim,) = shot.aim.tolist()
        aimed["aim"] = aim if abs(aim) <= AIM_MAX else math.fmod(aim, 360)
    elif shot.toward_256 is not None:
        aimed["toward"] = ((shot.at_256[0] + shot.toward_256[0]) / SUB).tolist()
    bits = {"accept": int(shot.accept[0]), "blocked_by": int(shot.blocked_by[0])}
    owners = [owner for owner in dict.fromkeys(shot.exclude[0].tolist()) if owner in stack.owner]
    return {
        "weapon": weapon.to_json() if name is None else name,
        "at": (shot.at_256[0] / SUB).tolist(),
        **aimed,
        **{key: scene.category_names(value) for key, value in bits.items() if value != ALL},
        **({"exclude": owners} if owners else {}),
        **({"seed": int(shot.seed[0])} if shot.seed[0] else {}),
        "shot": int(shot.number[0]),
    }


def _owner(scene: Scene, value: object, row: int) -> int:
    """Return the owner of a named object, or check the id of an owner."""
    with within(f"exclude[{row}]"):
        if isinstance(value, str):
            return int(scene.owner(scene.find(value)))
        return integer("owner", value, 0, scene.items.count - 1)


LINE_MAX = 2**20  # longest line of a log, bytes; enough for a shot that excludes thousands of objects by name
CHUNK_BYTES = 2**22  # bytes of lines that are read at a time; in memory they take about ten times as much
REPORTED_MAX = 20_000  # most shots of a log in one report: each is an answer of its own, some 20 kB and 1 ms
FEW = 16  # unusual lines are read one by one if there are at most this many; otherwise they are split into halves

_decode = json.JSONDecoder(object_pairs_hook=distinct_keys).raw_decode


def calls_of(requests: Sequence[ShotRequest]) -> Iterator[tuple[list[int], Weapon, dict[str, Any]]]:
    """Group shots that one call of `fire` can fire: by weapon, kind of aim (angle or point), number of excluded owners.

    Yielded are the places of the shots of a call, their weapon, and the other arguments of `fire`.
    """
    found: dict[tuple[Weapon, bool, int], list[int]] = {}
    for place, request in enumerate(requests):
        found.setdefault((request.weapon, request.toward is None, len(request.exclude)), []).append(place)
    for (weapon, by_angle, owners), places in found.items():
        columns = zip(*(requests[place] for place in places), strict=True)
        _, _, at, aim, toward, accept, blocked_by, exclude, seed, number = columns
        how = {
            "at": np.array(at, np.float64),
            "aim" if by_angle else "toward": np.array([angle or 0.0 for angle in aim] if by_angle else toward),
            "accept": np.array(accept),
            "blocked_by": np.array(blocked_by),
            "exclude": np.array(exclude) if owners else None,
            "seed": np.array(seed, np.uint64),
            "shot": np.array(number, np.int64),
        }
        yield places, weapon, how


def read_lines(log: BinaryIO, count: int) -> list[bytes]:
    """Read at most `count` further lines of a log; of a line that is too long only the beginning."""
    lines: list[bytes] = []
    size = 0
    while len(lines) < count and size < CHUNK_BYTES and (line := log.readline(LINE_MAX + 3)):
        lines.append(line)
        size += len(line)
    return lines


def hash_of(data: object) -> str:
    """First 16 digits of the SHA-256 of JSON."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def body_of(line: bytes) -> bytes:
    """Strip the line break."""
    return line.rstrip(b"\r\n")


class ShotReader:
    """Reader of the lines of a log for one scene and its weapons; `name` is that of the log in errors."""

    def __init__(self, scene: Scene, weapons: Mapping[str, Weapon], name: str) -> None:
        self.scene, self.weapons, self._name = scene, weapons, name
        self._bits = {category: 1 << bit for bit, category in enumerate(scene.categories)}
        ids = scene.ids()
        names, owners = list(map(scene.name_of, ids.tolist())), scene.owner(ids).tolist()
        times = Counter(names)
        self._owners = {name: owner for name, owner in zip(names, owners, strict=True) if times[name] == 1}

    def place(self, line: int) -> str:
        """Return the place of a line for errors; `line` counts from 0, the text from 1 as editors do."""
        return f"{self._name} line {line + 1}"

    def read(self, bodies: list[bytes], first: int) -> tuple[list[ShotRequest], InputError | None]:
        """Check lines without their breaks, of which the first has a number, from 0.

        Returned are the shots before the first bad line, and the error of that line or None.
        """
        try:
            return self._together(bodies, first), None
        except (LookupError, TypeError, ValueError, OverflowError, RecursionError):
            if len(bodies) <= FEW:
                return self._one_by_one(bodies, first)
        half = len(bodies) // 2
        head, error = self.read(bodies[:half], first)
        if error is not None:
            return head, error
        tail, error = self.read(bodies[half:], first + half)
        return head + tail, error

    def request(self, body: bytes, number: int) -> ShotRequest:
        """Check one line without its break; `number` is that of the line, from 0."""
        with within(self.place(number)):
            data = _parsed(body)
        return request_from_json(data, self.scene, self.weapons, self.place(number), number)

    def _one_by_one(self, bodies: list[bytes], first: int) -> tuple[list[ShotRequest], InputError | None]:
        """Check each line by the rules for a scene's shots, which name the error."""
        requests: list[ShotRequest] = []
        for number, body in enumerate(bodies, first):
            try:
                requests.append(self.request(body, number))
            except InputError as error:
                return requests, error
        return requests, None

    def _together(self, bodies: list[bytes], first: int) -> list[ShotRequest]:
        """Check the types and ranges of whole columns at once; raise any error if a line is unusual."""
        shots = _objects(bodies)
        guns, at = [shot["weapon"] for shot in shots], [shot["at"] for shot in shots]
        aim, toward = [shot.get("aim") for shot in shots], [shot.get("toward") for shot in shots]
        seed = [shot.get("seed", 0) for shot in shots]
        number = [shot.get("shot", row) for row, shot in enumerate(shots, first)]
        _usual(all(t is None or a is None for t, a in zip(toward, aim, strict=True)))
        _check_points([*at, *(point for point in toward if point is not None)])
        _check_numbers([angle for angle in aim if angle is not None], AIM_MAX)
        _usual({type(value) for value in (*seed, *number)} == {int} and min(*seed, *number) >= 0)
        _usual(max(seed) <= SEED_MAX and max(number) < 2**63)
        columns = (
            [gun if type(gun) is str else None for gun in guns],
            [self.weapons[gun] if type(gun) is str else weapon_from_json(gun) for gun in guns],
            at, aim, toward,
            [self._categories(shot, "accept") for shot in shots],
            [self._categories(shot, "blocked_by") for shot in shots],
            [self._passed_over(shot["exclude"]) if "exclude" in shot else () for shot in shots],
            seed, number,
        )  # fmt: skip
        return list(map(ShotRequest, *columns))

    def _categories(self, shot: dict[str, Any], key: str) -> int:
        if key not in shot:
            return ALL
        names: list[str] = shot[key]
        _usual(type(names) is list and len(set(names)) == len(names))
        return sum([self._bits[name] for name in names])

    def _passed_over(self, owners: Any) -> tuple[int, ...]:
        _usual(type(owners) is list and {type(owner) for owner in owners} <= {int, str})
        _usual(all(0 <= owner < self.scene.items.count for owner in owners if type(owner) is int))
        return tuple(self._owners[owner] if type(owner) is str else owner for owner in owners)


def requests_of_log(scene: Scene, weapons: Mapping[str, Weapon], log: Path) -> list[ShotRequest]:
    """Return the shots of a log that a report can show; one without a number gets that of its line, from 0."""
    reader, requests = ShotReader(scene, weapons, str(log)), list[ShotRequest]()
    with possible(f"{log}: cannot read it"), log.open("rb") as lines:
        while body := lines.readline(LINE_MAX + 3):
            if len(requests) == REPORTED_MAX:
                raise InputError(f"{log}: expected at most {REPORTED_MAX} shots for one picture, got more: draw a part")
            requests.append(reader.request(body_of(body), len(requests)))
    return requests


def _parsed(body: bytes) -> Any:
    """Parse one line."""
    if len(body) > LINE_MAX:
        raise InputError(f"expected at most {LINE_MAX} bytes, got more")
    if not body.strip():
        raise InputError("expected a shot, got an empty line")
    try:
        return json.loads(body.decode(), object_pairs_hook=distinct_keys)
    except json.JSONDecodeError as error:
        raise InputError(f"expected JSON: {error.msg} at column {error.colno}") from error
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"expected JSON in UTF-8: {error}") from error


def _objects(bodies: list[bytes]) -> list[dict[str, Any]]:
    """Parse lines that must be JSON objects with known keys, without blanks around them."""
    _usual(max(map(len, bodies)) <= LINE_MAX)
    texts = b"\n".join(bodies).decode().split("\n")
    decoded = [_decode(text) for text in texts]
    _usual([end for _, end in decoded] == list(map(len, texts)))
    shots = [shot for shot, _ in decoded]
    _usual({type(shot) for shot in shots} == {dict} and set().union(*shots) <= set(SHOT.forms))
    return shots


def _check_points(values: list[Any]) -> None:
    _usual({type(value) for value in values} <= {list} and {len(value) for value in values} <= {2})
    _check_numbers(list(chain.from_iterable(values)), POSITION_MAX)


def _check_numbers(values: list[Any], limit: int) -> None:
    _usual({type(value) for value in values} <= {int, float})
    _usual(bool((np.abs(np.array(values, np.float64)) <= limit).all()))


def _usual(condition: bool) -> None:
    if not condition:
        raise ValueError("not as usual")
