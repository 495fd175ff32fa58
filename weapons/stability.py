"""How many decisions are wrong on input that is hard to decide? Per predicate and family, ours and those of others.

Every decision is compared with `truth`. Rows come in blocks, each from a seed of its own: the same seed asks the same
questions, however far a run came, and an interrupted run keeps the blocks that it finished.
"""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TextIO

import numpy as np

from planes.arrays import integer
from planes.constants import SEED_MAX
from planes.image import write_text
from weapons.families import FAMILIES
from weapons.folders import cleared, own_folder
from weapons.peers import PEERS, installed, of_peer
from weapons.predicates import PREDICATES, Method, Predicate
from weapons.progress import Progress
from weapons.studywords import markdown_table
from weapons.tally import NAIVE, OURS, Cell, Count, Study

__all__ = ["FILES", "markdown", "run_stability", "summary"]

ONE_BY_ONE = ("pymunk", "pygame-ce")
ONE_BY_ONE_MOST = 10**5
"""Libraries that are asked row by row answer no more rows of a cell."""

FILES = ("stability.json", "stability.md", "stability.png")
"""What a run writes."""


def run_stability(folder: Path, seed: int = 0, quick: bool = False, stream: TextIO = sys.stderr) -> Study:
    """Ask everything, and write the table, the JSON and, where matplotlib is installed, the picture.

    Parameters
    ----------
    folder : a new or an empty one, or one that an earlier run wrote
    seed : of the questions
    quick : some hundred rows for each cell in place of up to a million
    stream : where to draw how far it is

    Raises
    ------
    InputError
        If the folder holds other things, or cannot be made or written.
    KeyboardInterrupt
        After what there is has been written.
    """
    seed = integer("seed", seed, 0, SEED_MAX)
    own_folder(folder, FILES)
    study = Study(seed, quick, _versions())
    progress = Progress(stream, "decisions")
    try:
        _ask(study, progress, lambda: _keep(study, folder))
    except KeyboardInterrupt:
        progress.clear()
        if not any(cell.rows for cell in study.cells):
            raise  # what an earlier run left is left
        _write(study, folder)
        raise KeyboardInterrupt(f"what was asked so far is in {folder}; it is not complete") from None
    progress.clear()
    _write(study, folder)
    return study


def _versions() -> dict[str, str]:
    names = ["hitplanes", "numpy", *(peer for peer in PEERS if installed(peer))]
    return {name: version(name) for name in names}


