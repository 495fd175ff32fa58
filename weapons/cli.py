"""The command `hitplanes`: one function for each of its words, and no decision of its own."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from planes.arrays import InputError
from planes.image import check_output, write_png, write_text
from planes.scene import load_scene
from weapons.arsenal import arsenal_of
from weapons.facts import report_of
from weapons.orders import fire_order, order_from_json, orders_of
from weapons.picture import picture_of_report

__all__ = ["main"]

DESCRIPTION = "What does a shot hit in a 2-D scene? Decided by pixels, exactly, and shown why."

NAMED = 8
"""Objects that a line of output names."""

REPORT_HELP = """\
Fire shots at a scene folder and write a picture, and the facts as JSON, that say what was hit and why.
Without --weapon the shots of scene.json are fired.
"""

EXAMPLES = """\
examples:
  hitplanes report fixtures/gallery
  hitplanes report fixtures/gallery -o report.png --json report.json
  hitplanes report fixtures/gallery --weapon shotgun --at 138,91 --seed 7
  hitplanes report fixtures/gallery --weapon laser --at 100,167 --aim -4.5
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; exit codes: 0 done, 2 bad input, 130 interrupted."""
    arguments = parser().parse_args(argv)
    try:
        arguments.run(arguments)
    except InputError as error:
        print(f"hitplanes: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("hitplanes: interrupted", file=sys.stderr)
        return 130
    return 0


def parser() -> argparse.ArgumentParser:
    """Words, options and help of the command."""
    top = argparse.ArgumentParser(prog="hitplanes", description=DESCRIPTION)
    words = top.add_subparsers(required=True, metavar="COMMAND")
    raw = argparse.RawDescriptionHelpFormatter
    one = words.add_parser(
        "report",
        help="fire at a scene and draw what was hit",
        description=REPORT_HELP,
        epilog=EXAMPLES,
        formatter_class=raw,
    )
    one.add_argument("scene", type=Path, metavar="SCENE", help="folder with scene.json and its images")
    one.add_argument("--weapon", metavar="NAME", help="a weapon of the scene; fires one shot, with the options below")
    one.add_argument("--at", metavar="X,Y", help="where it is fired, px (--at=-5,3 where X is negative)")
    one.add_argument("--aim", type=float, metavar="DEG", help="direction in degrees: 0 to the right, 90 down")
    one.add_argument("--seed", type=int, metavar="N", help="seed of the pellets")
    one.add_argument("-o", "--output", type=Path, default=Path("report.png"), metavar="PNG", help="default: report.png")
    one.add_argument("--json", type=Path, metavar="JSON", help="write the facts, too")
    one.set_defaults(run=report)
    return top


def report(arguments: argparse.Namespace) -> None:
    """Write the picture, and the facts, of the scene's shots or of one shot."""
    _check_outputs(arguments.output, arguments.json)
    scene = load_scene(arguments.scene)
    arsenal = arsenal_of(scene)
    if arguments.weapon is None:
        for name in ("at", "aim", "seed"):
            if getattr(arguments, name) is not None:
                raise InputError(f"--{name}: expected only together with --weapon, got no weapon")
        orders = orders_of(scene, arsenal)
    else:
        orders = [order_from_json(_shot(arguments), scene, arsenal, "command line")]
    fired = [fire_order(scene, order) for order in orders]
    facts = report_of(scene, fired, [order.name for order in orders])
    write_png(arguments.output, picture_of_report(facts, scene))
    if arguments.json is not None:
        write_text(arguments.json, json.dumps(facts, indent=1) + "\n")
    if not orders:
        print(f"{scene.name}: no shots in its scene.json; name one with --weapon and --at")
    for shot in facts["shots"]:
        hit = ", ".join(f"{row['name']} {row['pixels']} px" for row in shot["rows"][:NAMED]) or "nothing"
        if len(shot["rows"]) > NAMED:
            hit += f" and {len(shot['rows']) - NAMED} more"
        print(f"{shot['weapon']} at {shot['at'][0]:.15g}, {shot['at'][1]:.15g}: {hit}")


def _check_outputs(picture: Path, facts: Path | None) -> None:
    check_output(picture)
    if picture.suffix.lower() != ".png":
        raise InputError(f"--output: expected a name that ends in .png, got {picture.name!r}")
    if facts is not None:
        check_output(facts)
        if facts.resolve() == picture.resolve():
            raise InputError(f"--json: expected another file than --output, got {str(facts)!r} for both")


def _shot(arguments: argparse.Namespace) -> dict[str, Any]:
    """One shot of the command line as a scene file would have it."""
    if arguments.at is None:
        raise InputError("--at: expected X,Y with --weapon, got nothing")
    try:
        at = [float(part) for part in arguments.at.split(",")]
    except ValueError as error:
        raise InputError(f"--at: expected two numbers X,Y, got {arguments.at!r}") from error
    shot: dict[str, Any] = {"weapon": arguments.weapon, "at": at}
    return shot | {name: getattr(arguments, name) for name in ("aim", "seed") if getattr(arguments, name) is not None}
