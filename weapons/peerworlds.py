"""Other libraries, where they are installed, and a scene in each of them as its users would make it."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from planes import fit
from planes.arrays import Floats
from planes.spans import Spans
from weapons.decisions import Curve
from weapons.targets import Target

__all__ = [
    "PYGAME_MOST",
    "absent",
    "hulls_in_pymunk",
    "installed",
    "masks_in_pygame",
    "module_of",
    "pairs",
    "squares_in_shapely",
]

PYGAME_MOST = 2**30
"""Rectangles of pygame hold C ints: places within this, and twice it for a sum."""


def module_of(name: str) -> Any:
    """A module, imported quietly."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    return import_module(name)


def installed(name: str) -> Any:
    """A module, or None where it is not installed."""
    try:
        return module_of(name)
    except ImportError:
        return None


def absent(name: str) -> Curve:
    """What is told of a library that is not there."""
    return Curve(name, left_out=f"{name} is not installed")


def pairs(*columns: Floats) -> list[tuple[tuple[float, ...], ...]]:
    """Rows of points (N, 2) as tuples of tuples: other libraries ask one by one."""
    return list(zip(*([tuple(xy) for xy in column.tolist()] for column in columns), strict=True))


def hulls_in_pymunk(pymunk: Any, targets: list[Target]) -> tuple[Any, dict[Any, int]]:
    """A space with the hull of each mask, and the object of each shape."""
    space, item_of = pymunk.Space(), {}
    for item, mask, corner in targets:
        hull = fit.hull(mask).translated(corner).points
        shape = pymunk.Poly(space.static_body, hull.tolist())
        space.add(shape)
        item_of[shape] = item
    space.step(1)  # builds its index
    return space, item_of


def squares_in_shapely(shapely: Any, targets: list[Target]) -> npt.NDArray[Any]:
    """The pixel squares of each mask as one shape: its rows of runs, joined."""
    shapes = []
    for _, mask, (x, y) in targets:
        runs = Spans.from_mask(mask)
        rows = shapely.box(runs.x_first + x - 0.5, runs.y + y - 0.5, runs.x_last + x + 0.5, runs.y + y + 0.5)
        shapes.append(shapely.union_all(rows))
    return np.array(shapes, object)


def masks_in_pygame(pygame: Any, targets: list[Target]) -> list[tuple[Any, Any]]:
    """A rectangle and a mask for each."""
    world = []
    for _, mask, (x, y) in targets:
        surface = pygame.Surface(mask.shape[::-1], pygame.SRCALPHA, 32)
        alpha = pygame.surfarray.pixels_alpha(surface)
        alpha[:] = np.where(mask.T, 255, 0)
        del alpha  # it locks the surface
        world.append((pygame.Rect(x, y, mask.shape[1], mask.shape[0]), pygame.mask.from_surface(surface)))
    return world
