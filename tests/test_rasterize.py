"""Shapes to pixels, against one-pixel-at-a-time references, and the laws that every shape obeys."""

import itertools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import oracle_raster as oracle
import pytest
from examples import examples
from hypothesis import assume, example, given
from hypothesis import strategies as st
from some_of import some_of

from hitplanes.planes.grid import rasterize
from hitplanes.planes.grid.spans import Spans

AGAINST = examples(40, deadline=None)
LAWS = examples(30, deadline=None)

ONE = 2**30
REACH = 14  # px: shapes are drawn this near, so that a reference can look at every pixel
FAR = 2**28  # 2**20 px: as far as a shape reaches

Pixels = set[tuple[int, int]]
Point = tuple[int, int]


def spread(low_px: int, high_px: int) -> st.SearchStrategy[int]:
    """Draw lengths in 1/256 px: on pixel centres and edges, next to them, and anywhere."""
    halves = st.integers(2 * low_px, 2 * high_px).map(lambda n: 128 * n)
    beside = st.tuples(halves, st.sampled_from([-1, 1])).map(sum).filter(lambda v: 256 * low_px <= v <= 256 * high_px)
    return st.one_of(
        st.integers(low_px, high_px).map(lambda n: 256 * n), halves, beside, st.integers(256 * low_px, 256 * high_px)
    )


coordinates = spread(-REACH, REACH)
points = st.tuples(coordinates, coordinates)
lengths = spread(0, REACH)
small_lengths = spread(0, 4)
eighths = st.integers(-8, 8).map(lambda n: 45.0 * n)
angles = st.one_of(eighths, st.integers(-24, 24).map(lambda n: 15.0 * n), st.floats(-360, 360))
directions = angles.map(oracle.unit)
half_angles = st.one_of(
    st.sampled_from([0.0, 1e-12, 2.5, 22.5, 45.0, 60.0, 90.0, 135.0, 179.0, 180.0]), st.floats(0, 180)
)
ring_points = st.lists(points, min_size=1, max_size=7)
polygons = st.lists(ring_points, min_size=1, max_size=3)


# Calling the functions with plain tuples, and reading the answer as a set of pixels


def beam(a: Point, b: Point, radius: int) -> Spans:
    return rasterize.beams(np.array(a), np.array([b]), radius).spans()


def segment(a: Point, b: Point) -> Spans:
    return beam(a, b, 0)


def polygon(*rings: list[Point]) -> Spans:
    return rasterize.polygon([np.array(ring, dtype=np.int64).reshape(-1, 2) for ring in rings])


def cone(reach: int, axis: Point, half_degrees: float) -> Spans:
    return rasterize.cones(reach, np.array([axis]), *oracle.unit(half_degrees)).spans()


def pixel_set(spans: Spans) -> Pixels:
    return oracle.pixel_set(spans.y, spans.x_first, spans.x_last)


def check(spans: Spans, predicate: Callable[[int, int], bool], reach_px: int = REACH) -> None:
    """The pixels are those of the reference, none beyond its reach, in canonical runs."""
    assert pixel_set(spans) == oracle.pixels(predicate, (-reach_px - 2, -reach_px - 2, reach_px + 2, reach_px + 2))
    assert spans == Spans.from_runs(spans.y, spans.x_first, spans.x_last)
    rows = list(zip(spans.y.tolist(), spans.x_first.tolist(), spans.x_last.tolist(), strict=True))
    assert all(a[0] < b[0] or (a[0] == b[0] and a[2] + 1 < b[1]) for a, b in itertools.pairwise(rows))


def covers(spans: Spans, x: int, y: int) -> bool:
    """Look a pixel up without writing out the runs, for shapes of a million rows."""
    low, high = np.searchsorted(spans.y, [y, y + 1])
    return bool(((spans.x_first[low:high] <= x) & (x <= spans.x_last[low:high])).any())


def drawn(picture: str) -> Pixels:
    """Read a picture of # and . whose '@' or 'o' marks the origin, in the set or out of it."""
    rows = picture.split()
    marks = [(x, y) for y, row in enumerate(rows) for x, mark in enumerate(row) if mark in "o@"]
    x0, y0 = marks[0]
    return {(x - x0, y - y0) for y, row in enumerate(rows) for x, mark in enumerate(row) if mark in "#@"}


# Every shape against its reference


@AGAINST
@given(spread(0, REACH))
@example(0)
@example(255)
@example(256)
@example(362)  # the largest that leaves out the diagonal neighbour: 2 * 256**2 = 362.04**2
@example(363)
@example(5 * 256)  # 3, 4, 5
@example(13 * 256)  # 5, 12, 13
def test_disc(radius: int) -> None:
    check(rasterize.disc(radius), lambda x, y: oracle.in_disc(x, y, radius))


@AGAINST
@given(lengths, lengths)
@example(256, 512)
@example(5 * 256, 5 * 256)
@example(0, 0)
@example(5 * 256 + 1, 13 * 256 - 1)
def test_ring(one: int, other: int) -> None:
    inner, outer = sorted((one, other))
    check(rasterize.ring(inner, outer), lambda x, y: oracle.in_ring(x, y, inner, outer))


