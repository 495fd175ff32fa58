"""Pairs of volumes that are hard to decide in float64, from a seed: near touching, far away, thin, tied, tiny and huge.

`cases` gives (family, a, b) for two kinds of `oracle_volumes`, as plain tuples of floats, the families in turn. Most
pairs are put together at one point of both outlines, with the outward normals opposite, then moved as the family says,
rounded, and nudged by up to 3 ulp: about half touch or overlap. Polygons are convex, as stored, exactly.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice, product
from typing import Any

import numpy as np
import oracle_volumes as exact

__all__ = [
    "FAMILIES", "ORIENT_FAMILIES", "TRIANGLE_FAMILIES", "as_polygon", "cases", "orient_cases", "triangle_cases",
]  # fmt: skip

Array = np.ndarray[Any, np.dtype[np.float64]]
Rng = np.random.Generator
Shape = tuple[Any, ...]
Case = tuple[str, Shape, Shape]

ULPS = 3
LATTICE_NORMALS = {
    2: ((1, 0, 1), (0, 1, 1), (3, 4, 5), (4, 3, 5), (5, 12, 13), (8, 15, 17)),
    3: ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (1, 2, 2, 3), (2, 3, 6, 7), (4, 4, 7, 9)),
}
"""Whole vectors of whole length, and that length."""


@dataclass(frozen=True)
class Body:
    """A shape on its way: the points that it stores, as rows, and its radius."""

    kind: str
    points: Array
    radius: float = 0.0

    def corners(self) -> Array:
        if self.kind == "aabb":
            return np.array(list(product(*self.points.T)))
        return self.points

    def moved(self, by: Array) -> "Body":
        return replace(self, points=self.points + by)

    def scaled(self, by: float) -> "Body":
        return replace(self, points=self.points * by, radius=self.radius * by)


# Shapes around the origin


def unit(rng: Rng, dim: int) -> Array:
    vector = rng.normal(size=dim)
    return vector / np.sqrt((vector * vector).sum())


def across(along: Array) -> Array:
    return np.array([-along[1], along[0]])


def body(rng: Rng, kind: str, dim: int, size: float = 1.0, thin: float = 1.0, along: Array | None = None) -> Body:
    """A shape about the origin: `size` along a direction (boxes with sides on the axes: x), `size * thin` across it."""
    if kind in ("point", "circle"):
        return Body(kind, np.zeros((1, dim)), size * rng.uniform(0.1, 1) if kind == "circle" else 0.0)
    if kind == "aabb":
        half = size * rng.uniform(0.1, 1, dim) * np.array([1.0] + [thin] * (dim - 1))
        return Body(kind, np.array([-half, half]))
    along = unit(rng, 2) if along is None else along
    length, width = size * rng.uniform(0.1, 1), size * thin * rng.uniform(0.1, 1)
    frame = np.array([along * length, across(along) * width])
    if kind in ("segment", "capsule"):
        return Body(kind, np.array([-frame[0], frame[0]]), width if kind == "capsule" else 0.0)
    if kind == "obb":
        return Body(kind, np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ frame)
    count = int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    if rng.random() < 0.5:  # with a side along the direction
        angles = np.concatenate([[0, np.pi], rng.uniform(0.1, 3, count - 2)])
    return Body(kind, np.stack([np.cos(angles), np.sin(angles)], axis=1) @ frame)


def lattice_body(rng: Rng, kind: str, normal: Sequence[int], flat: bool = False) -> Body:
    """A small shape of whole numbers; its frame is the normal's, its radius a multiple of the normal's length."""
    *vector, length = normal
    dim = len(vector)
    radius = float(length * rng.integers(0 if flat else 1, 1 if flat else 4))
    if kind in ("point", "circle"):
        return Body(kind, np.zeros((1, dim)), radius if kind == "circle" else 0.0)
    if kind == "aabb":
        return Body(kind, np.array([np.zeros(dim), rng.integers(0, 3 if flat else 9, dim).astype(float)]))
    if kind in ("segment", "capsule"):
        step = across(np.array(vector)) if rng.random() < 0.5 else rng.integers(-5, 6, 2)
        end = step * rng.integers(0, 2 if flat else 4)
        return Body(kind, np.array([np.zeros(2), end]).astype(float), radius if kind == "capsule" else 0.0)
    if kind == "obb":
        frame = np.array([vector, across(np.array(vector))]) * rng.integers(0, 2 if flat else 4, (2, 1))
        return Body(kind, rng.permutation(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) @ frame).astype(float))
    return Body(kind, 2.0 * rng.integers(-4, 5, (int(rng.integers(3, 9)), 2)))


# Putting two together


def outermost(rng: Rng, shape: Body, normal: Array, length: float, halfway: bool = False) -> Array:
    """A point of the outline, where the outward normal is (normal / length): a corner, or a place on a side."""
    corners = shape.corners()
    heights = (corners * normal).sum(axis=1)
    top = corners[heights >= heights.max() - 1e-9 * (np.ptp(heights) or 1)]
    place = top[int(rng.integers(len(top)))]
    if len(top) > 1 and rng.random() < 0.5:
        shares = np.full(2, 0.5) if halfway else rng.dirichlet(np.ones(2))
        place = (top[:2] * shares[:, None]).sum(axis=0)
    return place + normal * (shape.radius / length)


def touching(
    rng: Rng, a: Body, b: Body, normal: Array, length: float = 1.0, halfway: bool = False
) -> tuple[Body, Body]:
    there = outermost(rng, a, normal, length, halfway)
    return a, b.moved(there - outermost(rng, b, -normal, length, halfway))


def nudged(rng: Rng, *bodies: Body) -> tuple[Body, ...]:
    """Every number moved by up to 3 ulp: its own, or in half of the cases that of the greatest number."""
    greatest = max(np.abs(b.points).max() + b.radius for b in bodies)
    coarse, most = rng.random() < 0.5, int(rng.integers(ULPS + 1))

    def moved(values: Array) -> Array:
        ulp = np.spacing(np.full_like(values, greatest) if coarse else np.abs(values))
        return values + rng.integers(-most, most + 1, values.shape) * ulp

    return tuple(
        replace(b, points=moved(b.points), radius=abs(float(moved(np.array(b.radius)))) if b.radius else 0.0)
        for b in bodies
    )


def exact_hull(points: Array) -> list[Shape]:
    """The hull of float64 points, its corners as they came."""
    rows = [tuple(row) for row in points.tolist()]
    stored_as = dict(zip(exact.units(*rows), rows, strict=True))
    return [stored_as[corner] for corner in exact.hull(stored_as)]


def as_polygon(rng: Rng, points: Array) -> Shape | None:
    """The exact hull of points as a convex polygon: any start, either sense, at times a point on a side."""
    ring = exact_hull(points)
    if len(ring) < 3:
        return None
    (x0, y0), (x1, y1) = ring[0], ring[1]
    middle = (x0 / 2 + x1 / 2, y0 / 2 + y1 / 2)
    if rng.random() < 0.3 and exact.orient2d(ring[0], ring[1], middle) == 0 and middle not in ring:
        ring.insert(1, middle)
    start = int(rng.integers(len(ring)))
    return tuple((ring[start:] + ring[:start])[:: 1 if rng.random() < 0.5 else -1])


def stored(rng: Rng, shape: Body) -> Shape | None:
    """As plain floats; None for what is no shape: a polygon without an area."""
    rows = tuple(map(tuple, shape.points.tolist()))
    match shape.kind:
        case "point":
            return rows[0]
        case "circle":
            return rows[0], float(shape.radius)
        case "capsule":
            return *rows, float(shape.radius)
        case "aabb":
            return tuple(map(tuple, np.sort(shape.points, axis=0).tolist()))
        case "polygon":
            return as_polygon(rng, shape.points)
    return rows


# Families: each makes one pair of bodies


def contact(
    rng: Rng, kinds: tuple[str, str], dim: int, sizes: tuple[float, float] = (1.0, 1.0), thin: float | None = None
) -> tuple[Body, Body]:
    """Two shapes that touch about the origin of the first, with a normal of a side or any other."""
    frames = [np.eye(2)[0] if kind == "aabb" else unit(rng, 2) for kind in kinds]
    thins = [rng.uniform(0.1, 1) if thin is None else thin for _ in kinds]
    a, b = (body(rng, *row) for row in zip(kinds, (dim, dim), sizes, thins, frames, strict=True))
    normal = unit(rng, dim)
    if rng.random() < 0.6:
        normal = np.eye(dim)[int(rng.integers(dim))] if dim == 3 else across(frames[int(rng.integers(2))])
    return touching(rng, a, b, normal * rng.choice([-1, 1]))


def near_touching(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    return nudged(rng, *contact(rng, kinds, dim))


def far_away(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """Both moved by 10^0 to 10^12: whole numbers by whole numbers, so that ties stay ties, or any."""
    if rng.random() < 0.4:
        whole = np.rint(unit(rng, dim) * 10 ** rng.uniform(0, 12))
        return tuple(b.moved(whole) for b in lattice(rng, kinds, dim))
    by = unit(rng, dim) * 10 ** rng.uniform(0, 12)
    return nudged(rng, *(b.moved(by) for b in contact(rng, kinds, dim)))


def size_ratio(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """One up to 10^12 times as large as the other."""
    power = rng.uniform(-6, 6)
    return nudged(rng, *contact(rng, kinds, dim, (10**power, 10**-power)))


def needles(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """Slivers, up to 10^16 times as long as wide."""
    return nudged(rng, *contact(rng, kinds, dim, thin=10 ** rng.uniform(-16, -2)))


def parallel(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """Sides that are parallel but for rounding or a little more, side by side or one after the other on a line."""
    along = np.array([1.0, 0.0]) if "aabb" in kinds or rng.random() < 0.3 else unit(rng, 2)
    tilted = along + across(along) * (10 ** rng.uniform(-17, -6) if rng.random() < 0.6 else 0)
    frames = [along, tilted] if kinds[1] != "aabb" else [tilted, along]
    a, b = (body(rng, kind, dim, thin=10 ** rng.uniform(-3, 0), along=f) for kind, f in zip(kinds, frames, strict=True))
    normal = np.eye(dim)[int(rng.integers(dim))] if dim == 3 else (along, across(along))[int(rng.integers(2))]
    return nudged(rng, *touching(rng, a, b, normal * rng.choice([-1, 1])))


def shared(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """A corner, or a whole side, of both is the same to the last bit; half of them are nudged after all."""
    a = replace(body(rng, kinds[0], dim), radius=0.0)
    normal = unit(rng, dim)
    b = replace(body(rng, kinds[1], dim), radius=0.0)
    top = a.corners()[np.argmax((a.corners() * normal).sum(axis=1))]
    row = int(np.argmin((b.corners() * normal).sum(axis=1)))
    if kinds[1] == "aabb":
        side = ((b.corners()[row] == b.points[1]) + 0).astype(int)
        points = b.points + (top - b.corners()[row])
        points[side, np.arange(dim)] = top
    else:
        points = b.points + (top - b.points[row])
        points[row] = top
    if kinds[1] in ("segment", "capsule", "obb", "polygon") and len(a.corners()) > 1 and rng.random() < 0.5:
        points = on_a_side(rng, a, kinds[1])
    pair = a, replace(b, points=points)
    return pair if rng.random() < 0.3 else nudged(rng, *pair)


def on_a_side(rng: Rng, a: Body, kind: str) -> Array:
    """Points of a shape that has a side of another, and lies on the side's far side."""
    ring = np.array(exact_hull(a.corners()))
    row = int(rng.integers(len(ring)))
    first, last = ring[row], ring[(row + 1) % len(ring)]
    out = -across(last - first) * rng.uniform(0.1, 1)
    if kind in ("segment", "capsule"):
        return np.array([first, last])
    if kind == "obb":
        return np.array([first, last, last + out, first + out])
    return np.array([last, first, first + out + (last - first) * rng.uniform(-1, 2)])


