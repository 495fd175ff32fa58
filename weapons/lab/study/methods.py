"""Methods of a study: their questions, decisions, errors and costs, and the scenes and shots that they are given."""

from __future__ import annotations

import statistics
import time
import timeit
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints, integer
from hitplanes.planes.common.limits import GOLDEN, HALF, SCALE_BITS, SEED_MAX, SUB
from hitplanes.planes.grid.fixed_point import turned, unit
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene
from hitplanes.planes.scene.sprite import Sprite

from ...fire.call import fire
from ...fire.hits import Hits
from ...kinds.draws import mix64
from ...kinds.placements import ShotColumns
from ...kinds.weapon import Weapon


@dataclass(frozen=True, eq=False)
class Decisions(ShotColumns):
    """Pairs (shot, object) that are hit, (K,) each; all other pairs are misses.

    `xy` are the places hit (K, 2), px, and `share` the part of the shot that lies on the object, 0 to 1; both are NaN
    where a method gives none.
    """

    object: Ints
    xy: Floats
    share: Floats

    @classmethod
    def of(cls, shot: Ints, object: Ints, xy: Floats | None = None, share: Floats | None = None) -> Decisions:  # noqa: A002
        """Make decisions; places and shares that the method does not give become NaN."""
        n = len(shot)
        return cls(
            np.asarray(shot, np.int64),
            np.asarray(object, np.int64),
            np.full((n, 2), np.nan) if xy is None else xy,
            np.full(n, np.nan) if share is None else share,
        )


class Errors(NamedTuple):
    """Numbers of true hits that a method misses and of its false hits, mean errors, and objects of wrong decisions.

    `share` is the mean absolute error over all pairs hit in truth or by the method, `position` the mean distance of
    the place hit from the true one, px, over pairs that both hit; None without such pairs.
    """

    missed: int
    false: int
    share: float | None
    position: float | None
    objects: Ints

    @property
    def wrong(self) -> int:
        """Number of wrong decisions, missed or false."""
        return self.missed + self.false


def errors_of(found: Decisions, truth: Decisions) -> Errors:
    """Compare the decisions of a method with the truth; each holds a pair at most once."""
    shot, item = (np.concatenate([getattr(found, n), getattr(truth, n)]) for n in ("shot", "object"))
    objects = int(item.max(initial=0)) + 1
    pairs, where = np.unique(shot * objects + item, return_inverse=True)
    row = np.full((2, len(pairs)), -1)
    row[0, where[: len(found)]] = np.arange(len(found))
    row[1, where[len(found) :]] = np.arange(len(truth))
    both = (row >= 0).all(axis=0)
    share = [np.where(r >= 0, np.append(d.share, 0.0)[r], 0.0) for r, d in zip(row, (found, truth), strict=True)]
    apart = found.xy[row[0, both]] - truth.xy[row[1, both]]
    missed, false = row < 0
    untold = len(found) and np.isnan(found.share).all()
    off = None if untold else _mean(np.abs(share[0] - share[1]))
    far = _mean(np.sqrt((apart**2).sum(axis=1)))
    return Errors(int(missed.sum()), int(false.sum()), off, far, pairs[missed | false] % objects)


