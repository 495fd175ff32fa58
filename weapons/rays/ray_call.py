"""Fire a ray weapon: the whole flow on one screen.

scene -> stack -> weapon -> rays -> way: cast at the items, or march to the first pixel that is taken -> ends -> rows
                                         walk: pre-filter -> cells on pixels of items -> ends -> rows
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import takewhile
from typing import NamedTuple, TypeVar

import numpy as np

from hitplanes.planes.common.backend import keep_arena
from hitplanes.planes.common.checks import Bools, Ints
from hitplanes.planes.common.limits import CHUNK_CELLS, CHUNK_PAIRS
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..fire.hits import Rows
from ..fire.plan import Plan, leave_out_absent, leave_out_imagery, read_stack
from ..fire.prefilter import Candidates, may_refuse, view_of
from ..fire.strategy import AUTO, RAY_WAYS, RayChoice, are_faster_alone, chosen_candidates, chosen_ray_way
from ..kinds.areas import RayParts, pellets_in
from ..kinds.placements import Shots
from ..kinds.rays import RayWeapon, ends_at_first, is_thin_first
from ..kinds.weapon import Weapon
from .contacts import Rays, Reason, Terminations, Touches, rays_of
from .first_hit import FirstHits, ends_by_march
from .ray_hits import Later, Passes, RayHits, Stops, Summed, Walk, rows_of_passes, walked_of
from .ray_walk import Range, expected_cells, has_whole_walk, trace
from .raycast import cast_rays, cast_to_ends

RAYS_AT_ONCE = 2**14
"""Most rays of a chunk; the columns of so many fit the processor's cache."""

WALKED_AT_ONCE, CHUNK_GROWTH = 1024, 4
"""Most rays that walk together, and the largest ratio of the numbers of two chunks in a row."""

CELLS_KEPT = 2**21
"""Most cells of rays that an answer keeps until its passes are read, 64 MB; passes of further rays are made at once."""

C = TypeVar("C", Passes, Stops)
Choose = Callable[[int], Candidates]
"""Function that chooses the pre-filter for a number of rays."""


class Made(NamedTuple):
    """Passes and stops of rays, and the numbers of the pixels that they hit, which were made at once."""

    passes: Passes
    stops: Stops
    numbers: Ints

    @classmethod
    def of(cls, walk: Walk, rays: Rays) -> Made:
        """Those of a walk of some of the rays; pixels are numbered if several rays may hit the same."""
        numbers = walk.pixels(rays.rounds) if rays.pellet.any() else np.zeros(0, np.int64)
        return cls(walk.passes, walk.stops, numbers)


