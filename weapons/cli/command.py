"""The command `hitplanes`. Each subcommand is a function that parses, calls the library and prints."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn, TextIO

from hitplanes.planes.common.checks import InputError, integer, printable, real, within
from hitplanes.planes.common.limits import SEED_MAX
from hitplanes.planes.files.png import check_output, write_png, write_text
from hitplanes.planes.files.scene_folder import FILE_NAME, images_of, load_scene, scene_folder
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from ..fire.hits import Hits
from ..fire.plan import PlanSum, plan_lines
from ..kinds.areas import weapons_of
from ..replay.shot_log import REPORTED_MAX, ShotRequest, fire_request, request_from_json, requests_of, requests_of_log
from ..replay.stream import Progress, fire_log
from ..report.cards import place_text
from ..report.differences import differences
from ..report.phrases import counted, unseen
from ..report.picture import picture_of_difference, picture_of_report
from ..report.report import report_of
from .report_file import read_report
from .starter import FROM_IMAGE, write_from_picture, write_starter

DESCRIPTION = "Find out what a shot hits in a 2-D scene, pixel by pixel and exactly, and see why."

REPORT_HELP = """\
Fire shots at a scene and draw a picture that shows what was hit and why. --json writes the same facts as JSON.
By default the shots in scene.json are fired; with --shots those of a log, as fire takes it; with --weapon and --at one
of your own. More than 24 shots become one heat picture.

examples:
  hitplanes report fixtures/gallery
  hitplanes report fixtures/gallery -o report.png --json report.json
  hitplanes report fixtures/gallery --json - | python -m json.tool
  hitplanes report fixtures/gallery --weapon shotgun --at 138,91 --seed 7
  hitplanes report fixtures/gallery --weapon beam --at 100,167 --aim -4.5
  hitplanes report fixtures/gallery --shots shots.jsonl -o heat.png
"""

FIRE_HELP = """\
Fire a log of shots of any length, in little memory. Each line of the log gives one line of hits, in the same order.

A line of SHOTS.jsonl is a shot as in scene.json: {"weapon": "point", "at": [62, 86]}, and aim or toward, accept,
blocked_by, exclude, seed. Shots are numbered by their line, from 0, unless they have "shot". Empty lines are refused.

The first line of HITS.jsonl names the scene, the weapons, the columns of a row and the objects by id. Each line after
it answers one shot: {"shot": 0, "of": CRC-32 of its line in the log, "rows": [[object, ...], ...],
"verdicts": [empty, hit, ...], "crc": CRC-32 of all bytes of HITS.jsonl before it}.

Answers are written to HITS.jsonl.part, which is renamed when it is complete. If a run stops early (an interrupt, a full
disk, a bad line that you then correct), run the same command again: it continues after the last intact answer.

examples:
  hitplanes fire fixtures/gallery shots.jsonl -o hits.jsonl
  zcat shots.jsonl.gz | hitplanes fire fixtures/gallery /dev/stdin -o hits.jsonl
  hitplanes fire fixtures/gallery shots.jsonl --plan
"""

NEW_HELP = """\
Write a small example scene: scene.json and the images that it names. FOLDER must be new or empty.

With --from-image the scene is made of a PNG of your own, and is as large as it. If it has transparent pixels, as a
sprite has, its opaque pixels (alpha over 127) are one object that can be hit. Else, as a screenshot, it is the
background, and a round target stands in its middle: put what can be hit in its place. A first shot is there.

examples:
  hitplanes new range
  hitplanes report range
  hitplanes new tank --from-image sprites/tank.png
"""

COMPARE_HELP = """\
Print the differences between two reports. With -o, also draw the reports side by side, with what was hit in the first
only, in the second only, and in both. Versions and plans are not compared.

Exit code: 0 no difference, 1 a difference, 2 bad input.

examples:
  hitplanes report fixtures/gallery --json before.json
  hitplanes compare before.json after.json
  hitplanes compare before.json after.json -o diff.png --scene fixtures/gallery
  hitplanes compare before.json after.json -o diff.png --scene level/old --scene level/new
"""

DEMO_HELP = """\
Animate a broad phase. Objects move, its cells split and merge, and a query first finds the cells that it touches, then
tests the objects in them. The number of tests is shown beside that of brute force.

