"""Triangles in space against Moller's float test, nanoseconds a pair, by share of hard rows; and a mesh against a mesh.

python tests/bench/triangles.py [share ...]
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
from turns import least

from hitplanes.planes.broadphase.triangles import Mesh, meeting_faces, triangles_meet
from hitplanes.planes.common.limits import CHUNK_ROWS

ROWS = 400_000


def plain(a: Any, b: Any) -> Any:
    """Decide by floats, as Moller does it, for planes that cross; a chunk at a time, decided rows leave."""
    found = np.zeros(len(a), bool)
    for first in range(0, len(a), CHUNK_ROWS):
        pair = [p[first : first + CHUNK_ROWS] for p in (a, b)]
        columns = [np.stack([p[:, i, k] for i in range(3) for k in range(3)]).reshape(3, 3, -1) for p in pair]
        found[first : first + CHUNK_ROWS] = plain_chunk(*columns)
    return found


def plain_chunk(a: Any, b: Any) -> Any:
    """Take columns (corner, axis, row) through the seven steps."""
    found = np.zeros(a.shape[2], bool)
    normal_b, da = distances(b, a)
    left = np.flatnonzero(~one_side(da))
    a, b, da, normal_b = (v.take(left, axis=-1) for v in (a, b, da, normal_b))
    normal_a, db = distances(a, b)
    keep = np.flatnonzero(~one_side(db))
    left, da, db = left[keep], da.take(keep, axis=1), db.take(keep, axis=1)
    axis = np.argmax(np.abs(cross(normal_a.take(keep, axis=1), normal_b.take(keep, axis=1))), axis=0)
    place = axis * a.shape[2] + keep
    spans = []
    for corners, d in ((a, da), (b, db)):
        along = np.stack([corners[i].ravel().take(place) for i in range(3)])
        spans.append(interval(along, d))
    (low_a, high_a), (low_b, high_b) = spans
    found[left] = (low_a <= high_b) & (low_b <= high_a)
    return found


def distances(plane: Any, corners: Any) -> tuple[Any, Any]:
    """Give the normal and what each corner's signed distance is in its lengths."""
    p, q, r = plane
    normal = cross(p - r, q - r)
    offset = -(normal[0] * r[0] + normal[1] * r[1] + normal[2] * r[2])
    return normal, np.stack([normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2] + offset for c in corners])


def cross(e: Any, f: Any) -> Any:
    """Cross products of columns."""
    return np.stack((e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]))


def one_side(d: Any) -> Any:
    """Tell where all three are above, or all below."""
    return (d[0] * d[1] > 0) & (d[0] * d[2] > 0)


def interval(along: Any, d: Any) -> tuple[Any, Any]:
    """Cut the two edges of the corner that is alone with the other plane."""
    n = d.shape[1]
    alone = np.where(d[0] * d[1] > 0, 2, np.where(d[0] * d[2] > 0, 1, 0))
    places = [
        after[alone] * n + np.arange(n) for after in (np.array([0, 1, 2]), np.array([1, 2, 0]), np.array([2, 0, 1]))
    ]
    (p, q, r), (dp, dq, dr) = ([v.ravel().take(place) for place in places] for v in (along, d))
    with np.errstate(all="ignore"):
        s, t = p + (q - p) * (dp / (dp - dq)), p + (r - p) * (dp / (dp - dr))
    return np.minimum(s, t), np.maximum(s, t)


