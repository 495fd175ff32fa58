"""The kernel of `fronttoback`, compiled: each placement takes its pixels from what is left of its pattern."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from planes import fronttoback
from planes.arrays import Ints
from planes.bitrows import Found, Placed, Windows
from planes.bitrows_jit import (
    ALL,
    BOXES,
    EVERYWHERE,
    FAR,
    FLAGS,
    INTS,
    ONE,
    OUT,
    ROWS_OUT,
    WORDS,
    bits_of,
    columns_about,
    in_order,
    is_beyond,
    is_far,
    key_of,
    pixel_of,
    row_key,
    rows_by,
    shared,
)
from planes.bits import WORD
from planes.compiled import compiled
from planes.fronttoback import Pile
from planes.spans import Box

__all__ = [
    "NOBODY", "NONE", "OWNERS", "PAD", "cut_off", "front_to_back", "laid", "near_of", "refuses", "struck", "take",
]  # fmt: skip

PART_NS, PLACEMENT_NS, TILE_NS = 8e5, 150.0, 0.7
"""What a thread must have to do to be worth it; about what a placement takes, and more for each tile there is."""

FEW = 4
"""So few placements look at every tile; for more, tiles are put into cells of the world first."""

CELL_BITS = 6
"""Of the side of those cells, at least: no tile is wider."""

PAD = WORD
"""Empty rows before and after those of a pattern, as `windows.columns_of` lays them out."""

OWNERS = types.Array(types.int64, 2, "A", readonly=True)


@compiled(types.Tuple((OUT, OUT, OUT))(BOXES))
def _binned(box):
    """Tiles by the cell of their first corner: where each list begins, the lists, and the cells' place and size."""
    count = len(box)
    x, y, x_max, y_max = box[0, 0], box[0, 1], box[0, 0], box[0, 1]
    for tile in range(count):
        x, x_max = min(x, box[tile, 0]), max(x_max, box[tile, 0])
        y, y_max = min(y, box[tile, 1]), max(y_max, box[tile, 1])
    bits = CELL_BITS
    while (((x_max - x) >> bits) + 1.0) * (((y_max - y) >> bits) + 1.0) > 2.0 * count + 64:
        bits += 1
    wide, high = ((x_max - x) >> bits) + 1, ((y_max - y) >> bits) + 1
    begin, listed = np.zeros(wide * high + 1, np.int64), np.empty(count, np.int64)
    for tile in range(count):
        begin[((box[tile, 1] - y) >> bits) * wide + ((box[tile, 0] - x) >> bits)] += 1
    total = 0
    for cell in range(wide * high + 1):
        total, begin[cell] = total + begin[cell], total
    for tile in range(count):
        cell = ((box[tile, 1] - y) >> bits) * wide + ((box[tile, 0] - x) >> bits)
        listed[begin[cell]] = tile
        begin[cell] += 1
    for cell in range(wide * high, 0, -1):
        begin[cell] = begin[cell - 1]
    begin[0] = 0
    return begin, listed, np.array([x, y, bits, wide, high])


@njit
def near_of(box, begin, listed, cells, left, top, right, bottom, near):
    """Tiles whose boxes meet one, front to back; how many."""
    count = 0
    if not len(cells):
        for tile in range(len(box)):
            across = (box[tile, 0] <= right) & (box[tile, 2] >= left)
            if across & (box[tile, 1] <= bottom) & (box[tile, 3] >= top):
                near[count] = tile
                count += 1
        return count
    x, y, bits, wide, high = cells[0], cells[1], cells[2], cells[3], cells[4]
    first, last = max((left - WORD + 1 - x) >> bits, 0), min((right - x) >> bits, wide - 1)
    if first > last:
        return 0
    for row in range(max((top - WORD + 1 - y) >> bits, 0), min((bottom - y) >> bits, high - 1) + 1):
        for entry in range(begin[row * wide + first], begin[row * wide + last + 1]):
            tile = listed[entry]
            across = (box[tile, 0] <= right) & (box[tile, 2] >= left)
            if across & (box[tile, 1] <= bottom) & (box[tile, 3] >= top):
                near[count] = tile
                count += 1
    _sort(near, count)
    return count


@njit
def _crossing(strips, pattern, x, y, box, near, count):
    """Keep tiles that are not beyond the strip of a pattern; how many."""
    kept = 0
    for i in range(count):
        tile = near[i]
        near[kept] = tile
        kept += not is_beyond(strips, pattern, x, y, box[tile, 0], box[tile, 1], box[tile, 2], box[tile, 3])
    return kept


