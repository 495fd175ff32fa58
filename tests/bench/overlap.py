"""The table of pairs against plain float versions of the same tests: nanoseconds a pair, and their ratio.

python tests/bench/overlap.py [share of hard rows ...]

Scenes: near (boxes around the two mostly meet: what a broad phase leaves over) and sparse (any two of a world of 2000
px). A hard row touches with a corner, or with the place of a round outline that faces (0.6, 0.8). Polygons have 3 to 8
corners. The float versions take the same volumes, work on columns, and count touching as overlap.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from turns import least

from hitplanes.planes.volumes.overlap import overlap
from hitplanes.planes.volumes.volumes import Aabbs, Capsules, Circles, Obbs, Polygons

ROWS = 200_000
TOWARD = np.array([0.6, 0.8])
WORLDS = {"near": 60.0, "sparse": 2000.0}
KINDS = ("circles", "aabbs", "obbs", "polygons", "capsules")


def columns(volume: Any) -> Any:
    """Corners (2, k, n), the last one again where a row has fewer."""
    if isinstance(volume, Aabbs):
        (x0, y0), (x1, y1) = volume.min.T, volume.max.T
        return np.stack([np.stack([x0, x1, x1, x0]), np.stack([y0, y0, y1, y1])])
    if isinstance(volume, Circles):
        return np.ascontiguousarray(volume.center.T)[:, None]
    if isinstance(volume, Capsules):
        return np.stack([volume.a_xy.T, volume.b_xy.T], axis=1)
    counts = np.diff(np.append(volume.starts, len(volume.points)))
    places = volume.starts + np.minimum(np.arange(counts.max())[:, None], counts - 1)
    return np.stack([volume.points[:, 0][places], volume.points[:, 1][places]])


def plain_circles_circles(a: Any, b: Any) -> Any:
    """By the squares of the distance and of the sum of the radii."""
    dx, dy, r = a.center[:, 0] - b.center[:, 0], a.center[:, 1] - b.center[:, 1], a.radius + b.radius
    return dx * dx + dy * dy <= r * r


def plain_circles_aabbs(a: Any, b: Any) -> Any:
    """By the clamped closest point."""
    dx, dy = (a.center[:, k] - np.clip(a.center[:, k], b.min[:, k], b.max[:, k]) for k in (0, 1))
    return dx * dx + dy * dy <= a.radius * a.radius


def plain_aabbs_aabbs(a: Any, b: Any) -> Any:
    """By min and max."""
    x, y = ((a.min[:, k] <= b.max[:, k]) & (b.min[:, k] <= a.max[:, k]) for k in (0, 1))
    return x & y


def distance2(p: Any, a: Any, b: Any) -> Any:
    """Of points to segments, by the clamped nearest point."""
    (fx, fy), (dx, dy) = p - a, b - a
    t = np.clip((fx * dx + fy * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0, 1)
    x, y = fx - t * dx, fy - t * dy
    return x * x + y * y


def plain_circles_capsules(a: Any, b: Any) -> Any:
    """By the distance to the segment."""
    r = a.radius + b.radius
    return distance2(a.center.T, b.a_xy.T, b.b_xy.T) <= r * r


def plain_capsules_capsules(a: Any, b: Any) -> Any:
    """By the distances of the ends, and whether the segments cross."""
    s, t, u, v = a.a_xy.T, a.b_xy.T, b.a_xy.T, b.b_xy.T
    r = a.radius + b.radius
    least = np.minimum.reduce([distance2(*row) for row in ((s, u, v), (t, u, v), (u, s, t), (v, s, t))])
    crossing = (side(s, t, u) * side(s, t, v) < 0) & (side(u, v, s) * side(u, v, t) < 0)
    return (least <= r * r) | crossing


def side(a: Any, b: Any, c: Any) -> Any:
    """Which side of ab has c."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def touching_boxes(a: Any, b: Any) -> Any:
    """Rows whose bounds meet."""
    p, q = a.bounds(), b.bounds()
    return np.flatnonzero(plain_aabbs_aabbs(p, q))


def plain_hulls(a: Any, b: Any) -> Any:
    """Bounds, then separating axes by projections of all corners, relative to the first."""
    left = touching_boxes(a, b)
    one, two = columns(a).take(left, axis=2), columns(b).take(left, axis=2)
    one, two = one - one[:, :1], two - one[:, :1]
    apart = np.zeros(len(left), bool)
    for hull, halves in ((one, isinstance(a, Obbs | Aabbs)), (two, isinstance(b, Obbs | Aabbs))):
        for k in range(2 if halves else hull.shape[1]):  # a box has two directions
            dx, dy = hull[:, (k + 1) % hull.shape[1]] - hull[:, k]
            p, q = (dx * v[1] - dy * v[0] for v in (one, two))
            apart |= (p.max(axis=0) < q.min(axis=0)) | (q.max(axis=0) < p.min(axis=0))
    found = np.zeros(len(a), bool)
    found[left] = ~apart
    return found


