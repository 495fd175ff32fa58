"""Broad phases side by side: build, query and move 10^5 boxes, against brute force and shapely's STRtree if installed.

python tests/bench/broadphase.py [boxes]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from planes.arrays import Floats, Ints
from planes.broadphase import BroadPhase, BruteForce, Bvh, Grid, Quadtree

try:
    import shapely
except ImportError:
    shapely = None

QUERIES = 1000


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


def line(name: str, build: float, query: float, brute: float, rest: str) -> None:
    """Print one row."""
    ratio = f"{brute / query:9.1f}x"
    print(f"  {name:10} {build * 1e3:9.1f} {query / QUERIES * 1e6:9.2f} {ratio} {rest}")


def structures(rows: Floats, queries: Floats, brute: float, expected: Ints, rng: np.random.Generator) -> None:
    """Time the project's own."""
    for kind in (Grid, Quadtree, Bvh):
        build, made = timed(lambda kind=kind: kind(rows))
        assert isinstance(made, BroadPhase)
        query, got = timed(lambda made=made: made.query(queries))
        assert np.array_equal(got, expected), kind
        work = made.work(queries)
        share, tests = (p.shape[1] / QUERIES for p in (work.visited, work.tested))
        few = rng.permutation(len(rows))[: len(rows) // 100]
        moves = []
        for ids in (np.arange(len(rows)), few):
            step = rng.normal(0, 0.02, (len(ids), 2))
            near = made.boxes[ids] + np.tile(step, 2)
            begin = time.perf_counter()
            made.move(ids, near)
            moves.append((time.perf_counter() - begin) * 1e3)
        rest = f"{100 * share / work.nodes:9.4f} {tests:9.1f} {100 * tests / len(rows):9.4f}"
        line(kind.__name__, build, query, brute, f"{rest} {moves[0]:9.1f} {moves[1]:8.2f}")


def main() -> None:
    """Print the tables."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    rng = np.random.default_rng(1)
    for name, rows in worlds(n, rng).items():
        queries = rows[rng.permutation(n)[:QUERIES]]
        plain = BruteForce(rows)
        brute, expected = timed(lambda plain=plain, queries=queries: plain.query(queries))
        assert isinstance(expected, np.ndarray)
        print(f"{n} boxes, {name}: {expected.shape[1] / QUERIES:.1f} found a query, {QUERIES} queries a call")
        print("              build ms  us/query  vs brute   nodes %     tests   boxes %  all move  1% move, ms")
        line("BruteForce", 0, brute, brute, "")
        structures(rows, queries, brute, expected, rng)
        if shapely is None:
            print("  (shapely is not installed)")
            continue
        made, asked = (shapely.box(*part.T) for part in (rows, queries))
        build, tree = timed(lambda made=made: planted(made))
        query, got = timed(lambda tree=tree, asked=asked: tree_pairs(tree, asked))
        same = "" if np.array_equal(got, expected) else "(other pairs)"
        line("STRtree", build, query, brute, same)


if __name__ == "__main__":
    main()
