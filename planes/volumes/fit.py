"""Bounding volumes fitted to pixels, which exactly contain each closed pixel square, and moved with their objects.

Pixels are a mask (h, w), with the centre of pixel [0, 0] at the origin, or Spans; an empty set is refused. A volume has
one row, in px. Hulls and choices are computed in integers; what float64 cannot hold is rounded outward. Rings turn from
+x toward +y.

A pixel of a turned or scaled mask is set if its centre, mapped back, lies in a set pixel of the frame. So the volume of
the frame, moved with the pose, contains the centres; grown by half a pixel's diagonal it contains the pixel squares.
Flips and quarter turns are exact and need no growth. A shape has no frame: its volume is fitted to its present mask.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.backend import LruCache
from ..common.checks import (
    Bools,
    Floats,
    InputError,
    Ints,
    array_of,
    bools,
    boxes_in,
    choice,
    integer,
    real,
    reals,
    within,
)
from ..common.limits import (
    BOUNDING_BYTES,
    BOUNDING_CACHE_BYTES,
    BOUNDS_SLACK,
    BOXES_MAX,
    CORNERS,
    GROWN_PX,
    LENGTH_TINY,
    MASK_SIDE_MAX,
    PLACE,
    POSITION_MAX,
    SCALE_BITS,
    SHARP,
    SUB,
    TRIG_BITS,
    TRIG_ERROR,
)
from ..grid.fixed_point import pixel
from ..grid.spans import Spans
from ..scene.sprite import Sprite, frame_pivot
from ..scene.variants import Transform, Variant
from .outline import cover, outline
from .polygons import (
    Extents,
    Line,
    Point,
    edge_lines,
    extents,
    fewer_lines,
    hull_points,
    neighbours,
    outward_corners,
    rows_of,
)
from .volumes import Aabbs, BoxSets, Capsules, Circles, Core, Hulls, Obbs, Parts, Polygons, Volumes, joined

if TYPE_CHECKING:
    from ..scene.items import Items

AXES = 33  # number of lengths of a capsule's axis that are tried


def hull(pixels: object) -> Polygons:
    """Convex hull of the pixel squares; its corners are pixel corners, and no three are on one line.

    Parameters
    ----------
    pixels : (h, w) bool, or Spans, with a pixel or more

    Raises
    ------
    InputError
        If there is no pixel, or the mask is too large or not a mask.
    """
    return Polygons(np.array(_corners(pixels)) / 2, [0])


def box(pixels: object) -> Aabbs:
    """Exact axis-aligned box of the pixel squares; `pixels` as in `hull`."""
    rows, first, last = _extents(pixels)
    return Aabbs([[first.min() - 0.5, rows[0] - 0.5]], [[last.max() + 0.5, rows[-1] + 0.5]])


def least_circle(pixels: object) -> Circles:
    """Least circle that contains the pixel squares; `pixels` as in `hull`.

    The exact centre is rounded, and the radius is the least float64 for that centre: only rounding makes it larger.

    References
    ----------
    Elzinga and Hearn, "Geometrical solutions for some minimax location problems" (1972): add the farthest point until
    none is outside. This takes few rounds, each over the corners of the hull.
    """
    corners = _corners(pixels)
    return _circle(corners, _least_center(corners))


def pivot_circle(pixels: object, pivot_xy: Sequence[float]) -> Circles:
    """Least circle about a pivot that contains the pixel squares; no turn about the pivot changes it.

    The centre is `pivot_xy` (2,), px; the radius is rounded up. `pixels` as in `hull`.
    """
    corners = _corners(pixels)
    x, y = reals("pivot_xy", pivot_xy, (2,), POSITION_MAX).tolist()
    return _circle(corners, (x, y))


def capsule(pixels: object) -> Capsules:
    """Capsule around the pixel squares, for long and thin shapes such as a beam; `pixels` as in `hull`.

    Its axis is that of the least box, shortened at both ends to make the area least (to 1/64 of its length). If the
    least circle is smaller, the capsule is that circle.
    """
    corners = _corners(pixels)
    a, b, c, d = outward_corners(_least_sides(corners))
    if ((b - a) ** 2).sum() < ((c - b) ** 2).sum():
        a, b, c, d = b, c, d, a
    begin, end = (a + d) / 2, (b + c) / 2
    inward = np.linspace(0, 0.5, AXES)[:, None] * (end - begin)
    found = min(zip(begin + inward, end - inward, strict=True), key=lambda axis: _capsule_area(corners, *axis))
    circle = _circle(corners, _least_center(corners))
    if math.pi * circle.radius[0] ** 2 <= _capsule_area(corners, *found):
        return Capsules(circle.center, circle.center, circle.radius)
    begin, end = found
    return Capsules(begin[None], end[None], _radius_about(corners, begin, end))


def _capsule_area(corners: list[Point], begin: Floats, end: Floats) -> float:
    """Area, px^2, of the least capsule about an axis that contains points in half pixels, with rounding."""
    along = end - begin
    offset = np.array(corners) / 2 - begin
    share = np.clip((offset * along).sum(axis=1) / max(float((along**2).sum()), LENGTH_TINY), 0, 1)
    radius = math.sqrt(((offset - share[:, None] * along) ** 2).sum(axis=1).max())
    return (2 * math.sqrt((along**2).sum()) + math.pi * radius) * radius


def oriented_box(pixels: object) -> Obbs:
    """Box of least area over all directions; `pixels` as in `hull`.

    Its area is least up to rounding: corners that float64 cannot hold are moved outward, so that the hull of the four
    stored corners contains the pixel squares.

    References
    ----------
    Freeman and Shapira (1975): a side lies on an edge of the hull. Toussaint, "Solving geometric problems with the
    rotating calipers" (1983).
    """
    return Obbs.from_corners(outward_corners(_least_sides(_corners(pixels)))[None])


def boxes(mask: object, k: int) -> BoxSets:
    """Cover the pixel squares of a mask (h, w) by at most k boxes (1 to 64) with few false pixels.

    A greater k never gives more false pixels. Fewer than k boxes are returned if they cover the mask as well. Boxes may
    overlap.
    """
    rows = cover(_checked(mask), integer("k", k, 1, BOXES_MAX)) - 0.5
    return BoxSets(rows[:, :2], rows[:, 2:], [0])


def convex(pixels: object, n: int) -> Polygons:
    """Convex polygon of at most n >= 4 corners that contains the hull; `pixels` as in `hull`.

    It is the hull without the edges whose removal adds the least area, one after the other.
    """
    lines = edge_lines(_corners(pixels))
    return Polygons(outward_corners(fewer_lines(lines, integer("n", n, 4, 4 * MASK_SIDE_MAX))), [0])


def concave(mask: object, tolerance: float) -> Floats:
    """Outline that contains the pixel squares of a mask (h, w) and leaves them by at most `tolerance` px.

    Parts are bridged and holes are filled first, and the tolerance is measured from that. A mask of very many pixels or
    corners is first reduced to square blocks of pixels (see `hitplanes.planes.volumes.outline`).

    Returns
    -------
    (n, 2) float, px: a simple polygon; `ConcavePolygons(points, [0])` makes a volume of it
    """
    checked = _checked(mask)
    return outline(checked, real("tolerance", tolerance, 0, MASK_SIDE_MAX))


def _checked(mask: object, field: str = "mask", expected: str = "a mask (h, w)") -> Bools:
    if array_of(field, mask).ndim == 0:
        raise InputError(f"{field}: expected {expected}, got {type(mask).__name__}")
    checked = bools(field, mask, (None, None))
    if max(checked.shape) > MASK_SIDE_MAX:
        raise InputError(f"{field}: expected sides up to {MASK_SIDE_MAX} px, got shape {checked.shape}")
    if not checked.any():
        raise InputError(f"{field}: expected a pixel or more, got none in shape {checked.shape}")
    return checked


def _extents(pixels: object) -> Extents:
    if not isinstance(pixels, Spans):
        return extents(_checked(pixels, "pixels", "a mask (h, w) or Spans"))
    with within("pixels"):
        pixels = Spans.from_runs(pixels.y, pixels.x_first, pixels.x_last)  # a caller may have made them by hand
    if not len(pixels):
        raise InputError("pixels: expected a pixel or more, got none")
    begins = np.flatnonzero(np.diff(pixels.y, prepend=pixels.y[0] - 1))
    return pixels.y[begins], pixels.x_first[begins], pixels.x_last[np.append(begins[1:], len(pixels)) - 1]


def _corners(pixels: object) -> list[Point]:
    """Corners of the hull, in half pixels."""
    return hull_points(_extents(pixels))


def _circle(corners: list[Point], center: tuple[float, float]) -> Circles:
    return Circles([center], _radius_about(corners, center, center))


def _radius_about(corners: list[Point], a_px: Iterable[float], b_px: Iterable[float]) -> float:
    """Least float64 radius, px, about a segment, or a point given twice, that contains points in half pixels."""
    ratios = [float(v).as_integer_ratio() for v in (*a_px, *b_px)]
    scale = max(below for _, below in ratios)
    ax, ay, bx, by = (2 * above * (scale // below) for above, below in ratios)
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    far = Fraction(0)
    for x, y in corners:
        fx, fy = x * scale - ax, y * scale - ay
        along, square = fx * dx + fy * dy, fx * fx + fy * fy
        if along >= length2 > 0:
            square += length2 - 2 * along
        elif along > 0:
            far = max(far, Fraction(square * length2 - along * along, length2))
            continue
        far = max(far, Fraction(square))
    far /= 4 * scale * scale
    radius = math.nextafter(math.sqrt(far), 0)
    while Fraction(radius) ** 2 < far:
        radius = math.nextafter(radius, math.inf)
    return radius


Center = tuple[int, int, int]  # (x, y, d) with d > 0 stands for (x / d, y / d)


def _least_center(points: list[Point]) -> tuple[float, float]:
    """Centre of the least circle around points in half pixels: px, rounded only once."""
    basis = points[:2]
    while True:
        center = x, y, d = _center(basis)
        far = max(points, key=lambda p: _scaled_square(center, p))
        if _scaled_square(center, far) <= _scaled_square(center, basis[0]):
            return x / (2 * d), y / (2 * d)
        basis = _support([far, *basis])


def _scaled_square(center: Center, point: Point) -> int:
    x, y, d = center
    return (point[0] * d - x) ** 2 + (point[1] * d - y) ** 2


def _center(basis: list[Point]) -> Center:
    """Centre of the circle on two points as diameter, or through three."""
    (x, y), *others = basis
    if len(others) == 1:
        return x + others[0][0], y + others[0][1], 2
    (p, q), (u, v) = ((a - x, b - y) for a, b in others)
    d = 2 * (p * v - q * u)
    up, down = v * (p * p + q * q) - q * (u * u + v * v), p * (u * u + v * v) - u * (p * p + q * q)
    return (x * d + up, y * d + down, d) if d > 0 else (-x * d - up, -y * d - down, -d)


def _support(points: list[Point]) -> list[Point]:
    """The two or three points that define the least circle of at most four; the first point lies on its edge."""
    first, *rest = points
    found = []
    for others in (*itertools.combinations(rest, 1), *itertools.combinations(rest, 2)):
        basis = [first, *others]
        center = _center(basis)
        square = _scaled_square(center, first)
        if center[2] and all(_scaled_square(center, p) <= square for p in points):
            found.append((Fraction(square, center[2] ** 2), basis))
    return min(found)[1]


def _least_sides(ring: list[Point]) -> list[Line]:
    """Four lines of the least box: one lies on an edge of the hull, so each edge is tried."""
    lines, points = edge_lines(ring), np.array(ring).T
    found: list[tuple[Fraction, list[Line]]] = []
    for a, b, c in lines:
        ways = ((-b, a), (-a, -b), (b, -a))
        right, far, left = (np.array(ways) @ points).max(axis=1).tolist()
        area = Fraction((right + left) * (far + c), a * a + b * b)
        others = zip(ways, (right, far, left), strict=True)
        found.append((area, [(a, b, c), *((*way, end) for way, end in others)]))
    return min(found, key=lambda sides: sides[0])[1]


def bounding(kind: str, sprites: Sequence[Sprite], variants: Sequence[Variant]) -> Volumes:
    """Volumes that contain the pixel squares of the masks of one or more variants of sprites, one row each.

    The kind is "circle", "oriented box", "polygon", or a number of boxes, as "4 boxes". Coordinates are px, from the
    centre of pixel [0, 0] of each mask. Corners and centres of circles are whole multiples of PLACE, so a flip, a
    quarter turn and a shift by whole pixels are exact.
    """
    return joined([_bounding_of(kind, sprite, variant) for sprite, variant in zip(sprites, variants, strict=True)])


class Bounds:
    """A cache of the volumes of one kind of the masks in use, which are made when first read; it is thread-safe."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._volumes: Volumes | None = None
        self._row: dict[int, int] = {}
        self._lock = threading.Lock()

    def rows(
        self, masks: Ints, sprites: Sequence[Sprite], variants: Sequence[Variant], ids: Ints, items: int
    ) -> tuple[Volumes, Ints]:
        """Volumes of masks, and the row of each item's volume.

        Parameters
        ----------
        masks : (n,) unique number of each item's mask
        sprites, variants : those of all items
        ids : (n,) the items
        items : number of masks that may be in use; many more are not kept
        """
        used = dict(zip(masks.tolist(), ids.tolist(), strict=True))
        with self._lock:
            if len(self._row) + len(used) > 2 * items + BOUNDS_SLACK:
                self._row, self._volumes = {}, None
            new = {mask: item for mask, item in used.items() if mask not in self._row}
            if new or self._volumes is None:
                more = bounding(self.kind, [sprites[i] for i in new.values()], [variants[i] for i in new.values()])
                self._volumes = more if self._volumes is None else joined([self._volumes, more])
                self._row |= zip(new, itertools.count(len(self._row)))
            return self._volumes, np.array([self._row[mask] for mask in masks.tolist()], np.int64)


