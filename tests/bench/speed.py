"""How fast are we, beside what people use today? All in one run: ratios are of the same work, in the same minutes.

pip install -e '.[peers]'; python tests/bench/speed.py [--json FILE] [--quick] [--jit] [--only static,moving]
[--objects 10,100]

1920 x 1080, objects of 48 px with irregular masks, 60 occluders before them. Ours are the public calls, checks and
`Hits` included. Every round has fresh shots, and all sides answer it in turn; what sides can compare is compared, every
row, and a difference ends the run. Times are the least of the rounds, with their median in brackets.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from speed_alone import alone
from speed_clock import Cell, bandwidth, told
from speed_far import cold, huge, rewind
from speed_floors import floors
from speed_moving import moving, moving_rays, redrawn
from speed_single import preparation, single
from speed_static import modes, special, static
from speed_targets import judged
from speed_weapons import weapons
from strategies import planner

import hitplanes
from hitplanes import use_jit
from hitplanes.planes.files.png import write_text

SECTIONS: dict[str, Callable[[Any], Iterator[Cell]]] = {
    "static": static,
    "special": special,
    "weapons": weapons,
    "moving": moving,
    "moving rays": moving_rays,
    "redrawn": redrawn,
    "single": single,
    "alone": alone,
    "preparation": preparation,
    "rewind": rewind,
    "huge": huge,
    "planner": planner,
    "floors": floors,
    "cold": cold,
}


@dataclass(frozen=True)
class Settings:
    """How much is measured.

    Parameters
    ----------
    objects, moving, single, planner : numbers of objects
    redrawn, huge : number of objects of these
    shots, rewound, batches : shots of a batch; of a rewind; of the planner's
    row : batches that are fired one after the other, if there is time for them
    frames, steps, calls, starts : frames of a round, short steps of a round, single calls of a round, processes
    rounds, seconds : rounds of each cell; how long a peer may take of each
    jit : also measure the compiled twins
    """

    objects: tuple[int, ...] = (10, 100, 1000, 10_000)
    moving: tuple[int, ...] = (10, 100, 1000, 10_000)
    single: tuple[int, ...] = (100, 1000)
    planner: tuple[int, ...] = (10, 100, 1000)
    redrawn: int = 1000
    huge: int = 100_000
    shots: int = 10_000
    row: int = 32
    rewound: int = 1000
    batches: tuple[int, ...] = (1, 100, 2000)
    frames: int = 12
    steps: int = 40
    calls: int = 500
    starts: int = 15
    rounds: int = 7
    seconds: float = 0.1
    jit: bool = False


QUICK = Settings(
    objects=(10, 100, 1000), moving=(100, 1000), shots=2000, row=4, frames=4, calls=100, starts=5, rounds=3,
    seconds=0.05, huge=10_000, rewound=200, planner=(100, 1000),
)  # fmt: skip


def measured(settings: Settings, only: Sequence[str], tell: Callable[[str], object] = print) -> dict[str, Any]:
    """Measure sections, tell their tables as they come, and give all of it as JSON."""
    about = machine()
    rates = bandwidth()
    load = ", ".join(f"{load:.1f}" for load in about["load"])
    tell(f"{about['python']}, numpy {about['versions']['numpy']}, {about['cpus']} CPUs, load {load}")
    tell(f"measured: {Path(hitplanes.__file__).parent}")
    tell("bytes a second: " + ", ".join(f"{name} {rate / 1e9:.1f} GB/s" for name, rate in rates.items()))
    cells: list[Cell] = []
    try:
        for section in only:
            cells += told_section(section, SECTIONS[section](settings), tell)
    finally:
        use_jit(None)
    about["load after"] = os.getloadavg()
    targets = judged(cells, list(modes(settings)))
    tell("\ntargets")
    for line in targets:
        tell(_target_line(line))
    return {
        "machine": about,
        "bandwidth": rates,
        "settings": asdict(settings),
        "cells": [cell.to_dict() for cell in cells],
        "targets": targets,
    }


def told_section(section: str, found: Iterator[Cell], tell: Callable[[str], object]) -> list[Cell]:
    """Tell the cells of a section as they are measured."""
    cells: list[Cell] = []
    easier: dict[str, str] = {}
    head: list[str] = []
    for cell in found:
        if not cells:
            tell(f"\n{section}, {cell.unit}: least (median), over the first; = rows compared; * an easier question")
        cells.append(cell)
        easier |= {name: times.easier for name, times in cell.sides.items() if times.easier}
        if head != (head := _columns(cell, head)):
            tell(f"{'M':>7}  {'':30}{'rows':>8}" + "".join(f"{name:>29}" for name in head))
        tell(
            f"{cell.objects:7}  {cell.what:30}{_shown_rows(cell):>8}"
            + "".join(f"{_side(cell, name):>29}" for name in head)
        )
        for name, value in cell.values.items():
            tell(f"{'':47}{name}: {_shown(value)}")
    for name, why in easier.items():
        tell(f"* {name}: {why}")
    return cells


def _columns(cell: Cell, head: list[str]) -> list[str]:
    """The sides of a cell: the columns before, if they have room for them."""
    return head if set(cell.sides) <= set(head) else list(cell.sides)


def _side(cell: Cell, name: str) -> str:
    """Time of a side, and how many times as long as the first it takes."""
    if name not in cell.sides:
        return ""
    times = cell.sides[name]
    ratio = cell.ratio(name, next(iter(cell.sides)))
    mark = "=" * times.compared + "*" * bool(times.easier)
    return f"{told(times.least)} ({told(times.median)}) {ratio:.3g}x{mark:2}"


def _shown_rows(cell: Cell) -> str:
    """Rows of a shot, or of a frame."""
    return "" if cell.rows is None else f"{cell.rows:.3g}"


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {_shown(one)}" for name, one in value.items())
    return "none" if value is None else f"{value:,.4g}" if abs(value) < 100 else f"{value:,.0f}"


def _target_line(line: dict[str, Any]) -> str:
    verdict = {True: "reached", False: "NOT reached", None: ""}[line["reached"]]
    figure = "-" if line["measured"] is None else f"{line['measured']:.3g}"
    wanted = f"{line['sense']:8} {line['wanted']:5}"
    return f"{line['target']:44} {line['mode']:6} {wanted} {figure:>8} {verdict:12} {line['where']}"


def machine() -> dict[str, Any]:
    """What ran it."""
    found = {}
    for name in ("numpy", "numba", "pygame-ce", "pymunk", "shapely", "opencv-python-headless"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    python = f"{platform.python_implementation()} {platform.python_version()}"
    return {
        "python": python,
        "system": platform.system(),
        "cpus": os.cpu_count(),
        "load": os.getloadavg(),
        "versions": found,
    }


def main(arguments: Sequence[str]) -> dict[str, Any]:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write all figures there")
    parser.add_argument("--quick", action="store_true", help="fewer objects, shots and rounds")
    parser.add_argument("--jit", action="store_true", help="the compiled twins too, beside numpy alone")
    parser.add_argument("--only", default=",".join(SECTIONS), help="sections: %(default)s")
    parser.add_argument("--objects", help="numbers of objects, of all sections that have several")
    given = parser.parse_args(arguments)
    only = given.only.split(",")
    if unknown := [name for name in only if name not in SECTIONS]:
        parser.error(f"--only: expected some of {', '.join(SECTIONS)}, got {', '.join(unknown)}")
    values: dict[str, Any] = asdict(QUICK if given.quick else Settings())
    if given.objects:
        counts = tuple(int(count) for count in given.objects.split(","))
        values |= dict.fromkeys(("objects", "moving", "single", "planner"), counts)
    values["jit"] = given.jit
    found = measured(Settings(**values), only, lambda line: print(line, flush=True))
    if given.json:
        write_text(given.json, json.dumps(found, indent=1) + "\n")
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
