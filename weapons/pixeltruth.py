"""What discs, rays and flying discs touch, worked out slowly: every pixel of every object, in whole numbers.

The truth that methods are judged by: it shares no code with them, and imports numpy alone. But for the discs, lengths
are in 1/256 px; pixel (x, y) is the closed square of side 256 around (256 x, 256 y). Times of flights are parts of the
frame. An object that moves by w while a disc moves by v is met by a disc that moves by d = v - w; at time t it touches
a pixel if the pixel's centre lies within the radius of a + t d, or if a + t d lies in the pixel's square.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Flights", "Impacts", "Parts", "first_pixels", "flown", "impacts", "parts_of_discs", "touching"]

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Target = tuple[int, Bools, tuple[int, int]]
"""An object's number, its mask (h, w), and the pixel (x, y) of the world at [0, 0]."""

PX, HALF = 256, 128
ONE = 2**30
FINE = 2**320
SAME = Fraction(1, 2**256)
"""Roots are cut off at 1 / FINE. Times nearer than SAME are equal: two roots of the quadratics below, whose
coefficients are below 2**62, differ by more than 2**-250 or not at all."""

SLACK = 2.0**-20
"""Floats sort out what may be first. Near a touch that only grazes, half of their digits are lost to the root: 2**-25
of the radius as a part of the way."""


def _boxes(targets: Sequence[Target]) -> Ints:
    """First and last pixel centres (M, 4) of masks."""
    boxes = [[x, y, x + mask.shape[1] - 1, y + mask.shape[0] - 1] for _, mask, (x, y) in targets]
    return PX * np.array(boxes, np.int64).reshape(-1, 4)


