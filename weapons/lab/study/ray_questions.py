"""The study's questions about rays, fast movers and shares, and the methods that are compared on each."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from hitplanes.planes.bits.label_plane import label_plane
from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.common.limits import CHUNK_SAMPLES, REACH_MAX, SUB
from hitplanes.planes.grid.fixed_point import pixel
from hitplanes.planes.scene.scene import Scene

from ...fire.call import fire
from ...kinds.areas import Disc, Point, Spread
from ...kinds.rays import Pistol, Projectile
from ...rays.ray_hits import RayHits
from ..peers import Segments, mover_curve, ray_curves
from .methods import (
    Curve,
    Decisions,
    Method,
    Question,
    ahead,
    copied,
    drawn_for,
    drawn_places,
    fired_method,
    size_of,
    velocities_of,
)
from .truth import Flights, first_pixels, flown, impacts, parts_of_discs, touching

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
    start, angle, _ = drawn_places(targets, shots, seed, SUB * length // 2, lambda xy: touching(xy, 0, targets))
    step = ahead(length, angle)
    shot, item, pixel_xy = first_pixels(start, step, targets)
    return Question(
        "rays",
        f"Which object does a ray of {length} px hit first?",
        shots,
        Decisions.of(shot, item, pixel_xy.astype(np.float64)),
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
        labels = np.pad(label_plane(alone.items.stack(), box), 1)
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
        targets, shots, seed, SUB * speed // 2, lambda xy: touching(xy, SUB * radius, targets)
    )
    way = ahead(speed, angle)
    flights = Flights(start, flown(SUB * speed, way), SUB * radius)
    velocities = velocities_of(alone, targets)
    first = impacts(flights, targets, velocities)
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


def _overlapping(alone: Scene, flights: Flights, setting: int | None, steps: int) -> Method:
    """Return a method that moves the objects and tests a disc at each step, which hits the nearest that it overlaps."""
    start, step, disc = flights.start_256 / SUB, flights.step_256 / SUB, Disc(flights.radius_256 / SUB)

    def prepare() -> Callable[[], list[Decisions]]:
        own = copied(alone, alone.ids())
        ids = own.ids()
        moving = ids[own.items.velocity_256[ids].any(axis=1)]
        place, velocity = (getattr(own.items, name)[moving] / SUB for name in ("position_256", "velocity_256"))

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
RADIUS_MAX = 64  # px of a blast; the truth tests each of its pixels for each shot and object


def spread_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask which part of a blast lies on each object, regardless of objects in front.

    The radius of the blasts is half the median size of the objects, in whole px, at most 64. Centres lie in the box of
    an object grown by the radius (see `drawn_places`).
    """
    shots, seed, alone, targets = drawn_for(scene, shots, seed)
    radius = min(max(1, round(size_of(targets) / 2)), RADIUS_MAX)
    place, _, _ = drawn_places(targets, shots, seed, SUB * radius, lambda xy: np.zeros(len(xy), np.bool_))
    at = pixel(place)
    parts = parts_of_discs(at, radius, targets)

    def pellets(n: int) -> Method:
        weapon = Spread(Point(pierce=True), n, radius)
        return fired_method(
            n, alone, weapon, lambda h: Decisions.of(h.shot, h.object, share=h.samples / n), at=at, seed=seed
        )

    note = "a share is a part of the pellets; it does not tell where it hit"
    every = fired_method(
        None, alone, Disc(radius, pierce=True),
        lambda h: Decisions(h.shot, h.object, h.first_xy.astype(np.float64), h.samples / parts.whole), at=at,
    )  # fmt: skip
    return Question(
        "spread",
        f"How much of a blast of {radius} px lies on each object?",
        shots,
        Decisions(parts.disc, parts.object, parts.nearest_xy.astype(np.float64), parts.pixels / parts.whole),
        "every pixel of the blast is looked up in the mask of every object, at full scale",
        (Curve("pellets", "pellets", tuple(map(pellets, PELLETS)), note), Curve("every pixel", "", (every,))),
        by_share=True,
    )
