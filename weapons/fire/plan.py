"""The plan: a record of the stages that a call ran, with bytes and times, and of those that it left out."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter_ns
from typing import Any

from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from ..kinds.areas import is_directed
from ..kinds.weapon import Weapon

READING = threading.RLock()
"""Lock, held while the notes of a plan are turned into stages."""


@dataclass(slots=True)
class Stage:
    """A stage that ran or was left out, and why.

    Parameters
    ----------
    bytes_made : bytes of the arrays that it returned or keeps; temporary arrays do not count
    pairs : for a filter, the number of pairs that it kept, and that it was given
    ns : how long it took; it is not compared
    """

    name: str
    why: str
    bytes_made: int = 0
    pairs: tuple[int, int] | None = None
    ns: int = field(default=0, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """A stage that ran, as JSON."""
        record = {"stage": self.name, "why": self.why, "bytes": self.bytes_made}
        return record if self.pairs is None else {**record, "pairs": list(self.pairs)}

    def add(self, other: Stage) -> None:
        """Add the numbers of the same stage, which ran again; the first reason that was given is kept."""
        self.why = self.why or other.why
        self.bytes_made += other.bytes_made
        self.ns += other.ns
        if other.pairs:
            kept, of = self.pairs or (0, 0)
            self.pairs = kept + other.pairs[0], of + other.pairs[1]


class Plan:
    """Stages of a call in the order in which they ran, and those left out; `print(hits.plan)` prints them as a table.

    It is a lap timer, started when it is made: a stage takes the time since the previous one ended, so the times add
    up to that of the call. Reports leave the times out: see `timed`. During the call only notes are taken; they become
    stages when these are read.
    """

    __slots__ = ("_left_out", "_mark", "_notes", "_ran", "_stage_of")

    def __init__(self) -> None:
        self._notes: list[tuple[Any, ...]] = []
        self._ran: list[Stage] = []
        self._left_out: list[Stage] = []
        self._stage_of: dict[str, Stage] = {}
        self._mark = perf_counter_ns()

    def __getstate__(self) -> tuple[None, dict[str, Any]]:
        """What a copy is made of: the stages, as notes may hold the scene."""
        self._read()
        return None, {name: getattr(self, name) for name in self.__slots__}

    def run(self, name: str, why: str, bytes_made: int = 0, pairs: tuple[int, int] | None = None) -> None:
        """Record that a stage ended; if it runs several times, its numbers add up, and the first `why` is kept."""
        self._notes.append((name, why, bytes_made, pairs, perf_counter_ns()))

    def leave_out(self, name: str, why: str) -> None:
        """Record that a stage was left out, unless it ran or is recorded already."""
        self._notes.append((name, why))

    def leave_out_all(self, stages: Callable[..., Iterable[tuple[str, str]]], *of: object) -> None:
        """Record stages that were left out, by a function that yields (name, why); it is called when they are read.

        Its arguments `of` must not change until then.
        """
        self._notes.append((stages, of))

    @property
    def ran(self) -> list[Stage]:
        """Stages that ran."""
        self._read()
        return self._ran

    @property
    def left_out(self) -> list[Stage]:
        """Stages that were left out."""
        self._read()
        return self._left_out

    def _read(self) -> None:
        """Turn the notes into stages, once, also if several threads ask for them."""
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
        """Add a stage, or add its numbers to the stage of that name."""
        known = self._stage_of.setdefault(stage.name, stage)
        if known is stage:
            self._ran.append(stage)
            self._left_out = [other for other in self._left_out if other.name != stage.name]
        else:
            known.add(stage)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Plan):
            return NotImplemented
        return self.ran == other.ran and self.left_out == other.left_out

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Plan(ran={self.ran}, left_out={self.left_out})"

    def __str__(self) -> str:
        """The table that `hitplanes report --plan` prints."""
        return "\n".join(plan_lines(self.timed()))

    @property
    def ns(self) -> int:
        """How long the call took, from its first stage to the end of its last."""
        return sum(stage.ns for stage in self.ran)

    def has_run(self, name: str) -> bool:
        """Whether a stage ran; the notes stay as they are."""
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
        """The plan as JSON, with the `ns` that each stage took, which differ from run to run."""
        return {**self.to_dict(), "ran": [{**stage.to_dict(), "ns": stage.ns} for stage in self.ran]}


class PlanSum:
    """Sum of the plans of many calls: how often each stage ran or was left out, its bytes and time, its first `why`."""

    def __init__(self) -> None:
        self.calls = 0
        self._sums: dict[bool, dict[str, Stage]] = {True: {}, False: {}}
        self._calls_of = Counter[tuple[bool, str]]()

    def add(self, plan: Plan, *asked: Stage) -> None:
        """Count the plan of one call, and stages that it left out until its answer was `asked` for them."""
        self.calls += 1
        later = {stage.name for stage in asked}
        left_out = [stage for stage in plan.left_out if stage.name not in later]
        for ran, stages in ((True, [*plan.ran, *asked]), (False, left_out)):
            self._calls_of.update({(ran, stage.name) for stage in stages})
            for stage in stages:
                if stage.name in self._sums[ran]:
                    self._sums[ran][stage.name].add(stage)
                else:
                    self._sums[ran][stage.name] = replace(stage)

    def timed(self) -> dict[str, list[dict[str, Any]]]:
        """Like `Plan.timed`, with the number of `calls` that ran, or left out, each stage."""
        return {"ran": self._records(ran=True), "left_out": self._records(ran=False)}

    def _records(self, *, ran: bool) -> list[dict[str, Any]]:
        calls, stages = self._calls_of, self._sums[ran].values()
        return [{**stage.to_dict(), "ns": stage.ns, "calls": calls[ran, stage.name]} for stage in stages]


def plan_lines(plan: Mapping[str, Sequence[Mapping[str, Any]]], calls: int = 1) -> list[str]:
    """Lines of a table of a timed plan, given as JSON: what each stage cost, and what was left out."""
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
    """Text of the last column: why a stage ran or not, in how many calls, and how many pairs a filter left."""
    often = f"{stage['calls']} of {calls} calls: " if calls != 1 else ""
    kept, of = stage.get("pairs", (0, 0))
    return f"{often}{stage['why']}" + (f"; {kept:,} of {of:,} pairs left" if of else "")


def read_stack(scene: Scene, plan: Plan) -> Stack:
    """The stack of a scene: its objects and occluders, front to back; the plan records whether it had to be sorted."""
    kept = scene.items.has_stack
    stack = scene.items.stack()
    text = "as they were" if kept else "put in order, front to back"
    plan.run("stack", f"{len(stack)} items, {text}", 0 if kept else stack.nbytes)
    return stack


def unaimed(weapon: Weapon) -> Iterator[tuple[str, str]]:
    """The direction of a call that has neither aim nor toward, if its weapon has one."""
    if is_directed(weapon):
        yield "aim", "none given, so to the right (0 degrees)"


def leave_out_absent(plan: Plan, scene: Scene, stack: Stack, weighted: bool, choosy: bool) -> None:
    """Record the stages for what the shots and the scene do not have."""
    plan.leave_out_all(absent, stack, weighted, scene.bounds is not None, choosy)


def absent(stack: Stack, weighted: bool, bounded: bool, choosy: bool) -> Iterator[tuple[str, str]]:
    """Stages for what the shots and the scene do not have."""
    there = weighted, bounded, stack.has_occluders, stack.layered, choosy
    return (stage for stage, present in zip(ABSENT, there, strict=True) if not present)


ABSENT = (
    ("weights", "the weapon has no falloff"),
    ("outside", "the scene has no bounds"),
    ("occluders", "the scene has none"),
    ("layers", "all items lie on one"),
    ("filter", "all is accepted, and nobody excluded"),
)


def leave_out_imagery(plan: Plan, scene: Scene) -> None:
    """Record the roles of items that decide no hit, and are only drawn."""
    plan.leave_out_all(undrawn, scene.items.imagery())


def undrawn(imagery: Sequence[Role]) -> Iterator[tuple[str, str]]:
    """Roles of items that decide no hit."""
    return ((role.value, "drawn only for a picture") for role in imagery)
