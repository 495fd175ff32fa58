"""Volumes of masks: they contain every closed pixel square, in exact arithmetic, and are not larger than need be."""

import itertools
import math
import re
from collections.abc import Iterable, Iterator
from fractions import Fraction

import numpy as np
import pytest
from some_of import some_of

from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints
from hitplanes.planes.common.limits import BOXES_MAX, MASK_SIDE_MAX
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.scene.sprite import Sprite
from hitplanes.planes.volumes import fit, outline
from hitplanes.planes.volumes import outline as cover
from hitplanes.planes.volumes.volumes import Aabbs, BoxSets, Capsules, Circles

Point = tuple[Fraction, Fraction]
Place = tuple[int, int]
HALF = Fraction(1, 2)


def mask_of(*rows: str) -> Bools:
    return np.array([[c == "#" for c in row] for row in rows])


NAMED = {
    "pixel": mask_of("#"),
    "pixel in a corner": mask_of("...", "...", "..#"),
    "row": mask_of("#####"),
    "column": mask_of("#", "#", "#"),
    "corner to corner": mask_of("#.", ".#"),
    "ring": mask_of("####", "#..#", "####"),
    "hole that a corner opens": mask_of("###.", "#.##", "##.#", ".###"),
    "two far parts": mask_of("#.........", "..........", ".........#"),
    "part within a hole": mask_of("#####", "#...#", "#.#.#", "#...#", "#####"),
    "comb": mask_of("#.#.#.#", "#.#.#.#", "#######"),
    "empty rows between": mask_of("##..", "....", "....", "..##"),
    "spiral": mask_of("#######", "......#", "#####.#", "#...#.#", "#.###.#", "#.....#", "#######"),
    "full": np.ones((5, 3), np.bool_),
}


def random_mask(rng: np.random.Generator, side: int) -> Bools:
    """Noise, or blobs with holes, or blobs with noise cut out; never empty."""
    shape = rng.integers(1, side + 1, 2)
    mask = rng.random(shape) < rng.choice([0.05, 0.3, 0.6, 0.95])
    if rng.random() < 0.7:
        rough = np.pad(rng.random(shape), 2)
        smooth = sum(rough[i : i + shape[0], j : j + shape[1]] for i in range(5) for j in range(5))
        blobs = smooth > np.quantile(smooth, rng.random())
        mask = blobs & mask if rng.random() < 0.3 else blobs
    if not mask.any():
        mask[tuple(rng.integers(0, shape))] = True
    return np.asarray(mask)


def random_masks(count: int, side: int, seed: int) -> Iterator[Bools]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield random_mask(rng, side)


def corners_of(mask: Bools, at: Place = (0, 0)) -> list[Point]:
    """Corners of the squares at both ends of each row: a convex set that holds them holds the row.

    So it holds a row between two others with the same ends, which is left out. Pixel [0, 0] lies at `at`.
    """
    ends = [(int(x[0]), int(x[-1])) if len(x := np.flatnonzero(row)) else None for row in mask]
    found = set()
    for y, here in enumerate(ends):
        if here and not (0 < y < len(ends) - 1 and ends[y - 1] == here == ends[y + 1]):
            found |= {(at[0] + x, at[1] + y + dy) for x in (here[0] - HALF, here[1] + HALF) for dy in (-HALF, HALF)}
    return sorted(found)


def turn(a: Point, b: Point, c: Point) -> Fraction:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def exact(points: Floats) -> list[Point]:
    return [(Fraction(x), Fraction(y)) for x, y in points.tolist()]


def holds_circle(circle: Circles, mask: Bools, at: Place = (0, 0)) -> bool:
    x, y = map(Fraction, circle.center[0].tolist())
    square = Fraction(circle.radius[0]) ** 2
    return all((p - x) ** 2 + (q - y) ** 2 <= square for p, q in corners_of(mask, at))


