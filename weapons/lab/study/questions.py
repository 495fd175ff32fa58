"""The questions of a study (discs, rays, fast movers, shares), their methods, and kinds of shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from hitplanes.planes.bits.label_plane import id_plane
from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, REACH_MAX, SCALE_BITS, SUB, TRIG_BITS
from hitplanes.planes.files.png import cv2
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite
from hitplanes.planes.scene.variants import variant_of
from hitplanes.planes.volumes import fit
from hitplanes.planes.volumes.fit import shifted
from hitplanes.planes.volumes.overlap import overlap
from hitplanes.planes.volumes.polygons import convex_parts, starts_of
from hitplanes.planes.volumes.volumes import Aabbs, Circles, ConcavePolygons, Parts, Polygons, Volumes, joined

from ...fire.call import fire
from ...fire.hits import Hits
from ...kinds.areas import Disc, Point, Spread, Stencil
from ...kinds.rays import Pistol, Projectile
from ...rays.ray_hits import RayHits
from ..peers import Segments, disc_curves, mover_curve, ray_curves
from . import truth
from .methods import (
    Curve,
    Decisions,
    Method,
    Question,
    ahead,
    copied,
    drawn_for,
    drawn_places,
    enlarged,
    fired_method,
    scaled,
    size_of,
    targets_of,
    velocities_of,
)

REACH = 8  # median size of the objects, in radii of the disc
RADIUS_MAX = 32  # px of a disc; at scale 4 it becomes 128 px, with 51,000 samples per shot
SPREAD_PART = 5  # by which blasts are fewer than other shots, as thousands of pellets take long


@dataclass(frozen=True, eq=False)
class Discs:
    """Shots with discs of one radius, px, around `at` (N, 2), and the objects that they are fired at, numbered from 0.

    `exact` (M,) says whether the exact shape of an object is known; places are whole numbers if none is. `aimed` (N,)
    is the object near which a shot is.
    """

    scene: Scene
    exact: Bools
    at: Floats
    aimed: Ints
    radius: float


def discs_at(alone: Scene, shots: int, seed: int) -> Discs:
    """Draw discs, each uniformly in the box of an object grown by twice the radius."""
    targets, count = targets_of(alone), len(alone)
    exact = np.array([_shape(alone, item) is not None for item in range(count)], np.bool_)
    radius = min(max(1, round(size_of(targets) / REACH)), RADIUS_MAX)
    place, _, near = drawn_places(targets, shots, seed, 2 * SUB * radius, lambda xy: np.zeros(len(xy), np.bool_))
    at = place / SUB if exact.any() else pixel(place).astype(np.float64)
    items = np.array([item for item, _, _ in targets] or [0])
    return Discs(alone, exact, at, items[near], float(radius))


def questions_of(alone: Scene, discs: Discs, shots: int, seed: int) -> list[Question]:
    """Return all questions of a study."""
    peers = disc_curves(targets_of(alone), discs.at, discs.radius)
    return [
        areas_question(discs, [*plane_curves(discs), *volume_curves(discs), *peers]),
        rays_question(alone, shots, seed),
        movers_question(alone, shots, seed),
        spread_question(alone, max(1, shots // SPREAD_PART), seed),
    ]


def areas_question(discs: Discs, curves: Sequence[Curve]) -> Question:
    """Return the question which objects discs touch, with its true answers."""
    exact, masks = int(discs.exact.sum()), int((~discs.exact).sum())
    texts = [f"exact shapes of {exact} objects"] * bool(exact) + [f"masks at full scale of {masks}"] * bool(masks)
    asks = f"Which objects does a disc of radius {discs.radius:g} px touch?"
    source = " and ".join(texts) or "nothing can be hit"
    return Question("areas", asks, len(discs.at), _truth(discs), source, tuple(curves), aimed=discs.aimed)


def _truth(discs: Discs) -> Decisions:
    """Return the exact shapes and the masks that discs touch, with places and shares."""
    exact = np.flatnonzero(discs.exact)
    shapes = [shape for item in exact.tolist() if (shape := _shape(discs.scene, item))]
    of = truth.discs_on_shapes(discs.at, discs.radius, shapes)
    masks = [target for target in targets_of(discs.scene) if not discs.exact[target[0]]]
    on = truth.parts_of_discs(np.floor(discs.at + 0.5).astype(np.int64), int(discs.radius), masks)
    return Decisions.joined([Decisions(of.shot, exact[of.object], of.xy, of.share), Decisions(*on)])


def _shape(scene: Scene, item: int) -> truth.Round | truth.Straight | None:
    """Return the exact shape of an object in the world, which is known of polygons and circles, but not of ellipses."""
    row = scene.items.table.row(item)
    transform, outline = scene.items.transforms[row], scene.items.sprites[row].outline
    if outline is None or (outline.radius is not None and transform.scale_x != transform.scale_y):
        return None
    position = scene.items.position_256[row] / SUB
    scale = transform.scale_x / (1 << SCALE_BITS), transform.scale_y / (1 << SCALE_BITS)
    if outline.radius is not None:
        return truth.Round(position, outline.radius / SUB * scale[0])
    rings = [ring / SUB for ring in outline.rings]
    return truth.Straight(truth.placed_rings(rings, transform.flip, scale, scene.items.angles[row], position))


SCALES = (1 / 8, 1 / 4, 1 / 2, 1, 2, 4)
PREFILTERS = ("none", "box", "circle", "oriented box", "4 boxes", "polygon")
BROADPHASES = ("none", "grid", "quadtree", "bvh")
Fired = list[tuple[Hits, Ints]]  # with the ids of the objects that were fired at


def plane_curves(discs: Discs) -> list[Curve]:
    """Return the curves of all methods that test pixels."""
    scales = tuple(Method(s, partial(_at_scale, discs, s), partial(_decided_by_planes, scale=s)) for s in SCALES)
    read = partial(_decided_by_planes, scale=1)
    before = tuple(Method(word, partial(_at_scale, discs, 1, prefilter=word), read) for word in PREFILTERS)
    broad = tuple(Method(word, partial(_at_scale, discs, 1, broadphase=word), read) for word in BROADPHASES)
    return [
        Curve("pixel planes", "scale", scales),
        Curve("pixels, pre-filter", "pre-filter", before, "at full scale"),
        Curve("pixels, broad phase", "broad phase", broad, "at full scale"),
    ]


def _at_scale(discs: Discs, scale: float, **how: Any) -> Callable[[], Fired]:
    """Return a run with shapes drawn at a scale; above full scale pixels of masks and of the disc become squares.

    `how` is the pre-filter or the broad phase, at up to full scale.
    """
    exact = discs.exact | (scale <= 1)
    drawn, squares = np.flatnonzero(exact), np.flatnonzero(~exact)
    runs: list[Callable[[], tuple[Hits, Ints]]] = []
    if len(drawn) or not len(squares):
        alone, disc = copied(discs.scene, drawn, scale), Disc(discs.radius * scale, pierce=True)
        at = scaled(discs.at, scale)
        runs.append(lambda: (fire(alone, disc, at, **how), drawn))
    if len(squares):
        k = int(scale)
        pixels = np.array(Disc(discs.radius).spans(1 << TRIG_BITS, 0).to_mask()[0])
        middle = k * len(pixels) // 2
        stencil = Stencil(np.kron(pixels, np.ones((k, k), np.bool_)), pivot_xy=(middle, middle), pierce=True)
        big, center = enlarged(discs.scene, squares, k), k * (np.floor(discs.at + 0.5) - len(pixels) // 2) + middle
        runs.append(lambda: (fire(big, stencil, center), squares))
    return lambda: [run() for run in runs]


def _decided_by_planes(fired: Fired, scale: float) -> Decisions:
    """Convert hits to decisions with the first pixel and the part of the disc's pixels that hit."""
    found = []
    for hits, ids in fired:
        xy, share = hits.first_xy.astype(np.float64), hits.samples / hits.verdicts.sum(axis=1)[hits.shot]
        found.append(Decisions(hits.shot, ids[hits.object], (xy + 0.5) / scale - 0.5, share))
    return Decisions.joined(found)


