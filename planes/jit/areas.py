"""Compiled kernels of areas: placed patterns against tiles, front to back or visible ones; and the label plane."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from ..bits import front_to_back as front_to_back_module
from ..bits.bit_rows import WORD, PatternBits, Placed
from ..bits.cells import Cells
from ..bits.front_to_back import OrderedTiles, RoundHits, Rule, some_rounds
from ..bits.label_plane import CELL_BITS as COARSE_BITS
from ..bits.label_plane import Front
from ..common.checks import Bools, Ints, Labels
from ..common.costs import COMPILED
from ..common.limits import HALF
from ..grid.spans import Box, sorted_once
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
    is_beyond,
    is_far,
    key_of,
    lowest,
    pixel_of,
    pixels_of,
    row_key,
    rows_by,
    shared,
)
from .cache import compiled, helper

FEW = 4  # most placements that compare all tiles; for more, tiles are listed in cells of the world first
CELL_BITS = 6  # least side of those cells, 2**CELL_BITS = 64 px; no tile is wider
PAD = WORD  # empty rows before and after each column of words of a pattern, see `bits.bit_rows.PatternBits`

SUMS = types.Array(types.uint32, 1, "C", readonly=True)
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


@helper()
def near_of(box, begin, listed, cells, left, top, right, bottom, near):
    """Write the tiles whose boxes meet a box to `near`, front to back; return how many."""
    count = 0
    if not len(cells):
        for tile in range(len(box)):
            across = (box[tile, 0] <= right) & (box[tile, 2] >= left)
            near[count] = tile  # the next overwrites it if it is not near
            count += across & (box[tile, 1] <= bottom) & (box[tile, 3] >= top)
        return count
    x, y, bits, wide, high = cells[0], cells[1], cells[2], cells[3], cells[4]
    first, last = max((left - WORD + 1 - x) >> bits, 0), min((right - x) >> bits, wide - 1)
    if first > last:
        return 0
    for row in range(max((top - WORD + 1 - y) >> bits, 0), min((bottom - y) >> bits, high - 1) + 1):
        for entry in range(begin[row * wide + first], begin[row * wide + last + 1]):
            tile = listed[entry]
            across = (box[tile, 0] <= right) & (box[tile, 2] >= left)
            near[count] = tile
            count += across & (box[tile, 1] <= bottom) & (box[tile, 3] >= top)
    _sort(near, count)
    return count


@helper()
def _crossing(strips, pattern, x, y, box, near, count):
    """Keep the tiles that meet the strip of a pattern; return how many."""
    kept = 0
    for i in range(count):
        tile = near[i]
        near[kept] = tile
        kept += not is_beyond(strips, pattern, x, y, box[tile, 0], box[tile, 1], box[tile, 2], box[tile, 3])
    return kept


@helper()
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


@helper()
def struck(tiles, tile, rest, word, step, shift, low, high, own, level):
    """Do what `shared` does, and clear the pixels in the rest of the pattern, in the same pass."""
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


@helper(inline="always")
def refuses(tile, categories, owner, meets, exclude, shot):
    """Whether a shot refuses the item of a tile; `meets` and `exclude` have one row for all shots, or one for each."""
    if categories[tile] & meets[shot if len(meets) > 1 else 0] == 0:
        return True
    for k in range(exclude.shape[1]):  # noqa: SIM110 - a generator costs a call of its own
        if owner[tile] == exclude[shot if len(exclude) > 1 else 0, k]:
            return True
    return False


@helper()
def _accepted(near, count, occluder, categories, owner, meets, exclude, shot):
    """Keep the tiles that a shot accepts, up to the last object's; return how many."""
    kept = objects = 0
    for i in range(count):
        tile = near[i]
        if len(meets) and refuses(tile, categories, owner, meets, exclude, shot):
            continue
        near[kept] = tile
        kept += 1
        if len(occluder) == 0 or not occluder[tile]:
            objects = kept
    return objects


TURN, RANK, SAMPLES, WEIGHT, PIXELS, PELLETS, KEY, X, Y = range(9)
"""Columns of rows; KEY becomes a squared distance. While a round is counted, Y holds the last pellet of a row."""