def _mean(values: Floats) -> float | None:
    """Return the mean of the values that are not NaN; None if there are none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None


@dataclass(frozen=True, eq=False)
class Method:
    """A method at one setting (a number in the unit of the curve, a word, or None), which is a point of a curve.

    `prepare` sets it up and returns the function that is timed as a run; `read` converts the answer of a run to
    decisions. `kept_bytes` returns the bytes that stay between runs, given an answer; None traces them, which slows the
    set-up.
    """

    setting: float | str | None
    prepare: Callable[[], Callable[[], Any]]
    read: Callable[[Any], Decisions]
    kept_bytes: Callable[[Any], int] | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """A method at all its settings, from coarse to fine; `setting` names their unit.

    `note` is a caveat for the comparison, for example that the method answers an easier question; `left_out` says why
    a curve has no points.
    """

    name: str
    setting: str = ""
    methods: tuple[Method, ...] = ()
    note: str = ""
    left_out: str = ""


@dataclass(frozen=True, eq=False)
class Question:
    """A question, its true answers and their source, and the curves of the methods that are compared on it.

    `aimed` is the object near which each shot is, (N,), for errors by kind of object; None if that has no meaning.
    `by_share` says whether the error is that of the share instead of the number of wrong decisions.
    """

    name: str
    asks: str
    shots: int
    truth: Decisions
    truth_told: str
    curves: tuple[Curve, ...]
    aimed: Ints | None = None
    by_share: bool = False


RUNS_MAX = 1000  # of a fast method
SLOW = 0.5  # seconds after which a slow method stops, even before the requested number of runs


class Cost(NamedTuple):
    """Seconds of the set-up, seconds of a run (least, median, most of `runs`), bytes kept, and bytes that a run needs.

    The extra time of the first run counts as set-up, as much is built at first use.
    """

    setup: float
    least: float
    median: float
    most: float
    runs: int
    kept_bytes: int
    run_bytes: int


def measured(method: Method, runs: int, seconds: float) -> tuple[Any, Cost]:
    """Set a method up, run it to warm up, then time `runs` runs and at least `seconds` seconds; fewer if it is slow.

    Memory is traced in a separate run, as tracing takes time. Returned are the answer of a run, and the cost.
    """
    begin = time.perf_counter()
    run = method.prepare()
    answer = run()
    setup = time.perf_counter() - begin
    times: list[float] = []
    while not times or (len(times) < RUNS_MAX and sum(times) < (max(seconds, SLOW) if len(times) < runs else seconds)):
        times.append(timeit.timeit(run, number=1))  # without garbage collection

    def again() -> Any:
        """Set up once more, with the first run."""
        own = method.prepare()
        own()
        return own

    kept = _traced(again)[0] if method.kept_bytes is None else method.kept_bytes(answer)
    least = min(times)
    middle, most = statistics.median(times), max(times)
    return answer, Cost(max(setup - least, 0.0), least, middle, most, len(times), kept, _traced(run)[1])


def _traced(call: Callable[[], Any]) -> tuple[int, int]:
    """Return the bytes that the result of a call keeps, and the most that the call needs at once."""
    tracemalloc.start()
    try:
        _kept = call()
        return tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()


Target = tuple[int, Bools, tuple[int, int]]  # an object's id, its mask (h, w), and the pixel of the world at [0, 0]
SHOTS_MAX = 10**6  # of a study; all decisions of a method are in memory
TRIES = 1000  # most tries per shot, before the scene is an error for lack of room


def targets_of(scene: Scene) -> list[Target]:
    """Return the hittable objects that have pixels, front to back: highest layer first, then latest added."""
    ids = scene.ids(Role.HITTABLE)
    order = np.lexsort((-ids, -scene.layer(ids)))
    targets = [(item, *scene.mask(item)) for item in ids[order].tolist()]
    return [target for target in targets if target[1].any()]


def velocities_of(scene: Scene, targets: list[Target]) -> Ints:
    """Return how far targets move in a frame, (M, 2) in 1/256 px."""
    rows = scene.items.table.rows(np.array([item for item, _, _ in targets], np.int64))
    return np.asarray(scene.items.velocity_256[rows])


def size_of(targets: list[Target]) -> float:
    """Return the median size of targets (mean of width and height), px; 1 if there are none."""
    return float(np.median([sum(mask.shape) / 2 for _, mask, _ in targets])) if targets else 1.0


def drawn_for(scene: Scene, shots: object, seed: object) -> tuple[int, int, Scene, list[Target]]:
    """Check the number of shots and the seed; return them, a copy of the hittable objects, and these as targets."""
    shots, seed = integer("shots", shots, 1, SHOTS_MAX), integer("seed", seed, 0, SEED_MAX)
    alone = copied(scene, scene.ids(Role.HITTABLE))
    return shots, seed, alone, targets_of(alone)


def drawn_places(
    targets: list[Target], shots: int, seed: int, grow_256: int, taken: Callable[[Ints], Bools]
) -> tuple[Ints, Floats, Ints]:
    """Draw random places and directions, each in the grown box of a random object; around (0, 0) without objects.

    Each try takes four draws of splitmix64: object, x, y, angle. A taken place is replaced by the next try.
    Boxes are grown on all sides by `grow_256`; `taken` returns which of the places (n, 2) are refused. Returned are
    places (shots, 2) in 1/256 px, angles (shots,) in degrees, and the target near each place (shots,).
    """
    boxes = np.array([[x, y, x + m.shape[1] - 1, y + m.shape[0] - 1] for _, m, (x, y) in targets] or [[0, 0, 0, 0]])
    low, high = SUB * boxes[:, :2] - HALF - grow_256, SUB * boxes[:, 2:] + HALF + grow_256
    places, angles, near = [np.zeros((0, 2), np.int64)], [np.zeros(0)], [np.zeros(0, np.int64)]
    begin = free = 0
    while free < shots:
        if begin > TRIES * shots:
            raise InputError(f"scene: expected room between its objects, got {free} free places of {begin} drawn")
        number = np.arange(4 * begin, 4 * (begin + shots), dtype=np.uint64) + np.uint64(1)
        words = mix64(mix64(np.array([seed], np.uint64)) + number * GOLDEN).reshape(shots, 4).astype(object)
        which = (words[:, 0] % len(boxes)).astype(np.int64)
        xy = low[which] + (words[:, 1:3] % (high - low + 1)[which]).astype(np.int64)
        good = np.flatnonzero(~taken(xy))
        places.append(xy[good])
        angles.append(words[good, 3].astype(np.float64) * (360 / 2.0**64))
        near.append(which[good])
        begin, free = begin + shots, free + len(good)
    return np.concatenate(places)[:shots], np.concatenate(angles)[:shots], np.concatenate(near)[:shots]


def ahead(length: float, degrees: Floats) -> Ints:
    """Return steps (N, 2) of a length in px along angles, rounded once to 1/256 px."""
    along = np.stack([np.full(len(degrees), round(SUB * length)), np.zeros(len(degrees), np.int64)], axis=1)
    return turned(along, *unit(degrees))


def fired_method(
    setting: float | str | None, scene: Scene, weapon: Weapon, read: Callable[[Any], Decisions], **arguments: Any
) -> Method:
    """Make a method that fires a batch in one call of `fire` with `arguments`; its set-up copies the scene."""

    def prepare() -> Callable[[], Hits]:
        own = copied(scene, scene.ids())
        return lambda: fire(own, weapon, **arguments)

    return Method(setting, prepare, read)


def scaled(xy: Floats, factor: float) -> Floats:
    """Scale points so that the edges of pixels stay edges of pixels."""
    return (xy + 0.5) * factor - 0.5


def copied(scene: Scene, ids: Ints, factor: float = 1.0) -> Scene:
    """Copy objects at a scale to a scene without bounds and occluders; ids count from 0 in the given order.

    Shapes are filled at that scale, and masks are resampled from their frames. Layers stay.
    """
    alone, items = Scene(), scene.items
    for row in items.table.rows(ids).tolist():
        transform, place = items.transforms[row], scaled(items.position_256[row] / SUB, factor).tolist()
        alone.add(
            items.sprites[row], place, angle=items.angles[row], flip=transform.flip, frame=transform.frame,
            scale=[v / (1 << SCALE_BITS) * factor for v in (transform.scale_x, transform.scale_y)],
            layer=int(items.layer[row]), name=items.names[row],
            velocity_xy=(items.velocity_256[row] / SUB * factor).tolist(),
        )  # fmt: skip
    return alone


def enlarged(scene: Scene, ids: Ints, factor: int) -> Scene:
    """Copy objects like `copied`, with each pixel of their masks as a square of `factor` by `factor` pixels."""
    alone, square = Scene(), np.ones((factor, factor), np.bool_)
    for item in ids.tolist():
        mask, (x, y) = scene.mask(item)
        big = Sprite.from_mask(np.kron(mask, square), pivot_xy=(0, 0))
        alone.add(big, (factor * x, factor * y), layer=int(scene.layer(item)))
    return alone
