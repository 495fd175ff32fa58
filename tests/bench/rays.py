"""Rays: microseconds for one of 1000 px, beside pymunk in the same run, and what stretches and boxes save; and scans.

python tests/bench/rays.py [--several] [objects ...]

Objects are discs and stars of 48 px, turned, and 60 occluders, over 1920x1080; 10,000 objects also over ten times the
side. With --several only rays that go on are measured, of 500 px, in numpy and compiled, beside a loop of pymunk's
`segment_query`. pymunk gets the convex hulls of the same masks, and answers one ray a call.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec

import cv2
import numpy as np
import pymunk
from turns import least

from hitplanes import Laser, Pistol, Projectile, RayHits, Rifle, Role, Scene, Sprite, Weapon, fire, scan, sees, use_jit
from hitplanes.weapons.rays import ray_walk

LENGTH, BATCH, SINGLE = 1000, 10_000, 100
SCAN = 300
WORLD = (1920, 1080)
Shots = tuple[np.ndarray, np.ndarray]


def weapons(width: float) -> dict[str, Weapon]:
    """The weapons of the table."""
    return {
        "pistol": Pistol(LENGTH, width=width),
        "rifle, 60 px": Rifle(LENGTH, budget=60, width=width),
        "laser": Laser(LENGTH, width=width),
    }


def sprites() -> list[Sprite]:
    """Discs and stars of 48 px, as an alpha channel would have them."""
    y, x = np.mgrid[:48, :48] - 23.5
    waves = (17 + 6.5 * np.cos(points * np.arctan2(y, x) + points) for points in (0, 5, 7, 3))
    return [Sprite.from_mask(np.hypot(x, y) < np.maximum(wave, 20 * (k == 0))) for k, wave in enumerate(waves)]


def scene_of(objects: int, size_wh: tuple[int, int]) -> Scene:
    """The scene: objects over all of the world, and 60 walls of 20 x 80 px or so."""
    rng = np.random.default_rng(objects)
    scene, shapes = Scene(size_wh), sprites()
    for _ in range(objects):
        where = rng.uniform((0, 0), size_wh)
        scene.add(shapes[rng.integers(len(shapes))], where, angle=float(rng.integers(0, 24) * 15))
    for _ in range(60):
        wall = np.ones(rng.integers((16, 60), (24, 100)), np.bool_)
        scene.add(wall, rng.uniform((0, 0), size_wh), role="occluder", angle=float(rng.integers(0, 4) * 45))
    return scene


def space_of(scene: Scene, ids: np.ndarray | None = None) -> pymunk.Space:
    """The same items, or some of them, as the hulls of their masks."""
    space = pymunk.Space()
    for item in (scene.ids() if ids is None else ids).tolist():
        mask, corner = scene.mask(item)
        y, x = np.nonzero(mask)
        squares = np.concatenate([np.stack([x + i, y + j], axis=1) for i in (-0.5, 0.5) for j in (-0.5, 0.5)])
        hull = cv2.convexHull(squares.astype(np.float32))[:, 0] + corner
        space.add(pymunk.Poly(space.static_body, hull.tolist()))
    space.step(0.001)  # builds its index
    return space


def shots_of(count: int, size_wh: tuple[int, int]) -> Shots:
    """Muzzles and whole degrees."""
    rng = np.random.default_rng(5)
    return rng.uniform((0, 0), size_wh, (count, 2)), rng.integers(0, 360, count).astype(np.float64)


def rays(scene: Scene, weapon: Weapon, shots: Shots, **options: str) -> RayHits:
    """A batch."""
    hits = fire(scene, weapon, shots[0], aim=shots[1], **options)
    assert isinstance(hits, RayHits)
    return hits


def one_by_one(scene: Scene, weapon: Weapon, shots: Shots) -> None:
    """A call for each."""
    for at, aim in zip(*shots, strict=True):
        fire(scene, weapon, at, aim=aim)


def queries(space: pymunk.Space, shots: Shots, radius: float, everything: bool, length: float = LENGTH) -> None:
    """Ask pymunk for the first shape on each ray, or for all."""
    ends = shots[0] + length * np.stack([np.cos(np.radians(shots[1])), np.sin(np.radians(shots[1]))], axis=1)
    segments(space, shots[0], ends, radius, everything)


def segments(
    space: pymunk.Space, starts: np.ndarray, ends: np.ndarray, radius: float = 0, everything: bool = False
) -> None:
    """Ask pymunk for the first shape on each segment, or for all."""
    ask = space.segment_query if everything else space.segment_query_first
    shape_filter = pymunk.ShapeFilter()
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        ask(tuple(start), tuple(end), radius, shape_filter)


@contextmanager
def one_stretch() -> Iterator[None]:
    """Follow rays to their full length at once."""
    edges = ray_walk._edges
    ray_walk._edges = lambda *_: [-np.inf, np.inf]
    try:
        yield
    finally:
        ray_walk._edges = edges


def in_one_stretch(scene: Scene, weapon: Weapon, shots: Shots) -> RayHits:
    """A batch, without stretches."""
    with one_stretch():
        return rays(scene, weapon, shots)


def table(scene: Scene, size_wh: tuple[int, int]) -> None:
    """Times a ray, of batches and of single calls, of ours and of pymunk."""
    batch, single = shots_of(BATCH, size_wh), shots_of(SINGLE, size_wh)
    space = space_of(scene)
    print(
        f"{'weapon':14} {'width':>5} {'batch us':>9} {'pymunk':>7} {'ratio':>6} {'single us':>10} {'ratio':>6} passes"
    )
    for width in (0, 4):
        for name, weapon in weapons(width).items():
            everything = name != "pistol"
            passes = len(rays(scene, weapon, batch).passes) / BATCH  # and warms up
            calls: list[Callable[[], object]] = [
                lambda w=weapon: rays(scene, w, batch),
                lambda e=everything, r=width / 2: queries(space, single, r, e),
                lambda w=weapon: one_by_one(scene, w, single),
            ]
            seconds = least(*calls)
            ours, theirs, alone = (1e6 * s / n for s, n in zip(seconds, (BATCH, SINGLE, SINGLE), strict=True))
            ratios = f"{ours:9.1f} {theirs:7.1f} {ours / theirs:6.2f} {alone:10.0f} {alone / theirs:6.1f}"
            print(f"{name:14} {width:5} {ratios} {passes:6.2f}", flush=True)


def savings(scene: Scene, size_wh: tuple[int, int]) -> None:
    """What stretches and boxes save; the rows are the same."""
    shots = shots_of(1000, size_wh)
    print(f"{'1000 rays':14} {'width':>5} {'us':>9} {'one stretch':>12} {'no boxes':>9}")
    for width in (0, 4):
        for name, weapon in weapons(width).items():
            expected = rays(scene, weapon, shots)
            assert in_one_stretch(scene, weapon, shots) == expected
            calls: list[Callable[[], object]] = [
                lambda w=weapon: rays(scene, w, shots),
                lambda w=weapon: in_one_stretch(scene, w, shots),
            ]
            if len(scene) <= 1100:
                assert rays(scene, weapon, shots, prefilter="none") == expected
                calls.append(lambda w=weapon: rays(scene, w, shots, prefilter="none"))
            plain, *others = (1e3 * s for s in least(*calls))
            print(f"{name:14} {width:5} {plain:9.1f} " + " ".join(f"{t / plain:10.2f} x" for t in others), flush=True)


def ways(scene: Scene, size_wh: tuple[int, int]) -> None:
    """Microseconds of a call of rays by each way to their first hit, and by the one chosen; the rows are the same.

    The distance field is made before.
    """
    print(f"{'way, us':14} {'rays':>5} {'walk':>9} {'cast':>9} {'march':>9} {'auto':>9}")
    for count in (1, 3, 10, 100, 1000):
        shots = shots_of(count, size_wh)
        found = []
        for way in WAYS:
            answer = rays(scene, Pistol(LENGTH), shots, strategy=way)
            assert not found or answer == found[0][0]
            found.append((answer, 1e6 * least(lambda w=way, s=shots: rays(scene, Pistol(LENGTH), s, strategy=w))[0]))
        print(f"{'pistol':14} {count:5} " + " ".join(f"{us:9.0f}" for _, us in found), flush=True)


WAYS = ("walk", "cast", "march", "auto")


def sights(scene: Scene, size_wh: tuple[int, int]) -> None:
    """Microseconds a beam of 10 lidars, and a pair of 60 eyes, beside a loop of pymunk's queries for the first shape.

    Of a scene that moves an object moves before each call. The space of the lines of sight has no objects.
    """
    rng, degrees = np.random.default_rng(7), np.arange(360.0)
    places, eyes = rng.uniform((0, 0), size_wh, (10, 2)), rng.uniform((0, 0), size_wh, (60, 2))
    at, aims = np.repeat(places, len(degrees), axis=0), np.tile(degrees, len(places))
    pairs = np.repeat(eyes, len(eyes), axis=0), np.tile(eyes, (len(eyes), 1))
    space, walls, carrier = space_of(scene), space_of(scene, scene.ids(Role.OCCLUDER)), int(scene.ids(Role.HITTABLE)[0])
    x, y = scene.position(carrier).tolist()
    steps = itertools.cycle((x + step, y) for step in range(4))
    ways: dict[str, Callable[[], object]] = {
        "scan": lambda: scan(scene, places, degrees, SCAN),
        "scan, an owner excluded": lambda: scan(scene, places, degrees, SCAN, exclude=carrier),
        "scan, an object moves": lambda: (scene.move(carrier, next(steps)), scan(scene, places, degrees, SCAN)),
        "sees": lambda: sees(scene, eyes, eyes),
        "sees, an object moves": lambda: (scene.move(carrier, next(steps)), sees(scene, eyes, eyes)),
    }
    print(f"{'10 x 360 beams, 60 x 60 pairs':30} {'us':>7} {'pymunk':>7} {'ratio':>6}")
    for name, ours in ways.items():
        ours()
        theirs = (
            partial(segments, walls, *pairs)
            if name.startswith("sees")
            else partial(queries, space, (at, aims), 0, False, SCAN)
        )
        here, there = (1e6 * s / len(at) for s in least(ours, theirs))
        print(f"{name:30} {here:7.2f} {there:7.2f} {here / there:6.2f}", flush=True)


SEVERAL: dict[str, tuple[Weapon, float, float]] = {
    "laser": (Laser(500), 500, 0),
    "laser, 5 px": (Laser(500, width=5), 500, 2.5),
    "rifle, 3 hits": (Rifle(500, max_hits=3), 500, 0),
    "rifle, 5 px": (Rifle(500, max_hits=3, width=5), 500, 2.5),
    "rifle, 60 px": (Rifle(500, budget=60), 500, 0),
    "projectile": (Projectile(300, radius=4), 300, 4),
}
"""Weapons of rays that go on, with the length and the radius of pymunk's query for all shapes."""