def random_pairs(rng: Any) -> tuple[Any, Any]:
    """Triangles in one cube of 2000 px; half of the pairs meet."""
    a, b = (rng.uniform(0, 2000, (3 * ROWS, 3, 3)) for _ in range(2))
    meeting = plain(a, b)
    half = [np.flatnonzero(meeting == value)[: ROWS // 2] for value in (False, True)]
    rows = rng.permutation(np.concatenate(half))
    return a[rows], b[rows]


def sphere(n: int, centre: Any, rng: Any) -> Mesh:
    """Give a ball of 8 n**2 triangles, an octahedron with each face cut into n**2, turned at random."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    one = np.array([(i, j, n - i - j) for i in range(n) for j in range(n - i)])
    up, right, front = np.eye(3, dtype=int)
    two = one[one[:, 2] > 1] - front
    faces = [np.stack((one, one + right - front, one + up - front), axis=1)]
    faces += [np.stack((two + right, two + up + right - front, two + up), axis=1)]
    signs = np.array([(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    corners = (np.concatenate(faces) * signs[:, None, None]).reshape(-1, 3)
    points, number = np.unique(corners, axis=0, return_inverse=True)
    points = points / np.sqrt((points * points).sum(axis=1, keepdims=True))
    return Mesh(points @ turn + centre, number.reshape(-1, 3))


def mesh_pairs(rng: Any) -> tuple[Any, Any]:
    """Faces of two balls whose boxes meet, again and again."""
    a, b = sphere(35, 0.0, rng), sphere(35, [0.7, 0.5, 0.3], rng)
    i, j = a.tree.query(b.boxes)[::-1]
    rows = rng.integers(0, len(i), ROWS)
    return a.corners[i[rows]], b.corners[j[rows]]


def hardened(a: Any, b: Any, share: float, rng: Any) -> tuple[Any, Any]:
    """Let a share of the rows touch: a corner of one in the plane of the other, but for rounding."""
    b = b.copy()
    hard = rng.choice(ROWS, round(share * ROWS), replace=False)
    b[hard, 0] = a[hard].sum(axis=1) / 3
    return a, b


def pairs_table(shares: list[float]) -> None:
    """Print nanoseconds a pair."""
    print(f"{'pairs':8} {'meet':>5} {'hard rows':>9} {'float ns':>9} {'exact ns':>9} {'ratio':>6} {'conservative':>13}")
    for name, scene in (("random", random_pairs), ("mesh", mesh_pairs)):
        for share in shares:
            rng = np.random.default_rng(1)
            a, b = hardened(*scene(rng), share, rng)
            floats, exacts, quick = least(
                lambda a=a, b=b: plain(a, b),  # type: ignore[misc]
                lambda a=a, b=b: triangles_meet(a, b),  # type: ignore[misc]
                lambda a=a, b=b: triangles_meet(a, b, conservative=True),  # type: ignore[misc]
            )
            times = f"{floats / ROWS * 1e9:9.1f} {exacts / ROWS * 1e9:9.1f}"
            meeting = triangles_meet(a, b).mean()
            print(f"{name:8} {meeting:5.2f} {share:9.0e} {times} {exacts / floats:6.2f} {quick / floats:13.2f}")


def meshes_table() -> None:
    """Print a ball against a ball: by their trees, and every face against every face."""
    for n in (8, 35, 112):
        rng = np.random.default_rng(2)
        a, b = sphere(n, 0.0, rng), sphere(n, [0.7, 0.5, 0.3], rng)
        begin = time.perf_counter()
        tree = len(a.tree) + len(b.tree)
        built = time.perf_counter() - begin
        found = meeting_faces(a, b)
        (took,) = least(lambda a=a, b=b: meeting_faces(a, b))  # type: ignore[misc]
        line = f"{tree // 2} faces each, {found.shape[1]} pairs meet: "
        line += f"trees {built * 1e3:.1f} ms, query {took * 1e3:.1f} ms"
        if n == 8:
            begin = time.perf_counter()
            brute = np.argwhere(triangles_meet(a.corners[:, None], b.corners)).T
            line += f", all pairs {(time.perf_counter() - begin) * 1e3:.1f} ms"
            assert np.array_equal(brute, found)
        print(line)


def main() -> None:
    """Print both tables."""
    pairs_table([float(word) for word in sys.argv[1:]] or [0, 1e-5, 1e-4, 1e-3])
    meshes_table()


if __name__ == "__main__":
    main()
