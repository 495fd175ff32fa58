"""Compiled kernels of placed patterns: against ordered tiles, front to back, or against visible tiles, by cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from ..bits import front_to_back as front_to_back_module
from ..bits.bit_rows import WORD, Beside, PatternBits, Placed, TileHits, VisibleTiles
from ..bits.cells import Cells
from ..bits.front_to_back import OrderedTiles, RoundHits
from ..common.checks import Ints
from ..grid.spans import Box
from .bit_rows import (
    ALL,
    BOXES,
    EVERYWHERE,
    FAR,
    FEW_ROWS,
    FLAGS,
    INTS,
    ONE,
    OUT,
    ROWS_OUT,
    WORDS,
    bits_of,
    cell_at,
    columns_about,
    in_order,
    is_beyond,
    is_far,
    key_of,
    pixel_of,
    pixels_of,
    row_key,
    rows_by,
    shared,
)
from .cache import compiled

PART_NS, PLACEMENT_NS, TILE_NS = 8e5, 150.0, 0.7
"""Least work of a thread, ns; time of each placement, and of each pair of a placement and a tile, ns."""

FEW = 4
"""Most placements that compare all tiles; for more, tiles are listed in cells of the world first."""

CELL_BITS = 6
"""Least side of those cells, 2**CELL_BITS = 64 px; no tile is wider."""

PAD = WORD
"""Empty rows before and after the rows of a pattern, as `kinds.weapon.columns_of` lays them out."""

OWNERS = types.Array(types.int64, 2, "A", readonly=True)


@compiled(types.Tuple((OUT, OUT, OUT))(BOXES))
def _binned(box):
    """List tiles by the cell of their first corner: begin of each list, the lists, and (x, y, bits, wide, high)."""
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
    """Write the tiles whose boxes meet a box to `near`, front to back; return how many."""
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
    """Keep the tiles that meet the strip of a pattern; return how many."""
    kept = 0
    for i in range(count):
        tile = near[i]
        near[kept] = tile
        kept += not is_beyond(strips, pattern, x, y, box[tile, 0], box[tile, 1], box[tile, 2], box[tile, 3])
    return kept


@njit
def _sort(numbers, count):
    """Sort the first `count` numbers: Shell (1959)."""
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
    """Copy the rows of a pattern to `rest`, between its empty rows; return the number of pixels."""
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
    """Clear the pixels of a pattern beyond the bounds; return the number of pixels that are left."""
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
    """Clear the pixels of a tile in the rest of a pattern, in rows `low` to `high`; return how many were cleared."""
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
    """Count the pixels that a tile shares with the rest of a pattern, and clear them: `shared`, `take` in one pass."""
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
    """Whether a shot refuses the item of a tile; `accept` and `exclude` have one row for all shots, or one for each."""
    if categories[tile] & accept[who if len(accept) > 1 else 0] == 0:
        return True
    for k in range(exclude.shape[1]):  # noqa: SIM110 - a generator costs a call of its own
        if owner[tile] == exclude[who if len(exclude) > 1 else 0, k]:
            return True
    return False


@njit
def _accepted(near, count, occluder, categories, owner, accept, exclude, who):
    """Keep the tiles that a shot accepts, up to the last object's; return how many."""
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


# house: hit rule of areas
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
    windows: PatternBits,
    ordered: OrderedTiles,
    accept: Ints | int | None,
    exclude: Ints | None,
    pierce: bool,
    bounds: Box | None,
) -> TileHits:
    """See `bits.front_to_back.front_to_back`."""
    accepted = NONE if accept is None else np.array([accept]) if isinstance(accept, int) else accept
    found = None
    if not windows.shifted:
        each = PLACEMENT_NS + TILE_NS * len(ordered.rank)
        found = rows_by(
            _front_to_back, 6, len(placed.x), PART_NS / each,
            *placed, windows.box_xyxy, windows.first, windows.rows, windows.words, windows.strips, *ordered,
            accepted, NOBODY if exclude is None else exclude, pierce, EVERYWHERE if bounds is None else bounds,
        )  # fmt: skip
    if found is None:
        return front_to_back_module.front_to_back(placed, windows, ordered, accept, exclude, pierce, bounds)
    return TileHits(*found)


LOOKUP_PART_NS, LOOKUP_PLACEMENT_NS, LISTED_NS = 8e5, 10.0, 40.0
"""Least work of a thread, ns; time of each placement, and of each tile in the list of its cell, ns."""

GIVEN = (
    types.int64, types.int64, types.int64, ROWS_OUT,
    *[INTS] * 5, BOXES, INTS, INTS, WORDS, BOXES, INTS, BOXES, INTS, WORDS,
    *[types.int64] * 5, INTS, INTS,
)  # fmt: skip
"""Types of the first arguments of both kernels: those of `rows_by`, then those of `_given`."""


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
    """Add the pixels that a tile shares with a window to `together`, row by row; return the number of new ones."""
    tile, word, following = np.uint64(tile + low), np.uint64(word + low), np.uint64(word + step + low)
    right, left, new = np.uint64(shift), np.uint64(63 - shift), np.int64(0)
    for i in range((high - low + 8) & -8):
        row = np.uint64(i)
        met = tiles[tile + row] & ((windows[word + row] >> right) | (windows[following + row] << left << ONE))
        new += bits_of(met & ~together[row])
        together[row] |= met
    return new


# house: row order
@njit(inline="always")
def _in_order(first, last, item, samples, pixels, pellets, key, x):
    """Sort rows like `bit_rows.in_order`; of equally near pixels the front item's comes first."""
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
    pellets, key, nearest_x, nearest_y = out[4], out[5], out[6], out[7]  # `nearest_y` first holds the row's last pellet
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


def looked_up(placed: Placed, windows: PatternBits, seen: VisibleTiles, cells: Cells, beside: Beside) -> TileHits:
    """See `bits.front_to_back.looked_up`; `beside` is not needed."""
    found = None
    if not windows.shifted:
        least = LOOKUP_PART_NS / (LOOKUP_PLACEMENT_NS + LISTED_NS * _listed(cells))
        found = rows_by(_looked_up, 6, len(placed.x), least, *_given(placed, windows, seen, cells))
    return front_to_back_module.looked_up(placed, windows, seen, cells, beside) if found is None else TileHits(*found)


def gathered_up(placed: Placed, windows: PatternBits, seen: VisibleTiles, cells: Cells, each: int) -> RoundHits:
    """See `bits.front_to_back.gathered_up`."""
    found = None
    if not windows.shifted:
        least = LOOKUP_PART_NS / (each * (LOOKUP_PLACEMENT_NS + LISTED_NS * _listed(cells)))
        given = *_given(placed, windows, seen, cells), each, seen.height
        found = rows_by(_gathered_up, 8, len(placed.origin_x), least, *given)
    return front_to_back_module.gathered_up(placed, windows, seen, cells, each) if found is None else RoundHits(*found)


def _listed(cells: Cells) -> float:
    """Mean number of tiles that a cell lists."""
    return len(cells.listed) / max(len(cells.begin) - 1, 1)


def _given(placed: Placed, windows: PatternBits, seen: VisibleTiles, cells: Cells) -> tuple[Any, ...]:
    """Arguments that both kernels have in common."""
    pattern = windows.box_xyxy, windows.first, windows.rows, windows.words, windows.strips
    return *placed, *pattern, seen.rank, seen.box_xyxy, seen.begin, seen.words, *cells