TOGETHER = WORD + 8  # words of the pixels of a tile that pellets of a round have hit


@helper(allocates=True)
def _room_for(pattern_box, following):
    """Scratch memory for the words of any of the patterns."""
    longest = 0
    for kind in range(len(pattern_box)):
        columns = (62 + pattern_box[kind, 2] - pattern_box[kind, 0] + 1) // 64 + 2
        longest = max(longest, columns * following[kind])
    return np.empty(PAD + longest, np.uint64)


@helper()
def lay(windows, first, step, hull, rest):
    """Copy the words of a pattern that tiles may read to `rest`; return their pixels.

    Parameters
    ----------
    hull : first and last column of words, and first and last row
    """
    pixels = 0
    for column in range(hull[0], hull[1] + 1):
        source, target = np.uint64(first + column * step + hull[2]), np.uint64(PAD + column * step + hull[2])
        rows = hull[3] - hull[2] + 1
        for i in range(rows + 8):  # tiles are read eight rows at a time
            row = np.uint64(i)
            rest[target + row] = windows[source + row]
            pixels += bits_of(windows[source + row])
    return pixels


@helper()
def clip(rest, step, hull, left, top, bounds):
    """Clear the words of a pattern in `rest` beyond the bounds; return the pixels that are left."""
    pixels = 0
    for column in range(hull[0], hull[1] + 1):
        begin = left - 63 + 64 * column  # of the world
        low, high = max(bounds[0] - begin, 0), min(bounds[2] - begin, 63)
        kept = np.uint64(0)
        if low <= 63 and high >= low:
            kept = (ALL << np.uint64(low)) & (ALL >> np.uint64(63 - high))
        for row in range(hull[2], hull[3] + 9):
            word = column * step + PAD + row
            rest[word] = rest[word] & kept if bounds[1] <= top + row <= bounds[3] else np.uint64(0)
            pixels += bits_of(rest[word])
    return pixels


@helper(inline="always")
def hull_of(box, near, count, left, top, bottom):
    """Words of a pattern that tiles may read: first and last column, first and last row."""
    first, last, low, high = 2**62, 0, bottom, top
    for i in range(count):
        at = near[i]
        column = (box[at, 0] - left + 63) >> 6
        first, last = min(first, column), max(last, column + 1)
        low, high = min(low, max(box[at, 1], top)), max(high, min(box[at, 3], bottom))
    return first, last, low - top, high - top


@helper()
def weighed(tiles, tile, windows, word, step, shift, low, high, sums, begin, wide):
    """Sum of the weights of the pixels that a tile shares with a window, run by run.

    `sums` are along rows; `begin` is the place of the tile's first column in row `low`, `wide` the numbers of a row.
    """
    tile, word, following = np.uint64(tile + low), np.uint64(word + low), np.uint64(word + step + low)
    right, left, total = np.uint64(shift), np.uint64(63 - shift), np.int64(0)
    for i in range(high - low + 1):
        row = np.uint64(i)
        met = tiles[tile + row] & ((windows[word + row] >> right) | (windows[following + row] << left << ONE))
        at = begin + i * wide
        while met:
            skipped = lowest(met)
            met >>= np.uint64(skipped)
            length = lowest(~met)  # 64 if all are set
            total += np.int64(sums[at + skipped + length] - sums[at + skipped]) & 0xFFFFFFFF
            at += skipped + length
            met = (met >> np.uint64(length - 1)) >> ONE
    return total


@helper()
def anew(together, tiles, tile, windows, word, step, shift, low, high):
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
@helper(inline="always")
def in_row_order(first, last, origin_x, origin_y, out):
    """Sort rows `first` .. `last` - 1 of a round by (key, rank), and replace the keys by squared distance and y.

    More than FEW_ROWS rows are left unsorted for `rows_by`.
    """
    rank, key = out[RANK], out[KEY]
    for i in range(first + 1, last if last - first <= FEW_ROWS else 0):
        j = i
        while j > first and (key[j - 1] > key[j] or (key[j - 1] == key[j] and rank[j - 1] > rank[j])):
            for column in range(RANK, X + 1):
                out[column, j - 1], out[column, j] = out[column, j], out[column, j - 1]
            j -= 1
    pixels_of(first, last, origin_x, origin_y, key, out[X], out[Y])


