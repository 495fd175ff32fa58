"""The pre-filter: no choice of it loses a hit, and it looks at no more than it must."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_of import in_turn

from hitplanes import (
    Beam,
    Box,
    Cone,
    Disc,
    Hits,
    InputError,
    Point,
    Ring,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Stencil,
    Weapon,
    fire,
)
from hitplanes.planes.broadphase import Grid
from hitplanes.planes.broadphase.boxes import Index
from hitplanes.planes.common import costs
from hitplanes.planes.common.checks import Bools
from hitplanes.planes.common.limits import INDEX_SLACK, STRUCTURES
from hitplanes.planes.grid.spans import meets
from hitplanes.planes.scene import items
from hitplanes.weapons.fire import areas
from hitplanes.weapons.fire.plan import Stage
from hitplanes.weapons.fire.prefilter import Candidates, prefilter_of
from hitplanes.weapons.kinds.areas import AreaWeapon, pattern_of

ROOT = Path(__file__).parents[1]
VOLUMES = ("circle", "oriented box", "1 boxes", "4 boxes", "polygon", "swept")
BROADPHASES = ("none", "grid", "quadtree", "bvh")
PAIRS = [  # each with half of the others, and with all of them in the long tests
    pytest.param(prefilter, broadphase, marks=[pytest.mark.long] * ((i + j) % 2))
    for i, prefilter in enumerate(VOLUMES)
    for j, broadphase in enumerate(BROADPHASES)
]
WEAPONS: list[Weapon] = [
    Point(), Disc(1.5), Disc(9, pierce=True), Ring(6, 7), Box(5, 2), Cone(reach=20, angle=25), Beam(length=40, width=1),
    Beam(length=70, width=6, pierce=True), Spread(Disc(1), count=5, radius=9), Stencil(["##...", "..###"]),
    Rounds(Beam(length=30, width=2), count=3, recoil_xy=(1, -2), recoil_deg=11),
]  # fmt: skip


def blob(rng: np.random.Generator, side: int) -> Bools:
    mask = rng.random(rng.integers(1, side + 1, 2)) < rng.choice([0.1, 0.5, 0.9])
    mask[tuple(rng.integers(0, mask.shape))] = True
    return np.asarray(mask)


def crowd(seed: int, count: int = 40, side: int = 120, world: bool = True) -> Scene:
    """Sprites and shapes, turned, scaled and flipped."""
    rng = np.random.default_rng(seed)
    scene = Scene((side, side)) if world else Scene()
    sprites: list[Any] = [Sprite.from_mask(blob(rng, 14), pivot_xy=rng.normal(4, 5, 2).tolist()) for _ in range(6)]
    sprites += [Sprite.circle(4.4), Sprite.polygon([(0, 0), (9, 2), (1, 7)]), Sprite.box(12, 1)]
    for i in range(count):
        scene.add(
            sprites[rng.integers(len(sprites))],
            rng.uniform(0, side, 2),
            angle=float(rng.choice([0, 90, 270, rng.uniform(0, 360)])),
            scale=rng.choice([1, 1, 0.5, 2.3, 0.07], 2).tolist(),
            flip=str(rng.choice(["none", "x", "y", "xy"])),
            layer=int(rng.integers(3)),
            role="occluder" if i % 5 == 4 else "hittable",
        )
    return scene


def pairs_tested(scene: Scene, weapon: Weapon, at: Any, **how: Any) -> tuple[int, int]:
    ran = fire(scene, weapon, at, strategy="direct", **how).plan.ran
    (stage,) = (stage for stage in ran if stage.name == "pre-filter")
    assert stage.pairs
    return stage.pairs


def three_crowds() -> list[Scene]:
    return [crowd(seed, world=seed != 1) for seed in range(3)]


@cache
def trials() -> list[tuple[int, Weapon, Any, Any, Hits]]:
    """Which crowd, a weapon, places, directions, and what is hit without a pre-filter."""
    rng, scenes = np.random.default_rng(1), three_crowds()
    out = []
    for which, weapon in itertools.product(range(3), WEAPONS):
        at, aim = rng.uniform(-5, 125, (60, 2)), rng.uniform(-180, 180, 60)
        truth = fire(scenes[which], weapon, at, aim=aim, prefilter="none", strategy="direct")
        out.append((which, weapon, at, aim, truth))
    return out


@pytest.mark.parametrize(("prefilter", "broadphase"), PAIRS)
def test_no_hit_is_lost(prefilter: str, broadphase: str) -> None:
    found, scenes = 0, three_crowds()
    for which, weapon, at, aim, truth in trials():
        hits = fire(scenes[which], weapon, at, aim=aim, prefilter=prefilter, broadphase=broadphase, strategy="direct")
        assert hits == truth
        found += len(hits)
    assert found > 700


@pytest.mark.long
@pytest.mark.parametrize("prefilter", ["box", *VOLUMES])
def test_no_hit_of_a_million_is_lost(prefilter: str) -> None:
    """10^6 random shots for each pre-filter: half of them at the gaps that a volume would close, with thin weapons."""
    per_scene, found = 10_000, 0
    for seed in range(100):
        rng = np.random.default_rng(1000 + seed)
        scene = crowd(seed, 25, 90, world=seed % 2 == 0)
        weapon = WEAPONS[seed % len(WEAPONS)]
        at, aim = rng.uniform(0, 90, (per_scene, 2)), rng.choice(np.arange(48) * 7.5, per_scene)
        broadphase = BROADPHASES[seed % 4]
        truth = fire(scene, weapon, at, aim=aim, prefilter="none", strategy="direct")
        hits = fire(scene, weapon, at, aim=aim, prefilter=prefilter, broadphase=broadphase, strategy="direct")
        assert hits == truth, seed
        found += len(hits)
    assert found > 300_000


@pytest.mark.parametrize("prefilter", VOLUMES)
def test_volumes_drop_what_boxes_keep(prefilter: str) -> None:
    """Shots in the corner of a disc's box, and beside a diagonal line: boxes share pixels, volumes do not touch."""
    disc, line = Sprite.circle(30), Sprite.from_mask(np.eye(60, dtype=np.bool_))
    sprite, beside = (disc, (128, 128)) if prefilter in ("circle", "swept") else (line, (108, 92))
    scene = Scene()
    scene.add(sprite, (100, 100))
    assert pairs_tested(scene, Disc(2), beside, prefilter="box") == (1, 1)
    kept = 1 if prefilter == "1 boxes" else 0
    assert pairs_tested(scene, Disc(2), beside, prefilter=prefilter) == (kept, 1)
    assert pairs_tested(scene, Disc(2), (100, 100), prefilter=prefilter) == (1, 1)


