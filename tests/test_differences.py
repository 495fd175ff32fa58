"""What changed between two reports: nothing that decides goes untold, and it is told in the game's words."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from some_of import some_of

from hitplanes import (
    Disc,
    Laser,
    Pistol,
    Point,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Weapon,
    fire,
    load_scene,
    weapons_of,
)
from hitplanes.weapons.replay.shot_log import fire_request, requests_of
from hitplanes.weapons.report.differences import decisive, differences, same
from hitplanes.weapons.report.report import report_of

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"
REPORTS = 6
LEFT_OUT = ("version", "hash", "plan", "times")

Json = Any
Steps = tuple[str | int, ...]


def game(
    duck: tuple[int, int] = (200, 100), can: tuple[int, int] = (260, 120), *, wall: bool = True, width: int = 320
) -> Scene:
    scene = Scene((width, 200))
    scene.add(Sprite.circle(12), duck, name="duck")
    scene.add(Sprite.circle(10), (230, 120), name="bandit")
    scene.add(Sprite.circle(5), can, name="can")
    if wall:
        scene.add(Sprite.box(40, 10), (215, 105), role="occluder", layer=1, name="house")
    return scene


def told(scene: Scene, weapon: Weapon | None = None, at: object = (210, 110), **more: Any) -> dict[str, Any]:
    return report_of(scene, [fire(scene, weapon or Disc(32), at, **more)])


@cache
def reports() -> tuple[dict[str, Any], ...]:
    """Of every kind: the gallery's shots, rounds, a batch, a scene without bounds, one without shots."""
    gallery = load_scene(GALLERY)
    requests = requests_of(gallery, weapons_of(gallery))[:3]
    rays = [fire(game(), Rounds(Spread(Laser(90), count=3, radius=20), count=2), (190, 110), toward=(240, 115))]
    free = Scene()
    free.add(Sprite.circle(4), (3, 3), name="ball")
    return (
        report_of(
            gallery, [fire_request(gallery, request) for request in requests], [request.name for request in requests]
        ),
        told(game(), Rounds(Spread(Disc(3), count=6, radius=20), count=3), seed=5, exclude=[1]),
        told(game(), Disc(3), [(x, 110) for x in range(190, 220)]),
        told(free, Point(), (9, 3)),
        report_of(free, []),
        report_of(rays[0].scene, rays),
    )


