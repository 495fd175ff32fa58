"""Ray weapons: each shot goes through the world in order, from the muzzle on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from hitplanes.planes.common.backend import cached_attribute
from hitplanes.planes.common.checks import Floats, InputError, Ints
from hitplanes.planes.common.limits import PELLETS_MAX, REACH_MAX, STEPS_MAX
from hitplanes.planes.common.tables import Number, Optional, Value, Whole, Word
from hitplanes.planes.grid.fixed_point import snap, unit
from hitplanes.planes.scene.items import Items, Stack

from .weapon import FALLOFFS, LENGTH, Part, Weapon

INSIDE = ("hit", "ignore_until_exit", "error")


@dataclass(frozen=True, eq=False, repr=False)
class RayWeapon(Weapon):
    """A weapon of one ray, which touches items in order of distance, and ends at the first occluder.

    Parameters
    ----------
    inside : what happens to an item that the ray starts in: "hit" at distance 0, "ignore_until_exit", or "error"
    """

    table: ClassVar[dict[str, Value]] = {"inside": Word(INSIDE)}
    inside: str = field(default="hit", kw_only=True)

    @property
    def length_256(self) -> int | None:
        """Length of the ray, 1/256 px; None if it ends at the point that it is aimed at."""
        return None

    @property
    def radius_256(self) -> int:
        """Half of the ray's width, 1/256 px."""
        return 0

    @property
    def hits_most(self) -> int | None:
        """Number of objects after which the ray ends; None if there is no limit."""
        return None

    @property
    def budget_256(self) -> int | None:
        """Length of material that the ray goes through, in 1/256 px of an object of cost 1; None if unlimited."""
        return None

    @property
    def fades(self) -> str | None:
        """Falloff of the weight along the ray: None, "linear" or "smooth"."""
        return None


@dataclass(frozen=True, eq=False, repr=False)
class Laser(RayWeapon):
    """A ray that goes through all objects.

    Parameters
    ----------
    range : length, px; None ends the ray exactly at the point `toward`, so that lines of sight are symmetric
    width : px; 0 is a line. A wider ray also covers pixels whose centres are at most half the width away
    falloff : None (full weight everywhere), "linear" or "smooth", from the muzzle to the ray's end
    """

    kind: ClassVar[str] = "laser"
    table: ClassVar[dict[str, Value]] = {
        "range": Optional(LENGTH),
        "width": LENGTH,
        "falloff": Optional(Word(FALLOFFS)),
        **RayWeapon.table,
    }
    range: float | None
    width: float = field(default=0, kw_only=True)
    falloff: str | None = field(default=None, kw_only=True)

    @cached_attribute
    def length_256(self) -> int | None:
        """The range."""
        return None if self.range is None else int(snap(self.range))

    @cached_attribute
    def radius_256(self) -> int:
        """Half of the width."""
        return int(snap(self.width / 2))

    @property
    def fades(self) -> str | None:
        """The falloff."""
        return self.falloff


@dataclass(frozen=True, eq=False, repr=False)
class Pistol(Laser):
    """A ray that ends at the first object that it hits."""

    kind: ClassVar[str] = "pistol"

    @property
    def hits_most(self) -> int:
        """One."""
        return 1


@dataclass(frozen=True, eq=False, repr=False)
class Rifle(Laser):
    """A ray that goes through objects until it has hit `max_hits` of them, or has spent its budget.

    Parameters
    ----------
    max_hits : the ray ends where it enters the last of so many objects
    budget : px of material, each px times the cost of its object. The ray ends at the moment when 0 px are left, also
        at the far side of an object. It hits nothing that it touches at that moment or later, whatever that costs. A
        ray with a budget of 0 ends at its muzzle and hits nothing
    """

    kind: ClassVar[str] = "rifle"
    table: ClassVar[dict[str, Value]] = {
        **Laser.table,
        "max_hits": Optional(Whole(1, 2**31)),
        "budget": Optional(Number(0, 256 * REACH_MAX)),
    }
    max_hits: int | None = field(default=None, kw_only=True)
    budget: float | None = field(default=None, kw_only=True)

    @property
    def hits_most(self) -> int | None:
        """As given."""
        return self.max_hits

    @property
    def budget_256(self) -> int | None:
        """As given."""
        return None if self.budget is None else int(snap(self.budget))