examples:
  hitplanes demo quadtree
  hitplanes demo grid -o grid.gif
  hitplanes demo bvh -o frames
"""

STABILITY_HELP = """\
Count wrong decisions on geometry that is hard to decide: almost touching, far away, thin, tied, tiny and huge shapes.
Compared are hitplanes, textbook formulas in float64, and those of shapely, pymunk and pygame-ce that are installed.
Exact rational arithmetic gives the right answers.

Writes stability.json, stability.md and, if matplotlib is installed, stability.png. An interrupted run writes what it
has counted.

Exit code: 0 hitplanes made no wrong decision, 1 it made one, 2 bad input.

examples:
  hitplanes stability --quick
  hitplanes stability -o stability/ --seed 7
"""

WARM_UP_HELP = """\
Compile all kernels of the extra jit once, and keep them on disk. Later processes of this user load them in a moment,
instead of compiling them in the middle of a game. hitplanes.warm_up() does the same.
"""

REPLAY_HELP = """\
Fire the shots of a record again and print how the first different result differs. A game writes a record by firing
with hitplanes.ShotRecord. If all results are the same but the content of SCENE is not, that is a difference, too. SCENE
stands still: a record of shots at ticks is for hitplanes.replay and their History.

If a line of the record was changed, lost, doubled or moved, the record is bad input, and the error names the line. If a
record was not closed (the game crashed), its shots are fired, and a note says that some may be missing.

Exit code: 0 no difference, 1 a result or the content of the scene differs, 2 bad input.

examples:
  hitplanes replay fixtures/gallery match.jsonl
"""

STUDY_HELP = """\
Measure the error and the run time of every method, and name the fastest that is accurate enough. The methods are pixel
planes at several scales, volumes, pre-filters, broad phases, sampled rays, fast movers in substeps, spread by pellets,
and those of pymunk, pygame and shapely that are installed. They are tested on the hittable objects of SCENE, by default
on one shape of each kind.

Writes study.json, study.csv, study.md and a diagram for each question (needs pip install 'hitplanes[study]').
An interrupted run writes what it has measured.

examples:
  hitplanes study --quick
  hitplanes study fixtures/gallery -o study --error 0.05
"""

Run = Callable[[argparse.Namespace], int | None]  # runs a subcommand, and returns its exit code if that is not 0
STANDARD_OUTPUT = Path("-")
NAMED = 8  # most objects that a line of output names
USAGE_MAX = 300  # characters of a usage error
SHOWN = ("quadtree", "grid", "bvh")  # structures that the demo can show


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; exit codes: 0 done, 1 something differs or is wrong, 2 bad input, 130 interrupted."""
    open_streams()
    try:
        try:
            arguments = parser().parse_args(argv)
            return arguments.run(arguments) or 0
        finally:
            with _printing():
                sys.stdout.flush()
    except InputError as error:
        _complain(" ".join(str(error).split()))
        return 2
    except OSError as error:  # the system's: the library reports those of its arguments as InputError
        _complain(f"{error.filename or 'system'}: {error.strerror or error}")
        return 2
    except KeyboardInterrupt as interrupt:
        _complain(": ".join(["interrupted", *map(str, interrupt.args)]))
        return 130
    finally:
        _let_go(sys.stderr)