@AGAINST
@given(lengths, lengths, directions)
@example(0, 0, (ONE, 0))
@example(0, 5 * 256, (ONE, 0))
@example(5 * 256, 0, oracle.unit(45.0))
@example(5 * 256, 0, oracle.unit(45.1))
@example(5 * 256, 3 * 256, (ONE, 0))
@example(5 * 256, 5 * 256, oracle.unit(30.0))
@example(1, 14 * 256, oracle.unit(90.0))
def test_ellipse(radius_x: int, radius_y: int, axis: Point) -> None:
    check(rasterize.ellipse(radius_x, radius_y, *axis), lambda x, y: oracle.in_ellipse(x, y, radius_x, radius_y, *axis))


@examples(67, deadline=None)
@given(polygons)
@example([[(0, 0)]])
@example([[(1, 0)]])
@example([[(0, 0), (1024, 512)]])
@example([[(0, 0), (1024, 0), (1024, 0), (0, 0)]])
@example([[(-1280, -1280), (1280, -1280), (1280, 1280), (-1280, 1280)]])
@example([[(-1280, 0), (0, -1280), (1280, 0), (0, 1280)], [(-512, 0), (0, -512), (512, 0), (0, 512)]])
@example([[(-1280, -1280), (1280, 1280), (-1280, 1280), (1280, -1280)]])  # an hourglass
@example([[(0, 0), (2560, 0), (0, 1)]])
def test_polygon(rings: list[list[Point]]) -> None:
    check(polygon(*rings), lambda x, y: oracle.in_polygon(x, y, rings))


@examples(40, deadline=None)
@given(points, points, small_lengths)
@example((0, 0), (0, 0), 0)
@example((0, 0), (0, 0), 256)
@example((0, 0), (0, 0), 363)
@example((0, 102), (2560, 102), 51)
@example((-768, 0), (768, 0), 768)
@example((0, 0), (3 * 256, 4 * 256), 5 * 256)
@example((-128, -128), (128, 128), 0)
def test_beam(a: Point, b: Point, radius: int) -> None:
    check(beam(a, b, radius), lambda x, y: oracle.in_beam(x, y, a, b, radius), REACH + 4)


@examples(67, deadline=None)
@given(lengths, directions, half_angles)
@example(0, (ONE, 0), 30.0)
@example(1, (ONE, 0), 180.0)
@example(2560, (ONE, 0), 0.0)
@example(2560, oracle.unit(45.0), 0.0)
@example(2560, oracle.unit(45.0), 45.0)
@example(2560, oracle.unit(30.0), 1e-300)
@example(2560, (0, -ONE), 90.0)
@example(1280, (-ONE, 0), 180.0)
@example(2560, oracle.unit(17.0), 135.0)
def test_cone(reach: int, axis: Point, half_degrees: float) -> None:
    half = oracle.unit(half_degrees)
    check(cone(reach, axis, half_degrees), lambda x, y: oracle.in_cone(x, y, reach, *axis, *half))


@examples(200, deadline=None)
@given(points, points)
@example((0, 0), (0, 0))
@example((128, 128), (128, 128))
@example((128, 0), (128, 0))
@example((128, -512), (128, 512))
@example((-640, 128), (640, 128))
@example((-1152, -1152), (1152, 1152))
@example((-1152, 1152), (1152, -1152))
@example((128, 0), (384, 512))
def test_segment(a: Point, b: Point) -> None:
    check(segment(a, b), lambda x, y: oracle.meets_segment(x, y, a, b))


@LAWS
@given(points, points, st.integers(-3, 3), st.integers(-3, 3))
def test_the_two_references_of_a_segment_agree(a: Point, b: Point, dx: int, dy: int) -> None:
    x, y = (a[0] + b[0]) // 512 + dx, (a[1] + b[1]) // 512 + dy
    assert oracle.meets_segment(x, y, a, b) == oracle.meets_segment_by_clipping(x, y, a, b)


# Small pictures


