"""Cards of a report: for each shot its weapon, verdicts, hits, first hit enlarged, and objects that were not hit."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hitplanes.planes.common.checks import Image
from hitplanes.planes.common.limits import WEIGHT_FULL
from hitplanes.planes.files.png import cv2
from hitplanes.planes.scene.scene import Scene

from . import phrases
from .canvas import CARD, FAINT, INK, LETTER, LINE, Text, World, clipped, text_width
from .differences import reason
from .overlay import draw_arrows
from .phrases import NAME_MAX, counted, fragile, percent, short
from .symbols import MARKS, tiled_glyph, verdict_mark

CELL, COLUMNS, ROWS = 14, 15, 9
"""Side of a pixel of the world in the inset, px, and how many are shown; odd, so that the hit lies in the middle."""

LIGHT = 200  # brightness of the scene in the inset, of 255; brighter than in the picture
GRID = 130  # brightness of the lines of the grid, relative to the inset, of 255


def inset_of(shot: Mapping[str, Any], scene: Scene) -> World | None:
    """Draw the pixels around the first hit of a shot; None if it hit nothing."""
    if not shot["rows"]:
        return None
    x, y = shot["rows"][0]["first_xy"]
    view = (x - COLUMNS // 2, y - ROWS // 2, x + COLUMNS // 2, y + ROWS // 2)
    world = World(scene, scene.bounds, view, CELL, LIGHT)
    world.mark_samples([shot])
    for item in sorted({row["object"] for row in shot["rows"]}):
        world.outline(item, "hit")
    image = world.image
    for line in (image[::CELL], image[:, ::CELL]):
        line[:] = (line.astype(np.uint16) * GRID // 255).astype(np.uint8)
    if "rays" in shot:
        draw_arrows(world, shot)
    left, top = COLUMNS // 2 * CELL, ROWS // 2 * CELL
    frame = image[top : top + CELL + 1, left : left + CELL + 1]
    frame[[0, -1]] = frame[:, [0, -1]] = (255, 255, 255)
    return world


HIT_LINES = 24  # most rows of hits on a card; the JSON has all
NOT_LINES = 5  # most objects that a card names as blocked or as not hit; the JSON has all
CELL_WIDTH, NARROW, MANY = 64, 58, 7  # width of a column of numbers, px; and where there are many
BAR = 9  # height of the bar of verdicts, px
HEADER = ("object hit", "pixels", "pattern", "visible", "mask", "nearest")
WEIGHT_HEADER = ("object hit", "pixels", "weight", *HEADER[2:])  # with falloff; in samples of full weight
BATCH_HEADER = ("object hit", "shots", "of shots", "pixels", "weight")


@dataclass(frozen=True)
class Card:
    """Content of a card."""

    number: int | None  # of the shot in the picture, or None
    title: str  # at the left of the first line
    fired: str  # at the right of the first line
    verdicts: Mapping[str, int]  # number of samples by verdict
    inset: World | None  # around the first hit
    lines: Sequence[Sequence[str]]  # one cell is a sentence, two are an object and a reason, more are a row of a table
    ray: Mapping[str, Any] | None = None  # the only ray of a shot, drawn above the verdicts; None draws a bar of them

    @property
    def height(self) -> int:
        """Height of the card, px."""
        return 52 + self._facts_height + LINE * len(self.lines) + 6

    @property
    def _facts_height(self) -> int:
        counts = 6 + LINE * max(1, sum(n > 0 for n in self.verdicts.values()))
        return max(counts, ROWS * CELL + 34) if self.inset else counts

    def draw(self, page: Image, x: int, y: int, wide: int) -> list[Text]:
        """Draw the card with its top left at (x, y); its texts are drawn later."""
        page[y : y + self.height, x : x + wide] = CARD
        left = x + 10
        texts = []
        if self.number is not None:
            cv2.circle(page, (x + 20, y + 18), 10, (255, 255, 255), 1)
            label = str(self.number)
            texts.append(Text(x + 20 - 4 * len(label), y + 22, label, INK, bold=True))
            left = x + 38
        texts.append(Text(left, y + 22, clipped(self.title, wide // 3), INK, bold=True))
        texts.append(Text(x + wide - 10, y + 22, clipped(self.fired, wide * 2 // 3 - 50), FAINT, right=True))
        _bar(page[y + 36 : y + 36 + BAR, x + 10 : x + wide - 10], self.verdicts, self.ray)
        top = y + 52
        counts_x = x + 10
        if self.inset:
            texts += _inset(page, self.inset, x + 10, top)
            counts_x += _margin(self.inset) + COLUMNS * CELL + 14
        texts += _counts(page, self.verdicts, counts_x, top, x + wide - 10 - counts_x)
        return texts + self._table(x, top + self._facts_height, wide)

    def _table(self, x: int, y: int, wide: int) -> list[Text]:
        texts = []
        for row, cells in enumerate(self.lines):
            base = y + 14 + row * LINE
            color = FAINT if len(cells) == 1 or cells[0] == HEADER[0] else INK
            if len(cells) == 2:  # object and reason
                texts.append(Text(x + wide - 10, base, clipped(cells[1], wide * 3 // 5), FAINT, right=True))
                texts.append(Text(x + 10, base, _name_in(wide * 2 // 5 - 20, cells[0]), FAINT))
                continue
            cell_width = CELL_WIDTH if len(cells) < MANY else NARROW
            room = wide - 20 - cell_width * (len(cells) - 1)
            named = clipped(cells[0], room) if len(cells) == 1 else _name_in(room, cells[0])
            texts.append(Text(x + 10, base, named, color))
            for column, cell in enumerate(reversed(cells[1:])):
                texts.append(Text(x + wide - 10 - cell_width * column, base, cell, color, right=True))
        return texts


def _name_in(room: int, name: str) -> str:
    """A name cut in its middle to a width, px; one that is cut already loses more there."""
    left, cut, right = name.partition("...")
    if not cut:
        left, right = name[: len(name) // 2], name[len(name) // 2 :]
    while text_width(name) > room and len(left + right) > 2:
        left, right = (left[:-1], right) if len(left) > len(right) else (left, right[1:])
        name = f"{left}...{right}"
    return name


def shot_card(shot: Mapping[str, Any], number: int, scene: Scene, now: str | None = None) -> Card:
    """Card of one shot; for a shot at the past with what it would hit now."""
    rays = shot.get("rays")
    lines = _first_of(_hits(shot) if rays is None else phrases.table(shot), HIT_LINES + 1, "")
    risks = {row["name"]: fragile(row, "misses it") for row in shot["rows"]}
    lines += _first_of([(name, risk) for name, risk in risks.items() if risk is not None], NOT_LINES, " fragile")
    near = None
    if rays is not None:
        near = phrases.missed(shot)
        lines += _first_of([[line] for line in phrases.ended(rays)], NOT_LINES, " ends")
    lines += _first_of(phrases.blocked(shot), NOT_LINES, " block")
    others = shot["why_not"]
    if near is not None:
        own = [e for e in others if e["object"] == shot["nearest_miss"]["object"] and e["reason"] == "missed"]
        lines.append((near[0], "; ".join([near[1], *filter(None, (fragile(e, "hits it") for e in own))])))
        others = [e for e in others if e not in own]
    whys = [(f"not {entry['name']}", _why(entry, rays is not None)) for entry in others]
    lines += _first_of(whys, NOT_LINES, " near it")
    if now is not None:
        lines.append(("the same shot now", now))
    if tested := shot.get("tested"):
        cells = f", {counted(tested['opened'], 'cell')} opened" if tested["opened"] else ""
        lines.append([f"tested {len(tested['objects'])} of {tested['of']} objects and occluders by pixels{cells}"])
    alone = rays[0] if rays is not None and len(rays) == 1 else None
    return Card(number, shot["weapon"], _fired(shot), shot["verdicts"], inset_of(shot, scene), lines, alone)


def _why(entry: Mapping[str, Any], of_ray: bool) -> str:
    """Why an object was not hit, and whether a shift of one pixel would hit it."""
    risk = None if of_ray and entry["reason"] != "missed" else fragile(entry, "hits it")
    return reason(entry, NAME_MAX) + ("" if risk is None else f"; {risk}")


def _hits(shot: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Table of the hits of a pattern."""
    weighted = any(row["weight"] != WEIGHT_FULL * row["samples"] for row in shot["rows"])
    lines: list[tuple[str, ...]] = []
    if shot["rows"]:
        exposed = ["exposed"] if "exposed" in shot["rows"][0]["shares"] else []
        header = WEIGHT_HEADER if weighted else HEADER
        lines.append((*header[:-1], *exposed, header[-1]))
    rounds = len({row["round"] for row in shot["rows"]}) > 1
    for row in shot["rows"]:
        name = f"{row['name']}, round {row['round']}" if rounds else row["name"]
        shares = [percent(share) for share in row["shares"].values()]
        weight = [f"{row['weight'] / WEIGHT_FULL:.1f}"] if weighted else []
        lines.append((name, str(row["pixels"]), *weight, *shares, f"{row['distance2'] ** 0.5:.1f} px"))
    return lines


