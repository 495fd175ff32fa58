"""One shot a call, prepared, against pygame-ce: nanoseconds, mean, median, 99th percentile.

python tests/bench/oneshot.py [--jit]

A is a function of its good user for each shot: `collidelistall`, the pattern without what blocks, front to back
`overlap_area` and `erase`; it gives (object, samples). We give all rows with their first pixels, in order of distance,
and verdicts when they are asked for: `fire` is the call alone, `rows` the call and the reading of all rows. Mean and
median are the least of the rounds, a ratio is the median of theirs. `first` is the mean of the first shots of all, from
`prepare` on; after them all squares are known.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from hitplanes import Beam, Disc, Point, Scene, Stencil, Weapon, prepare, use_jit
from hitplanes.planes.common.checks import Bools
from hitplanes.planes.grid.fixed_point import unit
from hitplanes.weapons.kinds.areas import AreaWeapon, pattern_of

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame

ROUNDS, SHOTS, FIRST = 300, 100, 2000
AIMS = 360


def scene_of(objects: int) -> Scene:
    """1920 x 1080 with irregular objects of 48 px and 60 occluders before them."""
    rng = np.random.default_rng(objects)
    scene = Scene((1920, 1080))
    y, x = np.mgrid[:48, :48] - 23.5
    for i in range(objects + 60):
        wave = 17 + 6 * np.sin(rng.integers(2, 7) * np.arctan2(y, x) + rng.uniform(0, 6))
        where = rng.uniform((0, 0), (1920, 1080))
        scene.add(np.hypot(x, y) < wave, where, role="hittable" if i < objects else "occluder", layer=int(i >= objects))
    return scene


def shotgun() -> Stencil:
    """Eight discs r = 2 at places within 24 px."""
    rng, mask = np.random.default_rng(8), np.zeros((53, 53), np.bool_)
    y, x = np.mgrid[:53, :53] - 26
    for dx, dy in rng.integers(-16, 17, (8, 2)):
        mask |= (x - dx) ** 2 + (y - dy) ** 2 <= 4
    return Stencil(mask, (26, 26))


def peer_mask(mask: Bools) -> Any:
    """A mask of the peer."""
    rgba = np.zeros((*mask.shape, 4), np.uint8)
    rgba[mask] = 255
    return pygame.mask.from_surface(pygame.image.frombuffer(rgba.tobytes(), mask.shape[::-1], "RGBA"), 127)


def rendered(weapon: AreaWeapon, degrees: float) -> tuple[Any, int, int]:
    """A pattern's mask, and where its first corner is from the shot's pixel."""
    c, s = (int(v) for v in unit(degrees))
    mask, (x, y) = pattern_of(weapon, c, s).spans.to_mask()
    return peer_mask(mask), x, y


class Peer:
    """A's scene: masks and rects of objects, front to back; occluders lie in front of all, in one mask."""

    def __init__(self, scene: Scene) -> None:
        self.ids = scene.ids("hittable")[::-1].tolist()
        placed = [scene.mask(i) for i in self.ids]
        self.masks = [peer_mask(mask) for mask, _ in placed]
        self.rects = [pygame.Rect(*corner, *mask.shape[::-1]) for mask, corner in placed]
        walls = np.zeros((1180, 2020), np.bool_)
        for mask, (x, y) in map(scene.mask, scene.ids("occluder").tolist()):
            walls[y + 50 : y + 50 + mask.shape[0], x + 50 : x + 50 + mask.shape[1]] |= mask
        walls[:50] = walls[-50:] = walls[:, :50] = walls[:, -50:] = True
        self.walls = peer_mask(walls)

    def point(self) -> Callable[[int, int], Any]:
        """One pixel."""
        rects, masks, ids, walls, box = self.rects, self.masks, self.ids, self.walls, pygame.Rect(0, 0, 1, 1)

        def fire(x: int, y: int) -> Any:
            box.topleft = x, y
            found = box.collidelistall(rects)
            if found and not walls.get_at((x + 50, y + 50)):
                for i in found:
                    left, top = rects[i].topleft
                    if masks[i].get_at((x - left, y - top)):
                        return [(ids[i], 1)]
            return ()

        return fire

    def area(self) -> Callable[[int, int, tuple[Any, int, int]], Any]:
        """A pattern."""
        rects, masks, ids, walls, box = self.rects, self.masks, self.ids, self.walls, pygame.Rect(0, 0, 1, 1)

        def fire(x: int, y: int, pattern: tuple[Any, int, int]) -> Any:
            mask, dx, dy = pattern
            left, top = x + dx, y + dy
            box.update((left, top), mask.get_size())
            found = box.collidelistall(rects)
            rows = []
            if found:
                rest = mask.copy()
                rest.erase(walls, (-50 - left, -50 - top))
                for i in found:
                    x, y = rects[i].topleft
                    at = x - left, y - top
                    count = rest.overlap_area(masks[i], at)
                    if count:
                        rows.append((ids[i], count))
                        rest.erase(masks[i], at)
            return rows

        return fire


