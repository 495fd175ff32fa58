"""Rays of a report over the enlarged world: arrows, numbered entries, exits, normals, near misses, swept shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from planes.arrays import Bools, Floats
from weapons.panel import Text
from weapons.signs import BADGE, NEAR_MISS, Signs
from weapons.world import World

__all__ = ["draw_arrows", "draw_rays", "marked"]

NUMBERED_MAX = 3
"""Shots of more rays than these have no numbers and no normals."""

STEPS_SHOWN = 256
"""Tests of a projectile that are drawn, each by its disc."""

OF_RAYS = ("filtered", "occluded", "hit")
"""Verdicts whose cells are marked under rays: those where it meets nothing are told by the arrow."""

INK = (18, 20, 24)

CLEAR_OF = ("number", "first contact", "goes in", "comes out", "ends: occluder", "ends: budget", "ray")
"""Signs that a number may not cover."""


def marked(shots: Sequence[Mapping[str, Any]], verdict: str) -> list[Mapping[str, Any]]:
    """Shots whose samples of one verdict are marked, each with a shape: of rays those on what they meet."""
    return [shot for shot in shots if "rays" not in shot or verdict in OF_RAYS]


def draw_rays(world: World, report: Mapping[str, Any]) -> tuple[list[Text], Bools]:
    """Draw the rays of all shots, and what they sweep.

    Returns
    -------
    numbers, and what of the picture (h, w) is drawn on
    """
    shots = [shot for shot in report["shots"] if "rays" in shot]
    signs = Signs(world.image.shape[:2], sum(len(shot["rays"]) for shot in shots))
    for shot in shots:
        _sweeps(signs, world, shot, _steps_of(report["weapons"][shot["weapon"]]))
        _arrows(signs, world, shot)
        _miss(signs, world, shot)
    texts = [text for shot in shots for text in _numbers(signs, world, shot)]
    world.painted |= {f"ray: {name}" for name in signs.lay(world.image)}
    taken = np.zeros(world.image.shape[:2], np.bool_)
    for strokes in signs.strokes.values():
        taken |= strokes.ground > 0
    return texts, taken


def draw_arrows(world: World, shot: Mapping[str, Any]) -> None:
    """Draw the rays of one shot alone, with what they go through."""
    signs = Signs(world.image.shape[:2], len(shot["rays"]))
    _arrows(signs, world, shot)
    signs.lay(world.image)


def _steps_of(weapon: Mapping[str, Any]) -> int | None:
    """At how many moments a projectile is tested; 0 for one that is swept, None for what is none."""
    while weapon["kind"] != "projectile":
        inner = [value for value in weapon.values() if isinstance(value, Mapping)]
        if not inner:
            return None
        weapon = inner[0]
    return weapon.get("steps") or 0


def _sweeps(signs: Signs, world: World, shot: Mapping[str, Any], steps: int | None) -> None:
    """Draw what the rays of a shot sweep, or where they are tested, and what a projectile touches first."""
    radius = shot["radius"] * world.factor
    for ray in shot["rays"]:
        stop = ray["stop"]
        begin, at, end = world.placed(np.array([ray["start"], stop["point"], ray["end"]]))
        if steps:
            for k in range(1, min(steps, STEPS_SHOWN) + 1):
                if k <= stop["fraction"] * steps:
                    signs.tested(begin + (end - begin) * (k / steps), radius)
        elif radius:
            signs.sweep(begin, at, radius)
        if steps is not None and stop["item"] is not None:
            signs.contact(at, radius, world.placed(np.array([stop["cell_xy"]]))[0], float(world.factor))


def _arrows(signs: Signs, world: World, shot: Mapping[str, Any]) -> None:
    """Draw the rays of a shot, and where they go through objects; of few with normals."""
    for ray in shot["rays"]:
        begin, at, end = world.placed(np.array([ray["start"], ray["stop"]["point"], ray["end"]]))
        signs.ray(begin, at, end, ray["stop"]["reason"])
        for told in ray["passes"]:
            into = world.placed(np.array([told["point"]]))[0]
            if told["entry"] < ray["stop"]["fraction"]:  # else the head of the arrow is there
                signs.through(into, begin + (end - begin) * told["exit"], told["exit"] < ray["stop"]["fraction"])
            normal = np.array(told["normal"], np.float64)
            if normal.any() and len(shot["rays"]) <= NUMBERED_MAX:
                signs.normal(into, normal)


def _numbers(signs: Signs, world: World, shot: Mapping[str, Any]) -> Iterator[Text]:
    """Number the entries of few rays, each beside its point."""
    if len(shot["rays"]) > NUMBERED_MAX:
        return
    radius = shot["radius"] * world.factor
    for ray in shot["rays"]:
        begin, end = world.placed(np.array([ray["start"], ray["end"]]))
        for told in ray["passes"]:
            into = world.placed(np.array([told["point"]]))[0]
            spot = next(_spots(signs, into, end - begin, np.array(told["normal"]), radius), None)
            if spot is not None:
                signs.badge(spot)
                label = str(told["order"] + 1)
                x, y = np.rint(spot).astype(np.int64).tolist()
                yield Text(x - 4 * len(label), y + 4, label, INK, bold=True)


def _spots(signs: Signs, at: Floats, ahead: Floats, normal: Floats, radius: float) -> Iterator[Floats]:
    """Free places for a number beside a point of a ray of a radius, first on the side that the normal is not on."""
    length = float(np.sqrt((ahead**2).sum()))
    if not length:
        return
    side = np.array([-ahead[1], ahead[0]]) / length
    if (side * normal).sum() > 0 or ((side * normal).sum() == 0 and side[1] > 0):
        side = -side
    height, width = signs.shape
    for far in (radius + BADGE + 6, radius + 2 * BADGE + 8):
        for spot in (at + far * side, at - far * side):
            x, y = (int(v) for v in np.floor(np.clip(spot, -BADGE, (width, height))))
            reach = int(BADGE) + 2
            inside = reach <= x < width - reach and reach <= y < height - reach
            box = slice(max(y - reach, 0), y + reach + 1), slice(max(x - reach, 0), x + reach + 1)
            if inside and not any(
                strokes.ink[box].any() for name, strokes in signs.strokes.items() if name in CLEAR_OF
            ):
                yield spot


def _miss(signs: Signs, world: World, shot: Mapping[str, Any]) -> None:
    """Draw the nearest miss, if it was a near one."""
    miss = shot["nearest_miss"]
    if miss is not None and 0 < miss["distance"] <= NEAR_MISS:
        signs.miss(*world.placed(np.array([miss["ray_xy"], miss["object_xy"]])))
