"""Small worlds at which rays are fired, as recipes: built for the library, and told to the oracle without it."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
import oracle_raster
import oracle_rays
from oracle_rays import Item, Pass, StartsInside, Walk

from hitplanes import ALL, Hits, Laser, Pistol, Rifle, Rounds, Scene, Spread, Sprite, Sweep, Weapon, fire
from hitplanes.weapons.kinds.draws import disc_offsets

Pixel = tuple[int, int]
Place = tuple[float, float]
Ray = tuple[int, int, Pixel, Pixel]
"""Round, pellet, and both ends in 1/256 px."""

ONE = 2**30
FULL = 65535

unit_of = lru_cache(maxsize=None)(oracle_raster.unit)


def snapped(v: float) -> int:
    """To 1/256 px, half to even."""
    return round(float(v) * 256)


def pair(place: Place) -> Pixel:
    return snapped(place[0]), snapped(place[1])


# Recipes


@dataclass(frozen=True)
class Body:
    """An object or an occluder of whole pixels."""

    pixels: frozenset[Pixel]
    occluder: bool = False
    layer: int = 0
    categories: int = 1
    owner: int | None = None
    cost: int = 1

    def moved(self, dx: int, dy: int) -> Body:
        return replace(self, pixels=frozenset((x + dx, y + dy) for x, y in self.pixels))


@dataclass(frozen=True)
class Gun:
    """A traced weapon, and what may be around it."""

    kind: str = "laser"
    range: float | None = None
    width: float = 0
    inside: str = "hit"
    falloff: str | None = None
    max_hits: int | None = None
    budget: float | None = None
    sweep: tuple[float, int] | None = None
    spread: tuple[int, float] | None = None
    rounds: tuple[int, Place, float] | None = None

    def weapon(self) -> Weapon:
        """The library's."""
        common: dict[str, Any] = {"width": self.width, "inside": self.inside, "falloff": self.falloff}
        made: Weapon
        if self.kind == "rifle":
            made = Rifle(self.range, max_hits=self.max_hits, budget=self.budget, **common)
        else:
            made = {"pistol": Pistol, "laser": Laser}[self.kind](self.range, **common)
        made = Sweep(made, *self.sweep) if self.sweep else made
        made = Spread(made, *self.spread) if self.spread else made
        return Rounds(made, *self.rounds) if self.rounds else made

    @property
    def hits_at_most(self) -> int | None:
        return {"pistol": 1, "rifle": self.max_hits, "laser": None}[self.kind]

    @property
    def budget_256(self) -> int | None:
        return None if self.kind != "rifle" or self.budget is None else snapped(self.budget)


@dataclass(frozen=True)
class Shot:
    """The arguments of one shot."""

    at: Place
    toward: Place | None = None
    aim: float = 0.0
    accept: int = ALL
    blocked_by: int = ALL
    exclude: tuple[int, ...] = ()
    number: int = 0


