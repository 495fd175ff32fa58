"""Error against run time on a scene of the user's own: every method asked, measured, and written as it goes."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from planes.arrays import Ints
from planes.image import write_text
from planes.scene import Scene
from weapons.areapeers import area_peer_curves
from weapons.arsenal import Disc
from weapons.copies import copied
from weapons.decisions import Curve, Errors, Method, Question, errors_of
from weapons.discs import Discs, areas_question, discs_at
from weapons.firing import fire
from weapons.kinds import kind_of
from weapons.moverstudy import movers_question
from weapons.planestudy import plane_curves
from weapons.raystudy import rays_question
from weapons.spreadstudy import spread_question
from weapons.timing import Cost, measured
from weapons.volumestudy import volume_curves

__all__ = ["FORMAT", "Effort", "run_study"]

FORMAT = "hitplanes-study/1"
FILE_NAME = "study.json"

SPREAD_PART = 5
"""Blasts of thousands of pellets take long: so many times fewer of them than other shots."""

Show = Callable[[str, int, int], None]
"""Told what is measured next, how many points are done, and of how many."""


@dataclass(frozen=True)
class Effort:
    """How much is measured: shots of a question, runs of a method and seconds of them, objects that take part."""

    shots: int = 4000
    runs: int = 7
    seconds: float = 0.25
    objects: int = 400

    @classmethod
    def quick(cls) -> Effort:
        """Enough for a first look."""
        return cls(shots=300, runs=3, seconds=0.0, objects=40)


def run_study(scene: Scene, folder: Path, seed: int, effort: Effort, show: Show) -> dict[str, Any]:
    """Measure all methods on the objects of a scene that can be hit, and write study.json after each curve.

    Parameters
    ----------
    folder : that is there; study.json in it is written anew
    seed : of the shots; the same seed gives the same decisions, and other times
    show : told how far it is

    Returns
    -------
    the study as JSON; `complete` is false in what an interrupt leaves in the file
    """
    ids = scene.ids("hittable")
    ids = ids[scene.items.size_wh[ids, 0] > 0]
    some = (
        ids[np.unique(np.linspace(0, len(ids) - 1, min(len(ids), effort.objects)).astype(np.int64))]
        if len(ids)
        else ids
    )
    alone = copied(scene, some)
    discs = discs_at(alone, effort.shots, seed)
    questions = _questions(alone, discs, effort.shots, seed)
    kinds = [kind_of(alone, item) for item in range(len(alone))]
    study: dict[str, Any] = {
        "format": FORMAT,
        "complete": False,
        "scene": {"name": scene.name, "hash": scene.content_hash(), "objects": len(some), "of": len(ids)},
        "seed": seed,
        "versions": _versions(),
        "kinds": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
        "plan": {"shots": effort.shots, **_plan(scene, discs)},
        "questions": [_told(question) for question in questions],
    }
    points = sum(len(curve.methods) for question in questions for curve in question.curves)
    done = 0
    for question, told in zip(questions, study["questions"], strict=True):
        for curve in question.curves:
            told["curves"].append(_curve(curve))
            for method in curve.methods:
                show(f"{question.name}: {curve.name}", done, points)
                answer, cost = measured(method, effort.runs, effort.seconds)
                errors = errors_of(method.read(answer), question.truth)
                told["curves"][-1]["points"].append(_point(method, question, errors, cost, kinds))
                done += 1
            write_text(folder / FILE_NAME, json.dumps(study, indent=1) + "\n")
    study["complete"] = True
    write_text(folder / FILE_NAME, json.dumps(study, indent=1) + "\n")
    return study


def _questions(alone: Scene, discs: Discs, shots: int, seed: int) -> list[Question]:
    return [
        areas_question(discs, [*plane_curves(discs), *volume_curves(discs), *area_peer_curves(discs)]),
        rays_question(alone, shots, seed),
        movers_question(alone, shots, seed),
        spread_question(alone, max(1, shots // SPREAD_PART), seed),
    ]


def _plan(scene: Scene, discs: Discs) -> dict[str, Any]:
    """What the discs cost in the scene as it is, stage by stage, and what it left out; after a call to warm up."""
    weapon = Disc(discs.radius)
    fire(scene, weapon, discs.at)
    return fire(scene, weapon, discs.at).plan.timed()


def _told(question: Question) -> dict[str, Any]:
    return {
        "name": question.name,
        "asks": question.asks,
        "truth": question.truth_told,
        "shots": question.shots,
        "hits": len(question.truth),
        "error": "share" if question.by_share else "wrong",
        "curves": [],
    }


def _curve(curve: Curve) -> dict[str, Any]:
    return {"name": curve.name, "setting": curve.setting, "note": curve.note, "left_out": curve.left_out, "points": []}


def _point(method: Method, question: Question, errors: Errors, cost: Cost, kinds: Sequence[str]) -> dict[str, Any]:
    """A method at one setting: what it decided, and what it cost."""
    shots = max(question.shots, 1)
    us = {name: 1e6 * getattr(cost, name) / shots for name in ("least", "median", "most")}
    return {
        "setting": method.setting,
        "missed": errors.missed,
        "false": errors.false,
        "wrong_per_shot": errors.wrong / shots,
        "share_error": errors.share,
        "position_error_px": errors.position,
        "wrong_per_shot_by_kind": _by_kind(errors.objects, question.aimed, kinds),
        "us_per_shot": us,
        "runs": cost.runs,
        "setup_ms": 1e3 * cost.setup,
        "kept_bytes": cost.kept_bytes,
        "run_bytes": cost.run_bytes,
    }


def _by_kind(wrong: Ints, aimed: Ints | None, kinds: Sequence[str]) -> dict[str, float]:
    """Wrong decisions on objects of a kind, for each shot near one of them."""
    if aimed is None or not len(aimed):
        return {}
    of, count = np.bincount(wrong, minlength=len(kinds)), np.bincount(aimed, minlength=len(kinds))
    rows = {kind: np.array([k == kind for k in kinds]) for kind in dict.fromkeys(kinds)}
    return {kind: float(of[some].sum() / max(count[some].sum(), 1)) for kind, some in rows.items()}


def _versions() -> dict[str, str]:
    """Versions of all that takes part, as far as it is installed."""
    found = {"python": platform.python_version()}
    for name in ("hitplanes", "numpy", "opencv-python-headless", "pymunk", "shapely", "pygame-ce"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
