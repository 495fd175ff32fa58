"""Facts of a report: one by one and as a batch; and what is written over the world covers nothing that it names."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hitplanes import Beam, Disc, History, InputError, Laser, Point, Scene, Spread, Sprite, fire, load_scene, weapons_of
from hitplanes import Box as WeaponBox
from hitplanes.weapons.report.canvas import RING, World, heat_step, plain
from hitplanes.weapons.report.cards import CELL, COLUMNS, ROWS, inset_of, shot_card
from hitplanes.weapons.report.differences import differences
from hitplanes.weapons.report.overlay import LETTER, ROW, SHOT_BADGE, Overlay
from hitplanes.weapons.report.phrases import fragile, short, unseen
from hitplanes.weapons.report.picture import picture_of_report
from hitplanes.weapons.report.report import SHOTS_MAX, heat_of, report_of
from hitplanes.weapons.report.symbols import HEAT, MARKS

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"


def street() -> Scene:
    """A wall before half of a target, and another target beside it."""
    scene = Scene((60, 40), name="street")
    scene.add(Sprite.circle(8), (20, 20), name="near")
    scene.add(Sprite.box(9, 20), (24, 20), role="occluder", layer=1, name="wall")
    scene.add(Sprite.circle(3), (50, 20), name="far")
    return scene


def pixels(runs: list[list[int]]) -> set[tuple[int, int]]:
    return {(x, y) for y, first, last in runs for x in range(first, last + 1)}


def test_rows_tell_their_pixels_and_blockers_what_they_hid() -> None:
    scene = street()
    hits = fire(scene, Disc(10), (20, 20))
    (shot,) = report_of(scene, [hits])["shots"]
    (row,) = shot["rows"]
    assert row["name"] == "near" and len(pixels(row["runs"])) == row["pixels"]
    assert pixels(row["runs"]) == pixels(shot["samples"]["hit"])
    (blocker,) = shot["blockers"]
    assert blocker["name"] == "wall" and blocker["samples"] == shot["verdicts"]["occluded"]
    (blocked,) = blocker["blocked"]
    near, at = scene.mask(scene.find("near"))
    wall, corner = scene.mask(scene.find("wall"))
    both = {(x + at[0], y + at[1]) for y, x in np.argwhere(near)}
    both &= {(x + corner[0], y + corner[1]) for y, x in np.argwhere(wall)}
    assert blocked["name"] == "near" and blocked["samples"] == len(both) and tuple(blocked["at_xy"]) in both


def test_aim_and_filter_are_told_as_they_were_given() -> None:
    scene = load_scene(GALLERY)
    hits = fire(scene, Beam(50, 1), [(9, 9), (99, 9)], aim=[-24.5, 540], accept=["bonus"], exclude=scene.find("clown"))
    first, second = report_of(scene, [hits], ["ray"])["shots"]
    assert (first["aim"], second["aim"], first["weapon"]) == (-24.5, 180, "ray")
    assert first["accept"] == ["bonus"] and first["exclude"] == [{"owner": scene.find("clown"), "name": "clown"}]
    (plain,) = report_of(scene, [fire(scene, Point(), (9, 9))])["shots"]
    assert (plain["aim"], plain["accept"], plain["exclude"]) == (None, None, [])


@pytest.mark.parametrize(
    ("at", "told"),
    [((5, -7.5), "5, -7.5"), ((10 / 3, 1e6 + 0.99609375), "3.33, 1000001"), ((-1 / 256, 0.25), "0, 0.25")],
)
def test_places_are_told_to_a_hundredth_of_a_px(at: tuple[float, float], told: str) -> None:
    scene = street()
    (shot,) = report_of(scene, [fire(scene, Point(), at)])["shots"]
    assert shot_card(shot, 0, scene).fired == f"at {told}"


def test_up_to_so_many_shots_are_told_one_by_one() -> None:
    scene = street()
    few, many = ([(i, 20) for i in range(n)] for n in (SHOTS_MAX, SHOTS_MAX + 1))
    assert len(report_of(scene, [fire(scene, Point(), few)])["shots"]) == SHOTS_MAX
    report = report_of(scene, [fire(scene, Point(), many)])
    assert report["shots"] == [] and report["batch"]["shots"] == SHOTS_MAX + 1


def test_a_batch_tells_every_row_and_each_object() -> None:
    scene = load_scene(GALLERY)
    rng = np.random.default_rng(5)
    weapons = weapons_of(scene)
    fired = [fire(scene, weapons[n], rng.uniform(0, 300, (40, 2)), seed=3) for n in ("shotgun", "burst")]
    report = report_of(scene, fired, ["shotgun", "burst"])
    assert json.loads(json.dumps(report)) == report
    batch = report["batch"]
    rows = [dict(zip(batch["columns"], row, strict=True)) for row in batch["rows"]]
    wanted = [(row, 0) for row in fired[0]] + [(row, 40) for row in fired[1]]
    assert [(r["shot"], r["round"], r["object"], r["pixels"], r["x"], r["y"], r["distance2"]) for r in rows] == [
        (row.shot + begin, row.round, row.object, row.pixels, *row.first_xy, row.distance2) for row, begin in wanted
    ]
    shots = Counter(item for _, item in {(row["shot"], row["object"]) for row in rows})
    assert {told["object"]: told["shots"] for told in batch["objects"]} == shots
    assert sum(told["pixels"] for told in batch["objects"]) == sum(hits.pixels.sum() for hits in fired)
    assert batch["shots_that_hit"] == len({row["shot"] for row in rows})
    assert sum(batch["verdicts"].values()) == sum(hits.fired.sum() for hits in fired)


@pytest.mark.parametrize("view", [(0, 0, 59, 39), (-9, 5, 40, 60), (25, 18, 25, 18)])
def test_heat_counts_every_sample(view: tuple[int, int, int, int]) -> None:
    scene = street()
    rng = np.random.default_rng(2)
    fired = [fire(scene, Spread(Disc(2), 4, 6), rng.uniform(-5, 60, (30, 2))), fire(scene, Disc(9), [(20, 20)] * 3)]
    counts: Counter[tuple[str, int, int]] = Counter()
    beyond = 0
    for hits in fired:
        for shot in range(len(hits.shots)):
            samples = hits.samples_at(shot)
            for (x, y), verdict in zip(samples.xy.tolist(), samples.verdict.tolist(), strict=True):
                if view[0] <= x <= view[2] and view[1] <= y <= view[3]:
                    counts[("empty", "hit", "occluded", "filtered", "outside")[verdict], x, y] += 1
                else:
                    beyond += 1
    heat = heat_of(fired, view)
    assert heat["cell"] == 1 and heat["beyond"] == beyond
    found = {
        (verdict, x + view[0], row + view[1]): count
        for verdict, runs in heat["counts"].items()
        for row, first, last, count in runs
        for x in range(first, last + 1)
    }
    assert found == dict(counts)


def test_runs_of_heat_end_with_their_row() -> None:
    scene = Scene((7, 5))
    heat = heat_of([fire(scene, Disc(20), (3, 2))], (0, 0, 6, 4))
    assert heat["counts"] == {"empty": [[row, 0, 6, 1] for row in range(5)]}


def test_large_views_share_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.weapons.report.report.CELLS_MAX", 100)
    scene = street()
    fired = [fire(scene, Disc(9), [(20, 20), (22, 20)])]
    heat = heat_of(fired, (0, 0, 58, 38))
    assert heat["cell"] == 8
    total = sum((last - first + 1) * n for runs in heat["counts"].values() for _, first, last, n in runs)
    assert total + heat["beyond"] == fired[0].fired.sum()
    assert all(last < 8 and row < 5 for runs in heat["counts"].values() for row, _, last, _ in runs)


def test_heat_rises_in_lightness_and_spans_the_scale() -> None:
    lightness = [54 * r + 183 * g + 19 * b for r, g, b in HEAT]
    assert lightness == sorted(set(lightness))
    assert (heat_step(1, 1000), heat_step(1000, 1000), heat_step(1, 1)) == (0, len(HEAT) - 1, len(HEAT) - 1)


def test_hits_that_lie_alone_have_a_ring() -> None:
    """One pixel at (10, 10), and five beside each other at (20..24, 30), 4 px of the picture each."""
    world = World(None, None, (0, 0, 39, 39), 4)
    runs = [[10, 10, 10, 1], [30, 20, 24, 1]]
    batch = {"verdicts": {"hit": 6}, "heat": {"cell": 1, "origin_xy": [0, 0], "counts": {"hit": runs}}}
    world.mark_heat(batch, "hit")
    ringed = np.argwhere((world.image == MARKS["hit"][0]).all(axis=2))
    assert len(ringed) > 20 and (abs(np.hypot(*(ringed - 42).T) - RING) < 1).all()


@pytest.mark.parametrize("of_rays", [True, False])
def test_the_ways_of_rays_are_lines(of_rays: bool) -> None:
    world = World(None, None, (0, 0, 9, 9), 6)
    plain, counts = world.image.copy(), {"empty": [[4, 0, 9, 1]]}
    heat = {"cell": 1, "origin_xy": [0, 0], "counts": counts}
    world.mark_heat({"verdicts": {"empty": 10} | ({"beyond": 0} if of_rays else {}), "heat": heat}, "empty")
    marked = (world.image != plain).any(axis=2)
    assert not marked[:24].any() and not marked[30:].any() and marked[24:30].all() == of_rays
    assert [heat_step(n, 1000) for n in range(1, 1001)] == sorted(heat_step(n, 1000) for n in range(1, 1001))


def test_hits_of_another_scene_or_version_are_refused() -> None:
    scene, other = street(), street()
    hits = fire(scene, Point(), (1, 1))
    with pytest.raises(InputError, match=r"fired\[0\]: expected hits of the scene 'street', got those of another$"):
        report_of(other, [hits])
    history = History(scene, ticks=2)
    for tick in (0, 1):
        history.record(tick)
    past = fire(history, Point(), (1, 1), tick=0)
    for moment, of in ((scene, past), (history.at(1), past), (history.at(0), hits)):
        with pytest.raises(InputError, match=r"those of another moment of it: .*, history\.at\(tick\)$"):
            report_of(moment, [of])
    with pytest.raises(InputError, match=r"fired\[1\]: expected Hits, got int"):
        report_of(scene, [hits, 5])  # type: ignore[list-item]
    with pytest.raises(InputError, match="names: expected 1, one for each hits, got 0"):
        report_of(scene, [hits], [])
    with pytest.raises(InputError, match="names: expected one weapon for each name, got two for 'gun'"):
        report_of(scene, [hits, fire(scene, Disc(2), (1, 1))], ["gun", "gun"])
    scene.move(0, (1, 1))
    with pytest.raises(InputError, match="expected 'street' at version 4, got version 3: read this before"):
        report_of(scene, [hits])


def test_weapons_without_names_are_called_by_their_kind() -> None:
    scene = street()
    fired = [fire(scene, weapon, (1, 1)) for weapon in (Disc(1), Disc(2), Disc(1), Point())]
    report = report_of(scene, fired)
    assert [shot["weapon"] for shot in report["shots"]] == ["disc", "disc 2", "disc", "point"]
    assert report["weapons"]["disc 2"] == {"kind": "disc", "radius": 2.0}


# Over the world


def overlaid(scene: Scene, report: dict[str, Any], factor: int) -> Overlay:
    x, y, *_ = view = tuple(report["view_xyxy"])
    overlay = Overlay(World(scene, scene.bounds, view, factor))
    overlay.keep_free(report["shots"], scene)
    before = np.zeros(overlay.image.shape[:2], np.bool_)  # pixels that no label may cover
    named = {e["object"] for shot in report["shots"] for e in (*shot["rows"], *shot["blockers"])}
    free = {p for shot in report["shots"] for runs in shot["samples"].values() for p in pixels(runs)}
    for item in named:
        mask, corner = scene.mask(item)
        free |= {(int(c) + corner[0], int(r) + corner[1]) for r, c in np.argwhere(mask)}
    for column, row in free:
        if column >= x and row >= y:
            before[(row - y) * factor :, (column - x) * factor :][:factor, :factor] = True
    for number, shot in enumerate(report["shots"]):
        overlay.shot(shot, number)
    overlay.names(report["shots"], scene)
    overlay.links(report["shots"], {row["object"] for shot in report["shots"] for row in shot["rows"]})
    for text in overlay.texts:  # what a label takes: its words at their widest
        wide = SHOT_BADGE if text.bold else (LETTER * len(text.text) + 8) // 2
        tall = SHOT_BADGE if text.bold else ROW // 2
        middle = text.x + 4 * len(text.text) if text.bold else text.x
        left, top = middle - wide, text.y - 5 - tall + text.bold
        assert not before[top + 1 : top + 2 * tall, left + 1 : left + 2 * wide - 1].any(), text.text
        before[top + 1 : top + 2 * tall, left + 1 : left + 2 * wide - 1] = True
    return overlay


@pytest.mark.parametrize("factor", [4, 9, 20])
def test_labels_cover_no_sample_no_target_and_no_label(factor: int) -> None:
    scene = street()
    report = report_of(scene, [fire(scene, Disc(10), (20, 20)), fire(scene, Beam(50, 3), (2, 30), aim=-12)])
    overlay = overlaid(scene, report, factor)
    assert {text.text for text in overlay.texts} == {"0", "1", "near", "far", "wall blocks near"} - (
        {"far"} if all(row["name"] != "far" for shot in report["shots"] for row in shot["rows"]) else set()
    )


def test_labels_of_the_gallery_cover_nothing() -> None:
    scene = load_scene(GALLERY)
    weapons = weapons_of(scene)
    fired = [fire(scene, weapons[n], (390, 110)) for n in ("blast", "shotgun")]
    fired.append(fire(scene, weapons["flame"], (356, 232), aim=-24))
    texts = [text.text for text in overlaid(scene, report_of(scene, fired), 3).texts]
    assert {"bandit", "can 1", "house blocks teddy", "0", "1", "2"} <= set(texts)


def test_a_shot_out_of_view_is_pointed_at() -> None:
    scene = street()
    report = report_of(scene, [fire(scene, Point(), (10**6, 20)), fire(scene, Point(), (5, -(10**9)))])
    right, up = overlaid(scene, report, 8).texts
    width, height = (report["view_xyxy"][i + 2] - report["view_xyxy"][i] + 1 for i in (0, 1))
    assert right.x > width * 8 - 60 and up.y < 60 and height


def test_long_names_are_cut_in_their_middle() -> None:
    """They often differ at their ends."""
    assert [short("a crate of the north wall 7", most) for most in (27, 24, 9, 8)] == [
        "a crate of the north wall 7", "a crate of ...rth wall 7", "a c...l 7", "a c... 7"
    ]  # fmt: skip
    scene = Scene((60, 40))
    for number in (1, 2):
        scene.add(Sprite.circle(8), (20 * number, 20), name=f"{'a crate ' * 9}{number}")
    scene.add(Sprite.box(9, 30), (50, 20), role="occluder", name=f"{'WALL ' * 9}3")
    shot = report_of(scene, [fire(scene, Disc(30), (30, 20))])["shots"][0]
    card = shot_card(shot, 0, scene)
    names = [text.text for text in card.draw(np.zeros((card.height, 464, 3), np.uint8), 0, 0, 464)]
    assert {name.count("...") for name in names} == {0, 1}  # once also beside what it blocks
    assert sum(name.startswith("a crate") and name.endswith(" 1") for name in names) == 1


def test_shots_that_do_not_fit_the_picture_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """With what it shows; to report a shot alone helps only if the picture is a part of the scene."""
    wide = Scene((3000, 1000))
    wide.add(Sprite.circle(30), (400, 300))
    wide.add(Sprite.circle(30), (2800, 300))
    report = report_of(wide, [fire(wide, Disc(40), at) for at in ((400, 300), (2790, 300), (2190, 600))])
    told = "2 of 3 shots do not fit this picture (x 144..2192, y 0..999): report each alone"
    texts: list[Any] = []
    monkeypatch.setattr("hitplanes.weapons.report.picture.draw_texts", lambda page, every: texts.extend(every))
    picture_of_report(report, wide)
    assert [text.text for text in texts if "picture" in text.text] == [f"{told}; 3 shots, 2 objects hit"]
    assert unseen(report_of(wide, [fire(wide, Disc(40), (2790, 300))]), wide.extent()) == ""
    small = street()
    report = report_of(small, [fire(small, Disc(3), at) for at in ((20, 20), (-900, 20), (-46, 20))])
    assert unseen(report, small.extent()) == "1 of 3 shots does not fit this picture (x -48..59, y 0..39)"


def test_the_inset_shows_the_pixels_around_the_first_hit() -> None:
    scene = street()
    (shot,) = report_of(scene, [fire(scene, Disc(10), (20, 20))])["shots"]
    inset = inset_of(shot, scene)
    assert inset is not None
    x, y = shot["rows"][0]["first_xy"]
    assert inset.view == (x - COLUMNS // 2, y - ROWS // 2, x + COLUMNS // 2, y + ROWS // 2)
    assert inset.image.shape == (ROWS * CELL, COLUMNS * CELL, 3)
    hit = pixels(shot["samples"]["hit"])
    for row in range(ROWS):
        for column in range(COLUMNS):
            middle = inset.image[row * CELL + CELL // 2 + 3, column * CELL + CELL // 2 + 3].astype(int)
            orange = abs(middle - MARKS["hit"][0]).max() < 40
            assert orange == ((inset.view[0] + column, inset.view[1] + row) in hit)
    assert inset_of({"rows": []}, scene) is None


def test_a_card_says_what_was_hit_what_blocked_and_why_not() -> None:
    scene = street()
    (shot,) = report_of(scene, [fire(scene, Disc(18), (8, 20))])["shots"]
    lines = shot_card(shot, 1, scene).lines
    row = shot["rows"][0]
    assert lines[1] == ("near", str(row["pixels"]), *lines[1][2:5], "4.0 px")
    assert [f"{100 * share:.1f} %" for share in row["shares"].values()] == list(lines[1][2:5])
    assert lines[2][0].startswith("wall blocks") and lines[2][1].endswith("on near")
    assert lines[3] == ("not far", "missed by 21.0 px")


def test_a_batch_has_a_heat_picture() -> None:
    scene = street()
    report = report_of(scene, [fire(scene, Disc(1), [(18, 20)] * 40 + [(13, 20)])])
    picture = picture_of_report(report, scene, text=False)
    world = picture[44 : 44 + 40 * 24, 16 : 16 + 60 * 24]
    for step, spot in ((len(HEAT) - 1, (18, 20)), (0, (12, 20))):
        x, y = (24 * v + 12 for v in spot)
        assert np.abs(world[y, x].astype(int) - HEAT[step]).max() < 30, step


def test_what_is_no_list_of_hits_is_refused() -> None:
    scene = street()
    hits = fire(scene, Point(), (1, 1))
    for fired, told in (
        (hits, "fired: expected a list of Hits, got Hits alone"),
        (5, "fired: expected a list of Hits, got 5"),
        ("hits", "fired: expected a list of Hits, got 'hits'"),
    ):
        with pytest.raises(InputError, match=told):
            report_of(scene, fired)  # type: ignore[arg-type]
    assert len(report_of(scene, (h for h in [hits]))["shots"]) == 1, "whatever can be gone through"  # type: ignore[arg-type]
    with pytest.raises(InputError, match="scene: expected a Scene, got NoneType"):
        report_of(None, [])  # type: ignore[arg-type]
    for name in ("", "x" * 201, "\ud800", 5):
        with pytest.raises(InputError, match=r"names\[0\]: expected a text of 1 to 200 characters"):
            report_of(scene, [hits], [name])  # type: ignore[list-item]
    scene.name = "\ud800"
    with pytest.raises(InputError, match=r"scene\.name: expected a text"):
        report_of(scene, [hits])


@pytest.mark.parametrize(
    ("at", "view"),
    [((5000, 150), (4736, 0, 5264, 299)), ((2 * 10**5, 50), None), ((-9000, 50), None), ((5000, -5000), None)],
)
def test_a_view_of_a_wide_world_lies_in_it_and_is_no_sliver(at: tuple[int, int], view: tuple[int, ...] | None) -> None:
    scene = Scene((10**5, 300))
    found = tuple(report_of(scene, [fire(scene, Disc(8), at)])["view_xyxy"])
    assert found == view or view is None
    x, y, x_max, y_max = found
    assert x >= -48 and x_max <= 10**5 + 48 and y_max - y >= 299 and 256 <= x_max - x <= 2048 + 96


def test_the_view_of_a_long_beam_shows_what_it_hit() -> None:
    scene = Scene((10**5, 300))
    scene.add(Sprite.circle(9), (50_000, 150), name="far away")
    x, y, x_max, y_max = report_of(scene, [fire(scene, Beam(90_000, 3), (100, 150))])["view_xyxy"]
    assert x <= 50_000 <= x_max and y <= 150 <= y_max


def test_letters_that_the_font_has_not_are_told_as_well_as_it_can() -> None:
    assert plain("énte\nñ größe 鴨 \x1b[31m") == "ente n gro?e ?  [31m"


def test_equal_plans_of_a_batch_are_told_once() -> None:
    scene = street()
    batch = report_of(scene, [fire(scene, Point(), (i, 20)) for i in range(30)])["batch"]
    assert 1 <= len(batch["plan"]) <= 4 and batch["shots"] == 30


def test_a_hit_object_that_was_blocked_is_linked_only_if_no_other_was() -> None:
    """A ring tells most where nothing else does: an object that no shot hit."""
    scene = Scene((80, 40))
    scene.add(Sprite.box(9, 30), (20, 20), name="seen in part")
    scene.add(Sprite.box(2, 2), (26, 20), name="hidden")
    scene.add(Sprite.box(12, 30), (26, 20), role="occluder", layer=1, name="wall")
    report = report_of(scene, [fire(scene, Disc(12), (22, 20))])
    assert "wall blocks hidden" in [text.text for text in overlaid(scene, report, 8).texts]


def test_a_name_lies_on_no_other_target_where_there_is_room() -> None:
    """Above and below are other targets; beside there is room."""
    scene = Scene((90, 60))
    hit = scene.add(Sprite.box(8, 8), (20, 30), name="this one")
    for y in (16, 44):
        scene.add(Sprite.box(30, 18), (20, y), name="another")
    report = report_of(scene, [fire(scene, Point(), (20, 30))])
    (name,) = (text for text in overlaid(scene, report, 8).texts if text.text == "this one")
    mask, (x, y) = scene.mask(hit)
    others = [((5 * 8, 35 * 8), (y * 8, (y + 18) * 8)) for y in (7, 35)]
    for (left, right), (top, low) in others:
        assert not (left < name.x < right and top < name.y < low), name
    assert mask.shape == (9, 9) and x < name.x // 8


def test_a_card_tells_the_weight_where_there_is_falloff() -> None:
    scene = street()
    (shot,) = report_of(scene, [fire(scene, Disc(18, falloff="linear"), (8, 20))])["shots"]
    lines = shot_card(shot, 0, scene).lines
    assert lines[0][:3] == ("object hit", "pixels", "weight") and len(lines[1]) == len(lines[0]) == 7
    assert lines[1][2] == f"{shot['rows'][0]['weight'] / 65535:.1f}" and float(lines[1][2]) < shot["rows"][0]["pixels"]


def test_numbers_of_many_shots_on_one_pixel_do_not_pile_up() -> None:
    scene = street()
    report = report_of(scene, [fire(scene, Point(), [(5, 5)] * SHOTS_MAX)])
    at = [(text.x + 4 * len(text.text), text.y) for text in overlaid(scene, report, 4).texts if text.text.isdigit()]
    assert len(at) == SHOTS_MAX
    apart = [max(abs(a[0] - b[0]), abs(a[1] - b[1])) for i, a in enumerate(at) for b in at[:i]]
    assert min(apart) >= 2 * SHOT_BADGE


def test_margins_are_told_and_fragile_ones_marked() -> None:
    """What one pixel turns over has a sign, a word and a way, of hits and of misses; what more does has none."""
    scene = Scene((60, 40), name="street")
    scene.add(Sprite.box(4, 4), (20, 20), name="hit by an edge")
    scene.add(Sprite.box(3, 3), (16, 10), name="missed by one")
    scene.add(Sprite.box(3, 3), (9, 20), name="missed by two")
    (shot,) = report_of(scene, [fire(scene, WeaponBox(7, 15), (15, 19))])["shots"]
    told = {entry["name"]: entry.get("margin") for entry in [*shot["rows"], *shot["why_not"]]}
    assert told == {
        "hit by an edge": {"distance": 1.0, "shift_xy": [-1, 0]},
        "missed by one": {"distance": 1.0, "shift_xy": [0, -1]},
        "missed by two": {"distance": 2.0, "shift_xy": [-2, 0]},
    }
    lines = shot_card(shot, 0, scene).lines
    assert ("hit by an edge", "! fragile: 1 px left misses it") in lines
    assert ("not missed by one", "missed by 1.0 px; ! fragile: 1 px up hits it") in lines
    assert ("not missed by two", "missed by 2.0 px") in lines


def test_fragile_rays_are_marked() -> None:
    """Rays tell a part of a px; what lies behind a wall is not near for them."""
    scene = Scene((90, 40), name="street")
    for x, y, name in ((10, 20, "hit"), (20, 26, "missed"), (30, 17, "touched"), (50, 20, "behind")):
        scene.add(Sprite.box(5, 5), (x, y), name=name)
    scene.add(Sprite.box(1, 9), (47, 20), role="occluder", layer=1, name="wall")
    (shot,) = report_of(scene, [fire(scene, Laser(90), (0, 19.5), aim=0)])["shots"]
    lines = [" | ".join(line) for line in shot_card(shot, 0, scene).lines]
    assert "touched | ! fragile: 0.004 px down misses it" in lines
    behind = next(entry for entry in shot["why_not"] if entry["name"] == "behind")
    assert "margin" not in behind
    assert not any("fragile" in line and ("behind" in line or line.startswith("hit")) for line in lines)
    (shot,) = report_of(scene, [fire(scene, Laser(90), (0, 22.75), aim=0)])["shots"]
    lines = [" | ".join(line) for line in shot_card(shot, 0, scene).lines]
    assert "nearest hit | missed low by 0.2 px; ! fragile: 0.25 px up hits it" in lines
    assert "not missed | missed by 0.8 px; ! fragile: 0.75 px down hits it" in lines


def test_ways_have_words() -> None:
    ways = {(1, 0): "right", (-1, 0.3): "left", (0.2, -1): "up", (0.4, 0.4): "down right", (-0.6, -0.5): "up left"}
    for shift, words in ways.items():
        told = fragile({"margin": {"distance": 0.5, "shift_xy": list(shift)}}, "hits it")
        assert told == f"! fragile: 0.5 px {words} hits it"
    assert fragile({}, "hits it") is None
    assert fragile({"margin": {"distance": 1.001, "shift_xy": [1.001, 0]}}, "hits it") is None


def test_a_margin_is_compared_when_nothing_else_has_changed() -> None:
    scene = street()
    report = report_of(scene, [fire(scene, Disc(6), (40, 20))])
    changed = json.loads(json.dumps(report))
    assert not differences(report, changed)
    (entry,) = (e for e in changed["shots"][0]["why_not"] if "margin" in e)
    entry["margin"]["distance"] += 1
    assert len(differences(report, changed)) == 1
    changed["shots"][0]["seed"] = 5
    (line,) = differences(report, changed)
    assert "seed" in line and "margin" not in line
