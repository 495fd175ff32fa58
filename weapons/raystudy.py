"""The question of rays: what one hits first, by points at a step, by all cells that it touches, and by the peers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Floats, Ints
from planes.compose import label_plane
from planes.constants import CHUNK_SAMPLES, SUB
from planes.scene import Scene
from weapons.byfire import fired_method
from weapons.decisions import Curve, Decisions, Method, Question
from weapons.guns import Pistol
from weapons.pixeltruth import first_pixels, touching
from weapons.rayhits import RayHits
from weapons.raypeers import Segments, peer_curves
from weapons.targets import ahead, checked_draw, drawn_places, only_hittable, size_of, targets_of

__all__ = ["rays_question"]

STEPS = tuple(2.0**k for k in range(4, -5, -1))
LENGTH_MAX = 1000
"""Longest rays, px: their points at a 16th of a px still come by the thousand."""

PLANE_MOST = 2**24
"""Largest plane that a user would make of a scene to look rays up in it, px."""


def rays_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask which object rays hit first.

    They are four median sizes of the objects long, whole px, at most 1000, and begin about an object, at most half of
    their length away: see `drawn_places`. None begins in an object.

    Parameters
    ----------
    scene : of which the hittable objects take part
    shots : how many rays
    seed : of the rays
    """
    shots, seed = checked_draw(shots, seed)
    alone = only_hittable(scene)
    targets = targets_of(alone)
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
            *peer_curves(targets, Segments(start / SUB, (start + step) / SUB)),
        ),
    )


def _supercover(alone: Scene, start: Ints, step: Ints) -> tuple[Curve, ...]:
    """`fire`, as it chooses by itself, and with each of its ways to leave objects out."""
    shot = {"at": start / SUB, "toward": (start + step) / SUB}

    def by(setting: str | None, **ways: str) -> Method:
        return fired_method(setting, alone, Pistol(None), _first, **shot, **ways)

    filters = tuple(by(name, prefilter=name, broadphase="none") for name in ("none", "box", "circle", "swept"))
    phases = tuple(by(name, broadphase=name) for name in ("grid", "quadtree", "bvh"))
    return (
        Curve("supercover", "", (by(None),)),
        Curve("supercover, pre-filter", "pre-filter", filters, "the same answers: only time differs"),
        Curve("supercover, broad phase", "broad phase", phases, "the same answers: only time differs"),
    )


def _first(hits: RayHits) -> Decisions:
    return Decisions.of(hits.passes.shot, hits.passes.object, hits.passes.entry_xy.astype(np.float64))


def _stepping(alone: Scene, start: Ints, step: Ints, length: int) -> Curve:
    """Points along the rays, looked up in one plane of the front-most objects."""
    box = alone.extent()
    width, height = box[2] - box[0] + 1, box[3] - box[1] + 1
    if width * height > PLANE_MOST:
        return Curve("fixed step", left_out=f"a plane of {width} x {height} px is more than {PLANE_MOST} px")
    own_start, own_step = start / SUB - np.array(box[:2]) + 1, step / SUB

    def prepare_by(spacing: float) -> Callable[[], Callable[[], tuple[Ints, Ints]]]:
        def prepare() -> Callable[[], tuple[Ints, Ints]]:
            labels = np.pad(label_plane(alone.items.stack(), box), 1)
            parts = np.arange(0, length + spacing, spacing)
            parts = parts[parts <= length] / length
            return lambda: _looked_up(labels, own_start, own_step, parts)

        return prepare

    def read(found: tuple[Ints, Ints]) -> Decisions:
        label, xy = found
        hit = np.flatnonzero(label)
        return Decisions.of(hit, label[hit] - 1, (xy[hit] + box[:2] - 1).astype(np.float64))

    methods = tuple(Method(spacing, prepare_by(spacing), read) for spacing in STEPS)
    return Curve("fixed step", "px", methods, "one plane of the front-most objects, read at points along the ray")


def _looked_up(labels: npt.NDArray[np.int32], start: Floats, step: Floats, parts: Floats) -> tuple[Ints, Ints]:
    """First label on each ray, 0 if there is none, and the pixel; a frame of zeros is around the labels."""
    label, xy = np.zeros(len(start), np.int64), np.zeros((len(start), 2), np.int64)
    most = np.array(labels.shape[::-1]) - 1
    rows = max(1, CHUNK_SAMPLES // len(parts))
    for begin in range(0, len(start), rows):
        some = slice(begin, begin + rows)
        points = start[some, None] + parts[:, None] * step[some, None]
        cells = np.clip(np.floor(points + 0.5).astype(np.int64), 0, most)
        found = labels[cells[..., 1], cells[..., 0]]
        on: Bools = found > 0
        first = (np.arange(len(on)), on.argmax(axis=1))
        label[some], xy[some] = found[first], cells[first]
    return label, xy
