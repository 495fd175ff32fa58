"""The past, a world too large for a plane, and cold starts."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import islice, repeat
from pathlib import Path
from typing import Any

import numpy as np
from speed_clock import Cell, Side, Times, race
from speed_engines import EASIER, Space, Tree
from speed_moving import STEP
from speed_peers import MARGIN, Masks, first, pygame, rendered
from speed_static import Settings, hit_rows, modes, ours, touched
from speed_world import PATTERNS, WORLD, Volleys, items_of, pattern_mask, scene_of, volleys

from hitplanes import Disc, History, fire

__all__ = ["cold", "huge", "rewind"]

TICKS = 64
HUGE = 10**6


def rewind(settings: Settings) -> Iterator[Cell]:
    """1000 shots over 64 ticks in which all objects move, against rects kept for each tick; and what a tick costs."""
    for objects in [m for m in settings.single if m <= 1000]:
        scene = scene_of(objects)
        history, masks = History(scene, TICKS), Masks(items_of(scene))
        ids, rng = scene.ids("hittable"), np.random.default_rng(4)
        xy = scene.position(ids)
        past, recording = [], []
        for _ in range(TICKS):
            xy = np.clip(xy + rng.integers(-STEP, STEP + 1, xy.shape), 0, np.array(WORLD) - 1)
            scene.move(ids, xy)
            begin = time.perf_counter_ns()
            history.record()
            recording.append(time.perf_counter_ns() - begin)
            boxes = scene.box(ids[::-1])
            past.append([pygame.Rect(x, y, x1 - x + 1, y1 - y + 1) for x, y, x1, y1 in boxes.tolist()])
        works = [[work] for work in islice(_at_ticks(settings.rewound, objects), settings.rounds + 1)]
        sides = [
            Side(mode, lambda w, n, h=history: _past(h, w, n), hit_rows, ready=ready, whole=True)
            for mode, ready in modes(settings).items()
        ]
        disc = rendered(pattern_mask(Disc(40)))
        sides.append(Side("A pygame", lambda w, n, m=masks, p=past, d=disc: _masks_past(m, p, d, w, n), list))
        cell = race(Cell("rewind", "disc r=40, 64 ticks", objects), sides, works, settings.rewound, settings.seconds)
        cell.values["record, ns a tick"] = statistics.median(recording)
        yield cell


def _at_ticks(shots: int, seed: int) -> Iterator[Volleys]:
    rng = np.random.default_rng(seed)
    for work in volleys("disc r=40", shots, seed):
        work.lists["tick"] = rng.integers(0, TICKS, shots)
        work.lists["ticks"] = work.lists["tick"].tolist()
        yield work


def _past(history: History, work: Volleys, units: int) -> Any:
    return touched(fire(history, Disc(40), work.at[:units], tick=work.lists["tick"][:units]))


def _masks_past(masks: Masks, past: Sequence[Any], disc: Any, work: Volleys, units: int) -> Any:
    """A, with the rects of the shot's tick."""
    rows: list[Any] = []
    shapes, ids, blocked = masks.masks, masks.ids, masks.blocked
    pattern, dx, dy, w, h = disc
    box = pygame.Rect(0, 0, w, h)
    for shot, (x, y, tick) in enumerate(zip(*first(work, units), work.lists["ticks"], strict=False)):
        rects = past[tick]
        box.topleft = left, top = x + dx, y + dy
        found = box.collidelistall(rects)
        if found:
            rest = pattern.copy()
            rest.erase(blocked, (-MARGIN - left, -MARGIN - top))
            for i in found:
                ox, oy = rects[i].topleft
                count = rest.overlap_area(shapes[i], (ox - left, oy - top))
                if count:
                    rows.append((shot, ids[i], count))
                    rest.erase(shapes[i], (ox - left, oy - top))
    return rows


