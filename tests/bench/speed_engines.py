"""Peers that keep shapes: pymunk and shapely, on the convex hulls of the masks. They see no occluders, count no pixels.

Their question is easier than ours, and the tables say so. They answer how many rows they found.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import cv2
import numpy as np
import pymunk
import shapely
from speed_world import Item, Volleys

__all__ = ["EASIER", "Space", "Tree"]

EASIER = "convex hulls, no occluders, no pixels"


def hull_of(item: Item) -> Any:
    """Hull (n, 2) of the squares of a mask's pixels."""
    return _hull(item.mask.tobytes(), item.mask.shape)


@cache
def _hull(mask: bytes, shape: tuple[int, int]) -> Any:
    """The same masks come again and again."""
    y, x = np.nonzero(np.frombuffer(mask, np.bool_).reshape(shape))
    squares = np.concatenate([np.stack([x + i, y + j], axis=1) for i in (-0.5, 0.5) for j in (-0.5, 0.5)])
    return cv2.convexHull(squares.astype(np.float32))[:, 0].astype(np.float64)


class Space:
    """pymunk: a body for each object, so that it can move; what stands still is static."""

    def __init__(self, items: Sequence[Item], moving: bool = False) -> None:
        self.space = pymunk.Space()
        self.bodies = []
        for item in items:
            if not item.occluder:
                kind = pymunk.Body.KINEMATIC if moving else pymunk.Body.STATIC
                body = pymunk.Body(body_type=kind)
                body.position = item.left, item.top
                self.bodies.append(body)
                self.space.add(body, pymunk.Poly(body, hull_of(item).tolist()))
        self.space.step(1e-9)  # builds its index
        self.all = pymunk.ShapeFilter()

    def move(self, corners: Sequence[tuple[int, int]]) -> None:
        """Place all objects by their first corners."""
        for body, corner in zip(self.bodies, corners, strict=True):
            body.position = corner
        self.space.step(1e-9)

    def discs(self, work: Volleys, units: int, radius: float) -> int:
        """All shapes at most `radius` away."""
        ask, filter_, found = self.space.point_query, self.all, 0
        for place in work.lists["places"][:units]:
            found += len(ask(place, radius, filter_))
        return found

    def scattered(self, work: Volleys, units: int) -> int:
        """All shapes at each pellet."""
        ask, filter_, found = self.space.point_query, self.all, 0
        for places in work.lists["pellets"][:units]:
            for place in places:
                found += len(ask(place, 2, filter_))
        return found

    def beams(self, work: Volleys, units: int) -> int:
        """All shapes on a segment of 300 x 6 px."""
        ask, filter_, found = self.space.segment_query, self.all, 0
        for (x, y), (fx, fy) in zip(work.lists["places"][:units], work.lists["ray ends"], strict=False):
            found += len(ask((x, y), (x + 0.3 * (fx - x), y + 0.3 * (fy - y)), 3, filter_))
        return found

    def piercing_rays(self, work: Volleys, units: int, radius: float = 0) -> int:
        """All shapes on a segment, or at most `radius` away."""
        ask, filter_, found = self.space.segment_query, self.all, 0
        for start, end in zip(work.lists["places"][:units], work.lists["ray ends"], strict=False):
            found += len(ask(start, end, radius, filter_))
        return found

    def rays(self, work: Volleys, units: int) -> int:
        """The first shape on a segment."""
        ask, filter_, found = self.space.segment_query_first, self.all, 0
        for start, end in zip(work.lists["places"][:units], work.lists["ray ends"], strict=False):
            found += ask(start, end, 0, filter_) is not None
        return found


class Tree:
    """shapely: an STRtree of hulls, asked for all shots at once."""

    def __init__(self, items: Sequence[Item]) -> None:
        shown = [item for item in items if not item.occluder]
        hulls = [shapely.Polygon(hull_of(item) + np.array((item.left, item.top))) for item in shown]
        shapely.prepare(hulls)
        self.tree = shapely.STRtree(hulls)
        self.tree.query(shapely.Point(0, 0))  # GEOS builds it then

    def discs(self, work: Volleys, units: int, radius: float) -> int:
        """All hulls at most `radius` away."""
        points = shapely.points(work.at[:units])
        if radius:
            return len(self.tree.query(points, "dwithin", radius)[0])
        return len(self.tree.query(points, "intersects")[0])

    def scattered(self, work: Volleys, units: int) -> int:
        """All hulls at each pellet."""
        assert work.pellets is not None
        points = shapely.points(work.pellets[:units].reshape(-1, 2).astype(float))
        return len(self.tree.query(points, "dwithin", 2)[0])

    def lines(self, work: Volleys, units: int, part: float, radius: float) -> int:
        """All hulls on a part of each ray, in no order."""
        at = work.at[:units]
        ends = at + part * (work.lists["ends"][:units] - at)
        lines = shapely.linestrings(np.stack([at, ends], axis=1))
        if radius:
            return len(self.tree.query(lines, "dwithin", radius)[0])
        return len(self.tree.query(lines, "intersects")[0])
