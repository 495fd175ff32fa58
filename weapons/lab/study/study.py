"""Measure the error and the run time of every method on a scene, and write the results as text, tables and diagrams."""

from __future__ import annotations

import csv
import io
import json
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hitplanes.planes.common.checks import InputError, Ints, path_of, printable
from hitplanes.planes.files.png import write_bytes, write_text
from hitplanes.planes.files.scene_folder import cleared, own_folder
from hitplanes.planes.scene.scene import Scene

from ...fire.call import fire
from ...fire.plan import plan_lines
from ...kinds.areas import Disc
from ...replay.stream import Progress
from ..peers import versions
from .methods import Cost, Errors, Method, Question, copied, errors_of, measured
from .questions import discs_at, kind_of, questions_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect

FORMAT = "hitplanes-study/1"
PACKAGES = ("hitplanes", "numpy", "opencv-python-headless", "pymunk", "shapely", "pygame-ce")
Json = Mapping[str, Any]
Show = Callable[[str, int, int], None]  # of the next measurement's name, the number of points done, and of all points
Keep = Callable[[dict[str, Any]], None]  # stores the unfinished study, given as JSON


@dataclass(frozen=True)
class Effort:
    """Size of a study: shots of a question, least runs and seconds of a method, and most objects."""

    shots: int = 4000
    runs: int = 7
    seconds: float = 0.25
    objects: int = 400

    @classmethod
    def quick(cls) -> Effort:
        """Return the effort for a first look."""
        return cls(shots=300, runs=3, seconds=0.0, objects=40)


def run_study(scene: Scene, seed: int, effort: Effort, show: Show, keep: Keep) -> dict[str, Any]:
    """Measure all methods on the hittable objects of a scene; equal seeds give equal decisions.

    `show` is called before each point, `keep` after each point and at the end. Returned is the study as JSON, whose
    `complete` is false until the end.
    """
    ids = scene.ids("hittable")
    ids = ids[scene.items.size_wh[scene.items.table.rows(ids), 0] > 0]
    chosen = ids[np.linspace(0, len(ids) - 1, min(len(ids), effort.objects)).astype(np.int64)]  # evenly
    alone = copied(scene, chosen)
    discs = discs_at(alone, effort.shots, seed)
    questions = questions_of(alone, discs, effort.shots, seed)
    weapon = Disc(discs.radius)
    fire(scene, weapon, discs.at)  # warms up
    plan = fire(scene, weapon, discs.at).plan.timed()
    kinds = [kind_of(alone, item) for item in range(len(alone))]
    study: dict[str, Any] = {
        "format": FORMAT,
        "complete": False,
        "scene": {"name": scene.name, "hash": scene.content_hash(), "objects": len(chosen), "of": len(ids)},
        "seed": seed,
        "versions": {"python": platform.python_version(), **versions(*PACKAGES)},
        "kinds": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
        "plan": {"shots": effort.shots, **plan},
        "questions": [
            {
                "name": q.name, "asks": q.asks, "truth": q.truth_told, "shots": q.shots, "hits": len(q.truth),
                "error": "share" if q.by_share else "wrong", "curves": [],
            }
            for q in questions
        ],
    }  # fmt: skip
    _measure(study, questions, kinds, effort, show, keep)
    study["complete"] = True
    keep(study)
    return study


def _measure(
    study: dict[str, Any], questions: Sequence[Question], kinds: Sequence[str], effort: Effort, show: Show, keep: Keep
) -> None:
    """Add the points of all curves to a study; a setting that meets a limit is left out, with a note."""
    points = sum(len(curve.methods) for question in questions for curve in question.curves)
    done = 0
    for question, record in zip(questions, study["questions"], strict=True):
        for curve in question.curves:
            row: dict[str, Any] = {name: getattr(curve, name) for name in ("name", "setting", "note", "left_out")}
            row["points"] = []
            record["curves"].append(row)
            for method in curve.methods:
                show(f"{question.name}: {curve.name}", done, points)
                done += 1
                try:
                    answer, cost = measured(method, effort.runs, effort.seconds)
                except InputError as error:
                    setting = "" if method.setting is None else f"{row['setting']} {method.setting} is left out: "
                    row["note"] = "; ".join([*filter(None, [row["note"]]), f"{setting}{error}"])
                else:
                    errors = errors_of(method.read(answer), question.truth)
                    row["points"].append(_point(method, question, errors, cost, kinds))
                keep(study)
            if not row["points"] and not row["left_out"]:
                row["left_out"], row["note"] = row["note"], ""