PICTURES: dict[str, tuple[Callable[[], Spans], str]] = {
    "disc of 1 px": (lambda: rasterize.disc(256), ".#. #@# .#."),
    "disc of 2 px": (lambda: rasterize.disc(512), "..#.. .###. ##@## .###. ..#.."),
    "ring 1 to 2 px": (lambda: rasterize.ring(256, 512), "..#.. .###. ##o## .###. ..#.."),
    "ring of no width": (
        lambda: rasterize.ring(1280, 1280),
        """
        .....#.....  ..#.....#..  .#.......#.  ...........  ...........  #....o....#
        ...........  ...........  .#.......#.  ..#.....#..  .....#.....""",
    ),
    "ellipse 3 x 1 px": (lambda: rasterize.ellipse(768, 256, ONE, 0), "...#... ###@### ...#..."),
    "flat ellipse": (lambda: rasterize.ellipse(600, 0, ONE, 0), "##@##"),
    "flat upright ellipse": (lambda: rasterize.ellipse(0, 600, ONE, 0), "# # @ # #"),
    "flat ellipse, turned": (lambda: rasterize.ellipse(600, 0, *oracle.unit(45.0)), "#.. .@. ..#"),
    "square on centres": (lambda: polygon([(0, 0), (512, 0), (512, 512), (0, 512)]), "@## ### ###"),
    "square on edges": (lambda: polygon([(-128, -128), (384, -128), (384, 384), (-128, 384)]), "@# ##"),
    "square between": (lambda: polygon([(1, 1), (511, 1), (511, 511), (1, 511)]), "o. .#"),
    "triangle": (lambda: polygon([(0, 0), (1024, 0), (0, 1024)]), "@#### ####. ###.. ##... #...."),
    "square with a hole": (
        lambda: polygon(
            [(0, 0), (1536, 0), (1536, 1536), (0, 1536)], [(512, 512), (1024, 512), (1024, 1024), (512, 1024)]
        ),
        "@###### ####### ####### ###.### ####### ####### #######",
    ),
    "hourglass": (lambda: polygon([(0, 0), (1024, 0), (0, 1024), (1024, 1024)]), "@#### .###. ..#.. .###. #####"),
    "two squares": (
        lambda: polygon([(0, 0), (256, 0), (256, 256), (0, 256)], [(768, 0), (1024, 0), (1024, 256), (768, 256)]),
        "@#.## ##.##",
    ),
    "point": (lambda: polygon([(256, 256)]), "o. .#"),
    "edge and back": (lambda: polygon([(0, 0), (768, 768)]), "@... .#.. ..#. ...#"),
    "beam 6 px wide": (
        lambda: beam((0, 0), (512, 0), 768),
        "...###... .#######. .#######. ###@##### .#######. .#######. ...###...",
    ),
    "thin beam between rows": (lambda: beam((0, 102), (2560, 102), 51), "@##########"),
    "beam of no width": (lambda: beam((0, 0), (512, 512), 0), "@#. ### .##"),
    "beam of no length": (lambda: beam((0, 0), (0, 0), 256), ".#. #@# .#."),
    "cone right": (lambda: cone(768, (ONE, 0), 45.0), "..#. .##. @### .##. ..#."),
    "cone of no angle": (lambda: cone(768, (ONE, 0), 0.0), "@###"),
    "half disc": (lambda: cone(512, (0, ONE), 90.0), "##@## .###. ..#.."),
    "full disc": (lambda: cone(512, (0, ONE), 180.0), "..#.. .###. ##@## .###. ..#.."),
    "three quarters": (lambda: cone(512, (ONE, 0), 135.0), "..#.. .###. ..@## .###. ..#.."),
    "diagonal": (lambda: segment((0, 0), (512, 512)), "@#. ### .##"),
    "on an edge": (lambda: segment((0, 128), (512, 128)), "@## ###"),
    "on a corner": (lambda: segment((128, 128), (128, 128)), "@# ##"),
    "to the edge": (lambda: segment((0, 0), (128, 0)), "@#"),
    "knight": (lambda: segment((0, 0), (512, 256)), "@#. .##"),
}


@pytest.mark.parametrize("name", PICTURES)
def test_picture(name: str) -> None:
    make, picture = PICTURES[name]
    assert pixel_set(make()) == drawn(picture)


@pytest.mark.parametrize(
    ("name", "make", "count"),
    [
        ("closed square of side 10", lambda: polygon([(0, 0), (2560, 0), (2560, 2560), (0, 2560)]), 121),
        ("the same, half a pixel off", lambda: polygon([(128, 128), (2688, 128), (2688, 2688), (128, 2688)]), 100),
        ("diagonal of 20 px", lambda: segment((0, 0), (5120, 5120)), 61),
        ("row of 20 px", lambda: segment((0, 0), (5120, 0)), 21),
        ("disc of 5 px", lambda: rasterize.disc(1280), 81),
    ],
)
def test_count(name: str, make: Callable[[], Spans], count: int) -> None:
    assert make().count == count
    assert len(pixel_set(make())) == count


# Laws over the whole family of shapes


@dataclass(frozen=True)
class Family:
    """A shape by its parameters, and what a linear map of the plane does to them."""

    draw: st.SearchStrategy[Any]
    make: Callable[[Any], Spans]
    # (parameters, map of vectors) -> parameters of the mapped shape
    mapped: Callable[[Any, Callable[[Point], Point]], Any]
    # parameters -> the same shape moved by a vector, for shapes that are not tied to the origin
    moved: Callable[[Any, Point], Any] | None = None


def plus(p: Point, d: Point) -> Point:
    return p[0] + d[0], p[1] + d[1]