def volumes_of(items: Items, name: str, rows: Ints) -> Volumes:
    """Bounding volumes of items in the world, one row each; see `Scene.volumes`."""
    k = boxes_in("kind", name)
    kind = choice("kind", "4 boxes" if k else name, ("box", "circle", "oriented box", "4 boxes", "polygon"))
    for item in items.id[rows[items.size_wh[rows, 0] == 0]].tolist():
        raise InputError(f"ids: expected objects with a pixel, got {item}, whose mask is empty")
    if name == "box":
        low, high = np.split(items.boxes(rows).astype(np.float64), 2, axis=1)
        return Aabbs(low - 0.5, high + 0.5)
    if not len(rows):
        return Circles(np.zeros((0, 2)), 0.0)
    volumes, of = items.bounding(f"{k} boxes" if k else kind, rows)
    return shifted(volumes.take(of), pixel(items.position_256[rows] - items.pivot_256[rows]))


def shifted(volumes: Volumes, xy: Ints) -> Volumes:
    """Move rows by whole pixels (n, 2); a volume that is rounded by this grows, so that it contains what it did.

    Whole multiples of PLACE are exact up to 2**36 px from the origin. Axis-aligned boxes do not grow: boxes of pixels
    are never rounded.
    """
    if isinstance(volumes, Parts):
        row = rows_of(volumes.starts, len(volumes.parts))[1]
        return volumes._same(shifted(volumes.parts, xy[row]), volumes.starts)._of(volumes.original)
    if isinstance(volumes, Hulls):  # a hull that would be rounded is grown first, by more than rounding can take back
        core = volumes.core()
        by = xy[rows_of(core.starts, len(core.points))[1]]
        off = np.maximum.reduceat(_rounding(core.points, by).max(axis=1), core.starts)
        if off.any():
            return type(volumes).around(_grown(core, 2 * off) + by, core.starts)._of(volumes.original)
    there = volumes.translated(xy)
    if isinstance(there, Circles):
        rounded = _rounding(volumes.core().points, xy).sum(axis=1)
        return _grown_circles(there, rounded)._of(volumes.original)
    return there


