"""Overlay of a picture: numbered shots, names of hit objects, links from occluders to objects, and rays.

A label is placed where it covers no sample, no object that it could seem to name, and no other label.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence, Set
from typing import Any

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.files.png import cv2
from hitplanes.planes.grid.spans import Box, Spans
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from .canvas import DARK, INK, OUTLINES, OUTLINES_MAX, Text, World, covered, enlarged
from .phrases import NAME_MAX, apart, short
from .symbols import BADGE, MARKS, MINT, NEAR_MISS, WHITE, Signs, Strokes

LETTER, ROW = 7, 17  # width of a letter and height of a label, px; not the font's, which depend on OpenCV's version
LABELS_MAX = 16  # most names in one picture; the cards have all
LINKS_MAX = 8  # most occluders that are linked to the object they kept most samples from; the cards have all
SHOT_BADGE = 11  # radius of the disc of a shot's number, px
NEAR, CLOSE, FAR = 40, 110, 400  # how far a name lies from its object, or from a link, if it can; and at most, px


class Overlay:
    """Marks and labels over an enlarged view; `texts` collects the text layer."""

    def __init__(self, world: World) -> None:
        self.world, self.image, self.view, self.factor = world, world.image, world.view, world.factor
        self.taken: Bools = np.zeros(self.image.shape[:2], np.bool_)
        self.targets: Bools = self.taken.copy()
        self.bodies: Bools = self.taken.copy()  # what is taken by nothing but an object that was hit
        self.texts: list[Text] = []

    def keep_free(self, shots: Sequence[Mapping[str, Any]], scene: Scene) -> None:
        """Reserve the samples, the objects that were hit, and the occluders that blocked, against labels."""
        runs = [of for shot in shots for of in shot["samples"].values()]
        items = {entry["object"] for shot in shots for entry in (*shot["rows"], *shot["blockers"])}
        bodies = [Spans.from_mask(*scene.mask(item)).runs() for item in items]
        targets = scene.ids(Role.HITTABLE).tolist()[:OUTLINES_MAX]
        self.bodies = enlarged(covered(self.view, bodies), self.factor)
        self.taken |= self.bodies
        self.reserve(enlarged(covered(self.view, runs), self.factor))
        every = (Spans.from_mask(*scene.mask(item)).runs() for item in targets)
        self.targets |= enlarged(covered(self.view, every), self.factor)

    def reserve(self, drawn: Bools) -> None:
        """Keep labels away from pixels (h, w) of the picture."""
        self.taken |= drawn
        self.bodies &= ~drawn

    def shot(self, shot: Mapping[str, Any], number: int) -> None:
        """Draw a cross on the pixel of a shot and its number in a disc with a line to it; an arrow if out of view."""
        height, width = self.image.shape[:2]
        if "rays" in shot:  # they start anywhere in a pixel
            x, y = np.floor(self.world.placed(np.array(shot["at"]))).astype(np.int64).tolist()
        else:
            x, y = (v + self.factor // 2 for v in self._at(*shot["at_xy"]))
        inside = 0 <= x < width and 0 <= y < height
        if not inside:
            x, y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
        bx, by = self._free(x, y, SHOT_BADGE + 1, SHOT_BADGE + 1)
        if inside:
            cv2.line(self.image, (x, y), (bx, by), WHITE, 1)
            for color, thick in ((DARK, 3), (WHITE, 1)):
                cv2.drawMarker(self.image, (x, y), color, cv2.MARKER_CROSS, 2 * max(3, self.factor), thick)
        else:
            cv2.arrowedLine(self.image, (bx, by), (x, y), WHITE, 1, tipLength=0.4)
        cv2.circle(self.image, (bx, by), SHOT_BADGE - 1, DARK, -1)
        cv2.circle(self.image, (bx, by), SHOT_BADGE - 1, WHITE, 1)
        self._take(bx - SHOT_BADGE, by - SHOT_BADGE, bx + SHOT_BADGE + 1, by + SHOT_BADGE + 1)
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
            at = np.argwhere(mask)[:, ::-1] + (x, y)
            seen = at[(at >= self.view[:2]).all(axis=1) & (at <= self.view[2:]).all(axis=1)]
            if len(seen):
                name = scene.name_of(item)
                if not any(self._label(name, box, INK, farthest, seen) for farthest in (NEAR, CLOSE)):
                    body = covered(self.view, [Spans.from_mask(mask, (x, y)).runs()])
                    self._label_on(name, enlarged(body, self.factor))

    def links(self, shots: Sequence[Mapping[str, Any]], hit: Set[int]) -> None:
        """Ring samples that an occluder kept from an object, and name both; objects that were not hit come first."""
        color = MARKS["occluded"][0]
        pairs = [(behind, by) for shot in shots for by in shot["blockers"] for behind in by["blocked"]]
        linked: set[int] = set()
        for behind, by in sorted(pairs, key=lambda pair: (pair[0]["object"] in hit, -pair[0]["samples"])):
            x, y = (v + self.factor // 2 for v in self._at(*behind["at_xy"]))
            inside = 0 <= x < self.image.shape[1] and 0 <= y < self.image.shape[0]
            if not inside or by["object"] in linked or len(linked) >= LINKS_MAX:
                continue
            text = f"{short(by['name'])} blocks {short(behind['name'])}"
            if self._label(text, (x - 7, y - 7, x + 8, y + 8), color, FAR):
                linked.add(by["object"])
                for shade, thick in ((DARK, 3), (color, 1)):
                    cv2.circle(self.image, (x, y), 6, shade, thick)

    def distances(self, shots: Sequence[Mapping[str, Any]]) -> None:
        """Write the distance by which rays missed the nearest object, beside its line."""
        for miss in (shot["nearest_miss"] for shot in shots if shot.get("nearest_miss")):
            ends = self.world.placed(np.array([miss["ray_xy"], miss["object_xy"]]))
            x, y = np.rint(np.clip(ends.mean(axis=0), -FAR, max(self.image.shape) + FAR)).astype(np.int64).tolist()
            inside = 0 <= x < self.image.shape[1] and 0 <= y < self.image.shape[0]
            if inside and 0 < miss["distance"] <= NEAR_MISS:
                self._label(apart(miss["distance"]), (x - 4, y - 4, x + 5, y + 5), MINT, NEAR)

    def _label(
        self, text: str, box: Box, color: tuple[int, int, int], farthest: int, pixels: Ints | None = None
    ) -> bool:
        """Write a text near a box of the picture, with a line to it if it is far; return whether there was room.

        If there is no room beside the other objects, the text may cover one that no shot hit. The line ends at the
        nearest of the pixels (n, 2) of the world, or at the box.
        """
        text = short(text, 2 * NAME_MAX)
        half_w, half_h = _half_of(text)
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
        self._write(text, x, y, color)
        return True

    def _label_on(self, text: str, body: Bools) -> None:
        """Write a name on its own object, a mask (h, w), where nothing is marked: there is no room beside it."""
        text = short(text, 2 * NAME_MAX)
        half_w, half_h = _half_of(text)
        free = body & self.bodies
        rows, columns = np.nonzero(free[::ROW, ::LETTER])
        spots = np.stack([columns * LETTER, rows * ROW], axis=1)
        middle = spots.mean(axis=0) if len(spots) else 0
        for x, y in spots[np.argsort(((spots - middle) ** 2).sum(axis=1), kind="stable")].tolist():
            place = free[max(y - half_h, 0) : y + half_h, max(x - half_w, 0) : x + half_w]
            if place.shape == (2 * half_h, 2 * half_w) and place.all():
                self._write(text, x, y, INK)
                return

    def _write(self, text: str, x: int, y: int, color: tuple[int, int, int]) -> None:
        """Write a text about a point of the picture, on a dark ground."""
        half_w, half_h = _half_of(text)
        part = self.image[y - half_h : y + half_h, x - half_w : x + half_w]
        part[:] = (part.astype(np.uint16) * 60 + np.array(DARK, np.uint16) * 195) // 255
        self._take(x - half_w, y - half_h, x + half_w, y + half_h)
        self.texts.append(Text(x, y + 5, text, color, middle=True))

    def _free(self, x: int, y: int, half_w: int, half_h: int) -> tuple[int, int]:
        """Free place for a rectangle around a point, else the nearest free place, else a place that is not free."""
        height, width = self.image.shape[:2]
        grid = np.mgrid[half_h : height - half_h : SHOT_BADGE, half_w : width - half_w : SHOT_BADGE].reshape(2, -1).T
        order = np.argsort(((grid - (y, x)) ** 2).sum(axis=1), kind="stable")
        others = ((column, row) for row, column in grid[order].tolist())
        for bx, by in itertools.chain(_around((x - 6, y - 6, x + 6, y + 6), half_w, half_h, FAR), others):
            if self._is_free(bx - half_w, by - half_h, bx + half_w, by + half_h):
                return bx, by
        return min(max(x, half_w), max(width - half_w, 0)), min(max(y - 22, half_h), max(height - half_h, 0))

    def _is_free(self, x0: int, y0: int, x1: int, y1: int) -> bool:
        height, width = self.taken.shape
        return min(x0, y0) >= 0 and x1 <= width and y1 <= height and not self.taken[y0:y1, x0:x1].any()

    def _take(self, x0: int, y0: int, x1: int, y1: int) -> None:
        place = slice(max(y0, 0), max(y1, 0)), slice(max(x0, 0), max(x1, 0))
        self.taken[place], self.bodies[place] = True, False

    def _at(self, x: int, y: int) -> tuple[int, int]:
        """Top left corner, in the picture, of a pixel of the world."""
        return (x - self.view[0]) * self.factor, (y - self.view[1]) * self.factor


def _half_of(text: str) -> tuple[int, int]:
    """Half the width and half the height of a label, px."""
    return (LETTER * len(text) + 8) // 2, ROW // 2 + 1


def _around(box: Box, half_w: int, half_h: int, farthest: int) -> Iterator[tuple[int, int]]:
    """Middles of rectangles around a box: above, below, right, left, then the corners, ever farther."""
    x0, y0, x1, y1 = box
    x, y = (x0 + x1) // 2, (y0 + y1) // 2
    for gap in range(3, farthest, 12):
        left, right, up, down = x0 - gap - half_w, x1 + gap + half_w, y0 - gap - half_h, y1 + gap + half_h
        yield from ((x, up), (x, down), (right, y), (left, y))
        yield from ((right, up), (left, up), (right, down), (left, down))


WAY_WIDTH, WAY_DASH, HEAD = 1.4, 6.0, 11.0  # width, dashes and head of the arrow of what has moved, px
SHORTEST = 6.0  # length of the shortest arrow that is drawn, px of the picture


def draw_present(world: World, report: Mapping[str, Any]) -> Bools:
    """Draw the present outlines of moved objects, and arrows from their old places; return the arrows' mask (h, w)."""
    strokes = Strokes(world.image.shape[:2])
    for entry in report["now"]["moved"]:
        world.outline_runs(entry["runs"], "now")
        begin, end = world.placed(np.array([entry["from_xy"], entry["to_xy"]]))
        way = end - begin
        length = float(np.sqrt((way**2).sum()))
        if length > SHORTEST:
            strokes.line(begin, end, WAY_WIDTH, WAY_DASH)
            strokes.head(end, way / length, min(HEAD, length))
    strokes.lay(world.image, *OUTLINES["now"], grounded=True)
    return np.asarray(strokes.ground > 0)


