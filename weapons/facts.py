"""Hits to report JSON: what was fired, what each sample met, what was hit and what was not, and why."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from planes.arrays import InputError, Ints, listed
from planes.constants import ALL, SUB, VIEW_MAX
from planes.grid256 import pixel
from planes.items import Role
from planes.sampling import OF_PATTERNS, Verdict
from planes.scene import Scene
from planes.schema import Text
from planes.spans import Box, Spans
from weapons.arsenal import parts_of
from weapons.heat import heat_of
from weapons.hits import HitRow, Hits
from weapons.rayfacts import item_told, ray_boxes, rays_told
from weapons.rayhits import RayHits
from weapons.thennow import present_of
from weapons.volley import Volley, volley_of

if TYPE_CHECKING:
    from weapons.sieve import Sieve

__all__ = ["FORMAT", "SHOTS_MAX", "report_of"]

FORMAT = "hitplanes-report/1"

SHOTS_MAX = 24
"""More shots than these are told as a batch: the page would be longer than one reads."""

PLACEMENTS_AT_A_TIME = 2**16

NEAR_OUTSIDE = 48
"""How far beyond the bounds samples are shown, px."""


def report_of(
    scene: Scene,
    fired: Sequence[Hits],
    names: Sequence[str] | None = None,
    *,
    now: Scene | None = None,
    prefilter: str | None = None,
    broadphase: str | None = None,
) -> dict[str, Any]:
    """Tell, as JSON, all that a picture of shots needs.

    Up to 24 shots are told one by one, with their samples as runs [y, x_first, x_last] by verdict, each pixel once
    under its strongest verdict; more are told as a batch.

    Parameters
    ----------
    scene : what was fired on
    fired : answers of `fire` on it, of one shot or of many
    names : of their weapons; by default the kinds
    now : the present, beside which shots at the past are shown: what has moved since, and what they would hit
    prefilter, broadphase : what the picture shows of the way to the hits: the volumes of a pre-filter ("circle",
        "4 boxes", ...), the cells of a broad phase ("grid", "quadtree", "bvh"), and how many objects were tested

    Raises
    ------
    InputError
        If hits are of another scene, or of another version of it, or are told under one name with different weapons.
    """
    fired = _checked(scene, fired)
    called = _weapon_names(fired, names)
    shots = sum(len(hits.shots) for hits in fired)
    each = [(hits, name, row) for hits, name in zip(fired, called, strict=True) for row in range(len(hits.shots))]
    told = [_shot(scene, *one) for one in each] if shots <= SHOTS_MAX else []
    view = view_of(scene, fired)
    sieve = None
    if prefilter is not None or broadphase is not None:
        from weapons.sieve import sieve_of  # few reports need it

        sieve = sieve_of(scene, view, prefilter, broadphase)
    return {
        "format": FORMAT,
        "version": version("hitplanes"),
        "scene": {
            "name": scene.name,
            "hash": scene.content_hash(),
            "version": scene.version,
            "bounds_xyxy": None if scene.bounds is None else list(scene.bounds),
            "hittable": len(scene.ids(Role.HITTABLE)),
            "occluders": len(scene.ids(Role.OCCLUDER)),
        },
        "view_xyxy": list(view),
        "weapons": {name: hits.weapon.to_json() for name, hits in zip(called, fired, strict=True)},
        "shots": told,
        "batch": None if shots <= SHOTS_MAX else _batch(scene, fired, view),
        **({} if sieve is None else {"filter": _sifted(sieve, fired, each if told else [], told)}),
        **({} if now is None else {"now": present_of(scene, now, fired, view)}),
    }


def _sifted(
    sieve: Sieve, fired: Sequence[Hits], each: Sequence[tuple[Hits, str, int]], told: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """Tell what each shot was compared with, and what the pre-filter is."""
    for (hits, _, row), shot in zip(each, told, strict=True):
        shot["tested"] = sieve.told(hits, row)
    opened = [np.zeros(0, np.int64), *(sieve.opened(hits) for hits in fired)]
    return sieve.to_dict(np.unique(np.concatenate(opened)))


def view_of(scene: Scene, fired: Sequence[Hits]) -> Box:
    """Box of the world that a picture shows: the scene, and samples a little outside of it."""
    x, y, x_max, y_max = scene.extent()
    reach = np.concatenate([np.zeros((0, 4), np.int64), *(_boxes(hits) for hits in fired)])
    if not len(reach):
        return x, y, min(x_max, x + VIEW_MAX), min(y_max, y + VIEW_MAX)
    low, high = reach[:, :2].min(axis=0).tolist(), reach[:, 2:].max(axis=0).tolist()
    middle = np.concatenate([_anchors(hits) for hits in fired])
    over = VIEW_MAX // 4 if scene.bounds is None else NEAR_OUTSIDE
    (x, x_max), (y, y_max) = (
        _shown(*side, over)
        for side in (
            (x, x_max, low[0], high[0], *_ends(middle[:, 0])),
            (y, y_max, low[1], high[1], *_ends(middle[:, 1])),
        )
    )
    return x, y, x_max, y_max


def _anchors(hits: Hits) -> Ints:
    """Pixel (N, 2) of each shot that should be seen: of its first hit, or its own."""
    at = pixel(hits.shots.at_256)
    some = hits.starts[:-1] < hits.starts[1:]
    at[some] = hits.first_xy[hits.starts[:-1][some]]
    return at


def _ends(values: Ints) -> tuple[int, int]:
    return int(values.min()), int(values.max())


def _shown(first: int, last: int, low: int, high: int, at_low: int, at_high: int, over: int) -> tuple[int, int]:
    """What is shown of one side of the world: all and a little more, or what the samples reach, or around the shots."""
    if last - first < VIEW_MAX:
        return max(min(first, low - 2), first - over), min(max(last, high + 2), last + over)
    if high - low >= VIEW_MAX - VIEW_MAX // 4:
        low, high = at_low, at_high
    begin = min(max(first, low - VIEW_MAX // 8), last - VIEW_MAX // 4)
    return begin, min(last, max(high + VIEW_MAX // 8, begin + VIEW_MAX // 4), begin + VIEW_MAX)


def _boxes(hits: Hits) -> Ints:
    """Box (n, 4) around the samples of each part of a batch that has any."""
    if isinstance(hits, RayHits):
        around = ray_boxes(hits)
        return np.array([] if around is None else [around], np.int64).reshape(-1, 4)
    found = []
    for volley in _volleys(hits):
        boxes = volley.boxes
        boxes = boxes[boxes[:, 0] <= boxes[:, 2]]
        if len(boxes):
            found.append(np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)]))
    return np.array(found, np.int64).reshape(-1, 4)


def _volleys(hits: Hits) -> Iterator[Volley]:
    """A batch as volleys of not too many placements."""
    burst, spread, _ = parts_of(hits.weapon)
    step = max(1, PLACEMENTS_AT_A_TIME // ((burst.count if burst else 1) * (spread.count if spread else 1)))
    for first in range(0, len(hits.shots), step):
        yield volley_of(hits.weapon, hits.shots.take(first, first + step))


def _checked(scene: Scene, fired: object) -> list[Hits]:
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a Scene, got {type(scene).__name__}")
    Text().check("scene.name", scene.name)
    if isinstance(fired, Hits):
        raise InputError("fired: expected a list of Hits, got Hits alone")
    told: list[Hits] = listed("fired", fired, "a list of Hits")
    for row, hits in enumerate(told):
        if not isinstance(hits, Hits):
            raise InputError(f"fired[{row}]: expected Hits, got {type(hits).__name__}")
        if not hits.one_scene:
            raise InputError(f"fired[{row}]: expected shots at one tick, got several: fire them at history.at(tick)")
        if hits.scene is not scene or hits.version != scene.version:
            got = f"version {hits.version}" if hits.scene is scene else f"hits of {hits.scene.name!r}"
            raise InputError(f"fired[{row}]: expected {scene.name!r} at version {scene.version}, got {got}: fire again")
    return told


def _weapon_names(fired: Sequence[Hits], names: Sequence[str] | None) -> list[str]:
    """Name of each weapon; equal weapons share one, others of the same kind are numbered."""
    if names is not None:
        if len(names) != len(fired):
            raise InputError(f"names: expected {len(fired)}, one for each hits, got {len(names)}")
        names = [Text().check(f"names[{i}]", name) for i, name in enumerate(names)]
        known: dict[str, Any] = {}
        for name, hits in zip(names, fired, strict=True):
            if known.setdefault(name, hits.weapon) != hits.weapon:
                raise InputError(f"names: expected one weapon for each name, got two for {name!r}")
        return list(names)
    given: dict[Any, str] = {}
    for hits in fired:
        same = sum(weapon.kind == hits.weapon.kind for weapon in given)
        given.setdefault(hits.weapon, f"{hits.weapon.kind} {same + 1}" if same else hits.weapon.kind)
    return [given[hits.weapon] for hits in fired]


def _shot(scene: Scene, hits: Hits, weapon: str, row: int) -> dict[str, Any]:
    shots = hits.shots
    accept = int(shots.accept[row])
    owners = [owner for owner in shots.exclude[row].tolist() if owner >= 0]
    margins = _margins(hits, row)
    return {
        "shot": int(shots.number[row]),
        "weapon": weapon,
        "at": (shots.at_256[row] / SUB).tolist(),
        "at_xy": pixel(shots.at_256[row]).tolist(),
        "aim": _degrees(hits, row),
        "seed": int(shots.seed[row]),
        "accept": None if accept == ALL else scene.category_names(accept),
        "exclude": [{"owner": owner, "name": _name(scene, owner)} for owner in owners],
        "verdicts": hits.verdict_counts(row),
        "rows": _rows(scene, hits, row, margins),
        "why_not": _why_not(scene, hits, row, margins),
        "blockers": [
            {
                **item_told(scene, entry.occluder),
                "samples": entry.samples,
                "blocked": [
                    {**item_told(scene, b.object), "samples": b.samples, "at_xy": list(b.at_xy)} for b in entry.behind
                ],
            }
            for entry in hits.blockers(row)
        ],
        "samples": _sample_runs(hits, row),
        "plan": hits.plan.to_dict(),
        **(rays_told(scene, hits, row) if isinstance(hits, RayHits) else {}),
    }


def _why_not(scene: Scene, hits: Hits, shot: int, margins: Mapping[int, dict[str, Any]]) -> list[dict[str, Any]]:
    """Objects near a shot that it did not hit, as JSON."""
    return [
        {
            **item_told(scene, entry.object),
            "reason": entry.reason,
            "samples": entry.samples,
            "by": [{**item_told(scene, item), "samples": n} for item, n in entry.by.items()],
            "distance": round(entry.distance, 3),
            **margins.get(entry.object, {}),
        }
        for entry in hits.why_not(shot)
    ]


def _margins(hits: Hits, shot: int) -> dict[int, dict[str, Any]]:
    """How far the verdict on each object is from flipping, if that is near and can be told."""
    if not hits.has_margins:
        return {}
    return {
        m.object: {"margin": {"distance": round(m.distance, 3), "shift_xy": [round(v, 3) for v in m.shift_xy]}}
        for m in hits.margins(shot)
    }


def _rows(scene: Scene, hits: Hits, shot: int, margins: Mapping[int, dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a shot; those of rays have no shares."""
    pixels, rows = hits.pixels_at(shot), hits.of(shot)
    shares = [None] * len(rows) if isinstance(hits, RayHits) else hits.shares(shot)
    return [
        {
            **item_told(scene, row.object),
            "round": row.round,
            "samples": row.samples,
            "pixels": row.pixels,
            "weight": row.weight,
            "pellets": row.pellets,
            "first_xy": list(row.first_xy),
            "distance2": row.distance2,
            **({} if share is None else {"shares": {k: round(value, 6) for k, value in share._asdict().items()}}),
            **margins.get(row.object, {}),
            "runs": pixels[row.round, row.object].runs().tolist(),
        }
        for row, share in zip(rows, shares, strict=True)
    ]


