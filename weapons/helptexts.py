"""What `hitplanes COMMAND --help` says."""

from __future__ import annotations

__all__ = [
    "COMPARE_EXAMPLES",
    "COMPARE_HELP",
    "DEMO_EXAMPLES",
    "DEMO_HELP",
    "DESCRIPTION",
    "FIRE_EXAMPLES",
    "FIRE_HELP",
    "NEW_EXAMPLES",
    "NEW_HELP",
    "REPLAY_EXAMPLES",
    "REPLAY_HELP",
    "REPORT_EXAMPLES",
    "REPORT_HELP",
    "STABILITY_EXAMPLES",
    "STABILITY_HELP",
    "STUDY_EXAMPLES",
    "STUDY_HELP",
]

DESCRIPTION = "What does a shot hit in a 2-D scene? Decided by pixels, exactly, and shown why."

REPORT_HELP = """\
Fire shots at a scene folder and write a picture, and the facts as JSON, that say what was hit and why.
Without --weapon the shots of scene.json are fired.
"""

REPORT_EXAMPLES = """\
examples:
  hitplanes report fixtures/gallery
  hitplanes report fixtures/gallery -o report.png --json report.json
  hitplanes report fixtures/gallery --weapon shotgun --at 138,91 --seed 7
  hitplanes report fixtures/gallery --weapon laser --at 100,167 --aim -4.5
"""

FIRE_HELP = """\
Resolve a log of shots, of any length, in little memory: a line in, a line out, in the same order.

A line of SHOTS.jsonl is a shot as in scene.json: {"weapon": "pistol", "at": [62, 86]}, and aim or toward, accept,
exclude, seed. Shots are numbered by their line, from 0, unless they have "shot". Empty lines are refused.

The first line of HITS.jsonl names the scene, the weapons, the columns of a row and the objects by id; then comes
{"shot": 0, "of": checksum of the line (CRC-32), "rows": [[object, ...], ...], "verdicts": [empty, hit, ...]}.

Answers are written to HITS.jsonl.part, which is renamed when it is complete. After an interrupt, a full disk or a bad
line, mended, the same command goes on where it was.
"""

FIRE_EXAMPLES = """\
examples:
  hitplanes fire fixtures/gallery shots.jsonl -o hits.jsonl
  zcat shots.jsonl.gz | hitplanes fire fixtures/gallery /dev/stdin -o hits.jsonl
  hitplanes fire fixtures/gallery shots.jsonl --plan
"""

NEW_HELP = """\
Write a small scene to start from: scene.json, and the images that it names. FOLDER must be new, or empty.
"""

NEW_EXAMPLES = """\
examples:
  hitplanes new range
  hitplanes report range
"""

COMPARE_HELP = """\
Say what differs between two reports, in words, and draw them side by side: what was hit in only one of them, in both.
Exit code: 0 the same, 1 they differ, 2 bad input. Versions and plans are not compared.
"""

DEMO_HELP = """\
Show a broad phase at work: objects that move, cells that split and merge with them, and a query in its two steps, to
find the leaves, and to compare within them. It counts the tests that it makes beside those of brute force.
"""

DEMO_EXAMPLES = """\
examples:
  hitplanes demo quadtree
  hitplanes demo grid -o grid.gif
  hitplanes demo bvh -o frames
"""

STABILITY_HELP = """\
Count wrong decisions on input that is hard to decide: near touching, far away, thin, tied, tiny and huge: those of
hitplanes, of the textbooks' formulas in float64, and of shapely, pymunk and pygame-ce where they are installed; the
truth is exact rational arithmetic. Writes stability.json, stability.md and, where matplotlib is installed,
stability.png into a folder.

Exit code: 0 hitplanes decides all rightly, 1 it does not, 2 bad input. An interrupted run keeps what it asked.
"""

STABILITY_EXAMPLES = """\
examples:
  hitplanes stability --quick
  hitplanes stability -o stability/ --seed 7
"""

REPLAY_HELP = """\
Fire the shots of a record again, and tell the first that differs, and how. A record is written by
weapons.ShotRecord, which a game fires with. Exit code: 0 all do the same, 1 one differs, 2 bad input.
"""

REPLAY_EXAMPLES = """\
examples:
  hitplanes replay fixtures/gallery match.jsonl
"""

STUDY_HELP = """\
Measure error against run time: which test is fast, which accurate, which good enough? Pixel planes at each scale, all
volumes, pre-filters and broad phases, rays by steps, fast movers by substeps, spread by pellets, and pymunk, pygame and
shapely where they are installed, all on the objects of SCENE that can be hit; without SCENE, on a shape of each kind.

Writes study.json, study.csv, study.md, and a diagram for each question (matplotlib: pip install 'hitplanes[study]').
After an interrupt it keeps what was measured.
"""

STUDY_EXAMPLES = """\
examples:
  hitplanes study --quick
  hitplanes study fixtures/gallery -o study --error 0.05
"""

COMPARE_EXAMPLES = """\
examples:
  hitplanes report fixtures/gallery --json before.json
  hitplanes compare before.json after.json
  hitplanes compare before.json after.json -o diff.png --scene fixtures/gallery
  hitplanes compare before.json after.json -o diff.png --scene level/old --scene level/new
"""