def _ask(study: Study, progress: Progress, keep: Callable[[], None]) -> None:
    plan = [(p, family) for p in PREDICATES for family in p.families]
    weights = [p.cost * (p.quick if study.quick else p.rows) for p, _ in plan]
    progress.begin(sum(weights), 0, 0)
    done = 0
    for (predicate, family), weight in zip(plan, weights, strict=True):
        asked = predicate.quick if study.quick else predicate.rows
        cell = Cell(predicate.name, family, asked)
        study.cells.append(cell)
        for rows in _blocks(predicate, family, cell, study):
            progress.show(sum(c.rows for c in study.cells), done + weight * rows // asked)
        done += weight
        keep()


def _blocks(predicate: Predicate, family: str, cell: Cell, study: Study) -> Iterator[int]:
    """Ask one cell, a block at a time; gives the rows done."""
    methods = _methods(predicate, study)
    place = [PREDICATES.index(predicate), list(FAMILIES).index(family)]
    done = 0
    while done < cell.asked:
        rng = np.random.default_rng([study.seed, *place, done])
        columns = predicate.families[family](rng, min(predicate.block, cell.asked - done))
        true = predicate.true(columns)
        counts, failed = {}, dict(cell.failed)
        for name, method in methods.items():
            counts[name] = Count(**vars(cell.methods.get(name, Count())))
            if name in ONE_BY_ONE and done >= ONE_BY_ONE_MOST:
                continue
            try:
                with np.errstate(all="ignore"):
                    counts[name].add(true, method(*columns))
            except Exception as error:  # of whatever kind: it gave no answer
                failed[name] = f"{type(error).__name__}: {error}"
        methods = {name: method for name, method in methods.items() if name not in failed}
        cell.methods = {name: counts[name] for name in methods}  # all of a block, or nothing of it
        cell.failed = failed
        done += len(true)
        yield done


def _methods(predicate: Predicate, study: Study) -> dict[str, Method]:
    methods: dict[str, Method] = {OURS: predicate.ours, NAIVE: predicate.naive}
    for peer in PEERS:
        method = of_peer(peer, predicate.name) if peer in study.versions else None
        if method is not None:
            methods[peer] = method
    return methods


def _keep(study: Study, folder: Path) -> None:
    """Keep the cells so far; from the first on the folder is that of this run."""
    if len(study.cells) == 1:
        cleared(folder, FILES[1:])
    write_text(folder / FILES[0], json.dumps(study.to_json(), indent=1) + "\n")


def _write(study: Study, folder: Path) -> None:
    """Keep a run, with its tables, and its picture where one can be drawn."""
    _keep(study, folder)
    write_text(folder / FILES[1], markdown(study))
    if find_spec("matplotlib") is None:
        return
    from weapons.figures import save_figure
    from weapons.heatfigure import heat_figure

    save_figure(heat_figure(study), folder / FILES[2])


# In words


def markdown(study: Study) -> str:
    """Tell a run as Markdown: a table of each method, and one of the rows that were asked."""
    families = [f for f in FAMILIES if any(c.family == f for c in study.cells)]
    predicates = [p.name for p in PREDICATES if any(c.predicate == p.name for c in study.cells)]
    told = ["# Wrong decisions on hard input", "", *_head(study), ""]
    for method in study.methods:
        asked = [p for p in predicates if any(method in c.methods for c in study.cells if c.predicate == p)]
        if asked:
            told += [f"## {method} {study.versions.get(method, '')}".rstrip(), ""]
            told += _table(study, asked, families, functools.partial(_entry, method))
    told += ["## Rows asked", ""]
    told += _table(study, predicates, families, lambda cell: f"{cell.rows:,}")
    return "\n".join(told)


def _head(study: Study) -> list[str]:
    told = "Wrong decisions of those asked, against exact rational truth: missed + false. Touching counts as meeting."
    if not study.complete:
        told += " **This run is not complete.**"
    names = ", ".join(f"{name} {number}" for name, number in study.versions.items())
    out = [name for name in PEERS if name not in study.versions]
    asked = f"Seed {study.seed}{', quick' if study.quick else ''}; {names}."
    if out:
        asked += f" Not installed, so not asked: {', '.join(out)}."
    return [told, "", asked, "", *(f"- {line}" for line in summary(study))]


def _table(
    study: Study, predicates: Sequence[str], families: Sequence[str], entry: Callable[[Cell], str]
) -> Iterator[str]:
    rows = []
    for predicate in predicates:
        cells = [study.cell(predicate, family) for family in families]
        rows.append([predicate, *("-" if cell is None else entry(cell) for cell in cells)])
    return markdown_table(["predicate", *(FAMILIES[f] for f in families)], rows, numbers=True)


def _entry(method: str, cell: Cell) -> str:
    count = cell.methods.get(method)
    if count is None:
        return "failed" if method in cell.failed else "-"
    if count.wrong:
        return f"{count.missed:,} + {count.false:,} of {count.cases:,}"
    return "0" if count.cases == cell.asked else f"0 of {count.cases:,}"


def summary(study: Study) -> list[str]:
    """Tell a run in a few lines: of each method how many are wrong, and where most are."""
    told = []
    for method in study.methods:
        total = study.total(method)
        failed = [cell for cell in study.cells if method in cell.failed]
        if not total.cases and not failed:
            continue
        line = f"{method}: {total.wrong:,} wrong of {total.cases:,}"
        if total.wrong:
            some = [cell for cell in study.cells if method in cell.methods]
            worst = max(some, key=lambda cell: cell.methods[method].per_million)
            count = worst.methods[method]
            family = FAMILIES[worst.family]
            line += f"; most in {worst.predicate}, {family}: {100 * count.wrong / count.cases:.1f} %"
        if failed:
            line += f"; it failed in {len(failed)} cells, first by {failed[0].failed[method]}"
        told.append(line)
    return told