def hit_now(report: Mapping[str, Any], number: int) -> str | None:
    """What a shot at the past would hit now, in words; None if the report does not say."""
    if "now" not in report:
        return None
    rows = report["now"]["shots"][number]
    if rows is None:
        return "starts inside of something"
    names = ", ".join(f"{short(row['name'])} {row['pixels']} px" for row in rows[:NOT_LINES]) or "nothing"
    return f"hits {names}" + (" and more" if len(rows) > NOT_LINES else "")


def batch_cards(report: Mapping[str, Any]) -> list[Card]:
    """Cards of a batch: its totals, and the objects that it hit."""
    batch = report["batch"]
    shots = batch["shots"]
    total = f"{shots} shots, {batch['shots_that_hit']} hit something"
    never = report["scene"]["hittable"] - len(batch["objects"])
    rows = [
        (
            entry["name"], str(entry["shots"]), percent(entry["shots"] / shots), str(entry["pixels"]),
            f"{entry['weight'] / WEIGHT_FULL:.1f}",
        )
        for entry in batch["objects"]
    ]  # fmt: skip
    lines: list[Sequence[str]] = [BATCH_HEADER, *_first_of(rows, HIT_LINES, " hit")] if rows else []
    lines.append([f"{never} of {report['scene']['hittable']} objects never hit" if never else "every object was hit"])
    if "filter" in report:
        lines.append(["volumes are drawn for a few shots only; cells for all"])
    if batch["heat"]["beyond"]:
        x, y, x_max, y_max = report["view_xyxy"]
        lines.append([f"{batch['heat']['beyond']} samples beyond the picture (x {x}..{x_max}, y {y}..{y_max})"])
    return [Card(None, ", ".join(report["weapons"]), total, batch["verdicts"], None, lines)]


