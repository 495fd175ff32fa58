"""Peers that keep pixels, each as its best user would write it: pygame-ce in two forms, and a label plane in numpy.

A shot is a whole pixel and the pattern that is placed on it, rendered before. Answers are lists or arrays of rows
(shot, object, samples). A border of MARGIN px around the bounds blocks, so that nothing off them is hit.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from speed_world import MARGIN, WORLD, Item, Volleys

from hitplanes.planes.common.checks import Bools, Ints

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame

__all__ = ["Baked", "Masks", "Placed", "Plane", "pygame_mask", "rendered"]

FINE, COARSE = 3, 4
"""Cells of shot positions have a side of 2**3 px for the smallest patterns, 2**4 px for others: the fastest of 8 to 32.
"""

Row = tuple[int, int, int]


class Cells(NamedTuple):
    """For each cell of shots, who may be met: a mask's `overlap_area`, its first corner, its object."""

    lists: list[tuple[tuple[Any, int, int, int], ...]]
    shift: int
    stride: int


class Placed(NamedTuple):
    """A rendered pattern: its mask, and the first corner and size of its box, from the shot's pixel."""

    mask: Any
    dx: int
    dy: int
    w: int
    h: int


def pygame_mask(mask: Bools) -> Any:
    """A mask of the peer."""
    rgba = np.zeros((*mask.shape, 4), np.uint8)
    rgba[mask] = 255
    surface = pygame.image.frombuffer(rgba.tobytes(), mask.shape[::-1], "RGBA")
    return pygame.mask.from_surface(surface, 127)


def rendered(pattern: tuple[Bools, int, int]) -> Placed:
    """A pattern of `speed_world.pattern_mask`."""
    mask, dx, dy = pattern
    return Placed(pygame_mask(mask), dx, dy, mask.shape[1], mask.shape[0])


def blocking_plane(items: Sequence[Item], size_wh: tuple[int, int] | None) -> Any:
    """All occluders and the border, as one mask that starts MARGIN px before the bounds; None without bounds."""
    if size_wh is None:
        return None
    plane = pygame.mask.Mask((size_wh[0] + 2 * MARGIN, size_wh[1] + 2 * MARGIN), fill=True)
    plane.erase(pygame.mask.Mask(size_wh, fill=True), (MARGIN, MARGIN))
    for item in items:
        if item.occluder:
            plane.draw(pygame_mask(item.mask), (item.left + MARGIN, item.top + MARGIN))
    return plane


def _window(plane: Any, item: Item) -> Any:
    h, w = item.mask.shape
    x, y = item.left + MARGIN, item.top + MARGIN
    assert x >= 0
    assert y >= 0
    return plane[y : y + h, x : x + w]