def leaves(value: Json, steps: Steps = ()) -> Iterator[Steps]:
    """Paths of all that decides and holds nothing else."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    some = False
    for step, part in inner:
        some = True
        inside_weapons = steps[:1] == ("weapons",)
        if step not in LEFT_OUT or inside_weapons:
            yield from leaves(part, (*steps, step))
    if not some:
        yield steps


OTHER = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 500),
    st.floats(allow_nan=False),
    st.text(max_size=3),
    st.just([]),
    st.just({}),
    st.just([[1, 2, 3]]),
    st.just([{"object": 1}]),
)


def changed(report: Json, steps: Steps, value: Json) -> Json:
    """A copy with one value set."""
    if not steps:
        return value
    out = copy.copy(report)
    out[steps[0]] = changed(report[steps[0]], steps[1:], value)
    return out


def at(report: Json, steps: Steps) -> Json:
    for step in steps:
        report = report[step]
    return report


@cache
def paths() -> tuple[tuple[int, Steps], ...]:
    return tuple((number, steps) for number, report in enumerate(reports()) for steps in leaves(report))


@pytest.mark.parametrize("number", some_of(range(REPORTS)))
def test_a_change_of_any_kind_of_leaf_is_told(number: int) -> None:
    report, seen = reports()[number], set()
    for steps in leaves(report):
        kind = tuple("*" if isinstance(step, int) else step for step in steps)
        if kind in seen:
            continue
        seen.add(kind)
        for other in (None, True, 1, 0, -7.5, "x\ny", [], {}, [[1, 2, 3]], [[1, 2, 3, 4]], [{"object": 1}], [5]):
            one = changed(report, steps, other)
            for lines in (differences(report, one), differences(one, report)):
                assert bool(lines) != same(at(report, steps), other), steps
                assert all(line and "\n" not in line for line in lines)
                assert len(lines) < 200


@given(st.data(), OTHER)
@examples(100, deadline=None)
def test_any_change_of_any_leaf_is_told(data: st.DataObject, other: Json) -> None:
    number, steps = data.draw(st.sampled_from(paths()))
    report = reports()[number]
    assert bool(differences(report, changed(report, steps, other))) != same(at(report, steps), other)


@pytest.mark.parametrize("number", some_of(range(REPORTS)))
def test_a_lost_or_a_repeated_entry_is_told(number: int) -> None:
    report = reports()[number]
    lists = {steps[:i] for steps in leaves(report) for i, step in enumerate(steps) if isinstance(step, int)}
    for steps in random.Random(number).sample(sorted(lists, key=str), min(len(lists), 100)):
        value = at(report, steps)
        for other in (value[1:], value[:-1], [*value, value[0]], value[::-1]):
            if not same(value, other):
                assert differences(report, changed(report, steps, other)), steps


def test_equal_reports_differ_in_nothing() -> None:
    for report in reports():
        assert differences(report, json.loads(json.dumps(report))) == []


def test_how_a_report_was_made_does_not_count() -> None:
    report = copy.deepcopy(reports()[0])
    report["version"], report["scene"]["hash"], report["scene"]["version"] = "9", "0" * 16, 99
    report["shots"][0]["plan"] = {"ran": [], "left_out": []}
    assert differences(reports()[0], report) == []
    assert decisive(reports()[0]) == decisive(report)
    assert "plan" in reports()[0]["shots"][0], "the report itself is left as it was"


def test_a_weapon_may_be_called_like_what_does_not_count() -> None:
    scene = game()
    one, other = (report_of(scene, [fire(scene, Disc(r), (210, 110))], ["plan"]) for r in (3, 4))
    assert differences(one, other)[0] == 'weapon "plan": radius: 4, was 3'


def test_a_number_is_no_truth_value() -> None:
    assert same(1, 1.0) and same((1, 2), [1, 2])
    assert not same(1, True) and not same(0, False) and not same(0, None) and not same([], {})


AT = "shot 0 (disc at 210, 110)"


@pytest.mark.parametrize(
    ("scene", "lines"),
    [
        (game(can=(263, 120)), [f'{AT}: object 2 "can": missed by 17.3 px, was 14.3 px']),
        (
            game(duck=(201, 100)),
            [
                f'{AT}: object 0 "duck": 258 px, was 269; gained at (201, 88), (205, 89) and 12 more; '
                "lost at (200, 88), (196, 89) and 23 more; first at (205, 111), was (204, 111)",
                f'{AT}: object 3 "house" in front of object 0 "duck": 183 samples, was 172',
                f"{AT}: verdicts: 2186 empty, was 2175; 572 hit, was 583",
            ],
        ),
        (
            game(wall=False),
            [
                "scene: occluders 0, was 1",
                f'{AT}: object 0 "duck": 441 px, was 269; gained at (195, 100), (196, 100) and 170 more; '
                "first at (208, 108), was (204, 111)",
                f'{AT}: object 1 "bandit": 315 px, was 314; gained at (230, 110)',
                f'{AT}: object 3 "house" no longer blocks',
                f"{AT}: verdicts: 2453 empty, was 2175; 756 hit, was 583; 0 occluded, was 451",
            ],
        ),
        (game(width=300), ["scene: bounds_xyxy [0, 0, 299, 199], was [0, 0, 319, 199]"]),
    ],
)
def test_words_about_a_scene_that_changed(scene: Scene, lines: list[str]) -> None:
    got = differences(told(game()), told(scene))
    for line in lines:
        assert any(other.startswith(line) for other in got), got
    if len(lines) > 1:
        assert got == lines


def test_words_about_a_hit_that_came_or_went() -> None:
    small = {"weapon": Disc(4), "at": (230, 120)}
    hidden = game()
    hidden.add(Sprite.box(40, 40), (230, 120), role="occluder", layer=2, name="crate")
    here = "shot 0 (disc at 230, 120)"
    went = differences(told(game(), **small), told(hidden, **small))
    assert f'{here}: object 1 "bandit" is no longer hit: behind crate' in went
    assert f'{here}: object 4 "crate" newly blocks 49 samples' in went
    assert not any("is newly near" in line for line in went)
    came = differences(told(hidden, **small), told(game(), **small))
    assert f'{here}: object 1 "bandit" is newly hit: 49 px, first at (230, 120); was behind crate' in came
    away = game()
    away.move(1, (245, 120))
    gone = differences(told(game(), **small), told(away, **small))
    assert f'{here}: object 1 "bandit" is no longer hit: missed by 1.0 px' in gone


def test_words_about_what_was_fired() -> None:
    scene = game()
    assert differences(told(scene), told(scene, Disc(33)))[0] == 'weapon "disc": radius: 33, was 32'
    assert f"{AT}: seed: 4, was 0" in differences(told(scene), told(scene, seed=4))
    moved = differences(told(scene), told(scene, at=(211, 110.5)))
    assert moved[0] == "shot 0 (disc at 211, 110.5): fired at 211, 110.5, was 210, 110"
    kind = differences(told(scene), told(scene, Point()))
    assert kind[:2] == ['weapon "disc" is gone', 'weapon "point" is new']


@pytest.mark.parametrize("name", [None, "gun"])
def test_of_weapons_of_two_kinds_nothing_is_told_that_only_one_has(name: str | None) -> None:
    scene, reports = game(), []
    for weapon in (Disc(20), Pistol(90)):
        scene.weapons = {} if name is None else {name: weapon.to_json()}
        reports.append(report_of(scene, [fire(scene, weapon, (210, 110))], name and [name]))
    key = "weapon" if name is None else "kind"
    for was, now, words in ((*reports, '"pistol", was "disc"'), (*reports[::-1], '"disc", was "pistol"')):
        lines = differences(was, now)
        assert sum(line.endswith(f"{key}: {words}") for line in lines) == 1
        assert not any("missing" in line for line in lines), lines


def test_shots_are_paired_by_what_was_fired() -> None:
    scene = game()
    at = [(200, 100), (210, 110), (230, 120)]
    fewer = differences(told(scene, at=at), told(scene, at=[at[0], at[2]]))
    assert "shot 1 (disc at 210, 110) is missing" in fewer
    assert [line for line in fewer if "px, was" in line] == []
    assert "shot 1 (disc at 210, 110) is new" in differences(told(scene, at=[at[0], at[2]]), told(scene, at=at))


def test_rounds_are_told_apart() -> None:
    weapon = Rounds(Disc(4), count=2, recoil_xy=(0, -6))
    lines = differences(told(game(), weapon, (200, 94)), told(game(duck=(201, 100)), weapon, (200, 94)))
    assert any('object 0 "duck", round 1: ' in line for line in lines)


def test_of_a_batch_the_first_rows_are_told() -> None:
    at = [(x, 110) for x in range(180, 240)]
    lines = differences(told(game(), at=at), told(game(duck=(201, 100)), at=at))
    assert lines[0] == 'batch: shot 0: object 0 "duck": 226 px, was 248; first at (190, 104), was (190, 106)'
    assert lines[12] == "batch: and 48 more"
    assert lines[13].startswith("batch: verdicts: ")
    assert len(lines) == 14
    assert differences(told(game()), told(game(), at=at)) == ["shots listed as a batch, was shots listed one by one"]


def test_a_change_that_only_samples_show_is_told() -> None:
    """A wall over nothing: what was empty is now occluded elsewhere, in equal numbers."""
    wall = [Scene((64, 64)), Scene((64, 64))]
    for scene, x in zip(wall, (30, 34), strict=True):
        scene.add(Sprite.box(4, 4), (x, 30), role="occluder", name="post")
    lines = differences(*(told(scene, Disc(10), (32, 30)) for scene in wall))
    assert lines[-1].startswith("shot 0 (disc at 32, 30): ")
    assert any("occluded samples: gained at " in line and "lost at " in line for line in lines)


def test_words_about_what_rays_passed_by() -> None:
    near, moved, away, bare = game(duck=(250, 100)), game(duck=(250, 102)), game(duck=(20, 198)), game()
    bare.remove(bare.ids("hittable"))
    reports = [told(scene, Pistol(90), (200, 40), aim=0) for scene in (near, moved, away)]
    here = "shot 0 (pistol at 200, 40): nearest miss: "
    assert differences(*reports[:2]) == [f'{here}object 0 "duck" by 49.5 px, was 47.5 px']
    assert differences(*reports[1:]) == [f'{here}object 1 "bandit" by 69.5 px, was object 0 "duck" by 49.5 px']
    assert f'{here}none, was object 1 "bandit" by 69.5 px' in differences(
        reports[2], told(bare, Pistol(90), (200, 40), aim=0)
    )


def test_words_about_rays() -> None:
    """Where they stopped and why, what they went through: by their pellets where there are several."""
    near, far = game(duck=(250, 180)), game(duck=(250, 180))
    far.remove(far.find("house"))
    one, other = (told(scene, Rifle(60), (190, 104), aim=0) for scene in (near, far))
    lines = differences(one, other)
    assert "shot 0 (rifle at 190, 104): ray: stopped after 60.0 px (range), was at house, 4.5 px (occluder)" in lines
    assert "shot 0 (rifle at 190, 104): ray: stopped at house, 4.5 px (occluder), was 60.0 px (range)" in differences(
        other, one
    )
    moved = game(duck=(252, 180))
    ducks = [told(scene, Pistol(90), (200, 180), aim=0) for scene in (near, moved)]
    here = "shot 0 (pistol at 200, 180): ray: "
    assert f"{here}stopped at duck, 39.5 px (hits), was 37.5 px" in differences(*ducks)
    assert f'{here}in object 0 "duck" from 39.5 px to 39.5 px, was from 37.5 px to 37.5 px' in differences(*ducks)
    fans = [told(scene, Spread(Pistol(90), count=3, radius=9), (200, 180), aim=0, seed=2) for scene in (near, moved)]
    assert any("): ray 2: stopped at duck, " in line for line in differences(*fans))
    bursts = [told(scene, Rounds(Pistol(90), count=2), (200, 180), aim=0) for scene in (near, moved)]
    assert any("): ray of round 1: stopped at duck, " in line for line in differences(*bursts))
    lost = copy.deepcopy(fans[0])
    del lost["shots"][0]["rays"][1]
    assert differences(fans[0], lost) == ["shot 0 (spread at 200, 180): ray 1 is missing"]


def test_of_rays_what_has_no_words_is_told_beside_what_has() -> None:
    one = told(game(), Rifle(60), (190, 104), aim=0)
    other = copy.deepcopy(one)
    (ray,) = other["shots"][0]["rays"]
    ray["stop"]["distance"] += 2
    ray["end"][0] += 1
    other["shots"][0]["rays"] = [ray, "torn"]
    here = "shot 0 (rifle at 190, 104): ray: "
    lines = differences(one, other)
    assert f"{here}stopped at house, 6.5 px (occluder), was 4.5 px" in lines
    assert f"{here}end[0]: 251, was 250" in lines
    other["shots"][0]["rays"] = [*one["shots"][0]["rays"], "torn"]
    other["shots"][0]["seed"] = 7
    assert "shot 0 (rifle at 190, 104): rays: 2 entries, was 1" in differences(one, other)


@examples(60, deadline=None)
@given(st.tuples(*[st.text("ab\n\x7f\x9b\u2028\u202e\u2066\u061c\ud800", min_size=1, max_size=5)] * 4))
def test_lines_can_be_printed_whatever_things_are_called(names: tuple[str, ...]) -> None:
    was = told(game(), Rounds(Spread(Disc(3), count=6, radius=20), count=3), seed=5, exclude=[1])
    now = copy.deepcopy(was)
    for report, (thing, key) in zip((was, now), (names[:2], names[2:]), strict=True):
        report["scene"]["name"] = thing
        report["weapons"][thing] = {key: thing}
        report["shots"][0][key] = {thing: key}
        report["shots"][0]["verdicts"][thing] = key
        for part in ("rows", "why_not", "blockers"):
            for entry in report["shots"][0][part]:
                entry["name"] = entry[key] = thing
    del now["shots"][0]["rows"][0]
    assert all(line.isprintable() for line in differences(was, now))
