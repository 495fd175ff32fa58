"""Methods of a study that are the library's own: `fire` with a weapon, each on its own copy of the scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from planes.scene import Scene
from weapons.decisions import Decisions, Method
from weapons.firing import fire
from weapons.hits import Hits
from weapons.targets import only_hittable
from weapons.weapon import Weapon

__all__ = ["fired_method"]


def fired_method(
    setting: float | str | None, scene: Scene, weapon: Weapon, read: Callable[[Any], Decisions], **arguments: Any
) -> Method:
    """A batch in one call; `arguments` are those of `fire`. Set-up copies the scene; the first run makes the rest."""

    def prepare() -> Callable[[], Hits]:
        own = only_hittable(scene)
        return lambda: fire(own, weapon, **arguments)

    return Method(setting, prepare, read)
