"""The cost models of the ways to answer a call, and the choice of strategy, pre-filter and broad phase."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hitplanes.planes.bits import bit_rows
from hitplanes.planes.bits.label_plane import area
from hitplanes.planes.bits.visible import View
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.common.checks import InputError, choice
from hitplanes.planes.common.limits import STRUCTURES, SUB
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..kinds.weapon import PatternTable
from .prefilter import BOX, Candidates, prefilter_of

STRATEGIES = ("auto", "direct", "composed", "walk", "cast", "march")
BROADPHASES = ("auto", *STRUCTURES)

# Measured with `tests/bench/strategies.py` and `tests/bench/prefilters.py` on one machine; only their ratios matter.
DIRECT_PLACEMENT_NS, DIRECT_PIXEL_NS = 300.0, 20.0
COMPOSED_CALL_NS, COMPOSED_PLACEMENT_NS, COMPOSED_SPAN_NS, COMPOSED_PIXEL_NS = 110_000.0, 300.0, 130.0, 12.0
REDRAW_PIXEL_NS = 0.5
SWEPT_CALL_NS, SWEPT_PAIR_NS, SWEPT_DROPPED_NS = 300_000.0, 350.0, 2100.0
BOX_PAIR_NS, BVH_CALL_NS, BVH_PLACEMENT_NS, BVH_MOVED_NS, BVH_BUILT_NS = 4.5, 80_000.0, 500.0, 250.0, 850.0


class Costs(NamedTuple):
    """What a call counted by bit rows costs, ns.

    `call` to `pair` are what it costs more without a visible set, or without a label plane.
    """

    call: float  # a call without pellets
    read: float  # a call of one-pixel shots
    scattered: float  # a call with pellets
    placement: float  # each placement
    pair: float  # each pair of a placement and an item
    compose: float  # making a visible set
    item: float  # each item of the visible set
    draw: float  # each item drawn into the label plane
    pixel: float  # each pixel of the label plane


IN_NUMPY = Costs(
    call=50_000, read=50_000, scattered=120_000, placement=500, pair=4.0, compose=2_000_000, item=2500, draw=7500,
    pixel=REDRAW_PIXEL_NS,
)  # fmt: skip
COMPILED = Costs(
    call=5000, read=25_000, scattered=190_000, placement=120, pair=0.3, compose=100_000, item=1500, draw=400, pixel=0.05
)
"""Measured with `tests/bench/strategies.py` on one machine; only their ratios matter."""


def chosen_strategy(strategy: str, scene: Scene, stack: Stack, table: PatternTable, placements: int) -> tuple[str, str]:
    """Strategy of a call answered by spans, and why: the one asked for, or the cheaper one by the cost model.

    Raises
    ------
    InputError
        If "composed" is asked for, and the scene has no bounds that fit one plane.
    """
    choice("strategy", strategy, STRATEGIES)
    plane = scene.label_plane()
    if strategy == "composed" and plane is None:
        what = "'composed' of falloff or of patterns beyond 2048 px"
        raise InputError(f"strategy: expected bounds that fit one plane for {what}, got a scene without them")
    if strategy != "auto":
        return strategy, "asked for"
    if plane is None:
        return "direct", "no bounds that fit one plane"
    patterns = max(len(table.count), 1)
    samples = placements * int(table.count.sum()) / patterns
    spans = placements * table.runs / patterns
    composed = COMPOSED_CALL_NS + placements * COMPOSED_PLACEMENT_NS + spans * COMPOSED_SPAN_NS
    composed += samples * COMPOSED_PIXEL_NS + plane.cost(scene.items) * REDRAW_PIXEL_NS
    x, y, x_max, y_max = plane.box_xyxy
    density = area(stack.box_xyxy) / ((x_max - x + 1) * (y_max - y + 1))
    direct = placements * DIRECT_PLACEMENT_NS + min(_box_costs(scene, len(stack), placements))
    direct += samples * density * DIRECT_PIXEL_NS
    name = "composed" if composed < direct else "direct"
    return name, f"about {composed / 1e3:.0f} us composed, {direct / 1e3:.0f} us direct"


def chosen_form(
    strategy: str,
    how: tuple[str, str],
    scene: Scene,
    stack: Stack,
    view: View | None,
    kind: tuple[bool, bool],
    placements: int,
) -> tuple[str, str]:
    """Strategy of a call that is counted by bit rows, and why: the one asked for, or the cheaper by the cost model.

    Parameters
    ----------
    how : pre-filter and broad phase that were asked for; only the direct strategy has them
    view : what all shots accept; None if they accept different items
    kind : whether a shot is one pixel, answered by one read of the label plane; whether the weapon has pellets
    """
    choice("strategy", strategy, STRATEGIES)
    if view is None:
        return "direct", "shots accept different items"
    if strategy != "auto":
        return strategy, "asked for"
    if how != ("auto", "auto"):
        return "direct", "a pre-filter was asked for"
    point, scattered = kind
    plane = scene.label_plane() if point else None
    known = scene.visible_sets()
    if (plane is not None and not plane.cost(scene.items)) or (plane is None and known.kept(view, scene.version)):
        return "composed", "it is there"
    costs = IN_NUMPY if kernels_of(bit_rows) is bit_rows else COMPILED
    lost = placements * (costs.placement + len(stack) * costs.pair)
    lost += costs.read if plane is not None else costs.scattered if scattered else costs.call
    cost = costs.compose + len(stack) * costs.item
    if plane is not None:
        drawn = len(stack) * costs.draw if plane.labels is None else 0
        cost = plane.cost(scene.items) * costs.pixel + drawn
    why = f"about {cost / 1e3:.0f} us to compose, {lost / 1e3:.0f} us more without it"
    return "composed" if known.pays(view, scene.version, lost, cost) else "direct", why


def chosen_candidates(
    prefilter: object, broadphase: object, scene: Scene, stack: Stack, swept: bool, asked: int
) -> Candidates:
    """Pre-filter and broad phase of a call, and why: those asked for, or the cheaper ones by the cost model.

    Parameters
    ----------
    swept : whether capsules pay: see `sweep_pays`
    asked : placements whose near items will be looked up

    Raises
    ------
    InputError
        If a name is unknown, or a broad phase is asked for without a pre-filter.
    """
    wanted = prefilter_of(prefilter)
    structure = choice("broadphase", broadphase, BROADPHASES)
    if wanted.name == "none":
        if structure not in ("auto", "none"):
            raise InputError(f"broadphase: expected 'none' without a pre-filter, got {structure!r}")
        return Candidates(scene.items, stack, wanted, None, "none: every item", "no box is compared")
    if wanted.name == "auto":
        wanted = prefilter_of("swept") if swept else BOX
    text = "box" if wanted == BOX else f"box, then {wanted}"
    if structure == "none":
        return Candidates(scene.items, stack, wanted, None, text)
    if structure == "auto":
        if not asked or not _bvh_pays(scene, len(stack), asked):
            why = "few pairs: every box is compared" if asked else "boxes are compared as samples are counted"
            return Candidates(scene.items, stack, wanted, None, text, why)
        structure = "bvh"
    return Candidates(scene.items, stack, wanted, scene.index(structure), f"{text}, by {structure}")


def sweep_pays(stack: Stack, table: PatternTable, asked: int) -> bool:
    """Whether capsules around long, slanting patterns drop enough of the items that their boxes meet.

    The number of pairs is estimated for items of the mean size, spread evenly over the box around all.

    Parameters
    ----------
    table : patterns of the first shot; those of the others are about alike
    asked : placements whose near items will be looked up
    """
    pattern = table.patterns[0] if table.patterns else None
    if pattern is None or pattern.swept is None or asked * len(stack) * SWEPT_DROPPED_NS < SWEPT_CALL_NS:
        return False
    a, b, radius = pattern.swept
    item_wh, world_wh = stack.sizes
    box_wh = np.minimum((np.abs(b - a) + 2 * radius) / SUB + item_wh, world_wh)
    width = 2 * radius / SUB + float(np.sqrt((item_wh**2).sum()))
    length = float(np.sqrt((((b - a) / SUB) ** 2).sum())) + width
    pairs = asked * len(stack) * float((box_wh / world_wh).prod())
    dropped = pairs * (1 - min(length * width / float(box_wh.prod()), 1))
    return dropped * SWEPT_DROPPED_NS > pairs * SWEPT_PAIR_NS + SWEPT_CALL_NS


def _box_costs(scene: Scene, items: int, placements: int) -> tuple[float, float]:
    """Time to find the boxes that placements meet, ns: one by one, and by a BVH, including its update or build."""
    one_by_one = placements * items * BOX_PAIR_NS
    answer = placements * BVH_PLACEMENT_NS + BVH_CALL_NS
    if answer >= one_by_one:
        return one_by_one, answer
    index = scene.index("bvh")
    return one_by_one, answer + index.owed(scene.items) * (BVH_BUILT_NS if index.boxes is None else BVH_MOVED_NS)


def _bvh_pays(scene: Scene, items: int, placements: int) -> bool:
    """Whether a BVH, including its update, is faster than comparing all boxes.

    A missing BVH is built once it would have saved as much as it costs, so the total is at most twice that of the
    better choice (Karlin et al., "Competitive snoopy caching", 1988).
    """
    one_by_one, by_bvh = _box_costs(scene, items, placements)
    index = scene.index("bvh")
    if one_by_one > by_bvh or index.boxes is not None:
        return one_by_one > by_bvh
    index.missed += max(one_by_one - placements * BVH_PLACEMENT_NS - BVH_CALL_NS, 0)
    return index.missed > items * BVH_BUILT_NS
