"""Weapons whose shots are rays: they go through the world in order, from the muzzle on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from planes.arrays import InputError
from planes.constants import PELLETS_MAX, REACH_MAX, STEPS_MAX
from planes.grid256 import snap
from planes.kept import once
from planes.schema import Number, Optional, Value, Whole, Word
from weapons.pattern import FALLOFFS
from weapons.weapon import LENGTH, Part, Weapon

__all__ = ["INSIDE", "Laser", "Pistol", "Projectile", "Rifle", "Sweep", "Traced"]

INSIDE = ("hit", "ignore_until_exit", "error")


@dataclass(frozen=True, eq=False)
class Traced(Weapon):
    """A weapon of one ray, which meets what lies on its way in order, and ends at the first occluder.

    Parameters
    ----------
    inside : of what the ray starts in: "hit" at distance 0, "ignore_until_exit", or an "error"
    """

    table: ClassVar[dict[str, Value]] = {"inside": Word(INSIDE)}
    inside: str = field(default="hit", kw_only=True)

    @property
    def length_256(self) -> int | None:
        """How far it goes, 1/256 px; None: to the point that it is aimed at."""
        return None

    @property
    def radius_256(self) -> int:
        """Half of its width, 1/256 px."""
        return 0

    @property
    def hits_most(self) -> int | None:
        """After how many objects it ends."""
        return None

    @property
    def budget_256(self) -> int | None:
        """How much material it goes through, in 1/256 px of an object of cost 1."""
        return None

    @property
    def fades(self) -> str | None:
        """Its falloff."""
        return None


@dataclass(frozen=True, eq=False)
class Laser(Traced):
    """Goes through all objects.

    Parameters
    ----------
    range : px; None ends it exactly at the point `toward` which it is aimed: whoever can see can be seen
    width : px; 0 is a line. A wider one also covers centres at most half of it away
    falloff : None (full weight everywhere), "linear" or "smooth", from the muzzle to the ray's end
    """

    kind: ClassVar[str] = "laser"
    table: ClassVar[dict[str, Value]] = {
        "range": Optional(LENGTH),
        "width": LENGTH,
        "falloff": Optional(Word(FALLOFFS)),
        **Traced.table,
    }
    range: float | None
    width: float = field(default=0, kw_only=True)
    falloff: str | None = field(default=None, kw_only=True)

    @once
    def length_256(self) -> int | None:
        """The range."""
        return None if self.range is None else int(snap(self.range))

    @once
    def radius_256(self) -> int:
        """Half of the width."""
        return int(snap(self.width / 2))

    @property
    def fades(self) -> str | None:
        """The falloff."""
        return self.falloff


@dataclass(frozen=True, eq=False)
class Pistol(Laser):
    """Ends at the first object that it hits."""

    kind: ClassVar[str] = "pistol"

    @property
    def hits_most(self) -> int:
        """One."""
        return 1


@dataclass(frozen=True, eq=False)
class Rifle(Laser):
    """Goes through objects, up to the last that it may hit, or until its budget is used up.

    Parameters
    ----------
    max_hits : it ends where it enters the last of so many objects
    budget : px of material, each times the cost of the object that it is of
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


@dataclass(frozen=True, eq=False)
class Projectile(Traced):
    """A disc that flies through one frame, while objects that have a velocity move; it ends at what it touches first.

    It is moved by its velocity relative to each object, whose mask stays as it is when the frame begins.

    Parameters
    ----------
    speed : px a frame, along the aim
    radius : of the disc, px
    steps : None sweeps it: no target is too thin, no speed too great. With n it is tested n times, at k / n of the
        frame for k = 1 .. n: once a frame, or at a higher rate of simulation; it misses what lies between two tests
    """

    kind: ClassVar[str] = "projectile"
    table: ClassVar[dict[str, Value]] = {
        "speed": LENGTH,
        "radius": LENGTH,
        "steps": Optional(Whole(1, STEPS_MAX)),
        **Traced.table,
    }
    speed: float
    radius: float
    steps: int | None = field(default=None, kw_only=True)

    @once
    def length_256(self) -> int:
        """What it flies in a frame."""
        return int(snap(self.speed))

    @once
    def radius_256(self) -> int:
        """The radius."""
        return int(snap(self.radius))

    @property
    def hits_most(self) -> int:
        """One."""
        return 1


@dataclass(frozen=True, eq=False)
class Sweep(Weapon):
    """A fan: `count` rays of a weapon, evenly over `angle` degrees about the aim."""

    kind: ClassVar[str] = "sweep"
    table: ClassVar[dict[str, Value]] = {
        "ray": Part("ray", (Traced,), "a weapon of one ray"),
        "angle": Number(0, 360),
        "count": Whole(2, PELLETS_MAX),
    }
    ray: Traced
    angle: float
    count: int

    def __post_init__(self) -> None:
        """Check that the ray has a length of its own."""
        super().__post_init__()
        if self.ray.length_256 is None:
            raise InputError("ray: expected a weapon with a range, got one that ends where it is aimed")