def _point(method: Method, question: Question, errors: Errors, cost: Cost, kinds: Sequence[str]) -> dict[str, Any]:
    """Return the errors and the cost of a method at one setting, as JSON."""
    us = {name: 1e6 * getattr(cost, name) / question.shots for name in ("least", "median", "most")}
    return {
        "setting": method.setting, "missed": errors.missed, "false": errors.false,
        "wrong_per_shot": errors.wrong / question.shots, "share_error": errors.share,
        "position_error_px": errors.position,
        "wrong_per_shot_by_kind": _by_kind(errors.objects, question.aimed, kinds), "us_per_shot": us, "runs": cost.runs,
        "setup_ms": 1e3 * cost.setup, "kept_bytes": cost.kept_bytes, "run_bytes": cost.run_bytes,
    }  # fmt: skip


def _by_kind(wrong: Ints, aimed: Ints | None, kinds: Sequence[str]) -> dict[str, float]:
    """Return wrong decisions per shot near an object, by kind of object, without kinds that no shot is near."""
    if aimed is None or not len(aimed):
        return {}
    names = np.array(kinds)
    count = {kind: (np.count_nonzero(names[wrong] == kind), np.count_nonzero(names[aimed] == kind)) for kind in kinds}
    return {kind: of / near for kind, (of, near) in count.items() if near}


RANKED = {"circle": "circle", "axis-aligned box": "box, refitted", "bounding box, oriented": "oriented box"}
"""The three volumes that textbooks rank, and the names of their curves."""

SHOWN_BY_KIND = (
    ("pixel planes", 1), ("circle", None), ("circle about the pivot", None), ("box, re-boxed", None),
    ("box, refitted", None), ("oriented box", None), ("boxes", 4), ("boxes", 16), ("boxes", 64), ("hull", None),
    ("polygon", 2.0), ("triangles", 2.0),
)  # fmt: skip

COLUMNS = (
    "question", "method", "setting", "shots", "missed", "false", "wrong_per_shot", "share_error", "position_error_px",
    "us_per_shot_least", "us_per_shot_median", "us_per_shot_most", "runs", "setup_ms", "kept_bytes", "run_bytes",
)  # fmt: skip


class Place(NamedTuple):
    """A point of a diagram: curve, setting, error, microseconds per shot, its JSON, and the unit of the setting."""

    curve: str
    setting: float | str | None
    error: float
    us: float
    point: Json
    unit: str = ""

    @property
    def name(self) -> str:
        """Name of the method with its setting and unit."""
        if self.setting is None:
            return self.curve
        unit = f" ({self.unit})" if self.unit not in ("", self.curve) and not isinstance(self.setting, str) else ""
        return f"{self.curve} {setting_text(self.setting)}{unit}"


def setting_text(setting: float | str | None) -> str:
    """Return the text of a setting, such as 1/8, 4 or grid."""
    if not isinstance(setting, int | float):
        return setting or ""
    return f"1/{1 / setting:g}" if 0 < setting < 1 and (1 / setting).is_integer() else f"{setting:g}"


def places(question: Json) -> list[Place]:
    """Return all points of a question whose error is known."""
    key = "share_error" if question["error"] == "share" else "wrong_per_shot"
    return [
        Place(curve["name"], point["setting"], point[key], point["us_per_shot"]["least"], point, curve["setting"])
        for curve in question["curves"]
        for point in curve["points"]
        if point[key] is not None
    ]


def bound(question: Json) -> float:
    """Return the upper bound (95 % confidence) of the error rate when no shot was wrong (Hanley, Lippman-Hand 1983)."""
    return 3 / max(int(question["shots"]), 1)


def front(found: Sequence[Place]) -> list[Place]:
    """Return the Pareto front, from fast to accurate: no other place is both faster and more accurate."""
    kept: list[Place] = []
    for place in sorted(found, key=lambda p: (p.us, p.error)):
        if not kept or place.error < kept[-1].error:
            kept.append(place)
    return kept


def verdict(study: Json, error: float) -> list[str]:
    """Return a line for each question, which names the fastest method with at most this error."""
    return [f"{question['name']}: {_verdict(question, error)}" for question in study["questions"]]


