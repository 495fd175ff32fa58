"""Bad input, row by row: each names its field and what came, nothing crashes, hangs, changes or is half written."""

from __future__ import annotations

import io
import math
import pickle
import re
import threading
from collections.abc import Callable
from contextlib import suppress
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from hitplanes import (  # fmt: skip
    Beam,
    Box,
    Cone,
    Disc,
    History,
    InputError,
    Laser,
    Pistol,
    Point,
    Polygon,
    Ring,
    Rounds,
    Scene,
    ShotRecord,
    Spans,
    Spread,
    Sprite,
    Stencil,
    Sweep,
    fire,
    load_scene,
    picture_of_report,
    prepare,
    read_png,
    replay,
    report_of,
    sees,
    use_jit,
    weapon_from_json,
    weapons_of,
    write_png,
)
from hitplanes.planes.common.checks import choice
from hitplanes.weapons.cli.report_file import read_report
from hitplanes.weapons.cli.starter import write_starter
from hitplanes.weapons.lab.demo import moments, write_demo, write_frames, write_gif
from hitplanes.weapons.lab.stability.stability import load_study, run_stability
from hitplanes.weapons.lab.study.study import Effort, write_study
from hitplanes.weapons.replay.shot_log import requests_of
from hitplanes.weapons.replay.stream import Progress, fire_log

GALLERY = Path(__file__).parents[1] / "fixtures" / "gallery"
TRIANGLE = [(0, 0), (9, 0), (0, 9)]
DIGITS = 10**5000
DEEP: list[Any] = []
for _ in range(10**5):
    DEEP = [DEEP]

pytestmark = pytest.mark.usefixtures("bounded")


def world() -> Scene:
    """A duck (0), a wall in front of its lower half (1), and what was removed (2)."""
    scene = Scene((64, 40), categories=["target", "friend"])
    scene.add(Sprite.circle(8), (32, 20), name="duck", categories=["target"])
    scene.add(Sprite.box(20, 6), (32, 26), role="occluder", name="wall")
    scene.remove(scene.add(np.ones((3, 3), bool), (5, 5), name="gone"))
    return scene


def of_two_frames() -> Scene:
    scene = Scene()
    scene.add(Sprite.from_images([np.full((4, 4, 4), 255, np.uint8)] * 2), frame=1)
    return scene


def crowd() -> Scene:
    scene = Scene()
    for number in range(30):
        scene.add(Sprite.circle(1), name=str(number))
    return scene


def shot(**given: Any) -> Any:
    return fire(world(), given.pop("weapon", Disc(3)), given.pop("at", (32, 20)), **given)


def sheet(width: int = 4, height: int = 3) -> np.ndarray:
    return np.full((height, width, 4), 200, np.uint8)


def huge(value: Any, *shape: int) -> np.ndarray:
    """Large, and not in memory."""
    return np.broadcast_to(np.asarray(value), shape)


class Thing:
    """What is no number."""


masked = np.ma.array([[1.0, 2.0], [3.0, 4.0]], mask=[[0, 0], [0, 1]])

ARRAYS: dict[str, tuple[Any, str]] = {
    "None": (None, "at: expected numbers, got None"),
    "text": ("12", "at: expected numbers, got '12'"),
    "a text among numbers": ([1, "x"], r"at: expected numbers, got \[1, 'x'\]"),
    "bytes": (b"12", "at: expected numbers, got b'12'"),
    "object": (Thing(), "at: expected numbers, got <"),
    "dict": ({"x": 1, "y": 2}, r"at: expected numbers, got \{'x': 1, 'y': 2\}"),
    "set": ({1, 2}, r"at: expected numbers, got \{1, 2\}"),
    "generator": ((v for v in (1, 2)), "at: expected numbers, got <generator"),
    "decimals": ([Decimal(1), Decimal(2)], "at: expected numbers, got .*Decimal"),
    "one number": (5, r"at: expected shape \(any, 2\), got \(\)"),
    "empty row": ([[]], r"at: expected shape \(any, 2\), got \(1, 0\)"),
    "three numbers": ((1, 2, 3), r"at: expected shape \(2,\) or \(any, 2\), got \(3,\)"),
    "columns for rows": (np.zeros((2, 5)), r"at: expected shape \(any, 2\), got \(2, 5\)"),
    "three dimensions": (np.zeros((1, 1, 2)), r"at: expected shape \(any, 2\), got \(1, 1, 2\)"),
    "ragged": ([(1, 2), (3,)], r"at: expected an array with rows of one length, got \[\(1, 2\), \(3,\)\]"),
    "ragged arrays": ([np.zeros((2, 2)), np.zeros((2, 1))], r"at: expected an array with rows of one length, got"),
    "ragged deep": ([1, [2]], r"at: expected an array with rows of one length, got \[1, \[2\]\]"),
    "in itself": ((loop := [1], loop.append(loop), loop)[2], r"at: expected an array .*, got \[1, \[1, \["),
    "10^5 deep": (DEEP, r"at: expected an array, got \[\[\["),
    "5000 digits": ((1, DIGITS), r"at\[1\]: expected a number within ±1099511627776, got a int that"),
    "400 digits": ((1, -(10**400)), r"at\[1\]: expected a number within ±1099511627776, got -1000"),
    "40 digits": ([(1, 2), (10**40, 2)], r"at\[1\]\[0\]: expected a number within ±1099511627776, got 1000"),
    "true beside 40 digits": ((True, 10**40), r"at: expected numbers, got \[True, 1000"),
    "NaN": ((1, math.nan), r"at\[1\]: expected a finite number, got nan"),
    "NaN in a batch": ([(1, 2), (math.nan, 4)], r"at\[1\]\[0\]: expected a finite number, got nan"),
    "infinite": ((math.inf, 1), r"at\[0\]: expected a finite number, got inf"),
    "true": (True, "at: expected numbers, got True"),
    "two booleans": ((True, False), r"at: expected numbers, got \[True, False\]"),
    "true beside a number": ([True, 2], r"at\[0\]: expected a number like the others, got True"),
    "false beside a float": ([(1.5, 2.5), (3.5, False)], r"at\[1\]\[1\]: expected a number like the others, got False"),
    "numpy's true beside a number": ([np.True_, 2], r"at\[0\]: expected a number like the others"),
    "booleans in an array in a list": ([np.array([True, True]), (1, 2)], r"at\[0\]: expected a number like the others"),
    "boolean array": (np.ones((1, 2), bool), r"at: expected numbers, got \[\[True, True\]\]"),
    "object array": (np.array([1, 2], object), r"at: expected numbers, got \[1, 2\]"),
    "text array": (np.array(["1", "2"]), r"at: expected numbers, got \['1', '2'\]"),
    "array of new texts": (np.array(["1", "2"], np.dtypes.StringDType()), "at: expected numbers, got"),
    "bytes array": (np.array([b"1", b"2"]), "at: expected numbers, got"),
    "complex": (np.array([1, 2j]), r"at: expected numbers, got \[\(1\+0j\), 2j\]"),
    "empty complex": (np.zeros((0, 2), complex), "at: expected numbers"),
    "dates": (np.array(["2020-01-01", "NaT"], "M8[D]"), "at: expected numbers"),
    "no dates": (np.zeros((0, 2), "M8[s]"), "at: expected numbers"),
    "times": (np.array([1, 2], "m8[s]"), "at: expected numbers"),
    "records": (np.zeros(2, "i4,f8"), r"at: expected numbers, got \[\(0, 0.0\)"),
    "no records": (np.zeros((0, 2), "i4,f8"), "at: expected numbers"),
    "no texts": (np.zeros((0, 2), "U1"), "at: expected numbers"),
    "masked": (masked, r"at\[1\]\[1\]: expected a value, got a masked one"),
    "masked in a list": ([masked[0], masked[1]], r"at\[1\]\[1\]: expected a value, got a masked one"),
    "masked number": (np.ma.masked, "at: expected a value, got a masked one"),
    "float16 infinity": (np.array([1, np.inf], np.float16), r"at\[1\]: expected a finite number, got inf"),
    "too long a double": (np.array([1, np.longdouble("1e4000")]), r"at\[1\]: expected a (finite )?number"),
    "uint64": (np.array([2**64 - 1, 1], np.uint64), r"at\[0\]: expected a number within ±1099511627776"),
}  # fmt: skip

