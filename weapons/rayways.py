"""Ways of rays to their first hit: to walk past items, to be cast at them, or to jump by a plane; which one pays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from planes import raycast
from planes.arrays import InputError, choice
from planes.items import Stack
from planes.scene import Scene
from planes.twins import kernels_of
from weapons.costs import REDRAW_PIXEL_NS, STRATEGIES
from weapons.guns import Projectile, Traced

if TYPE_CHECKING:
    from planes.clearance import ClearancePlane

__all__ = ["CAST_PAIR_NS", "CAST_RAY_NS", "Way", "chosen_way", "ends_at_first", "jumps_at_all", "owed_ns"]

WALK_CALL_NS, WALK_ITEM_NS, WALK_RAY_NS, WALK_MET_NS = 700_000.0, 20.0, 12_000.0, 3000.0
JUMP_CALL_NS, JUMP_RAY_NS, CLEARANCE_PIXEL_NS = 190_000.0, 400.0, 5.5
CAST_CALL_NS, CAST_RAY_NS, CAST_PAIR_NS = 270_000.0, 75_000.0, 30.0
COMPILED_CALL_NS, COMPILED_RAY_NS, COMPILED_PAIR_NS = 170_000.0, 600.0, 1.3
"""Of a call, of an item, of each ray, and of each ray and item, or box that it is expected to begin in: by walking,
jumping, and casting in numpy and compiled. Measured with `tests/bench/rays.py` on one machine; the choice hangs on
their ratios only."""


class Way(NamedTuple):
    """How rays go to their ends, and why: jumping by a plane, if there is one, or else cast at items, or walking."""

    plane: ClearancePlane | None
    casts: bool
    why: str


def ends_at_first(ray: Traced) -> bool:
    """Whether rays of a weapon end at the first object that they touch, as it stands."""
    return ray.hits_most == 1 and ray.budget_256 is None and not isinstance(ray, Projectile)


def jumps_at_all(ray: Traced) -> bool:
    """Whether rays of a weapon may jump."""
    return ends_at_first(ray) and not ray.radius_256


def chosen_way(strategy: str, asked: bool, ray: Traced, scene: Scene, stack: Stack, rays: int) -> Way:
    """The way of so many rays of a weapon.

    Parameters
    ----------
    strategy : of `fire`
    asked : whether a pre-filter or a broad phase is asked for: they are of the walk

    Raises
    ------
    InputError
        If the strategy is not known, or the composed one is asked for where no whole plane can be made.
    """
    choice("strategy", strategy, STRATEGIES if jumps_at_all(ray) else STRATEGIES[:2])
    if not jumps_at_all(ray):
        return Way(None, False, "only thin rays that end at their first hit do")
    plane = None if strategy == "direct" else scene.clearance()
    if strategy == "composed":
        if plane is None:
            raise InputError("strategy: expected bounds that fit one plane for 'composed', got a scene without them")
        return Way(plane, False, "asked for")
    if asked or not len(stack):
        return Way(None, False, "every ray walks")
    walk, cast = _walk_ns(rays, stack), _cast_ns(rays, len(stack))
    casts, direct = cast < walk, min(cast, walk)
    told = f"about {cast / 1e3:.0f} us cast at items, {walk / 1e3:.0f} us walking"
    if plane is None:
        why = "direct is asked for" if strategy == "direct" else "no bounds that fit one plane"
        return Way(None, casts, f"{why}: {told}")
    jump, owed = JUMP_CALL_NS + rays * JUMP_RAY_NS, owed_ns(plane, scene)
    plane.missed += max(direct - jump, 0.0)
    return Way(plane if plane.missed > owed else None, casts, f"{told}, {(jump + owed) / 1e3:.0f} us by jumps")


def owed_ns(plane: ClearancePlane, scene: Scene) -> float:
    """What it costs to make the plane, ns."""
    if plane.is_made(scene.items):
        return 0.0
    return plane.codes.cost(scene.items) * REDRAW_PIXEL_NS + plane.codes.size * CLEARANCE_PIXEL_NS


def _walk_ns(rays: int, stack: Stack) -> float:
    """What it costs to let rays walk, ns, among items that are spread evenly over the box around all."""
    item_wh, world_wh = stack.sizes
    met = min(len(stack) * float((item_wh / world_wh).prod()), len(stack))
    return WALK_CALL_NS + len(stack) * WALK_ITEM_NS + rays * (WALK_RAY_NS + met * WALK_MET_NS)


def _cast_ns(rays: int, items: int) -> float:
    """What it costs to cast rays at items, ns."""
    if kernels_of(raycast) is raycast:
        return CAST_CALL_NS + rays * (CAST_RAY_NS + items * CAST_PAIR_NS)
    return COMPILED_CALL_NS + rays * (COMPILED_RAY_NS + items * COMPILED_PAIR_NS)
