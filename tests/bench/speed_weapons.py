"""Every kind of weapon, and all that is asked of it: cells that no peer answers, beside each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
from speed_clock import Cell, Side, race
from speed_static import Settings, hit_rows, modes, touched
from speed_world import SEED, WORLD, scene_of, shotgun

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    Laser,
    Pistol,
    Point,
    Polygon,
    Projectile,
    Rifle,
    Ring,
    Scene,
    Spread,
    Weapon,
    fire,
)  # fmt: skip
from hitplanes.weapons.kinds.areas import AreaWeapon

WEAPONS: dict[str, Weapon] = {
    "point": Point(),
    "disc r=40": Disc(40),
    "ring 30 to 40": Ring(30, 40),
    "box 60x20": Box(60, 20),
    "polygon": Polygon([(0, 0), (50, 10), (30, 40)]),
    "cone 94, 34 deg": Cone(94, 34),
    "beam 200x9": Beam(200, 9),
    "stencil": shotgun(),
    "spread 8 x r=2": Spread(Disc(2), count=8, radius=24),
    "pistol 500": Pistol(500),
    "rifle 500": Rifle(500, max_hits=3),
    "laser 500": Laser(500),
    "laser 500x5": Laser(500, width=5),
    "projectile 300": Projectile(300, radius=4),
}

AIMS = 24
"""Aims that come again and again, of the cells in which aims are not new."""

PART = 20
"""These cells fire one shot where others fire so many: some take a thousand times as long."""


def weapons(settings: Settings) -> Iterator[Cell]:
    """Each weapon and each question, among each number of objects up to 1000."""
    for objects in [m for m in settings.objects if m <= 1000]:
        scene = scene_of(objects)
        for name, weapon in WEAPONS.items():
            for asked, how in questions(weapon).items():
                yield cell(settings, scene, objects, (name, asked), how)


def questions(weapon: Weapon) -> dict[str, dict[str, Any]]:
    """What is asked of a weapon, and how."""
    found: dict[str, dict[str, Any]] = {
        "rows": {"weapon": weapon}, "verdicts": {"weapon": weapon, "verdicts": True},
        "filter": {"weapon": weapon, "accept": 3},
    }  # fmt: skip
    if isinstance(weapon, AreaWeapon):
        found |= {"falloff": {"weapon": replace(weapon, falloff="linear")}}
        found |= {"pierce": {"weapon": replace(weapon, pierce=True)}}
        sights = {"in sight of occluders": "occluders", "in sight of all": "all"}
        found |= {told: {"weapon": replace(weapon, line_of_sight=sight)} for told, sight in sights.items()}
    if getattr(weapon, "directed", not isinstance(weapon, AreaWeapon | Spread)):
        found |= {"new aims": {"weapon": weapon, "fresh": True}}
    return found


def cell(settings: Settings, scene: Scene, objects: int, what: tuple[str, str], how: dict[str, Any]) -> Cell:
    """One weapon and one question, in each mode."""
    weapon, rng, shots = how["weapon"], np.random.default_rng(objects), max(settings.shots // PART, 1)
    options, fresh = {"accept": how["accept"]} if "accept" in how else {}, "fresh" in how

    turns = count()

    def works() -> Iterator[list[tuple[Any, Any]]]:
        """Places and aims of each round, and of one before for warming up."""
        again = rng.uniform(0, 360, AIMS)
        for _ in range(settings.rounds + 1):
            aim = rng.uniform(0, 360, shots) if fresh else rng.choice(again, shots)
            yield [(rng.uniform(0, WORLD, (shots, 2)), aim)]

    def answer(work: tuple[Any, Any], units: int) -> Any:
        aim = work[1][:units] + 1e-3 * next(turns) if fresh else work[1][:units]  # new for each side, too
        hits = touched(fire(scene, weapon, work[0][:units], aim=aim, seed=SEED, **options))
        if "verdicts" in how:
            hits.verdict_counts()
        return hits

    rows = None if fresh else hit_rows
    sides = [Side(mode, answer, rows, ready=ready, whole=True) for mode, ready in modes(settings).items()]
    return race(Cell("weapons", ", ".join(what), objects), sides, works(), shots, settings.seconds)
