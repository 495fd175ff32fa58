"""Every kind of weapon, and all that is asked of it, beside the peer that can answer it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, partial
from itertools import count, repeat
from typing import Any

import numpy as np
from speed_clock import Cell, Side, race
from speed_engines import EASIER, Space
from speed_peers import Masks, Placed, first, rendered
from speed_static import Settings, hit_rows, modes, touched
from speed_world import SEED, WORLD, Volleys, items_of, pattern_mask, placed_pellets, scene_of, shotgun

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
from hitplanes.planes.common.checks import Floats
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
        peers = Peers(scene, objects)
        for name, weapon in WEAPONS.items():
            for asked, how in questions(weapon).items():
                yield cell(settings, scene, peers, (name, asked), how)


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


def cell(settings: Settings, scene: Scene, peers: Peers, what: tuple[str, str], how: dict[str, Any]) -> Cell:
    """One weapon and one question, in each mode, and the peer."""
    weapon, rng, shots = how["weapon"], np.random.default_rng(peers.objects), max(settings.shots // PART, 1)
    options, fresh = {"accept": how["accept"]} if "accept" in how else {}, "fresh" in how
    turns = count()

    def works() -> Iterator[list[Volleys]]:
        """Places and aims of each round, and of one before for warming up."""
        again = rng.uniform(0, 360, AIMS)
        for _ in range(settings.rounds + 1):
            aim, at = (
                rng.uniform(0, 360, shots) if fresh else rng.choice(again, shots),
                rng.uniform(0, WORLD, (shots, 2)),
            )
            yield [peers.work(weapon, at, aim, fresh)]

    def answer(work: Volleys, units: int) -> Any:
        assert work.aim is not None
        aim = work.aim[:units] + 1e-3 * next(turns) if fresh else work.aim[:units]  # new for each side, too
        hits = touched(fire(scene, weapon, work.at[:units], aim=aim, seed=SEED, **options))
        if "verdicts" in how:
            hits.verdict_counts()
        return hits

    rows = None if fresh else hit_rows
    sides = [Side(mode, answer, rows, ready=ready, whole=True) for mode, ready in modes(settings).items()]
    sides += peers.sides(weapon, what[1])
    return race(Cell("weapons", ", ".join(what), peers.objects), sides, works(), shots, settings.seconds)


class Peers:
    """The peers of one scene: pygame-ce's masks for patterns, which are rendered before the clock; pymunk for rays."""

    def __init__(self, scene: Scene, objects: int) -> None:
        items = items_of(scene)
        self.objects, self.masks, self.space = objects, Masks(items), Space(items)

    def work(self, weapon: Weapon, at: Floats, aim: Floats, fresh: bool) -> Volleys:
        """Shots as both like them."""
        work = Volleys(at, aim, pellets=placed_pellets(weapon, at))
        if isinstance(weapon, AreaWeapon) and not fresh:
            placed = {angle: rendered(pattern_mask(weapon, angle)) for angle in set(aim.tolist())}
            work.lists["patterns"] = [placed[angle] for angle in aim.tolist()]
        elif not isinstance(weapon, AreaWeapon | Spread):
            length: Any = getattr(weapon, "range", None) or getattr(weapon, "speed", None)
            angle = np.radians(aim)
            ends = at + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            work.lists["ray ends"] = list(map(tuple, ends.tolist()))
        return work

    def sides(self, weapon: Weapon, asked: str) -> list[Side]:
        """Who can answer a question; none if nobody can."""
        radius = getattr(weapon, "width", 0) / 2 or getattr(weapon, "radius", 0)
        if isinstance(weapon, Spread):
            return [Side("A pygame", self._scattered, list)] if asked == "rows" else []
        if isinstance(weapon, Point) and asked == "rows":
            return [Side("A pygame", self._points, list)]
        if isinstance(weapon, AreaWeapon):
            answer = {"rows": self._areas, "pierce": partial(self._areas, pierce=True), "filter": self._filtered}.get(
                asked
            )
            return [Side("A pygame", answer, list)] if answer else []
        if asked not in ("rows", "new aims"):
            return []
        ray = self.space.rays if isinstance(weapon, Pistol) else partial(self.space.piercing_rays, radius=radius)
        return [Side("pymunk", ray, easier=EASIER)]

    def _points(self, work: Volleys, units: int) -> Any:
        return self.masks.points(*first(work, units))

    def _areas(self, work: Volleys, units: int, pierce: bool = False) -> Any:
        return self.masks.areas(*first(work, units), work.lists["patterns"], pierce)

    def _filtered(self, work: Volleys, units: int) -> Any:
        return self.masks.filtered(*first(work, units), work.lists["patterns"], 3, repeat(-1))

    def _scattered(self, work: Volleys, units: int) -> Any:
        return self.masks.scattered(*first(work, units), work.lists["pellets"], self._pellet)

    @cached_property
    def _pellet(self) -> Placed:
        return rendered(pattern_mask(Disc(2)))
