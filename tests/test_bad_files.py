"""Bad files, paths and words through the command: exit 2, one line that names the place, and no half-written file."""

from __future__ import annotations

import copy
import json
import os
import re
import resource
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hitplanes import Disc, InputError, Scene, Sprite, fire, load_scene, read_png
from hitplanes.planes.files.png import check_output, write_png, write_text
from hitplanes.weapons.cli.command import main

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "fixtures" / "gallery"

pytestmark = pytest.mark.usefixtures("bounded")

PLAIN: dict[str, Any] = {
    "format": "hitplanes-scene/2",
    "bounds": {"size_wh": [32, 20]},
    "categories": ["target"],
    "objects": {"hittable": [{"name": "duck", "circle": 4, "position_xy": [16, 10]}]},
    "weapons": {"gun": {"kind": "disc", "radius": 2}},
    "shots": [{"weapon": "gun", "at": [16, 10]}],
}
MISSING = object()
DUCK, SHOT, GUN = "objects.hittable.0", "shots.0", "weapons.gun"


def changed(place: str, value: Any) -> dict[str, Any]:
    """The plain scene with one thing put elsewhere, or taken away."""
    data = inner = copy.deepcopy(PLAIN)
    *way, last = [int(key) if key.isdecimal() else key for key in place.split(".")]
    for key in way:
        inner = inner[key]  # type: ignore[index]
    if value is MISSING:
        del inner[last]  # type: ignore[arg-type]
    else:
        inner[last] = value  # type: ignore[index]
    return data


def object_of(**source: Any) -> dict[str, Any]:
    return changed(DUCK, {"position_xy": [0, 0], **source})


def spelled(place: str, text: str) -> str:
    """The plain scene with a value of this spelling."""
    return json.dumps(changed(place, "HERE")).replace('"HERE"', text)


