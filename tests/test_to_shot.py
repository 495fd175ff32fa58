"""From an answer to a shot of a scene file, and back: what was found in Python is saved, and fired again."""

from __future__ import annotations

import io
import json
import random
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from bench.schemas import schemas
from some_of import some_of
from test_weapons import EVERY

from hitplanes import (
    ALL,
    Beam,
    Disc,
    History,
    Hits,
    InputError,
    Laser,
    Pistol,
    Point,
    Projectile,
    RayHits,
    Rifle,
    Rounds,
    Scene,
    Spread,
    Sprite,
    Sweep,
    Weapon,
    fire,
    fire_shots,
    load_scene,
    prepare,
    report_of,
    weapons_of,
)
from hitplanes.planes.grid.fixed_point import unit_of
from hitplanes.weapons.cli.command import main
from hitplanes.weapons.replay.shot_log import requests_of
from hitplanes.weapons.replay.stream import Progress, fire_log

ROOT = Path(__file__).parents[1]
RAYS: list[Weapon] = [
    Pistol(90, falloff="smooth"), Rifle(120, max_hits=2, budget=30), Laser(None), Laser(80, width=5),
    Sweep(Laser(60), 90, 7), Projectile(70, radius=2), Projectile(70, radius=2, steps=3), Spread(Pistol(80), 5, 20),
    Rounds(Spread(Laser(80), 3, 9), 2, (1, 0.5), 3),
]  # fmt: skip
CATEGORIES = ["a", "bit 5", "c"]


def some_scene(rng: random.Random) -> Scene:
    """Objects of several owners and categories, some without a name, some behind occluders, some gone."""
    scene = Scene(rng.choice([None, (120, 90)]), categories=CATEGORIES)
    for number in range(14):
        owner = None if number < 3 else rng.choice([None, rng.randrange(number)])
        role, bits = (
            rng.choice(["hittable"] * 3 + ["occluder"] * (number > 3)),
            rng.choice([None, 1, 2, 6, 1 << 5, 1 << 31, ALL]),
        )
        sprite = rng.choice([Sprite.circle(rng.randint(1, 9)), Sprite.box(rng.randint(1, 20), rng.randint(1, 20))])
        place = rng.uniform(0, 120), rng.uniform(0, 90)
        scene.add(
            sprite, place, role=role, layer=rng.randint(0, 2), categories=bits, owner=owner, cost=rng.randint(0, 2),
            velocity_xy=(rng.uniform(-9, 9), 3), angle=rng.choice([0, 33.3]),
        )  # fmt: skip
    scene.remove(sorted(rng.sample(scene.ids().tolist(), 2)))
    return scene


def some_shots(rng: random.Random, scene: Scene, weapon: Weapon) -> dict[str, Any]:
    """Arguments of `fire` for three shots, each with values of its own."""
    near = scene.position(rng.choices(scene.ids("hittable").tolist(), k=3)).tolist()
    at = [(x + rng.uniform(-6, 6), y + rng.uniform(-6, 6)) for x, y in near]
    bits = [ALL, ALL, ALL, 0, 1, 2, 1 << 5, ALL - 2, 1 << 31 | 1]
    how: dict[str, Any] = {
        "at": at,
        "accept": rng.choices(bits, k=3),
        "blocked_by": rng.choices(bits, k=3),
        "exclude": [[rng.randrange(-1, scene.items.count), rng.choice([-1, 3])] for _ in at],
        "seed": rng.choice([0, 7, 2**64 - 1]),
        "shot": rng.choice([[5, 0, 2**63 - 1], [1, 1, 2]]),
    }
    if weapon == Laser(None) or rng.random() < 0.4:
        return how | {"toward": [(x + rng.uniform(1, 40), y + rng.uniform(-40, 40)) for x, y in at]}
    angles = [rng.uniform(-400, 400), rng.uniform(-(10**9), 10**9), rng.choice([0, 45, 1e-300, 30.123456789])]
    return how | rng.choice([{"aim": angles}, {"aim": angles[0]}, {"aim": 90}, {}])


def same(shot: Hits, hits: Hits, row: int) -> None:
    """A shot fired alone has the rows, verdicts, passes and stops of one of a batch."""
    assert [one[1:] for one in shot] == [one[1:] for one in hits.of(row)]
    assert shot.verdict_counts() == hits.verdict_counts(row)
    if isinstance(hits, RayHits):
        assert isinstance(shot, RayHits)
        for own, other in ((shot.passes, hits.passes_at(row)), (shot.stop, hits.stops_at(row))):
            both = [
                [{k: v for k, v in one.items() if k not in ("shot", "row")} for one in rows.to_rows()]
                for rows in (own, other)
            ]
            assert both[0] == both[1]


