"""The kernel of `lookup`, compiled: each placement by itself, in one pass."""

from __future__ import annotations

from numba import types

from planes import lookup
from planes.bitrows import Beside, Found, Placed, Seen, Windows
from planes.bitrows_jit import BOXES, INTS, ROWS_OUT, WORDS, in_order, is_beyond, is_far, key_of, rows_by, shared
from planes.cells import Cells
from planes.cells_jit import cell_at
from planes.compiled import compiled

__all__ = ["looked_up"]

PART_NS, PLACEMENT_NS, LISTED_NS = 8e5, 10.0, 40.0
"""What a thread must have to do to be worth it; what a placement takes, and each tile that is listed near it."""


@compiled(
    types.UniTuple(types.int64, 2)(
            types.int64, types.int64, types.int64, ROWS_OUT,
            *[INTS] * 5, BOXES, INTS, INTS, WORDS, BOXES, INTS, BOXES, INTS, WORDS,
            *[types.int64] * 5, INTS, INTS,
    )
)  # fmt: skip
def _looked_up(
    who, end, count, out, pattern, x, y, origin_x, origin_y, pattern_box, first, following, windows, strips,
    rank, box, tile_begin, tiles, cells_x, cells_y, bits, wide, high, begin, listed,
):  # fmt: skip
    room = out.shape[1]
    whose, hit, hit_samples, key, nearest_x, nearest_y = out[0], out[1], out[2], out[3], out[4], out[5]
    while who < end:
        cell = cell_at(x[who], y[who], cells_x, cells_y, bits, wide, high)
        if cell < 0:
            who += 1
            continue
        entry, last = begin[cell], begin[cell + 1]
        if entry == last:
            who += 1
            continue
        if count + last - entry > room:
            break
        kind, item, row = pattern[who], -1, count - 1
        left, top = x[who] + pattern_box[kind, 0], y[who] + pattern_box[kind, 1]
        right, bottom = x[who] + pattern_box[kind, 2], y[who] + pattern_box[kind, 3]
        if is_far(origin_x[who], origin_y[who], left, top, right, bottom):
            return -1, 0
        step = following[kind]
        for place in range(entry, last):
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
                row += 1
                item = rank[at]
                whose[row], hit[row], hit_samples[row], key[row], nearest_x[row] = who, at, samples, new, across
        in_order(count, row + 1, origin_x[who], origin_y[who], hit, hit_samples, key, nearest_x, nearest_y)
        count = row + 1
        who += 1
    return who, count


def looked_up(placed: Placed, windows: Windows, seen: Seen, cells: Cells, beside: Beside) -> Found:
    """See `lookup.looked_up`; `beside` is not needed."""
    each = PLACEMENT_NS + LISTED_NS * len(cells.listed) / max(len(cells.begin) - 1, 1)
    found = None
    if not windows.shifted:
        found = rows_by(
            _looked_up, len(placed.x), PART_NS / each,
            *placed, windows.box_xyxy, windows.first, windows.rows, windows.words, windows.strips,
            seen.rank, seen.box_xyxy, seen.begin, seen.words, *cells,
        )  # fmt: skip
    return lookup.looked_up(placed, windows, seen, cells, beside) if found is None else found