BOXES = (1, 2, 4, 8, 16, 32, 64)
CORNERS = (4, 5, 6, 8, 12, 16, 24)
TOLERANCES = (8.0, 4.0, 2.0, 1.0, 0.5)
POINTS_AT_ONCE = 1 << 16  # that are tested against volumes
FINEST = 12  # px, largest radius at which every pixel is tested for the share; larger discs use a coarser lattice
Make = Callable[[Scene], list[Volumes]]  # in the world, one row per object


def volume_curves(discs: Discs) -> list[Curve]:
    """Return the curves of all kinds of volumes."""

    def curve(name: str, setting: str, makes: Mapping[float | None, Make]) -> Curve:
        return Curve(name, setting, tuple(_method(discs, value, make) for value, make in makes.items()))

    return [
        curve("circle", "", {None: _fit(fit.least_circle)}),
        curve("circle about the pivot", "", {None: _pivot_circles}),
        curve("box, re-boxed", "", {None: _reboxed}),
        curve("box, refitted", "", {None: _fit(fit.box)}),
        curve("oriented box", "", {None: _fit(fit.oriented_box)}),
        curve("boxes", "for an object", {k: _fit(partial(fit.boxes, k=k)) for k in BOXES}),
        curve("convex polygon", "corners", {n: _fit(partial(fit.convex, n=n)) for n in CORNERS}),
        curve("hull", "", {None: _fit(fit.hull)}),
        curve("polygon", "px of tolerance", {t: _fit(partial(_concave, tolerance=t)) for t in TOLERANCES}),
        curve("triangles", "px of tolerance", {t: _fit(partial(_triangles, tolerance=t)) for t in TOLERANCES}),
    ]


