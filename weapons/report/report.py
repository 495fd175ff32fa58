"""Report JSON of hits: what was fired, the verdicts of all samples, what was hit, and why the rest was not."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from itertools import chain, count, islice
from typing import Any

import numpy as np

from hitplanes.planes.bits.span_walk import OF_PATTERNS, Verdict
from hitplanes.planes.common.checks import InputError, Ints, kind_of, listed
from hitplanes.planes.common.limits import ALL, CHUNK_SAMPLES, SUB, VIEW_MAX
from hitplanes.planes.common.tables import Text
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.grid.spans import Box, Spans, meets
from hitplanes.planes.scene.history import PastScene
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from ..explain.samples import detail_of
from ..fire.call import fired as fire_checked
from ..fire.hits import BEFORE, Hits
from ..fire.spans import context_of
from ..kinds.areas import is_directed, parts_of, ray_parts_of
from ..kinds.placements import placements_for, placements_of
from ..kinds.weapon import Weapon
from ..rays.contacts import Reason, rays_of
from ..rays.ray_hits import Passes, RayHits, Stops
from .differences import BATCH_COLUMNS

CELLS_MAX = 2**18  # most cells of a heat map; in larger views a cell is 2 x 2, 4 x 4, ... pixels


def heat_of(fired: Sequence[Hits], view_xyxy: Box) -> dict[str, Any]:
    """Count the samples of all shots in a view, as JSON with these keys.

    - "cell": side of a cell, px
    - "origin_xy": pixel of cell (0, 0)
    - "beyond": number of samples out of view
    - "counts": for each verdict that occurs, runs [row, column_first, column_last, samples] of cells
    """
    x, y, x_max, y_max = view_xyxy
    cell = 1
    while -(-(x_max - x + 1) // cell) * -(-(y_max - y + 1) // cell) > CELLS_MAX:
        cell *= 2
    width, height = (x_max - x) // cell + 1, (y_max - y) // cell + 1
    counts, beyond = np.zeros((len(OF_PATTERNS), height * width), np.int64), 0
    for xy, verdict in _parts(fired):
        seen = (xy >= (x, y)).all(axis=1) & (xy <= (x_max, y_max)).all(axis=1)
        column, row = ((xy[seen] - (x, y)) // cell).T
        np.add.at(counts.reshape(-1), (verdict[seen] * height + row) * width + column, 1)
        beyond += int((~seen).sum())
    runs = {v.name.lower(): _runs(counts[v].reshape(height, width)) for v in OF_PATTERNS if counts[v].any()}
    return {"cell": cell, "origin_xy": [x, y], "beyond": beyond, "counts": runs}


def _parts(fired: Sequence[Hits]) -> Iterator[tuple[Ints, Ints]]:
    """Pixels (n, 2) and verdicts of all samples, in chunks of shots."""
    for hits in fired:
        if isinstance(hits, RayHits):
            for shot in range(len(hits.shots)):
                cells = hits.samples_at(shot)
                walked = cells.verdict != Verdict.BEYOND
                yield cells.xy[walked], cells.verdict[walked]
            continue
        step = max(1, CHUNK_SAMPLES // max(int(hits.fired.max(initial=1)), 1))
        context = context_of(hits.scene, hits.scene.items.stack(), hits.weapon, hits.shots)
        for first in range(0, len(hits.shots), step):
            detail = detail_of(context, hits.weapon, hits.shots.take(first, first + step))
            yield np.stack([detail.x, detail.runs.y[detail.run]], axis=1), detail.verdict


def _runs(counts: Ints) -> list[list[int]]:
    """Runs of equal counts, without those of 0, in the rows of a plane."""
    height, width = counts.shape
    flat = counts.reshape(-1)
    changed = np.flatnonzero(np.diff(flat, prepend=-1) != 0)
    first = np.union1d(changed, np.arange(height) * width)
    last = np.append(first[1:], len(flat)) - 1
    kept = flat[first] > 0
    first, last = first[kept], last[kept]
    runs: list[list[int]] = np.stack([first // width, first % width, last % width, flat[first]], axis=1).tolist()
    return runs


PASS_COLUMNS = (
    "order", "entry_xy", "exit_xy", "entry_px", "exit_px", "entry", "exit", "point_xy", "material", "normal_xy",
    "weight",
)  # fmt: skip
"""Columns of a pass through an object that a report tells."""


def rays_json(scene: Scene, hits: RayHits, row: int) -> dict[str, Any]:
    """Rays of one shot as JSON, with its nearest miss."""
    parts = ray_parts_of(hits.weapon)
    assert parts is not None  # its hits are those of rays
    rays = rays_of(parts, hits.shots.take(row, row + 1))
    stops, passes, miss = hits.stops_at(row), hits.passes_at(row), hits.nearest_miss(row)
    numbers = passes.round * (parts[1].count if parts[1] else 1) + passes.pellet
    of = np.searchsorted(numbers, np.arange(len(rays) + 1)).tolist()
    entries = [
        {
            "round": int(rays.round[i]),
            "pellet": int(rays.pellet[i]),
            "start": (rays.start_256[i] / SUB).tolist(),
            "end": ((rays.start_256[i] + rays.step_256[i]) / SUB).tolist(),
            "stop": _stop(scene, stops, i),
            "passes": [
                {**item_json(scene, int(passes.object[k])), **_columns(passes, PASS_COLUMNS, k)}
                for k in range(of[i], of[i + 1])
            ],
        }
        for i in range(len(rays))
    ]
    near = miss and {
        **item_json(scene, miss.object),
        "distance": miss.distance, "ray_xy": list(miss.ray_xy), "object_xy": list(miss.object_xy),
    }  # fmt: skip
    return {"radius": parts[2].radius_256 / SUB, "rays": entries, "nearest_miss": near}


def item_json(scene: Scene, item: int) -> dict[str, Any]:
    """Id and name of an item, as JSON."""
    return {"object": item, "name": scene.name_of(item)}


def _stop(scene: Scene, stops: Stops, i: int) -> dict[str, Any]:
    item = int(stops.item[i])
    return {
        "reason": Reason(int(stops.reason[i])).name.lower(),
        "item": None if item < 0 else item_json(scene, item),
        **_columns(stops, ("cell_xy", "point_xy", "distance", "fraction", "normal_xy"), i),
    }


def _columns(table: Stops | Passes, columns: Sequence[str], row: int) -> dict[str, Any]:
    """Columns of one row of a table, as JSON; those of points and normals lose their "_xy"."""
    names = {"point_xy": "point", "normal_xy": "normal"}
    return {names.get(column, column): getattr(table, column)[row].tolist() for column in columns}


MOVED_MAX = 200  # most moved objects in a report; a picture with more is too full to read


def present_of(then: Scene, now: Scene, fired: Sequence[Hits], view_xyxy: Box) -> dict[str, Any]:
    """Differences between a scene of the past, which was fired at, and the present, as JSON.

    Only items that were or are in a box are listed. The keys are

    - "tick" of the past scene, and "hash" of the present one
    - "moved": items with their present pixels as runs, and the middles of their boxes
    - "gone", "new": items
    - "shots": what each shot hits now; null if it would start in an item and its weapon forbids that
    """
    if not isinstance(now, Scene):
        raise InputError(f"now: expected a Scene, got {kind_of(now)}")
    was, is_now = (set(scene.items.stack().ids.tolist()) for scene in (then, now))
    return {
        "tick": then.tick if isinstance(then, PastScene) else None,
        "hash": now.content_hash(),
        "moved": list(islice(_moved(then, now, sorted(was & is_now), np.array(view_xyxy)), MOVED_MAX)),
        "gone": [item_json(then, item) for item in sorted(was - is_now)],
        "new": [item_json(now, item) for item in sorted(is_now - was)],
        "shots": [_again(now, hits, shot) for hits in fired for shot in range(len(hits.shots))],
    }


def _moved(then: Scene, now: Scene, items: Sequence[int], view_xyxy: Ints) -> Iterator[dict[str, Any]]:
    """Items, as JSON, that lie elsewhere or look different now, and were or are in a box."""
    before, after = then.items.stack(), now.items.stack()
    for item in items:
        rank, place = (int(stack.ranks(np.array(item))) for stack in (before, after))
        old, new = before.box_xyxy[rank], after.box_xyxy[place]
        mask, corner = now.mask(item)
        same = np.array_equal(old, new) and np.array_equal(before.mask(rank), mask)
        if not same and meets(view_xyxy, np.stack([old, new])).any():
            from_xy, to_xy = (((box[:2] + box[2:]) / 2).tolist() for box in (old, new))
            runs = Spans.from_mask(mask, corner).runs().tolist()
            yield {**item_json(now, item), "runs": runs, "from_xy": from_xy, "to_xy": to_xy}


def _again(now: Scene, hits: Hits, shot: int) -> list[dict[str, Any]] | None:
    """Objects that a shot hits now; None if it would start in an item and its weapon forbids that."""
    try:
        found = fire_checked(now, hits.weapon, hits.shots.take(shot, shot + 1))
    except InputError:
        return None
    return [{**item_json(now, row.object), "pixels": row.pixels} for row in found]


FORMAT = "hitplanes-report/1"
SHOTS_MAX = 24  # most shots that are listed one by one; more are summed up as a batch
PLACEMENTS_AT_A_TIME = 2**16
NO_BOXES: Ints = np.zeros((0, 4), np.int64)
NEAR_OUTSIDE = 48  # width of the strip beyond the bounds in which samples are shown, px


def report_of(
    scene: Scene, fired: Sequence[Hits], names: Sequence[str | None] | None = None, *,
    now: Scene | None = None, prefilter: str | None = None, broadphase: str | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Report of shots as JSON, with all that its picture needs.

    Up to 24 shots are listed one by one, with their samples as runs [y, x_first, x_last] by verdict, each pixel once
    under its strongest verdict. More shots are summed up as a batch.

    Parameters
    ----------
    scene : the scene that was fired at
    fired : answers of `fire` on it, each of one shot or of many
    names : names of the weapons; by default, and where they are None, their kinds
    now : the present scene, to show what has moved since the shots, and what they would hit now
    prefilter, broadphase : the pre-filter ("circle", "4 boxes", ...) whose volumes, and the broad phase ("grid",
        "quadtree", "bvh") whose cells the picture shows, with the number of objects tested

    Raises
    ------
    InputError
        If hits are of another scene, or of another version of it, or if two different weapons have one name.
    """
    fired = _checked(scene, fired)
    called, view = _weapon_names(fired, names), view_of(scene, fired)
    few, named = sum(len(hits.shots) for hits in fired) <= SHOTS_MAX, list(zip(called, fired, strict=True))
    entries = [_shot(scene, hits, name, row) for name, hits in named if few for row in range(len(hits.shots))]
    more: dict[str, Any] = {}
    if prefilter is not None or broadphase is not None:
        from .prefilter_trace import prefilter_trace  # few reports need it

        trace = prefilter_trace(scene, view, prefilter, broadphase)
        more["filter"] = trace.add_tests(fired, entries)
    if now is not None:
        more["now"] = present_of(scene, now, fired, view)
    weapons, batch = {name: hits.weapon.to_json() for name, hits in named}, None if few else _batch(scene, fired, view)
    return {**_head(scene, view), "weapons": weapons, "shots": entries, "batch": batch, **more}


