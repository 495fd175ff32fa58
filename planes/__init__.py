"""The world of a shot: what can be hit, what blocks, and where it is."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planes.arrays import InputError as InputError
    from planes.constants import ALL as ALL
    from planes.history import History as History
    from planes.history import PastScene as PastScene
    from planes.image import read_png as read_png
    from planes.image import write_png as write_png
    from planes.items import Role as Role
    from planes.labels import Planes as Planes
    from planes.loading import load_scene as load_scene
    from planes.scene import Scene as Scene
    from planes.spans import Spans as Spans
    from planes.sprite import Sprite as Sprite
    from planes.twins import use_jit as use_jit
    from planes.twins import use_threads as use_threads

_HOME = {
    "ALL": "constants",
    "History": "history",
    "InputError": "arrays",
    "PastScene": "history",
    "Planes": "labels",
    "Role": "items",
    "Scene": "scene",
    "Spans": "spans",
    "Sprite": "sprite",
    "load_scene": "loading",
    "read_png": "image",
    "use_jit": "twins",
    "use_threads": "twins",
    "write_png": "image",
}

__all__ = [
    "ALL", "History", "InputError", "PastScene", "Planes", "Role", "Scene", "Spans", "Sprite", "load_scene",
    "read_png", "use_jit", "use_threads", "write_png",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import a module when something of it is first used: importing the package costs little."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