@dataclass(frozen=True)
class Battle:
    """A world, a weapon, and a batch of shots: all of them have an aim, or all a target."""

    gun: Gun
    shots: list[Shot]
    bodies: list[Body] = field(default_factory=list)
    bounds: tuple[int, int, int, int] | None = None
    seed: int = 0

    def scene(self) -> Scene:
        """The library's."""
        scene = Scene()
        if self.bounds:
            x0, y0, x1, y1 = self.bounds
            scene = Scene((x1 - x0 + 1, y1 - y0 + 1), (x0, y0))
        for body in self.bodies:
            x0, y0 = (min((p[i] for p in body.pixels), default=0) for i in (0, 1))
            w, h = (max((p[i] for p in body.pixels), default=v) - v + 1 for i, v in ((0, x0), (1, y0)))
            mask = np.array([[(x0 + x, y0 + y) in body.pixels for x in range(w)] for y in range(h)])
            scene.add(
                Sprite.from_mask(mask, pivot_xy=(0, 0)), (x0, y0), role="occluder" if body.occluder else "hittable",
                layer=body.layer, categories=body.categories, owner=body.owner, cost=body.cost,
            )  # fmt: skip
        return scene

    def fired(self, scene: Scene | None = None, **options: Any) -> Hits:
        """Fire the batch."""
        shots = self.shots
        width = max((len(s.exclude) for s in shots), default=0)
        each: dict[str, Any] = {"accept": [s.accept for s in shots], "shot": [s.number for s in shots]}
        each["blocked_by"] = [s.blocked_by for s in shots]
        if width:  # an owner of whom a test took the body away would be an error
            owners = [[o if o < len(self.bodies) else -1 for o in s.exclude] for s in shots]
            each["exclude"] = [[*o, *[-1] * (width - len(o))] for o in owners]
        if shots[0].toward is not None:
            each["toward"] = [s.toward for s in shots]
        else:
            each["aim"] = [s.aim for s in shots]
        at = [s.at for s in shots]
        return fire(scene or self.scene(), self.gun.weapon(), at, seed=self.seed, **each, **options)

    def moved(self, dx: int, dy: int) -> Battle:
        """Elsewhere, by whole pixels."""

        def there(place: Place) -> Place:
            return place[0] + dx, place[1] + dy

        shots = [replace(s, at=there(s.at), toward=s.toward and there(s.toward)) for s in self.shots]
        bounds = self.bounds and tuple(v + d for v, d in zip(self.bounds, (dx, dy, dx, dy), strict=True))
        return replace(self, shots=shots, bodies=[b.moved(dx, dy) for b in self.bodies], bounds=bounds)  # type: ignore[arg-type]

    def rays(self, which: int) -> Iterator[Ray]:
        """Rays of one shot, by round and pellet."""
        gun, shot = self.gun, self.shots[which]
        a = pair(shot.at)
        count, recoil_xy, recoil_deg = gun.rounds or (1, (0.0, 0.0), 0.0)
        angle, fan = gun.sweep or (0.0, 1)
        scattered, radius = gun.spread or (1, 0.0)
        for n in range(count):
            start = (a[0] + n * snapped(recoil_xy[0]), a[1] + n * snapped(recoil_xy[1]))
            for k in range(fan):
                around = (k - fan // 2) / fan if angle == 360 else k / max(fan - 1, 1) - 1 / 2
                turns = (recoil_deg * n, angle * around if gun.sweep else 0.0)
                dx, dy = self._displacement(shot, turns)
                for pellet in range(scattered):
                    x = y = 0
                    if gun.spread:
                        numbers = np.array([self.seed], np.uint64), np.array([shot.number]), np.array([n])
                        x, y = disc_offsets(snapped(radius), *numbers, pellet + 1)[0, pellet].tolist()
                    yield n, k if gun.sweep else pellet, start, (start[0] + dx + 256 * x, start[1] + dy + 256 * y)

    def _displacement(self, shot: Shot, turns: Sequence[float]) -> Pixel:
        a = pair(shot.at)
        if self.gun.range is None:
            assert shot.toward is not None
            b = pair(shot.toward)
            made = b[0] - a[0], b[1] - a[1]
            for degrees in turns:
                made = oracle_raster.turned(made, *unit_of(degrees))
            return made
        c, s = unit_of(shot.aim)
        if shot.toward is not None:
            b = pair(shot.toward)
            c, s = oracle_raster.unit_toward(b[0] - a[0], b[1] - a[1])
        for degrees in turns:
            c, s = oracle_raster.turned((c, s), *unit_of(degrees))
        return oracle_raster.turned((snapped(self.gun.range), 0), c, s)

    def accepted(self, shot: Shot) -> list[Item]:
        """Items that exist for a shot, front to back."""
        owner = [i if body.owner is None else body.owner for i, body in enumerate(self.bodies)]
        ranked = sorted(range(len(owner)), key=lambda i: (-self.bodies[i].layer, not self.bodies[i].occluder, -i))
        return [
            Item(i, self.bodies[i].occluder, self.bodies[i].pixels, self.bodies[i].cost)
            for i in ranked
            if self.bodies[i].categories & (shot.blocked_by if self.bodies[i].occluder else shot.accept)
            and owner[i] not in shot.exclude
        ]

    def walks(self) -> list[list[tuple[Ray, Walk]]]:
        """For each shot its rays, walked by the oracle; StartsInside tells (shot, item) pairs."""
        gun, inside, found = self.gun, [], []
        for which, shot in enumerate(self.shots):
            items, rays = self.accepted(shot), []
            for ray in self.rays(which):
                try:
                    walked = oracle_rays.walk(
                        ray[2], ray[3], snapped(gun.width / 2), items, bounds=self.bounds,
                        max_hits=gun.hits_at_most, budget_256=gun.budget_256, inside=gun.inside,
                    )  # fmt: skip
                    rays.append((ray, walked))
                except StartsInside as told:
                    inside += [(which, item) for item in told.args]
            found.append(rays)
        if inside:
            raise StartsInside(*inside)
        return found


# What the oracle expects of the columns


def weight_at(walked: Walk, time: int | Fraction, falloff: str | None) -> int:
    """Weight at a time: 65535 - floor(65535 t), then smoothstep, rounded down."""
    if falloff is None:
        return FULL
    linear = FULL - math.floor(Fraction(FULL * time) / walked.path.scale)
    return linear if falloff == "linear" else linear * linear * (3 * FULL - 2 * linear) // FULL**2


@dataclass(frozen=True)
class Close:
    """A number that is not rounded correctly: equal to 1e-12 of its own size, or of the size of what it is made of."""

    value: float
    size: float = 0.0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, float | int) and math.isclose(
            self.value, other, rel_tol=1e-12, abs_tol=1e-12 * self.size
        )

    __hash__ = None  # type: ignore[assignment]