CALLS: dict[str, tuple[Callable[[], object], str]] = {
    # the scene
    "size of zero": (lambda: Scene((0, 5)), r"size_wh\[0\]: expected a whole number from 1 .*, got 0"),
    "size of half a pixel": (lambda: Scene((5, 0.5)), r"size_wh\[1\]: expected a whole number from 1 .*, got 0.5"),
    "size of true": (lambda: Scene((True, 5)), r"size_wh\[0\]: expected a number like the others, got True"),
    "size as two arguments": (lambda: Scene(5, 5), r"size_wh: expected shape \(2,\), got \(\)"),  # type: ignore[arg-type]
    "size of one number": (lambda: Scene(5), r"size_wh: expected shape \(2,\), got \(\)"),
    "planes of a world too large": (lambda: Scene((10**9, 10**9)).planes(), "bounds: expected a plane of sides up to"),
    "scene's name": (lambda: Scene(name=5), "name: expected a text of 1 to 200 characters, got 5"),
    "scene's name, surrogate": (lambda: Scene(name="\ud800"), r"name: expected a text .*got '\\ud800'"),
    "categories, one text": (lambda: Scene(categories="target"), "categories: expected a list of names, got 'target'"),
    "categories, number": (lambda: Scene(categories=3), "categories: expected a list of names, got 3"),
    "categories, array of no dimension": (
        lambda: Scene(categories=np.array(3)), "categories: expected a list of names"),
    "category, number": (lambda: Scene(categories=["a", 5]), r"categories\[1\]: expected a text .*got 5"),
    "categories, too many": (lambda: Scene(categories=map(str, range(32))), "categories: expected at most 31 .*got 32"),
    "categories, twice": (lambda: Scene(categories=["a", "a"]), "categories: expected distinct names"),
    # add
    "sprite, None": (lambda: world().add(None), "sprite: expected a Sprite, a mask .*got NoneType"),
    "sprite, number": (lambda: world().add(7), "sprite: expected a Sprite, a mask .*got int"),
    "sprite, four dimensions": (lambda: world().add(np.zeros((1, 1, 1, 1))), r"sprite: .*got \(1, 1, 1, 1\)"),
    "sprite, 10^5 deep": (lambda: world().add(DEEP), r"sprite: expected an array, got \[\[\["),
    "sprite made by hand": (lambda: world().add(Sprite(())), "sprite: expected one that a class method made"),
    "sprite of float pixels": (lambda: world().add(sheet() / 255), "^sprite: image: expected bytes .*float64"),
    "sprite of twos": (lambda: world().add([[0, 2]]), r"^sprite: mask\[0\]\[1\]: expected 0 or 1, got 2"),
    "sprite of booleans in three planes": (
        lambda: world().add(np.ones((2, 2, 3), bool)), "image: expected bytes .*bool"),
    "position with a masked value": (lambda: world().add(Sprite.circle(1), masked[1]), r"position_xy\[1\]: .*masked"),
    "mask, ragged": (
        lambda: Sprite.from_mask([[1, 0], [1]]),
        r"mask: expected an array with rows of one length, got \[\[1, 0\], \[1\]\]"),
    "move, ragged": (
        lambda: world().move([0, 1], [[1, 2], [3]]), r"xy: expected an array with rows of one length, got"),
    "role": (lambda: world().add(Sprite.circle(1), role="ocluder"), "role: .*got 'ocluder' .did you mean 'occluder'"),
    "role, number": (lambda: world().add(Sprite.circle(1), role=3), "role: expected one of .*got 3"),
    "angle, text": (lambda: world().add(Sprite.circle(1), angle="90"), "angle: expected a number, got '90'"),
    "scale, three": (
        lambda: world().add(Sprite.circle(1), scale=(1, 2, 3)), r"scale: expected shape \(2,\), got \(3,\)"),
    "scale, zero": (lambda: world().add(Sprite.circle(1), scale=0), r"scale\[0\]: expected a number from 0.00390625"),
    "scale of a mask that gets too large": (
        lambda: world().add(np.ones((2000, 2000), bool), scale=256), "scale: expected a mask of sides up to 32768"),
    "flip": (lambda: world().add(Sprite.circle(1), flip="left"), "flip: expected one of .*got 'left'"),
    "flip, deep": (lambda: world().add(Sprite.circle(1), flip=DEEP), "flip: expected one of"),
    "frame": (lambda: world().add(Sprite.circle(1), frame=1), "frame: expected a whole number from 0 to 0, got 1"),
    "layer": (lambda: world().add(Sprite.circle(1), layer=1.5), "layer: expected a whole number .*got 1.5"),
    "layer, true": (lambda: world().add(Sprite.circle(1), layer=True), "layer: expected a whole number .*got True"),
    "layer, 5000 digits": (lambda: world().add(Sprite.circle(1), layer=DIGITS), "layer: .*got a int that is too long"),
    "category, unknown": (
        lambda: world().add(Sprite.circle(1), categories=["targte"]),
        "categories: .*got 'targte' .did you mean 'target'"),
    "frame, a name of frames that have none": (
        lambda: world().set(0, frame="run"),
        "frame: expected a number from 0 to 0, as the frames have no names, got 'run'"),
    "accept, a wrong name of a shot": (
        lambda: fire(world(), Disc(1), [(0, 0)] * 2, accept=[["friend"], ["freind"]]),
        r"accept\[1\]: .*got 'freind' .did you mean 'friend'"),
    "categories, negative bits": (lambda: world().add(Sprite.circle(1), categories=-1), "categories: .*got -1"),
    "categories, true": (lambda: world().add(Sprite.circle(1), categories=True), "categories: .*got True"),
    "categories, bits of no dimension": (
        lambda: world().add(Sprite.circle(1), categories=np.array(3)), "categories: expected bits or a list"),
    "owner to come": (
        lambda: world().add(Sprite.circle(1), owner=9), "owner: expected a whole number from 0 to 2, got 9"),
    "name, too long": (lambda: world().add(Sprite.circle(1), name="x" * 201), "name: expected a text of 1 to 200"),
    # change, remove, ask
    "ids, None": (lambda: world().position(None), "^ids: expected a number, got None$"),  # type: ignore[arg-type]
    "ids, true": (lambda: world().remove(True), "^ids: expected a number, got True$"),
    "scale, a text": (lambda: world().add(Sprite.circle(1), scale="x"), "^scale: expected a number, got 'x'$"),
    "scale of a set, a text": (lambda: world().set(0, scale="x"), "^scale: expected a number, got 'x'$"),
    "layer of a set, true": (lambda: world().set(0, layer=True), "^layer: expected a number, got True$"),
    "ids, negative": (lambda: world().move(-1, (0, 0)), r"ids: expected a whole number from 0 to 2, got -1"),
    "ids, removed": (
        lambda: world().remove([0, 2]),
        r"ids\[1\]: expected an object in the scene, got 2, which was removed; the nearest are \[1\]$"),
    "no near name": (lambda: choice("name", "fast", ["cast", "walk"]), "expected one of 'cast', 'walk', got 'fast'$"),
    "ids, twice": (lambda: world().remove([0, 1, 0]), r"ids\[2\]: expected each object once, got 0 again"),
    "ids, booleans": (lambda: world().remove([True, False]), r"ids: expected numbers, got \[True, False\]"),
    "ids, a name": (lambda: world().remove("duck"), r"ids: expected ids, got .duck.: scene\.find\(name\) is"),
    "ids, masked": (lambda: world().remove(np.ma.array([0, 1], mask=[0, 1])), r"ids\[1\]: expected a value, got a m"),
    "ids, two dimensions": (lambda: world().remove([[0, 1]]), r"ids: expected shape \(any,\), got \(1, 2\)"),
    "ids, float16 NaN": (lambda: world().remove(np.array([0, np.nan], np.float16)), r"ids\[1\]: expected a whole"),
    "positions, too few": (
        lambda: world().move([0, 1], [(1, 2)]), r"^xy: expected shape \(2, 2\), got \(1, 2\)"),
    "position, masked": (
        lambda: world().move([0, 1], masked), r"^xy\[1\]\[1\]: expected a value, got a masked"),
    "position of one for all": (lambda: world().move([0, 1], (3, math.inf)), r"^xy\[1\]: expected a finite"),
    "layer of a row": (
        lambda: world().set([0, 1], layer=[1, 2**31]), r"layer\[1\]: expected a whole number .*2147483648"),
    "layers in float16": (lambda: world().set([0, 1], layer=np.array([1, 0.5], np.float16)), r"layer\[1\]: .*got 0.5"),
    "flip of a row": (lambda: world().set([0, 1], flip=["x", "z"]), "row 1: flip: expected one of .*got 'z'"),
    "flips, too many": (lambda: world().set([0, 1], flip=["x"] * 3), "flip: expected one for all or 2, got 3"),
    "frame of a row": (lambda: world().set([0, 1], frame=[0, 1]), "row 1: frame: .*got 1"),
    "scale of a row": (lambda: world().set([0, 1], scale=[1, 300]), r"row 1: scale\[0\]: .*got 300"),
    "role of a set": (lambda: world().set(0, role="hud "), "role: expected one of .*did you mean 'hud'"),
    "categories of a set, no dimension": (
        lambda: world().set(0, categories=np.array(1.5)), "categories: expected bits"),
    "owner of a set": (lambda: world().set(0, owner=3), "owner.*: expected a whole number from 0 to 2, got 3"),
    "find": (lambda: world().find("dukc"), "name: expected one of 'duck', 'wall', got 'dukc' .did you mean 'duck'"),
    "find, removed": (lambda: world().find("gone"), "name: expected one of 'duck', 'wall', got 'gone'"),
    "find, None": (lambda: world().find(None), "name: expected one of .*got None"),  # type: ignore[arg-type]
    "find, a book": (lambda: world().find("duc" * 10**6), r"name: expected one of .*got 'ducduc.*\.\.\."),
    "find among many": (lambda: crowd().find("30"), "name: expected one of '0', '1', .*'19' and 10 more, got '30'"),
    "mask of what was removed": (lambda: world().mask(2), "expected an object in the scene, got 2, which was removed"),
    "mask of true": (lambda: world().mask(True), "^item: expected a whole number from 0 to 2, got True"),
    "name of nothing": (lambda: world().name_of(3), "^item: expected a whole number from 0 to 2, got 3"),
    "a row of categories": (
        lambda: world().add(Sprite.circle(1), categories=np.array([[1, 2]])), "categories: expected one of"),
    "a sprite without the frame": (
        lambda: of_two_frames().set(0, sprite=Sprite.circle(4)),
        "row 0: frame: expected one of the new sprite, as the object shows frame 1, and its new sprite has 1"),
    "bits of a category": (lambda: world().category_bits("freind"), "category: .*did you mean 'friend'"),
    "bits of a number": (
        lambda: world().category_bits(1), "category: expected one of .*got 1"),  # type: ignore[arg-type]
    "ids of a role": (lambda: world().ids("ducks"), "role: expected one of .*got 'ducks'"),
    # whole planes
    "planes, none": (Scene.from_planes, "planes: expected one or more"),
    "planes, two sizes": (
        lambda: Scene.from_planes(hittable=np.zeros((3, 4)), hud=np.zeros((3, 5))),
        "planes: expected .*all of one size"),
    "labels, negative": (
        lambda: Scene.from_planes(hittable=[[0, -1]]), r"hittable\[0\]\[1\]: expected a whole .*got -1"),
    "labels, broken": (lambda: Scene.from_planes(movers=[[0, 1.5]]), r"movers\[0\]\[1\]: expected a whole .*got 1.5"),
    "labels, NaN": (lambda: Scene.from_planes(movers=[[0, math.nan]]), r"movers\[0\]\[1\]: expected a whole .*got nan"),
    "labels, too large": (
        lambda: Scene.from_planes(hittable=[[2**31]]), r"hittable\[0\]\[0\]: expected a whole number"),
    "labels with true": (lambda: Scene.from_planes(hittable=[[True, 2]]), r"hittable\[0\]\[0\]: .*got True"),
    "labels, masked": (
        lambda: Scene.from_planes(hittable=np.ma.array([[1]], mask=[[1]])), r"hittable\[0\]\[0\]: .*masked"),
    "labels of text": (lambda: Scene.from_planes(occluders=[["a"]]), "occluders: expected numbers, got"),
    "plane, empty": (
        lambda: Scene.from_planes(occluders=np.zeros((0, 5))), r"occluders: expected a plane .*got \(0, 5\)"),
    "plane of one row": (lambda: Scene.from_planes(hud=[1, 2]), r"hud: expected a plane .*got \(2,\)"),
    "plane of 10^5 a side": (
        lambda: Scene.from_planes(hittable=huge(1, 10**5, 10**5)), "hittable: expected a plane of si"),
    "mask of 40,000 columns": (
        lambda: Scene.from_planes(occluders=np.ones((1, 40_000), bool)), "occluders: mask: expected .*got 40000 x 1"),
    "masks, a billion": (
        lambda: Scene.from_planes(movers=huge(True, 10**9, 2, 2)), "movers: expected at most 4194304 "),
    "masks of twos": (
        lambda: Scene.from_planes(movers=np.full((2, 3, 5), 2)), r"movers\[0\]\[0\]\[0\]: expected 0 or 1"),
    # sprites
    "mask of floats": (lambda: Sprite.from_mask([[0.0, 1.0]]), r"mask: expected booleans, got \[\[0.0, 1.0\]\]"),
    "mask of twos": (lambda: Sprite.from_mask([[0, 2]]), r"mask\[0\]\[1\]: expected 0 or 1, got 2"),
    "mask of no rows": (lambda: Sprite.from_mask(np.zeros((0, 4), bool)), "mask: expected .*not empty, got 4 x 0"),
    "mask of 10^10": (lambda: Sprite.from_mask(huge(True, 10**5, 10**5)), "mask: expected .*got 100000 x 100000"),
    "mask, masked": (lambda: Sprite.from_mask(np.ma.array([[1, 0]], mask=[[0, 1]])), r"mask\[0\]\[1\]: .*a masked one"),
    "mask of true and numbers": (lambda: Sprite.from_mask([[True, 0]]), r"mask\[0\]\[0\]: expected a number like the"),
    "mask of records": (lambda: Sprite.from_mask(np.zeros((2, 2), "i4,i4")), "mask: expected booleans"),
    "pivot far away": (lambda: Sprite.from_mask([[1]], pivot_xy=(0, 1e6)), r"pivot_xy\[1\]: expected a number within"),
    "color": (
        lambda: Sprite.circle(1, color=(0, 0, 256)), r"color\[2\]: expected a whole number from 0 to 255, got 256"),
    "color, a word": (
        lambda: Sprite.circle(1, color="red"), "color: expected numbers, got 'red'"),  # type: ignore[arg-type]
    "image of 16 bits": (lambda: Sprite.from_image(sheet().astype(np.uint16)), "image: expected bytes .*uint16"),
    "image of two channels": (lambda: Sprite.from_image(sheet()[:, :, :2]), r"image: expected bytes .*\(3, 4, 2\)"),
    "image of 10^10": (lambda: Sprite.from_image(huge(np.uint8(1), 10**5, 10**5, 4)), "image: .*got 100000 x 100000"),
    "image, masked": (
        lambda: Sprite.from_image(np.ma.array(sheet(), mask=True)), r"image\[0\]\[0\]\[0\]: .*a masked one"),
    "alpha threshold": (lambda: Sprite.from_image(sheet(), alpha_threshold=256), "alpha_threshold: .*got 256"),
    "color key of two": (lambda: Sprite.from_image(sheet(), color_key=(1, 2)), r"color_key: expected shape \(3,\)"),
    "source": (lambda: Sprite.from_image(sheet(), source=5), "source: expected an object"),  # type: ignore[arg-type]
    "grid that does not divide": (lambda: Sprite.from_image(sheet(), grid_wh=(3, 3)), "grid_wh: expected to divide"),
    "grid of zero": (lambda: Sprite.from_image(sheet(), grid_wh=(0, 3)), r"grid_wh\[0\]: expected a whole .*got 0"),
    "grid of a million frames": (
        lambda: Sprite.from_image(np.zeros((1000, 1000, 4), np.uint8), grid_wh=(1, 1)),
        "grid_wh: expected at most 65536"),
    "rectangles, none": (lambda: Sprite.from_image(sheet(), rects_xywh=[]), "rects_xywh: expected"),
    "rectangles, too many": (
        lambda: Sprite.from_image(sheet(), rects_xywh=np.ones((65_537, 4))), "rects_xywh: expected 1 to 65536"),
    "rectangle that leaves": (
        lambda: Sprite.from_image(sheet(), rects_xywh=[[0, 0, 5, 1]]), r"rects_xywh\[0\]: .*4 x 3"),
    "polygon of two": (lambda: Sprite.polygon([(0, 0), (1, 1)]), "^points_xy: expected 3 points or more, got 2"),
    "polygon, far point": (
        lambda: Sprite.polygon([*TRIANGLE, (0, 1e6)]), r"^points_xy\[3\]\[1\]: expected a number within"),
    "holes, a number": (
        lambda: Sprite.polygon(TRIANGLE, 3), "holes: expected a list of rings, got 3"),  # type: ignore[arg-type]
    "holes, no dimension": (
        lambda: Sprite.polygon(TRIANGLE, np.array(3)), "holes: expected a list of rings"),  # type: ignore[arg-type]
    "hole": (lambda: Sprite.polygon(TRIANGLE, [TRIANGLE, [(0, 0)]]), r"holes\[1\]: expected 3 points or more, got 1"),
    "circle": (lambda: Sprite.circle(-1), "^radius: expected a number from 0 to 32768, got -1"),
    "box": (lambda: Sprite.box(5, -1), "^height: expected a number from 0 to 32768, got -1"),
    # weapons
    "ring inside out": (lambda: Ring(5, 3), "inner_radius: expected at most outer_radius, 3.0, got 5.0"),
    "box weapon of half a pixel": (
        lambda: Box(2.5, 3), "width: expected a whole number from 1 .*got 2.5"),  # type: ignore[arg-type]
    "radius, text": (lambda: Disc("3"), "radius: expected a number, got '3'"),  # type: ignore[arg-type]
    "radius, list": (lambda: Disc([3]), r"radius: expected shape \(\), got \(1,\)"),  # type: ignore[arg-type]
    "radius, 400 digits": (lambda: Disc(10**400), "radius: expected a number from 0 to 1048576, got 1000"),
    "radius, true": (lambda: Disc(True), "radius: expected a number, got True"),
    "radius, masked": (
        lambda: Disc(np.ma.masked), "radius: expected a value, got a masked one"),  # type: ignore[arg-type]
    "polygon weapon with true": (lambda: Polygon([*TRIANGLE, (True, 2)]), r"points\[3\]\[0\]: .*got True"),
    "pierce": (lambda: Disc(1, pierce=1), "pierce: expected true or false, got 1"),  # type: ignore[arg-type]
    "falloff": (lambda: Disc(1, falloff="liner"), "falloff: .*got 'liner' .did you mean 'linear'"),
    "stencil, empty": (lambda: Stencil([]), r"mask: expected shape \(any, any\), got \(0,\)"),
    "stencil without columns": (lambda: Stencil(np.zeros((3, 0), bool)), "mask: expected .* 1 to 32768 px, got 0 x 3"),
    "stencil without rows": (lambda: Stencil(np.zeros((0, 3), bool)), "mask: expected .* 1 to 32768 px, got 3 x 0"),
    "stencil of empty rows": (lambda: Stencil([""]), "mask: expected .* 1 to 32768 px, got 0 x 1"),
    "stencil, uneven": (lambda: Stencil(["##", "#"]), r"mask\[1\]: expected 2 of '#' and '.', got '#'"),
    "pellet, a name": (
        lambda: Spread("disc", 3, 1), "pellet: expected a weapon of one pattern or ray, got 'disc'"),  # type: ignore[arg-type]
    "pellets, none": (lambda: Spread(Disc(1), 0, 1), "count: expected a whole number from 1 to 65536, got 0"),
    "rounds of rounds": (
        lambda: Rounds(Rounds(Disc(1), 2), 2), "weapon: expected a weapon other than rounds"),  # type: ignore[arg-type]
    "too many pellets in all": (
        lambda: Rounds(Spread(Disc(1), 65_536, 1), 2), "count: expected a whole number from 1 to 1"),
    "weapon, None": (lambda: weapon_from_json(None), "weapon: expected an object with a kind, got None"),
    "weapon of no kind": (lambda: weapon_from_json({}), "weapon: kind: expected one of .*got None"),
    "kind": (lambda: weapon_from_json({"kind": "dics"}), "weapon: kind: .*got 'dics' .did you mean 'disc'"),
    "kind, list": (lambda: weapon_from_json({"kind": ["disc"]}), r"weapon: kind: .*got \['disc'\]"),
    "key of a weapon": (
        lambda: weapon_from_json({"kind": "disc", "radus": 1}), "weapon: key: .*got 'radus' .did you mean 'radius'"),
    "key of a weapon, number": (lambda: weapon_from_json({"kind": "point", 5: 1}), "weapon: key: .*got 5"),
    "field missing": (
        lambda: weapon_from_json({"kind": "ring", "inner_radius": 1}), "weapon: outer_radius: expected a va"),
    "pellet missing": (lambda: weapon_from_json({"kind": "spread"}), "weapon: pellet: expected a value, got nothing"),
    "pellet, wrong field": (
        lambda: weapon_from_json({"kind": "spread", "pellet": {"kind": "disc", "radius": -1}, "count": 1, "radius": 1}),
        "weapon: pellet: radius: expected a number from 0 .*got -1"),
    # fire
    "fire at no scene": (
        lambda: fire(None, Disc(1), (0, 0)), "scene: expected a Scene or a History, got NoneType"),  # type: ignore[arg-type]
    "fire no weapon": (lambda: shot(weapon="disc"), r"weapon: expected a weapon, got str: weapons_of\(scene\) has"),
    "fire a class": (lambda: shot(weapon=Disc), "weapon: expected a weapon, got the class Disc"),
    "prepare at a class": (lambda: prepare(Scene, Disc(1)), "scene: expected a Scene, got the class Scene"),
    "history of a class": (lambda: History(Scene), "scene: expected a Scene, got the class Scene"),
    "report of a class": (lambda: report_of(Scene, []), "scene: expected a Scene, got the class Scene"),
    "aim, NaN": (lambda: shot(aim=math.nan), "aim.*: expected a finite number, got nan"),
    "aim of a row": (
        lambda: shot(at=[(1, 2), (3, 4)], aim=[0, math.inf]), r"aim\[1\]: expected a finite number, got inf"),
    "aims, too many": (lambda: shot(at=[(1, 2)], aim=[1, 2]), r"aim: expected shape \(1,\), as at has .*got \(2,\)"),
    "aim and toward": (lambda: shot(aim=1, toward=(3, 4)), "aim: expected aim or toward, got both"),
    "toward itself": (lambda: shot(toward=(32, 20)), r"toward\[0\]: expected a point other than the shot's own"),
    "toward, NaN": (lambda: shot(toward=(math.nan, 0)), r"toward\[0\]: expected a finite number, got nan"),
    "toward, masked": (
        lambda: shot(at=[(1, 2), (3, 4)], toward=masked), r"toward\[1\]\[1\]: expected a value, got a mas"),
    "accept, negative": (lambda: shot(accept=-1), "accept.*: expected a whole number from 0 .*got -1"),
    "accept, None": (lambda: shot(accept=None), "accept: expected category names or bits, or ALL, got None"),
    "accept, a dict": (
        lambda: shot(accept={"a": 1}), r"^accept: expected category names or bits, or ALL, got \{'a': 1\}$"),
    "blocked_by, a set": (
        lambda: shot(blocked_by={"a"}), r"^blocked_by: expected category names or bits, or ALL, got \{'a'\}$"),
    "accept, names and a number": (
        lambda: shot(accept=["friend", 5]),
        r"^accept: expected category names or bits, or ALL, or a list of names for each shot, got \['friend', 5\]$"),
    "accept, a list of names and a number": (
        lambda: shot(accept=[["friend"], 5]),
        r"^accept: expected .*, or a list of names for each shot, got \[\['friend'\], 5\]$"),
    "accept, true": (lambda: shot(accept=True), "^accept: expected a number, got True$"),
    "aim, a text": (lambda: shot(aim="x"), "^aim: expected a number, got 'x'$"),
    "shot number, true": (lambda: shot(shot=True), "^shot: expected a number, got True$"),
    "tick, a text": (
        lambda: fire(past(), Disc(3), (1, 1), tick="x"), "^tick: expected a number, got 'x'$"),  # type: ignore[arg-type]
    "accept, a name": (lambda: shot(accept="taget"), "accept: .*got 'taget' .did you mean 'target'"),
    "accept, unknown name": (lambda: shot(accept=["taget"]), "accept: .*got 'taget' .did you mean 'target'"),
    "exclude, -2": (lambda: shot(exclude=[0, -2]), r"exclude\[1\]: expected a whole number from -1 .*got -2"),
    "exclude, a name": (lambda: shot(exclude=["duck"]), r"exclude: expected ids, got \['duck'\]: scene.find"),
    "exclude, true": (lambda: shot(exclude=True), "^exclude: expected a number, got True$"),
    "exclude, -2 alone": (lambda: shot(exclude=-2), "^exclude: expected a whole number from -1 to .*got -2$"),
    "exclude, a set": (lambda: shot(exclude={1}), r"^exclude: expected a number, got \{1\}$"),
    "exclude, three dimensions": (lambda: shot(exclude=np.zeros((1, 1, 1))), r"exclude: expected shape \(1, any\)"),
    "seed, text": (lambda: shot(seed="7"), "seed: expected a whole number .*got '7'"),
    "seed, 5000 digits": (lambda: shot(seed=DIGITS), "seed: expected .*got a int that is too long to show"),
    "seed, array": (lambda: shot(seed=np.array([1, 2])), r"seed: expected one, or one for each of 1 shots, got shape"),
    "shot numbers, too few": (lambda: shot(at=[(1, 2), (3, 4)], shot=[1]), r"shot: expected shape \(2,\), got \(1,\)"),
    "prefilter": (lambda: shot(prefilter="boxs"), "prefilter: .*got 'boxs' .did you mean 'box"),
    "prefilter, a number": (lambda: shot(prefilter=3), "prefilter: expected one of .*got 3"),
    "prefilter, no box": (lambda: shot(prefilter="0 boxes"), "prefilter: expected 1 to 64 boxes, got 0"),
    "prefilter, too many": (lambda: shot(prefilter="65 boxes"), "prefilter: expected 1 to 64 boxes, got 65"),
    "broadphase": (lambda: shot(broadphase="quad"), "broadphase: .*got 'quad' .did you mean 'quadtree'"),
    "broadphase, no boxes": (
        lambda: shot(broadphase="grid", prefilter="none"),
        "broadphase: expected 'none' without a pre-filter, got 'grid'",
    ),
    "strategy": (lambda: shot(strategy="buildt"), "strategy: .*got 'buildt' .did you mean 'built'"),
    # what may be asked of hits
    "rows of shot 1 of 1": (lambda: shot().of(1), "shot: expected a whole number from 0 to 0, got 1"),
    "rows of shot -1": (lambda: shot().of(-1), "shot: expected a whole number from 0 to 0, got -1"),
    "why not, true": (lambda: shot().why_not(True), "shot: expected a whole number .*got True"),
    "why not, half": (lambda: shot().why_not(0.5), "shot: expected a whole number .*got 0.5"),  # type: ignore[arg-type]
    "blockers, a name": (
        lambda: shot().blockers("duck"), "shot: expected a whole number .*got 'duck'"),  # type: ignore[arg-type]
    "margins, a name": (
        lambda: shot().margins("duck"), "shot: expected a whole number .*got 'duck'"),  # type: ignore[arg-type]
    "samples, 5000 digits": (lambda: shot().samples_at(DIGITS), "shot: .*got a int that is too long to show"),
    "verdicts, deep": (
        lambda: shot().verdict_counts(DEEP), r"shot: expected a whole number .*got \[\[\["),  # type: ignore[arg-type]
    "rows of no shot": (lambda: shot(at=np.zeros((0, 2))).of(0), "shot: expected a whole number from 0 to -1, got 0"),
    # paths
    "load, None": (lambda: load_scene(None), "folder: expected a path, got None"),  # type: ignore[arg-type]
    "load, bytes": (lambda: load_scene(b"x"), "folder: expected a path, got b'x'"),  # type: ignore[arg-type]
    "load, missing": (lambda: load_scene("/no/such"), "/no/such/scene.json: cannot read it: No such file"),
    "load, a zero byte": (lambda: load_scene("a\0b"), "folder: expected a path, got .*zero byte"),
    "load, 300 characters": (lambda: load_scene("x" * 300), "scene.json: cannot read it: File name too long"),
    "save, None": (lambda: world().save(None), "folder: expected a path, got None"),  # type: ignore[arg-type]
    "save below a file": (lambda: world().save(GALLERY / "duck.png" / "x"), "folder: cannot make .*: Not a directory"),
    "PNG of another ending": (
        lambda: write_png("x.jpg", FRAME), "^output: expected a name that ends in .png, got 'x.jpg'"),
    "PNG without an ending": (
        lambda: write_png("no/such/png", FRAME), "^output: expected a name that ends in .png, got 'png'"),
    "PNG, None": (lambda: read_png(None), "image: expected a path, got None"),  # type: ignore[arg-type]
    "PNG, its bytes": (lambda: read_png(b"\x89PNG"), "image: expected a path, got b"),  # type: ignore[arg-type]
    "PNG, missing": (lambda: read_png("no.png"), "image: expected a PNG file, got 'no.png': No such file or directory"),
    "PNG, a zero byte": (lambda: read_png("a\0.png"), "image: expected a path, got .*zero byte"),
    "PNG, 300 characters": (lambda: read_png("x" * 300), "image: expected a PNG file, got 'xxx.*: File name too long"),
    "PNG, a folder": (lambda: read_png(GALLERY), "image: expected a PNG file, got 'gallery', which is a folder"),
}  # fmt: skip

