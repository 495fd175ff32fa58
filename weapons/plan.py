"""What a call does and what it leaves out: the cost model that chooses a strategy, and the record of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planes.arrays import InputError, choice
from planes.compose import area
from planes.constants import SUB
from planes.index import STRUCTURES
from planes.items import Role, Stack
from planes.scene import Scene
from weapons.candidates import BOX, Candidates, prefilter_of
from weapons.pattern import PatternTable

__all__ = [
    "BROADPHASES",
    "STRATEGIES",
    "Plan",
    "PlanSum",
    "Stage",
    "chosen_candidates",
    "chosen_strategy",
    "leave_out_absent",
    "leave_out_imagery",
    "leave_out_unused",
    "plan_lines",
    "sweep_pays",
]

STRATEGIES = ("auto", "direct", "composed")
BROADPHASES = ("auto", *STRUCTURES)

DIRECT_PLACEMENT_NS, DIRECT_PIXEL_NS = 300.0, 20.0
COMPOSED_CALL_NS, COMPOSED_PLACEMENT_NS, COMPOSED_SPAN_NS, COMPOSED_PIXEL_NS = 110_000.0, 300.0, 130.0, 12.0
REDRAW_PIXEL_NS = 0.5
SWEPT_CALL_NS, SWEPT_PAIR_NS, SWEPT_DROPPED_NS = 300_000.0, 350.0, 2100.0
BOX_PAIR_NS, BVH_CALL_NS, BVH_PLACEMENT_NS, BVH_MOVED_NS, BVH_BUILT_NS = 4.5, 80_000.0, 500.0, 250.0, 850.0
"""Measured with `tests/bench/strategies.py` and `tests/bench/prefilters.py` on one machine; the choice hangs on their
ratios only."""


@dataclass(frozen=True)
class Stage:
    """A stage that ran, or one that was left out: why, how many bytes it made, and of a filter (kept, of how many)."""

    name: str
    why: str
    bytes_made: int = 0
    pairs: tuple[int, int] | None = None

    def to_dict(self) -> dict[str, Any]:
        """A stage that ran, as JSON."""
        told = {"stage": self.name, "why": self.why, "bytes": self.bytes_made}
        return told if self.pairs is None else {**told, "pairs": list(self.pairs)}


@dataclass
class Plan:
    """Stages of a call in the order in which they ran, and those left out."""

    ran: list[Stage] = field(default_factory=list)
    left_out: list[Stage] = field(default_factory=list)

    def run(self, name: str, why: str, bytes_made: int = 0, pairs: tuple[int, int] | None = None) -> None:
        """Record a stage that ran; the numbers of its runs for the parts of a batch add up."""
        for i, stage in enumerate(self.ran):
            if stage.name == name:
                self.ran[i] = Stage(name, stage.why, stage.bytes_made + bytes_made, added(stage.pairs, pairs))
                return
        self.ran.append(Stage(name, why, bytes_made, pairs))

    @classmethod
    def joined(cls, plans: Sequence[Plan]) -> Plan:
        """What ran in one or more, added up; what the first left out."""
        plan = cls(left_out=list(plans[0].left_out))
        for stage in (stage for one in plans for stage in one.ran):
            plan.run(stage.name, stage.why, stage.bytes_made, stage.pairs)
        return plan

    def has_run(self, name: str) -> bool:
        """Whether a stage ran."""
        return any(stage.name == name for stage in self.ran)

    def leave_out(self, name: str, why: str) -> None:
        """Record that a stage was not needed."""
        self.left_out.append(Stage(name, why))

    def to_dict(self) -> dict[str, list[dict[str, object]]]:
        """The plan as JSON."""
        return {
            "ran": [stage.to_dict() for stage in self.ran],
            "left_out": [{"stage": s.name, "why": s.why} for s in self.left_out],
        }


def added(a: tuple[int, int] | None, b: tuple[int, int] | None) -> tuple[int, int] | None:
    """Sum of two counts of pairs, of which either may be missing."""
    return (a[0] + b[0], a[1] + b[1]) if a and b else a or b


class PlanSum:
    """What many calls did, added up: how often each stage ran or was left out, its bytes, and why it first was so."""

    def __init__(self) -> None:
        self.calls = 0
        self._sums: dict[bool, dict[str, dict[str, Any]]] = {True: {}, False: {}}

    def add(self, plan: Plan) -> None:
        """Count the plan of one call."""
        self.calls += 1
        for ran, stages in ((True, plan.ran), (False, plan.left_out)):
            for stage in stages:
                told = self._sums[ran].get(stage.name)
                if told is None:
                    self._sums[ran][stage.name] = {**stage.to_dict(), "calls": 1}
                    continue
                told["bytes"] += stage.bytes_made
                told["calls"] += 1
                if stage.pairs:
                    told["pairs"] = [a + b for a, b in zip(told["pairs"], stage.pairs, strict=True)]

    def to_dict(self) -> dict[str, list[dict[str, Any]]]:
        """As `Plan.to_dict`, and with each stage in how many `calls` it was so."""
        return {"ran": list(self._sums[True].values()), "left_out": list(self._sums[False].values())}


def plan_lines(plan: Mapping[str, Sequence[Mapping[str, Any]]], calls: int = 1) -> list[str]:
    """Lines that tell a plan, given as JSON, to a reader: what ran, what was left out, and why."""
    lines = []
    for key, verb in (("ran", "ran"), ("left_out", "left out")):
        for stage in plan[key]:
            often = "" if calls == 1 else f", {stage['calls']} of {calls} calls"
            made = f", {stage['bytes']:,} bytes" if stage.get("bytes") else ""
            kept, of = stage.get("pairs", (0, 0))
            left = f", {kept:,} of {of:,} pairs left" if of else ""
            lines.append(f"{verb:8} {stage['stage']}{often}{left}{made}: {stage['why']}")
    return lines


def chosen_strategy(strategy: str, scene: Scene, stack: Stack, table: PatternTable, placements: int) -> tuple[str, str]:
    """Strategy of a call and why: the one asked for, or the cheaper by the cost model.

    Raises
    ------
    InputError
        If the composed strategy is asked for where no whole plane can be made.
    """
    choice("strategy", strategy, STRATEGIES)
    plane = scene.code_plane()
    if strategy == "composed" and plane is None:
        raise InputError("strategy: expected bounds that fit one plane for 'composed', got a scene without them")
    if strategy != "auto":
        return strategy, "asked for"
    if plane is None:
        return "direct", "no bounds that fit one plane"
    patterns = max(len(table.count), 1)
    samples = placements * int(table.count.sum()) / patterns
    spans = placements * len(table.y) / patterns
    composed = COMPOSED_CALL_NS + placements * COMPOSED_PLACEMENT_NS + spans * COMPOSED_SPAN_NS
    composed += samples * COMPOSED_PIXEL_NS + plane.cost(scene.items) * REDRAW_PIXEL_NS
    x, y, x_max, y_max = plane.box_xyxy
    density = area(stack.box_xyxy) / ((x_max - x + 1) * (y_max - y + 1))
    direct = placements * DIRECT_PLACEMENT_NS + min(_box_costs(scene, len(stack), placements))
    direct += samples * density * DIRECT_PIXEL_NS
    name = "composed" if composed < direct else "direct"
    return name, f"about {composed / 1e3:.0f} us composed, {direct / 1e3:.0f} us direct"


def chosen_candidates(
    prefilter: object, broadphase: object, scene: Scene, stack: Stack, swept: bool, asked: int
) -> Candidates:
    """Pre-filter and broad phase of a call, and why: those asked for, or the cheaper ones by the cost model.

    Parameters
    ----------
    swept : whether capsules pay, as `sweep_pays` tells
    asked : placements that will be asked for

    Raises
    ------
    InputError
        If one is not known, or boxes are asked for in a broad phase and not as a pre-filter.
    """
    wanted = prefilter_of(prefilter)
    structure = choice("broadphase", broadphase, BROADPHASES)
    if wanted.name == "none":
        if structure not in ("auto", "none"):
            raise InputError(f"broadphase: expected 'none' without a pre-filter, got {structure!r}")
        return Candidates(scene.items, stack, wanted, None, "none: every item", "no box is compared")
    if wanted.name == "auto":
        wanted = prefilter_of("swept") if swept else BOX
    told = "box" if wanted == BOX else f"box, then {wanted}"
    if structure == "none":
        return Candidates(scene.items, stack, wanted, None, told)
    if structure == "auto":
        if not _bvh_pays(scene, len(stack), asked):
            return Candidates(scene.items, stack, wanted, None, told, "few pairs: every box is compared")
        structure = "bvh"
    return Candidates(scene.items, stack, wanted, scene.index(structure), f"{told}, by {structure}")


def sweep_pays(stack: Stack, table: PatternTable, asked: int) -> bool:
    """Whether capsules around long, slanting patterns drop enough of what their boxes meet.

    Expected pairs are those of items of the mean size, spread evenly over the box around all.

    Parameters
    ----------
    table : patterns of the first shot; the others' are about alike
    asked : placements that will be asked for
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
    """Nanoseconds to find the boxes that placements meet: one by one, and by a BVH that is there or must be made."""
    one_by_one = placements * items * BOX_PAIR_NS
    answer = placements * BVH_PLACEMENT_NS + BVH_CALL_NS
    if answer >= one_by_one:
        return one_by_one, answer
    index = scene.index("bvh")
    return one_by_one, answer + index.owed(scene.items) * (BVH_BUILT_NS if index.boxes is None else BVH_MOVED_NS)


