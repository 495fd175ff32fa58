"""A study, given as JSON, in words and tables: the verdict, the ranks of the books, Markdown and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from weapons.plan import plan_lines

__all__ = [
    "Place",
    "bound",
    "csv_of",
    "front",
    "markdown",
    "markdown_table",
    "places",
    "ranks",
    "setting_text",
    "verdict",
]

Json = Mapping[str, Any]

RANKED = {"circle": "circle", "axis-aligned box": "box, refitted", "bounding box, oriented": "oriented box"}
"""The three that books compare, as the study names them."""

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
    """A point of a diagram: its curve, setting, error, microseconds a shot, the point whole, and the setting's unit."""

    curve: str
    setting: float | str | None
    error: float
    us: float
    point: Json
    unit: str = ""

    @property
    def name(self) -> str:
        """The method, its setting, and the unit of it."""
        if self.setting is None:
            return self.curve
        unit = f" ({self.unit})" if self.unit not in ("", self.curve) and not isinstance(self.setting, str) else ""
        return f"{self.curve} {setting_text(self.setting)}{unit}"


def setting_text(setting: float | str | None) -> str:
    """A setting as one reads it: 1/8, 4, grid."""
    if not isinstance(setting, int | float):
        return setting or ""
    return f"1/{1 / setting:g}" if 0 < setting < 1 and (1 / setting).is_integer() else f"{setting:g}"


def places(question: Json) -> list[Place]:
    """All points of a question whose error is known."""
    key = "share_error" if question["error"] == "share" else "wrong_per_shot"
    return [
        Place(curve["name"], point["setting"], point[key], point["us_per_shot"]["least"], point, curve["setting"])
        for curve in question["curves"]
        for point in curve["points"]
        if point[key] is not None
    ]


def bound(question: Json) -> float:
    """Rate that is not exceeded, with 95 % of confidence, by errors of which none was seen: three in all shots.

    References
    ----------
    Hanley and Lippman-Hand, "If nothing goes wrong, is everything all right?" (1983).
    """
    return 3 / max(int(question["shots"]), 1)


def front(found: Sequence[Place]) -> list[Place]:
    """The Pareto front: places than which none is both as fast and as right, from fast to right."""
    kept: list[Place] = []
    for place in sorted(found, key=lambda p: (p.us, p.error)):
        if not kept or place.error < kept[-1].error:
            kept.append(place)
    return kept


def verdict(study: Json, error: float) -> list[str]:
    """For each question the fastest method whose error is within what is asked for."""
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
        return f"no method has {error:g} {what} or less; the best is {best.name}, {_told(best, question)}"
    best = min(good, key=lambda p: p.us)
    told = f"the fastest with {error:g} {what} or less is {best.name}, {_told(best, question)}"
    if bound(question) > error and question["error"] == "wrong":
        told += f"; {question['shots']} shots cannot tell errors below {bound(question):.2g}"
    return told


def _told(place: Place, question: Json) -> str:
    none = place.error == 0 and question["error"] == "wrong"
    wrong = f"none wrong (under {bound(question):.2g})" if none else f"{place.error:.2g}"
    return f"{place.us:.3g} us a shot, {wrong}"


def ranks(study: Json, error: float) -> list[list[str]]:
    """Circle, axis-aligned and oriented box: which is fast, which accurate, and for what kinds good enough."""
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
    """The whole study as Markdown.

    Parameters
    ----------
    pictures : names of the questions that have a diagram beside it
    """
    return "\n".join(_lines(study, error, pictures)) + "\n"


