"""`hitplanes study`: its files, what is known to be true of any study, its truth, interrupts, and the words."""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from test_bounding_volumes import holds

from hitplanes import Scene, Sprite
from hitplanes.planes.common.checks import InputError
from hitplanes.planes.files.scene_folder import cleared
from hitplanes.planes.volumes import fit
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.lab.stability.stability import load_study, summary
from hitplanes.weapons.lab.study import questions
from hitplanes.weapons.lab.study import study as study_module
from hitplanes.weapons.lab.study.methods import Cost, Decisions, Method, Question, copied, enlarged, errors_of, measured
from hitplanes.weapons.lab.study.questions import (
    Discs,
    areas_question,
    discs_at,
    kind_of,
    kinds_scene,
    plane_curves,
    volume_curves,
)
from hitplanes.weapons.lab.study.study import (
    FILES,
    Effort,
    bound,
    csv_of,
    front,
    markdown,
    places,
    run_study,
    setting_text,
    verdict,
)
from hitplanes.weapons.lab.study.truth import Round, Straight, discs_on_shapes, placed_rings

ROOT = Path(__file__).parents[1]
TIMES = ("us_per_shot", "runs", "setup_ms", "kept_bytes", "run_bytes")


FEWER = Effort(shots=100, runs=1, seconds=0, objects=40)
FEWEST = Effort(shots=20, runs=1, seconds=0, objects=2)


@pytest.fixture(scope="module", params=[FEWER, pytest.param(Effort.quick(), marks=pytest.mark.long)], ids=["", "quick"])
def effort(request: pytest.FixtureRequest) -> Effort:
    return request.param


@pytest.fixture(scope="module")
def quick(effort: Effort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("quick") / "study"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Effort, "quick", classmethod(lambda cls: effort))
        assert main(["study", "-o", str(folder), "--quick", "--seed", "3"]) == 0
    return folder


def run_once(method: Method, runs: int, seconds: float) -> tuple[object, Cost]:
    """What a method decides, without the repetitions that measure it."""
    return method.prepare()(), Cost(0.0, 1e-6, 1e-6, 1e-6, 1, 0, 1)


def study_in(folder: Path) -> dict:
    return json.loads((folder / "study.json").read_text())


def points_of(study: dict, question: str, curve: str) -> list[dict]:
    (asked,) = (one for one in study["questions"] if one["name"] == question)
    (found,) = (one for one in asked["curves"] if one["name"] == curve)
    return found["points"]