def _verdict(question: Json, error: float) -> str:
    found = places(question)
    if not question["hits"]:
        return "no shot hits anything in truth, so it tells nothing"
    what = "of the share" if question["error"] == "share" else "wrong decisions a shot"
    good = [place for place in found if place.error <= error]
    if not found:
        return "nothing was measured"
    if not good:
        best = min(found, key=lambda p: (p.error, p.us))
        return f"no method has {error:g} {what} or less; the best is {best.name}, {_result(best, question)}"
    best = min(good, key=lambda p: p.us)
    text = f"the fastest with {error:g} {what} or less is {best.name}, {_result(best, question)}"
    if bound(question) > error and question["error"] == "wrong":
        text += f"; {question['shots']} shots cannot tell errors below {bound(question):.2g}"
    return text


def _result(place: Place, question: Json) -> str:
    none = place.error == 0 and question["error"] == "wrong"
    wrong = f"none wrong (under {bound(question):.2g})" if none else f"{place.error:.2g}"
    return f"{place.us:.3g} us a shot, {wrong}"


def ranks(study: Json, error: float) -> list[list[str]]:
    """Rank circle, axis-aligned box and oriented box by speed and accuracy; list the kinds each is good enough for."""
    found = {p.curve: p for q in study["questions"] if q["name"] == "areas" for p in places(q)}
    rows = [(name, found[curve]) for name, curve in RANKED.items() if curve in found]
    speed = sorted((place.us, name) for name, place in rows)
    right = sorted((place.error, name) for name, place in rows)
    table = []
    for name, place in rows:
        by_kind = place.point["wrong_per_shot_by_kind"]
        good = [kind for kind, wrong in by_kind.items() if wrong <= error]
        least = min(by_kind, key=lambda kind: by_kind[kind], default="")
        enough = ", ".join(good) or (f"nothing; nearest: {least}, {by_kind[least]:.2g}" if least else "nothing")
        fast, accurate = 1 + speed.index((place.us, name)), 1 + right.index((place.error, name))
        table.append([name, f"{fast} ({place.us:.2g} us)", f"{accurate} ({place.error:.2g} wrong)", enough])
    return table


def markdown(study: Json, error: float, pictures: Sequence[str] = ()) -> str:
    """Return the whole study as Markdown; `pictures` are the names of the questions that have a diagram."""
    return "\n".join(_lines(study, error, pictures)) + "\n"


def _lines(study: Json, error: float, pictures: Sequence[str]) -> Iterator[str]:
    scene = study["scene"]
    part = "" if scene["objects"] == scene["of"] else f" of {scene['of']}"
    kinds = ", ".join(f"{count} {kind}" for kind, count in study["kinds"].items())
    late = "" if study["complete"] else "**Not complete: it was interrupted.** What was measured is here.\n\n"
    yield f"""# Error against run time: {printable(scene["name"]) or "a scene"}

{late}{scene["objects"]}{part} objects ({kinds}), seed {study["seed"]}.
Versions: {", ".join(f"{name} {number}" for name, number in study["versions"].items())}.

## The verdict, for an error of {error:g}
"""
    yield from (f"- {line}" for line in verdict(study, error))
    yield """
Pixels, supercover, swept, every pixel and pellets are what `fire` does; volumes are tested by `overlap`.
"""
    if table := ranks(study, error):
        yield f"""\
Textbooks rank three volumes: the simpler one is faster, the tighter one more accurate. The table has their ranks as
measured here: 1 is the fastest, or the most accurate. The last column names the kinds of shapes for which the volume
makes {error:g} wrong decisions a shot or fewer.
"""
        yield from markdown_table(["", "fast", "accurate", "good enough for"], table)
    for question in study["questions"]:
        yield from _question(question, question["name"] in pictures)
    for question in study["questions"]:
        yield from _kinds(question)
    yield f"""## What this scene pays for

{study["plan"]["shots"]} discs in one call at the scene as it is: what each stage cost, what was left out.

```text"""
    yield from plan_lines(study["plan"])
    yield "```"