def open_streams() -> None:
    """Open stdout and stderr if they were closed, or the next file that is opened would take their number."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_WRONLY)
            if null > number:
                try:
                    os.fstat(number)
                except OSError:  # it is closed
                    os.dup2(null, number)
            setattr(sys, name, os.fdopen(null, "w", encoding="utf-8", closefd=False))


@contextmanager
def _printing() -> Iterator[None]:
    """Report errors of stdout; a closed pipe is no error, as its reader wants no more."""
    try:
        yield
    except BrokenPipeError:
        _let_go(sys.stdout)
    except OSError as error:
        _let_go(sys.stdout)
        raise InputError(f"output: cannot write what is printed: {error.strerror}") from error


def _let_go(stream: TextIO) -> None:
    """Send a stream that cannot be written to the null device, or Python would try again at exit."""
    try:
        stream.flush()
    except OSError:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def _complain(message: str) -> None:
    """Print an error as one line; a stderr that cannot be written is ignored."""
    with suppress(OSError):
        print(f"hitplanes: {printable(message)}", file=sys.stderr)


def _say(line: str) -> None:
    """Print a line, with escapes for control characters and those that the terminal cannot show."""
    encoding = sys.stdout.encoding or "utf-8"
    with _printing():
        print(printable(line).encode(encoding, "backslashreplace").decode(encoding))


class OneLineParser(argparse.ArgumentParser):
    """A parser that prints errors as one line, like all errors of the command."""

    def error(self, message: str) -> NoReturn:
        """Print what is wrong with the arguments, and exit with 2."""
        if message.endswith("expected one argument"):
            message += "; one that begins with a minus is written --at=-5,3"
        text = printable(" ".join(message.split()))
        text = text if len(text) <= USAGE_MAX else text[:USAGE_MAX] + "..."
        self.exit(2, f"hitplanes: {text} (see {self.prog} --help)\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help, and report errors of stdout, which argparse would ignore."""
        if file is not sys.stdout:
            super()._print_message(message, file)
            return
        with _printing():
            file.write(message)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command and of its subcommands."""
    top = OneLineParser(prog="hitplanes", description=DESCRIPTION)
    top.add_argument("--version", action="version", version=f"hitplanes {version('hitplanes')}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    _add_report(commands)
    sub = _command(commands, fire, "fire a log of shots, and write the hits of each", FIRE_HELP)
    sub.add_argument("shots", type=Path, metavar="SHOTS.jsonl", help="log with one shot a line")
    _add_output(sub, "hits.jsonl", "HITS.jsonl", "where to write the hits; the name ends in .jsonl")
    text = "print the total cost of each stage, and the stages that were skipped"
    sub.add_argument("--plan", action="store_true", help=text)
    sub = _command(commands, new, "write a small scene to start from", NEW_HELP)
    sub.add_argument("folder", type=Path, metavar="FOLDER", help="folder to create; its parent must exist")
    sub.add_argument(FROM_IMAGE, type=Path, metavar="PICTURE", help="make the scene of this PNG")
    sub = _command(commands, compare, "print and draw how two reports differ", COMPARE_HELP)
    sub.add_argument("expected", type=Path, metavar="A.json", help="first report, written by report --json")
    sub.add_argument("got", type=Path, metavar="B.json", help="second report")
    sub.add_argument("-o", "--output", type=Path, metavar="PNG", help="draw both reports to this file")
    text = "scene folder of a report, to draw it on; give it twice if the reports have different scenes"
    sub.add_argument("--scene", type=Path, metavar="SCENE", action="append", help=text)
    sub = _command(commands, replay, "fire a record of shots again, and compare", REPLAY_HELP)
    sub.add_argument("record", type=Path, metavar="RECORD.jsonl", help="file that hitplanes.ShotRecord wrote")
    _add_measurements(commands)
    _command(commands, warm_up, "compile all kernels of the extra jit", WARM_UP_HELP)
    sub = _command(commands, demo, "animate a quadtree, a grid or a BVH", DEMO_HELP)
    sub.add_argument("kind", choices=SHOWN, metavar="KIND", help=f"one of {', '.join(SHOWN)}")
    _add_output(sub, "demo.gif", "GIF", "a file that ends in .gif, or a new folder for PNG files")
    return top


def _add_output(sub: argparse.ArgumentParser, default: str, metavar: str, text: str) -> None:
    text = f"{text} (default: {default})"
    sub.add_argument("-o", "--output", type=Path, default=Path(default), metavar=metavar, help=text)


def _add_measurements(commands: Any) -> None:
    sub = _command(commands, study, "measure error and run time of all methods", STUDY_HELP)
    text = "folder with scene.json and its images (default: one shape of each kind)"
    sub.add_argument("scene", type=Path, metavar="SCENE", nargs="?", help=text)
    _add_output(sub, "study", "FOLDER", "a new folder, or that of an earlier study, which is replaced")
    text = "largest accepted error: wrong decisions per shot, or error of a share (default: 0.01)"
    sub.add_argument("--error", type=float, default=0.01, metavar="E", help=text)
    sub.add_argument("--quick", action="store_true", help="fewer shots and runs: under half a minute")
    sub.add_argument("--seed", type=int, default=0, metavar="N", help="random seed of the shots (default: 0)")
    sub = _command(commands, stability, "count wrong decisions on hard geometry", STABILITY_HELP)
    _add_output(sub, "stability", "FOLDER", "a new folder, or that of an earlier run, which is replaced")
    text = "a few hundred questions for each cell of the table: seconds instead of half an hour"
    sub.add_argument("--quick", action="store_true", help=text)
    sub.add_argument("--seed", type=int, default=0, metavar="N", help="random seed of the questions (default: 0)")


def _add_report(commands: Any) -> None:
    sub = _command(commands, report, "fire at a scene and draw what was hit", REPORT_HELP)
    text = f"fire the shots of this log, one a line, {REPORTED_MAX} at most"
    sub.add_argument("--shots", type=Path, metavar="SHOTS.jsonl", help=text)
    sub.add_argument("--weapon", metavar="NAME", help="fire one shot with this weapon of the scene; needs --at")
    sub.add_argument("--at", metavar="X,Y", help="position of the shot, px (write --at=-5,3 if X is negative)")
    sub.add_argument("--aim", type=float, metavar="DEG", help="direction in degrees: 0 is right, 90 is down")
    sub.add_argument("--toward", metavar="X,Y", help="point to aim at, px, instead of --aim")
    sub.add_argument("--seed", type=int, metavar="N", help="random seed of the pellets")
    _add_output(sub, "report.png", "PNG", "file of the picture")
    text = "also write the facts to this file; - is the standard output"
    sub.add_argument("--json", type=Path, metavar="JSON", help=text)
    volumes = "none, box, circle, 'oriented box', '4 boxes' (1 to 64), polygon or swept"
    text = f"test bounding volumes first, and draw them: {volumes}"
    sub.add_argument("--prefilter", metavar="NAME", help=text)
    text = "find objects with this structure, and draw its cells: grid, quadtree or bvh"
    sub.add_argument("--broadphase", metavar="NAME", help=text)
    text = "print the cost of each stage of a shot, and why stages were skipped"
    sub.add_argument("--plan", action="store_true", help=text)


def _command(commands: Any, run: Run, summary: str, text: str) -> argparse.ArgumentParser:
    """Add a subcommand named like its function, whose help ends with examples; those that fire take a scene first."""
    description, _, examples = text.partition("examples:\n")
    sub: argparse.ArgumentParser = commands.add_parser(
        run.__name__.replace("_", "-"), help=summary, description=description,
        epilog=f"examples:\n{examples}" if examples else None, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    sub.set_defaults(run=run)
    if run in (report, fire, replay):
        sub.add_argument("scene", type=Path, metavar="SCENE", help="folder with scene.json and its images")
    return sub


def report(arguments: argparse.Namespace) -> None:
    """Fire the shots of the scene, or the one of the command line, and write the picture and the facts."""
    piped = arguments.json == STANDARD_OUTPUT
    file = None if piped else arguments.json
    _check_outputs(arguments.output, file)
    scene = load_scene(arguments.scene)
    _check_not_of_scene(scene, arguments.scene, arguments.output, file)
    if arguments.shots is not None and _real(arguments.shots) in map(_real, filter(None, (arguments.output, file))):
        raise InputError(f"output: expected another file than the log of shots, got {arguments.shots}")
    requests = _requests(arguments, scene)
    how = {"prefilter": arguments.prefilter, "broadphase": arguments.broadphase}
    asked = {name: value for name, value in how.items() if value is not None}
    fired = [fire_request(scene, request, **asked) for request in requests]
    facts = report_of(scene, fired, [request.name for request in requests], **asked)
    write_png(arguments.output, picture_of_report(facts, scene))
    text = json.dumps(facts, indent=1) + "\n"
    if file is not None:
        write_text(file, text)
    if piped:
        with _printing():
            sys.stdout.write(text)
    with redirect_stdout(sys.stderr) if piped else nullcontext():
        _note_empty(scene)
        if note := unseen(facts, scene.extent()):
            _say(f"note: {note}")
        _print_hits(facts, fired if arguments.plan else [])


def _requests(arguments: argparse.Namespace, scene: Scene) -> list[ShotRequest]:
    """Return the shots of the scene's file, those of a log, or the one of the command line."""
    given = [name for name in ("weapon", "at", "aim", "toward", "seed") if getattr(arguments, name) is not None]
    with within(str(scene_folder(arguments.scene) / FILE_NAME)):
        weapons = weapons_of(scene)
        if not given and arguments.shots is None:
            return requests_of(scene, weapons)
    if arguments.shots is not None:
        if given:
            raise InputError(f"--{given[0]}: expected without --shots, got both")
        return requests_of_log(scene, weapons, arguments.shots)
    if arguments.weapon is None:
        raise InputError(f"--{given[0]}: expected only together with --weapon, got no weapon")
    return [request_from_json(_shot(arguments), scene, weapons, "command line")]


