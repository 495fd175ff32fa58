"""What the benchmark is to show, and whether it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from speed_clock import Cell

__all__ = ["TARGETS", "Target", "judged"]

ANY = range(10**9)
MANY = range(100, 10**9)


@dataclass(frozen=True)
class Target:
    """What is wanted of some cells: the worst of them decides.

    Parameters
    ----------
    section, what, objects : which cells; no `what` is any
    against : the peer that is to take so many times as long; or
    value : the measured value, with {mode} in its name, that is to be at most so much; its unit is `per`
    ours : the side of ours, with {mode} in its name
    """

    name: str
    section: str
    what: tuple[str, ...]
    objects: range
    numpy: float
    jit: float
    against: str = ""
    value: str = ""
    per: float = 1.0
    ours: str = "{mode}"

    def wanted(self, mode: str) -> float:
        """The figure for a mode."""
        return self.numpy if mode == "numpy" else self.jit

    def reached(self, mode: str, figure: float) -> bool:
        """Whether a measured figure is good enough."""
        return figure >= self.wanted(mode) if self.against else figure <= self.wanted(mode)

    def figures(self, mode: str, cells: Sequence[Cell]) -> list[tuple[float, str]]:
        """What was measured: each figure, and where."""
        found: list[tuple[float, str]] = []
        for cell in cells:
            if cell.section != self.section or cell.objects not in self.objects:
                continue
            if self.what and cell.what not in self.what:
                continue
            if self.against:
                figure = cell.ratio(self.against, self.ours.format(mode=mode))
            else:
                figure = cell.values.get(self.value.format(mode=mode))
                figure = None if figure is None else figure / self.per
            if figure is not None:
                found.append((figure, f"{cell.what}, M = {cell.objects}"))
        return found

    def worst(self, mode: str, cells: Sequence[Cell]) -> tuple[float, str] | None:
        """The figure that decides, and where it was measured; None if it was not."""
        found = self.figures(mode, cells)
        if not found:
            return None
        return min(found) if self.against else max(found)


@dataclass(frozen=True)
class PerRow(Target):
    """What a row costs with the most of the objects, over what it costs with the fewest."""

    def figures(self, mode: str, cells: Sequence[Cell]) -> list[tuple[float, str]]:
        """One figure."""
        name, few, many = self.value.format(mode=mode), self.objects[0], self.objects[-1]
        costs = {cell.objects: cell.values[name] for cell in cells if cell.section == self.section}
        return [(costs[many] / costs[few], f"M = {many} over {few}")] if {few, many} <= costs.keys() else []


def _pair(name: str, what: str, objects: range, a: tuple[float, float], c: tuple[float, float]) -> tuple[Target, ...]:
    return (
        Target(f"{name}, x A", "static", (what,), objects, *a, against="A pygame"),
        Target(f"{name}, x C", "static", (what,), objects, *c, against="C pygame"),
    )


SHOTS = ("point", "shotgun 8 x r=2", "disc r=40")
ONLY_100, ONLY_1000 = range(100, 101), range(1000, 1001)

TARGETS: tuple[Target, ...] = (
    *_pair("static point, M >= 100", "point", MANY, (40, 150), (10, 40)),
    *_pair("static shotgun, M >= 100", "shotgun 8 x r=2", MANY, (12, 40), (2.5, 5)),
    *_pair("static shotgun as a Spread, M >= 100", "spread 8 x r=2", MANY, (12, 40), (2.5, 5)),
    *_pair("static disc r=40, every M", "disc r=40", ANY, (8, 30), (1.5, 5)),
    Target("ray 1000 px, M >= 100, x pymunk on hulls", "static", ("ray 1000",), MANY, 4, 10, against="pymunk"),
    Target("all 1000 move, 100 shots, x A", "moving", ("100 shots",), ONLY_1000, 1.3, 10, against="A pygame"),
    Target("all 100 move, 100 shots, x A", "moving", ("100 shots",), ONLY_100, 0.8, 8, against="A pygame"),
    Target("all 1000 move, 10 shots, x A", "moving", ("10 shots",), ONLY_1000, 0.8, 8, against="A pygame"),
    Target(
        "one shot, prepared, M >= 100, worst, x A", "single", SHOTS, MANY, 1.5, 2, against="A pygame",
        ours="ready, {mode}",
    ),
    PerRow("r=40 at objects: a row, M = 10,000 over 10", "at objects", (), range(10, 10_001), 2, 3,
        value="ns a row, {mode}"),
    Target(
        "moved object redrawn, M = 1000, us", "redrawn", ("1 moved",), ONLY_1000, 25, 4,
        value="ns a moved object, {mode}", per=1e3,
    ),
    Target("planner: auto over the better", "planner", (), ANY, 1.5, 1.5, value="auto over best, {mode}"),
    Target(
        "import hitplanes: added to numpy's", "cold", (), ANY, 0.2, 0.2,
        value="import hitplanes: added to numpy's",
    ),
)  # fmt: skip


def judged(cells: Sequence[Cell], modes: Sequence[str]) -> list[dict[str, Any]]:
    """Each target in each mode: what was wanted, what was measured, where, and whether it is reached."""
    lines = []
    for target in TARGETS:
        for mode in modes:
            worst = target.worst(mode, cells)
            line = {"target": target.name, "mode": mode, "wanted": target.wanted(mode)}
            line["sense"] = "at least" if target.against else "at most"
            if worst is None:
                lines.append({**line, "measured": None, "where": "not measured", "reached": None})
            else:
                figure, where = worst
                lines.append({**line, "measured": figure, "where": where, "reached": target.reached(mode, figure)})
    return lines
