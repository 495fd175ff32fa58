"""What a study shoots at, and from where: the hittable objects of a scene alone, and seeded places about them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planes.arrays import Bools, Floats, InputError, Ints, integer
from planes.constants import HALF, SEED_MAX, SUB
from planes.grid256 import turned, unit
from planes.items import ROLES, Role
from planes.scene import Scene
from weapons.draws import GOLDEN, Words, mix64

__all__ = ["Target", "ahead", "checked_draw", "drawn_places", "only_hittable", "size_of", "targets_of", "velocities_of"]

Target = tuple[int, Bools, tuple[int, int]]
"""An object's id, its mask (h, w), and the pixel (x, y) of the world at [0, 0]."""

SHOTS_MAX = 10**6
"""Shots of a study: each method keeps all that it decides of them."""

KEPT = ("layer", "cost", "position_256", "velocity_256")
"""Columns of objects that are theirs in any world."""


def only_hittable(scene: Scene) -> Scene:
    """Hittable objects of a scene in a world of their own: no bounds, no occluders, nothing that a filter refuses.

    They keep their ids, names, layers, poses, masks and velocities; each is its own owner, in the first category.
    """
    alone, items = Scene(name=scene.name), scene.items
    for item in scene.ids(Role.HITTABLE).tolist():
        alone.items.skip_to(item)
        values: dict[str, object] = {name: getattr(items, name)[item] for name in KEPT}
        values |= {"role": ROLES.index(Role.HITTABLE), "categories": 1, "owner": item}
        alone.items.add(items.sprites[item], items.forms[item], items.angles[item], items.names[item], values)
    return alone


def targets_of(scene: Scene) -> list[Target]:
    """Hittable objects that have a pixel, front to back: greater layer first, then the later added."""
    ids = scene.ids(Role.HITTABLE)
    order = np.lexsort((-ids, -scene.items.layer[ids]))
    targets = [(item, *scene.mask(item)) for item in ids[order].tolist()]
    return [target for target in targets if target[1].any()]


def velocities_of(scene: Scene, targets: list[Target]) -> Ints:
    """How far targets move in a frame, (M, 2) in 1/256 px."""
    return np.asarray(scene.items.velocity_256[[item for item, _, _ in targets]]).reshape(-1, 2)


def size_of(targets: list[Target]) -> float:
    """Median over targets of the mean of width and height, px; 1 if there are none."""
    return float(np.median([sum(mask.shape) / 2 for _, mask, _ in targets])) if targets else 1.0


def checked_draw(shots: object, seed: object) -> tuple[int, int]:
    """Check how many shots are drawn, and from which seed."""
    return integer("shots", shots, 1, SHOTS_MAX), integer("seed", seed, 0, SEED_MAX)


def drawn_places(
    targets: list[Target], shots: int, seed: int, grow_256: int, taken: Callable[[Ints], Bools]
) -> tuple[Ints, Floats, Ints]:
    """Draw places and directions: an object, then a place in its box grown on all sides; about (0, 0) without objects.

    The draws are those of splitmix64 from the seed, four for each try: object, x, y, angle. A place that is taken is
    left out, and the next one comes in its stead.

    Parameters
    ----------
    grow_256 : 1/256 px
    taken : tells of places (n, 2) which are not wanted

    Returns
    -------
    (shots, 2) places in 1/256 px, (shots,) angles in degrees, and (shots,) the target near which a place is

    Raises
    ------
    InputError
        If of very many tries nearly all are taken.
    """
    boxes = np.array([[x, y, x + m.shape[1] - 1, y + m.shape[0] - 1] for _, m, (x, y) in targets] or [[0, 0, 0, 0]])
    low, high = SUB * boxes[:, :2] - HALF - grow_256, SUB * boxes[:, 2:] + HALF + grow_256
    places, angles, near = [np.zeros((0, 2), np.int64)], [np.zeros(0)], [np.zeros(0, np.int64)]
    begin = free = 0
    while free < shots:
        if begin > TRIES * shots:
            raise InputError(f"scene: expected room between its objects, got {free} free places of {begin} drawn")
        words = _words(seed, begin, shots).astype(object)
        which = (words[:, 0] % len(boxes)).astype(np.int64)
        xy = low[which] + (words[:, 1:3] % (high - low + 1)[which]).astype(np.int64)
        good = np.flatnonzero(~taken(xy))
        places.append(xy[good])
        angles.append(words[good, 3].astype(np.float64) * (360 / 2.0**64))
        near.append(which[good])
        begin, free = begin + shots, free + len(good)
    return np.concatenate(places)[:shots], np.concatenate(angles)[:shots], np.concatenate(near)[:shots]


TRIES = 1000
"""Tries for each shot, before a scene is said to have no room."""


def _words(seed: int, begin: int, count: int) -> Words:
    """Words (count, 4) of the stream of a seed, from try `begin` on."""
    number = np.arange(4 * begin, 4 * (begin + count), dtype=np.uint64) + np.uint64(1)
    return mix64(mix64(np.array([seed], np.uint64)) + number * GOLDEN).reshape(count, 4)


def ahead(length: float, degrees: Floats) -> Ints:
    """Steps (N, 2) of a length in px along angles, rounded to 1/256 px once."""
    along = np.stack([np.full(len(degrees), round(SUB * length)), np.zeros(len(degrees), np.int64)], axis=1)
    return turned(along, *unit(degrees))
