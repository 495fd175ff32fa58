"""The slow reference for line of sight of areas: pictures worked out by hand, its laws, and rays as a second way."""

import random
from collections.abc import Callable
from dataclasses import replace

import oracle_rays
import pytest
from oracle_shelter import Pellet, ShelteredWalk, StartsInside, entered, fire_sheltered, judge, supercover
from oracle_stack import Item, Pixel, at_pixel, fire_one

EVERY = {"accept": 1, "blocked_by": 1}
SIGHTS = (None, "occluders", "all")


def item(number: int, pixels: set[Pixel], *, occluder: bool = False, layer: int = 0, **how: int) -> Item:
    return Item(number, occluder, layer, how.get("categories", 1), how.get("owner", -1), frozenset(pixels))


def row(number: int, letters: str, **how: int) -> Item:
    """An item on the row y = 0 from x = 0 on; '#' is a pixel of an occluder, any other letter but '.' of an object."""
    pixels = {(x, 0) for x, letter in enumerate(letters) if letter != "."}
    return item(number, pixels, occluder="#" in letters, **how)


def see(
    items: list[Item], p: Pixel, o: Pixel = (0, 0), sight: str | None = "occluders", **how: object
) -> ShelteredWalk:
    return judge(items, o, p, line_of_sight=sight, **{**EVERY, **how})  # type: ignore[arg-type]


def told(found: ShelteredWalk) -> tuple[str, list[int], int | None]:
    """Verdict, ids of what was hit, id of what sheltered."""
    return found.verdict, [i.id for i in found.hit], found.sheltered_by.id if found.sheltered_by else None


# Pictures: '@' is the pellet's own pixel, '#' a pixel of the wall that is seen, '%' one that is sheltered,
# 'x' a sheltered pixel without an item, '.' one that is seen.

BESIDE = """
    ...........
    ...........
    .........xx
    ......xxxxx
    ...xxxxxxxx
    @.#xxxxxxxx
    ...xxxxxxxx
    ......xxxxx
    .........xx
    ...........
    ..........."""
"""The near edge is at x = 3/2 and ends at y = 1/2: the slope 1/3 touches its corner, as of (3, 1), (6, 2), (9, 3)."""

NEXT = """
    @.....
    .#xx..
    .xxxxx
    .xxxxx
    ..xxxx
    ..xxxx"""
"""The corners of the wall have the slopes 1/3, as of (3, 1), and 3, as of (1, 3)."""

TOUCHED = """
    ..xxx
    .xxxx
    @#xxx
    .xxxx
    ..xxx"""
"""The diagonal passes the corner of the wall, at (1/2, 1/2), and is blocked."""

DIAGONAL = """
    @.....#
    .....#x
    ....#xx
    ...#xxx
    ..#xxxx
    .#xxxxx
    #xxxxxx"""
"""Pixels that touch only at corners let nothing through, and do not shelter each other."""

GAP = """
    ...%xxxxxxx
    ...%xxxxxxx
    ...%xxxxxxx
    ...#xxxxxxx
    ...#xxxx...
    @..........
    ...#xxxx...
    ...#xxxxxxx
    ...%xxxxxxx
    ...%xxxxxxx
    ...%xxxxxxx"""
"""The far corners of the hole are at (7/2, 1/2): a slope below 1/7 passes, 1/7 touches, as of (7, 1).

Of the wall, (3, 2) is entered from (2, 2); the segment to (3, 3) touches (3, 2) at the corner (5/2, 5/2).
"""

THICK = """
    ...xxxx
    ..xxxxx
    ..#%%xx
    @.#%%xx
    ..#%%xx
    ..xxxxx
    ...xxxx"""
"""The near corners are at (3/2, 3/2): the slope 1 touches. The wall shelters itself behind its first column."""


PICTURES = {
    "beside": BESIDE, "next": NEXT, "touched": TOUCHED, "diagonal": DIAGONAL, "gap": GAP, "thick": THICK,
}  # fmt: skip


