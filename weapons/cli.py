"""The command `hitplanes`: one function for each of its words, and no decision of its own."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn

from planes.arrays import InputError, integer, real, within
from planes.constants import SEED_MAX
from planes.image import check_output, write_png, write_text
from planes.items import Role
from planes.loading import load_scene
from planes.scene import Scene
from planes.scenefile import FILE_NAME, scene_folder
from weapons.arsenal import arsenal_of
from weapons.differences import differences
from weapons.facts import report_of
from weapons.helptexts import (
    COMPARE_EXAMPLES,
    COMPARE_HELP,
    DEMO_EXAMPLES,
    DEMO_HELP,
    DESCRIPTION,
    FIRE_EXAMPLES,
    FIRE_HELP,
    NEW_EXAMPLES,
    NEW_HELP,
    REPLAY_EXAMPLES,
    REPLAY_HELP,
    REPORT_EXAMPLES,
    REPORT_HELP,
    STABILITY_EXAMPLES,
    STABILITY_HELP,
    STUDY_EXAMPLES,
    STUDY_HELP,
)
from weapons.hits import Hits
from weapons.orders import Order, fire_order, order_from_json, orders_of
from weapons.picture import picture_of_report
from weapons.plan import PlanSum, plan_lines
from weapons.progress import Progress
from weapons.schemas import read_report
from weapons.starter import write_starter
from weapons.stream import fire_log
from weapons.versus import picture_of_difference

__all__ = ["main"]


NAMED = 8
"""Objects that a line of output names."""

USAGE_MAX = 300
"""Letters of a word that the command line does not take."""


SHOWN = ("quadtree", "grid", "bvh")
"""Structures that the demo has."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; exit codes: 0 done, 1 something differs or is wrong, 2 bad input, 130 interrupted."""
    arguments = parser().parse_args(argv)
    code = 0
    try:
        code = arguments.run(arguments) or 0
        if sys.stdout is not None:
            with _printing():
                sys.stdout.flush()
    except BrokenPipeError:  # whoever read what is printed has seen enough; the files are written
        _hush()
    except InputError as error:
        print(f"hitplanes: {_plain(' '.join(str(error).split()))}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as interrupt:
        print(": ".join(["hitplanes: interrupted", *map(str, interrupt.args)]), file=sys.stderr)
        return 130
    return code


@contextmanager
def _printing() -> Iterator[None]:
    """Name what goes wrong with what is printed."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        _hush()
        raise InputError(f"output: cannot write what is printed: {error.strerror}") from error


def _hush() -> None:
    """Send what is left to be printed nowhere, or Python would try it again on its way out."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _say(line: str) -> None:
    """Print a line; what the terminal cannot show, or might obey, is spelled out."""
    if sys.stdout is None:  # closed before we began
        return
    encoding = sys.stdout.encoding or "utf-8"
    with _printing():
        print(_plain(line).encode(encoding, "backslashreplace").decode(encoding))


def _plain(text: str) -> str:
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line, as all errors of the command are."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the words, and exit with 2."""
        if message.endswith("expected one argument"):
            message += "; one that begins with a minus is written --at=-5,3"
        told = _plain(" ".join(message.split()))
        told = told if len(told) <= USAGE_MAX else told[:USAGE_MAX] + "..."
        self.exit(2, f"hitplanes: {told} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """Words, options and help of the command."""
    top = OneLineParser(prog="hitplanes", description=DESCRIPTION)
    top.add_argument("--version", action="version", version=f"hitplanes {version('hitplanes')}")
    words = top.add_subparsers(required=True, metavar="COMMAND")

    _add_report(words)
    one = _word(words, fire, "resolve a log of shots", FIRE_HELP, FIRE_EXAMPLES)
    one.add_argument("shots", type=Path, metavar="SHOTS.jsonl", help="the log")
    one.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("hits.jsonl"),
        metavar="HITS.jsonl",
        help="a name that ends in .jsonl (default: hits.jsonl)",
    )
    one.add_argument("--plan", action="store_true", help="print what each stage cost, and what was left out, added up")
    one = _word(words, new, "write a small scene to start from", NEW_HELP, NEW_EXAMPLES)
    one.add_argument("folder", type=Path, metavar="FOLDER", help="where to; its parent must be there")
    one = _word(words, compare, "say and draw what differs between two reports", COMPARE_HELP, COMPARE_EXAMPLES)
    one.add_argument("expected", type=Path, metavar="A.json", help="a report, as report --json writes it")
    one.add_argument("got", type=Path, metavar="B.json", help="another")
    one.add_argument("-o", "--output", type=Path, metavar="PNG", help="draw them, too")
    told = "scene of one of them or of both, to draw them on; may be given twice"
    one.add_argument("--scene", type=Path, metavar="SCENE", action="append", help=told)
    one = _word(
        words, replay, "fire a record of shots again, and tell the first that differs", REPLAY_HELP, REPLAY_EXAMPLES
    )
    one.add_argument("record", type=Path, metavar="RECORD.jsonl", help="a file of weapons.ShotRecord")
    _add_measurements(words)
    one = _word(words, demo, "show a quadtree, a grid or a BVH in motion", DEMO_HELP, DEMO_EXAMPLES)
    one.add_argument("kind", choices=SHOWN, metavar="KIND", help=f"one of {', '.join(SHOWN)}")
    told = "a name that ends in .gif, or a new folder for PNG files (default: demo.gif)"
    one.add_argument("-o", "--output", type=Path, default=Path("demo.gif"), metavar="GIF", help=told)
    return top


def _add_measurements(words: Any) -> None:
    one = _word(words, study, "measure error against run time of all tests", STUDY_HELP, STUDY_EXAMPLES)
    told = "folder with scene.json and its images (default: a shape of each kind)"
    one.add_argument("scene", type=Path, metavar="SCENE", nargs="?", help=told)
    told = "a new folder, or that of an earlier study (default: study)"
    one.add_argument("-o", "--output", type=Path, default=Path("study"), metavar="FOLDER", help=told)
    told = "what is good enough: wrong decisions a shot, or error of a share (default: 0.01)"
    one.add_argument("--error", type=float, default=0.01, metavar="E", help=told)
    one.add_argument("--quick", action="store_true", help="fewer shots and runs: under half a minute")
    one.add_argument("--seed", type=int, default=0, metavar="N", help="of the shots (default: 0)")
    one = _word(words, stability, "count wrong decisions on hard input", STABILITY_HELP, STABILITY_EXAMPLES)
    told = "a new folder, or that of an earlier run (default: stability)"
    one.add_argument("-o", "--output", type=Path, default=Path("stability"), metavar="FOLDER", help=told)
    one.add_argument("--quick", action="store_true", help="some hundred rows for each cell: seconds, not half an hour")
    one.add_argument("--seed", type=int, default=0, metavar="N", help="of the questions (default: 0)")


def _add_report(words: Any) -> None:
    one = _word(words, report, "fire at a scene and draw what was hit", REPORT_HELP, REPORT_EXAMPLES)
    one.add_argument("--weapon", metavar="NAME", help="a weapon of the scene; fires one shot, with the options below")
    one.add_argument("--at", metavar="X,Y", help="where it is fired, px (--at=-5,3 where X is negative)")
    one.add_argument("--aim", type=float, metavar="DEG", help="direction in degrees: 0 to the right, 90 down")
    one.add_argument("--toward", metavar="X,Y", help="or the point that it is aimed at, px")
    one.add_argument("--seed", type=int, metavar="N", help="seed of the pellets")
    one.add_argument("-o", "--output", type=Path, default=Path("report.png"), metavar="PNG", help="default: report.png")
    one.add_argument("--json", type=Path, metavar="JSON", help="write the facts, too")
    told = "fire with it and draw its volumes: none, box, circle, 'oriented box', '4 boxes' (1 to 64), polygon, swept"
    one.add_argument("--prefilter", metavar="NAME", help=told)
    one.add_argument("--broadphase", metavar="NAME", help="fire with it and draw its cells: grid, quadtree, bvh")
    one.add_argument(
        "--plan", action="store_true", help="print what each stage of a shot cost, what was left out, and why"
    )


def _word(
    words: Any, run: Callable[[argparse.Namespace], int | None], told: str, text: str, examples: str
) -> argparse.ArgumentParser:
    """Add a word of the command; those that fire take a scene first."""
    raw = argparse.RawDescriptionHelpFormatter
    one: argparse.ArgumentParser = words.add_parser(
        run.__name__, help=told, description=text, epilog=examples, formatter_class=raw
    )
    one.set_defaults(run=run)
    if run in (report, fire, replay):
        one.add_argument("scene", type=Path, metavar="SCENE", help="folder with scene.json and its images")
    return one


def report(arguments: argparse.Namespace) -> None:
    """Write the picture, and the facts, of the scene's shots or of one shot."""
    _check_outputs(arguments.output, arguments.json)
    scene = load_scene(arguments.scene)
    _check_not_of_scene(scene, arguments.scene, arguments.output, arguments.json)
    _note_empty(scene)
    orders = _orders(arguments, scene)
    how = {"prefilter": arguments.prefilter, "broadphase": arguments.broadphase}
    asked = {name: value for name, value in how.items() if value is not None}
    fired = [fire_order(scene, order, **asked) for order in orders]
    facts = report_of(scene, fired, [order.name for order in orders], **asked)
    write_png(arguments.output, picture_of_report(facts, scene))
    if arguments.json is not None:
        write_text(arguments.json, json.dumps(facts, indent=1) + "\n")
    _tell(facts, fired if arguments.plan else [])


def _orders(arguments: argparse.Namespace, scene: Scene) -> list[Order]:
    """Shots of the scene's file, or the one of the command line."""
    with within(str(scene_folder(arguments.scene) / FILE_NAME)):
        arsenal = arsenal_of(scene)
        if all(getattr(arguments, name) is None for name in ("weapon", "at", "aim", "toward", "seed")):
            return orders_of(scene, arsenal)
    if arguments.weapon is None:
        given = next(name for name in ("at", "aim", "toward", "seed") if getattr(arguments, name) is not None)
        raise InputError(f"--{given}: expected only together with --weapon, got no weapon")
    return [order_from_json(_shot(arguments), scene, arsenal, "command line")]


def _tell(facts: Mapping[str, Any], planned: Sequence[Hits]) -> None:
    """Print what each shot hit, or how many did; and what the stages of some hits cost."""
    batch = facts["batch"]
    if batch:
        _say(f"{batch['shots']} shots, {batch['shots_that_hit']} hit something")
    elif not facts["shots"]:
        _say(f"{facts['scene']['name']}: no shots in its scene.json; name one with --weapon and --at")
    for i, shot in enumerate(facts["shots"]):
        hit = ", ".join(f"{row['name']} {row['pixels']} px" for row in shot["rows"][:NAMED]) or "nothing"
        if len(shot["rows"]) > NAMED:
            hit += f" and {len(shot['rows']) - NAMED} more"
        _say(f"{shot['weapon']} at {shot['at'][0]:.15g}, {shot['at'][1]:.15g}: {hit}")
        if planned:
            _print_plan(planned[i].plan.timed())
    if batch and planned:
        done = PlanSum()
        for hits in planned:
            done.add(hits.plan)
        _print_plan(done.timed(), done.calls)


def fire(arguments: argparse.Namespace) -> None:
    """Write the answers to a log of shots."""
    check_output(arguments.output)
    scene = load_scene(arguments.scene)
    with within(str(scene_folder(arguments.scene) / FILE_NAME)):
        arsenal_of(scene)
    done = fire_log(scene, arguments.shots, arguments.output, Progress(sys.stderr))
    _say(f"{done.shots} shots, {done.hit} hit something, in {arguments.output}")
    if arguments.plan:
        _print_plan(done.plan.timed(), done.plan.calls)


def study(arguments: argparse.Namespace) -> None:
    """Measure all methods, and say which is the fastest that is good enough."""
    from weapons.kinds import kinds_scene  # a study loads much that no other word needs
    from weapons.study import Effort
    from weapons.studyfiles import NO_DIAGRAMS, write_study
    from weapons.studywords import verdict

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
    """Write a scene to start from, and say what to do next."""
    write_starter(arguments.folder)
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
        if os.path.realpath(facts) == os.path.realpath(picture):  # unlike resolve(), it takes a link to itself
            raise InputError(f"--json: expected another file than --output, got {str(facts)!r} for both")


def _check_not_of_scene(scene: Scene, folder: Path, *outputs: Path | None) -> None:
    """Refuse to write over a file that the scene is made of."""
    folder = scene_folder(folder)
    images = {str((sprite.source or {}).get("image", "")) for sprite in scene.items.sprites}
    own = {os.path.realpath(folder / name) for name in {FILE_NAME, *images}}
    for output in outputs:
        if output is not None and os.path.realpath(output) in own:
            raise InputError(f"output: expected another file than those of the scene, got {output}")


def _note_empty(scene: Scene) -> None:
    """Say which objects nothing can hit, for want of a pixel."""
    for item in (*scene.ids(Role.HITTABLE).tolist(), *scene.ids(Role.OCCLUDER).tolist()):
        if not scene.mask(item)[0].any():
            _say(f"note: {scene.name_of(item)} has no pixel: nothing hits it, it blocks nothing")


def _shot(arguments: argparse.Namespace) -> dict[str, Any]:
    """One shot of the command line as a scene file would have it."""
    if arguments.at is None:
        raise InputError("--at: expected X,Y with --weapon, got nothing")
    shot: dict[str, Any] = {"weapon": arguments.weapon, "at": _point("at", arguments.at)}
    if arguments.toward is not None:
        shot["toward"] = _point("toward", arguments.toward)
    return shot | {name: getattr(arguments, name) for name in ("aim", "seed") if getattr(arguments, name) is not None}


def _point(name: str, text: str) -> list[float]:
    """Two numbers of the command line."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"--{name}: expected two numbers X,Y, got {text!r}") from error


def compare(arguments: argparse.Namespace) -> int:
    """Print the differences of two reports, draw them if asked to, and tell by the exit code whether there are any."""
    if arguments.output is not None:
        _check_outputs(arguments.output, None)
    expected, got = read_report(arguments.expected), read_report(arguments.got)
    hashes = expected["scene"]["hash"], got["scene"]["hash"]
    scenes = {scene.content_hash(): scene for scene in map(load_scene, arguments.scene or ())}
    for other in scenes.keys() - set(hashes):
        raise InputError(f"--scene: expected that of a report, {' or '.join(hashes)}, got {other}")
    if arguments.output is not None:
        write_png(
            arguments.output, picture_of_difference(expected, got, (scenes.get(hashes[0]), scenes.get(hashes[1])))
        )
    lines = differences(expected, got)
    for line in lines or ["no difference"]:
        _say(line)
    return 1 if lines else 0


def replay(arguments: argparse.Namespace) -> int:
    """Print the first shot of a record that differs, and tell by the exit code whether there is one."""
    from weapons.record import replay as replayed  # no other word needs it

    found = replayed(arguments.record, load_scene(arguments.scene))
    if found is None:
        _say("all shots do the same again")
        return 0
    for told in found.told:
        _say(f"{arguments.record} line {found.line}, shot {found.shot}: {told}")
    return 1


def demo(arguments: argparse.Namespace) -> None:
    """Write the animation of a broad phase, and say where it is."""
    from weapons.demo import KINDS, write_demo  # no other word needs all structures

    _say(f"a {KINDS[arguments.kind].name} in motion is in {write_demo(arguments.kind, arguments.output)}")


def stability(arguments: argparse.Namespace) -> int:
    """Count wrong decisions, and tell by the exit code whether any is of hitplanes."""
    from weapons.stability import FILES, run_stability, summary  # no other word needs all that can be decided

    seed = integer("--seed", arguments.seed, 0, SEED_MAX)
    study = run_stability(arguments.output, seed, arguments.quick, sys.stderr)
    for line in summary(study):
        _say(line)
    told = "" if (arguments.output / FILES[-1]).exists() else ", without a picture: matplotlib is not installed"
    _say(f"the table, and the rest, is in {arguments.output}{told}")
    return 0 if study.right else 1
