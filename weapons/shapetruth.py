"""Which exact shapes does a disc touch? Slow and plain; it shares nothing with the methods that it judges.

In float64: inside by the even-odd rule, the nearest point of the edges, and the area that a shape shares with
the disc, by strips.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Found", "Round", "Straight", "discs_on_shapes", "placed_rings"]

Reals = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

STRIPS = 1024
"""Strips in which a disc is cut: a share is right to about one part in STRIPS**1.5, less than one in 30,000."""


@dataclass(frozen=True, eq=False)
class Found:
    """Hits as columns: shot, number of the object, the place nearest to the shot (K, 2), share of the disc (K,)."""

    shot: Whole
    object: Whole
    xy: Reals
    share: Reals


@dataclass(frozen=True, eq=False)
class Round:
    """A circle in the world, px."""

    center_xy: Reals
    radius: float

    @property
    def box(self) -> tuple[Reals, Reals]:
        """Corners of the box around it."""
        return self.center_xy - self.radius, self.center_xy + self.radius

    def meets(self, at: Reals, radius: float) -> bool:
        """Whether a disc touches it: by both centres, as its nearest point is rounded."""
        return bool(((at - self.center_xy) ** 2).sum() <= (self.radius + radius) ** 2)

    def nearest(self, at: Reals) -> Reals:
        """Its point that is nearest to another."""
        away = at - self.center_xy
        far = math.sqrt(float((away**2).sum()))
        nearest: Reals = at if far <= self.radius else self.center_xy + away * (self.radius / far)
        return nearest

    def chords(self, y: Reals, low: Reals, high: Reals) -> Reals:
        """Lengths of it on horizontal lines, between two places on each."""
        half = np.sqrt(np.maximum(self.radius**2 - (y - self.center_xy[1]) ** 2, 0))
        x = self.center_xy[0]
        return np.asarray(np.maximum(np.minimum(high, x + half) - np.maximum(low, x - half), 0))


@dataclass(frozen=True, eq=False)
class Straight:
    """A polygon of one ring or more in the world, px; inside is what lies within an odd number of them."""

    rings: tuple[Reals, ...]

    @property
    def box(self) -> tuple[Reals, Reals]:
        """Corners of the box around it."""
        points = np.concatenate(self.rings)
        return points.min(axis=0), points.max(axis=0)

    @property
    def edges(self) -> tuple[Reals, Reals]:
        """Begins and ends of all edges."""
        return np.concatenate(self.rings), np.concatenate([np.roll(ring, -1, axis=0) for ring in self.rings])

    def meets(self, at: Reals, radius: float) -> bool:
        """Whether a disc touches it."""
        return bool(((self.nearest(at) - at) ** 2).sum() <= radius * radius)

    def nearest(self, at: Reals) -> Reals:
        """Its point that is nearest to another: the point itself if it lies inside, or one of an edge."""
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
        nearest: Reals = foot[((foot - at) ** 2).sum(axis=1).argmin()]
        return nearest

    def chords(self, y: Reals, low: Reals, high: Reals) -> Reals:
        """Lengths of it on horizontal lines, between two places on each."""
        begin, end = self.edges
        straddles = (begin[:, 1] > y[:, None]) != (end[:, 1] > y[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (end[:, 0] - begin[:, 0]) / (end[:, 1] - begin[:, 1])
            x = begin[:, 0] + (y[:, None] - begin[:, 1]) * slope
        x = np.sort(np.where(straddles, x, np.inf), axis=1)
        if x.shape[1] % 2:
            x = np.append(x, np.full((len(x), 1), np.inf), axis=1)
        left, right = (np.clip(v, low[:, None], high[:, None]) for v in (x[:, ::2], x[:, 1::2]))
        return np.asarray((right - left).sum(axis=1))


def placed_rings(
    rings: Sequence[Reals], flip: str, scale_xy: tuple[float, float], degrees: float, position_xy: Reals
) -> tuple[Reals, ...]:
    """Rings about the origin, flipped, scaled, turned clockwise on the screen, and moved."""
    signs = np.array([-1.0 if "x" in flip else 1.0, -1.0 if flip in ("y", "xy") else 1.0])
    turn = math.radians(degrees)
    c, s = math.cos(turn), math.sin(turn)
    flat = [ring * signs * np.array(scale_xy) for ring in rings]
    return tuple(np.stack([p[:, 0] * c - p[:, 1] * s, p[:, 0] * s + p[:, 1] * c], axis=1) + position_xy for p in flat)


def discs_on_shapes(at: Reals, radius: float, shapes: Sequence[Round | Straight]) -> Found:
    """Closed discs about points (N, 2) that touch closed shapes."""
    found = []
    for k, shape in enumerate(shapes):
        low, high = shape.box
        for shot in np.flatnonzero(((at >= low - radius) & (at <= high + radius)).all(axis=1)).tolist():
            if shape.meets(at[shot], radius):
                found.append((shot, k, *shape.nearest(at[shot]).tolist(), _share(at[shot], radius, shape)))
    table = np.array(sorted(found), np.float64).reshape(-1, 5)
    return Found(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2:4], table[:, 4])


def _share(at: Reals, radius: float, shape: Round | Straight) -> float:
    """Part of a disc's area that a shape covers."""
    step = 2 * radius / STRIPS
    off = (np.arange(STRIPS) + 0.5) * step - radius
    half = np.sqrt(radius**2 - off**2)
    return float(shape.chords(at[1] + off, at[0] - half, at[0] + half).sum() / (2 * half.sum()))
