"""Count wrong decisions of hitplanes and others on hard input, by predicate and family, as JSON, table and picture.

Every decision is compared with the exact answer of `truth`. Rows come in blocks, each with its own seed, so a seed asks
the same questions in every run, and an interrupted run keeps its complete blocks. The picture uses the colours of
cividis, which the colour-blind can read, and writes the numbers in the cells.
"""

from __future__ import annotations

import functools
import json
import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from hitplanes.planes.common.checks import Bools, InputError, integer, path_of
from hitplanes.planes.common.limits import SEED_MAX
from hitplanes.planes.files.png import write_text
from hitplanes.planes.files.scene_folder import cleared, own_folder

from ...replay.stream import Progress
from ..peers import PEERS, installed, of_peer, versions
from ..study.study import FAINT, HATCH, INK, PAPER, looking_alike, markdown_table, save_figure
from .families import FAMILIES
from .predicates import PREDICATES, Method, Predicate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


FORMAT = "hitplanes-stability/1"
OURS, NAIVE = "hitplanes", "naive float64"


@dataclass
class Count:
    """Decisions of one method in one cell."""

    cases: int = 0
    missed: int = 0
    false: int = 0

    @property
    def wrong(self) -> int:
        """Number of wrong decisions, missed or false."""
        return self.missed + self.false

    @property
    def per_million(self) -> float:
        """Wrong decisions per million."""
        return 1e6 * self.wrong / self.cases

    def add(self, true: Bools, said: Bools) -> None:
        """Add the decisions of a block."""
        self.cases += len(true)
        self.missed += int((true & ~said).sum())
        self.false += int((~true & said).sum())


@dataclass
class Cell:
    """Results of a predicate in a family: number of rows, counts by method, and errors of methods that failed."""

    predicate: str
    family: str
    asked: int
    methods: dict[str, Count] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of rows that at least one method has answered."""
        return max((count.cases for count in self.methods.values()), default=0)

    @property
    def complete(self) -> bool:
        """Whether all rows were answered."""
        return self.rows == self.asked


@dataclass
class Study:
    """A run: its seed, whether it is quick, the versions of the libraries, and the cells so far."""

    seed: int
    quick: bool
    versions: dict[str, str]
    cells: list[Cell] = field(default_factory=list)

    @property
    def methods(self) -> list[str]:
        """Names of the methods: hitplanes, the textbook formulas, then libraries."""
        return [OURS, NAIVE, *(name for name in PEERS if name in self.versions)]

    @property
    def complete(self) -> bool:
        """Whether all cells exist and are complete."""
        return len(self.cells) == sum(len(p.families) for p in PREDICATES) and all(c.complete for c in self.cells)

    def cell(self, predicate: str, family: str) -> Cell | None:
        """Return a cell, or None if it has not been asked."""
        return next((c for c in self.cells if (c.predicate, c.family) == (predicate, family)), None)

    @property
    def right(self) -> bool:
        """Whether hitplanes answered every question, and made no wrong decision."""
        return not self.total(OURS).wrong and not any(OURS in cell.failed for cell in self.cells)

    def asked(self, method: str) -> list[str]:
        """Return the names of the predicates that a method has answered."""
        answered = {c.predicate for c in self.cells if method in c.methods}
        return [p.name for p in PREDICATES if p.name in answered]

    def total(self, method: str) -> Count:
        """Return the sum of the counts of a method."""
        found = [c.methods[method] for c in self.cells if method in c.methods]
        return Count(*(sum(getattr(c, name) for c in found) for name in ("cases", "missed", "false")))

    def to_json(self) -> dict[str, Any]:
        """Return the content of `stability.json`."""
        about = {name: getattr(self, name) for name in ("seed", "quick", "complete", "versions")}
        return {"format": FORMAT, **about, "families": FAMILIES, "cells": [asdict(cell) for cell in self.cells]}


def load_study(path: Path) -> Study:
    """Read a `stability.json`; any other file is an InputError."""
    path = path_of("path", path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["format"] != FORMAT:
            raise InputError(f"format: expected {FORMAT!r}, got {data['format']!r}")
        cells = [
            Cell(**{**c, "methods": {name: Count(**n) for name, n in c["methods"].items()}}) for c in data["cells"]
        ]
        return Study(data["seed"], data["quick"], data["versions"], cells)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected what `hitplanes stability` writes, got {error}") from error


EMPTY = "#f3f5f7"
WIDTH, LEFT, RIGHT = 11.0, 1.75, 0.85  # widths of the picture and of its margins, inches
ROW, GAP, NAMES, HEADING, SCALE = 0.255, 0.42, 1.1, 0.62, 0.85
"""Heights of a row, a block's title, the columns' names, the picture's title, and the scale, inches."""
LIGHTEST = 0.12  # start of the colour scale; lighter colours look like none
DARK = 0.5  # brightness of a colour below which text on it is white
FULL = 7  # characters that fill a cell