def _fit(make: Callable[[Bools], Volumes]) -> Make:
    """Fit volumes to masks, once for equal masks, and move them so that they hold the pixel squares of each object."""

    def fitted(scene: Scene) -> list[Volumes]:
        made: dict[int, Volumes] = {}
        placed = []
        for item, row in zip(scene.items.ids.tolist(), scene.items.rows.tolist(), strict=True):
            variant = scene.items.variants[row]
            if variant.uid not in made:
                made[variant.uid] = make(variant.mask)
            placed.append(shifted(made[variant.uid], np.array([scene.mask(item)[1]])))
        return placed

    return fitted


def _concave(mask: Bools, tolerance: float) -> Volumes:
    return ConcavePolygons(fit.concave(mask, tolerance), [0])


def _triangles(mask: Bools, tolerance: float) -> Volumes:
    """Cut the outline into convex parts, and each into a fan of triangles."""
    points = fit.concave(mask, tolerance)
    parts = convex_parts([(x, y) for x, y in points.tolist()])
    fans = [[part[0], part[k], part[k + 1]] for part in parts for k in range(1, len(part) - 1)]
    return Parts(Polygons(points[np.array(fans).ravel()], starts_of([3] * len(fans))), [0])


def _pivot_circles(scene: Scene) -> list[Volumes]:
    """Fit circles around the pivots before rotation, which they do not need to follow."""
    return [fit.pivot_circle(mask, pivot.tolist()).translated(corner) for mask, pivot, corner in _unturned(scene)]


def _reboxed(scene: Scene) -> list[Volumes]:
    """Rotate boxes of the unrotated masks, and return the bounds of their corners."""
    return [
        fit.box(mask).rotated(angle, pivot).bounds().translated(corner)
        for angle, (mask, pivot, corner) in zip(scene.angle(scene.ids()), _unturned(scene), strict=True)
    ]


def _unturned(scene: Scene) -> Iterator[tuple[Bools, Floats, Floats]]:
    """Yield the masks of objects before rotation, their pivots in the masks, and the positions of the masks, px."""
    items = scene.items
    for row in items.rows.tolist():
        variant = variant_of(items.sprites[row], items.transforms[row]._replace(quarter=0, c=1 << TRIG_BITS, s=0))
        pivot = np.array([variant.pivot_x, variant.pivot_y]) / SUB
        yield variant.mask, pivot, items.position_256[row] / SUB - pivot


