"""Shots as JSON: a weapon by name, categories and owners by name; checked, then fired."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from planes.arrays import InputError, choice, integer, within
from planes.constants import ALL, ITEMS_MAX, POSITION_MAX, SEED_MAX
from planes.grid256 import snap
from planes.scene import Scene
from planes.schema import Either, Keys, Names, Number, Numbers, Optional, Rows, Text, Whole
from weapons.arsenal import has_no_range
from weapons.firing import fire
from weapons.hits import Hits
from weapons.weapon import Weapon

__all__ = ["AIM_MAX", "SHOT", "Order", "fire_order", "order_from_json", "orders_of"]

AIM_MAX = 10**9
"""Largest aim, degrees, either way: beyond it a float has lost the angle."""

SHOT = Keys(
    {
        "weapon": Text(),
        "at": Numbers((2,), POSITION_MAX),
        "aim": Optional(Number(-AIM_MAX, AIM_MAX)),
        "toward": Optional(Numbers((2,), POSITION_MAX)),
        "accept": Names(),
        "exclude": Rows(Either(str, Text(), Whole(0, ITEMS_MAX - 1))),
        "seed": Whole(0, SEED_MAX),
        "shot": Whole(0, 2**63 - 1),
    },
    ("weapon", "at"),
)
"""The table of a shot."""


@dataclass(frozen=True)
class Order:
    """One shot: which weapon of the arsenal, fired how; `accept` holds category names, `exclude` owner ids."""

    name: str
    weapon: Weapon
    at: tuple[float, float]
    aim: float | None = None
    toward: tuple[float, float] | None = None
    accept: tuple[str, ...] | None = None
    exclude: tuple[int, ...] = ()
    seed: int = 0
    shot: int = 0
    categories: int = ALL


def orders_of(scene: Scene, arsenal: Mapping[str, Weapon]) -> list[Order]:
    """Shots of a scene's file, numbered in their order unless they say otherwise."""
    return [order_from_json(data, scene, arsenal, f"shots[{row}]", row) for row, data in enumerate(scene.shots)]


def order_from_json(
    data: object, scene: Scene, arsenal: Mapping[str, Weapon], place: str = "shot", number: int = 0
) -> Order:
    """Check one shot.

    Parameters
    ----------
    data : JSON of the shot
    place : in front of errors
    number : of the shot, unless the JSON has one

    Raises
    ------
    InputError
        Naming the place and the field.
    """
    with within(place):
        shot = SHOT.check("shot", data)
        name = choice("weapon", shot["weapon"], arsenal)
        if shot.get("aim") is not None and shot.get("toward") is not None:
            raise InputError("aim: expected aim or toward, got both")
        if shot.get("toward") is not None and not (snap(shot["toward"]) - snap(shot["at"])).any():
            raise InputError(f"toward: expected a point other than the shot's own, got {list(shot['toward'])}")
        if shot.get("toward") is None and has_no_range(arsenal[name]):
            raise InputError("toward: expected a point, as the weapon has no range, got none")
        accept = shot.get("accept")
        return Order(
            name,
            arsenal[name],
            shot["at"],
            shot.get("aim"),
            shot.get("toward"),
            None if accept is None else tuple(accept),
            tuple(_owner(scene, value, i) for i, value in enumerate(shot.get("exclude", ()))),
            shot.get("seed", 0),
            shot.get("shot", number),
            ALL if accept is None else scene.category_bits(*accept),
        )


def fire_order(scene: Scene, order: Order, prefilter: str = "auto", broadphase: str = "auto") -> Hits:
    """Fire one shot; pre-filter and broad phase as for `fire`."""
    return fire(
        scene,
        order.weapon,
        order.at,
        aim=order.aim,
        toward=order.toward,
        accept=order.categories,
        exclude=order.exclude or None,
        seed=order.seed,
        shot=[order.shot],
        prefilter=prefilter,
        broadphase=broadphase,
    )


def _owner(scene: Scene, value: object, row: int) -> int:
    """Owner of a named object, or an owner's id."""
    with within(f"exclude[{row}]"):
        if isinstance(value, str):
            return int(scene.items.owner[scene.find(value)])
        return integer("owner", value, 0, scene.items.count - 1)