def lattice_pair(rng: Rng, kinds: tuple[str, str], dim: int, flat: bool = False) -> tuple[Body, Body]:
    """Two shapes of whole numbers, or of halves, that touch exactly in the origin."""
    *vector, length = LATTICE_NORMALS[dim][int(rng.integers(6))]
    normal = [int(v) for v in np.array(vector) * rng.choice([-1, 1], dim)]
    a, b = (lattice_body(rng, kind, [*normal, length], flat) for kind in kinds)
    there = np.array(normal, float)
    a, b = a.moved(-outermost(rng, a, there, length, True)), b.moved(-outermost(rng, b, -there, length, True))
    return a, b.moved(np.sign(normal)) if rng.random() < 0.3 else b


def lattice(rng: Rng, kinds: tuple[str, str], dim: int, flat: bool = False) -> tuple[Body, ...]:
    """Whole numbers: they touch exactly, or are a step away, or lie anywhere near."""
    a, b = lattice_pair(rng, kinds, dim, flat)
    reach = int(rng.choice([0, 0, 1, 3 if flat else 6]))
    steps = rng.integers(-reach, reach + 1, (2, dim))
    return a.moved(steps[0]), b.moved(steps[1] if reach > 1 else steps[0] + rng.integers(-reach, reach + 1, dim))