class Masks:
    """A: pygame-ce as a good user writes it. Nothing depends on where objects are but their rects.

    `collidelistall`, the pattern without what blocks (all occluders in one mask, as they stand still and lie in front),
    then front to back `overlap_area` and `erase`.
    """

    def __init__(self, items: Sequence[Item], size_wh: tuple[int, int] | None = WORLD) -> None:
        shown = [item for item in items if not item.occluder]
        made: dict[tuple[bytes, tuple[int, ...]], Any] = {}
        for item in shown:
            key = item.mask.tobytes(), item.mask.shape
            made[key] = made.get(key) or pygame_mask(item.mask)
        self.masks = [made[item.mask.tobytes(), item.mask.shape] for item in shown]
        self.ids = [item.id for item in shown]
        self.categories = [item.categories for item in shown]
        self.rects = [pygame.Rect(i.left, i.top, *i.mask.shape[::-1]) for i in shown]
        self.blocked = blocking_plane(items, size_wh)

    def points(self, xs: Sequence[int], ys: Sequence[int]) -> list[Row]:
        """Points: the first mask, from the front, that has the pixel."""
        rows: list[Row] = []
        rects, masks, ids, blocked = self.rects, self.masks, self.ids, self.blocked
        box = pygame.Rect(0, 0, 1, 1)
        for shot, place in enumerate(zip(xs, ys, strict=True)):
            box.topleft = place
            found = box.collidelistall(rects)
            if found:
                x, y = place
                if blocked and blocked.get_at((x + MARGIN, y + MARGIN)):
                    continue
                for i in found:
                    left, top = rects[i].topleft
                    if masks[i].get_at((x - left, y - top)):
                        rows.append((shot, ids[i], 1))
                        break
        return rows

    def areas(
        self, xs: Sequence[int], ys: Sequence[int], patterns: Iterable[Placed], pierce: bool = False
    ) -> list[Row]:
        """Any pattern: what of it is left goes on to the next."""
        rows: list[Row] = []
        rects, masks, ids, blocked = self.rects, self.masks, self.ids, self.blocked
        box = pygame.Rect(0, 0, 1, 1)
        for shot, (x, y, (pattern, dx, dy, w, h)) in enumerate(zip(xs, ys, patterns, strict=False)):
            left, top = x + dx, y + dy
            box.update(left, top, w, h)
            found = box.collidelistall(rects)
            if found:
                rest = pattern.copy()
                if blocked:
                    rest.erase(blocked, (-MARGIN - left, -MARGIN - top))
                for i in found:
                    ox, oy = rects[i].topleft
                    at = (ox - left, oy - top)
                    count = rest.overlap_area(masks[i], at)
                    if count:
                        rows.append((shot, ids[i], count))
                        if not pierce:
                            rest.erase(masks[i], at)
        return rows

    def filtered(
        self, xs: Sequence[int], ys: Sequence[int], patterns: Iterable[Placed], accept: int, passed: Iterable[int]
    ) -> list[Row]:
        """Any pattern, that passes over what is of no accepted category, and over one owner a shot."""
        rows: list[Row] = []
        rects, masks, ids, blocked = self.rects, self.masks, self.ids, self.blocked
        categories = self.categories
        box = pygame.Rect(0, 0, 1, 1)
        for shot, (x, y, (mask, dx, dy, w, h), owner) in enumerate(zip(xs, ys, patterns, passed, strict=False)):
            left, top = x + dx, y + dy
            box.update(left, top, w, h)
            found = box.collidelistall(rects)
            if found:
                rest = mask.copy()
                rest.erase(blocked, (-MARGIN - left, -MARGIN - top))
                for i in found:
                    if categories[i] & accept and ids[i] != owner:
                        ox, oy = rects[i].topleft
                        count = rest.overlap_area(masks[i], (ox - left, oy - top))
                        if count:
                            rows.append((shot, ids[i], count))
                            rest.erase(masks[i], (ox - left, oy - top))
        return rows

    def scattered(self, xs: Sequence[int], ys: Sequence[int], pellets: Sequence[Any], pellet: Placed) -> list[Row]:
        """Pellets: one look around the shot, then only what a pellet touches is worked out."""
        rows: list[Row] = []
        rects, masks, ids, blocked = self.rects, self.masks, self.ids, self.blocked
        mask, dx, dy, w, h = pellet
        reach = 24
        box = pygame.Rect(0, 0, 2 * reach + w, 2 * reach + h)
        for shot, (x, y, places) in enumerate(zip(xs, ys, pellets, strict=False)):
            box.topleft = (x + dx - reach, y + dy - reach)
            found = box.collidelistall(rects)
            if not found:
                continue
            counts: dict[int, int] = {}
            near = [(masks[i], *rects[i].topleft, ids[i]) for i in found]
            for px, py in places:
                left, top = px + dx, py + dy
                met = [one for one in near if mask.overlap_area(one[0], (one[1] - left, one[2] - top))]
                if met:
                    rest = mask.copy()
                    if blocked:
                        rest.erase(blocked, (-MARGIN - left, -MARGIN - top))
                    for other, ox, oy, i in met:
                        count = rest.overlap_area(other, (ox - left, oy - top))
                        if count:
                            counts[i] = counts.get(i, 0) + count
                            rest.erase(other, (ox - left, oy - top))
            rows += [(shot, i, count) for i, count in counts.items()]
        return rows