def holds_capsule(capsule: Capsules, mask: Bools, at: Place = (0, 0)) -> bool:
    """Each corner is as near to the axis, or to an end of it, as the radius."""
    (a,), (b,), square = exact(capsule.a_xy), exact(capsule.b_xy), Fraction(capsule.radius[0]) ** 2
    d = b[0] - a[0], b[1] - a[1]
    length2 = d[0] ** 2 + d[1] ** 2
    for p, q in corners_of(mask, at):
        along = (p - a[0]) * d[0] + (q - a[1]) * d[1]
        share = min(max(along / length2, Fraction(0)), Fraction(1)) if length2 else Fraction(0)
        if (p - a[0] - share * d[0]) ** 2 + (q - a[1] - share * d[1]) ** 2 > square:
            return False
    return True


def check_convex(points: Floats, mask: Bools, at: Place = (0, 0)) -> None:
    ring = exact(points)
    n = len(ring)
    for i in range(n):
        assert turn(ring[i], ring[(i + 1) % n], ring[(i + 2) % n]) > 0, "not strictly convex, or turning the other way"
    turned = sum(ring[i][1] <= 0 < ring[(i + 1) % n][1] for i in range(n))
    assert turned <= 1, "more than one turn"
    corners = corners_of(mask, at)
    for i in range(n):
        assert all(turn(ring[i], ring[(i + 1) % n], p) >= 0 for p in corners), "a pixel square sticks out"


def segments(points: Floats) -> Ints:
    """Edges (n, 2, 2) in 1/256 px, whole numbers."""
    whole = points * 256
    assert np.array_equal(whole, np.rint(whole))
    ends = whole.astype(np.int64)
    return np.stack([ends, np.roll(ends, -1, axis=0)], axis=1)


