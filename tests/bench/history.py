"""A history: what a tick takes, in memory and in time, beside a deep copy of the same; and what a shot at it takes.

python tests/bench/history.py
"""

from __future__ import annotations

import copy
import time
import tracemalloc
from collections.abc import Callable

import numpy as np

from hitplanes import Disc, History, Scene, Sprite, fire
from hitplanes.planes.scene import variants
from hitplanes.planes.scene.items import COLUMNS

WORLD = (1920, 1080)
TICKS = 8


def scene_of(objects: int, rng: np.random.Generator) -> Scene:
    """Objects of 24 x 20 px, of 8 sprites."""
    scene = Scene(WORLD)
    sprites = [Sprite.from_mask(rng.random((20, 24)) < 0.8) for _ in range(8)]
    for i in range(objects):
        scene.add(sprites[i % 8], rng.uniform((0, 0), WORLD))
    return scene


def moved(scene: Scene, part: float, rng: np.random.Generator) -> None:
    """Move a part of all objects."""
    ids = rng.permutation(len(scene))[: int(len(scene) * part)]
    if len(ids):
        scene.move(ids, rng.uniform((0, 0), WORLD, (len(ids), 2)))


def turned(scene: Scene, rng: np.random.Generator) -> None:
    """Turn all objects, each by an angle of its own, and make their masks, which are no part of a record."""
    scene.set(scene.ids(), angle=rng.uniform(0, 360, len(scene)))
    scene.box(scene.ids())


CHANGES: dict[str, Callable[[Scene, np.random.Generator], None]] = {
    "none": lambda scene, rng: None,
    "10 % move": lambda scene, rng: moved(scene, 0.1, rng),
    "all move": lambda scene, rng: moved(scene, 1, rng),
    "all turn": turned,
}


def deep_copy(scene: Scene) -> object:
    """A copy of all that decides, with masks and sprites."""
    items = scene.items
    lists = (items.sprites, items.transforms, items.angles, items.variants, items.names)
    columns = [getattr(items, name)[: items.count] for name in COLUMNS]
    return copy.deepcopy((columns, lists, items.atlas.flat[: items.atlas.used]))


def bytes_freed(scene: Scene, change: Callable[[Scene, np.random.Generator], None], ticks: int) -> int:
    """Bytes that are free again when a history of some ticks goes."""
    rng, history = np.random.default_rng(2), History(scene)
    for _ in range(ticks):
        change(scene, rng)
        history.record()
    change(scene, rng)
    variants._kept.values.clear()  # masks kept for the next who asks are no tick's own
    variants._kept.bytes = 0
    before = tracemalloc.get_traced_memory()[0]
    del history
    return before - tracemalloc.get_traced_memory()[0]


def bytes_kept(scene: Scene, change: Callable[[Scene, np.random.Generator], None]) -> float:
    """Bytes of each tick after the first."""
    ticks = TICKS if change is not turned else 4
    return (bytes_freed(scene, change, ticks + 1) - bytes_freed(scene, change, 1)) / ticks


def bytes_copied(scene: Scene) -> float:
    """Bytes of a deep copy."""
    before = tracemalloc.get_traced_memory()[0]
    copied = deep_copy(scene)
    after = tracemalloc.get_traced_memory()[0]
    del copied
    return after - before


def timed(call: Callable[[], object]) -> float:
    """Microseconds."""
    begin = time.perf_counter()
    call()
    return (time.perf_counter() - begin) * 1e6


def times(scene: Scene, change: Callable[[Scene, np.random.Generator], None]) -> list[float]:
    """Median microseconds to record, to read a tick, to fire one disc at it, and to read between two."""
    rng, history, rows = np.random.default_rng(3), History(scene, interpolate=True), []
    for tick in range(50 if change is not turned else 4):
        change(scene, rng)
        row = [timed(history.record)]
        row.append(timed(lambda tick=tick: history.at(tick)))
        row.append(timed(lambda tick=tick: fire(history.at(tick), Disc(10), (900, 500))))
        row.append(timed(lambda tick=tick: history.at(max(tick - 0.5, 0))))
        rows.append(row)
    return np.median(rows[1:], axis=0).tolist()


def main() -> None:
    """Print the table."""
    heads = ("KB a tick", "deep KB", "ratio", "record us", "deep us", "at us", "fire us", "between us")
    print(f"{'objects':>8} {'change':10}", *(f"{head:>10}" for head in heads))
    for objects in (100, 1000, 10_000):
        for name, change in CHANGES.items():
            scene = scene_of(objects, np.random.default_rng(1))
            change(scene, np.random.default_rng(4))
            tracemalloc.start()
            kept, copied = bytes_kept(scene, change), bytes_copied(scene)
            tracemalloc.stop()
            deep = timed(lambda scene=scene: deep_copy(scene))
            record, at, shot, between = times(scene, change)
            told = f"{kept / 1e3:10,.1f} {copied / 1e3:10,.0f} {kept / copied:10.4f}"
            told += f" {record:10,.0f} {deep:10,.0f} {at:10,.0f} {shot:10,.0f} {between:10,.0f}"
            print(f"{objects:8,} {name:10} {told}")


if __name__ == "__main__":
    main()