def flat(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """Whole numbers and nothing in them: radius 0, boxes and capsules that are a line or a point."""
    return lattice(rng, kinds, dim, flat=True)


def mixed(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """They touch in the origin, where scaling by powers of two keeps ties; one may be 10^600 times the other."""
    return tuple(b.scaled(2.0 ** int(rng.integers(-1060, 1000))) for b in lattice_pair(rng, kinds, dim))


def at_scale(rng: Rng, kinds: tuple[str, str], dim: int, powers: tuple[int, int]) -> tuple[Body, ...]:
    power = 2.0 ** int(rng.integers(*powers))
    if rng.random() < 0.5:
        return tuple(b.scaled(power) for b in lattice(rng, kinds, dim))
    return nudged(rng, *(b.scaled(power) for b in contact(rng, kinds, dim)))


def subnormal(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    return at_scale(rng, kinds, dim, (-1073, -1015))


def huge(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """To 10^150: products of two coordinates stay finite, products of three do not."""
    return at_scale(rng, kinds, dim, (400, 498))


def greatest(rng: Rng, kinds: tuple[str, str], dim: int) -> tuple[Body, ...]:
    """To 10^307: no product is finite."""
    return at_scale(rng, kinds, dim, (700, 1014))


FAMILIES: dict[str, Callable[[Rng, tuple[str, str], int], tuple[Body, ...]]] = {
    "near_touching": near_touching, "far_away": far_away, "size_ratio": size_ratio, "needles": needles,
    "parallel": parallel, "shared": shared, "lattice": lattice, "flat": flat, "mixed": mixed,
    "subnormal": subnormal, "huge": huge, "greatest": greatest,
}  # fmt: skip


def cases(
    kind_a: str, kind_b: str, count: int, seed: int = 0, dim: int = 2, families: Sequence[str] = tuple(FAMILIES)
) -> Iterator[Case]:
    """Give `count` pairs (family, a, b); in 3-D of points, circles and boxes only."""
    rng = np.random.default_rng([seed, *map(ord, f"{kind_a} {kind_b} {dim}")])

    def endless() -> Iterator[Case]:
        for name in cycle(families):
            made = FAMILIES[name](rng, (kind_a, kind_b), dim)
            a, b = (stored(rng, shape) for shape in made)
            if a is not None and b is not None:
                yield name, a, b

    return islice(endless(), count)


# Triangles in space


def as_triangles(a: Array, b: Array) -> tuple[Shape, Shape]:
    return tuple(map(tuple, a.tolist())), tuple(map(tuple, b.tolist()))


def nudged3(rng: Rng, a: Array, b: Array) -> tuple[Array, Array]:
    first, second = nudged(rng, Body("polygon", a), Body("polygon", b))
    return first.points, second.points


def corner_on_face(rng: Rng, size: float = 1.0, thin: float = 1.0) -> tuple[Array, Array]:
    """A corner of one lies on the face of the other, the rest of it on one side."""
    x, y = unit(rng, 3), unit(rng, 3)
    a = np.array([x * 0, x, y * thin + x * rng.uniform(0, 1)]) - 0.4 * x
    normal = np.array(exact.cross3(tuple(x), tuple(y)))
    others = rng.normal(size=(2, 3))
    others *= np.sign((others * normal).sum(axis=1))[:, None]
    others[1] = others[0] + (others[1] - others[0]) * thin
    place = (a * rng.dirichlet(np.ones(3))[:, None]).sum(axis=0)
    return a, np.array([place, *(place + others * size)])


def edge_on_edge(rng: Rng, size: float = 1.0, thin: float = 1.0) -> tuple[Array, Array]:
    """Two edges cross, one triangle below them and one above."""
    x, y = unit(rng, 3), unit(rng, 3)
    up = np.array(exact.cross3(tuple(x), tuple(y))) * thin
    a = np.array([-x * rng.uniform(0.1, 1), x, -up + rng.normal() * x])
    b = np.array([-y * rng.uniform(0.1, 1), y, up + rng.normal() * y]) * size
    return a, b


def either(rng: Rng, size: float = 1.0, thin: float = 1.0) -> tuple[Array, Array]:
    a, b = (corner_on_face, edge_on_edge)[int(rng.integers(2))](rng, size, thin)
    return (a, b) if rng.random() < 0.5 else (b, a)


def near_coplanar(rng: Rng) -> tuple[Array, Array]:
    """Triangles of the plane that nearly touch, put into a plane in space: on whole numbers exactly coplanar."""
    whole = rng.random() < 0.4
    if whole:
        frame = rng.integers(-3, 4, (2, 3)).astype(float)
        flat_a, flat_b = rng.integers(-4, 5, (3, 2)).astype(float), rng.integers(-4, 5, (3, 2)).astype(float)
        if rng.random() < 0.5:
            flat_b = flat_b + flat_a[0] - flat_b[0] + (0, 1)
        return flat_a @ frame, flat_b @ frame
    frame = np.array([unit(rng, 3), unit(rng, 3)])
    along = unit(rng, 2)
    corners = rng.permutation(np.array([-along, along, across(along) * rng.uniform(0.1, 1)]))
    a, b = Body("polygon", corners), Body("polygon", -corners * rng.uniform(0.1, 1))
    a, b = touching(rng, a, b, across(along) if rng.random() < 0.5 else unit(rng, 2))
    return nudged3(rng, rng.permutation(a.points) @ frame, rng.permutation(b.points) @ frame)


def shared3(rng: Rng) -> tuple[Array, Array]:
    """One, two or three corners are the same to the last bit; or were, before a nudge."""
    a, b = rng.normal(size=(2, 3, 3))
    count = int(rng.integers(1, 4))
    b[:count] = a[rng.permutation(3)[:count]]
    b = rng.permutation(b)
    if rng.random() < 0.25:
        return a, b
    return nudged3(rng, a, b)


def lattice3(rng: Rng) -> tuple[Array, Array]:
    reach = int(rng.integers(1, 5))
    a, b = rng.integers(-reach, reach + 1, (2, 3, 3)).astype(float)
    return a, b


def flat3(rng: Rng) -> tuple[Array, Array]:
    """Triangles that are a segment or a point, on whole numbers."""
    a, b = lattice3(rng)
    a[2] = a[0] if rng.random() < 0.5 else 2 * a[1] - a[0]
    if rng.random() < 0.3:
        a[1] = a[0]
    if rng.random() < 0.6:  # put the first corner on the other's edge or corner
        a += b[0] - a[0] if rng.random() < 0.5 else (b[0] + b[1]) / 2 - a[0]
    if rng.random() < 0.4:
        b[2] = b[0]
    return (a, b) if rng.random() < 0.5 else (b, a)


def far3(rng: Rng) -> tuple[Array, Array]:
    by = unit(rng, 3) * 10 ** rng.uniform(0, 12)
    a, b = either(rng)
    return nudged3(rng, a + by, b + by)


def scaled3(rng: Rng, powers: tuple[int, int]) -> tuple[Array, Array]:
    power = 2.0 ** int(rng.integers(*powers))
    a, b = (lattice3, flat3, near_coplanar, either)[int(rng.integers(4))](rng)
    return nudged3(rng, a * power, b * power) if rng.random() < 0.3 else (a * power, b * power)


TRIANGLE_FAMILIES: dict[str, Callable[[Rng], tuple[Array, Array]]] = {
    "near_touching": lambda rng: nudged3(rng, *either(rng)),
    "far_away": far3,
    "size_ratio": lambda rng: nudged3(rng, *either(rng, size=10 ** rng.uniform(-12, 0))),
    "needles": lambda rng: nudged3(rng, *either(rng, thin=10 ** rng.uniform(-16, -2))),
    "near_coplanar": near_coplanar,
    "shared": shared3,
    "lattice": lattice3,
    "flat": flat3,
    "subnormal": lambda rng: scaled3(rng, (-1073, -1015)),
    "huge": lambda rng: scaled3(rng, (250, 498)),
    "greatest": lambda rng: scaled3(rng, (700, 1014)),
}


def triangle_cases(count: int, seed: int = 0, families: Sequence[str] = tuple(TRIANGLE_FAMILIES)) -> Iterator[Case]:
    """Give `count` pairs (family, a, b) of triangles in space."""
    rng = np.random.default_rng([seed, 3])
    for name in islice(cycle(families), count):
        yield name, *as_triangles(*TRIANGLE_FAMILIES[name](rng))


# Points that lie nearly on a line or a plane


def on_a_plane(rng: Rng, dim: int) -> Array:
    points = rng.normal(size=(dim, dim)) * 10 ** rng.uniform(-6, 6)
    shares = rng.dirichlet(np.ones(dim)) if rng.random() < 0.7 else rng.normal(size=dim)
    shares[0] = 1 - shares[1:].sum()
    return np.array([*points, (points * shares[:, None]).sum(axis=0)])


def orient_lattice(rng: Rng, dim: int) -> Array:
    return rng.integers(-2, 3, (dim + 1, dim)).astype(float)


def orient_scaled(rng: Rng, dim: int, powers: tuple[int, int]) -> Array:
    points = orient_lattice(rng, dim) if rng.random() < 0.5 else rng.normal(size=(dim + 1, dim))
    return points * 2.0 ** int(rng.integers(*powers))


ORIENT_FAMILIES: dict[str, Callable[[Rng, int], Array]] = {
    "near_touching": lambda rng, dim: nudged(rng, Body("point", on_a_plane(rng, dim)))[0].points,
    "far_away": lambda rng, dim: nudged(rng, Body("point", on_a_plane(rng, dim) + 10 ** rng.uniform(0, 12)))[0].points,
    "lattice": orient_lattice,
    "subnormal": lambda rng, dim: orient_scaled(rng, dim, (-1073, -1015)),
    "huge": lambda rng, dim: orient_scaled(rng, dim, (250, 498)),
    "greatest": lambda rng, dim: orient_scaled(rng, dim, (700, 1018)),
}


def orient_cases(
    dim: int, count: int, seed: int = 0, families: Sequence[str] = tuple(ORIENT_FAMILIES)
) -> Iterator[tuple[str, Shape]]:
    """Give `count` rows (family, dim + 1 points) for `orient2d` or `orient3d`."""
    rng = np.random.default_rng([seed, dim, 7])
    for name in islice(cycle(families), count):
        yield name, tuple(map(tuple, ORIENT_FAMILIES[name](rng, dim).tolist()))
