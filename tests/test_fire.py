"""What a shot hits, against the stack walked one sample at a time; and the laws that change no row."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, reduce
from typing import Any

import numpy as np
import oracle_raster
import oracle_shelter
import oracle_stack
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import (
    ALL,
    Beam,
    Box,
    Cone,
    Disc,
    Hits,
    InputError,
    Point,
    Polygon,
    Ring,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Weapon,
    fire,
    prepare,
)
from hitplanes.weapons.kinds.areas import AreaWeapon
from hitplanes.weapons.kinds.draws import disc_offsets
from hitplanes.weapons.kinds.placements import Shots, checked_shots

Pixel = tuple[int, int]
Bounds = tuple[int, int, int, int]
Row = tuple[int, int, int, int, int, int, int, Pixel, int]
"""A row as `Hits` yields it: shot, round, then a row of the oracle."""

ONE = 2**30
FAR = 10**9
SCENES_IN_PART = 100
PARTS, LONG_PARTS = 1, 40
PREFILTERS = ("box", "circle", "oriented box", "1 boxes", "3 boxes", "polygon", "swept")


# The oracle: from a scene and the arguments of `fire` to rows and verdict counts, one sample at a time


def items_of(scene: Scene) -> list[oracle_stack.Item]:
    """What decides, in the order it was added, each with its world pixels."""
    roles = dict.fromkeys(scene.ids("hittable").tolist(), False) | dict.fromkeys(scene.ids("occluder").tolist(), True)
    found = []
    for item in sorted(roles):
        mask, (x, y) = scene.mask(item)
        pixels = frozenset((x + i, y + j) for j, i in np.argwhere(mask).tolist())
        columns = scene.layer(item), scene.categories_of(item), scene.owner(item)
        found.append(oracle_stack.Item(item, roles[item], *map(int, columns), pixels))
    return found


def snapped(v: float) -> int:
    """To 1/256 px, half to even."""
    return round(float(v) * 256)


def weight_of(d2: int, falloff: str | None, reach_256: int) -> int:
    """Weight at a squared distance: 65535 - floor(65535 d / reach), at least 0, then smoothstep, rounded down."""
    if falloff is None:
        return 65535
    if reach_256 == 0:
        return 65535 if d2 == 0 else 0
    # floor(sqrt(a / b)) = isqrt(floor(a / b))
    linear = max(65535 - math.isqrt((65535 * 256) ** 2 * d2 // reach_256**2), 0)
    return linear if falloff == "linear" else linear * linear * (3 * 65535 - 2 * linear) // 65535**2


direction_of = lru_cache(maxsize=None)(oracle_raster.unit)


@lru_cache(maxsize=64)
def pattern_of(plain: AreaWeapon, c: int, s: int) -> list[tuple[Pixel, int]]:
    """Pixels of a plain weapon about its origin, and their weights."""
    spans = plain.spans(c, s)
    runs = zip(spans.y.tolist(), spans.x_first.tolist(), spans.x_last.tolist(), strict=True)
    pixels = [(x, y) for y, first, last in runs for x in range(first, last + 1)]
    return [((x, y), weight_of(x * x + y * y, plain.falloff, plain.reach_256)) for x, y in pixels]


def parts_of(weapon: Weapon) -> tuple[Rounds | None, Spread | None, AreaWeapon]:
    """The burst, the spread and the plain weapon in a weapon."""
    burst = weapon if isinstance(weapon, Rounds) else None
    inner = burst.weapon if burst else weapon
    spread = inner if isinstance(inner, Spread) else None
    plain = spread.pellet if spread else inner
    assert isinstance(plain, AreaWeapon)
    return burst, spread, plain


def rounds_of(
    weapon: Weapon, at: Sequence[float], aim: float | None, toward: Sequence[float] | None, seed: int, number: int
) -> Iterator[tuple[Pixel, list[tuple[Pixel, list[tuple[Pixel, int]]]]]]:
    """For each round of one shot its pixel, and for each of its pellets its own pixel and the samples."""
    burst, spread, plain = parts_of(weapon)
    x, y = (snapped(v) for v in at)
    c, s = direction_of(aim or 0.0)
    if toward is not None:
        c, s = oracle_raster.unit_toward(snapped(toward[0]) - x, snapped(toward[1]) - y)
    for n in range(burst.count if burst else 1):
        shift, turn = (0, 0), (ONE, 0)
        if burst:
            shift = (n * snapped(burst.recoil_xy[0]), n * snapped(burst.recoil_xy[1]))
            turn = direction_of(burst.recoil_deg * n)
        origin = ((x + shift[0] + 128) // 256, (y + shift[1] + 128) // 256)
        pattern = pattern_of(plain, *oracle_raster.turned((c, s), *turn))
        pellets = []
        for pellet in range(spread.count if spread else 1):
            dx, dy = origin
            if spread:
                numbers = np.array([seed], np.uint64), np.array([number]), np.array([n])
                offset = disc_offsets(snapped(spread.radius), *numbers, pellet + 1)[0, pellet].tolist()
                dx, dy = dx + offset[0], dy + offset[1]
            pellets.append(((dx, dy), [((px + dx, py + dy), weight) for (px, py), weight in pattern]))
        yield origin, pellets


@dataclass
class Shot:
    """The arguments of one shot."""

    at: tuple[float, float]
    aim: float | None = None
    toward: tuple[float, float] | None = None
    accept: int = ALL
    blocked_by: int = ALL
    exclude: tuple[int, ...] = ()
    number: int = 0


@dataclass
class Placements:
    """A weapon and a batch of shots; all of them have an aim, or all a target."""

    weapon: Weapon
    shots: list[Shot]
    seed: int = 0

    def fired(self, scene: Scene, shift: Pixel = (0, 0), **options: Any) -> Hits:
        """Fire the batch, shifted."""
        at = np.array([s.at for s in self.shots]).reshape(-1, 2) + shift
        return fire(scene, self.weapon, at, seed=self.seed, **self._each(shift), **options)

    def alone(self, scene: Scene, which: int, **options: Any) -> Hits:
        """Fire one of the shots alone, under its number."""
        one = Placements(self.weapon, [self.shots[which]], self.seed)
        return fire(scene, self.weapon, one.shots[0].at, seed=self.seed, **one._each((0, 0)), **options)

    def _each(self, shift: Pixel) -> dict[str, Any]:
        shots = self.shots
        width = max((len(s.exclude) for s in shots), default=0)
        each: dict[str, Any] = {"accept": [s.accept for s in shots], "shot": [s.number for s in shots]}
        each["blocked_by"] = [s.blocked_by for s in shots]
        if width:
            each["exclude"] = [[*s.exclude, *[-1] * (width - len(s.exclude))] for s in shots]
        if shots and shots[0].toward is not None:
            each["toward"] = np.array([s.toward for s in shots]) + shift
        else:
            each["aim"] = [s.aim or 0.0 for s in shots]
        return each


def expected(
    scene: Scene, volley: Placements, items: Sequence[oracle_stack.Item] | None = None
) -> tuple[list[Row], list[dict[str, int]]]:
    """All rows of a batch and the verdict counts of each shot, by the oracle; `items` instead of the scene's own."""
    items, plain = items_of(scene) if items is None else items, parts_of(volley.weapon)[2]
    rows: list[Row] = []
    verdicts = []
    for which, shot in enumerate(volley.shots):
        counts = dict.fromkeys(oracle_stack.VERDICTS, 0)
        every = rounds_of(volley.weapon, shot.at, shot.aim, shot.toward, volley.seed, shot.number)
        for number, (origin, pellets) in enumerate(every):
            how: dict[str, Any] = {"accept": shot.accept, "blocked_by": shot.blocked_by, "exclude": shot.exclude}
            how |= {"pierce": plain.pierce, "bounds": scene.bounds, "origin_xy": origin}
            if plain.line_of_sight is None:
                found, fell = oracle_stack.fire_one(items, [samples for _, samples in pellets], **how)
            else:
                how |= {"line_of_sight": plain.line_of_sight, "inside": plain.inside}
                found, fell = oracle_shelter.fire_sheltered(items, pellets, **how)
            rows += [(which, number, *row) for row in found]
            counts = {verdict: n + fell[verdict] for verdict, n in counts.items()}
        verdicts.append(counts)
    return rows, verdicts


