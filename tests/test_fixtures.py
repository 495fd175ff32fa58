"""Each bundled scene is what its script draws, and what its name says."""

from __future__ import annotations

import json
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hitplanes import Hits, Role, Scene, fire, load_scene, weapons_of
from hitplanes.planes.bits.span_walk import Verdict
from hitplanes.planes.files.png import read_png
from hitplanes.planes.volumes.overlap import contains_point
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.kinds.areas import KINDS, ray_parts_of
from hitplanes.weapons.rays.contacts import Reason
from hitplanes.weapons.rays.ray_hits import RayHits
from hitplanes.weapons.replay.shot_log import fire_request, requests_of

ROOT = Path(__file__).parents[1]
FIXTURES = ROOT / "fixtures"
GALLERY = FIXTURES / "gallery"
SCENES = sorted(path.parent.name for path in FIXTURES.glob("*/scene.json"))


def files_of(folder: Path) -> set[str]:
    """Names of what a script draws: all but scripts."""
    return {path.name for path in folder.iterdir() if path.suffix != ".py" and path.name != "__pycache__"}


def fired_at(scene: Scene) -> list[Hits]:
    """What the shots of a scene's file hit, shot by shot."""
    return [fire_request(scene, request) for request in requests_of(scene, weapons_of(scene))]


def names_hit(hits: Hits, scene: Scene) -> list[str]:
    """Names of the objects hit, each once, in the order of the rows."""
    return list(dict.fromkeys(scene.name_of(row.object) for row in hits))


def mask_points(scene: Scene, item: int) -> np.ndarray[Any, Any]:
    """Pixels (n, 2) of an object's mask, x and y."""
    mask, corner = scene.mask(item)
    return np.argwhere(mask)[:, ::-1] + np.array(corner, np.int64)


def numbers_at(data: object, key: str) -> Iterator[float]:
    """Numbers of all lists that JSON has under a key."""
    if isinstance(data, dict):
        for name, value in data.items():
            yield from value if name == key else numbers_at(value, key)
    elif isinstance(data, list):
        for value in data:
            yield from numbers_at(value, key)


# --- every scene ----------------------------------------------------------------------------------------------------


def test_every_scene_has_a_script() -> None:
    assert {"arena", "corridor", "crowd", "edges", "empty", "far", "gallery", "targets"} <= set(SCENES)
    assert [path.parent.name for path in sorted(FIXTURES.glob("*/draw.py"))] == SCENES


@pytest.mark.parametrize("name", SCENES)
def test_scene_is_small_and_lies_on_the_grid(name: str) -> None:
    assert sum((FIXTURES / name / file).stat().st_size for file in files_of(FIXTURES / name)) < 150_000
    data = json.loads((FIXTURES / name / "scene.json").read_text(encoding="utf-8"))
    assert 3 <= len(data["shots"]) <= 8
    assert set(data["weapons"]) >= {shot["weapon"] for shot in data["shots"]}
    places = [*numbers_at(data, "position_xy"), *numbers_at(data, "at"), *numbers_at(data, "toward")]
    assert places and all(float(256 * value).is_integer() for value in places)


@pytest.mark.parametrize("name", SCENES)
def test_saved_and_loaded_it_is_the_same(name: str, tmp_path: Path) -> None:
    scene = load_scene(FIXTURES / name)
    scene.save(tmp_path)
    again = load_scene(tmp_path)
    assert again.content_hash() == scene.content_hash()
    assert (again.name, again.weapons, again.shots) == (scene.name, scene.weapons, scene.shots)
    assert fired_at(again) == fired_at(scene)