def _method(discs: Discs, setting: float | None, make: Make) -> Method:
    """Return a method with a volume for each object; a run tests the bounding boxes first, then the volumes."""

    def prepare() -> Callable[[], tuple[Volumes, Ints, Ints]]:
        alone = copied(discs.scene, np.arange(len(discs.scene)))
        made = make(alone)
        volumes = joined(made) if made else Circles(np.zeros((0, 2)), 0.0)
        box = volumes.bounds()
        return lambda: (volumes, *_touched(volumes, box, discs))

    return Method(setting, prepare, lambda found: _decided(discs, *found), lambda found: _stored(found[0]))


def _stored(volumes: Volumes) -> int:
    """Return the bytes of the arrays of volumes."""
    if isinstance(volumes, Parts):
        return _stored(volumes.parts) + volumes.starts.nbytes
    if isinstance(volumes, Aabbs):
        return volumes.min.nbytes + volumes.max.nbytes
    core = volumes.core()
    return core.points.nbytes + core.radius.nbytes * isinstance(volumes, Circles)


def _touched(volumes: Volumes, box: Aabbs, discs: Discs) -> tuple[Ints, Ints]:
    """Return the pairs (shots, objects) whose disc and volume touch, given the bounding boxes of the volumes."""
    near = np.ones((len(discs.at), len(volumes)), np.bool_)
    for axis in range(2):
        place = discs.at[:, axis, None]
        near &= (place + discs.radius >= box.min[:, axis]) & (place - discs.radius <= box.max[:, axis])
    shot, item = np.nonzero(near)
    touching = overlap(volumes.take(item), Circles(discs.at[shot], discs.radius))
    return shot[touching], item[touching]


def _decided(discs: Discs, volumes: Volumes, shot: Ints, item: Ints) -> Decisions:
    """Return decisions of a volume; shares and nearest places come from sampled pixel centres of the disc."""
    off = _looked_at(discs.radius)
    share, xy = np.zeros(len(shot)), np.full((len(shot), 2), np.nan)
    step = max(1, POINTS_AT_ONCE // len(off))
    for first in range(0, len(shot), step):
        part = slice(first, first + step)
        points = discs.at[shot[part], None] + off
        rows = np.repeat(item[part], len(off))
        met = overlap(volumes.take(rows), Circles(points.reshape(-1, 2), 0.0), conservative=True)
        on: Bools = met.reshape(-1, len(off))
        share[part] = on.mean(axis=1)
        nearest = points[np.arange(len(on)), on.argmax(axis=1)]
        xy[part] = np.where((share[part] > 0)[:, None], nearest, np.nan)
    return Decisions(shot, item, xy, share)


def _looked_at(radius: float) -> Floats:
    """Return pixel centres (n, 2) of a disc, nearest first; for a large disc only those of a coarser lattice."""
    xy = Disc(radius).spans(1 << TRIG_BITS, 0).pixels()
    x, y = xy[(xy % max(1, round(radius / FINEST)) == 0).all(axis=1)].T
    return np.stack([x, y], axis=1)[np.lexsort((x, y, x * x + y * y))].astype(np.float64)


ROUND, LONG, HOLE, CONCAVE, PARTS, TURNED, COMPACT = (
    "round", "long and thin", "with a hole", "concave", "several parts", "turned", "compact",
)  # fmt: skip
ROUND_LEAST = 0.85  # part of its enclosing circle that a round mask fills
LONG_LEAST = 3.0  # ratio of the sides of the oriented box of a long and thin mask
CONCAVE_MOST = 0.85  # part of its hull below which a mask is concave
TURNED_DEG = 15.0  # least angle to the axes of a turned object, degrees


def kind_of(scene: Scene, item: int) -> str:
    """Classify the shape of an object that has pixels; the first kind that applies is returned."""
    mask, _ = scene.mask(item)
    off, radius = abs((float(scene.angle(item)) + 45) % 90 - 45), float(fit.least_circle(mask).radius[0])
    short, long = sorted(np.hypot(*np.diff(fit.oriented_box(mask).points[:3], axis=0).T).tolist())
    x, y = fit.hull(mask).points.T
    hull_area = abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) / 2
    if _regions(mask, diagonal=True) > 1:
        return PARTS
    if _regions(~np.pad(mask, 1), diagonal=False) > 1:
        return HOLE
    if mask.sum() >= ROUND_LEAST * math.pi * radius**2:
        return ROUND
    if off >= TURNED_DEG:
        return TURNED
    if long >= LONG_LEAST * short:
        return LONG
    return CONCAVE if mask.sum() < CONCAVE_MOST * hull_area else COMPACT


