"""The file of a report: the table that validates it, and its reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hitplanes.planes.bits.span_walk import OF_PATTERNS, Verdict
from hitplanes.planes.common.checks import InputError, path_of, within
from hitplanes.planes.common.limits import (
    IDS_MAX,
    MARGIN_PX,
    POSITION_MAX,
    REACH_MAX,
    SEED_MAX,
    STRUCTURES,
    TICK_MAX,
    VIEW_MAX,
)
from hitplanes.planes.common.tables import (
    Const,
    Flag,
    Keys,
    Mapped,
    Names,
    Number,
    Numbers,
    Optional,
    Rows,
    Text,
    Value,
    Whole,
    Wholes,
    Within,
    Word,
    json_of,
)
from hitplanes.planes.files.png import read_text

from ..explain.samples import REASONS
from ..rays.contacts import Reason
from ..replay.shot_log import WeaponJson
from ..report.report import FORMAT

FARTHEST = POSITION_MAX + 2 * REACH_MAX  # largest coordinate of a pixel of a pattern, px

COUNT = Whole(0, 2**62)
PIXEL = Wholes((2,), -FARTHEST, FARTHEST)
BOX = Wholes((4,), -FARTHEST, FARTHEST)
RUNS = Wholes((None, 3), -FARTHEST, FARTHEST)
SHARE = Number(0, 1)
ITEM: dict[str, Value] = {"object": Whole(0, IDS_MAX - 1), "name": Text()}
VERDICTS = {verdict.name.lower(): COUNT for verdict in Verdict}
COUNTS = Within(Keys(dict(VERDICTS), tuple(verdict.name.lower() for verdict in OF_PATTERNS)))
STAGE: dict[str, Value] = {"stage": Text(), "why": Text()}


def _all(keys: dict[str, Value], **more: Value) -> Within:
    """Return the form of an object in which every key is required, and more are allowed."""
    return Within(Keys({**keys, **more}, tuple(keys)))


RAN = Keys({**STAGE, "bytes": COUNT, "pairs": Wholes((2,), 0, 2**62)}, ("stage", "why", "bytes"))
PLAN = _all({"ran": Rows(Within(RAN)), "left_out": Rows(_all(STAGE))})
SHARES = _all({"of_pattern": SHARE, "of_visible": SHARE, "of_mask": SHARE}, exposed=SHARE)
MARGIN = _all({"distance": Number(0, MARGIN_PX), "shift_xy": Numbers((2,), MARGIN_PX)})
ROW = _all({
    **ITEM, "round": COUNT, "samples": COUNT, "pixels": COUNT, "weight": COUNT, "pellets": COUNT, "first_xy": PIXEL,
    "distance2": COUNT, "runs": RUNS,
}, shares=SHARES, margin=MARGIN)  # fmt: skip
WHY_NOT = _all({
    **ITEM, "reason": Word(REASONS), "samples": COUNT, "by": Rows(_all({**ITEM, "samples": COUNT})),
    "distance": Number(0),
}, margin=MARGIN)  # fmt: skip
POINT = Numbers((2,), FARTHEST)
NORMAL = Wholes((2,), -(2**10), 2**10)
PASS = _all({
    **ITEM, "order": COUNT, "entry_xy": PIXEL, "exit_xy": PIXEL,
    **dict.fromkeys(("entry_px", "exit_px", "material"), Number(0)),
    **dict.fromkeys(("entry", "exit"), Number(0, 1)), "point": POINT, "normal": NORMAL, "weight": COUNT,
})  # fmt: skip
STOP = _all({
    "reason": Word(tuple(reason.name.lower() for reason in Reason)), "item": Optional(_all(ITEM)),
    "cell_xy": PIXEL, "point": POINT, "distance": Number(0), "fraction": Number(0, 1), "normal": NORMAL,
})  # fmt: skip
RAY = _all({"round": COUNT, "pellet": COUNT, "start": POINT, "end": POINT, "stop": STOP, "passes": Rows(PASS)})
MISS = _all({**ITEM, "distance": Number(0), "ray_xy": POINT, "object_xy": POINT})
TESTED = _all({
    "objects": Wholes((None,), 0, IDS_MAX - 1), "of": COUNT, "opened": COUNT,
    "patterns": Rows(_all({"points": Numbers((None, 2), FARTHEST)})),
})  # fmt: skip
BLOCKED = _all({**ITEM, "samples": COUNT, "at_xy": PIXEL})
SHOT = _all({
    "shot": Whole(0, 2**63 - 1), "weapon": Text(), "at": Numbers((2,), POSITION_MAX), "at_xy": PIXEL,
    "aim": Optional(Number(-180, 180)), "seed": Whole(0, SEED_MAX), "accept": Optional(Names()),
    "blocked_by": Optional(Names()), "exclude": Rows(_all({"owner": COUNT, "name": Text()})),
    "verdicts": COUNTS, "rows": Rows(ROW), "why_not": Rows(WHY_NOT),
    "blockers": Rows(_all({**ITEM, "samples": COUNT, "blocked": Rows(BLOCKED)})),
    "samples": Within(Keys(dict.fromkeys(VERDICTS, RUNS))), "plan": PLAN,
}, radius=Number(0, REACH_MAX), rays=Rows(RAY), nearest_miss=Optional(MISS), tested=TESTED, sheltered=RUNS)  # fmt: skip
CELL = _all({"box_xyxy": Numbers((4,), FARTHEST), "opened": Flag()})
FILTER = _all({"prefilter": Text(), "broadphase": Word(tuple(STRUCTURES)), "cells": Rows(CELL)})
HEAT = _all({
    "cell": Whole(1, VIEW_MAX), "origin_xy": PIXEL, "beyond": COUNT,
    "counts": Within(Keys(dict.fromkeys(VERDICTS, Wholes((None, 4), 0, 2**62)))),
})  # fmt: skip
BATCH = _all({
    "shots": COUNT, "shots_that_hit": COUNT, "verdicts": COUNTS,
    "objects": Rows(_all({**ITEM, "shots": COUNT, "pixels": COUNT, "weight": COUNT})), "columns": Names(),
    "rows": Wholes((None, 10), -FARTHEST, 2**62), "heat": HEAT, "plan": Rows(PLAN),
})  # fmt: skip
SCENE = _all({
    "name": Text(), "hash": Text(), "version": COUNT, "bounds_xyxy": Optional(BOX), "hittable": COUNT,
    "occluders": COUNT,
})  # fmt: skip
KEYS: dict[str, Value] = {
    "format": Const(FORMAT), "version": Text(), "scene": SCENE, "view_xyxy": BOX,
    "weapons": Mapped(WeaponJson("weapon")), "shots": Rows(SHOT), "batch": Optional(BATCH),
}  # fmt: skip
NOW = _all({
    "tick": Optional(Number(-TICK_MAX, TICK_MAX)), "hash": Text(),
    "moved": Rows(_all({**ITEM, "runs": RUNS, "from_xy": POINT, "to_xy": POINT})),
    "gone": Rows(_all(ITEM)), "new": Rows(_all(ITEM)),
    "shots": Rows(Optional(Rows(_all({**ITEM, "pixels": COUNT})))),
})  # fmt: skip
REPORT = Keys({**KEYS, "filter": FILTER, "now": NOW}, tuple(KEYS))  # table that validates a report


def read_report(path: Path) -> dict[str, Any]:
    """Read and validate a report; an InputError names the file, the row and the field."""
    path = path_of("report", path)
    with within(str(path)):
        found = json_of(read_text(path))
        REPORT.check("report", found)
        for verdict, runs in (found["batch"] or {"heat": {"counts": {}}})["heat"]["counts"].items():
            if any(run[3] < 1 for run in runs):
                raise InputError(f"batch: heat: counts: {verdict}: expected counts from 1, got 0")
        x, y, x_max, y_max = found["view_xyxy"]
        if not (0 <= x_max - x <= 2 * VIEW_MAX and 0 <= y_max - y <= 2 * VIEW_MAX):
            raise InputError(f"view_xyxy: expected a box of at most {2 * VIEW_MAX} px a side, got {found['view_xyxy']}")
        return dict(found)