@njit
def _sort(numbers, count):
    """Shell (1959)."""
    step = 1
    while step < count // 3:
        step = 3 * step + 1
    while step:
        for i in range(step, count):
            number, j = numbers[i], i
            while j >= step and numbers[j - step] > number:
                numbers[j] = numbers[j - step]
                j -= step
            numbers[j] = number
        step //= 3


@njit
def laid(windows, first, columns, step, rows, rest):
    """Copy the rows of a pattern between the empty ones, and tell how many pixels it has."""
    pixels = 0
    for column in range(columns):
        source, target = np.uint64(first + column * step), np.uint64(PAD + column * step)
        for i in range(rows):
            row = np.uint64(i)
            rest[target + row] = windows[source + row]
            pixels += bits_of(windows[source + row])
    return pixels


@njit
def cut_off(rest, columns, step, left, top, rows, x, y, x_max, y_max):
    """Take away what of a pattern lies beyond the bounds, and tell how many pixels it has left."""
    pixels = 0
    for column in range(columns):
        first = left - 63 + 64 * column  # of the world
        low, high = max(x - first, 0), min(x_max - first, 63)
        kept = np.uint64(0)
        if low <= 63 and high >= low:
            kept = (ALL << np.uint64(low)) & (ALL >> np.uint64(63 - high))
        for row in range(rows):
            word = column * step + PAD + row
            rest[word] = rest[word] & kept if y <= top + row <= y_max else np.uint64(0)
            pixels += bits_of(rest[word])
    return pixels


@njit
def take(tiles, tile, rest, word, step, shift, low, high):
    """Take the pixels of a tile away from what is left, in rows from `low` to `high`; how many there were."""
    tile, word, following = np.uint64(tile + low), np.uint64(word + low), np.uint64(word + step + low)
    left, right = np.uint64(shift), np.uint64(63 - shift)
    taken = 0
    for i in range(high - low + 1):
        row = np.uint64(i)
        near, far = tiles[tile + row] << left, tiles[tile + row] >> right >> ONE
        taken += bits_of(rest[word + row] & near) + bits_of(rest[following + row] & far)
        rest[word + row] &= ~near
        rest[following + row] &= ~far
    return taken


@njit
def struck(tiles, tile, rest, word, step, shift, low, high, own, level):
    """What a tile shares with what is left of a pattern, told as by `shared`; that is taken away.

    In one pass: `shared` and then `take` make discs among 100 items 2 to 5 % slower, among 1000 items some 10 %.
    """
    tile, word, following = np.uint64(tile + low), np.uint64(word + low), np.uint64(word + step + low)
    right, left = np.uint64(shift), np.uint64(63 - shift)
    ahead, behind, beyond = columns_about(own)
    samples, nearest = np.int64(0), FAR
    for i in range((high - low + 8) & -8):
        row = np.uint64(i)
        pixels, near, far = tiles[tile + row], rest[word + row], rest[following + row]
        met = pixels & ((near >> right) | (far << left << ONE))
        rest[word + row] = near & ~(pixels << right)
        rest[following + row] = far & ~(pixels >> left >> ONE)
        samples += bits_of(met)
        nearest = min(nearest, row_key(met, i, low - level + i, ahead, behind, beyond))
    if samples == 0:
        return samples, FAR, np.int64(0), np.int64(0)
    return samples, *pixel_of(nearest, own, low - level)


@njit(inline="always")
def refuses(tile, categories, owner, accept, exclude, who):
    """Whether a shot refuses the item of a tile; what there is one of is for all shots."""
    if categories[tile] & accept[who if len(accept) > 1 else 0] == 0:
        return True
    for k in range(exclude.shape[1]):  # noqa: SIM110 - a generator costs a call of its own
        if owner[tile] == exclude[who if len(exclude) > 1 else 0, k]:
            return True
    return False


@njit
def _accepted(near, count, occluder, categories, owner, accept, exclude, who):
    """Keep tiles that a shot accepts, up to the last object's; how many."""
    kept = objects = 0
    for i in range(count):
        tile = near[i]
        if len(accept) and refuses(tile, categories, owner, accept, exclude, who):
            continue
        near[kept] = tile
        kept += 1
        if len(occluder) == 0 or not occluder[tile]:
            objects = kept
    return objects