def told(hits: Hits) -> tuple[list[Row], list[dict[str, int]]]:
    """The same of the project's answer."""
    return [tuple(row) for row in hits], [hits.verdict_counts(i) for i in range(len(hits.shots))]


def moved(rows: Sequence[Row], shift: Pixel) -> list[Row]:
    """Rows with their first pixels shifted."""
    return [(*row[:7], (row[7][0] + shift[0], row[7][1] + shift[1]), row[8]) for row in rows]


# Random scenes


@dataclass
class Battle:
    """A scene as a recipe, so that it can be built again elsewhere, and what is fired at it."""

    size_wh: tuple[int, int] | None
    origin_xy: Pixel
    volley: Placements
    objects: list[tuple[Sprite, tuple[float, float], dict[str, Any]]] = field(default_factory=list)

    def scene(self, shift: Pixel = (0, 0)) -> Scene:
        """Build it, shifted by whole pixels."""
        dx, dy = shift
        scene = Scene(self.size_wh, (self.origin_xy[0] + dx, self.origin_xy[1] + dy))
        for sprite, (x, y), pose in self.objects:
            scene.add(sprite, (x, y) if pose["role"] == "hud" else (x + dx, y + dy), **pose)
        return scene


def some_mask(rng: random.Random, side: int = 14) -> np.ndarray:
    """A mask with holes; sometimes one pixel, sometimes none."""
    w, h = (1, 1) if rng.random() < 0.15 else (rng.randint(2, side), rng.randint(2, side))
    chance = rng.choice([0.0, 0.4, 0.7, 0.7, 0.9, 0.9, 0.9, 0.9, 1.0, 1.0])
    return np.array([[rng.random() < chance for _ in range(w)] for _ in range(h)])


