"""What the core needs only now and then of the rooms below it: each module is imported when it is first read."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from .explain import margins as margins
    from .explain import owners as owners
    from .explain import ray_samples as ray_samples
    from .explain import ray_verdicts as ray_verdicts
    from .explain import samples as samples
    from .fire import shelter as shelter
    from .fire import spans as spans
    from .fire import verdicts as verdicts
    from .kinds import draws as draws
    from .prepared import prepare as prepare
    from .rays import one_ray as one_ray
    from .rays import ray_call as ray_call
    from .replay import shot_log as shot_log

_PLACES = (
    "explain.margins", "explain.owners", "explain.ray_samples", "explain.ray_verdicts", "explain.samples",
    "fire.shelter", "fire.spans", "fire.verdicts", "kinds.draws", "prepared.prepare", "rays.one_ray", "rays.ray_call",
    "replay.shot_log",
)  # fmt: skip


def __getattr__(name: str) -> ModuleType:
    """Import a module, once."""
    for place in _PLACES:
        if place.endswith(f".{name}"):
            module = globals()[name] = import_module(f"{__package__}.{place}")
            return module
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