def turns(a: Ints, b: Ints, c: Ints) -> Ints:
    return np.sign(
        (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    )


def check_simple(points: Floats) -> None:
    """No two edges that are not neighbours touch, and neighbours do not run back."""
    edges = segments(points)
    n = len(edges)
    i, j = np.triu_indices(n, 2)
    keep = ~((i == 0) & (j == n - 1))
    (a, b), (c, d) = edges[i[keep]].swapaxes(0, 1), edges[j[keep]].swapaxes(0, 1)
    apart = (np.maximum(a, b) < np.minimum(c, d)).any(axis=1) | (np.maximum(c, d) < np.minimum(a, b)).any(axis=1)
    apart |= turns(a, b, c) * turns(a, b, d) > 0
    apart |= turns(c, d, a) * turns(c, d, b) > 0
    assert apart.all(), "edges meet"
    a, b, c = edges[:, 0], edges[:, 1], np.roll(edges[:, 1], -1, axis=0)
    assert (turns(a, b, c) != 0).all(), "a corner on a straight edge, or an edge that runs back"
    assert area_of(points) > 0, "turning the other way"


def area_of(points: Floats) -> Fraction:
    ring = exact(points)
    return sum(p[0] * q[1] - p[1] * q[0] for p, q in zip(ring, ring[1:] + ring[:1], strict=True)) / 2


def check_contains(points: Floats, mask: Bools) -> None:
    """No edge meets an open pixel square, and each centre lies inside: so each closed square does."""
    edges = segments(points)[:, None]
    y, x = np.nonzero(mask)
    centers = np.stack([x, y], axis=1) * 256
    a, b = edges[..., 0, :], edges[..., 1, :]
    beside = ((np.maximum(a, b) <= centers - 128) | (np.minimum(a, b) >= centers + 128)).any(axis=-1)
    sides = np.stack([turns(a, b, centers + (dx, dy)) for dx in (-128, 128) for dy in (-128, 128)])  # noqa: RUF005
    off = (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
    assert (beside | off).all(), "an edge cuts a pixel square"
    up, down = a[..., 1] <= centers[:, 1], b[..., 1] <= centers[:, 1]
    left = turns(a, b, centers)
    winding = (up & ~down & (left > 0)).sum(axis=0) - (~up & down & (left < 0)).sum(axis=0)
    assert (winding == 1).all(), "a centre lies outside"


def rows_of(found: BoxSets) -> Floats:
    """Boxes (n, 4) of the one row of a set."""
    assert found.starts.tolist() == [0]
    boxes = found.parts
    assert isinstance(boxes, Aabbs)
    return np.concatenate([boxes.min, boxes.max], axis=1)


def false_area(found: BoxSets, mask: Bools) -> int:
    """Pixels in any box that are not in the mask; all of the mask are in one."""
    painted = np.zeros(mask.shape, np.bool_)
    for x, y, x_max, y_max in (rows_of(found) + 0.5).astype(int).tolist():
        painted[y:y_max, x:x_max] = True
    assert (painted | ~mask).all(), "a pixel lies in no box"
    return int((painted & ~mask).sum())


def check_boxes(found: BoxSets, mask: Bools, k: int) -> None:
    rows = rows_of(found)
    assert rows.shape == (len(rows), 4)
    assert 1 <= len(rows) <= k
    for x, y, x_max, y_max in (rows + 0.5).tolist():
        assert all(v == int(v) for v in (x, y, x_max, y_max))
        assert x < x_max <= mask.shape[1]
        assert y < y_max <= mask.shape[0]
    false_area(found, mask)


def check_all(mask: Bools, seeds: Iterable[int]) -> None:
    before = mask.copy()
    check_convex(fit.hull(mask).points, mask)
    assert set(exact(fit.hull(mask).points)) <= set(corners_of(mask))
    assert holds_circle(fit.least_circle(mask), mask)
    check_convex(fit.oriented_box(mask).points, mask)
    assert holds_capsule(fit.capsule(mask), mask)
    for seed in seeds:
        check_chosen(mask, np.random.default_rng(seed))
    assert np.array_equal(mask, before)


def check_chosen(mask: Bools, rng: np.random.Generator) -> None:
    """Volumes that are asked for with a number, or a point."""
    assert holds_circle(fit.pivot_circle(mask, rng.normal(0, 20, 2)), mask)
    n = int(rng.integers(4, 9))
    ring = fit.convex(mask, n).points
    assert len(ring) == min(n, len(fit.hull(mask).points))
    check_convex(ring, mask)
    k = int(rng.integers(1, BOXES_MAX + 1))
    check_boxes(fit.boxes(mask, k), mask, k)
    around = fit.concave(mask, float(rng.choice([0, 0.5, 1, 2, 5, 100])))
    check_simple(around)
    check_contains(around, mask)


@pytest.mark.parametrize("name", NAMED)
def test_named_masks(name: str) -> None:
    check_all(NAMED[name], range(20))


@pytest.mark.parametrize(("seed", "count"), some_of([(0, 50), (0, 120), (1, 120), (2, 120)], 4))
def test_random_masks_lie_in_their_volumes(seed: int, count: int) -> None:
    for i, mask in enumerate(random_masks(count, 14, seed)):
        check_all(mask, [i])


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3, 9))
def test_many_random_masks_lie_in_their_volumes(seed: int) -> None:
    for i, mask in enumerate(random_masks(300, 30, seed)):
        check_all(mask, [i])


@pytest.mark.parametrize("at", [(2**40, 2**40), (-(2**38) - 3, 7), (5, -(2**40))], ids=str)
def test_far_pixels_lie_in_their_volumes(at: Place) -> None:
    """As far as positions may be, where float64 holds no more than 1/4096 px."""
    rng = np.random.default_rng(11)
    for mask in [*NAMED.values(), *random_masks(40, 14, 8)]:
        spans = Spans.from_mask(mask, at)
        found = fit.box(spans)
        assert [*found.min[0], *found.max[0]] == [
            f(p[k] for p in corners_of(mask, at)) for f in (min, max) for k in (0, 1)
        ]
        assert holds_circle(fit.least_circle(spans), mask, at)
        pivot = np.clip(np.array(at) + rng.normal(0, 20, 2), -(2.0**40), 2.0**40)
        assert holds_circle(fit.pivot_circle(spans, pivot), mask, at)
        assert holds_capsule(fit.capsule(spans), mask, at)
        for ring in (fit.hull(spans), fit.oriented_box(spans), fit.convex(spans, int(rng.integers(4, 9)))):
            check_convex(ring.points, mask, at)


