"""The planner: "direct", "built" and "auto" over the grid of `speed.py`, and how auto does beside the better one.

python tests/bench/strategies.py
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

from speed_clock import Cell, Side, race, told
from speed_moving import Own, frames_of, own_rows
from speed_static import Settings, modes, ours
from speed_world import PATTERNS, runs, scene_of

STRATEGIES = ("direct", "built", "auto")


def planner(settings: Settings) -> Iterator[Cell]:
    """Scenes that stand still, and scenes that move; each strategy has a scene of its own."""
    for objects in settings.planner:
        for name, weapon in PATTERNS.items():
            if name != "ray 1000":
                for shots in settings.batches:
                    yield _still(settings, name, weapon, objects, shots)
        for shots in (*settings.batches[:-1], min(1000, settings.shots)):
            yield _in_motion(settings, objects, shots)


def _still(settings: Settings, name: str, weapon: Any, objects: int, shots: int) -> Cell:
    sides = []
    for strategy in STRATEGIES:
        for side in ours(settings, scene_of(objects), weapon, strategy=strategy):
            side.name = f"{side.name}, {strategy}"
            sides.append(side)
    works = islice(runs(name, shots, shots, 1), max(settings.rounds, 5 if shots < 1000 else 0) + 1)
    cell = race(Cell("planner", f"{name}, {shots} shots", objects), sides, works, shots, settings.seconds)
    return _with_losses(settings, cell)


def _in_motion(settings: Settings, objects: int, shots: int) -> Cell:
    sides = []
    for mode, ready in modes(settings).items():
        for strategy in STRATEGIES:
            own = Own(scene_of(objects), strategy=strategy)
            sides.append(Side(f"{mode}, {strategy}", own.answer, own_rows, ready=ready, whole=True))
    rounds = frames_of(scene_of(objects), settings.frames, shots, 0.0, shots)
    works = ([next(rounds)] for _ in range(settings.rounds + 1))
    cell = Cell("planner", f"all move, {shots} shots", objects, unit="ns a frame")
    return _with_losses(settings, race(cell, sides, works, settings.frames, settings.seconds))


def _with_losses(settings: Settings, cell: Cell) -> Cell:
    for mode in modes(settings):
        best = min(cell.sides[f"{mode}, {strategy}"].least for strategy in ("direct", "built"))
        cell.values[f"auto over best, {mode}"] = cell.sides[f"{mode}, auto"].least / best
    return cell


def main() -> None:
    """Print the table."""
    from speed import Settings as Whole

    for cell in planner(Whole()):
        times = "  ".join(f"{name} {told(times.least)}" for name, times in cell.sides.items())
        print(f"{cell.objects:6} {cell.what:28} {times}  {cell.values['auto over best, numpy']:.2f}", flush=True)


if __name__ == "__main__":
    main()
