"""The page around the pictures of a report: title, legend of what is present, cards in columns, footer."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence, Set
from typing import Any, NamedTuple, Protocol

import cv2
import numpy as np

from planes.arrays import Image
from weapons.marks import HEAT, LET_THROUGH, MARKS, SKETCH, glyph
from weapons.signs import SIGNS, sign_mark
from weapons.world import DASHED, HATCH, OUTLINES, World

__all__ = [
    "CARD", "EDGE", "FAINT", "GROUND", "INK", "LINE", "TOP", "Entry", "Legend", "Text", "clipped", "draw_texts",
    "legend_of", "page_of", "sign_entries", "verdict_mark",
]  # fmt: skip

Color = tuple[int, int, int]

EDGE, TOP = 16, 44
"""Left edge of the picture on the page, and its top, px."""

LINE, COLUMN, NARROWEST, GAP = 19, 464, 1000, 12
"""Height of a line, least width of a card, least width of a page, space between cards, px."""

GROUND, CARD, INK, FAINT = (24, 26, 30), (35, 38, 44), (238, 240, 244), (158, 164, 174)

LETTER, ENTRY_GAP = 8, 28
"""About the width of a letter, and the space around an entry of the legend, px."""

SIZE = 0.42
"""Scale of OpenCV's font, about 8 px a letter."""


NAMED_SIGNS = [name for name in SIGNS if name not in ("swept", "goes in", "comes out", "number")]
"""Signs of rays that a legend has."""


class Text(NamedTuple):
    """A line of text: (x, y) is the left end of its base line, px; its right end, or its middle."""

    x: int
    y: int
    text: str
    color: Color = INK
    bold: bool = False
    right: bool = False
    middle: bool = False


class Drawn(Protocol):
    """A card: it knows its height and draws itself."""

    @property
    def height(self) -> int:
        """Height, px."""

    def draw(self, page: Image, x: int, y: int, wide: int) -> list[Text]:
        """Draw it with its top left at (x, y), and return its texts."""