def drawn(picture: str) -> tuple[list[str], Pixel, set[Pixel]]:
    rows = [line.strip() for line in picture.strip().splitlines()]
    at = {(x, y): letter for y, line in enumerate(rows) for x, letter in enumerate(line)}
    (own,) = (pixel for pixel, letter in at.items() if letter == "@")
    return rows, own, {pixel for pixel, letter in at.items() if letter in "#%"}


def shown(rows: list[str], own: Pixel, wall: set[Pixel], seen: Callable[[Pixel], ShelteredWalk]) -> list[str]:
    letters = {}
    for y, line in enumerate(rows):
        for x in range(len(line)):
            found = seen((x, y))
            assert found.verdict == ("occluded" if found.shelters or (x, y) in wall else "empty")
            letters[x, y] = ("%" if found.shelters else "#") if (x, y) in wall else "x" if found.shelters else "."
    letters[own] = letters[own].replace(".", "@")
    return ["".join(letters[x, y] for x in range(len(line))) for y, line in enumerate(rows)]


@pytest.mark.parametrize("picture", PICTURES.values(), ids=PICTURES)
def test_a_wall_has_the_shadow_of_the_picture(picture: str) -> None:
    rows, own, wall = drawn(picture)
    items = [item(5, wall, occluder=True)]
    assert shown(rows, own, wall, lambda p: see(items, p, own)) == rows


def test_a_wall_of_objects_throws_the_same_shadow_with_all() -> None:
    rows, own, wall = drawn(GAP)
    one_by_one = [item(number, {pixel}) for number, pixel in enumerate(sorted(wall))]
    for x, y in ((x, y) for y, line in enumerate(rows) for x in range(len(line))):
        found = see(one_by_one, (x, y), own, "all")
        assert found.verdict == {"%": "occluded", "x": "occluded", "#": "hit"}.get(rows[y][x], "empty"), (x, y)
        assert not see(one_by_one, (x, y), own).shelters


# The way


