"""What the core needs only now and then of the rooms below it: each module is imported when it is first read."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from .bits import blockers as blockers
    from .bits import distance_field as distance_field
    from .bits import exits as exits
    from .bits import label_plane as label_plane
    from .bits import shadows as shadows
    from .bits import tiles as tiles
    from .bits import visible as visible
    from .broadphase import boxes as boxes
    from .files import scene_folder as scene_folder
    from .scene import carving as carving
    from .scene import render as render
    from .volumes import fit as fit
    from .volumes import overlap as overlap
    from .volumes import volumes as volumes

_PLACES = (
    "bits.blockers", "bits.distance_field", "bits.exits", "bits.label_plane", "bits.shadows", "bits.tiles",
    "bits.visible", "broadphase.boxes", "files.scene_folder", "scene.carving", "scene.render", "volumes.fit",
    "volumes.overlap", "volumes.volumes",
)  # fmt: skip


def __getattr__(name: str) -> ModuleType:
    """Import a module, once."""
    for place in _PLACES:
        if place.endswith(f".{name}"):
            module = globals()[name] = import_module(f"{__package__}.{place}")
            return module
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
