"""What is written over the world: numbered shots, names of what was hit, and what blocked what.

A label goes where it covers no sample, no object that it could be read for, and no other label.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from planes.arrays import Bools, Image
from planes.items import Role
from planes.scene import Scene
from planes.spans import Box, Spans
from weapons.marks import MARKS
from weapons.panel import INK, Text

__all__ = ["Overlay", "blocked_objects", "short"]

LETTER, ROW = 7, 17
"""Width of a letter and height of a label, px; not taken from the font, whose sizes depend on OpenCV's version."""

LABELS_MAX = 16
"""Names written over one picture; the cards have them all."""

LINKS_MAX = 8
"""Occluders that are linked to the object they kept most samples from; the cards have them all."""

NAME_MAX = 24
"""Letters of a name on a label."""

BADGE = 11
"""Radius of the disc of a shot's number, px."""

NEAR, FAR = 40, 400
"""How far a name, and a number or a link, may lie from what it belongs to, px."""

DARK = (20, 22, 26)
WHITE = (255, 255, 255)


class Overlay:
    """Marks and labels over an enlarged view; `texts` collects the text layer.

    Parameters
    ----------
    world : (h, w, 3) picture that is drawn on
    view : inclusive box of the world that it shows, px
    factor : pixels of the picture for one of the world
    """

    def __init__(self, world: Image, view: Box, factor: int) -> None:
        self.world, self.view, self.factor = world, view, factor
        self.taken: Bools = np.zeros(world.shape[:2], np.bool_)
        self.texts: list[Text] = []

    def keep_free(self, shots: Sequence[Mapping[str, Any]], scene: Scene) -> None:
        """Let no label cover a sample, an object that was hit, or an occluder that blocked."""
        for y, x_first, x_last in (run for shot in shots for of in shot["samples"].values() for run in of):
            self._take(*self._at(x_first, y), *self._at(x_last + 1, y + 1))
        hit = {row["object"] for shot in shots for row in shot["rows"]}
        for item in sorted(hit | {by["object"] for shot in shots for by in shot["blockers"]}):
            mask, (x, y) = scene.mask(item)
            spans = Spans.from_mask(mask, (x, y))
            for row, x_first, x_last in zip(
                spans.y.tolist(), spans.x_first.tolist(), spans.x_last.tolist(), strict=True
            ):
                self._take(*self._at(x_first, row), *self._at(x_last + 1, row + 1))

    def shot(self, shot: Mapping[str, Any], number: int) -> None:
        """Number a shot: a cross on its pixel, a disc beside the pattern, a line between; an arrow if it is far off."""
        height, width = self.world.shape[:2]
        x, y = (v + self.factor // 2 for v in self._at(*shot["at_xy"]))
        inside = 0 <= x < width and 0 <= y < height
        if not inside:
            edge = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
            x, y = edge
        bx, by = self._free(x, y, BADGE + 1, BADGE + 1)
        if inside:
            cv2.line(self.world, (x, y), (bx, by), WHITE, 1)
            _cross(self.world, x, y, max(3, self.factor))
        else:
            cv2.arrowedLine(self.world, (bx, by), (x, y), WHITE, 1, tipLength=0.4)
        cv2.circle(self.world, (bx, by), BADGE - 1, DARK, -1)
        cv2.circle(self.world, (bx, by), BADGE - 1, WHITE, 1)
        self._take(bx - BADGE, by - BADGE, bx + BADGE + 1, by + BADGE + 1)
        label = str(number)
        self.texts.append(Text(bx - 4 * len(label), by + 4, label, WHITE, bold=True))

    def names(self, shots: Sequence[Mapping[str, Any]], scene: Scene) -> None:
        """Name the objects that were hit, most pixels first."""
        pixels: dict[int, int] = {}
        for row in (row for shot in shots for row in shot["rows"]):
            pixels[row["object"]] = pixels.get(row["object"], 0) + row["pixels"]
        for item in sorted(pixels, key=lambda item: (-pixels[item], item))[:LABELS_MAX]:
            mask, (x, y) = scene.mask(item)
            box = (*self._at(x, y), *self._at(x + mask.shape[1], y + mask.shape[0]))
            self._label(scene.name_of(item), box, INK, NEAR)

    def links(self, shots: Sequence[Mapping[str, Any]]) -> None:
        """Ring samples that an occluder kept from an object, and say which kept what."""
        color = MARKS["occluded"][0]
        found = [(by["blocked"][0], by) for shot in shots for by in shot["blockers"] if by["blocked"]]
        for told, by in sorted(found, key=lambda pair: -pair[0]["samples"])[:LINKS_MAX]:
            x, y = (v + self.factor // 2 for v in self._at(*told["at_xy"]))
            if not (0 <= x < self.world.shape[1] and 0 <= y < self.world.shape[0]):
                continue
            for shade, thick in ((DARK, 3), (color, 1)):
                cv2.circle(self.world, (x, y), 6, shade, thick)
            text = f"{short(by['name'])} blocks {short(told['name'])}"
            self._label(text, (x - 7, y - 7, x + 8, y + 8), color, FAR)

    def _label(self, text: str, box: Box, color: tuple[int, int, int], farthest: int) -> None:
        """Write a text near a box of the picture, with a line to it where it had to go far; or not at all."""
        text = short(text, 2 * NAME_MAX)
        half_w, half_h = (LETTER * len(text) + 8) // 2, ROW // 2 + 1
        for x, y in _around(box, half_w, half_h, farthest):
            if self._is_free(x - half_w, y - half_h, x + half_w, y + half_h):
                break
        else:
            return
        near = min(max(x, box[0]), box[2] - 1), min(max(y, box[1]), box[3] - 1)
        if abs(x - near[0]) > half_w + 8 or abs(y - near[1]) > half_h + 8:
            cv2.line(self.world, (x, y), near, color, 1)
        part = self.world[y - half_h : y + half_h, x - half_w : x + half_w]
        part[:] = (part.astype(np.uint16) * 60 + np.array(DARK, np.uint16) * 195) // 255
        self._take(x - half_w, y - half_h, x + half_w, y + half_h)
        self.texts.append(Text(x - half_w + 4, y + 5, text, color))

    def _free(self, x: int, y: int, half_w: int, half_h: int) -> tuple[int, int]:
        """Nearest of some spots around a point where a rectangle covers nothing; else one inside the picture."""
        for bx, by in _around((x - 6, y - 6, x + 6, y + 6), half_w, half_h, FAR):
            if self._is_free(bx - half_w, by - half_h, bx + half_w, by + half_h):
                return bx, by
        height, width = self.world.shape[:2]
        return min(max(x, half_w), max(width - half_w, 0)), min(max(y - 22, half_h), max(height - half_h, 0))

    def _is_free(self, x0: int, y0: int, x1: int, y1: int) -> bool:
        height, width = self.taken.shape
        return min(x0, y0) >= 0 and x1 <= width and y1 <= height and not self.taken[y0:y1, x0:x1].any()

    def _take(self, x0: int, y0: int, x1: int, y1: int) -> None:
        self.taken[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = True

    def _at(self, x: int, y: int) -> tuple[int, int]:
        """Top left of a pixel of the world in the picture."""
        return (x - self.view[0]) * self.factor, (y - self.view[1]) * self.factor


def blocked_objects(shots: Sequence[Mapping[str, Any]], scene: Scene) -> set[int]:
    """Objects that occluders kept samples from, and that no shot hit."""
    hit = {row["object"] for shot in shots for row in shot["rows"]}
    blocked = {told["object"] for shot in shots for by in shot["blockers"] for told in by["blocked"]}
    return (blocked - hit) & set(scene.ids(Role.HITTABLE).tolist())


def _around(box: Box, half_w: int, half_h: int, farthest: int) -> Iterator[tuple[int, int]]:
    """Middles of rectangles around a box: above, below, right, left, then the corners, ever farther."""
    x0, y0, x1, y1 = box
    x, y = (x0 + x1) // 2, (y0 + y1) // 2
    for gap in range(3, farthest, 12):
        left, right, up, down = x0 - gap - half_w, x1 + gap + half_w, y0 - gap - half_h, y1 + gap + half_h
        yield from ((x, up), (x, down), (right, y), (left, y))
        yield from ((right, up), (left, up), (right, down), (left, down))


def _cross(world: Image, x: int, y: int, size: int) -> None:
    """Mark the shot's own pixel."""
    for color, thickness in ((DARK, 3), (WHITE, 1)):
        cv2.line(world, (x - size, y), (x + size, y), color, thickness)
        cv2.line(world, (x, y - size), (x, y + size), color, thickness)


def short(name: str, most: int = NAME_MAX) -> str:
    """A name of at most so many letters."""
    return name if len(name) <= most else name[: most - 3] + "..."