def _first_of(lines: Sequence[Sequence[str]], most: int, what: str) -> list[Sequence[str]]:
    """First lines, and a line with the number of the others."""
    more = len(lines) - most
    return [*lines[:most], *([[f"and {more} more{what}"]] if more > 0 else [])]


def place_text(at: Sequence[float]) -> str:
    """A position to 1/100 px: enough to find it; the facts have all of it."""
    return ", ".join(f"{round(value, 2) + 0.0:.15g}" for value in at)


def _fired(shot: Mapping[str, Any]) -> str:
    parts = [f"at {place_text(shot['at'])}"]
    if shot["aim"] is not None:
        parts.append(f"aim {shot['aim']:g} deg")
    if shot["seed"]:
        parts.append(f"seed {shot['seed']}")
    if shot["accept"] is not None:
        parts.append("accepts " + (" ".join(shot["accept"]) or "nothing"))
    if shot["blocked_by"] is not None:
        parts.append("blocked by " + (" ".join(shot["blocked_by"]) or "nothing"))
    if shot["exclude"]:
        parts.append("excludes " + " ".join(e["name"] for e in shot["exclude"]))
    return ", ".join(parts)


def _bar(bar: Image, verdicts: Mapping[str, int], ray: Mapping[str, Any] | None) -> None:
    """Draw the verdicts of a shot as parts of one bar, in the texture of their marks.

    A ray is drawn from end to end instead, with its parts in objects, its stop, and dashes beyond.
    """
    bar[:] = (58, 62, 70)
    wide = bar.shape[1]
    if ray is None:
        names = ("hit", "occluded", "filtered", "outside", "beyond")
        ends = [0, *itertools.accumulate(verdicts.get(name, 0) for name in names)]
        places = [end * wide // max(sum(verdicts.values()), 1) for end in ends]
        parts = list(zip(names, places[:-1], places[1:], strict=True))
    else:
        stop = int(ray["stop"]["fraction"] * (wide - 2))
        parts = [("beyond", stop, wide)]
        for entry in ray["passes"]:
            parts.append(("hit", int(entry["entry"] * (wide - 2)), int(entry["exit"] * (wide - 2)) + 1))
    for verdict, first, last in parts:
        part = bar[:, first:last]
        part[tiled_glyph(verdict, BAR, part.shape)] = MARKS[verdict][0]
    if ray is not None:
        bar[:, stop : stop + 2] = MARKS["occluded"][0] if ray["stop"]["reason"] == "occluder" else (255, 255, 255)


def _counts(page: Image, verdicts: Mapping[str, int], x: int, y: int, wide: int) -> list[Text]:
    """Draw the mark of each verdict that occurs, and return the numbers of its samples."""
    total = sum(verdicts.values())
    if not total:
        return [Text(x, y + 14, "no samples", FAINT)]
    texts = []
    for row, verdict in enumerate(v for v in reversed(MARKS) if verdicts.get(v, 0)):
        top = y + 3 + row * LINE
        page[top : top + 12, x : x + 12] = verdict_mark(verdict, 12)
        share = percent(verdicts[verdict] / total)
        texts.append(Text(x + 18, top + 11, clipped(f"{verdicts[verdict]} {verdict}, {share}", wide - 18), FAINT))
    return texts


def _inset(page: Image, inset: World, x: int, y: int) -> list[Text]:
    """Draw an inset, and the coordinates of its first, middle and last rows and columns."""
    left = x + _margin(inset)
    page[y : y + ROWS * CELL, left : left + COLUMNS * CELL] = inset.image
    texts = []
    widest = LETTER * max(len(str(v)) for v in inset.view[::2]) + LETTER
    for column in (0, COLUMNS // 2, COLUMNS - 1) if 3 * widest < COLUMNS * CELL else (COLUMNS // 2,):
        label = str(inset.view[0] + column)
        middle = left + column * CELL + CELL // 2
        start = min(max(middle - LETTER * len(label) // 2, left), left + COLUMNS * CELL - LETTER * len(label))
        texts.append(Text(start, y + ROWS * CELL + 14, label, FAINT))
    for row in (0, ROWS // 2, ROWS - 1):
        texts.append(Text(left - 5, y + row * CELL + CELL - 2, str(inset.view[1] + row), FAINT, right=True))
    return texts


def _margin(inset: World) -> int:
    """Width of the margin for the coordinates of rows, px."""
    return 8 + LETTER * max(len(str(inset.view[1])), len(str(inset.view[3])))