def huge(settings: Settings) -> Iterator[Cell]:
    """A world of 10^6 x 10^6 px without bounds or occluders; half of the shots lie near objects."""
    objects = settings.huge
    scene = scene_of(objects, None, occluders=0, over_wh=(HUGE, HUGE))
    items = items_of(scene)
    masks, space, tree = Masks(items, None), Space(items), Tree(items)
    middles = scene.position(scene.ids("hittable"))
    for name in ("point", "disc r=40", "ray 1000"):
        weapon: Any = PATTERNS[name]
        works = [[work] for work in islice(_half_near(name, settings.shots, middles), settings.rounds + 1)]
        sides = ours(settings, scene, weapon)
        if name == "ray 1000":
            sides.append(Side("pymunk", space.rays, easier=EASIER))
            sides.append(Side("shapely", lambda w, n: tree.lines(w, n, 1, 0), easier=EASIER + "; in no order"))
        else:
            radius = getattr(weapon, "radius", 0)
            placed = rendered(pattern_mask(weapon))
            batch = _points if placed.w == 1 else _areas
            sides.append(Side("A pygame", lambda w, n, p=placed, b=batch: b(masks, p, w, n), list))
            sides.append(Side("pymunk", lambda w, n, r=radius: space.discs(w, n, r), easier=EASIER))
            sides.append(Side("shapely", lambda w, n, r=radius: tree.discs(w, n, r), easier=EASIER))
        yield race(Cell("huge", name, objects), sides, works, settings.shots, settings.seconds)


def _points(masks: Masks, placed: Any, work: Volleys, units: int) -> Any:
    return masks.points(*first(work, units))


def _areas(masks: Masks, placed: Any, work: Volleys, units: int) -> Any:
    return masks.areas(*first(work, units), repeat(placed))


def _half_near(name: str, shots: int, middles: Any) -> Iterator[Volleys]:
    rng = np.random.default_rng(2)
    for work in volleys(name, shots, 2, area=(0, 0, HUGE, HUGE)):
        near = middles[rng.integers(len(middles), size=shots)] + rng.integers(-60, 61, (shots, 2))
        at = np.where(rng.random(shots)[:, None] < 0.5, np.floor(near), work.at)
        yield Volleys(at, work.aim)


COLD = {
    "python": "pass",
    "import numpy": "import numpy",
    "import hitplanes": "import numpy, hitplanes",
    "first fire": (
        "from hitplanes import Disc, Scene, Sprite, fire; s = Scene((1920, 1080)); "
        "s.add(Sprite.circle(12), (160, 100)); fire(s, Disc(40), (165, 102))"
    ),
    "import pygame": "import os; os.environ['PYGAME_HIDE_SUPPORT_PROMPT'] = '1'; import pygame",
    "import pymunk": "import pymunk",
}


IMPORTS = (
    "import time; a = time.perf_counter_ns(); import numpy; b = time.perf_counter_ns(); import hitplanes; "
    "print(a, b, time.perf_counter_ns())"
)


def cold(settings: Settings) -> Iterator[Cell]:
    """Fresh processes, in turn: what importing adds to numpy, and the first shot."""
    root = Path(__file__).parents[2]
    cell = Cell("cold", "fresh process", 0, unit="ns a start", asked=settings.starts)
    starts = COLD | (
        {"first fire, jit": "from hitplanes import use_jit; use_jit(); " + COLD["first fire"]} if settings.jit else {}
    )
    for number in range(settings.starts + 1):
        for name, code in starts.items():
            begin = time.perf_counter_ns()
            subprocess.run([sys.executable, "-c", code], cwd=root, check=True)  # a timeout would poll
            if number:
                cell.sides.setdefault(name, Times()).rounds.append(float(time.perf_counter_ns() - begin))
    numpy, added = zip(*(_imports(root) for _ in range(settings.starts)), strict=True)
    cell.values["import hitplanes: added to numpy's"] = statistics.median(added) / statistics.median(numpy)
    yield cell


def _imports(root: Path) -> tuple[int, int]:
    """What importing numpy takes in a fresh process, and what the packages take after it, ns."""
    run = [sys.executable, "-c", IMPORTS]
    told = subprocess.run(run, cwd=root, check=True, timeout=60, capture_output=True, text=True)
    before, both, after = map(int, told.stdout.split())
    return both - before, after - both
