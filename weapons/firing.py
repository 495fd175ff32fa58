"""Fire a weapon at a scene: the whole flow on one screen.

scene -> stack -> weapon -> patterns -> placed -> pre-filter -> samples -> rows

Shots of rays go on in `rayfire`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from planes.arrays import InputError, Ints, each, reals, shown
from planes.constants import ALL
from planes.heap import keep_freed
from planes.scene import Scene
from weapons.arsenal import ray_parts_of
from weapons.bitfire import fired_by_bits, traits_of
from weapons.hits import Hits
from weapons.plan import Plan, read_stack
from weapons.runfire import fired_by_runs
from weapons.volley import Shots, checked_shots
from weapons.weapon import Weapon

if TYPE_CHECKING:  # most shots are of patterns, at the present: rays and the past are loaded when they are asked for
    from planes.history import History

__all__ = ["category_bits", "fire"]


def fire(
    scene: Scene | History,
    weapon: Weapon,
    at: object,
    *,
    aim: object = None,
    toward: object = None,
    accept: object = ALL,
    exclude: object = None,
    seed: object = 0,
    shot: object = None,
    tick: object = None,
    prefilter: str = "auto",
    broadphase: str = "auto",
    strategy: str = "auto",
) -> Hits:
    """Decide what shots hit.

    Parameters
    ----------
    scene : what is fired at; or a History of it, at the ticks that are given
    weapon : one weapon for all shots
    at : (2,) position of one shot, or (N, 2) of a batch, px
    aim : degrees, 0 along +x, clockwise on the screen; or
    toward : (2,) or (N, 2) point that the weapon is aimed at, px
    accept : names, or bits, of the categories of what may be hit and of what may block; all by default
    exclude : owners that are passed over, the shooter's for one: a number; for one shot a list (K,); for a batch one
        for each shot (N,), or several for each (N, K) or for all (1, K), padded with -1
    seed : of the pellets, 0 .. 2**64 - 1
    shot : numbers of the shots, 0 .. N-1 by default: a shot of a batch fired again alone under its number is the same
    tick : of a History: when each shot was fired
    prefilter : "auto", "none", "box", "circle", "oriented box", "4 boxes" (1 to 64), "polygon", "swept": what goes
        before the pixels; it changes no row
    broadphase : "auto", "none", "grid", "quadtree", "bvh": how boxes that meet are found; it changes no row; none
        without a pre-filter
    strategy : "auto", "direct", "composed": how pixels are looked up; it changes no row. Composed are of rays only thin
        ones that end at their first hit, and of patterns with falloff, or beyond 2048 px, those at a scene with bounds;
        shots of other patterns that differ in what they accept are looked up direct, as the plan tells

    Each of aim, toward, accept, exclude, seed, shot and tick is one for all shots or one for each.

    Raises
    ------
    InputError
        Naming the argument and the row.
    """
    plan = Plan()
    present = scene if isinstance(scene, Scene) else _history(scene).scene
    shots = checked_shots(weapon, at, aim, toward, category_bits(present, accept), exclude, seed, shot)
    plan.run("shots", f"{len(shots)} checked", shots.nbytes)
    if not isinstance(scene, Scene):
        return _fired_at_moments(scene, tick, weapon, shots, (prefilter, broadphase, strategy), plan)
    if tick is not None:
        raise InputError(f"tick: expected none, as a Scene has no past, got {shown(tick)}: fire at its History")
    return fired(scene, weapon, shots, prefilter, broadphase, strategy, plan)


def _fired_at_moments(
    history: History, tick: object, weapon: Weapon, shots: Shots, how: tuple[str, str, str], plan: Plan
) -> Hits:
    """Fire shots at the scenes of their ticks; `how` are the last arguments of `fire`."""
    moments = moments_of(history, tick, len(shots))
    plan.run("past", f"{len(moments)} scenes of it")
    parts: list[Hits] = []
    for past, rows in moments:
        parts.append(fired(past, weapon, shots.pick(rows), *how, Plan() if parts else plan))
    if len(parts) == 1:
        return parts[0]
    hits = parts[0].gathered(parts, [rows for _, rows in moments], shots)
    hits.plan.run("rows", "", hits.nbytes)
    return hits


def _history(scene: object) -> History:
    from planes.history import History

    if not isinstance(scene, History):
        raise InputError(f"scene: expected a Scene or a History, got {type(scene).__name__}")
    return scene


def moments_of(history: History, tick: object, n: int) -> list[tuple[Scene, Ints]]:
    """Scenes of the past that shots are fired at, and the rows of the shots at each."""
    if tick is None:
        raise InputError("tick: expected one, or one for each shot, as it is a History that is fired at, got none")
    ticks = reals("tick", each("tick", tick, n), (n,))
    if not n:
        return [(history.at(history.ticks[-1]) if history.ticks else history.scene, np.arange(0))]
    distinct, which = np.unique(ticks, return_inverse=True)
    moments: list[tuple[Scene, Ints]] = []
    for k, one in enumerate(distinct.tolist()):
        rows = np.flatnonzero(which == k)
        try:
            moments.append((history.at(int(one) if one.is_integer() else one), rows))
        except InputError as error:
            raise InputError(str(error).replace("tick:", f"tick[{rows[0]}]:", 1) if n > 1 else str(error)) from error
    return moments


def fired(
    scene: Scene, weapon: Weapon, shots: Shots, prefilter: str, broadphase: str, strategy: str, plan: Plan | None = None
) -> Hits:
    """Decide what checked shots hit; the other arguments are those of `fire`, and a plan that has begun."""
    plan = plan or Plan()
    if len(shots) > 1:
        keep_freed()
    parts = ray_parts_of(weapon)
    if parts is not None:
        from weapons.rayfire import fired_rays

        return fired_rays(scene, weapon, parts, shots, (prefilter, broadphase, strategy), plan)
    stack = read_stack(scene, plan)
    fired_by = fired_by_bits if traits_of(weapon).counted else fired_by_runs
    return fired_by(scene, weapon, shots, stack, (prefilter, broadphase, strategy), plan)


def category_bits(scene: Scene, accept: object) -> object:
    """Category bits of names; anything else as it is."""
    if isinstance(accept, list | tuple) and accept and all(isinstance(name, str) for name in accept):
        return scene.category_bits(*accept)
    return accept
