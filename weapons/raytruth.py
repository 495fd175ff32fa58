"""What rays touch first, worked out slowly: every pixel square of every object, in whole numbers.

The truth that methods are judged by: it shares no code with them, and imports numpy alone. Lengths are in 1/256 px;
pixel (x, y) is the closed square of side 256 around (256 x, 256 y).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["Target", "first_pixels", "touching"]

Ints = npt.NDArray[np.int64]
Target = tuple[int, npt.NDArray[np.bool_], tuple[int, int]]
"""An object's number, its mask (h, w), and the pixel (x, y) of the world at [0, 0]."""

PX, HALF = 256, 128


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


def touching(points_256: Ints, targets: Sequence[Target]) -> npt.NDArray[np.bool_]:
    """Whether points (N, 2) lie in a closed pixel square of any target."""
    inside = np.zeros(len(points_256), np.bool_)
    inside[first_pixels(points_256, np.zeros_like(points_256), targets)[0]] = True
    return inside


def _boxes(targets: Sequence[Target]) -> Ints:
    """First and last pixel centres (M, 4) of masks."""
    boxes = [[x, y, x + mask.shape[1] - 1, y + mask.shape[0] - 1] for _, mask, (x, y) in targets]
    return PX * np.array(boxes, np.int64).reshape(-1, 4)


def _between(target: Target, low: Ints, high: Ints) -> Ints:
    """Pixels (K, 2) of a mask whose centres lie between two corners."""
    _, mask, corner = target
    x, y = np.maximum(-(-low // PX) - corner, 0)
    x_end, y_end = high // PX - corner + 1
    return np.asarray(np.argwhere(mask[y:y_end, x:x_end])[:, ::-1] + (x, y) + corner)


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