def test_a_beam_beside_a_disc() -> None:
    scene = Scene()
    scene.add(Sprite.circle(10), (60, 20))
    for prefilter, kept in (("box", 1), ("circle", 1), ("swept", 0), ("oriented box", 0), ("polygon", 0)):
        tested = pairs_tested(scene, Beam(length=100, width=2), (0, 0), aim=45, prefilter=prefilter)
        assert tested == (kept, 1), prefilter


def test_candidates_are_fewer_with_tighter_volumes() -> None:
    scene = crowd(5, 60)
    at = np.random.default_rng(2).uniform(0, 120, (300, 2))
    tested = {p: pairs_tested(scene, Disc(3), at, prefilter=p)[0] for p in ("none", "box", *VOLUMES)}
    assert tested["none"] == 300 * len(scene.items.stack())
    assert all(tested[p] < tested["box"] < 300 * 10 for p in VOLUMES)
    assert tested["4 boxes"] < tested["1 boxes"]
    assert tested["polygon"] < tested["circle"]
    hits = fire(scene, Disc(3), at, accept=["default"], strategy="direct")
    assert len(hits) < tested["polygon"]


@pytest.mark.parametrize(("weapon", "name"), in_turn([w for w in WEAPONS if isinstance(w, AreaWeapon)], VOLUMES))
def test_a_pattern_lies_in_its_volume(weapon: AreaWeapon, name: str) -> None:
    """A one-pixel object at each pixel of the pattern is a candidate, wherever in the world."""
    for angle in (0, 30, 45, 131):
        c, s = (round(f(math.radians(angle)) * 2**30) for f in (math.cos, math.sin))
        if not weapon.directed:
            c, s = 2**30, 0
        pixels = pattern_of(weapon, c, s).spans.pixels()
        scene = Scene()
        pixel = Sprite.from_mask([[True]])
        for xy in pixels.tolist():
            scene.add(pixel, (xy[0] + 10**6, xy[1] - 10**9))
        tested, of = (
            pairs_tested(
                scene, weapon, (10**6, -(10**9)), prefilter=name, toward=(10**6 + c / 2**10, -(10**9) + s / 2**10)
            )
            if weapon.directed
            else pairs_tested(scene, weapon, (10**6, -(10**9)), prefilter=name)
        )
        assert tested == of == len(pixels)