def kinds_scene() -> Scene:
    """Return a scene with one exact shape of each kind, at positions between pixels."""
    scene = Scene(size_wh=(480, 320), name="shapes by kind")
    star = [(r * math.sin(a), -r * math.cos(a)) for r, a in ((30 - 18 * (k % 2), k * math.pi / 5) for k in range(10))]
    octagon = [(math.cos((k + 0.5) * math.pi / 4), math.sin((k + 0.5) * math.pi / 4)) for k in range(8)]
    ring = [[(30 * x, 30 * y) for x, y in octagon], [(19 * x, 19 * y) for x, y in octagon]]
    bars = [
        [(x - 6, y - 22), (x + 6, y - 22), (x + 6, y + 22), (x - 6, y + 22)] for x, y in ((-22, 4), (0, -4), (22, 4))
    ]
    for name, sprite, at, angle in (
        (ROUND, Sprite.circle(24), (80.3, 80.6), 0),
        (LONG, Sprite.box(92, 7), (240.7, 80.2), 0),
        (HOLE, Sprite.polygon(ring[0], holes=ring[1:]), (400.4, 80.9), 0),
        (CONCAVE, Sprite.polygon(star), (80.8, 230.3), 0),
        (PARTS, Sprite.polygon(bars[0], holes=bars[1:]), (240.1, 230.7), 0),
        (TURNED, Sprite.box(68, 22), (400.6, 230.4), 45),
    ):
        scene.add(sprite, at, angle=angle, name=name)
    return scene


def _regions(mask: Bools, diagonal: bool) -> int:
    """Number of connected regions of set pixels."""
    return int(cv2.connectedComponents(mask.astype(np.uint8), connectivity=8 if diagonal else 4)[0]) - 1


# Rays, fast movers and shares

STEPS = tuple(2.0**k for k in range(4, -5, -1))
LENGTH_MAX = 1000  # px of a ray; at a step of 1/16 px it has 16,000 points
PLANE_MOST = 2**24  # px of the plane in which rays are looked up