FAMILIES: dict[str, Family] = {
    "disc": Family(lengths, rasterize.disc, lambda p, _: p),
    "ring": Family(st.tuples(lengths, lengths).map(sorted), lambda p: rasterize.ring(*p), lambda p, _: p),
    "ellipse": Family(
        st.tuples(lengths, lengths, directions),
        lambda p: rasterize.ellipse(p[0], p[1], *p[2]),
        lambda p, f: (p[0], p[1], f(p[2])),
    ),
    "polygon": Family(
        polygons,
        lambda p: polygon(*p),
        lambda p, f: [[f(v) for v in ring] for ring in p],
        lambda p, d: [[plus(v, d) for v in ring] for ring in p],
    ),
    "beam": Family(
        st.tuples(points, points, small_lengths),
        lambda p: beam(*p),
        lambda p, f: (f(p[0]), f(p[1]), p[2]),
        lambda p, d: (plus(p[0], d), plus(p[1], d), p[2]),
    ),
    "cone": Family(st.tuples(lengths, directions, half_angles), lambda p: cone(*p), lambda p, f: (p[0], f(p[1]), p[2])),
    "segment": Family(
        st.tuples(points, points),
        lambda p: segment(*p),
        lambda p, f: (f(p[0]), f(p[1])),
        lambda p, d: (plus(p[0], d), plus(p[1], d)),
    ),
}
MAPS: dict[str, Callable[[Point], Point]] = {
    "mirror left-right": lambda v: (-v[0], v[1]),
    "mirror up-down": lambda v: (v[0], -v[1]),
    "quarter turn": lambda v: (-v[1], v[0]),
    "half turn": lambda v: (-v[0], -v[1]),
    "swap x and y": lambda v: (v[1], v[0]),
}


@pytest.mark.parametrize("radii", [(0, 256), (0, 14 * 256), (3 * 256, 0), (0, FAR)])
@pytest.mark.parametrize("slope", [1, 2, -2, 5])
def test_a_flat_ellipse_all_but_along_an_axis_has_its_middle_alone(radii: tuple[int, int], slope: int) -> None:
    """The next centre on it lies millions of pixels away, where squares overflow."""
    for c, s in ((ONE, slope), (slope, ONE), (-ONE, slope), (slope, -ONE)):
        assert pixel_set(rasterize.ellipse(*radii, c, s)) == {(0, 0)}


@pytest.mark.parametrize(("family", "linear"), some_of(product(FAMILIES, MAPS)))
def test_mirrors_and_quarter_turns(family: str, linear: str) -> None:
    shape, f = FAMILIES[family], MAPS[linear]

    @LAWS
    @given(shape.draw)
    def law(p: Any) -> None:
        assert pixel_set(shape.make(shape.mapped(p, f))) == {f(v) for v in pixel_set(shape.make(p))}

    law()


@pytest.mark.parametrize("far_px", [5, 10**5, 2**20 - 2 * REACH])
@pytest.mark.parametrize("family", [name for name, shape in FAMILIES.items() if shape.moved])
def test_moves_by_whole_pixels(family: str, far_px: int) -> None:
    shape = FAMILIES[family]

    @LAWS
    @given(shape.draw, st.integers(-far_px, far_px), st.sampled_from([-1, 0, 1]))
    def law(p: Any, dx: int, side: int) -> None:
        dy = side * math.isqrt(far_px**2 - dx**2)  # no further off than far_px
        assert shape.make(shape.moved(p, (256 * dx, 256 * dy))) == shape.make(p).translated(dx, dy)

    law()


def test_inputs_are_left_alone() -> None:
    a, b, ring = np.array([3, 700]), np.array([-900, 5]), np.array([[0, 0], [900, 30], [40, 1000]])
    copies = [v.copy() for v in (a, b, ring)]
    rasterize.beams(a, b[None], 0).spans()
    rasterize.beams(b, a[None], 200).spans()
    rasterize.polygon([ring, ring])
    assert all(np.array_equal(v, copy) for v, copy in zip((a, b, ring), copies, strict=True))


# Wider covers narrower


def is_within(narrow: Spans, wide: Spans) -> bool:
    return narrow.union(wide) == wide


@LAWS
@given(lengths, lengths)
def test_a_larger_disc_covers_a_smaller(one: int, other: int) -> None:
    small, large = sorted((one, other))
    assert is_within(rasterize.disc(small), rasterize.disc(large))


@LAWS
@given(st.lists(lengths, min_size=4, max_size=4).map(sorted))
def test_a_ring_covers_a_ring_within_its_edges(radii: list[int]) -> None:
    assert is_within(rasterize.ring(radii[1], radii[2]), rasterize.ring(radii[0], radii[2]))
    assert is_within(rasterize.ring(radii[1], radii[2]), rasterize.ring(radii[1], radii[3]))
    assert is_within(rasterize.ring(radii[1], radii[2]), rasterize.disc(radii[2]))


@LAWS
@given(lengths, lengths, lengths, directions)
def test_a_larger_ellipse_covers_a_smaller(one: int, other: int, across: int, axis: Point) -> None:
    small, large = sorted((one, other))
    assert is_within(rasterize.ellipse(small, across, *axis), rasterize.ellipse(large, across, *axis))
    assert is_within(rasterize.ellipse(across, small, *axis), rasterize.ellipse(across, large, *axis))


