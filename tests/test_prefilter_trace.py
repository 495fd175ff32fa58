"""What a report tells and draws of the way to its hits: objects tested, volumes, cells."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_of import some_of

from hitplanes import (
    Beam,
    Disc,
    InputError,
    Laser,
    Pistol,
    Point,
    Projectile,
    Rifle,
    Scene,
    Spread,
    Sprite,
    Sweep,
    Weapon,
    fire,
    load_scene,
)
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.cli.report_file import REPORT
from hitplanes.weapons.report.canvas import _footer, factor_of
from hitplanes.weapons.report.differences import differences
from hitplanes.weapons.report.picture import picture_of_report
from hitplanes.weapons.report.prefilter_trace import CELLS_MAX, PATTERNS_MAX
from hitplanes.weapons.report.report import SHOTS_MAX, report_of
from hitplanes.weapons.report.symbols import LET_THROUGH, MARKS, PASSED_OVER, SKETCH

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"
WAYS = [
    ("box", None), ("circle", "grid"), ("oriented box", "quadtree"), ("4 boxes", "bvh"), ("polygon", "none"),
    ("swept", "grid"), (None, "quadtree"), ("none", None),
]  # fmt: skip


def yard() -> Scene:
    """Three targets and a wall, far from one another."""
    scene = Scene((200, 120), name="yard")
    for name, xy in (("west", (30, 40)), ("mid", (90, 60)), ("east", (160, 90))):
        scene.add(Sprite.circle(9), xy, name=name)
    scene.add(Sprite.box(4, 40), (120, 60), role="occluder", name="wall")
    return scene


def report(scene: Scene, weapon: Weapon, at: Any, **how: Any) -> dict[str, Any]:
    return report_of(scene, [fire(scene, weapon, at, aim=30 if isinstance(weapon, Beam) else None)], **how)


def colors(picture: np.ndarray) -> set[tuple[int, ...]]:
    labels = np.unique(picture.reshape(-1, 3).astype(np.int32) @ (1 << 16, 1 << 8, 1))  # rows are slow to sort
    return {(code >> 16, code >> 8 & 255, code & 255) for code in labels.tolist()}


@pytest.mark.parametrize(("prefilter", "broadphase"), some_of(WAYS, 2))
def test_what_was_tested_is_told(prefilter: str | None, broadphase: str | None) -> None:
    scene = yard()
    told = report(scene, Disc(20), (90, 60), prefilter=prefilter, broadphase=broadphase)
    REPORT.check("report", json.loads(json.dumps(told)))
    assert told["filter"]["prefilter"] == (prefilter or "box")
    assert told["filter"]["broadphase"] == (broadphase or "none")
    (shot,) = told["shots"]
    every = sorted(scene.find(name) for name in ("west", "mid", "east", "wall"))
    near = [scene.find("mid")]
    assert shot["tested"]["objects"] == (every if prefilter == "none" else near)
    assert shot["tested"]["of"] == 4
    assert (shot["tested"]["opened"] > 0) == (broadphase not in (None, "none"))
    assert any(cell["opened"] for cell in told["filter"]["cells"]) == (broadphase not in (None, "none"))
    patterns = [np.array(pattern["points"]) for pattern in shot["tested"]["patterns"]]
    assert len(patterns) == (prefilter != "none")
    for ring in patterns:  # about the shot, and around it
        assert (ring.min(axis=0) <= (90 - 20.5, 60 - 20.5)).all()
        assert (ring.max(axis=0) >= (90 + 20.5, 60 + 20.5)).all()
        assert (np.abs(ring - (90, 60)) < 35).all()


def test_without_a_word_nothing_is_told_or_drawn() -> None:
    scene = yard()
    told = report(scene, Disc(20), (90, 60))
    assert "filter" not in told
    assert "tested" not in told["shots"][0]
    assert not colors(picture_of_report(told, scene, text=False)) & {SKETCH[LET_THROUGH], SKETCH["cell"]}


@pytest.mark.parametrize(("prefilter", "broadphase"), some_of(WAYS, 2))
def test_volumes_and_cells_are_drawn_and_in_the_legend(prefilter: str | None, broadphase: str | None) -> None:
    scene = yard()
    told = report(scene, Disc(20), (90, 60), prefilter=prefilter, broadphase=broadphase)
    seen = colors(picture_of_report(told, scene, text=False))
    drawn = {name for name, color in SKETCH.items() if color in seen and color not in (c for c, _ in MARKS.values())}
    volumes = set() if prefilter == "none" else {LET_THROUGH, PASSED_OVER}
    assert drawn >= volumes
    assert (LET_THROUGH in drawn) == (prefilter != "none")
    assert ("cell" in drawn) <= (broadphase in ("grid", "quadtree", "bvh"))
    if broadphase == "grid":
        assert "cell" in drawn


def test_the_footer_leaves_out_nothing_that_is_drawn() -> None:
    """The call itself needed no volume: what is drawn is what a call that asks for them would test."""
    plain, drawn = (
        _footer(report(yard(), Disc(20), (90, 60), **how), 2000, 100)[1].text.split("left out: ")[1]
        for how in ({}, {"prefilter": "4 boxes", "broadphase": "quadtree"})
    )
    assert "broad phase" in plain and "volumes" in plain and "weights" in drawn
    assert "broad phase" not in drawn and "volumes" not in drawn


def test_a_volume_is_drawn_around_its_object() -> None:
    """Outside of the mask, within its box and what a circle adds; and the scene is drawn as without it elsewhere."""
    scene = Scene((80, 60))
    scene.add(Sprite.box(20, 10), (40, 30))
    told = report(scene, Point(), (40, 30), prefilter="box")
    factor = factor_of(tuple(told["view_xyxy"]))
    picture = picture_of_report(told, scene, text=False)
    y, x = np.nonzero((picture == SKETCH[LET_THROUGH]).all(axis=2))
    keep = y < 44 + 60 * factor  # not the legend
    left, top = min(x[keep]), min(y[keep])
    width, height = np.ptp(x[keep]), np.ptp(y[keep])
    assert abs(width - 21 * factor) <= 3
    assert abs(height - 11 * factor) <= 3
    assert abs((left - (picture.shape[1] - 80 * factor) // 2) - 29.5 * factor - factor / 2) <= 2
    assert abs((top - 44) - 24.5 * factor - factor / 2) <= 2


def test_pellets_have_volumes_of_their_own_and_not_too_many() -> None:
    scene = yard()
    told = report(scene, Spread(Disc(1), count=100, radius=30), (90, 60), prefilter="circle")
    assert len(told["shots"][0]["tested"]["patterns"]) == PATTERNS_MAX


def test_a_batch_tells_cells_but_no_volumes() -> None:
    scene = yard()
    many = [(20 + i, 40) for i in range(SHOTS_MAX + 1)]
    told = report(scene, Point(), many, prefilter="circle", broadphase="grid")
    assert not told["shots"]
    assert {cell["opened"] for cell in told["filter"]["cells"]} == {True, False}
    REPORT.check("report", json.loads(json.dumps(told)))
    picture_of_report(told, scene)


def test_of_very_many_cells_the_opened_ones_are_told() -> None:
    scene = Scene((2000, 2000))
    pixel = Sprite.from_mask([[True]])
    rng = np.random.default_rng(1)
    for xy in rng.integers(0, 2000, (CELLS_MAX + 1500, 2)).tolist():
        scene.add(pixel, xy)
    told = report(scene, Disc(200), (1000, 1000), broadphase="grid")
    assert 0 < len(told["filter"]["cells"]) < 1000
    assert all(cell["opened"] for cell in told["filter"]["cells"])


def test_cells_are_cut_to_the_view() -> None:
    scene = Scene()
    for x in range(0, 3 * 10**5, 1000):
        scene.add(Sprite.circle(200), (x, 0))
    for broadphase in ("grid", "quadtree", "bvh"):
        told = report(scene, Disc(9), (5000, 0), broadphase=broadphase)
        x, y, x_max, y_max = told["view_xyxy"]
        for cell in told["filter"]["cells"]:
            left, top, right, low = cell["box_xyxy"]
            assert x - 1 <= left <= right <= x_max + 1
            assert y - 1 <= top <= low <= y_max + 1


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ({"prefilter": "auto"}, "prefilter: expected one to be shown, of none, box, .*, swept, got 'auto'"),
        ({"prefilter": "cirle"}, r"prefilter: .*did you mean 'circle'"),
        ({"broadphase": "tree"}, "broadphase: expected one of"),
        ({"prefilter": "none", "broadphase": "grid"}, "broadphase: expected 'none' without a pre-filter, got 'grid'"),
    ],
)
def test_what_cannot_be_shown_is_refused(how: dict[str, str], told: str) -> None:
    with pytest.raises(InputError, match=told):
        report(yard(), Point(), (1, 1), **how)


def test_the_command_draws_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["report", str(GALLERY), "-o", str(tmp_path / "r.png"), "--json", str(tmp_path / "r.json"), "--plan"]
    assert main([*words, "--prefilter", "4 boxes", "--broadphase", "grid"]) == 0
    out = capsys.readouterr().out
    assert "  box, then 4 boxes, by grid; 1 of 26 pairs left\n" in out
    found = json.loads((tmp_path / "r.json").read_text())
    assert found["filter"]["prefilter"] == "4 boxes"
    scene = load_scene(GALLERY)
    assert found["shots"][0]["tested"]["of"] == len(scene.items.stack())
    assert main([*words, "--prefilter", "sphere"]) == 2
    assert "prefilter: expected one of" in capsys.readouterr().err


def test_a_sketch_leaves_the_rest_to_be_seen() -> None:
    """Volumes are thin lines: under them the picture is as without."""
    scene = yard()
    plain, drawn = (
        picture_of_report(report(scene, Disc(8), (90, 60), **how), scene, text=False)[: 44 + 120 * 8]
        for how in ({}, {"prefilter": "polygon"})
    )
    changed = (plain != drawn).any(axis=2).mean()
    assert 0 < changed < 0.03


def test_a_long_volume_is_drawn_where_it_is() -> None:
    """Its ends lie far beyond the picture; in the picture it follows the beam."""
    scene = Scene((120, 90))
    scene.add(Sprite.circle(5), (60, 34))
    told = report_of(scene, [fire(scene, Beam(500_000, 6), (0, 0), aim=30)], prefilter="swept")
    picture = picture_of_report(told, scene, text=False)
    factor = factor_of(tuple(told["view_xyxy"]))
    x0, y0 = told["view_xyxy"][:2]
    left = (picture.shape[1] - (told["view_xyxy"][2] - x0 + 1) * factor) // 2
    y, x = np.nonzero((picture[44 : 44 + (told["view_xyxy"][3] - y0 + 1) * factor] == (255, 255, 255)).all(axis=2))
    world = np.stack([(x - left) / factor + x0 - 0.5, y / factor + y0 - 0.5], axis=1)
    across = np.abs(world @ [-np.sin(np.pi / 6), np.cos(np.pi / 6)])
    on_edge = (across > 3) & (across < 6) & (world[:, 0] > 20)
    assert on_edge.sum() > 100 * factor
    assert world[on_edge].max(axis=0)[0] > 110


def test_a_filter_without_what_was_tested_is_refused() -> None:
    scene = yard()
    told = report(scene, Disc(20), (90, 60), prefilter="circle")
    del told["shots"][0]["tested"]
    with pytest.raises(InputError, match="shots: expected 'tested' in each, as the report has a filter"):
        picture_of_report(told, scene)


def test_reports_that_differ_in_the_filter_only_are_the_same() -> None:
    scene = yard()
    plain, *shown = (
        report(scene, Disc(20), (90, 60), **how) for how in ({}, {"prefilter": "circle"}, {"broadphase": "bvh"})
    )
    assert all(differences(plain, other) == [] for other in shown)
    assert differences(shown[0], shown[1]) == []


def test_each_cell_told_as_opened_meets_a_shot() -> None:
    scene = Scene((600, 600))
    rng = np.random.default_rng(2)
    for xy in rng.uniform(0, 600, (300, 2)):
        scene.add(Sprite.circle(4), xy)
    for broadphase in ("grid", "quadtree", "bvh"):
        told = report(scene, Disc(20), (300, 200), broadphase=broadphase)
        opened = [cell["box_xyxy"] for cell in told["filter"]["cells"] if cell["opened"]]
        assert opened
        assert all(x <= 320 and x_max >= 280 and y <= 220 and y_max >= 180 for x, y, x_max, y_max in opened), broadphase


def ray_report(scene: Scene, weapon: Weapon, at: Any, aim: float = 0, **how: Any) -> dict[str, Any]:
    told = report_of(scene, [fire(scene, weapon, at, aim=aim)], **how)
    REPORT.check("report", json.loads(json.dumps(told)))
    return told


@pytest.mark.parametrize(("prefilter", "broadphase"), some_of(WAYS, 2))
def test_what_a_ray_was_tested_against_is_told(prefilter: str | None, broadphase: str | None) -> None:
    """A ray of width 4 along y = 51: by its box beside of mid, by its capsule against it; on to the wall."""
    scene = yard()
    told = ray_report(scene, Laser(95, width=4), (45, 51), prefilter=prefilter, broadphase=broadphase)
    (shot,) = told["shots"]
    every = sorted(scene.find(name) for name in ("west", "mid", "east", "wall"))
    near = sorted(scene.find(name) for name in ("mid", "wall"))
    assert shot["tested"]["objects"] == (every if prefilter == "none" else near)
    assert shot["tested"]["of"] == 4
    assert (shot["tested"]["opened"] > 0) == (broadphase not in (None, "none"))
    assert any(cell["opened"] for cell in told["filter"]["cells"]) == (broadphase not in (None, "none"))
    patterns = [np.array(pattern["points"]) for pattern in shot["tested"]["patterns"]]
    assert len(patterns) == (prefilter != "none")
    for ring in patterns:
        assert (ring.min(axis=0) <= (45 - 1.9, 51 - 1.9)).all() and (ring.max(axis=0) >= (140 + 1.9, 51 + 1.9)).all()
        assert (ring.min(axis=0) >= (45 - 6, 51 - 6)).all() and (ring.max(axis=0) <= (140 + 6, 51 + 6)).all()
    picture_of_report(told, scene)


def test_a_volume_lets_fewer_rays_through_than_a_box() -> None:
    scene = Scene((200, 120))
    item = scene.add(Sprite.circle(9), (90, 60))
    (by_box,), (by_circle,) = (
        ray_report(scene, Laser(120), (40, 26), 45, prefilter=name)["shots"] for name in ("box", "circle")
    )
    assert by_box["tested"]["objects"] == [item] and by_circle["tested"]["objects"] == []
    (ring,) = by_circle["tested"]["patterns"]
    assert [40, 26] in ring["points"] and len(ring["points"]) == 2, "a thin ray is its own volume"


def test_what_a_ray_refuses_is_not_tested() -> None:
    scene = yard()
    (shot,) = report_of(scene, [fire(scene, Laser(150), (10, 40), aim=0, exclude=scene.find("west"))], prefilter="box")[
        "shots"
    ]
    assert scene.find("west") not in shot["tested"]["objects"]


def test_a_ray_that_ends_early_looks_no_farther() -> None:
    """In a crowd a pistol is followed stretch by stretch: most of the row behind its target is never asked for."""
    scene = Scene((3000, 40))
    for x in range(30, 2990, 12):
        scene.add(Sprite.circle(4), (x, 20))
    short, long = (
        ray_report(scene, weapon, (5, 20), prefilter="box", broadphase="bvh")["shots"][0]["tested"]
        for weapon in (Pistol(2900), Laser(2900))
    )
    assert len(short["objects"]) < 100 and len(long["objects"]) > 200
    assert short["opened"] < long["opened"] / 2


def test_pellets_and_flights_have_volumes_of_their_own() -> None:
    scene = yard()
    for weapon, count in (
        (Sweep(Laser(90), 40, 9), 9),
        (Spread(Rifle(90), 100, 30), PATTERNS_MAX),
        (Projectile(90, 3), 1),
    ):
        told = ray_report(scene, weapon, (20, 60), prefilter="circle")
        assert len(told["shots"][0]["tested"]["patterns"]) == count


def test_a_batch_of_rays_tells_the_cells_of_all() -> None:
    scene = yard()
    many = [(10, 20 + i) for i in range(SHOTS_MAX + 1)]
    told = ray_report(scene, Laser(60), many, prefilter="circle", broadphase="grid")
    assert not told["shots"] and {cell["opened"] for cell in told["filter"]["cells"]} == {True, False}
    picture_of_report(told, scene)
