"""What the core needs only now and then of the rooms below it: each module is imported when it is first read."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bits import distance_field as distance_field
    from .bits import label_plane as label_plane
    from .bits import shadows as shadows
    from .bits import tiles as tiles
    from .bits import visible as visible
    from .broadphase import boxes as boxes
    from .files import scene_folder as scene_folder
    from .scene import carving as carving
    from .volumes import fit as fit
    from .volumes import overlap as overlap
    from .volumes import volumes as volumes


def importer(here: dict[str, Any], *places: str) -> Callable[[str], ModuleType]:
    """Function that imports a module of a package, once; `here` are the globals of the module that names them all."""
    known = {place.rpartition(".")[2]: place for place in places}

    def read(name: str) -> ModuleType:
        if name not in known:
            raise AttributeError(f"module {here['__name__']!r} has no attribute {name!r}")
        module = import_module(f"{here['__package__']}.{known[name]}")
        here[name] = module
        return module

    return read


__getattr__ = importer(
    globals(), "broadphase.boxes", "scene.carving", "bits.distance_field", "volumes.fit", "bits.label_plane",
    "volumes.overlap", "files.scene_folder", "bits.shadows", "bits.tiles", "bits.visible", "volumes.volumes",
)  # fmt: skip
