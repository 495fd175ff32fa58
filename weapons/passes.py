"""Meetings and ends to what is told of them: each pass of a ray through an object, and each stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planes.arrays import Floats, Ints
from planes.constants import HALF, SUB, WEIGHT_FULL
from planes.grid256 import pixel
from planes.items import Stack
from weapons.columns import Columns
from weapons.ends import Ends, Reason
from weapons.meetings import Meetings, last_of_each, stretches
from weapons.pattern import smoothed
from weapons.rays import Rays
from weapons.trace import Lines

__all__ = ["Passes", "Stops", "normals_at", "passes_of", "points_at", "stops_of", "weights_at"]

SIDE = np.arange(-2, 3)
GRADIENT_XY = np.stack(np.meshgrid(SIDE, SIDE), axis=-1).reshape(-1, 2)
GRADIENT = -GRADIENT_XY * (3 - np.abs(GRADIENT_XY)).prod(axis=1, keepdims=True)
"""Weights of the pixels around one, whose sum is its outward normal: nearer ones count more. On straight edges and
circles it is off by 4 degrees in the mean."""


@dataclass(frozen=True, eq=False)
class Passes(Columns):
    """Rays through objects, sorted by (shot, round, pellet, order).

    Parameters
    ----------
    shot, round, pellet, object : (n,) whose ray, through what
    order : (n,) its number among the objects that the ray hit
    entry_xy, exit_xy : (n, 2) the first cell of the object, and of those walked the one that the ray leaves last
    entry, exit : (n,) when, as parts of the ray; of a projectile as parts of the frame
    entry_px, exit_px : (n,) how far along the ray, px
    material : (n,) length of the ray inside the object's pixel squares, px
    normal_xy : (n, 2) outward normal where it enters, in whole numbers; (0, 0) only where it starts inside
    weight : (n,) of the falloff where it enters, up to 65,535
    point_xy : (n, 2) where its point is when it enters, px
    samples : (n,) cells of the object that it walked
    row : (n,) the row of the hits under which it is listed
    """

    round: Ints
    pellet: Ints
    object: Ints
    order: Ints
    entry_xy: Ints
    exit_xy: Ints
    entry: Floats
    exit: Floats
    entry_px: Floats
    exit_px: Floats
    material: Floats
    normal_xy: Ints
    weight: Ints
    point_xy: Floats
    samples: Ints
    row: Ints


@dataclass(frozen=True, eq=False)
class Stops(Columns):
    """Where rays ended, sorted by (shot, round, pellet): where a bullet hole goes.

    Parameters
    ----------
    shot, round, pellet : (R,) whose ray
    reason : (R,) of `Reason`: RANGE, OCCLUDER, HITS (the last object that it may hit), BUDGET
    item : (R,) the occluder, or the object in which it ended; -1 for RANGE
    cell_xy : (R, 2) the pixel
    fraction, distance : (R,) when, as a part of the ray, and how far along it, px
    point_xy : (R, 2) where its point is, px
    normal_xy : (R, 2) outward normal of what it ran into, in whole numbers; (0, 0) for RANGE and BUDGET
    """

    round: Ints
    pellet: Ints
    reason: Ints
    item: Ints
    cell_xy: Ints
    fraction: Floats
    distance: Floats
    point_xy: Floats
    normal_xy: Ints


def passes_of(
    met: Meetings, ends: Ends, rays: Rays, lines: Lines, relative: Lines, stack: Stack, falloff: str | None
) -> tuple[Passes, Meetings]:
    """Passes of rays through objects, and the cells of each.

    Parameters
    ----------
    met : meetings with objects and occluders, also beyond the ends
    lines, relative : (R,) the rays; and, for each pair of `met`, the ray as the item sees it
    """
    chosen = np.flatnonzero(~stack.occluder[met.rank]) if stack.has_occluders else np.arange(len(met))
    objects = met.take(chosen)
    keep = ends.walked(objects)
    chosen = chosen[np.bincount(objects.pair[keep], minlength=len(objects)) > 0]
    walked = objects.only(keep)
    cell = walked.first
    order = np.lexsort((walked.rank, walked.x[cell], walked.y[cell], walked.entry[cell], walked.ray))
    walked, chosen = walked.take(order), chosen[order]
    ray, rank, cell = walked.ray, walked.rank, walked.first
    entry = walked.entry[cell]
    out = last_of_each(walked.begin, walked.pair, (walked.leave, walked.entry, walked.y, walked.x))
    scale, length = lines.scale[ray], lines.length[ray]
    first_part, last_part = entry / scale, np.minimum(walked.leave[out] / scale, ends.fraction[ray])
    last_part = np.maximum(last_part, first_part)
    at, sides = np.stack([walked.x, walked.y], axis=1), relative.entered_by(chosen, walked.x[cell], walked.y[cell])
    origin = rays.origin_xy[ray]
    entry_xy = at[cell] + origin
    return (
        Passes(
            rays.shot[ray], rays.round[ray], rays.pellet[ray], stack.ids[rank],
            np.arange(len(ray)) - np.searchsorted(ray, ray),
            entry_xy, at[out] + origin, first_part, last_part, first_part * length, last_part * length,
            _material(walked, ends, lines) * length,
            normals_at(stack, rank, entry_xy, sides),
            weights_at(entry, scale, falloff),
            points_at(rays, ray, first_part),
            walked.count,
            np.zeros_like(ray),
        ),
        walked,
    )  # fmt: skip


def stops_of(met: Meetings, ends: Ends, rays: Rays, lines: Lines, relative: Lines, stack: Stack) -> Stops:
    """Ends of rays as they are told; parameters as of `passes_of`."""
    cell_xy = pixel(rays.start_256 + rays.step_256)
    item, normal = np.full(len(rays), -1), np.zeros((len(rays), 2), np.int64)
    stopped = np.flatnonzero(ends.rank >= 0)
    here = np.stack([ends.x, ends.y], axis=1)[stopped]
    cell_xy[stopped] = here + rays.origin_xy[stopped]
    item[stopped] = stack.ids[ends.rank[stopped]]
    hard = np.flatnonzero(ends.reason[stopped] != Reason.BUDGET)
    row, (x, y) = stopped[hard], here[hard].T
    key = met.ray * max(len(stack), 1) + met.rank
    order = np.argsort(key)
    pair = order[np.searchsorted(key[order], row * max(len(stack), 1) + ends.rank[row])] if len(row) else row
    normal[row] = normals_at(stack, ends.rank[row], cell_xy[row], relative.entered_by(pair, x, y))
    return Stops(
        rays.shot, rays.round, rays.pellet, ends.reason, item, cell_xy, ends.fraction, ends.fraction * lines.length,
        points_at(rays, np.arange(len(rays)), ends.fraction), normal,
    )  # fmt: skip


def points_at(rays: Rays, ray: Ints, part: Floats) -> Floats:
    """Points of rays at parts of them, px."""
    return np.asarray(rays.start_256[ray] / SUB + part[:, None] * (rays.step_256[ray] / SUB))


def _material(walked: Meetings, ends: Ends, lines: Lines) -> Floats:
    """Parts of the ray for which each pair lasts, up to the end of the ray; each moment counts once."""
    group, first, last = walked.pair, walked.entry, walked.leave
    beside = (lines.step == 0) & ((lines.start & (SUB - 1)) == HALF)
    if lines.radius or beside.any():  # cells may be walked side by side
        group, first, last = stretches(group, first, last)
    ray = walked.ray[group]
    budget = ends.reason[ray] == Reason.BUDGET
    scale = lines.scale[ray]
    whole = np.where(budget, ends.time[ray] - 1, ends.time[ray])
    parts = np.maximum(np.minimum(last, whole) - first, 0)
    total = np.zeros(len(walked))
    if len(walked):
        total = np.add.reduceat(parts, np.searchsorted(group, np.arange(len(walked)))) / lines.scale[walked.ray]
    cut = np.flatnonzero(budget & (first <= whole) & (last > whole))
    np.add.at(total, group[cut], np.maximum(ends.fraction[ray[cut]] - whole[cut] / scale[cut], 0))
    return total


def normals_at(stack: Stack, rank: Ints, xy: Ints, sides: Ints) -> Ints:
    """Outward normals of items at pixels of theirs (n, 2): gradients of their masks, or the sides that are given."""
    box = stack.box_xyxy[rank]
    near = xy[:, None] + GRADIENT_XY
    inside = ((near >= box[:, None, :2]) & (near <= box[:, None, 2:])).all(axis=2)
    row, column = near[..., 1] - box[:, None, 1], near[..., 0] - box[:, None, 0]
    texel = np.where(inside, stack.offset[rank][:, None] + row * stack.width[rank][:, None] + column, 0)
    on = inside & stack.masks[texel]
    normal = np.stack([np.where(on, GRADIENT[:, axis], 0).sum(axis=1) for axis in (0, 1)], axis=1)
    return np.where((normal == 0).all(axis=1, keepdims=True), sides, normal)


def weights_at(entry: Ints, scale: Ints, falloff: str | None) -> Ints:
    """Whole weights from 65,535 at the muzzle to 0 at the end of the ray."""
    if falloff is None:
        return np.full(len(entry), WEIGHT_FULL)
    lost = np.asarray(entry.astype(object) * WEIGHT_FULL // scale, np.int64)
    return smoothed(WEIGHT_FULL - lost, falloff)