def _question(question: Json, picture: bool) -> Iterator[str]:
    yield f"""## {question["name"].capitalize()}: {question["asks"]}

{question["shots"]} shots, {question["hits"]} hits in truth. Truth: {question["truth"]}.
"""
    if picture:
        yield f"![Error against time: {question['name']}]({question['name']}.png)\n"
    head = ["method", "setting", "wrong a shot", "missed", "false", "error of share", "of place, px", "us a shot"]
    rows = [_row(curve, point, question) for curve in question["curves"] for point in curve["points"]]
    yield from markdown_table([*head, "median, most", "set-up, ms", "kept", "a run needs"], rows, numbers=True)
    yield """Of place: mean distance from where it truly hit. Us a shot: the least of all runs of a batch, then the
median and the most. Kept: what stays between runs; a run needs: the most at once.
"""
    for curve in question["curves"]:
        if curve["left_out"] or curve["note"]:
            yield f"- {curve['name']}: {'left out: ' + curve['left_out'] if curve['left_out'] else curve['note']}"
    yield ""


def _row(curve: Json, point: Json, question: Json) -> list[str]:
    us = point["us_per_shot"]
    wrong = f"{point['wrong_per_shot']:.4f}" if point["wrong_per_shot"] else f"0 (< {bound(question):.2g})"
    unit = f" {curve['setting']}" if isinstance(point["setting"], int | float) else ""
    return [
        curve["name"], setting_text(point["setting"]) + unit, wrong, str(point["missed"]), str(point["false"]),
        *("" if point[name] is None else format(point[name], form)
          for name, form in (("share_error", ".4f"), ("position_error_px", ".3f"))), f"{us['least']:.2f}",
        f"{us['median']:.2f}, {us['most']:.2f}", f"{point['setup_ms']:.1f}", _bytes(point["kept_bytes"]),
        _bytes(point["run_bytes"]),
    ]  # fmt: skip


def _kinds(question: Json) -> Iterator[str]:
    """Yield the table of wrong decisions by kind of shape, for the common methods."""
    points = {(curve["name"], point["setting"]): point for curve in question["curves"] for point in curve["points"]}
    shown = [(key, points[key]["wrong_per_shot_by_kind"]) for key in SHOWN_BY_KIND if key in points]
    kinds = list(dict.fromkeys(kind for _, by_kind in shown for kind in by_kind))
    if not kinds:
        return
    yield "## Shapes by kind: wrong decisions for each shot near one\n"
    rows = [
        [f"{name} {setting_text(setting)}".strip(), *(f"{by_kind[kind]:.3f}" for kind in kinds)]
        for (name, setting), by_kind in shown
    ]
    yield from markdown_table(["", *kinds], rows)


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: bool = False) -> Iterator[str]:
    """Yield the lines of a Markdown table and an empty line; `numbers` aligns all columns but the first right."""
    yield f"| {' | '.join(head)} |"
    yield "| --- |" + (" ---: |" if numbers else " --- |") * (len(head) - 1)
    yield from (f"| {' | '.join(row)} |" for row in rows)
    yield ""


def _bytes(count: int) -> str:
    """Return a number of bytes as text."""
    units = ["MB", "KB", "B"]
    while count >= 1000 and len(units) > 1:
        count, _ = round(count / 1000), units.pop()
    return f"{count} {units[-1]}"


