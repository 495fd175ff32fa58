"""Rays to report JSON: where each begins and ends, why, and what it went through."""

from __future__ import annotations

from typing import Any

import numpy as np

from planes.constants import SUB
from planes.grid256 import pixel
from planes.scene import Scene
from planes.spans import Box
from weapons.arsenal import ray_parts_of
from weapons.passes import Passes, Stops
from weapons.rayexplain import Miss
from weapons.rayhits import RayHits, Reason
from weapons.rays import rays_of

__all__ = ["item_told", "ray_boxes", "rays_told"]


def rays_told(scene: Scene, hits: RayHits, row: int) -> dict[str, Any]:
    """Tell the rays of one shot, and what it missed by least."""
    parts = ray_parts_of(hits.weapon)
    assert parts is not None  # its hits are those of rays
    rays = rays_of(parts, hits.shots.take(row, row + 1))
    stops, passes = hits.stops_at(row), hits.passes_at(row)
    of = np.searchsorted(_ray_numbers(passes, parts[1].count if parts[1] else 1), np.arange(len(rays) + 1)).tolist()
    ends = (rays.start_256 + rays.step_256) / SUB
    told = [
        {
            "round": int(rays.round[i]),
            "pellet": int(rays.pellet[i]),
            "start": (rays.start_256[i] / SUB).tolist(),
            "end": ends[i].tolist(),
            "stop": _stop(scene, stops, i),
            "passes": [_pass(scene, passes, k) for k in range(of[i], of[i + 1])],
        }
        for i in range(len(rays))
    ]
    miss = hits.nearest_miss(row)
    near = None if miss is None else {**item_told(scene, miss.object), **_near(miss)}
    return {"radius": parts[2].radius_256 / SUB, "rays": told, "nearest_miss": near}


def ray_boxes(hits: RayHits) -> Box | None:
    """Box around the way of all rays, from their starts to their stops."""
    if not len(hits.stop):
        return None
    begin, end = pixel(hits.shots.at_256), hits.stop.cell_xy
    x, y = np.minimum(begin.min(axis=0), end.min(axis=0)).tolist()
    x_max, y_max = np.maximum(begin.max(axis=0), end.max(axis=0)).tolist()
    return x, y, x_max, y_max


def _ray_numbers(passes: Passes, pellets: int) -> Any:
    return passes.round * pellets + passes.pellet


def item_told(scene: Scene, item: int) -> dict[str, Any]:
    """An item by its id and its name."""
    return {"object": item, "name": scene.name_of(item)}


def _stop(scene: Scene, stops: Stops, i: int) -> dict[str, Any]:
    item = int(stops.item[i])
    return {
        "reason": Reason(int(stops.reason[i])).name.lower(),
        "item": None if item < 0 else item_told(scene, item),
        "cell_xy": stops.cell_xy[i].tolist(),
        "point": stops.point_xy[i].tolist(),
        "distance": float(stops.distance[i]),
        "fraction": float(stops.fraction[i]),
        "normal": stops.normal_xy[i].tolist(),
    }


def _pass(scene: Scene, passes: Passes, k: int) -> dict[str, Any]:
    return {
        **item_told(scene, int(passes.object[k])),
        "order": int(passes.order[k]),
        "entry_xy": passes.entry_xy[k].tolist(),
        "exit_xy": passes.exit_xy[k].tolist(),
        "entry_px": float(passes.entry_px[k]),
        "exit_px": float(passes.exit_px[k]),
        "entry": float(passes.entry[k]),
        "exit": float(passes.exit[k]),
        "point": passes.point_xy[k].tolist(),
        "material": float(passes.material[k]),
        "normal": passes.normal_xy[k].tolist(),
        "weight": int(passes.weight[k]),
    }


def _near(miss: Miss) -> dict[str, Any]:
    return {"distance": miss.distance, "ray_xy": list(miss.ray_xy), "object_xy": list(miss.object_xy)}
