"""Slow exact reference for traced weapons: one ray, one cell and one item at a time.

Frame: x right, y down; pixel (x, y) is the closed square of side 256 around (256 x, 256 y). Positions, radii and
budgets are integers in 1/256 px. A time is a whole number over the ray's own `scale`, 0 at the muzzle and `scale` at
the far end. Whole numbers and fractions only; floats are made of them at the very end. Nothing is indexed or cut short.
"""

import itertools
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

__all__ = [
    "Item", "Pass", "Path", "StartsInside", "Stop", "Walk", "entered_side", "mask_normal", "path_of", "thick_cells",
    "thin_cells", "thin_times", "walk",
]  # fmt: skip

Pixel = tuple[int, int]
Point = Sequence[int]
Bounds = tuple[int, int, int, int]
Times = Mapping[Pixel, tuple[int, int]]
Time = int | Fraction

PX = 256  # units in a pixel
HALF = 128  # from a pixel's centre to its edge
ROOT_BITS = 200  # roots that are not whole are cut off after so many binary places


class StartsInside(Exception):  # noqa: N818 (it is an answer)
    """The ray starts in items of which it must not: their ids."""


@dataclass(frozen=True)
class Item:
    """An accepted object or occluder: who it is, the world pixels of its mask, and what a px of it costs."""

    id: int
    occluder: bool
    pixels: Collection[Pixel]
    cost: int = 1


@dataclass(frozen=True)
class Path:
    """A ray's cells with entry and exit over `scale`."""

    cells: Times
    scale: int
    length2: int  # of the ray, 1/256 px squared

    def px(self, time: Time) -> float:
        """Length of the ray before a time, px."""
        return float(root(Fraction(time) ** 2 * self.length2 / (PX * self.scale) ** 2))


@dataclass(frozen=True)
class Pass:
    """One ray through one object; `cells` are those where it was met, in the order of the walk."""

    object: int
    order: int
    cells: list[Pixel]
    entry: Time
    exit: Time
    exit_xy: Pixel
    material: float
    normal: Pixel | None


@dataclass(frozen=True)
class Stop:
    """Where a ray ended: at an item, in the object that took the last of its budget, or without one in no cell."""

    reason: str
    time: Time
    item: int | None = None
    cell_xy: Pixel | None = None
    normal: Pixel | None = (0, 0)


@dataclass(frozen=True)
class Walk:
    """All of one ray: every cell in order, how many of them were walked, what was hit, and the end."""

    path: Path
    order: list[Pixel]
    walked: int
    passes: list[Pass]
    stop: Stop


