"""What is derived from a scene and kept with it, and the base of all of it.

Items count their changes by kind. Each derived thing compares the number of its kind, and is stale when that differs:

| number of `Items` | changes with | what it makes stale |
| --- | --- | --- |
| `version` | every change | the stack; planes and indexes, which follow the journal from there |
| `decided` | changes of items that decide hits | visible sets |
| `arrangement` | all but places, velocities and costs | the columns of the stack, its tiles, roles that are drawn |

Items keep what depends on nothing else: the stack and its tiles. What depends on bounds or shots hangs on `Derived`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from .. import late
from ..common.backend import LruCache
from ..common.checks import Bools, choice
from ..common.limits import EVERYTHING, STRUCTURES
from ..grid.spans import Box

if TYPE_CHECKING:
    from ..bits.blockers import Covers
    from ..bits.distance_field import DistanceField
    from ..bits.label_plane import LabelPlane
    from ..bits.tiles import TileAtlas
    from ..bits.visible import Visible
    from ..broadphase.boxes import Index
    from ..volumes.fit import Bounds
    from .items import Change, Items, Stack

Made = TypeVar("Made")

NEVER = -1  # a version before all others
VIEWS_MOST = 8  # most visible sets of a scene, one for each view
PLANES_BYTES = 2**26  # most memory of the label planes and distance fields of a scene; a larger one is kept alone
PIXEL_BYTES = 5  # of a label and a distance, at most
ASKED_MOST = 64  # most things of a scene that are known to have been asked for
AGAIN_MOST = 8  # most things of a scene that are made when they are asked for a second time


class View(NamedTuple):
    """What shots see.

    Parameters
    ----------
    pierce : whether they go on through objects
    meets : the filter of items that they meet
    exclude : the owners whose items they skip
    of_occluders : whether the occluders that they meet are asked for, not the objects
    """

    pierce: bool
    meets: int
    exclude: tuple[int, ...]
    of_occluders: bool = False

    def may_refuse(self, stack: Stack) -> bool:
        """Whether such shots may refuse an item of a stack."""
        return self.meets != EVERYTHING or bool(self.exclude) or stack.has_unmet

    def accepts(self, stack: Stack) -> Bools:
        """Which items (M,) of a stack such shots accept."""
        there = (stack.categories & self.meets) != 0
        for owner in self.exclude:
            there &= stack.owner != owner
        return np.asarray(there)


OF_ALL = View(False, EVERYTHING, ()), View(True, EVERYTHING, ())
"""Views of shots that accept everything: without and with pierce."""


@dataclass
class ByMask:
    """What is derived from masks alone, by their numbers; the moments of a scene share it."""

    tiles: TileAtlas | None = None
    covers: Covers | None = None
    bounds: dict[str, Bounds] = field(default_factory=dict)


class Derivative:
    """Something derived from the items of a scene, made when calls have lost as much time without it as it takes.

    Threads may read it as long as none changes the scene. `regret` is the time that calls have lost for want of it, ns.
    """

    def __init__(self) -> None:
        self.regret = 0.0  # begins anew when the thing is made, or goes stale
        self._seen = NEVER
        self._lock = threading.RLock()

    def worth_building(self, lost: float, cost: float) -> bool:
        """Count the time that a call loses; whether all of it is more than what the thing costs to make.

        So the total is at most twice that of the better choice (Karlin et al., "Competitive snoopy caching", 1988).
        """
        with self._lock:
            self.regret += max(lost, 0.0)
            return self.regret > cost

    def _unseen(self, items: Items) -> list[Change] | None:
        """Changes since the last call, the last first; None if they are forgotten."""
        changes, self._seen = items.changes(self._seen), items.version
        return changes


class Derived:
    """All that is derived from the items of a scene within its bounds, if any; each is made when first asked for."""

    def __init__(self, bounds: Box | None) -> None:
        self._bounds = bounds
        self._visible: LruCache[View, Visible] = LruCache(VIEWS_MOST, lambda _: 1)
        self._planes: LruCache[View, LabelPlane] = LruCache(PLANES_BYTES, lambda plane: PIXEL_BYTES * plane.size)
        self._fields: LruCache[View, DistanceField] = LruCache(
            PLANES_BYTES, lambda field: PIXEL_BYTES * field.labels.size
        )
        self._indexes: dict[str, Index] = {}
        self._asked: LruCache[Hashable, list[Hashable]] = LruCache(ASKED_MOST, lambda _: 1)
        self._again: LruCache[Hashable, list[Any]] = LruCache(AGAIN_MOST, lambda _: 1)

    def when_asked_again(self, key: Hashable, make: Callable[[], Made]) -> Made | None:
        """What `make` makes, kept for a key; None the first time that it is asked for, which may be the last."""
        kept: list[Made] = self._again.get(key, list)
        if not kept:
            asked = self._asked.get(key, list)
            if not asked:
                asked.append(key)
                return None
            kept.append(make())
        return kept[0]

    def visible(self, view: View) -> Visible:
        """What is visible of the objects for shots of a view; those of the last few views are kept."""
        return self._visible.get(view, lambda: late.visible.Visible(view, self._bounds))

    def label_plane(self, view: View = OF_ALL[False]) -> LabelPlane | None:
        """The label plane of what a view accepts; None if the scene has no bounds, or too large ones."""
        bounds = self._bounds
        if bounds is None or not late.label_plane.plane_fits(bounds):
            return None
        return self._planes.get(view, lambda: late.label_plane.LabelPlane(bounds, view))

    def distance_field(self, view: View = OF_ALL[False]) -> DistanceField | None:
        """The distance field by which rays of a view march; None if there is no label plane."""
        labels = self.label_plane(view)
        if labels is None:
            return None
        return self._fields.get(view, lambda: late.distance_field.DistanceField(labels))

    def index(self, structure: str) -> Index:
        """The broad phase of the items that decide hits: "none", "grid", "quadtree" or "bvh"."""
        if choice("structure", structure, tuple(STRUCTURES)) not in self._indexes:
            self._indexes[structure] = late.boxes.Index(structure)
        return self._indexes[structure]
