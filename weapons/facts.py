"""Hits to report JSON: what was fired, what each sample met, what was hit and what was not, and why."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from planes.arrays import Ints
from planes.constants import TRIG_BITS
from planes.grid256 import pixel
from planes.items import Role
from planes.sampling import Verdict
from planes.scene import Scene
from planes.spans import Spans
from weapons.hits import Hits
from weapons.orders import Order, fire_order

__all__ = ["FORMAT", "report_of"]

FORMAT = "hitplanes-report/1"


def report_of(scene: Scene, orders: Sequence[Order]) -> dict[str, Any]:
    """Fire shots and tell all that a picture needs, as JSON.

    Samples are runs [y, x_first, x_last] by verdict, each pixel once under its strongest verdict.
    """
    return {
        "format": FORMAT,
        "version": version("hitplanes"),
        "scene": {
            "name": scene.name,
            "hash": scene.content_hash(),
            "version": scene.version,
            "occluders": len(scene.ids(Role.OCCLUDER)),
            "bounds_xyxy": None if scene.bounds is None else list(scene.bounds),
        },
        "weapons": {order.name: order.weapon.to_json() for order in orders},
        "shots": [_shot(scene, order) for order in orders],
    }


def _shot(scene: Scene, order: Order) -> dict[str, Any]:
    hits = fire_order(scene, order)
    c, s = hits.shots.direction[0].tolist()
    return {
        "shot": order.shot,
        "weapon": order.name,
        "at": list(order.at),
        "at_xy": pixel(hits.shots.at_256[0]).tolist(),
        "aim": order.aim,
        "toward": None if order.toward is None else list(order.toward),
        "direction": [c / (1 << TRIG_BITS), s / (1 << TRIG_BITS)],
        "seed": order.seed,
        "accept": None if order.accept is None else list(order.accept),
        "exclude": [{"owner": owner, "name": scene.name_of(owner)} for owner in order.exclude],
        "verdicts": hits.verdict_counts(0),
        "rows": _rows(scene, hits),
        "why_not": [
            {
                "object": entry.object,
                "name": scene.name_of(entry.object),
                "reason": entry.reason,
                "samples": entry.samples,
                "by": [{"object": i, "name": scene.name_of(i), "samples": n} for i, n in entry.by.items()],
                "distance": round(entry.distance, 3),
            }
            for entry in hits.why_not(0)
        ],
        "blockers": [
            {"object": b.occluder, "name": scene.name_of(b.occluder), "samples": b.samples} for b in hits.blockers(0)
        ],
        "samples": _sample_runs(hits),
        "plan": hits.plan.to_dict(),
    }


def _rows(scene: Scene, hits: Hits) -> list[dict[str, Any]]:
    rows = []
    for row, share in zip(hits, hits.shares(), strict=True):
        rows.append(
            {
                "object": row.object,
                "name": scene.name_of(row.object),
                "round": row.round,
                "samples": row.samples,
                "pixels": row.pixels,
                "weight": row.weight,
                "pellets": row.pellets,
                "first_xy": list(row.first_xy),
                "distance2": row.distance2,
                "shares": {name: round(value, 6) for name, value in share._asdict().items()},
            }
        )
    return rows


def _sample_runs(hits: Hits) -> dict[str, list[list[int]]]:
    """Runs [y, x_first, x_last] of the pixels of each verdict that occurs; every pellet sees a pixel alike."""
    samples = hits.samples_at(0)
    runs = {}
    for verdict in Verdict:
        here = samples.xy[samples.verdict == verdict]
        if len(here):
            runs[verdict.name.lower()] = _runs(here)
    return runs


def _runs(xy: Ints) -> list[list[int]]:
    spans = Spans.from_runs(xy[:, 1], xy[:, 0], xy[:, 0])
    rows: list[list[int]] = np.stack([spans.y, spans.x_first, spans.x_last], axis=1).tolist()
    return rows