def point_at(ray: Ray, walked: Walk, time: int | Fraction) -> list[Close]:
    """The ray's point, px."""
    part = Fraction(time) / walked.path.scale
    ends = zip(ray[2], ray[3], strict=True)
    return [Close(float((a + part * (b - a)) / 256), max(abs(a), abs(b)) / 256) for a, b in ends]


def part_at(walked: Walk, time: int | Fraction) -> float | Close:
    """Part of the ray before a time: correctly rounded where it is a quotient of whole numbers that are floats."""
    part = float(Fraction(time) / walked.path.scale)
    return part if isinstance(time, int) and walked.path.scale < 2**53 else Close(part)


def pass_of(which: int, ray: Ray, walked: Walk, one: Pass, falloff: str | None) -> dict[str, Any]:
    """A row of `hits.passes`, but for the row of `hits` that it belongs to."""
    return {
        "shot": which, "round": ray[0], "pellet": ray[1], "object": one.object, "order": one.order,
        "entry_xy": list(one.cells[0]), "exit_xy": list(one.exit_xy),
        "entry": part_at(walked, one.entry), "exit": part_at(walked, one.exit),
        "entry_px": Close(walked.path.px(one.entry)), "exit_px": Close(walked.path.px(one.exit)),
        "material": Close(one.material, 1.0), "normal_xy": one.normal and list(one.normal),
        "weight": weight_at(walked, one.entry, falloff), "point_xy": point_at(ray, walked, one.entry),
    }  # fmt: skip


def stop_of(which: int, ray: Ray, walked: Walk) -> dict[str, Any]:
    """A row of `hits.stop`; None where the sheet leaves it open: the cell of a far end, and a thick ray's normal."""
    stop = walked.stop
    return {
        "shot": which, "round": ray[0], "pellet": ray[1],
        "reason": ("range", "occluder", "hits", "budget").index(stop.reason),
        "item": -1 if stop.item is None else stop.item, "cell_xy": stop.cell_xy and list(stop.cell_xy),
        "fraction": part_at(walked, stop.time), "distance": Close(walked.path.px(stop.time)),
        "point_xy": point_at(ray, walked, stop.time), "normal_xy": stop.normal and list(stop.normal),
    }  # fmt: skip