NOT_YET = [
    pytest.param(lambda: Spread(DEEP, 1, 1), "pellet: ", id="pellet, 10^5 deep"),  # type: ignore[arg-type]
    pytest.param(lambda: Rounds(DIGITS, 1), "weapon: ", id="weapon of rounds, 5000 digits"),  # type: ignore[arg-type]
    pytest.param(lambda: Polygon(TRIANGLE, DIGITS), "holes: ", id="holes, 5000 digits"),  # type: ignore[arg-type]
    pytest.param(lambda: Stencil(np.ones((1, 40_000), bool)), "mask: .*40000 x 1", id="stencil of 40,000 columns"),
    pytest.param(lambda: weapon_from_json(DIGITS), "weapon: ", id="weapon, 5000 digits"),
    pytest.param(lambda: weapon_from_json(DEEP), "weapon: ", id="weapon, 10^5 deep"),
    pytest.param(lambda: weapon_from_json(deep_rounds(10**4)), "weapon: ", id="rounds 10^4 deep"),
    pytest.param(lambda: weapons_of(5), "scene: expected a Scene, got", id="weapons of a number"),
    pytest.param(lambda: Scene(name=DIGITS), "name: ", id="name, 5000 digits"),  # type: ignore[arg-type]
    pytest.param(lambda: world().add(Sprite.circle(1), name=DEEP), "name: ", id="name, 10^5 deep"),  # type: ignore[arg-type]
    pytest.param(lambda: load_scene(DEEP), "folder: ", id="folder, 10^5 deep"),  # type: ignore[arg-type]
    pytest.param(lambda: world().save("a\0b"), "folder: expected a path, got .*zero byte", id="save, a zero byte"),
]


