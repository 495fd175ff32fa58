"""Slow reference for line of sight of areas: one segment for each sample, and each pixel on it asked in turn.

Pixels are whole world pixels (x, y); pixel (x, y) is the closed square [x - 1/2, x + 1/2] x [y - 1/2, y + 1/2]. A time
is an exact fraction of the segment from the centre of a pellet's own pixel, 0, to the centre of a sample, 1.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache

from oracle_rays import PX, StartsInside, left, outside, thin_cells
from oracle_stack import Item, Pixel, Row, Walk, front_to_back, refused, tally

__all__ = ["Bounds", "ShelteredWalk", "StartsInside", "blockers", "fire_sheltered", "judge", "shelters", "supercover"]

Bounds = tuple[int, int, int, int]
Pellet = tuple[Pixel, Sequence[tuple[Pixel, int]]]

BLOCKING = {None: (), "occluders": (True,), "all": (True, False)}  # by line of sight: whether a blocker is an occluder
INSIDE = ("hit", "ignore_until_exit", "error")


@dataclass
class ShelteredWalk(Walk):
    """What a sample met, and what stood on the way to it.

    `shelters` are all blockers that shelter the pixel, the one that the segment enters first before the others;
    `sheltered` are the accepted objects that were not hit for that reason, front first. `sheltered_by` tells what
    decided, and is None unless the verdict is "occluded".
    """

    shelters: list[Item] = field(default_factory=list)
    sheltered: list[Item] = field(default_factory=list)
    sheltered_by: Item | None = None


@cache
def supercover(dx: int, dy: int) -> Mapping[Pixel, tuple[Fraction, Fraction]]:
    """All pixels that the segment from (0, 0) to (dx, dy) meets, both ends too, with the times of entry and exit."""
    return thin_cells((0, 0), (PX * dx, PX * dy))


def blockers(
    items: Sequence[Item], line_of_sight: str | None, *, accept: int, blocked_by: int, exclude: Collection[int] = ()
) -> list[Item]:
    """Items that may shelter, front to back."""
    kinds = BLOCKING[line_of_sight]
    return [i for i in front_to_back(items) if i.occluder in kinds and not refused(i, accept, blocked_by, exclude)]


def entered(item: Item, o: Pixel, p: Pixel, inside: str, bounds: Bounds | None) -> Fraction | None:
    """The time at which the segment from o to p first enters a pixel of an item that counts; None if none does."""
    times = {}
    for (x, y), both in supercover(p[0] - o[0], p[1] - o[1]).items():
        cell = o[0] + x, o[1] + y
        if cell in item.pixels and not outside(cell, bounds):
            times[cell] = both
    if inside == "ignore_until_exit":
        times = left(times)
    return min((entry for cell, (entry, _) in times.items() if cell != p), default=None)


def shelters(blocking: Sequence[Item], o: Pixel, p: Pixel, *, inside: str, bounds: Bounds | None) -> list[Item]:
    """Blockers on the way from o to p, the first that is entered before the others; at equal time the front one.

    Parameters
    ----------
    blocking : front to back
    """
    times = [(entered(item, o, p, inside, bounds), item) for item in blocking]
    on_the_way = [(time, item) for time, item in times if time is not None]
    return [item for _, item in sorted(on_the_way, key=lambda pair: pair[0])]  # stable: the front stays before


def refuse_inside(blocking: Sequence[Item], origins: Collection[Pixel], bounds: Bounds | None) -> None:
    """Raise `StartsInside` with the ids, front first, of blockers that have one of the pixels."""
    ids = [i.id for i in blocking if any(o in i.pixels and not outside(o, bounds) for o in origins)]
    if ids:
        raise StartsInside(*ids)


def judge(
    items: Sequence[Item],
    o: Pixel,
    p: Pixel,
    *,
    line_of_sight: str | None,
    inside: str = "hit",
    accept: int,
    blocked_by: int,
    exclude: Collection[int] = (),
    pierce: bool = False,
    bounds: Bounds | None = None,
) -> ShelteredWalk:
    """Judge one pixel p of a pellet whose own pixel is o.

    Parameters
    ----------
    items : in the order they were added
    line_of_sight : None, "occluders" or "all"
    inside : "hit", "ignore_until_exit" or "error"
    bounds : (x_min, y_min, x_max, y_max), ends included; None has no outside

    Raises
    ------
    StartsInside
        If inside is "error" and blockers have o as a pixel: their ids, front first.
    """
    assert inside in INSIDE
    blocking = blockers(items, line_of_sight, accept=accept, blocked_by=blocked_by, exclude=exclude)
    if inside == "error":
        refuse_inside(blocking, [o], bounds)
    if outside(p, bounds):
        return ShelteredWalk(verdict="outside")
    result = ShelteredWalk(shelters=shelters(blocking, o, p, inside=inside, bounds=bounds))
    for item in front_to_back([item for item in items if p in item.pixels]):
        if refused(item, accept, blocked_by, exclude):
            result.skipped.append(item)
            continue
        if not item.occluder:
            alone = all(other is item for other in result.shelters)
            (result.hit if alone else result.sheltered).append(item)
        if item.occluder or not pierce:
            result.ended_by = item
            break
    if result.hit:
        result.verdict = "hit"
    elif result.shelters or result.ended_by is not None:
        result.verdict = "occluded"
        first = result.sheltered[:1]
        result.sheltered_by = next((item for item in result.shelters if item not in first), None)
    elif result.skipped:
        result.verdict = "filtered"
    return result


def fire_sheltered(
    items: Sequence[Item],
    pellets: Sequence[Pellet],
    *,
    origin_xy: Pixel,
    line_of_sight: str | None,
    inside: str = "hit",
    accept: int,
    blocked_by: int,
    exclude: Collection[int] = (),
    pierce: bool = False,
    bounds: Bounds | None = None,
) -> tuple[list[Row], Mapping[str, int]]:
    """Fire one round of one shot.

    Parameters
    ----------
    items : in the order they were added
    pellets : for each pellet its own pixel and its samples, (absolute pixel, weight)
    origin_xy : the shot's pixel, from which distances are measured

    Returns
    -------
    rows, counts : as of `oracle_stack.fire_one`

    Raises
    ------
    StartsInside
        If inside is "error" and blockers have the own pixel of a pellet: their ids, front first.
    """
    if inside == "error":
        blocking = blockers(items, line_of_sight, accept=accept, blocked_by=blocked_by, exclude=exclude)
        refuse_inside(blocking, [own for own, _ in pellets], bounds)
    samples = []
    for number, (own, pellet) in enumerate(pellets):
        for pixel, weight in pellet:
            sample = judge(
                items, own, pixel, line_of_sight=line_of_sight, inside=inside, accept=accept, blocked_by=blocked_by,
                exclude=exclude, pierce=pierce, bounds=bounds,
            )  # fmt: skip
            samples.append((number, pixel, weight, sample))
    return tally(items, samples, origin_xy)