@helper(forceinline=True)
def _close_to(placement, kind, x, y, window, tiles, cells, bins, strips, meets, exclude, near):
    """Write the tiles that a placed pattern may hit to `near`, front to back; return how many.

    `window` is the box of the pattern in the world; `bins` are of `_binned`, empty if all tiles are compared.
    """
    left, top, right, bottom = window
    box, close = tiles.box_xyxy, 0
    if cells.wide:
        cell = cell_at(x, y, cells.x, cells.y, cells.bits, cells.wide, cells.high)
        for entry in range(cells.begin[max(cell, 0)], cells.begin[cell + 1] if cell >= 0 else cells.begin[0]):
            tile = cells.listed[entry]
            across = (box[tile, 0] <= right) & (box[tile, 2] >= left)
            near[close] = tile
            close += across & (box[tile, 1] <= bottom) & (box[tile, 3] >= top)
    else:
        close = near_of(box, bins[0], bins[1], bins[2], left, top, right, bottom, near)
    if len(strips):
        close = _crossing(strips, kind, x, y, box, near, close)
    if len(meets) or len(tiles.occluder):
        close = _accepted(near, close, tiles.occluder, tiles.categories, tiles.owner, meets, exclude, placement)
    return close


@helper(forceinline=True)
def _laid(patterns, kind, window, box, near, close, bounds, rest):
    """Copy the words of a placed pattern that tiles may read to `rest`, within the bounds; return their pixels."""
    left, top, right, bottom = window
    hull = hull_of(box, near, close, left, top, bottom)
    pixels = lay(patterns.words, patterns.first[kind], patterns.rows[kind], hull, rest)
    if left < bounds[0] or top < bounds[1] or right > bounds[2] or bottom > bounds[3]:
        pixels = clip(rest, patterns.rows[kind], hull, left, top, bounds)
    return pixels


@helper(forceinline=True)
def _counted(out, mine, row, row_of, turn, item, placement, samples, weight, new, nearest, x):
    """Add what a placement hits of an item to its row, or begin one if `mine` is negative; return the last row."""
    if mine < 0:
        row += 1
        out[TURN, row], out[RANK, row], out[SAMPLES, row], out[KEY, row], out[X, row] = turn, item, samples, nearest, x
        out[WEIGHT, row], out[PIXELS, row], out[PELLETS, row], out[Y, row] = weight, new, 1, placement
        if len(row_of):
            row_of[item] = row
        return row
    out[SAMPLES, mine] += samples
    out[WEIGHT, mine] += weight
    out[PIXELS, mine] += new
    out[PELLETS, mine] += out[Y, mine] != placement
    out[Y, mine] = placement
    if nearest < out[KEY, mine]:
        out[KEY, mine], out[X, mine] = nearest, x
    return row


@helper(forceinline=True)
def _new(at, part_of, hit, hits, together, tiles, tile, words, word, step, shift, low, high):
    """Pixels of a tile that no pellet of the round hit before, and how many tiles its pellets have hit."""
    if part_of[at] < 0:
        part_of[at], hit[hits] = hits * TOGETHER, at
        together[hits * TOGETHER : (hits + 1) * TOGETHER] = 0
        hits += 1
    part = together[part_of[at] + low - tiles.box_xyxy[at, 1] :]
    return anew(part, tiles.words, tile, words, word, step, shift, low, high), hits


