"""A shot at the past beside the present: what has moved since, and what the same shot would hit now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from planes.arrays import InputError
from planes.history import PastScene
from planes.scene import Scene
from planes.spans import Box, Spans, meets
from weapons.firing import fired as fire_checked
from weapons.hits import Hits
from weapons.rayfacts import item_told

__all__ = ["present_of"]

MOVED_MAX = 200
"""Objects told of as moved; a scene where more did is too full to read."""


def present_of(then: Scene, now: Scene, fired: Sequence[Hits], view_xyxy: Box) -> dict[str, Any]:
    """Tell, as JSON, how a scene of the past differs from the present.

    Parameters
    ----------
    then, now : the scene that was fired at, and as it is
    fired : hits of the past
    view_xyxy : items that were or are in this box are told

    Returns
    -------
    "tick", the present "hash", items that "moved" (with their present pixels as runs, and the middles of their boxes),
    those that are "gone" or "new", and what each of the "shots" hits now (null if it would start in something, which is
    an error for its weapon)
    """
    if not isinstance(now, Scene):
        raise InputError(f"now: expected a Scene, got {type(now).__name__}")
    before, after = then.items.stack(), now.items.stack()
    was = {item: rank for rank, item in enumerate(before.ids.tolist())}
    is_now = {item: rank for rank, item in enumerate(after.ids.tolist())}
    moved: list[dict[str, Any]] = []
    for item in sorted(was.keys() & is_now.keys()):
        old, new = before.box_xyxy[was[item]], after.box_xyxy[is_now[item]]
        if len(moved) == MOVED_MAX:
            break
        mask, corner = now.mask(item)
        same = np.array_equal(old, new) and np.array_equal(before.mask(was[item]), mask)
        if same or not meets(np.array(view_xyxy), np.stack([old, new])).any():
            continue
        moved.append(
            {
                **item_told(now, item),
                "runs": Spans.from_mask(mask, corner).runs().tolist(),
                "from_xy": ((old[:2] + old[2:]) / 2).tolist(),
                "to_xy": ((new[:2] + new[2:]) / 2).tolist(),
            }
        )
    return {
        "tick": then.tick if isinstance(then, PastScene) else None,
        "hash": now.content_hash(),
        "moved": moved,
        "gone": [item_told(then, item) for item in sorted(was.keys() - is_now.keys())],
        "new": [item_told(now, item) for item in sorted(is_now.keys() - was.keys())],
        "shots": [_again(now, hits, shot) for hits in fired for shot in range(len(hits.shots))],
    }


def _again(now: Scene, hits: Hits, shot: int) -> list[dict[str, Any]] | None:
    """What a shot hits now; None if it would start in something, and its weapon refuses to."""
    try:
        found = fire_checked(now, hits.weapon, hits.shots.take(shot, shot + 1), "auto", "auto", "auto")
    except InputError:
        return None
    return [{**item_told(now, row.object), "pixels": row.pixels} for row in found]