@pytest.mark.parametrize("name", SCENES)
def test_script_draws_what_is_in_the_folder(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = FIXTURES / name
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(folder / "draw.py"), str(tmp_path)])
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    monkeypatch.delitem(sys.modules, "drawing", raising=False)  # each script finds it by itself
    runpy.run_path(sys.argv[0], run_name="__main__")
    assert files_of(tmp_path) == files_of(folder)
    assert (tmp_path / "scene.json").read_bytes() == (folder / "scene.json").read_bytes()
    for file in sorted(file for file in files_of(folder) if file.endswith(".png")):
        assert np.array_equal(read_png(tmp_path / file), read_png(folder / file)), file


OUTCOMES: dict[str, list[tuple[str, str, list[str], list[str]]]] = {
    "corridor": [
        ("rifle", "empty hit outside beyond", ["guard 1", "partition", "runner", "armoured guard"], []),
        ("pistol", "empty hit beyond", ["guard 2"], []),
        ("shotgun", "empty hit beyond", ["guard 3", "guard 4"], []),
        ("laser sweep", "empty hit occluded beyond", ["guard 5", "guard 6"], ["brick wall"]),
        ("arrow", "empty beyond", ["drone"], []),
        ("arrow once a frame", "empty", [], []),
        ("sight", "empty occluded beyond", [], ["crate 1"]),
        ("laser", "empty hit occluded filtered outside beyond", ["guard 7"], ["brick wall"]),
    ],
    "targets": [
        ("needler", "hit", ["bull", "inner ring", "outer ring", "board"], []),
        ("point", "filtered", [], []),
        ("shotgun", "empty hit", ["gear"], []),
        ("point", "hit", ["coin"], []),
        ("beam", "empty hit", ["invader", "arrow"], []),
        ("blast", "empty hit filtered", ["star", "invader", "arrow"], []),
        ("burst", "empty hit", ["fish", "comb"], []),
    ],
    "empty": [
        ("point", "empty", [], []),
        ("blast", "empty", [], []),
        ("star", "empty", [], []),
        ("beam", "empty outside", [], []),
        ("shotgun", "empty outside", [], []),
        ("burst", "empty outside", [], []),
        ("point", "outside", [], []),
    ],
    "crowd": [
        ("point", "hit", ["thing of visitor 144"], []),
        ("point", "hit", ["visitor 71"], []),
        ("lance", "hit", ["steward 240", *(f"visitor {n}" for n in (212, 211, 184, 183, 155))], []),
        ("paint", "empty hit occluded", [f"visitor {n}" for n in (234, 206, 235, 236)], ["barrier 2"]),
        ("flash", "hit", ["visitor 195", "thing of visitor 194",
                          *(f"visitor {n}" for n in (166, 167, 194, 222, 223, 196, 165, 138))], []),
        ("hose", "hit occluded filtered", ["steward 136"], ["right pole", "rail"]),
        ("confetti", "empty hit occluded", [f"visitor {n}" for n in (244, 245, 246, 217)], ["barrier 4"]),
    ],
    "edges": [
        ("blast", "empty hit occluded outside", ["octopus"], ["rock 1"]),
        ("harpoon", "empty hit occluded outside", ["right fish"], ["right kelp"]),
        ("eel", "empty hit occluded outside", ["left fish", "right fish"], ["right kelp", "left kelp"]),
        ("net", "hit occluded filtered outside", ["pearl"], ["coral"]),
        ("shot", "hit occluded outside", ["chest"], ["right kelp", "rock 4"]),
        ("burst", "empty hit outside", ["turtle"], []),
        ("sonar", "outside", [], []),
    ],
    "far": [
        ("point", "hit", ["probe"], []),
        ("point", "empty", [], []),
        ("beam", "empty hit", ["rocket", "planet"], []),
        ("plasma", "empty hit", ["satellite"], []),
        ("nova", "empty hit occluded", ["rocket"], ["asteroid", "station"]),
        ("scan", "empty occluded filtered", [], ["station"]),
        ("burst", "empty hit", ["saucer"], []),
    ],
}  # fmt: skip
"""For each shot its weapon, the verdicts that occur, the objects hit, and the occluders that stopped a part of it."""