def test_names_of_prefilters() -> None:
    assert prefilter_of("4 boxes").name == "4 boxes"
    assert prefilter_of("1 box") == prefilter_of("1 boxes")
    assert prefilter_of("12 boxes").name == "12 boxes"
    assert prefilter_of("oriented box").name == "oriented box"
    assert not prefilter_of("box").volume
    with pytest.raises(InputError, match="prefilter: expected 1 to 64 boxes, got 99"):
        prefilter_of("99 boxes")


def why(stages: list[Stage], name: str) -> str:
    return next((stage.why for stage in stages if stage.name == name), "")


def test_the_plan_tells_what_was_tested() -> None:
    scene = crowd(3, 30)
    told = fire(scene, Disc(3), (60, 60), prefilter="circle", broadphase="grid", strategy="direct").plan
    assert why(told.ran, "pre-filter") == "box, then circle, by grid"
    count = len(scene.items.stack())
    assert why(told.ran, "broad phase") == f"grid: {count} boxes placed anew"
    assert not why(told.left_out, "broad phase")
    assert not why(told.left_out, "volumes")
    told = fire(scene, Disc(3), (60, 60), broadphase="grid", strategy="direct").plan
    assert why(told.ran, "broad phase") == "grid: 0 boxes placed anew"
    assert why(told.left_out, "volumes") == "boxes are the pre-filter"
    told = fire(scene, Disc(3), (60, 60), prefilter="none", strategy="direct").plan
    assert why(told.left_out, "volumes") == "no pre-filter"
    assert why(told.left_out, "broad phase") == "no box is compared"
    auto, asked = (fire(scene, Disc(3), (60, 60), broadphase=b, strategy="direct").plan for b in ("auto", "none"))
    assert why(auto.left_out, "broad phase") == "boxes are compared as samples are counted"
    spans = fire(scene, Disc(3), (60, 60), strategy="spans").plan
    assert why(spans.left_out, "broad phase") == "few pairs: every box is compared"
    assert why(asked.left_out, "broad phase") == "as asked for"
    (row,) = (stage for stage in told.to_dict()["ran"] if stage["stage"] == "pre-filter")
    assert row["pairs"] == [count, count]


def test_a_broad_phase_that_no_sample_needed_is_left_out() -> None:
    scene = crowd(3, 30)
    told = fire(scene, Disc(3), (60, 60), strategy="visible").plan
    assert why(told.left_out, "broad phase") == "the pre-filter lists tiles by cells" and told.has_left_out("volumes")
    told = fire(Scene(), Disc(3), (60, 60), prefilter="circle", strategy="spans").plan
    for stage in ("volumes", "pre-filter"):
        assert why(told.left_out, stage) == "no sample needed the stack"


def test_a_small_scene_gets_no_broad_phase_and_a_large_batch_does() -> None:
    scene = crowd(3, 20)
    for shots in (1, 1000):
        fire(scene, Disc(1), np.full((shots, 2), 50.0), strategy="direct")
    assert scene.derived.index("bvh").boxes is None
    many = crowd(4, 3000, 2000)
    at = np.random.default_rng(1).uniform(0, 2000, (3000, 2))
    hits = fire(many, Disc(1), at, strategy="spans")
    assert why(hits.plan.ran, "broad phase").startswith(f"bvh: {len(many.items.stack())} boxes")
    assert hits == fire(many, Disc(1), at, strategy="spans", broadphase="none")