@pytest.mark.parametrize("weapon", some_of([*EVERY, *RAYS]), ids=lambda weapon: weapon.text[:60])
def test_a_saved_shot_hits_what_it_hit(weapon: Weapon, tmp_path: Path) -> None:
    """fire -> to_shot -> save -> load -> fire: equal rows, verdicts, passes and stops; the schema accepts the shots."""
    schema, struck = schemas()["shot"], 0
    valid = jsonschema.validators.validator_for(schema)(schema)
    for seed in range(8):
        rng = random.Random(f"{weapon.text} {seed}")
        scene = some_scene(rng)
        how = some_shots(rng, scene, weapon)
        if seed % 2:
            scene.weapons = {"other": Disc(99).to_json(), "gun": weapon.to_json()}
        hits = fire(scene, weapon, **how)
        scene.shots += [hits.to_shot(row) for row in range(3)]
        for row, shot in enumerate(json.loads(json.dumps(scene.shots))):
            valid.validate(shot)
            assert shot["weapon"] == ("gun" if seed % 2 else json.loads(json.dumps(weapon.to_json())))
            if "aim" in how:
                assert shot["aim"] == (how["aim"][row] if isinstance(how["aim"], list) else how["aim"])
        scene.save(tmp_path / str(seed))
        loaded = load_scene(tmp_path / str(seed))
        for row, again in enumerate(fire_shots(loaded)):
            same(again, hits, row)
            assert again.to_shot() == scene.shots[row]
        struck += len(hits)
    assert struck


def test_a_shot_by_hand() -> None:
    scene = Scene((90, 90), categories=["duck", "glass"])
    shooter, gone = scene.add(Sprite.circle(5), (10, 10)), scene.add(Sprite.circle(5), (50, 50))
    scene.remove(gone)
    gun = Beam(30, 2)
    how: dict[str, Any] = {"accept": "duck", "blocked_by": ["duck", "default"], "exclude": [gone, shooter, -1, shooter]}
    hits = fire(scene, gun, (10.1, 10), aim=0.1, seed=4, shot=9, **how)
    told = {
        "weapon": {"kind": "beam", "length": 30.0, "width": 2.0}, "at": [10.1015625, 10.0], "aim": 0.1,
        "accept": ["duck"], "blocked_by": ["default", "duck"], "exclude": [shooter], "seed": 4, "shot": 9,
    }  # fmt: skip
    assert hits.to_shot() == told
    scene.weapons["flame"] = gun.to_json()
    assert hits.to_shot() == {**told, "weapon": "flame"}
    assert fire(scene, Point(), (10, 10)).to_shot() == {"weapon": {"kind": "point"}, "at": [10.0, 10.0], "shot": 0}
    aimed = fire(scene, Laser(None), [(1, 2), (3, 4)], toward=[(5, 6), (7.25, 8)])
    assert aimed.to_shot(1) == {"weapon": Laser(None).to_json(), "at": [3.0, 4.0], "toward": [7.25, 8.0], "shot": 1}
    with pytest.raises(InputError, match=r"^shot: expected a whole number from 0 to 1, got 2$"):
        aimed.to_shot(2)


@pytest.mark.parametrize("aim", [1e9 + 0.5, -3e11 - 0.25, 1e12])
def test_an_aim_too_large_for_a_file_is_folded_exactly(aim: float) -> None:
    shot = fire(Scene(), Beam(9, 1), (0, 0), aim=aim).to_shot()
    assert -360 < shot["aim"] < 360 and unit_of(shot["aim"]) == unit_of(aim)


def test_shots_of_prepared_weapons_and_of_a_scene_that_changed() -> None:
    scene = Scene((90, 90))
    scene.add(Sprite.circle(20), (40, 40), name="duck")
    scene.add(Sprite.circle(20), (40, 40), name="hen")
    for weapon in (Disc(9), Spread(Disc(2), 5, 9), Pistol(60)):
        for how in ({"aim": 33.3}, {"toward": (41.5, 40)}, {}):
            ready, fired = prepare(scene, weapon, exclude=1, seed=2).fire((30, 30), shot=4, **how), fire(
                scene, weapon, (30, 30), exclude=1, seed=2, shot=4, **how
            )  # fmt: skip
            told = fired.to_shot()
            assert ready.to_shot() == told
            kept = prepare(scene, weapon, exclude=1, seed=2).fire((30, 30), shot=4, **how)
            scene.move(0, (41, 40))
            assert fired.to_shot() == kept.to_shot() == told


def test_shots_of_the_past_are_saved_with_their_scene(tmp_path: Path) -> None:
    scene = Scene((90, 90))
    duck = scene.add(Sprite.circle(5), (40, 40))
    history = History(scene)
    for tick in range(3):
        scene.move(duck, (40 + 4 * tick, 40))
        history.record(tick)
    hits = fire(history, Disc(4), [(40, 40)] * 3, tick=[2, 0, 1], aim=[1, 2, 3])
    scene.remove(duck)
    for row in range(3):
        past = hits.scene_of(row).copy()
        past.shots.append(hits.to_shot(row))
        past.save(tmp_path / str(row))
        (again,) = fire_shots(load_scene(tmp_path / str(row)))
        same(again, hits, row)
        assert again.to_shot()["aim"] == row + 1


