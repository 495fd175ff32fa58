"""What a call does and what it leaves out: the cost model that chooses a strategy, and the record of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from planes.arrays import InputError, choice
from planes.compose import area
from planes.items import Role, Stack
from planes.scene import Scene
from weapons.pattern import PatternTable

__all__ = ["STRATEGIES", "Plan", "PlanSum", "Stage", "chosen_strategy", "leave_out_unused", "plan_lines"]

STRATEGIES = ("auto", "direct", "composed")

DIRECT_PLACEMENT_NS, DIRECT_PAIR_NS, DIRECT_PIXEL_NS = 300.0, 5.3, 20.0
COMPOSED_CALL_NS, COMPOSED_PLACEMENT_NS, COMPOSED_SPAN_NS, COMPOSED_PIXEL_NS = 110_000.0, 300.0, 130.0, 12.0
REDRAW_PIXEL_NS = 0.5
"""Measured with `tests/bench/strategies.py` on one machine; the choice hangs on their ratios only."""


@dataclass(frozen=True)
class Stage:
    """A stage that ran, or one that was left out: why, and how many bytes it made."""

    name: str
    why: str
    bytes_made: int = 0


@dataclass
class Plan:
    """Stages of a call in the order in which they ran, and those left out."""

    ran: list[Stage] = field(default_factory=list)
    left_out: list[Stage] = field(default_factory=list)

    def run(self, name: str, why: str, bytes_made: int = 0) -> None:
        """Record a stage that ran; the bytes of its runs for the parts of a batch add up."""
        for i, stage in enumerate(self.ran):
            if stage.name == name:
                self.ran[i] = Stage(name, stage.why, stage.bytes_made + bytes_made)
                return
        self.ran.append(Stage(name, why, bytes_made))

    def has_run(self, name: str) -> bool:
        """Whether a stage ran."""
        return any(stage.name == name for stage in self.ran)

    def leave_out(self, name: str, why: str) -> None:
        """Record that a stage was not needed."""
        self.left_out.append(Stage(name, why))

    def to_dict(self) -> dict[str, list[dict[str, object]]]:
        """The plan as JSON."""
        return {
            "ran": [{"stage": s.name, "why": s.why, "bytes": s.bytes_made} for s in self.ran],
            "left_out": [{"stage": s.name, "why": s.why} for s in self.left_out],
        }


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
                new = {"stage": stage.name, "why": stage.why, "bytes": 0, "calls": 0}
                told = self._sums[ran].setdefault(stage.name, new)
                told["bytes"] += stage.bytes_made
                told["calls"] += 1

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
            lines.append(f"{verb:8} {stage['stage']}{often}{made}: {stage['why']}")
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
    direct = placements * (DIRECT_PLACEMENT_NS + len(stack) * DIRECT_PAIR_NS) + samples * density * DIRECT_PIXEL_NS
    name = "composed" if composed < direct else "direct"
    return name, f"about {composed / 1e3:.0f} us composed, {direct / 1e3:.0f} us direct"


def leave_out_unused(plan: Plan, scene: Scene, stack: Stack, table: PatternTable, why_strategy: str) -> None:
    """Complete a plan with what this scene and this weapon did not need."""
    if table.prefix is None:
        plan.leave_out("weights", "the weapon has no falloff")
    if scene.bounds is None:
        plan.leave_out("outside", "the scene has no bounds")
    if not stack.occluder.any():
        plan.leave_out("occluders", "the scene has none")
    if not plan.has_run("code plane"):
        plan.leave_out("code plane", f"direct: {why_strategy}")
    if not plan.has_run("pre-filter"):
        plan.leave_out("pre-filter", "no sample needed the stack")
    if not plan.has_run("walk"):
        plan.leave_out("walk", "no sample lay where it needed one")
    for role in (Role.BACKGROUND, Role.MOVER, Role.HUD):
        if len(scene.ids(role)):
            plan.leave_out(role.value, "drawn only for a picture")
