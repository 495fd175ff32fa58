"""What makes a weapon ready for a scene: the thin path for one shot a call, if there is one for such a weapon."""

from __future__ import annotations

from planes.arrays import InputError
from planes.constants import ALL
from planes.scene import Scene
from weapons.arsenal import has_no_range, ray_parts_of
from weapons.firing import category_bits
from weapons.oneshot import Filter
from weapons.pieces import frame_of
from weapons.ready import Ready, ReadyPattern
from weapons.volley import checked_shots
from weapons.weapon import Weapon

__all__ = ["prepare"]


def prepare(scene: Scene, weapon: Weapon, *, accept: object = ALL, exclude: object = None, seed: object = 0) -> Ready:
    """Make a weapon ready to be fired at a scene one shot a call.

    Parameters
    ----------
    scene : what is fired at; it may change at any time: each shot is of the scene as it is then
    weapon, accept, exclude, seed : those of `fire`, the same for all shots; `exclude` is a number or a list (K,)

    Raises
    ------
    InputError
        Naming the argument.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a Scene, got {type(scene).__name__}")
    toward = (1, 0) if has_no_range(weapon) else None
    shots = checked_shots(weapon, (0, 0), None, toward, category_bits(scene, accept), exclude, seed, None)
    kept = Filter(int(shots.accept[0]), shots.exclude, int(shots.seed[0]))
    parts = ray_parts_of(weapon)
    if parts is not None:
        from weapons.rayways import jumps_at_all
        from weapons.readyray import ReadyRay

        alone = parts[0] is None and parts[1] is None and jumps_at_all(parts[2])
        return ReadyRay(scene, weapon, kept, parts[2]) if alone else Ready(scene, weapon, kept)
    frame = frame_of(weapon)
    return Ready(scene, weapon, kept) if frame is None else ReadyPattern(scene, weapon, kept, frame)
