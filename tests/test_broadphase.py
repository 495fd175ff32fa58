"""Broad phases: each answers as every box against every box does, and keeps its invariants whatever comes and goes."""

from __future__ import annotations

from collections.abc import Callable

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from some_of import some_of

from hitplanes import InputError
from hitplanes.planes.broadphase import BroadPhase, BruteForce, Bvh, Grid, PartsBvh, Quadtree
from hitplanes.planes.common.checks import Floats, Ints
from hitplanes.planes.common.limits import GRID_FRESH
from hitplanes.planes.grid.spans import meets, pieces
from hitplanes.planes.volumes.volumes import Aabbs, Circles

Maker = Callable[[Floats], BroadPhase]
MAKERS: dict[str, tuple[Maker, tuple[int, ...]]] = {
    "grid": (Grid, (2, 3)),
    "fine grid": (lambda rows: Grid(rows, cell=0.5), (2, 3)),
    "quadtree": (Quadtree, (2,)),
    "deep quadtree": (lambda rows: Quadtree(rows, capacity=1, depth=8), (2,)),
    "flat quadtree": (lambda rows: Quadtree(rows, capacity=3, depth=0), (2,)),
    "bvh": (Bvh, (2, 3)),
    "tight bvh": (lambda rows: Bvh(rows, slack=0), (2, 3)),
}
STRUCTURES = [pytest.param(make, d, id=f"{name} {d}-D") for name, (make, dims) in MAKERS.items() for d in dims]
ALL = [*STRUCTURES, pytest.param(BruteForce, 2, id="brute 2-D"), pytest.param(BruteForce, 3, id="brute 3-D")]
LARGEST = float(np.finfo(np.float64).max)


def boxes_from(low: Floats, sides: Floats) -> Floats:
    with np.errstate(over="ignore"):
        return np.concatenate((low, np.minimum(low + sides, LARGEST)), axis=1)


def uniform(rng: np.random.Generator, n: int, d: int) -> Floats:
    return boxes_from(rng.uniform(0, 60, (n, d)), rng.uniform(0, 4, (n, d)))


def whole(rng: np.random.Generator, n: int, d: int) -> Floats:
    """Edges that touch, sides of zero."""
    return boxes_from(rng.integers(0, 14, (n, d)).astype(float), rng.integers(0, 3, (n, d)).astype(float))


def clustered(rng: np.random.Generator, n: int, d: int) -> Floats:
    return boxes_from(rng.normal(0, 1, (n, d)) ** 5 * 100, rng.exponential(1, (n, d)) ** 3)


