"""Error against run time on a scene of the user's own: every method asked, measured, and kept as it goes."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from planes.arrays import InputError, Ints
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

SPREAD_PART = 5
"""Blasts of thousands of pellets take long: so many times fewer of them than other shots."""

Show = Callable[[str, int, int], None]
"""Told what is measured next, how many points are done, and of how many."""

Keep = Callable[[dict[str, Any]], None]
"""Given the study as JSON, as far as it is."""


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


def run_study(scene: Scene, seed: int, effort: Effort, show: Show, keep: Keep) -> dict[str, Any]:
    """Measure all methods on the objects of a scene that can be hit.

    Parameters
    ----------
    seed : of the shots; the same seed gives the same decisions, and other times
    show : told how far it is
    keep : given the study after each point, and when it is whole

    Returns
    -------
    the study as JSON; `complete` is false in what was kept before its end
    """
    ids = scene.ids("hittable")
    ids = ids[scene.items.size_wh[ids, 0] > 0]
    some = _spread_over(ids, effort.objects)
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
    _measure(study, questions, kinds, effort, show, keep)
    study["complete"] = True
    keep(study)
    return study


def _spread_over(ids: Ints, most: int) -> Ints:
    """At most so many of some ids, evenly from the first to the last."""
    return ids[np.linspace(0, len(ids) - 1, most).astype(np.int64)] if len(ids) > most else ids


def _measure(
    study: dict[str, Any], questions: Sequence[Question], kinds: Sequence[str], effort: Effort, show: Show, keep: Keep
) -> None:
    """Add the points of all curves to a study; a setting at which a method meets a limit is left out with a word."""
    points = sum(len(curve.methods) for question in questions for curve in question.curves)
    done = 0
    for question, told in zip(questions, study["questions"], strict=True):
        for curve in question.curves:
            row = _curve(curve)
            told["curves"].append(row)
            for method in curve.methods:
                show(f"{question.name}: {curve.name}", done, points)
                done += 1
                try:
                    answer, cost = measured(method, effort.runs, effort.seconds)
                except InputError as error:
                    _leave_out(row, method, error)
                else:
                    errors = errors_of(method.read(answer), question.truth)
                    row["points"].append(_point(method, question, errors, cost, kinds))
                keep(study)
            if not row["points"] and not row["left_out"]:
                row["left_out"], row["note"] = row["note"], ""


def _leave_out(row: dict[str, Any], method: Method, error: InputError) -> None:
    """Tell in a curve's note at which setting a limit was met."""
    setting = "" if method.setting is None else f"{row['setting']} {method.setting} is left out: "
    row["note"] = "; ".join([*filter(None, [row["note"]]), f"{setting}{error}"])


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
    """Wrong decisions on objects of a kind, for each shot near one of them; not of kinds that no shot is near."""
    if aimed is None or not len(aimed):
        return {}
    of, count = np.bincount(wrong, minlength=len(kinds)), np.bincount(aimed, minlength=len(kinds))
    rows = {kind: np.array([k == kind for k in kinds]) for kind in dict.fromkeys(kinds)}
    return {kind: float(of[some].sum() / count[some].sum()) for kind, some in rows.items() if count[some].any()}


def _versions() -> dict[str, str]:
    """Versions of all that takes part, as far as it is installed."""
    found = {"python": platform.python_version()}
    for name in ("hitplanes", "numpy", "opencv-python-headless", "pymunk", "shapely", "pygame-ce"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