def _bvh_pays(scene: Scene, items: int, placements: int) -> bool:
    """Whether a BVH answers sooner than all boxes one by one, with what it costs to bring it up to date.

    One that is not there is made when what it would have saved so far is as much as it costs: never more than twice
    the cost of the better choice (Karlin et al., "Competitive snoopy caching", 1988).
    """
    one_by_one, by_bvh = _box_costs(scene, items, placements)
    index = scene.index("bvh")
    if one_by_one > by_bvh or index.boxes is not None:
        return one_by_one > by_bvh
    index.missed += max(one_by_one - placements * BVH_PLACEMENT_NS - BVH_CALL_NS, 0)
    return index.missed > items * BVH_BUILT_NS


def leave_out_unused(plan: Plan, scene: Scene, candidates: Candidates, table: PatternTable, why_strategy: str) -> None:
    """Complete a plan with what this scene and this weapon did not need."""
    idle = "no sample needed the stack"
    if not plan.has_run("broad phase"):
        plan.leave_out("broad phase", candidates.why_unindexed if candidates.index is None else idle)
    if not candidates.prefilter.volume:
        plan.leave_out("volumes", "boxes are the pre-filter" if candidates.prefilter == BOX else "no pre-filter")
    elif not plan.has_run("pre-filter"):
        plan.leave_out("volumes", idle)
    leave_out_absent(plan, scene, candidates.stack, weighted=table.prefix is not None)
    if not plan.has_run("code plane"):
        plan.leave_out("code plane", f"direct: {why_strategy}")
    if not plan.has_run("pre-filter"):
        plan.leave_out("pre-filter", idle)
    if not plan.has_run("walk"):
        plan.leave_out("walk", "no sample lay where it needed one")
    leave_out_imagery(plan, scene)


def leave_out_absent(plan: Plan, scene: Scene, stack: Stack, weighted: bool) -> None:
    """Record what neither the weapon nor the scene has."""
    if not weighted:
        plan.leave_out("weights", "the weapon has no falloff")
    if scene.bounds is None:
        plan.leave_out("outside", "the scene has no bounds")
    if not stack.occluder.any():
        plan.leave_out("occluders", "the scene has none")


def leave_out_imagery(plan: Plan, scene: Scene) -> None:
    """Record the roles that decide nothing."""
    for role in (Role.BACKGROUND, Role.MOVER, Role.HUD):
        if len(scene.ids(role)):
            plan.leave_out(role.value, "drawn only for a picture")
