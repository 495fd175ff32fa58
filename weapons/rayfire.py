"""Fire rays: the whole flow of a traced weapon on one screen.

scene -> stack -> weapon -> rays -> pre-filter -> cells on pixels -> ends -> passes and stops -> rows
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Ints
from planes.constants import CHUNK_CELLS, CHUNK_PAIRS, CHUNK_ROWS
from planes.scene import Scene
from weapons.candidates import may_refuse
from weapons.guns import Traced
from weapons.hits import Rows
from weapons.passes import Passes, Stops, passes_of, stops_of
from weapons.plan import Plan, chosen_candidates, leave_out_absent, leave_out_imagery, read_stack
from weapons.rayhits import RayHits, pixels_of, rows_of_passes
from weapons.rays import Parts, Rays, rays_of
from weapons.tracing import Range, expected_cells, trace
from weapons.volley import Shots
from weapons.weapon import Weapon

__all__ = ["fired_rays"]

RAYS_MOST = 1024
"""Rays of the largest part: larger ones make nothing faster."""

GROWTH = 4
"""How much larger a part of the rays may be than the one before, if that touched few cells."""


def fired_rays(
    scene: Scene, weapon: Weapon, parts: Parts, shots: Shots, prefilter: object, broadphase: object, plan: Plan
) -> RayHits:
    """Decide what shots of a traced weapon hit; arguments are those of `fire`, and a plan that has begun."""
    stack, ray = read_stack(scene, plan), parts[2]
    burst, several, _ = parts
    each = (burst.count if burst else 1) * (several.count if several else 1)
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, False, each * len(shots))
    through = Range(scene.items, stack, scene.bounds, candidates, plan)
    plan.run("plan", candidates.why)
    step = max(1, CHUNK_ROWS // each)
    rows: list[Rows] = []
    passes: list[Passes] = []
    stops: list[Stops] = []
    for begin in range(0, max(len(shots), 1), step):
        some = shots.take(begin, min(begin + step, len(shots)))
        rays = rays_of(parts, some)
        plan.run("rays", "both ends on the grid", rays.nbytes)
        through_objects, ends, pixels = _followed(rays, ray, some, through)
        rows.append(rows_of_passes(through_objects, pixels, rays))
        passes.append(through_objects)
        stops.append(ends)
        for columns in (rows[-1], passes[-1], stops[-1]) if begin else ():
            columns.shot[:] += begin
        plan.run("rows", "passes, gathered by object", rows[-1].nbytes)
    hits = RayHits(Rows.joined(rows), Passes.joined(passes), Stops.joined(stops), scene, weapon, shots, plan)
    plan.run("rows", "")
    if not plan.has_run("broad phase"):
        plan.leave_out("broad phase", candidates.why_unindexed)
    plan.leave_out("cells between items", "only those inside their boxes are looked at")
    plan.leave_out("verdicts", "counted when asked for")
    if not plan.has_run("volumes"):
        plan.leave_out("volumes", "boxes are the pre-filter")
    leave_out_absent(plan, scene, stack, weighted=ray.fades is not None, choosy=may_refuse(stack, shots))
    leave_out_imagery(plan, scene)
    plan.run("plan", "")
    return hits


def _followed(rays: Rays, ray: Traced, shots: Shots, through: Range) -> tuple[Passes, Stops, Ints]:
    """Follow rays to their ends, in parts whose cells stay within their chunk, as far as can be told before.

    Returns
    -------
    passes, stops, and the pixels that were hit, as `pixels_of` tells them
    """
    stack, plan = through.stack, through.plan
    passes: list[Passes] = []
    stops: list[Stops] = []
    pixels: list[Ints] = []
    begin = cells = 0
    most = RAYS_MOST
    if through.candidates.prefilter.name == "none":
        most = min(most, CHUNK_PAIRS // max(len(stack), 1))
    step = max(1, min(most, int(CHUNK_CELLS / expected_cells(rays, ray, stack))))
    while begin < len(rays) or not passes:
        some = rays.take(begin, begin + step)
        met, ends, lines, relative = trace(some, ray, shots, through)
        plan.run("walk", "")
        through_objects, walked = passes_of(met, ends, some, lines, relative, stack, ray.fades)
        passes.append(through_objects)
        plan.run("passes", "each ray through each object", through_objects.nbytes)
        stops.append(stops_of(met, ends, some, lines, relative, stack))
        plan.run("stops", "", stops[-1].nbytes)
        pixels.append(pixels_of(through_objects, walked, some, rays))
        plan.run("rows", "", pixels[-1].nbytes)
        begin, cells = begin + step, cells + len(met.x)
        step = max(1, min(most, GROWTH * step, CHUNK_CELLS * begin // max(cells, 1)))
    return Passes.joined(passes), Stops.joined(stops), np.concatenate(pixels)