def rays_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask which object rays hit first.

    Rays are four median sizes of the objects long, in whole px, at most 1000. They begin near an object, at most half
    their length away (see `drawn_places`), but not in one.
    """
    shots, seed, alone, targets = drawn_for(scene, shots, seed)
    length = min(max(1, round(4 * size_of(targets))), LENGTH_MAX)
    start, angle, _ = drawn_places(targets, shots, seed, SUB * length // 2, lambda xy: truth.touching(xy, 0, targets))
    step = ahead(length, angle)
    first = truth.impacts(truth.Flights(start, step, 0), targets)
    return Question(
        "rays",
        f"Which object does a ray of {length} px hit first?",
        shots,
        Decisions.of(first.flight, first.object, first.pixel_xy.astype(np.float64)),
        "the pixel squares of the masks at full scale, as a step is judged by what is there in the planes; exactly",
        (
            _stepping(alone, start, step, length),
            *_supercover(alone, start, step),
            *ray_curves(targets, Segments(start / SUB, (start + step) / SUB)),
        ),
    )


def _supercover(alone: Scene, start: Ints, step: Ints) -> tuple[Curve, ...]:
    """Return curves of `fire`: by default, with each pre-filter, and with each broad phase."""
    shot = {"at": start / SUB, "toward": (start + step) / SUB}

    def entered(hits: RayHits) -> Decisions:
        return Decisions.of(hits.passes.shot, hits.passes.object, hits.passes.entry_xy.astype(np.float64))

    def by(setting: str | None, **ways: str) -> Method:
        return fired_method(setting, alone, Pistol(None), entered, **shot, **ways)

    filters = tuple(by(name, prefilter=name, broadphase="none") for name in ("none", "box", "circle", "swept"))
    phases = tuple(by(name, broadphase=name) for name in ("grid", "quadtree", "bvh"))
    return (
        Curve("supercover", "", (by(None),)),
        Curve("supercover, pre-filter", "pre-filter", filters, "the same answers: only time differs"),
        Curve("supercover, broad phase", "broad phase", phases, "the same answers: only time differs"),
    )


def _stepping(alone: Scene, start: Ints, step: Ints, length: int) -> Curve:
    """Return the curve that looks up points along the rays in a plane of the front-most objects."""
    box = alone.extent()
    width, height = box[2] - box[0] + 1, box[3] - box[1] + 1
    if width * height > PLANE_MOST:
        return Curve("fixed step", left_out=f"a plane of {width} x {height} px is more than {PLANE_MOST} px")
    own_start, own_step = start / SUB - np.array(box[:2]) + 1, step / SUB

    def prepare(spacing: float) -> Callable[[], tuple[Ints, Ints]]:
        labels = np.pad(id_plane(alone.items.stack(), box), 1)
        parts = np.arange(0, length + spacing, spacing)
        parts = parts[parts <= length] / length
        return lambda: _looked_up(labels, own_start, own_step, parts)

    def read(found: tuple[Ints, Ints]) -> Decisions:
        label, xy = found
        hit = np.flatnonzero(label)
        return Decisions.of(hit, label[hit] - 1, (xy[hit] + box[:2] - 1).astype(np.float64))

    methods = tuple(Method(spacing, partial(prepare, spacing), read) for spacing in STEPS)
    return Curve("fixed step", "px", methods, "one plane of the front-most objects, read at points along the ray")


def _looked_up(labels: npt.NDArray[np.int32], start: Floats, step: Floats, parts: Floats) -> tuple[Ints, Ints]:
    """Return the first label on each ray (0 if none) and its pixel; the labels have a border of zeros."""
    label, xy = np.zeros(len(start), np.int64), np.zeros((len(start), 2), np.int64)
    most = np.array(labels.shape[::-1]) - 1
    rows = max(1, CHUNK_SAMPLES // len(parts))
    for begin in range(0, len(start), rows):
        part = slice(begin, begin + rows)
        points = start[part, None] + parts[:, None] * step[part, None]
        cells = np.clip(np.floor(points + 0.5).astype(np.int64), 0, most)
        found = labels[cells[..., 1], cells[..., 0]]
        on: Bools = found > 0
        first = (np.arange(len(on)), on.argmax(axis=1))
        label[part], xy[part] = found[first], cells[first]
    return label, xy


SUBSTEPS = tuple(2**k for k in range(1, 7))
MOVER_RADIUS_MAX = 32  # px; a disc is tested up to 64 times a frame, with all its samples


def movers_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask which object flying discs hit first, while objects move by their velocities.

    A disc flies eight median sizes of the objects in a frame. Its radius is a sixth of a size, 1 to 32 px. Discs begin
    near an object, at most half their flight away (see `drawn_places`), but not on one. All lengths are whole px.
    """
    shots, seed, alone, targets = drawn_for(scene, shots, seed)
    size = size_of(targets)
    radius, speed = min(max(1, round(size / 6)), MOVER_RADIUS_MAX), min(max(1, round(8 * size)), REACH_MAX)
    start, angle, _ = drawn_places(
        targets, shots, seed, SUB * speed // 2, lambda xy: truth.touching(xy, SUB * radius, targets)
    )
    way = ahead(speed, angle)
    flights = truth.Flights(start, truth.flown(SUB * speed, way), SUB * radius)
    velocities = velocities_of(alone, targets)
    first = truth.impacts(flights, targets, velocities)
    point = (flights.start_256[first.flight] + first.time[:, None] * flights.step_256[first.flight]) / SUB
    once, *substeps = (_overlapping(alone, flights, None if n == 1 else n, n) for n in (1, *SUBSTEPS))
    swept = fired_method(
        None, alone, Projectile(speed, radius),
        lambda hits: Decisions.of(hits.passes.shot, hits.passes.object, np.asarray(hits.passes.point_xy)),
        at=start / SUB, toward=(start + way) / SUB,
    )  # fmt: skip
    ends = Segments(start / SUB, (start + flights.step_256) / SUB)
    return Question(
        "movers",
        f"What does a disc of {radius} px that flies {speed} px in a frame hit first?",
        shots,
        Decisions.of(first.flight, first.object, point),
        "for every pixel of every object the moment at which the disc touches it, exactly; objects move",
        (
            Curve("one test a frame", "", (once,), "a disc at the end of the frame, as many games have it"),
            Curve("substeps", "tests a frame", tuple(substeps), "a disc at each of them"),
            Curve("swept", "", (swept,)),
            mover_curve(targets, ends, float(radius), bool(velocities.any())),
        ),
    )


