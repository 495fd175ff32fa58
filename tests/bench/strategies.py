"""Direct against composed, in one run: microseconds a shot, their ratio, and whether the planner chose well.

python tests/bench/strategies.py
"""

from __future__ import annotations

import time

import numpy as np

from planes import Scene
from weapons import Disc, Hits, Point, Spread, Weapon, fire

WEAPONS: dict[str, Weapon] = {
    "point": Point(),
    "shotgun 8 x r=2": Spread(Disc(2), count=8, radius=24),
    "disc r=10": Disc(10),
    "disc r=40": Disc(40),
}


def scene_of(objects: int, rng: np.random.Generator) -> Scene:
    """1920 x 1080 with irregular objects of 48 px and 60 occluders."""
    scene = Scene((1920, 1080))
    y, x = np.mgrid[:48, :48] - 23.5
    for i in range(objects + 60):
        wave = 17 + 6 * np.sin(rng.integers(2, 7) * np.arctan2(y, x) + rng.uniform(0, 6))
        where = rng.uniform((0, 0), (1920, 1080))
        scene.add(np.hypot(x, y) < wave, where, role="hittable" if i < objects else "occluder", layer=int(i >= objects))
    return scene


def timed(scene: Scene, weapon: Weapon, strategy: str, shots: int, rng: np.random.Generator) -> tuple[float, Hits]:
    """Least microseconds a shot of three rounds, each with fresh shots."""
    best, hits = float("inf"), None
    for _ in range(3):
        at = rng.uniform((0, 0), (1920, 1080), (shots, 2))
        begin = time.perf_counter()
        hits = fire(scene, weapon, at, strategy=strategy)
        best = min(best, (time.perf_counter() - begin) / shots * 1e6)
    assert hits is not None
    return best, hits


def main() -> None:
    """Print the table."""
    rng = np.random.default_rng(1)
    print(f"{'objects':>8} {'shots':>6} {'weapon':16} {'direct us':>10} {'composed us':>12} {'ratio':>6}  planner")
    for objects in (10, 100, 1000):
        scene = scene_of(objects, rng)
        for shots in (1, 100, 5000):
            for name, weapon in WEAPONS.items():
                direct, _ = timed(scene, weapon, "direct", shots, rng)
                composed, _ = timed(scene, weapon, "composed", shots, rng)
                _, hits = timed(scene, weapon, "auto", shots, rng)
                chosen = "composed" if any(stage.name == "code plane" for stage in hits.plan.ran) else "direct"
                lost = {"direct": direct, "composed": composed}[chosen] / min(direct, composed)
                times = f"{direct:10.2f} {composed:12.2f} {direct / composed:6.2f}"
                print(f"{objects:8} {shots:6} {name:16} {times}  {chosen} {lost:.2f}")


if __name__ == "__main__":
    main()