@dataclass(frozen=True, eq=False, repr=False)
class Projectile(RayWeapon):
    """A disc that flies through one frame, while objects that have a velocity move; it ends at what it touches first.

    It moves by its velocity relative to each object; masks stay as they are when the frame begins.

    Parameters
    ----------
    speed : px a frame, along the aim
    radius : radius of the disc, px
    steps : None sweeps the disc, so that no target is too thin and no speed too great. With n the disc is tested at
        k / n of the frame for k = 1 .. n, like a simulation at n times the frame rate, and misses what lies between
    """

    kind: ClassVar[str] = "projectile"
    table: ClassVar[dict[str, Value]] = {
        "speed": LENGTH,
        "radius": LENGTH,
        "steps": Optional(Whole(1, STEPS_MAX)),
        **RayWeapon.table,
    }
    speed: float
    radius: float
    steps: int | None = field(default=None, kw_only=True)

    @cached_attribute
    def length_256(self) -> int:
        """The way of one frame."""
        return int(snap(self.speed))

    @cached_attribute
    def radius_256(self) -> int:
        """The radius."""
        return int(snap(self.radius))

    @property
    def hits_most(self) -> int:
        """One."""
        return 1


FULL_CIRCLE = 360


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Weapon):
    """A fan of `count` rays of a weapon, spread evenly over `angle` degrees about the aim.

    A fan has a ray on both of its sides. A full circle, of 360 degrees, has none twice, and one along the aim.
    """

    kind: ClassVar[str] = "sweep"
    table: ClassVar[dict[str, Value]] = {
        "ray": Part("ray", (RayWeapon,), "a weapon of one ray"),
        "angle": Number(0, FULL_CIRCLE),
        "count": Whole(2, PELLETS_MAX),
    }
    ray: RayWeapon
    angle: float
    count: int

    def __post_init__(self) -> None:
        """Check that the ray has a length of its own."""
        super().__post_init__()
        if self.ray.length_256 is None:
            raise InputError("ray: expected a weapon with a range, got one that ends where it is aimed")

    @property
    def turns(self) -> Floats:
        """Degrees (count,) from the aim to each ray; those of both sides differ only in their signs."""
        if self.angle == FULL_CIRCLE:
            return np.asarray(FULL_CIRCLE * ((np.arange(self.count) - self.count // 2) / self.count))
        return np.asarray(self.angle * ((2 * np.arange(self.count) - self.count + 1) / (2 * (self.count - 1))))

    @cached_attribute
    def directions(self) -> Ints:
        """Turns (count, 2) from the aim to each ray, as cos and sin times 2**30."""
        return np.stack(unit(self.turns), axis=1)


def ends_at_first(ray: RayWeapon) -> bool:
    """Whether rays of a weapon end at the first object that they touch, and take no time."""
    return ray.hits_most == 1 and ray.budget_256 is None and not isinstance(ray, Projectile)


def is_thin_first(ray: RayWeapon) -> bool:
    """Whether rays of a weapon are thin and end at their first hit, so that they need not walk."""
    return ends_at_first(ray) and not ray.radius_256


def is_moving(ray: RayWeapon, items: Items, stack: Stack) -> bool:
    """Whether any item moves during the ray; only a projectile takes time, one frame."""
    return isinstance(ray, Projectile) and bool(items.velocity_256[stack.rows].any())


def is_stepped(ray: RayWeapon) -> bool:
    """Whether rays of a weapon are tested at some moments of the frame alone."""
    return isinstance(ray, Projectile) and (ray.steps is not None or not ray.length_256)


def unspent(ray: RayWeapon) -> RayWeapon:
    """The weapon as it is for rays that begin in nothing and spend nothing, which can be cast."""
    free = replace(ray, inside="hit") if ray.inside != "hit" else ray
    return replace(free, budget=None) if isinstance(free, Rifle) and free.budget is not None else free
