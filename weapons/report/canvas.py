"""Canvas of a report: the scene, dimmed and enlarged, and the page around it with title, legend, cards and footer."""

from __future__ import annotations

import unicodedata
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence, Set
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hitplanes.planes.bits.label_plane import id_plane
from hitplanes.planes.common.checks import Bools, Floats, Image, Ints
from hitplanes.planes.files.png import cv2
from hitplanes.planes.grid.spans import Box, Spans, each_pixel
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.render import GROUND, draw_view
from hitplanes.planes.scene.scene import Scene

from .phrases import counted, unseen
from .symbols import (
    HEAT,
    MARKS,
    SIGNS,
    SKETCH,
    TINT,
    Color,
    mark_of,
    paint,
    sign_mark,
    sketch_mark,
    tiled_glyph,
    verdict_mark,
)

if TYPE_CHECKING:
    from .cards import Card

WIDTH, HEIGHT, LARGEST = 1600, 1200, 24  # largest size of an enlarged view, px, and largest factor
DIM = 125  # brightness of the scene, of 255
OUTSIDE, HATCH = (18, 19, 22), (200, 212, 230)
OUTLINES = {
    "hit": ((255, 200, 40), 255),
    "blocked": ((86, 180, 233), 255),
    "other": ((240, 240, 240), 130),
    "now": ((206, 156, 255), 255),
    "shadow": ((255, 255, 255), 200),
}
"""Colour and opacity of the outline of an object that was hit, of one that was only blocked, of any other, of the
present place of an object that has moved, and of what a shot does not see."""

THIN, DASHED = ("other", "shadow"), ("blocked", "now")
PLUS = np.array([(0, 1, 0), (1, 1, 1), (0, 1, 0)], np.uint8)  # a pixel and its four neighbours
DASH = 5  # length of the dashes of an outline, px
DARK = (20, 22, 26)  # ground under thin lines, rings and labels
SHADOW, SHADOW_ALPHA = (12, 14, 18), 170  # ground under the marks of hits, which keeps the gaps between them dark
HEAT_ALPHA = 235  # opacity of the heat of hits, of 255
LINE_ALPHA = 60  # the same of the cells of rays that decide nothing
LONE_PX, LONE_PIXELS = 3, 2  # a hit lies alone if so few pixels are hit within so many px of it
RINGS_MAX, RING = 400, 6  # most rings around hits that lie alone, and their radius, px
OUTLINES_MAX = 1000  # most objects that are outlined in addition to those that were hit or blocked