NUMBERED_MAX = 3  # most rays of a shot whose entries have numbers and normals
STEPS_SHOWN = 256  # most tests of a projectile that are drawn, each as a disc
OF_RAYS = ("filtered", "occluded", "hit")  # whose cells are marked under rays; the arrow shows the empty ones
BADGE_INK = (18, 20, 24)
CLEAR_OF = ("number", "first contact", "goes in", "comes out", "ends: occluder", "ends: budget", "ray")
"""Symbols that a number may not cover."""


def draw_rays(world: World, report: Mapping[str, Any]) -> tuple[list[Text], Bools]:
    """Draw the rays of all shots, and the areas that they sweep; return numbers and the mask (h, w) of their pixels."""
    shots = [shot for shot in report["shots"] if "rays" in shot]
    signs = Signs(world.image.shape[:2], sum(len(shot["rays"]) for shot in shots))
    for shot in shots:
        _sweeps(signs, world, shot, _steps_of(report["weapons"][shot["weapon"]]))
        _arrows(signs, world, shot)
        miss = shot["nearest_miss"]
        if miss is not None and 0 < miss["distance"] <= NEAR_MISS:
            signs.miss(*world.placed(np.array([miss["ray_xy"], miss["object_xy"]])))
    texts = [text for shot in shots for text in _numbers(signs, world, shot)]
    world.painted |= {f"ray: {name}" for name in signs.lay(world.image)}
    blank = np.zeros(world.image.shape[:2], np.bool_)
    return texts, np.logical_or.reduce([blank, *(strokes.ground > 0 for strokes in signs.strokes.values())])