def test_the_way_is_all_that_touches_the_segment() -> None:
    assert set(supercover(2, 1)) == {(0, 0), (1, 0), (1, 1), (2, 1)}  # its middle is on the border of (1, 0) and (1, 1)
    assert set(supercover(3, 1)) == {(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (3, 1)}  # corners at x = 3/2 only
    assert set(supercover(-1, 1)) == {(0, 0), (-1, 0), (0, 1), (-1, 1)}
    assert set(supercover(0, -2)) == {(0, 0), (0, -1), (0, -2)} and set(supercover(0, 0)) == {(0, 0)}


def test_the_way_is_that_of_a_separating_axis() -> None:
    """A square misses a segment iff they are apart in x, in y, or across the segment."""
    for dx in range(-7, 8):
        for dy in range(-7, 8):
            box = ((x, y) for x in range(min(0, dx), max(0, dx) + 1) for y in range(min(0, dy), max(0, dy) + 1))
            assert set(supercover(dx, dy)) == {(x, y) for x, y in box if 2 * abs(x * dy - y * dx) <= abs(dx) + abs(dy)}


def test_nothing_is_on_the_way_to_the_own_pixel() -> None:
    wall = row(5, "##")
    assert told(see([wall], (0, 0))) == ("occluded", [], None)
    assert told(see([wall, row(1, "a", layer=1)], (0, 0))) == ("hit", [1], None)
    assert told(see([], (0, 0))) == ("empty", [], None)


# At the pixel


def test_on_a_pixel_of_a_wall_the_stack_decides() -> None:
    wall, thick = row(5, "..#"), row(5, "..##")
    front, behind = row(1, "..aa", layer=1), row(2, "..aa", layer=-1)
    assert told(see([wall, front], (2, 0))) == ("hit", [1], None)
    assert told(see([wall, behind], (2, 0))) == ("occluded", [], None)
    assert told(see([wall, front], (3, 0))) == ("occluded", [], 5)
    found = see([thick, front, behind], (3, 0))
    assert told(found) == ("occluded", [], 5) and found.ended_by is found.sheltered[0] is front
    found = see([thick, behind], (3, 0))
    assert told(found) == ("occluded", [], 5) and found.ended_by is thick and not found.sheltered


def test_an_object_shelters_another_and_not_itself() -> None:
    a, b = row(1, "..aaa..."), row(2, "......b.")
    for x, expected in enumerate(["empty", "empty", "hit", "hit", "hit", "occluded", "occluded", "occluded"]):
        found = see([a, b], (x, 0), sight="all")
        assert told(found) == (expected, [1] if expected == "hit" else [], 1 if expected == "occluded" else None), x
    assert told(see([a, b], (6, 0))) == ("hit", [2], None), "objects shelter only with all"
    assert told(see([a, b, row(7, "#")], (1, 0), sight="all")) == ("occluded", [], 7), "occluders shelter with all, too"


def test_two_objects_in_one_place_shelter_each_other_behind_their_first_pixel() -> None:
    low, high = row(1, "..aaa."), row(2, "..aaa.", layer=1)
    for pierce, both in ((False, [2]), (True, [2, 1])):
        assert told(see([low, high], (2, 0), sight="all", pierce=pierce)) == ("hit", both, None)
        found = see([low, high], (3, 0), sight="all", pierce=pierce)
        assert told(found) == ("occluded", [], 1), "not by itself, though it is in front"
        assert [i.id for i in found.sheltered] == both
    assert told(see([low, high], (5, 0), sight="all")) == ("occluded", [], 2)


def test_a_sheltered_object_ends_the_walk_unless_it_pierces() -> None:
    below, above = row(1, "..aa"), row(2, "...a", layer=1)
    found = see([below, above], (3, 0), sight="all")
    assert told(found) == ("occluded", [], 1) and found.ended_by is above
    found = see([below, above], (3, 0), sight="all", pierce=True)
    assert told(found) == ("hit", [1], None) and found.sheltered == [above] and found.ended_by is None
    wall = row(5, "...#", layer=0)
    found = see([below, above, wall], (3, 0), sight="all", pierce=True)
    assert told(found) == ("occluded", [], 1) and found.ended_by is wall


def test_pierce_hits_all_that_is_seen() -> None:
    a, b, wall = row(1, "...a"), row(2, "...b"), row(5, ".#..")
    assert told(see([a, b], (3, 0), pierce=True)) == ("hit", [2, 1], None)
    found = see([a, b, wall], (3, 0), pierce=True)
    assert told(found) == ("occluded", [], 5) and found.sheltered == [b, a] and found.ended_by is None


def test_what_is_refused_shelters_nothing() -> None:
    target, wall = row(1, "....t"), row(5, ".#..", categories=2)
    other = row(3, "..o..", categories=2)
    assert told(see([target, wall, other], (4, 0), sight="all")) == ("hit", [1], None)
    assert told(see([target, wall, other], (4, 0), sight="all", blocked_by=2)) == ("occluded", [], 5)
    assert told(see([target, wall, other], (4, 0), sight="all", accept=3)) == ("occluded", [], 3)
    assert told(see([target, row(5, ".#..", owner=8)], (4, 0), exclude=[8])) == ("hit", [1], None)


def test_a_verdict_of_shelter_comes_before_filtered_and_after_hit() -> None:
    skipped, wall = row(1, "...a", categories=2), row(5, ".#..")
    found = see([skipped], (3, 0))
    assert told(found) == ("filtered", [], None) and found.skipped == [skipped]
    found = see([skipped, wall], (3, 0))
    assert told(found) == ("occluded", [], 5) and found.skipped == [skipped]


# What sheltered


def test_the_first_on_the_way_decides_and_then_the_front() -> None:
    near, far = row(5, ".#...", layer=-3), row(6, "...#.", layer=3)
    assert told(see([far, near], (5, 0))) == told(see([near, far], (5, 0))) == ("occluded", [], 5)
    across, down = item(5, {(1, 0)}, occluder=True), item(6, {(0, 1)}, occluder=True)
    assert told(see([across, down], (1, 1))) == ("occluded", [], 6), "both are entered at the corner: the later added"
    assert told(see([down, across], (1, 1))) == ("occluded", [], 5)
    assert told(see([replace(across, layer=1), down], (1, 1))) == ("occluded", [], 5)
    assert told(see([replace(across, occluder=False), down], (1, 1), sight="all")) == ("occluded", [], 6)


def test_the_object_that_was_not_hit_does_not_count_as_its_own_shelter() -> None:
    a, b = row(1, "..a.a"), row(2, "...b.")
    found = see([a, b], (4, 0), sight="all")
    assert told(found) == ("occluded", [], 2) and found.shelters == [a, b]
    wall = row(5, "....#", layer=1)
    assert told(see([a, b, wall], (4, 0), sight="all")) == ("occluded", [], 1), "the wall ended it before a was met"


def test_times_of_entry_are_exact() -> None:
    """A knight's move enters (1, 0) at a quarter and (1, 1) at a half: those of the pixels that count."""
    both = item(5, {(1, 0), (1, 1)}, occluder=True)
    assert entered(both, (0, 0), (2, 1), "hit", None) == 0.25
    assert entered(both, (0, 0), (2, 1), "hit", (0, 1, 9, 9)) == 0.5
    assert entered(both, (0, 0), (1, 1), "hit", None) == 0.5
    assert entered(both, (0, 0), (1, 0), "hit", None) is None
    assert entered(both, (1, 0), (3, 0), "hit", None) == 0


# Inside


WALL = "###.#."


def test_who_starts_in_a_wall_sees_nothing_by_default() -> None:
    wall, front = row(5, WALL), row(1, "aaaaaa", layer=1)
    for x in range(6):
        assert told(see([wall, front], (x, 0))) == (("occluded", [], 5) if x else ("hit", [1], None))
        assert told(see([wall, front], (x, 0), sight=None)) == ("hit", [1], None)


def test_what_a_pellet_starts_in_is_ignored_until_it_is_left() -> None:
    wall, front = row(5, WALL), row(1, "aaaaaa", layer=1)
    how = {"inside": "ignore_until_exit"}
    for x in range(6):
        hit = told(see([wall, front], (x, 0), **how))
        assert hit == (("hit", [1], None) if x < 5 else ("occluded", [], 5)), x
        alone = see([wall], (x, 0), **how)
        assert told(alone) == ("empty" if x == 3 else "occluded", [], 5 if x == 5 else None), x
    other = row(6, ".#....")
    assert told(see([wall, front, other], (2, 0), **how)) == ("occluded", [], 6), "only what it starts in"
    assert told(see([wall, front], (2, 0), (3, 0), **how)) == ("hit", [1], None)
    assert told(see([wall, front], (1, 0), (3, 0), **how)) == ("occluded", [], 5)


def test_pixels_that_touch_at_a_corner_are_one_stay() -> None:
    steps = item(5, {(0, 0), (1, 1), (3, 3)}, occluder=True)
    seen = [not see([steps], (i, i), inside="ignore_until_exit").shelters for i in range(6)]
    assert seen == [True, True, True, True, False, False]
    apart = item(5, {(0, 0), (2, 1)}, occluder=True)  # left at x = 1/2, entered at x = 3/2
    assert see([apart], (4, 2), inside="ignore_until_exit").shelters == [apart]
    joined = item(5, {(0, 0), (1, 0), (2, 1)}, occluder=True)  # left (1, 0) at x = 1, with (1, 1) between
    assert see([joined], (4, 2), inside="ignore_until_exit").shelters == [joined]
    bridged = item(5, {(0, 0), (1, 0), (1, 1), (2, 1)}, occluder=True)
    assert see([bridged], (4, 2), inside="ignore_until_exit").shelters == []


def test_an_object_that_a_pellet_starts_in_is_ignored_with_all() -> None:
    shooter, target = row(1, "ss.."), row(2, "...t")
    assert told(see([shooter, target], (3, 0), sight="all")) == ("occluded", [], 1)
    assert told(see([shooter, target], (3, 0), sight="all", inside="ignore_until_exit")) == ("hit", [2], None)
    assert told(see([shooter, target], (1, 0), sight="all")) == ("hit", [1], None)


def test_to_start_inside_may_be_an_error() -> None:
    wall, crate, target = row(5, "##."), row(3, "cc."), row(1, "..t")
    items = [wall, crate, target]
    how = {"inside": "error"}
    for o, sight, ids in (
        ((0, 0), "occluders", (5,)),
        ((1, 0), "all", (5, 3)),
        ((2, 0), "all", (1,)),
        ((2, 0), "occluders", ()),
        ((3, 0), "all", ()),
        ((0, 0), None, ()),
    ):
        if not ids:
            see(items, (9, 9), o, sight, **how)
            continue
        with pytest.raises(StartsInside) as raised:
            see(items, (9, 9), o, sight, **how)
        assert raised.value.args == ids
    see(items, (2, 0), blocked_by=2, **how)
    see(items, (2, 0), bounds=(1, 0, 9, 9), **how)


def test_a_shot_is_refused_for_any_of_its_pellets() -> None:
    items = [row(5, "#..#"), row(6, "...#"), row(7, "#...")]
    how = {"origin_xy": (1, 0), "line_of_sight": "occluders", "inside": "error", **EVERY}
    with pytest.raises(StartsInside) as raised:
        fire_sheltered(items, [((0, 0), []), ((3, 0), [((2, 0), 1)])], **how)  # type: ignore[arg-type]
    assert raised.value.args == (7, 6, 5)
    fire_sheltered(items, [((1, 0), [((9, 0), 1)])], **how)  # type: ignore[arg-type]


# Bounds


def test_only_pixels_within_the_bounds_shelter() -> None:
    wall, target = row(5, ".#.#."), row(1, "aaaaaa", layer=1)
    items = [wall, target]
    for bounds, expected in (
        ((0, 0, 5, 0), [("hit", 0), ("hit", 0), ("occluded", 5), ("occluded", 5), ("occluded", 5), ("occluded", 5)]),
        ((2, 0, 4, 0), [("outside", 0), ("outside", 0), ("hit", 0), ("hit", 0), ("occluded", 5), ("outside", 0)]),
    ):
        for x, (verdict, by) in enumerate(expected):
            found = see(items, (x, 0), bounds=bounds)
            assert (found.verdict, found.sheltered_by.id if found.sheltered_by else 0) == (verdict, by), (bounds, x)
    for y in (-1, 1):
        assert told(see(items, (3, y), bounds=(0, 0, 5, 0))) == ("outside", [], None)
    # (1, 0) is no pixel of the wall: the pellet, outside of the bounds, does not start in it
    assert told(see(items, (3, 0), (1, 0), bounds=(2, 0, 5, 0))) == ("hit", [1], None)
    assert told(see(items, (3, 0), (1, 0))) == ("occluded", [], 5)


# A shot


def test_each_pellet_looks_from_its_own_pixel() -> None:
    """Two pellets at either side of a wall; the target's two pixels are on the right of it."""
    wall, target = row(5, "..#.."), row(1, "...tt")
    line: list[tuple[Pixel, int]] = [((x, 0), 10 + x) for x in range(6)]
    pellets: list[Pellet] = [((0, 0), line), ((5, 0), line), ((4, 0), [((3, 0), 1)])]
    rows, counts = fire_sheltered([wall, target], pellets, origin_xy=(0, 0), line_of_sight="occluders", **EVERY)
    # from 0: . . # x x x   from 5: x x # t t .   from 4: t
    assert rows == [(1, 3, 2, 13 + 14 + 1, 2, (3, 0), 9)]
    assert counts == {"empty": 3, "hit": 3, "occluded": 7, "filtered": 0, "outside": 0}
    rows, counts = fire_sheltered([wall, target], pellets, origin_xy=(5, 0), line_of_sight=None, **EVERY)
    assert rows == [(1, 5, 2, 2 * (13 + 14) + 1, 3, (4, 0), 1)]
    assert counts == {"empty": 6, "hit": 5, "occluded": 2, "filtered": 0, "outside": 0}


def test_a_shot_leaves_what_its_pellets_start_in() -> None:
    items, line = [row(5, "##..#."), row(1, "..ttt", layer=1)], [((x, 0), 1) for x in range(6)]
    for inside, expected in (("hit", []), ("ignore_until_exit", [(1, 3, 3, 3, 1, (2, 0), 4)])):
        rows, _ = fire_sheltered(
            items, [((0, 0), line)], origin_xy=(0, 0), line_of_sight="occluders", inside=inside, **EVERY
        )
        assert rows == expected


# Laws


def some_world(rng: random.Random, size: int = 8, *, single: bool = False) -> list[Item]:
    """A few items of scattered pixels, or of one pixel each."""
    items = []
    for number in range(rng.randint(1, 7)):
        x, y = rng.randrange(size), rng.randrange(size)
        box = [(x + i, y + j) for i in range(rng.randint(1, 3)) for j in range(rng.randint(1, 3))]
        pixels = {(x, y)} if single else {pixel for pixel in box if rng.random() < 0.8} or {(x, y)}
        items.append(
            item(
                number, pixels, occluder=rng.random() < 0.5, layer=rng.randint(-1, 1),
                categories=rng.choice([1, 1, 3, 2]), owner=rng.choice([-1, -1, 7]),
            )
        )  # fmt: skip
    return items


def some_how(rng: random.Random) -> dict[str, object]:
    return {
        "line_of_sight": rng.choice(["occluders", "all"]),
        "inside": rng.choice(["hit", "ignore_until_exit"]),
        "accept": rng.choice([1, 3]),
        "blocked_by": rng.choice([1, 2, 3]),
        "exclude": rng.choice([[], [7]]),
        "pierce": rng.random() < 0.5,
        "bounds": rng.choice([None, (1, 0, 7, 6)]),
    }


def some_pixel(rng: random.Random) -> Pixel:
    return rng.randrange(-1, 10), rng.randrange(-1, 10)


def some_ends(rng: random.Random, items: list[Item]) -> tuple[Pixel, Pixel]:
    """The own pixel of a pellet, and a pixel that is more often than not one of an item."""
    covered = sorted(rng.choice(items).pixels)
    return some_pixel(rng), rng.choice(covered) if rng.random() < 0.7 else some_pixel(rng)


SEEDS = pytest.mark.parametrize("seed", range(6))


@SEEDS
def test_who_is_seen_sees(seed: int) -> None:
    rng = random.Random(seed)
    answers = set()
    for _ in range(150):
        o, p = some_pixel(rng), some_pixel(rng)
        items = [i for i in some_world(rng, single=True) if not i.pixels & {o, p}]
        how = {**some_how(rng), "bounds": None}
        there, back = ({i.id for i in judge(items, *ends, **how).shelters} for ends in ((o, p), (p, o)))  # type: ignore[arg-type]
        assert there == back, (o, p, items)
        answers.add(bool(there))
    assert answers == {False, True}


@SEEDS
def test_more_occluders_never_expose_more(seed: int) -> None:
    rng = random.Random(seed)
    less = 0
    for _ in range(150):
        items, how = some_world(rng), some_how(rng)
        o, p = some_ends(rng, items)
        more = items.copy()
        for one in some_world(rng):
            more.insert(rng.randint(0, len(more)), replace(one, id=one.id + 100, occluder=True))
        few, many = (judge(world, o, p, **how) for world in (items, more))  # type: ignore[arg-type]
        assert {i.id for i in few.shelters} <= {i.id for i in many.shelters}
        assert {i.id for i in many.hit} <= {i.id for i in few.hit}
        assert few.verdict != "occluded" or many.verdict == "occluded"
        less += few.hit != many.hit
    assert less


@SEEDS
def test_all_shelters_at_least_what_occluders_do(seed: int) -> None:
    rng = random.Random(seed)
    less = 0
    for _ in range(150):
        items, how = some_world(rng), some_how(rng)
        o, p = some_ends(rng, items)
        some, every = (judge(items, o, p, **{**how, "line_of_sight": sight}) for sight in SIGHTS[1:])  # type: ignore[arg-type]
        assert [i.id for i in every.shelters if i.occluder] == [i.id for i in some.shelters]
        assert {i.id for i in every.hit} <= {i.id for i in some.hit}
        less += some.hit != every.hit
    assert less


@SEEDS
def test_without_blockers_nothing_changes(seed: int) -> None:
    """Nothing asks for a line of sight, no occluder blocks, or there is none; the stack alone is the judge."""
    rng = random.Random(seed)
    for _ in range(60):
        items, how = some_world(rng), some_how(rng)
        case = rng.randrange(3)
        how["line_of_sight"] = None if case == 0 else "occluders"
        if case == 1:
            how["blocked_by"] = 4
        if case == 2:
            items = [replace(i, occluder=False) for i in items]
        plain = {name: value for name, value in how.items() if name not in ("line_of_sight", "inside")}
        pellets: list[Pellet] = [
            (some_pixel(rng), [(some_pixel(rng), rng.randint(0, 5)) for _ in range(20)]) for _ in range(2)
        ]
        origin = some_pixel(rng)
        for own, samples in pellets:
            for p, _ in samples:
                found, stack = judge(items, own, p, **how), at_pixel(items, p, **plain)  # type: ignore[arg-type]
                assert (found.verdict, found.hit, found.skipped, found.ended_by) == (
                    stack.verdict, stack.hit, stack.skipped, stack.ended_by,
                )  # fmt: skip
                assert not found.shelters and not found.sheltered and found.sheltered_by is None
        samples_only = [samples for _, samples in pellets]
        assert fire_sheltered(items, pellets, origin_xy=origin, **how) == fire_one(  # type: ignore[arg-type]
            items,
            samples_only,
            origin_xy=origin,
            **plain,  # type: ignore[arg-type]
        )


TURNS: dict[str, Callable[[int, int], Pixel]] = {
    "mirror x": lambda x, y: (-x, y),
    "mirror y": lambda x, y: (x, -y),
    "quarter turn": lambda x, y: (-y, x),
    "diagonal mirror": lambda x, y: (y, x),
    "shift": lambda x, y: (x + 1000, y - 777),
}


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_mirrors_and_turns_change_nothing(turn: Callable[[int, int], Pixel]) -> None:
    rng = random.Random(11)
    seen = set()
    for _ in range(600):
        items, how = some_world(rng), some_how(rng)
        o, p = some_ends(rng, items)
        turned = [replace(i, pixels=frozenset(turn(*pixel) for pixel in i.pixels)) for i in items]
        there = dict(how)
        if how["bounds"] is not None:
            x_min, y_min, x_max, y_max = how["bounds"]  # type: ignore[misc]
            (ax, ay), (bx, by) = turn(x_min, y_min), turn(x_max, y_max)
            there["bounds"] = min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)
        before = judge(items, o, p, **how)  # type: ignore[arg-type]
        after = judge(turned, turn(*o), turn(*p), **there)  # type: ignore[arg-type]
        assert told(before) == told(after), (o, p, items, how)
        assert [i.id for i in before.shelters] == [i.id for i in after.shelters]
        seen.add(before.verdict)
    assert seen == {"empty", "hit", "occluded", "filtered", "outside"}