def _head(scene: Scene, view: Box) -> dict[str, Any]:
    """What a report says of its scene and of itself, as JSON."""
    about = {
        "name": scene.name,
        "hash": scene.content_hash(),
        "version": scene.version,
        "bounds_xyxy": None if scene.bounds is None else list(scene.bounds),
        "hittable": len(scene.ids(Role.HITTABLE)),
        "occluders": len(scene.ids(Role.OCCLUDER)),
    }
    return {"format": FORMAT, "version": version("hitplanes"), "scene": about, "view_xyxy": list(view)}


def view_of(scene: Scene, fired: Sequence[Hits]) -> Box:
    """Box of the world that a picture shows: the scene, and samples near it."""
    x, y, x_max, y_max = scene.extent()
    reach = np.concatenate([NO_BOXES, *(_boxes(hits) for hits in fired)])
    if not len(reach):
        return x, y, min(x_max, x + VIEW_MAX), min(y_max, y + VIEW_MAX)
    low, high = reach[:, :2].min(axis=0).tolist(), reach[:, 2:].max(axis=0).tolist()
    middle = np.concatenate([_anchors(hits) for hits in fired])
    over = VIEW_MAX // 4 if scene.bounds is None else NEAR_OUTSIDE
    at_low, at_high = middle.min(axis=0).tolist(), middle.max(axis=0).tolist()
    x, x_max = _shown(x, x_max, low[0], high[0], at_low[0], at_high[0], over)
    y, y_max = _shown(y, y_max, low[1], high[1], at_low[1], at_high[1], over)
    return x, y, x_max, y_max


