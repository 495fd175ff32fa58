"""Slow reference for margins of rays: which shifts let segments touch pixels, tried one by one.

Positions in 1/256 px; pixel (x, y) is the closed square of side 256 around (256 x, 256 y). Exact for one shift, in
fractions; in floats for many, with squares and rims grown by `slack`.
"""

from collections.abc import Collection, Sequence
from fractions import Fraction

import numpy as np
import numpy.typing as npt

__all__ = ["Segment", "disc_grid", "touched_at", "touches"]

Segment = tuple[Sequence[Fraction], Sequence[Fraction], int]
"""Both ends, and half of its width."""

Pixel = tuple[int, int]
Floats = npt.NDArray[np.float64]


def touches(segment: Segment, pixel: Pixel, shift_px: Sequence[float] = (0, 0)) -> bool:
    """Whether a shifted segment meets the square of a pixel, or covers its centre; exactly."""
    a, b, r = segment
    moved = [Fraction(s) * 256 for s in shift_px]
    start = [p + s - 256 * c for p, s, c in zip(a, moved, pixel, strict=True)]  # about the pixel
    step = [q - p for p, q in zip(a, b, strict=True)]
    first, last = Fraction(0), Fraction(1)
    meets = True
    for p, d in zip(start, step, strict=True):
        if d:
            near, far = sorted(((-128 - p) / d, (128 - p) / d))
            first, last = max(first, near), min(last, far)
        else:
            meets = meets and abs(p) <= 128
    if meets and first <= last:
        return True
    length2 = sum(d * d for d in step)
    time = (
        min(max(-sum(p * d for p, d in zip(start, step, strict=True)) / length2, Fraction(0)), Fraction(1))
        if length2
        else Fraction(0)
    )
    return r > 0 and sum((p + time * d) ** 2 for p, d in zip(start, step, strict=True)) <= r * r


def touched_at(
    segments: Sequence[Segment], pixels: Collection[Pixel], shifts_px: Floats, slack: float
) -> npt.NDArray[np.bool_]:
    """For each shift (n, 2) whether any segment touches any pixel, in floats."""
    found = np.zeros(len(shifts_px), np.bool_)
    centres = 256.0 * np.array(sorted(pixels), np.float64).reshape(-1, 2)
    for a, b, r in segments:
        begin = np.array([float(v) for v in a])
        step = np.array([float(v - w) for v, w in zip(b, a, strict=True)])
        start = (begin + 256 * shifts_px)[:, None] - centres
        first, last = np.zeros(start.shape[:2]), np.ones(start.shape[:2])
        half = 128 + 256 * slack
        for axis in (0, 1):
            p, d = start[..., axis], step[axis]
            if d:
                near, far = np.minimum((-half - p) / d, (half - p) / d), np.maximum((-half - p) / d, (half - p) / d)
                first, last = np.maximum(first, near), np.minimum(last, far)
            else:
                last = np.where(np.abs(p) <= half, last, -1)
        found |= (first <= last).any(axis=1)
        if r:
            time = np.clip(-(start @ step) / max(float(step @ step), 1e-300), 0, 1)
            apart = start + time[..., None] * step
            found |= ((apart**2).sum(axis=2) <= (r + 256 * slack) ** 2).any(axis=1)
    return found


def disc_grid(radius: float) -> Floats:
    """Shifts of up to a length, px: on a grid, and on rings that come close to it."""
    n = min(40, int(16 * radius) + 4)
    side = np.linspace(-radius, radius, 2 * n + 1)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    turns = np.linspace(0, 2 * np.pi, 480, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    every = np.concatenate([np.stack([x, y], axis=1), *(radius * part * ring for part in (1, 0.999, 0.97, 0.5))])
    return np.asarray(every[(every**2).sum(axis=1) <= radius**2])