def _rounding(points: Floats, by: Ints) -> Floats:
    """Spacing of float64 at the sums of coordinates and whole numbers that are rounded; 0 for exact sums."""
    total = points + by
    exact = (total - by == points) & (total - points == by)
    return np.where(exact, 0.0, np.spacing(np.abs(total)))


def _grown_circles(circles: Circles, off: Floats) -> Circles:
    """Circles that contain all circles of the same radii whose centres are at most `off` away."""
    radius = circles.radius
    return Circles(circles.center, np.where(off > 0, np.nextafter(radius + off, np.inf), radius))


def fitted(kind: str, mask: Bools) -> Volumes:
    """Fit a volume to a mask with a pixel or more: one row, in px from the centre of its pixel [0, 0]."""
    if kind == "circle":
        return least_circle(mask)
    if kind == "oriented box":
        return oriented_box(mask)
    k = boxes_in("kind", kind)
    return convex(mask, CORNERS) if k is None else boxes(mask, k)


def moved(volume: Volumes, pivot_256: tuple[int, int], variant: Variant) -> Volumes:
    """Move a volume of a frame with its object, so that it contains the pixel squares of the variant's mask.

    The volume is one row that contains the pixel squares of the frame: a circle, or corners that are whole multiples of
    PLACE. It and the frame's pivot are relative to the centre of pixel [0, 0] of the frame; the result, a circle or
    polygons, is relative to that of the variant's mask.
    """
    transform = variant.transform
    parts = volume.parts if isinstance(volume, Parts) else volume
    if isinstance(parts, Circles):
        parts = _on_grid(parts)
    core = parts.core()
    offset = np.array(pivot_256) / SUB
    place = np.array([variant.pivot_x, variant.pivot_y]) / SUB
    most = max(transform.scale_x, transform.scale_y) / (1 << SCALE_BITS)
    reach = float(np.abs(core.points - offset).max() + core.radius.max()) * most
    grown = 0.0 if transform.plain else GROWN_PX + reach * TRIG_ERROR
    points = _turned(core.points - offset, transform) + place
    if isinstance(parts, Circles):
        return Circles(_placed(points), core.radius * most + grown)
    rings = Polygons.around(_placed(_grown(replace(core, points=points), grown)), core.starts)
    return Parts(rings, volume.starts) if isinstance(volume, Parts) else rings