@LAWS
@given(points, points, small_lengths, small_lengths)
def test_a_wider_beam_covers_a_narrower(a: Point, b: Point, one: int, other: int) -> None:
    narrow, wide = sorted((one, other))
    assert is_within(beam(a, b, narrow), beam(a, b, wide))
    assert is_within(segment(a, b), beam(a, b, narrow))


@LAWS
@given(lengths, directions, half_angles, half_angles)
@example(2560, (ONE, 0), 0.0, 1e-3)
@example(2560, (ONE, 0), 0.0, 40.0)
@example(2560, oracle.unit(45.0), 89.0, 90.0)
@example(2560, oracle.unit(45.0), 90.0, 91.0)
def test_a_wider_cone_covers_a_narrower(reach: int, axis: Point, one: float, other: float) -> None:
    narrow, wide = sorted((one, other))
    assert is_within(cone(reach, axis, narrow), cone(reach, axis, wide))


@LAWS
@given(lengths, lengths, directions, half_angles)
def test_a_longer_cone_covers_a_shorter(one: int, other: int, axis: Point, half: float) -> None:
    short, long = sorted((one, other))
    # the far end of the axis is rounded, so the two axes may differ where they only touch a square
    whole = cone(long, axis, half).union(segment((0, 0), oracle.turned((short, 0), *axis)))
    assert is_within(cone(short, axis, half), whole)


@LAWS
@given(lengths, lengths, st.integers(0, 7), half_angles)
def test_a_longer_cone_covers_a_shorter_on_exact_axes(one: int, other: int, eighth: int, half: float) -> None:
    short, long = sorted((one, other))
    axis = oracle.unit(45.0 * eighth)
    assert is_within(cone(short, axis, half), cone(long, axis, half))


# One shape as another


@LAWS
@given(lengths, directions)
def test_a_disc_by_other_names(radius: int, axis: Point) -> None:
    disc = rasterize.disc(radius)
    tip = oracle.turned((radius, 0), *axis)
    assert rasterize.ring(0, radius) == disc
    assert rasterize.ellipse(radius, radius, *axis) == disc
    assert beam((0, 0), (0, 0), radius) == disc
    assert cone(radius, axis, 180.0) == disc.union(segment((0, 0), tip))


@LAWS
@given(lengths, lengths, directions)
def test_an_ellipse_by_its_other_axis(radius_x: int, radius_y: int, axis: Point) -> None:
    c, s = axis
    assert rasterize.ellipse(radius_x, radius_y, c, s) == rasterize.ellipse(radius_y, radius_x, -s, c)


@LAWS
@given(lengths, directions)
def test_two_half_cones_are_the_disc(reach: int, axis: Point) -> None:
    c, s = axis
    both = cone(reach, (c, s), 90.0).union(cone(reach, (-c, -s), 90.0))
    tip = oracle.turned((reach, 0), c, s)
    axes = segment((0, 0), tip).union(segment((0, 0), (-tip[0], -tip[1])))
    assert both == rasterize.disc(reach).union(axes)


@LAWS
@given(points, points, small_lengths)
def test_the_ends_may_be_swapped(a: Point, b: Point, radius: int) -> None:
    assert segment(a, b) == segment(b, a)
    assert beam(a, b, radius) == beam(b, a, radius)
    assert beam(a, b, 0) == segment(a, b)