@SEEDS
def test_a_ray_to_the_pixel_stops_at_what_shelters_it(seed: int) -> None:
    """A thin ray through the blockers as occluders, without their pixels at p, stops iff p is sheltered, and then."""
    rng = random.Random(seed)
    stopped = 0
    for _ in range(200):
        items = some_world(rng)
        how = some_how(rng) | {"line_of_sight": "all", "accept": 3, "blocked_by": 3, "exclude": []}
        o, p = some_ends(rng, items)
        a, b = ((256 * x, 256 * y) for x, y in (o, p))
        inside, bounds = str(how["inside"]), how["bounds"]
        walls = [oracle_rays.Item(i.id, True, i.pixels - {p}) for i in items]
        ray = oracle_rays.walk(a, b, 0, walls, bounds=bounds, inside=inside)  # type: ignore[arg-type]
        found = judge(items, o, p, **how)  # type: ignore[arg-type]
        if found.verdict == "outside":
            continue
        assert (ray.stop.reason == "occluder") == bool(found.shelters), (o, p, items)
        if found.shelters:
            by_id = {i.id: i for i in items}
            times = [entered(i, o, p, inside, bounds) for i in (found.shelters[0], by_id[ray.stop.item])]  # type: ignore[index,arg-type]
            assert times[0] == times[1] == oracle_rays.Fraction(ray.stop.time, ray.path.scale)
            stopped += 1
    assert stopped > 20