def draw_arrows(world: World, shot: Mapping[str, Any]) -> None:
    """Draw the rays of one shot alone, with what they go through."""
    signs = Signs(world.image.shape[:2], len(shot["rays"]))
    _arrows(signs, world, shot)
    signs.lay(world.image)


def _steps_of(weapon: Mapping[str, Any]) -> int | None:
    """Number of moments at which a projectile is tested; 0 if it is swept, None if the weapon is not a projectile."""
    while weapon["kind"] != "projectile":
        inner = [value for value in weapon.values() if isinstance(value, Mapping)]
        if not inner:
            return None
        weapon = inner[0]
    return weapon.get("steps") or 0


def _sweeps(signs: Signs, world: World, shot: Mapping[str, Any], steps: int | None) -> None:
    """Draw the areas that rays sweep, or the discs at which they are tested, and the first contact of a projectile."""
    radius = shot["radius"] * world.factor
    for ray in shot["rays"]:
        stop = ray["stop"]
        begin, at, end = world.placed(np.array([ray["start"], stop["point"], ray["end"]]))
        if steps:
            for k in range(1, min(steps, STEPS_SHOWN) + 1):
                if k <= stop["fraction"] * steps:
                    spot = begin + (end - begin) * (k / steps)
                    signs.sweep(spot, spot, radius, "tested only here")
        elif radius:
            signs.sweep(begin, at, radius)
        if steps is not None and stop["item"] is not None:
            signs.contact(at, radius, world.placed(np.array([stop["cell_xy"]]))[0], float(world.factor))


