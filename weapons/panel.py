"""The page around a report's picture: title, legend of what is present, a card for each shot, footer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from planes.arrays import Image
from weapons.marks import MARKS, glyph

__all__ = ["HATCH", "OUTLINE", "OUTLINE_HIT", "Text", "draw_texts", "page_of"]

Color = tuple[int, int, int]

EDGE, TOP = 16, 44
"""Left edge of the picture on the page, and its top, px."""

LINE, COLUMN, NARROWEST, GAP = 19, 420, 900, 12
"""Height of a line, least width of a card, least width of a page, space between cards, px."""

GROUND, CARD, INK, FAINT = (24, 26, 30), (35, 38, 44), (238, 240, 244), (158, 164, 174)
OUTLINE_HIT, OUTLINE, HATCH = (255, 200, 40), (240, 240, 240), (200, 212, 230)

ENTRY = 124
"""Width of an entry of the legend, px; not taken from the text, whose width depends on the version of OpenCV."""

SIZE = 0.42
"""Scale of OpenCV's font, about 8 px a letter."""

HIT_LINES = 24
"""Rows of a card; the JSON has them all."""

WHY_NOT_LINES = 3
"""Objects that a card names as not hit; the JSON has them all."""


HEADER = ["object hit", "pixels", "of visible", "nearest"]


class Text(NamedTuple):
    """A line of text: (x, y) is the left end of its base line, or the right end, px."""

    x: int
    y: int
    text: str
    color: Color = INK
    bold: bool = False
    right: bool = False


