"""Fire a log of shots of any length in constant memory, with a progress line, and resume an interrupted run.

Each line of the log gives one line of output, in the same order:

    {"weapon": "pistol", "at": [62, 86]}
    {"shot":0,"of":"25c88664","rows":[[1,0,1,1,65535,1,62,86,0]],"verdicts":[0,1,0,0,0],"crc":"65ee013d"}
"""

from __future__ import annotations

import json
import os
import shutil
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO, Self, TextIO

import numpy as np

from hitplanes.planes.bits.span_walk import OF_PATTERNS
from hitplanes.planes.common.checks import InputError, path_of, printable, within
from hitplanes.planes.files.png import check_output, possible, put_in_place
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from ..fire.call import fire
from ..fire.hits import Hits
from ..fire.plan import PlanSum, Stage
from ..kinds.areas import weapons_of
from ..kinds.placements import ShotColumns
from ..rays.contacts import Reason
from ..rays.ray_hits import RayHits
from .shot_log import ShotReader, ShotRequest, body_of, calls_of, hash_of, read_lines

SECONDS = 0.2  # least time between two drawings, seconds
BAR = 24  # length of the bar, characters


class Progress:
    """Progress line of a long run, drawn on terminals only; messages go to any stream.

    The stream is usually sys.stderr; None (as sys.stderr is if it was closed) draws nothing. `what` is counted.
    """

    def __init__(self, stream: TextIO | None, what: str = "shots") -> None:
        self._stream, self._draws, self._what = stream, stream is not None and stream.isatty(), what
        self._size = 0
        self._begin = self._drawn = time.monotonic()
        self._before = (0, 0)
        self._width = 0

    def begin(self, size: int, shots: int, at: int) -> None:
        """Start to measure the speed; `size` is the bytes of the whole log, or 0 if unknown, as for a pipe.

        An earlier run answered some shots; `at` is the bytes of their lines.
        """
        self._size, self._before = size, (shots, at)
        self._begin = time.monotonic()

    def say(self, text: str) -> None:
        """Write a message, on any stream."""
        self.clear()
        self._write(f"hitplanes: {printable(text)}\n")

    def show(self, shots: int, at: int) -> None:
        """Draw the line, unless it was drawn a moment ago: shots answered so far, and the bytes of their lines."""
        if not self._is_due():
            return
        seconds = max(self._drawn - self._begin, SECONDS)
        shots_before, at_before = self._before
        texts = [f"{shots:,} {self._what}", f"{(shots - shots_before) / seconds:,.0f}/s"]
        if self._size:
            texts.insert(1, f"{100 * at // self._size} %")
            rate = (at - at_before) / seconds
            if rate > 0:
                left = round(max(self._size - at, 0) / rate)
                texts.append(f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02} left")
        self._draw(", ".join(texts))

    def step(self, what: str, done: int, of: int) -> None:
        """Draw the present step and the number of steps done, unless the line was drawn a moment ago."""
        if self._is_due():
            full = BAR * done // max(of, 1)
            self._draw(f"[{'#' * full}{'.' * (BAR - full)}] {done} of {of}, {what}")

    def clear(self) -> None:
        """Clear the line of the terminal."""
        if self._width:
            self._draw("")

    def _is_due(self) -> bool:
        """Whether it is time to draw the line again; the time of this drawing is noted."""
        now = time.monotonic()
        due = self._draws and now - self._drawn >= SECONDS
        self._drawn = now if due else self._drawn
        return due

    def _draw(self, text: str) -> None:
        text = text[: shutil.get_terminal_size().columns - 1]
        self._write(f"\r{text:{self._width}}" if text else f"\r{text:{self._width}}\r")
        self._width = len(text)

    def _write(self, text: str) -> None:
        if self._stream is None:
            return
        with suppress(OSError):  # a closed stream must not stop the run
            self._stream.write(text)
            self._stream.flush()


try:
    import fcntl
except ImportError:  # Windows, where two writers of one file are not noticed
    fcntl = None  # type: ignore[assignment]


HEADER_MAX = 2**20  # bytes that are read of an unexpected header, to name the difference
SEAL = b',"crc":"%08x"}\n'  # end of a line, with the CRC-32 of all earlier bytes of the file
SEAL_BYTES = len(SEAL % 0)
FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


