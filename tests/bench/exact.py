"""Exact signs against plain float versions of the same test: nanoseconds a row, and their ratio, by share of hard rows.

python tests/bench/exact.py [share ...]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from turns import least

from hitplanes.planes.volumes.exact import circles_sign, orient2d, orient3d, point_segment_sign, segment_segment_sign

ROWS = 1_000_000


def plain_orient2d(a: Any, b: Any, c: Any) -> Any:
    """Sign of the determinant as it comes."""
    return np.sign(
        (a[:, 0] - c[:, 0]) * (b[:, 1] - c[:, 1]) - (a[:, 1] - c[:, 1]) * (b[:, 0] - c[:, 0])
    ).astype(np.int8)  # fmt: skip


def plain_orient3d(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Sign of the determinant as it comes."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = ([p[:, k] - d[:, k] for k in range(3)] for p in (a, b, c))
    value = az * (bx * cy - by * cx) + ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz)
    return np.sign(value).astype(np.int8)


def plain_circles(c1: Any, r1: Any, c2: Any, r2: Any) -> Any:
    """Sign of the difference of the squares."""
    dx, dy, r = c1[:, 0] - c2[:, 0], c1[:, 1] - c2[:, 1], r1 + r2
    return np.sign(dx * dx + dy * dy - r * r).astype(np.int8)


def plain_point_segment(p: Any, a: Any, b: Any, r: Any) -> Any:
    """Sign by the clamped nearest point."""
    fx, fy, dx, dy = p[:, 0] - a[:, 0], p[:, 1] - a[:, 1], b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    t = np.clip((fx * dx + fy * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0, 1)
    x, y = fx - t * dx, fy - t * dy
    return np.sign(x * x + y * y - r * r).astype(np.int8)


def plain_segment_segment(a: Any, b: Any, c: Any, d: Any, r: Any) -> Any:
    """Sign by the four ends, and -1 where the segments cross."""
    ends = [plain_point_segment(p, q, s, r) for p, q, s in ((a, c, d), (b, c, d), (c, a, b), (d, a, b))]
    across = plain_orient2d(a, b, c) * plain_orient2d(a, b, d) < 0
    crossing = across & (plain_orient2d(c, d, a) * plain_orient2d(c, d, b) < 0)
    return np.where(crossing, np.int8(-1), np.minimum.reduce(ends))


def scene(name: str, share: float) -> list[Any]:
    """Rows over a world of 2000 px; a share of them touches, to the ulp."""
    rng = np.random.default_rng(1)
    hard = rng.choice(ROWS, round(share * ROWS), replace=False)
    if name == "orient3d":
        rows = [rng.uniform(0, 2000, (ROWS, 3)) for _ in range(4)]
        rows[3][hard] = rows[0][hard] / 3 + rows[1][hard] / 3 + rows[2][hard] / 3
        return rows
    p, a, b, e = (rng.uniform(0, 2000, (ROWS, 2)) for _ in range(4))
    r, q = rng.uniform(1, 40, ROWS), rng.uniform(1, 40, ROWS)
    if name == "orient2d":
        e[hard] = a[hard] + (p[hard] - a[hard]) / 3
        return [a, p, e]
    if name == "circles":
        a[hard] = p[hard] + np.stack([3 * (r[hard] + q[hard]) / 5, 4 * (r[hard] + q[hard]) / 5], axis=1)
        return [p, r, a, q]
    if name == "point segment":
        p[hard], r[hard] = a[hard] + [0.6, 0.8], 1
        b[hard] = a[hard] + np.array([-80.0, 60.0])
        return [p, a, b, r]
    b[hard] = a[hard] + np.array([-80.0, 60.0])
    p[hard], r[hard] = a[hard] + [0.6, 0.8], 1
    e[hard] = p[hard] + [0.6, 0.8]
    return [a, b, p, e, r]


PAIRS: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "orient2d": (orient2d, plain_orient2d),
    "orient3d": (orient3d, plain_orient3d),
    "circles": (circles_sign, plain_circles),
    "point segment": (point_segment_sign, plain_point_segment),
    "segment segment": (segment_segment_sign, plain_segment_segment),
}


def main() -> None:
    """Print the table."""
    shares = [float(word) for word in sys.argv[1:]] or [0, 1e-5, 1e-4, 1e-3]
    print(f"{'sign':16} {'hard rows':>9} {'float ns':>9} {'exact ns':>9} {'ratio':>6} {'conservative':>13}")
    for name, (exact, plain) in PAIRS.items():
        for share in shares:
            rows = scene(name, share)
            floats, exacts, quick = (
                1e9 / ROWS * t
                for t in least(
                    lambda p=plain, v=rows: p(*v),  # type: ignore[misc]
                    lambda e=exact, v=rows: e(*v),  # type: ignore[misc]
                    lambda e=exact, v=rows: e(*v, conservative=True),  # type: ignore[misc]
                )
            )
            ratios = f"{exacts / floats:6.2f} {quick / floats:13.2f}"
            print(f"{name:16} {share:9.0e} {floats:9.1f} {exacts:9.1f} {ratios}")


if __name__ == "__main__":
    main()
