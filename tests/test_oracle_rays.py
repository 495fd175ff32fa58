"""The slow reference for traced weapons: pictures worked out by hand, and its two thin rays against each other."""

import math
import random
from fractions import Fraction

import pytest
from oracle_rays import (
    Item,
    Pass,
    Pixel,
    StartsInside,
    Walk,
    entered_side,
    joined,
    mask_normal,
    path_of,
    thick_cells,
    thin_cells,
    thin_times,
    walk,
)
from some_of import some_of

PX = 256
Point = tuple[float, float]


def units(at: Point) -> tuple[int, int]:
    """A position in px that lies on the grid, in 1/256 px."""
    x, y = (Fraction(v) * PX for v in at)
    assert x.denominator == y.denominator == 1
    return int(x), int(y)


def cells_of(a: Point, b: Point, width: float = 0) -> set[Pixel]:
    return set(path_of(units(a), units(b), int(width * PX / 2)).cells)


def drawn(picture: str, letter: str, item: int = 0, cost: int = 1) -> Item:
    """What a letter covers in a picture; '#' is an occluder."""
    rows = [row.strip() for row in picture.strip().splitlines()]
    pixels = {(x, y) for y, row in enumerate(rows) for x, c in enumerate(row) if c == letter}
    assert pixels
    return Item(item, letter == "#", pixels, cost)


def shot(a: Point, b: Point, *items: Item, width: float = 0, **options: object) -> Walk:
    return walk(units(a), units(b), int(width * PX / 2), items, **options)  # type: ignore[arg-type]


def only(found: Walk) -> Pass:
    (one,) = found.passes
    return one


def px(found: Walk, time: Fraction | int) -> float:
    """How far along the ray."""
    return found.path.px(time)


# Cells


def test_a_diagonal_meets_what_touches_its_corners() -> None:
    cells = cells_of((0, 0), (20, 20))
    assert len(cells) == 61
    assert cells == {(x, y) for x in range(21) for y in range(21) if abs(x - y) <= 1}
    times = thin_cells((0, 0), units((20, 20)))
    assert times[1, 1] == (Fraction(1, 40), Fraction(3, 40))
    assert times[1, 0] == times[0, 1] == (Fraction(1, 40), Fraction(1, 40))
    assert times[0, 0] == (0, Fraction(1, 40)) and times[20, 20] == (Fraction(39, 40), 1)


def test_a_ray_between_two_rows_meets_both() -> None:
    assert cells_of((0, 2.5), (3, 2.5)) == {(x, y) for x in range(4) for y in (2, 3)}
    assert cells_of((1.5, 0), (1.5, -2)) == {(x, y) for x in (1, 2) for y in (0, -1, -2)}
    assert cells_of((0, 2.5 - 1 / 256), (3, 2.5 - 1 / 256)) == {(x, 2) for x in range(4)}
    assert cells_of((0, 0), (1.5, 0)) == {(0, 0), (1, 0), (2, 0)}


def test_a_ray_of_no_length_meets_the_squares_about_a_point() -> None:
    assert thin_cells((128, 128), (128, 128)) == {(x, y): (0, 0) for x in (0, 1) for y in (0, 1)}
    assert cells_of((0.5, 0), (0.5, 0)) == {(0, 0), (1, 0)}
    assert cells_of((0.25, 0), (0.25, 0)) == {(0, 0)}
    assert cells_of((0, 0), (0, 0), 2) == {(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)}
    assert thick_cells((0, 0), (0, 0), 256)[0][1, 0] == (0, 0)


def test_a_thick_ray_has_round_ends_and_times_of_its_own() -> None:
    """Radius 5 px along a row: 3 rows off it, a centre is reached 4 px before, and left 4 px after."""
    cells, scale = thick_cells(units((0, 0)), units((20, 0)), 5 * PX)
    assert scale == (20 * PX) ** 2
    assert cells[10, 3] == cells[10, -3] == (6 * PX * 20 * PX, 14 * PX * 20 * PX)
    assert cells[10, 5] == (10 * PX * 20 * PX,) * 2 and (10, 6) not in cells
    assert cells[-4, 3] == (0, 0) and cells[-5, 0] == (0, 0) and (-4, 4) not in cells
    assert cells[24, -3] == (scale, scale) and cells[2, 0] == (0, 7 * PX * 20 * PX)
    assert len(cells) == 81 + 20 * 11


def test_roots_are_cut_off() -> None:
    """A centre one row off, radius 1 1/256 px: reached sqrt(257^2 - 256^2) / 256 px before."""
    cells, scale = thick_cells(units((0, 0)), units((9, 0)), 257)
    half = math.isqrt((257**2 - 256**2) * scale)
    assert cells[4, 1] == (4 * 9 * PX**2 - half, 4 * 9 * PX**2 + half)
    assert half**2 < (257**2 - 256**2) * scale


