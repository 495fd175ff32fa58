"""A work-precision diagram: the error of each method against its time a shot, one curve for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from weapons.figures import FAINT, INK, PAPER, looking_alike
from weapons.studywords import Place, bound, front, places, setting_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect

__all__ = ["work_precision"]

SIZE = (11.0, 7.2)
"""Inches."""

BLACK, ORANGE, SKY, GREEN, BLUE, RED, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
"""Okabe and Ito, "Color universal design" (2008): told apart by the colour-blind. Shapes of the marks tell the rest."""


DECADES = 30
"""Least ratio of the ends of the axis of time."""

CLOSE = 1.12
"""Points of which the times are within this ratio have one label."""


class Style(NamedTuple):
    """Of a curve: colour and mark."""

    color: str
    mark: str


STYLES = {
    "pixel planes": Style(BLUE, "o"),
    "pixels, pre-filter": Style(SKY, "D"),
    "pixels, broad phase": Style(SKY, "s"),
    "circle": Style(PURPLE, "o"),
    "circle about the pivot": Style(PURPLE, "P"),
    "box, re-boxed": Style(ORANGE, "X"),
    "box, refitted": Style(ORANGE, "s"),
    "oriented box": Style(RED, "D"),
    "boxes": Style(ORANGE, "v"),
    "convex polygon": Style(GREEN, "^"),
    "hull": Style(GREEN, "*"),
    "polygon": Style(GREEN, "p"),
    "triangles": Style(RED, "<"),
    "pymunk": Style(BLACK, "P"),
    "shapely": Style(BLACK, "X"),
    "pygame": Style(BLACK, "*"),
}
OTHERS = (
    Style(BLUE, "o"), Style(ORANGE, "s"), Style(GREEN, "^"), Style(RED, "D"), Style(PURPLE, "v"), Style(SKY, "<"),
)  # fmt: skip
"""For methods without a style of their own, in turn."""


def work_precision(question: Mapping[str, Any], title: str) -> Figure:
    """Draw a question of a study, given as JSON.

    Points without an error lie on a floor of their own, if there are any, with the bound that the number of shots
    allows; the Pareto front goes through those than which none is both faster and less wrong.
    """
    from matplotlib.figure import Figure

    found = places(question)
    floor = _floor(question, found)
    others = iter(OTHERS * len(question["curves"]))
    with looking_alike():
        figure = Figure(figsize=SIZE, layout="constrained")
        plot = figure.add_subplot()
        _draw_front(plot, front(found), floor)
        for curve in question["curves"]:
            own = [place for place in found if place.curve == curve["name"]]
            if own:
                _draw_curve(plot, own, curve["setting"], STYLES.get(curve["name"]) or next(others), floor)
        _write_words(plot, found, floor)
        _draw_axes(plot, question)
        if question["error"] == "wrong":
            _draw_bound(plot, question)
        if any(place.error == 0 for place in found):
            _draw_floor(plot, question, floor)
        plot.set_title(f"{title}\n{question['asks']}", loc="left", weight="bold", size=11)
        figure.legend(loc="outside right upper", frameon=False, fontsize=9, title="method", alignment="left")
    return figure


def _draw_axes(plot: Axes, question: Mapping[str, Any]) -> None:
    """Scales, labels with their units, and a grid."""
    plot.set(
        xscale="log",
        yscale="log",
        xlabel="time a shot, microseconds (least of all runs); better is lower, and farther left",
        ylabel=_asked(question),
    )
    plot.grid(which="major", color="#dde2e7", linewidth=0.8)
    plot.set_axisbelow(True)
    plot.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    plot.xaxis.set_minor_formatter("")
    least, most = plot.get_xlim()
    plot.set_xlim(min(least, most / DECADES), max(most, least * DECADES))


def _asked(question: Mapping[str, Any]) -> str:
    if question["error"] == "share":
        return "error of the share hit, mean"
    return "wrong decisions a shot (missed and false hits)"


def _floor(question: Mapping[str, Any], found: Sequence[Place]) -> float:
    """Where points without an error are drawn: below all others, and below one wrong decision in all shots."""
    least = min((place.error for place in found if place.error > 0), default=1.0)
    one = least if question["error"] == "share" else 1 / max(question["shots"], 1)
    return min(least, one) / 3


def _draw_curve(plot: Axes, own: Sequence[Place], setting: str, style: Style, floor: float) -> None:
    """A curve, with its settings beside the points; those that are words are not joined."""
    x, y = [place.us for place in own], [place.error or floor for place in own]
    joined = all(isinstance(place.setting, int | float) for place in own)
    label = own[0].curve + (f" ({setting})" if joined and setting not in ("", own[0].curve) else "")
    plot.plot(
        x, y, linestyle="-" if joined else "", color=style.color, marker=style.mark, label=label,
        markersize=10 if style.mark in "PX*" else 7.5, markeredgecolor="white", markeredgewidth=0.7, linewidth=1.4,
        clip_on=False, zorder=3,
    )  # fmt: skip
    for place, left, low in zip(own, x, y, strict=True):
        if joined and place.setting is not None:
            plot.annotate(setting_text(place.setting), (left, low), (5, 3), textcoords="offset points",
                          fontsize=7.5, color=style.color, path_effects=_halo(), zorder=4)  # fmt: skip


def _halo() -> list[AbstractPathEffect]:
    """Paper about letters, by which they are read on lines and marks."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2, foreground=PAPER)]


