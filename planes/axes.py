"""Do convex hulls, grown by radii, overlap? Separating axes and distances, by floats where they can tell.

A hull's outline turns from +x towards +y, so a corner of the other lies beyond an edge where `orient2d` is below 0.
Columns are points (2, k, n): x and y, k to a row, n rows.
"""

from __future__ import annotations

import numpy as np

from planes.arrays import Bools, Floats, Ints
from planes.constants import CHUNK_ROWS, DISTANCE_ERROR, FLOAT_HUGE, FLOAT_TINY, LENGTH_TINY, SIDE_ERROR
from planes.exact import Signs, orient2d
from planes.volumes import Core

__all__ = ["edge_parts", "hulls_sign"]


def hulls_sign(one: Core, two: Core, rows: Ints) -> Signs:
    """Tell by floats which rows of two kinds overlap.

    Returns
    -------
    (len(rows),) int8: -1 where they do, 1 where they are apart, 0 where floats cannot tell

    References
    ----------
    Ericson, *Real-Time Collision Detection* (2005), 4.4.1, 5.1.2 and 5.2.1.
    """
    signs = np.zeros(len(rows), np.int8)
    order = _by_corners(one, two, rows)
    done = 0
    with np.errstate(all="ignore"):
        while done < len(rows):
            most = int(max(v.counts[rows[order[done]]] for v in (one, two)))
            chunk = order[done : done + max(CHUNK_ROWS // most, 1)]
            signs[chunk] = _chunk_sign(one, two, rows[chunk])
            done += len(chunk)
    return signs


def _by_corners(one: Core, two: Core, rows: Ints) -> Ints:
    """Order of rows such that those of a chunk have about as many corners, the most first."""
    counts = one.counts[rows], two.counts[rows]
    if all((c == c[:1]).all() for c in counts):
        return np.arange(len(rows))
    return np.lexsort((np.minimum(*counts), np.maximum(*counts)))[::-1]


def _chunk_sign(one: Core, two: Core, rows: Ints) -> Signs:
    """The edges of one, then of the other, then distances; rows that are settled leave the batch."""
    a, b = (_corners(core, rows) for core in (one, two))
    a_ends, b_ends = (_without_length(v) for v in (a, b))
    middle = a[:, :1].copy()
    a -= middle
    b -= middle
    reach = np.maximum(np.abs(a).max(axis=(0, 1)), np.abs(b).max(axis=(0, 1)))
    signs, met = _edges_sign(a, b, a_ends, reach)
    left = np.flatnonzero(signs == 0)
    others, met_too = _edges_sign(
        b.take(left, axis=2), a.take(left, axis=2), b_ends.take(left, axis=1), reach.take(left)
    )
    signs[left] = np.where(met[left] & met_too & (others == 0), -1, others)
    radius = one.radius[rows] + two.radius[rows]
    if radius.any():
        left = np.flatnonzero((signs >= 0) & (radius > 0))
        far = _distance_sign(a.take(left, axis=2), b.take(left, axis=2), reach.take(left), radius.take(left))
        signs[left] = np.where(far > 0, signs[left], far)
    return signs


def _corners(core: Core, rows: Ints) -> Floats:
    """Columns of rows, as many as the most that one has: where a row has fewer, its last corner again."""
    counts = core.counts[rows]
    places = np.arange(counts.max())[:, None]
    if not (counts == len(places)).all():
        places = np.minimum(places, counts - 1)
    pairs = np.ascontiguousarray(core.points).view(np.complex128)[:, 0]  # x and y are gathered as one
    found = pairs[core.starts[rows] + places]
    return np.stack([found.real, found.imag])


def _without_length(a: Floats) -> Bools:
    """Edges (k, n) of which both ends are the same."""
    return np.asarray((a == np.roll(a, -1, axis=1)).all(axis=0))


def _edges_sign(a: Floats, b: Floats, ends: Bools, reach: Floats) -> tuple[Signs, Bools]:
    """On which sides of the edges of a the corners of b lie; edges without length are left out.

    Returns
    -------
    signs : 1 where all corners lie beyond an edge, -1 where one lies within all edges, else 0
    met : where they all lie beyond no edge, and there is one
    """
    bound = SIDE_ERROR * reach * reach + FLOAT_TINY
    parted, met = np.zeros(len(reach), np.bool_), np.ones(len(reach), np.bool_)
    within = np.full(b.shape[1:], np.inf)
    after = np.roll(a, -1, axis=1)
    for k in range(a.shape[1]):
        (x, y), (dx, dy) = a[:, k], after[:, k] - a[:, k]
        side = dx * b[1]
        side -= dy * b[0]
        side -= dx * y - dy * x
        if ends[k].any():
            side[:, ends[k]] = np.inf
        top = side.max(axis=0)
        parted |= top < -bound
        met &= top > bound
        np.minimum(within, side, out=within)
    most = within.max(axis=0)
    inside = (most > bound) & (most < np.inf)
    return parted.astype(np.int8) - inside.astype(np.int8), met & (most < np.inf)


def _distance_sign(a: Floats, b: Floats, reach: Floats, radius: Floats) -> Signs:
    """Compare the least distance of a corner of one to an edge of the other with the radius."""
    least = np.full(len(reach), np.inf)
    for corners, edges in ((a, b), (b, a)):
        count = edges.shape[1]
        if count == 1 and corners.shape[1] > 1:
            continue  # the other's edges to this one point say it all
        for k in range(1 if count == 2 else count):
            p, q = edges[:, k, None], edges[:, (k + 1) % count, None]
            np.minimum(least, _distance2(corners, p, q).min(axis=0), out=least)
    value = least - radius * radius
    error = DISTANCE_ERROR * reach + LENGTH_TINY
    bound = error * (2 * radius + error)
    bound[~(reach * reach < FLOAT_HUGE)] = np.inf
    return np.subtract((value > bound).view(np.int8), (value < -bound).view(np.int8))


def _distance2(p: Floats, a: Floats, b: Floats) -> Floats:
    """Squared distances of points to segments."""
    (fx, fy), (dx, dy) = p - a, b - a
    share = (fx * dx + fy * dy) / np.maximum(dx * dx + dy * dy, FLOAT_TINY)
    share = np.minimum(np.maximum(share, 0), 1)
    x, y = fx - share * dx, fy - share * dy
    return np.asarray(x * x + y * y)


def edge_parts(first: Core, second: Core, rows: Ints, k: int, conservative: bool) -> Bools:
    """Where all of the second lies strictly beyond edge k of the first; a segment has an edge on either side."""
    parted = np.flatnonzero(k < first.counts[rows])
    here = rows[parted]
    p, q = first.point(here, k), first.point(here, k + 1)
    for j in range(int(second.counts[here].max(initial=0))):
        outside = orient2d(p, q, second.point(here, np.minimum(j, second.counts[here] - 1)), conservative) < 0
        parted, here, p, q = parted[outside], here[outside], p[outside], q[outside]
    found = np.zeros(len(rows), np.bool_)
    found[parted] = True
    return found