def fired_rays(
    scene: Scene, weapon: Weapon, parts: RayParts, shots: Shots, how: tuple[str, str, str], plan: Plan
) -> RayHits:
    """Decide what shots of a ray weapon hit; `how` is (prefilter, broadphase, strategy) of `fire`."""
    ray = parts[2]
    each = pellets_in(parts)
    through, chosen, choose = _planned(scene, ray, view_of(False, shots), each * len(shots), how, plan)
    step = max(1, RAYS_AT_ONCE // each)
    rows: list[Rows] = []
    found: list[tuple[int, Walk | Made | FirstHits]] = []
    room = CELLS_KEPT
    for begin in range(0, max(len(shots), 1), step):
        part = shots.take(begin, min(begin + step, len(shots)))
        rays = rays_of(parts, part)
        plan.run("rays", "both ends, rounded to 1/256 px", rays.nbytes)
        if ends_at_first(ray):
            ends = _first_ends(rays, ray, part, through, chosen.way, choose)
            first = FirstHits(rays, ray, ends, through.stack)
            rows.append(first.rows(len(part)))
            found.append((begin, first))
            plan.run("rows", "of the first hit of each ray", rows[-1].nbytes)
        else:
            followed, row, room = _followed(rays, ray, part, through, chosen.way, choose, room)
            rows.append(row)
            found += [(begin, walk) for walk in followed]
        if begin:
            rows[-1].shot[:] += begin
    later = _later_of(found, shots, ray, through)
    hits = RayHits(Rows.joined(rows), later, each * len(shots), scene, through.stack, weapon, shots, plan)
    plan.run("rows", "")
    _leave_out_unused(plan, scene, through, shots, ray, (how[2], chosen))
    plan.run("plan", "")
    return hits


def _planned(
    scene: Scene, ray: RayWeapon, view: View | None, count: int, how: tuple[str, str, str], plan: Plan
) -> tuple[Range, RayChoice, Choose]:
    """Choose the way of so many rays of a view, and what goes before it.

    `view` is None if they accept different items; `how` is (prefilter, broadphase, strategy) of `fire`.
    """
    stack = read_stack(scene, plan)
    prefilter, broadphase, strategy = how
    chosen = chosen_ray_way(strategy, how[:2] != AUTO[:2], ray, scene, stack, view, count)
    choose = partial(chosen_candidates, prefilter, broadphase, scene, stack)
    walks = chosen.way == "walk"
    candidates = choose(count if walks else 0)
    field = scene.derived.distance_field(view) if view and chosen.way == "march" else None
    plan.run("plan", candidates.why if walks else chosen.why)
    return Range(scene.items, stack, scene.bounds, candidates, plan, field=field), chosen, choose


def end_times(scene: Scene, ray: RayWeapon, view: View | None, count: int) -> Callable[[Shots], tuple[Rays, Ints]]:
    """Function that finds when the rays of shots of one ray each end, planned for so many rays of a view in all.

    Rays end at the first thing that they meet, or NEVER. Rows, passes and stops are not made.
    """
    stack, follow = scene.items.stack(), None
    if view is not None and are_faster_alone(count, stack):
        follow, _ = late.one_ray.chosen_follower(scene, stack, ray, view, in_arrays=False)
    planned = cache(lambda: _planned(scene, ray, view, count, AUTO, Plan()))

    def ended(shots: Shots) -> tuple[Rays, Ints]:
        """Rays of shots, and when they end."""
        rays = rays_of((None, None, ray), shots)
        if follow is not None:
            lines = zip(rays.start_256.tolist(), rays.step_256.tolist(), strict=True)
            followed = takewhile(bool, (follow(*start, *step) for start, step in lines))
            times = [found[0] for found in followed if found]
            if len(times) == len(rays):
                return rays, np.array(times, np.int64)
        keep_arena()
        through, chosen, choose = planned()
        return rays, _first_ends(rays, ray, shots, through, chosen.way, choose).time

    return ended


def items_hit(scene: Scene, parts: RayParts, shots: Shots) -> tuple[Ints, Ints]:
    """Items that shots hit, as (shot, rank), some several times. Rows, passes and stops are not made."""
    ray, rays = parts[2], rays_of(parts, shots)
    through, chosen, choose = _planned(scene, ray, view_of(False, shots), len(rays), AUTO, Plan())
    if ends_at_first(ray):
        ends = _first_ends(rays, ray, shots, through, chosen.way, choose)
        hit = np.flatnonzero(ends.reason == Reason.HITS)
        return rays.shot[hit], ends.rank[hit]
    walks = _to_ends(rays, ray, shots, through, chosen.way, choose)
    found = [(walk.rays.shot[walk.hit.ray], walk.hit.rank) for walk in walks]
    shot, rank = (np.concatenate(column) for column in zip(*found, strict=True))
    return shot, rank


def _later_of(found: list[tuple[int, Walk | Made | FirstHits]], shots: Shots, ray: RayWeapon, through: Range) -> Later:
    """Functions that tell more of chunks of shots, which are given with the number of their first shot."""
    bounds = through.bounds
    walks = [(first, part) for first, part in found if not isinstance(part, Made)]
    counted = len(walks) == len(found) and has_whole_walk(ray, through.items, through.stack)
    return Later(
        lambda: Passes.joined([_moved_on(part.passes, first) for first, part in found]),
        lambda: Stops.joined([_moved_on(part.stops, first) for first, part in found]),
        (lambda: late.ray_verdicts.verdicts_of(walks, shots, bounds)) if counted else None,
    )


def _moved_on(columns: C, first_shot: int) -> C:
    return replace(columns, shot=columns.shot + first_shot) if first_shot else columns


def _leave_out_unused(
    plan: Plan, scene: Scene, through: Range, shots: Shots, ray: RayWeapon, how: tuple[str, RayChoice]
) -> None:
    """Add the stages that this scene and this weapon did not need to the plan; `how` is what was asked and chosen."""
    unindexed = through.candidates.why_unindexed if plan.has_run("pre-filter") else None
    plan.leave_out_all(_unused, unindexed, plan.has_run("walk"), ray, *how)
    choosy = may_refuse(through.stack, shots)
    leave_out_absent(plan, scene, through.stack, weighted=ray.fades is not None, choosy=choosy)
    leave_out_imagery(plan, scene)


def _unused(
    why_unindexed: str | None, walked: bool, ray: RayWeapon, strategy: str, chosen: RayChoice
) -> Iterator[tuple[str, str]]:
    """Stages that rays did not need, and why; `why_unindexed` is None unless some rays went through the pre-filter."""
    idle = "a part of the walk" if walked else "no ray walks"
    for name in ("pre-filter", "walk", "stops"):
        yield name, idle
    yield "broad phase", why_unindexed or idle
    yield "passes", "told when they are asked for, as the stops are"
    for name in RAY_WAYS:
        if name not in (chosen.way, "walk") and (is_thin_first(ray) or name == strategy):
            yield name, chosen.why
    yield "cells between items", "only those inside their boxes are looked at"
    yield "verdicts", "counted when asked for"
    yield "volumes", "boxes are the pre-filter"


def _first_ends(rays: Rays, ray: RayWeapon, shots: Shots, through: Range, way: str, choose: Choose) -> Terminations:
    """Ends of rays that end at their first hit; those that march leaves over are cast, and the rest walk."""
    if way == "walk":
        return Terminations.joined([walk.ends for walk in _walks(rays, ray, shots, through)])
    ends, left = (cast_to_ends if way == "cast" else ends_by_march)(rays, ray, shots, through)
    if len(left):
        rest = "walk" if way == "cast" else "cast"
        through = _walking(through, choose, len(left)) if rest == "walk" else through
        ends.put(left, _first_ends(rays.take(left), ray, shots, through, rest, choose))
    return ends


def _walking(through: Range, choose: Choose, rays: int) -> Range:
    """The items as so many rays are tested against them that were left over by another way."""
    through = replace(through, candidates=choose(rays))
    through.plan.run("plan", "")
    return through


def _walks(rays: Rays, ray: RayWeapon, shots: Shots, through: Range) -> Iterator[Walk]:
    """Follow rays cell by cell to their ends, in chunks that are expected to touch at most CHUNK_CELLS cells."""
    begin = cells = 0
    most = WALKED_AT_ONCE
    if through.candidates.prefilter.name == "none":
        most = min(most, CHUNK_PAIRS // max(len(through.stack), 1))
    step = max(1, min(most, int(CHUNK_CELLS / expected_cells(rays, ray, through.stack))))
    while begin < max(len(rays), 1):
        part = rays.take(slice(begin, begin + step))
        met, ends, lines, relative = trace(part, ray, shots, through)
        through.plan.run("walk", "")
        walked, _ = walked_of(met, ends, through.stack)
        first = (column[walked.first] for column in (walked.x, walked.y, walked.entry))
        hit = Touches(walked.ray, walked.rank, walked.count, *first)
        walk = Walk(part, lines, hit, ends, through.stack, through.bounds, ray.fades, (met, relative))
        why = "cells of each ray on each object; the rest when it is asked for"
        through.plan.run("passes", why, walked.nbytes)
        yield walk
        begin, cells = begin + step, cells + len(met.x)
        step = max(1, min(most, CHUNK_GROWTH * step, CHUNK_CELLS * begin // max(cells, 1)))


def _to_ends(rays: Rays, ray: RayWeapon, shots: Shots, through: Range, way: str, choose: Choose) -> Iterable[Walk]:
    """Walks of rays that go on, by the chosen way; those that cannot be cast walk."""
    cast = cast_rays(rays, ray, shots, through) if way == "cast" else None
    if cast is None and way == "cast":
        through = _walking(through, choose, len(rays))
    return cast or _walks(rays, ray, shots, through)


def _followed(
    rays: Rays, ray: RayWeapon, shots: Shots, through: Range, way: str, choose: Choose, room: int
) -> tuple[list[Walk | Made], Rows, int]:
    """Follow rays that go on to their ends.

    Parameters
    ----------
    way, choose : the chosen way, and the function that chooses the pre-filter of those that walk
    room : number of cells that may be kept until passes are read

    Returns
    -------
    the walks, or the passes of those that there is no room for; the rows; and the room that is left
    """
    walks: list[Walk | Made] = []
    summed, plan = [], through.plan
    for walk in _to_ends(rays, ray, shots, through, way, choose):
        summed.append(walk.summed)
        plan.run("rows", "passes, gathered by object")
        room -= len(walk.traced[0].x) if walk.traced else 0
        if room >= 0 or not walk.traced:
            walks.append(walk)
            continue
        made = Made.of(walk, rays)
        walks.append(made)
        plan.run("passes", "", made.passes.nbytes + made.numbers.nbytes)
    passes = Summed(*map(np.concatenate, zip(*summed, strict=True)))

    def pixels(wanted: Bools) -> Ints:
        """Number the pixels that some of the passes hit."""
        ends = np.cumsum([len(part.shot) for part in summed])[:-1]
        parts = zip(walks, np.split(wanted, ends), strict=True)
        return np.concatenate(
            [part.numbers if isinstance(part, Made) else part.pixels(rays.rounds, own) for part, own in parts]
        )

    rows = rows_of_passes(passes, rays, through.stack, pixels)
    plan.run("rows", "", rows.nbytes)
    return walks, rows, room