class Plane:
    """A plane of front-most labels in numpy, 0 where nothing is to be hit, with a border; patterns gather from it."""

    def __init__(self, items: Sequence[Item], size_wh: tuple[int, int] = WORLD) -> None:
        self.labels = np.zeros((size_wh[1] + 2 * MARGIN, size_wh[0] + 2 * MARGIN), np.int32)
        for item in reversed(items):
            _window(self.labels, item)[item.mask] = 0 if item.occluder else item.id + 1
        for edge in (self.labels, self.labels.T):
            edge[:MARGIN] = edge[-MARGIN:] = 0
        self.most = max(item.id for item in items) + 2

    def points(self, xy: Ints) -> Ints:
        """Points: one read each."""
        label = self.labels[xy[:, 1] + MARGIN, xy[:, 0] + MARGIN]
        shot = np.flatnonzero(label)
        return np.stack([shot, label[shot] - 1, np.ones_like(shot)], axis=1)

    def few(self, xy: Ints, pattern: tuple[Bools, int, int]) -> Ints:
        """A pattern of few pixels: all of them at once."""
        mask, dx, dy = pattern
        y, x = np.nonzero(mask)
        return self.scattered(xy[:, None], x + dx, y + dy)

    def scattered(self, xy: Ints, x: Ints, y: Ints) -> Ints:
        """Pixels x, y about places (N, K, 2): labels and their counts."""
        wide = self.labels.shape[1]
        base = (xy[..., 1] + MARGIN) * wide + xy[..., 0] + MARGIN
        step = max(1, (1 << 17) // (base.shape[1] * len(x)))
        offset, flat, parts = y * wide + x, self.labels.ravel(), []
        for begin in range(0, len(base), step):
            label = flat[base[begin : begin + step, :, None] + offset].reshape(-1, base.shape[1] * len(x))
            shot, k = np.nonzero(label)
            key, count = np.unique((shot + begin) * self.most + label[shot, k], return_counts=True)
            parts.append(np.stack([key // self.most, key % self.most - 1, count], axis=1))
        return np.concatenate(parts)

    def areas(self, xs: Sequence[int], ys: Sequence[int], patterns: Iterable[tuple[Bools, int, int]]) -> list[Row]:
        """A pattern of many pixels: shot by shot, the window's labels counted."""
        rows: list[Row] = []
        labels = self.labels
        for shot, (x, y, (mask, dx, dy)) in enumerate(zip(xs, ys, patterns, strict=False)):
            h, w = mask.shape
            top, left = y + dy + MARGIN, x + dx + MARGIN
            seen = labels[top : top + h, left : left + w][mask]
            seen = seen[seen > 0]
            if len(seen):
                count = np.bincount(seen)
                found = count.nonzero()[0]
                rows += zip(repeat(shot), (found - 1).tolist(), count[found].tolist(), strict=False)
        return rows


class Baked:
    """C: an expert's form for a scene that stands still. What of each object is visible is baked once, and cropped.

    Lists of who may be met are made for cells of shot positions; then only `overlap_area` is left.
    """

    def __init__(self, items: Sequence[Item], plane: Plane) -> None:
        self.shown: list[tuple[Any, int, int, int]] = []
        boxes = []
        for item in items:
            visible = _window(plane.labels, item) == item.id + 1
            if not item.occluder and visible.any():
                y, x = (np.flatnonzero(visible.any(axis=axis)) for axis in (1, 0))
                crop = visible[y[0] : y[-1] + 1, x[0] : x[-1] + 1]
                left, top = item.left + int(x[0]), item.top + int(y[0])
                self.shown.append((pygame_mask(crop), left, top, item.id))
                boxes.append((left, top, *crop.shape[::-1]))
        self.rects = [pygame.Rect(box) for box in boxes]
        self.size_hw = plane.labels.shape

    def cells(self, dx: int, dy: int, w: int, h: int) -> Cells:
        """For each cell of shots, what the box of a pattern (its corner from the shot, its size) may meet."""
        shift = FINE if max(w, h) <= 1 << FINE else COARSE
        rows, stride = ((side >> shift) + 1 for side in self.size_hw)
        cells: list[list[tuple[Any, int, int, int]]] = [[] for _ in range(stride * rows)]
        for (mask, left, top, i), rect in zip(self.shown, self.rects, strict=True):
            one = (mask.overlap_area, left - dx, top - dy, i)
            first_x, last_x = (rect.left - dx - w + 1 + MARGIN) >> shift, (rect.right - 1 - dx + MARGIN) >> shift
            first_y, last_y = (rect.top - dy - h + 1 + MARGIN) >> shift, (rect.bottom - 1 - dy + MARGIN) >> shift
            for row in range(max(first_y, 0), min(last_y, rows - 1) + 1):
                for column in range(max(first_x, 0), min(last_x, stride - 1) + 1):
                    cells[row * stride + column].append(one)
        return Cells(list(map(tuple, cells)), shift, stride)  # all empty tuples are one: fewer cache misses

    def alike(self, xs: Sequence[int], ys: Sequence[int], pattern: Any, cells: Cells) -> list[Row]:
        """One pattern for all shots, with its cells."""
        rows: list[Row] = []
        lists, shift, stride = cells
        for shot, (x, y) in enumerate(zip(xs, ys, strict=False)):
            for ask, left, top, i in lists[((y + MARGIN) >> shift) * stride + ((x + MARGIN) >> shift)]:
                count = ask(pattern, (x - left, y - top))
                if count:
                    rows.append((shot, i, count))
        return rows

    def areas(self, xs: Sequence[int], ys: Sequence[int], patterns: Iterable[Placed]) -> list[Row]:
        """A pattern of its own for each shot: long ones would be in too many cells."""
        rows: list[Row] = []
        shown, rects = self.shown, self.rects
        box = pygame.Rect(0, 0, 1, 1)
        for shot, (x, y, (pattern, dx, dy, w, h)) in enumerate(zip(xs, ys, patterns, strict=False)):
            left, top = x + dx, y + dy
            box.update(left, top, w, h)
            for k in box.collidelistall(rects):
                mask, mx, my, i = shown[k]
                count = mask.overlap_area(pattern, (left - mx, top - my))
                if count:
                    rows.append((shot, i, count))
        return rows

    def scattered(self, pellets: Sequence[Any], pellet: Placed, cells: Cells) -> list[Row]:
        """Pellets of one pattern, each by its own cell."""
        rows: list[Row] = []
        mask, (lists, shift, stride) = pellet.mask, cells
        for shot, places in enumerate(pellets):
            counts: dict[int, int] = {}
            for x, y in places:
                for ask, left, top, i in lists[((y + MARGIN) >> shift) * stride + ((x + MARGIN) >> shift)]:
                    count = ask(mask, (x - left, y - top))
                    if count:
                        counts[i] = counts.get(i, 0) + count
            for i, count in counts.items():
                rows.append((shot, i, count))
        return rows


def first(work: Volleys, units: int) -> tuple[list[int], list[int]]:
    """The first pixels of a round."""
    return work.lists["x"][:units], work.lists["y"][:units]