class Part:
    """Resumable output file `<output>.part`, which only this process may write.

    `write` does not buffer. Each line ends with a checksum of all bytes before it, so a line that was changed, lost or
    doubled is found: `damaged` is the number of the first such line of an older part, from 1, or None. An InputError
    says if the file cannot be written, if another process writes it, or if an older part has another first line.
    """

    def __init__(self, output: Path, header: bytes) -> None:
        self.output, self.path = output, self.path_of(output)
        self._writing = f"output: cannot write {self.path}"
        for path in (self.output, self.path):
            check_output(path)
        with possible(self._writing):
            self._file = os.open(self.path, FLAGS, 0o666)
        try:
            self._hold()
            self._check(header)
            self._end, self._crc = len(header), zlib.crc32(header)
            self.damaged: int | None = None
        except BaseException:
            os.close(self._file)
            raise

    @staticmethod
    def path_of(output: Path) -> Path:
        """Return the path of the part of an output."""
        return output.with_name(f"{output.name}.part")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file >= 0:
            os.close(self._file)

    def lines(self) -> Iterator[bytes]:
        """Yield the intact lines of an older part after its header; `cut` drops all behind the last one taken."""
        with possible(self._writing), self.path.open("rb") as file:
            file.seek(self._end)
            for number, line in enumerate(file, 2):
                if not line.endswith(b"\n"):
                    break
                sealed, crc = self._sealed(line[:-SEAL_BYTES], self._crc)
                if line != sealed:
                    self.damaged = number
                    break
                yield line
                self._end += len(line)
                self._crc = crc

    def cut(self) -> None:
        """Truncate the file after the last intact line, and write from there on."""
        with possible(self._writing):
            os.ftruncate(self._file, self._end)
            os.lseek(self._file, self._end, os.SEEK_SET)

    def write(self, lines: Iterable[bytes]) -> None:
        """Append JSON objects, each given without its last brace; an error may leave an incomplete last line."""
        whole, crc = [], self._crc
        for line in lines:
            sealed, crc = self._sealed(line, crc)
            whole.append(sealed)
        self._put(b"".join(whole))
        self._crc = crc

    @staticmethod
    def _sealed(line: bytes, crc: int) -> tuple[bytes, int]:
        """Complete a line that follows bytes with this CRC-32; return it and the CRC-32 after it."""
        crc = zlib.crc32(line, crc)
        seal = SEAL % crc
        return line + seal, zlib.crc32(seal, crc)

    def _put(self, data: bytes) -> None:
        view = memoryview(data)
        with possible(self._writing):
            while len(view):
                view = view[os.write(self._file, view) :]

    def finish(self) -> None:
        """Rename the part, now complete, to the output."""
        with possible(self._writing):
            if fcntl is None:
                os.close(self._file)
                self._file = -1
            put_in_place(self.path, self.output)  # still locked, so no other process writes it

    def _hold(self) -> None:
        """Lock the file for this process."""
        if fcntl is None:
            return
        busy = InputError(f"{self._writing}: another process is writing it")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise busy from error
        except OSError:  # a file system without locks
            return
        with possible(self._writing):
            if not self.path.exists() or not os.path.samestat(os.fstat(self._file), self.path.stat()):
                raise busy  # the process that held the lock has renamed it

    def _check(self, header: bytes) -> None:
        """Write the header of a new part, or compare that of an older one."""
        with possible(self._writing):
            found = os.read(self._file, len(header))
            if found == header:
                return
            if header.startswith(found):
                os.lseek(self._file, 0, os.SEEK_SET)
                self._put(header)
                return
            os.lseek(self._file, 0, os.SEEK_SET)
            found = os.read(self._file, HEADER_MAX)
        raise InputError(f"{self.path}: {_difference(header, found)}: remove it to start anew")


def _difference(header: bytes, found: bytes) -> str:
    """Return the text of the difference between the header found and the one expected."""
    now = json.loads(header)
    try:
        then = json.loads(found.partition(b"\n")[0])
    except (ValueError, RecursionError):
        then = None
    family = now["format"].partition("/")[0]
    if not isinstance(then, dict) or str(then.get("format")).partition("/")[0] != family:
        return f"expected a part of {now['format']}, got something else"
    for key, value in now.items():
        if then.get(key) != value:
            return f"expected {key} {_short(value)}, got {_short(then.get(key))}"
    return "expected the header of this version, got another"


