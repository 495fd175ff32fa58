"""Fire a few shots of patterns: one by one, in Python's own integers, where arrays would take longer to set up.

scene -> stack -> weapon -> patterns -> tiles near placements -> filters -> what they share, front to back -> rows
"""

from __future__ import annotations

import numpy as np

from planes import fronttoback
from planes.arrays import Ints
from planes.bigfront import Ground, Hit, hit_by_few, pays
from planes.bitrows import Found
from planes.cells import met_boxes
from planes.constants import SUB
from planes.items import Stack
from planes.scene import Scene
from planes.twins import kernels_of
from weapons.arsenal import parts_of
from weapons.candidates import may_refuse, refused
from weapons.counting import placed_of, rows_of
from weapons.hits import Rows
from weapons.plan import Plan
from weapons.volley import Shots, Volley, volley_of
from weapons.weapon import Weapon
from weapons.windows import big_of

__all__ = ["accepted", "fired_by_few"]

REACH = 48
"""Reach of a pattern, px: of a larger one arrays are as fast where it hits something."""

PLACEMENTS_MOST, BOXES_MOST = 64, 2**15
"""Placements, and their boxes compared with those of tiles: of more, too many meet, and the comparison was in vain."""


def fired_by_few(scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, placements: int, plan: Plan) -> Rows | None:
    """Rows of what shots without pellets hit; None if they, or what they come near, are too many, or are compiled."""
    plain = parts_of(weapon)[2]
    if kernels_of(fronttoback) is not fronttoback or not 0 < placements <= PLACEMENTS_MOST:
        return None
    if plain.reach_256 > SUB * REACH:
        return None
    tiles = scene.items.tiles()
    if placements * len(tiles) > BOXES_MOST:
        return None
    volley = volley_of(weapon, shots)
    ground = Ground(stack, tiles, tiles.boxes(stack.box_xyxy), plain.pierce, scene.bounds)
    near, box = met_boxes(volley.boxes, ground.boxes_xyxy), volley.table.box_xyxy
    wide, high = (int((box[:, axis + 2] - box[:, axis]).max()) + 1 for axis in (0, 1))
    if not pays(len(near[0]), wide, high):
        return None
    patterns = [big_of(pattern) for pattern in volley.table.patterns]
    plan.run("tiles", "bit rows of the masks", 0 if tiles.whole else ground.boxes_xyxy.nbytes)
    plan.run("patterns", f"{len(patterns)} distinct", volley.nbytes)
    hits = hit_by_few(placed_of(volley), patterns, accepted(near, ground, shots, volley.shot), ground)
    rows = _rows_of(volley, hits, stack)
    plan.run("samples", "counted in integers, front to back: boxes, filters and occluders, too", rows.nbytes)
    return rows


def accepted(near: tuple[Ints, Ints], ground: Ground, shots: Shots, shot: Ints) -> tuple[Ints, Ints]:
    """Pairs of placements and tiles that shots do not refuse.

    Parameters
    ----------
    near : pairs (n,) of a placement and a tile
    shot : (P,) which shot's each placement is
    """
    placement, tile = near
    if not may_refuse(ground.stack, shots):
        return near
    some = (~refused(ground.stack, ground.tiles.rank[tile], shots, shot[placement])).nonzero()[0]
    return placement[some], tile[some]


def _rows_of(volley: Volley, hits: list[Hit], stack: Stack) -> Rows:
    """Rows of hits, which are in order."""
    if not hits:
        return Rows.none()
    placement, distance2, y, x, rank, samples = np.array(hits, np.int64).T
    return rows_of(volley, Found(placement, rank, samples, distance2, x, y), stack.ids)