def one_huge(rng: np.random.Generator, n: int, d: int) -> Floats:
    rows = boxes_from(rng.uniform(0, 100, (n, d)), rng.uniform(0, 1, (n, d)))
    rows[: n // 40 + 1] = np.repeat((-1e300, 1e300), d)
    return rows


def one_spot(rng: np.random.Generator, n: int, d: int) -> Floats:
    return np.full((n, 2 * d), 7.0)


def extreme(rng: np.random.Generator, n: int, d: int) -> Floats:
    ends = [-LARGEST, LARGEST, 1e300, -1e300, 0.0, -0.0, 5e-324, -5e-324, 1.0]
    a, b = rng.choice(ends, (2, n, d))
    return np.concatenate((np.minimum(a, b), np.maximum(a, b)), axis=1)


def in_line(rng: np.random.Generator, n: int, d: int) -> Floats:
    """Each touches the next one at a corner, far from zero."""
    low = 1e9 + np.repeat(np.arange(n, dtype=float)[:, None], d, axis=1)
    return boxes_from(low, np.ones((n, d)))


WORLDS = [uniform, whole, clustered, one_huge, one_spot, extreme, in_line]
EVERYWHERE = some_of((name, d, world) for name, (_, dims) in MAKERS.items() for d in dims for world in WORLDS)


def meets_plainly(a: Floats, b: Floats) -> bool:
    d = len(a) // 2
    return all(a[i] <= b[d + i] and b[i] <= a[d + i] for i in range(d))


def assert_same(plain: BroadPhase, other: BroadPhase, queries: Floats) -> None:
    other.check()
    assert np.array_equal(plain.ids, other.ids) and np.array_equal(plain.boxes, other.boxes)
    assert np.array_equal(plain.query(queries), other.query(queries))
    assert np.array_equal(plain.pairs(), other.pairs())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("world", WORLDS)
def test_brute_force_is_the_definition(world: Callable[..., Floats], d: int) -> None:
    rng = np.random.default_rng(5)
    rows, queries = world(rng, 25, d), world(rng, 9, d)
    plain = BruteForce(rows)
    due = [(q, b) for q in range(9) for b in range(25) if meets_plainly(queries[q], rows[b])]
    assert list(map(tuple, plain.query(queries).T.tolist())) == due
    due = [(i, j) for i in range(25) for j in range(i + 1, 25) if meets_plainly(rows[i], rows[j])]
    assert list(map(tuple, plain.pairs().T.tolist())) == due


@pytest.mark.parametrize(("name", "d", "world"), EVERYWHERE)
def test_equals_brute_force(name: str, d: int, world: Callable[..., Floats]) -> None:
    make, rng = MAKERS[name][0], np.random.default_rng(d)
    for n in (0, 1, 2, 17, 400):
        rows = world(rng, n, d)
        queries = np.concatenate((world(rng, 30, d), uniform(rng, 5, d), rows[:5]))
        assert_same(BruteForce(rows), make(rows), queries)


@pytest.mark.parametrize(("name", "d", "world"), EVERYWHERE)
def test_equals_brute_force_while_boxes_come_move_and_go(name: str, d: int, world: Callable[..., Floats]) -> None:
    make, rng = MAKERS[name][0], np.random.default_rng(d + 10)
    rows = world(rng, 200, d)
    plain, other = BruteForce(rows), make(rows)
    for step in range(6):
        new = (uniform, world)[step % 2](rng, 60, d)
        assert np.array_equal(plain.insert(new), other.insert(new))
        gone = rng.permutation(plain.ids)[:50]
        moved = np.setdiff1d(plain.ids, gone)[:: 1 + step % 3]
        old = plain.query(new)  # a query between changes must leave nothing behind
        assert np.array_equal(old, other.query(new))
        places = world(rng, len(moved), d)
        if step % 4:  # a small move
            places = plain.boxes[np.searchsorted(plain.ids, moved)]
            places += rng.normal(0, 0.1 * step, (len(moved), 1)) * (np.abs(places).max(axis=1, keepdims=True) < 1e300)
        for structure in (plain, other):
            structure.remove(gone)
            structure.move(moved, places)
        assert_same(plain, other, np.concatenate((new, world(rng, 20, d))))
    for structure in (plain, other):
        structure.remove(structure.ids)
    assert len(other) == 0
    assert_same(plain, other, rows)
    assert plain.insert(rows).tolist() == other.insert(rows).tolist()
    assert_same(plain, other, rows[:50])


@pytest.mark.parametrize(("make", "d"), ALL)
def test_touching_counts_and_zeros_are_one(make: Maker, d: int) -> None:
    unit = [0.0] * d + [1.0] * d
    structure = make(np.array([unit, [-1.0] * d + [-0.0] * d, [1.0] * (2 * d), [np.nextafter(1, 2)] * (2 * d)]))
    assert structure.query([unit]).tolist() == [[0, 0, 0], [0, 1, 2]]
    assert structure.pairs().tolist() == [[0, 0], [1, 2]]


@pytest.mark.parametrize(("make", "d"), ALL)
def test_nothing_at_all(make: Maker, d: int) -> None:
    structure = make(np.empty((0, 2 * d)))
    structure.check()
    assert structure.pairs().shape == structure.query(np.zeros((3, 2 * d))).shape == (2, 0)
    assert structure.query(np.empty((0, 2 * d))).dtype == structure.pairs().dtype == np.int64
    assert structure.insert(np.empty((0, 2 * d))).tolist() == []
    structure.remove([])
    structure.move([], np.empty((0, 2 * d)))
    assert structure.insert(np.zeros((2, 2 * d))).tolist() == [0, 1]
    structure.check()
    assert structure.pairs().tolist() == [[0], [1]]


@pytest.mark.parametrize(("make", "d"), ALL)
def test_inputs_are_left_alone_and_copied(make: Maker, d: int) -> None:
    rows = uniform(np.random.default_rng(1), 50, d)
    kept = rows.copy()
    structure = make(rows)
    structure.move([3], rows[4:5])
    assert np.array_equal(rows, kept)
    before = structure.pairs()
    rows[:] = 0
    structure.boxes[:] = 0
    assert np.array_equal(structure.pairs(), before)


@pytest.mark.parametrize(("make", "d"), ALL)
def test_ids_are_never_used_again(make: Maker, d: int) -> None:
    structure = make(np.zeros((3, 2 * d)))
    structure.remove([2])
    assert structure.insert(np.zeros((1, 2 * d))).tolist() == [3]
    assert structure.ids.tolist() == [0, 1, 3]


NAN = float("nan")
BAD = {
    "boxes[1][2]: expected a finite number": lambda s, d: s.insert([[0] * 2 * d, [0, 0, NAN, 0, 0, 0][: 2 * d]]),
    "boxes[0]: expected min <= max in y, got 2 and 1": lambda s, d: s.query([[0, 2, 0][:d] + [1] * d]),
    "boxes: expected shape (any, ": lambda s, d: s.query([[0.0] * (2 * d + 1)]),
    "boxes: expected shape (2, ": lambda s, d: s.move([0, 1], [[0.0] * 2 * d]),
    "ids[1]: expected the id of a box that is there, got 9": lambda s, d: s.remove([0, 9]),
    "ids[0]: expected the id of a box that is there, got 3": lambda s, d: s.remove([3]),
    "ids[0]: expected the id of a box that is there, got 2": lambda s, d: s.move([2], [[0.0] * 2 * d]),
    "ids[2]: expected each id once, got 0 again": lambda s, d: s.remove([0, 1, 0]),
    "ids[0]: expected a whole number from 0": lambda s, d: s.remove([-1]),
    "boxes: expected numbers, got": lambda s, d: s.insert([["a"] * 2 * d]),
}  # fmt: skip


@pytest.mark.parametrize("message", BAD)
@pytest.mark.parametrize(("make", "d"), ALL)
def test_bad_input_is_named_and_changes_nothing(make: Maker, d: int, message: str) -> None:
    structure = make(np.zeros((3, 2 * d)))
    structure.remove([2])
    with pytest.raises(InputError) as error:
        BAD[message](structure, d)
    assert message in str(error.value)
    structure.check()
    assert structure.ids.tolist() == [0, 1] and not structure.boxes.any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: BruteForce([0, 1]), "boxes: expected shape (any, 4) or (any, 6), got (2,)"),
        (lambda: Bvh(np.zeros((2, 5))), "boxes: expected shape (any, 4) or (any, 6), got (2, 5)"),
        (lambda: Quadtree(np.zeros((2, 6))), "boxes: expected shape (any, 4), got (2, 6)"),
        (lambda: Quadtree(np.zeros((2, 4)), capacity=0), "capacity: "),
        (lambda: Quadtree(np.zeros((2, 4)), depth=-1), "depth: "),
        (lambda: Grid(np.zeros((2, 4)), cell=0), "cell: "),
        (lambda: Bvh(np.zeros((2, 4)), slack=-1), "slack: "),
        (lambda: Grid(np.zeros((2, 4))).cells(5), "ids[0]: expected the id of a box that is there, got 5"),
        (lambda: Grid([[0, 0, 1, 1], [0, 0, 99, 99]], cell=1).cells(1), "box: expected one over at most 64 cells"),
        (lambda: Grid(np.zeros((2, 4))).owners([0]), "cell: expected shape (2,), got (1,)"),
        (
            lambda: Grid(Circles([[0, 0]], [1])),
            "boxes: expected Aabbs or rows (N, 4) or (N, 6), got Circles (their .bounds() are boxes)",
        ),
        (lambda: Bvh("x"), "boxes: expected Aabbs or rows (N, 4) or (N, 6), got 'x'"),
        (lambda: Bvh(3), "boxes: expected Aabbs or rows (N, 4) or (N, 6), got 3"),
        (
            lambda: Quadtree(np.zeros((2, 4))).query(Circles([[0, 0]], [1])),
            "boxes: expected Aabbs or rows (N, 4), got Circles (their .bounds() are boxes)",
        ),
        (lambda: PartsBvh(np.zeros((2, 4)), [0, 1]), "starts: expected whole numbers from 0 to 2"),
        (lambda: PartsBvh(np.zeros((2, 4)), [0, 2, 2]), "starts[2]: expected more than 2, got 2"),
    ],
)
def test_bad_making_is_named(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError) as error:
        call()
    assert message in str(error.value)