def _anchors(hits: Hits) -> Ints:
    """Pixel (N, 2) of each shot that the picture should show: that of its first hit, or its own."""
    at = pixel(hits.shots.at_256)
    hitting = hits.starts[:-1] < hits.starts[1:]
    at[hitting] = hits.first_xy[hits.starts[:-1][hitting]]
    return at


def _shown(first: int, last: int, low: int, high: int, at_low: int, at_high: int, over: int) -> tuple[int, int]:
    """Range of one axis that is shown: the whole world and a little more, or the reach of the samples, or the shots."""
    if last - first < VIEW_MAX:
        return max(min(first, low - 2), first - over), min(max(last, high + 2), last + over)
    if high - low >= VIEW_MAX - VIEW_MAX // 4:
        low, high = at_low, at_high
    begin = min(max(first, low - VIEW_MAX // 8), last - VIEW_MAX // 4)
    return begin, min(last, max(high + VIEW_MAX // 8, begin + VIEW_MAX // 4), begin + VIEW_MAX)


def _boxes(hits: Hits) -> Ints:
    """Boxes (n, 4) around the samples of each part of a batch that has samples."""
    if isinstance(hits, RayHits):
        ends = np.concatenate([pixel(hits.shots.at_256), hits.stop.cell_xy])  # rays, from starts to stops
        return np.concatenate([ends.min(axis=0), ends.max(axis=0)])[None] if len(hits.stop) else NO_BOXES
    found = []
    step = max(1, PLACEMENTS_AT_A_TIME // placements_of(hits.weapon))
    for first in range(0, len(hits.shots), step):
        boxes = placements_for(hits.weapon, hits.shots.take(first, first + step)).boxes
        boxes = boxes[boxes[:, 0] <= boxes[:, 2]]
        if len(boxes):
            found.append(np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)]))
    return np.array(found, np.int64).reshape(-1, 4)


def _checked(scene: Scene, fired: object) -> list[Hits]:
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a Scene, got {kind_of(scene)}")
    Text().check("scene.name", scene.name)
    if isinstance(fired, Hits):
        raise InputError("fired: expected a list of Hits, got Hits alone")
    batches: list[Hits] = listed("fired", fired, "a list of Hits")
    for row, hits in enumerate(batches):
        if not isinstance(hits, Hits):
            raise InputError(f"fired[{row}]: expected Hits, got {kind_of(hits)}")
        if not hits.one_scene:
            raise InputError(f"fired[{row}]: expected shots at one tick, got several: fire them at history.at(tick)")
        if hits.scene is not scene:
            moment = " moment of it: pass the scene that they were fired at, history.at(tick)"
            another = "another" + (moment if hits.scene.latest is scene.latest else "")
            raise InputError(f"fired[{row}]: expected hits of the scene {scene.name!r}, got those of {another}")
        if hits.version != scene.version:
            got = f"version {hits.version}: {BEFORE}"
            raise InputError(f"fired[{row}]: expected {scene.name!r} at version {scene.version}, got {got}")
    return batches


def _weapon_names(fired: Sequence[Hits], names: Sequence[str | None] | None) -> list[str]:
    """Name of each weapon; equal weapons without a name share one, others of the same kind are numbered."""
    given = [None] * len(fired) if names is None else listed("names", names, "a list of names")
    if len(given) != len(fired):
        raise InputError(f"names: expected {len(fired)}, one for each hits, got {len(given)}")
    known: dict[str, Weapon] = {}
    for i, (name, hits) in enumerate(zip(given, fired, strict=True)):
        if name is not None and known.setdefault(Text().check(f"names[{i}]", name), hits.weapon) != hits.weapon:
            raise InputError(f"names: expected one weapon for each name, got two for {name!r}")
    called = {weapon: name for name, weapon in reversed(known.items())}  # the first of several names
    for hits in fired:
        if hits.weapon not in called:
            kind = hits.weapon.kind
            numbered = chain([kind], (f"{kind} {number}" for number in count(2)))
            called[hits.weapon] = next(name for name in numbered if name not in known)
            known[called[hits.weapon]] = hits.weapon
    return [called[hits.weapon] if name is None else name for name, hits in zip(given, fired, strict=True)]


def _shot(scene: Scene, hits: Hits, weapon: str, row: int) -> dict[str, Any]:
    shots = hits.shots
    accept, blocked_by = int(shots.accept[row]), int(shots.blocked_by[row])
    owners = [owner for owner in shots.exclude[row].tolist() if owner >= 0]
    margins, samples = _margins(hits, row), hits.samples_at(row)
    of_verdict = {verdict: samples.xy[samples.verdict == verdict] for verdict in Verdict}
    cosine, sine = shots.direction[row].tolist()
    sight = not isinstance(hits, RayHits) and parts_of(hits.weapon)[2].line_of_sight is not None
    return {
        "shot": int(shots.number[row]),
        "weapon": weapon,
        "at": (shots.at_256[row] / SUB).tolist(),
        "at_xy": pixel(shots.at_256[row]).tolist(),
        "aim": round(math.degrees(math.atan2(sine, cosine)), 6) + 0.0 if is_directed(hits.weapon) else None,
        "seed": int(shots.seed[row]),
        "accept": None if accept == ALL else scene.category_names(accept),
        "blocked_by": None if blocked_by == ALL else scene.category_names(blocked_by),
        "exclude": [  # a scene of the past need not have an owner yet; an id of a file may have no name
            {"owner": owner, "name": scene.latest.name_of(owner) or f"id {owner}"} for owner in owners
        ],
        "verdicts": hits.verdict_counts(row),
        "rows": _rows(scene, hits, row, margins),
        "why_not": _why_not(scene, hits, row, margins),
        "blockers": [
            {
                **item_json(scene, entry.occluder),
                "samples": entry.samples,
                "blocked": [
                    {**item_json(scene, b.object), "samples": b.samples, "at_xy": list(b.at_xy)} for b in entry.behind
                ],
            }
            for entry in hits.blockers(row)
        ],
        "samples": {verdict.name.lower(): _runs_of(xy) for verdict, xy in of_verdict.items() if len(xy)},
        **({"sheltered": _runs_of(samples.xy[samples.sheltered])} if sight else {}),
        "plan": hits.plan.to_dict(),
        **(rays_json(scene, hits, row) if isinstance(hits, RayHits) else {}),
    }


def _why_not(scene: Scene, hits: Hits, shot: int, margins: Mapping[int, dict[str, Any]]) -> list[dict[str, Any]]:
    """Objects near a shot that it did not hit, as JSON."""
    return [
        {
            **item_json(scene, entry.object),
            **entry._asdict(),
            "by": [{**item_json(scene, item), "samples": n} for item, n in entry.by.items()],
            "distance": round(entry.distance, 3),
            **margins.get(entry.object, {}),
        }
        for entry in hits.why_not(shot)
    ]


def _margins(hits: Hits, shot: int) -> dict[int, dict[str, Any]]:
    """Margins of one shot by object, as JSON; empty if the shot has none."""
    if not hits.has_margins:
        return {}
    return {
        m.object: {"margin": {"distance": round(m.distance, 3), "shift_xy": [round(v, 3) for v in m.shift_xy]}}
        for m in hits.margins(shot)
    }


def _rows(scene: Scene, hits: Hits, shot: int, margins: Mapping[int, dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a shot, as JSON; rows of rays have no shares."""
    pixels, rows = hits.pixels_at(shot), hits.of(shot)
    shares = [None] * len(rows) if isinstance(hits, RayHits) else hits.shares(shot)
    entries = []
    for row, share in zip(rows, shares, strict=True):
        columns = {name: value for name, value in row._asdict().items() if name not in ("shot", "object")}
        entry = {**item_json(scene, row.object), **columns, "first_xy": list(row.first_xy)}
        if share is not None:
            entry["shares"] = {name: round(part, 6) for name, part in share._asdict().items() if part is not None}
        runs = pixels[row.round, row.object].runs().tolist()
        entries.append({**entry, **margins.get(row.object, {}), "runs": runs})
    return entries


def _runs_of(xy: Ints) -> list[list[int]]:
    """Runs [y, x_first, x_last] of pixels (n, 2), each once."""
    x, y = xy.T
    runs: list[list[int]] = Spans.from_runs(y, x, x).runs().tolist()
    return runs


def _batch(scene: Scene, fired: Sequence[Hits], view: Box) -> dict[str, Any]:
    """Batch of shots as JSON: totals, objects, all rows, and the heat map of the view."""
    first = np.cumsum([0, *(len(hits.shots) for hits in fired)]).tolist()
    rows = [
        [row.shot + begin, *row[1:-2], *row.first_xy, row.distance2]
        for begin, hits in zip(first, fired, strict=False)
        for row in hits
    ]
    verdicts = np.zeros(len(Verdict), np.int64)
    for hits in fired:
        verdicts[: hits.verdicts.shape[1]] += hits.verdicts.sum(axis=0)
    known = Verdict if any(isinstance(hits, RayHits) for hits in fired) else OF_PATTERNS
    return {
        "shots": first[-1],
        "shots_that_hit": len({row[0] for row in rows}),
        "verdicts": {verdict.name.lower(): int(verdicts[verdict]) for verdict in known},
        "objects": _objects(scene, rows),
        "columns": list(BATCH_COLUMNS),
        "rows": rows,
        "heat": heat_of(fired, view),
        "plan": list({json.dumps(plan): plan for plan in (hits.plan.to_dict() for hits in fired)}.values()),
    }


def _objects(scene: Scene, rows: list[list[int]]) -> list[dict[str, Any]]:
    """Objects that were hit, sorted by the number of shots that hit them, then by pixels and id."""
    of: dict[int, list[list[int]]] = {}
    for row in rows:
        of.setdefault(row[2], []).append(row)
    entries = [
        {
            **item_json(scene, item),
            "shots": len({row[0] for row in own}),
            "pixels": sum(row[4] for row in own),
            "weight": sum(row[5] for row in own),
        }
        for item, own in of.items()
    ]
    return sorted(entries, key=lambda entry: (-entry["shots"], -entry["pixels"], entry["object"]))