def _print_hits(facts: Mapping[str, Any], planned: Sequence[Hits]) -> None:
    """Print what each shot hit, or how many shots of a batch hit, and the plans of the hits in `planned`."""
    batch = facts["batch"]
    if batch:
        _say(f"{batch['shots']} shots, {batch['shots_that_hit']} hit something")
    elif not facts["shots"]:
        _say(f"{facts['scene']['name']}: no shots to fire; name one with --weapon and --at")
    for i, shot in enumerate(facts["shots"]):
        hit = ", ".join(f"{row['name']} {row['pixels']} px" for row in shot["rows"][:NAMED]) or "nothing"
        if len(shot["rows"]) > NAMED:
            hit += f" and {len(shot['rows']) - NAMED} more"
        _say(f"{shot['weapon']} at {place_text(shot['at'])}: {hit}")
        if planned:
            _print_plan(planned[i].plan.timed())
    if batch and planned:
        done = PlanSum()
        for hits in planned:
            done.add(hits.plan)
        _print_plan(done.timed(), done.calls)


def fire(arguments: argparse.Namespace) -> None:
    """Fire a log of shots, and write the hits of each."""
    check_output(arguments.output)
    scene = load_scene(arguments.scene)
    with within(str(scene_folder(arguments.scene) / FILE_NAME)):
        weapons_of(scene)
    done = fire_log(scene, arguments.shots, arguments.output, Progress(sys.stderr))
    _say(f"{counted(done.shots, 'shot')}, {done.hit} hit something, in {arguments.output}")
    if arguments.plan:
        _print_plan(done.plan.timed(), done.plan.calls)


