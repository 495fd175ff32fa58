"""Worlds of any extent: peak memory and time of shots and rays, where only the distances between objects differ.

python tests/bench/extent.py [objects]

Each row is a process of its own: 5,000 objects, without bounds, over a square of some side, some way from the origin.
Memory is what Python and numpy allocate at most during the calls (tracemalloc), and the most that the process ever had
resident, less what it had before the scene was made. It goes with the masks and with what is met, not with the extent.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np

from hitplanes import Beam, Disc, Hits, Laser, Pistol, Projectile, Scene, Sprite, Weapon, fire

SHOTS, RANGE = 1000, 1000
WORLDS = [
    *((side, 0, 1) for side in (10**4, 10**5, 10**6, 10**9)),
    *((10**6, away, 1) for away in (10**3, 10**9, 10**12)),
    *((10**6, 0, scale) for scale in (2, 4)),
]
"""Side of the square, how far it is away, px, and the scale of the masks."""

WEAPONS: dict[str, Weapon] = {
    "disc r=40": Disc(40),
    "beam 600": Beam(length=600, width=5),
    "pistol": Pistol(RANGE),
    "laser w=4": Laser(RANGE, width=4),
    "laser 10^6": Laser(10**6),
    "projectile": Projectile(RANGE, 3),
}


def scene_of(objects: int, side: int, away: int, scale: int) -> Scene:
    """Stars of 48 px; the same masks in every world."""
    rng = np.random.default_rng(4)
    y, x = np.mgrid[:48, :48] - 23.5
    sprites = [Sprite.from_mask(np.hypot(x, y) < 17 + 6 * np.cos(k * np.arctan2(y, x))) for k in (0, 3, 5, 7)]
    scene = Scene()
    for where in rng.uniform(0, 1, (objects, 2)):
        scene.add(
            sprites[rng.integers(4)], np.rint(where * side) + away, angle=float(rng.integers(0, 24) * 15), scale=scale
        )
    return scene


def shots_at(scene: Scene, weapon: Weapon) -> Hits:
    """One batch: each shot is fired from 100 px beside an object, towards it or not."""
    rng = np.random.default_rng(6)
    ids = rng.choice(scene.ids(), SHOTS)
    aim = rng.integers(0, 360, SHOTS).astype(np.float64)
    box = scene.box(ids).astype(np.float64)
    beside = 100 * np.stack([np.cos(np.radians(aim)), np.sin(np.radians(aim))], axis=1)
    return fire(scene, weapon, (box[:, :2] + box[:, 2:]) / 2 - np.rint(beside), aim=aim)


def resident() -> float:
    """Most memory that the process had so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(objects: int, side: int, away: int, scale: int) -> dict[str, object]:
    """What one world costs: MB, and for each weapon rows, peak MB and microseconds a shot."""
    fire(scene_of(10, 1000, 0, 1), Disc(40), (0, 0))  # loads what is loaded late
    before = resident()
    tracemalloc.start()
    scene = scene_of(objects, side, away, scale)
    made = tracemalloc.get_traced_memory()[0] / 2**20
    told: dict[str, list[float]] = {}
    for name, weapon in WEAPONS.items():
        shots_at(scene, weapon)  # masks, patterns and indexes are there from now on
        tracemalloc.reset_peak()
        base = tracemalloc.get_traced_memory()[0]
        rows = len(shots_at(scene, weapon))
        told[name] = [rows, (tracemalloc.get_traced_memory()[1] - base) / 2**20, 0.0]
    tracemalloc.stop()
    for name, weapon in WEAPONS.items():
        times = []
        for _ in range(3):
            begin = time.perf_counter()
            shots_at(scene, weapon)
            times.append(time.perf_counter() - begin)
        told[name][2] = min(times) / SHOTS * 1e6
    return {"scene": made, "resident": resident() - before, "weapons": told}


def main(objects: int) -> None:
    """Print the table."""
    print(f"{objects} objects, {SHOTS} shots; rows, peak MB of a call, us a shot")
    print(
        f"{'side':>7} {'away':>7} {'scale':>5} {'scene MB':>8} {'rss MB':>7} "
        + "".join(f"{name:>22}" for name in WEAPONS)
    )
    for side, away, scale in WORLDS:
        command = [sys.executable, __file__, "one", *map(str, (objects, side, away, scale))]
        root = Path(__file__).parents[2]
        run = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root)
        told = json.loads(run.stdout)
        cells = "".join(f"{rows:8} {peak:6.1f} {us:6.1f}" for rows, peak, us in told["weapons"].values())
        print(f"{side:7.0e} {away:7.0e} {scale:5} {told['scene']:8.1f} {told['resident']:7.1f} {cells}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        print(json.dumps(measure(*map(int, sys.argv[2:]))))
    else:
        main(int(sys.argv[1]) if sys.argv[1:] else 5000)
