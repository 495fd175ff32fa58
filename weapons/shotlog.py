"""A log of shots, one JSON object to a line, to checked columns: many lines at once, or one by one for the error."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from typing import Any, BinaryIO

import numpy as np

from planes.arrays import Floats, InputError, Ints, within
from planes.constants import ALL, POSITION_MAX
from planes.scene import Scene
from planes.schema import distinct_keys
from weapons.draws import Words
from weapons.orders import AIM_MAX, SHOT, Order, order_from_json
from weapons.weapon import Weapon

__all__ = ["LINE_MAX", "Salvo", "ShotReader", "body_of", "read_lines"]

LINE_MAX = 2**20
"""Longest line of a log, bytes: one shot with the names of thousands that it passes over."""

CHUNK_BYTES = 2**22
"""Bytes of lines worked on at a time; what they become in memory is some ten times as much."""

FEW = 16
"""So few lines are read one by one when something about them is unusual; more are halved, and halved again."""

_decode = json.JSONDecoder(object_pairs_hook=distinct_keys).raw_decode


@dataclass(frozen=True, eq=False)
class Salvo:
    """Checked shots of any weapons, as columns.

    Parameters
    ----------
    name : of each shot's weapon
    at : (n, 2) px
    aim : (n,) degrees
    toward : (n, 2) px; NaN where a shot has an aim
    accept : (n,) category bits
    exclude : owners, of each shot its own number of them
    seed, number : (n,) for the draws
    """

    name: list[str]
    at: Floats
    aim: Floats
    toward: Floats
    accept: Ints
    exclude: list[tuple[int, ...]]
    seed: Words
    number: Ints

    def __len__(self) -> int:
        return len(self.name)

    def groups(self) -> dict[tuple[str, bool, int], Ints]:
        """Shots that one call can fire: of one weapon, all or none toward a point, with as many owners to pass over."""
        found: dict[tuple[str, bool, int], list[int]] = {}
        aimed = (~np.isnan(self.toward[:, 0])).tolist()
        for row, key in enumerate(zip(self.name, aimed, map(len, self.exclude), strict=True)):
            found.setdefault(key, []).append(row)
        return {key: np.array(rows) for key, rows in found.items()}

    def arguments(self, rows: Ints, toward: bool, owners: int) -> dict[str, Any]:
        """What `fire` takes beside scene and weapon, for shots of one group."""
        return {
            "at": self.at[rows],
            "toward" if toward else "aim": self.toward[rows] if toward else self.aim[rows],
            "accept": self.accept[rows],
            "exclude": np.array([self.exclude[row] for row in rows.tolist()]) if owners else None,
            "seed": self.seed[rows],
            "shot": self.number[rows],
        }

    def take(self, row: int) -> Salvo:
        """One of the shots."""
        part = slice(row, row + 1)
        return Salvo(*(getattr(self, f.name)[part] for f in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Salvo]) -> Salvo:
        """All shots of several salvos, in order."""

        def column(name: str) -> Any:
            return np.concatenate([getattr(part, name) for part in parts])

        return cls(
            [name for part in parts for name in part.name],
            column("at"),
            column("aim"),
            column("toward"),
            column("accept"),
            [owners for part in parts for owners in part.exclude],
            column("seed"),
            column("number"),
        )

    @classmethod
    def of_orders(cls, orders: Sequence[Order]) -> Salvo:
        """Shots that were checked one by one."""
        return cls(
            [order.name for order in orders],
            np.array([order.at for order in orders], np.float64).reshape(-1, 2),
            np.array([order.aim or 0.0 for order in orders], np.float64),
            np.array([order.toward or NOWHERE for order in orders], np.float64).reshape(-1, 2),
            np.array([order.categories for order in orders], np.int64),
            [order.exclude for order in orders],
            np.array([order.seed for order in orders], np.uint64),
            np.array([order.shot for order in orders], np.int64),
        )


NOWHERE = (float("nan"), float("nan"))


def read_lines(log: BinaryIO, count: int) -> list[bytes]:
    """Read the next lines of a log, at most so many; none at its end. Of a line that is too long only the beginning."""
    lines: list[bytes] = []
    size = 0
    while len(lines) < count and size < CHUNK_BYTES and (line := log.readline(LINE_MAX + 3)):
        lines.append(line)
        size += len(line)
    return lines


def body_of(line: bytes) -> bytes:
    """A line without its end."""
    return line.rstrip(b"\r\n")


class ShotReader:
    """Reads lines of a log for one scene and its arsenal.

    Parameters
    ----------
    name : of the log, for errors
    """

    def __init__(self, scene: Scene, arsenal: Mapping[str, Weapon], name: str) -> None:
        self.scene, self.arsenal, self._name = scene, arsenal, name
        self._bits = {category: 1 << bit for bit, category in enumerate(scene.categories)}
        self._owners: dict[int | str, int] = {item: item for item in range(scene.items.count)}
        names = Counter(scene.items.names[item] for item in scene.ids().tolist())
        for item in scene.ids().tolist():
            if names[name_of := scene.items.names[item]] == 1:
                self._owners[name_of] = int(scene.items.owner[item])

    def place(self, line: int) -> str:
        """Where a line is, counted from 0 as shots are, in the words of an editor, which counts from 1."""
        return f"{self._name} line {line + 1}"

    def read(self, bodies: list[bytes], first: int) -> tuple[Salvo, InputError | None]:
        """Check lines.

        Parameters
        ----------
        bodies : lines without their ends
        first : number of the first of them, from 0

        Returns
        -------
        the shots before the first bad line, and what is wrong with that one, or None
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
        return Salvo.joined([head, tail]), error

    def _one_by_one(self, bodies: list[bytes], first: int) -> tuple[Salvo, InputError | None]:
        """Each line by the rules of a scene's shots, which say what is wrong with it."""
        orders: list[Order] = []
        for number, body in enumerate(bodies, first):
            try:
                with within(self.place(number)):
                    data = _parsed(body)
                orders.append(order_from_json(data, self.scene, self.arsenal, self.place(number), number))
            except InputError as error:
                return Salvo.of_orders(orders), error
        return Salvo.of_orders(orders), None

    def _together(self, bodies: list[bytes], first: int) -> Salvo:
        """All lines at once, if they are as usual: by types and ranges of whole columns; else any error."""
        shots = _objects(bodies)
        names = [shot["weapon"] for shot in shots]
        _usual(set(names) <= self.arsenal.keys())
        toward, aim = [shot.get("toward") for shot in shots], [shot.get("aim") for shot in shots]
        _usual(all(t is None or a is None for t, a in zip(toward, aim, strict=True)))
        aimed = np.array([point is not None for point in toward])
        points = np.full((len(shots), 2), np.nan)
        points[aimed] = _points([point for point in toward if point is not None])
        return Salvo(
            names,
            _points([shot["at"] for shot in shots]),
            _numbers([0.0 if angle is None else angle for angle in aim], AIM_MAX),
            points,
            np.array([self._accepted(shot["accept"]) if "accept" in shot else ALL for shot in shots], np.int64),
            [self._passed_over(shot["exclude"]) if "exclude" in shot else () for shot in shots],
            np.array(_whole([shot.get("seed", 0) for shot in shots]), np.uint64),
            np.array(_whole([shot.get("shot", row) for row, shot in enumerate(shots, first)]), np.int64),
        )

    def _accepted(self, names: Any) -> int:
        _usual(type(names) is list and len(set(names)) == len(names))
        return sum(self._bits[name] for name in names)

    def _passed_over(self, owners: Any) -> tuple[int, ...]:
        _usual(type(owners) is list and {type(owner) for owner in owners} <= {int, str})
        return tuple(self._owners[owner] for owner in owners)


def _parsed(body: bytes) -> Any:
    """JSON of one line."""
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
    """Lines that are JSON objects from the first byte to the last, of known keys."""
    _usual(max(map(len, bodies)) <= LINE_MAX)
    texts = b"\n".join(bodies).decode().split("\n")
    decoded = [_decode(text) for text in texts]
    _usual([end for _, end in decoded] == list(map(len, texts)))
    shots = [shot for shot, _ in decoded]
    _usual({type(shot) for shot in shots} == {dict} and set().union(*shots) <= set(SHOT.forms))
    return shots


def _points(values: list[Any]) -> Floats:
    _usual({type(value) for value in values} <= {list} and {len(value) for value in values} <= {2})
    return _numbers(list(chain.from_iterable(values)), POSITION_MAX).reshape(-1, 2)


def _numbers(values: list[Any], limit: int) -> Floats:
    _usual({type(value) for value in values} <= {int, float})
    array = np.array(values, np.float64)
    _usual(bool((np.abs(array) <= limit).all()))
    return array


def _whole(values: list[Any]) -> list[int]:
    _usual({type(value) for value in values} == {int} and min(values) >= 0)
    return values


def _usual(condition: bool) -> None:
    if not condition:
        raise ValueError("not as usual")
