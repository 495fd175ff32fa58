"""A shot's rounds as sets of pixels; and as integer rows, in parts that fit the squares in which they are looked up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planes.bigrows import Depths, rows_of_spans
from planes.constants import SUB
from planes.grid256 import snap, unit_toward
from planes.spans import Spans
from weapons.arsenal import parts_of
from weapons.volley import Shots, volley_of
from weapons.weapon import Weapon

__all__ = ["Frame", "Piece", "Round", "frame_of", "pieces_of", "rounds_of"]

WHOLE = 96
"""A pattern within a box of this side is looked up as a whole, px: of a larger one most is empty where an object is."""

TILE = 64
"""Side of the parts of a larger one, px."""

PARTS_MAX = 256
"""Parts of a pattern that are looked up one by one; with more, numpy is as fast."""

TURNED_PX = 2
"""How far beyond its reach a pattern that turns may have pixels: those whose squares its axis meets, and rounding."""


class Round(NamedTuple):
    """A round of a shot at the origin: its pixel (x, y), its number, and its pixels about that."""

    x: int
    y: int
    number: int
    spans: Spans


Piece = tuple[int, int, int, Depths]
"""A part of a round: the pixel (x, y) where it is looked up, from the round's; its pixels as integer rows; and their
order."""


@dataclass(frozen=True)
class Frame:
    """What the pixels of each round lie within: so many px from its own; and how they are looked up as integer rows.

    A part lies in a box of some side that begins at (corner, corner) from the pixel where it is looked up; patterns
    larger than that are cut into tiles.
    """

    reach: int
    corner: int
    side: int
    tiled: bool


def frame_of(weapon: Weapon) -> Frame | None:
    """What a weapon of patterns lies within; None if that is too large, or depends on the place in its pixel."""
    burst, spread, plain = parts_of(weapon)
    if burst and (snap(burst.recoil_xy) % SUB).any():
        return None
    reach = plain.reach_256 // SUB + (TURNED_PX if plain.directed else 0)
    reach += int(snap(spread.radius)) // SUB if spread else 0
    side = 2 * reach + 1
    if side <= WHOLE:
        return Frame(reach, -reach, side, False)
    return Frame(reach, 0, TILE, True) if (side // TILE + 1) ** 2 <= PARTS_MAX else None


def rounds_of(weapon: Weapon, shots: Shots, offset_256: tuple[int, int] | None) -> list[Round]:
    """Rounds of a shot at the origin, which is aimed `toward` an offset, if any; none that has no pixel."""
    if offset_256 is not None:
        shots = shots.aimed(np.stack(unit_toward(*offset_256)).reshape(1, 2))
    volley = volley_of(weapon, shots)
    found: list[Round] = []
    for number in np.unique(volley.round).tolist():
        pellets = np.flatnonzero(volley.round == number)
        x, y = volley.origin_xy[pellets[0]].tolist()
        placed = zip(volley.pattern[pellets].tolist(), volley.xy[pellets].tolist(), strict=True)
        sets = [volley.table.patterns[k].spans.translated(px - x, py - y) for k, (px, py) in placed]
        runs = (np.concatenate([getattr(one, name) for one in sets]) for name in ("y", "x_first", "x_last"))
        spans = Spans.from_runs(*runs)
        if len(spans):
            found.append(Round(x, y, number, spans))
    return found


def pieces_of(spans: Spans, frame: Frame, stride: int) -> list[Piece]:
    """The pixels of one round as integer rows, whole or cut into tiles."""
    box = spans.box_xyxy
    if box is None:
        return []
    if not frame.tiled:
        rows = rows_of_spans(spans, (frame.corner, frame.corner), stride)
        return [(0, 0, rows, Depths(rows, stride, frame.corner, frame.corner))]
    found: list[Piece] = []
    for top in range(box[1], box[3] + 1, TILE):
        for left in range(box[0], box[2] + 1, TILE):
            part = _clipped(spans, left, top)
            if len(part):
                rows = rows_of_spans(part, (left, top), stride)
                found.append((left, top, rows, Depths(rows, stride, left, top)))
    return found


def _clipped(spans: Spans, left: int, top: int) -> Spans:
    """The pixels in one tile."""
    first, last = np.maximum(spans.x_first, left), np.minimum(spans.x_last, left + TILE - 1)
    some = (first <= last) & (spans.y >= top) & (spans.y < top + TILE)
    return Spans(spans.y[some], first[some], last[some])