def test_the_box_is_exact() -> None:
    for mask in random_masks(300, 12, 5):
        found, corners = fit.box(mask), corners_of(mask)
        for axis in (0, 1):
            assert found.min[0, axis] == min(p[axis] for p in corners)
            assert found.max[0, axis] == max(p[axis] for p in corners)


def least_square(points: list[Point]) -> Fraction:
    """Squared radius of the least circle: of all pairs and triples, the least that contains all."""
    found = []
    for pair in itertools.combinations(points, 2):
        found.append(tuple((a + b) / 2 for a, b in zip(*pair, strict=True)) + pair[:1])
    for a, b, c in itertools.combinations(points, 3):
        d = 2 * turn(a, b, c)
        if d:
            bx, by, cx, cy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
            u, v = bx * bx + by * by, cx * cx + cy * cy
            found.append((a[0] + (cy * u - by * v) / d, a[1] + (bx * v - cx * u) / d, a))
    squares = []
    for x, y, on in found:
        square = (on[0] - x) ** 2 + (on[1] - y) ** 2
        if all((p - x) ** 2 + (q - y) ** 2 <= square for p, q in points):
            squares.append(square)
    return min(squares)


def test_the_least_circle_is_least() -> None:
    for mask in random_masks(60, 5, 11):
        square = Fraction(fit.least_circle(mask).radius[0]) ** 2
        least = least_square([p for p in corners_of(mask) if p in set(exact(fit.hull(mask).points))])
        assert least <= square <= least * (1 + Fraction(1, 2**50))


def test_a_circle_has_the_least_radius_for_its_center() -> None:
    for mask in random_masks(300, 12, 13):
        for circle in (fit.least_circle(mask), fit.pivot_circle(mask, (0.1, -3.7))):
            assert not holds_circle(Circles(circle.center, math.nextafter(circle.radius[0], 0)), mask)


def test_no_quarter_turn_changes_the_circle_about_the_pivot() -> None:
    for mask in random_masks(100, 9, 17):
        side = max(mask.shape)
        square = np.zeros((side, side), np.bool_)
        square[: mask.shape[0], : mask.shape[1]] = mask
        pivot = ((side - 1) / 2, (side - 1) / 2)
        assert len({fit.pivot_circle(np.rot90(square, i), pivot).radius[0] for i in range(4)}) == 1


def least_area(points: list[Point]) -> Fraction:
    """Area of the least box with a side along any two of the points."""
    areas = []
    for a, b in itertools.combinations(points, 2):
        dx, dy = b[0] - a[0], b[1] - a[1]
        along, across = [p * dx + q * dy for p, q in points], [p * dy - q * dx for p, q in points]
        areas.append((max(along) - min(along)) * (max(across) - min(across)) / (dx * dx + dy * dy))
    return min(areas)


@pytest.mark.parametrize("count", [70, pytest.param(200, marks=pytest.mark.long)])
def test_the_oriented_box_is_least(count: int) -> None:
    for mask in random_masks(count, 6, 19):
        area = area_of(fit.oriented_box(mask).points)
        least = least_area(corners_of(mask))
        assert least <= area <= least * (1 + Fraction(1, 2**44))
        p = fit.hull(mask).points
        for angle in np.linspace(0, np.pi / 2, 91):
            c, s = np.cos(angle), np.sin(angle)
            assert float(area) <= np.ptp(p[:, 0] * c + p[:, 1] * s) * np.ptp(p[:, 1] * c - p[:, 0] * s) * (1 + 1e-12)


