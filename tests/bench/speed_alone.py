"""One shot a call of every kind of weapon: at aims that come again, at new ones, and after all objects moved."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from speed_clock import Cell
from speed_single import Call, timed_calls
from speed_static import Settings, modes
from speed_weapons import AIMS, WEAPONS, questions
from speed_world import WORLD, scene_of

from hitplanes import Disc, Pistol, Scene, Spread, Weapon, fire

OTHERS: dict[str, Weapon] = {
    "disc r=40, linear falloff": Disc(40, falloff="linear"), "spread 8 pistols": Spread(Pistol(500), 8, 40),
}  # fmt: skip

MOVED = 3
"""Objects lie at so many places in turn, a pixel apart."""


def alone(settings: Settings) -> Iterator[Cell]:
    """Each weapon, each number of objects."""
    for objects in settings.single:
        scenes = {mode: scene_of(objects) for mode in modes(settings)}  # what is kept for a scene is of one mode
        for name, weapon in (WEAPONS | OTHERS).items():
            asked = ("aims again", "new aims", "all move") if "new aims" in questions(weapon) else ("again", "all move")
            for what in asked:
                kind = moved if what == "all move" else still
                calls = {
                    f"fire, {mode}": (kind(scenes[mode], weapon), ready) for mode, ready in modes(settings).items()
                }
                cell = Cell("alone", f"{name}, {what}", objects, unit="ns a call", asked=settings.calls)
                yield timed_calls(cell, calls, list(works(settings, what == "new aims")), {})


def works(settings: Settings, fresh: bool) -> Iterator[list[tuple[Any, float]]]:
    """Places and aims of each round, and of one before for warming up."""
    rng = np.random.default_rng(settings.calls)
    again = rng.uniform(0, 360, AIMS)
    for _ in range(settings.rounds + 1):
        at, shots = rng.uniform(0, WORLD, (settings.calls, 2)), settings.calls
        aims = rng.uniform(0, 360, shots) if fresh else rng.choice(again, shots)
        yield list(zip(map(tuple, at.tolist()), aims.tolist(), strict=True))


def still(scene: Scene, weapon: Weapon) -> Call:
    """`fire` with one shot, all rows read."""

    def call(at: Any, aim: float) -> Any:
        hits = fire(scene, weapon, at, aim=aim)
        return hits.object.tolist(), hits.samples.tolist()

    return call


def moved(scene: Scene, weapon: Weapon) -> Call:
    """The same, after all objects moved: a frame of one shot."""
    ids, fired = scene.ids("hittable"), still(scene, weapon)
    places = [scene.position(ids) + k for k in range(MOVED)]

    def call(at: Any, aim: float) -> Any:
        scene.move(ids, places[int(at[0]) % MOVED])
        return fired(at, aim)

    return call
