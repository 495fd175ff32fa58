"""Hits are decided, explained, recorded and read from scenes without OpenCV; only images ask for it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hitplanes import write_png

BLOCKED = "import sys; sys.modules['cv2'] = None\n"  # `import cv2` raises ImportError, as where it is not installed

SHOTS = """
import json
from pathlib import Path
import numpy as np
from hitplanes import (
    Disc, History, Laser, Pistol, Projectile, Rifle, Scene, ShotRecord, Spread, Sprite, weapons_of, fire, load_scene,
    prepare, replay, report_of,
)
from hitplanes.planes.volumes.fit import concave

mask = np.ones((9, 9), np.bool_)
image = np.full((9, 9, 4), 255, np.uint8)
scene = Scene((200, 200))
duck = scene.add(mask, (60, 60), name="duck")
scene.add(Sprite.from_image(image), (80, 60), name="can")
scene.add(Sprite.polygon([(0, 0), (9, 0), (0, 9)]), (120, 60), angle=30, name="kite")
scene.add(mask, (90, 60), role="occluder", layer=1, name="wall")
for weapon in (Disc(9), Spread(Disc(2), 6, 9), Pistol(150), Rifle(150, budget=20), Laser(None), Projectile(90, 3)):
    ray = not isinstance(weapon, Disc) and not isinstance(getattr(weapon, "pellet", weapon), Disc)
    how = {"at": (20, 60), "toward": (130, 60)} if ray else {"at": (62, 62)}
    hits = fire(scene, weapon, **how)
    assert [scene.name_of(row.object) for row in hits][:1] == ["duck"], weapon
    assert hits.margins(0) is not None and hits.samples_at(0) is not None and hits.why_not(0) is not None
    assert report_of(scene, [hits])["shots"]
for kind in ("box", "circle", "oriented box", "4 boxes", "polygon"):
    assert len(scene.volumes(scene.ids(), kind)) == len(scene.ids())
parts = np.zeros((20, 20), np.bool_)
parts[2:9, 3:9] = parts[12:17, 11:18] = True
assert len(concave(parts, 0.5)) > 4
ready = prepare(scene, Disc(9))
assert len(ready.fire((62, 62))) == len(fire(scene, Disc(9), (62, 62)))
fire(scene, Disc(6), np.random.default_rng(1).uniform(0, 200, (3000, 2)))
fire(scene, Pistol(90), np.random.default_rng(1).uniform(0, 200, (3000, 2)), aim=5)
history = History(scene, ticks=8)
for tick in range(4):
    scene.move(duck, (60 + tick, 60))
    history.record(tick)
with ShotRecord("match.jsonl") as record:
    record.fire(history, Pistol(200), (20, 60), aim=0, tick=2)
assert replay("match.jsonl", history) is None
objects = {
    "hittable": [{"circle": 9, "position_xy": [30, 30]}, {"mask": ["###", "##."], "scale": 4, "position_xy": [60, 30]}],
    "occluders": [{"box_wh": [9, 9], "position_xy": [60, 30], "layer": 1}],
}
weapons = {"a": {"kind": "disc", "radius": 5}}
told = {"format": "hitplanes-scene/2", "objects": objects, "weapons": weapons}
Path("plain").mkdir()
Path("plain/scene.json").write_text(json.dumps(told))
assert len(fire(load_scene("plain"), weapons_of(load_scene("plain"))["a"], (30, 30))) == 1
"""


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(words, capture_output=True, text=True, cwd=folder, check=False)


def test_what_decides_hits_does_not_need_opencv(tmp_path: Path) -> None:
    done = run(BLOCKED + SHOTS, tmp_path)
    assert done.returncode == 0, done.stderr


def test_what_decides_hits_does_not_load_opencv(tmp_path: Path) -> None:
    """Also where it is installed."""
    done = run(f"{SHOTS}\nimport sys; assert 'cv2' not in sys.modules", tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_command_fires_without_opencv(tmp_path: Path) -> None:
    assert run(BLOCKED + SHOTS, tmp_path).returncode == 0
    (tmp_path / "shots.jsonl").write_text('{"weapon": "a", "at": [30, 30]}\n')
    words = ("['--version']", "['fire', 'plain', 'shots.jsonl']")
    for word in words:
        code = f"from hitplanes.weapons.cli.command import main\nraise SystemExit(main({word}))"
        done = run(BLOCKED + code, tmp_path)
        assert done.returncode == 0, done.stderr
    assert len((tmp_path / "hits.jsonl").read_text().splitlines()) == 2


@pytest.mark.parametrize(
    "code",
    [
        "write_png('out.png', np.zeros((4, 4, 3), np.uint8))",
        "read_png('some.png')",
        "load_scene('pictured')",
        "picture_of_report(report_of(scene, [fire(scene, Disc(3), (9, 9))]), scene)",
    ],
)
def test_where_images_need_opencv_one_error_says_what_to_install(code: str, tmp_path: Path) -> None:
    write_png(tmp_path / "some.png", np.zeros((4, 4, 3), np.uint8))
    (tmp_path / "pictured").mkdir()
    write_png(tmp_path / "pictured" / "some.png", np.zeros((4, 4, 3), np.uint8))
    (tmp_path / "pictured" / "scene.json").write_text(
        '{"format": "hitplanes-scene/2", "objects": {"hittable": [{"image": "some.png", "position_xy": [9, 9]}]}}'
    )
    script = f"""
import numpy as np
from hitplanes import Disc, InputError, Scene, fire, load_scene, picture_of_report, read_png, report_of, write_png
scene = Scene((99, 99))
try:
    {code}
except InputError as error:
    assert "images: expected OpenCV to be installed (pip install opencv-python-headless), got " in str(error), error
else:
    raise AssertionError("no error")
"""
    done = run(BLOCKED + script, tmp_path)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "out.png").exists()


def test_the_command_says_in_one_line_what_to_install(tmp_path: Path) -> None:
    write_png(tmp_path / "can.png", np.full((9, 9, 4), 255, np.uint8))
    code = "from hitplanes.weapons.cli.command import main\n"
    code += "raise SystemExit(main(['new', '--from-image', 'can.png', 'range']))"
    done = run(BLOCKED + code, tmp_path)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "pip install opencv-python-headless" in done.stderr
