"""Picture of what weapons cost, beside each other and beside a peer, of the figures of `speed.py --only weapons`.

python tests/bench/speed.py --jit --only weapons --json FILE; python tests/bench/speed_heat.py FILE PICTURE

Where a peer answers the same question, a cell tells how many times as long it takes. In other columns a cell tells how
many times as long a shot takes as one that asks for rows alone. Both are coloured alike: red is slow.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from hitplanes.weapons.lab.study.study import BLUE, RED, looking_alike, save_figure

PEERS = ("A pygame", "pymunk")
COLORS = LinearSegmentedColormap.from_list("slow, even, fast", [RED, "#f7f7f7", BLUE])
DECADES = 1.5
"""Ratios of 1 to 10**1.5 have colours of their own; farther ones have the last."""

BESIDE = ("rows", "pierce", "filter", "new aims")
ALONE = ("verdicts", "falloff", "pierce", "filter", "in sight of occluders", "in sight of all", "new aims")
HEADS = {
    "in sight of occluders": "sheltered by\noccluders",
    "in sight of all": "sheltered\nby all",
    "new aims": "new\naims",
}

Cells = Mapping[tuple[str, str], Mapping[str, float]]


def cells_of(found: Mapping[str, Any], objects: int) -> dict[tuple[str, str], dict[str, float]]:
    """Times of each weapon and question by side, ns a shot."""
    cells = {}
    for cell in found["cells"]:
        if cell["section"] == "weapons" and cell["objects"] == objects:
            weapon, asked = cell["what"].rsplit(", ", 1)
            cells[weapon, asked] = {name: side["min_ns"] for name, side in cell["sides"].items()}
    return cells


def ratio_beside(cells: Cells, weapon: str, asked: str, mode: str) -> float:
    """How many times as long the peer takes, or NaN."""
    sides = cells.get((weapon, asked), {})
    return next((sides[peer] / sides[mode] for peer in PEERS if peer in sides), math.nan)


def ratio_alone(cells: Cells, weapon: str, asked: str, mode: str) -> float:
    """How many times as long a shot takes as one that asks for rows alone, or NaN."""
    sides = cells.get((weapon, asked))
    return sides[mode] / cells[weapon, "rows"][mode] if sides else math.nan


def draw(found: Mapping[str, Any]) -> Figure:
    """Draw a panel for each form and each number of objects."""
    modes = ["numpy", "jit"] if found["settings"]["jit"] else ["numpy"]
    counts = sorted({cell["objects"] for cell in found["cells"] if cell["section"] == "weapons"})
    with looking_alike():
        figure = Figure(figsize=(4.5 * len(modes) + 0.8, 2.9 * len(counts) + 0.7), layout="constrained")
        figure.suptitle(
            "left: how many times as long a peer takes (pygame-ce's masks for patterns; for rays pymunk, an easier "
            "question)\nright: how many times as long a shot takes as one that asks for rows alone; blue is fast, "
            "red is slow",
            x=0.01, ha="left", fontsize=8,
        )  # fmt: skip
        every = figure.subplots(len(counts), len(modes), squeeze=False)
        for row, objects in zip(every, counts, strict=True):
            cells = cells_of(found, objects)
            for plot, mode in zip(row, modes, strict=True):
                _draw_panel(plot, cells, mode)
                plot.set_title(f"{objects} objects, {mode}", loc="left", weight="bold", size=8)
    return figure


def _draw_panel(plot: Axes, cells: Cells, mode: str) -> None:
    weapons = list(dict.fromkeys(weapon for weapon, _ in cells))
    beside = [[ratio_beside(cells, weapon, asked, mode) for asked in BESIDE] for weapon in weapons]
    alone = [[ratio_alone(cells, weapon, asked, mode) for asked in ALONE] for weapon in weapons]
    gap = np.full((len(weapons), 1), math.nan)
    ratios = np.concatenate([np.array(beside), gap, np.array(alone)], axis=1)
    heat = np.log10(np.concatenate([np.array(beside), gap, 1 / np.array(alone)], axis=1))
    plot.imshow(heat, cmap=COLORS, vmin=-DECADES, vmax=DECADES, aspect="auto")
    for (y, x), value in np.ndenumerate(ratios):
        if not math.isnan(value):
            dark = abs(heat[y, x]) > 0.7 * DECADES
            plot.text(x, y, shown(value), ha="center", va="center", size=6, color="white" if dark else "black")
    heads = [*BESIDE, "", *ALONE]
    plot.set_xticks(range(len(heads)), [HEADS.get(head, head) for head in heads], size=6, rotation=50, ha="left")
    plot.set_yticks(range(len(weapons)), weapons, size=6.5)
    plot.tick_params(length=0, top=False, bottom=False, labeltop=True, labelbottom=False, left=False)
    plot.grid(visible=False)
    for side in plot.spines.values():
        side.set_visible(False)


def shown(ratio: float) -> str:
    """A ratio in two digits."""
    return f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.1f}" if ratio >= 0.095 else f"{ratio:.2f}"


def main(arguments: Sequence[str]) -> None:
    """Read figures, and write the picture."""
    source, picture = arguments
    save_figure(draw(json.loads(Path(source).read_text())), Path(picture))


if __name__ == "__main__":
    main(sys.argv[1:])
