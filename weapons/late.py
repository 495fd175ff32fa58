"""What the core needs only now and then of the rooms below it: each module is imported when it is first read."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from .explain import owners as owners
    from .explain import ray_margins as ray_margins
    from .explain import ray_samples as ray_samples
    from .explain import samples as samples
    from .fire import shelter as shelter
    from .prepared import prepare as prepare
    from .rays import ray_call as ray_call
    from .replay import shot_log as shot_log

_PLACES = {
    "owners": "explain.owners",
    "prepare": "prepared.prepare",
    "ray_call": "rays.ray_call",
    "ray_margins": "explain.ray_margins",
    "ray_samples": "explain.ray_samples",
    "samples": "explain.samples",
    "shelter": "fire.shelter",
    "shot_log": "replay.shot_log",
}


def __getattr__(name: str) -> ModuleType:
    """Import a module, once."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = globals()[name] = import_module(f"{__package__}.{_PLACES[name]}")
    return module