def deep_rounds(depth: int) -> dict[str, Any]:
    weapon: dict[str, Any] = {"kind": "point"}
    for _ in range(depth):
        weapon = {"kind": "rounds", "weapon": weapon, "count": 1}
    return weapon


def check(call: Callable[[], object], told: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert re.search(told, message)
    assert "\n" not in message and len(message) < 1000


@pytest.mark.parametrize("name", ARRAYS)
def test_what_is_no_array_of_numbers(name: str) -> None:
    given, told = ARRAYS[name]
    check(lambda: fire(world(), Disc(3), given), f"^{told}")


@pytest.mark.parametrize(("call", "told"), [*(pytest.param(*row, id=name) for name, row in CALLS.items()), *NOT_YET])
def test_a_bad_call_is_named(call: Callable[[], object], told: str, capfd: pytest.CaptureFixture[str]) -> None:
    check(call, told)
    assert capfd.readouterr() == ("", "")


def test_labels_are_counted_before_they_are_objects(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hitplanes.planes.scene.render.ITEMS_MAX", 3)
    assert len(Scene.from_planes(hittable=[[1, 2, 3, 0]])) == 3
    with pytest.raises(InputError, match="hittable: expected at most 3 objects, got 4"):
        Scene.from_planes(hittable=[[1, 2, 3, 9]])


# Every number of every call

NUMBERS = (math.nan, math.inf, -math.inf, DIGITS, -DIGITS, 10**400, np.longdouble("1e4000"), np.float16(np.inf))
BEYOND = (1e300, -1e300)
OTHERS = ("1", True, np.True_, 1j, [1, [2]], {}, Thing(), np.datetime64("2020-01-01"), DEEP)
FAR = 2**40 + 1


def placed(**pose: Any) -> object:
    return world().add(np.ones((2, 3), bool), **pose)


def in_file(**entry: Any) -> object:
    from hitplanes.planes.files.scene_folder import OBJECT, READERS

    (kind,) = entry
    checked = OBJECT[kind].check("object", {**entry, "position_xy": [0, 0]})
    return READERS[kind](checked, Path(), entry)


def ordered(**given: Any) -> object:
    scene = world()
    scene.shots = [{"weapon": "gun", "at": [1, 2], **given}]
    return requests_of(scene, {"gun": Disc(3)})


FIELDS: dict[str, tuple[Callable[[Any], object], str, tuple[Any, ...]]] = {
    "at": (lambda v: shot(at=(1, v)), "at", (FAR, -FAR)),
    "at of a batch": (lambda v: shot(at=[(1, 2), (v, 3)]), "at", (FAR, -FAR)),
    "aim": (lambda v: shot(aim=v), "aim", ()),
    "toward": (lambda v: shot(toward=(v, 2)), "toward", (FAR, -FAR)),
    "accept": (lambda v: shot(accept=v), "accept", (-1, 2**32, 0.5, 2**64)),
    "blocked_by": (lambda v: shot(blocked_by=v), "blocked_by", (-1, 2**32, 0.5, 2**64)),
    "exclude": (lambda v: shot(exclude=v), "exclude", (-2, 0.5, 2**31 + 1, 2**63)),
    "seed": (lambda v: shot(seed=v), "seed", (-1, 0.5, 2**64)),
    "shot": (lambda v: shot(shot=v), "shot", (-1, 0.5, 2**63)),
    "bounds' width": (lambda v: Scene((v, 5)), "size_wh", (0, -1, 0.5, FAR)),
    "bounds' place": (lambda v: Scene((5, 5), (0, v)), "origin_xy", (0.5, FAR, -FAR)),
    "planes' place": (lambda v: Scene.from_planes(hittable=[[1]], origin_xy=(v, 0)), "origin_xy", (0.5, FAR)),
    "add position_xy": (lambda v: placed(position_xy=(1, v)), "position_xy", (FAR, -FAR)),
    "add velocity_xy": (lambda v: placed(velocity_xy=(1, v)), "velocity_xy", (-(2**21), 2**20 + 0.001, FAR)),
    "add angle": (lambda v: placed(angle=v), "angle", ()),
    "add scale": (lambda v: placed(scale=v), "scale", (0, -1, 1 / 257, 257)),
    "add scales": (lambda v: placed(scale=(1, v)), "scale", (0, -1, 1 / 257, 257)),
    "add frame": (lambda v: placed(frame=v), "frame", (-1, 1, 0.5, 2**64)),
    "add layer": (lambda v: placed(layer=v), "layer", (2**31, -(2**31), 0.5, 2**64)),
    "add categories": (lambda v: placed(categories=v), "categor", (-1, 2**32, 0.5)),
    "add owner": (lambda v: placed(owner=v), "owner", (-1, 4, 0.5, 2**64)),
    "ids": (lambda v: world().remove(v), "ids", (-1, 3, 0.5, 2**64)),
    "set position_xy": (lambda v: world().set([0, 1], position_xy=[(1, 2), (3, v)]), "position_xy", (FAR, -FAR)),
    "set angle": (lambda v: world().set([0, 1], angle=[1, v]), "angle", ()),
    "set scale": (lambda v: world().set([0, 1], scale=[1, v]), "scale", (0, -1, 257)),
    "set frame": (lambda v: world().set([0, 1], frame=[0, v]), "frame", (-1, 1, 0.5)),
    "set layer": (lambda v: world().set([0, 1], layer=[0, v]), "layer", (2**31, 0.5)),
    "set categories": (lambda v: world().set([0, 1], categories=[1, v]), "categor", (-1, 2**32)),
    "set owner": (lambda v: world().set([0, 1], owner=[1, v]), "owner", (-1, 3, 0.5)),
    "mask's id": (lambda v: world().mask(v), "item", (-1, 3, 0.5)),
    "name's id": (lambda v: world().name_of(v), "item", (-1, 3, 0.5)),
    "hits.of": (lambda v: shot().of(v), "shot", (-1, 1, 0.5)),
    "hits.scene_of": (lambda v: shot().scene_of(v), "shot", (-1, 1, 0.5)),
    "hits.scene_of of rays": (lambda v: shot(weapon=Pistol(9), aim=0).scene_of(v), "shot", (-1, 1, 0.5)),
    "hits.why_not": (lambda v: shot().why_not(v), "shot", (-1, 1, 0.5)),
    "hits.blockers": (lambda v: shot().blockers(v), "shot", (-1, 1, 0.5)),
    "hits.margins": (lambda v: shot().margins(v), "shot", (-1, 1, 0.5)),
    "hits.samples_at": (lambda v: shot().samples_at(v), "shot", (-1, 1, 0.5)),
    "circle": (Sprite.circle, "radius", (-1, 32_769)),
    "box's width": (lambda v: Sprite.box(v, 1), "width", (-1, 32_769)),
    "polygon": (lambda v: Sprite.polygon([*TRIANGLE, (1, v)]), "points_xy", (32_769,)),
    "hole": (lambda v: Sprite.polygon(TRIANGLE, [[*TRIANGLE, (1, v)]]), r"holes\[0\]", (32_769,)),
    "pivot_xy": (lambda v: Sprite.from_mask([[1]], pivot_xy=(v, 0)), "pivot_xy", (32_769,)),
    "color": (lambda v: Sprite.circle(1, color=(0, v, 0)), "color", (-1, 256, 0.5)),
    "alpha_threshold": (lambda v: Sprite.from_image(sheet(), alpha_threshold=v), "alpha_threshold", (-1, 256, 0.5)),
    "color_key": (lambda v: Sprite.from_image(sheet(), color_key=(0, v, 0)), "color_key", (-1, 256, 0.5)),
    "grid_wh": (lambda v: Sprite.from_image(sheet(), grid_wh=(v, 3)), "grid_wh", (-1, 0, 3, 5, 0.5, 10**9)),
    "rects_xywh": (
        lambda v: Sprite.from_image(sheet(), rects_xywh=[(0, 0, 1, v)]), "rects_xywh", (-1, 0, 4, 0.5, 10**9)),
    "disc radius": (Disc, "radius", (-1, 2**20 + 1, 10**9)),
    "ring inner_radius": (lambda v: Ring(v, 2**20), "inner_radius", (-1, 2**20 + 1)),
    "ring outer_radius": (lambda v: Ring(0, v), "outer_radius", (-1, 2**20 + 1)),
    "box weapon's width": (lambda v: Box(v, 1), "width", (0, -1, 0.5, 2**20 + 1, 10**9)),
    "box weapon's height": (lambda v: Box(1, v), "height", (0, -1, 0.5, 2**20 + 1, 10**9)),
    "polygon points": (lambda v: Polygon([*TRIANGLE, (1, v)]), "points", (2**19 + 1,)),
    "polygon holes": (lambda v: Polygon(TRIANGLE, [[*TRIANGLE, (1, v)]]), r"holes\[0\]", (2**19 + 1,)),
    "cone reach": (lambda v: Cone(v, 30), "reach", (-1, 2**20 + 1)),
    "cone angle": (lambda v: Cone(30, v), "angle", (-1, 361)),
    "beam length": (lambda v: Beam(v, 1), "length", (-1, 2**20 + 1)),
    "beam width": (lambda v: Beam(1, v), "width", (-1, 2**20 + 1)),
    "stencil pivot_xy": (lambda v: Stencil(["#"], (v, 0)), "pivot_xy", (32_769,)),
    "spread count": (lambda v: Spread(Disc(1), v, 1), "count", (0, -1, 0.5, 65_537, 10**9)),
    "spread radius": (lambda v: Spread(Disc(1), 1, v), "radius", (-1, 2**20 + 1)),
    "rounds count": (lambda v: Rounds(Disc(1), v), "count", (0, -1, 0.5, 65_537, 10**9)),
    "rounds recoil_xy": (lambda v: Rounds(Disc(1), 2, (0, v)), "recoil_xy", (2**20 + 1,)),
    "rounds recoil_deg": (lambda v: Rounds(Disc(1), 2, (0, 0), v), "recoil_deg", (-361, 361)),
    "file's circle": (lambda v: in_file(circle=v), "circle", (-1, 32_769)),
    "file's box_wh": (lambda v: in_file(box_wh=[1, v]), "box_wh", (-1, 32_769)),
    "file's polygon": (lambda v: in_file(polygon=[*TRIANGLE, [1, v]]), "polygon", (32_769,)),
    "file's mask": (lambda v: in_file(mask=[[1, v]]), "mask", (-1, 2)),
    "order's at": (lambda v: ordered(at=[1, v]), r"shots\[0\]: at", (FAR,)),
    "order's aim": (lambda v: ordered(aim=v), r"shots\[0\]: aim", (10**9 + 1,)),
    "order's toward": (lambda v: ordered(toward=[v, 1]), r"shots\[0\]: toward", (FAR,)),
    "order's seed": (lambda v: ordered(seed=v), r"shots\[0\]: seed", (-1, 0.5, 2**64)),
    "order's shot": (lambda v: ordered(shot=v), r"shots\[0\]: shot", (-1, 0.5, 2**63)),
}  # fmt: skip

MAY_BE_NONE = {
    "aim", "exclude", "shot", "order's aim", "order's toward", "hits.margins", "add categories", "add owner",
}  # fmt: skip
NO_LIMIT = {"aim", "add angle", "set angle"}


@pytest.mark.parametrize("name", FIELDS)
def test_every_number_is_checked(name: str) -> None:
    call, field, beyond = FIELDS[name]
    values = [
        *NUMBERS,
        *(() if name in NO_LIMIT else BEYOND),
        *(() if name in MAY_BE_NONE else (None,)),
        *OTHERS,
        *beyond,
    ]
    for value in values:
        with pytest.raises(InputError) as caught:
            call(value)
        assert re.match(rf"(row \d+: )?{field}.*: expected .+, got ", str(caught.value)), (value, str(caught.value))
        assert len(str(caught.value)) < 500


# What is right in any form


NUMBERS_OF: dict[str, Callable[[np.ndarray], object]] = {
    "list": lambda v: v.tolist(),
    "tuples": lambda v: tuple(map(tuple, v.tolist())),
    "list of arrays": list,
    "list of numpy's numbers": lambda v: [list(row) for row in v],
    "int8": lambda v: v.astype(np.int8),
    "uint64": lambda v: v.astype(np.uint64),
    "big-endian int16": lambda v: v.astype(">i2"),
    "float16": lambda v: v.astype(np.float16),
    "big-endian float64": lambda v: v.astype(">f8"),
    "long double": lambda v: v.astype(np.longdouble),
    "columns first": np.asfortranarray,
    "backwards in memory": lambda v: v[::-1].copy()[::-1],
    "every other": lambda v: np.repeat(np.repeat(v, 2, axis=0), 3, axis=1)[::2, ::3],
    "not aligned": lambda v: np.frombuffer(b"x" + v.tobytes(), np.uint8)[1:].view(v.dtype).reshape(v.shape),
    "a view of one": lambda v: v.view(type("View", (np.ndarray,), {})),
    "masked nowhere": lambda v: np.ma.array(v, mask=False),
    "its buffer": lambda v: memoryview(np.ascontiguousarray(v)),
}


def frozen(given: object) -> object:
    if isinstance(given, np.ndarray):
        given.flags.writeable = False
    return given


@pytest.mark.parametrize("form", NUMBERS_OF)
def test_numbers_in_any_form_are_taken_and_left_as_they_were(form: str) -> None:
    at = np.array([[32, 20], [30, 24], [3, 4]])
    given = frozen(NUMBERS_OF[form](at.copy()))
    expected = fire(world(), Disc(3), at, toward=at + 5, exclude=[-1, -1, 0])
    assert expected and fire(world(), Disc(3), given, toward=at + 5, exclude=[-1, -1, 0]) == expected
    moved, told = world(), world()
    moved.set([0, 1], position_xy=given[:2] if isinstance(given, tuple | list | np.ndarray) else at[:2])  # type: ignore[index]
    told.move([0, 1], at[:2])
    assert moved.content_hash() == told.content_hash()
    labels = Scene.from_planes(hittable=given)
    assert labels.content_hash() == Scene.from_planes(hittable=at).content_hash()
    assert np.array_equal(np.asarray(given), at)


@pytest.mark.parametrize("form", [f for f in NUMBERS_OF if f not in ("float16", "big-endian float64", "long double")])
def test_masks_and_images_in_any_form_are_taken_and_left_as_they_were(form: str) -> None:
    mask = np.array([[1, 0, 1], [0, 1, 1]])
    given = frozen(NUMBERS_OF[form](mask.copy()))
    assert np.array_equal(Sprite.from_mask(given).frames[0].mask, mask == 1)
    true = frozen(np.asarray(given) == 1)
    assert np.array_equal(Sprite.from_mask(true).frames[0].mask, mask == 1)
    image = np.random.default_rng(1).integers(0, 256, (4, 3, 4)).astype(np.uint8)
    seen = image.copy()
    views = [image[::-1].copy()[::-1], np.asfortranarray(image), np.repeat(image, 2, axis=1)[:, ::2]]
    for view in views:
        frame = Sprite.from_image(frozen(view)).frames[0]
        assert frame.image is not None and np.array_equal(frame.image, image)
    assert np.array_equal(np.asarray(given), mask) and all(np.array_equal(view, seen) for view in views)


# Paths and words


def record(path: Any) -> None:
    with ShotRecord(path) as written:
        written.fire(world(), Disc(3), (1, 1))


def quiet() -> Progress:
    return Progress(io.StringIO())


NO_STUDY = Effort.quick()
FRAME = np.zeros((2, 2, 3), np.uint8)
TAKES_A_PATH: dict[str, Callable[[Any], object]] = {
    "load_scene": load_scene,
    "save": lambda path: world().save(path),
    "read_png": read_png,
    "write_png": lambda path: write_png(path, FRAME),
    "ShotRecord": record,
    "replay": lambda path: replay(path, world()),
    "fire_log, log": lambda path: fire_log(world(), path, Path("hits.jsonl"), quiet()),
    "fire_log, output": lambda path: fire_log(world(), Path("empty.jsonl"), path, quiet()),
    "read_report": read_report,
    "load_study": load_study,
    "write_starter": write_starter,
    "write_frames": lambda path: write_frames(path, [FRAME]),
    "write_gif": lambda path: write_gif(path, [FRAME], 10),
    "write_demo": lambda path: write_demo("grid", path, 1),
    "write_study": lambda path: write_study(world(), path, 0, NO_STUDY, 0.1, quiet()),
    "run_stability": lambda path: run_stability(path, 0, True, io.StringIO()),
}
NO_PATHS = [
    "",
    "a\0b",
    Path("a\0b"),
    "\ud800",
    Path("\ud800"),
    b"abc",
    None,
    5,
    1.5,
    [],
    {},
    {"a"},
    np.array(["a"]),
    object(),
]


def refuse(*_: object) -> None:
    raise InputError("nothing is studied here")


@pytest.mark.parametrize("name", TAKES_A_PATH)
def test_what_is_no_path_is_named_everywhere(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty.jsonl").touch()
    for value in NO_PATHS:
        check(lambda value=value: TAKES_A_PATH[name](value), r"^\w+: expected a path, got ")  # type: ignore[misc]
    assert [path.name for path in tmp_path.iterdir()] == ["empty.jsonl"]


@pytest.mark.parametrize("name", TAKES_A_PATH)
@pytest.mark.parametrize("path", ["x" * 300, "empty.jsonl/a", "/dev/null/x", "", ".", "/", "no/such/place", "\udc80/a"])
def test_a_path_that_leads_nowhere_is_bad_input(
    name: str, path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hitplanes.weapons.lab.study.study.run_study", refuse)
    monkeypatch.setattr("hitplanes.weapons.lab.stability.stability._ask", refuse)
    monkeypatch.chdir(tmp_path)
    Path("empty.jsonl").touch()
    with suppress(InputError):
        TAKES_A_PATH[name](path)


WORDS: dict[str, Callable[[Any], object]] = {
    **{
        f"{field} of {weapon.kind}, {n} shots": (
            lambda word, field=field, weapon=weapon, n=n: shot(weapon=weapon, at=[(32, 20)] * n, aim=0, **{field: word})
        )
        for field in ("prefilter", "broadphase", "strategy")
        for weapon in (Disc(3), Spread(Disc(2), 3, 9), Pistol(50), Sweep(Pistol(50), 9, 3))
        for n in (0, 1, 2, 100)
    },
    "prefilter of a past": lambda word: fire(past(), Disc(3), (1, 1), tick=0, prefilter=word),
    "prefilter of a report": lambda word: told(prefilter=word),
    "broadphase of a report": lambda word: told(broadphase=word),
    "index": world().derived.index,
    "volumes": lambda word: world().volumes([0], word),
    "role": lambda word: world().ids(word),
    "flip": lambda word: world().add(Sprite.circle(1), flip=word),
    "falloff": lambda word: Disc(3, falloff=word),
    "inside": lambda word: Pistol(3, inside=word),
    "kind": lambda word: weapon_from_json({"kind": word}),
    "demo": lambda word: next(moments(word, 1)),
}
NO_WORDS = [
    np.array(["auto", "none"]), np.array("auto"), np.zeros(3), np.zeros(0), {"auto"}, ["auto"], ("auto",), {}, 5, 1.5,
    math.nan, b"auto", True, object(), "", "\ud800", "a\0", "autoo", "\u00b2 boxes", "9" * 99 + " boxes", len,
]  # fmt: skip


def past() -> History:
    history = History(world())
    history.record()
    return history


def told(**given: Any) -> object:
    scene = world()
    return report_of(scene, [fire(scene, Disc(3), (32, 20))], **given)


@pytest.mark.parametrize("name", WORDS)
def test_what_is_none_of_the_words_is_named_everywhere(name: str) -> None:
    for word in NO_WORDS:
        with pytest.raises(InputError) as caught:
            WORDS[name](word)
        assert len(str(caught.value)) < 1000


class NoCopy:
    """What cannot be copied."""

    def __reduce__(self) -> Any:
        raise RuntimeError("no copy")


class NoReturn:
    """What cannot be made again of its copy."""

    def __reduce__(self) -> Any:
        return int, ("x",)


@pytest.mark.parametrize("value", [lambda: 0, threading.Lock(), NoCopy(), DEEP], ids=["lambda", "lock", "own", "deep"])
def test_a_history_refuses_weapons_that_cannot_be_copied(value: object) -> None:
    scene = world()
    history = History(scene)
    history.record()
    for field in ("weapons", "shots"):
        setattr(scene, field, {"gun": value} if field == "weapons" else [value])
        check(history.record, "^scene: expected weapons and shots of plain JSON, got a value that cannot be kept: ")
        setattr(scene, field, {} if field == "weapons" else [])
    assert history.ticks == [0] and history.record() == 1


def test_a_history_refuses_weapons_that_do_not_come_back() -> None:
    scene = world()
    scene.weapons = {"gun": NoReturn()}
    history = History(scene)
    history.record()
    check(lambda: history.at(0), "^scene: expected weapons and shots of plain JSON")


@pytest.mark.parametrize("value", [5, None, [], np.zeros(3), "report", {}, {"format": 5}, {"format": np.zeros(3)}])
def test_what_is_no_report_is_not_drawn(value: Any) -> None:
    check(lambda: picture_of_report(value, world()), "^report: ")


def test_other_calls_with_what_they_do_not_take() -> None:
    scene = world()
    report = report_of(scene, [fire(scene, Disc(3), (32, 20))])
    for names in (5, 1.5, "disc", b"disc", {"disc": 1}, np.array(5), object()):
        check(lambda names=names: told(names=names), "^names: expected a list of names, got ")  # type: ignore[misc]
    check(lambda: picture_of_report(report, None), "^scene: expected a Scene, got NoneType")  # type: ignore[arg-type]
    check(lambda: picture_of_report(report, scene, text=np.zeros(3)), "^text: ")  # type: ignore[arg-type]
    check(lambda: use_jit(np.zeros(3)), "^on: expected true or false, got ")  # type: ignore[arg-type]
    scene.weapons = [5]  # type: ignore[assignment]
    check(lambda: weapons_of(scene), "^weapons: expected an object, got ")


@examples(30, deadline=None)
@given(st.text("ab/\n\t\x1b\x7f\x9b\u2028\u202e\u2066\u061c\u200f\ud800", min_size=1))
def test_an_error_can_be_printed_whatever_it_names(text: str) -> None:
    calls: list[Callable[[], object]] = [
        lambda: load_scene(f"{text}/no"),
        lambda: read_png(text + ".no"),
        lambda: replay(f"{text}/no", world()),
        lambda: weapon_from_json({"kind": text}),
        lambda: weapon_from_json({"kind": "disc", "radius": -1}, text),
        lambda: weapon_from_json({"kind": "disc", text: 1}),
        lambda: shot(accept=[text]),
        lambda: shot(strategy=text),
        lambda: world().find(text),
        lambda: Scene(categories=[text, text]),
        lambda: report_of(world(), [shot()], [text, text]),
    ]
    for call in calls:
        with pytest.raises(InputError) as caught:
            call()
        assert str(caught.value).isprintable()


def test_an_error_says_what_it_says_and_can_be_copied() -> None:
    error = InputError("name: expected 鴨 and é, got \x7f")
    assert str(error) == "name: expected 鴨 and é, got \\x7f"
    assert str(InputError(str(error))) == str(error) == str(pickle.loads(pickle.dumps(error)))


def test_an_empty_list_of_points_is_none_of_them() -> None:
    """A game whose last enemy is gone passes empty lists; no call expects the shape of what is not there."""
    scene = Scene((50, 50))
    wall = scene.add(np.ones((9, 9), np.bool_), (20, 20), role="occluder")
    for weapon, aimed in ((Point(), {}), (Disc(3), {}), (Pistol(20), {"aim": []}), (Laser(None), {"toward": []})):
        assert len(fire(scene, weapon, [], **aimed).shots) == len(fire(scene, weapon, (3, 3), toward=[]).shots) == 0
    assert sees(scene, [], (3, 3)).size == sees(scene, (3, 3), []).size == 0
    scene.move([], [])
    scene.set([], position_xy=[], velocity_xy=[])
    assert scene.carve({wall: []}) == {wall: 0}
    with pytest.raises(InputError, match="at: expected shape"):
        fire(scene, Disc(3), np.zeros((0, 3)))


SPANS = {
    "alpha": (
        np.full((2, 2), 255, np.uint8),
        (0, 0),
        r"mask\[0\]\[0\]: expected 0 or 1 .of an image of grey: mask > 127., got 255",
    ),
    "masks": (np.ones((2, 2, 2), np.bool_), (0, 0), r"mask: expected shape \(any, any\), got \(2, 2, 2\)"),
    "fraction": ([[1]], (10.5, 0), r"origin_xy\[0\]: expected a whole number"),
    "corner": ([[1]], (10, 0, 0), r"origin_xy: expected shape \(2,\), got \(3,\)"),
    "nowhere": ([[1]], (float("nan"), 0), r"origin_xy\[0\]: expected a whole number"),
}


@pytest.mark.parametrize("name", SPANS)
def test_spans_are_of_a_mask_at_a_whole_pixel(name: str) -> None:
    mask, corner, text = SPANS[name]
    with pytest.raises(InputError, match=text):
        Spans.from_mask(mask, corner)  # type: ignore[arg-type]
    assert Spans.from_mask([[1, 0], [1, 1]], np.array([3, 4])).runs().tolist() == [[4, 3, 3], [5, 3, 4]]  # type: ignore[arg-type]
