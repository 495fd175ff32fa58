"""What does a shot hit in a 2-D scene? Decided by pixels, exactly, and shown why.

`from hitplanes import Scene, Sprite, Disc, fire`: all that users name is here. Behind it are
`hitplanes.planes`, the world, and `hitplanes.weapons`, the shot.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hitplanes.planes.bits.span_walk import Verdict as Verdict
    from hitplanes.planes.common.backend import use_jit as use_jit
    from hitplanes.planes.common.backend import use_threads as use_threads
    from hitplanes.planes.common.checks import InputError as InputError
    from hitplanes.planes.common.limits import ALL as ALL
    from hitplanes.planes.files.png import read_png as read_png
    from hitplanes.planes.files.png import write_png as write_png
    from hitplanes.planes.files.scene_folder import load_scene as load_scene
    from hitplanes.planes.grid.spans import Spans as Spans
    from hitplanes.planes.scene.history import FixedStep as FixedStep
    from hitplanes.planes.scene.history import History as History
    from hitplanes.planes.scene.history import PastScene as PastScene
    from hitplanes.planes.scene.objects import Role as Role
    from hitplanes.planes.scene.render import Planes as Planes
    from hitplanes.planes.scene.scene import Scene as Scene
    from hitplanes.planes.scene.sprite import Sprite as Sprite
    from hitplanes.weapons.fire.call import fire as fire
    from hitplanes.weapons.fire.hits import Hits as Hits
    from hitplanes.weapons.kinds.areas import Beam as Beam
    from hitplanes.weapons.kinds.areas import Box as Box
    from hitplanes.weapons.kinds.areas import Cone as Cone
    from hitplanes.weapons.kinds.areas import Disc as Disc
    from hitplanes.weapons.kinds.areas import Point as Point
    from hitplanes.weapons.kinds.areas import Polygon as Polygon
    from hitplanes.weapons.kinds.areas import Ring as Ring
    from hitplanes.weapons.kinds.areas import Rounds as Rounds
    from hitplanes.weapons.kinds.areas import Spread as Spread
    from hitplanes.weapons.kinds.areas import Stencil as Stencil
    from hitplanes.weapons.kinds.areas import weapon_from_json as weapon_from_json
    from hitplanes.weapons.kinds.areas import weapons_of as weapons_of
    from hitplanes.weapons.kinds.rays import Laser as Laser
    from hitplanes.weapons.kinds.rays import Pistol as Pistol
    from hitplanes.weapons.kinds.rays import Projectile as Projectile
    from hitplanes.weapons.kinds.rays import Rifle as Rifle
    from hitplanes.weapons.kinds.rays import Sweep as Sweep
    from hitplanes.weapons.kinds.weapon import Weapon as Weapon
    from hitplanes.weapons.prepared.prepare import Ready as Ready
    from hitplanes.weapons.prepared.prepare import prepare as prepare
    from hitplanes.weapons.prepared.warm_up import warm_up as warm_up
    from hitplanes.weapons.rays.contacts import Reason as Reason
    from hitplanes.weapons.rays.ray_hits import RayHits as RayHits
    from hitplanes.weapons.rays.sight import scan as scan
    from hitplanes.weapons.rays.sight import sees as sees
    from hitplanes.weapons.replay.record import ShotRecord as ShotRecord
    from hitplanes.weapons.replay.record import replay as replay
    from hitplanes.weapons.replay.shot_log import fire_shots as fire_shots
    from hitplanes.weapons.report.picture import picture_of_report as picture_of_report
    from hitplanes.weapons.report.report import report_of as report_of

    __version__: str

_HOME = {
    name: module
    for module, names in {
        "planes.common.limits": "ALL",
        "planes.common.checks": "InputError",
        "planes.common.backend": "use_jit use_threads",
        "planes.grid.spans": "Spans",
        "planes.scene.sprite": "Sprite",
        "planes.scene.objects": "Role",
        "planes.scene.scene": "Scene",
        "planes.scene.history": "FixedStep History PastScene",
        "planes.scene.render": "Planes",
        "planes.files.png": "read_png write_png",
        "planes.files.scene_folder": "load_scene",
        "planes.bits.span_walk": "Verdict",
        "weapons.kinds.weapon": "Weapon",
        "weapons.kinds.rays": "Laser Pistol Projectile Rifle Sweep",
        "weapons.kinds.areas": (
            "Beam Box Cone Disc Point Polygon Ring Rounds Spread Stencil weapons_of weapon_from_json"
        ),
        "weapons.fire.call": "fire",
        "weapons.fire.hits": "Hits",
        "weapons.rays.contacts": "Reason",
        "weapons.rays.ray_hits": "RayHits",
        "weapons.rays.sight": "scan sees",
        "weapons.prepared.prepare": "Ready prepare",
        "weapons.prepared.warm_up": "warm_up",
        "weapons.report.report": "report_of",
        "weapons.report.picture": "picture_of_report",
        "weapons.replay.record": "ShotRecord replay",
        "weapons.replay.shot_log": "fire_shots",
    }.items()
    for name in names.split()
}
"""Of each name the module that has it."""

__all__ = ["__version__", *sorted(_HOME)]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    """Import a module when something of it is first used: importing the package costs little."""
    if name == "__version__":
        from importlib.metadata import version

        return version("hitplanes")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)  # read at once from now on
    return value


def __dir__() -> list[str]:
    return __all__