def heat_figure(study: Study) -> Figure:
    """Draw the wrong decisions of a run, with a block of predicates by families for each method.

    The colour of a cell is the logarithm of the wrong decisions per million, which are also written in it. A cell
    without any is white and says 0; a cell that was not asked is hatched.
    """
    from matplotlib.figure import Figure

    blocks = {method: names for method in study.methods if (names := study.asked(method))}
    height = HEADING + NAMES + sum(GAP + ROW * len(names) for names in blocks.values()) + SCALE
    with looking_alike():
        figure = Figure(figsize=(WIDTH, height))
        note = "" if study.complete else " (not complete)"
        title = f"Wrong decisions on input that is hard to decide{note}"
        figure.text(0.15 / WIDTH, 1 - 0.18 / height, title, weight="bold", size=13, va="top")
        run = f"seed {study.seed}{', quick' * study.quick}"
        text = f"Part of the answers that exact rational arithmetic contradicts; {run}"
        figure.text(0.15 / WIDTH, 1 - 0.46 / height, text, color=FAINT, va="top")
        top = height - HEADING - NAMES
        for k, (method, names) in enumerate(blocks.items()):
            top -= GAP + ROW * len(names)
            wide, high = 1 - (LEFT + RIGHT) / WIDTH, ROW * len(names) / height
            axes = figure.add_axes((LEFT / WIDTH, top / height, wide, high))
            _block(axes, study, method, names)
            if k == 0:  # the names of the families, slanted; all blocks have the same columns
                axes.set_xticks(range(len(FAMILIES)), [re.sub(r"\^(-?\d+)", r"$^{\1}$", f) for f in FAMILIES.values()])
                axes.tick_params(axis="x", labeltop=True, labelbottom=False, rotation=38, pad=19)
                for label in axes.get_xticklabels():
                    label.set(ha="left", va="bottom", rotation_mode="anchor")
        _scale(figure, height)
    return figure


def _block(axes: Axes, study: Study, method: str, predicates: list[str]) -> None:
    """Draw the block of a method, with a row for each of its predicates."""
    from matplotlib.patches import Rectangle

    wide, high = len(FAMILIES), len(predicates)
    axes.add_patch(Rectangle((-0.5, -0.5), wide, high, facecolor=EMPTY, edgecolor=HATCH, linewidth=0, hatch="////"))
    for y, predicate in enumerate(predicates):
        for x, family in enumerate(FAMILIES):
            cell = study.cell(predicate, family)
            if cell is not None and method in cell.methods:
                _square(axes, x, y, cell.methods[method].per_million)
    total, name = study.total(method), f"{method} {study.versions.get(method, '')}".strip()
    axes.text(-0.5, -0.72, name, weight="bold", size=10.5)
    axes.text(wide - 0.5, -0.72, f"{total.wrong:,} wrong of {total.cases:,}", ha="right", size=9.5)
    axes.set(xlim=(-0.5, wide - 0.5), ylim=(high - 0.5, -0.5), xticks=[])
    axes.set_yticks(range(high), predicates)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _square(axes: Axes, x: int, y: int, per_million: float) -> None:
    """Draw a cell, with its colour and text."""
    from matplotlib.patches import Rectangle

    color, rim, text = (_color(per_million), 0.0, rate(per_million)) if per_million else ((1.0, 1.0, 1.0), 0.8, "0")
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=PAPER, linewidth=0))
    axes.add_patch(Rectangle((x - 0.47, y - 0.45), 0.94, 0.9, facecolor=color, edgecolor=HATCH, linewidth=rim))
    dark = color[0] * 0.3 + color[1] * 0.59 + color[2] * 0.11 < DARK
    ink, size = PAPER if dark else INK, 8 if len(text) < FULL else 7
    axes.text(x, y, text, ha="center", va="center_baseline", color=ink, size=size)