def test_the_oriented_box_has_right_angles() -> None:
    for mask in random_masks(200, 20, 23):
        a, b, c, d = fit.oriented_box(mask).points
        assert abs(((b - a) * (c - b)).sum()) <= 1e-12 * area_of(np.array([a, b, c, d]))
        assert np.abs((b - a) - (c - d)).max() <= 1e-12


def test_one_box_more_never_covers_more() -> None:
    for mask in [*random_masks(20, 20, 29), *NAMED.values()]:
        found = [fit.boxes(mask, k) for k in range(1, BOXES_MAX + 1)]
        for k, one in enumerate(found, 1):
            check_boxes(one, mask, k)
        assert all(false_area(a, mask) >= false_area(b, mask) for a, b in itertools.pairwise(found))
        (row,), whole = rows_of(found[0]), fit.box(mask)
        assert row.tolist() == [*whole.min[0], *whole.max[0]]


def test_one_box_is_found_without_cutting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cover, "_cut", None)
    for mask in random_masks(30, 20, 31):
        (row,), whole = rows_of(fit.boxes(mask, 1)), fit.box(mask)
        assert row.tolist() == [*whole.min[0], *whole.max[0]]


def least_false(mask: Bools, k: int) -> int:
    """Fewest false pixels of k boxes, by trying all."""
    h, w = mask.shape
    paints = set()
    for y, x in itertools.product(range(h), range(w)):
        for y_end, x_end in itertools.product(range(y + 1, h + 1), range(x + 1, w + 1)):
            painted = np.zeros(mask.shape, np.bool_)
            painted[y:y_end, x:x_end] = True
            paints.add(int("".join("01"[v] for v in painted.ravel().tolist()), 2))
    goal = int("".join("01"[v] for v in mask.ravel().tolist()), 2)
    best = mask.size
    for some in itertools.combinations_with_replacement(paints, k):
        union = 0
        for one in some:
            union |= one
        if not goal & ~union:
            best = min(best, (union & ~goal).bit_count())
    return best


def test_two_boxes_are_mostly_the_best_two() -> None:
    masks = list(random_masks(60, 5, 31))
    found = [false_area(fit.boxes(mask, 2), mask) for mask in masks]
    best = [least_false(mask, 2) for mask in masks]
    assert all(a >= b for a, b in zip(found, best, strict=True))
    assert sum(a == b for a, b in zip(found, best, strict=True)) >= 54


@pytest.mark.parametrize(
    ("mask", "k"),
    [
        (mask_of("#..", "#..", "###"), 2),
        (mask_of(".#.", "###", ".#."), 2),
        (mask_of("####", "#..#", "#..#", "####"), 4),
        (mask_of("##...", "##...", ".....", "...##"), 2),
    ],
)
def test_what_boxes_can_cover_is_covered_without_a_false_pixel(mask: Bools, k: int) -> None:
    assert false_area(fit.boxes(mask, k), mask) == 0
    assert false_area(fit.boxes(mask, k - 1), mask) > 0
    assert len(rows_of(fit.boxes(mask, BOXES_MAX))) <= mask.sum()


def test_the_hull_of_a_plus() -> None:
    ring = fit.hull(mask_of(".#.", "###", ".#.")).points
    assert ring.tolist() == [
        [1.5, -0.5], [2.5, 0.5], [2.5, 1.5], [1.5, 2.5], [0.5, 2.5], [-0.5, 1.5], [-0.5, 0.5], [0.5, -0.5],
    ]  # fmt: skip


def test_the_circle_of_a_pixel() -> None:
    circle = fit.least_circle(mask_of("...", "..#"))
    assert circle.center[0].tolist() == [2, 1]
    assert 0.5 < Fraction(circle.radius[0]) ** 2 < 0.5 + 1e-15