# house: hit rule of areas
@helper(forceinline=True)
def _hit(
    turn, placement, kind, window, origin, words, corner, pixels, patterns, tiles, pierce, several, close, near,
    pellets, hits, first_row, row, out,
):  # fmt: skip
    """Write the rows of a placement; return the last row, and how many tiles the pellets of its round have hit.

    The pattern lies in `words`, from `corner` on, and has so many pixels that are not used up.
    """
    (left, top, right, _), step, sums, occluder = window, patterns.rows[kind], patterns.sums, tiles.occluder
    row_of, part_of, hit, together = pellets
    for i in range(close):
        if pixels == 0:
            break
        at, box = near[i], tiles.box_xyxy
        low, high, offset = max(box[at, 1], top), min(box[at, 3], window[3]), box[at, 0] - left + 63
        tile, word, shift = tiles.begin[at] - box[at, 1], corner + (offset >> 6) * step - top, offset & 63
        own, level = origin[0] - box[at, 0], origin[1]
        blocks = len(occluder) > 0 and occluder[at]
        if blocks or not (pierce or several or len(sums)):
            found = struck(tiles.words, tile, words, word, step, shift, low, high, own, level)
        else:
            found = shared(tiles.words, tile, words, word, step, shift, low, high, own, level)
        samples, weight, new, nearest = found[0], 0, found[0], key_of(found[1], found[2], found[3])
        if blocks or samples == 0:
            pixels -= samples
            continue
        if len(sums):
            place = patterns.first_sum[kind] + (low - top) * (right - left + 2) + offset - 63
            weight = weighed(tiles.words, tile, words, word, step, shift, low, high, sums, place, right - left + 2)
        item = tiles.rank[at]
        mine = row if row >= first_row and out[RANK, row] == item else -1
        if several:
            mine = row_of[item]
            new, hits = _new(at, part_of, hit, hits, together, tiles, tile, words, word, step, shift, low, high)
        if not pierce:
            if several or len(sums):
                struck(tiles.words, tile, words, word, step, shift, low, high, own, level)
            pixels -= samples
        row = _counted(out, mine, row, row_of, turn, item, placement, samples, weight, new, nearest, found[2])
    return row, hits


DONE, FULL, UNDECIDED = range(3)
"""How a round ended: its rows are written, there was no room for them, or a pixel lies too far from its origin."""


@helper(forceinline=True)
def _round(
    turn, each, row, placed, patterns, tiles, cells, bins, pierce, bounds, meets, exclude, whole, near, words, pellets,
    out,
):  # fmt: skip
    """Write the rows of a round after row `row`; return the last row, the tiles that pellets have hit, and its end."""
    first_row, hits, box = row + 1, 0, patterns.box_xyxy
    origin, several = (placed.origin_x[turn], placed.origin_y[turn]), len(pellets[1]) > 0
    for placement in range(turn * each, turn * each + each):
        kind, x, y = placed.pattern[placement], placed.x[placement], placed.y[placement]
        window = x + box[kind, 0], y + box[kind, 1], x + box[kind, 2], y + box[kind, 3]
        if is_far(origin[0], origin[1], window[0], window[1], window[2], window[3]):
            return row, hits, UNDECIDED
        close = _close_to(placement, kind, x, y, window, tiles, cells, bins, patterns.strips, meets, exclude, near)
        if row + 1 + close > out.shape[1]:
            return row, hits, FULL
        if close == 0:
            continue
        corner, pixels = patterns.first[kind], 1
        if not whole:
            corner, pixels = PAD, _laid(patterns, kind, window, tiles.box_xyxy, near, close, bounds, words)
        row, hits = _hit(
            turn, placement, kind, window, origin, words, corner, pixels, patterns, tiles, pierce, several, close, near,
            pellets, hits, first_row, row, out,
        )  # fmt: skip
    return row, hits, DONE


PLACED, CELLS = types.UniTuple(INTS, 5), types.Tuple((*[types.int64] * 5, INTS, INTS))
PATTERNS = types.Tuple((BOXES, INTS, INTS, types.uint64[::1], BOXES, SUMS, INTS))
TILES = types.Tuple((INTS, BOXES, INTS, WORDS, FLAGS, INTS, INTS))
RULE = types.boolean, types.UniTuple(types.int64, 4), INTS, OWNERS
"""Types of the columns of `Placed`, `Cells`, `PatternBits` and `OrderedTiles`, and of what `Rule` says."""