def timed(call: Callable[..., Any], shots: list[tuple[Any, ...]]) -> list[float]:
    """Nanoseconds of each call, written as its user would write it, the clock's own taken off."""
    clock, found = time.perf_counter_ns, []
    if len(shots[0]) == 1:
        for (at,) in shots:
            begin = clock()
            call(at)
            found.append(clock() - begin)
    elif len(shots[0]) == 2:
        for x, y in shots:
            begin = clock()
            call(x, y)
            found.append(clock() - begin)
    else:
        for x, y, pattern in shots:
            begin = clock()
            call(x, y, pattern)
            found.append(clock() - begin)
    empty = min(-clock() + clock() for _ in range(100))
    return [max(ns - empty, 0) for ns in found]


def shots_of(name: str, rng: np.random.Generator, count: int) -> Iterator[tuple[tuple[float, float], float]]:
    """Fresh places, and aims."""
    at, aim = np.floor(rng.uniform((0, 0), (1920, 1080), (count, 2))).tolist(), rng.integers(0, AIMS, count).tolist()
    return zip(map(tuple, at), map(float, aim), strict=True)


def main() -> None:
    """Print the table."""
    use_jit("--jit" in sys.argv)
    weapons: dict[str, Weapon] = {
        "point": Point(),
        "shotgun": shotgun(),
        "disc r=40": Disc(40),
        "beam 300x6": Beam(300, 6),
    }
    told = " median    p99"
    print(f"objects pattern     rows       A{told}    fire{told} A/fire    rows{told} A/rows     first")
    for objects in (100, 1000):
        scene = scene_of(objects)
        peer = Peer(scene)
        for name, weapon in weapons.items():
            compare(name, weapon, scene, peer, objects)


def compare(name: str, weapon: Any, scene: Scene, peer: Peer, objects: int) -> None:
    """One line of the table."""
    rng, aimed = np.random.default_rng(1), name.startswith("beam")
    begin = time.perf_counter_ns()
    ready = prepare(scene, weapon)

    def ours(at: tuple[float, float], aim: float) -> Any:
        return ready.fire(at, aim) if aimed else ready.fire(at)

    for shot in shots_of(name, rng, FIRST):
        ours(*shot)
    first = (time.perf_counter_ns() - begin) / FIRST
    patterns = [rendered(weapon, a) for a in range(AIMS if aimed else 1)]
    for x in range(16, 1920, 32):
        for y in range(16, 1080, 32):
            ours((x, y), float((x + y) % AIMS))
    kinds: dict[str, list[list[float]]] = {"A": [], "fire": [], "rows": []}
    theirs, total = (peer.point() if name == "point" else peer.area()), 0
    for _ in range(ROUNDS):
        shots = list(shots_of(name, rng, SHOTS))
        pixels = [
            (int(x), int(y), *([] if name == "point" else [patterns[int(a) % len(patterns)]])) for (x, y), a in shots
        ]
        calls = [(at, aim) if aimed else (at,) for at, aim in shots]
        kinds["A"].append(timed(theirs, pixels))
        kinds["fire"].append(timed(ready.fire, calls))
        kinds["rows"].append(timed(lambda *call: list(ready.fire(*call)), calls))
        for pixel, call in zip(pixels, calls, strict=True):
            rows = ready.fire(*call)
            assert sorted((row.object, row.samples) for row in rows) == sorted(theirs(*pixel)), (name, call)
            total += len(rows)
    told = f"{objects:7} {name:10} {total / ROUNDS / SHOTS:5.2f}"
    for kind, rounds in kinds.items():
        mean, median = (min(float(of(one)) for one in rounds) for of in (np.mean, np.median))
        p99 = float(np.median([np.percentile(one, 99) for one in rounds]))
        told += f"  {mean:6.0f} {median:6.0f} {p99:6.0f}"
        if kind != "A":
            ratios = [sum(a) / sum(b) for a, b in zip(kinds["A"], rounds, strict=True)]
            told += f" {np.median(ratios):6.2f}"
    print(f"{told}  {first:8.0f}", flush=True)


if __name__ == "__main__":
    main()
