"""Rays, fast movers and spread: the truth against a slower one, and the methods against the truth."""

import ast
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from oracle_projectile import Thing
from oracle_projectile import flight as oracle_flight
from oracle_projectile import impacts as oracle_impacts
from oracle_rays import thin_cells
from some_of import some_of

from hitplanes import InputError, Pistol, Projectile, Scene, Sprite, fire, load_scene
from hitplanes.weapons.lab.peers import Segments, ray_curves
from hitplanes.weapons.lab.study.methods import (
    Curve,
    Decisions,
    Errors,
    Method,
    Question,
    ahead,
    copied,
    drawn_places,
    errors_of,
    size_of,
    targets_of,
    velocities_of,
)
from hitplanes.weapons.lab.study.questions import movers_question, rays_question, spread_question
from hitplanes.weapons.lab.study.truth import Flights, flown, impacts, parts_of_discs, touching

ROOT = Path(__file__).parent.parent
PEERS = ("pymunk", "shapely", "pygame")
SUB = 256


def scene_of(seed: int, objects: int = 6, moving: bool = False, spread: int = 9) -> Scene:
    """Small random masks that overlap, on two layers; some of the movers go the same way."""
    rng = np.random.default_rng(seed)
    velocities = np.array([(0, 0), (-7, 3), (2.25, 30), *rng.integers(-99, 99, (2, 2)) / 7])
    scene = Scene()
    for _ in range(objects):
        scene.add(
            rng.random(rng.integers(1, 7, 2)) < 0.6,
            rng.integers(-2 * spread, 2 * spread, 2) / 2,
            layer=int(rng.integers(2)),
            velocity_xy=velocities[rng.integers(len(velocities))] if moving else (0, 0),
        )
    return scene