@LAWS
@given(points, points)
def test_nothing_slips_through_a_segment(a: Point, b: Point) -> None:
    # connected by edges, so that a wall that is connected by corners cannot be passed
    cells = pixel_set(segment(a, b))
    reached, todo = set(), [next(iter(cells))]
    while todo:
        x, y = todo.pop()
        if (x, y) in cells and (x, y) not in reached:
            reached.add((x, y))
            todo += [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
    assert reached == cells
    assert {(v[0] + 128) // 256 for v in (a, b)} <= {x for x, _ in cells}


@LAWS
@given(points, points)
def test_a_segment_is_its_two_halves(a: Point, b: Point) -> None:
    middle = ((a[0] + b[0]) // 2, (a[1] + b[1]) // 2)
    b = (2 * middle[0] - a[0], 2 * middle[1] - a[1])  # so that the middle is exact
    assert segment(a, middle).union(segment(middle, b)) == segment(a, b)


@pytest.mark.parametrize("half_degrees", [0.0, 0.5, 2.5])
@pytest.mark.parametrize("degrees", [0.0, 7.0, 30.0, 45.0, 101.0, 250.0])
def test_a_narrow_cone_has_no_gap_at_the_muzzle(degrees: float, half_degrees: float) -> None:
    xs = {x for x, _ in pixel_set(cone(40 * 256, oracle.unit(degrees), half_degrees))}
    ys = {y for _, y in pixel_set(cone(40 * 256, oracle.unit(degrees), half_degrees))}
    assert xs == set(range(min(xs), max(xs) + 1))
    assert ys == set(range(min(ys), max(ys) + 1))


# Polygons: many ways to write one


@LAWS
@given(polygons, st.integers(0, 6), st.randoms(use_true_random=False))
def test_the_order_of_points_and_rings_does_not_matter(
    rings: list[list[Point]], shift: int, rng: random.Random
) -> None:
    whole = polygon(*rings)
    assert polygon(*(ring[::-1] for ring in rings)) == whole
    assert polygon(*(ring[shift % len(ring) :] + ring[: shift % len(ring)] for ring in rings)) == whole
    mixed = rings[:]
    rng.shuffle(mixed)
    assert polygon(*mixed) == whole


@LAWS
@given(ring_points)
def test_points_along_an_edge_do_not_matter(ring: list[Point]) -> None:
    doubled = [(2 * x, 2 * y) for x, y in ring]  # so that the middle of an edge is exact
    middles = [plus(p, q) for p, q in zip(ring, ring[1:] + ring[:1], strict=True)]
    assert polygon([p for pair in zip(doubled, middles, strict=True) for p in pair]) == polygon(doubled)
    assert polygon([p for p in doubled for _ in range(2)]) == polygon(doubled)
    assert polygon([*doubled, doubled[0]]) == polygon(doubled)


@LAWS
@given(polygons, polygons)
def test_even_odd(one: list[list[Point]], other: list[list[Point]]) -> None:
    both = one + other
    edges = [(p, q) for ring in both for p, q in zip(ring, ring[1:] + ring[:1], strict=True)]
    a, b = pixel_set(polygon(*one)), pixel_set(polygon(*other))
    rim = {(x, y) for x, y in a | b if any(oracle.on_edge((256 * x, 256 * y), p, q) for p, q in edges)}
    assert pixel_set(polygon(*both)) == (a ^ b) | rim


@LAWS
@given(points, points, points)
def test_a_triangle_is_its_two_parts(a: Point, b: Point, c: Point) -> None:
    c = (c[0] + (b[0] - c[0]) % 2, c[1] + (b[1] - c[1]) % 2)  # so that the middle of bc is exact
    middle = ((b[0] + c[0]) // 2, (b[1] + c[1]) // 2)
    parts = polygon([a, b, middle]).union(polygon([a, middle, c]))
    assert parts == polygon([a, b, c])


@LAWS
@given(st.lists(st.integers(-8, 8).map(lambda n: n * 256), min_size=4, max_size=4))
def test_a_hole_keeps_its_rim(numbers: list[int]) -> None:
    (x_min, x_max), (y_min, y_max) = sorted(numbers[:2]), sorted(numbers[2:])
    assume(x_min < x_max and y_min < y_max)
    far = 10 * 256
    outer = [(-far, -far), (far, -far), (far, far), (-far, far)]
    hole = [(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)]
    left_out = {(x, y) for x in range(x_min // 256 + 1, x_max // 256) for y in range(y_min // 256 + 1, y_max // 256)}
    assert pixel_set(polygon(outer, hole)) == pixel_set(polygon(outer)) - left_out


# Far out: 2**20 px, where a product of two coordinates needs 57 bits and a float has 53


def test_a_disc_of_a_million_pixels() -> None:
    for radius in (FAR, FAR - 1):
        disc = rasterize.disc(radius)
        rows = disc.y.tolist()
        assert (rows[0], rows[-1]) == (-(radius // 256), radius // 256)
        assert len(disc) == 2 * (radius // 256) + 1
        for y in {0, 1, 2**10, 2**19, 741_455, radius // 256 - 1, radius // 256}:
            width = math.isqrt(radius**2 - (256 * y) ** 2) // 256
            for row in (y, -y):
                i = row + radius // 256
                assert (rows[i], int(disc.x_first[i]), int(disc.x_last[i])) == (row, -width, width)


@pytest.mark.parametrize(("short_by", "width"), [(0, 800_000), (1, 799_999)])
def test_a_large_disc_with_centres_on_its_edge(short_by: int, width: int) -> None:
    disc = rasterize.disc(256 * 1_000_000 - short_by)  # 3, 4, 5
    for y in (-600_000, 600_000):
        i = int(np.searchsorted(disc.y, y))
        assert (int(disc.x_first[i]), int(disc.x_last[i])) == (-width, width)


def test_a_ring_of_a_million_pixels() -> None:
    inner, outer = FAR - 300, FAR
    ring = rasterize.ring(inner, outer)
    for y in (0, 1, 741_455, 1_000_003, 2**20):
        edge = math.isqrt(max(outer**2 - (256 * y) ** 2, 0)) // 256
        for x in range(max(edge - 4, 0), edge + 3):
            assert covers(ring, x, y) == covers(ring, -x, -y) == oracle.in_ring(x, y, inner, outer)


far_out = st.one_of(st.integers(-60, 60).map(lambda n: 128 * n), st.integers(-9000, 9000)).map(
    lambda v: v - FAR + 2**16
)
far_ends = st.tuples(far_out, st.integers(-2000, 2000))
near_a_corner = st.integers(-300, 300).map(lambda v: v - 2**27)
far_diagonal = st.tuples(near_a_corner, near_a_corner)
any_third = st.tuples(st.integers(-FAR * 15 // 16, FAR * 15 // 16), st.integers(-9000, 9000))


def mirrored(p: Point) -> Point:
    return -p[0], -p[1]


def near(a: Point, b: Point, count: int, reach_px: int, rng: random.Random) -> list[Point]:
    """List pixels at places along a line, up to some px off it."""
    found = []
    for t in [0.0, 1.0, *(rng.random() for _ in range(count))]:
        x, y = round((a[0] + t * (b[0] - a[0])) / 256), round((a[1] + t * (b[1] - a[1])) / 256)
        found += [(x + dx, y + dy) for dx in (-1, 0, 1) for dy in range(-reach_px, reach_px + 1)]
    return found


FAR_OFF = examples(8, deadline=None)


@FAR_OFF
@given(far_ends, far_ends, st.randoms(use_true_random=False))
def test_a_long_segment(a: Point, b: Point, rng: random.Random) -> None:
    b = mirrored(b)
    spans = segment(a, b)
    assert spans == segment(b, a)
    for x, y in near(a, b, 30, 2, rng):
        assert covers(spans, x, y) == oracle.meets_segment(x, y, a, b)


@examples(4, deadline=None)
@given(far_diagonal, far_diagonal, st.randoms(use_true_random=False))
@example((-(2**27), -(2**27)), (-(2**27), -(2**27)), random.Random(1))
def test_a_long_diagonal_segment(a: Point, b: Point, rng: random.Random) -> None:
    b = mirrored(b)
    spans = segment(a, b)
    for x, y in near(a, b, 30, 2, rng):
        assert covers(spans, x, y) == oracle.meets_segment(x, y, a, b)


@FAR_OFF
@given(far_ends, far_ends, spread(0, 20), st.randoms(use_true_random=False))
def test_a_long_beam(a: Point, b: Point, radius: int, rng: random.Random) -> None:
    b = mirrored(b)
    spans = beam(a, b, radius)
    for x, y in near(a, b, 20, 2, rng):
        for row in (y, y - radius // 256, y + radius // 256):
            assert covers(spans, x, row) == oracle.in_beam(x, row, a, b, radius)


@FAR_OFF
@given(far_ends, far_ends, any_third, st.randoms(use_true_random=False))
def test_a_wide_polygon(a: Point, b: Point, c: Point, rng: random.Random) -> None:
    b = mirrored(b)
    spans = polygon([a, b, c])
    for p, q in ((a, b), (b, c), (c, a)):
        for x, y in near(p, q, 20, 2, rng):
            assert covers(spans, x, y) == oracle.in_polygon(x, y, [[a, b, c]])


def test_a_tall_polygon_with_centres_on_its_edges() -> None:
    # both long edges run through pixel centres, every 3 rows and every 7 columns
    k = 137_000
    ring = [(-256 * 7 * k, -256 * 3 * k), (256 * 7 * k, 256 * 3 * k), (256 * 7 * k - 256, 256 * 3 * k)]
    spans = polygon(ring)
    for n in (-k, -k + 1, -12_345, 0, 1, 77_777, k - 1, k):
        for dx in (-2, -1, 0, 1):
            x, y = 7 * n + dx, 3 * n
            assert covers(spans, x, y) == oracle.in_polygon(x, y, [ring])
        assert covers(spans, 7 * n, 3 * n)


@pytest.mark.parametrize("nudge", [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
def test_a_long_segment_through_corners(nudge: Point) -> None:
    # the line runs through the corner of four pixels every 7 columns, and misses it by next to nothing when nudged
    k = 137_000
    a, b = (128 - 256 * 7 * k, 128 - 256 * 3 * k), (128 + 256 * 7 * k + nudge[0], 128 + 256 * 3 * k + nudge[1])
    spans = segment(a, b)
    for n in (-k + 1, -99_999, -1, 0, 1, 12_345, k - 1):
        for x, y in itertools.product(range(7 * n - 1, 7 * n + 3), range(3 * n - 1, 3 * n + 3)):
            assert covers(spans, x, y) == oracle.meets_segment(x, y, a, b)
        if nudge == (0, 0):
            assert all(covers(spans, 7 * n + i, 3 * n + j) for i in (0, 1) for j in (0, 1))


@pytest.mark.parametrize("radius", [1280, 1279])
def test_a_long_beam_with_centres_on_its_rim(radius: int) -> None:
    # 3, 4, 5: the rim, 5 px off the axis, runs through a centre every 4 columns
    k = 209_000
    a, b = (-256 * 4 * k, -256 * 3 * k), (256 * 4 * k, 256 * 3 * k)
    spans = beam(a, b, radius)
    for n in (-k, -k + 1, -99_999, 0, 1, 12_345, k - 1, k):
        for x, y in ((4 * n - 3, 3 * n + 4), (4 * n + 3, 3 * n - 4)):
            assert covers(spans, x, y) == (radius == 1280)
            assert all(
                covers(spans, x, y + i) == oracle.in_beam(x, y + i, a, b, radius) for i in (-3, -2, -1, 0, 1, 2, 3)
            )


def passing_by(along: Point, cross: int, lattice_px: int) -> tuple[Point, Point, Point]:
    """Give a segment with this direction, near the origin, and a point that it passes by at cross / length.

    The point lies on a pixel centre (lattice 0) or on a pixel corner (lattice 128); along must be coprime.
    """
    dx, dy = along
    v = pow(dx, -1, dy) * cross  # dx * v - dy * u = cross
    u = (dx * v - cross) // dy
    steps = u // dx
    u, v = u - steps * dx, v - steps * dy
    target = tuple((w - d // 2) // 256 * 256 + lattice_px for w, d in zip((u, v), along, strict=True))
    a = (target[0] - u, target[1] - v)
    return a, plus(a, along), target


# Directions so long that a product of two differences has 58 bits; turned and mirrored to point anywhere.
long_ways = st.tuples(
    st.integers(2**27, 2**29 - 2**13),
    st.one_of(st.integers(2, 2**12), st.integers(2**27, 2**28), st.integers(2**27, 2**28)),
).filter(lambda d: math.gcd(*d) == 1 and math.hypot(*d) < 2**29 - 2**12)
any_maps = st.sampled_from([lambda v: v, *MAPS.values()])
HAIR = examples(11, deadline=None)


@HAIR
@given(long_ways, st.sampled_from([-1, 0, 1]), any_maps)
def test_a_long_segment_a_hair_off_a_corner(way: Point, side: int, f: Callable[[Point], Point]) -> None:
    a, b, corner = passing_by(way, side, 128)
    spans = segment(f(a), f(b))
    squares = list(itertools.product(*((w // 256, w // 256 + 1) for w in corner)))
    met = [oracle.meets_segment(x, y, a, b) for x, y in squares]
    assert all(met) == (side == 0)  # on the corner all four squares are met, a hair off it only three
    assert sum(met) >= 3
    assert [covers(spans, *f(square)) for square in squares] == met


@HAIR
@given(long_ways, st.integers(1, 4000), st.sampled_from([0, 1]), st.sampled_from([-1, 1]), any_maps)
def test_a_long_beam_a_hair_off_a_centre(
    way: Point, radius: int, beyond: int, side: int, f: Callable[[Point], Point]
) -> None:
    reach = math.isqrt(radius**2 * (way[0] ** 2 + way[1] ** 2))  # the largest product that is within the radius
    a, b, centre = passing_by(way, side * (reach + beyond), 0)
    x, y = centre[0] // 256, centre[1] // 256
    inside = oracle.in_beam(x, y, a, b, radius)
    assert covers(beam(f(a), f(b), radius), *f((x, y))) == inside


@HAIR
@given(long_ways, st.sampled_from([-1, 0, 1]), st.integers(-400, 400), any_maps)
def test_a_long_edge_a_hair_off_a_centre(way: Point, side: int, off_px: int, f: Callable[[Point], Point]) -> None:
    a, b, centre = passing_by(way, side, 0)
    x, y = centre[0] // 256, centre[1] // 256
    ring = [a, b, (0, 256 * off_px)]
    assert covers(polygon([f(p) for p in ring]), *f((x, y))) == oracle.in_polygon(x, y, [ring])


def test_a_flat_ellipse_of_a_million_pixels() -> None:
    spans = rasterize.ellipse(FAR, 640, ONE, 0)
    assert (spans.y.min(), spans.y.max()) == (-2, 2)
    for y in range(-3, 4):
        width = math.isqrt(max(640**2 - (256 * y) ** 2, 0)) * FAR // 640 // 256
        for x in range(width - 3, width + 4):
            assert covers(spans, x, y) == covers(spans, -x, y) == oracle.in_ellipse(x, y, FAR, 640, ONE, 0)


def test_a_long_narrow_cone() -> None:
    axis, half = oracle.unit(0.001), oracle.unit(0.0004)
    spans = rasterize.cones(FAR, np.array([axis]), *half).spans()
    for x in (0, 1, 10, 1000, 65_537, 2**20 - 1, 2**20):
        middle = round(x * math.radians(0.001))
        for y in range(middle - 12, middle + 13):
            assert covers(spans, x, y) == oracle.in_cone(x, y, FAR, *axis, *half)


def test_a_long_cone_with_centres_on_its_sides() -> None:
    reach = 300 * 256
    spans = cone(reach, oracle.unit(45.0), 45.0)
    assert pixel_set(spans) == {
        (x, y) for x, y in oracle.pixels(lambda x, y: x * x + y * y <= 300**2, (0, 0, 300, 300))
    } | pixel_set(segment((0, 0), oracle.turned((reach, 0), *oracle.unit(45.0))))
