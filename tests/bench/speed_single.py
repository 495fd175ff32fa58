"""One shot a call: nanoseconds of each call, their median and 99th percentile; and what the first calls cost."""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from speed_clock import Cell, DisagreementError, Side, Times, no_collection, race, sorted_rows
from speed_engines import EASIER, Space
from speed_peers import MARGIN, Baked, Masks, Plane, pygame, rendered
from speed_static import Settings, modes, ours
from speed_world import PATTERNS, Volleys, items_of, pattern_mask, scene_of, volleys

import hitplanes
from hitplanes import Pistol, Scene, Weapon, fire

__all__ = ["masks_call", "own_calls", "preparation", "single", "timed_calls", "works_of"]

SINGLE = ("point", "shotgun 8 x r=2", "disc r=40", "ray 1000")

Call = Callable[[Any, float], Any]
"""Of a place and an aim; gives [(object, samples)], or None where it answers another question."""

BLOCK = 50
"""Calls of one side in a row."""


def single(settings: Settings) -> Iterator[Cell]:
    """Each pattern, each number of objects."""
    for objects in settings.single:
        scene = scene_of(objects)
        items = items_of(scene)
        masks, plane = Masks(items), Plane(items)
        baked, space = Baked(items, plane), Space(items)
        for name in SINGLE:
            weapon = PATTERNS[name]
            calls: dict[str, tuple[Call, Callable[[], None] | None]] = {}
            for mode, ready in modes(settings).items():
                calls |= {side: (call, ready) for side, call in own_calls(scene, weapon, mode).items()}
            if name == "ray 1000":
                calls["pymunk"] = (pymunk_ray(space), None)
            else:
                calls["A pygame"] = (masks_call(masks, weapon), None)
                calls["C pygame"] = (baked_call(baked, weapon), None)
            works = list(works_of(name, objects, settings))
            yield timed_calls(
                Cell("single", name, objects, unit="ns a call", asked=settings.calls), calls, works, {"pymunk": EASIER}
            )


def works_of(name: str, objects: int, settings: Settings) -> Iterator[list[tuple[Any, float]]]:
    """Places and aims of the calls of each round, and of one before for warming up."""
    rounds = volleys(name, settings.calls, objects)
    for _ in range(settings.rounds + 1):
        work = next(rounds)
        aims = work.lists.get("aim") or [0] * settings.calls
        xy = zip(work.lists["x"], work.lists["y"], strict=True)
        yield [(place, float(aim)) for place, aim in zip(xy, aims, strict=True)]


def own_calls(scene: Scene, weapon: Weapon, mode: str) -> dict[str, Call]:
    """`fire` with one shot, and the prepared call, with and without its rows being read."""

    def fired(at: Any, aim: float) -> Any:
        hits = fire(scene, weapon, at, aim=aim)
        return hits.object.tolist(), hits.samples.tolist()

    calls: dict[str, Call] = {f"fire, {mode}": fired}
    prepare = getattr(hitplanes, "prepare", None)
    if prepare is None:
        return calls
    ready = prepare(scene, weapon)
    if isinstance(weapon, Pistol):
        return {
            **calls,
            f"ready, {mode}": lambda at, aim: list(ready.fire(at, aim=aim)),
            f"ready, only len, {mode}": lambda at, aim: len(ready.fire(at, aim=aim)),
        }
    return {
        **calls,
        f"ready, {mode}": lambda at, aim: list(ready.fire(at)),
        f"ready, only len, {mode}": lambda at, aim: len(ready.fire(at)),
    }


def masks_call(masks: Masks, weapon: Any) -> Call:
    """A, for one shot a call."""
    rects, shapes, ids, blocked = masks.rects, masks.masks, masks.ids, masks.blocked
    pattern, dx, dy, w, h = rendered(pattern_mask(weapon))
    box = pygame.Rect(0, 0, w, h)

    def area(at: Any, aim: float) -> Any:
        box.topleft = left, top = at[0] + dx, at[1] + dy
        found = box.collidelistall(rects)
        if not found:
            return []
        rows = []
        rest = pattern.copy()
        rest.erase(blocked, (-MARGIN - left, -MARGIN - top))
        for i in found:
            x, y = rects[i].topleft
            place = (x - left, y - top)
            count = rest.overlap_area(shapes[i], place)
            if count:
                rows.append((ids[i], count))
                rest.erase(shapes[i], place)
        return rows

    def point(at: Any, aim: float) -> Any:
        box.topleft = at
        found = box.collidelistall(rects)
        if not found:
            return []
        x, y = at
        if blocked.get_at((x + MARGIN, y + MARGIN)):
            return []
        for i in found:
            left, top = rects[i].topleft
            if shapes[i].get_at((x - left, y - top)):
                return [(ids[i], 1)]
        return []

    return point if w == h == 1 else area


def baked_call(baked: Baked, weapon: Any) -> Call:
    """C, for one shot a call."""
    placed = rendered(pattern_mask(weapon))
    pattern = placed.mask
    lists, shift, stride = baked.cells(*placed[1:])

    def call(at: Any, aim: float) -> Any:
        x, y = at
        rows = []
        for ask, left, top, i in lists[((y + MARGIN) >> shift) * stride + ((x + MARGIN) >> shift)]:
            count = ask(pattern, (x - left, y - top))
            if count:
                rows.append((i, count))
        return rows

    return call


def pymunk_ray(space: Space) -> Call:
    """The first hull on a ray."""
    ask, everything = space.space.segment_query_first, space.all
    ends = [(1000 * np.cos(np.radians(a)), 1000 * np.sin(np.radians(a))) for a in range(360)]
    whole = [(float(x), float(y)) for x, y in ends]

    def call(at: Any, aim: float) -> Any:
        x, y = whole[int(aim)]
        return ask(at, (at[0] + x, at[1] + y), 0, everything)

    return call