def _between(target: Target, low: Ints, high: Ints) -> Ints:
    """Pixels (K, 2) of a mask whose centres lie between two corners."""
    _, mask, corner = target
    x, y = np.maximum(-(-low // PX) - corner, 0)
    x_end, y_end = np.maximum(high // PX - corner + 1, 0)
    return np.asarray(np.argwhere(mask[y:y_end, x:x_end])[:, ::-1] + (x, y) + corner)


# --- discs -----------------------------------------------------------------------------------------------------------


class Parts(NamedTuple):
    """Discs and objects that share pixels: the disc (K,), the object (K,), how many, the nearest pixel (K, 2).

    The nearest is that to the disc's own; of several the least (y, x). `whole` is how many pixels a disc has.
    """

    disc: Ints
    object: Ints
    pixels: Ints
    nearest_xy: Ints
    whole: int


def parts_of_discs(center_xy: Ints, radius: int, targets: Sequence[Target]) -> Parts:
    """Count the pixels that discs share with objects, whatever lies in front of what.

    Parameters
    ----------
    center_xy : (N, 2) whole pixels
    radius : px; a pixel belongs to a disc when its centre is no farther away
    targets : in any order
    """
    side = np.arange(-radius, radius + 1)
    y, x = (grid.ravel() for grid in np.meshgrid(side, side, indexing="ij"))
    inside = x * x + y * y <= radius * radius
    xy = np.stack([x, y], axis=1)[inside]
    xy = xy[np.lexsort((xy[:, 0], xy[:, 1], (xy * xy).sum(axis=1)))]  # the nearest first
    found = []
    for number, mask, corner in targets:
        size = np.array(mask.shape[::-1])
        first = center_xy - np.array(corner)
        for disc in np.flatnonzero(((first >= -radius) & (first < size + radius)).all(axis=1)).tolist():
            at = first[disc] + xy
            on = np.flatnonzero(((at >= 0) & (at < size)).all(axis=1))
            on = on[mask[at[on, 1], at[on, 0]]]
            if len(on):
                found.append((disc, number, len(on), *(center_xy[disc] + xy[on[0]]).tolist()))
    rows = np.array(found, np.int64).reshape(-1, 5)
    return Parts(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3:], len(xy))


# --- rays ------------------------------------------------------------------------------------------------------------


def first_pixels(start_256: Ints, step_256: Ints, targets: Sequence[Target]) -> tuple[Ints, Ints, Ints]:
    """Find the first pixel that each closed segment touches.

    The first is that which is entered first; of those entered at once the least (y, x), and there the front-most
    object.

    Parameters
    ----------
    start_256, step_256 : (N, 2) where segments begin, and from there to their ends; up to 2**28
    targets : front to back

    Returns
    -------
    segments (K,) that touch anything, rising; the number of the object (K,); the pixel (K, 2)
    """
    box = _boxes(targets)
    found: list[tuple[int, int, int, int]] = []
    for shot, (start, step) in enumerate(zip(start_256, step_256, strict=True)):
        low, high = np.minimum(start, start + step) - HALF, np.maximum(start, start + step) + HALF
        near = np.flatnonzero((box[:, :2] <= high).all(axis=1) & (box[:, 2:] >= low).all(axis=1))
        if not len(near):
            continue
        pixels = [_between(targets[rank], low, high) for rank in near.tolist()]
        xy, rank = np.concatenate(pixels), np.repeat(near, [len(some) for some in pixels])
        time, met = _entries(PX * xy - start, step)
        if len(met):
            first = met[np.lexsort((rank[met], xy[met, 0], xy[met, 1], time))[0]]
            found.append((shot, targets[rank[first]][0], int(xy[first, 0]), int(xy[first, 1])))
    rows = np.array(found, np.int64).reshape(-1, 4)
    return rows[:, 0], rows[:, 1], rows[:, 2:]


def _entries(away: Ints, step: Ints) -> tuple[Ints, Ints]:
    """When a segment enters squares around centres `away` (K, 2) from its start, and the rows of those it touches.

    Times are whole numbers over one scale. A segment and a square meet unless their shadows on x, on y, or across the
    segment are apart; it enters where it comes to the later of the sides that face it.
    """
    low, high = np.minimum(step, 0) - HALF, np.maximum(step, 0) + HALF
    cross = away[:, 0] * step[1] - away[:, 1] * step[0]
    apart = ((away < low) | (away > high)).any(axis=1) | (np.abs(cross) > HALF * np.abs(step).sum())
    met = np.flatnonzero(~apart)
    times = np.zeros((len(met), 3), np.int64)
    for axis in np.flatnonzero(step):
        other = max(abs(int(step[1 - axis])), 1)
        times[:, axis] = (away[met, axis] * np.sign(step[axis]) - HALF) * other
    return times.max(axis=1), met


# --- flying discs ----------------------------------------------------------------------------------------------------


class Flights(NamedTuple):
    """Discs of one radius: where they begin and how far they go in a frame, (N, 2)."""

    start_256: Ints
    step_256: Ints
    radius_256: int


class Impacts(NamedTuple):
    """First touches, by rising flight: the flight (K,), the object (K,), when (K,), the pixel (K, 2)."""

    flight: Ints
    object: Ints
    time: Floats
    pixel_xy: Ints


class _Near(NamedTuple):
    """Pixels that one flight may touch: from its start to their centres, how it moves relative to each, and whose."""

    away: Ints
    step: Ints
    xy: Ints
    rank: Ints


def flown(speed_256: int, toward_256: Ints) -> Ints:
    """Where flights along vectors (N, 2), none of them zero, end after a frame.

    The direction is rounded to 2**-30, then the end to 1/256 px, half to even, once each.
    """
    ends = [[_along(speed_256, c, x * x + y * y) for c in (x, y)] for x, y in toward_256.tolist()]
    return np.array(ends, np.int64).reshape(-1, 2)


def _along(speed_256: int, part: int, square: int) -> int:
    cosine = (math.isqrt(4 * ONE * ONE * part * part // square) + 1) // 2
    return round(Fraction(cosine * speed_256 * (1 if part > 0 else -1), ONE))


def impacts(flights: Flights, targets: Sequence[Target], velocity_256: Ints) -> Impacts:
    """Find what each disc touches first.

    Of pixels touched at once it is the least (y, x), and there the front-most object.

    Parameters
    ----------
    flights : up to 2**29 with all velocities added
    targets : front to back
    velocity_256 : (M, 2) of the targets: how far they move in the frame
    """
    found = []
    for number, near in _nearby(flights, targets, velocity_256):
        first = _first(near, flights.radius_256)
        if first is not None:
            time, row = first
            found.append((number, targets[near.rank[row]][0], time, *near.xy[row].tolist()))
    columns = list(zip(*found, strict=True)) or [()] * 5
    whole = [np.array(columns[i], np.int64) for i in (0, 1, 3, 4)]
    return Impacts(whole[0], whole[1], np.array(columns[2], np.float64), np.stack(whole[2:], axis=1))


def touching(points_256: Ints, radius_256: int, targets: Sequence[Target]) -> Bools:
    """Whether discs that rest on points (N, 2) touch any target."""
    resting = Flights(points_256, np.zeros_like(points_256), radius_256)
    inside = np.zeros(len(points_256), np.bool_)
    for number, near in _nearby(resting, targets, np.zeros((len(targets), 2), np.int64)):
        inside[number] = np.isfinite(_times(near, radius_256)).any()
    return inside


def _nearby(flights: Flights, targets: Sequence[Target], velocity_256: Ints) -> Iterator[tuple[int, _Near]]:
    """For each flight the pixels in the box around its way, as each target sees it, that it could touch first.

    Those are the pixels about its start, and farther on those at a rim: a disc that comes to a pixel with all eight
    neighbours has come to one of them before.
    """
    box, rims = _boxes(targets), [_rim(target) for target in targets]
    reach = max(flights.radius_256, HALF)
    for number, (start, step) in enumerate(zip(flights.start_256, flights.step_256, strict=True)):
        relative = step - velocity_256.reshape(-1, 2)
        low, high = start + np.minimum(relative, 0) - reach, start + np.maximum(relative, 0) + reach
        near = np.flatnonzero((box[:, :2] <= high).all(axis=1) & (box[:, 2:] >= low).all(axis=1))
        pixels = [
            np.concatenate([_between(targets[k], start - reach, start + reach), _within(rims[k], low[k], high[k])])
            for k in near.tolist()
        ]
        if any(map(len, pixels)):
            xy, rank = np.concatenate(pixels), np.repeat(near, [len(some) for some in pixels])
            yield number, _Near(PX * xy - start, relative[rank], xy, rank)


def _rim(target: Target) -> Ints:
    """Pixels (K, 2) of the world that lack one of their eight neighbours."""
    _, mask, corner = target
    h, w = mask.shape
    wide = np.pad(mask, 1)
    inner = np.all([wide[y : y + h, x : x + w] for y in range(3) for x in range(3)], axis=0)
    return np.asarray(np.argwhere(mask & ~inner)[:, ::-1] + corner)


def _within(xy: Ints, low: Ints, high: Ints) -> Ints:
    """Pixels whose centres lie between two corners."""
    return xy[((PX * xy >= low) & (PX * xy <= high)).all(axis=1)]


def _first(near: _Near, radius: int) -> tuple[float, int] | None:
    """When the first pixel is touched, and its row; None if none is."""
    about = _times(near, radius)
    if not np.isfinite(about).any():
        return None
    length = np.maximum(np.sqrt((near.step.astype(np.float64) ** 2).sum(axis=1)), 1)
    slack = SLACK * (1 + radius / length)
    could = np.flatnonzero(about - slack <= (about + slack).min())
    exact = {int(row): _time(near.away[row].tolist(), near.step[row].tolist(), radius) for row in could}
    least = min(exact.values())
    row = min(
        (row for row, time in exact.items() if time - least <= SAME),
        key=lambda row: (*near.xy[row, ::-1].tolist(), int(near.rank[row])),
    )
    return float(least), row


def _times(near: _Near, radius: int) -> Floats:
    """When the disc comes to pixels, in floats; infinite, exactly, for those it does not come to."""
    about = _disc_times(near, radius)
    if radius * radius < 2 * HALF * HALF:  # a larger disc has the centre of each square in which its own centre lies
        about = np.minimum(about, _square_times(near))
    return about


def _disc_times(near: _Near, radius: int) -> Floats:
    """When the disc comes to the centres of pixels, in floats; infinite, exactly, for those it does not come to."""
    away, step = near.away, near.step
    square, along = (step * step).sum(axis=1), (away * step).sum(axis=1)
    cross = np.abs(away[:, 0] * step[:, 1] - away[:, 1] * step[:, 0])
    different, which = np.unique(square, return_inverse=True)
    side = np.array([math.isqrt(radius * radius * one) for one in different.tolist()])[which]
    begins = (away * away).sum(axis=1) <= radius * radius
    ends = ((away - step) ** 2).sum(axis=1) <= radius * radius
    passes = (along > 0) & (along < square) & (cross <= side)
    reach = radius * np.sqrt(square.astype(np.float64))
    root = np.sqrt(np.maximum((reach - cross) * (reach + cross), 0))
    time = np.where(begins, 0, (along - root) / np.maximum(square, 1))
    return np.where(begins | ends | passes, time, np.inf)


def _square_times(near: _Near) -> Floats:
    """When the disc's centre comes to the squares of pixels, in floats; infinite, exactly, where it does not."""
    away, step = near.away, near.step
    low, high = np.minimum(step, 0) - HALF, np.maximum(step, 0) + HALF
    cross = np.abs(away[:, 0] * step[:, 1] - away[:, 1] * step[:, 0])
    apart = ((away < low) | (away > high)).any(axis=1) | (cross > HALF * np.abs(step).sum(axis=1))
    sides = (away * np.sign(step) - HALF) / np.maximum(np.abs(step), 1)
    return np.where(apart, np.inf, np.maximum(np.where(step == 0, 0, sides).max(axis=1), 0))


def _time(away: list[int], step: list[int], radius: int) -> Fraction:
    """When one pixel, which is touched, is first touched."""
    return min(time for time in (_disc_time(away, step, radius), _square_time(away, step)) if time is not None)


def _disc_time(away: list[int], step: list[int], radius: int) -> Fraction | None:
    """First t in [0, 1] with |t d - away| <= radius: the smaller root, or 0 inside of it."""
    square, along = step[0] ** 2 + step[1] ** 2, away[0] * step[0] + away[1] * step[1]
    apart = away[0] ** 2 + away[1] ** 2 - radius * radius
    if apart <= 0:
        return Fraction(0)
    under = along * along - square * apart
    if under < 0 or along <= 0:
        return None
    if along > square and square - 2 * along + apart > 0:  # at the end it still comes nearer, and is not there
        return None
    return Fraction(along * FINE - math.isqrt(under * FINE * FINE), square * FINE)


def _square_time(away: list[int], step: list[int]) -> Fraction | None:
    entry, leave = Fraction(0), Fraction(1)
    for far, d in zip(away, step, strict=True):
        if d == 0 and abs(far) > HALF:
            return None
        if d:
            sides = sorted((Fraction(far - HALF, d), Fraction(far + HALF, d)))
            entry, leave = max(entry, sides[0]), min(leave, sides[1])
    return entry if entry <= leave else None