def _lines(study: Json, error: float, pictures: Sequence[str]) -> Iterator[str]:
    scene, versions = study["scene"], study["versions"]
    yield f"# Error against run time: {scene['name'] or 'a scene'}"
    yield ""
    if not study["complete"]:
        yield "**Not complete: it was interrupted.** What was measured is here."
        yield ""
    part = "" if scene["objects"] == scene["of"] else f" of {scene['of']}"
    kinds = ", ".join(f"{count} {kind}" for kind, count in study["kinds"].items())
    yield f"{scene['objects']}{part} objects ({kinds}), seed {study['seed']}."
    yield f"Versions: {', '.join(f'{name} {number}' for name, number in versions.items())}."
    yield ""
    yield f"## The verdict, for an error of {error:g}"
    yield ""
    yield from (f"- {line}" for line in verdict(study, error))
    yield ""
    yield "Pixels, supercover, swept, every pixel and pellets are what `fire` does; volumes are tested by `overlap`."
    yield ""
    table = ranks(study, error)
    if table:
        yield f"As the books rank them, but measured; good enough means {error:g} wrong decisions a shot or less:"
        yield ""
        yield from markdown_table(["", "fast", "accurate", "good enough for"], table)
    for question in study["questions"]:
        yield from _question(question, question["name"] in pictures)
    for question in study["questions"]:
        yield from _kinds(question)
    yield "## What this scene pays for"
    yield ""
    yield f"{study['plan']['shots']} discs in one call at the scene as it is: what each stage cost, what was left out."
    yield ""
    yield "```text"
    yield from plan_lines(study["plan"])
    yield "```"


def _question(question: Json, picture: bool) -> Iterator[str]:
    yield f"## {question['name'].capitalize()}: {question['asks']}"
    yield ""
    yield f"{question['shots']} shots, {question['hits']} hits in truth. Truth: {question['truth']}."
    yield ""
    if picture:
        yield f"![Error against time: {question['name']}]({question['name']}.png)"
        yield ""
    head = ["method", "setting", "wrong a shot", "missed", "false", "error of share", "of place, px", "us a shot"]
    rows = [_row(curve, point, question) for curve in question["curves"] for point in curve["points"]]
    yield from markdown_table([*head, "median, most", "set-up, ms", "kept", "a run needs"], rows, numbers=True)
    yield "Of place: mean distance from where it truly hit. Us a shot: the least of all runs of a batch, then the"
    yield "median and the most. Kept: what stays between runs; a run needs: the most at once."
    yield ""
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
        _number(point["share_error"], ".4f"), _number(point["position_error_px"], ".3f"), f"{us['least']:.2f}",
        f"{us['median']:.2f}, {us['most']:.2f}", f"{point['setup_ms']:.1f}", _bytes(point["kept_bytes"]),
        _bytes(point["run_bytes"]),
    ]  # fmt: skip


def _kinds(question: Json) -> Iterator[str]:
    """Wrong decisions by kind of shape, of the methods that people choose among."""
    points = {(curve["name"], point["setting"]): point for curve in question["curves"] for point in curve["points"]}
    shown = [(key, points[key]["wrong_per_shot_by_kind"]) for key in SHOWN_BY_KIND if key in points]
    kinds = list(dict.fromkeys(kind for _, by_kind in shown for kind in by_kind))
    if not kinds:
        return
    yield "## Shapes by kind: wrong decisions for each shot near one"
    yield ""
    rows = [
        [f"{name} {setting_text(setting)}".strip(), *(f"{by_kind[kind]:.3f}" for kind in kinds)]
        for (name, setting), by_kind in shown
    ]
    yield from markdown_table(["", *kinds], rows)


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: bool = False) -> Iterator[str]:
    """Lines of a Markdown table, and an empty one; `numbers` are set right, in all columns but the first."""
    yield f"| {' | '.join(head)} |"
    yield "| --- |" + (" ---: |" if numbers else " --- |") * (len(head) - 1)
    yield from (f"| {' | '.join(row)} |" for row in rows)
    yield ""


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _bytes(count: int) -> str:
    """Bytes as one reads them."""
    for unit in ("B", "KB", "MB"):
        if count < 1000 or unit == "MB":
            break
        count = round(count / 1000)
    return f"{count} {unit}"


def csv_of(study: Json) -> str:
    """A row for each point."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for question in study["questions"]:
        for curve in question["curves"]:
            for point in curve["points"]:
                flat = {**point, **{f"us_per_shot_{name}": us for name, us in point["us_per_shot"].items()}}
                own = {"question": question["name"], "method": curve["name"], "shots": question["shots"]}
                writer.writerow([own.get(name, flat.get(name)) for name in COLUMNS])
    return text.getvalue()