def _short(value: Any) -> str:
    return f"{json.dumps(value):.60}"


FORMAT = "hitplanes-hits/3"
COLUMNS = ("object", "round", "samples", "pixels", "weight", "pellets", "x", "y", "distance2")
"""Columns of a row, as in `Hits`, with first_xy as x and y."""

PASSES = (
    "object", "round", "pellet", "order", "entry_xy", "exit_xy", "entry_px", "exit_px", "material", "normal_xy",
    "weight",
)  # fmt: skip
"""Columns of a pass of a ray; a name that ends in _xy stands for two numbers."""

STOPS = ("round", "pellet", "reason", "item", "cell_xy", "distance", "normal_xy")
"""Columns of the end of a ray; a name that ends in _xy stands for two numbers."""

LINES_FIRST, LINES_MAX = 16, 16384  # of the first chunk, as each shot may hit thousands, and of the largest useful one

SECONDS_SHORT, SECONDS_LONG = 0.1, 0.4
"""After a chunk that took less, the next is four times as large; after one that took more, half as large."""

SUFFIX = ".jsonl"
NOTHING = b'"rows":[],'  # part of the answer to a shot that hit nothing


@dataclass
class Streamed:
    """Totals of a run."""

    shots: int = 0  # shots answered, also by earlier runs
    resumed: int = 0  # shots answered by earlier runs
    hit: int = 0  # shots that hit something
    size: int = 0  # bytes of the answered lines of the log
    plan: PlanSum = field(default_factory=PlanSum)  # costs of the shots that this run fired


def fire_log(scene: Scene, log: Path, output: Path, progress: Progress) -> Streamed:
    """Fire the shots of a log, or continue an interrupted run with the same log, scene and weapons.

    The answers are written to `<output>.part`, which is renamed when it is complete.

    Parameters
    ----------
    log : one JSON object a line, as in "shots" of a scene; without "shot", its number is that of its line, from 0
    output : its first line describes the scene and the weapons; each further line answers one shot

    Raises
    ------
    InputError
        Naming the file, the line and the field; the answers before that line are kept.
    KeyboardInterrupt
        With a message that the part is kept.
    """
    log, output = path_of("log", log), path_of("output", output)
    reader = ShotReader(scene, weapons_of(scene), str(log))
    with possible(f"{log}: cannot read it"), log.open("rb") as lines:
        _check_places(lines, output)
        with Part(output, _header(scene, reader)) as part:
            done = Streamed()
            try:
                _resume(lines, reader, part, done)
                if part.damaged is not None:
                    progress.say(f"{part.path} line {part.damaged} is damaged: it and what follows are answered again")
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
    """Refuse an output with another ending, or one that is the log."""
    if output.suffix.lower() != SUFFIX:
        raise InputError(f"output: expected a name that ends in {SUFFIX}, got {output.name!r}")
    for path in (output, Part.path_of(output)):
        if path.exists() and os.path.samestat(path.stat(), os.fstat(lines.fileno())):
            raise InputError(f"output: expected another file than the log, got {output}")


def _header(scene: Scene, reader: ShotReader) -> bytes:
    """Return the first line of the output: all that answers depend on beside the log, and how to read them."""
    ids = scene.ids()
    owners = zip(ids.tolist(), scene.owner(ids).tolist(), strict=True)
    words = {item: (scene.name_of(item), owner) for item, owner in owners}
    data = {
        "format": FORMAT,
        "version": version("hitplanes"),
        "scene": scene.content_hash(),
        "name": scene.name,
        "names": hash_of([scene.categories, words]),
        "weapons": hash_of({name: weapon.to_json() for name, weapon in reader.weapons.items()}),
        "columns": COLUMNS,
        "verdicts": [verdict.name.lower() for verdict in OF_PATTERNS],
        "passes": PASSES,
        "stops": STOPS,
        "reasons": [reason.name.lower() for reason in Reason],
        "objects": {item: scene.name_of(item) for item in scene.ids(Role.HITTABLE).tolist()},
    }
    return json.dumps(data, separators=(",", ":")).encode() + b"\n"