def study(arguments: argparse.Namespace) -> None:
    """Measure all methods, and print the fastest that is accurate enough for each question."""
    from ..lab.study.questions import kinds_scene  # heavy imports that only this subcommand needs
    from ..lab.study.study import NO_DIAGRAMS, Effort, verdict, write_study

    error, seed = real("--error", arguments.error, 0, 1), integer("--seed", arguments.seed, 0, SEED_MAX)
    scene = kinds_scene() if arguments.scene is None else load_scene(arguments.scene)
    effort = Effort.quick() if arguments.quick else Effort()
    done, drawn = write_study(scene, arguments.output, seed, effort, error, Progress(sys.stderr))
    for question in done["questions"]:
        _say(f"{question['name']}: {question['asks']} Truth: {question['truth']}")
    for line in verdict(done, error):
        _say(line)
    _say(f"{'tables and diagrams are' if drawn else 'the tables are'} in {arguments.output}")
    if not drawn:
        _say(NO_DIAGRAMS)


def new(arguments: argparse.Namespace) -> None:
    """Write a scene to start from, and print the next command to try."""
    if arguments.from_image is None:
        write_starter(arguments.folder)
    else:
        write_from_picture(arguments.folder, arguments.from_image)
    _say(f"a scene is in {arguments.folder}; now try: hitplanes report {shlex.quote(str(arguments.folder))}")


def _print_plan(plan: Mapping[str, Sequence[Mapping[str, Any]]], calls: int = 1) -> None:
    for line in plan_lines(plan, calls):
        _say(f"  {line}")


def _check_outputs(picture: Path, facts: Path | None) -> None:
    check_output(picture)
    if picture.suffix.lower() != ".png":
        raise InputError(f"--output: expected a name that ends in .png, got {picture.name!r}")
    if facts is not None:
        check_output(facts)
        if _real(facts) == _real(picture):
            raise InputError(f"--json: expected another file than --output, got {str(facts)!r} for both")


def _check_not_of_scene(scene: Scene, folder: Path, *outputs: Path | None) -> None:
    """Refuse an output that would overwrite a file of the scene."""
    folder = scene_folder(folder)
    images = {name for sprite in scene.items.sprites for name in images_of(sprite)}
    own = {_real(folder / name) for name in {FILE_NAME, *images}}
    for output in outputs:
        if output is not None and _real(output) in own:
            raise InputError(f"output: expected another file than those of the scene, got {output}")


