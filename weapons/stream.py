"""Resolve a log of shots of any length in constant memory: lines -> columns -> fire -> lines; and resume it.

One line goes in, one line comes out, in the order of the log:

    {"weapon": "pistol", "at": [62, 86]}
    {"shot":0,"of":"60bb7dfe","rows":[[1,0,1,1,65535,1,62,86,0]],"verdicts":[0,1,0,0,0]}
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np

from planes.arrays import InputError, within
from planes.items import Role
from planes.sampling import OF_PATTERNS
from planes.scene import Scene
from weapons.arsenal import arsenal_of
from weapons.columns import Columns
from weapons.firing import fire
from weapons.hits import Hits
from weapons.part import Part
from weapons.plan import PlanSum
from weapons.progress import Progress
from weapons.rayhits import RayHits, Reason
from weapons.shotlog import Salvo, ShotReader, body_of, read_lines

__all__ = ["COLUMNS", "FORMAT", "Streamed", "fire_log"]

FORMAT = "hitplanes-hits/1"
COLUMNS = ("object", "round", "samples", "pixels", "weight", "pellets", "x", "y", "distance2")
"""Of a row: as in `Hits`, with first_xy as x and y."""

PASSES = (
    "object", "round", "pellet", "order", "entry_xy", "exit_xy", "entry_px", "exit_px", "material", "normal_xy",
    "weight",
)  # fmt: skip
STOPS = ("round", "pellet", "reason", "item", "cell_xy", "distance", "normal_xy")
"""Of rays: of each pass and each end; a name that ends in _xy stands for two numbers."""

LINES_FIRST, LINES_MAX = 16, 16384
"""Lines of the first chunk, for shots that may hit thousands of objects each, and of the largest: larger ones make
nothing faster."""

SECONDS_SHORT, SECONDS_LONG = 0.1, 0.4
"""A chunk that took less is followed by one four times as large, one that took more by one half as large: so memory
follows what the shots hit, and an interrupt loses little."""

SUFFIX = ".jsonl"
LISTS = rb"\[[-+.\de,\[\]]*\]"
ANSWER = re.compile(
    rb'\{"shot":\d+,"of":"[0-9a-f]{8}","rows":%b,("verdicts":\[\d+(,\d+){4}\]|"passes":%b,"stops":%b)\}\n'
    % (LISTS, LISTS, LISTS)
)
NOTHING = b'"rows":[],'
"""In the answer to a shot that hit nothing."""


@dataclass
class Streamed:
    """What a run did.

    Parameters
    ----------
    shots : answered in all
    resumed : of them by earlier runs
    hit : of them all, those that hit something
    size : bytes of the log that they take
    plan : of what this run fired
    """

    shots: int = 0
    resumed: int = 0
    hit: int = 0
    size: int = 0
    plan: PlanSum = field(default_factory=PlanSum)


def fire_log(scene: Scene, log: Path, output: Path, progress: Progress) -> Streamed:
    """Fire the shots of a log, or those that an interrupted run with the same log, scene and weapons left.

    The answers are written to `<output>.part`, which is renamed when it is complete.

    Parameters
    ----------
    log : a JSON object to a line, as in "shots" of a scene; numbered by its line, from 0, unless it has "shot"
    output : first line: what was fired at, with what; then a line for each shot

    Raises
    ------
    InputError
        Naming the file, the line and the field; the answers before that line are kept.
    KeyboardInterrupt
        Saying that the part is kept.
    """
    reader = ShotReader(scene, arsenal_of(scene), str(log))
    with _opened(log) as lines:
        _check_places(lines, output)
        with Part(output, _header(scene, reader)) as part:
            done = Streamed()
            try:
                _resume(lines, reader, part, done)
                if done.resumed:
                    progress.say(f"{part.path} answers {done.resumed} shots: going on after them")
                progress.begin(os.fstat(lines.fileno()).st_size, done.shots, done.size)
                for chunk in _chunks(lines):
                    _answer(chunk, reader, part, done)
                    progress.show(done.shots, done.size)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(f"{part.path} is kept, and the same command goes on with it") from None
            finally:
                progress.clear()
            part.finish()
    return done


def _check_places(lines: BinaryIO, output: Path) -> None:
    """Refuse an output that is the log, or the scene."""
    if output.suffix.lower() != SUFFIX:
        raise InputError(f"output: expected a name that ends in {SUFFIX}, got {output.name!r}")
    for path in (output, Part.path_of(output)):
        if path.exists() and os.path.samestat(path.stat(), os.fstat(lines.fileno())):
            raise InputError(f"output: expected another file than the log, got {output}")


@contextmanager
def _opened(log: Path) -> Iterator[BinaryIO]:
    try:
        with log.open("rb") as lines:
            yield lines
    except OSError as error:
        raise InputError(f"{log}: cannot read it: {error.strerror}") from error


def _header(scene: Scene, reader: ShotReader) -> bytes:
    """First line of the answers: all that they depend on beside the log, and what is needed to read them."""
    words = {item: (scene.name_of(item), int(scene.items.owner[item])) for item in scene.ids().tolist()}
    data = {
        "format": FORMAT,
        "version": version("hitplanes"),
        "scene": scene.content_hash(),
        "name": scene.name,
        "names": _hash([scene.categories, words]),
        "weapons": _hash({name: weapon.to_json() for name, weapon in reader.arsenal.items()}),
        "columns": COLUMNS,
        "verdicts": [verdict.name.lower() for verdict in OF_PATTERNS],
        "passes": PASSES,
        "stops": STOPS,
        "reasons": [reason.name.lower() for reason in Reason],
        "objects": {item: scene.name_of(item) for item in scene.ids(Role.HITTABLE).tolist()},
    }
    return json.dumps(data, separators=(",", ":")).encode() + b"\n"


def _hash(data: object) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def _resume(lines: BinaryIO, reader: ShotReader, part: Part, done: Streamed) -> None:
    """Pass over the lines of the log that an older part answers; each answer names its line by a checksum."""
    for answer in part.lines():
        if not ANSWER.fullmatch(answer):
            break  # damaged, as by a loss of power: it and what follows are answered again
        line = b"".join(read_lines(lines, 1))
        if b'"of":"%08x"' % zlib.crc32(body_of(line)) not in answer[:64]:
            told = f"is not the one that {part.path} answers: remove {part.path} to start anew"
            raise InputError(f"{reader.place(done.shots)} {told}")
        done.shots += 1
        done.size += len(line)
        done.hit += NOTHING not in answer
    done.resumed = done.shots
    part.cut()


def _chunks(lines: BinaryIO) -> Iterator[list[bytes]]:
    """Lines of the log, as many at a time as are answered while one blinks."""
    count = LINES_FIRST
    begin = time.monotonic()
    while chunk := read_lines(lines, count):
        yield chunk
        now = time.monotonic()
        if now - begin < SECONDS_SHORT:
            count = min(4 * count, LINES_MAX)
        elif now - begin > SECONDS_LONG:
            count = max(count // 2, 1)
        begin = now


def _answer(chunk: list[bytes], reader: ShotReader, part: Part, done: Streamed) -> None:
    """Write the answers to some lines, up to the first bad one."""
    bodies = [body_of(line) for line in chunk]
    salvo, error = reader.read(bodies, done.shots)
    try:
        answers = _fired(salvo, bodies, reader, done.plan)
    except InputError:
        answers, error = _fired_one_by_one(salvo, bodies, reader, done)
    part.write(b"".join(answers))
    done.shots += len(answers)
    done.size += sum(map(len, chunk[: len(answers)]))
    done.hit += sum(NOTHING not in answer for answer in answers)
    if error is not None:
        raise error


def _fired(salvo: Salvo, bodies: list[bytes], reader: ShotReader, plan: PlanSum) -> list[bytes]:
    """Fire shots, those of one weapon together; one line for each."""
    sums = [zlib.crc32(body) for body in bodies]
    numbers = salvo.number.tolist()
    answers = [b""] * len(salvo)
    for (name, toward, owners), rows in salvo.groups().items():
        hits = fire(reader.scene, reader.arsenal[name], **salvo.arguments(rows, toward, owners))
        plan.add(hits.plan)
        for row, answer in zip(rows.tolist(), _answers(hits), strict=True):
            answers[row] = b'{"shot":%d,"of":"%08x",%b' % (numbers[row], sums[row], answer)
    return answers


def _answers(hits: Hits) -> Iterator[bytes]:
    """Rows and verdicts of each shot, as the end of its line."""
    columns = [*(getattr(hits, name) for name in COLUMNS[:-3]), *hits.first_xy.T, hits.distance2]
    rows = np.stack(columns, axis=1).tolist()
    starts = hits.starts.tolist()
    if isinstance(hits, RayHits):
        for shot, (first, last) in enumerate(pairwise(starts)):
            passes, stops = _lists(hits.passes_at(shot), PASSES), _lists(hits.stops_at(shot), STOPS)
            yield f'"rows":{rows[first:last]},"passes":{passes},"stops":{stops}}}\n'.replace(" ", "").encode()
        return
    for first, last, verdicts in zip(starts, starts[1:], hits.verdicts.tolist(), strict=False):
        # Lists of whole numbers look the same in Python and in JSON.
        yield f'"rows":{rows[first:last]},"verdicts":{verdicts}}}\n'.replace(" ", "").encode()


def _lists(columns: Columns, names: Sequence[str]) -> list[list[float]]:
    """Columns as rows of numbers; a column of points is two."""
    every = [getattr(columns, name) for name in names]
    flat = [one.T.tolist() if one.ndim == 2 else [one.tolist()] for one in every]
    return [list(row) for row in zip(*(column for one in flat for column in one), strict=True)]


def _fired_one_by_one(
    salvo: Salvo, bodies: list[bytes], reader: ShotReader, done: Streamed
) -> tuple[list[bytes], InputError | None]:
    """Fire shots each by itself, up to the one that cannot be fired, and say why."""
    answers: list[bytes] = []
    for row, body in enumerate(bodies[: len(salvo)]):
        try:
            with within(reader.place(done.shots + row)):
                answers += _fired(salvo.take(row), [body], reader, done.plan)
        except InputError as error:
            return answers, error
    return answers, None