def _resume(lines: BinaryIO, reader: ShotReader, part: Part, done: Streamed) -> None:
    """Skip the lines of the log that an older part answers; each answer holds the checksum of its line."""
    for answer in part.lines():
        line = b"".join(read_lines(lines, 1))
        if b'"of":"%08x"' % zlib.crc32(body_of(line)) not in answer[:64]:
            why = f"is not the one that {part.path} answers: remove {part.path} to start anew"
            raise InputError(f"{reader.place(done.shots)} {why}")
        done.shots += 1
        done.size += len(line)
        done.hit += NOTHING not in answer
    done.resumed = done.shots
    part.cut()


def _chunks(lines: BinaryIO) -> Iterator[list[bytes]]:
    """Yield chunks of lines, sized so that each takes between SECONDS_SHORT and SECONDS_LONG."""
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
    """Write the answers to a chunk, up to its first bad line."""
    bodies = [body_of(line) for line in chunk]
    requests, error = reader.read(bodies, done.shots)
    try:
        answers = _fired(requests, bodies, reader, done.plan)
    except InputError:
        answers, error = _fired_one_by_one(requests, bodies, reader, done)
    part.write(answers)
    done.shots += len(answers)
    done.size += sum(map(len, chunk[: len(answers)]))
    done.hit += sum(NOTHING not in answer for answer in answers)
    if error is not None:
        raise error


def _fired(requests: list[ShotRequest], bodies: list[bytes], reader: ShotReader, plan: PlanSum) -> list[bytes]:
    """Fire shots, as many in a call as can be; return a line for each, without its last brace."""
    answers = [b""] * len(requests)
    for places, weapon, how in calls_of(requests):
        hits = fire(reader.scene, weapon, **how)
        plan.add(hits.plan, _asked(hits))
        for place, answer in zip(places, _answers(hits), strict=True):
            number, crc = requests[place].shot, zlib.crc32(bodies[place])
            answers[place] = b'{"shot":%d,"of":"%08x",%b' % (number, crc, answer)
    return answers


def _asked(hits: Hits) -> Stage:
    """Make what answers hold beside rows: verdicts, or for rays passes and stops. Return that stage."""
    begin = time.perf_counter_ns()
    if isinstance(hits, RayHits):
        made = 0 if hits.plan.has_run("passes") else hits.passes.nbytes + hits.stop.nbytes
        stage = Stage("passes", "told for the answers, as the stops are", made)
    else:
        stage = Stage("verdicts", "counted for the answers", hits.verdicts.nbytes)
    stage.ns = time.perf_counter_ns() - begin
    return stage


def _answers(hits: Hits) -> Iterator[bytes]:
    """Yield the rows and verdicts (for rays the rows, passes and stops) of each shot as JSON."""
    columns = [*(getattr(hits, name) for name in COLUMNS[:-3]), *hits.first_xy.T, hits.distance2]
    rows = np.stack(columns, axis=1).tolist()
    starts = hits.starts.tolist()
    if isinstance(hits, RayHits):
        for shot, (first, last) in enumerate(pairwise(starts)):
            passes, stops = _lists(hits.passes_at(shot), PASSES), _lists(hits.stops_at(shot), STOPS)
            yield f'"rows":{rows[first:last]},"passes":{passes},"stops":{stops}'.replace(" ", "").encode()
        return
    for first, last, verdicts in zip(starts, starts[1:], hits.verdicts.tolist(), strict=False):
        # Lists of whole numbers look the same in Python and in JSON.
        yield f'"rows":{rows[first:last]},"verdicts":{verdicts}'.replace(" ", "").encode()


def _lists(columns: ShotColumns, names: Sequence[str]) -> list[list[float]]:
    """Return columns as rows of numbers; a column of points becomes two."""
    every = [getattr(columns, name) for name in names]
    flat = [array.T.tolist() if array.ndim == 2 else [array.tolist()] for array in every]
    return [list(row) for row in zip(*(column for group in flat for column in group), strict=True)]


def _fired_one_by_one(
    requests: list[ShotRequest], bodies: list[bytes], reader: ShotReader, done: Streamed
) -> tuple[list[bytes], InputError | None]:
    """Fire shots one by one up to the first that cannot be fired; return the answers and its error."""
    answers: list[bytes] = []
    for row, request in enumerate(requests):
        try:
            with within(reader.place(done.shots + row)):
                answers += _fired([request], [bodies[row]], reader, done.plan)
        except InputError as error:
            return answers, error
    return answers, None
