"""Number of cells of rays by verdict, from their ends and what they hit, without a list of all cells.

A thin ray is counted in closed form: it enters a cell with each border of pixels that it crosses, and one more where it
crosses two at once, as cells are closed. A wide ray is counted row by row, and cell by cell at its two round ends.
`ray_samples` lists all cells. It is the reference, and serves rays that are tested at some moments, or at moving items,
or that ignore what they start in.

walk -> all cells, those in bounds, those before the end -> of these: hit, occluded, filtered -> the rest is empty
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hitplanes.planes.bits.cells import met_boxes
from hitplanes.planes.bits.span_walk import Verdict
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import Bools, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, HALF, SUB
from hitplanes.planes.grid.rasterize import DIAGONAL, Lines
from hitplanes.planes.grid.spans import Box, Columns, clipped, each_pixel, meets, pieces, sorted_once

from ..fire.prefilter import Filters, filters_of, refused, refused_by
from ..kinds.placements import Shots
from ..rays.contacts import NEVER, Reason, Terminations, find_contacts
from ..rays.first_hit import FirstHits
from ..rays.ray_hits import Walk
from ..rays.raycast import RAYS_AT_ONCE, covers, near_items, times_in
from .ray_samples import REACH_BITS, key_of_cells

SLACK = 2.0**-24
"""Tolerance of times as fractions of rays, by which cells are listed that need not be."""


def verdicts_of(walks: Iterable[tuple[int, Walk | FirstHits]], shots: Shots, bounds: Box | None) -> Ints:
    """Number of cells (N, 6) of shots by verdict.

    Parameters
    ----------
    walks : walks of all rays, each with the number of the shot that its rays count from
    """
    n = len(Verdict)
    found = np.zeros(len(shots) * n, np.int64)
    for first, part in walks:
        walk = part if isinstance(part, Walk) else _walk_of(part, shots, first)
        filters = filters_of(walk.stack, shots, walk.rays.shot + first)
        of_rays = kernels_of(sys.modules[__name__]).verdicts_of_rays(walk, filters, bounds)
        if of_rays is None:
            of_rays = verdicts_of_rays(walk, filters, bounds)
        place = (walk.rays.shot + first)[:, None] * n + np.arange(n)
        found += np.bincount(place.ravel(), of_rays.ravel(), len(found)).astype(np.int64)
    return found.reshape(-1, n)


def _walk_of(rays: FirstHits, shots: Shots, first_shot: int) -> Walk:
    """The walk of rays to their first hits. Of cells entered at once, rays walk those with occluders first."""
    walk, stack = rays.walk, rays.stack
    ends, origin = walk.ends, walk.rays.origin_xy
    alone, hit = ends.reason == Reason.OCCLUDER, np.flatnonzero(ends.reason == Reason.HITS)
    blocking = np.flatnonzero(stack.occluder)
    of, which = met_boxes(np.tile(origin[hit] + np.stack([ends.x, ends.y], axis=1)[hit], 2), stack.box_xyxy[blocking])
    ray, rank = hit[of], blocking[which]
    here = covers(stack, rank, ends.x[ray], ends.y[ray], origin[ray], None)
    here &= ~refused(stack, rank, shots, walk.rays.shot[ray] + first_shot)
    alone[ray[here]] = True
    return replace(walk, ends=replace(ends, alone=alone))


def verdicts_of_rays(walk: Walk, filters: Filters | None, bounds: Box | None) -> Ints:
    """Number of cells (R, 6) of rays by verdict; the compiled kernel returns None for rays that are too long for it."""
    lines, ends, origin = walk.lines, walk.ends, walk.rays.origin_xy
    counts = np.zeros((len(lines), len(Verdict)), np.int64)
    box = lines.box_xyxy
    inside = total = cells_in(lines, box)
    if bounds is not None:
        shift = np.tile(origin, 2)
        box = clipped(box + shift, bounds) - shift
        leaving = np.flatnonzero((box != lines.box_xyxy).any(axis=1))
        inside = total.copy()
        inside[leaving] = cells_in(lines.take(leaving), box[leaving])
    reached, ended = inside.copy(), np.flatnonzero(ends.reason != Reason.RANGE)
    reached[ended] = cells_in(lines.take(ended), box[ended], ends.take(ended))
    met = _met(walk, filters, bounds)
    counts[:, Verdict.HIT : Verdict.OUTSIDE] = met
    counts[:, Verdict.EMPTY] = reached - met.sum(axis=1)
    counts[:, Verdict.OUTSIDE], counts[:, Verdict.BEYOND] = total - inside, inside - reached
    return counts


def cells_in(lines: Lines, box_xyxy: Ints, ends: Terminations | None = None) -> Ints:
    """Number of cells (n,) of lines in inclusive boxes (n, 4), each in its own; with ends only those before them."""
    left, top, right, low = box_xyxy.T
    count, kept = np.zeros(len(lines), np.int64), np.flatnonzero((left <= right) & (top <= low))
    if len(kept):  # many lines lie outside the bounds
        cells = _wide_cells_in if lines.radius else _thin_cells_in
        count[kept] = cells(lines.take(kept), box_xyxy[kept], None if ends is None else ends.take(kept))
    return count


def _thin_cells_in(lines: Lines, box_xyxy: Ints, ends: Terminations | None) -> Ints:
    """`cells_in` of thin lines, in boxes that are not empty."""
    borders = Borders.of(lines)
    time = borders.last if ends is None else np.minimum(ends.time - 1, borders.last)
    cut = np.flatnonzero((box_xyxy != lines.box_xyxy).any(axis=1))
    count = borders.cells_by(time)
    if len(cut):
        count[cut] = borders.take(cut).cells_in(box_xyxy[cut], time[cut])
    return count if ends is None else count + _last_cells(lines, box_xyxy, ends)


def _last_cells(lines: Lines, box_xyxy: Ints, ends: Terminations) -> Ints:
    """Number of cells that thin lines reach of those which they enter at the time of their end: beside the last one."""
    near = np.arange(-1, 2)
    line = np.arange(len(lines)).repeat(9)
    x = (ends.x[:, None] + np.tile(near, 3)).ravel()
    y = (ends.y[:, None] + near.repeat(3)).ravel()
    entry, leave = lines.times(line, x, y)
    counted = (entry <= leave) & (entry == ends.time[line]) & ends.reaches(line, entry, y, x)
    left, top, right, low = box_xyxy[line].T
    counted &= (left <= x) & (x <= right) & (top <= y) & (y <= low)
    return np.asarray(counted.reshape(-1, 9).sum(axis=1))


@dataclass(frozen=True, eq=False)
class Borders(Columns):
    """Borders between pixels that thin lines cross, along x and along y, and when; times are those of `Lines`.

    Parameters
    ----------
    first : (n, 2) way to the first border along each axis, 1/256 px; beyond the end along an axis without a step
    across : (n, 2) time that 1/256 px takes
    base, sign : (n, 2) cell before the first border, and whether the next ones are to the right and down, or the others
    last : (n,) time at the end
    still : (n,) whether there is no step along x, or none along y
    phase, period : (n,) time at which a line crosses two borders at once for the first time, or NEVER, and time from
        then to the next
    """

    first: Ints
    across: Ints
    base: Ints
    sign: Ints
    last: Ints
    still: Bools
    phase: Ints
    period: Ints

    @classmethod
    def of(cls, lines: Lines) -> Borders:
        """Borders of lines, which start in pixel (0, 0)."""
        ahead, length = np.where(lines.step > 0, 1, -1), np.abs(lines.step)
        first = np.where(ahead > 0, HALF - lines.start, HALF + lines.start) % SUB
        base = -((ahead > 0) & (first == 0)).astype(np.int64)
        first = np.where((length == 0) & (first > 0), 2, first)  # such a line runs along a border, or crosses none
        across = np.maximum(length, 1)
        last, still = across[:, 0] * across[:, 1], (length[:, 0] == 0) | (length[:, 1] == 0)
        return cls(first, across[:, ::-1], base, ahead, last, still, *_at_once(first, across))

    def crossed(self, time: Ints) -> Ints:
        """Number of borders (n, 2) crossed by a time."""
        return np.asarray(np.maximum((time[:, None] // self.across - self.first) // SUB + 1, 0))

    def cells_by(self, time: Ints) -> Ints:
        """Number of cells that lines have entered by a time: one, and one for each border, and for each two at once.

        A line along an axis has all cells beside it, of one row of pixels or of two.
        """
        corners, (x, y) = np.maximum((time - self.phase) // self.period + 1, 0), self.crossed(time).T
        count = np.where(self.still, (1 + x) * (1 + y), 1 + x + y + corners)
        return np.where(time < 0, 0, count)

    def cells_in(self, box_xyxy: Ints, time: Ints) -> Ints:
        """Number of cells in boxes (n, 4) that lines have entered by a time.

        They are those up to the far sides of the box along both axes, without those before its near sides.
        """
        low = np.where(self.sign > 0, box_xyxy[:, :2] - self.base, self.base - box_xyxy[:, 2:])
        high = np.where(self.sign > 0, box_xyxy[:, 2:] - self.base, self.base - box_xyxy[:, :2])
        all_ = self.crossed(self.last)
        low, high = np.clip(low, 0, all_ + 1) - 1, np.clip(high, -1, all_)
        (x, y), (x_before, y_before) = high.T, low.T
        count = self._up_to(x, y, time) - self._up_to(x_before, y, time)
        return np.asarray(count - self._up_to(x, y_before, time) + self._up_to(x_before, y_before, time))

    def _up_to(self, x: Ints, y: Ints, time: Ints) -> Ints:
        """Number of cells entered by a time, after at most `x` borders along x, and `y` along y."""
        most = np.stack([x, y], axis=1)
        left_x, left_y = np.where(most < self.crossed(self.last), (self.first + SUB * most) * self.across, NEVER).T
        out = np.minimum(left_x, left_y)
        at_once = (left_x != left_y) & (out >= self.phase) & ((out - self.phase) % self.period == 0)
        count = np.where(time < out, self.cells_by(time), self.cells_by(out - 1) + (at_once & (out <= time)))
        beside_x, beside_y = 1 + np.minimum(self.crossed(np.where(self.still, time, 0)), most).T
        count = np.where(self.still | (out == 0), beside_x * beside_y, count)  # or of a line that leaves as it starts
        return np.where((x < 0) | (y < 0) | (time < 0), 0, count)


def _at_once(first: Ints, length: Ints) -> tuple[Ints, Ints]:
    """Times at which lines cross two borders at once: the first, and from each to the next.

    Along x they have then come m * p, along y m * q, where p and q are the steps by their greatest common divisor. So
    m * p = first_x and m * q = first_y modulo 256; one of p and q is odd, and has an inverse.
    """
    common = np.gcd(*length.T)
    p, q = (length // common[:, None]).T
    odd = np.where(p & 1, p, q)
    inverse = odd.copy()
    for _ in range(2):  # of 3 bits, 6, 12: Newton's method
        inverse = inverse * (2 - odd * inverse) % (2 * SUB)
    m = np.where(p & 1, first[:, 0], first[:, 1]) % SUB * inverse % SUB
    both = ((m * p - first[:, 0]) % SUB == 0) & ((m * q - first[:, 1]) % SUB == 0)
    unit = common * p * q
    return np.where(both, unit * m, NEVER), unit * SUB


def _wide_cells_in(lines: Lines, box_xyxy: Ints, ends: Terminations | None) -> Ints:
    """`cells_in` of wide lines."""
    if ends is not None:  # nothing beyond the end
        fraction = np.minimum(ends.time, lines.length2) / np.maximum(lines.length2, 1)
        short = Lines(lines.start, np.rint(lines.step * fraction[:, None]).astype(np.int64), lines.radius + SUB)
        low, high = np.maximum(box_xyxy, short.box_xyxy)[:, :2], np.minimum(box_xyxy, short.box_xyxy)[:, 2:]
        box_xyxy = np.concatenate([low, high], axis=1)
    size = np.maximum(box_xyxy[:, 2:] - box_xyxy[:, :2] + 1, 0)
    parts = pieces(size.min(axis=1) + 2 * lines.radius // SUB, CHUNK_SAMPLES) if len(lines) else []
    found = [np.zeros(0, np.int64)]
    for part in parts:
        found.append(_in_rows(lines.take(part), box_xyxy[part], None if ends is None else ends.take(part)))
    return np.concatenate(found)


def _in_rows(lines: Lines, box_xyxy: Ints, ends: Terminations | None) -> Ints:
    """`_wide_cells_in` of some lines: rows of cells that a line passes before its end, and cells at its two ends."""
    line, row, first, last = lines.runs(box_xyxy)
    u, v, along, aside = lines.flat
    time = lines.length2 if ends is None else np.minimum(ends.time - 1, lines.length2)
    begin = (SUB * first - u[line]) * along[line] + (SUB * row - v[line]) * aside[line]
    step, forward = SUB * np.maximum(np.abs(along), 1)[line], along[line] >= 0
    far = begin + np.where(forward, 1, -1) * step * (last - first)
    begin, far = np.minimum(begin, far), np.maximum(begin, far)  # when the line passes the first centre, and the last
    count, sure = last - first + 1, lines.radius >= DIAGONAL
    whole = (lines.length2[line] > 0) & (begin >= 0) & (far <= time[line]) & sure
    found = np.bincount(line[whole], count[whole], len(lines)).astype(np.int64)
    rest = np.flatnonzero(~whole & (begin <= time[line] + lines.wide_sides[line] + 1))
    line, row, first, last, count = (column[rest] for column in (line, row, first, last, count))
    begin, step, forward = begin[rest], step[rest], forward[rest]
    passed = np.maximum(time[line] - begin, -1) // step + 1
    before = np.where(begin < 0, -(begin // step), 0)
    before = np.where(lines.length2[line] > 0, np.minimum(before, count), count) if sure else count
    passed = np.clip(passed, before, count)
    close = (np.maximum(time[line] + lines.wide_sides[line] + 1 - begin, -1)) // step + 1
    close = np.clip(close, passed, count)
    found += np.bincount(line, passed - before, len(lines)).astype(np.int64)
    for a, b in ((np.zeros_like(before), before), (passed, close)):
        run, place = each_pixel(a, b - 1)
        cell = np.where(forward[run], first[run] + place, last[run] - place)
        of = line[run]
        steep = lines.steep[of]
        x, y = np.where(steep, row[run], cell), np.where(steep, cell, row[run])
        entry, leave = lines.times(of, x, y)
        touched = entry <= leave
        if ends is not None:
            touched &= ends.reaches(of, entry, y, x)
        found += np.bincount(of[touched], minlength=len(lines))
    return found


def _met(walk: Walk, filters: Filters | None, bounds: Box | None) -> Ints:
    """Number of cells (R, 3) of rays that are hit, occluded, and filtered."""
    n, ends = len(walk.rays), walk.ends
    stopped = ends.reason == Reason.OCCLUDER
    counts = np.stack([np.bincount(walk.hit.ray, walk.hit.count, n).astype(np.int64), stopped, np.zeros(n, np.int64)])
    skipped = _skipped(walk, filters, bounds)
    listed = _several_in_cells(walk)
    listed[skipped >> 2 * REACH_BITS] = True
    rays = np.flatnonzero(listed)
    if not len(rays):
        return counts.T
    cells = walk.of_rays(rays).walked
    hits = sorted_once(key_of_cells(rays[cells.ray[cells.pair]], cells.x, cells.y))
    ended = rays[stopped[rays]]
    stops = key_of_cells(ended, ends.x[ended], ends.y[ended])
    stops, skipped = (np.setdiff1d(keys, hits, assume_unique=True) for keys in (stops, skipped))
    for row, keys in enumerate((hits, stops, np.setdiff1d(skipped, stops, assume_unique=True))):
        counts[row, rays] = np.bincount(keys >> 2 * REACH_BITS, minlength=n)[rays]
    return counts.T


def _several_in_cells(walk: Walk) -> Bools:
    """Whether rays (R,) may meet several items in a cell: they are in several boxes at once, or stop in one."""
    hit, lines, ends = walk.hit, walk.lines, walk.ends
    ray, x, y = hit.ray, ends.x[hit.ray], ends.y[hit.ray]
    box = walk.stack.box_xyxy[hit.rank] - np.tile(walk.rays.origin_xy[ray], 2)
    several = np.zeros(len(lines), np.bool_)
    several[ray[meets(box, np.stack([x, y, x, y], axis=1)) & (ends.reason[ray] == Reason.OCCLUDER)]] = True
    scale, behind = lines.scale[ray], 4.0 * ray  # each ray begins after the one before has ended
    near = behind + hit.entry / scale - SLACK
    far = behind + np.minimum(times_in(lines, ray, box)[1] / scale, 2) + SLACK
    several[ray[1:][near[1:] <= np.maximum.accumulate(far)[:-1]]] = True
    return several


def _skipped(walk: Walk, filters: Filters | None, bounds: Box | None) -> Ints:
    """Keys of the cells of items that the filter refuses, before the ends of rays."""
    keys = [np.zeros(0, np.int64)]
    if filters is None:
        return keys[0]
    for begin in range(0, len(walk.rays), RAYS_AT_ONCE):
        part = slice(begin, begin + RAYS_AT_ONCE)
        rays, own, ends = walk.rays.take(part), walk.lines.take(part), walk.ends.take(part)
        lines = replace(own, start=rays.start_256)
        near = near_items(walk.stack, bounds, lines, own, rays.origin_xy, None)
        near = near.take(refused_by(filters, walk.stack, near.rank, near.ray + begin))
        met = find_contacts(own.take(near.ray), near.ray, near.rank, walk.stack, bounds, rays.origin_xy[near.ray])
        ray = met.ray[met.pair]
        before = ends.reaches(ray, met.entry, met.y, met.x)
        keys.append(sorted_once(key_of_cells(ray[before] + begin, met.x[before], met.y[before])))
    return np.concatenate(keys)
