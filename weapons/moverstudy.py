"""The question of fast movers: what a disc that flies far in a frame hits first, tested so often, or swept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planes.arrays import Ints
from planes.constants import REACH_MAX, SUB
from planes.scene import Scene
from weapons.arsenal import Disc
from weapons.byfire import fired_method
from weapons.decisions import Curve, Decisions, Method, Question
from weapons.firing import fire
from weapons.guns import Projectile
from weapons.pixeltruth import Flights, flown, impacts, touching
from weapons.rayhits import RayHits
from weapons.raypeers import Segments, mover_peer_curve
from weapons.targets import ahead, checked_draw, drawn_places, only_hittable, size_of, targets_of, velocities_of

__all__ = ["movers_question"]

SUBSTEPS = tuple(2**k for k in range(1, 7))

RADIUS_MAX = 32
"""Largest radius of a disc, px: it is placed up to 64 times a frame, with all its samples."""


def movers_question(scene: Scene, shots: int, seed: int) -> Question:
    """Ask what flying discs hit first, while objects move by their velocities.

    A disc flies eight median sizes of the objects in a frame; its radius is a sixth of one, 1 to 32; whole px.
    Each begins about an object, at most half of its flight away: see `drawn_places`. None begins on an object.

    Parameters
    ----------
    scene : of which the hittable objects take part
    shots : how many discs
    seed : of their flights
    """
    shots, seed = checked_draw(shots, seed)
    alone = only_hittable(scene)
    targets = targets_of(alone)
    size = size_of(targets)
    radius, speed = min(max(1, round(size / 6)), RADIUS_MAX), min(max(1, round(8 * size)), REACH_MAX)
    start, angle, _ = drawn_places(
        targets, shots, seed, SUB * speed // 2, lambda xy: touching(xy, SUB * radius, targets)
    )
    way = ahead(speed, angle)
    flights = Flights(start, flown(SUB * speed, way), SUB * radius)
    first = impacts(flights, targets, velocities_of(alone, targets))
    point = (flights.start_256[first.flight] + first.time[:, None] * flights.step_256[first.flight]) / SUB
    return Question(
        "movers",
        f"What does a disc of {radius} px that flies {speed} px in a frame hit first?",
        shots,
        Decisions.of(first.flight, first.object, point),
        "for every pixel of every object the moment at which the disc touches it, exactly; objects move",
        (*_curves(alone, flights, start + way, speed), _peer(alone, flights)),
    )


def _curves(alone: Scene, flights: Flights, toward: Ints, speed: int) -> tuple[Curve, ...]:
    once = _overlapping(alone, flights, None, 1)
    substeps = tuple(_overlapping(alone, flights, n, n) for n in SUBSTEPS)
    weapon = Projectile(speed, flights.radius_256 / SUB)
    swept = fired_method(None, alone, weapon, _impacts, at=flights.start_256 / SUB, toward=toward / SUB)
    return (
        Curve("one test a frame", "", (once,), "a disc at the end of the frame, as many games have it"),
        Curve("substeps", "tests a frame", substeps, "a disc at each of them"),
        Curve("swept", "", (swept,)),
    )


def _peer(alone: Scene, flights: Flights) -> Curve:
    targets = targets_of(alone)
    start, step = flights.start_256 / SUB, flights.step_256 / SUB
    moving = bool(velocities_of(alone, targets).any())
    return mover_peer_curve(targets, Segments(start, start + step), flights.radius_256 / SUB, moving)


def _overlapping(alone: Scene, flights: Flights, setting: int | None, steps: int) -> Method:
    """A disc is placed at each step, after the objects that move: it hits the nearest that it shares a pixel with."""
    start, step, disc = flights.start_256 / SUB, flights.step_256 / SUB, Disc(flights.radius_256 / SUB)

    def prepare() -> Callable[[], list[Decisions]]:
        own = only_hittable(alone)
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


def _impacts(hits: RayHits) -> Decisions:
    """First objects, and where the middle of the disc is then."""
    passes = hits.passes
    return Decisions.of(passes.shot, passes.object, np.asarray(passes.point_xy))