def _turned(points: Floats, transform: Transform) -> Floats:
    """Vectors from the pivot, flipped, scaled and turned as the mask is."""
    scale, signs = np.array([[transform.scale_x], [transform.scale_y]]), np.array([transform.signs]).T
    x, y = (points / (1 << SCALE_BITS)).T * scale * signs
    c, s = transform.direction
    return np.stack([x * c - y * s, x * s + y * c], axis=1) / (1 << TRIG_BITS)


def _grown(core: Core, by: float | Floats) -> Floats:
    """Corners of convex rings whose edges all move outward, by one length or one per ring (N,).

    A ring with a very sharp corner becomes its box.
    """
    lengths = np.broadcast_to(by, len(core.counts))
    if not lengths.any():
        return core.points
    outward, needles = _outward(core)
    points: Floats = core.points + outward * lengths.repeat(core.counts)[:, None]
    sharp = needles & (lengths > 0)
    rings = zip(core.starts[sharp].tolist(), core.counts[sharp].tolist(), lengths[sharp].tolist(), strict=True)
    for first, count, length in rings:
        ring = core.points[first : first + count]
        (x, y), (x_max, y_max) = ring.min(axis=0) - length, ring.max(axis=0) + length
        box = np.array([(x, y), (x_max, y), (x_max, y_max), (x, y_max)])
        points[first : first + count] = box[np.minimum(np.arange(count), 3)]
    return points