def some_sprite(rng: random.Random) -> Sprite:
    kind = rng.choice(["mask", "mask", "mask", "sheet", "circle", "box", "polygon"])
    if kind == "circle":
        return Sprite.circle(rng.randint(0, 24) / 4)
    if kind == "box":
        return Sprite.box(rng.randint(1, 56) / 4, rng.randint(1, 56) / 4)
    if kind == "polygon":
        return Sprite.polygon([(rng.randint(-30, 30) / 4, rng.randint(-30, 30) / 4) for _ in range(rng.randint(3, 5))])
    if kind == "sheet":
        w, h = rng.randint(1, 9), rng.randint(1, 9)
        image = np.zeros((h, 2 * w, 4), np.uint8)
        image[..., 3] = [[rng.choice([0, 127, 128, 255]) for _ in range(2 * w)] for _ in range(h)]
        return Sprite.from_image(image, grid_wh=(w, h))
    return Sprite.from_mask(some_mask(rng), pivot_xy=rng.choice([None, (0, 0), (rng.randint(-8, 24) / 8, 1.5)]))


def some_pose(rng: random.Random, frames: int) -> dict[str, Any]:
    """Turned, scaled, flipped, most often not."""
    pose: dict[str, Any] = {"flip": rng.choice(["none", "none", "x", "y", "xy"]), "frame": rng.randrange(frames)}
    pose["angle"] = rng.choice([0, 0, 0, 90, 180, -90, 45, rng.uniform(-400, 400)])
    pose["scale"] = rng.choice([1, 1, 1, 0.5, 2, (1.5, 0.75)])
    return pose


def some_plain(rng: random.Random) -> AreaWeapon:
    common: dict[str, Any] = {"pierce": rng.random() < 0.4, "falloff": rng.choice([None, "linear", "smooth"])}
    if rng.random() < 0.3:
        common["line_of_sight"] = rng.choice(["occluders", "all"])
        common["inside"] = rng.choice(["hit", "hit", "ignore_until_exit"])

    def length(high: int) -> float:
        return rng.randint(0, 8 * high) / 8

    kinds = {
        "point": lambda: Point(**common),
        "disc": lambda: Disc(length(5), **common),
        "ring": lambda: Ring(*sorted((length(6), length(6))), **common),
        "box": lambda: Box(rng.randint(1, 12), rng.randint(1, 8), **common),
        "polygon": lambda: Polygon(*some_rings(rng), **common),
        "cone": lambda: Cone(length(9), rng.choice([0, 30, 90, 180, 250, 360]), **common),
        "beam": lambda: Beam(length(18), length(3), **common),
        "stencil": lambda: Stencil(some_mask(rng, 8), rng.choice([None, (0, 0), (3, 1.5)]), **common),
    }
    return kinds[rng.choice(list(kinds))]()


def some_rings(rng: random.Random) -> tuple[list[tuple[float, float]], list[list[tuple[float, float]]]]:
    def ring() -> list[tuple[float, float]]:
        return [(rng.randint(-24, 24) / 4, rng.randint(-24, 24) / 4) for _ in range(rng.randint(3, 5))]

    return ring(), [ring() for _ in range(rng.randint(0, 1))]


def some_weapon(rng: random.Random) -> Weapon:
    """Any weapon: plain, a spread, or a burst of one of them."""
    weapon: AreaWeapon | Spread = some_plain(rng)
    if rng.random() < 0.35:
        weapon = Spread(weapon, rng.randint(1, 5), rng.randint(0, 12) / 4)
    if rng.random() < 0.35:
        recoil = (rng.randint(-24, 24) / 8, rng.randint(-24, 24) / 8)
        return Rounds(weapon, rng.randint(1, 3), recoil, rng.choice([0, 90, 7.5, -20]))
    return weapon


BITS = (ALL, ALL, ALL, ALL, ALL, 1, 3, 3, 6, 0)
"""Filters of random shots."""


def some_place(rng: random.Random, origin_xy: Pixel) -> tuple[float, float]:
    """A position in the 24 x 18 px from an origin, or a little beside them."""
    return origin_xy[0] + rng.randint(-512, 256 * 26) / 256, origin_xy[1] + rng.randint(-512, 256 * 20) / 256


def some_volley(rng: random.Random, weapon: Weapon, places: list[tuple[float, float]], items: int) -> Placements:
    """Up to 3 shots about some places, each with its own aim, filter and number."""
    shots, aimed = [], rng.random() < 0.5
    for number in range(rng.randint(2, 3)):
        x, y = rng.choice(places)
        at = (x + rng.randint(-512, 512) / 256, y + rng.randint(-512, 512) / 256)
        shot = Shot(at, accept=rng.choice(BITS), blocked_by=rng.choice(BITS))
        shot.number = rng.choice([number, 2**40 + number])
        if rng.random() < 0.3:
            drawn = (rng.randrange(items + 1) for _ in range(rng.randint(1, 2)))
            shot.exclude = tuple(owner if owner < items else -1 for owner in drawn)
        if aimed:
            shot.aim = rng.randint(-30, 30) * 12.5
        else:
            dx, dy = rng.choice([-1, 1]) * rng.randint(1, 2000) / 256, rng.randint(-9, 9)
            shot.toward = (shot.at[0] + dx, shot.at[1] + dy)
        shots.append(shot)
    return Placements(weapon, shots, rng.choice([0, 7, 2**64 - 1]))


