"""Fire rays: the whole flow of a traced weapon on one screen.

scene -> stack -> weapon -> rays -> pre-filter -> cells on pixels -> ends -> passes and stops -> rows
"""

from __future__ import annotations

from planes.constants import CHUNK_SAMPLES
from planes.items import Role
from planes.scene import Scene
from weapons.hits import Rows
from weapons.passes import Passes, Stops, passes_of, stops_of
from weapons.plan import Plan, chosen_candidates
from weapons.rayhits import RayHits, rows_of_passes
from weapons.rays import Parts, rays_of
from weapons.tracing import Range, trace
from weapons.volley import Shots
from weapons.weapon import Weapon

__all__ = ["fired_rays"]

RAYS_FIRST, RAYS_MOST = 128, 1024
"""Rays of the first part of a batch, and of the largest: larger parts make nothing faster. A part has twice the rays of
the one before unless that met many cells."""


def fired_rays(
    scene: Scene, weapon: Weapon, parts: Parts, shots: Shots, prefilter: object, broadphase: object
) -> RayHits:
    """Decide what shots of a traced weapon hit; arguments are those of `fire`."""
    plan, stack, ray = Plan(), scene.items.stack(), parts[2]
    burst, several, _ = parts
    each = (burst.count if burst else 1) * (several.count if several else 1)
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, False, each * len(shots))
    through = Range(scene.items, stack, scene.bounds, candidates, plan)
    rows: list[Rows] = []
    passes: list[Passes] = []
    stops: list[Stops] = []
    begin, step = 0, max(RAYS_FIRST // each, 1)
    while not rows or begin < len(shots):
        some = shots.take(begin, min(begin + step, len(shots)))
        rays = rays_of(parts, some)
        plan.run("rays", "both ends on the grid", rays.start_256.nbytes * 2)
        met, ends, lines, relative = trace(rays, ray, some, through)
        through_objects, cells = passes_of(met, ends, rays, lines, relative, stack, ray.fades)
        passes.append(through_objects)
        rows.append(rows_of_passes(through_objects, cells, rays))
        stops.append(stops_of(met, ends, rays, lines, relative, stack))
        for columns in (rows[-1], passes[-1], stops[-1]):
            columns.shot[:] += begin
        begin += step
        step = max(1, min(2 * step, RAYS_MOST // each, step * CHUNK_SAMPLES // max(len(met.x), 1)))
    _leave_out_unused(plan, scene, candidates.why_unindexed, ray.fades)
    return RayHits(Rows.joined(rows), Passes.joined(passes), Stops.joined(stops), scene, weapon, shots, plan)


def _leave_out_unused(plan: Plan, scene: Scene, why_unindexed: str, falloff: str | None) -> None:
    """Complete a plan with what this scene and this weapon did not need."""
    if not plan.has_run("broad phase"):
        plan.leave_out("broad phase", why_unindexed)
    plan.leave_out("cells between items", "only those inside their boxes are looked at")
    plan.leave_out("verdicts", "counted when asked for")
    if falloff is None:
        plan.leave_out("weights", "the weapon has no falloff")
    if scene.bounds is None:
        plan.leave_out("outside", "the scene has no bounds")
    if not scene.items.stack().occluder.any():
        plan.leave_out("occluders", "the scene has none")
    for role in (Role.BACKGROUND, Role.MOVER, Role.HUD):
        if len(scene.ids(role)):
            plan.leave_out(role.value, "drawn only for a picture")