def _sample_runs(hits: Hits, row: int) -> dict[str, list[list[int]]]:
    """Runs of the pixels of each verdict that occurs; every pellet sees a pixel alike."""
    samples = hits.samples_at(row)
    runs = {}
    for verdict in Verdict:
        xy = samples.xy[samples.verdict == verdict]
        if len(xy):
            runs[verdict.name.lower()] = Spans.from_runs(xy[:, 1], xy[:, 0], xy[:, 0]).runs().tolist()
    return runs


def _batch(scene: Scene, fired: Sequence[Hits], view: Box) -> dict[str, Any]:
    """Many shots: totals, each object's share of them, every row, and the heat of each pixel of the view."""
    first = np.cumsum([0, *(len(hits.shots) for hits in fired)]).tolist()
    rows = [[row.shot + begin, *_flat(row)] for begin, hits in zip(first, fired, strict=False) for row in hits]
    verdicts = np.zeros(len(Verdict), np.int64)
    for hits in fired:
        verdicts[: hits.verdicts.shape[1]] += hits.verdicts.sum(axis=0)
    known = Verdict if any(isinstance(hits, RayHits) for hits in fired) else OF_PATTERNS
    return {
        "shots": first[-1],
        "shots_that_hit": len({row[0] for row in rows}),
        "verdicts": {verdict.name.lower(): int(verdicts[verdict]) for verdict in known},
        "objects": _objects(scene, rows),
        "columns": [*(name for name in HitRow._fields if name not in ("first_xy", "distance2")), "x", "y", "distance2"],
        "rows": rows,
        "heat": heat_of(fired, view),
        "plan": _distinct([hits.plan.to_dict() for hits in fired]),
    }