def some_battle(seed: int) -> Battle:
    """A small world, crowded, with few layers, categories and owners, so that ties and refusals occur."""
    rng = random.Random(seed)
    origin = rng.choice([(0, 0), (rng.randint(-99, 99), rng.randint(-99, 99))])
    sprites = [some_sprite(rng) for _ in range(4)]
    roles = ["hittable"] * 9 + ["occluder"] * 3 + ["mover", "background", "hud"]
    objects = []
    for number in range(rng.choice([0, *range(3, 15), 8, 10, 12])):
        sprite = rng.choice(sprites)
        pose = some_pose(rng, sprite.frame_count) | {"role": rng.choice(roles), "layer": rng.choice([0, 0, 1, 2, -3])}
        pose["categories"] = rng.choice([None, None, None, None, 1, 2, 3, 4, 0])
        pose["owner"] = rng.choice([None, rng.randint(0, number)])
        objects.append((sprite, some_place(rng, origin), pose))
    places = [some_place(rng, origin), *(place for _, place, _ in objects)]
    volley = some_volley(rng, some_weapon(rng), places, len(objects))
    return Battle(rng.choice([(24, 18), (24, 18), None]), origin, volley, objects)


def check_battle(seed: int) -> int:
    """Every way to fire a battle gives the oracle's rows; returns their number."""
    battle, rng = some_battle(seed), random.Random(~seed)
    scene, volley = battle.scene(), battle.volley
    truth = expected(scene, volley)
    strategies = ["direct", "built"] if battle.size_wh else ["direct"]
    for strategy, prefilter in itertools.product(strategies, ("none", "box", "auto")):
        hits = volley.fired(scene, strategy=strategy, prefilter=prefilter)
        assert told(hits) == truth, f"{seed=} {strategy} {prefilter}"
    for prefilter in rng.sample(PREFILTERS, 2):
        strategy, broadphase = rng.choice(strategies), rng.choice(("none", "grid", "quadtree", "bvh"))
        hits = volley.fired(scene, strategy=strategy, prefilter=prefilter, broadphase=broadphase)
        assert told(hits) == truth, f"{seed=} {strategy} {prefilter} {broadphase}"
    assert told(volley.fired(scene)) == truth, f"{seed=}"
    rows, verdicts = [], []
    for which in range(len(volley.shots)):
        alone = volley.alone(scene, which, strategy=rng.choice(strategies))
        rows += [(which, *row[1:]) for row in alone]
        verdicts.append(alone.verdict_counts(0))
    assert (rows, verdicts) == truth, f"{seed=} one by one"
    shift = (rng.choice([-FAR, 0, FAR]), rng.choice([-FAR, FAR]))
    far = volley.fired(battle.scene(shift), shift, strategy=rng.choice(strategies))
    assert told(far) == (moved(truth[0], shift), truth[1]), f"{seed=} shifted by {shift}"
    return len(truth[0])


def check_part(part: int) -> None:
    rows = [check_battle(SCENES_IN_PART * part + i) for i in range(SCENES_IN_PART)]
    assert sum(rows) > SCENES_IN_PART, "too little was hit to mean anything"


@pytest.mark.parametrize("part", range(PARTS))
def test_random_scenes(part: int) -> None:
    check_part(part)


@pytest.mark.long
@pytest.mark.parametrize("part", range(PARTS, PARTS + LONG_PARTS))
def test_more_random_scenes(part: int) -> None:
    check_part(part)


def test_the_random_scenes_reach_every_case() -> None:
    """What the comparison is worth: every verdict, weapon, tie and kind of filter occurs, and often."""
    verdicts: dict[str, int] = dict.fromkeys(oracle_stack.VERDICTS, 0)
    kinds: dict[str, int] = {}
    seen = dict.fromkeys(("pierced", "overlapping pellets", "no sample", "excluded", "cut by the bounds", "tie"), 0)
    for seed in range(400):
        battle = some_battle(seed)
        scene = battle.scene()
        rows, counts = expected(scene, battle.volley)
        burst, spread, plain = parts_of(battle.volley.weapon)
        for kind in (plain.kind, "spread" if spread else "", "rounds" if burst else ""):
            kinds[kind] = kinds.get(kind, 0) + 1
        for one in counts:
            verdicts = {v: n + one[v] for v, n in verdicts.items()}
        items = items_of(scene)
        hit = sum(c["hit"] for c in counts)
        pairs = itertools.combinations(items, 2)
        seen["pierced"] += sum(row[3] for row in rows) > hit
        seen["overlapping pellets"] += any(row[3] > row[4] for row in rows)
        seen["no sample"] += not sum(sum(c.values()) for c in counts)
        seen["excluded"] += any(i.owner in s.exclude for i in items for s in battle.volley.shots)
        seen["tie"] += any(a.layer == b.layer and a.occluder != b.occluder and a.pixels & b.pixels for a, b in pairs)
        if bounds := scene.bounds:
            x0, y0, x1, y1 = bounds
            inside = [{x0 <= x <= x1 and y0 <= y <= y1 for x, y in item.pixels} for item in items]
            seen["cut by the bounds"] += {True, False} in inside
    assert min(verdicts.values()) > 200, verdicts
    assert len(kinds) == 11 and min(kinds.values()) >= 15, kinds
    assert min(seen.values()) >= 5, seen


