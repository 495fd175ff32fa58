"""What is written over the world: numbered shots, names of what was hit, and what blocked what.

A label goes where it covers no sample, no object that it could be read for, and no other label.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from typing import Any

import cv2
import numpy as np

from planes.arrays import Bools, Image, Ints
from planes.items import Role
from planes.scene import Scene
from planes.spans import Box, Spans
from weapons.marks import MARKS
from weapons.panel import INK, Text
from weapons.signs import MINT, NEAR_MISS
from weapons.words import NAME_MAX, apart, short
from weapons.world import OUTLINES_MAX, World, enlarged, fill_runs

__all__ = ["Overlay"]

LETTER, ROW = 7, 17
"""Width of a letter and height of a label, px; not taken from the font, whose sizes depend on OpenCV's version."""

LABELS_MAX = 16
"""Names written over one picture; the cards have them all."""

LINKS_MAX = 8
"""Occluders that are linked to the object they kept most samples from; the cards have them all."""

BADGE = 11
"""Radius of the disc of a shot's number, px."""

NEAR, CLOSE, FAR = 40, 110, 400
"""How far a name may lie from its object, how far a link lies if it can, and how far it and a number may lie, px."""

DARK = (20, 22, 26)
WHITE = (255, 255, 255)


class Overlay:
    """Marks and labels over an enlarged view; `texts` collects the text layer."""

    def __init__(self, world: World) -> None:
        self.world, self.image, self.view, self.factor = world, world.image, world.view, world.factor
        self.taken: Bools = np.zeros(self.image.shape[:2], np.bool_)
        self.targets: Bools = self.taken.copy()
        self.texts: list[Text] = []

    def keep_free(self, shots: Sequence[Mapping[str, Any]], scene: Scene) -> None:
        """Let no label cover a sample, an object that was hit, or an occluder that blocked."""
        runs = [of for shot in shots for of in shot["samples"].values()]
        hit = {row["object"] for shot in shots for row in shot["rows"]}
        blocking = {by["object"] for shot in shots for by in shot["blockers"]}
        self.taken |= self._plane(
            [*runs, *(Spans.from_mask(*scene.mask(item)).runs() for item in sorted(hit | blocking))]
        )
        self.targets |= self._plane(
            [Spans.from_mask(*scene.mask(item)).runs() for item in scene.ids(Role.HITTABLE).tolist()[:OUTLINES_MAX]]
        )

    def _plane(self, runs: Sequence[Any]) -> Bools:
        """Pixels of the picture that runs of the world cover."""
        x, y, x_max, y_max = self.view
        at = np.zeros((y_max - y + 1, x_max - x + 1), np.bool_)
        for some in runs:
            fill_runs(at, self.view, some)
        return enlarged(at, self.factor)

    def shot(self, shot: Mapping[str, Any], number: int) -> None:
        """Number a shot: a cross on its pixel, a disc beside the pattern, a line between; an arrow if it is far off."""
        height, width = self.image.shape[:2]
        x, y = self._start(shot)
        inside = 0 <= x < width and 0 <= y < height
        if not inside:
            edge = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
            x, y = edge
        bx, by = self._free(x, y, BADGE + 1, BADGE + 1)
        if inside:
            cv2.line(self.image, (x, y), (bx, by), WHITE, 1)
            _cross(self.image, x, y, max(3, self.factor))
        else:
            cv2.arrowedLine(self.image, (bx, by), (x, y), WHITE, 1, tipLength=0.4)
        cv2.circle(self.image, (bx, by), BADGE - 1, DARK, -1)
        cv2.circle(self.image, (bx, by), BADGE - 1, WHITE, 1)
        self._take(bx - BADGE, by - BADGE, bx + BADGE + 1, by + BADGE + 1)
        label = str(number)
        self.texts.append(Text(bx - 4 * len(label), by + 4, label, WHITE, bold=True))

    def _start(self, shot: Mapping[str, Any]) -> tuple[int, int]:
        """Where a shot begins: in the middle of its pixel, or where its rays do."""
        if "rays" in shot:
            x, y = np.floor(self.world.placed(np.array(shot["at"]))).astype(np.int64).tolist()
            return x, y
        x, y = self._at(*shot["at_xy"])
        return x + self.factor // 2, y + self.factor // 2

    def names(self, shots: Sequence[Mapping[str, Any]], scene: Scene) -> None:
        """Name the objects that were hit, most pixels first."""
        pixels: dict[int, int] = {}
        for row in (row for shot in shots for row in shot["rows"]):
            pixels[row["object"]] = pixels.get(row["object"], 0) + row["pixels"]
        for item in sorted(pixels, key=lambda item: (-pixels[item], item))[:LABELS_MAX]:
            mask, (x, y) = scene.mask(item)
            box = (*self._at(x, y), *self._at(x + mask.shape[1], y + mask.shape[0]))
            at = np.argwhere(mask)[:, ::-1] + (x, y)
            seen = at[(at >= self.view[:2]).all(axis=1) & (at <= self.view[2:]).all(axis=1)]
            if len(seen):
                self._label(scene.name_of(item), box, INK, NEAR, seen)

    def links(self, shots: Sequence[Mapping[str, Any]], hit: Set[int]) -> None:
        """Ring samples that an occluder kept from an object, and say which kept what; objects not hit come first."""
        color = MARKS["occluded"][0]
        pairs = [(told, by) for shot in shots for by in shot["blockers"] for told in by["blocked"]]
        linked: set[int] = set()
        for told, by in sorted(pairs, key=lambda pair: (pair[0]["object"] in hit, -pair[0]["samples"])):
            x, y = (v + self.factor // 2 for v in self._at(*told["at_xy"]))
            inside = 0 <= x < self.image.shape[1] and 0 <= y < self.image.shape[0]
            if not inside or by["object"] in linked or len(linked) >= LINKS_MAX:
                continue
            text = f"{short(by['name'])} blocks {short(told['name'])}"
            if self._label(text, (x - 7, y - 7, x + 8, y + 8), color, FAR):
                linked.add(by["object"])
                for shade, thick in ((DARK, 3), (color, 1)):
                    cv2.circle(self.image, (x, y), 6, shade, thick)

    def distances(self, shots: Sequence[Mapping[str, Any]]) -> None:
        """Write how far the nearest object was missed by rays, beside the line between."""
        for miss in (shot["nearest_miss"] for shot in shots if shot.get("nearest_miss")):
            ends = self.world.placed(np.array([miss["ray_xy"], miss["object_xy"]]))
            x, y = np.rint(np.clip(ends.mean(axis=0), -FAR, max(self.image.shape) + FAR)).astype(np.int64).tolist()
            inside = 0 <= x < self.image.shape[1] and 0 <= y < self.image.shape[0]
            if inside and 0 < miss["distance"] <= NEAR_MISS:
                self._label(apart(miss["distance"]), (x - 4, y - 4, x + 5, y + 5), MINT, NEAR)

    def _label(
        self, text: str, box: Box, color: tuple[int, int, int], farthest: int, pixels: Ints | None = None
    ) -> bool:
        """Write a text near a box of the picture, with a line to it where it had to go far; tells if there was room.

        Where there is none beside the other targets, it may lie on one that no shot has to do with. The line ends at
        the nearest of the pixels (n, 2) of the world, or at the box.
        """
        text = short(text, 2 * NAME_MAX)
        half_w, half_h = (LETTER * len(text) + 8) // 2, ROW // 2 + 1
        reaches = [(reach, free) for reach in (min(CLOSE, farthest), farthest) for free in (True, False)]
        spots = ((spot, free) for reach, free in reaches for spot in _around(box, half_w, half_h, reach))
        for (x, y), free in spots:
            place = x - half_w, y - half_h, x + half_w, y + half_h
            if self._is_free(*place) and not (free and self.targets[place[1] : place[3], place[0] : place[2]].any()):
                break
        else:
            return False
        near = min(max(x, box[0]), box[2] - 1), min(max(y, box[1]), box[3] - 1)
        if pixels is not None:
            away = (pixels - self.view[:2]) * self.factor + self.factor // 2 - (x, y)
            near = tuple((away[(away**2).sum(axis=1).argmin()] + (x, y)).tolist())
        if not free or abs(x - near[0]) > half_w + 8 or abs(y - near[1]) > half_h + 8:
            cv2.line(self.image, (x, y), near, color, 1)
        part = self.image[y - half_h : y + half_h, x - half_w : x + half_w]
        part[:] = (part.astype(np.uint16) * 60 + np.array(DARK, np.uint16) * 195) // 255
        self._take(x - half_w, y - half_h, x + half_w, y + half_h)
        self.texts.append(Text(x, y + 5, text, color, middle=True))
        return True

    def _free(self, x: int, y: int, half_w: int, half_h: int) -> tuple[int, int]:
        """A spot around a point where a rectangle covers nothing; else the nearest anywhere; else one that covers."""
        for bx, by in _around((x - 6, y - 6, x + 6, y + 6), half_w, half_h, FAR):
            if self._is_free(bx - half_w, by - half_h, bx + half_w, by + half_h):
                return bx, by
        height, width = self.image.shape[:2]
        rows, columns = np.mgrid[half_h : height - half_h : BADGE, half_w : width - half_w : BADGE].reshape(2, -1)
        for i in np.argsort((columns - x) ** 2 + (rows - y) ** 2, kind="stable").tolist():
            bx, by = int(columns[i]), int(rows[i])
            if self._is_free(bx - half_w, by - half_h, bx + half_w, by + half_h):
                return bx, by
        return min(max(x, half_w), max(width - half_w, 0)), min(max(y - 22, half_h), max(height - half_h, 0))

    def _is_free(self, x0: int, y0: int, x1: int, y1: int) -> bool:
        height, width = self.taken.shape
        return min(x0, y0) >= 0 and x1 <= width and y1 <= height and not self.taken[y0:y1, x0:x1].any()

    def _take(self, x0: int, y0: int, x1: int, y1: int) -> None:
        self.taken[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = True

    def _at(self, x: int, y: int) -> tuple[int, int]:
        """Top left of a pixel of the world in the picture."""
        return (x - self.view[0]) * self.factor, (y - self.view[1]) * self.factor


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