@pytest.mark.parametrize(("make", "dim"), ALL)
def test_boxes_may_come_as_volumes(make: Maker, dim: int) -> None:
    rows = np.random.default_rng(1).random((30, 2 * dim)).cumsum(axis=1)
    volumes = Aabbs(rows[:, :dim], rows[:, dim:])
    one, other = make(rows), make(volumes)  # type: ignore[arg-type]
    other.move(other.insert(volumes.take([0]))[:1], volumes.take([1]))
    one.move(one.insert(rows[:1]), rows[1:2])
    assert np.array_equal(one.query(rows), other.query(volumes))


def test_a_grid_tells_cells_and_owners() -> None:
    rows = np.array([[0, 0, 1, 1], [0.5, 0.5, 0.75, 0.75], [-1, 0, -0.5, 0], [0, 0, 50, 50]])
    grid = Grid(rows, cell=1)
    assert grid.origin.tolist() == [0, 0]
    assert grid.cells(0).tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]
    assert grid.cells(1).tolist() == [[0, 0]] and grid.cells(2).tolist() == [[-1, 0]]
    assert grid.owners([0, 0]).tolist() == [0, 1, 3] and grid.owners([-1, 0]).tolist() == [2]
    assert grid.owners([50, 50]).tolist() == [3] and grid.owners([51, 0]).tolist() == []
    grid.move([1], [[-0.9, 0, -0.8, 0.1]])
    assert grid.owners([0, 0]).tolist() == [0, 3] and grid.owners([-1, 0]).tolist() == [1, 2]
    grid.remove([3])
    assert grid.owners([50, 50]).tolist() == []


def test_a_grid_takes_its_cell_from_the_data() -> None:
    assert Grid([[0, 0, 1, 3], [0, 0, 2, 1], [0, 0, 9, 9]]).cell == 3
    assert Grid(np.empty((0, 4))).cell == 1
    points = np.random.default_rng(0).uniform(0, 100, (10_000, 2))
    grid = Grid(np.tile(points, 2))
    assert 0.3 < grid.cell < 3, "points get about one cell each"


def test_a_huge_box_among_tiny_ones_fills_no_memory() -> None:
    rng = np.random.default_rng(3)
    rows = boxes_from(rng.uniform(0, 1e6, (20_000, 2)), np.full((20_000, 2), 1.0))
    rows[:200] = (-1e300, -1e300, 1e300, 1e300)
    for structure in (Grid(rows), Quadtree(rows)):
        assert structure.query([[5, 5, 5, 5]]).shape[1] >= 200
        structure.check()
    assert sum(len(listing.entry) for listing in Grid(rows)._listings) < 120_000
    assert len(Quadtree(rows)._pool) < 30 * len(rows)