def factor_of(view: Box, width: int = WIDTH, height: int = HEIGHT) -> int:
    """Greatest whole factor, up to LARGEST, by which a view fits a size."""
    return max(1, min(width // (view[2] - view[0] + 1), height // (view[3] - view[1] + 1), LARGEST))


class World:
    """Enlarged picture of a view of the world; `painted` lists what was drawn on it, for the legend.

    Parameters
    ----------
    scene : scene to draw; None draws the bounds alone
    bounds : bounds of the world (x_min, y_min, x_max, y_max), or None
    view : inclusive box of the world, px
    factor : side of a pixel of the world in the picture, px
    light : brightness of the scene, of 255
    """

    def __init__(
        self, scene: Scene | None, bounds: Sequence[int] | None, view: Box, factor: int, light: int = DIM
    ) -> None:
        self.scene, self.view, self.factor = scene, view, factor
        self.painted: set[str] = set()
        shape = view[3] - view[1] + 1, view[2] - view[0] + 1
        ground = np.full((*shape, 3), GROUND, np.uint8) if scene is None else _dimmed(scene, view, light)
        if bounds is not None:
            inside = np.zeros(shape, np.bool_)
            fill(inside, view, bounds)
            ground[~inside] = OUTSIDE
        self.image: Image = enlarged(ground, factor)
        if bounds is not None and view != tuple(bounds):
            _frame(self.image, view, bounds, factor)
        if scene is not None and len(scene.ids(Role.OCCLUDER)):
            occluding = np.isin(id_plane(scene.items.stack(), view), scene.ids(Role.OCCLUDER) + 1)
            if occluding.any():
                self.painted.add("occluder")
                paint(self.image, HATCH, (enlarged(occluding, factor) & _stripes(self.image.shape, 12, 2)) * 80)

    def placed(self, points: Floats) -> Floats:
        """Points (n, 2) of the world in coordinates of the picture."""
        return np.asarray((points - self.view[:2] + 0.5) * self.factor)

    def mark_samples(self, shots: Sequence[Mapping[str, Any]], of_rays: Container[str] = MARKS) -> None:
        """Mark the samples of all shots, each with the shape of its verdict; of rays only those of some verdicts."""
        for verdict in MARKS:
            marked = [shot["samples"] for shot in shots if "rays" not in shot or verdict in of_rays]
            self.lay(covered(self.view, [samples.get(verdict, ()) for samples in marked]), verdict)

    def lay(self, at: Bools, verdict: str) -> None:
        """Mark the set pixels of a plane (h, w) of the view with the shape of a verdict."""
        rows, columns = np.nonzero(at)
        if not len(rows):
            return
        self.painted.add(verdict)
        y0, x0 = int(rows.min()), int(columns.min())
        part = enlarged(at[y0 : rows.max() + 1, x0 : columns.max() + 1], self.factor)
        shape = tiled_glyph(verdict, self.factor, part.shape)
        color, alpha = MARKS[verdict]
        window = self.image[y0 * self.factor :, x0 * self.factor :][: part.shape[0], : part.shape[1]]
        if verdict == "hit":
            paint(window, SHADOW, part * SHADOW_ALPHA)
        paint(window, color, part * TINT)
        paint(window, color, (part & shape) * alpha)

    def mark_heat(self, batch: Mapping[str, Any], verdict: str) -> None:
        """Colour each cell by its number of samples of one verdict, on a logarithmic scale; ring those that lie alone.

        The cells of rays that decide nothing are tinted, which makes lines of them.
        """
        heat, of_rays = batch["heat"], "beyond" in batch["verdicts"]
        most = max((run[3] for run in heat["counts"].get(verdict, ())), default=0)
        steps = np.zeros((self.view[3] - self.view[1] + 1, self.view[2] - self.view[0] + 1), np.uint8)
        for count, box in heat_boxes(heat, verdict):
            fill(steps, self.view, box, 1 + heat_step(count, most))
        if not steps.any():
            return
        self.painted.add(verdict)
        there = enlarged(steps > 0, self.factor)
        color, alpha = MARKS[verdict]
        if verdict == "hit":
            colors = np.array(HEAT, np.uint8)[np.maximum(steps, 1) - 1]
            paint(self.image, enlarged(colors, self.factor), there * HEAT_ALPHA)
        elif of_rays and verdict in ("empty", "outside"):
            paint(self.image, color, there * LINE_ALPHA)
        else:
            paint(self.image, color, (there & tiled_glyph(verdict, self.factor, there.shape)) * (alpha // 2))
        if verdict == "hit" or (of_rays and verdict == "occluded"):
            self._ring_lone(steps > 0, color)

    def _ring_lone(self, at: Bools, color: Color) -> None:
        """Draw rings around the set pixels of a plane (h, w) that have no other within LONE_PX; at most RINGS_MAX."""
        side = 2 * LONE_PX + 1
        near = cv2.boxFilter(at.astype(np.float32), -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
        lone = np.argwhere(at & (near <= LONE_PIXELS))
        for y, x in lone.tolist() if len(lone) <= RINGS_MAX else ():
            middle = x * self.factor + self.factor // 2, y * self.factor + self.factor // 2
            cv2.circle(self.image, middle, RING, DARK, 3)
            cv2.circle(self.image, middle, RING, color, 1)

    def outline(self, item: int, kind: str) -> None:
        """Draw the border of an object's mask inside its pixels: thick for "hit", thick and dashed for "blocked"."""
        if self.scene is not None and item in self.scene:
            self.border(*self.scene.mask(item), kind)

    def outline_runs(self, runs: Sequence[Sequence[int]], kind: str) -> None:
        """Draw the border of the pixels of runs [y, x_first, x_last]."""
        self.border(*Spans(*np.array(runs, np.int64).reshape(-1, 3).T).to_mask(), kind)

    def outline_seen(self, items: Sequence[int]) -> None:
        """Draw the borders of the visible parts of at most OUTLINES_MAX objects."""
        if self.scene is None:
            return
        x, y = self.view[:2]
        around = (x - 1, y - 1, self.view[2] + 1, self.view[3] + 1)  # an object may go on beyond the view
        front = id_plane(self.scene.items.stack(), around)
        for item in items[:OUTLINES_MAX]:
            mask, (left, top) = self.scene.mask(item)
            box = max(left, around[0]), max(top, around[1])
            end = min(left + mask.shape[1], around[2] + 1), min(top + mask.shape[0], around[3] + 1)
            if box[0] < end[0] and box[1] < end[1]:
                rows, columns = slice(box[1] - y + 1, end[1] - y + 1), slice(box[0] - x + 1, end[0] - x + 1)
                self.border(front[rows, columns] == item + 1, box, "other")

    def border(self, mask: Bools, corner: tuple[int, int], kind: str) -> None:
        """Draw the border of a mask (h, w) whose pixel [0, 0] lies at a corner, inside its pixels."""
        (x, y), (height, width), view, factor = corner, mask.shape, self.view, self.factor
        left, top = max(x, view[0]), max(y, view[1])
        right, low = min(x + width, view[2] + 1), min(y + height, view[3] + 1)
        if left >= right or top >= low:
            return
        inside = enlarged(np.pad(mask, 1)[top - y : low - y + 2, left - x : right - x + 2], factor)
        thick = 2 if kind != "other" and factor > 1 else 1  # so that it stands out in grey, too
        core = cv2.erode(inside.astype(np.uint8), PLUS, iterations=thick)
        border = (inside & (core == 0))[factor:-factor, factor:-factor]
        if not border.any():
            return
        self.painted.add(f"object {kind}")
        if kind in DASHED:
            border &= _stripes(border.shape, 2 * DASH, DASH)
        window = self.image[(top - view[1]) * factor : (low - view[1]) * factor]
        color, alpha = OUTLINES[kind]
        paint(window[:, (left - view[0]) * factor : (right - view[0]) * factor], color, border * alpha)


def heat_boxes(heat: Mapping[str, Any], verdict: str) -> Iterator[tuple[int, Box]]:
    """Counts of one verdict, and the boxes of the world that have them."""
    cell, (x, y) = heat["cell"], heat["origin_xy"]
    for row, first, last, count in heat["counts"].get(verdict, ()):
        yield count, (x + first * cell, y + row * cell, x + (last + 1) * cell - 1, y + (row + 1) * cell - 1)


def fill(plane: npt.NDArray[Any], view: Box, box: Sequence[int], value: int = 1) -> None:
    """Set the part of a box of the world that lies in a plane (h, w) of a view."""
    x0, y0, x1, y1 = (max(v - low, -1) for v, low in zip(box, (view[0], view[1]) * 2, strict=True))
    plane[max(y0, 0) : y1 + 1, max(x0, 0) : x1 + 1] = value


def covered(view: Box, lists: Iterable[Sequence[Sequence[int]] | Ints]) -> Bools:
    """Mask (h, w) of the pixels of a view that lists of runs [y, x_first, x_last] of the world cover."""
    plane = np.zeros((view[3] - view[1] + 1, view[2] - view[0] + 1), np.bool_)
    for runs in lists:
        y, first, last = np.array(runs, np.int64).reshape(-1, 3).T
        seen = (y >= view[1]) & (y <= view[3])
        first, last = np.maximum(first[seen], view[0]), np.minimum(last[seen], view[2])
        run, x = each_pixel(first, np.maximum(last, first - 1))
        plane[y[seen][run] - view[1], x - view[0]] = True
    return plane


def heat_step(count: int, most: int) -> int:
    """Step of a count from 1 to `most` on the scale of heat, by its number of binary digits; the last if all are 1."""
    return len(HEAT) - 1 if most == 1 else (count.bit_length() - 1) * (len(HEAT) - 1) // max(most.bit_length() - 1, 1)


def _dimmed(scene: Scene, view: Box, light: int) -> Image:
    """Picture of the scene, darker and a little greyer."""
    plain = draw_view(scene.items, view, scene.extent()[:2]).astype(np.uint32)
    grey = (plain * (54, 183, 19)).sum(axis=2, keepdims=True) // 256
    return np.asarray((plain * 3 + grey * 2) // 5 * light // 255, np.uint8)


def _frame(world: Image, view: Box, bounds: Sequence[int], factor: int) -> None:
    """Draw a line around the bounds."""
    corners = [(v - low) * factor for v, low in zip(bounds, (view[0], view[1]) * 2, strict=True)]
    x, y, x_max, y_max = np.clip(corners, -factor, max(world.shape) + factor).tolist()
    cv2.rectangle(world, (x - 1, y - 1), (x_max + factor, y_max + factor), (120, 126, 136), 1)


def enlarged(plane: npt.NDArray[Any], factor: int) -> npt.NDArray[Any]:
    """Enlarge a plane (h, w) or a picture (h, w, 3) by a whole factor."""
    return np.repeat(np.repeat(plane, factor, axis=0), factor, axis=1)


def _stripes(shape: tuple[int, ...], period: int, wide: int) -> Bools:
    """Slanted stripes over a picture (h, w, ...): in each row `wide` pixels of every `period`."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((rows + columns) % period < wide)


EDGE, TOP = 16, 44  # left edge of the picture on the page, and its top, px
LINE, COLUMN, NARROWEST, GAP = 19, 464, 1000, 12  # line height, least widths of a card and a page, gap of cards, px
PAGE_GROUND, CARD, INK, FAINT = (24, 26, 30), (35, 38, 44), (238, 240, 244), (158, 164, 174)
LETTER, ENTRY_GAP = 8, 28  # about the width of a letter, and the space around an entry of the legend, px
SIZE = 0.42  # scale of OpenCV's font, about 8 px a letter


NAMED_SIGNS = [name for name in SIGNS if name not in ("swept", "goes in", "comes out", "number")]
"""Ray symbols that a legend lists."""


class Text(NamedTuple):
    """A line of text; (x, y) is the left end of its base line, px, or its right end or middle if these are set."""

    x: int
    y: int
    text: str
    color: Color = INK
    bold: bool = False
    right: bool = False
    middle: bool = False


def page_of(
    report: Mapping[str, Any], world: World, texts: Sequence[Text], cards: Sequence[Card]
) -> tuple[Image, list[Text]]:
    """Page around the enlarged world, and all texts, which are drawn later."""
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
    page = np.full((max(bottoms) + 46, width, 3), PAGE_GROUND, np.uint8)
    left = (width - image.shape[1]) // 2
    page[TOP : TOP + image.shape[0], left : left + image.shape[1]] = image
    every = [text._replace(x=text.x + left, y=text.y + TOP) for text in texts]
    note = unseen(report, world.scene.extent()) if world.scene is not None else ""
    summary = _summary(report, width, note)
    room = min(width // 2, width - 3 * EDGE - text_width(summary.text)) if note else width // 2
    every += [Text(EDGE, 28, clipped(report["scene"]["name"], room), INK, bold=True), summary]
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
        cv2.putText(page, shown, (x, text.y), font, SIZE, text.color, 1)


def plain(text: str) -> str:
    """Text on one line in the letters of the font: accents are dropped, unknown letters become question marks."""
    bare = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return "".join(c if c.isprintable() else " " for c in bare).encode("ascii", "replace").decode()


def text_width(text: str) -> int:
    """Width of a text, px."""
    return int(cv2.getTextSize(plain(text), cv2.FONT_HERSHEY_SIMPLEX, SIZE, 1)[0][0])


def clipped(text: str, width: int) -> str:
    """Shorten a text to a width, px."""
    text = text[: max(width, 0)]  # a letter is at least one pixel wide
    if text_width(text) <= width:
        return text
    while text and text_width(text + "...") > width:
        text = text[:-1]
    return text + "..."


class Entry(NamedTuple):
    """An entry of the legend: a word, and the picture (14, w, 3) of its mark."""

    word: str
    mark: Image


class Legend:
    """Entries side by side, in as many lines as needed; widths do not depend on the font, which differs."""

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
    """Legend of what the picture contains."""
    heat = report["batch"]["heat"]["counts"].get("hit", ()) if report["batch"] else ()
    entries = [Entry(v, verdict_mark(v)) for v in reversed(MARKS) if v in painted and not (heat and v == "hit")]
    if heat and "hit" in painted:
        scale = np.repeat(np.array(HEAT, np.uint8)[None], 14, axis=0)
        cell = report["batch"]["heat"]["cell"]
        per, most = f" in {cell} x {cell} px" if cell > 1 else "", max(run[3] for run in heat)
        word, scale = (f"1 to {most} hits", scale) if most > 1 else ("1 hit", scale[:, [-1] * 3])
        entries.insert(0, Entry(word + per, np.repeat(scale, 5, axis=1)))
    target = "other target" if painted & {"object hit", "object blocked"} else "target"
    words = {"hit": "object hit", "blocked": "object blocked", "other": target, "now": "where it is now"}
    words["shadow"] = "edge of a shadow"
    entries += [Entry(word, _outlined(kind)) for kind, word in words.items() if f"object {kind}" in painted]
    entries += [Entry(name, sketch_mark(name)) for name in SKETCH if name in painted]
    entries += sign_entries(painted)
    if "occluder" in painted:
        entries.append(Entry("occluder", mark_of(_stripes((14, 14), 6, 2), HATCH)))
    return Legend(entries, width)


def sign_entries(painted: Set[str]) -> list[Entry]:
    """Legend entries of the ray symbols that a picture contains."""
    return [Entry(name, sign_mark(name)) for name in NAMED_SIGNS if f"ray: {name}" in painted]


def _outlined(kind: str) -> Image:
    thick = 1 if kind in THIN else 2
    border = _stripes((14, 14), 6, 3 if kind in DASHED else 6)
    border[thick:-thick, thick:-thick] = False
    return mark_of(border, OUTLINES[kind][0])


def _summary(report: Mapping[str, Any], width: int, note: str) -> Text:
    """What was fired and hit, after a note that must be seen."""
    shots, batch = report["shots"], report["batch"]
    objects = {entry["object"] for shot in shots for entry in shot["rows"]}
    objects |= {entry["object"] for entry in (batch["objects"] if batch else ())}
    text = f"{counted(batch['shots'] if batch else len(shots), 'shot')}, {counted(len(objects), 'object')} hit"
    if report.get("now", {}).get("tick") is not None:
        text = f"tick {report['now']['tick']:g}: {text}"
    text = clipped(f"{note}; {text}", width - 3 * EDGE) if note else text
    return Text(width - EDGE, 28, text, INK if note else FAINT, right=True)


def _footer(report: Mapping[str, Any], width: int, height: int) -> list[Text]:
    """Footer with scene, version and plan; the cards have weapons and seeds."""
    scene = report["scene"]
    plans = [shot["plan"] for shot in report["shots"]] + (report["batch"]["plan"] if report["batch"] else [])
    ran = dict.fromkeys(stage["stage"] for plan in plans for stage in plan["ran"])
    drawn = ("pre-filter", "broad phase", "volumes") if "filter" in report else ()
    left = [s["stage"] for s in plans[0]["left_out"] if s["stage"] not in drawn] if plans else []
    left = [name for name in left if all(name in [s["stage"] for s in plan["left_out"]] for plan in plans)]
    source = f"scene {scene['hash']}, version {scene['version']}, hitplanes {report['version']}"
    plan = "; ".join(f"{word}: {', '.join(stages)}" for word, stages in (("ran", ran), ("left out", left)) if stages)
    return [Text(EDGE, height - 30, source, FAINT), Text(EDGE, height - 12, clipped(plan, width - 2 * EDGE), FAINT)]