def timed_calls(cell: Cell, calls: dict[str, Any], works: list[Any], easier: Mapping[str, str]) -> Cell:
    """Time every call; blocks of the sides take turns; a round is told by its median. All rows are compared, but those
    of who answers an easier question.

    The order is drawn anew for each block: who always came after the same one would always find its caches, full of
    what is of use to both, or emptied.
    """
    spent: dict[str, list[int]] = {name: [] for name in calls}
    nothing, rng = _empty_ns(), np.random.default_rng(0)
    for number, work in enumerate(works):
        answers: dict[str, list[Any]] = {name: [] for name in calls}
        for begin in range(0, len(work), BLOCK):
            for name in rng.permutation(list(calls)).tolist():
                call, ready = calls[name]
                if ready:
                    ready()
                taken, got = _block(call, work[begin : begin + BLOCK])
                answers[name] += got
                spent[name] += taken
        _compare_calls(cell, {name: answer for name, answer in answers.items() if name not in easier})
        for name in calls:
            if number == 0:
                spent[name].clear()  # that was for warming up
            else:
                times = cell.sides.setdefault(name, Times(units=len(work)))
                times.rounds.append(float(np.median(spent[name][-len(work) :])) - nothing)
    for name, ns in spent.items():
        times = cell.sides[name]
        times.easier = easier.get(name, "")
        times.compared = name not in easier and "len" not in name and "A pygame" in calls
        cell.values[name] = {
            "median_ns": float(np.median(ns)) - nothing,
            "p99_ns": float(np.percentile(ns, 99)) - nothing,
        }
    return cell


def _block(call: Call, work: list[Any]) -> tuple[list[int], list[Any]]:
    clock, taken, got = time.perf_counter_ns, [], []
    with no_collection():
        for at, aim in work:
            begin = clock()
            answer = call(at, aim)
            taken.append(clock() - begin)
            got.append(answer)
    return taken, got


def _empty_ns() -> float:
    """What timing itself costs."""
    taken, _ = _block(lambda at, aim: None, [(None, 0.0)] * 1000)
    return float(np.median(taken))


def _compare_calls(cell: Cell, answers: dict[str, list[Any]]) -> None:
    found = {}
    for name, answer in answers.items():
        if "len" in name:
            continue
        rows = [(shot, *pair) for shot, one in enumerate(answer) for pair in _pairs(name, one)]
        found[name] = sorted_rows(rows)
    first, *others = found
    for other in others:
        if not np.array_equal(found[first], found[other]):
            raise DisagreementError(f"{cell.section}, {cell.what}, {cell.objects} objects: {first} and {other} differ")


def _pairs(name: str, answer: Any) -> Any:
    if name.startswith("fire"):
        return zip(*answer, strict=True)
    if name.startswith("ready"):
        return [(row.object, row.samples) for row in answer]
    return answer


def preparation(settings: Settings) -> Iterator[Cell]:
    """First call of a batch less later ones, the memory that it leaves and its peak, and the break-even against A."""
    for objects in settings.single:
        for name in ("point", "disc r=40"):
            weapon = PATTERNS[name]
            works = [
                work for _, work in zip(range(settings.rounds + 1), volleys(name, settings.shots, 9), strict=False)
            ]
            items = items_of(scene_of(objects))
            peers = Masks(items)
            placed = rendered(pattern_mask(weapon))  # type: ignore[arg-type]
            cell = Cell("preparation", name, objects, asked=settings.shots)
            theirs = Side("A pygame", lambda w, n, m=peers, p=placed: _masks_batch(m, p, w, n))
            sides = [*ours(settings, scene_of(objects), weapon), theirs]
            race(cell, sides, [[work] for work in works], settings.shots, settings.seconds)
            begin = time.perf_counter_ns()
            Baked(items, Plane(items)).cells(*placed[1:])
            cell.values["C pygame bakes, ns"] = time.perf_counter_ns() - begin
            for mode, ready in modes(settings).items():
                ready()
                cell.values[mode] = _first_call(settings, weapon, objects, works, cell, mode)
            yield cell


def _masks_batch(masks: Masks, placed: Any, work: Volleys, units: int) -> Any:
    xs, ys = work.lists["x"][:units], work.lists["y"][:units]
    return masks.points(xs, ys) if placed.w == 1 else masks.areas(xs, ys, [placed] * units)


def _first_call(
    settings: Settings, weapon: Weapon, objects: int, works: list[Volleys], cell: Cell, mode: str
) -> dict[str, float | None]:
    firsts, laters = [], []
    for _ in range(settings.rounds):
        scene = scene_of(objects)
        taken = []
        for work in works[:3]:
            begin = time.perf_counter_ns()
            fire(scene, weapon, work.at)
            taken.append(time.perf_counter_ns() - begin)
        firsts.append(taken[0])
        laters.append(min(taken[1:]))
    scene = scene_of(objects)
    gc.collect()
    tracemalloc.start()
    hits = fire(scene, weapon, works[0].at)
    _, peak = tracemalloc.get_traced_memory()
    del hits
    gc.collect()
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    extra = max(min(firsts) - min(laters), 0)
    gain = cell.sides["A pygame"].least - cell.sides[mode].least
    even = extra / gain if gain > 0 else float("inf")
    found = {"first less later ns": extra, "kept bytes": kept, "peak bytes": peak}
    return {**found, "break-even shots against A": even if np.isfinite(even) else None}