@pytest.mark.parametrize("seed", range(0, 400, 10))
def test_a_world_moved_object_by_object(seed: int) -> None:
    """Scenes without bounds, moved by `move` instead of being built elsewhere."""
    battle = some_battle(seed)
    battle.size_wh = None
    scene = battle.scene()
    rows, verdicts = expected(scene, battle.volley)
    ids = [i for i in scene.ids().tolist() if i not in scene.ids("hud")]
    places = np.array([battle.objects[i][1] for i in ids]).reshape(-1, 2)
    scene.move(ids, places + np.array([FAR, -FAR]))
    assert told(battle.volley.fired(scene, (FAR, -FAR))) == (moved(rows, (FAR, -FAR)), verdicts)
    scene.move(ids, places)
    assert told(battle.volley.fired(scene)) == (rows, verdicts)


@pytest.mark.parametrize("seed", range(0, 300, 10))
def test_the_order_of_a_batch_changes_no_shot(seed: int) -> None:
    battle = some_battle(seed)
    scene, volley = battle.scene(), battle.volley
    backward = Placements(volley.weapon, volley.shots[::-1] * 2, volley.seed)
    forward, twice = volley.fired(scene), backward.fired(scene)
    for i in range(len(backward.shots)):
        which = len(volley.shots) - 1 - i % len(volley.shots)
        assert [row[1:] for row in twice.of(i)] == [row[1:] for row in forward.of(which)]
        assert twice.verdict_counts(i) == forward.verdict_counts(which)


SEEDS = st.sampled_from([0, 1, 2**53 + 1, 2**63 - 1, 2**63, 2**64 - 2, 2**64 - 1])


@examples(20, deadline=None)
@given(st.lists(st.tuples(SEEDS, st.integers(0, 9)), min_size=1, max_size=12), st.booleans())
def test_shots_with_seeds_of_their_own_are_the_shots_fired_one_by_one(
    shots: list[tuple[int, int]], as_array: bool
) -> None:
    scene = Scene((60, 60))
    scene.add(square(9), (25, 25))
    weapon = Spread(Point(), count=5, radius=20)
    seeds, numbers = (list(column) for column in zip(*shots, strict=True))
    given_seeds = np.array(seeds, np.uint64) if as_array else seeds
    hits = fire(scene, weapon, [(30, 30)] * len(shots), seed=given_seeds, shot=numbers)
    assert hits.shots.seed.tolist() == seeds
    for i, (seed, number) in enumerate(shots):
        alone = fire(scene, weapon, (30, 30), seed=seed, shot=[number])
        assert [row[1:] for row in hits.of(i)] == [row[1:] for row in alone]
        assert hits.verdict_counts(i) == alone.verdict_counts()
        assert np.array_equal(hits.samples_at(i).xy, alone.samples_at().xy)