def root(value: Fraction) -> Fraction:
    """Square root, cut off after `ROOT_BITS` binary places: exact where it is a whole number."""
    return Fraction(math.isqrt((value.numerator << 2 * ROOT_BITS) // value.denominator), 1 << ROOT_BITS)


# Cells


def around(a: Point, b: Point, margin: int) -> list[Pixel]:
    """All pixels whose closed squares come within a margin, in x and in y, of the box around two points."""
    (x0, x1), (y0, y1) = ((min(p), max(p)) for p in zip(a, b, strict=True))
    columns = range(-((HALF - x0 + margin) // PX), (x1 + margin + HALF) // PX + 1)
    rows = range(-((HALF - y0 + margin) // PX), (y1 + margin + HALF) // PX + 1)
    return [(x, y) for y in rows for x in columns]


def thin_cells(a: Point, b: Point) -> dict[Pixel, tuple[Fraction, Fraction]]:
    """Pixels whose closed square meets the closed segment, with the least and the greatest time in the square."""
    found = {}
    for cell in around(a, b, 0):
        entry, leave, meets = Fraction(0), Fraction(int(a[0] != b[0] or a[1] != b[1])), True
        for start, end, centre in zip(a, b, cell, strict=True):
            low, high, step = PX * centre - HALF - start, PX * centre + HALF - start, end - start
            if step == 0:
                meets = meets and low <= 0 <= high
                continue
            near, far = sorted((Fraction(low, step), Fraction(high, step)))
            entry, leave = max(entry, near), min(leave, far)
        if meets and entry <= leave:
            found[cell] = entry, leave
    return found


def thin_times(a: Point, b: Point) -> tuple[dict[Pixel, tuple[int, int]], int]:
    """The same in whole numbers over a scale: max(1, |dx|) * max(1, |dy|)."""
    sizes = [max(1, abs(q - p)) for p, q in zip(a, b, strict=True)]
    scale = sizes[0] * sizes[1]
    last = scale if a[0] != b[0] or a[1] != b[1] else 0
    slabs: list[list[tuple[int, int, int]]] = []  # for each column, then for each row: number, entry, exit
    for start, end, other in ((a[0], b[0], sizes[1]), (a[1], b[1], sizes[0])):
        step, half = ((end > start) - (end < start)) * other, HALF * other
        numbers = range(-((HALF - min(start, end)) // PX), (max(start, end) + HALF) // PX + 1)
        middles = [(n, (PX * n - start) * step) for n in numbers]
        slabs.append([(n, m - half, m + half) if step else (n, 0, last) for n, m in middles])
    found = {}
    for (y, y_in, y_out), (x, x_in, x_out) in itertools.product(slabs[1], slabs[0]):
        entry, leave = max(x_in, y_in, 0), min(x_out, y_out, last)
        if entry <= leave:
            found[x, y] = entry, leave
    return found, scale


def thick_cells(a: Point, b: Point, r: int) -> tuple[dict[Pixel, tuple[int, int]], int]:
    """Centres at most r from the segment, and the cells of the thin ray, with times over the squared length."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    found = {}
    for x, y in around(a, b, r):
        ax, ay, bx, by = PX * x - a[0], PX * y - a[1], PX * x - b[0], PX * y - b[1]
        u, cross = ax * dx + ay * dy, ax * dy - ay * dx
        end2 = ax * ax + ay * ay if u <= 0 else bx * bx + by * by
        if cross * cross <= r * r * length2 if 0 < u < length2 else end2 <= r * r:
            half = math.isqrt(r * r * length2 - cross * cross)
            found[x, y] = max(u - half, 0), min(u + half, length2)
    for cell, (entry, leave) in (thin := thin_times(a, b))[0].items():
        times = -(-entry * length2 // thin[1]), leave * length2 // thin[1]  # rounded up, rounded down
        both = found.get(cell, times)
        found[cell] = min(times[0], both[0]), max(times[1], both[1])
    return found, max(length2, 1)


def path_of(a: Point, b: Point, r: int) -> Path:
    """Cells of a ray of radius r; 0 is thin."""
    cells, scale = thick_cells(a, b, r) if r else thin_times(a, b)
    return Path(cells, scale, (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)


# Normals


def mask_normal(pixels: Collection[Pixel], cell: Pixel) -> Pixel:
    """Out of the mask about a cell, by weights (3 - |i|) * (3 - |j|); (0, 0) where it says nothing."""
    near = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if (cell[0] + i, cell[1] + j) in pixels]
    weighted = [(i, j, (3 - abs(i)) * (3 - abs(j))) for i, j in near]
    return -sum(i * w for i, _, w in weighted), -sum(j * w for _, j, w in weighted)


def entered_side(a: Point, b: Point, cell: Pixel) -> Pixel:
    """Side of its square through which a thin ray enters a cell, both at a corner, none where it starts in it."""
    entry = thin_cells(a, b)[cell][0]
    normal = []
    for start, end, centre in zip(a, b, cell, strict=True):
        sign = (end > start) - (end < start)
        entered = sign != 0 and Fraction(PX * centre - sign * HALF - start, end - start) == entry
        normal.append(-sign * entered)
    return normal[0], normal[1]


# The walk


def joined(times: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """The union of closed intervals, as intervals that are apart."""
    union: list[tuple[int, int]] = []
    for entry, leave in sorted(times):
        if union and entry <= union[-1][1]:
            union[-1] = union[-1][0], max(union[-1][1], leave)
        else:
            union.append((entry, leave))
    return union


def covered(union: Iterable[tuple[int, int]], time: Time) -> Time:
    """How much of the time before a moment lies in intervals that are apart."""
    return sum(min(leave, time) - entry for entry, leave in union if entry < time)


def normal_at(item: Item, cell: Pixel, a: Point, b: Point, r: int) -> Pixel | None:
    """Normal of an item where it is met; None where the mask says nothing and the ray is thick."""
    said = mask_normal(item.pixels, cell)
    return said if said != (0, 0) else None if r else entered_side(a, b, cell)


def outside(cell: Pixel, bounds: Bounds | None) -> bool:
    """Not a pixel of the bounds (x_min, y_min, x_max, y_max), ends included."""
    return bounds is not None and not (bounds[0] <= cell[0] <= bounds[2] and bounds[1] <= cell[1] <= bounds[3])


def left(times: Times) -> dict[Pixel, tuple[int, int]]:
    """The cells that are entered after the ray has left what it starts in."""
    end = max((leave for entry, leave in joined(times.values()) if entry == 0), default=-1)
    return {cell: time for cell, time in times.items() if time[0] > end}


@dataclass(frozen=True)
class Spending:
    """What the objects take of a budget: costs, and when the ray is inside, by id."""

    path: Path
    costs: dict[int, int]
    unions: dict[int, list[tuple[int, int]]]
    budget_256: int | None

    def spent(self, time: Time) -> Time:
        """Time inside of objects, times their costs."""
        return sum(cost * covered(self.unions[i], time) for i, cost in self.costs.items())

    def over(self, time: Time) -> bool:
        """Whether nothing of the budget is left at a time."""
        full = self.budget_256
        return full is not None and self.spent(time) ** 2 * self.path.length2 >= (full * self.path.scale) ** 2

    def used_up(self) -> Time:
        """The first time at which nothing of the budget is left."""
        moments = sorted({0, self.path.scale, *(t for both in self.path.cells.values() for t in both)})
        if self.over(0):
            return 0
        before, after = max(t for t in moments if not self.over(t)), min(t for t in moments if self.over(t))
        low, high = self.spent(before), self.spent(after)
        full = root(Fraction((int(self.budget_256 or 0) * self.path.scale) ** 2, self.path.length2))
        time = before + (full - low) * (after - before) / (high - low)
        return int(time) if time.denominator == 1 else time


def goes_through(
    path: Path, order: list[Pixel], present: Sequence[tuple[Item, Times]], spending: Spending, max_hits: int | None
) -> tuple[dict[int, list[Pixel]], int, str, Time, Item | None]:
    """Walk the cells: where each object was met, how many cells were walked, why, when and on what it ended."""
    met: dict[int, list[Pixel]] = {}
    for number, cell in enumerate(order):
        time = path.cells[cell][0]
        if spending.over(time):
            return met, number, "budget", spending.used_up(), None
        for item in (item for item, times in present if cell in times):
            if item.occluder:
                return met, number + 1, "occluder", time, item
            new = item.id not in met
            met.setdefault(item.id, []).append(cell)
            if new and len(met) == max_hits:
                return met, number + 1, "hits", time, item
    if spending.over(path.scale):
        return met, len(order), "budget", spending.used_up(), None
    return met, len(order), "range", path.scale, None


def nearest(point: Point) -> Pixel:
    """The pixel of a point; on a border the greater one."""
    return (point[0] + HALF) // PX, (point[1] + HALF) // PX


def spent_in(present: Sequence[tuple[Item, Times]], time: Time) -> Stop | None:
    """The end in the front-most object that costs something up to a time, in its first cell by (y, x)."""
    for item, times in present:
        cells = [(y, x) for (x, y), (entry, leave) in times.items() if entry < time <= leave]
        if cells and item.cost and not item.occluder:
            y, x = min(cells)
            return Stop("budget", time, item.id, (x, y))
    return None


def walk(
    a: Point, b: Point, r: int, items: Sequence[Item], *, bounds: Bounds | None = None,
    max_hits: int | None = None, budget_256: int | None = None, inside: str = "hit",
) -> Walk:  # fmt: skip
    """Walk one ray from a to b through accepted items, front to back."""
    cells = (path := path_of(a, b, r)).cells
    present = [(i, {c: cells[c] for c in i.pixels if c in cells and not outside(c, bounds)}) for i in items]
    if inside == "error" and (within := [i.id for i, times in present for entry, _ in times.values() if entry == 0]):
        raise StartsInside(*within)
    if inside == "ignore_until_exit":
        present = [(item, left(times)) for item, times in present]
    blocked = {c for item, times in present if item.occluder for c in times}
    order = sorted(cells, key=lambda c: (cells[c][0], c not in blocked, c[1], c[0]))
    unions = {item.id: joined(times.values()) for item, times in present}
    spending = Spending(path, {item.id: item.cost for item in items if not item.occluder}, unions, budget_256)
    met, walked, reason, time, ended = goes_through(path, order, present, spending, max_hits)
    by_id = {item.id: item for item in items}
    passes = []
    for place, (i, its) in enumerate(met.items()):
        last = max((cells[c][1], cells[c][0], c[1], c[0]) for c in its)
        normal, material = normal_at(by_id[i], its[0], a, b, r), path.px(covered(unions[i], time))
        out = min(last[0], time)
        passes.append(Pass(i, place, its, cells[its[0]][0], out, (last[3], last[2]), material, normal))
    if reason == "budget":
        return Walk(path, order, walked, passes, spent_in(present, time) or Stop(reason, time, None, nearest(a)))
    if ended is None:
        return Walk(path, order, walked, passes, Stop(reason, time))
    cell = order[walked - 1]
    return Walk(path, order, walked, passes, Stop(reason, time, ended.id, cell, normal_at(ended, cell, a, b, r)))