def page_of(
    report: Mapping[str, Any], world: World, texts: Sequence[Text], cards: Sequence[Drawn]
) -> tuple[Image, list[Text]]:
    """Lay a page around the enlarged world; texts, with those of the world, are drawn later."""
    image = world.image
    width = max(image.shape[1] + 2 * EDGE, NARROWEST)
    columns = max(1, (width - 2 * EDGE + GAP) // (COLUMN + GAP))
    wide = (width - 2 * EDGE - GAP * (columns - 1)) // columns
    legend = legend_of(report, world.painted, width)
    bottoms = [TOP + image.shape[0] + 14 + legend.height] * columns
    places = []
    for card in cards:
        column = bottoms.index(min(bottoms))
        places.append((EDGE + column * (wide + GAP), bottoms[column]))
        bottoms[column] += card.height + GAP
    page = np.empty((max(bottoms) + 46, width, 3), np.uint8)
    page[:] = GROUND
    left = (width - image.shape[1]) // 2
    page[TOP : TOP + image.shape[0], left : left + image.shape[1]] = image
    every = [text._replace(x=text.x + left, y=text.y + TOP) for text in texts]
    every += [Text(EDGE, 28, clipped(report["scene"]["name"], width // 2), INK, bold=True), _summary(report, width)]
    every += legend.draw(page, EDGE, TOP + image.shape[0] + 14)
    for card, (x, y) in zip(cards, places, strict=True):
        every += card.draw(page, x, y, wide)
    return page, [*every, *_footer(report, width, page.shape[0])]


def draw_texts(page: Image, texts: Sequence[Text]) -> None:
    """Draw the text layer."""
    for text in texts:
        shown = plain(text.text)
        x = text.x - text_width(shown) * (2 * text.right + text.middle) // 2
        font = cv2.FONT_HERSHEY_DUPLEX if text.bold else cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(page, shown, (x, text.y), font, SIZE, text.color, 1, cv2.LINE_AA)


def plain(text: str) -> str:
    """A text in letters that the font has: without accents, on one line, and a question mark for what it has not."""
    bare = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return "".join(c if c.isprintable() else " " for c in bare).encode("ascii", "replace").decode()


def text_width(text: str) -> int:
    """Width of a text, px."""
    return int(cv2.getTextSize(plain(text), cv2.FONT_HERSHEY_SIMPLEX, SIZE, 1)[0][0])


def clipped(text: str, width: int) -> str:
    """Shorten a text to a width, px."""
    text = text[: max(width, 0)]  # a letter takes a pixel at least
    if text_width(text) <= width:
        return text
    while text and text_width(text + "...") > width:
        text = text[:-1]
    return text + "..."


class Entry(NamedTuple):
    """An entry of the legend: its word, and a picture (14, w, 3) of its mark."""

    word: str
    mark: Image


class Legend:
    """Entries side by side, in as many lines as they take; widths are not taken from the font, which differs."""

    def __init__(self, entries: Sequence[Entry], width: int) -> None:
        self.entries = entries
        self.places: list[tuple[int, int]] = []
        x, y = 0, 0
        for entry in entries:
            wide = entry.mark.shape[1] + LETTER * len(entry.word) + ENTRY_GAP
            if x and x + wide > width - 2 * EDGE:
                x, y = 0, y + 26
            self.places.append((x, y))
            x += wide
        self.height = y + 26 + 8 if entries else 8

    def draw(self, page: Image, x: int, y: int) -> list[Text]:
        """Draw the marks and return the words."""
        texts = []
        for entry, (left, top) in zip(self.entries, self.places, strict=True):
            wide = entry.mark.shape[1]
            page[y + top : y + top + 14, x + left : x + left + wide] = entry.mark
            texts.append(Text(x + left + wide + 6, y + top + 12, entry.word, FAINT))
        return texts


def legend_of(report: Mapping[str, Any], painted: Set[str], width: int) -> Legend:
    """Only what the picture has: verdicts or their heat, outlines, hatching."""
    heat = report["batch"]["heat"]["counts"].get("hit", ()) if report["batch"] else ()
    entries = [Entry(v, verdict_mark(v)) for v in reversed(MARKS) if v in painted and not (heat and v == "hit")]
    if heat and "hit" in painted:
        scale = np.repeat(np.array(HEAT, np.uint8)[None], 14, axis=0)
        entries.insert(0, Entry(f"1 to {max(run[3] for run in heat)} hits{_per(report)}", np.repeat(scale, 5, axis=1)))
    told = "other target" if painted & {"object hit", "object blocked"} else "target"
    for kind, word in (
        ("hit", "object hit"),
        ("blocked", "object blocked"),
        ("other", told),
        ("now", "where it is now"),
    ):
        if f"object {kind}" in painted:
            entries.append(Entry(word, _outlined(kind)))
    for name, color in SKETCH.items():
        if name in painted:
            entries.append(Entry(name, _sketched(color, name)))
    entries += sign_entries(painted)
    if "occluder" in painted:
        rows, columns = np.mgrid[:14, :14]
        mark = _blank(14)
        mark[(rows + columns) % 6 < 2] = HATCH
        entries.append(Entry("occluder", mark))
    return Legend(entries, width)


def sign_entries(painted: Set[str]) -> list[Entry]:
    """What a picture has of rays."""
    return [Entry(name, sign_mark(name)) for name in NAMED_SIGNS if f"ray: {name}" in painted]


def _per(report: Mapping[str, Any]) -> str:
    """What a count of heat belongs to, where that is not one pixel."""
    cell = report["batch"]["heat"]["cell"]
    return f" in {cell} x {cell} px" if cell > 1 else ""


def verdict_mark(verdict: str, size: int = 14) -> Image:
    """Mark (size, size, 3) of a verdict, for a legend."""
    mark = _blank(size)
    mark[glyph(verdict, size)] = MARKS[verdict][0]
    return mark


def _blank(size: int) -> Image:
    mark = np.empty((size, size, 3), np.uint8)
    mark[:] = (70, 74, 82)
    return mark


def _outlined(kind: str) -> Image:
    mark, thick = _blank(14), 1 if kind == "other" else 2
    border = np.ones((14, 14), np.bool_)
    border[thick:-thick, thick:-thick] = False
    rows, columns = np.ogrid[:14, :14]
    mark[border & ((kind not in DASHED) | ((rows + columns) // 3 % 2 == 0))] = OUTLINES[kind][0]
    return mark


def _sketched(color: Color, name: str) -> Image:
    """Outline of a volume, a rhombus to be told from an object's; or a cell, with its ground where it was opened."""
    mark = _blank(14)
    if name.startswith("cell"):
        if name == "cell opened":
            mark[:] = (np.array(color) + 2 * mark.astype(np.int64)) // 3
        mark[[0, -1]] = mark[:, [0, -1]] = color
        return mark
    rows, columns = np.mgrid[:14, :14]
    away = abs(2 * rows - 13) + abs(2 * columns - 13)
    mark[(away <= 13) & (away > (7 if name == LET_THROUGH else 9))] = color
    return mark


def _of(batch: Mapping[str, Any] | None, key: str) -> Sequence[Any]:
    found: Sequence[Any] = batch[key] if batch else ()
    return found


def _summary(report: Mapping[str, Any], width: int) -> Text:
    shots, batch = report["shots"], report["batch"]
    objects = {row["object"] for shot in shots for row in shot["rows"]} | {o["object"] for o in _of(batch, "objects")}
    told = f"{_counted(batch['shots'] if batch else len(shots), 'shot')}, {_counted(len(objects), 'object')} hit"
    if report.get("now", {}).get("tick") is not None:
        told = f"tick {report['now']['tick']:g}: {told}"
    return Text(width - EDGE, 28, told, FAINT, right=True)


def _footer(report: Mapping[str, Any], width: int, height: int) -> list[Text]:
    """Scene, version and plan; weapons and seeds are in the cards."""
    scene = report["scene"]
    plans = [shot["plan"] for shot in report["shots"]] + list(_of(report["batch"], "plan"))
    ran = dict.fromkeys(stage["stage"] for plan in plans for stage in plan["ran"])
    left = [s["stage"] for s in plans[0]["left_out"]] if plans else []
    left = [name for name in left if all(name in [s["stage"] for s in plan["left_out"]] for plan in plans)]
    told = f"scene {scene['hash']}, version {scene['version']}, hitplanes {report['version']}"
    plan = "; ".join(f"{word}: {', '.join(stages)}" for word, stages in (("ran", ran), ("left out", left)) if stages)
    return [Text(EDGE, height - 30, told, FAINT), Text(EDGE, height - 12, clipped(plan, width - 2 * EDGE), FAINT)]


def _counted(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")