def test_a_quadtree_splits_in_four_and_merges() -> None:
    corners = np.array([[0, 0, 1, 1], [7, 0, 8, 1], [0, 7, 1, 8], [7, 7, 8, 8.0]])
    tree = Quadtree(corners, capacity=3)
    assert sorted(tree.leaves.tolist()) == [[0, 0, 4, 4], [0, 4, 4, 8], [4, 0, 8, 4], [4, 4, 8, 8]]
    tree.remove([0])
    assert tree.leaves.tolist() == [[0, 0, 8, 8]]
    assert tree.insert([[3, 3, 5, 5]]).tolist() == [4]
    assert len(tree.leaves) == 4
    assert tree.work([[0, 0, 0, 0]]).tested.tolist() == [[0], [4]], "a box that straddles is in all four leaves"
    tree.move([4], [[7, 0, 8, 1]])
    assert tree.work([[0, 0, 0, 0]]).tested.shape == (2, 0)
    tree.insert([[4, 4, 4, 4]] * 5)
    assert len(tree.leaves) == 1, "splitting would copy more than half of the boxes"


def test_a_quadtree_is_no_deeper_and_no_fuller_than_told() -> None:
    rows = np.tile(np.random.default_rng(1).uniform(0, 60, (400, 2)), 2)
    assert [len(Quadtree(rows, capacity=1, depth=depth).leaves) for depth in range(4)] == [1, 4, 16, 64]
    tree = Quadtree(rows, capacity=5)
    tested = tree.work(rows).tested[0]
    assert np.bincount(tested).max() == 5


def test_a_quadtree_is_what_a_new_one_is() -> None:
    rng = np.random.default_rng(8)
    rows = uniform(rng, 500, 2)
    rows[0] = (0, 0, 64, 64)
    tree = Quadtree(rows, capacity=4)
    tree.move(np.arange(1, 500), uniform(rng, 499, 2))
    tree.move(np.arange(1, 500), rows[1:])
    assert sorted(tree.leaves.tolist()) == sorted(Quadtree(rows, capacity=4).leaves.tolist())


def test_a_quadtree_begins_anew_only_when_boxes_leave_its_cell() -> None:
    rows = uniform(np.random.default_rng(8), 500, 2)
    tree = Quadtree(rows, capacity=4)
    nodes, leaves = tree._nodes, len(tree.leaves)
    tree.move(np.arange(500), rows + 1e-9)
    tree.move(np.arange(100), rows[:100] + 1000)
    tree.move(np.arange(100), rows[:100])
    assert tree._nodes is nodes
    tree.move(np.arange(500), rows + 1000)
    assert len(tree.leaves) > leaves / 2 and tree.leaves.min() >= 1000


def test_a_small_move_leaves_a_bvh_alone() -> None:
    rng = np.random.default_rng(2)
    rows = uniform(rng, 1000, 2)
    tree = Bvh(rows, slack=0.5)
    tree.move(np.arange(1000), rows + 0.1)
    levels = [level.copy() for level in tree._trees[0].levels]
    tree.move(np.arange(1000), rows + 0.3)
    assert all(np.array_equal(a, b) for a, b in zip(levels, tree._trees[0].levels, strict=True))
    tree.check()


def written(structure: BroadPhase, change: Callable[[], object]) -> int:
    before = structure.written
    change()
    return structure.written - before


