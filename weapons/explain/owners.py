"""Rows of hits added up by owner: one event for each shot and body, whatever number of its parts were hit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from typing import NamedTuple

from hitplanes.planes.scene.items import Stack

from ..fire.hits import HitRow
from ..fire.prefilter import QueryContext
from ..fire.spans import chunks, direct
from ..kinds.placements import Shots, placements_for
from ..kinds.weapon import Weapon

Pellet = tuple[int, int, int, int]  # a pellet that hit an object: (shot, round, pellet, object)


class OwnerRow(NamedTuple):
    """One owner hit by one shot: the rows of all its objects and all rounds.

    `samples`, `pixels` and `weight` are sums of the rows. `pellets` counts each pellet once, even if it hit several
    objects. `first_xy` and `distance2` are those of the nearest row: the first by (distance2, y, x). `objects` are the
    ids of those that were hit, in the order of the rows.
    """

    shot: int
    owner: int
    samples: int
    pixels: int
    weight: int
    pellets: int
    first_xy: tuple[int, int]
    distance2: int
    objects: tuple[int, ...]


def owner_rows(
    rows: Iterable[HitRow], stack_of: Callable[[int], Stack], pellets_of: Callable[[list[int]], Iterable[Pellet]] | None
) -> list[OwnerRow]:
    """Add rows up by (shot, owner), in the order of the first row of each.

    Parameters
    ----------
    stack_of : function of a shot that returns the stack that it was fired at
    pellets_of : function of shots that returns the pellets that hit, each with each of its objects; None if a round of
        the weapon has one pellet. It is asked only about shots of which a round hit several objects of a body
    """

    @cache
    def owners(stack: Stack) -> dict[int, int]:
        return dict(zip(stack.ids.tolist(), stack.owner.tolist(), strict=True))

    def owner_of(shot: int, item: int) -> int:
        return owners(stack_of(shot))[item]

    bodies: dict[tuple[int, int], list[HitRow]] = {}
    for row in rows:
        bodies.setdefault((row.shot, owner_of(row.shot, row.object)), []).append(row)
    rounds = {body: len({row.round for row in own}) for body, own in bodies.items()}
    shared = [body for body, own in bodies.items() if rounds[body] < len(own)]
    pellets = {body: sum(row.pellets for row in own) for body, own in bodies.items()}
    if pellets_of is None:
        pellets |= {body: rounds[body] for body in shared}
    elif shared:
        found = pellets_of(sorted({shot for shot, _ in shared}))
        distinct = {(shot, owner_of(shot, item), round_, pellet) for shot, round_, pellet, item in found}
        pellets |= Counter((shot, owner) for shot, owner, _, _ in distinct)
    return [_added(*body, own, pellets[body]) for body, own in bodies.items()]


def _added(shot: int, owner: int, rows: list[HitRow], pellets: int) -> OwnerRow:
    """The row of a body."""
    samples, pixels, weight = (sum(getattr(row, name) for row in rows) for name in ("samples", "pixels", "weight"))
    nearest = min(rows, key=lambda row: (row.distance2, row.first_xy[1], row.first_xy[0]))
    objects = tuple(dict.fromkeys(row.object for row in rows))
    return OwnerRow(shot, owner, samples, pixels, weight, pellets, nearest.first_xy, nearest.distance2, objects)


def area_pellets(context: QueryContext, weapon: Weapon, shots: Shots) -> set[Pellet]:
    """Pellets of area weapons that hit, each with each of its objects; shots count from 0."""
    found: set[Pellet] = set()
    for begin, part in chunks(shots, placements_for(weapon, shots.take(0, 1)), context.candidates):
        placements = placements_for(weapon, part)
        met = direct(placements, part, context)
        of = met.placement
        turn = placements.shot[of] + begin, placements.round[of], placements.pellet[of]
        found.update(zip(*(column.tolist() for column in (*turn, context.stack.ids[met.rank])), strict=True))
    return found