def segments_of(seed: int, count: int, spread: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Starts and steps: every other on half pixels and along whole or half ones, where ties are, some of length 0."""
    rng = np.random.default_rng(seed)
    start, step = rng.integers(-SUB * spread, SUB * spread, (2, count, 2))
    start[::2], step[::2] = start[::2] // 128 * 128, step[::2] // 128 * 128
    step[::8, 0], step[1::8] = 0, 0
    step[2::8] = np.abs(step[2::8, :1]) * (-1, 1)
    return start, step


def slow_first(a: np.ndarray, step: np.ndarray, scene: Scene) -> tuple[int, tuple[int, int]] | None:
    """First object and pixel of one ray, with fractions, one cell after another."""
    cells = thin_cells(a.tolist(), (a + step).tolist())
    best = None
    for item in scene.ids("hittable").tolist():
        mask, (x0, y0) = scene.mask(item)
        for y, x in np.argwhere(mask).tolist():
            cell = (x + x0, y + y0)
            if cell in cells:
                key = (cells[cell][0], cell[1], cell[0], -int(scene.items.layer[item]), -item)
                best = key if best is None else min(best, key)
    return None if best is None else (-best[4], (best[2], best[1]))


@pytest.mark.parametrize("seed", range(3))
def test_truth_of_rays_is_that_of_fractions_and_of_fire(seed: int) -> None:
    scene, (start, step) = scene_of(seed), segments_of(seed, 60)
    shot, item, _, pixel_xy = impacts(Flights(start, step, 0), targets_of(scene))
    found = {k: (i, tuple(p)) for k, i, p in zip(shot.tolist(), item.tolist(), pixel_xy.tolist(), strict=True)}
    assert found == {
        k: slow for k, (a, d) in enumerate(zip(start, step, strict=True)) if (slow := slow_first(a, d, scene))
    }
    assert 10 < len(found) < 60
    some = np.flatnonzero(step.any(axis=1))
    passes = fire(scene, Pistol(None), start[some] / SUB, toward=(start + step)[some] / SUB).passes
    told = zip(some[passes.shot].tolist(), passes.object.tolist(), passes.entry_xy.tolist(), strict=True)
    assert {k: (i, tuple(p)) for k, i, p in told} == {k: v for k, v in found.items() if k in some}


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("radius", [0, 100, 181, 182, 256, 700])
def test_truth_of_movers_is_that_of_fractions(radius: int, moving: bool) -> None:
    scene, (start, step) = scene_of(radius, moving=moving), segments_of(radius, 40)
    targets = targets_of(scene)
    found = impacts(Flights(start, step, radius), targets, velocities_of(scene, targets))
    rows = dict(zip(found.flight.tolist(), range(len(found.flight)), strict=True))
    things = things_of(scene)
    for k, (a, v) in enumerate(zip(start.tolist(), step.tolist(), strict=True)):
        slow = oracle_impacts(tuple(a), tuple(v), radius, things)
        assert (k in rows) == bool(slow)
        if slow:
            row, (time, thing, pixel) = rows[k], slow[0]
            assert (int(found.object[row]), tuple(found.pixel_xy[row].tolist())) == (thing.id, pixel)
            assert abs(Fraction(float(found.time[row])) - time) < Fraction(1, 2**50)
    assert 5 < len(rows) < 40


@pytest.mark.parametrize("radius", some_of([0, 128, 181, 182, 256, 700], 2))
def test_truth_of_movers_about_large_objects_is_that_of_fractions(radius: int) -> None:
    rng, scene = np.random.default_rng(radius), Scene()
    for k in range(3):
        mask = np.ones((9, 11), np.bool_)
        mask[tuple(rng.integers(1, 8, (2, 4)))] = False
        scene.add(mask, (9 * k - 9, 4 * k - 4), layer=k % 2, velocity_xy=[(0, 0), (4, -3), (0, 0)][k])
    targets, (start, step) = targets_of(scene), segments_of(radius, 40, spread=14)
    found = impacts(Flights(start, step, radius), targets, velocities_of(scene, targets))
    slow = [
        oracle_impacts(tuple(a), tuple(v), radius, things_of(scene))
        for a, v in zip(start.tolist(), step.tolist(), strict=True)
    ]
    told = [(k, one[0][1].id, one[0][2]) for k, one in enumerate(slow) if one]
    pixels = map(tuple, found.pixel_xy.tolist())
    assert list(zip(found.flight.tolist(), found.object.tolist(), pixels, strict=True)) == told
    at_rest = [bool(oracle_impacts(tuple(a), (0, 0), radius, _still(scene))) for a in start.tolist()]
    assert touching(start, radius, targets).tolist() == at_rest and 5 < sum(at_rest) < 35


def _still(scene: Scene) -> list[Thing]:
    return [Thing(thing.id, thing.pixels, layer=thing.layer) for thing in things_of(scene)]


def things_of(scene: Scene) -> list[Thing]:
    """Objects of a scene as the slow reference takes them."""
    things = []
    for item in scene.ids("hittable").tolist():
        mask, (x0, y0) = scene.mask(item)
        pixels = frozenset((x + x0, y + y0) for y, x in np.argwhere(mask).tolist())
        velocity = tuple(scene.items.velocity_256[item].tolist())
        things.append(Thing(item, pixels, layer=int(scene.items.layer[item]), velocity=velocity))
    return things


@pytest.mark.parametrize("speed", [300, 2**20])
def test_flights_end_where_those_of_projectiles_do(speed: int) -> None:
    toward = np.array([(1, 0), (0, -3), (-7, 7), (-3, -4), *np.random.default_rng(1).integers(-999, 999, (40, 2))])
    ends = flown(SUB * speed, toward)
    assert ends.tolist() == [list(oracle_flight(SUB * speed, tuple(t))) for t in toward.tolist()]
    stop = fire(Scene(), Projectile(speed, 1), np.zeros((len(toward), 2)), toward=toward / SUB).stop
    assert np.array_equal(stop.point_xy, ends / SUB)


def test_truth_of_spread_is_that_of_one_pixel_after_another() -> None:
    scene, radius = scene_of(5), 4
    targets = targets_of(scene)
    centers = np.random.default_rng(1).integers(-14, 14, (30, 2))
    parts = parts_of_discs(centers, radius, targets)
    disc = [(x, y) for y in range(-4, 5) for x in range(-4, 5) if x * x + y * y <= 16]
    expected = {}
    for number, (cx, cy) in enumerate(centers.tolist()):
        for thing in things_of(scene):
            on = [(x * x + y * y, cy + y, cx + x) for x, y in disc if (cx + x, cy + y) in thing.pixels]
            if on:
                expected[number, thing.id] = len(on) / len(disc), min(on)[2], min(on)[1]
    got = zip(*(column.tolist() for column in parts), strict=True)
    assert {(d, i): (share, *xy) for d, i, xy, share in got} == expected
    assert len(expected) > 15


def test_truth_tells_who_starts_inside() -> None:
    target = [(3, np.ones((1, 1), np.bool_), (5, 7))]
    points = np.array([(5 * SUB + x, 7 * SUB + y) for x in (-129, -128, 0, 128, 129) for y in (0, 128, 129)])
    inside = (np.abs(points - (5 * SUB, 7 * SUB)) <= 128).all(axis=1)
    assert np.array_equal(impacts(Flights(points, np.zeros_like(points), 0), target).flight, np.flatnonzero(inside))
    assert np.array_equal(touching(points, 0, target), inside)
    assert touching(points, 400, target).all() and not touching(points + 600, 400, target).any()


@pytest.mark.parametrize("name", ["truth"])
def test_truth_shares_nothing_with_what_it_judges(name: str) -> None:
    tree = ast.parse((ROOT / "weapons/lab/study" / f"{name}.py").read_text())
    modules = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    modules |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    standard = {module for module in modules if module.split(".")[0] in sys.stdlib_module_names}
    assert modules - standard == {"numpy", "numpy.typing"}


def curve_of(question: Question, name: str) -> Curve:
    return next(curve for curve in question.curves if curve.name == name)


def decided(method: Method) -> Decisions:
    return method.read(method.prepare()())


def errors_in(question: Question, name: str) -> list[Errors]:
    return [errors_of(decided(method), question.truth) for method in curve_of(question, name).methods]


SCENES = {
    "gallery": lambda: load_scene(ROOT / "fixtures" / "gallery"),
    "crowd": lambda: load_scene(ROOT / "fixtures" / "crowd"),
    "corridor": lambda: load_scene(ROOT / "fixtures" / "corridor"),
    "targets": lambda: load_scene(ROOT / "fixtures" / "targets"),
    "far": lambda: load_scene(ROOT / "fixtures" / "far"),
    **{f"random {seed}": lambda seed=seed: scene_of(seed, 9, moving=True) for seed in range(3)},
}


@pytest.mark.parametrize("name", SCENES)
def test_exact_methods_are_never_wrong(name: str) -> None:
    scene, shots = SCENES[name](), 20 if name == "crowd" else 60
    rays, movers, spread = (q(scene, shots, 7) for q in (rays_question, movers_question, spread_question))
    names = [curve.name for curve in rays.curves if curve.name.startswith("supercover")]
    for curve in names[: 1 if name == "crowd" else 3]:
        assert [(e.wrong, e.position) for e in errors_in(rays, curve)] == [(0, 0)] * len(curve_of(rays, curve).methods)
    (swept,) = errors_in(movers, "swept")
    assert swept.wrong == 0 and swept.position is not None and swept.position < 1e-5
    assert [one[:4] for one in errors_in(spread, "every pixel")] == [(0, 0, 0, 0)]
    assert all(len(question.truth) >= shots // 5 for question in (rays, movers, spread))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", SCENES)
def test_exact_methods_are_never_wrong_on_many_shots(name: str, seed: int) -> None:
    scene = SCENES[name]()
    for question, curve in (
        (rays_question, "supercover"),
        (movers_question, "swept"),
        (spread_question, "every pixel"),
    ):
        (errors,) = errors_in(question(scene, 200, seed), curve)
        assert errors.wrong == 0


def test_a_finer_step_misses_less_and_all_it_misses_is_crossed() -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    missed = np.zeros(9, np.int64)
    for seed in range(3):
        question = rays_question(scene, 100, seed)
        missed += [errors.missed for errors in errors_in(question, "fixed step")]
        coarse = decided(curve_of(question, "fixed step").methods[0])
        some = ~np.isin(question.truth.shot, coarse.shot)
        assert some.any() and set(coarse.shot.tolist()) <= set(question.truth.shot.tolist())
    assert (np.diff(missed) <= 0).all() and missed[0] >= 10 > missed[-1]


def test_fixed_steps_are_the_pixels_of_points_along_the_ray() -> None:
    scene = scene_of(3, 12)
    question = rays_question(scene, 40, 1)
    targets = targets_of(scene)
    length = round(4 * size_of(targets))
    start, angle, _ = drawn_places(targets, 40, 1, SUB * length // 2, lambda xy: touching(xy, 0, targets))
    step = ahead(length, angle)
    for method in curve_of(question, "fixed step").methods[::3]:
        expected = {}
        for shot, (a, d) in enumerate(zip(start.tolist(), step.tolist(), strict=True)):
            for k in range(int(length / method.setting) + 1):
                part = Fraction(method.setting) * k / length
                x, y = ((a[i] + part * d[i] + 128) // SUB for i in (0, 1))
                here = [t[0] for t in things_at(targets, x, y)]
                if here:
                    expected[shot] = (here[0], x, y)
                    break
        found = decided(method)
        got = zip(found.shot.tolist(), found.object.tolist(), found.xy.tolist(), strict=True)
        assert {shot: (item, *xy) for shot, item, xy in got} == expected
        assert expected


def things_at(targets: list, x: int, y: int) -> list:
    """Targets that have a pixel there, front to back."""
    return [
        t
        for t in targets
        if 0 <= x - t[2][0] < t[1].shape[1] and 0 <= y - t[2][1] < t[1].shape[0] and t[1][y - t[2][1], x - t[2][0]]
    ]


def test_more_substeps_miss_less() -> None:
    scene = load_scene(ROOT / "fixtures" / "corridor")
    question = movers_question(scene, 150, 2)
    (once,), steps = errors_in(question, "one test a frame"), errors_in(question, "substeps")
    missed = [once.missed, *(errors.missed for errors in steps)]
    assert missed[0] > len(question.truth) // 2 and missed[0] > missed[2] > missed[4] >= missed[6]
    places = [errors.position for errors in steps]
    assert places[0] > places[3] > places[5] > 0.1


def test_overlap_each_step_is_that_of_a_disc_where_it_is_then() -> None:
    question = movers_question(load_scene(ROOT / "fixtures" / "targets"), 60, 2)
    (once,) = curve_of(question, "one test a frame").methods
    _, fourth, *_, last = curve_of(question, "substeps").methods
    assert (once.setting, fourth.setting, last.setting) == (None, 4, 64)
    hits = curve_of(question, "swept").methods[0].prepare()()
    start, step = hits.shots.at_256, flown(round(SUB * hits.weapon.speed), hits.shots.toward_256)
    targets = targets_of(hits.scene)
    for method, steps in ((once, 1), (fourth, 4)):
        expected = {}
        for k in range(steps, 0, -1):
            at = start / SUB + k / steps * (step / SUB)
            parts = parts_of_discs(np.floor(at + 0.5).astype(int), round(hits.weapon.radius), targets)
            pixel_xy = np.floor(at + 0.5)[parts.shot]
            away = ((parts.xy - pixel_xy) ** 2).sum(axis=1)
            for row in np.lexsort((away, parts.shot))[::-1].tolist():
                expected[int(parts.shot[row])] = int(parts.object[row]), at[parts.shot[row]].tolist()
        found = decided(method)
        told = zip(found.shot.tolist(), found.object.tolist(), found.xy.tolist(), strict=True)
        assert {shot: (item, xy) for shot, item, xy in told} == expected and expected
    assert errors_of(decided(last), question.truth).wrong <= 5


def test_overlap_each_step_moves_what_moves() -> None:
    scene = load_scene(ROOT / "fixtures" / "corridor")
    scene.set(scene.ids("hittable"), velocity_xy=(40, -25))
    question = movers_question(scene, 150, 2)
    method = curve_of(question, "substeps").methods[-1]
    run = method.prepare()
    one, again = (errors_of(method.read(run()), question.truth) for _ in range(2))
    assert one[:4] == again[:4] and one.wrong <= 6 and one.position < 3


def test_movers_move() -> None:
    scene = Scene()
    item = scene.add(np.ones((5, 5), np.bool_), (0, 0))
    still = movers_question(scene, 50, 1).truth
    scene.set(item, velocity_xy=(30, -20))
    moved = movers_question(scene, 50, 1).truth
    assert still.shot.tolist() != moved.shot.tolist()
    assert errors_in(movers_question(scene, 50, 1), "swept")[0].wrong == 0


def test_share_by_pellets_is_off_by_one_over_their_root() -> None:
    question = spread_question(load_scene(ROOT / "fixtures" / "targets"), 40, 3)
    methods = curve_of(question, "pellets").methods
    assert [method.setting for method in methods] == [2**k for k in range(2, 13)]
    errors = [errors_of(decided(method), question.truth) for method in methods[:9]]
    assert all(one.false == 0 and one.position is None for one in errors)
    assert methods[0].prepare()().shots.seed.tolist() == [3] * 40
    slope = np.polyfit(np.arange(2, 11), np.log2([one.share for one in errors]), 1)[0]
    assert -0.6 < slope < -0.4


def test_a_copy_keeps_what_can_be_hit() -> None:
    scene = Scene((50, 50), categories=("a",))
    scene.add(Sprite.box(9, 9), role="occluder")
    duck = scene.add(Sprite.polygon([(0, 0), (9, 2), (3, 8)]), (3.25, 70), angle=33, scale=(2, 1.5), flip="x",
                     layer=3, categories=["a"], velocity_xy=(1, 2), name="duck")  # fmt: skip
    gone = scene.add(Sprite.circle(3))
    last = scene.add(Sprite.circle(3), (9, 9), owner=duck)
    scene.remove(gone)
    alone = copied(scene, scene.ids("hittable"))
    assert alone.bounds is None and alone.ids().tolist() == [0, 1]
    assert [alone.name_of(i) for i in (0, 1)] == ["duck", scene.name_of(last)]
    for new, item in enumerate((duck, last)):
        (mask, corner), (expected, place) = alone.mask(new), scene.mask(item)
        assert np.array_equal(mask, expected) and corner == place
    assert alone.items.layer[0] == 3 and alone.items.velocity_256[0].tolist() == [256, 512]
    assert alone.items.categories[[0, 1]].tolist() == [1, 1] and alone.items.owner[[0, 1]].tolist() == [0, 1]
    assert [target[0] for target in targets_of(alone)] == [0, 1]


def test_places_are_about_objects_and_those_taken_are_not_drawn() -> None:
    targets = [(0, np.ones((3, 5), np.bool_), (10, 20)), (1, np.ones((1, 1), np.bool_), (-500, 0))]
    places, angles, near = drawn_places(targets, 500, 3, SUB * 4, lambda xy: xy[:, 0] > SUB * 12)
    assert places.shape == (500, 2) and ((angles >= 0) & (angles < 360)).all() and angles.max() - angles.min() > 300
    right = places[:, 0] > 0
    assert (near == ~right).all()
    assert 100 < right.sum() < 300 and places[:, 0].max() <= SUB * 12
    low, high = np.array([6, 16]) * SUB - 128, np.array([18, 26]) * SUB + 128
    assert (places[right] >= low).all() and (places[right] <= high).all()
    assert np.ptp(places[right, 1]) > 0.9 * (high - low)[1]
    with pytest.raises(InputError, match="room between its objects, got 0 free places"):
        drawn_places(targets, 5, 3, 0, lambda xy: np.ones(len(xy), np.bool_))


QUESTIONS = {"rays": rays_question, "movers": movers_question, "spread": spread_question}


@pytest.mark.parametrize("name", QUESTIONS)
def test_questions_depend_on_the_seed_alone(name: str) -> None:
    scene, ask = scene_of(1, 8), QUESTIONS[name]
    one, same, other = (ask(scene, 30, seed) for seed in (5, 5, 6))
    assert (one.name, one.shots, one.aimed, one.by_share) == (name, 30, None, name == "spread")
    for field in ("shot", "object", "xy", "share"):
        assert np.array_equal(getattr(one.truth, field), getattr(same.truth, field), equal_nan=True)
        first, again = (getattr(decided(q.curves[0].methods[0]), field) for q in (one, same))
        assert np.array_equal(first, again, equal_nan=True)
    assert one.truth.shot.tolist() != other.truth.shot.tolist()


@pytest.mark.parametrize("name", QUESTIONS)
@pytest.mark.parametrize("objects", [0, 1])
def test_questions_of_few_objects(name: str, objects: int) -> None:
    scene = Scene((90, 90))
    scene.add(Sprite.box(30, 3), (40, 40), role="occluder")
    for _ in range(objects):
        scene.add(Sprite.circle(6), (40, 40))
        scene.add(np.zeros((2, 2), np.bool_), (40, 40))
    question = QUESTIONS[name](scene, 40, 1)
    assert 0 < len(question.truth) < 40 if objects else len(question.truth) == 0
    for curve in question.curves:
        for method in curve.methods:
            errors = errors_of(decided(method), question.truth)
            assert errors.false == 0 and (objects or errors.wrong == 0)


@pytest.mark.parametrize("name", QUESTIONS)
def test_questions_refuse_what_is_no_number(name: str) -> None:
    with pytest.raises(InputError, match="shots: expected a whole number from 1 to 1000000, got 0"):
        QUESTIONS[name](Scene(), 0, 1)
    with pytest.raises(InputError, match="seed: expected a whole number from 0"):
        QUESTIONS[name](Scene(), 1, -1)


@pytest.mark.parametrize("peer", PEERS)
def test_a_peer_agrees_nearly_where_it_is_installed(peer: str) -> None:
    pytest.importorskip(peer)
    question = rays_question(load_scene(ROOT / "fixtures" / "gallery"), 100, 1)
    (errors,) = errors_in(question, peer)
    assert errors.wrong <= (0 if peer == "shapely" else 8) and errors.position < (0.01 if peer == "shapely" else 5)


def test_a_swept_disc_of_pymunk_agrees_nearly_where_nothing_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pymunk")
    scene = Scene()
    for k in range(4):
        scene.add(Sprite.circle(9 + k), (60 * k, 7 * k))
    question = movers_question(scene, 100, 1)
    (errors,) = errors_in(question, "pymunk")
    assert len(question.truth) > 20 and errors.wrong <= 2 and errors.position < 2
    scene.set(0, velocity_xy=(3, 0))
    assert "objects move" in curve_of(movers_question(scene, 5, 1), "pymunk").left_out
    monkeypatch.setitem(sys.modules, "pymunk", None)
    assert curve_of(movers_question(scene, 5, 1), "pymunk").left_out == "pymunk is not installed"


@pytest.mark.parametrize("peer", ["shapely", "pygame"])
def test_a_peer_finds_the_nearest_of_what_lies_in_the_box_of_another(peer: str) -> None:
    pytest.importorskip(peer)
    ell = np.ones((2, 20), np.bool_)
    ell[0, :-1] = False
    targets = [(4, ell, (0, 0)), (7, np.ones((1, 1), np.bool_), (10, 0)), (8, ell, (2, 0))]
    for order in (targets, targets[::-1]):
        curves = ray_curves(order, Segments(np.array([[-5.0, 0], [12, 0]]), np.array([[30.0, 0], [30, 0]])))
        found = decided(next(curve for curve in curves if curve.name == peer).methods[0])
        assert (found.object.tolist(), found.xy.tolist()) == ([7, 4], [[10, 0], [19, 0]])


@pytest.mark.parametrize("peer", PEERS)
def test_a_peer_that_is_missing_is_left_out_with_a_word(peer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, peer, None)
    curve = curve_of(rays_question(scene_of(1), 5, 1), peer)
    assert (curve.left_out, curve.methods) == (f"{peer} is not installed", ())


def test_what_is_too_large_for_a_method_is_left_out_with_a_word() -> None:
    scene = Scene()
    scene.add(Sprite.circle(6), (0, 0))
    scene.add(Sprite.circle(6), (2.0**36, 0))
    question = rays_question(scene, 20, 1)
    assert "is more than 16777216 px" in curve_of(question, "fixed step").left_out
    if "installed" not in curve_of(question, "pygame").left_out:
        assert "do not fit its rectangles" in curve_of(question, "pygame").left_out
    assert errors_in(question, "supercover")[0].wrong == 0 and len(question.truth)


def pixels_at(*places: tuple[int, int]) -> list[tuple[int, np.ndarray, tuple[int, int]]]:
    """Targets of one pixel each, numbered in order."""
    return [(number, np.ones((1, 1), np.bool_), place) for number, place in enumerate(places)]


def impact(
    start: tuple[int, int], step: tuple[int, int], targets: list, velocity: object = 0, radius: int = SUB
) -> tuple[int, float]:
    """What one disc touches first, and when."""
    moving = np.broadcast_to(np.asarray(velocity), (len(targets), 2))
    found = impacts(Flights(np.array([start]), np.array([step]), radius), targets, moving)
    return int(found.object[0]), float(found.time[0])


def test_of_pixels_entered_at_once_the_upper_is_first() -> None:
    targets = pixels_at((0, 1), (1, 0))
    assert impact((0, 0), (SUB, SUB), targets, radius=0)[0] == 1
    assert impact((-SUB, -SUB), (SUB, SUB), targets)[0] == 1


def test_a_disc_that_touches_as_it_leaves_has_touched() -> None:
    assert impact((0, 0), (-999, 5), pixels_at((1, 0))) == (0, 0.0)


def test_impacts_that_floats_take_for_one_are_told_apart() -> None:
    upper, lower = targets = pixels_at((10_000, 0), (10_000, 1))
    assert impact((0, 129), (20_000 * SUB, 0), targets)[0] == 1
    assert impact((0, 127), (20_000 * SUB, 0), [lower, upper])[0] == 0


@pytest.mark.parametrize("place", [(2859, 2512), (7, 2)])
def test_impacts_at_one_time_by_different_ways_are_one(place: tuple[int, int]) -> None:
    straight = np.array([3 * SUB - 260, 0])
    for sign, first in ((-1, 0), (1, 1)):  # of both, touched at a third of the frame, the upper is first
        pixel = np.array(place) * (1, sign)
        aslant = SUB * pixel - 52 * np.array((3, 4 * sign))  # from a side on whole numbers: |(3, 4)| = 5, radius 5 * 52
        moving = 3 * (straight - [aslant, straight])
        targets = pixels_at(tuple(pixel.tolist()), (3, 0))
        assert impact((0, 0), tuple(3 * straight), targets, moving, radius=260)[0] == first


def test_no_mover_begins_on_an_object() -> None:
    question = movers_question(load_scene(ROOT / "fixtures" / "targets"), 60, 1)
    hits = curve_of(question, "swept").methods[0].prepare()()
    assert len(hits.passes) > 10 and (hits.passes.entry > 0).all()


@pytest.mark.parametrize(
    ("side", "px"),
    [(10, (40, 2, 80, 5)), (3, (12, 1, 24, 2)), (301, (1000, 32, 2408, 64)), (1101, (1000, 32, 8808, 64))],
)
def test_lengths_are_those_of_the_median_object(side: int, px: tuple[int, ...]) -> None:
    scene = Scene()
    for w, h in ((side, side), (side - 2, side + 2), (1, 2), (2, 1), (side + 9, side + 9)):
        mask = np.zeros((h, w), np.bool_)
        mask[0, 0] = mask[-1, -1] = True
        scene.add(mask)
    asked = [ask(scene, 1, 1).asks for ask in QUESTIONS.values()]
    rays, radius, speed, blast = px
    assert asked == [
        f"Which object does a ray of {rays} px hit first?",
        f"What does a disc of {radius} px that flies {speed} px in a frame hit first?",
        f"How much of a blast of {blast} px lies on each object?",
    ]