def _color(per_million: float) -> tuple[float, float, float]:
    """Return a colour of cividis, darker for more wrong decisions."""
    from matplotlib import colormaps

    share = min(max(math.log10(per_million) / 6, 0.0), 1.0)
    red, green, blue, _ = colormaps["cividis_r"](LIGHTEST + (1 - LIGHTEST) * share)
    return red, green, blue


def rate(per_million: float) -> str:
    """Return a rate as short text: per cent, or ppm below a thousandth."""
    value, unit = (per_million / 10_000, "%") if per_million >= 1000 else (per_million, "ppm")
    return f"{value:.0f} {unit}" if value >= 10 else f"{value:.2g} {unit}"


def _scale(figure: Figure, height: float) -> None:
    """Draw the colour scale and the legend below all blocks."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm

    colors = ListedColormap([_color(10 ** (6 * k / 255)) for k in range(256)])
    axes = figure.add_axes((LEFT / WIDTH, 0.5 / height, 0.48, 0.14 / height))
    bar = figure.colorbar(ScalarMappable(LogNorm(1, 1e6), colors), cax=axes, orientation="horizontal")
    bar.set_label("wrong decisions in a million (1 ppm to all)", labelpad=1)
    bar.outline.set_visible(False)
    figure.text(LEFT / WIDTH + 0.52, 0.57 / height, "0: none wrong      hatched: not asked", va="center")


ONE_BY_ONE, ONE_BY_ONE_MOST = ("pymunk", "pygame-ce"), 10**5
"""Libraries that are called row by row, and the most rows of a cell that they answer."""
FILES = ("stability.json", "stability.md", "stability.png")


def run_stability(folder: Path, seed: int = 0, quick: bool = False, stream: TextIO | None = sys.stderr) -> Study:
    """Ask all questions, and write the JSON, the table and, if matplotlib is installed, the picture.

    A quick run asks a few hundred rows for each cell instead of up to a million. Progress is drawn on the stream. An
    interrupt writes the results so far. A folder that holds other files is refused.
    """
    seed = integer("seed", seed, 0, SEED_MAX)
    folder = path_of("output", folder)
    made = own_folder(folder, FILES)
    study = Study(seed, quick, versions("hitplanes", "numpy", *filter(installed, PEERS)))
    progress = Progress(stream, "decisions")
    try:
        _ask(study, progress, lambda: _keep(study, folder))
    except KeyboardInterrupt:
        progress.clear()
        if not any(cell.rows for cell in study.cells):
            if made:
                folder.rmdir()
            raise  # keep the files of an earlier run
        _write(study, folder)
        raise KeyboardInterrupt(f"what was asked so far is in {folder}; it is not complete") from None
    progress.clear()
    _write(study, folder)
    return study


def _ask(study: Study, progress: Progress, keep: Callable[[], None]) -> None:
    plan = [(p, family, p.quick if study.quick else p.rows) for p in PREDICATES for family in p.families]
    progress.begin(sum(p.cost * asked for p, _, asked in plan), 0, 0)
    done = 0
    for predicate, family, asked in plan:
        cell = Cell(predicate.name, family, asked)
        study.cells.append(cell)
        for rows in _blocks(predicate, family, cell, study):
            progress.show(sum(c.rows for c in study.cells), done + predicate.cost * rows)
        done += predicate.cost * asked
        keep()


def _blocks(predicate: Predicate, family: str, cell: Cell, study: Study) -> Iterator[int]:
    """Ask the questions of a cell block by block; yield the number of rows done."""
    methods: dict[str, Method | None] = {OURS: predicate.ours, NAIVE: predicate.naive}
    methods |= {peer: of_peer(peer, predicate.name) for peer in PEERS if peer in study.versions}
    place = [PREDICATES.index(predicate), list(FAMILIES).index(family)]
    done = 0
    while done < cell.asked:
        rng = np.random.default_rng([study.seed, *place, done])
        columns = predicate.families[family](rng, min(predicate.block, cell.asked - done))
        true = predicate.true(columns)
        counts, failed = {}, dict(cell.failed)
        for name, method in methods.items():
            if method is None or name in failed:
                continue
            counts[name] = replace(cell.methods.get(name, Count()))
            if name in ONE_BY_ONE and done >= ONE_BY_ONE_MOST:
                continue
            try:
                with np.errstate(all="ignore"):
                    counts[name].add(true, method(*columns))
            except Exception as error:  # whatever a library raises
                failed[name] = f"{type(error).__name__}: {error}"
        cell.methods = {name: count for name, count in counts.items() if name not in failed}  # complete blocks only
        cell.failed = failed
        done += len(true)
        yield done


def _keep(study: Study, folder: Path) -> None:
    """Write the cells so far; the first cell replaces an earlier run."""
    if len(study.cells) == 1:
        cleared(folder, FILES[1:])
    write_text(folder / FILES[0], json.dumps(study.to_json(), indent=1) + "\n")


def _write(study: Study, folder: Path) -> None:
    """Write the JSON, the tables and, if matplotlib is installed, the picture."""
    _keep(study, folder)
    write_text(folder / FILES[1], markdown(study))
    if find_spec("matplotlib") is None:
        return
    try:
        save_figure(heat_figure(study), folder / FILES[2])
    except KeyboardInterrupt:
        missing = "only the picture is missing" if study.complete else "it is not complete, and the picture is missing"
        raise KeyboardInterrupt(f"what was asked is in {folder}; {missing}") from None


def markdown(study: Study) -> str:
    """Return a run as Markdown, with a table for each method and one of the numbers of rows."""
    families = [f for f in FAMILIES if any(c.family == f for c in study.cells)]
    predicates = [p.name for p in PREDICATES if any(c.predicate == p.name for c in study.cells)]
    lines = ["# Wrong decisions on hard input", "", *_head(study), ""]
    for method in study.methods:
        if asked := study.asked(method):
            lines += [f"## {method} {study.versions.get(method, '')}".rstrip(), ""]
            lines += _table(study, asked, families, functools.partial(_entry, method))
    lines += ["## Rows asked", ""]
    lines += _table(study, predicates, families, lambda cell: f"{cell.rows:,}")
    return "\n".join(lines)


def _head(study: Study) -> list[str]:
    text = "Wrong decisions of those asked, against exact rational truth: missed + false. Touching counts as meeting."
    late = "" if study.complete else " **This run is not complete.**"
    names = ", ".join(f"{name} {number}" for name, number in study.versions.items())
    out = ", ".join(name for name in PEERS if name not in study.versions)
    asked = f"Seed {study.seed}{', quick' if study.quick else ''}; {names}."
    absent = f" Not installed, so not asked: {out}." if out else ""
    return [text + late, "", asked + absent, "", *(f"- {line}" for line in summary(study))]


def _table(
    study: Study, predicates: Sequence[str], families: Sequence[str], entry: Callable[[Cell], str]
) -> Iterator[str]:
    rows = [
        [name, *("-" if (cell := study.cell(name, family)) is None else entry(cell) for family in families)]
        for name in predicates
    ]
    return markdown_table(["predicate", *(FAMILIES[f] for f in families)], rows, numbers=True)


def _entry(method: str, cell: Cell) -> str:
    count = cell.methods.get(method)
    if count is None:
        return "failed" if method in cell.failed else "-"
    if count.wrong:
        return f"{count.missed:,} + {count.false:,} of {count.cases:,}"
    return "0" if count.cases == cell.asked else f"0 of {count.cases:,}"


def summary(study: Study) -> list[str]:
    """Return a line for each method: its wrong decisions, and the cell with the most."""
    lines = []
    for method in study.methods:
        total = study.total(method)
        failed = [cell for cell in study.cells if method in cell.failed]
        if not total.cases and not failed:
            continue
        line = f"{method}: {total.wrong:,} wrong of {total.cases:,}"
        if total.wrong:
            answered = [cell for cell in study.cells if method in cell.methods]
            worst = max(answered, key=lambda cell: cell.methods[method].per_million)
            count = worst.methods[method]
            line += f"; most in {worst.predicate}, {FAMILIES[worst.family]}: {100 * count.wrong / count.cases:.1f} %"
        if failed:
            line += f"; it failed in {len(failed)} cells, first by {failed[0].failed[method]}"
        lines.append(line)
    return lines
