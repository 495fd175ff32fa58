"""Measure the times by which strategies are chosen, and write them to planes/common/costs.py.

python tests/bench/calibrate.py [FILE]

A way is timed over a grid of sizes, and its costs are the least squares of these times, each relative to itself. What
a way keeps of a scene is the difference between a first call and the next. Each time is the least of several.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from time import perf_counter_ns
from typing import Any
from unittest.mock import patch

import numpy as np

from hitplanes import Disc, Pistol, Point, Scene, Sprite, fire, prepare, use_jit
from hitplanes.planes.bits.cells import met_boxes
from hitplanes.planes.bits.tiles import stride_of
from hitplanes.planes.broadphase.boxes import Index
from hitplanes.planes.common import costs
from hitplanes.planes.common.backend import in_parts, use_threads
from hitplanes.weapons.fire.strategy import expected_near

FILE = Path(__file__).parents[2] / "planes" / "common" / "costs.py"
SIZE_WH, DENSE_WH, RADIUS, RANGE = (1920, 1080), (480, 270), 24, 500
SHOTS, ITEMS, REACHES = (1, 100, 3000), (10, 100, 1000), (3, 20, 60)
HANDED_OVER = 20
"""Work is given to a thread if it takes so many times as long as handing it over."""

Row = tuple[float, ...]
"""What a time depends on, such as 1, shots, and pairs; and the time, ns."""


def scene_of(items: int, size_wh: tuple[int, int] = SIZE_WH, bounded: bool = True) -> Scene:
    """A scene of discs, spread evenly."""
    scene, sprite = Scene(size_wh if bounded else None), Sprite.circle(RADIUS)
    for at in np.random.default_rng(items).uniform((0, 0), size_wh, (items, 2)):
        scene.add(sprite, at)
    return scene


def places(shots: int, size_wh: tuple[int, int] = SIZE_WH) -> Any:
    """Positions of shots, spread evenly."""
    return np.random.default_rng(shots).uniform((0, 0), size_wh, (shots, 2))


def time_of(work: Callable[[], object]) -> float:
    """Time of one call, ns."""
    start = perf_counter_ns()
    work()
    return float(perf_counter_ns() - start)


def least(work: Callable[[], object], rounds: int) -> float:
    """The least time of some calls, ns; the first does not count."""
    work()
    return min(time_of(work) for _ in range(rounds))


def fitted(names: str, rows: Sequence[Row]) -> dict[str, float]:
    """Costs that explain the times best; a cost that would be negative is 0."""
    every, used = names.split(), list(range(len(names.split())))
    what = np.array([row[:-1] for row in rows]) / np.array([row[-1] for row in rows])[:, None]
    while True:
        costs = np.linalg.lstsq(what[:, used], np.ones(len(rows)), rcond=None)[0]
        if (costs >= 0).all():
            return {**dict.fromkeys(every, 0.0), **{every[k]: float(c) for k, c in zip(used, costs, strict=True)}}
        used.pop(int(costs.argmin()))


def timed(
    weapon: Any, strategy: str, rounds: int, shots: Sequence[int] = SHOTS, size_wh: tuple[int, int] = SIZE_WH
) -> Iterator[tuple[int, Scene, float]]:
    """Times of calls over the grid of sizes, as (shots, scene, ns)."""
    for items in ITEMS:
        scene = scene_of(items, size_wh)
        for count in shots:
            at, aim = places(count, size_wh), np.random.default_rng(count).uniform(0, 360, count)
            yield count, scene, least(partial(fire, scene, weapon, at, aim=aim, strategy=strategy), rounds)


def crowded(strategy: str, rounds: int) -> Iterator[Row]:
    """Times of calls of discs, as (1, shots, pairs of a shot and an item, those that are near, ns); some are dense."""
    for size_wh, reach in product((SIZE_WH, DENSE_WH), REACHES):
        for n, scene, ns in timed(Disc(reach), strategy, rounds, size_wh=size_wh):
            yield 1, n, n * len(scene), n * expected_near(scene.items.stack(), reach), ns


def made(weapon: Any, strategy: str, rounds: int, before: str, size_wh: tuple[int, int] = SIZE_WH) -> list[Row]:
    """Times to make what a way keeps of a scene: 1, items, pixels, ns; `before` makes what is not counted."""
    rows = []
    for items in ITEMS:
        firsts, nexts = [], []
        for _ in range(rounds):
            scene = scene_of(items, size_wh)
            fire(scene, weapon, (1, 1), strategy=before)
            call = partial(fire, scene, weapon, (1, 1), strategy=strategy)
            firsts.append(time_of(call))
            nexts.append(time_of(call))
        rows.append((1, items, math.prod(size_wh), max(min(firsts) - min(nexts), 1.0)))
    return rows


def of_areas(rounds: int) -> dict[str, float]:
    """Costs of tiles, visible sets and label planes."""
    disc, found = Disc(20), fitted("tiles_call tiles_placement tiles_pair tiles_near", [*crowded("tiles", rounds)])
    visible = [(*row[:2], *row[3:]) for row in crowded("visible", rounds)]
    found |= fitted("visible_call visible_placement visible_near", visible)
    found |= fitted("visible_made visible_tile", [(*row[:2], row[3]) for row in made(disc, "visible", rounds, "tiles")])
    found |= fitted("labels_call", [(1, ns) for *_, ns in timed(Point(), "labels", rounds, (1,))])
    drawn = [row[1:] for size_wh in (SIZE_WH, DENSE_WH) for row in made(Point(), "labels", rounds, "tiles", size_wh)]
    return found | fitted("labels_item labels_pixel", drawn) | {"labels_box": redrawn(rounds)}


def redrawn(rounds: int) -> float:
    """Time to redraw the box of an item that moved, of a label plane."""
    scene = scene_of(ITEMS[1])
    plane, moved = scene.derived.label_plane(), scene.ids()[: ITEMS[0]]
    assert plane is not None  # the scene has bounds

    def follow() -> float:
        scene.move(moved, scene.position(moved) + 1)
        scene.items.stack()
        return time_of(partial(plane.read, scene.items))

    return min(follow() for _ in range(rounds)) / len(moved)


def of_integers(rounds: int) -> dict[str, float]:
    """Costs of a few shots counted in integers."""
    rows = []
    for radius in (3, 20, 40):
        for n, scene, ns in timed(Disc(radius), "integers", rounds, (1, 10, 30)):
            near, side = n * expected_near(scene.items.stack(), radius), 2 * radius + 1
            rows.append((1, n, near, near * stride_of(side) * side, ns))
    return fitted("integers_call integers_placement integers_pair integers_bit", rows)


def of_boxes(rounds: int) -> dict[str, float]:
    """Costs of comparing boxes one by one, and by a BVH."""
    scene, found, rows = scene_of(ITEMS[-1]), {}, []
    boxes = scene.items.stack().box_xyxy
    found["box_pair"] = least(partial(met_boxes, boxes[:500], boxes), rounds) / (500 * len(boxes))
    found["bvh_item"] = least(lambda: Index("bvh").read(scene.items), rounds) / len(boxes)
    index = Index("bvh")
    index.read(scene.items)
    for count in SHOTS:
        asked = boxes[np.arange(count) % len(boxes)]
        rows.append((1, count, least(partial(index.query, scene.items, asked), rounds)))
    found |= fitted("bvh_call bvh_placement", rows)
    moved = scene.ids()[: len(boxes) // 10]

    def follow() -> float:
        scene.move(moved, scene.position(moved) + 1)
        return time_of(partial(index.read, scene.items))

    return found | {"bvh_moved": min(follow() for _ in range(rounds)) / len(moved)}


def of_rays(rounds: int, labels_pixel: float) -> dict[str, float]:
    """Costs of the cast, the march, and the distance field."""
    pistol, found = Pistol(RANGE), {}
    casts = [(1, n, n * len(scene), ns) for n, scene, ns in timed(pistol, "cast", rounds)]
    found |= fitted("cast_call cast_ray cast_pair", casts)
    found |= fitted("march_call march_ray", [(1, n, ns) for n, _, ns in timed(pistol, "march", rounds)])
    fields = [row[3] / row[2] for row in made(pistol, "march", rounds, "cast")]
    found["field_pixel"] = max(min(fields) - labels_pixel, 0.0)
    scene = scene_of(ITEMS[0])
    fire(scene, pistol, (1, 1), strategy="march")
    dear = {form: getattr(costs, form)._replace(prepared_cast=1e9) for form in ("NUMPY", "COMPILED")}
    with patch.multiple(costs, **dear):  # so that rays march
        found["prepared_march"] = prepared(scene, pistol, rounds)
    alone = [(1, items, prepared(scene_of(items, bounded=False), pistol, rounds)) for items in ITEMS]
    return found | fitted("prepared_cast prepared_cast_item", alone)


def prepared(scene: Scene, weapon: Any, rounds: int) -> float:
    """Time of a shot of a ready weapon; without bounds there is no field to march by."""
    ready, shots = prepare(scene, weapon), [tuple(at) for at in places(200).tolist()]
    return least(lambda: [ready.fire(at, aim=30) for at in shots], rounds) / len(shots)


def of_kernels(rounds: int) -> dict[str, float]:
    """Costs that only compiled kernels have: of a prepared shot that walks the tiles, and of threads."""
    rows = []
    for items in ITEMS:
        for radius in (3, 40):
            scene, times = scene_of(items), []
            for _ in range(rounds):
                ready = prepare(scene, Disc(radius))
                ready.fire((1, 1))
                times.append(min(time_of(partial(ready.fire, (900 + k, 500))) for k in range(9)))
            rows.append((1, items, expected_near(scene.items.stack(), radius), min(times)))
    found = fitted("prepared_call prepared_tile prepared_near", rows)
    del found["prepared_call"]  # it is the same with a visible set
    use_threads(2)
    handed = least(lambda: in_parts(2, 1, lambda _, __: None), 20 * rounds)
    use_threads(None)
    return found | {"thread": HANDED_OVER * handed}


def measured(compiled: bool, rounds: int) -> dict[str, float]:
    """All costs in one form."""
    use_jit(compiled)
    try:
        found = of_areas(rounds)
        found |= of_boxes(rounds) | of_rays(rounds, found["labels_pixel"])
        return found | (of_kernels(rounds) if compiled else of_integers(rounds))
    finally:
        use_jit(None)


def written(text: str, form: str, costs: dict[str, float]) -> str:
    """The text of the module with the costs of a form, three digits each."""
    head, body, tail = re.split(rf"(?s)(?<=\n)({form} = Costs\(.*?\n\))", text)
    for name, cost in costs.items():
        body, count = re.subn(rf"\b{name}=[\w.]+", f"{name}={float(f'{max(cost, 0.001):.3g}'):.10g}", body)
        assert count == 1, name
    return head + body + tail


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=FILE, help="default: the module of the package")
    parser.add_argument("--rounds", type=int, default=9, help="calls of which the least time counts")
    given = parser.parse_args(arguments)
    text = given.file.read_text()
    for form in ("NUMPY", "COMPILED"):
        text = written(text, form, measured(form == "COMPILED", given.rounds))
    given.file.write_text(text)


if __name__ == "__main__":
    main()