@pytest.mark.parametrize("n", [1000, 16_000])
@pytest.mark.parametrize(("make", "d"), [(Grid, 2), (Grid, 3), (Quadtree, 2), (Bvh, 2), (Bvh, 3)])
def test_a_small_move_costs_little_in_any_world(make: Maker, d: int, n: int) -> None:
    rng = np.random.default_rng(d)
    rows = boxes_from(rng.uniform(0, n ** (1 / d), (n, d)), rng.uniform(0.5, 1.5, (n, d)))
    structure, ids = make(rows), np.arange(n)
    build = structure.written
    assert n <= build < 30 * n
    structure.move(ids, structure.boxes + 0.001)  # a box that has not moved yet has no room in a BVH
    assert written(structure, lambda: structure.move(ids, structure.boxes + 0.001)) < build / 10
    far = 2 * max(GRID_FRESH, build // 16) if make is Grid else 300  # a grid sorts what is fresh, to leave and to enter
    for k in range(20):
        assert written(structure, lambda k=k: structure.move([k], structure.boxes[[k]] + 0.001)) < 200
        assert written(structure, lambda k=k: structure.move([k], rows[[n - 1 - k]])) < far
    assert written(structure, lambda: structure.move(ids, rng.permutation(rows))) > n / 2
    structure.check()


def test_boxes_larger_than_any_root_cell_cost_no_rebuild(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    n = 4000
    rows = boxes_from(rng.uniform(0, 1000, (n, 2)), rng.uniform(1, 4, (n, 2)))
    rows[::3] += (-4000, -4000, 4000, 4000)
    tree, ids = Quadtree(rows), np.arange(n)
    build = tree.written
    for k in range(20):
        assert written(tree, lambda k=k: tree.move([k], tree.boxes[[k]] + 0.5)) < n / 4
    assert written(tree, lambda: tree.move(ids, tree.boxes + 1e-9)) < build / 10
    tree.check()
    builds, build_of = [0], Quadtree._build

    def counted(self: Quadtree) -> None:
        builds[0] += 1
        build_of(self)

    monkeypatch.setattr(Quadtree, "_build", counted)
    tree.move(ids[::3], np.full((len(ids[::3]), 4), 500.0))
    assert not builds[0], "they have come in"
    tree.move(ids[::3], rows[::3] + 20_000)
    assert builds[0] == 1, "they have left"
    other = Quadtree(rows[:0])
    for k in range(0, 1000, 2):
        other.insert(rows[k : k + 2])
    other.check()
    assert builds[0] < 40
    other = Quadtree(rows)
    other.remove(ids[::3])
    builds[0] = 0
    few = other.ids[:1000]
    other.move(few, rows[few] + 20_000)
    assert builds[0] == 1, "those that have gone do not count"


def test_a_grid_keeps_little_that_is_stale_or_fresh() -> None:
    rng = np.random.default_rng(3)
    rows = uniform(rng, 2000, 2)
    grid = Grid(rows, cell=2)
    due = len(grid._listings[0].entry)
    for _ in range(10):
        grid.move(np.arange(2000), uniform(rng, 2000, 2))
        assert sum(len(listing.entry) for listing in grid._listings) < 2.5 * due
    for k in range(0, 1800, 100):
        grid.remove(np.arange(k, k + 100))
        assert len(grid._listings[0].entry) <= max(2.2 * due * (1900 - k) / 2000, 100)
    grid = Grid(rows[:0], cell=2)
    for k in range(0, 2000, 10):
        grid.insert(rows[k : k + 10])
        assert len(grid._listings[1].entry) <= GRID_FRESH
    assert grid.written < 200 * 2000
    assert_same(BruteForce(rows), grid, rows[:40])


def test_work_is_cut_in_pieces() -> None:
    assert pieces(np.array([3, 3, 3, 3]), 12) == [slice(0, 4)]
    assert pieces(np.array([3, 3, 3, 3, 3]), 6) == [slice(0, 1), slice(1, 3), slice(3, 5)]
    assert pieces(np.array([1, 99, 1, 1]), 10) == [slice(0, 1), slice(1, 4)]
    assert pieces(np.array([], int), 10) == [slice(0, 0)]


@pytest.mark.parametrize(("make", "d"), ALL)
def test_answers_do_not_depend_on_the_pieces(make: Maker, d: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    rows, queries = one_huge(rng, 300, d), np.concatenate((uniform(rng, 40, d), one_huge(rng, 3, d)))
    structure = make(rows)
    structure.insert(rows[:20])
    due = structure.query(queries), structure.pairs(), np.sort(structure.work(queries).tested[1])
    for module in ("boxes", "grids", "quadtree", "bvh"):
        monkeypatch.setattr(
            f"hitplanes.planes.broadphase.{module}.CHUNK_{'PAIRS' if module == 'boxes' else 'SAMPLES'}", 37
        )
    got = structure.query(queries), structure.pairs(), np.sort(structure.work(queries).tested[1])
    assert all(np.array_equal(a, b) for a, b in zip(got, due, strict=True))


def test_queries_write_nothing() -> None:
    rows = uniform(np.random.default_rng(2), 1000, 2)
    for make in (BruteForce, Grid, Quadtree, Bvh):
        structure = make(rows)
        assert written(structure, lambda structure=structure: (structure.query(rows), structure.pairs())) == 0


def test_a_worn_bvh_is_planted_anew() -> None:
    rng = np.random.default_rng(2)
    rows = uniform(rng, 4000, 2)
    tree = Bvh(rows)
    tree.move(np.arange(4000), rng.permutation(rows))
    fresh = Bvh(tree.boxes)
    counts = [structure.work(rows[:200]).visited.shape[1] for structure in (tree, fresh)]
    assert counts[0] < 1.2 * counts[1]
    tree.check()


def test_a_bvh_shrinks_when_boxes_go() -> None:
    rows = uniform(np.random.default_rng(2), 4000, 2)
    tree = Bvh(rows)
    tree.remove(np.arange(3000))
    assert tree.work(rows[:1]).nodes <= 2 * Bvh(rows[3000:]).work(rows[:1]).nodes


def test_nodes_of_several_trees_have_numbers_of_their_own() -> None:
    rows = uniform(np.random.default_rng(2), 200, 2)
    tree = Bvh(rows)
    tree.insert(rows[:80] + 1000)
    assert len(tree._trees) == 2
    number, box, leaf = tree.cell_boxes()
    for query in (rows[:1], rows[:1] + 1000):
        visited = tree.work(query).visited[1]
        assert len(np.unique(visited)) == len(visited)
        assert meets(box[np.isin(number, visited) & leaf], query).any()


def test_a_tree_that_is_emptied_goes() -> None:
    rows = uniform(np.random.default_rng(2), 1370, 2)
    tree, plain = Bvh(rows[:1000]), BruteForce(rows[:1000])
    for each in (tree, plain):
        each.insert(rows[1000:1300])
        each.insert(rows[1300:])
    assert [len(each.ids) for each in tree._trees] == [1000, 300, 70]
    for each in (tree, plain):
        each.remove(np.arange(1000))
    tree.check()
    assert [len(each.ids) for each in tree._trees] == [300, 70]
    for each in (tree, plain):
        each.move(plain.ids[::3], plain.boxes[::3] + 0.5)
    assert_same(plain, tree, rows[:40])
    number, box, _ = tree.cell_boxes()
    visited = tree.work(rows[:40]).visited
    assert meets(box[np.searchsorted(number, visited[1])], rows[visited[0]]).all()
    tree.remove(plain.ids)
    tree.check()
    assert not tree._trees


@pytest.mark.parametrize("d", [2, 3])
def test_what_nobody_told_is_measured_when_boxes_come(d: int) -> None:
    rows = uniform(np.random.default_rng(3), 2000, d)
    grid, tree = Grid(rows[:0]), Bvh(rows[:0])
    for structure in (grid, tree):
        structure.insert(rows)
    assert grid.cell == Grid(rows).cell and tree.slack == Bvh(rows).slack > 0
    for structure in (grid, tree):
        structure.remove(structure.ids)
        structure.insert(100 * rows)
        structure.check()
    assert grid.cell == Grid(100 * rows).cell and tree.slack == Bvh(100 * rows).slack
    grid, tree = Grid(rows[:10] / 100), Bvh(rows[:10] / 100)
    for structure in (grid, tree):
        for k in range(0, 2000, 20):
            structure.insert(rows[k : k + 20])
        structure.check()
        assert structure.written < 200 * 2000
        assert np.array_equal(structure.pairs(), BruteForce(structure.boxes).pairs())
    assert 0.8 < grid.cell / Grid(rows).cell < 1.25 and 0.8 < tree.slack / Bvh(rows).slack < 1.25
    grid, tree = Grid(rows[:10] / 100, cell=0.5), Bvh(rows[:10] / 100, slack=0.5)
    for structure in (grid, tree):
        structure.insert(rows)
    assert grid.cell == tree.slack == 0.5


@pytest.mark.parametrize("d", [2, 3])
def test_boxes_that_change_their_size_are_measured_again(d: int) -> None:
    rows = uniform(np.random.default_rng(3), 500, d)
    grid, tree = Grid(rows), Bvh(rows)
    for structure in (grid, tree):
        structure.move(np.arange(500), 100 * rows)
        structure.check()
    assert 50 < grid.cell / Grid(rows).cell < 200 and tree.slack == Bvh(100 * rows).slack


def test_boxes_that_come_one_by_one_make_few_trees() -> None:
    rows = uniform(np.random.default_rng(4), 600, 2)
    tree = Bvh(rows[:0])
    for k in range(600):
        assert tree.insert(rows[k : k + 1]).tolist() == [k]
    assert len(tree._trees) < 8
    assert_same(BruteForce(rows), tree, rows[:40])


@pytest.mark.parametrize(("make", "d"), ALL)
def test_work_tells_what_was_looked_at(make: Maker, d: int) -> None:
    rng = np.random.default_rng(6)
    rows = boxes_from(rng.uniform(0, 60, (500, d)), rng.uniform(0, 1, (500, d)))
    structure, queries = make(rows), rows[:20]
    work = structure.work(queries)
    tested, found = set(map(tuple, work.tested.T.tolist())), set(map(tuple, structure.query(queries).T.tolist()))
    assert found <= tested <= {(q, b) for q in range(20) for b in range(500)}
    assert work.visited.size and work.visited[1].max() < work.nodes
    if not isinstance(structure, BruteForce) and not (isinstance(structure, Quadtree) and not structure.depth):
        assert len(tested) < 20 * 500 / 4


@pytest.mark.parametrize(("make", "d"), ALL)
def test_cells_are_where_a_query_looks(make: Maker, d: int) -> None:
    rng = np.random.default_rng(7)

    def small(n: int) -> Floats:
        return boxes_from(rng.uniform(0, 60, (n, d)), rng.uniform(0, 1, (n, d)))

    structure = make(small(400))
    for step in range(4):
        structure.check()
        number, box, leaf = structure.cell_boxes()
        boxes, queries = structure.boxes, small(20)
        work = structure.work(queries)
        assert len(np.unique(number)) == len(number) == len(box) == len(leaf) == work.nodes
        assert meets(boxes[:, None], box[leaf]).any(axis=1).all(), "a box is in no leaf"
        place = {int(n): k for k, n in enumerate(number)}
        visited = np.array([place[n] for n in work.visited[1].tolist()], np.int64)
        holds = box[visited, 0] <= box[visited, d]
        assert meets(box[visited], queries[work.visited[0]])[holds].all(), "a cell was visited in vain"
        for query, found in structure.query(queries).T.tolist():
            mine = visited[work.visited[0] == query]
            shared = meets(boxes[structure.ids == found], box[mine]) & meets(queries[query], box[mine])
            assert (shared & leaf[mine]).any(), "a pair shares no leaf that was visited"
        structure.remove(structure.ids[:: step + 3])
        structure.move(structure.ids[:100], small(100))
        structure.insert(small(30))
    structure.remove(structure.ids)
    number, box, leaf = structure.cell_boxes()
    visited = structure.work(small(9)).visited[1]
    assert len(number) == len(box) == len(leaf) and set(visited.tolist()) <= set(number.tolist())


def test_cells_of_each_structure() -> None:
    rows = np.array([[0, 0, 1, 1], [7, 0, 8, 1], [0, 7, 1, 8], [7, 7, 8, 8.0]])
    number, box, leaf = Quadtree(rows, capacity=3).cell_boxes()
    inf = np.inf
    quarters = [[-inf, -inf, 4, 4], [4, -inf, inf, 4], [-inf, 4, 4, inf], [4, 4, inf, inf]]
    assert box.tolist() == [[-inf, -inf, inf, inf], *quarters]
    assert leaf.tolist() == [False, True, True, True, True] and number.tolist() == [0, 1, 2, 3, 4]
    _, box, leaf = Grid(rows, cell=4).cell_boxes()
    assert box.tolist() == [[-1, -1, 3, 3], [-1, 7, 3, 11], [7, -1, 11, 3], [7, 7, 11, 11]] and leaf.all()
    grid = Grid(rows, cell=4)
    grid.remove([0])
    grid.insert([[0, 8, 1, 9]])
    assert grid.cell_boxes().box.tolist() == [[inf, inf, -inf, -inf], *box[1:].tolist(), [-1, 7, 3, 11]]
    _, box, leaf = Grid([[0, 1, 2, 0.5, 1.5, 2.5]], cell=1).cell_boxes()
    assert box.tolist() == [[0, 1, 2, 1, 2, 3]]
    _, box, leaf = Bvh(np.tile(rows, (5, 1))).cell_boxes()
    assert box.tolist() == [[0, 0, 8, 8], *rows[[0, 2, 1, 3]].tolist()]
    assert leaf.tolist() == [False, True, True, True, True]
    _, box, leaf = BruteForce(rows).cell_boxes()
    assert box.tolist() == [[0, 0, 8, 8]] and leaf.tolist() == [True]


@pytest.mark.parametrize(("make", "d"), ALL)
def test_nothing_has_no_cell_that_holds_anything(make: Maker, d: int) -> None:
    structure = make(np.empty((0, 2 * d)))
    number, box, leaf = structure.cell_boxes()
    assert box.shape == (len(number), 2 * d) and leaf.dtype == np.bool_ and len(leaf) == len(number) <= 1
    assert structure.work(np.zeros((3, 2 * d))).tested.shape == (2, 0)


@pytest.mark.parametrize("d", [2, 3])
def test_objects_of_parts(d: int) -> None:
    rng = np.random.default_rng(d)
    length = rng.integers(1, 6, 80)
    starts = np.append(0, np.cumsum(length))
    parts = uniform(rng, starts[-1], d)
    bodies, flat = PartsBvh(parts, starts), BruteForce(parts)
    owner = np.repeat(np.arange(80), length)

    def due(pairs: Ints) -> list[tuple[int, int]]:
        return sorted({(q, int(owner[b])) for q, b in pairs.T.tolist()})

    def told(pairs: Ints) -> list[tuple[int, ...]]:
        return list(map(tuple, pairs.T.tolist()))

    queries = uniform(rng, 30, d)
    for _ in range(3):
        bodies.check()
        assert told(bodies.query(queries)) == due(flat.query(queries))
        query, body, part = bodies.query_parts(queries)
        assert told(np.stack((query, starts[body] + part))) == told(flat.query(queries))
        crossing = {tuple(sorted((int(owner[a]), int(owner[b])))) for a, b in flat.pairs().T.tolist()}
        assert told(bodies.pairs()) == sorted(pair for pair in crossing if pair[0] < pair[1])
        moved = rng.permutation(80)[:30]
        rows = np.concatenate([np.arange(starts[k], starts[k + 1]) for k in moved])
        places = uniform(rng, len(rows), d)
        bodies.move(moved, places)
        flat.move(rows, places)
    more = uniform(rng, 3, d)
    assert bodies.insert(more, [0, 1, 3]).tolist() == [80, 81]
    bodies.remove([0])
    bodies.check()
    assert len(bodies) == 81
    assert {80, 81} <= set(bodies.query(more)[1].tolist()) and 0 not in bodies.query(queries)[1]
    assert len(PartsBvh(np.empty((0, 2 * d)), [0])) == 0


numbers = st.one_of(st.integers(-6, 6).map(float), st.sampled_from([0.5, -0.0, 1e300, -1e300, 5e-324]))


def some_boxes(d: int, least: int = 0, most: int = 12) -> st.SearchStrategy[Floats]:
    one = st.lists(st.tuples(numbers, numbers).map(sorted), min_size=d, max_size=d)
    rows = st.lists(one.map(lambda axes: [a for a, _ in axes] + [b for _, b in axes]), min_size=least, max_size=most)
    return rows.map(lambda values: np.array(values, float).reshape(-1, 2 * d))


class Changing(RuleBasedStateMachine):
    """All structures beside brute force."""

    dim = 2

    @initialize(data=st.data())
    def begin(self, data: st.DataObject) -> None:
        rows = data.draw(some_boxes(self.dim))
        self.plain: BroadPhase = BruteForce(rows)
        self.others = [make(rows) for make, dims in MAKERS.values() if self.dim in dims]

    def change(self, work: Callable[[BroadPhase], object]) -> None:
        for structure in (self.plain, *self.others):
            work(structure)
        for other in self.others:
            other.check()
            assert np.array_equal(self.plain.pairs(), other.pairs())

    @rule(data=st.data())
    def insert(self, data: st.DataObject) -> None:
        rows = data.draw(some_boxes(self.dim))
        self.change(lambda structure: structure.insert(rows))

    @precondition(lambda self: len(self.plain))
    @rule(data=st.data())
    def remove(self, data: st.DataObject) -> None:
        ids = data.draw(st.lists(st.sampled_from(self.plain.ids.tolist()), unique=True))
        self.change(lambda structure: structure.remove(ids))

    @precondition(lambda self: len(self.plain))
    @rule(data=st.data())
    def remove_oldest(self, data: st.DataObject) -> None:
        ids = self.plain.ids[: data.draw(st.integers(1, len(self.plain)))]
        self.change(lambda structure: structure.remove(ids))

    @precondition(lambda self: len(self.plain))
    @rule(data=st.data())
    def move(self, data: st.DataObject) -> None:
        ids = data.draw(st.lists(st.sampled_from(self.plain.ids.tolist()), unique=True, min_size=1))
        rows = data.draw(some_boxes(self.dim, len(ids), len(ids)))
        self.change(lambda structure: structure.move(ids, rows))

    @precondition(lambda self: len(self.plain))
    @rule(data=st.data(), step=st.sampled_from([0.25, -0.5, 1.0]))
    def nudge(self, data: st.DataObject, step: float) -> None:
        ids = data.draw(st.lists(st.sampled_from(self.plain.ids.tolist()), unique=True, min_size=1))
        rows = self.plain.boxes[np.searchsorted(self.plain.ids, ids)] + step
        self.change(lambda structure: structure.move(ids, rows))

    @rule(data=st.data())
    def query(self, data: st.DataObject) -> None:
        rows = data.draw(some_boxes(self.dim, 0, 5))
        for other in self.others:
            assert np.array_equal(self.plain.query(rows), other.query(rows))


class ChangingIn3D(Changing):
    dim = 3


@pytest.fixture
def few_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dozen boxes make several trees of several levels, and settle in a grid."""
    monkeypatch.setattr("hitplanes.planes.broadphase.bvh.BVH_SMALL", 4)
    monkeypatch.setattr("hitplanes.planes.broadphase.bvh.BVH_LEAF", 2)
    monkeypatch.setattr("hitplanes.planes.broadphase.grids.GRID_FRESH", 6)


@pytest.mark.usefixtures("few_are_many")
@pytest.mark.parametrize("machine", [Changing, ChangingIn3D])
def test_any_sequence_of_changes(machine: type[Changing]) -> None:
    run_state_machine_as_test(machine, settings=settings(max_examples=10, stateful_step_count=15, deadline=None))


@pytest.mark.long
@pytest.mark.usefixtures("few_are_many")
@pytest.mark.parametrize("machine", [Changing, ChangingIn3D])
def test_any_long_sequence_of_changes(machine: type[Changing]) -> None:
    run_state_machine_as_test(machine, settings=settings(max_examples=120, stateful_step_count=30, deadline=None))


MILLION = pytest.mark.parametrize(("make", "d"), [(Grid, 2), (Grid, 3), (Quadtree, 2), (Bvh, 2), (Bvh, 3)])


@pytest.mark.long
@MILLION
def test_a_million_boxes(make: Maker, d: int) -> None:
    rng = np.random.default_rng(0)
    n = 10**6
    rows = boxes_from(rng.uniform(0, n ** (1 / d), (n, d)), rng.uniform(0, 1, (n, d)))
    rows[0] = np.repeat((-1e300, 1e300), d)
    structure, plain = make(rows), BruteForce(rows)
    queries = np.concatenate((rows[1:50], one_spot(rng, 1, d), extreme(rng, 3, d)))
    assert np.array_equal(structure.query(queries), plain.query(queries))
    assert structure.work(rows[1:1001]).tested.shape[1] < 1000 * 300, "one huge box made all others slow"
    moved = np.arange(0, n, 100)
    for each in (structure, plain):
        each.move(moved, rows[moved[::-1]])
    assert np.array_equal(structure.query(queries), plain.query(queries))
    few = rng.permutation(n)[:1000]
    for each in (structure, plain):
        each.remove(np.setdiff1d(each.ids, few))
    structure.check()
    assert len(structure) == 1000 and np.array_equal(structure.query(queries), plain.query(queries))
    structure.remove(few)
    structure.check()
    assert structure.query(queries).shape == structure.pairs().shape == (2, 0)


@pytest.mark.long
@MILLION
def test_a_million_boxes_in_one_spot(make: Maker, d: int) -> None:
    n = 10**6
    spot = np.full((n, 2 * d), 7.0)
    structure = make(spot)
    assert structure.query(spot[:1]).shape == (2, n) and structure.query(np.zeros((9, 2 * d))).shape == (2, 0)
    structure.move(np.arange(0, n, 2), spot[::2] + 1)
    structure.check()
    assert np.array_equal(structure.query(spot[:1] + 1)[1], np.arange(0, n, 2))
    assert np.array_equal(structure.query(spot[:1])[1], np.arange(1, n, 2))