def csv_of(study: Json) -> str:
    """Return the study as CSV, with a row for each point."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for question in study["questions"]:
        for curve in question["curves"]:
            for point in curve["points"]:
                us = {f"us_per_shot_{name}": us for name, us in point["us_per_shot"].items()}
                own = {"question": question["name"], "method": curve["name"], "shots": question["shots"]}
                writer.writerow({**point, **us, **own})
    return text.getvalue()


NO_DIAGRAMS = "the diagrams are left out: matplotlib is not installed (pip install 'hitplanes[study]')"
QUESTIONS = ("areas", "rays", "movers", "spread")
FILES = ("study.json", "study.csv", "study.md", *(f"{name}.png" for name in QUESTIONS))


def write_study(
    scene: Scene, folder: Path, seed: int, effort: Effort, error: float, progress: Progress
) -> tuple[dict[str, Any], list[str]]:
    """Run a study and write it to a new folder or that of an earlier study; an interrupt writes what was measured.

    Returned are the study as JSON, and the names of the questions that have a diagram.
    """
    folder = path_of("output", folder)
    made = own_folder(folder, FILES)
    kept: dict[str, Any] = {}

    def keep(study: dict[str, Any]) -> None:
        if not kept:  # the first point replaces an earlier study
            cleared(folder, FILES)
        kept.update(study)
        write_text(folder / FILES[0], json.dumps(study, indent=1) + "\n")

    try:
        run_study(scene, seed, effort, progress.step, keep)
    except KeyboardInterrupt:
        progress.clear()
        if not kept:
            if made:
                folder.rmdir()
            raise
        _write_tables(kept, folder, error)
        raise KeyboardInterrupt(f"what was measured is in {folder}") from None
    progress.clear()
    return kept, _write_tables(kept, folder, error)


def _write_tables(study: Mapping[str, Any], folder: Path, error: float) -> list[str]:
    """Write the tables and, if matplotlib is installed, the diagrams; return the names of the diagrams."""
    drawn: list[str] = []
    write_text(folder / FILES[1], csv_of(study))
    write_text(folder / FILES[2], markdown(study, error))
    if find_spec("matplotlib") is None:
        return drawn
    for question in filter(places, study["questions"]):
        try:
            save_figure(work_precision(question, study["scene"]["name"]), folder / f"{question['name']}.png")
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"what was measured is in {folder}; only diagrams are missing") from None
        drawn.append(question["name"])
        write_text(folder / FILES[2], markdown(study, error, drawn))
    return drawn


# Work-precision diagrams (error against time, a curve for each method), drawn with matplotlib if it is installed

DPI = 160  # a picture of 11 inches is 1760 px wide, and readable when shown at 1000
INK, FAINT, PAPER, HATCH = "#1d2733", "#66707c", "#ffffff", "#cfd5db"
LOOK: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "font.size": 9, "axes.edgecolor": FAINT, "axes.labelcolor": INK, "text.color": INK,
    "xtick.color": INK, "ytick.color": INK, "hatch.color": HATCH, "hatch.linewidth": 0.8, "savefig.facecolor": PAPER,
}  # fmt: skip
"""Style of all diagrams."""


@contextmanager
def looking_alike() -> Iterator[None]:
    """Apply the common style in the block, whatever the user's settings are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(LOOK)
        yield


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG; equal figures give equal bytes."""
    data = io.BytesIO()
    with looking_alike():
        figure.savefig(data, format="png", dpi=DPI, metadata={"Software": None})
    write_bytes(path, data.getvalue())


SIZE = (11.0, 7.2)  # of a diagram, inches
DECADES = 30  # least ratio of the ends of the time axis to the data
CLOSE = 1.12  # points whose times are within this ratio share a label
BLACK, ORANGE, SKY, GREEN, BLUE, RED, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
"""Colours that the colour-blind can tell apart: Okabe and Ito, "Color universal design" (2008)."""
Style = tuple[str, str]  # colour and mark of a curve
STYLES: dict[str, Style] = {
    "pixel planes": (BLUE, "o"), "pixels, pre-filter": (SKY, "D"), "pixels, broad phase": (SKY, "s"),
    "circle": (PURPLE, "o"), "circle about the pivot": (PURPLE, "P"), "box, re-boxed": (ORANGE, "X"),
    "box, refitted": (ORANGE, "s"), "oriented box": (RED, "D"), "boxes": (ORANGE, "v"), "convex polygon": (GREEN, "^"),
    "hull": (GREEN, "*"), "polygon": (GREEN, "p"), "triangles": (RED, "<"), "pymunk": (BLACK, "P"),
    "shapely": (BLACK, "X"), "pygame": (BLACK, "*"),
}  # fmt: skip
OTHERS = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (RED, "D"), (PURPLE, "v"), (SKY, "<"))  # for other methods, in turn


def work_precision(question: Mapping[str, Any], title: str) -> Figure:
    """Draw a question of a study, given as JSON.

    Points without an error lie on a separate floor, below all others and below one wrong decision in all shots, which
    is labelled with the bound for this number of shots. The Pareto front goes through the points for which no other is
    both faster and more accurate.
    """
    from matplotlib.figure import Figure

    found, wrong, least = places(question), question["error"] == "wrong", bound(question)
    errors = [place.error for place in found if place.error > 0]
    floor = min([*errors, 1 / max(question["shots"], 1)] if wrong else errors or [1.0]) / 3
    others = iter(OTHERS * len(question["curves"]))
    with looking_alike():
        figure = Figure(figsize=SIZE, layout="constrained")
        plot = figure.add_subplot()
        x, y = zip(*[(place.us, place.error or floor) for place in front(found)], strict=True)
        label = "Pareto front: none is faster and less wrong"
        plot.plot(x, y, color="#c3c9d0", linewidth=7, alpha=0.8, drawstyle="steps-post", label=label, zorder=1)
        for curve in question["curves"]:
            own = [place for place in found if place.curve == curve["name"]]
            if own:
                _draw_curve(plot, own, curve["setting"], STYLES.get(curve["name"]) or next(others), floor)
        _write_words(plot, found, floor)
        _draw_axes(plot, question)
        if wrong:  # the smallest error rate that this number of shots can show
            text = f"3/n = {least:.2g}"
            _draw_level(plot, least, (6, 3), 0.8, text, (1.0, 3, 0), va="center", fontsize=7.5, color=FAINT)
        if any(place.error == 0 for place in found):
            plot.set_ylim(bottom=floor / 1.8)
            text = f"none wrong in {question['shots']} shots: the rate is likely under 3/n" if wrong else "no error"
            _draw_level(plot, floor, (2, 3), 1, text, (0.01, 0, -11), fontsize=8, color=INK)
        plot.set_title(f"{title}\n{question['asks']}", loc="left", weight="bold", size=11)
        figure.legend(loc="outside right upper", frameon=False, fontsize=9, title="method", alignment="left")
    return figure


def _draw_axes(plot: Axes, question: Mapping[str, Any]) -> None:
    """Set the scales, the labels with their units, and the grid."""
    shares, wrong = "error of the share hit, mean", "wrong decisions a shot (missed and false hits)"
    time = "time a shot, microseconds (least of all runs); better is lower, and farther left"
    plot.set(xscale="log", yscale="log", xlabel=time, ylabel=shares if question["error"] == "share" else wrong)
    plot.grid(which="major", color="#dde2e7", linewidth=0.8)
    plot.set_axisbelow(True)
    plot.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    plot.xaxis.set_minor_formatter("")
    least, most = plot.get_xlim()
    plot.set_xlim(min(least, most / DECADES), max(most, least * DECADES))


def _draw_curve(plot: Axes, own: Sequence[Place], setting: str, style: Style, floor: float) -> None:
    """Draw a curve with its settings beside the points; points whose settings are words are not joined."""
    x, y = [place.us for place in own], [place.error or floor for place in own]
    joined = all(isinstance(place.setting, int | float) for place in own)
    color, mark = style
    label = own[0].curve + (f" ({setting})" if joined and setting not in ("", own[0].curve) else "")
    plot.plot(
        x, y, linestyle="-" if joined else "", color=color, marker=mark, label=label,
        markersize=10 if mark in "PX*" else 7.5, markeredgecolor="white", markeredgewidth=0.7, linewidth=1.4,
        clip_on=False, zorder=3,
    )  # fmt: skip
    for place, left, low in zip(own, x, y, strict=True):
        if joined and place.setting is not None:
            plot.annotate(setting_text(place.setting), (left, low), (5, 3), textcoords="offset points",
                          fontsize=7.5, color=color, path_effects=_halo(), zorder=4)  # fmt: skip


def _halo() -> list[AbstractPathEffect]:
    """Return an outline in the colour of the paper, which keeps text readable on lines."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2, foreground=PAPER)]


def _write_words(plot: Axes, found: Sequence[Place], floor: float) -> None:
    """Write settings that are words vertically; points close together share a label."""
    words = sorted(
        (place.us, place.error or floor, str(place.setting)) for place in found if isinstance(place.setting, str)
    )
    near: list[tuple[float, float, str]] = []
    for x, y, word in [*words, (float("inf"), 0.0, "")]:
        if near and (x > near[0][0] * CLOSE or y != near[0][1]):
            text = ", ".join(dict.fromkeys(word for _, _, word in near))
            plot.annotate(text, near[0][:2], (0, 8), textcoords="offset points", fontsize=7.5, rotation=90, color=INK,
                          ha="center", va="bottom", path_effects=_halo(), zorder=4)  # fmt: skip
            near = []
        near.append((x, y, word))


def _draw_level(
    plot: Axes, y: float, dashes: tuple[int, int], width: float, text: str, at: tuple[float, int, int], **how: Any
) -> None:
    """Draw a level line, and a text at a part of its length, moved by a number of points."""
    plot.axhline(y, color=FAINT, linewidth=width, linestyle=(0, dashes), zorder=0)
    plot.annotate(text, (at[0], y), at[1:], xycoords=("axes fraction", "data"), textcoords="offset points", **how)
