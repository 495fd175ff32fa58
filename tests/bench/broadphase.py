"""Broad phases side by side: build, query and move 10^5 boxes, against brute force and shapely's STRtree if installed.

pip install -e '.[peers]'; python tests/bench/broadphase.py [boxes]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from hitplanes.planes.broadphase import BroadPhase, BruteForce, Bvh, Grid, Quadtree
from hitplanes.planes.common.checks import Floats, Ints

try:
    import shapely
except ImportError:
    shapely = None

QUERIES, SINGLE, BRUTE = 10_000, 200, 500
"""Queries of a call, calls of one query each, and queries that brute force is timed by."""

HEAD = """\
                    ms  us/query  us/query    batch       ms  looked into, %        all moved      1 % moved
                build     alone  in batch  vs brute   pairs    nodes    boxes       ms  written       ms  written"""
"""`written` is in parts, %, of what building writes."""


def worlds(n: int, rng: np.random.Generator) -> dict[str, Floats]:
    """Boxes of 0..2 px, about one for each square px, and what is not so even."""
    low = rng.uniform(0, np.sqrt(n), (n, 2))
    sides = rng.uniform(0, 2, (n, 2))
    even = np.concatenate((low, low + sides), axis=1)
    centres = rng.uniform(0, np.sqrt(n), (50, 2))
    low = centres[rng.integers(0, 50, n)] + rng.normal(0, np.sqrt(n) / 100, (n, 2))
    clustered = np.concatenate((low, low + sides / 4), axis=1)
    mixed = even.copy()
    mixed[:, 2:] = mixed[:, :2] + sides * rng.pareto(1.5, (n, 1))
    mixed[0] = (-1e300, -1e300, 1e300, 1e300)
    return {"even": even, "clustered": clustered, "sizes apart": mixed}


def timed(work: Callable[[], object]) -> tuple[float, object]:
    """Least seconds of three rounds."""
    best, result = float("inf"), None
    for _ in range(3):
        begin = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - begin)
    return best, result


def tree_pairs(tree: object, queries: Ints) -> Ints:
    """Answer as the project does, sorted."""
    pairs = tree.query(queries)  # type: ignore[attr-defined]
    return np.asarray(pairs[:, np.lexsort(pairs[::-1])])


def planted(boxes: object) -> object:
    """A tree that has answered once: GEOS builds it then."""
    tree = shapely.STRtree(boxes)
    tree.query(shapely.Point(0, 0))
    return tree


def singly(ask: Callable[[int], object]) -> float:
    """Seconds of a call with one query."""
    return timed(lambda: [ask(k) for k in range(SINGLE)])[0] / SINGLE


def line(name: str, build: float, singles: float, query: float, brute: float, rest: str = "") -> None:
    """Print one row."""
    told = f"{build * 1e3:8.1f} {singles * 1e6:9.1f} {query / QUERIES * 1e6:9.2f} {brute / query:8.1f}x"
    print(f"  {name:10} {told} {rest}")


def moved(made: BroadPhase, ids: Ints, built: int, rng: np.random.Generator) -> str:
    """Milliseconds of a small move, and the entries and nodes that it wrote, in parts of those of building."""
    near = made.boxes[ids] + np.tile(rng.normal(0, 0.02, (len(ids), 2)), 2)
    before, begin = made.written, time.perf_counter()
    made.move(ids, near)
    return f"{(time.perf_counter() - begin) * 1e3:8.2f} {100 * (made.written - before) / built:8.2f}"


def structures(rows: Floats, queries: Floats, brute: float, expected: Ints, rng: np.random.Generator) -> None:
    """Time the project's own."""
    for kind in (Grid, Quadtree, Bvh):
        build, made = timed(lambda kind=kind: kind(rows))
        assert isinstance(made, BroadPhase)
        built = made.written
        query, got = timed(lambda made=made: made.query(queries))
        assert np.array_equal(got, expected), kind
        singles = singly(lambda k, made=made: made.query(queries[k : k + 1]))
        pairs, _ = timed(made.pairs)
        work = made.work(queries)
        nodes, tests = (part.shape[1] / QUERIES for part in (work.visited, work.tested))
        few = rng.permutation(len(rows))[: len(rows) // 100]
        moved(made, made.ids, built, rng)  # a box that has not moved yet has no room in a BVH
        moves = " ".join(moved(made, ids, built, rng) for ids in (made.ids, few))
        rest = f"{pairs * 1e3:7.0f} {100 * nodes / work.nodes:8.4f} {100 * tests / len(rows):8.4f} {moves}"
        line(kind.__name__, build, singles, query, brute, rest)


def peer(rows: Floats, queries: Floats, brute: float, expected: Ints) -> None:
    """Time shapely's tree, its answers sorted as the project's are, and as they come; its boxes are made beforehand."""
    made, asked = (shapely.box(*part.T) for part in (rows, queries))
    build, tree = timed(lambda: planted(made))
    query, got = timed(lambda: tree_pairs(tree, asked))
    singles = singly(lambda k: tree_pairs(tree, asked[k : k + 1]))
    pairs, _ = timed(lambda: tree_pairs(tree, made))
    line("STRtree", build, singles, query, brute, f"{pairs * 1e3:7.0f}")
    bare, pairs = (timed(lambda q=q: tree.query(q))[0] for q in (asked, made))  # type: ignore[attr-defined]
    line("unsorted", build, singly(lambda k: tree.query(asked[k])), bare, brute, f"{pairs * 1e3:7.0f}")
    if not np.array_equal(got, expected):
        print("  (other pairs)")


def main() -> None:
    """Print the tables."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    rng = np.random.default_rng(1)
    for name, rows in worlds(n, rng).items():
        queries = rows[rng.integers(0, n, QUERIES)]
        plain = BruteForce(rows)
        few, _ = timed(lambda plain=plain, queries=queries: plain.query(queries[:BRUTE]))
        brute, expected = few * QUERIES / BRUTE, Bvh(rows).query(queries)
        assert np.array_equal(plain.query(queries[:BRUTE]), expected[:, expected[0] < BRUTE])
        print(f"{n} boxes, {name}: {expected.shape[1] / QUERIES:.1f} found a query, {QUERIES} queries a call")
        print(HEAD)
        line("BruteForce", 0, few / BRUTE, brute, brute)
        structures(rows, queries, brute, expected, rng)
        if shapely is None:
            print("  (shapely is not installed)")
        else:
            peer(rows, queries, brute, expected)


if __name__ == "__main__":
    main()