def rows_of(which: int, walks: Sequence[tuple[Ray, Walk]], falloff: str | None) -> list[tuple[Any, ...]]:
    """Rows of `hits` of one shot."""
    struck: dict[tuple[int, int], list[tuple[Any, ...]]] = {}
    for ray, walked in walks:
        for one in walked.passes:
            along2 = Fraction(one.entry) ** 2 * walked.path.length2 / walked.path.scale**2
            weight = weight_at(walked, one.entry, falloff)
            struck.setdefault((ray[0], one.object), []).append((along2, ray[1], one.order, ray[2], one.cells, weight))
    keyed = []
    for (round_, item), passes in struck.items():
        nearest = min(passes, key=lambda p: p[:3])
        cells = [c for p in passes for c in p[4]]
        (x, y), (a, b) = nearest[4][0], nearest[3]
        distance2 = (x - (a + 128) // 256) ** 2 + (y - (b + 128) // 256) ** 2
        weight = sum(p[5] for p in passes)
        row = (which, round_, item, len(cells), len(set(cells)), weight, len(passes), (x, y), distance2)
        keyed.append(((round_, *nearest[:3]), row))
    return [row for _, row in sorted(keyed)]


# Random worlds


def some_spot(rng: random.Random, low: int, high: int) -> float:
    """A coordinate: a centre, a border, between, or anywhere on the grid."""
    kind = rng.choice(["half", "half", "half", "quarter", "any"])
    parts = {"half": 2, "quarter": 4, "any": 256}[kind]
    return rng.randint(low * parts, high * parts) / parts


def some_place(rng: random.Random, bodies: Sequence[Body] = ()) -> Place:
    """Anywhere in 14 x 12 px, or on a pixel of a body: its centre, a side, a corner."""
    pixels = sorted(rng.choice(bodies).pixels) if bodies and rng.random() < 0.5 else []
    if not pixels:
        return some_spot(rng, -2, 12), some_spot(rng, -2, 10)
    x, y = rng.choice(pixels)
    return x + rng.randint(-2, 2) / 2, y + rng.randint(-2, 2) / 2


def some_body(rng: random.Random, number: int) -> Body:
    """A small mask with holes; some are hollow, some one pixel, some nothing."""
    w, h = (1, 1) if rng.random() < 0.1 else (rng.randint(1, 8), rng.randint(1, 8))
    chance = rng.choice([0.0, 0.5, 0.5, 0.8, 0.8, 0.8, 1.0, 1.0, 1.0, 1.0])
    hollow = rng.random() < 0.3
    pixels = {
        (x, y)
        for x in range(w)
        for y in range(h)
        if rng.random() < chance and not (hollow and 0 < x < w - 1 and 0 < y < h - 1)
    }
    occluder = rng.random() < 0.15
    layer = rng.choice([-3, -1, 0, 1] if occluder else [0, 0, 0, 1, -2])
    owner, cost = rng.choice([None, None, rng.randint(0, number)]), rng.choice([0, 1, 1, 1, 1, 2, 7, 255])
    body = Body(frozenset(pixels), occluder, layer, rng.choice([1, 1, 1, 1, 2, 3, 4, 0]), owner, cost)
    return body.moved(rng.randint(-1, 6), rng.randint(-1, 5))


def some_target(rng: random.Random, at: Place, bodies: Sequence[Body] = ()) -> Place:
    """Anywhere but at the muzzle itself: on a level with it, on a diagonal, right beside it."""
    x, y = some_place(rng, bodies)
    kind = rng.choice(["any", "any", "any", "any", "row", "column", "diagonal", "diagonal", "near"])
    if kind == "diagonal":
        step = rng.choice([-1, 1]) * rng.randint(1, 24) / 2
        return at[0] + step, at[1] + rng.choice([-1, 1]) * step
    near = at[0] + rng.randint(-3, 3) / 256, at[1] + rng.randint(-3, 3) / 256
    found = {"any": (x, y), "row": (x, at[1]), "column": (at[0], y), "near": near}[kind]
    return found if pair(found) != pair(at) else (at[0] + 1, at[1] - 0.5)


def some_gun(rng: random.Random) -> Gun:
    """Any traced weapon; thin, or at least 2 px wide."""
    kind = rng.choice(["pistol", "rifle", "rifle", "rifle", "laser"])
    width = rng.choice([*[0] * 12, 2, 3, 4.5, 9, rng.randint(512, 2304) / 256])
    gun = Gun(kind, rng.choice([*[None] * 8, rng.randint(0, 5120) / 256, 12, 12, 0]), width)
    inside = rng.choice(["hit", "hit", "hit", "ignore_until_exit", "ignore_until_exit", "error"])
    gun = replace(gun, inside=inside, falloff=rng.choice([None, "linear", "smooth"]))
    if kind == "rifle":
        budget = rng.choice([None, rng.randint(0, 8) / 2, rng.randint(0, 4), rng.randint(0, 2000) / 256, 300.5])
        gun = replace(gun, max_hits=rng.choice([None, None, None, 1, 2, 3]), budget=budget)
    around = rng.choice(["", "", "", "", "", "", "sweep", "spread"])
    if around == "sweep":
        gun = replace(
            gun, range=rng.choice([4, 7.3, 12]), sweep=(rng.choice([0, 30, 90, 180, 360, 33.3]), rng.randint(2, 5))
        )
    if around == "spread":
        gun = replace(gun, spread=(rng.randint(1, 4), rng.randint(0, 20) / 4))
    if rng.random() < 0.15:
        recoil = (rng.randint(-8, 8) / 8, rng.randint(-8, 8) / 8)
        gun = replace(gun, rounds=(rng.randint(1, 3), recoil, rng.choice([0, 90, 7.5, -20])))
    return gun


def some_battle(rng: random.Random) -> Battle:
    """A crowded little world and two or three shots."""
    gun = some_gun(rng)
    bodies = [some_body(rng, number) for number in range(rng.choice([0, 2, 4, 5, 6, 7, 8, 9]))]
    aimed = gun.range is not None and rng.random() < 0.5
    shots = []
    for number in range(rng.randint(1, 3)):
        at = some_place(rng, bodies)
        toward = some_target(rng, at, bodies)
        exclude = (rng.randint(0, 9),) if rng.random() < 0.2 else ()
        accept = rng.choice([ALL] * 8 + [1, 3, 6])
        shot = Shot(at, toward, 0.0, accept, ALL, exclude, rng.choice([number, 2**40]))
        if aimed:
            shot = replace(shot, toward=None, aim=rng.choice([0, 90, 180, -90, 45, -135, rng.randint(-30, 30) * 12.5]))
        shots.append(shot)
    bounds = rng.choice([None, None, (0, 0, 11, 9), (2, 1, 7, 8)])
    seed = rng.choice([0, 7, 2**64 - 1])
    shots = [replace(shot, blocked_by=rng.choice([ALL] * 8 + [1, 3, 6, 0])) for shot in shots]
    return Battle(gun, shots, bodies, bounds, seed)
