"""Slow exact reference for sprites: where a frame or a shape lies once it is flipped, scaled, turned and placed.

Frame: x right, y down; pixel (x, y) is the closed square around its centre. A frame is rows of booleans; a pivot is
in 1/256 px from the centre of its pixel [0, 0]; scales are in 1/65536. A turn is `quarter` quarter turns and a rest
(c, s), cosine and sine times 2**30. One pixel at a time, in fractions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from oracle_raster import in_ellipse, in_polygon, rounded, turned

__all__ = ["Turn", "default_pivot", "place", "placed_circle", "placed_mask", "placed_polygon", "turn_of_corner"]

ONE = 1 << 30
PX = 256
FULL = 1 << 16
CENTRE = Fraction(1, 2)

Pixels = set[tuple[int, int]]
Point = tuple[int, int]
Rows = Sequence[Sequence[bool]]


@dataclass(frozen=True)
class Turn:
    """How a frame is changed: flip, scale in 1/65536, quarter turns, and the direction of the rest."""

    flip: str = "none"
    scale: Point = (FULL, FULL)
    quarter: int = 0
    c: int = ONE
    s: int = 0


def default_pivot(mask: Rows) -> Point:
    """Centre ((w-1)/2, (h-1)/2) of a frame, in 1/256 px."""
    return 128 * (len(mask[0]) - 1), 128 * (len(mask) - 1)


def placed_mask(mask: Rows, pivot: Point | None, turn: Turn, position: Point) -> Pixels:
    """World pixels of a placed frame; position and pivot in 1/256 px."""
    height, width = len(mask), len(mask[0])
    x, y = default_pivot(mask) if pivot is None else pivot
    centres = {(column, row) for row in range(height) for column in range(width) if mask[row][column]}
    if turn.flip in ("x", "xy"):
        centres = {(width - 1 - column, row) for column, row in centres}
        x = PX * (width - 1) - x
    if turn.flip in ("y", "xy"):
        centres = {(column, height - 1 - row) for column, row in centres}
        y = PX * (height - 1) - y
    pivot_xy = (Fraction(x, PX), Fraction(y, PX))
    held_xy = tuple(_held(p, scale) for p, scale in zip(pivot_xy, turn.scale, strict=True))
    around = _grid(held_xy, _reach(width, height, pivot_xy, turn))
    offsets = [offset for offset in around if _hits(offset, centres, pivot_xy, turn)]
    for _ in range(turn.quarter):
        offsets = [(-dy, dx) for dx, dy in offsets]
    return {place(offset, position) for offset in offsets}


def placed_polygon(rings: Sequence[Sequence[Point]], turn: Turn, position: Point) -> Pixels:
    """World pixels of a placed polygon; points about the position, in 1/256 px."""
    sign = (-1 if turn.flip in ("x", "xy") else 1, -1 if turn.flip in ("y", "xy") else 1)
    made = []
    for ring in rings:
        scaled = [tuple(rounded(Fraction(p[i] * sign[i] * turn.scale[i], FULL)) for i in (0, 1)) for p in ring]
        made.append([turned(p, *turn_of_corner(turn)) for p in scaled])
    reach = 1 + max(abs(v) for ring in made for p in ring for v in p) // PX
    around = range(-reach, reach + 1)
    return {place((x, y), position) for y in around for x in around if in_polygon(x, y, made)}


def placed_circle(radius: int, turn: Turn, position: Point) -> Pixels:
    """World pixels of a placed circle, which two scales make an ellipse; radius in 1/256 px."""
    radii = [rounded(Fraction(radius * scale, FULL)) for scale in turn.scale]
    around = range(-max(radii) // PX - 1, max(radii) // PX + 2)
    direction = turn_of_corner(turn)
    return {place((x, y), position) for y in around for x in around if in_ellipse(x, y, *radii, *direction)}


def turn_of_corner(turn: Turn) -> Point:
    """Direction of a whole turn: the rest and its quarter turns."""
    c, s = turn.c, turn.s
    for _ in range(turn.quarter):
        c, s = -s, c
    return c, s


def place(offset: tuple[Fraction | int, Fraction | int], position: Point) -> Point:
    """Whole pixel of a centre that lies at an offset from the position."""
    x, y = (math.floor(Fraction(p, PX) + o + CENTRE) for p, o in zip(position, offset, strict=True))
    return x, y


def _held(pivot: Fraction, scale: int) -> Fraction:
    """Where a pivot lies on the scaled frame: as the frame's edges are scaled, to half a pixel; unscaled, as it is."""
    if scale == FULL:
        return pivot
    return Fraction(rounded(2 * ((pivot + CENTRE) * Fraction(scale, FULL) - CENTRE)), 2)


def _reach(width: int, height: int, pivot_xy: tuple[Fraction, ...], turn: Turn) -> int:
    """Pixels from the pivot beyond which nothing can lie."""
    far_x = max(abs(edge - pivot_xy[0]) for edge in (-CENTRE, width - CENTRE)) * Fraction(turn.scale[0], FULL)
    far_y = max(abs(edge - pivot_xy[1]) for edge in (-CENTRE, height - CENTRE)) * Fraction(turn.scale[1], FULL)
    if turn.s == 0:
        return math.ceil(max(far_x, far_y)) + 1
    return math.isqrt(math.ceil(far_x**2 + far_y**2)) + 2


def _grid(held_xy: tuple[Fraction, ...], reach: int) -> list[tuple[Fraction, Fraction]]:
    """Offsets from the pivot of all pixel centres within reach: whole pixels less the pivot's fraction."""
    xs, ys = ([k - held % 1 for k in range(-reach, reach + 2)] for held in held_xy)
    return [(x, y) for y in ys for x in xs]


def _hits(offset: tuple[Fraction, Fraction], centres: Pixels, pivot_xy: tuple[Fraction, ...], turn: Turn) -> bool:
    """Turn and scale an offset back; does it lie in the closed unit square of a set pixel?"""
    dx, dy = offset
    x = (dx * turn.c + dy * turn.s) / ONE * Fraction(FULL, turn.scale[0]) + pivot_xy[0]
    y = (dy * turn.c - dx * turn.s) / ONE * Fraction(FULL, turn.scale[1]) + pivot_xy[1]
    columns = (math.ceil(x - CENTRE), math.floor(x + CENTRE))
    rows = (math.ceil(y - CENTRE), math.floor(y + CENTRE))
    return any((column, row) in centres for column in columns for row in rows)