def _distinct(plans: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Plans that differ."""
    return list({json.dumps(plan): plan for plan in plans}.values())


def _objects(scene: Scene, rows: list[list[int]]) -> list[dict[str, Any]]:
    """Objects hit, by the number of shots that hit them, then by pixels and id."""
    shots: dict[int, set[int]] = {}
    pixels: dict[int, int] = {}
    weight: dict[int, int] = {}
    for shot, _, item, _, count, heft, *_ in rows:
        shots.setdefault(item, set()).add(shot)
        pixels[item] = pixels.get(item, 0) + count
        weight[item] = weight.get(item, 0) + heft
    order = sorted(shots, key=lambda item: (-len(shots[item]), -pixels[item], item))
    return [
        {**item_told(scene, item), "shots": len(shots[item]), "pixels": pixels[item], "weight": weight[item]}
        for item in order
    ]


def _flat(row: HitRow) -> list[int]:
    return [row.round, row.object, row.samples, row.pixels, row.weight, row.pellets, *row.first_xy, row.distance2]


def _name(scene: Scene, item: int) -> str:
    """Name of an object; an owner may be one that the scene never had."""
    return scene.name_of(item) if item < scene.items.count else f"id {item}"


def _degrees(hits: Hits, row: int) -> float | None:
    """Aim of a shot whose weapon has one, to a millionth of a degree."""
    if not isinstance(hits, RayHits) and not parts_of(hits.weapon)[2].directed:
        return None
    c, s = hits.shots.direction[row].tolist()
    return round(math.degrees(math.atan2(s, c)), 6) + 0.0
