"""A study in a folder: study.json, study.csv, study.md, and a diagram for each question."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from planes.image import write_text
from planes.scene import Scene
from weapons.folders import cleared, own_folder
from weapons.progress import Progress
from weapons.study import Effort, run_study
from weapons.studywords import csv_of, markdown, places

__all__ = ["NO_DIAGRAMS", "write_study"]

NO_DIAGRAMS = "the diagrams are left out: matplotlib is not installed (pip install 'hitplanes[study]')"
QUESTIONS = ("areas", "rays", "movers", "spread")
FILES = ("study.json", "study.csv", "study.md", *(f"{name}.png" for name in QUESTIONS))


def write_study(
    scene: Scene, folder: Path, seed: int, effort: Effort, error: float, progress: Progress
) -> tuple[dict[str, Any], list[str]]:
    """Run a study and keep it in a folder, a new one or that of an earlier study; an interrupted one, too.

    Returns
    -------
    the study as JSON, and the names of the questions of which there is a diagram

    Raises
    ------
    InputError
        If the folder holds other things, or cannot be written.
    KeyboardInterrupt
        After what was measured was kept.
    """
    own_folder(folder, FILES)
    kept: dict[str, Any] = {}

    def keep(study: dict[str, Any]) -> None:
        if not kept:  # from here on the folder is that of this study
            cleared(folder, FILES)
        kept.update(study)
        write_text(folder / FILES[0], json.dumps(study, indent=1) + "\n")

    try:
        run_study(scene, seed, effort, progress.step, keep)
    except KeyboardInterrupt:
        progress.clear()
        if not kept:
            raise
        _write_told(kept, folder, error)
        raise KeyboardInterrupt(f"what was measured is in {folder}") from None
    progress.clear()
    return kept, _write_told(kept, folder, error)


def _write_told(study: Mapping[str, Any], folder: Path, error: float) -> list[str]:
    """Write tables, and diagrams where they can be drawn: last, for an interrupt or a full disk may come first."""
    drawn: list[str] = []
    write_text(folder / FILES[1], csv_of(study))
    write_text(folder / FILES[2], markdown(study, error))
    if find_spec("matplotlib") is not None:
        from weapons.diagram import work_precision
        from weapons.figures import save_figure

        for question in study["questions"]:
            if places(question):
                save_figure(work_precision(question, study["scene"]["name"]), folder / f"{question['name']}.png")
                drawn.append(question["name"])
                write_text(folder / FILES[2], markdown(study, error, drawn))
    return drawn
