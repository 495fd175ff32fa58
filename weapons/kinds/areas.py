"""Area weapons and their patterns, pellets and bursts, and all weapons from JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar
from weakref import ref

import numpy as np

from hitplanes.planes.common.backend import LruCache, kernels_of
from hitplanes.planes.common.checks import InputError, Ints, choice, integer, kind_of, shown, suggestion, within
from hitplanes.planes.common.limits import HALF, MASK_SIDE_MAX, PATTERN_CACHE_BYTES, PELLETS_MAX, REACH_MAX, SUB
from hitplanes.planes.common.tables import Flag, Mask, Number, Numbers, Optional, Rows, Value, Whole, Word, typed
from hitplanes.planes.grid import fixed_point, rasterize
from hitplanes.planes.grid.fixed_point import ONE, all_quarters, pixel, quarters, snap, turned, unit_of
from hitplanes.planes.grid.rasterize import ORIGIN, Edges, disc, edges_of, polygon, ring
from hitplanes.planes.grid.spans import RowRuns, Spans
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite, fits, frame_pivot, rows_of
from hitplanes.planes.scene.variants import Transform, variant_of

from .rays import INSIDE, Laser, Pistol, Projectile, RayWeapon, Rifle, Sweep, ends_at_first, is_stepped
from .weapon import (
    FALLOFFS,
    LENGTH,
    AimedTable,
    Part,
    Pattern,
    PatternTable,
    Swept,
    Weapon,
    fits_at_reach,
    make_pattern,
)

SIGHTS = ("occluders", "all")

FOLLOWED_MOST = 32
"""Most rays of a shot that a ready weapon follows one by one; more take less time together."""

ONE_RING = np.zeros(1, np.int64)
RING = Numbers((None, 2), REACH_MAX / 2, least=3)


@dataclass(frozen=True, eq=False, repr=False)
class AreaWeapon(Weapon):
    """A weapon of one pattern.

    Parameters
    ----------
    pierce : whether samples go on through the objects that they hit, up to an occluder
    falloff : None (full weight everywhere), "linear" or "smooth", from the shot's pixel to the end of the reach
    line_of_sight : what shelters a pixel of the pattern if it lies on the way there from the shot's pixel, or from the
        pellet's: None (nothing: only what lies in front, at the pixel itself), "occluders", or "all" (objects, too, but
        for the one that is hit at the pixel)
    inside : what an item that the way begins in does, as for rays: "hit" (it shelters all but the shot's pixel),
        "ignore_until_exit", or "error"
    """

    table: ClassVar[dict[str, Value]] = {
        "pierce": Flag(),
        "falloff": Optional(Word(FALLOFFS)),
        "line_of_sight": Optional(Word(SIGHTS)),
        "inside": Word(INSIDE),
    }
    directed: ClassVar[bool] = False
    pierce: bool = field(default=False, kw_only=True)
    falloff: str | None = field(default=None, kw_only=True)
    line_of_sight: str | None = field(default=None, kw_only=True)
    inside: str = field(default="hit", kw_only=True)

    def __post_init__(self) -> None:
        """Check that `inside` has ways to speak of."""
        super().__post_init__()
        if self.inside != "hit" and self.line_of_sight is None:
            raise InputError(f"inside: expected 'hit' of a weapon without line_of_sight, got {self.inside!r}")

    @property
    def reach_256(self) -> int:
        """Where falloff ends, in 1/256 px from the shot's pixel."""
        return 0

    def spans(self, c: int, s: int) -> Spans:
        """Pixels about the shot's pixel, aimed along the direction (c, s) of length 2**30."""
        runs = self.runs(np.array([[c, s]]))
        if runs is None:
            raise InputError(f"weapon: expected a kind that has a pattern, got {type(self).__name__}")
        return runs.spans()

    def runs(self, direction: Ints) -> RowRuns | None:
        """Runs of the patterns along several directions at once; None if this kind makes them one by one.

        Parameters
        ----------
        direction : (n, 2) cos and sin of the aims, times 2**30
        """
        return None

    def swept(self, c: int, s: int) -> Swept | None:
        """The segment that the pattern lies along, if it has one, and how far from it centres may lie."""
        return None


@dataclass(frozen=True, eq=False, repr=False)
class Point(AreaWeapon):
    """One pixel."""

    kind: ClassVar[str] = "point"

    def spans(self, c: int, s: int) -> Spans:
        """The shot's pixel."""
        return disc(0)


@dataclass(frozen=True, eq=False, repr=False)
class Disc(AreaWeapon):
    """All pixels whose centres are at most `radius` px away: a blast."""

    kind: ClassVar[str] = "disc"
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {"radius": LENGTH}
    radius: float

    @property
    def reach_256(self) -> int:
        """The radius."""
        return _snapped(self.radius)

    def spans(self, c: int, s: int) -> Spans:
        """A closed disc."""
        return disc(_snapped(self.radius))


@dataclass(frozen=True, eq=False, repr=False)
class Ring(AreaWeapon):
    """All pixels whose centres are `inner_radius` to `outer_radius` px away: a shock wave."""

    kind: ClassVar[str] = "ring"
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {"inner_radius": LENGTH, "outer_radius": LENGTH}
    inner_radius: float
    outer_radius: float

    def __post_init__(self) -> None:
        """Check that the inner radius is not the larger one."""
        super().__post_init__()
        if self.inner_radius > self.outer_radius:
            raise InputError(
                f"inner_radius: expected at most outer_radius, {self.outer_radius}, got {self.inner_radius}"
            )

    @property
    def reach_256(self) -> int:
        """The outer radius."""
        return _snapped(self.outer_radius)

    def spans(self, c: int, s: int) -> Spans:
        """A closed ring."""
        return ring(_snapped(self.inner_radius), _snapped(self.outer_radius))


@dataclass(frozen=True, eq=False, repr=False)
class Box(AreaWeapon):
    """A box of `width` x `height` px, turned with the aim; an even side is centred right of, or below, the pixel."""

    kind: ClassVar[str] = "box"
    directed: ClassVar[bool] = True
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {"width": Whole(1, REACH_MAX), "height": Whole(1, REACH_MAX)}
    width: int
    height: int

    @cached_property
    def reach_256(self) -> int:
        """Distance of the farthest corner."""
        return _farthest(self._corners)

    def spans(self, c: int, s: int) -> Spans:
        """A closed rectangle whose edges lie between the pixels."""
        return polygon([turned(self._corners, c, s)])

    def runs(self, direction: Ints) -> RowRuns:
        """Closed rectangles, along directions (n, 2)."""
        return _polygons(self._corners, ONE_RING, direction)

    @cached_property
    def _corners(self) -> Ints:
        sides = [(HALF * (1 - n % 2), HALF * n) for n in (int(self.width), int(self.height))]
        (left, right), (top, low) = ((center - half, center + half) for center, half in sides)
        return np.array([(left, top), (right, top), (right, low), (left, low)], np.int64)


@dataclass(frozen=True, eq=False, repr=False)
class Polygon(AreaWeapon):
    """A polygon about the shot, turned with the aim; convex or not, with holes, filled by the even-odd rule.

    Parameters
    ----------
    points : (n, 2) corners, px; the last is joined to the first
    holes : more rings (n, 2)
    """

    kind: ClassVar[str] = "polygon"
    directed: ClassVar[bool] = True
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {"points": RING, "holes": Rows(RING)}
    points: Sequence[Sequence[float]]
    holes: Sequence[Sequence[Sequence[float]]] = ()

    @cached_property
    def reach_256(self) -> int:
        """Distance of the farthest point."""
        return _farthest(self._points)

    def spans(self, c: int, s: int) -> Spans:
        """The filled rings."""
        return polygon(np.split(turned(self._points, c, s), self._starts[1:]))

    def runs(self, direction: Ints) -> RowRuns:
        """The filled rings, along directions (n, 2)."""
        return _polygons(self._points, self._starts, direction)

    @cached_property
    def _points(self) -> Ints:
        """Points (n, 2) of all rings, in 1/256 px."""
        return np.concatenate([snap(ring) for ring in (self.points, *self.holes)])

    @cached_property
    def _starts(self) -> Ints:
        """Where each ring begins among the points."""
        return np.cumsum([0, len(self.points), *map(len, self.holes)])[:-1]


@dataclass(frozen=True, eq=False, repr=False)
class Cone(AreaWeapon):
    """All pixels whose centres are at most `reach` px away and at most `angle` / 2 degrees off the aim: a flame.

    The supercover of the axis belongs to it, so it has no gap near the muzzle.
    """

    kind: ClassVar[str] = "cone"
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {"reach": LENGTH, "angle": Number(0, 360)}
    directed: ClassVar[bool] = True
    reach: float
    angle: float

    @property
    def reach_256(self) -> int:
        """The reach."""
        return _snapped(self.reach)

    def runs(self, direction: Ints) -> RowRuns:
        """Closed sectors, along directions (n, 2)."""
        runs: RowRuns = kernels_of(rasterize).cones(self.reach_256, direction, *self._half)
        return runs

    @cached_property
    def _half(self) -> tuple[int, int]:
        """Direction of half the angle."""
        return unit_of(self.angle / 2)


@dataclass(frozen=True, eq=False, repr=False)
class Beam(AreaWeapon):
    """Pixels whose centres are at most `width` / 2 px from a segment of `length` px, and the segment's supercover."""

    kind: ClassVar[str] = "beam"
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {"length": LENGTH, "width": LENGTH}
    directed: ClassVar[bool] = True
    length: float
    width: float

    @property
    def reach_256(self) -> int:
        """The length and half the width."""
        return _snapped(self.length) + _snapped(self.width / 2)

    def runs(self, direction: Ints) -> RowRuns:
        """Segments with round ends, along directions (n, 2)."""
        end = kernels_of(fixed_point).turned_to(np.array([[_snapped(self.length), 0]]), direction)[:, 0]
        runs: RowRuns = kernels_of(rasterize).beams(ORIGIN, end, _snapped(self.width / 2))
        return runs

    def swept(self, c: int, s: int) -> Swept:
        """The segment from the shot's pixel along the aim, and half the width."""
        return ORIGIN, turned(np.array([_snapped(self.length), 0]), c, s), _snapped(self.width / 2)


@dataclass(frozen=True, eq=False, repr=False)
class Stencil(AreaWeapon):
    """A mask as the pattern, turned with the aim like a sprite.

    Parameters
    ----------
    mask : (h, w) booleans, or rows of '#' and '.'
    pivot_xy : pixel of the mask that lies on the shot; by default its centre
    """

    kind: ClassVar[str] = "stencil"
    directed: ClassVar[bool] = True
    table: ClassVar[dict[str, Value]] = AreaWeapon.table | {
        "mask": Mask(),
        "pivot_xy": Optional(Numbers((2,), MASK_SIDE_MAX)),
    }
    mask: Any
    pivot_xy: Sequence[float] | None = None

    def __post_init__(self) -> None:
        """Keep the mask as a tuple of rows, which is read-only."""
        super().__post_init__()
        self._keep("mask", tuple(rows_of(self.mask)))

    @cached_property
    def _sprite(self) -> Sprite:
        return Sprite.from_mask(Mask().check("mask", self.mask), pivot_xy=self.pivot_xy)

    @cached_property
    def reach_256(self) -> int:
        """Distance of the farthest pixel, unturned."""
        return _farthest(SUB * self.spans(1 << 30, 0).pixels())

    def spans(self, c: int, s: int) -> Spans:
        """The turned mask."""
        quarter, c, s = quarters(c, s)
        variant = variant_of(self._sprite, Transform(quarter=quarter, c=c, s=s))
        x, y = pixel(np.array([-variant.pivot_x, -variant.pivot_y])).tolist()
        return Spans.from_mask(variant.mask, (x, y))

    @cached_property
    def _edges(self) -> Edges:
        frame = self._sprite.frames[0]
        return edges_of(frame.mask, frame_pivot(self._sprite, frame))

    def runs(self, direction: Ints) -> RowRuns | None:
        """The turned masks, along directions (n, 2); None if they may be too large."""
        side = 2 * -(-self.reach_256 // SUB) + 3
        if not fits(side, side):
            return None
        runs: RowRuns = kernels_of(rasterize).turned_runs(self._edges, *all_quarters(direction))
        return runs


Pellet = TypeVar("Pellet", bound=AreaWeapon | RayWeapon, covariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Spread(Weapon, Generic[Pellet]):
    """A shotgun: `count` pellets of a weapon, with offsets uniform over a disc of `radius` px.

    If the pellet is a ray, its far end is offset: all pellets start at the muzzle.
    """

    kind: ClassVar[str] = "spread"
    table: ClassVar[dict[str, Value]] = {
        "pellet": Part("pellet", (AreaWeapon, RayWeapon), "a weapon of one pattern or ray"),
        "count": Whole(1, PELLETS_MAX),
        "radius": LENGTH,
    }
    pellet: Pellet
    count: int
    radius: float


Repeated = TypeVar("Repeated", bound=AreaWeapon | RayWeapon | Spread[Any] | Sweep, covariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Rounds(Weapon, Generic[Repeated]):
    """A burst: `count` rounds of a weapon, each shifted and turned by the recoil of those before it.

    Parameters
    ----------
    recoil_xy : shift of each round from the one before, px
    recoil_deg : turn of the aim from the round before, degrees
    """

    kind: ClassVar[str] = "rounds"
    table: ClassVar[dict[str, Value]] = {
        "weapon": Part("single", (AreaWeapon, RayWeapon, Spread, Sweep), "a weapon other than rounds"),
        "count": Whole(1, PELLETS_MAX),
        "recoil_xy": Numbers((2,), REACH_MAX),
        "recoil_deg": Number(-360, 360),
    }
    weapon: Repeated
    count: int
    recoil_xy: Sequence[float] = (0.0, 0.0)
    recoil_deg: float = 0.0

    def __post_init__(self) -> None:
        """Check that all rounds together do not have too many pellets."""
        super().__post_init__()
        if isinstance(self.weapon, Spread | Sweep):
            integer("count", self.count, 1, PELLETS_MAX // self.weapon.count)


Rays = RayWeapon | Sweep | Spread[RayWeapon] | Rounds[RayWeapon | Sweep | Spread[RayWeapon]]
"""Weapons of rays, for type checkers: `fire` answers them with `RayHits`."""

AreaParts = tuple[Rounds[Any] | None, Spread[Any] | None, AreaWeapon]
"""Burst, spread, and pattern of an area weapon."""

RayParts = tuple[Rounds[Any] | None, Spread[Any] | Sweep | None, RayWeapon]
"""Burst, spread or sweep, and ray of a ray weapon."""

Parts = tuple[AreaParts | None, RayParts | None]
"""Parts of a weapon of either family; None of the other."""

KINDS: dict[str, type[Weapon]] = {
    kind.kind: kind
    for kind in (
        Point, Disc, Ring, Box, Polygon, Cone, Beam, Stencil, Pistol, Rifle, Laser, Projectile, Spread, Sweep, Rounds,
    )
}  # fmt: skip


def parts_of(weapon: Weapon) -> AreaParts:
    """Burst, spread and pattern of an area weapon."""
    parts = _parts_of(weapon)[0]
    if parts is None:
        hint = ": weapons_of(scene) has those of a scene by name" if isinstance(weapon, str | dict) else ""
        raise InputError(f"weapon: expected a weapon, got {kind_of(weapon)}{hint}")
    return parts


def ray_parts_of(weapon: Weapon) -> RayParts | None:
    """Burst, spread or sweep, and ray of a ray weapon; None for other weapons."""
    return _parts_of(weapon)[1]


def pellets_in(parts: AreaParts | RayParts) -> int:
    """Number of patterns or rays of a shot: the pellets of all rounds."""
    burst, several, _ = parts
    return (burst.count if burst else 1) * (several.count if several else 1)


def are_followed(parts: RayParts) -> bool:
    """Whether a ready shot follows its rays one by one: a single ray, or a few that end at their first hit."""
    burst, several, ray = parts
    if burst is None and several is None:
        return not is_stepped(ray)
    return pellets_in(parts) <= FOLLOWED_MOST and ends_at_first(ray)


def _parts_of(weapon: object) -> Parts:
    """Parts of a weapon; they are not kept with it, as the weapon may be one of them: a reference cycle."""
    if isinstance(weapon, AreaWeapon) and KINDS.get(weapon.kind) is type(weapon):
        return (None, None, weapon), None
    if not isinstance(weapon, Weapon):
        return None, None
    burst = weapon if isinstance(weapon, Rounds) else None
    inner: Weapon = burst.weapon if burst else weapon
    several = inner if isinstance(inner, Spread | Sweep) else None
    plain: Weapon = inner.pellet if isinstance(inner, Spread) else inner.ray if isinstance(inner, Sweep) else inner
    if KINDS.get(plain.kind) is not type(plain):
        return None, None
    if isinstance(plain, AreaWeapon):
        return (burst, several if isinstance(several, Spread) else None, plain), None
    return None, (burst, several, plain) if isinstance(plain, RayWeapon) else None


def has_no_range(weapon: Weapon) -> bool:
    """Whether a weapon is a ray that ends at the point that it is aimed at, so that it needs `toward`."""
    parts = ray_parts_of(weapon)
    return parts is not None and parts[2].length_256 is None


def is_directed(weapon: Weapon) -> bool:
    """Whether what a weapon hits depends on its aim."""
    area, ray = _parts_of(weapon)
    return ray is not None or (area is not None and area[2].directed)


FADING_MOST = 512
"""Longest reach, px, of patterns with weights that are made at once: the weights of all pixels around are needed."""

_kept: LruCache[tuple[str, int, int], Pattern] = LruCache(
    PATTERN_CACHE_BYTES, lambda pattern: pattern.nbytes, lambda key: len(key[0])
)


def pattern_of(weapon: AreaWeapon, c: int, s: int) -> Pattern:
    """Pattern of a weapon aimed along a direction of length 2**30; the last ones asked for are kept.

    The weapon refers to its straight pattern, the only one of a weapon that is not directed.
    """
    straight = s == 0 and c == ONE
    found: Pattern | None = vars(weapon)["_straight"]() if straight and "_straight" in vars(weapon) else None
    if found is not None:
        return found

    def make() -> Pattern:
        return make_pattern(weapon.spans(c, s), weapon.falloff, weapon.reach_256, weapon.swept(c, s))

    pattern = _kept.get((weapon.text, c, s), make)  # the weapon itself may hold much more
    if straight:
        weapon._keep("_straight", ref(pattern))  # no longer than others are kept
    return pattern


def patterns_of(weapon: AreaWeapon, direction: Ints) -> PatternTable:
    """Patterns of a weapon along distinct directions (n, 2): only their bit rows are made, if its kind can."""
    weighted, reach = weapon.falloff is not None, -(-weapon.reach_256 // SUB)
    far = (weighted and reach > FADING_MOST) or not fits_at_reach(reach, weighted)
    if type(weapon).runs is AreaWeapon.runs or far:
        return PatternTable([pattern_of(weapon, c, s) for c, s in direction.tolist()])
    return AimedTable(weapon, direction, pattern_of)


def weapon_from_json(data: object, name: str = "weapon", kinds: tuple[type, ...] = (Weapon,)) -> Weapon:
    """Make a weapon from its JSON.

    Parameters
    ----------
    data : an object with a kind and the fields of that kind
    name : name of the weapon in error texts
    kinds : classes that it may be of; a burst may not be part of a burst

    Raises
    ------
    InputError
        If a kind or key is unknown, a field missing or a value out of range; it names the weapon and the field.
    """
    with within(name):
        if not isinstance(data, Mapping):
            how = ": give what its to_json() returns" if isinstance(data, Weapon) else ""
            raise InputError(f"expected an object with a kind, got {shown(data)}{how}")
        for key in () if "kind" in data else data:
            if suggestion(key, ("kind",)):
                choice("key", key, ("kind",))
        known_kinds = [kind for kind, made in KINDS.items() if issubclass(made, kinds)]
        kind = KINDS[choice("kind", data.get("kind"), known_kinds)]
        known = {f.name: f for f in fields(kind)}
        for key in data:
            choice("key", key, ("kind", *known))
        missing = [key for key, f in known.items() if f.default is MISSING and key not in data]
        if missing:
            raise InputError(f"{missing[0]}: expected a value, got nothing")
        values = {key: value for key, value in data.items() if key != "kind"}
        for key, part in kind.table.items():
            if isinstance(part, Part):
                values[key] = weapon_from_json(values[key], key, part.kinds)
        return kind(**values)


def weapons_of(scene: Scene) -> dict[str, Weapon]:
    """Weapons of a scene's file, by name."""
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a Scene, got {kind_of(scene)}")
    weapons = typed("weapons", scene.weapons, dict)
    return {name: weapon_from_json(data, f"weapons.{name}") for name, data in weapons.items()}


def _polygons(points: Ints, starts: Ints, direction: Ints) -> RowRuns:
    """Runs of rings of points (m, 2), which begin at `starts`, turned to directions (n, 2)."""
    turned_points = kernels_of(fixed_point).turned_to(points, direction)
    runs: RowRuns = kernels_of(rasterize).polygons(turned_points, starts)
    return runs


def _snapped(length: float) -> int:
    """Like `snap`, for one Python number."""
    return round(SUB * length)


def _farthest(points_256: Ints) -> int:
    """Distance of the farthest point from the origin, rounded up."""
    square = int((points_256 * points_256).sum(axis=1).max(initial=0))
    return math.isqrt(square - 1) + 1 if square else 0


def check_aimed(weapon: Weapon, offset: Ints | None) -> None:
    """Check that a ray without a range is aimed at a point within reach."""
    if not has_no_range(weapon):
        return
    if offset is None:
        raise InputError("toward: expected a point, as the weapon has no range, got none")
    far = np.flatnonzero((np.abs(offset) > SUB * REACH_MAX).any(axis=1))
    if len(far):
        got = (offset[far[0]] / SUB).tolist()
        raise InputError(
            f"toward[{far[0]}]: expected a point within {REACH_MAX} px of the shot, got one at {got} of it"
        )