def _outward(core: Core) -> tuple[Floats, Bools]:
    """Shift of each corner of convex rings if all edges move outward by 1 px, and whether a ring has a sharp corner."""
    before, after = neighbours(core.starts, len(core.points))
    step = core.points[after] - core.points
    turning = step[before, 0] * step[:, 1] - step[before, 1] * step[:, 0]
    sense = np.where(np.add.reduceat(turning, core.starts) < 0, -1, 1).repeat(core.counts)  # a flip reverses a ring
    normal = np.stack([step[:, 1], -step[:, 0]], axis=1) * (sense / np.sqrt((step**2).sum(axis=1)))[:, None]
    open_ = 1 + (normal[before] * normal).sum(axis=1)
    sharp = np.minimum.reduceat(open_, core.starts) < SHARP
    return (normal[before] + normal) / np.maximum(open_, SHARP)[:, None], np.asarray(sharp)


def _placed(points: Floats) -> Floats:
    return np.rint(points / PLACE) * PLACE


def _bytes(row: Volumes) -> int:
    core = row.parts.core() if isinstance(row, Parts) else row.core()
    return core.points.nbytes + BOUNDING_BYTES


_fitted: LruCache[tuple[Any, ...], Volumes] = LruCache(BOUNDING_CACHE_BYTES, _bytes)


def _bounding_of(kind: str, sprite: Sprite, variant: Variant) -> Volumes:
    """The volume fitted to a shape's mask, or the moved volume of the frame."""
    if sprite.outline is not None:
        return _fitted.get((kind, sprite.uid, variant.transform), lambda: _on_grid(fitted(kind, variant.mask)))
    number = variant.transform.frame
    frame = sprite.frames[number]
    volume = _fitted.get((kind, sprite.uid, number), lambda: _on_grid(fitted(kind, frame.mask)))
    return moved(volume, frame_pivot(sprite, frame), variant)


def _on_grid(volume: Volumes) -> Volumes:
    """Circles with centres, or polygons with corners, on whole multiples of PLACE; corners move only outward."""
    if isinstance(volume, Parts):
        return Parts(_on_grid(volume.parts), volume.starts)
    core = volume.core()
    placed = _placed(core.points)
    if isinstance(volume, Circles):
        return _grown_circles(Circles(placed, volume.radius), np.abs(placed - core.points).sum(axis=1))
    if (placed == core.points).all():
        return Polygons.around(core.points, core.starts)
    return Polygons.around(_placed(_grown(core, 2 * PLACE)), core.starts)