def test_a_capsule_follows_what_is_long() -> None:
    assert fit.capsule(np.ones((1, 9), np.bool_)).radius[0] == pytest.approx(0.5)
    y, x = np.mgrid[:40, :90]
    along = np.clip((x - 20) * 0.8 + (y - 5) * 0.6, 0, 50)
    beam = (x - 20 - 0.8 * along) ** 2 + (y - 5 - 0.6 * along) ** 2 <= 16
    found = fit.capsule(beam)
    assert found.radius[0] < 5.2  # 4 and half a pixel's diagonal; a capsule about the whole box's axis is no shorter
    assert math.dist(found.a_xy[0], found.b_xy[0]) < 52
    for mask in random_masks(100, 12, 43):
        capsule = fit.capsule(mask)
        assert not holds_capsule(Capsules(capsule.a_xy, capsule.b_xy, math.nextafter(capsule.radius[0], 0)), mask)


def test_spans_have_the_volumes_of_their_mask() -> None:
    for mask in random_masks(100, 14, 61):
        spans = Spans.from_mask(mask, (-3, 7))
        for name in ("hull", "box", "least_circle", "oriented_box", "capsule"):
            here, there = getattr(fit, name)(mask).translated((-3, 7)).bounds(), getattr(fit, name)(spans).bounds()
            assert np.allclose(here.min, there.min, rtol=0, atol=1e-12), name
            assert np.allclose(here.max, there.max, rtol=0, atol=1e-12), name
        assert np.array_equal(fit.hull(spans).points, fit.hull(mask).points + np.array([-3, 7]))
    with pytest.raises(InputError, match="pixels: expected a pixel or more, got none"):
        fit.hull(Spans.empty())


def test_a_slanted_line_has_a_slanted_box() -> None:
    mask = np.eye(12, dtype=bool)
    corners = fit.oriented_box(mask).points
    assert area_of(corners) == 24  # 12 sqrt(2) long, sqrt(2) wide
    assert false_area(fit.boxes(mask, 1), mask) == 132


def test_leaving_out_the_cheapest_edge() -> None:
    """An octagon of a square without its corner pixels is the square again at four corners."""
    mask = np.ones((6, 6), np.bool_)
    mask[[0, 0, 5, 5], [0, 5, 0, 5]] = False
    assert len(fit.convex(mask, 99).points) == 8
    assert area_of(fit.convex(mask, 4).points) == 36
    assert [area_of(fit.convex(mask, n).points) for n in (8, 7, 6, 5)] == [34, Fraction(69, 2), 35, Fraction(71, 2)]


def test_without_tolerance_the_outline_is_the_mask() -> None:
    mask = mask_of("##.....", "##.###.", "#####..", "..####.", "....##.")
    ring = fit.concave(mask, 0)
    assert area_of(ring) == mask.sum()
    assert fit.concave(mask_of("#"), 0).tolist() == [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]


def test_holes_are_filled_and_parts_are_bridged() -> None:
    assert area_of(fit.concave(mask_of("####", "#..#", "####"), 0)) == 12
    assert area_of(fit.concave(mask_of("#...#", ".....", "....."), 0)) == 5
    assert area_of(fit.concave(mask_of("#.#..#"), 0)) == 6
    assert area_of(fit.concave(mask_of("#.#", *["..."] * 8, "###"), 0)) == 14  # the two shortest of three
    assert area_of(fit.concave(mask_of("#.", ".#"), 0)) == 3


def test_a_disc_gets_few_corners() -> None:
    """Fewer than its hull, though the hull leaves it by less."""
    y, x = np.mgrid[:41, :41]
    mask = (x - 20) ** 2 + (y - 20) ** 2 <= 404
    counts = [len(fit.concave(mask, tolerance)) for tolerance in (0, 0.75, 1.5, 3, 9)]
    assert counts == sorted(counts, reverse=True)
    assert counts[2] < len(fit.hull(mask).points) <= counts[1]
    assert counts[4] <= 8
    assert area_of(fit.concave(mask, 1.5)) < 1.1 * mask.sum()