def page_of(report: Mapping[str, Any], world: Image, badges: Sequence[Text]) -> tuple[Image, list[Text]]:
    """Lay a page around the enlarged world; texts, with those of the world, are drawn later."""
    width = max(world.shape[1] + 2 * EDGE, NARROWEST)
    columns = max(1, (width - 2 * EDGE + GAP) // (COLUMN + GAP))
    wide = (width - 2 * EDGE - GAP * (columns - 1)) // columns
    cards = [_card_lines(shot) for shot in report["shots"]]
    bottoms = [TOP + world.shape[0] + 46] * columns
    places = []
    for lines in cards:
        column = bottoms.index(min(bottoms))
        places.append((EDGE + column * (wide + GAP), bottoms[column]))
        bottoms[column] += len(lines) * LINE + 62 + GAP
    page = np.empty((max(bottoms) + 34, width, 3), np.uint8)
    page[:] = GROUND
    left = (width - world.shape[1]) // 2
    page[TOP : TOP + world.shape[0], left : left + world.shape[1]] = world
    texts = [badge._replace(x=badge.x + left, y=badge.y + TOP) for badge in badges]
    texts += [Text(EDGE, 28, _clipped(report["scene"]["name"], width // 2), INK, bold=True), _summary(report, width)]
    texts += _legend(page, report, TOP + world.shape[0] + 14)
    for number, (shot, lines, (x, y)) in enumerate(zip(report["shots"], cards, places, strict=True), 1):
        texts += _card(page, shot, number, lines, (x, y, wide))
    return page, [*texts, *_footer(report, width, page.shape[0])]


def draw_texts(page: Image, texts: Sequence[Text]) -> None:
    """Draw the text layer; what the font has no letter for is shown as a question mark."""
    for text in texts:
        shown = text.text.encode("ascii", "replace").decode()
        x = text.x - text_width(shown) if text.right else text.x
        font = cv2.FONT_HERSHEY_DUPLEX if text.bold else cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(page, shown, (x, text.y), font, SIZE, text.color, 1, cv2.LINE_AA)


def text_width(text: str) -> int:
    """Width of a text, px."""
    return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, SIZE, 1)[0][0])


def _summary(report: Mapping[str, Any], width: int) -> Text:
    shots = report["shots"]
    objects = {row["object"] for shot in shots for row in shot["rows"]}
    told = f"{_counted(len(shots), 'shot')}, {_counted(len(objects), 'object')} hit"
    return Text(width - EDGE, 28, told, FAINT, right=True)


def _legend(page: Image, report: Mapping[str, Any], y: int) -> list[Text]:
    """Only what the picture has: verdicts, outlines, hatching."""
    present = {verdict for shot in report["shots"] for verdict in shot["samples"]}
    texts, x = [], EDGE
    for verdict in reversed(MARKS):
        if verdict in present:
            color, _ = MARKS[verdict]
            page[y : y + 14, x : x + 14] = (70, 74, 82)
            page[y : y + 14, x : x + 14][glyph(verdict, 14)] = color
            texts.append(Text(x + 20, y + 12, verdict, FAINT))
            x += ENTRY
    hit = any(shot["rows"] for shot in report["shots"])
    for color, name, thick, there in ((OUTLINE_HIT, "object hit", 3, hit), (OUTLINE, "other target", 1, True)):
        if there:
            cv2.rectangle(page, (x, y), (x + 13, y + 13), color, thick)
            texts.append(Text(x + 20, y + 12, name, FAINT))
            x += ENTRY
    if report["scene"]["occluders"]:
        rows, columns = np.mgrid[:14, :14]
        page[y : y + 14, x : x + 14] = (70, 74, 82)
        page[y : y + 14, x : x + 14][(rows + columns) % 6 < 2] = HATCH
        texts.append(Text(x + 20, y + 12, "occluder", FAINT))
    return texts


def _card(
    page: Image, shot: Mapping[str, Any], number: int, lines: list[list[str]], at: tuple[int, int, int]
) -> list[Text]:
    """One shot: what was fired, a bar of its verdicts, and the lines."""
    x, y, wide = at
    page[y : y + len(lines) * LINE + 62, x : x + wide] = CARD
    cv2.circle(page, (x + 18, y + 18), 10, (255, 255, 255), 1)
    label = str(number)
    texts = [
        Text(x + 18 - 4 * len(label), y + 22, label, INK, bold=True),
        Text(x + 36, y + 22, _clipped(shot["weapon"], wide // 3), INK, bold=True),
        Text(x + wide - 10, y + 22, _clipped(_fired(shot), wide * 2 // 3 - 50), FAINT, right=True),
    ]
    _bar(page, shot["verdicts"], x + 10, y + 36, wide - 20)
    for row, cells in enumerate(lines):
        base = y + 66 + row * LINE
        color = FAINT if len(cells) == 1 or cells == HEADER else INK
        texts.append(Text(x + 10, base, _clipped(cells[0], wide - 20 if len(cells) == 1 else wide - 250), color))
        for cell, offset in zip(cells[1:], (160, 90, 10), strict=False):
            texts.append(Text(x + wide - offset, base, cell, color, right=True))
    return texts


def _card_lines(shot: Mapping[str, Any]) -> list[list[str]]:
    """Lines of a card: verdict counts, a table of the objects hit, and some that were not."""
    counts = [f"{shot['verdicts'][verdict]} {verdict}" for verdict in reversed(MARKS) if shot["verdicts"][verdict]]
    lines = [[", ".join(counts) or "no samples"]]
    if shot["rows"]:
        lines.append(HEADER)
    rounds = len({row["round"] for row in shot["rows"]}) > 1
    for row in shot["rows"][:HIT_LINES]:
        name = f"{row['name']}, round {row['round'] + 1}" if rounds else row["name"]
        distance = f"{row['distance2'] ** 0.5:.1f} px"
        lines.append([name, str(row["pixels"]), _percent(row["shares"]["of_visible"]), distance])
    if len(shot["rows"]) > HIT_LINES:
        lines.append([f"and {len(shot['rows']) - HIT_LINES} more"])
    if shot["blockers"]:
        blocked = [f"{entry['name']} ({entry['samples']})" for entry in shot["blockers"]]
        lines.append(["blocked by " + ", ".join(blocked)])
    for entry in shot["why_not"][:WHY_NOT_LINES]:
        lines.append([f"not {entry['name']}: {_reason(entry)}"])
    if len(shot["why_not"]) > WHY_NOT_LINES:
        lines.append([f"and {len(shot['why_not']) - WHY_NOT_LINES} more near it"])
    return lines


def _reason(entry: Mapping[str, Any]) -> str:
    if entry["reason"] == "missed":
        return f"missed by {entry['distance']:.1f} px"
    if entry["reason"] == "behind":
        return "behind " + ", ".join(by["name"] for by in entry["by"])
    return {"category": "not an accepted category", "excluded": "its owner is excluded", "outside": "out of bounds"}[
        entry["reason"]
    ]


def _fired(shot: Mapping[str, Any]) -> str:
    parts = [f"at {shot['at'][0]:.12g}, {shot['at'][1]:.12g}"]
    if shot["aim"] is not None:
        parts.append(f"aim {shot['aim']:g} deg")
    if shot["toward"] is not None:
        parts.append(f"toward {shot['toward'][0]:.12g}, {shot['toward'][1]:.12g}")
    if shot["seed"]:
        parts.append(f"seed {shot['seed']}")
    if shot["accept"] is not None:
        parts.append("accepts " + " ".join(shot["accept"]))
    if shot["exclude"]:
        parts.append("excludes " + " ".join(e["name"] for e in shot["exclude"]))
    return ", ".join(parts)


def _bar(page: Image, verdicts: Mapping[str, int], x: int, y: int, wide: int) -> None:
    """Verdicts of a shot as parts of one bar."""
    total = sum(verdicts.values())
    page[y : y + 8, x : x + wide] = (58, 62, 70)
    begun = 0
    for verdict in ("hit", "occluded", "filtered", "outside"):
        done = begun + verdicts[verdict]
        if total:
            page[y : y + 8, x + begun * wide // total : x + done * wide // total] = MARKS[verdict][0]
        begun = done


def _footer(report: Mapping[str, Any], width: int, height: int) -> list[Text]:
    scene = report["scene"]
    ran = sorted({stage["stage"] for shot in report["shots"] for stage in shot["plan"]["ran"]})
    left = f"scene {scene['hash']}, version {scene['version']}, hitplanes {report['version']}"
    return [
        Text(EDGE, height - 12, left, FAINT),
        Text(width - EDGE, height - 12, "stages: " + ", ".join(ran) if ran else "", FAINT, right=True),
    ]


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share == 0 or share >= 0.001 else "< 0.1 %"


def _clipped(text: str, width: int) -> str:
    """Shorten a text to a width."""
    if text_width(text) <= width:
        return text
    while text and text_width(text + "...") > width:
        text = text[:-1]
    return text + "..."


def _counted(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")