def test_the_command_reports_what_was_found_in_python(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = load_scene(ROOT / "fixtures" / "gallery")
    scene.shots.clear()
    weapons = [Disc(21), Disc(8), weapons_of(scene)["beam"], Disc(21), Laser(200)]
    for weapon in weapons:
        scene.shots.append(fire(scene, weapon, (170, 150), aim=12).to_shot())
    scene.weapons["disc"] = Disc(5).to_json()  # the name of its kind is taken
    scene.save(tmp_path / "found")
    facts = tmp_path / "r.json"
    assert main(["report", str(tmp_path / "found"), "-o", str(tmp_path / "r.png"), "--json", str(facts)]) == 0
    report = json.loads(facts.read_text())
    assert [shot["weapon"] for shot in report["shots"]] == ["disc", "disc 2", "beam", "disc", "laser"]
    for shot, weapon in zip(report["shots"], weapons, strict=True):
        truth = fire(scene, weapon, (170, 150), aim=12)
        assert [(row["object"], row["pixels"]) for row in shot["rows"]] == [(row.object, row.pixels) for row in truth]
    assert "disc 2 at" in capsys.readouterr().out


def test_weapons_without_a_name_get_one_that_is_free() -> None:
    scene = Scene((20, 20))
    fired = [fire(scene, Disc(radius), (1, 1)) for radius in (1, 2, 3, 2, 1)]
    told = report_of(scene, fired, ["disc", None, None, None, None])
    assert [shot["weapon"] for shot in told["shots"]] == ["disc", "disc 2", "disc 3", "disc 2", "disc"]
    told = report_of(scene, fired, [None, "disc 2", "disc", "gun", "boom"])
    assert [shot["weapon"] for shot in told["shots"]] == ["boom", "disc 2", "disc", "gun", "boom"]
    assert {name: weapon["radius"] for name, weapon in told["weapons"].items()} == {
        "boom": 1, "disc 2": 2, "disc": 3, "gun": 2,
    }  # fmt: skip


def test_a_log_may_describe_its_weapons(tmp_path: Path) -> None:
    """Answers are those of the same weapons by name, in any mixture, but for the checksums of the lines."""
    scene = load_scene(ROOT / "fixtures" / "gallery")
    rng, answers = np.random.default_rng(3), []
    shots = [
        {"weapon": ["shotgun", "beam", "point"][i % 3], "at": rng.uniform(0, 480, 2).tolist(), "aim": i}
        for i in range(90)
    ]
    told = [{**shot, "weapon": scene.weapons[shot["weapon"]]} if i % 4 else shot for i, shot in enumerate(shots)]
    for name, lines in (("named", shots), ("told", told)):
        log, output = tmp_path / f"{name}.jsonl", tmp_path / f"{name}.hits.jsonl"
        log.write_text("".join(json.dumps(line) + "\n" for line in lines))
        fire_log(scene, log, output, Progress(io.StringIO()))
        answers.append([{**json.loads(line), "of": 0, "crc": 0} for line in output.read_text().splitlines()[1:]])
    assert answers[0] == answers[1] and any(answer["rows"] for answer in answers[0])
    log.write_text(json.dumps(told[1]) + '\n{"weapon": {"kind": "disk", "radius": 3}, "at": [1, 2]}\n')
    with pytest.raises(InputError, match=r"told.jsonl line 2: weapon: kind: expected one of .*did you mean 'disc'"):
        fire_log(scene, log, tmp_path / "bad.jsonl", Progress(io.StringIO()))


BAD_WEAPONS: dict[str, tuple[object, str]] = {
    "no kind": ({}, r"^shots\[0\]: weapon: kind: expected one of 'point'"),
    "a field": ({"kind": "disc", "radius": "x"}, r"^shots\[0\]: weapon: radius: expected "),
    "a list": (["disc"], r"^shots\[0\]: weapon: expected a text of 1 to 200 characters, got \['disc'\]"),
    "no name": ("gum", r"^shots\[0\]: weapon: expected one of 'gun', got 'gum' \(did you mean 'gun'\?\)"),
    "no point": (
        {"kind": "laser", "range": None},
        r"^shots\[0\]: toward: expected a point, as the weapon has no range",
    ),
}


@pytest.mark.parametrize(("weapon", "told"), BAD_WEAPONS.values(), ids=BAD_WEAPONS)
def test_bad_weapons_of_a_shot_are_named(weapon: object, told: str) -> None:
    scene = Scene()
    scene.weapons, scene.shots = {"gun": Disc(3).to_json()}, [{"weapon": weapon, "at": [1, 2]}]
    with pytest.raises(InputError, match=told):
        fire_shots(scene)
    with pytest.raises(InputError, match=told):
        requests_of(scene, weapons_of(scene))


@pytest.mark.parametrize("categories", [[], ["a"], CATEGORIES, ["bit 4", "bit 4'", "bit 3"]])
def test_names_of_categories_are_read_as_they_are_told(categories: list[str]) -> None:
    scene = Scene(categories=categories)
    for bits in (0, 1, 2, 1 << 4, 1 << 5 | 1 << 31, ALL):
        assert scene.category_bits(*scene.category_names(bits)) == bits
    with pytest.raises(InputError, match=r"^category: expected one of 'default'.*, got 'bit 32'"):
        scene.category_bits("bit 32")
