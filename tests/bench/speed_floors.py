"""What stops the cells that are not reached: the same calls where nothing can be hit, and answers that tell less.

`nothing there` is the same public call at the same objects as movers, which cannot be hit: what is left are its checks,
its answer, and the moves. `asked` is what the targets leave a call, by the peer in the same run: where nothing there
takes longer than that, finding hits in no time would not do.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, repeat
from typing import Any
from unittest import mock

import numpy as np
from speed_clock import Cell, Side, race
from speed_moving import Own, frames_of, masks_side, own_rows
from speed_peers import Masks, first, rendered
from speed_single import masks_call, own_calls, timed_calls, works_of
from speed_static import Settings, hit_rows, modes, ours
from speed_targets import TARGETS
from speed_world import PATTERNS, items_of, pattern_mask, runs, scene_of

from hitplanes import Scene

__all__ = ["floors"]

STATIC = (("point", 100), ("shotgun 8 x r=2", 100), ("disc r=40", 10), ("disc r=40", 100))
MOVING = ((100, 100), (1000, 10), (1000, 100))
"""Objects that all move, and shots a frame."""

NOTHING, COUNTS, LEAST = "nothing there", "counts alone", "a call of Python"
LESS = {
    NOTHING: "the same objects as movers, which no shot can hit",
    COUNTS: "samples of each object, in no order, without the nearest pixel",
    LEAST: "looks at a version, checks two numbers, begins an answer",
}
"""In what the question of a side is easier than ours."""


def floors(settings: Settings) -> Iterator[Cell]:
    """Batches, frames and single calls that are to be so many times as fast as pygame-ce."""
    for name, objects in STATIC:
        yield asked(settings, _batch(settings, name, objects), "static", name)
    for objects, shots in MOVING:
        yield asked(settings, _frame(settings, objects, shots), "moving", f"{shots} shots")
    yield asked(settings, _call(settings, 100), "single", "point")


def asked(settings: Settings, cell: Cell, section: str, what: str) -> Cell:
    """Tell what each mode may take by the targets of a cell."""
    for target in TARGETS:
        there = cell.objects in target.objects and target.against in cell.sides
        if there and target.section == section and what in target.what:
            for mode in modes(settings):
                cell.values[f"asked of {mode}, ns"] = cell.sides[target.against].least / target.wanted(mode)
    return cell


def unhittable(scene: Scene) -> Scene:
    """A scene, now none of whose objects decides anything."""
    scene.set(scene.ids(), role="mover")
    return scene


def named(side: Side, what: str) -> Side:
    """A side that answers less."""
    side.name, side.rows, side.easier = f"{side.name}, {what}", None, LESS[what]
    return side


def _batch(settings: Settings, name: str, objects: int) -> Cell:
    """A batch at a scene that stands still."""
    scene, weapon = scene_of(objects), PATTERNS[name]
    masks, placed = Masks(items_of(scene)), rendered(pattern_mask(weapon))  # type: ignore[arg-type]
    sides = ours(settings, scene, weapon)
    sides += [named(side, NOTHING) for side in ours(settings, unhittable(scene_of(objects)), weapon)]
    if name != "point":
        sides.append(_counts(ours(settings, scene, weapon)[0]))
        sides.append(Side("A pygame", lambda w, n: masks.areas(*first(w, n), repeat(placed)), list))
    else:
        sides.append(Side("A pygame", lambda w, n: masks.points(*first(w, n)), list))
    works = islice(runs(name, settings.shots, objects, settings.row), settings.rounds + 1)
    return race(Cell("floors", name, objects), sides, works, settings.shots, settings.seconds)


def _counts(side: Side) -> Side:
    """Ours in numpy as peers answer: samples of each object, in no order, without their nearest pixel."""
    whole = side.answer

    def answer(work: Any, units: int) -> Any:
        with (
            mock.patch("hitplanes.planes.bits.front_to_back.nearest", lambda met, left, top: (left, left, top)),
            mock.patch("hitplanes.planes.bits.front_to_back.row_order", lambda *keys: np.arange(len(keys[0]))),
        ):
            return whole(work, units)

    side.answer = answer
    named(side, COUNTS).rows = hit_rows
    return side


def _frame(settings: Settings, objects: int, shots: int) -> Cell:
    """A frame in which all objects move."""
    sides = []
    for mode, ready in modes(settings).items():
        sides.append(Side(mode, Own(scene_of(objects)).answer, own_rows, ready=ready, whole=True))
    for mode, ready in modes(settings).items():
        still = Own(scene_of(objects))
        unhittable(still.scene)
        sides.append(named(Side(mode, still.answer, ready=ready, whole=True), NOTHING))
    shadow = scene_of(objects)
    sides.append(masks_side(shadow))
    rounds = islice(frames_of(shadow, settings.frames, shots, 0.0, shots), settings.rounds + 1)
    cell = Cell("floors", f"{shots} shots", objects, unit="ns a frame")
    return race(cell, sides, ([frames] for frames in rounds), settings.frames, settings.seconds)


class Least:
    """What no prepared shot can do without: to look whether the scene changed, check two numbers, begin an answer."""

    def __init__(self) -> None:
        self.scene, self.version = self, 0

    def fire(self, at: Any) -> list[Any]:
        """Answer nothing."""
        if self.scene.version != self.version:
            raise AssertionError
        x, y = at
        if type(x) is int is type(y) and -1e9 < x < 1e9 and -1e9 < y < 1e9:
            return []
        raise ValueError


def _call(settings: Settings, objects: int) -> Cell:
    """One point a call, made ready."""
    scene, empty, weapon, least = scene_of(objects), unhittable(scene_of(objects)), PATTERNS["point"], Least()
    calls: dict[str, Any] = {}
    for mode, ready in modes(settings).items():
        name = f"ready, {mode}"
        calls[name] = own_calls(scene, weapon, mode)[name], ready
        calls[f"{name}, {NOTHING}"] = own_calls(empty, weapon, mode)[name], ready
    calls[LEAST] = lambda at, aim: list(least.fire(at)), None
    calls["A pygame"] = masks_call(Masks(items_of(scene)), weapon), None
    works = list(works_of("point", objects, settings))
    cell = Cell("floors", "point, prepared", objects, unit="ns a call", asked=settings.calls)
    return timed_calls(cell, calls, works, {name: LESS[what] for name in calls for what in LESS if what in name})