@compiled(types.UniTuple(types.int64, 3)(
    types.int64, types.int64, types.int64, ROWS_OUT, PLACED, PATTERNS, TILES, CELLS, *RULE, types.int64
))  # fmt: skip
def match(turn, end, count, out, placed, patterns, tiles, cells, pierce, bounds, meets, exclude, each):
    """Write the rows of rounds `turn` .. `end` - 1 to columns `out`, from row `count` on.

    `placed`, `patterns`, `tiles` and `cells` are the columns of `Placed`, `PatternBits`, `OrderedTiles` and `Cells`, as
    plain tuples. Returned are the round where it stopped for want of room, or -1 if it cannot decide one; the rows
    written; and the most rows of a round.
    """
    placed, patterns, tiles, cells = Placed(*placed), PatternBits(*patterns), OrderedTiles(*tiles), Cells(*cells)
    rank, box, most = tiles.rank, tiles.box_xyxy, 0
    near, boxes = np.empty(len(box), np.int64), len(box) if each > 1 else 0
    row_of, part_of = np.full(rank[-1] + 1 if boxes else 0, -1), np.full(boxes, -1)  # of what pellets have hit
    pellets = row_of, part_of, np.empty(boxes, np.int64), np.empty(boxes * TOGETHER, np.uint64)
    bins = cells.begin[:0], cells.listed[:0], cells.begin[:0]
    if not cells.wide and (end - turn) * each > FEW and len(box):
        bins = _binned(box)
    whole = pierce and not len(tiles.occluder) and bounds[0] == EVERYWHERE[0]  # nothing is taken away from patterns
    words = patterns.words if whole else _room_for(patterns.box_xyxy, patterns.rows)
    while turn < end:
        row, hits, state = _round(
            turn, each, count - 1, placed, patterns, tiles, cells, bins, pierce, bounds, meets, exclude, whole, near,
            words, pellets, out,
        )  # fmt: skip
        if state == UNDECIDED:
            return -1, 0, 0
        for k in range(hits):
            at = pellets[2][k]
            row_of[rank[at]] = part_of[at] = -1
        if state == FULL:
            break
        if row >= count:
            in_row_order(count, row + 1, placed.origin_x[turn], placed.origin_y[turn], out)
        most, count, turn = max(most, row + 1 - count), row + 1, turn + 1
    return turn, count, most


NONE = np.zeros(0, np.int64)
NOBODY = np.zeros((1, 0), np.int64)
NOWHERE = Cells(0, 0, 0, 0, 0, NONE, NONE)


def _placement_ns(tiles: int, cells: Cells) -> float:
    """Time of a placement that meets one of some tiles, or those that a cell lists, ns."""
    if cells.wide:
        return COMPILED.visible_placement + COMPILED.visible_near * len(cells.listed) / (len(cells.begin) - 1)
    return COMPILED.tiles_placement + COMPILED.tiles_near + COMPILED.tiles_pair * tiles


def front_to_back(
    placed: Placed,
    each: int,
    windows: PatternBits,
    tiles: OrderedTiles,
    rule: Rule,
    near: Cells | tuple[Ints, Ints] | None = None,
) -> RoundHits:
    """See `bits.front_to_back.front_to_back`."""
    meets, cells = rule.meets, near if isinstance(near, Cells) else NOWHERE
    accepted = NONE if meets is None else np.array([meets]) if isinstance(meets, int) else meets
    found = None
    if near is None or isinstance(near, Cells):
        least = COMPILED.thread / (each * _placement_ns(len(tiles.rank), cells))
        found = rows_by(
            match, Y + 1, len(placed.origin_x), least, tuple(placed), tuple(windows), tuple(tiles), tuple(cells),
            rule.pierce, EVERYWHERE if rule.bounds is None else rule.bounds,
            accepted, NOBODY if rule.exclude is None else rule.exclude, each,
        )  # fmt: skip
    if found is None:
        return front_to_back_module.front_to_back(placed, each, windows, tiles, rule, near)
    if rule.blockers is not None and found.shape[1]:
        turn = sorted_once(found[TURN])  # no round hits in sight that hits nothing otherwise
        placed, rule = some_rounds(placed, each, rule, turn)
        hits: RoundHits = front_to_back_module.front_to_back(placed, each, windows, tiles, rule, near)
        return hits._replace(turn=turn[hits.turn])
    several = (found[PIXELS], found[PELLETS]) if each > 1 else (None, None)
    weight = found[WEIGHT] if len(windows.sums) else None
    return RoundHits(found[TURN], found[RANK], found[SAMPLES], found[KEY], found[X], found[Y], weight, *several)


