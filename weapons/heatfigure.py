"""The heat picture of a run of `stability`: predicates by families, a block for each method.

Colours are of cividis, which is read alike by the colour-blind and in grey; what matters is also told by a sign.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from weapons.families import FAMILIES
from weapons.figures import FAINT, HATCH, INK, PAPER, looking_alike
from weapons.predicates import PREDICATES
from weapons.tally import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["heat_figure", "powers", "rate"]

EMPTY = "#f3f5f7"

WIDTH, LEFT, RIGHT = 11.0, 1.75, 0.85
"""Of a heat picture, and of its margins, where the rows' names and the last column's are: inches."""

ROW, GAP, NAMES, HEADING, SCALE = 0.255, 0.42, 1.1, 0.62, 0.85
"""Heights of a row, of a block's title, of the columns' names, of the picture's title, and of the scale: inches."""

LIGHTEST = 0.12
"""Where the scale of colours begins: lighter ones would be read as none."""

DARK = 0.5
"""Below this brightness of a colour letters on it are white."""

FULL = 7
"""So many letters fill a cell."""


def powers(text: str) -> str:
    """Spell powers as 10^-6 with raised exponents."""
    return re.sub(r"\^(-?\d+)", r"$^{\1}$", text)


def heat_figure(study: Study) -> Figure:
    """Draw the wrong decisions of a run: a block for each method, predicates by families.

    The colour is the power of ten of the wrong ones in a million, their part is written in the cell. A cell without any
    is white and says 0; one that is not asked is hatched.
    """
    from matplotlib.figure import Figure

    blocks = {m: [p.name for p in PREDICATES if _is_asked(study, m, p.name)] for m in study.methods}
    blocks = {m: names for m, names in blocks.items() if names}
    height = HEADING + NAMES + sum(GAP + ROW * len(names) for names in blocks.values()) + SCALE
    with looking_alike():
        figure = Figure(figsize=(WIDTH, height))
        told = "" if study.complete else " (not complete)"
        title = f"Wrong decisions on input that is hard to decide{told}"
        figure.text(0.15 / WIDTH, 1 - 0.18 / height, title, weight="bold", size=13, va="top")
        run = f"seed {study.seed}{', quick' * study.quick}"
        told = f"Part of the answers that exact rational arithmetic contradicts; {run}"
        figure.text(0.15 / WIDTH, 1 - 0.46 / height, told, color=FAINT, va="top")
        top = height - HEADING - NAMES
        for k, (method, names) in enumerate(blocks.items()):
            top -= GAP + ROW * len(names)
            box = (LEFT / WIDTH, top / height, 1 - (LEFT + RIGHT) / WIDTH, ROW * len(names) / height)
            axes = figure.add_axes(box)
            _block(axes, study, method, names)
            if k == 0:
                _name_families(axes)
        _scale(figure, height)
    return figure


def _is_asked(study: Study, method: str, predicate: str) -> bool:
    return any(method in cell.methods for cell in study.cells if cell.predicate == predicate)


def _block(axes: Axes, study: Study, method: str, predicates: list[str]) -> None:
    """One method: a row for each predicate that it was asked."""
    from matplotlib.patches import Rectangle

    wide, high = len(FAMILIES), len(predicates)
    corner = (-0.5, -0.5)
    axes.add_patch(Rectangle(corner, wide, high, facecolor=EMPTY, edgecolor=HATCH, linewidth=0, hatch="////"))
    for y, predicate in enumerate(predicates):
        for x, family in enumerate(FAMILIES):
            cell = study.cell(predicate, family)
            if cell is not None and method in cell.methods:
                _square(axes, x, y, cell.methods[method].per_million)
    total, name = study.total(method), f"{method} {study.versions.get(method, '')}".strip()
    axes.text(-0.5, -0.72, name, weight="bold", size=10.5)
    axes.text(wide - 0.5, -0.72, f"{total.wrong:,} wrong of {total.cases:,}", ha="right", size=9.5)
    axes.set(xlim=(-0.5, wide - 0.5), ylim=(high - 0.5, -0.5), xticks=[])
    axes.set_yticks(range(high), predicates)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _square(axes: Axes, x: int, y: int, per_million: float) -> None:
    """A cell: its colour and what it says."""
    from matplotlib.patches import Rectangle

    color = _color(per_million) if per_million else (1.0, 1.0, 1.0)
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=PAPER, linewidth=0))
    axes.add_patch(
        Rectangle(
            (x - 0.47, y - 0.45), 0.94, 0.9, facecolor=color, edgecolor=HATCH, linewidth=0 if per_million else 0.8
        )
    )
    dark = color[0] * 0.3 + color[1] * 0.59 + color[2] * 0.11 < DARK
    told = rate(per_million) if per_million else "0"
    size = 8 if len(told) < FULL else 7
    axes.text(x, y, told, ha="center", va="center_baseline", color=PAPER if dark else INK, size=size)


def _color(per_million: float) -> tuple[float, float, float]:
    """A colour of cividis, the darker the more are wrong."""
    from matplotlib import colormaps

    share = min(max(math.log10(per_million) / 6, 0.0), 1.0)
    red, green, blue, _ = colormaps["cividis_r"](LIGHTEST + (1 - LIGHTEST) * share)
    return red, green, blue


def rate(per_million: float) -> str:
    """Tell a part in a few letters: per cent, or in a million where that is less than a thousandth."""
    value, unit = (per_million / 10_000, "%") if per_million >= 1000 else (per_million, "ppm")
    return f"{value:.0f} {unit}" if value >= 10 else f"{value:.2g} {unit}"


def _name_families(axes: Axes) -> None:
    """Above the first block, slanting: the lower blocks have the same columns."""
    axes.set_xticks(range(len(FAMILIES)), [powers(name) for name in FAMILIES.values()])
    axes.tick_params(axis="x", labeltop=True, labelbottom=False, rotation=38, pad=19)
    for label in axes.get_xticklabels():
        label.set(ha="left", va="bottom", rotation_mode="anchor")


def _scale(figure: Figure, height: float) -> None:
    """Tell what colours and signs say, below all blocks."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm

    colors = ListedColormap([_color(10 ** (6 * k / 255)) for k in range(256)])
    axes = figure.add_axes((LEFT / WIDTH, 0.5 / height, 0.48, 0.14 / height))
    bar = figure.colorbar(ScalarMappable(LogNorm(1, 1e6), colors), cax=axes, orientation="horizontal")
    bar.set_label("wrong decisions in a million (1 ppm to all)", labelpad=1)
    bar.outline.set_visible(False)
    figure.text(LEFT / WIDTH + 0.52, 0.57 / height, "0: none wrong      hatched: not asked", va="center")
