"""True answers of the study: what discs, rays and flying discs touch, computed slowly from all pixels or exact shapes.

It shares no code with the methods that it judges, and imports only numpy. Apart from discs, lengths are in 1/256 px,
and pixel (x, y) is the closed square of side 256 around (256 x, 256 y).

The time of a flight is a fraction of the frame. If a disc moves by v and an object by w, the disc moves by d = v - w
relative to the object. At time t it touches a pixel if the pixel's centre lies within the radius of a + t d, or if
a + t d lies in the pixel's square.

Exact shapes are tested in float64: inside by the even-odd rule, distance by the nearest point of the edges, and the
area shared with a disc by strips.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Target = tuple[int, Bools, tuple[int, int]]  # an object's number, its mask (h, w), and the pixel of the world at [0, 0]

PX, HALF, ONE = 256, 128, 2**30
FINE = 2**320  # roots are truncated to multiples of 1 / FINE
SAME = Fraction(1, 2**256)
"""Times closer than this are equal: different roots of the quadratics below, whose coefficients are below 2**62, differ
by more than 2**-250."""
SLACK = 2.0**-20
"""Tolerance by which floats preselect the first touch. A grazing touch loses half of the digits of the root, which is
2**-25 of the radius."""


def _between(target: Target, low: Ints, high: Ints) -> Ints:
    """Return the pixels (K, 2) of a mask whose centres lie between two corners."""
    _, mask, corner = target
    x, y = np.maximum(-(-low // PX) - corner, 0)
    x_end, y_end = np.maximum(high // PX - corner + 1, 0)
    return np.asarray(np.argwhere(mask[y:y_end, x:x_end])[:, ::-1] + (x, y) + corner)


# Discs


class Touched(NamedTuple):
    """Hits as columns: shot and object (K,), px of the object nearest to the shot (K, 2), share of the disc (K,)."""

    shot: Ints
    object: Ints
    xy: Floats
    share: Floats

    @classmethod
    def of(cls, found: Sequence[tuple[float, ...]]) -> Touched:
        """Make columns of rows (shot, object, x, y, share)."""
        table = np.array(found, np.float64).reshape(-1, 5)
        shot, item = table[:, :2].T.astype(np.int64)
        return cls(shot, item, table[:, 2:4], table[:, 4])


def parts_of_discs(center_xy: Ints, radius: int, targets: Sequence[Target]) -> Touched:
    """Count the pixels that discs around whole pixels (N, 2) share with objects, regardless of objects in front.

    A pixel belongs to a disc when its centre is no farther away than the radius, px. Of several nearest pixels the
    least (y, x) is returned.
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
                found.append((disc, number, *(center_xy[disc] + xy[on[0]]).tolist(), len(on) / len(xy)))
    return Touched.of(found)


# Flying discs, and rays, which are those of radius 0


class Flights(NamedTuple):
    """Flying discs of one radius, or rays: starts, and steps in a frame, (N, 2)."""

    start_256: Ints
    step_256: Ints
    radius_256: int


class Impacts(NamedTuple):
    """First touches, in order of flight: flight, object and time (K,), pixel (K, 2)."""

    flight: Ints
    object: Ints
    time: Floats
    pixel_xy: Ints


class _Near(NamedTuple):
    """Pixels that a flight may touch: offsets from its start, relative steps, positions, and ranks of their targets."""

    away: Ints
    step: Ints
    xy: Ints
    rank: Ints