def test_an_axis_without_centres_is_there_all_the_same() -> None:
    cells, scale = thick_cells(units((0, 0.375)), units((10, 0.375)), 51)
    assert set(cells) == {(x, 0) for x in range(11)} and scale == (10 * PX) ** 2
    assert cells[1, 0] == (128 * 10 * PX, 384 * 10 * PX)


SPOTS = [v / 2 for v in range(-6, 7)] + [v / 4 for v in range(-7, 8)] + [v / 256 for v in (-385, -1, 3, 127, 200, 511)]


def some_end(rng: random.Random) -> tuple[int, int]:
    if rng.random() < 0.2:
        return rng.randint(-900, 900), rng.randint(-900, 900)
    return units((rng.choice(SPOTS), rng.choice(SPOTS)))


@pytest.mark.parametrize("seed", range(8))
def test_whole_numbers_and_fractions_find_the_same_cells(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(100):
        a, b = some_end(rng), some_end(rng)
        if rng.random() < 0.2:
            b = (a[0], b[1]) if rng.random() < 0.5 else (b[0], a[1])
        cells, scale = thin_times(a, b)
        exact = thin_cells(a, b)
        assert exact == {c: (Fraction(entry, scale), Fraction(leave, scale)) for c, (entry, leave) in cells.items()}


@pytest.mark.parametrize("seed", some_of(range(20)))
def test_cells_are_those_that_a_fine_walk_along_the_ray_sees(seed: int) -> None:
    """At every moment that divides the ray, the squares about the point are cells, at a time within theirs."""
    rng = random.Random(seed)
    a, b = some_end(rng), some_end(rng)
    cells, seen = thin_cells(a, b), set()
    for moment in {t for both in cells.values() for t in both} | {Fraction(i, 40) for i in range(41)}:
        x, y = (s + moment * (e - s) for s, e in zip(a, b, strict=True))
        about = [(i, j) for i in range(-9, 10) for j in range(-9, 10)
                 if abs(x - PX * i) <= 128 and abs(y - PX * j) <= 128]  # fmt: skip
        assert about and all(a == b or cells[c][0] <= moment <= cells[c][1] for c in about)
        seen |= set(about)
    assert seen == set(cells)


# The walk


def test_no_ray_passes_a_diagonal_wall() -> None:
    wall = Item(7, True, {(i, -i) for i in range(-30, 31)})
    behind = Item(1, False, {(x, y) for x in range(-40, 41) for y in range(-40, 41) if x + y > 0})
    rng = random.Random(1)
    for _ in range(200):
        a = units((-rng.randint(2, 16) / 2, -rng.randint(2, 16) / 2))
        b = units((rng.randint(2, 16) / 2, rng.randint(2, 16) / 2))
        found = walk(a, b, 0, [behind, wall])
        assert (found.stop.reason, found.stop.item, found.passes) == ("occluder", 7, []), (a, b)


def test_a_hole_is_no_material() -> None:
    ring = drawn(
        """
        .......
        .ooooo.
        .o...o.
        .o...o.
        .ooooo.
        .......""",
        "o", 4,
    )  # fmt: skip
    found = shot((0, 2), (6, 2), ring)
    one = only(found)
    assert (one.object, one.order, one.cells, one.exit_xy) == (4, 0, [(1, 2), (5, 2)], (5, 2))
    assert (px(found, one.entry), px(found, one.exit), one.material) == (0.5, 5.5, 2.0)
    assert one.normal == (-12, -6) and found.stop.reason == "range"
    assert only(shot((0, 1), (6, 1), ring)).material == 5.0
    assert only(shot((0, 1.5), (6, 1.5), ring)).material == 5.0  # the border of two rows counts once
    assert only(shot((0, 5), (6, -1), ring)).material == 2 * math.sqrt(2)


def test_normals_come_of_the_mask_or_of_the_side() -> None:
    block = {(x, y) for x in range(1, 9) for y in range(1, 9)}
    assert mask_normal(block, (1, 4)) == (-(1 * 2 + 2 * 1) * (1 + 2 + 3 + 2 + 1), 0)
    assert mask_normal(block, (4, 8))[0] == 0 < mask_normal(block, (4, 8))[1]
    assert mask_normal(block, (1, 1)) == (-24, -24) and mask_normal(block, (4, 4)) == (0, 0)
    dot = drawn("..a..", "a")
    assert only(shot((0, 0), (4, 0), dot)).normal == (-1, 0)
    assert only(shot((4, 0.25), (0, 0.25), dot)).normal == (1, 0)
    assert only(shot((2, -3), (2, 3), dot)).normal == (0, -1)
    assert only(shot((0, -2), (4, 2), dot)).normal == (-1, -1)
    assert only(shot((2, 0), (4, 2), dot)).normal == (0, 0)
    assert only(shot((1.5, 0), (4, 0), dot)).normal == (-1, 0)
    assert entered_side(units((1.5, 0)), units((1.5, 0)), (2, 0)) == (0, 0)
    assert only(shot((0, 0), (4, 0), dot, width=2)).normal is None


def test_a_budget_ends_in_the_middle() -> None:
    wall = drawn("..aaaaa..", "a", 3, cost=2)
    found = shot((0, 0), (8, 0), wall, budget_256=5 * PX)
    assert (found.stop.reason, px(found, found.stop.time), found.stop.item) == ("budget", 4.0, 3)
    one = only(found)
    assert (one.cells, one.exit_xy, px(found, one.exit), one.material) == ([(2, 0), (3, 0), (4, 0)], (4, 0), 4.0, 2.5)
    slanted = shot((0, 0), (8, 0.25), wall, budget_256=5 * PX)
    assert only(slanted).material == 2.5 and slanted.stop.reason == "budget"
    assert found.stop.cell_xy == (4, 0)


def test_a_budget_ends_also_in_the_last_cell() -> None:
    wall = drawn("..aaaaa..", "a", 3)
    found = shot((0, 0), (4.25, 0), wall, budget_256=5 * PX // 2)
    assert (found.stop.reason, px(found, found.stop.time), found.walked) == ("budget", 4.0, 5)
    assert (only(found).cells[-1], px(found, only(found).exit)) == ((4, 0), 4.0)
    assert shot((0, 0), (4, 0), wall, budget_256=5 * PX // 2).stop.reason == "budget"
    assert shot((0, 0), (4, 0), wall, budget_256=5 * PX // 2 + 1).stop.reason == "range"


def test_what_is_just_enough_is_used_up() -> None:
    """All is spent on the first: the ray ends where it leaves it."""
    a, b = drawn("..aaa..bb.", "a", 0), drawn("..aaa..bb.", "b", 1)
    found = shot((0, 0), (9, 0), a, b, budget_256=3 * PX)
    assert [(one.object, one.cells, one.material) for one in found.passes] == [(0, [(2, 0), (3, 0), (4, 0)], 3.0)]
    assert (found.stop.reason, px(found, found.stop.time), found.walked) == ("budget", 4.5, 5)
    assert (found.stop.item, found.stop.cell_xy) == (0, (4, 0))
    for budget, objects in ((-1, [0]), (1, [0, 1])):
        assert [p.object for p in shot((0, 0), (9, 0), a, b, budget_256=3 * PX + budget).passes] == objects


def test_a_budget_of_nothing_is_used_up_at_the_muzzle() -> None:
    free = drawn(".aaaa.", "a", 0, cost=0)
    for begin in ((0, 0), (2, 0)):
        found = shot(begin, (5, 0), free, budget_256=0)
        assert (found.stop.reason, found.stop.time, found.passes, found.walked) == ("budget", 0, [], 0)
        assert (found.stop.item, found.stop.cell_xy) == (None, begin)


def test_two_objects_in_one_place_cost_both() -> None:
    a, b = drawn(".aaaa.", "a", 0, cost=1), drawn(".aaaa.", "a", 1, cost=3)
    found = shot((0, 0), (5, 0), a, b, budget_256=6 * PX)
    assert (px(found, found.stop.time), [one.material for one in found.passes]) == (2.0, [1.5, 1.5])


def test_the_first_hit_and_the_second() -> None:
    a, b = drawn(".aa..bb", "a", 0), drawn(".aa..bb", "b", 1)
    found = shot((0, 0), (7, 0), b, a, max_hits=1)
    one = only(found)
    assert (one.object, one.cells, px(found, one.exit), one.exit_xy, one.material) == (0, [(1, 0)], 0.5, (1, 0), 0.0)
    assert (found.stop.reason, found.stop.item, found.stop.cell_xy) == ("hits", 0, (1, 0))
    found = shot((0, 0), (7, 0), b, a, max_hits=2)
    assert [(p.object, p.material) for p in found.passes] == [(0, 2.0), (1, 0.0)]
    assert shot((0, 0), (7, 0), b, a, max_hits=3).stop.reason == "range"


def test_of_what_lies_in_one_place_the_front_comes_first() -> None:
    a, b, wall = (drawn(".aa", "a", i) for i in range(3))
    wall = Item(2, True, wall.pixels)
    assert [p.object for p in shot((0, 0), (3, 0), b, a).passes] == [1, 0]
    assert [p.object for p in shot((0, 0), (3, 0), b, wall, a).passes] == [1]
    assert shot((0, 0), (3, 0), wall, b, a).passes == []


def test_a_wall_at_the_corner_comes_before_the_cells_beside_it() -> None:
    """From (0, 0) to (1, 1): three cells are entered at the corner, and the one with the wall first."""
    target, wall = Item(0, False, {(1, 0), (0, 1)}), Item(1, True, {(1, 1)})
    assert shot((0, 0), (2, 2), target, wall).passes == []
    assert shot((0, 0), (2, 2), target).order[:4] == [(0, 0), (1, 0), (0, 1), (1, 1)]
    assert shot((0, 0), (2, 2), target, wall).order[:4] == [(0, 0), (1, 1), (1, 0), (0, 1)]


C_SHAPE = """
    ccccc
    c....
    ccccc"""


def test_what_a_ray_starts_in_is_ignored_until_it_is_left() -> None:
    c = drawn(C_SHAPE, "c")
    assert only(shot((2, 0), (2, 3), c)).cells == [(2, 0), (2, 2)]
    found = shot((2, 0), (2, 3), c, inside="ignore_until_exit")
    one = only(found)
    assert (one.cells, px(found, one.entry), one.material) == ([(2, 2)], 1.5, 1.0)
    assert only(shot((2, 0.5), (2, 3), c, inside="ignore_until_exit")).cells == [(2, 2)]  # starts on its border
    assert shot((2, 0), (8, 0), c, inside="ignore_until_exit").passes == []
    assert len(only(shot((2, -1), (2, 3), c, inside="ignore_until_exit")).cells) == 2
    wall = Item(1, True, c.pixels)
    found = shot((2, 0), (2, 3), wall, inside="ignore_until_exit")
    assert (found.stop.reason, found.stop.cell_xy, px(found, found.stop.time)) == ("occluder", (2, 2), 1.5)
    assert shot((2, 0), (2, 3), wall).stop.time == 0


def test_a_corner_keeps_what_is_left_together() -> None:
    """Two cells that touch at a corner are one stay; a budget does not begin before it is over."""
    steps = Item(0, False, {(0, 0), (1, 1), (3, 3)})
    found = shot((0, 0), (4, 4), steps, inside="ignore_until_exit", budget_256=PX // 2)
    one = only(found)
    assert one.cells == [(3, 3)] and found.stop.reason == "budget"
    assert math.isclose(one.material, 0.5, rel_tol=1e-15)


def test_to_start_inside_may_be_an_error() -> None:
    c = drawn(C_SHAPE, "c", 5)
    with pytest.raises(StartsInside) as told:
        shot((2, 0), (2, 3), c, inside="error")
    assert told.value.args == (5,)
    assert shot((2, 1), (2, 1.25), c, inside="error").passes == []
    assert shot((2, 0), (2, 1), c, inside="error", bounds=(0, 1, 9, 9)).passes == []


def test_only_pixels_within_the_bounds_count() -> None:
    bar = drawn("aaaaaa", "a")
    found = shot((0, 0), (5, 0), bar, bounds=(1, 0, 3, 0))
    one = only(found)
    assert (one.cells, one.material, px(found, one.exit)) == ([(1, 0), (2, 0), (3, 0)], 3.0, 3.5)
    assert one.normal == mask_normal(bar.pixels, (1, 0)), "the mask itself is not cut"


def test_the_exit_is_the_last_of_the_cells_left_last() -> None:
    """Along the border of two rows both cells of a column are left at once: the lower one is named."""
    block = Item(0, False, {(x, y) for x in (1, 2) for y in (0, 1)})
    one = only(shot((0, 0.5), (4, 0.5), block))
    assert one.cells == [(1, 0), (1, 1), (2, 0), (2, 1)] and one.exit_xy == (2, 1)
    stopped = shot((0, 0.5), (4, 0.5), Item(1, False, {(2, 0)}), block, max_hits=2)
    assert [(p.object, p.cells, p.exit_xy) for p in stopped.passes] == [
        (0, [(1, 0), (1, 1)], (1, 1)),
        (1, [(2, 0)], (2, 0)),
    ]


def test_intervals_that_touch_are_one() -> None:
    assert joined([(3, 4), (0, 1), (1, 2), (4, 4), (6, 7)]) == [(0, 2), (3, 4), (6, 7)]
    assert joined([]) == []
