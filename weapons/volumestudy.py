"""Discs against volumes: each kind, fitted to the masks of the objects as they stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from planes import fit
from planes.arrays import Bools, Floats, Ints
from planes.constants import SUB, TRIG_BITS
from planes.overlap import overlap
from planes.parts import ConcavePolygons, Parts, joined
from planes.rings import convex_parts, starts_of
from planes.scene import Scene
from planes.sprite import variant_of
from planes.volumes import Aabbs, Circles, Polygons, Volumes
from weapons.arsenal import Disc
from weapons.copies import copied
from weapons.decisions import Curve, Decisions, Method
from weapons.discs import Discs

__all__ = ["volume_curves"]

BOXES = (1, 2, 4, 8, 16, 32, 64)
CORNERS = (4, 5, 6, 8, 12, 16, 24)
TOLERANCES = (8.0, 4.0, 2.0, 1.0, 0.5)

POINTS_AT_ONCE = 1 << 16
"""Points that are compared with volumes at once."""

FINEST = 12
"""Pixels from the middle of a disc to its rim that are looked at for its share: of a larger one every second or so."""

Make = Callable[[Scene], list[Volumes]]
"""The volume of each object of a scene, in the world: one row each."""


def volume_curves(discs: Discs) -> list[Curve]:
    """The curves of all kinds of volumes."""

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
    """Volumes of objects from those of their masks; equal masks have one."""

    def fitted(scene: Scene) -> list[Volumes]:
        made: dict[int, Volumes] = {}
        placed = []
        for item, variant in enumerate(scene.items.variants):
            if variant.uid not in made:
                made[variant.uid] = make(variant.mask)
            placed.append(made[variant.uid].translated(scene.mask(item)[1]))
        return placed

    return fitted


def _concave(mask: Bools, tolerance: float) -> Volumes:
    return ConcavePolygons(fit.concave(mask, tolerance), [0])


def _triangles(mask: Bools, tolerance: float) -> Volumes:
    """The outline cut into triangles: fans of its convex parts."""
    points = fit.concave(mask, tolerance)
    parts = convex_parts([(x, y) for x, y in points.tolist()])
    fans = [[part[0], part[k], part[k + 1]] for part in parts for k in range(1, len(part) - 1)]
    return Parts(Polygons(points[np.array(fans).ravel()], starts_of([3] * len(fans))), [0])


def _pivot_circles(scene: Scene) -> list[Volumes]:
    """Circles about the pivots, which no turn changes: fitted before the turn."""
    unturned = [_unturned(scene, item) for item in range(len(scene))]
    return [fit.pivot_circle(mask, pivot.tolist()).translated(corner) for mask, pivot, corner in unturned]


def _reboxed(scene: Scene) -> list[Volumes]:
    """Boxes before the turn, their corners turned, and boxed again."""
    boxes: list[Volumes] = []
    for item in range(len(scene)):
        mask, pivot_xy, corner_xy = _unturned(scene, item)
        boxes.append(fit.box(mask).rotated(scene.items.angles[item], pivot_xy).bounds().translated(corner_xy))
    return boxes


def _unturned(scene: Scene, item: int) -> tuple[Bools, Floats, Floats]:
    """Mask of an object before its turn, its pivot in the mask, and where the mask goes then, px."""
    items = scene.items
    variant = variant_of(items.sprites[item], items.forms[item]._replace(quarter=0, c=1 << TRIG_BITS, s=0))
    pivot = np.array([variant.pivot_x, variant.pivot_y]) / SUB
    return variant.mask, pivot, items.position_256[item] / SUB - pivot


def _method(discs: Discs, setting: float | None, make: Make) -> Method:
    """A volume for each object; a run compares boxes around all, then volumes."""

    def prepare() -> Callable[[], tuple[Volumes, Ints, Ints]]:
        alone = copied(discs.scene, np.arange(len(discs.scene)))
        made = make(alone)
        volumes = joined(made) if made else Circles(np.zeros((0, 2)), 0.0)
        box = volumes.bounds()
        return lambda: (volumes, *_touched(volumes, box.min, box.max, discs))

    return Method(setting, prepare, lambda found: _decided(discs, *found), lambda found: _stored(found[0]))


def _stored(volumes: Volumes) -> int:
    """Bytes of the numbers of volumes."""
    if isinstance(volumes, Parts):
        return _stored(volumes.parts) + volumes.starts.nbytes
    if isinstance(volumes, Aabbs):
        return volumes.min.nbytes + volumes.max.nbytes
    core = volumes.core()
    return core.points.nbytes + core.radius.nbytes * isinstance(volumes, Circles)


def _touched(volumes: Volumes, low: Floats, high: Floats, discs: Discs) -> tuple[Ints, Ints]:
    """Shots and objects, of which disc and volume touch; `low` and `high` are corners of the boxes around volumes."""
    near = np.ones((len(discs.at), len(low)), np.bool_)
    for axis in range(2):
        place = discs.at[:, axis, None]
        near &= (place + discs.radius >= low[:, axis]) & (place - discs.radius <= high[:, axis])
    shot, item = np.nonzero(near)
    meet = overlap(volumes.take(item), Circles(discs.at[shot], discs.radius))
    return shot[meet], item[meet]


def _decided(discs: Discs, volumes: Volumes, shot: Ints, item: Ints) -> Decisions:
    """Decisions of a volume; its share and its nearest place are those of the centres of the disc's pixels, or some."""
    off = _looked_at(discs.radius)
    share, xy = np.zeros(len(shot)), np.full((len(shot), 2), np.nan)
    step = max(1, POINTS_AT_ONCE // len(off))
    for first in range(0, len(shot), step):
        some = slice(first, first + step)
        points = discs.at[shot[some], None] + off
        rows = np.repeat(item[some], len(off))
        met = overlap(volumes.take(rows), Circles(points.reshape(-1, 2), 0.0), conservative=True)
        on: Bools = met.reshape(-1, len(off))
        share[some] = on.mean(axis=1)
        nearest = points[np.arange(len(on)), on.argmax(axis=1)]
        xy[some] = np.where((share[some] > 0)[:, None], nearest, np.nan)
    return Decisions(shot, item, xy, share)


def _looked_at(radius: float) -> Floats:
    """Centres (n, 2) of a disc's pixels, the nearest first: of a large disc those of a lattice, as others cost much."""
    xy = Disc(radius).spans(1 << TRIG_BITS, 0).pixels()
    x, y = xy[(xy % max(1, round(radius / FINEST)) == 0).all(axis=1)].T
    return np.stack([x, y], axis=1)[np.lexsort((x, y, x * x + y * y))].astype(np.float64)