def _arrows(signs: Signs, world: World, shot: Mapping[str, Any]) -> None:
    """Draw the rays of a shot and their passes through objects, with normals if there are few rays."""
    for ray in shot["rays"]:
        begin, at, end = world.placed(np.array([ray["start"], ray["stop"]["point"], ray["end"]]))
        signs.ray(begin, at, end, ray["stop"]["reason"])
        for entry in ray["passes"]:
            into = world.placed(np.array([entry["point"]]))[0]
            if entry["entry"] < ray["stop"]["fraction"]:  # else the head of the arrow is there
                signs.through(into, begin + (end - begin) * entry["exit"], entry["exit"] < ray["stop"]["fraction"])
            normal = np.array(entry["normal"], np.float64)
            if normal.any() and len(shot["rays"]) <= NUMBERED_MAX:
                signs.normal(into, normal)


def _numbers(signs: Signs, world: World, shot: Mapping[str, Any]) -> Iterator[Text]:
    """Draw a number beside each entry, if there are few rays."""
    if len(shot["rays"]) > NUMBERED_MAX:
        return
    radius = shot["radius"] * world.factor
    for ray in shot["rays"]:
        begin, end = world.placed(np.array([ray["start"], ray["end"]]))
        for entry in ray["passes"]:
            into = world.placed(np.array([entry["point"]]))[0]
            spot = next(_spots(signs, into, end - begin, np.array(entry["normal"]), radius), None)
            if spot is not None:
                signs.of("number").line(spot, spot, 2 * BADGE)
                label = str(entry["order"] + 1)
                x, y = np.rint(spot).astype(np.int64).tolist()
                yield Text(x - 4 * len(label), y + 4, label, BADGE_INK, bold=True)


def _spots(signs: Signs, at: Floats, ahead: Floats, normal: Floats, radius: float) -> Iterator[Floats]:
    """Free places for a number beside a point of a ray of a radius, first on the side that the normal is not on."""
    length = float(np.sqrt((ahead**2).sum()))
    if not length:
        return
    side = np.array([-ahead[1], ahead[0]]) / length
    if (side * normal).sum() > 0 or ((side * normal).sum() == 0 and side[1] > 0):
        side = -side
    height, width = signs.shape
    for far in (radius + BADGE + 6, radius + 2 * BADGE + 8):
        for spot in (at + far * side, at - far * side):
            x, y = (int(v) for v in np.floor(np.clip(spot, -BADGE, (width, height))))
            reach = int(BADGE) + 2
            inside = reach <= x < width - reach and reach <= y < height - reach
            box = slice(max(y - reach, 0), y + reach + 1), slice(max(x - reach, 0), x + reach + 1)
            if inside and not any(
                strokes.ink[box].any() for name, strokes in signs.strokes.items() if name in CLEAR_OF
            ):
                yield spot