@pytest.mark.parametrize("name", OUTCOMES)
def test_shots_end_as_they_promise(name: str) -> None:
    scene = load_scene(FIXTURES / name)
    found = []
    for shot, hits in zip(scene.shots, fired_at(scene), strict=True):
        verdicts = " ".join(verdict for verdict, count in hits.verdict_counts().items() if count)
        blockers = [scene.name_of(blocked.occluder) for blocked in hits.blockers()]
        found.append((shot["weapon"], verdicts, names_hit(hits, scene), blockers))
    assert found == OUTCOMES[name]


@pytest.mark.parametrize(
    ("name", "shot", "reason", "refused"),
    [
        ("targets", 1, "excluded", {"board", "outer ring", "inner ring", "bull"}),
        ("targets", 5, "category", {"owl"}),
        ("crowd", 1, "excluded", {"visitor 127", "thing of visitor 127"}),
        ("edges", 3, "category", {"clam", "starfish"}),
        ("far", 5, "category", {"astronaut"}),
    ],
)
def test_filters_refuse_whom_they_should(name: str, shot: int, reason: str, refused: set[str]) -> None:
    scene = load_scene(FIXTURES / name)
    told = fired_at(scene)[shot].why_not()
    assert {scene.name_of(entry.object) for entry in told if entry.reason == reason} == refused


# --- one by one -----------------------------------------------------------------------------------------------------