def test_an_outline_goes_round_a_spiral() -> None:
    """A lot of tolerance, and still no edge may cross another."""
    for tolerance in (0, 1, 2, 3):
        ring = fit.concave(NAMED["spiral"], tolerance)
        check_simple(ring)
        check_contains(ring, NAMED["spiral"])
    assert area_of(fit.concave(NAMED["spiral"], 0)) == NAMED["spiral"].sum()


def test_the_outline_keeps_to_its_tolerance() -> None:
    """Points along the edges are no farther from a pixel square than that."""
    y, x = np.mgrid[:30, :30]
    for tolerance, (a, b) in itertools.product((0.5, 1, 2, 4), ((1, 0), (3, 7), (-1, 2))):
        mask = ((x - 15) ** 2 + (y - 15) ** 2 <= 200) & ~((a * (x - 13) + b * (y - 15) > 0) & (abs(x - y) < 6))
        ring = fit.concave(fit_part(mask), tolerance)
        along = np.linspace(ring, np.roll(ring, -1, axis=0), 40).reshape(-1, 1, 2)
        pixels = np.argwhere(fit_part(mask))[:, ::-1]
        off = np.maximum(np.abs(along - pixels) - 0.5, 0)
        assert np.sqrt((off**2).sum(axis=2)).min(axis=1).max() <= tolerance + 1e-9
        assert len(ring) <= len(fit.concave(fit_part(mask), 0))


def fit_part(mask: Bools) -> Bools:
    """A mask whose outline at tolerance 0 is itself: its parts bridged, its holes filled."""
    ring = fit.concave(mask, 0)
    filled = np.zeros(mask.shape, np.bool_)
    for (x, y), (x_next, y_next) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        if x == x_next:
            low, high = sorted((int(y + 0.5), int(y_next + 0.5)))
            filled[low:high, int(x + 0.5) :] ^= True
    return filled


def test_large_outlines_are_taken_by_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outline, "OUTLINE_CORNERS", 12)
    for mask in random_masks(200, 24, 37):
        ring = fit.concave(mask, 0)
        assert len(ring) <= 12
        check_simple(ring)
        check_contains(ring, mask)
    monkeypatch.setattr(outline, "OUTLINE_PIXELS", 30)
    for mask in random_masks(200, 24, 41):
        ring = fit.concave(mask, 1)
        check_simple(ring)
        check_contains(ring, mask)