def goes_on(weapon: Weapon, scene: Scene, shots: Shots, compiled: bool) -> None:
    """A batch, in numpy or compiled."""
    use_jit(compiled)
    rays(scene, weapon, shots)


def several(scene: Scene, size_wh: tuple[int, int]) -> None:
    """Microseconds of the processor a ray that goes on, in one run, in turns; a ratio below 1 is faster than pymunk."""
    batch, single, space = shots_of(2000, size_wh), shots_of(SINGLE, size_wh), space_of(scene)
    print(f"{'us a ray':14} {'numpy':>8} {'compiled':>8} {'pymunk':>8} {'ratio':>6} {'ratio':>6}")
    for name, (weapon, length, radius) in SEVERAL.items():
        for compiled in (False, True):
            goes_on(weapon, scene, shots_of(20, size_wh), compiled)  # warms up
        seconds = least(
            partial(goes_on, weapon, scene, batch, False),
            partial(goes_on, weapon, scene, batch, True),
            partial(queries, space, single, radius, True, length),
            clock=time.process_time,
        )
        plain, kernel, theirs = (1e6 * s / n for s, n in zip(seconds, (2000, 2000, SINGLE), strict=True))
        ratios = f"{plain / theirs:6.2f} {kernel / theirs:6.2f}"
        print(f"{name:14} {plain:8.1f} {kernel:8.1f} {theirs:8.1f} {ratios}", flush=True)
    use_jit(None)


def main(counts: list[int], only_several: bool) -> None:
    """Print the tables."""
    worlds = [(count, WORLD) for count in counts]
    worlds += [(count, (10 * WORLD[0], 10 * WORLD[1])) for count in counts if count >= 10_000]
    for objects, size_wh in worlds:
        scene = scene_of(objects, size_wh)
        walls = len(scene.ids(Role.OCCLUDER))
        print(f"\n{objects} objects, {walls} occluders, {size_wh[0]} x {size_wh[1]}; pymunk {pymunk.version}")
        if only_several:
            several(scene, size_wh)
            continue
        table(scene, size_wh)
        savings(scene, size_wh)
        for mode in (False, True) if find_spec("numba") else (False,):
            use_jit(mode)
            print("with compiled kernels" if mode else "in numpy")
            ways(scene, size_wh)
            sights(scene, size_wh)
        use_jit(None)


if __name__ == "__main__":
    given = [int(v) for v in sys.argv[1:] if v != "--several"]
    main(given or [10, 100, 1000, 10_000], "--several" in sys.argv)
