"""What a call does and what it leaves out: the record of it, as it is told."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter_ns
from typing import Any

from planes.items import Role, Stack
from planes.scene import Scene
from weapons.candidates import BOX, Candidates
from weapons.pattern import PatternTable

__all__ = [
    "Plan",
    "PlanSum",
    "Stage",
    "leave_out_absent",
    "leave_out_imagery",
    "leave_out_uncounted",
    "leave_out_unused",
    "plan_lines",
    "read_stack",
]

READING = threading.RLock()
"""Held while stages are made of the notes of a plan."""


@dataclass(slots=True)
class Stage:
    """A stage that ran, or one that was left out, and why.

    Parameters
    ----------
    bytes_made : of the arrays that it made and handed on, or keeps; while it works it holds some more
    pairs : of a filter, how many it kept, and of how many
    ns : how long it took; two that differ in it alone are equal
    """

    name: str
    why: str
    bytes_made: int = 0
    pairs: tuple[int, int] | None = None
    ns: int = field(default=0, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """A stage that ran, as JSON."""
        told = {"stage": self.name, "why": self.why, "bytes": self.bytes_made}
        return told if self.pairs is None else {**told, "pairs": list(self.pairs)}


class Plan:
    """Stages of a call in the order in which they ran, and those left out.

    It is a lap timer, started when it is made: the time since the last stage ended is that of the stage which is told
    to have ended now, so the times add up to that of the call. They are in no report: see `timed`.

    While the call runs it only notes what it is told; the stages are made of its notes when they are asked for.
    """

    __slots__ = ("_left_out", "_mark", "_notes", "_ran", "_stage_of")

    def __init__(self) -> None:
        self._notes: list[tuple[Any, ...]] = []
        self._ran: list[Stage] = []
        self._left_out: list[Stage] = []
        self._stage_of: dict[str, Stage] = {}
        self._mark = perf_counter_ns()

    def run(self, name: str, why: str, bytes_made: int = 0, pairs: tuple[int, int] | None = None) -> None:
        """Record that a stage ended; the numbers of its runs, for the parts of a batch or of the work, add up.

        Why it ran is told once.
        """
        self._notes.append((name, why, bytes_made, pairs, perf_counter_ns()))

    def leave_out(self, name: str, why: str) -> None:
        """Record that a stage was not needed; nothing of one that ran, or of which that is known."""
        self._notes.append((name, why))

    def leave_out_all(self, told: Callable[..., Iterable[tuple[str, str]]], *of: object) -> None:
        """Record stages that were not needed: a function tells their names, each with why, when they are asked for.

        What it tells them of must not change until then.
        """
        self._notes.append((told, of))

    @property
    def ran(self) -> list[Stage]:
        """Stages that ran."""
        self._read()
        return self._ran

    @property
    def left_out(self) -> list[Stage]:
        """Stages that were not needed."""
        self._read()
        return self._left_out

    def _read(self) -> None:
        """Make stages of the notes, each once, also if threads ask for them at the same time."""
        with READING:
            for name, why, *numbers in self._notes:
                if numbers:
                    bytes_made, pairs, now = numbers
                    self._add(Stage(name, why, bytes_made, pairs, now - self._mark))
                    self._mark = now
                    continue
                for left_out in name(*why) if callable(name) else ((name, why),):
                    self._leave_out(*left_out)
            self._notes.clear()

    def _leave_out(self, name: str, why: str) -> None:
        if name not in self._stage_of and name not in (stage.name for stage in self._left_out):
            self._left_out.append(Stage(name, why))

    def _add(self, stage: Stage) -> None:
        """Count a stage, or what it did once more."""
        known = self._stage_of.setdefault(stage.name, stage)
        if known is stage:
            self._ran.append(stage)
            return
        known.why = known.why or stage.why
        known.bytes_made += stage.bytes_made
        known.ns += stage.ns
        if stage.pairs:
            known.pairs = added(known.pairs, stage.pairs)

    @classmethod
    def joined(cls, plans: Sequence[Plan]) -> Plan:
        """What ran in one or more that followed each other, added up; what the first left out."""
        plan = cls()
        for stage in (stage for one in plans for stage in one.ran):
            plan._add(replace(stage))
        plan._left_out, plan._mark = list(plans[0].left_out), plans[-1]._mark
        return plan

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Plan):
            return NotImplemented
        return self.ran == other.ran and self.left_out == other.left_out

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Plan(ran={self.ran}, left_out={self.left_out})"

    @property
    def ns(self) -> int:
        """How long the call took, from its first stage to the end of its last."""
        return sum(stage.ns for stage in self.ran)

    def has_run(self, name: str) -> bool:
        """Whether a stage ran; no stages are made for that."""
        return any(note[0] == name and len(note) > 2 for note in self._notes) or name in self._stage_of

    def has_left_out(self, name: str) -> bool:
        """Whether a stage was left out."""
        return any(stage.name == name for stage in self.left_out)

    def to_dict(self) -> dict[str, list[dict[str, object]]]:
        """The plan as JSON."""
        return {
            "ran": [stage.to_dict() for stage in self.ran],
            "left_out": [{"stage": s.name, "why": s.why} for s in self.left_out],
        }

    def timed(self) -> dict[str, list[dict[str, object]]]:
        """The plan as JSON, with the `ns` that each stage took: never twice the same."""
        return {**self.to_dict(), "ran": [{**stage.to_dict(), "ns": stage.ns} for stage in self.ran]}


def added(a: Sequence[int] | None, b: Sequence[int] | None) -> tuple[int, int] | None:
    """Sum of two counts of pairs, of which either may be missing."""
    known = [pairs for pairs in (a, b) if pairs]
    return (sum(kept for kept, _ in known), sum(of for _, of in known)) if known else None


class PlanSum:
    """What many calls did, added up: how often each stage ran or was left out, its bytes and time, and why at first."""

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
                    self._sums[ran][stage.name] = {**stage.to_dict(), "ns": stage.ns, "calls": 1}
                    continue
                told["bytes"] += stage.bytes_made
                told["ns"] += stage.ns
                told["calls"] += 1
                if pairs := added(told.get("pairs"), stage.pairs):
                    told["pairs"] = list(pairs)

    def timed(self) -> dict[str, list[dict[str, Any]]]:
        """As `Plan.timed`, and with each stage in how many `calls` it was so."""
        return {"ran": list(self._sums[True].values()), "left_out": list(self._sums[False].values())}


def plan_lines(plan: Mapping[str, Sequence[Mapping[str, Any]]], calls: int = 1) -> list[str]:
    """Lines of a table that tells a timed plan, given as JSON, to a reader: what each stage cost, what was left out."""
    ran = plan["ran"]
    rows = [("stage", "time", "bytes", "why")]
    rows += [(s["stage"], _microseconds(s["ns"]), f"{s['bytes']:,}", _why(s, calls)) for s in ran]
    whole = f"{calls} calls" if calls != 1 else ""
    rows.append(("all", _microseconds(sum(s["ns"] for s in ran)), f"{sum(s['bytes'] for s in ran):,}", whole))
    rows += [(s["stage"], "left out", "", _why(s, calls)) for s in plan["left_out"]]
    name, time, made = (max(len(row[column]) for row in rows) for column in range(3))
    return [f"{row[0]:{name}}  {row[1]:>{time}}  {row[2]:>{made}}  {row[3]}".rstrip() for row in rows]


def _microseconds(ns: int) -> str:
    return f"{ns / 1e3:,.1f} us"


def _why(stage: Mapping[str, Any], calls: int) -> str:
    """Why a stage ran or not, in how many of the calls, and what a filter left."""
    often = f"{stage['calls']} of {calls} calls: " if calls != 1 else ""
    kept, of = stage.get("pairs", (0, 0))
    return f"{often}{stage['why']}" + (f"; {kept:,} of {of:,} pairs left" if of else "")


def read_stack(scene: Scene, plan: Plan) -> Stack:
    """Items that decide, front to back; the plan is told whether they had to be put in order."""
    kept = scene.items.has_stack
    stack = scene.items.stack()
    told = "as they were" if kept else "put in order, front to back"
    plan.run("stack", f"{len(stack)} items, {told}", 0 if kept else stack.nbytes)
    return stack


def leave_out_unused(
    plan: Plan, scene: Scene, candidates: Candidates, table: PatternTable, choosy: bool, why_strategy: str
) -> None:
    """Complete a plan with what this scene and this weapon did not need."""
    idle = "no sample needed the stack"
    plan.leave_out("broad phase", candidates.why_unindexed if candidates.index is None else idle)
    if not candidates.prefilter.volume:
        plan.leave_out("volumes", "boxes are the pre-filter" if candidates.prefilter == BOX else "no pre-filter")
    elif not plan.has_run("pre-filter"):
        plan.leave_out("volumes", idle)
    leave_out_absent(plan, scene, candidates.stack, weighted=table.prefix is not None, choosy=choosy)
    for name in ("filter", "occluders"):
        plan.leave_out(name, idle)
    plan.leave_out("code plane", f"direct: {why_strategy}")
    plan.leave_out("pre-filter", idle)
    plan.leave_out("walk", "no sample lay where it needed one")
    leave_out_imagery(plan, scene)


def leave_out_uncounted(plan: Plan, scene: Scene, candidates: Candidates, choosy: bool, name: str, why: str) -> None:
    """Complete a plan of a call that was counted by bit rows with what it did not need."""
    bounded = scene.bounds is not None
    plan.leave_out_all(_uncounted, candidates, bounded, choosy, name == "composed", why, scene.items.imagery())


def _uncounted(
    candidates: Candidates, bounded: bool, choosy: bool, composed: bool, why: str, imagery: Sequence[Role]
) -> Iterator[tuple[str, str]]:
    yield "broad phase", "composed: cells" if composed else candidates.why_unindexed
    yield "volumes", "boxes are the pre-filter" if candidates.prefilter == BOX else "no pre-filter"
    yield from _absent(candidates.stack, False, bounded, choosy)
    yield "verdicts", "counted when asked for"
    if not composed:
        yield "composition", f"direct: {why}"
    yield from _undrawn(imagery)


def leave_out_absent(plan: Plan, scene: Scene, stack: Stack, weighted: bool, choosy: bool) -> None:
    """Record what neither the shots nor the scene have."""
    plan.leave_out_all(_absent, stack, weighted, scene.bounds is not None, choosy)


def _absent(stack: Stack, weighted: bool, bounded: bool, choosy: bool) -> Iterator[tuple[str, str]]:
    there = weighted, bounded, stack.has_occluders, stack.layered, choosy
    return (told for told, present in zip(ABSENT, there, strict=True) if not present)


ABSENT = (
    ("weights", "the weapon has no falloff"),
    ("outside", "the scene has no bounds"),
    ("occluders", "the scene has none"),
    ("layers", "all items lie on one"),
    ("filter", "all is accepted, and nobody excluded"),
)


def leave_out_imagery(plan: Plan, scene: Scene) -> None:
    """Record the roles that decide nothing."""
    plan.leave_out_all(_undrawn, scene.items.imagery())


def _undrawn(imagery: Sequence[Role]) -> Iterator[tuple[str, str]]:
    return ((role.value, "drawn only for a picture") for role in imagery)
