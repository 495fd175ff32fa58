"""Pre-filters and broad phases in one run: microseconds a shot, pairs tested, and how many of them shared no pixel.

python tests/bench/prefilters.py [objects ...]
"""

from __future__ import annotations

import sys
import time

import numpy as np

from hitplanes import Beam, Cone, Disc, Point, Ring, Scene, Spread, Sprite, Weapon, fire

WEAPONS: dict[str, Weapon] = {
    "point": Point(),
    "shotgun 8 x r=2": Spread(Disc(2), count=8, radius=24),
    "disc r=40": Disc(40),
    "beam 600 x 5": Beam(length=600, width=5),
    "cone r=200": Cone(reach=200, angle=30),
    "ring r=150": Ring(146, 150),
}
PREFILTERS = ("none", "box", "circle", "oriented box", "4 boxes", "polygon", "swept")
BROADPHASES = ("none", "grid", "quadtree", "bvh")
SHOTS, ROUNDS = 400, 3


def scene_of(objects: int, rng: np.random.Generator) -> Scene:
    """Objects of 24 to 70 px, long and thin or round, turned, over a world that they fill to a third."""
    side = int(1000 * (objects / 300) ** 0.5) + 200
    scene = Scene((side, side))
    y, x = np.mgrid[:48, :48] - 23.5
    sprites = []
    for k in range(24):
        wave = 17 + 6 * np.sin(k % 5 * np.arctan2(y, x) + k)
        sprites.append(Sprite.from_mask(np.hypot(x, y * (1 + k % 4)) < wave))
    for _ in range(objects):
        where, angle = rng.uniform(0, side, 2), float(rng.integers(0, 36) * 10)
        scene.add(sprites[rng.integers(24)], where, angle=angle, scale=float(rng.choice([0.5, 1, 1.5])))
    return scene


def timed(scene: Scene, weapon: Weapon, prefilter: str, broadphase: str) -> tuple[float, int, int, int]:
    """Least microseconds a shot; pairs tested, possible, and with a row."""
    rng = np.random.default_rng(3)
    assert scene.bounds
    best, hits = float("inf"), None
    for _ in range(ROUNDS):
        at, aim = rng.uniform(0, scene.bounds[2], (SHOTS, 2)), rng.integers(0, 24, SHOTS) * 15.0
        begin = time.perf_counter()
        hits = fire(scene, weapon, at, aim=aim, strategy="direct", prefilter=prefilter, broadphase=broadphase)
        best = min(best, (time.perf_counter() - begin) / SHOTS * 1e6)
    assert hits is not None
    (stage,) = (stage for stage in hits.plan.ran if stage.name == "pre-filter")
    assert stage.pairs
    return best, *stage.pairs, int(hits.pellets.sum())


def main(counts: list[int]) -> None:
    """Print the tables."""
    for objects in counts:
        scene = scene_of(objects, np.random.default_rng(1))
        print(f"\n{objects} objects, {SHOTS} shots, direct\n{'weapon':16} {'pre-filter':13}", end="")
        print(f" {'us':>8} {'of box':>7} {'tested':>8} {'of all':>8} {'no pixel':>9}")
        for name, weapon in WEAPONS.items():
            results = {f: timed(scene, weapon, f, "none") for f in PREFILTERS if f != "none" or objects <= 1000}
            for prefilter, (us, tested, possible, met) in results.items():
                share = f"{tested / SHOTS:8.1f} {tested / possible:8.2%} {1 - met / max(tested, 1):9.1%}"
                print(f"{name:16} {prefilter:13} {us:8.1f} {us / results['box'][0]:7.2f} {share}")
        print(f"{'weapon':16} {'broad phase':13} {'us':>8} {'of none':>7}")
        for name, weapon in WEAPONS.items():
            times = {b: timed(scene, weapon, "box", b)[0] for b in BROADPHASES}
            for broadphase, us in times.items():
                print(f"{name:16} {broadphase:13} {us:8.1f} {us / times['none']:7.2f}")


if __name__ == "__main__":
    main([int(v) for v in sys.argv[1:]] or [100, 1000, 10_000])
