"""What each kind of volume costs and how wrong it is: the duck of the picture of volumes, and sprites of the gallery.

python tests/bench/volumes.py

A disc of radius 6 is placed at every whole pixel near a sprite. False hits: of the places that a volume keeps against
the circle around the disc (against its box for "box by box"), the share where the pixels share none. Places are worked
out one and all, so these shares are exact; times are the least of three, in ns a pair of a batch. Conservative, exact.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fixtures"))

from fitted import FITS, Bools, false_area, numbers_of

from hitplanes import Disc, Scene, Sprite, fire, load_scene
from hitplanes.planes.volumes import fit
from hitplanes.planes.volumes.overlap import overlap
from hitplanes.planes.volumes.volumes import Volumes

RADIUS = 6
PAIRS, ROUNDS = 100_000, 3
OBJECTS = ("duck 1", "robot", "rabbit", "bandit", "teddy", "clown", "bottle", "hoop")
BOXES, PIXELS = "box by box", "pixels, by fire"


Fit = Callable[[Bools], Volumes]


class Cost(NamedTuple):
    """Of one kind: float64 stored, shares of false area and of false hits, ms to fit, ns a pair to test and exactly."""

    numbers: float
    false_area: float
    false_hits: float
    fit_ms: float
    test_ns: float
    exact_ns: float


def masks() -> dict[str, Bools]:
    """Masks of the frames of objects of the gallery."""
    scene = load_scene(Path(__file__).resolve().parents[2] / "fixtures" / "gallery")
    found = {}
    for name in OBJECTS:
        item = scene.find(name)
        found[name] = scene.sprite(item).frames[scene.frame(item)].mask
    return found


def disc() -> Bools:
    """Mask of the disc."""
    y, x = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1]
    return np.asarray(x * x + y * y <= RADIUS * RADIUS)


def places(mask: Bools) -> np.ndarray:
    """Every whole pixel (n, 2) from where a disc could meet a volume of a mask."""
    (h, w), reach = mask.shape, RADIUS + max(mask.shape) // 2
    y, x = np.mgrid[-reach : h + reach, -reach : w + reach]
    return np.stack([x.ravel(), y.ravel()], axis=1)


def met(mask: Bools, at: np.ndarray) -> Bools:
    """Tell whether the pixels of a disc at places (n, 2) share one with a mask."""
    low, high = at.min(axis=0) - RADIUS, at.max(axis=0) + RADIUS + 1
    plane = np.zeros((high - low)[::-1], np.bool_)
    plane[-low[1] : len(mask) - low[1], -low[0] : mask.shape[1] - low[0]] = mask
    found = np.zeros(len(at), np.bool_)
    for y, x in np.argwhere(disc()) - RADIUS:
        found |= plane[at[:, 1] + y - low[1], at[:, 0] + x - low[0]]
    return found


def discs_at(at: np.ndarray, of_disc: Fit) -> Volumes:
    """Volumes of the disc at places (n, 2)."""
    pattern = of_disc(disc()).translated((-RADIUS, -RADIUS))
    return pattern.take(np.zeros(len(at), np.int64)).translated(at.astype(np.float64))


def false_hits(volume: Volumes, mask: Bools, of_disc: Fit = fit.least_circle) -> float:
    """Share of the places that a volume keeps where the pixels share none; no hit may be lost."""
    at = places(mask)
    truth, discs = met(mask, at), discs_at(at, of_disc)
    kept, exact = overlap(volume, discs, conservative=True), overlap(volume, discs)
    assert not (truth & ~exact).any() and not (exact & ~kept).any(), "a hit is lost"
    edge = ((at == at.min(axis=0)) | (at == at.max(axis=0))).any(axis=1)
    assert not (kept & edge).any(), "there are more places"
    return float(1 - truth.sum() / kept.sum())


def calls_of(make: Fit, mask: Bools, of_disc: Fit) -> list[Callable[[], object]]:
    """What is timed of one kind: the fit, and a batch of tests twice."""
    volume, at = make(mask), places(mask)
    discs = discs_at(at[np.random.default_rng(1).integers(0, len(at), PAIRS)], of_disc)
    return [lambda: make(mask), *(lambda c=c: overlap(volume, discs, conservative=c) for c in (True, False))]


def pixel_calls(mask: Bools) -> list[Callable[[], object]]:
    """Check `fire` with boxes before the pixels, and time it twice."""
    scene, at = Scene(), places(mask)
    scene.add(Sprite.from_mask(mask, pivot_xy=(0, 0)), (0, 0))
    assert np.array_equal(np.diff(fire(scene, Disc(RADIUS), at).starts) > 0, met(mask, at))
    some = at[np.random.default_rng(1).integers(0, len(at), PAIRS)]
    shots = {"strategy": "direct", "prefilter": "box", "broadphase": "none"}
    return [lambda: None, *[lambda: fire(scene, Disc(RADIUS), some, **shots)] * 2]


def least_times(calls: dict[str, list[Callable[[], object]]]) -> dict[str, list[float]]:
    """Least of a few times of each call, s: in turn, so that what else the machine does is shared."""
    least = {name: [float("inf")] * len(some) for name, some in calls.items()}
    for _ in range(ROUNDS):
        for name, some in calls.items():
            for k, call in enumerate(some):
                begin = time.perf_counter()
                call()
                least[name][k] = min(least[name][k], time.perf_counter() - begin)
    return least


def costs(mask: Bools) -> dict[str, Cost]:
    """Measure every kind on one mask."""
    kinds = {BOXES: (fit.box, fit.box), **{name: (make, fit.least_circle) for name, make in FITS.items()}}
    calls = {name: calls_of(make, mask, of_disc) for name, (make, of_disc) in kinds.items()}
    times = least_times({**calls, PIXELS: pixel_calls(mask)})
    wrong = {PIXELS: (float(mask.size), 0.0, 0.0)}
    for name, (make, of_disc) in kinds.items():
        volume = make(mask)
        hits = false_hits(volume, mask, of_disc)
        wrong[name] = (float(numbers_of(volume)), false_area(volume, int(mask.sum())), hits)
    per_pair = 1e9 / PAIRS
    return {name: Cost(*wrong[name], f * 1e3, t * per_pair, e * per_pair) for name, (f, t, e) in times.items()}


def mean(every: Sequence[Cost]) -> Cost:
    """Mean of costs."""
    return Cost(*(np.mean(column) for column in zip(*every, strict=True)))


def table(title: str, found: dict[str, Cost]) -> None:
    """Print one table."""
    print(f"\n{title}\n{'volume':23} {'numbers':>7} {'false area':>10} {'false hits':>10} {'fit ms':>7}", end="")
    print(f" {'test ns':>8} {'of boxes':>8} {'exact ns':>8} {'of boxes':>8}")
    base = found[BOXES]
    for name, cost in found.items():
        print(
            f"{name:23} {cost.numbers:7.0f} {cost.false_area:10.0%} {cost.false_hits:10.0%} {cost.fit_ms:7.2f}", end=""
        )
        for ns, boxes in ((cost.test_ns, base.test_ns), (cost.exact_ns, base.exact_ns)):
            print(f" {ns:8.1f} {ns / boxes:8.1f}", end="")
        print()


def main() -> None:
    """Print the tables."""
    found = {name: costs(mask) for name, mask in masks().items()}
    table(f"{OBJECTS[0]}, {PAIRS:,} pairs", found[OBJECTS[0]])
    every = {kind: mean([one[kind] for one in found.values()]) for kind in found[OBJECTS[0]]}
    table(f"mean of {', '.join(found)}", every)


if __name__ == "__main__":
    main()