def test_gallery_has_what_a_first_scene_should_show() -> None:
    scene = load_scene(GALLERY)
    assert all(len(scene.ids(role)) for role in Role)
    found = weapons_of(scene), weapons_of(load_scene(FIXTURES / "corridor"))
    assert {weapon.kind for weapons in found for weapon in weapons.values()} == set(KINDS), "patterns, and rays"
    assert 1 in scene.mask(scene.find("robot"))[0].sum(axis=1), "a mast of one pixel"
    hoop, _ = scene.mask(scene.find("hoop"))
    assert not hoop[hoop.shape[0] // 2, hoop.shape[1] // 2], "a ring with a hole"
    back, duck, front = (int(scene.layer(scene.find(name))) for name in ("back waves", "duck 1", "front waves"))
    assert back < duck < front


def test_gallery_shots_show_every_outcome() -> None:
    scene = load_scene(GALLERY)
    found = fired_at(scene)
    counts = sum(hits.verdicts for hits in found).sum(axis=0)
    assert (counts[:4] > 0).all()
    names = [[scene.name_of(row.object) for row in hits] for hits in found]
    assert names[1] == ["coin", "hoop"], "pellets through the ring's hole"
    assert names[3] == ["duck 1", "duck 2", "duck 3"], "a beam that pierces"
    assert found[6].why_not(0)[0].reason == "category"


def test_corridor_has_every_weapon_of_rays_and_what_they_are_for() -> None:
    scene = load_scene(FIXTURES / "corridor")
    weapons = weapons_of(scene)
    assert all(len(scene.ids(role)) for role in Role)
    assert {"pistol", "rifle", "laser", "projectile", "sweep", "spread", "rounds"} == {w.kind for w in weapons.values()}
    assert all(ray_parts_of(weapon) is not None for weapon in weapons.values())
    assert [scene.cost(scene.find(name)) for name in ("guard 1", "partition", "armoured guard")] == [1, 4, 3]
    assert scene.mask(scene.find("drone"))[0].sum(axis=1).max() == 2, "thinner than an arrow flies in a frame"
    assert scene.velocity([scene.find("drone"), scene.find("runner")]).any(axis=1).all()


def test_corridor_shots_end_for_every_reason() -> None:
    scene = load_scene(FIXTURES / "corridor")
    found = [hits for hits in fired_at(scene) if isinstance(hits, RayHits)]
    assert len(found) == len(scene.shots)
    reasons = [{Reason(value) for value in hits.stop.reason.tolist()} for hits in found]
    assert reasons == [
        {Reason.BUDGET}, {Reason.HITS}, {Reason.HITS}, {Reason.OCCLUDER, Reason.RANGE},
        {Reason.HITS}, {Reason.RANGE}, {Reason.OCCLUDER}, {Reason.OCCLUDER},
    ]  # fmt: skip
    (request,) = (o for o in requests_of(scene, weapons_of(scene)) if o.name == "laser")
    assert not request.blocked_by & scene.category_bits("glass")
    through = fire(scene, request.weapon, request.at)
    assert scene.name_of(int(through.stop.item[0])) == "glass", "by itself a laser ends at the pane"
    again = fire(scene, weapons_of(scene)["arrow"], scene.shots[5]["at"])
    assert names_hit(again, scene) == ["drone"], "what the arrow that is tested once a frame flies through"


def test_targets_are_all_there_is() -> None:
    scene = load_scene(FIXTURES / "targets")
    assert scene.bounds is not None
    assert len(scene) == len(scene.ids(Role.HITTABLE)) > 10
    first, last = np.array(scene.bounds[:2]), np.array(scene.bounds[2:])
    for item in scene.ids().tolist():
        points = mask_points(scene, item)
        assert (points >= first).all() and (points <= last).all(), scene.name_of(item)
    text = (FIXTURES / "targets" / "scene.json").read_text(encoding="utf-8")
    assert all(f'"{source}"' in text for source in ("image", "polygon", "holes", "circle", "box_wh", "mask"))


def test_empty_has_bounds_and_no_object() -> None:
    scene = load_scene(FIXTURES / "empty")
    assert len(scene) == 0 and scene.bounds is not None
    assert {"point", "disc", "polygon", "beam", "spread", "rounds"} == {w.kind for w in weapons_of(scene).values()}


def test_crowd_is_three_hundred_who_overlap() -> None:
    scene = load_scene(FIXTURES / "crowd")
    ids = scene.ids(Role.HITTABLE).tolist()
    assert len(ids) == 300 and len(scene.ids(Role.OCCLUDER)) > 0
    points = [mask_points(scene, item) for item in ids]
    keys = [p[:, 1] * 10_000 + p[:, 0] for p in points]
    pixels, count = np.unique(np.concatenate(keys), return_counts=True)
    shared = set(pixels[count > 1].tolist())
    assert sum(not shared.isdisjoint(key.tolist()) for key in keys) > 270
    assert count.max() >= 6, "deep, not only wide"


def test_crowd_differs_in_every_part_of_a_pose() -> None:
    scene = load_scene(FIXTURES / "crowd")
    data = json.loads((FIXTURES / "crowd" / "scene.json").read_text(encoding="utf-8"))["objects"]["hittable"]
    assert {entry["flip"] for entry in data if "flip" in entry} == {"none", "x"}
    for key, least in (("frame", 30), ("scale", 20), ("angle", 20), ("layer", 9)):
        assert len({str(entry[key]) for entry in data}) >= least, key
    owner = dict(zip(scene, scene.owner(scene.ids()).tolist(), strict=True))
    held = [item for item in scene.ids(Role.HITTABLE).tolist() if owner[item] != item]
    assert len(held) == 48
    assert all(scene.name_of(item) == f"thing of {scene.name_of(owner[item])}" for item in held)


@pytest.mark.parametrize("role", [Role.HITTABLE, Role.OCCLUDER, Role.MOVER, Role.HUD])
def test_something_hangs_over_each_edge_and_corner(role: Role) -> None:
    scene = load_scene(FIXTURES / "edges")
    assert scene.bounds is not None
    first, last = np.array(scene.bounds[:2]), np.array(scene.bounds[2:])
    if role is Role.HUD:
        first, last = first - first, last - first
    crossed = set()
    for item in scene.ids(role).tolist():
        points = mask_points(scene, item)
        low, high = (points < first).any(axis=0), (points > last).any(axis=0)
        if ((points >= first) & (points <= last)).all(axis=1).any():
            crossed.add("".join(edge for edge, over in zip("LTRB", (*low, *high), strict=True) if over))
    assert crossed >= {"L", "T", "R", "B", "LT", "TR", "LB", "RB"}


def test_edges_have_a_negative_origin_and_shots_over_them() -> None:
    scene = load_scene(FIXTURES / "edges")
    assert scene.bounds is not None and max(scene.bounds[:2]) < 0 < min(scene.bounds[2:])
    found = fired_at(scene)
    outside = np.array([hits.verdicts[0, Verdict.OUTSIDE] for hits in found])
    fired = np.array([hits.fired[0] for hits in found])
    assert ((outside > 0) & (outside < fired)).sum() == 6 and (outside == fired).sum() == 1


def test_far_scene_has_no_bounds_and_lies_between_pixels() -> None:
    scene = load_scene(FIXTURES / "far")
    assert scene.bounds is None
    for item in scene.ids().tolist():
        assert np.abs(mask_points(scene, item)).min() > 9e8, scene.name_of(item)
    parts = np.rint(256 * scene.position(scene.ids())).astype(np.int64) % 256
    assert len(np.unique(parts)) >= 8 and {127, 128, 255} <= set(parts.ravel().tolist())
    assert sum(hits.verdict_counts()["outside"] for hits in fired_at(scene)) == 0


def test_far_scene_tells_positions_of_one_step_apart() -> None:
    scene = load_scene(FIXTURES / "far")
    (x, y), (x_next, y_next) = scene.shots[0]["at"], scene.shots[1]["at"]
    assert x_next - x == 1 / 256 and y == y_next
    assert [bool(hits) for hits in fired_at(scene)[:2]] == [True, False]


# --- the pictures of reports in the README -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gallery", "corridor"])
def test_the_pictures_of_reports_are_what_the_command_draws(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Text is part of it, as it tells the stages that ran; where OpenCV draws all of it otherwise, that is not told."""
    monkeypatch.chdir(tmp_path)
    main(["report", str(FIXTURES / name)])
    drawn, kept = read_png(tmp_path / "report.png"), read_png(FIXTURES / f"{name}.png")
    assert drawn.shape == kept.shape
    other = (drawn != kept).any(axis=2).mean()
    if other > 0.04:
        pytest.skip("OpenCV of this version draws text otherwise")
    assert other == 0


# --- the picture of volumes -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def volumes_page() -> dict[str, Any]:
    """Names of the script that draws the volumes of one sprite."""
    return runpy.run_path(str(FIXTURES / "volumes.py"))


def test_volumes_are_drawn_as_in_the_folder(volumes_page: dict[str, Any]) -> None:
    """All but the lines that have text, which OpenCV draws as its version does."""
    sheet, texts = volumes_page["page"]()
    drawn = read_png(FIXTURES / "volumes.png")[:, :, :3]
    assert drawn.shape == sheet.shape and (FIXTURES / "volumes.png").stat().st_size < 150_000
    told = np.zeros(len(sheet), np.bool_)
    for text in texts:
        told[text.y - 14 : text.y + 7] = True
        assert (drawn[text.y - 9 : text.y + 1] != sheet[text.y - 9 : text.y + 1]).any(), text.text
    assert np.array_equal(drawn[~told], sheet[~told]) and told.mean() < 0.25


def test_panels_go_from_loose_to_tight(volumes_page: dict[str, Any]) -> None:
    upright = [p for p in volumes_page["panels"]() if p.volume is not None and p.anew is None]
    areas = [volumes_page["false_area"](p.volume, int(p.picture.mask.sum())) for p in upright]
    assert areas == sorted(areas, reverse=True) and len(areas) == len(volumes_page["FITS"]) == 11


def test_false_area_is_what_lies_in_a_volume_and_in_no_pixel(volumes_page: dict[str, Any]) -> None:
    """Sampled at the middles of quarters of pixels; those of the sprite's pixels all lie in the volume."""
    y, x = np.mgrid[-80:160, -80:200] / 2 - 0.25
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    for panel in volumes_page["panels"]():
        mask = panel.picture.mask
        column, row = np.floor(points + 0.5).astype(np.int64).T
        within = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
        pixel = within & mask[np.where(within, row, 0), np.where(within, column, 0)]
        assert pixel.sum() == 4 * mask.sum()
        for volume in (panel.volume, panel.anew):
            if volume is not None:
                inside = contains_point(volume, points)
                assert not (pixel & ~inside).any(), panel.name
                told = volumes_page["false_area"](volume, int(mask.sum()))
                assert (inside & ~pixel).sum() / pixel.sum() == pytest.approx(told, abs=0.02), panel.name


# --- the picture of a shot at the past ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rewind() -> dict[str, Any]:
    """Names of the script that draws a shot at the past."""
    return runpy.run_path(str(FIXTURES / "rewind.py"))


def test_rewind_hits_what_was_seen_and_no_longer_is_there(rewind: dict[str, Any]) -> None:
    then, now = rewind["strips"]()
    assert then.report["now"]["tick"] == rewind["SEEN"] == rewind["TICKS"] - 1 - 9, "150 ms are 9 ticks of 60 a second"
    assert rewind["outcome"](then.report) == "hits guard 1, partition, runner; ends at brick wall"
    assert rewind["outcome"](now.report) == "hits partition; ends at brick wall"
    assert [row["name"] for row in then.report["now"]["shots"][0]] == ["partition"]
    assert {moved["name"] for moved in then.report["now"]["moved"]} == {"guard 1", "runner"}


def test_rewind_is_drawn_as_in_the_folder(rewind: dict[str, Any]) -> None:
    """All but what is near to text, which OpenCV draws as its version does."""
    drawn, bare, sheet = read_png(FIXTURES / "rewind.png")[:, :, :3], rewind["page"](text=False), rewind["page"]()
    assert drawn.shape == sheet.shape and (FIXTURES / "rewind.png").stat().st_size < 400_000
    near = np.zeros(sheet.shape[:2], np.bool_)
    for y, x in np.argwhere((sheet != bare).any(axis=2)).tolist():
        near[max(y - 4, 0) : y + 5, max(x - 12, 0) : x + 13] = True
    assert np.array_equal(drawn[~near], bare[~near]) and 0 < near.mean() < 0.05
    assert (drawn[near] != bare[near]).any()


# --- the arena ------------------------------------------------------------------------------------------------------


PLAYED = {
    "frames": 600, "tanks left": {"red": 20, "blue": 18}, "destroyed by": {"blast": 17, "shell": 2, "shotgun": 3},
    "pixels of crates shot away": 4864,
}  # fmt: skip
"""What happened when the arena was looked at."""


def test_the_arena_is_played_without_a_window(tmp_path: Path) -> None:
    """600 frames go as they went, and the reports of the deadliest shots tell what these hit."""
    game = runpy.run_path(str(FIXTURES / "arena" / "play.py"))
    told = game["play"](tmp_path)
    assert told == PLAYED
    reports = sorted(tmp_path.glob("*.json"))
    assert len(reports) == 3
    for path in reports:
        (shot,) = json.loads(path.read_text(encoding="utf-8"))["shots"]
        assert any(row["name"].startswith(("red", "blue")) for row in shot["rows"]), path.name
        assert read_png(path.with_suffix(".png")).shape[2] == 4


def test_walls_of_the_arena_shelter() -> None:
    scene = load_scene(FIXTURES / "arena")
    blast, flame, *_ = fired_at(scene)
    assert names_hit(blast, scene)[:2] == ["crate 1", "crate 0"] and blast.samples_at(0).sheltered.any()
    assert names_hit(flame, scene) == ["crate 6"], "it shelters the crates behind it"
