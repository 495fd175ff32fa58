"""Outlines: simple polygons cut into convex parts, and refused where they cross, against the exact oracle."""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

import numpy as np
import oracle_volumes as exact
import pytest

from hitplanes import InputError
from hitplanes.planes.volumes.polygons import convex_parts, hull

Ring = list[tuple[float, float]]

SHAPES: dict[str, tuple[Ring, int]] = {
    "square with points on edges": ([(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)], 1),
    "L": ([(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)], 2),
    "L with points on its line of sight": ([(0, 0), (1, 0), (4, 0), (4, 1), (2, 1), (1, 1), (1, 3), (0, 3), (0, 1)], 2),
    "plus": ([(1, 0), (2, 0), (2, 1), (3, 1), (3, 2), (2, 2), (2, 3), (1, 3), (1, 2), (0, 2), (0, 1), (1, 1)], 7),
    "dart": ([(0, 0), (4, 0), (1, 1), (0, 4)], 2),
    "comb": ([(0, 0), (6, 0), (6, 3), (5, 3), (5, 1), (4, 1), (4, 3), (3, 3), (3, 1), (2, 1), (2, 3), (0, 3)], 4),
}
"""Outlines, and into how many parts they are cut at most."""


def sides(ring: Any) -> list[Any]:
    return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def is_simple(ring: Ring) -> bool:
    """Neighbouring sides share one point, others none."""
    if any(p == q for p, q in sides(ring)):
        return False
    for (i, (a, b)), (j, (c, d)) in combinations(enumerate(sides(ring)), 2):
        if j == i + 1:
            met = exact.on_segment(d, a, b) or exact.on_segment(a, c, d)
        elif (j + 1) % len(ring) == i:
            met = exact.on_segment(c, a, b) or exact.on_segment(b, c, d)
        else:
            met = exact.segments_meet(a, b, c, d)
        if met:
            return False
    return True


def holds(ring: Any, p: Any) -> bool:
    return any(exact.on_segment(p, a, b) for a, b in sides(ring)) or exact.odd(p, sides(ring))


def twice_area(ring: Any) -> Any:
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in sides(ring))


def check(ring: Ring) -> int:
    """Parts are convex, turn one way, add up to the whole without overlapping, and are few."""
    (whole,) = exact.units(tuple((8 * x, 8 * y) for x, y in ring))
    parts = [[whole[i] for i in part] for part in convex_parts(ring)]
    areas = [twice_area(part) for part in parts]
    assert all(area > 0 for area in areas) and sum(areas) == abs(twice_area(whole))
    assert all(exact.is_convex_ring(part) and len(exact.hull(part)) == len(part) for part in parts)
    triples = list(zip([whole[-1], *whole[:-1]], whole, [*whole[1:], whole[0]], strict=True))
    around = 1 if twice_area(whole) > 0 else -1
    reflex = sum(exact.sign(exact.turn(*triple)) == -around for triple in triples)
    assert len(parts) <= 2 * reflex + 1
    corners = [p for part in parts for p in part]
    middles = [tuple(sum(v) // len(part) for v in zip(*part, strict=True)) for part in parts]
    between = [((p[0] + q[0]) // 2, (p[1] + q[1]) // 2) for p, q in zip(whole, whole[2:], strict=False)]
    for p in (*corners, *middles, *between):
        inside = [exact.in_ring(p, part) for part in parts]
        assert any(inside) == holds(whole, p)
        strictly = [all(exact.turn(a, b, p) > 0 for a, b in sides(part)) for part in parts]
        assert sum(strictly) <= 1 and (not any(strictly) or sum(inside) == 1)
    return len(parts)


@pytest.mark.parametrize("name", SHAPES)
def test_parts_by_hand(name: str) -> None:
    ring, most = SHAPES[name]
    for turned in (ring, ring[::-1], [(-y, x) for x, y in ring]):
        for k in range(len(ring)):
            assert check(turned[k:] + turned[:k]) <= most


def test_convex_ones_stay_whole() -> None:
    rng = np.random.default_rng(3)
    for n in range(3, 30):
        ring = hull([(x, y) for x, y in rng.normal(0, 100, (n, 2)).tolist()])
        assert len(convex_parts(ring)) == 1


@pytest.mark.parametrize("loops", [1500, pytest.param(6000, marks=pytest.mark.long)])
def test_any_loop_on_a_small_lattice_is_cut_or_refused(loops: int) -> None:
    """Many corners on one line, on edges, on diagonals."""
    rng = np.random.default_rng(4)
    lattice = list(product(range(4), range(4)))
    cut = 0
    for _ in range(loops):
        count = int(rng.integers(3, 10))
        ring = [(float(lattice[i][0]), float(lattice[i][1])) for i in rng.choice(16, count, replace=False)]
        if is_simple(ring):
            check(ring)
            cut += 1
        else:
            with pytest.raises(InputError, match="expected edges that do not cross or touch"):
                convex_parts(ring)
    assert cut > loops / 20


def untangled(rng: np.random.Generator, ring: list[Any]) -> Ring:
    """Two sides that cross are exchanged until none do: any points become a simple polygon."""
    k = True
    while k:
        k = False
        for i, j in combinations(range(len(ring)), 2):
            if exact.segments_meet(ring[i - 1], ring[i], ring[j], ring[(j + 1) % len(ring)]) and j - i < len(ring) - 2:
                old = dist(ring[i - 1], ring[i]) + dist(ring[j], ring[(j + 1) % len(ring)])
                new = dist(ring[i - 1], ring[j]) + dist(ring[i], ring[(j + 1) % len(ring)])
                if new < old - 1e-9:
                    ring[i : j + 1] = ring[i : j + 1][::-1]
                    k = True
    return ring


def dist(p: Any, q: Any) -> float:
    return float(np.sqrt((p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2))


def test_tangled_loops() -> None:
    """Long winding outlines on a lattice, where much lines up."""
    rng = np.random.default_rng(5)
    cut = 0
    for _ in range(60):
        places = rng.choice(100, int(rng.integers(10, 30)), replace=False)
        ring = untangled(rng, [(float(i % 10), float(i // 10)) for i in places.tolist()])
        if is_simple(ring):
            check(ring)
            cut += 1
    assert cut > 20


def test_few_points_are_refused() -> None:
    for ring in ([], [(0.0, 0.0)], [(0.0, 0.0), (1.0, 0.0)]):
        with pytest.raises(InputError, match="expected three or more"):
            convex_parts(ring)
