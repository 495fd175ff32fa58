"""What the core needs only now and then of the rooms below it: each module is imported when it is first read."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

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

_PLACES = {
    "boxes": "broadphase.boxes",
    "carving": "scene.carving",
    "distance_field": "bits.distance_field",
    "fit": "volumes.fit",
    "label_plane": "bits.label_plane",
    "overlap": "volumes.overlap",
    "scene_folder": "files.scene_folder",
    "shadows": "bits.shadows",
    "tiles": "bits.tiles",
    "visible": "bits.visible",
    "volumes": "volumes.volumes",
}


def __getattr__(name: str) -> ModuleType:
    """Import a module, once."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = globals()[name] = import_module(f"{__package__}.{_PLACES[name]}")
    return module