@pytest.mark.parametrize("falloff", [None, "linear"])
def test_seeds_stay_with_their_shots_in_the_parts_of_a_batch(
    strategy: str, falloff: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene((60, 60))
    scene.add(square(9), (25, 25))
    weapon, seeds = Spread(Disc(1, falloff=falloff), count=5, radius=20), np.arange(40, dtype=np.uint64)
    whole = fire(scene, weapon, [(30, 30)] * 40, seed=seeds, shot=3, strategy=strategy)
    assert whole and whole.fired.sum() == 1000  # verdicts are counted
    monkeypatch.setattr("hitplanes.weapons.fire.spans.CHUNK_SAMPLES", 150)
    monkeypatch.setattr("hitplanes.weapons.fire.areas.PLACEMENTS_AT_ONCE", 35)
    monkeypatch.setattr("hitplanes.weapons.fire.areas.CHUNK_PAIRS", 35)
    monkeypatch.setattr("hitplanes.weapons.fire.spans.CHUNK_PAIRS", 35)
    assert fire(scene, weapon, [(30, 30)] * 40, seed=seeds, shot=3, strategy=strategy) == whole


@pytest.mark.parametrize(
    ("seeds", "told"),
    [
        ([1, 2**64], r"seed\[1\]: expected a whole number from 0 to 18446744073709551615, got 18446744073709551616"),
        ([-1, 2**64 - 1], r"seed\[0\]: expected a whole number .*, got -1"),
        ([1.5, 2], r"seed\[0\]: expected a whole number .*, got 1.5"),
        (np.array([3, -7]), r"seed\[1\]: expected a whole number .*, got -7"),
        ([True, 2], r"seed\[0\]: expected a whole number .*, got True"),
        ([1, 2, 3], r"seed: expected one, or one for each of 2 shots, got shape \(3,\)"),
        ("12", r"seed: expected a whole number .*, got '12'"),
        (None, r"seed: expected a whole number .*, got None"),
    ],
)
def test_bad_seeds_are_named(seeds: object, told: str) -> None:
    with pytest.raises(InputError, match=told):
        fire(Scene(), Point(), [(0, 0), (1, 1)], seed=seeds)


# Small pictures: what is on the screen, front-most letter on top, and what a shot does to it


def square(width: int, height: int = 0) -> Sprite:
    """A full rectangle, held at its top left."""
    return Sprite.from_mask(np.ones((height or width, width), bool), pivot_xy=(0, 0))


def verdict(hits: Hits) -> str:
    """The one verdict of a shot of one sample."""
    (name,) = [name for name, n in hits.verdict_counts().items() if n]
    return name


@pytest.fixture(params=["direct", "built"])
def strategy(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_a_refused_teammate_over_a_wall_over_an_enemy(strategy: str) -> None:
    """OCCLUDED by the wall, whatever is accepted; HIT where nothing of its category blocks."""
    team, enemy, glass = 1, 2, 4
    scene = Scene((9, 9))
    foe = scene.add(square(3), (3, 3), layer=0, categories=enemy)
    wall = scene.add(square(3), (3, 3), layer=1, categories=glass, role="occluder")
    friend = scene.add(square(3), (3, 3), layer=2, categories=team)

    def at(accept: int, blocked_by: int = ALL, exclude: int | None = None) -> tuple[str, list[int]]:
        how: dict[str, Any] = {"accept": accept, "blocked_by": blocked_by, "exclude": exclude, "strategy": strategy}
        hits = fire(scene, Point(), (4, 4), **how)
        ready = prepare(scene, Point(), accept=accept, blocked_by=blocked_by, exclude=exclude).fire((4, 4))
        assert (verdict(ready), ready.object.tolist()) == (verdict(hits), hits.object.tolist())
        return verdict(hits), hits.object.tolist()

    assert at(ALL) == at(team, 0) == ("hit", [friend])
    assert at(enemy | glass) == at(enemy) == at(enemy, glass) == ("occluded", [])
    assert at(ALL, exclude=friend) == ("occluded", [])
    assert at(enemy, team | enemy) == at(enemy, 0) == ("hit", [foe])
    assert at(enemy, 0, exclude=foe) == ("filtered", [])
    assert at(8, 0) == ("filtered", [])
    assert at(ALL & ~team, exclude=wall) == ("hit", [foe])
    scene.set(wall, layer=-1)
    assert at(enemy) == ("hit", [foe])


def test_two_squares_and_a_row_in_front(strategy: str) -> None:
    """Two 5x5 squares that overlap in 3x3, and an occluder over one row of both.

    y = 1   A A A A A . .
    y = 2   A A A A A . .
    y = 3   A A B B B B B
    y = 4   # # # # # # #
    y = 5   A A B B B B B
    y = 6   . . B B B B B
    y = 7   . . B B B B B
    """
    scene = Scene((9, 9))
    a = scene.add(square(5), (1, 1))
    b = scene.add(square(5), (3, 3))
    scene.add(square(7, 1), (1, 4), role="occluder")
    hits = fire(scene, Box(9, 9), (4, 4), strategy=strategy)
    assert [(row.object, row.samples, row.first_xy, row.distance2) for row in hits] == [
        (b, 20, (4, 3), 1),
        (a, 14, (4, 2), 4),
    ]
    assert hits.verdict_counts() == {"empty": 40, "hit": 34, "occluded": 7, "filtered": 0, "outside": 0}
    through = fire(scene, Box(9, 9, pierce=True), (4, 4), strategy=strategy)
    assert [(row.object, row.samples, row.first_xy) for row in through] == [(b, 20, (4, 3)), (a, 20, (4, 3))]
    assert through.verdict_counts() == hits.verdict_counts()


@pytest.mark.parametrize("roles", list(itertools.permutations(["hittable", "hittable", "occluder"])))
def test_equal_layers(roles: tuple[str, ...], strategy: str) -> None:
    """Occluders before objects, whenever they were added; then the later added."""
    scene = Scene((3, 3))
    ids = [scene.add(square(1), (1, 1), role=role) for role in roles]
    assert verdict(fire(scene, Point(), (1, 1), strategy=strategy)) == "occluded"
    scene.remove(ids[roles.index("occluder")])
    later = max(i for i, role in zip(ids, roles, strict=True) if role == "hittable")
    assert fire(scene, Point(), (1, 1), strategy=strategy).object.tolist() == [later]
    scene.set(later, layer=-1)
    (other,) = {int(i) for i in scene.ids("hittable")} - {later}
    assert fire(scene, Point(), (1, 1), strategy=strategy).object.tolist() == [other]


def test_piercing_ends_at_an_occluder(strategy: str) -> None:
    """Three objects, an occluder, and one more that is not reached; rows of one pixel come front to back."""
    scene = Scene((3, 3))
    behind = scene.add(square(1), (1, 1), layer=0)
    scene.add(square(1), (1, 1), layer=1, role="occluder")
    front = [scene.add(square(1), (1, 1), layer=layer) for layer in (4, 2, 3)]
    hits = fire(scene, Point(pierce=True), (1, 1), strategy=strategy)
    assert hits.object.tolist() == [front[0], front[2], front[1]] and behind not in hits.object
    assert hits.verdict_counts()["hit"] == 1
    assert fire(scene, Point(), (1, 1), strategy=strategy).object.tolist() == [front[0]]
    rest = fire(scene, Point(pierce=True), (1, 1), exclude=front[0], strategy=strategy)
    assert rest.object.tolist() == [front[2], front[1]]


def test_nothing_and_outside(strategy: str) -> None:
    """Off the bounds is OUTSIDE, also where an object is there; the bounds' own pixels are in."""
    scene = Scene((4, 3), (10, 20))
    scene.add(square(30), (0, 10))
    for x, y in itertools.product((9, 10, 13, 14), (19, 20, 22, 23)):
        inside = 10 <= x <= 13 and 20 <= y <= 22
        assert verdict(fire(scene, Point(), (x, y), strategy=strategy)) == ("hit" if inside else "outside")
    assert verdict(fire(Scene((4, 3)), Point(), (1, 1), strategy=strategy)) == "empty"
    assert verdict(fire(Scene(), Point(), (-(10**6), 1))) == "empty"


def test_only_objects_and_occluders_decide(strategy: str) -> None:
    scene = Scene((5, 5))
    for role in ("background", "mover", "hud"):
        scene.add(square(5), (0, 0), role=role, layer=9)
    assert verdict(fire(scene, Point(), (2, 2), strategy=strategy)) == "empty"
    foe = scene.add(square(1), (2, 2))
    assert fire(scene, Disc(9), (2, 2), strategy=strategy).object.tolist() == [foe]


def test_a_position_belongs_to_its_pixel(strategy: str) -> None:
    """[x - 1/2, x + 1/2) after the one rounding to 1/256 px; for objects and shots alike."""
    scene = Scene((5, 5))
    item = scene.add(square(1), (2, 2))
    at = [(1.498, 2), (1.5 - 1 / 256, 2), (1.5 - 1 / 1024, 2), (1.5, 2), (2.498, 2), (2.5 - 1 / 1024, 2), (2.5, 2)]
    truth = [0, 0, 1, 1, 1, 0, 0]
    hits = fire(scene, Point(), at, strategy=strategy)
    assert np.diff(hits.starts).tolist() == truth
    for (x, y), there in zip(at, truth, strict=True):
        scene.move(item, (x, y))
        assert bool(fire(scene, Point(), (2, 2), strategy=strategy)) == there


def test_overlapping_pellets_count_pixels_once() -> None:
    """Five pellets of one pixel on one pixel: five samples, one pixel, five times the weight."""
    scene = Scene((5, 5))
    scene.add(square(5))
    (row,) = fire(scene, Spread(Point(), 5, 0), (2, 2))
    assert (row.samples, row.pixels, row.pellets, row.weight) == (5, 1, 5, 5 * 65535)


@pytest.mark.parametrize("falloff", ["linear", "smooth"])
def test_weights_fall_to_nothing_at_the_reach(falloff: str, strategy: str) -> None:
    """At distance 0 all, at 5 nothing (a hit all the same), at 3 two fifths of it, and smoothstep of that."""
    scene = Scene((11, 1), (-5, 0))
    for x in (0, 3, 5):
        scene.add(square(1), (x, 0))
    hits = fire(scene, Disc(5, falloff=falloff), (0, 0), strategy=strategy)
    middle = {"linear": 26214, "smooth": 26214**2 * (3 * 65535 - 2 * 26214) // 65535**2}[falloff]
    assert hits.weight.tolist() == [65535, middle, 0] and hits.samples.tolist() == [1, 1, 1]


def test_the_filters_of_a_batch_are_its_shots_own(strategy: str) -> None:
    scene = Scene((5, 5))
    a, b = (scene.add(square(5), layer=layer, categories=layer + 1) for layer in (0, 1))
    at = [(2, 2)] * 5
    hits = fire(scene, Point(), at, accept=[3, 1, 2, 3, 3], exclude=[[-1], [-1], [-1], [b], [a]], strategy=strategy)
    assert hits.object.tolist() == [b, a, b, a, b]
    assert fire(scene, Point(), at, exclude=[-1, a, b, a, b], strategy=strategy).object.tolist() == [b, b, a, b, a]
    assert not fire(scene, Point(), at, exclude=[[a, b]], strategy=strategy)
    assert not fire(scene, Point(), at[0], exclude=[a, b], strategy=strategy)


def test_an_aim_and_a_point_in_that_direction_are_one(strategy: str) -> None:
    """Also far from the origin of the world, and for every eighth of a turn."""
    for x in (0, FAR):
        scene = Scene((41, 41), (x - 20, -20))
        scene.add(square(41), (x - 20, -20))
        at = np.array([x + 0.25, 0.5])
        for number, step in enumerate([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]):
            aimed = fire(scene, Beam(15, 3), at, aim=45.0 * number, strategy=strategy)
            pointed = fire(scene, Beam(15, 3), at, toward=at + 7 * np.array(step), strategy=strategy)
            assert aimed == pointed and aimed


def test_inputs_are_left_as_they_were() -> None:
    mask, at = np.ones((3, 3), bool), np.array([[1.0, 1.0], [2.5, 0.0]])
    accept, exclude = np.array([1, 2]), np.array([[0], [-1]])
    kept = [v.copy() for v in (mask, at, accept, exclude)]
    scene = Scene((9, 9))
    scene.add(mask, (1, 1))
    fire(scene, Spread(Disc(2), 3, 1), at, accept=accept, exclude=exclude, strategy="built").shares()
    for before, after in zip(kept, (mask, at, accept, exclude), strict=True):
        np.testing.assert_array_equal(before, after)


def test_what_is_built_needs_no_bounds() -> None:
    for scene in (Scene(), Scene((70_000, 2))):
        item = scene.add(square(3), (1, 1))
        for weapon in (Point(), Disc(2), Disc(2, falloff="linear")):
            assert fire(scene, weapon, (1, 1), strategy="built").object.tolist() == [item]


@pytest.mark.parametrize(
    "one", [{}, {"aim": 30}, {"accept": 5, "seed": 2**64 - 1}, {"blocked_by": 6}, {"exclude": 3}, {"toward": (50, 9)}]
)
def test_a_column_is_what_was_given_for_all(jit: bool, one: dict[str, Any]) -> None:
    """Shots whose arguments are one for all are those that are told one by one, also some of them."""
    weapon, at = Beam(9, 2), np.arange(12.0).reshape(6, 2)
    default: dict[str, Any] = {"accept": ALL, "blocked_by": ALL, "seed": 0}
    if "toward" not in one:
        default["aim"] = 0
    each = {name: [value] * 6 for name, value in (default | one).items()} | {"shot": range(6)}
    shots = [checked(weapon, at, **how) for how in (one, each)]
    for some in ([slice(0, 6)], [slice(2, 5)], [slice(2, 5), np.array([1, 0])], [np.array([4, 1]), slice(1, 2)]):
        got, expected = (reduce(Shots.pick, some, both) for both in shots)
        assert len(got) == len(expected) and got.choosy == expected.choosy == bool(
            {"accept", "blocked_by", "exclude"} & set(one)
        )
        for name in ("at_256", "direction", "meets", "accept", "blocked_by", "exclude", "number", "seed", "row"):
            x, y = getattr(got, name), getattr(expected, name)
            assert x.dtype == y.dtype and np.array_equal(x, y), name
    assert shots[0].nbytes <= (3 if "toward" in one else 2) * at.nbytes < shots[1].nbytes


@pytest.mark.parametrize("laid", ["apart", "unaligned", "read-only", "big-endian", "float32", "list"])
def test_positions_may_lie_anyhow(jit: bool, laid: str) -> None:
    plain = np.arange(40.0).reshape(20, 2) / 8
    raw = np.zeros(plain.nbytes + 1, np.uint8)[1:]
    raw[:] = plain.view(np.uint8).reshape(-1)
    fixed = plain.copy()
    fixed.flags.writeable = False
    at = {
        "apart": np.repeat(plain, 3, axis=1)[:, ::3], "unaligned": raw.view(np.float64).reshape(20, 2),
        "read-only": fixed, "big-endian": plain.astype(">f8"), "float32": plain.astype(np.float32),
        "list": plain.tolist(),
    }[laid]  # fmt: skip
    shots = checked(Disc(2), at)
    assert np.array_equal(shots.at_256, 256 * plain) and shots.at_256.dtype == np.int64


def checked(weapon: Weapon, at: object, **how: Any) -> Shots:
    """Checked shots, as `fire` has them."""
    how = {
        "aim": None,
        "toward": None,
        "accept": ALL,
        "blocked_by": ALL,
        "exclude": None,
        "seed": 0,
        "shot": None,
    } | how
    return checked_shots(weapon, at, **how)


def test_filters_of_each_shot_may_be_lists_of_names() -> None:
    scene = Scene(categories=("a", "b"))
    for name in ("a", "b"):
        scene.add(Sprite.circle(3), (5, 5), categories=[name])
    hits = fire(scene, Disc(1), [(5, 5)] * 4, accept=[["a"], ["b"], ("a", "b"), []], blocked_by=[["a"]] * 4)
    assert list(zip(hits.shot.tolist(), hits.object.tolist(), strict=True)) == [(0, 0), (1, 1), (2, 1)]
    assert hits.shots.accept.tolist() == [2, 4, 6, 0] and hits.shots.blocked_by.tolist() == [2] * 4