def _real(path: Path) -> str:
    """Resolve a path; unlike Path.resolve, this accepts a link to itself."""
    try:
        return os.path.realpath(path)
    except OSError as error:
        raise InputError(f"output: cannot find {path}: the folder that we are in is not there any more") from error


def _note_empty(scene: Scene) -> None:
    """Print a note for each object that has no pixels, so that nothing can hit it."""
    for item in (*scene.ids(Role.HITTABLE).tolist(), *scene.ids(Role.OCCLUDER).tolist()):
        if not scene.mask(item)[0].any():
            _say(f"note: {scene.name_of(item)} has no pixel: nothing hits it, it blocks nothing")


def _shot(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the shot of the command line in the form of scene.json."""
    if arguments.at is None:
        raise InputError("--at: expected X,Y with --weapon, got nothing")
    shot: dict[str, Any] = {"weapon": arguments.weapon, "at": _point("at", arguments.at)}
    if arguments.toward is not None:
        shot["toward"] = _point("toward", arguments.toward)
    return shot | {name: getattr(arguments, name) for name in ("aim", "seed") if getattr(arguments, name) is not None}


def _point(name: str, text: str) -> list[float]:
    """Parse two numbers of the command line."""
    try:
        x, y = text.split(",")
        return [float(x), float(y)]
    except ValueError as error:
        raise InputError(f"--{name}: expected two numbers X,Y, got {text!r}") from error


def compare(arguments: argparse.Namespace) -> int:
    """Print the differences of two reports, and draw them if asked; return 1 if there are any."""
    if arguments.output is not None:
        _check_outputs(arguments.output, None)
    expected, got = read_report(arguments.expected), read_report(arguments.got)
    hashes = expected["scene"]["hash"], got["scene"]["hash"]
    scenes = {scene.content_hash(): scene for scene in map(load_scene, arguments.scene or ())}
    for other in scenes.keys() - set(hashes):
        raise InputError(f"--scene: expected that of a report, {' or '.join(hashes)}, got {other}")
    if arguments.output is not None:
        pair = scenes.get(hashes[0]), scenes.get(hashes[1])
        write_png(arguments.output, picture_of_difference(expected, got, pair))
    lines = differences(expected, got)
    for line in lines or ["no difference"]:
        _say(line)
    return 1 if lines else 0


def replay(arguments: argparse.Namespace) -> int:
    """Print the first shot of a record whose result or scene differs; return 1 if there is one."""
    from ..replay.record import NO_END, SAME, replayed  # only this subcommand needs it

    found, endless = replayed(arguments.record, load_scene(arguments.scene))
    if found is None:
        _say(SAME)
    else:
        for text in found.told:
            _say(text if text == SAME else f"{arguments.record} line {found.line}, shot {found.shot}: {text}")
    if endless:
        _say(f"note: {arguments.record} {NO_END}")
    return 0 if found is None else 1


def demo(arguments: argparse.Namespace) -> None:
    """Write the animation of a broad phase, and print its path."""
    from ..lab.demo import KINDS, write_demo  # only this subcommand needs all structures

    _say(f"a {KINDS[arguments.kind].name} in motion is in {write_demo(arguments.kind, arguments.output)}")


def warm_up(_: argparse.Namespace) -> None:
    """Compile all kernels."""
    from ..prepared.warm_up import warm_up as compile_all  # needs numba

    def progress(done: int, steps: int) -> None:
        """Print how far it is."""
        print(f"{done} of {steps} steps", file=sys.stderr, flush=True)

    _say(f"all kernels are ready: {compile_all(progress):.1f} s")


def stability(arguments: argparse.Namespace) -> int:
    """Count wrong decisions; return 1 if hitplanes made one."""
    from ..lab.stability.stability import FILES, run_stability, summary  # heavy, and only for this subcommand

    seed = integer("--seed", arguments.seed, 0, SEED_MAX)
    study = run_stability(arguments.output, seed, arguments.quick, sys.stderr)
    for line in summary(study):
        _say(line)
    note = "" if (arguments.output / FILES[-1]).exists() else ", without a picture: matplotlib is not installed"
    _say(f"the table, and the rest, is in {arguments.output}{note}")
    return 0 if study.right else 1
