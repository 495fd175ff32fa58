"""Slow reference for what an area shot hits: the stack, walked one sample at a time.

Pixels are whole world pixels (x, y). Nothing is indexed, cached or cut short.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

__all__ = ["Item", "Walk", "at_pixel", "fire_one", "front_to_back", "refused", "tally", "walk"]

Pixel = tuple[int, int]
Row = tuple[int, int, int, int, int, Pixel, int]
VERDICTS = ("empty", "hit", "occluded", "filtered", "outside")


@dataclass(frozen=True)
class Item:
    """An object or an occluder: who it is, where in the stack, and its world pixels."""

    id: int
    occluder: bool
    layer: int
    categories: int
    owner: int
    pixels: frozenset[Pixel]


@dataclass
class Walk:
    """What a sample met: its verdict, the objects hit (front first), the items skipped, and what ended it."""

    verdict: str = "empty"
    hit: list[Item] = field(default_factory=list)
    skipped: list[Item] = field(default_factory=list)
    ended_by: Item | None = None


def front_to_back(items: Sequence[Item]) -> list[Item]:
    """Sort the stack: greater layer, then occluders before objects, then the later added.

    Parameters
    ----------
    items : in the order they were added
    """
    places = sorted(range(len(items)), key=lambda i: (-items[i].layer, not items[i].occluder, -i))
    return [items[i] for i in places]


def refused(item: Item, accept: int, blocked_by: int, exclude: Collection[int]) -> bool:
    """Tell whether the shot's filter passes over an item: `accept` an object, `blocked_by` an occluder."""
    return item.categories & (blocked_by if item.occluder else accept) == 0 or item.owner in exclude


def walk(
    covering: Iterable[Item], *, accept: int, blocked_by: int, exclude: Collection[int] = (), pierce: bool = False
) -> Walk:
    """Walk the items that cover one pixel, front to back."""
    result = Walk()
    for item in covering:
        if refused(item, accept, blocked_by, exclude):
            result.skipped.append(item)
            continue
        if not item.occluder:
            result.hit.append(item)
        if item.occluder or not pierce:
            result.ended_by = item
            break
    if result.hit:
        result.verdict = "hit"
    elif result.ended_by is not None:
        result.verdict = "occluded"
    elif result.skipped:
        result.verdict = "filtered"
    return result


def at_pixel(
    items: Sequence[Item],
    pixel: Pixel,
    *,
    accept: int,
    blocked_by: int,
    exclude: Collection[int] = (),
    pierce: bool = False,
    bounds: tuple[int, int, int, int] | None = None,
) -> Walk:
    """Judge one pixel: OUTSIDE before all, else the walk.

    Parameters
    ----------
    items : in the order they were added
    bounds : (x_min, y_min, x_max, y_max), ends included; None has no outside
    """
    if bounds is not None:
        x_min, y_min, x_max, y_max = bounds
        if not (x_min <= pixel[0] <= x_max and y_min <= pixel[1] <= y_max):
            return Walk(verdict="outside")
    covering = front_to_back([item for item in items if pixel in item.pixels])
    return walk(covering, accept=accept, blocked_by=blocked_by, exclude=exclude, pierce=pierce)


def fire_one(
    items: Sequence[Item],
    pellets: Sequence[Sequence[tuple[Pixel, int]]],
    *,
    origin_xy: Pixel,
    accept: int,
    blocked_by: int,
    exclude: Collection[int] = (),
    pierce: bool = False,
    bounds: tuple[int, int, int, int] | None = None,
) -> tuple[list[Row], Mapping[str, int]]:
    """Fire one round of one shot.

    Parameters
    ----------
    items : in the order they were added
    pellets : for each pellet its samples, (absolute pixel, weight); a weight of 0 hits all the same

    Returns
    -------
    rows : (id, samples, distinct pixels, weight, pellets that hit, first pixel, its squared distance)
        Ordered by (squared distance, y, x, place in the stack).
    counts : samples by verdict
    """
    samples = []
    for number, pellet in enumerate(pellets):
        for pixel, weight in pellet:
            sample = at_pixel(
                items, pixel, accept=accept, blocked_by=blocked_by, exclude=exclude, pierce=pierce, bounds=bounds
            )
            samples.append((number, pixel, weight, sample))
    return tally(items, samples, origin_xy)


def tally(
    items: Sequence[Item], samples: Iterable[tuple[int, Pixel, int, Walk]], origin_xy: Pixel
) -> tuple[list[Row], Mapping[str, int]]:
    """Make the rows and the counts of one round of one shot, as `fire_one` returns them.

    Parameters
    ----------
    items : in the order they were added
    samples : (number of the pellet, pixel, weight, what the sample met)
    """
    counts = dict.fromkeys(VERDICTS, 0)
    struck: dict[int, list[tuple[int, Pixel, int]]] = {}  # by id: (pellet, pixel, weight) of each sample that hit
    for number, pixel, weight, sample in samples:
        counts[sample.verdict] += 1
        for item in sample.hit:
            struck.setdefault(item.id, []).append((number, pixel, weight))

    def distance2(pixel: Pixel) -> int:
        return (pixel[0] - origin_xy[0]) ** 2 + (pixel[1] - origin_xy[1]) ** 2

    rows = []
    for item in front_to_back(items):
        samples = struck.get(item.id)
        if not samples:
            continue
        seen = {pixel for _, pixel, _ in samples}
        first = min(seen, key=lambda p: (distance2(p), p[1], p[0]))
        weight = sum(w for _, _, w in samples)
        struck_by = {number for number, _, _ in samples}
        rows.append((item.id, len(samples), len(seen), weight, len(struck_by), first, distance2(first)))
    # rows come front to back and sorting is stable, so the place in the stack decides last
    rows.sort(key=lambda row: (row[6], row[5][1], row[5][0]))
    return rows, counts