def flown(speed_256: int, toward_256: Ints) -> Ints:
    """Return the steps in a frame of flights along nonzero vectors (N, 2).

    The direction is rounded to 2**-30, then the end to 1/256 px, half to even.
    """
    ends = []
    for x, y in toward_256.tolist():
        cosines = [(math.isqrt(4 * ONE * ONE * c * c // (x * x + y * y)) + 1) // 2 for c in (x, y)]
        signed = [k if c > 0 else -k for k, c in zip(cosines, (x, y), strict=True)]
        ends.append([round(Fraction(k * speed_256, ONE)) for k in signed])
    return np.array(ends, np.int64).reshape(-1, 2)


def impacts(flights: Flights, targets: Sequence[Target], velocity_256: Ints | None = None) -> Impacts:
    """Find the first touch of each disc; coordinates are up to 2**29, all velocities (M, 2) of moving targets added.

    Of several pixels touched at once it is the least (y, x), with the front-most object there: targets are given front
    to back.
    """
    found = []
    for number, near in _nearby(flights, targets, velocity_256):
        first = _first(near, flights.radius_256)
        if first is not None:
            time, row = first
            found.append((number, targets[near.rank[row]][0], time, *near.xy[row].tolist()))
    rows = np.array(found, np.float64).reshape(-1, 5)
    whole = rows.astype(np.int64)
    return Impacts(whole[:, 0], whole[:, 1], rows[:, 2], whole[:, 3:])


def touching(points_256: Ints, radius_256: int, targets: Sequence[Target]) -> Bools:
    """Whether resting discs at points (N, 2) touch any target."""
    resting = Flights(points_256, np.zeros_like(points_256), radius_256)
    inside = np.zeros(len(points_256), np.bool_)
    for number, near in _nearby(resting, targets, None):
        inside[number] = np.isfinite(_times(near, radius_256)).any()
    return inside


def _nearby(flights: Flights, targets: Sequence[Target], velocity_256: Ints | None) -> Iterator[tuple[int, _Near]]:
    """Yield the pixels that each flight could touch first, from the box around its path relative to each target.

    These are all pixels near its start, and elsewhere those at a rim: a disc that reaches a pixel with eight neighbours
    has reached one of them before.
    """
    corners = [[x, y, x + mask.shape[1] - 1, y + mask.shape[0] - 1] for _, mask, (x, y) in targets]
    box, rims = PX * np.array(corners, np.int64).reshape(-1, 4), [_rim(target) for target in targets]
    reach = max(flights.radius_256, HALF)
    velocity = np.zeros((len(targets), 2), np.int64) if velocity_256 is None else velocity_256
    for number, (start, step) in enumerate(zip(flights.start_256, flights.step_256, strict=True)):
        relative = step - velocity.reshape(-1, 2)
        low, high = start + np.minimum(relative, 0) - reach, start + np.maximum(relative, 0) + reach
        near = np.flatnonzero((box[:, :2] <= high).all(axis=1) & (box[:, 2:] >= low).all(axis=1))
        pixels = []
        for k in near.tolist():
            rim = rims[k][((PX * rims[k] >= low[k]) & (PX * rims[k] <= high[k])).all(axis=1)]
            pixels.append(np.concatenate([_between(targets[k], start - reach, start + reach), rim]))
        if any(map(len, pixels)):
            xy, rank = np.concatenate(pixels), np.repeat(near, [len(rows) for rows in pixels])
            yield number, _Near(PX * xy - start, relative[rank], xy, rank)


def _rim(target: Target) -> Ints:
    """Return the pixels (K, 2) of a target, in the world, that lack one of their eight neighbours."""
    _, mask, corner = target
    h, w = mask.shape
    wide = np.pad(mask, 1)
    inner = np.all([wide[y : y + h, x : x + w] for y in range(3) for x in range(3)], axis=0)
    return np.asarray(np.argwhere(mask & ~inner)[:, ::-1] + corner)


def _first(near: _Near, radius: int) -> tuple[float, int] | None:
    """Return the time of the first touch and its row; None if no pixel is touched."""
    about = _times(near, radius)
    if not np.isfinite(about).any():
        return None
    length = np.maximum(np.sqrt((near.step.astype(np.float64) ** 2).sum(axis=1)), 1)
    slack = SLACK * (1 + radius / length)
    could = np.flatnonzero(about - slack <= (about + slack).min())
    exact = {}
    for row in could.tolist():
        away, step = near.away[row].tolist(), near.step[row].tolist()
        exact[row] = min(t for t in (_disc_time(away, step, radius), _square_time(away, step)) if t is not None)
    least = min(exact.values())
    row = min(
        (row for row, time in exact.items() if time - least <= SAME),
        key=lambda row: (*near.xy[row, ::-1].tolist(), int(near.rank[row])),
    )
    return float(least), row


def _times(near: _Near, radius: int) -> Floats:
    """Return when the disc touches pixels: approximate times, and inf exactly for those that it misses."""
    away, step = near.away, near.step
    square, along = (step * step).sum(axis=1), (away * step).sum(axis=1)
    cross = np.abs(away[:, 0] * step[:, 1] - away[:, 1] * step[:, 0])
    different, which = np.unique(square, return_inverse=True)
    side = np.array([math.isqrt(radius * radius * value) for value in different.tolist()])[which]
    begins = (away * away).sum(axis=1) <= radius * radius
    ends = ((away - step) ** 2).sum(axis=1) <= radius * radius
    passes = (along > 0) & (along < square) & (cross <= side)
    reach = radius * np.sqrt(square.astype(np.float64))
    root = np.sqrt(np.maximum((reach - cross) * (reach + cross), 0))
    centre = np.where(begins | ends | passes, np.where(begins, 0, (along - root) / np.maximum(square, 1)), np.inf)
    if radius * radius >= 2 * HALF * HALF:  # it reaches the pixel's centre before its own enters the square
        return centre
    low, high = np.minimum(step, 0) - HALF, np.maximum(step, 0) + HALF
    apart = ((away < low) | (away > high)).any(axis=1) | (cross > HALF * np.abs(step).sum(axis=1))
    sides = (away * np.sign(step) - HALF) / np.maximum(np.abs(step), 1)
    square_entered = np.where(apart, np.inf, np.maximum(np.where(step == 0, 0, sides).max(axis=1), 0))
    return np.minimum(centre, square_entered)


def _disc_time(away: list[int], step: list[int], radius: int) -> Fraction | None:
    """Return the first t in [0, 1] with |t d - away| <= radius; None if there is none."""
    square, along = step[0] ** 2 + step[1] ** 2, away[0] * step[0] + away[1] * step[1]
    apart = away[0] ** 2 + away[1] ** 2 - radius * radius
    if apart <= 0:
        return Fraction(0)
    under = along * along - square * apart
    if under < 0 or along <= 0:
        return None
    if along > square and square - 2 * along + apart > 0:  # at the end it is still approaching
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


STRIPS = 1024  # into which a disc is cut; the error of a share is about STRIPS**-1.5, or 1 in 30,000


@dataclass(frozen=True, eq=False)
class Round:
    """A circle in the world, px."""

    center_xy: Floats
    radius: float

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Corners of the box around it."""
        return self.center_xy - self.radius, self.center_xy + self.radius

    def meets(self, at: Floats, radius: float) -> bool:
        """Whether a disc touches it, by the distance of the centres, as the nearest point is rounded."""
        return bool(((at - self.center_xy) ** 2).sum() <= (self.radius + radius) ** 2)

    def nearest(self, at: Floats) -> Floats:
        """Return its point nearest to `at`."""
        away = at - self.center_xy
        far = math.sqrt(float((away**2).sum()))
        return at if far <= self.radius else np.asarray(self.center_xy + away * (self.radius / far))

    def chords(self, y: Floats, low: Floats, high: Floats) -> Floats:
        """Return the lengths that it covers of horizontal lines at `y`, from `low` to `high`."""
        half = np.sqrt(np.maximum(self.radius**2 - (y - self.center_xy[1]) ** 2, 0))
        x = self.center_xy[0]
        return np.asarray(np.maximum(np.minimum(high, x + half) - np.maximum(low, x - half), 0))


@dataclass(frozen=True, eq=False)
class Straight:
    """A polygon of one or more rings in the world, px, filled by the even-odd rule."""

    rings: tuple[Floats, ...]

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Corners of the box around it."""
        points = np.concatenate(self.rings)
        return points.min(axis=0), points.max(axis=0)

    @property
    def edges(self) -> tuple[Floats, Floats]:
        """Begins and ends of all edges."""
        return np.concatenate(self.rings), np.concatenate([np.roll(ring, -1, axis=0) for ring in self.rings])

    def meets(self, at: Floats, radius: float) -> bool:
        """Whether a disc touches it."""
        return bool(((self.nearest(at) - at) ** 2).sum() <= radius * radius)

    def nearest(self, at: Floats) -> Floats:
        """Return its point nearest to `at`, which is `at` itself if that lies inside."""
        begin, end = self.edges
        straddles = (begin[:, 1] > at[1]) != (end[:, 1] > at[1])
        a, b = begin[straddles], end[straddles]
        crossing = a[:, 0] + (at[1] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
        if (crossing > at[0]).sum() % 2:
            return at
        along = end - begin
        square = (along**2).sum(axis=1)
        part = ((at - begin) * along).sum(axis=1) / np.where(square > 0, square, 1.0)
        foot = begin + along * np.clip(part, 0, 1)[:, None]
        return np.asarray(foot[((foot - at) ** 2).sum(axis=1).argmin()])

    def chords(self, y: Floats, low: Floats, high: Floats) -> Floats:
        """Return the lengths that it covers of horizontal lines at `y`, from `low` to `high`."""
        begin, end = self.edges
        straddles = (begin[:, 1] > y[:, None]) != (end[:, 1] > y[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (end[:, 0] - begin[:, 0]) / (end[:, 1] - begin[:, 1])
            x = begin[:, 0] + (y[:, None] - begin[:, 1]) * slope
        x = np.clip(np.sort(np.where(straddles, x, np.inf), axis=1), low[:, None], high[:, None])
        left, right = x[:, :-1:2], x[:, 1::2]  # a line crosses an even number of edges
        return np.asarray((right - left).sum(axis=1))


def placed_rings(
    rings: Sequence[Floats], flip: str, scale_xy: tuple[float, float], degrees: float, position_xy: Floats
) -> tuple[Floats, ...]:
    """Flip, scale, rotate (clockwise on the screen) and move rings around the origin."""
    signs = np.array([-1.0 if "x" in flip else 1.0, -1.0 if flip in ("y", "xy") else 1.0])
    turn = math.radians(degrees)
    c, s = math.cos(turn), math.sin(turn)
    flat = [ring * signs * np.array(scale_xy) for ring in rings]
    return tuple(np.stack([p[:, 0] * c - p[:, 1] * s, p[:, 0] * s + p[:, 1] * c], axis=1) + position_xy for p in flat)


def discs_on_shapes(at: Floats, radius: float, shapes: Sequence[Round | Straight]) -> Touched:
    """Find the closed discs around points (N, 2) that touch closed shapes."""
    found = []
    off = (np.arange(STRIPS) + 0.5) * (2 * radius / STRIPS) - radius
    half = np.sqrt(radius**2 - off**2)
    for k, shape in enumerate(shapes):
        low, high = shape.box
        for shot in np.flatnonzero(((at >= low - radius) & (at <= high + radius)).all(axis=1)).tolist():
            place = at[shot]
            if shape.meets(place, radius):
                chords = shape.chords(place[1] + off, place[0] - half, place[0] + half)
                found.append((shot, k, *shape.nearest(place).tolist(), float(chords.sum() / (2 * half.sum()))))
    return Touched.of(sorted(found))