@pytest.mark.parametrize("kind", some_of(["stairs", "row", "column", "ends"], 2))
def test_masks_as_long_as_they_may_be(kind: str) -> None:
    n = MASK_SIDE_MAX
    mask = np.zeros((n // 64, n) if kind == "stairs" else (1, n), np.bool_)
    if kind == "stairs":
        mask[np.arange(n) // 64, np.arange(n)] = True
    else:
        mask[0, [0, -1]] = True
        mask[0] |= kind != "ends"
    if kind == "column":
        mask = mask.T
    check_convex(fit.hull(mask).points, mask)
    assert holds_circle(fit.least_circle(mask), mask)
    check_convex(fit.oriented_box(mask).points, mask)
    check_convex(fit.convex(mask, 5).points, mask)
    check_boxes(fit.boxes(mask, 3), mask, 3)
    check_simple(fit.concave(mask, 1))


@pytest.mark.parametrize("shape", [(64, MASK_SIDE_MAX), (MASK_SIDE_MAX, 64), (3000, 3000)])
def test_a_few_pixels_far_apart(shape: tuple[int, int]) -> None:
    """Long edges, small angles between them: coordinates that float64 rounds most."""
    rng = np.random.default_rng(47)
    for count in (3, 10, 200):
        mask = np.zeros(shape, np.bool_)
        mask[rng.integers(0, shape[0], count), rng.integers(0, shape[1], count)] = True
        assert holds_circle(fit.least_circle(mask), mask)
        check_convex(fit.oriented_box(mask).points, mask)
        for n in (4, 5, 7):
            check_convex(fit.convex(mask, n).points, mask)


def test_a_pivot_far_away_or_tiny() -> None:
    mask = mask_of("#.", ".#")
    for pivot in ((2.0**40, -(2.0**40)), (5e-324, 1e-300), (1e9 + 0.1, 0.3)):
        circle = fit.pivot_circle(mask, pivot)
        assert circle.center[0].tolist() == list(pivot)
        assert holds_circle(circle, mask)
        assert not holds_circle(Circles(circle.center, math.nextafter(circle.radius[0], 0)), mask)


def test_strided_masks_are_read_as_they_look() -> None:
    mask = next(random_masks(1, 20, 43))
    for view in (mask[::-1], mask.T, np.pad(mask, 3)[::2, 1::3]):
        if view.any():
            check_all(view, [1])


FITS = {
    "hull": fit.hull,
    "box": fit.box,
    "least_circle": fit.least_circle,
    "pivot_circle": lambda mask: fit.pivot_circle(mask, (0, 0)),
    "oriented_box": fit.oriented_box,
    "capsule": fit.capsule,
    "boxes": lambda mask: fit.boxes(mask, 4),
    "convex": lambda mask: fit.convex(mask, 8),
    "concave": lambda mask: fit.concave(mask, 1),
}


@pytest.mark.parametrize("name", FITS)
def test_what_is_no_mask_is_refused_by_the_name_of_the_argument(name: str) -> None:
    field = "mask" if name in ("boxes", "concave") else "pixels"
    for mask, told in (
        (np.zeros((3, 4), bool), ": expected a pixel or more, got none"),
        (np.zeros((0, 5), bool), ": expected a pixel or more, got none"),
        (np.zeros((0, 0), bool), ": expected a pixel or more, got none"),
        (np.ones((1, MASK_SIDE_MAX + 1), bool), ": expected sides up to 32768 px"),
        ([[2, 3]], "[0][0]: expected 0 or 1"),
        (np.ones((2, 2)), ": expected booleans"),
        (np.ones((2, 2, 2), bool), ": expected shape"),
        ([[1, 2], [3]], ": expected an array"),
        (np.ma.masked_all((2, 2), bool), "[0][0]: expected a value, got a masked one"),
    ):
        with pytest.raises(InputError, match=f"^{re.escape(field + told)}"):
            FITS[name](mask)


@pytest.mark.parametrize("name", FITS)
def test_what_has_no_pixels_is_named_by_its_kind(name: str) -> None:
    field = (
        "mask: expected a mask (h, w)" if name in ("boxes", "concave") else "pixels: expected a mask (h, w) or Spans"
    )
    sprite = Sprite.from_mask(np.ones((2, 3), np.bool_))
    for thing, kind in ((sprite, "Sprite"), (None, "NoneType"), ("mask.png", "str"), (5, "int")):
        with pytest.raises(InputError, match=f"^{re.escape(field)}, got {kind}$"):
            FITS[name](thing)


def test_bad_settings_are_refused() -> None:
    mask = mask_of("##")
    for call, name in (
        (lambda: fit.boxes(mask, 0), "k: "),
        (lambda: fit.boxes(mask, BOXES_MAX + 1), "k: "),
        (lambda: fit.convex(mask, 3), "n: "),
        (lambda: fit.concave(mask, -1), "tolerance: "),
        (lambda: fit.concave(mask, math.nan), "tolerance: "),
        (lambda: fit.pivot_circle(mask, (math.inf, 0)), "pivot_xy"),
    ):
        with pytest.raises(InputError, match=name):
            call()
