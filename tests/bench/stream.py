"""`hitplanes fire` on long logs: shots and rows a second, and the peak memory of the process.

python tests/bench/stream.py
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hitplanes import Disc, load_scene

ROOT = Path(__file__).parents[2]
MIXES = {"point": ["point"], "disc r=8": ["disc"], "mixed": ["point"] * 14 + ["disc"] * 3 + ["shotgun"] * 2 + ["blast"]}


def write_log(path: Path, weapons: list[str], shots: int) -> None:
    """Shots all over the gallery; some refuse friends, some pass over their shooter."""
    rng = random.Random(1)
    with path.open("w") as log:
        for _ in range(shots):
            at = [round(rng.uniform(0, 480), 2), round(rng.uniform(0, 270), 2)]
            shot: dict[str, object] = {"weapon": rng.choice(weapons), "at": at}
            if shot["weapon"] == "shotgun":
                shot["seed"] = rng.getrandbits(64)
            if rng.random() < 0.2:
                shot |= {"accept": ["target"], "exclude": ["duck 1"]}
            log.write(json.dumps(shot) + "\n")


def measured(scene: Path, log: Path, output: Path) -> tuple[float, float]:
    """Seconds of a run in a process of its own, from its start to its end, and its peak memory in MB."""
    begin = time.perf_counter()
    words = [sys.executable, "-m", "hitplanes", "fire", scene, log, "-o", output]
    process = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0
    return time.perf_counter() - begin, usage.ru_maxrss / 1024


def main() -> None:
    """Print the table."""
    lines = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = load_scene(ROOT / "fixtures" / "gallery")
        scene.weapons["disc"] = Disc(8).to_json()
        scene.save(folder / "scene")
        log, output = folder / "shots.jsonl", folder / "hits.jsonl"
        for shots in (10**5, 10**6):
            for mix, weapons in MIXES.items():
                write_log(log, weapons, shots)
                seconds, peak = measured(folder / "scene", log, output)
                with output.open() as answers:
                    next(answers)
                    rows = sum(len(json.loads(line)["rows"]) for line in answers)
                lines.append(f"{shots:9,} {mix:9} {shots / seconds:9,.0f} {rows / seconds:9,.0f} {peak:8.0f}")
    print(f"{'shots':>9} {'weapons':9} {'shots/s':>9} {'rows/s':>9} {'peak MB':>8}")
    print(*lines, sep="\n")


if __name__ == "__main__":
    main()