def test_single_shots_make_a_broad_phase_when_it_would_have_paid(monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as no shot alone pays for it none is made; then what was lost adds up."""
    now = costs.NUMPY._replace(box_pair=300.0, bvh_call=6e4, bvh_placement=500.0, bvh_item=700.0, bvh_moved=1500.0)
    monkeypatch.setattr(costs, "NUMPY", now)
    scene = crowd(7, 600, 900)
    lost = 300.0 * len(scene.items.stack()) - now.bvh_placement - now.bvh_call
    due = math.floor(len(scene.items.stack()) * now.bvh_item / lost) + 1
    assert due > 2
    made = []
    for _ in range(due + 2):
        fire(scene, Point(), (3, 3), strategy="spans")
        made.append(scene.derived.index("bvh").boxes is not None)
    assert made.index(True) == due - 1
    scene.move(scene.ids(), (5, 5))  # to follow all would cost more than the shot saves
    assert not why(fire(scene, Point(), (3, 3), strategy="spans").plan.ran, "broad phase")


UNUSED = (
    "hitplanes.planes.volumes.fit",
    "hitplanes.planes.volumes.volumes",
    "hitplanes.planes.volumes.overlap",
    "hitplanes.planes.broadphase.grids",
)
LOADED = f"""
import sys
from hitplanes import Beam, Disc, Scene, fire
from hitplanes.weapons.fire import strategy as costs
scene = Scene((99, 99))
ids = [scene.add([[True]], (i, i)) for i in range(40)]
fire(scene, Disc(3), [(9, 9)] * 20, strategy="direct")
fire(scene, Beam(9, 1), (9, 9)).why_not()
import hitplanes.weapons.cli.command
from hitplanes import picture_of_report, report_of
picture_of_report(report_of(scene, [fire(scene, Disc(3), (9, 9))]), scene)
print([name for name in {UNUSED} if name in sys.modules])
fire(scene, Disc(3), (9, 9), prefilter="box", broadphase="bvh", strategy="direct")
fire(scene, Disc(3), (9, 9), prefilter="circle", strategy="direct")
print([name for name in {UNUSED} if name not in sys.modules])
"""


def test_volumes_and_broad_phases_are_loaded_when_they_are_asked_for() -> None:
    run = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout == "[]\n[]\n"


def test_threads_may_fire_at_a_scene_that_none_of_them_changes() -> None:
    rng = np.random.default_rng(9)
    at = rng.uniform(0, 300, (200, 2))
    for broadphase in BROADPHASES:
        scene = crowd(11, 300, 300)
        truth = fire(scene, Disc(4), at, prefilter="none", strategy="direct")
        large = scene.add(np.ones((1500, 1500), np.bool_), (-9999, 0), scale=2)
        scene.items.stack()
        scene.set(large, scale=1 / 64)
        assert scene.items.atlas.wasteful  # the first who fires lays the masks out anew
        with ThreadPoolExecutor(8) as pool:
            futures = [
                pool.submit(fire, scene, Disc(4), at, prefilter=prefilter, broadphase=broadphase, strategy="direct")
                for prefilter in VOLUMES * 4
            ]
            assert all(future.result() == truth for future in futures)


# The index


def expected(scene: Scene, boxes: np.ndarray) -> list[tuple[int, int]]:
    stack = scene.items.stack()
    row, rank = np.nonzero(meets(boxes[:, None], stack.box_xyxy[None]))
    return sorted(zip(row.tolist(), stack.rows[rank].tolist(), strict=True))


def change(scene: Scene, rng: np.random.Generator) -> None:
    ids = scene.ids()
    some = rng.choice(ids, min(len(ids), int(rng.integers(1, 4))), replace=False) if len(ids) else []
    kind = rng.integers(6)
    if kind == 0 or not len(ids):
        scene.add(blob(rng, 6), rng.uniform(0, 60, 2), role=str(rng.choice(["hittable", "occluder", "mover"])))
    elif kind == 1:
        scene.remove(some)
    elif kind == 2:
        scene.set(some, role=str(rng.choice(["hittable", "mover", "background"])))
    elif kind == 3:
        scene.set(some, angle=float(rng.uniform(0, 360)))
    else:
        scene.move(some, rng.uniform(0, 60, (len(some), 2)))


@pytest.mark.parametrize(("structure", "remembered"), in_turn(STRUCTURES, [0, 5, 10**6]))
def test_an_index_follows_its_scene(structure: str, remembered: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(items, "JOURNAL_ROWS", remembered)
    rng = np.random.default_rng(8)
    scene = Scene()
    index = scene.derived.index(structure)
    assert scene.derived.index(structure) is index
    followed = 0
    for _ in range(120):
        for _ in range(int(rng.integers(0, 5))):
            change(scene, rng)
        owed = index.build_cost(scene.items)
        corner = rng.integers(-5, 60, (4, 2))
        boxes = np.concatenate([corner, corner + rng.integers(0, 20, (4, 2))], axis=1)
        row, item = index.query(scene.items, boxes)
        assert sorted(zip(row.tolist(), item.tolist(), strict=True)) == expected(scene, boxes)
        assert index.followed == owed
        assert index.build_cost(scene.items) == 0
        index.read(scene.items).check()
        followed += owed
    assert followed > 100


def test_a_change_owes_what_it_changes() -> None:
    scene = crowd(2, 200)
    index = scene.derived.index("grid")
    assert index.build_cost(scene.items) == len(scene.items.stack())
    index.read(scene.items)
    scene.move([3, 7], (5, 5))
    scene.move([3], (6, 5))
    assert index.build_cost(scene.items) == index.build_cost(scene.items) == 2
    index.read(scene.items)
    assert index.build_cost(scene.items) == 0


def test_changes_that_no_answer_follows_do_not_pile_up() -> None:
    scene = crowd(2, 30)
    index, fresh = scene.derived.index("bvh"), Index("none")
    index.read(scene.items)
    for i in range(500):
        scene.move(scene.ids()[i % 7 :], (i % 60, i % 50))
        assert index.build_cost(scene.items) <= 33 * 30
    boxes = np.array([[0, 0, 60, 60], [20, 20, 25, 25]])
    assert [v.tolist() for v in index.query(scene.items, boxes)] == [
        v.tolist() for v in fresh.query(scene.items, boxes)
    ]


def test_an_index_that_has_grown_is_made_anew() -> None:
    """A grid chosen for one pixel is no grid for what came later."""
    scene = Scene()
    scene.add([[True]], (0, 0))
    index = scene.derived.index("grid")
    first = index.read(scene.items)
    for i in range(200):
        scene.add(np.ones((20, 20), np.bool_), (30 * (i % 20), 30 * (i // 20)))
    second = index.read(scene.items)
    assert second is not first
    assert isinstance(second, Grid)
    assert second.cell > 10


def test_parts_of_a_pile_stay_within_their_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every placement meets every item: a broad phase helps nothing, and must not take more memory either."""
    scene = Scene()
    for i in range(100):
        scene.add(np.ones((9, 9), np.bool_), (i % 3, i // 3 % 3))
    monkeypatch.setattr(areas, "CHUNK_PAIRS", 2000)
    most = []
    monkeypatch.setattr(
        Candidates, "meeting", lambda self, *a, meeting=Candidates.meeting: most.append(p := meeting(self, *a)) or p
    )
    at = np.zeros((170, 2))
    for weapon, times in ((Disc(1, falloff="linear"), 2), (Point(), 1)):
        most.clear()
        hits = fire(scene, weapon, at, strategy="direct", broadphase="bvh")
        assert 2000 / 2 < max(len(rank) for _, rank in most) <= times * 2000
        assert hits == fire(scene, weapon, at, strategy="direct", broadphase="none")
    spread = Scene()
    for i in range(100):
        spread.add([[True]], (9 * i, 0))
    most.clear()
    fire(spread, Disc(1, falloff="linear"), at, strategy="direct", broadphase="bvh")
    assert len(most) < 10  # few are met: parts grow


def test_what_was_missed_is_forgotten_when_an_index_is_made() -> None:
    scene = crowd(2, 10)
    index = scene.derived.index("grid")
    index.regret = 5.0
    index.read(scene.items)
    assert index.regret == 0


def test_an_index_forgets_boxes_that_came_and_went() -> None:
    scene = crowd(2, 300)
    index = scene.derived.index("bvh")
    first = index.read(scene.items)
    rounds = 0
    while index.read(scene.items) is first:
        ids = [scene.add([[True]], (i, i)) for i in range(500)]
        index.read(scene.items)
        scene.remove(ids)
        rounds += 1
        assert rounds < 20
    assert rounds > INDEX_SLACK // 1000
    boxes = np.array([[0, 0, 200, 200]])
    assert [pair[1] for pair in expected(scene, boxes)] == sorted(index.query(scene.items, boxes)[1].tolist())


def test_unknown_structures_are_refused() -> None:
    with pytest.raises(InputError, match=r"structure: expected one of .*got 'octree'"):
        Index("octree")
