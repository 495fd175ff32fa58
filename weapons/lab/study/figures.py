"""Work-precision diagrams (error against time, a curve for each method), drawn with matplotlib if it is installed."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hitplanes.planes.files.png import write_bytes

from .study import Place, bound, front, places, setting_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect


DPI = 160  # a picture of 11 inches is 1760 px wide, and readable when shown at 1000
INK, FAINT, PAPER, HATCH = "#1d2733", "#66707c", "#ffffff", "#cfd5db"
LOOK: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "font.size": 9, "axes.edgecolor": FAINT, "axes.labelcolor": INK, "text.color": INK,
    "xtick.color": INK, "ytick.color": INK, "hatch.color": HATCH, "hatch.linewidth": 0.8, "savefig.facecolor": PAPER,
}  # fmt: skip
"""Style of all diagrams."""


@contextmanager
def looking_alike() -> Iterator[None]:
    """Apply the common style in the block, whatever the user's settings are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(LOOK)
        yield


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG; equal figures give equal bytes."""
    data = io.BytesIO()
    with looking_alike():
        figure.savefig(data, format="png", dpi=DPI, metadata={"Software": None})
    write_bytes(path, data.getvalue())


SIZE = (11.0, 7.2)  # of a diagram, inches
DECADES = 30  # least ratio of the ends of the time axis to the data
CLOSE = 1.12  # points whose times are within this ratio share a label
BLACK, ORANGE, SKY, GREEN, BLUE, RED, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
"""Colours that the colour-blind can tell apart: Okabe and Ito, "Color universal design" (2008)."""
Style = tuple[str, str]  # colour and mark of a curve
STYLES: dict[str, Style] = {
    "pixel planes": (BLUE, "o"), "pixels, pre-filter": (SKY, "D"), "pixels, broad phase": (SKY, "s"),
    "circle": (PURPLE, "o"), "circle about the pivot": (PURPLE, "P"), "box, re-boxed": (ORANGE, "X"),
    "box, refitted": (ORANGE, "s"), "oriented box": (RED, "D"), "boxes": (ORANGE, "v"), "convex polygon": (GREEN, "^"),
    "hull": (GREEN, "*"), "polygon": (GREEN, "p"), "triangles": (RED, "<"), "pymunk": (BLACK, "P"),
    "shapely": (BLACK, "X"), "pygame": (BLACK, "*"),
}  # fmt: skip
OTHERS = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (RED, "D"), (PURPLE, "v"), (SKY, "<"))
"""Styles for all other methods, in turn."""


def work_precision(question: Mapping[str, Any], title: str) -> Figure:
    """Draw a question of a study, given as JSON.

    Points without an error lie on a separate floor, below all others and below one wrong decision in all shots, which
    is labelled with the bound for this number of shots. The Pareto front goes through the points for which no other is
    both faster and more accurate.
    """
    from matplotlib.figure import Figure

    found, wrong, least = places(question), question["error"] == "wrong", bound(question)
    errors = [place.error for place in found if place.error > 0]
    floor = min([*errors, 1 / max(question["shots"], 1)] if wrong else errors or [1.0]) / 3
    others = iter(OTHERS * len(question["curves"]))
    with looking_alike():
        figure = Figure(figsize=SIZE, layout="constrained")
        plot = figure.add_subplot()
        x, y = zip(*[(place.us, place.error or floor) for place in front(found)], strict=True)
        label = "Pareto front: none is faster and less wrong"
        plot.plot(x, y, color="#c3c9d0", linewidth=7, alpha=0.8, drawstyle="steps-post", label=label, zorder=1)
        for curve in question["curves"]:
            own = [place for place in found if place.curve == curve["name"]]
            if own:
                _draw_curve(plot, own, curve["setting"], STYLES.get(curve["name"]) or next(others), floor)
        _write_words(plot, found, floor)
        _draw_axes(plot, question)
        if wrong:  # the smallest error rate that this number of shots can show
            _draw_level(plot, least, (6, 3), 0.8, "3/n", (1.0, 3, 0), va="center", fontsize=7.5, color=FAINT)
        if any(place.error == 0 for place in found):
            plot.set_ylim(bottom=floor / 1.8)
            text = f"none wrong in {question['shots']} shots: under 3/n = {least:.2g}" if wrong else "no error"
            _draw_level(plot, floor, (2, 3), 1, text, (0.01, 0, -11), fontsize=8, color=INK)
        plot.set_title(f"{title}\n{question['asks']}", loc="left", weight="bold", size=11)
        figure.legend(loc="outside right upper", frameon=False, fontsize=9, title="method", alignment="left")
    return figure


def _draw_axes(plot: Axes, question: Mapping[str, Any]) -> None:
    """Set the scales, the labels with their units, and the grid."""
    shares, wrong = "error of the share hit, mean", "wrong decisions a shot (missed and false hits)"
    time = "time a shot, microseconds (least of all runs); better is lower, and farther left"
    plot.set(xscale="log", yscale="log", xlabel=time, ylabel=shares if question["error"] == "share" else wrong)
    plot.grid(which="major", color="#dde2e7", linewidth=0.8)
    plot.set_axisbelow(True)
    plot.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    plot.xaxis.set_minor_formatter("")
    least, most = plot.get_xlim()
    plot.set_xlim(min(least, most / DECADES), max(most, least * DECADES))


def _draw_curve(plot: Axes, own: Sequence[Place], setting: str, style: Style, floor: float) -> None:
    """Draw a curve with its settings beside the points; points whose settings are words are not joined."""
    x, y = [place.us for place in own], [place.error or floor for place in own]
    joined = all(isinstance(place.setting, int | float) for place in own)
    color, mark = style
    label = own[0].curve + (f" ({setting})" if joined and setting not in ("", own[0].curve) else "")
    plot.plot(
        x, y, linestyle="-" if joined else "", color=color, marker=mark, label=label,
        markersize=10 if mark in "PX*" else 7.5, markeredgecolor="white", markeredgewidth=0.7, linewidth=1.4,
        clip_on=False, zorder=3,
    )  # fmt: skip
    for place, left, low in zip(own, x, y, strict=True):
        if joined and place.setting is not None:
            plot.annotate(setting_text(place.setting), (left, low), (5, 3), textcoords="offset points",
                          fontsize=7.5, color=color, path_effects=_halo(), zorder=4)  # fmt: skip


def _halo() -> list[AbstractPathEffect]:
    """Return an outline in the colour of the paper, which keeps text readable on lines."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2, foreground=PAPER)]


def _write_words(plot: Axes, found: Sequence[Place], floor: float) -> None:
    """Write settings that are words vertically; points close together share a label."""
    words = sorted(
        (place.us, place.error or floor, str(place.setting)) for place in found if isinstance(place.setting, str)
    )
    near: list[tuple[float, float, str]] = []
    for x, y, word in [*words, (float("inf"), 0.0, "")]:
        if near and (x > near[0][0] * CLOSE or y != near[0][1]):
            text = ", ".join(dict.fromkeys(word for _, _, word in near))
            plot.annotate(text, near[0][:2], (0, 8), textcoords="offset points", fontsize=7.5, rotation=90, color=INK,
                          ha="center", va="bottom", path_effects=_halo(), zorder=4)  # fmt: skip
            near = []
        near.append((x, y, word))


def _draw_level(
    plot: Axes, y: float, dashes: tuple[int, int], width: float, text: str, at: tuple[float, int, int], **how: Any
) -> None:
    """Draw a level line, and a text at a part of its length, moved by a number of points."""
    plot.axhline(y, color=FAINT, linewidth=width, linestyle=(0, dashes), zorder=0)
    plot.annotate(text, (at[0], y), at[1:], xycoords=("axes fraction", "data"), textcoords="offset points", **how)