def _overlapping(alone: Scene, flights: truth.Flights, setting: int | None, steps: int) -> Method:
    """Return a method that moves the objects and tests a disc at each step, which hits the nearest that it overlaps."""
    start, step, disc = flights.start_256 / SUB, flights.step_256 / SUB, Disc(flights.radius_256 / SUB)

    def prepare() -> Callable[[], list[Decisions]]:
        own = copied(alone, alone.ids())
        ids = own.ids()
        moving = ids[own.velocity(ids).any(axis=1)]
        place, velocity = own.position(moving), own.velocity(moving)

        def run() -> list[Decisions]:
            live, found = np.arange(len(start)), []
            for part in np.arange(1, steps + 1) / steps:
                own.move(moving, place + part * velocity)
                at = start[live] + part * step[live]
                hits = fire(own, disc, at)
                shot, row = np.unique(hits.shot, return_index=True)
                found.append(Decisions.of(live[shot], hits.object[row], at[shot]))
                live = np.delete(live, shot)
            return found

        return run

    return Method(setting, prepare, Decisions.joined)


PELLETS = tuple(2**k for k in range(2, 13))
BLAST_RADIUS_MAX = 64  # px of a blast; the truth tests each of its pixels for each shot and object


def spread_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask which part of a blast lies on each object, regardless of objects in front.

    The radius of the blasts is half the median size of the objects, in whole px, at most 64. Centres lie in the box of
    an object grown by the radius (see `drawn_places`).
    """
    shots, seed, alone, targets = drawn_for(scene, shots, seed)
    radius = min(max(1, round(size_of(targets) / 2)), BLAST_RADIUS_MAX)
    place, _, _ = drawn_places(targets, shots, seed, SUB * radius, lambda xy: np.zeros(len(xy), np.bool_))
    at = pixel(place)

    def pellets(n: int) -> Method:
        weapon = Spread(Point(pierce=True), n, radius)
        return fired_method(
            n, alone, weapon, lambda h: Decisions.of(h.shot, h.object, share=h.samples / n), at=at, seed=seed
        )

    note = "a share is a part of the pellets; it does not tell where it hit"
    every = fired_method(
        None, alone, Disc(radius, pierce=True), lambda hits: _decided_by_planes([(hits, alone.ids())], 1), at=at
    )
    return Question(
        "spread",
        f"How much of a blast of {radius} px lies on each object?",
        shots,
        Decisions(*truth.parts_of_discs(at, radius, targets)),
        "every pixel of the blast is looked up in the mask of every object, at full scale",
        (Curve("pellets", "pellets", tuple(map(pellets, PELLETS)), note), Curve("every pixel", "", (every,))),
        by_share=True,
    )