def command(words: list[str], capfd: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and what was told on stderr."""
    try:
        code = main(words)
    except SystemExit as error:  # as argparse ends
        code = int(error.code or 0)
    return code, capfd.readouterr().err


def refused(words: list[str], told: str, capfd: pytest.CaptureFixture[str]) -> None:
    code, error = command(words, capfd)
    assert code == 2, error
    assert error.startswith("hitplanes: ") and error.endswith("\n") and error.count("\n") == 1, error
    assert re.search(told, error), error
    assert len(error) < 1000


SCENES: dict[str, tuple[Any, str]] = {
    # as a text
    "empty": ("", "expected one JSON value: Expecting value"),
    "zero bytes": (b"\0" * 100, "expected one JSON value"),
    "byte order mark": ("\ufeff" + json.dumps(PLAIN), "expected one JSON value: Unexpected UTF-8 BOM"),
    "UTF-16": (json.dumps(PLAIN).encode("utf-16"), "expected JSON in UTF-8"),
    "Latin-1": (json.dumps(PLAIN).replace("duck", "\xe9").encode("latin-1"), "expected JSON in UTF-8: 'utf-8' codec"),
    "Python": (repr(PLAIN), "expected one JSON value: Expecting property name enclosed in double quotes"),
    "a comment": ("// a scene\n" + json.dumps(PLAIN), "expected one JSON value"),
    "something after it": (json.dumps(PLAIN) + " x", "expected one JSON value: Extra data"),
    "a list": ("[]", r"scene: expected an object, got \[\]"),
    "10^5 deep": ("[" * 10**5 + "]" * 10**5, "expected one JSON value: .*recursion"),
    "objects 10^5 deep": ('{"a":' * 10**5, "expected one JSON value: .*recursion"),
    "duplicate key": (json.dumps(PLAIN)[:-1] + ', "shots": []}', "key: expected each key once, got 'shots' again"),
    "duplicate key inside": (
        spelled(GUN, '{"kind": "disc", "kind": "point"}'), "key: expected each .*got 'kind' again"),
    "duplicate key, escaped": (spelled(GUN, '{"kind": 1, "\\u006bind": 2}'), "key: expected each .*got 'kind' again"),
    "NaN": (
        spelled(f"{DUCK}.position_xy", "[NaN, 1]"), r"objects: hittable\[0\]: position_xy\[0\]: .*number, got NaN"),
    "Infinity": (
        spelled(f"{SHOT}.at", "[-Infinity, 1]"), r"shots\[0\]: at\[0\]: expected a finite number, got -Infinity"),
    "1e999": (
        spelled(f"{DUCK}.position_xy", "[1e999, 1]"), r"hittable\[0\]: position_xy\[0\]: .*finite number, got inf"),
    "1e999 in a shot": (
        spelled(f"{SHOT}.at", "[1, -1e999]"), r"shots\[0\]: at\[1\]: expected a finite number, got -inf"),
    "5000 digits": (spelled(f"{DUCK}.layer", "1" * 5000), "Exceeds the limit"),
    "4000 digits": (spelled(f"{DUCK}.layer", "1" * 4000), "layer: expected a whole number .*got 111.*11"),
    "4000 digits of a position": (
        spelled(f"{DUCK}.position_xy", f"[{'1' * 4000}, 0]"), r"position_xy\[0\]: expected a number within .*got 1"),
    "position 900 deep": (spelled(f"{DUCK}.position_xy", "[" * 900 + "]" * 900), r"position_xy: .* array .*got \[\[\["),
    "name 900 deep": (spelled(f"{DUCK}.name", "[" * 900 + "]" * 900), r"hittable\[0\]: name: expected a text"),
    # the scene
    "format": (changed("format", "hitplanes-scene/9"), "format: expected 'hitplanes-scene/2', got 'hitplanes-scene/9'"),
    "a report": (json.dumps({"format": "hitplanes-report/1", "version": "1"}), "format: .*got 'hitplanes-report/1'"),
    "no format": (changed("format", MISSING), "format: expected 'hitplanes-scene/2', got nothing"),
    "key": (changed("shot", []), "key: expected one of .*got 'shot' .did you mean 'shots'"),
    "name, surrogate": (spelled("name", r'"\ud800"'), r"name: expected a text .*got '\\ud800'"),
    "bounds, list": (changed("bounds", [32, 20]), r"bounds: expected an object, got \[32, 20\]"),
    "bounds, 10^13": (
        changed("bounds.size_wh", [10**13, 5]), r"bounds: size_wh\[0\]: expected a whole .*got 10000000000000"),
    "bounds, true": (changed("bounds.size_wh", [True, 5]), r"bounds: size_wh\[0\]: .*got True"),
    "bounds, key": (changed("bounds.size", [4, 4]), "bounds: key: .*got 'size' .did you mean 'size_wh'"),
    "categories, text": (changed("categories", "target"), "categories: expected a list, got 'target'"),
    "categories, twice": (changed("categories", ["a", "a"]), "categories: expected distinct names"),
    "categories, the default": (changed("categories", ["default"]), "categories: expected distinct names"),
    "objects, list": (changed("objects", []), r"objects: expected an object, got \[\]"),
    "section": (changed("objects.ocluders", []), "key: .*got 'ocluders' .did you mean 'occluders'"),
    "section, null": (changed("objects.hud", None), "objects: hud: expected a list, got None"),
    "bounds, text": (changed("bounds", "all"), r"scene\.json: bounds: expected an object, got 'all'"),
    # an object
    "object, text": (changed(DUCK, "duck"), r"objects\.hittable\[0\]: expected an object, got 'duck'"),
    "no source": (changed(f"{DUCK}.circle", MISSING), r"objects\.hittable\[0\]: source: expected one of image"),
    "source, misspelled": (
        object_of(circel=4), r"hittable\[0\]: source: .*got circel .did you mean 'circle'\?"),
    "source, capital": (
        object_of(Circle=4), r"hittable\[0\]: source: .*got Circle .did you mean 'circle'\?"),
    "source, strange": (object_of(blob=4), r"hittable\[0\]: source: .* mask, got blob$"),
    "capitals": (changed(f"{DUCK}.LAYER", 2), r"hittable\[0\]: key: .*got 'LAYER' .did you mean 'layer'"),
    "frames, key": (
        object_of(image="a.png", frames={"grid": [2, 2]}),
        r"hittable\[0\]: frames: key: .*got 'grid' .did you mean 'grid_wh'"),
    "part's key": (
        changed(GUN, {"kind": "spread", "pellet": {"kind": "disc", "raduis": 1}, "count": 2, "radius": 3}),
        r"weapons\.gun: pellet: key: .*got 'raduis' .did you mean 'radius'"),
    "two sources": (changed(f"{DUCK}.mask", ["#"]), r"objects\.hittable\[0\]: source: .*got circle and mask"),
    "object's key": (changed(f"{DUCK}.scal", 2), r"objects\.hittable\[0\]: key: .*got 'scal' .did you mean 'scale'"),
    "position with true": (changed(f"{DUCK}.position_xy", [True, 2]), r"hittable\[0\]: position_xy\[0\]: .*got True"),
    "position of texts": (changed(f"{DUCK}.position_xy", ["1", "2"]), r"hittable\[0\]: position_xy: expected numbers"),
    "position null": (changed(f"{DUCK}.position_xy", None), r"hittable\[0\]: position_xy: expected numbers, got None"),
    "layer 10^30": (changed(f"{DUCK}.layer", 10**30), r"hittable\[0\]: layer: expected a whole number .*got 1000"),
    "id 10^9": (changed(f"{DUCK}.id", 10**9), r"hittable\[0\]: id: expected a whole number from 0 .*got 1000000000"),
    "owner to come": (changed(f"{DUCK}.owner", 7), r"hittable\[0\]: owner.*: expected a whole number .*got 7"),
    "owner unknown": (changed(f"{DUCK}.owner", "duk"), r"hittable\[0\]: owner.*'duk' .did you mean 'duck'"),
    "category unknown": (changed(f"{DUCK}.categories", ["targe"]), r"hittable\[0\]: .*'targe' .did you mean 'target'"),
    "flip true": (changed(f"{DUCK}.flip", True), r"hittable\[0\]: flip: expected one of .*got True"),
    "mask of 40,000": (object_of(mask=["#" * 40_000]), r"hittable\[0\]: mask: expected a mask of sides .*40000 x 1"),
    "mask of an empty row": (object_of(mask=[""]), r"hittable\[0\]: mask: expected .*1 to 32768 px, got 0 x 1"),
    "mask of words": (object_of(mask=["##", "#x"]), r"hittable\[0\]: mask\[1\]: expected 2 of '#' and '\.', got '#x'"),
    "mask of true and 0": (object_of(mask=[[True, 0]]), r"hittable\[0\]: mask\[0\]\[0\]: .*like the others, got True"),
    "polygon with true": (object_of(polygon=[[0, 0], [True, 0], [0, 5]]), r"polygon\[1\]\[0\]: .*got True"),
    "polygon too large": (object_of(polygon=[[0, 0], [32768, 0], [0, 32768]]), r"hittable\[0\]: .*got 32769 x 32769"),
    "holes, object": (object_of(polygon=[[0, 0], [9, 0], [0, 5]], holes={}), r"holes: expected a list, got \{\}"),
    "color of floats": (
        object_of(circle=3, color=[0.5, 0, 0]), r"hittable\[0\]: color\[0\]: expected a whole .*got 0.5"),
    # weapons and shots
    "weapons, list": (changed("weapons", []), r"weapons: expected an object, got \[\]"),
    "weapon, text": (changed(GUN, "disc"), r"weapons\.gun: expected an object with a kind, got 'disc'"),
    "weapon's kind": (changed(f"{GUN}.kind", "dsc"), r"weapons\.gun: kind: .*got 'dsc' .did you mean 'disc'"),
    "weapon's key": (changed(f"{GUN}.radus", 2), r"weapons\.gun: key: .*got 'radus' .did you mean 'radius'"),
    "weapon's field, text": (changed(f"{GUN}.radius", "2"), r"weapons\.gun: radius: expected a number, got '2'"),
    "weapon's field, true": (changed(f"{GUN}.radius", True), r"weapons\.gun: radius: expected a number, got True"),
    "weapon's field, 10^9": (changed(f"{GUN}.radius", 10**9), r"weapons\.gun: radius: expected .*got 1000000000"),
    "weapon's field, missing": (
        changed(f"{GUN}.radius", MISSING), r"weapons\.gun: radius: expected a value, got nothing"),
    "weapon of too many pixels": (
        changed(f"{GUN}.radius", 2**20), "samples: expected a shot of at most 33554432 to tell"),
    "shots, object": (changed("shots", {}), r"shots: expected a list, got \{\}"),
    "shot, number": (changed(SHOT, 5), r"shots\[0\]: shot: expected an object, got 5"),
    "shot of nothing": (changed(SHOT, {}), r"shots\[0\]: weapon: expected a value, got nothing"),
    "shot's key": (changed(f"{SHOT}.aimm", 3), r"shots\[0\]: key: .*got 'aimm' .did you mean 'aim'"),
    "shot's weapon": (changed(f"{SHOT}.weapon", "gum"), r"shots\[0\]: weapon: .*got 'gum' .did you mean 'gun'"),
    "shot with true": (changed(f"{SHOT}.at", [True, 2]), r"shots\[0\]: at\[0\]: expected a number like .*got True"),
    "shot at three": (changed(f"{SHOT}.at", [1, 2, 3]), r"shots\[0\]: at: expected shape \(2,\), got \(3,\)"),
    "shot's aim, true": (changed(f"{SHOT}.aim", True), r"shots\[0\]: aim: expected a number, got True"),
    "shot's accept, text": (changed(f"{SHOT}.accept", "target"), r"shots\[0\]: accept: expected a list, got 'target'"),
    "shot's accept": (changed(f"{SHOT}.accept", ["targe"]), r"shots\[0\]: .*got 'targe' .did you mean 'target'"),
    "shot's exclude": (
        changed(f"{SHOT}.exclude", ["duk"]), r"shots\[0\]: exclude\[0\]: .*got 'duk' .did you mean 'duck'"),
    "shot's exclude, number": (changed(f"{SHOT}.exclude", [9]), r"shots\[0\]: exclude\[0\]: owner: .*got 9"),
    "shot's seed": (changed(f"{SHOT}.seed", 2**64), r"shots\[0\]: seed: expected a whole .*got 18446744073709551616"),
    "shot's seed, null": (changed(f"{SHOT}.seed", None), r"shots\[0\]: seed: expected a whole number .*got None"),
}  # fmt: skip

SCENES_NOT_YET = [
    pytest.param(changed(SHOT, {"weapon": "gun", "at": [1, 1], "aim": 1, "toward": [2, 2]}),
          r"shots\[0\]: aim: expected aim or toward", id="shot with aim and toward"),
    pytest.param(changed(f"{SHOT}.toward", [16, 10]), r"shots\[0\]: toward: ", id="shot at itself"),
    pytest.param(changed("weapons.", {"kind": "point"}), "weapons: ",
          id="weapon of no name"),
    pytest.param(changed("weapons." + "x" * 10**4, {"kind": "point"}), "weapons: ",
          id="weapon of a name of 10^4"),
    pytest.param(spelled(GUN, '{"kind":"rounds","count":1,"weapon":' * 200 + "0" + "}" * 200),
          r"weapons\.gun: ", id="rounds 200 deep"),
    pytest.param(changed("format", "x" * 10**6), "format: ", id="format of 10^6"),
    pytest.param(changed("categories", [f"category {i}" for i in range(300)] * 2), "categories: ",
          id="600 categories, twice"),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "told"), [*(pytest.param(*row, id=name) for name, row in SCENES.items()),
                                             *SCENES_NOT_YET])  # fmt: skip
def test_a_bad_scene_is_one_line(scene: Any, told: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    text = scene if isinstance(scene, str | bytes) else json.dumps(scene)
    data = text if isinstance(text, bytes) else text.encode()
    folder, out = tmp_path / "scene", tmp_path / "out"
    folder.mkdir()
    out.mkdir()
    (folder / "scene.json").write_bytes(data)
    refused(["report", str(folder), "-o", str(out / "r.png"), "--json", str(out / "r.json")], told, capfd)
    assert list(out.iterdir()) == [] and list(folder.iterdir()) == [folder / "scene.json"]


def test_the_plain_scene_is_right(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.json").write_text(json.dumps(PLAIN))
    assert command(["report", str(tmp_path), "-o", str(tmp_path / "r.png")], capfd) == (0, "")


WINDOWS = ("CON", "NUL", "aux.png", "com1.png", "sub/Lpt9.tar.gz", "prn .png")

IMAGES: dict[str, tuple[Any, str]] = {
    "up": ("../duck.png", "image: expected a path inside the scene's folder, got '../duck.png'"),
    "down and up": ("a/../../duck.png", "image: expected a path inside"),
    "up in the middle": ("nul.png/../duck.png", "image: expected a path inside"),
    "absolute": ("/etc/passwd", "image: expected a path inside the scene's folder, got '/etc/passwd'"),
    "two slashes": ("//server/duck.png", "image: expected a path inside"),
    "backslash": ("a\\duck.png", "image: expected a path inside"),
    "backslashes up": ("..\\duck.png", "image: expected a path inside"),
    "drive": ("C:duck.png", "image: expected a path inside"),
    "drive and slash": ("C:/duck.png", "image: expected a path inside"),
    "address": ("file:///etc/passwd", "image: expected a path inside"),
    "stream": ("duck.png:x", "image: expected a path inside"),
    "zero byte": ("du\0ck.png", "image: expected a path inside"),
    "surrogate": ("\ud800.png", "image: expected a text"),
    "300 characters": ("x" * 300, "image: expected a text of 1 to 200 characters"),
    "no name": ("", "image: expected a text"),
    "number": (5, "image: expected a text of 1 to 200 characters, got 5"),
    "list": (["duck.png"], "image: expected a text"),
    "missing": ("duck.png", "image: expected a PNG file, got 'duck.png': No such file or directory"),
    "dot behind": ("real.png.", "image: expected a PNG file, got 'real.png.': No such file"),
    "space behind": ("real.png ", "image: expected a PNG file, got 'real.png ': No such file"),
    "home": ("~/real.png", "image: expected a PNG file"),
    "the folder itself": (".", "image: expected a PNG file, got .* which is a folder"),
    "a folder": ("folder.png", "image: expected a PNG file, got 'folder.png', which is a folder"),
    "below a file": ("real.png/duck.png", "image: expected a PNG file, got 'duck.png': Not a directory"),
    "a pipe": ("pipe.png", "image: expected a PNG file, got 'pipe.png', which is a folder, a pipe or a device"),
    "link out": ("out.png", "image: expected a path inside .*got 'out.png', which leads out of it"),
    "link to a folder out": ("away/x.png", "image: expected a path inside .*which leads out of it"),
    "link to a device": ("zero.png", "image: expected a path inside .*which leads out of it"),
    "link to itself": ("loop.png", "image: expected a path inside .*which leads out of it"),
    "an empty file": ("empty.png", r"image: 'empty.png': expected a PNG file, got something else \(0 bytes\)"),
    "scene.json": ("scene.json", "image: 'scene.json': expected a PNG file, got something else"),
    **{name: (name, "image: expected a path inside the scene's folder") for name in WINDOWS},
}


@pytest.mark.parametrize("name", IMAGES)
def test_a_bad_path_of_an_image_is_one_line(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image, told = IMAGES[name]
    folder = tmp_path / "scene"
    (folder / "folder.png").mkdir(parents=True)
    (folder / "empty.png").touch()
    (folder / "real.png").write_bytes((GALLERY / "duck.png").read_bytes())
    (tmp_path / "duck.png").write_bytes((GALLERY / "duck.png").read_bytes())
    os.mkfifo(folder / "pipe.png")
    links = {"out.png": "../duck.png", "away": "..", "loop.png": "loop.png", "zero.png": "/dev/zero"}
    for link, to in links.items():
        (folder / link).symlink_to(to)
    (folder / "scene.json").write_text(json.dumps(object_of(image=image)))
    refused(["report", str(folder), "-o", str(tmp_path / "r.png")], rf"objects\.hittable\[0\]: {told}", capfd)
    assert not (tmp_path / "r.png").exists()


# The words of the command


def words_of(*words: str) -> list[str]:
    return ["report", str(GALLERY), *words]


ONE = ("--weapon", "laser", "--at", "1,2")
WORDS: dict[str, tuple[list[str], str]] = {
    "scene missing": (["report", "no"], "no/scene.json: cannot read it: No such file"),
    "scene of no name": (["report", ""], "scene.json: cannot read it: No such file"),
    "scene, a file": (["report", str(GALLERY / "duck.png")], "scene.json: cannot read it: Not a directory"),
    "scene, 300 characters": (["report", "x" * 300], "scene.json: cannot read it: File name too long"),
    "scene, zero byte": (["report", "a\0b"], r"folder: expected a path, got .*x00.*zero byte"),
    "weapon unknown": (words_of("--weapon", "bean", "--at", "1,2"), "weapon: .*got 'bean' .did you mean 'beam'"),
    "weapon of no name": (words_of("--weapon", "", "--at", "1,2"), "weapon: expected a text of .*got ''"),
    "at missing": (words_of("--weapon", "laser"), "--at: expected X,Y with --weapon, got nothing"),
    "at without weapon": (words_of("--at", "1,2"), "--at: expected only together with --weapon"),
    "seed without weapon": (words_of("--seed", "1"), "--seed: expected only together with --weapon"),
    "at, empty": (words_of("--weapon", "laser", "--at", ""), "--at: expected two numbers X,Y, got ''"),
    "at, hole": (words_of("--weapon", "laser", "--at", "1,,2"), "--at: expected two numbers X,Y, got '1,,2'"),
    "at, words": (words_of("--weapon", "laser", "--at", "a,b"), "--at: expected two numbers X,Y, got 'a,b'"),
    "at, three": (words_of("--weapon", "laser", "--at", "1,2,3"), "--at: expected two numbers X,Y, got '1,2,3'"),
    "at, NaN": (words_of("--weapon", "laser", "--at", "nan,2"), r"at\[0\]: expected a finite number, got nan"),
    "at, 1e999": (words_of("--weapon", "laser", "--at", "1,1e999"), r"at\[1\]: expected a finite number, got inf"),
    "at, 1e13": (words_of("--weapon", "laser", "--at", "1e13,2"), r"at\[0\]: expected a number within ±1099511627776"),
    "aim, infinite": (words_of(*ONE, "--aim", "inf"), "aim: expected a finite number, got inf"),
    "aim, 1e10": (words_of(*ONE, "--aim", "1e10"), "aim: expected a number from -1000000000 to 1000000000"),
    "seed, negative": (words_of(*ONE, "--seed", "-1"), "seed: expected a whole number from 0 .*got -1"),
    "seed, 2^64": (
        words_of(*ONE, "--seed", str(2**64)), "seed: expected a whole number from 0 .*got 18446744073709551616"),
    "output, no name": (words_of("-o", ""), "output: cannot write .: expected the name of a file"),
    "output, a folder": (words_of("-o", "folder.png"), "output: cannot write folder.png: expected the name of a file"),
    "output, a pipe": (words_of("-o", "pipe.png"), "output: cannot write pipe.png: expected the name of a file"),
    "output, no folder": (words_of("-o", "no/r.png"), "output: cannot write no/r.png: no folder no"),
    "output, below a file": (words_of("-o", "old.png/r.png"), "output: cannot write old.png/r.png"),
    "output, 300 characters": (words_of("-o", "x" * 300 + ".png"), "output: cannot write xxx.*: File name too long"),
    "output, 250 characters": (words_of("-o", "x" * 246 + ".png"), "output: cannot write xxx.*: File name too long"),
    "output, zero byte": (words_of("-o", "a\0.png"), "output: expected a path, got .*zero byte"),
    "output, JPEG": (words_of("-o", "r.jpg"), "--output: expected a name that ends in .png, got 'r.jpg'"),
    "output, dot behind": (words_of("-o", "r.png."), "--output: expected a name that ends in .png"),
    "facts, no name": (words_of("--json", "."), r"output: cannot write \.: expected the name of a file"),
    "facts, a pipe": (words_of("--json", "pipe.png"), "output: cannot write pipe.png: expected the name of a file"),
    "facts, a device": (words_of("--json", "device"), "output: cannot write device: expected the name of a file"),
    "facts, 300 characters": (words_of("--json", "x" * 300), "output: cannot write xxx.*: File name too long"),
    "facts over the picture": (words_of("-o", "r.png", "--json", "./r.png"), "--json: expected another file"),
    "facts over the picture by a link": (words_of("-o", "old.png", "--json", "link.png"), "--json: expected another"),
}  # fmt: skip

WORDS_NOT_YET = [
    pytest.param([], "COMMAND", id="no command"),
    pytest.param(["rapport"], "'rapport'", id="command unknown"),
    pytest.param(["report"], "SCENE", id="no scene"),
    pytest.param(["report", "a", "b"], "b", id="two scenes"),
    pytest.param(words_of("--bogus"), "--bogus", id="option unknown"),
    pytest.param(words_of("--at"), "--at", id="option without its value"),
    pytest.param(words_of(*ONE, "--aim", "north"), "--aim", id="aim, a word"),
    pytest.param(words_of(*ONE, "--seed", "1.5"), "--seed", id="seed, half"),
    pytest.param(words_of(*ONE, "--seed", "9" * 5000), "--seed", id="seed, 5000 digits"),
    pytest.param(words_of("-o", "r.png", "--json", "loop.json"), "--json|output", id="facts, link to itself"),
]


@pytest.mark.parametrize(("words", "told"), [*(pytest.param(*row, id=name) for name, row in WORDS.items()),
                                             *WORDS_NOT_YET])  # fmt: skip
def test_bad_words_are_one_line(
    words: list[str], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder.png").mkdir()
    Path("old.png").write_text("old")
    Path("link.png").symlink_to("old.png")
    Path("loop.json").symlink_to("loop.json")
    Path("device").symlink_to("/dev/null")  # refused before it is opened
    os.mkfifo("pipe.png")
    before = sorted(tmp_path.iterdir())
    refused(words, told, capfd)
    assert sorted(tmp_path.iterdir()) == before
    assert Path("old.png").read_text() == "old" and Path("pipe.png").is_fifo()


# What cannot be read


def test_an_image_that_is_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"got 'a.png', which is a folder, a pipe or a device"):
        read_png(tmp_path / "a.png")


def test_a_scene_that_is_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "scene.json")
    import signal

    signal.setitimer(signal.ITIMER_REAL, 1)
    with pytest.raises(InputError):
        load_scene(tmp_path)


@pytest.mark.parametrize("name", ["folder", "loop"])
def test_a_scene_that_is_no_file_is_named(name: str, tmp_path: Path) -> None:
    place = tmp_path / "scene.json"
    place.mkdir() if name == "folder" else place.symlink_to("scene.json")
    with pytest.raises(InputError, match=r"scene\.json: cannot read it: (Is a directory|Too many levels)"):
        load_scene(tmp_path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read and write everything")
def test_a_file_or_folder_without_permission_is_named(tmp_path: Path) -> None:
    write_text(tmp_path / "a.png", "")
    (tmp_path / "a.png").chmod(0)
    with pytest.raises(InputError, match="Permission denied"):
        read_png(tmp_path / "a.png")
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match=r"output: cannot write .*Permission denied"):
        write_text(tmp_path / "b.txt", "text")
    tmp_path.chmod(0o700)


# What cannot be written


OLD = b"the old report"
STEPS = ("write_bytes", "replace")
ENDS: dict[str, Callable[[], BaseException]] = {
    "interrupt": KeyboardInterrupt,
    "full": lambda: OSError(28, "No space left on device"),
    "memory": MemoryError,
}


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize(("step", "after"), [("write_bytes", False), ("write_bytes", True), ("replace", False)])
@pytest.mark.parametrize("written", ["r.png", "r.json"])
def test_a_report_that_is_stopped_leaves_the_old_one(
    written: str, step: str, after: bool, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """At each write: what was there is whole, what is new is whole, and no part is left."""
    scene, out = tmp_path / "scene", tmp_path / "out"
    scene.mkdir()
    (scene / "scene.json").write_text(json.dumps(PLAIN))
    out.mkdir()
    for name in ("r.png", "r.json"):
        (out / name).write_bytes(OLD)
    done = getattr(Path, step)

    def stopped(self: Path, *arguments: Any) -> Any:
        if not self.name.startswith(written):
            return done(self, *arguments)
        if after:
            done(self, *(a[: len(a) // 2] for a in arguments))
        raise ENDS[end]()

    monkeypatch.setattr(Path, step, stopped)
    words = ["report", str(scene), "-o", str(out / "r.png"), "--json", str(out / "r.json")]
    try:
        code, error = command(words, capfd)
    except MemoryError:
        code, error = 1, "\n"
    assert code == {"interrupt": 130, "full": 2, "memory": 1}[end]
    assert error.count("\n") == 1
    assert sorted(p.name for p in out.iterdir()) == ["r.json", "r.png"]
    assert (out / written).read_bytes() == OLD
    if written == "r.json":
        assert read_png(out / "r.png").shape[2] == 4


@pytest.mark.parametrize("step", STEPS)
def test_a_scene_whose_saving_is_stopped_is_the_old_one(
    step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every write in turn is interrupted; whatever was written before, the folder is the old scene."""
    load_scene(GALLERY).save(tmp_path)
    old = load_scene(tmp_path)
    new = load_scene(tmp_path)
    rng = np.random.default_rng(2)
    new.remove(0)
    for size in (70, 80):
        new.add(rng.integers(0, 256, (size, size, 4)).astype(np.uint8), (30, 40))
    done = getattr(Path, step)
    for stop in range(10):
        writes = 0

        def stopped(self: Path, *arguments: Any, stop: int = stop) -> Any:
            nonlocal writes
            writes += 1
            if writes > stop:
                raise KeyboardInterrupt
            return done(self, *arguments)

        monkeypatch.setattr(Path, step, stopped)
        try:
            new.save(tmp_path)
        except KeyboardInterrupt:
            monkeypatch.undo()
            assert load_scene(tmp_path).content_hash() == old.content_hash()
            assert not list(tmp_path.glob("*.part"))
        else:
            break
    assert stop > 0
    assert load_scene(tmp_path).content_hash() == new.content_hash()


def in_process(code: str, *words: str, stdout: Any = subprocess.PIPE) -> subprocess.CompletedProcess[str]:
    run = [sys.executable, "-W", "error", "-c", code, *words]
    return subprocess.run(run, cwd=ROOT, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False, timeout=60)


REPORT = "import sys; from hitplanes.weapons.cli.command import main; sys.exit(main(sys.argv[1:]))"


def test_a_full_disk_leaves_the_old_report(tmp_path: Path) -> None:
    """The kernel lets no file of the process grow beyond 20 kB."""
    for name in ("r.png", "r.json"):
        (tmp_path / name).write_bytes(OLD)
    limit = f"import resource; resource.setrlimit({resource.RLIMIT_FSIZE}, (20_000, 20_000)); "
    limited = "import sys; sys.dont_write_bytecode = True; " + limit + REPORT  # one cut short would spoil later runs
    words = ["report", str(GALLERY), "-o", str(tmp_path / "r.png"), "--json", str(tmp_path / "r.json")]
    run = in_process(limited, *words)
    assert run.returncode == 2 and re.fullmatch(r"hitplanes: output: cannot write .*: File too large\n", run.stderr)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.json", "r.png"]
    assert all(path.read_bytes() == OLD for path in tmp_path.iterdir())


@pytest.mark.parametrize("channels", [3, 4])
def test_writers_of_one_file_at_once_leave_one_of_theirs(channels: int, tmp_path: Path) -> None:
    place = tmp_path / "r.png"
    images = [np.full((60, 50, channels), shade, np.uint8) for shade in range(8)]
    failed: list[BaseException] = []

    def write(image: np.ndarray) -> None:
        try:
            for _ in range(25):
                write_png(place, image)
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=write, args=(image,)) for image in images]
    for thread in threads:
        thread.start()
    seen = {int(read_png(place)[0, 0, 0]) for _ in range(200) if place.exists()}
    for thread in threads:
        thread.join()
    assert not failed
    assert seen <= set(range(8))
    assert list(tmp_path.iterdir()) == [place]
    assert len(np.unique(read_png(place)[:, :, :3])) == 1