def _write_words(plot: Axes, found: Sequence[Place], floor: float) -> None:
    """Settings that are words, upright; those of points that are close together in one line."""
    words = sorted(
        (place.us, place.error or floor, str(place.setting)) for place in found if isinstance(place.setting, str)
    )
    near: list[tuple[float, float, str]] = []
    for x, y, word in [*words, (float("inf"), 0.0, "")]:
        if near and (x > near[0][0] * CLOSE or y != near[0][1]):
            told = ", ".join(dict.fromkeys(word for _, _, word in near))
            plot.annotate(told, near[0][:2], (0, 8), textcoords="offset points", fontsize=7.5, rotation=90, color=INK,
                          ha="center", va="bottom", path_effects=_halo(), zorder=4)  # fmt: skip
            near = []
        near.append((x, y, word))


def _draw_front(plot: Axes, best: Sequence[Place], floor: float) -> None:
    """What none is better than, as steps."""
    x, y = [place.us for place in best], [place.error or floor for place in best]
    told = "Pareto front: none is faster and less wrong"
    plot.plot(x, y, color="#c3c9d0", linewidth=7, alpha=0.8, drawstyle="steps-post", label=told, zorder=1)


def _draw_bound(plot: Axes, question: Mapping[str, Any]) -> None:
    """What so many shots can tell at the least."""
    least = bound(question)
    plot.axhline(least, color=FAINT, linewidth=0.8, linestyle=(0, (6, 3)), zorder=0)
    plot.annotate("3/n", (1.0, least), (3, 0), xycoords=("axes fraction", "data"), textcoords="offset points",
                  va="center", fontsize=7.5, color=FAINT)  # fmt: skip


def _draw_floor(plot: Axes, question: Mapping[str, Any], floor: float) -> None:
    """The line of points without an error, and what it means."""
    plot.axhline(floor, color=FAINT, linewidth=1, linestyle=(0, (2, 3)), zorder=0)
    plot.set_ylim(bottom=floor / 1.8)
    told = "no error"
    if question["error"] == "wrong":
        told = f"none wrong in {question['shots']} shots: under 3/n = {bound(question):.2g}"
    plot.annotate(told, (0.01, floor), (0, -11), xycoords=("axes fraction", "data"), textcoords="offset points",
                  fontsize=8, color=INK)  # fmt: skip
