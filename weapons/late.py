"""What the core needs only now and then of the rooms below it: each module is imported when it is first read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hitplanes.planes.late import importer

if TYPE_CHECKING:
    from .explain import owners as owners
    from .explain import ray_margins as ray_margins
    from .explain import ray_samples as ray_samples
    from .explain import samples as samples
    from .fire import shelter as shelter
    from .rays import ray_call as ray_call
    from .replay import shot_log as shot_log

__getattr__ = importer(
    globals(), "explain.owners", "rays.ray_call", "explain.ray_margins", "explain.ray_samples", "explain.samples",
    "fire.shelter", "replay.shot_log",
)  # fmt: skip
