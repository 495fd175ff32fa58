"""The strategies of rays: in which way what a ray hits is found.

- The walk (`ray_walk`) follows any ray. It is the reference, and all rays that pierce walk.
- The cast tests a thin ray that ends at its first hit against the boxes and pixels of all items.
- The march takes such a ray to the first pixel that is taken, by the distance field of a scene within bounds.

A way is chosen by what the call asks, by its sizes, and by the distance field of the scene: whether it is made, and
the time lost so far without it (`DistanceField.lost_ns`). The plan tells both. `fire` and prepared weapons choose by
the same table.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from hitplanes.planes.bits.distance_field import DistanceField
from hitplanes.planes.common.checks import choice
from hitplanes.planes.common.costs import costs
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.strategy import STRATEGIES
from ..kinds.rays import Projectile, RayWeapon

RAYS_AT_ONCE = 2**14
"""Most rays of a chunk; the columns of so many fit the processor's cache."""

WALKED_AT_ONCE, CHUNK_GROWTH = 1024, 4
"""Most rays that walk together, and the largest ratio of the numbers of two chunks in a row."""

STRETCH_PAIRS, STRETCH_GROWTH = 150, 2
"""Pairs of rays and boxes expected in the first stretch of a walk, at least one a ray, which cost as much as a stretch;
ratio of the lengths of two stretches in a row."""


class Sizes(NamedTuple):
    """What costs depend on: how many rays a call has, or that it is of one prepared ray; and the items."""

    rays: int
    prepared: bool
    stack: Stack


def _walk_ns(sizes: Sizes) -> float:
    """Cost of the walk, ns, among items that are spread evenly over the box around all; a prepared ray never walks."""
    if sizes.prepared:
        return inf
    item_wh, world_wh = sizes.stack.sizes
    items, now = len(sizes.stack), costs()
    met = min(items * float((item_wh / world_wh).prod()), items)
    return now.walk_call + items * now.walk_item + sizes.rays * (now.walk_ray + met * now.walk_met)


def _cast_ns(sizes: Sizes) -> float:
    now = costs()
    return now.cast_call * (not sizes.prepared) + sizes.rays * (now.cast_ray + len(sizes.stack) * now.cast_pair)


def _march_ns(sizes: Sizes) -> float:
    now = costs()
    return now.march_prepared if sizes.prepared else now.march_call + sizes.rays * now.march_ray


def ends_at_first(ray: RayWeapon) -> bool:
    """Whether rays of a weapon end at the first object that they touch, and take no time."""
    return ray.hits_most == 1 and ray.budget_256 is None and not isinstance(ray, Projectile)


def is_thin_first(ray: RayWeapon) -> bool:
    """Whether rays of a weapon are thin and end at their first hit, so that they need not walk."""
    return ends_at_first(ray) and not ray.radius_256


def _never(_: RayWeapon, __: Scene) -> str:
    return ""


def _not_cast(ray: RayWeapon, _: Scene) -> str:
    return "" if is_thin_first(ray) else "only thin rays that end at their first hit do"


def _not_marched(ray: RayWeapon, scene: Scene) -> str:
    return _not_cast(ray, scene) or ("" if scene.distance_field() else "no bounds that fit one plane")


class Way(NamedTuple):
    """A way of rays: why it cannot serve a weapon at a scene, or ""; and what it costs, ns.

    Its engine is of the same name in `first_hit.ENGINES`; the walk's is `ray_walk.trace`.
    """

    why_not: Callable[[RayWeapon, Scene], str]
    cost: Callable[[Sizes], float]


WAYS = {"walk": Way(_never, _walk_ns), "cast": Way(_not_cast, _cast_ns), "march": Way(_not_marched, _march_ns)}

ASKED = {"direct": "walk", "built": "march"}
"""Ways that are meant by the strategies which areas and rays share."""


class Choice(NamedTuple):
    """The way of a call, and why; `pending` if a later call like it, at the same scene, may march."""

    way: str
    why: str
    pending: bool = False


def chosen_way(
    strategy: str, asked: bool, ray: RayWeapon, scene: Scene, stack: Stack, rays: int, prepared: bool = False
) -> Choice:
    """Choose the way of so many rays of a weapon.

    Parameters
    ----------
    strategy : argument of `fire`; a way that cannot serve is passed over, and any other name counts as "auto"
    asked : whether the caller named a pre-filter or a broad phase, which only the walk uses

    Raises
    ------
    InputError
        If the strategy is not known.
    """
    choice("strategy", strategy, STRATEGIES)
    name = ASKED.get(strategy, strategy)
    forced = WAYS.get(name)
    passed_over = forced.why_not(ray, scene) if forced else ""
    if forced and not passed_over:
        return Choice(name, "asked for")
    why = f"{name} is passed over: {passed_over}; " if passed_over else ""
    if asked or not len(stack) or not is_thin_first(ray):
        return Choice("walk", f"{why}every ray walks")
    sizes = Sizes(rays, prepared, stack)
    walk, cast, march = (way.cost(sizes) for way in WAYS.values())
    why += f"about {cast / 1e3:.0f} us cast at items, {walk / 1e3:.0f} us walking"
    field, saved_ns = scene.distance_field(), min(cast, walk) - march
    if field is not None:
        why += f", {march / 1e3:.0f} us by march"
    other = Choice("cast" if cast < walk else "walk", why)
    return other if field is None or saved_ns <= 0 else _rented_or_bought(other, field, scene, saved_ns)


def way_of_rest(way: str, stack: Stack, rays: int) -> str:
    """Way of the rays that another way left over."""
    sizes = Sizes(rays, False, stack)
    casts = way == "march" and len(stack) and _cast_ns(sizes) < _walk_ns(sizes)
    return "cast" if casts else "walk"


def _rented_or_bought(other: Choice, field: DistanceField, scene: Scene, saved_ns: float) -> Choice:
    """March if the distance field is made, or as soon as calls have lost as much time without it as it takes to make.

    So the total is at most twice that of the better choice (Karlin et al., "Competitive snoopy caching", 1988).
    """
    if field.is_made(scene.items):
        return other._replace(way="march")
    field.lost_ns += saved_ns
    build = field.labels.cost(scene.items) * costs().labels_pixel + field.labels.size * costs().field_pixel
    why = f"{other.why}, which would take {build / 1e3:.0f} us to make: {field.lost_ns / 1e3:.0f} us lost so far"
    return other._replace(way="march", why=why) if field.lost_ns > build else Choice(other.way, why, pending=True)
