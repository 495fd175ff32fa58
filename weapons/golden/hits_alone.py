"""Goldens of hits alone: what they keep of a report, how much may differ, and the differences as lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hitplanes.planes.common.checks import InputError, choice, integer
from hitplanes.planes.common.limits import POSITION_MAX

from ..report.differences import BATCH_COLUMNS, differences

HITS = "hits"  # the only part that may be asked for alone

HOW = ("shot", "weapon", "at", "aim", "seed", "accept", "blocked_by", "exclude")
"""Keys of a shot that say how it was fired; they are kept to be read, and not compared."""

WHAT = ("object", "name", "round", "samples", "pixels", "weight", "pellets", "first_xy", "distance2", "runs")
"""Keys of a row that are kept; the others depend on what lies near."""

Entry = Mapping[str, Any]


@dataclass(frozen=True)
class Tolerance:
    """How much the rows of hits may differ.

    Parameters
    ----------
    pixels : most pixels by which the number of hit pixels of an object may differ
    px : farthest that the first hit pixel of an object may move, px
    """

    pixels: int = 0
    px: int = 0

    def __bool__(self) -> bool:
        return bool(self.pixels or self.px)

    def exceeded(self, was: Entry, now: Entry) -> list[str]:
        """What exceeds it in two rows of one object, and by how much; empty if nothing does."""
        count = abs(now["pixels"] - was["pixels"])
        far2 = sum((to - at) ** 2 for to, at in zip(now["first_xy"], was["first_xy"], strict=True))
        told = [f"{count} px more or less, tolerance_pixels={self.pixels}"] if count > self.pixels else []
        return told + ([f"first hit {far2**0.5:.1f} px away, tolerance_px={self.px}"] if far2 > self.px**2 else [])


EXACT = Tolerance()  # no difference is tolerated


def tolerance_of(only: object, tolerance_pixels: object, tolerance_px: object) -> Tolerance:
    """Check what is asked of a golden beside its name and planes."""
    if only is not None:
        choice("only", only, (HITS,))
    given = {"tolerance_pixels": tolerance_pixels, "tolerance_px": tolerance_px}
    pixels, px = (integer(name, value, 0, 2 * POSITION_MAX) for name, value in given.items())
    if only is None and (pixels or px):
        name = "tolerance_pixels" if pixels else "tolerance_px"
        raise InputError(f"{name}: expected together with only={HITS!r}, got {pixels or px} for a whole golden")
    return Tolerance(pixels, px)


def hits_alone(report: Entry) -> dict[str, Any]:
    """The part of a report that a golden of hits alone keeps: how each shot was fired, and its rows."""
    shots = [
        {key: shot[key] for key in HOW if key in shot}
        | {"rows": [{key: row[key] for key in WHAT if key in row} for row in shot["rows"]]}
        for shot in report["shots"]
    ]
    batch = report["batch"] and {
        "shots": report["batch"]["shots"],
        "objects": [{key: entry[key] for key in ("object", "name")} for entry in report["batch"]["objects"]],
        "rows": report["batch"]["rows"],
    }
    return {"weapons": report["weapons"], "shots": shots, "batch": batch}


def hits_unlike(expected: Entry, got: Entry, tolerance: Tolerance) -> list[str]:
    """Lines about the hits of two kept parts that differ by more than a tolerance.

    How the shots were fired is not compared, nor the order of the rows of a shot. An object that is newly hit, or no
    longer, differs whatever the tolerance. With a tolerance the numbers of pixels and the first pixels are compared;
    samples, weights and pellets follow from them.
    """
    was, now = _rows(expected), _rows(got)
    exceeded: list[str] = []
    for shot in range(min(len(was), len(now)) if tolerance else 0):
        after_of = {_key(row): row for row in now[shot]}
        for place, before in enumerate(was[shot]):
            after = after_of.get(_key(before), before)
            told = tolerance.exceeded(before, after)
            exceeded += [f"shot {shot}: object {after['object']}: {line}" for line in told]
            was[shot][place] = before if told or _key(before) not in after_of else after
    parts = expected, got
    alike = got if len(was) == len(now) else expected
    objects = {entry["object"]: entry for part in parts for entry in (part["batch"] or {"objects": ()})["objects"]}
    before, after = (
        _compared(part, how, rows, [objects[item] for item in sorted(objects)])
        for part, how, rows in zip(parts, (alike, got), (was, now), strict=True)
    )
    return differences(before, after) + exceeded


def _rows(part: Entry) -> list[list[Entry]]:
    """Rows of each shot, sorted by object and round; those of a batch in the form of the others."""
    rows: list[list[Entry]] = [list(shot["rows"]) for shot in part["shots"]]
    if part["batch"]:
        rows = [[] for _ in range(part["batch"]["shots"])]
        for row in part["batch"]["rows"]:
            columns = dict(zip(BATCH_COLUMNS, row, strict=True))
            rows[row[0]].append({**columns, "first_xy": [columns["x"], columns["y"]]})
    return [sorted(own, key=_key) for own in rows]


def _key(row: Entry) -> tuple[int, int]:
    return row["object"], row["round"]


def _compared(part: Entry, how: Entry, rows: list[list[Entry]], objects: list[Entry]) -> dict[str, Any]:
    """A report of these rows, as `differences` reads it: shots are told as in `how`, and objects of a batch named."""
    if part["batch"]:
        listed = [[row[column] for column in BATCH_COLUMNS] for own in rows for row in own]
        return {"batch": {"shots": len(rows), "objects": objects, "rows": listed}, "shots": []}
    hows = [{key: shot.get(key) for key in ("weapon", "at", "aim")} for shot in how["shots"]]
    return {"batch": None, "shots": [{**told, "rows": own} for told, own in zip(hows, rows, strict=True)]}


def reports_of_hits(whole: Entry, expected: Entry, got: Entry) -> list[dict[str, Any]]:
    """Two reports that show the expected hits and those got, and no other samples, on the scene as it is.

    Parameters
    ----------
    whole : the report of the hits got
    expected, got : kept parts

    Returns
    -------
    the two reports; none if there is a batch, or not the same number of shots
    """
    if not whole["shots"] or len(expected["shots"]) != len(whole["shots"]):
        return []
    reports = []
    for part in (expected, got):
        own = [shot["rows"] for shot in part["shots"]]
        runs = [{"hit": [run for row in rows for run in row["runs"]]} for rows in own]
        shots = zip(whole["shots"], own, runs, strict=True)
        reports.append({**whole, "shots": [{**shot, "rows": rows, "samples": hit} for shot, rows, hit in shots]})
    return reports