def plain_round(a: Any, b: Any) -> Any:
    """Bounds, then: the hull contains the first point, a segment crosses an edge, or a distance is in reach."""
    left = touching_boxes(a, b)
    core, hull, r = columns(a).take(left, axis=2), columns(b).take(left, axis=2), a.radius[left]
    after = np.roll(hull, -1, axis=1)
    within = (side(hull, after, core[:, :1]) >= 0).all(axis=0)
    least = distance2(core[:, :1], hull, after).min(axis=0)
    if core.shape[1] == 2:
        p, q = core[:, :1], core[:, 1:]
        within |= ((side(p, q, hull) * side(p, q, after) < 0) & (side(hull, after, p) * side(hull, after, q) < 0)).any(
            0
        )
        least = np.minimum.reduce([least, distance2(q, hull, after).min(axis=0), distance2(hull, p, q).min(axis=0)])
    found = np.zeros(len(a), bool)
    found[left] = within | (least <= r * r)
    return found


PLAIN: dict[tuple[str, str], Callable[[Any, Any], Any]] = {
    ("circles", "circles"): plain_circles_circles,
    ("circles", "aabbs"): plain_circles_aabbs,
    ("circles", "capsules"): plain_circles_capsules,
    ("aabbs", "aabbs"): plain_aabbs_aabbs,
    ("capsules", "capsules"): plain_capsules_capsules,
}


def plain_of(one: str, two: str) -> tuple[Callable[[Any, Any], Any], bool]:
    """The float version of a pair, and whether it takes the second first."""
    if (one, two) in PLAIN:
        return PLAIN[one, two], False
    if two == "capsules":
        return plain_round, True
    return plain_round if one == "circles" else plain_hulls, False


def volumes(kind: str, rng: np.random.Generator, world: float) -> Any:
    """Rows of one kind, about 30 px across."""
    center, half = rng.uniform(0, world, (ROWS, 2)), rng.uniform(2, 30, (ROWS, 2))
    if kind == "circles":
        return Circles(center, half[:, 0])
    if kind == "aabbs":
        return Aabbs(center - half, center + half)
    if kind == "obbs":
        return Obbs.from_center(center, half, rng.uniform(0, 360, ROWS))
    if kind == "capsules":
        end = rng.normal(0, 15, (ROWS, 2))
        return Capsules(center - end, center + end, half[:, 0] / 3)
    counts = rng.integers(3, 9, ROWS)
    starts = np.cumsum(counts) - counts
    row = np.repeat(np.arange(ROWS), counts)
    turn = (np.arange(len(row)) - starts[row] + rng.uniform(0.1, 0.9, len(row))) / counts[row] * 2 * np.pi
    return Polygons(center[row] + half[row] * np.stack([np.cos(turn), np.sin(turn)], axis=1), starts)


def outermost(volume: Any, rows: Any, toward: Any) -> Any:
    """The place of the outline that faces a direction."""
    corners = columns(volume)[..., rows]
    best = (corners * toward[:, None, None]).sum(axis=0).argmax(axis=0)
    return corners[:, best, np.arange(len(rows))].T + volume.core().radius[rows, None] * toward


def scene(one: str, two: str, world: float, share: float) -> tuple[Any, Any]:
    """Two volumes; a share of the rows touches, to the ulp."""
    rng = np.random.default_rng(1)
    a, b = volumes(one, rng, world), volumes(two, rng, world)
    hard = rng.choice(ROWS, round(share * ROWS), replace=False)
    by = np.zeros((ROWS, 2))
    by[hard] = outermost(a, hard, TOWARD) - outermost(b, hard, -TOWARD)
    return a, b.translated(by)


def main() -> None:
    """Print the table."""
    shares = [float(word) for word in sys.argv[1:]] or [0, 1e-5, 1e-4]
    heads = " ".join(f"{share:7.0e}" for share in shares) + "  conservative"
    print(f"{'pair':20} {'scene':7} {'meet':>5} {'float ns':>9} {'exact ns':>9}  ratio at hard rows: {heads}")
    for one, two in combinations_with_replacement(KINDS, 2):
        plain, swapped = plain_of(one, two)
        for name, world in WORLDS.items():
            ratios, first = [], []
            for share in shares:
                a, b = scene(one, two, world, share)
                rows = (b, a) if swapped else (a, b)
                times = [
                    1e9 / ROWS * t
                    for t in least(
                        lambda p=plain, v=rows: p(*v),  # type: ignore[misc]
                        lambda v=(a, b): overlap(*v),  # type: ignore[misc]
                        lambda v=(a, b): overlap(*v, conservative=True),  # type: ignore[misc]
                    )
                ]
                ratios.append(times[1] / times[0])
                first = first or [overlap(a, b).mean() * 100, *times]
            shown = " ".join(f"{r:7.2f}" for r in ratios)
            find_contacts, floats, exacts, quick = first
            head = f"{one + ' ' + two:20} {name:7} {find_contacts:4.0f}% {floats:9.1f} {exacts:9.1f}"
            print(f"{head} {'':20} {shown}  {quick / floats:12.2f}", flush=True)


if __name__ == "__main__":
    main()