@compiled(
    types.UniTuple(types.int64, 3)(
            types.int64, types.int64, types.int64, ROWS_OUT,
            *[INTS] * 5, BOXES, INTS, INTS, WORDS, BOXES, INTS, BOXES, INTS, WORDS, FLAGS, INTS,
            INTS, INTS, OWNERS, types.boolean, types.UniTuple(types.int64, 4)
    )
)  # fmt: skip
def _front_to_back(
    who, end, count, out, pattern, x, y, origin_x, origin_y, pattern_box, first, following, windows, strips,
    rank, box, tile_begin, tiles, occluder, categories, owner, accept, exclude, pierce, bounds,
):  # fmt: skip
    room, most, words = out.shape[1], 0, 0
    for kind in range(len(first)):
        words = max(words, ((62 + pattern_box[kind, 2] - pattern_box[kind, 0] + 1) // 64 + 2) * following[kind])
    begin = listed = cells = np.zeros(0, np.int64)
    if end - who > FEW and len(box):
        begin, listed, cells = _binned(box)
    near, rest, last_kind = np.empty(len(box), np.int64), np.empty(words, np.uint64), -1
    whose, hit, hit_samples, key, nearest_x, nearest_y = out[0], out[1], out[2], out[3], out[4], out[5]
    while who < end:
        kind = pattern[who]
        left, top = x[who] + pattern_box[kind, 0], y[who] + pattern_box[kind, 1]
        right, bottom = x[who] + pattern_box[kind, 2], y[who] + pattern_box[kind, 3]
        if is_far(origin_x[who], origin_y[who], left, top, right, bottom):
            return -1, 0, 0
        close = near_of(box, begin, listed, cells, left, top, right, bottom, near)
        if len(strips):
            close = _crossing(strips, kind, x[who], y[who], box, near, close)
        close = _accepted(near, close, occluder, categories, owner, accept, exclude, who)
        if close == 0:
            who += 1
            continue
        if count + close > room:
            break
        if kind != last_kind:
            rest[:], last_kind = 0, kind
        step, rows = following[kind], bottom - top + 1
        columns = (62 + right - left + 1) // 64 + 2
        pixels = laid(windows, first[kind], columns, step, rows, rest)
        if left < bounds[0] or top < bounds[1] or right > bounds[2] or bottom > bounds[3]:
            pixels = cut_off(rest, columns, step, left, top, rows, bounds[0], bounds[1], bounds[2], bounds[3])
        item, row = -1, count - 1
        for i in range(close):
            if pixels == 0:
                break
            at = near[i]
            low, high = max(box[at, 1], top), min(box[at, 3], bottom)
            offset = box[at, 0] - left + 63
            tile, word, shift = tile_begin[at] - box[at, 1], PAD + (offset >> 6) * step - top, offset & 63
            if len(occluder) and occluder[at]:
                pixels -= take(tiles, tile, rest, word, step, shift, low, high)
                continue
            own, level = origin_x[who] - box[at, 0], origin_y[who]
            if pierce:
                samples, distance2, across, down = shared(tiles, tile, rest, word, step, shift, low, high, own, level)
            else:
                samples, distance2, across, down = struck(tiles, tile, rest, word, step, shift, low, high, own, level)
                pixels -= samples
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
        most = max(most, row + 1 - count)
        count = row + 1
        who += 1
    return who, count, most


NONE = np.zeros(0, np.int64)
NOBODY = np.zeros((1, 0), np.int64)


def front_to_back(
    placed: Placed,
    windows: Windows,
    pile: Pile,
    accept: Ints | int | None,
    exclude: Ints | None,
    pierce: bool,
    bounds: Box | None,
) -> Found:
    """See `fronttoback.front_to_back`."""
    accepted = NONE if accept is None else np.array([accept]) if isinstance(accept, int) else accept
    found = None
    if not windows.shifted:
        each = PLACEMENT_NS + TILE_NS * len(pile.rank)
        found = rows_by(
            _front_to_back, 6, len(placed.x), PART_NS / each,
            *placed, windows.box_xyxy, windows.first, windows.rows, windows.words, windows.strips, *pile,
            accepted, NOBODY if exclude is None else exclude, pierce, EVERYWHERE if bounds is None else bounds,
        )  # fmt: skip
    if found is None:
        return fronttoback.front_to_back(placed, windows, pile, accept, exclude, pierce, bounds)
    return Found(*found)
