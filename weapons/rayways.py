"""Two ways of rays to their first hit: to walk past items, or to jump by the clearance plane; which one pays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from planes.arrays import InputError, choice
from planes.items import Stack
from planes.scene import Scene
from weapons.costs import REDRAW_PIXEL_NS, STRATEGIES
from weapons.guns import Projectile, Traced

if TYPE_CHECKING:
    from planes.clearance import ClearancePlane

__all__ = ["chosen_way", "ends_at_first", "jumps_at_all"]

WALK_CALL_NS, WALK_RAY_NS = 700_000.0, 12_000.0
JUMP_CALL_NS, JUMP_RAY_NS, CLEARANCE_PIXEL_NS = 300_000.0, 400.0, 5.5
"""Measured with `tests/bench/rays.py` on one machine; the choice hangs on their ratios only."""


def ends_at_first(ray: Traced) -> bool:
    """Whether rays of a weapon end at the first object that they touch, as it stands."""
    return ray.hits_most == 1 and ray.budget_256 is None and not isinstance(ray, Projectile)


def jumps_at_all(ray: Traced) -> bool:
    """Whether rays of a weapon may jump."""
    return ends_at_first(ray) and not ray.radius_256


def chosen_way(
    strategy: str, asked: bool, ray: Traced, scene: Scene, stack: Stack, rays: int
) -> tuple[ClearancePlane | None, str]:
    """The plane by which so many rays of a weapon jump, or None where they walk, and why.

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
        return None, "only thin rays that end at their first hit do"
    if strategy == "direct" or (strategy == "auto" and (asked or not len(stack))):
        return None, "every ray walks"
    plane = scene.clearance()
    if strategy == "composed":
        if plane is None:
            raise InputError("strategy: expected bounds that fit one plane for 'composed', got a scene without them")
        return plane, "asked for"
    if plane is None:
        return None, "no bounds that fit one plane"
    walk, jump = WALK_CALL_NS + rays * WALK_RAY_NS, JUMP_CALL_NS + rays * JUMP_RAY_NS
    owed = 0.0
    if not plane.is_made(scene.items):
        owed = plane.codes.cost(scene.items) * REDRAW_PIXEL_NS + plane.codes.size * CLEARANCE_PIXEL_NS
    plane.missed += max(walk - jump, 0.0)
    return (plane if plane.missed > owed else None), f"about {(jump + owed) / 1e3:.0f} us by jumps, {walk / 1e3:.0f} us"
