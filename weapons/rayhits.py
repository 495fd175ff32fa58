"""What rays hit: hits with the passes of each ray through an object, and where each ray stopped."""

from __future__ import annotations

import numpy as np

from planes.arrays import Ints
from planes.scene import Scene
from weapons.ends import Reason
from weapons.hits import Hits, Rows
from weapons.meetings import Meetings
from weapons.passes import Passes, Stops
from weapons.plan import Plan
from weapons.rays import Rays
from weapons.volley import Shots
from weapons.weapon import Weapon

__all__ = ["RayHits", "Reason", "rows_of_passes"]


class RayHits(Hits):
    """What a call of `fire` with a traced weapon hit.

    Its rows are those of `Hits`, ordered by (shot, round, distance, pellet, order along the ray): `samples` are cells
    of all pellets, `first_xy` is where the nearest pellet enters. Two are equal when rows, passes and stops are.

    Parameters
    ----------
    passes : each ray through each object
    stop : where each ray ended, and why
    """

    def __init__(
        self, rows: Rows, passes: Passes, stop: Stops, scene: Scene, weapon: Weapon, shots: Shots, plan: Plan
    ) -> None:
        self._keep(rows, scene, weapon, shots, plan)
        self.passes, self.stop = passes, stop


def rows_of_passes(passes: Passes, cells: Meetings, rays: Rays) -> Rows:
    """Gather the passes of all pellets into rows; `cells` are those of each pass."""
    rounds = int(rays.round.max(initial=0)) + 1
    objects = int(passes.object.max(initial=0)) + 1
    group = (passes.shot * rounds + passes.round) * objects + passes.object
    order = np.lexsort((passes.order, passes.pellet, passes.entry_px, group))
    begins = np.flatnonzero(np.diff(group[order], prepend=-1))
    best = order[begins]
    number = np.zeros(len(group), np.int64)
    number[order] = np.cumsum(np.diff(group[order], prepend=-1) != 0) - 1
    samples = np.bincount(number, passes.samples, len(best)).astype(np.int64)
    weight = np.bincount(number, passes.weight, len(best)).astype(np.int64)
    pellets = np.bincount(number, minlength=len(best))
    pixels = samples if (pellets == 1).all() else _distinct(cells, rays, number, len(best))
    ray_of = passes.shot[best], passes.round[best]
    sort = np.lexsort((passes.order[best], passes.pellet[best], passes.entry_px[best], *ray_of[::-1]))
    best = best[sort]
    origin = rays.origin_xy[cells.ray[best]]
    return Rows(
        passes.shot[best], passes.round[best], passes.object[best], samples[sort], pixels[sort], weight[sort],
        pellets[sort], passes.entry_xy[best], ((passes.entry_xy[best] - origin) ** 2).sum(axis=1),
    )  # fmt: skip


def _distinct(cells: Meetings, rays: Rays, number: Ints, rows: int) -> Ints:
    """Cells of each row, each counted once."""
    xy = np.stack([cells.x, cells.y], axis=1) + rays.origin_xy[cells.ray[cells.pair]]
    each = np.unique(np.column_stack([number[cells.pair], xy]), axis=0)
    return np.bincount(each[:, 0], minlength=rows)
