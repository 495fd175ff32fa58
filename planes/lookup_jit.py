"""The kernels of `lookup`, compiled: each placement, or each round, by itself, in one pass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from planes import lookup
from planes.bitrows import Found, Placed, Windows
from planes.bitrows_jit import (
    BOXES,
    FEW_ROWS,
    INTS,
    ONE,
    ROWS_OUT,
    WORDS,
    bits_of,
    in_order,
    is_beyond,
    is_far,
    key_of,
    pixels_of,
    rows_by,
    shared,
)
from planes.bits import Seen
from planes.cells import Cells
from planes.cells_jit import cell_at
from planes.compiled import compiled
from planes.nearest import Beside
from planes.pellets import Gathered

__all__ = ["gathered_up", "looked_up"]

PART_NS, PLACEMENT_NS, LISTED_NS = 8e5, 10.0, 40.0
"""What a thread must have to do to be worth it; what a placement takes, and each tile that is listed near it."""

GIVEN = (
    types.int64, types.int64, types.int64, ROWS_OUT,
    *[INTS] * 5, BOXES, INTS, INTS, WORDS, BOXES, INTS, BOXES, INTS, WORDS,
    *[types.int64] * 5, INTS, INTS,
)  # fmt: skip
"""Of both kernels: what `rows_by` tells them, and what `_given` gives."""


@compiled(types.UniTuple(types.int64, 3)(*GIVEN))
def _looked_up(
    who, end, count, out, pattern, x, y, origin_x, origin_y, pattern_box, first, following, windows, strips,
    rank, box, tile_begin, tiles, cells_x, cells_y, bits, wide, high, begin, listed,
):  # fmt: skip
    room, most = out.shape[1], 0
    whose, hit, hit_samples, key, nearest_x, nearest_y = out[0], out[1], out[2], out[3], out[4], out[5]
    while who < end:
        cell = cell_at(x[who], y[who], cells_x, cells_y, bits, wide, high)
        if cell < 0 or begin[cell] == begin[cell + 1]:
            who += 1
            continue
        kind, item, row = pattern[who], -1, count - 1
        left, top = x[who] + pattern_box[kind, 0], y[who] + pattern_box[kind, 1]
        right, bottom = x[who] + pattern_box[kind, 2], y[who] + pattern_box[kind, 3]
        if is_far(origin_x[who], origin_y[who], left, top, right, bottom):
            return -1, 0, 0
        step = following[kind]
        for place in range(begin[cell], begin[cell + 1]):
            at = listed[place]
            low, lowest = max(box[at, 1], top), min(box[at, 3], bottom)
            if (box[at, 0] > right) | (box[at, 2] < left) | (low > lowest):
                continue
            if len(strips) and is_beyond(strips, kind, x[who], y[who], box[at, 0], box[at, 1], box[at, 2], box[at, 3]):
                continue
            offset = box[at, 0] - left + 63
            word = first[kind] + (offset >> 6) * step - top
            own, level = origin_x[who] - box[at, 0], origin_y[who]
            samples, distance2, across, down = shared(
                tiles, tile_begin[at] - box[at, 1], windows, word, step, offset & 63, low, lowest, own, level
            )
            if samples == 0:
                continue
            new = key_of(distance2, across, down)
            if rank[at] == item:
                hit_samples[row] += samples
                if new < key[row]:
                    key[row], nearest_x[row] = new, across
            else:
                if row + 1 == room:
                    return who, count, most
                row += 1
                item = rank[at]
                whose[row], hit[row], hit_samples[row], key[row], nearest_x[row] = who, at, samples, new, across
        in_order(count, row + 1, origin_x[who], origin_y[who], hit, hit_samples, key, nearest_x, nearest_y)
        most = max(most, row + 1 - count)
        count = row + 1
        who += 1
    return who, count, most


@njit
def _anew(together, tiles, tile, windows, word, step, shift, low, high):
    """Add what a tile shares with a window to what it shares with others, row by row; tell how many pixels are new."""
    tile, word, following = np.uint64(tile + low), np.uint64(word + low), np.uint64(word + step + low)
    right, left, new = np.uint64(shift), np.uint64(63 - shift), np.int64(0)
    for i in range((high - low + 8) & -8):
        row = np.uint64(i)
        met = tiles[tile + row] & ((windows[word + row] >> right) | (windows[following + row] << left << ONE))
        new += bits_of(met & ~together[row])
        together[row] |= met
    return new


@njit(inline="always")
def _in_order(first, last, item, samples, pixels, pellets, key, x):
    """Like `bitrows_jit.in_order`; of pixels as near the item in front is first."""
    for i in range(first + 1, last if last - first <= FEW_ROWS else 0):
        own = item[i], samples[i], pixels[i], pellets[i], key[i], x[i]
        j = i
        while j > first and (key[j - 1] > own[4] or (key[j - 1] == own[4] and item[j - 1] > own[0])):
            item[j], samples[j], pixels[j] = item[j - 1], samples[j - 1], pixels[j - 1]
            pellets[j], key[j], x[j] = pellets[j - 1], key[j - 1], x[j - 1]
            j -= 1
        item[j], samples[j], pixels[j], pellets[j], key[j], x[j] = own


@compiled(types.UniTuple(types.int64, 3)(*GIVEN, types.int64, types.int64))
def _gathered_up(
    turn, end, count, out, pattern, x, y, origin_x, origin_y, pattern_box, first, following, windows, strips,
    rank, box, tile_begin, tiles, cells_x, cells_y, bits, wide, high, begin, listed, each, height,
):  # fmt: skip
    room, most = out.shape[1], 0
    whose, item, samples, pixels = out[0], out[1], out[2], out[3]
    pellets, key, nearest_x, nearest_y = out[4], out[5], out[6], out[7]  # the last one has the last pellet before
    stride, tiles_hit = height + 8, np.empty(len(rank), np.int64)
    row_of, part_of = np.full(rank[-1] + 1 if len(rank) else 0, -1), np.full(len(rank), -1)
    together = np.empty(len(rank) * stride, np.uint64)
    while turn < end:
        row, hits, full = count - 1, 0, False
        for who in range(turn * each, (turn + 1) * each):
            cell = cell_at(x[who], y[who], cells_x, cells_y, bits, wide, high)
            if cell < 0 or begin[cell] == begin[cell + 1]:
                continue
            kind = pattern[who]
            left, top = x[who] + pattern_box[kind, 0], y[who] + pattern_box[kind, 1]
            right, bottom = x[who] + pattern_box[kind, 2], y[who] + pattern_box[kind, 3]
            if is_far(origin_x[turn], origin_y[turn], left, top, right, bottom):
                return -1, 0, 0
            step = following[kind]
            for place in range(begin[cell], begin[cell + 1]):
                at = listed[place]
                low, lowest = max(box[at, 1], top), min(box[at, 3], bottom)
                if (box[at, 0] > right) | (box[at, 2] < left) | (low > lowest):
                    continue
                if len(strips) and is_beyond(
                    strips, kind, x[who], y[who], box[at, 0], box[at, 1], box[at, 2], box[at, 3]
                ):
                    continue
                offset = box[at, 0] - left + 63
                tile, word, shift = tile_begin[at] - box[at, 1], first[kind] + (offset >> 6) * step - top, offset & 63
                own, level = origin_x[turn] - box[at, 0], origin_y[turn]
                met, distance2, across, down = shared(tiles, tile, windows, word, step, shift, low, lowest, own, level)
                if met == 0:
                    continue
                part = part_of[at]
                if part < 0:
                    part = part_of[at] = hits * stride
                    together[part : part + stride] = 0
                    tiles_hit[hits] = at
                    hits += 1
                new = _anew(
                    together[part + low - box[at, 1] :], tiles, tile, windows, word, step, shift, low, lowest
                )  # fmt: skip
                nearest = key_of(distance2, across, down)
                mine = row_of[rank[at]]
                if mine < 0:
                    if row + 1 == room:
                        full = True
                        break
                    row += 1
                    row_of[rank[at]] = row
                    whose[row], item[row], samples[row], pixels[row], pellets[row] = turn, rank[at], met, new, 1
                    key[row], nearest_x[row], nearest_y[row] = nearest, across, who
                    continue
                samples[mine] += met
                pixels[mine] += new
                pellets[mine] += nearest_y[mine] != who
                nearest_y[mine] = who
                if nearest < key[mine]:
                    key[mine], nearest_x[mine] = nearest, across
            if full:
                break
        for k in range(hits):
            row_of[rank[tiles_hit[k]]] = part_of[tiles_hit[k]] = -1
        if full:
            break
        _in_order(count, row + 1, item, samples, pixels, pellets, key, nearest_x)
        pixels_of(count, row + 1, origin_x[turn], origin_y[turn], key, nearest_x, nearest_y)
        most = max(most, row + 1 - count)
        count = row + 1
        turn += 1
    return turn, count, most


def looked_up(placed: Placed, windows: Windows, seen: Seen, cells: Cells, beside: Beside) -> Found:
    """See `lookup.looked_up`; `beside` is not needed."""
    found = None
    if not windows.shifted:
        least = PART_NS / (PLACEMENT_NS + LISTED_NS * _listed(cells))
        found = rows_by(_looked_up, 6, len(placed.x), least, *_given(placed, windows, seen, cells))
    return lookup.looked_up(placed, windows, seen, cells, beside) if found is None else Found(*found)


def gathered_up(placed: Placed, windows: Windows, seen: Seen, cells: Cells, each: int) -> Gathered:
    """See `lookup.gathered_up`."""
    found = None
    if not windows.shifted:
        least = PART_NS / (each * (PLACEMENT_NS + LISTED_NS * _listed(cells)))
        given = *_given(placed, windows, seen, cells), each, seen.height
        found = rows_by(_gathered_up, 8, len(placed.origin_x), least, *given)
    return lookup.gathered_up(placed, windows, seen, cells, each) if found is None else Gathered(*found)


def _listed(cells: Cells) -> float:
    """Tiles that are listed in a cell, about."""
    return len(cells.listed) / max(len(cells.begin) - 1, 1)


def _given(placed: Placed, windows: Windows, seen: Seen, cells: Cells) -> tuple[Any, ...]:
    """What both kernels are given."""
    pattern = windows.box_xyxy, windows.first, windows.rows, windows.words, windows.strips
    return *placed, *pattern, seen.rank, seen.box_xyxy, seen.begin, seen.words, *cells
