"""Rays that jump to the first thing on their way, by the clearance plane of the scene, instead of walking past items.

Only thin rays that end at their first hit: where such a ray first touches anything at all, the code plane tells what.
What rays refuse they go through, cell by cell. Those for which all this is not enough are left to the walk: they refuse
what lies in front of something else, or what they touch together with it, or have no length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from planes import jumps
from planes.arrays import Bools, Codes, Ints
from planes.clearance import ClearancePlane
from planes.constants import HALF, SUB
from planes.items import Items, Stack
from planes.jumps import PAD, UNDECIDED, Clearance, Passed
from planes.spans import meets
from planes.twins import kernels_of
from weapons.candidates import may_refuse, refused
from weapons.ends import Ends, Reason, endless
from weapons.guns import Traced
from weapons.plan import Plan
from weapons.rays import Rays
from weapons.rayways import JUMP_RAY_NS
from weapons.volley import Shots

__all__ = ["ends_by_jumps"]

RAYS_AT_ONCE = 2**14
"""Rays whose columns fit the cache."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """What rays see of the scene where they come to something."""

    rays: Rays
    shots: Shots
    stack: Stack
    codes: Codes
    clearance: Clearance
    plan: Plan

    def place(self, cell: Ints) -> tuple[Ints, Ints]:
        """Columns and rows of cells; numpy divides by one number several times as fast as `divmod` does."""
        y = cell // self.clearance.shape[1]
        return cell - y * self.clearance.shape[1], y

    def front(self, cell: Ints) -> tuple[Ints, Codes]:
        """Rank of the front of taken cells, and their codes."""
        x, y = self.place(cell)
        code = self.codes.reshape(-1).take((y - PAD) * self.codes.shape[1] + (x - PAD))
        return self.stack.rank_by_code.take(code >> 1), code

    def refuses(self, ray: Ints, rank: Ints) -> Bools:
        """Whether rays refuse items."""
        self.plan.run("jumps", "")
        found = refused(self.stack, rank, self.shots, self.rays.shot[ray])
        self.plan.run("filter", "categories and owners", found.nbytes)
        return found

    def passed(self, ray: Ints, cell: Ints) -> Bools:
        """Whether rays refuse all that is in taken cells."""
        rank, code = self.front(cell)
        return np.asarray(self.refuses(ray, rank) & (code & 1 == 0))


def ends_by_jumps(
    rays: Rays, ray: Traced, shots: Shots, items: Items, stack: Stack, plane: ClearancePlane, plan: Plan
) -> tuple[Ends, Ints]:
    """Find where rays end, but for the parts of their lengths.

    Returns
    -------
    the ends, and the rays for which they are yet to be found
    """
    seen = _Seen(rays, shots, stack, *_read(plane, items, plan), plan)
    choosy = may_refuse(stack, shots)
    entry, cell, several = _first_taken(seen.clearance, rays, plane.corner_xy, seen.passed if choosy else None)
    unsure, met = entry == UNDECIDED, np.flatnonzero(entry >= 0)
    at = np.flatnonzero(several)
    if len(at):
        cells = _cells_at_once(cell[at], entry[at] == 0, rays.start_256[at], rays.step_256[at], seen.clearance.shape[1])
        cell[at], others = _first_of(cells, seen, plane.corner_xy)
        unsure[at] = others & choosy
    place = cell[met]
    rank, _ = seen.front(place)
    if choosy:
        unsure[met] |= seen.refuses(met, rank)
    if ray.inside != "hit":
        unsure |= entry == 0
    (x, y), aside = seen.place(place), plane.corner_xy - rays.origin_xy.take(met, axis=0)
    ends = endless(len(rays))
    ends.x[met], ends.y[met] = x + aside[:, 0], y + aside[:, 1]
    ends.rank[met], ends.time[met] = rank, entry[met]
    ends.reason[met] = np.where(stack.occluder[rank], Reason.OCCLUDER, Reason.HITS)
    plan.run("jumps", "each to the first cell that is taken", ends.nbytes)
    return ends, np.flatnonzero(unsure)


def _read(plane: ClearancePlane, items: Items, plan: Plan) -> tuple[Codes, Clearance]:
    """Codes and distances of the scene as it is now."""
    made = plane.is_made(items)
    codes = plane.codes.read(items)
    redrawn = plane.codes.redrawn
    plan.run("code plane", f"{redrawn} px drawn anew", redrawn * codes.itemsize)
    clearance = plane.read(items, codes)
    plan.run("clearance plane", "as it was" if made else "measured anew", 0 if made else clearance.nbytes)
    return codes, clearance


def _first_taken(clearance: Clearance, rays: Rays, corner_xy: Ints, passed: Passed | None) -> tuple[Ints, Ints, Bools]:
    """First taken cells of all rays, but for those that are passed, so many rays at once that they fit the cache."""
    start, found = rays.start_256 - SUB * corner_xy, []
    for begin in range(0, max(len(rays), 1), RAYS_AT_ONCE):
        part = slice(begin, begin + RAYS_AT_ONCE)
        if passed is None:
            kernels = kernels_of(jumps, len(rays) * JUMP_RAY_NS)
            found.append(kernels.first_taken(clearance, start[part], rays.step_256[part]))
        else:
            later = partial(_later, passed, begin)
            found.append(jumps.first_taken(clearance, start[part], rays.step_256[part], later))
    if len(found) == 1:
        first: tuple[Ints, Ints, Bools] = found[0]
        return first
    entry, cell, several = (np.concatenate(column) for column in zip(*found, strict=True))
    return entry, cell, several


def _later(passed: Passed, begin: int, ray: Ints, cell: Ints) -> Bools:
    return passed(ray + begin, cell)


def _cells_at_once(place: Ints, starts: Bools, start_256: Ints, step_256: Ints, width: int) -> Ints:
    """Cells (n, 4) of the clearance plane that rays come to at once; some are told twice.

    Parameters
    ----------
    place : (n,) the cell that a ray goes into, or the one beside the corner, along x
    starts : (n,) whether it starts there, or else goes through a corner, or along a border
    """
    sign = np.where(step_256 < 0, -1, 1)
    on_border = ((start_256 & (SUB - 1)) == HALF) & (starts[:, None] | (step_256 == 0))
    border, starts = sign * on_border, starts | on_border.any(axis=1)
    at_start, at_corner = np.array([[0, 0], [-1, 0], [0, -1], [-1, -1]]), np.array([[0, 0], [-1, 1], [0, 1], [0, 1]])
    steps = np.where(starts[:, None, None], at_start * border[:, None], at_corner * sign[:, None])
    return np.asarray(place[:, None] + steps[:, :, 0] + width * steps[:, :, 1])


def _first_of(cells: Ints, seen: _Seen, corner_xy: Ints) -> tuple[Ints, Bools]:
    """Of cells (n, k) that rays come to at once, the one that comes first: with an occluder, then by (y, x).

    Returns
    -------
    its place; and whether more cells than that are taken
    """
    taken = seen.clearance.reshape(-1)[cells] == 0
    blocked = np.zeros_like(taken)
    if seen.stack.has_occluders:
        rank, code = seen.front(cells[taken])
        in_front = seen.stack.occluder[rank]
        behind = np.flatnonzero(~in_front & (code & 1 == 1))
        xy = np.stack(seen.place(cells[taken][behind]), axis=1) + corner_xy
        in_front[behind] = _has_occluder(seen.stack, xy)
        blocked[taken] = in_front
    last = np.where(taken, cells, -1).max(axis=1, keepdims=True)
    best = np.argmin((~taken * 2 + ~blocked) * seen.clearance.size + cells, axis=1)
    return cells[np.arange(len(cells)), best], (taken & (cells != last)).any(axis=1)


def _has_occluder(stack: Stack, xy: Ints) -> Bools:
    """Whether any occluder covers pixels (n, 2)."""
    walls = np.flatnonzero(stack.occluder)
    box = stack.box_xyxy[walls]
    pixel, wall = np.nonzero(meets(np.concatenate([xy, xy], axis=1)[:, None], box))
    x, y = (xy[pixel] - box[wall, :2]).T
    on = stack.masks[stack.offset[walls[wall]] + y * stack.width[walls[wall]] + x]
    return np.asarray(np.bincount(pixel, on, len(xy)) > 0)