def test_a_quick_study_writes_all_its_files(quick: Path, effort: Effort) -> None:
    assert sorted(path.name for path in quick.iterdir()) == sorted(FILES)
    study = study_in(quick)
    assert study["format"] == "hitplanes-study/1" and study["complete"] and study["seed"] == 3
    assert [question["name"] for question in study["questions"]] == ["areas", "rays", "movers", "spread"]
    assert study["scene"]["objects"] == study["scene"]["of"] == 6 and len(study["kinds"]) == 6
    for question in study["questions"]:
        assert question["shots"] > 0 and question["hits"] > 0 and question["truth"] and question["asks"].endswith("?")
        for curve in question["curves"]:
            assert bool(curve["points"]) != bool(curve["left_out"]), curve["name"]
            for point in curve["points"]:
                us = point["us_per_shot"]
                assert 0 < us["least"] <= us["median"] <= us["most"] and point["runs"] >= 1 and point["setup_ms"] >= 0
                assert point["kept_bytes"] >= 0 and point["run_bytes"] > 0
                assert point["wrong_per_shot"] == (point["missed"] + point["false"]) / question["shots"]
    assert study["plan"]["shots"] == effort.shots and "samples" in [stage["stage"] for stage in study["plan"]["ran"]]
    assert {"stage": "occluders", "why": "the scene has none"} in study["plan"]["left_out"]
    rows = list(csv.DictReader(io.StringIO((quick / "study.csv").read_text())))
    assert len(rows) == sum(len(curve["points"]) for q in study["questions"] for curve in q["curves"])
    told = (quick / "study.md").read_text()
    assert all(f"]({question['name']}.png)" in told for question in study["questions"])
    for name in ("areas", "rays", "movers", "spread"):
        assert (quick / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_what_is_known_to_be_true_comes_out(quick: Path) -> None:
    study = study_in(quick)
    noise = 2 / study["questions"][0]["shots"]
    scales = [point["wrong_per_shot"] for point in points_of(study, "areas", "pixel planes")]
    assert all(finer <= coarser + noise for coarser, finer in itertools.pairwise(scales)) and scales[0] > 0.1
    shares = [point["share_error"] for point in points_of(study, "areas", "pixel planes")]
    assert shares == sorted(shares, reverse=True)
    boxes = points_of(study, "areas", "boxes")
    assert [point["setting"] for point in boxes] == [1, 2, 4, 8, 16, 32, 64]
    for name in ("wrong_per_shot", "share_error"):
        errors = [point[name] for point in boxes]
        assert errors == sorted(errors, reverse=True) and errors[0] > errors[-1]
    assert boxes[0]["false"] == points_of(study, "areas", "box, refitted")[0]["false"]
    full = points_of(study, "areas", "pixel planes")[3]
    for curve in ("pixels, pre-filter", "pixels, broad phase"):
        for point in points_of(study, "areas", curve):
            assert (point["missed"], point["false"]) == (full["missed"], full["false"])
    for question, curve in (("rays", "supercover"), ("movers", "swept")):
        (point,) = points_of(study, question, curve)
        assert point["missed"] == point["false"] == 0 and point["position_error_px"] < 1e-5
    steps = [point["missed"] for point in points_of(study, "rays", "fixed step")]
    assert steps[0] > 0 and steps[0] >= steps[2] >= steps[4] >= steps[8]
    assert points_of(study, "spread", "every pixel")[0]["share_error"] == 0
    kinds = points_of(study, "areas", "oriented box")[0]["wrong_per_shot_by_kind"]
    assert kinds["long and thin"] < kinds["concave"] and set(kinds) == set(study["kinds"])


def studied(scene: Scene, seed: int, shots: int = 20) -> dict:
    return run_study(scene, seed, replace(FEWEST, shots=shots), lambda *_: None, lambda _: None)


@pytest.fixture
def planes_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Studies of pixel planes, and nothing else."""

    def questions(alone: Scene, discs: Discs, shots: int, seed: int) -> list[Question]:
        return [areas_question(discs, plane_curves(discs)[:2])]

    monkeypatch.setattr(study_module, "questions_of", questions)


def test_decisions_depend_on_the_seed_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_module, "measured", run_once)

    def decided(seed: int) -> list:
        study = studied(kinds_scene(), seed)
        points = [point for question in study["questions"] for curve in question["curves"] for point in curve["points"]]
        return [{name: value for name, value in point.items() if name not in TIMES} for point in points]

    one = decided(4)
    assert one == decided(4) and one != decided(5)


def masks() -> Scene:
    scene = Scene(size_wh=(200, 120))
    rng = np.random.default_rng(1)
    for k in range(4):
        blob = np.kron(rng.random((5, 6)) < 0.6, np.ones((4, 4), bool))
        scene.add(blob, (30 + 45 * k, 40.3), angle=20 * k, scale=1.5)
    return scene


def test_a_plane_at_full_scale_is_the_truth_where_masks_are() -> None:
    alone = copied(masks(), np.arange(4))
    discs = discs_at(alone, 120, 1)
    question = areas_question(discs, plane_curves(discs))
    assert question.truth_told == "masks at full scale of 4" and (discs.at == np.floor(discs.at)).all()
    errors = {m.setting: errors_of(m.read(m.prepare()()), question.truth) for m in question.curves[0].methods}
    assert errors[1][:4] == (0, 0, 0, 0)
    for finer in (2, 4):
        assert errors[finer][:2] == (0, 0) and errors[finer].share == 0 and errors[finer].position < 1
    assert errors[1 / 8].wrong > errors[1 / 2].wrong > 0
    for curve in volume_curves(discs):
        for method in curve.methods:
            found = errors_of(method.read(method.prepare()()), question.truth)
            assert found.missed == 0 or curve.name in ("circle about the pivot", "box, re-boxed"), curve.name


FITS = {
    "circle": fit.least_circle, "oriented box": fit.oriented_box, "boxes": partial(fit.boxes, k=3), "hull": fit.hull,
    "polygon": partial(fit.convex, n=5), "concave": partial(questions._concave, tolerance=1.0),
    "triangles": partial(questions._triangles, tolerance=0.5),
}  # fmt: skip


@pytest.mark.parametrize("name", FITS)
def test_volumes_fitted_to_masks_hold_their_pixel_squares_where_the_objects_are(name: str) -> None:
    scene, rng = Scene(), np.random.default_rng(4)
    for place in (5.25, -1000003.5, 2.0**31, -(2.0**40)):
        for _ in range(12):
            mask = rng.random(rng.integers(2, 9, 2)) < 0.5
            mask[0, 0] = True
            scene.add(mask, (place, place / 3), angle=float(rng.integers(360)))
    for item, volume in enumerate(questions._fit(FITS[name])(scene)):
        assert holds(volume, *scene.mask(item)), item


def test_the_share_of_a_volume_is_that_of_the_pixels_of_a_disc_or_of_a_lattice_of_them() -> None:
    for radius, every in ((3, 1), (17, 1), (23, 2), (48, 4)):
        side = np.arange(-radius, radius + 1, 1)
        x, y = (grid.ravel() for grid in np.meshgrid(side, side))
        inside = (x * x + y * y <= radius * radius) & (x % every == 0) & (y % every == 0)
        found = questions._looked_at(float(radius)).tolist()
        assert sorted(found) == sorted(np.stack([x, y], axis=1)[inside].tolist()) and found[0] == [0, 0]
    scene = Scene()
    scene.add(Sprite.circle(300.5), (0.3, 0.2))
    discs = discs_at(scene, 20, 1)
    (circle, *_), truth = volume_curves(discs), areas_question(discs, []).truth
    found = circle.methods[0].read(circle.methods[0].prepare()())
    share = errors_of(found, truth).share
    assert len(found) and share is not None and share < 0.02


def test_enlarged_masks_are_squares_of_pixels() -> None:
    scene = masks()
    big = enlarged(scene, np.array([2, 0]), 3)
    for new, old in ((0, 2), (1, 0)):
        (mask, corner), (small, place) = big.mask(new), scene.mask(old)
        assert np.array_equal(mask, np.repeat(np.repeat(small, 3, axis=0), 3, axis=1))
        assert corner == tuple(3 * v for v in place)


def area_by_counting(at: np.ndarray, radius: float, rings: list) -> float:
    """Part of a disc that lies within rings, by a grid of points."""
    side = (np.arange(90) + 0.5) / 90 * 2 - 1
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    on = x * x + y * y <= 1
    return float(winding_inside(at + radius * np.stack([x[on], y[on]], axis=1), rings).mean())


def winding_inside(points: np.ndarray, rings: list) -> np.ndarray:
    """Even-odd by angles: the sum of the angles of each ring tells whether it goes round a point."""
    times = np.zeros(len(points), int)
    for ring in rings:
        off = ring - points[:, None]
        angle = np.arctan2(off[..., 1], off[..., 0])
        turn = (np.roll(angle, -1, axis=1) - angle + np.pi) % (2 * np.pi) - np.pi
        times += np.rint(turn.sum(axis=1) / (2 * np.pi)).astype(int)
    return times % 2 == 1


RINGS = [
    np.array([(-20, -12), (22, -15), (18, 14), (0, 2), (-17, 16)], float),
    np.array([(-6, -8), (8, -9), (3, -2)], float),
]


@pytest.mark.parametrize("seed", range(3))
def test_truth_of_polygons(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rings = placed_rings(RINGS, "x", (1.25, 0.75), 33.0, np.array([50.25, -7.5]))
    at, radius = rng.uniform((20, -40), (80, 30), (40, 2)), 7.0
    found = discs_on_shapes(at, radius, [Straight(rings)])
    told = {int(s): (xy, share) for s, xy, share in zip(found.shot, found.xy, found.share, strict=True)}
    ends = [(ring, np.roll(ring, -1, axis=0)) for ring in rings]
    edges = np.concatenate([a + np.linspace(0, 1, 2001)[:, None, None] * (b - a) for a, b in ends], axis=1).reshape(
        -1, 2
    )
    for shot, inside in enumerate(winding_inside(at, rings).tolist()):
        away = np.sqrt(((edges - at[shot]) ** 2).sum(axis=1))
        assert (shot in told) == (inside or away.min() <= radius) or abs(away.min() - radius) < 1e-2
        if shot in told:
            assert np.allclose(told[shot][0], at[shot] if inside else edges[away.argmin()], atol=0.03)
            assert told[shot][1] == pytest.approx(area_by_counting(at[shot], radius, rings), abs=0.01)
    assert 5 < len(told) < 40


def test_truth_of_circles() -> None:
    shape = Round(np.array([10.0, 20.0]), 5.0)
    at = np.array([(10, 20), (18, 20), (18.001, 20), (10, 13.5), (13, 24)])
    found = discs_on_shapes(at, 3.0, [shape])
    assert found.shot.tolist() == [0, 1, 3, 4] and found.share[0] == pytest.approx(1)
    assert found.xy.tolist() == pytest.approx(np.array([(10, 20), (15, 20), (10, 15), (13, 24)]))
    distance, a, b = 6.5, 3.0, 5.0  # the area that two circles share, by the closed form
    one = math.acos((distance**2 + a**2 - b**2) / (2 * distance * a))
    two = math.acos((distance**2 + b**2 - a**2) / (2 * distance * b))
    lens = a * a * (one - math.sin(2 * one) / 2) + b * b * (two - math.sin(2 * two) / 2)
    assert found.share[2] == pytest.approx(lens / (math.pi * a * a), rel=1e-3)


def test_truth_of_circles_that_only_touch() -> None:
    """Whole vectors of whole length: the nearest point is rounded, the answer is not."""
    for x, y, length in ((3, 4, 5), (5, 12, 13), (8, 15, 17), (20, 21, 29), (7, 24, 25), (12, 35, 37)):
        for times in range(2, 30):
            at = np.array([[x * times, y * times], [x * times + 1 / 256, y * times]]) + 0.25
            found = discs_on_shapes(at, float(times), [Round(np.array([0.25, 0.25]), float(times * (length - 1)))])
            assert found.shot.tolist() == [0], (x, y, times)


def test_placed_rings_turn_clockwise_on_the_screen() -> None:
    ((ring,)) = placed_rings([np.array([(1.0, 0.0)])], "none", (2.0, 1.0), 90.0, np.array([5.0, 5.0]))
    assert np.allclose(ring, [(5, 7)])


def test_truth_shares_no_code_with_what_it_judges() -> None:
    for name in ("truth",):
        text = (ROOT / "weapons" / "lab" / "study" / f"{name}.py").read_text()
        assert "hitplanes" not in text


def test_kinds_of_the_built_in_scene_are_their_names() -> None:
    scene = kinds_scene()
    assert [kind_of(scene, item) for item in range(len(scene))] == [scene.name_of(item) for item in range(len(scene))]
    item = scene.add(Sprite.box(20, 16), (0, 0))
    assert kind_of(scene, item) == "compact"


def test_errors_are_counted() -> None:
    xy = np.array([(0.0, 0.0), (3.0, 4.0), (1.0, 1.0)])
    truth = Decisions(np.array([0, 1, 2]), np.array([5, 5, 6]), xy, np.array([0.5, 1.0, 0.25]))
    found = Decisions(np.array([2, 0, 3]), np.array([6, 5, 9]), xy[[1, 0, 2]], np.array([0.75, 0.5, 0.25]))
    errors = errors_of(found, truth)
    assert (errors.missed, errors.false, errors.wrong) == (1, 1, 2) and sorted(errors.objects.tolist()) == [5, 9]
    assert errors.share == pytest.approx((0.0 + 1.0 + 0.5 + 0.25) / 4)
    assert errors.position == pytest.approx(math.hypot(2, 3) / 2)
    untold = Decisions.of(found.shot, found.object)
    assert errors_of(untold, truth)[:4] == (1, 1, None, None)
    none = Decisions.of(np.zeros(0, int), np.zeros(0, int))
    assert errors_of(none, none)[:4] == (0, 0, None, None) and errors_of(none, truth).missed == 3


def test_cost_of_a_method() -> None:
    made = []

    def prepare():
        made.append(np.zeros(1 << 17))
        return lambda: np.ones(1 << 16).sum()

    answer, cost = measured(Method(None, prepare, lambda _: None), 3, 0.0)
    assert answer == 1 << 16 and cost.runs == 3 and 0 < cost.least <= cost.median <= cost.most and cost.setup >= 0
    assert 1 << 20 <= cost.kept_bytes < (1 << 20) + 50_000 and 1 << 19 <= cost.run_bytes < (1 << 19) + 50_000
    _, counted = measured(Method(None, prepare, lambda _: None, lambda _: 7), 1, 0.0)
    assert counted.kept_bytes == 7


def point(error: float, us: float, setting: object = None) -> dict:
    return {
        "setting": setting, "missed": 1, "false": 0, "wrong_per_shot": error, "share_error": None,
        "position_error_px": None, "wrong_per_shot_by_kind": {"round": error}, "runs": 3, "setup_ms": 1.0,
        "us_per_shot": {"least": us, "median": us, "most": us}, "kept_bytes": 999_999, "run_bytes": 12,
    }  # fmt: skip


def told_study(**curves: list[dict]) -> dict:
    told = [{"name": n, "setting": "", "note": "", "left_out": "", "points": p} for n, p in curves.items()]
    question = {"name": "areas", "asks": "Which?", "truth": "masks", "shots": 300, "hits": 9, "error": "wrong"}
    return {
        "complete": True, "seed": 0, "kinds": {"round": 1}, "versions": {"numpy": "2"},
        "scene": {"name": "s", "objects": 1, "of": 1}, "questions": [{**question, "curves": told}],
        "plan": {"shots": 7, "ran": [{"stage": "walk", "why": "so", "bytes": 12, "ns": 5000}], "left_out": []},
    }  # fmt: skip


def test_verdict_names_the_fastest_that_is_good_enough() -> None:
    study = told_study(slow=[point(0.0, 9, 4)], fast=[point(0.2, 1)], middle=[point(0.02, 3, 1 / 8)])
    assert verdict(study, 0.05)[0].startswith(
        "areas: the fastest with 0.05 wrong decisions a shot or less is middle 1/8, 3 us"
    )
    (line,) = verdict(study, 0.001)
    assert "is slow 4, 9 us a shot, none wrong (under 0.01); 300 shots cannot tell errors below 0.01" in line
    (line,) = verdict(told_study(fast=[point(0.2, 1)]), 0.1)
    assert line == "areas: no method has 0.1 wrong decisions a shot or less; the best is fast, 1 us a shot, 0.2"
    assert verdict(told_study(), 0.1) == ["areas: nothing was measured"]


def test_front_has_none_that_is_slower_and_as_wrong() -> None:
    study = told_study(a=[point(0.5, 1), point(0.5, 2), point(0.1, 3), point(0.2, 4), point(0.0, 5), point(0.0, 6)])
    assert [(p.us, p.error) for p in front(places(study["questions"][0]))] == [(1, 0.5), (3, 0.1), (5, 0.0)]
    assert bound(study["questions"][0]) == 0.01


def test_a_diagram_has_a_floor_where_a_method_is_never_wrong() -> None:
    pytest.importorskip("matplotlib")
    from hitplanes.weapons.lab.study.study import work_precision

    def texts(error: float) -> list[str]:
        (question,) = told_study(fast=[point(0.2, 1, 4)], other=[point(error, 3, 8)])["questions"]
        (plot,) = work_precision(question, "a scene").axes
        assert plot.get_xlabel().startswith("time a shot, microseconds") and plot.get_ylabel().startswith("wrong")
        assert (plot.get_xscale(), plot.get_yscale()) == ("log", "log")
        return [text.get_text() for text in plot.texts]

    assert {"none wrong in 300 shots: the rate is likely under 3/n", "3/n = 0.01"} <= set(texts(0.0))
    assert "3/n = 0.01" in texts(0.02)
    assert not any("none wrong" in text for text in texts(0.02)) and {"4", "8"} <= set(texts(0.02))


def test_words_of_a_study() -> None:
    study = told_study(
        **{"circle": [point(0.02, 1)], "box, refitted": [point(0.2, 2)], "oriented box": [point(0.3, 1.5)]}
    )
    told = markdown(study, 0.05)
    assert "| circle | 1 (1 us) | 1 (0.02 wrong) | round |" in told and "1 MB" in told and "| 12 B |" in told
    assert "| bounding box, oriented | 2 (1.5 us) | 3 (0.3 wrong) | nothing; nearest: round, 0.3 |" in told
    assert "Not complete" not in told and "Not complete" in markdown({**study, "complete": False}, 0.05)
    hostile = {**study, "scene": {**study["scene"], "name": "a\n\x7f\u202e"}}
    assert markdown(hostile, 0.05).splitlines()[0] == r"# Error against run time: a\n\x7f\u202e"
    assert [setting_text(s) for s in (0.125, 2.0, 0.3, "grid", None)] == ["1/8", "2", "0.3", "grid", ""]
    assert "7 discs in one call" in told and "walk   5.0 us     12  so" in told
    assert csv_of(study).splitlines()[1].startswith("areas,circle,,300,1,0,0.02,,,1,1,1,3,1.0,999999,12")


def test_an_interrupted_study_keeps_what_it_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def interrupted(method: Method, runs: int, seconds: float):
        if method.setting == "none":
            raise KeyboardInterrupt
        return measured(method, runs, seconds)

    monkeypatch.setattr(study_module, "measured", interrupted)
    folder = tmp_path / "study"
    assert main(["study", "-o", str(folder), "--quick"]) == 130
    assert f"interrupted: what was measured is in {folder}" in capsys.readouterr().err
    study = study_in(folder)
    assert not study["complete"] and len(points_of(study, "areas", "pixel planes")) == 6
    assert "Not complete" in (folder / "study.md").read_text() and (folder / "areas.png").exists()
    assert not (folder / "rays.png").exists() and len((folder / "study.csv").read_text().splitlines()) == 7


def test_an_interrupt_before_anything_is_measured_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(study_module, "measured", interrupted)
    (tmp_path / "mine").mkdir()
    for name in ("study", "mine"):
        assert main(["study", "--quick", "-o", str(tmp_path / name)]) == 130
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_an_interrupt_before_anything_is_measured_leaves_the_last_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    for name in FILES:
        (tmp_path / name).write_text("of before")
    monkeypatch.setattr(study_module, "measured", interrupted)
    assert main(["study", "-o", str(tmp_path), "--quick"]) == 130
    assert {path.read_text() for path in tmp_path.iterdir()} == {"of before"}


@pytest.mark.parametrize(
    ("sprite", "pose", "beyond"),
    [
        (Sprite.box(2000, 2000), {"scale": 1 / 256}, {0.125, 0.25, 0.5}),
        (Sprite.circle(0.1), {"scale": 256}, {2, 4}),
        (np.ones((2, 3), bool), {"position_xy": (2.0**40 - 64, 0)}, {2, 4}),
    ],
    ids=["small", "large", "far"],
)
def test_a_setting_beyond_a_limit_is_left_out_with_a_word(
    planes_alone: None, sprite: object, pose: dict, beyond: set
) -> None:
    scene = Scene()
    scene.add(sprite, **{"position_xy": (0, 0), **pose})
    study = studied(scene, 1, shots=4)
    (planes,) = (one for one in study["questions"][0]["curves"] if one["name"] == "pixel planes")
    assert study["complete"] and {p["setting"] for p in planes["points"]} == {1 / 8, 1 / 4, 1 / 2, 1, 2, 4} - beyond
    assert all(f"scale {scale:g} is left out: " in planes["note"] for scale in beyond) and "expected" in planes["note"]
    assert "is left out: " in markdown(study, 0.1)


def test_a_method_that_meets_a_limit_at_every_setting_is_left_out(
    planes_alone: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(method: Method, runs: int, seconds: float) -> tuple:
        if method.setting != "box":
            raise InputError("scale: expected less, got more")
        return measured(method, 1, 0)

    monkeypatch.setattr(study_module, "measured", refused)
    planes, filters = studied(kinds_scene(), 1, shots=2)["questions"][0]["curves"]
    assert not planes["points"] and planes["left_out"].startswith("scale 0.125 is left out: scale: expected less")
    assert [p["setting"] for p in filters["points"]] == ["box"] and not filters["left_out"]
    assert "; pre-filter polygon is left out: scale: expected" in filters["note"]


def test_kinds_that_no_shot_is_near_are_told_nothing_of(planes_alone: None) -> None:
    study = studied(kinds_scene(), 1, shots=1)
    by_kind = study["questions"][0]["curves"][0]["points"][0]["wrong_per_shot_by_kind"]
    assert len(study["kinds"]) == 2 and len(by_kind) == 1


def test_a_second_interrupt_leaves_the_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hitplanes.weapons.lab.study.study.work_precision", interrupted)
    monkeypatch.setattr("hitplanes.weapons.lab.study.study.run_study", kept_of_another)
    assert main(["study", "-o", str(tmp_path / "study"), "--quick"]) == 130
    told = f"hitplanes: interrupted: what was measured is in {tmp_path / 'study'}; only diagrams are missing\n"
    assert capsys.readouterr().err == told
    assert sorted(path.name for path in (tmp_path / "study").iterdir()) == ["study.csv", "study.json", "study.md"]
    assert ".png" not in (tmp_path / "study" / "study.md").read_text()


def kept_of_another(*arguments: object) -> None:
    """Stand for a study that was interrupted after its first curve."""
    *_, keep = arguments
    keep({**told_study(circle=[point(0.02, 1)]), "complete": False})
    raise KeyboardInterrupt


def test_without_matplotlib_the_diagrams_are_left_out_with_a_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setattr("hitplanes.weapons.lab.study.study.find_spec", lambda name: None)
    monkeypatch.setattr(study_module, "measured", run_once)
    monkeypatch.setattr(Effort, "quick", classmethod(lambda cls: FEWEST))
    assert main(["study", "-o", str(tmp_path / "study"), "--quick"]) == 0
    assert "matplotlib is not installed" in capsys.readouterr().out
    assert sorted(path.suffix for path in (tmp_path / "study").iterdir()) == [".csv", ".json", ".md"]


@pytest.mark.parametrize("effort", [FEWEST, pytest.param(Effort.quick(), marks=pytest.mark.long)], ids=["", "quick"])
def test_a_scene_without_targets_is_studied(effort: Effort, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Effort, "quick", classmethod(lambda cls: effort))
    assert main(["study", str(ROOT / "fixtures" / "empty"), "-o", str(tmp_path / "study"), "--quick"]) == 0
    study = study_in(tmp_path / "study")
    assert study["complete"] and study["scene"]["objects"] == 0
    assert {line.split(": ")[1] for line in verdict(study, 0.1)} == {
        "no shot hits anything in truth, so it tells nothing"
    }


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--error", "2"], "--error: expected"),
        (["--error", "nan"], "--error: expected"),
        (["--seed", "-1"], "--seed: expected"),
        (["nowhere"], "nowhere"),
    ],
)
def test_bad_words_write_nothing(words: list[str], told: str, tmp_path: Path, capsys) -> None:
    assert main(["study", *words, "-o", str(tmp_path / "study")]) == 2
    assert told in capsys.readouterr().err and not (tmp_path / "study").exists()


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path, capsys) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["study", "-o", str(tmp_path)]) == 2
    assert "expected a new folder, or that of an earlier run" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    (tmp_path / "file").write_text("")
    assert main(["study", "-o", str(tmp_path / "file")]) == 2
    assert main(["study", "-o", str(tmp_path / "no" / "such")]) == 2


def test_what_cannot_be_removed_is_named(tmp_path: Path) -> None:
    (tmp_path / "study.md").mkdir()
    with pytest.raises(InputError, match=r"--output: cannot remove .*study\.md: "):
        cleared(tmp_path, ["study.json", "study.md"])


def test_the_chapter_is_what_its_studies_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "fixtures" / "study"))
    import chapter

    assert (ROOT / "fixtures" / "study" / "README.md").read_text(encoding="utf-8") == chapter.chapter()
    told = "\n".join(summary(load_study(ROOT / "fixtures" / "study" / "stability" / "stability.json")))
    assert f"```text\n{told}\n```" in (ROOT / "fixtures" / "README.md").read_text(encoding="utf-8")
    for name in chapter.SCENES:
        folder = ROOT / "fixtures" / "study" / name
        study = study_in(folder)
        assert study["complete"] and (folder / "study.csv").read_text() == csv_of(study)
        drawn = [question["name"] for question in study["questions"]]
        assert (folder / "study.md").read_text() == markdown(study, chapter.ERROR, drawn)
        for question, curve in (("rays", "supercover"), ("movers", "swept")):
            assert points_of(study, question, curve)[0]["wrong_per_shot"] == 0