def test_processes_that_write_one_report_at_once_leave_a_whole_one(tmp_path: Path) -> None:
    words = ["report", str(GALLERY), "-o", str(tmp_path / "r.png"), "--json", str(tmp_path / "r.json")]
    run = [sys.executable, "-c", REPORT, *words]
    both = [subprocess.Popen(run, cwd=ROOT, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [process.wait(60) for process in both] == [0, 0]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.json", "r.png"]
    assert json.loads((tmp_path / "r.json").read_text())["shots"] and read_png(tmp_path / "r.png").shape[2] == 4


@pytest.mark.parametrize("name", ["", ".", "..", "/", "a\0b", "x" * 300, "no/r.png"])
def test_a_place_for_no_file_is_named_before_any_work(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for call in (check_output, lambda path: write_text(path, "text")):
        with pytest.raises(InputError, match=r"output: cannot write|output: expected a path, got .*zero byte"):
            call(Path(name))
    assert not list(tmp_path.iterdir())


def test_a_file_keeps_the_usual_permissions(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "text")
    (tmp_path / "b.txt").write_text("text")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


# What a scene that was made in Python may bring to a file


NOT_SAVED: dict[str, tuple[Callable[[Scene], object], str]] = {
    "name": (lambda s: setattr(s, "name", ""), "name: expected a text of 1 to 200 characters, got ''"),
    "name, number": (lambda s: setattr(s, "name", 5), "name: expected a text of 1 to 200 characters, got 5"),
    "weapons, list": (lambda s: setattr(s, "weapons", []), r"weapons: expected an object, got \[\]"),
    "shots, object": (lambda s: setattr(s, "shots", {}), r"shots: expected a list, got \{\}"),
    "weapon, a class": (
        lambda s: s.weapons.update(gun=Disc), r"^weapons\.gun: .* got <class .*Disc'>: Object of type"),
    "weapon, an object": (
        lambda s: s.weapons.update(gun=Sprite), r"^weapons\.gun: expected plain JSON, got <class .*Sprite"),
    "weapon, one of Python": (
        lambda s: s.weapons.update(gun=Disc(3)),
        r"^weapons\.gun: expected plain JSON, got Disc\(radius=3\.0\): give what its to_json\(\) returns$"),
    "shot, hits": (
        lambda s: s.shots.append(fire(s, Disc(3), (9, 9))),
        r"^shots\[7\]: expected plain JSON, got <Hits: .*: give what its to_shot\(\) returns$"),
    "pellet, one of Python": (
        lambda s: s.weapons.update(gun={"kind": "spread", "pellet": Disc(2)}),
        r"^weapons\.gun: expected plain JSON, got .*: Object of type Disc is not JSON"),
    "weapon, NaN": (lambda s: s.weapons.update(gun=float("nan")), r"^weapons\.gun: expected plain JSON, got"),
    "weapon, numpy's": (lambda s: s.weapons.update(gun=np.int64(1)), r"^weapons\.gun: expected plain JSON, got"),
    "weapon, 5000 digits": (lambda s: s.weapons.update(gun=10**5000), r"^weapons\.gun: expected plain JSON, got"),
    "weapon in itself": (lambda s: s.weapons.update(gun=s.weapons), r"^weapons\.gun: expected plain JSON, got"),
    "weapon's name, a pair": (
        lambda s: s.weapons.update({(1, 2): 3}), r"^weapons: key: expected a text .* got \(1, 2\)"),
    "shot, a set": (lambda s: s.shots.append({1}), r"^shots\[7\]: expected plain JSON, got \{1\}: Object of type set"),
}  # fmt: skip

DEEP: list[Any] = []
for _ in range(10**5):
    DEEP = [DEEP]
NOT_SAVED_YET = [
    pytest.param(lambda s: s.shots.append(DEEP), r"^shots\[7\]: expected plain JSON, got",
          id="shot, 10^5 deep"),
    pytest.param(lambda s: s.weapons.update({i: {"kind": "point"} for i in range(9)}),
          "weapons", id="weapons' names, numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "told"), [*(pytest.param(*row, id=name) for name, row in NOT_SAVED.items()),
                                              *NOT_SAVED_YET])  # fmt: skip
def test_a_scene_that_could_not_be_read_is_not_written(
    change: Callable[[Scene], object], told: str, tmp_path: Path
) -> None:
    scene = load_scene(GALLERY)
    scene.save(tmp_path)
    before = (tmp_path / "scene.json").read_bytes()
    change(scene)
    with pytest.raises(InputError, match=told):
        scene.save(tmp_path)
    assert (tmp_path / "scene.json").read_bytes() == before
    with pytest.raises(InputError, match=told):
        scene.save(tmp_path / "new")
    assert not (tmp_path / "new").exists()


# What is told to a terminal, a pipe and a full disk


def report_of(
    folder: Path, tmp_path: Path, environment: dict[str, str], stdout: Any
) -> subprocess.CompletedProcess[str]:
    run = [sys.executable, "-c", REPORT, "report", str(folder), "-o", str(tmp_path / "r.png")]
    env = {**os.environ, **environment}
    return subprocess.run(
        run, cwd=ROOT, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False, timeout=60, env=env
    )


def test_names_that_a_terminal_cannot_show_are_told(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_text(json.dumps(changed(f"{DUCK}.name", "énte 鴨")))
    run = report_of(tmp_path, tmp_path, {"PYTHONIOENCODING": "ascii"}, subprocess.PIPE)
    assert run.returncode == 0 and run.stderr == ""


def test_a_full_standard_output_is_one_line(tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        run = report_of(GALLERY, tmp_path, {}, full)
    assert run.returncode == 2 and run.stderr.startswith("hitplanes: ") and run.stderr.count("\n") == 1


def test_a_reader_that_has_gone_is_no_traceback(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        run = report_of(GALLERY, tmp_path, {}, writer)
    finally:
        os.close(writer)
    assert run.stderr.count("\n") <= 1


def test_a_weapon_named_by_half_a_character_is_one_line(tmp_path: Path) -> None:
    data = changed(SHOT, {"weapon": "\ud800", "at": [16, 10]})
    data["weapons"]["\ud800"] = {"kind": "point"}
    (tmp_path / "scene.json").write_text(json.dumps(data))
    run = report_of(tmp_path, tmp_path, {}, subprocess.PIPE)
    assert run.returncode == 2 and run.stderr.count("\n") == 1


def test_a_name_cannot_speak_to_the_terminal(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.json").write_text(json.dumps(changed(f"{DUCK}.name", "a\nb\x1b[31m")))
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "r.png")]) == 0
    assert "\x1b" not in (out := capfd.readouterr().out) and out.count("\n") == 1


HOSTILE = "a\n\x1b\x7f\x9b\u2028\u202e\u2066\u061c"


def test_no_name_of_anything_speaks_to_the_terminal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path(HOSTILE)
    folder.mkdir()
    for x in (16, 17):
        data = changed(f"{DUCK}.name", HOSTILE)
        data["name"] = HOSTILE
        data["weapons"][HOSTILE] = {"kind": "point"}
        data["shots"] = [{"weapon": HOSTILE, "at": [x, 10]}]
        (folder / "scene.json").write_text(json.dumps(data))
        assert main(["report", HOSTILE, "-o", f"{HOSTILE}.png", "--json", f"{HOSTILE}{x}.json"]) == 0
    (folder / "log.jsonl").write_text(json.dumps({"weapon": HOSTILE, "at": [16, 10]}) + "\n")
    hits = f"{HOSTILE}.jsonl"
    assert main(["fire", HOSTILE, f"{HOSTILE}/log.jsonl", "-o", hits, "--plan"]) == 0
    assert main(["compare", f"{HOSTILE}16.json", f"{HOSTILE}17.json"]) == 1
    assert main(["compare", f"{HOSTILE}16.json", f"{HOSTILE}18.json"]) == 2
    assert main(["report", HOSTILE, "--weapon", "b", "--at", "1,2"]) == 2
    assert main(["new", HOSTILE]) == 2
    (folder / "log.jsonl").write_text(json.dumps({"weapon": HOSTILE, "at": [16, 10]}) + "\n" + "no\n")
    assert main(["fire", HOSTILE, f"{HOSTILE}/log.jsonl", "-o", hits]) == 2
    assert main(["fire", HOSTILE, f"{HOSTILE}/log.jsonl", "-o", hits]) == 2  # it goes on, and says so
    monkeypatch.setattr("hitplanes.weapons.replay.stream._chunks", interrupt)
    assert main(["fire", HOSTILE, f"{HOSTILE}/log.jsonl", "-o", hits]) == 130
    with pytest.raises(SystemExit):
        main(["report", "x", HOSTILE])
    told = capfd.readouterr()
    assert all(line.isprintable() for line in told.out.split("\n") + told.err.split("\n"))
    assert "going on after them" in told.err and "is kept" in told.err


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def test_an_output_that_another_writer_makes_meanwhile_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is looked at once: what was not there a moment ago and is there now is still the name of a file."""
    place, look = tmp_path / "r.png", Path.stat

    def stat(path: Path, **how: bool) -> os.stat_result:
        try:
            return look(path, **how)
        finally:
            if path == place:
                place.write_bytes(b"by another")

    monkeypatch.setattr(Path, "stat", stat)
    write_png(place, np.zeros((3, 3, 3), np.uint8))
    monkeypatch.undo()
    assert read_png(place).shape == (3, 3, 4)
