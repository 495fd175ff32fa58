"""The shot: what is fired, and what it did."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planes.sampling import Verdict as Verdict
    from weapons.arsenal import Beam as Beam
    from weapons.arsenal import Box as Box
    from weapons.arsenal import Cone as Cone
    from weapons.arsenal import Disc as Disc
    from weapons.arsenal import Point as Point
    from weapons.arsenal import Polygon as Polygon
    from weapons.arsenal import Ring as Ring
    from weapons.arsenal import Rounds as Rounds
    from weapons.arsenal import Spread as Spread
    from weapons.arsenal import Stencil as Stencil
    from weapons.arsenal import arsenal_of as arsenal_of
    from weapons.arsenal import weapon_from_json as weapon_from_json
    from weapons.clock import FixedStep as FixedStep
    from weapons.facts import report_of as report_of
    from weapons.firing import fire as fire
    from weapons.guns import Laser as Laser
    from weapons.guns import Pistol as Pistol
    from weapons.guns import Projectile as Projectile
    from weapons.guns import Rifle as Rifle
    from weapons.guns import Sweep as Sweep
    from weapons.hits import Hits as Hits
    from weapons.picture import picture_of_report as picture_of_report
    from weapons.preparing import prepare as prepare
    from weapons.rayhits import RayHits as RayHits
    from weapons.rayhits import Reason as Reason
    from weapons.ready import Ready as Ready
    from weapons.record import ShotRecord as ShotRecord
    from weapons.record import replay as replay
    from weapons.weapon import Weapon as Weapon

_HOME = {
    **dict.fromkeys(
        ("Beam", "Box", "Cone", "Disc", "Point", "Polygon", "Ring", "Rounds", "Spread", "Stencil"),
        "weapons.arsenal",
    ),
    **dict.fromkeys(("Laser", "Pistol", "Projectile", "Rifle", "Sweep"), "weapons.guns"),
    "FixedStep": "weapons.clock",
    "RayHits": "weapons.rayhits",
    "Ready": "weapons.ready",
    "prepare": "weapons.preparing",
    "Reason": "weapons.rayhits",
    "ShotRecord": "weapons.record",
    "replay": "weapons.record",
    "Weapon": "weapons.weapon",
    "arsenal_of": "weapons.arsenal",
    "weapon_from_json": "weapons.arsenal",
    "fire": "weapons.firing",
    "Hits": "weapons.hits",
    "report_of": "weapons.facts",
    "picture_of_report": "weapons.picture",
    "Verdict": "planes.sampling",
}

__all__ = [
    "Beam", "Box", "Cone", "Disc", "Point", "Polygon", "Ring", "Rounds", "Spread", "Stencil", "Weapon",
    "Laser", "Pistol", "Projectile", "Rifle", "Sweep", "arsenal_of", "weapon_from_json", "fire", "prepare", "Ready",
    "Hits", "RayHits", "Reason", "ShotRecord", "replay", "Verdict", "FixedStep", "report_of", "picture_of_report",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import a module when something of it is first used: importing the package costs little."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
