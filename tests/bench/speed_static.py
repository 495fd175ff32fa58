"""Batches at a scene that stands still: every pattern, and what is special: filters, piercing, wide objects, edges."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import islice, repeat
from typing import Any

import numpy as np
from speed_clock import Cell, Side, race
from speed_engines import EASIER, Space, Tree
from speed_peers import Baked, Masks, Plane, first, rendered
from speed_world import MARGIN, PATTERNS, SEED, WORLD, Volleys, items_of, pattern_mask, runs, scene_of, volleys

from hitplanes import Disc, Hits, Laser, Scene, Weapon, fire, use_jit

__all__ = ["hit_rows", "modes", "ours", "static", "special"]

Settings = Any


def modes(settings: Settings) -> dict[str, Callable[[], None]]:
    """Our sides, and what is called before each: numpy alone, and with compiled twins."""
    found = {"numpy": lambda: use_jit(False)}
    if settings.jit:
        found["jit"] = lambda: use_jit(True)
    return found


def touched(hits: Hits) -> Hits:
    """Hits whose columns are there, if they are made when asked for."""
    for name in ("shot", "object", "samples", "first_xy", "distance2"):
        getattr(hits, name)
    return hits


def hit_rows(hits: Hits) -> Any:
    """Rows (shot, object, samples)."""
    return np.stack([hits.shot, hits.object, hits.samples], axis=1)


def ours(settings: Settings, scene: Scene, weapon: Weapon, **options: Any) -> list[Side]:
    """The public call, in each mode."""

    def answer(work: Volleys, units: int) -> Hits:
        aim = None if work.aim is None else work.aim[:units]
        more = options if work.exclude is None else {**options, "exclude": work.exclude[:units]}
        return touched(fire(scene, weapon, work.at[:units], aim=aim, seed=SEED, **more))

    return [Side(mode, answer, hit_rows, ready=ready, whole=True) for mode, ready in modes(settings).items()]


def unfiltered(settings: Settings, scene: Scene, weapon: Weapon) -> Side:
    """Ours again, that looks at every item: rays have no peer that gives the same rows."""
    side = ours(settings, scene, weapon, prefilter="none")[0]
    side.name, side.whole = "no pre-filter", False
    return side


@cache
def beams() -> tuple[list[Any], list[Any]]:
    """The beam at each whole degree, as arrays and as masks."""
    weapon: Any = PATTERNS["beam 300x6"]
    patterns = [pattern_mask(weapon, degrees) for degrees in range(360)]
    return patterns, [rendered(pattern) for pattern in patterns]


class Peers:
    """The peers of one scene that stands still."""

    def __init__(self, scene: Scene) -> None:
        items = items_of(scene)
        self.masks, self.plane = Masks(items), Plane(items)
        self.baked = Baked(items, self.plane)
        self.space, self.tree = Space(items), Tree(items)
        self.beams, self.placed_beams = beams()

    def sides(self, name: str) -> list[Side]:
        """Who answers a pattern of PATTERNS."""
        made: dict[str, Callable[[], list[Side]]] = {
            "point": self.points,
            "spread 8 x r=2": self.spreads,
            "beam 300x6": self.lines,
            "ray 1000": self.rays,
        }
        return made.get(name, partial(self.areas, PATTERNS[name]))()

    def points(self) -> list[Side]:
        dot = rendered(pattern_mask(PATTERNS["point"]))  # type: ignore[arg-type]
        cells = self.baked.cells(*dot[1:])
        return [
            Side("A pygame", lambda w, n: self.masks.points(*first(w, n)), list),
            Side("C pygame", lambda w, n: self.baked.alike(*first(w, n), dot.mask, cells), list),
            Side("numpy plane", lambda w, n: self.plane.points(w.lists["xy"][:n]), np.asarray),
            *self.shapes(0),
        ]

    def shapes(self, radius: float) -> list[Side]:
        return [
            Side("pymunk", lambda w, n: self.space.discs(w, n, radius), easier=EASIER),
            Side("shapely", lambda w, n: self.tree.discs(w, n, radius), easier=EASIER),
        ]

    def areas(self, weapon: Any) -> list[Side]:
        pattern = pattern_mask(weapon)
        placed = rendered(pattern)
        cells = self.baked.cells(*placed[1:])

        def plane(work: Volleys, units: int) -> Any:
            if pattern[0].sum() < 256:
                return self.plane.few(work.lists["xy"][:units], pattern)
            return self.plane.areas(*first(work, units), repeat(pattern))

        sides = [
            Side("A pygame", lambda w, n: self.masks.areas(*first(w, n), repeat(placed)), list),
            Side("C pygame", lambda w, n: self.baked.alike(*first(w, n), placed.mask, cells), list),
            Side("numpy plane", plane, np.asarray),
        ]
        return sides + (self.shapes(weapon.radius) if isinstance(weapon, Disc) else [])

    def spreads(self) -> list[Side]:
        pattern = pattern_mask(Disc(2))
        placed = rendered(pattern)
        cells = self.baked.cells(*placed[1:])
        y, x = np.nonzero(pattern[0])
        x, y = x + pattern[1], y + pattern[2]
        return [
            Side("A pygame", lambda w, n: self.masks.scattered(*first(w, n), w.lists["pellets"], placed), list),
            Side("C pygame", lambda w, n: self.baked.scattered(w.lists["pellets"][:n], placed, cells), list),
            Side("numpy plane", lambda w, n: self.plane.scattered(w.pellets[:n], x, y), np.asarray),
            Side("pymunk", self.space.scattered, easier=EASIER),
            Side("shapely", self.tree.scattered, easier=EASIER),
        ]

    def lines(self) -> list[Side]:
        def aimed(work: Volleys, patterns: Any) -> Iterator[Any]:
            return map(patterns.__getitem__, work.lists["aim"])

        return [
            Side("A pygame", lambda w, n: self.masks.areas(*first(w, n), aimed(w, self.placed_beams)), list),
            Side("C pygame", lambda w, n: self.baked.areas(*first(w, n), aimed(w, self.placed_beams)), list),
            Side("numpy plane", lambda w, n: self.plane.areas(*first(w, n), aimed(w, self.beams)), np.asarray),
            Side("pymunk", self.space.beams, easier=EASIER),
            Side("shapely", lambda w, n: self.tree.lines(w, n, 0.3, 3), easier=EASIER),
        ]

    def rays(self) -> list[Side]:
        every = EASIER + "; all that a ray crosses, in no order"
        return [
            Side("pymunk", self.space.rays, easier=EASIER),
            Side("shapely", lambda w, n: self.tree.lines(w, n, 1, 0), easier=every),
        ]


def static(settings: Settings) -> Iterator[Cell]:
    """Every pattern, every number of objects."""
    for objects in settings.objects:
        scene = scene_of(objects)
        peers = Peers(scene)
        for name, weapon in PATTERNS.items():
            sides = ours(settings, scene, weapon) + peers.sides(name)
            if name == "ray 1000" and objects <= 1000:
                sides.append(unfiltered(settings, scene, weapon))
            works = islice(runs(name, settings.shots, objects, settings.row), settings.rounds + 1)
            yield race(Cell("static", name, objects), sides, works, settings.shots, settings.seconds)
        yield aimed_at_objects(settings, scene, objects, peers)


def aimed_at_objects(settings: Settings, scene: Scene, objects: int, peers: Peers) -> Cell:
    """Discs r = 40 at the middles of objects: what a row costs, of few objects and of many."""
    ids = scene.ids("hittable")
    middles = scene.box(ids).reshape(-1, 2, 2).mean(axis=1)
    rng = np.random.default_rng(7)
    works = [
        [
            Volleys(np.floor(middles[rng.integers(len(ids), size=settings.shots)]), peers=not number)
            for number in range(settings.row)
        ]
        for _ in range(settings.rounds + 1)
    ]
    own = ours(settings, scene, Disc(40))
    cell = race(
        Cell("at objects", "disc r=40", objects), own + peers.areas(Disc(40))[:2], works, settings.shots,
        settings.seconds,
    )  # fmt: skip
    assert cell.rows is not None
    for side in own:
        cell.values[f"ns a row, {side.name}"] = cell.sides[side.name].least / max(cell.rows, 1e-9)
    return cell


def special(settings: Settings) -> Iterator[Cell]:
    """Filters, piercing, objects of 200 px, objects and shots off the bounds."""
    for objects in [m for m in settings.objects if m <= 1000]:
        yield from choosy(settings, objects)
        yield piercing_rays(settings, objects)
        yield from wide(settings, objects)


def choosy(settings: Settings, objects: int) -> Iterator[Cell]:
    """Discs r = 40 that pass over a third of the objects and one owner a shot; and those that pierce."""
    scene = scene_of(objects)
    masks = Masks(items_of(scene))
    disc = rendered(pattern_mask(Disc(40)))
    rng = np.random.default_rng(5)

    def with_owners() -> Iterator[Volleys]:
        for work in volleys("disc r=40", settings.shots, objects):
            work.exclude = rng.integers(0, objects, settings.shots)
            work.lists["passed"] = work.exclude.tolist()
            yield work

    def filtered(work: Volleys, units: int) -> Any:
        return masks.filtered(*first(work, units), repeat(disc), 3, work.lists["passed"])

    sides = [*ours(settings, scene, Disc(40), accept=3), Side("A pygame", filtered, list)]
    works = islice(([work] for work in with_owners()), settings.rounds + 1)
    yield race(Cell("special", "r=40, accept, exclude", objects), sides, works, settings.shots, settings.seconds)
    through = Side("A pygame", lambda w, n: masks.areas(*first(w, n), repeat(disc), True), list)
    works = islice(runs("disc r=40", settings.shots, objects, settings.row), settings.rounds + 1)
    sides = [*ours(settings, scene, Disc(40, pierce=True)), through]
    yield race(Cell("special", "r=40, pierce", objects), sides, works, settings.shots, settings.seconds)


def piercing_rays(settings: Settings, objects: int) -> Cell:
    """Rays that go through objects, up to an occluder; pymunk gives all shapes on a segment."""
    scene = scene_of(objects)
    space = Space(items_of(scene))
    sides = [*ours(settings, scene, Laser(1000)), Side("pymunk", space.piercing_rays, easier=EASIER)]
    sides.append(unfiltered(settings, scene, Laser(1000)))
    works = islice(runs("ray 1000", settings.shots, objects, settings.row), settings.rounds + 1)
    return race(Cell("special", "ray 1000, pierce", objects), sides, works, settings.shots, settings.seconds)


def wide(settings: Settings, objects: int) -> Iterator[Cell]:
    """Objects of 200 px, partly off the bounds, and shots around them too."""
    scene = scene_of(objects, side=200, beyond=100)
    peers = Peers(scene)
    area = (-200, -200, WORLD[0] + 200, WORLD[1] + 200)
    assert max(map(abs, area[:2])) + 100 < MARGIN
    for name in ("point", "spread 8 x r=2", "disc r=40"):
        works = islice(runs(name, settings.shots, objects, settings.row, area=area), settings.rounds + 1)
        sides = ours(settings, scene, PATTERNS[name]) + peers.sides(name)[:3]
        cell = Cell("special", f"{name}, 200 px, off bounds", objects)
        yield race(cell, sides, works, settings.shots, settings.seconds)