@compiled()
def paint(labels: Labels, x: int, y: int, dirty: Ints, places: Ints, masks: Bools) -> None:
    """Redraw boxes of a label plane, back to front; see `bits.label_plane.paint`."""
    for d in range(len(dirty)):
        left, top, right, low = dirty[d, 0], dirty[d, 1], dirty[d, 2], dirty[d, 3]
        labels[top - y : low - y + 1, left - x : right - x + 1] = 0
        for rank in range(len(places) - 1, -1, -1):
            place = places[rank]
            if place[0] <= right and place[2] >= left and place[1] <= low and place[3] >= top:
                paint_item(labels, x, y, left, top, right, low, place, masks)


@helper()
def paint_item(
    labels: Labels, x: int, y: int, left: int, top: int, right: int, low: int, place: Any, masks: Bools
) -> None:
    """Draw the part of an item that lies in a box over what is drawn there."""
    zero, one = labels.dtype.type(0), labels.dtype.type(1)
    code = labels.dtype.type(place[5])
    width = place[2] - place[0] + 1
    x0, x1, y0, y1 = max(left, place[0]), min(right, place[2]), max(top, place[1]), min(low, place[3])
    begin = place[4] + (y0 - place[1]) * width + x0 - place[0]
    n = x1 - x0 + 1
    for row in range(y0 - y, y1 - y + 1):
        part, mask = labels[row, x0 - x : x1 - x + 1], masks[begin : begin + n]
        for i in range(n):
            old = part[i]
            new = code + one if old != zero else code
            part[i] = new if mask[i] else old
        begin += width


COARSE = types.Array(types.boolean, 2, "C", readonly=True)
BITS = np.uint64(COARSE_BITS)


# house: hit rule of areas
@compiled(
    *(
        types.int64(
            types.Array(kind, 2, "C", readonly=True), COARSE, *[types.int64] * 2, BOXES, FLAGS, OUT, OUT, ROWS_OUT
        )
        for kind in (types.uint16, types.uint32)
    )
)  # fmt: skip
def _front_at(labels, cells, left, top, at_256, objects, place, label, xy):
    count = 0
    high, wide, coarse = np.uint64(labels.shape[0]), np.uint64(labels.shape[1]), cells.size > 0
    for i in range(len(at_256)):
        x, y = (at_256[i, 0] + HALF) >> 8, (at_256[i, 1] + HALF) >> 8
        column, row = np.uint64(x - left), np.uint64(y - top)  # negative numbers become very large
        if (column >= wide) | (row >= high):
            continue
        if coarse and not cells[row >> BITS, column >> BITS]:
            continue
        front = np.int64(labels[row, column] >> 1)  # always written; the next one overwrites it if it is no hit
        place[count], label[count], xy[count, 0], xy[count, 1] = i, front, x, y
        count += objects[front]
    return count


NO_CELLS: Bools = np.zeros((0, 0), np.bool_)


def front_at(labels: Labels, cells: Bools | None, plane_xyxy: Box, at_256: Ints, objects: Bools) -> Front:
    """See `bits.label_plane.front_at`."""
    place, label = np.empty((2, len(at_256)), np.int64)
    xy, coarse = np.empty(at_256.shape, np.int64), NO_CELLS if cells is None else cells
    count = _front_at(labels, coarse, plane_xyxy[0], plane_xyxy[1], at_256, objects, place, label, xy)
    return Front(place[:count], label[:count], xy[:count])
